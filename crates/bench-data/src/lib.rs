//! Bench recordings of soft strain sensors: traces, their CSV schema, phases, and a simulator.
//!
//! - [`TraceReader`] reads a recording row by row as it arrives, [`Trace`] holds a whole one and writes it back.
//! - [`segment`] cuts a reference into stretching, holding and releasing.
//! - With the feature `import`, the module of that name makes traces from a lab's files.
//! - [`simulate`](mod@simulate) makes recordings of a simulated bench.
//! - [`faults`] adds faults to recordings.
//!
//! # Policy
//! - Units are converted here and nowhere else: inside, there is strain, Ω or R/R₀, and seconds.
//! - NaN in a vector or a row is a *missing* value; ±∞, zero and negative resistance are errors.
//! - Nothing here opens files, prints, or reads a clock. Randomness is seeded.
//! - Errors name file, line, column, what was expected and what was found, on one line.
//!
//! # The schema
//! ```text
//! # material = ecoflex-00-30                     any key; these four mean something:
//! # gauge_length_mm = 30
//! # front_end = divider reference_ohm=10000 side=low bits=12 noise_codes=0.5
//! # joint = prestrain=0.05 moment_arm_mm=4.4 gauge_length_mm=30
//! time_s,resistance_ohm,strain                   columns in any order
//! 0.00,1600.1,0
//! 0.05,,0.0017                                   an empty or NaN cell is a missing value
//! ```
//! Exactly one of `time_s`, `time_us` (whole microseconds, a 32-bit counter may wrap); exactly one of `resistance_ohm`,
//! `resistance_ratio`, `adc` (codes, need a front end); at most one of `strain`, `displacement_mm` (needs a gauge
//! length), `angle_deg` (strain with a joint); `temperature_c` is optional. Other columns are ignored.
//!
//! # What the simulated sensors do
//! Without noise, drift and conditioning:
//!
#![doc = include_str!("../preset-findings.md")]

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod cell;
mod clock;
mod columns;
mod counted;
mod device_reader;
mod error;
pub mod faults;
mod headed;
#[cfg(feature = "import")]
pub mod import;
mod line_parser;
mod lines;
mod metadata;
mod order;
pub mod pacing;
#[cfg(feature = "import")]
mod parquet_text;
mod reader;
mod row;
mod row_parser;
mod rows;
mod segment;
pub mod simulate;
mod spec;
mod trace;
mod writer;

pub use clock::{LastTime, Microseconds};
pub use counted::counted;
pub use device_reader::{DeviceReader, DeviceRow};
pub use error::{BadContent, SpecError, TraceError};
pub use headed::Headed;
pub use line_parser::{Line, LineParser};
pub use lines::cells;
pub use metadata::{Metadata, ResistanceUnit, StrainUnit};
#[cfg(feature = "import")]
pub use parquet_text::ParquetText;
pub use reader::TraceReader;
pub use row::{Reading, ReadingKind, ReferenceQuantity, Row};
pub use rows::RowWriter;
pub use segment::{Segment, segment};
pub use simulate::simulate;
pub use spec::{FrontEndSpec, JointSpec};
pub use trace::{ConverterReadings, MOST_ROWS, Readings, Reference, Trace};
