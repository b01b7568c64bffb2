use std::fmt;
use std::str::FromStr;

/// Mark before the fraction of a number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DecimalMark {
    /// `1.5`.
    #[default]
    Point,
    /// `1,5`.
    Comma,
}

impl DecimalMark {
    pub(crate) const fn character(self) -> char {
        match self {
            Self::Point => '.',
            Self::Comma => ',',
        }
    }
}

impl fmt::Display for DecimalMark {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}", self.character())
    }
}

impl FromStr for DecimalMark {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "." | "point" => Ok(Self::Point),
            "," | "comma" => Ok(Self::Comma),
            _ => Err("expected . or ,".into()),
        }
    }
}

/// Value of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value {
    Number(f64),
    Missing,
    Text,
}

/// Texts for missing values from instruments and programs, in lower case, without `+`, `-` and `.`.
const MISSING: &str = "nan na n/a #n/a null none nil missing ovld ovl ol 0l overload overld overflow ovrflw ovfl over overrange \
                       outofrange oor under inf infinity ∞ open error err #num! #value! #div/0! #ref! invalid timeout";

/// Overload of SCPI instruments, which return ±9.9e37 for it and 9.91e37 for NaN.
pub(crate) const SCPI_OVERLOAD: f64 = 9.9e37;

/// True if a text denotes a missing value. `own` are the user's texts for that.
pub(crate) fn is_missing(text: &str, own: &[String]) -> bool {
    let text = text.trim();
    if text.is_empty() || own.iter().any(|own| own == text) {
        return true;
    }
    if text.bytes().all(|byte| matches!(byte, b'-' | b'*' | b'#' | b'>' | b'<' | b'?')) {
        return true;
    }
    if text.len() > 16 || text.as_bytes()[0].is_ascii_digit() && text != "0L" {
        return false;
    }
    let bare: String =
        text.to_lowercase().chars().filter(|c| !matches!(c, '+' | '-' | '.' | ' ' | '_' | '>' | '<')).collect();
    MISSING.split(' ').any(|text| text == bare)
}

/// Returns the value of a cell, its number times 10^`shift`.
pub(crate) fn value(text: &str, mark: DecimalMark, shift: i32, own: &[String]) -> Value {
    let text = text.trim();
    // An overload is a number of the instrument, in whatever unit.
    let is_overload = |value: f64| number(text, mark, 0).unwrap_or(value).abs() >= SCPI_OVERLOAD;
    match number(text, mark, shift) {
        Some(value) if value.is_finite() && !is_overload(value) && !own.iter().any(|own| own == text) => {
            Value::Number(value)
        }
        Some(_) => Value::Missing,
        None if is_missing(text, own) => Value::Missing,
        None => Value::Text,
    }
}

/// Returns a number times 10^`shift`, rounded once.
pub(crate) fn number(text: &str, mark: DecimalMark, shift: i32) -> Option<f64> {
    let plain = plain(text.trim(), mark)?;
    if shift == 0 {
        return plain.parse().ok();
    }
    let (mantissa, exponent) = match plain.find(['e', 'E']) {
        Some(at) => (&plain[..at], plain[at + 1..].parse::<i32>().ok()?),
        None => (plain.as_ref(), 0),
    };
    format!("{mantissa}e{}", exponent.checked_add(shift)?).parse().ok()
}

/// Returns a number times 10^`shift` as a whole number of nanoseconds, exactly; further digits are dropped. `None` if it is too large, or
/// has an exponent.
pub(crate) fn nanoseconds(text: &str, mark: DecimalMark, shift: i32) -> Option<i128> {
    let plain = plain(text.trim(), mark)?;
    let (sign, digits) = plain.strip_prefix('-').map_or((1, plain.trim_start_matches('+')), |digits| (-1, digits));
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let behind = usize::try_from(shift.checked_add(9)?).ok()?;
    let fraction: String = fraction.chars().chain(std::iter::repeat('0')).take(behind).collect();
    (whole.len() + behind < 36).then(|| format!("{whole}{fraction}").parse::<i128>().ok().map(|count| sign * count))?
}

