//! Numbers rounded to their uncertainty, and names and units as people write them.

use std::fmt;

/// Plain notation up to this many decimals.
const MOST_DECIMALS: i32 = 8;

/// An estimate and its U95, both rounded to the place of the U95's second significant digit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rounded {
    /// The value, to be multiplied by ten to the `exponent`.
    pub value: String,
    /// The uncertainty, likewise.
    pub u95: String,
    /// Common power of ten.
    pub exponent: i32,
}

impl Rounded {
    /// Rounds `value ± u95`; `None` if one is not finite or the uncertainty is negative.
    pub fn new(value: f64, u95: f64) -> Option<Self> {
        if !value.is_finite() || !u95.is_finite() || u95 < 0.0 {
            return None;
        }
        if u95 == 0.0 {
            return Some(Self { value: significant(value, 10), u95: "0".to_owned(), exponent: 0 });
        }
        // Place of the second digit after rounding: 0.0996 is 0.10, not 0.100.
        let decimals = 1 - exponent_rounded(u95, 1);
        let magnitude = exponent_rounded(value.abs().max(u95), 1);
        let plain = magnitude < 7 && decimals <= MOST_DECIMALS;
        let exponent = if plain || (-4..7).contains(&magnitude) { 0 } else { magnitude };
        let places = decimals.saturating_add(exponent);
        let scaled = |v: f64| {
            // Two steps, because 10^-exponent alone may overflow.
            let half = exponent / 2;
            v / 10_f64.powi(half) / 10_f64.powi(exponent - half)
        };
        if places > MOST_DECIMALS {
            // Far smaller than the value: in a power of ten of its own, and no digits that f64 does not hold.
            let u95 = format!("{:.1e}", scaled(u95));
            return Some(Self { value: fixed(scaled(value), places.min(12)), u95, exponent });
        }
        Some(Self { value: fixed(scaled(value), places), u95: fixed(scaled(u95), places), exponent })
    }

    /// The value alone.
    pub fn value_alone(&self) -> String {
        with_exponent(&self.value, self.exponent)
    }

    /// The uncertainty alone.
    pub fn u95_alone(&self) -> String {
        with_exponent(&self.u95, self.exponent)
    }
}

impl fmt::Display for Rounded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.exponent {
            0 => write!(f, "{} ± {}", self.value, self.u95),
            e => write!(f, "({} ± {})e{e}", self.value, self.u95),
        }
    }
}

fn with_exponent(mantissa: &str, exponent: i32) -> String {
    if exponent == 0 { mantissa.to_owned() } else { format!("{mantissa}e{exponent}") }
}

/// `20.013 ± 0.021 kg`; `not identified` if the numbers cannot be printed.
pub fn with_u95(value: f64, u95: f64, unit: &str) -> String {
    match Rounded::new(value, u95) {
        Some(rounded) if unit.is_empty() => rounded.to_string(),
        Some(rounded) => format!("{rounded} {}", unit_symbol(unit)),
        None => NOT_IDENTIFIED.to_owned(),
    }
}

/// The text in place of a number that the data do not give.
pub const NOT_IDENTIFIED: &str = "not identified";

/// Replaces the number of a fit that must not be used.
pub const CONTRADICTED: &str = "contradicted";

/// Returns a reference value to be beside `value ± u95`: one decimal more than the estimate's, no trailing
/// zeros.
pub fn beside(reference: f64, u95: f64) -> String {
    if !reference.is_finite() {
        return "unknown".to_owned();
    }
    if !u95.is_finite() || u95 <= 0.0 {
        return significant(reference, 10);
    }
    let decimals = 2 - exponent_rounded(u95, 1);
    if decimals > 12 || reference.abs() >= 1e7 {
        return significant(reference, 10);
    }
    strip_zeros(fixed(reference, decimals.max(0)))
}

/// `1 row`, `2 rows`.
pub fn counted(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// Returns a number with at most the given number of significant digits, without trailing zeros; scientific
/// outside 1e-5 … 1e7.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return "unknown".to_owned();
    }
    let digits = digits.clamp(1, 17);
    let exponent = exponent_rounded(value, digits - 1);
    if (-5..7).contains(&exponent) {
        let decimals = i32::try_from(digits).unwrap_or(17) - 1 - exponent;
        return strip_zeros(fixed(value, decimals));
    }
    let text = format!("{value:.*e}", digits - 1);
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{}e{exponent}", strip_zeros(mantissa.to_owned())),
        None => text,
    }
}

