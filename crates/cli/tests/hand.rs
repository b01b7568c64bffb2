//! A hand of five fingers, simulated one by one, then all of them in one recording; and the output of `plan`.

use crate::common::{Bench, Csv, Run, SIMULATE, change_rows};

const FINGERS: [&str; 5] = ["thumb", "index", "middle", "ring", "little"];
/// The simulated sensor is stretched by a third of its length; that is 90° over 6.4 mm on 30 mm.
const JOINT: &str = "prestrain=0 moment_arm_mm=6.4 gauge_length_mm=30";
/// Scale of `JOINT`, degrees per strain.
const DEGREES: f64 = 180.0 / std::f64::consts::PI * 30.0 / 6.4;

/// Returns a folder with a sensor and a recording per finger, `hand.toml`, and `hand.csv` with all readings. Each sensor has intervals of
/// its own width.
fn hand() -> (Bench, usize) {
    let bench = Bench::calibrated();
    let mut traces = vec![];
    let mut description = String::from("format = 1\n");
    for (place, finger) in FINGERS.iter().enumerate() {
        let (seed, trace, sensor) = (format!("{}", place + 1), format!("{finger}.csv"), format!("{finger}.toml"));
        bench.run(&[&SIMULATE[..], &["--seed", &seed, "-o", &trace]].concat()).ok();
        let wider = |line: &str| match line.strip_prefix("strain_sd_scale = ") {
            Some(scale) => {
                format!("strain_sd_scale = {:?}\n", scale.parse::<f64>().unwrap() * (1.0 + 0.1 * place as f64))
            }
            None => format!("{line}\n"),
        };
        bench.write(&sensor, bench.read("sensor.toml").lines().map(wider).collect::<String>());
        description += &format!(
            "[[joints]]\nname = \"{finger}\"\ncolumn = \"{finger}_ohm\"\nsensor = \"{sensor}\"\njoint = \"{JOINT}\"\n"
        );
        traces.push(Csv::new(&bench.read(&trace)));
    }
    bench.write("hand.toml", description);
    let names: Vec<String> = FINGERS.iter().map(|finger| format!("{finger}_ohm")).collect();
    let mut all = format!("time_s,{}\n", names.join(","));
    for row in 0..traces[0].len() {
        let cells: Vec<&str> = traces.iter().map(|trace| trace.cells("resistance_ohm")[row]).collect();
        all += &format!("{},{}\n", traces[0].cells("time_s")[row], cells.join(","));
    }
    bench.write("hand.csv", all);
    let rows = traces[0].len();
    (bench, rows)
}

/// Returns a folder with a sensor and a recording, and with a hand of two joints of that sensor, the second of which sees the recording
/// backwards: `pair.toml`, `pair.csv`, and `back.csv` with the readings of the second joint alone.
fn pair() -> Bench {
    let bench = Bench::calibrated();
    let trace = Csv::new(&bench.read("trace.csv"));
    let (times, ohms, strains) = (trace.cells("time_s"), trace.cells("resistance_ohm"), trace.cells("strain"));
    let rows = trace.len();
    let (mut both, mut back) =
        ("time_s,a_ohm,a_strain,b_ohm,b_strain\n".to_owned(), "time_s,resistance_ohm,strain\n".to_owned());
    for row in 0..rows {
        let last = rows - 1 - row;
        both += &format!("{},{},{},{},{}\n", times[row], ohms[row], strains[row], ohms[last], strains[last]);
        back += &format!("{},{},{}\n", times[row], ohms[last], strains[last]);
    }
    let joint =
        |name: &str| format!("[[joints]]\nname = \"{name}\"\ncolumn = \"{name}_ohm\"\nsensor = \"sensor.toml\"\n");
    bench.write("pair.csv", both);
    bench.write("back.csv", back);
    bench.write("pair.toml", format!("format = 1\n{}{}", joint("a"), joint("b")));
    bench
}

