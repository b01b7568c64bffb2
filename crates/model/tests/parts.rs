//! Gauge curves, front ends and the joint map.

use ohmstrain_model::{
    AdcCode, Branch, ConstantCurrent, Divider, Gauge, Joint, Phase, SensorLaw, SensorSide, StrainRange,
};
use proptest::prelude::*;

#[test]
fn gauge_curves_start_at_zero_and_know_their_borders() {
    let peak = Gauge::DecayingExponential { slope: 3.0_f64, decay_strain: 0.23 };
    assert_eq!(peak.static_borders(), [Some(0.23), None]);
    let cubic = Gauge::Polynomial { coefficients: [1.2, -3.0, 1.0] };
    let tunnel = Gauge::Tunnelling { gap: 1.0, barrier: 2.0, path_loss: -8.0 };
    let straight = Gauge::Polynomial { coefficients: [1.2, 0.0, 0.0] };
    assert_eq!(straight.static_borders(), [None, None]);
    for gauge in [peak, cubic, tunnel, straight] {
        assert_eq!(gauge.value_and_slope(0.0).0, 0.0);
        for border in gauge.static_borders().into_iter().flatten() {
            assert!(gauge.value_and_slope(border).1.abs() < 1e-13, "{gauge:?} at {border}");
        }
    }
}

/// `ρ = g(ε) + η v + Σ c + b`, by hand.
#[test]
fn a_law_adds_up() {
    let branch =
        |tau_s| Branch { tau_s, extend_gain: 0.5, retract_gain: -0.3, extend_gain_slope: 0.0, retract_gain_slope: 0.0 };
    let law = SensorLaw {
        gauge: Gauge::Polynomial { coefficients: [2.0_f64, -1.0, 0.0] },
        extend_viscosity_s: 0.5,
        retract_viscosity_s: -0.25,
        branches: [branch(1.0), branch(10.0)],
        range: StrainRange { lower: 0.0, upper: 0.5 },
    };
    let at = |rate, phase| law.relative_change(0.25, rate, &[0.5, -0.125], 0.0625, phase);
    // 2/4 - 1/16 = 7/16 of the gauge, 3/8 of the branches; binary fractions, so that nothing is rounded.
    assert_eq!(at(0.125, Phase::Extend), 0.4375 + 0.0625 + 0.375 + 0.0625);
    assert_eq!(at(-0.125, Phase::Retract), 0.4375 + 0.03125 + 0.375 + 0.0625);
    assert_eq!(at(0.0, Phase::Hold), 0.4375 + 0.375 + 0.0625);
}

#[test]
fn a_law_goes_on_along_its_tangent() {
    let law = SensorLaw::<f64, 0> {
        gauge: Gauge::DecayingExponential { slope: 3.0, decay_strain: 0.23 },
        extend_viscosity_s: 0.0,
        retract_viscosity_s: 0.0,
        branches: [],
        range: StrainRange { lower: 0.0, upper: 0.3 },
    };
    assert_eq!(law.static_border(), Some(0.23));
    let (edge, slope) = law.gauge_value_and_slope(0.3);
    let (beyond, beyond_slope) = law.gauge_value_and_slope(0.5);
    assert!((beyond - (edge + 0.2 * slope)).abs() < 1e-15);
    assert_eq!(beyond_slope, slope);
}

proptest! {
    #[test]
    fn angle_and_strain_are_inverse(pre in -0.1..0.3_f64, arm in 1.0..20.0_f64, length in 5.0..100.0_f64, angle in -2.0..2.0_f64) {
        for arm in [arm, -arm] {
            let joint = Joint::new(pre, arm, length).unwrap();
            let (back, sd) = joint.angle_rad(joint.strain(angle), 0.01);
            prop_assert!((back - angle).abs() < 1e-12);
            // dε/dθ = r/L₀.
            prop_assert!((sd - 0.01 * length / arm.abs()).abs() < 1e-12);
        }
    }

    /// A code stands for the resistances that round to it: half a code to each side, which is √12/2 deviations.
    #[test]
    fn a_divider_reads_back_what_it_converted(ohm in 200.0..50_000.0_f64, low in any::<bool>(), bits in 8..=16_u32) {
        let side = if low { SensorSide::Low } else { SensorSide::High };
        let divider = Divider::new(4_700.0, side, bits, 0.0).unwrap();
        let code = divider.code(ohm).round() as u32;
        if let AdcCode::Reading(reading) = divider.read(code) {
            // Second order: the curve bends over half a code by at most the share of a code in the ratio.
            let bend = 1.0 + 4.0 * reading.sd_ohm / reading.resistance_ohm * 12_f64.sqrt();
            prop_assert!((reading.resistance_ohm - ohm).abs() <= 0.5 * 12_f64.sqrt() * reading.sd_ohm * bend);
        } else {
            prop_assert!(code == 0 || code >= (1 << bits) - 1);
        }
    }
}

/// A 10-bit divider resolves 0.39 % of R at mid-scale, a 12-bit one 0.098 %.
#[test]
fn resolution_of_a_divider_at_mid_scale() {
    for (bits, percent) in [(10, 0.39), (12, 0.098)] {
        let divider = Divider::new(1_000.0_f64, SensorSide::Low, bits, 0.0).unwrap();
        let AdcCode::Reading(reading) = divider.read(1 << (bits - 1)) else { panic!("saturated") };
        let step_percent = 100.0 * 12_f64.sqrt() * reading.sd_ohm / reading.resistance_ohm;
        assert!((step_percent / percent - 1.0).abs() < 0.01, "{bits} bits: {step_percent} %");
    }
}

#[test]
fn converters_saturate_at_both_ends() {
    let source = ConstantCurrent::new(1e-4_f64, 10.0, 3.3, 12, 0.5).unwrap();
    assert_eq!(source.read(0), AdcCode::Saturated);
    assert_eq!(source.read(4095), AdcCode::Saturated);
    let AdcCode::Reading(reading) = source.read(2048) else { panic!("saturated") };
    assert!((reading.resistance_ohm - 2048.0 * 3.3 / 4095.0 / 1e-3).abs() < 1e-9);
    assert!(Divider::new(-1.0, SensorSide::Low, 12, 0.0).is_err());
    assert!(ConstantCurrent::new(1e-4, 10.0, 3.3, 0, 0.5).is_err());
}
