/// One reading of a sensor, in the unit of its calibration: Ω, or a ratio. A number, or an `Option` of one, converts into a
/// reading.
///
/// ```
/// use ohmstrain::Reading;
///
/// assert_eq!(Reading::from(1600.0), Reading { value: 1600.0, ..Reading::MISSING });
/// assert!(Reading::from(None).value.is_nan());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Reading {
    /// Value as recorded; NaN if it is missing.
    pub value: f64,
    /// Standard deviation that the electronics add to the sensor's own, in the same unit; 0 if unknown.
    pub sd: f64,
    /// True if a converter was at an end of its scale, so that there is no value.
    pub saturated: bool,
}

impl Reading {
    /// A missing reading.
    ///
    /// ```
    /// assert!(ohmstrain::Reading::MISSING.value.is_nan());
    /// ```
    pub const MISSING: Self = Self { value: f64::NAN, sd: 0.0, saturated: false };

    /// Returns the reading relative to R₀, R/R₀ - 1, as the kernels of `ohmstrain-ekf` take it; `None` without a value.
    ///
    /// ```
    /// let relative = ohmstrain::Reading::from(1760.0).relative(1600.0).unwrap();
    /// assert!((relative.value - 0.1).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn relative(self, rest_reading: f64) -> Option<ohmstrain_ekf::Reading<f64>> {
        if !self.value.is_finite() {
            return None;
        }
        let sd = if self.sd.is_finite() { self.sd / rest_reading } else { 0.0 };
        Some(ohmstrain_ekf::Reading { value: (self.value - rest_reading) / rest_reading, extra_variance: sd * sd })
    }
}

impl From<f64> for Reading {
    fn from(value: f64) -> Self {
        Self { value, ..Self::MISSING }
    }
}

impl From<Option<f64>> for Reading {
    fn from(value: Option<f64>) -> Self {
        value.map_or(Self::MISSING, Self::from)
    }
}
