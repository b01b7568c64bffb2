//! The prediction, in place. Sums are written with what does not depend on the belief first.

use ohmstrain_model::{Phase, Scalar, Turning, correlated_steps};

use crate::sparse_constants::{BranchConstants, Gains, StepConstants};
use crate::sparse_parts::{Part, Parts};
use crate::switch::RateSpread;
use crate::{SparseEkf, Switch};

/// What a step does to one branch. The gain grows with the sum of old and new strain: the old one's share is in `row`, the
/// new one's is added when its covariances are known.
#[derive(Clone, Copy)]
pub(crate) struct Driven<T> {
    change: T,
    gain: T,
    /// Growth of the change with old or new strain.
    pub pull: T,
    /// Answer to old strain and rate.
    pub row: [T; 2],
    /// What is left of the covariances with old strain and rate, and these with what the motion adds.
    kept: [T; 2],
    carried: [T; 2],
    /// What a unit of path in the other direction would have changed.
    jump: T,
}

/// How a branch is driven: its change, gain and pull; its jump, and the variance of the rate's split, where that is open.
#[derive(Clone, Copy)]
struct Drive<T> {
    change: T,
    gain: T,
    pull: T,
    jump: T,
    left: T,
}

/// What is known of the direction of a step that moves.
#[derive(Clone, Copy)]
pub(crate) enum Course<T> {
    /// Nothing but the rate's distribution.
    Uncertain,
    /// A hypothesis.
    Known(Phase),
    /// A hypothesis of both ends of the step: the phase at its end, and what turning around on the way adds.
    Within(Phase, Turning<T>),
}

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize, G> SparseEkf<T, S, B, N, G> {
    pub(crate) const HAS_BASELINE: bool = Parts::<T, B>::has_baseline(N);

    /// Predicts one step ahead. With an uncertain course every branch splits its rate by the variance of the rate in the middle
    /// of the step. What is returned is for the reading's split.
    #[inline(always)]
    pub(crate) fn predict(&self, parts: &mut Parts<T, B>, course: Course<T>) -> RateSpread<T, S> {
        if let Course::Known(Phase::Hold) = course {
            self.hold(parts);
            return RateSpread::new(T::zero());
        }
        self.move_on(parts, course).0
    }

    /// The prediction of a step that moves, and what it did to the branches.
    #[inline(always)]
    pub(crate) fn move_on(&self, parts: &mut Parts<T, B>, course: Course<T>) -> (RateSpread<T, S>, [Driven<T>; B]) {
        let step = &self.step;
        let [a, b] = step.motion;
        let Parts { strain, rate, strain_variance, strain_rate, rate_variance, .. } = *parts;
        let input = |toward_strain: T, toward_rate: T| match course {
            Course::Uncertain => toward_strain,
            Course::Known(Phase::Extend) | Course::Within(Phase::Extend, _) => toward_strain + toward_rate,
            _ => toward_strain - toward_rate,
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
        let mut spread: RateSpread<T, S> = RateSpread::new(T::of(0.5) * (rate_variance + parts.rate_variance));

        let gains = self.gains.at(strain_sum);
        // Two loops: one short enough to be unrolled, and one that holds the choices.
        let drives: [Drive<T>; B] = core::array::from_fn(|i| {
            let (branch, gains) = (&step.branches[i], &gains[i]);
            let drive = branch.drive;
            let unit = input(branch.input, branch.phase_input) + drive[0] * strain + drive[1] * rate;
            match course {
                Course::Uncertain => split(branch, gains, strain_sum, unit, &mut spread),
                Course::Known(phase) => known(gains, strain_sum, unit, phase == Phase::Extend),
                Course::Within(phase, turning) => within(branch, gains, strain_sum, unit, (phase, &turning)),
            }
        });
        // All branches are driven by about the same rate: what its direction leaves open is taken from the first.
        let mut unexplained = drives.first().map_or(T::zero(), |drive| drive.left);
        if matches!(course, Course::Uncertain) && unexplained > T::zero() {
            let with_strain = b[0] * strain_variance + b[1] * strain_rate;
            let together = b[0] * strain_rate + b[1] * rate_variance;
            let fresh = step.noise[2] + with_strain * step.rate_change[0] + together * step.rate_change[1];
            unexplained *= step.averaging * correlated_steps(parts.rate_variance, together, fresh);
        }
        let driven: [Driven<T>; B] = core::array::from_fn(|i| {
            let (branch, part, Drive { change, gain, pull, jump, .. }) =
                (&step.branches[i], &parts.branches[i], drives[i]);
            let row = [pull + gain * branch.drive[0], gain * branch.drive[1]];
            let kept = [branch.decay * part.with_strain, branch.decay * part.with_rate];
            let carried = [
                kept[0] + row[0] * strain_variance + row[1] * strain_rate,
                kept[1] + row[0] * strain_rate + row[1] * rate_variance,
            ];
            Driven { change, gain, pull, row, kept, carried, jump }
        });
        predict_branches(step, parts, &driven);
        if unexplained > T::zero() {
            leave_open(parts, &driven, unexplained);
        }
        if Self::HAS_BASELINE {
            predict_baseline(step, &mut parts.baseline, &driven);
        }
        (RateSpread::new(parts.rate_variance), driven)
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

/// Of a branch whose direction is known.
#[inline(always)]
fn known<T: Scalar>(gains: &Gains<T>, strain_sum: T, unit: T, extends: bool) -> Drive<T> {
    let gain = if extends { &gains.extend } else { &gains.retract };
    let here = gain.at(strain_sum);
    Drive { change: here * unit, gain: here, pull: gain.growth * unit, jump: T::zero(), left: T::zero() }
}

/// The same where the rate may have turned around on the way.
#[inline(always)]
fn within<T: Scalar, const B: usize>(
    branch: &BranchConstants<T, B>,
    gains: &Gains<T>,
    strain_sum: T,
    unit: T,
    (phase, turning): (Phase, &Turning<T>),
) -> Drive<T> {
    let net = known(gains, strain_sum, unit, phase == Phase::Extend);
    if !(turning.variance > T::zero()) {
        return net;
    }
    let jump = branch.reach * (gains.extend.at(strain_sum) - gains.retract.at(strain_sum));
    let growth = branch.reach * (gains.extend.growth - gains.retract.growth);
    let detour = T::of(0.5) * turning.excess;
    Drive {
        change: net.change + jump * detour,
        pull: net.pull + growth * detour,
        jump,
        left: T::of(0.25) * turning.variance,
        ..net
    }
}

/// The same where the rate's distribution decides.
#[inline(always)]
fn split<T: Scalar, S: Switch<T>, const B: usize>(
    branch: &BranchConstants<T, B>,
    gains: &Gains<T>,
    strain_sum: T,
    unit: T,
    spread: &mut RateSpread<T, S>,
) -> Drive<T> {
    if !(unit * unit < branch.clear * spread.variance) {
        return known(gains, strain_sum, unit, unit > T::zero());
    }
    let rate = spread.blend(unit * branch.per_reach);
    let (extend, retract) = (gains.extend.at(strain_sum), gains.retract.at(strain_sum));
    Drive {
        change: branch.reach * rate.drive(extend, retract),
        gain: rate.slope(extend, retract),
        pull: branch.reach * rate.drive(gains.extend.growth, gains.retract.growth),
        jump: branch.reach * (extend - retract),
        left: rate.variance,
    }
}

/// Adds what the direction leaves open: one number for all branches.
#[inline(always)]
fn leave_open<T: Scalar, const B: usize>(parts: &mut Parts<T, B>, driven: &[Driven<T>; B], unexplained: T) {
    for i in 0..B {
        let share = unexplained * driven[i].jump;
        let part = &mut parts.branches[i];
        for (with, other) in part.with.iter_mut().zip(driven).take(i) {
            *with += share * other.jump;
        }
        part.variance += share * driven[i].jump;
    }
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
        let (branch, Driven { change, gain, pull, row, kept, carried, .. }) = (&step.branches[i], &driven[i]);
        let (gain, pull) = (*gain, *pull);
        // Without the new strain's share in the gain.
        let strain = gain * branch.cross_noise[0] + a[0] * carried[0] + a[1] * carried[1];
        let rate = gain * branch.cross_noise[1] + b[0] * carried[0] + b[1] * carried[1];
        let with_strain = strain + pull * parts.strain_variance;
        for k in 0..i {
            let (other, others_strain) = (&driven[k], parts.branches[k].with_strain);
            let with = &mut parts.branches[i].with[k];
            *with = other.gain * (gain * branch.noise[k])
                + other.row[0] * carried[0]
                + other.row[1] * carried[1]
                + row[0] * other.kept[0]
                + row[1] * other.kept[1]
                + branch.decays[k] * *with
                + other.pull * strain
                + pull * others_strain;
        }
        let part = &mut parts.branches[i];
        part.variance = branch.variance
            + gain * (gain * branch.noise[i])
            + row[0] * (carried[0] + kept[0])
            + row[1] * (carried[1] + kept[1])
            + branch.decays[i] * part.variance
            + pull * (strain + with_strain);
        part.mean = *change + branch.decay * part.mean;
        part.with_strain = with_strain;
        part.with_rate = rate + pull * parts.strain_rate;
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
