use ohmstrain_model::{Phase, Scalar, SwitchedModel};

use crate::sparse_gaussian::Working;
use crate::{Gaussian, Reading, Residual, StepError};

/// One step of the sensor's model in a given phase: what the modes of the sparse mixtures are led through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct KnownStep<T, const B: usize, const N: usize> {
    model: SwitchedModel<T, 2, B, N>,
    /// Transition of the motion, and what the pull toward mean strain and mean rate adds, by phase.
    motion: [[T; 2]; 2],
    motion_input: [[T; 2]; 3],
    /// Covariances of ε with ε, v with ε, v with v.
    motion_noise: [T; 3],
    branches: [BranchStep<T, B>; B],
    baseline_decay: T,
    baseline_variance: T,
    reading_variance: T,
    viscosity_s: [T; 3],
}

/// A branch over one step.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BranchStep<T, const B: usize> {
    decay: T,
    drive: [T; 2],
    drive_input: [T; 3],
    cross_noise: [T; 2],
    branch_noise: [T; B],
    variance: T,
    /// Gain at zero strain and its growth, by phase.
    gain: [[T; 2]; 3],
}

/// With which gain a branch was driven, how the gain's growth pulls it, and its row of the Jacobian.
#[derive(Clone, Copy)]
struct Driven<T> {
    gain: T,
    pull: T,
    row: [T; 2],
}

impl<T: Scalar, const B: usize, const N: usize> KnownStep<T, B, N> {
    const HAS_BASELINE: bool = N == B + 3;

    pub(crate) fn new(model: SwitchedModel<T, 2, B, N>, dt_s: T) -> Result<Self, StepError> {
        crate::ekf::check_time_step(dt_s)?;
        if dt_s.is_zero() {
            return Err(StepError::NegativeTimeStep);
        }
        let step = model.prepare(dt_s);
        let response = step.response();
        let motion = model.motion();
        let push = Phase::ALL.map(|phase| {
            let toward_rate = match phase {
                Phase::Extend => motion.phase_rate(),
                Phase::Hold => T::zero(),
                Phase::Retract => -motion.phase_rate(),
            };
            motion.restoring()[0] * motion.rest_strain() + motion.restoring()[1] * toward_rate
        });
        let change = &response.motion_change;
        let branch = |i: usize| {
            let law = &model.law().branches[i];
            let zero = T::zero();
            BranchStep {
                decay: T::one() + response.decay_change[i],
                drive: response.drive[i],
                drive_input: push.map(|push| response.drive_input[i] * push),
                cross_noise: response.cross_noise[i],
                branch_noise: response.branch_noise[i],
                variance: step.branch_variance()[i],
                gain: [
                    [law.extend_gain, law.extend_gain_slope],
                    [zero, zero],
                    [law.retract_gain, law.retract_gain_slope],
                ],
            }
        };
        Ok(Self {
            motion: [[T::one() + change[0][0], change[0][1]], [change[1][0], T::one() + change[1][1]]],
            motion_input: push.map(|push| response.input.map(|answer| answer * push)),
            motion_noise: [response.motion_noise[0][0], response.motion_noise[1][0], response.motion_noise[1][1]],
            branches: core::array::from_fn(branch),
            baseline_decay: T::one() + step.baseline_change(),
            baseline_variance: step.baseline_variance(),
            reading_variance: model.noise().reading_sd * model.noise().reading_sd,
            viscosity_s: Phase::ALL.map(|phase| model.law().viscosity_s(phase)),
            model,
        })
    }

    pub(crate) const fn model(&self) -> &SwitchedModel<T, 2, B, N> {
        &self.model
    }

    /// The rate after a step in a moving phase.
    #[inline(always)]
    pub(crate) fn rate_ahead(&self, phase: Phase, from: &Working<T, N>) -> Gaussian<T> {
        let (b, p) = (&self.motion[1], &from.p);
        let mean = b[0] * from.x[0] + b[1] * from.x[1] + self.motion_input[phase.index()][1];
        let spread = [b[0] * p[0][0] + b[1] * p[1][0], b[0] * p[1][0] + b[1] * p[1][1]];
        Gaussian { mean, variance: spread[0] * b[0] + spread[1] * b[1] + self.motion_noise[2] }
    }

