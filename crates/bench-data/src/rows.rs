use std::io::{self, Write};

/// Writes rows of numbers as CSV, one at a time, without an allocation per cell.
///
/// Numbers are the shortest that read back as the same `f64`, as by `f64`'s `Display` (of two that are equally short and near, the even
/// one). Only magnitudes below 1e-30, smaller than any measured value, have exponents. A cell without a number stays empty. No output needs
/// quotation marks.
///
/// ```
/// use ohmstrain_bench_data::RowWriter;
/// let mut rows = RowWriter::new(Vec::new());
/// for cell in ["time_s", "strain", "flags"] {
///     rows.text(cell);
/// }
/// rows.end()?;
/// rows.number(0.5);
/// rows.number(1e-7);
/// rows.words(["missing", "at_limit"].into_iter());
/// rows.end()?;
/// assert_eq!(rows.into_inner(), b"time_s,strain,flags\n0.5,0.0000001,missing|at_limit\n");
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug)]
pub struct RowWriter<W> {
    out: W,
    /// The row so far, with a comma after every cell.
    row: Vec<u8>,
}

impl<W: Write> RowWriter<W> {
    /// Makes a writer that writes to `out` once per row; `out` should be buffered.
    pub const fn new(out: W) -> Self {
        Self { out, row: Vec::new() }
    }

    /// Adds a cell of text, which must not contain a comma, quotation mark or line end.
    pub fn text(&mut self, text: &str) {
        debug_assert!(!text.contains([',', '"', '\n', '\r']));
        self.row.extend_from_slice(text.as_bytes());
        self.row.push(b',');
    }

    /// Adds a cell with a number; an empty one for NaN.
    pub fn number(&mut self, value: f64) {
        if !value.is_nan() {
            append_number(&mut self.row, value);
        }
        self.row.push(b',');
    }

    /// Adds a cell with words separated by `|`.
    pub fn words<'a>(&mut self, words: impl Iterator<Item = &'a str>) {
        let start = self.row.len();
        for word in words {
            if self.row.len() > start {
                self.row.push(b'|');
            }
            self.row.extend_from_slice(word.as_bytes());
        }
        self.row.push(b',');
    }

    /// Ends the row.
    ///
    /// # Errors
    /// The error of `out`.
    pub fn end(&mut self) -> io::Result<()> {
        if self.row == b"," {
            // A row of one empty cell would be a blank line, which readers skip.
            self.row.splice(.., *b"\"\",");
        }
        if let Some(last) = self.row.last_mut() {
            *last = b'\n';
        }
        let written = self.out.write_all(&self.row);
        self.row.clear();
        written
    }

    /// Flushes everything written so far.
    ///
    /// # Errors
    /// The error of the writer.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// Returns the writer.
    pub const fn get_mut(&mut self) -> &mut W {
        &mut self.out
    }

    /// Returns the writer, without a flush.
    pub fn into_inner(self) -> W {
        self.out
    }
}

/// Smallest magnitude written without an exponent; smaller numbers are practically zero, and would be lines of hundreds of zeros.
const TINY: f64 = 1e-30;

/// Appends a number that is not NaN as by `f64`'s `Display`, several times faster; one below [`TINY`] with its exponent.
#[inline]
pub(crate) fn append_number(out: &mut Vec<u8>, value: f64) {
    if value.is_infinite() {
        out.extend_from_slice(if value > 0.0 { b"inf" } else { b"-inf" });
        return;
    }
    let mut buffer = zmij::Buffer::new();
    let text = buffer.format_finite(value).as_bytes();
    match text.iter().rposition(|byte| *byte == b'e') {
        Some(_) if value.abs() < TINY => out.extend_from_slice(text),
        Some(at) => append_without_exponent(out, &text[..at], &text[at + 1..]),
        None => out.extend_from_slice(text.strip_suffix(b".0").unwrap_or(text)),
    }
}

/// Appends `-1.25`, `-7` as `-0.000000125`: numbers without exponents are readable by all spreadsheets and scripts.
#[cold]
fn append_without_exponent(out: &mut Vec<u8>, mantissa: &[u8], exponent: &[u8]) {
    let (negative, mantissa) = match mantissa.strip_prefix(b"-") {
        Some(rest) => (true, rest),
        None => (false, mantissa),
    };
    let (down, exponent) = match exponent.strip_prefix(b"-") {
        Some(rest) => (true, rest),
        None => (false, exponent.strip_prefix(b"+").unwrap_or(exponent)),
    };
    let power = exponent.iter().fold(0, |sum, digit| 10 * sum + usize::from(digit - b'0'));
    let digits = || mantissa.iter().copied().filter(|byte| *byte != b'.');
    if negative {
        out.push(b'-');
    }
    if down {
        out.extend_from_slice(b"0.");
        out.extend(std::iter::repeat_n(b'0', power.saturating_sub(1)));
        out.extend(digits());
    } else {
        // A mantissa has one digit before its point and at most 16 after it; exponents are at least 16.
        out.extend(digits());
        out.extend(std::iter::repeat_n(b'0', (power + 1).saturating_sub(digits().count())));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn text(value: f64) -> String {
        let mut out = Vec::new();
        append_number(&mut out, value);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn numbers_look_as_they_always_have() {
        for value in [0.0, -0.0, 1.0, -400.0, 0.1, 1e-5, 9.9e-6, 1e-7, -1.25e-7, 1e15, 1e16, 1.5e16, 1e17, 1e22] {
            assert_eq!(text(value), value.to_string());
        }
        for value in [f64::MAX, 1e-30, f64::INFINITY, f64::NEG_INFINITY, 123456789012345680.0] {
            assert_eq!(text(value), value.to_string());
        }
        // A baseline reaches such values after hours without a reading.
        for value in [9.9e-31, -f64::MIN_POSITIVE, 5e-324, -2.5e-323] {
            assert_eq!(text(value), format!("{value:e}"));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn any_number_reads_back_and_is_as_short_as_displayed(bits: u64) {
            let value = f64::from_bits(bits);
            if !value.is_nan() {
                let text = text(value);
                prop_assert_eq!(text.parse::<f64>().map(f64::to_bits), Ok(bits));
                // Of two equally near candidates for the last of 17 digits, the two implementations may choose differently.
                if value == 0.0 || value.abs() >= TINY {
                    prop_assert_eq!(text.len(), value.to_string().len());
                    prop_assert!(!text.contains(['e', 'E']));
                }
            }
        }

        #[test]
        fn what_sensors_measure_looks_as_displayed(moderate in -1e4..1e4_f64) {
            // Ties need a binary fraction of few digits, which numbers this small have in full.
            for value in [moderate, moderate * 1e-9] {
                prop_assert_eq!(text(value), value.to_string());
            }
        }
    }

    #[test]
    fn an_empty_row_of_one_cell_is_no_blank_line() {
        let mut rows = RowWriter::new(Vec::new());
        rows.number(f64::NAN);
        rows.end().unwrap();
        rows.number(f64::NAN);
        rows.number(2.0);
        rows.end().unwrap();
        rows.words(std::iter::empty());
        rows.end().unwrap();
        assert_eq!(String::from_utf8(rows.into_inner()).unwrap(), "\"\"\n,2\n\"\"\n");
    }
}
