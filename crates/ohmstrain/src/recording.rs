use ohmstrain_calib::{Samples, ScoredRow};
use ohmstrain_sensor::{JointParams, Quantity, ReadingUnit, Scores};

use crate::{Error, Sensor};

/// A recording with known strain, for calibration or comparison.
///
/// ```
/// use ohmstrain::Recording;
///
/// let recording = Recording::new(&[0.0, 0.1], &[1600.0, f64::NAN], &[0.00, 0.01])?;
/// assert!(Recording::new(&[0.1, 0.0], &[1600.0, 1610.0], &[0.00, 0.01]).is_err());
/// # Ok::<(), ohmstrain::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Recording<'a> {
    pub(crate) samples: Samples<'a>,
    pub(crate) reading: ReadingUnit,
    pub(crate) quantity: Quantity,
    pub(crate) joint: Option<JointParams>,
    pub(crate) file: Option<(&'a str, &'a str)>,
    pub(crate) temperature_c: Option<&'a [f64]>,
    pub(crate) knows_strain_unit: bool,
    pub(crate) knows_resistance_unit: bool,
    pub(crate) knows_clock: bool,
}

impl<'a> Recording<'a> {
    /// Creates a recording from increasing times, s, positive readings, Ω, and true strains, 0.1 for 10 %. A missing reading or
    /// strain is NaN.
    ///
    /// # Errors
    /// The first invalid row, or lengths that differ.
    ///
    /// ```
    /// let (time_s, ohm, strain) = ([0.0, 0.1], [1600.0, 1610.0], [0.00, 0.01]);
    /// let recording = ohmstrain::Recording::new(&time_s, &ohm, &strain)?;
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    pub fn new(time_s: &'a [f64], resistance: &'a [f64], strain: &'a [f64]) -> Result<Self, Error> {
        let samples = Samples::new(time_s, resistance, strain)?;
        Ok(Self {
            samples,
            reading: ReadingUnit::Ohm,
            quantity: Quantity::Strain,
            joint: None,
            file: None,
            temperature_c: None,
            knows_strain_unit: false,
            knows_resistance_unit: false,
            knows_clock: false,
        })
    }

    /// Sets standard deviations of the true strains, as [`marked_references`](crate::marked_references()) returns them.
    /// Calibrated intervals then cover the reference's error, too.
    ///
    /// # Errors
    /// If their number differs from that of the strains, or one of a known strain is negative or NaN.
    ///
    /// ```
    /// let recording = ohmstrain::Recording::new(&[0.0, 0.1], &[1600.0, 1610.0], &[0.00, 0.01])?;
    /// assert!(recording.with_strain_sd(&[0.002, 0.002]).is_ok());
    /// assert!(recording.with_strain_sd(&[0.002, -0.1]).is_err());
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    pub fn with_strain_sd(self, strain_sd: &'a [f64]) -> Result<Self, Error> {
        Ok(Self { samples: self.samples.with_strain_sd(strain_sd)?, ..self })
    }

    /// Sets the temperature in each row, °C, NaN where it was not measured. Calibration determines its effect if it moves enough.
    ///
    /// # Errors
    /// If their number differs from that of the rows.
    ///
    /// ```
    /// let recording = ohmstrain::Recording::new(&[0.0, 0.1], &[1600.0, 1610.0], &[0.00, 0.01])?;
    /// assert!(recording.at_temperatures_c(&[21.5, f64::NAN]).is_ok());
    /// assert!(recording.at_temperatures_c(&[21.5]).is_err());
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    pub fn at_temperatures_c(self, temperature_c: &'a [f64]) -> Result<Self, Error> {
        let (rows, temperatures) = (self.samples.len(), temperature_c.len());
        if rows != temperatures {
            return Err(Error::Temperatures { rows, temperatures });
        }
        Ok(Self { temperature_c: Some(temperature_c), ..self })
    }

    /// States that the readings are ratios to some resistance at rest.
    ///
    /// ```
    /// let recording = ohmstrain::Recording::new(&[0.0, 0.1], &[1.00, 1.01], &[0.00, 0.01])?.of_ratios();
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub const fn of_ratios(self) -> Self {
        Self { reading: ReadingUnit::Ratio, ..self }
    }

    /// States that the reference is an angle in degrees; the sensor will then estimate an angle.
    ///
    /// ```
    /// let recording = ohmstrain::Recording::new(&[0.0, 0.1], &[1600.0, 1610.0], &[0.0, 3.5])?.of_angles_deg();
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub const fn of_angles_deg(self) -> Self {
        Self { quantity: Quantity::AngleDeg, ..self }
    }

    /// States that the strains are fractions, which [`calibration_doubts`](crate::calibration_doubts) then does not doubt.
    ///
    /// ```
    /// let balloon = ohmstrain::Recording::new(&[0.0, 0.1], &[1600.0, 9000.0], &[0.0, 4.5])?.strain_unit_is_known();
    /// assert!(ohmstrain::calibration_doubts(&[balloon]).is_empty());
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub const fn strain_unit_is_known(self) -> Self {
        Self { knows_strain_unit: true, ..self }
    }

