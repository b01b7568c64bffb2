//! The learned correction in the form that the templates take.

use ohmstrain_ekf::correction::{Decay, FILTER_INPUTS, TIME_CONSTANTS_S};
use ohmstrain_sensor::PortableCorrection;
use ohmstrain_sensor::correction::{OwnedProcess, OwnedRows, OwnedSimulated};
use serde::Serialize;

use super::literal::Literal;
use super::quadratic::OwnedQuadratic;

/// Rows, weights and scales.
#[derive(Debug, Serialize)]
pub struct CorrectionConstants {
    centre: Literal,
    half_range: Literal,
    rates: [Literal; 2],
    /// Offset and slope of each low-pass filter's start.
    starts: Vec<[Literal; 2]>,
    time_constants_s: Vec<Literal>,
    /// Decay of the low-pass filters over the usual time between readings, and the mean over it.
    decays: Vec<Literal>,
    mean_decays: Vec<Literal>,
    rows: RowConstants,
    mean: Vec<Literal>,
    /// Standard deviation; `None` for a constant input: infinite.
    sd: Vec<Option<Literal>>,
    lower: Vec<Literal>,
    upper: Vec<Literal>,
    inducing: usize,
    processes: [ProcessConstants; 2],
    quadratics: Option<[OwnedQuadratic<Literal>; 2]>,
    simulated: Option<SimulatedConstants>,
    strain_variance: Literal,
    variance_factor: Literal,
}

/// Rows in order for C, and in blocks for Rust.
#[derive(Debug, Serialize)]
struct RowConstants {
    count: usize,
    one_by_one: Vec<Vec<Literal>>,
    blocks: Vec<Vec<Vec<Literal>>>,
}

impl RowConstants {
    fn new(rows: &OwnedRows<f64, FILTER_INPUTS>) -> Self {
        Self {
            count: rows.len(),
            one_by_one: rows.iter().map(narrowed).collect(),
            blocks: rows.blocks().iter().map(|block| block.iter().map(narrowed).collect()).collect(),
        }
    }
}

/// A Gaussian process.
#[derive(Debug, Serialize)]
struct ProcessConstants {
    name: &'static str,
    comment: &'static str,
    relevance: Vec<Literal>,
    mean: Literal,
    variance: Literal,
    noise: Literal,
    widening: Literal,
    least_variance: Literal,
    weights: Vec<Literal>,
    /// Stripes of four rows, stored column by column.
    explained: Vec<Vec<Literal>>,
}

/// The process of simulated rows.
#[derive(Debug, Serialize)]
struct SimulatedConstants {
    rows: RowConstants,
    lower: Vec<Literal>,
    upper: Vec<Literal>,
    process: ProcessConstants,
}

impl SimulatedConstants {
    fn new(of: &OwnedSimulated<f64, FILTER_INPUTS>) -> Self {
        let process = ProcessConstants::new("SIMULATED", "Strain from the features, as the law has it.", &of.process);
        Self {
            rows: RowConstants::new(&of.rows),
            lower: of.scales.iter().map(|scale| narrow(scale.lower)).collect(),
            upper: of.scales.iter().map(|scale| narrow(scale.upper)).collect(),
            process,
        }
    }
}

fn narrow(number: f64) -> Literal {
    Literal(number as f32)
}

fn narrowed<'a>(numbers: impl IntoIterator<Item = &'a f64>) -> Vec<Literal> {
    numbers.into_iter().copied().map(narrow).collect()
}

impl CorrectionConstants {
    /// Computes the constants of a correction.
    pub fn new(correction: &PortableCorrection, quadratics: Option<&[OwnedQuadratic; 2]>, dt_s: f32) -> Self {
        let PortableCorrection { features, learned } = correction;
        let scales = &learned.scales;
        let decays = TIME_CONSTANTS_S.map(|tau_s| Decay::over(dt_s, tau_s as f32));
        Self {
            centre: narrow(features.centre),
            half_range: narrow(features.half_range),
            rates: features.rates.map(narrow),
            starts: features.starts.iter().map(|start| start.map(narrow)).collect(),
            time_constants_s: narrowed(&TIME_CONSTANTS_S),
            decays: decays.iter().map(|decay| Literal(decay.end)).collect(),
            mean_decays: decays.iter().map(|decay| Literal(decay.mean)).collect(),
            rows: RowConstants::new(&learned.rows),
            mean: scales.iter().map(|scale| narrow(scale.mean)).collect(),
            sd: scales.iter().map(|scale| Some(narrow(scale.sd)).filter(|sd| sd.0.is_finite())).collect(),
            lower: scales.iter().map(|scale| narrow(scale.lower)).collect(),
            upper: scales.iter().map(|scale| narrow(scale.upper)).collect(),
            inducing: learned.direct.explained.side(),
            processes: [
                ProcessConstants::new("DIRECT", "Strain from the features.", &learned.direct),
                ProcessConstants::new("RESIDUAL", "Error of the filter's strain, from all inputs.", &learned.residual),
            ],
            quadratics: quadratics.map(|both| both.each_ref().map(|one| one.map(narrow))),
            simulated: learned.simulated.as_ref().map(SimulatedConstants::new),
            strain_variance: narrow(learned.strain_variance),
            variance_factor: narrow(learned.variance_factor),
        }
    }
}

impl ProcessConstants {
    fn new(name: &'static str, comment: &'static str, process: &OwnedProcess<f64, FILTER_INPUTS>) -> Self {
        let numbers = &process.numbers;
        Self {
            name,
            comment,
            relevance: narrowed(&numbers.relevance),
            mean: narrow(numbers.mean),
            variance: narrow(numbers.variance),
            noise: narrow(numbers.noise),
            widening: narrow(numbers.widening),
            least_variance: narrow(numbers.least_variance),
            weights: narrowed(&process.weights),
            explained: process.explained.columns().iter().map(narrowed).collect(),
        }
    }
}
