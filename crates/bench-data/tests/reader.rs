//! Inputs that the reader accepts, and its errors for others.

use ohmstrain_bench_data::{FrontEndSpec, Metadata, ReadingKind, ReferenceQuantity, Trace, TraceError};

fn read(text: impl AsRef<[u8]>) -> Result<Trace, TraceError> {
    Trace::read(text.as_ref(), "t.csv")
}

fn message(text: impl AsRef<[u8]>) -> String {
    match read(text) {
        Ok(trace) => format!("read {} rows", trace.len()),
        Err(error) => error.to_string(),
    }
}

fn with_missing(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().map(|value| (!value.is_nan()).then_some(*value)).collect()
}

#[test]
fn bad_input_is_named_with_file_line_column_expected_and_found() {
    let resistance = "a positive resistance, or nothing for a missing reading";
    let utf16: Vec<u8> = "\u{feff}time_s".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let long = format!("time_s,resistance_ohm\n0,{}\n", "z".repeat(99));
    let cases: Vec<(&[u8], String)> = vec![
        (b"", "t.csv:1: expected a header such as `time_s,resistance_ohm,strain`, found an empty file".into()),
        (b"# a = b\n", "t.csv:1: expected a header such as `time_s,resistance_ohm,strain`, found the end of the file".into()),
        (b"time_s,resistance_ohm\n", "t.csv:2: expected at least one row of data, found the end of the file".into()),
        (b"time_s,strain\n0,0\n", "t.csv:1: expected a header with the column `resistance_ohm` or `resistance_ratio` or `adc`, found `time_s,strain`".into()),
        (b"0.1,1600,0\n", "t.csv:1: expected a header with the column `time_s` or `time_us`, found `0.1,1600,0`".into()),
        (b"time_s;resistance_ohm\n0;1\n", "t.csv:1: expected a header with the column `time_s` or `time_us`, found `time_s;resistance_ohm`".into()),
        (b"time_s,\"resistance_ohm\n0,1\n", "t.csv:1: expected quotation marks in pairs, found `time_s,\"resistance_ohm`".into()),
        (b"\xef\xbb\xbf\n\n", "t.csv:2: expected a header such as `time_s,resistance_ohm,strain`, found the end of the file".into()),
        (b"time_s,time_us,adc\n", "t.csv:1: column `time_us`: expected one column `time_s` or `time_us`, found `time_s` and `time_us`".into()),
        (b"time_s,adc,adc\n", "t.csv:1: column `adc`: expected one column `resistance_ohm` or `resistance_ratio` or `adc`, found `adc` and `adc`".into()),
        (b"time_s,resistance_ohm,strain,angle_deg\n", "t.csv:1: column `angle_deg`: expected one column `strain` or `displacement_mm` or `angle_deg`, found `strain` and `angle_deg`".into()),
        (b"time_s,adc\n0,1\n", "t.csv:1: column `adc`: expected a line `# front_end = …` above the header, found none".into()),
        (b"time_s,resistance_ohm,displacement_mm\n", "t.csv:1: column `displacement_mm`: expected a line `# gauge_length_mm = …` above the header, found none".into()),
        (b"time_s,resistance_ohm\n0,16o0\n", "t.csv:2: column `resistance_ohm`: expected a number, found `16o0`".into()),
        (b"time_s,resistance_ohm\n0,inf\n", "t.csv:2: column `resistance_ohm`: expected a finite number, found `inf`".into()),
        (b"time_s,resistance_ohm,strain\n0,1,-1e999\n", "t.csv:2: column `strain`: expected a finite number, found `-1e999`".into()),
        (b"time_s,resistance_ohm,temperature_c\n0,1,warm\n", "t.csv:2: column `temperature_c`: expected a number, found `warm`".into()),
        (b"time_s,resistance_ohm\n0,-1\n", format!("t.csv:2: column `resistance_ohm`: expected {resistance}, found `-1`")),
        (b"time_s,resistance_ratio\n0,0\n", format!("t.csv:2: column `resistance_ratio`: expected {resistance}, found `0`")),
        (b"time_s,resistance_ohm\n1,1\n\n0.5,1\n", "t.csv:4: column `time_s`: expected a time after 1 s, found `0.5`".into()),
        (b"time_s,resistance_ohm\r\n1,1\r\n1,1\r\n", "t.csv:3: column `time_s`: expected a time after 1 s, found `1`".into()),
        (b"time_s,resistance_ohm\n,1\n", "t.csv:2: column `time_s`: expected a time in seconds, found nothing".into()),
        (b"time_us,resistance_ohm\n1.5,1\n", "t.csv:2: column `time_us`: expected a time in whole microseconds, found `1.5`".into()),
        (b"time_us,resistance_ohm\n9,1\n8,1\n", "t.csv:3: column `time_us`: expected a time after 9 µs, found `8`".into()),
        (b"time_s,resistance_ohm,x\n0,1\n", "t.csv:2: expected 3 cells, as in the header, found 2".into()),
        (b"time_s,resistance_ohm\n0,1,\n", "t.csv:2: expected 2 cells, as in the header, found 3".into()),
        (b"time_s,resistance_ohm\n0,\"1\n", "t.csv:2: expected quotation marks in pairs, found `0,\"1`".into()),
        (b"time_s,resistance_ohm\n#\"a,\"1\n1,1\n", "t.csv:2: expected quotation marks in pairs, found `#\"a,\"1`".into()),
        (b"time_s,resistance_ohm\n0,1\0\n", "t.csv:2: expected UTF-8 text, found binary data (a NUL byte)".into()),
        (b"time_s,resistance_ohm\n0,\xff\xff\n", "t.csv:2: expected UTF-8 text, found binary data (bytes that are not UTF-8)".into()),
        (b"\x7fELF\x02\x01\0\0", "t.csv:1: expected UTF-8 text, found binary data (a NUL byte)".into()),
        (&utf16, "t.csv:1: expected UTF-8 text, found UTF-16 text".into()),
        (long.as_bytes(), format!("t.csv:2: column `resistance_ohm`: expected a number, found `{}…`", "z".repeat(40))),
        (b"time_s,resistance_ohm\n0,\x1b[31m\n", "t.csv:2: column `resistance_ohm`: expected a number, found `\\u{1b}[31m`".into()),
        (b"# gauge_length_mm = -3\ntime_s,resistance_ohm\n0,1\n", "t.csv:1: expected `gauge_length_mm` to be a positive number of millimetres, found `-3`".into()),
        (b"# material = a\n# material = b\n", "t.csv:2: expected `# material = …` once, found it a second time".into()),
        (b"# joint = prestrain=0 moment_arm_mm=0 gauge_length_mm=30\n", "t.csv:1: expected possible parameters (moment_arm_mm is outside the range in which the model holds), found `prestrain=0 moment_arm_mm=0 gauge_length…`".into()),
        (b"# front_end = bridge\n", "t.csv:1: expected a front end `divider …` or `constant-current …`, found `bridge`".into()),
        (b"# front_end = divider side=low bits=12\n", "t.csv:1: expected `reference_ohm=…`, found none".into()),
        (b"# front_end = divider reference_ohm=1e4 side=low bits=40\n", "t.csv:1: expected possible parameters (bits is outside the range in which the model holds), found `divider reference_ohm=1e4 side=low bits=…`".into()),
    ];
    for (text, expected) in cases {
        let message = message(text);
        assert!(!message.contains('\n'), "{message}");
        assert_eq!(message, expected, "{}", String::from_utf8_lossy(text));
    }
}

