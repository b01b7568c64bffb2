//! Inspection of a zip container before anything in it is read: the kind of workbook, and its unpacked size. Repeated
//! rows and cells of ODS are counted as often as they are repeated.

use std::io::{BufRead, BufReader, Cursor, Read, copy, sink};

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use zip::ZipArchive;

use crate::import::bytes::bounds::{LARGEST_WORKBOOK, mib};
use crate::import::bytes::sheet::{Budget, TooMuch, check_size};

/// A kind of workbook.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Xlsx,
    Xlsb,
    Ods,
}

/// True if a container is an archive of files rather than a workbook.
pub(crate) fn is_archive(bytes: &[u8]) -> bool {
    const OF_WORKBOOKS: [&str; 3] = ["content.xml", "xl/workbook.bin", "[Content_Types].xml"];
    let Ok(archive) = ZipArchive::new(Cursor::new(bytes)) else { return false };
    !archive.is_empty() && !OF_WORKBOOKS.iter().any(|name| has(&archive, name))
}

fn has(archive: &ZipArchive<Cursor<&[u8]>>, name: &str) -> bool {
    archive.file_names().flatten().any(|file| file.eq_ignore_ascii_case(name))
}

/// Returns the kind of a workbook whose unpacked size is within its bound.
pub(crate) fn kind(bytes: &[u8]) -> Result<Kind, String> {
    check_unpacked(bytes, "save the sheet with the recording as CSV")?;
    let archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    Ok(match (has(&archive, "content.xml"), has(&archive, "xl/workbook.bin")) {
        (true, _) => Kind::Ods,
        (_, true) => Kind::Xlsb,
        _ => Kind::Xlsx,
    })
}

/// Refuses a container whose unpacked size exceeds its bound.
pub(crate) fn check_unpacked(bytes: &[u8], way_out: &str) -> Result<(), String> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let mut left = LARGEST_WORKBOOK;
    for index in 0..archive.len() {
        // The sizes that the container states may be wrong.
        let file = archive.by_index(index).map_err(|error| error.to_string())?;
        let size = copy(&mut file.take(left + 1), &mut sink()).map_err(|error| error.to_string())?;
        left = left.checked_sub(size).ok_or_else(|| {
            let most = mib(LARGEST_WORKBOOK);
            format!("expected at most {most} MiB when unpacked, found more: {way_out}")
        })?;
    }
    Ok(())
}

/// Refuses a workbook whose sheets have too many cells, from the first to the last one that is not empty.
pub(crate) fn check_ods(bytes: &[u8]) -> Result<(), TooMuch> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let content = archive.by_name("content.xml").map_err(|error| error.to_string())?;
    count(BufReader::new(content))
}

/// Rows and columns of a sheet up to its last cell that is not empty, and the size of their text.
#[derive(Default)]
struct Size {
    /// Number of rows so far, and of those up to the last that is not empty.
    rows: usize,
    height: usize,
    width: usize,
    bytes: u64,
    /// Place of a cell in the last column.
    last: (u32, u32),
}

/// The row being read.
#[derive(Default)]
struct OpenRow {
    repeats: usize,
    columns: usize,
    /// Number of columns up to the last cell that is not empty.
    width: usize,
    bytes: u64,
    /// Repetitions of the cell being read.
    cell: usize,
}

fn count(source: impl BufRead) -> Result<(), TooMuch> {
    let mut reader = Reader::from_reader(source);
    reader.config_mut().check_end_names = false;
    reader.config_mut().expand_empty_elements = true;
    let (mut size, mut row, mut budget, mut buffer) =
        (Size::default(), OpenRow::default(), Budget::default(), Vec::new());
    loop {
        match reader.read_event_into(&mut buffer).map_err(|error| error.to_string())? {
            Event::Start(tag) => match tag.name().as_ref() {
                "table:table-row" => {
                    row = OpenRow { repeats: repeats(&tag, "table:number-rows-repeated"), ..OpenRow::default() };
                }
                "table:table-cell" | "table:covered-table-cell" => {
                    row.cell = repeats(&tag, "table:number-columns-repeated");
                    row.columns = row.columns.saturating_add(row.cell);
                    let value = attribute(&tag, "office:string-value").map_or(0, |text| text.len());
                    if ["office:value-type", "table:formula"].iter().any(|name| attribute(&tag, name).is_some()) {
                        row.fill(value);
                    }
                }
                _ => {}
            },
            Event::Text(text) if row.cell > 0 => row.fill(text.len()),
            Event::GeneralRef(_) if row.cell > 0 => row.fill(1),
            Event::End(tag) => match tag.name().as_ref() {
                "table:table-cell" | "table:covered-table-cell" => row.cell = 0,
                "table:table-row" => size.add(&row)?,
                "table:table" => std::mem::take(&mut size).charge(&mut budget)?,
                _ => {}
            },
            Event::Eof => return size.charge(&mut budget),
            _ => {}
        }
        buffer.clear();
    }
}

impl OpenRow {
    fn fill(&mut self, bytes: usize) {
        self.width = self.columns;
        self.bytes = self.bytes.saturating_add((bytes as u64).saturating_mul(self.cell as u64));
    }
}

impl Size {
    fn add(&mut self, row: &OpenRow) -> Result<(), TooMuch> {
        self.rows = self.rows.saturating_add(row.repeats);
        if row.width == 0 {
            return Ok(());
        }
        self.height = self.rows;
        self.bytes = self.bytes.saturating_add(row.bytes.saturating_mul(row.repeats as u64));
        if row.width > self.width {
            let place = |count: usize| u32::try_from(count - 1).unwrap_or(u32::MAX);
            (self.width, self.last) = (row.width, (place(self.rows), place(row.width)));
        }
        check_size(self.last, self.height, self.width)
    }

    fn charge(self, budget: &mut Budget) -> Result<(), TooMuch> {
        budget.take(self.width.saturating_mul(self.height), self.bytes)
    }
}

fn repeats(tag: &BytesStart, name: &str) -> usize {
    attribute(tag, name).and_then(|text| text.trim().parse().ok()).unwrap_or(1)
}

fn attribute(tag: &BytesStart, name: &str) -> Option<String> {
    tag.try_get_attribute(name).ok().flatten().map(|found| found.value.into_owned())
}
