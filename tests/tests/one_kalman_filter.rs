//! On a linear model with one phase, the textbook's Kalman filter, adskalman's and each of our estimators are the same
//! filter.
//!
//! The covariances here have condition numbers up to a few thousand and entries of order one, so that a dozen rounded
//! products leave a relative error of 1e-12; the tolerance is 1e-11.

use adskalman::{KalmanFilterNoControl, StateAndCovariance};
use nalgebra::{Const, SMatrix, SVector};
use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, LinearStep, Reading, Step};
use ohmstrain_model::{Observation, Phase, Symmetric, Transition};
use ohmstrain_tests::{Draws, Linear, rts_smooth};

const TOLERANCE: f64 = 1e-11;
const ROWS: usize = 25;
const DT_S: f64 = 0.1;

/// A linear model around a nonzero state.
#[derive(Clone, Copy)]
struct Around<const N: usize> {
    linear: Linear<f64, N>,
    centre: SVector<f64, N>,
}

impl<const N: usize, const L: usize> Dynamics<f64, N, L> for Around<N> {
    type Prepared = ();

    fn prepare(&self, _: f64) {}

    fn transition(&self, (): &(), from: &Belief<f64, N, L>, _: Option<Phase>) -> Transition<f64, N, L> {
        let Linear { transition, noise, .. } = self.linear;
        let mean = self.centre + transition * (from.mean - self.centre);
        Transition { mean, jacobian: transition, noise: Symmetric::from_lower(&noise) }
    }
}

impl<const N: usize, const L: usize> Channel<f64, N, L> for Around<N> {
    fn observe(&self, at: &Belief<f64, N, L>, _: Option<Phase>) -> Observation<f64, N> {
        let Linear { gradient, variance, .. } = self.linear;
        Observation { value: gradient.dot(&(at.mean - self.centre)), gradient, variance }
    }
}

/// Expected values of a row.
struct Row<const N: usize> {
    mean: SVector<f64, N>,
    covariance: SMatrix<f64, N, N>,
    log_likelihood: f64,
}

impl<const N: usize> Row<N> {
    fn check<const L: usize>(&self, who: &str, belief: &Belief<f64, N, L>) {
        let mean = (belief.mean - self.mean).amax();
        assert!(mean < TOLERANCE, "{who}, n = {N}: mean off by {mean:e}");
        let covariance = (belief.covariance.to_matrix() - self.covariance).amax();
        assert!(covariance < TOLERANCE, "{who}, n = {N}: covariance off by {covariance:e}");
    }

    fn check_log_likelihood(&self, who: &str, log_likelihood: f64) {
        let difference = (log_likelihood - self.log_likelihood).abs();
        assert!(difference < TOLERANCE * (1.0 + self.log_likelihood.abs()), "{who}, n = {N}: off by {difference:e}");
    }
}

/// Returns the rows of Kalman's textbook equations, with P - K S Kᵀ.
#[allow(non_snake_case, reason = "the letters of the textbook")]
fn textbook<const N: usize>(
    model: &Around<N>,
    start: (SVector<f64, N>, SMatrix<f64, N, N>),
    readings: &[Option<f64>],
) -> Vec<Row<N>> {
    let Linear { transition: F, noise: Q, gradient, variance: R } = model.linear;
    let H = gradient.transpose();
    let (mut x, mut P) = (start.0 - model.centre, start.1);
    let mut rows = Vec::new();
    for reading in readings {
        x = F * x;
        P = F * P * F.transpose() + Q;
        let mut log_likelihood = 0.0;
        if let Some(y) = reading {
            let S = (H * P * H.transpose())[0] + R;
            let K = P * H.transpose() / S;
            let innovation = y - (H * x)[0];
            x += K * innovation;
            P -= K * S * K.transpose();
            log_likelihood = -0.5 * (innovation * innovation / S + (std::f64::consts::TAU * S).ln());
        }
        rows.push(Row { mean: x + model.centre, covariance: P, log_likelihood });
    }
    rows
}

