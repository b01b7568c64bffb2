//! Headers that do not fit the data, and transposed tables.

use ohmstrain_bench_data::import::Recipe;

use crate::import_files::{asks, decimal, file, is_imported, proposed, seconds_ohms_percent, tables, truth};

fn of_columns(columns: [(&str, &str); 3], units: [(&str, &str); 3]) -> Recipe {
    Recipe {
        columns: columns.map(|(role, column)| (role.parse().unwrap(), column.parse().unwrap())).to_vec(),
        units: units.map(|(role, unit)| (role.parse().unwrap(), unit.to_owned())).to_vec(),
        ..Recipe::default()
    }
}

#[test]
fn names_that_are_numbers_are_names() {
    let row = |ms, ohm, strain| format!("{};{};{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
    let known = of_columns(
        [("time", "time"), ("resistance", "4"), ("strain", "9")],
        [("time", "s"), ("resistance", "ohm"), ("strain", "percent")],
    );
    is_imported("channels.csv", file("time;4;9\n", row), &known);
    // `2` is the name of a column, not an index.
    let known = of_columns(
        [("time", "stretch_id"), ("resistance", "3"), ("strain", "2")],
        [("time", "s"), ("resistance", "ohm"), ("strain", "percent")],
    );
    is_imported("swapped.csv", file("stretch_id;3;2\n", row), &known);
    let named = file("sample;1;2\n", row);
    asks(&[("a.csv", &named)], &Recipe::default(), &["`sample`, `1`, `2`", "--column resistance=NAME"]);
    // pandas numbers columns without names.
    let counted = file("0;1;2\n", row);
    let known = of_columns(
        [("time", "0"), ("resistance", "1"), ("strain", "2")],
        [("time", "s"), ("resistance", "ohm"), ("strain", "percent")],
    );
    is_imported("frame.csv", counted, &known);
}

#[test]
fn fewer_or_more_names_than_columns_are_those_of_the_first() {
    let row = |ms, ohm, strain| format!("{},7,8.5,9", seconds_ohms_percent(ms, ohm, strain));
    let names = "Time (s),R (Ohm),Strain (%)\n";
    let imported = is_imported("fewer.csv", file(names, row), &Recipe::default());
    assert!(imported.remarks.iter().any(|remark| remark.contains("3 names above 6 columns")), "{:?}", imported.remarks);
    let names = "Time (s),R (Ohm),Strain (%),Operator,Temperature (°C)\n";
    let imported = is_imported("more.csv", file(names, seconds_ohms_percent), &Recipe::default());
    assert!(imported.remarks.iter().any(|remark| remark.contains("5 names above 3 columns")), "{:?}", imported.remarks);
    // Prose is not a header.
    let prose = file("Strain gauge of the second batch, glued\n", row);
    asks(&[("a.csv", &prose)], &Recipe::default(), &["no header"]);
}

#[test]
fn blank_and_repeated_names_are_distinguished_by_number() {
    let row = |ms, ohm, strain| {
        let (ms, ohm, strain) = (decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
        format!("{ms},1,{ohm},{ohm},{strain}")
    };
    let text = file("Time (s),,R (Ohm),R (Ohm),Strain (%)\n", row);
    asks(&[("a.csv", &text)], &Recipe::default(), &["--column resistance=3 or --column resistance=4"]);
    let known = Recipe { columns: vec![("resistance".parse().unwrap(), "3".parse().unwrap())], ..Recipe::default() };
    is_imported("twins.csv", text, &known);
}

#[test]
fn an_index_behind_a_name_is_no_unit() {
    let row = |ms, ohm, strain| format!("{},{},{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
    let text = file("time_s,resistance_ohm_2,strain_2\n", row);
    asks(&[("a.csv", &text)], &Recipe::default(), &["`strain_2`", "--unit strain=percent"]);
}

/// Returns columns as lines: labels, followed by all numbers.
fn on_its_side(labels: [&str; 3], separator: &str) -> String {
    let truth = truth();
    let joined = |label: &str, numbers: Vec<String>| format!("{label}{separator}{}\n", numbers.join(separator));
    let milliseconds = truth.time_ms.iter().map(ToString::to_string).collect();
    let ohms = truth.ohm().iter().map(ToString::to_string).collect();
    let percent = truth.strain().iter().map(|strain| format!("{:.2}", 100.0 * strain)).collect();
    joined(labels[0], milliseconds) + &joined(labels[1], ohms) + &joined(labels[2], percent)
}

#[test]
fn a_table_on_its_side_is_read_with_a_remark() {
    for (labels, separator) in [
        (["time_ms", "R (Ohm)", "strain_pct"], ","),
        (["Time\tms", "R\tOhm", "Strain\t%"], "\t"),
        (["Time (ms)", "R (Ohm)", "Strain (%)"], ";"),
    ] {
        let imported = is_imported("side.csv", on_its_side(labels, separator), &Recipe::default());
        let expected = "rows and columns seem to be exchanged";
        assert!(imported.remarks.iter().any(|remark| remark.contains(expected)), "{:?}", imported.remarks);
    }
    let bare = on_its_side(["1", "2", "3"], " ").replace("\n1 ", "\n").replace("\n2 ", "\n").replace("\n3 ", "\n");
    let bare = bare.strip_prefix("1 ").unwrap();
    let table = &tables(&[("side.txt", bare.into())], &Recipe::default()).unwrap()[0];
    assert!(table.layout.is_exchanged && table.columns.len() == 3);
}

#[test]
fn many_columns_make_a_short_question() {
    let names: Vec<String> = (0..68).map(|channel| format!("adc_{channel}")).collect();
    let text = format!("time_ms,{}\n", names.join(","));
    let text = file(&text, |ms, ohm, _| format!("{ms},{}", vec![ohm.to_string(); 68].join(",")));
    let error = proposed(&[("glove.csv", text.into())], &Recipe::default()).unwrap_err().to_string();
    assert!(error.contains("62 more") && error.len() < 500, "{error}");
}

#[test]
fn labview_without_a_column_of_times() {
    let truth = truth();
    let mut text = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\tNo\n\
                    ***End_of_Header***\t\n\t\nChannels\t2\t\t\nDate\t2023/11/02\t2023/11/02\t\nY_Unit_Label\tOhm\t%\t\n\
                    X_Dimension\tTime\tTime\t\nX0\t0,25\t0,25\t\nDelta_X\t0,020\t0,020\t\n***End_of_Header***\t\t\t\n\
                    X_Value\tSensor\tStrain\tComment\n"
        .to_owned();
    for row in 0..truth.time_ms.len() {
        let line = format!("\t{}\t{:.2}\n", truth.ohm()[row], 100.0 * truth.strain()[row]);
        text += &line.replace('.', ",");
    }
    let (_, imported) = proposed(&[("run.lvm", text.into())], &Recipe::default()).unwrap();
    assert_eq!(imported.trace.readings.values, truth.ohm());
    assert_eq!(imported.trace.time_s[..4], [0.25, 0.27, 0.29, 0.31]);
}

#[test]
fn a_rate_above_the_data_is_proposed() {
    let row = |_, ohm, strain| format!("{},{}", decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
    let text = file("Sampling rate: 40 Hz\nR (Ohm),Strain (%)\n", row);
    asks(&[("a.csv", &text)], &Recipe::default(), &["--rate-hz 40", "line 1"]);
}
