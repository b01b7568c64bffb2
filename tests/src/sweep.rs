//! The sweep of faults: kinds, severities, recordings, and rows of its table.

use ohmstrain::{EstimatorKind, Sensor};
use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::faults::{Episode, Fault};
use ohmstrain_bench_data::simulate::{Material, Protocol, SettingsError, SimulationSettings, simulate};

use crate::faults::{AFTER_S, Answer, BEFORE_S, FilterOutput, answer, estimates};

/// A sensor calibrated on the first half of the demo's recording: `ohmstrain demo --seed 1`, version 0.1.0.
pub const SENSOR: &str = include_str!("../fixtures/representative.toml");
/// Number of onset times of every fault.
const ONSETS: usize = 6;
/// End of the calibration's rows, which are not scored, s.
const CALIBRATED_UNTIL_S: f64 = 200.0;

/// A fault with its severity and duration.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Name in the table.
    pub name: &'static str,
    /// Kind and size of the fault.
    pub fault: Fault,
    /// Duration, s.
    pub lasts_s: f64,
}

const fn case(name: &'static str, fault: Fault, lasts_s: f64) -> Case {
    Case { name, fault, lasts_s }
}

/// All faults, mild and severe. The sensor reads 1.6 to 3.8 kΩ.
pub const CASES: [Case; 35] = [
    case("nothing", Fault::Dropout { share: 0.0 }, 10.0),
    case("dropout, every other reading, 20 s", Fault::Dropout { share: 0.5 }, 20.0),
    case("dropout, all, 2 s", Fault::Dropout { share: 1.0 }, 2.0),
    case("dropout, all, 20 s", Fault::Dropout { share: 1.0 }, 20.0),
    case("burst of noise, 2 % of R₀, 10 s", Fault::Burst { sd: 0.02 }, 10.0),
    case("burst of noise, 20 % of R₀, 10 s", Fault::Burst { sd: 0.2 }, 10.0),
    case("one spike, × 1.3", Fault::Spike { factor: 1.3 }, 0.05),
    case("one spike, × 10", Fault::Spike { factor: 10.0 }, 0.05),
    case("spikes × 1.3, 5 % of the rows, 20 s", Fault::Spikes { share: 0.05, factor: 1.3 }, 20.0),
    case("spikes × 10, 1 % of the rows, 20 s", Fault::Spikes { share: 0.01, factor: 10.0 }, 20.0),
    case("stuck, 2 s", Fault::Stuck, 2.0),
    case("stuck, 20 s", Fault::Stuck, 20.0),
    case("saturated in the upper 20 %, 20 s", Fault::Saturation { share: 0.8 }, 20.0),
    case("saturated in the upper 60 %, 20 s", Fault::Saturation { share: 0.4 }, 20.0),
    case("unplugged, 5 kΩ, 2 s", Fault::UnpluggedHigh { reading: 5000.0 }, 2.0),
    case("unplugged, 210 kΩ, 2 s", Fault::UnpluggedHigh { reading: 210e3 }, 2.0),
    case("one code below the rail, 10.2 MΩ, 20 s", Fault::UnpluggedHigh { reading: 10.2e6 }, 20.0),
    case("unplugged, 1 kΩ, 5 s", Fault::UnpluggedLow { reading: 1000.0 }, 5.0),
    case("short circuit, 1.6 Ω, 5 s", Fault::UnpluggedLow { reading: 1.6 }, 5.0),
    case("step in baseline, 5 % of R₀, 10 s", Fault::BaselineStep { share: 0.05 }, 10.0),
    case("step in baseline, 50 % of R₀, 10 s", Fault::BaselineStep { share: 0.5 }, 10.0),
    case("gain × 1.1, 20 s", Fault::GainChange { factor: 1.1 }, 20.0),
    case("gain × 1.5, 20 s", Fault::GainChange { factor: 1.5 }, 20.0),
    case("polarity flipped, 10 s", Fault::PolarityFlip, 10.0),
    case("jitter, 10 % of a step, 20 s", Fault::Jitter { share: 0.1 }, 20.0),
    case("jitter, 40 % of a step, 20 s", Fault::Jitter { share: 0.4 }, 20.0),
    case("duplicated, 20 % of the rows, 20 s", Fault::Duplicated { share: 0.2 }, 20.0),
    case("late, 20 % of the rows, 20 s", Fault::Late { share: 0.2 }, 20.0),
    case("R₀ × 1.05, 20 s", Fault::WrongRest { factor: 1.05 }, 20.0),
    case("R₀ × 1.1, 20 s", Fault::WrongRest { factor: 1.1 }, 20.0),
    case("R₀ × 1.2, 20 s", Fault::WrongRest { factor: 1.2 }, 20.0),
    case("R₀ × 0.9, 20 s", Fault::WrongRest { factor: 0.9 }, 20.0),
    case("slipped by 2 % strain, 20 s", Fault::Slipped { by: 0.02 }, 20.0),
    case("clock 5 % fast, 20 s", Fault::WrongRate { factor: 1.05 }, 20.0),
    case("clock twice as fast, 20 s", Fault::WrongRate { factor: 2.0 }, 20.0),
];

