//! Fall of the readings in the holds of a calibration, against the law's prediction.

use ohmstrain_ekf::Settling;
use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::calibrate::left_out::{Build, LeftOut, PredictedFall};
use crate::order;
use crate::recording::holds::{Hold, LEAST_HOLD_S, holds};
use crate::samples::Samples;
use crate::sd_scale::Z_95;

/// Minimum duration of a hold, as a fraction of the longest. Shorter ones end before the others.
const LEAST_SHARE: f64 = 1.0 / 3.0;
/// Minimum number of holds: one hold carries no information on the next one.
const FEWEST_HOLDS: usize = 2;
/// Span of the rows used of a hold: from this many seconds after its start to this many before its end, in equal steps of log time.
const FIRST_S: f64 = 2.0;
const BEFORE_END_S: f64 = 10.0;
const ROWS: u32 = 12;
/// Largest widening factor: two or three holds determine a standard deviation poorly, but not as poorly as Student's t says.
const MOST_WIDENED: f64 = 3.0;
/// Ratios tried of the standard deviation that grows with the relaxation to the constant one: 0, and from 0.1 to 100 in 30 steps.
const RATIOS: (u32, f64, f64) = (30, 0.1, 100.0);

/// A row of a hold.
struct Fall {
    /// Reading minus the last one of the hold.
    read: f64,
    /// Fall predicted by the law.
    predicted: f64,
}

/// Long holds of the recordings.
pub(crate) struct LongHolds {
    longest_s: f64,
    count: usize,
    /// Rows used of each recording, in order.
    rows: Vec<Vec<usize>>,
    /// Their readings minus the last one of their hold.
    read: Vec<Vec<f64>>,
}

impl LongHolds {
    /// Collects the long holds of recordings whose strains have a range of `span`; `None` if there are not enough of them.
    pub(crate) fn new(recordings: &[Samples], span: f64) -> Option<Self> {
        let every: Vec<Vec<Hold>> = recordings.iter().map(|samples| holds(samples, span, LEAST_HOLD_S)).collect();
        let longest_s = every.iter().flatten().map(|hold| hold.duration_s).reduce(f64::max)?;
        let long = |hold: &&Hold| hold.duration_s >= LEAST_SHARE * longest_s;
        let count = every.iter().flatten().filter(long).count();
        if count < FEWEST_HOLDS {
            return None;
        }
        let of = |(samples, holds): (&Samples, &Vec<Hold>)| -> (Vec<usize>, Vec<f64>) {
            holds.iter().filter(long).flat_map(|hold| rows_of(hold, samples)).unzip()
        };
        let (rows, read) = recordings.iter().zip(&every).map(of).unzip();
        Some(Self { longest_s, count, rows, read })
    }

    /// Returns the settling of filters that report the full relaxation of the branches within the longest hold.
    pub(crate) const fn law(&self) -> Settling<f64> {
        Settling { horizon_s: self.longest_s, share: 1.0, share_sd: 0.0, sd: 0.0 }
    }

    /// Estimates the settling; `None` if a filter fails. `build` makes filters with [`Self::law`].
    ///
    /// The share is the least-squares estimate, the standard deviations are maximum-likelihood estimates. Errors within one hold are alike,
    /// so the number of holds determines the uncertainty for another hold, by Student's t.
    pub(crate) fn settling(&self, left_out: &LeftOut, build: &Build) -> Option<Settling<f64>> {
        let fall = |of: PredictedFall| {
            let place = self.rows[of.recording].binary_search(&of.row).ok()?;
            Some(Fall { read: self.read[of.recording][place] / of.rest_reading, predicted: of.predicted })
        };
        let falls: Vec<Fall> = left_out.falls(build, &self.rows)?.into_iter().filter_map(fall).collect();
        (!falls.is_empty()).then(|| likeliest(&falls, self.count, self.longest_s))
    }
}

/// Returns the rows of a hold that have a reading, with its difference from the last one.
fn rows_of(hold: &Hold, samples: &Samples) -> Vec<(usize, f64)> {
    let start_s = samples.time_s[hold.rows.start];
    let latest = (hold.duration_s - BEFORE_END_S) / FIRST_S;
    let times = (0..ROWS).map(|k| start_s + FIRST_S * latest.powf(f64::from(k) / f64::from(ROWS - 1)));
    let mut rows: Vec<usize> =
        times.map(|time| samples.time_s.partition_point(|t| *t < time)).filter(|row| hold.rows.contains(row)).collect();
    rows.dedup();
    let above = |row: usize| (row, samples.reading[row] - hold.last_reading);
    rows.into_iter().map(above).filter(|(_, above)| above.is_finite()).collect()
}

