//! Records of `label: value`, as boards and command-line tools print them: on one line or over several.
//!
//! A record ends where one of its labels is repeated, or at a line of `---`. Labels below an indented one, as in YAML,
//! are distinguished by the labels above them.

use std::collections::HashMap;

use crate::import::bytes::{Cell, Rows};
use crate::import::table::grid::{ARROW, MONITOR_CLOCK, SAMPLE, behind_arrow};
use crate::import::words::stamp::SPLIT_SECONDS;
use crate::import::words::{DecimalMark, Value, amount, has_groups, is_stamp, number, units, value};

/// Name of the separator in the layout.
pub(crate) const SEPARATOR: &str = "labels (serial plotter)";
/// Largest number of labels in a record; text with more of them is prose.
const MOST_LABELS: usize = 1000;
/// Longest label, bytes; longer ones are sentences.
const LONGEST_LABEL: usize = 60;
/// A file of records.
pub(crate) struct Records<'a> {
    pub headings: Vec<String>,
    pub rows: Rows<'a>,
    /// Row with the most values, the model for the others.
    pub fullest: usize,
    /// The decimal mark, and whether commas may equally well group thousands.
    pub decimal: (DecimalMark, bool),
}

/// A record; one without values is a line of another kind.
struct Record<'a> {
    line: u64,
    /// Text that a serial monitor writes before its first line.
    clock: &'a str,
    values: Vec<(usize, &'a str)>,
}

struct Column {
    heading: String,
    source: Source,
}

enum Source {
    /// The value after a label, without the unit that all its values share.
    Value { label: usize, unit: Option<String> },
    /// Whole seconds and a fraction, with the number of digits of its unit.
    Seconds { whole: usize, fraction: usize, digits: usize },
}

impl<'a> Records<'a> {
    /// Finds the records of lines that are not blank; `None` if most lines are of another kind, or if no label is
    /// repeated.
    pub(crate) fn find(lines: &[(u64, &'a str)], has_clock: bool) -> Option<Self> {
        let body = |line: &'a str| if has_clock { behind_arrow(line) } else { line };
        if !are_records(lines.iter().take(SAMPLE).map(|(_, line)| body(line))) {
            return None;
        }
        let (mut labels, mut rows, mut current) = (Labels::default(), Vec::new(), None::<Record>);
        for &(line, text) in lines {
            if is_rule(body(text)) {
                rows.extend(current.take());
                labels.above.clear();
                continue;
            }
            let clock = text.split_once(ARROW).filter(|_| has_clock).map_or("", |(clock, _)| clock.trim());
            let empty = || Record { line, clock, values: Vec::new() };
            let Some(pairs) = labels.of_line(body(text)) else {
                rows.push(empty());
                continue;
            };
            for (label, value) in pairs {
                if current.as_ref().is_some_and(|record| record.values.iter().any(|(known, _)| *known == label)) {
                    rows.extend(current.take());
                }
                current.get_or_insert_with(empty).values.push((label, value));
            }
            if labels.names.len() > MOST_LABELS {
                return None;
            }
        }
        rows.extend(current);
        let columns = columns(&labels.names, &rows);
        let clock = has_clock.then(|| MONITOR_CLOCK.to_owned());
        Some(Self {
            fullest: (0..rows.len()).rev().max_by_key(|row| rows[*row].values.len()).unwrap_or(0),
            decimal: decimal(&rows),
            rows: rows.iter().map(|record| (record.line, record.cells(&columns, has_clock))).collect(),
            headings: clock.into_iter().chain(columns.into_iter().map(|column| column.heading)).collect(),
        })
    }
}

impl<'a> Record<'a> {
    /// Returns the cells of a record, after the clock of a serial monitor.
    fn cells(&self, columns: &[Column], has_clock: bool) -> Vec<Cell<'a>> {
        let value =
            |label: usize| self.values.iter().find(|(known, _)| *known == label).map_or("", |(_, value)| *value);
        let cell = |column: &Column| match &column.source {
            Source::Value { label, unit } => {
                let (value, unit) = (value(*label), unit.as_deref().unwrap_or_default());
                Cell::text(value.strip_suffix(unit).unwrap_or(value))
            }
            Source::Seconds { whole, fraction, digits } => match (value(*whole), value(*fraction)) {
                ("", _) | (_, "") => Cell::Empty,
                (whole, fraction) => Cell::Text(format!("{whole}.{fraction:0>digits$}").into()),
            },
        };
        let clock = has_clock.then(|| Cell::text(self.clock));
        clock.into_iter().chain(columns.iter().map(cell)).collect()
    }
}

/// Returns the decimal mark of values, and whether commas may equally well group thousands.
fn decimal(rows: &[Record]) -> (DecimalMark, bool) {
    let values = || rows.iter().flat_map(|row| &row.values).map(|(_, value)| *value);
    let is_comma = |value: &&str| value.contains(',') && number(value, DecimalMark::Comma, 0).is_some();
    let mut commas = values().filter(is_comma).peekable();
    if commas.peek().is_none() || values().any(|value| value.contains('.') && !is_stamp(value)) {
        return (DecimalMark::Point, false);
    }
    (DecimalMark::Comma, commas.all(|value| has_groups(value, DecimalMark::Point)))
}

/// Labels in order of their first appearance, each with those above it.
#[derive(Default)]
struct Labels<'a> {
    names: Vec<String>,
    numbers: HashMap<String, usize>,
    /// Labels without a value above the next line, with their indents.
    above: Vec<(usize, &'a str)>,
}

impl<'a> Labels<'a> {
    /// Returns labels and values of a line; none for a label that is above others.
    fn of_line(&mut self, line: &'a str) -> Option<Vec<(usize, &'a str)>> {
        let pairs = pairs(line)?;
        let indent = line.len() - line.trim_start().len();
        while self.above.last().is_some_and(|(above, _)| *above >= indent) {
            self.above.pop();
        }
        if let [(label, "")] = pairs[..] {
            self.above.push((indent, label));
            return Some(Vec::new());
        }
        Some(pairs.into_iter().map(|(label, value)| (self.number(label), value)).collect())
    }

