//! An inverse without a model of the sensor as a member of the ensemble: what the filters may all be wrong about, because
//! they share a law, it is wrong about in another way.

use ohmstrain_ekf::{Gaussian, Reading};
use serde::{Deserialize, Serialize};

use crate::CalibrationError;
use crate::filter::Rows;
use crate::low_pass::LowPass;
use crate::own_rest::OwnRest;
use crate::params::RangeParams;
use crate::way_back::SEGMENT;

/// Time constants of the low-passes, s, a factor of four apart.
pub(crate) const TIME_CONSTANTS_S: [f64; 4] = [0.5, 2.0, 8.0, 32.0];

/// Ridge regressions of strain on the reading, its distances from low-passes of it, and all products of two of them: one
/// on low-passes of the past, and one, for the smoother, on low-passes of past and future.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InverseParams {
    /// How much the inverse is listened to beside the members, whose weights sum to one.
    pub weight: f64,
    /// The same where past and future are known.
    pub smoothed_weight: f64,
    /// Change of resistance `R/R₀ - 1` that counts as zero.
    pub centre: f64,
    /// Distance from there that counts as one.
    pub half_range: f64,
    /// From the past.
    pub filter: RegressionParams,
    /// From past and future.
    pub smoother: RegressionParams,
}

/// A linear regression on products.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegressionParams {
    /// Root mean squared error of strain on blocks left out.
    pub strain_sd: f64,
    /// Weights of 1, of the reading and its distances from the low-passes, and of their products, row by row of the upper
    /// triangle.
    pub coefficients: Vec<f64>,
}

impl RegressionParams {
    /// Strain, within a range.
    fn strain(&self, regressors: &[f64], range: RangeParams) -> Gaussian<f64> {
        let mean: f64 = self.coefficients.iter().zip(regressors).map(|(weight, value)| weight * value).sum();
        Gaussian { mean: mean.clamp(range.lower, range.upper), variance: self.strain_sd * self.strain_sd }
    }
}

/// Low-passes that run over the readings in one direction of time.
#[derive(Clone, Copy, Debug)]
pub struct LowPasses([LowPass; TIME_CONSTANTS_S.len()]);

impl LowPasses {
    pub(crate) fn new() -> Self {
        Self(TIME_CONSTANTS_S.map(LowPass::new))
    }

    /// How far the reading is from each of them. Times increase from call to call.
    pub(crate) fn distances(&mut self, time_s: f64, reading: f64) -> [f64; TIME_CONSTANTS_S.len()] {
        self.0.each_mut().map(|low_pass| reading - low_pass.next(time_s, reading))
    }
}

/// The constant, the linear regressors and the products of any two of them.
pub(crate) fn with_products(linear: &[f64]) -> Vec<f64> {
    let mut regressors = vec![1.0];
    regressors.extend(linear);
    for (i, a) in linear.iter().enumerate() {
        regressors.extend(linear[i..].iter().map(|b| a * b));
    }
    regressors
}

/// The inverse at work.
pub(crate) struct Inverse {
    pub params: InverseParams,
    range: RangeParams,
    own_rest: OwnRest,
    low_passes: LowPasses,
    /// What the last reading says; `None` if it was missing.
    pub now: Option<Gaussian<f64>>,
}

impl Inverse {
    pub(crate) fn new(params: InverseParams, range: RangeParams, own_rest: OwnRest) -> Result<Self, CalibrationError> {
        let products = |linear: usize| 1 + linear + linear * (linear + 1) / 2;
        let low_passes = TIME_CONSTANTS_S.len();
        for (name, regression, linear) in
            [("filter", &params.filter, 1 + low_passes), ("smoother", &params.smoother, 1 + 2 * low_passes)]
        {
            let (found, expected) = (regression.coefficients.len(), products(linear));
            if found != expected {
                let message = format!("`ensemble.inverse.{name}` of {found} coefficients; {expected} are expected");
                return Err(CalibrationError::Unsupported(message));
            }
        }
        Ok(Self { params, range, own_rest, low_passes: LowPasses::new(), now: None })
    }

    fn scaled(&self, reading: Reading<f64>) -> f64 {
        (self.own_rest.reading(reading).value - self.params.centre) / self.params.half_range
    }

    /// Takes the reading of a row.
    pub(crate) fn step(&mut self, time_s: f64, reading: Option<Reading<f64>>) {
        self.now = reading.map(|reading| {
            let reading = self.scaled(reading);
            let [a, b, c, d] = self.low_passes.distances(time_s, reading);
            self.params.filter.strain(&with_products(&[reading, a, b, c, d]), self.range)
        });
    }

    /// Runs over a recording and stands at its end; goes back through it from there.
    pub(crate) fn way_back<'a>(&'a mut self, rows: Rows<'a>) -> InverseWayBack<'a> {
        let mut starts = Vec::with_capacity(rows.len() / SEGMENT + 1);
        for row in 0..rows.len() {
            if row % SEGMENT == 0 {
                starts.push(self.low_passes);
            }
            let (time_s, reading) = rows.get(row);
            self.step(time_s, reading);
        }
        InverseWayBack { inverse: self, rows, starts, ahead: LowPasses::new() }
    }
}

