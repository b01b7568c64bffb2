//! Calibration without a test stage: the strain is known at marks, and the motion between them is fitted together with the law.
//!
//! A person bends to a mark, waits, and comes back; nothing measures the strain in between. Between two marks the body is assumed to move
//! with a common velocity profile ([`motion`]), to hold where the readings come to rest ([`holds`]), and to have a pace of its own where
//! the law does not explain the common profile ([`pace`]). Times and strains of the marks, paces and the law are then fitted together
//! ([`joint`]). The result is a reference with a standard deviation in every row.

mod holds;
mod joint;
mod mark;
mod motion;
mod pace;

use nalgebra::DVector;
use ohmstrain_model::StrainRange;

use crate::CalibrationError;
use crate::calibrate::calibrate_once;
use crate::law::fit::LawOptions;
use crate::order::extent;
use crate::samples::Samples;
use ohmstrain_sensor::EstimatorKind;

use joint::fit;
pub use mark::{Mark, MarksError};
use motion::MarkedMotion;

/// Velocity profiles tried: constant speed, and two between that and minimum jerk.
const SHAPES: [f64; 3] = [0.0, 0.4, 0.8];

/// A reference estimated from marks.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkedReference {
    /// Strain of each row; NaN before the first mark and after the last.
    pub strain: Vec<f64>,
    /// Its standard deviation; NaN in the same rows.
    pub strain_sd: Vec<f64>,
    /// Number of marks at which the body was held.
    pub holds: usize,
    /// Number of moves with a pace of their own.
    pub irregular: usize,
    /// Number of moves.
    pub moves: usize,
}

/// Estimates references for recordings whose strain is known at marks only; the strains in `recordings` are ignored. Each recording has a
/// list of marks in order of time.
///
/// The common velocity profile is the one whose calibrated extended Kalman filter scores best on held-out quarters.
///
/// # Errors
/// [`CalibrationError::Unsupported`] if there are not as many lists as recordings, [`CalibrationError::Marks`] if marks contradict each
/// other or lie outside of their recording, and as
/// [`calibrate`](crate::calibrate) if no law explains the motion.
pub fn marked_references(
    recordings: &[Samples],
    marks: &[Vec<Mark>],
) -> Result<Vec<MarkedReference>, CalibrationError> {
    if marks.len() != recordings.len() {
        let (lists, recordings) = (marks.len(), recordings.len());
        return Err(CalibrationError::Unsupported(format!(
            "{lists} lists of marks for {recordings} recordings; expected one for each"
        )));
    }
    let mut ranges = Vec::with_capacity(recordings.len());
    for (recording, (samples, marks)) in recordings.iter().zip(marks).enumerate() {
        let in_recording = |source| CalibrationError::Marks { recording, source };
        ranges.push(mark::check(marks, samples.time_s).map_err(in_recording)?);
    }
    let (lower, upper) = extent(ranges.into_iter().flat_map(<[f64; 2]>::from));
    let range = StrainRange { lower, upper };
    let motions = |shape: f64| -> Vec<MarkedMotion> {
        let of_one = |(samples, marks): (&Samples, &Vec<Mark>)| MarkedMotion::new(samples, marks, range.span(), shape);
        recordings.iter().zip(marks).map(of_one).collect()
    };
    let tried = SHAPES.map(|shape| (shape, score(recordings, &motions(shape))));
    let best = tried.iter().filter_map(|(shape, score)| Some((*shape, *score.as_ref().ok()?)));
    let Some((shape, _)) = best.min_by(|a, b| a.1.total_cmp(&b.1)) else {
        let [(_, first), ..] = tried;
        return Err(first.err().unwrap_or(CalibrationError::Singular));
    };
    recordings.iter().zip(motions(shape)).map(|(samples, motion)| reference(samples, motion, range)).collect()
}

/// Returns the score of an extended Kalman filter that is calibrated on regular motions; smaller is better.
fn score(recordings: &[Samples], motions: &[MarkedMotion]) -> Result<f64, CalibrationError> {
    let of_one = |(samples, motion): (&Samples, &MarkedMotion)| {
        motion.strains(&DVector::zeros(motion.parameters()), samples.time_s)
    };
    let strains: Vec<Vec<f64>> = recordings.iter().zip(motions).map(of_one).collect();
    let samples: Vec<Samples> =
        recordings.iter().zip(&strains).map(|(samples, strain)| Samples { strain, ..*samples }).collect();
    let calibration = calibrate_once(&samples, &[LawOptions::default()], &[EstimatorKind::Ekf], None, |_| {})?;
    calibration.params.estimators.get(&EstimatorKind::Ekf).map(|params| params.score).ok_or(CalibrationError::Singular)
}

fn reference(
    samples: &Samples,
    motion: MarkedMotion,
    range: StrainRange<f64>,
) -> Result<MarkedReference, CalibrationError> {
    let fitted = fit(samples, motion, range)?;
    let (strain, strain_sd) = fitted.strains(samples.time_s);
    let motion = &fitted.motion;
    Ok(MarkedReference {
        strain,
        strain_sd,
        holds: motion.holds(),
        irregular: motion.irregular(),
        moves: motion.moves(),
    })
}
