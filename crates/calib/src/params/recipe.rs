use crate::params::estimator::EstimatorKind;

/// What the default estimator is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Recipe {
    /// The filters to choose from, by how well each does on blocks that the law has not seen. The first one is tried under
    /// every law, the others under the laws that serve it best, and only where the body rests for a tenth of the time or more.
    pub filters: &'static [EstimatorKind],
    /// The estimator that is calibrated, and made the default, unless another one is asked for: the filter with its strain
    /// corrected, or as it is.
    pub estimator: EstimatorKind,
    /// What its correction is made of.
    pub parts: Parts,
}

/// Parts of the learned correction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parts {
    /// The process that says strain from the readings alone; in a smoother the one that sees both sides of time.
    pub direct: bool,
    /// The process that says what the filter's strain lacks.
    pub residual: bool,
    /// What the law says of simulated motions, the filter's.
    pub simulated: bool,
    /// The smoother's processes of one side of time.
    pub one_sided: bool,
    /// That a process which contradicts all others is less sure, the smoother's.
    pub consensus: bool,
}

impl Parts {
    /// All of them.
    pub const ALL: Self = Self { direct: true, residual: true, simulated: true, one_sided: true, consensus: true };
    /// All but one, by the name of what is left out.
    pub const ALL_BUT_ONE: [(&'static str, Self); 5] = [
        ("without direct process", Self { direct: false, ..Self::ALL }),
        ("without residual process", Self { residual: false, ..Self::ALL }),
        ("without simulated motions", Self { simulated: false, ..Self::ALL }),
        ("without one-sided processes", Self { one_sided: false, ..Self::ALL }),
        ("without consensus", Self { consensus: false, ..Self::ALL }),
    ];
}

/// One filter under one law with one learned correction, the same on a laptop and on a chip. Sign-split follows a body that
/// moves; phase histories keep their way through holds of minutes.
pub const RECIPE: Recipe = Recipe {
    filters: &[EstimatorKind::SignSplit, EstimatorKind::Hypotheses],
    estimator: EstimatorKind::Corrected,
    parts: Parts::ALL,
};

impl Recipe {
    /// The filters to choose from for a body that rests at times, or never. Phase histories take several times as long to
    /// calibrate.
    pub(crate) fn candidates(&self, rests: bool) -> &'static [EstimatorKind] {
        if rests { self.filters } else { self.filters.get(..1).unwrap_or(self.filters) }
    }
}