    fn number(&mut self, label: &str) -> usize {
        let above = self.above.iter().map(|(_, label)| *label);
        let name = above.chain([label]).collect::<Vec<_>>().join(".");
        if let Some(known) = self.numbers.get(&name) {
            return *known;
        }
        self.names.push(name.clone());
        self.numbers.insert(name, self.names.len() - 1);
        self.names.len() - 1
    }
}

/// True if more than four lines in five have only repeated labels, and some repeated label has only numbers.
fn are_records<'a>(lines: impl Iterator<Item = &'a str>) -> bool {
    let (mut labels, mut all) = (Labels::default(), Vec::new());
    for line in lines.filter(|line| !is_rule(line)) {
        all.push(labels.of_line(line));
    }
    let pairs = || all.iter().flatten().flatten();
    // Number of occurrences of each label, and whether all of its values are numbers.
    let mut known = vec![(0_usize, true); labels.names.len()];
    for (label, value) in pairs() {
        known[*label].0 += 1;
        known[*label].1 &= is_amount(value);
    }
    let recurs = |pairs: &Vec<(usize, &str)>| pairs.iter().all(|(label, _)| known[*label].0 > 1);
    let fitting = all.iter().flatten().filter(|pairs| recurs(pairs)).count();
    fitting * 10 > all.len() * 8 && known.iter().any(|(count, is_number)| *count > 1 && *is_number)
}

/// True if a text is a number, perhaps with a unit, or a time.
fn is_amount(text: &str) -> bool {
    let is_number = |mark: &DecimalMark| amount(text, *mark) != Value::Text;
    [DecimalMark::Point, DecimalMark::Comma].iter().any(is_number) || is_stamp(text) || unit_behind(text).is_some()
}

/// Returns the unit after a number.
fn unit_behind(text: &str) -> Option<&str> {
    let (amount, unit) = text.rsplit_once(char::is_whitespace)?;
    let is_number = number(amount.trim(), DecimalMark::Point, 0).or(number(amount.trim(), DecimalMark::Comma, 0));
    (is_number.is_some() && units::is_unit(unit)).then_some(unit)
}

