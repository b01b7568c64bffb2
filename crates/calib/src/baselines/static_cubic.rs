use nalgebra::{DMatrix, DVector};

use super::reading_scale::ReadingScale;
use super::{Baseline, Held};
use crate::CalibrationError;
use crate::samples::Samples;
use ohmstrain_sensor::{RangeParams, StaticCubic};

/// Least squares over all rows with reading and strain.
///
/// # Errors
/// If the readings do not vary.
pub fn fit_static_cubic(recordings: &[Samples], range: RangeParams) -> Result<StaticCubic, CalibrationError> {
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
    Ok(StaticCubic { reading_centre, reading_scale, coefficients, range })
}

/// A static cubic, row by row.
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
