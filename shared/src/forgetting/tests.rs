extern crate std;
use std::vec::Vec;

use nalgebra::{Matrix4, Vector4};

use super::*;
use crate::random::Random;

/// Root mean square of the regressor's noise; the wrench's is 1.
const NOISE: f64 = 0.01;
const TRUTH: [f64; 4] = [2.0, -1.0, 0.5, 3.0];
const ROWS: usize = 60;

/// Returns rows whose coefficients have the given sizes, plus noise in the regressor that the answer does not
/// know.
fn segment(random: &mut Random, truth: &[f64; 4], size: &[f64; 4]) -> InformationFactor<f64, 4> {
    let mut factor = InformationFactor::new();
    for _ in 0..ROWS {
        let row: [f64; 4] = core::array::from_fn(|j| size[j] * random.normal());
        let y = row.iter().zip(truth).map(|(a, p)| a * p).sum::<f64>() + random.normal();
        factor.absorb::<1>(&row.map(|a| [a + NOISE * random.normal()]), &[y]);
    }
    factor
}

fn information<T: Scalar>(factor: &InformationFactor<T, 4>, wide: impl Fn(T) -> f64) -> Matrix4<f64> {
    let r = Matrix4::from_fn(|i, j| wide(factor.r()[i][j]));
    r.transpose() * r
}

fn exact(factor: &InformationFactor<f64, 4>) -> Matrix4<f64> {
    information(factor, |v| v)
}

const ALL: [f64; 4] = [3.0, 1.0, 2.0, 0.5];
const STILL: [f64; 4] = [0.0; 4];
const PART: [f64; 4] = [3.0, 0.0, 2.0, 0.0];

/// Forgets by the plain exponential rule of the textbook: `R ← √λ R`, `z ← √λ z`.
fn plain(memory: &mut InformationFactor<f64, 4>, segment: &InformationFactor<f64, 4>, lambda: f64) {
    let root = lambda.sqrt();
    let numbers = InformationFactor::<f64, 4>::ENTRIES - 1;
    let entries: Vec<f64> =
        memory.entries().enumerate().map(|(k, v)| if k < numbers { root * v } else { lambda * v }).collect();
    *memory = InformationFactor::from_entries(entries, 0).unwrap();
    memory.merge(segment);
}

#[test]
fn forgetting_of_one_is_no_forgetting() {
    let mut random = Random(3);
    let mut forgetting = Forgetting::new([NOISE; 4]);
    let mut merged = InformationFactor::new();
    for n in 0..50 {
        let s = segment(&mut random, &TRUTH, [&ALL, &STILL, &PART][n % 3]);
        forgetting.take(&s, 1.0);
        merged.merge(&s);
    }
    assert_eq!(forgetting.factor(), merged);
    assert_eq!(retention(0.1, f64::INFINITY), 1.0);
    assert_eq!(retention(0.1, 0.0), 1.0);
}

#[test]
fn one_segment_forgets_by_the_formula() {
    // M⊥ + λ M∥ + S by nalgebra on the matrices themselves, X being the excited coordinates.
    let mut random = Random(5);
    let lambda = 0.7;
    let mut forgetting = Forgetting::new([NOISE; 4]);
    forgetting.take(&segment(&mut random, &TRUTH, &ALL), 1.0);
    // Correlate the parameters, so that M∥ is not a block.
    let map = [[1.0, 0.0, 0.4, 0.0], [0.3, 1.0, 0.0, 0.0], [0.0, 0.2, 1.0, 0.5], [0.1, 0.0, 0.0, 1.0]];
    forgetting.memory = forgetting.memory.substitute(&map);
    let m = exact(&forgetting.factor());
    // A segment without noise, so that X is known exactly: rows in two directions.
    let (a, b) = (Vector4::new(3.0, 1.0, 0.0, -1.0), Vector4::new(0.0, 2.0, 1.0, 0.5));
    let mut s = InformationFactor::new();
    for n in 0..ROWS {
        let row = if n % 2 == 0 { a } else { b };
        s.absorb::<1>(&[[row[0]], [row[1]], [row[2]], [row[3]]], &[1.0]);
    }
    let x = nalgebra::Matrix4x2::from_columns(&[a, b]);
    let mx = m * x;
    let parallel = mx * (x.transpose() * mx).try_inverse().unwrap() * mx.transpose();
    let expected = m - parallel * (1.0 - lambda) + exact(&s);
    assert_eq!(forgetting.take(&s, lambda), 2);
    assert!((exact(&forgetting.factor()) - expected).abs().max() < 1e-11 * expected.abs().max());
}

