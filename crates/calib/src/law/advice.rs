//! Advice on the next recording, as motions of a rig: which motion, its speed and its duration. Speeds are stated as the duration of a
//! stroke over the whole range, so that they apply to strains and angles alike.

use nalgebra::{Cholesky, DMatrix};
use ohmstrain_model::StrainRange;

use crate::likelihood::Bound;
use crate::motion_stats::MotionStats;
use ohmstrain_sensor::Uncertainty;

/// Standard error of a time constant, relative to its value, above which it is not identified. A 95 % interval from half to twice the value
/// corresponds to about 0.35.
const LEAST_SURE: f64 = 0.25;
/// Ratio of speeds that still counts as one speed, for the middle half of the moving rows.
const ONE_SPEED: f64 = 1.15;
/// Largest variance inflation of a weight, relative to a column that stands alone; the usual rule.
const LARGEST_INFLATION: f64 = 10.0;
/// Least distance of release, as a fraction of the distance of stretching, that determines the law of release.
const LEAST_BACK: f64 = 0.1;
/// Least number of strokes over the whole range; fewer do not repeat, so that none can be left out.
const FEWEST_STROKES: f64 = 6.0;
/// Shortest recording, s, with quarters of 15 s to leave out.
const SHORTEST_S: f64 = 60.0;
/// Unrecorded strain between zero and the least strain, in spans, beyond which R₀ is an extrapolation.
const FAR_FROM_REST: f64 = 0.1;

/// A time constant that is on a bound of its search.
#[derive(Clone, Debug, PartialEq)]
pub struct OnBound {
    /// Its name.
    pub name: String,
    /// Its value, s.
    pub value: f64,
    /// The bound: the lower one is the pace of the motion, the upper one a quarter of the longest recording.
    pub bound: Bound,
}

/// Returns motions to record next, most important first.
pub(crate) fn advice(
    parameters: &Uncertainty,
    on_bound: &[OnBound],
    stats: &MotionStats,
    range: StrainRange<f64>,
    jacobian: &DMatrix<f64>,
) -> Vec<String> {
    let stroke_s = range.span() / stats.speed.max(f64::MIN_POSITIVE);
    let slow = slow_relaxation(parameters, on_bound);
    let is_fast = on_bound.iter().any(|on| on.bound == Bound::Lower);
    let reasons = [
        both_directions(stats, stroke_s),
        enough_strokes(stats, stroke_s),
        near_zero(range),
        slow.and_then(|tau_s| long_holds(tau_s, stats)),
        is_one_speed(parameters, stats, jacobian).then(|| another_speed(stroke_s)),
        is_fast.then(|| faster(range, stats)),
    ];
    reasons.into_iter().flatten().collect()
}

/// Advises more releases, or stretches, if there are too few of either to determine their law.
fn both_directions(stats: &MotionStats, stroke_s: f64) -> Option<String> {
    let [stretched, released] = stats.distances;
    let stroke = duration(stroke_s);
    if released < LEAST_BACK * stretched {
        return Some(format!("release as often as you stretch: back to the smallest strain, in {stroke} a stroke"));
    }
    (stretched < LEAST_BACK * released)
        .then(|| format!("stretch as often as you release: up to the largest strain, in {stroke} a stroke"))
}

/// Advises more strokes if a block that is left out to test a law would not contain a motion.
fn enough_strokes(stats: &MotionStats, stroke_s: f64) -> Option<String> {
    if stats.strokes < FEWEST_STROKES {
        let [stroke, all] = [stroke_s, 2.0 * FEWEST_STROKES * stroke_s].map(duration);
        let times = 2.0 * FEWEST_STROKES;
        return Some(format!(
            "go to and fro over the whole range {times:.0} times, in {stroke} a stroke: {all} in all"
        ));
    }
    (stats.longest_s < SHORTEST_S).then(|| {
        let [found, wanted] = [stats.longest_s, 2.0 * SHORTEST_S].map(duration);
        format!("go on with the same motion for {wanted}; the longest recording has {found}")
    })
}

