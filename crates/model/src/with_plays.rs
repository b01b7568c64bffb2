use nalgebra::SVector;

use crate::error::ParameterError;
use crate::{Direction, Observation, Phase, Play, Scalar, SwitchedModel, SwitchedStep, Symmetric, Transition};

/// A [`SwitchedModel`] with `P` plays: its state goes on with their lags, `x = [ε, v, (a), c₁ … c_B, (b), u₁ … u_P]`,
/// and `N = N0 + P`, which does not compile otherwise.
///
/// A play's lag behind the strain, u = p - ε, is all that it remembers, so the memory of a play is a part of the state
/// like any other. It moves by `u' = clamp(u - (ε' - ε), -r, r)`. The clamp is linearised over the Gaussian that it acts
/// on, process noise of the strain included; what that leaves unexplained is process noise of the lag. In a hold nothing
/// moves.
///
/// The lag is kept and not the play itself because p and ε are nearly the same number: while the play is dragged their
/// difference is known exactly, and a covariance of both would have lost that in `f32`.
///
/// ```
/// use ohmstrain_model::*;
/// # let law = SensorLaw {
/// #     gauge: Gauge::Polynomial { coefficients: [1.9, -2.8, 0.0] },
/// #     extend_viscosity_s: 0.02, retract_viscosity_s: -0.01, branches: [],
/// #     range: StrainRange { lower: 0.0, upper: 0.33 },
/// # };
/// # let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1)?;
/// # let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
/// let inner = SwitchedModel::<f64, 2, 0, 3>::new(law, motion, noise)?;
/// let model = WithPlays::<f64, 2, 0, 3, 1, 4>::new(inner, [Play { half_width: 0.02, weight: 0.5 }])?;
/// // Everything is known exactly, and the strain rises by more than the slack.
/// let state = nalgebra::vector![0.1, 0.5, 0.0, 0.0];
/// let step = model.inner().prepare(0.1);
/// let next: Transition<f64, 4, 10> =
///     model.transition(&step, &state, &Symmetric::zeros(), Direction::Known(Phase::Extend));
/// assert!(next.mean[3] < 0.0);
/// # Ok::<(), ParameterError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WithPlays<T, const M: usize, const B: usize, const N0: usize, const P: usize, const N: usize> {
    inner: SwitchedModel<T, M, B, N0>,
    plays: [Play<T>; P],
}

impl<T: Scalar, const M: usize, const B: usize, const N0: usize, const P: usize, const N: usize>
    WithPlays<T, M, B, N0, P, N>
{
    const SIZES_FIT: () = assert!(N == N0 + P, "N must be N0 + P");

    /// Adds plays to a model.
    ///
    /// # Errors
    /// Names the parameter that no play can have.
    pub fn new(inner: SwitchedModel<T, M, B, N0>, plays: [Play<T>; P]) -> Result<Self, ParameterError> {
        let () = Self::SIZES_FIT;
        plays.iter().try_for_each(Play::validate)?;
        Ok(Self { inner, plays })
    }

    /// The model without plays. It prepares the steps.
    #[must_use]
    pub const fn inner(&self) -> &SwitchedModel<T, M, B, N0> {
        &self.inner
    }

    /// The plays.
    #[must_use]
    pub const fn plays(&self) -> &[Play<T>; P] {
        &self.plays
    }

    /// Mean and variances before any reading: those of the model inside, and lags anywhere in their loops. On average
    /// they do not lag, which is also where calibration starts them.
    #[must_use]
    pub fn initial_distribution(&self) -> (SVector<T, N>, [T; N]) {
        let (inner_mean, inner_variance) = self.inner.initial_distribution();
        let (mut mean, mut variance) = (SVector::zeros(), [T::zero(); N]);
        for i in 0..N0 {
            mean[i] = inner_mean[i];
            variance[i] = inner_variance[i];
        }
        for (variance, play) in variance[N0..].iter_mut().zip(&self.plays) {
            *variance = play.half_width * play.half_width / T::of(3.0);
        }
        (mean, variance)
    }

    /// The transition over a step that the model inside has prepared, from a state with its covariance.
    #[must_use]
    pub fn transition<const L: usize>(
        &self,
        step: &SwitchedStep<T, M, B>,
        state: &SVector<T, N>,
        covariance: &Symmetric<T, N, L>,
        direction: Direction<T>,
    ) -> Transition<T, N, L> {
        let mut out = self.inner.transition_in(step, state, direction);
        if direction == Direction::Known(Phase::Hold) {
            for u in N0..N {
                out.mean[u] = state[u];
                out.jacobian[(u, u)] = T::one();
            }
            return out;
        }
        // ε' - ε = Σ change[i] x[i] + constant + noise.
        let change = &step.response.motion_change[0];
        let strain_noise = out.noise[(0, 0)];
        let risen = out.mean[0] - state[0];
        for (u, play) in (N0..N).zip(&self.plays) {
            let mut variance = covariance[(u, u)] + strain_noise;
            for i in 0..M {
                variance -= T::of(2.0) * change[i] * covariance[(u, i)];
                for j in 0..M {
                    variance += change[i] * change[j] * covariance[(i, j)];
                }
            }
            let clamped = play.clamped(state[u] - risen, variance.max(T::zero()).sqrt());
            out.mean[u] = clamped.mean;
            out.jacobian[(u, u)] = clamped.slope;
            for i in 0..M {
                out.jacobian[(u, i)] = -clamped.slope * change[i];
            }
            // The noise of the strain and of what it moves, seen by the lag; lags before this one are among them.
            for i in 0..u {
                out.noise[(u, i)] = -clamped.slope * out.noise[(0, i)];
            }
            out.noise[(u, u)] = clamped.slope * clamped.slope * strain_noise + clamped.unexplained;
        }
        out
    }

    /// `F P Fᵀ + Q` of a transition of this model, without touching its zeros.
    #[must_use]
    pub fn propagate<const L: usize>(
        &self,
        covariance: &Symmetric<T, N, L>,
        transition: &Transition<T, N, L>,
    ) -> Symmetric<T, N, L> {
        SwitchedModel::<T, M, B, N0>::propagate_in(covariance, transition, |i| i < M + B || i >= N0)
    }

    /// The reading ρ = R/R₀ - 1 expected at `state`.
    #[must_use]
    pub fn observe(&self, state: &SVector<T, N>, direction: Direction<T>) -> Observation<T, N> {
        let inner = self.inner.observe(&SVector::from_fn(|i, _| state[i]), direction);
        let mut value = inner.value;
        let mut gradient = SVector::zeros();
        for i in 0..N0 {
            gradient[i] = inner.gradient[i];
        }
        for (u, play) in (N0..N).zip(&self.plays) {
            value += play.weight * state[u];
            gradient[u] = play.weight;
        }
        Observation { value, gradient, variance: inner.variance }
    }
}
