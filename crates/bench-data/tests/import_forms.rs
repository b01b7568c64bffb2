//! The forms in which labs export recordings: each is proposed an import without a question (or with the one that it
//! leaves), the import takes the proposal, and the trace has the numbers that the file was made of.

use std::fmt::Write as _;
use std::io::Write as _;

use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::import::{ImportError, Imported, Plan, Preset, Recipe, Table, read_table};

/// Numbers with few decimals, so that every unit writes them exactly.
pub struct Truth {
    time_ms: Vec<i64>,
    /// Tenths of an ohm.
    decaohm: Vec<i64>,
    /// Hundredths of a percent, and of a millimetre on 100 mm.
    strain: Vec<i64>,
}

pub fn truth() -> Truth {
    let rows = 60;
    Truth {
        time_ms: (0..rows).map(|k| 250 + 50 * k + k % 3).collect(),
        decaohm: (0..rows).map(|k| 16_000 + 13 * k + 7 * (k % 5)).collect(),
        strain: (0..rows).map(|k| 50 * (k - 30_i64).abs() + 3).collect(),
    }
}

impl Truth {
    fn time_s(&self) -> Vec<f64> {
        self.time_ms.iter().map(|ms| *ms as f64 / 1e3).collect()
    }

    fn ohm(&self) -> Vec<f64> {
        self.decaohm.iter().map(|tenths| *tenths as f64 / 10.0).collect()
    }

    pub fn strain(&self) -> Vec<f64> {
        self.strain.iter().map(|hundredths| *hundredths as f64 / 1e4).collect()
    }
}

/// A whole number of 10^-`digits` as text: `1600.1`.
pub fn decimal(value: i64, digits: usize, mark: char) -> String {
    let text = format!("{:0>width$}", value, width = digits + 1);
    let (whole, fraction) = text.split_at(text.len() - digits);
    if digits == 0 { text } else { format!("{whole}{mark}{fraction}") }
}

/// A file with these lines above the rows; a row is made of time in ms, tenths of an ohm, hundredths of a percent.
pub fn file(above: &str, row: impl Fn(i64, i64, i64) -> String) -> String {
    let truth = truth();
    let mut out = above.to_owned();
    for k in 0..truth.time_ms.len() {
        writeln!(out, "{}", row(truth.time_ms[k], truth.decaohm[k], truth.strain[k])).unwrap();
    }
    out
}

pub fn tables(files: &[(&str, Vec<u8>)], recipe: &Recipe) -> Result<Vec<Table>, ImportError> {
    let read = |(index, (name, bytes)): (usize, &(&str, Vec<u8>))| {
        read_table(bytes.clone(), name, &recipe.read_options(index))
    };
    files.iter().enumerate().map(read).collect()
}

/// What is proposed, run as it is proposed.
pub fn proposed(files: &[(&str, Vec<u8>)], known: &Recipe) -> Result<(Recipe, Imported), ImportError> {
    let first = tables(files, known)?;
    let recipe = Plan::propose(&first, known)?.recipe(&first);
    let again = tables(files, &recipe)?;
    let plan = Plan::new(&again, &recipe)?;
    assert_eq!(plan.recipe(&again), recipe, "a recipe leads to itself");
    let imported = plan.import(&again)?;
    let mut written = Vec::new();
    imported.trace.write(&mut written).unwrap();
    let read = Trace::read(written.as_slice(), "again").unwrap();
    assert_eq!(format!("{read:?}"), format!("{:?}", imported.trace), "the trace survives being written");
    Ok((recipe, imported))
}

/// The file is imported as proposed, to the last bit of its numbers.
#[track_caller]
pub fn is_imported(name: &str, bytes: impl Into<Vec<u8>>, known: &Recipe) -> Imported {
    let (_, imported) = proposed(&[(name, bytes.into())], known).unwrap_or_else(|error| panic!("{error}"));
    let truth = truth();
    let trace = &imported.trace;
    assert_eq!(trace.time_s, truth.time_s(), "{name}: time");
    assert_eq!(trace.readings.values, truth.ohm(), "{name}: readings");
    let strain = &trace.reference.as_ref().unwrap().values;
    assert_eq!(strain.len(), truth.strain.len());
    for (found, expected) in strain.iter().zip(truth.strain()) {
        // A displacement is rounded when it is read and when it is divided; what is a strain already, once.
        let roundings =
            if known.gauge_length_mm.is_some() || trace.metadata.gauge_length_mm.is_some() { 1.0 } else { 0.0 };
        assert!((found - expected).abs() <= roundings * f64::EPSILON * expected, "{name}: {found} {expected}");
    }
    imported
}

