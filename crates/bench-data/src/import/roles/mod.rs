//! Roles of columns: the contents of the files and the user's answers become a decision.

mod clock;
mod decide;
mod decision;
mod facts;
mod find;
mod preset;
mod recipe;
#[cfg(test)]
mod tests;
mod unit;

pub(crate) use decide::{decide, is_stretch_without_zero};
pub(crate) use decision::{Channel, Clock, Decision, FileColumn, Timed};
pub use facts::{Candidate, candidates};
pub(crate) use facts::{Found, is_coarse};
pub(crate) use find::refer;
pub use preset::Preset;
pub use recipe::{Align, ColumnName, PerFile, Recipe, RecipeError};
