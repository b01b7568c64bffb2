//! Recordings as JSON: an object or a list for each row, on separate lines or in a list, or a list for each column.

use std::borrow::Cow;
use std::collections::HashMap;

use crate::import::bytes::{Cell, Json, Rows, json_values};

/// Largest number of columns; a file with more of them is not a recording.
const MOST_COLUMNS: usize = 1000;

/// Returns the rows of a JSON text, below a line of names if there are any; `None` if the text is not JSON.
pub(crate) fn rows(text: &str) -> Option<Rows<'static>> {
    if !text.trim_start_matches(['\u{feff}', ' ', '\n', '\r', '\t']).starts_with(['{', '[']) {
        return None;
    }
    let mut values = json_values(&with_null(text));
    let others = values.iter().filter(|(_, value)| value.is_none()).count();
    if others * 5 > values.len() {
        return None;
    }
    if let [(_, value)] = &mut values[..] {
        return whole(value.take()?);
    }
    records(values)
}

/// Returns the rows of a file that is a single value.
fn whole(value: Json) -> Option<Rows<'static>> {
    match value {
        Json::List(list) if !list.iter().any(is_cell) => records((1..).zip(list.into_iter().map(Some)).collect()),
        Json::Object(pairs) => of_object(pairs),
        _ => None,
    }
}

/// Returns the rows of columns by name, as lists or as objects indexed by row number; of `columns` beside `data`; or of an object that
/// contains one of these.
fn of_object(pairs: Vec<(String, Json)>) -> Option<Rows<'static>> {
    let named = |wanted: &str| pairs.iter().find(|(name, _)| name == wanted).map(|(_, value)| value);
    if let (Some(Json::List(names)), Some(Json::List(data))) = (named("columns"), named("data")) {
        let names = names.iter().map(|name| if let Json::Cell(name) = name { name.clone() } else { Cell::Empty });
        let mut rows: Rows = vec![(1, names.collect())];
        rows.extend((1..).zip(data).map(|(number, row)| (number, cells_of(row))));
        return Some(rows);
    }
    let longest = pairs.iter().map(|(_, value)| list_of_cells(value).len()).max()?;
    let is_of_rows =
        |value: &Json| matches!(value, Json::List(rows) if rows.len() > longest && !rows.iter().any(is_cell));
    if longest > 1 && !pairs.iter().any(|(_, value)| is_of_rows(value)) {
        let columns = pairs.into_iter().map(|(name, value)| (name, list_of_cells(&value)));
        // Shorter lists are settings, unless they only lack the last values.
        let columns: Vec<_> = columns.filter(|(_, cells)| cells.len() * 10 >= longest * 9).take(MOST_COLUMNS).collect();
        let names = columns.iter().map(|(name, _)| Cell::Text(name.clone().into())).collect();
        let cell = |cells: &[Cell<'static>], row: usize| cells.get(row).cloned().unwrap_or_default();
        let row = |row: usize| (row as u64 + 1, columns.iter().map(|(_, cells)| cell(cells, row)).collect());
        return Some([(1, names)].into_iter().chain((0..longest).map(row)).collect());
    }
    // The object may contain settings beside the recording, and several recordings, one below the other then.
    let found: Vec<Rows> = pairs.into_iter().filter_map(|(_, value)| whole(value)).collect();
    let names = found.iter().rev().max_by_key(|rows| rows.len())?.first()?.1.clone();
    Some(found.into_iter().filter(|rows| rows.first().is_some_and(|(_, first)| *first == names)).flatten().collect())
}

/// Replaces the words for numbers that are not finite, which Python writes and JSON does not have.
fn with_null(text: &str) -> Cow<'_, str> {
    const WORDS: [&str; 3] = ["NaN", "-Infinity", "Infinity"];
    if !WORDS.iter().any(|word| text.contains(word)) {
        return text.into();
    }
    let (mut out, mut rest, mut is_quoted) = (String::with_capacity(text.len()), text, false);
    while let Some(next) = rest.chars().next() {
        let word = WORDS.iter().find(|word| !is_quoted && rest.starts_with(**word));
        let (taken, written) = match (word, next) {
            (Some(word), _) => (word.len(), "null"),
            (None, '\\') if is_quoted => {
                let escaped = rest.chars().take(2).map(char::len_utf8).sum();
                (escaped, &rest[..escaped])
            }
            _ => (next.len_utf8(), &rest[..next.len_utf8()]),
        };
        is_quoted ^= next == '"';
        out.push_str(written);
        rest = &rest[taken..];
    }
    out.into()
}

