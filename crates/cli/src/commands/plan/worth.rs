//! Information of recordings about a law's parameters, and errors of an estimate by sampling and converters.

use nalgebra::DMatrix;
use ohmstrain::{JointParams, Reading, ReadingUnit, Sensor};
use ohmstrain_bench_data::FrontEndSpec;
use ohmstrain_model::AdcCode;
use ohmstrain_sensor::{LawParams, NoiseParams};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

use super::motion::{Protocol, Protocols, RATE_HZ, at_rate};
use crate::error::CliError;
use ohmstrain_report::Law;

/// Readings per second that are tried.
pub const RATES_HZ: [f64; 4] = [2.0, 5.0, 20.0, FASTEST_HZ];
/// The last of them.
pub const FASTEST_HZ: f64 = 50.0;
const FINEST_HZ: f64 = 100.0;
/// Bits of a converter; 0 for readings as good as the sensor.
pub const BITS: [u32; 4] = [0, 12, 10, 8];
/// Draws of noise and drift; the median of their errors is stated. One that leads the filter astray is no measure of sampling.
const DRAWS: u64 = 5;
/// Largest standard error of a parameter that counts as determined, as a share of it.
const TOLD: f64 = 0.25;
/// An error is hardly larger than another one up to this factor.
const HARDLY: f64 = 1.1;
/// Least reading, as a share of R₀: the drift stands for the law's errors too, and can be larger than a resistance.
const LEAST_READING: f64 = 0.01;
/// Relative step of a difference: errors of its square and of rounding over it are both about 1e-9.
const STEP: f64 = 1e-5;
/// Seconds in which a filter finds its feet, which are not scored.
const SETTLING_S: f64 = 5.0;

/// Information of a recording.
#[derive(Serialize)]
pub struct Told {
    pub protocol: String,
    pub minutes: f64,
    /// Parameters of the law.
    pub parameters: usize,
    /// Number of parameters with a standard error of less than a quarter of them.
    pub told: usize,
    /// Largest standard error of the determined parameters, percent.
    pub worst_percent: Option<f64>,
    /// Condition number of the Fisher information, its diagonal scaled to one.
    pub condition: f64,
    /// Parameter with the least information, if any is undetermined.
    pub left_open: String,
}

/// Errors with one way of sampling.
#[derive(Serialize)]
pub struct Worth {
    pub rate_hz: f64,
    /// Bits of the converter; none if it is as good as the sensor.
    pub bits: Option<u32>,
    /// Root mean square error in percent of the sensor's range, the median of several draws of noise and drift.
    pub error_percent: f64,
    pub coverage_percent: f64,
    /// Root mean square error of the joint's angle, degrees, if there is a joint.
    pub angle_deg: Option<f64>,
}

/// Errors with several ways of sampling, and those that none of them reduces.
#[derive(Serialize)]
pub struct Sampling {
    pub cases: Vec<Worth>,
    /// Error at [`FASTEST_HZ`] of readings that drift and have no noise otherwise, percent of the sensor's range.
    pub drift_alone_percent: f64,
    /// Error of readings that have noise and do not drift.
    pub noise_alone_percent: f64,
    /// Error of readings that have neither.
    pub neither_percent: f64,
}

impl Sampling {
    /// The slowest and coarsest of the cases whose error is hardly larger than the least.
    pub fn enough(&self) -> Option<&Worth> {
        let least = self.cases.iter().map(|one| one.error_percent).reduce(f64::min)?;
        // From the slowest on, and for each rate from the finest converter on.
        let close = |one: &&Worth| one.error_percent < HARDLY * least;
        let slowest = self.cases.iter().find(close)?;
        self.cases.iter().filter(close).rfind(|one| one.rate_hz == slowest.rate_hz)
    }
}

/// The shortest recording that tells as many parameters as any.
pub fn best(recordings: &[Told]) -> Option<&Told> {
    let most = recordings.iter().map(|one| one.told).max()?;
    recordings.iter().filter(|one| one.told == most).min_by(|a, b| a.minutes.total_cmp(&b.minutes))
}

/// Factors on each kind of noise, relative to the calibration.
#[derive(Clone, Copy)]
struct Disturbed {
    drift: f64,
    white: f64,
}

/// Noise of the calibration.
const AS_FOUND: Disturbed = Disturbed { drift: 1.0, white: 1.0 };

/// The sensor's drift, the same one however it is sampled: shares of R₀, [`FINEST_HZ`] of them a second.
fn drift(noise: NoiseParams, rows: usize, seed: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(2 * seed);
    let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
    let kept = (-1.0 / (FINEST_HZ * noise.baseline_time_s)).exp();
    let mut baseline = noise.baseline_sd * draw();
    let next = |_| {
        baseline = kept * baseline + noise.baseline_sd * (1.0 - kept * kept).sqrt() * draw();
        baseline
    };
    (0..rows).map(next).collect()
}

