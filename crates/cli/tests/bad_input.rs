//! Errors in inputs: one line names the place, the expected and the found content; no panic, no partial file, no partial row.

use crate::common::{Bench, change_rows};

/// Exit code for the contents of an input.
const CONTENT: i32 = 4;
/// Exit code for arguments.
const ARGUMENTS: i32 = 2;
/// Exit code for the rest: files that cannot be read or written.
const OTHER: i32 = 1;

/// Content of the previous output: a sensor file that may be replaced.
const OLD: &str = "format = 9\nmade_by = \"ohmstrain 0.0.1\"\nquantity = \"strain\"\n";

/// The commands that read a recording, each with a file that it would write.
const READERS: [&[&str]; 4] = [
    &["filter", "bad.csv", "--sensor", "sensor.toml"],
    &["smooth", "bad.csv", "--sensor", "sensor.toml"],
    &["evaluate", "bad.csv", "--sensor", "sensor.toml"],
    &["calibrate", "bad.csv", "-o", "old.toml", "--report", "new.html"],
];

/// Runs a command that must fail, and checks the files: an old one keeps its content, no new one appears.
#[track_caller]
fn fails(bench: &Bench, arguments: &[&str], code: i32, message: &str) {
    bench.write("old.toml", OLD);
    let before = bench.files();
    bench.run(arguments).fails(code, message);
    assert_eq!(bench.files(), before, "{arguments:?}");
    assert_eq!(bench.read("old.toml"), OLD);
}

/// Three lines above the first row, so that a line number is not a row number.
const HEADER: &str = "# material = silicone\n# gauge_length_mm = 30\ntime_s,resistance_ohm,strain\n";

/// Returns a recording with `row` at line 6, between good rows.
fn with_row(row: &str) -> Vec<u8> {
    format!("{HEADER}0.0,1600,0.0\n0.1,1610,0.01\n{row}\n0.3,1630,0.03\n").into_bytes()
}

/// Returns the same with another header.
fn with_header(header: &str, row: &str) -> Vec<u8> {
    format!("# material = silicone\n{header}\n{row}\n").into_bytes()
}

/// Encodes ASCII text in UTF-16, as a spreadsheet may save it.
fn utf_16(text: &str, mark: [u8; 2], order: fn(u16) -> [u8; 2]) -> Vec<u8> {
    mark.into_iter().chain(text.encode_utf16().flat_map(order)).collect()
}

/// Returns the number of the header's line.
fn header_line(trace: &str) -> usize {
    1 + trace.lines().position(|line| line.starts_with("time_s")).unwrap()
}

