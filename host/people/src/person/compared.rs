//! The force that a motion needs beside the one that plates measured: whether one follows the other.

use nalgebra::Vector3;

/// Fewest frames that tell whether plates and cameras belong together, …
const FEWEST_TO_COMPARE: usize = 30;
/// … of a person who moves: standard deviations of the force over the weight, …
const MOVES: f64 = 0.03;
/// … and the least correlation of the two.
pub(super) const LEAST_CORRELATION: f64 = 0.4;

/// Needed and measured force in frames of a trial, N.
pub(super) struct Compared {
    pairs: Vec<[Vector3<f64>; 2]>,
    means: [Vector3<f64>; 2],
    /// Standard deviations about the means.
    spread: [Vector3<f64>; 2],
}

impl Compared {
    /// Returns the comparison of pairs, needed first; `None` of too few.
    pub(super) fn of(pairs: Vec<[Vector3<f64>; 2]>) -> Option<Self> {
        if pairs.len() < FEWEST_TO_COMPARE {
            return None;
        }
        let n = pairs.len() as f64;
        let means = [0, 1].map(|k| pairs.iter().map(|p| p[k]).sum::<Vector3<f64>>() / n);
        let squares =
            |k: usize| pairs.iter().map(|p| (p[k] - means[k]).map(|v| v * v)).sum::<Vector3<f64>>() / n;
        let spread = [0, 1].map(|k| squares(k).map(f64::sqrt));
        Some(Self { pairs, means, spread })
    }

    /// Returns the correlation of the needed force along an axis with the measured one along another; `None`
    /// of who hardly moves along them.
    pub(super) fn correlation(&self, needed: usize, measured: usize) -> Option<f64> {
        let moves = MOVES * self.means[1].z.abs();
        let [a, b] = [self.spread[0][needed], self.spread[1][measured]];
        let product = |p: &[Vector3<f64>; 2]| {
            (p[0][needed] - self.means[0][needed]) * (p[1][measured] - self.means[1][measured])
        };
        let mean = self.pairs.iter().map(product).sum::<f64>() / self.pairs.len() as f64;
        (a > moves && b > moves).then(|| mean / (a * b))
    }

    /// Returns the horizontal axis along which plates push against the motion, with the correlation. Small
    /// ones are those of parts that no marker follows, or of noise; no honest plate pushes the other way.
    pub(super) fn flipped(&self) -> Option<(&'static str, f64)> {
        let of = |(axis, k)| Some((axis, self.correlation(k, k).filter(|r| *r < -LEAST_CORRELATION)?));
        [("x", 0), ("y", 1)].into_iter().find_map(of)
    }
}
