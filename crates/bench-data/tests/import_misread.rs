//! Forms of files that are easily read as something else, without a word.

use std::fmt::Write;

use ohmstrain_bench_data::import::Recipe;

use crate::import_files::{asks, decimal, file, is_imported, proposed, seconds_ohms_percent, truth};

/// Returns three cells of s, kΩ and percent, in this order.
fn seconds_kohms_percent(ms: i64, ohm: i64, strain: i64) -> String {
    format!("{},{},{}", decimal(ms, 3, '.'), decimal(ohm, 4, '.'), decimal(strain, 2, '.'))
}

#[test]
fn a_quantity_beside_times_of_day_is_no_fraction_of_a_second() {
    let truth = truth();
    for (heading, unit) in [("Strain (frac)", 1.0), ("Strain (microstrain)", 1e6)] {
        let mut text = format!("Time,R (Ohm),{heading}\n");
        for (k, (ohm, strain)) in truth.ohm().iter().zip(truth.strain()).enumerate() {
            writeln!(text, "10:00:{k:02},{ohm},{}", strain * unit).unwrap();
        }
        let (_, imported) = proposed(&[("clock.csv", text.into_bytes())], &Recipe::default()).unwrap();
        assert_eq!(imported.trace.time_s, (0..60).map(f64::from).collect::<Vec<_>>(), "{heading}");
    }
}

#[test]
fn a_row_with_more_cells_than_columns_is_refused() {
    // A mark of thousands that also separates.
    let mut text = file("time_s,resistance_ohm,strain_percent\n", seconds_ohms_percent);
    text.push_str("3.5,1,010.5,20.0\n");
    asks(&[("a.csv", &text)], &Recipe::default(), &["a.csv:62", "3 cells", "found 4", "`20.0`"]);
}

#[test]
fn an_overload_is_a_missing_value_in_any_unit() {
    let row = |ms: i64, ohm, strain| {
        let cells = seconds_ohms_percent(ms, ohm, strain);
        if ms == 301 { "0.301,9.9E37,9.9E37".to_owned() } else { cells }
    };
    let text = file("time_s,R (mOhm),strain_percent\n", row);
    let (_, imported) = proposed(&[("a.csv", text.into_bytes())], &Recipe::default()).unwrap();
    let trace = &imported.trace;
    let row = trace.time_s.iter().position(|time| *time == 0.301).unwrap();
    assert!(trace.readings.values[row].is_nan() && trace.reference.as_ref().unwrap().values[row].is_nan());
}

#[test]
fn a_unit_within_a_heading_counts() {
    for heading in ["resistance_kohm_1", "resistance.kohm", "Resistance..kOhm.", "Resistance_kOhm_", "kohm"] {
        let text = file(&format!("time_s,{heading},strain %\n"), seconds_kohms_percent);
        is_imported("units.csv", text, &Recipe::default());
    }
    let text = file("s,kOhm,%\ntime,resistance,strain\n", seconds_kohms_percent);
    is_imported("above.csv", text, &Recipe::default());
}

#[test]
fn a_percent_sign_before_a_header_may_be_a_comment() {
    let row = |ms, ohm, strain| format!("{},{},{}", decimal(strain, 2, '.'), decimal(ohm, 1, '.'), decimal(ms, 3, '.'));
    let text = file("% Strain,R (Ohm),Time (s)\n", row);
    asks(&[("a.csv", &text)], &Recipe::default(), &["`%` may be a unit", "--unit strain=percent"]);
    let text = file("% Time (s),R (Ohm),Strain (%)\n", seconds_ohms_percent);
    is_imported("matlab.csv", text, &Recipe::default());
}

#[test]
fn dates_beside_times_of_day_count() {
    let mut text = "Date,Time,R (Ohm)\n".to_owned();
    for (day, second) in [(13, 0), (13, 1), (13, 2), (14, 0), (14, 1), (15, 9)] {
        writeln!(text, "2024-05-{day},10:00:0{second},1{day}{second}.5").unwrap();
    }
    let (_, imported) = proposed(&[("days.csv", text.into_bytes())], &Recipe::default()).unwrap();
    assert_eq!(imported.trace.time_s, [0.0, 1.0, 2.0, 86_400.0, 86_401.0, 172_809.0]);
}

