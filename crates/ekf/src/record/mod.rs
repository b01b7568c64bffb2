//! Recording of the kernel's arithmetic, for programs that write other programs.
//!
//! A tape runs the kernel on expressions and keeps every operation, in the order in which the kernel does them. Where
//! numbers would choose a way, both ways are kept and one of the results is chosen; results are the same.
//!
//! Code around the kernel compares numbers and goes one way ([`write_down`]): it is run once for every way that it may go.

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
