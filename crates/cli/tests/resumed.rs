//! A filter that is stopped and resumes from its state.

use crate::common::{Bench, Run};

const FILTER: [&str; 5] = ["-q", "filter", "-", "--sensor", "sensor.toml"];

fn with<'a>(flags: &[&'a str]) -> Vec<&'a str> {
    [&FILTER[..], flags].concat()
}

/// Splits a text into header and rows.
fn apart(text: &str) -> (String, Vec<String>) {
    let mut lines = text.lines().skip_while(|line| line.starts_with('#'));
    (lines.next().unwrap().to_owned(), lines.map(str::to_owned).collect())
}

fn joined(header: &str, rows: &[String]) -> String {
    rows.iter().fold(format!("{header}\n"), |text, row| text + row + "\n")
}

#[track_caller]
fn refused(run: &Run, code: i32, words: &str) {
    assert!(run.code == Some(code) && run.stderr.contains(words), "{:?}: {}", run.code, run.stderr);
}

#[test]
fn pieces_of_a_stream_are_the_stream() {
    let bench = Bench::calibrated();
    let (header, rows) = apart(&bench.read("trace.csv"));
    for flags in
        [&["--gate", "30"][..], &["--lag-s", "2", "--estimator", "ekf"], &["--known", "20:0.1", "--known", "80:0.05"]]
    {
        let (_, whole) = apart(&bench.feed(&with(flags), joined(&header, &rows)).ok());
        let mut found = Vec::new();
        for (piece, first) in [(0..100, true), (100..101, false), (101..rows.len(), false)] {
            let (is_last, mut more) = (piece.end == rows.len(), vec!["--save-state", "state.toml"]);
            if !first {
                more.extend(["--resume", "state.toml"]);
            }
            if is_last {
                more.drain(..2);
            }
            // Strains known at earlier rows, or in the state already, count once.
            let text = bench.feed(&with(&[flags, &more].concat()), joined(&header, &rows[piece])).ok();
            found.extend(apart(&text).1);
        }
        assert_eq!(found, whole, "{flags:?}");
    }
}

#[test]
fn a_counter_wraps_between_two_streams() {
    let bench = Bench::calibrated();
    let (_, rows) = apart(&bench.read("trace.csv"));
    let from_us = (1_u64 << 32) - 10_000_000;
    let row = |(k, row): (usize, &String)| {
        let ohm = row.split(',').nth(1).unwrap();
        format!("{},{ohm}", (from_us + 200_000 * k as u64) % (1 << 32))
    };
    let rows: Vec<String> = rows.iter().take(120).enumerate().map(row).collect();
    let header = "time_us,resistance_ohm";
    let (_, whole) = apart(&bench.feed(&FILTER, joined(header, &rows)).ok());
    let saved = bench.feed(&with(&["--save-state", "state.toml"]), joined(header, &rows[..50])).ok();
    let resumed = bench.feed(&with(&["--resume", "state.toml"]), joined(header, &rows[50..])).ok();
    assert_eq!([apart(&saved).1, apart(&resumed).1].concat(), whole);
    // A device may print its header more than once.
    let twice = joined(header, &[&[header.to_owned()], &rows[50..]].concat());
    let again = bench.feed(&with(&["--resume", "state.toml", "--skip-bad"]), twice).ok();
    assert_eq!([apart(&saved).1, apart(&again).1].concat(), whole);
    let seconds = bench.feed(&with(&["--resume", "state.toml"]), "time_s,resistance_ohm\n9999,1600\n");
    refused(&seconds, 4, "expected the column `time_us`, as in the stream that --resume goes on from");
}

#[test]
fn a_state_that_does_not_belong_here_is_refused() {
    let bench = Bench::calibrated();
    let (header, rows) = apart(&bench.read("trace.csv"));
    let part = |rows: &[String]| joined(&header, rows);
    bench.feed(&with(&["--save-state", "state.toml"]), part(&rows[..20])).ok();
    let state = bench.read("state.toml");
    let resume = ["--resume", "state.toml"];
    for (flags, expected) in [
        (&["--gate", "10.8"][..], "state.toml: the state belongs to a filter with gate none, this one has 10.8"),
        (&["--lag-s", "0.5"], "lag none, this one has 0.5 s"),
        (&["--influence", "huber:2"], "influence redescending:3, this one has huber:2"),
    ] {
        refused(&bench.feed(&with(&[&resume, flags].concat()), part(&rows[20..])), 4, expected);
    }
    refused(&bench.feed(&with(&resume), part(&rows[19..])), 4, "expected a time after");
    refused(&bench.feed(&with(&["--resume", "sensor.toml"]), part(&rows[20..])), 4, "sensor.toml: expected the state");
    refused(
        &bench.feed(&with(&["--resume", "state.toml", "--initial-strain", "0"]), part(&rows[20..])),
        2,
        "cannot be used",
    );
    let anew = with(&["--resume", "state.toml", "--rest-resistance", "first:5"]);
    refused(&bench.feed(&anew, part(&rows[20..])), 2, "R0 is in the state");
    let sensor = bench.read("sensor.toml");
    let line = sensor.lines().find(|line| line.starts_with("strain_sd_scale = ")).unwrap();
    let scale: f64 = line.rsplit(' ').next().unwrap().parse().unwrap();
    bench.write("other.toml", sensor.replacen(line, &format!("strain_sd_scale = {}", 1.01 * scale), 1));
    let other = ["-q", "filter", "-", "--sensor", "other.toml", "--resume", "state.toml"];
    refused(&bench.feed(&other, part(&rows[20..])), 4, "state.toml: the state belongs to another sensor");
    // If a stream fails, the state of before stays, and no other file is replaced.
    let broken = part(&rows[20..30]) + "x,y\n";
    refused(&bench.feed(&with(&["--resume", "state.toml", "--save-state", "state.toml"]), broken), 4, "expected");
    assert_eq!(bench.read("state.toml"), state);
    refused(
        &bench.feed(&with(&["--save-state", "trace.csv"]), part(&rows[..5])),
        2,
        "it holds something else than the state",
    );
    refused(&bench.feed(&with(&["--save-state", "sensor.toml"]), part(&rows[..5])), 2, "it is the input sensor.toml");
}
