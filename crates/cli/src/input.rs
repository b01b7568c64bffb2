use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use ohmstrain::trace::TraceFile;
use ohmstrain_bench_data::{Metadata, ParquetText, TraceError, TraceReader};
use sha2::{Digest, Sha256};

use crate::error::CliError;
use crate::readings::late;
use crate::sensor_file;
use crate::whole_file::is_stdin;

/// Bytes that are read at once from a file that is not kept in memory as a whole.
const READ_AT_ONCE: usize = 1 << 16;

/// Opens a recording for reading row by row; `-` is stdin.
pub fn open(path: &Path, overrides: &Metadata) -> Result<TraceReader<Box<dyn Read>>, CliError> {
    let (text, metadata) = text_of(path, overrides)?;
    Ok(TraceReader::with_overrides(text, &path.display().to_string(), &metadata)?)
}

/// Returns the text of a recording (for a Parquet file, the equivalent CSV) and its further metadata.
pub fn text_of(path: &Path, overrides: &Metadata) -> Result<(Box<dyn Read>, Metadata), CliError> {
    if is_stdin(path) {
        let mut stdin = io::stdin().lock();
        // Waits for the first bytes, without consuming them.
        if let Ok(first) = stdin.fill_buf() {
            refuse_parameters(path, first)?;
        }
        return Ok((Box::new(stdin), overrides.clone()));
    }
    let unreadable = |error| CliError::file("read", path, &error);
    let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
    let first = file.fill_buf().map_err(unreadable)?;
    if ParquetText::is_one(first) {
        return text_of_parquet(path, overrides);
    }
    refuse_parameters(path, first)?;
    Ok((Box::new(file), overrides.clone()))
}

fn text_of_parquet(path: &Path, overrides: &Metadata) -> Result<(Box<dyn Read>, Metadata), CliError> {
    let unreadable = |error| CliError::Input(format!("{}: cannot be read {error}", path.display()));
    let file = File::open(path).map_err(|error| CliError::file("read", path, &error))?;
    let text = ParquetText::new(file).map_err(unreadable)?;
    let mut metadata = text.metadata().clone();
    metadata.override_with(overrides);
    Ok((Box::new(text), metadata))
}

/// Reads a whole recording, up to the permitted number of rows.
pub fn read(path: &Path, overrides: &Metadata) -> Result<TraceFile, CliError> {
    if is_stdin(path) {
        return of_text(&mut io::stdin().lock(), path, overrides);
    }
    let unreadable = |error| CliError::file("read", path, &error);
    let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
    if ParquetText::is_one(file.fill_buf().map_err(unreadable)?) {
        let sha256 = sha256_of(path).map_err(unreadable)?;
        let (text, metadata) = text_of_parquet(path, overrides)?;
        let rows = TraceReader::with_overrides(text, &path.display().to_string(), &metadata)?;
        return TraceFile::collect(rows, sha256).map_err(several);
    }
    of_text(&mut file, path, overrides)
}

/// Parses these bytes as a whole recording.
pub fn parse(mut bytes: &[u8], path: &Path, overrides: &Metadata) -> Result<TraceFile, CliError> {
    of_text(&mut bytes, path, overrides)
}

fn of_text<R: BufRead>(source: &mut R, path: &Path, overrides: &Metadata) -> Result<TraceFile, CliError> {
    refuse_parameters(path, source.fill_buf().map_err(|error| CliError::file("read", path, &error))?)?;
    let mut digest = Sha256::new();
    let hashed = Hashed { source, digest: &mut digest };
    let rows = TraceReader::with_overrides(hashed, &path.display().to_string(), overrides)?;
    let file = TraceFile::collect(rows, String::new()).map_err(several)?;
    Ok(TraceFile { sha256: hexadecimal(&digest.finalize()), ..file })
}

/// Creates the error of a recording; where the clock begins anew, with advice on several recordings in one file.
fn several(error: TraceError) -> CliError {
    late(
        error,
        "`ohmstrain import --split-recordings` makes a file of each recording (with --each for several channels)",
    )
}

/// A source whose bytes are hashed as they are read.
struct Hashed<'a, R> {
    source: &'a mut R,
    digest: &'a mut Sha256,
}

impl<R: Read> Read for Hashed<'_, R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(out)?;
        self.digest.update(&out[..count]);
        Ok(count)
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the SHA-256 of a file's bytes, hexadecimal. Only regular files: a device may have no end, and a pipe can be read
/// once.
pub fn sha256_of(path: &Path) -> io::Result<String> {
    if !path.metadata()?.is_file() {
        return Err(io::Error::other("expected a file, found a device, a pipe or a folder"));
    }
    let (mut file, mut digest, mut bytes) = (File::open(path)?, Sha256::new(), vec![0; READ_AT_ONCE]);
    loop {
        match file.read(&mut bytes)? {
            0 => return Ok(hexadecimal(&digest.finalize())),
            count => digest.update(&bytes[..count]),
        }
    }
}

/// Returns the SHA-256 of the hashes of several files, hexadecimal.
pub fn sha256_of_all(paths: &[PathBuf]) -> io::Result<String> {
    let hashes = paths.iter().map(|path| sha256_of(path)).collect::<io::Result<Vec<_>>>()?;
    Ok(hexadecimal(&Sha256::digest(hashes.concat())))
}

/// Refuses the file of a sensor or of a hand, recognised by its first bytes.
fn refuse_parameters(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    if !sensor_file::is_one(bytes) {
        return Ok(());
    }
    let what = if sensor_file::is_hand(&String::from_utf8_lossy(bytes)) {
        sensor_file::A_HAND
    } else {
        "is a sensor file, not a recording: give it to --sensor, and the recording here"
    };
    Err(CliError::Input(format!("{} {what}", path.display())))
}
