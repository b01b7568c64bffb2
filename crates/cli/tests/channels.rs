//! A recording of several channels: calibrated, fused, evaluated and filtered in one command each.

use std::sync::OnceLock;

use crate::common::{Bench, Csv, change_rows};
use crate::export::{compile_and_run, compilers};

/// Names of the channels.
const CHANNELS: [&str; 3] = ["inner", "middle", "outer"];
/// End of the rows for calibration, s.
const UNTIL: &str = "100";

/// Returns a pseudo-random number in ±1.
fn noise(row: usize, channel: usize) -> f64 {
    ((row * 3 + channel) as f64 * 12.9898).sin() * 43758.5453 % 1.0
}

/// Returns a recording of 150 s: three channels with curves of their own measure one strain, two of them its rate as well.
fn knee() -> String {
    let names: Vec<String> = CHANNELS.iter().map(|channel| format!("{channel}_ohm")).collect();
    let mut text = format!("# sleeve = 7\ntime_s,{},strain\n", names.join(","));
    let strain = |t: f64| 0.15 - 0.10 * (0.9 * t).cos() - 0.05 * (0.33 * t + 1.0).cos();
    let mut drift = [0.0; CHANNELS.len()];
    for row in 0..1500 {
        let t = 0.1 * row as f64;
        let (e, rate) = (strain(t), (strain(t) - strain(t - 0.1)) / 0.1);
        let ln_r = [2.0 * e + 0.3 * rate, 3.0 * e - 2.0 * e * e, 1.5 * e + 3.0 * e * e - 0.2 * rate];
        // Errors of readings are correlated over five seconds.
        for (channel, drift) in drift.iter_mut().enumerate() {
            *drift = 0.98 * *drift + 0.2 * noise(row, channel + 7);
        }
        let error = |channel: usize| 0.01 * (noise(row, channel) + drift[channel]);
        let ohm = |channel: usize| 1000.0 * (channel + 1) as f64 * (ln_r[channel] + error(channel)).exp();
        text += &format!("{t:.1},{:.2},{:.2},{:.2},{e:.6}\n", ohm(0), ohm(1), ohm(2));
    }
    text
}

/// Returns a folder with that recording and a quick calibration on its first 100 s, made once.
fn bench() -> Bench {
    static FILES: OnceLock<Vec<(String, String)>> = OnceLock::new();
    Bench::with(FILES.get_or_init(|| {
        let bench = Bench::new();
        bench.write("knee.csv", knee());
        let calibrate = ["calibrate", "knee.csv", "--until", UNTIL, "-o", "knee.toml", "--estimator", "ekf", "--json"];
        bench.write("left_out.json", bench.run(&calibrate).ok());
        bench.contents()
    }))
}

/// Returns errors, % of full scale, of the joint and of its best channel, and the joint's coverage of the 95 % interval.
fn scores(json: &str) -> ([f64; 2], f64) {
    let json: serde_json::Value = serde_json::from_str(json).unwrap();
    let joint = &json["joints"][0];
    let channels = joint["channels"].as_array().unwrap();
    assert_eq!(channels.len(), CHANNELS.len());
    let error = |channel: &serde_json::Value| channel["alone"]["rmse_percent_fs"].as_f64().unwrap();
    let best = channels.iter().map(error).fold(f64::INFINITY, f64::min);
    ([joint["fused"]["rmse_percent_fs"].as_f64().unwrap(), joint["fused"]["coverage_95"].as_f64().unwrap()], best)
}

