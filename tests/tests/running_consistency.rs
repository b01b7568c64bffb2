//! The running consistency check: its bounds against another library, its counting against a naive one, and its level
//! and power on simulated filters.

use nalgebra::{Cholesky, SMatrix, SVector, matrix, vector};
use ohmstrain_ekf::{Belief, ChiSquare, ConsistencyRecord, ConsistencyReport, ConsistencyTest, Ekf, Reading, Verdict};
use ohmstrain_tests::Linear;
use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ChiSquared, ContinuousCDF};

const RUNS: usize = 1000;
const STEPS: usize = 300;
const FALSE_ALARM: f64 = 0.05;
/// Two-sided 99.9 % of the standard normal.
const Z_999: f64 = 3.2905;

fn normal(rng: &mut ChaCha12Rng) -> f64 {
    StandardNormal.sample(rng)
}

#[test]
fn chi_square_equals_statrs() {
    for dof in [1.0, 2.0, 3.0, 8.0, 15.0, 30.0, 99.0, 100.0] {
        let (ours, theirs) = (ChiSquare::new(dof), ChiSquared::new(dof).unwrap());
        for tail in [1e-4, 1e-3, 0.025, 0.3, 0.5, 0.9, 0.975, 0.999] {
            let x = ours.upper_quantile(tail);
            // Sums of up to fifty terms; where the tail is close to 1 the quantile of one degree of freedom goes with
            // the square of what is left of it.
            assert!((theirs.sf(x) - tail).abs() < 1e-11 * tail, "dof {dof}, tail {tail}: {x}");
            assert!((ours.upper_tail(x) - theirs.sf(x)).abs() < 1e-11);
            let single = f64::from(ChiSquare::new(dof as f32).upper_quantile(tail as f32));
            assert!((single - x).abs() < 3e-4 * x, "f32, dof {dof}, tail {tail}: {single} vs {x}");
        }
    }
    // The approximation, at the bounds that its documentation states.
    for (dof, bound) in [(30.5, 7e-3), (100.5, 1.2e-3), (300.0, 2.4e-4), (1000.0, 4e-5), (1e5, 1e-6)] {
        let (ours, theirs) = (ChiSquare::new(dof), ChiSquared::new(dof).unwrap());
        for tail in [1e-3, 0.025, 0.5, 0.975, 0.999] {
            let (x, exact) = (ours.upper_quantile(tail), theirs.inverse_cdf(1.0 - tail));
            assert!((x - exact).abs() < bound * exact, "dof {dof}, tail {tail}: {x} vs {exact}");
            assert!((ours.upper_tail(x) - tail).abs() < 1e-12);
        }
    }
}

