//! Output of commands: stdout, and files.
//!
//! A command claims its files before the work, so that an unusable name costs no time. Then it produces their contents, and
//! publishes all of them at its end. A command that fails leaves the files as they were.

mod kind;
mod place;
mod rows;
mod unfinished;
mod wide;

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

pub use kind::{IMPORT, Kind, MANUAL, SIMULATE, is_of_a_hand, is_this_program};
use place::Identity;
pub use place::{Destination, HEAD};
pub use rows::{RowsOut, append_whole};
use unfinished::Unfinished;
pub use unfinished::UnfinishedFolder;
pub use wide::{COLUMNS, named, table, wrapped, wrapped_table};

use crate::error::CliError;
use crate::printable::{printable_json, printable_lines};
use crate::whole_file::is_stdin;
use ohmstrain::MADE_BY;

/// The files that a command writes.
pub struct Outputs {
    force: bool,
    inputs: Vec<(PathBuf, Identity)>,
    files: Vec<Claimed>,
    /// Folders made for them, outermost first.
    folders: Vec<PathBuf>,
    published: bool,
}

/// A file that has been claimed.
#[derive(Clone, Copy)]
pub struct Claim(usize);

struct Claimed {
    /// Path as the user wrote it.
    path: PathBuf,
    kind: Kind,
    /// Columns of a table.
    columns: Vec<String>,
    place: Destination,
    content: Option<Vec<u8>>,
    /// File that was written bit by bit.
    begun: Option<Unfinished>,
}

impl Outputs {
    /// Creates the outputs of a command that reads `inputs`. With `force` they replace files of other kinds, but never an
    /// input.
    pub fn new<'a>(force: bool, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        // Standard input may be one of the files: `filter -o trace.csv < trace.csv`.
        let opened = |path: &'a PathBuf| if is_stdin(path) { Path::new("/dev/stdin") } else { path.as_path() };
        let known = |path: &'a PathBuf| Some((path.clone(), Identity::of(opened(path))?));
        let inputs = inputs.into_iter().filter_map(known).collect();
        Self { force, inputs, files: Vec::new(), folders: Vec::new(), published: false }
    }

    /// Creates a folder and its parents; new folders are removed again unless something is published.
    ///
    /// # Errors
    /// If a folder cannot be created.
    pub fn folder(&mut self, path: &Path) -> Result<(), CliError> {
        refuse_stdout(path)?;
        let is_new = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let mut new: Vec<PathBuf> = path.ancestors().take_while(is_new).map(Path::to_path_buf).collect();
        new.reverse();
        self.folders.extend(new);
        fs::create_dir_all(path).map_err(|error| CliError::file("make the folder", path, &error))
    }

    /// Claims a file.
    ///
    /// # Errors
    /// If it cannot be written, is an input or another output, or holds something that this program did not write.
    pub fn claim(&mut self, path: &Path, kind: Kind) -> Result<Claim, CliError> {
        self.claim_table(path, kind, &[])
    }

    /// Claims a file; `None` if there is no path, or if `-` stands for stdout.
    ///
    /// # Errors
    /// As [`Outputs::claim`].
    pub fn claim_or_stdout(&mut self, path: Option<&Path>, kind: Kind) -> Result<Option<Claim>, CliError> {
        path.filter(|path| !is_stdout(path)).map(|path| self.claim(path, kind)).transpose()
    }

    /// Claims a file for a table with these columns; an existing table with the same columns counts as this program's.
    ///
    /// # Errors
    /// As [`Outputs::claim`].
    pub fn claim_table(&mut self, path: &Path, kind: Kind, columns: &[String]) -> Result<Claim, CliError> {
        refuse_stdout(path)?;
        let place = Destination::of(path).map_err(|error| match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() && !folder.exists() => {
                CliError::Other(format!("cannot write {}: there is no folder {}", path.display(), folder.display()))
            }
            _ => CliError::file("write", path, &error),
        })?;
        if let Some(identity) = place.identity() {
            self.refuse_identity(path, identity)?;
            if let Some(other) = self.files.iter().find(|file| file.place.identity() == Some(identity)) {
                return Err(is_another(path, "the output", &other.path));
            }
        }
        let (path, columns) = (path.to_path_buf(), columns.to_vec());
        let claimed = Claimed { path, kind, columns, place, content: None, begun: None };
        self.check_kind(&claimed)?;
        self.files.push(claimed);
        Ok(Claim(self.files.len() - 1))
    }

    /// Refuses a file that is an input.
    ///
    /// # Errors
    /// If it is one.
    pub fn refuse_input(&self, path: &Path) -> Result<(), CliError> {
        Identity::of(path).map_or(Ok(()), |identity| self.refuse_identity(path, &identity))
    }

    fn refuse_identity(&self, path: &Path, identity: &Identity) -> Result<(), CliError> {
        match self.inputs.iter().find(|(_, input)| input == identity) {
            Some((input, _)) => Err(is_another(path, "the input", input)),
            None => Ok(()),
        }
    }

    fn check_kind(&self, file: &Claimed) -> Result<(), CliError> {
        let foreign = file.place.holds_other_than(file.kind, &file.columns);
        let foreign = foreign.map_err(|error| CliError::file("read", &file.path, &error))?;
        if foreign && !self.force {
            let (path, kind) = (file.path.display(), file.kind.name());
            return Err(CliError::Arguments(format!(
                "cannot write {path}: it holds something else than {kind} of this program; choose another name, or \
                 replace it with --force"
            )));
        }
        Ok(())
    }

    /// Keeps the content of a file until it is published.
    pub fn put(&mut self, claim: Claim, content: impl Into<Vec<u8>>) {
        if let Some(file) = self.files.get_mut(claim.0) {
            file.content = Some(content.into());
        }
    }

    /// Opens a file that is written piece by piece. It is published with the others, or, if it `grows`, is visible while it is
    /// written.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn open(&mut self, claim: Claim, grows: bool) -> Result<(fs::File, PathBuf), CliError> {
        let Some(claimed) = self.files.get_mut(claim.0) else {
            return Err(CliError::Other("an output was not claimed".into()));
        };
        let opened = if grows { claimed.place.grow().map(|file| (file, None)) } else { claimed.place.begin() };
        let (file, begun) = opened.map_err(|error| CliError::file("write", &claimed.path, &error))?;
        claimed.begun = begun;
        Ok((file, claimed.path.clone()))
    }

    /// Publishes the content of one file, or prints it if none was claimed.
    pub fn publish_or_print(mut self, claim: Option<Claim>, content: Vec<u8>) -> Result<(), CliError> {
        match claim {
            Some(claim) => {
                self.put(claim, content);
                self.publish()
            }
            None => print_data(&content),
        }
    }

    /// Publishes all contents: each file as a whole, and none before all are complete beside their places.
    pub fn publish(mut self) -> Result<(), CliError> {
        for file in self.files.iter().filter(|file| file.content.is_some() || file.begun.is_some()) {
            self.check_kind(file)?;
        }
        let mut whole = Vec::new();
        // Devices come last, just before the renames: writing to them may still fail, a rename hardly does.
        self.files.sort_by_key(|file| matches!(file.place, Destination::Through(_)));
        for file in &mut self.files {
            if let Some(content) = file.content.take() {
                let begun = file.place.fill(&content);
                file.begun = begun.map_err(|error| CliError::file("write", &file.path, &error))?;
            }
            whole.extend(file.begun.take());
        }
        unfinished::publish(whole).map_err(|(path, error)| CliError::file("write", &path, &error))?;
        self.published = true;
        Ok(())
    }
}

