//! What the templates show: a sensor's filter in `f32`, for steps of one length.

use ohmstrain::{DOUBT, KNOWN_BEYOND};
use ohmstrain_calib::{EstimatorKind, HISTORIES, HYPOTHESES, PortableFilter, Quantity, ReadingUnit, SensorParams};
use ohmstrain_ekf::record::{MixtureNumbers, shared};
use ohmstrain_ekf::{Belief, Compact, Gaussian, Hypotheses, SignSplit, SparseEkf};
use ohmstrain_model::TURNING;
use serde::Serialize;

use super::correction::CorrectionConstants;
use super::cost::Cost;
use super::doubt::DoubtParts;
use super::fixed_rate::FixedRate;
use super::law::{LawConstants, NoiseConstants, PhaseConstants, PriorConstants};
use super::literal::{Literal, literals};
use super::plan::{ChipFilter, Plan};
use super::twin::Parts;
use super::vectors::Vectors;
use super::{ExportError, arithmetic, parameter, too_many_branches};

/// A sensor as the templates have it.
#[derive(Debug, Serialize)]
pub struct Exported {
    made_by: String,
    version: &'static str,
    quantity: &'static str,
    quantity_unit: &'static str,
    reading_name: &'static str,
    reading_unit: &'static str,
    /// Column of a trace that the readings stand in.
    reading_column: &'static str,
    joint: bool,
    dt_s: Literal,
    dt_us: u64,
    dt_ms: f64,
    rest_reading: Literal,
    /// What the rested sensor read in calibration, and whether zero is a strain that it can have.
    rested: Literal,
    rests_at_zero: bool,
    lower: Literal,
    upper: Literal,
    strain_sd_scale: Literal,
    states: usize,
    branches: usize,
    estimator: EstimatorText,
    /// Whether hypotheses are split by the sign of the rate, and whether the body rests.
    splits: bool,
    rests: bool,
    start_mean: Vec<Literal>,
    start_variance: Vec<Literal>,
    /// Of a strain that is known at a start, and how far beyond the limits that may be.
    known_variance: Literal,
    known_beyond: Literal,
    reading_variance: Literal,
    sieve: SieveConstants,
    doubt: DoubtConstants,
    steps: StepConstants,
    fresh_mean: Vec<Literal>,
    fresh_variance: Vec<Literal>,
    /// What multiplies the exponent of a likelihood; `None` without tempering.
    tempering: Option<Literal>,
    /// `None` where the direction never is left open.
    forgets_s: Option<Literal>,
    clear_tail: Literal,
    hopeless: Literal,
    limits: SharedConstants,
    turning: TurningConstants,
    correction: Option<CorrectionConstants>,
    /// The kernel as functions in C.
    arithmetic: String,
    /// What is left of the filter, and about what it costs.
    words: String,
    /// Whether it is less than what a computer runs.
    is_smaller: bool,
    /// What was promised and scored, line by line.
    promise: Vec<String>,
    cost: Cost,
    law: LawConstants,
    noise: NoiseConstants,
    prior: PriorConstants,
    phases: Option<PhaseConstants>,
    vectors: Vectors,
}

/// How the filter is called.
#[derive(Debug, Serialize)]
struct EstimatorText {
    /// As a sentence begins, in prose, and on the command line.
    title: &'static str,
    prose: &'static str,
    name: &'static str,
    /// Its type in Rust.
    rust: String,
    /// How many hypotheses it follows; 0 for a single Gaussian.
    hypotheses: usize,
}

/// What a reading must be.
#[derive(Debug, Serialize)]
struct SieveConstants {
    lower: Literal,
    upper: Literal,
    longest_repeat_s: Option<Literal>,
    most_repeats: u32,
    error_time_s: Option<Literal>,
}

/// When the interval is wider than the filter says.
#[derive(Debug, Serialize)]
struct DoubtConstants {
    low: Literal,
    high: Literal,
    fastest_per_s: Literal,
    longest_s: Literal,
    per_reading: Literal,
    /// Variances.
    start: Literal,
    most: Literal,
    fades_s: Literal,
    outside_fades_s: Literal,
    margin: Literal,
    shows: Literal,
    faster: Literal,
    worth: Literal,
    zero: Literal,
    rest: Option<RestConstants>,
}

/// Where the sensor rests.
#[derive(Debug, Serialize)]
struct RestConstants {
    rested: Literal,
    tolerance: Literal,
    lasts_s: Literal,
    sign: Literal,
    end: Literal,
}

