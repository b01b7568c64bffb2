//! Batches of recordings: their results, repetitions, and refusals.

use std::fs;

use crate::common::{Bench, Csv};

/// Returns a folder with recordings of the same readings at other times, a sensor, and two files that are not recordings.
fn folder() -> Bench {
    let bench = Bench::calibrated();
    let trace = bench.read("trace.csv");
    fs::create_dir_all(bench.path("in/day 2")).unwrap();
    for (name, rows) in [("in/a.csv", 400), ("in/b.csv", 500), ("in/day 2/a.csv", 600)] {
        bench.write(name, trace.lines().take(rows).map(|line| format!("{line}\n")).collect::<String>());
    }
    bench
}

const SMOOTH: [&str; 9] = ["-q", "batch", "smooth", "--sensor", "sensor.toml", "-o", "out", "--glob", "in/**/*.csv"];

/// Returns the rows of a summary in JSON, one per recording.
fn summary(bench: &Bench) -> Vec<serde_json::Value> {
    serde_json::from_str(&bench.read("out/summary.json")).unwrap()
}

#[test]
fn outputs_are_those_of_the_command() {
    let bench = folder();
    let flags = ["--", "--gate", "10.8", "--columns", "time_s,strain,flags"];
    bench.run(&[&SMOOTH[..], &["--jobs", "2"], &flags].concat()).ok();
    for name in ["a.csv", "b.csv", "day 2/a.csv"] {
        let input = format!("in/{name}");
        let single = bench.run(&[&["smooth", &input, "--sensor", "sensor.toml"], &flags[1..]].concat()).ok();
        assert_eq!(bench.read(&format!("out/{name}")), single, "{name}");
    }
    let text = bench.read("out/summary.csv");
    assert_eq!(text.lines().count(), 4, "{text}");
    assert!(text.lines().skip(1).all(|row| row.contains(",done,")), "{text}");
}

#[test]
fn bad_recordings_leave_the_others_alone() {
    let bench = folder();
    bench.write("in/c.csv", "time_s,resistance_ohm\n0,1600\n1,oops\n");
    bench.write("in/d.csv", [0, 159, 146, 150]);
    let run = bench.run(&[&SMOOTH[..], &["--summary", "json"]].concat());
    assert_eq!(run.code, Some(5), "{}", run.stderr);
    assert!(run.stderr.contains("in/c.csv:3: column `resistance_ohm`"), "{}", run.stderr);
    assert!(run.stderr.contains("3 done, 0 done before, 2 failed"), "{}", run.stderr);
    let rows = summary(&bench);
    let states: Vec<_> =
        rows.iter().map(|row| (row["file"].as_str().unwrap(), row["state"].as_str().unwrap())).collect();
    let expected = [("in/a.csv", "done"), ("in/b.csv", "done"), ("in/c.csv", "failed"), ("in/d.csv", "failed")];
    assert_eq!(states[..4], expected);
    assert_eq!((rows[2]["exit_code"].as_i64(), rows[2]["output_sha256"].as_str()), (Some(4), None));
    assert!(bench.path("out/b.csv").is_file() && !bench.path("out/c.csv").exists());
    let left = fs::read_dir(bench.path("out"))
        .unwrap()
        .filter(|found| found.as_ref().unwrap().file_name().to_string_lossy().starts_with('.'));
    assert_eq!(left.count(), 0, "drafts go");
}