/// Each joint's smoothed strain equals that of `smooth` alone, and its scores those of `evaluate`.
#[test]
fn a_hand_is_smoothed_and_scored_joint_by_joint() {
    let bench = pair();
    let both = Csv::new(&bench.run(&["smooth", "pair.csv", "--sensor", "pair.toml"]).ok());
    assert_eq!(both.header, "time_s,a_strain,a_strain_sd,b_strain,b_strain_sd,flags");
    let scored = bench.run(&["evaluate", "pair.csv", "--sensor", "pair.toml", "--json"]).ok();
    let scored: serde_json::Value = serde_json::from_str(&scored).unwrap();
    for (place, (joint, file)) in [("a", "trace.csv"), ("b", "back.csv")].into_iter().enumerate() {
        let alone = Csv::new(&bench.run(&["smooth", file, "--sensor", "sensor.toml"]).ok());
        assert_eq!(both.cells(&format!("{joint}_strain")), alone.cells("strain"), "{joint}");
        assert_eq!(both.cells(&format!("{joint}_strain_sd")), alone.cells("strain_sd"), "{joint}");
        let one = bench.run(&["evaluate", file, "--sensor", "sensor.toml", "--json"]).ok();
        let one: serde_json::Value = serde_json::from_str(&one).unwrap();
        let found = &scored["joints"][place];
        assert_eq!((&found["fused"]["rmse"], &found["smoothed"]["rmse"]), rmse_of(&one), "{joint}");
    }
    let evaluate = ["evaluate", "pair.csv", "pair.csv", "--sensor", "pair.toml"];
    let several: serde_json::Value =
        serde_json::from_str(&bench.run(&[&evaluate[..], &["--json"]].concat()).ok()).unwrap();
    assert!((0..2).all(|place| several["recordings"][place]["joints"] == scored["joints"]), "{several}");
    let late = bench.run(&[&evaluate[..], &["--from", "9999"]].concat());
    late.fails(4, "pair.csv: no row is left by --from 9999; the recording goes from 0 to 400 s");
    for (flags, refused) in [
        (["--estimator", "ekf"], "--estimator is for one sensor"),
        (["--rest-resistance", "1600"], "--rest-resistance is for one sensor"),
        (["--columns", "time_s"], "--columns is for one sensor"),
        (["--format", "parquet"], "--format parquet is for one sensor"),
    ] {
        let run = bench.run(&[&["smooth", "pair.csv", "--sensor", "pair.toml"][..], &flags].concat());
        assert!(run.code == Some(2) && run.stderr.contains(refused), "{}", run.stderr);
    }
    // A description by hand may have comments.
    bench.write("noted.toml", bench.read("pair.toml").replace("[[joints]]", "[[joints]]  # of the left hand"));
    let noted = Csv::new(&bench.run(&["smooth", "pair.csv", "--sensor", "noted.toml"]).ok());
    assert_eq!(noted.cells("a_strain"), both.cells("a_strain"));
    // A stream that was joined within a line.
    let late = format!("00,16,17\n{}", bench.read("pair.csv"));
    let angles = bench.feed(&["hand", "pair.toml", "--skip-bad"], late.clone());
    assert!(angles.warnings.concat().contains("1 line was skipped"), "{}", angles.stderr);
    let strict = bench.feed(&["hand", "pair.toml"], late);
    assert!(strict.code == Some(4) && strict.stderr.contains("stdin:1: expected a header"), "{}", strict.stderr);
    bench.write("short.csv", "time_s,a_ohm,b_ohm\n0,1600,1600\n1,x,1600\n");
    let run = bench.run(&["smooth", "short.csv", "--sensor", "pair.toml", "-o", "none.csv"]);
    assert!(run.code == Some(4) && run.stderr.contains("short.csv:3:"), "{}", run.stderr);
    assert!(!bench.path("none.csv").exists());
}

/// Returns the errors of filter and smoother in the JSON of `evaluate`.
fn rmse_of(json: &serde_json::Value) -> (&serde_json::Value, &serde_json::Value) {
    let scores = &json["recordings"][0];
    (&scores["rmse"], &scores["smoother"]["rmse"])
}

