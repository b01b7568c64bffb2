//! Files that require more memory than there is, records over several lines, and names whose last part is not a unit.

use std::fmt::Write as _;
use std::io::Write as _;

use ohmstrain_bench_data::import::{ImportError, Plan, Recipe, Table, read_table};
use ohmstrain_bench_data::{Metadata, TraceReader};
use rust_xlsxwriter::Workbook;

fn read(bytes: Vec<u8>, name: &str) -> Result<Table, ImportError> {
    read_table(bytes, name, &Recipe::default().read_options(0))
}

/// Returns a workbook with a small table, and optionally a cell far away.
fn workbook(far: Option<(u32, u16)>) -> Vec<u8> {
    let mut workbook = Workbook::new();
    let sheet = workbook.add_worksheet();
    for (column, name) in ["t (s)", "R (Ohm)", "strain"].into_iter().enumerate() {
        sheet.write(0, column as u16, name).unwrap();
        for row in 1..=50 {
            sheet
                .write(
                    row,
                    column as u16,
                    [0.05 * f64::from(row), 1600.0 + f64::from(row), 0.001 * f64::from(row)][column],
                )
                .unwrap();
        }
    }
    if let Some((row, column)) = far {
        sheet.write(row, column, 1.0).unwrap();
    }
    workbook.save_to_buffer().unwrap()
}

/// The last possible cell of a sheet would make a table of 17 billion cells; one far below, or to the right, fewer.
#[test]
fn a_stray_cell_takes_no_memory() {
    assert!(read(workbook(None), "rig.xlsx").is_ok());
    for far in [(1_048_575, 16_383), (1_048_575, 2), (3, 16_383), (500_000, 9_000)] {
        match read(workbook(Some(far)), "rig.xlsx") {
            // Empty rows in between are left out.
            Ok(table) => assert!(Plan::propose(&[table], &Recipe::default()).is_ok(), "{far:?}"),
            Err(error) => assert!(error.to_string().contains("rig.xlsx"), "{far:?}: {error}"),
        }
    }
}

/// More than a gigabyte of zeros in a megabyte.
#[test]
fn a_gzip_bomb_is_refused() {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    let zeros = vec![b'0'; 1 << 24];
    (0..65).for_each(|_| packed.write_all(&zeros).unwrap());
    let error = read(packed.finish().unwrap(), "trace.csv.gz").unwrap_err().to_string();
    assert!(error.contains("trace.csv.gz") && error.contains("MiB"), "{error}");
}

#[test]
fn metadata_without_end_is_refused() {
    let endless = "# a = b\n".repeat(100_000);
    let error = TraceReader::with_overrides(endless.as_bytes(), "-", &Metadata::default()).map(drop).unwrap_err();
    assert!(error.to_string().contains("at most 1000 lines"), "{error}");
}

/// A record ends where one of its labels is repeated, with or without a line between records.
#[test]
fn a_record_over_several_lines_is_one_row() {
    for (end, separator) in [("---\n", ": "), ("", ": "), ("\n", " = "), ("", "=")] {
        let mut text = String::new();
        for row in 0..60 {
            let (t, ohm) = (0.05 * f64::from(row), 1600.0 + f64::from(row * row % 17));
            write!(
                text,
                "time_s{separator}{t}\nresistance_ohm{separator}{ohm}\nstrain{separator}0.0{}\n{end}",
                row % 10
            )
            .unwrap();
        }
        let tables = [read(text.into_bytes(), "board.txt").unwrap()];
        let trace = Plan::propose(&tables, &Recipe::default()).unwrap().import(&tables).unwrap().trace;
        assert_eq!(trace.len(), 60, "{end:?} {separator:?}");
        assert!(trace.readings.values.iter().all(|value| value.is_finite()));
    }
}

/// The last part of a name is a unit only if it cannot be an index.
#[test]
fn an_index_is_no_unit() {
    let table = |strain: &str, scale: f64| {
        let mut text = format!("t_s,resistance_ohm,{strain}\n");
        (0..60).for_each(|k| {
            writeln!(text, "{},{},{}", 0.05 * f64::from(k), 1600 + k, scale * f64::from(k % 20)).unwrap()
        });
        [read(text.into_bytes(), "rig.csv").unwrap()]
    };
    for name in ["strain_1", "Strain1", "strain_2", "strain 1"] {
        let tables = table(name, 1.0);
        let asked = Plan::propose(&tables, &Recipe::default()).unwrap_err().to_string();
        assert!(asked.contains("--unit strain=percent"), "{name}: {asked}");
    }
    let tables = table("strain_pct", 1.0);
    let trace = Plan::propose(&tables, &Recipe::default()).unwrap().import(&tables).unwrap().trace;
    assert!((trace.reference.unwrap().values[19] - 0.19).abs() < 1e-12);
}
