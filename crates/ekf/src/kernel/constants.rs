use ohmstrain_model::{Branch, Response, Scalar, SensorLaw, StrainRange, SwitchedModel};

use super::{Lanes, Regions};

/// Constants of all steps of one length: everything a step needs besides the belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StepConstants<T, const B: usize> {
    /// Transition of the motion.
    pub motion: [[T; 2]; 2],
    /// Coefficients of the rate's new variance: factors of the old variance of strain, the old covariance, and the old
    /// variance of rate.
    pub rate_squares: [T; 3],
    /// Contribution of the pull toward the mean strain.
    pub input: [T; 2],
    /// Contribution of a moving phase's mean rate while stretching.
    pub phase_input: [T; 2],
    /// Covariances of ε with ε, v with ε, v with v.
    pub noise: [T; 3],
    /// Change of the rate with old strain and rate.
    pub rate_change: [T; 2],
    /// See [`SwitchedStep::averaging`](ohmstrain_model::SwitchedStep::averaging).
    pub averaging: T,
    pub branches: [BranchConstants<T, B>; B],
    pub baseline_decay: T,
    /// Products with the branches' decays; `baseline_square` is the product with itself.
    pub baseline_decays: [T; B],
    pub baseline_square: T,
    pub baseline_variance: T,
}

/// A branch over one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BranchConstants<T, const B: usize> {
    pub decay: T,
    /// Products with the decays of all branches.
    pub decays: [T; B],
    /// Response to ε and v; then to the pull toward the mean strain, and to a phase's mean rate.
    pub drive: [T; 2],
    pub input: T,
    pub phase_input: T,
    /// Effective time over which a rate acts, s, and its inverse.
    pub reach: T,
    pub per_reach: T,
    /// The drive's direction is certain if its square is at least this times the rate's variance.
    pub clear: T,
    pub cross_noise: [T; 2],
    /// Covariances with the branches up to this one.
    pub noise: [T; B],
    pub variance: T,
}

impl<T: Scalar, const B: usize> StepConstants<T, B> {
    /// Computes the constants of steps of `dt_s > 0` seconds; a rate's direction is certain if its square is at least `clear`
    /// variances.
    pub(crate) fn new<const N: usize>(model: &SwitchedModel<T, B, N>, dt_s: T, clear: T) -> Self {
        let step = model.prepare(dt_s);
        let response: &Response<T, B> = step.response();
        let motion = model.motion();
        let push = motion.restoring()[0] * motion.rest_strain();
        let phase_push = motion.restoring()[1] * motion.phase_rate();
        let change = &response.motion_change;
        let motion = [[T::one() + change[0][0], change[0][1]], [change[1][0], T::one() + change[1][1]]];
        let [_, b] = motion;
        let decay = |i: usize| T::one() + response.decay_change[i];
        let baseline_decay = T::one() + step.baseline_change();
        let branch = |i: usize| {
            let reach = -response.decay_change[i] * model.law().branches[i].tau_s;
            BranchConstants {
                decay: decay(i),
                decays: core::array::from_fn(|k| decay(i) * decay(k)),
                drive: response.drive[i],
                input: response.drive_input[i] * push,
                phase_input: response.drive_input[i] * phase_push,
                reach,
                per_reach: T::one() / reach,
                clear: clear * reach * reach,
                cross_noise: response.cross_noise[i],
                noise: response.branch_noise[i],
                variance: step.branch_variance()[i],
            }
        };
        Self {
            motion,
            rate_squares: [b[0] * b[0], T::of(2.0) * b[0] * b[1], b[1] * b[1]],
            input: response.input.map(|answer| answer * push),
            phase_input: response.input.map(|answer| answer * phase_push),
            noise: [response.motion_noise[0][0], response.motion_noise[1][0], response.motion_noise[1][1]],
            rate_change: change[1],
            averaging: step.averaging(),
            branches: core::array::from_fn(branch),
            baseline_decay,
            baseline_decays: core::array::from_fn(|i| baseline_decay * decay(i)),
            baseline_square: baseline_decay * baseline_decay,
            baseline_variance: step.baseline_variance(),
        }
    }
}

#[cfg(feature = "record")]
impl<T, const B: usize> StepConstants<T, B> {
    /// Visits every number with its name, those of branches as `name.number`, always in the same order. Covariances of
    /// branches with later ones are unused and not visited.
    pub(crate) fn visit(&mut self, visit: &mut impl FnMut(&'static str, usize, &mut T)) {
        let mut all = |name, numbers: &mut [T]| {
            for (i, number) in numbers.iter_mut().enumerate() {
                visit(name, i, number);
            }
        };
        let [to_strain, to_rate] = &mut self.motion;
        all("to_strain", to_strain);
        all("to_rate", to_rate);
        all("rate_squares", &mut self.rate_squares);
        all("input", &mut self.input);
        all("phase_input", &mut self.phase_input);
        all("noise", &mut self.noise);
        all("rate_change", &mut self.rate_change);
        all("averaging", core::slice::from_mut(&mut self.averaging));
        all("baseline_decay", core::slice::from_mut(&mut self.baseline_decay));
        all("baseline_decays", &mut self.baseline_decays);
        all("baseline_square", core::slice::from_mut(&mut self.baseline_square));
        all("baseline_variance", core::slice::from_mut(&mut self.baseline_variance));
        for branch in &mut self.branches {
            all("decay", core::slice::from_mut(&mut branch.decay));
            all("decays", &mut branch.decays);
            all("drive", &mut branch.drive);
            all("branch_input", core::slice::from_mut(&mut branch.input));
            all("branch_phase_input", core::slice::from_mut(&mut branch.phase_input));
            all("reach", core::slice::from_mut(&mut branch.reach));
            all("per_reach", core::slice::from_mut(&mut branch.per_reach));
            all("clear", core::slice::from_mut(&mut branch.clear));
            all("cross_noise", &mut branch.cross_noise);
            all("branch_noise", &mut branch.noise);
            all("variance", core::slice::from_mut(&mut branch.variance));
        }
    }
}

/// The gains of all branches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gains<T> {
    pub extend: Gain<T>,
    pub retract: Gain<T>,
}

