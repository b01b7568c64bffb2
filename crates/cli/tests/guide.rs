//! Every command of the guide runs: the blocks marked `sh` of a chapter, one after another, in a folder of their own.
#![cfg(unix)]

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use assert_cmd::cargo::cargo_bin;
use tempfile::TempDir;

fn chapters() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../guide/src")
}

/// Returns the commands of a chapter; the first that fails ends them.
fn script(text: &str) -> String {
    let mut script = String::from("set -eu\n");
    let mut is_code = false;
    for line in text.lines() {
        match line {
            "```sh" => is_code = true,
            "```" => is_code = false,
            line if is_code => script += &format!("{line}\n"),
            _ => {}
        }
    }
    script
}

fn run(chapter: &str) -> TempDir {
    let text = fs::read_to_string(chapters().join(chapter)).unwrap();
    let script = script(&text);
    assert!(script.contains("ohmstrain "), "{chapter} has no command");
    let folder = TempDir::new().unwrap();
    let own = cargo_bin!("ohmstrain").parent().unwrap().to_path_buf();
    let path = env::join_paths([own].into_iter().chain(env::split_paths(&env::var_os("PATH").unwrap_or_default())));
    let mut shell = Command::new("sh");
    let done = shell.args(["-c", &script]).current_dir(folder.path()).env("PATH", path.unwrap()).output().unwrap();
    let stderr = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{chapter}: {stderr}\n{script}");
    folder
}

#[track_caller]
fn holds(folder: &TempDir, names: &[&str]) {
    for name in names {
        let file = folder.path().join(name);
        assert!(file.metadata().is_ok_and(|metadata| metadata.len() > 0), "{name}");
    }
}

#[test]
fn record() {
    holds(&run("record.md"), &["bench.csv"]);
}

#[test]
fn import() {
    let folder = run("import.md");
    let columns = |name: &str| -> Vec<Vec<f64>> {
        let text = fs::read_to_string(folder.path().join(name)).unwrap();
        let rows = text.lines().filter(|line| line.starts_with(|first: char| first.is_ascii_digit()));
        rows.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect()
    };
    let (bench, imported) = (columns("bench.csv"), columns("imported.csv"));
    assert_eq!(bench.len(), imported.len());
    for (a, b) in bench.iter().zip(&imported) {
        // Half a unit of the last digit in the rig's file: 1 ms, 1e-6 kΩ, 1e-5 mm on 30 mm.
        let rounded = [1e-3, 0.5e-3, 0.5e-5 / 30.0];
        assert!(a.iter().zip(b).zip(rounded).all(|((a, b), most)| (a - b).abs() <= 1.001 * most), "{a:?} {b:?}");
    }
}

#[test]
fn calibrate() {
    holds(&run("calibrate.md"), &["sensor.toml", "report.html", "test.html", "figures/strain-against-time.svg"]);
}

#[test]
fn filter() {
    holds(&run("filter.md"), &["estimates.csv", "smoothed.csv", "hand.toml", "hand-thumb.toml", "strains.csv"]);
}

/// Five fingers, calibrated on a person's known angles, estimate their angles on another day.
#[test]
fn glove() {
    let folder = run("glove.md");
    holds(&folder, &["glove.csv", "hand.toml", "hand-thumb.toml", "angles.csv"]);
    let text = fs::read_to_string(folder.path().join("glove.csv")).unwrap();
    let header = text.lines().find(|line| line.starts_with("time_s")).unwrap();
    assert!(header.starts_with("time_s,thumb_ohm,index_ohm,") && header.ends_with(",little_angle_deg,little_angle_sd"));
}

/// Both sketches compile: the new one with the library that the page exports.
#[test]
fn replace_map() {
    let folder = run("replace-map.md");
    holds(&folder, &["firmware"]);
    let text = fs::read_to_string(chapters().join("replace-map.md")).unwrap();
    let sketches: Vec<&str> = text.split("```cpp\n").skip(1).filter_map(|block| block.split("```").next()).collect();
    assert_eq!(sketches.len(), 2);
    let Some(compiler) = crate::export::compilers().first().map(|c| if *c == "gcc" { "g++" } else { "clang++" }) else {
        return;
    };
    let arduino = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/exported-c");
    for sketch in sketches {
        fs::write(folder.path().join("sketch.cpp"), sketch).unwrap();
        let flags = ["-std=gnu++11", "-fsyntax-only", "-Wall", "-Werror", "-I", arduino, "-include", "Arduino.h"];
        let compiled = Command::new(compiler)
            .current_dir(folder.path())
            .args(flags)
            .args(["-I", "firmware/src", "sketch.cpp"])
            .output();
        let compiled = compiled.unwrap();
        assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    }
}

#[test]
fn chip() {
    holds(&run("chip.md"), &["firmware", "module"]);
}

#[test]
fn questions() {
    holds(&run("which-motion.md"), &["one-speed.toml", "mixed.csv"]);
    holds(&run("wide-interval.md"), &["estimates.csv", "undoubted.csv"]);
    holds(&run("tau-and-gain.md"), &["sensor.toml", "report.html"]);
    holds(&run("what-limits.md"), &["sensor.toml", "report.html"]);
    holds(&run("which-estimator.md"), &["bench.csv"]);
}

#[test]
fn the_summary_names_every_chapter() {
    let summary = fs::read_to_string(chapters().join("SUMMARY.md")).unwrap();
    for entry in fs::read_dir(chapters()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(name == "SUMMARY.md" || summary.contains(&format!("({name})")), "{name}");
    }
}

/// Chapters without commands to run name commands, too.
#[test]
fn what_is_only_named_exists() {
    for entry in fs::read_dir(chapters()).unwrap() {
        let text = fs::read_to_string(entry.unwrap().path()).unwrap();
        for at in text.match_indices("`ohmstrain ").map(|(at, start)| at + start.len()) {
            let command: String = text[at..].chars().take_while(|c| c.is_ascii_lowercase() || *c == '-').collect();
            let done = Command::new(cargo_bin!("ohmstrain")).args([&command, "--help"]).output().unwrap();
            assert!(done.status.success(), "{command}");
        }
    }
}
