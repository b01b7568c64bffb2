/// Kind of a trace's readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ReadingKind {
    /// Resistance, Ω.
    Ohm,
    /// Resistance over the resistance at rest, R/R₀.
    Ratio,
}

/// Quantity of a trace's reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ReferenceQuantity {
    /// Engineering strain.
    Strain,
    /// Angle of a joint of unknown geometry, degrees.
    AngleDeg,
}

/// One reading. NaN is a missing one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Ω or R/R₀, see [`reading_kind`](crate::TraceReader::reading_kind); NaN if missing or saturated.
    pub value: f64,
    /// Standard deviation of the reading by the front end, Ω; known for converter codes only.
    pub sd_ohm: Option<f64>,
    /// The converter's code, if the file has codes and this one is not missing.
    pub code: Option<u32>,
    /// True if the converter was at an end of its scale.
    pub saturated: bool,
}

/// One row of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Physical line in the file, counted from 1.
    pub line: u64,
    /// Time on the file's clock, s.
    pub time_s: f64,
    /// The sensor.
    pub reading: Reading,
    /// Reference, see [`reference_quantity`](crate::TraceReader::reference_quantity); NaN if missing.
    pub reference: f64,
    /// Standard deviation of the reference; NaN if the reference is missing or exact.
    pub reference_sd: f64,
    /// Temperature, °C; NaN if missing.
    pub temperature_c: f64,
}