    /// States that the clock counts seconds, which [`motion_doubts`](crate::motion_doubts) then does not doubt.
    ///
    /// ```
    /// let slow = ohmstrain::Recording::new(&[0.0, 60.0], &[1600.0, 1610.0], &[0.00, 0.01])?.clock_is_known();
    /// assert!(ohmstrain::motion_doubts(&[slow]).is_empty());
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub const fn clock_is_known(self) -> Self {
        Self { knows_clock: true, ..self }
    }

    /// States that the readings are in Ω, as electronics do, too.
    ///
    /// ```
    /// let small = ohmstrain::Recording::new(&[0.0, 0.1], &[1.6, 1.7], &[0.0, 0.1])?.resistance_unit_is_known();
    /// assert!(ohmstrain::calibration_doubts(&[small]).is_empty());
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub const fn resistance_unit_is_known(self) -> Self {
        Self { knows_resistance_unit: true, ..self }
    }

    /// Names the file that it was read from, with the SHA-256 of its bytes, hexadecimal. The sensor stores both.
    ///
    /// ```
    /// let hash = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
    /// let recording = ohmstrain::Recording::new(&[0.0, 0.1], &[1.0, 1.1], &[0.0, 0.1])?.of_file("bench.csv", hash);
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub const fn of_file(self, name: &'a str, sha256: &'a str) -> Self {
        Self { file: Some((name, sha256)), ..self }
    }

    /// Sets the joint that the sensor is glued across.
    ///
    /// ```
    /// use ohmstrain::{JointParams, Recording};
    ///
    /// let knee = JointParams { prestrain: 0.05, moment_arm_mm: 4.4, gauge_length_mm: 30.0 };
    /// let recording = Recording::new(&[0.0, 0.1], &[1600.0, 1610.0], &[0.05, 0.06])?.on_joint(knee);
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub const fn on_joint(self, joint: JointParams) -> Self {
        Self { joint: Some(joint), ..self }
    }
}

/// Scores of a sensor's estimates on a recording; see [`Sensor::evaluate`].
///
/// ```
/// # let text = std::fs::read_to_string("examples/sensor.toml")?;
/// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
/// let recording = ohmstrain::Recording::new(&[0.0, 0.1, 0.2], &[1600.0, 1610.0, 1620.0], &[0.00, 0.01, 0.02])?;
/// if let Some(found) = sensor.evaluate(&recording)? {
///     println!("{:.1} %FS, without relaxation {:.1}", found.filter.rmse_percent_fs, found.static_cubic.rmse_percent_fs);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Evaluation {
    /// Scores of the filter.
    pub filter: Scores,
    /// Scores of the smoother.
    pub smoother: Scores,
    /// Scores of strain as a cubic polynomial of the reading.
    pub static_cubic: Scores,
}

impl Sensor {
    /// Filters and smooths a recording without using its strain, and scores the estimates; `None` if it has no known strain.
    ///
    /// # Errors
    /// As [`Sensor::smooth`]; or if the recording is of another quantity or unit than the calibration.
    ///
    /// ```
    /// # let text = std::fs::read_to_string("examples/sensor.toml")?;
    /// # let sensor = ohmstrain::Sensor::from_toml(&text)?;
    /// use ohmstrain::Recording;
    ///
    /// let recording = Recording::new(&[0.0, 0.1, 0.2], &[1600.0, 1610.0, 1620.0], &[0.00, 0.01, 0.02])?;
    /// let found = sensor.evaluate(&recording)?.unwrap();
    /// assert_eq!(found.filter.n, 3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn evaluate(&self, recording: &Recording) -> Result<Option<Evaluation>, Error> {
        let (samples, params) = (&recording.samples, self.params());
        if (recording.reading, recording.quantity) != (params.reading, params.quantity) {
            return Err(Error::OtherQuantity);
        }
        self.check_reference(samples.strain().iter().copied())?;
        let (time_s, readings) = (samples.time_s(), samples.reading());
        let (sensor, readings) = match recording.temperature_c {
            Some(temperature_c) => (self.clone(), self.at_reference_temperature(readings, temperature_c)),
            None => (self.clone().without_temperature(), readings.to_vec()),
        };
        let smoothed = sensor.smooth(time_s, &readings)?;
        let mut filter = sensor.filter().build()?;
        let mut cubic = ohmstrain_calib::running_cubic(params.static_cubic);
        let (mut filter_rows, mut smoother_rows, mut cubic_rows) = (Vec::new(), Vec::new(), Vec::new());
        for (row, smoothed) in smoothed.iter().enumerate() {
            let (time_s, reading, truth) = (time_s[row], readings[row], samples.strain()[row]);
            let filtered = filter.step(time_s, reading)?;
            let scored = |strain, sd| ScoredRow { time_s, truth, strain, sd };
            filter_rows.push(scored(filtered.strain, Some(filtered.strain_sd)));
            smoother_rows.push(scored(smoothed.strain, Some(smoothed.strain_sd)));
            cubic_rows.push(scored(ohmstrain_calib::Baseline::strain(&mut cubic, time_s, reading), None));
        }
        let scores = (
            ohmstrain_calib::score(&filter_rows),
            ohmstrain_calib::score(&smoother_rows),
            ohmstrain_calib::score(&cubic_rows),
        );
        let (Some(filter), Some(smoother), Some(static_cubic)) = scores else { return Ok(None) };
        Ok(Some(Evaluation { filter, smoother, static_cubic }))
    }
}
