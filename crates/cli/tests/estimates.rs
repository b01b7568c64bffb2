//! Output of `filter` and `smooth`: columns, units, flags, and the effects of the flags of the command line.

use crate::common::{Bench, Csv, ESTIMATES_HEADER, SIMULATE, change_rows};
use serde_json::Value;

#[test]
fn filter_reads_stdin_as_it_reads_a_file() {
    let bench = Bench::calibrated();
    let from_file = bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml"]).ok();
    let trace = bench.read("trace.csv");
    assert_eq!(bench.feed(&["filter", "-", "--sensor", "sensor.toml"], trace.as_str()).ok(), from_file);
    assert_eq!(bench.feed(&["filter", "--sensor", "sensor.toml"], trace.as_str()).ok(), from_file);
    let with_carriage_returns = trace.replace('\n', "\r\n");
    assert_eq!(bench.feed(&["filter", "--sensor", "sensor.toml"], with_carriage_returns).ok(), from_file);
}

#[test]
fn filter_never_reads_the_reference() {
    let bench = Bench::calibrated();
    let with = bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml"]).ok();
    let blind = bench.read("trace.csv").lines().fold(String::new(), |blind, line| {
        let kept = if line.starts_with('#') { line } else { line.rsplit_once(',').unwrap().0 };
        blind + kept + "\n"
    });
    assert_eq!(bench.feed(&["filter", "--sensor", "sensor.toml"], blind).ok(), with);
}

/// Returns a factor on a standard deviation from the sensor file.
fn sd_scale(bench: &Bench, field: &str) -> f64 {
    let sensor = bench.read("sensor.toml");
    let line = sensor.lines().find(|line| line.starts_with(field)).unwrap();
    line.split_once('=').unwrap().1.trim().parse().unwrap()
}

#[test]
fn smoother_and_filter_share_header_and_last_row_and_nothing_in_between() {
    let bench = Bench::calibrated();
    // An R₀ that adapts to the readings has adapted by their end only in the filter.
    let flags = ["--sensor", "sensor.toml", "--without", "doubts", "--rest-resistance", "calibrated"];
    let estimates = |command| Csv::new(&bench.run(&[&[command, "trace.csv"][..], &flags].concat()).ok());
    let (filtered, smoothed) = (estimates("filter"), estimates("smooth"));
    assert_eq!(filtered.header, ESTIMATES_HEADER);
    assert_eq!(smoothed.header, ESTIMATES_HEADER);
    assert_eq!(smoothed.cells("time_s"), filtered.cells("time_s"));
    for column in ["strain", "strain_rate", "relaxation", "flags"] {
        assert_eq!(smoothed.cells(column).last(), filtered.cells(column).last(), "{column}");
    }
    // Each standard deviation of strain contains a calibrated factor; without it the last ones are equal.
    let unscaled = |csv: &Csv, scale: &str| {
        let scale = sd_scale(&bench, scale);
        csv.numbers("strain_sd").iter().map(|sd| sd / scale).collect::<Vec<f64>>()
    };
    let (filtered, smoothed) = (unscaled(&filtered, "strain_sd_scale"), unscaled(&smoothed, "smoothed_sd_scale"));
    let (last_filtered, last_smoothed) = (filtered[filtered.len() - 1], smoothed[smoothed.len() - 1]);
    assert!((last_smoothed / last_filtered - 1.0).abs() < 1e-12);
    // All readings are more informative than those up to a row. A linearisation may violate this in single rows, but not on the
    // whole.
    assert!(smoothed.iter().sum::<f64>() < filtered.iter().sum::<f64>());
}