#[test]
fn channels_of_one_strain_are_fused() {
    let bench = bench();
    let ([fused, covered], best) = scores(&bench.read("left_out.json"));
    assert!(fused < best && covered > 0.9, "{fused} {best} {covered}");
    let scored = bench.run(&["evaluate", "knee.csv", "--sensor", "knee.toml", "--from", UNTIL, "--json"]).ok();
    let ([fused, covered], best) = scores(&scored);
    // Three equal errors with half of the variance in common would leave 0.82 of one.
    assert!(fused < 0.82 * best && covered > 0.9, "{fused} {best} {covered}");
    let table = bench.run(&["evaluate", "knee.csv", "--sensor", "knee.toml", "--from", UNTIL]).ok();
    assert!(table.contains("| knee ") && table.contains("inner_ohm alone"), "{table}");

    // With later readings the error is smaller, and the smoother's interval narrower.
    let json: serde_json::Value = serde_json::from_str(&scored).unwrap();
    let (filtered, smoothed) = (&json["joints"][0]["fused"], &json["joints"][0]["smoothed"]);
    let number = |scores: &serde_json::Value, name: &str| scores[name].as_f64().unwrap();
    assert!(number(smoothed, "rmse") < number(filtered, "rmse") && number(smoothed, "coverage_95") > 0.9, "{smoothed}");
    let rows = Csv::new(&bench.run(&["smooth", "knee.csv", "--sensor", "knee.toml"]).ok());
    assert_eq!(rows.header, "time_s,knee_strain,knee_strain_sd,flags");

    let angles = Csv::new(&bench.run(&["hand", "knee.toml", "knee.csv"]).ok());
    assert_eq!(angles.header, "time_s,knee_strain,knee_strain_sd,flags");
    assert_eq!(angles.len(), Csv::new(&bench.read("knee.csv")).len());
    // Another run gives the same files, and replaces them silently.
    let before: Vec<String> = ["knee.toml", "knee-fusion.toml", "knee-outer.toml"].map(|name| bench.read(name)).into();
    bench.run(&["calibrate", "knee.csv", "--until", UNTIL, "-o", "knee.toml", "--estimator", "ekf", "--quiet"]).ok();
    let after: Vec<String> = ["knee.toml", "knee-fusion.toml", "knee-outer.toml"].map(|name| bench.read(name)).into();
    assert_eq!(before, after);
}

