use ohmstrain_model::Scalar;

use crate::Belief;

/// A belief taken apart into motion, branches and baseline: each moves in its own way, no index needs a check, and with one
/// branch there is no loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Parts<T, const B: usize> {
    pub strain: T,
    pub rate: T,
    pub strain_variance: T,
    /// Covariance of strain and rate.
    pub strain_rate: T,
    pub rate_variance: T,
    pub branches: [Part<T, B>; B],
    /// Means nothing where there is no baseline.
    pub baseline: Part<T, B>,
}

/// A branch, or the baseline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part<T, const B: usize> {
    pub mean: T,
    pub with_strain: T,
    pub with_rate: T,
    /// Covariances with the branches: of a branch those before it, of the baseline all.
    pub with: [T; B],
    pub variance: T,
}

/// Takes numbers one after another. Their count is known while compiling, so that no test of an end is left.
#[inline(always)]
fn next<'a, T: Scalar>(numbers: &mut impl Iterator<Item = &'a T>) -> T {
    numbers.next().copied().unwrap_or_else(T::zero)
}

impl<T: Scalar, const B: usize> Part<T, B> {
    #[inline(always)]
    fn read<'a>(
        others: usize,
        means: &mut impl Iterator<Item = &'a T>,
        covariances: &mut impl Iterator<Item = &'a T>,
    ) -> Self {
        let mean = next(means);
        let (with_strain, with_rate) = (next(covariances), next(covariances));
        let mut with = [T::zero(); B];
        for with in with.iter_mut().take(others) {
            *with = next(covariances);
        }
        Self { mean, with_strain, with_rate, with, variance: next(covariances) }
    }

    /// Writes into what [`Self::read`] has read from.
    #[inline(always)]
    fn write<'a>(
        &self,
        others: usize,
        means: &mut impl Iterator<Item = &'a mut T>,
        covariances: &mut impl Iterator<Item = &'a mut T>,
    ) {
        put(means, self.mean);
        put(covariances, self.with_strain);
        put(covariances, self.with_rate);
        for with in self.with.iter().take(others) {
            put(covariances, *with);
        }
        put(covariances, self.variance);
    }
}

#[inline(always)]
fn put<'a, T: Scalar>(places: &mut impl Iterator<Item = &'a mut T>, number: T) {
    if let Some(place) = places.next() {
        *place = number;
    }
}

impl<T: Scalar, const B: usize> Parts<T, B> {
    /// Whether the last of `n` states is a baseline.
    pub(crate) const fn has_baseline(n: usize) -> bool {
        n == B + 3
    }

    #[inline(always)]
    pub(crate) fn of<const N: usize, const L: usize>(belief: &Belief<T, N, L>) -> Self {
        Self::read::<N>(&mut belief.mean.iter(), &mut belief.covariance.packed().iter())
    }

    /// From means, and the lower triangle of covariances row by row.
    #[inline(always)]
    pub(crate) fn read<'a, const N: usize>(
        means: &mut impl Iterator<Item = &'a T>,
        covariances: &mut impl Iterator<Item = &'a T>,
    ) -> Self {
        let (strain, rate) = (next(means), next(means));
        let (strain_variance, strain_rate, rate_variance) = (next(covariances), next(covariances), next(covariances));
        let branches = core::array::from_fn(|i| Part::read(i, means, covariances));
        let others = if Self::has_baseline(N) { B } else { 0 };
        let baseline = if Self::has_baseline(N) {
            Part::read(others, means, covariances)
        } else {
            Part::read(0, &mut [].iter(), &mut [].iter())
        };
        Self { strain, rate, strain_variance, strain_rate, rate_variance, branches, baseline }
    }

    #[inline(always)]
    pub(crate) fn write<'a, const N: usize>(
        &self,
        means: &mut impl Iterator<Item = &'a mut T>,
        covariances: &mut impl Iterator<Item = &'a mut T>,
    ) {
        put(means, self.strain);
        put(means, self.rate);
        put(covariances, self.strain_variance);
        put(covariances, self.strain_rate);
        put(covariances, self.rate_variance);
        for (i, branch) in self.branches.iter().enumerate() {
            branch.write(i, means, covariances);
        }
        if Self::has_baseline(N) {
            self.baseline.write(B, means, covariances);
        }
    }

    #[inline(always)]
    pub(crate) fn put_into<const N: usize, const L: usize>(&self, belief: &mut Belief<T, N, L>) {
        self.write::<N>(&mut belief.mean.iter_mut(), &mut belief.covariance.packed_mut().iter_mut());
    }

    /// Whether a step has left numbers: no variance is negative and nothing is infinite or not a number. `extra` is a number
    /// that shall be finite too.
    #[allow(clippy::eq_op, reason = "a number minus itself is zero only if it is finite")]
    #[inline(always)]
    pub(crate) fn is_sound<const N: usize>(&self, extra: T) -> bool {
        let zero = T::zero();
        let mut positive = self.strain_variance >= zero && self.rate_variance >= zero;
        let mut sum = extra + self.strain + self.rate;
        for branch in &self.branches {
            positive = positive && branch.variance >= zero;
            sum += branch.mean;
        }
        if Self::has_baseline(N) {
            positive = positive && self.baseline.variance >= zero;
            sum += self.baseline.mean;
        }
        // Whatever is not finite makes the sum not finite, and such a number minus itself is not zero.
        positive && sum - sum == zero
    }

    /// Sum of all variances.
    #[inline(always)]
    pub(crate) fn variances<const N: usize>(&self) -> T {
        let motion = self.strain_variance + self.rate_variance;
        let baseline = if Self::has_baseline(N) { self.baseline.variance } else { T::zero() };
        self.branches.iter().fold(motion + baseline, |sum, branch| sum + branch.variance)
    }
}
