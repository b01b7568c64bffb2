//! `inspect` and `import` as run by a shell.

use std::fmt::Write as _;
use std::process::Command;

use crate::common::{Bench, Csv, SIMULATE};
use assert_cmd::cargo::cargo_bin;

/// Runs a shell command in the bench's folder, with the program on its path; returns exit code and output.
#[track_caller]
fn shell(bench: &Bench, line: &str) -> (Option<i32>, String, String) {
    let folder = cargo_bin("ohmstrain").parent().unwrap().to_path_buf();
    let path = format!("{}:{}", folder.display(), std::env::var("PATH").unwrap());
    let output = Command::new("sh").args(["-c", line]).env("PATH", path).current_dir(bench.path("")).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

/// A German export with a preamble.
fn export(rows: usize) -> String {
    let mut out = "Prüfstand 4\nBediener: x\nZeit (ms);Widerstand (kOhm);Weg (mm)\n".to_owned();
    for row in 0..rows {
        // Five seconds of rest before it moves.
        let phase = 0.1 * (row.max(100) - 100) as f64;
        let (kiloohm, mm) = (1.6 + 0.1 * phase.sin(), 2.0 - 2.0 * phase.cos());
        writeln!(
            out,
            "{};{};{}",
            50 * row,
            format!("{kiloohm:.4}").replace('.', ","),
            format!("{mm:.3}").replace('.', ",")
        )
        .unwrap();
    }
    out
}

#[test]
fn what_is_suggested_is_ready_for_a_shell() {
    let bench = Bench::new();
    bench.write("it's a test; rm.csv", export(200));
    let inspect = "ohmstrain inspect --suggest *.csv --gauge-length-mm 30";
    let (code, line, stderr) = shell(&bench, inspect);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    assert_eq!(line.lines().count(), 1);
    let (code, printed, stderr) = shell(&bench, &line);
    assert_eq!((code, printed.as_str()), (Some(0), ""), "{stderr}");
    assert!(stderr.lines().all(|line| line.starts_with("ohmstrain: ")) && stderr.contains("resistance = "), "{stderr}");
    let trace = Csv::new(&bench.read("trace.csv"));
    assert_eq!(trace.header, "time_s,resistance_ohm,strain");
    assert_eq!(trace.numbers("time_s")[199], 9.95);
    assert_eq!(trace.numbers("resistance_ohm")[0], 1600.0);
    assert_eq!(trace.numbers("strain")[0], 0.0);
}

#[test]
fn inspect_says_what_it_found_and_how_to_go_on() {
    let bench = Bench::new();
    bench.write("rig.csv", export(400));
    let known = ["--gauge-length-mm", "30"];
    let text = bench.run(&[&["inspect", "rig.csv"][..], &known].concat()).ok();
    for words in [
        "separated by semicolons",
        "decimal mark `,`",
        "UTF-8",
        "2 lines above the header",
        "400 rows",
        "resistance, kohm",
        "20 Hz",
        "0 duplicates",
        "noise",
        "Allan",
        "drift",
        "phases",
        "lag",
        "import it with\nohmstrain import rig.csv --column 'time=Zeit (ms)'",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&bench.run(&[&["inspect", "rig.csv", "--json"][..], &known].concat()).ok()).unwrap();
    assert_eq!(json["files"][0]["separator"], "semicolons");
    // A difference of times up to 20 s, each rounded.
    let step_s = json["recording"]["clock"]["step_s"].as_f64().unwrap();
    assert!((step_s - 0.05).abs() < 20.0 * f64::EPSILON);
    assert_eq!(json["columns"][1]["role"], "resistance");
    let line = bench.run(&[&["inspect", "rig.csv", "--suggest"][..], &known].concat()).ok();
    assert_eq!(json["command"], line.trim_end());
}

#[test]
fn what_is_open_is_asked_on_one_line_with_the_answer() {
    let bench = Bench::new();
    bench.write("rig.csv", export(50));
    let question =
        "rig.csv: a displacement becomes strain by the length of the unstretched sensor; say --gauge-length-mm MM";
    bench.run(&["inspect", "--suggest", "rig.csv"]).fails(4, question);
    bench.run(&["import", "rig.csv", "-o", "trace.csv"]).fails(4, question);
    assert_eq!(bench.files(), ["rig.csv"]);
    let text = bench.run(&["inspect", "rig.csv"]).ok();
    assert!(text.contains(&format!("before it can be imported: {question}")), "{text}");
    let json = bench.run(&["inspect", "rig.csv", "--json"]).ok();
    assert_eq!(serde_json::from_str::<serde_json::Value>(&json).unwrap()["question"], question);
    let run = bench.run(&["import", "rig.csv", "--unit", "resistance=furlong", "-o", "trace.csv"]);
    assert!(run.code == Some(4) && run.stderr.contains("--unit resistance=kohm"), "{}", run.stderr);
}

#[test]
fn an_imported_file_is_a_trace_and_no_input_is_overwritten() {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    let line = bench.run(&["inspect", "--suggest", "trace.csv"]).ok();
    assert!(line.ends_with("-o imported.csv\n"), "{line}");
    let (code, _, stderr) = shell(&bench, &line);
    assert_eq!(code, Some(0), "{stderr}");
    let rows =
        |name: &str| bench.read(name).lines().filter(|line| !line.starts_with('#')).collect::<Vec<_>>().join("\n");
    assert_eq!(rows("imported.csv"), rows("trace.csv"));
    bench.write("rig.csv", export(50));
    let run = bench.run(&["import", "rig.csv", "--gauge-length-mm", "30", "-o", "rig.csv"]);
    assert_eq!((run.code, bench.read("rig.csv")), (Some(2), export(50)), "{}", run.stderr);
}

#[test]
fn two_files_are_aligned_and_the_offset_is_printed_with_its_uncertainty() {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    let trace = Csv::new(&bench.read("trace.csv"));
    let (mut readings, mut reference) = ("Time (s),R (Ohm)\n".to_owned(), "Time (s),Strain (%)\n".to_owned());
    let columns = trace.numbers("time_s").into_iter().zip(trace.numbers("resistance_ohm")).zip(trace.numbers("strain"));
    for ((time, ohm), strain) in columns {
        writeln!(readings, "{time},{ohm}").unwrap();
        writeln!(reference, "{},{}", time + 20.0, 100.0 * strain).unwrap();
    }
    bench.write("dmm.csv", readings);
    bench.write("stage.csv", reference);
    let line = bench.run(&["inspect", "--suggest", "dmm.csv", "stage.csv"]).ok();
    assert!(line.contains("--align motion") && line.contains("reference-time=2:"), "{line}");
    let (code, _, stderr) = shell(&bench, &line.replace("trace.csv", "both.csv"));
    assert_eq!(code, Some(0), "{stderr}");
    let found = stderr.split_once("the reference's clock plus ").unwrap().1;
    let mut words = found.split(' ');
    let offset: f64 = words.next().unwrap().parse().unwrap();
    let sd: f64 = words.nth(1).unwrap().parse().unwrap();
    assert!((offset + 20.0).abs() < 3.0 * sd + 0.05 && sd < 0.3, "{stderr}");
}

#[test]
fn a_file_that_is_no_trace_is_sent_to_inspect() {
    let bench = Bench::calibrated();
    bench.write("rig file.csv", export(50));
    for command in ["filter", "smooth", "evaluate"] {
        let run = bench.run(&[command, "rig file.csv", "--sensor", "sensor.toml"]);
        assert_eq!(run.code, Some(4));
        assert!(run.stderr.ends_with("; see `ohmstrain inspect 'rig file.csv'`\n"), "{}", run.stderr);
        assert_eq!(run.stderr.lines().count(), 1);
    }
    let run = bench.feed(&["filter", "--sensor", "sensor.toml"], export(5));
    assert!(run.code == Some(4) && !run.stderr.contains("inspect"), "{}", run.stderr);
}

/// The remarks name each column's role once, with every word taken for a missing value.
#[test]
fn remarks_name_every_missing_word_and_come_once() {
    let bench = Bench::new();
    let words = ["OL", "####", "--", "n/a", "NaN"];
    let rows: String = (0..300)
        .map(|row| {
            let reading = words
                .get(row / 7)
                .filter(|_| row % 7 == 3)
                .map_or_else(|| (1600 + row % 9).to_string(), |w| (*w).into());
            format!("{:.1},{reading},{:.2}\n", 0.1 * row as f64, 0.01 * (row % 20) as f64)
        })
        .collect();
    bench.write("rig.csv", format!("t,R (Ohm),eps\n{rows}"));
    let stderr = bench.run(&["import", "rig.csv", "-o", "trace.csv"]).stderr;
    for word in words {
        assert!(stderr.contains(&format!("1 × `{word}`")), "{word}: {stderr}");
    }
    let lines: Vec<&str> = stderr.lines().collect();
    assert!(lines.iter().enumerate().all(|(k, line)| !lines[..k].contains(line)), "{stderr}");
}

#[test]
fn recordings_of_one_file_are_written_apart() {
    let bench = Bench::new();
    let run = |ohm: usize| (0..30).map(|row| format!("{};{};{}\n", 40 * row, ohm + row, row % 9)).collect::<String>();
    bench.write("day.csv", format!("t_ms;R_ohm;angle_deg\n{}{}", run(500), run(700)));
    let whole = bench.run(&["import", "day.csv", "-o", "out.csv"]);
    assert_eq!(whole.code, Some(4));
    assert!(whole.stderr.contains("day.csv:32") && whole.stderr.contains("--split-recordings"), "{}", whole.stderr);
    let split = bench.run(&["import", "day.csv", "--split-recordings", "-o", "out.csv"]);
    assert_eq!(split.code, Some(0), "{}", split.stderr);
    assert!(split.stderr.contains("out-2.csv: recording 2, 30 rows, lines 32 to 61"), "{}", split.stderr);
    assert_eq!(bench.files(), ["day.csv", "out-1.csv", "out-2.csv"]);
    for (file, ohm) in [("out-1.csv", 500.0), ("out-2.csv", 700.0)] {
        let trace = Csv::new(&bench.read(file));
        assert_eq!((trace.numbers("time_s")[1], trace.numbers("resistance_ohm")[0]), (0.04, ohm));
    }
    // All of them, or none.
    bench.write("other-2.csv", "my notes\n");
    let refused = bench.run(&["import", "day.csv", "--split-recordings", "-o", "other.csv"]);
    assert_eq!(refused.code, Some(2));
    assert!(!bench.path("other-1.csv").exists());
    let second = bench.run(&["import", "day.csv", "--recording", "2", "-o", "second.csv"]);
    assert_eq!(second.code, Some(0), "{}", second.stderr);
    assert_eq!(Csv::new(&bench.read("second.csv")).numbers("resistance_ohm")[0], 700.0);
}

#[test]
fn joints_of_one_file_are_imported_and_calibrated_together() {
    let bench = Bench::new();
    let row = |k: u32| {
        format!(
            "{},{},{},{},{}\n",
            50 * k,
            12.0 + f64::from(k % 40) / 50.0,
            14.0 + f64::from(k % 40) / 30.0,
            k % 40,
            2 * (k % 40)
        )
    };
    let header = "Time (ms),Thumb (kOhm),Index (kOhm),Thumb angle (deg),Index angle (deg)\n";
    bench.write("glove.csv", header.to_owned() + &(0..400).map(row).collect::<String>());
    let command = bench.run(&["inspect", "glove.csv", "--suggest"]).ok();
    assert_eq!(command, "ohmstrain import glove.csv --each -o trace.csv\n");
    let shown = bench.run(&["inspect", "glove.csv"]).ok();
    assert!(shown.contains("thumb       `Thumb (kOhm)`, its reference `Thumb angle (deg)`\n"), "{shown}");
    let json = bench.run(&["inspect", "glove.csv", "--json"]).ok();
    assert!(json.contains("\"command\": \"ohmstrain import glove.csv --each -o trace.csv\""), "{json}");
    let (code, _, stderr) = shell(&bench, &command);
    assert!(
        code == Some(0) && stderr.contains("index = `Index (kOhm)`, its reference `Index angle (deg)`"),
        "{stderr}"
    );
    let trace = bench.read("trace.csv");
    assert!(
        trace.contains("\ntime_s,thumb_ohm,index_ohm,thumb_angle_deg,index_angle_deg\n0,12000,14000,0,0\n"),
        "{trace}"
    );
    // The output of an earlier import may be replaced.
    let (code, _, stderr) = shell(&bench, &command);
    assert!(code == Some(0), "{stderr}");
}

/// A clock that begins anew, or another value in a column `trial`, is another recording, of all channels too: a file for each, on all of
/// which `calibrate` makes one hand.
#[test]
fn trials_of_several_joints_are_several_recordings() {
    let bench = Bench::new();
    let row = |k: u32| {
        let (trial, time) = (1 + k / 300, 0.1 * f64::from(k % 300));
        let bend = 20.0 - 20.0 * (0.6 * time + f64::from(trial)).cos();
        // The sensor has a memory of two seconds.
        let ohm = |scale: f64| scale * (1.0 + 0.02 * bend + 0.1 * (0.6 * time).sin() + 0.002 * f64::from(k % 7));
        format!("{trial},{time:.1},{:.2},{:.2},{bend:.3},{:.3}\n", ohm(1000.0), ohm(1500.0), 0.5 * bend)
    };
    let rows: String = (0..600).map(row).collect();
    bench.write("glove.csv", format!("trial,time_s,thumb_ohm,index_ohm,thumb_angle_deg,index_angle_deg\n{rows}"));
    let command = bench.run(&["inspect", "glove.csv", "--suggest"]).ok();
    assert_eq!(command, "ohmstrain import glove.csv --each --split-recordings -o trace.csv\n");
    let (code, _, stderr) = shell(&bench, &command);
    assert!(code == Some(0) && stderr.contains("trace-2.csv: recording 2, 300 rows, lines 302 to 601"), "{stderr}");
    let second = Csv::new(&bench.read("trace-2.csv"));
    assert_eq!(second.header, "time_s,thumb_ohm,index_ohm,thumb_angle_deg,index_angle_deg");
    assert_eq!((second.len(), second.cells("time_s")[0]), (300, "0"));
    let calibrate = ["calibrate", "trace-1.csv", "trace-2.csv", "-o", "hand.toml", "--quiet"];
    bench.run(&[&calibrate[..], &["--estimator", "ekf", "--branches", "1"]].concat()).ok();
    // The whole file is no recording, and the answer is in the message.
    let refused = bench.run(&["calibrate", "glove.csv", "-o", "hand.toml", "--force"]);
    assert!(refused.code == Some(4) && refused.stderr.contains("glove.csv:302: column `time_s`"), "{}", refused.stderr);
    assert!(refused.stderr.contains("ohmstrain import --split-recordings"), "{}", refused.stderr);
    // Another value of the trial begins another recording on a clock that goes on, too.
    let goes_on: String = (0..600)
        .map(row)
        .enumerate()
        .map(|(k, line)| {
            let cells: Vec<&str> = line.split(',').collect();
            format!("{},{:.1},{}", cells[0], 0.1 * k as f64, cells[2..].join(","))
        })
        .collect();
    bench.write("long.csv", format!("trial,time_s,thumb_ohm,index_ohm,thumb_angle_deg,index_angle_deg\n{goes_on}"));
    let run = bench.run(&["import", "long.csv", "--each", "--split-recordings", "-o", "long_trace.csv"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_eq!(Csv::new(&bench.read("long_trace-2.csv")).len(), 300);
}

#[test]
fn a_table_of_many_columns_is_cut() {
    let bench = Bench::new();
    let names: Vec<String> = (0..80).map(|pad| format!("pad_{pad}")).collect();
    let row = |row: usize| format!("{},{},{}\n", 20 * row, vec!["512"; 80].join(","), row % 5);
    let rows: String = (0..40).map(row).collect();
    bench.write("glove.csv", format!("time_ms,{},angle_deg\n{rows}", names.join(",")));
    let text = bench.run(&["inspect", "glove.csv"]).ok();
    assert!(text.lines().count() < 40 && text.contains("58 more") && text.contains("angle_deg"), "{text}");
}