/// True if a line separates records.
fn is_rule(line: &str) -> bool {
    let line = line.trim();
    line.len() > 1 && line.bytes().all(|byte| matches!(byte, b'-' | b'=' | b'*' | b'_' | b'#'))
}

/// Returns labels and values of a line: several numbers, `R:1600.5,strain:0.1`, or one value of any kind,
/// `frame: base`.
fn pairs(line: &str) -> Option<Vec<(&str, &str)>> {
    several(line.trim()).or_else(|| {
        let (label, value) = line.split_once([':', '='])?;
        let label = label.trim();
        (is_label(label) && !label.contains([',', ';', '\t'])).then(|| vec![(label, value.trim())])
    })
}

fn several(line: &str) -> Option<Vec<(&str, &str)>> {
    const BETWEEN: [char; 4] = [',', '\t', ' ', ';'];
    let (mut found, mut rest) = (Vec::new(), line);
    while !rest.is_empty() {
        let (label, behind) = rest.split_once([':', '='])?;
        let (label, behind) = (label.trim(), behind.trim_start());
        let (text, next) = behind.split_at(behind.find(BETWEEN).unwrap_or(behind.len()));
        if !is_label(label) || label.contains(BETWEEN) || value(text, DecimalMark::Point, 0, &[]) == Value::Text {
            return None;
        }
        found.push((label, text));
        rest = next.trim_start_matches(BETWEEN);
    }
    (!found.is_empty()).then_some(found)
}

fn is_label(text: &str) -> bool {
    text.starts_with(char::is_alphabetic) && text.len() <= LONGEST_LABEL
}

/// Returns the columns of labels. A label is shown without those above it if its name is unique.
fn columns(names: &[String], rows: &[Record]) -> Vec<Column> {
    let last = |name: &str| name.rsplit('.').next().unwrap_or_default().to_owned();
    let above = |name: &str| name.rsplit_once('.').map_or("", |(above, _)| above).to_owned();
    let split = |first: &str| {
        SPLIT_SECONDS.iter().find_map(|(whole, fraction, digits)| {
            let is_fraction = |name: &&String| last(name) == *fraction && above(name) == above(first);
            let at = names.iter().position(|name| is_fraction(&name))?;
            (last(first) == *whole).then_some((at, *digits))
        })
    };
    let units = units_of_all(names.len(), rows);
    let fractions: Vec<usize> = names.iter().filter_map(|name| split(name)).map(|(at, _)| at).collect();
    let is_alone = |name: &str| names.iter().filter(|other| last(other) == last(name)).count() == 1;
    let column = |(label, name): (usize, &String)| {
        if let Some((fraction, digits)) = split(name) {
            let above = if above(name).is_empty() { "stamp".to_owned() } else { above(name) };
            let heading = if is_alone(name) { last(&above) } else { above };
            let source = Source::Seconds { whole: label, fraction, digits };
            return Column { heading: format!("{heading} (s)"), source };
        }
        let name = if is_alone(name) { last(name) } else { name.clone() };
        let unit = units[label].flatten().map(str::to_owned);
        let heading = unit.as_ref().map_or(name.clone(), |unit| format!("{name} ({unit})"));
        Column { heading, source: Source::Value { label, unit } }
    };
    names.iter().enumerate().filter(|(label, _)| !fractions.contains(label)).map(column).collect()
}

/// Returns the unit after every value of a label: `Some(None)` if there is none, or if they differ.
fn units_of_all<'a>(labels: usize, rows: &[Record<'a>]) -> Vec<Option<Option<&'a str>>> {
    let mut units: Vec<Option<Option<&str>>> = vec![None; labels];
    for (label, text) in rows.iter().flat_map(|row| &row.values) {
        let unit = unit_behind(text);
        // A missing value has no unit.
        if unit.is_some() || value(text, DecimalMark::Point, 0, &[]) != Value::Missing {
            let known = units[*label].get_or_insert(unit);
            *known = known.filter(|known| Some(*known) == unit);
        }
    }
    units
}
