//! Nonlinear models beside exact moments, a search and quadrature.

use nalgebra::{Vector1, Vector2, matrix, vector};
use ohmstrain_ekf::kalman::{Ekf, Filter, Normal, Ukf};

/// x + x²/2 of x ~ N(0, 1): mean 1/2, variance 1 + 1/2. The tangent's are 0 and 1.
#[test]
fn the_unscented_transition_has_the_moments_of_a_parabola() {
    let bent = |x: &Vector1<f64>| vector![x[0] + 0.5 * x[0] * x[0]];
    let standard = Normal::independent(vector![0.0], &vector![1.0]).unwrap();
    let ukf = Ukf::new((bent, |x: &Vector1<f64>| *x), matrix![0.0], matrix![1.0]);
    let prediction = ukf.predict(&standard).unwrap();
    assert!((prediction.prior.mean[0] - 0.5).abs() < 1e-15, "{prediction:?}");
    assert!((prediction.prior.covariance()[(0, 0)] - 1.5).abs() < 1e-15, "{prediction:?}");
    // The reading likewise, S with R = 1.
    let ukf = Ukf::new((|x: &Vector1<f64>| *x, bent), matrix![0.0], matrix![1.0]);
    let step = ukf.update(&standard, &[Some(1.0)]).unwrap();
    assert!((step.innovation[0] - 0.5).abs() < 1e-15 && (step.innovation_covariance[(0, 0)] - 2.5).abs() < 1e-15);
    // cov(x, y) = 1, so the mean moves by ν/S and the variance falls by 1/S.
    assert!((step.posterior.mean[0] - 0.2).abs() < 1e-15, "{step:?}");
    assert!((step.posterior.covariance()[(0, 0)] - 0.6).abs() < 1e-15, "{step:?}");
    let slope = |x: &Vector1<f64>| matrix![1.0 + x[0]];
    let ekf = Ekf::new((bent, slope, bent, slope), matrix![0.0], matrix![1.0]);
    let prior = ekf.predict(&standard).unwrap().prior;
    assert_eq!((prior.mean[0], prior.covariance()[(0, 0)]), (0.0, 1.0));
}

/// Two states: the textbook's weighted sums over 2 N + 1 points, written out.
#[test]
fn the_unscented_filter_is_the_textbooks() {
    let turn = |x: &Vector2<f64>| vector![x[0] * x[1].cos(), x[1] + 0.3 * x[0] * x[0]];
    let (q, p) = (matrix![0.02, 0.01; 0.01, 0.03], matrix![0.5, 0.2; 0.2, 0.4]);
    let x = vector![1.0, 0.4];
    let ukf = Ukf::new((turn, |x: &Vector2<f64>| vector![x[0].hypot(x[1])]), q, matrix![0.01]);
    let found = ukf.predict(&Normal::new(x, &p).unwrap()).unwrap();
    let root = p.cholesky().unwrap().l() * 2.0_f64.sqrt();
    let points: Vec<_> = (0..2).flat_map(|i| [x + root.column(i), x - root.column(i)]).collect();
    let images: Vec<_> = points.iter().map(turn).collect();
    let mean = images.iter().sum::<Vector2<f64>>() / 4.0;
    let centre = turn(&x) - mean;
    let pairs = images.iter().map(|y| (y - mean) * (y - mean).transpose() / 4.0).sum::<nalgebra::Matrix2<f64>>();
    let covariance = pairs + centre * centre.transpose() * 2.0 + q;
    assert!((found.prior.mean - mean).amax() < 1e-15);
    assert!((found.prior.covariance() - covariance).amax() < 1e-14);
    // The regression's slope F = Cᵀ P⁻¹, and its noise is what F P Fᵀ does not explain.
    let cross =
        points.iter().zip(&images).map(|(a, b)| (b - mean) * (a - x).transpose() / 4.0).sum::<nalgebra::Matrix2<f64>>();
    let slope = cross * p.try_inverse().unwrap();
    assert!((found.transition.slope - slope).amax() < 1e-14);
    assert!((found.transition.noise() - (covariance - slope * p * slope.transpose())).amax() < 1e-14);
}

