use std::io::Read;

use crate::ParquetText;
use crate::import::error::ImportError;
use crate::import::grid::{Grid, Separator};
use crate::import::header::Header;
use crate::import::layout::{TextLayout, decode, lines, text_layout};
use crate::import::recipe::ReadOptions;
use crate::import::table::{Layout, Table};
use crate::import::{parquet, workbook};

/// Most bytes that a compressed file may unpack to, 4 GiB: a bound on what a small file can do.
const LARGEST_UNPACKED: u64 = 1 << 32;

/// Reads a file of any kind: text, XLSX and its relatives, Parquet, each of them in gzip too. `name` is what messages call
/// it.
///
/// # Errors
/// [`ImportError`] if it is nothing of that kind, or has no rows of numbers.
pub fn read_table(bytes: Vec<u8>, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    if bytes.starts_with(&[0x1f, 0x8b]) {
        let mut inner = Vec::new();
        let unpacked =
            flate2::read::MultiGzDecoder::new(bytes.as_slice()).take(LARGEST_UNPACKED).read_to_end(&mut inner);
        unpacked.map_err(|error| ImportError::unreadable(name, format!("expected gzip data, found {error}")))?;
        let mut table = read_table(inner, name, options)?;
        table.layout.format = format!("gzip, {}", table.layout.format);
        return Ok(table);
    }
    if ParquetText::is_one(&bytes) {
        return parquet::read(bytes, name);
    }
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(&[0xd0, 0xcf, 0x11, 0xe0]) {
        return workbook::read(bytes, name, options);
    }
    let Some((text, encoding)) = decode(&bytes) else {
        let what = "expected text, XLSX or Parquet, perhaps in gzip, found binary data";
        return Err(ImportError::unreadable(name, what));
    };
    read_text(&text, encoding, name, options)
}

fn read_text(text: &str, encoding: &'static str, name: &str, options: &ReadOptions) -> Result<Table, ImportError> {
    let lines = lines(text);
    let skip = options.skip.unwrap_or(0);
    let below = lines.partition_point(|(number, _)| *number <= skip as u64);
    let written = text_layout(&lines[below..], options.decimal);
    let TextLayout { separator, decimal, decimal_is_open, labels, monitor } = written;
    let layout = Layout {
        format: "text".to_owned(),
        encoding: Some(encoding),
        separator: Some(separator.words()),
        decimal,
        decimal_is_open,
        ..Layout::default()
    };
    let label_header = (separator == Separator::Labels).then(|| Header::of_labels(&labels, monitor, skip, below));
    let is_open = !text.ends_with(['\n', '\r']);
    let grid = Grid::Text { lines, separator, labels, monitor, is_open };
    let header = match label_header {
        Some(header) => header,
        None => Header::find(name, &grid, decimal, skip)?,
    };
    Ok(Table::of_grid(name, &grid, header, layout))
}
