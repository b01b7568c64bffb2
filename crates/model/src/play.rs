use crate::error::{ParameterError, Problem};
use crate::phase::STEEPNESS;
use crate::{Direction, Scalar};

/// A play operator: hysteresis that depends on where the strain has turned around and not on time.
///
/// A play is dragged by the strain at the end of some slack, `p' = clamp(p, ε' - r, ε' + r)`. It adds `w (p - ε)` to the
/// reading: nothing in the middle of its loop, -w r where the strain has been rising and w r where it has been falling.
/// Plays of several widths make a Prandtl-Ishlinskii operator. Literature adds `w p`, which is the same law with w more
/// in the slope of the gauge curve; as it is here, that curve runs through the middle of the loop, and its peak stays
/// where one reading belongs to two strains.
///
/// Source: Brokate & Sprekels, *Hysteresis and Phase Transitions* (Springer 1996), section 2.3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Play<T> {
    /// Slack r to each side, in units of strain.
    pub half_width: T,
    /// Weight w, relative change of resistance per strain.
    pub weight: T,
}

/// A Gaussian that was clamped, and the line that says most about it.
#[derive(Clone, Copy)]
pub(crate) struct Clamped<T> {
    pub mean: T,
    /// Slope of the regression on the value before.
    pub slope: T,
    /// Variance that the regression leaves unexplained.
    pub unexplained: T,
}

impl<T: Scalar> Play<T> {
    /// Checks both parameters.
    ///
    /// # Errors
    /// Names the parameter that no play can have.
    pub fn validate(&self) -> Result<(), ParameterError> {
        if !(self.half_width > T::zero() && self.half_width.is_finite()) {
            return Err(ParameterError::new("half_width", Problem::NotPositive));
        }
        if !self.weight.is_finite() {
            return Err(ParameterError::new("weight", Problem::NotFinite));
        }
        Ok(())
    }

    /// `clamp(d, -r, r) = -r + max(d + r, 0) - max(d - r, 0)` of a Gaussian d, linearised statistically: exact where the
    /// deviation is zero.
    ///
    /// Mean and slope are those of the logistic distribution in place of the normal one, as for [`Direction`]. Of what the
    /// slope leaves unexplained the second Hermite coefficient of each corner is taken, ½ (sd² · density)², nearly all of it
    /// where the Gaussian is centred on a corner; but not more than a value between -r and r with this mean can have
    /// (Bhatia & Davis, *Am. Math. Mon.* 107 (2000) 353).
    pub(crate) fn clamped(&self, mean: T, sd: T) -> Clamped<T> {
        let (r, direction) = (self.half_width, Direction::Uncertain { rate_sd: sd });
        let (above_lower, above_upper) = (direction.split(mean + r), direction.split(mean - r));
        let slope = above_lower.extend_probability - above_upper.extend_probability;
        let clamped = (above_lower.extend - above_upper.extend - r).max(-r).min(r);
        let bend = |p: T, q: T| p * q * p * q;
        let bends = bend(above_lower.extend_probability, above_lower.retract_probability)
            + bend(above_upper.extend_probability, above_upper.retract_probability);
        let steep = T::of(STEEPNESS) * sd;
        let most = (r * r - clamped * clamped - slope * slope * sd * sd).max(T::zero());
        Clamped { mean: clamped, slope, unexplained: (T::of(0.5) * steep * steep * bends).min(most) }
    }
}
