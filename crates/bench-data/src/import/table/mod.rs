//! From a file's contents to columns under their headings.

mod columns;
mod data;
mod description;
mod grid;
mod header;
mod layout;
mod read;
mod records;
mod value;

pub(crate) use columns::all_files;
pub use columns::{Column, Layout, ReadOptions, Table};
pub(crate) use grid::MONITOR_CLOCK;
pub use read::read_table;
pub(crate) use records::SEPARATOR;
pub(crate) use value::{number_of, value_of};
