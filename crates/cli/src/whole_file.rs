//! Files that are read as a whole, up to a limit, so that an endless device is refused.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use csv::StringRecord;
use ohmstrain_bench_data::import::LARGEST_FILE;

use crate::error::CliError;

/// Largest size, bytes, of a file of parameters, a description or a list of recordings: room for a hundred thousand recordings,
/// and far more than this program writes.
const LARGEST_TEXT: u64 = 16 << 20;

/// True if a path means stdin.
pub fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

/// Reads a lab's file; `-` is stdin.
pub fn bytes(path: &Path) -> Result<Vec<u8>, CliError> {
    up_to(LARGEST_FILE, path, "take a part of it, or fewer columns")
}

/// Reads a file of parameters, or another one that people write.
pub fn text(path: &Path) -> Result<String, CliError> {
    let bytes = up_to(LARGEST_TEXT, path, "is it another file that was meant?")?;
    String::from_utf8(bytes).map_err(|_| {
        let name = path.display();
        CliError::Input(format!("{name}:1: expected a text file in UTF-8, found other bytes"))
    })
}

/// Returns the line of a record of a CSV file. Its position is that of the line ends before it, which are skipped.
pub fn line(text: &str, row: &StringRecord) -> u64 {
    let Some(position) = row.position() else { return 0 };
    let rest = usize::try_from(position.byte()).ok().and_then(|byte| text.get(byte..)).unwrap_or_default();
    let ends = rest.chars().take_while(|end| ['\r', '\n'].contains(end));
    position.line() + ends.filter(|end| *end == '\n').count() as u64
}

fn up_to(most: u64, path: &Path, hint: &str) -> Result<Vec<u8>, CliError> {
    let mut bytes = Vec::new();
    let read = if is_stdin(path) {
        io::stdin().lock().take(most + 1).read_to_end(&mut bytes)
    } else {
        File::open(path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes))
    };
    read.map_err(|error| CliError::file("read", path, &error))?;
    if bytes.len() as u64 <= most {
        return Ok(bytes);
    }
    let name = if is_stdin(path) { "stdin".into() } else { path.display().to_string() };
    Err(CliError::Input(format!("{name}: expected a file of at most {} MiB, found a larger one; {hint}", most >> 20)))
}
