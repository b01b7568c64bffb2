use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use crate::MOST_ROWS;
use crate::error::Fault;
use crate::import::bytes::bounds::LONGEST_LINE;

/// Inverse of the fraction of NUL bytes below which bytes count as text.
const MOST_NULS: usize = 50;

/// Decodes text, and returns it with the name of its encoding.
///
/// A byte-order mark decides. Without one, NUL bytes in every other place mean UTF-16; bytes that are not UTF-8 are read as Windows-1252,
/// which includes Latin-1 and has a character for every byte. `None` if the bytes are not text.
pub(crate) fn decode(bytes: Vec<u8>) -> Option<(String, &'static str)> {
    let decoded = |encoding: &'static Encoding, bytes| encoding.decode_without_bom_handling(bytes).0.into_owned();
    if let Some((encoding, mark)) = Encoding::for_bom(&bytes) {
        let name = if encoding == UTF_8 { "UTF-8 with a byte-order mark" } else { encoding.name() };
        return Some((decoded(encoding, &bytes[mark..]), name));
    }
    let head = &bytes[..bytes.len().min(2000)];
    if head.contains(&0) {
        let nuls = |odd: usize| head.iter().skip(odd).step_by(2).filter(|byte| **byte == 0).count();
        let encoding = match (nuls(0), nuls(1)) {
            (0, odd) if odd * 4 > head.len() => Some(UTF_16LE),
            (even, 0) if even * 4 > head.len() => Some(UTF_16BE),
            // A serial line brings a few when it is opened.
            (even, odd) if (even + odd) * MOST_NULS < head.len() => None,
            _ => return None,
        };
        if let Some(encoding) = encoding {
            return Some((decoded(encoding, &bytes), encoding.name()));
        }
    }
    Some(match String::from_utf8(bytes) {
        Ok(text) if text.is_ascii() => (text, "ASCII"),
        Ok(text) => (text, "UTF-8"),
        Err(error) => (decoded(WINDOWS_1252, error.as_bytes()), "Latin-1 (Windows-1252)"),
    })
}

/// Splits text into lines that are not blank, with their numbers, at any line ending.
///
/// # Errors
/// The first line that is too long, or one too many.
pub(crate) fn lines(text: &str) -> Result<Vec<(u64, &str)>, (u64, Fault)> {
    let ends: &[char] = if text.contains('\n') { &['\n'] } else { &['\r', '\n'] };
    let numbered = text.split(ends).zip(1..).map(|(line, number)| (number, line.trim_end_matches('\r')));
    let mut lines = Vec::new();
    // A heading may contain line ends: `"Time\n(s)","Resistance\n(kOhm)"`.
    let (head, skipped) = quoted_head(text);
    if let Some(head) = head {
        lines.push((1, head));
    }
    for (number, line) in numbered.skip(skipped).filter(|(_, line)| !line.trim().is_empty()) {
        if line.len() > LONGEST_LINE {
            return Err((number, Fault::new(format!("a line of at most {LONGEST_LINE} bytes"), "a longer one")));
        }
        if lines.len() == MOST_ROWS {
            let expected = format!("at most {MOST_ROWS} rows: make several files of it");
            return Err((number, Fault::new(expected, "more")));
        }
        lines.push((number, line));
    }
    Ok(lines)
}

/// Returns a first line whose quoted cells contain line ends, and its number of lines; none, and 0, if it is of another kind.
fn quoted_head(text: &str) -> (Option<&str>, usize) {
    const MOST_LINES: usize = 8;
    let is_open = |head: &str| head.matches('"').count() % 2 == 1;
    let ends = text.match_indices('\n').map(|(at, _)| at).take(MOST_LINES).zip(1..);
    let first = text.split('\n').next().unwrap_or_default();
    // The quotation mark that stays open begins a cell; within one it may be a sign for inches.
    let begins_cell =
        |at: usize| first[..at].trim_end_matches(' ').chars().next_back().is_none_or(|c| ",;\t".contains(c));
    if !is_open(first) || !first.rfind('"').is_some_and(begins_cell) {
        return (None, 0);
    }
    let closed = ends.skip(1).find(|(end, _)| !is_open(&text[..*end]));
    closed.map_or((None, 0), |(end, count)| (Some(text[..end].trim_end_matches('\r')), count))
}
