use ohmstrain_calib::{Identifiability, Lag, LagError, Samples, identifiability, reference_lag, screen};

use crate::{Error, Recording, Sensor};

impl Recording<'_> {
    /// Returns the lag of the reference behind the readings, with its uncertainty, as `ohmstrain inspect`, `calibrate` and
    /// `evaluate` report it. A recording whose lag [is too late](Lag::is_too_late) and [certain](Lag::is_certain) is not
    /// suitable for calibration as it is.
    ///
    /// # Errors
    /// [`LagError`] if the motion does not determine the lag.
    ///
    /// ```
    /// use ohmstrain::{LagError, Recording};
    ///
    /// let recording = Recording::new(&[0.0, 0.1], &[1600.0, 1610.0], &[0.00, 0.01])?;
    /// match recording.reference_lag() {
    ///     Ok(lag) if lag.is_sure() && lag.is_too_late() => println!("{:.1} ± {:.1} s late", lag.lag_s, lag.sd_s),
    ///     Ok(_) => {}
    ///     Err(error) => assert_eq!(error, LagError::Short),
    /// }
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    pub fn reference_lag(&self) -> Result<Lag, LagError> {
        reference_lag(&self.samples)
    }
}

/// Reports which parameters of the fitted law the recordings determine, which they leave open, and what to record next.
///
/// # Errors
/// If the recordings are too short, or the strain is constant.
///
/// ```
/// use ohmstrain::{Calibration, EstimatorKind, Recording, explain};
///
/// let time_s: Vec<f64> = (0..400).map(|k| 0.1 * f64::from(k)).collect();
/// let strain: Vec<f64> = time_s.iter().map(|t| 0.15 - 0.15 * (0.6 * t).cos()).collect();
/// let ohm: Vec<f64> = strain.iter().map(|e| 1600.0 * (1.0 + 1.9 * e - 2.0 * e * e)).collect();
/// let bench = [Recording::new(&time_s, &ohm, &strain)?];
/// let sensor = Calibration::new().estimator(EstimatorKind::Ekf).branches(1).run(&bench)?.sensor;
/// println!("{}", explain(&bench, &sensor)?);
/// # Ok::<(), ohmstrain::Error>(())
/// ```
pub fn explain(recordings: &[Recording], sensor: &Sensor) -> Result<Identifiability, Error> {
    let samples: Vec<Samples> = recordings.iter().map(|recording| recording.samples).collect();
    let screened = screen(&samples)?;
    Ok(identifiability(&screened.samples(), &sensor.params().law)?)
}