#[test]
fn columns_are_chosen_and_ordered_by_name() {
    let bench = Bench::calibrated();
    let all = Csv::new(&bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml"]).ok());
    for command in ["filter", "smooth"] {
        let columns = ["--columns", "flags,strain_sd,time_s"];
        let run = bench.run(&[&[command, "trace.csv", "--sensor", "sensor.toml"], &columns[..]].concat());
        let chosen = Csv::new(&run.ok());
        assert_eq!(chosen.header, "flags,strain_sd,time_s");
        assert_eq!(chosen.cells("time_s"), all.cells("time_s"));
        assert!(command == "smooth" || chosen.cells("strain_sd") == all.cells("strain_sd"));
    }
}

/// Returns `trace.csv` with other columns, calibrated and filtered.
fn estimates_of(bench: &Bench, trace: &str) -> Csv {
    bench.write("other.csv", trace);
    let calibrate = ["calibrate", "other.csv", "--until", "60", "--branches", "1", "-o", "other.toml"];
    bench.run(&[&calibrate[..], &["--estimator", "ekf"]].concat()).ok();
    Csv::new(&bench.run(&["filter", "other.csv", "--sensor", "other.toml"]).ok())
}

#[test]
fn ratios_give_columns_of_ratios() {
    let bench = Bench::calibrated();
    let ratio = |_: usize, cells: &mut Vec<String>| cells[1] = (cells[1].parse::<f64>().unwrap() / 1600.0).to_string();
    let trace = change_rows(&bench.read("trace.csv"), ratio).replace("resistance_ohm", "resistance_ratio");
    let estimates = estimates_of(&bench, &trace);
    let expected = ESTIMATES_HEADER
        .replace("resistance_ohm", "resistance_ratio")
        .replace("settled_resistance_sd_ohm", "settled_resistance_sd_ratio");
    assert_eq!(estimates.header, expected);
    assert_eq!(estimates.cells("resistance_ratio"), Csv::new(&trace).cells("resistance_ratio"));
    let settled = estimates.numbers("settled_resistance_ratio");
    assert!(settled.iter().all(|ratio| (0.1..10.0).contains(ratio)));
}

#[test]
fn an_angle_without_a_joint_is_estimated_in_degrees() {
    let bench = Bench::calibrated();
    let degrees = |_: usize, cells: &mut Vec<String>| cells[2] = (cells[2].parse::<f64>().unwrap() * 270.0).to_string();
    let trace = change_rows(&bench.read("trace.csv"), degrees).replace(",strain", ",angle_deg");
    let estimates = estimates_of(&bench, &trace);
    let expected = ESTIMATES_HEADER
        .replace("strain_rate_sd", "angle_rate_sd")
        .replace("strain_rate", "angle_rate")
        .replace("strain_sd", "angle_sd")
        .replace(",strain,", ",angle_deg,");
    assert_eq!(estimates.header, expected);
    let angles = estimates.numbers("angle_deg");
    assert!(angles.iter().all(|angle| (-0.1..90.1).contains(angle)));
    assert!(angles.iter().any(|angle| *angle > 45.0));
    let json = bench.run(&["evaluate", "other.csv", "--sensor", "other.toml", "--json"]).ok();
    let scores: Value = serde_json::from_str(&json).unwrap();
    assert!(scores["recordings"][0]["rmse"].as_f64().unwrap() > 1.0, "in degrees, not in strain: {json}");
}

/// ε = prestrain + r θ / L.
#[track_caller]
fn assert_angles(estimates: &Csv, prestrain: f64, arm_over_length: f64) {
    assert_eq!(estimates.header, format!("{ESTIMATES_HEADER},angle_deg,angle_sd"));
    let (strain, sd) = (estimates.numbers("strain"), estimates.numbers("strain_sd"));
    let (angle, angle_sd) = (estimates.numbers("angle_deg"), estimates.numbers("angle_sd"));
    for k in 0..estimates.len() {
        // A subtraction of numbers below 1, a division and a conversion: a few 2⁻⁵³ of 100 degrees.
        assert!((angle[k] - ((strain[k] - prestrain) / arm_over_length).to_degrees()).abs() < 1e-12);
        assert!((angle_sd[k] - (sd[k] / arm_over_length.abs()).to_degrees()).abs() < 1e-12);
    }
}

#[test]
fn a_joint_appends_its_angle() {
    const JOINT: &str = "prestrain=0.02 moment_arm_mm=6 gauge_length_mm=30";
    let bench = Bench::calibrated();
    let with_joint = format!("# joint = {JOINT}\n{}", bench.read("trace.csv"));
    // The sensor has it from its calibration.
    assert_angles(&estimates_of(&bench, &with_joint), 0.02, 0.2);
    // From the recording, or from a flag of `filter` and of `import`, which overrides it.
    let flag = ["--joint", "prestrain=0 moment_arm_mm=-3 gauge_length_mm=30"];
    bench.run(&[&["-q", "import", "other.csv", "-o", "imported.csv"], &flag[..]].concat()).ok();
    for (command, recording, flags) in [("filter", "other.csv", &flag[..]), ("smooth", "imported.csv", &[])] {
        assert_angles(&Csv::new(&bench.run(&[command, "other.csv", "--sensor", "sensor.toml"]).ok()), 0.02, 0.2);
        let run = bench.run(&[&[command, recording, "--sensor", "other.toml"], flags].concat());
        assert_angles(&Csv::new(&run.ok()), 0.0, -0.1);
    }
}

#[test]
fn an_angle_with_a_joint_calibrates_strain() {
    let bench = Bench::calibrated();
    let degrees = |_: usize, cells: &mut Vec<String>| {
        cells[2] = (cells[2].parse::<f64>().unwrap() / 0.2).to_degrees().to_string();
    };
    let trace = change_rows(&bench.read("trace.csv"), degrees).replace(",strain", ",angle_deg");
    let joint = "# joint = prestrain=0 moment_arm_mm=6 gauge_length_mm=30";
    assert_angles(&estimates_of(&bench, &format!("{joint}\n{trace}")), 0.0, 0.2);
}

#[test]
fn converter_codes_become_ohms_and_saturated_ones_are_flagged() {
    let bench = Bench::new();
    let front_end = ["--front-end", "divider reference_ohm=4000 side=low bits=12 noise_codes=0.5"];
    bench.run(&[&SIMULATE[..], &front_end, &["-o", "codes.csv"]].concat()).ok();
    let saturate = |row: usize, cells: &mut Vec<String>| match row {
        7 => cells[1] = "4095".into(),
        8 => cells[1] = "0".into(),
        9 => cells[1] = "NaN".into(),
        _ => {}
    };
    let trace = change_rows(&bench.read("codes.csv"), saturate);
    let estimates = estimates_of(&bench, &trace);
    assert_eq!(estimates.header, ESTIMATES_HEADER);
    let flags = estimates.cells("flags");
    let flagged = |word: &str| -> Vec<usize> {
        (0..flags.len()).filter(|&k| flags[k].split('|').any(|flag| flag == word)).collect()
    };
    assert_eq!(flagged("saturated"), [7, 8]);
    assert_eq!(flagged("missing"), [9]);
    for row in 7..10 {
        assert_eq!((estimates.cells("resistance_ohm")[row], estimates.cells("nis")[row]), ("", ""));
    }
    // Code c of 4095 is R = 4000 c / (4095 - c), to about half a code.
    let code: f64 = Csv::new(&trace).numbers("adc")[100];
    let ohm: f64 = estimates.cells("resistance_ohm")[100].parse().unwrap();
    assert!((ohm / (4000.0 * code / (4095.0 - code)) - 1.0).abs() < 2e-3, "{ohm} for code {code}");
    let sensor = ["--sensor", "other.toml"];
    let [filtered, smoothed] =
        ["filter", "smooth"].map(|command| bench.run(&[&[command, "other.csv"], &sensor[..]].concat()).ok());
    assert_eq!(Csv::new(&smoothed).cells("flags")[7].split('|').next(), Some("saturated"));
    // `import` states the electronics of a recording once and for all; `filter` takes them from a flag, too.
    let rows: Vec<&str> = trace.lines().filter(|line| !line.starts_with("# front_end")).collect();
    bench.write("bare.csv", rows.join("\n") + "\n");
    let refused = bench.run(&[&["smooth", "bare.csv"], &sensor[..]].concat());
    assert!(refused.code == Some(4) && refused.stderr.contains("# front_end = "), "{}", refused.stderr);
    bench.run(&[&["-q", "import", "bare.csv", "-o", "imported.csv"], &front_end[..]].concat()).ok();
    assert_eq!(bench.run(&[&["smooth", "imported.csv"], &sensor[..]].concat()).ok(), smoothed);
    assert_eq!(bench.run(&[&["filter", "bare.csv"], &sensor[..], &front_end].concat()).ok(), filtered);
}

#[test]
fn a_known_initial_strain_starts_there() {
    let bench = Bench::calibrated();
    for (command, scale) in [("filter", "strain_sd_scale"), ("smooth", "smoothed_sd_scale")] {
        let scale = sd_scale(&bench, scale);
        let first = |flags: &[&str]| {
            let run = bench.run(&[&[command, "trace.csv", "--sensor", "sensor.toml"], flags].concat());
            let estimates = Csv::new(&run.ok());
            (estimates.numbers("strain")[0], estimates.numbers("strain_sd")[0] / scale)
        };
        let ((_, unknown_sd), (zero, zero_sd)) = (first(&[]), first(&["--initial-strain", "0"]));
        // Its deviation is a thousandth of the range, 3.3e-4, before the first reading takes effect and before the calibrated
        // factor.
        assert!(
            zero.abs() < 2e-3 && zero_sd <= 3.34e-4 && unknown_sd > 10.0 * zero_sd,
            "{zero} {zero_sd} {unknown_sd}"
        );
    }
    let far = bench.run(&["filter", "trace.csv", "--sensor", "sensor.toml", "--initial-strain", "0.2"]).ok();
    assert!((Csv::new(&far).numbers("strain")[0] - 0.2).abs() < 2e-3);
}

/// A strain known at the filter's largest error improves that row and the second after it, also with a lag, with which the rows
/// before it profit, too. Without a lag, rows before it do not change.
#[test]
fn a_strain_that_is_known_is_taken_in() {
    let bench = Bench::calibrated();
    let truth = Csv::new(&bench.read("trace.csv")).numbers("strain");
    for lag in [&[][..], &["--lag-s", "0.6"]] {
        let errors = |flags: &[&str]| -> (Vec<f64>, Csv) {
            let run = bench.run(&[&["filter", "trace.csv", "--sensor", "sensor.toml"][..], lag, flags].concat());
            let estimates = Csv::new(&run.ok());
            let strains = estimates.numbers("strain");
            (strains.iter().zip(&truth).map(|(strain, truth)| (strain - truth).abs()).collect(), estimates)
        };
        let (without_known, estimates) = errors(&[]);
        let worst =
            (50..without_known.len() - 10).max_by(|a, b| without_known[*a].total_cmp(&without_known[*b])).unwrap();
        // At a time between two rows, the strain applies to the next row.
        let time_s = estimates.numbers("time_s")[worst] - 0.01;
        let known = format!("{time_s}:{}:0.001", truth[worst]);
        let (with_known, estimates) = errors(&["--known", &known]);
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        let smoothed = if lag.is_empty() { 0.0 } else { sd_scale(&bench, "smoothed_sd_scale") };
        let sd = estimates.numbers("strain_sd")[worst] / sd_scale(&bench, "strain_sd_scale").max(smoothed);
        // Four deviations of the known strain.
        assert!(
            with_known[worst] < 0.004 && sd < 1.001e-3,
            "{lag:?}: {} ± {sd}, was {}",
            with_known[worst],
            without_known[worst]
        );
        assert!(
            mean(&with_known[worst..worst + 5]) < 0.7 * mean(&without_known[worst..worst + 5]),
            "{lag:?}: {with_known:?}"
        );
        if lag.is_empty() {
            assert_eq!(with_known[..worst], without_known[..worst]);
        } else {
            assert!(with_known[worst - 1] < without_known[worst - 1]);
        }
    }
    // After the end of the recording it is not used, and a message says so.
    for lag in [&["--lag-s", "1"][..], &[]] {
        let late =
            bench.run(&[&["filter", "trace.csv", "--sensor", "sensor.toml", "--known", "5000:0.1"], lag].concat());
        let warned = "warning: trace.csv: --known 5000:0.1 was not used: the recording goes from 0 to ";
        assert!(late.warnings.iter().any(|warning| warning.contains(warned)), "{:?}", late.warnings);
    }
    for command in ["filter", "smooth"] {
        let far = bench.run(&[command, "trace.csv", "--sensor", "sensor.toml", "--known", "3:12"]);
        far.fails(2, "--known: expected 0 to 0.3333, the limits of the sensor's strain, found 12; 10 % is 0.1");
    }
}

/// The smoother uses it for rows before and after, and reports unused ones.
#[test]
fn a_smoother_takes_in_a_strain_that_is_known() {
    let bench = Bench::calibrated();
    let smoothed = |flags: &[&str]| {
        let run = bench.run(&[&["smooth", "trace.csv", "--sensor", "sensor.toml"], flags].concat());
        (run.warnings.clone(), Csv::new(&run.ok()).numbers("strain"))
    };
    let (_, without_known) = smoothed(&[]);
    let known = format!("100:{}", without_known[500] + 0.02);
    let (warnings, with_known) = smoothed(&["--known", &known, "--known", "5000:0.1"]);
    let more: Vec<f64> =
        with_known.iter().zip(&without_known).map(|(with_known, without_known)| with_known - without_known).collect();
    assert!((more[500] - 0.02).abs() < 0.003 && more[497] > 0.005 && more[503] > 0.005, "{:?}", &more[495..506]);
    assert!(warnings.iter().any(|warning| warning.contains("--known 5000:0.1 was not used")), "{warnings:?}");
}

/// A stretch, and a rest that lies a fifth of the readings' range above the calibration's. The question ends with the flag that
/// answers it, which is accepted.
#[test]
fn a_long_quiet_hold_is_asked_about() {
    let bench = Bench::calibrated();
    let sensor = bench.read("sensor.toml");
    let number = |name: &str| -> f64 {
        let value = sensor.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(" = "));
        value.unwrap().parse().unwrap()
    };
    let range = number("reading_upper") - number("reading_lower");
    let stretch = |k: u32| if k < 100 { 0.6 * range * (0.01 * f64::from(k) * std::f64::consts::PI).sin() } else { 0.0 };
    let reading = |k: u32| number("measured_rest") + 0.2 * range + stretch(k) + 0.1 * f64::from(k * 7 % 11);
    let rows = (0..400).map(|k| format!("{},{}\n", 0.2 * f64::from(k), reading(k)));
    bench.write("rest.csv", format!("time_s,resistance_ohm\n{}", rows.collect::<String>()));
    let asked = |flags: &[&str]| {
        let run = bench.run(&[&["filter", "rest.csv", "--sensor", "sensor.toml"], flags].concat());
        let questions = run.warnings.iter().filter(|warning| warning.contains("s of quiet")).cloned();
        (questions.collect::<Vec<String>>(), Csv::new(&run.ok()).numbers("strain"))
    };
    let (questions, unanswered) = asked(&[]);
    assert_eq!(questions.len(), 1, "{questions:?}");
    let (_, answer) = questions[0].split_once("if the body was at rest, add ").unwrap();
    let flags: Vec<&str> = answer.split_whitespace().take(2).collect();
    let (questions, answered) = asked(&flags);
    assert!(questions.is_empty(), "{questions:?}");
    // From the named row on, thirty seconds after the stretch.
    let first = answered.iter().zip(&unanswered).position(|(answered, unanswered)| answered != unanswered).unwrap();
    assert!((245..255).contains(&first), "{first}");
    assert!(answered[first] < 0.005 && answered[275] < 0.6 * unanswered[275], "{} {}", answered[275], unanswered[275]);
}

