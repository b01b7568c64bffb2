use crate::law::structure::LawFit;
use crate::order::{extent, mean};
use crate::samples::Samples;

/// Least drift from the first to the last quarter of a recording, as a fraction of the range of its readings.
const NOTICED: f64 = 0.02;

/// True if the law's residuals rise, or fall, from quarter to quarter of a recording; a longer run would drift farther.
pub(crate) fn drifts(recordings: &[Samples], fit: &LawFit) -> bool {
    recordings.iter().zip(&fit.residuals).zip(&fit.rest_readings).any(|((samples, residuals), rest)| {
        let (low, high) = extent(samples.reading.iter().copied().filter(|reading| reading.is_finite()));
        is_drift(&quarter_means(residuals), (high - low) / rest)
    })
}

fn is_drift(means: &[f64], range: f64) -> bool {
    let steps: Vec<f64> = means.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let one_way = steps.iter().all(|step| *step > 0.0) || steps.iter().all(|step| *step < 0.0);
    one_way && steps.iter().sum::<f64>().abs() > NOTICED * range
}

/// Returns the mean of the known residuals in each quarter.
fn quarter_means(residuals: &[f64]) -> Vec<f64> {
    let quarters = residuals.chunks(residuals.len().div_ceil(4).max(1));
    quarters.map(|quarter| mean(quarter.iter().copied().filter(|residual| residual.is_finite()))).collect()
}

#[cfg(test)]
mod tests {
    use super::{is_drift, quarter_means};

    /// A line of 0.04 over 400 rows beside an oscillation of whole periods: quarter means a hundredth apart, 0.03 in all.
    #[test]
    fn a_line_is_a_drift_and_an_oscillation_is_none() {
        let row = |k: i32, slope: f64| {
            slope * f64::from(k) / 400.0 + 0.1 * (f64::from(k) * core::f64::consts::TAU / 50.0).sin()
        };
        let of = |slope: f64| quarter_means(&(0..400).map(|k| row(k, slope)).collect::<Vec<f64>>());
        assert!(is_drift(&of(0.04), 1.0) && is_drift(&of(-0.04), 1.0));
        assert!(!is_drift(&of(0.04), 2.0) && !is_drift(&of(0.0), 1.0));
        assert!(!is_drift(&[0.0, 0.1, 0.05, 0.2], 1.0));
    }
}
