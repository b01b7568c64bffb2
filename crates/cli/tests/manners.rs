//! Behaviour towards users: help, hints, verbosity, completions and manuals.

use crate::common::{Bench, SIMULATE, files_in};

const COMMANDS: [&str; 22] = [
    "demo",
    "example",
    "serve",
    "inspect",
    "import",
    "plan",
    "record",
    "simulate",
    "calibrate",
    "refine",
    "fit-law",
    "filter",
    "live",
    "hand",
    "smooth",
    "evaluate",
    "batch",
    "fleet",
    "export",
    "serial-check",
    "completions",
    "man",
];

#[test]
fn help_leads_with_an_example() {
    let bench = Bench::new();
    for command in COMMANDS {
        for flag in ["-h", "--help"] {
            let help = bench.run(&[command, flag]).ok();
            assert!(help.starts_with(&format!("Example: ohmstrain {command} ")), "{help}");
        }
    }
    let all = bench.run(&["--help"]).ok();
    let listed = |line: &&str| line.starts_with("  ") && line.as_bytes()[2].is_ascii_lowercase();
    let names = all.lines().filter(listed).map(|line| line.split_whitespace().next().unwrap());
    assert_eq!(names.collect::<Vec<_>>(), [&COMMANDS[..], &["help"]].concat(), "{all}");
}

#[test]
fn what_is_missing_is_shown_in_an_example() {
    let bench = Bench::new();
    let run = bench.run(&["calibrate", "trace.csv"]);
    assert_eq!(run.code, Some(2));
    assert!(run.stderr.contains("--output <sensor.toml>"), "{}", run.stderr);
    assert!(run.stderr.ends_with("Example: ohmstrain calibrate bench.csv -o sensor.toml --report report.html\n"));
}

#[test]
fn a_swapped_recording_and_sensor_file_are_recognised() {
    let bench = Bench::calibrated();
    for command in ["filter", "smooth", "evaluate"] {
        let swapped = "trace.csv is a recording, not a sensor file: give --sensor what `ohmstrain calibrate` wrote, and the \
                       recording by itself";
        bench.run(&[command, "sensor.toml", "--sensor", "trace.csv"]).fails(4, swapped);
    }
    let sensor = "sensor.toml is a sensor file, not a recording: give it to --sensor, and the recording here";
    bench.run(&["evaluate", "sensor.toml", "--sensor", "sensor.toml"]).fails(4, sensor);
    bench.run(&["calibrate", "sensor.toml", "-o", "new.toml"]).fails(4, sensor);
}

#[test]
fn times_outside_of_a_recording_are_answered_with_its_range() {
    let bench = Bench::calibrated();
    let range = "the recording goes from 0 to 400 s";
    let calibrate = ["calibrate", "trace.csv", "-o", "new.toml"];
    for (flags, named) in [
        (&["--from", "900"][..], "--from 900"),
        (&["--until", "-5"], "--until -5"),
        (&["--from", "60", "--until", "50"], "--from 60 --until 50"),
    ] {
        let message = format!("trace.csv: no row is left by {named}; {range}");
        bench.run(&[&calibrate[..], flags].concat()).fails(4, &message);
        let refine = ["refine", "trace.csv", "--sensor", "sensor.toml", "-o", "new.toml"];
        bench.run(&[&refine[..], flags].concat()).fails(4, &message);
    }
}

#[test]
fn quiet_says_nothing_and_verbose_what_is_done() {
    let bench = Bench::new();
    bench.run(&[&SIMULATE[..], &["-o", "trace.csv"]].concat()).ok();
    let quick = ["--until", "60", "--estimator", "ekf", "--branches", "1", "-o", "sensor.toml"];
    let calibrate = [&["calibrate", "trace.csv", "trace.csv"], &quick[..]].concat();
    let usual = bench.run(&calibrate);
    assert!(usual.warnings.iter().any(|warning| warning.contains("the same rows")), "{:?}", usual.warnings);
    let quiet = bench.run(&[&calibrate[..], &["--quiet"]].concat());
    assert!(quiet.warnings.is_empty() && quiet.ok().is_empty());
    let verbose = bench.run(&[&calibrate[..], &["-v"]].concat());
    for stage in ["fitting the law", "fitting noise and motion", "checking parts left out"] {
        assert!(verbose.stderr.lines().any(|line| line.starts_with("ohmstrain: ") && line.ends_with(stage)), "{stage}");
    }
    assert_eq!(bench.run(&["demo", "-q", "-v"]).code, Some(2));
}

#[test]
fn shells_and_manuals_know_every_command() {
    let bench = Bench::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = bench.run(&["completions", shell]).ok();
        assert!(COMMANDS.iter().all(|command| script.contains(command)), "{shell}");
    }
    bench.run(&["man", "-o", "man"]).ok();
    let pages = files_in(&bench.path("man"));
    assert!(pages.contains(&"ohmstrain.1".to_owned()), "{pages:?}");
    for command in COMMANDS {
        assert!(pages.contains(&format!("ohmstrain-{command}.1")), "{command}: {pages:?}");
    }
}

