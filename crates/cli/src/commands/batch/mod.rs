//! One command over many recordings.
//!
//! Each recording is processed by the function of the command itself, with the flags that a person would type. The result is
//! the command's, to the byte, and an error or a bug in one recording does not affect the others.

mod journal;
mod plan;
mod scores;
mod summary;
mod workshop;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use clap::ValueEnum;
use journal::{Entry, Journal, State};
use plan::Job;
use rayon::ThreadPoolBuilder;
use workshop::Workshop;

use crate::args::{BatchArgs, SummaryForm, name_of};
use crate::error::CliError;
use crate::messages::Messages;
use crate::output::{Kind, Outputs};
use crate::progress::Progress;

/// Runs the command on all recordings that are not done yet, and writes their summary.
pub fn run(args: &BatchArgs, messages: &Messages) -> Result<(), CliError> {
    let jobs = plan::jobs(args)?;
    plan::check_sensor(&jobs, args)?;
    let path = |form: SummaryForm| args.output.join(format!("{}.{}", summary::SUMMARY, name_of(form)));
    let mut outputs = Outputs::new(args.force, jobs.iter().flat_map(Job::inputs));
    outputs.folder(&args.output)?;
    let claim = outputs.claim_table(&path(args.summary), Kind::Summary, &summary::columns())?;
    let journal = Journal::open(&args.output, args.force)?;
    plan::check_outputs(&jobs, args, &journal)?;
    let workshop = Workshop::new(args)?;
    let bytes = jobs.iter().map(Job::bytes).sum();
    let progress = Progress::over_bytes("recordings", bytes, messages);
    let work = Work { args, jobs: &jobs, journal: &journal, workshop: &workshop, progress: &progress };
    let entries = work.all()?;
    drop(progress);
    outputs.put(claim, summary::text(&entries, args.summary)?);
    outputs.publish()?;
    let others = SummaryForm::value_variants().iter().filter(|form| **form != args.summary);
    let stale: Vec<PathBuf> = others.map(|form| path(*form)).filter(|path| path.exists()).collect();
    closing(&entries, &path(args.summary), &stale, messages)
}

/// Stack of a thread, bytes; the same as that of the thread that runs a single command.
const STACK: usize = 8 << 20;

struct Work<'a> {
    args: &'a BatchArgs,
    jobs: &'a [Job],
    journal: &'a Journal,
    workshop: &'a Workshop<'a>,
    progress: &'a Progress<'a>,
}

impl Work<'_> {
    /// Runs all jobs, the largest first, so that no core waits long for another at the end; returns entries in the jobs' order.
    fn all(&self) -> Result<Vec<Entry>, CliError> {
        let mut order: Vec<usize> = (0..self.jobs.len()).collect();
        order.sort_by_key(|job| std::cmp::Reverse(self.jobs[*job].bytes()));
        let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let worker = || {
            let mut entries = Vec::new();
            while let Some(job) = order.get(next.fetch_add(1, Ordering::Relaxed)) {
                let entry = self.one(&self.jobs[*job])?;
                let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                let message = format!("{count} of {} recordings", self.jobs.len());
                self.progress.advance(self.jobs[*job].bytes(), message);
                entries.push((*job, entry));
            }
            Ok::<_, CliError>(entries)
        };
        let places = self.args.jobs.or(thread::available_parallelism().ok()).map_or(1, usize::from);
        // A recording that runs alone uses all cores: zero threads means that to the pool.
        let threads = if places > 1 { places } else { 0 };
        let pool = ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build();
        let pool = pool.map_err(|error| CliError::Other(format!("cannot start threads: {error}")))?;
        // Recordings are not tasks of the pool: a thread that waits for a part of one recording would begin another.
        let workers = pool.broadcast(|thread| if thread.index() < places { worker() } else { Ok(Vec::new()) });
        let mut entries = workers.into_iter().collect::<Result<Vec<_>, _>>()?.concat();
        entries.sort_by_key(|(job, _)| *job);
        Ok(entries.into_iter().map(|(_, entry)| entry).collect())
    }

    /// Runs a job, unless an earlier run has done it.
    fn one(&self, job: &Job) -> Result<Entry, CliError> {
        let mut entry = self.workshop.entry(job);
        if let Err(message) = self.workshop.hash_inputs(job, &mut entry) {
            entry.message = message;
        } else if let Some(done) = self.journal.finished(&entry).filter(|_| !self.args.again && job.has_reports()) {
            return Ok(Entry { state: State::Kept, ..done });
        } else {
            self.workshop.finish(job, &mut entry, self.journal)?;
        }
        if entry.state == State::Failed {
            let output = self.args.output.join(&entry.output);
            if entry.output_sha256.is_none() && output.exists() {
                entry.message = format!("{}; {} is from before this run", entry.message, output.display());
            }
            self.progress.around(|| Messages::error(&entry.message));
        }
        Ok(entry)
    }
}

/// Prints the number of jobs in each state, and names summaries that are not from this run.
fn closing(entries: &[Entry], summary: &Path, stale: &[PathBuf], messages: &Messages) -> Result<(), CliError> {
    let count = |state| entries.iter().filter(|entry| entry.state == state).count();
    let (done, kept, failed) = (count(State::Done), count(State::Kept), count(State::Failed));
    let warned = entries.iter().filter(|entry| !entry.warnings.is_empty()).count();
    let mut text =
        format!("{done} done, {kept} done before, {failed} failed, {warned} with warnings: {}", summary.display());
    stale.iter().for_each(|path| text += &format!("; {} is from before this run", path.display()));
    if failed > 0 {
        return Err(CliError::Batch(text));
    }
    messages.remark(&text);
    Ok(())
}
