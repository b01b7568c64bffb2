use ohmstrain::{Findings, Scores};
use serde::{Deserialize, Serialize};

use crate::commands::evaluate::RecordingScores;
use crate::commands::hand::scores::JointScores;

/// Scores of `evaluate` for the first estimator, or of `calibrate` on its held-out parts: errors in %FS, coverage as a share.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Figures {
    /// Rows that were scored.
    pub rows: Option<u64>,
    /// Error of the filter.
    pub filter_percent_fs: Option<f64>,
    /// Error of the smoother.
    pub smoother_percent_fs: Option<f64>,
    /// Error of strain as a cubic polynomial of the reading.
    pub static_cubic_percent_fs: Option<f64>,
    /// Coverage of the filter's 95 % interval.
    pub coverage_95: Option<f64>,
    /// Mean width of that interval, %FS.
    pub width_95_percent_fs: Option<f64>,
}

impl Figures {
    /// Collects the scores of an estimator on a recording.
    pub fn of_scores(scores: &RecordingScores) -> Self {
        Self::new(&scores.filter, Some(&scores.smoother), Some(&scores.baselines.static_cubic))
    }

    /// Collects the scores of a calibration.
    pub fn of_findings(findings: &Findings) -> Self {
        Self::new(&findings.filter, findings.smoother.as_ref(), Some(&findings.static_cubic))
    }

    /// Collects the scores of a hand's joint.
    pub fn of_joint(joint: &JointScores) -> Self {
        let filter = joint.fused.as_ref();
        filter.map_or_else(Self::default, |filter| Self::new(filter, joint.smoothed.as_ref(), None))
    }

    fn new(filter: &Scores, smoother: Option<&Scores>, static_cubic: Option<&Scores>) -> Self {
        let known = |number: f64| Some(number).filter(|number| number.is_finite());
        Self {
            rows: u64::try_from(filter.n).ok(),
            filter_percent_fs: known(filter.rmse_percent_fs),
            smoother_percent_fs: smoother.and_then(|smoother| known(smoother.rmse_percent_fs)),
            static_cubic_percent_fs: static_cubic.and_then(|cubic| known(cubic.rmse_percent_fs)),
            coverage_95: filter.coverage_95.and_then(known),
            width_95_percent_fs: filter.width_95_percent_fs.and_then(known),
        }
    }
}
