use std::ops::Range;

use thiserror::Error;

use crate::order::{extent, median, range};

/// One recording: times, readings and, where it is known, the true strain.
///
/// "Strain" stands for the reference quantity whatever its unit: an angle in degrees is calibrated in degrees.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// Times, s, strictly increasing.
    pub(crate) time_s: &'a [f64],
    /// Readings, Ω or a ratio, positive; NaN where missing.
    pub(crate) reading: &'a [f64],
    /// True strain; NaN where missing.
    pub(crate) strain: &'a [f64],
    /// Standard deviations of the true strains; empty if they are exact.
    pub(crate) strain_sd: &'a [f64],
}

/// Reason why slices do not form a recording. Rows count from zero.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SamplesError {
    /// The slices have different lengths.
    #[error("{times} times, {readings} readings and {strains} strains; expected as many of each")]
    Lengths {
        /// Number of times.
        times: usize,
        /// Number of readings.
        readings: usize,
        /// Number of strains.
        strains: usize,
    },
    /// A time is NaN or infinite.
    #[error("row {row}: expected a finite time, found {time_s}")]
    Time {
        /// The row.
        row: usize,
        /// Its time, s.
        time_s: f64,
    },
    /// A time is not after the previous one.
    #[error("row {row}: expected a time after {before_s} s, found {time_s} s")]
    Order {
        /// The row.
        row: usize,
        /// Its time, s.
        time_s: f64,
        /// Previous time, s.
        before_s: f64,
    },
    /// A reading is infinite, zero or negative.
    #[error("row {row}: expected a positive reading, or NaN where it is missing, found {reading}")]
    Reading {
        /// The row.
        row: usize,
        /// Its reading.
        reading: f64,
    },
    /// A strain is infinite.
    #[error("row {row}: expected a finite strain, or NaN where it is missing, found {strain}")]
    Strain {
        /// The row.
        row: usize,
        /// Its strain.
        strain: f64,
    },
    /// A known strain with a standard deviation that is NaN, infinite or negative.
    #[error("row {row}: expected a standard deviation of zero or more, found {strain_sd}")]
    StrainSd {
        /// The row.
        row: usize,
        /// Its standard deviation.
        strain_sd: f64,
    },
}

impl<'a> Samples<'a> {
    /// Makes a recording of increasing times, s, positive readings, Ω or ratios, and true strains. NaN stands for a missing reading or
    /// strain.
    ///
    /// # Errors
    /// If the slices differ in length, or with the first invalid row.
    pub fn new(time_s: &'a [f64], reading: &'a [f64], strain: &'a [f64]) -> Result<Self, SamplesError> {
        if reading.len() != time_s.len() || strain.len() != time_s.len() {
            let (times, readings, strains) = (time_s.len(), reading.len(), strain.len());
            return Err(SamplesError::Lengths { times, readings, strains });
        }
        let mut before = None;
        for (row, ((&time_s, &reading), &strain)) in time_s.iter().zip(reading).zip(strain).enumerate() {
            if !time_s.is_finite() {
                return Err(SamplesError::Time { row, time_s });
            }
            if let Some(before_s) = before.filter(|before_s| time_s <= *before_s) {
                return Err(SamplesError::Order { row, time_s, before_s });
            }
            if reading <= 0.0 || reading.is_infinite() {
                return Err(SamplesError::Reading { row, reading });
            }
            if strain.is_infinite() {
                return Err(SamplesError::Strain { row, strain });
            }
            before = Some(time_s);
        }
        Ok(Self { time_s, reading, strain, strain_sd: &[] })
    }

