//! What commands write: stdout, and files.
//!
//! A command claims its files before the work, so that a name that cannot be written costs no time, makes their contents,
//! and publishes all of them at its end. A command that fails leaves the files as they were.

mod kind;
mod place;
mod rows;
mod wide;

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

pub use kind::{IMPORT, Kind, SIMULATE};
use place::{Identity, Place, Prepared};
pub use rows::RowsOut;
pub use wide::{COLUMNS, table, wrapped, wrapped_table};

use crate::error::CliError;
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
    /// As the user calls it.
    path: PathBuf,
    kind: Kind,
    place: Place,
    content: Option<Vec<u8>>,
    /// What was written bit by bit.
    begun: Option<Prepared>,
}

impl Outputs {
    /// The outputs of a command that reads `inputs`. With `force` they replace files of another kind, but never an input.
    pub fn new<'a>(force: bool, inputs: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        let known = |path: &'a PathBuf| Some((path.clone(), Identity::of(path)?));
        let inputs = inputs.into_iter().filter_map(known).collect();
        Self { force, inputs, files: Vec::new(), folders: Vec::new(), published: false }
    }

    /// Makes a folder and the folders above it; those that are new go again, unless something is published.
    pub fn folder(&mut self, path: &Path) -> Result<(), CliError> {
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
        let place = Place::of(path).map_err(|error| match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() && !folder.exists() => {
                CliError::Other(format!("cannot write {}: there is no folder {}", path.display(), folder.display()))
            }
            _ => CliError::file("write", path, &error),
        })?;
        if let Some(identity) = place.identity() {
            let refused = |what: &str, other: &Path| {
                let (path, other) = (path.display(), other.display());
                CliError::Arguments(format!("cannot write {path}: it is {what} {other}; choose another name"))
            };
            if let Some((input, _)) = self.inputs.iter().find(|(_, input)| input == identity) {
                return Err(refused("the input", input));
            }
            if let Some(other) = self.files.iter().find(|file| file.place.identity() == Some(identity)) {
                return Err(refused("the output", &other.path));
            }
        }
        let claimed = Claimed { path: path.to_path_buf(), kind, place, content: None, begun: None };
        self.check_kind(&claimed)?;
        self.files.push(claimed);
        Ok(Claim(self.files.len() - 1))
    }

    fn check_kind(&self, file: &Claimed) -> Result<(), CliError> {
        let foreign =
            file.place.holds_other_than(file.kind).map_err(|error| CliError::file("read", &file.path, &error))?;
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

    /// A file to write bit by bit: it is published with the others, or, if it `grows`, is seen while it is written.
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

    /// Publishes this content of a file; prints it if none was claimed.
    pub fn publish_or_print(mut self, claim: Option<Claim>, content: Vec<u8>) -> Result<(), CliError> {
        match claim {
            Some(claim) => {
                self.put(claim, content);
                self.publish()
            }
            None => print(|out| Ok(out.write_all(&content)?)),
        }
    }

    /// Writes all that was put: each file whole, and nothing before everything lies ready beside its place.
    pub fn publish(mut self) -> Result<(), CliError> {
        let mut ready = Vec::new();
        for file in self.files.iter().filter(|file| file.content.is_some() || file.begun.is_some()) {
            self.check_kind(file)?;
        }
        for file in &mut self.files {
            let prepared = match (file.begun.take(), &file.content) {
                (Some(begun), _) => begun,
                (None, Some(content)) => {
                    file.place.prepare(content).map_err(|error| CliError::file("write", &file.path, &error))?
                }
                (None, None) => continue,
            };
            ready.push((file.path.clone(), prepared));
        }
        // A device may still fail; taking a place hardly does.
        ready.sort_by_key(|(_, prepared)| !prepared.may_fail());
        for (path, prepared) in ready {
            prepared.publish().map_err(|error| CliError::file("write", &path, &error))?;
            self.published = true;
        }
        Ok(())
    }
}

impl Drop for Outputs {
    fn drop(&mut self) {
        if !self.published {
            // One that somebody has put something into meanwhile stays.
            self.folders.iter().rev().for_each(|folder| drop(fs::remove_dir(folder)));
        }
    }
}

/// Writes an object as JSON. `schema` is the version of what it has: names are added without another version; one that
/// goes or changes its meaning brings the next.
pub fn json(out: &mut dyn Write, schema: u32, content: &impl Serialize) -> Result<(), CliError> {
    #[derive(Serialize)]
    struct Versioned<'a, T> {
        schema: u32,
        /// Program and version.
        made_by: &'static str,
        #[serde(flatten)]
        content: &'a T,
    }
    let all = Versioned { schema, made_by: MADE_BY, content };
    serde_json::to_writer_pretty(&mut *out, &all).map_err(io::Error::from)?;
    Ok(writeln!(out)?)
}

/// Writes to stdout.
pub fn print(fill: impl FnOnce(&mut dyn Write) -> Result<(), CliError>) -> Result<(), CliError> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    fill(&mut out)?;
    Ok(out.flush()?)
}