#[test]
fn constant_excitation_tends_to_the_geometric_sum() {
    let mut random = Random(7);
    let s = segment(&mut random, &TRUTH, &ALL);
    let lambda = retention(0.5, 10.0);
    assert!((1.0 / (1.0 - lambda) - 21.0).abs() < 1e-12);
    let mut forgetting = Forgetting::new([NOISE; 4]);
    for n in 1..=400_u32 {
        assert_eq!(forgetting.take(&s, lambda), 4);
        let sum = (1.0 - lambda.powi(n as i32)) / (1.0 - lambda);
        let expected = exact(&s) * sum;
        assert!((exact(&forgetting.factor()) - expected).abs().max() < 1e-10 * expected.abs().max());
    }
    let (kept, one) = (forgetting.factor(), s.residual_sum_of_squares());
    assert!((kept.residual_sum_of_squares() / one - 21.0).abs() < 1e-3);
    assert_eq!(kept.rows(), 21 * ROWS as u32);
    // The answer of equal segments is the answer of one.
    for (a, b) in kept.solve().estimate.iter().zip(s.solve().estimate) {
        assert!((a - b).abs() < 1e-10);
    }
}

#[test]
fn a_step_is_followed_with_the_time_constant() {
    // Noise-free segments of equal information: the answer is the weighted mean, so that after n segments the
    // old value has the weight λⁿ.
    let mut random = Random(9);
    let rows: Vec<[f64; 4]> = (0..ROWS).map(|_| core::array::from_fn(|j| ALL[j] * random.normal())).collect();
    let of = |truth: &[f64; 4]| {
        let mut s = InformationFactor::new();
        for row in &rows {
            let y = row.iter().zip(truth).map(|(a, p)| a * p).sum();
            s.absorb::<1>(&row.map(|a| [a]), &[y]);
        }
        s
    };
    let mut after = TRUTH;
    after[0] += 1.0;
    let (segment_s, time_constant_s) = (0.2, 5.0);
    let lambda = retention(segment_s, time_constant_s);
    let mut forgetting = Forgetting::new([NOISE; 4]);
    for _ in 0..2000 {
        forgetting.take(&of(&TRUTH), lambda);
    }
    for n in 1..=25 {
        forgetting.take(&of(&after), lambda);
        let old = lambda.powi(n);
        assert!((forgetting.factor().solve().estimate[0] - (after[0] - old)).abs() < 1e-9);
    }
    // 25 segments are one time constant: 1/e is left, within the rational's Δt / 2τ = 2 %.
    let left = after[0] - forgetting.factor().solve().estimate[0];
    assert!((left / (-1.0_f64).exp() - 1.0).abs() < 0.02 + 0.02 * 0.02, "{left}");
}

#[test]
fn standing_still_winds_up_plain_forgetting_and_not_this() {
    let mut random = Random(11);
    let lambda = retention(0.5, 20.0);
    let mut forgetting = Forgetting::new([NOISE; 4]);
    let mut textbook = InformationFactor::new();
    for _ in 0..500 {
        let s = segment(&mut random, &TRUTH, &ALL);
        forgetting.take(&s, lambda);
        plain(&mut textbook, &s, lambda);
    }
    let before = forgetting.factor();
    let sd = before.solve().standard_deviation;
    for n in 0..100_000 {
        let s = segment_of_noise(&mut random, n);
        assert_eq!(forgetting.take(&s, lambda), 0);
        plain(&mut textbook, &s, lambda);
    }
    // Nothing excited: nothing changed, to the last bit.
    assert_eq!(forgetting.factor(), before);
    // The planted failure: noise in regressor and wrench is all that is left, with the answer at random.
    let wound = textbook.solve();
    for j in 0..4 {
        assert!(wound.standard_deviation[j] > 20.0 * sd[j]);
    }
    let off = (0..4).map(|j| (wound.estimate[j] - TRUTH[j]).abs() / sd[j]).fold(0.0, f64::max);
    assert!(off > 20.0, "{off}");
}

/// Returns a still segment, in its triangle already: the Bartlett decomposition of 60 rows would be the exact
/// law; its mean with random signs and a spread does for a hundred thousand of them.
fn segment_of_noise(random: &mut Random, n: usize) -> InformationFactor<f64, 4> {
    if n.is_multiple_of(1000) {
        return segment(random, &TRUTH, &STILL);
    }
    let mut r = [[0.0; 4]; 4];
    for i in 0..4 {
        for j in i..4 {
            r[i][j] = if i == j {
                let freedom = (ROWS - i) as f64;
                NOISE * (freedom + (2.0 * freedom).sqrt() * random.normal()).max(1.0).sqrt()
            } else {
                NOISE * random.normal()
            };
        }
    }
    let triangle: Vec<f64> = (0..4).flat_map(|i| r[i][i..].to_vec()).collect();
    let z: Vec<f64> = (0..4).map(|_| random.normal()).collect();
    let entries = triangle.into_iter().chain(z).chain(core::iter::once(ROWS as f64 - 4.0));
    InformationFactor::from_entries(entries, ROWS as u32).unwrap()
}

