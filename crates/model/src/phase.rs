use crate::Scalar;

/// What the body does with the sensor: the law's gains and dash-pot depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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
    /// The phase is not known, only that the rate is Gaussian around its prediction. Each set of gains is driven by the
    /// rate it is expected to see, `E[max(v, 0)]` or `E[min(v, 0)]`, and weighted in the Jacobian with the probability
    /// of its direction: statistical linearisation of the switch, smooth where a sign would jump.
    Uncertain {
        /// Standard deviation of the rate, 1/s.
        rate_sd: T,
    },
}

/// Steepness of the logistic distribution that stands for the normal one: `Φ(r) ≈ 1/(1 + exp(-1.702 r))`.
pub(crate) const STEEPNESS: f64 = 1.702;

/// How a rate splits between stretching and releasing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplitRate<T> {
    /// Expected stretching rate, not negative.
    pub extend: T,
    /// Expected releasing rate, not positive.
    pub retract: T,
    /// Probability of stretching, the slope of `extend`.
    pub extend_probability: T,
    /// Probability of releasing, the slope of `retract`.
    pub retract_probability: T,
}

impl<T: Scalar> Direction<T> {
    /// Splits a mean rate, 1/s.
    ///
    /// The normal distribution is replaced by the logistic one, `Φ(r) ≈ 1/(1 + exp(-1.702 r))`, off by at most 0.0095
    /// (Bowling et al., *J. Ind. Eng. Manag.* 2 (2009) 114): its integral has a closed form, and neither needs an error
    /// function.
    #[must_use]
    pub fn split(self, rate: T) -> SplitRate<T> {
        let (zero, one) = (T::zero(), T::one());
        match self {
            Self::Known(Phase::Extend) => {
                SplitRate { extend: rate, retract: zero, extend_probability: one, retract_probability: zero }
            }
            Self::Known(Phase::Retract) => {
                SplitRate { extend: zero, retract: rate, extend_probability: zero, retract_probability: one }
            }
            Self::Known(Phase::Hold) => {
                SplitRate { extend: zero, retract: zero, extend_probability: zero, retract_probability: zero }
            }
            Self::Uncertain { rate_sd } => {
                // Below this share of the rate the deviation makes no difference, and 0/0 is avoided.
                let scale = (rate_sd.max(rate.abs() * T::of(0.01)) + T::of(1e-30)) / T::of(STEEPNESS);
                let lean = rate / scale;
                // ln(1 + exp(x)) = max(x, 0) + ln(1 + exp(-|x|)), which cannot overflow.
                let tail = (-lean.abs()).exp();
                let spread = scale * tail.ln_1p();
                let larger = one / (one + tail);
                let (extend_probability, retract_probability) =
                    if rate < zero { (one - larger, larger) } else { (larger, one - larger) };
                SplitRate {
                    extend: rate.max(zero) + spread,
                    retract: rate.min(zero) - spread,
                    extend_probability,
                    retract_probability,
                }
            }
        }
    }
}

impl<T: Scalar> SplitRate<T> {
    /// Expected product of gain and rate.
    #[must_use]
    pub fn drive(&self, extend_gain: T, retract_gain: T) -> T {
        extend_gain * self.extend + retract_gain * self.retract
    }

    /// Its derivative with respect to the rate.
    #[must_use]
    pub fn slope(&self, extend_gain: T, retract_gain: T) -> T {
        extend_gain * self.extend_probability + retract_gain * self.retract_probability
    }
}
