//! Parts of an exported program.

use ohmstrain_ekf::live::{Flag, Flags, LiveParts, StaticCurve};
use ohmstrain_ekf::{Dwell, Evidence, Real, StepError};
use ohmstrain_model::StrainRange;
use ohmstrain_sensor::{EstimatorKind, PhaseParams, PortableCorrection};

use crate::quadratic::OwnedQuadratic;

/// Flags in the order of `ohmstrain_flag` in C.
const BITS: [(Flag, u32); 10] = [
    (Flag::Missing, 1),
    (Flag::Implausible, 2),
    (Flag::Stuck, 4),
    (Flag::Rejected, 8),
    (Flag::Downweighted, 16),
    (Flag::StartUp, 32),
    (Flag::Recovering, 64),
    (Flag::Extrapolated, 128),
    (Flag::LongRun, 256),
    (Flag::RestMoved, 512),
];

/// Converts flags to those of the exported program in C.
pub fn bits(flags: Flags) -> u32 {
    BITS.into_iter().fold(0, |all, (flag, bit)| if flags.has(flag) { all | bit } else { all })
}

/// Parts of a twin, whatever its precision.
#[derive(Clone, Copy)]
pub struct Parts<'a> {
    pub kind: EstimatorKind,
    /// Durations of phases, and of rests if the body rests; `None` for a filter without phases.
    pub phases: Option<PhaseParams>,
    /// Surroundings of the filter. Lengths of steps are those of single precision.
    pub live: LiveParts<f64, ()>,
    /// Curve that gives the strain in place of the filter.
    pub curve: Option<StaticCurve<f64>>,
    pub correction: Option<&'a PortableCorrection>,
    /// Stand-in for rows of the correction that were left out.
    pub quadratics: Option<&'a [OwnedQuadratic; 2]>,
}

/// Numbers that depend on the length of a step.
pub struct Numbers<'a, T> {
    /// Function that computes, for a length in s, the kernel's numbers and then nine probabilities of the chain.
    pub of: Box<dyn Fn(T) -> Vec<T> + 'a>,
    /// Function that computes the effective length of a step, s.
    pub length_s: fn(T) -> T,
}

impl Parts<'_> {
    /// Returns the limits in any precision.
    pub fn limits_in<T: Real>(&self) -> StrainRange<T> {
        self.live.to().limits
    }
}

/// Returns the dwell times of phases and the evidence that weights hypotheses.
///
/// # Errors
/// If single precision cannot represent them.
pub fn filter_parts<T: Real>(
    phases: &PhaseParams,
    limits: StrainRange<T>,
) -> Result<(Dwell<T>, Evidence<T>), StepError> {
    let dwell = Dwell::new(T::of(phases.hold_time_s), T::of(phases.move_time_s), T::of(phases.reversal));
    let evidence = Evidence::new(limits, T::of(phases.tempering));
    // Checked when the file was read, but single precision may still round a number to zero.
    dwell.and_then(|dwell| Ok((dwell, evidence?))).map_err(|_| StepError::NonFiniteState)
}
