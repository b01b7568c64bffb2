//! Estimates the lag by the law, if the recording is long enough.

use nalgebra::DVector;

use crate::law::design::BRANCH_COLUMNS;
use crate::law::regression::LawRegression;
use crate::law::robust_loss::{preliminary, robust};
use crate::low_pass::LowPass;
use crate::motion_stats::MotionStats;
use crate::samples::{FEWEST_ROWS, Samples};

use super::{FARTHEST_S, Lag, LagError, SURE, aligned};

/// Grid of the lags to try.
#[derive(Clone, Copy)]
struct Lags {
    /// Middle of the lags tried, s.
    around_s: f64,
    /// Distance to which lags are tried on both sides, s.
    reach_s: f64,
    /// Number of lags tried to each side.
    steps: u32,
    /// Largest number of rows kept.
    rows: usize,
}

/// Coarse search, over the offsets of clocks that are started by hand.
const FAR: Lags = Lags { around_s: 0.0, reach_s: FARTHEST_S, steps: 24, rows: 1500 };
/// Fine search, around the result of the coarse one.
const NEAR: Lags = Lags { around_s: 0.0, reach_s: 1.0, steps: 20, rows: 6000 };
/// Ratio of squared errors up to which a lag counts as good as the best one; the smallest such lag is chosen, because periodic movements
/// look alike one period later.
const AS_GOOD: f64 = 1.2;
/// Largest unexplained fraction of the readings' changes with which a gauge alone is used, if the body does not rest. In slow, even motion,
/// a law with branches mistakes a lag for relaxation, and half a period for another part of it. Public recordings of movements leave 0.03
/// to 0.2. In holds the law identifies relaxation, which a gauge mistakes for a lag, with gains of up to 55.
const OF_GAUGE: f64 = 0.3;
/// Largest own lag of a sensor behind the strain, by its hysteresis, in movements. A gauge takes it for an early reference.
const OWN_SHARE: f64 = 0.1;
/// Ridge of the law, in the middle of those that calibration tries.
const RIDGE: f64 = 0.01;
/// Gain beyond which a lag is practically certain. Of 1440 simulated recordings as they are, whole, halves and thirds, 43 show a lag of
/// more than a tenth of a movement with a gain of [`SURE`] (in three movements between long holds up to 5.5, by a gauge up to 4.6), four
/// with this gain (halves with sines of a sensor with much hysteresis). Of public recordings, whole to quarters, none shows more than 3.2.
const CERTAIN: f64 = 6.0;
/// Fraction of the readings' mean square below which errors count as equal: a law with a ridge leaves this much even if it is the sensor's
/// own. At half a period, one part of a sine explains another, and no worse. Public recordings leave 0.006 and more.
const EXPLAINED: f64 = 1e-3;
/// Number of dash-pot columns, between gauge and branches.
const DASH_POTS: usize = 2;
/// Number of coefficients of the polynomial gauge.
const GAUGE: usize = 3;

/// Estimates the lag of a reference by the law.
///
/// The result is the lag, within ±12 s if it is [sure](Lag::is_sure) and ±1 s if not, at which a law with two branches, a cubic gauge and
/// no dash-pots best explains the readings, on held-out blocks. Law and readings are compared after a high-pass whose time constant is the
/// range of the lags: a lag shows where the movement changes, whereas slow errors of the law, which are larger, would move it by half a
/// second and more. A dash-pot is left out because it looks like a lag, so a sensor's own dash-pot is part of the result. A periodic
/// movement cannot separate a lag from one that is a period longer; the smaller one is returned.
///
/// The gauge alone is used as well, over ±12 s, if the body does not rest and the gauge explains most of the changes. It does not mistake a
/// lag for relaxation, but cannot separate the sensor's own lag. If it contradicts the lag of the law, that lag is discarded. Its own lag,
/// in the middle of the range that remains possible, is accepted from 0.15 movements on.
pub(super) fn lag_by_law(samples: &Samples) -> Result<Lag, LagError> {
    let errors = errors(samples, FAR).ok_or(LagError::Short)?;
    match by_law_and_gauge(samples, &errors) {
        Some(lag) if lag.is_sure() => Ok(lag),
        unsure => out_of_reach(&errors.law)
            .map_or_else(|| unsure.ok_or(LagError::Undetermined), |end_s| Err(LagError::AtEnd(end_s))),
    }
}

