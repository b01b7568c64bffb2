use ohmstrain_model::{Motion, ParameterError, Phase, Problem, Scalar, SwitchedModel};

use crate::Gaussian;

/// Longest step over the mean length of a phase.
const LONGEST: f64 = 0.02;

/// Mean and variance of |x| for a standard normal x: √(2/π) and 1 - 2/π.
const HALF_NORMAL: (f64, f64) = (0.797_884_560_802_865_4, 0.363_380_227_632_418_6);

/// The rate that a moving phase begins with; of no meaning for a hold.
pub(crate) fn fresh_rate<T: Scalar>(motion: &Motion<T>, phase: Phase) -> Gaussian<T> {
    let sign = if phase == Phase::Retract { -T::one() } else { T::one() };
    let variance = motion.stationary_variance()[1];
    if motion.phase_rate() > T::zero() {
        return Gaussian { mean: sign * motion.phase_rate(), variance };
    }
    Gaussian { mean: sign * T::of(HALF_NORMAL.0) * variance.sqrt(), variance: T::of(HALF_NORMAL.1) * variance }
}

/// A hypothesis whose rate is cut at zero takes a step of this share of the longest one at most: over more, what turns around
/// twice is too much for the first order of its formula, and a body that sets out within the step does so too early. Without a
/// reading for a second or less the branches' deviation was stated 1.2 to 1.8 times as large as simulations have it with whole
/// steps, 0.99 to 1.02 times with quarters.
const CUT: f64 = 0.25;

/// The longest step of a hypothesis whose rate is cut, s.
pub(crate) fn longest_cut_s<T: Scalar, const B: usize, const N: usize>(model: &SwitchedModel<T, B, N>) -> T {
    T::of(CUT) * model.longest_step_s()
}

/// Seconds without a reading after which a step leaves the direction open: three of the longest steps with a cut, half of the
/// integral of the rate's squared correlation. Later, rows of milliseconds have cut too often by then: 0.2 of the deviation was
/// lost. Sooner, less would be known of what comes at the end of a long step with a reading.
pub(crate) fn forgets_direction_s<T: Scalar, const B: usize, const N: usize>(model: &SwitchedModel<T, B, N>) -> T {
    if !model.motion().phase_rate().is_zero() {
        return T::one() / T::zero();
    }
    T::of(3.0) * longest_cut_s(model)
}

/// Durations of phases and the phases that follow: a Markov chain in continuous time over extend, hold and retract.
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
    /// Names the parameter that is out of range.
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

    /// The longest step in which a change of phase may be taken for one at its beginning, s.
    pub(crate) fn longest_step_s(&self) -> T {
        T::of(LONGEST) * self.hold_s.min(self.move_s)
    }

    /// Transition probabilities over `dt_s`, `[from][to]` in the order of [`Phase::ALL`]: the exponential of generator
    /// times dt in closed form, so that one step equals two halves.
    ///
    /// The sum of both moving phases and the hold form a chain of two states; their difference decays by itself.
    #[must_use]
    pub fn probabilities(&self, dt_s: T) -> [[T; 3]; 3] {
        let (one, half) = (T::one(), T::of(0.5));
        let (stop, start) = ((one - self.reversal) / self.move_s, one / self.hold_s);
        let total = stop + start;
        // Over the rate: where nothing ever changes that is the time itself.
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
