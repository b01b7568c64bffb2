//! Values for the templates: a sensor's filter in `f32`, for steps of one length.

mod kernel;
mod readings;

use ohmstrain_ekf::Belief;
use ohmstrain_ekf::live::{BESIDE_SHARE, DOUBT, FARTHEST_REST, KNOWN_BEYOND, LiveParts, StaticCurve};
use ohmstrain_sensor::{EstimatorKind, PortableFilter, Quantity, ReadingUnit, SensorParams, with_sizes};
use serde::Serialize;

use super::arithmetic::{Around, Lists};
use super::correction::CorrectionConstants;
use super::cost::Cost;
use super::fixed_rate::FixedRate;
use super::law::{LawConstants, NoiseConstants, PhaseConstants, PriorConstants};
use super::literal::{Literal, literals};
use super::plan::{ChipFilter, Plan};
use super::vectors::Vectors;
use super::{ExportError, too_many_branches};
use kernel::{Recorded, SharedConstants, StepConstants};
use readings::{DoubtConstants, FollowConstants, SieveConstants, TemperatureConstants};

/// A sensor in the form that the templates take.
#[derive(Debug, Serialize)]
pub struct Exported {
    made_by: String,
    version: &'static str,
    quantity: &'static str,
    quantity_unit: &'static str,
    reading_name: &'static str,
    reading_unit: &'static str,
    /// Column of a trace with the readings.
    reading_column: &'static str,
    joint: bool,
    dt_s: Literal,
    dt_us: u64,
    dt_ms: f64,
    rest_reading: Literal,
    /// Resistance at rest in calibration, or by the law if the sensor was not rested then (`has_rested`), and the factor by
    /// which today's may differ.
    rested: Literal,
    has_rested: bool,
    farthest_rest: Literal,
    /// True if zero is a strain within its limits.
    rests_at_zero: bool,
    lower: Literal,
    upper: Literal,
    strain_sd_scale: Literal,
    states: usize,
    branches: usize,
    estimator: EstimatorText,
    /// True if hypotheses are split by the sign of the rate, and if the body rests.
    splits: bool,
    rests: bool,
    start_mean: Vec<Literal>,
    start_variance: Vec<Literal>,
    /// Variance of a known initial strain, and its tolerance beyond the limits.
    known_variance: Literal,
    known_beyond: Literal,
    reading_variance: Literal,
    /// Weight of the second hypothesis of a second look.
    beside_share: Literal,
    sieve: SieveConstants,
    doubt: DoubtConstants,
    follow: FollowConstants,
    /// Effect of temperature; `None` if the sensor has none.
    temperature: Option<TemperatureConstants>,
    steps: StepConstants,
    fresh_mean: Vec<Literal>,
    fresh_variance: Vec<Literal>,
    /// Factor on the exponent of a likelihood; `None` without tempering.
    tempering: Option<Literal>,
    /// `None` if the direction is never left open.
    forgets_s: Option<Literal>,
    limits: SharedConstants,
    /// Static cubic; `None` if the filter gives the strain.
    curve: Option<CurveConstants>,
    correction: Option<CorrectionConstants>,
    /// The kernel as functions in C, and the functions around it.
    arithmetic: String,
    around: String,
    /// Constants of the lists of operations; `None` without lists.
    lists: Option<ListConstants>,
    /// State from step to step, as C declares it.
    fields: Vec<String>,
    /// Plan of the filter in words, and its approximate cost.
    words: String,
    /// True if it is reduced against the filter on a computer.
    is_smaller: bool,
    /// Flag of `serial-check` for an estimator that is not the default.
    check_flag: String,
    /// Promises and scores, line by line.
    promise: Vec<String>,
    cost: Cost,
    law: LawConstants,
    noise: NoiseConstants,
    prior: PriorConstants,
    phases: Option<PhaseConstants>,
    vectors: Vectors,
}

/// Registers, names and cases of operations, for `templates/listed.c`.
#[derive(Debug, Serialize)]
struct ListConstants {
    registers: usize,
    names: Vec<&'static str>,
    cases: Vec<String>,
}

impl ListConstants {
    fn new(lists: &Lists) -> Self {
        Self { registers: lists.registers(), names: lists.names(), cases: lists.cases() }
    }
}

/// Numbers of the static cubic.
#[derive(Debug, Serialize)]
struct CurveConstants {
    centre: Literal,
    half_range: Literal,
    coefficients: [Literal; 4],
    lower: Literal,
    upper: Literal,
    variance: Literal,
}

