//! Files that commands write: existing files are not lost, and a command that fails leaves everything as it was.

use crate::common::{Bench, SIMULATE};

/// Exit codes for arguments and for files that cannot be written.
const ARGUMENTS: i32 = 2;
const OTHER: i32 = 1;

/// A quick calibration.
const CALIBRATE: [&str; 9] = ["calibrate", "trace.csv", "--until", "60", "--estimator", "ekf", "--branches", "1", "-o"];
const REFINE: [&str; 7] = ["refine", "trace.csv", "--sensor", "sensor.toml", "--until", "60", "-o"];
const EXPORT: [&str; 8] = ["export", "--sensor", "sensor.toml", "--target", "rust", "--dt-s", "0.2", "-o"];

/// A recording of a user.
const RECORDING: &str = "# material = silicone\ntime_s,resistance_ohm,strain\n0,1600,0\n0.1,1610,0.01\n";

/// Runs a command that must be refused, and checks the files: all keep their contents, no new one appears.
#[track_caller]
fn refused(bench: &Bench, arguments: &[&str], code: i32, message: &str) {
    let contents = || -> Vec<_> {
        let files = bench.files().into_iter().filter(|name| bench.path(name).is_file());
        files.map(|name| (bench.read(&name), name)).collect()
    };
    let before = (contents(), bench.files());
    let run = bench.run(arguments);
    assert_eq!((run.code, run.stdout.as_str()), (Some(code), ""), "{}: {}", run.command, run.stderr);
    assert!(run.stderr.starts_with(&format!("ohmstrain: {message}")), "{}: {}", run.command, run.stderr);
    assert_eq!(run.stderr.lines().count(), 1, "{}", run.stderr);
    assert!((contents(), bench.files()) == before, "{}: files have changed", run.command);
}

#[test]
fn a_file_of_another_kind_is_replaced_only_by_force() {
    let bench = Bench::calibrated();
    bench.write("recording.csv", RECORDING);
    bench.write("README.md", "# My notes on ohmstrain\n");
    std::fs::create_dir(bench.path("mine")).unwrap();
    bench.write("mine/trace.csv", RECORDING);
    let foreign = |path: &str, kind: &str| {
        format!(
            "cannot write {path}: it holds something else than {kind} of this program; choose another name, or replace it \
             with --force\n"
        )
    };
    let cases: [(&[&str], &[&str], String); 7] = [
        (&["simulate", "-o"], &["recording.csv"], foreign("recording.csv", "a simulated recording")),
        (&CALIBRATE, &["recording.csv"], foreign("recording.csv", "a sensor file")),
        (&CALIBRATE, &["new.toml", "--report", "README.md"], foreign("README.md", "a report")),
        (&REFINE, &["recording.csv"], foreign("recording.csv", "a sensor file")),
        (&EXPORT, &["."], foreign("./README.md", "an export")),
        (&["demo", "--out"], &["mine"], foreign("mine/trace.csv", "a simulated recording")),
        // A sensor file is not a report, though both are outputs of this program.
        (&CALIBRATE, &["new.toml", "--report", "sensor.toml"], foreign("sensor.toml", "a report")),
    ];
    for (command, flags, message) in &cases {
        refused(&bench, &[*command, *flags].concat(), ARGUMENTS, message);
    }
    assert_eq!(bench.read("mine/trace.csv"), RECORDING);
    bench.run(&[&SIMULATE[..], &["--force", "-o", "recording.csv"]].concat()).ok();
    bench.run(&[&CALIBRATE[..], &["new.toml", "--report", "README.md", "--force"]].concat()).ok();
    assert!(bench.read("README.md").starts_with("<!DOCTYPE html>"));
    bench.run(&[&EXPORT[..], &[".", "--force"]].concat()).ok();
    assert!(bench.read("README.md").starts_with("# One soft strain sensor"));
}

/// Only outputs that can be made again are replaced: a recording of `live` cannot; a simulation can, and so can an import.
#[test]
fn only_reproducible_outputs_are_replaced() {
    let bench = Bench::new();
    let rows: String = (0..60).map(|row| format!("{},{},{}\n", row, 1600 + row % 7, row % 5)).collect();
    bench.write("rig.csv", format!("Time (s),Resistance (Ohm),Displacement (mm)\n{rows}"));
    let import = ["import", "rig.csv", "--gauge-length-mm", "40", "--align", "none", "-o", "trace.csv"];
    for _ in 0..2 {
        assert_eq!(bench.run(&import).code, Some(0), "{}", bench.run(&import).stderr);
    }
    let imported = bench.read("trace.csv");
    let recorded = format!("# made_by = ohmstrain 0.1.0 live\n{RECORDING}");
    bench.write("live-1.csv", &recorded);
    let simulated = "holds something else than a simulated recording of this program";
    for name in ["trace.csv", "live-1.csv"] {
        let message = format!("cannot write {name}: it {simulated}");
        refused(&bench, &[&SIMULATE[..], &["-o", name]].concat(), ARGUMENTS, &message);
    }
    let message = "cannot write live-1.csv: it holds something else than an imported recording";
    refused(&bench, &[&import[..7], &["live-1.csv"]].concat(), ARGUMENTS, message);
    assert!(bench.read("trace.csv") == imported && bench.read("live-1.csv") == recorded);
}

