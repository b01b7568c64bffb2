use std::mem;

use ohmstrain_calib::{
    CalibrationError, Confounded, Distrusted, GaugeFamily, LawOptions, LeftOutRow, RECIPE, Samples, Stage,
    TemperatureCoefficients, TemperatureFit, fit_temperature,
};
use ohmstrain_sensor::{EstimatorKind, Findings, Quantity, RecordingInfo, SensorParams};

use crate::{Error, MADE_BY, Prior, Recording, Sensor};

/// Calibrates a sensor on recordings with known strain, with all options at their defaults. See [`Calibration`].
///
/// # Errors
/// If the recordings are too short or too uniform, of different quantities or units, or the readings do not determine the
/// strain.
///
/// ```
/// use ohmstrain::{Recording, calibrate};
///
/// let time_s: Vec<f64> = (0..400).map(|k| 0.1 * f64::from(k)).collect();
/// let strain: Vec<f64> = time_s.iter().map(|t| 0.15 - 0.15 * (0.6 * t).cos()).collect();
/// let ohm: Vec<f64> = strain.iter().map(|e| 1600.0 * (1.0 + 1.9 * e - 2.0 * e * e)).collect();
/// # if false { // takes half a minute in a test
/// let sensor = calibrate(&[Recording::new(&time_s, &ohm, &strain)?])?;
/// std::fs::write("sensor.toml", sensor.to_toml()?)?;
/// # }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn calibrate(recordings: &[Recording]) -> Result<Sensor, Error> {
    Calibration::new().run(recordings).map(|calibrated| calibrated.sensor)
}

/// Options of a calibration. Everything has a default.
///
/// ```
/// use ohmstrain::{Calibration, EstimatorKind, Recording};
///
/// let time_s: Vec<f64> = (0..400).map(|k| 0.1 * f64::from(k)).collect();
/// let strain: Vec<f64> = time_s.iter().map(|t| 0.15 - 0.15 * (0.6 * t).cos()).collect();
/// let ohm: Vec<f64> = strain.iter().map(|e| 1600.0 * (1.0 + 1.9 * e - 2.0 * e * e)).collect();
/// let calibration = Calibration::new().estimator(EstimatorKind::Ekf).branches(1);
/// let sensor = calibration.run(&[Recording::new(&time_s, &ohm, &strain)?])?.sensor;
/// assert_eq!(sensor.params().law.branches.len(), 1);
/// # Ok::<(), ohmstrain::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Calibration<'a> {
    prior: Option<&'a Prior>,
    estimator: Option<EstimatorKind>,
    branches: Option<usize>,
    gauge: Option<GaugeFamily>,
    temperature: Option<TemperatureCoefficients>,
}

/// Result of a calibration.
///
/// ```
/// fn remark(calibrated: &ohmstrain::Calibrated) {
///     for row in &calibrated.distrusted {
///         println!("recording {}, row {}: {}; left out", row.recording, row.row, row.doubt);
///     }
/// }
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Calibrated {
    /// The sensor.
    pub sensor: Sensor,
    /// Measured quality of the sensor; `None` if it could not be measured.
    pub findings: Option<Findings>,
    /// R₀ of each recording, in the unit of its readings.
    pub rest_readings: Vec<f64>,
    /// Rows that were left out.
    pub distrusted: Vec<Distrusted>,
    /// Reason why the effect of temperature could not be determined although the temperature moved; `None` otherwise.
    pub confounded_temperature: Option<Confounded>,
    /// Estimates on each quarter by a fit to the other quarters, in order; empty if that was not possible.
    pub left_out: Vec<LeftOutRow>,
}

impl<'a> Calibration<'a> {
    /// Creates a calibration with all options at their defaults.
    ///
    /// ```
    /// let calibration = ohmstrain::Calibration::new();
    /// ```
    #[must_use]
    pub const fn new() -> Self {
        Self { prior: None, estimator: None, branches: None, gauge: None, temperature: None }
    }

    /// Sets the estimator that is calibrated and becomes the sensor's default, in place of the better one of the corrected filter and the
    /// static cubic; the extended Kalman filter is calibrated in any case.
    ///
    /// ```
    /// use ohmstrain::{Calibration, EstimatorKind};
    ///
    /// let quick = Calibration::new().estimator(EstimatorKind::Ekf);
    /// ```
    #[must_use]
    pub const fn estimator(self, kind: EstimatorKind) -> Self {
        Self { estimator: Some(kind), ..self }
    }

    /// Sets the number of relaxing branches of the law, 0 to 4, instead of choosing it by the filter's error.
    ///
    /// ```
    /// let plain = ohmstrain::Calibration::new().branches(1);
    /// ```
    #[must_use]
    pub const fn branches(self, branches: usize) -> Self {
        Self { branches: Some(branches), ..self }
    }

    /// Sets the family of the quasi-static curve, instead of a polynomial.
    ///
    /// ```
    /// use ohmstrain::{Calibration, GaugeFamily};
    ///
    /// let tunnelling = Calibration::new().gauge(GaugeFamily::Tunnelling);
    /// ```
    #[must_use]
    pub const fn gauge(self, family: GaugeFamily) -> Self {
        Self { gauge: Some(family), ..self }
    }

    /// Sets the effect of temperature instead of fitting it, for recordings that all have temperatures.
    ///
    /// ```
    /// use ohmstrain::{Calibration, TemperatureCoefficients};
    ///
    /// let coefficients = TemperatureCoefficients { rest_per_k: (0.003, 0.0005), gain_per_k: (0.0, 0.001) };
    /// let calibration = Calibration::new().temperature(coefficients);
    /// ```
    #[must_use]
    pub const fn temperature(self, coefficients: TemperatureCoefficients) -> Self {
        Self { temperature: Some(coefficients), ..self }
    }

