//! Approximate cost of an exported filter on a Cortex-M4F: instructions per step, and memory.
//!
//! The state's size and the tables in flash are computed. Instructions, code and stack are sums over hypotheses, branches and
//! rows; the coefficients below are least-squares fits to the counts of `scripts/exported-c.sh` in QEMU for filters of all
//! kinds (arm-none-eabi-gcc 12.2, -O2 -fno-math-errno). That script checks in turn that no estimate is further than a tenth
//! from its count.

use ohmstrain_ekf::correction::{BLOCK, FEATURES, OUTPUTS, TIME_CONSTANTS_S};
use ohmstrain_model::Gauge;
use ohmstrain_sensor::{EstimatorKind, LawParams, PortableCorrection, SensorParams, with_sizes};
use serde::Serialize;

use super::fixed_rate::FixedRate;
use super::plan::{ChipFilter, Plan};
use super::vectors::{self, Work};
use super::{ExportError, too_many_branches};

/// Approximate cost of a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Cost {
    /// Instructions per step, with a reading, at the usual interval.
    pub instructions: usize,
    /// Code and constants, bytes.
    pub flash: usize,
    /// The state, bytes: exact, apart from the padding of another processor.
    pub state: usize,
    /// Stack of a step, bytes.
    pub stack: usize,
}

impl Cost {
    /// Returns the memory of a running filter, bytes.
    pub const fn ram(&self) -> usize {
        self.state + self.stack
    }
}

/// Cost of a kind of filter without a correction.
struct OfKind {
    /// Instructions per step; and per updated hypothesis, per branch of it, and for a curve with an exponential.
    step: f64,
    update: f64,
    update_branch: f64,
    curve: f64,
    /// Instructions per hypothesis predicted without a reading, and per branch of it.
    prediction: f64,
    prediction_branch: f64,
    /// Instructions per pair of one of these hypotheses and one that the filter keeps.
    pair: f64,
    /// Bytes of code and tables; and per branch.
    flash: f64,
    flash_branch: f64,
    /// Bytes of the stack; and per branch, per hypothesis, per branch of each hypothesis.
    stack: [f64; 4],
}

/// Costs of the extended Kalman filter. A prediction is taken to cost three quarters of a branch's step; that is not measured.
const EKF: OfKind = OfKind {
    step: 1637.0,
    update: 0.0,
    update_branch: 360.0,
    curve: 70.0,
    prediction: 0.0,
    prediction_branch: 266.0,
    pair: 0.0,
    flash: 14_450.0,
    flash_branch: 2900.0,
    stack: [695.0, 185.0, 0.0, 0.0],
};
/// Cost of the EKF on an AVR, as lists of operations (`arithmetic/listed.rs`): cycles in simavr and avr-gcc's -Os, by `scripts/exported-c.sh`.
const EKF_ON_AVR: OfKind = OfKind {
    step: 179_000.0,
    update: 0.0,
    update_branch: 68_000.0,
    curve: 2500.0,
    prediction: 0.0,
    prediction_branch: 0.0,
    pair: 0.0,
    flash: 16_200.0,
    flash_branch: 2450.0,
    stack: [736.0, 126.0, 0.0, 0.0],
};
/// Costs of the sign-split filter, its instructions from 18 filters of five sensors: one to three branches, two to eight hypotheses, steps of
/// 0.01 to 0.2 s; estimates are 9 % low to 13 % high. Merging two hypotheses costs less than their share of the cost of eight, hence the
/// step's negative number.
const SIGN_SPLIT: OfKind = OfKind {
    step: -1680.0,
    update: 3050.0,
    update_branch: 1080.0,
    curve: 78.0,
    prediction: 3070.0,
    prediction_branch: 776.0,
    pair: 0.0,
    flash: 19_500.0,
    flash_branch: 7750.0,
    stack: [1120.0, 191.0, 48.0, 56.0],
};
/// Costs of the filter of phase histories, its instructions from 23 filters of six sensors in the same way; estimates are 7 % low to 8 % high.
const HISTORIES: OfKind = OfKind {
    step: 1730.0,
    update: 2030.0,
    update_branch: 662.0,
    curve: -234.0,
    prediction: 1590.0,
    prediction_branch: 531.0,
    pair: 72.0,
    flash: 17_600.0,
    flash_branch: 5000.0,
    stack: [1130.0, 154.0, 66.0, 49.0],
};

