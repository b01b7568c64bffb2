//! Workbooks and Parquet files that the test writes with third-party libraries.

use std::io::Write as _;
use std::sync::Arc;

use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::import::{Plan, Recipe, read_table};
use parquet::basic::Compression;
use parquet::data_type::{DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use rust_xlsxwriter::{ExcelDateTime, Format, Workbook};

const ROWS: usize = 50;

fn time_s(row: usize) -> f64 {
    row as f64 / 20.0
}

fn kiloohm(row: usize) -> f64 {
    1.6 + 0.01 * row as f64
}

fn strain(row: usize) -> f64 {
    0.1 * (1.0 - (0.3 * row as f64).cos())
}

fn import(bytes: Vec<u8>, recipe: &Recipe) -> Trace {
    let tables = [read_table(bytes.clone(), "lab", &recipe.read_options(0)).unwrap_or_else(|error| panic!("{error}"))];
    let proposed = Plan::propose(&tables, recipe).unwrap_or_else(|error| panic!("{error}")).recipe(&tables);
    let tables = [read_table(bytes, "lab", &proposed.read_options(0)).unwrap()];
    Plan::new(&tables, &proposed).unwrap().import(&tables).unwrap().trace
}

/// Compares times to `tolerance_s`, other values to one rounding of the unit.
fn has_the_numbers(trace: &Trace, tolerance_s: f64) {
    assert_eq!(trace.len(), ROWS);
    for row in 0..ROWS {
        assert!((trace.time_s[row] - time_s(row)).abs() <= tolerance_s, "{} {}", trace.time_s[row], time_s(row));
        assert!((trace.readings.values[row] / (1e3 * kiloohm(row)) - 1.0).abs() <= f64::EPSILON);
        let reference = &trace.reference.as_ref().unwrap().values;
        assert!((reference[row] - strain(row)).abs() <= f64::EPSILON);
    }
}

fn workbook(dates: bool) -> Vec<u8> {
    let mut workbook = Workbook::new();
    workbook.add_worksheet().set_name("Notes").unwrap().write(0, 0, "nothing here").unwrap();
    let sheet = workbook.add_worksheet().set_name("Data").unwrap();
    sheet.write(0, 0, "Sensor 3").unwrap();
    for (column, name) in ["Time (s)", "R (kOhm)", "Strain"].into_iter().enumerate() {
        sheet.write(2, column as u16, name).unwrap();
    }
    let format = Format::new().set_num_format("yyyy-mm-dd hh:mm:ss.000");
    for row in 0..ROWS {
        let line = row as u32 + 3;
        if dates {
            let moment = ExcelDateTime::from_ymd(2024, 5, 1).unwrap();
            let moment = moment.and_hms_milli(10, 0, (row / 20) as u8, 50 * (row as u16 % 20)).unwrap();
            sheet.write_with_format(line, 0, &moment, &format).unwrap();
        } else {
            sheet.write(line, 0, time_s(row)).unwrap();
        }
        sheet.write(line, 1, kiloohm(row)).unwrap();
        sheet.write(line, 2, strain(row)).unwrap();
    }
    workbook.save_to_buffer().unwrap()
}

#[test]
fn a_workbook_with_its_data_on_one_sheet() {
    has_the_numbers(&import(workbook(false), &Recipe::default()), 0.0);
    // A date is a number of days: 45 413 days have steps of 7e-12 d, 0.6 µs, and are read to the microsecond.
    has_the_numbers(&import(workbook(true), &Recipe::default()), 1.5e-6);
}

/// Numbers in a workbook have no decimal mark; that of its texts does not apply to them.
#[test]
fn a_decimal_comma_is_for_texts_of_a_workbook() {
    let known = Recipe { decimal: vec![",".parse().unwrap()], ..Recipe::default() };
    has_the_numbers(&import(workbook(false), &known), 0.0);
}

#[test]
fn two_sheets_of_numbers_are_a_question() {
    let mut workbook = Workbook::new();
    for name in ["Run 1", "Run 2"] {
        let sheet = workbook.add_worksheet().set_name(name).unwrap();
        for (column, heading) in ["Time (s)", "R (Ohm)"].into_iter().enumerate() {
            sheet.write(0, column as u16, heading).unwrap();
            sheet.write(1, column as u16, 1.5).unwrap();
        }
    }
    let bytes = workbook.save_to_buffer().unwrap();
    let error = read_table(bytes.clone(), "lab.xlsx", &Recipe::default().read_options(0)).unwrap_err().to_string();
    assert!(error.contains("--sheet 'Run 1' or --sheet 'Run 2'"), "{error}");
    let known = Recipe { sheet: Some("Run 2".into()), ..Recipe::default() };
    assert!(read_table(bytes, "lab.xlsx", &known.read_options(0)).is_ok());
}

/// Returns a file with time in microseconds, kΩ and strain.
fn parquet(compression: Compression) -> Vec<u8> {
    let schema = "message lab { REQUIRED INT64 time (TIMESTAMP(MICROS, true)); OPTIONAL DOUBLE R_kohm; OPTIONAL DOUBLE strain; }";
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let properties = Arc::new(WriterProperties::builder().set_compression(compression).build());
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, properties).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let micros: Vec<i64> = (0..ROWS as i64).map(|row| 50_000 * row).collect();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<Int64Type>().write_batch(&micros, None, None).unwrap();
    column.close().unwrap();
    for of in [kiloohm, strain] {
        let values: Vec<f64> = (0..ROWS).map(of).collect();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<DoubleType>().write_batch(&values, Some(&[1; ROWS]), None).unwrap();
        column.close().unwrap();
    }
    group.close().unwrap();
    writer.into_inner().unwrap()
}

