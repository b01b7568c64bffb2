use ohmstrain_sensor::EstimatorKind;

/// Components of the default estimator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recipe {
    /// The filters to choose from, by how well each does on every row of blocks that the law has not seen. The first one is tried
    /// under every law, the others under the laws that serve it best, and only where the body rests for a tenth of the time or more.
    pub filters: &'static [EstimatorKind],
    /// Default estimator, which is calibrated unless another one is requested: the filter with its strain
    /// corrected, or as it is.
    pub estimator: EstimatorKind,
}

/// One filter under one law with one learned correction, the same on a laptop and on a chip. Sign-split follows a body that
/// moves; phase histories keep their way through holds of minutes.
pub const RECIPE: Recipe =
    Recipe { filters: &[EstimatorKind::SignSplit, EstimatorKind::Hypotheses], estimator: EstimatorKind::Corrected };

impl Recipe {
    /// The filters to choose from for a body that rests at times, or never. Phase histories take several times as long to
    /// calibrate.
    pub(crate) fn candidates(&self, rests: bool) -> &'static [EstimatorKind] {
        if rests { self.filters } else { self.filters.get(..1).unwrap_or(self.filters) }
    }
}
