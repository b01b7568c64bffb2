//! Each protection can be turned off, in exported C as in the program.

use crate::common::{Bench, Csv, change_rows};
use crate::export::{compile_and_run, compilers};

/// Switches that turn off a protection in C, and in the program.
const SWITCHES: [(&str, &[&str]); 5] = [
    ("-DOHMSTRAIN_WITHOUT_PLAUSIBILITY", &["--without", "plausibility"]),
    ("-DOHMSTRAIN_WITHOUT_INFLUENCE", &["--influence", "none"]),
    ("-DOHMSTRAIN_WITHOUT_SECOND_LOOK", &["--without", "second-look"]),
    ("-DOHMSTRAIN_WITHOUT_FOLLOWING", &["--rest-resistance", "calibrated"]),
    ("-DOHMSTRAIN_WITHOUT_DOUBTS", &["--without", "doubts"]),
];

/// Returns a reading with a fault for each of them: an unplugged sensor, spikes, a bad contact, a stuck number, another day.
fn faulty(row: usize, ohm: f64) -> f64 {
    match row {
        800..840 => 210_000.0,
        1200..1260 => 1.3 * ohm,
        2200..2300 => 1700.5,
        3000.. => 1.35 * ohm,
        _ if row.is_multiple_of(97) => 1.5 * ohm,
        _ => ohm,
    }
}

/// Returns strain and its deviation, row by row, without the first row: a chip's first step takes an interval, that of a
/// recording takes no time.
fn estimates(printed: &str) -> Vec<(f64, f64)> {
    let table = Csv::new(printed);
    table.numbers("strain").into_iter().zip(table.numbers("strain_sd")).skip(100).collect()
}

/// Returns the number of rows in which two differ by more than `share` of the deviation.
fn apart(a: &[(f64, f64)], b: &[(f64, f64)], share: f64) -> usize {
    let differ = |((x, sd), (y, other)): (&(f64, f64), &(f64, f64))| {
        (x - y).abs() > share * other || (sd / other - 1.0).abs() > share
    };
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|pair| differ(*pair)).count()
}

#[test]
fn what_is_turned_off_is_off_in_c_as_in_the_program() {
    let bench = Bench::new();
    bench.write("sensor.toml", include_str!("../../../tests/fixtures/representative.toml"));
    bench.run(&["simulate", "--protocol", "mixed", "--sample-rate-hz", "20", "-o", "clean.csv"]).ok();
    let trace = change_rows(&bench.read("clean.csv"), |row, cells| {
        cells[1] = faulty(row, cells[1].parse().unwrap()).to_string();
    });
    let trace: String = trace.lines().take(4500).map(|line| format!("{line}\n")).collect();
    bench.write("faulty.csv", &trace);
    bench.run(&["export", "--sensor", "sensor.toml", "--dt-s", "0.05", "--target", "c", "-o", "c"]).ok();
    let Some(compiler) = compilers().into_iter().next() else { return };
    let run = |switches: &[&str]| {
        let sources = [switches, &["src/ohmstrain.c", "selftest/replay.c"]].concat();
        estimates(&compile_and_run(compiler, &bench.path("c"), &sources, &trace))
    };
    let filter = |flags: &[&str]| {
        let filter = ["--quiet", "filter", "faulty.csv", "--sensor", "sensor.toml"];
        estimates(&bench.run(&[&filter[..], flags].concat()).ok())
    };
    let protected = run(&[]);
    for (switch, flags) in SWITCHES {
        let (exported, program) = (run(&[switch]), filter(flags));
        let (unlike, without) = (apart(&exported, &program, 0.1), apart(&exported, &protected, 0.1));
        println!("{switch}: {unlike} rows unlike the program's, {without} unlike those with it");
        // In a pause the switch of the direction is a polynomial on a chip: a few rows after each differ by more than rounding.
        assert!(unlike <= exported.len() / 50, "{switch}: {unlike} rows");
        assert!(without >= 100, "{switch}: {without} rows");
    }
}
