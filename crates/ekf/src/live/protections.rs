/// What protects a filter from what no calibration has seen. All of it is on unless somebody turns it off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Protections {
    /// Readings that this sensor cannot give, and numbers that come again and again, are none.
    pub plausibility: bool,
    /// A reading beyond three standard deviations counts the less the farther it is.
    pub influence: bool,
    /// Where readings jump, what was known before any reading is followed, too; not without `influence`.
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
