//! The lag of a reference behind the readings: the only estimate of it, for one clock and for two.

mod law;
mod motion;
mod search;

use std::fmt;

use thiserror::Error;

use crate::CalibrationError;
use crate::recording::screen::screen;
use crate::samples::{LONGEST_GAP, Samples, usual_step_s};
use law::lag_by_law;
use search::Search;

/// Largest lag of a reference on the readings' clock that is searched, s: the largest offset between devices started by hand.
const FARTHEST_S: f64 = 12.0;
/// Least length of a recording, in multiples of the largest lag, for an estimate by the law. The law includes relaxation, and needs
/// readings with a reference on both sides of all lags. In shorter recordings it confuses movements, and only the motion is used.
const LONG: f64 = 10.0;
/// Factor by which a lag must lower the squared error to be reported. Of 104 public recordings as they are, parts of 15 s and more among
/// them, two reach it.
const SURE: f64 = 2.5;
/// Gain beyond which a lag is practically certain, if the motion explains the readings and the lag exceeds a sensor's own: none of those
/// 104 recordings, and of 311 simulated ones, meets all three conditions.
const CERTAIN: f64 = 6.0;
/// Largest unexplained fraction of the readings' variance at which the motion counts as explaining them.
const WELL_EXPLAINED: f64 = 0.3;
/// Standard deviation of a sensor's own lag, which looks like one of the reference, in movements. In eight public recordings of one rig,
/// hysteresis gives -0.10 to 0.09.
const OWN_SHARE: f64 = 0.05;
/// Lag, in movements, above which a reference is too late: for that fraction of the time, stretching counts as releasing.
const LARGEST_SHARE: f64 = 0.1;
/// Least number of standard deviations by which a lag must differ from zero.
const SIGNIFICANT: f64 = 3.0;

/// Lag of a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// Lag, s; positive if the reference shows later what the reading shows now.
    pub lag_s: f64,
    /// Standard deviation, s: from leaving out a tenth of the rows at a time and from the choice of the high-pass, or from the spacing of
    /// the lags tried.
    pub sd_s: f64,
    /// Standard deviation of the sensor's own lag, s, which cannot be separated from that of the reference.
    pub own_s: f64,
    /// Duration of a movement, s.
    pub movement_s: f64,
    /// Squared error on held-out blocks without the lag, over that with it.
    pub gain: f64,
    /// Fraction of the readings' variance that is unexplained at this lag.
    pub unexplained: f64,
    /// True if hardly any recording without a lag shows one like this.
    pub(crate) certain: bool,
}

impl Lag {
    /// True if the lag explains the readings so much better that it should be reported.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.gain >= SURE
    }

    /// True if hardly any recording without a lag shows one like this.
    #[must_use]
    pub const fn is_certain(&self) -> bool {
        self.certain
    }

    /// True if the lag is more than a tenth of a movement. If it [is also certain](Self::is_certain), the recording must not be used for
    /// calibration as it is.
    #[must_use]
    pub fn is_too_late(&self) -> bool {
        self.lag_s.abs() > LARGEST_SHARE * self.movement_s && self.lag_s.abs() > SIGNIFICANT * self.sd_s
    }
}

/// Writes for example `2.00 ± 0.05 s late`; the standard deviation includes the sensor's own lag.
impl fmt::Display for Lag {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let word = if self.lag_s < 0.0 { "early" } else { "late" };
        write!(out, "{:.2} ± {:.2} s {word}", self.lag_s.abs(), self.sd_s.hypot(self.own_s))
    }
}

/// Reason why the motion does not determine a lag.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LagError {
    /// No lag explains the readings best.
    #[error("the readings do not tell")]
    Undetermined,
    /// Too few readings or reference values, or no motion.
    #[error("too few rows with readings or reference, or no motion")]
    Short,
    /// The reference explains too little of the readings.
    #[error("the motion does not show in the readings ({:.0} % of their variance stays unexplained at best)", 100.0 * .0.min(1.0))]
    Unseen(f64),
    /// The best lag, s, is at an end of those tried.
    #[error("the best offset, {0:.3} s, is the farthest that was tried")]
    AtEnd(f64),
    /// The motion repeats: two lags, s, the better one first.
    #[error("the motion repeats, {0:.3} s and {1:.3} s fit alike")]
    Repeats(f64, f64),
}

