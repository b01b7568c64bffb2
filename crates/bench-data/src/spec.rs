use std::fmt;
use std::str::FromStr;

use ohmstrain_model::{ConstantCurrent, Divider, FrontEnd, Joint, ParameterError, SensorSide};

use crate::error::{SpecError, quote};

/// A front end as written in files and flags; [`build`](Self::build) makes the corresponding model.
///
/// ```
/// use ohmstrain_bench_data::FrontEndSpec;
/// let text = "divider reference_ohm=10000 side=low bits=12 noise_codes=0.5";
/// let spec: FrontEndSpec = text.parse()?;
/// assert_eq!(spec.to_string(), text);
/// # Ok::<(), ohmstrain_bench_data::SpecError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrontEndSpec {
    /// `divider reference_ohm=10000 side=low|high bits=12 noise_codes=0.5`.
    Divider {
        /// The known resistor, Ω.
        reference_ohm: f64,
        /// Position of the sensor.
        side: SensorSide,
        /// Resolution of the converter.
        bits: u32,
        /// Standard deviation of the converter's own noise, codes; 0 if not given.
        noise_codes: f64,
    },
    /// `constant-current current_a=1e-4 gain=10 full_scale_v=3.3 bits=12 noise_codes=0.5`.
    ConstantCurrent {
        /// Current through the sensor, A.
        current_a: f64,
        /// Amplification of its voltage.
        gain: f64,
        /// Voltage of the largest code, V.
        full_scale_v: f64,
        /// Resolution of the converter.
        bits: u32,
        /// Standard deviation of the converter's own noise, codes; 0 if not given.
        noise_codes: f64,
    },
}

impl FrontEndSpec {
    /// Makes the front end that converts codes.
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn build(&self) -> Result<FrontEnd<f64>, ParameterError> {
        match *self {
            Self::Divider { reference_ohm, side, bits, noise_codes } => {
                Divider::new(reference_ohm, side, bits, noise_codes).map(FrontEnd::Divider)
            }
            Self::ConstantCurrent { current_a, gain, full_scale_v, bits, noise_codes } => {
                ConstantCurrent::new(current_a, gain, full_scale_v, bits, noise_codes).map(FrontEnd::ConstantCurrent)
            }
        }
    }

    /// Returns the resolution of the converter, bits.
    #[must_use]
    pub const fn bits(&self) -> u32 {
        match *self {
            Self::Divider { bits, .. } | Self::ConstantCurrent { bits, .. } => bits,
        }
    }

    /// Returns the standard deviation of the converter's own noise, codes.
    #[must_use]
    pub const fn noise_codes(&self) -> f64 {
        match *self {
            Self::Divider { noise_codes, .. } | Self::ConstantCurrent { noise_codes, .. } => noise_codes,
        }
    }
}

impl FromStr for FrontEndSpec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let (kind, rest) = text.trim().split_once(char::is_whitespace).unwrap_or((text.trim(), ""));
        let spec = match kind {
            "divider" => {
                let pairs = Pairs::parse(rest, &["reference_ohm", "side", "bits", "noise_codes"])?;
                Self::Divider {
                    reference_ohm: pairs.number("reference_ohm")?,
                    side: match pairs.get("side")? {
                        "low" => SensorSide::Low,
                        "high" => SensorSide::High,
                        other => return Err(SpecError::new("`side` to be low or high", quote(other))),
                    },
                    bits: pairs.bits()?,
                    noise_codes: pairs.number_or("noise_codes", 0.0)?,
                }
            }
            "constant-current" => {
                let pairs = Pairs::parse(rest, &["current_a", "gain", "full_scale_v", "bits", "noise_codes"])?;
                Self::ConstantCurrent {
                    current_a: pairs.number("current_a")?,
                    gain: pairs.number("gain")?,
                    full_scale_v: pairs.number("full_scale_v")?,
                    bits: pairs.bits()?,
                    noise_codes: pairs.number_or("noise_codes", 0.0)?,
                }
            }
            other => return Err(SpecError::new("a front end `divider …` or `constant-current …`", quote(other))),
        };
        spec.build().map_err(|error| impossible(error, text))?;
        Ok(spec)
    }
}

