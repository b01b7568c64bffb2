//! Recordings with temperatures: calibration, filter, and exported code.

use std::path::PathBuf;
use std::sync::OnceLock;

use crate::common::{Bench, Csv, change_rows};
use crate::export::{compile_and_run, compilers};

/// Returns a folder with a sensor of the fastest estimator, calibrated in a climate chamber, and its recording with and without the column
/// of temperatures, made once.
fn chamber() -> Bench {
    static FILES: OnceLock<Vec<(String, String)>> = OnceLock::new();
    Bench::with(FILES.get_or_init(|| {
        let bench = Bench::new();
        let simulate =
            "simulate --protocol mixed --duration-s 1200 --sample-rate-hz 2 --speed-mm-s 5 --material representative";
        let words: Vec<&str> = simulate.split(' ').collect();
        bench.run(&[&words[..], &["--chamber", "period_s=400 rest_per_k=0.004", "-o", "trace.csv"]].concat()).ok();
        let blind = |line: &str| match line.rsplit_once(',') {
            Some((left, _)) if !line.starts_with('#') => left.to_owned(),
            _ => line.to_owned(),
        };
        bench.write("blind.csv", bench.read("trace.csv").lines().map(blind).collect::<Vec<_>>().join("\n"));
        let calibrate = ["calibrate", "trace.csv", "-o", "sensor.toml", "--estimator", "ekf", "--branches", "1"];
        let closing = bench.run(&calibrate).ok();
        assert!(closing.contains("Temperature") && closing.contains("converted to 25"), "{closing}");
        bench.contents()
    }))
}

fn coefficient(bench: &Bench, name: &str) -> f64 {
    let sensor: toml::Table = bench.read("sensor.toml").parse().unwrap();
    sensor["temperature"][name].as_float().unwrap()
}

#[test]
fn readings_are_those_at_one_temperature_and_exported_code_converts_them_as_well() {
    let bench = chamber();
    let [rest, gain, reference, r0] = [
        coefficient(&bench, "rest_per_k"),
        coefficient(&bench, "gain_per_k"),
        coefficient(&bench, "reference_c"),
        bench.read("sensor.toml").parse::<toml::Table>().unwrap()["rest_reading"].as_float().unwrap(),
    ];
    let converted = |ohm: f64, celsius: f64| {
        let above_k = celsius - reference;
        r0 + (ohm / (1.0 + rest * above_k) - r0) / (1.0 + gain * above_k)
    };
    let trace = Csv::new(&bench.read("trace.csv"));
    let (ohm, celsius) = (trace.numbers("resistance_ohm"), trace.numbers("temperature_c"));
    for command in ["filter", "smooth"] {
        let run = bench.run(&[command, "trace.csv", "--sensor", "sensor.toml"]);
        assert!(
            run.code == Some(0) && run.warnings.iter().all(|line| !line.contains("temperature")),
            "{:?}",
            run.warnings
        );
        let rows = Csv::new(&run.stdout);
        let found = rows.numbers("resistance_ohm");
        assert!(found.len() == ohm.len());
        for (k, found) in found.iter().enumerate() {
            assert!((found - converted(ohm[k], celsius[k])).abs() < 1e-3, "{command}, row {k}");
        }
        let blind = bench.run(&[command, "blind.csv", "--sensor", "sensor.toml"]);
        let warning = "blind.csv: no column `temperature_c`: intervals are wider";
        assert!(blind.warnings.iter().any(|line| line.contains(warning)), "{:?}", blind.warnings);
        let (with, without) = (rows.numbers("strain_sd"), Csv::new(&blind.stdout).numbers("strain_sd"));
        // Added to the variance of each row; the readings are others, and so is the rest of it.
        let mean = |sd: &[f64]| sd.iter().sum::<f64>() / sd.len() as f64;
        assert!(mean(&without) > mean(&with), "{command}: {} {}", mean(&without), mean(&with));
    }
    bench.run(&["export", "--sensor", "sensor.toml", "--target", "c", "--dt-s", "0.5", "-o", "c"]).ok();
    bench.write(
        "c/main.c",
        "#include <stdio.h>\n#include \"ohmstrain.h\"\nint main(void) { printf(\"%.9g %.9g\", \
         (double)ohmstrain_at_reference(1900.0f, 38.5f), (double)ohmstrain_at_reference(1900.0f, NAN)); return 0; }\n"
            .replace("<stdio.h>", "<math.h>\n#include <stdio.h>"),
    );
    for compiler in compilers() {
        let folder: PathBuf = bench.path("c");
        let printed = compile_and_run(compiler, &folder, &["src/ohmstrain.c", "main.c"], "");
        let numbers: Vec<f64> = printed.split(' ').map(|number| number.parse().unwrap()).collect();
        // A few roundings of single precision.
        assert!((numbers[0] / converted(1900.0, 38.5) - 1.0).abs() < 1e-6 && numbers[1] == 1900.0, "{printed}");
    }
}

