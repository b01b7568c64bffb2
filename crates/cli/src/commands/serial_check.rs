//! Comparison of a board's results with those of this computer.

use std::path::Path;

use ohmstrain_sensor::SensorParams;

use crate::args::SerialCheckArgs;
use crate::commands::export_choice;

use crate::error::CliError;
use crate::output::print;
use crate::port::{Event, Source};
use crate::sensor_file;
use crate::whole_file::is_stdin;
use ohmstrain_export::{self as export, ChipEstimate, Plan, ReplayedRow};

/// Number of steps that are compared from a port, which never ends.
const STEPS_OF_A_PORT: usize = 600;
/// Half the width of the interval, in standard deviations.
const HALF_WIDTH: f64 = 1.96;
/// Resolution of the strain that the sketch prints; the deviation is computed from two printed numbers.
const PRINTED_TO: f64 = 1e-5;
/// Tolerance, as a share of the deviation, far above the effect of another library's `expf`.
const SHARE_OF_DEVIATION: f64 = 0.01;
/// Tolerated share of steps with other flags, since a value may lie on a threshold.
const OTHER_FLAGS: f64 = 0.01;

/// Compares a board's estimates with those of the exported code's twin, given the board's readings.
pub fn run(args: &SerialCheckArgs) -> Result<(), CliError> {
    let asked = args.estimator.chosen();
    let sensor = sensor_file::read(&args.sensor, asked)?;
    let name = args.sensor.display().to_string();
    let params = sensor.params();
    let dt_s = export_choice::usual_step_s(args.dt_s, params)?;
    let plan = match &args.budget {
        None => Plan { kind: asked, ..Plan::default() },
        Some(budget) => export::first_fitting(params, budget, dt_s).map_err(|error| CliError::export(&error, &name))?,
    };
    let received = listen(args)?;
    let expected_rows =
        replayed(params, &plan, dt_s, &received.steps).map_err(|error| CliError::export(&error, &name))?;
    let farthest = compared(&received.steps, &expected_rows)?;
    print(|out| {
        writeln!(out, "{} steps, {} other lines", received.steps.len(), received.others)?;
        writeln!(
            out,
            "largest difference: strain {:.1e}, its deviation {:.1e}; the deviation is {:.1e} at least; \
             other flags in {} steps",
            farthest.strain, farthest.sd, farthest.least_sd, farthest.other_flags
        )?;
        Ok(writeln!(out, "The board computes what this computer does.")?)
    })
}

/// Line that the sketch prints.
const LINE: &str = "step:0,us:50000,ohm:1600.0000,reading_sd:4.000000,strain:0.10000,lo:0.08000,hi:0.12000,flags:0";

/// A step as the board printed it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BoardStep {
    number: u64,
    /// Time since the step before, µs.
    since_us: u32,
    ohm: f64,
    /// Standard deviation of the reading; 0 from a sketch without one.
    ohm_sd: f64,
    strain: f64,
    sd: f64,
    flags: u32,
}

impl BoardStep {
    /// Parses a line like [`LINE`]; `None` for any other.
    fn of(line: &[u8]) -> Option<Self> {
        let line = std::str::from_utf8(line).ok()?.trim();
        let parts: Vec<(&str, &str)> = line.split(',').map(|part| part.split_once(':')).collect::<Option<_>>()?;
        let text = |label: &str| parts.iter().find(|(name, _)| *name == label).map(|(_, value)| *value);
        let number = |label: &str| text(label)?.parse::<f64>().ok();
        let ohm = match text("ohm")? {
            // Values beyond the range that Arduino prints.
            "ovf" => f64::INFINITY,
            "-ovf" => f64::NEG_INFINITY,
            other => other.parse().ok()?,
        };
        let sd = (number("hi")? - number("lo")?) / (2.0 * HALF_WIDTH);
        let (since_us, flags) = (text("us")?.parse().ok()?, text("flags")?.parse().ok()?);
        let ohm_sd = if text("reading_sd").is_some() { number("reading_sd")? } else { 0.0 };
        Some(Self { number: text("step")?.parse().ok()?, since_us, ohm, ohm_sd, strain: number("strain")?, sd, flags })
    }
}

/// Lines that came from a board.
struct Received {
    steps: Vec<BoardStep>,
    /// Number of lines that are not steps.
    others: usize,
}