impl Drop for Outputs {
    fn drop(&mut self) {
        if !self.published {
            // A folder that somebody else has put a file into stays.
            self.folders.iter().rev().for_each(|folder| drop(fs::remove_dir(folder)));
        }
    }
}

/// Returns the error of an output that is also another file of the command.
fn is_another(path: &Path, what: &str, other: &Path) -> CliError {
    let (path, other) = (path.display(), other.display());
    CliError::Arguments(format!("cannot write {path}: it is {what} {other}; choose another name"))
}

/// True if a path means stdout.
pub fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

/// Refuses `-` where a file or a folder is written.
pub fn refuse_stdout(path: &Path) -> Result<(), CliError> {
    if is_stdout(path) {
        let what = "cannot write -: expected a file or a folder, found -, which means stdout; one of this name is ./-";
        return Err(CliError::Arguments(what.into()));
    }
    Ok(())
}

/// Writes an object as JSON. `schema` is the version of its fields: a new field keeps the version; a field that disappears or
/// changes its meaning increases it.
pub fn json(out: &mut dyn Write, schema: u32, content: &impl Serialize) -> Result<(), CliError> {
    #[derive(Serialize)]
    struct Versioned<'a, T> {
        schema: u32,
        /// Name and version of the program.
        made_by: &'static str,
        #[serde(flatten)]
        content: &'a T,
    }
    let all = Versioned { schema, made_by: MADE_BY, content };
    let text = serde_json::to_string_pretty(&all).map_err(io::Error::from)?;
    Ok(writeln!(out, "{}", printable_json(&text))?)
}

/// Writes text for people to stdout, in printable form.
pub fn print(fill: impl FnOnce(&mut dyn Write) -> Result<(), CliError>) -> Result<(), CliError> {
    let mut text = Vec::new();
    fill(&mut text)?;
    print_data(printable_lines(&String::from_utf8_lossy(&text)).as_bytes())
}

/// Writes data to stdout, unchanged.
pub fn print_data(data: &[u8]) -> Result<(), CliError> {
    let mut out = io::stdout().lock();
    out.write_all(data)?;
    Ok(out.flush()?)
}
