//! Printable form of text from files, devices and file names, for a terminal.
//!
//! All text for people passes through here on its way out: messages in [`Messages`](crate::messages::Messages), tables in
//! [`print`](crate::output::print), the picture of `live`, titles of reports. Data (rows of CSV, JSON) does not.

use std::borrow::Cow;
use std::fmt::Write;

/// Escapes one line of text. Characters that move the cursor, colour, reorder or hide their surroundings become escapes such as
/// `\u{1b}`; so does an end of line.
pub fn printable(text: &str) -> Cow<'_, str> {
    if text.chars().all(is_shown) {
        return Cow::Borrowed(text);
    }
    let escaped = |c: char| if is_shown(c) { c.to_string() } else { c.escape_debug().to_string() };
    Cow::Owned(text.chars().map(escaped).collect())
}

/// Escapes several lines of text, each as [`printable`] does.
pub fn printable_lines(text: &str) -> String {
    text.split('\n').map(printable).collect::<Vec<_>>().join("\n")
}

/// Escapes JSON in the same way, with the escapes of JSON in its strings.
pub fn printable_json(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if c == '\n' || is_shown(c) {
            out.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                let _ = write!(out, "\\u{unit:04x}");
            }
        }
    }
    out
}

/// True if a terminal shows a character as itself: all that `str::escape_debug` leaves as it is, and quotation marks. That
/// includes a combining mark after a letter.
fn is_shown(c: char) -> bool {
    if c.is_ascii() {
        return c == ' ' || c.is_ascii_graphic();
    }
    // Tested behind another character, because a combining mark is escaped at the start of a text.
    let mut behind = String::from("-");
    behind.push(c);
    behind.escape_debug().eq(behind.chars())
}

#[cfg(test)]
mod tests {
    use super::{printable, printable_json, printable_lines};

    #[test]
    fn only_control_characters_of_a_terminal_are_escaped() {
        let plain = "it's `C:\\x` \"5 Ω ± 2 %\" für 日本 u\u{308}";
        assert_eq!(printable(plain), plain);
        let cases = [
            ("\u{1b}[31mred", "\\u{1b}[31mred"),
            ("a\r\n\tb\u{7}", "a\\r\\n\\tb\\u{7}"),
            // An 8-bit control, right-to-left text, a zero-width space, other line ends.
            ("\u{9b}2J", "\\u{9b}2J"),
            ("\u{202e}vsc.exe\u{2066}", "\\u{202e}vsc.exe\\u{2066}"),
            ("a\u{200b}b\u{feff}\u{2028}\u{85}", "a\\u{200b}b\\u{feff}\\u{2028}\\u{85}"),
        ];
        for (foreign, shown) in cases {
            assert_eq!(printable(foreign), shown);
            assert_eq!(
                printable_lines(&format!("{plain}\n{foreign}")),
                format!("{plain}\n{}", printable_lines(foreign))
            );
        }
    }

    #[test]
    fn json_stays_the_same_json() {
        let text = serde_json::to_string_pretty(&["\u{202e}a\u{9b}", "\u{1b}\n\"\\", "\u{e0001}Ω"]).unwrap();
        let shown = printable_json(&text);
        assert!(shown.chars().all(|c| c == '\n' || c == 'Ω' || c == ' ' || c.is_ascii_graphic()), "{shown}");
        let read = |text: &str| serde_json::from_str::<Vec<String>>(text).unwrap();
        assert_eq!(read(&shown), read(&text));
    }
}
