//! The EKF of the sensor's own model at a fixed rate, without a multiplication by zero.
//!
//! Branches and baseline never touch each other in F, and a reading contains each of them with factor one. What depends on
//! the step's length only is folded into constants beforehand. The variance of the rate after the step, which the choice of
//! direction needs, is the one that the prediction computes anyway.
//!
//! # Policy
//! As [`Ekf`](crate::Ekf), with two differences, both for microcontrollers: the belief is changed in place (an error leaves
//! it as it was), and the covariance is updated as `P - (P Hᵀ)(P Hᵀ)ᵀ/S`, without Joseph's form; a variance that rounding
//! has made negative is an error. Only innovation and its variance are returned; nothing takes a logarithm unless asked.

use core::marker::PhantomData;

use ohmstrain_model::{Phase, Scalar, StrainRange, SwitchedModel, Symmetric};

use crate::switch::{Splitter, Switch};
use crate::{Belief, Reading, Residual, StepError};

/// The EKF of a [`SwitchedModel`] with Ornstein-Uhlenbeck motion, for steps of one length. `S` is [`Compact`](crate::Compact)
/// or, to agree with [`Ekf`](crate::Ekf) to rounding, [`Logistic`](crate::Logistic).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SparseEkf<T, S, const B: usize, const N: usize> {
    model: SwitchedModel<T, 2, B, N>,
    /// Transition of the motion, and what the pull toward the mean strain adds.
    motion: [[T; 2]; 2],
    motion_input: [T; 2],
    /// Covariances of ε with ε, v with ε, v with v.
    motion_noise: [T; 3],
    branches: [BranchStep<T, B>; B],
    baseline_decay: T,
    baseline_variance: T,
    reading_variance: T,
    switch: PhantomData<S>,
}

/// A branch over one step.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BranchStep<T, const B: usize> {
    decay: T,
    /// Answer to ε and v, and to the pull toward the mean strain.
    drive: [T; 2],
    drive_input: T,
    /// Time over which a rate acts, s, and its inverse.
    reach_s: T,
    per_reach: T,
    cross_noise: [T; 2],
    branch_noise: [T; B],
    variance: T,
    extend: [T; 2],
    retract: [T; 2],
}

/// What a step does to one branch, and with which gain it was driven.
#[derive(Clone, Copy)]
struct Driven<T> {
    gain: T,
    pull: T,
    row: [T; 2],
}

impl<T: Scalar, S: Switch<T>, const B: usize, const N: usize> SparseEkf<T, S, B, N> {
    const HAS_BASELINE: bool = N == B + 3;

    /// A filter for steps of `dt_s` seconds.
    ///
    /// # Errors
    /// If `dt_s` is not a positive number.
    pub fn new(model: SwitchedModel<T, 2, B, N>, dt_s: T) -> Result<Self, StepError> {
        crate::ekf::check_time_step(dt_s)?;
        if dt_s.is_zero() {
            return Err(StepError::NegativeTimeStep);
        }
        let step = model.prepare(dt_s);
        let response = step.response();
        let push = model.motion().restoring()[0] * model.motion().rest_strain();
        let change = &response.motion_change;
        let branch = |i: usize| {
            let law = &model.law().branches[i];
            let reach_s = -response.decay_change[i] * law.tau_s;
            BranchStep {
                decay: T::one() + response.decay_change[i],
                drive: response.drive[i],
                drive_input: response.drive_input[i] * push,
                reach_s,
                per_reach: T::one() / reach_s,
                cross_noise: response.cross_noise[i],
                branch_noise: response.branch_noise[i],
                variance: step.branch_variance()[i],
                extend: [law.extend_gain, law.extend_gain_slope],
                retract: [law.retract_gain, law.retract_gain_slope],
            }
        };
        Ok(Self {
            motion: [[T::one() + change[0][0], change[0][1]], [change[1][0], T::one() + change[1][1]]],
            motion_input: response.input.map(|answer| answer * push),
            motion_noise: [response.motion_noise[0][0], response.motion_noise[1][0], response.motion_noise[1][1]],
            branches: core::array::from_fn(branch),
            baseline_decay: T::one() + step.baseline_change(),
            baseline_variance: step.baseline_variance(),
            reading_variance: model.noise().reading_sd * model.noise().reading_sd,
            model,
            switch: PhantomData,
        })
    }

    /// The model.
    pub const fn model(&self) -> &SwitchedModel<T, 2, B, N> {
        &self.model
    }

