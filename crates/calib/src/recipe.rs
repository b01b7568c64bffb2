use crate::estimator_params::EstimatorKind;

/// What the default estimator is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recipe {
    /// The filter.
    pub filter: EstimatorKind,
    /// The estimator that is calibrated, and made the default, unless another one is asked for: the filter with its strain
    /// corrected, or as it is.
    pub estimator: EstimatorKind,
}

/// One filter under one law with one learned correction, the same on a laptop and on a chip.
pub const RECIPE: Recipe = Recipe { filter: EstimatorKind::SignSplit, estimator: EstimatorKind::Corrected };