/// Finds the lag of a reference on the readings' clock, within ±12 s.
///
/// In recordings of two minutes and more it is the lag at which a law with two branches explains the readings best, on held-out blocks. In
/// shorter ones, the readings are regressed, at each lag, on the reference: its first three powers, and its movements, with and without
/// their sign, through low-passes of one and eight times the time of a full stretch. Changes slower than two full stretches are removed
/// from both sides. A lag is judged by readings that are left out of the regression; rows that it leaves without a reference count as
/// unexplained. Zero is returned unless the readings contradict a reference on time. Rows that calibration distrusts are left out.
///
/// # Errors
/// [`LagError`] if the motion does not determine a lag.
pub fn reference_lag(samples: &Samples) -> Result<Lag, LagError> {
    match screen(&[*samples]) {
        Ok(screened) => screened.samples().first().map_or(Err(LagError::Short), on_one_clock),
        // The cause may itself be a lag.
        Err(CalibrationError::NothingExplained { .. }) => on_one_clock(samples),
        Err(_) => Err(LagError::Short),
    }
}

fn on_one_clock(samples: &Samples) -> Result<Lag, LagError> {
    if samples.duration_s() >= LONG * FARTHEST_S { lag_by_law(samples) } else { lag_by_motion(samples) }
}

fn lag_by_motion(samples: &Samples) -> Result<Lag, LagError> {
    let (readings, reference) = ((samples.time_s, samples.reading), (samples.time_s, samples.strain));
    let search = Search::new(readings, reference, Some(FARTHEST_S))?;
    let best = search.best()?;
    let found = |i: usize| search.lag(i, readings, reference);
    if let Some(on_time) = search.nearest_to_zero(best, LARGEST_SHARE) {
        return found(on_time);
    }
    let is_sure = search.gain(best) >= SURE;
    match search.end(best) {
        Some(end_s) if is_sure => return Err(LagError::AtEnd(end_s)),
        Some(_) => return found(search.zero()),
        None => {}
    }
    if is_sure {
        search.check(best)?;
    }
    found(best)
}

/// Returns a lag that was found from the motion.
fn of_motion(lag_s: f64, sd_s: f64, movement_s: f64, gain: f64, unexplained: f64) -> Lag {
    let own_s = OWN_SHARE * movement_s;
    let certain = gain >= CERTAIN && unexplained <= WELL_EXPLAINED && lag_s.abs() > SIGNIFICANT * sd_s.hypot(own_s);
    Lag { lag_s, sd_s, own_s, movement_s, gain, unexplained, certain }
}

/// Returns the lag of a reference with a clock of its own, each `(times in s, values)`: the offset to subtract from its times.
///
/// As [`reference_lag`], for any offset that leaves two fifths of the shorter recording in common.
///
/// # Errors
/// [`LagError`] if the motion does not determine a lag. Unlike on one clock, an offset of zero is no likelier than any other.
pub fn clock_lag(readings: (&[f64], &[f64]), reference: (&[f64], &[f64])) -> Result<Lag, LagError> {
    let search = Search::new(readings, reference, None)?;
    let best = search.best()?;
    search.end(best).map_or(Ok(()), |end_s| Err(LagError::AtEnd(end_s)))?;
    search.check(best)?;
    search.lag(best, readings, reference)
}

/// Returns the reference of each row, moved by `-lag_s`: its value that much later, interpolated; NaN beyond its ends and in gaps of more
/// than ten of its usual steps.
#[must_use]
pub fn aligned(samples: &Samples, lag_s: f64) -> Vec<f64> {
    let rows = samples.time_s.iter().zip(samples.strain).filter(|(_, strain)| strain.is_finite());
    let (known_s, known): (Vec<f64>, Vec<f64>) = rows.unzip();
    let longest_s = LONGEST_GAP * usual_step_s(std::iter::once(&known_s[..]));
    let at = |time_s: f64| {
        let after = known_s.partition_point(|known_s| *known_s < time_s);
        let row = |row: usize| Some((*known_s.get(row)?, *known.get(row)?));
        match (after.checked_sub(1).and_then(row), row(after)) {
            (_, Some((b_s, b))) if b_s == time_s => b,
            (Some((a_s, a)), Some((b_s, b))) if b_s - a_s <= longest_s => a + (time_s - a_s) / (b_s - a_s) * (b - a),
            _ => f64::NAN,
        }
    };
    samples.time_s.iter().map(|time_s| at(time_s + lag_s)).collect()
}
