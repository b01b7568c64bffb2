//! `-o` of `filter` and `smooth`: the output of stdout in a file, with the same rules as other commands' files.

use crate::common::{Bench, ESTIMATES_HEADER, SIMULATE};

const COMMANDS: [&str; 2] = ["filter", "smooth"];

fn estimate<'a>(command: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&[command, "trace.csv", "--sensor", "sensor.toml"], more].concat()
}

#[test]
fn a_file_holds_what_stdout_gets() {
    let bench = Bench::calibrated();
    for command in COMMANDS {
        let printed = bench.run(&estimate(command, &[])).ok();
        assert!(printed.starts_with(ESTIMATES_HEADER));
        for _ in 0..2 {
            assert_eq!(bench.run(&estimate(command, &["-o", "estimates.csv"])).ok(), "");
            assert!(bench.read("estimates.csv") == printed, "{command}");
        }
        // Fewer columns are still estimates, and may be replaced.
        for _ in 0..2 {
            bench.run(&estimate(command, &["-o", "few.csv", "--columns", "time_s,strain,strain_sd"])).ok();
        }
        for flags in [&["-o", "estimates.parquet"][..], &["-o", "estimates.parquet", "--format", "parquet"]] {
            bench.run(&estimate(command, flags)).ok();
            assert!(std::fs::read(bench.path("estimates.parquet")).unwrap().starts_with(b"PAR1"));
        }
    }
}

#[test]
fn what_is_not_made_of_estimates_stays() {
    let bench = Bench::calibrated();
    bench.run(&[&SIMULATE[..], &["-o", "other.csv"]].concat()).ok();
    let trace = bench.read("trace.csv");
    for command in COMMANDS {
        let foreign = "cannot write other.csv: it holds something else than estimates of this program; choose another name, or \
                       replace it with --force";
        bench.run(&estimate(command, &["-o", "other.csv"])).fails(2, foreign);
        for (output, input) in [("trace.csv", "trace.csv"), ("./sensor.toml", "sensor.toml")] {
            let message = format!("cannot write {output}: it is the input {input}; choose another name");
            bench.run(&estimate(command, &["-o", output, "--force"])).fails(2, &message);
        }
        assert_eq!(bench.run(&estimate(command, &["-o", "none/new.csv"])).code, Some(1));
    }
    assert!(bench.read("trace.csv") == trace && bench.read("other.csv") == trace);
    assert_eq!(bench.files(), ["closing.json", "other.csv", "sensor.toml", "trace.csv"]);
    bench.run(&estimate("filter", &["-o", "other.csv", "--force"])).ok();
    assert!(bench.read("other.csv").starts_with(ESTIMATES_HEADER));
}

/// A recording that breaks leaves the estimates as they were; a stream that breaks keeps its rows so far.
#[test]
fn rows_of_a_broken_recording_and_of_a_broken_stream() {
    let bench = Bench::calibrated();
    let broken = format!("{}and so on\n", bench.read("trace.csv"));
    bench.run(&estimate("filter", &["-o", "estimates.csv"])).ok();
    let before = bench.read("estimates.csv");
    bench.write("trace.csv", &broken);
    for command in COMMANDS {
        assert_eq!(bench.run(&estimate(command, &["-o", "estimates.csv"])).code, Some(4));
        assert!(bench.read("estimates.csv") == before);
    }
    let live = bench.feed(&["filter", "-", "--sensor", "sensor.toml", "-o", "estimates.csv"], broken.clone());
    assert_eq!(live.code, Some(4));
    let rows = bench.read("estimates.csv");
    // The same rows, whatever other columns accompany them.
    assert!(rows.starts_with(ESTIMATES_HEADER) && rows == before, "{}", rows.lines().count());
    assert_eq!(bench.files(), ["closing.json", "estimates.csv", "sensor.toml", "trace.csv"]);
}

#[cfg(unix)]
#[test]
fn a_device_takes_the_rows() {
    let bench = Bench::calibrated();
    for command in COMMANDS {
        let printed = bench.run(&estimate(command, &[])).ok();
        assert!(bench.run(&estimate(command, &["-o", "/dev/stdout"])).ok() == printed);
        if std::path::Path::new("/dev/full").exists() {
            let full = bench.run(&estimate(command, &["-o", "/dev/full"]));
            assert_eq!(full.code, Some(1));
            assert!(full.stderr.starts_with("ohmstrain: cannot write: /dev/full: "), "{}", full.stderr);
        }
    }
}

#[test]
fn batch_names_its_outputs_itself() {
    let bench = Bench::calibrated();
    let batch = ["batch", "filter", "trace.csv", "--sensor", "sensor.toml", "-o", "out", "--", "-o", "mine.csv"];
    bench
        .run(&batch)
        .fails(2, "batch names the outputs itself, or as the manifest's columns `output`, `report` and `figures` say");
}