#[test]
fn what_this_program_wrote_is_replaced() {
    let bench = Bench::calibrated();
    // An empty file, as mktemp creates it, contains nothing to lose.
    bench.write("empty.csv", "");
    bench.run(&[&SIMULATE[..], &["-o", "empty.csv"]].concat()).ok();
    for _ in 0..2 {
        bench.run(&[&SIMULATE[..], &["--seed", "2", "-o", "trace.csv"]].concat()).ok();
        bench.run(&[&CALIBRATE[..], &["new.toml", "--report", "report.html"]].concat()).ok();
        bench.run(&[&EXPORT[..], &["exported"]].concat()).ok();
    }
    let refined = bench.run(&[&REFINE[..], &["new.toml"]].concat());
    assert_eq!(refined.code, Some(0), "{}", refined.stderr);
}

#[test]
fn an_input_or_another_output_is_not_replaced_whatever_it_is_called() {
    let bench = Bench::calibrated();
    std::fs::create_dir(bench.path("folder")).unwrap();
    std::fs::hard_link(bench.path("trace.csv"), bench.path("hard.csv")).unwrap();
    let mut names = vec!["trace.csv", "./trace.csv", "folder/../trace.csv", "hard.csv"];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("trace.csv", bench.path("soft.csv")).unwrap();
        names.push("soft.csv");
    }
    for name in names {
        let message = format!("cannot write {name}: it is the input trace.csv; choose another name\n");
        refused(&bench, &[&CALIBRATE[..], &[name, "--force"]].concat(), ARGUMENTS, &message);
        refused(&bench, &[&CALIBRATE[..], &["new.toml", "--force", "--report", name]].concat(), ARGUMENTS, &message);
        refused(&bench, &[&REFINE[..], &[name, "--force"]].concat(), ARGUMENTS, &message);
    }
    let message = "cannot write ./sensor.toml: it is the input sensor.toml; choose another name\n";
    refused(&bench, &[&REFINE[..], &["./sensor.toml"]].concat(), ARGUMENTS, message);
    bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml", "--save-state", "state.toml"]).ok();
    bench.run(&["plan", "--strains", "rest=0 full=0.2", "-o", "protocol.toml"]).ok();
    let resumed = ["filter", "-", "--sensor", "sensor.toml", "--resume", "state.toml", "-o", "state.toml", "--force"];
    let message = "cannot write state.toml: it is the input state.toml; choose another name\n";
    refused(&bench, &resumed, ARGUMENTS, message);
    let followed = ["simulate", "--follow", "protocol.toml", "-o", "protocol.toml", "--force"];
    let message = "cannot write protocol.toml: it is the input protocol.toml; choose another name\n";
    refused(&bench, &followed, ARGUMENTS, message);
    let message = "cannot write folder/../new.toml: it is the output new.toml; choose another name\n";
    refused(&bench, &[&CALIBRATE[..], &["new.toml", "--report", "folder/../new.toml"]].concat(), ARGUMENTS, message);
}

/// `filter -o trace.csv < trace.csv` would read what it writes.
#[cfg(unix)]
#[test]
fn the_file_on_standard_input_is_not_replaced() {
    let bench = Bench::calibrated();
    let before = bench.read("trace.csv");
    for command in ["filter", "smooth"] {
        let input = std::fs::File::open(bench.path("trace.csv")).unwrap();
        let run = std::process::Command::new(assert_cmd::cargo::cargo_bin!("ohmstrain"))
            .args([command, "--sensor", "sensor.toml", "-", "-o", "trace.csv", "--force"])
            .current_dir(bench.path("."))
            .stdin(input)
            .output()
            .unwrap();
        let stderr = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(ARGUMENTS), "{command}: {stderr}");
        assert!(stderr.contains("cannot write trace.csv: it is the input -"), "{command}: {stderr}");
    }
    assert!(bench.read("trace.csv") == before);
}