impl fmt::Display for FrontEndSpec {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Divider { reference_ohm, side, bits, noise_codes } => {
                let side = if *side == SensorSide::Low { "low" } else { "high" };
                write!(out, "divider reference_ohm={reference_ohm} side={side} bits={bits} noise_codes={noise_codes}")
            }
            Self::ConstantCurrent { current_a, gain, full_scale_v, bits, noise_codes } => write!(
                out,
                "constant-current current_a={current_a} gain={gain} full_scale_v={full_scale_v} bits={bits} \
                 noise_codes={noise_codes}"
            ),
        }
    }
}

/// A joint as written in files and flags: `prestrain=0.05 moment_arm_mm=4.4 gauge_length_mm=30`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSpec {
    /// Strain at angle zero.
    pub prestrain: f64,
    /// Distance of the sensor from the joint's axis, mm; may be negative, not zero.
    pub moment_arm_mm: f64,
    /// Length of the unstretched sensor, mm.
    pub gauge_length_mm: f64,
}

impl JointSpec {
    /// Makes the joint that maps angles to strains.
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn build(&self) -> Result<Joint<f64>, ParameterError> {
        Joint::new(self.prestrain, self.moment_arm_mm, self.gauge_length_mm)
    }
}

impl FromStr for JointSpec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let pairs = Pairs::parse(text, &["prestrain", "moment_arm_mm", "gauge_length_mm"])?;
        let spec = Self {
            prestrain: pairs.number("prestrain")?,
            moment_arm_mm: pairs.number("moment_arm_mm")?,
            gauge_length_mm: pairs.number("gauge_length_mm")?,
        };
        spec.build().map_err(|error| impossible(error, text))?;
        Ok(spec)
    }
}

impl fmt::Display for JointSpec {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { prestrain, moment_arm_mm, gauge_length_mm } = self;
        write!(out, "prestrain={prestrain} moment_arm_mm={moment_arm_mm} gauge_length_mm={gauge_length_mm}")
    }
}

fn impossible(error: ParameterError, text: &str) -> SpecError {
    SpecError::new(format!("possible parameters ({error})"), quote(text))
}

/// `key=value` pairs separated by blanks.
pub(crate) struct Pairs<'a>(Vec<(&'a str, &'a str)>);

impl<'a> Pairs<'a> {
    pub(crate) fn parse(text: &'a str, known: &[&str]) -> Result<Self, SpecError> {
        let mut pairs: Vec<(&str, &str)> = Vec::new();
        for word in text.split_whitespace() {
            let wanted = || format!("`key=value` with the key one of {}", known.join(", "));
            let (key, value) = word.split_once('=').ok_or_else(|| SpecError::new(wanted(), quote(word)))?;
            if !known.contains(&key) {
                return Err(SpecError::new(wanted(), quote(word)));
            }
            if pairs.iter().any(|(earlier, _)| *earlier == key) {
                return Err(SpecError::new(format!("`{key}` once"), "it twice"));
            }
            pairs.push((key, value));
        }
        Ok(Self(pairs))
    }

    fn find(&self, key: &str) -> Option<&'a str> {
        self.0.iter().find(|(k, _)| *k == key).map(|(_, value)| *value)
    }

    fn get(&self, key: &str) -> Result<&'a str, SpecError> {
        self.find(key).ok_or_else(|| SpecError::new(format!("`{key}=…`"), "none"))
    }

    fn number(&self, key: &str) -> Result<f64, SpecError> {
        let text = self.get(key)?;
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(SpecError::new(format!("`{key}` to be a finite number"), quote(text))),
        }
    }

    pub(crate) fn number_or(&self, key: &str, default: f64) -> Result<f64, SpecError> {
        if self.find(key).is_some() { self.number(key) } else { Ok(default) }
    }

    fn bits(&self) -> Result<u32, SpecError> {
        let text = self.get("bits")?;
        text.parse().map_err(|_| SpecError::new("`bits` to be a whole number", quote(text)))
    }
}
