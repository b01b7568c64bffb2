//! Test vectors: output of the Rust filters over a short motion, which the exported filter must reproduce.

use ohmstrain_ekf::live::SensorEstimator;
use ohmstrain_ekf::{Reading, Real, StepError};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

use super::ExportError;
use super::fixed_rate::FixedRate;
use super::literal::Literal;
use super::motion;
use super::twin::{StepNumbers, Task, TwinFilter, with_twin};

/// Readings, results, and their tolerances.
#[derive(Debug, Serialize)]
pub struct Vectors {
    seed: u64,
    ulp: Literal,
    tolerance_ulp: u64,
    rows: Vec<Vector>,
    /// Row before which the sensor is found at rest, and its reading then.
    rezeroed: usize,
    rested: Literal,
    #[serde(skip)]
    pub work: Work,
}

/// One row.
#[derive(Debug, Serialize)]
struct Vector {
    reading: Option<Literal>,
    reading_sd: Literal,
    strain: Literal,
    strain_sd: Literal,
}

/// A row as the microcontroller receives it.
#[derive(Clone, Copy)]
pub struct Input {
    pub reading: Option<f32>,
    pub reading_sd: f32,
}

/// Mean work of a step.
#[derive(Clone, Copy, Debug)]
pub struct Work {
    /// Number of hypotheses updated: 1 for a single Gaussian; a surprising reading counts twice.
    pub updated: f64,
    /// Number of hypotheses predicted without a reading.
    pub predicted: f64,
}

/// Number of rows at the end in which the sensor rests, and its reading then relative to that in calibration: another day.
const RESTED: usize = 20;
const ANOTHER_DAY: f32 = 1.08;

/// Factor by which another filter may be further from exact arithmetic than Rust's `f32` filter is, or than other roundings of
/// the readings move it.
pub const FURTHER: f64 = 3.0;

/// Seed of the noise, and the largest number of seeds that are tried.
const FIRST_SEED: u64 = 1;
const SEEDS: u64 = 8;

/// Number of runs with other roundings of the readings, and their relative deviation: larger than the differences between C
/// libraries, so that a decision close to a tie is found.
pub const ROUNDINGS: u64 = 6;
const ROUNDED_BY: f64 = 2.0 * f32::EPSILON as f64;

/// Largest effect of rounding, as a share of the mean deviation; beyond it, rounding decides which hypotheses are merged.
const CALM: f64 = 1e-3;

/// Strain and deviation of each row, with the effect of rounding.
struct Run {
    seed: u64,
    inputs: Vec<Input>,
    estimates: Vec<(f32, f32)>,
    work: Work,
    /// Largest effect of rounding.
    rounding: f64,
}

impl Run {
    /// Runs the filter in single and double precision, and again with readings rounded otherwise.
    fn new<const B: usize, const N: usize, const L: usize>(
        sensor: &FixedRate<'_, B, N>,
        seed: u64,
    ) -> Result<Self, ExportError> {
        let inputs = readings(sensor, seed);
        let single = |inputs: &[Input]| {
            let motion = MotionRun { sensor, inputs };
            with_twin::<_, B, N, L, _>(sensor, sensor.model, sensor.interpolated(), motion)
        };
        let (estimates, work): (Vec<(f32, f32)>, Work) = single(&inputs)?;
        let (exact, _): (Vec<(f64, f64)>, Work) = with_twin::<_, B, N, L, _>(
            sensor,
            sensor.reference,
            sensor.exact(),
            MotionRun { sensor, inputs: &inputs },
        )?;
        let mut rounding = farthest(&estimates, exact.into_iter());
        // The distance from exact arithmetic can be small by chance.
        let mut rounded = other_rounding(seed);
        for _ in 0..ROUNDINGS {
            let mut other = |reading: f32| rounded(reading.into());
            let perturbed = inputs.iter().map(|input| Input { reading: input.reading.map(&mut other), ..*input });
            let (others, _) = single(&perturbed.collect::<Vec<_>>())?;
            let others = others.into_iter().map(|(strain, sd)| (f64::from(strain), f64::from(sd)));
            rounding = rounding.max(farthest(&estimates, others));
        }
        Ok(Self { seed, inputs, estimates, work, rounding })
    }

    /// True if rounding has no relevant effect.
    fn is_calm(&self) -> bool {
        let sd = self.estimates.iter().map(|(_, sd)| f64::from(*sd)).sum::<f64>() / self.estimates.len() as f64;
        self.rounding < CALM * sd
    }
}

/// Returns a function that rounds readings otherwise, each call with the next draw.
pub fn other_rounding(seed: u64) -> impl FnMut(f64) -> f32 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    move |reading: f64| {
        let normal: f64 = StandardNormal.sample(&mut random);
        (reading * (1.0 + ROUNDED_BY * normal)) as f32
    }
}