/// No law describes a movement with random readings.
#[test]
fn fits_that_say_little_are_warned_of_and_tables_have_units() {
    let bench = Bench::new();
    let simulate = ["simulate", "--protocol", "extend-hold", "--sample-rate-hz", "10", "-o", "trace.csv"];
    bench.run(&simulate).ok();
    let table = bench.run(&["fit-law", "trace.csv", "--table"]).ok();
    for column in ["| tau0_s ", "| r_start, ohm "] {
        assert!(table.contains(column), "{column}: {table}");
    }
    let noise = |k: usize| 1000 + (k * 7919) % 101;
    let rows: String = (0..200).map(|k| format!("{k},{}\n", noise(k))).collect();
    bench.write("noise.csv", format!("time_s,resistance_ohm\n{rows}"));
    let run = bench.run(&["fit-law", "--law", "eq9", "--segment", "whole", "noise.csv"]);
    assert!(run.warnings.iter().any(|warning| warning.contains("hardly describes")), "{:?}", run.warnings);
    let run = bench.run(&["fit-law", "--compare", "kww,prony:1", "--segment", "whole", "noise.csv"]);
    let of_law = |law: &str| run.warnings.iter().any(|w| w.contains(&format!("{law}: whole: R^2 is ")));
    assert!(of_law("kww") && of_law("prony:1"), "{:?}", run.warnings);
    // Poor fits are counted if there are many.
    let triangle = |k: usize| (k % 20).min(20 - k % 20) as f64 / 50.0;
    let rows: String = (0..400).map(|k| format!("{}.{},{},{}\n", k / 10, k % 10, noise(k), triangle(k))).collect();
    bench.write("many.csv", format!("time_s,resistance_ohm,strain\n{rows}"));
    let run = bench.run(&["fit-law", "many.csv", "--table"]);
    assert!(run.warnings.len() < 7, "{:?}", run.warnings);
    assert!(run.warnings.iter().any(|warning| warning.contains("R^2 is below 0.9 in ")), "{:?}", run.warnings);
}

/// A table of numbers is unreadable if the terminal wraps it.
#[test]
fn no_table_and_no_help_is_wider_than_a_hundred_columns() {
    let bench = Bench::calibrated();
    bench.run(&["simulate", "--protocol", "extend-hold", "--sample-rate-hz", "10", "-o", "hold.csv"]).ok();
    let narrow = |arguments: &[&str]| {
        let run = bench.run(arguments);
        assert_eq!(run.code, Some(0), "{}: {}", run.command, run.stderr);
        // clap does not wrap the line of usage.
        for line in run.stdout.lines().filter(|line| !line.starts_with("Usage: ")) {
            assert!(line.chars().count() <= 100, "{}: {line}", run.command);
        }
        run
    };
    for flags in [&[][..], &["--table"], &["--compare", "eq1,kww,prony:2", "--segment", "hold"]] {
        narrow(&[&["fit-law", "hold.csv"], flags].concat());
    }
    narrow(&["plan", "--sensor", "sensor.toml"]);
    narrow(&["refine", "trace.csv", "--sensor", "sensor.toml", "-o", "refined.toml", "--parameters", "reading_sd"]);
    let calibrate = ["calibrate", "trace.csv", "--until", "120", "--estimator", "ekf", "--branches", "1"];
    narrow(&[&calibrate[..], &["--explain", "-o", "new.toml"]].concat());
    for command in COMMANDS {
        narrow(&[command, "--help"]);
    }
}

/// Errors once contained only a name, without the kind of the file.
#[test]
fn errors_name_the_kind_of_file_and_the_missing_part() {
    let bench = Bench::calibrated();
    let estimates = bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml"]).stdout;
    bench.write("estimates.csv", estimates);
    bench.write("hand.toml", "format = 1\n[[joints]]\nname = \"a\"\n");
    let hand = "hand.toml is the description of a hand, not of a sensor: give it to `ohmstrain hand`, or to `smooth`, `live`, `evaluate`, `export` or `batch`";
    for arguments in [
        &["inspect", "hand.toml"][..],
        &["filter", "trace.csv", "--sensor", "hand.toml"],
        &["smooth", "hand.toml", "--sensor", "sensor.toml"],
    ] {
        bench.run(arguments).fails(4, hand);
    }
    let cases: [(&[&str], i32, &str); 5] = [
        (&["simulate", "-o", "no/such/s.csv"], 1, "cannot write no/such/s.csv: there is no folder no/such"),
        (
            &["hand", "trace.csv"],
            4,
            "trace.csv is a recording, not the description of a hand: give hand.toml first, and the recording after it",
        ),
        (
            &["inspect", "sensor.toml"],
            4,
            "sensor.toml is a sensor file: give it to --sensor of `filter`, `smooth`, `evaluate` or `live`",
        ),
        (
            &["inspect", "estimates.csv"],
            4,
            "estimates.csv has estimates, what `filter` or `smooth` made of a recording: give the recording itself",
        ),
        (
            &["evaluate", "trace.csv", "--sensor", "sensor.toml", "--from", "1e6"],
            4,
            "trace.csv: no row is left by --from 1000000; the recording goes from 0 to 400 s",
        ),
    ];
    for (arguments, code, message) in cases {
        bench.run(arguments).fails(code, message);
    }
    let gate = bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml", "--gate", "-1"]);
    assert!(gate.stderr.contains("'-1' for '--gate <X>': expected a positive number"), "{}", gate.stderr);
    let inspected = bench.run(&["inspect", "trace.csv"]).ok();
    let next = "it is a trace already and needs no import; go on with\nohmstrain calibrate trace.csv -o sensor.toml\n";
    assert!(inspected.ends_with(next), "{inspected}");
    // Strain in percent is not accepted as strain until the user confirms the unit.
    let percent = bench.read("trace.csv").replace("strain\n", "strain (%)\n");
    bench.write("percent.csv", percent);
    assert!(bench.run(&["inspect", "percent.csv"]).ok().contains("import it with"));
}
