use std::ops::Range;

use ohmstrain_model::StrainRange;

/// Examples of a correction: inputs with the filter's outputs first, the true strain, and times, s, row by row.
#[derive(Clone, Copy)]
pub(crate) struct Examples<'a, const D: usize> {
    pub inputs: &'a [[f64; D]],
    pub strain: &'a [f64],
    pub time_s: &'a [f64],
    pub limits: StrainRange<f64>,
    /// Standard deviation of the strains themselves, which the errors do not show.
    pub reference_sd: f64,
    /// All rows of several recordings, which these rows represent; `None` if there are no others.
    pub all: Option<AllRows<'a, D>>,
}

/// Rows of several recordings, one recording after the other.
#[derive(Clone, Copy)]
pub(crate) struct AllRows<'a, const D: usize> {
    pub inputs: &'a [[f64; D]],
    pub strain: &'a [f64],
    pub recordings: &'a [Range<usize>],
    /// Usual time between rows, s.
    pub step_s: f64,
}
