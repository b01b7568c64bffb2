use std::str::FromStr;

use ohmstrain_calib::TemperatureCoefficients;

/// Largest relative change per kelvin.
const LARGEST_PER_K: f64 = 0.1;

/// `auto`, or a value.
#[derive(Clone, Copy, Debug)]
pub enum Auto<T> {
    /// Let the program choose.
    Auto,
    /// Chosen.
    Chosen(T),
}

impl<T> Auto<T> {
    /// The choice, if one was made.
    pub fn chosen(self) -> Option<T> {
        match self {
            Self::Auto => None,
            Self::Chosen(value) => Some(value),
        }
    }
}

impl<T: FromStr<Err = String>> FromStr for Auto<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" { Ok(Self::Auto) } else { text.parse().map(Self::Chosen) }
    }
}

/// A number of branches.
#[derive(Clone, Copy, Debug)]
pub struct Branches(pub usize);

impl FromStr for Branches {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(count @ 0..=4) => Ok(Self(count)),
            _ => Err("expected auto or 0 to 4".into()),
        }
    }
}

/// Coefficients of temperature, A:SD or A:SD,B:SD.
#[derive(Clone, Copy, Debug)]
pub struct Coefficients(pub TemperatureCoefficients);

impl FromStr for Coefficients {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let coefficient = |text: &str| -> Option<(f64, f64)> {
            let (value, sd) = text.split_once(':')?;
            let (value, sd) = (value.parse().ok()?, sd.parse().ok()?);
            (f64::abs(value) <= LARGEST_PER_K && (0.0..=LARGEST_PER_K).contains(&sd)).then_some((value, sd))
        };
        let (rest, gain) = text.split_once(',').unwrap_or((text, "0:0"));
        let both = coefficient(rest).zip(coefficient(gain));
        both.map(|(rest_per_k, gain_per_k)| Self(TemperatureCoefficients { rest_per_k, gain_per_k })).ok_or_else(|| {
            format!("expected A:SD or A:SD,B:SD, changes per kelvin up to {LARGEST_PER_K} and their deviations, e.g. 0.003:0.0005")
        })
    }
}
