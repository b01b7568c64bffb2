use std::str::FromStr;

use ohmstrain_calib::GaugeFamily;
use ohmstrain_sensor::EstimatorKind;

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

/// A family of gauge curves.
#[derive(Clone, Copy, Debug)]
pub struct Gauge(pub GaugeFamily);

impl FromStr for Gauge {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = GaugeFamily::ALL.into_iter().find(|family| family.name() == text);
        found.map(Self).ok_or_else(|| "expected auto, polynomial, decaying-exponential or tunnelling".into())
    }
}

/// An estimator.
#[derive(Clone, Copy, Debug)]
pub struct Estimator(pub EstimatorKind);

impl FromStr for Estimator {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let names: Vec<&str> = EstimatorKind::ALL.iter().map(|kind| kind.name()).collect();
        EstimatorKind::ALL
            .into_iter()
            .find(|kind| kind.name() == text)
            .map(Self)
            .ok_or_else(|| format!("expected auto or {}", names.join(", ")))
    }
}
