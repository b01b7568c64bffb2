use crate::import::channel::name;
use crate::import::error::ImportError;
use crate::import::names::{self, Sureness};
use crate::import::number::{number, ohms};
use crate::import::questions::quoted;
use crate::import::recipe::{ColumnName, NO_COLUMN, Recipe};
use crate::import::roles::Role;
use crate::import::stamp::{Order, stamp};
use crate::import::table::{Column, Table};

/// What a column may be, by its name and unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Candidate {
    /// The file, counted from 0.
    pub table: usize,
    /// The column, counted from 0.
    pub column: usize,
    /// What it may be.
    pub role: Role,
    /// Whether the name says so, not the unit alone.
    pub is_named: bool,
}

/// What the columns of files may be.
#[must_use]
pub fn candidates(tables: &[Table]) -> Vec<Candidate> {
    let mut out = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let mut found_here: Vec<(Candidate, Sureness)> = Vec::new();
        for (place, column) in table.columns.iter().enumerate() {
            let found = if column.heading == crate::import::header::MONITOR_CLOCK {
                Some((Role::Time, Sureness::Weak))
            } else if is_date_only(table, place) {
                None
            } else {
                names::role(&column.name, column.unit.as_deref())
            };
            if let Some((role, how)) = found.filter(|_| has_values(table, place)) {
                let is_named = how != Sureness::Weak;
                found_here.push((Candidate { table: index, column: place, role, is_named }, how));
            }
        }
        // `R_1` beside `R` is another thing.
        let strong: Vec<Role> =
            found_here.iter().filter(|(_, how)| *how == Sureness::Strong).map(|(of, _)| of.role).collect();
        found_here.retain(|(of, how)| *how != Sureness::Indexed || !strong.contains(&of.role));
        out.extend(found_here.into_iter().map(|(of, _)| of));
    }
    out
}

/// A column of dates beside one of times of day.
fn is_date_only(table: &Table, column: usize) -> bool {
    let mut filled = table.columns[column].cells.iter().filter(|cell| !cell.is_empty()).take(5).peekable();
    let bare = |cell: &str| Order::ALL.iter().any(|order| stamp(cell, *order).is_some_and(|stamp| !stamp.has_time));
    filled.peek().is_some() && filled.all(bare)
}

/// Whether a column has a number or a date at all.
fn has_values(table: &Table, column: usize) -> bool {
    let decimal = table.layout.decimal;
    let is_value = |cell: &str| {
        number(cell.trim(), decimal, 0).is_some()
            || crate::import::stamp::is_stamp(cell)
            || ohms(cell.trim(), decimal).is_some()
    };
    table.columns[column].cells.iter().any(is_value)
}

/// Finds the column that a flag names.
pub(crate) fn find(tables: &[Table], role: Role, wanted: &ColumnName) -> Result<(usize, usize), ImportError> {
    let in_file = |table: usize| wanted.file.is_none_or(|file| file == table + 1);
    let all: Vec<(usize, usize)> = (0..tables.len())
        .filter(|table| in_file(*table))
        .flat_map(|table| (0..tables[table].columns.len()).map(move |column| (table, column)))
        .collect();
    let column = |&(table, column): &(usize, usize)| &tables[table].columns[column];
    let text = wanted.column.trim();
    let lower = text.to_lowercase();
    let number = text.parse::<usize>().ok();
    let is_alike = |column: &Column| column.heading.to_lowercase() == lower || column.name.to_lowercase() == lower;
    let fits = |way: usize, place: &(usize, usize)| match way {
        0 => column(place).heading == text,
        1 => column(place).name == text,
        2 => is_alike(column(place)),
        _ => number == Some(place.1 + 1),
    };
    // A name before a number, so that a column may be called `3`.
    for way in 0..4 {
        let found: Vec<(usize, usize)> =
            all.iter().copied().filter(|place| !text.is_empty() && fits(way, place)).collect();
        match found[..] {
            [] => {}
            [place] => return Ok(place),
            _ => return Err(several(tables, role, &found)),
        }
    }
    let file = wanted.file.and_then(|file| tables.get(file - 1)).or(tables.first());
    let (file, names) = file.map_or((String::new(), String::new()), |table| (table.file.clone(), list(table)));
    let expected = format!("--column {role}={}: there is no such column among {names}", quoted(&wanted.to_string()));
    Err(ImportError::question(&file, expected, [format!("--column {role}=NAME with one of them")]))
}

/// Several columns might be one thing.
pub(crate) fn several(tables: &[Table], role: Role, found: &[(usize, usize)]) -> ImportError {
    let found: Vec<(Role, (usize, usize))> = found.iter().map(|place| (role, *place)).collect();
    several_roles(tables, &format!("the {role}"), &found)
}

/// Several columns might be what they are named.
fn several_roles(tables: &[Table], what: &str, found: &[(Role, (usize, usize))]) -> ImportError {
    let names: Vec<String> = found.iter().map(|(_, (table, column))| name(&tables[*table], *column)).collect();
    let answer =
        |(role, place): &(Role, _)| format!("--column {}", quoted(&format!("{role}={}", refer(tables, *place))));
    let mut files: Vec<&str> = found.iter().map(|(_, (table, _))| tables[*table].file.as_str()).collect();
    files.dedup();
    let what = format!("{} may be {what}", names.join(" and "));
    ImportError::question(&files.join(", "), what, found.iter().map(answer))
}

/// The shortest sure way to name a column: its heading if that is the only one and can be typed, its number otherwise.
pub(crate) fn refer(tables: &[Table], (table, column): (usize, usize)) -> ColumnName {
    let file = (tables.len() > 1).then_some(table + 1);
    let heading = &tables[table].columns[column].heading;
    let twins =
        tables[table].columns.iter().filter(|other| other.heading == *heading || other.name == *heading).count();
    let is_sure = !heading.is_empty()
        && twins == 1
        && heading.trim() == heading
        && heading != NO_COLUMN
        && !heading.contains(char::is_control)
        && !heading.starts_with(|c: char| c.is_ascii_digit());
    ColumnName { file, column: if is_sure { heading.clone() } else { (column + 1).to_string() } }
}

/// The columns of a table, for messages.
pub(crate) fn list(table: &Table) -> String {
    let names: Vec<String> = (0..table.columns.len()).take(12).map(|column| name(table, column)).collect();
    names.join(", ") + if table.columns.len() > 12 { " …" } else { "" }
}

/// The place that the recipe, or else a name, gives to one of several roles.
pub(crate) fn choose(
    tables: &[Table],
    recipe: &Recipe,
    roles: &[Role],
    what: &str,
) -> Result<Option<(Role, usize, usize)>, ImportError> {
    let mut excluded = Vec::new();
    for &role in roles {
        match recipe.column(role) {
            Some(Some(wanted)) => return find(tables, role, wanted).map(|(table, column)| Some((role, table, column))),
            Some(None) => excluded.push(role),
            None => {}
        }
    }
    let is_free = |found: &Candidate| {
        !recipe
            .columns
            .iter()
            .any(|(_, name)| find(tables, found.role, name).is_ok_and(|place| place == (found.table, found.column)))
    };
    let mut found = candidates(tables);
    found.retain(|found| {
        found.is_named && roles.contains(&found.role) && !excluded.contains(&found.role) && is_free(found)
    });
    match found[..] {
        [] => Ok(None),
        [one] => Ok(Some((one.role, one.table, one.column))),
        _ => {
            let found: Vec<_> = found.iter().map(|of| (of.role, (of.table, of.column))).collect();
            Err(several_roles(tables, what, &found))
        }
    }
}