/// Returns the largest difference of strains, or of deviations.
fn farthest(estimates: &[(f32, f32)], others: impl Iterator<Item = (f64, f64)>) -> f64 {
    let off = |(&(strain, sd), other): (&(f32, f32), (f64, f64))| {
        (f64::from(strain) - other.0).abs().max((f64::from(sd) - other.1).abs())
    };
    estimates.iter().zip(others).map(off).fold(0.0, f64::max)
}

impl Vectors {
    /// Runs the filters through a motion whose noise leaves no decision to rounding; if there is none, through the one with the
    /// smallest effect of rounding.
    pub fn new<const B: usize, const N: usize, const L: usize>(
        sensor: &FixedRate<'_, B, N>,
    ) -> Result<Self, ExportError> {
        let mut best = Run::new::<B, N, L>(sensor, FIRST_SEED)?;
        for seed in FIRST_SEED + 1..FIRST_SEED + SEEDS {
            if best.is_calm() {
                break;
            }
            let other = Run::new::<B, N, L>(sensor, seed)?;
            if other.rounding < best.rounding {
                best = other;
            }
        }
        let limits = sensor.narrow().limits;
        let largest = limits.lower.abs().max(limits.upper.abs());
        let ulp = largest.next_up() - largest;
        let row = |(input, estimate): (&Input, &(f32, f32))| Vector {
            reading: input.reading.map(Literal),
            reading_sd: Literal(input.reading_sd),
            strain: Literal(estimate.0),
            strain_sd: Literal(estimate.1),
        };
        Ok(Self {
            seed: best.seed,
            rezeroed: best.inputs.len() - RESTED,
            rested: Literal(rested_elsewhere(sensor)),
            ulp: Literal(ulp),
            tolerance_ulp: ((FURTHER + 1.0) * best.rounding / f64::from(ulp)).ceil() as u64,
            work: best.work,
            rows: best.inputs.iter().zip(&best.estimates).map(row).collect(),
        })
    }
}

/// Computes the work of a step of the motion.
pub fn work<const B: usize, const N: usize, const L: usize>(sensor: &FixedRate<'_, B, N>) -> Result<Work, ExportError> {
    let inputs = readings(sensor, FIRST_SEED);
    let motion = MotionRun { sensor, inputs: &inputs };
    let (_, work): (Vec<(f32, f32)>, Work) =
        with_twin::<_, B, N, L, _>(sensor, sensor.model, sensor.interpolated(), motion)?;
    Ok(work)
}

/// Returns the readings of the motion, in the sensor's unit.
fn readings<const B: usize, const N: usize>(sensor: &FixedRate<'_, B, N>, seed: u64) -> Vec<Input> {
    let rest = sensor.parts.live.rest_reading;
    let input = |row: motion::MotionRow| Input {
        reading: row.rho.map(|rho| (rest * (1.0 + rho)) as f32),
        reading_sd: (rest * row.extra_sd) as f32,
    };
    let reading_sd = f64::from(sensor.model.noise().reading_sd);
    let dt_s = sensor.parts.live.dt_s;
    let mut inputs: Vec<Input> =
        motion::rows(sensor.reference.law(), dt_s, reading_sd, seed).into_iter().map(input).collect();
    // It wanders, so that no number repeats.
    let wandering = |row: usize| 1.0 + reading_sd * (row as f64).sin();
    let rested = f64::from(rested_elsewhere(sensor));
    inputs.extend((0..RESTED).map(|row| Input { reading: Some((rested * wandering(row)) as f32), reading_sd: 0.0 }));
    inputs
}

/// Returns the resistance at rest on another day.
fn rested_elsewhere<const B: usize, const N: usize>(sensor: &FixedRate<'_, B, N>) -> f32 {
    sensor.narrow().rested * ANOTHER_DAY
}

/// Converts a row relative to R₀, computed as on the microcontroller.
fn relative<T: Real>(rest_reading: f32, input: &Input) -> Option<Reading<T>> {
    let (sd, exactly) = (input.reading_sd / rest_reading, |x: f32| T::of(x.into()));
    let value = |reading: f32| exactly((reading - rest_reading) / rest_reading);
    input.reading.map(|reading| Reading { value: value(reading), extra_variance: exactly(sd * sd) })
}

/// Strain and deviation as reported, row by row; and the work of a step.
struct MotionRun<'a, const B: usize, const N: usize> {
    sensor: &'a FixedRate<'a, B, N>,
    inputs: &'a [Input],
}

impl<T: Real, const B: usize, const S: usize> Task<T> for MotionRun<'_, B, S> {
    type Output = (Vec<(T, T)>, Work);

    fn run<F, const N: usize, const L: usize>(
        self,
        mut live: TwinFilter<'_, T, F, N, L>,
    ) -> Result<Self::Output, StepError>
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
        Ok((estimates, Work { updated, predicted }))
    }
}
