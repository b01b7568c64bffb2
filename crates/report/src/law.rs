//! Predictions of the sensor's law for a recording.

use std::collections::BTreeMap;

use ohmstrain::Estimate;
use ohmstrain_model::{Branch, SensorLaw};
use ohmstrain_sensor::{EstimatorParams, SensorParams};

/// A sensor's law, with its branches in a slice.
pub struct Law<'a> {
    /// Gauge curve, dash-pots and range.
    quasi_static: SensorLaw<f64, 0>,
    branches: &'a [Branch<f64>],
    estimator: Option<&'a EstimatorParams>,
    rest_reading: f64,
}

/// Response of the law to a known strain.
pub struct Driven {
    /// Readings, row by row; NaN where the strain is missing.
    pub reading: Vec<f64>,
    /// State of the law's branches at the requested rows.
    pub memories: BTreeMap<usize, Vec<f64>>,
}

impl<'a> Law<'a> {
    /// Creates the law of a sensor whose reading at rest is `rest_reading`.
    pub fn new(params: &'a SensorParams, rest_reading: f64) -> Self {
        let law = &params.law;
        let quasi_static = SensorLaw {
            gauge: law.gauge,
            extend_viscosity_s: law.extend_viscosity_s,
            retract_viscosity_s: law.retract_viscosity_s,
            branches: [],
            range: law.range,
        };
        let estimator = params.estimator(params.filter_of(params.default_estimator)).ok();
        Self { quasi_static, branches: &law.branches, estimator, rest_reading }
    }

    /// Returns g(ε).
    pub fn gauge(&self, strain: f64) -> f64 {
        self.quasi_static.gauge_value_and_slope(strain).0
    }

    /// Returns dg/dε, the local gauge factor.
    pub fn gauge_slope(&self, strain: f64) -> f64 {
        self.quasi_static.gauge_value_and_slope(strain).1
    }

    /// Returns the strain beyond which a reading belongs to two strains.
    pub fn static_border(&self) -> Option<f64> {
        self.quasi_static.static_border()
    }

    /// Returns the reading that the law predicts for an estimate.
    pub fn fitted(&self, row: &Estimate) -> f64 {
        let (rising, falling) = split(row.strain_rate, row.strain_rate_sd);
        let dash_pot = self.quasi_static.extend_viscosity_s * rising + self.quasi_static.retract_viscosity_s * falling;
        self.reading(self.gauge(row.strain) + dash_pot + row.relaxation + row.baseline)
    }

    /// Returns the standard deviation of a reading around the law driven by the true strain: branches, baseline and white
    /// noise.
    pub fn model_error(&self) -> f64 {
        self.estimator.map_or(f64::NAN, |estimator| {
            let noise = &estimator.noise;
            let branches = self.branches.len() as f64 * noise.branch_sd.powi(2);
            self.rest_reading.abs() * (branches + noise.baseline_sd.powi(2) + noise.reading_sd.powi(2)).sqrt()
        })
    }

    /// Returns the standard deviation of a reading's white noise.
    pub fn reading_noise(&self) -> f64 {
        self.estimator.map_or(f64::NAN, |estimator| self.rest_reading.abs() * estimator.noise.reading_sd)
    }

    /// Drives the law from rest by a known strain; it is exact if the strain is linear from row to row. Rows without strain are
    /// skipped. The branches are returned at the rows `remember`.
    pub fn driven(&self, time_s: &[f64], strain: &[f64], remember: &[usize]) -> Driven {
        let known: Vec<(usize, f64, f64)> = time_s
            .iter()
            .zip(strain)
            .enumerate()
            .filter(|(_, (time, strain))| time.is_finite() && strain.is_finite())
            .map(|(row, (time, strain))| (row, *time, *strain))
            .collect();
        let mut driven = Driven { reading: vec![f64::NAN; time_s.len()], memories: BTreeMap::new() };
        let mut memory = vec![0.0; self.branches.len()];
        for (place, &(row, time, strain)) in known.iter().enumerate() {
            let before =
                place.checked_sub(1).and_then(|place| known.get(place)).copied().unwrap_or((row, time, strain));
            let after = known.get(place + 1).copied().unwrap_or((row, time, strain));
            self.drive(&mut memory, time - before.1, before.2, strain);
            let rate = if after.1 > before.1 { (after.2 - before.2) / (after.1 - before.1) } else { 0.0 };
            let dash_pot =
                if rate > 0.0 { self.quasi_static.extend_viscosity_s } else { self.quasi_static.retract_viscosity_s };
            let change = self.gauge(strain) + dash_pot * rate + self.remembered(&memory, 0.0);
            if let Some(reading) = driven.reading.get_mut(row) {
                *reading = self.reading(change);
            }
            if remember.contains(&row) {
                driven.memories.insert(row, memory.clone());
            }
        }
        driven
    }

    /// Propagates the branches over `dt_s` seconds in which the strain goes linearly from `from` to `to`.
    fn drive(&self, state: &mut [f64], dt_s: f64, from: f64, to: f64) {
        if !(dt_s > 0.0) {
            return;
        }
        let middle = self.quasi_static.range.clamp(0.5 * (from + to));
        for (c, branch) in state.iter_mut().zip(self.branches) {
            let x = dt_s / branch.tau_s;
            let gain = if to > from {
                branch.extend_gain + branch.extend_gain_slope * middle
            } else {
                branch.retract_gain + branch.retract_gain_slope * middle
            };
            *c = *c * (-x).exp() + gain * (to - from) * (-(-x).exp_m1() / x);
        }
    }

    /// Returns the reading `elapsed_s` seconds into a hold at `strain` that began with these branches.
    pub fn held(&self, strain: f64, memory: &[f64], elapsed_s: f64) -> f64 {
        self.reading(self.gauge(strain) + self.remembered(memory, elapsed_s))
    }

    /// Returns the contribution of the branches to the reading after `elapsed_s` seconds of rest.
    fn remembered(&self, memory: &[f64], elapsed_s: f64) -> f64 {
        let factors = self.branches.iter().map(|branch| (-elapsed_s / branch.tau_s).exp());
        factors.zip(memory).map(|(factor, value)| factor * value).sum()
    }

    fn reading(&self, relative_change: f64) -> f64 {
        self.rest_reading * (1.0 + relative_change)
    }
}

/// Returns the expected positive and negative part of a rate with standard deviation `sd`, with the logistic density that the
/// filter uses.
fn split(rate: f64, sd: f64) -> (f64, f64) {
    let scale = sd / 1.702;
    let spread = if scale > 0.0 { scale * (-rate.abs() / scale).exp().ln_1p() } else { 0.0 };
    (rate.max(0.0) + spread, rate.min(0.0) - spread)
}
