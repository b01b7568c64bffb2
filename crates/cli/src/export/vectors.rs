//! What the Rust filters make of a short motion: what the exported filter must make of it too.

use ohmstrain_ekf::{Belief, Compact, Reading, SparseEkf, StepError};
use serde::Serialize;

use super::ExportError;
use super::constants::FixedRate;
use super::literal::Literal;
use super::motion;
use super::settled::Settled;
use crate::report::number;

/// Readings and results, and how far other results may be off.
#[derive(Debug, Serialize)]
pub struct Vectors {
    seed: u64,
    ulp: Literal,
    /// Where only expf may differ, and where products may be contracted.
    tolerance_ulp: u64,
    contracted_tolerance_ulp: u64,
    /// Root mean squared errors of the strain in the same motion at the calibration's speed, both filters.
    ekf_error: String,
    fixed_error: String,
    rows: Vec<Vector>,
}

/// One row.
#[derive(Debug, Serialize)]
struct Vector {
    reading: Option<Literal>,
    reading_sd: Literal,
    strain: Literal,
    strain_sd: Literal,
    fixed: Literal,
}

/// A row as the microcontroller gets it.
#[derive(Clone, Copy)]
struct Input {
    true_strain: f64,
    reading: Option<f32>,
    reading_sd: f32,
}

/// Spacings of `f32` at 1 by which a predicted reading may be off in each step, as the exported file says: where only expf
/// differs, and where products are contracted.
const SPACINGS: [f32; 2] = [2.0, 12.0];
/// Deviations of the sum of all these that are allowed.
const DEVIATIONS: f32 = 6.0;
/// By how much a relative reading is moved to see how the strain follows: far above the rounding of `f32`, far below the
/// law's bends.
const NUDGE: f32 = 1e-3;

impl Vectors {
    /// Runs the filters.
    pub fn new<const B: usize, const N: usize, const L: usize>(
        sensor: &FixedRate<B, N>,
        settled: &Settled<B, N, L>,
    ) -> Result<Self, ExportError> {
        let inputs = readings(sensor, 1);
        let ekf = |nudged| run_ekf::<B, N, L>(sensor, &inputs, nudged);
        let fixed = |nudged| run_fixed(sensor, settled, &inputs, nudged);
        let strains = |nudged| Ok(ekf(nudged)?.iter().map(|estimate| estimate.0).collect());
        let moved = sensitivity(&inputs, strains)?.max(sensitivity(&inputs, fixed)?);
        let (estimates, fixed) = (ekf(None)?, fixed(None)?);
        let largest = sensor.limits.lower.abs().max(sensor.limits.upper.abs());
        let ulp = largest.next_up() - largest;
        let tolerance = |spacings: f32| (DEVIATIONS * spacings * f32::EPSILON * moved / ulp).ceil() as u64;
        let row = |((input, estimate), fixed): ((&Input, &(f32, f32)), &f32)| Vector {
            reading: input.reading.map(Literal),
            reading_sd: Literal(input.reading_sd),
            strain: Literal(estimate.0),
            strain_sd: Literal(estimate.1),
            fixed: Literal(*fixed),
        };
        let exact = sensor.is_exact();
        let speed = sensor.model.motion().stationary_variance()[1].sqrt();
        let slow = readings(sensor, motion::slowness(&sensor.law, f64::from(sensor.dt_s), f64::from(speed)));
        Ok(Self {
            seed: motion::SEED,
            ulp: Literal(ulp),
            tolerance_ulp: if exact { 0 } else { tolerance(SPACINGS[0]) },
            contracted_tolerance_ulp: tolerance(SPACINGS[1]),
            ekf_error: error(&slow, run_ekf::<B, N, L>(sensor, &slow, None)?.iter().map(|estimate| estimate.0)),
            fixed_error: error(&slow, run_fixed(sensor, settled, &slow, None)?.iter().copied()),
            rows: inputs.iter().zip(&estimates).zip(&fixed).map(row).collect(),
        })
    }
}

