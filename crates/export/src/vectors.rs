//! Output of the Rust filters over a short motion, which the exported filter must have too.

use ohmstrain_ekf::live::SensorEstimator;
use ohmstrain_ekf::{Reading, Real, StepError};
use serde::Serialize;

use super::ExportError;
use super::fixed_rate::FixedRate;
use super::literal::Literal;
use super::motion;
use super::twin::{StepNumbers, Task, TwinFilter, with_twin};

/// Readings and results, and how far other results may be off.
#[derive(Debug, Serialize)]
pub struct Vectors {
    seed: u64,
    ulp: Literal,
    tolerance_ulp: u64,
    rows: Vec<Vector>,
    /// The row before which the sensor is found to rest, and what it reads then.
    rezeroed: usize,
    rested: Literal,
    /// Hypotheses moved on in a step, on average.
    #[serde(skip)]
    pub work: f64,
}

/// One row.
#[derive(Debug, Serialize)]
struct Vector {
    reading: Option<Literal>,
    reading_sd: Literal,
    strain: Literal,
    strain_sd: Literal,
}

/// A row as the microcontroller gets it.
#[derive(Clone, Copy)]
pub struct Input {
    pub reading: Option<f32>,
    pub reading_sd: f32,
}

/// Share of the instructions of a step with a reading that a prediction takes.
const PREDICTION: f64 = 0.75;

/// Rows at the end for which the sensor rests, and what it reads then over what it read in calibration: another day.
const RESTED: usize = 20;
const ANOTHER_DAY: f32 = 1.08;

/// Factor by which another filter may be further from exact arithmetic than Rust's `f32` filter, or than one rounding of the readings
/// moves that.
const FURTHER: f64 = 3.0;

impl Vectors {
    /// Runs the filters.
    pub fn new<const B: usize, const N: usize, const L: usize>(
        sensor: &FixedRate<'_, B, N>,
    ) -> Result<Self, ExportError> {
        let inputs = readings(sensor);
        let motion = || Motion { sensor, inputs: &inputs };
        let (estimates, work): (Vec<(f32, f32)>, f64) =
            with_twin::<_, B, N, L, _>(sensor, sensor.model, sensor.interpolated(), motion())?;
        let (exact, _): (Vec<(f64, f64)>, f64) =
            with_twin::<_, B, N, L, _>(sensor, sensor.reference, sensor.exact(), motion())?;
        let limits = sensor.narrow().limits;
        let largest = limits.lower.abs().max(limits.upper.abs());
        let ulp = largest.next_up() - largest;
        let off = |((strain, sd), exact): (&(f32, f32), &(f64, f64))| {
            (f64::from(*strain) - exact.0).abs().max((f64::from(*sd) - exact.1).abs())
        };
        let mut rounding = estimates.iter().zip(&exact).map(off).fold(0.0, f64::max);
        // The distance from exact arithmetic may be small by chance: readings of one rounding more or less say so.
        for nudged in [f32::next_up, f32::next_down] {
            let nudge = |input: &Input| Input { reading: input.reading.map(nudged), ..*input };
            let inputs: Vec<Input> = inputs.iter().map(nudge).collect();
            let motion = Motion { sensor, inputs: &inputs };
            let (others, _) = with_twin::<_, B, N, L, _>(sensor, sensor.model, sensor.interpolated(), motion)?;
            let exactly = |(strain, sd): (f32, f32)| (f64::from(strain), f64::from(sd));
            let others = others.into_iter().map(exactly).collect::<Vec<_>>();
            rounding = estimates.iter().zip(&others).map(off).fold(rounding, f64::max);
        }
        let tolerance = ((FURTHER + 1.0) * rounding / f64::from(ulp)).ceil() as u64;
        let row = |(input, estimate): (&Input, &(f32, f32))| Vector {
            reading: input.reading.map(Literal),
            reading_sd: Literal(input.reading_sd),
            strain: Literal(estimate.0),
            strain_sd: Literal(estimate.1),
        };
        Ok(Self {
            seed: motion::SEED,
            rezeroed: inputs.len() - RESTED,
            rested: Literal(rested_elsewhere(sensor)),
            ulp: Literal(ulp),
            tolerance_ulp: tolerance,
            work,
            rows: inputs.iter().zip(&estimates).map(row).collect(),
        })
    }
}