/// Advises rest near zero strain if R₀ would otherwise be an extrapolation.
fn near_zero(range: StrainRange<f64>) -> Option<String> {
    let least = range.lower.abs().min(range.upper.abs());
    (least > FAR_FROM_REST * range.span() && range.lower * range.upper > 0.0).then(|| {
        let least = number(least);
        format!(
            "begin and end with 30 s at rest, unstretched: near zero strain, where nothing below {least} was recorded"
        )
    })
}

/// Returns the longest time constant, s, that is poorly determined or on the bound set by the recording's length.
fn slow_relaxation(parameters: &Uncertainty, on_bound: &[OnBound]) -> Option<f64> {
    let all = parameters.names.iter().zip(&parameters.values).zip(&parameters.standard_errors);
    let open = all.filter(|((name, tau_s), error_s)| {
        let bound = on_bound.iter().find(|on| on.name == **name).map(|on| on.bound);
        name.ends_with(".tau_s")
            && bound != Some(Bound::Lower)
            && (bound.is_some() || **error_s >= LEAST_SURE * **tau_s)
    });
    open.map(|((_, tau_s), _)| *tau_s).reduce(f64::max)
}

fn long_holds(tau_s: f64, stats: &MotionStats) -> Option<String> {
    let (hold, relaxes) = (duration(2.0 * tau_s), duration(tau_s));
    Some(match stats.longest_hold_s {
        0.0 => format!(
            "hold at the largest strain for {hold}, release, and rest for {hold}: a relaxation of {relaxes} shows in holds only"
        ),
        held if held < 2.0 * tau_s => {
            let held = duration(held);
            format!(
                "hold at the largest strain for {hold}, release, and rest for {hold}: a relaxation takes {relaxes}, the longest hold was {held}"
            )
        }
        _ => format!("hold for {hold} at two intermediate strains, approached once from each side"),
    })
}

fn another_speed(stroke_s: f64) -> String {
    let [stroke, faster] = [stroke_s, stroke_s / 3.0].map(duration);
    format!("repeat the strokes at a second speed: in {faster} a stroke, not only in {stroke}")
}

fn faster(range: StrainRange<f64>, stats: &MotionStats) -> String {
    let fastest_s = range.span() / stats.fastest_rate.max(f64::MIN_POSITIVE);
    let [fastest, faster] = [fastest_s, fastest_s / 2.0].map(duration);
    format!("add full strokes of {faster}, sampled faster in proportion: the fastest so far would take {fastest}")
}

/// True if only one speed was recorded. The dash-pot is a jump of the reading that depends on the speed. At one speed it is a constant for
/// each direction, which R₀, the gauge and fast branches can absorb.
fn is_one_speed(parameters: &Uncertainty, stats: &MotionStats, jacobian: &DMatrix<f64>) -> bool {
    let (slow, fast) = stats.quartile_speeds;
    let Some(linear_before) = jacobian.ncols().checked_sub(trailing_columns(parameters)) else { return false };
    let inflation = variance_inflation(jacobian);
    let worst = inflation.iter().skip(linear_before).take(2).copied().fold(0.0, f64::max);
    fast <= ONE_SPEED * slow && worst > LARGEST_INFLATION
}

/// Returns the number of columns from the dash-pot on: two of its own, four and a time constant of each branch, the gauge's nonlinear
/// parameters.
fn trailing_columns(parameters: &Uncertainty) -> usize {
    let count = |wanted: &dyn Fn(&str) -> bool| parameters.names.iter().filter(|name| wanted(name)).count();
    let gauge = count(&|name| matches!(name, "gauge.decay_strain" | "gauge.gap" | "gauge.barrier" | "gauge.path_loss"));
    2 + count(&|name| name.starts_with("branches[")) + gauge
}

