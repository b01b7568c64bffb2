use crate::error::{ParameterError, Problem};
use crate::{Number, Scalar};

/// The quasi-static curve g(ε): relative change of resistance once all branches have relaxed, with g(0) = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Gauge<T> {
    /// `a₁ ε + a₂ ε² + a₃ ε³`.
    Polynomial {
        /// Coefficients a₁, a₂, a₃.
        coefficients: [T; 3],
    },
    /// `G ε exp(-ε/ε₀)`: rises, peaks at ε₀, falls.
    DecayingExponential {
        /// Slope G at zero strain.
        slope: T,
        /// Strain ε₀ of the peak.
        decay_strain: T,
    },
    /// `(1 + C ε) exp(A ε + W ε²) - 1`: tunnelling between particles whose gap grows with strain
    /// (Zhang, Pan, Zheng & Yi, *J. Polym. Sci. B* 38 (2000) 2739, with the exponent in powers of strain).
    Tunnelling {
        /// Growth C of the gap, 1 + C ε > 0.
        gap: T,
        /// Barrier term A.
        barrier: T,
        /// Loss of conducting paths W.
        path_loss: T,
    },
}

impl Gauge<f64> {
    /// Converts it to another precision.
    #[must_use]
    pub fn to<T: Number>(&self) -> Gauge<T> {
        match *self {
            Self::Polynomial { coefficients } => Gauge::Polynomial { coefficients: coefficients.map(T::of) },
            Self::DecayingExponential { slope, decay_strain } => {
                Gauge::DecayingExponential { slope: T::of(slope), decay_strain: T::of(decay_strain) }
            }
            Self::Tunnelling { gap, barrier, path_loss } => {
                Gauge::Tunnelling { gap: T::of(gap), barrier: T::of(barrier), path_loss: T::of(path_loss) }
            }
        }
    }
}

impl<T: Scalar> Gauge<T> {
    /// Checks that every coefficient is finite, and that ε₀ is not zero.
    ///
    /// # Errors
    /// Names the coefficient.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let finite = |name, value: T| {
            if value.is_finite() { Ok(()) } else { Err(ParameterError::new(name, Problem::NotFinite)) }
        };
        match *self {
            Self::Polynomial { coefficients } => coefficients.iter().try_for_each(|a| finite("gauge.coefficients", *a)),
            Self::DecayingExponential { slope, decay_strain } => {
                finite("gauge.slope", slope)?;
                finite("gauge.decay_strain", decay_strain)?;
                if decay_strain.is_zero() {
                    return Err(ParameterError::new("gauge.decay_strain", Problem::OutOfRange));
                }
                Ok(())
            }
            Self::Tunnelling { gap, barrier, path_loss } => {
                finite("gauge.gap", gap)?;
                finite("gauge.barrier", barrier)?;
                finite("gauge.path_loss", path_loss)
            }
        }
    }

    /// Checks that a gauge with valid coefficients has a finite value everywhere from `lower` to `upper`, and that the
    /// tunnelling gap stays positive.
    ///
    /// # Errors
    /// If the range is too wide for the gauge.
    pub(crate) fn validate_within(&self, lower: T, upper: T) -> Result<(), ParameterError> {
        let mut ends = [lower, upper, lower];
        if let Self::Tunnelling { gap, barrier, path_loss } = *self {
            let touches = |strain: T| !(T::one() + gap * strain > T::zero());
            if touches(lower) || touches(upper) {
                return Err(ParameterError::new("gauge.gap", Problem::OutOfRange));
            }
            // The exponent is largest here, or at an end.
            let vertex = -barrier / (T::of(2.0) * path_loss);
            if vertex > lower && vertex < upper {
                ends[2] = vertex;
            }
        }
        let finite = |strain: T| {
            let (value, slope) = self.value_and_slope(strain);
            value.is_finite() && slope.is_finite()
        };
        if ends.into_iter().all(finite) { Ok(()) } else { Err(ParameterError::new("gauge", Problem::OutOfRange)) }
    }

    /// Returns g(ε) and its slope g′(ε).
    #[must_use]
    pub fn value_and_slope(&self, strain: T) -> (T, T) {
        match *self {
            Self::Polynomial { coefficients: [a1, a2, a3] } => (
                strain * (a1 + strain * (a2 + strain * a3)),
                a1 + strain * (T::of(2.0) * a2 + strain * T::of(3.0) * a3),
            ),
            Self::DecayingExponential { slope, decay_strain } => {
                let x = strain / decay_strain;
                let decay = (-x).exp();
                (slope * strain * decay, slope * (T::one() - x) * decay)
            }
            Self::Tunnelling { gap, barrier, path_loss } => {
                let growth = (strain * (barrier + strain * path_loss)).exp();
                let width = T::one() + gap * strain;
                let slope = (gap + width * (barrier + T::of(2.0) * path_loss * strain)) * growth;
                (width * growth - T::one(), slope)
            }
        }
    }

    /// Returns the strains at which g′ = 0, ascending; beyond the first, strain is ambiguous.
    #[must_use]
    pub fn static_borders(&self) -> [Option<T>; 2] {
        match *self {
            Self::Polynomial { coefficients: [a1, a2, a3] } => quadratic_roots(T::of(3.0) * a3, T::of(2.0) * a2, a1),
            Self::DecayingExponential { decay_strain, .. } => [Some(decay_strain), None],
            Self::Tunnelling { gap, barrier, path_loss } => {
                let twice_loss = T::of(2.0) * path_loss;
                quadratic_roots(twice_loss * gap, barrier * gap + twice_loss, barrier + gap)
            }
        }
    }
}

/// Real roots of `a x² + b x + c`, ascending, without cancellation.
fn quadratic_roots<T: Scalar>(a: T, b: T, c: T) -> [Option<T>; 2] {
    if a.is_zero() {
        return [if b.is_zero() { None } else { Some(-c / b) }, None];
    }
    let discriminant = b * b - T::of(4.0) * a * c;
    if discriminant < T::zero() {
        return [None, None];
    }
    let sign = if b < T::zero() { -T::one() } else { T::one() };
    let q = -(b + sign * discriminant.sqrt()) / T::of(2.0);
    let (x, y) = (q / a, if q.is_zero() { T::zero() } else { c / q });
    if x <= y { [Some(x), Some(y)] } else { [Some(y), Some(x)] }
}
