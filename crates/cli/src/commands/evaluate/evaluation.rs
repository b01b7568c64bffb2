use std::io::Write;

use ohmstrain_calib::SIMULATED_SEED;
use ohmstrain_report::Drawn;
use serde::Serialize;

use super::scores::{PUBLISHED, RecordingScores};
use super::summary::{self, Summary, summaries};
use crate::commands::score_table::{KEY, add_scores, score_table};
use crate::error::CliError;
use crate::output;

/// Version of the output of `--json`.
const SCHEMA: u32 = 3;

/// All scores, recording by recording.
#[derive(Default)]
pub struct Evaluation {
    /// Report, if one was requested.
    pub drawn: Option<Drawn>,
    recordings: Vec<Vec<RecordingScores>>,
}

/// Content of the output of `--json`.
#[derive(Serialize)]
struct Json<'a> {
    /// Commit that the program was built from, if known.
    commit: Option<&'static str>,
    /// Seed of the motions that calibration simulates; nothing else is random.
    simulated_seed: u64,
    /// Summary of all cases, one row per estimate.
    summary: Vec<Summary>,
    recordings: Vec<&'a RecordingScores>,
}

impl Evaluation {
    /// Adds the scores of one recording.
    pub fn add(&mut self, scores: Vec<RecordingScores>) {
        self.recordings.push(scores);
    }

    /// True if nothing was scored.
    pub fn is_empty(&self) -> bool {
        self.recordings.is_empty()
    }

    /// Returns all scores in one sequence.
    pub fn recordings(&self) -> impl Iterator<Item = &RecordingScores> {
        self.recordings.iter().flatten()
    }

    /// Writes JSON or a table.
    pub fn write(&self, out: &mut dyn Write, json: bool) -> Result<(), CliError> {
        if json {
            let json = Json {
                commit: option_env!("OHMSTRAIN_COMMIT").filter(|commit| !commit.is_empty()),
                simulated_seed: SIMULATED_SEED,
                summary: self.summaries(),
                recordings: self.recordings().collect(),
            };
            output::json(out, SCHEMA, &json)
        } else {
            self.write_tables(out)?;
            if self.recordings.len() > 1 {
                summary::write(&self.summaries(), out)?;
            }
            writeln!(out, "{KEY}")?;
            if self.recordings().any(|scores| scores.known.is_some()) {
                writeln!(
                    out,
                    "known: the reference told the estimator the strain of these rows, which are scored, too."
                )?;
            }
            let has_published = |scores: &RecordingScores| scores.baselines.named().any(|(name, _)| name == PUBLISHED);
            if self.recordings().any(has_published) {
                writeln!(out, "{PUBLISHED}: equations 8 and 9 solved for the strain, told when phases begin.")?;
            }
            Ok(())
        }
    }

    fn summaries(&self) -> Vec<Summary> {
        summaries(self.recordings.iter().map(Vec::as_slice))
    }

    /// Writes one table per recording, headed by its name: filter and smoother of every estimator, then the baselines.
    fn write_tables(&self, out: &mut dyn Write) -> Result<(), CliError> {
        for scores in &self.recordings {
            let Some(first) = scores.first() else { continue };
            writeln!(out, "{}", first.heading())?;
            let mut table = score_table();
            for of in scores {
                // A part that belongs to only one of filter and smoother leaves the other unchanged.
                let has_filter = !of.is_part || of.filter != first.filter;
                let has_smoother = !of.is_part || of.smoother != first.smoother;
                if has_filter {
                    add_scores(&mut table, &of.name(), &of.filter);
                }
                if has_smoother {
                    let own_name = format!("{}, smoother", of.name());
                    add_scores(&mut table, if has_filter { "smoother" } else { &own_name }, &of.smoother);
                }
            }
            for (name, of) in first.baselines.named() {
                add_scores(&mut table, name, &of);
            }
            writeln!(out, "{table}\n")?;
            for of in scores.iter().filter(|of| !of.is_part) {
                if let Some(settled) = of.settled {
                    writeln!(out, "{}, {settled}\n", of.name())?;
                }
            }
        }
        Ok(())
    }
}
