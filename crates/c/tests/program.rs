#![cfg(unix)]

use std::fmt::Write;
use std::mem::{offset_of, size_of};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::{env, fs};

use ohmstrain::{Flag, Sensor};
use ohmstrain_c::Estimate;

use super::{SENSOR, rows};

/// Compiles a program with the static library; `None` without a compiler.
fn compiled(folder: &Path, source: &Path, compiler: &str, standard: &str) -> Option<PathBuf> {
    let made_of = env::current_exe().unwrap();
    let program = folder.join("program");
    let done = Command::new(compiler)
        .args([standard, "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1"])
        .arg(source)
        .args(["-I", concat!(env!("CARGO_MANIFEST_DIR"), "/include")])
        .arg(made_of.with_file_name("libohmstrain_c.a"))
        .args(["-lm", "-lpthread", "-ldl", "-o"])
        .arg(&program)
        .output();
    let Ok(done) = done else {
        assert!(env::var_os("OHMSTRAIN_REQUIRE_C").is_none(), "there is no {compiler}");
        eprintln!("NOT TESTED: there is no {compiler}");
        return None;
    };
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    Some(program)
}

fn run(program: &Path, arguments: &[&Path]) -> Output {
    Command::new(program).args(arguments).output().unwrap()
}

/// The example prints the numbers of the Rust library, and refuses what is no sensor and no row.
#[test]
fn a_program_in_c_filters_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/filter.c");
    let Some(program) = compiled(folder.path(), &source, "cc", "-std=c99") else { return };
    let sensor = Sensor::from_toml(&fs::read_to_string(SENSOR).unwrap()).unwrap();
    let mut filter = sensor.filter().build().unwrap();
    let (mut readings, mut expected) =
        (String::from("time_s,resistance_ohm\n"), String::from("time_s,strain,strain_sd,flags\n"));
    for (time_s, reading) in rows() {
        // A missing reading is an empty cell.
        let cell = if reading.is_nan() { String::new() } else { reading.to_string() };
        writeln!(readings, "{time_s},{cell}").unwrap();
        let row = filter.step(time_s, reading).unwrap();
        let flags: u32 = Flag::ALL.iter().enumerate().map(|(bit, flag)| u32::from(row.flags.has(*flag)) << bit).sum();
        writeln!(expected, "{time_s},{},{},{flags}", row.strain, row.strain_sd).unwrap();
    }
    let file = folder.path().join("readings.csv");
    fs::write(&file, &readings).unwrap();
    let done = run(&program, &[SENSOR.as_ref(), &file]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let cells = |text: &str| -> Vec<Vec<f64>> {
        text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect()
    };
    assert_eq!(cells(&String::from_utf8(done.stdout).unwrap()), cells(&expected));

    for (line, wrong) in [("12,1700\n", "line 3: the time step is negative"), ("x\n", "line 2: expected a time")] {
        fs::write(&file, format!("time_s,resistance_ohm\n{line}1,1700\n")).unwrap();
        let done = run(&program, &[SENSOR.as_ref(), &file]);
        let message = String::from_utf8_lossy(&done.stderr);
        assert!(done.status.code() == Some(1) && message.starts_with(wrong), "{message}");
    }
    let done = run(&program, &[&file, &file]);
    let message = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.code() == Some(1) && message.contains("readings.csv"), "{message}");
}

/// The README's program compiles, and prints an estimate.
#[test]
fn the_program_in_the_readme_runs() {
    let folder = tempfile::tempdir().unwrap();
    let readme = include_str!("../README.md");
    let (_, after) = readme.split_once("```c\n").unwrap();
    let source = folder.path().join("readme.c");
    fs::write(&source, after.split_once("```").unwrap().0).unwrap();
    let Some(program) = compiled(folder.path(), &source, "cc", "-std=c99") else { return };
    fs::copy(SENSOR, folder.path().join("sensor.toml")).unwrap();
    let done = Command::new(&program).current_dir(folder.path()).output().unwrap();
    assert!(done.status.success() && String::from_utf8_lossy(&done.stdout).contains(" +- "), "{done:?}");
}

/// The header's estimate has the layout of the library's, in C and in C++.
#[test]
fn the_header_has_the_layout_of_the_library() {
    macro_rules! offsets {
        ($($field:ident),* $(,)?) => {
            [$((stringify!($field), offset_of!(Estimate, $field))),*]
        };
    }
    let offsets = offsets![
        time_s,
        strain,
        strain_sd,
        strain_rate,
        strain_rate_sd,
        relaxation,
        relaxation_sd,
        baseline,
        settled_resistance,
        settled_resistance_sd,
        p_extend,
        p_hold,
        p_retract,
        p_beyond_border,
        nis,
        angle_deg,
        angle_sd,
        flags,
    ];
    let mut source =
        String::from("#include <stddef.h>\n#include <stdio.h>\n#include \"ohmstrain_c.h\"\nint main(void)\n{\n");
    let mut expected = format!("{}\n", size_of::<Estimate>());
    writeln!(source, "printf(\"%d\\n\", (int)sizeof(ohmc_estimate));").unwrap();
    for (name, offset) in offsets {
        writeln!(source, "printf(\"%d\\n\", (int)offsetof(ohmc_estimate, {name}));").unwrap();
        writeln!(expected, "{offset}").unwrap();
    }
    source.push_str("return ohmc_version() == NULL;\n}\n");
    for (file, compiler, standard) in [("layout.c", "cc", "-std=c99"), ("layout.cpp", "c++", "-std=c++11")] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(file);
        fs::write(&path, &source).unwrap();
        let Some(program) = compiled(folder.path(), &path, compiler, standard) else { continue };
        let done = run(&program, &[]);
        assert!(done.status.success());
        assert_eq!(String::from_utf8_lossy(&done.stdout), expected, "{compiler}");
    }
}
