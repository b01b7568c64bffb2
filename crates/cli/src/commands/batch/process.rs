use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Instant;

use super::journal::{Entry, Journal, State};
use super::plan::Job;
use super::scores::Figures;
use crate::args::{BatchArgs, BatchCommand, Format};
use crate::error::CliError;
use crate::input::sha256_of;
use crate::output::{Place, UnfinishedFolder};
use ohmstrain::MADE_BY;

/// Exit code of `evaluate --check` for estimates that are found wanting: there is an output all the same.
const WANTING: i32 = 3;
/// What this program's messages begin with.
const SPEAKER: &str = "ohmstrain: ";

/// Where jobs are done.
pub struct Workshop<'a> {
    args: &'a BatchArgs,
    program: PathBuf,
    places: usize,
    /// For outputs until they are whole; in the folder of outputs, so that taking their place is a change of name.
    drafts: UnfinishedFolder,
    /// Hashes of sensors and priors: many recordings share one.
    shared: Mutex<HashMap<PathBuf, String>>,
}

/// A job of which all inputs have been read once.
pub struct Started<'a> {
    workshop: &'a Workshop<'a>,
    job: &'a Job,
    /// What is known of it so far.
    pub entry: Entry,
}

impl<'a> Workshop<'a> {
    /// With as many places as there are to be processes at a time.
    pub fn new(args: &'a BatchArgs) -> Result<Self, CliError> {
        let failed = |error: io::Error| CliError::Other(format!("cannot start this program anew: {error}"));
        let program = std::env::current_exe().map_err(failed)?;
        let places = args.jobs.or(thread::available_parallelism().ok()).map_or(1, usize::from);
        let drafts =
            UnfinishedFolder::inside(&args.output).map_err(|error| CliError::file("write to", &args.output, &error))?;
        Ok(Self { args, program, places, drafts, shared: Mutex::default() })
    }

    /// Processes at a time.
    pub const fn places(&self) -> usize {
        self.places
    }

    /// Reads the inputs of a job.
    ///
    /// # Errors
    /// The entry of a job whose inputs cannot be read.
    pub fn start<'b>(&'b self, job: &'b Job) -> Result<Started<'b>, Box<Entry>> {
        let mut entry = Entry {
            command: self.args.command.name().to_owned(),
            files: job.files.clone(),
            sensor: job.sensor.clone(),
            flags: job.flags.clone(),
            made_by: MADE_BY.to_owned(),
            output: job.output.clone(),
            ..Entry::default()
        };
        match self.hash_inputs(job, &mut entry) {
            Ok(()) => Ok(Started { workshop: self, job, entry }),
            Err(message) => Err(Box::new(Entry { message, ..entry })),
        }
    }

    fn hash_inputs(&self, job: &Job, entry: &mut Entry) -> Result<(), String> {
        let unreadable = |file: &Path, error: &io::Error| format!("cannot read {}: {error}", file.display());
        for file in &job.files {
            entry.sha256.push(sha256_of(file).map_err(|error| unreadable(file, &error))?);
        }
        let shared = |file: &Option<PathBuf>| {
            let hash = |file: &PathBuf| self.shared_hash(file).map_err(|error| unreadable(file, &error));
            file.as_ref().map(hash).transpose()
        };
        entry.sensor_sha256 = shared(&job.sensor)?;
        entry.prior_sha256 = shared(&job.prior)?;
        Ok(())
    }

    fn shared_hash(&self, path: &Path) -> io::Result<String> {
        let mut known = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(hash) = known.get(path) {
            return Ok(hash.clone());
        }
        let hash = sha256_of(path)?;
        known.insert(path.to_path_buf(), hash.clone());
        Ok(hash)
    }
}

