//! Text wrapped to the width of a terminal.

use comfy_table::{ContentArrangement, Row, Table, presets};

/// Largest width of a line, where words can be wrapped.
pub const COLUMNS: usize = 100;

/// Width of the names before sentences.
const HEAD: usize = 13;

/// Creates a table without rows.
pub fn table(header: impl Into<Row>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(header);
    table
}

/// Creates a table whose cells are wrapped where it would be too wide.
pub fn wrapped_table(header: impl Into<Row>) -> Table {
    let mut table = table(header);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(COLUMNS as u16);
    table
}

/// Wraps lines between words; a continued line keeps its indentation.
pub fn wrapped(text: &str) -> String {
    let line = |line: &str| {
        let indent = &line[..line.len() - line.trim_start().len()];
        broken(line, indent, indent)
    };
    text.lines().map(line).collect()
}

/// Lays out names, each with its sentence beside it.
pub fn named(lines: &[(&str, String)]) -> String {
    lines.iter().map(|(name, text)| broken(text, &format!("{name:HEAD$}"), &" ".repeat(HEAD))).collect()
}

/// Wraps one line between words at [`COLUMNS`]. The first line begins with `first`, the others with `rest`, and each ends with
/// a line break. A number stays with its percent sign or its seconds.
fn broken(text: &str, first: &str, rest: &str) -> String {
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

/// Splits a text into words, each number with its percent sign or its seconds.
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

#[cfg(test)]
mod tests {
    use super::{COLUMNS, broken, named, wrapped};

    #[test]
    fn lines_are_broken_between_words_and_keep_their_indent() {
        assert_eq!(wrapped("short\n\n  a line\n"), "short\n\n  a line\n");
        let long = format!("  {} end", ["word"; 30].join(" "));
        let lines: Vec<String> = wrapped(&long).lines().map(str::to_owned).collect();
        // Two of indent and 19 words of five, the last without its blank, are 96.
        assert_eq!(lines, [format!("  {}", ["word"; 19].join(" ")), format!("  {} end", ["word"; 11].join(" "))]);
    }

    #[test]
    fn sentences_stand_beside_their_names() {
        let text = ["word"; 30].join(" ");
        let lines = broken(&text, "Said: ", "      ");
        // Six columns, then 18 words of five and one of four.
        assert_eq!(lines.lines().next().map(str::len), Some(6 + 18 * 5 + 4));
        assert_eq!(lines.lines().nth(1), Some(format!("      {}", ["word"; 11].join(" ")).as_str()));
        assert!(named(&[("Verdict", ["word"; 99].join(" "))]).lines().all(|line| line.len() <= COLUMNS));
    }
}
