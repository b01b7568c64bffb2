//! Consistency of the filter's uncertainty. On a linear sensor with a known phase, simulated from its own model, NIS and
//! NEES are exactly χ², and so are their sums over independent terms; the bounds are 99.9 % quantiles of those sums.
//! With a wrong Q or R in the filter, the same statistics must leave the bounds: a test that cannot fail would prove
//! nothing.

use nalgebra::{Cholesky, SVector};
use ohmstrain_ekf::{Belief, Channel, Dynamics, Ekf, Reading};
use ohmstrain_model::{Observation, Phase, SwitchedModel, Symmetric, Transition};
use ohmstrain_tests::{Draws, KnownPhase, rts_smooth, square_root, switching_sensor};
use statrs::distribution::{ChiSquared, ContinuousCDF};

const RUNS: u64 = 400;
const ROWS: usize = 60;
const DT_S: f64 = 0.2;

/// A sensor known to stretch, with the noise that the filter assumes.
#[derive(Clone, Copy)]
struct AssumedNoise {
    sensor: KnownPhase<SwitchedModel<f64, 1, 3>>,
    /// Factor on the filter's Q.
    process: f64,
    /// Factor on the filter's R.
    reading: f64,
}

impl Dynamics<f64, 3, 6> for AssumedNoise {
    type Prepared = <SwitchedModel<f64, 1, 3> as Dynamics<f64, 3, 6>>::Prepared;

    fn prepare(&self, dt_s: f64) -> Self::Prepared {
        Dynamics::<f64, 3, 6>::prepare(&self.sensor, dt_s)
    }

    fn transition(
        &self,
        step: &Self::Prepared,
        from: &Belief<f64, 3, 6>,
        phase: Option<Phase>,
    ) -> Transition<f64, 3, 6> {
        let right = self.sensor.transition(step, from, phase);
        Transition { noise: right.noise.scaled(self.process), ..right }
    }
}

impl Channel<f64, 3, 6> for AssumedNoise {
    fn observe(&self, at: &Belief<f64, 3, 6>, phase: Option<Phase>) -> Observation<f64, 3> {
        let right = self.sensor.observe(at, phase);
        Observation { variance: right.variance * self.reading, ..right }
    }
}

fn with_noise(process: f64, reading: f64) -> AssumedNoise {
    AssumedNoise { sensor: KnownPhase { model: switching_sensor(), phase: Phase::Extend }, process, reading }
}

/// Sums of independent χ² terms.
#[derive(Debug, Default)]
struct Statistics {
    /// Over all rows of all runs: innovations of different rows are independent.
    nis: f64,
    /// The last row of each run.
    filtered: f64,
    /// The middle row of each run.
    smoothed: f64,
}

/// Returns the squared distance of truth and belief in units of the belief's covariance.
fn nees(truth: &SVector<f64, 3>, belief: &Belief<f64, 3, 6>) -> f64 {
    let error = truth - belief.mean;
    error.dot(&Cholesky::new(belief.covariance.to_matrix()).unwrap().solve(&error))
}

/// Returns the statistics of a filter with the factors `assumed` on data from the unchanged sensor.
fn statistics(assumed: AssumedNoise) -> Statistics {
    let truth = with_noise(1.0, 1.0);
    let spread = [1e-3, 1e-3, 1e-3];
    let start: Belief<f64, 3, 6> = Belief::independent(SVector::from([0.1, 0.1, 0.0]), &spread);
    let prepared = truth.prepare(DT_S);
    let move_on = |state: &SVector<f64, 3>| {
        truth.transition(&prepared, &Belief { mean: *state, covariance: Symmetric::zeros() }, None)
    };
    let root = square_root(&move_on(&start.mean).noise);
    let ekf = Ekf::new(assumed);
    let mut sums = Statistics::default();
    for seed in 0..RUNS {
        let mut draws = Draws::new(seed);
        let mut state = start.mean + SVector::from(spread.map(f64::sqrt)).component_mul(&draws.vector());
        let (mut belief, mut states, mut steps) = (start, Vec::new(), Vec::new());
        for _ in 0..ROWS {
            state = move_on(&state).mean + root * draws.vector::<3>();
            let seen = truth.observe(&Belief { mean: state, covariance: Symmetric::zeros() }, None);
            let reading = seen.value + seen.variance.sqrt() * draws.normal();
            let step = ekf.step_prepared(&belief, &prepared, Some(Reading::from(reading))).unwrap();
            sums.nis += step.update.unwrap().nis;
            belief = step.posterior;
            states.push(state);
            steps.push(step);
        }
        sums.filtered += nees(&state, &belief);
        sums.smoothed += nees(&states[ROWS / 2], &rts_smooth(&steps)[ROWS / 2]);
    }
    sums
}

/// Compares a sum of χ² terms, with `freedom` degrees of freedom in total, with its 99.9 % range: below, inside or
/// above.
fn place(sum: f64, freedom: u64) -> std::cmp::Ordering {
    let chi_squared = ChiSquared::new(freedom as f64).unwrap();
    match sum {
        sum if sum < chi_squared.inverse_cdf(0.0005) => std::cmp::Ordering::Less,
        sum if sum > chi_squared.inverse_cdf(0.9995) => std::cmp::Ordering::Greater,
        _ => std::cmp::Ordering::Equal,
    }
}

fn places(sums: &Statistics) -> [std::cmp::Ordering; 3] {
    [place(sums.nis, RUNS * ROWS as u64), place(sums.filtered, 3 * RUNS), place(sums.smoothed, 3 * RUNS)]
}

#[test]
fn a_matched_filter_and_smoother_are_consistent() {
    let sums = statistics(with_noise(1.0, 1.0));
    assert_eq!(places(&sums), [std::cmp::Ordering::Equal; 3], "{sums:?}");
}

/// Assumed noise that is too large makes every statistic too small, and vice versa.
#[test]
fn a_wrong_filter_is_found_out() {
    for (factor, side) in [(4.0, std::cmp::Ordering::Less), (0.25, std::cmp::Ordering::Greater)] {
        for (what, assumed) in [("Q", with_noise(factor, 1.0)), ("R", with_noise(1.0, factor))] {
            let sums = statistics(assumed);
            println!("{what} × {factor}: {sums:?}");
            assert_eq!(places(&sums), [side; 3], "{what} × {factor}: {sums:?}");
        }
    }
}
