//! Series packed into text for the page.
//!
//! A value is a whole number of steps. The number in the text is how far it is from where the last two values
//! lead, which is small for a motion: a number of base-64 digits as in source maps (VLQ), five bits in each,
//! the sign lowest in the first, the sixth bit set where another follows. A dot is a value that is missing;
//! after it the motion is taken to begin at rest.

const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
/// Most steps from zero: what follows from it stays a 32-bit number.
const FARTHEST: f64 = (1_u32 << 26) as f64;

/// Channels of one step size.
#[derive(Clone, Debug, serde::Serialize, PartialEq)]
pub struct Packed {
    /// Size of a step.
    pub step: f64,
    /// One text per channel.
    pub channels: Vec<String>,
}

/// Returns channels packed in steps of this size, or larger ones where values are too far from zero.
pub fn pack(step: f64, channels: &[Vec<f32>]) -> Packed {
    let largest = largest(channels.iter().flatten());
    let step = step.max(largest / FARTHEST);
    Packed { step, channels: channels.iter().map(|values| packed(step, values)).collect() }
}

/// Returns the largest finite magnitude, or zero.
pub fn largest<'a>(values: impl Iterator<Item = &'a f32>) -> f64 {
    values.filter(|v| v.is_finite()).fold(0.0, |most, v| most.max(f64::from(v.abs())))
}

fn packed(step: f64, values: &[f32]) -> String {
    let mut text = String::with_capacity(values.len() + values.len() / 4);
    let (mut last, mut before) = (0_i64, 0_i64);
    for value in values {
        if !value.is_finite() {
            text.push('.');
            before = last;
            continue;
        }
        let steps = (f64::from(*value) / step).round() as i64;
        digits(&mut text, steps - (2 * last - before));
        (before, last) = (last, steps);
    }
    text
}

fn digits(text: &mut String, number: i64) {
    let mut rest = (number.unsigned_abs() << 1) | u64::from(number < 0);
    loop {
        let more = u64::from(rest >= 32) << 5;
        text.push(char::from(DIGITS[((rest & 31) | more) as usize]));
        rest >>= 5;
        if rest == 0 {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns what the player does.
    fn unpacked(text: &str, step: f64) -> Vec<f64> {
        let mut digits = text.bytes();
        let (mut last, mut before, mut values) = (0_i64, 0_i64, Vec::new());
        while let Some(mut digit) = digits.next() {
            if digit == b'.' {
                before = last;
                values.push(f64::NAN);
                continue;
            }
            let (mut rest, mut shift) = (0_i64, 0);
            loop {
                let bits = DIGITS.iter().position(|d| *d == digit).unwrap() as i64;
                rest |= (bits & 31) << shift;
                shift += 5;
                if bits < 32 {
                    break;
                }
                digit = digits.next().unwrap();
            }
            let number = if rest & 1 == 1 { -(rest >> 1) } else { rest >> 1 };
            let steps = number + 2 * last - before;
            (before, last) = (last, steps);
            values.push(steps as f64 * step);
        }
        values
    }

    #[test]
    fn values_come_back_within_half_a_step_and_gaps_stay_gaps() {
        let odd = [0.0, 1e-3, -7.3, f32::NAN, f32::NAN, 1234.5, f32::INFINITY, -0.0, 31.0, -32.0, 1e3];
        let wave: Vec<f32> = (0..5000).map(|k| (k as f32 * 0.01).sin()).collect();
        for (step, values) in
            [(1e-3, odd.to_vec()), (5e-4, wave), (1.0, vec![f32::MAX, f32::MIN, 3.0]), (1.0, vec![])]
        {
            let Packed { step, channels } = pack(step, std::slice::from_ref(&values));
            let back = unpacked(&channels[0], step);
            assert_eq!(back.len(), values.len());
            for (a, b) in values.iter().zip(&back) {
                let near = (f64::from(*a) - b).abs() <= 0.5001 * step;
                assert!(if a.is_finite() { near } else { b.is_nan() }, "{a} {b} by {step}");
            }
        }
    }

    #[test]
    fn a_smooth_motion_takes_one_character_per_value() {
        let stride: Vec<f32> =
            (0..12_000).map(|k| 0.4 * (k as f32 * 0.063).sin() + 0.013 * k as f32).collect();
        let text = packed(5e-4, &stride);
        assert!(text.len() < 12_100, "{}", text.len());
    }
}
