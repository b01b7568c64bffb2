//! `evaluate` with its own calibration: on the first rows of a recording, or on other recordings.

use crate::common::{Bench, CALIBRATED_UNTIL, Csv, SIMULATE, change_rows, first_rows};
use serde_json::Value;

/// The names of the baselines in JSON, sorted.
const BASELINES: [&str; 5] = ["fir_20s", "leaky_bank", "low_pass_mode", "relaxing_modulus", "static_cubic"];

/// A folder with a simulated recording of 400 s per seed: `1.csv`, `2.csv` and so on.
fn simulated(seeds: &[&str]) -> Bench {
    simulated_for("400", seeds)
}

/// The same with recordings of this length, s.
fn simulated_for(duration_s: &str, seeds: &[&str]) -> Bench {
    let bench = Bench::new();
    for &seed in seeds {
        let of = ["--duration-s", duration_s, "--seed", seed];
        bench.run(&[&SIMULATE[..], &of, &["-o", &format!("{seed}.csv")]].concat()).ok();
    }
    bench
}

/// `recordings` of the JSON that `evaluate` prints.
fn evaluate(bench: &Bench, arguments: &[&str]) -> Vec<Value> {
    let run = bench.run(&[&["evaluate", "--json"], arguments].concat());
    assert!(run.warnings.is_empty() || arguments.contains(&"--sensor"), "{:?}", run.warnings);
    let json: Value = serde_json::from_str(&run.ok()).unwrap();
    json["recordings"].as_array().unwrap().clone()
}

fn number(value: &Value, name: &str) -> f64 {
    value[name].as_f64().unwrap_or_else(|| panic!("{name} in {value}"))
}

/// Asserts that the same estimates are scored on the same rows, apart from fields that only one of the two ways reports.
#[track_caller]
fn assert_same_scores(a: &Value, b: &Value) {
    let scores = ["n", "rmse", "mae", "bias", "coverage_50", "coverage_90", "coverage_95", "log_score", "wrong_branch"];
    for name in scores {
        assert_eq!(a[name], b[name], "{name}");
        assert_eq!(a["smoother"][name], b["smoother"][name], "smoother {name}");
    }
    assert_eq!(a["baselines"]["static_cubic"], b["baselines"]["static_cubic"]);
}

#[test]
fn a_split_is_a_calibration_on_the_first_rows_and_scores_of_the_rest() {
    let bench = simulated(&["1"]);
    let trace = Csv::new(&bench.read("1.csv"));
    // 30 % of 2001 rows are 600.3.
    let (rows, from) = (600, trace.cells("time_s")[600].to_owned());
    assert_eq!(trace.len(), 2001);
    let split = evaluate(&bench, &["--split", "0.3", "--estimator", "ekf", "1.csv"]);
    // With --until the sensor would cover the errors of its test.
    bench.write("first.csv", first_rows(&bench.read("1.csv"), rows));
    bench.run(&["calibrate", "first.csv", "--estimator", "ekf", "-o", "sensor.toml"]).ok();
    let by_hand = evaluate(&bench, &["1.csv", "--sensor", "sensor.toml", "--from", &from]);
    assert_eq!(split.len(), 1);
    assert_eq!(split[0]["n"], trace.len() - rows);
    assert_eq!(split[0]["estimator"], "ekf");
    assert_same_scores(&split[0], &by_hand[0]);

    let baselines = split[0]["baselines"].as_object().unwrap();
    assert_eq!(baselines.keys().collect::<Vec<_>>(), BASELINES);
    assert!(number(&split[0], "calibration_s") > 0.0);
    assert!(number(&split[0], "lag_s").abs() <= 1.0);
    assert!(by_hand[0]["calibration_s"].is_null() && by_hand[0].get("lag_s").is_none());
}

/// Known strains from the reference add two scores, with a smaller error of the smoother; the score without them is unchanged.
#[test]
fn known_strains_are_scored_beside() {
    let bench = Bench::calibrated();
    let flags = ["trace.csv", "--sensor", "sensor.toml", "--from", CALIBRATED_UNTIL];
    let alone = evaluate(&bench, &flags);
    let with_known = evaluate(&bench, &[&flags[..], &["--known-every", "5"]].concat());
    let names: Vec<&Value> = with_known.iter().map(|scores| &scores["known"]).collect();
    assert_eq!(names, [&Value::Null, &Value::from("known every 5 s"), &Value::from("rest and stretch known")]);
    assert_same_scores(&with_known[0], &alone[0]);
    assert!(number(&with_known[1]["smoother"], "rmse") < number(&with_known[0]["smoother"], "rmse"));
    let table = bench.run(&[&["evaluate", "--known-every", "5"], &flags[..]].concat()).ok();
    assert!(table.contains("ekf, known every 5 s") && table.contains("known: the reference told"), "{table}");
}