/// Recordings that are processed at the same time keep their own warnings, in the command's words.
#[test]
fn warnings_are_their_own_recordings() {
    let bench = folder();
    let beyond: String = (0..200).map(|second| format!("{},20000,0\n", 90_000 + second)).collect();
    bench.write("in/b.csv", bench.read("in/b.csv") + &beyond);
    bench.run(&[&SMOOTH[..], &["--summary", "json", "--jobs", "3"]].concat()).ok();
    let printed = bench.run(&["smooth", "in/b.csv", "--sensor", "sensor.toml"]).warnings;
    let printed: Vec<&str> =
        printed.iter().map(|line| line.trim_end().trim_start_matches("ohmstrain: warning: ")).collect();
    let warnings = |row: &serde_json::Value| row["warnings"].as_str().map(str::to_owned);
    let rows = summary(&bench);
    assert_eq!(warnings(&rows[1]), Some(printed.join("; ")));
    assert!(
        printed
            .iter()
            .any(|printed| printed.starts_with("in/b.csv: at 900") && printed.contains("resistance_ohm is outside of")),
        "{printed:?}"
    );
    assert_eq!((warnings(&rows[0]), warnings(&rows[2])), (None, None));
    // `-q` applies to the command, not to the batch.
    bench.run(&[&SMOOTH[..], &["--summary", "json", "--", "-q"]].concat()).ok();
    assert_eq!(summary(&bench).iter().filter_map(warnings).count(), 0);
}

