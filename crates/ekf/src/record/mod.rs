//! Recording of the kernel's arithmetic, for programs that generate source code.
//!
//! The kernel runs on expressions, and a tape stores every operation in the kernel's order. Where numbers would select
//! a branch, both branches are recorded and one of their results is selected; the results are the same.
//!
//! Code around the kernel compares numbers and takes one path ([`write_down`]); it is run once for every possible path.

mod correction;
mod expression;
mod fields;
mod numbers;
mod operation;
mod pieces;
mod steps;
mod tape;
#[cfg(test)]
mod tests;
mod ways;

pub use correction::{write_mixture, write_scaled};
pub use expression::Expression;
pub use fields::{Fields, See};
pub use numbers::{MixtureNumbers, shared};
pub use operation::{Operation, Place, Recorded};
pub use pieces::{Carried, Piece};
use tape::Tape;
pub use ways::{Function, Name, Writer, write_down};
