use crate::import::error::ImportError;
use crate::import::roles::decision::{Clock, Place, Taken};
use crate::import::roles::facts::{Candidate, Found};
use crate::import::roles::find::{find, several};
use crate::import::roles::recipe::Recipe;
use crate::import::roles::unit::channel;
use crate::import::table::{Table, all_files};
use crate::import::words::Role;

/// The clock of a value's column: what the answers say, a rate, or a column of times in the same file. `role` is that of
/// its times.
pub(crate) fn clock(
    found: &Found,
    answers: &Recipe,
    role: Role,
    value: Place,
    remarks: &mut Vec<String>,
) -> Result<Clock, ImportError> {
    if let Some(Some(wanted)) = answers.column(role) {
        let place = find(found, role, wanted)?;
        return channel(found, answers, Taken { role, place }, remarks).map(Clock::Column);
    }
    // The readings' time is the reference's too if both stand in one file.
    if role == Role::ReferenceTime
        && let Some(Some(wanted)) = answers.column(Role::Time)
        && let Ok(place) = find(found, role, wanted)
        && place.file == value.file
    {
        return channel(found, answers, Taken { role: Role::Time, place }, remarks).map(Clock::Column);
    }
    if let Some(hz) = answers.rate_hz {
        return Ok(Clock::Rate { file: value.file, hz });
    }
    let is_time = |one: &&Candidate| one.table == value.file && one.role == Role::Time;
    let mut times: Vec<&Candidate> = found.candidates.iter().filter(is_time).collect();
    let is_named = times.iter().any(|time| time.is_named);
    times.retain(|time| time.is_named || !is_named);
    let table = found.table(value);
    let column = match times[..] {
        [] => return Err(no_time(found, value.file, role)),
        [one] => one.column,
        _ => beside(table.columns.len(), &times, value.column).ok_or_else(|| {
            let taken: Vec<Taken> = times.iter().map(|time| Taken { role, place: time.place() }).collect();
            several(found, &format!("the {role}"), &taken)
        })?,
    };
    let name = table.name(column);
    if times.len() > 1 {
        let value = found.name(value);
        remarks.push(format!("{}: {name} is taken for the clock of {value}, beside which it stands", table.file));
    }
    if !is_named {
        remarks.push(format!("{}: {name} is taken for the time", table.file));
    }
    // Unless it is another column, the reference's clock is under the name that the readings' has.
    let role = if role == Role::ReferenceTime && times.len() == 1 { Role::Time } else { role };
    channel(found, answers, Taken { role, place: Place { column, ..value } }, remarks).map(Clock::Column)
}

/// The time column beside a value, where every value has one on the same side: `t1, v1, t2, v2` or `v1, t1, v2, t2`.
fn beside(columns: usize, times: &[&Candidate], column: usize) -> Option<usize> {
    let is_time = |place: usize| times.iter().any(|time| time.column == place);
    let alternate =
        |first: usize| columns.is_multiple_of(2) && (0..columns).all(|place| is_time(place) == (place % 2 == first));
    match (alternate(0), alternate(1)) {
        (true, _) => column.checked_sub(1),
        (_, true) => Some(column + 1),
        _ => None,
    }
}

/// Nothing says what the time is.
fn no_time(found: &Found, file: usize, role: Role) -> ImportError {
    let (table, rising) = (&found.tables[file], found.rising(file));
    let mut answers: Vec<String> = rising.iter().map(|column| format!("--column {role}={}", column + 1)).collect();
    answers.push("--rate-hz HZ".to_owned());
    let what = format!("which column is the time among {}{}", table.list(), rising_words(&rising));
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
pub(crate) fn no_readings(found: &Found) -> ImportError {
    let tables = found.tables;
    let Some(table) = tables.first() else { return ImportError::unreadable("import", "expected a file, found none") };
    if let Some(preset) = found.preset {
        let what = "no header; seven columns of which the third, fifth and seventh increase";
        let own = "--column time=N --column resistance=N".to_owned();
        return ImportError::question(&table.file, what, [format!("--preset {preset}"), own]);
    }
    let files = all_files(tables);
    let lists = tables.iter().map(Table::list).collect::<Vec<_>>().join(" and ");
    if tables.iter().any(Table::has_names) {
        let answers = Role::READINGS.map(|role| format!("--column {role}=NAME"));
        return ImportError::question(&files, format!("which column holds the readings among {lists}"), answers);
    }
    let what = format!("no header; which column is what among {lists}{}", rising_words(&found.rising(0)));
    let answer = "--column time=N --column resistance=N --column strain=N (ratio, adc; displacement, angle, none)";
    ImportError::question(&files, what, [answer.to_owned()])
}
