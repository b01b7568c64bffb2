use crate::error::{ParameterError, Problem};
use crate::{Gauge, Number, Phase, Scalar};

/// One relaxing contribution to the resistance: `ċ = -c/τ + (k + κ ε) v`, with separate gains for stretching and
/// releasing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Branch<T> {
    /// Time constant τ, s.
    pub tau_s: T,
    /// Gain k⁺ while stretching.
    pub extend_gain: T,
    /// Gain k⁻ while releasing.
    pub retract_gain: T,
    /// Growth κ⁺ of the stretching gain with strain.
    pub extend_gain_slope: T,
    /// Growth κ⁻ of the releasing gain with strain.
    pub retract_gain_slope: T,
}

/// Range of strains for which a law was fitted.
///
/// Outside it, the gauge curve continues along its tangent and the gains keep their values at the border: an
/// extrapolated polynomial is meaningless, and a filter must still be able to return.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StrainRange<T> {
    /// Lower end.
    pub lower: T,
    /// Upper end.
    pub upper: T,
}

impl<T: Number> StrainRange<T> {
    /// Returns `strain`, moved to the nearer end if it lies outside.
    #[must_use]
    pub fn clamp(&self, strain: T) -> T {
        strain.max(self.lower).min(self.upper)
    }

    /// True if `strain` lies in the range, ends included.
    #[must_use]
    pub fn contains(&self, strain: T) -> bool {
        strain >= self.lower && strain <= self.upper
    }

    /// Length of the range.
    #[must_use]
    pub fn span(&self) -> T {
        self.upper - self.lower
    }

    /// Variance of a strain distributed uniformly over the range.
    #[must_use]
    pub fn variance_of_anywhere(&self) -> T {
        let span = self.span();
        span * span * T::of(1.0 / 12.0)
    }
}

/// The switched Kelvin-Voigt law with `B` branches:
///
/// `ρ = R/R₀ - 1 = g(ε) + ηᵖ v + Σ cᵢ + b`, `ċᵢ = -cᵢ/τᵢ + (kᵢᵖ + κᵢᵖ ε) v`, p = extend, hold or retract.
///
/// With `k⁺ = k⁻` and `κ = 0` it is linear viscoelasticity; with no branch it is the Kelvin-Voigt element.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SensorLaw<T, const B: usize> {
    /// Quasi-static curve g.
    pub gauge: Gauge<T>,
    /// Dash-pot term η⁺ while stretching, s.
    pub extend_viscosity_s: T,
    /// Dash-pot term η⁻ while releasing, s.
    pub retract_viscosity_s: T,
    /// The branches, fastest first by convention.
    #[cfg_attr(feature = "serde", serde(with = "serde_big_array::BigArray"))]
    pub branches: [Branch<T>; B],
    /// Range in which the law holds.
    pub range: StrainRange<T>,
}

impl<const B: usize> SensorLaw<f64, B> {
    /// Converts it to another precision.
    #[must_use]
    pub fn to<T: Number>(&self) -> SensorLaw<T, B> {
        SensorLaw {
            gauge: self.gauge.to(),
            extend_viscosity_s: T::of(self.extend_viscosity_s),
            retract_viscosity_s: T::of(self.retract_viscosity_s),
            branches: self.branches.map(|branch| Branch {
                tau_s: T::of(branch.tau_s),
                extend_gain: T::of(branch.extend_gain),
                retract_gain: T::of(branch.retract_gain),
                extend_gain_slope: T::of(branch.extend_gain_slope),
                retract_gain_slope: T::of(branch.retract_gain_slope),
            }),
            range: StrainRange { lower: T::of(self.range.lower), upper: T::of(self.range.upper) },
        }
    }
}