/// Returns JᵀJ with columns of unit length; a column of zeros stays zero.
pub(crate) fn scaled_normal(jacobian: &DMatrix<f64>) -> DMatrix<f64> {
    let lengths: Vec<f64> = jacobian.column_iter().map(|column| column.norm().max(f64::MIN_POSITIVE)).collect();
    let normal = jacobian.tr_mul(jacobian);
    DMatrix::from_fn(normal.nrows(), normal.ncols(), |i, j| normal[(i, j)] / (lengths[i] * lengths[j]))
}

/// Returns the diagonal of the inverse of the scaled normal matrix: 1 for a column orthogonal to all others.
fn variance_inflation(jacobian: &DMatrix<f64>) -> Vec<f64> {
    let size = jacobian.ncols();
    // Far above rounding, and far below the inverse of any relevant inflation.
    let normal = scaled_normal(jacobian) + DMatrix::identity(size, size) * 1e-10;
    Cholesky::new(normal)
        .map_or(vec![f64::INFINITY; size], |factor| factor.inverse().diagonal().iter().copied().collect())
}

/// Formats a duration for people: two digits of seconds, minutes or hours.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 100.0 => format!("{} s", number(s)),
        s if s < 6000.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.0} h", s / 3600.0),
    }
}

/// Formats a number for people: two or three digits.
fn number(x: f64) -> String {
    let size = x.abs();
    if size >= 10.0 {
        format!("{x:.0}")
    } else if size >= 1.0 {
        format!("{x:.1}")
    } else {
        format!("{x:.3}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stats(hold_s: f64) -> MotionStats {
        MotionStats {
            strain_mean: 0.1,
            strain_sd: 0.1,
            rate_sd: 0.1,
            rate_time_s: 1.0,
            hold_s: None,
            move_s: 1.0,
            reversal: 1.0,
            speed: 0.1,
            quartile_speeds: (0.1, 0.1),
            longest_hold_s: hold_s,
            fastest_rate: 0.1,
            longest_s: 12_345.0,
            strokes: 20.0,
            distances: [3.0, 3.0],
        }
    }

    const RANGE: StrainRange<f64> = StrainRange { lower: 0.0, upper: 0.3 };

    /// The end of a calibration has ten lines, of which two pieces of advice and a count of the rest take two.
    #[test]
    fn advice_is_short() {
        let holds = [0.0, 0.123, 5000.0].map(|hold_s| long_holds(3086.4, &stats(hold_s)).unwrap());
        let others = [
            another_speed(12.3),
            faster(RANGE, &stats(0.0)),
            near_zero(StrainRange { lower: 0.1, upper: 0.3 }).unwrap(),
        ];
        for advice in holds.iter().chain(&others) {
            assert!(advice.chars().count() <= 140, "{advice}");
        }
    }

    /// Tests each deficiency of a recording with the motion that remedies it.
    #[test]
    fn what_is_lacking_is_asked_for() {
        let with = |distances, longest_s| MotionStats { distances, longest_s, ..stats(0.0) };
        let one_way = both_directions(&with([0.6, 0.0], 20.0), 3.0).unwrap();
        assert_eq!(one_way, "release as often as you stretch: back to the smallest strain, in 3.0 s a stroke");
        assert!(both_directions(&with([0.0, 0.6], 20.0), 3.0).unwrap().starts_with("stretch as often as you release"));
        assert_eq!(both_directions(&with([0.6, 0.5], 20.0), 3.0), None);
        let few = enough_strokes(&MotionStats { strokes: 4.0, ..stats(0.0) }, 3.0).unwrap();
        assert_eq!(few, "go to and fro over the whole range 12 times, in 3.0 s a stroke: 36 s in all");
        let short = enough_strokes(&with([3.0, 3.0], 20.0), 3.0).unwrap();
        assert_eq!(short, "go on with the same motion for 2 min; the longest recording has 20 s");
        assert_eq!(enough_strokes(&with([3.0, 3.0], 200.0), 3.0), None);
    }
}
