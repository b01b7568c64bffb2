//! A recording with the data derived from it for the plots.

use std::collections::BTreeMap;
use std::ops::Deref;

use ohmstrain::Estimate;
use ohmstrain_sensor::{Quantity, ReadingUnit, SensorParams};

use super::ReportInput;
use super::axis::extent;
use super::law::{Driven, Law};
use super::motion::{self, Hold, MotionKind};
use ohmstrain::number::{self, significant};

/// Shortest hold whose relaxation is plotted, s.
pub const SHORTEST_HOLD_S: f64 = 5.0;
/// Number of holds that are plotted.
const PLOTTED_HOLDS: usize = 4;
/// Number of points of a gauge curve.
const CURVE_POINTS: u32 = 200;

/// The report's input and the data derived from it.
pub struct PlottedRecording<'a> {
    input: ReportInput<'a>,
    /// Reference, if it is known anywhere; hides that of the input.
    pub truth: Option<&'a [f64]>,
    /// The sensor's law.
    pub law: Law<'a>,
    /// Motion of the strain, row by row.
    pub motions: Vec<MotionKind>,
    /// Readings of the law driven by the reference.
    pub driven: Option<Vec<f64>>,
    strain: Vec<f64>,
    held: Vec<Hold>,
    /// States of the law's branches at the starts of the longest holds.
    memories: BTreeMap<usize, Vec<f64>>,
}

impl<'a> Deref for PlottedRecording<'a> {
    type Target = ReportInput<'a>;

    fn deref(&self) -> &Self::Target {
        &self.input
    }
}

impl<'a> PlottedRecording<'a> {
    /// Prepares the data that more than one plot needs.
    pub fn new(input: &ReportInput<'a>) -> Self {
        let truth = input.truth.filter(|truth| truth.iter().any(|x| x.is_finite()));
        let estimates = if input.smoothed.is_empty() { input.filtered } else { input.smoothed };
        let strain = truth.map_or_else(|| estimates.iter().map(|row| row.strain).collect(), <[f64]>::to_vec);
        let law = Law::new(input.params, input.rest_reading);
        let mut held = motion::holds(input.time_s, &strain, SHORTEST_HOLD_S);
        if truth.is_none() {
            held.retain(|hold| is_free(hold.strain, input.params));
        }
        let held = motion::levels_first(held);
        let starts: Vec<usize> = held.iter().take(PLOTTED_HOLDS).map(|hold| hold.first).collect();
        let Driven { reading, memories } = law.driven(input.time_s, &strain, &starts);
        Self {
            input: input.clone(),
            truth,
            motions: motion::motions(input.time_s, &strain, &held),
            law,
            driven: truth.map(|_| reading),
            strain,
            held,
            memories,
        }
    }

    /// Returns the reference, or else the estimate.
    pub fn known_strain(&self) -> &[f64] {
        &self.strain
    }

    /// Returns the plotted holds, at most four: the longest of each level, then the longest others.
    pub fn longest_holds(&self) -> &[Hold] {
        self.held.get(..PLOTTED_HOLDS).unwrap_or(&self.held)
    }

    /// Returns all holds: the longest of each level, then the others, longest first.
    pub fn holds(&self) -> &[Hold] {
        &self.held
    }

    /// Returns the state of the law's branches at the start of one of the longest holds.
    pub fn memory_at(&self, row: usize) -> Option<&[f64]> {
        self.memories.get(&row).map(Vec::as_slice)
    }

    /// Returns points (strain, g) of the gauge curve over a range.
    pub fn gauge_curve(&self, range: Option<(f64, f64)>) -> Vec<(f64, f64)> {
        let Some((low, high)) = range else { return vec![] };
        let at = |i: u32| low + f64::from(i) / f64::from(CURVE_POINTS) * (high - low);
        (0..=CURVE_POINTS).map(|i| (at(i), self.law.gauge(at(i)))).collect()
    }

    /// Returns points (strain, reading) of the static calibration over the readings.
    pub fn static_curve(&self) -> Vec<(f64, f64)> {
        let Some((low, high)) = extent(self.reading.iter().copied()) else { return vec![] };
        let at = |i: u32| low + f64::from(i) / f64::from(CURVE_POINTS) * (high - low);
        (0..=CURVE_POINTS).map(|i| (self.params.static_cubic.strain(at(i)), at(i))).collect()
    }

    /// Returns the strain by the static calibration, within its range; NaN without a reading.
    pub fn static_strain(&self, reading: f64) -> f64 {
        let cubic = self.params.static_cubic;
        cubic.strain(reading).clamp(cubic.range.lower, cubic.range.upper)
    }

    /// Returns the axis label of the readings.
    pub fn reading_label(&self) -> &'static str {
        match self.params.reading {
            ReadingUnit::Ohm => "Resistance, Ω",
            ReadingUnit::Ratio => "Resistance ratio",
        }
    }

    /// Returns the name of the estimated quantity.
    pub fn quantity_name(&self) -> &'static str {
        match self.params.quantity {
            Quantity::Strain => "Strain",
            Quantity::AngleDeg => "Angle",
        }
    }

    /// Converts a value of the estimated quantity to the unit that people read: strain in percent.
    pub fn shown(&self, value: f64) -> f64 {
        number::shown(self.params.quantity).0 * value
    }

    /// Returns the axis label of the estimated quantity.
    pub fn quantity_label(&self) -> &'static str {
        match self.params.quantity {
            Quantity::Strain => "Strain, %",
            Quantity::AngleDeg => "Angle, °",
        }
    }

    /// Returns the axis label of the reference, or of the estimate in its place.
    pub fn known_strain_label(&self) -> String {
        let source = if self.truth.is_some() { "reference" } else { "estimated" };
        format!("{} ({source})", self.quantity_label())
    }

    /// Formats a value of the estimated quantity with its unit.
    pub fn with_unit(&self, value: f64) -> String {
        match self.params.quantity {
            Quantity::Strain => format!("strain {} %", significant(100.0 * value, 3)),
            Quantity::AngleDeg => format!("{}°", significant(value, 3)),
        }
    }

    /// Returns the 95 % interval of an estimate, within the limits of the output.
    pub fn interval(&self, row: &Estimate) -> (f64, f64) {
        let (limits, half) = (self.params.limits, Z_95 * row.strain_sd);
        // A limit that is NaN bounds nothing.
        let within = |x: f64| if x.is_nan() { x } else { x.max(limits.lower).min(limits.upper) };
        (within(row.strain - half), within(row.strain + half))
    }
}

/// Half-width of the 95 % interval of a standard normal.
pub const Z_95: f64 = 1.96;

/// Distance from the limits below which an estimate counts as being at them, as a share of their span.
const AT_LIMIT: f64 = 0.02;

/// True if an estimated strain is away from the limits. An estimate that is clamped to them does not show that the body is at
/// rest.
fn is_free(strain: f64, params: &SensorParams) -> bool {
    let (limits, margin) = (params.limits, AT_LIMIT * params.limits.span());
    strain > limits.lower + margin && strain < limits.upper - margin
}
