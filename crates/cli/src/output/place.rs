use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

use super::Kind;

/// A file as the system knows it, whatever it is called.
#[derive(Debug, PartialEq, Eq)]
pub enum Identity {
    /// Device and number of a file that is there.
    #[cfg(unix)]
    Number(u64, u64),
    /// Its one name without links.
    Name(PathBuf),
}

impl Identity {
    /// Of a file that is there.
    #[cfg(unix)]
    pub fn of(path: &Path) -> Option<Self> {
        use std::os::unix::fs::MetadataExt;
        let found = fs::metadata(path).ok()?;
        Some(Self::Number(found.dev(), found.ino()))
    }

    /// Of a file that is there.
    #[cfg(not(unix))]
    pub fn of(path: &Path) -> Option<Self> {
        Some(Self::Name(fs::canonicalize(path).ok()?))
    }
}

/// Where an output goes.
pub enum Place {
    /// Into what stands there and takes bytes: a device, a pipe, an open file of this process.
    Through(File),
    /// To a file, whole: into a temporary neighbour that then takes its place.
    Whole {
        /// Without symbolic links: they stay, what they point to is written.
        path: PathBuf,
        identity: Identity,
        /// Of the file that is there.
        permissions: Option<Permissions>,
    },
}

/// Symbolic links in a row; the system follows as many.
const MOST_LINKS: usize = 40;

/// Bytes that tell what a file is.
const HEAD: u64 = 4096;

impl Place {
    /// Looks whether `path` can be written, and leaves it as it is.
    pub fn of(path: &Path) -> io::Result<Self> {
        let found = fs::metadata(path).ok();
        if let Some(found) = found.as_ref().filter(|found| !found.is_file() || is_descriptor(path)) {
            if found.is_dir() {
                return Err(io::ErrorKind::IsADirectory.into());
            }
            return Ok(Self::Through(OpenOptions::new().append(true).open(path)?));
        }
        let path = without_links(path)?;
        // The kind alone: the full text names the temporary neighbour, which nobody asked for. This one has no name.
        tempfile::tempfile_in(folder(&path)).map_err(|error| io::Error::from(error.kind()))?;
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
            None => Identity::Name(fs::canonicalize(folder(&path))?.join(name)),
        };
        Ok(Self::Whole { path, identity, permissions })
    }

    /// Which file would be replaced; none is where bytes go through.
    pub const fn identity(&self) -> Option<&Identity> {
        match self {
            Self::Through(_) => None,
            Self::Whole { identity, .. } => Some(identity),
        }
    }

    /// Whether there is a file with content that is not a `kind` of this program.
    pub fn holds_other_than(&self, kind: Kind) -> io::Result<bool> {
        let Self::Whole { path, .. } = self else { return Ok(false) };
        let file = match File::open(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
            opened => opened?,
        };
        let mut head = Vec::new();
        (&file).take(HEAD).read_to_end(&mut head)?;
        if head.starts_with(b"PAR1") {
            // Parquet says at its end who wrote it.
            (&file).seek(SeekFrom::Start(file.metadata()?.len().saturating_sub(HEAD)))?;
            (&file).take(HEAD).read_to_end(&mut head)?;
        }
        Ok(!head.is_empty() && !kind.wrote(&String::from_utf8_lossy(&head)))
    }

    /// Writes `content` beside the place.
    pub fn prepare(&self, content: &[u8]) -> io::Result<Prepared> {
        match self {
            Self::Through(file) => Ok(Prepared::Through(file.try_clone()?, content.to_vec())),
            Self::Whole { path, permissions, .. } => {
                let mut file = neighbour(path, permissions.as_ref())?;
                file.write_all(content)?;
                Ok(Prepared::Whole(file, path.clone()))
            }
        }
    }

    /// A file to write bit by bit, and what then puts it in its place; nothing where bytes go through.
    pub fn begin(&self) -> io::Result<(File, Option<Prepared>)> {
        match self {
            Self::Through(file) => Ok((file.try_clone()?, None)),
            Self::Whole { path, permissions, .. } => {
                let file = neighbour(path, permissions.as_ref())?;
                Ok((file.as_file().try_clone()?, Some(Prepared::Whole(file, path.clone()))))
            }
        }
    }

    /// The file itself, emptied, for what is to be seen as it grows.
    pub fn grow(&self) -> io::Result<File> {
        match self {
            Self::Through(file) => file.try_clone(),
            Self::Whole { path, .. } => File::create(path),
        }
    }
}

/// An output that lies ready.
pub enum Prepared {
    Through(File, Vec<u8>),
    Whole(NamedTempFile, PathBuf),
}

impl Prepared {
    /// Whether publishing it is more than a change of name.
    pub const fn may_fail(&self) -> bool {
        matches!(self, Self::Through(..))
    }

    /// Puts it in its place.
    pub fn publish(self) -> io::Result<()> {
        match self {
            Self::Through(mut file, content) => file.write_all(&content),
            Self::Whole(file, path) => file.persist(path).map(drop).map_err(|error| error.error),
        }
    }
}

/// A temporary file beside `path`, which is to take its place.
fn neighbour(path: &Path, permissions: Option<&Permissions>) -> io::Result<NamedTempFile> {
    let file = new_file(&mut Builder::new()).tempfile_in(folder(path)).map_err(|error| error.kind())?;
    if let Some(permissions) = permissions {
        file.as_file().set_permissions(permissions.clone())?;
    }
    Ok(file)
}

/// A temporary file is private; a result is as readable as the user's umask lets new files be.
#[cfg(unix)]
fn new_file<'a, 'b>(builder: &'a mut Builder<'b, 'b>) -> &'a mut Builder<'b, 'b> {
    use std::os::unix::fs::PermissionsExt;
    builder.permissions(Permissions::from_mode(0o666))
}

#[cfg(not(unix))]
fn new_file<'a, 'b>(builder: &'a mut Builder<'b, 'b>) -> &'a mut Builder<'b, 'b> {
    builder
}

/// Whether a path names an open file of this process: a new file in its place would not reach whoever opened it.
fn is_descriptor(path: &Path) -> bool {
    ["/dev/stdout", "/dev/stderr"].iter().any(|name| path == Path::new(name))
        || ["/dev/fd", "/proc/self/fd"].iter().any(|folder| path.starts_with(folder))
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// What a chain of symbolic links points to, be it there or not.
fn without_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&path) {
            Ok(target) => path = folder(&path).join(target),
            Err(_) => return Ok(path),
        }
    }
    Err(io::Error::other("too many symbolic links in a row"))
}