#[test]
fn an_error_carries_its_parts_as_fields() {
    let Err(TraceError::Content(error)) = Trace::read(&b"time_s,resistance_ohm\n0,x\n"[..], "-") else {
        panic!("a letter is no resistance");
    };
    assert_eq!((error.file.as_str(), error.line, error.column.as_deref()), ("stdin", 2, Some("resistance_ohm")));
    assert_eq!((error.expected.as_str(), error.found.as_str()), ("a number", "`x`"));
}

#[test]
fn a_failing_source_is_not_bad_content() {
    struct Broken;
    impl std::io::Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("gone"))
        }
    }
    use std::io::Read as _;
    let error = Trace::read((&b"time_s,resistance_ohm\n0,1\n"[..]).chain(Broken), "t.csv").unwrap_err();
    assert!(matches!(error, TraceError::Io { line: 3, .. }));
    assert_eq!(error.to_string(), "t.csv:3: cannot be read: gone");
    assert_eq!(Trace::read(Broken, "-").unwrap_err().to_string(), "stdin:1: cannot be read: gone");
}

#[test]
fn one_row_is_a_trace_even_without_an_end_of_line() {
    let trace = read("time_s,resistance_ohm\n0,1600").unwrap();
    assert_eq!((trace.len(), trace.readings.values[0]), (1, 1600.0));
    assert_eq!((trace.reference, trace.temperature_c), (None, None));
}

#[test]
fn byte_order_mark_crlf_quotes_blanks_and_unknown_columns_are_tolerated() {
    let text = "\u{feff}# material = x\r\n\r\n\"strain\", note ,time_s,resistance_ohm\r\n0.1,\"a,b\",0.5, 7 \r\n\r\n0.2,,1,8\r\n";
    let trace = read(text).unwrap();
    assert_eq!(trace.metadata.material.as_deref(), Some("x"));
    assert_eq!((trace.time_s, trace.readings.values), (vec![0.5, 1.0], vec![7.0, 8.0]));
    assert_eq!(trace.reference.unwrap().values, [0.1, 0.2]);
}

#[test]
fn an_empty_or_nan_cell_is_missing() {
    let trace = read("time_s,resistance_ratio,strain,temperature_c\n0,,0.1,20\n1,NaN,nan,\n2,1.5,,NAN\n").unwrap();
    assert_eq!(trace.readings.kind, ReadingKind::Ratio);
    assert_eq!(with_missing(&trace.readings.values), [None, None, Some(1.5)]);
    assert_eq!(with_missing(&trace.reference.unwrap().values), [Some(0.1), None, None]);
    assert_eq!(with_missing(&trace.temperature_c.unwrap()), [Some(20.0), None, None]);
}