#[test]
fn a_recording_that_is_none_is_refused_alike_by_every_command() {
    let resistance = "6: column `resistance_ohm`: expected";
    let positive = "a positive resistance, or nothing for a missing reading";
    let time = "6: column `time_s`: expected a time";
    let no_row = "expected at least one row of data, found the end of the file";
    let no_header = "expected a header such as `time_s,resistance_ohm,strain`, found";
    let one_of = "expected a header with the column";
    let binary = b"\x7fELF\x02\x01\x01\x00\x00\x00\x03\x00\x3e\x00\n\x01\x00".to_vec();
    let latin_1 = [HEADER.as_bytes(), b"0.0,1600,0.0\n0.1,16\xb5,0.01\n"].concat();
    let cases: Vec<(Vec<u8>, String)> = vec![
        // Cells.
        (with_row("0.2,abc,0.02"), format!("{resistance} a number, found `abc`")),
        (with_row("0.2,1,6e3,0.02"), "6: expected 3 cells, as in the header, found 4".into()),
        (with_row("0.2,1620;0.02,"), format!("{resistance} a number, found `1620;0.02`")),
        (with_row("0.2,inf,0.02"), format!("{resistance} a finite number, found `inf`")),
        (with_row("0.2,-inf,0.02"), format!("{resistance} a finite number, found `-inf`")),
        (with_row("0.2,1e999,0.02"), format!("{resistance} a finite number, found `1e999`")),
        (with_row("0.2,0,0.02"), format!("{resistance} {positive}, found `0`")),
        (with_row("0.2,-1620,0.02"), format!("{resistance} {positive}, found `-1620`")),
        (with_row("0.2,1620,wide"), "6: column `strain`: expected a number, found `wide`".into()),
        (with_row("0.2,1620,inf"), "6: column `strain`: expected a finite number, found `inf`".into()),
        // Time.
        (with_row("0.05,1620,0.02"), format!("{time} after 0.1 s, found `0.05`")),
        (with_row("0.1,1620,0.02"), format!("{time} after 0.1 s, found `0.1`")),
        (with_row(",1620,0.02"), format!("{time} in seconds, found nothing")),
        (with_row("NaN,1620,0.02"), format!("{time} in seconds, found `NaN`")),
        (with_row("inf,1620,0.02"), "6: column `time_s`: expected a finite number, found `inf`".into()),
        // Rows.
        (with_row("0.2,1620"), "6: expected 3 cells, as in the header, found 2".into()),
        (with_row("0.2"), "6: expected 3 cells, as in the header, found 1".into()),
        (with_row("\"0.2,1620,0.02"), "6: expected quotation marks in pairs, found `\"0.2,1620,0.02`".into()),
        // Files without rows.
        (Vec::new(), format!("1: {no_header} an empty file")),
        (b"\n\n".to_vec(), format!("2: {no_header} the end of the file")),
        (b"# material = silicone\n".to_vec(), format!("1: {no_header} the end of the file")),
        (HEADER.into(), format!("4: {no_row}")),
        // Headers.
        (
            with_header("resistance_ohm,strain", "1600,0"),
            format!("2: {one_of} `time_s` or `time_us`, found `resistance_ohm,strain`"),
        ),
        (
            with_header("time_s,ohm,strain", "0,1600,0"),
            format!("2: {one_of} `resistance_ohm` or `resistance_ratio` or `adc`, found `time_s,ohm,strain`"),
        ),
        (b"0.0,1600,0.0\n0.1,1610,0.01\n".to_vec(), format!("1: {one_of} `time_s` or `time_us`, found `0.0,1600,0.0`")),
        (
            with_header("time_s,resistance_ohm,adc,strain", "0,1600,5,0"),
            "2: column `adc`: expected one column `resistance_ohm` or `resistance_ratio` or `adc`, found \
             `resistance_ohm` and `adc`"
                .into(),
        ),
        (
            with_header("time_s,adc,strain", "0,5,0"),
            "2: column `adc`: expected a line `# front_end = …` above the header, found none".into(),
        ),
        (
            with_header("time_s,resistance_ohm,displacement_mm", "0,1600,0"),
            "2: column `displacement_mm`: expected a line `# gauge_length_mm = …` above the header, found none".into(),
        ),
        // Metadata.
        (
            with_header("# gauge_length_mm = -3\ntime_s,resistance_ohm,strain", "0,1600,0"),
            "2: expected `gauge_length_mm` to be a positive number of millimetres, found `-3`".into(),
        ),
        (
            with_header("# front_end = bridge\ntime_s,adc,strain", "0,5,0"),
            "2: expected a front end `divider …` or `constant-current …`, found `bridge`".into(),
        ),
        (
            with_header("# joint = prestrain=0\ntime_s,resistance_ohm,strain", "0,1600,0"),
            "2: expected `moment_arm_mm=…`, found none".into(),
        ),
        // Not text.
        (binary, "1: expected UTF-8 text, found binary data (a NUL byte)".into()),
        (latin_1, "5: expected UTF-8 text, found binary data (bytes that are not UTF-8)".into()),
        (utf_16(HEADER, [0xff, 0xfe], u16::to_le_bytes), "1: expected UTF-8 text, found UTF-16 text".into()),
        (utf_16(HEADER, [0xfe, 0xff], u16::to_be_bytes), "1: expected UTF-8 text, found UTF-16 text".into()),
    ];
    let bench = Bench::calibrated();
    for (content, message) in cases {
        bench.write("bad.csv", &content);
        // A file in an entirely different encoding belongs to somebody else.
        let is_foreign = message.contains(one_of) || message.contains("UTF-8 text");
        let hint = if is_foreign { "; see `ohmstrain inspect bad.csv`" } else { "" };
        // A stream may have restarted.
        let is_back = message.contains("expected a time after");
        let anew = "; if the clock has started again there, --skip-bad goes on with another filter";
        let in_parts =
            "; if the clock has started again there, give each part a file of its own, or `filter --skip-bad` both";
        let split = "; if the clock has started again there, `ohmstrain import --split-recordings` makes a file of each recording \
                     (with --each for several channels)";
        let of = |command: &[&str]| match command[0] {
            "filter" if is_back => anew,
            "smooth" if is_back => in_parts,
            _ if is_back => split,
            _ => hint,
        };
        for command in READERS {
            fails(&bench, command, CONTENT, &format!("bad.csv:{message}{}", of(command)));
        }
        let run = bench.feed(&["filter", "--sensor", "sensor.toml"], content);
        run.fails(CONTENT, &format!("stdin:{message}{}", if is_back { anew } else { "" }));
    }
}