fn by_law_and_gauge(samples: &Samples, errors: &Errors) -> Option<Lag> {
    let found = best_lag(&errors.law, FAR).and_then(|(around_s, _)| examined(samples, around_s));
    let by_law = found.filter(Lag::is_sure).or_else(|| examined(samples, 0.0));
    let motion = MotionStats::new(&[*samples]);
    if motion.hold_s.is_some() || least(&errors.gauge) >= OF_GAUGE {
        return by_law;
    }
    match by_law.filter(|lag| !(lag.is_sure() && contradicts(&errors.gauge, lag))) {
        Some(lag) if lag.is_sure() => Some(lag),
        unsure => of_gauge(&errors.gauge, motion.move_s).or(unsure),
    }
}

/// Returns the lag by the gauge alone, if it is sure and larger than a sensor's own.
fn of_gauge(errors: &[f64], movement_s: f64) -> Option<Lag> {
    let (lag_s, error) = best_lag(errors, FAR)?;
    let own_s = 0.5 * OWN_SHARE * movement_s;
    let gain = errors.get(FAR.steps as usize)? / error.max(EXPLAINED);
    let lag = lag_of(lag_s + own_s, own_s, FAR, movement_s, gain, error);
    (lag.is_sure() && lag.lag_s.abs() > 3.0 * own_s).then_some(lag)
}

/// True if the gauge's errors around this lag, extended by the sensor's possible own lag, are much larger than elsewhere.
fn contradicts(errors: &[f64], lag: &Lag) -> bool {
    let (first_s, last_s) =
        (lag.lag_s - OWN_SHARE * lag.movement_s - 1.5 * FAR.step_s(), lag.lag_s + 1.5 * FAR.step_s());
    let near = (0..errors.len()).filter(|i| (first_s..=last_s).contains(&FAR.offset_s(*i))).map(|i| errors[i]);
    near.fold(f64::INFINITY, f64::min) > SURE * least(errors).max(EXPLAINED)
}

/// Returns the end of the searched range, s (negative: the reference is early), if the readings are explained best there, and surely better
/// than without a lag; the clocks then differ by more than that.
fn out_of_reach(errors: &[f64]) -> Option<f64> {
    let least = least(errors);
    let is_sure = *errors.get(FAR.steps as usize)? >= SURE * least.max(EXPLAINED);
    let is_least = |error: Option<&f64>| is_sure && error == Some(&least);
    match (is_least(errors.first()), is_least(errors.last())) {
        (true, false) => Some(-FAR.reach_s),
        (false, true) => Some(FAR.reach_s),
        _ => None,
    }
}

/// Returns the best lag near `around_s`.
fn examined(samples: &Samples, around_s: f64) -> Option<Lag> {
    let search = Lags { around_s, ..NEAR };
    let (lag_s, least) = best_lag(&errors(samples, search)?.law, search)?;
    let [now, _] = left_out_errors(samples, 0.0, search)?;
    let movement_s = MotionStats::new(&[*samples]).move_s;
    Some(lag_of(lag_s, 0.0, search, movement_s, now / least.max(EXPLAINED), least))
}

/// Returns a lag with a standard deviation of half a step of the search.
fn lag_of(lag_s: f64, own_s: f64, search: Lags, movement_s: f64, gain: f64, unexplained: f64) -> Lag {
    let sd_s = 0.5 * search.step_s();
    Lag { lag_s, sd_s, own_s, movement_s, gain, unexplained, certain: gain >= CERTAIN }
}

