use nalgebra::DVector;

use crate::baselines::RIDGES;
use crate::blocks::BlockedNormal;
use crate::inverse::{InverseParams, LowPasses, RegressionParams, with_products};
use crate::law_fit::CrossFit;
use crate::law_regression::BLOCKS;
use crate::left_out::REFERENCE_SD;
use crate::samples::Samples;

/// The inverse fitted to everything, and without each block of the recordings.
pub(crate) struct InverseFit {
    /// Weights are for the caller to find.
    pub params: InverseParams,
    pub without_block: Vec<InverseParams>,
}

/// Fits the inverse to changes of resistance relative to the law's R₀; `None` where the rows do not suffice.
pub(crate) fn fit_inverse(recordings: &[Samples], fit: &CrossFit) -> Option<InverseFit> {
    let relative = |(samples, rest): (&Samples, &f64)| samples.reading.iter().map(|r| r / rest - 1.0).collect();
    let readings: Vec<Vec<f64>> = recordings.iter().zip(&fit.law.rest_readings).map(relative).collect();
    let known = readings.iter().flatten().copied().filter(|x| x.is_finite());
    let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    let (centre, half_range) = (0.5 * (low + high), 0.5 * (high - low));
    if !(half_range > 0.0) {
        return None;
    }
    let scaled: Vec<Vec<f64>> =
        readings.iter().map(|readings| readings.iter().map(|x| (x - centre) / half_range).collect()).collect();
    let filter = Regression::fit(recordings, &scaled, fit, false)?;
    let smoother = Regression::fit(recordings, &scaled, fit, true)?;
    let params = |filter: RegressionParams, smoother: RegressionParams| InverseParams {
        weight: 0.0,
        smoothed_weight: 0.0,
        centre,
        half_range,
        filter,
        smoother,
    };
    let without = |block: usize| params(filter.params(Some(block)), smoother.params(Some(block)));
    Some(InverseFit {
        params: params(filter.params(None), smoother.params(None)),
        without_block: (0..BLOCKS).map(without).collect(),
    })
}

impl RegressionParams {
    /// Mean negative log density of the strain on blocks left out, in spans: as of a filter that always has this deviation.
    pub(crate) fn score(&self, span: f64) -> f64 {
        let variance = (self.strain_sd / span).powi(2) + REFERENCE_SD * REFERENCE_SD;
        0.5 * ((self.strain_sd / span).powi(2) / variance + variance.ln())
    }
}

/// One regression: coefficients of all rows, and without each block.
struct Regression {
    strain_sd: f64,
    coefficients: DVector<f64>,
    without_block: Vec<DVector<f64>>,
}

impl Regression {
    /// With the ridge that leaves the least error on blocks left out.
    fn fit(recordings: &[Samples], scaled: &[Vec<f64>], fit: &CrossFit, two_sided: bool) -> Option<Self> {
        let (mut columns, mut strain, mut blocks) = (Vec::<Vec<f64>>::new(), Vec::new(), Vec::new());
        for ((samples, readings), rows) in recordings.iter().zip(scaled).zip(&fit.blocks) {
            let regressors = regressors(samples.time_s, readings, two_sided);
            for rows in rows {
                let start = strain.len();
                for k in rows.clone().filter(|&k| samples.strain[k].is_finite()) {
                    let Some(row) = &regressors[k] else { continue };
                    columns.resize_with(row.len(), Vec::new);
                    columns.iter_mut().zip(row).for_each(|(column, value)| column.push(*value));
                    strain.push(samples.strain[k]);
                }
                blocks.push(start..strain.len());
            }
        }
        let columns: Vec<DVector<f64>> = columns.into_iter().map(DVector::from_vec).collect();
        let normal = BlockedNormal::new(&columns, 1, &DVector::from_vec(strain), &blocks);
        let all: Vec<usize> = (0..columns.len()).collect();
        let of_block = |block: usize| (0..recordings.len()).map(|r| r * BLOCKS + block).collect::<Vec<usize>>();
        let scored = RIDGES.iter().filter_map(|&ridge| Some((normal.left_out_error(&all, ridge)?, ridge)));
        let (error, ridge) = scored.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Self {
            strain_sd: error.sqrt(),
            coefficients: normal.fit(&all, ridge, &[])?,
            without_block: (0..BLOCKS).map(|b| normal.fit(&all, ridge, &of_block(b))).collect::<Option<_>>()?,
        })
    }

    fn params(&self, without: Option<usize>) -> RegressionParams {
        let coefficients = without.map_or(&self.coefficients, |block| &self.without_block[block]);
        RegressionParams { strain_sd: self.strain_sd, coefficients: coefficients.iter().copied().collect() }
    }
}

/// The regressors of every row; `None` where the reading is missing.
pub(crate) fn regressors(time_s: &[f64], readings: &[f64], two_sided: bool) -> Vec<Option<Vec<f64>>> {
    let mut past = LowPasses::new();
    let mut linear: Vec<Option<Vec<f64>>> = time_s
        .iter()
        .zip(readings)
        .map(|(time_s, reading)| {
            let distances = reading.is_finite().then(|| past.distances(*time_s, *reading))?;
            Some([*reading].into_iter().chain(distances).collect())
        })
        .collect();
    if two_sided {
        let mut ahead = LowPasses::new();
        for ((linear, time_s), reading) in linear.iter_mut().zip(time_s).zip(readings).rev() {
            if let Some(linear) = linear {
                linear.extend(ahead.distances(-time_s, *reading));
            }
        }
    }
    linear.into_iter().map(|linear| linear.map(|linear| with_products(&linear))).collect()
}
