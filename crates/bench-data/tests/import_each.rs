//! Several channels of one file in one recording, paired by their names, by flags, or by a question.

use ohmstrain_bench_data::import::{ColumnName, EachPlan, EachTrace, ImportError, Recipe, Role, Table, read_table};

fn tables(text: &str) -> Vec<Table> {
    vec![read_table(text.as_bytes().to_vec(), "glove.csv", &Recipe::default().read_options(0)).unwrap()]
}

fn name(text: &str) -> ColumnName {
    text.parse().unwrap()
}

/// Returns three rows under a header: times in steps of 50 ms, readings from 1000 on, references from 0 on, different
/// in each column.
fn rows(header: &str) -> String {
    let columns = header.split(',').count();
    let cell = |row: usize, column: usize| match column {
        0 => (50 * row).to_string(),
        // Readings are the first columns.
        1 | 2 if columns > 3 => (1000 * column + row).to_string(),
        1 => (1000 + row).to_string(),
        column => (10 * column * row).to_string(),
    };
    let line = |row: usize| (0..columns).map(|column| cell(row, column)).collect::<Vec<_>>().join(",") + "\n";
    format!("{header}\n") + &(0..3).map(line).collect::<String>()
}

fn imported(text: &str, recipe: &Recipe, pairs: &[(ColumnName, ColumnName)]) -> Result<EachTrace, ImportError> {
    let tables = tables(text);
    EachPlan::new(&tables, recipe, pairs)?.import(&tables)
}

#[track_caller]
fn columns(header: &str, recipe: &Recipe, expected: &str) -> EachTrace {
    let trace = imported(&rows(header), recipe, &[]).unwrap();
    assert_eq!(trace.columns.join(","), expected);
    trace
}

#[test]
fn the_temperature_is_that_of_all_channels() {
    let header = "time_s,thumb_ohm,index_ohm,thumb_deg,index_deg,temperature_c";
    let trace =
        columns(header, &Recipe::default(), "time_s,thumb_ohm,index_ohm,thumb_angle_deg,index_angle_deg,temperature_c");
    assert_eq!(trace.values.last().unwrap(), &[0.0, 50.0, 100.0]);
}

#[test]
fn references_share_the_stem_of_their_channel() {
    let none = Recipe::default();
    let joints = "time_s,thumb_ohm,index_ohm,thumb_angle_deg,index_angle_deg";
    for header in [
        "Time (ms),Thumb (Ohm),Index (Ohm),Thumb angle (deg),Index angle (deg)",
        "Time (ms),Index (Ohm),Thumb (Ohm),Thumb angle (deg),Index angle (deg)",
        "t_ms,thumb_ohm,index_ohm,thumb_deg,index_deg",
    ] {
        let trace = imported(&rows(header), &none, &[]).unwrap();
        let mut found = trace.columns.clone();
        let mut wanted: Vec<&str> = joints.split(',').collect();
        found.sort_unstable();
        wanted.sort_unstable();
        assert_eq!(found, wanted, "{header}");
        let values = |column: &str| &trace.values[trace.columns.iter().position(|name| name == column).unwrap()];
        assert_eq!(values("time_s"), &[0.0, 0.05, 0.1]);
        let thumb = if header.starts_with("Time (ms),Index") { 2000.0 } else { 1000.0 };
        assert_eq!(values("thumb_ohm"), &[thumb, thumb + 1.0, thumb + 2.0], "{header}");
        assert_eq!(values("thumb_angle_deg"), &[0.0, 30.0, 60.0], "{header}");
    }
    // Numbers also pair; a channel keeps the letter before its number.
    let degrees = Recipe { units: vec![(Role::Angle, "deg".into())], ..none };
    columns(
        "time_ms,R1,R2,theta1,theta2",
        &Recipe { columns: of(&["R1", "R2"]), ..degrees },
        "time_s,r1_ohm,r2_ohm,r1_angle_deg,r2_angle_deg",
    );
}

fn of(readings: &[&str]) -> Vec<(Role, ColumnName)> {
    readings.iter().map(|reading| (Role::Resistance, name(reading))).collect()
}

#[test]
fn one_reference_is_of_all_channels() {
    let trace = columns("time_ms,a_ohm,b_ohm,strain_%", &Recipe::default(), "time_s,a_ohm,b_ohm,strain");
    assert_eq!(trace.values[3], [0.0, 0.3, 0.6]);
}

#[test]
fn what_nothing_tells_is_asked_and_answered_by_pairs() {
    let text = rows("time_ms,a_ohm,b_ohm,left (deg),right (deg)");
    let Err(ImportError::Question { what, answers, .. }) = imported(&text, &Recipe::default(), &[]) else { panic!() };
    assert_eq!(what, "nothing tells the reference of `a_ohm`");
    assert_eq!(answers, ["--pair 'a_ohm=left (deg)'", "--pair 'a_ohm=right (deg)'", "--column angle=none"]);
    let pairs = [(name("a_ohm"), name("right (deg)")), (name("b_ohm"), name("left (deg)"))];
    let trace = imported(&text, &Recipe::default(), &pairs).unwrap();
    assert_eq!(trace.columns.join(","), "time_s,a_ohm,b_ohm,a_angle_deg,b_angle_deg");
    assert_eq!((&trace.values[3], &trace.values[4]), (&vec![0.0, 40.0, 80.0], &vec![0.0, 30.0, 60.0]));
    let without = Recipe { columns: vec![(Role::Angle, name("none"))], ..Recipe::default() };
    assert_eq!(imported(&text, &without, &[]).unwrap().columns.join(","), "time_s,a_ohm,b_ohm");
    let wrong = imported(&text, &Recipe::default(), &[(name("a_ohm"), name("time_ms"))]);
    assert!(wrong.unwrap_err().to_string().contains("--pair: `time_ms` is no column of a reference"));
    let single = imported(&rows("time_ms,a_ohm,strain"), &Recipe::default(), &[]).unwrap_err().to_string();
    assert!(single.contains("expected two or more columns of readings for --each, found 1"), "{single}");
}

#[test]
fn codes_are_written_as_codes() {
    let front_end = "divider reference_ohm=10000 side=low bits=12".parse().ok();
    let trace = columns(
        "time_ms,index_adc,thumb_adc,index_deg,thumb_deg",
        &Recipe { front_end, ..Recipe::default() },
        "time_s,index_adc,thumb_adc,index_angle_deg,thumb_angle_deg",
    );
    assert_eq!(trace.values[1], [1000.0, 1001.0, 1002.0]);
    let mut text = Vec::new();
    trace.write(&mut text).unwrap();
    assert!(String::from_utf8(text).unwrap().contains("# front_end = divider reference_ohm=10000"));
}
