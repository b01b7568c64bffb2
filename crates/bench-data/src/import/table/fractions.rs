//! Clocks in two columns: whole seconds, or a time of day, in one and their decimals in another.

use crate::import::bytes::Cells;
use crate::import::table::columns::{Column, Table};
use crate::import::words::stamp::SPLIT_SECONDS;
use crate::import::words::{DecimalMark, Role, is_stamp, names};

/// Names of columns of fractions beside times of day, and the digits of a fraction; `None` for a decimal fraction of a second.
const FRACTIONS: [(&str, Option<usize>); 10] = [
    ("frac", None),
    ("subsec", None),
    ("millis", Some(3)),
    ("msec", Some(3)),
    ("ms", Some(3)),
    ("micros", Some(6)),
    ("usec", Some(6)),
    ("us", Some(6)),
    ("nanos", Some(9)),
    ("nsec", Some(9)),
];

/// Appends the fractions of a second to the whole seconds, in the column of the latter.
pub(crate) fn join(table: &mut Table) {
    let pairs: Vec<(usize, Joined)> =
        (0..table.columns.len()).filter_map(|whole| Some((whole, joined(table, whole)?))).collect();
    for (whole, Joined { fraction, cells, unit }) in pairs {
        let heading = format!("{} + {}", table.columns[whole].heading, table.columns[fraction].heading);
        table.columns[whole] = Column { name: "time".to_owned(), heading, unit, cells };
        // By itself it is no time.
        "fraction".clone_into(&mut table.columns[fraction].name);
    }
}

/// A clock joined with its fractions, and the column of these.
struct Joined {
    fraction: usize,
    cells: Cells,
    unit: Option<String>,
}

fn joined(table: &Table, whole: usize) -> Option<Joined> {
    let cells = &table.columns[whole].cells;
    let is_day = cells.iter().any(|cell| cell.contains(':'));
    let fits = |fraction: &usize| *fraction != whole;
    let others = (0..table.columns.len()).filter(fits);
    let decimal = table.layout.decimal;
    let found = others.filter_map(|fraction| {
        let digits = if is_day { of_a_day(table, fraction) } else { of_seconds(table, whole, fraction).map(Some) }?;
        Some((fraction, digits))
    });
    let mut joined = found.filter_map(|(fraction, digits)| {
        let fractions = &table.columns[fraction].cells;
        let mut out = Cells::default();
        for row in 0..cells.len() {
            out.push(&cell(cells.get(row), fractions.get(row), digits, decimal, is_day)?);
        }
        Some(Joined { fraction, cells: out, unit: (!is_day).then(|| "s".to_owned()) })
    });
    // With two columns of fractions the choice is ambiguous.
    let only = joined.next()?;
    joined.next().is_none().then_some(only)
}

/// Returns the digits of fractions in a column beside times of day. A quantity is no fraction: `Strain (frac)`, `Conductance (uS)`.
fn of_a_day(table: &Table, fraction: usize) -> Option<Option<usize>> {
    let column = &table.columns[fraction];
    if names::role(&column.name, column.unit.as_deref()).is_some_and(|(role, _)| role != Role::Time) {
        return None;
    }
    let heading = column.heading.to_lowercase();
    let words = || heading.split(|c: char| !c.is_alphanumeric());
    // `ms` and `us` must be whole words.
    let is_called =
        |name: &str| words().any(|word| if name.len() == 2 { word == name } else { word.starts_with(name) });
    FRACTIONS.iter().find(|(name, _)| is_called(name)).map(|(_, digits)| *digits)
}

/// Returns the digits of fractions in a column beside whole seconds: `stamp.secs`, `stamp.nsecs`.
fn of_seconds(table: &Table, whole: usize, fraction: usize) -> Option<usize> {
    let [whole, fraction] = [whole, fraction].map(|column| table.columns[column].heading.trim().to_lowercase());
    let is_pair = |(name, part, _): &&(&str, &str, usize)| match (whole.strip_suffix(name), fraction.strip_suffix(part))
    {
        (Some(above), Some(beside)) => above == beside && !above.ends_with(char::is_alphanumeric),
        _ => false,
    };
    SPLIT_SECONDS.iter().find(is_pair).map(|(_, _, digits)| *digits)
}

/// Returns a moment with its fraction; `None` if the two cells are not of that kind.
fn cell(whole: &str, fraction: &str, digits: Option<usize>, decimal: DecimalMark, is_day: bool) -> Option<String> {
    let (whole, fraction) = (whole.trim(), fraction.trim());
    if whole.is_empty() || fraction.is_empty() {
        return Some(String::new());
    }
    let is_count = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    // Workbooks add microseconds, here all zero.
    let seconds = whole.strip_suffix(".000000").unwrap_or(whole);
    let is_whole = if is_day { is_stamp(seconds) && !seconds.contains(['.', ',']) } else { is_count(seconds) };
    let part = match digits {
        Some(digits) => Some(fraction)
            .filter(|count| is_count(count) && count.len() <= digits)
            .map(|count| format!("{count:0>digits$}")),
        None => match fraction.split_once(decimal.character()) {
            Some((zero, part)) => {
                Some(part).filter(|part| zero.trim_start_matches('0').is_empty() && is_count(part)).map(str::to_owned)
            }
            None => Some(fraction).filter(|count| *count == "0").map(str::to_owned),
        },
    }?;
    let mark = if is_day { '.' } else { decimal.character() };
    is_whole.then(|| format!("{seconds}{mark}{part}"))
}
