use crate::CalibrationError;

/// One recording: times, readings and, where it is known, the true strain. All slices have the same length.
///
/// "Strain" stands for the reference quantity whatever its unit: an angle in degrees is calibrated in degrees.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// Times, s, strictly increasing.
    pub time_s: &'a [f64],
    /// Readings, Ω or a ratio, positive; NaN where missing.
    pub reading: &'a [f64],
    /// True strain; NaN where missing.
    pub strain: &'a [f64],
}

impl<'a> Samples<'a> {
    /// The first `rows` rows.
    #[must_use]
    pub fn head(&self, rows: usize) -> Self {
        let rows = rows.min(self.time_s.len());
        Self { time_s: &self.time_s[..rows], reading: &self.reading[..rows], strain: &self.strain[..rows] }
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Rows in which both reading and strain are known.
    pub fn complete_rows(&self) -> impl Iterator<Item = usize> + use<'a> {
        let (reading, strain) = (self.reading, self.strain);
        (0..self.time_s.len()).filter(move |&k| reading[k].is_finite() && strain[k].is_finite())
    }

    /// Smallest and largest known strain; `None` if nothing is known.
    #[must_use]
    pub fn strain_range(&self) -> Option<(f64, f64)> {
        let known = self.strain.iter().copied().filter(|x| x.is_finite());
        known.fold(None, |range, x| Some(range.map_or((x, x), |(low, high): (f64, f64)| (low.min(x), high.max(x)))))
    }
}

/// Fewest complete rows a recording needs to be calibrated on: several per parameter of the smallest law.
pub(crate) const FEWEST_ROWS: usize = 60;

/// Checks what calibration relies on and returns the strain's range over all recordings.
pub(crate) fn check(recordings: &[Samples]) -> Result<(f64, f64), CalibrationError> {
    let mut range: Option<(f64, f64)> = None;
    for (recording, samples) in recordings.iter().enumerate() {
        let complete = samples.complete_rows().count();
        if complete < FEWEST_ROWS {
            return Err(CalibrationError::TooFewRows { recording, complete, needed: FEWEST_ROWS });
        }
        let Some((low, high)) = samples.strain_range() else { continue };
        range = Some(range.map_or((low, high), |(l, h)| (l.min(low), h.max(high))));
    }
    match range {
        None => Err(CalibrationError::NoRecording),
        Some((low, high)) if high > low => Ok((low, high)),
        Some(_) => Err(CalibrationError::ConstantStrain),
    }
}

/// The known strain without gaps: missing values interpolated in time, the ends held.
#[must_use]
pub(crate) fn filled_strain(samples: &Samples) -> Vec<f64> {
    let known: Vec<usize> = (0..samples.len()).filter(|&k| samples.strain[k].is_finite()).collect();
    let mut filled = samples.strain.to_vec();
    let (Some(&first), Some(&last)) = (known.first(), known.last()) else { return filled };
    filled[..first].fill(samples.strain[first]);
    filled[last..].fill(samples.strain[last]);
    for pair in known.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        for k in a + 1..b {
            let share = (samples.time_s[k] - samples.time_s[a]) / (samples.time_s[b] - samples.time_s[a]);
            filled[k] = samples.strain[a] + share * (samples.strain[b] - samples.strain[a]);
        }
    }
    filled
}