/// The exported C over the same recording: with all channels, and with one unplugged for a while, when the processes of all readings rest.
#[test]
fn a_fused_joint_is_exported() {
    let bench = bench();
    let export = ["export", "--sensor", "knee.toml", "--target", "c", "-o", "out", "--dt-s", "0.1"];
    let printed = bench.run(&export).ok();
    assert!(printed.contains("filters of 3 channels: ") && printed.contains("fusion of `knee`: "), "{printed}");
    // An earlier export is replaced silently.
    assert_eq!(bench.run(&export).ok(), printed);
    let unplugged = change_rows(&bench.read("knee.csv"), |_, cells| {
        if cells[0].parse::<f64>().is_ok_and(|time_s| (120.0..125.0).contains(&time_s)) {
            cells[1].clear();
        }
    });
    let parts = ["", "_inner", "_middle", "_outer"];
    let sources = |prefix: &str, main: &'static str| -> Vec<String> {
        parts.iter().map(|part| format!("src/{prefix}{part}.c")).chain([main.to_owned()]).collect()
    };
    // Another prefix is that of the channels, too: two hands in one program have names of their own.
    bench.run(&[&export[..6], &["out2", "--prefix", "knee", "--dt-s", "0.1"]].concat()).ok();
    for compiler in compilers() {
        let replay = sources("ohmstrain", "selftest/replay.c");
        let replay: Vec<&str> = replay.iter().map(String::as_str).collect();
        let shown = compile_and_run(compiler, &bench.path("out"), &replay, &unplugged);
        let test = sources("knee", "selftest/selftest.c");
        let test: Vec<&str> = test.iter().map(String::as_str).collect();
        let tested = compile_and_run(compiler, &bench.path("out2"), &test, "");
        assert!(tested.ends_with(", 0 failures\nself-test passed\n"), "{tested}");
        let chip = Csv::new(&shown);
        bench.write("unplugged.csv", &unplugged);
        let computer = Csv::new(&bench.run(&["hand", "knee.toml", "unplugged.csv"]).ok());
        assert_eq!(chip.header, "time_s,knee_strain,knee_strain_sd,knee_flags");
        let (values, deviations) = (computer.numbers("knee_strain"), computer.numbers("knee_strain_sd"));
        let off: Vec<f64> =
            (0..values.len()).map(|k| (chip.numbers("knee_strain")[k] - values[k]).abs() / deviations[k]).collect();
        // The processes leave out rows that add less than a hundredth of the noise variance, a tenth of a deviation; filters alone know less.
        assert!(off[..1200].iter().all(|off| *off < 0.1), "{:?}", off.iter().position(|off| *off >= 0.1));
        assert!(off.iter().all(|off| *off < 1.5), "{off:?}");
        // The flag of a missing reading.
        let is_missing = |row: usize| chip.numbers("knee_flags")[row] as u32 & 1;
        assert_eq!((is_missing(1210), is_missing(1300)), (1, 0));
    }
    let text = bench.read("knee.toml");
    let joint = text.split_once("[[joints]]").unwrap().1;
    bench.write("twice.toml", format!("{text}\n[[joints]]{}", joint.replace("name = \"knee\"", "name = \"Knee\"")));
    let run = bench.run(&["export", "--sensor", "twice.toml", "--target", "c", "-o", "out3", "--dt-s", "0.1"]);
    assert!(run.stderr.contains("a name each in C, found two of the name `knee`"), "{}", run.stderr);
    // Without the steps of the converter, a sensor at rest would count as stuck.
    let sketch = bench.read("out/examples/ohmstrain_plotter/ohmstrain_plotter.ino");
    assert!(sketch.contains("reading, reading_sd);") && sketch.contains("scale * sd_of(k, ohm)"), "{sketch}");
    let current = "front_end = \"constant-current current_a=1e-4 gain=1 full_scale_v=1.2 bits=12 noise_codes=0.5\"\n";
    bench
        .write("current.toml", text.replace("column = \"inner_ohm\"\n", &format!("column = \"inner_ohm\"\n{current}")));
    let run = bench.run(&["export", "--sensor", "current.toml", "--target", "c", "-o", "out4", "--dt-s", "0.1"]);
    let says = "current.toml: column `inner_ohm`: expected a divider, which the exported sketch measures, found `constant-current ";
    assert!(run.code == Some(4) && run.stderr.contains(says), "{}", run.stderr);
    for (flags, refused) in [
        (["--estimator", "ekf"], "--estimator is for one sensor"),
        (["--budget", "lean"], "--budget is for one sensor"),
        (["--score", "knee.csv"], "--score is for one sensor"),
    ] {
        let run = bench.run(&[&export[..], &flags].concat());
        assert!(run.stderr.contains(refused), "{}", run.stderr);
    }
}

/// A channel that is unplugged or shorted from 110 s on leaves the others working.
#[test]
fn a_channel_that_fails_leaves_the_others() {
    let bench = bench();
    let faulty = |cell: &str| {
        change_rows(&bench.read("knee.csv"), |_, cells| {
            if cells[0].parse::<f64>().is_ok_and(|time_s| time_s >= 110.0) {
                cells[2] = cell.to_owned();
            }
        })
    };
    for (name, cell, flag) in [("open.csv", "", "middle_ohm:missing"), ("shorted.csv", "3", "middle_ohm:implausible")] {
        bench.write(name, faulty(cell));
        let scored = bench.run(&["evaluate", name, "--sensor", "knee.toml", "--from", UNTIL, "--json"]).ok();
        let ([fused, covered], best) = scores(&scored);
        assert!(fused < best && covered > 0.9, "{name}: {fused} {best} {covered}");
        let angles = bench.run(&["hand", "knee.toml", name]).ok();
        assert!(angles.lines().last().unwrap().contains(flag), "{name}: {}", angles.lines().last().unwrap());
    }
}

