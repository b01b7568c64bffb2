//! Is the filter's own uncertainty right? On a linear sensor with a known phase, simulated from its own model, NIS and
//! NEES are χ²; the bounds below are those of their mean over all runs at 99.9 %. The same statistics must leave the
//! bounds when the filter is told a wrong Q or R: a test that cannot fail would prove nothing.

use nalgebra::{Cholesky, SMatrix, SVector};
use ohmstrain_ekf::{Belief, Ekf, Reading};
use ohmstrain_tests::Linear;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

const RUNS: u64 = 200;
const STEPS: usize = 60;
/// Two-sided 99.9 % of the standard normal: sums of this many χ² are normal to three digits.
const Z_999: f64 = 3.2905;

fn model() -> Linear<f64, 3> {
    // Strain, rate and one relaxing branch at steps of 0.1 s, rounded; any stable matrices would do.
    Linear {
        transition: SMatrix::<f64, 3, 3>::new(0.97, 0.09, 0.0, -0.2, 0.85, 0.0, 0.03, 0.08, 0.9),
        noise: SMatrix::<f64, 3, 3>::new(0.02, 0.01, 0.005, 0.01, 0.08, 0.01, 0.005, 0.01, 0.03),
        gradient: SVector::from([1.4, 0.2, 1.0]),
        variance: 0.05,
    }
}

fn normal(rng: &mut ChaCha12Rng) -> SVector<f64, 3> {
    SVector::from_fn(|_, _| StandardNormal.sample(rng))
}

/// Mean NIS and mean NEES of `assumed` on data from [`model`].
fn statistics(assumed: Linear<f64, 3>) -> (f64, f64) {
    let truth = model();
    let root = Cholesky::new(truth.noise).unwrap().l();
    let ekf = Ekf::new(assumed);
    let (mut nis, mut nees) = (0.0, 0.0);
    for seed in 0..RUNS {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut state = normal(&mut rng);
        let mut belief: Belief<f64, 3, 6> = Belief::independent(SVector::zeros(), &[1.0; 3]);
        for _ in 0..STEPS {
            state = truth.transition * state + root * normal(&mut rng);
            let white: f64 = StandardNormal.sample(&mut rng);
            let reading = truth.gradient.dot(&state) + truth.variance.sqrt() * white;
            let step = ekf.step(&belief, 0.1, Some(Reading::from(reading))).unwrap();
            nis += step.update.unwrap().nis;
            let error = state - step.posterior.mean;
            nees += error.dot(&Cholesky::new(step.posterior.covariance.to_matrix()).unwrap().solve(&error));
            belief = step.posterior;
        }
    }
    let count = (RUNS as usize * STEPS) as f64;
    (nis / count, nees / count)
}

/// Half-width of the interval of a mean of χ²_d: NIS of different steps are independent.
fn nis_bound() -> f64 {
    Z_999 * (2.0 / (RUNS as usize * STEPS) as f64).sqrt()
}

/// NEES of one run are correlated over steps; runs are independent. The variance of a run's mean is at most that of
/// one step, 2 d, which makes this bound wide and safe.
fn nees_bound() -> f64 {
    Z_999 * (2.0 * 3.0 / RUNS as f64).sqrt()
}

#[test]
fn a_matched_filter_is_consistent() {
    let (nis, nees) = statistics(model());
    assert!((nis - 1.0).abs() < nis_bound(), "NIS {nis}");
    assert!((nees - 3.0).abs() < nees_bound(), "NEES {nees}");
}

#[test]
fn a_wrong_filter_is_found_out() {
    for factor in [4.0, 0.25] {
        let (nis, nees) = statistics(Linear { noise: model().noise * factor, ..model() });
        assert!((nis - 1.0).abs() > nis_bound(), "Q × {factor}: NIS {nis}");
        assert!((nees - 3.0).abs() > nees_bound(), "Q × {factor}: NEES {nees}");
        let (nis, _) = statistics(Linear { variance: model().variance * factor, ..model() });
        assert!((nis - 1.0).abs() > nis_bound(), "R × {factor}: NIS {nis}");
    }
}