/// Converts a number to Rust's notation, with a point and without thousands marks; `None` if the text is not a number.
fn plain(text: &str, mark: DecimalMark) -> Option<std::borrow::Cow<'_, str>> {
    if !text.bytes().any(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let usual = |byte: u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'+' | b'-' | b'e' | b'E');
    if mark == DecimalMark::Point && text.bytes().all(usual) {
        return Some(text.into());
    }
    let text = text.replace('\u{2212}', "-");
    let body_end = text.find(['e', 'E']).unwrap_or(text.len());
    let (body, exponent) = text.split_at(body_end);
    let (whole, fraction) = body.split_once(mark.character()).map_or((body, None), |(w, f)| (w, Some(f)));
    let digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    let sign = if whole.starts_with(['+', '-']) { &whole[..1] } else { "" };
    let whole = ungrouped(&whole[sign.len()..], mark)?;
    (fraction.is_none_or(digits) && exponent.bytes().all(usual)).then(|| {
        let fraction = fraction.filter(|fraction| !fraction.is_empty()).unwrap_or("0");
        let whole = if whole.is_empty() { "0" } else { &whole };
        format!("{sign}{whole}.{fraction}{exponent}").into()
    })
}

/// Removes the marks that group thousands.
fn ungrouped(whole: &str, mark: DecimalMark) -> Option<String> {
    if whole.bytes().all(|byte| byte.is_ascii_digit()) {
        return Some(whole.to_owned());
    }
    let other = if mark == DecimalMark::Point { ',' } else { '.' };
    let group = whole.chars().find(|c| !c.is_ascii_digit())?;
    if ![other, '\'', '\u{2019}', '\u{a0}', '\u{202f}', '\u{2009}', ' '].contains(&group) {
        return None;
    }
    let mut parts = whole.split(group);
    let first = parts.next()?;
    let is_digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    // A group of thousands never begins with a zero: `0,950` has another decimal mark.
    if first.is_empty() || first.len() > 3 || first.starts_with('0') || !is_digits(first) {
        return None;
    }
    parts.try_fold(first.to_owned(), |whole, part| (part.len() == 3 && is_digits(part)).then(|| whole + part))
}

/// True if a number contains marks that group thousands, given the decimal mark `mark`.
pub(crate) fn has_groups(text: &str, mark: DecimalMark) -> bool {
    let other = if mark == DecimalMark::Point { ',' } else { '.' };
    text.contains(other) && number(text, mark, 0).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_once_whatever_the_unit() {
        let comma = |text, shift| number(text, DecimalMark::Comma, shift);
        assert_eq!(comma("1,1", 3), Some(1100.0));
        assert_eq!(comma("-1,5e-3", 0), Some(-0.0015));
        assert_eq!(comma("1.234.567,5", 0), Some(1_234_567.5));
        assert_eq!(comma(",5", 0), Some(0.5));
        assert_eq!(number("16.7", DecimalMark::Point, -2), Some(0.167));
        assert_eq!(number("1,600.25", DecimalMark::Point, 0), Some(1600.25));
        assert_eq!(number("1 600.25", DecimalMark::Point, 0), Some(1600.25));
        assert_eq!(number("5.", DecimalMark::Point, 3), Some(5000.0));
        assert_eq!(number("\u{2212}2.5", DecimalMark::Point, 0), Some(-2.5));
        for text in ["1,60", "0,950", "1;2", "12:30", "1.2.3", "abc", "", "-", "e5"] {
            assert_eq!(number(text, DecimalMark::Point, 0), None, "{text}");
        }
    }

    #[test]
    fn nanoseconds_are_exact() {
        let exact = |text, shift| nanoseconds(text, DecimalMark::Point, shift);
        assert_eq!(exact("1700000000.004", 0), Some(1_700_000_000_004_000_000));
        assert_eq!(exact("1700000000004", -3), Some(1_700_000_000_004_000_000));
        assert_eq!(exact("-2.5", -9), Some(-2));
        assert_eq!(exact("1.7e9", 0), None);
        assert_eq!(exact("", 0), None);
    }

    #[test]
    fn overload_is_a_missing_value_and_a_word_is_none() {
        for text in
            ["OVLD", "+OL", "O.L", "OVERLOAD", " nan ", "", "---", "#N/A", "9.91E37", "-9.9e+37", "inf", "Over Range"]
        {
            assert_eq!(value(text, DecimalMark::Point, 0, &[]), Value::Missing, "{text}");
        }
        for shift in [-6, -2, 3] {
            assert_eq!(value("9.9E37", DecimalMark::Point, shift, &[]), Value::Missing);
        }
        assert_eq!(value("hold", DecimalMark::Point, 0, &[]), Value::Text);
        assert_eq!(value("hold", DecimalMark::Point, 0, &["hold".into()]), Value::Missing);
        assert_eq!(value("-999", DecimalMark::Point, 0, &["-999".into()]), Value::Missing);
    }
}
