use std::io::{self, BufRead, BufReader, Read};

use csv::StringRecord;

use crate::error::{Fault, quote};

/// Longest line of text, bytes: a bound on memory, far above what a trace needs.
const LONGEST_LINE: u64 = 64 * 1024;

/// Reason why no line could be delivered.
pub(crate) enum LineFault {
    Io(io::Error),
    Content(Fault),
}

/// Physical lines of text with their numbers, each delivered as soon as it is complete.
pub(crate) struct Lines<R> {
    source: BufReader<R>,
    buffer: Vec<u8>,
    /// Number of the line delivered last, counted from 1.
    number: u64,
    /// True if the line delivered last was too long, so that its rest is still to come.
    is_cut: bool,
}

impl<R: Read> Lines<R> {
    pub(crate) fn new(source: R) -> Self {
        Self { source: BufReader::new(source), buffer: Vec::new(), number: 0, is_cut: false }
    }

    pub(crate) const fn number(&self) -> u64 {
        self.number
    }

    /// Returns the next line that is not blank, without its end; `None` at the end of the source.
    pub(crate) fn next(&mut self) -> Result<Option<&str>, LineFault> {
        if std::mem::take(&mut self.is_cut) {
            self.source.skip_until(b'\n').map_err(LineFault::Io)?;
        }
        loop {
            self.buffer.clear();
            let mut bounded = (&mut self.source).take(LONGEST_LINE);
            if bounded.read_until(b'\n', &mut self.buffer).map_err(LineFault::Io)? == 0 {
                return Ok(None);
            }
            self.number += 1;
            self.is_cut = self.buffer.len() as u64 == LONGEST_LINE && !self.buffer.ends_with(b"\n");
            check_bytes(&self.buffer, self.number).map_err(LineFault::Content)?;
            if !content(&self.buffer, self.number).trim_ascii().is_empty() {
                break;
            }
        }
        let invalid =
            |_| LineFault::Content(Fault::new("UTF-8 text", "binary data (bytes that are not UTF-8)").foreign());
        std::str::from_utf8(content(&self.buffer, self.number)).map(Some).map_err(invalid)
    }
}

/// Refuses bytes that are not text.
fn check_bytes(bytes: &[u8], number: u64) -> Result<(), Fault> {
    const TEXT: &str = "UTF-8 text";
    if number == 1 && (bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff])) {
        return Err(Fault::new(TEXT, "UTF-16 text").foreign());
    }
    if bytes.contains(&0) {
        return Err(Fault::new(TEXT, "binary data (a NUL byte)").foreign());
    }
    if bytes.len() as u64 == LONGEST_LINE && !bytes.ends_with(b"\n") {
        return Err(Fault::new(format!("a line of at most {LONGEST_LINE} bytes"), "a longer one"));
    }
    Ok(())
}

/// Returns the line without byte-order mark and line end.
fn content(bytes: &[u8], number: u64) -> &[u8] {
    let bytes = bytes.strip_suffix(b"\n").unwrap_or(bytes);
    let bytes = bytes.strip_suffix(b"\r").unwrap_or(bytes);
    if number == 1 { bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes) } else { bytes }
}

/// Feeds [`Lines`] to the csv crate, one line per call of `read`, so that a record is delivered when its line is
/// complete and [`Lines::number`] is the number of that line.
pub(crate) struct LineFeed<R> {
    lines: Lines<R>,
    pending: Vec<u8>,
    taken: usize,
    record_has_line: bool,
    fault: Option<LineFault>,
}

impl<R: Read> LineFeed<R> {
    /// Starts with `first`, which was already taken from `lines` and is delivered again.
    pub(crate) fn new(lines: Lines<R>, first: &str) -> Self {
        Self { lines, pending: format!("{first}\n").into_bytes(), taken: 0, record_has_line: true, fault: None }
    }

    pub(crate) const fn line(&self) -> u64 {
        self.lines.number()
    }

    /// Allows one more line to be taken. A record that needs a second line has an open quotation mark, and would
    /// consume the rest of the source.
    pub(crate) const fn begin_record(&mut self) {
        self.record_has_line = false;
    }

