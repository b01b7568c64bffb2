//! Units in a column of their own, as meters write them: `Reading,Unit` above `1.3E+03,Ohm`.

use crate::import::table::columns::Table;
use crate::import::words::units;

/// Names of such columns, in lower case.
const NAMES: [&str; 6] = ["unit", "units", "einheit", "unité", "unidad", "单位"];

/// Moves a unit from the column after a column without one, if all rows have the same unit.
pub(crate) fn take(table: &mut Table) {
    for place in 1..table.columns.len() {
        let (before, behind) = table.columns.split_at_mut(place);
        let (values, column) = (&mut before[place - 1], &behind[0]);
        let mut cells = column.cells.iter().map(str::trim).filter(|cell| !cell.is_empty());
        let Some(unit) = cells.next().filter(|unit| units::is_unit(unit)) else { continue };
        let is_named = NAMES.contains(&column.name.to_lowercase().as_str());
        if is_named && values.unit.is_none() && cells.all(|cell| cell == unit) {
            values.unit = Some(unit.to_owned());
        }
    }
}