/// Decimal exponent after rounding to `decimals + 1` significant digits.
fn exponent_rounded(value: f64, decimals: usize) -> i32 {
    let text = format!("{value:.decimals$e}");
    text.split_once('e').and_then(|(_, e)| e.parse().ok()).unwrap_or(0)
}

/// Three significant digits, with trailing zeros: `10.0`.
pub fn three_digits(value: f64) -> String {
    Rounded::new(value, 0.1 * value.abs()).map_or("unknown".to_owned(), |r| r.value_alone())
}

/// Fixed-point text; negative `decimals` round to tens, hundreds, … Never a negative zero.
pub fn fixed(value: f64, decimals: i32) -> String {
    let text = match usize::try_from(decimals) {
        Ok(decimals) => format!("{value:.decimals$}"),
        Err(_) => {
            let place = 10_f64.powi(-decimals);
            format!("{:.0}", (value / place).round() * place)
        }
    };
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_owned(),
        _ => text,
    }
}

/// Fixed-point text with its sign, which zero has too: `+0.3`, `+0.0`.
pub fn signed(value: f64, decimals: i32) -> String {
    let text = fixed(value, decimals);
    if text.starts_with('-') { text } else { format!("+{text}") }
}

fn strip_zeros(text: String) -> String {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// `kg m2` as `kg m²`.
pub fn unit_symbol(unit: &str) -> String {
    unit.split(' ')
        .map(|part| match part.strip_suffix('2') {
            Some(base) if base.chars().all(char::is_alphabetic) || base.contains('/') => format!("{base}²"),
            _ => part.to_owned(),
        })
        .collect::<Vec<_>>()
        .join(" ")
}

/// Seconds as `12.5 s`, `3 min 20 s` or `2 h 05 min`.
pub fn duration(seconds: f64) -> String {
    if !seconds.is_finite() || seconds < 0.0 {
        return "unknown".to_owned();
    }
    let whole = seconds.round();
    if seconds < 99.95 {
        format!("{} s", strip_zeros(fixed(seconds, 1)))
    } else if whole < 3600.0 {
        format!("{} min {:02} s", (whole / 60.0).floor(), whole % 60.0)
    } else {
        let minutes = (seconds / 60.0).round();
        format!("{} h {:02} min", (minutes / 60.0).floor(), minutes % 60.0)
    }
}

/// A count with thin spaces between thousands: `36 000`.
pub fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// The first `shown` of a list, and how many more there are.
pub fn shortened(names: &[impl AsRef<str>], shown: usize) -> String {
    let mut text = names.iter().take(shown).map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    if names.len() > shown {
        text += &format!(" and {} more", names.len() - shown);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_and_uncertainty_are_rounded_to_two_digits_of_the_uncertainty() {
        for (value, u95, expected) in [
            (20.0131, 0.0213, "20.013 ± 0.021 kg"),
            (20.0131, 0.0996, "20.01 ± 0.10 kg"),
            (-1.23456, 0.0451, "-1.235 ± 0.045 kg"),
            (-0.0004, 0.012, "0.000 ± 0.012 kg"),
            (56789.0, 1234.0, "56800 ± 1200 kg"),
            (9999.96, 12.4, "10000 ± 12 kg"),
            (9.996, 0.99, "10.00 ± 0.99 kg"),
            (9.996, 0.996, "10.0 ± 1.0 kg"),
            (5.0, 9.96, "5 ± 10 kg"),
            (3.2, 0.0, "3.2 ± 0 kg"),
            (0.0, 0.0, "0 ± 0 kg"),
            (0.1 + 0.2, 0.0, "0.3 ± 0 kg"),
            (0.0, 3e-5, "0.000000 ± 0.000030 kg"),
            (1.0e-9, 2.0e-10, "(1.00 ± 0.20)e-9 kg"),
            (1.2345e12, 3.1e9, "(1.2345 ± 0.0031)e12 kg"),
            (-1.0e300, 2.0e299, "(-1.00 ± 0.20)e300 kg"),
            (20.0, 1.0e-12, "20.000000000000 ± 1.0e-12 kg"),
            (20.0, 1.24e-9, "20.0000000000 ± 1.2e-9 kg"),
            (f64::NAN, 0.1, "not identified"),
            (1.0, f64::INFINITY, "not identified"),
            (1.0, -0.1, "not identified"),
        ] {
            assert_eq!(with_u95(value, u95, "kg"), expected);
        }
        assert_eq!(with_u95(0.38131, 0.00042, "kg m2"), "0.38131 ± 0.00042 kg m²");
        assert_eq!(with_u95(1.0, 0.1, ""), "1.00 ± 0.10");
    }

    /// Whatever the numbers, the text read back is the value within half a unit of the last place.
    #[test]
    fn rounding_moves_the_value_by_less_than_three_per_cent_of_the_uncertainty() {
        for k in -300..300 {
            for (value, u95) in [(1.234_567, 0.0996), (-9.999_999, 0.3), (5.55, 77.7), (0.0, 0.0149)] {
                let (value, u95) = (value * 10_f64.powi(k), u95 * 10_f64.powi(k));
                let rounded = Rounded::new(value, u95).unwrap();
                let back: f64 = rounded.value_alone().parse().unwrap();
                let u_back: f64 = rounded.u95_alone().parse().unwrap();
                // Half a unit of a second digit, at worst 0.05 of 1.0.
                assert!((back - value).abs() <= 0.0501 * u95, "{value} {rounded}");
                assert!((u_back - u95).abs() <= 0.0501 * u95, "{u95} {rounded}");
            }
        }
    }

    #[test]
    fn a_reference_shows_no_digits_that_the_estimate_cannot_have() {
        assert_eq!(beside(20.0, 0.021), "20");
        assert_eq!(beside(0.053_123_456, 0.000_21), "0.053123");
        assert_eq!(beside(-3e-17, 0.000_21), "0");
        assert_eq!(beside(0.5, 0.0), "0.5");
        assert_eq!(beside(1e-11, 3e-14), "1e-11");
        assert_eq!(beside(f64::NAN, 1.0), "unknown");
    }

    #[test]
    fn significant_digits_lose_their_zeros_and_keep_their_carry() {
        assert_eq!(significant(12.3456, 3), "12.3");
        assert_eq!(significant(999.96, 4), "1000");
        assert_eq!(significant(1.0e-7, 3), "1e-7");
        assert_eq!(significant(-0.25, 3), "-0.25");
        assert_eq!(significant(6.02e23, 2), "6e23");
        assert_eq!(significant(f64::INFINITY, 2), "unknown");
        assert_eq!(three_digits(10.04), "10.0");
        assert_eq!(three_digits(0.46), "0.460");
        assert_eq!(three_digits(99.97), "100");
        assert_eq!(three_digits(0.0), "0");
    }

    #[test]
    fn numbers_that_round_to_zero_have_no_sign_of_their_own() {
        for (value, decimals, expected) in [
            (0.344, 2, "+0.34"),
            (-1.337, 2, "-1.34"),
            (-0.004, 2, "+0.00"),
            (-0.05, 1, "-0.1"),
            (0.0, 1, "+0.0"),
        ] {
            assert_eq!(signed(value, decimals), expected);
        }
    }

    #[test]
    fn names_units_counts_and_durations_read_as_written_by_hand() {
        assert_eq!(unit_symbol("kg m2"), "kg m²");
        assert_eq!(unit_symbol("m/s2"), "m/s²");
        assert_eq!(unit_symbol("N m"), "N m");
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(count(12), "12");
        assert_eq!(duration(12.0), "12 s");
        assert_eq!(duration(99.97), "1 min 40 s");
        assert_eq!(duration(200.2), "3 min 20 s");
        assert_eq!(duration(3599.6), "1 h 00 min");
        assert_eq!(duration(f64::NAN), "unknown");
    }

    #[test]
    fn one_of_a_kind_is_in_the_singular() {
        assert_eq!(counted(1, "reading was", "readings were"), "1 reading was");
        assert_eq!(counted(0, "sample", "samples"), "0 samples");
    }
}
