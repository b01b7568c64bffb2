use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::CliError;

/// Writes a file whole or not at all: into a temporary neighbour that then takes its place.
pub fn write_file(path: &Path, fill: impl FnOnce(&mut dyn Write) -> Result<(), CliError>) -> Result<(), CliError> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    };
    let failed = |error: &std::io::Error| CliError::file("write", path, error);
    // The kind alone: the full text names the temporary neighbour, which nobody asked for.
    let mut file = NamedTempFile::new_in(folder).map_err(|error| failed(&error.kind().into()))?;
    {
        let mut buffer = std::io::BufWriter::new(&mut file);
        fill(&mut buffer)?;
        buffer.flush().map_err(|error| failed(&error))?;
    }
    let persisted = file.persist(path).map_err(|error| failed(&error.error))?;
    readable_by_all(&persisted).map_err(|error| failed(&error))
}

/// A temporary file is private; a result is not.
#[cfg(unix)]
fn readable_by_all(file: &fs::File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn readable_by_all(_: &fs::File) -> std::io::Result<()> {
    Ok(())
}

/// Writes to a file, or to stdout if there is none.
pub fn write_to(
    path: Option<&Path>,
    fill: impl FnOnce(&mut dyn Write) -> Result<(), CliError>,
) -> Result<(), CliError> {
    match path {
        Some(path) => write_file(path, fill),
        None => {
            let mut out = std::io::BufWriter::new(std::io::stdout().lock());
            fill(&mut out)?;
            Ok(out.flush()?)
        }
    }
}

/// Makes a folder and the folders above it.
pub fn make_folder(path: &Path) -> Result<(), CliError> {
    fs::create_dir_all(path).map_err(|error| CliError::file("make the folder", path, &error))
}
