//! Phases of clean, noisy, coarse and broken references.

use ohmstrain_bench_data::{Segment, segment};
use ohmstrain_model::Phase::{self, Extend, Hold, Retract};
use proptest::prelude::*;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// Returns the strain of rest, stretch, hold, release, rest: corners at 10, 20, 80, 84 and 120 s.
fn trapezoid(time_s: f64) -> f64 {
    0.3 * ((time_s - 10.0) / 10.0).clamp(0.0, 1.0) * ((84.0 - time_s) / 4.0).clamp(0.0, 1.0)
}

fn times(rate_hz: f64, duration_s: f64) -> Vec<f64> {
    (0..(rate_hz * duration_s) as u32).map(|i| f64::from(i) / rate_hz).collect()
}

fn phases(segments: &[Segment]) -> Vec<Phase> {
    segments.iter().map(|segment| segment.phase).collect()
}

/// Checks for the trapezoid's phases, with corners within `tolerance_s` of their true times.
fn assert_trapezoid(time_s: &[f64], strain: &[f64], tolerance_s: f64) {
    let segments = segment(time_s, strain);
    assert_eq!(phases(&segments), [Hold, Extend, Hold, Retract, Hold]);
    for (segment, corner_s) in segments[1..].iter().zip([10.0, 20.0, 80.0, 84.0]) {
        let found_s = time_s[segment.rows.start];
        assert!((found_s - corner_s).abs() <= tolerance_s, "{found_s} {corner_s}");
    }
}

#[test]
fn a_clean_trapezoid_has_five_phases_at_any_rate() {
    for rate_hz in [2.0, 10.0, 100.0] {
        let time_s = times(rate_hz, 120.0);
        let strain: Vec<f64> = time_s.iter().map(|t| trapezoid(*t)).collect();
        // The narrowest window has one row to each side.
        assert_trapezoid(&time_s, &strain, 2.0 / rate_hz);
    }
}

#[test]
fn noise_resolution_gaps_and_jitter_do_not_make_phases() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for (noise, resolution) in [(1e-4, 0.0), (1e-3, 0.0), (3e-3, 0.0), (0.0, 1e-3), (1e-4, 5e-4)] {
        let mut time_s = times(20.0, 120.0);
        for time in &mut time_s {
            let jitter: f64 = StandardNormal.sample(&mut random);
            *time += 0.01 * jitter.clamp(-2.0, 2.0);
        }
        let mut strain: Vec<f64> = time_s.iter().map(|t| trapezoid(*t)).collect();
        for value in &mut strain {
            let deviate: f64 = StandardNormal.sample(&mut random);
            *value += noise * deviate;
            if resolution > 0.0 {
                *value = (*value / resolution).round() * resolution;
            }
        }
        strain[300..310].fill(f64::NAN);
        assert_trapezoid(&time_s, &strain, 1.5);
    }
}

#[test]
fn slow_and_fast_movements_beside_long_holds_are_all_seen() {
    let time_s = times(9.0, 700.0);
    let strain: Vec<f64> = time_s
        .iter()
        .map(|t| match *t {
            t if t < 300.0 => 0.2 * (t / 12.0).min(1.0),
            t if t < 600.0 => 0.2 * (1.0 - (t - 300.0) / 3.0).max(0.0),
            t => 0.2 * ((t - 600.0) / 5.0).min(1.0),
        })
        .collect();
    assert_eq!(phases(&segment(&time_s, &strain)), [Extend, Hold, Retract, Hold, Extend, Hold]);
}

#[test]
fn the_turning_points_of_a_sine_are_no_holds() {
    let time_s = times(8.8, 90.0);
    let strain: Vec<f64> = time_s.iter().map(|t| 0.15 * (1.0 - (t * std::f64::consts::TAU / 30.0).cos())).collect();
    assert_eq!(phases(&segment(&time_s, &strain)), [Extend, Retract, Extend, Retract, Extend, Retract]);
}

#[test]
fn a_slow_ramp_before_fast_movements_is_a_ramp() {
    let time_s = times(9.0, 70.0);
    let fast = |t: f64| 0.15 + 0.15 * (std::f64::consts::TAU * t / 10.0).sin();
    let strain: Vec<f64> = time_s.iter().map(|t| if *t < 35.0 { 0.15 * t / 35.0 } else { fast(*t - 35.0) }).collect();
    assert_eq!(phases(&segment(&time_s, &strain))[..2], [Extend, Retract]);
}

#[test]
fn the_sway_of_a_body_at_rest_is_no_movement() {
    let time_s = times(20.0, 30.0);
    let bend = |t: f64| 85.0 * (1.0 - (std::f64::consts::TAU * (t - 10.0) / 2.0).cos()) / 2.0;
    let sway = |t: f64| 0.3 * (t * 1.3).sin();
    let angle: Vec<f64> = time_s.iter().map(|t| if (10.0..12.0).contains(t) { bend(*t) } else { sway(*t) }).collect();
    assert_eq!(phases(&segment(&time_s, &angle)), [Hold, Extend, Retract, Hold]);
}

#[test]
fn degenerate_references_are_one_hold_or_nothing() {
    assert_eq!(segment(&[], &[]), []);
    for strain in [vec![0.3], vec![f64::NAN; 4], vec![0.3; 50]] {
        let rows = strain.len();
        assert_eq!(segment(&times(1.0, rows as f64), &strain), [Segment { phase: Hold, rows: 0..rows }]);
    }
}

/// The reference fails over a whole movement, and in a long hold.
#[test]
fn a_gap_is_neither_movement_nor_hold() {
    let time_s = times(20.0, 120.0);
    let known = |t: &f64| if (8.0..25.0).contains(t) || (40.0..60.0).contains(t) { f64::NAN } else { trapezoid(*t) };
    let segments = segment(&time_s, &time_s.iter().map(known).collect::<Vec<_>>());
    assert_eq!(phases(&segments), [Hold, Hold, Hold, Retract, Hold]);
    let rows: Vec<_> = segments[..3].iter().map(|segment| segment.rows.clone()).collect();
    assert_eq!(rows[..2], [0..160, 500..800]);
    assert_eq!(rows[2].start, 1200);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    #[test]
    fn segments_cover_all_known_rows_and_neighbours_differ(
        steps in proptest::collection::vec((0.01..1.0_f64, -0.1..0.1_f64, any::<bool>()), 1..200),
    ) {
        let (mut time, mut value) = (0.0, 0.0);
        let (mut time_s, mut strain) = (Vec::new(), Vec::new());
        for (dt, step, missing) in steps {
            time += dt;
            value += step;
            time_s.push(time);
            strain.push(if missing { f64::NAN } else { value });
        }
        let segments = segment(&time_s, &strain);
        for row in (0..strain.len()).filter(|row| strain[*row].is_finite()) {
            prop_assert!(segments.iter().any(|segment| segment.rows.contains(&row)));
        }
        for pair in segments.windows(2) {
            prop_assert!(pair[0].rows.end <= pair[1].rows.start);
            prop_assert!(pair[0].phase != pair[1].phase || pair[0].rows.end < pair[1].rows.start);
            prop_assert!(!pair[0].rows.is_empty() && !pair[1].rows.is_empty());
        }
    }
}
