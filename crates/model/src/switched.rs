use nalgebra::{SMatrix, SVector};

use crate::error::{ParameterError, Problem};
use crate::motion::MOTION_STATES as M;
use crate::phase::Direction;
use crate::reversal::averaging;
use crate::{ModelNoise, Motion, Phase, Response, Scalar, SensorLaw, Symmetric};

/// The state after a time step, given the state before it: `x' = mean + jacobian · (x - x̂) + noise`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition<T, const N: usize, const L: usize> {
    /// Propagated mean, from the linearisation point x̂.
    pub mean: SVector<T, N>,
    /// ∂x'/∂x at x̂.
    pub jacobian: SMatrix<T, N, N>,
    /// Covariance Q of the process noise.
    pub noise: Symmetric<T, N, L>,
}

/// A scalar reading as a function of the state, at one state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation<T, const N: usize> {
    /// Expected reading.
    pub value: T,
    /// ∂(reading)/∂x.
    pub gradient: SVector<T, N>,
    /// Variance of the reading's own noise.
    pub variance: T,
}

/// The switched Kelvin-Voigt law as a state-space model with state `x = [ε, v, c₁ … c_B, (b)]`.
///
/// There are `B` branches, and a baseline if `N = B + 3` but not if `N = B + 2`. Any other `N` does not compile. `L` in
/// the methods is `N (N + 1) / 2`.
///
/// ```
/// use ohmstrain_model::*;
/// let law = SensorLaw {
///     gauge: Gauge::Polynomial { coefficients: [1.9, -2.8, 0.0] },
///     extend_viscosity_s: 0.02,
///     retract_viscosity_s: -0.01,
///     branches: [Branch {
///         tau_s: 20.0, extend_gain: 0.6, retract_gain: -0.4, extend_gain_slope: 0.0, retract_gain_slope: 0.0,
///     }],
///     range: StrainRange { lower: 0.0, upper: 0.33 },
/// };
/// let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1)?;
/// let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
/// let model = SwitchedModel::<f64, 1, 4>::new(law, motion, noise)?;
/// let step = model.prepare(0.01);
/// let state = nalgebra::vector![0.1, 0.05, 0.02, 0.0];
/// let next: Transition<f64, 4, 10> = model.transition(&step, &state, Direction::Known(Phase::Extend));
/// assert!(next.mean[0] > 0.1);
/// # Ok::<(), ParameterError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwitchedModel<T, const B: usize, const N: usize> {
    law: SensorLaw<T, B>,
    motion: Motion<T>,
    noise: ModelNoise<T>,
}

/// Constants of [`SwitchedModel::transition`] for one step length, computed once if the step is fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SwitchedStep<T, const B: usize> {
    pub(crate) response: Response<T, B>,
    branch_variance: [T; B],
    pub(crate) baseline_change: T,
    baseline_variance: T,
    /// Variance of the mean over the step of a term that follows the rate's sign, as a fraction of its variance at an
    /// instant.
    pub(crate) averaging: T,
}

impl<T: Scalar, const B: usize> SwitchedStep<T, B> {
    /// Length of the step, s.
    #[must_use]
    pub fn dt_s(&self) -> T {
        self.response.dt_s
    }

    /// Response of the motion and of branches of unit gain.
    #[must_use]
    pub const fn response(&self) -> &Response<T, B> {
        &self.response
    }

    /// Variance that each branch gains around its law over the step, (R/R₀)².
    #[must_use]
    pub const fn branch_variance(&self) -> &[T; B] {
        &self.branch_variance
    }

    /// `exp(-dt/T_b) - 1` of the baseline.
    #[must_use]
    pub fn baseline_change(&self) -> T {
        self.baseline_change
    }

    /// Variance of the mean over the step of a term that follows the rate's sign, as a fraction of its variance at an
    /// instant.
    #[must_use]
    pub fn averaging(&self) -> T {
        self.averaging
    }

    /// Variance that the baseline gains over the step, (R/R₀)².
    #[must_use]
    pub fn baseline_variance(&self) -> T {
        self.baseline_variance
    }
}

impl<T: Scalar, const B: usize, const N: usize> SwitchedModel<T, B, N> {
    const SIZES_FIT: () = assert!(N == M + B || N == M + B + 1, "N must be B + 2 or B + 3");

    pub(crate) const HAS_BASELINE: bool = N == M + B + 1;

