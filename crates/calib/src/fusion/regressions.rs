use ohmstrain_sensor::fusion::{FusionRow, Member, Regression, RegressionParams};
use rayon::prelude::*;

use super::readings::{Readings, ReadingsRow};
use super::{BLOCKS, KEPT_ROWS, REGRESSIONS};
use crate::CalibrationError;

/// Length scales tried, in standard deviations of the input.
const LENGTHS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Standard deviations of the noise tried, as fractions of the strain's range.
const NOISES: [f64; 3] = [0.01, 0.02, 0.04];
/// Number of rows of each block on which settings are judged.
const JUDGED_ROWS: usize = 200;

/// Fits the settings of each regression, and estimates every row without its block.
pub(super) fn fit(
    readings: &Readings,
    span: f64,
) -> Result<(Vec<RegressionParams>, Vec<Vec<Member>>), CalibrationError> {
    let mut chosen = Vec::new();
    for low_passes in REGRESSIONS {
        let settings = LENGTHS.iter().flat_map(|length| NOISES.iter().map(move |noise| (*length, *noise)));
        let settings: Vec<RegressionParams> = settings
            .map(|(length, noise)| RegressionParams { low_passes: low_passes.to_vec(), length, noise })
            .collect();
        let scores: Vec<f64> =
            settings.par_iter().map(|params| score(readings, params, span).unwrap_or(f64::INFINITY)).collect();
        let best = settings.into_iter().zip(scores).min_by(|a, b| a.1.total_cmp(&b.1));
        chosen.extend(best.map(|(params, _)| params));
    }
    let left_out: Option<Vec<Vec<Member>>> = chosen.par_iter().map(|params| left_out(readings, params, span)).collect();
    Ok((chosen, left_out.ok_or(CalibrationError::NoCommonRows)?))
}

/// Returns the mean negative log density of the strain in held-out blocks; `None` if the regression cannot be made.
fn score(readings: &Readings, params: &RegressionParams, span: f64) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0_usize);
    for block in 0..BLOCKS {
        let regression = without(readings, params, block, span)?;
        for row in readings.thinned(|row| row.block == block, JUDGED_ROWS) {
            let member = regression.strain((&row.seen).into());
            sum += 0.5 * ((member.strain - row.seen.strain) / member.sd).powi(2) + member.sd.ln();
            count += 1;
        }
    }
    Some(sum / count.max(1) as f64)
}

/// Estimates every row by a regression that was fitted without its block.
fn left_out(readings: &Readings, params: &RegressionParams, span: f64) -> Option<Vec<Member>> {
    let regressions: Option<Vec<Regression>> =
        (0..BLOCKS).map(|block| without(readings, params, block, span)).collect();
    let regressions = regressions?;
    let of_row = |row: &ReadingsRow| regressions[row.block].strain((&row.seen).into());
    Some(readings.rows.iter().map(of_row).collect())
}

fn without(readings: &Readings, params: &RegressionParams, block: usize, span: f64) -> Option<Regression> {
    let rows: Vec<&FusionRow> = readings.thinned(|row| row.block != block, KEPT_ROWS).map(|row| &row.seen).collect();
    let channels: Vec<usize> = (0..readings.channels).collect();
    Regression::new(&rows, params, &channels, span)
}
