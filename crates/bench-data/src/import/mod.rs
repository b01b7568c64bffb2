//! From a lab's files to a trace: what stands in them, which questions that leaves, and the import itself.
//!
//! ```text
//! bytes ──► read_table ──► Table (cells as text) ──► Plan::new(tables, Recipe) ──► Plan::import ──► Imported (Trace)
//!                                                          │ all that the recipe leaves open is decided here, or asked
//!                                                          └──► Plan::recipe: the same, with nothing left open
//! ```
//!
//! # Policy
//! - Nothing is guessed in silence: what follows from names, units or numbers stands in [`Plan::remarks`]; what does not
//!   follow is an [`ImportError::Question`], one line that shows how to answer it.
//! - A plan's own recipe leads to the same plan: `Plan::new(tables, &plan.recipe())` asks nothing.
//! - Numbers are read as they are written: powers of ten between units move the decimal mark, so that nothing is rounded
//!   twice. Cells that no instrument means as a number (`OVLD`, `N/A`, 9.9e37) are missing values, and are counted.
//! - What a file is unpacked to, or repeats, is bounded (`bounds`), and counted before there is room made for it.
//! - Nothing here opens files.

mod bounds;
mod build;
mod candidates;
mod channel;
mod clock;
mod compound;
mod digits;
mod error;
mod grid;
mod header;
mod layout;
mod names;
mod number;
mod ods_size;
mod parquet;
mod plan;
mod plan_clock;
mod plan_units;
mod preset;
mod questions;
mod recipe;
mod records;
mod roles;
mod series;
mod sheet;
mod source;
mod stamp;
mod survey;
mod table;
mod units;
mod workbook;
mod xls_size;
mod zipped;

pub use bounds::LARGEST_FILE;
pub use build::Imported;
pub use candidates::{Candidate, candidates};
pub use error::ImportError;
pub use number::DecimalMark;
pub use plan::Plan;
pub use preset::Preset;
pub use recipe::{Align, ColumnName, PerFile, ReadOptions, Recipe, RecipeError};
pub use roles::Role;
pub use source::read_table;
pub use survey::{Allan, ChannelSurvey, ClockSurvey, PhaseSurvey, Survey};
pub use table::{Cells, Column, Layout, Table};
