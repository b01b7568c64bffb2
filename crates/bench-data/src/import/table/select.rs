//! Selection of a table's rows: those with a given value in a column, and those of one range.

use crate::error::quote;
use crate::import::error::ImportError;
use crate::import::table::columns::{Column, Table};
use crate::import::table::options::RowFilter;

/// Largest number of values of a column that a message lists.
const MOST_VALUES: usize = 8;

impl Table {
    /// Returns the column with this heading, name or number.
    pub(crate) fn called(&self, text: &str) -> Option<usize> {
        let place = |is_it: &dyn Fn(&Column) -> bool| self.columns.iter().position(is_it);
        let lower = text.to_lowercase();
        place(&|column| column.heading == text)
            .or_else(|| place(&|column| column.name == text))
            .or_else(|| place(&|column| column.heading.to_lowercase() == lower))
            .or_else(|| text.parse::<usize>().ok()?.checked_sub(1).filter(|place| *place < self.columns.len()))
    }

    /// Keeps the rows that pass a filter.
    ///
    /// # Errors
    /// If the column does not exist, or no row passes.
    pub(crate) fn keep(&mut self, filter: &RowFilter) -> Result<(), ImportError> {
        let Some(place) = self.called(&filter.column) else {
            let what = format!("there is no column {} among {}", quote(&filter.column), self.list());
            return Err(ImportError::question(&self.file, what, ["--where COLUMN=VALUE with one of them".to_owned()]));
        };
        let cells = &self.columns[place].cells;
        let is_it = |cell: &str| cell.trim() == filter.value || is_same_number(cell, &filter.value);
        let rows: Vec<usize> = (0..self.len()).filter(|row| is_it(cells.get(*row))).collect();
        if rows.is_empty() {
            let (name, value) = (self.name(place), quote(&filter.value));
            let what = format!("column {name} has no {value}, but {}", listed(&self.values(place)));
            return Err(ImportError::unreadable(&self.file, what));
        }
        *self = self.rows(rows.into_iter());
        Ok(())
    }

    /// Returns the table with some of its rows.
    pub(crate) fn rows(&self, rows: impl Iterator<Item = usize> + Clone) -> Self {
        let column = |Column { name, heading, unit, cells }: &Column| Column {
            name: name.clone(),
            heading: heading.clone(),
            unit: unit.clone(),
            cells: cells.some(rows.clone()),
        };
        Self {
            file: self.file.clone(),
            layout: self.layout.clone(),
            metadata: self.metadata.clone(),
            columns: self.columns.iter().map(column).collect(),
            lines: rows.clone().map(|row| self.lines[row]).collect(),
        }
    }

    /// Returns the distinct values of a column.
    pub(crate) fn values(&self, place: usize) -> Vec<&str> {
        let mut values: Vec<&str> = Vec::new();
        for value in self.columns[place].cells.iter() {
            if values.len() <= MOST_VALUES && !values.contains(&value) {
                values.push(value);
            }
        }
        values
    }
}

fn is_same_number(cell: &str, value: &str) -> bool {
    matches!((cell.trim().parse::<f64>(), value.parse::<f64>()), (Ok(cell), Ok(value)) if cell == value)
}

/// Lists values for a message.
fn listed(values: &[&str]) -> String {
    let shown: Vec<String> = values.iter().take(MOST_VALUES).map(|value| quote(value)).collect();
    shown.join(", ") + if values.len() > MOST_VALUES { " …" } else { "" }
}
