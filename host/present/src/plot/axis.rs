//! Ranges and round tick values.

/// Typographic minus, as wide as a plus.
const MINUS: &str = "\u{2212}";

/// A range with ticks at round values inside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Smallest value shown.
    pub low: f64,
    /// Largest value shown.
    pub high: f64,
    /// Round values within.
    pub ticks: Vec<f64>,
    /// Labels are in units of ten to this power (a multiple of three).
    pub exponent: i32,
    /// Decimals of the labels.
    decimals: usize,
}

impl Axis {
    /// Returns an axis from `low` to `high` with about `wanted` ticks at 1, 2 or 5 times a power of ten. A
    /// range that f64 or a reader cannot resolve is widened.
    pub fn covering(low: f64, high: f64, wanted: usize) -> Self {
        let usable = |v: f64| v.is_finite() && v.abs() < 1e150;
        let (mut low, mut high) =
            if usable(low) && usable(high) { (low.min(high), low.max(high)) } else { (0.0, 1.0) };
        let magnitude = low.abs().max(high.abs());
        let least = if magnitude > 0.0 { (1e-9 * magnitude).max(1e-150) } else { 1.0 };
        if high - low < least {
            let centre = 0.5 * (low + high);
            (low, high) = (centre - 0.5 * least, centre + 0.5 * least);
        }
        let step = round_step((high - low) / wanted.max(1) as f64);
        // A tick that rounding alone puts outside belongs inside.
        let (first, last) = ((low / step - 1e-6).ceil(), (high / step + 1e-6).floor());
        let ticks = (0..=(last - first) as usize).map(|i| (first + i as f64) * step).collect();
        let largest = low.abs().max(high.abs()).log10().floor() as i32;
        let exponent = if (-4..5).contains(&largest) { 0 } else { 3 * largest.div_euclid(3) };
        let place = (step.log10() + 1e-9).floor() as i32 - exponent;
        Self { low, high, ticks, exponent, decimals: usize::try_from(-place).unwrap_or(0) }
    }

    /// Returns the text of a tick, without the power of ten.
    pub fn label(&self, tick: f64) -> String {
        let text = format!("{:.*}", self.decimals, tick / 10_f64.powi(self.exponent));
        match text.strip_prefix('-') {
            Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_owned(),
            Some(rest) => format!("{MINUS}{rest}"),
            None => text,
        }
    }

    /// Returns the width of the longest label in characters.
    pub fn widest_label(&self) -> usize {
        self.ticks.iter().map(|t| self.label(*t).chars().count()).max().unwrap_or(1)
    }

    /// Returns the unit with the power of ten that the labels lack: `×10⁻³ N m`.
    pub fn unit(&self, unit: &str) -> String {
        if self.exponent == 0 { unit.to_owned() } else { format!("{} {unit}", power_of_ten(self.exponent)) }
    }

    /// Returns where the value lies: 0 at `low`, 1 at `high`.
    pub fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }
}

/// Returns a power of ten as text: `×10⁻³`.
pub fn power_of_ten(exponent: i32) -> String {
    let superscript = |c: char| match c {
        '-' => '⁻',
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + (digit as u32).saturating_sub('0' as u32)).unwrap_or(digit),
    };
    format!("×10{}", exponent.to_string().chars().map(superscript).collect::<String>())
}

/// Returns the smallest of 1, 2, 5 · 10^k that is not below `raw` (positive).
fn round_step(raw: f64) -> f64 {
    let decade = 10_f64.powi(raw.log10().floor() as i32);
    [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|s| *s >= raw * (1.0 - 1e-9)).unwrap_or(raw)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64) -> Vec<String> {
        let axis = Axis::covering(low, high, 5);
        axis.ticks.iter().map(|t| axis.label(*t)).collect()
    }

    #[test]
    fn ticks_are_round_and_labelled_with_just_the_decimals_they_need() {
        assert_eq!(labels(0.0, 60.0), ["0", "20", "40", "60"]);
        assert_eq!(labels(0.0, 10.0), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(labels(-1.0, 1.0), ["−1.0", "−0.5", "0.0", "0.5", "1.0"]);
        assert_eq!(labels(20.0131, 20.0135), ["20.0131", "20.0132", "20.0133", "20.0134", "20.0135"]);
        assert_eq!(labels(-0.1, 0.3), ["−0.1", "0.0", "0.1", "0.2", "0.3"]);
    }

    #[test]
    fn very_small_and_very_large_values_carry_their_power_of_ten_in_the_unit() {
        let axis = Axis::covering(-4e-5, 5e-5, 5);
        assert_eq!(axis.unit("N m"), "×10⁻⁶ N m");
        assert_eq!(axis.label(axis.ticks[0]), "−40");
        assert_eq!(Axis::covering(0.0, 2e6, 5).unit("N"), "×10⁶ N");
        assert_eq!(Axis::covering(0.0, 20.0, 5).unit("N"), "N");
        assert_eq!(power_of_ten(-45), "×10⁻⁴⁵");
    }

    #[test]
    fn any_two_numbers_give_a_usable_axis() {
        let odd =
            [0.0, -0.0, 1.0, 1.0 + f64::EPSILON, -1e-308, 1e308, f64::NAN, f64::INFINITY, 5e-324, 1e149];
        for low in odd {
            for high in odd {
                let axis = Axis::covering(low, high, 6);
                assert!(axis.low < axis.high && axis.ticks.len() <= 8, "{low} {high} {axis:?}");
                assert!(axis.ticks.iter().all(|t| (-0.01..=1.01).contains(&axis.share(*t))));
                assert!(axis.widest_label() < 16);
            }
        }
    }
}
