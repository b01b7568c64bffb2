use ohmstrain_sensor::EstimatorKind;

/// Components of the default estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recipe {
    /// Filters to choose from, by their scores on every row of held-out blocks. The first is tried under every law, the others under the
    /// law that is chosen, and only if the body rests for a tenth of the time or more.
    pub filters: &'static [EstimatorKind],
    /// Candidates for the default estimator, unless another is requested: the filter with corrected strain, and the static cubic. The one with
    /// the smallest error on held-out quarters is chosen.
    pub estimators: &'static [EstimatorKind],
}

/// One filter under one law with one learned correction, or the static cubic; the same on a laptop and on a chip. Sign-split follows a body
/// that moves; phase histories keep their direction through holds of minutes.
pub const RECIPE: Recipe = Recipe {
    filters: &[EstimatorKind::SignSplit, EstimatorKind::Hypotheses],
    estimators: &[EstimatorKind::Corrected, EstimatorKind::StaticCubic],
};

impl Recipe {
    /// Returns the filters to choose from, for a body that sometimes rests or never does. Phase histories take several times as long to
    /// calibrate.
    pub(crate) fn candidates(&self, rests: bool) -> &'static [EstimatorKind] {
        if rests { self.filters } else { self.filters.get(..1).unwrap_or(self.filters) }
    }
}
