use ohmstrain_model::{AdcCode, FrontEnd};

use super::chamber::WarmedSensor;
use super::individual::{Individual, REST_SPREAD};
use super::matched::Matched;
use super::mismatched::Mismatched;
use super::noise::{Drift, Stream, conditioning, normal, random};
use super::profile::Profile;
use super::sensor::{Movement, StretchedSensor};
use super::{GAUGE_LENGTH_MM, SettingsError, SimulationSettings};
use crate::metadata::Metadata;
use crate::row::{ReadingKind, ReferenceQuantity};
use crate::spec::FrontEndSpec;
use crate::trace::{ConverterReadings, Readings, Reference, Trace};

/// Longest integration step, s, at any sampling rate.
const LONGEST_STEP_S: f64 = 0.01;

/// Simulates a recording: resistance (and codes, with a front end) and the exact strain, rounded to 1e-5.
///
/// # Errors
/// Names the invalid setting.
pub fn simulate(settings: &SimulationSettings) -> Result<Trace, SettingsError> {
    settings.validate()?;
    let profile = Profile::new(settings, &mut random(settings.seed, Stream::Profile));
    settings.check_rows(profile.duration_s())?;
    let mut individual = Individual::new(settings.individual);
    let rest_ohm = settings.material.rest_resistance_ohm() * individual.factor(REST_SPREAD);
    let truth = if settings.mismatched {
        run(&profile, settings.sample_rate_hz, &mut Mismatched::new(settings.material, &mut individual))
    } else {
        run(&profile, settings.sample_rate_hz, &mut Matched::new(settings.material))
    };
    let resistance_ohm = disturbed(settings, &profile, rest_ohm, &truth);
    let per_unit = settings.followed.as_ref().map_or(1.0, |followed| followed.strain_per_unit(settings.full_strain()));
    let quantity = settings.followed.as_ref().map_or(ReferenceQuantity::Strain, |followed| followed.pacing.quantity);
    // Resolution of the reference: as fine as the strain's.
    let exact = if quantity == ReferenceQuantity::Strain { 1e5 } else { 1e3 };
    Ok(Trace {
        metadata: metadata(settings),
        time_s: truth.iter().map(|sample| round(sample.time_s, 1e6)).collect(),
        readings: readings(settings, resistance_ohm)?,
        reference: Some(Reference {
            quantity,
            values: truth.iter().map(|sample| round(sample.strain / per_unit, exact)).collect(),
            sd: Vec::new(),
        }),
        temperature_c: settings
            .chamber
            .map(|chamber| truth.iter().map(|at| round(chamber.at(at.time_s), 10.0)).collect()),
    })
}

/// State of the sensor at one moment, undisturbed.
struct Sample {
    time_s: f64,
    strain: f64,
    relative_change: f64,
    /// Distance travelled so far, in units of strain.
    travel: f64,
}

/// Moves the sensor through the profile, sampling at a fixed rate from time zero to the end.
fn run(profile: &Profile, rate_hz: f64, sensor: &mut impl StretchedSensor) -> Vec<Sample> {
    let at_rest = Sample { time_s: 0.0, strain: 0.0, relative_change: 0.0, travel: 0.0 };
    let mut samples = vec![at_rest];
    let (mut now_s, mut travel) = (0.0, 0.0);
    for [(start_s, start), (end_s, end)] in profile.segments() {
        let rate = (end - start) / (end_s - start_s);
        let strain_at = |time_s: f64| start + rate * (time_s - start_s);
        while now_s < end_s {
            let next_sample_s = samples.len() as f64 / rate_hz;
            let then_s = end_s.min(next_sample_s).min(now_s + LONGEST_STEP_S);
            let movement = Movement {
                from_strain: strain_at(now_s),
                to_strain: if then_s < end_s { strain_at(then_s) } else { end },
                rate,
                duration_s: then_s - now_s,
            };
            sensor.advance(&movement);
            travel += rate.abs() * movement.duration_s;
            now_s = then_s;
            if now_s >= next_sample_s {
                let relative_change = sensor.relative_change(&movement);
                samples.push(Sample { time_s: now_s, strain: movement.to_strain, relative_change, travel });
            }
        }
    }
    samples
}