/// A model, its initial belief, and its readings.
struct Case<const N: usize, const L: usize> {
    model: Around<N>,
    start: Belief<f64, N, L>,
    readings: Vec<Option<f64>>,
    rows: Vec<Row<N>>,
}

impl<const N: usize, const L: usize> Case<N, L> {
    fn new(seed: u64, centre: SVector<f64, N>) -> Self {
        let mut draws = Draws::new(seed);
        let model = Around { linear: draws.linear_model(), centre };
        let (mean, covariance) = (centre + draws.vector(), draws.covariance());
        let readings = draws.readings(ROWS);
        let rows = textbook(&model, (mean, covariance), &readings);
        Self { model, start: Belief { mean, covariance: Symmetric::from_lower(&covariance) }, readings, rows }
    }

    fn check_one_gaussian<M: Dynamics<f64, N, L> + Channel<f64, N, L>>(
        &self,
        who: &str,
        filter: &Ekf<M>,
    ) -> Vec<Step<f64, N, L>> {
        let mut belief = self.start;
        let mut steps = Vec::new();
        for (reading, row) in self.readings.iter().zip(&self.rows) {
            let step = filter.step(&belief, DT_S, reading.map(Reading::from)).unwrap();
            belief = step.posterior;
            row.check(who, &belief);
            row.check_log_likelihood(who, step.update.map_or(0.0, |update| update.log_likelihood));
            steps.push(step);
        }
        steps
    }
}

fn check_filters_of_one_gaussian<const N: usize, const L: usize>(seed: u64) {
    let case = Case::<N, L>::new(seed, SVector::zeros());
    let steps = case.check_one_gaussian("ekf", &Ekf::new(case.model));
    check_adskalman(&case, &steps);
}

/// Checks adskalman's filter and smoother, used through our bridge.
fn check_adskalman<const N: usize, const L: usize>(case: &Case<N, L>, steps: &[Step<f64, N, L>]) {
    let origin = Belief { mean: SVector::zeros(), ..case.start };
    let transition: Transition<f64, N, L> = case.model.transition(&(), &origin, None);
    let observation = case.model.observe(&origin, None);
    let bridge = LinearStep::new(origin.mean, &transition, origin.mean, &[observation]);
    let filter = KalmanFilterNoControl::new(&bridge, &bridge);
    let start = StateAndCovariance::new(case.start.mean, case.start.covariance.to_matrix());
    let observations: Vec<_> = case.readings.iter().map(|y| SVector::from([y.unwrap_or(f64::NAN)])).collect();
    let filtered = filter.filter(&start, &observations).unwrap();
    let smoothed = filter.smooth_from_filtered(filtered.clone()).unwrap();
    for (row, theirs) in case.rows.iter().zip(&filtered) {
        row.check("adskalman", &belief_of::<N, L>(theirs));
    }
    for (ours, theirs) in rts_smooth(steps).iter().zip(&smoothed) {
        let ours = Row { mean: ours.mean, covariance: ours.covariance.to_matrix(), log_likelihood: 0.0 };
        ours.check("adskalman's smoother", &belief_of::<N, L>(theirs));
    }
}

fn belief_of<const N: usize, const L: usize>(theirs: &StateAndCovariance<f64, Const<N>>) -> Belief<f64, N, L> {
    Belief { mean: *theirs.state(), covariance: Symmetric::from_lower(theirs.covariance()) }
}

#[test]
fn filters_of_one_gaussian_are_the_textbook_s() {
    check_filters_of_one_gaussian::<1, 1>(1);
    check_filters_of_one_gaussian::<2, 3>(2);
    check_filters_of_one_gaussian::<3, 6>(3);
    check_filters_of_one_gaussian::<4, 10>(4);
    check_filters_of_one_gaussian::<5, 15>(5);
    check_filters_of_one_gaussian::<6, 21>(6);
}
