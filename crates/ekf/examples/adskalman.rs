//! One sensor and a coarse strain gauge, two readings per step, filtered with adskalman's Kalman filter. This crate's
//! own filter takes the same readings one after the other. Both print the same numbers.
//!
//! ```sh
//! cargo run -p ohmstrain-ekf --example adskalman --features adskalman
//! ```

use std::error::Error;
use std::println;

use adskalman::{KalmanFilterNoControl, StateAndCovariance};
use nalgebra::SVector;
use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, LinearStep, Reading};
use ohmstrain_model::{
    Branch, Gauge, ModelNoise, Motion, Observation, Phase, SensorLaw, StrainRange, SwitchedModel, Symmetric, Transition,
};

const N: usize = 4;
const L: usize = 10;
type Sensor = SwitchedModel<f64, 1, N>;

/// A second reading of the same state: strain itself, to 0.02.
#[derive(Clone, Copy)]
struct CoarseStrain {
    sensor: Sensor,
}

impl Channel<f64, N, L> for CoarseStrain {
    fn observe(&self, at: &Belief<f64, N, L>, _: Option<Phase>) -> Observation<f64, N> {
        let gradient = SVector::from([1.0, 0.0, 0.0, 0.0]);
        Observation { value: at.mean[0], gradient, variance: 0.02 * 0.02 }
    }
}

/// An `Ekf` needs dynamics and channel in one model; these dynamics are the sensor's.
impl Dynamics<f64, N, L> for CoarseStrain {
    type Prepared = <Sensor as Dynamics<f64, N, L>>::Prepared;

    fn prepare(&self, dt_s: f64) -> Self::Prepared {
        self.sensor.prepare(dt_s)
    }

    fn transition(
        &self,
        step: &Self::Prepared,
        from: &Belief<f64, N, L>,
        phase: Option<Phase>,
    ) -> Transition<f64, N, L> {
        Dynamics::transition(&self.sensor, step, from, phase)
    }

    fn propagate(&self, covariance: &Symmetric<f64, N, L>, by: &Transition<f64, N, L>) -> Symmetric<f64, N, L> {
        self.sensor.propagate(covariance, by)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let sensor = sensor()?;
    let coarse = CoarseStrain { sensor };
    let (own, own_coarse) = (Ekf::new(sensor), Ekf::new(coarse));
    let prepared = sensor.prepare(0.05);

    let mut belief: Belief<f64, N, L> = Belief::initial(&sensor);
    let mut theirs: StateAndCovariance<f64, nalgebra::Const<N>> = belief.into();
    println!("{:>6} {:>10} {:>10} {:>10} {:>10} {:>8}", "t", "strain", "sd", "adskalman", "sd", "apart");
    for k in 0..=200 {
        let readings = readings(k);

        // adskalman: linearise at its own estimate, leave out missing readings, and take both at once.
        let step = LinearStep::linearise(&sensor, [&sensor, &coarse], &prepared, &(&theirs).into(), None);
        let (step, values) = step.take(&readings)?;
        let next = KalmanFilterNoControl::new(&step, &step).step(&theirs, &values);
        // Without its std feature, which also enables logging, adskalman's error does not implement `Error`.
        theirs = next.map_err(|error| format!("{error:?}"))?;

        // Ours: a step with the first reading, a step of zero seconds with the second.
        let first = own.step_prepared(&belief, &prepared, readings[0])?;
        belief = own_coarse.step(&first.posterior, 0.0, readings[1])?.posterior;

        if k % 20 == 0 {
            let (sd, their_sd) = (belief.covariance[(0, 0)].sqrt(), theirs.covariance()[(0, 0)].sqrt());
            let apart = (belief.mean - theirs.state()).amax();
            let (strain, their_strain) = (belief.mean[0], theirs.state()[0]);
            let t = 0.05 * f64::from(k);
            println!("{t:>6.2} {strain:>10.6} {sd:>10.6} {their_strain:>10.6} {their_sd:>10.6} {apart:>8.0e}");
        }
    }
    Ok(())
}

/// A slow stretch and release; each reading is sometimes missing.
fn readings(k: i32) -> [Option<Reading<f64>>; 2] {
    let strain = 0.12 - 0.1 * (0.02 * f64::from(k)).cos();
    let resistance = 1.9 * strain - 2.8 * strain * strain;
    // The coarse gauge has a resolution of 0.02.
    let coarse = (strain / 0.02).round() * 0.02;
    [(k % 7 != 3).then(|| resistance.into()), (k % 3 == 0).then(|| coarse.into())]
}

fn sensor() -> Result<Sensor, Box<dyn Error>> {
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [1.9, -2.8, 0.0] },
        extend_viscosity_s: 0.02,
        retract_viscosity_s: -0.01,
        branches: [Branch {
            tau_s: 20.0,
            extend_gain: 0.6,
            retract_gain: -0.4,
            extend_gain_slope: 0.0,
            retract_gain_slope: 0.0,
        }],
        range: StrainRange { lower: 0.0, upper: 0.33 },
    };
    let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1)?;
    let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 5e-3, baseline_sd: 0.02, baseline_time_s: 30.0 };
    Ok(SwitchedModel::new(law, motion, noise)?)
}
