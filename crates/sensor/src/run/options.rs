use ohmstrain_ekf::Guard;
use ohmstrain_ekf::live::Protections;

use crate::run::Start;

/// Start, guard and protections of a filter.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The start.
    pub start: Start,
    /// Treatment of outliers.
    pub guard: Guard<f64>,
    /// Protections from conditions absent from the calibration; the guard handles outliers.
    pub protections: Protections,
}

impl Options {
    /// Returns the options of a filter that starts from an unknown strain, without protections.
    #[must_use]
    pub fn plain() -> Self {
        Self { start: Start::Unknown, guard: Guard::none(), protections: Protections::NONE }
    }
}