/// Holds of five minutes, of a sensor outside the family of laws and of one within. Before the prediction started from the
/// reading, the error was 13 and 6 times that of the reading itself, and the interval contained 31 % of the last readings of
/// the second.
#[test]
fn settled_readings_are_compared_with_the_ends_of_holds() {
    let bench = Bench::calibrated();
    let sensors = [
        ("mismatched.csv", &["--material", "representative", "--mismatched"][..], 1.5),
        ("matched.csv", &["--material", "ecoflex-00-30"], 2.0),
    ];
    for (file, of, most) in sensors {
        let simulate = ["simulate", "--protocol", "long-holds", "--sample-rate-hz", "2", "-o", file];
        bench.run(&[&simulate[..], of].concat()).ok();
        let settled = evaluate(&bench, &["--split", "0.5", "--estimator", "ekf", file])[0]["settled"].clone();
        assert!(number(&settled, "coverage_95") >= 0.9, "{settled}");
        assert!(number(&settled, "rmse") <= most * number(&settled, "reading_rmse"), "{settled}");
        assert!(number(&settled, "holds") >= 5.0 && number(&settled, "n") > 1000.0, "{settled}");
    }
    let table = bench.run(&["evaluate", "matched.csv", "--sensor", "sensor.toml"]).ok();
    assert!(table.contains("settled resistance against the last reading of a hold"), "{table}");
}

/// Two shares, and the halves exchanged: the same as each on its own, and the summary follows from the cases.
#[test]
fn several_splits_are_summed_up() {
    let bench = simulated(&["1"]);
    let flags = ["evaluate", "--json", "--estimator", "ekf", "1.csv", "--splits"];
    let run =
        |splits: &str| -> Value { serde_json::from_str(&bench.run(&[&flags[..], &[splits]].concat()).ok()).unwrap() };
    let all = run("0.4,0.6,reversed");
    assert_eq!(&all["schema"], &Value::from(3));
    assert!(all["simulated_seed"] == 1 && (all["commit"].is_null() || all["commit"].is_string()));
    assert!(all["made_by"].as_str().unwrap().starts_with("ohmstrain "));
    let cases = all["recordings"].as_array().unwrap();
    assert_eq!(cases.iter().map(|case| &case["split"]).collect::<Vec<_>>(), ["0.4", "0.6", "0.5:reversed"]);
    assert!(cases.iter().all(|case| case["sha256"].as_str().unwrap().len() == 64));
    // 40 and 60 % of 2001 rows are 800.4 and 1200.6; the first half ends where the last 1000 rows begin.
    assert_eq!(cases.iter().map(|case| case["n"].as_u64().unwrap()).collect::<Vec<_>>(), [1201, 801, 1001]);
    assert_same_scores(&cases[0], &run("0.4")["recordings"][0]);

    let of = |estimate: &str| {
        let summary = all["summary"].as_array().unwrap();
        summary.iter().find(|row| row["estimate"] == estimate).unwrap().clone()
    };
    let ratios = cases.iter().map(|case| number(case, "rmse") / number(&case["baselines"]["static_cubic"], "rmse"));
    let ratios: Vec<f64> = ratios.collect();
    let mean = |name: &str| cases.iter().map(|case| number(case, name)).sum::<f64>() / 3.0;
    let filter = of("ekf");
    assert!((number(&filter, "ratio") - ratios.iter().product::<f64>().cbrt()).abs() < 1e-12);
    let percent: f64 = cases.iter().map(|case| number(case, "rmse_percent_fs")).product();
    assert!((number(&filter, "percent_fs") - percent.cbrt()).abs() < 1e-12);
    // A number read back from JSON may differ in its last bit.
    let worst = ratios.iter().copied().fold(0.0, f64::max);
    assert!((number(&filter, "worst_ratio") - worst).abs() < 1e-12);
    for name in ["crps_percent_fs", "width_95_percent_fs", "coverage_50", "coverage_90", "coverage_95"] {
        assert!((number(&filter, name) - mean(name)).abs() < 1e-9, "{name}");
    }
    let cubic = of("static cubic");
    assert!((number(&cubic, "ratio") - 1.0).abs() < 1e-12 && cubic["width_95_percent_fs"].is_null());
    assert_eq!(of("ekf, smoother")["cases"], 3);
}