impl<T: Scalar, const B: usize> SensorLaw<T, B> {
    /// Checks every parameter.
    ///
    /// # Errors
    /// Names the invalid parameter.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.gauge.validate()?;
        if !(self.extend_viscosity_s.is_finite() && self.retract_viscosity_s.is_finite()) {
            return Err(ParameterError::new("viscosity_s", Problem::NotFinite));
        }
        for branch in &self.branches {
            if !(branch.tau_s.is_finite() && branch.tau_s > T::zero()) {
                return Err(ParameterError::new("tau_s", Problem::NotPositive));
            }
            let gains = [branch.extend_gain, branch.retract_gain, branch.extend_gain_slope, branch.retract_gain_slope];
            if !gains.iter().all(|gain| gain.is_finite()) {
                return Err(ParameterError::new("branch gain", Problem::NotFinite));
            }
        }
        let StrainRange { lower, upper } = self.range;
        if !(lower.is_finite() && upper.is_finite()) {
            return Err(ParameterError::new("range", Problem::NotFinite));
        }
        if !(lower < upper) {
            return Err(ParameterError::new("range", Problem::OutOfRange));
        }
        self.gauge.validate_within(lower, upper)
    }

    /// Returns g(ε) and g′(ε), continued along the tangent outside the range.
    #[must_use]
    pub fn gauge_value_and_slope(&self, strain: T) -> (T, T) {
        let inside = self.range.clamp(strain);
        let (value, slope) = self.gauge.value_and_slope(inside);
        (value + slope * (strain - inside), slope)
    }

    /// Dash-pot term of a phase, s; zero in a hold.
    #[must_use]
    pub fn viscosity_s(&self, phase: Phase) -> T {
        match phase {
            Phase::Extend => self.extend_viscosity_s,
            Phase::Hold => T::zero(),
            Phase::Retract => self.retract_viscosity_s,
        }
    }

    /// Gain of branch `i` at `strain` and its growth with strain, in a phase; zero in a hold.
    #[must_use]
    pub fn gain(&self, i: usize, strain: T, phase: Phase) -> (T, T) {
        let Some(branch) = self.branches.get(i) else { return (T::zero(), T::zero()) };
        let (gain, slope) = match phase {
            Phase::Extend => (branch.extend_gain, branch.extend_gain_slope),
            Phase::Hold => (T::zero(), T::zero()),
            Phase::Retract => (branch.retract_gain, branch.retract_gain_slope),
        };
        let slope_here = if self.range.contains(strain) { slope } else { T::zero() };
        (gain + slope * self.range.clamp(strain), slope_here)
    }

    /// Returns ρ = R/R₀ - 1 from strain, rate (1/s), relaxation states and baseline.
    #[must_use]
    pub fn relative_change(&self, strain: T, rate: T, relaxation: &[T; B], baseline: T, phase: Phase) -> T {
        let (gauge, _) = self.gauge_value_and_slope(strain);
        let relaxing = relaxation.iter().fold(T::zero(), |sum, c| sum + *c);
        gauge + self.viscosity_s(phase) * rate + relaxing + baseline
    }

    /// Returns dρ/dt over v on a ramp of constant rate v, the change of the reading per strain *along the movement*, with
    /// relaxation: `g′(ε) + Σ (kᵢᵖ + κᵢᵖ ε) - Σ cᵢ/(τᵢ v)`. It is zero at the ramp border ε*(v).
    #[must_use]
    pub fn ramp_slope(&self, strain: T, rate: T, relaxation: &[T; B], phase: Phase) -> T {
        let (_, slope) = self.gauge_value_and_slope(strain);
        self.branches.iter().zip(relaxation).enumerate().fold(slope, |sum, (i, (branch, c))| {
            let (gain, _) = self.gain(i, strain, phase);
            sum + gain - *c / (branch.tau_s * rate)
        })
    }

    /// Returns the static border, beyond which one reading belongs to two strains. It is the smallest strain in range at
    /// which the gauge curve peaks. If there is no peak and the curve ends below its start, it is the valley. (A curve
    /// that mostly rises may begin with a dip; strains beyond that are not ambiguous.)
    #[must_use]
    pub fn static_border(&self) -> Option<T> {
        let nudge = T::of(1e-3) * self.range.span();
        let turns = |border: &T, down: bool| {
            let (_, before) = self.gauge.value_and_slope(*border - nudge);
            let (_, after) = self.gauge.value_and_slope(*border + nudge);
            let (before, after) = if down { (before, after) } else { (after, before) };
            self.range.contains(*border) && before > T::zero() && after < T::zero()
        };
        let borders = || self.gauge.static_borders().into_iter().flatten();
        let value = |strain: T| self.gauge.value_and_slope(strain).0;
        let falls = value(self.range.upper) < value(self.range.lower);
        borders().find(|border| turns(border, true)).or_else(|| borders().find(|border| falls && turns(border, false)))
    }
}
