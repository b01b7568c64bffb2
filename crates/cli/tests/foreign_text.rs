//! Text of files and file names on its way to a terminal: nothing in it moves, colours or reorders its surroundings.

use crate::common::{Bench, Run};

/// Red text, a screen cleared by an 8-bit control, and right-to-left text.
const EVIL: &str = "\u{1b}[31mred\u{9b}2J\u{202e}vsc";

#[track_caller]
fn assert_printable(run: &Run) {
    let output = [&run.stdout, &run.stderr, &run.warnings.concat()].map(String::as_str).concat();
    let is_shown = |c: char| c == '\n' || !(c.is_control() || ('\u{202a}'..='\u{202e}').contains(&c));
    assert!(output.chars().all(is_shown), "{}: {output:?}", run.command);
    // The argument parser drops the colour.
    let shown = ["\\u{1b}[31mred", "\\u001b[31mred", "red\\u{9b}2J"];
    assert!(shown.iter().any(|shown| output.contains(shown)), "{}: {output}", run.command);
}

#[test]
fn messages_about_files_are_printable() {
    let bench = Bench::calibrated();
    let name = if cfg!(windows) { "evil.csv".to_owned() } else { format!("{EVIL}.csv") };
    let rows: String = (0..40).map(|row| format!("{}.5,{},{}\n", row, 1600 + row % 7, row % 5)).collect();
    bench.write(&name, format!("Time (s),R {EVIL} (Ohm),Displacement (mm)\n{rows}"));
    // In TOML's escapes, since control characters themselves are invalid.
    let escape = |c: char| if c.is_ascii_graphic() { c.to_string() } else { format!("\\u{:04x}", u32::from(c)) };
    let escaped: String = EVIL.chars().map(escape).collect();
    bench.write("evil.toml", format!("format = 9\nmade_by = \"ohmstrain 0.1.0\"\nquantity = \"{escaped}\"\n"));
    bench.write("bad.csv", format!("time_s,resistance_ohm\n0,{EVIL}\n"));
    bench.write("meta.csv", format!("# strain_unit = {EVIL}\ntime_s,resistance_ohm,strain\n0,1600,0\n"));
    let columns = format!("strain,{EVIL}");
    let commands: [&[&str]; 8] = [
        &["inspect", &name],
        &["inspect", &name, "--json"],
        &["filter", &name, "--sensor", "sensor.toml"],
        &["filter", "trace.csv", "--sensor", "evil.toml"],
        &["filter", "bad.csv", "--sensor", "sensor.toml"],
        &["calibrate", "meta.csv", "-o", "new.toml"],
        &["smooth", "trace.csv", "--sensor", "sensor.toml", "--columns", &columns],
        // Message of the argument parser.
        &["smooth", "trace.csv", "--sensor", "sensor.toml", EVIL],
    ];
    for arguments in commands {
        assert_printable(&bench.run(arguments));
    }
}

/// JSON contains the text itself.
#[test]
fn json_holds_the_text_itself() {
    let bench = Bench::new();
    let rows: String = (0..40).map(|row| format!("{row},{}\n", 1600 + row % 7)).collect();
    bench.write("rig.csv", format!("Time (s),R {EVIL} (Ohm)\n{rows}"));
    let json: serde_json::Value = serde_json::from_str(&bench.run(&["inspect", "rig.csv", "--json"]).ok()).unwrap();
    let heading = json["files"][0]["columns"][1]["heading"].as_str().unwrap();
    assert!(heading.contains("\u{9b}2J\u{202e}vsc"), "{heading:?}");
}

/// A suggested command can be printed, copied into a shell, and run.
#[cfg(unix)]
#[test]
fn a_suggested_command_names_any_file() {
    let bench = Bench::new();
    let rows: String = (0..40).map(|row| format!("{row},{},{}\n", 1600 + row % 7, row % 5)).collect();
    let name = format!("it's {EVIL}.csv");
    bench.write(&name, format!("Time (s),Resistance (Ohm),Displacement (mm)\n{rows}"));
    let command = bench.run(&["inspect", "--suggest", &name, "--gauge-length-mm", "40"]).ok();
    assert!(command.contains(r"$'it\'s \033[31mred\302\233") && command.trim().chars().all(|c| !c.is_control()));
    let words = command.trim().replacen("ohmstrain", assert_cmd::cargo::cargo_bin!("ohmstrain").to_str().unwrap(), 1);
    match std::process::Command::new("bash").current_dir(bench.path("")).args(["-c", &words]).status() {
        Ok(status) => assert!(status.success() && bench.path("trace.csv").is_file(), "{words}"),
        Err(_) => eprintln!("SKIPPED: there is no bash"),
    }
}
