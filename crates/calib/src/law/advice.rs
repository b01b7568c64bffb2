use nalgebra::{Cholesky, DMatrix};

use crate::likelihood::Bound;
use crate::motion_stats::MotionStats;
use crate::params::{RangeParams, Uncertainty};

/// A time constant with a larger standard error than this, relative to itself, is not identified: a 95 % interval from
/// half to twice the value is about 0.35.
const LEAST_SURE: f64 = 0.25;
/// Speeds count as one where the middle half of the moving rows lies within this ratio.
const ONE_SPEED: f64 = 1.15;
/// The variance of a weight may be this many times what it were if its column stood alone; the usual rule.
const LARGEST_INFLATION: f64 = 10.0;
/// Strain not recorded between zero and the least strain, in spans, beyond which R₀ is an extrapolation.
const FAR_FROM_REST: f64 = 0.1;

/// A time constant that ends on a bound of its search.
#[derive(Clone, Debug, PartialEq)]
pub struct OnBound {
    /// Its name.
    pub name: String,
    /// Its value, s.
    pub value: f64,
    /// The bound: the pace of the motion below, a quarter of the longest recording above.
    pub bound: Bound,
}

/// What to record next, most important first.
pub(crate) fn advice(
    parameters: &Uncertainty,
    on_bound: &[OnBound],
    stats: &MotionStats,
    range: RangeParams,
    jacobian: &DMatrix<f64>,
) -> Vec<String> {
    let mut out = Vec::new();
    for (i, (name, &tau_s)) in parameters.names.iter().zip(&parameters.values).enumerate() {
        if name.ends_with(".tau_s") {
            let bound = on_bound.iter().find(|on| on.name == *name).map(|on| on.bound);
            out.extend(about_time_constant(name, tau_s, parameters.standard_errors[i], bound, stats));
        }
    }
    out.extend(about_speeds(parameters, stats, jacobian));
    if range.lower.abs().min(range.upper.abs()) > FAR_FROM_REST * range.span() && range.lower * range.upper > 0.0 {
        out.push(format!(
            "rest_reading is extrapolated from strains of {} and more: record near zero strain too",
            number(range.lower.abs().min(range.upper.abs()))
        ));
    }
    out
}

fn about_time_constant(
    name: &str,
    tau_s: f64,
    error_s: f64,
    bound: Option<Bound>,
    stats: &MotionStats,
) -> Option<String> {
    let (tau, hold_s) = (number(tau_s), stats.longest_hold_s);
    if bound == Some(Bound::Lower) {
        return Some(format!(
            "{name} = {tau} s, its lower bound, is too fast to tell from the dash-pot: move or sample faster, or fit a \
             branch fewer"
        ));
    }
    if bound == Some(Bound::Upper) {
        let hold = match hold_s {
            _ if hold_s <= 0.0 => format!("; hold for {tau} s or more"),
            _ if hold_s < tau_s => format!("; hold {} s longer than {} s", number(tau_s - hold_s), number(hold_s)),
            _ => String::new(),
        };
        let longest = number(stats.longest_s);
        return Some(format!(
            "{name} = {tau} s, its upper bound, a quarter of the longest recording: record more than {longest} s{hold}"
        ));
    }
    if error_s < LEAST_SURE * tau_s {
        return None;
    }
    Some(if hold_s <= 0.0 {
        format!("{name} = {tau} s cannot be told without a hold: hold for {tau} s or more")
    } else if hold_s < tau_s {
        let (hold, more) = (number(hold_s), number(tau_s - hold_s));
        format!("{name} = {tau} s cannot be told by holds of at most {hold} s: hold {more} s longer")
    } else {
        format!("{name} = {tau} s is uncertain although holds are long enough: record more of them")
    })
}

/// The dash-pot is a jump of the reading by an amount that depends on the speed. At one speed it is a constant of each
/// direction, which R₀, the gauge and fast branches can take on.
fn about_speeds(parameters: &Uncertainty, stats: &MotionStats, jacobian: &DMatrix<f64>) -> Option<String> {
    let (slow, fast) = stats.quartile_speeds;
    let linear_before = jacobian.ncols().checked_sub(trailing_columns(parameters))?;
    let inflation = variance_inflation(jacobian);
    let worst = inflation.iter().skip(linear_before).take(2).copied().fold(0.0, f64::max);
    let one_speed = fast <= ONE_SPEED * slow;
    (one_speed && worst > LARGEST_INFLATION).then(|| {
        format!(
            "the dash-pot and rest_reading cannot be told apart at one speed ({} per second): record a second speed",
            number(stats.speed)
        )
    })
}

/// Columns from the dash-pot on: two of it, four and a time constant of each branch, the gauge's nonlinear parameters.
fn trailing_columns(parameters: &Uncertainty) -> usize {
    let count = |wanted: &dyn Fn(&str) -> bool| parameters.names.iter().filter(|name| wanted(name)).count();
    let gauge = count(&|name| matches!(name, "gauge.decay_strain" | "gauge.gap" | "gauge.barrier" | "gauge.path_loss"));
    2 + count(&|name| name.starts_with("branches[")) + gauge
}

/// JᵀJ with columns of unit length; a column of zeros stays one.
pub(crate) fn scaled_normal(jacobian: &DMatrix<f64>) -> DMatrix<f64> {
    let lengths: Vec<f64> = jacobian.column_iter().map(|column| column.norm().max(f64::MIN_POSITIVE)).collect();
    let normal = jacobian.tr_mul(jacobian);
    DMatrix::from_fn(normal.nrows(), normal.ncols(), |i, j| normal[(i, j)] / (lengths[i] * lengths[j]))
}

/// Diagonal of the inverse of the scaled normal matrix: 1 for a column at right angles to all others.
fn variance_inflation(jacobian: &DMatrix<f64>) -> Vec<f64> {
    let size = jacobian.ncols();
    // Far above rounding and far below what counts as inflated.
    let normal = scaled_normal(jacobian) + DMatrix::identity(size, size) * 1e-10;
    Cholesky::new(normal)
        .map_or(vec![f64::INFINITY; size], |factor| factor.inverse().diagonal().iter().copied().collect())
}

/// Two or three figures, as people read them.
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

    /// With a count of what else there is, it takes two of the ten lines that end a calibration: twice 87 columns, without the
    /// count and a word that may not fit.
    #[test]
    fn advice_is_short() {
        let stats = |longest_hold_s| MotionStats {
            strain_mean: 0.1,
            strain_sd: 0.1,
            rate_sd: 0.1,
            rate_time_s: 1.0,
            hold_s: None,
            move_s: 1.0,
            reversal: 1.0,
            speed: 0.1,
            quartile_speeds: (0.1, 0.1),
            longest_hold_s,
            fastest_rate: 0.1,
            longest_s: 12_345.0,
        };
        for hold_s in [0.0, 0.123, 5000.0] {
            for bound in [None, Some(Bound::Lower), Some(Bound::Upper)] {
                let advice = about_time_constant("branches[0].tau_s", 3086.4, 4000.0, bound, &stats(hold_s)).unwrap();
                assert!(advice.chars().count() <= 140, "{advice}");
            }
        }
    }
}