#[test]
fn a_foreign_cell_does_not_garble_the_message() {
    let bench = Bench::calibrated();
    bench.write("bad.csv", with_row(&format!("0.2,\u{1b}[2J{},0.02", "x".repeat(1000))));
    let run = bench.run(READERS[0]);
    run.printed_whole_rows();
    assert_eq!((run.code, run.stderr.lines().count()), (Some(CONTENT), 1));
    assert!(run.stderr.len() < 200 && !run.stderr.contains('\u{1b}'), "{}", run.stderr);
}

#[test]
fn a_reference_without_information_is_refused() {
    let bench = Bench::calibrated();
    let trace = bench.read("trace.csv");
    let header_line = header_line(&trace);
    let no_reference = format!(
        "bad.csv:{header_line}: column `strain`: expected a reference (strain, displacement_mm or angle_deg), found none"
    );
    let (evaluate, calibrate) = (READERS[2], READERS[3]);

    bench.write("bad.csv", trace.replace(",strain", ",remark"));
    fails(&bench, evaluate, CONTENT, &no_reference);
    fails(&bench, calibrate, CONTENT, &no_reference);

    bench.write("bad.csv", change_rows(&trace, |_, cells| cells[2] = "0.1".into()));
    let constant = "bad.csv: the reference is constant: nothing can be learned from it";
    fails(&bench, calibrate, CONTENT, constant);
    let unchanged = "bad.csv: expected a reference that changes, found 0.1 in every row that is scored";
    fails(&bench, evaluate, CONTENT, unchanged);

    bench.write("bad.csv", change_rows(&trace, |_, cells| cells[2] = "NaN".into()));
    let none = "bad.csv: recording 1 has 0 rows with reading and reference, at least 60 are needed";
    fails(&bench, calibrate, CONTENT, none);
    fails(&bench, evaluate, CONTENT, "bad.csv: expected a reference at any row, found none");

    bench.write("bad.csv", &trace);
    let from = [evaluate, &["--from", "400.5"]].concat();
    fails(&bench, &from, CONTENT, "bad.csv: no row is left by --from 400.5; the recording goes from 0 to 400 s");
    let few = "bad.csv: recording 1 has 15 rows with reading and reference, at least 60 are needed";
    fails(&bench, &[calibrate, &["--until", "3"]].concat(), CONTENT, few);

    bench.write("bad.csv", trace.replace(",strain", ",angle_deg"));
    let angle = format!(
        "bad.csv:{header_line}: column `angle_deg`: expected a reference in `strain`, as the calibration has it, found \
         `angle_deg`"
    );
    fails(&bench, evaluate, CONTENT, &angle);
    fails(&bench, &["calibrate", "trace.csv", "bad.csv", "-o", "old.toml"], CONTENT, &angle);
}

#[test]
fn the_culprit_among_several_recordings_is_named() {
    let bench = Bench::calibrated();
    let trace = bench.read("trace.csv");
    bench.write("bad.csv", trace.lines().take(30).map(|line| format!("{line}\n")).collect::<String>());
    let run = bench.run(&["calibrate", "trace.csv", "bad.csv", "-o", "new.toml"]);
    assert_eq!((run.code, run.stderr.lines().count()), (Some(CONTENT), 1));
    assert!(run.stderr.starts_with("ohmstrain: bad.csv: recording 2 has "), "{}", run.stderr);
}

#[test]
fn readings_in_another_unit_than_the_sensors_are_refused() {
    let bench = Bench::calibrated();
    let trace = bench.read("trace.csv").replace("resistance_ohm", "resistance_ratio");
    let header_line = header_line(&trace);
    bench.write("bad.csv", trace);
    let message = format!(
        "bad.csv:{header_line}: column `resistance_ratio`: expected `resistance_ohm` as in the sensor's calibration, found \
         `resistance_ratio`"
    );
    for command in &READERS[..3] {
        fails(&bench, command, CONTENT, &message);
    }
    fails(&bench, &["calibrate", "trace.csv", "bad.csv", "-o", "old.toml"], CONTENT, &message);
}

