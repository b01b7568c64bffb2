//! Choice between the filter and the static cubic, by their errors on held-out quarters.

use crate::calibrate::findings::Checked;
use ohmstrain_sensor::EstimatorKind;

/// Role of the static cubic in a calibration.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum StaticCubicAs {
    /// Others are compared with it.
    Baseline,
    /// It becomes the default if it is the better one on held-out quarters.
    Candidate,
    /// It is what was requested.
    Default,
}

impl StaticCubicAs {
    /// Returns its role if these estimators are requested.
    pub(crate) fn of(kinds: &[EstimatorKind]) -> Self {
        match (kinds.contains(&EstimatorKind::StaticCubic), kinds.len()) {
            (false, _) => Self::Baseline,
            (true, 1) => Self::Default,
            (true, _) => Self::Candidate,
        }
    }
}

/// The default estimator of a calibration.
pub(crate) struct Best {
    pub default: EstimatorKind,
    /// The estimator that smooths for it.
    pub smoother: EstimatorKind,
    /// Their quality on held-out quarters.
    pub checked: Option<Checked>,
}

impl Best {
    /// Chooses between `whole`, an estimator with the filter behind it, and the static cubic.
    pub(crate) fn on_held_out(
        whole: (EstimatorKind, EstimatorKind),
        static_cubic: StaticCubicAs,
        check: impl Fn((EstimatorKind, EstimatorKind)) -> Option<Checked>,
    ) -> Self {
        let of_whole = if static_cubic == StaticCubicAs::Default { None } else { check(whole) };
        let is_worse = |checked: &Checked| checked.findings.static_cubic.rmse < checked.findings.filter.rmse;
        let is_tried = static_cubic == StaticCubicAs::Default
            || static_cubic == StaticCubicAs::Candidate && of_whole.as_ref().is_some_and(is_worse);
        let default = EstimatorKind::StaticCubic;
        let of_cubic = if is_tried { check((default, EstimatorKind::Ekf)) } else { None };
        match (of_cubic, of_whole) {
            (Some(cubic), Some(of_whole)) if !of_whole.filters_better_than(&cubic) => {
                if whole.0 == EstimatorKind::Corrected && of_whole.smooths_better_than(&cubic) {
                    Self { default, smoother: whole.0, checked: Some(cubic.smoothed_as(&of_whole)) }
                } else {
                    Self { default, smoother: default, checked: Some(cubic) }
                }
            }
            (checked, None) if is_tried => Self { default, smoother: default, checked },
            (_, checked) => Self { default: whole.0, smoother: whole.0, checked },
        }
    }
}
