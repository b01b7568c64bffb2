use nalgebra::SVector;
use ohmstrain_model::{ModelNoise, Play, Scalar, SensorLaw, SwitchedModel, WithPlays};

/// A model of a strain sensor with state `[ε, v, (a), c₁ … c_B, (b), u₁ … u_P]`: what initial beliefs and
/// [`Estimate`](crate::Estimate)s take from it.
pub trait StrainSensor<T: Scalar, const M: usize, const B: usize, const N: usize> {
    /// The sensor's law.
    fn law(&self) -> &SensorLaw<T, B>;

    /// What the law does not explain.
    fn noise(&self) -> &ModelNoise<T>;

    /// Whether component `M + B` of the state is a baseline.
    fn has_baseline(&self) -> bool;

    /// Plays, whose lags are the last components of the state.
    fn plays(&self) -> &[Play<T>];

    /// Mean and variances before any reading.
    fn initial_distribution(&self) -> (SVector<T, N>, [T; N]);
}

impl<T: Scalar, const M: usize, const B: usize, const N: usize> StrainSensor<T, M, B, N> for SwitchedModel<T, M, B, N> {
    fn law(&self) -> &SensorLaw<T, B> {
        self.law()
    }

    fn noise(&self) -> &ModelNoise<T> {
        self.noise()
    }

    fn has_baseline(&self) -> bool {
        N > M + B
    }

    fn plays(&self) -> &[Play<T>] {
        &[]
    }

    fn initial_distribution(&self) -> (SVector<T, N>, [T; N]) {
        self.initial_distribution()
    }
}

impl<T: Scalar, const M: usize, const B: usize, const N0: usize, const P: usize, const N: usize>
    StrainSensor<T, M, B, N> for WithPlays<T, M, B, N0, P, N>
{
    fn law(&self) -> &SensorLaw<T, B> {
        self.inner().law()
    }

    fn noise(&self) -> &ModelNoise<T> {
        self.inner().noise()
    }

    fn has_baseline(&self) -> bool {
        N0 > M + B
    }

    fn plays(&self) -> &[Play<T>] {
        self.plays()
    }

    fn initial_distribution(&self) -> (SVector<T, N>, [T; N]) {
        self.initial_distribution()
    }
}
