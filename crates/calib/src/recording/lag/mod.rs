//! The lag of a reference behind the readings: the one estimate of it, for one clock and for two.

mod law;
mod motion;
mod search;

use std::fmt;

use thiserror::Error;

use crate::CalibrationError;
use crate::recording::screen::screen;
use crate::samples::Samples;
use law::lag_by_law;
use search::Search;

/// Lags of a reference on the readings' clock are looked for this far, s: as far as devices started by hand are apart.
const FARTHEST_S: f64 = 12.0;
/// Length of a recording, in multiples of the farthest lag, from which on the law tells the lag: it knows relaxation, and needs
/// readings with a reference on both sides of all lags. In shorter ones it takes one movement for another, and only the motion is used.
const LONG: f64 = 10.0;
/// Factor by which a lag has to lower the squared error to be reported. Of 104 public recordings as they are, parts of 15 s and more
/// among them, two show as much.
const SURE: f64 = 2.5;
/// Gain from which on there is hardly a doubt, if the motion explains the readings and the lag is more than a sensor's own: none of
/// those 104, and of 311 simulated ones, shows all three …
const CERTAIN: f64 = 6.0;
/// … but for this share of their variance, at most.
const WELL_EXPLAINED: f64 = 0.3;
/// A sensor's own hysteresis looks like a lag. Standard deviation of that as a share of a movement: of eight public recordings
/// of one rig it is -0.10 to 0.09.
const OWN_SHARE: f64 = 0.05;
/// A lag of more than this share of a movement turns stretching into releasing for that share of the time.
const LARGEST_SHARE: f64 = 0.1;
/// Standard deviations that a lag must differ from zero by.
const SIGNIFICANT: f64 = 3.0;

/// Lag of a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// Positive if what the reading shows now stands in the reference later, s.
    pub lag_s: f64,
    /// Standard deviation, s: from leaving out a tenth of the rows at a time and from what counts as slow, or of the lags that were
    /// tried.
    pub sd_s: f64,
    /// Standard deviation of the lag that the sensor itself may have, which cannot be told apart from the reference's, s.
    pub own_s: f64,
    /// Duration of a movement, s.
    pub movement_s: f64,
    /// Squared error on blocks left out without the lag, over that with it.
    pub gain: f64,
    /// Share of the readings' variance that stays unexplained at this lag.
    pub unexplained: f64,
    /// True if hardly any recording that is on time looks like that.
    pub(crate) certain: bool,
}

impl Lag {
    /// True if the readings are explained so much better with the lag that it is worth saying.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.gain >= SURE
    }

    /// True if hardly any recording that is on time looks like that.
    #[must_use]
    pub const fn is_certain(&self) -> bool {
        self.certain
    }

    /// True if the lag is more than a tenth of a movement: such a recording, if that [is certain](Self::is_certain), is not to be
    /// calibrated on as it is.
    #[must_use]
    pub fn is_too_late(&self) -> bool {
        self.lag_s.abs() > LARGEST_SHARE * self.movement_s && self.lag_s.abs() > SIGNIFICANT * self.sd_s
    }
}

/// `2.00 ± 0.05 s late`, what the sensor itself may lag included in the standard deviation.
impl fmt::Display for Lag {
    fn fmt(&self, out: &mut fmt::Formatter) -> fmt::Result {
        let word = if self.lag_s < 0.0 { "early" } else { "late" };
        write!(out, "{:.2} ± {:.2} s {word}", self.lag_s.abs(), self.sd_s.hypot(self.own_s))
    }
}

/// Reason why the motion does not tell a lag.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LagError {
    /// No lag explains the readings best.
    #[error("the readings do not tell")]
    Untold,
    /// Too little of either.
    #[error("too few rows with readings or reference, or no motion")]
    Short,
    /// The reference explains too little of the readings.
    #[error("the motion does not show in the readings ({:.0} % of their variance stays unexplained at best)", 100.0 * .0.min(1.0))]
    Unseen(f64),
    /// The best lag, s, is the largest one tried.
    #[error("the best offset, {0:.3} s, is the farthest that was tried")]
    AtEnd(f64),
    /// The motion repeats: two lags, s, the better one first.
    #[error("the motion repeats, {0:.3} s and {1:.3} s fit alike")]
    Repeats(f64, f64),
}

