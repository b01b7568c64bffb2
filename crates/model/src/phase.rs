use crate::Scalar;

/// What the body does with the sensor: the law's gains and dash-pot depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// Stretching, v > 0.
    Extend,
    /// Held still, v = 0: nothing drives the branches, they only relax.
    Hold,
    /// Releasing, v < 0.
    Retract,
}

impl Phase {
    /// All phases, in the order in which they are reported.
    pub const ALL: [Self; 3] = [Self::Extend, Self::Hold, Self::Retract];

    /// Place in [`Phase::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::Extend => 0,
            Self::Hold => 1,
            Self::Retract => 2,
        }
    }
}

/// Which of the law's two sets of gains a step uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Direction<T> {
    /// The phase is given: a hypothesis, or known from elsewhere.
    Known(Phase),
    /// The phase is read off the predicted rate, softly: the weight of the stretching gains is
    /// `(1 + tanh(v/rate_scale)) / 2`. A rate well below the scale, jitter for instance, drives the branches with the
    /// mean of both gains, which for gains of opposite sign is next to nothing: a dead band without corners.
    ByRate {
        /// The rate that counts as clearly moving, 1/s, positive.
        rate_scale: T,
    },
}

impl<T: Scalar> Direction<T> {
    /// The weight of the stretching gains at rate `v`, and its slope.
    pub(crate) fn blend(self, rate: T) -> Blend<T> {
        match self {
            Self::Known(Phase::Extend) => {
                Blend { extend: T::one(), retract: T::zero(), extend_weight_slope: T::zero() }
            }
            Self::Known(Phase::Hold) => Blend { extend: T::zero(), retract: T::zero(), extend_weight_slope: T::zero() },
            Self::Known(Phase::Retract) => {
                Blend { extend: T::zero(), retract: T::one(), extend_weight_slope: T::zero() }
            }
            Self::ByRate { rate_scale } => {
                let lean = (rate / rate_scale).tanh();
                let half = T::of(0.5);
                Blend {
                    extend: half * (T::one() + lean),
                    retract: half * (T::one() - lean),
                    extend_weight_slope: half * (T::one() - lean * lean) / rate_scale,
                }
            }
        }
    }
}

/// Weights of the two sets of gains.
#[derive(Clone, Copy)]
pub(crate) struct Blend<T> {
    extend: T,
    retract: T,
    /// Derivative of `extend` with respect to the rate; `retract` has the opposite one.
    pub(crate) extend_weight_slope: T,
}

impl<T: Scalar> Blend<T> {
    pub(crate) fn mix(&self, extend: T, retract: T) -> T {
        self.extend * extend + self.retract * retract
    }
}
