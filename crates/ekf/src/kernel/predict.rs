//! The prediction, in place. In sums, terms that do not depend on the belief come first.

use ohmstrain_model::{LEAST_LEFT, Phase, Scalar, Turning};

use super::constants::{BranchConstants, Gain, GainsAt, StepConstants};
use super::{Lanes, Part, Parts, RateSpread, SparseEkf, Switch};

/// Effect of a step on one branch. The gain grows with the sum of old and new strain: the contribution of the old strain
/// is in `row`, that of the new one is added once its covariances are known.
#[derive(Clone, Copy)]
pub(super) struct Driven<V> {
    change: V,
    gain: V,
    /// Growth of the change with old or new strain.
    pub pull: V,
    /// Response to old strain and rate.
    pub row: [V; 2],
    /// Decayed covariances with old strain and rate; then the same plus the contribution of the motion.
    kept: [V; 2],
    carried: [V; 2],
    /// Difference of the change between both directions, per unit of path.
    jump: V,
}

/// Drive of a branch: its change, gain and pull; for an uncertain direction also its jump, and the variance of the rate's
/// split.
#[derive(Clone, Copy)]
struct Drive<V> {
    change: V,
    gain: V,
    pull: V,
    jump: V,
    left: V,
}

/// Drives of all branches.
pub(super) struct Driving<V, const B: usize> {
    drives: [Drive<V>; B],
    /// Variance of the path due to the uncertain direction.
    unexplained: V,
}

/// Information about the direction of a step.
#[derive(Clone, Copy)]
pub(crate) enum Course<V> {
    /// Only the rate's distribution.
    Uncertain,
    /// A hypothesis.
    Known(Phase),
    /// A hypothesis about both ends of the step: the phase at its end, and the excess path of turning around in
    /// between.
    Within(Phase, Turning<V>),
}

impl<V> Course<V> {
    /// Returns an input plus the contribution of a moving phase's mean rate.
    #[inline(always)]
    fn input(&self, like: V, toward_strain: V::Number, toward_rate: V::Number) -> V
    where
        V: Lanes,
    {
        match self {
            Self::Uncertain => like.with(toward_strain),
            Self::Known(Phase::Extend) | Self::Within(Phase::Extend, _) => {
                like.with(toward_strain) + like.with(toward_rate)
            }
            _ => like.with(toward_strain) - like.with(toward_rate),
        }
    }
}

/// `a₀ b₀ + a₁ b₁`.
#[inline(always)]
pub(super) fn dot<V: Lanes>([a0, a1]: [V; 2], [b0, b1]: [V; 2]) -> V {
    a1.mul_add(b1, a0 * b0)
}

/// `start + a₀ b₀ + a₁ b₁`.
#[inline(always)]
pub(super) fn sum<V: Lanes>(start: V, [a0, a1]: [V; 2], [b0, b1]: [V; 2]) -> V {
    a1.mul_add(b1, a0.mul_add(b0, start))
}

/// Returns the same two numbers in all lanes.
#[inline(always)]
fn pair<V: Lanes>(like: V, [a, b]: [V::Number; 2]) -> [V; 2] {
    [like.with(a), like.with(b)]
}

impl<T: Scalar, S, const B: usize, const N: usize, G> SparseEkf<T, S, B, N, G> {
    pub(crate) const HAS_BASELINE: bool = Parts::<T, B>::has_baseline(N);

    /// Predicts one step ahead. With an uncertain course, every branch splits its rate with the variance of the rate in the
    /// middle of the step; only then is the switch used, the caller's because the filter's may not support these lanes. Returns
    /// the spread of the rate for the split in the update.
    #[inline(always)]
    pub(crate) fn predict<V: Lanes<Number = T>, X: Switch<V>>(
        &self,
        parts: &mut Parts<V, B>,
        course: Course<V>,
    ) -> RateSpread<V, X> {
        if let Course::Known(Phase::Hold) = course {
            self.hold(parts);
            return RateSpread::new(parts.rate);
        }
        let Parts { strain_variance, strain_rate, rate_variance, .. } = *parts;
        let driving = self.drive::<V, X>(parts, course);
        self.spread_on(parts, &driving, [strain_variance, strain_rate, rate_variance]);
        RateSpread::new(parts.rate_variance)
    }