fn least(errors: &[f64]) -> f64 {
    errors.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Returns the best lag of a search, interpolated, and its error; `None` if it is at an end.
fn best_lag(errors: &[f64], search: Lags) -> Option<(f64, f64)> {
    let least = least(errors);
    let is_valley =
        |i: usize| i > 0 && i + 1 < errors.len() && errors[i] <= errors[i - 1] && errors[i] <= errors[i + 1];
    let good = (0..errors.len()).filter(|&i| errors[i] <= AS_GOOD * least.max(EXPLAINED));
    let best = good.filter(|&i| is_valley(i) || errors[i] == least).min_by(|a, b| {
        let size = |i: usize| (search.around_s + search.offset_s(i)).abs();
        size(*a).total_cmp(&size(*b))
    })?;
    let (before, after) = (errors.get(best.checked_sub(1)?)?, errors.get(best + 1)?);
    // Minimum of the parabola through the best lag and its neighbours.
    let curvature = before - 2.0 * errors[best] + after;
    let offset = if curvature > 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
    Some((search.around_s + search.offset_s(best) + offset * search.step_s(), errors[best]))
}

/// Errors at every lag of a search.
struct Errors {
    /// Errors of the law.
    law: Vec<f64>,
    /// Errors of the gauge alone.
    gauge: Vec<f64>,
}

fn errors(samples: &Samples, search: Lags) -> Option<Errors> {
    let lags = 0..=2 * search.steps as usize;
    let at =
        |i| left_out_errors(samples, search.around_s + search.offset_s(i), search).map(|[law, gauge]| (law, gauge));
    let (law, gauge) = lags.map(at).collect::<Option<Vec<_>>>()?.into_iter().unzip();
    Some(Errors { law, gauge })
}

impl Lags {
    fn step_s(&self) -> f64 {
        self.reach_s / f64::from(self.steps)
    }

    /// Returns the distance of the i-th lag from the middle, s.
    fn offset_s(&self, i: usize) -> f64 {
        (i as f64 - f64::from(self.steps)) * self.step_s()
    }
}

/// Returns the squared error of the law, and of its gauge alone, on held-out blocks, relative to the readings' mean square. Both are
/// high-passed, and the reference is read `lag_s` later.
fn left_out_errors(samples: &Samples, lag_s: f64, search: Lags) -> Option<[f64; 2]> {
    let strain = aligned(samples, lag_s);
    // All lags are judged on the same rows: those with a reference within reach on both sides.
    let reach_s = search.around_s.abs() + search.reach_s;
    let (first_s, last_s) = (samples.time_s.first()? + reach_s, samples.time_s.last()? - reach_s);
    let stride = samples.len().div_ceil(search.rows);
    let within = |k: &usize| (first_s..=last_s).contains(&samples.time_s[*k]);
    let rows: Vec<usize> = (0..samples.len()).step_by(stride).filter(within).collect();
    if rows.len() < FEWEST_ROWS {
        return None;
    }
    let pick = |values: &[f64]| rows.iter().map(|&k| values[k]).collect::<Vec<f64>>();
    let (time_s, strain) = (pick(samples.time_s), pick(&strain));
    let reading: Vec<f64> =
        rows.iter().map(|&k| if samples.strain[k].is_finite() { samples.reading[k] } else { f64::NAN }).collect();
    let shifted = Samples { time_s: &time_s, reading: &reading, strain: &strain, strain_sd: &[] };
    let regression = robust(LawRegression::new(&[shifted]).ok()?);
    let structure = preliminary(&regression);
    let mut design = structure.design(&regression);
    let times: Vec<f64> = regression.recordings[0].complete.iter().map(|&k| time_s[k]).collect();
    let rest_readings = regression.median_readings();
    let response = regression.response(&rest_readings);
    // The time constant is the full range of the lags.
    let high_pass = |column: &DVector<f64>| high_pass(&times, column, 2.0 * search.reach_s);
    let changes = high_pass(&response);
    let mean_square = changes.norm_squared() / changes.len() as f64;
    design.offset = &response - changes;
    // The constant is not filtered: it belongs to the regression.
    for column in design.columns.iter_mut().skip(1) {
        *column = high_pass(column);
    }
    let normal = regression.normal(&design, &rest_readings);
    let branches = 1 + GAUGE + DASH_POTS;
    let with_branches: Vec<usize> = (0..=GAUGE).chain(branches..branches + structure.taus * BRANCH_COLUMNS).collect();
    let error = |columns: &[usize]| Some(normal.cross_validate(columns, RIDGE)? / mean_square);
    Some([error(&with_branches)?, error(&with_branches[..=GAUGE])?])
}

/// Applies a high-pass with time constant `tau_s` to a column.
fn high_pass(time_s: &[f64], column: &DVector<f64>, tau_s: f64) -> DVector<f64> {
    let mut low_pass = LowPass::new(tau_s);
    DVector::from_iterator(
        column.len(),
        time_s.iter().zip(column.iter()).map(|(&time_s, &value)| value - low_pass.next(time_s, value)),
    )
}
