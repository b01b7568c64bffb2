//! Axes of a plot: a range that holds the data, round ticks, linear or logarithmic.
//!
//! The ticks are our own, since the plotting library's tick search asserts and compares with an absolute epsilon: a NaN, or a
//! range such as 1e-20, must not cause a panic or an endless loop.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use ohmstrain::number;

/// Largest magnitude on an axis: the difference of two such numbers is still finite.
const LARGEST: f64 = 1e300;
/// Shortest range relative to its numbers; neighbouring ticks of a shorter one would look the same.
const SHORTEST: f64 = 1e-9;
/// Space left free at both ends, as a share of the range.
const MARGIN: f64 = 0.04;
/// Steps between ticks, times a power of ten.
const STEPS: [f64; 4] = [1.0, 2.0, 5.0, 10.0];

/// One axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    low: f64,
    high: f64,
    log: bool,
    ticks: Vec<f64>,
    step: f64,
}

impl Axis {
    /// Creates a linear axis that holds all finite `values`, with a margin.
    pub fn holding(label: &str, values: impl IntoIterator<Item = f64>, most_ticks: usize) -> Self {
        let (low, high) = opened(extent(values));
        let margin = MARGIN * (high - low);
        Self::linear(label, low - margin, high + margin, most_ticks)
    }

    /// Creates a linear axis that holds all of `core`, and as much of `rest` as makes it at most twice as long.
    pub fn around(
        label: &str,
        core: impl IntoIterator<Item = f64>,
        rest: impl IntoIterator<Item = f64>,
        most_ticks: usize,
    ) -> Self {
        let (low, high) = opened(extent(core));
        let slack = 0.5 * (high - low);
        let within = rest.into_iter().filter(|x| x.is_finite()).map(|x| x.clamp(low - slack, high + slack));
        Self::holding(label, within.chain([low, high]), most_ticks)
    }

    /// Creates a linear axis from `low` to `high`.
    pub fn linear(label: &str, low: f64, high: f64, most_ticks: usize) -> Self {
        let (low, high) = opened(Some((low, high)));
        let step = round_step((high - low) / most_ticks.max(1) as f64);
        let first = (low / step).ceil();
        let ticks = (0..=most_ticks).map(|i| (first + i as f64) * step).filter(|tick| *tick <= high).collect();
        Self { label: label.into(), low, high, log: false, ticks, step }
    }

