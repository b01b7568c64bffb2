//! Files left behind by an interrupted command.
#![cfg(unix)]

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::{Bench, files_in};
use assert_cmd::cargo::cargo_bin;

/// Longer than any operation takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// Starts a filter of a pipe that writes Parquet, which is complete only with its last row: it has begun, and waits for more.
fn waiting(bench: &Bench) -> (Child, ChildStdin) {
    let mut command = Command::new(cargo_bin!("ohmstrain"));
    command.current_dir(bench.path("")).args(["filter", "-", "--sensor", "sensor.toml", "-o", "out/estimates.parquet"]);
    let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(b"time_s,resistance_ohm\n0,1600\n0.2,1601\n").unwrap();
    let started = Instant::now();
    while !files_in(&bench.path("out")).iter().any(|name| is_unfinished(name)) {
        assert!(started.elapsed() < PATIENCE, "nothing was begun");
        std::thread::sleep(Duration::from_millis(20));
    }
    (child, stdin)
}

fn is_unfinished(name: &str) -> bool {
    name.starts_with(".ohmstrain-")
}

fn stop(child: &mut Child, signal: &str) -> std::process::ExitStatus {
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let started = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        // A shell that starts these tests in the background makes them and the program ignore interrupts.
        assert!(started.elapsed() < PATIENCE, "{signal} was ignored");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn bench() -> Bench {
    let bench = Bench::calibrated();
    std::fs::create_dir(bench.path("out")).unwrap();
    bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml", "-o", "out/estimates.parquet"]).ok();
    bench
}

#[test]
fn a_signal_leaves_the_old_file_and_no_other() {
    use std::os::unix::process::ExitStatusExt;
    let bench = bench();
    let before = std::fs::read(bench.path("out/estimates.parquet")).unwrap();
    for (signal, number) in [("-INT", 2), ("-TERM", 15)] {
        let (mut child, _stdin) = waiting(&bench);
        assert_eq!(stop(&mut child, signal).signal(), Some(number));
        assert_eq!(files_in(&bench.path("out")), ["estimates.parquet"]);
        assert!(std::fs::read(bench.path("out/estimates.parquet")).unwrap() == before);
    }
}

/// The next run removes the files of a killed one; files of a running process stay.
#[test]
fn what_a_killed_run_left_goes_with_the_next_one() {
    let bench = bench();
    let (mut killed, _stdin) = waiting(&bench);
    stop(&mut killed, "-KILL");
    let left = |bench: &Bench| files_in(&bench.path("out")).into_iter().filter(|name| is_unfinished(name)).count();
    assert_eq!(left(&bench), 1);
    let (other, stdin) = waiting(&bench);
    std::fs::create_dir(bench.path("out/.ohmstrain-a1B2c3.parts")).unwrap();
    bench.write("out/.ohmstrain-notes", "mine");
    bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml", "-o", "out/new.csv"]).ok();
    // One file is in use, and one is not an output.
    assert_eq!(left(&bench), 2, "{:?}", files_in(&bench.path("out")));
    drop(stdin);
    assert!(other.wait_with_output().unwrap().status.success());
    assert_eq!(files_in(&bench.path("out")), [".ohmstrain-notes", "estimates.parquet", "new.csv"]);
}

/// A signal that the parent process has set to be ignored is ignored.
#[cfg(target_os = "linux")]
#[test]
fn an_ignored_interrupt_stays_ignored() {
    let bench = bench();
    let mut command = Command::new("sh");
    let filter = "trap '' INT; exec \"$0\" filter - --sensor sensor.toml -o out/estimates.csv";
    command.current_dir(bench.path("")).args(["-c", filter]).arg(cargo_bin!("ohmstrain"));
    let mut child = command.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(b"time_s,resistance_ohm\n0,1600\n").unwrap();
    let started = Instant::now();
    while !bench.path("out/estimates.csv").exists() || bench.read("out/estimates.csv").lines().count() < 2 {
        assert!(started.elapsed() < PATIENCE, "nothing was written");
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    stdin.write_all(b"0.2,1601\n").unwrap();
    drop(stdin);
    let printed_lines = BufReader::new(child.stderr.take().unwrap()).lines().count();
    assert!(child.wait().unwrap().success() && printed_lines == 0);
    assert_eq!(bench.read("out/estimates.csv").lines().count(), 3);
}