    #[inline(always)]
    pub(crate) fn predict(&self, phase: Phase, state: &mut Working<T, N>) {
        if phase == Phase::Hold {
            self.hold(state);
        } else {
            self.move_on(phase, state);
        }
    }

    /// A hold: the strain stays, the rate is zero, branches and baseline relax.
    #[inline(always)]
    fn hold(&self, Working { x, p }: &mut Working<T, N>) {
        x[1] = T::zero();
        p[1] = [T::zero(); N];
        for i in 2..N {
            let (decay, variance) = self.relaxing(i);
            x[i] *= decay;
            p[i][0] *= decay;
            p[i][1] = T::zero();
            for k in 2..=i {
                p[i][k] *= decay * self.relaxing(k).0;
            }
            p[i][i] += variance;
        }
    }

    /// Decay and variance of a branch, or of the baseline.
    #[inline(always)]
    fn relaxing(&self, i: usize) -> (T, T) {
        match self.branches.get(i - 2) {
            Some(branch) => (branch.decay, branch.variance),
            None => (self.baseline_decay, self.baseline_variance),
        }
    }

    #[inline(always)]
    fn move_on(&self, phase: Phase, Working { x, p }: &mut Working<T, N>) {
        let [a, b] = self.motion;
        let input = &self.motion_input[phase.index()];
        let (strain, rate) = (x[0], x[1]);
        x[0] = a[0] * strain + a[1] * rate + input[0];
        x[1] = b[0] * strain + b[1] * rate + input[1];
        let from_strain = [a[0] * p[0][0] + a[1] * p[1][0], a[0] * p[1][0] + a[1] * p[1][1]];
        let from_rate = [b[0] * p[0][0] + b[1] * p[1][0], b[0] * p[1][0] + b[1] * p[1][1]];

        let mid_strain = T::of(0.5) * (strain + x[0]);
        let range = &self.model.law().range;
        let (at, inside) = if mid_strain < range.lower {
            (range.lower, T::zero())
        } else if mid_strain > range.upper {
            (range.upper, T::zero())
        } else {
            (mid_strain, T::of(0.5))
        };
        let driven: [Driven<T>; B] = core::array::from_fn(|i| {
            let branch = &self.branches[i];
            let unit_drive = branch.drive[0] * strain + branch.drive[1] * rate + branch.drive_input[phase.index()];
            let [gain, growth] = branch.gain[phase.index()];
            let gain = gain + growth * at;
            let pull = inside * growth * unit_drive;
            x[2 + i] = branch.decay * x[2 + i] + gain * unit_drive;
            let row = [gain * branch.drive[0] + pull * a[0] + pull, gain * branch.drive[1] + pull * a[1]];
            Driven { gain, pull, row }
        });

        self.predict_baseline(x, p, &driven);
        self.predict_branches(p, &driven);
        p[0][0] = from_strain[0] * a[0] + from_strain[1] * a[1] + self.motion_noise[0];
        p[1][0] = from_rate[0] * a[0] + from_rate[1] * a[1] + self.motion_noise[1];
        p[1][1] = from_rate[0] * b[0] + from_rate[1] * b[1] + self.motion_noise[2];
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
    pub(crate) fn update(
        &self,
        phase: Phase,
        Working { x, p }: &mut Working<T, N>,
        reading: Reading<T>,
    ) -> Result<Residual<T>, StepError> {
        let (gauge, slope) = self.model.law().gauge_value_and_slope(x[0]);
        let viscosity = self.viscosity_s[phase.index()];
        let mut expected = gauge + viscosity * x[1];
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
            return Err(refusal(reading, innovation));
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
}

/// Why a reading was not taken.
#[cold]
fn refusal<T: Scalar>(reading: Reading<T>, innovation: T) -> StepError {
    if !(reading.value.is_finite() && reading.extra_variance.is_finite()) {
        StepError::NonFiniteReading
    } else if innovation.is_finite() {
        StepError::NonPositiveInnovationVariance
    } else {
        StepError::NonFiniteState
    }
}
