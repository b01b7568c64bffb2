//! A climate chamber around the sensor, and the thermometer in it.

use std::fmt;
use std::str::FromStr;

use super::settings::{SettingsError, within};
use crate::error::SpecError;
use crate::spec::Pairs;

/// Temperature at which the chamber has no effect, °C.
const NEUTRAL_C: f64 = 25.0;
/// Time by which the sensor's temperature is behind the chamber's, s.
const BEHIND_S: f64 = 20.0;
/// Self-heating by the current of the measurement, K, and the time in which it develops, s.
const SELF_HEATING_K: f64 = 0.5;
const SELF_HEATING_S: f64 = 60.0;

/// Ramps of a climate chamber: `low_c=10 high_c=40 period_s=1200 rest_per_k=0.003 gain_per_k=-0.002`. The temperature rises from the
/// lowest to the highest and falls again, period by period. The thermometer shows the chamber's temperature, to 0.1 K; the sensor's
/// is 20 s behind it, and up to 0.5 K above it by self-heating.
///
/// The resistance is `R₀ (1 + α_R ΔT) (1 + ρ (1 + α_ρ ΔT))`, with ΔT from 25 °C. The coefficients are invented.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chamber {
    /// Lowest temperature, °C.
    pub low_c: f64,
    /// Highest temperature, °C.
    pub high_c: f64,
    /// Time from one lowest temperature to the next, s.
    pub period_s: f64,
    /// Relative change of R₀ per kelvin, α_R.
    pub rest_per_k: f64,
    /// Relative change per kelvin of the change with strain, α_ρ.
    pub gain_per_k: f64,
}

impl Default for Chamber {
    fn default() -> Self {
        Self { low_c: 10.0, high_c: 40.0, period_s: 1200.0, rest_per_k: 0.003, gain_per_k: -0.002 }
    }
}

impl FromStr for Chamber {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Self, SpecError> {
        let pairs = Pairs::parse(text, &["low_c", "high_c", "period_s", "rest_per_k", "gain_per_k"])?;
        let usual = Self::default();
        let chamber = Self {
            low_c: pairs.number_or("low_c", usual.low_c)?,
            high_c: pairs.number_or("high_c", usual.high_c)?,
            period_s: pairs.number_or("period_s", usual.period_s)?,
            rest_per_k: pairs.number_or("rest_per_k", usual.rest_per_k)?,
            gain_per_k: pairs.number_or("gain_per_k", usual.gain_per_k)?,
        };
        chamber
            .validate()
            .map_err(|error| SpecError::new("temperatures, a period and coefficients", error.to_string()))?;
        Ok(chamber)
    }
}

impl fmt::Display for Chamber {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { low_c, high_c, period_s, rest_per_k, gain_per_k } = self;
        write!(out, "low_c={low_c} high_c={high_c} period_s={period_s} rest_per_k={rest_per_k} gain_per_k={gain_per_k}")
    }
}

impl Chamber {
    pub(super) fn validate(&self) -> Result<(), SettingsError> {
        within("low_c", self.low_c, -60.0, 200.0)?;
        within("high_c", self.high_c, self.low_c, 200.0)?;
        within("period_s", self.period_s, 1.0, 1e6)?;
        within("rest_per_k", self.rest_per_k, -0.01, 0.01)?;
        within("gain_per_k", self.gain_per_k, -0.01, 0.01)
    }

    /// Returns the chamber's temperature, °C.
    pub(super) fn at(&self, time_s: f64) -> f64 {
        let phase = (time_s / self.period_s).rem_euclid(1.0);
        self.low_c + (self.high_c - self.low_c) * (1.0 - (2.0 * phase - 1.0).abs())
    }
}

/// The sensor in the chamber.
pub(super) struct WarmedSensor {
    chamber: Chamber,
    time_s: f64,
    /// Temperature that the chamber has passed on to the sensor so far, °C.
    passed_on_c: f64,
}

impl WarmedSensor {
    pub(super) fn new(chamber: Chamber) -> Self {
        Self { chamber, time_s: 0.0, passed_on_c: chamber.at(0.0) }
    }

    /// Advances to a time, s, and returns the resistance over R₀ at 25 °C, given that without a chamber.
    pub(super) fn resistance(&mut self, time_s: f64, relative: f64) -> f64 {
        let kept = (-(time_s - self.time_s) / BEHIND_S).exp();
        self.passed_on_c = self.chamber.at(time_s) + kept * (self.passed_on_c - self.chamber.at(time_s));
        self.time_s = time_s;
        let own_k = SELF_HEATING_K * -(-time_s / SELF_HEATING_S).exp_m1();
        let above_k = self.passed_on_c + own_k - NEUTRAL_C;
        let Chamber { rest_per_k, gain_per_k, .. } = self.chamber;
        (1.0 + rest_per_k * above_k) * (1.0 + (relative - 1.0) * (1.0 + gain_per_k * above_k))
    }
}