#[test]
fn elapsed_times_pass_a_day_and_an_hour() {
    let elapsed = [
        ("h", [("23:59:59", 0.0), ("24:00:00", 1.0), ("25:00:01", 3602.0)]),
        ("m", [("59:59.5", 0.0), ("60:00.0", 0.5), ("121:00.5", 3661.0)]),
        ("pandas", [("0 days 23:59:59.5", 0.0), ("1 days 00:00:00", 0.5), ("1 days 00:00:00.5", 1.0)]),
    ];
    for (name, rows) in elapsed {
        let lines = rows.iter().zip(1..).map(|((time, _), k)| format!("{time},160{k}.5\n"));
        let text = "Elapsed time,R (Ohm)\n".to_owned() + &lines.collect::<String>();
        let (_, imported) = proposed(&[(name, text.into_bytes())], &Recipe::default()).unwrap();
        assert_eq!(imported.trace.time_s, rows.map(|(_, seconds)| seconds), "{name}");
    }
    let mixed = "Time,R (Ohm)\n10:00:01,1600\n2024-05-13 10:00:02,1601\n10:00:03,1602\n";
    asks(&[("a.csv", mixed)], &Recipe::default(), &["a.csv:3", "a time of day as in the rows above"]);
}

#[test]
fn a_restart_of_a_board_is_no_wrap() {
    let row = |k: i64| format!("{},160{k}.5\n", 2_400_000_000_i64 + 50_000 * k);
    let text = "time_us,resistance_ohm\n".to_owned() + &(0..5).map(row).collect::<String>() + "5,1600\n50005,1601\n";
    asks(&[("a.csv", &text)], &Recipe::default(), &["a.csv:7", "--split-recordings"]);
}

#[test]
fn a_later_header_of_other_columns_is_refused() {
    let text = file("time_s,resistance_kohm,strain_percent\n", seconds_kohms_percent);
    let (head, rest) = text.split_at(text.len() / 2);
    let (line, rest) = rest.split_once('\n').unwrap();
    let other = format!("{head}{line}\ntime_s,resistance_ohm,strain_percent\n{rest}");
    asks(&[("a.csv", &other)], &Recipe::default(), &["as above", "resistance_ohm"]);
    let same = format!("{head}{line}\ntime_s,resistance_kohm,strain_percent\n{rest}");
    is_imported("again.csv", same, &Recipe::default());
}

