use ohmstrain_calib::{Mark, MarkedReference, Samples};

use crate::{Error, Recording};

/// Estimates references for recordings whose strain is known at marks only; references in `recordings` are ignored. Calibrate
/// on recordings with these strains and [`Recording::with_strain_sd`].
///
/// # Errors
/// If the numbers of lists of marks and of recordings differ, if marks contradict each other or lie outside their recording, or
/// if no law explains the motion.
///
/// ```
/// use ohmstrain::{Mark, Recording, marked_references};
///
/// // A body that goes to 0.3 and back in 12 s, again and again; only the ends of its way are known.
/// let time_s: Vec<f64> = (0..900).map(|k| 0.1 * f64::from(k)).collect();
/// let strain = |t: f64| 0.15 - 0.15 * (std::f64::consts::TAU * t / 12.0).cos();
/// let ohm: Vec<f64> = time_s.iter().map(|t| 1600.0 * (1.0 + 1.9 * strain(*t))).collect();
/// let marks: Vec<Mark> = (0..15).map(|k| Mark::new(6.0 * f64::from(k), 0.3 * f64::from(k % 2))).collect();
/// let unknown = vec![f64::NAN; time_s.len()];
/// let recording = Recording::new(&time_s, &ohm, &unknown)?;
/// let found = marked_references(&[recording], &[marks])?.remove(0);
/// assert!(found.strain.iter().zip(&time_s).all(|(found, t)| !(*t <= 84.0) || (found - strain(*t)).abs() < 0.03));
/// let recording = Recording::new(&time_s, &ohm, &found.strain)?.with_strain_sd(&found.strain_sd)?;
/// # Ok::<(), ohmstrain::Error>(())
/// ```
pub fn marked_references(recordings: &[Recording], marks: &[Vec<Mark>]) -> Result<Vec<MarkedReference>, Error> {
    let samples: Vec<Samples> = recordings.iter().map(|recording| recording.samples).collect();
    Ok(ohmstrain_calib::marked_references(&samples, marks)?)
}
