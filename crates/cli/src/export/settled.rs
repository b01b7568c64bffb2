//! Gains for a filter that does not carry a covariance: what [`FixedGain`] settles to, once for each phase.
//!
//! The sensor's model is not linear, so there is no one gain. It is linearised at the mean strain of the calibration, at
//! rest or moving one way at the calibration's rate, and a filter settles on each linearisation. The mean goes on
//! following the full law.

use nalgebra::SVector;
use ohmstrain_ekf::{Belief, Channel, Compact, Dynamics, FixedGain, FixedGainState, Reading, SparseEkf, Switch};
use ohmstrain_model::{Direction, Observation, Phase, SwitchedModel, SwitchedStep, Symmetric, Transition};
use serde::Serialize;

use super::ExportError;
use super::constants::FixedRate;
use super::literal::{Literal, literals};

/// In the order of the exported `ohmstrain_phase`.
const PHASES: [Phase; 3] = [Phase::Hold, Phase::Extend, Phase::Retract];

/// The filters that have settled, one for each of [`PHASES`].
pub struct Settled<const B: usize, const N: usize, const L: usize>([SettledPhase<B, N, L>; 3]);

/// A filter that has settled.
struct SettledPhase<const B: usize, const N: usize, const L: usize> {
    model: Linearised<B, N, L>,
    gain: SVector<f32, N>,
    prior_covariance: Symmetric<f32, N, L>,
    covariance: Symmetric<f32, N, L>,
}

/// What the exported filter needs of it.
#[derive(Debug, Serialize)]
pub struct SettledGain {
    gain: Vec<Literal>,
    drive: [Literal; 4],
    rate: [Literal; 4],
    strain_sd: Literal,
    rate_sd: Literal,
}

/// The sensor's model whose derivatives are those at one point; its means are `SparseEkf`'s.
#[derive(Clone, Copy, Debug)]
struct Linearised<const B: usize, const N: usize, const L: usize> {
    ekf: SparseEkf<f32, Compact, B, N>,
    step: SwitchedStep<f32, 2, B>,
    phase: Phase,
    point: Belief<f32, N, L>,
}

/// How far from their limit the covariances may be, relative; tried one after the other.
const TOLERANCES: [f32; 2] = [0.01, 0.1];
/// Readings after which a filter that has not settled never will: a day at 1 Hz.
const MOST_STEPS: usize = 100_000;

impl<const B: usize, const N: usize, const L: usize> Settled<B, N, L> {
    /// Lets a filter settle in each phase.
    ///
    /// # Errors
    /// If one does not.
    pub fn new(sensor: &FixedRate<B, N>) -> Result<Self, ExportError> {
        let settle = |phase| SettledPhase::new(&Linearised::new(sensor, phase)?, sensor.dt_s);
        let [hold, extend, retract] = PHASES.map(settle);
        Ok(Self([hold?, extend?, retract?]))
    }

    /// The mean before any reading.
    pub fn start(&self) -> SVector<f32, N> {
        Belief::<f32, N, L>::initial(self.0[0].model.model()).mean
    }

    /// One interval on, with the gain of the phase that the rate suggests: one within its own deviation has no direction.
    ///
    /// # Errors
    /// If the mean leaves `f32`.
    pub fn step(&self, mean: &SVector<f32, N>, reading: Option<f32>) -> Result<SVector<f32, N>, ExportError> {
        let clear = self.0[0].covariance[(1, 1)].sqrt();
        let phase = usize::from(mean[1] > clear) + 2 * usize::from(mean[1] < -clear);
        self.0[phase].step(mean, reading)
    }

    /// The numbers to export.
    pub fn gains(&self) -> Vec<SettledGain> {
        self.0.iter().map(SettledPhase::export).collect()
    }
}

