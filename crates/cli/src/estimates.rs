use std::io::Write;

use ohmstrain_bench_data::RowWriter;
use ohmstrain_calib::{Output, Quantity, ReadingUnit, SensorParams};
use ohmstrain_ekf::ReadingVerdict;
use ohmstrain_model::Joint;

use crate::error::CliError;

/// Writes `estimates.csv`: one row per reading, cells that are not known left empty.
pub struct EstimateWriter<W: Write> {
    rows: RowWriter<W>,
    columns: Vec<Column>,
    limits: (f64, f64),
    joint: Option<Joint<f64>>,
}

/// One row before it is written.
#[derive(Clone, Copy, Debug)]
pub struct EstimateRow {
    /// Time, s.
    pub time_s: f64,
    /// Reading as recorded; NaN where missing.
    pub reading: f64,
    /// Whether the converter stood at an end of its scale.
    pub saturated: bool,
    /// R₀ in the unit of the readings.
    pub rest_reading: f64,
    /// What the estimator says.
    pub output: Output,
}

/// A column's meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    Time,
    Reading,
    Strain,
    StrainSd,
    Rate,
    RateSd,
    Relaxation,
    RelaxationSd,
    Baseline,
    Settled,
    SettledSd,
    Phase(usize),
    BeyondBorder,
    Nis,
    Flags,
    Angle,
    AngleSd,
}

impl<W: Write> EstimateWriter<W> {
    /// Writes the header. `chosen` are the columns wanted, all if empty.
    pub fn new(out: W, params: &SensorParams, chosen: &[String]) -> Result<Self, CliError> {
        let joint = params
            .joint
            .map(|joint| Joint::new(joint.prestrain, joint.moment_arm_mm, joint.gauge_length_mm))
            .transpose()
            .map_err(|error| CliError::Input(format!("the sensor's joint: {error}")))?;
        let known = columns(params);
        let mut selected = Vec::new();
        if chosen.is_empty() {
            selected.clone_from(&known);
        }
        for name in chosen {
            match known.iter().find(|(known, _)| known == name) {
                Some(column) => selected.push(*column),
                None => {
                    let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
                    return Err(CliError::Arguments(format!(
                        "--columns: expected some of {}, found `{name}`",
                        names.join(",")
                    )));
                }
            }
        }
        let mut rows = RowWriter::new(out);
        selected.iter().for_each(|(name, _)| rows.text(name));
        rows.end()?;
        Ok(Self {
            rows,
            columns: selected.into_iter().map(|(_, column)| column).collect(),
            limits: (params.limits.lower, params.limits.upper),
            joint,
        })
    }

    /// Writes one row.
    pub fn write(&mut self, row: &EstimateRow) -> Result<(), CliError> {
        for column in &self.columns {
            match column {
                Column::Flags => self.rows.words(flags(row, self.limits)),
                _ => self.rows.number(value(*column, row, self.joint.as_ref())),
            }
        }
        Ok(self.rows.end()?)
    }

    /// Hands everything written so far on to the reader.
    pub fn flush(&mut self) -> Result<(), CliError> {
        Ok(self.rows.flush()?)
    }

    /// What is written to.
    pub const fn get_mut(&mut self) -> &mut W {
        self.rows.get_mut()
    }

    /// What was written to, without a flush.
    pub fn into_inner(self) -> W {
        self.rows.into_inner()
    }
}

/// A cell's number; NaN where it is not known.
fn value(column: Column, row: &EstimateRow, joint: Option<&Joint<f64>>) -> f64 {
    let estimate = &row.output.estimate;
    let angle = || joint.map(|joint| joint.angle_rad(estimate.strain.mean, estimate.strain.sd()));
    match column {
        Column::Time => row.time_s,
        Column::Reading => row.reading,
        Column::Strain => estimate.strain.mean,
        Column::StrainSd => estimate.strain.sd(),
        Column::Rate => estimate.rate.mean,
        Column::RateSd => estimate.rate.sd(),
        Column::Relaxation => estimate.relaxation.mean,
        Column::RelaxationSd => estimate.relaxation.sd(),
        Column::Baseline => estimate.baseline,
        Column::Settled => row.rest_reading * (1.0 + estimate.settled.mean),
        Column::SettledSd => row.rest_reading * estimate.settled.sd(),
        Column::Phase(index) => row.output.phases.map_or(f64::NAN, |phases| phases[index]),
        Column::BeyondBorder => estimate.beyond_border,
        Column::Nis => row.output.nis.unwrap_or(f64::NAN),
        Column::Angle => angle().map_or(f64::NAN, |(angle, _)| angle.to_degrees()),
        Column::AngleSd => angle().map_or(f64::NAN, |(_, sd)| sd.to_degrees()),
        Column::Flags => f64::NAN,
    }
}

/// Names of the flags that are raised.
fn flags(row: &EstimateRow, limits: (f64, f64)) -> impl Iterator<Item = &'static str> {
    let strain = row.output.estimate.strain.mean;
    [
        ("missing", row.reading.is_nan() && !row.saturated),
        ("saturated", row.saturated),
        ("rejected", row.output.verdict == ReadingVerdict::Rejected),
        ("downweighted", row.output.verdict == ReadingVerdict::Downweighted),
        ("implausible", row.output.verdict == ReadingVerdict::Implausible),
        ("stuck", row.output.verdict == ReadingVerdict::Stuck),
        ("readmitted", row.output.verdict == ReadingVerdict::Readmitted),
        ("ramp_border", row.output.estimate.near_ramp_border),
        ("at_limit", strain <= limits.0 || strain >= limits.1),
    ]
    .into_iter()
    .filter_map(|(name, raised)| raised.then_some(name))
}

/// All columns of a sensor, in order.
fn columns(params: &SensorParams) -> Vec<(&'static str, Column)> {
    let (reading, settled, settled_sd) = match params.reading {
        ReadingUnit::Ohm => ("resistance_ohm", "settled_resistance_ohm", "settled_resistance_sd_ohm"),
        ReadingUnit::Ratio => ("resistance_ratio", "settled_resistance_ratio", "settled_resistance_sd_ratio"),
    };
    let [strain, strain_sd, rate, rate_sd] = match params.quantity {
        Quantity::Strain => ["strain", "strain_sd", "strain_rate", "strain_rate_sd"],
        Quantity::AngleDeg => ["angle_deg", "angle_sd", "angle_rate", "angle_rate_sd"],
    };
    let mut columns = vec![
        ("time_s", Column::Time),
        (reading, Column::Reading),
        (strain, Column::Strain),
        (strain_sd, Column::StrainSd),
        (rate, Column::Rate),
        (rate_sd, Column::RateSd),
        ("relaxation", Column::Relaxation),
        ("relaxation_sd", Column::RelaxationSd),
        ("baseline", Column::Baseline),
        (settled, Column::Settled),
        (settled_sd, Column::SettledSd),
        ("p_extend", Column::Phase(0)),
        ("p_hold", Column::Phase(1)),
        ("p_retract", Column::Phase(2)),
        ("p_beyond_border", Column::BeyondBorder),
        ("nis", Column::Nis),
        ("flags", Column::Flags),
    ];
    if params.joint.is_some() {
        columns.extend([("angle_deg", Column::Angle), ("angle_sd", Column::AngleSd)]);
    }
    columns
}
