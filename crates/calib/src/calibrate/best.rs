//! Choice between the filter and the static cubic, by their errors on held-out quarters.

use crate::calibrate::findings::Checked;
use ohmstrain_sensor::EstimatorKind;

/// Smallest number of full strokes in which held-out quarters tell which estimator is better. In a stretch and a release each quarter has
/// what no other one has, and the filter that has learned from all of them is better than those without it.
const FEWEST_STROKES: f64 = 3.0;

/// Role of the static cubic in a calibration.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum StaticCubicAs {
    /// Baseline for comparison.
    Baseline,
    /// It becomes the default if it is the better one on held-out quarters.
    Candidate,
    /// It is what was requested.
    Default,
}

impl StaticCubicAs {
    /// Returns the role of the static cubic among the requested estimators, in a calibration with that many strokes.
    pub(crate) fn of(kinds: &[EstimatorKind], strokes: f64) -> Self {
        let is_cubic = |kind: &EstimatorKind| *kind == EstimatorKind::StaticCubic;
        match (kinds.iter().any(is_cubic), kinds.iter().all(is_cubic)) {
            (false, _) => Self::Baseline,
            (true, true) => Self::Default,
            (true, false) if strokes < FEWEST_STROKES => Self::Baseline,
            (true, false) => Self::Candidate,
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
    /// Chooses between `filter`, an estimator with the filter behind it, and the static cubic.
    pub(crate) fn on_held_out(
        filter: (EstimatorKind, EstimatorKind),
        static_cubic: StaticCubicAs,
        check: impl Fn((EstimatorKind, EstimatorKind)) -> Option<Checked>,
    ) -> Self {
        let default = EstimatorKind::StaticCubic;
        let of_cubic = || check((default, EstimatorKind::Ekf));
        if static_cubic == StaticCubicAs::Default {
            return Self { default, smoother: default, checked: of_cubic() };
        }
        let of_filter = check(filter);
        let of_cubic = if static_cubic == StaticCubicAs::Candidate { of_cubic() } else { None };
        match (of_cubic, of_filter) {
            (Some(cubic), Some(of_filter)) if cubic.filters_better_than(&of_filter) => {
                if filter.0 == EstimatorKind::Corrected && of_filter.smooths_better_than(&cubic) {
                    Self { default, smoother: filter.0, checked: Some(cubic.smoothed_as(&of_filter)) }
                } else {
                    Self { default, smoother: default, checked: Some(cubic) }
                }
            }
            (_, checked) => Self { default: filter.0, smoother: filter.0, checked },
        }
    }
}
