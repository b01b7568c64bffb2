use std::sync::Arc;

use ohmstrain_model::Joint;
use ohmstrain_sensor::{
    EstimatorKind, JointParams, Learned, Options, Quantity, SensorParams, Smoother, build_filter_with,
    build_smoother_with,
};

use crate::column::Header;
use crate::estimate::check_rest;
use crate::text;
use crate::{Column, Error, Estimate, FilterBuilder, Thermometer, UnitDoubt};

/// A calibrated, checked sensor: every number is in its range, and a filter can be built from it.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let sensor = ohmstrain::Sensor::from_toml(&std::fs::read_to_string("examples/sensor.toml")?)?;
/// assert_eq!(sensor.params().default_estimator.name(), "sign-split");
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Shared with its filters.
    params: Arc<SensorParams>,
    /// Learned correction, shared by all its filters; `None` without a correction.
    learned: Option<Arc<Learned>>,
}

impl PartialEq for Sensor {
    fn eq(&self, other: &Self) -> bool {
        self.params == other.params
    }
}

impl Sensor {
    /// Reads the text of a `sensor.toml`.
    ///
    /// # Errors
    /// With line and column if it is not TOML, is of another version, has an unknown or a missing field, or a number out of its
    /// range; or if no filter can be built for its default estimator.
    ///
    /// ```
    /// let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let wrong = text.replace("rest_reading = 1", "rest_reading = -1");
    /// assert!(ohmstrain::Sensor::from_toml(&wrong).unwrap_err().to_string().contains("column"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn from_toml(text: &str) -> Result<Self, Error> {
        Self::from_params(text::parse(text)?)
    }

    /// Reads a sensor for use with one estimator, whatever the default in the text is.
    ///
    /// # Errors
    /// As [`Self::from_toml`], for that estimator.
    ///
    /// ```
    /// use ohmstrain::{EstimatorKind, Sensor};
    ///
    /// let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// let sensor = Sensor::from_toml_for(&text, EstimatorKind::Ekf)?;
    /// assert!(Sensor::from_toml_for(&text, EstimatorKind::Ukf).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn from_toml_for(text: &str, estimator: EstimatorKind) -> Result<Self, Error> {
        Self::for_estimator(text::parse(text)?, Some(estimator))
    }

    /// Creates a sensor with these parameters.
    ///
    /// # Errors
    /// Names the first number that is out of its range; or if no filter can be built for the default estimator.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// use ohmstrain::Sensor;
    ///
    /// let mut params = Sensor::from_toml(&text)?.params().clone();
    /// params.limits.upper = f64::NAN;
    /// assert!(Sensor::from_params(params).unwrap_err().to_string().contains("limits.upper"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn from_params(params: SensorParams) -> Result<Self, Error> {
        Self::for_estimator(params, None)
    }

    fn for_estimator(params: SensorParams, kind: Option<EstimatorKind>) -> Result<Self, Error> {
        let sensor = Self { learned: Learned::of(&params), params: Arc::new(params) };
        sensor.build(kind.unwrap_or(sensor.params.default_estimator), &Options::plain())?;
        Ok(sensor)
    }

    /// Builds a filter that shares the learned correction.
    pub(crate) fn build(
        &self,
        kind: EstimatorKind,
        options: &Options,
    ) -> Result<Box<dyn ohmstrain_sensor::Filter>, Error> {
        Ok(build_filter_with(&self.params, self.learned.as_ref(), Some(kind), options)?)
    }

    /// Builds a smoother that shares the learned correction.
    pub(crate) fn build_smoother(&self, kind: EstimatorKind, options: &Options) -> Result<Box<dyn Smoother>, Error> {
        Ok(build_smoother_with(&self.params, self.learned.as_ref(), Some(kind), options)?)
    }

    /// Returns the text of its `sensor.toml`, which [`Self::from_toml`] reads.
    ///
    /// # Errors
    /// If TOML cannot represent a number.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// use ohmstrain::Sensor;
    ///
    /// let sensor = Sensor::from_toml(&text)?;
    /// assert_eq!(Sensor::from_toml(&sensor.to_toml()?)?, sensor);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn to_toml(&self) -> Result<String, Error> {
        self.params.validate().map_err(ohmstrain_sensor::SensorError::from)?;
        Ok(toml::to_string(self.params())?)
    }

    /// Returns all its numbers.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// println!("{} branches", sensor.params().law.branches.len());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn params(&self) -> &SensorParams {
        &self.params
    }

    pub(crate) const fn shared(&self) -> &Arc<SensorParams> {
        &self.params
    }

    /// Returns the parameters, and consumes the sensor.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut params = sensor.into_params();
    /// params.limits.upper = 0.3;
    /// let sensor = ohmstrain::Sensor::from_params(params)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn into_params(self) -> SensorParams {
        Arc::unwrap_or_clone(self.params)
    }

    /// Returns R₀ of the law, to which everything is relative, in the unit of the readings. It is the calibration's, or, if the
    /// rested sensor now reads `rest_resistance`, scaled accordingly.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert_eq!(sensor.rest_reading(None), sensor.params().rest_reading);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn rest_reading(&self, rest_resistance: Option<f64>) -> f64 {
        rest_resistance.map_or(self.params.rest_reading, |measured| self.params.rest_reading_of(measured))
    }

    /// Mounts the sensor across a joint: estimates then have an angle, too. A sensor calibrated in degrees needs no joint and
    /// stays as it is.
    ///
    /// # Errors
    /// If the joint is invalid.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::JointParams;
    ///
    /// let knee = JointParams { prestrain: 0.05, moment_arm_mm: 4.4, gauge_length_mm: 30.0 };
    /// let mut filter = sensor.on_joint(knee)?.filter().build()?;
    /// assert!(filter.step(0.0, 1600.0)?.angle_deg.is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn on_joint(mut self, joint: JointParams) -> Result<Self, Error> {
        if self.params.quantity == Quantity::Strain {
            Arc::make_mut(&mut self.params).joint = Some(joint);
        }
        self.joint()?;
        Ok(self)
    }

    /// Returns the sensor for readings whose temperature is not measured: its intervals are wider by what the calibration's temperatures
    /// do to the strain. Without an effect of temperature it is the same sensor.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert_eq!(sensor.clone().without_temperature(), sensor);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn without_temperature(mut self) -> Self {
        if self.params.temperature.is_some() {
            Arc::make_mut(&mut self.params).forget_temperature();
        }
        self
    }

    /// Returns a column of readings as they would be at the reference temperature; as they are without an effect of temperature. A
    /// missing temperature, °C, is that of the row before; an [implausible](Thermometer::implausible) one counts as missing.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// assert_eq!(sensor.at_reference_temperature(&[1612.0, 1613.0], &[31.5, f64::NAN]), [1612.0, 1613.0]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn at_reference_temperature(&self, readings: &[f64], temperature_c: &[f64]) -> Vec<f64> {
        let mut thermometer = Thermometer::new(self);
        readings.iter().zip(temperature_c).map(|(reading, value)| thermometer.at_reference(*reading, *value)).collect()
    }

    /// Checks that the rested sensor can read `measured`.
    ///
    /// # Errors
    /// If it is not positive, or differs from the rested sensor's reading in calibration by more than a factor of
    /// [`FARTHEST_REST`](crate::FARTHEST_REST).
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// sensor.check_rest_resistance(1712.0)?;
    /// let refused = sensor.check_rest_resistance(14_000.0).unwrap_err();
    /// assert!(refused.to_string().starts_with("resistance at rest: expected "));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn check_rest_resistance(&self, measured: f64) -> Result<(), Error> {
        check_rest(self.params.rested(), measured)
    }

    /// Returns the joint that it is mounted on, if there is one.
    pub(crate) fn joint(&self) -> Result<Option<Joint<f64>>, Error> {
        let joint = |joint: JointParams| Joint::new(joint.prestrain, joint.moment_arm_mm, joint.gauge_length_mm);
        self.params.joint.map(joint).transpose().map_err(Error::Joint)
    }

    /// Returns the builder of a filter.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let mut filter = sensor.filter().gate(10.8).build()?;
    /// for (time_s, ohm) in [(0.00, 1600.0), (0.05, 1632.0), (0.10, f64::NAN)] {
    ///     let e = filter.step(time_s, ohm)?;
    ///     println!("{:.3} ± {:.3}", e.strain, e.strain_sd);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn filter(&self) -> FilterBuilder<'_> {
        FilterBuilder::new(self)
    }

    /// Smooths a whole recording: each estimate uses all readings; a missing reading is NaN. See [`FilterBuilder::smooth`] for
    /// more options.
    ///
    /// # Errors
    /// If the slices differ in length, a time or a reading is invalid, or the readings seem to be in another unit than the
    /// calibration's.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let rows = sensor.smooth(&[0.00, 0.05, 0.10], &[1600.0, f64::NAN, 1660.0])?;
    /// assert!(rows[1].flags.has(ohmstrain::Flag::Missing));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn smooth(&self, time_s: &[f64], readings: &[f64]) -> Result<Vec<Estimate>, Error> {
        self.filter().smooth(time_s, readings)
    }

    /// Returns the columns of its `estimates.csv`, in order.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// let names: Vec<&str> = sensor.columns().iter().map(|column| column.name()).collect();
    /// assert_eq!(names[..4], ["time_s", "resistance_ohm", "strain", "strain_sd"]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn columns(&self) -> Vec<Column> {
        Header::of(&self.params).columns().collect()
    }

    /// Checks that readings are in the calibration's unit, by their median. `rest_resistance` is the present reading of the rested
    /// sensor, if it differs from that in calibration.
    ///
    /// # Errors
    /// If they are far from those of the calibration, and would not be so in another unit.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// sensor.check_unit([1600.0, 1632.0], None)?;
    /// let doubt = sensor.check_unit([1.600, 1.632], None).unwrap_err();
    /// assert!(doubt.to_string().ends_with("a thousandth of that: are they in kilo-ohms?"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn check_unit(
        &self,
        readings: impl IntoIterator<Item = f64>,
        rest_resistance: Option<f64>,
    ) -> Result<(), UnitDoubt> {
        UnitDoubt::of(&self.params, self.rest_reading(rest_resistance), readings.into_iter()).map_or(Ok(()), Err)
    }
}