#[test]
fn a_sensor_file_that_is_none_is_refused_alike_by_every_command() {
    let bench = Bench::calibrated();
    let (sensor, trace) = (bench.read("sensor.toml"), bench.read("trace.csv"));
    /// Replaces the first line that starts with `start`; returns its number.
    fn swap(sensor: &str, start: &str, by: &str) -> (String, usize) {
        let index = sensor.lines().position(|line| line.starts_with(start)).unwrap();
        let mut lines: Vec<&str> = sensor.lines().collect();
        lines[index] = by;
        (lines.join("\n"), index + 1)
    }
    let unknown = swap(&sensor, "made_by = ", "colour = \"black\"");
    let in_table = swap(&sensor, "tau_s = ", "tau_min = 3.0");
    let newer = swap(&swap(&sensor, "format = ", "format = 10").0, "made_by = ", "colour = \"black\"");
    let word = swap(&sensor, "rest_reading = ", "rest_reading = \"high\"");
    let negative = swap(&sensor, "rest_reading = ", "rest_reading = -1600.0");
    let nan = swap(&sensor, "rest_reading = ", "rest_reading = nan");
    let endless = swap(&sensor, "longest_repeat_s = ", "longest_repeat_s = inf");
    let far = swap(&sensor, "measured_rest = ", "measured_rest = 1e9");
    let limits = swap(&sensor, "upper = ", "upper = -1.0");
    let tau = swap(&sensor, "tau_s = ", "tau_s = -2.0");
    let family = swap(&sensor, "family = \"polynomial\"", "family = \"spline\"");
    let angle = swap(&sensor, "quantity = ", "quantity = \"angle_deg\"");
    let line_of = |start: &str| sensor.lines().position(|line| line.starts_with(start)).unwrap();
    let joint = "[joint]\nprestrain = 0.0\nmoment_arm_mm = 0.0\ngauge_length_mm = 30.0\n\n[law]";
    let cases: Vec<(Vec<u8>, String)> = vec![
        (unknown.0.into(), format!(":{}: column 1: unknown field `colour`, expected one of `format`, ", unknown.1)),
        (in_table.0.into(), format!(":{}: column 1: unknown field `tau_min`, expected one of `tau_s`, ", in_table.1)),
        // A field of a newer version is reported as newer, not as unknown.
        (newer.0.into(), ":1: field `format`: expected version 9, found 10".into()),
        (word.0.into(), format!(":{}: column 16: invalid type: string \"high\", expected f64", word.1)),
        (
            negative.0.into(),
            format!(":{}: column 16: field `rest_reading`: expected 1e-12 to 1e12, found -1600", negative.1),
        ),
        (nan.0.into(), format!(":{}: column 16: field `rest_reading`: expected 1e-12 to 1e12, found NaN", nan.1)),
        (
            endless.0.into(),
            format!(":{}: column 20: field `validity.longest_repeat_s`: expected 0 to 1e12, found inf", endless.1),
        ),
        (far.0.into(), format!(":{}: column 17: field `measured_rest`: expected ", far.1)),
        (
            limits.0.into(),
            format!(":{}: column 9: field `limits.upper`: expected more than `lower`, 0, found -1", limits.1),
        ),
        (
            tau.0.into(),
            format!(":{}: column 9: field `law.branches[0].tau_s`: expected 1e-12 to 1e12, found -2", tau.1),
        ),
        (
            family.0.into(),
            format!(":{}: column 10: unknown variant `spline`, expected one of `polynomial`, ", family.1),
        ),
        (
            sensor.replace("[law]", joint).into(),
            format!(":{}: column 17: field `joint.moment_arm_mm`: expected a length", 3 + line_of("[law]")),
        ),
        (
            angle.0.replace("[law]", &joint.replace("= 0.0\ng", "= 9.0\ng")).into(),
            format!(":{}: column 12: field `quantity`: expected `strain` beside `[joint]`, found angle_deg", angle.1),
        ),
        (trace.into(), " is a recording, not a sensor file: give --sensor what ".into()),
        ("hello there\n".into(), ":1: column 7: key with no value, expected `=`".into()),
        ("format = 1\n[law\n".into(), ":2: column 5: unclosed table, expected `]`".into()),
        (Vec::new(), ":1: column 1: missing field `format`".into()),
        (b"format = 9\n".to_vec(), ":1: column 1: missing field `made_by`".into()),
        (utf_16("format = 1", [0xff, 0xfe], u16::to_le_bytes), ":1: expected a text file in UTF-8, found ".into()),
    ];
    for (content, message) in cases {
        bench.write("bad.toml", content);
        for command in ["filter", "smooth", "evaluate"] {
            let run = bench.run(&[command, "trace.csv", "--sensor", "bad.toml"]);
            assert!(run.stderr.starts_with(&format!("ohmstrain: bad.toml{message}")), "{message}\n{}", run.stderr);
            assert_eq!((run.code, run.stderr.lines().count()), (Some(CONTENT), 1), "{}", run.stderr);
            assert_eq!(run.stdout, "");
        }
    }
}

