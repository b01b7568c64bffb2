use super::datum::Datum;
use crate::order::median;

/// Number of points per time constant on the grid of starts.
const GRID: usize = 8;
/// Shortest time constant, in steps between readings; three steps later nothing of it is left.
const SHORTEST_STEPS: f64 = 0.3;
/// Longest time constant, in durations; the curvature of the exponential is then 1/60 of its fall.
const LONGEST_DURATIONS: f64 = 30.0;

/// Extent of the data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Typical time between readings, s.
    pub step_s: f64,
    /// Longest time since the start of a phase, s.
    pub duration_s: f64,
    /// Largest strain in magnitude.
    pub strain: f64,
}

impl Extent {
    /// Measures the extent of data in the order of their times.
    pub(super) fn of(data: &[Datum]) -> Self {
        let steps = data.windows(2).map(|pair| pair[1].at.elapsed_s - pair[0].at.elapsed_s);
        let largest = |value: fn(&Datum) -> f64| data.iter().map(value).fold(0.0, f64::max);
        let duration_s = largest(|datum| datum.at.elapsed_s).max(f64::MIN_POSITIVE);
        let strain = largest(|datum| datum.at.strain.abs());
        Self {
            step_s: median(steps.filter(|step| *step > 0.0)).unwrap_or(duration_s),
            duration_s,
            strain: if strain > 0.0 { strain } else { 1.0 },
        }
    }

    /// Returns the search ranges of `count` interchangeable time constants, s.
    #[must_use]
    pub fn time_constants(&self, count: usize) -> Vec<Search> {
        // Starts beyond the duration or below the step would lie where the data carry little information.
        let (first, last) = (self.step_s.ln(), self.duration_s.max(2.0 * self.step_s).ln());
        let starts: Vec<f64> =
            (0..GRID).map(|i| (first + (last - first) * (i as f64 + 0.5) / GRID as f64).exp()).collect();
        let search = Search {
            low: SHORTEST_STEPS * self.step_s,
            high: LONGEST_DURATIONS * self.duration_s,
            logarithmic: true,
            starts,
            above_previous: false,
        };
        (0..count).map(|i| Search { above_previous: i > 0, ..search.clone() }).collect()
    }

    /// Returns the search ranges of `count` rates, 1/s.
    #[must_use]
    pub fn rates(&self, count: usize) -> Vec<Search> {
        let inverse = |search: Search| Search {
            low: 1.0 / search.high,
            high: 1.0 / search.low,
            starts: search.starts.iter().rev().map(|tau| 1.0 / tau).collect(),
            ..search
        };
        self.time_constants(count).into_iter().map(inverse).collect()
    }
}

/// Search range of one nonlinear parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Search {
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// True if the search steps in its logarithm; the limits are then positive.
    pub logarithmic: bool,
    /// Values to start from, ascending.
    pub starts: Vec<f64>,
    /// True if it is interchangeable with the preceding parameter, so that only starts above that one's are tried.
    pub above_previous: bool,
}

impl Search {
    /// Returns the search range of a parameter that may have either sign.
    #[must_use]
    pub fn between(low: f64, high: f64, starts: &[f64]) -> Self {
        Self { low, high, logarithmic: false, starts: starts.to_vec(), above_previous: false }
    }

    /// Returns the coordinate that the optimiser varies.
    pub(super) fn coordinate(&self, value: f64) -> f64 {
        if self.logarithmic { value.ln() } else { value }
    }

    /// Returns the value at a coordinate, and its derivative.
    pub(super) fn value_and_slope(&self, coordinate: f64) -> (f64, f64) {
        if self.logarithmic { (coordinate.exp(), coordinate.exp()) } else { (coordinate, 1.0) }
    }

    /// True if a value is at a limit, to the resolution of the optimiser's steps.
    pub(super) fn at_limit(&self, value: f64) -> bool {
        let (low, high, x) = (self.coordinate(self.low), self.coordinate(self.high), self.coordinate(value));
        (x - low).min(high - x) <= 1e-6 * (high - low)
    }
}

/// Returns every combination of starts.
pub(super) fn starts(searches: &[Search]) -> Vec<Vec<f64>> {
    let mut out = vec![Vec::new()];
    for search in searches {
        let extend = |start: &Vec<f64>| {
            let last = if search.above_previous { start.last().copied() } else { None };
            let above = search.starts.iter().filter(|value| last.is_none_or(|last| **value > last));
            above.map(|value| [start.as_slice(), &[*value]].concat()).collect::<Vec<_>>()
        };
        out = out.iter().flat_map(extend).collect();
    }
    out
}
