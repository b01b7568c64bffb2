//! One command over many recordings.
//!
//! Every recording is done by this program, started anew with the command line that a person would type: what comes of it
//! is the command's, to the byte, and whatever happens to one recording happens to no other.

mod journal;
mod plan;
mod process;
mod scores;
mod summary;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use clap::ValueEnum;
use journal::{Entry, Journal, State};
use plan::Job;
use process::Workshop;

use crate::args::{BatchArgs, SummaryForm};
use crate::error::CliError;
use crate::output::{Kind, Outputs};
use crate::progress::Progress;
use crate::verbosity::Verbosity;

/// Does all recordings that are not done yet, and sums up.
pub fn run(args: &BatchArgs) -> Result<(), CliError> {
    let jobs = plan::jobs(args)?;
    plan::check_sensor(&jobs, args)?;
    let path = |form: SummaryForm| args.output.join(format!("{}.{}", summary::SUMMARY, form.name()));
    let mut outputs = Outputs::new(args.force, jobs.iter().flat_map(Job::inputs));
    outputs.folder(&args.output)?;
    let claim = outputs.claim_table(&path(args.summary), Kind::Summary, &summary::columns())?;
    let journal = Journal::open(&args.output, args.force)?;
    plan::check_outputs(&jobs, args, &journal)?;
    let workshop = Workshop::new(args)?;
    let bytes = jobs.iter().map(Job::bytes).sum();
    let progress = Progress::over_bytes("recordings", bytes);
    let work = Work { args, jobs: &jobs, journal: &journal, workshop: &workshop, progress: &progress };
    let entries = work.all()?;
    drop(progress);
    outputs.put(claim, summary::text(&entries, args.summary)?);
    outputs.publish()?;
    let others = SummaryForm::value_variants().iter().filter(|form| **form != args.summary);
    let stale: Vec<PathBuf> = others.map(|form| path(*form)).filter(|path| path.exists()).collect();
    closing(&entries, &path(args.summary), &stale)
}

struct Work<'a> {
    args: &'a BatchArgs,
    jobs: &'a [Job],
    journal: &'a Journal,
    workshop: &'a Workshop<'a>,
    progress: &'a Progress,
}

impl Work<'_> {
    /// Does all jobs, the largest first, so that no core waits long for another at the end; entries in the jobs' order.
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
            Ok(entries)
        };
        let mut entries = thread::scope(|scope| {
            let workers: Vec<_> = (0..self.workshop.places()).map(|_| scope.spawn(worker)).collect();
            let mut entries = Vec::new();
            for worker in workers {
                let done: Result<_, CliError> =
                    worker.join().unwrap_or_else(|_| Err(CliError::Other("a worker panicked".into())));
                entries.extend(done?);
            }
            Ok::<_, CliError>(entries)
        })?;
        entries.sort_by_key(|(job, _)| *job);
        Ok(entries.into_iter().map(|(_, entry)| entry).collect())
    }

    /// Does a job, unless that was done before.
    fn one(&self, job: &Job) -> Result<Entry, CliError> {
        let started = self.workshop.start(job);
        if !self.args.again
            && let Some(done) = started.as_ref().ok().and_then(|started| self.journal.finished(&started.entry))
        {
            return Ok(Entry { state: State::Kept, ..done });
        }
        let mut entry = match started {
            Ok(started) => started.finish(self.journal)?,
            Err(entry) => *entry,
        };
        if entry.state == State::Failed {
            let output = self.args.output.join(&entry.output);
            if entry.output_sha256.is_none() && output.exists() {
                entry.message = format!("{}; {} is from before this run", entry.message, output.display());
            }
            self.progress.around(|| CliError::error(&entry.message));
        }
        Ok(entry)
    }
}

/// Says how many there are of each kind, and which summaries are not of this run.
fn closing(entries: &[Entry], summary: &Path, stale: &[PathBuf]) -> Result<(), CliError> {
    let count = |state| entries.iter().filter(|entry| entry.state == state).count();
    let (done, kept, failed) = (count(State::Done), count(State::Kept), count(State::Failed));
    let warned = entries.iter().filter(|entry| !entry.warnings.is_empty()).count();
    let mut text =
        format!("{done} done, {kept} done before, {failed} failed, {warned} with warnings: {}", summary.display());
    stale.iter().for_each(|path| text += &format!("; {} is from before this run", path.display()));
    if failed > 0 {
        return Err(CliError::Batch(text));
    }
    if Verbosity::chosen() != Verbosity::Quiet {
        CliError::remark(&text);
    }
    Ok(())
}
