//! Matrices of a step for smoothers, from the same kernel as the forward step.

use nalgebra::SMatrix;
use ohmstrain_model::{Scalar, Transition};

use super::predict::Driven;
use super::{Course, Parts, SparseEkf, Switch};
use crate::Belief;

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G> SparseEkf<T, S, B, N, G> {
    /// Returns F and Q of a step with an uncertain direction, and the prior after it, as needed by
    /// [`rts_step`](crate::rts_step).
    pub(crate) fn transition<const L: usize>(&self, from: &Belief<T, N, L>) -> (Transition<T, N, L>, Belief<T, N, L>) {
        let mut parts = Parts::of(from);
        let Parts { strain_variance, strain_rate, rate_variance, .. } = parts;
        let driving = self.drive::<T, S>(&mut parts, Course::Uncertain);
        let driven = self.spread_on(&mut parts, &driving, [strain_variance, strain_rate, rate_variance]);
        // The same step from an exactly known state gives the noise alone.
        let [strain_variance, strain_rate, rate_variance] = self.step.noise;
        let mut noise = Parts { strain_variance, strain_rate, rate_variance, ..Parts::certain(T::zero()) };
        self.spread_on(&mut noise, &driving, [T::zero(); 3]);
        let (prior, noise): (Belief<T, N, L>, Belief<T, N, L>) = (parts.together(), noise.together());
        let jacobian = self.jacobian(&driven);
        (Transition { mean: prior.mean, jacobian, noise: noise.covariance }, prior)
    }

    fn jacobian(&self, driven: &[Driven<T>; B]) -> SMatrix<T, N, N> {
        let (mut jacobian, [a, b]) = (SMatrix::zeros(), self.step.motion);
        for j in 0..2 {
            (jacobian[(0, j)], jacobian[(1, j)]) = (a[j], b[j]);
            for i in 0..B {
                jacobian[(i + 2, j)] = driven[i].row[j] + driven[i].pull * a[j];
            }
        }
        for i in 0..B {
            jacobian[(i + 2, i + 2)] = self.step.branches[i].decay;
        }
        if Self::HAS_BASELINE {
            jacobian[(N - 1, N - 1)] = self.step.baseline_decay;
        }
        jacobian
    }
}
