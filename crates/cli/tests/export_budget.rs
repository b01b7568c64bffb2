//! Smaller filters for smaller chips: they fit, and the C code equals the scored twin, also with faults.

use crate::common::{Bench, Csv};
use crate::export::{DT_S, compile_and_run, compilers, every_filter};

/// Exports with these flags, scored on a recording; returns the output.
fn scored(bench: &Bench, sensor: &str, flags: &[&str], trace: &str, folder: &str) -> String {
    let export = ["export", "--dt-s", DT_S, "--target", "c", "-o", folder, "--force"];
    bench.run(&[&export[..], flags, &["--sensor", sensor, "--score", trace]].concat()).ok()
}

/// Exports within a budget, scored on a recording; returns the output.
fn within(bench: &Bench, sensor: &str, budget: &str, trace: &str, folder: &str) -> String {
    scored(bench, sensor, &["--budget", budget], trace, folder)
}

/// Returns a cell in the row of the exported code.
fn exported(printed: &str, column: usize) -> f64 {
    let row = printed.lines().find(|line| line.contains("| exported")).unwrap();
    row.split('|').nth(column).unwrap().trim().parse().unwrap()
}

/// Columns of its error, percent of full scale, and of its cost.
const ERROR: usize = 2;
const INSTRUCTIONS: usize = 4;
const FLASH: usize = 5;
const RAM: usize = 6;

/// A smaller filter equals its twin to the bit: a quadratic function and fewer rows are summed in the same order in both
/// languages.
#[test]
fn a_smaller_filter_fits_and_is_its_twin() {
    let bench = every_filter();
    for (budget, most, column) in [
        ("lean", 15_000.0, INSTRUCTIONS),
        ("instructions=20000", 20_000.0, INSTRUCTIONS),
        ("flash=24000", 24_000.0, FLASH),
        ("ram=1900", 1900.0, RAM),
    ] {
        let printed = within(&bench, "corrected.toml", budget, "trace.csv", "small");
        assert!(exported(&printed, column) <= most, "{budget}: {printed}");
        assert!(bench.read("small/src/ohmstrain.h").contains("| exported"));
        for compiler in compilers() {
            let sources = ["src/ohmstrain.c", "selftest/selftest.c"];
            let tested = compile_and_run(compiler, &bench.path("small"), &sources, "");
            assert!(tested.starts_with("largest difference: 0 of "), "{budget}, {compiler}: {tested}");
        }
    }
    // Chosen by the table instead of a score: a quadratic function is among the parts that fit.
    let export = ["export", "--sensor", "corrected.toml", "--dt-s", DT_S, "--target", "c", "-o", "small"];
    let printed = bench.run(&[&export[..], &["--budget", "flash=33000"]].concat()).ok();
    assert!(printed.contains("a quadratic function"), "{printed}");
    for compiler in compilers() {
        let sources = ["src/ohmstrain.c", "selftest/selftest.c"];
        let tested = compile_and_run(compiler, &bench.path("small"), &sources, "");
        assert!(tested.starts_with("largest difference: 0 of "), "{compiler}: {tested}");
    }
}

#[test]
fn exceeded_resources_are_reported() {
    let bench = every_filter();
    let export = ["export", "--dt-s", DT_S, "--sensor", "corrected.toml", "-o", "none", "--budget"];
    let c = |budget: &str, more: &[&str]| bench.run(&[&export[..], &[budget], more].concat());
    let nothing = c("instructions=100", &["--target", "c"]);
    assert_eq!(nothing.code, Some(2));
    assert!(
        nothing.stderr.contains("nothing fits; the smallest filter of this sensor takes about"),
        "{}",
        nothing.stderr
    );
    assert!(nothing.stderr.contains(" instructions where 100 are free"), "{}", nothing.stderr);
    assert_eq!(c("lean", &["--target", "c", "--estimator", "ekf"]).code, Some(2));
    assert_eq!(c("fast", &["--target", "c"]).code, Some(2));
    assert!(!bench.path("none").exists());
}

/// All candidates are printed with their costs, and the resource that the next better one exceeds, in the order of the table or
/// of their errors.
#[test]
fn candidates_and_the_limit_of_the_next_better_one_are_printed() {
    let bench = every_filter();
    let export = ["export", "--dt-s", DT_S, "--sensor", "corrected.toml", "--target", "c", "-o", "asked", "--force"];
    let printed = bench.run(&[&export[..], &["--budget", "flash=33000"]].concat()).ok();
    let rows = |fits: &str| printed.lines().filter(|line| line.trim_end().ends_with(fits)).count();
    assert!(rows("| yes  |") > 3 && rows("| no   |") > 3, "{printed}");
    let next = printed.lines().find(|line| line.starts_with("the next better one, ")).unwrap();
    assert!(next.ends_with(" B of flash where 33000 are free"), "{next}");
    let scored = within(&bench, "corrected.toml", "lean", "trace.csv", "asked");
    // The exported filter has the smallest error of those that fit.
    let error = |row: &str| row.split('|').nth(2).unwrap().trim().parse::<f64>().unwrap();
    let fitting = scored.lines().filter(|line| line.trim_end().ends_with("| yes  |")).map(error);
    assert!((fitting.fold(f64::MAX, f64::min) - exported(&scored, ERROR)).abs() < 0.006, "{scored}");
    if let Some(next) = scored.lines().find(|line| line.starts_with("the next better one, ")) {
        assert!(next.ends_with(" instructions where 15000 are free"), "{next}");
    }
    // Without a choice, nothing is printed.
    assert!(!bench.run(&export).ok().contains("candidate"));
}

