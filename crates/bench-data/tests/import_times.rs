//! The clocks of lab files: dates and times of day, counters that start again, a spreadsheet's days.

use ohmstrain_bench_data::import::Recipe;

use crate::import_files::{asks, decimal, file, proposed, truth};

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