const fn is_cell(value: &Json) -> bool {
    matches!(value, Json::Cell(_))
}

/// Returns the cells of a column; none if it is something else.
fn list_of_cells(value: &Json) -> Vec<Cell<'static>> {
    let cell = |value: &Json| if let Json::Cell(cell) = value { Some(cell.clone()) } else { None };
    match value {
        Json::List(list) => list.iter().map(cell).collect::<Option<_>>().unwrap_or_default(),
        Json::Object(pairs) if pairs.iter().all(|(name, _)| name.bytes().all(|byte| byte.is_ascii_digit())) => {
            pairs.iter().map(|(_, value)| cell(value)).collect::<Option<_>>().unwrap_or_default()
        }
        _ => Vec::new(),
    }
}

fn cells_of(row: &Json) -> Vec<Cell<'static>> {
    let mut out = Vec::new();
    flatten(String::new(), row, &mut out);
    out.into_iter().map(|(_, cell)| cell).collect()
}

/// Returns the rows of objects, whose keys are the columns, or of lists.
fn records(values: Vec<(u64, Option<Json>)>) -> Option<Rows<'static>> {
    let (mut names, mut places, mut rows) = (Vec::<String>::new(), HashMap::<String, usize>::new(), Rows::new());
    for (line, value) in values {
        let mut cells = Vec::new();
        match value {
            Some(value @ Json::Object(_)) => {
                let mut pairs = Vec::new();
                flatten(String::new(), &value, &mut pairs);
                for (name, cell) in pairs {
                    let place = *places.entry(name.clone()).or_insert_with(|| {
                        names.push(name);
                        names.len() - 1
                    });
                    if cells.len() <= place {
                        cells.resize(place + 1, Cell::Empty);
                    }
                    cells[place] = cell;
                }
            }
            Some(value) => cells = cells_of(&value),
            // Anything that is not JSON is a line of text.
            None => cells.push(Cell::Text("no JSON".into())),
        }
        if names.len() > MOST_COLUMNS {
            return None;
        }
        rows.push((line, cells));
    }
    let width = names.len();
    if width > 0 {
        // A record may lack its last values.
        rows.iter_mut().filter(|(_, cells)| cells.len() > 1).for_each(|(_, cells)| cells.resize(width, Cell::Empty));
        let first = rows.iter().position(|(_, cells)| cells.len() == width).unwrap_or(0);
        let line = rows.get(first).map_or(1, |(line, _)| *line);
        rows.insert(first, (line, shortened(&names).into_iter().map(|name| Cell::Text(name.into())).collect()));
    }
    Some(rows)
}

/// Shortens names to their last word, if that is a unique name of a quantity.
fn shortened(names: &[String]) -> Vec<String> {
    let last = |name: &String| name.rsplit('.').next().unwrap_or_default().to_owned();
    let short = |name: &String| {
        let is_only = names.iter().filter(|other| last(other) == last(name)).count() == 1;
        let is_name = last(name).starts_with(char::is_alphabetic);
        if is_only && is_name { last(name) } else { name.clone() }
    };
    names.iter().map(short).collect()
}

/// Collects the cells in a value, named by their path: `stamp.sec`, `position.0`.
fn flatten(name: String, value: &Json, out: &mut Vec<(String, Cell<'static>)>) {
    let below = |part: &str| if name.is_empty() { part.to_owned() } else { format!("{name}.{part}") };
    match value {
        Json::Cell(cell) => out.push((name, cell.clone())),
        Json::List(list) => {
            list.iter().enumerate().for_each(|(place, value)| flatten(below(&place.to_string()), value, out))
        }
        Json::Object(pairs) => pairs.iter().for_each(|(part, value)| flatten(below(part), value, out)),
    }
}
