//! Numbers in messages, without the digits that a conversion adds.

/// Number of digits of a displayed number.
pub const DIGITS: usize = 7;
/// Number of significant digits of a double.
const ALL: usize = 17;

/// Rounds a number to `digits` significant digits.
pub fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value)
}

/// Rounds two different numbers to as few digits as distinguish them.
pub fn rounded_distinct(a: f64, b: f64) -> (f64, f64) {
    let pair = |digits| (rounded(a, digits), rounded(b, digits));
    (DIGITS..ALL).map(pair).find(|(a, b)| a != b).unwrap_or((a, b))
}

#[cfg(test)]
mod tests {
    use super::{rounded, rounded_distinct};

    #[test]
    fn digits_of_a_conversion_are_not_shown() {
        assert_eq!(rounded(1234.0 * 1.1, 7).to_string(), "1357.4");
        assert_eq!(rounded_distinct(3.0 * 0.1, 0.1 + 0.1), (0.3, 0.2));
        // A microsecond in 1.7 billion seconds takes sixteen digits.
        let (now, before) = (1_700_000_000.000_004, 1_700_000_000.000_003);
        let (a, b) = rounded_distinct(now, before);
        assert!(a > b && rounded_distinct(1.0, 1.0) == (1.0, 1.0));
    }
}
