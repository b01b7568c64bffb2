//! Lines that fit a terminal.

/// Columns that no line exceeds where words can be wrapped.
///
/// ```
/// use ohmstrain::wrap::{COLUMNS, wrapped};
///
/// assert!(wrapped(&["word"; 99].join(" "), "", "").lines().all(|line| line.len() <= COLUMNS));
/// ```
pub const COLUMNS: usize = 100;

/// The words of one line, broken between them where a line would be longer than [`COLUMNS`]: the first line begins with
/// `first`, the others with `rest`, and each ends with an end of line. A number stays with its percent sign or its seconds.
///
/// ```
/// let text = ["word"; 30].join(" ");
/// let wrapped = ohmstrain::wrap::wrapped(&text, "Said: ", "      ");
/// // Six columns, then 18 words of five and one of four.
/// assert_eq!(wrapped.lines().next().map(str::len), Some(6 + 18 * 5 + 4));
/// assert_eq!(wrapped.lines().nth(1), Some(format!("      {}", ["word"; 11].join(" ")).as_str()));
/// ```
#[must_use]
pub fn wrapped(text: &str, first: &str, rest: &str) -> String {
    let (mut out, mut width, mut is_bare) = (first.to_owned(), first.chars().count(), true);
    for word in with_units(text) {
        let long = word.chars().count();
        if !is_bare && width + 1 + long > COLUMNS {
            out += "\n";
            out += rest;
            (width, is_bare) = (rest.chars().count(), true);
        }
        if !is_bare {
            out.push(' ');
            width += 1;
        }
        out += &word;
        (width, is_bare) = (width + long, false);
    }
    out + "\n"
}

/// The words of a text, each number with its percent sign or its seconds.
fn with_units(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let is_unit = word.starts_with('%') || word.trim_end_matches([';', ',', ':', '.']) == "s";
        match words.last_mut() {
            Some(number) if is_unit && number.ends_with(|end: char| end.is_ascii_digit()) => {
                *number += &format!(" {word}");
            }
            _ => words.push(word.into()),
        }
    }
    words
}
