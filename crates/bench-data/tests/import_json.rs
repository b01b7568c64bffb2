//! Recordings as JSON.

use ohmstrain_bench_data::import::Recipe;

use crate::import_files::{decimal, file, is_imported, proposed, truth};

fn object(ms: i64, ohm: i64, strain: i64) -> String {
    format!(
        "{{\"time_ms\": {ms}, \"sensor\": {{\"r\": {}}}, \"strain_pct\": {}}}",
        decimal(ohm, 1, '.'),
        decimal(strain, 2, '.')
    )
}

#[test]
fn an_object_for_each_row() {
    is_imported("run.jsonl", file("", object), &Recipe::default());
    let list = file("", |ms, ohm, strain| object(ms, ohm, strain) + ",");
    is_imported("run.json", format!("[{}]", list.trim_end().trim_end_matches(',')), &Recipe::default());
    let pretty = file("", |ms, ohm, strain| object(ms, ohm, strain).replace(", ", ",\n  "));
    is_imported("pretty.json", pretty, &Recipe::default());
    // A board also prints other text.
    let mixed = file("{\"boot\": \n", object);
    is_imported("mixed.jsonl", mixed, &Recipe::default());
}

/// A JSON number of 17 digits is the same number as in a CSV.
#[test]
fn numbers_are_rounded_once() {
    for (text, expected) in
        [("1600.2220009926900355", 1_600.222_000_992_69), ("0.22200099269003554", 0.222_000_992_690_035_54)]
    {
        let object = |ms, _, strain| {
            let (time_s, strain) = (decimal(ms, 3, '.'), decimal(strain, 4, '.'));
            format!("{{\"time_s\": {time_s}, \"resistance_ohm\": {text}, \"strain\": {strain}}}")
        };
        let (_, imported) = proposed(&[("a.jsonl", file("", object).into_bytes())], &Recipe::default()).unwrap();
        assert_eq!(imported.trace.readings.values[0], expected);
    }
}

#[test]
fn a_list_for_each_column() {
    let truth = truth();
    let list = |numbers: Vec<String>| format!("[{}]", numbers.join(", "));
    let times = list(truth.time_ms.iter().map(ToString::to_string).collect());
    let ohms = list(truth.ohm().iter().map(ToString::to_string).collect());
    let percent = list(truth.strain().iter().map(|strain| format!("{:.2}", 100.0 * strain)).collect());
    let columns = format!("{{\"time_ms\": {times}, \"R_ohm\": {ohms}, \"strain_pct\": {percent}}}");
    is_imported("columns.json", columns.clone(), &Recipe::default());
    is_imported("within.json", format!("{{\"rate\": 20, \"data\": {columns}}}"), &Recipe::default());
    let rows = file("", |ms, ohm, strain| format!("[{ms}, {}, {}],", decimal(ohm, 1, '.'), decimal(strain, 2, '.')));
    let rows = rows.trim_end().trim_end_matches(',');
    let split = format!("{{\"columns\": [\"time_ms\", \"R_ohm\", \"strain_pct\"], \"data\": [{rows}]}}");
    is_imported("split.json", split, &Recipe::default());
}

#[test]
fn pairs_with_equal_signs_and_records_over_lines() {
    let row =
        |ms, ohm, strain| format!("millis={ms} R_ohm={} strain_pct={}", decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
    is_imported("pairs.txt", file("", row), &Recipe::default());
    let row = |ms, ohm, strain| {
        let (whole, nanos) = (1_700_000_000 + ms / 1000, ms % 1000 * 1_000_000);
        format!(
            "stamp:\n  sec: {whole}\n  nanosec: {nanos}\nR_ohm: {}\nstrain_pct: {}\n---",
            decimal(ohm, 1, '.'),
            decimal(strain, 2, '.')
        )
    };
    let imported = crate::import_files::proposed(&[("echo.txt", file("", row).into())], &Recipe::default()).unwrap().1;
    assert_eq!(imported.trace.readings.values, truth().ohm());
    assert_eq!(imported.trace.time_s[1], (truth().time_ms[1] - truth().time_ms[0]) as f64 / 1e3);
}
