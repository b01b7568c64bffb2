//! The simulated sensors reproduce published findings on real ones.

use std::fmt::Write as _;

use crate::common::{Bench, Curve, LongHold};
use ohmstrain_bench_data::simulate::{Material, Protocol};

const MATCHED: [Bench; 3] = [
    Bench { material: Material::Ecoflex0030, mismatched: false },
    Bench { material: Material::Ecoflex0050, mismatched: false },
    Bench { material: Material::Vytaflex10, mismatched: false },
];
const MISMATCHED: Bench = Bench { material: Material::Ecoflex0030, mismatched: true };

#[test]
fn hysteresis_grows_with_speed() {
    for bench in MATCHED.into_iter().chain([MISMATCHED]) {
        for elongation_mm in [5.0, 10.0] {
            let areas = [1.0, 2.0, 5.0].map(|speed| bench.loop_areas(elongation_mm, speed));
            // After many cycles, the mismatched sensor has no paths left to break at any speed.
            let cycles = if bench.mismatched { 1 } else { 2 };
            for cycle in 0..cycles {
                let areas = areas.map(|both| both[cycle]);
                assert!(areas[0] * 1.1 < areas[1] && areas[1] * 1.1 < areas[2], "{} {areas:?}", bench.material);
            }
        }
    }
}

#[test]
fn resistance_peaks_near_a_strain_of_0_23_at_1_mm_s() {
    for bench in [MATCHED[0], MATCHED[2]] {
        let (ratio, strain) = bench.ramp_peak(1.0);
        assert!((strain - 0.23).abs() <= 0.03, "{} {strain}", bench.material);
        assert!(ratio > 1.33 && ratio < 1.6, "{ratio}");
    }
}

#[test]
fn ecoflex_00_50_peaks_earlier_and_relaxes_faster() {
    let (_, strain) = MATCHED[1].ramp_peak(5.0);
    assert!((strain - 0.12).abs() <= 0.02, "{strain}");
    assert!(strain < MATCHED[0].ramp_peak(5.0).1 - 0.1);
    let half_life = |bench: Bench| {
        let hold = bench.long_hold(5.0);
        (1..2900).map(|i| f64::from(i) * 0.1).find(|t| hold.lost(*t) > hold.lost(290.0) / 2.0).unwrap()
    };
    assert!(half_life(MATCHED[1]) < 0.6 * half_life(MATCHED[0]));
}

#[test]
fn a_held_resistance_falls_fast_and_then_slowly() {
    for bench in MATCHED.into_iter().chain([MISMATCHED]) {
        let hold = bench.long_hold(5.0);
        let early_per_s = hold.lost(3.0) / 3.0;
        let late_per_s = (hold.lost(90.0) - hold.lost(60.0)) / 30.0;
        assert!(early_per_s > 20.0 * late_per_s && late_per_s > 0.0, "{early_per_s} {late_per_s}");
        let (one, two) = exponential_residuals(&hold);
        assert!(two < 0.4 * one, "{} one {one} two {two}", bench.material);
    }
}

#[test]
fn a_hold_of_290_s_loses_about_a_tenth() {
    for bench in [MATCHED[0], MATCHED[2], MISMATCHED] {
        for speed in [1.0, 5.0] {
            let lost = bench.long_hold(speed).lost(290.0);
            assert!(lost > 0.08 && lost < 0.17, "{lost}");
        }
    }
}

#[test]
fn resistance_peaks_on_release_and_higher_at_higher_speed() {
    let [slow, fast] = [1.0, 5.0].map(|speed| MISMATCHED.long_hold(speed).release_peak());
    for (ratio, strain) in [slow, fast] {
        assert!((1.5..=1.75).contains(&ratio), "{ratio}");
        assert!((0.06..=0.18).contains(&strain), "{strain}");
    }
    assert!(fast.0 > slow.0 + 0.02);
    for bench in MATCHED {
        let hold = bench.long_hold(1.0);
        assert!(hold.release_peak().0 > hold.curve.at(hold.start_s + 290.0) + 0.05, "{}", bench.material);
    }
}

#[test]
fn a_mismatched_sensor_does_not_come_back_to_its_rest_soon() {
    for speed in [1.0, 5.0] {
        let left = MISMATCHED.long_hold(speed).left();
        assert!((0.06..=0.13).contains(&left), "{left}");
    }
}

#[test]
fn resistance_drops_beyond_40_g() {
    for bench in &MATCHED[..2] {
        let settled = settled_by_load(&bench.record(Protocol::LOAD_STEPS, 10.0, 1.0));
        let at = |load_g: usize| settled[load_g / 5 - 1];
        assert!(settled.len() == 15 && at(5) > 1.05);
        for load_g in (40..75).step_by(5) {
            assert!(at(load_g + 5) < at(load_g), "{} {load_g} g {settled:?}", bench.material);
        }
    }
    let settled = settled_by_load(&MATCHED[0].record(Protocol::LOAD_STEPS, 10.0, 1.0));
    let highest = settled.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
    assert!((6..=7).contains(&highest), "highest at {} g", 5 * (highest + 1));
}