/// A bearing read from nearby: the iterated update ends where the posterior density is largest, the plain one does not.
#[test]
fn the_iterated_update_finds_the_mode() {
    let bearing = |x: &Vector1<f64>| vector![x[0].atan()];
    let slope = |x: &Vector1<f64>| matrix![1.0 / (1.0 + x[0] * x[0])];
    let (r, y) = (0.01, 1.1);
    let one = |_: &Vector1<f64>| matrix![1.0];
    let ekf = Ekf::new((|x: &Vector1<f64>| *x, one, bearing, slope), matrix![0.0], matrix![r]);
    let prior = Normal::independent(vector![0.8], &vector![1.0]).unwrap();
    let cost = |x: f64| 0.5 * (x - 0.8).powi(2) + 0.5 * (y - x.atan()).powi(2) / r;
    // Golden section on −ln p(x | y), which has one minimum here; ∜-like flatness leaves √ε.
    let (mut low, mut high) = (0.0, 4.0);
    for _ in 0..80 {
        let (a, b) = (low + 0.381_966 * (high - low), low + 0.618_034 * (high - low));
        if cost(a) < cost(b) { high = b } else { low = a }
    }
    let mode = 0.5 * (low + high);
    let iterated = ekf.update_iterated(&prior, &[Some(y)], 60).unwrap();
    assert!((iterated.posterior.mean[0] - mode).abs() < 1e-7, "{iterated:?} {mode}");
    let plain = ekf.update(&prior, &[Some(y)]).unwrap();
    assert!((plain.posterior.mean[0] - mode).abs() > 0.05, "{plain:?} {mode}");
}

/// A reading through a weak bend: posterior moments and evidence beside Simpson's rule, to the order of the bend squared.
#[test]
fn a_weakly_bent_reading_has_the_posterior_of_a_quadrature() {
    let bend = 1e-3;
    let bent = move |x: &Vector1<f64>| vector![x[0] + bend * x[0] * x[0]];
    let ukf = Ukf::new((|x: &Vector1<f64>| *x, bent), matrix![0.0], matrix![0.5]);
    let prior = Normal::independent(vector![0.3], &vector![1.0]).unwrap();
    let step = ukf.update(&prior, &[Some(0.9)]).unwrap();
    let density = |x: f64| {
        let normal =
            |off: f64, variance: f64| (-0.5 * off * off / variance).exp() / (std::f64::consts::TAU * variance).sqrt();
        normal(x - 0.3, 1.0) * normal(0.9 - x - bend * x * x, 0.5)
    };
    let moment = |of: &dyn Fn(f64) -> f64| {
        let (n, h) = (4000, 20.0 / 4000.0);
        let weight = |k: i32| {
            if k == 0 || k == n {
                1.0
            } else if k % 2 == 1 {
                4.0
            } else {
                2.0
            }
        };
        (0..=n).map(|k| (-10.0 + h * f64::from(k), weight(k))).map(|(x, w)| w * of(x) * density(x)).sum::<f64>() * h
            / 3.0
    };
    let evidence = moment(&|_| 1.0);
    let mean = moment(&|x| x) / evidence;
    // The regression leaves out terms of the first order of the bend times skewness: at most some bends.
    assert!((step.posterior.mean[0] - mean).abs() < bend, "{step:?} {mean}");
    assert!((step.log_likelihood - evidence.ln()).abs() < bend, "{step:?} {evidence}");
    let tangent = Ekf::new(
        (
            |x: &Vector1<f64>| *x,
            |_: &Vector1<f64>| matrix![1.0],
            bent,
            move |x: &Vector1<f64>| matrix![1.0 + 2.0 * bend * x[0]],
        ),
        matrix![0.0],
        matrix![0.5],
    );
    assert!((tangent.update(&prior, &[Some(0.9)]).unwrap().posterior.mean[0] - mean).abs() < bend);
}
