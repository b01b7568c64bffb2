use ohmstrain_model::Scalar;

use crate::Gaussian;
use crate::sparse_parts::{Part, Parts};

/// Where a mixture's mean of one component of the state lies, and its parts around it.
#[derive(Clone, Copy)]
struct Shift<T> {
    mean: T,
    /// Deviations of the lighter parts from the heaviest one, with their weights.
    weighted: [T; 2],
    /// Deviations of the lighter parts from the mixture.
    off: [T; 2],
}

/// The mixture of three beliefs, the heaviest first.
struct Mixing<T> {
    weights: [T; 3],
}

impl<T: Scalar> Mixing<T> {
    #[inline(always)]
    fn shift(&self, heaviest: T, b: T, c: T) -> Shift<T> {
        let (b, c) = (b - heaviest, c - heaviest);
        let weighted = [self.weights[1] * b, self.weights[2] * c];
        let shift = weighted[0] + weighted[1];
        Shift { mean: heaviest + shift, weighted, off: [b - shift, c - shift] }
    }

    /// With deviations d from the heaviest part's mean and s the mixture's own, `Σ w (d - s)(d - s)ᵀ = Σ w d (d - s)ᵀ`, and
    /// the heaviest part has d = 0. As its weight is a third at least, s is no more than √3 deviations of the mixture, and
    /// nothing cancels.
    #[inline(always)]
    fn entry(&self, [a, b, c]: [T; 3], i: &Shift<T>, j: &Shift<T>) -> T {
        let [w0, w1, w2] = self.weights;
        w0 * a + w1 * b + w2 * c + i.weighted[0] * j.off[0] + i.weighted[1] * j.off[1]
    }

    #[inline(always)]
    fn part<const B: usize>(
        &self,
        of: [&Part<T, B>; 3],
        own: &Shift<T>,
        strain: &Shift<T>,
        others: &[Shift<T>],
    ) -> Part<T, B> {
        let zero = T::zero();
        let mut with = [zero; B];
        for (k, other) in others.iter().enumerate().take(B) {
            with[k] = self.entry(of.map(|part| part.with[k]), own, other);
        }
        Part {
            mean: own.mean,
            with_strain: self.entry(of.map(|part| part.with_strain), own, strain),
            with_rate: zero,
            with,
            variance: self.entry(of.map(|part| part.variance), own, own),
        }
    }
}

impl<T: Scalar, const B: usize> Parts<T, B> {
    /// Mean and covariance of a mixture of three, the heaviest first, but for the rate, which is left zero.
    #[inline(always)]
    pub(crate) fn mixed<const N: usize>(weights: [T; 3], of: [&Self; 3]) -> Self {
        let (mixing, zero) = (Mixing { weights }, T::zero());
        let shift = |means: [T; 3]| mixing.shift(means[0], means[1], means[2]);
        let strain = shift(of.map(|parts| parts.strain));
        let shifts: [Shift<T>; B] = core::array::from_fn(|i| shift(of.map(|parts| parts.branches[i].mean)));
        let branch = |i: usize| {
            let before = shifts.get(..i).unwrap_or(&[]);
            mixing.part(of.map(|parts| &parts.branches[i]), &shifts[i], &strain, before)
        };
        let baseline = if Self::has_baseline(N) {
            let own = shift(of.map(|parts| parts.baseline.mean));
            mixing.part(of.map(|parts| &parts.baseline), &own, &strain, &shifts)
        } else {
            of[0].baseline
        };
        Self {
            strain: strain.mean,
            rate: zero,
            strain_variance: mixing.entry(of.map(|parts| parts.strain_variance), &strain, &strain),
            strain_rate: zero,
            rate_variance: zero,
            branches: core::array::from_fn(branch),
            baseline,
        }
    }

    /// Puts the rate of a moving phase into a mixture: the phase's own with the share `kept`, with the rest one that is
    /// drawn anew, independent of everything else.
    #[inline(always)]
    pub(crate) fn mix_rate<const N: usize>(&mut self, kept: T, own: &Self, fresh: &Gaussian<T>) {
        let renewed = T::one() - kept;
        let apart = own.rate - fresh.mean;
        let weighted = kept * apart;
        self.rate = fresh.mean + weighted;
        self.rate_variance = kept * own.rate_variance + renewed * (fresh.variance + weighted * apart);
        let with_rate = |of_own: T, mean: T, mixed: T| kept * of_own + weighted * (mean - mixed);
        self.strain_rate = with_rate(own.strain_rate, own.strain, self.strain);
        for (mixed, own) in self.branches.iter_mut().zip(&own.branches) {
            mixed.with_rate = with_rate(own.with_rate, own.mean, mixed.mean);
        }
        if Self::has_baseline(N) {
            let own = &own.baseline;
            self.baseline.with_rate = with_rate(own.with_rate, own.mean, self.baseline.mean);
        }
    }
}