impl Started<'_> {
    /// Does the job, and notes what became of it before its output takes its place.
    ///
    /// # Errors
    /// If the folder of outputs cannot be written.
    pub fn finish(self, journal: &Journal) -> Result<Entry, CliError> {
        let Self { workshop, job, mut entry } = self;
        let start = Instant::now();
        let path = workshop.args.output.join(&job.output);
        let cannot_write = |error: &io::Error| CliError::file("write", &path, error);
        let draft = workshop.drafts.path().join(job.output.to_string_lossy().replace(['/', '\\'], "|"));
        workshop.run(job, &draft, &mut entry).map_err(|error| cannot_write(&error))?;
        entry.seconds = start.elapsed().as_secs_f64();
        if entry.state == State::Done || entry.exit_code == Some(WANTING) {
            entry.output_sha256 = Some(sha256_of(&draft).map_err(|error| cannot_write(&error))?);
            entry.rows = workshop.rows(&draft, &entry);
        }
        journal.note(&entry)?;
        if entry.output_sha256.is_some() {
            path.parent().map_or(Ok(()), fs::create_dir_all).map_err(|error| cannot_write(&error))?;
            Place::of(&path).and_then(|place| place.adopt(&draft)).map_err(|error| cannot_write(&error))?;
        }
        for left in [said_beside(&draft), draft] {
            let _ = fs::remove_file(left);
        }
        Ok(entry)
    }
}

impl Workshop<'_> {
    /// Runs the command to its end; its output is in `draft`.
    fn run(&self, job: &Job, draft: &Path, entry: &mut Entry) -> io::Result<()> {
        let is_calibration = self.args.command == BatchCommand::Calibrate;
        let said = if is_calibration { said_beside(draft) } else { draft.to_path_buf() };
        let mut words = job.arguments(self.args);
        if is_calibration {
            words.splice(1..1, ["-o".to_owned(), draft.display().to_string()]);
        }
        let mut command = Command::new(&self.program);
        command.args(words).stdin(Stdio::null()).stdout(File::create(&said)?).stderr(Stdio::piped());
        if self.places > 1 {
            // Recordings are what is done in parallel.
            command.env("RAYON_NUM_THREADS", "1");
        }
        let mut child = command.spawn()?;
        let mut last = String::new();
        // What is said of a draft holds of what it becomes.
        let (drafted, published) =
            (draft.display().to_string(), self.args.output.join(&job.output).display().to_string());
        for line in child.stderr.take().map(BufReader::new).into_iter().flat_map(BufRead::lines) {
            let line = line?.replace(&drafted, &published);
            let text = line.strip_prefix(SPEAKER).unwrap_or(&line);
            match text.strip_prefix("warning: ") {
                Some(warning) => entry.warnings.push(warning.to_owned()),
                None => text.clone_into(&mut last),
            }
        }
        let status = child.wait()?;
        entry.exit_code = status.code();
        entry.state = if status.success() { State::Done } else { State::Failed };
        if !status.success() {
            let silent = format!("{}: the process ended with {status}", job.name());
            entry.message = if last.is_empty() || entry.exit_code.is_none() { silent } else { last };
        }
        if matches!(self.args.command, BatchCommand::Evaluate | BatchCommand::Calibrate) {
            entry.figures = Figures::of_json(&fs::read(&said)?, self.args.command);
        }
        Ok(())
    }

    /// Rows of an output.
    fn rows(&self, output: &Path, entry: &Entry) -> Option<u64> {
        match (self.args.command, self.args.format) {
            (BatchCommand::Calibrate, _) => None,
            (BatchCommand::Evaluate, _) => entry.figures.rows,
            (_, Format::Csv) => {
                let lines = BufReader::new(File::open(output).ok()?).lines().count() as u64;
                lines.checked_sub(1)
            }
            (_, Format::Parquet) => {
                use parquet::file::reader::{FileReader, SerializedFileReader};
                let reader = SerializedFileReader::new(File::open(output).ok()?).ok()?;
                u64::try_from(reader.metadata().file_metadata().num_rows()).ok()
            }
        }
    }
}

/// What a command prints that writes its output by itself.
fn said_beside(draft: &Path) -> PathBuf {
    let mut name = draft.as_os_str().to_owned();
    name.push(".said");
    name.into()
}