impl<const B: usize, const N: usize, const L: usize> SettledPhase<B, N, L> {
    fn new(model: &Linearised<B, N, L>, dt_s: f32) -> Result<Self, ExportError> {
        let wrong = |error: &dyn std::error::Error| ExportError::Parameter(error.to_string());
        for tolerance in TOLERANCES {
            let filter = FixedGain::new::<N, L>(*model, dt_s, tolerance).map_err(|error| wrong(&error))?;
            let mut state = FixedGainState::from(model.point);
            for _ in 0..MOST_STEPS {
                // What the filter expects, so that its mean stays where the law takes it.
                let expected = model.observe(&model.predicted(state.belief()), None).value;
                let taken = filter.step(&state, dt_s, Some(Reading::from(expected))).map_err(|error| wrong(&error))?;
                state = taken.next;
                if let (true, Some(update)) = (state.is_frozen(), taken.step.update) {
                    let prior_covariance = taken.step.prior.covariance;
                    let covariance = state.belief().covariance;
                    return Ok(Self { model: *model, gain: update.gain, prior_covariance, covariance });
                }
            }
        }
        Err(ExportError::Parameter(format!("the gain does not settle within {MOST_STEPS} readings")))
    }

    /// What [`FixedGain`] does with a frozen gain, from any mean.
    fn step(&self, mean: &SVector<f32, N>, reading: Option<f32>) -> Result<SVector<f32, N>, ExportError> {
        let mut ahead = self.model.predicted(&Belief { mean: *mean, covariance: self.covariance });
        if let Some(reading) = reading {
            let prior = Belief { mean: ahead.mean, covariance: self.prior_covariance };
            let innovation = reading - self.model.observe(&prior, None).value;
            ahead.mean += self.gain * innovation;
        }
        if ahead.mean.iter().all(|x| x.is_finite()) {
            return Ok(ahead.mean);
        }
        Err(ExportError::Parameter("the filter with fixed gains diverges on the law's own readings".into()))
    }

    fn export(&self) -> SettledGain {
        let from = Belief { mean: self.model.point.mean, covariance: self.covariance };
        SettledGain {
            gain: literals(self.gain.iter()),
            drive: spread(self.model.predicted(&from).covariance[(1, 1)]),
            rate: spread(self.prior_covariance[(1, 1)]),
            strain_sd: Literal(self.covariance[(0, 0)].sqrt()),
            rate_sd: Literal(self.covariance[(1, 1)].sqrt()),
        }
    }
}

impl<const B: usize, const N: usize, const L: usize> Linearised<B, N, L> {
    fn new(sensor: &FixedRate<B, N>, phase: Phase) -> Result<Self, ExportError> {
        let model = sensor.model;
        let ekf = SparseEkf::new(model, sensor.dt_s).map_err(|error| ExportError::Parameter(error.to_string()))?;
        let mut point: Belief<f32, N, L> = Belief::initial(&model);
        point.mean[0] = model.law().range.clamp(point.mean[0]);
        let speed = model.motion().stationary_variance()[1].sqrt();
        point.mean[1] = match phase {
            Phase::Hold => 0.0,
            Phase::Extend => speed,
            Phase::Retract => -speed,
        };
        Ok(Self { ekf, step: model.prepare(sensor.dt_s), phase, point })
    }

    /// One interval on, as `SparseEkf` predicts it; what cannot be had is refused by the filter, like any mean that is not
    /// finite.
    fn predicted(&self, from: &Belief<f32, N, L>) -> Belief<f32, N, L> {
        let mut ahead = *from;
        if self.ekf.step(&mut ahead, None).is_err() {
            ahead.mean.fill(f32::NAN);
        }
        ahead
    }

    fn model(&self) -> &SwitchedModel<f32, 2, B, N> {
        self.ekf.model()
    }

    /// A body at rest is not known to be: its direction is as uncertain as its rate.
    fn direction(&self, rate_variance: f32) -> Direction<f32> {
        match self.phase {
            Phase::Hold => Direction::Uncertain { rate_sd: rate_variance.max(0.0).sqrt() },
            moving => Direction::Known(moving),
        }
    }
}

impl<const B: usize, const N: usize, const L: usize> Dynamics<f32, N, L> for Linearised<B, N, L> {
    type Prepared = ();

