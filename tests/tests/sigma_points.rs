//! Sigma points of the strain, compared with the exact moments.

use nalgebra::{SMatrix, SVector};
use ohmstrain_ekf::{AnyCurve, Cubic};
use ohmstrain_ekf::{Belief, Compact, Curve, Reading, SigmaPoints, SparseEkf};
use ohmstrain_model::{Gauge, ModelNoise, Motion, SensorLaw, StrainRange, SwitchedModel, Symmetric};

/// Range far beyond all strains of these tests.
const WIDE: StrainRange<f64> = StrainRange { lower: -10.0, upper: 10.0 };

/// Returns E[g], Cov(g, ε)/σ² and the residual variance of a line with that slope, by the trapezoid rule over ten
/// standard deviations.
fn integrated(gauge: &Gauge<f64>, mean: f64, variance: f64) -> [f64; 3] {
    let (sd, steps) = (variance.sqrt(), 4000);
    let over = |f: &dyn Fn(f64) -> f64| -> f64 {
        let h = 20.0 / f64::from(steps);
        (0..=steps)
            .map(|k| -10.0 + h * f64::from(k))
            .map(|z| h * (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt() * f(mean + sd * z))
            .sum()
    };
    let value = |strain: f64| gauge.value_and_slope(strain).0;
    let expected = over(&value);
    let slope = over(&|strain| (value(strain) - expected) * (strain - mean)) / variance;
    let left = over(&|strain| (value(strain) - expected - slope * (strain - mean)).powi(2));
    [expected, slope, left]
}

/// Three points have the moments of a normal distribution up to the fifth: exact for E and slope of a cubic, and for all
/// moments of a parabola. The trapezoid rule is exact to rounding for integrands that decay like a normal density.
#[test]
fn moments_of_polynomials_are_exact() {
    for (a2, a3) in [(-2.8, 0.0), (0.9, 0.0), (-2.8, 3.0)] {
        let gauge = Gauge::Polynomial { coefficients: [1.9, a2, a3] };
        let curve = SigmaPoints::<Cubic<f64>>::new(&gauge, &WIDE).unwrap();
        for (mean, variance) in [(0.1, 1e-2), (0.2, 4e-4), (-0.1, 0.09)] {
            let [expected, slope, left] = integrated(&gauge, mean, variance);
            let line = curve.line(mean, variance);
            assert!((line.value - expected).abs() < 1e-13, "{a2} {a3} {mean}: {line:?} {expected}");
            assert!((line.slope - slope).abs() < 1e-11, "{a2} {a3} {mean}: {line:?} {slope}");
            if a3 == 0.0 {
                assert!((line.left.unwrap() - left).abs() < 1e-13, "{a2} {mean}: {line:?} {left}");
            }
        }
    }
}

/// An exactly known strain gives the tangent, without residual variance.
#[test]
fn without_a_variance_there_is_the_tangent() {
    let gauge = Gauge::DecayingExponential { slope: 3.0, decay_strain: 0.25 };
    let curve = SigmaPoints::<AnyCurve<f64>>::new(&gauge, &WIDE).unwrap();
    let (value, slope) = gauge.value_and_slope(0.1);
    let line = curve.line(0.1, 0.0);
    assert_eq!((line.value, line.slope, line.left), (value, slope, Some(0.0)));
}

/// One update with the moments of a parabola, written out with full matrices.
#[test]
fn an_update_is_that_of_the_moments() {
    let (a1, a2) = (1.9, -2.8);
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [a1, a2, 0.0] },
        extend_viscosity_s: 0.0,
        retract_viscosity_s: 0.0,
        branches: [],
        range: WIDE,
    };
    let motion = Motion::ornstein_uhlenbeck(1.0, 0.3, 0.15, 0.2).unwrap();
    let noise = ModelNoise { reading_sd: 5e-3, branch_sd: 0.0, baseline_sd: 0.05, baseline_time_s: 5.0 };
    let model = SwitchedModel::<f64, 0, 3>::new(law, motion, noise).unwrap();
    let filter = SparseEkf::<f64, Compact, 0, 3, SigmaPoints<Cubic<f64>>>::new(model, 0.05).unwrap();
    let mut belief = Belief {
        mean: SVector::from([0.2, -0.1, 0.01]),
        covariance: Symmetric::<f64, 3, 6>::from_packed([0.04, 0.01, 0.09, -0.003, 0.001, 0.0025]),
    };
    let mut ahead = belief;
    filter.step(&mut ahead, None).unwrap();
    let residual = filter.step(&mut belief, Some(Reading { value: 0.3, extra_variance: 1e-5 })).unwrap().unwrap();

    let (m, p): (f64, SMatrix<f64, 3, 3>) = (ahead.mean[0], ahead.covariance.to_matrix());
    let spread = p[(0, 0)];
    let expected = a1 * m + a2 * (m * m + spread) + ahead.mean[2];
    let h = SVector::from([a1 + 2.0 * a2 * m, 0.0, 1.0]);
    let variance = h.dot(&(p * h)) + 2.0 * (a2 * spread).powi(2) + 2.5e-5 + 1e-5;
    let gain = p * h / variance;
    let (mean, covariance) = (ahead.mean + gain * (0.3 - expected), p - gain * gain.transpose() * variance);
    // Numbers of order one, about thirty operations.
    let tolerance = 30.0 * f64::EPSILON;
    assert!((residual.variance - variance).abs() < tolerance, "{residual:?} {variance}");
    assert!((residual.innovation - (0.3 - expected)).abs() < tolerance, "{residual:?}");
    assert!((belief.mean - mean).amax() < tolerance, "{} {mean}", belief.mean);
    assert!((belief.covariance.to_matrix() - covariance).amax() < tolerance);
}

