//! State of a filter between two streams.

use std::path::Path;

use ohmstrain::{Stored, StoredClock};
use ohmstrain_bench_data::{LastTime, Microseconds};

use crate::error::CliError;
use crate::stream::RowSource;
use crate::whole_file;

/// Reads a state that `--save-state` wrote.
pub fn read(path: &Path) -> Result<Stored, CliError> {
    let text = whole_file::text(path)?;
    Stored::from_toml(&text).map_err(|error| CliError::Input(format!("{}: {error}", path.display())))
}

/// Returns the clock of a stream in the form that is stored.
pub const fn of_last_time(last: LastTime) -> StoredClock {
    match last {
        LastTime::Seconds(time_s) => StoredClock::TimeS(time_s),
        LastTime::Microseconds(Microseconds { counter, unwrapped }) => StoredClock::TimeUs { counter, unwrapped },
    }
}

/// Continues a stream from the end of the one before.
pub fn go_on(rows: &mut RowSource, stored: &Stored) -> Result<(), CliError> {
    let (last, column) = match stored.clock {
        None => return Ok(()),
        Some(StoredClock::TimeS(time_s)) => (LastTime::Seconds(time_s), "time_s"),
        Some(StoredClock::TimeUs { counter, unwrapped }) => {
            (LastTime::Microseconds(Microseconds { counter, unwrapped }), "time_us")
        }
    };
    if rows.go_on(last) {
        return Ok(());
    }
    let (file, line) = (rows.file(), rows.line());
    Err(CliError::Input(format!(
        "{file}:{line}: expected the column `{column}`, as in the stream that --resume goes on from"
    )))
}