/// Instructions of a correction per row, per simulated row, per entry of the two triangles, and for its quadratic functions.
const ROW: f64 = 183.0;
const SIMULATED_ROW: f64 = 84.0;
const ENTRY: f64 = 8.4;
const QUADRATIC: f64 = 1930.0;
/// Bytes of code of a correction and of its quadratic functions; bytes of the stack.
const CORRECTION_CODE: f64 = 3790.0;
const QUADRATIC_CODE: f64 = 2000.0;
const SIMULATED_CODE: f64 = 400.0;
const CORRECTION_STACK: f64 = 270.0;

const FLOAT: usize = 4;

/// Arithmetic of a processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Processor {
    /// Single precision in hardware, as in a Cortex-M4F.
    Single,
    /// 32 bits, floating point in software, as in a Cortex-M0+.
    Software,
    /// 8 bits, floating point in software.
    Avr,
}

/// Ratios of costs on a processor to those on a Cortex-M4F.
struct Times {
    /// Instructions of an extended Kalman filter, of hypotheses, and of either with a correction.
    instructions: [f64; 3],
    /// Code and constants.
    flash: f64,
}

impl Processor {
    /// Returns the factors from docs/costs.md, the largest for each kind. On an AVR an extended Kalman filter took 236 403 cycles in simavr,
    /// on the Cortex-M4F 1898 instructions; for others the ratio to a Cortex-M0+ is assumed to be the same.
    const fn times(self) -> Times {
        match self {
            Self::Single => Times { instructions: [1.0; 3], flash: 1.0 },
            Self::Software => Times { instructions: [33.7, 39.3, 48.2], flash: 1.22 },
            Self::Avr => Times { instructions: [125.0, 146.0, 179.0], flash: 3.1 },
        }
    }
}

impl Cost {
    /// Returns the cost of the same filter on another processor than a Cortex-M4F.
    #[must_use]
    pub fn on(self, processor: Processor, law: &LawParams, chip: &ChipFilter) -> Self {
        if processor == Processor::Avr && chip.filter.kind == EstimatorKind::Ekf && chip.filter.correction.is_none() {
            // It keeps no state for the end of a fault.
            let state = state(law.branches.len(), chip, 1);
            return Self { state, ..Self::of_kind(&EKF_ON_AVR, law, chip, Work { updated: 1.0, predicted: 0.0 }) };
        }
        let Times { instructions, flash } = processor.times();
        let kind = match (chip.filter.kind, &chip.filter.correction) {
            (_, Some(_)) => 2,
            (EstimatorKind::Ekf, None) => 0,
            _ => 1,
        };
        let times = |number: usize, by: f64| (number as f64 * by).round() as usize;
        Self { instructions: times(self.instructions, instructions[kind]), flash: times(self.flash, flash), ..self }
    }

    /// Returns the cost of a filter with this law and this work per step.
    pub fn of(law: &LawParams, chip: &ChipFilter, work: Work) -> Self {
        let kind = match chip.filter.kind {
            EstimatorKind::SignSplit => &SIGN_SPLIT,
            EstimatorKind::Hypotheses => &HISTORIES,
            _ => &EKF,
        };
        Self::of_kind(kind, law, chip, work)
    }