impl CurveConstants {
    fn new(curve: &StaticCurve<f32>) -> Self {
        Self {
            centre: Literal(curve.centre),
            half_range: Literal(curve.half_range),
            coefficients: curve.coefficients.map(Literal),
            lower: Literal(curve.range.lower),
            upper: Literal(curve.range.upper),
            variance: Literal(curve.variance),
        }
    }
}

/// Names of the filter.
#[derive(Debug, Serialize)]
struct EstimatorText {
    /// Name at the start of a sentence, in prose, and on the command line.
    title: &'static str,
    prose: &'static str,
    name: &'static str,
    /// Its type in Rust.
    rust: String,
    /// Number of hypotheses; 0 for a single Gaussian.
    hypotheses: usize,
}

impl Exported {
    /// Checks that the sensor has an exported form and computes all of it. `plan` selects the filter and its parts.
    ///
    /// # Errors
    /// See [`ExportError`].
    pub fn new(
        params: &SensorParams,
        plan: &Plan,
        made_by: &str,
        dt_s: f64,
        promise: &[String],
    ) -> Result<Self, ExportError> {
        let filter = ChipFilter::new(params, plan)?;
        let of_size =
            with_sizes!(params.law.branches.len(), B, N, L => Self::of::<B, N, L>(params, &filter, made_by, dt_s));
        let mut exported = of_size.unwrap_or_else(|| Err(too_many_branches()))?;
        exported.promise = promise.to_vec();
        exported.check_flag = match plan {
            Plan { rows: Some(_), .. } | Plan { hypotheses: Some(_), .. } => " --budget BUDGET".to_owned(),
            Plan { kind: Some(kind), .. } => format!(" --estimator {}", kind.name()),
            Plan { kind: None, .. } => String::new(),
        };
        Ok(exported)
    }

    fn of<const B: usize, const N: usize, const L: usize>(
        params: &SensorParams,
        chip: &ChipFilter,
        made_by: &str,
        dt_s: f64,
    ) -> Result<Self, ExportError> {
        let sensor = FixedRate::<B, N>::new::<L>(params, chip, dt_s as f32)?;
        let filter = &chip.filter;
        let live = sensor.narrow();
        let LiveParts { strain_sd_scale, limits, reading_variance, .. } = live;
        // Chips without room for compiled functions have no room for hypotheses and corrections either.
        let is_small = filter.kind == EstimatorKind::Ekf && filter.correction.is_none();
        let mut lists = Lists::default();
        let recorded = Recorded::new(&sensor, is_small.then_some(&mut lists))?;
        let steps = StepConstants::new(&sensor, &recorded);
        let Recorded { arithmetic, numbers, .. } = recorded;
        let model = &sensor.model;
        let start: Belief<f32, N, L> = Belief::initial(model);
        let around = Around { parts: &sensor.parts };
        let finite = |number: f32| number.is_finite().then_some(Literal(number));
        let around_filter = around.text(is_small.then_some(&mut lists));
        let vectors = Vectors::new::<B, N, L>(&sensor)?;
        let exported = Self {
            made_by: made_by.into(),
            version: env!("CARGO_PKG_VERSION"),
            quantity: if params.quantity == Quantity::AngleDeg { "angle" } else { "strain" },
            quantity_unit: if params.quantity == Quantity::AngleDeg { ", degrees" } else { "" },
            reading_name: if params.reading == ReadingUnit::Ohm { "resistance" } else { "resistance ratio" },
            reading_unit: if params.reading == ReadingUnit::Ohm { "ohm" } else { "a ratio" },
            reading_column: if params.reading == ReadingUnit::Ohm { "resistance_ohm" } else { "resistance_ratio" },
            joint: params.joint.is_some(),
            dt_s: Literal(live.dt_s),
            dt_us: (dt_s * 1e6).round() as u64,
            dt_ms: (dt_s * 1e6).round() / 1e3,
            rest_reading: Literal(live.rest_reading),
            rested: Literal(live.rested),
            has_rested: params.measured_rest.is_some(),
            farthest_rest: Literal(FARTHEST_REST as f32),
            rests_at_zero: sensor.rests_at_zero(),
            lower: Literal(limits.lower),
            upper: Literal(limits.upper),
            strain_sd_scale: Literal(strain_sd_scale),
            states: N,
            branches: B,
            estimator: EstimatorText::new(filter, B, N),
            splits: filter.kind == EstimatorKind::SignSplit,
            rests: filter.estimator.phases.is_some_and(|phases| phases.rests()),
            start_mean: literals(start.mean.iter()),
            start_variance: (0..N).map(|i| Literal(start.covariance[(i, i)])).collect(),
            known_variance: Literal(live.known_variance),
            known_beyond: Literal((KNOWN_BEYOND * params.limits.span()) as f32),
            reading_variance: Literal(reading_variance),
            beside_share: Literal(BESIDE_SHARE as f32),
            sieve: SieveConstants::new(&live.sieve),
            follow: FollowConstants::new(live.rest),
            temperature: params.temperature.map(TemperatureConstants::new),
            doubt: DoubtConstants::new(&live.doubt, Literal((DOUBT.zero * params.limits.span()) as f32)),
            steps,
            fresh_mean: numbers.fresh.iter().map(|rate| Literal(rate.mean)).collect(),
            fresh_variance: numbers.fresh.iter().map(|rate| Literal(rate.variance)).collect(),
            tempering: (numbers.tempering != 1.0).then_some(Literal(-0.5 * numbers.tempering)),
            forgets_s: finite(numbers.forgets_direction_s),
            limits: SharedConstants::new(),
            curve: sensor.parts.curve.map(|curve| CurveConstants::new(&curve.to())),
            correction: filter
                .correction
                .as_ref()
                .map(|correction| CorrectionConstants::new(correction, chip.quadratics.as_ref(), dt_s as f32)),
            arithmetic,
            around: around_filter,
            lists: is_small.then(|| ListConstants::new(&lists)),
            fields: around.fields(),
            words: chip.words(),
            is_smaller: chip.is_smaller(),
            check_flag: String::new(),
            promise: Vec::new(),
            cost: Cost::of(&params.law, chip, vectors.work),
            law: LawConstants::new(model.law()),
            noise: NoiseConstants::new(model.noise()),
            prior: PriorConstants::new(&filter.estimator.motion),
            phases: filter.estimator.phases.as_ref().map(PhaseConstants::new),
            vectors,
        };
        exported.check_finite()?;
        Ok(exported)
    }