/// Reads until there are enough steps, starting with a board's first one.
fn listen(args: &SerialCheckArgs) -> Result<Received, CliError> {
    let name = args.port.display().to_string();
    let ends = is_stdin(&args.port) || args.port.is_file();
    let wanted = args.steps.unwrap_or(if ends { usize::MAX } else { STEPS_OF_A_PORT });
    let mut received = Received { steps: Vec::new(), others: 0 };
    let mut late = None;
    for event in Source::open(Path::new(&args.port), args.baud)?.events {
        let line = match event {
            Event::Line(line, _) => line,
            Event::Connected => continue,
            Event::Ended => break,
            Event::Failed(error) => return Err(CliError::Other(format!("cannot read {name}: {error}"))),
            Event::Away(why) => return Err(CliError::Other(format!("cannot read {name}: {why}"))),
        };
        match BoardStep::of(&line) {
            None => received.others += 1,
            Some(step) if step.number == 0 => received.steps = vec![step],
            Some(step) if received.steps.is_empty() => late = late.or(Some(step.number)),
            Some(step) => {
                let expected = received.steps.len() as u64;
                if step.number != expected {
                    return Err(CliError::Input(format!(
                        "{name}: expected step {expected}, found step {}: lines were lost; send fewer, or faster",
                        step.number
                    )));
                }
                received.steps.push(step);
            }
        }
        if received.steps.len() >= wanted {
            break;
        }
    }
    match (received.steps.is_empty(), late) {
        (false, _) => Ok(received),
        (true, Some(number)) => Err(CliError::Input(format!(
            "{name}: expected step 0 first, found step {number}: reset the board while it is listened to"
        ))),
        (true, None) => Err(CliError::Input(format!(
            "{name}: expected lines like {LINE}, found none in {}; is OHMSTRAIN_CHECK 1 in the sketch?",
            received.others
        ))),
    }
}

/// Returns the twin's estimates from the board's readings.
fn replayed(
    params: &SensorParams,
    plan: &Plan,
    dt_s: f64,
    steps: &[BoardStep],
) -> Result<Vec<ChipEstimate>, export::ExportError> {
    // Rounded as the sketch rounds it.
    let row = |step: &BoardStep| ReplayedRow {
        since_s: 1e-6_f32 * step.since_us as f32,
        reading: step.ohm,
        reading_sd: step.ohm_sd,
    };
    let rows: Vec<ReplayedRow> = steps.iter().map(row).collect();
    export::replay(params, plan, dt_s, &rows)
}

/// Largest differences.
struct Farthest {
    strain: f64,
    sd: f64,
    least_sd: f64,
    /// Number of steps with other flags, which happens on a threshold.
    other_flags: usize,
}

fn compared(steps: &[BoardStep], expected_rows: &[ChipEstimate]) -> Result<Farthest, CliError> {
    let mut farthest = Farthest { strain: 0.0, sd: 0.0, least_sd: f64::INFINITY, other_flags: 0 };
    for (step, expected) in steps.iter().zip(expected_rows) {
        let (strain, sd) = (f64::from(expected.strain), f64::from(expected.sd));
        let (of_strain, of_sd) = ((step.strain - strain).abs(), (step.sd - sd).abs());
        let least = PRINTED_TO + SHARE_OF_DEVIATION * sd;
        // Written so that NaN is a disagreement.
        if !(of_strain <= least && of_sd <= least) {
            return Err(CliError::Check(format!(
                "step {}: expected strain {strain:.5} ± {sd:.5} for {} ohm, found {:.5} ± {:.5} on the board; was it \
                 exported from this sensor, with this estimator?",
                step.number, step.ohm, step.strain, step.sd
            )));
        }
        farthest.strain = farthest.strain.max(of_strain);
        farthest.sd = farthest.sd.max(of_sd);
        farthest.least_sd = farthest.least_sd.min(sd);
        farthest.other_flags += usize::from(step.flags != expected.flags);
    }
    if farthest.other_flags as f64 > OTHER_FLAGS * steps.len() as f64 {
        let count = farthest.other_flags;
        return Err(CliError::Check(format!("{count} of {} steps: other flags on the board", steps.len())));
    }
    Ok(farthest)
}

#[cfg(test)]
mod tests {
    use super::{BoardStep, LINE};

    #[test]
    fn a_line_is_a_step_or_something_else() {
        let step =
            BoardStep::of(b"step:3,us:50012,ohm:1600.5000,strain:0.10000,lo:0.08040,hi:0.11960,flags:16\r").unwrap();
        assert_eq!((step.number, step.since_us, step.ohm, step.strain, step.flags), (3, 50012, 1600.5, 0.1, 16));
        assert!((step.sd - 0.01).abs() < 1e-12 && BoardStep::of(LINE.as_bytes()).is_some());
        let open = BoardStep::of(b"step:4,us:50000,ohm:ovf,strain:0.1,lo:0.0,hi:0.2,flags:2").unwrap();
        assert_eq!(open.ohm, f64::INFINITY);
        for other in
            ["", "ets Jul 29 2019", "strain:0.1,lo:0.0,hi:0.2,flags:0", "step:4,us:5,ohm:16", "time_s,resistance_ohm"]
        {
            assert_eq!(BoardStep::of(other.as_bytes()), None, "{other}");
        }
    }
}
