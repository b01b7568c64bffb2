use nalgebra::SVector;
use ohmstrain_model::{Observation, Phase, Scalar, Symmetric, Transition};

use crate::belief::psd::SemiDefinite;
use crate::{Belief, Channel, Dynamics, Ekf};

/// Unscented Kalman filter: the prediction is linear given the phase, the reading goes through sigma points.
///
/// ```
/// # use ohmstrain_ekf::{Belief, Ukf, Unscented, Reading};
/// # use ohmstrain_model::*;
/// # let law = SensorLaw {
/// #     gauge: Gauge::Polynomial { coefficients: [1.9, -2.8, 0.0] },
/// #     extend_viscosity_s: 0.02, retract_viscosity_s: -0.01, branches: [],
/// #     range: StrainRange { lower: 0.0, upper: 0.33 },
/// # };
/// # let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1)?;
/// # let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 0.0, baseline_sd: 0.0, baseline_time_s: 1.0 };
/// # let model = SwitchedModel::<f64, 0, 2>::new(law, motion, noise)?;
/// let belief: Belief<f64, 2, 3> = Belief::initial(&model);
/// let ukf = Ukf::new(Unscented::new(model));
/// let step = ukf.step(&belief, 0.05, Some(Reading::from(0.1)))?;
/// # assert!(step.posterior.covariance[(0, 0)] < belief.covariance[(0, 0)]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type Ukf<M> = Ekf<Unscented<M>>;

/// A model whose channel is linearised statistically, by the unscented transform, instead of by its gradient.
///
/// The transform's regression of the reading on the state stands in for the gradient, and what the regression leaves
/// over is added to the noise. The Kalman update with that observation is the unscented update, and inherits Joseph's
/// form: the covariance stays positive semi-definite. Sigma points are drawn from the prediction with its process noise.
///
/// Source: Julier & Uhlmann, *Proc. IEEE* 92 (2004) 401, with α = 1, κ = 0, β = 2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unscented<M> {
    model: M,
}

/// Weight that corrects the centre point's part in the variance, β - α² + 1 with α = 1 and β = 2.
const CENTRE_CORRECTION: f64 = 2.0;

impl<M> Unscented<M> {
    /// Wraps a model.
    pub const fn new(model: M) -> Self {
        Self { model }
    }

    /// The model inside.
    pub const fn inner(&self) -> &M {
        &self.model
    }
}

impl<T: Scalar, M: Dynamics<T, N, L>, const N: usize, const L: usize> Dynamics<T, N, L> for Unscented<M> {
    type Prepared = M::Prepared;

    fn prepare(&self, dt_s: T) -> Self::Prepared {
        self.model.prepare(dt_s)
    }

    fn longest_step_s(&self) -> T {
        self.model.longest_step_s()
    }

    fn transition(&self, step: &Self::Prepared, from: &Belief<T, N, L>, phase: Option<Phase>) -> Transition<T, N, L> {
        self.model.transition(step, from, phase)
    }

    fn propagate(&self, covariance: &Symmetric<T, N, L>, transition: &Transition<T, N, L>) -> Symmetric<T, N, L> {
        self.model.propagate(covariance, transition)
    }
}

impl<T: Scalar, M: Channel<T, N, L>, const N: usize, const L: usize> Channel<T, N, L> for Unscented<M> {
    fn observe(&self, at: &Belief<T, N, L>, phase: Option<Phase>) -> Observation<T, N> {
        // With α = 1 and κ = 0 the centre has no weight in the mean and 2N points have 1/2N each, at √N deviations.
        let spread = T::of(N as f64);
        let weight = T::one() / (T::of(2.0) * spread);
        let root = SemiDefinite::factor(&at.covariance);
        let value_at = |point: SVector<T, N>| self.model.value_at(&point, at, phase);
        let centre = self.model.observe(at, phase);
        let pairs: [(SVector<T, N>, T, T); N] = core::array::from_fn(|i| {
            let offset = root.column(i) * spread.sqrt();
            (offset, value_at(at.mean + offset), value_at(at.mean - offset))
        });
        let value = pairs.iter().fold(T::zero(), |sum, (_, up, down)| sum + weight * (*up + *down));
        let mut variance = T::of(CENTRE_CORRECTION) * (centre.value - value) * (centre.value - value);
        let mut cross = SVector::zeros();
        for (offset, up, down) in &pairs {
            variance += weight * ((*up - value) * (*up - value) + (*down - value) * (*down - value));
            cross += *offset * (weight * (*up - *down));
        }
        let gradient = root.solve(&cross);
        let unexplained = (variance - gradient.dot(&cross)).max(T::zero());
        Observation { value, gradient, variance: centre.variance + unexplained }
    }
}
