//! Information of recordings about a law's parameters, and errors of an estimate for several sampling rates and converters.

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

/// Sampling rates that are compared, Hz.
pub const RATES_HZ: [f64; 4] = [2.0, 5.0, 20.0, FASTEST_HZ];
/// The last of them.
pub const FASTEST_HZ: f64 = 50.0;
const FINEST_HZ: f64 = 100.0;
/// Resolutions of converters, bits; 0 stands for readings as good as the sensor.
pub const BITS: [u32; 4] = [0, 12, 10, 8];
/// Number of draws of noise and drift. The median error is reported, since a draw that makes the filter diverge says nothing
/// about sampling.
const DRAWS: u64 = 5;
/// Largest standard error of a determined parameter, as a share of its value.
const DETERMINED_BELOW: f64 = 0.25;
/// Factor up to which an error is hardly larger than another.
const HARDLY: f64 = 1.1;
/// Factor by which the error grows from the slowest to the fastest rate if the filter loses the strain.
const LOST: f64 = 1.5;
/// Smallest reading, as a share of R₀: the drift also represents errors of the law, and can exceed the resistance.
const LEAST_READING: f64 = 0.01;
/// Relative step of the central difference: its truncation error (the square) and its rounding error are both below 1e-9.
const STEP: f64 = 1e-5;
/// Time in which a filter settles and is not scored, s.
const SETTLING_S: f64 = 5.0;

/// Information of a recording.
#[derive(Serialize)]
pub struct Information {
    pub protocol: String,
    pub minutes: f64,
    /// Parameters of the law.
    pub parameters: usize,
    /// Number of parameters with a standard error below a quarter of their value.
    #[serde(rename = "told")]
    pub determined: usize,
    /// Largest standard error of the determined parameters, percent.
    pub worst_percent: Option<f64>,
    /// Condition number of the Fisher information, its diagonal scaled to one.
    pub condition: f64,
    /// Parameter with the least information, if any parameter is undetermined.
    pub left_open: String,
}

/// Errors of one sampling scheme.
#[derive(Serialize)]
pub struct Worth {
    pub rate_hz: f64,
    /// Bits of the converter; `None` if it is as good as the sensor.
    pub bits: Option<u32>,
    /// Root mean square error in percent of the sensor's range, the median of several draws of noise and drift.
    pub error_percent: f64,
    pub coverage_percent: f64,
    /// Root mean square error of the joint's angle, degrees, if there is a joint.
    pub angle_deg: Option<f64>,
}

/// Errors of several sampling schemes, and those that no scheme reduces.
#[derive(Serialize)]
pub struct Sampling {
    #[serde(rename = "sampling")]
    pub cases: Vec<Worth>,
    /// Error at [`FASTEST_HZ`] with drift as the only disturbance, percent of the sensor's range.
    pub drift_alone_percent: f64,
    /// The same with white noise as the only disturbance.
    pub noise_alone_percent: f64,
    /// The same with neither.
    pub neither_percent: f64,
}

impl Sampling {
    /// True if the error grows with the sampling rate of an exact converter: the filter loses the strain, whatever the sampling.
    pub fn is_lost(&self) -> bool {
        let exact = || self.cases.iter().filter(|one| one.bits.is_none()).map(|one| one.error_percent);
        let (first, last) = (exact().next(), exact().next_back());
        first.zip(last).is_some_and(|(slowest, fastest)| fastest > LOST * slowest)
    }

    /// Returns the slowest and coarsest case whose error is hardly larger than the smallest.
    pub fn enough(&self) -> Option<&Worth> {
        let least = self.cases.iter().map(|one| one.error_percent).reduce(f64::min)?;
        // Sorted from the slowest rate on, and for each rate from the finest converter on.
        let close = |one: &&Worth| one.error_percent < HARDLY * least;
        let slowest = self.cases.iter().find(close)?;
        self.cases.iter().filter(close).rfind(|one| one.rate_hz == slowest.rate_hz)
    }
}

/// Returns the shortest recording that determines the largest number of parameters.
pub fn best(recordings: &[Information]) -> Option<&Information> {
    let most = recordings.iter().map(|one| one.determined).max()?;
    recordings.iter().filter(|one| one.determined == most).min_by(|a, b| a.minutes.total_cmp(&b.minutes))
}

/// Factors on each kind of noise, relative to the calibrated noise.
#[derive(Clone, Copy)]
struct Disturbed {
    drift: f64,
    white: f64,
}

/// The calibrated noise.
const AS_FOUND: Disturbed = Disturbed { drift: 1.0, white: 1.0 };

/// Draws the sensor's drift relative to R₀, at [`FINEST_HZ`], the same for every sampling scheme.
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

/// Simulates the readings of a motion by the sensor's law, with white noise and a drifting baseline.
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
pub fn recording_information(sensor: &Sensor, protocol: &Protocol) -> Information {
    let minutes = protocol.strain.len() as f64 / RATE_HZ / 60.0;
    let (names, values) = parameters(&sensor.params().law);
    let information = information(sensor, &protocol.strain);
    // Scaled to ones on its diagonal, so that units do not matter.
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
    let is_determined = |share: &f64| *share < DETERMINED_BELOW;
    let open = relative.iter().zip(&names).filter(|(share, _)| !is_determined(share)).max_by(|a, b| a.0.total_cmp(b.0));
    Information {
        protocol: protocol.name.clone(),
        minutes,
        parameters: relative.len(),
        determined: relative.iter().filter(|share| is_determined(share)).count(),
        worst_percent: relative.iter().copied().filter(is_determined).reduce(f64::max).map(|share| 100.0 * share),
        condition: most / least,
        left_open: open.map_or_else(String::new, |(_, name)| name.clone()),
    }
}

/// Returns names and values of a law's non-zero parameters.
fn parameters(law: &LawParams) -> (Vec<String>, Vec<f64>) {
    let mut law = law.clone();
    law.parameters_mut().into_iter().map(|own| (own.name, *own.value)).filter(|(_, value)| *value != 0.0).unzip()
}

/// Returns JᵀJ of the whitened readings, by central differences. The drift is an Ornstein-Uhlenbeck process, so each reading
/// minus the decayed previous one has nearly white errors; the correlation that white noise adds between neighbours is
/// neglected.
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

/// Returns the draw with the median error, and the mean coverage of all draws.
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

/// Converts readings through a divider whose resistor is the geometric mean of their range.
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
    // A correction models the law's error on real readings, which simulated readings do not have.
    let params = sensor.params();
    let mut filter = sensor.filter().estimator(params.filter_of(params.default_estimator)).build()?;
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
