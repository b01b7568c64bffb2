use std::fmt;
use std::str::FromStr;

use crate::error::{Fault, SpecError, quote};
use crate::spec::{FrontEndSpec, JointSpec};

/// Metadata of a trace, one `# key = value` line each, above the header.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// `material`: the material of the sensor.
    pub material: Option<String>,
    /// `gauge_length_mm`: length of the unstretched sensor, mm, positive.
    pub gauge_length_mm: Option<f64>,
    /// `front_end`: the electronics between sensor and number.
    pub front_end: Option<FrontEndSpec>,
    /// `joint`: the joint that the sensor spans.
    pub joint: Option<JointSpec>,
    /// `strain_unit`: unit of the column `strain`; a fraction by default.
    pub strain_unit: Option<StrainUnit>,
    /// `resistance_unit`: unit of the column `resistance_ohm`; Ω by default.
    pub resistance_unit: Option<ResistanceUnit>,
    /// All other keys and their values, in the file's order.
    pub other: Vec<(String, String)>,
}

/// Unit of the column `strain`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StrainUnit {
    /// Fraction of the length, ΔL/L₀.
    Fraction,
    /// Per cent of the length.
    Percent,
}

/// Unit of the column `resistance_ohm`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResistanceUnit {
    /// Ω.
    Ohm,
    /// kΩ.
    Kohm,
}

impl StrainUnit {
    /// Returns its name in files and flags.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fraction => "fraction",
            Self::Percent => "percent",
        }
    }

    /// Returns the factor from a number in the file to a fraction, or to Ω.
    #[must_use]
    pub const fn factor(self) -> f64 {
        match self {
            Self::Fraction => 1.0,
            Self::Percent => 0.01,
        }
    }
}

impl ResistanceUnit {
    /// Returns its name in files and flags.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ohm => "ohm",
            Self::Kohm => "kohm",
        }
    }

    /// Returns the factor from a number in the file to a fraction, or to Ω.
    #[must_use]
    pub const fn factor(self) -> f64 {
        match self {
            Self::Ohm => 1.0,
            Self::Kohm => 1000.0,
        }
    }
}

impl FromStr for StrainUnit {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let found = [Self::Fraction, Self::Percent].into_iter().find(|unit| unit.name() == text);
        found.ok_or_else(|| SpecError::new("`strain_unit` to be `fraction` or `percent`", quote(text)))
    }
}

impl FromStr for ResistanceUnit {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let found = [Self::Ohm, Self::Kohm].into_iter().find(|unit| unit.name() == text);
        found.ok_or_else(|| SpecError::new("`resistance_unit` to be `ohm` or `kohm`", quote(text)))
    }
}

/// Largest number of other keys, which are kept without a meaning: a bound on memory, far above normal use.
const MOST_OTHER: usize = 1000;

impl Metadata {
    /// Keys with a meaning in a trace.
    pub(crate) const KEYS: [&str; 6] =
        ["material", "gauge_length_mm", "front_end", "joint", "strain_unit", "resistance_unit"];
    /// Key of the clock's unit. Only its value `s` has a meaning.
    pub const TIME_UNIT: &str = "time_unit";

    /// Returns the metadata with the units of numbers after reading, if a file states units. Without a column `strain` that
    /// of strains is kept, for marks.
    pub(crate) fn in_own_units(&self, has_strain: bool) -> Self {
        Self {
            strain_unit: self.strain_unit.map(|unit| if has_strain { StrainUnit::Fraction } else { unit }),
            resistance_unit: self.resistance_unit.map(|_| ResistanceUnit::Ohm),
            ..self.clone()
        }
    }

    /// Sets `made_by`: the program that made the recording, in place of any other.
    pub fn set_made_by(&mut self, made_by: &str) {
        self.other.retain(|(key, _)| key != "made_by");
        self.other.push(("made_by".into(), made_by.into()));
    }

    /// Takes the values that `overrides` has, and keeps the others.
    pub fn override_with(&mut self, overrides: &Self) {
        fn take<T: Clone>(mine: &mut Option<T>, theirs: &Option<T>) {
            if theirs.is_some() {
                mine.clone_from(theirs);
            }
        }
        take(&mut self.material, &overrides.material);
        take(&mut self.gauge_length_mm, &overrides.gauge_length_mm);
        take(&mut self.front_end, &overrides.front_end);
        take(&mut self.joint, &overrides.joint);
        take(&mut self.strain_unit, &overrides.strain_unit);
        take(&mut self.resistance_unit, &overrides.resistance_unit);
        for (key, value) in &overrides.other {
            self.other.retain(|(mine, _)| mine != key);
            self.other.push((key.clone(), value.clone()));
        }
    }

    /// Parses a line that starts with `#`. One without `=` is a remark and is ignored.
    pub(crate) fn take_line(&mut self, line: &str) -> Result<(), Fault> {
        let Some((key, value)) = line.trim_start_matches('#').split_once('=') else { return Ok(()) };
        let (key, value) = (key.trim(), value.trim());
        match key {
            "material" => once(&mut self.material, key, value.to_owned()),
            "gauge_length_mm" => once(&mut self.gauge_length_mm, key, length_mm(value)?),
            "front_end" => once(&mut self.front_end, key, value.parse()?),
            "joint" => once(&mut self.joint, key, value.parse()?),
            "strain_unit" => once(&mut self.strain_unit, key, value.parse()?),
            "resistance_unit" => once(&mut self.resistance_unit, key, value.parse()?),
            _ if self.other.len() == MOST_OTHER => Err(Fault::new(
                format!("at most {MOST_OTHER} lines `# key = value`, and then a header"),
                "more of them",
            )),
            _ => {
                self.other.push((key.to_owned(), value.to_owned()));
                Ok(())
            }
        }
    }
}

fn once<T>(place: &mut Option<T>, key: &str, value: T) -> Result<(), Fault> {
    if place.replace(value).is_some() {
        return Err(Fault::new(format!("`# {key} = …` once"), "it a second time"));
    }
    Ok(())
}

fn length_mm(text: &str) -> Result<f64, Fault> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err(Fault::new("`gauge_length_mm` to be a positive number of millimetres", quote(text))),
    }
}

/// Writes the lines as above a header, each with its end.
impl fmt::Display for Metadata {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let known = [
            self.material.clone(),
            self.gauge_length_mm.map(|length| length.to_string()),
            self.front_end.map(|front_end| front_end.to_string()),
            self.joint.map(|joint| joint.to_string()),
            self.strain_unit.map(|unit| unit.name().to_owned()),
            self.resistance_unit.map(|unit| unit.name().to_owned()),
        ];
        let known = Self::KEYS.into_iter().zip(&known).filter_map(|(key, value)| Some((key, value.as_ref()?)));
        let other = self.other.iter().map(|(key, value)| (key.as_str(), value));
        // A line break in a value would end the comment and become a row.
        known
            .chain(other)
            .try_for_each(|(key, value)| writeln!(out, "# {key} = {}", value.replace(char::is_control, " ")))
    }
}