    /// Uses a prior learned from other sensors of the same make, with which a short motion is enough. The law's structure is
    /// then the prior's, whatever [`Self::branches`] and [`Self::gauge`] say; the sensor's R₀ is its own.
    ///
    /// ```
    /// use ohmstrain::{Calibration, Prior};
    ///
    /// fn short(prior: &Prior) -> Calibration<'_> {
    ///     Calibration::new().prior(prior)
    /// }
    /// ```
    #[must_use]
    pub const fn prior(self, prior: &'a Prior) -> Self {
        Self { prior: Some(prior), ..self }
    }

    /// Calibrates the sensor. The same recordings give the same sensor.
    ///
    /// # Errors
    /// As [`calibrate`].
    ///
    /// ```
    /// use ohmstrain::{Calibration, Recording};
    ///
    /// let short = Recording::new(&[0.0, 0.1], &[1600.0, 1610.0], &[0.00, 0.01])?;
    /// let error = Calibration::new().run(&[short]).unwrap_err();
    /// assert!(error.to_string().starts_with("recording 1 has 2 rows"));
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    pub fn run(self, recordings: &[Recording]) -> Result<Calibrated, Error> {
        self.run_with(recordings, |_| {})
    }

    /// Calibrates, calling `progress` with each stage.
    ///
    /// # Errors
    /// As [`calibrate`].
    ///
    /// ```
    /// use ohmstrain::{Calibration, Recording};
    ///
    /// let short = Recording::new(&[0.0, 0.1], &[1600.0, 1610.0], &[0.00, 0.01])?;
    /// let failed = Calibration::new().run_with(&[short], |stage| println!("{stage:?}"));
    /// assert!(failed.is_err());
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    pub fn run_with(self, recordings: &[Recording], progress: impl FnMut(Stage)) -> Result<Calibrated, Error> {
        let Some(first) = recordings.first() else { return Err(CalibrationError::NoRecording.into()) };
        let (quantity, reading) = (first.quantity, first.reading);
        if recordings.iter().any(|other| (other.quantity, other.reading) != (quantity, reading)) {
            return Err(Error::OtherQuantity);
        }
        let estimators = self.estimator.as_ref().map_or(RECIPE.estimators, std::slice::from_ref);
        let mut samples: Vec<Samples> = recordings.iter().map(|recording| recording.samples).collect();
        let temperature = self.effect_of_temperature(recordings, &samples)?;
        if let Some(fit) = &temperature {
            for (samples, readings) in samples.iter_mut().zip(&fit.readings) {
                *samples = samples.with_readings(readings)?;
            }
        }
        let prior = self.prior.map(Prior::params);
        if let Some(of_make) = prior.map(|prior| prior.quantity).filter(|of_make| *of_make != quantity) {
            return Err(Error::OtherMake { of_make, found: quantity });
        }
        let mut calibration =
            ohmstrain_calib::calibrate(&samples, &self.structures(estimators), estimators, prior, progress)?;
        let (distrusted, left_out) = (mem::take(&mut calibration.distrusted), mem::take(&mut calibration.left_out));
        let rest_readings = mem::take(&mut calibration.rest_readings);
        let info = |(recording, rest_reading): (&Recording, &f64)| {
            let (file, sha256) = recording.file.map(|(file, sha256)| (file.to_string(), sha256.to_string()))?;
            let (rows, time_s) = (recording.samples.len(), recording.samples.time_s());
            let (first_s, last_s) = (*time_s.first()?, *time_s.last()?);
            Some(RecordingInfo { file, sha256, rows, first_s, last_s, rest_reading: *rest_reading })
        };
        let infos = recordings.iter().zip(&rest_readings).filter_map(info).collect();
        let of_strain = |recording: &Recording| recording.joint.filter(|_| recording.quantity == Quantity::Strain);
        let joint = recordings.iter().find_map(of_strain);
        let params = calibration.into_sensor(MADE_BY, quantity, reading);
        let findings = params.findings.clone();
        let (effect, confounded_temperature) =
            temperature.as_ref().map_or((None, None), |fit| (fit.effect, fit.confounded));
        let sensor = Sensor::from_params(SensorParams { joint, recordings: infos, temperature: effect, ..params })?;
        Ok(Calibrated { sensor, findings, rest_readings, distrusted, confounded_temperature, left_out })
    }

    /// Returns the effect of temperature, with readings at the reference temperature; `None` unless all recordings have temperatures.
    fn effect_of_temperature(
        self,
        recordings: &[Recording],
        samples: &[Samples],
    ) -> Result<Option<TemperatureFit>, Error> {
        let temperature_c: Option<Vec<&[f64]>> = recordings.iter().map(|recording| recording.temperature_c).collect();
        if self.temperature.is_some() && temperature_c.is_none() {
            return Err(Error::NoTemperatures);
        }
        let fit = temperature_c.map(|temperature_c| fit_temperature(samples, &temperature_c, self.temperature));
        Ok(fit.transpose()?)
    }

    /// Returns the candidate structures of the law.
    fn structures(self, estimators: &[EstimatorKind]) -> Vec<LawOptions> {
        let estimator = estimators.first().copied().unwrap_or(EstimatorKind::Corrected);
        let with_gauge = |options: &LawOptions| LawOptions { gauge: self.gauge.unwrap_or(options.gauge), ..*options };
        let structures: Vec<LawOptions> = LawOptions::candidates(estimator).iter().map(with_gauge).collect();
        match self.branches {
            Some(branches) => structures.first().map(|first| LawOptions { branches, ..*first }).into_iter().collect(),
            None => structures,
        }
    }
}
