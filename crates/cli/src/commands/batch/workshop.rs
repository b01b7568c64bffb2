use std::any::Any;
use std::collections::HashMap;
use std::fs;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use super::journal::{Entry, Journal, State};
use super::plan::Job;
use super::scores::Figures;
use crate::args::{BatchArgs, Command, name_of};
use crate::channels::Table;
use crate::commands::evaluate::{self, Evaluation};
use crate::commands::hand::{self, description};
use crate::commands::{calibrate, filter, smooth};
use crate::error::CliError;
use crate::input::{sha256_of, sha256_of_all};
use crate::messages::Messages;
use crate::output::{Destination, UnfinishedFolder};
use crate::printable::printable;
use crate::sensor_file;
use ohmstrain::MADE_BY;

/// Exit code of a job that panicked.
const PANICKED: u8 = 101;

/// Folder and settings in which jobs are done.
pub struct Workshop<'a> {
    args: &'a BatchArgs,
    /// Folder of unfinished outputs. It lies in the folder of outputs, so that publishing a file is a rename.
    drafts: UnfinishedFolder,
    /// Number of drafts so far, which are their names: a path could be too long for one name.
    drafted: AtomicUsize,
    /// Hashes of sensors and priors, which many recordings share.
    shared: Mutex<HashMap<PathBuf, String>>,
}

impl<'a> Workshop<'a> {
    /// Creates the workshop in the folder of outputs.
    pub fn new(args: &'a BatchArgs) -> Result<Self, CliError> {
        let drafts =
            UnfinishedFolder::inside(&args.output).map_err(|error| CliError::file("write to", &args.output, &error))?;
        Ok(Self { args, drafts, drafted: AtomicUsize::new(0), shared: Mutex::default() })
    }

    /// Returns the entry of a job before it runs.
    pub fn entry(&self, job: &Job) -> Entry {
        Entry {
            command: name_of(self.args.command),
            files: job.files.clone(),
            sensor: job.sensor.clone(),
            flags: job.flags.clone(),
            made_by: MADE_BY.to_owned(),
            output: job.output.clone(),
            ..Entry::default()
        }
    }

    /// Adds the hashes of all inputs.
    ///
    /// # Errors
    /// The input that cannot be read.
    pub fn hash_inputs(&self, job: &Job, entry: &mut Entry) -> Result<(), String> {
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
        for file in &job.marks {
            entry.marks_sha256.push(sha256_of(file).map_err(|error| unreadable(file, &error))?);
        }
        Ok(())
    }

    /// Returns the hash of a sensor, a prior or a hand; that of a hand covers its sensors and fusions.
    fn shared_hash(&self, path: &Path) -> io::Result<String> {
        let mut known = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(hash) = known.get(path) {
            return Ok(hash.clone());
        }
        let hand = sensor_file::is_of_a_hand(path).then(|| description::read(path).ok()).flatten();
        let hash = match hand {
            Some(hand) => sha256_of_all(&hand.files(path))?,
            None => sha256_of(path)?,
        };
        known.insert(path.to_path_buf(), hash.clone());
        Ok(hash)
    }

    /// Runs the job, and records its result before the output is published.
    ///
    /// # Errors
    /// If the folder of outputs cannot be written.
    pub fn finish(&self, job: &Job, entry: &mut Entry, journal: &Journal) -> Result<(), CliError> {
        let start = Instant::now();
        let path = self.args.output.join(&job.output);
        let cannot_write = |error: &io::Error| CliError::file("write", &path, error);
        let number = self.drafted.fetch_add(1, Ordering::Relaxed);
        let draft =
            self.drafts.path().join(number.to_string()).with_extension(job.output.extension().unwrap_or_default());
        self.run(job, &draft, entry);
        entry.seconds = start.elapsed().as_secs_f64();
        // `evaluate --check` writes its output even if it fails.
        let wanting = CliError::Check(String::new()).code();
        if entry.state == State::Done || entry.exit_code == Some(wanting.into()) {
            entry.output_sha256 = Some(sha256_of(&draft).map_err(|error| cannot_write(&error))?);
        }
        journal.note(entry)?;
        if entry.output_sha256.is_some() {
            path.parent().map_or(Ok(()), fs::create_dir_all).map_err(|error| cannot_write(&error))?;
            Destination::of(&path).and_then(|place| place.adopt(&draft)).map_err(|error| cannot_write(&error))?;
        }
        let _ = fs::remove_file(draft);
        Ok(())
    }

