use crate::error::{Fault, quote};
use crate::import::error::ImportError;
use crate::import::number::{DecimalMark, Value, number, ohms, value};
use crate::import::questions::quoted;
use crate::import::roles::Role;
use crate::import::table::Table;
use crate::import::units::{Scale, Unit};

/// A column that a trace takes numbers from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Channel {
    pub role: Role,
    pub table: usize,
    pub column: usize,
    pub unit: Unit,
}

/// Numbers of a column in the trace's unit, and what stood where there are none.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Values {
    /// NaN is a missing one.
    pub values: Vec<f64>,
    /// Texts of missing values and how often they stand there, the commonest first.
    pub missing: Vec<(String, usize)>,
}

impl Values {
    /// Reads a column.
    pub(crate) fn read(table: &Table, channel: &Channel, own_missing: &[String]) -> Result<Self, ImportError> {
        let shift = match channel.unit.scale {
            Scale::Shift(shift) | Scale::ChangeShift(shift) => shift,
            Scale::Affine(..) | Scale::Stamp => 0,
        };
        let column = &table.columns[channel.column];
        let mut out = Self::default();
        for (row, cell) in column.cells.iter().enumerate() {
            match value(cell, table.layout.decimal, shift, own_missing) {
                Value::Number(number) => out.values.push(in_trace_unit(number, channel.unit.scale)),
                Value::Missing => {
                    out.values.push(f64::NAN);
                    match out.missing.iter_mut().find(|(text, _)| text == cell) {
                        Some((_, count)) => *count += 1,
                        None => out.missing.push((cell.to_owned(), 1)),
                    }
                }
                Value::Text => out.values.push(ohms_of(table, channel, row, cell)?),
            }
        }
        out.missing.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        Ok(out)
    }
}

impl Channel {
    /// A number of the column in the trace's unit.
    pub(crate) fn convert(&self, value: f64) -> f64 {
        let shift = if let Scale::Shift(shift) | Scale::ChangeShift(shift) = self.unit.scale { shift } else { 0 };
        let shifted = number(&value.to_string(), DecimalMark::Point, shift).unwrap_or(value);
        in_trace_unit(shifted, self.unit.scale)
    }
}

fn in_trace_unit(number: f64, scale: Scale) -> f64 {
    match scale {
        Scale::Affine(factor, offset) => number * factor + offset,
        Scale::ChangeShift(_) => 1.0 + number,
        Scale::Shift(_) | Scale::Stamp => number,
    }
}

/// A number of ohms with a unit of its own.
fn ohms_of(table: &Table, channel: &Channel, row: usize, cell: &str) -> Result<f64, ImportError> {
    let found = ohms(cell.trim(), table.layout.decimal).filter(|_| channel.role == Role::Resistance);
    let found = found.ok_or_else(|| no_number(table, channel, row, cell))?;
    if channel.unit.scale != Scale::Shift(0) {
        let (column, unit) = (name(table, channel.column), channel.unit.name);
        let what = format!("column {column}: {} has a unit of its own, and the column another, {unit}", quote(cell));
        let place = format!("{}:{}", table.file, table.lines[row]);
        return Err(ImportError::question(
            &place,
            what,
            ["--unit resistance=ohm if numbers without one are ohms".into()],
        ));
    }
    Ok(found)
}

/// A text among numbers: is it a missing value?
fn no_number(table: &Table, channel: &Channel, row: usize, cell: &str) -> ImportError {
    let line = table.lines[row];
    let what = format!("column {}: expected a number, found {}", name(table, channel.column), quote(cell));
    if cell.contains(char::is_control) || cell.is_empty() {
        return ImportError::content(&table.file, line, Fault::new("a number", quote(cell)));
    }
    let answer = format!("--missing {} if it means a missing value", quoted(cell));
    ImportError::question(&format!("{}:{line}", table.file), what, [answer])
}

/// How messages call a column.
pub(crate) fn name(table: &Table, column: usize) -> String {
    match table.columns.get(column).map(|column| column.heading.as_str()) {
        Some(heading) if !heading.is_empty() => quote(heading),
        _ => (column + 1).to_string(),
    }
}
