use std::fmt;

use crate::CalibrationError;
use crate::digits::significant;
use crate::law::regression::LawRegression;
use crate::law::robust_loss;
use crate::law::robust_loss::robust;
use crate::order::{median, sorted};
use crate::samples::Samples;

/// A row that calibration distrusts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distrusted {
    /// Index of the recording, from zero.
    pub recording: usize,
    /// Index of its row, from zero.
    pub row: usize,
    /// Its time, s.
    pub time_s: f64,
    /// Its fault.
    pub doubt: Doubt,
}

/// Reason for distrusting a row.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Doubt {
    /// The reading is far from its neighbours.
    Reading {
        /// The reading.
        found: f64,
        /// Median of the neighbouring rows.
        around: f64,
    },
    /// The reference is far from its neighbours.
    Reference {
        /// The reference.
        found: f64,
        /// Median of the neighbouring rows.
        around: f64,
    },
    /// Reading and reference contradict each other; it is unknown which of them is wrong.
    Law {
        /// Distance from the preliminary law, in robust standard deviations.
        deviations: f64,
    },
}

/// Number of digits in messages, which hides the rounding of a unit conversion.
const DIGITS: usize = 7;

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let short = |value: &f64| significant(*value, DIGITS);
        match self {
            Self::Reading { found, around } => {
                write!(f, "reading {} among readings of {}", short(found), short(around))
            }
            Self::Reference { found, around } => {
                write!(f, "reference {} among references of {}", short(found), short(around))
            }
            Self::Law { deviations } => {
                write!(
                    f,
                    "reading and reference do not go together, {deviations:.0} deviations from what the others say"
                )
            }
        }
    }
}

/// Recordings in which distrusted values are missing.
#[derive(Clone, Debug)]
pub struct Screened {
    recordings: Vec<Columns>,
    /// Rows that were left out, recording by recording.
    pub distrusted: Vec<Distrusted>,
}

#[derive(Clone, Debug)]
struct Columns {
    time_s: Vec<f64>,
    reading: Vec<f64>,
    strain: Vec<f64>,
    strain_sd: Vec<f64>,
}

/// Number of rows to each side with which a row is compared.
const NEIGHBOURS: usize = 3;
/// Least distance of a spike from the median of its neighbours: as a fraction of the column's span, in multiples of those neighbours'
/// spread, and in multiples of the 90 % quantile of such distances, so that a movement of few rows is not a spike. On eleven public
/// recordings of three materials nothing reaches 0.1 of the span.
const SPIKE: (f64, f64, f64) = (0.25, 8.0, 3.0);
/// Quantiles of the values that bound the span.
const SPAN: (f64, f64) = (0.02, 0.98);
/// Weight in the preliminary law, five robust deviations over the row's own, below which a row is distrusted if it is also off by this
/// fraction of the readings' span. On those recordings no weight is below 0.57.
const LEAST_WEIGHT: f64 = 0.2;
const LEAST_MISFIT: f64 = 0.1;
/// Largest fraction of rows that count as outliers; with more, the law is wrong.
const MOST_OUTLIERS: f64 = 0.05;
/// Largest fraction of the readings' variance that the law may leave on held-out blocks. Those recordings leave 0.47 and less, readings
/// unrelated to the reference 0.98 and more.
const MOST_UNEXPLAINED: f64 = 0.9;
/// Largest such fraction on the fitted rows, if held-out blocks exceed their limit: in one extension, one hold and one release, no part is
/// like the others. The published protocol, simulated with three materials, leaves 0.04 and less, readings unrelated to the reference 0.8
/// and more.
const MOST_UNEXPLAINED_FITTED: f64 = 0.2;
/// Ridges tried for that; strong ones extrapolate least.
const SCREENING_RIDGES: [f64; 3] = [0.1, 0.01, 0.001];

