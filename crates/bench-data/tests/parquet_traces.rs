//! Traces in Parquet as other programs write them: any name of the schema's root, any compression, any number type.

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use ohmstrain_bench_data::import::{Plan, Recipe, read_table};
use ohmstrain_bench_data::{ParquetText, Trace};
use parquet::basic::Compression;
use parquet::data_type::{DoubleType, FloatType, Int32Type};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

const ROWS: usize = 40;

/// Returns times in whole seconds, ohms in single precision, every seventh of them missing, strain, and an unrelated column.
fn parquet(root: &str, compression: Compression) -> Vec<u8> {
    described(root, compression, &[])
}

/// The same, with key-value metadata.
fn described(root: &str, compression: Compression, metadata: &[(&str, &str)]) -> Vec<u8> {
    let schema = format!(
        "message {root} {{ OPTIONAL INT32 time_s; OPTIONAL FLOAT resistance_ohm; REQUIRED DOUBLE strain; OPTIONAL INT32 note; }}"
    );
    let schema = Arc::new(parse_message_type(&schema).unwrap());
    let properties = WriterProperties::builder().set_compression(compression).set_dictionary_enabled(true);
    let pairs = metadata.iter().map(|(key, value)| KeyValue::new((*key).to_owned(), (*value).to_owned())).collect();
    let properties = properties.set_key_value_metadata(Some(pairs)).build();
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties)).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let times: Vec<i32> = (0..ROWS as i32).collect();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<Int32Type>().write_batch(&times, Some(&[1; ROWS]), None).unwrap();
    column.close().unwrap();
    let ohms: Vec<f32> = (0..ROWS).filter(|row| is_known(*row)).map(ohm).collect();
    let known: Vec<i16> = (0..ROWS).map(|row| i16::from(is_known(row))).collect();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<FloatType>().write_batch(&ohms, Some(&known), None).unwrap();
    column.close().unwrap();
    let strains: Vec<f64> = (0..ROWS).map(strain).collect();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<DoubleType>().write_batch(&strains, None, None).unwrap();
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<Int32Type>().write_batch(&[], Some(&[0; ROWS]), None).unwrap();
    column.close().unwrap();
    group.close().unwrap();
    writer.into_inner().unwrap()
}

const fn is_known(row: usize) -> bool {
    row % 7 != 3
}

fn ohm(row: usize) -> f32 {
    700.1 + row as f32
}

fn strain(row: usize) -> f64 {
    0.01 * (row % 5) as f64
}

/// A trace and an import of the same file: whoever states the unit in the file need not state it again.
#[test]
fn key_value_metadata_count_for_traces_and_imports() {
    let lines = [("resistance_unit", "kohm"), ("strain_unit", "percent"), ("time_unit", "s"), ("pandas", "{}")];
    let bytes = described("schema", Compression::SNAPPY, &lines);
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("described-{}.parquet", std::process::id()));
    fs::write(&path, &bytes).unwrap();
    let text = ParquetText::new(File::open(&path).unwrap()).unwrap();
    assert_eq!(text.metadata().other, [("time_unit".to_owned(), "s".to_owned())]);
    let read = Trace::read(text, "read").unwrap_or_else(|error| panic!("{error}"));
    fs::remove_file(path).unwrap();
    let recipe = Recipe::default();
    let tables = [read_table(bytes, "imported.parquet", &recipe.read_options(0)).unwrap()];
    let imported = Plan::propose(&tables, &recipe).unwrap().import(&tables).unwrap().trace;
    assert_eq!(
        imported.readings.values[0],
        1000.0 * f64::from(ohm(0).to_string().parse::<f32>().unwrap()).round() + 100.0
    );
    assert_eq!(imported.reference.unwrap().values[1], 0.01 * 0.01);
    assert_eq!(read.len(), ROWS);
}

/// Whatever byte of a file is damaged: an error, or other numbers, and no panic.
#[test]
fn a_damaged_file_is_an_error() {
    let bytes = parquet("schema", Compression::SNAPPY);
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("damaged-{}.parquet", std::process::id()));
    for place in 4..bytes.len() {
        for bit in [0x01, 0x80] {
            let mut damaged = bytes.clone();
            damaged[place] ^= bit;
            fs::write(&path, damaged).unwrap();
            if let Ok(text) = ParquetText::new(File::open(&path).unwrap()) {
                let _ = Trace::read(text, "damaged");
            }
        }
    }
    fs::remove_file(path).unwrap();
}

#[test]
fn a_trace_is_read_whatever_wrote_it() {
    let compressions = [
        Compression::UNCOMPRESSED,
        Compression::SNAPPY,
        Compression::ZSTD(Default::default()),
        Compression::LZ4_RAW,
        Compression::BROTLI(Default::default()),
    ];
    for (root, compression) in
        ["schema", "root", "duckdb_schema", "spark_schema", "hive_schema"].into_iter().zip(compressions)
    {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{root}-{}.parquet", std::process::id()));
        fs::write(&path, parquet(root, compression)).unwrap();
        let text = ParquetText::new(File::open(&path).unwrap()).unwrap_or_else(|error| panic!("{root}: {error}"));
        let trace = Trace::read(text, root).unwrap();
        fs::remove_file(path).unwrap();
        assert_eq!(trace.len(), ROWS, "{root}");
        for row in 0..ROWS {
            assert_eq!(trace.time_s[row], row as f64, "{root}");
            // Single precision is read by its own shortest decimal digits: 700.1 means 700.1.
            let expected = if is_known(row) { ohm(row).to_string().parse().unwrap() } else { f64::NAN };
            assert_eq!(trace.readings.values[row].to_bits(), f64::to_bits(expected), "{root}");
            assert_eq!(trace.reference.as_ref().unwrap().values[row], strain(row), "{root}");
        }
    }
}
