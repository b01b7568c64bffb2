use std::io::Read;

use crate::ParquetText;
use crate::import::bounds::{LARGEST_FILE, MOST_WRAPPINGS, mib};
use crate::import::error::ImportError;
use crate::import::grid::{Grid, is_monitor};
use crate::import::header::Header;
use crate::import::layout::{SAMPLE, TextLayout, decode, lines, text_layout};
use crate::import::recipe::ReadOptions;
use crate::import::records::{self, Records};
use crate::import::table::{Layout, Table};
use crate::import::{parquet, workbook};

/// Reads a file of any kind: text, XLSX and its relatives, Parquet, each of them in gzip too. `name` is what messages call
/// it.
///
/// # Errors
/// [`ImportError`] if it is nothing of that kind, has no rows of numbers, or holds more than may be held.
pub fn read_table(mut bytes: Vec<u8>, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    let mut wrappings = 0;
    while bytes.starts_with(&[0x1f, 0x8b]) {
        wrappings += 1;
        if wrappings > MOST_WRAPPINGS {
            let what = format!("expected gzip data in at most {MOST_WRAPPINGS} wrappings, found more: unpack it first");
            return Err(ImportError::unreadable(name, what));
        }
        bytes = unpacked(&bytes, name)?;
    }
    let mut table = read_unpacked(bytes, name, options)?;
    table.layout.format.insert_str(0, &"gzip, ".repeat(wrappings));
    Ok(table)
}

/// What is packed in gzip data.
fn unpacked(bytes: &[u8], name: &str) -> Result<Vec<u8>, ImportError> {
    let mut inner = Vec::new();
    let read = flate2::read::MultiGzDecoder::new(bytes).take(LARGEST_FILE + 1).read_to_end(&mut inner);
    read.map_err(|error| ImportError::unreadable(name, format!("expected gzip data, found {error}")))?;
    if inner.len() as u64 <= LARGEST_FILE {
        return Ok(inner);
    }
    let most = mib(LARGEST_FILE);
    let what =
        format!("expected gzip data of at most {most} MiB when unpacked, found more: unpack it, and take a part of it");
    Err(ImportError::unreadable(name, what))
}

fn read_unpacked(bytes: Vec<u8>, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    if ParquetText::is_one(&bytes) {
        return parquet::read(bytes, name);
    }
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(&workbook::XLS) {
        return workbook::read(&bytes, name, options);
    }
    let Some((text, encoding)) = decode(&bytes) else {
        let what = "expected text, XLSX or Parquet, perhaps in gzip, found binary data";
        return Err(ImportError::unreadable(name, what));
    };
    read_text(&text, encoding, name, options)
}

fn read_text(text: &str, encoding: &'static str, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    let lines = lines(text).map_err(|(line, fault)| ImportError::content(name, line, fault))?;
    let skip = options.skip.unwrap_or(0);
    let below = lines.partition_point(|(number, _)| *number <= skip as u64);
    let monitor = is_monitor(lines[below..].iter().take(SAMPLE).map(|(_, line)| *line));
    if let Some(records) = Records::find(&lines[below..], monitor) {
        let (decimal, decimal_is_open) = options.decimal.map_or_else(|| records.decimal(), |mark| (mark, false));
        let separator = Some(records::SEPARATOR);
        let layout = Layout {
            format: "text".to_owned(),
            encoding: Some(encoding),
            separator,
            decimal,
            decimal_is_open,
            ..Layout::default()
        };
        let header = Header::of_records(&records, monitor, decimal, skip);
        return Table::of_grid(name, &Grid::Records(records), header, layout);
    }
    let TextLayout { separator, decimal, decimal_is_open } = text_layout(&lines[below..], monitor, options.decimal);
    let layout = Layout {
        format: "text".to_owned(),
        encoding: Some(encoding),
        separator: Some(separator.words()),
        decimal,
        decimal_is_open,
        ..Layout::default()
    };
    let is_open = !text.ends_with(['\n', '\r']);
    let grid = Grid::Text { lines, separator, monitor, is_open };
    let header = Header::find(name, &grid, decimal, skip)?;
    Table::of_grid(name, &grid, header, layout)
}
