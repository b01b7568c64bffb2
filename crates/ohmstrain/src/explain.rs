use ohmstrain_calib::{
    CalibrationError, Identifiability, Lag, Samples, identifiability, lag_out_of_reach, reference_lag, screen,
};

use crate::{Error, Recording, Sensor};

/// A lag of more than this share of a movement turns stretching into releasing for that share of the time.
const LARGEST_SHARE: f64 = 0.1;

/// How late a reference is, and whether that matters.
///
/// ```
/// # let (time_s, ohm, strain) = ([0.0, 0.1], [1600.0, 1610.0], [0.00, 0.01]);
/// let recording = ohmstrain::Recording::new(&time_s, &ohm, &strain)?;
/// if let Some(late) = recording.reference_lag().filter(|late| late.is_too_late()) {
///     println!("the reference is {:.1} s late", late.lag_s);
/// }
/// # Ok::<(), ohmstrain::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ReferenceLag {
    /// Positive if what the reading shows now stands in the reference later, s.
    pub lag_s: f64,
    /// Mean duration of a movement in one direction, s.
    pub movement_s: f64,
    /// By how much that may be off, s, where what the sensor lags itself cannot be told apart; 0 where it can.
    pub own_s: f64,
    /// Whether hardly any recording without a lag looks like that; if not, few do.
    pub is_certain: bool,
}

impl ReferenceLag {
    /// Whether it is more than a tenth of a movement: such a recording, if that [is certain](Self::is_certain), is not to be
    /// calibrated on as it is.
    ///
    /// ```
    /// # let (time_s, ohm, strain) = ([0.0, 0.1], [1600.0, 1610.0], [0.00, 0.01]);
    /// let recording = ohmstrain::Recording::new(&time_s, &ohm, &strain)?;
    /// assert!(!recording.reference_lag().is_some_and(|late| late.is_too_late()));
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub fn is_too_late(&self) -> bool {
        self.lag_s.abs() > LARGEST_SHARE * self.movement_s
    }
}

impl Recording<'_> {
    /// How late the reference is; `None` where that cannot be told for sure.
    ///
    /// ```
    /// let recording = ohmstrain::Recording::new(&[0.0, 0.1], &[1600.0, 1610.0], &[0.00, 0.01])?;
    /// assert_eq!(recording.reference_lag(), None);
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub fn reference_lag(&self) -> Option<ReferenceLag> {
        let lag = self.screened(reference_lag).filter(Lag::is_sure)?;
        Some(ReferenceLag {
            lag_s: lag.lag_s,
            movement_s: lag.movement_s,
            own_s: lag.own_s,
            is_certain: lag.is_certain(),
        })
    }

    /// How far lags are looked for, s, with its sign, if the reference seems to be as late as that or later (negative: early);
    /// [`Self::reference_lag`] is then `None`.
    ///
    /// ```
    /// let recording = ohmstrain::Recording::new(&[0.0, 0.1], &[1600.0, 1610.0], &[0.00, 0.01])?;
    /// assert_eq!(recording.lag_out_of_reach(), None);
    /// # Ok::<(), ohmstrain::Error>(())
    /// ```
    #[must_use]
    pub fn lag_out_of_reach(&self) -> Option<f64> {
        self.screened(lag_out_of_reach)
    }

    /// What the recording without distrusted rows says.
    fn screened<T>(&self, said: impl Fn(&Samples) -> Option<T>) -> Option<T> {
        match screen(&[self.samples]) {
            Ok(screened) => screened.samples().first().and_then(said),
            // Which may be a lag's own doing.
            Err(CalibrationError::NothingExplained { .. }) => said(&self.samples),
            // What cannot be screened is for the calibration to refuse.
            Err(_) => None,
        }
    }
}

/// What recordings tell of the parameters of the law that was fitted to them, what they leave open, and what to record next.
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
