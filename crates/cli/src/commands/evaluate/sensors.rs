use std::path::Path;
use std::time::Instant;

use ohmstrain::trace::TraceFile;
use ohmstrain::{Calibrated, Calibration, ValidityWatch};
use ohmstrain_bench_data::segment;
use ohmstrain_calib::{Baselines, PhaseRows, PublishedLaw};
use ohmstrain_sensor::{EstimatorKind, StaticCubic};

use super::known_strains::KnownStrains;
use super::scores::{BaselineScores, LearnedScores, RecordingScores};
use super::settled::SettledScores;
use crate::args::Estimators;
use crate::commands::calibrate::calibrate_recordings;
use crate::error::CliError;
use crate::progress::Progress;
use crate::sensor_file;
use ohmstrain_report::{Sample, Scored, estimate, scoring};

/// A calibrated sensor and the estimator that it is judged with.
pub struct JudgedSensor {
    /// The sensor.
    pub sensor: ohmstrain::Sensor,
    /// The estimator.
    pub kind: EstimatorKind,
    /// Wall-clock time of the calibration, s; `None` if it was read from a file.
    calibration_s: Option<f64>,
    /// True if it is shown as a part of another one.
    pub is_part: bool,
    /// Name of the scores: the estimator's name, or that of the part left out.
    name: &'static str,
}

/// Baselines that the sensor is compared with.
pub struct Rivals {
    pub static_cubic: StaticCubic,
    /// The other baselines, if there are rows to fit them to.
    pub learned: Option<Baselines>,
    /// The published law, if those rows move in both directions.
    pub published: Option<PublishedLaw>,
}

/// Returns the phases of the body's motion, from the reference.
pub fn phases(time_s: &[f64], strain: &[f64]) -> Vec<PhaseRows> {
    segment(time_s, strain).into_iter().map(|segment| (segment.phase, segment.rows)).collect()
}

impl JudgedSensor {
    /// Reads a sensor for each requested estimator, with the parameters of a file; at least one.
    pub fn from_file(path: &Path, estimators: Estimators, corrects: bool) -> Result<Vec<Self>, CliError> {
        let wanted = if let Estimators::One(kind) = estimators { Some(kind) } else { None };
        let sensor = sensor_file::read(path, wanted)?;
        let can_be_built = |kind: &EstimatorKind| sensor.filter().estimator(*kind).build().is_ok();
        let kinds = match estimators {
            Estimators::All => EstimatorKind::ALL.into_iter().filter(can_be_built).collect(),
            _ => vec![wanted.unwrap_or(sensor.params().default_estimator)],
        };
        let kinds = EstimatorKind::distinct(
            kinds.into_iter().map(|kind| if corrects { kind } else { sensor.params().without_correction(kind) }),
        );
        let judged = |kind: EstimatorKind| {
            let name = kind.name();
            Self { sensor: sensor.clone(), kind, calibration_s: None, is_part: false, name }
        };
        Ok(kinds.into_iter().map(judged).collect())
    }

    /// Calibrates a sensor for each requested estimator, at least one, as `calibrate --estimator` does. A corrected filter is
    /// followed by the same without the correction, as a part.
    pub fn calibrated(
        training: &[TraceFile],
        estimators: Estimators,
        corrects: bool,
        progress: &Progress,
    ) -> Result<Vec<Self>, CliError> {
        let wanted = match estimators {
            Estimators::Auto => vec![None],
            Estimators::All => EstimatorKind::ALL
                .into_iter()
                .filter(|kind| corrects || *kind != EstimatorKind::Corrected)
                .map(Some)
                .collect(),
            Estimators::One(kind) => vec![Some(kind)],
        };
        let calibrate = |kind: Option<EstimatorKind>| {
            let start = Instant::now();
            let calibration = kind.map_or_else(Calibration::new, |kind| Calibration::new().estimator(kind));
            let Calibrated { sensor, .. } = calibrate_recordings(training, calibration, progress)?;
            let calibration_s = Some(start.elapsed().as_secs_f64());
            let kind = sensor.params().default_estimator;
            let filter = sensor.params().without_correction(kind);
            let (of_filter, name) = (filter.name(), kind.name());
            let part = Self { sensor: sensor.clone(), kind: filter, calibration_s, is_part: corrects, name: of_filter };
            let whole = Self { sensor, kind, calibration_s, is_part: false, name };
            let is_corrected = part.kind != whole.kind;
            Ok([Some(whole).filter(|_| corrects || !is_corrected), Some(part).filter(|_| is_corrected)])
        };
        let calibrated = wanted.iter().map(|kind| calibrate(*kind)).collect::<Result<Vec<_>, CliError>>()?;
        let sensors = calibrated.into_iter().flatten().flatten();
        // A part that was requested by itself is not shown twice.
        Ok(sensors.filter(|sensor| !(sensor.is_part && wanted.contains(&Some(sensor.kind)))).collect())
    }

