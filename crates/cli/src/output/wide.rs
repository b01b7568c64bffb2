//! Text that fits a terminal.

use comfy_table::{ContentArrangement, Row, Table, presets};

pub use ohmstrain::wrap::COLUMNS;

/// A table without rows.
pub fn table(header: impl Into<Row>) -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(header);
    table
}

/// The same, of which cells are wrapped where it would be too wide.
pub fn wrapped_table(header: impl Into<Row>) -> Table {
    let mut table = table(header);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(COLUMNS as u16);
    table
}

/// A text whose lines are broken between words; what goes on is indented as its line was.
pub fn wrapped(text: &str) -> String {
    let line = |line: &str| {
        let indent = &line[..line.len() - line.trim_start().len()];
        ohmstrain::wrap::wrapped(line, indent, indent)
    };
    text.lines().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::wrapped;

    #[test]
    fn lines_are_broken_between_words_and_keep_their_indent() {
        assert_eq!(wrapped("short\n\n  a line\n"), "short\n\n  a line\n");
        let long = format!("  {} end", ["word"; 30].join(" "));
        let lines: Vec<String> = wrapped(&long).lines().map(str::to_owned).collect();
        // Two of indent and 19 words of five, the last without its blank, are 96.
        assert_eq!(lines, [format!("  {}", ["word"; 19].join(" ")), format!("  {} end", ["word"; 11].join(" "))]);
    }
}