/// Hypotheses moved on in a step of the motion, on average, each time that they are.
pub fn work<const B: usize, const N: usize, const L: usize>(sensor: &FixedRate<'_, B, N>) -> Result<f64, ExportError> {
    let inputs = readings(sensor);
    let motion = Motion { sensor, inputs: &inputs };
    let (_, work): (Vec<(f32, f32)>, f64) =
        with_twin::<_, B, N, L, _>(sensor, sensor.model, sensor.interpolated(), motion)?;
    Ok(work)
}

/// The readings of the motion, in the sensor's unit.
fn readings<const B: usize, const N: usize>(sensor: &FixedRate<'_, B, N>) -> Vec<Input> {
    let rest = sensor.parts.live.rest_reading;
    let input = |row: motion::Row| Input {
        reading: row.rho.map(|rho| (rest * (1.0 + rho)) as f32),
        reading_sd: (rest * row.extra_sd) as f32,
    };
    let reading_sd = f64::from(sensor.model.noise().reading_sd);
    let dt_s = sensor.parts.live.dt_s;
    let mut inputs: Vec<Input> =
        motion::rows(sensor.reference.law(), dt_s, reading_sd).into_iter().map(input).collect();
    // It wanders, so that no number comes twice.
    let wandering = |row: usize| 1.0 + reading_sd * (row as f64).sin();
    let rested = f64::from(rested_elsewhere(sensor));
    inputs.extend((0..RESTED).map(|row| Input { reading: Some((rested * wandering(row)) as f32), reading_sd: 0.0 }));
    inputs
}

/// Resistance at rest on another day.
fn rested_elsewhere<const B: usize, const N: usize>(sensor: &FixedRate<'_, B, N>) -> f32 {
    sensor.narrow().rested * ANOTHER_DAY
}

/// A row relative to R₀, computed as on the microcontroller.
fn relative<T: Real>(rest_reading: f32, input: &Input) -> Option<Reading<T>> {
    let (sd, exactly) = (input.reading_sd / rest_reading, |x: f32| T::of(x.into()));
    let value = |reading: f32| exactly((reading - rest_reading) / rest_reading);
    input.reading.map(|reading| Reading { value: value(reading), extra_variance: exactly(sd * sd) })
}

/// Strain and deviation as they are reported, row by row; hypotheses moved on in a step.
struct Motion<'a, const B: usize, const N: usize> {
    sensor: &'a FixedRate<'a, B, N>,
    inputs: &'a [Input],
}

impl<T: Real, const B: usize, const S: usize> Task<T> for Motion<'_, B, S> {
    type Said = (Vec<(T, T)>, f64);

    fn run<F, const N: usize, const L: usize>(
        self,
        mut live: TwinFilter<'_, T, F, N, L>,
    ) -> Result<Self::Said, StepError>
    where
        F: SensorEstimator<T, N, L, Prepared = F> + StepNumbers<T>,
    {
        let Self { sensor, inputs } = self;
        let exactly = |x: f32| T::of(x.into());
        let mut rest_reading = sensor.narrow().rest_reading;
        let mut estimates = Vec::with_capacity(inputs.len());
        for (row, input) in inputs.iter().enumerate() {
            if row + RESTED == inputs.len() {
                rest_reading = sensor.rest_reading_at(rested_elsewhere(sensor));
                live.rezero(exactly(rested_elsewhere(sensor)))?;
            }
            let reading = relative(rest_reading, input);
            let strain = live.step_after(T::of(sensor.parts.live.dt_s), reading)?.strain;
            estimates.push((strain.mean, strain.sd()));
        }
        let [updated, predicted] = live.estimator().work().map(|count| count as f64 / inputs.len() as f64);
        Ok((estimates, updated + PREDICTION * predicted))
    }
}
