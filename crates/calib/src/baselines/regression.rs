use nalgebra::DVector;
use ohmstrain_model::StrainRange;

use super::reading_scale::ReadingScale;
use super::{Baseline, Held};
use crate::CalibrationError;
use crate::enough::check;
use crate::law::blocked_normal::BlockedNormal;
use crate::law::regression::VALIDATION_BLOCKS;
use crate::samples::Samples;

/// Features of the readings up to now, for a linear regression of strain.
pub trait Features: Clone {
    /// Returns the regressors at `time_s`, the constant 1 first. `reading` is not missing, and is scaled to be within ±1 on the rows of the
    /// fit. Times increase.
    fn next(&mut self, time_s: f64, reading: f64) -> Vec<f64>;
}

/// Strain as a weighted sum of features, fitted by least squares.
#[derive(Clone, Debug)]
pub struct Regression<F> {
    /// The features before the first reading.
    pub features: F,
    /// Weight of a squared coefficient, relative to the variance of its feature and the number of rows.
    pub ridge: f64,
    /// Root mean squared error on blocks left out, in the unit of strain.
    pub cross_validated_rmse: f64,
    scale: ReadingScale,
    weights: DVector<f64>,
    range: StrainRange<f64>,
}

/// Ridges tried, for regressions with more features than the data need. A larger one would by itself flatten a feature to less than half of
/// its effect, which would make the rival too weak, even if a few blocks of a short recording favour it.
pub(super) const BASELINE_RIDGES: [f64; 7] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

impl<F: Features> Regression<F> {
    /// Fits the candidate and ridge with the least error on held-out blocks. The first `free` features are not penalised.
    pub(super) fn fit(
        recordings: &[Samples],
        candidates: impl IntoIterator<Item = F>,
        free: usize,
        ridges: &[f64],
    ) -> Result<Self, CalibrationError> {
        let (lower, upper) = check(recordings)?;
        let scale = ReadingScale::of(recordings)?;
        let mut best: Option<Self> = None;
        for features in candidates {
            let (normal, columns) = normal_equations(recordings, &features, scale, free);
            for &ridge in ridges {
                let Some(error) = normal.left_out_error(&columns, ridge) else { continue };
                let cross_validated_rmse = error.sqrt();
                if best.as_ref().is_some_and(|best| best.cross_validated_rmse <= cross_validated_rmse) {
                    continue;
                }
                if let Some(weights) = normal.fit(&columns, ridge, &[]) {
                    let (features, range) = (features.clone(), StrainRange { lower, upper });
                    best = Some(Self { features, ridge, cross_validated_rmse, scale, weights, range });
                }
            }
        }
        best.ok_or(CalibrationError::Singular)
    }

    /// Returns the regression before the first reading of a recording.
    #[must_use]
    pub fn start(&self) -> impl Baseline + use<F> {
        let Self { features, scale, weights, range, .. } = self.clone();
        RunningRegression { features, scale, weights, held: Held::new(range) }
    }
}

/// Returns the normal equations over the rows with reading and strain, and the indices of the features.
fn normal_equations<F: Features>(
    recordings: &[Samples],
    features: &F,
    scale: ReadingScale,
    free: usize,
) -> (BlockedNormal, Vec<usize>) {
    let (mut columns, mut strain, mut blocks) = (Vec::new(), Vec::new(), Vec::new());
    for samples in recordings {
        let start = strain.len();
        let mut features = features.clone();
        for k in (0..samples.len()).filter(|&k| samples.reading[k].is_finite()) {
            let row = features.next(samples.time_s[k], scale.scaled(samples.reading[k]));
            if samples.strain[k].is_finite() {
                columns.resize_with(row.len(), Vec::new);
                columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
                strain.push(samples.strain[k]);
            }
        }
        let edge = |b: usize| start + b * (strain.len() - start) / VALIDATION_BLOCKS;
        blocks.extend((0..VALIDATION_BLOCKS).map(|b| edge(b)..edge(b + 1)));
    }
    let columns: Vec<DVector<f64>> = columns.into_iter().map(DVector::from_vec).collect();
    let normal = BlockedNormal::new(&columns, free, &DVector::from_vec(strain), &blocks);
    (normal, (0..columns.len()).collect())
}

struct RunningRegression<F> {
    features: F,
    scale: ReadingScale,
    weights: DVector<f64>,
    held: Held,
}

impl<F: Features> Baseline for RunningRegression<F> {
    fn strain(&mut self, time_s: f64, reading: f64) -> f64 {
        let strain = reading.is_finite().then(|| {
            let row = self.features.next(time_s, self.scale.scaled(reading));
            row.iter().zip(self.weights.iter()).map(|(value, weight)| value * weight).sum()
        });
        self.held.next(strain)
    }
}
