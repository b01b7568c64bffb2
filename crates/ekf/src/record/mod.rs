//! The kernel's arithmetic written down instead of done: what a program that writes other programs needs.
//!
//! A tape runs the kernel on expressions and keeps every operation, in the order in which the kernel does them. Where
//! numbers would choose a way, both ways are kept and one of the results is chosen; results are the same.

mod expression;
mod numbers;
mod pieces;
mod steps;
#[cfg(test)]
mod tests;

use expression::{Expression, Tape};
pub use expression::{Operation, Place, Recorded};
pub use numbers::{MixtureNumbers, shared};
pub use pieces::{Carried, Piece};