/// Returns the resistance with conditioning, drift and white noise, Ω.
fn disturbed(settings: &SimulationSettings, profile: &Profile, rest_ohm: f64, truth: &[Sample]) -> Vec<f64> {
    let disturbances = &settings.disturbances;
    let mut white = random(settings.seed, Stream::White);
    let mut drifting = random(settings.seed, Stream::Drift);
    let mut drift = Drift::new(disturbances.drift_density, &mut drifting);
    let mut warmed = settings.chamber.map(WarmedSensor::new);
    let cycle = 2.0 * profile.peak_strain();
    let resistance = |sample: &Sample| {
        let conditioned = if disturbances.conditioning { conditioning(sample.travel / cycle) } else { 0.0 };
        let drifted = drift.advance(1.0 / settings.sample_rate_hz, &mut drifting);
        let noise = disturbances.white_sd * normal(&mut white);
        let stretched = 1.0 + sample.relative_change;
        let stretched = warmed.as_mut().map_or(stretched, |warmed| warmed.resistance(sample.time_s, stretched));
        let relative = stretched * (1.0 + conditioned) * (1.0 + drifted) + noise;
        // The noise may be set large enough for a negative resistance, but resistances must be positive.
        rest_ohm * relative.max(1e-3)
    };
    truth.iter().map(resistance).collect()
}

/// Returns the recorded readings: the resistance itself, to 1 mΩ, or a front end's conversion of it.
fn readings(settings: &SimulationSettings, resistance_ohm: Vec<f64>) -> Result<Readings, SettingsError> {
    let Some(spec) = &settings.front_end else {
        let values = resistance_ohm.iter().map(|ohm| round(*ohm, 1e3)).collect();
        return Ok(Readings { kind: ReadingKind::Ohm, values, converter: None });
    };
    let front_end = spec.build().map_err(|error| SettingsError::FrontEnd(error.to_string()))?;
    let mut noise = random(settings.seed, Stream::Converter);
    let mut values = Vec::with_capacity(resistance_ohm.len());
    let mut converter = ConverterReadings::default();
    for ohm in resistance_ohm {
        let code = convert(spec, &front_end, ohm, normal(&mut noise));
        let (value, sd_ohm) = match front_end.read(code) {
            AdcCode::Reading(reading) => (reading.resistance_ohm, reading.sd_ohm),
            AdcCode::Saturated => (f64::NAN, f64::NAN),
        };
        values.push(value);
        converter.codes.push(Some(code));
        converter.sd_ohm.push(sd_ohm);
        converter.saturated.push(value.is_nan());
    }
    Ok(Readings { kind: ReadingKind::Ohm, values, converter: Some(converter) })
}

fn convert(spec: &FrontEndSpec, front_end: &FrontEnd<f64>, ohm: f64, noise: f64) -> u32 {
    let largest = f64::from((1_u32 << spec.bits()) - 1);
    let code = front_end.code(ohm) + spec.noise_codes() * noise;
    code.round().clamp(0.0, largest) as u32
}

fn metadata(settings: &SimulationSettings) -> Metadata {
    let other = [
        ("source", if settings.mismatched { "simulated-mismatched" } else { "simulated" }.to_owned()),
        ("protocol", settings.followed.as_ref().map_or(settings.protocol.name(), |_| "a person").to_owned()),
        ("elongation_mm", settings.elongation_mm.to_string()),
        match &settings.followed {
            Some(followed) => ("person", followed.person.to_string()),
            None => ("speed_mm_s", settings.speed_mm_s.to_string()),
        },
        ("seed", settings.seed.to_string()),
    ];
    Metadata {
        material: Some(settings.material.to_string()),
        gauge_length_mm: Some(GAUGE_LENGTH_MM),
        front_end: settings.front_end,
        joint: None,
        other: other
            .map(|(key, value)| (key.to_owned(), value))
            .into_iter()
            .chain(settings.chamber.map(|chamber| ("chamber".to_owned(), chamber.to_string())))
            .chain(settings.individual.map(|seed| ("individual".to_owned(), seed.to_string())))
            .collect(),
        ..Metadata::default()
    }
}

/// Rounds to a decimal resolution of `per_unit` steps per unit, so that files hold short numbers.
fn round(value: f64, per_unit: f64) -> f64 {
    (value * per_unit).round() / per_unit
}