/// The recording is unreadable, too, and would be reported first if the output were checked later.
#[test]
fn an_output_that_cannot_be_written_is_noticed_before_the_work() {
    let bench = Bench::calibrated();
    bench.write("trace.csv", "no recording");
    bench.write("file", "");
    for path in ["none/new.file", "file/new.file", "folder"] {
        std::fs::create_dir_all(bench.path("folder")).unwrap();
        let message = format!("cannot write {path}: ");
        refused(&bench, &[&CALIBRATE[..], &[path]].concat(), OTHER, &message);
        refused(&bench, &[&CALIBRATE[..], &["new.toml", "--report", path]].concat(), OTHER, &message);
        refused(&bench, &[&REFINE[..], &[path]].concat(), OTHER, &message);
    }
}

/// Folders that were created for outputs are removed again.
#[test]
fn a_command_that_fails_leaves_no_folder_behind() {
    let bench = Bench::calibrated();
    bench.write("exported", "");
    refused(&bench, &[&EXPORT[..], &["exported/below"]].concat(), OTHER, "cannot make the folder exported/below");
    std::fs::create_dir(bench.path("half")).unwrap();
    bench.write("half/README.md", "Mine");
    let c = ["export", "--sensor", "sensor.toml", "--target", "c", "--dt-s", "0.2", "-o", "half"];
    refused(&bench, &c, ARGUMENTS, "cannot write half/README.md: ");
    assert_eq!(crate::common::files_in(&bench.path("half")), ["README.md"]);
}

#[cfg(unix)]
mod on_unix {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
    use std::process::Command;

    use super::*;

    #[test]
    fn a_pipe_and_a_device_take_the_bytes_and_stay() {
        let bench = Bench::calibrated();
        let made = Command::new("mkfifo").arg(bench.path("pipe")).status();
        if !made.is_ok_and(|status| status.success()) {
            eprintln!("SKIPPED: there is no mkfifo");
            return;
        }
        let pipe = bench.path("pipe");
        let reader = std::thread::spawn(move || fs::read_to_string(pipe).unwrap());
        bench.run(&[&SIMULATE[..], &["-o", "file.csv"]].concat()).ok();
        bench.run(&[&SIMULATE[..], &["-o", "pipe"]].concat()).ok();
        assert!(fs::metadata(bench.path("pipe")).unwrap().file_type().is_fifo());
        assert_eq!(reader.join().unwrap(), bench.read("file.csv"));

        symlink("/dev/null", bench.path("null")).unwrap();
        bench.run(&[&CALIBRATE[..], &["null", "--report", "null"]].concat()).ok();
        assert!(fs::symlink_metadata(bench.path("null")).unwrap().is_symlink());
    }

    /// The device fails after everything has been computed.
    #[test]
    fn an_output_that_fails_at_the_end_takes_the_others_with_it() {
        if !std::path::Path::new("/dev/full").exists() {
            eprintln!("SKIPPED: there is no /dev/full");
            return;
        }
        let bench = Bench::calibrated();
        symlink("/dev/full", bench.path("full")).unwrap();
        refused(&bench, &[&CALIBRATE[..], &["new.toml", "--report", "full"]].concat(), OTHER, "cannot write full: ");
        refused(&bench, &[&CALIBRATE[..], &["full", "--report", "new.html"]].concat(), OTHER, "cannot write full: ");
    }

    /// A symbolic link stays, and its target is written, whether it exists or not.
    #[test]
    fn a_symbolic_link_stays() {
        let bench = Bench::calibrated();
        fs::create_dir(bench.path("folder")).unwrap();
        symlink("folder/there.toml", bench.path("link.toml")).unwrap();
        for _ in 0..2 {
            bench.run(&[&CALIBRATE[..], &["link.toml"]].concat()).ok();
            assert!(fs::symlink_metadata(bench.path("link.toml")).unwrap().is_symlink());
            assert!(bench.read("folder/there.toml").starts_with("format = "));
        }
        assert_eq!(crate::common::files_in(&bench.path("folder")), ["there.toml"]);
    }

    #[test]
    fn mode_and_umask_are_kept() {
        let bench = Bench::calibrated();
        let mode = |name: &str| fs::metadata(bench.path(name)).unwrap().permissions().mode() & 0o7777;
        for kept in [0o600, 0o664] {
            fs::set_permissions(bench.path("trace.csv"), Permissions::from_mode(kept)).unwrap();
            bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
            assert_eq!(mode("trace.csv"), kept);
        }
        for (umask, expected) in [("077", 0o600), ("027", 0o640), ("002", 0o664)] {
            let name = format!("new-{umask}.csv");
            let under = format!("umask {umask}; exec \"$@\"");
            let program = assert_cmd::cargo::cargo_bin!("ohmstrain");
            let mut command = Command::new("sh");
            command.current_dir(bench.path("")).args(["-c", &under, "sh"]).arg(program);
            assert!(command.args(SIMULATE).args(["-o", &name]).status().unwrap().success());
            assert_eq!(mode(&name), expected, "{name}");
        }
    }
}
