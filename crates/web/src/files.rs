//! A lab's files: from bytes to recordings.

use ohmstrain_bench_data::Trace;
use ohmstrain_bench_data::import::{LARGEST_FILE, Table, read_table};
use wasm_bindgen::prelude::*;

use crate::answers;
use crate::inspection::{Inspection, Proposal, proposed};
use crate::json::refused;
use crate::recording::Recording;

/// Files of one recording, as a lab wrote them: text, XLSX, Parquet, each optionally in gzip.
#[wasm_bindgen]
#[derive(Default)]
pub struct Files {
    files: Vec<(String, Vec<u8>)>,
}

#[wasm_bindgen]
impl Files {
    /// Creates an empty list of files.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a file of the recording.
    pub fn add(&mut self, name: String, bytes: Vec<u8>) -> Result<(), JsError> {
        if bytes.len() as u64 > LARGEST_FILE {
            let most = LARGEST_FILE >> 20;
            let hint = "take a part of it, or fewer columns";
            return Err(refused(format!("{name}: expected a file of at most {most} MiB, found a larger one; {hint}")));
        }
        self.files.push((name, bytes));
        Ok(())
    }

    /// Inspects the files: their contents, and the recording or the question that follows. `answers` are flags of
    /// `ohmstrain import` in the syntax of a shell.
    pub fn inspect(&self, answers: &str) -> Result<Inspection, JsError> {
        let recipe = answers::recipe(answers).map_err(refused)?;
        for (name, bytes) in &self.files {
            refuse_results(name, bytes).map_err(refused)?;
        }
        let table = |(index, (name, bytes)): (usize, &(String, Vec<u8>))| {
            read_table(bytes.clone(), name, &recipe.read_options(index))
        };
        let tables: Vec<Table> = self.files.iter().enumerate().map(table).collect::<Result<_, _>>().map_err(refused)?;
        let found = proposed(&tables, &recipe).and_then(|(plan, imported)| {
            let as_is = if answers.is_empty() { self.as_is(&imported.trace) } else { None };
            let is_trace = as_is.is_some();
            let recording = match as_is {
                Some(recording) => recording,
                None => self.imported(imported.trace.clone())?,
            };
            Ok(Proposal { plan, imported, recording, is_trace })
        });
        Ok(Inspection { tables, found })
    }
}

impl Files {
    /// Returns the file itself, if it is a trace that an import would not change.
    fn as_is(&self, imported: &Trace) -> Option<Recording> {
        let [(name, bytes)] = &self.files[..] else { return None };
        if bytes.starts_with(b"PAR1") {
            return None;
        }
        let recording = Recording::of_trace(name, bytes.clone()).ok()?;
        let is_same = recording.file.trace.readings.kind == imported.readings.kind
            && numbers(&recording.file.trace).eq(numbers(imported));
        is_same.then_some(recording)
    }

    /// Returns a trace in the form that `ohmstrain import` writes.
    fn imported(&self, trace: Trace) -> Result<Recording, String> {
        let bytes = trace.marked(&format!("{} import", ohmstrain::MADE_BY)).map_err(|error| error.to_string())?;
        Recording::of_trace(self.trace_name(), bytes).map_err(|error| error.to_string())
    }

    /// Returns the name that the command line proposes.
    pub(crate) fn trace_name(&self) -> &'static str {
        let is_taken = |name: &&str| self.files.iter().any(|(file, _)| file == name);
        let names = ["trace.csv", "imported.csv", "imported-trace.csv"];
        names.into_iter().find(|name| !is_taken(name)).unwrap_or("imported-trace-1.csv")
    }
}

/// Returns the bits of all its numbers.
fn numbers(trace: &Trace) -> impl Iterator<Item = u64> {
    let reference = trace.reference.iter().flat_map(|reference| &reference.values);
    trace.time_s.iter().chain(&trace.readings.values).chain(reference).map(|number| number.to_bits())
}

/// Number of first bytes by which the kind of a file is recognised.
const HEAD: usize = 4096;

/// Refuses results of this program, which look like tables, too.
fn refuse_results(name: &str, bytes: &[u8]) -> Result<(), String> {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(HEAD)]);
    let header = head.lines().next().unwrap_or_default();
    let what = if head.starts_with("format = ") {
        "is a sensor file: use it as the sensor, and drop the recording here"
    } else if ohmstrain::Column::are_all(header.split(',')) {
        "has estimates, what `filter` or `smooth` made of a recording: give the recording itself"
    } else {
        return Ok(());
    };
    Err(format!("{name} {what}"))
}