#[test]
fn a_meter_that_changes_its_range_has_a_unit_in_each_row() {
    let row = |ms, ohm, strain| match ms % 2 {
        0 => format!("{},{},Ohm,{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.')),
        _ => format!("{},{},kOhm,{}", decimal(ms, 3, '.'), decimal(ohm, 4, '.'), decimal(strain, 2, '.')),
    };
    for name in ["Unit", "Resistance Unit"] {
        let text = file(&format!("time_s,Resistance,{name},strain_percent\n"), row);
        is_imported("ranges.csv", text, &Recipe::default());
    }
}

#[test]
fn rows_of_r_have_a_name_each() {
    let row = |ms, ohm, strain| format!("\"{}\",{}", 101 + (ms - 250) / 50, seconds_ohms_percent(ms, ohm, strain));
    is_imported("r.csv", file("\"time_s\",\"resistance_ohm\",\"strain_percent\"\n", row), &Recipe::default());
}

#[test]
fn a_change_of_resistance_is_no_resistance() {
    for heading in ["delta R (Ohm)", "resistance_change_ohm", "dR (Ohm)"] {
        let text = file(&format!("time_s,{heading},strain_percent\n"), seconds_ohms_percent);
        asks(&[("a.csv", &text)], &Recipe::default(), &["change of resistance"]);
    }
}

#[test]
fn a_constant_resistance_is_a_setting() {
    let row = |ms, ohm, strain| format!("{},10000,{},{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), strain);
    let text = file("time_s,r_ref_ohm,v_out_V,strain_percent\n", row);
    asks(&[("a.csv", &text)], &Recipe::default(), &["which column holds the readings"]);
}

#[test]
fn a_rate_is_no_strain() {
    let row = |ms, ohm, strain| format!("{},0.1", seconds_ohms_percent(ms, ohm, strain));
    is_imported("rate.csv", file("time_s,resistance_ohm,strain_percent,strain_rate\n", row), &Recipe::default());
}

#[test]
fn readings_beyond_the_range_at_the_end_are_rows() {
    let text = file("time_s,resistance_ohm,strain_percent\n", seconds_ohms_percent) + "3.5,OPEN LOOP,3.0\n";
    asks(&[("a.csv", &text)], &Recipe::default(), &["a.csv:62", "--missing 'OPEN LOOP'"]);
    let text = file("time_s,resistance_ohm,strain_percent\n", seconds_ohms_percent) + "Maximum,1700.0,25.0\n";
    is_imported("sums.csv", text, &Recipe::default());
}

#[test]
fn a_reference_of_another_time_is_refused() {
    let readings = "time_s,resistance_ohm\n0,1600\n1,1601\n2,1602\n";
    let reference = "time_s,strain_percent\n100,0\n101,1\n102,2\n";
    let known = Recipe { align: Some("none".parse().unwrap()), ..Recipe::default() };
    asks(&[("r.csv", readings), ("e.csv", reference)], &known, &["no value at the time of any reading", "--align"]);
}

#[test]
fn names_may_have_another_separator_or_line_ends() {
    let text = file("Time (s);Resistance (kOhm);Strain (%)\n", seconds_kohms_percent);
    is_imported("other.txt", text, &Recipe::default());
    let text = file("\"Time\n(s)\",\"Resistance\n(kOhm)\",\"Strain\n(%)\"\n", seconds_kohms_percent);
    is_imported("ends.csv", text, &Recipe::default());
    let logger = "\"TOA5\",\"CR1000\",\"CR1000\",\"1\"\n\"TIMESTAMP\",\"RECORD\",\"Resistance\",\"Strain\"\n\"TS\",\"RN\",\"kOhm\",\"%\"\n\
                  \"\",\"\",\"Smp\",\"Avg\"\n";
    let row = |ms: i64, ohm, strain| {
        let (ohm, strain) = (decimal(ohm, 4, '.'), decimal(strain, 2, '.'));
        format!("\"2024-05-13 10:00:{:02}.{:03}\",{ms},{ohm},{strain}", ms / 1000, ms % 1000)
    };
    let (_, imported) = proposed(&[("a.dat", file(logger, row).into_bytes())], &Recipe::default()).unwrap();
    assert_eq!(imported.trace.readings.values, truth().ohm());
}

#[test]
fn rows_out_of_order_are_not_another_recording() {
    let mut lines: Vec<String> =
        file("time_s,resistance_ohm,strain_percent\n", seconds_ohms_percent).lines().map(str::to_owned).collect();
    lines.swap(40, 41);
    asks(&[("a.csv", &(lines.join("\n") + "\n"))], &Recipe::default(), &["a.csv:42", "out of order"]);
}

#[test]
fn json_loses_no_recording_and_no_column() {
    let list = |from: u32| {
        let rows = (0..4).map(|k| format!("{{\"time_s\":{k},\"resistance_ohm\":{}}}", 1600 + from + k));
        rows.collect::<Vec<_>>().join(",")
    };
    let text = format!("{{\"trial1\":[{}],\"trial2\":[{}],\"list\":[1,2]}}", list(0), list(10));
    asks(&[("a.json", &text)], &Recipe::default(), &["--split-recordings"]);
    let text = "{\"time_s\":[0,1,2,3,4,5,6,7,8,9],\"resistance_ohm\":[1,2,3,4,NaN,6,7,8,9],\"note\":[1]}";
    let (_, imported) = proposed(&[("b.json", text.as_bytes().to_vec())], &Recipe::default()).unwrap();
    assert!(imported.trace.readings.values[4].is_nan() && imported.trace.readings.values[9].is_nan());
}

/// Header of a LabVIEW file of two channels, in kΩ and percent, with these columns of times and steps.
fn labview(x_columns: &str, steps: [&str; 2], names: &str) -> String {
    format!(
        "LabVIEW Measurement\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\t{x_columns}\n***End_of_Header***\n\
         Channels\t2\nY_Unit_Label\tkOhm\t%\nX0\t0.25\t0.25\nDelta_X\t{}\t{}\n***End_of_Header***\n{names}\n",
        steps[0], steps[1]
    )
}

#[test]
fn labview_files_have_the_units_of_their_header_and_one_step() {
    let names = "X_Value\tResistance\tStrain";
    let row = |ms, ohm, strain| seconds_kohms_percent(ms, ohm, strain).replace(',', "\t");
    // With times in the file the steps do not matter.
    is_imported("one.lvm", file(&labview("One", ["0.05", "0.1"], names), row), &Recipe::default());
    let without = |ms, ohm, strain| row(ms, ohm, strain).split_once('\t').map(|(_, rest)| format!("\t{rest}")).unwrap();
    let text = file(&labview("No", ["0.05", "0.1"], names), without);
    asks(&[("no.lvm", &text)], &Recipe::default(), &["no.lvm:9", "one step between rows, 0.05", "`0.1`"]);
    // Another segment, in other units.
    let text = file(&labview("No", ["0.05", "0.05"], names), without);
    let segment = text.split_once("Channels").unwrap().1.replace("kOhm", "Ohm");
    asks(&[("two.lvm", &format!("{text}Channels{segment}"))], &Recipe::default(), &["as above", "Resistance (Ohm)"]);
}

#[test]
fn a_group_of_thousands_does_not_begin_with_a_zero() {
    let mut text = file("Time (s);R (kOhm);Strain (%)\n", |ms, ohm, strain| {
        let time = decimal(ms, 3, '.');
        format!("{time};{};{}", decimal(ohm - 15_500, 3, ','), decimal(strain, 2, '.'))
    });
    text.push_str("3.5;0,950;0.5\n");
    asks(&[("a.csv", &text)], &Recipe::default(), &["a.csv", "`0,"]);
}

#[test]
fn a_unit_may_have_a_mark_in_it() {
    for heading in ["Strain / mm/mm", "Strain_mm/mm", "Strain, mm/mm", "Strain mm/mm", "Strain (mm/mm)"] {
        let row =
            |ms, ohm, strain| format!("{},{},{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 4, '.'));
        let text =
            file(&format!("Time (s);R (Ohm);{heading}\n"), |ms, ohm, strain| row(ms, ohm, strain).replace(',', ";"));
        is_imported("a.csv", text, &Recipe::default());
    }
}

#[test]
fn the_letter_of_a_unit_may_stand_after_a_blank() {
    let truth = truth();
    let mut text = String::from("Time h,R Ohm,Strain %,Temperature K\n");
    for (k, (ohm, strain)) in truth.ohm().iter().zip(truth.strain()).enumerate() {
        writeln!(text, "{},{ohm},{},300.15", k as f64 / 4096.0, 100.0 * strain).unwrap();
    }
    let (_, imported) = proposed(&[("a.csv", text.into_bytes())], &Recipe::default()).unwrap();
    let expected: Vec<f64> = (0..60).map(|k| f64::from(k) * 3600.0 / 4096.0).collect();
    assert_eq!(imported.trace.time_s, expected);
    assert!(imported.trace.temperature_c.unwrap().iter().all(|celsius| (celsius - 27.0).abs() < 1e-12));
}

#[test]
fn a_row_without_a_value_below_the_header_is_no_header() {
    for row in [",,", "NaN,NaN,NaN", "-,-,-\n,,"] {
        let text = file(&format!("Time (s),R (Ohm),Strain (%)\n{row}\n"), seconds_ohms_percent);
        is_imported("a.csv", text, &Recipe::default());
    }
}

#[test]
fn any_heading_may_have_a_line_end() {
    let row = |ms, ohm, strain| seconds_ohms_percent(ms, ohm, strain) + ",";
    let text = file("Time (s),R (Ohm),Strain (%),\"note\nof the day\"\n", row);
    is_imported("a.csv", text, &Recipe::default());
}

#[test]
fn the_deviation_of_a_reference_stays_with_it() {
    let row =
        |ms, ohm, strain| format!("{},{},{},0.5", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
    let text = file("# strain_unit = percent\ntime_s,resistance_ohm,strain,strain_sd\n", row);
    let imported = is_imported("a.csv", text, &Recipe::default());
    assert_eq!(imported.trace.reference.unwrap().sd, vec![0.005; 60]);
}
