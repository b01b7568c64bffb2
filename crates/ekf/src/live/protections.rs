/// Protections of a filter against conditions that no calibration has seen. All of them are on by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Protections {
    /// Readings that this sensor cannot give, and numbers that come again and again, are none.
    pub plausibility: bool,
    /// A reading beyond three standard deviations counts the less the farther it is.
    pub influence: bool,
    /// Second look after a jump of the readings, which also follows the knowledge from before any reading; not without `influence`.
    pub second_look: bool,
    /// R₀ follows readings that stay beyond those of the calibration.
    pub following: bool,
    /// Intervals are wider at a start, after a fault, and outside of the calibration.
    pub doubts: bool,
}

impl Protections {
    /// Everything is off.
    pub const NONE: Self =
        Self { plausibility: false, influence: false, second_look: false, following: false, doubts: false };
    /// Everything is on.
    pub const ALL: Self =
        Self { plausibility: true, influence: true, second_look: true, following: true, doubts: true };
}
