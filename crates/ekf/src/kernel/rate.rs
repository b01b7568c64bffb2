//! What a sign-split filter does to the rate alone.

use ohmstrain_model::{Phase, RateChange, Scalar, Turning};

use super::{Part, Parts};
use crate::belief::gaussian::Real;
use crate::belief::tail::Tail;
use crate::{Curve, Gaussian, SparseEkf, Switch};

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// The rate after a step in a moving phase.
    #[inline(always)]
    pub(crate) fn rate_ahead(&self, phase: Phase, from: &Parts<T, B>) -> Gaussian<T> {
        let (step, b) = (&self.step, self.step.motion[1]);
        let toward = if phase == Phase::Extend { step.phase_input[1] } else { -step.phase_input[1] };
        let mean = step.input[1] + toward + b[0] * from.strain + b[1] * from.rate;
        let spread = [
            b[0] * from.strain_variance + b[1] * from.strain_rate,
            b[0] * from.strain_rate + b[1] * from.rate_variance,
        ];
        Gaussian { mean, variance: step.noise[2] + b[0] * spread[0] + b[1] * spread[1] }
    }
}

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G: Curve<T>> SparseEkf<T, S, B, N, G> {
    /// What a rate of the sign of `before` leaves open over a step, as
    /// [`SwitchedModel::turning`](ohmstrain_model::SwitchedModel::turning).
    #[inline(always)]
    pub(crate) fn turning(&self, before: Phase, from: &Parts<T, B>) -> Turning<T> {
        let (step, change) = (&self.step, self.step.rate_change);
        let (side, toward) =
            if before == Phase::Retract { (-T::one(), -step.phase_input[1]) } else { (T::one(), step.phase_input[1]) };
        let spread = [
            change[0] * from.strain_variance + change[1] * from.strain_rate,
            change[0] * from.strain_rate + change[1] * from.rate_variance,
        ];
        let change = RateChange {
            expected: side * (step.input[1] + toward + change[0] * from.strain + change[1] * from.rate),
            spread: change[0] * spread[0] + change[1] * spread[1],
            noise: step.noise[2],
            is_brownian: true,
        };
        Turning::new(side * from.rate, from.rate_variance, &change, S::root)
    }
}

impl<T: Real, const B: usize> Parts<T, B> {
    /// Draws the rate anew, independent of everything else.
    #[inline(always)]
    pub(crate) fn renew_rate(&mut self, fresh: &Gaussian<T>) {
        (self.rate, self.rate_variance, self.strain_rate) = (fresh.mean, fresh.variance, T::zero());
        for part in self.branches.iter_mut().chain([&mut self.baseline]) {
            part.with_rate = T::zero();
        }
    }

    /// Restricts the rate to the sign of a moving phase; what that leaves of the Gaussian. Tails beyond `clear` squared
    /// deviations are not cut off.
    #[inline(always)]
    pub(crate) fn cut_rate<S: Switch<T>, const N: usize>(&mut self, phase: Phase, clear: T) -> T {
        let variance = self.rate_variance;
        let side = if phase == Phase::Retract { -T::one() } else { T::one() };
        let toward = side * self.rate;
        if variance <= T::zero() {
            return if toward < T::zero() { T::zero() } else { T::one() };
        }
        if toward > T::zero() && toward * toward > clear * variance {
            return T::one();
        }
        let per_sd = T::one() / S::root(variance);
        let border = -toward * per_sd;
        let Tail { mass, hazard: shift } = Tail::above(border);
        let (narrowed, zero, gone) = (border * shift - shift * shift, T::zero(), -T::one());
        // By comparisons, which cost less than calls of `fmax` and `fmin`.
        let narrowed = if narrowed > zero {
            zero
        } else if narrowed < gone {
            gone
        } else {
            narrowed
        };
        self.regress::<N>(side * shift * per_sd, narrowed * per_sd * per_sd);
        mass
    }

    /// Moves the rate, everything else along its regression: means by covariance · `moves`, covariances by the product of
    /// both covariances · `narrows`.
    #[inline(always)]
    fn regress<const N: usize>(&mut self, moves: T, narrows: T) {
        let (with_strain, with_rate) = (self.strain_rate, self.rate_variance);
        let (on_strain, on_rate) = (with_strain * narrows, with_rate * narrows);
        let branches = self.branches.map(|branch| branch.with_rate);
        let follow = |part: &mut Part<T, B>, others: usize| {
            let (own, narrowing) = (part.with_rate, part.with_rate * narrows);
            part.mean += own * moves;
            part.with_strain += narrowing * with_strain;
            part.with_rate += narrowing * with_rate;
            for (with, other) in part.with.iter_mut().zip(&branches).take(others) {
                *with += narrowing * *other;
            }
            part.variance += narrowing * own;
        };
        self.strain += with_strain * moves;
        self.rate += with_rate * moves;
        self.strain_variance += on_strain * with_strain;
        self.strain_rate += on_rate * with_strain;
        self.rate_variance += on_rate * with_rate;
        for (i, branch) in self.branches.iter_mut().enumerate() {
            follow(branch, i);
        }
        if Self::has_baseline(N) {
            follow(&mut self.baseline, B);
        }
    }
}
