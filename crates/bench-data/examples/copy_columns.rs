//! Reads a recording row by row and writes as many columns as a table of estimates has, without estimating anything: what
//! `ohmstrain filter` costs beyond this is the filter. `scripts/million-rows.sh` runs both.
//!
//! `copy_columns recording.csv estimates.csv > copy.csv`: time and reading come from the recording; the other cells come
//! from the first rows of the estimates, again and again, so that numbers are as long as they are there.

use std::error::Error;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, stdout};

use ohmstrain_bench_data::{RowWriter, TraceReader};

/// Rows of estimates that are held in memory.
const ROWS: usize = 1000;

fn main() -> Result<(), Box<dyn Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let [recording, estimates] = paths.as_slice() else { return Err("expected two files".into()) };
    let mut lines = BufReader::new(File::open(estimates)?).lines();
    let header = lines.next().ok_or("no header")??;
    let names: Vec<&str> = header.split(',').collect();
    let table: Vec<Vec<f64>> = lines.take(ROWS).map(|line| Ok(cells(&line?))).collect::<Result<_, Box<dyn Error>>>()?;

    let mut rows = RowWriter::new(BufWriter::with_capacity(1 << 16, stdout().lock()));
    names.iter().for_each(|name| rows.text(name));
    rows.end()?;
    for (row, estimates) in TraceReader::new(File::open(recording)?, recording)?.zip(table.iter().cycle()) {
        let row = row?;
        for (name, cell) in names.iter().zip(estimates) {
            rows.number(match *name {
                "time_s" => row.time_s,
                "resistance_ohm" => row.reading.value,
                _ => *cell,
            });
        }
        rows.end()?;
    }
    Ok(rows.flush()?)
}

/// The numbers of a line; NaN where there is none.
fn cells(line: &str) -> Vec<f64> {
    line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()
}
