use ohmstrain_model::Scalar;

use crate::kernel::{Part, Parts};
use crate::{Belief, Gaussian};

/// Mean of one component of the state over a mixture, and deviations of its parts.
#[derive(Clone, Copy)]
struct Shift<T> {
    /// Index of the component.
    i: usize,
    mean: T,
    /// Deviations of the lighter parts from the heaviest one, with their weights.
    weighted: [T; 2],
    /// Deviations of the lighter parts from the mixture.
    off: [T; 2],
}

/// A mixture of three beliefs, the heaviest first.
struct Mixing<'a, T, const N: usize, const L: usize> {
    weights: [T; 3],
    of: [&'a Belief<T, N, L>; 3],
}

/// Returns component `i` of a mean. An index known at compile time is checked at compile time; otherwise the check must
/// not panic.
#[inline(always)]
fn mean<T: Scalar, const N: usize, const L: usize>(belief: &Belief<T, N, L>, i: usize) -> T {
    belief.mean.as_slice().get(i).copied().unwrap_or_else(T::zero)
}

/// Returns entry `i`, `j ≤ i` of a covariance, like [`mean`].
#[inline(always)]
fn covariance<T: Scalar, const N: usize, const L: usize>(belief: &Belief<T, N, L>, i: usize, j: usize) -> T {
    belief.covariance.packed().get(i * (i + 1) / 2 + j).copied().unwrap_or_else(T::zero)
}

impl<T: Scalar, const N: usize, const L: usize> Mixing<'_, T, N, L> {
    #[inline(always)]
    fn shift(&self, i: usize) -> Shift<T> {
        let [_, w1, w2] = self.weights;
        let [a, b, c] = self.of;
        let heaviest = mean(a, i);
        let (b, c) = (mean(b, i) - heaviest, mean(c, i) - heaviest);
        let weighted = [w1 * b, w2 * c];
        let shift = weighted[0] + weighted[1];
        Shift { i, mean: heaviest + shift, weighted, off: [b - shift, c - shift] }
    }

    /// Returns an entry of the mixture's covariance. With d the deviations from the heaviest part's mean, and s that of the
    /// mixture, `Σ w (d - s)(d - s)ᵀ = Σ w d (d - s)ᵀ`; the heaviest part has d = 0. Its weight is at least a third, so s is at
    /// most √3 standard deviations of the mixture, and nothing cancels.
    #[inline(always)]
    fn entry(&self, i: &Shift<T>, j: &Shift<T>) -> T {
        let [w0, w1, w2] = self.weights;
        let [a, b, c] = self.of;
        w0 * covariance(a, i.i, j.i)
            + w1 * covariance(b, i.i, j.i)
            + w2 * covariance(c, i.i, j.i)
            + i.weighted[0] * j.off[0]
            + i.weighted[1] * j.off[1]
    }

    #[inline(always)]
    fn part<const B: usize>(&self, own: &Shift<T>, strain: &Shift<T>, others: &[Shift<T>]) -> Part<T, B> {
        let mut with = [T::zero(); B];
        for (with, other) in with.iter_mut().zip(others) {
            *with = self.entry(own, other);
        }
        let (with_strain, variance) = (self.entry(own, strain), self.entry(own, own));
        Part { mean: own.mean, with_strain, with_rate: T::zero(), with, variance }
    }
}

impl<T: Scalar, const B: usize> Parts<T, B> {
    /// Returns mean and covariance of a mixture of three, the heaviest first, except for the rate, which is zero.
    #[inline(always)]
    pub(crate) fn mixed<const N: usize, const L: usize>(weights: [T; 3], of: [&Belief<T, N, L>; 3]) -> Self {
        let (mixing, zero) = (Mixing { weights, of }, T::zero());
        let strain = mixing.shift(0);
        let shifts: [Shift<T>; B] = core::array::from_fn(|i| mixing.shift(2 + i));
        let mut branches = [Part::vacant(zero); B];
        for (i, (branch, own)) in branches.iter_mut().zip(&shifts).enumerate() {
            *branch = mixing.part(own, &strain, shifts.get(..i).unwrap_or(&[]));
        }
        let mut baseline = Part::vacant(zero);
        if Self::has_baseline(N) {
            baseline = mixing.part(&mixing.shift(N - 1), &strain, &shifts);
        }
        let strain_variance = mixing.entry(&strain, &strain);
        Self { strain: strain.mean, strain_variance, branches, baseline, ..Self::certain(zero) }
    }

    /// Adds the rate of a moving phase to a mixture: the phase's own with weight `kept`, and otherwise a new one,
    /// independent of everything else.
    #[inline(always)]
    pub(crate) fn mix_rate<const N: usize, const L: usize>(
        &mut self,
        kept: T,
        own: &Belief<T, N, L>,
        fresh: &Gaussian<T>,
    ) {
        let renewed = T::one() - kept;
        let apart = mean(own, 1) - fresh.mean;
        let weighted = kept * apart;
        self.rate = fresh.mean + weighted;
        self.rate_variance = kept * covariance(own, 1, 1) + renewed * (fresh.variance + weighted * apart);
        let with_rate = |of_own: T, i: usize, mixed: T| kept * of_own + weighted * (mean(own, i) - mixed);
        self.strain_rate = with_rate(covariance(own, 1, 0), 0, self.strain);
        for (i, mixed) in self.branches.iter_mut().enumerate() {
            mixed.with_rate = with_rate(covariance(own, 2 + i, 1), 2 + i, mixed.mean);
        }
        if Self::has_baseline(N) {
            self.baseline.with_rate = with_rate(covariance(own, N - 1, 1), N - 1, self.baseline.mean);
        }
    }
}
