//! Parts of an exported program.

use ohmstrain_ekf::live::{Flag, Flags, LiveParts};
use ohmstrain_ekf::{Dwell, Evidence, Real, StepError};
use ohmstrain_model::StrainRange;
use ohmstrain_sensor::{EstimatorKind, PhaseParams, PortableCorrection};

use crate::quadratic::OwnedQuadratic;

/// Flags as `ohmstrain_flag` in C has them.
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

/// The flags of the exported program in C.
pub fn bits(flags: Flags) -> u32 {
    BITS.into_iter().fold(0, |all, (flag, bit)| if flags.has(flag) { all | bit } else { all })
}

/// Parts of a twin, whatever its precision.
#[derive(Clone, Copy)]
pub struct Parts<'a> {
    pub kind: EstimatorKind,
    /// Durations of phases, and of rests if the body rests; `None` for a filter without phases.
    pub phases: Option<PhaseParams>,
    /// Surroundings of the filter. The lengths of its steps are those of single precision.
    pub live: LiveParts<f64, ()>,
    pub correction: Option<&'a PortableCorrection>,
    /// Stand-in for rows of the correction that were left out.
    pub quadratics: Option<&'a [OwnedQuadratic; 2]>,
}

/// Numbers that depend on the length of a step.
pub struct Numbers<'a, T> {
    /// The kernel's numbers, then nine probabilities of the chain, for a length, s.
    pub of: Box<dyn Fn(T) -> Vec<T> + 'a>,
    /// The length that is prepared for a step, s.
    pub length_s: fn(T) -> T,
}

/// A number of a file, as exactly as the precision can have it.
pub fn number<T: Real>(value: f64) -> T {
    T::of(value)
}

impl Parts<'_> {
    /// The limits, in any precision.
    pub fn limits_in<T: Real>(&self) -> StrainRange<T> {
        self.live.to().limits
    }
}

/// Dwell times of phases, and what weighs hypotheses.
///
/// # Errors
/// If single precision has no such numbers.
pub fn filter_parts<T: Real>(
    phases: &PhaseParams,
    limits: StrainRange<T>,
) -> Result<(Dwell<T>, Evidence<T>), StepError> {
    let dwell = Dwell::new(number(phases.hold_time_s), number(phases.move_time_s), number(phases.reversal));
    let evidence = Evidence::new(limits, number(phases.tempering));
    // Checked when the file was read; single precision may still turn a number into zero.
    dwell.and_then(|dwell| Ok((dwell, evidence?))).map_err(|_| StepError::NonFiniteState)
}