    /// Runs the command to its end, with its output in `draft`.
    fn run(&self, job: &Job, draft: &Path, entry: &mut Entry) {
        // Messages name the published output instead of the draft.
        let (drafted, published) =
            (draft.display().to_string(), self.args.output.join(&job.output).display().to_string());
        let displayed = |text: &str| printable(text).replace(&drafted, &published);
        let parsed = match job.parsed(self.args) {
            Ok(parsed) => parsed,
            Err(error) => return entry.message = displayed(&error.to_string()),
        };
        let messages = Messages::kept(parsed.verbosity());
        let done = catch_unwind(AssertUnwindSafe(|| run_command(parsed.command, draft, entry, &messages)));
        entry.warnings = messages.into_warnings().iter().map(|warning| displayed(warning)).collect();
        let (code, message) = match done {
            Ok(Ok(())) => (0, String::new()),
            Ok(Err(error)) => (error.code(), displayed(&error.to_string())),
            Err(panic) => (PANICKED, displayed(&format!("{}: a bug: {}", job.name(), text_of(panic.as_ref())))),
        };
        (entry.exit_code, entry.message) = (Some(code.into()), message);
        entry.state = if code == 0 { State::Done } else { State::Failed };
    }
}

/// Runs a command whose output goes to `draft`.
fn run_command(command: Command, draft: &Path, entry: &mut Entry, messages: &Messages) -> Result<(), CliError> {
    match command {
        Command::Filter(mut args) => {
            args.written.output = Some(draft.to_path_buf());
            entry.rows = Some(filter::run(&args, messages)?);
        }
        Command::Smooth(mut args) => {
            args.written.output = Some(draft.to_path_buf());
            entry.rows = Some(smooth::run(&args, messages)?);
        }
        Command::Hand(mut args) => {
            args.output = Some(draft.to_path_buf());
            entry.rows = Some(hand::run(&args, messages)?);
        }
        Command::Evaluate(args)
            if args.calibration.sensor.as_ref().is_some_and(|path| sensor_file::is_of_a_hand(path)) =>
        {
            let hand = args.calibration.sensor.clone().unwrap_or_default();
            hand::evaluate::run(&args, &hand, |name, scores| {
                entry.figures = scores.first().map(Figures::of_joint).unwrap_or_default();
                entry.rows = entry.figures.rows;
                let mut text = Vec::new();
                hand::scores::write(&mut text, name, &scores, args.json)?;
                fs::write(draft, text).map_err(|error| CliError::file("write", draft, &error))
            })?;
        }
        Command::Evaluate(args) => {
            let mut evaluation = Evaluation::default();
            let judged = evaluate::evaluate(&args, messages, &mut evaluation, |evaluation| {
                let mut text = Vec::new();
                evaluation.write(&mut text, args.json)?;
                fs::write(draft, text).map_err(|error| CliError::file("write", draft, &error))
            });
            entry.figures = evaluation.recordings().next().map(Figures::of_scores).unwrap_or_default();
            if matches!(judged, Ok(()) | Err(CliError::Check(_))) {
                entry.rows = entry.figures.rows;
            }
            judged?;
        }
        Command::Calibrate(mut args) => {
            if let Some(path) = args.traces.iter().find(|path| Table::read(path).is_ok_and(|table| table.is_some())) {
                let what =
                    "expected readings of one channel, found those of several; use `ohmstrain calibrate` without batch";
                return Err(CliError::Input(format!("{}: {what}", path.display())));
            }
            args.output = draft.to_path_buf();
            let outcome = calibrate::calibrate(&args, messages)?;
            entry.figures = outcome.findings.as_ref().map(Figures::of_findings).unwrap_or_default();
        }
        _ => return Err(CliError::Other("not a command for many recordings".into())),
    }
    Ok(())
}

/// Returns the message of a panic.
fn text_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("it does not say which")
}
