//! Looks into a zip container before anything in it is read: which kind of workbook it is, and how much it unpacks to.

use std::io::{Cursor, Read, copy, sink};

use zip::ZipArchive;

use crate::import::bounds::{LARGEST_WORKBOOK, mib};

/// A kind of workbook.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Xlsx,
    Xlsb,
    Ods,
}

/// The kind of a workbook that unpacks to no more than it may.
pub(crate) fn kind(bytes: &[u8]) -> Result<Kind, String> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let mut left = LARGEST_WORKBOOK;
    for index in 0..archive.len() {
        // What the container says of sizes need not be true.
        let file = archive.by_index(index).map_err(|error| error.to_string())?;
        let size = copy(&mut file.take(left + 1), &mut sink()).map_err(|error| error.to_string())?;
        left = left.checked_sub(size).ok_or_else(|| {
            let most = mib(LARGEST_WORKBOOK);
            format!("expected at most {most} MiB when unpacked, found more: save the sheet with the recording as CSV")
        })?;
    }
    let has = |name: &str| archive.file_names().flatten().any(|file| file.eq_ignore_ascii_case(name));
    Ok(match (has("content.xml"), has("xl/workbook.bin")) {
        (true, _) => Kind::Ods,
        (_, true) => Kind::Xlsb,
        _ => Kind::Xlsx,
    })
}