/// Readings of a motion by the sensor's law, with white noise and a drifting baseline.
fn readings(sensor: &Sensor, (rate_hz, strain): (f64, &[f64]), disturbed: Disturbed, seed: u64) -> Vec<f64> {
    let params = sensor.params();
    let law = Law::new(params, params.rest_reading);
    let driven = law.driven(&times(strain.len(), rate_hz), strain, &[]).reading;
    let Some(noise) = params.estimator(params.filter_of(params.default_estimator)).ok().map(|own| own.noise) else {
        return driven;
    };
    let every = (FINEST_HZ / rate_hz).round() as usize;
    let drift = drift(noise, strain.len() * every, seed);
    let mut random = ChaCha8Rng::seed_from_u64(2 * seed + 1);
    let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
    let noisy = |(reading, row): (f64, usize)| {
        let noise = disturbed.drift * drift[row * every] + disturbed.white * noise.reading_sd * draw();
        (reading + params.rest_reading * noise).max(LEAST_READING * params.rest_reading)
    };
    driven.into_iter().zip(0..).map(noisy).collect()
}

fn times(rows: usize, rate_hz: f64) -> Vec<f64> {
    (0..rows).map(|row| row as f64 / rate_hz).collect()
}

/// Computes a recording's information about the law's parameters: their Fisher information, at the sensor's own values.
pub fn told(sensor: &Sensor, protocol: &Protocol) -> Told {
    let minutes = protocol.strain.len() as f64 / RATE_HZ / 60.0;
    let (names, values) = parameters(&sensor.params().law);
    let information = information(sensor, &protocol.strain);
    // With ones on its diagonal, so that units do not count.
    let scale: Vec<f64> = information.diagonal().iter().map(|x| x.sqrt().max(f64::MIN_POSITIVE)).collect();
    let scaled = DMatrix::from_fn(values.len(), values.len(), |i, j| information[(i, j)] / (scale[i] * scale[j]));
    let eigen = scaled.symmetric_eigen();
    let most = eigen.eigenvalues.max();
    let least = eigen.eigenvalues.min().max(f64::EPSILON * most);
    let error = |i: usize| {
        let row = eigen.eigenvectors.row(i);
        let squares = row.iter().zip(eigen.eigenvalues.iter());
        squares.map(|(x, value)| x * x / value.max(f64::EPSILON * most)).sum::<f64>().sqrt() / scale[i]
    };
    let relative: Vec<f64> = values.iter().enumerate().map(|(i, value)| (error(i) / value).abs()).collect();
    let is_told = |share: &f64| *share < TOLD;
    let open = relative.iter().zip(&names).filter(|(share, _)| !is_told(share)).max_by(|a, b| a.0.total_cmp(b.0));
    Told {
        protocol: protocol.name.clone(),
        minutes,
        parameters: relative.len(),
        told: relative.iter().filter(|share| is_told(share)).count(),
        worst_percent: relative.iter().copied().filter(is_told).reduce(f64::max).map(|share| 100.0 * share),
        condition: most / least,
        left_open: open.map_or_else(String::new, |(_, name)| name.clone()),
    }
}

/// The parameters of a law that are not zero, by name.
fn parameters(law: &LawParams) -> (Vec<String>, Vec<f64>) {
    let mut law = law.clone();
    law.parameters_mut().into_iter().map(|own| (own.name, *own.value)).filter(|(_, value)| *value != 0.0).unzip()
}

/// JᵀJ of the whitened readings by central differences. The drift is an Ornstein-Uhlenbeck process: a reading less what is left of
/// the one before has white errors of the variance that both noises leave, but for the neighbours' share of the white one.
fn information(sensor: &Sensor, strain: &[f64]) -> DMatrix<f64> {
    let params = sensor.params();
    let time_s = times(strain.len(), RATE_HZ);
    let noise = params.estimator(params.filter_of(params.default_estimator)).ok().map(|own| own.noise);
    let (white, drift, drift_s) =
        noise.map_or((1e-3, 0.0, 1.0), |noise| (noise.reading_sd, noise.baseline_sd, noise.baseline_time_s));
    let kept = (-1.0 / RATE_HZ / drift_s).exp();
    let sd = (drift * drift * (1.0 - kept * kept) + white * white * (1.0 + kept * kept)).sqrt();
    let (names, values) = parameters(&params.law);
    let driven = |name: &str, factor: f64| {
        let mut moved = params.clone();
        if let Some(own) = moved.law.parameters_mut().into_iter().find(|own| own.name == name) {
            *own.value *= factor;
        }
        Law::new(&moved, 1.0).driven(&time_s, strain, &[]).reading
    };
    let mut jacobian = DMatrix::zeros(strain.len(), names.len());
    for (column, (name, value)) in names.iter().zip(&values).enumerate() {
        let (above, below) = (driven(name, 1.0 + STEP), driven(name, 1.0 - STEP));
        let slope = |row: usize| (above[row] - below[row]) / (2.0 * STEP * value);
        for row in 1..strain.len() {
            jacobian[(row, column)] = (slope(row) - kept * slope(row - 1)) / sd;
        }
    }
    jacobian.tr_mul(&jacobian)
}