    /// Combines law, motion and noise.
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn new(law: SensorLaw<T, B>, motion: Motion<T>, noise: ModelNoise<T>) -> Result<Self, ParameterError> {
        let () = Self::SIZES_FIT;
        law.validate()?;
        noise.validate()?;
        if !Self::HAS_BASELINE && !noise.baseline_sd.is_zero() {
            return Err(ParameterError::new("baseline_sd", Problem::OutOfRange));
        }
        Ok(Self { law, motion, noise })
    }

    /// The sensor's law.
    #[must_use]
    pub const fn law(&self) -> &SensorLaw<T, B> {
        &self.law
    }

    /// The motion prior.
    #[must_use]
    pub const fn motion(&self) -> &Motion<T> {
        &self.motion
    }

    /// Noise: the part of the reading that the law does not explain.
    #[must_use]
    pub const fn noise(&self) -> &ModelNoise<T> {
        &self.noise
    }

    /// Returns mean and variances before any reading: motion and baseline in their stationary distributions, branches
    /// relaxed on average. An infinite variance of strain is replaced by the squared span of the law's range.
    #[must_use]
    pub fn initial_distribution(&self) -> (SVector<T, N>, [T; N]) {
        let (mut mean, mut variance) = (SVector::zeros(), [T::zero(); N]);
        mean[0] = self.motion.rest_strain();
        variance[..M].copy_from_slice(self.motion.stationary_variance());
        if !variance[0].is_finite() {
            variance[0] = self.law.range.span() * self.law.range.span();
        }
        for spread in &mut variance[M..M + B] {
            *spread = self.noise.branch_sd * self.noise.branch_sd;
        }
        if Self::HAS_BASELINE {
            variance[N - 1] = self.noise.baseline_sd * self.noise.baseline_sd;
        }
        (mean, variance)
    }

    /// Prepares a step of `dt_s ≥ 0` seconds: the constants that do not depend on the state.
    #[must_use]
    pub fn prepare(&self, dt_s: T) -> SwitchedStep<T, B> {
        let growth = |sd: T, time_s: T| -(T::of(-2.0) * dt_s / time_s).exp_m1() * sd * sd;
        SwitchedStep {
            response: Response::new(&self.motion, &self.law.branches, dt_s),
            branch_variance: self.law.branches.map(|branch| growth(self.noise.branch_sd, branch.tau_s)),
            baseline_change: (-dt_s / self.noise.baseline_time_s).exp_m1(),
            baseline_variance: growth(self.noise.baseline_sd, self.noise.baseline_time_s),
            averaging: averaging(&self.motion, dt_s),
        }
    }

    /// Returns the transition over a prepared step from `state`, linearised there.
    ///
    /// It is exact if the phase is given and the gains are constant. Gains affine in strain are taken at mid-strain,
    /// and the uncertainty of that strain goes into `jacobian` and `noise`.
    #[must_use]
    pub fn transition<const L: usize>(
        &self,
        step: &SwitchedStep<T, B>,
        state: &SVector<T, N>,
        direction: Direction<T>,
    ) -> Transition<T, N, L> {
        let mut out = Transition { mean: SVector::zeros(), jacobian: SMatrix::zeros(), noise: Symmetric::zeros() };
        if direction == Direction::Known(Phase::Hold) {
            out.mean[0] = state[0];
            out.jacobian[(0, 0)] = T::one();
            self.relax(step, state, &mut out);
        } else {
            self.move_body(step, state, direction, &mut out);
            self.relax(step, state, &mut out);
            self.drive_branches(step, state, direction, &mut out);
        }
        out
    }

    /// Returns `F P Fᵀ + Q` of a transition of this model, skipping the zeros of F: motion depends on itself, a branch
    /// on the motion and itself, the baseline on itself.
    #[inline]
    #[must_use]
    pub fn propagate<const L: usize>(
        &self,
        covariance: &Symmetric<T, N, L>,
        transition: &Transition<T, N, L>,
    ) -> Symmetric<T, N, L> {
        let jacobian = &transition.jacobian;
        // The full P: reading a row then needs no test for the triangle of an entry.
        let mut whole = [[T::zero(); N]; N];
        let mut entries = covariance.packed().iter();
        for i in 0..N {
            for j in 0..=i {
                if let Some(entry) = entries.next() {
                    whole[i][j] = *entry;
                    whole[j][i] = *entry;
                }
            }
        }
        let mut out = transition.noise;
        for i in 0..N {
            let mut row = if i < M { [T::zero(); N] } else { whole[i].map(|entry| jacobian[(i, i)] * entry) };
            if i < M + B {
                for l in 0..M {
                    let factor = jacobian[(i, l)];
                    for k in 0..N {
                        row[k] += factor * whole[l][k];
                    }
                }
            }
            for j in 0..=i {
                out[(i, j)] += Self::sparse_dot(j, |k| jacobian[(j, k)], |k| row[k]);
            }
        }
        out
    }

