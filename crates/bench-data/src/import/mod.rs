//! Import of a lab's files as a trace: their contents, the questions that these leave open, and the import itself.
//!
//! ```text
//! bytes ──► table ──► roles ──► series ──► trace        each uses those before it and, but for bytes, `words`
//!
//! read_table: bytes ──► Table ──► Plan::new(tables, Recipe) ──► Plan::import ──► Imported (Trace)
//!                                     │ all that the recipe leaves open is decided by one function, or asked
//!                                     └──► Plan::recipe: the same, with nothing left open
//! ```
//!
//! # Policy
//! - No guess is silent: a conclusion from names, units or numbers is in [`Plan::remarks`]; an open question
//!   is an [`ImportError::Question`], one line that shows how to answer it.
//! - A plan's own recipe leads to the same plan: `Plan::new(tables, &plan.recipe())` raises no question.
//! - Numbers are read as they are written: powers of ten between units move the decimal mark, so that nothing is
//!   rounded twice. Cells that no instrument uses as a number (`OVLD`, `N/A`, 9.9e37) are missing values, and are
//!   counted.
//! - The unpacked size of a file, and its repetitions, are bounded (`bounds`), and counted before memory is allocated.
//! - No function here opens files.

mod bytes;
mod error;
mod roles;
mod series;
mod table;
mod trace;
mod words;

pub use bytes::Cells;
pub use bytes::bounds::LARGEST_FILE;
pub use error::ImportError;
pub use roles::{Align, Candidate, ColumnName, PerFile, Preset, Recipe, RecipeError, candidates};
pub use table::{Column, Layout, ReadOptions, RowFilter, Table, read_table};
pub use trace::{Allan, ChannelSurvey, ClockSurvey, EachPlan, EachTrace, Imported, PhaseSurvey, Plan, Survey};
pub use words::{DecimalMark, Role};
