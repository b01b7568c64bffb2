//! The sensor's own law, linearised once, in adskalman's filter and smoother; the linearisation has offsets.

use adskalman::{KalmanFilterNoControl, StateAndCovariance};
use nalgebra::SVector;
use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, LinearStep, Reading};
use ohmstrain_model::{Observation, Phase, Transition};
use ohmstrain_tests::{Draws, rts_smooth, sensor};

type Linearised = (Transition<f64, 5, 15>, Observation<f64, 5>);

/// One linearised step of the sensor's own law.
fn linearised() -> (Belief<f64, 5, 15>, Linearised) {
    let model = sensor::<f64, 2, 5>();
    let start = Belief::<f64, 5, 15>::initial(&model);
    let prepared = Dynamics::<f64, 5, 15>::prepare(&model, 0.05);
    let transition = Dynamics::transition(&model, &prepared, &start, Some(Phase::Extend));
    let prior = Belief { mean: transition.mean, covariance: start.covariance };
    (start, (transition, Channel::observe(&model, &prior, Some(Phase::Extend))))
}

/// The linearised law as a linear model of this crate, around the same points.
struct Frozen {
    from: SVector<f64, 5>,
    step: Linearised,
}

impl Dynamics<f64, 5, 15> for Frozen {
    type Prepared = ();

    fn prepare(&self, _: f64) {}

    fn transition(&self, (): &(), at: &Belief<f64, 5, 15>, _: Option<Phase>) -> Transition<f64, 5, 15> {
        let (transition, _) = self.step;
        Transition { mean: transition.mean + transition.jacobian * (at.mean - self.from), ..transition }
    }
}

impl Channel<f64, 5, 15> for Frozen {
    fn observe(&self, at: &Belief<f64, 5, 15>, _: Option<Phase>) -> Observation<f64, 5> {
        let (transition, observation) = self.step;
        let value = observation.value + observation.gradient.dot(&(at.mean - transition.mean));
        Observation { value, ..observation }
    }
}

#[test]
fn filter_and_smoother_agree_with_adskalman() {
    let (start, step) = linearised();
    let bridge = LinearStep::new(start.mean, &step.0, step.0.mean, &[step.1]);
    let mut draws = Draws::new(9);
    let readings: Vec<Option<f64>> =
        (0..40).map(|k| (k % 5 != 3).then(|| step.1.value + 0.05 * draws.normal())).collect();
    let observations: Vec<SVector<f64, 1>> = readings.iter().map(|y| SVector::from([y.unwrap_or(f64::NAN)])).collect();
    let filter = KalmanFilterNoControl::new(&bridge, &bridge);
    let theirs =
        filter.filter(&StateAndCovariance::new(start.mean, start.covariance.to_matrix()), &observations).unwrap();
    let (ekf, mut belief) = (Ekf::new(Frozen { from: start.mean, step }), start);
    let mut steps = Vec::new();
    for reading in &readings {
        steps.push(ekf.step(&belief, 0.05, reading.map(Reading::from)).unwrap());
        belief = steps[steps.len() - 1].posterior;
    }
    for (ours, theirs) in steps.iter().zip(&theirs) {
        assert_same(&ours.posterior, theirs);
    }
    // adskalman's smoother supports only linear transitions without offset, so deviations from a path that follows the
    // offset are smoothed.
    let mut path = start.mean;
    let mut deviations = Vec::new();
    let mut paths = Vec::new();
    for theirs in &theirs {
        path = step.0.mean + step.0.jacobian * (path - start.mean);
        deviations.push(StateAndCovariance::new(theirs.state() - path, *theirs.covariance()));
        paths.push(path);
    }
    let smoothed = filter_without_offset(&step, &deviations);
    for ((ours, theirs), path) in rts_smooth(&steps).iter().zip(&smoothed).zip(&paths) {
        assert_same(ours, &StateAndCovariance::new(theirs.state() + path, *theirs.covariance()));
    }
}

/// adskalman's smoother on the homogeneous part of the step.
fn filter_without_offset(
    step: &Linearised,
    filtered: &[StateAndCovariance<f64, nalgebra::Const<5>>],
) -> Vec<StateAndCovariance<f64, nalgebra::Const<5>>> {
    let homogeneous = Transition { mean: SVector::zeros(), ..step.0 };
    let bridge = LinearStep::new(SVector::zeros(), &homogeneous, SVector::zeros(), &[step.1]);
    KalmanFilterNoControl::new(&bridge, &bridge).smooth_from_filtered(filtered.to_vec()).unwrap()
}

fn assert_same(ours: &Belief<f64, 5, 15>, theirs: &StateAndCovariance<f64, nalgebra::Const<5>>) {
    for i in 0..5 {
        assert!((ours.mean[i] - theirs.state()[i]).abs() < 1e-10);
        for j in 0..5 {
            assert!((ours.covariance[(i, j)] - theirs.covariance()[(i, j)]).abs() < 1e-10);
        }
    }
}
