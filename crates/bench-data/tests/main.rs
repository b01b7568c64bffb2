//! Recordings read, written, simulated and imported. One test program with a module for each subject.

mod common;

mod faults;
mod findings;
#[cfg(feature = "import")]
mod import_bounds;
#[cfg(feature = "import")]
mod import_clocks;
#[cfg(feature = "import")]
mod import_containers;
mod import_each;
#[cfg(feature = "import")]
mod import_files;
#[cfg(feature = "import")]
mod import_forms;
#[cfg(feature = "import")]
mod import_headers;
#[cfg(feature = "import")]
mod import_json;
#[cfg(feature = "import")]
mod import_misread;
#[cfg(feature = "import")]
mod import_recordings;
#[cfg(feature = "import")]
mod import_rig;
#[cfg(feature = "import")]
mod import_times;
#[cfg(feature = "import")]
mod import_units;
#[cfg(feature = "import")]
mod parquet_traces;
mod reader;
mod round_trip;
mod segment;
mod simulate;
mod streaming;