    /// Propagates means and covariances of strain and rate, and returns the drive of the branches.
    #[inline(always)]
    pub(super) fn drive<V: Lanes<Number = T>, X: Switch<V>>(
        &self,
        parts: &mut Parts<V, B>,
        course: Course<V>,
    ) -> Driving<V, B> {
        let step = &self.step;
        let Parts { strain, rate, strain_variance, strain_rate, rate_variance, .. } = *parts;
        let [a, b] = [pair(strain, step.motion[0]), pair(strain, step.motion[1])];
        let (zero, push) = (strain.nothing(), |i: usize| course.input(strain, step.input[i], step.phase_input[i]));
        let before = [strain, rate];
        parts.strain = sum(push(0), before, a);
        parts.rate = sum(push(1), before, b);
        let strain_sum = strain + parts.strain;

        let (with_strain, with_rate) = ([strain_variance, strain_rate], [strain_rate, rate_variance]);
        let from_strain = [dot(with_strain, a), dot(with_rate, a)];
        parts.strain_variance = sum(strain.with(step.noise[0]), from_strain, a);
        parts.strain_rate = sum(strain.with(step.noise[1]), from_strain, b);
        let squares = step.rate_squares;
        let from_old = sum(strain.with(step.noise[2]), with_strain, pair(strain, [squares[0], squares[1]]));
        parts.rate_variance = rate_variance.scale_add(squares[2], from_old);
        let mut spread: RateSpread<V, X> = RateSpread::new((rate_variance + parts.rate_variance).scale(T::of(0.5)));

        let gains = self.gains.gains(strain_sum);
        let nothing = Drive { change: zero, gain: zero, pull: zero, jump: zero, left: zero };
        let mut drives = [nothing; B];
        for i in 0..B {
            let branch = &step.branches[i];
            let push = course.input(strain, branch.input, branch.phase_input);
            let unit = sum(push, before, pair(strain, branch.drive));
            drives[i] = match course {
                Course::Uncertain => split(branch, gains.of(i), unit, &mut spread),
                Course::Known(phase) => known(gains.of(i), unit, phase),
                Course::Within(phase, turning) => within(branch, gains.of(i), unit, (phase, &turning)),
            };
        }
        // All branches are driven by about the same rate, so the variance due to its uncertain direction is taken from
        // the first.
        let mut unexplained = if B > 0 { drives[0].left } else { zero };
        let opens = zero.less(unexplained);
        if matches!(course, Course::Uncertain) && !V::none(opens) {
            let [with_strain, together] = [dot(with_strain, b), dot(with_rate, b)];
            let fresh = sum(strain.with(step.noise[2]), [with_strain, together], pair(strain, step.rate_change));
            let steps = correlated_steps(parts.rate_variance, together, fresh);
            unexplained = V::pick(opens, unexplained * steps.scale(step.averaging), zero);
        }
        Driving { drives, unexplained }
    }

    /// Propagates the branches and the baseline after the motion, given its old covariances. Returns the effect on the
    /// branches.
    #[inline(always)]
    pub(super) fn spread_on<V: Lanes<Number = T>>(
        &self,
        parts: &mut Parts<V, B>,
        Driving { drives, unexplained }: &Driving<V, B>,
        [strain_variance, strain_rate, rate_variance]: [V; 3],
    ) -> [Driven<V>; B] {
        let (step, zero) = (&self.step, strain_variance.nothing());
        let [a, b] = [pair(zero, step.motion[0]), pair(zero, step.motion[1])];
        let (with_strain, with_rate) = ([strain_variance, strain_rate], [strain_rate, rate_variance]);
        let idle = Driven {
            change: zero,
            gain: zero,
            pull: zero,
            row: [zero; 2],
            kept: [zero; 2],
            carried: [zero; 2],
            jump: zero,
        };
        let mut driven = [idle; B];
        for i in 0..B {
            let (branch, part, Drive { change, gain, pull, jump, .. }) =
                (&step.branches[i], &parts.branches[i], drives[i]);
            let [from_strain, from_rate] = branch.drive;
            let row = [gain.scale_add(from_strain, pull), gain.scale(from_rate)];
            let kept = [part.with_strain.scale(branch.decay), part.with_rate.scale(branch.decay)];
            let carried = [sum(kept[0], row, with_strain), sum(kept[1], row, with_rate)];
            driven[i] = Driven { change, gain, pull, row, kept, carried, jump };
        }
        predict_branches(step, parts, &driven, [a, b]);
        if !V::none(zero.less(*unexplained)) {
            leave_open(parts, &driven, *unexplained);
        }
        if Self::HAS_BASELINE {
            predict_baseline(step, &mut parts.baseline, &driven, [a, b]);
        }
        driven
    }