#[test]
fn nothing_but_the_scores_depends_on_the_reference_of_the_test_rows() {
    let bench = simulated(&["1"]);
    let shift = 0.01;
    let moved = change_rows(&bench.read("1.csv"), |row, cells| {
        if row >= 1000 {
            cells[2] = (cells[2].parse::<f64>().unwrap() + shift).to_string();
        }
    });
    bench.write("moved.csv", moved);
    let scores = evaluate(&bench, &["--split", "0.5", "--estimator", "ekf", "1.csv", "moved.csv"]);
    // Mean of 1001 differences of rounded numbers of order 0.1.
    let shifted = |plain: &Value, moved: &Value| {
        assert!((number(plain, "bias") - shift - number(moved, "bias")).abs() < 1e-12, "{plain} {moved}");
    };
    shifted(&scores[0], &scores[1]);
    shifted(&scores[0]["smoother"], &scores[1]["smoother"]);
    for name in BASELINES {
        shifted(&scores[0]["baselines"][name], &scores[1]["baselines"][name]);
    }
}

#[test]
fn some_recordings_train_and_others_test() {
    let bench = simulated_for("120", &["1", "2", "3"]);
    let train = ["--train", "1.csv", "--train", "2.csv", "--estimator", "ekf"];
    let tested = evaluate(&bench, &[&train[..], &["--test", "3.csv", "--test", "1.csv"]].concat());
    bench.run(&["calibrate", "1.csv", "2.csv", "--estimator", "ekf", "-o", "sensor.toml"]).ok();
    let by_hand = evaluate(&bench, &["3.csv", "1.csv", "--sensor", "sensor.toml"]);
    assert_eq!(tested.iter().map(|scores| &scores["file"]).collect::<Vec<_>>(), ["3.csv", "1.csv"]);
    for (tested, by_hand) in tested.iter().zip(&by_hand) {
        assert_eq!(tested["n"], 601);
        assert_same_scores(tested, by_hand);
        assert_eq!(tested["baselines"].as_object().unwrap().len(), BASELINES.len());
        assert!(number(tested, "calibration_s") > 0.0 && tested.get("lag_s").is_none());
    }
    // Scoring from a time on means fewer rows, not another run.
    let later = evaluate(&bench, &[&train[..], &["--test", "3.csv", "--from", "60"]].concat());
    let by_hand = evaluate(&bench, &["3.csv", "--sensor", "sensor.toml", "--from", "60"]);
    assert_same_scores(&later[0], &by_hand[0]);
}

/// Each recording is scored as with the two others in --train; a single recording has no others.
#[test]
fn each_recording_is_left_out_in_turn() {
    let bench = simulated_for("120", &["1", "2", "3"]);
    let all = evaluate(&bench, &["--leave-one-out", "--estimator", "ekf", "1.csv", "2.csv", "3.csv"]);
    assert_eq!(all.iter().map(|scores| &scores["file"]).collect::<Vec<_>>(), ["1.csv", "2.csv", "3.csv"]);
    let by_hand = evaluate(&bench, &["--train", "1.csv", "--train", "3.csv", "--test", "2.csv", "--estimator", "ekf"]);
    assert_eq!(all[1]["split"], "left out");
    assert_same_scores(&all[1], &by_hand[0]);
    bench
        .run(&["evaluate", "--leave-one-out", "1.csv"])
        .fails(2, "--leave-one-out: expected two recordings or more, found one");
}

