//! Text that fits a terminal.

use comfy_table::{ContentArrangement, Table, presets};

/// Columns that no line exceeds where words can be wrapped.
pub const COLUMNS: usize = 100;

/// An empty table whose cells are wrapped where it would be too wide.
pub fn table() -> Table {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(COLUMNS as u16);
    table
}

/// A text whose lines are broken between words; what goes on is indented as its line was.
pub fn wrapped(text: &str) -> String {
    let mut out = String::new();
    for line in text.lines() {
        let indent = &line[..line.len() - line.trim_start().len()];
        let mut width = 0;
        for word in line.split_whitespace() {
            let long = word.chars().count();
            let breaks = width > 0 && width + 1 + long > COLUMNS;
            let between = match (width, breaks) {
                (0, _) => indent,
                (_, true) => &format!("\n{indent}"),
                _ => " ",
            };
            width = long + if width == 0 || breaks { indent.len() } else { width + 1 };
            out += between;
            out += word;
        }
        out.push('\n');
    }
    out
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
