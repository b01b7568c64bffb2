//! Forms in which labs export recordings. An import of each is proposed without a question (or with the one that the
//! file leaves open), the import accepts the proposal, and the trace has the numbers of the file.

use std::io::Write as _;

use ohmstrain_bench_data::import::Recipe;

use crate::import_files::{asks, decimal, file, is_imported, proposed, seconds_ohms_percent, tables, truth};

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
    // Names may be in the upper line; where it has none, the lower line applies.
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
fn twins_are_distinguished_by_the_line_above_them_or_by_number() {
    let row = |ms, ohm, strain| {
        let (ms, ohm, strain) = (decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
        format!("{ms},{ohm},{ms},{strain}")
    };
    let above = "DMM,,Stage,\nTime,Resistance,Time,Strain\ns,Ohm,s,%\n";
    is_imported("twins.csv", file(above, row), &Recipe::default());
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
    // Minutes to nine decimals: multiplication by 60 adds digits that the file does not have.
    let minutes = |k: u32| format!("{:.9},{}\n", f64::from(k) * 0.097 / 60.0, 1600 + k % 7);
    let back = format!("time_min,R_ohm\n{}{}", (0..62).map(minutes).collect::<String>(), minutes(11));
    asks(&[("a.csv", &back)], &nothing, &["a.csv:64", "expected a time after 5.917 s, found 1.067 s"]);
}

#[test]
fn words_beside_numbers_above_the_names_are_no_data() {
    let names = "Time (s),R (Ohm),Strain (%)\n";
    for above in ["Sample,7,\nDate,2024-05-13,\n", "Channels,2,\nX0,0.0,0.0\n***End***\n\n", "sep=,\n"] {
        is_imported("above.csv", file(&format!("{above}{names}"), seconds_ohms_percent), &Recipe::default());
    }
    // LabVIEW has a name for a column of remarks, and rows without them.
    let above = "Separator\tTab\nX0\t0.0\t0.0\n***End_of_Header***\nX_Value\tR (Ohm)\tStrain (%)\tComment\n";
    let row = |ms, ohm, strain| seconds_ohms_percent(ms, ohm, strain).replace(',', "\t");
    is_imported("rig.lvm", file(above, row), &Recipe::default());
    // R's write.table has a cell for the row number, without a name.
    let row = |ms, ohm, strain| {
        format!("\"{}\" {}", (ms - 200) / 50, seconds_ohms_percent(ms, ohm, strain).replace(',', " "))
    };
    is_imported("frame.txt", file("\"time_s\" \"R_ohm\" \"strain_percent\"\n", row), &Recipe::default());
    // A first row that lacks its last cell is not part of the header either.
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
fn lines_behind_the_data_are_skipped_with_a_remark() {
    let text = file("Time (s),R (Ohm),Strain (%)\n", seconds_ohms_percent);
    for (behind, expected) in [
        ("End of data\n", "1 line among or behind the data passed over, which is line 62"),
        (
            "\nMax R,1700\nMean,1650.2,20.1\n",
            "2 lines among or behind the data passed over, of which the first is line 63",
        ),
        // Truncated in the middle of a number.
        ("3.3,16", "1 line among or behind the data passed over, which is line 62"),
    ] {
        let imported = is_imported("behind.csv", format!("{text}{behind}"), &Recipe::default());
        assert!(imported.remarks.iter().any(|remark| remark.contains(expected)), "{behind}: {:?}", imported.remarks);
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
fn a_missing_resistance_or_reference_is_reported() {
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
    let expected = "--column 'displacement=Length (mm)'";
    assert!(imported.remarks.iter().any(|remark| remark.contains(expected)), "{:?}", imported.remarks);
    let answered = Recipe { columns: vec![("strain".parse().unwrap(), "none".parse().unwrap())], ..nothing };
    assert!(proposed(&[("a.csv", length.into())], &answered).unwrap().1.remarks.is_empty());
}
