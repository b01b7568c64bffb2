//! Unfinished outputs: files and folders beside their places, under names of this program's own, each locked by its writer.
//!
//! An interrupt (SIGINT) or a termination request (SIGTERM) removes them. Leftovers of a killed process or a power cut are
//! recognised by their name and by an unheld lock: the next output in the same folder removes them.

use std::fs::{self, File, Permissions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{Builder, NamedTempFile, TempDir};

/// Prefix of their names.
const PREFIX: &str = ".ohmstrain-";
/// Suffix of files; that of folders follows.
const FILE: &str = ".part";
const FOLDER: &str = ".parts";
/// Name of the locked file in such a folder.
const LOCK: &str = "lock";

/// Unfinished files of this process. Names of finished ones stay in the list, and are not used again.
static BEGUN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn begun() -> MutexGuard<'static, Vec<PathBuf>> {
    BEGUN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An unfinished file, which will take its place.
pub struct Unfinished {
    file: NamedTempFile,
    place: PathBuf,
}

impl Unfinished {
    /// Creates an empty file beside its place, with the permissions of the existing file.
    pub fn beside(place: &Path, permissions: Option<&Permissions>) -> io::Result<Self> {
        let folder = folder_of(place);
        prepare(folder);
        loop {
            let mut begun = begun();
            // The error's kind alone, since its full text names a temporary file that the user does not know.
            let named = new_file(Builder::new().prefix(PREFIX).suffix(FILE)).tempfile_in(folder);
            let file = named.map_err(|error| io::Error::from(error.kind()))?;
            begun.push(file.path().to_path_buf());
            drop(begun);
            if hold(file.as_file(), file.path()) {
                permissions.map_or(Ok(()), |permissions| file.as_file().set_permissions(permissions.clone()))?;
                return Ok(Self { file, place: place.to_path_buf() });
            }
        }
    }

    /// Returns the file to write to.
    pub fn file(&self) -> &File {
        self.file.as_file()
    }
}

/// Publishes all files once their contents are on the disk; a signal takes effect before or after that.
///
/// # Errors
/// The place that could not be taken, and the reason.
pub fn publish(all: Vec<Unfinished>) -> Result<(), (PathBuf, io::Error)> {
    for Unfinished { file, place } in &all {
        file.as_file().sync_all().map_err(|error| (place.clone(), error))?;
    }
    let begun = begun();
    for Unfinished { file, place } in all {
        file.persist(&place).map_err(|error| (place.clone(), error.error))?;
        sync_folder(folder_of(&place));
    }
    drop(begun);
    Ok(())
}

/// Waits until the names in a folder are on the disk. Some file systems do not support it.
pub fn sync_folder(folder: &Path) {
    if cfg!(unix) {
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
}

/// A folder for unfinished files, which is removed when it is dropped.
pub struct UnfinishedFolder {
    folder: TempDir,
    _lock: File,
}

impl UnfinishedFolder {
    /// Creates an empty folder in another one.
    pub fn inside(parent: &Path) -> io::Result<Self> {
        prepare(parent);
        loop {
            let mut begun = begun();
            let folder = Builder::new().prefix(PREFIX).suffix(FOLDER).tempdir_in(parent)?;
            begun.push(folder.path().to_path_buf());
            drop(begun);
            match File::create(folder.path().join(LOCK)) {
                Ok(lock) if hold(&lock, folder.path()) => return Ok(Self { folder, _lock: lock }),
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
    }

    /// Returns its path.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Locks a new file; returns `false` if another process has taken it for a leftover. Some file systems have no locks; no
/// leftovers are removed there.
fn hold(lock: &File, path: &Path) -> bool {
    lock.lock().is_err() || path.exists()
}

/// Prepares the first output in a folder: removes the remains of processes that have ended.
fn prepare(folder: &Path) {
    handle_signals();
    if begun().iter().any(|path| folder_of(path) == folder) {
        return;
    }
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        let Some(rest) = name.to_str().and_then(|name| name.strip_prefix(PREFIX)) else { continue };
        let is_dir = entry.file_type().is_ok_and(|kind| kind.is_dir());
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        let lock = match rest {
            _ if is_file && rest.ends_with(FILE) => File::open(&path),
            _ if is_dir && rest.ends_with(FOLDER) => File::create(path.join(LOCK)),
            _ => continue,
        };
        // The lock is held until the leftover is removed.
        if lock.as_ref().is_ok_and(|lock| lock.try_lock().is_ok()) {
            let _ = if is_dir { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
        }
    }
}

/// Removes the unfinished outputs when a signal ends the process, and then lets the signal take its usual effect.
#[cfg(unix)]
fn handle_signals() {
    use std::sync::Once;

    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    static INSTALLED: Once = Once::new();
    INSTALLED.call_once(|| {
        let ignored = ignored_signals();
        let wanted = [SIGINT, SIGTERM].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
        let Ok(mut signals) = Signals::new(wanted) else { return };
        std::thread::spawn(move || {
            for signal in signals.forever() {
                let begun = begun();
                for path in begun.iter() {
                    let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
                }
                let _ = emulate_default_handler(signal);
            }
        });
    });
}

#[cfg(not(unix))]
const fn handle_signals() {}

/// Returns the signals that the parent process has set to be ignored, one bit each, if the system lists them.
#[cfg(unix)]
fn ignored_signals() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

/// Gives new files the permissions of the user's umask, since temporary files are private.
#[cfg(unix)]
fn new_file<'a, 'b>(builder: &'a mut Builder<'b, 'b>) -> &'a mut Builder<'b, 'b> {
    use std::os::unix::fs::PermissionsExt;
    builder.permissions(Permissions::from_mode(0o666))
}

#[cfg(not(unix))]
const fn new_file<'a, 'b>(builder: &'a mut Builder<'b, 'b>) -> &'a mut Builder<'b, 'b> {
    builder
}

/// Returns the folder of a file.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}