    /// Splits the next line at its commas, which suffices for most traces; `None` at the end of the source. A line with
    /// quotation marks is left for `read`, and `false` is returned; all later lines are also for `read`.
    pub(crate) fn next_plain(&mut self, cells: &mut StringRecord) -> Result<Option<bool>, LineFault> {
        let Some(line) = self.lines.next()? else { return Ok(None) };
        if is_plain(line) {
            cells.clear();
            line.split(',').for_each(|cell| cells.push_field(cell));
            return Ok(Some(true));
        }
        deliver(line, &mut self.pending);
        (self.taken, self.record_has_line) = (0, true);
        Ok(Some(false))
    }

    fn next_line(&mut self) -> Result<Option<()>, LineFault> {
        if self.record_has_line {
            let found = quote(&String::from_utf8_lossy(&self.pending));
            return Err(LineFault::Content(Fault::new("quotation marks in pairs", found)));
        }
        let Some(line) = self.lines.next()? else { return Ok(None) };
        deliver(line, &mut self.pending);
        (self.taken, self.record_has_line) = (0, true);
        Ok(Some(()))
    }

    /// Takes the error that made `read` fail.
    pub(crate) const fn take_fault(&mut self) -> Option<LineFault> {
        self.fault.take()
    }
}

/// Returns the cells of a line without spaces around them and without quotation marks; `None` if those are not in pairs.
///
/// ```
/// use ohmstrain_bench_data::cells;
/// let expected = vec!["0.05".to_owned(), "1600".into(), "warm, dry".into()];
/// assert_eq!(cells("0.05, 1600,\"warm, dry\"\r\n"), Some(expected));
/// assert_eq!(cells("0.05,\"1600"), None);
/// ```
#[must_use]
pub fn cells(line: &str) -> Option<Vec<String>> {
    let mut cells = StringRecord::new();
    take_apart(line.trim_start_matches('\u{feff}').trim(), &mut cells).ok()?;
    Some(cells.iter().map(|cell| cell.trim().to_owned()).collect())
}

/// Splits a single line into cells.
pub(crate) fn take_apart(line: &str, cells: &mut StringRecord) -> Result<(), Fault> {
    cells.clear();
    if is_plain(line) {
        line.split(',').for_each(|cell| cells.push_field(cell));
        return Ok(());
    }
    let unpaired = || Fault::new("quotation marks in pairs", quote(line));
    if line.bytes().filter(|byte| *byte == b'"').count() % 2 == 1 {
        return Err(unpaired());
    }
    let mut records = csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(line.as_bytes());
    records.read_record(cells).map_err(|_| unpaired())?;
    Ok(())
}

/// True if a line is one record that splits at its commas: no quotation mark, no end of line.
pub(crate) fn is_plain(line: &str) -> bool {
    !line.bytes().any(|byte| byte == b'"' || byte == b'\r')
}

fn deliver(line: &str, pending: &mut Vec<u8>) {
    pending.clear();
    pending.extend_from_slice(line.as_bytes());
    pending.push(b'\n');
}

impl<R: Read> Read for LineFeed<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.pending.len() {
            match self.next_line() {
                Ok(None) => return Ok(0),
                Ok(Some(())) => {}
                Err(fault) => {
                    self.fault = Some(fault);
                    return Err(io::Error::other("not a line of a trace"));
                }
            }
        }
        let count = out.len().min(self.pending.len() - self.taken);
        out[..count].copy_from_slice(&self.pending[self.taken..self.taken + count]);
        self.taken += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_counted_physically() {
        let mut lines = Lines::new("\u{feff}a\r\n\r\n\nb".as_bytes());
        let mut seen = Vec::new();
        while let Ok(Some(line)) = lines.next() {
            let line = line.to_owned();
            seen.push((lines.number(), line));
        }
        assert_eq!(seen, [(1, "a".to_owned()), (4, "b".to_owned())]);
    }

    #[test]
    fn a_line_without_end_does_not_fill_the_memory() {
        let mut lines = Lines::new(io::repeat(b'x'));
        assert!(matches!(lines.next(), Err(LineFault::Content(_))));
        assert_eq!(lines.buffer.len() as u64, LONGEST_LINE);
    }

    #[test]
    fn the_end_of_a_line_that_was_too_long_is_no_line() {
        let text = format!("{},1600\nb\n", "9".repeat(3 * LONGEST_LINE as usize));
        let mut lines = Lines::new(text.as_bytes());
        assert!(matches!(lines.next(), Err(LineFault::Content(_))));
        assert!(matches!(lines.next(), Ok(Some("b"))) && lines.number() == 2);
    }
}
