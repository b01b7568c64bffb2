use crate::import::error::{ImportError, quoted};
use crate::import::roles::decision::{FileColumn, Taken};
use crate::import::roles::facts::Found;
use crate::import::roles::recipe::{ColumnName, NO_COLUMN, Recipe};
use crate::import::table::Table;
use crate::import::words::{Role, names};

/// Prefix of a column number, for files whose columns have numbers as names.
const COUNTED: char = '#';
/// Largest number of columns that a question lists.
const MOST_NAMED: usize = 6;

/// Returns the column that an answer names.
pub(crate) fn find(found: &Found, role: Role, wanted: &ColumnName) -> Result<FileColumn, ImportError> {
    let all = || found.places().filter(|place| wanted.file.is_none_or(|file| file == place.file + 1));
    let text = wanted.column.trim();
    let lower = text.to_lowercase();
    let number = text.strip_prefix(COUNTED).unwrap_or(text).parse::<usize>().ok();
    let fits = |way: usize, place: FileColumn| {
        let column = found.column(place);
        match way {
            0 => column.heading == text,
            1 => column.name == text,
            2 => column.heading.to_lowercase() == lower || column.name.to_lowercase() == lower,
            _ => number == Some(place.column + 1),
        }
    };
    // Names take precedence over numbers, so that a column may be called `3`.
    for way in 0..4 {
        let fitting: Vec<Taken> =
            all().filter(|place| !text.is_empty() && fits(way, *place)).map(|place| Taken { role, place }).collect();
        match fitting[..] {
            [] => {}
            [taken] => return Ok(taken.place),
            _ => return Err(several(found, &format!("the {role}"), &fitting)),
        }
    }
    let file = wanted.file.and_then(|file| found.tables.get(file - 1)).or(found.tables.first());
    let (file, names) = file.map_or((String::new(), String::new()), |table| (table.file.clone(), table.list()));
    let expected = format!("--column {role}={}: there is no such column among {names}", quoted(&wanted.to_string()));
    Err(ImportError::question(&file, expected, [format!("--column {role}=NAME with one of them")]))
}

/// Returns the question for several columns that fit a role.
pub(crate) fn several(found: &Found, what: &str, taken: &[Taken]) -> ImportError {
    let others = taken.len().saturating_sub(MOST_NAMED);
    let named = &taken[..taken.len() - others];
    let mut names: Vec<String> = named.iter().map(|taken| found.name(taken.place)).collect();
    let answer =
        |taken: &Taken| format!("--column {}", quoted(&format!("{}={}", taken.role, refer(found.tables, taken.place))));
    let mut answers: Vec<String> = named.iter().map(answer).collect();
    if others > 0 {
        names.push(format!("{others} more"));
        answers.push("another of them".to_owned());
    }
    let mut files: Vec<&str> = taken.iter().map(|taken| found.table(taken.place).file.as_str()).collect();
    files.dedup();
    ImportError::question(&files.join(", "), format!("{} may be {what}", names.join(" and ")), answers)
}

/// Returns the shortest unambiguous name of a column: its heading if that is unique and can be typed, its number otherwise.
pub(crate) fn refer(tables: &[Table], place: FileColumn) -> ColumnName {
    let columns = &tables[place.file].columns;
    let heading = &columns[place.column].heading;
    let are_called = |name: &str| columns.iter().filter(|column| column.heading == name || column.name == name).count();
    let is_sure = !heading.is_empty()
        && are_called(heading) == 1
        && heading.trim() == heading
        && heading != NO_COLUMN
        && !heading.contains(char::is_control)
        && (!heading.starts_with(|c: char| c.is_ascii_digit()) || heading.parse::<f64>().is_ok());
    let file = (tables.len() > 1).then_some(place.file + 1);
    let number = (place.column + 1).to_string();
    let column = match are_called(&number) {
        _ if is_sure => heading.clone(),
        0 => number,
        _ => format!("{COUNTED}{number}"),
    };
    ColumnName { file, column }
}

/// Returns the only one of several columns whose name has the same stem as another column's: `Thumb angle` beside `Thumb`.
fn paired(found: &Found, taken: &[Taken], beside: FileColumn) -> Option<Taken> {
    let stem = |place: FileColumn| names::stem(&found.column(place).name);
    let wanted = stem(beside);
    let mut fitting = taken.iter().filter(|taken| !wanted.is_empty() && stem(taken.place) == wanted);
    fitting.next().copied().filter(|_| fitting.next().is_none())
}

/// Returns the column that an answer, or else a name, assigns to one of several roles; `beside` is a column with which it may share its
/// name.
pub(crate) fn choose(
    found: &Found,
    answers: &Recipe,
    roles: &[Role],
    what: &str,
    beside: Option<FileColumn>,
) -> Result<Option<Taken>, ImportError> {
    let named = roles.iter().find_map(|role| answers.column(*role).flatten().map(|wanted| (*role, wanted)));
    if let Some((role, wanted)) = named {
        return find(found, role, wanted).map(|place| Some(Taken { role, place }));
    }
    let is_taken = |taken: &Taken| {
        let mut names = answers.columns.iter().map(|(_, name)| name);
        names.any(|name| find(found, taken.role, name).is_ok_and(|place| place == taken.place))
    };
    let is_wanted = |role: Role| roles.contains(&role) && answers.column(role).is_none();
    let fitting = |by_name: bool| -> Vec<Taken> {
        let wanted = found.candidates.iter().filter(|one| one.is_named == by_name && is_wanted(one.role));
        wanted.map(|one| Taken { role: one.role, place: one.place() }).filter(|taken| !is_taken(taken)).collect()
    };
    // A unit alone does not determine a role, except beside a column of the same stem: `index_deg` of `index_adc`.
    let of_unit = || beside.and_then(|beside| paired(found, &fitting(false), beside));
    let named = fitting(true);
    match named[..] {
        [] => Ok(of_unit()),
        [one] => Ok(Some(one)),
        _ => match beside.and_then(|beside| paired(found, &named, beside)) {
            Some(pair) => Ok(Some(pair)),
            None => Err(several(found, what, &named)),
        },
    }
}