/// Near the gauge's peak, the tangent implies that readings carry no information; sigma points account for the distance of the
/// strain from the peak, so intervals are valid. A filter with tangents must fail the same bound.
#[test]
fn near_a_peak_sigma_points_cover_where_tangents_do_not() {
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [2.0, -5.0, 0.0] },
        extend_viscosity_s: 0.0,
        retract_viscosity_s: 0.0,
        branches: [],
        range: WIDE,
    };
    let motion = Motion::ornstein_uhlenbeck(1.0, 0.2, 0.2, 0.1).unwrap();
    let noise = ModelNoise { reading_sd: 2e-3, branch_sd: 0.0, baseline_sd: 0.0, baseline_time_s: 1.0 };
    let model = SwitchedModel::<f64, 0, 2>::new(law, motion, noise).unwrap();
    let start =
        Belief::<f64, 2, 3> { mean: SVector::from([0.2, 0.0]), covariance: Symmetric::from_packed([0.01, 0.0, 0.04]) };
    // Strains 1/2 to 3/2 standard deviations below the peak at 0.2; a reading determines the distance from the peak.
    let normalised = |curve: &dyn Fn(f64) -> (f64, f64)| -> f64 {
        let squares = (0..=20).map(|k| 0.2 - 0.1 * (0.5 + 0.05 * f64::from(k)));
        let errors = squares.map(|strain| {
            let (mean, sd) = curve(2.0 * strain - 5.0 * strain * strain);
            ((strain - mean) / sd).powi(2)
        });
        errors.sum::<f64>() / 21.0
    };
    let sigma = SparseEkf::<f64, Compact, 0, 2, SigmaPoints<Cubic<f64>>>::new(model, 1e-6).unwrap();
    let tangents = SparseEkf::<f64, Compact, 0, 2>::new(model, 1e-6).unwrap();
    let mut off_peak = start;
    off_peak.mean[0] = 0.17;
    let by_sigma = normalised(&|reading| {
        let mut belief = off_peak;
        sigma.step(&mut belief, Some(Reading::from(reading))).unwrap();
        (belief.mean[0], belief.covariance[(0, 0)].sqrt())
    });
    let by_tangents = normalised(&|reading| {
        let mut belief = off_peak;
        tangents.step(&mut belief, Some(Reading::from(reading))).unwrap();
        (belief.mean[0], belief.covariance[(0, 0)].sqrt())
    });
    assert!(by_sigma < 2.0, "{by_sigma}");
    assert!(by_tangents > 4.0, "{by_tangents}");
}
