//! On a linear model of one phase there is one Kalman filter: the textbook's, adskalman's, and each of our estimators,
//! whatever it would do elsewhere.
//!
//! The covariances here have condition numbers of at most some thousand and entries of order one, so that a dozen
//! rounded products leave 1e-12 of a result; 1e-11 is asked for.

use adskalman::{KalmanFilterNoControl, StateAndCovariance};
use nalgebra::{Const, SMatrix, SVector};
use ohmstrain_ekf::{
    Belief, Channel, Dwell, Dynamics, Ekf, Evidence, Hypotheses, Imm, LinearStep, Mixture, Phased, Reading, SignSplit,
    Step, Ukf, Unscented, rts_smooth_vec,
};
use ohmstrain_model::{Observation, Phase, StrainRange, Symmetric, Transition};
use ohmstrain_tests::{Draws, Linear};

const TOLERANCE: f64 = 1e-11;
const ROWS: usize = 25;
const DT_S: f64 = 0.1;
const ANYWHERE: Evidence<f64> =
    Evidence { limits: StrainRange { lower: f64::NEG_INFINITY, upper: f64::INFINITY }, tempering: 1.0 };

/// A linear model around another state than zero.
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

impl<const N: usize, const L: usize> Phased<f64, N, L> for Around<N> {
    fn enter(&self, from: &Belief<f64, N, L>, _: Phase) -> Belief<f64, N, L> {
        *from
    }

    fn renewed(&self) -> std::ops::Range<usize> {
        0..0
    }
}

/// What a row must come to.
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

/// Kalman's equations as every textbook has them, P - K S Kᵀ included.
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

/// A model, where it starts, and its readings.
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

    /// `step` returns the mixture after a reading, and its log-likelihood where the filter keeps every hypothesis.
    fn check_mixture<const K: usize>(
        &self,
        who: &str,
        step: impl Fn(&Mixture<f64, N, L, K>, Option<Reading<f64>>) -> (Mixture<f64, N, L, K>, Option<f64>),
    ) {
        let mut mixture = Mixture::<f64, N, L, K>::single(self.start, Phase::Extend);
        for (reading, row) in self.readings.iter().zip(&self.rows) {
            let (posterior, log_likelihood) = step(&mixture, reading.map(Reading::from));
            mixture = posterior;
            row.check(who, &mixture.moments());
            if let Some(log_likelihood) = log_likelihood {
                row.check_log_likelihood(who, log_likelihood);
            }
        }
    }
}

fn check_filters_of_one_gaussian<const N: usize, const L: usize>(seed: u64) {
    let case = Case::<N, L>::new(seed, SVector::zeros());
    let steps = case.check_one_gaussian("ekf", &Ekf::new(case.model));
    case.check_one_gaussian("iterated", &Ekf::new(case.model).iterated(4));
    case.check_one_gaussian("ukf", &Ukf::new(Unscented::new(case.model)));
    case.check_one_gaussian("iterated ukf", &Ukf::new(Unscented::new(case.model)).iterated(3));
    check_adskalman(&case, &steps);
}

/// adskalman's filter and smoother through our bridge.
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
    for (ours, theirs) in rts_smooth_vec(steps).iter().zip(&smoothed) {
        let ours = Row { mean: ours.mean, covariance: ours.covariance.to_matrix(), log_likelihood: 0.0 };
        ours.check("adskalman's smoother", &belief_of::<N, L>(theirs));
    }
}

fn belief_of<const N: usize, const L: usize>(theirs: &StateAndCovariance<f64, Const<N>>) -> Belief<f64, N, L> {
    Belief { mean: *theirs.state(), covariance: Symmetric::from_lower(theirs.covariance()) }
}

/// Where the rate is a hundred deviations from zero there is nothing to cut, and the sign-split filter keeps one half.
/// With holds it also gives up the histories that release after a hold, and their part of the likelihood.
fn check_mixtures<const N: usize, const L: usize>(seed: u64) {
    let case = Case::<N, L>::new(seed, SVector::from_fn(|i, _| if i == 1 { 500.0 } else { 0.0 }));
    let dwell = Dwell::new(1.0, 2.0, 0.3).unwrap();
    let imm = Imm::new(case.model, dwell, ANYWHERE);
    case.check_mixture::<3>("imm", |mixture, reading| {
        let step = imm.step_prepared(mixture, &(), DT_S, reading).unwrap();
        (step.posterior, Some(step.log_likelihood))
    });
    let unscented = Imm::new(Unscented::new(case.model), dwell, ANYWHERE);
    case.check_mixture::<3>("unscented imm", |mixture, reading| {
        let step = unscented.step_prepared(mixture, &(), DT_S, reading).unwrap();
        (step.posterior, Some(step.log_likelihood))
    });
    let single = Hypotheses::new(case.model, dwell, ANYWHERE);
    case.check_mixture::<1>("one hypothesis", |mixture, reading| {
        (single.step_prepared(mixture, &(), DT_S, reading).unwrap().posterior, None)
    });
    let histories = Hypotheses::new(case.model, dwell, ANYWHERE);
    case.check_mixture::<8>("hypotheses", |mixture, reading| {
        let step = histories.step_prepared(mixture, &(), DT_S, reading).unwrap();
        (step.posterior, Some(step.log_likelihood))
    });
    for hold in [None, Some(dwell)] {
        let single = SignSplit::new(case.model, hold, ANYWHERE);
        case.check_mixture::<1>("one sign-split hypothesis", |mixture, reading| {
            let step = single.step_prepared(mixture, &(), DT_S, reading).unwrap();
            (step.posterior, hold.is_none().then_some(step.log_likelihood))
        });
        let split = SignSplit::new(case.model, hold, ANYWHERE);
        case.check_mixture::<8>("sign-split", |mixture, reading| {
            let step = split.step_prepared(mixture, &(), DT_S, reading).unwrap();
            (step.posterior, hold.is_none().then_some(step.log_likelihood))
        });
    }
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

/// A mixture holds strain and rate at least, so n starts at 2.
#[test]
fn filters_of_hypotheses_are_the_textbook_s() {
    check_mixtures::<2, 3>(2);
    check_mixtures::<3, 6>(3);
    check_mixtures::<4, 10>(4);
    check_mixtures::<5, 15>(5);
    check_mixtures::<6, 21>(6);
}
