//! White noise of signals: how much there is, and signs by chance, the same on every machine, to make more of
//! it.

/// Steele's splitmix64, a sign from the top bit of each number.
#[derive(Clone, Debug)]
pub struct Signs(u64);

impl Signs {
    /// Returns the signs of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_add(1))
    }

    /// Returns 1 or −1.
    pub fn draw(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        if (z ^ (z >> 31)) >> 63 == 0 { -1.0 } else { 1.0 }
    }
}

/// Share of the differences that counts: knocks and jumps are not noise.
const COUNTED: f64 = 0.95;
/// Mean of the least 95 % of a χ² of three degrees of freedom over its mean: `F₅(q)/0.95` at the quantile q
/// of F₃;
const COUNTED_OF_THREE: f64 = 0.877;
/// of one: `F₃(q)/0.95` at the quantile q of F₁.
const COUNTED_OF_ONE: f64 = 0.759;
/// Noise below this share of the largest value is rounding, of computed signals: no sensor has twenty bits.
const LEAST: f64 = 1e-6;
/// Longer recordings are examined in as many places.
const MOST: usize = 100_000;

/// Weights of sixth differences; the squares add up to 924.
const SIXTH: [f64; 7] = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0];
/// Weights of tenth differences.
pub const TENTH: [f64; 11] = [1.0, -10.0, 45.0, -120.0, 210.0, -252.0, 210.0, -120.0, 45.0, -10.0, 1.0];
/// Noise is white as far as differences show if sixth and tenth ones agree as well: some per cent are chance.
const WHITE: f64 = 0.1;

/// Returns σ of a sensor, the root mean square over its axes, from sixth differences: motion hardly enters,
/// noise by √924. Each signal is given with its time, ns; a step of more than one and a half times the usual
/// one is none. Its N numbers have one freedom or three.
pub fn sixth_differences<const N: usize>(signals: &[(u64, [f64; N])], freedoms: u8) -> f64 {
    sixth_differences_of(signals, |signal| *signal, freedoms)
}

/// Returns the same of signals that `of` finds in readings.
pub fn sixth_differences_of<R, const N: usize>(
    readings: &[R],
    of: impl Fn(&R) -> (u64, [f64; N]),
    freedoms: u8,
) -> f64 {
    differences(readings, of, freedoms, &SIXTH)
}

/// Returns the same if the noise is white. Tenth differences show another one where a sensor has a low-pass,
/// which hides its noise, and where vibration resembles noise; zero then.
pub fn certain_noise<R, const N: usize>(
    readings: &[R],
    of: impl Fn(&R) -> (u64, [f64; N]),
    freedoms: u8,
) -> f64 {
    let sixth = differences(readings, &of, freedoms, &SIXTH);
    let tenth = differences(readings, of, freedoms, &TENTH);
    if (tenth / sixth - 1.0).abs() < WHITE { sixth } else { 0.0 }
}

fn differences<R, const N: usize, const W: usize>(
    readings: &[R],
    of: impl Fn(&R) -> (u64, [f64; N]),
    freedoms: u8,
    weights: &[f64; W],
) -> f64 {
    let span =
        |window: &[R]| window.last().zip(window.first()).map_or(0, |(b, a)| of(b).0.saturating_sub(of(a).0));
    let usual = span(readings) as f64 / readings.len().saturating_sub(1).max(1) as f64;
    let windows = readings.windows(W).step_by(readings.len().div_ceil(MOST).max(1));
    let whole = windows.filter(|window| span(window) as f64 <= (W as f64 - 0.5) * usual);
    let mut squares: Vec<f64> = whole
        .map(|window| {
            let own: [[f64; N]; W] = std::array::from_fn(|k| window.get(k).map_or([0.0; N], |r| of(r).1));
            let axis = |k: usize| own.iter().zip(weights).map(|(v, weight)| weight * v[k]).sum::<f64>();
            (0..N).map(|k| axis(k).powi(2)).sum::<f64>()
        })
        .filter(|square| square.is_finite())
        .collect();
    squares.sort_by(f64::total_cmp);
    squares.truncate((COUNTED * squares.len() as f64).ceil() as usize);
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    let counted = if freedoms == 1 { COUNTED_OF_ONE } else { COUNTED_OF_THREE };
    let gain: f64 = weights.iter().map(|weight| weight * weight).sum();
    let sigma = (mean / (counted * f64::from(freedoms) * gain)).sqrt();
    let largest = readings.iter().flat_map(|r| of(r).1);
    let largest = largest.filter(|v| v.is_finite()).fold(0.0_f64, |m, v| m.max(v.abs()));
    if sigma > LEAST * largest { sigma } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motion of 1.5 Hz at 200 Hz with white noise, a gap, a jump and a spike.
    #[test]
    fn noise_is_found_whatever_moves() {
        let mut signs = Signs::new(3);
        // The sum of twelve signs is nearly normal, of σ √12.
        let mut normal = || (0..12).map(|_| signs.draw()).sum::<f64>() / 12.0_f64.sqrt();
        let mut signals: Vec<(u64, [f64; 3])> = (0..8000_u64)
            .map(|k| {
                let t = k as f64 * 0.005;
                let (sin, cos) = (std::f64::consts::TAU * 1.5 * t).sin_cos();
                let gap = if k < 4000 { 0 } else { 1_000_000_000 };
                let jump = if k < 6000 { 0.0 } else { 9.0 };
                (
                    k * 5_000_000 + gap,
                    [5.0 * sin + 0.02 * normal(), cos + jump + 0.02 * normal(), 0.02 * normal()],
                )
            })
            .collect();
        signals[1000].1[0] += 50.0;
        let found = sixth_differences(&signals, 3);
        assert!((found / 0.02 - 1.0).abs() < 0.05, "{found}");
        assert_eq!(sixth_differences(&signals[..6], 3), 0.0);
        assert_eq!(certain_noise(&signals, |signal| *signal, 3), found);
        // A mean of neighbours takes most of what differences show; the noise that is left is none to be
        // certain of.
        let mean = |w: &[(u64, [f64; 3])]| std::array::from_fn(|k| 0.5 * (w[0].1[k] + w[1].1[k]));
        let smoothed: Vec<(u64, [f64; 3])> = signals.windows(2).map(|w| (w[1].0, mean(w))).collect();
        assert!(
            sixth_differences(&smoothed, 3) < found / 2.0
                && certain_noise(&smoothed, |signal| *signal, 3) == 0.0
        );
        let one: Vec<(u64, [f64; 1])> = signals.iter().map(|(t, v)| (*t, [v[0]])).collect();
        let found = sixth_differences(&one, 1);
        assert!((found / 0.02 - 1.0).abs() < 0.05, "{found}");
    }
}
