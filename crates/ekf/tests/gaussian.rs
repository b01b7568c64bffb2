//! Truncated moments against numerical integration.

use ohmstrain_ekf::Gaussian;
use ohmstrain_model::StrainRange;
use proptest::prelude::*;

/// Mass, mean and variance of N(mean, variance) on [a, b] by Simpson's rule on the density times exp(shift), which keeps
/// far tails in range.
fn by_simpson(mean: f64, variance: f64, a: f64, b: f64) -> (f64, f64, f64) {
    let sd = variance.sqrt();
    let nearest = mean.clamp(a, b);
    let exponent = |x: f64| -0.5 * (x - mean).powi(2) / variance;
    let shift = exponent(nearest);
    // Where the near end is z deviations out, the mass lies within a few sd/z of it.
    let z = ((nearest - mean) / sd).abs();
    let reach = 12.0 * sd / (1.0 + 0.3 * z);
    let (a, b) = (a.max(nearest - reach), b.min(nearest + reach));
    let n = 20_000;
    let h = (b - a) / f64::from(n);
    let (mut m0, mut m1, mut m2) = (0.0, 0.0, 0.0);
    for k in 0..=n {
        let x = a + h * f64::from(k);
        let weight = if k == 0 || k == n { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
        let density = weight * (exponent(x) - shift).exp();
        (m0, m1, m2) = (m0 + density, m1 + density * (x - nearest), m2 + density * (x - nearest).powi(2));
    }
    let mass = m0 * h / 3.0 * shift.exp() / (std::f64::consts::TAU * variance).sqrt();
    let first = m1 / m0;
    (mass, nearest + first, m2 / m0 - first * first)
}

proptest! {
    /// Differences of erfc lose a digit or two where the interval is short against the deviation: 1e-6 of the variance
    /// is left even at a hundredth of a deviation.
    #[test]
    fn moments_equal_numerical_integration(
        mean in -3.0..3.0_f64, ln_sd in -3.0..1.0_f64, lower in -1.0..0.5_f64, width in 0.2..2.0_f64,
    ) {
        let variance = (2.0 * ln_sd).exp();
        let range = StrainRange { lower, upper: lower + width };
        let got = Gaussian { mean, variance }.restricted(&range);
        let (mass, expected_mean, expected_variance) = by_simpson(mean, variance, lower, lower + width);
        prop_assert!((got.mass - mass).abs() < 1e-9);
        prop_assert_eq!(Gaussian { mean, variance }.mass_within(&range), got.mass);
        let sd = variance.sqrt();
        // In the far tail the asymptote is used; its relative error is 2/z² of the distance from the edge.
        let tolerance = if mass < 1e-8 { 0.2 } else { 1e-6 };
        prop_assert!((got.mean - expected_mean).abs() < tolerance * sd, "{} vs {expected_mean}", got.mean);
        prop_assert!((got.variance - expected_variance).abs() < tolerance * variance);
        prop_assert!(got.mean >= range.lower && got.mean <= range.upper);
    }
}

/// On a small part of a deviation the density is taken for an exponential, which misses w²/24 of the mass and w²/60 of the
/// variance over a width of w deviations; single precision adds its rounding, of the mean that of the edge.
#[test]
fn a_narrow_interval_has_its_moments() {
    for lower in [0.0_f32, -0.5, 0.5, 2.0, -4.0] {
        for width in [0.02_f32, 0.05, 0.0859375, 0.125, 0.171875] {
            let upper = lower + width;
            let got = Gaussian { mean: 0.0, variance: 1.0_f32 }.restricted(&StrainRange { lower, upper });
            let (mass, mean, variance) = by_simpson(0.0, 1.0, lower.into(), upper.into());
            let square = f64::from(width).powi(2);
            assert!((f64::from(got.mass) / mass - 1.0).abs() < square / 20.0 + 1e-5, "{lower} {width}: {got:?} {mass}");
            assert!(
                (f64::from(got.mean) - mean).abs() < square.powf(1.5) / 30.0 + 1e-6,
                "{lower} {width}: {got:?} {mean}"
            );
            let apart = (f64::from(got.variance) / variance - 1.0).abs();
            assert!(apart < square / 30.0 + 1e-5, "{lower} {width}: {got:?} {variance}");
        }
        let (lower, width) = (f64::from(lower), 1e-3);
        let got = Gaussian { mean: 0.0, variance: 1.0 }.restricted(&StrainRange { lower, upper: lower + width });
        let (mass, mean, variance) = by_simpson(0.0, 1.0, lower, lower + width);
        assert!(
            (got.mass / mass - 1.0).abs() < 1e-6 && (got.mean - mean).abs() < 1e-6 * width,
            "{lower}: {got:?} {mean}"
        );
        assert!((got.variance / variance - 1.0).abs() < 1e-6, "{lower}: {got:?} {variance}");
    }
}

#[test]
fn exactly_known_values_are_no_problem() {
    let range = StrainRange { lower: 0.0, upper: 1.0 };
    let inside = Gaussian { mean: 0.4, variance: 0.0 }.restricted(&range);
    assert_eq!((inside.mass, inside.mean, inside.variance), (1.0, 0.4, 0.0));
    assert_eq!(Gaussian { mean: 2.0_f64, variance: 0.0 }.restricted(&range).mean, 1.0);
    assert_eq!(Gaussian { mean: 2.0_f64, variance: 0.0 }.probability_above(1.0), 1.0);
    assert_eq!(Gaussian { mean: 2.0_f64, variance: 4.0 }.probability_above(2.0), 0.5);
}
