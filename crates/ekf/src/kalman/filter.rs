use nalgebra::{SMatrix, SVector};
use ohmstrain_model::Scalar;

use super::factor::Factor;
use super::rows::{Combination, Digits, Sources, orthogonalise, regress};
use super::{KalmanError, Normal};

/// Linear approximation of a function of the state, `value + slope (x − at) + noise`: a tangent or a regression.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine<T, const R: usize, const N: usize> {
    /// Linearisation point.
    pub at: SVector<T, N>,
    /// Value at `at`.
    pub value: SVector<T, R>,
    /// Slope: F of a transition, H of a reading.
    pub slope: SMatrix<T, R, N>,
    pub(super) noise: Factor<T, R>,
}

impl<T: Scalar, const R: usize, const N: usize> Affine<T, R, N> {
    /// Builds a tangent; `None` if the noise is not a covariance or a number is not finite.
    pub(super) fn tangent(
        at: SVector<T, N>,
        value: SVector<T, R>,
        slope: SMatrix<T, R, N>,
        noise: &SMatrix<T, R, R>,
    ) -> Option<Self> {
        Self { at, value, slope, noise: Factor::of(noise)? }.checked()
    }

    pub(super) fn checked(self) -> Option<Self> {
        self.value.iter().chain(self.slope.iter()).copied().all(|x| x.is_finite()).then_some(self)
    }

    /// Returns the covariance of the noise: Q of a transition, R of a reading. For a regression it includes the
    /// linearisation error.
    #[must_use]
    pub fn noise(&self) -> SMatrix<T, R, R> {
        self.noise.matrix()
    }

    /// Returns its rows over the sources of `state` and of its own noise.
    pub(super) fn rows(&self, state: &Normal<T, N>) -> [Combination<T, N, R>; R] {
        core::array::from_fn(|i| Combination::of(&self.slope, &state.factor.columns, &self.noise.columns, i))
    }

    pub(super) fn sources<'a>(&'a self, state: &'a Normal<T, N>) -> Sources<'a, T, N, R> {
        Sources { state: &state.factor.variances, noise: &self.noise.variances }
    }

    fn mean(&self, state: &Normal<T, N>) -> SVector<T, R> {
        self.value + self.slope * (state.mean - self.at)
    }
}

/// Prediction: transition of a step, and the distribution after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prediction<T, const N: usize> {
    /// The transition, with slope F and noise Q.
    pub transition: Affine<T, N, N>,
    /// The state after it, N(x⁻, P⁻).
    pub prior: Normal<T, N>,
}

/// Results of one step. Values that belong to a missing entry of the reading are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<T, const N: usize, const M: usize> {
    /// The transition; the identity for an update alone.
    pub transition: Affine<T, N, N>,
    /// The state before the reading, N(x⁻, P⁻).
    pub prior: Normal<T, N>,
    /// The state after it, N(x, P).
    pub posterior: Normal<T, N>,
    /// Innovation ν = y − h(x⁻).
    pub innovation: SVector<T, M>,
    /// Its covariance S = H P⁻ Hᵀ + R.
    pub innovation_covariance: SMatrix<T, M, M>,
    /// Kalman gain K = P⁻ Hᵀ S⁻¹.
    pub gain: SMatrix<T, N, M>,
    /// Number of entries of the reading that are not missing.
    pub readings: usize,
    /// Normalised innovation squared νᵀ S⁻¹ ν: χ² with `readings` degrees of freedom if model and noise are right.
    pub nis: T,
    /// Log density of the reading given all earlier ones, −½ (νᵀ S⁻¹ ν + ln det S + readings · ln 2π).
    pub log_likelihood: T,
}

/// Prediction and update of a Kalman filter. Filters differ in how they linearise a function of the state.
pub trait Filter<T: Scalar, const N: usize, const M: usize> {
    /// Returns the transition x′ = f(x) + w, linearised around N(x, P).
    ///
    /// # Errors
    /// [`KalmanError::ProcessNoise`].
    fn transition_line(&self, state: &Normal<T, N>) -> Result<Affine<T, N, N>, KalmanError>;

    /// Returns the reading y = h(x) + v, linearised around N(x, P).
    ///
    /// # Errors
    /// [`KalmanError::ReadingNoise`].
    fn reading_line(&self, state: &Normal<T, N>) -> Result<Affine<T, M, N>, KalmanError>;

    /// Predicts the state one step later: x⁻ = f(x), P⁻ = F P Fᵀ + Q.
    ///
    /// # Errors
    /// See [`KalmanError`].
    fn predict(&self, state: &Normal<T, N>) -> Result<Prediction<T, N>, KalmanError> {
        let transition = self.transition_line(state)?;
        let mut rows = transition.rows(state);
        let (factor, _) = orthogonalise(&mut rows, transition.sources(state), [true; N]);
        Ok(Prediction { transition, prior: Normal { mean: transition.mean(state), factor }.checked()? })
    }

    /// Updates with a reading, without a prediction: for the first step of a filter, or a second reading at the same
    /// time.
    ///
    /// # Errors
    /// See [`KalmanError`].
    fn update(&self, prior: &Normal<T, N>, reading: &[Option<T>; M]) -> Result<Step<T, N, M>, KalmanError> {
        condition(prior, &self.reading_line(prior)?, reading)
    }

