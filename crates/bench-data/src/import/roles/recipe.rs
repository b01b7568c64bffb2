use std::fmt;
use std::str::FromStr;

use crate::import::roles::preset::Preset;
use crate::import::table::{ReadOptions, RowFilter};
use crate::import::words::{DecimalMark, Role};
use crate::{FrontEndSpec, JointSpec};

/// A flag's value that is not valid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct RecipeError(String);

/// Column named by a flag: `Time (s)`, `3` or, with two files, `2:Position`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnName {
    /// The file, counted from 1, if it is named.
    pub file: Option<usize>,
    /// Heading, name or number (from 1) of the column; `none` for no column.
    pub column: String,
}

impl ColumnName {
    /// True if no column is to be used.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.file.is_none() && self.column == NO_COLUMN
    }
}

/// Name that stands for no column.
pub(crate) const NO_COLUMN: &str = "none";

impl fmt::Display for ColumnName {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.file {
            Some(file) => write!(out, "{file}:{}", self.column),
            None => out.write_str(&self.column),
        }
    }
}

impl FromStr for ColumnName {
    type Err = RecipeError;

    fn from_str(text: &str) -> Result<Self, RecipeError> {
        let (file, column) = file_and_rest(text);
        if column.is_empty() {
            return Err(RecipeError("expected the name or the number of a column".into()));
        }
        Ok(Self { file, column: column.to_owned() })
    }
}

/// Splits `2:rest` into its parts; files are counted from 1.
fn file_and_rest(text: &str) -> (Option<usize>, &str) {
    match text.split_once(':') {
        Some((file, rest)) if file.len() <= 2 => match file.parse() {
            Ok(file @ 1..) => (Some(file), rest),
            _ => (None, text),
        },
        _ => (None, text),
    }
}

/// A value for all files, or for one of them: `;` or `2:,`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PerFile<T> {
    /// The file, counted from 1, if the value applies to one only.
    pub file: Option<usize>,
    /// The value.
    pub value: T,
}

impl<T> PerFile<T> {
    /// True if it applies to a file, counted from 0.
    fn is_for(&self, file: usize) -> bool {
        self.file.is_none_or(|named| named == file + 1)
    }
}

impl<T: FromStr> FromStr for PerFile<T>
where
    T::Err: fmt::Display,
{
    type Err = RecipeError;

    fn from_str(text: &str) -> Result<Self, RecipeError> {
        let (file, value) = file_and_rest(text);
        let value = value.parse().map_err(|error: T::Err| RecipeError(error.to_string()))?;
        Ok(Self { file, value })
    }
}

/// Alignment of the reference's clock with that of the readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Align {
    /// Both are one clock.
    None,
    /// Alignment by the motion, which both files contain.
    Motion,
    /// Offset, s, added to the reference's clock.
    Seconds(f64),
}

impl fmt::Display for Align {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => out.write_str("none"),
            Self::Motion => out.write_str("motion"),
            Self::Seconds(seconds) => write!(out, "{seconds}"),
        }
    }
}

impl FromStr for Align {
    type Err = RecipeError;

    fn from_str(text: &str) -> Result<Self, RecipeError> {
        match (text, text.parse::<f64>()) {
            ("none", _) => Ok(Self::None),
            ("motion", _) => Ok(Self::Motion),
            (_, Ok(seconds)) if seconds.is_finite() => Ok(Self::Seconds(seconds)),
            _ => Err(RecipeError("expected motion, none or a number of seconds".into())),
        }
    }
}

/// Answers about files that are given in advance; others are inferred or asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recipe {
    /// A known layout.
    pub preset: Option<Preset>,
    /// Columns and their roles.
    pub columns: Vec<(Role, ColumnName)>,
    /// Units of columns.
    pub units: Vec<(Role, String)>,
    /// Decimal marks.
    pub decimal: Vec<PerFile<DecimalMark>>,
    /// Number of lines above header and data.
    pub skip: Vec<PerFile<usize>>,
    /// The sheet of a workbook.
    pub sheet: Option<String>,
    /// Filters of rows; a row must pass all of them.
    pub rows: Vec<PerFile<RowFilter>>,
    /// Recording, counted from 1, of a file in which the clock restarts.
    pub recording: Option<usize>,
    /// Texts that stand for missing values.
    pub missing: Vec<String>,
    /// Roles whose sign is arbitrary.
    pub magnitude: Vec<Role>,
    /// Roles in which a lone 0 between larger values is a missing value.
    pub drop_zeros: Vec<Role>,
    /// Values of columns at rest, in their own units.
    pub zero: Vec<(Role, f64)>,
    /// True if neighbouring readings were taken with opposite currents; their means are the readings.
    pub fold_polarity: bool,
    /// Alignment of two clocks.
    pub align: Option<Align>,
    /// Rows per second, if there is no time.
    pub rate_hz: Option<f64>,
    /// Length of the unstretched sensor, mm.
    pub gauge_length_mm: Option<f64>,
    /// Electronics.
    pub front_end: Option<FrontEndSpec>,
    /// Joint.
    pub joint: Option<JointSpec>,
}

