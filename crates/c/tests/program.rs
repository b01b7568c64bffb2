#![cfg(unix)]

use std::env;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

use ohmstrain::Sensor;

use super::{SENSOR, rows};

/// A program in C, linked with the static library, prints the numbers of the Rust library.
#[test]
fn a_program_in_c_filters_a_recording() {
    let made_of = env::current_exe().unwrap();
    let libraries = made_of.ancestors().nth(1).unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("filter");
    let flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1"];
    let compiled = Command::new(env::var_os("CC").unwrap_or("cc".into()))
        .args(flags)
        .arg(root.join("examples/filter.c"))
        .arg("-I")
        .arg(root.join("include"))
        .arg(libraries.join("libohmstrain_c.a"))
        .args(["-lm", "-lpthread", "-ldl", "-o"])
        .arg(&program)
        .output();
    let Ok(compiled) = compiled else {
        assert!(env::var_os("OHMSTRAIN_REQUIRE_C").is_none(), "there is no C compiler");
        eprintln!("NOT TESTED: there is no C compiler");
        return;
    };
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));

    let sensor = Sensor::from_toml(&std::fs::read_to_string(SENSOR).unwrap()).unwrap();
    let mut filter = sensor.filter().build().unwrap();
    let (mut readings, mut expected) = (String::from("time_s,resistance_ohm\n"), vec![]);
    for (time_s, reading) in rows() {
        writeln!(readings, "{time_s},{reading}").unwrap();
        let row = filter.step(time_s, reading).unwrap();
        expected.push((row.strain, row.strain_sd));
    }
    let file = folder.path().join("readings.csv");
    std::fs::write(&file, readings).unwrap();
    let done = Command::new(&program).arg(SENSOR).arg(&file).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let printed = String::from_utf8(done.stdout).unwrap();
    let numbers = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        (cells[1], cells[2])
    };
    assert_eq!(printed.lines().skip(1).map(numbers).collect::<Vec<_>>(), expected);

    let wrong = Command::new(&program).arg(&file).arg(&file).output().unwrap();
    let message = String::from_utf8_lossy(&wrong.stderr);
    assert!(wrong.status.code() == Some(1) && message.contains("readings.csv"), "{message}");
}
