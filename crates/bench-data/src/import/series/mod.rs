//! Channels and clocks as numbers.

mod digits;
mod times;
mod values;

use crate::import::error::ImportError;
use crate::import::roles::is_coarse;
use crate::import::table::Table;
use crate::order::{LONGEST_GAP, median, typical_step};

use digits::rounded_distinct;

pub(crate) use times::Times;
pub(crate) use values::{Values, check_positive, converted};

/// Largest time after a restart, as a share of the time since the recording's start.
const RESTART: f64 = 0.1;
/// Answers for a clock that restarts.
const ANOTHER_RECORDING: [&str; 2] = [
    "--split-recordings if another recording begins here, for a file of each",
    "--recording 1 for the first of them alone",
];

/// Values over strictly increasing times.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Series {
    /// Times, s.
    pub time: Vec<f64>,
    /// Values; NaN is a missing one.
    pub value: Vec<f64>,
    /// Row of each in the table.
    pub row: Vec<usize>,
}

impl Series {
    pub(crate) fn push(&mut self, time: f64, value: f64, row: usize) {
        self.time.push(time);
        self.value.push(value);
        self.row.push(row);
    }

    /// Takes a table's rows, whose times must not decrease, and counts the omitted ones: those without a time, and those with the time of
    /// the previous row.
    pub(crate) fn ordered(table: &Table, time: &[f64], value: Vec<f64>) -> Result<(Self, usize, usize), ImportError> {
        let (mut series, mut untimed, mut repeated) = (Self::default(), 0, 0);
        for (row, (&time, value)) in time.iter().zip(value).enumerate() {
            match series.time.last() {
                _ if time.is_nan() => untimed += 1,
                Some(&last) if time == last => repeated += 1,
                Some(&last) if time < last => {
                    let (last, time) = rounded_distinct(last, time);
                    let place = format!("{}:{}", table.file, table.lines[row]);
                    let what = format!("expected a time after {last} s, found {time} s");
                    // A clock that restarts begins anew.
                    let start = series.time.first().copied().unwrap_or_default();
                    if time - start > RESTART * (last - start) {
                        return Err(ImportError::unreadable(&place, format!("{what}: the rows are out of order")));
                    }
                    return Err(ImportError::question(&place, what, ANOTHER_RECORDING.map(str::to_owned)));
                }
                _ => series.push(time, value, row),
            }
        }
        if series.time.is_empty() {
            return Err(ImportError::unreadable(&table.file, "expected rows with a time, found none"));
        }
        if is_coarse(repeated, table.len()) {
            let rows = table.len();
            let what = format!("{repeated} of {rows} rows have the time of the row before: the clock is too coarse");
            let answer = "--rate-hz HZ if the rows are evenly spaced".to_owned();
            return Err(ImportError::question(&table.file, what, [answer]));
        }
        Ok((series, untimed, repeated))
    }

    /// Interpolates the known values linearly; NaN outside of them and in gaps, unless the values on both sides are equal.
    pub(crate) fn at(&self, times: &[f64]) -> Vec<f64> {
        let known: Vec<usize> = (0..self.time.len()).filter(|row| !self.value[*row].is_nan()).collect();
        let step = typical_step(&self.time).unwrap_or(0.0);
        let mut next = 0;
        let value = |&time: &f64| {
            while next < known.len() && self.time[known[next]] < time {
                next += 1;
            }
            let after = *known.get(next)?;
            if self.time[after] == time {
                return Some(self.value[after]);
            }
            let before = known[next.checked_sub(1)?];
            let gap = self.time[after] - self.time[before];
            let share = (time - self.time[before]) / gap;
            let (a, b) = (self.value[before], self.value[after]);
            (gap <= LONGEST_GAP * step || a == b).then_some(a + share * (b - a))
        };
        times.iter().map(value).map(|value| value.unwrap_or(f64::NAN)).collect()
    }
}

/// Returns the means of neighbours, in time and in value. Their currents are opposite, so that an offset of the electronics cancels in the
/// mean.
pub(crate) fn folded(series: &Series) -> Series {
    let mut out = Series::default();
    for row in 1..series.time.len() {
        let mean = |values: &[f64]| 0.5 * (values[row - 1] + values[row]);
        out.push(mean(&series.time), mean(&series.value), series.row[row]);
    }
    out
}

