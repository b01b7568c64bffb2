use crate::error::{Fault, quote};
use crate::import::error::{ImportError, quoted};
use crate::import::roles::Channel;
use crate::import::series::digits::{DIGITS, rounded};
use crate::import::table::Table;
use crate::import::table::value_of;
use crate::import::words::{DecimalMark, Role, Scale, Value, number, ohms};

/// Numbers of a column in the trace's unit, and the texts of missing ones.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Values {
    /// Values; NaN is a missing one.
    pub values: Vec<f64>,
    /// Texts of missing values with their counts, the commonest first.
    pub missing: Vec<(String, usize)>,
}

impl Values {
    /// Reads a column.
    pub(crate) fn read(tables: &[Table], channel: &Channel, own_missing: &[String]) -> Result<Self, ImportError> {
        let (table, shift) = (&tables[channel.place.file], channel.unit.scale.shift());
        let cells = &table.columns[channel.place.column].cells;
        let mut out = Self::default();
        for (row, cell) in cells.cells().enumerate() {
            match value_of(&cell, table.layout.decimal, shift, own_missing) {
                Value::Number(number) => out.values.push(in_trace_unit(number, channel.unit.scale)),
                Value::Missing => {
                    out.values.push(f64::NAN);
                    let text = cells.get(row);
                    match out.missing.iter_mut().find(|(known, _)| known == text) {
                        Some((_, count)) => *count += 1,
                        None => out.missing.push((text.to_owned(), 1)),
                    }
                }
                Value::Text => out.values.push(ohms_of(table, channel, row)?),
            }
        }
        out.missing.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        Ok(out)
    }
}

/// Converts a number of a column to the trace's unit.
pub(crate) fn converted(value: f64, scale: Scale) -> f64 {
    in_trace_unit(number(&value.to_string(), DecimalMark::Point, scale.shift()).unwrap_or(value), scale)
}

fn in_trace_unit(number: f64, scale: Scale) -> f64 {
    match scale {
        Scale::Affine(factor, offset) => number * factor + offset,
        Scale::ChangeShift(_) => 1.0 + number,
        // A conductance of zero has no finite resistance; it becomes 0, about which the user is asked.
        Scale::Inverse(_) if number == 0.0 => 0.0,
        Scale::Inverse(_) => number.recip(),
        Scale::Shift(_) | Scale::Stamp => number,
    }
}

/// Reads ohms with a unit in the cell.
fn ohms_of(table: &Table, channel: &Channel, row: usize) -> Result<f64, ImportError> {
    let (cell, name) = (table.columns[channel.place.column].cells.get(row), table.name(channel.place.column));
    let found = ohms(cell.trim(), table.layout.decimal).filter(|_| channel.role == Role::Resistance);
    let found = found.ok_or_else(|| no_number(table, &name, row, cell))?;
    if channel.unit.scale != Scale::Shift(0) {
        let unit = channel.unit.name;
        let what = format!("column {name}: {} has a unit of its own, and the column another, {unit}", quote(cell));
        let place = format!("{}:{}", table.file, table.lines[row]);
        return Err(ImportError::question(
            &place,
            what,
            ["--unit resistance=ohm if numbers without one are ohms".into()],
        ));
    }
    Ok(found)
}

/// Returns the question whether a text among numbers is a missing value.
fn no_number(table: &Table, name: &str, row: usize, cell: &str) -> ImportError {
    let line = table.lines[row];
    let what = format!("column {name}: expected a number, found {}", quote(cell));
    if cell.contains(char::is_control) || cell.is_empty() {
        return ImportError::content(&table.file, line, Fault::new("a number", quote(cell)));
    }
    let answer = format!("--missing {} if it means a missing value", quoted(cell));
    ImportError::question(&format!("{}:{line}", table.file), what, [answer])
}

/// Refuses values that are not resistances, and names the flag for their kind.
pub(crate) fn check_positive(tables: &[Table], channel: &Channel, values: &[f64]) -> Result<(), ImportError> {
    let Some(row) = values.iter().position(|value| *value <= 0.0) else { return Ok(()) };
    let (table, column, role) = (&tables[channel.place.file], channel.place.column, channel.role);
    let missing = format!("--missing {} if it means a missing value", quoted(table.columns[column].cells.get(row)));
    let answers = if values[row] < 0.0 {
        vec![format!("--magnitude {role} if signs are arbitrary"), missing]
    } else {
        vec![format!("--drop-zeros {role} if zeros are missing values")]
    };
    let (name, found) = (table.name(column), rounded(values[row], DIGITS));
    let what = format!("column {name}: expected a positive resistance, found {found}");
    Err(ImportError::question(&format!("{}:{}", table.file, table.lines[row]), what, answers))
}