/// A board has room for half of the time between two readings, and three quarters of its memory; costs are those of its processor.
#[test]
fn a_board_is_a_budget() {
    let bench = every_filter();
    let export = [
        "export",
        "--dt-s",
        DT_S,
        "--sensor",
        "corrected.toml",
        "--target",
        "c",
        "-o",
        "boards",
        "--force",
        "--budget",
    ];
    let within = |budget: &str| bench.run(&[&export[..], &[budget]].concat());
    let printed = within("board=stm32f4").ok();
    // 100 MHz and 0.2 s; 512 KiB and 128 KiB.
    assert!(printed.contains("Black Pill, STM32F411CE") && printed.contains("| room for it there"), "{printed}");
    assert!(printed.contains("10000000") && printed.contains("393216") && printed.contains("98304"), "{printed}");
    // A processor without floating point takes longer for the same filter.
    let rp2040 = within("board=rp2040").ok();
    let instructions = |printed: &str, row: &str| {
        let row = printed.lines().find(|line| line.contains(row)).unwrap();
        row.split('|').nth(INSTRUCTIONS).unwrap().trim().parse::<f64>().unwrap()
    };
    let times = instructions(&rp2040, "RP2040") / instructions(&rp2040, "exported");
    assert!((48.0..49.0).contains(&times), "{rp2040}");
    let unknown = within("board=duo");
    assert_eq!(unknown.code, Some(2));
    assert!(unknown.stderr.contains("no board is called duo; boards: uno, nano"), "{}", unknown.stderr);
}

/// A reading of a recording with a fault.
type Fault = (&'static str, fn(usize, f64) -> f64);

const FAULTS: [Fault; 6] = [
    ("one in fifty a spike of 1.3", |row, ohm| if row % 50 == 0 { 1.3 * ohm } else { ohm }),
    ("every other missing", |row, ohm| if row % 2 == 0 { f64::NAN } else { ohm }),
    ("unplugged for 10 s", |row, ohm| if (700..750).contains(&row) { 1e6 } else { ohm }),
    ("short circuit of 10 s", |row, ohm| if (700..750).contains(&row) { 1.6 } else { ohm }),
    ("half more for 20 s", |row, ohm| if (700..800).contains(&row) { 1.5 * ohm } else { ohm }),
    ("a tenth more from half-way", |row, ohm| if row > 1000 { 1.1 * ohm } else { ohm }),
];

/// The error that `export` prints is that of the compiled program, whatever the readings are.
#[test]
fn the_compiled_program_answers_faults_as_its_twin() {
    let bench = every_filter();
    let trace = Csv::new(&bench.read("trace.csv"));
    let [time_s, ohm, truth] = ["time_s", "resistance_ohm", "strain"].map(|column| trace.numbers(column));
    let range = truth.iter().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(*x), high.max(*x)));
    for (name, fault) in FAULTS {
        let cell = |ohm: f64| if ohm.is_nan() { String::new() } else { ohm.to_string() };
        let row = |k: usize| format!("{},{},{}\n", time_s[k], cell(fault(k, ohm[k])), truth[k]);
        let rows: String = (0..time_s.len()).map(row).collect();
        bench.write("fault.csv", format!("time_s,resistance_ohm,strain\n{rows}"));
        for budget in [&[][..], &["--budget", "lean"]] {
            let promised = exported(&scored(&bench, "corrected.toml", budget, "fault.csv", "faulty"), ERROR);
            for compiler in compilers() {
                let sources = ["src/ohmstrain.c", "selftest/replay.c"];
                let folder = bench.path("faulty");
                let estimates = Csv::new(&compile_and_run(compiler, &folder, &sources, &bench.read("fault.csv")));
                let strain = estimates.numbers("strain");
                let squares: f64 = strain.iter().zip(&truth).map(|(strain, truth)| (strain - truth).powi(2)).sum();
                let found = 100.0 * (squares / truth.len() as f64).sqrt() / (range.1 - range.0);
                println!("{name}, {budget:?}, {compiler}: {found:.2}");
                // Two digits are printed.
                assert!(
                    (found - promised).abs() < 0.006,
                    "{name}, {budget:?}, {compiler}: {found}, promised {promised}"
                );
            }
        }
    }
}
