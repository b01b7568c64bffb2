//! The prediction, in place. Sums are written with what does not depend on the belief first.

use ohmstrain_model::{Phase, Scalar};

use crate::sparse_constants::{BranchConstants, Gains, StepConstants};
use crate::sparse_parts::{Part, Parts};
use crate::switch::RateSpread;
use crate::{SparseEkf, Switch};

/// What a step does to one branch. The gain grows with the sum of old and new strain: the old one's share is in `row`, the
/// new one's is added when its covariances are known.
#[derive(Clone, Copy)]
struct Driven<T> {
    change: T,
    gain: T,
    /// Growth of the change with old or new strain.
    pull: T,
    /// Answer to old strain and rate.
    row: [T; 2],
    /// What is left of the covariances with old strain and rate, and these with what the motion adds.
    kept: [T; 2],
    carried: [T; 2],
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
        let input = |toward_strain: T, toward_rate: T| match phase {
            None => toward_strain,
            Some(Phase::Extend) => toward_strain + toward_rate,
            Some(_) => toward_strain - toward_rate,
        };
        parts.strain = input(step.input[0], step.phase_input[0]) + a[0] * strain + a[1] * rate;
        parts.rate = input(step.input[1], step.phase_input[1]) + b[0] * strain + b[1] * rate;
        let strain_sum = strain + parts.strain;

        let from_strain = [a[0] * strain_variance + a[1] * strain_rate, a[0] * strain_rate + a[1] * rate_variance];
        let squares = step.rate_squares;
        parts.strain_variance = step.noise[0] + a[0] * from_strain[0] + a[1] * from_strain[1];
        parts.strain_rate = step.noise[1] + b[0] * from_strain[0] + b[1] * from_strain[1];
        parts.rate_variance =
            step.noise[2] + squares[0] * strain_variance + squares[1] * strain_rate + squares[2] * rate_variance;
        let mut spread = RateSpread::new(parts.rate_variance);

        let gains = self.gains.at(strain_sum);
        let driven: [Driven<T>; B] = core::array::from_fn(|i| {
            let (branch, gains, part) = (&step.branches[i], &gains[i], &parts.branches[i]);
            let drive = branch.drive;
            let unit = input(branch.input, branch.phase_input) + drive[0] * strain + drive[1] * rate;
            let (change, gain, pull) = match phase {
                None => split(branch, gains, strain_sum, unit, &mut spread),
                Some(phase) => known(gains, strain_sum, unit, phase == Phase::Extend),
            };
            let row = [pull + gain * drive[0], gain * drive[1]];
            let kept = [branch.decay * part.with_strain, branch.decay * part.with_rate];
            let carried = [
                kept[0] + row[0] * strain_variance + row[1] * strain_rate,
                kept[1] + row[0] * strain_rate + row[1] * rate_variance,
            ];
            Driven { change, gain, pull, row, kept, carried }
        });
        predict_branches(step, parts, &driven);
        if Self::HAS_BASELINE {
            predict_baseline(step, &mut parts.baseline, &driven);
        }
        spread
    }

    /// Predicts one step of a hold: strain stays, there is no rate, branches and baseline relax.
    #[inline(always)]
    fn hold(&self, parts: &mut Parts<T, B>) {
        let zero = T::zero();
        let step = &self.step;
        (parts.rate, parts.strain_rate, parts.rate_variance) = (zero, zero, zero);
        let relax = |part: &mut Part<T, B>, decay: T, decays: &[T; B]| {
            part.mean *= decay;
            part.with_strain *= decay;
            part.with_rate = zero;
            for (with, decays) in part.with.iter_mut().zip(decays) {
                *with *= *decays;
            }
        };
        for i in 0..B {
            let (part, branch) = (&mut parts.branches[i], &step.branches[i]);
            relax(part, branch.decay, &branch.decays);
            part.variance = branch.variance + branch.decays[i] * part.variance;
        }
        if Self::HAS_BASELINE {
            let part = &mut parts.baseline;
            relax(part, step.baseline_decay, &step.baseline_decays);
            part.variance = step.baseline_variance + step.baseline_square * part.variance;
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

/// The branches' covariances with the new motion, which is in `parts` already, and with each other.
#[inline(always)]
fn predict_branches<T: Scalar, const B: usize>(
    step: &StepConstants<T, B>,
    parts: &mut Parts<T, B>,
    driven: &[Driven<T>; B],
) {
    let [a, b] = step.motion;
    for i in 0..B {
        let (branch, Driven { change, gain, pull, row, kept, carried }) = (&step.branches[i], driven[i]);
        // Without the new strain's share in the gain.
        let strain = gain * branch.cross_noise[0] + a[0] * carried[0] + a[1] * carried[1];
        let rate = gain * branch.cross_noise[1] + b[0] * carried[0] + b[1] * carried[1];
        let with_strain = strain + pull * parts.strain_variance;
        let mut new = parts.branches[i];
        for k in 0..i {
            let other = &driven[k];
            new.with[k] = other.gain * (gain * branch.noise[k])
                + other.row[0] * carried[0]
                + other.row[1] * carried[1]
                + row[0] * other.kept[0]
                + row[1] * other.kept[1]
                + branch.decays[k] * new.with[k]
                + other.pull * strain
                + pull * parts.branches[k].with_strain;
        }
        new.variance = branch.variance
            + gain * (gain * branch.noise[i])
            + row[0] * (carried[0] + kept[0])
            + row[1] * (carried[1] + kept[1])
            + branch.decays[i] * new.variance
            + pull * (strain + with_strain);
        new.mean = change + branch.decay * new.mean;
        new.with_strain = with_strain;
        new.with_rate = rate + pull * parts.strain_rate;
        parts.branches[i] = new;
    }
}

/// The baseline's covariances, from its own old ones.
#[inline(always)]
fn predict_baseline<T: Scalar, const B: usize>(
    step: &StepConstants<T, B>,
    part: &mut Part<T, B>,
    driven: &[Driven<T>; B],
) {
    let [a, b] = step.motion;
    let decay = step.baseline_decay;
    let kept = [decay * part.with_strain, decay * part.with_rate];
    part.with_strain = a[0] * kept[0] + a[1] * kept[1];
    part.with_rate = b[0] * kept[0] + b[1] * kept[1];
    for i in 0..B {
        let Driven { pull, row, .. } = driven[i];
        part.with[i] =
            row[0] * kept[0] + row[1] * kept[1] + step.baseline_decays[i] * part.with[i] + pull * part.with_strain;
    }
    part.mean *= decay;
    part.variance = step.baseline_variance + step.baseline_square * part.variance;
}