    /// Predicts one step of a hold: strain is constant, the rate is zero, branches and baseline relax.
    #[inline(always)]
    fn hold<V: Lanes<Number = T>>(&self, parts: &mut Parts<V, B>) {
        let zero = parts.strain.nothing();
        let step = &self.step;
        (parts.rate, parts.strain_rate, parts.rate_variance) = (zero, zero, zero);
        for i in 0..B {
            let (part, branch) = (&mut parts.branches[i], &step.branches[i]);
            relax(part, branch.decay, &branch.decays);
            part.variance = part.variance.scale_add(branch.decays[i], zero.with(branch.variance));
        }
        if Self::HAS_BASELINE {
            let part = &mut parts.baseline;
            relax(part, step.baseline_decay, &step.baseline_decays);
            part.variance = part.variance.scale_add(step.baseline_square, zero.with(step.baseline_variance));
        }
    }
}

#[inline(always)]
fn relax<V: Lanes, const B: usize>(part: &mut Part<V, B>, decay: V::Number, decays: &[V::Number; B]) {
    part.mean = part.mean.scale(decay);
    part.with_strain = part.with_strain.scale(decay);
    part.with_rate = part.mean.nothing();
    for k in 0..B {
        part.with[k] = part.with[k].scale(decays[k]);
    }
}

/// See [`ohmstrain_model::correlated_steps`]; an exactly known rate has no error that persists.
#[inline(always)]
fn correlated_steps<V: Lanes>(ahead: V, together: V, fresh: V) -> V {
    let (square, both) = (ahead * ahead, together * together);
    let both = V::pick(both.less(square), both, square);
    let (left, least) = (fresh * (ahead + together), square * square.literal(LEAST_LEFT));
    (square + both).over(V::pick(least.less(left), left, least))
}

/// Returns the drive of a branch with the gain of a known direction.
#[inline(always)]
fn driven_by<V: Lanes>(gain: Gain<V>, strain_sum: V, unit: V) -> Drive<V> {
    let (here, zero) = (gain.at(strain_sum), unit.nothing());
    Drive { change: here * unit, gain: here, pull: gain.growth * unit, jump: zero, left: zero }
}

/// Returns the drive of a branch whose direction is known.
#[inline(always)]
fn known<V: Lanes, const B: usize>(gains: GainsAt<'_, V, B>, unit: V, phase: Phase) -> Drive<V> {
    let gain = if matches!(phase, Phase::Extend) { gains.extend() } else { gains.retract() };
    driven_by(gain, gains.strain_sum, unit)
}

/// Returns the drive of a branch if the rate may have turned around within the step.
#[inline(always)]
fn within<V: Lanes, const B: usize>(
    branch: &BranchConstants<V::Number, B>,
    gains: GainsAt<'_, V, B>,
    unit: V,
    (phase, turning): (Phase, &Turning<V>),
) -> Drive<V> {
    let net = known(gains, unit, phase);
    if V::none(unit.nothing().less(turning.variance)) {
        return net;
    }
    let (extend, retract) = (gains.extend(), gains.retract());
    let jump = (extend.at(gains.strain_sum) - retract.at(gains.strain_sum)).scale(branch.reach);
    let growth = (extend.growth - retract.growth).scale(branch.reach);
    let detour = turning.excess * unit.literal(0.5);
    Drive {
        change: jump.mul_add(detour, net.change),
        pull: growth.mul_add(detour, net.pull),
        jump,
        left: turning.variance * unit.literal(0.25),
        ..net
    }
}

