use std::ops::Range;

use ohmstrain_ekf::correction::FEATURES;
use ohmstrain_sensor::TrainingRow;

use crate::order::mean_sd;

/// Weight of the path length of the features, against time, in the choice of rows: long holds repeat the same row.
const BY_WAY: f64 = 0.8;

/// Chooses rows spread evenly over time and over the path length of the past features, in each recording by itself.
pub(crate) fn chosen(candidates: &[TrainingRow], recordings: &[Range<usize>], most: usize) -> Vec<TrainingRow> {
    let sd = |i: usize| mean_sd(candidates.iter().map(|row| row.past[i])).1.max(f64::MIN_POSITIVE);
    let sds: [f64; FEATURES] = std::array::from_fn(sd);
    let step = |pair: &[TrainingRow]| {
        let square: f64 = (0..FEATURES).map(|i| ((pair[1].past[i] - pair[0].past[i]) / sds[i]).powi(2)).sum();
        square.sqrt()
    };
    let steps: Vec<Vec<f64>> =
        recordings.iter().map(|rows| candidates[rows.clone()].windows(2).map(step).collect()).collect();
    let counts: Vec<usize> = recordings.iter().map(Range::len).collect();
    let quotas = quotas(&shares(&steps, &counts), &counts, most);
    let each = recordings.iter().zip(&steps).zip(quotas);
    each.flat_map(|((rows, steps), quota)| spread(&candidates[rows.clone()], steps, quota)).collect()
}

/// Weight of the path against time; without a path all weight is time's.
fn by_way(way: f64) -> f64 {
    if way > 0.0 { BY_WAY } else { 0.0 }
}

/// Returns the share of each recording in all rows to choose, from its steps of the path and its number of rows.
fn shares(steps: &[Vec<f64>], counts: &[usize]) -> Vec<f64> {
    let (way, rows) = (steps.iter().flatten().sum::<f64>(), counts.iter().sum::<usize>() as f64);
    let by_way = by_way(way);
    let share = |(steps, count): (&Vec<f64>, &usize)| {
        by_way * steps.iter().sum::<f64>() / way.max(f64::MIN_POSITIVE) + (1.0 - by_way) * *count as f64 / rows
    };
    steps.iter().zip(counts).map(share).collect()
}

/// Divides `most` rows among recordings by their shares. Rows that a recording does not have go to the others, so that all are given away
/// as long as there are some.
fn quotas(shares: &[f64], counts: &[usize], most: usize) -> Vec<usize> {
    let mut quotas = vec![0; counts.len()];
    loop {
        let left = most.min(counts.iter().sum()) - quotas.iter().sum::<usize>();
        let open: Vec<usize> = (0..counts.len()).filter(|&k| quotas[k] < counts[k]).collect();
        let total: f64 = open.iter().map(|&k| shares[k]).sum();
        if left == 0 || open.is_empty() {
            return quotas;
        }
        let (mut share, mut given) = (0.0, 0);
        for k in open.iter().copied() {
            share += if total > 0.0 { shares[k] / total } else { 1.0 / open.len() as f64 };
            let due = (share * left as f64).round() as usize - given;
            given += due;
            quotas[k] = (quotas[k] + due).min(counts[k]);
        }
    }
}

/// Chooses `most` rows of a recording, the first one included, spread over time and over the path with these `steps`.
fn spread(candidates: &[TrainingRow], steps: &[f64], most: usize) -> Vec<TrainingRow> {
    let n = candidates.len();
    let most = most.min(n);
    if most == 0 {
        return vec![];
    }
    let way = steps.iter().sum::<f64>();
    let by_way = by_way(way);
    let mut gone = 0.0;
    let mut rows = vec![candidates[0]];
    for (k, (row, step)) in candidates.iter().skip(1).zip(steps).enumerate() {
        gone += by_way * step / way.max(f64::MIN_POSITIVE) + (1.0 - by_way) / (n - 1) as f64;
        // Due: fewer rows are chosen than should be by now. Needed: no more rows remain than are still wanted.
        let due = gone * (most - 1) as f64 + 1.0 + 1e-9 >= (rows.len() + 1) as f64;
        let needed = most - rows.len() >= n - 1 - k;
        if rows.len() < most && (due || needed) {
            rows.push(*row);
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A row whose first past feature is given, at a time of its own.
    fn row(time_s: f64, feature: f64) -> TrainingRow {
        let mut past = [0.0; FEATURES];
        past[0] = feature;
        let (future, filtered, smoothed) = Default::default();
        TrainingRow { time_s, strain: 0.0, past, future, filtered, smoothed }
    }

    /// A long slow recording and a short fast one: the short one gives all of its rows, the long one the rest. Without a path rows
    /// are spread over time.
    #[test]
    fn all_rows_asked_for_are_chosen() {
        let slow = (0..5000).map(|k| row(f64::from(k), 1e-4 * f64::from(k)));
        let fast = (0..60).map(|k| row(6000.0 + f64::from(k), f64::from(k % 2)));
        let candidates: Vec<TrainingRow> = slow.chain(fast).collect();
        let rows = chosen(&candidates, &[0..5000, 5000..5060], 200);
        assert_eq!(rows.len(), 200);
        assert_eq!(rows.iter().filter(|row| row.time_s >= 6000.0).count(), 60);

        let still: Vec<TrainingRow> = (0..1000).map(|k| row(f64::from(k), 0.5)).collect();
        let times: Vec<f64> =
            chosen(&still, std::slice::from_ref(&(0..1000)), 50).iter().map(|row| row.time_s).collect();
        // Even to a row: 999 / 49.
        assert!(times.windows(2).all(|pair| (pair[1] - pair[0] - 999.0 / 49.0).abs() <= 1.0), "{times:?}");
    }

    proptest! {
        /// Quotas sum to the rows asked for or all there are, and no recording gives more than it has, in any division.
        #[test]
        fn quotas_add_up(parts in prop::collection::vec((0.0..1.0_f64, 0..300_usize), 1..9), most in 0..400_usize) {
            let (shares, counts): (Vec<f64>, Vec<usize>) = parts.into_iter().unzip();
            let quotas = quotas(&shares, &counts, most);
            prop_assert_eq!(quotas.iter().sum::<usize>(), most.min(counts.iter().sum()));
            prop_assert!(quotas.iter().zip(&counts).all(|(quota, count)| quota <= count));
        }
    }
}
