use nalgebra::{SMatrix, SVector};
use ohmstrain_model::Scalar;

use super::factor::Factor;
use super::rows::sum;
use super::{Affine, Filter, KalmanError, Model, Normal};

/// Unscented Kalman filter: both functions of the model are evaluated at 2 N + 1 sigma points, and no Jacobian is
/// needed.
///
/// The points are x and x ± √N times a column of P's square root, with α = 1, κ = 0, β = 2. The centre has weight 0 in
/// the mean and 2 in the covariance, so that no weight is negative. The sigma points of the reading are new, drawn from
/// the prediction including Q. The linear approximation is the regression on the points; its residual covariance is
/// added to Q or R.
///
/// Source: Julier & Uhlmann, *Proc. IEEE* 92 (2004) 401; as a regression, Särkkä (2013), §5.5 and §6.2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ukf<D, T, const N: usize, const M: usize> {
    /// The model's functions.
    pub model: D,
    /// Q: covariance of the process noise of the step.
    pub process_noise: SMatrix<T, N, N>,
    /// R: covariance of the readings' noise.
    pub reading_noise: SMatrix<T, M, M>,
}

impl<D, T, const N: usize, const M: usize> Ukf<D, T, N, M> {
    /// Creates the filter of a model with Q and R.
    #[allow(non_snake_case, reason = "the letters of every textbook")]
    pub const fn new(model: D, Q: SMatrix<T, N, N>, R: SMatrix<T, M, M>) -> Self {
        Self { model, process_noise: Q, reading_noise: R }
    }
}

/// Weight of the centre in the covariance, β − α² + 1 with α = 1 and β = 2.
const CENTRE_WEIGHT: f64 = 2.0;

impl<T: Scalar, D: Model<T, N, M>, const N: usize, const M: usize> Filter<T, N, M> for Ukf<D, T, N, M> {
    fn transition_line(&self, state: &Normal<T, N>) -> Result<Affine<T, N, N>, KalmanError> {
        regression(state, |x| self.model.transition(x), &self.process_noise).ok_or(KalmanError::ProcessNoise)
    }

    fn reading_line(&self, state: &Normal<T, N>) -> Result<Affine<T, M, N>, KalmanError> {
        regression(state, |x| self.model.reading(x), &self.reading_noise).ok_or(KalmanError::ReadingNoise)
    }
}

/// Returns the unscented transform of a function with noise, as its regression on the state.
fn regression<T: Scalar, const R: usize, const N: usize>(
    state: &Normal<T, N>,
    function: impl Fn(&SVector<T, N>) -> SVector<T, R>,
    noise: &SMatrix<T, R, R>,
) -> Option<Affine<T, R, N>> {
    let (x, two, spread) = (state.mean, T::of(2.0), T::of(N as f64).sqrt());
    let centre = function(&x);
    // Half the difference and half the sum of the values at both points of a pair.
    let (mut odd, mut even) = (SMatrix::<T, R, N>::zeros(), SMatrix::<T, R, N>::zeros());
    for i in 0..N {
        let offset = state.factor.column(i) * spread;
        let (above, below) = (function(&(x + offset)), function(&(x - offset)));
        odd.set_column(i, &((above - below) / two));
        even.set_column(i, &((above + below) / two));
    }
    let value = even.column_mean();

    // Slope with respect to the sources s of x = L s, converted to x through L.
    let mut slope = odd;
    for i in (0..N).rev() {
        let deviation = state.factor.variances[i].sqrt() * spread;
        let own = if deviation.is_zero() { SVector::zeros() } else { odd.column(i) / deviation };
        let later = (i + 1..N).fold(own, |left, k| left - slope.column(k) * state.factor.columns[(k, i)]);
        slope.set_column(i, &later);
    }

    // Nonlinear part: pairs have weight 1/N, the centre 2.
    let pairs = SMatrix::<T, R, N>::from_fn(|i, j| even[(i, j)] - value[i]);
    let noise = Factor::of(noise)?;
    let bend = SVector::<T, N>::repeat(T::one() / T::of(N as f64));
    let noise = sum(&noise, &pairs, &bend);
    let noise = sum(&noise, &(centre - value), &SVector::<T, 1>::repeat(T::of(CENTRE_WEIGHT)));
    Affine { at: x, value, slope, noise }.checked()
}