    /// Returns row `i` of the Jacobian times a column, using only the entries that can differ from zero.
    #[inline]
    fn sparse_dot(i: usize, row: impl Fn(usize) -> T, column: impl Fn(usize) -> T) -> T {
        let mut sum = if i < M { T::zero() } else { row(i) * column(i) };
        if i < M + B {
            for k in 0..M {
                sum += row(k) * column(k);
            }
        }
        sum
    }

    /// Returns the reading ρ = R/R₀ - 1 expected at `state`.
    #[must_use]
    pub fn observe(&self, state: &SVector<T, N>, direction: Direction<T>) -> Observation<T, N> {
        let (gauge, slope) = self.law.gauge_value_and_slope(state[0]);
        let rate = direction.split(state[1]);
        let viscosities = (self.law.extend_viscosity_s, self.law.retract_viscosity_s);
        let mut value = gauge + rate.drive(viscosities.0, viscosities.1);
        let mut gradient = SVector::zeros();
        gradient[0] = slope;
        gradient[1] = rate.slope(viscosities.0, viscosities.1);
        for i in M..N {
            value += state[i];
            gradient[i] = T::one();
        }
        let jump = viscosities.0 - viscosities.1;
        let variance = self.noise.reading_sd * self.noise.reading_sd + jump * jump * rate.variance;
        Observation { value, gradient, variance }
    }

    /// Propagates strain and rate, which are linear whatever the gains.
    fn move_body<const L: usize>(
        &self,
        step: &SwitchedStep<T, B>,
        state: &SVector<T, N>,
        direction: Direction<T>,
        out: &mut Transition<T, N, L>,
    ) {
        let push = self.push(direction);
        for i in 0..M {
            let mut change = step.response.input[i] * push;
            for j in 0..M {
                change += step.response.motion_change[i][j] * state[j];
                out.jacobian[(i, j)] = step.response.motion_change[i][j];
            }
            out.mean[i] = state[i] + change;
            out.jacobian[(i, i)] += T::one();
            for j in 0..=i {
                out.noise[(i, j)] = step.response.motion_noise[i][j];
            }
        }
    }

    /// Returns the constant push on the rate, toward the mean strain and the phase's mean rate.
    pub(crate) fn push(&self, direction: Direction<T>) -> T {
        let toward_strain = self.motion.restoring()[0] * self.motion.rest_strain();
        let toward_rate = match direction {
            Direction::Known(Phase::Extend) | Direction::Within { phase: Phase::Extend, .. } => {
                self.motion.phase_rate()
            }
            Direction::Known(Phase::Retract) | Direction::Within { phase: Phase::Retract, .. } => {
                -self.motion.phase_rate()
            }
            _ => T::zero(),
        };
        toward_strain + self.motion.restoring()[1] * toward_rate
    }

    /// Adds the decay of branches and baseline, and their random wander.
    fn relax<const L: usize>(&self, step: &SwitchedStep<T, B>, state: &SVector<T, N>, out: &mut Transition<T, N, L>) {
        for i in 0..B {
            let (c, change) = (M + i, step.response.decay_change[i]);
            out.mean[c] = state[c] + change * state[c];
            out.jacobian[(c, c)] = T::one() + change;
            out.noise[(c, c)] = step.branch_variance[i];
        }
        if Self::HAS_BASELINE {
            let b = M + B;
            out.mean[b] = state[b] + step.baseline_change * state[b];
            out.jacobian[(b, b)] = T::one() + step.baseline_change;
            out.noise[(b, b)] = step.baseline_variance;
        }
    }

    /// Returns the variance of the rate at the end of a step, from the covariance at its start.
    #[must_use]
    pub fn rate_variance<const L: usize>(&self, step: &SwitchedStep<T, B>, covariance: &Symmetric<T, N, L>) -> T {
        let mut row = step.response.motion_change[1];
        row[1] += T::one();
        let mut variance = step.response.motion_noise[1][1];
        for i in 0..M {
            for j in 0..M {
                variance += row[i] * row[j] * covariance[(i, j)];
            }
        }
        variance.max(T::zero())
    }
}