/// Checks like `fails`, for messages that end with the operating system's text.
#[track_caller]
fn fails_on_files(bench: &Bench, arguments: &[&str], message: &str) {
    let before = bench.files();
    let run = bench.run(arguments);
    assert!(run.stderr.starts_with(&format!("ohmstrain: {message}: ")), "{}: {}", run.command, run.stderr);
    assert!(!run.stderr.contains(".tmp"), "{}", run.stderr);
    assert_eq!((run.code, run.stderr.lines().count()), (Some(OTHER), 1), "{}: {}", run.command, run.stderr);
    assert_eq!(run.stdout, "", "{}", run.command);
    assert_eq!(bench.files(), before);
}

#[test]
fn a_file_that_cannot_be_read_is_named() {
    let bench = Bench::calibrated();
    for command in ["filter", "smooth", "evaluate"] {
        fails_on_files(&bench, &[command, "none.csv", "--sensor", "sensor.toml"], "cannot read none.csv");
        fails_on_files(&bench, &[command, "trace.csv", "--sensor", "none.toml"], "cannot read none.toml");
    }
    fails_on_files(&bench, &["calibrate", "trace.csv", "none.csv", "-o", "new.toml"], "cannot read none.csv");
}

/// Nothing can be created below a regular file, by any user.
#[test]
fn an_output_that_cannot_be_written_leaves_nothing_behind() {
    let bench = Bench::calibrated();
    bench.write("file", "what was here before");
    fails_on_files(&bench, &["demo", "--out", "file/demo"], "cannot make the folder file/demo");
    fails_on_files(&bench, &["demo", "--out", "file"], "cannot make the folder file");
    fails_on_files(&bench, &["simulate", "-o", "file/trace.csv"], "cannot write file/trace.csv");
    let calibrate = ["calibrate", "trace.csv", "--until", "60", "--branches", "0"];
    for (output, report, culprit) in [
        ("file/sensor.toml", None, "file/sensor.toml"),
        ("none/sensor.toml", None, "none/sensor.toml"),
        ("new.toml", Some("file/report.html"), "file/report.html"),
    ] {
        let report = report.map_or(Vec::new(), |report| vec!["--report", report]);
        let arguments = [&calibrate[..], &["-o", output], &report].concat();
        fails_on_files(&bench, &arguments, &format!("cannot write {culprit}"));
    }
    assert_eq!(bench.read("file"), "what was here before");
}