/// Computes the errors of the estimate for rates and converters, all on one motion with the same drifts.
pub fn sampling(sensor: &Sensor, protocols: &Protocols) -> Result<Sampling, CliError> {
    let (path, mut cases) = (protocols.usual(), Vec::new());
    for rate_hz in RATES_HZ {
        let strain = at_rate(&path, rate_hz);
        for bits in BITS.into_iter().filter(|bits| *bits == 0 || sensor.params().reading == ReadingUnit::Ohm) {
            cases.push(median_of_draws(sensor, (rate_hz, bits), &strain, AS_FOUND)?);
        }
    }
    let strain = at_rate(&path, FASTEST_HZ);
    let alone = |disturbed: Disturbed| {
        median_of_draws(sensor, (FASTEST_HZ, 0), &strain, disturbed).map(|one| one.error_percent)
    };
    let drift_alone_percent = alone(Disturbed { white: 0.0, ..AS_FOUND })?;
    let noise_alone_percent = alone(Disturbed { drift: 0.0, ..AS_FOUND })?;
    let neither_percent = alone(Disturbed { drift: 0.0, white: 0.0 })?;
    Ok(Sampling { cases, drift_alone_percent, noise_alone_percent, neither_percent })
}

/// The draw with the median error, with the coverage of all.
fn median_of_draws(
    sensor: &Sensor,
    (rate_hz, bits): (f64, u32),
    strain: &[f64],
    disturbed: Disturbed,
) -> Result<Worth, CliError> {
    let draw = |seed: u64| {
        let exact = readings(sensor, (rate_hz, strain), disturbed, seed);
        scored(sensor, (rate_hz, bits), strain, &converted(&exact, bits)?)
    };
    let mut draws = (1..=DRAWS).map(draw).collect::<Result<Vec<Worth>, _>>()?;
    draws.sort_by(|a, b| a.error_percent.total_cmp(&b.error_percent));
    let coverage_percent = draws.iter().map(|one| one.coverage_percent).sum::<f64>() / DRAWS as f64;
    let median = draws.swap_remove(draws.len() / 2);
    Ok(Worth { coverage_percent, ..median })
}

/// Readings through a divider whose resistor is the geometric mean of their range.
fn converted(exact: &[f64], bits: u32) -> Result<Vec<Reading>, CliError> {
    if bits == 0 {
        return Ok(exact.iter().map(|value| Reading::from(*value)).collect());
    }
    let (low, high) = exact.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(*x), high.max(*x)));
    let spec = format!("divider reference_ohm={} side=low bits={bits} noise_codes=0.5", (low * high).sqrt());
    let spec: FrontEndSpec = spec.parse().map_err(|error| CliError::Other(format!("{error}")))?;
    let front_end = spec.build().map_err(|error| CliError::Other(error.to_string()))?;
    let read = |value: &f64| match front_end.read(front_end.code(*value).round().max(0.0) as u32) {
        AdcCode::Reading(ohms) => Reading { value: ohms.resistance_ohm, sd: ohms.sd_ohm, saturated: false },
        AdcCode::Saturated => Reading { saturated: true, ..Reading::MISSING },
    };
    Ok(exact.iter().map(read).collect())
}

fn scored(
    sensor: &Sensor,
    (rate_hz, bits): (f64, u32),
    strain: &[f64],
    readings: &[Reading],
) -> Result<Worth, CliError> {
    // What a correction has learned is the error of the law on real readings; these have none.
    let mut filter = sensor.filter().without_correction().build()?;
    let (mut squares, mut inside, mut count) = (0.0, 0_usize, 0_usize);
    for ((time_s, truth), reading) in times(strain.len(), rate_hz).into_iter().zip(strain).zip(readings) {
        let row = filter.step(time_s, *reading)?;
        if time_s < SETTLING_S {
            continue;
        }
        let error = row.strain - truth;
        squares += error * error;
        inside += usize::from(error.abs() <= 1.96 * row.strain_sd);
        count += 1;
    }
    let n = count.max(1) as f64;
    let error = (squares / n).sqrt();
    let per_strain = |joint: JointParams| (joint.gauge_length_mm / joint.moment_arm_mm).to_degrees();
    Ok(Worth {
        rate_hz,
        bits: (bits > 0).then_some(bits),
        error_percent: 100.0 * error / sensor.params().law.range.span(),
        coverage_percent: 100.0 * inside as f64 / n,
        angle_deg: sensor.params().joint.map(|joint| error * per_strain(joint)),
    })
}