/// Returns rows with a lone 0 between values of one sign, if the jumps to both neighbours are larger than almost all others; every 0 if a
/// value cannot be zero.
pub(crate) fn spurious_zeros(values: &[f64], never_zero: bool) -> Vec<usize> {
    if never_zero {
        return (0..values.len()).filter(|row| values[*row] == 0.0).collect();
    }
    let pairs = values.windows(2).filter(|pair| pair[0] != 0.0 && pair[1] != 0.0);
    let mut steps: Vec<f64> = pairs.map(|pair| (pair[1] - pair[0]).abs()).filter(|step| !step.is_nan()).collect();
    steps.sort_by(f64::total_cmp);
    let usual = steps.get(steps.len() * 95 / 100).copied().unwrap_or(0.0);
    let is_known = |row: &usize| !values[*row].is_nan();
    let is_spurious = |row: &usize| {
        let (before, after) = ((0..*row).rev().find(is_known), (*row + 1..values.len()).find(is_known));
        let (Some(before), Some(after)) = (before.map(|row| values[row]), after.map(|row| values[row])) else {
            return false;
        };
        before * after > 0.0 && before.abs().min(after.abs()) > usual
    };
    (0..values.len()).filter(|row| values[*row] == 0.0).filter(is_spurious).collect()
}

/// Returns the amplitude by which neighbouring readings alternate, relative to their size, if they do: in most stretches of twenty, nearly
/// all readings alternate between above and below their neighbours' mean. In noise, about three of four do.
pub(crate) fn alternation(values: &[f64]) -> Option<f64> {
    const STRETCH: usize = 20;
    const SHARE: f64 = 0.8;
    // Of simulated white noise, 1.3 % of the stretches qualify, two of two in 2e-4 of the recordings, three of four in 1e-5.
    const FEWEST: usize = 4;
    let known: Vec<f64> = values.iter().copied().filter(|value| !value.is_nan()).collect();
    let off = |i: usize| known[i] - 0.5 * (known[i - 1] + known[i + 1]);
    let sides: Vec<f64> =
        (1..known.len().saturating_sub(1)).map(|i| if i % 2 == 0 { off(i) } else { -off(i) }).collect();
    let stretches: Vec<&[f64]> = sides.chunks_exact(STRETCH).collect();
    let strict =
        |stretch: &&[f64]| stretch.iter().map(|side| side.signum()).sum::<f64>().abs() >= SHARE * STRETCH as f64;
    let count = stretches.iter().filter(|stretch| strict(stretch)).count();
    let half = median(sides.iter().map(|side| side.abs()).collect())?;
    let size = median(known.iter().map(|value| value.abs()).collect())?;
    (stretches.len() >= FEWEST && count * 2 > stretches.len() && half > 0.0).then(|| half / size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zero_is_spurious_only_where_the_motion_cannot_be() {
        let mut values: Vec<f64> = (0..200).map(|i| (f64::from(i) * 0.05).sin().abs() * 10.0).collect();
        values[0] = 0.0;
        for row in [20, 40, 101] {
            values[row] = 0.0;
        }
        assert_eq!(spurious_zeros(&values, false), [20, 40, 101]);
        let through_zero = [1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0, 0.5];
        assert_eq!(spurious_zeros(&through_zero, false), [] as [usize; 0]);
        let turns_at_zero = [1.0, 0.5, 0.0, 0.5, 1.0, 0.5, 0.0, 0.5];
        assert_eq!(spurious_zeros(&turns_at_zero, false), [] as [usize; 0]);
    }

    #[test]
    fn nothing_is_made_up_outside_and_in_gaps() {
        let time: Vec<f64> = (0..20).map(f64::from).chain([50.0]).collect();
        let series = Series { value: time.clone(), row: (0..21).collect(), time };
        let at = series.at(&[-1.0, 0.0, 2.5, 19.0, 30.0, 50.0, 51.0]);
        assert_eq!(at[1..4], [0.0, 2.5, 19.0]);
        assert_eq!(at[5], 50.0);
        assert!([0, 4, 6].iter().all(|i| at[*i].is_nan()));
    }

    /// Returns a slow rise by 20 %, with every other reading larger by 2 %.
    fn flipping(rows: u32) -> Vec<f64> {
        (0..rows).map(|k| (1.0 + 1e-3 * f64::from(k)) * if k % 2 == 0 { 1600.0 } else { 1632.0 }).collect()
    }

    #[test]
    fn polarity_is_not_determined_from_a_few_readings() {
        assert_eq!(alternation(&flipping(60)), None);
        let share = alternation(&flipping(200)).unwrap();
        assert!((share - 0.02).abs() < 0.001, "{share}");
    }
}