/// Removes outliers, then rows whose reading and reference contradict each other, and checks that the readings follow the reference at all.
/// A second screening finds only rows that the first one uncovered.
///
/// # Errors
/// If the recordings are too short or vary too little to learn a law from, or if the best law explains nothing.
pub fn screen(recordings: &[Samples]) -> Result<Screened, CalibrationError> {
    let mut screened = Screened { recordings: Vec::new(), distrusted: Vec::new() };
    for (recording, samples) in recordings.iter().enumerate() {
        let (mut reading, mut strain) = (samples.reading.to_vec(), samples.strain.to_vec());
        for (row, found, around) in spikes(&reading) {
            let doubt = Doubt::Reading { found, around };
            screened.distrusted.push(Distrusted { recording, row, time_s: samples.time_s[row], doubt });
            reading[row] = f64::NAN;
        }
        for (row, found, around) in spikes(&strain) {
            let doubt = Doubt::Reference { found, around };
            screened.distrusted.push(Distrusted { recording, row, time_s: samples.time_s[row], doubt });
            strain[row] = f64::NAN;
        }
        screened.recordings.push(Columns {
            time_s: samples.time_s.to_vec(),
            reading,
            strain,
            strain_sd: samples.strain_sd.to_vec(),
        });
    }
    screened.leave_out_misfits()?;
    screened.distrusted.sort_by_key(|one| (one.recording, one.row));
    let samples = screened.samples();
    let unexplained = Unexplained::of(&robust(LawRegression::new(&samples)?)).ok_or(CalibrationError::Singular)?;
    if unexplained.left_out > MOST_UNEXPLAINED && unexplained.fitted > MOST_UNEXPLAINED_FITTED {
        return Err(CalibrationError::NothingExplained { unexplained: unexplained.left_out });
    }
    Ok(screened)
}

impl Columns {
    fn samples(&self) -> Samples<'_> {
        Samples { time_s: &self.time_s, reading: &self.reading, strain: &self.strain, strain_sd: &self.strain_sd }
    }
}

impl Screened {
    /// Returns the recordings without those rows.
    #[must_use]
    pub fn samples(&self) -> Vec<Samples<'_>> {
        self.recordings.iter().map(Columns::samples).collect()
    }

    /// Leaves out the rows with next to no weight in the preliminary law.
    fn leave_out_misfits(&mut self) -> Result<(), CalibrationError> {
        let misfits = misfits(&self.samples())?;
        for one in misfits {
            let columns = &mut self.recordings[one.recording];
            (columns.reading[one.row], columns.strain[one.row]) = (f64::NAN, f64::NAN);
            self.distrusted.push(one);
        }
        Ok(())
    }
}

/// Returns rows whose reading and reference contradict each other.
fn misfits(samples: &[Samples]) -> Result<Vec<Distrusted>, CalibrationError> {
    let regression = robust(LawRegression::new(samples)?);
    let weights: Vec<f64> = regression.root_weights().iter().map(|root| root * root).collect();
    if weights.iter().all(|weight| *weight >= LEAST_WEIGHT) {
        return Ok(Vec::new());
    }
    let Some(misfits) = robust_loss::misfits(&regression) else { return Ok(Vec::new()) };
    let mut off: Vec<Distrusted> = Vec::new();
    let mut place = 0;
    for (recording, (samples, of)) in samples.iter().zip(&regression.recordings).enumerate() {
        let most = LEAST_MISFIT * span(samples.reading).unwrap_or(0.0) / of.median_reading();
        let mut row_before = None;
        for &row in &of.complete {
            let (weight, misfit) = (weights[place], misfits[place].abs());
            place += 1;
            if weight >= LEAST_WEIGHT || misfit <= most {
                row_before = None;
                continue;
            }
            // Long recordings are thinned; the rows between two misfits count as misfits.
            let doubt = Doubt::Law { deviations: robust_loss::HUBER / weight };
            let rows = row_before.map_or(row, |before| before + 1)..=row;
            off.extend(rows.map(|row| Distrusted { recording, row, time_s: samples.time_s[row], doubt }));
            row_before = Some(row);
        }
    }
    let rows: usize = samples.iter().map(|samples| samples.complete_rows().count()).sum();
    Ok(if off.len() as f64 > MOST_OUTLIERS * rows as f64 { Vec::new() } else { off })
}

