//! The choice of G. Venture, K. Ayusawa and Y. Nakamura (2009): motions that excite at least one part of the
//! body well, without near-duplicates.
//!
//! The paper gives neither the threshold nor the formula of the "variance" by which motions are
//! distinguished. Here the signature of motion k are the logarithms `s_ki = log10 cond` of its groups i, the
//! distance of two motions is `D² = mean(d)² + var(d)`, `d_i = s_ki − s_li`, which is the mean of `d_i²`; of
//! the closest pair the one that is also closer to a third motion is taken
//! away, until as many are left as were asked for.

use super::conditions::{Condition, Group, conditions};
use super::{Candidate, SelectionError, check};

/// A condition beyond this counts as this: nothing is reported.
const WORST: f64 = 1e12;

/// Returns the motions whose best group has a condition number below `threshold`, near-duplicates taken away
/// until `count` are left, in the order of the candidates.
///
/// # Errors
/// [`SelectionError`] if there is nothing to choose from.
pub fn choose(
    candidates: &[Candidate],
    groups: &[Group],
    threshold: f64,
    count: usize,
) -> Result<Vec<usize>, SelectionError> {
    check(candidates)?;
    if count == 0 {
        return Err(SelectionError::Zero);
    }
    let all: Vec<Vec<Condition>> = candidates.iter().map(|c| conditions(&c.factor, groups)).collect();
    let excites = |own: &[Condition]| own.iter().map(|c| c.raw).fold(f64::INFINITY, f64::min) < threshold;
    let mut left: Vec<usize> =
        (0..candidates.len()).filter(|k| all.get(*k).is_some_and(|c| excites(c))).collect();
    let signature =
        |own: &[Condition]| -> Vec<f64> { own.iter().map(|c| c.raw.min(WORST).log10()).collect() };
    let signatures: Vec<Vec<f64>> = all.iter().map(|own| signature(own)).collect();
    // The names decide between equals, so that the order of the candidates does not.
    left.sort_by(|a, b| candidates[*a].name.cmp(&candidates[*b].name));
    thin(&mut left, &signatures, count);
    left.sort_unstable();
    Ok(left)
}

/// Takes near-duplicates away until the given number is left.
fn thin(left: &mut Vec<usize>, signatures: &[Vec<f64>], count: usize) {
    let distance = |a: usize, b: usize| square_distance(&signatures[a], &signatures[b]);
    // The nearest other one of each.
    let nearest = |left: &[usize], k: usize| -> (f64, usize) {
        let others = left.iter().filter(|o| **o != k).map(|o| (distance(k, *o), *o));
        others.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, k))
    };
    let mut near: Vec<(f64, usize)> = left.iter().map(|k| nearest(left, *k)).collect();
    while left.len() > count.max(1) {
        let Some(first) = (0..left.len()).min_by(|a, b| near[*a].0.total_cmp(&near[*b].0)) else { return };
        let (a, b) = (left[first], near[first].1);
        let third = |k: usize, other: usize| {
            let others = left.iter().filter(|o| **o != k && **o != other);
            others.map(|o| distance(k, *o)).fold(f64::INFINITY, f64::min)
        };
        let gone = if third(a, b) <= third(b, a) { a } else { b };
        let place = left.iter().position(|k| *k == gone).unwrap_or(first);
        left.remove(place);
        near.remove(place);
        for (k, near) in left.iter().zip(&mut near).filter(|(_, near)| near.1 == gone) {
            *near = nearest(left, *k);
        }
    }
}

/// `mean(d)² + var(d)` of the differences of two signatures.
fn square_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>() / a.len().max(1) as f64
}