impl Recipe {
    /// Returns the options for reading a file, counted from 0.
    #[must_use]
    pub fn read_options(&self, file: usize) -> ReadOptions {
        ReadOptions {
            decimal: for_file(&self.decimal, file),
            skip: for_file(&self.skip, file),
            sheet: self.sheet.clone(),
            rows: self.rows.iter().filter(|rows| rows.is_for(file)).map(|rows| rows.value.clone()).collect(),
        }
    }

    /// Returns the recipe completed by its preset.
    pub(crate) fn completed(&self) -> Self {
        let mut out = self.clone();
        let Some(preset) = self.preset else { return out };
        let has_reference = Role::REFERENCES.iter().any(|role| self.column(*role).is_some());
        for (role, column, unit) in preset.columns() {
            if self.column(role).is_none() && !(role == Role::Displacement && has_reference) {
                out.columns.push((role, ColumnName { file: None, column: column.to_string() }));
            }
            if self.unit(role).is_none() {
                out.units.push((role, unit.to_owned()));
            }
        }
        out.magnitude.extend([Role::Resistance, Role::Displacement]);
        out.drop_zeros.push(Role::Displacement);
        out.fold_polarity = true;
        out.gauge_length_mm = self.gauge_length_mm.or(Some(preset.gauge_length_mm()));
        out
    }

    /// Returns the column given for a role; `Some(None)` if there is none by request.
    pub(crate) fn column(&self, role: Role) -> Option<Option<&ColumnName>> {
        let (_, name) = self.columns.iter().rev().find(|(of, _)| *of == role)?;
        Some(Some(name).filter(|name| !name.is_none()))
    }

    pub(crate) fn unit(&self, role: Role) -> Option<&str> {
        self.units.iter().rev().find(|(of, _)| *of == role).map(|(_, unit)| unit.as_str())
    }

    /// Returns the flags of the recipe, each as one word of a command line, unquoted.
    #[must_use]
    pub fn arguments(&self) -> Vec<String> {
        let mut out = Vec::new();
        let mut flag = |name: &str, value: String| out.extend([format!("--{name}"), value]);
        if let Some(preset) = self.preset {
            flag("preset", preset.to_string());
        }
        self.columns.iter().for_each(|(role, name)| flag("column", format!("{role}={name}")));
        self.units.iter().for_each(|(role, unit)| flag("unit", format!("{role}={unit}")));
        self.decimal.iter().for_each(|mark| flag("decimal", per_file(mark)));
        self.skip.iter().for_each(|skip| flag("skip", per_file(skip)));
        self.sheet.iter().for_each(|sheet| flag("sheet", sheet.clone()));
        self.rows.iter().for_each(|rows| flag("where", per_file(rows)));
        self.recording.iter().for_each(|number| flag("recording", number.to_string()));
        self.missing.iter().for_each(|text| flag("missing", text.clone()));
        self.magnitude.iter().for_each(|role| flag("magnitude", role.to_string()));
        self.drop_zeros.iter().for_each(|role| flag("drop-zeros", role.to_string()));
        self.zero.iter().for_each(|(role, zero)| flag("zero", format!("{role}={zero}")));
        self.align.iter().for_each(|align| flag("align", align.to_string()));
        self.rate_hz.iter().for_each(|rate| flag("rate-hz", rate.to_string()));
        self.gauge_length_mm.iter().for_each(|length| flag("gauge-length-mm", length.to_string()));
        self.front_end.iter().for_each(|front_end| flag("front-end", front_end.to_string()));
        self.joint.iter().for_each(|joint| flag("joint", joint.to_string()));
        if self.fold_polarity {
            out.push("--fold-polarity".to_owned());
        }
        out
    }
}

/// Returns the last value given for a file, counted from 0.
fn for_file<T: Copy>(values: &[PerFile<T>], file: usize) -> Option<T> {
    values.iter().rev().find(|value| value.is_for(file)).map(|value| value.value)
}

fn per_file<T: fmt::Display>(value: &PerFile<T>) -> String {
    match value.file {
        Some(file) => format!("{file}:{}", value.value),
        None => value.value.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_may_name_their_file() {
        let column = |text: &str| text.parse::<ColumnName>().unwrap();
        assert_eq!(column("Time (s)"), ColumnName { file: None, column: "Time (s)".into() });
        assert_eq!(column("2:Position"), ColumnName { file: Some(2), column: "Position".into() });
        assert_eq!(column("a:b").file, None);
        assert!(column("none").is_none());
        assert!("".parse::<ColumnName>().is_err());
    }

    #[test]
    fn an_answer_for_one_file_applies_to_it_alone() {
        let skip = |text: &str| text.parse::<PerFile<usize>>().unwrap();
        let recipe = Recipe { skip: vec![skip("3"), skip("2:5")], ..Recipe::default() };
        assert_eq!(recipe.read_options(0).skip, Some(3));
        assert_eq!(recipe.read_options(1).skip, Some(5));
        assert!("2:x".parse::<PerFile<usize>>().is_err());
    }
}
