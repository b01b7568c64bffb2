//! Plans of recordings and their value, simulated with a sensor's own law before anything has been recorded.

mod motion;
mod pacing;
mod worth;

use std::path::Path;

use comfy_table::ColumnConstraint;
use ohmstrain::{Calibration, EstimatorKind, Sensor, trace};
use ohmstrain_bench_data::simulate::{Protocol, SimulationSettings};
use ohmstrain_bench_data::{Metadata, ReferenceQuantity};
use serde::Serialize;

use super::calibrate::calibrate_recordings;
use super::simulate;
use crate::args::PlanArgs;
use crate::error::{CliError, shell_word};
use crate::input;
use crate::messages::Messages;
use crate::output::{self, Kind, Outputs, print, wrapped};
use crate::printable::printable;
use crate::progress::Progress;
use crate::protocol_file;
use crate::sensor_file;
use motion::Protocols;
use ohmstrain::number::{self, fixed, significant};
use worth::{Information, Sampling};

/// Version of the output of `--json`.
const SCHEMA: u32 = 1;

/// Content of the output of `--json`.
#[derive(Serialize)]
struct Json<'a> {
    sensor: String,
    recordings: &'a [Information],
    #[serde(flatten)]
    sampling: &'a Sampling,
}

/// Plans a recording.
pub fn run(args: &PlanArgs, messages: &Messages) -> Result<(), CliError> {
    if let Some(path) = &args.output {
        return protocol(args, path);
    }
    let (sensor, name) = match &args.sensor {
        Some(path) => (sensor_file::read(path, None)?, path.display().to_string()),
        None => (illustrative(args, messages)?, format!("an illustrative sensor ({})", args.material)),
    };
    let joint = trace::joint(&Metadata { joint: args.joint, ..Metadata::default() });
    let sensor = joint.map_or(Ok(sensor.clone()), |joint| sensor.on_joint(joint))?;
    let progress = Progress::new("planning", messages);
    let protocols = Protocols::new(sensor.params());
    let information: Vec<Information> =
        protocols.all().iter().map(|protocol| worth::recording_information(&sensor, protocol)).collect();
    let worth = worth::sampling(&sensor, &protocols)?;
    drop(progress);
    print(|out| {
        if args.json {
            return output::json(out, SCHEMA, &Json { sensor: name, recordings: &information, sampling: &worth });
        }
        Ok(out.write_all(text(&sensor, &name, &protocols, &information, &worth).as_bytes())?)
    })
}

/// Writes a protocol for a person, and prints what it requires.
fn protocol(args: &PlanArgs, path: &Path) -> Result<(), CliError> {
    let (quantity, positions) = match (&args.strains, &args.angles) {
        (Some(strains), _) => (ReferenceQuantity::Strain, strains),
        (None, Some(angles)) => (ReferenceQuantity::AngleDeg, angles),
        (None, None) => {
            let what = "-o: expected --strains or --angles, the positions of the protocol: --strains 'rest=0 full=0.2'";
            return Err(CliError::Arguments(what.into()));
        }
    };
    let mut outputs = Outputs::new(args.replace.force, []);
    let claim = outputs.claim(path, Kind::Protocol)?;
    let joints = args.joints.len().max(1);
    let values = positions.0.iter().map(|(name, value)| (name.clone(), vec![*value; joints], f64::NAN));
    let mut pacing = protocol_file::pacing(quantity, args.joints.clone(), values.collect());
    pacing.steps = pacing::steps(&pacing, args.minutes);
    pacing.validate().map_err(|error| CliError::Arguments(error.to_string()))?;
    outputs.put(claim, protocol_file::text(&pacing)?);
    outputs.publish()?;
    let names: Vec<&str> = pacing.positions.iter().map(|position| position.name.as_str()).collect();
    print(|out| {
        let (steps, minutes) = (pacing.steps.len(), significant(pacing.duration_s() / 60.0, 2));
        let text = format!("{}: {steps} steps in {minutes} minutes, held at {}", path.display(), names.join(", "));
        let word = shell_word(&path.display().to_string());
        let next = format!("next: ohmstrain record --port /dev/ttyACM0 --protocol {word} -o trace.csv");
        Ok(write!(out, "{}\n{}\n", printable(&text), printable(&next))?)
    })
}

/// Returns a sensor calibrated on a simulated bench session, whose law is as wrong as for real sensors.
fn illustrative(args: &PlanArgs, messages: &Messages) -> Result<Sensor, CliError> {
    let settings = SimulationSettings {
        speed_mm_s: 5.0,
        sample_rate_hz: 5.0,
        mismatched: true,
        ..SimulationSettings::new(args.material, Protocol::Mixed { duration_s: 400.0 })
    };
    let bytes = simulate::bytes(&settings).map_err(CliError::Other)?;
    let recording = input::parse(&bytes, "simulated.csv".as_ref(), &Metadata::default())?;
    let calibration = Calibration::new().estimator(EstimatorKind::SignSplit);
    Ok(calibrate_recordings(&[recording], calibration, &Progress::new("simulating", messages))?.sensor)
}

