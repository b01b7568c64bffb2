//! Dense matrices of a calibration: products and factors in vectors of four lanes, with the same digits on every processor.
//!
//! nalgebra's loops over matrices of variable size are scalar, and its product of large matrices fuses multiplication and addition on
//! processors that support it.

mod cholesky;
mod gram;
mod product;
mod tile;

pub(crate) use cholesky::{cholesky, inverse, inverse_diagonal, lower_inverse};
pub(crate) use gram::{gram, gram_of};
pub(crate) use product::product;
