//! Conversion of a file's contents to columns under their headings.

mod columns;
mod data;
mod date_column;
mod description;
mod fractions;
mod grid;
mod header;
mod interleaved;
mod json;
mod labview;
mod layout;
mod names;
mod options;
mod rate;
mod read;
mod records;
mod select;
mod transposed;
mod unit_column;
mod value;

pub(crate) use columns::all_files;
pub use columns::{Column, Layout, Table};
pub(crate) use grid::MONITOR_CLOCK;
pub use options::{ReadOptions, RowFilter};
pub use read::read_table;
pub(crate) use records::SEPARATOR;
pub(crate) use value::{number_of, value_of};
