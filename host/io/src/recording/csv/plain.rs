//! Plain decimals, `-12.345`, read at once with where they end.

use crate::recording::time::Time;

/// Whole numbers up to this are exact, as are powers of ten up to 10²²: of two exact numbers a quotient is
/// rounded once.
const EXACT: u64 = 1 << 53;
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];
/// More digits may not fit their number.
const MOST_DIGITS: usize = 18;
/// Digits of a second in nanoseconds.
const PLACES: usize = 9;

/// A decimal: digits with a sign and a point among them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plain {
    is_negative: bool,
    digits: u64,
    count: usize,
    fraction: usize,
    /// Bytes that it takes.
    pub(super) length: usize,
}

impl Plain {
    /// Reads the decimal that a text begins with.
    pub(super) fn read(text: &[u8]) -> Self {
        let is_negative = text.first() == Some(&b'-');
        let start = usize::from(is_negative);
        let (mut digits, mut length) = (0_u64, start);
        let mut take = |length: &mut usize| {
            let from = *length;
            while let Some(digit) = text.get(*length).map(|byte| byte.wrapping_sub(b'0')).filter(|d| *d < 10)
            {
                digits = digits.wrapping_mul(10).wrapping_add(u64::from(digit));
                *length += 1;
            }
            *length - from
        };
        let whole = take(&mut length);
        let mut fraction = 0;
        if text.get(length) == Some(&b'.') {
            length += 1;
            fraction = take(&mut length);
        }
        Self { is_negative, digits, count: whole + fraction, fraction, length }
    }

    fn has_digits(&self) -> bool {
        (1..=MOST_DIGITS).contains(&self.count)
    }

    /// Returns the number as the standard library reads it; `None` if one rounding is not enough.
    pub(super) fn number(&self) -> Option<f64> {
        let power = POWERS.get(self.fraction).filter(|_| self.has_digits() && self.digits <= EXACT)?;
        let size = self.digits as f64 / power;
        Some(if self.is_negative { -size } else { size })
    }

    /// Returns the same as a time in units of 10⁻ˢʰⁱᶠᵗ s, as [`crate::recording::time::parse`] reads it;
    /// `None` if it has more digits than usual.
    pub(super) fn time(&self, shift: usize) -> Option<Time> {
        let places = PLACES.checked_sub(shift)?;
        let missing = places.checked_sub(self.fraction)?;
        if !self.has_digits() || self.count + missing > MOST_DIGITS {
            return None;
        }
        let ns = i128::from(self.digits) * 10_i128.pow(u32::try_from(missing).ok()?);
        Some(Time::Nanoseconds(if self.is_negative { -ns } else { ns }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::time;

    #[test]
    fn plain_decimals_are_the_bits_of_the_standard_library() {
        let mut state = 5_u64;
        let mut next = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let fixed = [
            "0",
            "-0",
            "-0.0",
            ".5",
            "5.",
            "-.25",
            "007.50",
            "9007199254740993",
            "0.1",
            "123456789012345.678",
        ];
        let mut texts: Vec<String> = fixed.map(str::to_owned).to_vec();
        for _ in 0..20_000 {
            let whole: String = (0..next(12)).map(|_| char::from(b'0' + next(10) as u8)).collect();
            let fraction: String = (0..next(12)).map(|_| char::from(b'0' + next(10) as u8)).collect();
            texts.push(format!("{}{whole}.{fraction}", if next(2) == 0 { "-" } else { "" }));
        }
        let mut read = 0;
        for text in &texts {
            let plain = Plain::read(text.as_bytes());
            assert_eq!(plain.length, text.len(), "{text}");
            let known: Option<f64> = text.parse().ok();
            if let Some(number) = plain.number() {
                assert_eq!(Some(number.to_bits()), known.map(f64::to_bits), "{text}");
                read += 1;
            }
            for (shift, scale) in [(0, 1.0), (3, 1e-3), (6, 1e-6), (9, 1e-9)] {
                if let Some(own) = plain.time(shift) {
                    assert_eq!(Some(own), time::parse(text, scale), "{text}, {scale}");
                }
            }
        }
        assert!(read > 15_000, "{read}");
        for other in ["", "-", ".", "-.", "+1", "nan", "1e5", "1234567890123456789"] {
            let plain = Plain::read(other.as_bytes());
            assert!(plain.number().is_none() || plain.length < other.len(), "{other}");
        }
    }
}
