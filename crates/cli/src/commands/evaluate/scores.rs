use ohmstrain_sensor::{Quantity, Scores};
use serde::Serialize;

use super::settled::SettledScores;
use ohmstrain_report::Sample;

/// Scores of the filter, the smoother and the baselines for one recording and one estimator.
#[derive(Serialize)]
pub struct RecordingScores {
    pub file: String,
    /// SHA-256 of the recording's bytes, hexadecimal.
    pub sha256: String,
    /// Share of the rows used for calibration, if the rest was scored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split: Option<String>,
    pub estimator: &'static str,
    /// Name of the known strains that the estimator received from the reference, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub known: Option<String>,
    /// Overlap of the scored rows with the calibration.
    #[serde(skip)]
    pub sample: Sample,
    /// True if it is shown as a part of the estimator before it, or to show the effect of known strains.
    #[serde(skip)]
    pub is_part: bool,
    #[serde(flatten)]
    pub filter: Scores,
    pub smoother: Scores,
    /// Scores of the filter's settled readings, if long holds are scored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settled: Option<SettledScores>,
    /// Wall-clock time of the calibration, s; `None` if it was read from a file.
    pub calibration_s: Option<f64>,
    /// Lag of the reference, s, if it was estimated; the inner `None` is an unknown lag.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lag_s: Option<Option<f64>>,
    pub baselines: BaselineScores,
    /// Quantity of the errors, for the table's header.
    #[serde(skip)]
    pub quantity: Quantity,
}

/// The name of the published law in tables.
pub const PUBLISHED: &str = "published law";

/// Scores of the baselines; a sensor file holds the first one only.
#[derive(Clone, Copy, Serialize)]
pub struct BaselineScores {
    pub static_cubic: Scores,
    #[serde(flatten)]
    pub learned: Option<LearnedScores>,
}

/// Scores of models that are fitted for comparison and not stored.
#[derive(Clone, Copy, Serialize)]
pub struct LearnedScores {
    pub fir_20s: Scores,
    pub low_pass_mode: Scores,
    pub leaky_bank: Scores,
    /// Scores of the published law, with known phases; `None` if the calibration moved in one direction only.
    pub relaxing_modulus: Option<Scores>,
}

impl BaselineScores {
    /// Returns the scores with their names in the table.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, Scores)> {
        let learned = self.learned.map(|learned| {
            [
                Some(("20 s FIR", learned.fir_20s)),
                Some(("low-pass mode", learned.low_pass_mode)),
                Some(("leaky bank", learned.leaky_bank)),
                learned.relaxing_modulus.map(|scores| (PUBLISHED, scores)),
            ]
        });
        std::iter::once(("static cubic", self.static_cubic)).chain(learned.into_iter().flatten().flatten())
    }
}

impl RecordingScores {
    /// Returns its name in tables.
    pub fn name(&self) -> String {
        self.known.as_ref().map_or_else(|| self.estimator.into(), |known| format!("{}, {known}", self.estimator))
    }

    /// Returns the recording and, if there is one, the split.
    pub fn case(&self) -> String {
        self.split.as_ref().map_or_else(|| self.file.clone(), |split| format!("{} {split}", self.file))
    }

    /// Returns the case, the quantity of its errors, and further facts.
    pub fn heading(&self) -> String {
        let unit = match self.quantity {
            Quantity::Strain => "strain",
            Quantity::AngleDeg => "degrees",
        };
        let seconds = self.calibration_s.map(|seconds| format!("calibrated in {seconds:.1} s"));
        let lag = self.lag_s.map(|lag| match lag {
            Some(lag_s) => {
                format!("the reference is {:.2} s {}", lag_s.abs(), if lag_s < 0.0 { "early" } else { "late" })
            }
            None => "how late the reference is cannot be told".into(),
        });
        let sample = (self.sample != Sample::Out).then(|| self.sample.name().to_owned());
        let more = [format!("errors in {unit}")]
            .into_iter()
            .chain(sample)
            .chain(seconds)
            .chain(lag)
            .collect::<Vec<_>>()
            .join(", ");
        format!("{}: {more}", self.case())
    }
}