#[track_caller]
pub fn asks(files: &[(&str, &str)], known: &Recipe, words: &[&str]) {
    let files: Vec<(&str, Vec<u8>)> = files.iter().map(|(name, text)| (*name, text.as_bytes().to_vec())).collect();
    let error = proposed(&files, known).map(|(recipe, _)| recipe.arguments()).unwrap_err().to_string();
    assert!(words.iter().all(|word| error.contains(word)) && error.lines().count() == 1, "{error}");
}

fn gauge_100() -> Recipe {
    Recipe { gauge_length_mm: Some(100.0), ..Recipe::default() }
}

#[test]
fn semicolons_with_decimal_commas() {
    let row = |ms, ohm, strain| format!("{};{};{}", decimal(ms, 3, ','), decimal(ohm, 1, ','), decimal(strain, 2, ','));
    is_imported("komma.csv", file("Zeit (s);Widerstand (Ohm);Dehnung (%)\n", row), &Recipe::default());
}

#[test]
fn tabs_names_with_units_and_kiloohms() {
    let row =
        |ms, ohm, strain| format!("{}\t{}\t{}", decimal(ms, 3, '.'), decimal(ohm, 4, '.'), decimal(strain, 2, '.'));
    let text = file("Time (s)\tR (kOhm)\tDisplacement [mm]\n", row);
    is_imported("tabs.txt", text, &gauge_100());
}

#[test]
fn two_header_lines_and_a_line_of_units_below_a_preamble() {
    let row = |ms, ohm, strain| format!("{},{},{}", ms, decimal(ohm, 4, '.'), decimal(strain, 2, '.'));
    let above = "Rig 7\nOperator: N. N.\n\nClock,DMM,Stage\nTime,Resistance,Position\nms,kΩ,mm\n";
    is_imported("rig.csv", file(above, row), &gauge_100());
    // The names may stand in the upper line; where it has none, the lower one's counts.
    let above = "Rig 7\n\nTime,Resistance,Extension\nChannel 1,DMM,Channel 2\n(ms),(kΩ),(mm)\n";
    is_imported("upper.csv", file(above, row), &gauge_100());
    let above = "Time,,Extension\nClock,Resistance,Channel 2\n(ms),(kΩ),(mm)\n";
    is_imported("both.csv", file(above, row), &gauge_100());
}

#[test]
fn a_percent_sign_may_be_a_unit_and_a_hash_a_name() {
    let row = |ms, ohm, strain| format!("{},{},{ms}", decimal(strain, 2, '.'), decimal(ohm, 1, '.'));
    is_imported("units.csv", file("Strain,R,Time\n%,Ohm,ms\n", row), &Recipe::default());
    let row = |ms, ohm, strain| format!("{ms},{},{},{ms}", decimal(strain, 2, '.'), decimal(ohm, 1, '.'));
    is_imported("hash.csv", file("#,Strain,R,Time\n,%,Ohm,ms\n", row), &Recipe::default());
    let row = |ms, ohm, strain| format!("{}\t{}\t{ms}", decimal(strain, 2, '.'), decimal(ohm, 1, '.'));
    is_imported("tabs.tsv", file("Strain\tR\tTime\n%\tOhm\tms\n", row), &Recipe::default());
}

