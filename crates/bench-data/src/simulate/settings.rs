use super::{Chamber, Disturbances, Followed, GAUGE_LENGTH_MM, Material, Protocol};
use crate::spec::FrontEndSpec;

/// Largest number of rows in a simulated recording: a typing error must not fill the memory.
const MOST_ROWS: f64 = 1e7;

/// Settings of a simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulationSettings {
    /// Material of the sensor.
    pub material: Material,
    /// Movements of the bench.
    pub protocol: Protocol,
    /// A person who follows a protocol, in place of the bench's movements; default `None`.
    pub followed: Option<Followed>,
    /// Full stretch, mm on 30 mm, above 0 and at most 15; default 10.
    pub elongation_mm: f64,
    /// Speed of the machine, mm/s, 0.01 to 100; default 1. The largest speed in [`Protocol::LongHolds`] and [`Protocol::Mixed`].
    pub speed_mm_s: f64,
    /// Readings per second, 0.1 to 10 000; default 20.
    pub sample_rate_hz: f64,
    /// True if the sensor follows a law outside the fitted family; default false.
    pub mismatched: bool,
    /// Disturbances of the reading; default all of them.
    pub disturbances: Disturbances,
    /// A climate chamber around the sensor, whose temperature is recorded; default none.
    pub chamber: Option<Chamber>,
    /// The electronics that convert the resistance to codes; default none: the resistance itself is recorded.
    pub front_end: Option<FrontEndSpec>,
    /// Equal seeds give equal recordings; default 1.
    pub seed: u64,
    /// Number of the sensor within the make, also a seed: its R₀ and, with `mismatched`, its character are drawn around those of the make;
    /// default `None`, the make's own values.
    pub individual: Option<u64>,
}

impl SimulationSettings {
    /// Returns the defaults for a material and a protocol.
    #[must_use]
    pub const fn new(material: Material, protocol: Protocol) -> Self {
        Self {
            material,
            protocol,
            followed: None,
            elongation_mm: 10.0,
            speed_mm_s: 1.0,
            sample_rate_hz: 20.0,
            mismatched: false,
            disturbances: Disturbances::BENCH,
            chamber: None,
            front_end: None,
            seed: 1,
            individual: None,
        }
    }

    /// Returns the settings of the example: a sensor outside the fitted family of laws, stretched by up to 10 mm at up to 5 mm/s.
    #[must_use]
    pub fn example() -> Self {
        Self { speed_mm_s: 5.0, mismatched: true, ..Self::new(Material::Representative, Protocol::MIXED) }
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// Names the setting, its range and the value found.
    pub fn validate(&self) -> Result<(), SettingsError> {
        within("elongation_mm", self.elongation_mm, 1e-3, 15.0)?;
        within("speed_mm_s", self.speed_mm_s, 0.01, 100.0)?;
        within("sample_rate_hz", self.sample_rate_hz, 0.1, 1e4)?;
        self.disturbances.validate()?;
        self.chamber.map_or(Ok(()), |chamber| chamber.validate())?;
        if let Some(front_end) = &self.front_end {
            front_end.build().map_err(|error| SettingsError::FrontEnd(error.to_string()))?;
        }
        if let Some(followed) = &self.followed {
            followed.validate()?;
        }
        match self.protocol {
            Protocol::ExtendRetract { cycles, rest_s } => {
                within("cycles", f64::from(cycles), 1.0, 1e4)?;
                within("rest_s", rest_s, 0.0, 1e6)
            }
            Protocol::ExtendHold { cycles, hold_s, rest_s } | Protocol::LongHolds { cycles, hold_s, rest_s } => {
                within("cycles", f64::from(cycles), 1.0, 1e4)?;
                within("hold_s", hold_s, 0.0, 1e6)?;
                within("rest_s", rest_s, 0.0, 1e6)
            }
            Protocol::LoadSteps { step_g, hold_s } => {
                within("step_g", step_g, 0.1, Protocol::HEAVIEST_LOAD_G)?;
                within("hold_s", hold_s, 0.0, 1e6)
            }
            Protocol::Mixed { duration_s } => within("duration_s", duration_s, 1.0, 1e6),
        }
    }

    /// Refuses recordings that do not fit into memory.
    pub(super) fn check_rows(&self, duration_s: f64) -> Result<(), SettingsError> {
        within("number of rows", duration_s * self.sample_rate_hz, 0.0, MOST_ROWS)
    }

    pub(super) fn full_strain(&self) -> f64 {
        self.elongation_mm / GAUGE_LENGTH_MM
    }

    pub(super) fn strain_rate(&self) -> f64 {
        self.speed_mm_s / GAUGE_LENGTH_MM
    }
}

/// Error for invalid settings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// A number outside of its range.
    #[error("{setting}: expected {lowest} to {highest}, found {found}")]
    OutOfRange {
        /// The setting.
        setting: &'static str,
        /// Its smallest value.
        lowest: f64,
        /// Its largest value.
        highest: f64,
        /// Value of the setting.
        found: f64,
    },
    /// An invalid front end.
    #[error("front_end: {0}")]
    FrontEnd(String),
}

pub(super) fn within(setting: &'static str, found: f64, lowest: f64, highest: f64) -> Result<(), SettingsError> {
    if found >= lowest && found <= highest {
        Ok(())
    } else {
        Err(SettingsError::OutOfRange { setting, lowest, highest, found })
    }
}
