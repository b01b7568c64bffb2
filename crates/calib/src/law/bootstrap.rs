use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::CalibrationError;
use crate::law::least_squares::{settle, without_ridge};
use crate::law::regression::LawRegression;
use crate::law::robust_loss::robust;
use crate::law::uncertainty::Linearised;
use crate::order::sorted;
use crate::samples::Samples;
use ohmstrain_sensor::LawParams;

/// Percentile intervals of a law's parameters from recordings whose blocks were resampled.
#[derive(Clone, Debug, PartialEq)]
pub struct Bootstrap {
    /// Names of the parameters.
    pub names: Vec<String>,
    /// Their values on the recordings as they are, by least squares without a ridge.
    pub values: Vec<f64>,
    /// 2.5 % points.
    pub lower: Vec<f64>,
    /// 97.5 % points.
    pub upper: Vec<f64>,
    /// Number of replicates used; the others were singular.
    pub replicates: usize,
}

/// Number of blocks of a recording. They must be longer than the correlation time of the residuals, and many enough to draw from.
const BOOTSTRAP_BLOCKS: usize = 40;

/// Draws the blocks of every recording with replacement, `replicates` times, and fits the structure of `law` to each draw by least squares
/// without a ridge, which would pull all draws to the same side. Each row keeps the sensor's memory of the true history before it; the draw
/// only selects the rows that count. The same `seed` gives the same intervals.
///
/// Source: Künsch, *Ann. Statist.* 17 (1989) 1217, with blocks that do not overlap (Carlstein 1986).
///
/// # Errors
/// If the law does not fit the recordings, or fewer than two replicates can be fitted.
pub fn bootstrap_law(
    recordings: &[Samples],
    law: &LawParams,
    replicates: usize,
    seed: u64,
) -> Result<Bootstrap, CalibrationError> {
    let mut regression = robust(LawRegression::new(recordings)?);
    let structure = without_ridge(law, &regression)?;
    let (names, values): (Vec<String>, Vec<f64>) =
        Linearised::new(&structure, &regression)?.named().into_iter().unzip();
    let whole: Vec<Vec<usize>> = regression.recordings.iter().map(|recording| recording.complete.clone()).collect();
    let mut rng = ChaCha12Rng::seed_from_u64(seed);
    let mut drawn: Vec<Vec<f64>> = Vec::with_capacity(replicates);
    for _ in 0..replicates {
        for (recording, rows) in regression.recordings.iter_mut().zip(&whole) {
            recording.complete = draw(rows, &mut rng);
        }
        let refitted = settle(structure.clone(), &regression)
            .and_then(|refitted| Ok(Linearised::new(&refitted, &regression)?.named()));
        drawn.extend(refitted.ok().map(|named| named.into_iter().map(|(_, value)| value).collect()));
    }
    if drawn.len() < 2 {
        return Err(CalibrationError::Singular);
    }
    let percentile = |share: f64| (0..names.len()).map(|j| quantile(drawn.iter().map(|row| row[j]), share)).collect();
    Ok(Bootstrap { lower: percentile(0.025), upper: percentile(0.975), replicates: drawn.len(), names, values })
}

/// Draws as many rows as there are, block by block.
fn draw(rows: &[usize], rng: &mut ChaCha12Rng) -> Vec<usize> {
    let mut out = Vec::with_capacity(rows.len() + rows.len() / BOOTSTRAP_BLOCKS);
    while out.len() < rows.len() {
        let block = (rng.next_u64() % BOOTSTRAP_BLOCKS as u64) as usize;
        out.extend(&rows[block * rows.len() / BOOTSTRAP_BLOCKS..(block + 1) * rows.len() / BOOTSTRAP_BLOCKS]);
    }
    out.truncate(rows.len());
    out
}

/// Returns a quantile, linear between order statistics.
fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let sorted = sorted(values);
    let at = share * (sorted.len() - 1) as f64;
    let (low, high) = (at.floor() as usize, at.ceil() as usize);
    sorted[low] + (sorted[high] - sorted[low]) * (at - at.floor())
}