#[test]
fn the_rest_resistance_is_the_sensors_or_given_or_that_of_the_first_readings() {
    let bench = Bench::calibrated();
    // One of the first rows has no reading: it does not count.
    let gap = |row: usize, cells: &mut Vec<String>| cells[1] = if row == 2 { String::new() } else { cells[1].clone() };
    let trace = change_rows(&bench.read("trace.csv"), gap);
    bench.write("trace.csv", &trace);
    let mut first: Vec<f64> =
        [0, 1, 3, 4, 5].map(|row| Csv::new(&trace).cells("resistance_ohm")[row].parse().unwrap()).into();
    first.sort_by(f64::total_cmp);
    let (median, mean_of_four) = (first[2].to_string(), {
        let mut four: Vec<f64> =
            [0, 1, 3, 4].map(|row| Csv::new(&trace).cells("resistance_ohm")[row].parse().unwrap()).into();
        four.sort_by(f64::total_cmp);
        (0.5 * (four[1] + four[2])).to_string()
    });
    let sensor: toml::Table = toml::from_str(&bench.read("sensor.toml")).unwrap();
    let calibrated = sensor["measured_rest"].as_float().unwrap().to_string();
    for command in ["filter", "smooth"] {
        let estimates =
            |rest: &str| bench.run(&[command, "trace.csv", "--sensor", "sensor.toml", "--rest-resistance", rest]).ok();
        let as_then = estimates("calibrated");
        assert_eq!(estimates(&calibrated), as_then);
        assert_eq!(estimates("first:5"), estimates(&median));
        assert_eq!(estimates("first:4"), estimates(&mean_of_four));
        assert_ne!(estimates("first:5"), as_then);
        assert_ne!(estimates("1234"), as_then);
    }
    // A common factor of the readings and of R₀ cancels.
    let scaled = change_rows(&trace, |_, cells| {
        if let Ok(ohm) = cells[1].parse::<f64>() {
            cells[1] = (ohm * 2.0).to_string();
        }
    });
    let rest = (1234.0 * 2.0).to_string();
    let columns = ["--columns", "strain,strain_sd,nis"];
    let one = ["filter", "--sensor", "sensor.toml", "--rest-resistance", "1234"];
    let other = ["filter", "--sensor", "sensor.toml", "--rest-resistance", &rest];
    assert_eq!(
        bench.feed(&[&one[..], &columns].concat(), trace).ok(),
        bench.feed(&[&other[..], &columns].concat(), scaled).ok()
    );
}
