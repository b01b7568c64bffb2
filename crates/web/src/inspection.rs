//! Contents of a lab's files, in structures and in the words of `ohmstrain inspect`.

use ohmstrain_bench_data::import::{ImportError, Imported, Plan, Recipe, Role, Survey, Table, candidates};
use serde::Serialize;
use wasm_bindgen::prelude::*;

use crate::json::{json, refused};
use crate::recording::Recording;

/// An import that has been tried, and its result.
pub struct Proposal {
    pub plan: Plan,
    pub imported: Imported,
    pub recording: Recording,
    /// True if the file itself is a trace.
    pub is_trace: bool,
}

/// Findings in files: a recording, or a question.
#[wasm_bindgen]
pub struct Inspection {
    pub(crate) tables: Vec<Table>,
    pub(crate) found: Result<Proposal, Asked>,
}

/// Question to be answered first.
#[derive(Debug, Serialize)]
pub struct Asked {
    /// Question in one line, as on the command line.
    text: String,
    /// Flags that answer it; empty for an error that is not a question.
    answers: Vec<String>,
}

impl From<ImportError> for Asked {
    fn from(error: ImportError) -> Self {
        let text = error.to_string();
        let answers = if let ImportError::Question { answers, .. } = error { answers } else { vec![] };
        Self { text, answers }
    }
}

impl From<String> for Asked {
    fn from(text: String) -> Self {
        Self { text, answers: vec![] }
    }
}

/// Plans as `ohmstrain inspect` does, and imports.
pub fn proposed(tables: &[Table], recipe: &Recipe) -> Result<(Plan, Imported), Asked> {
    let plan = Plan::propose(tables, recipe)?;
    let imported = plan.import(tables)?;
    Ok((plan, imported))
}

#[derive(Serialize)]
struct Described<'a> {
    files: Vec<DescribedFile<'a>>,
    question: Option<&'a Asked>,
    remarks: &'a [String],
    /// Flags that state the whole plan.
    flags: String,
    is_trace: bool,
    roles: Vec<DescribedRole>,
}

#[derive(Serialize)]
struct DescribedRole {
    name: &'static str,
    units: Vec<&'static str>,
}

#[derive(Serialize)]
struct DescribedFile<'a> {
    name: &'a str,
    description: String,
    columns: Vec<DescribedColumn<'a>>,
}

#[derive(Serialize)]
struct DescribedColumn<'a> {
    heading: &'a str,
    unit: &'a str,
    /// Its chosen role, and its unit.
    taken: Option<(&'static str, String)>,
    /// Its possible role.
    candidate: Option<&'static str>,
    first: &'a str,
    last: &'a str,
}

#[wasm_bindgen]
impl Inspection {
    /// Describes the files, the roles of their columns, the question, if there is one, and remarks.
    #[wasm_bindgen(unchecked_return_type = "Described")]
    pub fn described(&self) -> Result<JsValue, JsError> {
        let proposal = self.found.as_ref().ok();
        json(&Described {
            files: (0..self.tables.len()).map(|index| self.file(index)).collect(),
            question: self.found.as_ref().err(),
            remarks: proposal.map_or(&[], |proposal| &proposal.imported.remarks),
            flags: proposal.map_or_else(String::new, |proposal| flags(&proposal.plan.recipe(&self.tables))),
            is_trace: proposal.is_some_and(|proposal| proposal.is_trace),
            roles: Role::ALL.iter().map(|role| DescribedRole { name: role.name(), units: role.units() }).collect(),
        })
    }

    /// Returns the survey of the recording: names and sentences, as `ohmstrain inspect` prints them.
    #[wasm_bindgen(unchecked_return_type = "[string, string][]")]
    pub fn survey(&self) -> Result<JsValue, JsError> {
        let lines = self.found.as_ref().map(|found| Survey::new(&found.imported).lines());
        json(&lines.unwrap_or_default())
    }

    /// Returns the recording.
    pub fn recording(&self) -> Result<Recording, JsError> {
        self.found.as_ref().map(|found| found.recording.clone()).map_err(|asked| refused(&asked.text))
    }
}

impl Inspection {
    fn file(&self, index: usize) -> DescribedFile<'_> {
        let table = &self.tables[index];
        let taken = self.found.as_ref().map(|found| found.plan.columns(&self.tables)).unwrap_or_default();
        let found = candidates(&self.tables);
        let columns = table.columns.iter().enumerate().map(|(place, column)| {
            let is_here = |table: usize, column: usize| (table, column) == (index, place);
            let taken = taken.iter().find(|(_, table, column, ..)| is_here(*table, *column));
            let candidate = found.iter().find(|one| is_here(one.table, one.column));
            DescribedColumn {
                heading: &column.heading,
                unit: column.unit.as_deref().unwrap_or_default(),
                taken: taken.map(|(role, .., unit)| (role.name(), (*unit).to_owned())),
                candidate: candidate.map(|one| one.role.name()),
                first: column.cells.get(0),
                last: column.cells.get(column.cells.len().saturating_sub(1)),
            }
        });
        DescribedFile { name: &table.file, description: table.description(), columns: columns.collect() }
    }
}

/// Returns the flags of a recipe on one line.
fn flags(recipe: &Recipe) -> String {
    let words = recipe.arguments();
    shlex::try_join(words.iter().map(String::as_str)).unwrap_or_default()
}
