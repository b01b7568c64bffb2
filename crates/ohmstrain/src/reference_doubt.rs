use std::ops::RangeInclusive;

use ohmstrain_sensor::Quantity;

use crate::Sensor;
use crate::unit_doubt::quantile;

/// Ratios of a reference's 95th percentile to the largest strain of the calibration that suggest a factor of a hundred.
const PERCENT: RangeInclusive<f64> = 30.0..=300.0;
/// Largest strain of a glued or cast sensor; a calibration with larger strains was probably in percent.
const LARGEST_STRAIN: f64 = 3.0;

/// A reference that seems to be in percent, or of a sensor that was calibrated in percent; see
/// [`Sensor::check_reference`].
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let doubt = sensor.check_reference([20.0, 30.0]).unwrap_err();
/// assert!(doubt.to_string().ends_with("are they in percent?"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceDoubt {
    /// Largest strain of the calibration.
    pub expected: f64,
    /// 95th percentile of the reference's magnitude.
    pub found: f64,
    /// True if the calibration seems to be in percent, not the recording.
    pub is_of_calibration: bool,
}

impl std::error::Error for ReferenceDoubt {}

impl Sensor {
    /// Checks that a reference is in the calibration's unit: fractions, not percent. Angles are not checked.
    ///
    /// # Errors
    /// If it is a hundred times too large, or too small.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// sensor.check_reference([0.0, 0.2, 0.3])?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn check_reference(&self, strains: impl IntoIterator<Item = f64>) -> Result<(), ReferenceDoubt> {
        let params = self.params();
        if params.quantity != Quantity::Strain {
            return Ok(());
        }
        let Some(found) = quantile(strains.into_iter().map(f64::abs), 0.95) else { return Ok(()) };
        let expected = params.validity.lower.abs().max(params.validity.upper.abs());
        let is_of_calibration = expected > LARGEST_STRAIN && PERCENT.contains(&(expected / found));
        if PERCENT.contains(&(found / expected)) || is_of_calibration {
            return Err(ReferenceDoubt { expected, found, is_of_calibration });
        }
        Ok(())
    }
}