/// A batch writes what each command prints, and does again what another file of a sensor changes.
#[test]
fn hands_in_batches() {
    let bench = pair();
    for (command, single) in [
        ("hand", bench.run(&["hand", "pair.toml", "pair.csv"]).ok()),
        ("smooth", bench.run(&["smooth", "pair.csv", "--sensor", "pair.toml"]).ok()),
        ("evaluate", bench.run(&["evaluate", "pair.csv", "--sensor", "pair.toml", "--json"]).ok()),
    ] {
        let batch = ["batch", command, "--sensor", "pair.toml", "-o", command, "pair.csv"];
        assert!(bench.run(&batch).stderr.contains("1 done, 0 done before"), "{command}");
        let ending = if command == "evaluate" { "json" } else { "csv" };
        assert_eq!(bench.read(&format!("{command}/pair.{ending}")), single, "{command}");
        assert!(bench.run(&batch).stderr.contains("0 done, 1 done before"), "{command}");
    }
    // The description stays as it is; the file of a sensor that it names does not.
    bench.write("sensor.toml", bench.read("sensor.toml") + "\n");
    let again = bench.run(&["batch", "hand", "--sensor", "pair.toml", "-o", "hand", "pair.csv"]);
    assert!(again.stderr.contains("1 done, 0 done before"), "{}", again.stderr);
    let refused = bench.run(&["batch", "hand", "pair.toml", "pair.csv", "-o", "odd"]);
    assert!(
        refused.code == Some(2) && refused.stderr.contains("expected the hand.toml as --sensor"),
        "{}",
        refused.stderr
    );
    let refused = bench.run(&["batch", "filter", "--sensor", "pair.toml", "-o", "filtered", "pair.csv"]);
    assert!(refused.code == Some(4) && refused.stderr.contains("ohmstrain hand"), "{}", refused.stderr);
}

fn in_kiloohm(number: f64) -> String {
    // Times are not changed.
    if number > 1000.0 { (number / 1000.0).to_string() } else { number.to_string() }
}

