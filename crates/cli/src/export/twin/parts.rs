//! What an exported program is made of.

use ohmstrain::{DoubtParts, RestBounds};
use ohmstrain_calib::{EstimatorKind, PortableCorrection, PortableSieve};
use ohmstrain_ekf::{Dwell, Evidence, Real, StepError};
use ohmstrain_model::StrainRange;

use crate::export::quadratic::Quadratic;

/// What became of a reading, as `ohmstrain_flag` in C has it.
pub mod flag {
    use ohmstrain::{Flag, Flags};

    pub const MISSING: u32 = 1;
    pub const IMPLAUSIBLE: u32 = 2;
    pub const STUCK: u32 = 4;
    pub const REJECTED: u32 = 8;
    pub const DOWNWEIGHTED: u32 = 16;
    pub const START_UP: u32 = 32;
    pub const RECOVERING: u32 = 64;
    pub const EXTRAPOLATED: u32 = 128;
    pub const LONG_RUN: u32 = 256;
    pub const REST_MOVED: u32 = 512;

    /// The reading was not used.
    pub const NO_READING: u32 = MISSING | IMPLAUSIBLE | STUCK | REJECTED;

    /// Those of doubts.
    pub fn of(doubts: Flags) -> u32 {
        let bits = [
            (Flag::StartUp, START_UP),
            (Flag::Recovering, RECOVERING),
            (Flag::Extrapolated, EXTRAPOLATED),
            (Flag::LongRun, LONG_RUN),
            (Flag::RestMoved, REST_MOVED),
        ];
        bits.into_iter().fold(0, |all, (flag, bit)| if doubts.has(flag) { all | bit } else { all })
    }
}

/// What a twin is made of, whatever its precision.
#[derive(Clone, Copy)]
pub struct Parts<'a> {
    pub kind: EstimatorKind,
    /// Usual time between readings, s, and the longest step: longer times are divided.
    pub dt_s: f32,
    pub longest_step_s: f32,
    /// How long phases last, and whether the body rests; `None` for a filter without phases.
    pub phases: Option<PhaseParts>,
    pub limits: StrainRange<f32>,
    pub strain_sd_scale: f32,
    pub sieve: PortableSieve,
    /// Variance of a strain that is known at a start.
    pub start_variance: f32,
    /// A strain that is less is none.
    pub zero: f32,
    pub correction: Option<&'a PortableCorrection>,
    /// What stands for rows of the correction that were left out.
    pub quadratics: Option<&'a [Quadratic; 2]>,
    pub doubt: DoubtParts,
    pub rest: RestBounds,
}

/// Phases, as a file has them.
#[derive(Clone, Copy)]
pub struct PhaseParts {
    pub hold_time_s: f64,
    pub move_time_s: f64,
    pub reversal: f64,
    pub tempering: f64,
    pub rests: bool,
}

/// What depends on the length of a step: the kernel's numbers, then nine probabilities of the chain.
pub type Numbers<'a, T> = Box<dyn Fn(T) -> Vec<T> + 'a>;

/// A number of a file, as exactly as the precision can have it.
pub fn number<T: Real>(value: f64) -> T {
    T::of(value)
}

impl PhaseParts {
    /// Dwell times, and what weighs hypotheses.
    ///
    /// # Errors
    /// If single precision has no such numbers.
    pub fn filter_parts<T: Real>(&self, limits: StrainRange<T>) -> Result<(Dwell<T>, Evidence<T>), StepError> {
        let dwell = Dwell::new(number(self.hold_time_s), number(self.move_time_s), number(self.reversal));
        let evidence = Evidence::new(limits, number(self.tempering));
        // Checked when the file was read; single precision may still turn a number into zero.
        dwell.and_then(|dwell| Ok((dwell, evidence?))).map_err(|_| StepError::NonFiniteState)
    }
}
