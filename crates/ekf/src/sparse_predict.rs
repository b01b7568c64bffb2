//! The prediction, in place. Sums are written with what does not depend on the belief first.

use ohmstrain_model::{Phase, Scalar};

use crate::sparse_constants::{BranchConstants, Gains, StepConstants};
use crate::sparse_parts::{Part, Parts};
use crate::switch::RateSpread;
use crate::{SparseEkf, Switch};

/// What a step does to one branch, and with which gain it was driven.
#[derive(Clone, Copy)]
struct Driven<T> {
    change: T,
    gain: T,
    /// Growth of the change with the sum of old and new strain.
    pull: T,
    /// Row of the Jacobian: strain and rate.
    row: [T; 2],
}

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G> SparseEkf<T, S, B, N, G> {
    pub(crate) const HAS_BASELINE: bool = Parts::<T, B>::has_baseline(N);

    /// Predicts one step ahead. `phase` is a hypothesis, as for [`Dynamics::transition`](crate::Dynamics::transition); with
    /// `None` every branch splits its rate by the variance of the predicted rate, which is returned for the reading's split.
    #[inline(always)]
    pub(crate) fn predict(&self, parts: &mut Parts<T, B>, phase: Option<Phase>) -> RateSpread<T, S> {
        if phase == Some(Phase::Hold) {
            self.hold(parts);
            return RateSpread::new(T::zero());
        }
        let step = &self.step;
        let [a, b] = step.motion;
        let Parts { strain, rate, strain_variance, strain_rate, rate_variance, .. } = *parts;
        let toward = match phase {
            Some(Phase::Extend) => T::one(),
            Some(_) => -T::one(),
            None => T::zero(),
        };
        let input = |toward_strain: T, toward_rate: T| match phase {
            None => toward_strain,
            Some(_) => toward_strain + toward * toward_rate,
        };
        parts.strain = input(step.input[0], step.phase_input[0]) + a[0] * strain + a[1] * rate;
        parts.rate = input(step.input[1], step.phase_input[1]) + b[0] * strain + b[1] * rate;
        let strain_sum = strain + parts.strain;

        let from_strain = [a[0] * strain_variance + a[1] * strain_rate, a[0] * strain_rate + a[1] * rate_variance];
        let from_rate = [b[0] * strain_variance + b[1] * strain_rate, b[0] * strain_rate + b[1] * rate_variance];
        let mut spread = RateSpread::new(step.noise[2] + b[0] * from_rate[0] + b[1] * from_rate[1]);

        let gains = self.gains.of(strain_sum);
        let driven: [Driven<T>; B] = core::array::from_fn(|i| {
            let (branch, gains) = (&step.branches[i], &gains[i]);
            let unit = input(branch.input, branch.phase_input) + branch.drive[0] * strain + branch.drive[1] * rate;
            let (change, gain, pull) = match phase {
                None => split(branch, gains, strain_sum, unit, &mut spread),
                Some(phase) => known(gains, strain_sum, unit, phase == Phase::Extend),
            };
            let row = [gain * branch.drive[0] + pull * step.strain_sum, gain * branch.drive[1] + pull * a[1]];
            Driven { change, gain, pull, row }
        });

        if Self::HAS_BASELINE {
            predict_baseline(step, &mut parts.baseline, &driven);
        }
        predict_branches(step, parts, &driven);
        parts.strain_variance = step.noise[0] + a[0] * from_strain[0] + a[1] * from_strain[1];
        parts.strain_rate = step.noise[1] + b[0] * from_strain[0] + b[1] * from_strain[1];
        parts.rate_variance = spread.variance;
        spread
    }

    /// Predicts one step of a hold: strain stays, there is no rate, branches and baseline relax.
    #[inline(always)]
    fn hold(&self, parts: &mut Parts<T, B>) {
        let zero = T::zero();
        let step = &self.step;
        (parts.rate, parts.strain_rate, parts.rate_variance) = (zero, zero, zero);
        let relax = |part: &mut Part<T, B>, decay: T, variance: T| {
            part.mean *= decay;
            part.with_strain *= decay;
            part.with_rate = zero;
            for (with, other) in part.with.iter_mut().zip(&step.branches) {
                *with *= decay * other.decay;
            }
            part.variance = variance + decay * (decay * part.variance);
        };
        for (part, branch) in parts.branches.iter_mut().zip(&step.branches) {
            relax(part, branch.decay, branch.variance);
        }
        if Self::HAS_BASELINE {
            relax(&mut parts.baseline, step.baseline_decay, step.baseline_variance);
        }
    }
}