#[test]
fn metadata_is_known_or_kept() {
    let text = "# material = ecoflex-00-30\n#gauge_length_mm=30\n# a remark\n# front_end = constant-current \
                current_a=1e-4 gain=10 full_scale_v=3.3 bits=12\n# joint = prestrain=0.05 moment_arm_mm=4.4 \
                gauge_length_mm=30\n# operator = me = you\ntime_s,resistance_ohm\n0,1\n";
    let metadata = read(text).unwrap().metadata;
    assert_eq!(metadata.gauge_length_mm, Some(30.0));
    assert_eq!(metadata.front_end.unwrap().noise_codes(), 0.0);
    assert_eq!(metadata.joint.unwrap().moment_arm_mm, 4.4);
    assert_eq!(metadata.other, [("operator".to_owned(), "me = you".to_owned())]);
}

#[test]
fn codes_become_ohms_with_a_standard_deviation_and_a_saturated_one_is_missing() {
    let head = "# front_end = divider reference_ohm=10000 side=low bits=12 noise_codes=0.5\n";
    let trace = read(format!("{head}time_s,adc\n0,819\n1,4095\n2,0\n3,\n4,9999\n")).unwrap();
    let converter = trace.readings.converter.unwrap();
    assert_eq!(converter.saturated, [false, true, true, false, true]);
    assert_eq!(converter.codes, [Some(819), Some(4095), Some(0), None, Some(9999)]);
    assert_eq!(with_missing(&trace.readings.values), [Some(2500.0), None, None, None, None]);
    // R = R_ref x/(1-x), x = 0.2: dR/dcode = R_ref / 0.64 / 4095; the code's variance is 0.25 + 1/12.
    let sd = 1e4 / 0.64 / 4095.0 * (0.25_f64 + 1.0 / 12.0).sqrt();
    assert!((converter.sd_ohm[0] / sd - 1.0).abs() < 1e-12);
    assert_eq!(
        message(format!("{head}time_s,adc\n0,-3\n")),
        "t.csv:3: column `adc`: expected a converter code, a whole number from 0, found `-3`"
    );
}

#[test]
fn references_in_other_units_become_strain_where_the_geometry_is_known() {
    let reference = |text: &str| read(text).unwrap().reference.unwrap();
    let strain = reference("# gauge_length_mm = 40\ntime_s,resistance_ohm,displacement_mm\n0,1,8\n");
    assert_eq!((strain.quantity, strain.values[0]), (ReferenceQuantity::Strain, 0.2));
    let angle = reference("time_s,resistance_ohm,angle_deg\n0,1,90\n");
    assert_eq!((angle.quantity, angle.values[0]), (ReferenceQuantity::AngleDeg, 90.0));
    let joint = "# joint = prestrain=0.05 moment_arm_mm=4.4 gauge_length_mm=30\n";
    let strain = reference(&format!("{joint}time_s,resistance_ohm,angle_deg\n0,1,90\n"));
    assert_eq!(strain.quantity, ReferenceQuantity::Strain);
    assert!((strain.values[0] - (0.05 + 4.4 * std::f64::consts::FRAC_PI_2 / 30.0)).abs() < 1e-15);
}

#[test]
fn overrides_take_the_place_of_the_files_metadata() {
    let file = "# gauge_length_mm = 40\ntime_s,adc,displacement_mm\n0,819,8\n";
    let front_end: FrontEndSpec = "divider reference_ohm=1000 side=low bits=12".parse().unwrap();
    let overrides = Metadata { gauge_length_mm: Some(80.0), front_end: Some(front_end), ..Metadata::default() };
    let rows = ohmstrain_bench_data::TraceReader::with_overrides(file.as_bytes(), "t.csv", &overrides).unwrap();
    let trace = Trace::collect(rows).unwrap();
    assert_eq!((trace.readings.values[0], trace.reference.unwrap().values[0]), (250.0, 0.1));
}

#[test]
fn slices_by_row() {
    let trace = read("time_s,resistance_ohm,strain\n0,1,0\n1,2,0.1\n2,3,0.2\n3,4,0.3\n").unwrap();
    assert_eq!(trace.rows(0..2).time_s, [0.0, 1.0]);
    assert_eq!(trace.rows(2..4).readings.values, [3.0, 4.0]);
    assert_eq!(trace.rows(1..3).reference.unwrap().values, [0.1, 0.2]);
    assert_eq!(trace.rows(1..99).len(), 3);
    assert!(trace.rows(7..9).is_empty() && trace.rows(0..0).is_empty());
}

#[test]
fn microseconds_may_wrap() {
    let trace = read("time_us,resistance_ohm\n4294900000,1\n32704,1\n132704,1\n").unwrap();
    assert_eq!(trace.time_s, [4294.9, 4295.0, 4295.1]);
}
