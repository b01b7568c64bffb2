//! Clocks of lab files: dates and times of day, counters that restart, a spreadsheet's days.

use ohmstrain_bench_data::import::{Plan, Recipe};

use crate::import_files::{asks, decimal, file, proposed, tables, truth};

#[test]
fn time_stamps() {
    let clock =
        |ms: i64| format!("{:02}:{:02}:{:02}.{:03}", ms / 3_600_000 % 24, ms / 60_000 % 60, ms / 1000 % 60, ms % 1000);
    let rest = |ohm, strain| format!("{},{}", decimal(ohm, 1, '.'), decimal(strain, 2, '.'));
    let names = "Timestamp,R_ohm,strain_pct\n";
    // Just before midnight, so that the date changes.
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
    // Doubles of that size are 2.4e-7 apart, but digits are exact.
    assert_eq!(imported.trace.time_s, since);
    // A spreadsheet's days are not interpreted as seconds.
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

/// Returns times since the first, s.
fn since_first() -> Vec<f64> {
    truth().time_ms.iter().map(|ms| (ms - truth().time_ms[0]) as f64 / 1e3).collect()
}

/// Checks the import, as proposed, of a file whose rows begin with a moment.
#[track_caller]
fn has_times(name: &str, names: &str, moment: impl Fn(i64) -> String) {
    let text =
        file(names, |ms, ohm, strain| format!("{},{},{}", moment(ms), decimal(ohm, 1, '.'), decimal(strain, 2, '.')));
    let (_, imported) = proposed(&[(name, text.into())], &Recipe::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(imported.trace.time_s, since_first(), "{name}");
    assert_eq!(imported.trace.readings.values, truth().ohm(), "{name}");
}

#[test]
fn moments_without_a_blank_between_date_and_time() {
    let clock = |ms: i64| format!("09:59:{}", decimal(50_000 + ms, 3, '.'));
    for before in ["2023/11/30/", "2023-11-30-", "2023-11-30_", "30.11.2023_"] {
        has_times(before, "Timestamp,R_ohm,strain_pct\n", |ms| format!("{before}{}", clock(ms)));
    }
    has_times("file name", "Timestamp,R_ohm,strain_pct\n", |ms| {
        format!("20231130_0959{}", decimal(50_000 + ms, 3, '.'))
    });
}

#[test]
fn a_clock_in_several_columns_is_joined() {
    let day = |ms: i64| format!("2023-11-30,09:59:{:02}", 50 + ms / 1000);
    let names = "Date,Time,Fraction,R_ohm,strain_pct\n";
    has_times("fraction", names, |ms| format!("{},0.{:03}", day(ms), ms % 1000));
    let names = "Date,Time,Millisecond,R_ohm,strain_pct\n";
    has_times("milliseconds", names, |ms| format!("{},{}", day(ms), ms % 1000));
    for (names, digits) in [("secs,nsecs", 9), ("header.stamp.secs,header.stamp.nsecs", 9), ("tv_sec,tv_usec", 6)] {
        let fraction = |ms: i64| (ms % 1000) * 10_i64.pow(digits - 3);
        let names = format!("{names},R_ohm,strain_pct\n");
        has_times(&names, &names, |ms| format!("{},{}", 1_698_000_000 + ms / 1000, fraction(ms)));
    }
}

#[test]
fn a_clock_that_tells_rows_apart_is_taken_before_one_that_does_not() {
    let row = |ms: i64| format!("09:59:{:02},{}", 50 + ms / 1000, decimal(ms - 250, 3, '.'));
    let names = "Time,Elapsed time (s),R_ohm,strain_pct\n";
    has_times("coarse", names, row);
    let text =
        file(names, |ms, ohm, strain| format!("{},{},{}", row(ms), decimal(ohm, 1, '.'), decimal(strain, 2, '.')));
    let tables = tables(&[("coarse.csv", text.into())], &Recipe::default()).unwrap();
    let remarks = Plan::propose(&tables, &Recipe::default()).unwrap().remarks;
    assert!(remarks.iter().any(|remark| remark.contains("`Time` is no clock")), "{remarks:?}");
    let text = file("Time,Relative,R_ohm,strain_pct\n", |ms, ohm, strain| {
        format!("{},{},{}", row(ms), decimal(ohm, 1, '.'), decimal(strain, 2, '.'))
    });
    asks(&[("a.csv", &text)], &Recipe::default(), &["too coarse", "--column time=Relative"]);
}

#[test]
fn times_since_1970_are_known_by_their_size() {
    for (name, unit) in [("s", 1e-3), ("ms", 1.0), ("us", 1e3), ("ns", 1e6)] {
        let count = |ms: i64| {
            let ms = 1_698_000_000_000 + ms;
            if unit < 1.0 { decimal(ms, 3, '.') } else { (ms * unit as i64).to_string() }
        };
        has_times(name, "timestamp,R_ohm,strain_pct\n", count);
        // Without a header it is the only identifiable column.
        let text = file("", |ms, ohm, _| format!("{},{}", count(ms), decimal(ohm, 1, '.')));
        asks(&[(name, &text)], &Recipe::default(), &["(1 is the time); say --column resistance=N"]);
    }
}

#[test]
fn the_clock_of_a_serial_monitor_is_the_time() {
    let row = |ms, ohm, _| format!("09:59:{} -> {}", decimal(50_000 + ms, 3, '.'), decimal(ohm, 1, '.'));
    let text = file("", row);
    asks(&[("monitor.txt", &text)], &Recipe::default(), &["`monitor clock` is the time", "say --column resistance=N"]);
    let known = Recipe { columns: vec![("resistance".parse().unwrap(), "2".parse().unwrap())], ..Recipe::default() };
    let (_, imported) = proposed(&[("monitor.txt", text.clone().into())], &known).unwrap();
    assert_eq!(imported.trace.time_s, since_first());
    // The board may print the names of its columns.
    let named = format!("09:59:49.900 -> R_ohm\n{text}");
    assert_eq!(proposed(&[("monitor.txt", named.into())], &Recipe::default()).unwrap().1.trace.time_s, since_first());
}