#[test]
fn what_is_done_is_done_once() {
    let bench = folder();
    let smooth = [&SMOOTH[..], &["--summary", "json"]].concat();
    let states = |arguments: &[&str]| {
        bench.run(arguments).ok();
        summary(&bench).iter().map(|row| row["state"].as_str().unwrap().to_owned()).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(states(&smooth), "done done done");
    assert_eq!(states(&smooth), "kept kept kept");
    // A changed recording, a truncated output, and a missing one.
    bench.write("in/b.csv", bench.read("in/a.csv"));
    assert_eq!(states(&smooth), "kept done kept");
    bench.write("out/a.csv", "time_s\n");
    assert_eq!(states(&smooth), "done kept kept");
    fs::remove_file(bench.path("out/day 2/a.csv")).unwrap();
    assert_eq!(states(&smooth), "kept kept done");
    // Other flags, another sensor, and repetition on request.
    assert_eq!(states(&[&smooth[..], &["--", "--without", "correction"]].concat()), "done done done");
    bench.write("sensor.toml", bench.read("sensor.toml") + "\n");
    assert_eq!(states(&[&smooth[..], &["--", "--without", "correction"]].concat()), "done done done");
    assert_eq!(states(&[&smooth[..], &["--again", "--", "--without", "correction"]].concat()), "done done done");
    // A sensor among the flags of the command.
    let flagged: Vec<&str> =
        smooth.iter().copied().filter(|word| !["--sensor", "sensor.toml"].contains(word)).collect();
    let flagged = [&flagged[..], &["--", "--sensor", "sensor.toml"]].concat();
    assert_eq!(states(&flagged), "done done done");
    assert_eq!(states(&flagged), "kept kept kept");
    bench.write("sensor.toml", bench.read("sensor.toml") + "\n");
    assert_eq!(states(&flagged), "done done done");
    assert_eq!(states(&[&smooth[..], &["--again", "--", "--without", "correction"]].concat()), "done done done");
    // A line left unfinished by a killed run.
    let journal = bench.read("out/batch.jsonl");
    let lines: Vec<&str> = journal.lines().collect();
    let [.., first, second, third] = lines[..] else { panic!("{journal}") };
    bench.write("out/batch.jsonl", format!("{first}\n{second}\n{}", &third[..third.len() - 20]));
    let last = states(&[&smooth[..], &["--force", "--", "--without", "correction"]].concat());
    assert_eq!((last.matches("done").count(), last.matches("kept").count()), (1, 2), "{last}");
}

/// One mistyped name is one message.
#[test]
fn an_invalid_sensor_is_reported_once() {
    let bench = folder();
    bench.write("old.toml", "format = 1\n");
    for (sensor, why) in [("mistyped.toml", "cannot read mistyped.toml"), ("old.toml", "old.toml:1: field `format`")] {
        let run = bench.run(&["-q", "batch", "smooth", "in/a.csv", "in/b.csv", "--sensor", sensor, "-o", "out"]);
        let single = bench.run(&["-q", "smooth", "in/a.csv", "--sensor", sensor]);
        assert_eq!((run.code, &run.stderr), (single.code, &single.stderr));
        assert!(run.stderr.contains(why) && run.stderr.lines().count() == 1, "{}", run.stderr);
        assert!(!bench.path("out").exists());
    }
    let flagged =
        ["-q", "batch", "smooth", "in/a.csv", "--sensor", "sensor.toml", "-o", "out", "--", "--estimator", "ukf"];
    let run = bench.run(&flagged);
    assert!(run.code == Some(4) && run.stderr.contains("ukf"), "{:?} {}", run.code, run.stderr);
    assert!(!bench.path("out").exists());
}

#[test]
fn a_folder_is_pointed_to_a_pattern() {
    let bench = folder();
    let run = bench.run(&["batch", "smooth", "in/", "--sensor", "sensor.toml", "-o", "out"]);
    run.fails(2, "in is a folder: --glob 'in/**/*.csv' takes the recordings in it");
    assert!(!bench.path("out").exists());
}

#[test]
fn outputs_left_from_an_earlier_run_are_reported() {
    let bench = folder();
    bench.run(&SMOOTH).ok();
    let before = bench.read("out/b.csv");
    bench.write("in/b.csv", "time_s,resistance_ohm\n0,1600\n1,oops\n");
    let run = bench.run(&[&SMOOTH[..], &["--summary", "json"]].concat());
    assert_eq!(run.code, Some(5), "{}", run.stderr);
    assert_eq!(bench.read("out/b.csv"), before);
    assert!(run.stderr.contains("b.csv is from before this run"), "{}", run.stderr);
    assert!(run.stderr.contains("summary.json; out/summary.csv is from before this run"), "{}", run.stderr);
    assert!(summary(&bench)[1]["message"].as_str().unwrap().ends_with("b.csv is from before this run"));
}

#[test]
fn inputs_and_other_peoples_files_stay() {
    let bench = folder();
    let refused = |arguments: &[&str], why: &str| {
        let run = bench.run(arguments);
        assert_eq!(run.code, Some(2), "{}", run.stderr);
        assert!(run.stderr.contains(why), "{}", run.stderr);
    };
    let smooth = ["-q", "batch", "smooth", "--sensor", "sensor.toml"];
    refused(&[&smooth[..], &["in/a.csv", "-o", "in"]].concat(), "it is an input");
    bench.write("in/note.csv", bench.read("in/a.csv"));
    fs::create_dir(bench.path("out")).unwrap();
    bench.write("out/note.csv", "mine\n");
    refused(&[&smooth[..], &["in/note.csv", "-o", "out"]].concat(), "no earlier run wrote");
    assert_eq!(bench.read("out/note.csv"), "mine\n");
    bench.run(&[&smooth[..], &["in/note.csv", "-o", "out", "--force"]].concat()).ok();
    refused(&[&smooth[..], &["in/a.csv", "in/a.csv", "-o", "other"]].concat(), "same name");
    refused(&[&smooth[..], &["in/a.csv", "-o", "other", "--", "--gate", "x"]].concat(), "expected a positive number");
    let gone = "unexpected argument '--no-doubts' found: it is `--without doubts` now";
    refused(&[&smooth[..], &["in/a.csv", "-o", "other", "--", "--no-doubts"]].concat(), gone);
    refused(&["-q", "batch", "filter", "in/a.csv", "-o", "other"], "--sensor");
    refused(&[&smooth[..], &["-", "-o", "other"]].concat(), "batch reads files");
}

#[test]
fn a_manifest_has_sensors_names_and_flags() {
    let bench = folder();
    fs::copy(bench.path("sensor.toml"), bench.path("in/mine.toml")).unwrap();
    let manifest = "file,sensor,output,initial-strain,without\na.csv,mine.toml,first,0,\"correction,doubts\"\nb.csv,,day/second.csv,,\n";
    bench.write("in/manifest.csv", manifest);
    let batch = ["-q", "batch", "filter", "--manifest", "in/manifest.csv", "--sensor", "sensor.toml", "-o", "out"];
    bench.run(&batch).ok();
    let a =
        ["filter", "in/a.csv", "--sensor", "sensor.toml", "--initial-strain", "0", "--without", "correction,doubts"];
    assert_eq!(bench.read("out/first.csv"), bench.run(&a).ok());
    let b = ["filter", "in/b.csv", "--sensor", "sensor.toml"];
    assert_eq!(bench.read("out/day/second.csv"), bench.run(&b).ok());
}

#[test]
fn recordings_of_one_sensor_are_calibrated_together_and_evaluated() {
    let bench = folder();
    bench.write("manifest.csv", "file,sensor\nin/day 2/a.csv,left\nin/b.csv,left\nin/a.csv,right\n");
    let calibrate = ["-q", "batch", "calibrate", "--manifest", "manifest.csv", "-o", "out", "--summary", "json"];
    let flags = ["--", "--estimator", "ekf", "--branches", "1"];
    bench.run(&[&calibrate[..], &flags].concat()).ok();
    let single = ["calibrate", "in/day 2/a.csv", "in/b.csv", "-o", "single.toml"];
    bench.run(&[&single[..], &flags[1..]].concat()).ok();
    assert_eq!(bench.read("out/left.toml"), bench.read("single.toml"));
    let rows = summary(&bench);
    assert_eq!((rows.len(), rows[0]["file"].as_str()), (2, Some("in/day 2/a.csv; in/b.csv")));
    assert!(rows[1]["filter_percent_fs"].as_f64().is_some(), "{}", rows[1]);

    bench
        .run(&[
            "-q",
            "batch",
            "evaluate",
            "in/b.csv",
            "--sensor",
            "out/left.toml",
            "-o",
            "scores",
            "--summary",
            "parquet",
        ])
        .ok();
    let single = bench.run(&["evaluate", "in/b.csv", "--sensor", "out/left.toml", "--json"]).ok();
    assert_eq!(bench.read("scores/b.json"), single);
    assert!(fs::read(bench.path("scores/summary.parquet")).unwrap().ends_with(b"PAR1"));
}

/// Rows of one sensor have a file of marks each, whose paths start at the manifest's folder, and share all other flags.
#[test]
fn rows_of_one_sensor_share_flags_and_have_their_own_marks() {
    let bench = folder();
    let trace = bench.read("in/b.csv");
    let readings = trace.lines().filter(|line| !line.starts_with('#')).map(|line| line.rsplit_once(',').unwrap().0);
    bench.write("in/b.csv", readings.map(|line| format!("{line}\n")).collect::<String>());
    bench.write("in/marks.csv", "time_s,strain\n0,0\n5,0.1\n");
    bench.write("in/late.csv", "time_s,strain\n0,0\n5e6,0.1\n");
    let run = |manifest: &str| {
        bench.write("in/manifest.csv", manifest);
        bench.run(&["-q", "batch", "calibrate", "--manifest", "in/manifest.csv", "-o", "out"])
    };
    let other = run("file,sensor,estimator\r\na.csv,two,ekf\r\n\r\nday 2/a.csv,two,ukf\r\n");
    let expected = "in/manifest.csv:4: expected the flags of the first row of its sensor, `--estimator ekf`, found `--estimator ukf`";
    other.fails(4, expected);
    let marked = run("file,sensor,estimator,marks\na.csv,one,ekf,marks.csv\nb.csv,one,ekf,late.csv\n");
    assert!(
        marked.code == Some(5) && marked.stderr.contains("in/late.csv:3: expected a time between"),
        "{}",
        marked.stderr
    );
}

#[test]
fn calibrations_with_other_marks_are_done_again() {
    let bench = folder();
    bench.write("marks.csv", "time_s,strain\n0,0\n1,x\n");
    let batch =
        ["-q", "batch", "calibrate", "in/a.csv", "-o", "out", "--summary", "json", "--", "--marks", "marks.csv"];
    let flags = ["--estimator", "ekf", "--branches", "0"];
    let trace = Csv::new(&bench.read("in/a.csv"));
    let (time_s, strain) = (trace.numbers("time_s"), trace.numbers("strain"));
    for (every, state) in [(20, "done"), (20, "kept"), (25, "done")] {
        let marks = (0..time_s.len()).step_by(every).map(|k| format!("{},{}\n", time_s[k], strain[k]));
        bench.write("marks.csv", format!("time_s,strain\n{}", marks.collect::<String>()));
        bench.run(&[&batch[..], &flags].concat()).ok();
        assert_eq!(summary(&bench)[0]["state"], state, "{every}");
    }
}

#[test]
fn reports_do_not_replace_each_other_and_are_made_again() {
    let bench = folder();
    let run = |reports: [&str; 2], more: &[&str]| {
        bench.write("manifest.csv", format!("file,report\nin/a.csv,{}\nin/b.csv,{}\n", reports[0], reports[1]));
        let batch = ["-q", "batch", "evaluate", "--manifest", "manifest.csv", "--sensor", "sensor.toml", "-o", "out"];
        bench.run(&[&batch[..], more].concat())
    };
    for (reports, why) in [
        (["r.html", "r.html"], "cannot write out/r.html for in/b.csv: another output has the same name"),
        (["b.json", "r.html"], "cannot write out/b.json for in/a.csv: another output has the same name"),
        (["batch.jsonl", "r.html"], "cannot write out/batch.jsonl for in/a.csv: it is the name of the summary"),
    ] {
        let refused = run(reports, &[]);
        assert!(refused.code == Some(2) && refused.stderr.contains(why), "{}", refused.stderr);
    }
    run(["a.html", "b.html"], &[]).ok();
    fs::remove_file(bench.path("out/a.html")).unwrap();
    run(["a.html", "b.html"], &["--summary", "json"]).ok();
    let rows = summary(&bench);
    assert_eq!([&rows[0]["state"], &rows[1]["state"]], ["done", "kept"]);
    assert!(bench.path("out/a.html").exists());
}

/// A file may lie deeper than a single name can be long.
#[test]
fn long_paths_are_no_names() {
    let bench = folder();
    let deep = format!("in/{0}/{0}/{0}", "deep".repeat(25));
    fs::create_dir_all(bench.path(&deep)).unwrap();
    bench.write(&format!("{deep}/a.csv"), bench.read("in/a.csv"));
    bench.run(&SMOOTH).ok();
    assert!(bench.path(&deep.replacen("in", "out", 1)).join("a.csv").exists());
}

#[test]
fn a_batch_calibrates_recordings_of_one_channel() {
    let bench = folder();
    bench.write("in/two.csv", "time_s,a_ohm,b_ohm,strain\n0,1,1,0\n");
    let run = bench.run(&["-q", "batch", "calibrate", "in/two.csv", "-o", "out"]);
    let why = "in/two.csv: expected readings of one channel, found those of several; use `ohmstrain calibrate`";
    assert!(run.code == Some(5) && run.stderr.contains(why), "{}", run.stderr);
}

/// A CSV and the CSV filtered from its Parquet contain the same numbers, as output and as input.
#[test]
fn parquet_holds_the_same_numbers() {
    let bench = folder();
    let batch = [
        "-q",
        "batch",
        "filter",
        "in/a.csv",
        "in/b.csv",
        "--sensor",
        "sensor.toml",
        "-o",
        "out",
        "--format",
        "parquet",
    ];
    bench.run(&batch).ok();
    let bytes = fs::metadata(bench.path("out/b.parquet")).unwrap().len();
    let text = bench.run(&["filter", "in/b.csv", "--sensor", "sensor.toml"]).ok();
    assert!(bytes < text.len() as u64, "{bytes} of {}", text.len());
    // Estimates contain time and readings, so that they are a recording again, and give the same estimates.
    for command in ["filter", "smooth"] {
        let repeated = bench.run(&[command, "out/b.parquet", "--sensor", "sensor.toml"]).ok();
        let first = bench.run(&[command, "in/b.csv", "--sensor", "sensor.toml"]).ok();
        assert_eq!(repeated, first, "{command}");
    }
    let evaluated = |file: &str| bench.run(&["evaluate", file, "--sensor", "sensor.toml"]).ok();
    let lines = |text: String| text.lines().skip(1).map(str::to_owned).collect::<Vec<_>>();
    // Scored against its own estimates, like a CSV with the same columns.
    bench.write("b.csv", text);
    assert_eq!(lines(evaluated("out/b.parquet")), lines(evaluated("b.csv")));
}
