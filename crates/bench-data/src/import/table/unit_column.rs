//! Units in a column of their own, as meters write them: `Reading,Unit` above `1.3E+03,Ohm`.

use crate::import::bytes::Cells;
use crate::import::table::columns::Table;
use crate::import::words::{Role, units};

/// Last words of the names of such columns, in lower case.
const NAMES: [&str; 6] = ["unit", "units", "einheit", "unité", "unidad", "单位"];

/// Moves a unit from the column after a column without one, if all rows have the same unit. Of a meter that changes its range, each number
/// gets the unit in its row.
pub(crate) fn take(table: &mut Table) {
    for place in 1..table.columns.len() {
        let (before, behind) = table.columns.split_at_mut(place);
        let (values, column) = (&mut before[place - 1], &behind[0]);
        let name = column.name.to_lowercase();
        let is_named = name.split([' ', '_', '-', '.']).next_back().is_some_and(|last| NAMES.contains(&last));
        if !is_named || values.unit.is_some() {
            continue;
        }
        let mut filled = column.cells.iter().map(str::trim).filter(|cell| !cell.is_empty());
        let Some(unit) = filled.next().filter(|unit| units::is_unit(unit)) else { continue };
        if filled.clone().all(|cell| cell == unit) {
            values.unit = Some(unit.to_owned());
        } else if filled.all(|cell| units::unit(Role::Resistance, cell).is_some()) {
            let mut cells = Cells::default();
            let rows = values.cells.iter().zip(column.cells.iter());
            rows.for_each(|(value, unit)| cells.push(format!("{} {}", value.trim(), unit.trim()).trim()));
            values.cells = cells;
        }
    }
}
