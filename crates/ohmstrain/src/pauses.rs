use std::ops::Range;

use ohmstrain_ekf::live::{NEVER_READ_S, Unread};
use ohmstrain_sensor::Output;

/// Pauses of the readings in a recording that is smoothed, from its end to its start.
pub(crate) struct Pauses {
    unread: Unread<f64>,
    /// Time without a reading before the first row, s.
    before_s: f64,
    /// Time of the row seen last, s, and the time from it to the next reading, s.
    next: Option<(f64, f64)>,
}

impl Pauses {
    pub(crate) const fn new((unread, before_s): (Unread<f64>, f64)) -> Self {
        Self { unread, before_s, next: None }
    }

    /// Widens the estimates of a segment in rows without readings, since the strain moves between the last reading and the next
    /// one. At the beginning of the segment, the time since the last reading before it is unknown.
    pub(crate) fn widen(&mut self, rows: Range<usize>, time_s: impl Fn(usize) -> f64, outputs: &mut [Output]) {
        let mut until_s = vec![0.0; outputs.len()];
        for (k, (until_s, output)) in rows.clone().zip(until_s.iter_mut().zip(outputs.iter())).rev() {
            let now_s = time_s(k);
            *until_s = match self.next {
                _ if output.verdict.is_taken() => 0.0,
                Some((next_s, after_s)) => next_s - now_s + after_s,
                None => NEVER_READ_S,
            };
            self.next = Some((now_s, *until_s));
        }
        let mut since_s = if rows.start == 0 { self.before_s } else { NEVER_READ_S };
        let mut last_s = time_s(rows.start);
        for (k, (until_s, output)) in rows.zip(until_s.iter().zip(outputs)) {
            let now_s = time_s(k);
            since_s += now_s - last_s;
            last_s = now_s;
            if output.verdict.is_taken() {
                since_s = 0.0;
                continue;
            }
            let strain = &mut output.estimate.strain;
            strain.variance = self.unread.variance(until_s.min(since_s), strain.mean, strain.variance);
        }
    }
}
