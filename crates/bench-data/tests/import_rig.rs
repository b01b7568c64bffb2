//! Files of a rig that is recognised by its columns: two rows per reading, a position with its own clock.

use std::fmt::Write as _;

use ohmstrain_bench_data::import::{Plan, Preset, Recipe};

use crate::import_files::{proposed, tables};

/// The rig's irregular steps, s.
const STEPS: [f64; 5] = [0.08, 0.08, 0.08, 0.125, 0.19];

/// Returns a file of the rig: resistance rises by 10 Ω a second, the position goes up and down with corners every fifty
/// rows.
fn rig(rows: usize, spurious: &[usize]) -> String {
    let mut out = String::new();
    for (row, time) in times(rows).into_iter().enumerate() {
        let sign = if row % 2 == 0 { 1.0 } else { -1.0 };
        let inner = -(1600.0 + 10.0 * time + 12.0 * sign);
        let position = if spurious.contains(&row) { -0.0 } else { -position(row) };
        writeln!(out, "39000,{inner},{time},{position},{},0.5,{}", time + 0.03, time + 0.05).unwrap();
    }
    out
}

fn times(rows: usize) -> Vec<f64> {
    STEPS
        .iter()
        .cycle()
        .take(rows)
        .scan(0.0, |time, step| {
            *time += step;
            Some(*time)
        })
        .collect()
}

/// Returns the position, mm, linear between rows that are multiples of fifty.
fn position(row: usize) -> f64 {
    let times = times(row / 50 * 50 + 51);
    let (from, to) = (row / 50 * 50, row / 50 * 50 + 50);
    let share = (times[row] - times[from]) / (times[to] - times[from]);
    12.0 * if (row / 50).is_multiple_of(2) { share } else { 1.0 - share }
}

#[test]
fn a_rig_without_header_is_folded_and_interpolated() {
    let spurious = [20, 31, 77, 78 + 50, 160];
    let text = rig(200, &spurious);
    let table = tables(&[("rig.csv", text.clone().into())], &Recipe::default()).unwrap();
    assert_eq!(Preset::that_fits(&table[0]), Some(Preset::ElectromechStretcher));
    let imports = Plan::new(&table, &Recipe::default()).unwrap_err().to_string();
    assert!(imports.contains("--preset electromech-stretcher"), "{imports}");
    let (recipe, imported) = proposed(&[("rig.csv", text.into())], &Recipe::default()).unwrap();
    assert_eq!(recipe.arguments(), ["--preset", "electromech-stretcher"]);
    let trace = &imported.trace;
    let (times, strain) = (times(200), &trace.reference.as_ref().unwrap().values);
    assert_eq!(trace.len(), 199);
    let corner = |k: usize| [0, 49].contains(&(k % 50));
    for k in 0..199 {
        let time = 0.5 * (times[k] + times[k + 1]);
        // Sums of numbers up to 2000 and 30, printed to 17 digits, are accurate to a few units in the last place.
        assert!((trace.time_s[k] - time).abs() < 1e-13);
        assert!((trace.readings.values[k] - (1600.0 + 10.0 * time)).abs() < 2e-12, "row {k}");
        // The position's clock is 0.03 s late; away from corners the position is that of the motion at its own time.
        if k > 0 && !corner(k) {
            let (a, b) = (times[k] + 0.03, times[k + 1] + 0.03);
            let exact = position(k) + (position(k + 1) - position(k)) * (time - a) / (b - a);
            assert!((strain[k] - exact / 40.0).abs() < 1e-13, "row {k}: {} {}", strain[k], exact / 40.0);
        }
    }
    assert!(imported.remarks.iter().any(|remark| remark.contains("5 zeros")), "{:?}", imported.remarks);
}