/// Change, gain and pull of a branch whose direction is known.
#[inline(always)]
fn known<T: Scalar>(gains: &Gains<T>, strain_sum: T, unit: T, extends: bool) -> (T, T, T) {
    let gain = if extends { &gains.extend } else { &gains.retract };
    let here = gain.at(strain_sum);
    (here * unit, here, gain.growth * unit)
}

/// The same where the rate's distribution decides.
#[inline(always)]
fn split<T: Scalar, S: Switch<T>, const B: usize>(
    branch: &BranchConstants<T, B>,
    gains: &Gains<T>,
    strain_sum: T,
    unit: T,
    spread: &mut RateSpread<T, S>,
) -> (T, T, T) {
    if !(unit * unit < branch.clear * spread.variance) {
        return known(gains, strain_sum, unit, unit > T::zero());
    }
    let rate = spread.blend(unit * branch.per_reach);
    let (extend, retract) = (gains.extend.at(strain_sum), gains.retract.at(strain_sum));
    (
        branch.reach * rate.drive(extend, retract),
        rate.slope(extend, retract),
        branch.reach * rate.drive(gains.extend.growth, gains.retract.growth),
    )
}

/// The baseline's row, from the others' old values.
#[inline(always)]
fn predict_baseline<T: Scalar, const B: usize>(
    step: &StepConstants<T, B>,
    part: &mut Part<T, B>,
    driven: &[Driven<T>; B],
) {
    let [a, b] = step.motion;
    let decay = step.baseline_decay;
    let (with_strain, with_rate) = (decay * part.with_strain, decay * part.with_rate);
    for i in 0..B {
        let [on_strain, on_rate] = driven[i].row;
        let kept = decay * part.with[i];
        part.with[i] = on_strain * with_strain + on_rate * with_rate + step.branches[i].decay * kept;
    }
    part.mean *= decay;
    part.with_strain = a[0] * with_strain + a[1] * with_rate;
    part.with_rate = b[0] * with_strain + b[1] * with_rate;
    part.variance = step.baseline_variance + decay * (decay * part.variance);
}

/// The branches' rows, the last one first: each needs the old values of those before it and of the motion.
#[inline(always)]
fn predict_branches<T: Scalar, const B: usize>(
    step: &StepConstants<T, B>,
    parts: &mut Parts<T, B>,
    driven: &[Driven<T>; B],
) {
    let [a, b] = step.motion;
    for i in (0..B).rev() {
        let (constants, Driven { change, gain, pull, row }) = (&step.branches[i], driven[i]);
        let (decay, old) = (constants.decay, parts.branches[i]);
        // Row of F P: covariances of the new branch with the old motion, and below with the old branches.
        let strain = row[0] * parts.strain_variance + row[1] * parts.strain_rate + decay * old.with_strain;
        let rate = row[0] * parts.strain_rate + row[1] * parts.rate_variance + decay * old.with_rate;
        let cross = [
            gain * constants.cross_noise[0] + pull * step.noise[0],
            gain * constants.cross_noise[1] + pull * step.noise[1],
        ];
        let entry = |k: usize, start: T, old_pair: T| {
            let (other, to, with) = (&step.branches[k], &driven[k], &parts.branches[k]);
            let kept = row[0] * with.with_strain + row[1] * with.with_rate + decay * old_pair;
            let noise = gain * constants.noise[k] + pull * other.cross_noise[0];
            start + to.gain * noise + to.pull * cross[0] + to.row[0] * strain + to.row[1] * rate + other.decay * kept
        };
        let mut new = old;
        new.mean = change + decay * old.mean;
        for k in 0..i {
            new.with[k] = entry(k, T::zero(), old.with[k]);
        }
        new.variance = entry(i, constants.variance, old.variance);
        new.with_strain = cross[0] + a[0] * strain + a[1] * rate;
        new.with_rate = cross[1] + b[0] * strain + b[1] * rate;
        parts.branches[i] = new;
    }
}
