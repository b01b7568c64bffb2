use crate::{Known, Sensor};

/// An initial strain that the sensor never reports; see [`Sensor::check_start`].
///
/// ```
/// let doubt = ohmstrain::StartDoubt { found: 0.35, lower: 0.0, upper: 0.33 };
/// assert!(doubt.to_string().starts_with("0.35 is outside of the sensor's limits, 0 to 0.33"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartDoubt {
    /// The strain.
    pub found: f64,
    /// Lower limit.
    pub lower: f64,
    /// Upper limit.
    pub upper: f64,
}

impl std::error::Error for StartDoubt {}

impl Sensor {
    /// Checks that the sensor can report an initial strain. One slightly beyond the limits is accepted.
    ///
    /// # Errors
    /// If it is outside the sensor's limits.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// sensor.check_start(0.1)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn check_start(&self, strain: f64) -> Result<(), StartDoubt> {
        let (lower, upper) = (self.params().limits.lower, self.params().limits.upper);
        if (lower..=upper).contains(&strain) { Ok(()) } else { Err(StartDoubt { found: strain, lower, upper }) }
    }
}

/// A known strain without a row; see [`unused_known`].
///
/// ```
/// let doubt = ohmstrain::UnusedKnown { known: ohmstrain::Known::new(70.0, 0.1), first_s: 0.0, last_s: 60.0 };
/// assert_eq!(doubt.to_string(), "was not used: the recording goes from 0 to 60 s");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnusedKnown {
    /// The strain and its time.
    pub known: Known,
    /// First time of the recording, s.
    pub first_s: f64,
    /// Last time of the recording, s.
    pub last_s: f64,
}

/// Returns the known strains after the end of a recording, whose first and last time are given in s.
///
/// ```
/// use ohmstrain::{Known, unused_known};
///
/// let known = [Known::new(5.0, 0.0), Known::new(70.0, 0.1)];
/// assert_eq!(unused_known(&known, (0.0, 60.0)).len(), 1);
/// ```
#[must_use]
pub fn unused_known(known: &[Known], (first_s, last_s): (f64, f64)) -> Vec<UnusedKnown> {
    let unused = known.iter().filter(|known| known.time_s > last_s);
    unused.map(|known| UnusedKnown { known: *known, first_s, last_s }).collect()
}
