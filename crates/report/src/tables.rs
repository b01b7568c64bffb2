//! Tables of the report: scores and the sensor's parameters.

use ohmstrain_model::{Gauge, StrainRange};
use ohmstrain_sensor::{MotionParams, Quantity, ReadingUnit, SensorParams, Uncertainty};
use serde::Serialize;

use super::recording::Z_95;
use super::{Sample, ScoreRow};
use ohmstrain::number::{percent, plain, with_error};

/// A table; the first cell of a row is its heading.
#[derive(Debug, Serialize)]
pub struct Table {
    caption: String,
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn new<const N: usize>(caption: &str, header: [&str; N], rows: Vec<[String; N]>) -> Self {
        Self {
            caption: caption.into(),
            header: header.map(String::from).to_vec(),
            rows: rows.into_iter().map(Vec::from).collect(),
        }
    }
}

/// Returns the unit of the estimated quantity.
pub fn unit(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Strain => "–",
        Quantity::AngleDeg => "°",
    }
}

/// Returns the unit of `per` over the given power of the quantity.
fn per_quantity(quantity: Quantity, power: usize) -> String {
    let raised = ["", "", "²", "³"].get(power).copied().unwrap_or("");
    match quantity {
        Quantity::Strain => "–".into(),
        Quantity::AngleDeg => format!("1/°{raised}"),
    }
}

/// Returns the unit of the quantity's rate, or of its second derivative.
fn per_time(quantity: Quantity) -> String {
    match quantity {
        Quantity::Strain => "1/s".into(),
        Quantity::AngleDeg => "°/s".into(),
    }
}

/// Returns the table of scores, one estimator per row.
pub fn scores(rows: &[ScoreRow], quantity: Quantity, sample: Sample) -> Table {
    let rmse = match quantity {
        Quantity::Strain => "RMSE (strain)",
        Quantity::AngleDeg => "RMSE (°)",
    };
    let cells = |row: &ScoreRow| {
        let share = |share: Option<f64>| share.map_or_else(|| "–".into(), percent);
        let scores = &row.scores;
        [
            row.name.to_owned(),
            plain(scores.rmse),
            percent(scores.rmse_percent_fs / 100.0),
            share(scores.coverage_95),
            share(scores.width_95_percent_fs.map(|width| width / 100.0)),
            percent(scores.crps_percent_fs / 100.0),
        ]
    };
    let caption = format!(
        "Errors ({}): RMSE, how often the 95 % interval holds the reference and how wide it is, and the ranked probability \
         score (CRPS), which counts both",
        sample.name()
    );
    Table::new(
        &caption,
        ["Estimate", rmse, "of full scale", "Coverage of 95 % interval", "Width, of full scale", "CRPS, of full scale"],
        rows.iter().map(cells).collect(),
    )
}

/// Lists all parameters in the sensor's file.
pub fn parameters(params: &SensorParams, rest_reading: f64) -> Vec<Table> {
    let mut tables = vec![law(params, rest_reading)];
    tables.extend(estimator(params));
    tables.push(ranges(params));
    if !params.recordings.is_empty() {
        tables.push(recordings(params));
    }
    tables
}

/// Rows of a parameter table under construction.
struct ParameterRows<'a> {
    rows: Vec<[String; 4]>,
    uncertainty: Option<&'a Uncertainty>,
    found: Vec<usize>,
}

impl ParameterRows<'_> {
    /// Adds a value of the law in use, and its uncertainty under its `path` in the sensor's file.
    fn fitted(&mut self, name: &str, path: &str, value: f64, unit: &str) {
        let place = self.uncertainty.and_then(|known| known.names.iter().position(|name| name == path));
        self.found.extend(place);
        let estimate = self.uncertainty.map_or_else(|| "–".into(), |known| estimate_text(known, place));
        self.rows.push([name.into(), plain(value), estimate, unit.into()]);
    }

    /// Adds the errors of parameters without a row of their own.
    fn rest(&mut self) {
        let Some(known) = self.uncertainty else { return };
        let entries = known.names.iter().zip(&known.values).zip(&known.standard_errors).enumerate();
        for (place, ((name, value), error)) in entries {
            if !self.found.contains(&place) {
                self.rows.push([name.clone(), "–".into(), with_error(*value, *error), String::new()]);
            }
        }
    }
}

/// Formats the estimate of a parameter from the recordings; one whose interval contains zero is not determined.
fn estimate_text(known: &Uncertainty, place: Option<usize>) -> String {
    let at = |values: &[f64]| place.and_then(|place| values.get(place).copied());
    match (at(&known.values), at(&known.standard_errors)) {
        (Some(value), Some(error)) if value.abs() > Z_95 * error => with_error(value, error),
        (Some(value), Some(error)) => format!("undetermined ({})", with_error(value, error)),
        _ => "undetermined".into(),
    }
}