/// The argument parser may print several lines of help; the first one names the error.
#[test]
fn an_argument_that_cannot_be_is_named() {
    let filter = ["filter", "trace.csv", "--sensor", "sensor.toml"];
    let calibrate = ["calibrate", "trace.csv", "-o", "new.toml"];
    let evaluate = ["evaluate", "trace.csv", "--sensor", "sensor.toml"];
    let cases: &[(&[&str], &[&str], &str)] = &[
        (&filter, &["--estimator", "tarot"], "'tarot' for '--estimator"),
        (&filter, &["--initial-strain", "x"], "'x' for '--initial-strain"),
        (&filter, &["--initial-strain", "NaN"], "'NaN' for '--initial-strain"),
        (&filter, &["--initial-strain", "inf"], "'inf' for '--initial-strain"),
        (&filter, &["--known", "3"], "'3' for '--known"),
        (&filter, &["--known", "3:0.1:0"], "'3:0.1:0' for '--known"),
        (&filter, &["--rest-resistance", "0"], "'0' for '--rest-resistance"),
        (&filter, &["--rest-resistance", "-5"], "'-5' for '--rest-resistance"),
        (&filter, &["--rest-resistance", "first:0"], "'first:0' for '--rest-resistance"),
        (&filter, &["--rest-resistance", "last:5"], "'last:5' for '--rest-resistance"),
        (&filter, &["--front-end", "bridge"], "'bridge' for '--front-end"),
        (&filter, &["--joint", "prestrain=0"], "'prestrain=0' for '--joint"),
        (&filter, &["--gauge-length-mm", "NaN"], "'NaN' for '--gauge-length-mm"),
        (&filter, &["--gauge-length-mm", "0"], "'0' for '--gauge-length-mm"),
        (&filter, &["--unit", "strain=kohm"], "'strain=kohm' for '--unit"),
        (&filter, &["--unit", "resistance=megohm"], "'resistance=megohm' for '--unit"),
        (&filter, &["--without", "strain"], "'strain' for '--without"),
        (&evaluate, &["--without", "doubts"], "'doubts' for '--without"),
        (&filter, &["--columns", "strain,colour"], "--columns: expected some of time_s,resistance_ohm,"),
        (&filter, &["--columns", ""], "--columns: expected some of time_s,resistance_ohm,"),
        (&filter, &["--colour"], "'--colour'"),
        (&calibrate, &["--branches", "5"], "'5' for '--branches"),
        (&calibrate, &["--branches", "two"], "'two' for '--branches"),
        (&calibrate, &["--gauge", "spline"], "'spline' for '--gauge"),
        (&calibrate, &["--until", "noon"], "'noon' for '--until"),
        (&calibrate, &["--until", "NaN"], "'NaN' for '--until"),
        (&calibrate, &["--from", "inf"], "'inf' for '--from"),
        (&evaluate, &["--from", "NaN"], "'NaN' for '--from"),
        (&["simulate"], &["--material", "steel"], "'steel' for '--material"),
        (&["simulate"], &["--protocol", "dance"], "'dance' for '--protocol"),
        (&["simulate"], &["--speed-mm-s", "0"], "speed_mm_s: expected 0.01 to 100, found 0"),
        (&["simulate"], &["--elongation-mm", "NaN"], "elongation_mm: expected 0.001 to 15, found NaN"),
        (&["simulate"], &["--sample-rate-hz", "1e9"], "sample_rate_hz: expected 0.1 to 10000, found 1000000000"),
        (&["demo"], &["--seed", "-1"], "'-1'"),
        (&["filter"], &["trace.csv"], "required arguments were not provided"),
        (&["dance"], &[], "'dance'"),
    ];
    let bench = Bench::calibrated();
    let before = bench.files();
    for (command, flags, culprit) in cases {
        let run = bench.run(&[*command, *flags].concat());
        assert_eq!((run.code, run.stdout.as_str()), (Some(ARGUMENTS), ""), "{}: {}", run.command, run.stderr);
        assert!(run.stderr.lines().next().unwrap().contains(culprit), "{}: {}", run.command, run.stderr);
        assert!(!run.stderr.contains("panicked"), "{}: {}", run.command, run.stderr);
        assert_eq!(bench.files(), before, "{}", run.command);
    }
    let run = bench.run(&[&filter[..], &["--columns", "strain,colour"]].concat());
    assert!(run.stderr.lines().count() == 1 && run.stderr.ends_with("found `colour`\n"), "{}", run.stderr);
}

/// The name of a removed flag leads to its replacement, in commands that had it.
#[test]
fn a_flag_that_is_gone_leads_to_another() {
    let bench = Bench::calibrated();
    let front_end = "`# front_end = …` above the header says it, which `ohmstrain import --front-end` writes";
    let cases: &[(&[&str], &str)] = &[
        (&["filter", "--no-correction"], "it is `--without correction` now"),
        (&["evaluate", "--no-correction"], "it is `--without correction` now"),
        (&["live", "--no-plausibility"], "it is `--without plausibility` now"),
        (&["-q", "smooth", "--no-second-look"], "it is `--without second-look` now"),
        (&["filter", "--no-doubts"], "it is `--without doubts` now"),
        (&["calibrate", "--strain-unit", "percent"], "it is `--unit strain=UNIT` now"),
        (&["live", "--resistance-unit=kohm"], "it is `--unit resistance=UNIT` now"),
        (&["smooth", "--front-end", "divider"], front_end),
        (&["evaluate", "--gauge-length-mm", "30"], "`ohmstrain import --gauge-length-mm` writes"),
        (&["fit-law", "--joint", "prestrain=0"], "`ohmstrain import --joint` writes"),
    ];
    for (arguments, answer) in cases {
        let run = bench.run(arguments);
        assert_eq!((run.code, run.stdout.as_str()), (Some(ARGUMENTS), ""), "{}", run.command);
        assert!(run.stderr.contains(answer), "{}: {}", run.command, run.stderr);
        assert_eq!(run.stderr.matches("tip: ").count(), 1, "{}: {}", run.command, run.stderr);
    }
    let never_there = bench.run(&["export", "--no-doubts"]);
    assert!(!never_there.stderr.contains("--without"), "{}", never_there.stderr);
}
