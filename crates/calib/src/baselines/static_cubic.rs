use nalgebra::{DMatrix, DVector};
use ohmstrain_model::StrainRange;

use super::reading_scale::ReadingScale;
use super::{Baseline, Held};
use crate::CalibrationError;
use crate::samples::Samples;
use ohmstrain_sensor::StaticCubic;

/// Fits by least squares over all rows with reading and strain. `error_sd` is the standard deviation of the residuals, with four degrees of
/// freedom subtracted.
///
/// # Errors
/// If the readings do not vary.
pub fn fit_static_cubic(recordings: &[Samples], range: StrainRange<f64>) -> Result<StaticCubic, CalibrationError> {
    let rows: Vec<(f64, f64)> = recordings
        .iter()
        .flat_map(|samples| samples.complete_rows().map(|k| (samples.reading[k], samples.strain[k])))
        .collect();
    let ReadingScale { centre: reading_centre, half_range: reading_scale } = ReadingScale::of(recordings)?;
    let design =
        DMatrix::from_fn(rows.len(), 4, |k, power| ((rows[k].0 - reading_centre) / reading_scale).powi(power as i32));
    let strain = DVector::from_iterator(rows.len(), rows.iter().map(|(_, strain)| *strain));
    let solution = design.svd(true, true).solve(&strain, 1e-12).map_err(|_| CalibrationError::Singular)?;
    let coefficients = [solution[0], solution[1], solution[2], solution[3]];
    let cubic = StaticCubic { reading_centre, reading_scale, coefficients, range, error_sd: None };
    let squares: f64 = rows.iter().map(|(reading, strain)| (cubic.strain(*reading) - strain).powi(2)).sum();
    let freedom = rows.len().saturating_sub(coefficients.len()).max(1);
    Ok(StaticCubic { error_sd: Some((squares / freedom as f64).sqrt()), ..cubic })
}

/// Returns the static cubic as a baseline that runs row by row.
#[must_use]
pub fn running_cubic(cubic: StaticCubic) -> impl Baseline + use<> {
    RunningCubic { cubic, held: Held::new(cubic.range) }
}

struct RunningCubic {
    cubic: StaticCubic,
    held: Held,
}

impl Baseline for RunningCubic {
    fn strain(&mut self, _: f64, reading: f64) -> f64 {
        self.held.next(reading.is_finite().then(|| self.cubic.strain(reading)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_static_cubic_is_a_cubic() {
        let reading: Vec<f64> = (0..50).map(|k| 1000.0 + 20.0 * f64::from(k)).collect();
        let strain: Vec<f64> = reading.iter().map(|r| 1e-4 * (r - 1000.0) + 2e-10 * (r - 1000.0_f64).powi(3)).collect();
        let time_s: Vec<f64> = (0..50).map(f64::from).collect();
        let samples = Samples::new(&time_s, &reading, &strain).unwrap();
        let cubic = fit_static_cubic(&[samples], StrainRange { lower: 0.0, upper: 0.2 }).unwrap();
        for (r, s) in reading.iter().zip(&strain) {
            assert!((cubic.strain(*r) - s.min(0.2)).abs() < 1e-12);
        }
        assert_eq!(cubic.strain(1e6), 0.2);
    }
}