#[test]
fn twins_are_told_apart_by_the_line_above_them_or_by_number() {
    let row = |ms, ohm, strain| {
        let (ms, ohm, strain) = (decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
        format!("{ms},{ohm},{ms},{strain}")
    };
    let above = "DMM,,Stage,\nTime,Resistance,Time,Strain\ns,Ohm,s,%\n";
    is_imported("twins.csv", file(above, row), &Recipe::default());
}

#[test]
fn time_stamps() {
    let clock =
        |ms: i64| format!("{:02}:{:02}:{:02}.{:03}", ms / 3_600_000 % 24, ms / 60_000 % 60, ms / 1000 % 60, ms % 1000);
    let rest = |ohm, strain| format!("{},{}", decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
    let names = "Timestamp,R_ohm,strain_pct\n";
    // Just before midnight, so that a day goes by.
    let noon = 86_400_000 - 1000;
    type Stamp<'a> = (&'a str, &'a dyn Fn(i64) -> String);
    let forms: [Stamp; 5] = [
        ("iso", &|ms| format!("2024-02-{}T{}Z", if ms < 1000 { 28 } else { 29 }, clock(ms + noon))),
        ("zone", &|ms| format!("2024-02-{} {}+01:00", if ms < 1000 { 28 } else { 29 }, clock(ms + noon))),
        ("points", &|ms| format!("{}.02.2024 {}", if ms < 1000 { 28 } else { 29 }, clock(ms + noon))),
        ("american", &|ms| format!("02/{}/2024 {}", if ms < 1000 { 28 } else { 29 }, clock(ms + noon))),
        ("clock", &|ms| clock(ms + noon)),
    ];
    let truth = truth();
    for (name, stamp) in forms {
        let text = file(names, |ms, ohm, strain| format!("{},{}", stamp(ms), rest(ohm, strain)));
        let (_, imported) = proposed(&[(name, text.into())], &Recipe::default()).unwrap();
        let since: Vec<f64> = truth.time_ms.iter().map(|ms| (ms - truth.time_ms[0]) as f64 / 1e3).collect();
        assert_eq!(imported.trace.time_s, since, "{name}");
        assert_eq!(imported.trace.readings.values, truth.ohm(), "{name}");
    }
    let open = file(names, |ms, ohm, strain| format!("0{}/02/2024 {},{}", 1 + ms / 1500, clock(ms), rest(ohm, strain)));
    asks(&[("open", &open)], &Recipe::default(), &["day and month", "--unit time=dmy", "--unit time=mdy"]);
}

#[test]
fn overload_is_missing_and_unknown_words_are_asked_about() {
    let row = |word: &'static str| {
        move |ms, ohm, strain| {
            let reading = if ms % 7 == 0 { word.to_owned() } else { decimal(ohm, 1, '.') };
            format!("{},{},{}", decimal(ms, 3, '.'), reading, decimal(strain, 2, '.'))
        }
    };
    let names = "time_s,resistance_ohm,strain_percent\n";
    for word in ["OVLD", "+OL", "9.9E37", "", "NaN", "####"] {
        let text = file(names, row(word));
        let (_, imported) = proposed(&[("dmm.csv", text.into())], &Recipe::default()).unwrap();
        let truth = truth();
        let expected = truth.time_ms.iter().filter(|ms| **ms % 7 == 0).count();
        assert_eq!(imported.trace.readings.values.iter().filter(|value| value.is_nan()).count(), expected, "{word}");
        assert_eq!(imported.trace.time_s, truth.time_s());
        assert!(expected > 3 && imported.remarks.iter().any(|remark| remark.contains("missing values")), "{word}");
    }
    let text = file(names, row("WAIT"));
    asks(&[("dmm.csv", &text)], &Recipe::default(), &["dmm.csv:", "`WAIT`", "--missing WAIT"]);
    let known = Recipe { missing: vec!["WAIT".into()], ..Recipe::default() };
    assert!(proposed(&[("dmm.csv", text.into())], &known).is_ok());
}

#[test]
fn encodings() {
    let row =
        |ms, ohm, strain| format!("{};{};{};21,5", decimal(ms, 3, ','), decimal(ohm, 4, ','), decimal(strain, 2, ','));
    let text = file("Zeit [s];R [kΩ];Dehnung [%];Prüfraum Temperatur [°C]\n", row);
    let utf_16 = |mark: [u8; 2], order: fn(u16) -> [u8; 2]| -> Vec<u8> {
        mark.into_iter().chain(text.encode_utf16().flat_map(order)).collect()
    };
    is_imported("le.csv", utf_16([0xff, 0xfe], u16::to_le_bytes), &Recipe::default());
    is_imported("be.csv", utf_16([0xfe, 0xff], u16::to_be_bytes), &Recipe::default());
    is_imported("bom.csv", [b"\xef\xbb\xbf", text.as_bytes()].concat(), &Recipe::default());
    // Latin-1 has no Ω, but the degree sign and umlauts.
    let latin_1: Vec<u8> = text.replace('Ω', "Ohm").chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    assert!(std::str::from_utf8(&latin_1).is_err());
    let imported = is_imported("latin.csv", latin_1, &Recipe::default());
    assert_eq!(imported.trace.temperature_c.unwrap()[0], 21.5);
    let old_mac = text.replace('\n', "\r");
    is_imported("mac.csv", old_mac, &Recipe::default());
}

#[test]
fn a_trace_that_names_its_units_is_read_by_them() {
    let row = |ms, ohm, strain| format!("{},{},{}", decimal(ms, 3, '.'), decimal(ohm, 4, '.'), decimal(strain, 2, '.'));
    let above = "# strain_unit = percent\n# resistance_unit = kohm\ntime_s,resistance_ohm,strain\n";
    is_imported("units.csv", file(above, row), &Recipe::default());
}

#[test]
fn serial_plotter_lines_and_a_serial_monitor() {
    let row = |ms, ohm, strain| {
        format!("millis:{ms}\tR_ohm:{}\tstrain_pct:{}", decimal(ohm, 1, '.'), decimal(strain, 2, '.'))
    };
    is_imported("plotter.txt", file("", row), &Recipe::default());
    let row = |ms, ohm, strain| {
        format!("10:00:{} -> {ms},{},{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'))
    };
    let text = file("", row);
    let known = Recipe {
        columns: [("time", "2"), ("resistance", "3"), ("strain", "4")]
            .map(|(role, column)| (role.parse().unwrap(), column.parse().unwrap()))
            .to_vec(),
        units: [("time", "ms"), ("resistance", "ohm"), ("strain", "percent")]
            .map(|(role, unit)| (role.parse().unwrap(), unit.to_owned()))
            .to_vec(),
        ..Recipe::default()
    };
    is_imported("monitor.txt", text, &known);
}

#[test]
fn a_microsecond_counter_wraps() {
    let start = (1_i64 << 32) - 1_000_000;
    let row = |ms: i64, ohm, strain| {
        let micros = (start + 1000 * ms) % (1 << 32);
        format!("{micros},{},{}", decimal(ohm, 1, '.'), decimal(strain, 2, '.'))
    };
    let text = file("micros,R_ohm,strain_pct\n", row);
    let (_, imported) = proposed(&[("counter.csv", text.into())], &Recipe::default()).unwrap();
    let expected: Vec<f64> = truth().time_ms.iter().map(|ms| (start + 1000 * ms) as f64 / 1e6).collect();
    assert_eq!(imported.trace.time_s, expected);
    assert!(
        imported.remarks.iter().any(|remark| remark.contains("started again 1 time") && !remark.contains("1 times")),
        "{:?}",
        imported.remarks
    );
}

#[test]
fn gzip_and_spaces_and_comments() {
    let row =
        |ms, ohm, strain| format!("  {}  {}   {}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
    let text = file("% a remark\n# gauge_length_mm = 100\n# Time (s) R (Ohm) x (mm)\n", row) + "END OF TEST\n";
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(text.as_bytes()).unwrap();
    let imported = is_imported("spaces.txt.gz", packed.finish().unwrap(), &Recipe::default());
    assert_eq!(imported.trace.metadata.gauge_length_mm, Some(100.0));
}

#[test]
fn what_nothing_decides_is_asked_with_the_answer() {
    let nothing = Recipe::default();
    let row = |ms, ohm, strain| format!("{ms},{},{}", decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
    let unit = file("time,resistance_ohm,strain_pct\n", row);
    asks(&[("a.csv", &unit)], &nothing, &["a.csv", "`time`", "--unit time=ms"]);
    let gauge = file("time_ms,R_ohm,displacement_mm\n", row);
    asks(&[("a.csv", &gauge)], &nothing, &["--gauge-length-mm MM"]);
    let names = file("", row);
    asks(&[("a.csv", &names)], &nothing, &["no header", "--column time=N --column resistance=N"]);
    let two = file("time_ms,R1 (Ohm),R2 (Ohm)\n", row);
    asks(&[("a.csv", &two)], &nothing, &["`R1 (Ohm)` and `R2 (Ohm)`", "--column 'resistance=R1 (Ohm)'"]);
    let thousands =
        file("time_ms;R_ohm;strain_pct\n", |ms, ohm, _| format!("{ms};{},{:03};1", 1 + ohm % 9, ohm % 1000));
    asks(&[("a.csv", &thousands)], &nothing, &["--decimal ,", "--decimal ."]);
    let rate =
        file("R_ohm,strain_pct\n", |_, ohm, strain| format!("{},{}", decimal(ohm, 1, '.'), decimal(strain, 2, '.')));
    asks(&[("a.csv", &rate)], &nothing, &["--rate-hz HZ"]);
    let commas =
        file("time_s,resistance_ohm\n", |ms, ohm, _| format!("{},{}", decimal(ms, 3, ','), decimal(ohm, 1, ',')));
    asks(&[("a.csv", &commas)], &nothing, &["cannot be told apart"]);
    let signs = file("time_ms,R_ohm\n", |ms, ohm, _| format!("{ms},{}", decimal(ohm, 1, '.')));
    let back = signs.clone() + "3,1600\n";
    asks(&[("a.csv", &back)], &nothing, &["a.csv:62", "expected a time after"]);
    // Minutes to nine decimals: what multiplying them with 60 adds is no digit of the file's.
    let minutes = |k: u32| format!("{:.9},{}\n", f64::from(k) * 0.097 / 60.0, 1600 + k % 7);
    let back = format!("time_min,R_ohm\n{}{}", (0..62).map(minutes).collect::<String>(), minutes(11));
    asks(&[("a.csv", &back)], &nothing, &["a.csv:64", "expected a time after 5.917 s, found 1.067 s"]);
}

/// Three cells with commas between them: s, Ω, percent.
fn seconds_ohms_percent(ms: i64, ohm: i64, strain: i64) -> String {
    format!("{},{},{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'))
}

#[test]
fn words_beside_numbers_above_the_names_are_no_data() {
    let names = "Time (s),R (Ohm),Strain (%)\n";
    for above in ["Sample,7,\nDate,2024-05-13,\n", "Channels,2,\nX0,0.0,0.0\n***End***\n\n", "sep=,\n"] {
        is_imported("above.csv", file(&format!("{above}{names}"), seconds_ohms_percent), &Recipe::default());
    }
    // LabVIEW has a name for remarks, and rows without them.
    let above = "Separator\tTab\nX0\t0.0\t0.0\n***End_of_Header***\nX_Value\tR (Ohm)\tStrain (%)\tComment\n";
    let row = |ms, ohm, strain| seconds_ohms_percent(ms, ohm, strain).replace(',', "\t");
    is_imported("rig.lvm", file(above, row), &Recipe::default());
    // R's write.table has a cell for the number of the row, and no name for it.
    let row = |ms, ohm, strain| {
        format!("\"{}\" {}", (ms - 200) / 50, seconds_ohms_percent(ms, ohm, strain).replace(',', " "))
    };
    is_imported("frame.txt", file("\"time_s\" \"R_ohm\" \"strain_percent\"\n", row), &Recipe::default());
    // Neither is a first row that lacks its last cell the header's end.
    let row = |ms, ohm, strain| {
        let row = seconds_ohms_percent(ms, ohm, strain);
        if ms == 250 { row[..row.rfind(',').unwrap()].to_owned() } else { row }
    };
    let (_, imported) = proposed(&[("short.csv", file(names, row).into())], &Recipe::default()).unwrap();
    assert_eq!(imported.trace.readings.values, truth().ohm());
    assert!(imported.trace.reference.unwrap().values[0].is_nan());
    assert!(imported.remarks.iter().any(|remark| remark.contains("1 row with fewer cells")), "{:?}", imported.remarks);
}

#[test]
fn what_stands_behind_the_data_is_passed_over_and_said() {
    let text = file("Time (s),R (Ohm),Strain (%)\n", seconds_ohms_percent);
    for (behind, said) in [
        ("End of data\n", "1 line among or behind the data passed over, which is line 62"),
        (
            "\nMax R,1700\nMean,1650.2,20.1\n",
            "2 lines among or behind the data passed over, of which the first is line 63",
        ),
        // Cut in the middle of a number.
        ("3.3,16", "1 line among or behind the data passed over, which is line 62"),
    ] {
        let imported = is_imported("behind.csv", format!("{text}{behind}"), &Recipe::default());
        assert!(imported.remarks.iter().any(|remark| remark.contains(said)), "{behind}: {:?}", imported.remarks);
    }
}

#[test]
fn a_serial_line_begins_with_garbage() {
    let text = file("millis,R_ohm,strain_percent\n", |ms, ohm, strain| {
        format!("{ms},{},{}", decimal(ohm, 1, '.'), decimal(strain, 2, '.'))
    });
    for garbage in [b"\0\0\xf0x\xe0\r\nready\r\n".as_slice(), b"\xff\x80,16\r\n"] {
        is_imported("serial.log", [garbage, text.as_bytes()].concat(), &Recipe::default());
    }
    let binary: Vec<u8> = (0..2000_u32).map(|k| (k * k % 7) as u8).collect();
    assert!(tables(&[("a.bin", binary)], &Recipe::default()).unwrap_err().to_string().contains("binary data"));
}

#[test]
fn clocks_of_spreadsheets_scanners_and_computers() {
    let rest = |ohm, strain| format!("{},{}", decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
    let since: Vec<f64> = truth().time_ms.iter().map(|ms| (ms - 250) as f64 / 1e3).collect();
    type Clock<'a> = (&'a str, &'a dyn Fn(i64) -> String);
    let forms: [Clock; 2] = [
        ("minutes", &|ms| format!("59:{}", decimal(50_000 + ms, 3, '.'))),
        ("thousandths", &|ms| format!("05/13/2024 10:00:{:02}:{:03}", ms / 1000, ms % 1000)),
    ];
    for (name, clock) in forms {
        let text = file("Time,R_ohm,strain_pct\n", |ms, ohm, strain| format!("{},{}", clock(ms), rest(ohm, strain)));
        let (_, imported) = proposed(&[(name, text.into())], &Recipe::default()).unwrap();
        assert_eq!(imported.trace.time_s, since, "{name}");
    }
    let epoch = |ms| 1_715_594_400_000 + ms;
    let text = file("timestamp,R_ohm,strain_pct\n", |ms, ohm, strain| {
        format!("{},{}", decimal(epoch(ms), 3, '.'), rest(ohm, strain))
    });
    let (_, imported) = proposed(&[("epoch", text.into())], &Recipe::default()).unwrap();
    // Numbers of that size are 2.4e-7 apart.
    assert!(imported.trace.time_s.iter().zip(&since).all(|(found, expected)| (found - expected).abs() < 2.4e-7));
    // A spreadsheet's days are not taken for seconds.
    let text = file("Time,R_ohm,strain_pct\n", |ms, ohm, strain| {
        format!("{:.10},{}", 45_425.0 + ms as f64 / 86_400e3, rest(ohm, strain))
    });
    asks(&[("days", &text)], &Recipe::default(), &["column `Time`", "its unit is not known", "--unit time=days"]);
    let known = Recipe { units: vec![("time".parse().unwrap(), "days".to_owned())], ..Recipe::default() };
    let (_, imported) = proposed(&[("days", text.into())], &known).unwrap();
    let span = imported.trace.time_s.last().unwrap() - imported.trace.time_s[0];
    // Ten decimals of a day are 9 µs.
    assert!((span - since.last().unwrap()).abs() < 9e-6, "{span}");
}

#[test]
fn what_is_no_resistance_and_what_has_no_reference_is_said() {
    let nothing = Recipe::default();
    let volts = file("Time (s),Output (V),Strain (%)\n", seconds_ohms_percent);
    let known = |role: &str| Recipe {
        columns: vec![(role.parse().unwrap(), "Output (V)".parse().unwrap())],
        ..nothing.clone()
    };
    asks(&[("a.csv", &volts)], &known("resistance"), &["a.csv", "volts are not read", "--column adc=NAME"]);
    let united = file("Time,R,Strain\n", |ms, ohm, _| format!("{} s,{ohm} Ohm,1 %", decimal(ms, 3, '.')));
    asks(&[("a.csv", &united)], &nothing, &["cells like `3.2", "take units"]);
    let sentinel = file("Time (s),R (Ohm)\n", |ms, ohm, _| {
        format!("{},{}", decimal(ms, 3, '.'), if ms % 13 == 0 { "-999".to_owned() } else { decimal(ohm, 1, '.') })
    });
    asks(&[("a.csv", &sentinel)], &nothing, &["found -999", "--magnitude resistance", "--missing -999"]);
    let length = file("Time (s),R (Ohm),Length (mm)\n", seconds_ohms_percent);
    let (_, imported) = proposed(&[("a.csv", length.clone().into())], &nothing).unwrap();
    let said = "--column 'displacement=Length (mm)'";
    assert!(imported.remarks.iter().any(|remark| remark.contains(said)), "{:?}", imported.remarks);
    let told = Recipe { columns: vec![("strain".parse().unwrap(), "none".parse().unwrap())], ..nothing };
    assert!(proposed(&[("a.csv", length.into())], &told).unwrap().1.remarks.is_empty());
}

/// The rig's irregular steps, s.
const STEPS: [f64; 5] = [0.08, 0.08, 0.08, 0.125, 0.19];

/// A file of the rig: resistance rises by 10 Ω a second, the position goes up and down with corners every fifty rows.
fn rig(rows: usize, spurious: &[usize]) -> String {
    let mut out = String::new();
    for (row, time) in times(rows).into_iter().enumerate() {
        let sign = if row % 2 == 0 { 1.0 } else { -1.0 };
        let inner = -(1600.0 + 10.0 * time + 12.0 * sign);
        let position = if spurious.contains(&row) { -0.0 } else { -position(row) };
        writeln!(out, "39000,{inner},{time},{position},{},0.5,{}", time + 0.03, time + 0.05).unwrap();
    }
    out
}

fn times(rows: usize) -> Vec<f64> {
    STEPS
        .iter()
        .cycle()
        .take(rows)
        .scan(0.0, |time, step| {
            *time += step;
            Some(*time)
        })
        .collect()
}

/// mm; straight between rows that are multiples of fifty.
fn position(row: usize) -> f64 {
    let times = times(row / 50 * 50 + 51);
    let (from, to) = (row / 50 * 50, row / 50 * 50 + 50);
    let share = (times[row] - times[from]) / (times[to] - times[from]);
    12.0 * if (row / 50).is_multiple_of(2) { share } else { 1.0 - share }
}

#[test]
fn a_rig_without_header_is_folded_and_interpolated() {
    let spurious = [20, 31, 77, 78 + 50, 160];
    let text = rig(200, &spurious);
    let table = tables(&[("rig.csv", text.clone().into())], &Recipe::default()).unwrap();
    assert_eq!(Preset::that_fits(&table[0]), Some(Preset::ElectromechStretcher));
    let imports = Plan::new(&table, &Recipe::default()).unwrap_err().to_string();
    assert!(imports.contains("--preset electromech-stretcher"), "{imports}");
    let (recipe, imported) = proposed(&[("rig.csv", text.into())], &Recipe::default()).unwrap();
    assert_eq!(recipe.arguments(), ["--preset", "electromech-stretcher"]);
    let trace = &imported.trace;
    let (times, strain) = (times(200), &trace.reference.as_ref().unwrap().values);
    assert_eq!(trace.len(), 199);
    let corner = |k: usize| [0, 49].contains(&(k % 50));
    for k in 0..199 {
        let time = 0.5 * (times[k] + times[k + 1]);
        // Sums of numbers up to 2000 and 30, printed to 17 digits: a few units in the last place.
        assert!((trace.time_s[k] - time).abs() < 1e-13);
        assert!((trace.readings.values[k] - (1600.0 + 10.0 * time)).abs() < 2e-12, "row {k}");
        // The position's clock is 0.03 s late: on one straight it reads what the motion says at its own time.
        if k > 0 && !corner(k) {
            let (a, b) = (times[k] + 0.03, times[k + 1] + 0.03);
            let exact = position(k) + (position(k + 1) - position(k)) * (time - a) / (b - a);
            assert!((strain[k] - exact / 40.0).abs() < 1e-13, "row {k}: {} {}", strain[k], exact / 40.0);
        }
    }
    assert!(imported.remarks.iter().any(|remark| remark.contains("5 zeros")), "{:?}", imported.remarks);
}
