/// Place on a recording for which a law predicts its reading. Values that a law does not use may be zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    /// Time since the phase began, s.
    pub elapsed_s: f64,
    /// Strain since the phase began, ε − ε_s: the `v t` of equation 8.
    pub travel: f64,
    /// Mean strain rate v of the movement, 1/s, negative on release; in a hold, that of the preceding movement.
    pub rate: f64,
    /// Strain ε.
    pub strain: f64,
    /// Movement that led to a hold, if one is known.
    pub before: Option<Movement>,
}

/// A whole movement, as seen from the hold after it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Movement {
    /// Duration, s.
    pub duration_s: f64,
    /// Change of strain.
    pub travel: f64,
}

/// One reading and where it was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Datum {
    /// Place on the recording.
    pub at: Moment,
    /// Reading, Ω or a ratio.
    pub reading: f64,
}