#[test]
fn partial_excitation_keeps_the_rest() {
    let mut random = Random(13);
    let lambda = retention(0.5, 20.0);
    let mut forgetting = Forgetting::new([NOISE; 4]);
    for _ in 0..500 {
        forgetting.take(&segment(&mut random, &TRUTH, &ALL), lambda);
    }
    let before = forgetting.factor().solve();
    // Parameter 0 changes; 1 and 3 are not excited any more.
    let mut after = TRUTH;
    after[0] += 1.0;
    for _ in 0..20_000 {
        let excited = forgetting.take(&segment(&mut random, &after, &PART), lambda);
        assert!((2..=3).contains(&excited), "{excited}");
    }
    let now = forgetting.factor().solve();
    // The excited ones follow, within six of their standard deviations.
    for j in [0, 2] {
        assert!((now.estimate[j] - after[j]).abs() < 6.0 * now.standard_deviation[j] + NOISE);
    }
    // The others are as sharp as they were and stay within six of their standard deviations.
    for j in [1, 3] {
        assert!(now.standard_deviation[j] < 1.2 * before.standard_deviation[j], "{j} {now:?} {before:?}");
        assert!(
            (now.estimate[j] - TRUTH[j]).abs() < 6.0 * before.standard_deviation[j] + NOISE,
            "{j} {now:?}"
        );
    }
}

/// Returns the largest difference of f32 from f64 over 20 000 segments of all kinds, in standard deviations;
/// signals 1e4 times the noise.
fn single_against_double(recentred: bool) -> f64 {
    let mut random = Random(17);
    let lambda = retention(0.5, 20.0);
    let mut wide = Forgetting::new([NOISE; 4]);
    let mut narrow = Forgetting::new([NOISE as f32; 4]);
    let mut worst: f64 = 0.0;
    for n in 0..20_000 {
        let size = if n < 500 { &ALL } else { [&ALL, &STILL, &PART, &PART][n % 4] };
        // The very same numbers on both sides.
        let short = segment(&mut random, &TRUTH, &size.map(|v| 1000.0 * v)).cast(|v| v as f32);
        let a = wide.take(&short.cast(f64::from), f64::from(lambda as f32));
        assert_eq!(a, narrow.take(&short, lambda as f32));
        if recentred && n == 10 {
            narrow.recentre(&narrow.factor().solve().estimate);
        }
        if n % 100 == 99 {
            let (x, y) = (wide.factor().solve(), narrow.memory.solve());
            for j in 0..4 {
                let estimate = f64::from(y.estimate[j]) + f64::from(narrow.reference[j]);
                worst = worst.max((x.estimate[j] - estimate).abs() / x.standard_deviation[j]);
            }
        }
    }
    worst
}

#[test]
fn single_precision_follows_double_about_a_reference() {
    // What f32 is asked to hold is 0.05 sd. Without the reference the same run drifts.
    let (with, without) = (single_against_double(true), single_against_double(false));
    assert!(with < 0.05 && without > 5.0 * with, "{with} {without}");
}

#[test]
fn another_reference_changes_nothing() {
    let mut random = Random(37);
    let lambda = retention(0.5, 20.0);
    let mut one = Forgetting::new([NOISE; 4]);
    let mut other = one;
    for n in 0..300 {
        let s = segment(&mut random, &TRUTH, [&ALL, &PART, &STILL][n % 3]);
        one.take(&s, lambda);
        other.take(&s, lambda);
        other.recentre(&core::array::from_fn(|_| random.normal()));
    }
    let (a, b) = (one.factor(), other.factor());
    for (x, y) in a.entries().zip(b.entries()) {
        assert!((x - y).abs() < 1e-9 * a.r()[0][0]);
    }
    let before = other;
    other.recentre(&[f64::NAN; 4]);
    assert_eq!(other, before);
}

#[test]
fn whatever_the_segment_the_memory_stays_finite() {
    let mut random = Random(23);
    let mut forgetting = Forgetting::new([NOISE as f32, 0.0, 1e-20, 1e20]);
    for _ in 0..5000 {
        let size: [f64; 4] = core::array::from_fn(|_| 10_f64.powf(30.0 * random.uniform() - 25.0));
        let s = segment(&mut random, &TRUTH, &size).cast(|v| v as f32);
        forgetting.take(&s, random.uniform() as f32);
        assert!(forgetting.factor().is_finite());
    }
    let before = forgetting.factor();
    assert_eq!(forgetting.take(&InformationFactor::new(), 0.5), 0);
    assert_eq!(forgetting.take(&before, f32::NAN), 0);
    assert_eq!(forgetting.factor(), before);
}

#[test]
fn a_window_is_the_factor_of_its_last_segments() {
    let mut random = Random(29);
    let segments: Vec<_> = (0..20).map(|_| segment(&mut random, &TRUTH, &ALL)).collect();
    let mut window = Window::<f64, 4, 6>::new();
    for (n, s) in segments.iter().enumerate() {
        window.take(s);
        let mut whole = InformationFactor::new();
        for s in &segments[(n + 1).saturating_sub(6)..=n] {
            whole.merge(s);
        }
        assert_eq!(window.factor(), whole);
    }
}