impl DoubtConstants {
    fn new(seen: &DoubtParts, zero: Literal) -> Self {
        let narrow = |number: f64| Literal(number as f32);
        Self {
            low: narrow(seen.low),
            high: narrow(seen.high),
            fastest_per_s: narrow(seen.fastest_per_s),
            longest_s: narrow(seen.longest_s),
            per_reading: narrow(seen.per_reading),
            start: narrow(seen.start),
            most: narrow(seen.most),
            fades_s: narrow(DOUBT.fades_s),
            outside_fades_s: narrow(DOUBT.outside_fades_s),
            margin: narrow(DOUBT.margin),
            shows: narrow(DOUBT.shows),
            faster: narrow(DOUBT.faster),
            worth: narrow(DOUBT.worth),
            zero,
            rest: seen.rest.map(|rest| RestConstants {
                rested: narrow(rest.rested),
                tolerance: narrow(rest.tolerance),
                lasts_s: narrow(rest.lasts_s),
                sign: narrow(rest.sign),
                end: narrow(rest.end),
            }),
        }
    }
}

/// What depends on the length of a step.
#[derive(Debug, Serialize)]
struct StepConstants {
    names: Vec<String>,
    usual_s: Literal,
    longest_s: Literal,
    usual: Vec<Literal>,
    lower_s: Literal,
    upper_s: Literal,
    nodes: Vec<Literal>,
    inverses: Vec<Literal>,
    rows: Vec<Vec<Literal>>,
    /// What is one over what.
    reciprocals: Vec<(String, String)>,
}

/// What is the same in all filters of hypotheses.
#[derive(Debug, Serialize)]
struct SharedConstants {
    alike: Literal,
    least_weight: Literal,
    not_lighter: Literal,
    least_inside: Literal,
    least_mass: Literal,
}

/// How often a rate turns around within a step.
#[derive(Debug, Serialize)]
struct TurningConstants {
    clear: Literal,
    normal_density: Literal,
    reach: Literal,
    even_excess: Literal,
    brownian_excess: Literal,
    brownian_variance: Literal,
}

impl Exported {
    /// Checks that the sensor has an exported form and computes all of it. `plan` says what of its filter.
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
        let mut exported = match params.law.branches.len() {
            0 => Self::of::<0, 3, 6>(params, &filter, made_by, dt_s),
            1 => Self::of::<1, 4, 10>(params, &filter, made_by, dt_s),
            2 => Self::of::<2, 5, 15>(params, &filter, made_by, dt_s),
            3 => Self::of::<3, 6, 21>(params, &filter, made_by, dt_s),
            4 => Self::of::<4, 7, 28>(params, &filter, made_by, dt_s),
            _ => Err(too_many_branches()),
        }?;
        exported.promise = promise.to_vec();
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
        let Parts { strain_sd_scale, limits, .. } = sensor.parts;
        let Recorded { arithmetic, numbers, names } = Recorded::new(&sensor)?;
        let model = &sensor.model;
        let start: Belief<f32, N, L> = Belief::initial(model);
        let reading_sd = model.noise().reading_sd;
        let finite = |number: f32| number.is_finite().then_some(Literal(number));
        let sieve = filter.readings;
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
            dt_s: Literal(sensor.parts.dt_s),
            dt_us: (dt_s * 1e6).round() as u64,
            dt_ms: (dt_s * 1e6).round() / 1e3,
            rest_reading: Literal(sensor.rest_reading),
            rested: Literal(sensor.rested),
            rests_at_zero: sensor.rested_strain().is_some(),
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
            known_variance: Literal(sensor.parts.start_variance),
            known_beyond: Literal((KNOWN_BEYOND * params.limits.span()) as f32),
            reading_variance: Literal(reading_sd * reading_sd),
            sieve: SieveConstants {
                lower: Literal(sieve.plausible.0 as f32),
                upper: Literal(sieve.plausible.1 as f32),
                longest_repeat_s: finite(sieve.longest_repeat_s as f32),
                most_repeats: sieve.most_repeats,
                error_time_s: Some(Literal(sieve.error_time_s as f32)).filter(|time_s| time_s.0 > 0.0),
            },
            doubt: DoubtConstants::new(&sensor.parts.doubt, Literal(sensor.parts.zero)),
            steps: StepConstants::new(&sensor, &names),
            fresh_mean: numbers.fresh.iter().map(|rate| Literal(rate.mean)).collect(),
            fresh_variance: numbers.fresh.iter().map(|rate| Literal(rate.variance)).collect(),
            tempering: (numbers.tempering != 1.0).then_some(Literal(-0.5 * numbers.tempering)),
            forgets_s: finite(numbers.forgets_direction_s),
            clear_tail: Literal(numbers.clear),
            hopeless: Literal(shared::HOPELESS_SQUARE),
            limits: SharedConstants {
                alike: Literal(shared::ALIKE_BELOW),
                least_weight: Literal(shared::LEAST_WEIGHT_KEPT),
                not_lighter: Literal(shared::NOT_LIGHTER),
                least_inside: Literal(shared::LEAST_INSIDE_LIMITS),
                least_mass: Literal(shared::LEAST_MASS_LEFT),
            },
            turning: TurningConstants {
                clear: Literal(shared::TURNING_CLEAR_SQUARE),
                normal_density: Literal(TURNING.normal_density as f32),
                reach: Literal(TURNING.reach as f32),
                even_excess: Literal(TURNING.even_excess as f32),
                brownian_excess: Literal(TURNING.brownian.0 as f32),
                brownian_variance: Literal(TURNING.brownian.1 as f32),
            },
            correction: filter
                .correction
                .as_ref()
                .map(|correction| CorrectionConstants::new(correction, chip.quadratics.as_ref(), dt_s as f32)),
            arithmetic,
            words: chip.words(),
            is_smaller: chip.is_smaller(),
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