    fn of_kind(kind: &OfKind, law: &LawParams, chip: &ChipFilter, work: Work) -> Self {
        let ChipFilter { filter, quadratics } = chip;
        let branches = law.branches.len() as f64;
        let curve = if matches!(law.gauge, Gauge::Polynomial { .. }) { 0.0 } else { kind.curve };
        let update = kind.update + kind.update_branch * branches + curve;
        let prediction = kind.prediction + kind.prediction_branch * branches;
        let mut flash = kind.flash + kind.flash_branch * branches;
        let hypotheses = if filter.kind == EstimatorKind::Ekf { 0.0 } else { filter.hypotheses as f64 };
        let pairs = (work.updated + work.predicted) * hypotheses;
        let mut instructions = kind.step + work.updated * update + work.predicted * prediction + kind.pair * pairs;
        let of_stack = [1.0, branches, hypotheses, hypotheses * branches];
        let mut stack: f64 = kind.stack.iter().zip(of_stack).map(|(bytes, count)| bytes * count).sum();
        if let Some(PortableCorrection { learned, .. }) = &filter.correction {
            let (rows, stripes) = (learned.rows.len() as f64, learned.direct.explained.columns());
            let entries = (BLOCK * stripes.len()) as f64;
            instructions += ROW * rows + ENTRY * entries;
            let inputs = (OUTPUTS + FEATURES) as f64;
            // Per row the inputs and two weights; two triangles; per input four numbers of its scale and two relevances.
            flash += CORRECTION_CODE + FLOAT as f64 * ((inputs + 2.0) * rows + 2.0 * entries + 6.0 * inputs);
            stack += CORRECTION_STACK;
            if let Some(simulated) = &learned.simulated {
                let rows = simulated.rows.len() as f64;
                instructions += SIMULATED_ROW * rows;
                // Per row the features and a weight; per feature both ends of its range.
                flash += SIMULATED_CODE + FLOAT as f64 * ((FEATURES as f64 + 1.0) * rows + 2.0 * FEATURES as f64);
            }
        }
        if quadratics.is_some() {
            instructions += QUADRATIC;
            flash += QUADRATIC_CODE;
        }
        let [instructions, flash, stack] = [instructions, flash, stack].map(|x: f64| x.round() as usize);
        Self { instructions, flash, state: state(law.branches.len(), chip, 2), stack }
    }
}

/// Computes the cost of a sensor's filter, with its work counted over the motion of the self-test.
///
/// # Errors
/// If it has no exported form.
pub fn cost(params: &SensorParams, plan: &Plan, dt_s: f64) -> Result<Cost, ExportError> {
    cost_of(params, &ChipFilter::new(params, plan)?, dt_s)
}

/// Computes the cost of a given filter.
pub fn cost_of(params: &SensorParams, chip: &ChipFilter, dt_s: f64) -> Result<Cost, ExportError> {
    let work = with_sizes!(params.law.branches.len(), B, N, L => work_of::<B, N, L>(params, chip, dt_s));
    let work = work.unwrap_or_else(|| Err(too_many_branches()))?;
    Ok(Cost::of(&params.law, chip, work))
}

fn work_of<const B: usize, const N: usize, const L: usize>(
    params: &SensorParams,
    chip: &ChipFilter,
    dt_s: f64,
) -> Result<Work, ExportError> {
    vectors::work::<B, N, L>(&FixedRate::<B, N>::new::<L>(params, chip, dt_s as f32)?)
}

/// Returns the size of `ohmstrain_state`, bytes, with `copies` of what the filter knows.
fn state(branches: usize, chip: &ChipFilter, copies: usize) -> usize {
    let filter = &chip.filter;
    let states = branches + 3;
    let gaussian = states + states * (states + 1) / 2;
    // Weight, probability within the limits, phase; the number of hypotheses; for sign-split a pause and a flag.
    let words = match filter.kind {
        EstimatorKind::SignSplit => filter.hypotheses * (gaussian + 3) + 3,
        EstimatorKind::Hypotheses => filter.hypotheses * (gaussian + 3) + 1,
        _ => gaussian,
    };
    // Readings and doubts: thirty-five words; for a correction four, low-pass filters and features. A pause. In each copy; and
    // strain, rate, their variances, rest reading.
    let correction = filter.correction.as_ref().map_or(0, |_| 4 + TIME_CONSTANTS_S.len() + FEATURES);
    FLOAT * (copies * (words + 35 + correction + 2) + 5)
}
