//! Numbers of messages: what a conversion adds to their digits is not shown.

/// Digits that a number is shown with.
pub const DIGITS: usize = 7;
/// Digits that a number has.
const ALL: usize = 17;

/// A number with as many significant digits, trailing zeros left out.
pub fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value)
}

/// Two numbers that differ, with as many digits as it takes to tell them apart.
pub fn told_apart(a: f64, b: f64) -> (f64, f64) {
    let pair = |digits| (rounded(a, digits), rounded(b, digits));
    (DIGITS..ALL).map(pair).find(|(a, b)| a != b).unwrap_or((a, b))
}

#[cfg(test)]
mod tests {
    use super::{rounded, told_apart};

    #[test]
    fn digits_of_a_conversion_are_not_shown() {
        assert_eq!(rounded(1234.0 * 1.1, 7).to_string(), "1357.4");
        assert_eq!(told_apart(3.0 * 0.1, 0.1 + 0.1), (0.3, 0.2));
        // A microsecond apart in 1.7 billion seconds takes sixteen digits.
        let (now, before) = (1_700_000_000.000_004, 1_700_000_000.000_003);
        let (a, b) = told_apart(now, before);
        assert!(a > b && told_apart(1.0, 1.0) == (1.0, 1.0));
    }
}