    /// Creates a logarithmic axis from `low` to `high`, both positive.
    pub fn logarithmic(label: &str, low: f64, high: f64) -> Self {
        let low = if low > 1.0 / LARGEST { low.min(LARGEST / 10.0) } else { 1e-3 };
        let high = if high > 1.2 * low { high.min(LARGEST) } else { 10.0 * low };
        let decades = number::exponent(low)..=number::exponent(high);
        let few = high / low < 500.0;
        let within: &[f64] = if few { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let ticks = decades
            .flat_map(|decade| within.iter().map(move |digit| digit * 10.0_f64.powi(decade)))
            .filter(|tick| (low..=high).contains(tick))
            .collect();
        Self { label: label.into(), low, high, log: true, ticks, step: low }
    }

    /// Returns the position of a value, 0 at the lower and 1 at the upper end; outside, the position of the nearer end. NaN stays NaN.
    pub fn unit(&self, value: f64) -> f64 {
        let share = if self.log {
            (value.max(self.low) / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        };
        share.clamp(0.0, 1.0)
    }

    /// Returns the value at a position, 0 at the lower and 1 at the upper end.
    pub fn value(&self, share: f64) -> f64 {
        if self.log { self.low * (self.high / self.low).powf(share) } else { self.low + share * (self.high - self.low) }
    }

    /// Formats both ends, and `log` if the axis is logarithmic.
    pub fn as_attribute(&self) -> String {
        format!("{} {}{}", self.low, self.high, if self.log { " log" } else { "" })
    }

    /// Returns the ends of the axis.
    pub fn ends(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    fn tick_label(&self, tick: f64) -> String {
        if self.log {
            return number::significant(tick, 1);
        }
        let largest = self.low.abs().max(self.high.abs());
        if number::reads_better_in_powers(largest) || number::exponent(self.step) < -6 {
            let digits = number::exponent(largest) - number::exponent(self.step) + 1;
            return number::in_powers(tick, digits.clamp(1, 12));
        }
        number::fixed(tick, -number::exponent(self.step * 1.000_001).min(0))
    }
}

/// Returns the smallest and the largest finite value.
pub fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .into_iter()
        .filter(|x| x.is_finite())
        .fold(None, |range, x| Some(range.map_or((x, x), |(low, high): (f64, f64)| (low.min(x), high.max(x)))))
}

/// Returns a range of positive length: 0 to 1 if nothing is known, a little to both sides of a single value.
fn opened(range: Option<(f64, f64)>) -> (f64, f64) {
    let Some((low, high)) = range else { return (0.0, 1.0) };
    if !(low.is_finite() && high.is_finite()) {
        return (0.0, 1.0);
    }
    let (low, high) = (low.clamp(-LARGEST, LARGEST), high.clamp(-LARGEST, LARGEST));
    let size = low.abs().max(high.abs());
    if high - low > (SHORTEST * size).max(1.0 / LARGEST) {
        return (low, high);
    }
    let half = if size > 1.0 / LARGEST { 0.05 * size } else { 0.5 };
    (low - half, high + half)
}

/// Returns the smallest round number that is at least `step`.
fn round_step(step: f64) -> f64 {
    let decade = 10.0_f64.powi(number::exponent(step));
    STEPS.iter().map(|digit| digit * decade).find(|round| *round >= step * 0.999_999).unwrap_or(10.0 * decade)
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let length = f64::from(limit.1) - f64::from(limit.0);
        (f64::from(limit.0) + self.unit(*value) * length).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.ticks.clone()
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        self.tick_label(*value)
    }
}

#[cfg(test)]
mod tests {
    use super::Axis;

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks.iter().map(|tick| axis.tick_label(*tick)).collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(labels(&Axis::linear("", 0.0, 0.35, 4)), ["0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(&Axis::linear("", -20.0, 160.0, 5)), ["0", "50", "100", "150"]);
        assert_eq!(labels(&Axis::logarithmic("", 0.1, 300.0)), ["0.1", "1", "10", "100"]);
        assert_eq!(labels(&Axis::logarithmic("", 0.5, 12.0)), ["0.5", "1", "2", "5", "10"]);
    }

    #[test]
    fn any_data_gives_a_finite_axis() {
        let cases: [&[f64]; 7] = [
            &[],
            &[f64::NAN, f64::INFINITY],
            &[0.0],
            &[5e3],
            &[1e-320, 2e-320],
            &[-f64::MAX, f64::MAX],
            &[1.0, 1.0 + f64::EPSILON],
        ];
        for case in cases {
            let axis = Axis::holding("", case.iter().copied(), 6);
            let (low, high) = axis.ends();
            assert!(low < high && (high - low).is_finite(), "{case:?}: {low} to {high}");
            assert!(axis.ticks.len() <= 7, "{case:?}: {:?}", axis.ticks);
            assert!((0.0..=1.0).contains(&axis.unit(low)));
        }
    }

    /// Tests that a position gives the value back, to rounding: a few units in the last place of the larger end.
    #[test]
    fn a_place_gives_the_value_back() {
        for axis in [Axis::linear("", -3.0, 7.0, 5), Axis::logarithmic("", 0.1, 300.0)] {
            for value in [0.1, 0.25, 3.0, 6.5] {
                assert!((axis.value(axis.unit(value)) - value).abs() < 1e-12, "{value}");
            }
        }
    }
}
