use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use serde::{Deserialize, Serialize};

use super::scores::Figures;
use crate::error::CliError;
use crate::input::sha256_of;
use crate::output::is_this_program;
use crate::whole_file;

/// Result of a job: a line of the journal, a row of the summary.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Entry {
    pub command: String,
    pub files: Vec<PathBuf>,
    /// SHA-256 of each.
    pub sha256: Vec<String>,
    pub sensor: Option<PathBuf>,
    pub sensor_sha256: Option<String>,
    /// SHA-256 of the file that `--prior` among the flags names.
    pub prior_sha256: Option<String>,
    /// SHA-256 of each file that `--marks` among the flags names.
    #[serde(default)]
    pub marks_sha256: Vec<String>,
    /// Flags other than `--sensor` and those that `batch` adds.
    pub flags: Vec<String>,
    /// Name and version of the program.
    pub made_by: String,
    /// Path below the folder of outputs.
    pub output: PathBuf,
    pub output_sha256: Option<String>,
    pub state: State,
    /// Exit code of the command; `None` if the command did not run.
    pub exit_code: Option<i32>,
    /// Reason for its failure.
    pub message: String,
    pub warnings: Vec<String>,
    /// Rows of the output's table, or rows that were scored.
    pub rows: Option<u64>,
    pub seconds: f64,
    pub figures: Figures,
}

/// State of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// The output was written.
    Done,
    /// The output had been written by an earlier run.
    Kept,
    /// No output, or one that failed `evaluate --check`.
    #[default]
    Failed,
}

impl State {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Kept => "kept",
            Self::Failed => "failed",
        }
    }
}

impl Entry {
    /// True if two entries are of the same work: the same program, command, flags and bytes.
    fn is_same_work(&self, other: &Self) -> bool {
        let work = |of: &Self| {
            let names: Vec<_> = of.files.iter().filter_map(|file| file.file_name()).map(ToOwned::to_owned).collect();
            (of.command.clone(), of.flags.clone(), of.made_by.clone(), names)
        };
        let beside = |of: &Self| (of.sensor_sha256.clone(), of.prior_sha256.clone(), of.marks_sha256.clone());
        let bytes = |of: &Self| (of.sha256.clone(), beside(of));
        work(self) == work(other) && bytes(self) == bytes(other)
    }
}

/// Journal of the jobs of earlier runs and of this one: one line of JSON per job. The last line of an output counts.
pub struct Journal {
    folder: PathBuf,
    known: HashMap<PathBuf, Entry>,
    file: Mutex<File>,
}

/// Its name.
pub const JOURNAL: &str = "batch.jsonl";

impl Journal {
    /// Reads the journal of a folder, or begins one. A file of this name that another program wrote is replaced only with
    /// `force`.
    pub fn open(folder: &Path, force: bool) -> Result<Self, CliError> {
        let path = folder.join(JOURNAL);
        let bytes = if path.exists() { whole_file::bytes(&path)? } else { Vec::new() };
        let mut text = String::from_utf8_lossy(&bytes).into_owned();
        if !is_ours(&text) {
            if !force {
                return Err(CliError::Arguments(format!(
                    "cannot write {}: no earlier run wrote what is there; choose another folder, or replace it with --force",
                    path.display()
                )));
            }
            fs::write(&path, "").map_err(|error| CliError::file("write", &path, &error))?;
            text.clear();
        }
        // A line that a killed run left unfinished, or that another version wrote, is ignored.
        let entries = text.lines().filter_map(|line| serde_json::from_str::<Entry>(line).ok());
        let known = entries.map(|entry| (entry.output.clone(), entry)).collect();
        let opened = OpenOptions::new().create(true).append(true).open(&path);
        let mut file = opened.map_err(|error| CliError::file("write", &path, &error))?;
        if !text.is_empty() && !text.ends_with('\n') {
            file.write_all(b"\n")?;
        }
        Ok(Self { folder: folder.to_path_buf(), known, file: Mutex::new(file) })
    }

    /// True if an earlier run wrote this output.
    pub fn knows(&self, output: &Path) -> bool {
        self.known.contains_key(output)
    }

    /// Returns an earlier run's entry of the same work, if its output is still there.
    pub fn finished(&self, work: &Entry) -> Option<Entry> {
        let known = self.known.get(&work.output)?;
        let is_there = || sha256_of(&self.folder.join(&known.output)).ok() == known.output_sha256;
        let is_done = known.state == State::Done && known.is_same_work(work) && is_there();
        is_done.then(|| known.clone())
    }

    /// Appends the result of a job, at once.
    pub fn note(&self, entry: &Entry) -> Result<(), CliError> {
        let mut line = serde_json::to_vec(entry).map_err(|error| CliError::Other(error.to_string()))?;
        line.push(b'\n');
        let path = self.folder.join(JOURNAL);
        let mut file = self.file.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        file.write_all(&line).and_then(|()| file.sync_data()).map_err(|error| CliError::file("write", &path, &error))
    }
}

/// True if a journal begins with a line of this program, or with as much of one as a killed run wrote.
fn is_ours(text: &str) -> bool {
    let (first, is_whole) = text.split_once('\n').map_or((text, false), |(first, _)| (first, true));
    let made_by = |line: serde_json::Value| line.get("made_by")?.as_str().map(is_this_program);
    match serde_json::from_str(first) {
        Ok(line) => made_by(line) == Some(true),
        Err(_) => first.is_empty() || (!is_whole && first.starts_with("{\"command\":\"")),
    }
}
