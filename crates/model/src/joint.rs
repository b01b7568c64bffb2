use crate::Scalar;
use crate::error::{ParameterError, Problem};

/// A sensor glued across a joint: `ε = ε_pre + r θ / L₀`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint<T> {
    prestrain: T,
    moment_arm_mm: T,
    gauge_length_mm: T,
}

impl<T: Scalar> Joint<T> {
    /// - `prestrain` ε_pre: strain at angle zero.
    /// - `moment_arm_mm` r: distance of the sensor from the joint's axis; may be negative, not zero.
    /// - `gauge_length_mm` L₀: length of the unstretched sensor, positive.
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn new(prestrain: T, moment_arm_mm: T, gauge_length_mm: T) -> Result<Self, ParameterError> {
        if !prestrain.is_finite() {
            return Err(ParameterError::new("prestrain", Problem::NotFinite));
        }
        if !moment_arm_mm.is_finite() || moment_arm_mm.is_zero() {
            return Err(ParameterError::new("moment_arm_mm", Problem::OutOfRange));
        }
        if !(gauge_length_mm.is_finite() && gauge_length_mm > T::zero()) {
            return Err(ParameterError::new("gauge_length_mm", Problem::NotPositive));
        }
        Ok(Self { prestrain, moment_arm_mm, gauge_length_mm })
    }

    /// Returns the strain at a joint angle in rad.
    #[must_use]
    pub fn strain(&self, angle_rad: T) -> T {
        self.prestrain + self.moment_arm_mm * angle_rad / self.gauge_length_mm
    }

    /// Returns the joint angle and its standard deviation, rad, from the strain and its standard deviation.
    #[must_use]
    pub fn angle_rad(&self, strain: T, strain_sd: T) -> (T, T) {
        let rad_per_strain = self.gauge_length_mm / self.moment_arm_mm;
        ((strain - self.prestrain) * rad_per_strain, strain_sd * rad_per_strain.abs())
    }
}