#[test]
fn all_angles_of_a_hand() {
    let (bench, rows) = hand();
    let shown = bench.run(&["hand", "hand.toml", "hand.csv"]).ok();
    let angles = Csv::new(&shown);
    assert!(angles.header.starts_with("time_s,thumb_deg,thumb_sd_deg,index_deg,"));
    assert_eq!(angles.len(), rows);
    for finger in FINGERS {
        // Each finger's estimates equal those of `filter` alone.
        let alone =
            bench.run(&["filter", &format!("{finger}.csv"), "--sensor", &format!("{finger}.toml"), "--joint", JOINT]);
        let alone = Csv::new(&alone.ok());
        assert_eq!(angles.cells(&format!("{finger}_deg")), alone.cells("angle_deg"), "{finger}");
        assert_eq!(angles.cells(&format!("{finger}_sd_deg")), alone.cells("angle_sd"), "{finger}");
    }
    // Into a file, twice: its own output is replaced silently, an input never.
    for _ in 0..2 {
        assert_eq!(bench.run(&["hand", "hand.toml", "hand.csv", "-o", "angles.csv"]).ok(), "");
        assert_eq!(bench.read("angles.csv"), shown);
    }
    let refused = bench.run(&["hand", "hand.toml", "hand.csv", "-o", "thumb.toml", "--force"]);
    assert!(refused.code == Some(2) && refused.stderr.contains("it is the input"), "{}", refused.stderr);
    let garbage = bench.read("hand.csv") + "1e9,1,2\n";
    let strict = bench.feed(&["hand", "hand.toml"], garbage.clone());
    assert_eq!(strict.code, Some(4), "{}", strict.stderr);
    let skipping = bench.feed(&["hand", "hand.toml", "--skip-bad"], garbage);
    // If a recording ends in an error, the output file is unchanged.
    bench.write("broken.csv", bench.read("hand.csv") + "1e9,1,2\n");
    assert_eq!(bench.run(&["hand", "hand.toml", "broken.csv", "-o", "angles.csv"]).code, Some(4));
    assert_eq!(bench.read("angles.csv"), shown);
    assert!(skipping.warnings.concat().contains("1 line was skipped"));
    assert_eq!(Csv::new(&skipping.ok()).len(), angles.len());

    let refused = bench.run(&["hand", "hand.toml", "thumb.csv"]);
    assert!(refused.code == Some(4) && refused.stderr.contains("expected a column `thumb_ohm`"), "{}", refused.stderr);
    // Another unit raises a question, a file of another kind is named as such.
    let column =
        |row: &str| row.split(',').map(|cell| cell.parse().map_or(cell.to_owned(), in_kiloohm)).collect::<Vec<_>>();
    let kohm: Vec<String> = bench.read("hand.csv").lines().map(|row| column(row).join(",")).collect();
    bench.write("kohm.csv", kohm.join("\n"));
    bench.write("binary.csv", b"\x1f\x8b\x08\x08\xff\xfe\x01\n");
    bench.write("nothing.csv", "time_s,thumb_ohm\n");
    let named: String = FINGERS.iter().map(|finger| format!("{finger}_ohm,")).collect();
    bench.write("timeless.csv", format!("{named}\n1,2,3,4,5,\n"));
    bench.write("empty.csv", format!("time_s,{named}\n"));
    for (arguments, message) in [
        (["hand.toml", "kohm.csv"], "kohm.csv: joint `thumb`: "),
        (["hand.toml", "binary.csv"], "binary.csv:1: expected a header with the column `time_s` or `time_us`, found `"),
        (["hand.toml", "timeless.csv"], "timeless.csv:1: expected a header with the column `time_s`"),
        (["hand.toml", "nothing.csv"], "nothing.csv:1: joint `index`: expected a column `index_ohm`"),
        (["hand.toml", "empty.csv"], "empty.csv:2: expected at least one row of data"),
        (["thumb.toml", "hand.csv"], "thumb.toml is a sensor file: hand.toml names it"),
    ] {
        let refused = bench.run(&["hand", arguments[0], arguments[1], "-o", "none.csv"]);
        assert!(refused.code == Some(4) && refused.stderr.contains(message), "{message}: {}", refused.stderr);
        assert!(!refused.stderr.trim_end().contains(char::is_control), "{:?}", refused.stderr);
    }
    bench.write("odd.toml", "format = 1\n[[joints]]\nname = \"a\"\ncolum = \"a\"\n");
    let refused = bench.run(&["hand", "odd.toml", "hand.csv"]);
    assert!(refused.code == Some(4) && refused.stderr.contains("odd.toml:4: unknown field"), "{}", refused.stderr);
}