    /// Replaces the readings.
    ///
    /// # Errors
    /// If their number differs, or with the first invalid one.
    pub fn with_readings<'b>(&self, reading: &'b [f64]) -> Result<Samples<'b>, SamplesError>
    where
        'a: 'b,
    {
        let Self { time_s, strain, strain_sd, .. } = *self;
        Ok(Samples { strain_sd, ..Samples::new(time_s, reading, strain)? })
    }

    /// Adds standard deviations of the true strains. Errors of an estimate are increased by them, so that intervals cover the reference's
    /// error as well.
    ///
    /// # Errors
    /// [`SamplesError::StrainSd`] for the first known strain whose standard deviation is not zero or positive, and
    /// [`SamplesError::Lengths`].
    pub fn with_strain_sd(self, strain_sd: &'a [f64]) -> Result<Self, SamplesError> {
        let (times, strains) = (self.time_s.len(), strain_sd.len());
        if strains != times {
            return Err(SamplesError::Lengths { times, readings: times, strains });
        }
        let is_wrong = |row: &usize| self.strain[*row].is_finite() && !(0.0..f64::INFINITY).contains(&strain_sd[*row]);
        match (0..times).find(is_wrong) {
            Some(row) => Err(SamplesError::StrainSd { row, strain_sd: strain_sd[row] }),
            None => Ok(Self { strain_sd, ..self }),
        }
    }

    /// Returns the standard deviation of the true strain in a row; zero if it is exact.
    pub(crate) fn sd_of_strain(&self, row: usize) -> f64 {
        self.strain_sd.get(row).copied().filter(|sd| sd.is_finite()).unwrap_or(0.0)
    }

    /// Returns the times, s.
    #[must_use]
    pub const fn time_s(&self) -> &'a [f64] {
        self.time_s
    }

    /// Returns the readings; NaN where missing.
    #[must_use]
    pub const fn reading(&self) -> &'a [f64] {
        self.reading
    }

    /// Returns the true strains; NaN where missing.
    #[must_use]
    pub const fn strain(&self) -> &'a [f64] {
        self.strain
    }

    /// Returns the first `rows` rows.
    #[must_use]
    pub fn head(&self, rows: usize) -> Self {
        let rows = rows.min(self.time_s.len());
        let strain_sd = self.strain_sd.get(..rows).unwrap_or_default();
        Self { time_s: &self.time_s[..rows], reading: &self.reading[..rows], strain: &self.strain[..rows], strain_sd }
    }

    /// Returns the time from the first row to the last, s.
    pub(crate) fn duration_s(&self) -> f64 {
        self.time_s.last().zip(self.time_s.first()).map_or(0.0, |(last, first)| last - first)
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// True if there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Returns the rows in which both reading and strain are known.
    pub fn complete_rows(&self) -> impl Iterator<Item = usize> + use<'a> {
        let (reading, strain) = (self.reading, self.strain);
        (0..self.time_s.len()).filter(move |&k| reading[k].is_finite() && strain[k].is_finite())
    }

    /// Returns the smallest and the largest known strain; `None` if no strain is known.
    #[must_use]
    pub fn strain_range(&self) -> Option<(f64, f64)> {
        range(self.strain.iter().copied().filter(|x| x.is_finite()))
    }
}

/// Least number of complete rows in a recording for calibration: several per parameter of the smallest law.
pub(crate) const FEWEST_ROWS: usize = 60;

/// Longest gap in a reference over which its values are interpolated, in usual steps between them.
pub(crate) const LONGEST_GAP: f64 = 10.0;

/// Returns the strain without gaps: missing values are interpolated in time, and the ends held.
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

/// Returns the strain with missing values interpolated in time, and the ends held; NaN in long gaps and at long ends without a reference.
#[must_use]
pub(crate) fn bridged_strain(samples: &Samples) -> Vec<f64> {
    let known: Vec<usize> = (0..samples.len()).filter(|&k| samples.strain[k].is_finite()).collect();
    let mut strain = filled_strain(samples);
    let (Some(&first), Some(&last)) = (known.first(), known.last()) else { return strain };
    let known_s: Vec<f64> = known.iter().map(|&k| samples.time_s[k]).collect();
    let longest_s = LONGEST_GAP * usual_step_s(std::iter::once(&known_s[..]));
    let gaps = known.windows(2).map(|pair| (pair[0] + 1..pair[1], pair[0], pair[1]));
    let end = samples.len() - 1;
    for (rows, a, b) in gaps.chain([(0..first, 0, first), (last + 1..samples.len(), last, end)]) {
        if samples.time_s[b] - samples.time_s[a] > longest_s {
            strain[rows].fill(f64::NAN);
        }
    }
    strain
}

/// Rows between long gaps in a reference, and their strain without gaps.
pub(crate) type KnownPart = (Range<usize>, Vec<f64>);

/// Returns the parts of a recording between long gaps in its reference, of two rows and more.
pub(crate) fn known_parts(samples: &Samples) -> Vec<KnownPart> {
    let strain = bridged_strain(samples);
    let mut start = 0;
    let part = |run: &[f64]| {
        start += run.len();
        (run.len() > 1 && run[0].is_finite()).then(|| (start - run.len()..start, run.to_vec()))
    };
    strain.chunk_by(|a, b| a.is_finite() == b.is_finite()).filter_map(part).collect()
}

/// Returns the usual time between rows, s: the median step over all recordings.
pub(crate) fn usual_step_s<'a>(recordings: impl Iterator<Item = &'a [f64]>) -> f64 {
    median(recordings.flat_map(|time_s| time_s.windows(2).map(|pair| pair[1] - pair[0]))).unwrap_or(0.0)
}

/// Returns the smallest and the largest reading of the rows used for calibration.
pub(crate) fn reading_range(recordings: &[Samples]) -> (f64, f64) {
    let readings = recordings.iter().flat_map(|samples| samples.complete_rows().map(|k| samples.reading[k]));
    extent(readings)
}

/// Returns the rate by central differences over one row to each side, one-sided at the ends.
pub(crate) fn central_rate(time_s: &[f64], x: &[f64]) -> Vec<f64> {
    let last = x.len().saturating_sub(1);
    (0..x.len())
        .map(|k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(last));
            if a == b { 0.0 } else { (x[b] - x[a]) / (time_s[b] - time_s[a]) }
        })
        .collect()
}