/// Mean and variance of z² given z² ≤ gate, by Simpson's rule.
#[test]
fn a_gate_lowers_the_expected_nis() {
    for gate in [1.0_f64, 4.0, 9.0, 25.0] {
        let (mut m0, mut m2) = (0.0, 0.0);
        let (n, a) = (2000, gate.sqrt());
        for k in 0..=n {
            let z = a * (2.0 * f64::from(k) / f64::from(n) - 1.0);
            let weight = if k == 0 || k == n { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
            let density = weight * (-0.5 * z * z).exp();
            (m0, m2) = (m0 + density, m2 + density * z * z);
        }
        let mut record = ConsistencyRecord::<f64, 1>::new();
        record.accept_standardised(0.5);
        let test = ConsistencyTest::new(0.05).unwrap().with_gate(gate).unwrap().with_minimum(1);
        let expected = test.report(&record).nis.unwrap().expected;
        // Simpson's error is (2a/n)⁴ a/90 of a fourth derivative below 10.
        assert!((expected - m2 / m0).abs() < 1e-9, "gate {gate}: {expected} vs {}", m2 / m0);
    }
}

/// Ljung and Box's statistic from the whole sequence, products over pairs without a gap in either place.
fn naive_ljung_box(sequence: &[Option<f64>], lags: usize) -> f64 {
    let squares: f64 = sequence.iter().flatten().map(|z| z * z).sum();
    let n = sequence.iter().flatten().count() as f64;
    (1..=lags)
        .map(|lag| {
            let pairs: Vec<f64> =
                (lag..sequence.len()).filter_map(|k| Some(sequence[k]? * sequence[k - lag]?)).collect();
            let r = pairs.iter().sum::<f64>() / squares;
            if pairs.is_empty() { 0.0 } else { n * (n + 2.0) * r * r / pairs.len() as f64 }
        })
        .sum()
}

#[test]
fn gaps_interrupt_the_lag_products() {
    let mut rng = ChaCha12Rng::seed_from_u64(3);
    let sequence: Vec<Option<f64>> =
        (0..97).map(|k| (k % 7 != 2 && !(40..48).contains(&k)).then(|| normal(&mut rng))).collect();
    let mut record = ConsistencyRecord::<f64, 6>::new();
    for (k, z) in sequence.iter().enumerate() {
        match z {
            Some(z) => record.accept_standardised(*z),
            None if k % 2 == 0 => record.gate(),
            None => record.miss(),
        }
    }
    // Neither NaN nor infinity is a reading.
    record.accept_standardised(f64::NAN);
    record.accept_standardised(f64::INFINITY);
    let report = ConsistencyTest::new(0.05).unwrap().report(&record);
    let gaps = sequence.iter().enumerate().filter(|(_, z)| z.is_none());
    let gated = gaps.clone().filter(|(k, _)| k % 2 == 0).count();
    assert_eq!(report.accepted, sequence.iter().flatten().count());
    assert_eq!((report.gated, report.missing), (gated, gaps.count() - gated + 2));
    let whiteness = report.whiteness.unwrap();
    assert_eq!(whiteness.lags, 6);
    assert!((whiteness.statistic - naive_ljung_box(&sequence, 6)).abs() < 1e-12);
    let mean = sequence.iter().flatten().map(|z| z * z).sum::<f64>() / report.accepted as f64;
    assert!((report.nis.unwrap().mean - mean).abs() < 1e-13);
    // Every second reading missing: the odd lags have no pairs.
    let mut record = ConsistencyRecord::<f64, 4>::new();
    for _ in 0..40 {
        record.accept_standardised(normal(&mut rng));
        record.miss();
    }
    assert_eq!(ConsistencyTest::new(0.05).unwrap().report(&record).whiteness.unwrap().lags, 2);
}

fn truth() -> Linear<f64, 2> {
    Linear {
        transition: matrix![0.97, 0.09; -0.2, 0.85],
        noise: matrix![0.02, 0.01; 0.01, 0.08],
        gradient: vector![1.4, 0.2],
        variance: 0.05,
    }
}

/// One run of a filter that assumes a model, every eleventh reading missing, those above the gate refused.
fn simulate(assumed: Linear<f64, 2>, gate: f64, seed: usize) -> ConsistencyRecord<f64, 10> {
    let truth = truth();
    let root = Cholesky::new(truth.noise).unwrap().l();
    let ekf = Ekf::new(assumed);
    let mut rng = ChaCha12Rng::seed_from_u64(seed as u64);
    let mut state = SVector::from_fn(|_, _| normal(&mut rng));
    let mut belief: Belief<f64, 2, 3> = Belief::independent(SVector::zeros(), &[1.0; 2]);
    let mut record = ConsistencyRecord::new();
    for k in 0..STEPS {
        state = truth.transition * state + root * SVector::from_fn(|_, _| normal(&mut rng));
        let reading = truth.gradient.dot(&state) + truth.variance.sqrt() * normal(&mut rng);
        let step = ekf.step(&belief, 0.1, (k % 11 != 5).then(|| Reading::from(reading))).unwrap();
        if step.update.is_some_and(|update| update.nis > gate) {
            record.gate();
            belief = step.prior;
        } else {
            record.step(&step);
            belief = step.posterior;
        }
    }
    let error = state - belief.mean;
    record.add_error(&error, &belief.covariance);
    record
}

fn reports(assumed: Linear<f64, 2>, gate: f64) -> Vec<ConsistencyReport<f64>> {
    let mut test = ConsistencyTest::new(FALSE_ALARM).unwrap();
    if gate.is_finite() {
        test = test.with_gate(gate).unwrap();
    }
    (0..RUNS).map(|seed| test.report(&simulate(assumed, gate, seed))).collect()
}

fn share(reports: &[ConsistencyReport<f64>], wanted: impl Fn(&ConsistencyReport<f64>) -> bool) -> f64 {
    reports.iter().filter(|report| wanted(report)).count() as f64 / reports.len() as f64
}

/// Whether a share of all runs is what a probability of `rate` gives, at 99.9 %.
fn assert_rate(share: f64, rate: f64, what: &str) {
    let band = Z_999 * (rate * (1.0 - rate) / RUNS as f64).sqrt();
    assert!((share - rate).abs() < band, "{what}: {share}, should be {rate} ± {band}");
}

#[test]
fn false_alarms_come_at_the_stated_rate() {
    let reports = reports(truth(), f64::INFINITY);
    let rate = |verdict: Verdict| share(&reports, |report| report.verdict == verdict);
    assert_rate(rate(Verdict::Overconfident), FALSE_ALARM / 2.0, "overconfident");
    assert_rate(rate(Verdict::Underconfident), FALSE_ALARM / 2.0, "underconfident");
    assert_rate(1.0 - rate(Verdict::Consistent), FALSE_ALARM, "all");
    assert_rate(share(&reports, |report| !report.whiteness.unwrap().white), FALSE_ALARM, "coloured");
    assert!(reports.iter().all(|report| report.missing == 27 && report.gated == 0));
}

/// Independent innovations, the gate at two deviations: a twentieth is refused.
#[test]
fn false_alarms_of_a_gated_filter_come_at_the_stated_rate() {
    let test = ConsistencyTest::new(FALSE_ALARM).unwrap();
    let (mut alarms, mut alarms_uncorrected, mut gated) = (0, 0, 0);
    let mut rng = ChaCha12Rng::seed_from_u64(11);
    for _ in 0..RUNS {
        let mut record = ConsistencyRecord::<f64, 4>::new();
        for _ in 0..STEPS {
            let z = normal(&mut rng);
            if z * z > 4.0 { record.gate() } else { record.accept_standardised(z) }
        }
        let report = test.with_gate(4.0).unwrap().report(&record);
        alarms += usize::from(report.verdict != Verdict::Consistent);
        alarms_uncorrected += usize::from(test.report(&record).verdict != Verdict::Consistent);
        gated += report.gated;
    }
    assert_rate(alarms as f64 / RUNS as f64, FALSE_ALARM, "corrected");
    // Without the correction the mean, 0.774 ± 0.054, lies 1.3 deviations below the lower bound of 0.843: in nine of ten
    // runs.
    assert_rate(alarms_uncorrected as f64 / RUNS as f64, 0.9, "uncorrected");
    let expected = ChiSquare::new(1.0).upper_tail(4.0);
    let band = Z_999 * (expected / (RUNS * STEPS) as f64).sqrt();
    assert!((gated as f64 / (RUNS * STEPS) as f64 - expected).abs() < band);
}

/// A gate of three deviations in a filter, which goes on with the prior after a refusal, moves the rate by less than the
/// band.
#[test]
fn a_filter_with_a_wide_gate_is_consistent() {
    let reports = reports(truth(), 9.0);
    assert_rate(share(&reports, |report| report.verdict != Verdict::Consistent), FALSE_ALARM, "gate of 9");
    assert!(share(&reports, |report| report.gated > 0) > 0.3);
}

/// Four times too much or too little process or reading noise. The mean NIS of 273 readings has a deviation of 0.086 in a
/// consistent filter. Here it is 0.45, 0.47, 1.57 (gated) or more, at least six deviations off: found nearly always.
#[test]
fn wrong_noise_is_detected() {
    let times = |q: f64, r: f64| Linear { noise: truth().noise * q, variance: truth().variance * r, ..truth() };
    for (assumed, verdict) in [
        (times(4.0, 1.0), Verdict::Underconfident),
        (times(0.25, 1.0), Verdict::Overconfident),
        (times(1.0, 4.0), Verdict::Underconfident),
        (times(1.0, 0.25), Verdict::Overconfident),
    ] {
        for gate in [f64::INFINITY, 9.0] {
            let reports = reports(assumed, gate);
            let found = share(&reports, |report| report.verdict == verdict);
            let mean = reports.iter().map(|report| report.nis.unwrap().mean).sum::<f64>() / RUNS as f64;
            assert!(found > 0.95, "{verdict}, gate {gate}: {found}, NIS {mean}");
        }
    }
}

/// The total is right and the model is wrong: too little process noise made up for by too much reading noise.
#[test]
fn coloured_innovations_are_found_where_the_nis_is_not() {
    let assumed = Linear { noise: truth().noise * 0.1, variance: 0.25, ..truth() };
    let reports = reports(assumed, f64::INFINITY);
    assert!(share(&reports, |report| !report.whiteness.unwrap().white) > 0.95);
    assert!(share(&reports, |report| report.verdict == Verdict::Consistent) > 0.5);
}

/// Errors of independent runs: two degrees of freedom each, and a direction that is known exactly counts for none.
#[test]
fn errors_of_the_state() {
    let test = ConsistencyTest::new(FALSE_ALARM).unwrap();
    let (mut alarms, groups) = (0, 200);
    let mut rng = ChaCha12Rng::seed_from_u64(5);
    let covariance = SMatrix::<f64, 3, 3>::new(2.0, 0.5, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0);
    let root = Cholesky::new(covariance.fixed_view::<2, 2>(0, 0).into_owned()).unwrap().l();
    let packed = ohmstrain_model::Symmetric::<f64, 3, 6>::from_lower(&covariance);
    for _ in 0..groups {
        let mut record = ConsistencyRecord::<f64, 1>::new();
        for _ in 0..40 {
            let error = root * vector![normal(&mut rng), normal(&mut rng)];
            let nees = record.add_error(&vector![error[0], error[1], 0.0], &packed);
            let z = root.try_inverse().unwrap() * error;
            assert!((nees - z.norm_squared()).abs() < 1e-12 * (1.0 + nees));
        }
        let report = test.report(&record);
        assert_eq!((report.nis, report.whiteness), (None, None));
        // Eighty degrees of freedom, each half of the rate: the NIS that is not there would have the other half.
        let upper = ChiSquared::new(80.0).unwrap().inverse_cdf(1.0 - FALSE_ALARM / 4.0) / 80.0;
        assert!((report.nees.unwrap().upper - upper).abs() < 1e-9);
        alarms += usize::from(report.verdict != Verdict::Consistent);
    }
    let expected = FALSE_ALARM / 2.0;
    let band = Z_999 * (expected * (1.0 - expected) / f64::from(groups)).sqrt();
    assert!((alarms as f64 / f64::from(groups) - expected).abs() < band, "{alarms}");
}

#[test]
fn names_and_limits() {
    let names = [Verdict::Consistent, Verdict::Overconfident, Verdict::Underconfident, Verdict::TooFew];
    assert_eq!(names.map(|verdict| verdict.to_string()), ["consistent", "overconfident", "underconfident", "too few"]);
    let mut record = ConsistencyRecord::<f32, 3>::default();
    for _ in 0..29 {
        record.accept_standardised(9.0);
    }
    let test = ConsistencyTest::new(0.01_f32).unwrap();
    assert_eq!(test.report(&record).verdict, Verdict::TooFew);
    record.accept_standardised(9.0);
    assert_eq!(test.report(&record).verdict, Verdict::Overconfident);
    for refused in [0.0, 1.0, f64::NAN] {
        assert!(ConsistencyTest::new(refused).is_err());
    }
    assert!(ConsistencyTest::new(0.05).unwrap().with_gate(0.5).is_err());
    // Thirty million innovations of half a deviation: a plain sum in f32 stops at 2²² times a quarter.
    let mut record = ConsistencyRecord::<f32, 1>::default();
    for _ in 0..30_000_000 {
        record.accept_standardised(0.5);
    }
    assert!((test.report(&record).nis.unwrap().mean - 0.25).abs() < 1e-6);
}