/// A sensor calibrated on ratios but given ohms, or the reverse, is detected by the column's name, the electronics, the line
/// above the header, or the readings themselves, however few. So is an R0 that cannot be the sensor's.
#[test]
fn ohms_and_ratios_are_distinguished() {
    let bench = Bench::calibrated();
    let ratio = change_rows(&bench.read("trace.csv"), |_, cells| {
        cells[1] = (cells[1].parse::<f64>().unwrap() / 1600.0).to_string();
    });
    bench.write("ratio.csv", ratio.replace("resistance_ohm", "resistance_ratio"));
    let calibrate = ["calibrate", "ratio.csv", "--until", "60", "--branches", "1", "-o", "ratio.toml"];
    bench.run(&[&calibrate[..], &["--estimator", "ekf"]].concat()).ok();
    let recording = |trace: &str, column: &str, rows: usize| {
        let trace = Csv::new(&bench.read(trace));
        let reading = trace.header.split(',').nth(1).unwrap().to_owned();
        let row = |(time, reading): (&&str, &&str)| format!("{time},{reading}\n");
        let rows: String = trace.cells("time_s").iter().zip(&trace.cells(&reading)).take(rows).map(row).collect();
        format!("time_s,{column}\n{rows}")
    };
    let hand = |sensor: &str, column: &str, more: &str, recording: String| {
        let joint = format!("name = \"a\"\ncolumn = \"{column}\"\nsensor = \"{sensor}\"\njoint = \"{JOINT}\"\n{more}");
        bench.write("hand.toml", format!("format = 1\n[[joints]]\n{joint}"));
        bench.write("hand.csv", recording);
        bench.run(&["hand", "hand.toml", "hand.csv"])
    };
    let refused = |run: Run, expected: &[&str]| {
        assert_eq!(run.code, Some(4), "{}", run.stderr);
        assert!(expected.iter().all(|expected| run.stderr.contains(expected)), "{}", run.stderr);
    };
    let (ohm, all) = ("trace.csv", usize::MAX);
    let named = ["hand.csv:1: column", "joint `a`", "expected `resistance_ratio` as in the sensor's calibration"];
    refused(hand("ratio.toml", "thumb_ohm", "", recording(ohm, "thumb_ohm", all)), &named);
    refused(hand("ratio.toml", "thumb_kohm", "", recording(ohm, "thumb_kohm", all)), &named);
    let electronics = "front_end = \"divider reference_ohm=10000 side=low bits=12 noise_codes=0.5\"\n";
    refused(hand("ratio.toml", "thumb", electronics, recording(ohm, "thumb", all)), &named);
    let with_unit = "# resistance_unit = ohm\n".to_owned() + &recording(ohm, "thumb", all);
    refused(hand("ratio.toml", "thumb", "", with_unit), &named[1..]);
    let expected = ["joint `a`", "expected readings of", "are they in ohms?"];
    refused(hand("ratio.toml", "thumb", "", recording(ohm, "thumb", all)), &expected);
    refused(hand("ratio.toml", "thumb", "", recording(ohm, "thumb", 5)), &expected);
    let named = ["joint `a`", "expected `resistance_ohm` as in the sensor's calibration, found `resistance_ratio`"];
    refused(hand("sensor.toml", "thumb_ratio", "", recording("ratio.csv", "thumb_ratio", all)), &named);
    // R0 of a ratio is near one.
    let far = "rest_resistance = 1612.0\n";
    let of_rest = ["joint `a`: rest_resistance: resistance at rest: expected 0.2", "found 1612"];
    refused(hand("ratio.toml", "thumb_ratio", far, recording("ratio.csv", "thumb_ratio", all)), &of_rest);
    let suits =
        hand("ratio.toml", "thumb_ratio", "rest_resistance = 1.1\n", recording("ratio.csv", "thumb_ratio", all));
    assert_eq!(suits.code, Some(0), "{}", suits.stderr);
    assert_eq!(hand("ratio.toml", "thumb", "", recording("ratio.csv", "thumb", all)).code, Some(0));
}

#[test]
fn a_plan_says_what_recordings_tell_and_what_sampling_leaves() {
    let bench = Bench::calibrated();
    // One branch: motions without long holds contain almost no information on more branches, and that is random.
    let calibrate = ["calibrate", "trace.csv", "--estimator", "ekf", "--branches", "1", "-o", "sensor.toml", "--force"];
    bench.run(&calibrate).ok();
    let json = bench.run(&["plan", "--sensor", "sensor.toml", "--joint", JOINT, "--json"]).ok();
    let plan: serde_json::Value = serde_json::from_str(&json).unwrap();
    let recordings = plan["recordings"].as_array().unwrap();
    let determined = |place: usize| recordings[place]["told"].as_u64().unwrap();
    let condition = |place: usize| recordings[place]["condition"].as_f64().unwrap();
    // At a single speed, rate and strain are correlated; each further recording separates them better. One speed determines
    // fewer parameters than three with holds.
    assert!(recordings.len() == 4 && determined(0) <= determined(3) && condition(0) > 100.0 * condition(3), "{json}");
    let sampling = plan["sampling"].as_array().unwrap();
    assert_eq!(sampling.len(), 16);
    for one in sampling {
        let number = |name: &str| one[name].as_f64().unwrap();
        assert!(
            (0.0..100.0).contains(&number("error_percent")) && (0.0..=100.0).contains(&number("coverage_percent")),
            "{one}"
        );
        // A percent of the range is a third of a percent of strain, which is converted to an angle.
        let degrees = DEGREES / 3.0 * number("error_percent") / 100.0;
        assert!((number("angle_deg") / degrees - 1.0).abs() < 1e-3, "{one}");
    }
    // Exact readings, and readings with one kind of noise.
    for name in ["drift_alone_percent", "noise_alone_percent", "neither_percent"] {
        assert!((0.0..100.0).contains(&plan[name].as_f64().unwrap()), "{name}: {json}");
    }
    let text = bench.run(&["plan", "--sensor", "sensor.toml"]).ok();
    assert!(text.contains("to and fro, one speed") && text.contains("12 bits"), "{text}");
    assert!(text.contains("Most informative for its duration: ") && text.contains("of the least error."), "{text}");
    let illustrative = bench.run(&["plan", "--material", "ecoflex-00-30"]).ok();
    assert!(illustrative.contains("an illustrative sensor (ecoflex-00-30)"), "{illustrative}");
}

