use std::ops::Range;

use crate::samples::{Samples, bridged_strain};

/// A part of a recording in which the strain is constant.
#[derive(Clone, Debug, PartialEq)]
pub struct Hold {
    /// Its rows.
    pub rows: Range<usize>,
    /// Duration, s.
    pub duration_s: f64,
    /// Mean reading of its last seconds, when the reading has settled.
    pub last_reading: f64,
}

/// Shortest hold, s, that shows where a reading settles.
pub(crate) const LEAST_HOLD_S: f64 = 20.0;
/// Largest deviation of a held strain from its middle, as a fraction of the strain's range.
const STILL: f64 = 0.005;
/// Start and end of the mean for the last reading, s before the end of the hold; at the very end the next movement may have begun.
const LAST_S: (f64, f64) = (6.0, 1.0);
/// Least time between the rows that are checked, s.
const STEP_S: f64 = 0.2;

/// Returns all holds of at least `least_s`, and never less than 20 s, in order of time. `span` is the range of the strain.
#[must_use]
pub fn holds(samples: &Samples, span: f64, least_s: f64) -> Vec<Hold> {
    let (time_s, strain) = (samples.time_s, bridged_strain(samples));
    let rows = thinned(time_s);
    let (mut found, mut start) = (Vec::new(), 0);
    while start < rows.len() {
        let end = standing_still(&rows, &strain, start, 2.0 * STILL * span);
        let (first, last) = (rows[start], rows[end]);
        let duration_s = time_s[last] - time_s[first];
        if duration_s < least_s.max(LEAST_HOLD_S) {
            start += 1;
            continue;
        }
        let last_reading = mean_reading(samples, time_s[last] - LAST_S.0, time_s[last] - LAST_S.1);
        found.extend(last_reading.map(|last_reading| Hold { rows: first..last + 1, duration_s, last_reading }));
        start = end + 1;
    }
    found
}

/// Returns rows that are at least [`STEP_S`] apart.
fn thinned(time_s: &[f64]) -> Vec<usize> {
    let mut rows: Vec<usize> = Vec::new();
    for (row, now_s) in time_s.iter().enumerate() {
        if rows.last().is_none_or(|&last| now_s - time_s[last] >= STEP_S) {
            rows.push(row);
        }
    }
    rows
}

/// Returns the last of `rows` up to which the strain is known and stays within a range of `width`, from `start` on.
fn standing_still(rows: &[usize], strain: &[f64], start: usize, width: f64) -> usize {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let stays = rows[start..].iter().take_while(|&&row| {
        (low, high) = (strain[row].min(low), strain[row].max(high));
        strain[row].is_finite() && high - low <= width
    });
    start + stays.count().saturating_sub(1)
}

/// Returns the mean of the readings between two times; `None` without a reading.
fn mean_reading(samples: &Samples, from_s: f64, until_s: f64) -> Option<f64> {
    let first = samples.time_s.partition_point(|time_s| *time_s < from_s);
    let rows = samples.time_s[first..].iter().zip(&samples.reading[first..]);
    let known = rows.take_while(|(time_s, _)| **time_s <= until_s).map(|(_, reading)| *reading);
    let (count, sum) = known.filter(|r| r.is_finite()).fold((0_u32, 0.0), |(count, sum), r| (count + 1, sum + r));
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    use super::holds;
    use crate::samples::Samples;

    /// Returns a strain that rises in 5 s, is held for 60 s at 0.3 with a jitter of 0.4 % of the range, falls, and is held for 30 s at 0.
    fn strain(t: f64) -> f64 {
        let jitter = 0.0012 * (if (10.0 * t) as i64 % 2 == 0 { 1.0 } else { -1.0 });
        match t {
            ..5.0 => 0.06 * t,
            5.0..65.0 => 0.3 + jitter,
            65.0..70.0 => 0.06 * (70.0 - t),
            _ => 0.0,
        }
    }

    #[test]
    fn what_stands_still_is_found_with_its_last_reading() {
        let time_s: Vec<f64> = (0..1000).map(|k| 0.1 * f64::from(k)).collect();
        let strains: Vec<f64> = time_s.iter().map(|t| strain(*t)).collect();
        let reading: Vec<f64> = time_s.iter().map(|t| 1000.0 - t).collect();
        let samples = Samples::new(&time_s, &reading, &strains).unwrap();
        let found = holds(&samples, 0.3, 0.0);
        assert_eq!(found.len(), 2, "{found:?}");
        for (hold, [from_s, until_s]) in found.iter().zip([[5.0, 65.0], [70.0, 99.9]]) {
            // The strain passes 1 % of the range within 0.05 s; rows are checked every 0.2 s.
            assert!((time_s[hold.rows.start] - from_s).abs() <= 0.3, "{hold:?}");
            assert!((time_s[hold.rows.end - 1] - until_s).abs() <= 0.3, "{hold:?}");
            // The mean reading from 6 s to 1 s before the end is that of 3.5 s before it.
            assert!((hold.last_reading - (1000.0 - until_s + 3.5)).abs() <= 0.3, "{hold:?}");
        }
        assert_eq!(holds(&samples, 0.3, 45.0).len(), 1);
        // Half a second between rows, every other one with a reference.
        let sparse: Vec<f64> =
            strains.iter().enumerate().map(|(k, x)| if k % 10 == 0 { *x } else { f64::NAN }).collect();
        assert_eq!(holds(&Samples::new(&time_s, &reading, &sparse).unwrap(), 0.3, 0.0).len(), 2);
        // The reference fails for 30 s of the first hold.
        let failing: Vec<f64> =
            time_s.iter().zip(strains).map(|(t, x)| if (20.0..50.0).contains(t) { f64::NAN } else { x }).collect();
        assert_eq!(holds(&Samples::new(&time_s, &reading, &failing).unwrap(), 0.3, 0.0).len(), 1);
    }
}
