use nalgebra::{SMatrix, SVector};
use ohmstrain_model::Scalar;

use super::KalmanError;
use super::factor::Factor;
use super::rows::sum;

/// Normal distribution N(x, P) of a state with N entries.
///
/// P is stored as L D Lᵀ, so it is always symmetric and positive semi-definite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal<T, const N: usize> {
    /// Mean x.
    pub mean: SVector<T, N>,
    pub(super) factor: Factor<T, N>,
}

impl<T: Scalar, const N: usize> Normal<T, N> {
    /// Creates N(x, P). An exactly known state has a row and a column of zeros in P.
    ///
    /// # Errors
    /// [`KalmanError::InitialCovariance`] if P is not a covariance, [`KalmanError::NonFiniteState`] if x is not finite.
    pub fn new(mean: SVector<T, N>, covariance: &SMatrix<T, N, N>) -> Result<Self, KalmanError> {
        let factor = Factor::of(covariance).ok_or(KalmanError::InitialCovariance)?;
        let factor = sum::<T, N, 0>(&factor, &SMatrix::zeros(), &SVector::zeros());
        Self { mean, factor }.checked()
    }

    /// Creates N(x, P) with independent entries of these variances. A large variance gives a diffuse start; 1e7 costs
    /// no digits, not even in `f32`.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn independent(mean: SVector<T, N>, variances: &SVector<T, N>) -> Result<Self, KalmanError> {
        Self::new(mean, &SMatrix::from_diagonal(variances))
    }

    /// Covariance P.
    #[must_use]
    pub fn covariance(&self) -> SMatrix<T, N, N> {
        self.factor.matrix()
    }

    /// Standard deviations, the square roots of P's diagonal.
    #[must_use]
    pub fn sd(&self) -> SVector<T, N> {
        self.covariance().diagonal().map(|variance| variance.sqrt())
    }

    pub(super) fn checked(self) -> Result<Self, KalmanError> {
        let is_finite = self.mean.iter().chain(self.factor.columns.iter()).chain(self.factor.variances.iter());
        if is_finite.copied().all(|x| x.is_finite()) { Ok(self) } else { Err(KalmanError::NonFiniteState) }
    }
}
