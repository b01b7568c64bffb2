use ohmstrain_sensor::fusion::{FusionRow, Member, Regression, RegressionParams};
use rayon::prelude::*;

use super::readings::{Readings, ReadingsRow};
use super::{BLOCKS, KEPT_ROWS, REGRESSIONS};
use crate::CalibrationError;

/// Length scales that are tried, in standard deviations of the input.
const LENGTHS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Standard deviations of the noise that are tried, as shares of the range of the strain.
const NOISES: [f64; 3] = [0.01, 0.02, 0.04];
/// Rows of each block that settings are judged on.
const JUDGED_ROWS: usize = 200;

/// Settings of each regression, and its estimates of every row without the block of that row.
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

/// Mean negative log density of the strain in blocks left out; `None` if the regression cannot be made.
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

/// Estimates of every row by a regression that has not seen its block.
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