/// Returns R/R₀ at the end of each load step, just before the strain rises again.
fn settled_by_load(curve: &Curve) -> Vec<f64> {
    let rising = |i: usize| curve.strain[i + 1] > curve.strain[i];
    let mut out: Vec<f64> = (1..curve.strain.len() - 1)
        .filter(|i| !rising(i - 1) && rising(*i) && curve.strain[*i] > 0.0)
        .map(|i| curve.ratio[i])
        .collect();
    out.extend(curve.ratio.last());
    out
}

/// Returns the root mean square residuals of the best one and the best two exponentials over a constant, over 290 s of
/// hold, by brute force over a grid of time constants.
fn exponential_residuals(hold: &LongHold) -> (f64, f64) {
    let times: Vec<f64> = (0..580).map(|i| 0.5 * f64::from(i)).collect();
    let values: Vec<f64> = times.iter().map(|t| hold.curve.at(hold.start_s + t)).collect();
    let taus: Vec<f64> = (0..24).map(|i| 0.5 * 1.35_f64.powi(i)).collect();
    let basis: Vec<Vec<f64>> = taus.iter().map(|tau| times.iter().map(|t| (-t / tau).exp()).collect()).collect();
    let constant = vec![1.0; times.len()];
    let (mut one, mut two) = (f64::INFINITY, f64::INFINITY);
    for i in 0..taus.len() {
        one = one.min(residual(&values, &[&constant, &basis[i]]));
        for j in i + 1..taus.len() {
            two = two.min(residual(&values, &[&constant, &basis[i], &basis[j]]));
        }
    }
    (one, two)
}

/// Returns the root mean square of the part of `values` that Gram-Schmidt leaves.
fn residual(values: &[f64], basis: &[&Vec<f64>]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut orthogonal: Vec<Vec<f64>> = Vec::new();
    let without = |mut vector: Vec<f64>, orthogonal: &[Vec<f64>]| {
        for direction in orthogonal {
            let share = dot(&vector, direction) / dot(direction, direction);
            vector.iter_mut().zip(direction).for_each(|(x, d)| *x -= share * d);
        }
        vector
    };
    for vector in basis {
        let direction = without((*vector).clone(), &orthogonal);
        orthogonal.push(direction);
    }
    let rest = without(values.to_vec(), &orthogonal);
    (dot(&rest, &rest) / values.len() as f64).sqrt()
}

/// The command `OHMSTRAIN_UPDATE=1 cargo test -p ohmstrain-bench-data --test all findings::` rewrites the table.
#[test]
fn the_table_in_the_documentation_is_what_the_simulator_does() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/preset-findings.md");
    let table = table();
    if std::env::var_os("OHMSTRAIN_UPDATE").is_some() {
        std::fs::write(path, &table).unwrap();
    }
    assert_eq!(std::fs::read_to_string(path).unwrap(), table);
}

fn table() -> String {
    let mut out = String::from(
        "| sensor, 10 mm at 1 / 5 mm/s | peak of R/R₀ while stretching, at strain | loop area, sixth cycle | \
         lost in a 290 s hold, of it in 5 s | peak on release, at strain | left after 290 s of rest |\n\
         |---|---|---|---|---|---|\n",
    );
    for mismatched in [false, true] {
        for material in Material::ALL {
            let bench = Bench { material, mismatched };
            let speeds = [1.0, 5.0];
            let both = |text: &dyn Fn(f64) -> String| speeds.map(text).join(" / ");
            let peak = both(&|speed| format_peak(bench.ramp_peak(speed)));
            let area = both(&|speed| format!("{:.3}", bench.loop_areas(10.0, speed)[1]));
            let holds = speeds.map(|speed| bench.long_hold(speed));
            let lost =
                holds.each_ref().map(|h| format!("{:.0} %, {:.0} %", 100.0 * h.lost(290.0), 100.0 * h.lost(5.0)));
            let release = holds.each_ref().map(|hold| format_peak(hold.release_peak()));
            let left = holds.each_ref().map(|hold| format!("{:.0} %", 100.0 * hold.left()));
            let name = if mismatched { format!("{material}, mismatched") } else { material.to_string() };
            let cells = [name, peak, area, lost.join(" / "), release.join(" / "), left.join(" / ")];
            writeln!(out, "| {} |", cells.join(" | ")).unwrap();
        }
    }
    out
}

fn format_peak((ratio, strain): (f64, f64)) -> String {
    format!("{ratio:.2} at {strain:.2}")
}