    /// A literal that is no number would not compile, or worse.
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

impl StepConstants {
    fn new<const B: usize, const N: usize>(sensor: &FixedRate<'_, B, N>, names: &[String]) -> Self {
        let table = &sensor.table;
        let narrow = |numbers: &[f64]| numbers.iter().map(|x| Literal(*x as f32)).collect();
        Self {
            names: names.to_vec(),
            usual_s: Literal(sensor.usual_step_s()),
            longest_s: Literal(sensor.parts.longest_step_s),
            usual: literals(&sensor.usual_numbers()),
            lower_s: Literal(table.range.0 as f32),
            upper_s: Literal(table.range.1 as f32),
            nodes: narrow(&table.nodes),
            inverses: narrow(&table.inverses),
            rows: table.rows.iter().map(|row| narrow(row)).collect(),
            reciprocals: table.reciprocals.iter().map(|(at, of)| (names[*at].clone(), names[*of].clone())).collect(),
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
            _ => ("Extended Kalman filter", "extended Kalman filter", "SparseEkf"),
        };
        let hypotheses = if filter.kind == EstimatorKind::Ekf { 0 } else { filter.hypotheses };
        let rust = match hypotheses {
            0 => format!("{name}<f32, Compact, {branches}, {states}>"),
            _ => format!("{name}<f32, {branches}, {states}, {hypotheses}, Compact>"),
        };
        let estimator = if filter.correction.is_some() { EstimatorKind::Corrected } else { filter.kind };
        Self { title, prose, name: estimator.name(), rust, hypotheses }
    }
}

/// What the filter in single precision says of itself.
struct Recorded {
    arithmetic: String,
    numbers: MixtureNumbers,
    /// Of what depends on the length of a step, as C has them.
    names: Vec<String>,
}

impl Recorded {
    fn new<const B: usize, const N: usize>(sensor: &FixedRate<'_, B, N>) -> Result<Self, ExportError> {
        let kernel: SparseEkf<f32, Compact, B, N> =
            SparseEkf::new(sensor.model, sensor.usual_step_s()).map_err(parameter)?;
        let names: Vec<String> = kernel.step_names().iter().map(|name| name.to_uppercase()).collect();
        let carried = SparseEkf::<f32, Compact, B, N>::carried();
        let none = MixtureNumbers {
            fresh: [Gaussian { mean: 0.0, variance: 0.0 }; 3],
            tempering: 1.0,
            clear: 0.0,
            forgets_direction_s: f32::INFINITY,
        };
        let record = |piece| kernel.record(piece);
        let Some(phases) = sensor.parts.phases else {
            return Ok(Self { arithmetic: arithmetic::of_ekf(carried, &names, record), numbers: none, names });
        };
        let (dwell, evidence) = phases.filter_parts(sensor.parts.limits).map_err(parameter)?;
        let splits = sensor.parts.kind == EstimatorKind::SignSplit;
        let numbers = if splits {
            SignSplit::<_, B, N, HYPOTHESES, _>::around(kernel, phases.rests.then_some(dwell), evidence).numbers()
        } else {
            Hypotheses::<_, B, N, HISTORIES, _>::around(kernel, dwell, evidence).numbers()
        };
        Ok(Self { arithmetic: arithmetic::of_hypotheses(splits, carried, &names, record), numbers, names })
    }
}