/// A gain as a function of the sum of old and new strain: twice the mid-step strain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gain<T> {
    pub at_zero: T,
    pub growth: T,
}

impl<V: Lanes> Gain<V> {
    #[inline(always)]
    pub(crate) fn at(&self, strain_sum: V) -> V {
        strain_sum.mul_add(self.growth, self.at_zero)
    }
}

impl<T: Scalar> Gain<T> {
    #[inline(always)]
    fn in_lanes<V: Lanes<Number = T>>(&self, like: V) -> Gain<V> {
        Gain { at_zero: like.with(self.at_zero), growth: like.with(self.growth) }
    }
}

/// Gains of a branch at a sum of strains, computed lazily.
#[derive(Clone, Copy)]
pub(super) struct GainsAt<'a, V: Lanes, const B: usize> {
    regions: &'a Regions<V::Number, [Gains<V::Number>; B]>,
    /// Gains of all lanes, if they are in one region.
    common: Option<&'a [Gains<V::Number>; B]>,
    pub strain_sum: V,
    i: usize,
}

impl<T: Scalar, const B: usize> Regions<T, [Gains<T>; B]> {
    /// Returns the gains of the first branch; see [`GainsAt::of`].
    #[inline(always)]
    pub(super) fn gains<V: Lanes<Number = T>>(&self, strain_sum: V) -> GainsAt<'_, V, B> {
        GainsAt { regions: self, common: self.common(strain_sum), strain_sum, i: 0 }
    }
}

impl<V: Lanes, const B: usize> GainsAt<'_, V, B> {
    /// Returns the gains of another branch.
    #[inline(always)]
    pub(super) fn of(self, i: usize) -> Self {
        Self { i, ..self }
    }

    #[inline(always)]
    pub(super) fn extend(&self) -> Gain<V> {
        self.gain(|gains| &gains.extend)
    }

    #[inline(always)]
    pub(super) fn retract(&self) -> Gain<V> {
        self.gain(|gains| &gains.retract)
    }

    /// Returns the gain for the direction in each lane.
    #[inline(always)]
    pub(super) fn toward(&self, extends: V::Mask) -> Gain<V> {
        if let Some(row) = self.common
            && let Some(gain) = V::one_of(extends, &row[self.i].extend, &row[self.i].retract)
        {
            return gain.in_lanes(self.strain_sum);
        }
        let (extend, retract) = (self.extend(), self.retract());
        Gain {
            at_zero: V::pick(extends, extend.at_zero, retract.at_zero),
            growth: V::pick(extends, extend.growth, retract.growth),
        }
    }

    #[inline(always)]
    fn gain(&self, of: impl Fn(&Gains<V::Number>) -> &Gain<V::Number>) -> Gain<V> {
        if let Some(row) = self.common {
            return of(&row[self.i]).in_lanes(self.strain_sum);
        }
        let regions = self.regions;
        let [below, within, above] =
            [of(&regions.below[self.i]), of(&regions.within[self.i]), of(&regions.above[self.i])];
        Gain {
            at_zero: regions.chosen(self.strain_sum, [below.at_zero, within.at_zero, above.at_zero]),
            growth: regions.chosen(self.strain_sum, [below.growth, within.growth, above.growth]),
        }
    }
}

impl<T: Scalar> Gains<T> {
    /// Returns the gains within the range, where they are affine in strain, and beyond its ends, where they keep their
    /// border values.
    pub(crate) fn by_region<const B: usize>(law: &SensorLaw<T, B>) -> Regions<T, [Self; B]> {
        let StrainRange { lower, upper } = law.range;
        let beyond = |border: T| law.branches.map(|branch| Self::of(&branch, Some(border)));
        let within = law.branches.map(|branch| Self::of(&branch, None));
        let sums = StrainRange { lower: lower + lower, upper: upper + upper };
        Regions::new(&sums, beyond(lower), within, beyond(upper))
    }

    fn of(branch: &Branch<T>, border: Option<T>) -> Self {
        let gain = |at_zero: T, growth: T| match border {
            None => Gain { at_zero, growth: T::of(0.5) * growth },
            Some(border) => Gain { at_zero: at_zero + growth * border, growth: T::zero() },
        };
        Self {
            extend: gain(branch.extend_gain, branch.extend_gain_slope),
            retract: gain(branch.retract_gain, branch.retract_gain_slope),
        }
    }
}