/// Estimates share and standard deviations from the rows of `count` holds.
fn likeliest(falls: &[Fall], count: usize, horizon_s: f64) -> Settling<f64> {
    let squares: f64 = falls.iter().map(|fall| fall.predicted * fall.predicted).sum();
    let products: f64 = falls.iter().map(|fall| fall.read * fall.predicted).sum();
    let share = (products / squares.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    let usual = (squares / falls.len() as f64).sqrt().max(f64::MIN_POSITIVE);
    // Squared errors, and squares of the predicted falls in units of their usual size.
    let errors: Vec<(f64, f64)> = falls
        .iter()
        .map(|fall| ((fall.read - share * fall.predicted).powi(2), (fall.predicted / usual).powi(2)))
        .collect();
    let mean = |of: &dyn Fn(f64, f64) -> f64| order::mean(errors.iter().map(|(e, s)| of(*e, *s)));
    let constant = |ratio: f64| mean(&|error, predicted| error / (1.0 + ratio * ratio * predicted));
    let cost = |ratio: &f64| constant(*ratio).ln() + mean(&|_, predicted| (ratio * ratio * predicted).ln_1p());
    let (steps, least, most) = RATIOS;
    let grid = (0..=steps).map(|k| least * (most / least).powf(f64::from(k) / f64::from(steps)));
    let ratio = std::iter::once(0.0).chain(grid).min_by(|a, b| cost(a).total_cmp(&cost(b))).unwrap_or(0.0);
    let sd = constant(ratio).sqrt() * widened(count);
    Settling { horizon_s, share, share_sd: ratio * sd / usual, sd }
}

/// Returns the factor on an interval whose standard deviation was estimated from `count` holds.
fn widened(count: usize) -> f64 {
    let count = count as f64;
    let quantile = |t: StudentsT| t.inverse_cdf(0.975);
    let student = StudentsT::new(0.0, 1.0, count - 1.0).map_or(f64::INFINITY, quantile);
    (student / Z_95 * (1.0 + 1.0 / count).sqrt()).min(MOST_WIDENED)
}

#[cfg(test)]
mod tests {
    use super::{Fall, likeliest, widened};

    /// Tests a share of two thirds of the predicted fall, with errors of alternating sign: 10 % of the fall and 0.001, added in quadrature.
    #[test]
    fn share_and_deviations_are_found() {
        let fall = |k: u32| {
            let predicted = 0.4 * 0.7_f64.powi((k / 2) as i32);
            let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
            Fall { read: predicted * 2.0 / 3.0 + sign * (0.1 * predicted).hypot(1e-3), predicted }
        };
        let falls: Vec<Fall> = (0..60).map(fall).collect();
        let found = likeliest(&falls, 1000, 300.0);
        // A thousand holds widen by half a per mille; the grid of ratios has steps of a quarter.
        assert!((found.share - 2.0 / 3.0).abs() < 1e-12 && found.horizon_s == 300.0, "{found:?}");
        assert!((found.share_sd / 0.1 - 1.0).abs() < 0.15 && (found.sd / 1e-3 - 1.0).abs() < 0.15, "{found:?}");
    }

    #[test]
    fn branches_that_say_nothing_leave_the_readings_own_fall() {
        let falls: Vec<Fall> = [0.01, 0.03].map(|read| Fall { read, predicted: 0.0 }).into();
        let found = likeliest(&falls, 1_000_000, 60.0);
        assert_eq!((found.share, found.share_sd), (0.0, 0.0));
        // The quantile is accurate to 2e-5.
        assert!((found.sd / 5e-4_f64.sqrt() - 1.0).abs() < 1e-4, "{found:?}");
    }

    /// Quantiles of Student's t with 4 and 9 degrees of freedom, from tables.
    #[test]
    fn few_holds_widen() {
        for (count, quantile) in [(5_u32, 2.776), (10, 2.262)] {
            let expected = quantile / 1.96 * (1.0 + 1.0 / f64::from(count)).sqrt();
            assert!((widened(count as usize) - expected).abs() < 1e-3);
        }
        assert_eq!((widened(2), widened(1)), (3.0, 3.0));
    }
}
