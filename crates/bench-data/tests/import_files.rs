//! Files as labs write them, and their import: proposed, performed as proposed, and compared to the last bit.

use std::fmt::Write as _;

use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::import::{ImportError, Imported, Plan, Recipe, Table, read_table};

/// Numbers with few decimals, so that every unit writes them exactly.
pub struct Truth {
    pub time_ms: Vec<i64>,
    /// Tenths of an ohm.
    decaohm: Vec<i64>,
    /// Hundredths of a percent, equal to hundredths of a millimetre on 100 mm.
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
    pub fn time_s(&self) -> Vec<f64> {
        self.time_ms.iter().map(|ms| *ms as f64 / 1e3).collect()
    }

    pub fn ohm(&self) -> Vec<f64> {
        self.decaohm.iter().map(|tenths| *tenths as f64 / 10.0).collect()
    }

    pub fn strain(&self) -> Vec<f64> {
        self.strain.iter().map(|hundredths| *hundredths as f64 / 1e4).collect()
    }
}

/// Writes a whole number of 10^-`digits` as text: `1600.1`.
pub fn decimal(value: i64, digits: usize, mark: char) -> String {
    let text = format!("{:0>width$}", value, width = digits + 1);
    let (whole, fraction) = text.split_at(text.len() - digits);
    if digits == 0 { text } else { format!("{whole}{mark}{fraction}") }
}

/// Returns a file with these lines above the rows; a row is made from time in ms, tenths of an ohm, hundredths of a percent.
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

/// Imports files as the plan proposes.
pub fn proposed(files: &[(&str, Vec<u8>)], known: &Recipe) -> Result<(Recipe, Imported), ImportError> {
    let first = tables(files, known)?;
    let recipe = Plan::propose(&first, known)?.recipe(&first);
    let second = tables(files, &recipe)?;
    let plan = Plan::new(&second, &recipe)?;
    assert_eq!(plan.recipe(&second), recipe, "a recipe leads to itself");
    let imported = plan.import(&second)?;
    let mut written = Vec::new();
    imported.trace.write(&mut written).unwrap();
    let read = Trace::read(written.as_slice(), "again").unwrap();
    assert_eq!(format!("{read:?}"), format!("{:?}", imported.trace), "the trace survives being written");
    Ok((recipe, imported))
}

/// Checks that the file is imported as proposed, to the last bit of its numbers.
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
        // A displacement is rounded when it is read and when it is divided; a strain only once.
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

/// Returns three cells separated by commas: s, Ω, percent.
pub fn seconds_ohms_percent(ms: i64, ohm: i64, strain: i64) -> String {
    format!("{},{},{}", decimal(ms, 3, '.'), decimal(ohm, 1, '.'), decimal(strain, 2, '.'))
}