#[test]
fn coefficients_can_be_given_and_are_checked() {
    let bench = chamber();
    let calibrate =
        ["calibrate", "trace.csv", "--until", "800", "-o", "given.toml", "--estimator", "ekf", "--branches", "1"];
    bench.run(&[&calibrate[..], &["--temperature", "0.0035:0.0002,-0.001:0.0005"]].concat()).ok();
    let sensor: toml::Table = bench.read("given.toml").parse().unwrap();
    assert_eq!(sensor["temperature"]["rest_per_k"].as_float(), Some(0.0035));
    assert_eq!(sensor["temperature"]["gain_per_k_sd"].as_float(), Some(0.0005));
    for wrong in ["0.0035", "a:b", "0.5:0.1", "0.003:-1"] {
        let run = bench.run(&[&calibrate[..], &["--temperature", wrong]].concat());
        assert!(run.code == Some(2) && run.stderr.contains("expected A:SD or A:SD,B:SD"), "{wrong}: {}", run.stderr);
    }
    let blind = ["calibrate", "blind.csv", "-o", "given.toml", "--temperature", "0.0035:0.0002"];
    let run = bench.run(&blind);
    assert!(
        run.code == Some(2) && run.stderr.contains("expected recordings that all have temperatures"),
        "{}",
        run.stderr
    );
}

#[test]
fn scores_do_not_depend_on_implausible_temperatures() {
    let bench = chamber();
    for (name, cell) in [("unplugged.csv", "-127"), ("missing.csv", "")] {
        let changed = change_rows(&bench.read("trace.csv"), |row, cells| {
            if row % 400 > 300 {
                *cells.last_mut().unwrap() = cell.to_owned();
            }
        });
        bench.write(name, changed);
    }
    let scores = |name: &str| {
        let run = bench.run(&["evaluate", name, "--sensor", "sensor.toml", "--json"]);
        let json: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
        ["rmse", "coverage_95", "smoother"].map(|name| json["recordings"][0][name].clone())
    };
    assert!(scores("missing.csv")[0].is_number());
    assert_eq!(scores("unplugged.csv"), scores("missing.csv"));
}

/// The first rows after the interruption have no temperature: the last one of the earlier stream applies.
#[test]
fn a_resumed_filter_keeps_the_last_temperature() {
    let bench = chamber();
    let text = bench.read("trace.csv");
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let first = lines.iter().position(|line| line.starts_with("time_s")).unwrap() + 1;
    let (cut, header) = (first + 1000, lines[..first].join("\n"));
    for line in &mut lines[cut..cut + 3] {
        let (left, _) = line.rsplit_once(',').unwrap();
        *line = format!("{left},");
    }
    bench.write("whole.csv", lines.join("\n"));
    bench.write("early.csv", lines[..cut].join("\n"));
    bench.write("late.csv", format!("{header}\n{}", lines[cut..].join("\n")));
    let filter = |words: &[&str]| bench.run(&[&["filter", "--sensor", "sensor.toml"], words].concat()).ok();
    let whole = filter(&["whole.csv"]);
    let early = filter(&["early.csv", "--save-state", "state.toml"]);
    let late = filter(&["late.csv", "--resume", "state.toml"]);
    let rows = |text: &str| text.lines().skip(1).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(rows(&whole), [rows(&early), rows(&late)].concat());
}
