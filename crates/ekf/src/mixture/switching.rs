use ohmstrain_model::{Motion, ParameterError, Phase, Problem, Scalar, SwitchedModel};

use crate::Gaussian;

/// Longest step, as a fraction of the shortest mean duration of a phase.
const LONGEST: f64 = 0.02;

/// Mean and variance of |x| for a standard normal x: √(2/π) and 1 - 2/π.
const HALF_NORMAL: (f64, f64) = (0.797_884_560_802_865_4, 0.363_380_227_632_418_6);

/// Returns the initial rate of a moving phase; meaningless for a hold.
pub(crate) fn fresh_rate<T: Scalar>(motion: &Motion<T>, phase: Phase) -> Gaussian<T> {
    let sign = if phase == Phase::Retract { -T::one() } else { T::one() };
    let variance = motion.stationary_variance()[1];
    if motion.phase_rate() > T::zero() {
        return Gaussian { mean: sign * motion.phase_rate(), variance };
    }
    Gaussian { mean: sign * T::of(HALF_NORMAL.0) * variance.sqrt(), variance: T::of(HALF_NORMAL.1) * variance }
}

/// Longest step of a hypothesis whose rate is truncated at zero, as a fraction of the model's longest step. In longer steps,
/// rates that turn around twice are too frequent for the first-order formula, and a body that starts to move within the step
/// does so too early. In gaps of up to a second, the stated standard deviation of the branches was 1.2 to 1.8 times that of
/// simulations with whole steps, and 0.99 to 1.02 times with quarter steps.
const CUT: f64 = 0.25;

/// Returns the longest step, s, of a hypothesis whose rate is truncated.
pub(crate) fn longest_cut_s<T: Scalar, const B: usize, const N: usize>(model: &SwitchedModel<T, B, N>) -> T {
    T::of(CUT) * model.longest_step_s()
}

/// Returns the time without a reading, s, after which steps leave the direction open: three of the longest steps with
/// truncation, or half the integral of the rate's squared correlation. If it were longer, rows of milliseconds would truncate
/// too often before; 0.2 of the standard deviation was lost. If it were shorter, less would be known at the end of a long step
/// with a reading.
pub(crate) fn forgets_direction_s<T: Scalar, const B: usize, const N: usize>(model: &SwitchedModel<T, B, N>) -> T {
    if !model.motion().phase_rate().is_zero() {
        return T::one() / T::zero();
    }
    T::of(3.0) * longest_cut_s(model)
}

/// Durations of phases and transitions between them: a continuous-time Markov chain over extend, hold and retract.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dwell<T> {
    hold_s: T,
    move_s: T,
    reversal: T,
}

impl<T: Scalar> Dwell<T> {
    /// - `hold_s`, `move_s`: mean duration of a hold and of a stretching or releasing phase, s.
    /// - `reversal`: probability that a moving phase turns around without a hold, 0 to 1.
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn new(hold_s: T, move_s: T, reversal: T) -> Result<Self, ParameterError> {
        if !(hold_s > T::zero()) {
            return Err(ParameterError::new("hold_s", Problem::NotPositive));
        }
        if !(move_s > T::zero()) {
            return Err(ParameterError::new("move_s", Problem::NotPositive));
        }
        if !(reversal >= T::zero() && reversal <= T::one()) {
            return Err(ParameterError::new("reversal", Problem::OutOfRange));
        }
        Ok(Self { hold_s, move_s, reversal })
    }

    /// Returns the longest step, s, in which a change of phase may be treated as if at its beginning.
    pub(crate) fn longest_step_s(&self) -> T {
        T::of(LONGEST) * self.hold_s.min(self.move_s)
    }

    /// Returns the transition probabilities over `dt_s`, `[from][to]` in the order of [`Phase::ALL`]: the matrix
    /// exponential of the generator times dt in closed form, so that one step equals two halves.
    ///
    /// The sum of both moving phases and the hold form a chain of two states; the difference of the moving phases
    /// decays independently.
    #[must_use]
    pub fn probabilities(&self, dt_s: T) -> [[T; 3]; 3] {
        let (one, half) = (T::one(), T::of(0.5));
        let (stop, start) = ((one - self.reversal) / self.move_s, one / self.hold_s);
        let total = stop + start;
        // Divided by the total rate; without any transitions, this is the time itself.
        let mixed = if total > T::zero() { -(-total * dt_s).exp_m1() / total } else { dt_s };
        let (moving_stops, hold_ends) = (stop * mixed, start * mixed);
        let difference = (-(one + self.reversal) / self.move_s * dt_s).exp();
        let stays_moving = one - moving_stops;
        let same = half * (stays_moving + difference);
        let other = half * (stays_moving - difference);
        [
            [same, moving_stops, other],
            [half * hold_ends, one - hold_ends, half * hold_ends],
            [other, moving_stops, same],
        ]
    }
}