/// Returns isolated values, each with its row and the median of its neighbours.
///
/// Source: Hampel, *J. Am. Stat. Assoc.* 69 (1974) 383, for median and median deviation.
fn spikes(values: &[f64]) -> Vec<(usize, f64, f64)> {
    let known: Vec<usize> = (0..values.len()).filter(|&k| values[k].is_finite()).collect();
    let Some(span) = span(values) else { return Vec::new() };
    let around: Vec<(f64, f64)> = (0..known.len())
        .filter_map(|i| {
            let window = &known[i.saturating_sub(NEIGHBOURS)..(i + NEIGHBOURS + 1).min(known.len())];
            let middle = median(window.iter().map(|&k| values[k]))?;
            Some((middle, median(window.iter().map(|&k| (values[k] - middle).abs()))?))
        })
        .collect();
    let distances: Vec<f64> = known.iter().zip(&around).map(|(&k, (median, _))| (values[k] - median).abs()).collect();
    let usual = sorted(distances.iter().copied()).get(distances.len() * 9 / 10).copied().unwrap_or(0.0);
    let (of_span, of_spread, of_usual) = SPIKE;
    let is_spike = |i: usize| {
        let distance = distances[i];
        distance > 0.0 && distance > of_span * span && distance > of_spread * around[i].1 && distance > of_usual * usual
    };
    (0..known.len()).filter(|&i| is_spike(i)).map(|i| (known[i], values[known[i]], around[i].0)).collect()
}

/// Returns the range that contains nearly all known values; `None` without any.
fn span(values: &[f64]) -> Option<f64> {
    let known = sorted(values.iter().copied().filter(|value| value.is_finite()));
    let last = known.len().checked_sub(1)?;
    let at = |share: f64| known[(last as f64 * share).round() as usize];
    Some(at(SPAN.1) - at(SPAN.0))
}

/// Fractions of the readings' variance that the law leaves.
struct Unexplained {
    /// Fraction on held-out blocks, each in turn.
    left_out: f64,
    /// Fraction on the rows of the fit.
    fitted: f64,
}

impl Unexplained {
    fn of(regression: &LawRegression) -> Option<Self> {
        let design = robust_loss::preliminary(regression).design(regression);
        let normal = regression.normal(&design, &regression.median_readings());
        let all: Vec<usize> = (0..design.columns.len()).collect();
        let constants: Vec<usize> = (0..design.free).collect();
        let constant = normal.cross_validate(&constants, 0.0)?;
        let law = SCREENING_RIDGES.iter().filter_map(|&ridge| normal.cross_validate(&all, ridge)).reduce(f64::min)?;
        let fitted = |columns, ridge| normal.left_out_variance(columns, |_| normal.fit(columns, ridge, &[]));
        let [.., weakest] = SCREENING_RIDGES;
        Some(Self { left_out: law / constant, fitted: fitted(&all, weakest)? / fitted(&constants, 0.0)? })
    }
}

#[cfg(test)]
mod tests {
    use super::spikes;

    fn sine(rows: u32, per_cycle: f64) -> Vec<f64> {
        (0..rows).map(|k| (f64::from(k) * std::f64::consts::TAU / per_cycle).sin()).collect()
    }

    #[test]
    fn movements_are_no_spikes() {
        for per_cycle in [4.3, 7.0, 20.0, 400.0] {
            assert_eq!(spikes(&sine(400, per_cycle)), [], "{per_cycle} rows a cycle");
        }
        let steps: Vec<f64> = (0..400).map(|k| f64::from(k / 50 % 2)).collect();
        // At rest except for three taps, each up and down within ten rows.
        let taps: Vec<f64> = (0..400).map(|k| (5.0 - (f64::from(k % 130) - 60.0).abs()).max(0.0)).collect();
        assert_eq!((spikes(&steps), spikes(&taps), spikes(&[1.0; 99])), (vec![], vec![], vec![]));
    }

    #[test]
    fn lone_rows_are_found_wherever_they_are() {
        let rows = |values: &[f64]| spikes(values).iter().map(|spike| spike.0).collect::<Vec<_>>();
        for at in [0, 1, 57, 200, 398, 399] {
            let mut values = sine(400, 90.0);
            values[at] = 20.0;
            assert_eq!(rows(&values), [at]);
        }
        let mut two = sine(400, 90.0);
        (two[100], two[101], two[300]) = (-9.0, -9.0, f64::NAN);
        assert_eq!(rows(&two), [100, 101]);
    }
}