/// The readings of a motion so many times slower, in the sensor's unit.
fn readings<const B: usize, const N: usize>(sensor: &FixedRate<B, N>, slowness: usize) -> Vec<Input> {
    let rest = f64::from(sensor.rest_reading);
    let input = |row: motion::Row| Input {
        true_strain: row.strain,
        reading: row.rho.map(|rho| (rest * (1.0 + rho)) as f32),
        reading_sd: (rest * row.extra_sd) as f32,
    };
    let reading_sd = f64::from(sensor.model.noise().reading_sd);
    motion::rows(&sensor.law, f64::from(sensor.dt_s), reading_sd, slowness).into_iter().map(input).collect()
}

/// A row relative to R₀, computed as on the microcontroller.
fn relative(rest_reading: f32, row: usize, input: &Input, nudged: Option<usize>) -> Option<Reading<f32>> {
    let nudge = if nudged == Some(row) { NUDGE } else { 0.0 };
    let sd = input.reading_sd / rest_reading;
    let relative = |reading: f32| (reading - rest_reading) / rest_reading + nudge;
    input.reading.map(|reading| Reading { value: relative(reading), extra_variance: sd * sd })
}

/// Mean strain and reported standard deviation, row by row.
fn run_ekf<const B: usize, const N: usize, const L: usize>(
    sensor: &FixedRate<B, N>,
    inputs: &[Input],
    nudged: Option<usize>,
) -> Result<Vec<(f32, f32)>, ExportError> {
    let filter: SparseEkf<f32, Compact, B, N> = SparseEkf::new(sensor.model, sensor.dt_s).map_err(refused)?;
    let mut belief: Belief<f32, N, L> = Belief::initial(&sensor.model);
    let estimate = |(row, input): (usize, &Input)| {
        filter.step(&mut belief, relative(sensor.rest_reading, row, input, nudged)).map_err(refused)?;
        Ok((belief.mean[0], sensor.strain_sd_scale * belief.covariance[(0, 0)].sqrt()))
    };
    inputs.iter().enumerate().map(estimate).collect()
}

/// Mean strain of the filter with fixed gains, row by row.
fn run_fixed<const B: usize, const N: usize, const L: usize>(
    sensor: &FixedRate<B, N>,
    settled: &Settled<B, N, L>,
    inputs: &[Input],
    nudged: Option<usize>,
) -> Result<Vec<f32>, ExportError> {
    let mut mean = settled.start();
    let estimate = |(row, input): (usize, &Input)| {
        let reading = relative(sensor.rest_reading, row, input, nudged).map(|reading| reading.value);
        mean = settled.step(&mean, reading)?;
        Ok(mean[0])
    };
    inputs.iter().enumerate().map(estimate).collect()
}

/// Root of the sum of squares of |d strain / d reading| over all readings, in the row where it is largest.
fn sensitivity(
    inputs: &[Input],
    run: impl Fn(Option<usize>) -> Result<Vec<f32>, ExportError>,
) -> Result<f32, ExportError> {
    let plain = run(None)?;
    let mut squares = vec![0.0; plain.len()];
    for row in 0..inputs.len() {
        for (sum, (strain, plain)) in squares.iter_mut().zip(run(Some(row))?.iter().zip(&plain)) {
            *sum += ((strain - plain) / NUDGE).powi(2);
        }
    }
    Ok(squares.into_iter().fold(0.0, f32::max).sqrt())
}

/// Root mean squared error of the strain, two significant digits.
fn error(inputs: &[Input], strains: impl Iterator<Item = f32>) -> String {
    let squares = inputs.iter().zip(strains).map(|(input, strain)| (f64::from(strain) - input.true_strain).powi(2));
    number::significant((squares.sum::<f64>() / inputs.len() as f64).sqrt(), 2)
}

fn refused(error: StepError) -> ExportError {
    ExportError::Parameter(format!("the filter refuses the law's own readings: {error}"))
}