#[test]
fn parquet_as_most_programs_write_it() {
    let packed = [Compression::SNAPPY, Compression::LZ4_RAW, Compression::LZ4, Compression::ZSTD(Default::default())];
    let slowly = [Compression::GZIP(Default::default()), Compression::BROTLI(Default::default())];
    for compression in packed.into_iter().chain(slowly).chain([Compression::UNCOMPRESSED]) {
        has_the_numbers(&import(parquet(compression), &Recipe::default()), 0.0);
    }
}

/// Whatever byte is wrong, the result is a table or a one-line error.
#[test]
fn a_damaged_parquet_file_is_no_panic() {
    let whole = parquet(Compression::SNAPPY);
    let places = (4..whole.len()).step_by(whole.len() / 200);
    for (place, value) in places.flat_map(|place| [0, 0x7f, 0xff].map(|value| (place, value))) {
        let mut bytes = whole.clone();
        bytes[place] = value;
        if let Err(error) = read_table(bytes, "lab.parquet", &Recipe::default().read_options(0)) {
            let error = error.to_string();
            assert!(error.starts_with("lab.parquet") && error.lines().count() == 1, "{place}: {error}");
        }
    }
}

/// Returns files in a zip archive.
fn zip(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, content) in files {
        writer.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        writer.write_all(content).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

fn csv() -> Vec<u8> {
    let row = |row: usize| format!("{},{},{}\n", time_s(row), kiloohm(row), strain(row));
    ("Time (s),R (kOhm),Strain\n".to_owned() + &(0..ROWS).map(row).collect::<String>()).into_bytes()
}

#[test]
fn a_file_in_a_zip_archive() {
    let one = zip(&[("run/trace.csv", &csv()), ("__MACOSX/run/._trace.csv", b"\0\x05\x16\x07")]);
    has_the_numbers(&import(one, &Recipe::default()), 0.0);
    let two = zip(&[("a.csv", b"notes\n"), ("b.csv", &csv())]);
    let error = read_table(two.clone(), "lab.zip", &Recipe::default().read_options(0)).unwrap_err().to_string();
    assert!(error.contains("--sheet a.csv or --sheet b.csv"), "{error}");
    let known = Recipe { sheet: Some("b.csv".into()), ..Recipe::default() };
    has_the_numbers(&import(two, &known), 0.0);
}

/// Returns an array as NumPy writes it.
fn numpy(shape: &str, numbers: impl Iterator<Item = f64>) -> Vec<u8> {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
    let data: Vec<u8> = numbers.flat_map(f64::to_le_bytes).collect();
    [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &data].concat()
}

#[test]
fn arrays_of_numpy() {
    let shape = format!("({ROWS},)");
    let array = |of: fn(usize) -> f64| numpy(&shape, (0..ROWS).map(of));
    let mut files = vec![("time_s.npy", array(time_s)), ("R_kohm.npy", array(kiloohm)), ("strain.npy", array(strain))];
    files.push(("rate.npy", numpy("(1,)", [20.0].into_iter())));
    let files: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (*name, bytes.as_slice())).collect();
    has_the_numbers(&import(zip(&files), &Recipe::default()), 0.0);
    let table = numpy(&format!("({ROWS}, 3)"), (0..ROWS).flat_map(|row| [time_s(row), kiloohm(row), strain(row)]));
    let answers = [("time", "1", "s"), ("resistance", "2", "kohm"), ("strain", "3", "1")];
    let known = Recipe {
        columns: answers.map(|(role, column, _)| (role.parse().unwrap(), column.parse().unwrap())).to_vec(),
        units: answers.map(|(role, _, unit)| (role.parse().unwrap(), unit.to_owned())).to_vec(),
        ..Recipe::default()
    };
    has_the_numbers(&import(table, &known), 0.0);
}

#[test]
fn names_of_numpy_fields_may_be_latin_1() {
    let header = "{'descr': [('time_s', '<f8'), ('R_kohm', '<f8'), ('strain', '<f8'), ('Temp (°C)', '<f8')], \
                  'fortran_order': False, 'shape': (40,), }\n";
    let header: Vec<u8> = header.chars().map(|c| c as u8).collect();
    let rows = (0..40).flat_map(|row| [time_s(row), kiloohm(row), strain(row), 21.5]);
    let data: Vec<u8> = rows.flat_map(f64::to_le_bytes).collect();
    let array = [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], &header, &data].concat();
    assert_eq!(import(array, &Recipe::default()).temperature_c, Some(vec![21.5; 40]));
}

#[test]
fn a_file_without_a_table_is_refused_in_one_line() {
    for bytes in [
        b"PAR1 is all".to_vec(),
        b"PK\x03\x04".to_vec(),
        b"\x1f\x8bno".to_vec(),
        b"\0\x01\x02\0\0\0".to_vec(),
        b"words only\n".to_vec(),
        Vec::new(),
    ] {
        let error = read_table(bytes, "lab", &Recipe::default().read_options(0)).unwrap_err().to_string();
        assert!(error.starts_with("lab") && error.lines().count() == 1, "{error}");
    }
}