/// A board that restarts, with its header or without, restarts the filters of all joints.
#[test]
fn filters_of_all_joints_restart_with_the_clock() {
    let bench = Bench::calibrated();
    let joint = |name: &str| {
        format!("[[joints]]\nname = \"{name}\"\ncolumn = \"{name}\"\nsensor = \"sensor.toml\"\njoint = \"{JOINT}\"\n")
    };
    bench.write("hand.toml", format!("format = 1\n{}{}", joint("a"), joint("b")));
    let rows = |from: usize| -> String {
        (from..50).map(|row| format!("{:.1},{},{}\n", 0.2 * row as f64, 1700 + 5 * row, 1800 - row)).collect()
    };
    let header = "time_s,a,b\n";
    let hand = ["hand", "hand.toml", "--skip-bad"];
    let alone = |rows: &str| bench.feed(&hand, format!("{header}{rows}")).ok();
    // Two rows show that the clock has restarted; the third is the first that counts.
    let plain = rows(0);
    let swapped = plain.lines().map(|row| {
        let cells: Vec<&str> = row.split(',').collect();
        format!("{},{},{}\n", cells[0], cells[2], cells[1])
    });
    let swapped: String = swapped.collect();
    for (between, again, rest) in
        [("", rows(0), rows(2)), (header, rows(0), rows(0)), ("time_s,b,a\n", swapped, rows(0))]
    {
        let run = bench.feed(&hand, format!("{header}{}{between}{again}", rows(0)));
        assert!(run.warnings.concat().contains("the clock has started again"), "{:?}", run.warnings);
        let second: Vec<String> = alone(&rest).lines().skip(1).map(|row| format!("{row}\n")).collect();
        assert_eq!(run.ok(), alone(&rows(0)) + &second.concat());
    }
    // A corrupt line is one line: it leaves the clock of the other channel as it was.
    let corrupt = format!("{header}0,1700,1800\n9999,1700,x\n{}", rows(1));
    let run = bench.feed(&hand, corrupt.clone());
    assert!(!run.warnings.concat().contains("the clock has started again"), "{:?}", run.warnings);
    assert_eq!(Csv::new(&run.ok()).len(), 50);
    let quoted = format!("\u{feff}\"time_s\",\"a\",b\n{}", rows(0));
    assert_eq!(bench.feed(&hand, quoted).ok(), alone(&rows(0)));
    for (text, message) in [
        (corrupt, "ohmstrain: odd.csv:3: column `b`: expected "),
        ("time_s,a,b\n-1e308,1700,1800\n1e308,1700,1800\n".to_owned(), "ohmstrain: odd.csv:3: "),
    ] {
        bench.write("odd.csv", text);
        let run = bench.run(&["hand", "hand.toml", "odd.csv"]);
        assert!(run.code == Some(4) && run.stderr.contains(message), "{}", run.stderr);
    }
    let strict = bench.feed(&hand[..2], format!("{header}{}{}", rows(0), rows(0)));
    assert!(strict.code == Some(4) && strict.stderr.contains("--skip-bad goes on"), "{}", strict.stderr);
}
