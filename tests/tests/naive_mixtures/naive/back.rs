//! Naive smoother of a filter of hypotheses.

use nalgebra::{SMatrix, SVector};
use ohmstrain_model::{Direction, Transition};

use super::{Hypotheses, Hypothesis, Moments, Naive, Rule, moments};

/// Smoothed weight, mean and covariance.
pub type Smoothed<const N: usize> = (f64, SVector<f64, N>, SMatrix<f64, N, N>);

impl<const B: usize, const N: usize> Naive<B, N> {
    /// Returns the smoothed hypotheses before a step, from the filtered ones, those after the step, and the smoothed ones
    /// after the step.
    pub fn back<const L: usize>(
        &self,
        filtered: &Hypotheses<N>,
        (following, next): (&Hypotheses<N>, &[Smoothed<N>]),
        dt_s: f64,
    ) -> Vec<Smoothed<N>> {
        let Rule::Imm(dwell) = self.rule else { return through(&filtered.all, &following.all, next) };
        let (mixed, step) = (self.mixed(filtered, &dwell, dt_s), self.model.prepare(dt_s));
        let before = mixed.iter().map(|one| {
            let here = (one.mean, one.covariance);
            let Some(place) = following.all.iter().position(|hypothesis| hypothesis.phase == one.phase) else {
                return (0.0, here.0, here.1);
            };
            let moved: Transition<f64, N, L> = self.model.transition(&step, &one.mean, Direction::Known(one.phase));
            let covariance = moved.jacobian * here.1 * moved.jacobian.transpose() + moved.noise.to_matrix();
            let (weight, mean, later) = next[place];
            let back = retraced(&here, &moved.jacobian, &(moved.mean, covariance), &(mean, later));
            (weight, back.0, back.1)
        });
        through(&filtered.all, &mixed, &before.collect::<Vec<_>>())
    }
}

/// Takes a Rauch-Tung-Striebel step from the smoothed state after a step to that before it. Exactly known states, such as the
/// rate of a hold, carry no information.
fn retraced<const N: usize>(
    before: &Moments<N>,
    jacobian: &SMatrix<f64, N, N>,
    predicted: &Moments<N>,
    after: &Moments<N>,
) -> Moments<N> {
    let per_sd = SMatrix::<f64, N, N>::from_diagonal(
        &predicted.1.diagonal().map(|variance| if variance > 0.0 { 1.0 / variance.sqrt() } else { 0.0 }),
    );
    // A dynamic matrix, because the decomposition is not available for a generic size.
    let correlation = per_sd * predicted.1 * per_sd;
    let inverse = nalgebra::DMatrix::from_column_slice(N, N, correlation.as_slice()).pseudo_inverse(1e-11).unwrap();
    let inverse = per_sd * SMatrix::<f64, N, N>::from_column_slice(inverse.as_slice()) * per_sd;
    let gain = before.1 * jacobian.transpose() * inverse;
    (before.0 + gain * (after.0 - predicted.0), before.1 + gain * (after.1 - predicted.1) * gain.transpose())
}

/// Runs Kim's smoother over merged hypotheses: each leads back to the parents of all its children, with their shares.
fn through<const N: usize>(
    filtered: &[Hypothesis<N>],
    following: &[Hypothesis<N>],
    next: &[Smoothed<N>],
) -> Vec<Smoothed<N>> {
    let mut ways: Vec<Vec<Smoothed<N>>> = filtered.iter().map(|_| vec![]).collect();
    for (hypothesis, (weight, mean, covariance)) in following.iter().zip(next) {
        let total: f64 = hypothesis.made_of.iter().map(|child| child.log_weight.exp()).sum();
        for child in &hypothesis.made_of {
            let share = weight * child.log_weight.exp() / total;
            if share <= 1e-7 {
                continue;
            }
            // The merged hypothesis is the child plus noise of the size of their distance.
            let apart = hypothesis.mean - child.posterior.0;
            let merged = (hypothesis.mean, child.posterior.1 + apart * apart.transpose());
            let own = retraced(&child.posterior, &SMatrix::identity(), &merged, &(*mean, *covariance));
            let parent = &filtered[child.parent];
            let here = (parent.mean, parent.covariance);
            let back = retraced(&here, &child.jacobian, &child.predicted, &own);
            // A change beyond any possible information of later readings is an error of merging.
            let astray = (0..N).any(|i| {
                let variance = here.1[(i, i)];
                !(back.1[(i, i)] <= 4.0 * variance && (back.0[i] - here.0[i]).powi(2) <= 400.0 * variance)
            });
            let (mean, covariance) = if astray { here } else { back };
            ways[child.parent].push((share, mean, covariance));
        }
    }
    let total: f64 = ways.iter().flatten().map(|way| way.0).sum();
    let gathered = |(ways, parent): (&Vec<Smoothed<N>>, &Hypothesis<N>)| {
        let weight: f64 = ways.iter().map(|way| way.0).sum();
        let (mean, covariance) = if weight > 0.0 { moments(ways) } else { (parent.mean, parent.covariance) };
        (weight / total, mean, covariance)
    };
    ways.iter().zip(filtered).map(gathered).collect()
}