    fn prepare(&self, _dt_s: f32) {}

    fn transition(&self, (): &(), from: &Belief<f32, N, L>, _phase: Option<Phase>) -> Transition<f32, N, L> {
        let direction = self.direction(self.model().rate_variance(&self.step, &from.covariance));
        let at_point = self.model().transition(&self.step, &self.point.mean, direction);
        Transition { mean: self.predicted(from).mean, ..at_point }
    }
}

impl<const B: usize, const N: usize, const L: usize> Channel<f32, N, L> for Linearised<B, N, L> {
    fn observe(&self, at: &Belief<f32, N, L>, _phase: Option<Phase>) -> Observation<f32, N> {
        let (law, variance) = (self.model().law(), at.covariance[(1, 1)]);
        let (gauge, _) = law.gauge_value_and_slope(at.mean[0]);
        let (rate, extend, retract) = (at.mean[1], law.extend_viscosity_s, law.retract_viscosity_s);
        let clear = <Compact as Switch<f32>>::CLEAR as f32;
        let mut value = if rate * rate < clear * clear * variance {
            let split = Compact::blend(rate, Compact::width(variance));
            gauge + extend * split.extend + retract * split.retract
        } else {
            gauge + if rate > 0.0 { extend } else { retract } * rate
        };
        for i in 2..N {
            value += at.mean[i];
        }
        Observation { value, ..self.model().observe(&self.point.mean, self.direction(variance)) }
    }
}

/// A rate's variance, three deviations, their inverse and the square of that, as the splits of a step share them.
fn spread(variance: f32) -> [Literal; 4] {
    let square = 9.0 * variance;
    let per_square = 1.0 / square;
    let per_width = per_square.sqrt();
    [variance, square * per_width, per_width, per_square].map(Literal)
}

#[cfg(test)]
mod tests {
    use ohmstrain_model::{Branch, Gauge, ModelNoise, SensorLaw, StrainRange};

    use super::*;

    fn sensor() -> FixedRate<1, 4> {
        let branch = Branch {
            tau_s: 2.0,
            extend_gain: 0.6,
            retract_gain: 0.4,
            extend_gain_slope: -0.5,
            retract_gain_slope: 0.2,
        };
        let range = StrainRange { lower: 0.0, upper: 0.3 };
        let limits = StrainRange { lower: 0.0, upper: 0.3 };
        let law = SensorLaw {
            gauge: Gauge::Polynomial { coefficients: [1.9, -1.1, 0.3] },
            extend_viscosity_s: 0.02,
            retract_viscosity_s: -0.01,
            branches: [branch],
            range,
        };
        let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
        FixedRate::new(law, [1.0, 0.1, 0.15, 0.1], noise, 0.02, limits).unwrap()
    }

    /// The library's filter and this module's must give the same bits: what is exported is tested against this one.
    #[test]
    fn a_step_is_that_of_the_settled_fixed_gain_filter() {
        let sensor = sensor();
        for phase in PHASES {
            let model = Linearised::<1, 4, 10>::new(&sensor, phase).unwrap();
            let filter = FixedGain::new::<4, 10>(model, sensor.dt_s, TOLERANCES[0]).unwrap();
            let mut state = FixedGainState::from(model.point);
            while !state.is_frozen() {
                let reading = model.observe(&model.predicted(state.belief()), None).value;
                state = filter.step(&state, sensor.dt_s, Some(Reading::from(reading))).unwrap().next;
            }
            let settled = SettledPhase::new(&model, sensor.dt_s).unwrap();
            let mut mean = state.belief().mean;
            for k in 0..100_u8 {
                let reading = 0.2 + 0.002 * f32::from(k % 17);
                let step = filter.step(&state, sensor.dt_s, Some(Reading::from(reading))).unwrap();
                assert!(step.frozen);
                state = step.next;
                mean = settled.step(&mean, Some(reading)).unwrap();
                assert_eq!(mean, state.belief().mean, "{phase:?} {k}");
            }
        }
    }
}
