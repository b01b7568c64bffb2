use std::cmp::Ordering;

use crate::CalibrationError;
use crate::samples::Samples;

/// Recordings in an order that depends on their rows only, the longest first. Rounding, and the rows that a correction keeps, depend
/// on the order of the recordings: two callers with the same recordings get the same sensor.
pub(crate) struct Arranged<'a> {
    /// The recordings.
    pub recordings: Vec<Samples<'a>>,
    /// The caller's index of each of them.
    caller: Vec<usize>,
}

impl<'a> Arranged<'a> {
    /// Arranges the caller's recordings.
    pub fn new(recordings: &[Samples<'a>]) -> Self {
        let mut caller: Vec<usize> = (0..recordings.len()).collect();
        caller.sort_by(|&a, &b| compare(&recordings[a], &recordings[b]));
        Self { recordings: caller.iter().map(|&index| recordings[index]).collect(), caller }
    }

    /// The caller's index of a recording.
    pub fn caller(&self, arranged: usize) -> usize {
        self.caller[arranged]
    }

    /// Values of the recordings, in the caller's order.
    pub fn in_callers_order<T: Clone>(&self, values: &[T]) -> Vec<T> {
        let mut pairs: Vec<(usize, &T)> = self.caller.iter().copied().zip(values).collect();
        pairs.sort_by_key(|(caller, _)| *caller);
        pairs.into_iter().map(|(_, value)| value.clone()).collect()
    }

    /// The error with the caller's index of its recording.
    pub fn callers_error(&self, error: CalibrationError) -> CalibrationError {
        match error {
            CalibrationError::TooFewRows { recording, complete, needed } => {
                CalibrationError::TooFewRows { recording: self.caller(recording), complete, needed }
            }
            other => other,
        }
    }
}

/// Longer recordings first; of one length by times, readings, strains and their deviations.
fn compare(a: &Samples, b: &Samples) -> Ordering {
    let rows = |samples: &Samples| samples.time_s.len();
    rows(b)
        .cmp(&rows(a))
        .then_with(|| by_values(a.time_s, b.time_s))
        .then_with(|| by_values(a.reading, b.reading))
        .then_with(|| by_values(a.strain, b.strain))
        .then_with(|| a.strain_sd.len().cmp(&b.strain_sd.len()))
        .then_with(|| by_values(a.strain_sd, b.strain_sd))
}

fn by_values(a: &[f64], b: &[f64]) -> Ordering {
    a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}