    /// Refuses literals that are not finite, which would not compile, or worse.
    fn check_finite(&self) -> Result<(), ExportError> {
        let scalars =
            [self.rest_reading, self.rested, self.lower, self.upper, self.strain_sd_scale, self.reading_variance];
        let all = self.start_mean.iter().chain(&self.start_variance).chain(&scalars);
        match all.copied().find(|literal| !literal.0.is_finite()) {
            Some(literal) => Err(ExportError::Parameter(format!("a parameter is {:?} in single precision", literal.0))),
            None if !(self.rest_reading.0 > 0.0 && self.rested.0 > 0.0) => {
                Err(ExportError::Parameter("field `rest_reading`: vanishes in single precision".into()))
            }
            None => Ok(()),
        }
    }
}

impl EstimatorText {
    fn new(filter: &PortableFilter, branches: usize, states: usize) -> Self {
        let (title, prose, name) = match filter.kind {
            EstimatorKind::SignSplit => (
                "Filter of hypotheses about the sign of the rate",
                "filter of hypotheses about the sign of the rate (sign-split)",
                "SignSplit",
            ),
            EstimatorKind::Hypotheses => ("Filter of phase histories", "filter of phase histories", "Hypotheses"),
            _ if filter.curve.is_some() => (
                "Static cubic of the reading, beside an extended Kalman filter",
                "static cubic of the reading, beside an extended Kalman filter",
                "SparseEkf",
            ),
            _ => ("Extended Kalman filter", "extended Kalman filter", "SparseEkf"),
        };
        let hypotheses = if filter.kind == EstimatorKind::Ekf { 0 } else { filter.hypotheses };
        let rust = match hypotheses {
            0 => format!("{name}<f32, Compact, {branches}, {states}>"),
            _ => format!("{name}<f32, {branches}, {states}, {hypotheses}, Compact>"),
        };
        let estimator = match (&filter.correction, &filter.curve) {
            (Some(_), _) => EstimatorKind::Corrected,
            (None, Some(_)) => EstimatorKind::StaticCubic,
            (None, None) => filter.kind,
        };
        Self { title, prose, name: estimator.name(), rust, hypotheses }
    }
}
