//! Meanings of words in any table: numbers, dates, units, and quantities by name.

pub(crate) mod kinds;
pub(crate) mod names;
mod number;
mod role;
pub(crate) mod stamp;
pub(crate) mod units;

pub use number::DecimalMark;
pub(crate) use number::{SCPI_OVERLOAD, Value, has_groups, is_missing, nanoseconds, number, value};
pub use role::Role;
pub(crate) use stamp::is_stamp;
pub(crate) use units::{Scale, Unit, amount, ohms};
