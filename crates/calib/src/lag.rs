use nalgebra::DVector;

use crate::design::BRANCH_COLUMNS;
use crate::law_fit::GaugeFamily;
use crate::law_params::LawParams;
use crate::law_regression::LawRegression;
use crate::law_structure::LawStructure;
use crate::low_pass::LowPass;
use crate::samples::Samples;

/// Lags tried reach this far to both sides, s.
const FARTHEST_S: f64 = 1.0;
/// Lags tried to each side.
const STEPS: usize = 20;
/// Time constant of the high-pass, s: as long as the lags reach from one side to the other.
const HIGH_PASS_S: f64 = 2.0 * FARTHEST_S;
/// Ridge of the law, in the middle of those that calibration tries.
const RIDGE: f64 = 0.01;
/// Dash-pots: the two columns between gauge and branches.
const DASH_POTS: usize = 2;
/// Coefficients of the polynomial gauge.
const GAUGE: usize = 3;

/// How far the reference lags behind the reading, s: positive if what the reading shows now stands in the reference later.
///
/// The lag, within ±1 s, at which a law with the time constants of `law`, a cubic gauge and no dash-pots explains the
/// readings best, on blocks left out. Law and readings are compared through a high-pass: a lag shows where the movement
/// changes, and slow errors of the law, which are larger, would move it by half a second and more. A dash-pot is left out
/// because it looks like a lag: what a sensor has of one is part of the answer.
///
/// `None` if no lag within ±1 s is best, or the recording is too short or too plain to tell.
#[must_use]
pub fn reference_lag(samples: &Samples, law: &LawParams) -> Option<f64> {
    let step_s = FARTHEST_S / STEPS as f64;
    let lag_s = |i: usize| (i as f64 - STEPS as f64) * step_s;
    let errors: Vec<f64> = (0..=2 * STEPS).map(|i| left_out_error(samples, law, lag_s(i))).collect::<Option<_>>()?;
    let (best, _) = errors.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
    let (before, after) = (errors.get(best.checked_sub(1)?)?, errors.get(best + 1)?);
    // The minimum of the parabola through the best lag and its neighbours.
    let curvature = before - 2.0 * errors[best] + after;
    let offset = if curvature > 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
    Some(lag_s(best) + offset * step_s)
}

/// Mean squared error of the law behind the high-pass, on blocks left out, if the reference is read `lag_s` later.
fn left_out_error(samples: &Samples, law: &LawParams, lag_s: f64) -> Option<f64> {
    let strain = advanced(samples, lag_s);
    // Every lag is judged by the same rows: those that have a reference within reach on both sides.
    let (first_s, last_s) = (samples.time_s.first()? + FARTHEST_S, samples.time_s.last()? - FARTHEST_S);
    let within = |k: usize| (first_s..=last_s).contains(&samples.time_s[k]) && samples.strain[k].is_finite();
    let reading: Vec<f64> = (0..samples.len()).map(|k| if within(k) { samples.reading[k] } else { f64::NAN }).collect();
    let shifted = Samples { time_s: samples.time_s, reading: &reading, strain: &strain };
    let regression = LawRegression::new(&[shifted]).ok()?;
    let taus: Vec<f64> = law.branches.iter().map(|branch| branch.tau_s.ln()).collect();
    let family = GaugeFamily::Polynomial;
    let structure = LawStructure { family, taus: taus.len(), nonlinear: taus, ridge: RIDGE };
    let mut design = structure.design(&regression);
    let times: Vec<f64> = regression.recordings[0].complete.iter().map(|&k| samples.time_s[k]).collect();
    let rest_readings = regression.median_readings();
    let response = regression.response(&rest_readings);
    design.offset = &response - high_pass(&times, &response);
    // The constant stays: it is the regression's own.
    for column in design.columns.iter_mut().skip(1) {
        *column = high_pass(&times, column);
    }
    let normal = regression.normal(&design, &rest_readings);
    let branches = 1 + GAUGE + DASH_POTS;
    let columns: Vec<usize> = (0..=GAUGE).chain(branches..branches + structure.taus * BRANCH_COLUMNS).collect();
    normal.cross_validate(&columns, structure.ridge)
}

/// What of a column is faster than [`HIGH_PASS_S`].
fn high_pass(time_s: &[f64], column: &DVector<f64>) -> DVector<f64> {
    let mut low_pass = LowPass::new(HIGH_PASS_S);
    DVector::from_iterator(
        column.len(),
        time_s.iter().zip(column.iter()).map(|(&time_s, &value)| value - low_pass.next(time_s, value)),
    )
}

/// The reference `lag_s` later than each row, interpolated between known values, the ends held.
fn advanced(samples: &Samples, lag_s: f64) -> Vec<f64> {
    let known: Vec<(f64, f64)> = samples
        .time_s
        .iter()
        .zip(samples.strain)
        .filter_map(|(&time_s, &strain)| strain.is_finite().then_some((time_s, strain)))
        .collect();
    let at = |time_s: f64| {
        let after = known.partition_point(|(known_s, _)| *known_s < time_s);
        match (after.checked_sub(1).and_then(|before| known.get(before)), known.get(after)) {
            (Some((a_s, a)), Some((b_s, b))) => a + (time_s - a_s) / (b_s - a_s) * (b - a),
            (Some((_, end)), None) | (None, Some((_, end))) => *end,
            (None, None) => f64::NAN,
        }
    };
    samples.time_s.iter().map(|time_s| at(time_s + lag_s)).collect()
}
