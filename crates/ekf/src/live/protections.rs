/// Protections of a filter against conditions absent from its calibration. All of them are on by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Protections {
    /// Plausibility check: impossible readings, and numbers that repeat too often, count as missing.
    pub plausibility: bool,
    /// Bounded influence: the weight of a reading beyond three standard deviations decreases with its distance.
    pub influence: bool,
    /// Second look: after a jump of the readings, the filter also follows a hypothesis from its initial distribution; if readings
    /// jump back, it continues from its state before the jump. Requires `influence`.
    pub second_look: bool,
    /// Following: R₀ adapts to readings that stay beyond those of the calibration.
    pub following: bool,
    /// Doubts: wider intervals at a start, after a fault, and outside the calibrated range.
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
