//! Recordings as they arrive: one row in, one row out.

use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use crate::common::{Bench, Csv, ESTIMATES_HEADER, Run};
use assert_cmd::cargo::cargo_bin;

/// Far more than a row takes on any machine, but a bearable wait for a test that hangs.
const PATIENCE: Duration = Duration::from_secs(20);

const FILTER: [&str; 3] = ["filter", "--sensor", "sensor.toml"];

/// Starts the program with pipes.
fn start(bench: &Bench, arguments: &[&str]) -> Child {
    let mut command = Command::new(cargo_bin!("ohmstrain"));
    command.current_dir(bench.path("")).args(arguments);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Waits for the program's end.
fn finish(arguments: &[&str], child: Child) -> Run {
    Run::new(arguments, child.wait_with_output().unwrap())
}

/// Returns the lines of a running program as they arrive.
fn lines_of(child: &mut Child) -> Receiver<String> {
    let stdout = BufReader::new(child.stdout.take().unwrap());
    let (sender, receiver) = channel();
    thread::spawn(move || stdout.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
    receiver
}

/// Writes row by row, and waits for the answer to each before the next one is written.
fn converse(trace: &str, stdin: &mut ChildStdin, answers: &Receiver<String>) -> Vec<String> {
    let mut received = Vec::new();
    for line in trace.lines() {
        writeln!(stdin, "{line}").unwrap();
        stdin.flush().unwrap();
        if line.starts_with(|first: char| first.is_ascii_digit()) {
            if received.is_empty() {
                received
                    .push(answers.recv_timeout(PATIENCE).expect("the header comes with the first row at the latest"));
            }
            received.push(answers.recv_timeout(PATIENCE).expect("each row is answered before the next one"));
        }
    }
    received
}

fn first_lines(text: &str, count: usize) -> String {
    text.lines().take(count).map(|line| format!("{line}\n")).collect()
}

#[test]
fn a_live_pipe_is_answered_row_by_row() {
    let bench = Bench::calibrated();
    let trace = first_lines(&bench.read("trace.csv"), 40);
    let expected = bench.feed(&FILTER, trace.as_str()).ok();
    let mut sources = vec!["-"];
    if cfg!(target_os = "linux") {
        // A pipe under another name.
        sources.push("/dev/stdin");
    }
    for source in sources {
        let arguments = ["filter", source, "--sensor", "sensor.toml"];
        let mut child = start(&bench, &arguments);
        let answers = lines_of(&mut child);
        let mut stdin = child.stdin.take().unwrap();
        let received = converse(&trace, &mut stdin, &answers);
        assert_eq!(received, expected.lines().collect::<Vec<_>>());
        drop(stdin);
        finish(&arguments, child).ok();
        assert!(answers.recv_timeout(PATIENCE).is_err(), "nothing is said after the last row");
    }
}

#[test]
fn rows_before_a_bad_one_are_printed() {
    let bench = Bench::calibrated();
    let good = first_lines(&bench.read("trace.csv"), 30);
    let good_lines = good.lines().count();
    bench.write("bad.csv", format!("{good}99,wet,0\n100,1700,0\n"));
    let run = bench.run(&["filter", "bad.csv", "--sensor", "sensor.toml"]);
    run.fails(4, &format!("bad.csv:{}: column `resistance_ohm`: expected a number, found `wet`", good_lines + 1));
    assert_eq!(run.stdout, bench.feed(&FILTER, good).ok());
    // The smoother needs the whole recording first.
    assert_eq!(bench.run(&["smooth", "bad.csv", "--sensor", "sensor.toml"]).stdout, "");
}

#[test]
fn a_row_without_end_counts_at_the_end_of_the_file() {
    let bench = Bench::calibrated();
    let trace = first_lines(&bench.read("trace.csv"), 30);
    assert_eq!(bench.feed(&FILTER, trace.trim_end()).ok(), bench.feed(&FILTER, trace.as_str()).ok());
}

#[test]
fn a_closed_pipe_ends_quietly() {
    let bench = Bench::calibrated();
    // More output than any pipe holds.
    bench.run(&["simulate", "--protocol", "mixed", "--sample-rate-hz", "50", "-o", "long.csv"]).ok();
    let commands: [&[&str]; 6] = [
        &["simulate", "--protocol", "mixed", "--sample-rate-hz", "50"],
        &["filter", "long.csv", "--sensor", "sensor.toml"],
        &["smooth", "long.csv", "--sensor", "sensor.toml"],
        &["evaluate", "long.csv", "--sensor", "sensor.toml", "--json"],
        &["filter", "long.csv", "--sensor", "sensor.toml", "--save-state", "state.toml"],
        &["export", "--sensor", "sensor.toml", "--target", "c", "-o", "c"],
    ];
    for arguments in commands {
        let mut child = start(&bench, arguments);
        drop(child.stdout.take());
        finish(arguments, child).ok();
    }
    // Files are written even if nobody reads what is printed.
    assert!(bench.read("state.toml").contains("format = ") && bench.path("c/src/ohmstrain.c").exists());
}

#[test]
fn a_reader_that_leaves_a_live_filter_ends_it_quietly() {
    let bench = Bench::calibrated();
    let trace = bench.read("trace.csv");
    let mut child = start(&bench, &FILTER);
    let mut stdin = child.stdin.take().unwrap();
    let mut first = String::new();
    {
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        stdin.write_all(first_lines(&trace, 10).as_bytes()).unwrap();
        stdout.read_line(&mut first).unwrap();
    }
    assert_eq!(first.trim_end(), ESTIMATES_HEADER);
    // The filter notices at its next row, and then our output has no reader.
    let rest = trace.lines().skip(10).try_for_each(|line| writeln!(stdin, "{line}"));
    assert!(rest.is_ok() || rest.is_err_and(|error| error.kind() == ErrorKind::BrokenPipe));
    drop(stdin);
    finish(&FILTER, child).ok();
}

#[test]
fn a_message_that_nobody_reads_is_no_panic() {
    let bench = Bench::new();
    let arguments = ["filter", "none.csv", "--sensor", "none.toml"];
    let mut child = start(&bench, &arguments);
    drop(child.stderr.take());
    assert_eq!(finish(&arguments, child).code, Some(1));
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    let bench = Bench::calibrated();
    for command in ["filter", "smooth", "evaluate"] {
        let arguments = [command, "trace.csv", "--sensor", "sensor.toml"];
        let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
        let mut process = Command::new(cargo_bin!("ohmstrain"));
        process.current_dir(bench.path("")).args(arguments).stdout(full);
        let run = Run::new(&arguments, process.output().unwrap());
        assert_eq!(run.code, Some(1), "{}", run.command);
        assert!(run.stderr.starts_with("ohmstrain: cannot write: "), "{}", run.stderr);
        assert_eq!(run.stderr.lines().count(), 1);
    }
}

#[test]
fn one_row_is_a_recording() {
    let bench = Bench::calibrated();
    bench.write("one.csv", "time_s,resistance_ohm\n12.5,1700\n");
    bench.write("nothing.csv", "time_s,resistance_ohm\n12.5,\n");
    for command in ["filter", "smooth"] {
        let estimates = |file: &str| Csv::new(&bench.run(&[command, file, "--sensor", "sensor.toml"]).ok());
        let one = estimates("one.csv");
        assert_eq!((one.header.as_str(), one.len()), (ESTIMATES_HEADER, 1));
        assert_eq!((one.cells("time_s")[0], one.cells("resistance_ohm")[0]), ("12.5", "1700"));
        let nothing = estimates("nothing.csv");
        assert_eq!((nothing.cells("flags")[0].split('|').next(), nothing.cells("nis")[0]), (Some("missing"), ""));
        // Even a single reading is informative: its estimate has a smaller deviation than the prior of strain.
        let first = |rows: &Csv, column: &str| rows.numbers(column)[0];
        let off = first(&one, "strain") - first(&nothing, "strain");
        assert!(first(&one, "strain_sd") < first(&nothing, "strain_sd").hypot(off));
    }
}

/// Cells that every row has in any case; the others may be unknown.
const ALWAYS: [&str; 9] = [
    "time_s",
    "strain",
    "strain_sd",
    "strain_rate",
    "strain_rate_sd",
    "relaxation",
    "relaxation_sd",
    "settled_resistance_ohm",
    "settled_resistance_sd_ohm",
];

#[track_caller]
fn assert_whole(estimates: &Csv) {
    for column in ALWAYS {
        assert!(estimates.numbers(column).iter().all(|value| value.is_finite()), "{column}");
        assert!(!column.contains("_sd") || estimates.numbers(column).iter().all(|sd| *sd > 0.0), "{column}");
    }
}

#[test]
fn empty_and_nan_cells_are_missing_readings() {
    let bench = Bench::calibrated();
    let rows = "0,1600\n0.2,1610\n0.4,\n0.6,NaN\n0.8, nan \n1.0,1650\n";
    let estimates = Csv::new(&bench.feed(&FILTER, format!("time_s,resistance_ohm\n{rows}")).ok());
    assert_whole(&estimates);
    let (flags, readings, nis) = (estimates.cells("flags"), estimates.cells("resistance_ohm"), estimates.cells("nis"));
    for row in 0..6 {
        let is_missing = (2..5).contains(&row);
        assert_eq!(flags[row].split('|').any(|flag| flag == "missing"), is_missing, "{row}");
        assert_eq!((readings[row].is_empty(), nis[row].is_empty()), (is_missing, is_missing), "{row}");
    }
}

#[test]
fn without_readings_the_error_bar_grows_to_what_is_known_of_the_body() {
    let bench = Bench::calibrated();
    let gap: String = (1..200).map(|second| format!("{second},\n")).collect();
    let estimates = Csv::new(&bench.feed(&FILTER, format!("time_s,resistance_ohm\n0,1600\n{gap}")).ok());
    assert_whole(&estimates);
    let sd = estimates.numbers("strain_sd");
    let nothing = bench.feed(&FILTER, "time_s,resistance_ohm\n0,\n").ok();
    let unknown_sd = Csv::new(&nothing).numbers("strain_sd")[0];
    assert!(sd[0] < unknown_sd);
    assert!((sd[199] / unknown_sd - 1.0).abs() < 0.1, "{} {unknown_sd}", sd[199]);
}

#[test]
fn irregular_steps_and_gaps_work() {
    let bench = Bench::calibrated();
    let mut time_s = -3.0;
    let rows: String = [0.001, 0.2, 0.0005, 37.0, 0.1, 0.19, 1e-6, 4000.0, 0.125, 1e6, 0.2]
        .iter()
        .enumerate()
        .map(|(row, step_s)| {
            time_s += step_s;
            format!("{time_s},{}\n", 1600 + 20 * row)
        })
        .collect();
    let trace = format!("time_s,resistance_ohm\n{rows}");
    let filtered = Csv::new(&bench.feed(&FILTER, trace.as_str()).ok());
    bench.write("irregular.csv", &trace);
    let smoothed = Csv::new(&bench.run(&["smooth", "irregular.csv", "--sensor", "sensor.toml"]).ok());
    for estimates in [&filtered, &smoothed] {
        assert_whole(estimates);
        assert_eq!(estimates.cells("time_s"), Csv::new(&trace).cells("time_s"));
        assert!(estimates.cells("flags").iter().all(|flags| !flags.contains("missing")));
    }
}

/// The filter uses differences of time only.
#[test]
fn microseconds_that_wrap_are_seconds_that_do_not() {
    let bench = Bench::calibrated();
    let counter = |row: u64| (4_294_000_000 + 200_000 * row) % (1 << 32);
    let recording = |header: &str, time: &dyn Fn(u64) -> String| -> String {
        let rows = (0..20).map(|row| format!("{},{}\n", time(row), 1600 + 5 * row));
        format!("{header},resistance_ohm\n{}", rows.collect::<String>())
    };
    let estimates = |trace: String| Csv::new(&bench.feed(&FILTER, trace).ok());
    let wrapped = estimates(recording("time_us", &|row| counter(row).to_string()));
    let plain = estimates(recording("time_s", &|row| (0.2 * row as f64).to_string()));
    // Times near 4294 s are rounded to 4.5e-13 s, steps of 0.2 s thus to 5e-12 of their length: the filter damps it.
    for column in ["strain", "strain_sd", "nis"] {
        for (a, b) in wrapped.numbers(column).into_iter().zip(plain.numbers(column)) {
            assert!((a - b).abs() <= 1e-9 * b.abs(), "{column}: {a} {b}");
        }
    }
}

#[test]
fn bad_lines_are_skipped_where_that_is_wanted_and_counted() {
    let bench = Bench::calibrated();
    let good = first_lines(&bench.read("trace.csv"), 60);
    let mut bad: Vec<u8> = vec![];
    for (row, line) in good.lines().enumerate() {
        bad.extend_from_slice(line.as_bytes());
        bad.push(b'\n');
        match row {
            30 => bad.extend_from_slice(b"1.4\"x,160\n\xff\xfe\x00garbage\n"),
            40 => bad.extend_from_slice(b"9999,-3\n0.0,1600,0\n"),
            _ => {}
        }
    }
    let strict = bench.feed(&FILTER, bad.clone());
    assert_eq!(strict.code, Some(4));
    let skipping = bench.feed(&[&FILTER[..], &["--skip-bad"]].concat(), bad);
    let warnings = skipping.warnings.concat();
    assert!(warnings.contains("4 lines were skipped; the first one: stdin:32: "), "{warnings}");
    assert_eq!(skipping.ok(), bench.feed(&FILTER, good).ok());
    let nothing = bench.feed(&[&FILTER[..], &["--skip-bad"]].concat(), "time_s,resistance_ohm\nx,y\n");
    assert_eq!(nothing.code, Some(4));
}

/// A board prints other lines when it starts; a stream that is joined late has no header.
#[test]
fn a_stream_may_begin_with_something_else_or_in_its_middle() {
    let bench = Bench::calibrated();
    let good = first_lines(&bench.read("trace.csv"), 60);
    let whole = bench.feed(&FILTER, good.clone()).ok();
    let banner = b"\xff\x00booting...\nets Jun  8 2016 00:22:57\n".to_vec();
    let skipping = [&FILTER[..], &["--skip-bad"]].concat();
    let booted = bench.feed(&skipping, [banner.clone(), good.clone().into_bytes()].concat());
    assert!(
        booted.warnings.concat().contains("2 lines were skipped; the first one: stdin:1: "),
        "{:?}",
        booted.warnings
    );
    assert_eq!(booted.ok(), whole);

    let is_row = |line: &&str| line.starts_with(|c: char| c.is_ascii_digit());
    let rows: String = good.lines().filter(is_row).map(|line| format!("{line}\n")).collect();
    let header = good.lines().find(|line| line.starts_with("time_s")).unwrap();
    assert_eq!(bench.feed(&[&FILTER[..], &["--header", header]].concat(), rows.clone()).ok(), whole);
    let joined = bench.feed(&[&skipping[..], &["--header", header]].concat(), format!("9,16\n{rows}"));
    assert_eq!(joined.ok(), whole);

    let hint = "; a stream without a header, or joined after it, needs --header time_s,resistance_ohm\n";
    let headless = bench.feed(&skipping, rows);
    assert!(headless.code == Some(4) && headless.stderr.ends_with(hint), "{}", headless.stderr);
    let only = bench.feed(&skipping, [banner, header.as_bytes().to_vec()].concat());
    only.fails(4, "stdin:4: expected at least one row of data, found the end of the file");
    let odd = bench.feed(&[&FILTER[..], &["--header", "a,b"]].concat(), "1,2\n");
    odd.fails(2, "--header: expected a header with the column `time_s` or `time_us`, found `a,b`");
}

/// Returns `count` rows of a clock that starts at zero, each 0.2 s after the previous one.
fn clock(count: usize) -> String {
    (0..count).map(|row| format!("{:.1},{}\n", 0.2 * row as f64, 1600 + 5 * (row % 40))).collect()
}

/// The clock of a reset board restarts, with its header or without, and so does the filter: at once, and once.
#[test]
fn a_stream_continues_after_a_clock_restart() {
    let bench = Bench::calibrated();
    let skipping = [&FILTER[..], &["--skip-bad"]].concat();
    let header = "time_s,resistance_ohm\n";
    let (first, second) = (clock(100), clock(50));
    let alone = |rows: &str| bench.feed(&FILTER, format!("{header}{rows}")).ok();
    // Without a header, two rows are late before the third shows that the clock has restarted.
    let from_third = second.splitn(3, '\n').nth(2).unwrap();
    let cases = [("", from_third, 104, 2), ("boot\ntime_s,resistance_ohm\n", &second, 104, 1)];
    for (between, rest, line, skipped) in cases {
        for lag in [&[][..], &["--lag-s", "0.5"]] {
            let stream = format!("{header}{first}{between}{second}");
            let run = bench.feed(&[&skipping[..], lag].concat(), stream.as_str());
            let at = format!("ohmstrain: warning: stdin:{line}: the clock has started again, at ");
            assert!(run.warnings.iter().any(|warning| warning.starts_with(&at)), "{:?}", run.warnings);
            let lines =
                if skipped == 1 { "1 line was skipped".to_owned() } else { format!("{skipped} lines were skipped") };
            assert!(run.warnings.iter().any(|warning| warning.contains(&lines)), "{:?}", run.warnings);
            let estimates = run.ok();
            assert_eq!(Csv::new(&estimates).len(), 100 + rest.lines().count(), "{between:?} {lag:?}");
            if lag.is_empty() {
                let own: Vec<String> = alone(rest).lines().skip(1).map(str::to_owned).collect();
                assert_eq!(estimates, alone(&first) + &own.join("\n") + "\n");
            }
        }
    }
    // One late row, occasional late rows, and late rows that do not continue each other are bad lines, not a restarted clock.
    let strays = first.replace("10.0,", "3.0,1600\n10.0,").replace("15.0,", "4.0,1\n3.9,1\n3.8,1\n3.7,1\n15.0,");
    let run = bench.feed(&skipping, format!("{header}{strays}"));
    assert!(run.warnings.concat().contains("5 lines were skipped") && run.warnings.len() == 1, "{:?}", run.warnings);
    assert_eq!(run.ok(), alone(&first));
}

/// The restart of a clock is reported while the stream goes on.
#[test]
fn a_clock_restart_is_reported_at_once() {
    let bench = Bench::calibrated();
    let arguments = [&FILTER[..], &["--skip-bad"]].concat();
    let mut child = start(&bench, &arguments);
    let answers = lines_of(&mut child);
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let mut stdin = child.stdin.take().unwrap();
    write!(stdin, "time_s,resistance_ohm\n{}{}", clock(40), clock(3)).unwrap();
    stdin.flush().unwrap();
    let mut first = String::new();
    stderr.read_line(&mut first).unwrap();
    assert!(first.starts_with("ohmstrain: warning: stdin:44: the clock has started again, at 0.4 s"), "{first}");
    let rows: Vec<String> = (0..42).map(|_| answers.recv_timeout(PATIENCE).unwrap()).collect();
    assert!(rows[41].starts_with("0.4,1610,"), "{}", rows[41]);
    drop(stdin);
    assert!(child.wait().unwrap().success());
}

/// A known strain on the first clock is not one on the second.
#[test]
fn a_second_clock_has_no_known_strains() {
    let bench = Bench::calibrated();
    let known = ["--skip-bad", "--known", "1:0.2", "--initial-strain", "0"];
    let stream = format!("time_s,resistance_ohm\n{}time_s,resistance_ohm\n{}", clock(60), clock(50));
    let run = bench.feed(&[&FILTER[..], &known].concat(), stream);
    let second: Vec<String> = run.ok().lines().skip(61).map(str::to_owned).collect();
    let alone = bench.feed(&FILTER, format!("time_s,resistance_ohm\n{}", clock(50))).ok();
    assert_eq!(second, alone.lines().skip(1).collect::<Vec<_>>());
}

#[test]
fn a_recording_with_a_clock_restart_is_refused_with_a_way_out() {
    let bench = Bench::calibrated();
    bench.write("twice.csv", format!("time_s,resistance_ohm\n{}{}", clock(60), clock(60)));
    let late = "twice.csv:62: column `time_s`: expected a time after 11.8 s, found `0.0`; if the clock has started again there, ";
    let filter = bench.run(&["filter", "twice.csv", "--sensor", "sensor.toml"]);
    filter.fails(4, &format!("{late}--skip-bad goes on with another filter"));
    let smooth = bench.run(&["smooth", "twice.csv", "--sensor", "sensor.toml"]);
    smooth.fails(4, &format!("{late}give each part a file of its own, or `filter --skip-bad` both"));
    assert!(bench.run(&["filter", "twice.csv", "--sensor", "sensor.toml", "--skip-bad"]).code == Some(0));
}