/// Finds the lag of a reference on the readings' clock, within ±12 s.
///
/// In recordings of two minutes and more it is the lag at which a law with two branches explains the readings best, on held-out blocks. In
/// shorter ones, at each lag the readings are regressed on the reference there: its first three powers, and its movements,
/// with and without their sign, through low-passes of one and eight times the time of a full stretch. Changes slower than two
/// full stretches are taken out of both sides. A lag is judged by readings that are left out of the regression, and rows that it
/// leaves without a reference count as unexplained. Zero is returned unless the readings speak against a reference
/// on time. Rows that calibration does not believe take no part.
///
/// # Errors
/// [`LagError`] if the motion does not tell.
pub fn reference_lag(samples: &Samples) -> Result<Lag, LagError> {
    match screen(&[*samples]) {
        Ok(screened) => screened.samples().first().map_or(Err(LagError::Short), on_one_clock),
        // Which may be a lag's own doing.
        Err(CalibrationError::NothingExplained { .. }) => on_one_clock(samples),
        Err(_) => Err(LagError::Short),
    }
}

fn on_one_clock(samples: &Samples) -> Result<Lag, LagError> {
    let lasts_s = samples.time_s.last().zip(samples.time_s.first()).map_or(0.0, |(last, first)| last - first);
    if lasts_s >= LONG * FARTHEST_S { lag_by_law(samples) } else { lag_by_motion(samples) }
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

/// A lag that the motion tells.
fn of_motion(lag_s: f64, sd_s: f64, movement_s: f64, gain: f64, unexplained: f64) -> Lag {
    let own_s = OWN_SHARE * movement_s;
    let certain = gain >= CERTAIN && unexplained <= WELL_EXPLAINED && lag_s.abs() > SIGNIFICANT * sd_s.hypot(own_s);
    Lag { lag_s, sd_s, own_s, movement_s, gain, unexplained, certain }
}

/// Lag of a reference with a clock of its own, each `(times in s, values)`: what to subtract from its times to get the readings'.
///
/// As [`reference_lag`], for any offset that leaves two fifths of the shorter recording in common.
///
/// # Errors
/// [`LagError`] if the motion does not tell: other than on one clock, an offset of zero is no likelier than any other.
pub fn clock_lag(readings: (&[f64], &[f64]), reference: (&[f64], &[f64])) -> Result<Lag, LagError> {
    let search = Search::new(readings, reference, None)?;
    let best = search.best()?;
    search.end(best).map_or(Ok(()), |end_s| Err(LagError::AtEnd(end_s)))?;
    search.check(best)?;
    search.lag(best, readings, reference)
}

/// Returns the reference of each row, moved by `-lag_s`: its value that much later, interpolated; NaN beyond its ends.
#[must_use]
pub fn aligned(samples: &Samples, lag_s: f64) -> Vec<f64> {
    let known: Vec<(f64, f64)> = samples
        .time_s
        .iter()
        .zip(samples.strain)
        .filter_map(|(&time_s, &strain)| strain.is_finite().then_some((time_s, strain)))
        .collect();
    let at = |time_s: f64| {
        let after = known.partition_point(|(known_s, _)| *known_s < time_s);
        match (after.checked_sub(1).and_then(|before| known.get(before)), known.get(after)) {
            (_, Some((b_s, b))) if *b_s == time_s => *b,
            (Some((a_s, a)), Some((b_s, b))) => a + (time_s - a_s) / (b_s - a_s) * (b - a),
            _ => f64::NAN,
        }
    };
    samples.time_s.iter().map(|time_s| at(time_s + lag_s)).collect()
}
