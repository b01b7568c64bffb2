use crate::import::error::{ImportError, quoted};
use crate::import::roles::decision::{Clock, FileColumn, Taken};
use crate::import::roles::facts::{Candidate, Found};
use crate::import::roles::find::{find, refer, several};
use crate::import::roles::recipe::Recipe;
use crate::import::roles::unit::channel;
use crate::import::table::{Table, all_files};
use crate::import::words::Role;

/// Finds the clock of a value's column: by the answers, by a rate, or by a column of times in the same file. `role` is that of
/// its times.
pub(crate) fn clock(
    found: &Found,
    answers: &Recipe,
    role: Role,
    value: FileColumn,
    remarks: &mut Vec<String>,
) -> Result<Clock, ImportError> {
    if let Some(Some(wanted)) = answers.column(role) {
        let place = find(found, role, wanted)?;
        return channel(found, answers, Taken { role, place }, remarks).map(Clock::Column);
    }
    // The readings' time is also the reference's if both are in one file.
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
    remarks.extend(without_coarse(found, &mut times));
    let column = match times[..] {
        [] => return Err(no_time(found, value.file, role)),
        [one] => one.column,
        _ => beside(table.columns.len(), &times, value.column).ok_or_else(|| {
            let taken: Vec<Taken> = times.iter().map(|time| Taken { role, place: time.place() }).collect();
            several(found, &format!("the {role}"), &taken)
        })?,
    };
    let name = table.name(column);
    if found.is_coarse(FileColumn { column, ..value }) {
        let others: Vec<usize> = found.rising(value.file).into_iter().filter(|other| *other != column).collect();
        if !others.is_empty() {
            return Err(too_coarse(found, FileColumn { column, ..value }, role, &others));
        }
    }
    if times.len() > 1 {
        let value = found.name(value);
        remarks.push(format!("{}: {name} is taken for the clock of {value}, beside which it stands", table.file));
    }
    if !is_named {
        remarks.push(format!("{}: {name} is taken for the time", table.file));
    }
    // Unless it is another column, the reference's clock has the role of the readings' clock.
    let role = if role == Role::ReferenceTime && times.len() == 1 { Role::Time } else { role };
    channel(found, answers, Taken { role, place: FileColumn { column, ..value } }, remarks).map(Clock::Column)
}

/// Leaves out clocks that do not distinguish rows, if there are others, and returns a remark on that.
fn without_coarse(found: &Found, times: &mut Vec<&Candidate>) -> Option<String> {
    let (coarse, fine): (Vec<&Candidate>, Vec<&Candidate>) =
        times.iter().partition(|time| found.is_coarse(time.place()));
    let first = *coarse.first().filter(|_| !fine.is_empty())?;
    let (table, place) = (&found.tables[first.table], first.place());
    let (name, rows) = (found.name(place), found.facts(place).repeated);
    *times = fine;
    Some(format!("{}: {name} is no clock: {rows} of {} rows have the time of the row before", table.file, table.len()))
}

/// Returns the question for a clock that the names suggest but that does not distinguish rows, while other columns increase.
fn too_coarse(found: &Found, place: FileColumn, role: Role, others: &[usize]) -> ImportError {
    let (table, repeated) = (found.table(place), found.facts(place).repeated);
    let mut answers = rising_answers(found, place.file, role, others);
    answers.push("--rate-hz HZ if the rows are evenly spaced".to_owned());
    let (name, rows) = (found.name(place), table.len());
    let what =
        format!("column {name}: {repeated} of {rows} rows have the time of the row before: the clock is too coarse");
    ImportError::question(&table.file, what, answers)
}

/// Returns the time column beside a value, if every value has one on the same side: `t1, v1, t2, v2` or `v1, t1, v2, t2`.
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

/// Returns the question for an unknown time.
fn no_time(found: &Found, file: usize, role: Role) -> ImportError {
    let (table, rising) = (&found.tables[file], found.rising(file));
    let mut answers = rising_answers(found, file, role, &rising);
    match &table.layout.rate {
        Some((hz, line)) => answers.insert(0, format!("--rate-hz {hz} (as line {line} says)")),
        None => answers.push("--rate-hz HZ".to_owned()),
    }
    let what = format!("which column is the time among {}{}", table.list(), rising_words(table, &rising));
    ImportError::question(&table.file, what, answers)
}

/// Returns answers that name each of these columns.
fn rising_answers(found: &Found, file: usize, role: Role, columns: &[usize]) -> Vec<String> {
    let answer = |column: &usize| {
        let column = refer(found.tables, FileColumn { file, column: *column });
        format!("--column {}", quoted(&format!("{role}={column}")))
    };
    columns.iter().map(answer).collect()
}

fn rising_words(table: &Table, rising: &[usize]) -> String {
    let is_named = rising.iter().all(|column| !table.columns[*column].heading.is_empty());
    let names: Vec<String> = rising.iter().map(|column| table.name(*column)).collect();
    match (rising, is_named) {
        ([], _) => ", none of which increases throughout".to_owned(),
        ([_], true) => format!(" ({} increases)", names[0]),
        ([_], false) => format!(" (number {} increases)", names[0]),
        (_, true) => format!(" ({} increase)", names.join(", ")),
        (_, false) => format!(" (numbers {} increase)", names.join(", ")),
    }
}

/// Returns the question for unknown readings.
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
        let channels = table.columns.iter().filter(|column| is_channel(&column.heading)).count();
        if channels > 1 && table.columns.iter().any(|column| matches!(column.heading.as_str(), "time_s" | "time_us")) {
            let what = format!(
                "a trace of {channels} channels, which needs no import: go on with `ohmstrain calibrate FILE -o hand.toml`"
            );
            return ImportError::unreadable(&files, what);
        }
        let answers = Role::READINGS.map(|role| format!("--column {role}=NAME"));
        return ImportError::question(&files, format!("which column holds the readings among {lists}"), answers);
    }
    let time = found.candidates.iter().find(|one| one.table == 0 && one.role == Role::Time);
    let (known, time) = match time {
        Some(time) => (format!(" ({} is the time)", found.name(time.place())), ""),
        None => (rising_words(table, &found.rising(0)), "--column time=N "),
    };
    let what = format!("no header; which column is what among {lists}{known}");
    let answer = format!("{time}--column resistance=N --column strain=N (ratio, adc; displacement, angle, none)");
    ImportError::question(&files, what, [answer])
}

/// True if a heading is that of one of several channels in a trace: `index_ohm`.
fn is_channel(heading: &str) -> bool {
    ["_ohm", "_ratio", "_adc"].iter().any(|end| heading.strip_suffix(end).is_some_and(|name| !name.is_empty()))
}
