//! Files in a zip archive: the one with the recording, or arrays of NumPy with their names.

use std::io::{Cursor, Read};

use zip::ZipArchive;

use crate::import::bytes::numpy;
use crate::import::bytes::parquet::RawColumn;
use crate::import::bytes::zipped;
use crate::import::error::{ImportError, quoted};

/// Largest number of files that a question lists.
const MOST_NAMED: usize = 6;

/// Content of an archive.
pub(crate) enum Packed {
    /// The contents of a file.
    File(Vec<u8>),
    /// Columns of arrays.
    Arrays(Vec<RawColumn>),
}

/// Returns the requested file of an archive, or the only one.
pub(crate) fn read(bytes: &[u8], name: &str, wanted: Option<&str>) -> Result<Packed, ImportError> {
    let broken = |error: String| ImportError::unreadable(name, format!("cannot be read as a zip archive: {error}"));
    zipped::check_unpacked(bytes, "unpack it, and take the file with the recording").map_err(broken)?;
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| broken(error.to_string()))?;
    let mut files: Vec<(String, usize)> = Vec::new();
    for place in 0..archive.len() {
        let file = archive.by_index(place).map_err(|error| broken(error.to_string()))?;
        let own = file.name().map_err(|error| broken(error.to_string()))?.into_owned();
        let is_hidden =
            own.starts_with("__MACOSX/") || own.rsplit('/').next().is_some_and(|file| file.starts_with('.'));
        if !file.is_dir() && !is_hidden {
            files.push((own, place));
        }
    }
    let mut content = |place: usize| {
        let mut content = Vec::new();
        let read = archive.by_index(place).map(|mut file| file.read_to_end(&mut content));
        read.map_err(|error| broken(error.to_string()))?.map_err(|error| broken(error.to_string()))?;
        Ok(content)
    };
    if files.len() > 1 && wanted.is_none() && files.iter().all(|(file, _)| file.ends_with(".npy")) {
        let arrays: Result<Vec<(String, Vec<u8>)>, ImportError> =
            files.into_iter().map(|(file, place)| Ok((file, content(place)?))).collect();
        return arrays_of(arrays?, name).map(Packed::Arrays);
    }
    let named: Vec<&(String, usize)> =
        files.iter().filter(|(file, _)| wanted.is_none_or(|wanted| wanted == file)).collect();
    match named[..] {
        [(_, place)] => content(*place).map(Packed::File),
        [] if files.is_empty() => Err(ImportError::unreadable(name, "expected files in the zip archive, found none")),
        _ => {
            let answers = files.iter().take(MOST_NAMED).map(|(file, _)| format!("--sheet {}", quoted(file)));
            let what = format!("a zip archive of {} files, of which one is read", files.len());
            Err(ImportError::question(name, what, answers))
        }
    }
}

/// Returns the columns of arrays with the commonest length.
fn arrays_of(arrays: Vec<(String, Vec<u8>)>, name: &str) -> Result<Vec<RawColumn>, ImportError> {
    let mut columns = Vec::new();
    for (file, bytes) in arrays {
        let array = file.strip_suffix(".npy").unwrap_or(&file);
        let what = |error| ImportError::unreadable(name, format!("array `{array}`: {error}"));
        columns.extend(numpy::columns(&bytes, array).map_err(what)?);
    }
    let share = |length: usize| columns.iter().filter(|column| column.cells.len() == length).count();
    let length = columns.iter().map(|column| column.cells.len()).max_by_key(|length| (share(*length), *length));
    columns.retain(|column| Some(column.cells.len()) == length);
    Ok(columns)
}