fn law(params: &SensorParams, rest_reading: f64) -> Table {
    let (law, quantity) = (&params.law, params.quantity);
    let mut rows = ParameterRows { rows: vec![], uncertainty: params.uncertainty.as_ref(), found: vec![] };
    let reading = match params.reading {
        ReadingUnit::Ohm => "Ω",
        ReadingUnit::Ratio => "–",
    };
    rows.fitted("R₀ of the law", "rest_reading", rest_reading, reading);
    if let Some(measured) = params.measured_rest {
        rows.rows.push(["Reading of the rested sensor".into(), plain(measured), plain(measured), reading.into()]);
    }
    gauge(&mut rows, &law.gauge, quantity);
    let seconds = match quantity {
        Quantity::Strain => "s",
        Quantity::AngleDeg => "s/°",
    };
    rows.fitted("Dash-pot while stretching η⁺", "extend_viscosity_s", law.extend_viscosity_s, seconds);
    rows.fitted("Dash-pot while releasing η⁻", "retract_viscosity_s", law.retract_viscosity_s, seconds);
    let (gain, slope) = (per_quantity(quantity, 1), per_quantity(quantity, 2));
    for (i, branch) in law.branches.iter().enumerate() {
        let parameters = [
            ("time constant τ", "tau_s", branch.tau_s, "s"),
            ("gain while stretching k⁺", "extend_gain", branch.extend_gain, gain.as_str()),
            ("gain while releasing k⁻", "retract_gain", branch.retract_gain, gain.as_str()),
            ("growth of k⁺ with strain κ⁺", "extend_gain_slope", branch.extend_gain_slope, slope.as_str()),
            ("growth of k⁻ with strain κ⁻", "retract_gain_slope", branch.retract_gain_slope, slope.as_str()),
        ];
        for (name, field, value, unit) in parameters {
            rows.fitted(&format!("Branch {}: {name}", i + 1), &format!("branches[{i}].{field}"), value, unit);
        }
    }
    rows.rest();
    Table::new(
        "The law: what the filter runs with, regularised by a ridge, and the fit without it, value ± \
         standard error",
        ["Parameter", "In the filter", "Told by the recordings", "Unit"],
        rows.rows,
    )
}

fn gauge(rows: &mut ParameterRows, gauge: &Gauge<f64>, quantity: Quantity) {
    let per = |power| per_quantity(quantity, power);
    match *gauge {
        Gauge::Polynomial { coefficients } => {
            for (i, (name, value)) in ["a₁", "a₂", "a₃"].iter().zip(coefficients).enumerate() {
                rows.fitted(&format!("Gauge curve {name}"), &format!("gauge.coefficients[{i}]"), value, &per(i + 1));
            }
        }
        Gauge::DecayingExponential { slope, decay_strain } => {
            rows.fitted("Gauge curve: slope at zero G", "gauge.slope", slope, &per(1));
            rows.fitted("Gauge curve: peak ε₀", "gauge.decay_strain", decay_strain, unit(quantity));
        }
        Gauge::Tunnelling { gap, barrier, path_loss } => {
            rows.fitted("Gauge curve: growth of the gap C", "gauge.gap", gap, &per(1));
            rows.fitted("Gauge curve: barrier A", "gauge.barrier", barrier, &per(1));
            rows.fitted("Gauge curve: loss of paths W", "gauge.path_loss", path_loss, &per(2));
        }
    }
}

fn estimator(params: &SensorParams) -> Option<Table> {
    let kind = params.filter_of(params.default_estimator);
    let estimator = params.estimator(kind).ok()?;
    let (noise, own) = (&estimator.noise, unit(params.quantity));
    let rate = per_time(params.quantity);
    let row = |name: &str, value: f64, unit: &str| [name.to_owned(), plain(value), unit.to_owned()];
    let mut rows = vec![
        row("White noise of a reading, of R₀", noise.reading_sd, "–"),
        row("Wander of each branch, of R₀", noise.branch_sd, "–"),
        row("Wander of the baseline, of R₀", noise.baseline_sd, "–"),
        row("Correlation time of the baseline", noise.baseline_time_s, "s"),
    ];
    let MotionParams { rate_time_s, rate_sd_per_s, strain_mean, strain_sd } = estimator.motion;
    rows.push(row("Motion: correlation time of the rate", rate_time_s, "s"));
    rows.push(row("Motion: sd of the rate", rate_sd_per_s, &rate));
    rows.push(row("Motion: mean", strain_mean, own));
    rows.push(row("Motion: sd", strain_sd, own));
    let caption = format!("Noise and motion for the estimator “{}”", kind.name());
    Some(Table::new(&caption, ["Parameter", "Value", "Unit"], rows))
}

fn ranges(params: &SensorParams) -> Table {
    let (own, rate) = (unit(params.quantity), per_time(params.quantity));
    let range = |range: StrainRange<f64>| format!("{} to {}", plain(range.lower), plain(range.upper));
    let validity = &params.validity;
    let seen = StrainRange { lower: validity.lower, upper: validity.upper };
    let mut rows = vec![
        ["Limits of the output".into(), range(params.limits), own.into()],
        ["Seen in calibration".into(), range(seen), own.into()],
        ["Fastest rate seen (99th percentile)".into(), plain(validity.fastest_rate_per_s), rate],
        ["Longest recording".into(), plain(validity.duration_s), "s".into()],
    ];
    if let Some(joint) = params.joint {
        rows.push(["Joint: strain at angle zero".into(), plain(joint.prestrain), "–".into()]);
        rows.push(["Joint: moment arm".into(), plain(joint.moment_arm_mm), "mm".into()]);
        rows.push(["Joint: gauge length".into(), plain(joint.gauge_length_mm), "mm".into()]);
    }
    Table::new(
        "Limits and validity; beyond what was seen, results are extrapolations",
        ["Range", "Value", "Unit"],
        rows,
    )
}

fn recordings(params: &SensorParams) -> Table {
    let cells = |recording: &ohmstrain_sensor::RecordingInfo| {
        let hash: String = recording.sha256.chars().take(12).collect();
        [recording.file.clone(), recording.rows.to_string(), plain(recording.rest_reading), hash]
    };
    Table::new(
        "Recordings in the calibration",
        ["File", "Rows", "R₀", "SHA-256, first digits"],
        params.recordings.iter().map(cells).collect(),
    )
}
