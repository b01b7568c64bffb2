//! Clocks in two columns: a date in one and the time of day in the other.

use crate::import::bytes::Cells;
use crate::import::table::columns::{Column, Table};
use crate::import::words::stamp::{Order, Stamp, stamp};

/// Writes the dates of a column before the times of day in the column beside it, if there is more than one date.
pub(crate) fn join(table: &mut Table) {
    let kinds: Vec<Kind> = table.columns.iter().map(|column| Kind::of(&column.cells)).collect();
    for place in (0..kinds.len()).filter(|place| kinds[*place] == Kind::Times) {
        let beside = [place.checked_sub(1), Some(place + 1)].into_iter().flatten();
        let Some(dates) = beside.into_iter().find(|beside| kinds.get(*beside) == Some(&Kind::Dates)) else { continue };
        let (dates, times) = (&table.columns[dates], &table.columns[place]);
        let mut cells = Cells::default();
        let rows = dates.cells.iter().zip(times.cells.iter()).map(|(date, time)| (date_of(date), time.trim()));
        rows.for_each(|(date, time)| match (date, time) {
            ("", _) | (_, "") => cells.push(""),
            (date, time) => cells.push(&format!("{date} {time}")),
        });
        let heading = format!("{} {}", dates.heading, times.heading).trim().to_owned();
        table.columns[place] = Column { name: times.name.clone(), heading, unit: times.unit.clone(), cells };
    }
}

/// Content of a column.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Dates without times of day, not all of them alike.
    Dates,
    /// Times of day without dates.
    Times,
    Other,
}

impl Kind {
    fn of(cells: &Cells) -> Self {
        let mut filled = cells.iter().map(date_of).filter(|cell| !cell.is_empty()).peekable();
        let Some(first) = filled.peek().copied() else { return Self::Other };
        let all = |fits: &dyn Fn(Stamp) -> bool| {
            let is_fit = |cell: &str| Order::ALL.iter().any(|order| stamp(cell, *order).is_some_and(fits));
            is_fit(first) && filled.clone().all(is_fit)
        };
        if all(&|stamp| !stamp.has_date) {
            Self::Times
        } else if all(&|stamp| !stamp.has_time) && filled.clone().any(|cell| cell != first) {
            Self::Dates
        } else {
            Self::Other
        }
    }
}

/// Returns a date without the midnight that workbooks write behind it.
fn date_of(cell: &str) -> &str {
    let cell = cell.trim();
    cell.strip_suffix(" 00:00:00.000000").unwrap_or(cell)
}
