//! Minimisation without derivatives.
//!
//! Source: J. A. Nelder, R. Mead, A simplex method for function minimization, *The Computer Journal* 7 (1965) 308–313.

use std::cell::Cell;

/// Cost that replaces one that is not finite.
const VERY_BAD: f64 = 1e9;
/// Standard deviation of the corners' costs below which the search ends.
const SETTLED: f64 = 1e-7;
/// Factors on offsets from the centroid of the other corners or, for shrinkage, from the best corner.
const REFLECTION: f64 = -1.0;
const EXPANSION: f64 = 2.0;
const CONTRACTION: f64 = 0.5;
const SHRINKAGE: f64 = 0.5;

/// Evaluations per dimension in which a search has to improve; a simplex has one corner more than dimensions.
const PATIENCE: u64 = 3;

/// Limits of a search.
#[derive(Clone, Copy)]
pub(crate) struct Ends {
    /// Largest number of iterations.
    pub iterations: u64,
    /// Least fall of the cost in [`PATIENCE`] evaluations per dimension; at 0 the search goes on.
    pub least_gain: f64,
}

/// Returns the best point that Nelder-Mead finds from `start`, with a first simplex of side `step` in every direction. A cost that is not
/// finite counts as very bad.
pub(crate) fn nelder_mead(mut cost: impl FnMut(&[f64]) -> f64, start: &[f64], step: f64, ends: Ends) -> Vec<f64> {
    let evaluations = Cell::new(0);
    let mut corner = |point: Vec<f64>| {
        let cost = cost(&point);
        evaluations.update(|n| n + 1);
        Corner { point, cost: if cost.is_finite() { cost } else { VERY_BAD } }
    };
    let moved = (0..start.len()).map(|i| {
        let mut point = start.to_vec();
        point[i] += step;
        point
    });
    let mut simplex: Vec<Corner> = std::iter::once(start.to_vec()).chain(moved).map(&mut corner).collect();
    sort(&mut simplex);
    let (mut cost_then, mut evaluations_then) = (simplex[0].cost, evaluations.get());
    for _ in 0..ends.iterations {
        if simplex[0].cost < cost_then - ends.least_gain {
            (cost_then, evaluations_then) = (simplex[0].cost, evaluations.get());
        }
        let is_stalled = evaluations.get() >= evaluations_then + PATIENCE * start.len() as u64;
        if spread(&simplex) < SETTLED || (ends.least_gain > 0.0 && is_stalled) {
            break;
        }
        if let Some(better) = improved(&simplex, &mut corner) {
            simplex.pop();
            simplex.push(better);
        } else {
            let best = simplex[0].point.clone();
            for other in &mut simplex[1..] {
                *other = corner(from(&best, &other.point, SHRINKAGE));
            }
        }
        sort(&mut simplex);
    }
    simplex.swap_remove(0).point
}

/// A point with its cost.
struct Corner {
    point: Vec<f64>,
    cost: f64,
}

/// Sorts corners by cost, best first; ties keep their order.
fn sort(simplex: &mut [Corner]) {
    simplex.sort_by(|a, b| a.cost.total_cmp(&b.cost));
}

/// Returns the point at `factor` times the offset of `point` from `origin`.
fn from(origin: &[f64], point: &[f64], factor: f64) -> Vec<f64> {
    origin.iter().zip(point).map(|(origin, point)| origin + (point - origin) * factor).collect()
}

/// Returns the corner that replaces the worst one; `None` if the simplex has to shrink.
fn improved(simplex: &[Corner], mut corner: impl FnMut(Vec<f64>) -> Corner) -> Option<Corner> {
    let [best, .., worst] = simplex else { return None };
    let second_worst = &simplex[simplex.len() - 2];
    let centroid = centroid(&simplex[..simplex.len() - 1]);
    let reflected = corner(from(&centroid, &worst.point, REFLECTION));
    if reflected.cost < best.cost {
        let expanded = corner(from(&centroid, &reflected.point, EXPANSION));
        return Some(if expanded.cost < reflected.cost { expanded } else { reflected });
    }
    if reflected.cost < second_worst.cost {
        return Some(reflected);
    }
    if reflected.cost < worst.cost {
        let outside = corner(from(&centroid, &reflected.point, CONTRACTION));
        return Some(outside).filter(|outside| outside.cost <= reflected.cost);
    }
    let inside = corner(from(&centroid, &worst.point, CONTRACTION));
    Some(inside).filter(|inside| inside.cost < worst.cost)
}

fn centroid(corners: &[Corner]) -> Vec<f64> {
    let mut sum = corners[0].point.clone();
    for corner in &corners[1..] {
        sum.iter_mut().zip(&corner.point).for_each(|(sum, x)| *sum += x);
    }
    let share = 1.0 / corners.len() as f64;
    sum.into_iter().map(|sum| sum * share).collect()
}

/// Returns the standard deviation of the costs.
fn spread(simplex: &[Corner]) -> f64 {
    let n = simplex.len() as f64;
    let mean = simplex.iter().map(|corner| corner.cost).sum::<f64>() / n;
    let squares = simplex.iter().map(|corner| (corner.cost - mean).powi(2)).sum::<f64>();
    (1.0 / (n - 1.0) * squares).sqrt()
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::{Ends, PATIENCE, nelder_mead};

    const TO_THE_END: Ends = Ends { iterations: 500, least_gain: 0.0 };

    /// The minimum at (1, 1) lies at the end of a bent valley.
    #[test]
    fn the_minimum_of_rosenbrocks_function_is_found() {
        let cost = |x: &[f64]| (1.0 - x[0]).powi(2) + 100.0 * (x[1] - x[0] * x[0]).powi(2);
        let best = nelder_mead(cost, &[-1.2, 1.0], 0.5, TO_THE_END);
        // Costs that differ by 1e-7 belong to points whose distance is the root of that over the root of the smallest
        // curvature, about 0.4.
        assert!(best.iter().all(|x| (x - 1.0).abs() < 1e-3), "{best:?}");
    }

    #[test]
    fn a_cost_that_cannot_be_computed_is_avoided() {
        let cost = |x: &[f64]| if x[0] < 0.0 { f64::NAN } else { (x[0] - 0.5).powi(2) };
        let best = nelder_mead(cost, &[0.1], -0.3, TO_THE_END);
        assert!((best[0] - 0.5).abs() < 1e-3, "{best:?}");
    }

    /// A steep slope gains more than a tenth whenever that is asked, a gentle one never: the simplex expands, but not ten
    /// thousandfold in nine evaluations.
    #[test]
    fn a_search_that_hardly_gains_ends() {
        let evaluations = |slope: f64, least_gain: f64| {
            let count = Cell::new(0);
            let cost = |x: &[f64]| {
                count.update(|n: u64| n + 1);
                slope * (x[0] + x[1] + x[2])
            };
            nelder_mead(cost, &[0.0; 3], 1.0, Ends { iterations: 40, least_gain });
            count.get()
        };
        assert_eq!(evaluations(-1.0, 0.1), evaluations(-1.0, 0.0));
        // A simplex, the evaluations in which it has to gain, and the last step.
        let most = 4 + 3 * PATIENCE + 2;
        assert!((4 + 3 * PATIENCE..=most).contains(&evaluations(-1e-5, 0.1)));
        assert!(evaluations(-1e-5, 0.0) >= 40);
    }
}