    /// Updates with the reading linearised again around the last result, `iterations` times: the iterated Kalman
    /// filter, which is the Gauss-Newton method for the most probable state. `update` is one iteration.
    ///
    /// # Errors
    /// See [`KalmanError`].
    ///
    /// Source: Bell & Cathey, *IEEE TAC* 38 (1993) 294; for a regression, García-Fernández et al., *IEEE TSP* 63 (2015)
    /// 5561.
    fn update_iterated(
        &self,
        prior: &Normal<T, N>,
        reading: &[Option<T>; M],
        iterations: usize,
    ) -> Result<Step<T, N, M>, KalmanError> {
        let mut step = self.update(prior, reading)?;
        for _ in 1..iterations {
            step = condition(prior, &self.reading_line(&step.posterior)?, reading)?;
        }
        Ok(step)
    }

    /// Predicts, then updates. If all entries of the reading are missing, it only predicts.
    ///
    /// # Errors
    /// See [`KalmanError`]; `state` is unchanged.
    fn step(&self, state: &Normal<T, N>, reading: &[Option<T>; M]) -> Result<Step<T, N, M>, KalmanError> {
        let Prediction { transition, prior } = self.predict(state)?;
        Ok(Step { transition, ..self.update(&prior, reading)? })
    }
}

/// Updates the state given the reading. With x = L s, s ~ N(0, D), it conditions the sources s.
#[allow(non_snake_case, reason = "S and K are the letters of every textbook")]
fn condition<T: Scalar, const N: usize, const M: usize>(
    prior: &Normal<T, N>,
    line: &Affine<T, M, N>,
    reading: &[Option<T>; M],
) -> Result<Step<T, N, M>, KalmanError> {
    if reading.iter().flatten().any(|y| !y.is_finite()) {
        return Err(KalmanError::NonFiniteReading);
    }
    let sources = line.sources(prior);
    let there = reading.map(|y| y.is_some());
    let mut y_rows = line.rows(prior);
    let mut S = SMatrix::<T, M, M>::from_fn(|i, j| y_rows[i].covariance(&y_rows[j], sources));
    let (S_factor, y_digits) = orthogonalise(&mut y_rows, sources, there);
    let mut s_rows: [Combination<T, N, M>; N] = core::array::from_fn(Combination::source);
    let on_y = regress(&mut s_rows, &y_rows, &S_factor.variances, sources);
    let (s_factor, s_digits) = orthogonalise(&mut s_rows, sources, [true; N]);
    let is_there = |digits: &(usize, Digits)| there[digits.0];
    let y_digits = || y_digits.iter().copied().enumerate().filter(is_there).map(|(_, digits)| digits);
    if y_digits().any(|digits| digits == Digits::None) {
        return Err(KalmanError::SingularInnovation);
    }
    if y_digits().chain(s_digits).any(|digits| digits == Digits::Few) {
        return Err(KalmanError::LostPrecision);
    }

    // Innovations, decorrelated in the order of the reading.
    let expected = line.mean(prior);
    let innovation = SVector::<T, M>::from_fn(|i, _| reading[i].map_or(T::zero(), |y| y - expected[i]));
    let independent = solve_lower(&S_factor.columns, &innovation);
    let (mut nis, mut ln_det, mut readings) = (T::zero(), T::zero(), 0);
    for i in (0..M).filter(|i| there[*i]) {
        nis += independent[i] * independent[i] / S_factor.variances[i];
        ln_det += S_factor.variances[i].ln();
        readings += 1;
    }
    if !nis.is_finite() {
        return Err(KalmanError::NonFiniteState);
    }
    let gain_independent = prior.factor.columns * on_y;
    let mut K = SMatrix::<T, N, M>::zeros();
    for j in (0..M).filter(|j| there[*j]) {
        let unit = SVector::from_fn(|i, _| if i == j { T::one() } else { T::zero() });
        K.set_column(j, &(gain_independent * solve_lower(&S_factor.columns, &unit)));
    }
    for (i, j) in (0..M).flat_map(|i| (0..M).map(move |j| (i, j))) {
        if !(there[i] && there[j]) {
            S[(i, j)] = T::zero();
        }
    }
    let factor = Factor { columns: prior.factor.columns * s_factor.columns, variances: s_factor.variances };
    Ok(Step {
        transition: stand_still(prior),
        prior: *prior,
        posterior: Normal { mean: prior.mean + gain_independent * independent, factor }.checked()?,
        innovation,
        innovation_covariance: S,
        gain: K,
        readings,
        nis,
        log_likelihood: T::of(-0.5) * (nis + ln_det + T::of(readings as f64) * T::two_pi().ln()),
    })
}

/// Returns the transition of a step of zero length.
fn stand_still<T: Scalar, const N: usize>(state: &Normal<T, N>) -> Affine<T, N, N> {
    Affine { at: state.mean, value: state.mean, slope: SMatrix::identity(), noise: Factor::zero() }
}

/// Returns the solution z of L z = b for a unit lower triangular L.
pub(super) fn solve_lower<T: Scalar, const R: usize>(lower: &SMatrix<T, R, R>, b: &SVector<T, R>) -> SVector<T, R> {
    let mut z = *b;
    for i in 0..R {
        for k in 0..i {
            let below = lower[(i, k)] * z[k];
            z[i] -= below;
        }
    }
    z
}
