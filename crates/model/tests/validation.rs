//! Laws that are no laws, and where strain is ambiguous.

use ohmstrain_model::{Gauge, Motion, SensorLaw, StrainRange};

fn law(gauge: Gauge<f64>, lower: f64, upper: f64) -> SensorLaw<f64, 0> {
    let range = StrainRange { lower, upper };
    SensorLaw { gauge, extend_viscosity_s: 0.0, retract_viscosity_s: 0.0, branches: [], range }
}

const STRAIGHT: Gauge<f64> = Gauge::Polynomial { coefficients: [1.0, 0.0, 0.0] };

#[test]
fn an_infinite_range_is_refused() {
    for (lower, upper) in [(0.0, f64::INFINITY), (f64::NEG_INFINITY, 0.3), (f64::NAN, 0.3), (0.3, 0.0)] {
        assert!(law(STRAIGHT, lower, upper).validate().is_err(), "{lower} {upper}");
    }
    assert!(law(STRAIGHT, -0.1, 0.3).validate().is_ok());
}

/// An accepted gauge has a finite value and slope at a thousand strains of the range.
#[test]
fn a_gauge_without_a_value_in_its_range_is_refused() {
    let tunnelling = |gap, barrier, path_loss| Gauge::Tunnelling { gap, barrier, path_loss };
    let refused = [
        (tunnelling(-4.0, 1.0, 0.0), 0.0, 0.3),
        (tunnelling(5.0, 1.0, 0.0), -0.3, 0.3),
        (tunnelling(1.0, 1e4, 0.0), 0.0, 0.3),
        // Fine at both ends, and e⁹⁰⁰⁰ between them.
        (tunnelling(1.0, 1.2e5, -4e5), 0.0, 0.3),
        (Gauge::DecayingExponential { slope: 1.0, decay_strain: -1e-5 }, 0.0, 0.3),
    ];
    for (gauge, lower, upper) in refused {
        assert!(law(gauge, lower, upper).validate().is_err(), "{gauge:?}");
    }
    for gauge in [tunnelling(1.0, 2.0, 3.0), tunnelling(-3.0, 40.0, -90.0), tunnelling(5.0, 0.0, 0.0)] {
        let law = law(gauge, -0.1, 0.3);
        law.validate().unwrap();
        for k in 0..=1000 {
            let (value, slope) = gauge.value_and_slope(-0.1 + 4e-4 * f64::from(k));
            assert!(value.is_finite() && slope.is_finite() && value > -1.0, "{gauge:?}");
        }
    }
}

#[test]
fn a_phase_rate_is_a_speed() {
    let motion = Motion::ornstein_uhlenbeck(1.0, 0.1, 0.15, 0.1).unwrap();
    for rate in [f64::NAN, f64::INFINITY, -0.1] {
        assert!(motion.with_phase_rate(rate).is_err(), "{rate}");
    }
    assert!(motion.with_phase_rate(0.0).is_ok());
}

/// A falling sensor's curve is a rising one upside down, so its border is the same.
#[test]
fn a_falling_sensor_has_a_border_too() {
    for coefficients in [[1.9, -4.0, 0.0], [1.0, -2.0, -3.0], [0.5, 1.0, -6.0]] {
        let border = |sign: f64| law(Gauge::Polynomial { coefficients: coefficients.map(|a| sign * a) }, 0.0, 0.45);
        let (rising, falling) = (border(1.0).static_border(), border(-1.0).static_border());
        let falls_more = border(-1.0).gauge_value_and_slope(0.45).0 < 0.0;
        assert!(rising.is_some());
        assert_eq!(falling, rising.filter(|_| falls_more), "{coefficients:?}");
    }
    // A dip before a long rise is no border.
    let dip = Gauge::Polynomial { coefficients: [-0.05, 3.0, 0.0] };
    assert_eq!(law(dip, 0.0, 0.33).static_border(), None);
}
