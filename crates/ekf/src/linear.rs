//! The linear sensor: stretching and releasing are alike, gains do not grow, the gauge is straight. F, Q and H are constants,
//! and so is, once it has settled, the gain.

use nalgebra::SVector;
use ohmstrain_model::Scalar;

use crate::kernel::{Compared, Course, Parts};
use crate::{Belief, Line, Reading, Residual, SparseEkf, StepError, Undirected};

/// The Kalman filter of a linear sensor: [`SparseEkf`] without a direction to be asked for.
///
/// ```
/// # use ohmstrain_ekf::{Belief, LinearFilter, Reading};
/// # use ohmstrain_model::*;
/// let branch =
///     Branch { tau_s: 4.0, extend_gain: 0.3, retract_gain: 0.3, extend_gain_slope: 0.0, retract_gain_slope: 0.0 };
/// let law = SensorLaw {
///     gauge: Gauge::Polynomial { coefficients: [1.6, 0.0, 0.0] },
///     extend_viscosity_s: 0.02, retract_viscosity_s: 0.02, branches: [branch],
///     range: StrainRange { lower: 0.0, upper: 0.33 },
/// };
/// # let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1)?;
/// # let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
/// let model = SwitchedModel::<f64, 1, 4>::new(law, motion, noise)?;
/// let filter = LinearFilter::new(model, 0.01)?;
/// let mut belief: Belief<f64, 4, 10> = Belief::initial(&model);
/// filter.step(&mut belief, Some(Reading::from(0.1)))?;
/// // With a covariance that stays as it settles, a step moves the mean only.
/// let frozen = filter.freeze(&belief)?;
/// frozen.step(&mut belief.mean, Some(0.11))?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type LinearFilter<T, const B: usize, const N: usize> = SparseEkf<T, Undirected, B, N, Line<T>>;

/// A linear sensor's filter whose covariance stands still where it settles when every step has a reading.
///
/// It is the filter's limit, not the filter: it starts too slowly from a belief less certain than that, and after a missing
/// reading it takes the next one with too little weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frozen<T, const B: usize, const N: usize> {
    motion: [[T; 2]; 2],
    input: [T; 2],
    branches: [Row<T>; B],
    baseline_decay: T,
    /// The next reading: of strain and rate as they are now, and by itself. What relaxes is read with factor one.
    expected: [T; 2],
    offset: T,
    gain: [T; N],
    variance: T,
    per_variance: T,
}

/// What a branch becomes: of strain and rate, of itself, and by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row<T> {
    of_motion: [T; 2],
    decay: T,
    input: T,
}

/// Steps until the gain stands still, at most.
const MOST_STEPS: u32 = 4_000_000;

impl<T: Scalar, const B: usize, const N: usize> LinearFilter<T, B, N> {
    /// The filter with the gain at which it settles, coming `from` a belief. In `f32` a gain that settles in n steps is exact to
    /// about n rounding errors.
    ///
    /// # Errors
    /// [`StepError`] if a step is refused, and [`StepError::NonFiniteState`] if the gain does not settle within four million steps.
    pub fn freeze<const L: usize>(&self, from: &Belief<T, N, L>) -> Result<Frozen<T, B, N>, StepError> {
        let (mut parts, mut last) = (Parts::of(from), [T::zero(); N]);
        let reading = Reading::from(T::zero());
        for _ in 0..MOST_STEPS {
            let spread = self.predict(&mut parts, Course::Uncertain);
            let compared = self.compare(&parts, reading, None, spread);
            self.update(&mut parts, reading, None, spread, None)?;
            let gain = Self::gain(&compared);
            let (mut moved, mut size) = (T::zero(), T::zero());
            for i in 0..N {
                moved = moved.max((gain[i] - last[i]).abs());
                size = size.max(gain[i].abs());
            }
            if moved <= size * T::default_epsilon() * T::of(0.25) {
                return Ok(self.with_gain(gain, &compared));
            }
            last = gain;
        }
        Err(StepError::NonFiniteState)
    }

    fn gain(compared: &Compared<T, B>) -> [T; N] {
        let mut gain = [T::zero(); N];
        gain[0] = compared.strain;
        gain[1] = compared.rate;
        for (gain, branch) in gain[2..].iter_mut().zip(&compared.branches) {
            *gain = *branch;
        }
        if Self::HAS_BASELINE {
            gain[N - 1] = compared.baseline;
        }
        gain.map(|covariance| covariance / compared.variance)
    }

    fn with_gain(&self, gain: [T; N], compared: &Compared<T, B>) -> Frozen<T, B, N> {
        let (step, gains) = (&self.step, &self.gains.within);
        let row = |i: usize| {
            let (branch, gain) = (&step.branches[i], gains[i].extend.at_zero);
            Row { of_motion: branch.drive.map(|drive| gain * drive), decay: branch.decay, input: gain * branch.input }
        };
        let (branches, along): ([Row<T>; B], _) = (core::array::from_fn(row), [compared.slope, compared.viscosity]);
        let through = |[of_strain, of_rate]: [T; 2]| along[0] * of_strain + along[1] * of_rate;
        let [a, b] = step.motion;
        let expected = [0, 1].map(|i| branches.iter().fold(through([a[i], b[i]]), |sum, row| sum + row.of_motion[i]));
        Frozen {
            motion: step.motion,
            input: step.input,
            branches,
            baseline_decay: step.baseline_decay,
            expected,
            offset: branches.iter().fold(through(step.input), |sum, row| sum + row.input),
            gain,
            variance: compared.variance,
            per_variance: T::one() / compared.variance,
        }
    }
}

impl<T: Scalar, const B: usize, const N: usize> Frozen<T, B, N> {
    /// The gain.
    #[must_use]
    pub const fn gain(&self) -> &[T; N] {
        &self.gain
    }

    /// Predicts one step ahead and takes the reading; without one it is a prediction and returns `None`.
    ///
    /// # Errors
    /// [`StepError::NonFiniteReading`] and [`StepError::NonFiniteState`]; the mean is untouched.
    #[inline]
    pub fn step(&self, mean: &mut SVector<T, N>, reading: Option<T>) -> Result<Option<Residual<T>>, StepError> {
        let ([a, b], [strain, rate]) = (self.motion, [mean[0], mean[1]]);
        let mut next = *mean;
        // The reading is expected from the mean as it was, so that neither waits for the other.
        let mut expected = self.offset + strain * self.expected[0] + rate * self.expected[1];
        next[0] = self.input[0] + strain * a[0] + rate * a[1];
        next[1] = self.input[1] + strain * b[0] + rate * b[1];
        for (mean, row) in next.iter_mut().skip(2).zip(&self.branches) {
            let left = *mean * row.decay;
            expected += left;
            *mean = left + (row.input + strain * row.of_motion[0] + rate * row.of_motion[1]);
        }
        if Parts::<T, B>::has_baseline(N) {
            next[N - 1] *= self.baseline_decay;
            expected += next[N - 1];
        }
        let mut residual = None;
        if let Some(reading) = reading {
            let innovation = reading - expected;
            for (mean, gain) in next.iter_mut().zip(&self.gain) {
                *mean += *gain * innovation;
            }
            let nis = innovation * innovation * self.per_variance;
            residual = Some(Residual { innovation, variance: self.variance, nis });
        }
        // Whatever is not finite makes the sum not finite.
        if !next.sum().is_finite() {
            let is_of_the_reading = reading.is_some_and(|reading| !reading.is_finite());
            return Err(if is_of_the_reading { StepError::NonFiniteReading } else { StepError::NonFiniteState });
        }
        *mean = next;
        Ok(residual)
    }
}
