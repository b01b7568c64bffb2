/// Protections of a filter against conditions that no calibration has seen. All of them are on by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Protections {
    /// Plausibility check: readings that this sensor cannot give, and numbers that repeat too often, count as missing.
    pub plausibility: bool,
    /// Bounded influence: a reading beyond three standard deviations counts the less the farther it is.
    pub influence: bool,
    /// Second look after a jump of the readings, which also follows the knowledge from before any reading; not without `influence`.
    pub second_look: bool,
    /// Following: R₀ adapts to readings that stay beyond those of the calibration.
    pub following: bool,
    /// Doubts: intervals are wider at a start, after a fault, and outside the calibrated range.
    pub doubts: bool,
}

impl Protections {
    /// All protections off.
    pub const NONE: Self =
        Self { plausibility: false, influence: false, second_look: false, following: false, doubts: false };
    /// All protections on.
    pub const ALL: Self =
        Self { plausibility: true, influence: true, second_look: true, following: true, doubts: true };
}
