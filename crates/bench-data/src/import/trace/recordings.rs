//! Several recordings in one file: the clock restarts, or a column counts them.

use std::ops::Range;

use crate::error::Fault;
use crate::import::error::ImportError;
use crate::import::series::Times;
use crate::import::table::Table;
use crate::import::trace::plan::Plan;

/// Least number of rows in a recording; fewer are rows that are out of order.
const FEWEST_ROWS: usize = 3;
/// Names of columns that count recordings, in lower case.
const COUNTERS: [&str; 9] = ["trial", "run", "rep", "repetition", "recording", "session", "test", "experiment", "take"];

impl Plan {
    /// Splits a file into its recordings, one below the other, each as its own tables. A new one begins where the clock restarts, or where
    /// a column such as `trial` or `run` changes its value. Returns a single recording if there is no such place.
    ///
    /// # Errors
    /// [`ImportError`] for times that cannot be read, rows that are out of order, and files beside the one with the readings.
    pub fn recordings(&self, tables: &[Table]) -> Result<Vec<Vec<Table>>, ImportError> {
        let ranges = self.ranges(tables)?;
        if ranges.len() > 1 && tables.len() > 1 {
            let what = "several recordings are taken apart in one file, whose reference stands beside the readings";
            return Err(ImportError::unreadable(&tables[0].file, what));
        }
        Ok(ranges.into_iter().map(|rows| tables.iter().map(|table| table.rows(rows.clone())).collect()).collect())
    }

    /// Returns the rows of each recording.
    fn ranges(&self, tables: &[Table]) -> Result<Vec<Range<usize>>, ImportError> {
        let clock = &self.decision.readings[0].clock;
        let table = &tables[clock.file()];
        let times = Times::read(tables, clock, &self.recipe.missing)?.seconds;
        let mut starts = vec![0];
        let mut last = f64::NEG_INFINITY;
        for (row, &time) in times.iter().enumerate().filter(|(_, time)| !time.is_nan()) {
            if time < last {
                starts.push(row);
            }
            last = time;
        }
        for column in (0..table.columns.len()).filter(|column| counts_recordings(table, *column)) {
            let cells = &table.columns[column].cells;
            starts.extend((1..table.len()).filter(|row| cells.get(*row) != cells.get(row - 1)));
        }
        starts.sort_unstable();
        starts.dedup();
        let ends = starts.iter().skip(1).copied().chain([table.len()]);
        let ranges: Vec<Range<usize>> = starts.iter().zip(ends).map(|(start, end)| *start..end).collect();
        match ranges.iter().find(|rows| rows.len() < FEWEST_ROWS && ranges.len() > 1) {
            Some(short) => {
                let found = format!("{}: rows seem to be out of order there", short.len());
                let fault = Fault::new(format!("recordings of {FEWEST_ROWS} rows or more"), found);
                Err(ImportError::content(&table.file, table.lines[short.start], fault))
            }
            None => Ok(ranges),
        }
    }

    /// Returns the tables of one recording, counted from 1.
    pub(crate) fn recording(&self, tables: &[Table], number: usize) -> Result<Vec<Table>, ImportError> {
        let mut all = self.recordings(tables)?;
        let count = all.len();
        if !(1..=count).contains(&number) {
            let what = format!("there is no recording {number}: the file has {count}");
            return Err(ImportError::question(&tables[0].file, what, [format!("--recording with 1 to {count}")]));
        }
        Ok(all.swap_remove(number - 1))
    }
}

/// True if a column numbers recordings: by its name, and with constant values over ranges of rows.
fn counts_recordings(table: &Table, column: usize) -> bool {
    let name = table.columns[column].name.to_lowercase();
    let word = name.split(|c: char| !c.is_alphabetic()).find(|word| !word.is_empty()).unwrap_or_default();
    let cells = &table.columns[column].cells;
    let changes = (1..cells.len()).filter(|row| cells.get(*row) != cells.get(row - 1)).count();
    COUNTERS.contains(&word) && (changes + 1) * FEWEST_ROWS <= cells.len()
}