#[test]
fn the_table_has_filter_smoother_and_all_baselines_per_recording() {
    let bench = simulated(&["1", "2"]);
    let printed = bench.run(&["evaluate", "--split", "0.5", "--estimator", "ekf", "1.csv", "2.csv"]).ok();
    assert!(printed.lines().all(|line| line.chars().count() <= 100), "{printed}");
    let cells = |line: &str| -> Vec<String> { line.split('|').map(|cell| cell.trim().to_owned()).collect() };
    let tables: Vec<Vec<Vec<String>>> = printed
        .split("\n\n")
        .map(|block| block.lines().filter(|line| line.starts_with('|')).map(cells).collect())
        .filter(|table: &Vec<Vec<String>>| !table.is_empty())
        .collect();
    let names = ["ekf", "smoother", "static cubic", "20 s FIR", "low-pass mode", "leaky bank", "published law"];
    // A table per recording, then one of all cases.
    assert_eq!(tables.len(), 3, "{printed}");
    for table in &tables[..2] {
        for column in ["RMSE", "MAE", "%FS", "bias", "50/90/95 %", "width", "CRPS", "log", "wrong"] {
            assert!(table[0].iter().any(|name| name == column), "{column}: {printed}");
        }
        assert!(table[2..].iter().zip(names).all(|(row, name)| row[1] == name), "{printed}");
        assert_eq!(table.len(), 2 + names.len(), "{printed}");
    }
    assert!(tables[2][2..].iter().zip(["ekf", "ekf, smoother"]).all(|(row, name)| row[1] == name && row[2] == "2"));
    for heading in ["1.csv 0.5: errors in strain, calibrated in ", "2.csv 0.5: errors in strain, calibrated in "] {
        assert!(printed.lines().any(|line| line.starts_with(heading) && line.ends_with(" s late")), "{printed}");
    }
}

#[test]
fn all_estimators_of_a_sensor_file_are_those_it_has_parameters_for() {
    let bench = simulated_for("60", &["1"]);
    bench.run(&["calibrate", "1.csv", "--until", CALIBRATED_UNTIL, "--estimator", "ukf", "-o", "sensor.toml"]).ok();
    let scores = evaluate(&bench, &["1.csv", "--sensor", "sensor.toml", "--estimator", "all"]);
    assert_eq!(scores.iter().map(|scores| &scores["estimator"]).collect::<Vec<_>>(), ["ekf", "ukf", "static-cubic"]);
    let alone = evaluate(&bench, &["1.csv", "--sensor", "sensor.toml", "--estimator", "ekf"]);
    assert_same_scores(&scores[0], &alone[0]);
}

#[test]
fn what_was_scored_before_an_error_is_printed() {
    let bench = simulated_for("120", &["1"]);
    let run = bench.run(&["evaluate", "--split", "0.5", "--estimator", "ekf", "1.csv", "none.csv"]);
    assert_eq!(run.code, Some(1));
    assert!(run.stderr.starts_with("ohmstrain: cannot read none.csv"), "{}", run.stderr);
    assert!(run.stdout.contains("1.csv") && run.stdout.contains("leaky bank"), "{}", run.stdout);
}

#[test]
fn check_holds_a_split_to_the_same_promise() {
    let bench = simulated_for("120", &["1"]);
    // Strains that the sensor never had, several deviations from those that it had.
    let other = change_rows(&bench.read("1.csv"), |row, cells| {
        if row >= 300 {
            cells[2] = (cells[2].parse::<f64>().unwrap() + 1.0).to_string();
        }
    });
    bench.write("other.csv", other);
    let run = bench.run(&["evaluate", "--split", "0.5", "--estimator", "ekf", "--check", "other.csv"]);
    assert_eq!(run.code, Some(3), "{}", run.stderr);
    assert!(run.stderr.starts_with("ohmstrain: other.csv: "), "{}", run.stderr);
    assert!(run.stdout.contains("static cubic"));
}

#[test]
fn arguments_that_contradict_each_other_are_refused() {
    let bench = Bench::new();
    let cases: &[(&[&str], &str)] = &[
        (&["1.csv"], "--sensor"),
        (&["--split", "0.5"], "TRACES"),
        (&["1.csv", "--split", "0"], "'0' for '--split"),
        (&["1.csv", "--split", "1"], "'1' for '--split"),
        (&["1.csv", "--split", "NaN"], "'NaN' for '--split"),
        (&["1.csv", "--split", "0.5", "--sensor", "s.toml"], "cannot be used with"),
        (&["1.csv", "--split", "0.5", "--from", "3"], "cannot be used with"),
        (&["--train", "1.csv"], "--test"),
        (&["--test", "1.csv"], "--train"),
        (&["1.csv", "--train", "1.csv", "--test", "2.csv"], "cannot be used with"),
        (&["--test", "1.csv", "--sensor", "s.toml"], "cannot be used with"),
        (&["1.csv", "--split", "0.5", "--estimator", "tarot"], "'tarot' for '--estimator"),
    ];
    for (arguments, culprit) in cases {
        let run = bench.run(&[&["evaluate"], *arguments].concat());
        assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""), "{}: {}", run.command, run.stderr);
        assert!(run.stderr.contains(culprit), "{}: {}", run.command, run.stderr);
    }
}