    /// Predicts one step ahead and takes the reading; without one it is a prediction and returns `None`.
    ///
    /// # Errors
    /// See [`StepError`]; the belief is untouched.
    #[inline]
    pub fn step<const L: usize>(
        &self,
        belief: &mut Belief<T, N, L>,
        reading: Option<Reading<T>>,
    ) -> Result<Option<Residual<T>>, StepError> {
        let mut x: [T; N] = core::array::from_fn(|i| belief.mean[i]);
        let mut p = unpacked(&belief.covariance);
        self.predict(&mut x, &mut p);
        let residual = match reading {
            None => None,
            Some(reading) => Some(self.update(&mut x, &mut p, reading)?),
        };
        // Whatever is not finite makes this sum not finite, or a comparison false.
        let mut sum = T::zero();
        for i in 0..N {
            if !(p[i][i] >= T::zero()) {
                return Err(StepError::NonFiniteState);
            }
            sum += x[i] + p[i][i];
        }
        if !sum.is_finite() {
            return Err(StepError::NonFiniteState);
        }
        belief.mean = x.into();
        belief.covariance = packed(&p);
        Ok(residual)
    }

    #[inline(always)]
    fn predict(&self, x: &mut [T; N], p: &mut [[T; N]; N]) {
        let [a, b] = self.motion;
        let (strain, rate) = (x[0], x[1]);
        x[0] = a[0] * strain + a[1] * rate + self.motion_input[0];
        x[1] = b[0] * strain + b[1] * rate + self.motion_input[1];
        let from_strain = [a[0] * p[0][0] + a[1] * p[1][0], a[0] * p[1][0] + a[1] * p[1][1]];
        let from_rate = [b[0] * p[0][0] + b[1] * p[1][0], b[0] * p[1][0] + b[1] * p[1][1]];
        let rate_variance = from_rate[0] * b[0] + from_rate[1] * b[1] + self.motion_noise[2];

        let mid_strain = T::of(0.5) * (strain + x[0]);
        let mut splitter = Splitter::new(rate_variance);
        let driven: [Driven<T>; B] = core::array::from_fn(|i| {
            let branch = &self.branches[i];
            let unit_drive = branch.drive[0] * strain + branch.drive[1] * rate + branch.drive_input;
            let mut change = T::zero();
            let driven = self.drive(branch, mid_strain, unit_drive, &mut splitter, &mut change);
            x[2 + i] = branch.decay * x[2 + i] + change;
            driven
        });

        self.predict_baseline(x, p, &driven);
        self.predict_branches(p, &driven);
        p[0][0] = from_strain[0] * a[0] + from_strain[1] * a[1] + self.motion_noise[0];
        p[1][0] = from_rate[0] * a[0] + from_rate[1] * a[1] + self.motion_noise[1];
        p[1][1] = rate_variance;
    }

    /// Gain of a branch, how the gain's growth pulls it, and its row of the Jacobian.
    #[inline(always)]
    fn drive(
        &self,
        branch: &BranchStep<T, B>,
        mid_strain: T,
        unit_drive: T,
        splitter: &mut Splitter<T>,
        change: &mut T,
    ) -> Driven<T> {
        let range: &StrainRange<T> = &self.model.law().range;
        let split = splitter.split::<S>(unit_drive * branch.per_reach);
        let (at, inside) = (clamped(range, mid_strain), range.contains(mid_strain));
        let (extend, retract) = (branch.extend[0] + branch.extend[1] * at, branch.retract[0] + branch.retract[1] * at);
        let gain = split.slope(extend, retract);
        *change = branch.reach_s * split.drive(extend, retract);
        if !inside {
            return Driven { gain, pull: T::zero(), row: branch.drive.map(|answer| gain * answer) };
        }
        let pull = T::of(0.5) * branch.reach_s * split.drive(branch.extend[1], branch.retract[1]);
        let a = &self.motion[0];
        let row = [gain * branch.drive[0] + pull * a[0] + pull, gain * branch.drive[1] + pull * a[1]];
        Driven { gain, pull, row }
    }

    /// The baseline's row, from the others' old values.
    #[inline(always)]
    fn predict_baseline(&self, x: &mut [T; N], p: &mut [[T; N]; N], driven: &[Driven<T>; B]) {
        if !Self::HAS_BASELINE {
            return;
        }
        let (last, decay) = (N - 1, self.baseline_decay);
        let (with_strain, with_rate) = (decay * p[last][0], decay * p[last][1]);
        for i in 0..B {
            let row = &driven[i].row;
            p[last][2 + i] =
                row[0] * with_strain + row[1] * with_rate + decay * self.branches[i].decay * p[last][2 + i];
        }
        let [a, b] = self.motion;
        p[last][0] = a[0] * with_strain + a[1] * with_rate;
        p[last][1] = b[0] * with_strain + b[1] * with_rate;
        p[last][last] = decay * decay * p[last][last] + self.baseline_variance;
        x[last] *= decay;
    }

