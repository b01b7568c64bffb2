use crate::Scalar;

/// Phase of the body's movement; the law's gains and dash-pot depend on it.
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

    /// Index in [`Phase::ALL`].
    #[must_use]
    pub const fn index(self) -> usize {
        match self {
            Self::Extend => 0,
            Self::Hold => 1,
            Self::Retract => 2,
        }
    }
}

/// Direction of a step: it selects one of the law's two sets of gains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Direction<T> {
    /// The phase is given, as a hypothesis or from another source.
    Known(Phase),
    /// The signs of the rate at both ends of the step are hypotheses. In between the rate may have turned around, so that
    /// the body's path is longer than its net displacement.
    Within {
        /// A moving phase: the sign at the end.
        phase: Phase,
        /// Path that turning around adds.
        turning: Turning<T>,
    },
    /// The phase is not known, only that the rate is Gaussian around its prediction. Each set of gains is driven by the
    /// expected rate in its direction, `E[max(v, 0)]` or `E[min(v, 0)]`, and weighted in the Jacobian by the
    /// probability of that direction. This statistical linearisation of the switch is smooth where a sign would jump.
    Uncertain {
        /// Standard deviation of the rate over the step, 1/s.
        rate_sd: T,
        /// Factor by which the variance of the linearisation error over many steps exceeds that of errors independent from
        /// step to step. The error lasts as long as the rate's error: longer than a short step, and shorter than a long one.
        persistence: T,
    },
}

/// Path beyond the body's net displacement because its rate turns around within a step, divided by the step's length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turning<T> {
    /// Mean, 1/s.
    pub excess: T,
    /// Its variance, 1/s².
    pub variance: T,
}

/// Var(max(v, 0)) for a centred v of unit variance, minus the part explained by the line ½ v: ¼ - 1/(2π).
pub const UNEXPLAINED: f64 = 0.090_845_056_908_105_33;
/// Dependence of that variance on the mean: coefficients in powers of 4 Φ (1 - Φ).
pub const UNEXPLAINED_SHAPE: (f64, f64) = (0.77, 0.23);

/// Returns the variance of max(v, 0) that its statistical linearisation leaves unexplained, Var(max(v, 0)) - Φ² Var(v),
/// for a normal v of the given variance that is positive with probability `extends`. The fit is off by at most 3 % of its
/// maximum.
#[inline(always)]
pub fn unexplained<T: Scalar>(extends: T, retracts: T, variance: T) -> T {
    let both = extends * T::of(4.0) * retracts;
    variance * T::of(UNEXPLAINED) * both * (T::of(UNEXPLAINED_SHAPE.0) + both * T::of(UNEXPLAINED_SHAPE.1))
}

/// Steepness of the logistic distribution that approximates the normal one: `Φ(r) ≈ 1/(1 + exp(-1.702 r))`.
pub(crate) const STEEPNESS: f64 = 1.702;

/// Split of a rate between stretching and releasing.
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
    /// Variance of the stretching rate around `extend` that the linearisation leaves unexplained, 1/s². The releasing rate
    /// has the same unexplained variance, with errors of opposite sign.
    pub variance: T,
}

impl<T: Scalar> Direction<T> {
    /// Splits a mean rate, 1/s.
    ///
    /// The normal distribution is replaced by the logistic one, `Φ(r) ≈ 1/(1 + exp(-1.702 r))`, off by at most 0.0095
    /// (Bowling et al., *J. Ind. Eng. Manag.* 2 (2009) 114): its integral has a closed form, and no error function is
    /// needed.
    #[must_use]
    pub fn split(self, rate: T) -> SplitRate<T> {
        let (zero, one) = (T::zero(), T::one());
        match self {
            Self::Known(phase) => SplitRate::known(phase, rate),
            Self::Within { phase, turning } => {
                let (net, half) = (SplitRate::known(phase, rate), T::of(0.5));
                SplitRate {
                    extend: net.extend + half * turning.excess,
                    retract: net.retract - half * turning.excess,
                    variance: half * half * turning.variance,
                    ..net
                }
            }
            Self::Uncertain { rate_sd, .. } => {
                // Below this fraction of the rate, the deviation makes no difference; the bound also avoids 0/0.
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
                    variance: unexplained(extend_probability, retract_probability, rate_sd * rate_sd),
                }
            }
        }
    }
}

impl<T: Scalar> SplitRate<T> {
    /// Assigns the whole rate to one direction, or to none.
    fn known(phase: Phase, rate: T) -> Self {
        let (zero, one) = (T::zero(), T::one());
        let none =
            Self { extend: zero, retract: zero, extend_probability: zero, retract_probability: zero, variance: zero };
        match phase {
            Phase::Extend => Self { extend: rate, extend_probability: one, ..none },
            Phase::Hold => none,
            Phase::Retract => Self { retract: rate, retract_probability: one, ..none },
        }
    }

    /// Returns the expected product of gain and rate.
    #[must_use]
    pub fn drive(&self, extend_gain: T, retract_gain: T) -> T {
        extend_gain * self.extend + retract_gain * self.retract
    }

    /// Returns the derivative of [`Self::drive`] with respect to the rate.
    #[must_use]
    pub fn slope(&self, extend_gain: T, retract_gain: T) -> T {
        extend_gain * self.extend_probability + retract_gain * self.retract_probability
    }
}
