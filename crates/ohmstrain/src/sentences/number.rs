//! Numbers for people: only significant digits, and a true minus sign; the median of several.

use ohmstrain_sensor::Quantity;

/// Significant digits of a value whose uncertainty is not known.
const DIGITS: i32 = 4;

/// Formats `value` with four significant digits, without trailing zeros of the fraction; an en dash if it is not finite.
///
/// ```
/// use ohmstrain::number::plain;
///
/// assert_eq!([1384.529, -0.012_345_6, 0.25, 3.2e-8].map(plain), ["1385", "−0.01235", "0.25", "3.2·10⁻⁸"]);
/// assert_eq!(plain(f64::NAN), "–");
/// ```
pub fn plain(value: f64) -> String {
    significant(value, DIGITS)
}

/// Formats `value` with the given number of significant digits.
///
/// ```
/// assert_eq!(ohmstrain::number::significant(1384.529, 2), "1400");
/// ```
pub fn significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return if value.is_nan() { "–".into() } else { signed(if value > 0.0 { "∞" } else { "-∞" }.into()) };
    }
    let decimals = digits - 1 - exponent(value);
    if reads_better_in_powers(value) {
        return in_powers(value, digits);
    }
    trimmed(fixed(value, decimals))
}

/// Formats `value ± error`, both rounded to the error's second digit.
///
/// ```
/// assert_eq!(ohmstrain::number::with_error(1.234_56, 0.034_9), "1.235 ± 0.035");
/// ```
pub fn with_error(value: f64, error: f64) -> String {
    if !(error > 0.0 && error.is_finite() && value.is_finite()) {
        return plain(value);
    }
    let largest = value.abs().max(error);
    if reads_better_in_powers(largest) {
        return format!("{} ± {}", in_powers(value, DIGITS), in_powers(error, 2));
    }
    let decimals = 1 - exponent(error);
    format!("{} ± {}", fixed(value, decimals), fixed(error, decimals))
}

/// Formats a share as a percentage with one decimal.
///
/// ```
/// assert_eq!(ohmstrain::number::percent(0.953_4), "95.3 %");
/// ```
pub fn percent(share: f64) -> String {
    if share.is_finite() { format!("{} %", fixed(100.0 * share, 1)) } else { plain(share) }
}

/// Returns the factor and the unit in which people read a quantity: strains in percent, angles in degrees.
///
/// ```
/// assert_eq!(ohmstrain::number::shown(ohmstrain::Quantity::Strain), (100.0, " %"));
/// ```
pub const fn shown(quantity: Quantity) -> (f64, &'static str) {
    match quantity {
        Quantity::Strain => (100.0, " %"),
        Quantity::AngleDeg => (1.0, "°"),
    }
}

/// Formats `value` with `decimals` digits after the point; a negative number of them rounds before the point.
///
/// ```
/// assert_eq!(ohmstrain::number::fixed(-1234.567, 1), "−1234.6");
/// assert_eq!(ohmstrain::number::fixed(1234.567, -2), "1200");
/// ```
pub fn fixed(value: f64, decimals: i32) -> String {
    if decimals < 0 {
        let unit = 10.0_f64.powi(-decimals);
        return fixed((value / unit).round() * unit, 0);
    }
    let text = format!("{value:.*}", decimals.unsigned_abs().min(17) as usize);
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    signed(if is_zero { text.replace('-', "") } else { text })
}

/// True if a number of this size is better written with a power of ten.
///
/// ```
/// assert_eq!([1e-6, 0.1, 1e8].map(ohmstrain::number::reads_better_in_powers), [true, false, true]);
/// ```
pub fn reads_better_in_powers(value: f64) -> bool {
    value != 0.0 && !(-5..7).contains(&exponent(value))
}

/// Formats a number as `m·10ⁿ`.
///
/// ```
/// assert_eq!(ohmstrain::number::in_powers(123_456.0, 3), "1.23·10⁵");
/// ```
pub fn in_powers(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return significant(value, digits);
    }
    let text = format!("{value:.*e}", (digits - 1).max(0).unsigned_abs() as usize);
    let Some((mantissa, power)) = text.split_once('e') else { return signed(text) };
    let mantissa = trimmed(signed(mantissa.to_owned()));
    let raised: String = power.chars().map(superscript).collect();
    format!("{mantissa}·10{raised}")
}

/// Returns the power of ten of the leading digit; 0 for zero.
///
/// ```
/// assert_eq!([0.02, 0.0, 250.0].map(ohmstrain::number::exponent), [-2, 0, 2]);
/// ```
pub fn exponent(value: f64) -> i32 {
    if value == 0.0 || !value.is_finite() { 0 } else { value.abs().log10().floor() as i32 }
}

fn trimmed(text: String) -> String {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn signed(text: String) -> String {
    text.replace('-', "−")
}

fn superscript(c: char) -> char {
    match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '0' | '4'..='9' => char::from_u32(0x2070 + u32::from(c) - u32::from('0')).unwrap_or(c),
        other => other,
    }
}

/// Returns the median of numbers; `None` if there are none.
///
/// ```
/// assert_eq!(ohmstrain::number::median(vec![3.0, 1.0, 2.0, 9.0]), Some(2.5));
/// ```
#[must_use]
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => None,
        n if n % 2 == 1 => Some(values[n / 2]),
        n => Some(0.5 * (values[n / 2 - 1] + values[n / 2])),
    }
}

#[cfg(test)]
mod tests {
    use super::{percent, plain, with_error};

    #[test]
    fn digits_follow_size_and_uncertainty() {
        assert_eq!(plain(1384.529), "1385");
        assert_eq!(plain(-0.012_345_6), "−0.01235");
        assert_eq!(plain(0.25), "0.25");
        assert_eq!(plain(0.0), "0");
        assert_eq!(plain(3.2e-8), "3.2·10⁻⁸");
        assert_eq!(plain(1.5e12), "1.5·10¹²");
        assert_eq!(plain(f64::NAN), "–");
        assert_eq!(with_error(1.234_56, 0.034_9), "1.235 ± 0.035");
        assert_eq!(with_error(1234.56, 349.0), "1230 ± 350");
        assert_eq!(with_error(1.5, f64::NAN), "1.5");
        assert_eq!(percent(0.953_4), "95.3 %");
    }
}