    /// The branches' rows, the last one first: each needs the old values of those before it and of the motion.
    #[inline(always)]
    fn predict_branches(&self, p: &mut [[T; N]; N], driven: &[Driven<T>; B]) {
        let [a, b] = self.motion;
        for i in (0..B).rev() {
            let (c, branch, Driven { gain, pull, row }) = (2 + i, &self.branches[i], driven[i]);
            let carried = [
                row[0] * p[0][0] + row[1] * p[1][0] + branch.decay * p[c][0],
                row[0] * p[1][0] + row[1] * p[1][1] + branch.decay * p[c][1],
            ];
            let cross = [
                gain * branch.cross_noise[0] + pull * self.motion_noise[0],
                gain * branch.cross_noise[1] + pull * self.motion_noise[1],
            ];
            for k in 0..=i {
                let (other, to) = (&self.branches[k], &driven[k]);
                let kept = row[0] * p[2 + k][0] + row[1] * p[2 + k][1] + branch.decay * p[c][2 + k];
                let noise =
                    to.pull * cross[0] + to.gain * (gain * branch.branch_noise[k] + pull * other.cross_noise[0]);
                p[c][2 + k] = carried[0] * to.row[0] + carried[1] * to.row[1] + other.decay * kept + noise;
            }
            p[c][c] += branch.variance;
            p[c][0] = carried[0] * a[0] + carried[1] * a[1] + cross[0];
            p[c][1] = carried[0] * b[0] + carried[1] * b[1] + cross[1];
        }
    }

    #[inline(always)]
    fn update(&self, x: &mut [T; N], p: &mut [[T; N]; N], reading: Reading<T>) -> Result<Residual<T>, StepError> {
        let law = self.model.law();
        let inside = clamped(&law.range, x[0]);
        let (gauge, slope) = law.gauge.value_and_slope(inside);
        let mut expected = gauge + slope * (x[0] - inside);
        let rate = Splitter::new(p[1][1]).split::<S>(x[1]);
        let (extend, retract) = (law.viscosity_s(Phase::Extend), law.viscosity_s(Phase::Retract));
        expected += rate.drive(extend, retract);
        let viscosity = rate.slope(extend, retract);
        for c in &x[2..] {
            expected += *c;
        }
        let spread: [T; N] = core::array::from_fn(|i| {
            let mut sum = slope * p[i][0] + viscosity * if i == 0 { p[1][0] } else { p[i][1] };
            for k in 2..N {
                sum += if k <= i { p[i][k] } else { p[k][i] };
            }
            sum
        });
        let mut variance = slope * spread[0] + viscosity * spread[1] + self.reading_variance + reading.extra_variance;
        for s in &spread[2..] {
            variance += *s;
        }
        let innovation = reading.value - expected;
        if !(variance > T::zero() && variance.is_finite() && innovation.is_finite()) {
            return Err(self.refusal(reading, innovation));
        }
        let per_variance = T::one() / variance;
        for i in 0..N {
            let gain = spread[i] * per_variance;
            x[i] += gain * innovation;
            for j in 0..=i {
                p[i][j] -= gain * spread[j];
            }
        }
        Ok(Residual { innovation, variance })
    }

    /// Why a reading was not taken.
    #[cold]
    fn refusal(&self, reading: Reading<T>, innovation: T) -> StepError {
        if !(reading.value.is_finite() && reading.extra_variance.is_finite()) {
            StepError::NonFiniteReading
        } else if innovation.is_finite() {
            StepError::NonPositiveInnovationVariance
        } else {
            StepError::NonFiniteState
        }
    }
}

/// [`StrainRange::clamp`] by comparisons, which cost less than calls of `fmax` and `fmin`.
#[inline(always)]
fn clamped<T: Scalar>(range: &StrainRange<T>, strain: T) -> T {
    if strain < range.lower {
        range.lower
    } else if strain > range.upper {
        range.upper
    } else {
        strain
    }
}

/// The lower triangle, addressed by rows of known length: indices in loops need no check at run time.
#[inline(always)]
fn unpacked<T: Scalar, const N: usize, const L: usize>(covariance: &Symmetric<T, N, L>) -> [[T; N]; N] {
    let mut out = [[T::zero(); N]; N];
    let mut entries = covariance.packed().iter();
    for i in 0..N {
        for j in 0..=i {
            if let Some(entry) = entries.next() {
                out[i][j] = *entry;
            }
        }
    }
    out
}

#[inline(always)]
fn packed<T: Scalar, const N: usize, const L: usize>(p: &[[T; N]; N]) -> Symmetric<T, N, L> {
    let mut out = [T::zero(); L];
    let mut entries = out.iter_mut();
    for i in 0..N {
        for j in 0..=i {
            if let Some(entry) = entries.next() {
                *entry = p[i][j];
            }
        }
    }
    Symmetric::from_packed(out)
}
