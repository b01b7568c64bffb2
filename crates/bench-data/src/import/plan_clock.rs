use crate::import::candidates::{Candidate, candidates, find, list, several};
use crate::import::channel::name;
use crate::import::clock::Clock;
use crate::import::error::ImportError;
use crate::import::plan_units::channel;
use crate::import::preset::{Preset, increases};
use crate::import::recipe::Recipe;
use crate::import::roles::Role;
use crate::import::table::Table;

/// The clock of a value's column: what the recipe says, a rate, or a column of times in the same file.
pub(crate) fn clock(
    tables: &[Table],
    recipe: &Recipe,
    (role, table, column): (Role, usize, usize),
    remarks: &mut Vec<String>,
) -> Result<Clock, ImportError> {
    if let Some(Some(wanted)) = recipe.column(role) {
        let (table, column) = find(tables, role, wanted)?;
        return channel(tables, recipe, (role, table, column), remarks).map(Clock::Column);
    }
    // The readings' time is the reference's too if both stand in one file.
    if role == Role::ReferenceTime
        && let Some(Some(wanted)) = recipe.column(Role::Time)
        && let Ok((found, column)) = find(tables, role, wanted)
        && found == table
    {
        return channel(tables, recipe, (Role::Time, found, column), remarks).map(Clock::Column);
    }
    if let Some(hz) = recipe.rate_hz {
        return Ok(Clock::Rate { table, hz });
    }
    let is_time = |found: &Candidate| found.table == table && found.role == Role::Time;
    let mut times: Vec<Candidate> = candidates(tables).into_iter().filter(is_time).collect();
    if times.iter().any(|time| time.is_named) {
        times.retain(|time| time.is_named);
    }
    let place = match times[..] {
        [] => return Err(no_time(&tables[table], role)),
        [one] => one.column,
        _ => beside(&tables[table], &times, column)
            .ok_or_else(|| several(tables, role, &times.iter().map(|time| (table, time.column)).collect::<Vec<_>>()))?,
    };
    if times.len() > 1 {
        let (time, value) = (name(&tables[table], place), name(&tables[table], column));
        remarks
            .push(format!("{}: {time} is taken for the clock of {value}, beside which it stands", tables[table].file));
    }
    if !times.iter().any(|time| time.is_named) {
        remarks.push(format!("{}: {} is taken for the time", tables[table].file, name(&tables[table], place)));
    }
    // Unless it is another column, the reference's clock is under the name that the readings' has.
    let role = if role == Role::ReferenceTime && times.len() == 1 { Role::Time } else { role };
    channel(tables, recipe, (role, table, place), remarks).map(Clock::Column)
}

/// The time column beside a value, where every value has one on the same side: `t1, v1, t2, v2` or `v1, t1, v2, t2`.
fn beside(table: &Table, times: &[Candidate], column: usize) -> Option<usize> {
    let is_time = |place: usize| times.iter().any(|time| time.column == place);
    let places: Vec<usize> = (0..table.columns.len()).collect();
    let alternate = |first: bool| places.iter().all(|place| is_time(*place) == (place % 2 == usize::from(!first)));
    if places.len() % 2 == 1 {
        return None;
    }
    if alternate(true) {
        column.checked_sub(1)
    } else if alternate(false) {
        Some(column + 1)
    } else {
        None
    }
}

/// Nothing says what the time is.
fn no_time(table: &Table, role: Role) -> ImportError {
    let rising: Vec<usize> = (0..table.columns.len()).filter(|column| increases(table, *column)).collect();
    let mut answers: Vec<String> = rising.iter().map(|column| format!("--column {role}={}", column + 1)).collect();
    answers.push("--rate-hz HZ".to_owned());
    let what = format!("which column is the time among {}{}", list(table), rising_words(&rising));
    ImportError::question(&table.file, what, answers)
}

fn rising_words(rising: &[usize]) -> String {
    match rising {
        [] => ", none of which increases throughout".to_owned(),
        [one] => format!(" (number {} increases)", one + 1),
        _ => {
            let numbers: Vec<String> = rising.iter().map(|column| (column + 1).to_string()).collect();
            format!(" (numbers {} increase)", numbers.join(", "))
        }
    }
}

/// Nothing says which column holds the readings.
pub(crate) fn no_readings(tables: &[Table]) -> ImportError {
    let Some(table) = tables.first() else { return ImportError::unreadable("import", "expected a file, found none") };
    if let Some(preset) = tables.iter().find_map(Preset::that_fits) {
        let what = "no header; seven columns of which the third, fifth and seventh increase";
        let own = "--column time=N --column resistance=N".to_owned();
        return ImportError::question(&table.file, what, [format!("--preset {preset}"), own]);
    }
    let files: Vec<&str> = tables.iter().map(|table| table.file.as_str()).collect();
    let lists: Vec<String> = tables.iter().map(list).collect();
    let none = if tables.iter().any(Table::has_names) {
        "which column holds the readings"
    } else {
        "no header; which column is what"
    };
    let what = format!("{none} among {}", lists.join(" and "));
    if tables.iter().any(Table::has_names) {
        let answers = ["resistance", "ratio", "adc"].map(|role| format!("--column {role}=NAME"));
        return ImportError::question(&files.join(", "), what, answers);
    }
    let rising: Vec<usize> = (0..table.columns.len()).filter(|column| increases(table, *column)).collect();
    let answer = "--column time=N --column resistance=N --column strain=N (ratio, adc; displacement, angle, none)";
    ImportError::question(&files.join(", "), what + &rising_words(&rising), [answer.to_owned()])
}