#[test]
fn errors_in_several_channels_are_reported() {
    let bench = bench();
    bench.write("bare.csv", bench.read("knee.csv").replace(",strain\n", ",x\n"));
    bench.write("other.csv", bench.read("knee.csv").replace("outer_ohm", "thigh_ohm"));
    bench.write("double.csv", bench.read("knee.csv").replace("middle_ohm", "inner_ohm"));
    bench.write("word.csv", bench.read("knee.csv").replacen("\n0.0,", "\n0.0,x", 1));
    bench.write("mine.toml", "format = 1\n[[joints]]\nname = \"a\"\ncolumn = \"a_ohm\"\nsensor = \"a.toml\"\n");
    bench.write("unfused.toml", bench.read("knee.toml").replace("fusion = \"knee-fusion.toml\"\n", ""));
    bench.write("worse.toml", bench.read("knee.toml").replace("knee-fusion", "worse-fusion"));
    bench.write("worse-fusion.toml", bench.read("knee-fusion.toml").replace("novelty = ", "novelty = -"));
    for (arguments, code, message) in [
        (
            &["calibrate", "bare.csv", "-o", "out.toml"][..],
            4,
            "bare.csv:2: column `inner_ohm`: expected its reference, `inner_angle_deg`",
        ),
        (
            &["calibrate", "knee.csv", "other.csv", "-o", "out.toml"],
            4,
            "other.csv:2: expected the channels of the first recording",
        ),
        (
            &["calibrate", "double.csv", "-o", "out.toml"],
            4,
            "double.csv:2: column `inner_ohm`: expected a name of its own, found another column `inner_ohm`",
        ),
        (&["calibrate", "word.csv", "-o", "out.toml"], 4, "word.csv:3: column `inner_ohm`"),
        (&["calibrate", "knee.csv", "-o", "out.toml", "--explain"], 2, "--explain is for recordings of one channel"),
        (&["calibrate", "knee.csv", "-o", "mine.toml"], 2, "cannot write mine.toml: it holds something else"),
        (&["hand", "unfused.toml", "knee.csv"], 4, "unfused.toml: joint `knee`: expected `fusion`"),
        (&["hand", "worse.toml", "knee.csv"], 4, "worse-fusion.toml:"),
        (&["evaluate", "knee.csv", "--sensor", "knee.toml", "--check"], 2, "--check is for one sensor"),
        (&["evaluate", "knee.csv", "--sensor", "knee.toml", "--estimator", "ekf"], 2, "--estimator is for one sensor"),
        (
            &["evaluate", "knee.toml", "--sensor", "knee.toml"],
            4,
            "knee.toml: expected a recording with two or more columns",
        ),
    ] {
        let run = bench.run(arguments);
        assert!(run.code == Some(code) && run.stderr.contains(message), "{arguments:?}: {:?} {}", run.code, run.stderr);
    }
    assert!(!std::path::Path::new(&bench.path("out.toml")).exists());
}

/// Two joints, each with its own reference: two sensors without fusion.
#[test]
fn each_reference_is_a_joint() {
    let bench = bench();
    let (header, rows) = ("inner_ohm,middle_ohm,outer_ohm,strain", bench.read("knee.csv"));
    let two = rows.replace(header, "inner_ohm,middle_ohm,_,inner_strain");
    let doubled: Vec<String> = two
        .lines()
        .map(|line| match line.rsplit_once(',') {
            Some((_, "inner_strain")) => format!("{line},middle_strain"),
            Some((_, strain)) => format!("{line},{strain}"),
            None => line.to_owned(),
        })
        .collect();
    bench.write("two.csv", doubled.join("\n") + "\n");
    bench.run(&["calibrate", "two.csv", "--until", "40", "-o", "two.toml", "--estimator", "ekf", "--quiet"]).ok();
    let angles = Csv::new(&bench.run(&["hand", "two.toml", "two.csv"]).ok());
    assert_eq!(angles.header, "time_s,inner_strain,inner_strain_sd,middle_strain,middle_strain_sd,flags");
}