/// Returns the rest of the calibration recording, and another recording of the same sensor.
///
/// # Errors
/// Never: the settings are valid.
pub fn recordings() -> Result<[Trace; 2], SettingsError> {
    let recording = |seed: u64| {
        simulate(&SimulationSettings {
            speed_mm_s: 5.0,
            mismatched: true,
            seed,
            ..SimulationSettings::new(Material::Representative, Protocol::MIXED)
        })
    };
    Ok([recording(1)?, recording(2)?])
}

/// A filter: estimates of a recording, row by row, with the true strain.
pub type Run<'a> = Box<dyn Fn(&Trace) -> Vec<(FilterOutput, f64)> + 'a>;

/// Returns a run of the library with an estimator of the sensor.
#[must_use]
pub fn of_library(sensor: &Sensor, kind: EstimatorKind) -> Run<'_> {
    Box::new(move |trace| estimates(sensor.filter().estimator(kind), trace))
}

/// Returns the response of a filter to a fault, over one or more recordings.
#[must_use]
pub fn answer_to(run: &Run, case: &Case, traces: &[Trace]) -> Answer {
    let mut sum = Answer::default();
    for trace in traces {
        let strain = trace.reference.iter().flat_map(|reference| &reference.values);
        let (low, high) = strain.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
        let last_s = trace.time_s.last().copied().unwrap_or(0.0) - AFTER_S - case.lasts_s;
        let first_s = CALIBRATED_UNTIL_S.max(BEFORE_S);
        // An odd fraction of a second, so that no onset coincides with a turn of the machine.
        let onset = |k: usize| first_s + 0.73 + (last_s - first_s - 1.0) * k as f64 / (ONSETS - 1) as f64;
        let onsets: [f64; ONSETS] = std::array::from_fn(onset);
        let episode = Episode { fault: case.fault, from_s: 0.0, until_s: case.lasts_s, seed: 1 };
        sum.merge(answer(run, trace, (episode, &onsets), high - low));
    }
    sum
}

/// Returns a row of the table, in Markdown.
#[must_use]
pub fn row(name: &str, run: &Run, case: &Case, traces: &[Trace]) -> String {
    let response = answer_to(run, case, traces);
    let cell = |score: &crate::faults::Score| format!("{:.1} ({:.0})", score.rmse(), score.coverage());
    format!(
        "| {} | {} | {} | {} | {} | {} | {:.0} | {:.0} | {:.0} | {:.0} |",
        case.name,
        name,
        cell(&response.before),
        cell(&response.during),
        cell(&response.soon),
        cell(&response.later),
        response.during.flagged(),
        response.during.silent(),
        response.recovered(),
        response.slowest_s()
    )
}
