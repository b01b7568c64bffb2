use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, BufReader, Read, Seek, Write};
use std::path::{Path, PathBuf};

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::TypePtr;
use serde_json::Value;

use super::kind::{Kind, is_this_program};
use super::unfinished::{Unfinished, folder_of, publish, sync_folder};

/// Identity of a file in the system, independent of its name.
#[derive(Debug, PartialEq, Eq)]
pub enum Identity {
    /// Device and inode number of an existing file.
    #[cfg(unix)]
    Number(u64, u64),
    /// Its unique name without links.
    Name(PathBuf),
}

impl Identity {
    /// Returns the identity of a file that exists.
    #[cfg(unix)]
    pub fn of(path: &Path) -> Option<Self> {
        use std::os::unix::fs::MetadataExt;
        let found = fs::metadata(path).ok()?;
        Some(Self::Number(found.dev(), found.ino()))
    }

    /// Returns the identity of a file that exists.
    #[cfg(not(unix))]
    pub fn of(path: &Path) -> Option<Self> {
        Some(Self::Name(fs::canonicalize(path).ok()?))
    }
}

/// Destination of an output.
pub enum Destination {
    /// An existing file that takes bytes directly: a device, a pipe, an open file of this process.
    Through(File),
    /// A whole file: written to a temporary neighbour that then replaces it.
    Whole {
        /// Path without symbolic links: the links stay, their target is written.
        path: PathBuf,
        identity: Identity,
        /// Permissions of the existing file.
        permissions: Option<Permissions>,
    },
}

/// Longest chain of symbolic links, as long as the system follows.
const MOST_LINKS: usize = 40;

/// Number of first bytes by which the kind of a file is recognised.
pub const HEAD: u64 = 4096;

impl Destination {
    /// Checks that `path` can be written, and leaves the file as it is.
    pub fn of(path: &Path) -> io::Result<Self> {
        let found = fs::metadata(path).ok();
        if let Some(found) = found.as_ref().filter(|found| !found.is_file() || is_descriptor(path)) {
            if found.is_dir() {
                return Err(io::ErrorKind::IsADirectory.into());
            }
            return Ok(Self::Through(OpenOptions::new().append(true).open(path)?));
        }
        let path = without_links(path)?;
        // The error's kind alone, since its full text names a temporary file that the user does not know.
        tempfile::tempfile_in(folder_of(&path)).map_err(|error| io::Error::from(error.kind()))?;
        let permissions = match found {
            Some(found) => {
                OpenOptions::new().write(true).open(&path)?;
                Some(found.permissions())
            }
            None => None,
        };
        let name = path.file_name().ok_or(io::ErrorKind::InvalidFilename)?;
        let identity = match Identity::of(&path) {
            Some(identity) => identity,
            None => Identity::Name(fs::canonicalize(folder_of(&path))?.join(name)),
        };
        Ok(Self::Whole { path, identity, permissions })
    }

    /// Returns the file that would be replaced; `None` if bytes go through.
    pub const fn identity(&self) -> Option<&Identity> {
        match self {
            Self::Through(_) => None,
            Self::Whole { identity, .. } => Some(identity),
        }
    }

    /// True if a file exists whose content is not a `kind` of this program; `own` are the columns of the table that will
    /// replace it.
    pub fn holds_other_than(&self, kind: Kind, own: &[String]) -> io::Result<bool> {
        let Self::Whole { path, .. } = self else { return Ok(false) };
        let mut file = match File::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
            opened => opened?,
        };
        let mut head = Vec::new();
        (&file).take(HEAD).read_to_end(&mut head)?;
        if head.starts_with(b"PAR1") {
            return Ok(!columns_of_ours(file).is_some_and(|names| kind.has_columns(&names, own)));
        }
        if kind == Kind::Summary && head.starts_with(b"[") {
            file.rewind()?;
            return Ok(!is_rows_of_ours(BufReader::new(file), own));
        }
        Ok(!head.is_empty() && !kind.wrote(&String::from_utf8_lossy(&head), own))
    }

    /// Writes content, and returns the unfinished file that will replace the old one; `None` if bytes go through.
    pub fn fill(&self, content: &[u8]) -> io::Result<Option<Unfinished>> {
        let (mut file, unfinished) = self.begin()?;
        file.write_all(content)?;
        Ok(unfinished)
    }

    /// Opens a file to be written piece by piece, and returns what later replaces the old one; `None` if bytes go through.
    pub fn begin(&self) -> io::Result<(File, Option<Unfinished>)> {
        match self {
            Self::Through(file) => Ok((file.try_clone()?, None)),
            Self::Whole { path, permissions, .. } => {
                let unfinished = Unfinished::beside(path, permissions.as_ref())?;
                Ok((unfinished.file().try_clone()?, Some(unfinished)))
            }
        }
    }

    /// Opens the file itself, emptied, for output that is visible while it grows.
    pub fn grow(&self) -> io::Result<File> {
        match self {
            Self::Through(file) => file.try_clone(),
            Self::Whole { path, .. } => File::create(path),
        }
    }

    /// Moves a complete file to this place: by a rename, or by a copy from another file system.
    pub fn adopt(&self, draft: &Path) -> io::Result<()> {
        if let Self::Whole { path, permissions, .. } = self {
            permissions.as_ref().map_or(Ok(()), |permissions| fs::set_permissions(draft, permissions.clone()))?;
            File::open(draft)?.sync_all()?;
            match fs::rename(draft, path) {
                Err(error) if error.kind() == io::ErrorKind::CrossesDevices => {}
                renamed => {
                    sync_folder(folder_of(path));
                    return renamed;
                }
            }
        }
        let (mut file, unfinished) = self.begin()?;
        io::copy(&mut File::open(draft)?, &mut file)?;
        publish(unfinished.into_iter().collect()).map_err(|(_, error)| error)
    }
}

/// Returns the names of the columns of a table that this program wrote; `None` for any other file.
fn columns_of_ours(file: File) -> Option<Vec<String>> {
    let reader = SerializedFileReader::new(file).ok()?;
    let metadata = reader.metadata().file_metadata();
    let is_ours = metadata.created_by().is_some_and(is_this_program);
    let name = |field: &TypePtr| field.name().to_owned();
    is_ours.then(|| metadata.schema().get_fields().iter().map(name).collect())
}

/// True if this is JSON of this program: objects that have all these fields and name the program.
fn is_rows_of_ours(json: impl Read, own: &[String]) -> bool {
    let rows: Option<Vec<serde_json::Map<String, Value>>> = serde_json::from_reader(json).ok();
    let is_ours = |row: &serde_json::Map<String, Value>| {
        let made_by = row.get("made_by").and_then(Value::as_str);
        row.len() == own.len() && own.iter().all(|name| row.contains_key(name)) && made_by.is_some_and(is_this_program)
    };
    rows.is_some_and(|rows| rows.iter().all(is_ours))
}

/// True if a path names an open file of this process. A new file in its place would not reach the process that opened it.
fn is_descriptor(path: &Path) -> bool {
    ["/dev/stdout", "/dev/stderr"].iter().any(|name| path == Path::new(name))
        || ["/dev/fd", "/proc/self/fd"].iter().any(|folder| path.starts_with(folder))
}

/// Returns the target of a chain of symbolic links, whether it exists or not.
fn without_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&path) {
            Ok(target) => path = folder_of(&path).join(target),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("too many symbolic links in a row"))
}