    /// Scores some rows of a recording, with the filter started at the first row and given the strains of `given`; `None`
    /// without a reference. Doubts about those strains are added to `warnings`.
    pub fn judge(
        &self,
        recording: &TraceFile,
        part: Scored,
        rest_resistance: Option<f64>,
        given: &KnownStrains,
        baselines: BaselineScores,
        warnings: &mut Vec<String>,
    ) -> Result<Option<RecordingScores>, CliError> {
        let sensor = recording.sensor_for(&self.sensor);
        let estimated = estimate(recording, &sensor, rest_resistance, Some(self.kind), &given.known)
            .map_err(|error| CliError::reporting(error, &recording.name))?;
        if self.calibration_s.is_none() && given.name.is_none() {
            let mut watch = ValidityWatch::new(&self.sensor, rest_resistance);
            for (k, row) in estimated.filtered.iter().enumerate() {
                let reading = row.resistance.unwrap_or(f64::NAN);
                let seen = watch.see(row.time_s, reading, row.strain_rate, recording.truth(k));
                warnings.extend(seen.map(|warning| format!("{}: {warning}", recording.name)));
            }
        }
        let scores = |estimates: &[_]| scoring::of_estimates(recording, estimates, part);
        let (Some(filter), Some(smoother)) = (scores(&estimated.filtered), scores(&estimated.smoothed)) else {
            return Ok(None);
        };
        let span = self.sensor.params().limits.span();
        let settled = SettledScores::new(recording, &estimated.filtered, part, span)?;
        Ok(Some(RecordingScores {
            file: recording.name.clone(),
            sha256: recording.sha256.clone(),
            split: None,
            estimator: self.name,
            sample: Sample::Out,
            known: given.name.clone(),
            is_part: self.is_part || given.name.is_some(),
            filter,
            smoother,
            settled,
            calibration_s: self.calibration_s,
            lag_s: None,
            baselines,
            quantity: self.sensor.params().quantity,
        }))
    }
}

impl Rivals {
    /// Scores some rows of a recording, whose readings times `moved` match those of the calibration; `None` without a
    /// reference.
    pub fn scores(&self, recording: &TraceFile, part: Scored, moved: f64) -> Option<BaselineScores> {
        let learned = match &self.learned {
            None => None,
            Some(learned) => Some(LearnedScores {
                fir_20s: scoring::of_baseline(recording, learned.fir.start(), part, moved)?,
                low_pass_mode: scoring::of_baseline(recording, learned.low_pass_mode.start(), part, moved)?,
                leaky_bank: scoring::of_baseline(recording, learned.leaky_bank.start(), part, moved)?,
                relaxing_modulus: self.of_published(recording, part, moved),
            }),
        };
        let static_cubic =
            scoring::of_baseline(recording, ohmstrain_calib::running_cubic(self.static_cubic), part, moved)?;
        Some(BaselineScores { static_cubic, learned })
    }

    fn of_published(&self, recording: &TraceFile, part: Scored, moved: f64) -> Option<ohmstrain::Scores> {
        let time_s = &recording.trace.time_s;
        let strain: Vec<f64> = (0..time_s.len()).map(|row| recording.truth(row)).collect();
        let phases = phases(time_s, &strain).into_iter().map(|(phase, rows)| (time_s[rows.start], phase)).collect();
        let first = strain.first().copied().unwrap_or(f64::NAN);
        scoring::of_baseline(recording, self.published?.start(phases, first), part, moved)
    }
}