fn text(sensor: &Sensor, name: &str, protocols: &Protocols, information: &[Information], worth: &Sampling) -> String {
    let params = sensor.params();
    let (factor, unit) = number::shown(params.quantity);
    let shown = |x: f64| format!("{}{unit}", significant(factor * x, 3));
    let speeds: Vec<String> = protocols.speeds.iter().map(|speed| format!("{}/s", shown(*speed))).collect();
    let (low, high) = (params.law.range.lower, params.law.range.upper);
    let mut text = wrapped(&format!(
        "{name}: {} to {}, relaxation within {} s. All of this is simulated with the sensor's own law: what the law gets wrong \
         comes on top.\n\nNumber of the law's parameters that a recording determines to ± 25 % or better, and the worst of \
         their errors, at speeds of {} and levels of a quarter, a half, three quarters and all of the range:\n",
        shown(low),
        shown(high),
        significant(protocols.slowest_s, 2),
        speeds.join(", ")
    ));
    let mut recordings =
        output::wrapped_table(["recording", "minutes", "determined", "worst", "condition", "least certain"]);
    for one in information {
        recordings.add_row([
            one.protocol.to_string(),
            fixed(one.minutes, 1),
            format!("{} of {}", one.determined, one.parameters),
            one.worst_percent.map_or("-".into(), |worst| format!("± {} %", significant(worst, 2))),
            format!("{:.0e}", one.condition),
            one.left_open.clone(),
        ]);
    }
    let estimator = params.filter_of(params.default_estimator).name();
    // Names of parameters are not wrapped, those of recordings are.
    if let Some(left_open) = recordings.column_mut(5) {
        left_open.set_constraint(ColumnConstraint::ContentWidth);
    }
    text += &format!("{recordings}\n");
    if let Some(best) = worth::best(information) {
        text += &wrapped(&format!("Most informative for its duration: {}.\n", best.protocol));
    }
    text += &wrapped(&format!(
        "\nError of strain by the filter {estimator}, % of the range (share of rows in the 95 % interval), by sampling and \
         converter:"
    ));
    let converter = |bits| if bits == 0 { "no quantisation".into() } else { format!("{bits} bits") };
    let header = ["readings per s".to_owned()].into_iter().chain(worth::BITS.map(converter));
    let mut errors = output::wrapped_table(header);
    for rate in worth::RATES_HZ {
        let of_rate = worth.cases.iter().filter(|one| one.rate_hz == rate);
        let cells = of_rate.map(|one| format!("{} ({:.0})", fixed(one.error_percent, 1), one.coverage_percent));
        errors.add_row([format!("{rate}")].into_iter().chain(cells));
    }
    text += &format!("{errors}\n");
    text += "Medians of five draws of noise and drift, without a learned correction.\n";
    if worth.is_lost() {
        text += &wrapped(
            "The error grows with the rate: the filter loses the strain of this sensor, and its errors say nothing of sampling. \
             Take 10 to 50 readings per s.\n",
        );
    } else if let Some(enough) = worth.enough() {
        let bits = enough.bits.map_or("a converter without quantisation".into(), |bits| format!("{bits} bits"));
        text +=
            &wrapped(&format!("{} readings per s by {bits} come within a tenth of the least error.\n", enough.rate_hz));
    }
    if let Some(summary) = params.summary.as_ref().filter(|_| params.default_estimator == EstimatorKind::Corrected) {
        text += &wrapped(&format!(
            "With its correction this sensor's calibration left {} % on quarters left out.\n",
            fixed(summary.left_out_percent_fs, 1)
        ));
    }
    text += &wrapped(&floor(worth));
    text += "The converter is read through a divider whose resistor is the geometric mean of the readings' range.\n";
    if let Some(best) = worth.cases.iter().filter_map(|one| one.angle_deg).reduce(f64::min) {
        text += &format!("Of the joint's angle the least of these errors is {}°.\n", significant(best, 2));
    }
    text
}

/// Describes the errors that no sampling scheme reduces.
fn floor(worth: &Sampling) -> String {
    let Sampling { drift_alone_percent, noise_alone_percent, neither_percent, .. } = worth;
    let shown = |percent: &f64| fixed(*percent, 1);
    format!(
        "Of {} readings per s drift by itself leaves {}, noise by itself {}, and exact readings {}. What exact readings leave is \
         the filter's own: it allows for an error of the law, and has to find out which way the body moves. Neither that nor \
         drift is mended by rate or converter, but by a better filter (--sensor, calibrated by default) and by rests now and \
         then (--rest-resistance, filter --known).\n",
        worth::FASTEST_HZ,
        shown(drift_alone_percent),
        shown(noise_alone_percent),
        shown(neither_percent)
    )
}