/// Returns the drive of a branch if the direction follows from the rate's distribution.
#[inline(always)]
fn split<V: Lanes, S: Switch<V>, const B: usize>(
    branch: &BranchConstants<V::Number, B>,
    gains: GainsAt<'_, V, B>,
    unit: V,
    spread: &mut RateSpread<V, S>,
) -> Drive<V> {
    let uncertain = (unit * unit).less(spread.variance.scale(branch.clear));
    let (extends, zero) = (unit.nothing().less(unit), unit.nothing());
    if V::none(uncertain) {
        return driven_by(gains.toward(extends), gains.strain_sum, unit);
    }
    let rate = spread.blend(unit.scale(branch.per_reach));
    let (extend, retract) = (gains.extend(), gains.retract());
    let here = [extend.at(gains.strain_sum), retract.at(gains.strain_sum)];
    let rates = [rate.extend, rate.retract];
    let open = Drive {
        change: dot(rates, here).scale(branch.reach),
        gain: dot([rate.extend_probability, rate.retract_probability], here),
        pull: dot(rates, [extend.growth, retract.growth]).scale(branch.reach),
        jump: (here[0] - here[1]).scale(branch.reach),
        left: rate.variance,
    };
    if V::all(uncertain) {
        return open;
    }
    let clear = driven_by(gains.toward(extends), gains.strain_sum, unit);
    Drive {
        change: V::pick(uncertain, open.change, clear.change),
        gain: V::pick(uncertain, open.gain, clear.gain),
        pull: V::pick(uncertain, open.pull, clear.pull),
        jump: V::pick(uncertain, open.jump, zero),
        left: V::pick(uncertain, open.left, zero),
    }
}

/// Adds the variance due to the uncertain direction, one number for all branches.
#[inline(always)]
fn leave_open<V: Lanes, const B: usize>(parts: &mut Parts<V, B>, driven: &[Driven<V>; B], unexplained: V) {
    for i in 0..B {
        let share = unexplained * driven[i].jump;
        let part = &mut parts.branches[i];
        for k in 0..i {
            part.with[k] = share.mul_add(driven[k].jump, part.with[k]);
        }
        part.variance = share.mul_add(driven[i].jump, part.variance);
    }
}

/// Predicts the branches' covariances with the new motion, which is already in `parts`, and with each other.
#[inline(always)]
fn predict_branches<V: Lanes, const B: usize>(
    step: &StepConstants<V::Number, B>,
    parts: &mut Parts<V, B>,
    driven: &[Driven<V>; B],
    [a, b]: [[V; 2]; 2],
) {
    for i in 0..B {
        let (branch, Driven { change, gain, pull, row, kept, carried, .. }) = (&step.branches[i], driven[i]);
        // Without the contribution of the new strain to the gain.
        let strain = sum(gain.scale(branch.cross_noise[0]), carried, a);
        let rate = sum(gain.scale(branch.cross_noise[1]), carried, b);
        let with_strain = pull.mul_add(parts.strain_variance, strain);
        for k in 0..i {
            let (other, others_strain) = (&driven[k], parts.branches[k].with_strain);
            let with = &mut parts.branches[i].with[k];
            let from_motion = sum(other.gain * gain.scale(branch.noise[k]), other.row, carried);
            let from_both = sum(from_motion, row, other.kept);
            let own = with.scale_add(branch.decays[k], from_both);
            *with = pull.mul_add(others_strain, other.pull.mul_add(strain, own));
        }
        let part = &mut parts.branches[i];
        let noise = gain.mul_add(gain.scale(branch.noise[i]), gain.with(branch.variance));
        let from_motion = sum(noise, row, [carried[0] + kept[0], carried[1] + kept[1]]);
        let own = part.variance.scale_add(branch.decays[i], from_motion);
        part.variance = pull.mul_add(strain + with_strain, own);
        part.mean = part.mean.scale_add(branch.decay, change);
        part.with_strain = with_strain;
        part.with_rate = pull.mul_add(parts.strain_rate, rate);
    }
}

/// Predicts the baseline's covariances from its old ones.
#[inline(always)]
fn predict_baseline<V: Lanes, const B: usize>(
    step: &StepConstants<V::Number, B>,
    part: &mut Part<V, B>,
    driven: &[Driven<V>; B],
    [a, b]: [[V; 2]; 2],
) {
    let decay = step.baseline_decay;
    let kept = [part.with_strain.scale(decay), part.with_rate.scale(decay)];
    part.with_strain = dot(kept, a);
    part.with_rate = dot(kept, b);
    for i in 0..B {
        let Driven { pull, row, .. } = driven[i];
        let own = part.with[i].scale_add(step.baseline_decays[i], dot(row, kept));
        part.with[i] = pull.mul_add(part.with_strain, own);
    }
    part.mean = part.mean.scale(decay);
    part.variance = part.variance.scale_add(step.baseline_square, part.mean.with(step.baseline_variance));
}
