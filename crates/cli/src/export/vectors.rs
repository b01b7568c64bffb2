//! What the Rust filters make of a short motion: what the exported filter must make of it too.

use ohmstrain_ekf::{Belief, Compact, Reading, SparseEkf, StepError};
use ohmstrain_model::{Gauge, Scalar, StrainRange, SwitchedModel};
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
    fixed_tolerance_ulp: u64,
    contracted_tolerance_ulp: u64,
    contracted_fixed_tolerance_ulp: u64,
    /// What multiplies expf in the gauge, at most.
    expf_factor: String,
    /// Root mean squared errors of the strain in the same motion at the calibration's speed, both filters.
    ekf_error: String,
    fixed_error: String,
    /// Whether the filter with fixed gains is of no use for this sensor.
    fixed_fails: bool,
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

/// A filter with fixed gains that errs so many times more than the EKF is of no use.
const FAILS: f64 = 2.0;
/// How many times further than Rust's `f32` filter another one may be from exact arithmetic.
const FURTHER: f64 = 3.0;
/// Spacings of `f32` at 1 by which the reading that a filter with fixed gains predicts may be off in each step, as the exported
/// file says: where only expf differs, and where products are contracted.
const SPACINGS: [f32; 2] = [2.0, 12.0];
/// Deviations of the sum of all these that are allowed.
const DEVIATIONS: f32 = 6.0;
/// Strains at which the gauge is looked at.
const STRAINS: usize = 64;
/// By how much a relative reading is moved to see how the strain follows: far above the rounding of `f32`, far below the
/// law's bends.
const NUDGE: f32 = 1e-3;

/// What an error of expf of one spacing of `f32` at 1 is multiplied with in the gauge, at most within the limits; no less
/// than 1.
fn expf_factor(gauge: &Gauge<f32>, limits: &StrainRange<f32>) -> f32 {
    let factor = |strain: f32| match *gauge {
        Gauge::Polynomial { .. } => 0.0,
        Gauge::DecayingExponential { slope, decay_strain } => {
            (slope * strain).abs() * (-strain / decay_strain).exp().max(1.0)
        }
        Gauge::Tunnelling { gap, barrier, path_loss } => {
            (1.0 + gap * strain).abs() * (strain * (barrier + strain * path_loss)).exp().max(1.0)
        }
    };
    let strains = (0..=STRAINS).map(|k| limits.lower + limits.span() * (k as f32 / STRAINS as f32));
    strains.map(factor).fold(1.0, f32::max)
}

impl Vectors {
    /// Runs the filters.
    pub fn new<const B: usize, const N: usize, const L: usize>(
        sensor: &FixedRate<B, N>,
        settled: &Settled<B, N, L>,
    ) -> Result<Self, ExportError> {
        let inputs = readings(sensor, 1);
        let estimates = run_ekf::<f32, B, N, L>(&sensor.model, sensor, &inputs)?;
        let exact = run_ekf::<f64, B, N, L>(&sensor.reference, sensor, &inputs)?;
        let fixed = run_fixed(sensor, settled, &inputs, None)?;
        let moved = sensitivity(&inputs, |nudged| run_fixed(sensor, settled, &inputs, nudged))?;

        let largest = sensor.limits.lower.abs().max(sensor.limits.upper.abs());
        let ulp = largest.next_up() - largest;
        let off = |((strain, sd), exact): (&(f32, f32), &(f64, f64))| {
            (f64::from(*strain) - exact.0).abs().max((f64::from(*sd) - exact.1).abs())
        };
        let rounding = estimates.iter().zip(&exact).map(off).fold(0.0, f64::max);
        let tolerance = ((FURTHER + 1.0) * rounding / f64::from(ulp)).ceil() as u64;
        let fixed_tolerance = |spacings: f32| (DEVIATIONS * spacings * f32::EPSILON * moved / ulp).ceil() as u64;
        let factor = expf_factor(&sensor.model.law().gauge, &sensor.limits);
        let rounded = !sensor.is_exact();

        let speed = sensor.model.motion().stationary_variance()[1].sqrt();
        let slowness = motion::slowness(sensor.reference.law(), f64::from(sensor.dt_s), f64::from(speed));
        let slow = readings(sensor, slowness);
        let ekf_error = error(&slow, run_ekf::<f32, B, N, L>(&sensor.model, sensor, &slow)?.iter().map(|e| e.0));
        let fixed_error = error(&slow, run_fixed(sensor, settled, &slow, None)?.iter().copied());
        let row = |((input, estimate), fixed): ((&Input, &(f32, f32)), &f32)| Vector {
            reading: input.reading.map(Literal),
            reading_sd: Literal(input.reading_sd),
            strain: Literal(estimate.0),
            strain_sd: Literal(estimate.1),
            fixed: Literal(*fixed),
        };
        Ok(Self {
            seed: motion::SEED,
            ulp: Literal(ulp),
            tolerance_ulp: if rounded { tolerance } else { 0 },
            fixed_tolerance_ulp: if rounded { fixed_tolerance(SPACINGS[0] * factor) } else { 0 },
            contracted_tolerance_ulp: tolerance,
            contracted_fixed_tolerance_ulp: fixed_tolerance(SPACINGS[1].max(SPACINGS[0] * factor)),
            expf_factor: number::significant(f64::from(factor), 2),
            ekf_error: number::significant(ekf_error, 2),
            fixed_error: number::significant(fixed_error, 2),
            fixed_fails: !(fixed_error < FAILS * ekf_error),
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
    motion::rows(sensor.reference.law(), f64::from(sensor.dt_s), reading_sd, slowness).into_iter().map(input).collect()
}

/// A row relative to R₀, computed as on the microcontroller.
fn relative(rest_reading: f32, input: &Input) -> Option<Reading<f32>> {
    let sd = input.reading_sd / rest_reading;
    input.reading.map(|reading| Reading { value: (reading - rest_reading) / rest_reading, extra_variance: sd * sd })
}

/// Mean strain and reported standard deviation, row by row.
fn run_ekf<T: Scalar, const B: usize, const N: usize, const L: usize>(
    model: &SwitchedModel<T, 2, B, N>,
    sensor: &FixedRate<B, N>,
    inputs: &[Input],
) -> Result<Vec<(T, T)>, ExportError> {
    let exactly = |x: f32| T::of(x.into());
    let filter: SparseEkf<T, Compact, B, N> = SparseEkf::new(*model, exactly(sensor.dt_s)).map_err(refused)?;
    let mut belief: Belief<T, N, L> = Belief::initial(model);
    let estimate = |input: &Input| {
        let reading = relative(sensor.rest_reading, input)
            .map(|reading| Reading { value: exactly(reading.value), extra_variance: exactly(reading.extra_variance) });
        filter.step(&mut belief, reading).map_err(refused)?;
        Ok((belief.mean[0], exactly(sensor.strain_sd_scale) * belief.covariance[(0, 0)].sqrt()))
    };
    inputs.iter().map(estimate).collect()
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
        let nudge = if nudged == Some(row) { NUDGE } else { 0.0 };
        let reading = relative(sensor.rest_reading, input).map(|reading| reading.value + nudge);
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

/// Root mean squared error of the strain.
fn error(inputs: &[Input], strains: impl Iterator<Item = f32>) -> f64 {
    let squares = inputs.iter().zip(strains).map(|(input, strain)| (f64::from(strain) - input.true_strain).powi(2));
    (squares.sum::<f64>() / inputs.len() as f64).sqrt()
}

fn refused(error: StepError) -> ExportError {
    ExportError::Parameter(format!("the filter refuses the law's own readings: {error}"))
}
