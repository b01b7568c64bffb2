use nalgebra::SVector;
use ohmstrain_model::{MOTION_STATES, ModelNoise, Scalar, SensorLaw, SwitchedModel};

/// A model of a strain sensor with state `[ε, v, c₁ … c_B, (b)]`: what initial beliefs and
/// [`Estimate`](crate::Estimate)s take from it.
pub trait StrainSensor<T: Scalar, const B: usize, const N: usize> {
    /// The sensor's law.
    fn law(&self) -> &SensorLaw<T, B>;

    /// What the law does not explain.
    fn noise(&self) -> &ModelNoise<T>;

    /// Whether component `B + 2` of the state is a baseline.
    fn has_baseline(&self) -> bool;

    /// Mean and variances before any reading.
    fn initial_distribution(&self) -> (SVector<T, N>, [T; N]);
}

impl<T: Scalar, const B: usize, const N: usize> StrainSensor<T, B, N> for SwitchedModel<T, B, N> {
    fn law(&self) -> &SensorLaw<T, B> {
        self.law()
    }

    fn noise(&self) -> &ModelNoise<T> {
        self.noise()
    }

    fn has_baseline(&self) -> bool {
        N > MOTION_STATES + B
    }

    fn initial_distribution(&self) -> (SVector<T, N>, [T; N]) {
        self.initial_distribution()
    }
}