/// The inverse on its way back, segment by segment.
pub(crate) struct InverseWayBack<'a> {
    inverse: &'a Inverse,
    rows: Rows<'a>,
    /// The low-passes of the past before each segment that is still to come.
    starts: Vec<LowPasses>,
    /// Those of the future.
    ahead: LowPasses,
}

impl InverseWayBack<'_> {
    /// How much it is listened to on the way back.
    pub(crate) fn smoothed_weight(&self) -> f64 {
        self.inverse.params.smoothed_weight
    }

    /// What it says of the rows of the last segment left, in order of time.
    pub(crate) fn next_segment(&mut self, out: &mut Vec<Option<Gaussian<f64>>>) {
        out.clear();
        let Some(mut past) = self.starts.pop() else { return };
        let first = self.starts.len() * SEGMENT;
        let rows = first..self.rows.len().min(first + SEGMENT);
        let known = |row: usize| {
            let (time_s, reading) = self.rows.get(row);
            reading.map(|reading| (time_s, self.inverse.scaled(reading)))
        };
        let behind: Vec<_> =
            rows.clone().map(|row| known(row).map(|(time_s, reading)| past.distances(time_s, reading))).collect();
        for row in rows.rev() {
            out.push(known(row).zip(behind[row - first]).map(|((time_s, reading), [a, b, c, d])| {
                let [e, f, g, h] = self.ahead.distances(-time_s, reading);
                let regressors = with_products(&[reading, a, b, c, d, e, f, g, h]);
                self.inverse.params.smoother.strain(&regressors, self.inverse.range)
            }));
        }
        out.reverse();
    }
}

#[cfg(test)]
mod tests {
    use ohmstrain_ekf::Reading;

    use super::{Inverse, InverseParams, RegressionParams};
    use crate::filter::Rows;
    use crate::inverse_fit::regressors;
    use crate::own_rest::OwnRest;
    use crate::params::RangeParams;
    use crate::way_back::SEGMENT;

    const RANGE: RangeParams = RangeParams { lower: -1.0, upper: 1.0 };

    /// Coefficients that no two regressors have in common, small enough to stay within the range.
    fn params() -> InverseParams {
        let regression = |count: usize| RegressionParams {
            strain_sd: 0.1,
            coefficients: (0..count).map(|i| 0.05 / (i + 1) as f64).collect(),
        };
        let (filter, smoother) = (regression(21), regression(55));
        InverseParams { weight: 0.1, smoothed_weight: 0.2, centre: 0.3, half_range: 0.5, filter, smoother }
    }

    /// Two whole segments and a short one, a reading missing now and then; the readings relative to an R₀ that is not the
    /// inverse's.
    #[test]
    fn segments_say_what_the_whole_recording_says() {
        let rows = 2 * SEGMENT + 500;
        let time_s: Vec<f64> = (0..rows).map(|k| 0.05 * k as f64).collect();
        let scaled: Vec<f64> = (0..rows).map(|k| if k % 7 == 3 { f64::NAN } else { (0.02 * k as f64).sin() }).collect();
        let params = params();
        let reading = |k: usize| {
            let own = params.centre + params.half_range * scaled[k];
            scaled[k].is_finite().then(|| Reading::from(1.25 * (1.0 + own) - 1.0))
        };
        let row = |k: usize| (time_s[k], reading(k));
        let mut inverse = Inverse::new(params.clone(), RANGE, OwnRest::new(1.25)).unwrap();

        let expected = |two_sided: bool, regression: &RegressionParams| -> Vec<Option<f64>> {
            let strain = |regressors: Vec<f64>| -> f64 {
                regressors.iter().zip(&regression.coefficients).map(|(value, weight)| value * weight).sum()
            };
            regressors(&time_s, &scaled, two_sided).into_iter().map(|row| row.map(strain)).collect()
        };
        // Some tens of products of numbers below one.
        let same = |said: Option<f64>, expected: Option<f64>| match (said, expected) {
            (Some(said), Some(expected)) => (said - expected).abs() < 1e-13,
            (said, expected) => said == expected,
        };
        for (k, expected) in expected(false, &params.filter).into_iter().enumerate().take(300) {
            inverse.step(time_s[k], reading(k));
            assert!(same(inverse.now.map(|strain| strain.mean), expected), "{k}");
        }

        let mut inverse = Inverse::new(params.clone(), RANGE, OwnRest::new(1.25)).unwrap();
        let expected = expected(true, &params.smoother);
        let mut back = inverse.way_back(Rows::new(rows, &row));
        let (mut segment, mut end) = (Vec::new(), rows);
        while end > 0 {
            back.next_segment(&mut segment);
            assert!(!segment.is_empty() && segment.len() <= SEGMENT);
            let first = end - segment.len();
            for (k, said) in (first..end).zip(&segment) {
                assert!(same(said.map(|strain| strain.mean), expected[k]), "{k}");
            }
            end = first;
        }
        back.next_segment(&mut segment);
        assert!(segment.is_empty());
    }

    #[test]
    fn a_number_of_coefficients_that_fits_nothing_is_refused() {
        let mut params = params();
        params.smoother.coefficients.pop();
        let error = Inverse::new(params, RANGE, OwnRest::SHARED).err().map(|error| error.to_string());
        assert!(error.is_some_and(|error| error.contains("`ensemble.inverse.smoother` of 54 coefficients; 55")));
    }
}
