use nalgebra::{SMatrix, SVector};
use ohmstrain_model::Symmetric;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};

/// Random numbers that are the same on every machine.
pub struct Draws(ChaCha12Rng);

impl Draws {
    /// Creates the stream of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(ChaCha12Rng::seed_from_u64(seed))
    }

    /// Draws a standard normal number.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Draws a uniform number in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Draws a vector of independent standard normal numbers.
    pub fn vector<const N: usize>(&mut self) -> SVector<f64, N> {
        SVector::from_fn(|_, _| self.normal())
    }

    /// Draws a matrix of independent standard normal numbers.
    pub fn matrix<const N: usize>(&mut self) -> SMatrix<f64, N, N> {
        SMatrix::from_fn(|_, _| self.normal())
    }

    /// Draws a full covariance without small eigenvalues.
    pub fn covariance<const N: usize>(&mut self) -> SMatrix<f64, N, N> {
        let root = self.matrix::<N>();
        root * root.transpose() + SMatrix::identity() * 0.1
    }
}

/// Returns a square root of a possibly singular covariance, `root · rootᵀ`, from eigenvectors.
#[must_use]
pub fn square_root<const N: usize, const L: usize>(covariance: &Symmetric<f64, N, L>) -> SMatrix<f64, N, N> {
    // Components differ greatly in size, so the eigenvectors are those of the correlations.
    let sd = SVector::<f64, N>::from_fn(|i, _| covariance[(i, i)].max(0.0).sqrt());
    let share = |i: usize, j: usize| if sd[i] * sd[j] > 0.0 { covariance[(i, j)] / (sd[i] * sd[j]) } else { 0.0 };
    let correlations = nalgebra::DMatrix::from_fn(N, N, share).symmetric_eigen();
    SMatrix::from_fn(|i, j| sd[i] * correlations.eigenvectors[(i, j)] * correlations.eigenvalues[j].max(0.0).sqrt())
}
