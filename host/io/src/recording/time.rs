//! Times in files: decimal seconds in text, whole nanoseconds inside.

/// Whole numbers up to this are floating-point numbers.
const EXACT: u128 = 1 << 53;

/// A time in a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Time {
    /// Nanoseconds hold it exactly.
    Nanoseconds(i128),
    /// They do not: the number as it was, s.
    Seconds(f64),
}

impl Time {
    /// Returns the nearest nanosecond.
    pub fn nanoseconds(self) -> i128 {
        match self {
            Self::Nanoseconds(ns) => ns,
            Self::Seconds(s) => {
                let whole = s.floor();
                // The fraction of a number is exact; whole seconds are integers.
                (whole as i128)
                    .saturating_mul(1_000_000_000)
                    .saturating_add(((s - whole) * 1e9).round() as i128)
            }
        }
    }

    /// Returns the time as a floating-point number, s.
    pub fn seconds(self) -> f64 {
        match self {
            Self::Seconds(s) => s,
            // Both are exact, and the quotient is rounded once, as a decimal text is.
            Self::Nanoseconds(ns) if ns.unsigned_abs() <= EXACT => ns as f64 / 1e9,
            // A decimal text is rounded once, where a division would round twice.
            Self::Nanoseconds(ns) => signed_text(ns).parse().unwrap_or(ns as f64 * 1e-9),
        }
    }
}

/// Reads a decimal number times `scale` as seconds. Powers of ten shift the decimal point, so that
/// microseconds since 1970 keep every digit. `None` if it is not a finite number.
pub fn parse(cell: &str, scale: f64) -> Option<Time> {
    let value: f64 = cell.parse().ok().filter(|v: &f64| v.is_finite())?;
    if let Some(shift) = power_of_ten(scale)
        && let Some(ns) = decimal(cell, shift)
    {
        return Some(Time::Nanoseconds(ns));
    }
    // Multiplying by one would change nothing but the sign of a zero.
    let seconds = if scale == 1.0 { value } else { value * scale };
    seconds.is_finite().then(|| {
        let exact = Time::Nanoseconds(Time::Seconds(seconds).nanoseconds());
        if exact.seconds().to_bits() == seconds.to_bits() { exact } else { Time::Seconds(seconds) }
    })
}

/// Returns `k` where the scale is 10⁻ᵏ.
pub(super) fn power_of_ten(scale: f64) -> Option<usize> {
    [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9].iter().position(|p| *p == scale)
}

/// Returns a plain decimal times 10⁻ˢʰⁱᶠᵗ in ns, if that is an integer.
fn decimal(cell: &str, shift: usize) -> Option<i128> {
    let (negative, digits) = match cell.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, cell),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let fraction = fraction.trim_end_matches('0');
    let places = 9_usize.checked_sub(shift)?;
    let all_digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    if fraction.len() > places || whole.len() > 20 || !all_digits(whole) || !all_digits(fraction) {
        return None;
    }
    let ns: i128 = format!("0{whole}{fraction:0<places$}").parse().ok()?;
    Some(if negative { -ns } else { ns })
}

/// Returns signed nanoseconds as seconds with all their digits.
pub(super) fn signed_text(ns: i128) -> String {
    let sign = if ns < 0 { "-" } else { "" };
    let ns = ns.unsigned_abs();
    let text = format!("{sign}{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000);
    let short = text.trim_end_matches('0');
    if short.ends_with('.') { format!("{short}0") } else { short.to_owned() }
}

/// Nanoseconds as seconds with all their digits: `0.005`, `12.0`.
pub fn text(ns: u64) -> String {
    signed_text(i128::from(ns))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_keep_every_digit() {
        for (cell, scale, ns) in [
            ("0.005", 1.0, 5_000_000),
            ("-0.25", 1.0, -250_000_000),
            ("1708857503931759", 1e-6, 1_708_857_503_931_759_000),
            ("1708857503.931759123", 1.0, 1_708_857_503_931_759_123),
            ("5", 1e-3, 5_000_000),
            ("12", 1.0, 12_000_000_000),
            ("1e-3", 1.0, 1_000_000),
            ("0.0000000010", 1.0, 1),
            (".5", 1.0, 500_000_000),
        ] {
            assert_eq!(parse(cell, scale), Some(Time::Nanoseconds(ns)), "{cell}");
        }
        assert_eq!(parse("0.015000000000000001", 1.0), Some(Time::Seconds(0.015000000000000001)));
        for bad in ["", "nan", "inf", "12:30", "1,5"] {
            assert_eq!(parse(bad, 1.0), None);
        }
    }

    #[test]
    fn numbers_come_back_as_they_were() {
        for t in [0.0, 1.0 / 3.0, 3.0 * 0.005, 1e-12, 123456.789, 1_708_857_503.931_759, 1e18, -1.5] {
            let time = parse(&format!("{t:?}"), 1.0).unwrap();
            assert_eq!(time.seconds().to_bits(), f64::to_bits(t), "{t}");
            assert!((time.nanoseconds() as f64 - t * 1e9).abs() <= 1.0 + t.abs() * 1e9 * 1e-15);
        }
        assert_eq!(
            (text(5_000_000), text(12_000_000_000), text(0)),
            ("0.005".into(), "12.0".into(), "0.0".into())
        );
    }
}
