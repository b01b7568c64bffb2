use ohmstrain_calib::Prior as Params;
use ohmstrain_sensor::SensorParams;

use crate::{Error, MADE_BY, Sensor, text};

/// Common properties of calibrated sensors of one make, with which a short motion calibrates the next sensor; see
/// [`Calibration::prior`](crate::Calibration::prior).
///
/// ```no_run
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use ohmstrain::{Calibration, Prior, Recording, Sensor};
///
/// let read = |name: &str| Ok::<_, Box<dyn std::error::Error>>(Sensor::from_toml(&std::fs::read_to_string(name)?)?);
/// let prior = Prior::learn(&[read("1.toml")?, read("2.toml")?, read("3.toml")?])?;
/// # let (time_s, ohm, strain) = (vec![], vec![], vec![]);
/// let short = Recording::new(&time_s, &ohm, &strain)?;
/// let sensor = Calibration::new().prior(&prior).run(&[short])?.sensor;
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    params: Params,
}

impl Prior {
    /// Learns a prior from at least three calibrated sensors.
    ///
    /// # Errors
    /// If there are too few of them, or if they are of different quantities.
    ///
    /// ```
    /// let sensor = ohmstrain::Sensor::from_toml(&std::fs::read_to_string("examples/sensor.toml")?)?;
    /// let error = ohmstrain::Prior::learn(&[sensor]).unwrap_err();
    /// assert_eq!(error.to_string(), "1 sensors; a fleet has at least 3");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn learn(sensors: &[Sensor]) -> Result<Self, Error> {
        let params: Vec<SensorParams> = sensors.iter().map(|sensor| sensor.params().clone()).collect();
        Ok(Self { params: Params::learn(&params, MADE_BY)? })
    }

    /// Reads the text of a `prior.toml`.
    ///
    /// # Errors
    /// With line and column if it is not TOML, is of another version, has an unknown or a missing field, or a number out of its
    /// range.
    ///
    /// ```
    /// let error = ohmstrain::Prior::from_toml("format = 4").unwrap_err();
    /// assert_eq!(error.to_string(), "line 1: field `format`: expected version 2, found 4");
    /// ```
    pub fn from_toml(text: &str) -> Result<Self, Error> {
        Ok(Self { params: text::parse(text)? })
    }

    /// Returns the text of its `prior.toml`, which [`Self::from_toml`] reads.
    ///
    /// # Errors
    /// If a number is out of its range.
    ///
    /// ```
    /// fn save(prior: &ohmstrain::Prior) -> Result<(), Box<dyn std::error::Error>> {
    ///     Ok(std::fs::write("prior.toml", prior.to_toml()?)?)
    /// }
    /// ```
    pub fn to_toml(&self) -> Result<String, Error> {
        self.params.validate().map_err(ohmstrain_sensor::SensorError::from)?;
        Ok(toml::to_string(&self.params)?)
    }

    /// Returns all its numbers.
    ///
    /// ```
    /// fn tell(prior: &ohmstrain::Prior) {
    ///     println!("{} sensors", prior.params().sensors);
    /// }
    /// ```
    #[must_use]
    pub const fn params(&self) -> &Params {
        &self.params
    }
}
