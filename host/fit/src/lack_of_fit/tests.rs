use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::metric::{Metric, drift};
use super::noise::{PowerLaw, ROUNDING, basis};
use super::score::Common;
use super::*;
use crate::study_length::runs;
use crate::{Filter, SampleCounts};

struct Normal(ChaCha8Rng);

impl Normal {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    fn draw(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }
}

const SIGMA: [f64; 2] = [0.5, 0.1];
const RATE_HZ: f64 = 100.0;
/// Two parameters of a body, the second of them turning, and the offset of each channel.
const N: usize = 4;
const ROLES: [Role; N] = [Role::Body, Role::Turning, Role::Offset, Role::Offset];
const PHI: [f64; N] = [3.0, 0.4, 1.0, -0.2];

/// Rows that represent themselves, with a filter's width.
struct Blocks {
    filter: Filter,
    counts: SampleCounts,
    part: Range<usize>,
    rows: Vec<[f64; 2 * N]>,
    measured: Vec<[f64; 2]>,
}

/// Rows of a body at some time.
fn rows_at(time_s: f64) -> [f64; 2 * N] {
    let wave = |f: f64| (std::f64::consts::TAU * f * time_s).sin();
    let (push, turn) =
        (5.0 + 7.0 * wave(0.3) + 3.0 * wave(1.1) + wave(2.2), 3.0 * wave(0.45) + 2.0 * wave(1.3));
    [push, 0.3 * turn, 1.0, 0.0, 0.1 * wave(0.7), turn, 0.0, 1.0]
}

impl Blocks {
    /// Returns rows with white noise and what `add` makes of each time, for each channel.
    fn new(count: usize, seed: u64, add: impl Fn(f64, &[f64; 2 * N]) -> [f64; 2]) -> Self {
        let mut normal = Normal::new(seed);
        let (mut rows, mut measured) = (Vec::new(), Vec::new());
        for k in 0..count {
            let time_s = k as f64 / RATE_HZ;
            let own = rows_at(time_s);
            let more = add(time_s, &own);
            measured.push(std::array::from_fn(|c| {
                let exact: f64 = own[c * N..(c + 1) * N].iter().zip(PHI).map(|(a, phi)| a * phi).sum();
                exact + more[c] + SIGMA[c] * normal.draw()
            }));
            rows.push(own);
        }
        let filter = Filter {
            rate_hz: RATE_HZ,
            width_s: 0.1,
            every: 1,
            noise_gain: 1.0,
            derivative_noise_gain: 0.0,
            response: vec![1.0],
            derivative: vec![0.0],
        };
        Self { filter, counts: SampleCounts::default(), part: 0..count, rows, measured }
    }

    fn still(mut self) -> Self {
        self.filter = Filter::default();
        self
    }

    fn rows<'a>(&'a self, whitening: &'a Whitening, weights: &'a Weights) -> Rows<'a> {
        Rows {
            blocks: self,
            values: &PHI,
            roles: &ROLES,
            whitening,
            noise: None,
            weights,
            has_drives: false,
            is_suspect: true,
        }
    }

    fn look(&self) -> LackOfFit {
        let weights = Weights::none(2);
        let whitening = Whitening::diagonal(&SIGMA.map(|s| 1.0 / s));
        look(&self.rows(&whitening, &weights))
    }
}

impl RowBlocks for Blocks {
    fn filter(&self) -> &Filter {
        &self.filter
    }

    fn counts(&self) -> &SampleCounts {
        &self.counts
    }

    fn parts(&self) -> &[Range<usize>] {
        std::slice::from_ref(&self.part)
    }

    fn time_s(&self, block: usize) -> f64 {
        if self.filter.rate_hz > 0.0 { block as f64 / RATE_HZ } else { 0.0 }
    }

    fn write(&self, block: usize, rows: &mut [f64], measured: &mut [f64]) {
        rows.copy_from_slice(&self.rows[block]);
        measured.copy_from_slice(&self.measured[block]);
    }
}

/// 0.1 kg beside 0.5 N at some 7 m/s² in rows of 100 Hz: a row of the step is 1.4 standard deviations. The
/// filter's centre is half a width and half a row before the row that shows it. Every other load cell drifts
/// by 4 N meanwhile.
#[test]
fn a_step_of_the_body_is_found_with_its_time_and_size() {
    for seed in 0..10 {
        let at_s = 7.0 + 0.61 * seed as f64;
        let drift = |t: f64| if seed % 2 == 1 { 2.0 * (0.1 * t - 1.0) } else { 0.0 };
        let step = |t: f64, row: f64| if t < at_s { 0.0 } else { -0.1 * row };
        let blocks = Blocks::new(2000, seed, |t, row| [drift(t) + step(t, row[0]), 0.0]);
        let found = blocks.look();
        let change = found.change.as_ref().expect("a change");
        assert_eq!((change.changed, found.not_rigid.as_ref()), (Changed::Body, None));
        let late = change.time_s + 0.5 * (0.1 + 1.0 / RATE_HZ) - at_s;
        assert!(late.abs() < 2.0 * change.time_u95_s && late.abs() < 0.2, "{late} {}", change.time_u95_s);
        let step = change.steps.iter().find(|s| s.column == 0).unwrap();
        assert!((step.value + 0.1).abs() < 4.0 * step.deviation && step.deviation < 0.01, "{step:?}");
        assert!(found.contradicts() && (found.shift(0) - step.value.abs()).abs() < 1e-15);
    }
}

#[test]
fn a_step_of_an_offset_is_none_of_the_body() {
    for seed in 0..10 {
        let blocks = Blocks::new(2000, seed, |t, _| if t < 11.0 { [0.0; 2] } else { [1.0, 0.0] });
        let found = blocks.look();
        let Some(change) = &found.change else { panic!("{found:?}") };
        assert_eq!(change.changed, Changed::Offset);
        assert!(change.steps.iter().all(|s| ROLES[s.column] == Role::Offset));
    }
}

/// The probability that is reported is an upper bound: of recordings of noise, white or wandering, at most 5
/// % and four standard errors have one below 5 %. And no empty one: some have one below 90 %.
#[test]
fn the_probability_of_a_step_by_chance_is_no_smaller_than_it_is() {
    let count = runs(400, 60);
    for wanders in [false, true] {
        let (mut below, mut some) = (0, 0);
        for seed in 0..count {
            let mut normal = Normal::new(5000 + seed);
            let size = if wanders { 0.03 } else { 0.0 };
            let wander: Vec<f64> =
                std::iter::successors(Some(0.0), |x| Some(0.99 * x + size * normal.draw()))
                    .take(1000)
                    .collect();
            let blocks = Blocks::new(1000, seed, |t, _| [wander[(t * RATE_HZ).round() as usize], 0.0]);
            let weights = Weights::none(2);
            let whitening = Whitening::diagonal(&SIGMA.map(|s| 1.0 / s));
            let bins = Bins::new(&blocks.rows(&whitening, &weights));
            let chance =
                change::Search { bins: &bins, columns: &[2, 3, 0, 1], friction: 0, offsets: 2, bin_s: 0.1 }
                    .chance()
                    .unwrap();
            below += u32::from(chance < 0.05);
            some += usize::from(chance < 0.9);
        }
        let all = count as f64;
        assert!(f64::from(below) <= all * 0.05 + 4.0 * (all * 0.05 * 0.95).sqrt(), "{wanders} {below}");
        assert!(some > 0, "{wanders}");
    }
}

/// Rounding is no noise, and columns of which there are none explain nothing.
#[test]
fn computed_rows_are_not_accused_and_nothing_is_found_by_no_columns() {
    let mut blocks = Blocks::new(2000, 1, |_, _| [0.0; 2]);
    for (row, measured) in blocks.rows.iter().zip(&mut blocks.measured) {
        let exact = |c: usize| row[c * N..(c + 1) * N].iter().zip(PHI).map(|(a, phi)| a * phi).sum::<f64>();
        *measured = std::array::from_fn(|c| exact(c) * (1.0 + 1e-7 * row[0]));
    }
    assert_eq!(blocks.look(), LackOfFit::default());
    // A body that does not turn has no angles for a spring to follow.
    let mut still = Blocks::new(2000, 1, |t, _| [if t < 9.0 { 0.0 } else { 5.0 }, 0.0]);
    for row in &mut still.rows {
        (row[1], row[5]) = (0.0, 0.0);
    }
    let found = still.look();
    assert!(found.not_rigid.is_none() && found.change.is_some(), "{found:?}");
}

/// White noise, and noise that wanders: a line, a curve, exponentially correlated noise of the size of the
/// white noise in a bin.
#[test]
fn an_honest_recording_shows_no_change() {
    for seed in 0..40 {
        let mut normal = Normal::new(1000 + seed);
        let wander: Vec<f64> =
            std::iter::successors(Some(0.0), |x| Some(0.995 * x + 0.01 * normal.draw())).take(2000).collect();
        let blocks = Blocks::new(2000, seed, |t, _| match seed % 3 {
            0 => [0.0; 2],
            1 => [0.05 * t + 0.01 * t * t, 0.02 * t],
            _ => [wander[(t * RATE_HZ).round() as usize], 0.0],
        });
        assert_eq!(blocks.look(), LackOfFit::default(), "{seed}");
    }
}

/// A rest of 10 s in which what pushes is gravity with noise of some 10 Hz, of which differences of samples
/// show next to nothing; the noise is in the rows all the time, and not in what is measured. With `lost` 300
/// g go 10 s after the rest.
fn after_a_rest(seed: u64, lost: bool) -> Blocks {
    let mut normal = Normal::new(700 + seed);
    let mut smooth = [0.0; 2];
    let noise = std::iter::repeat_with(|| {
        smooth[0] += 0.6 * (normal.draw() - smooth[0]);
        smooth[1] += 0.6 * (smooth[0] - smooth[1]);
        0.5 * smooth[1]
    });
    let noise: Vec<f64> = noise.take(3000).collect();
    let rests = |t: f64| t < 10.0;
    let mut blocks = Blocks::new(3000, seed, |t, own| {
        let push = if rests(t) { 5.0 - own[0] } else { 0.0 };
        let still = if rests(t) { [own[1], own[4], own[5]] } else { [0.0; 3] };
        let less = if lost && t > 20.0 { -0.3 } else { 0.0 };
        [PHI[0] * push - PHI[1] * still[0] + less * own[0], -PHI[0] * still[1] - PHI[1] * still[2]]
    });
    for (k, (row, noise)) in blocks.rows.iter_mut().zip(&noise).enumerate() {
        if rests(k as f64 / RATE_HZ) {
            (row[0], row[1], row[4], row[5]) = (5.0, 0.0, 0.0, 0.0);
        }
        row[0] += noise;
    }
    blocks
}

#[test]
fn noise_in_a_rest_is_no_change_and_a_loss_after_it_is_one() {
    for seed in 0..12 {
        let honest = after_a_rest(seed, false).look();
        assert!(honest.change.is_none() && honest.not_rigid.is_none(), "{seed}: {honest:?}");
        let change = after_a_rest(seed, true).look().change.unwrap();
        assert!((change.time_s - 20.0).abs() < 1.5, "{seed}: {change:?}");
    }
}

/// A part that swings at 6.4 Hz, which motion below 2.3 Hz and noise of 5 to 9 Hz in the rows set in motion.
fn with_noise_above_the_motion(seed: u64, part: f64) -> Blocks {
    let mut normal = Normal::new(4000 + seed);
    // Noise of a narrow band: two cosines of slowly changing size for each column that moves.
    let band = |normal: &mut Normal| -> Vec<f64> {
        let waves: Vec<[f64; 3]> =
            (0..40).map(|k| [5.0 + 0.1 * f64::from(k), normal.draw(), normal.draw()]).collect();
        let at = |k: usize| {
            let of = |[hz, a, b]: &[f64; 3]| {
                let (sin, cos) = (std::f64::consts::TAU * hz * k as f64 / RATE_HZ).sin_cos();
                a * sin + b * cos
            };
            waves.iter().map(of).sum::<f64>() / 40.0_f64.sqrt()
        };
        (0..3000).map(at).collect()
    };
    let noise = [band(&mut normal), band(&mut normal)];
    let omega = std::f64::consts::TAU * 6.4;
    // Far below its frequency a part has a wrench more by the second derivative over ω².
    let step = 1e-3;
    let second = |t: f64| (rows_at(t + step)[0] - 2.0 * rows_at(t)[0] + rows_at(t - step)[0]) / (step * step);
    let mut blocks = Blocks::new(3000, seed, |t, _| [-part * PHI[0] * second(t) / (omega * omega), 0.0]);
    for (k, row) in blocks.rows.iter_mut().enumerate() {
        (row[0], row[5]) = (row[0] + 0.3 * noise[0][k], row[5] + 0.3 * noise[1][k]);
    }
    blocks
}

/// Without a rest nothing but the residuals shows that noise.
#[test]
fn noise_above_the_motion_is_no_part_that_swings_and_a_part_is_one() {
    for seed in 0..6 {
        let honest = with_noise_above_the_motion(seed, 0.0).look();
        assert_eq!(honest.not_rigid, None, "{seed}");
        let swings = with_noise_above_the_motion(seed, 1.0).look().not_rigid;
        let is_found = matches!(swings, Some(NotRigid { motion: Motion::Resonance { .. }, .. }));
        assert!(is_found, "{seed}: {swings:?}");
    }
}

/// Of 10 % of the body on a spring of 1.6 Hz, rows through the spring's own differential equation.
#[test]
fn a_part_on_a_spring_is_reported_with_its_frequency() {
    let omega = std::f64::consts::TAU * 1.6;
    let count = 3000;
    let (mut swing, mut extra) = ([0.0_f64; 2], Vec::new());
    let push = |t: f64| 0.1 * PHI[0] * rows_at(t)[0];
    (swing[0], swing[1]) = (-push(0.0) / (omega * omega), 0.0);
    for k in 0..count * 50 {
        let t = f64::from(k) / (50.0 * RATE_HZ);
        let pull = -push(t) - omega * omega * swing[0] - 0.1 * omega * swing[1];
        if k % 50 == 0 {
            extra.push(pull);
        }
        swing[1] += pull / (50.0 * RATE_HZ);
        swing[0] += swing[1] / (50.0 * RATE_HZ);
    }
    let blocks = Blocks::new(count as usize, 5, |t, _| [4.0 * extra[(t * RATE_HZ).round() as usize], 0.0]);
    let found = blocks.look();
    let Some(NotRigid { motion: Motion::Resonance { frequency_hz: [low, high] }, .. }) = found.not_rigid
    else {
        panic!("{found:?}")
    };
    assert!(low > 1.0 && low < 1.7 && high > 1.5 && high < 2.5, "{low} {high}");
    assert!(found.change.is_none() && found.contradicts());
}

/// The angle is the second integral of the turning column, each sine over −ω².
#[test]
fn a_spring_is_distinguished_from_a_resonance() {
    let angle = |t: f64| {
        let of = |size: f64, f: f64| {
            let omega = std::f64::consts::TAU * f;
            -size * (omega * t).sin() / (omega * omega)
        };
        of(3.0, 0.45) + of(2.0, 1.3)
    };
    let blocks = Blocks::new(3000, 6, |t, _| [0.6 * angle(t), 0.5 * angle(t)]);
    let found = blocks.look();
    assert_eq!(found.not_rigid.map(|f| f.motion), Some(Motion::Spring));
}

#[test]
fn bursts_are_reported_and_do_not_contradict() {
    let mut normal = Normal::new(9);
    let noise: Vec<f64> = (0..3000).map(|_| normal.draw()).collect();
    let blocks = Blocks::new(3000, 8, |t, _| {
        let loud = t % 2.0 < 0.3;
        [if loud { 2.0 * noise[(t * RATE_HZ).round() as usize] } else { 0.0 }, 0.0]
    });
    let found = blocks.look();
    let Some(Motion::Bursts { count }) = found.not_rigid.as_ref().map(|f| f.motion) else {
        panic!("{found:?}")
    };
    assert!((14..=17).contains(&count) && !found.contradicts(), "{count}");
}

/// A drift of two standard deviations from the first to the last of 40 poses, and none; and white noise in
/// 200 recordings.
#[test]
fn poses_that_drift_are_reported_and_others_are_not() {
    let drifting = Blocks::new(40, 3, |t, _| [0.0, 0.6 * (t * RATE_HZ / 40.0)]).still().look();
    assert_eq!(drifting.pose_drift.iter().map(|d| d.channel).collect::<Vec<_>>(), [1]);
    assert!(drifting.pose_drift[0].probability < 1e-4 && drifting.pose_drift[0].correlation > 0.5);
    assert!(
        (0..200).all(|seed| Blocks::new(40, 100 + seed, |_, _| [0.0; 2])
            .still()
            .look()
            .pose_drift
            .is_empty())
    );
}

/// F(5, 20) is above 2.711 in 5 % of cases, F(2, 10) above 14.91 in 0.1 % (tables of Fisher and Snedecor).
#[test]
fn tails_are_those_of_the_tables() {
    assert!((tail(5.0 * 2.711, 5, 20.0) - 0.05).abs() < 1e-4);
    assert!((tail(2.0 * 14.91, 2, 10.0) - 0.001).abs() < 1e-5);
    // F(2, ν) in closed form, far out: (1 + 2 F/ν)^(−ν/2).
    assert!((tail(2.0 * 80.0, 2, 100.0) / 2.6_f64.powi(-50) - 1.0).abs() < 1e-9);
    assert_eq!((tail(3.0, 0, 10.0), tail(0.0, 3, 10.0)), (1.0, 1.0));
}

/// Against the covariance written out, b by c.
#[test]
fn the_inverse_of_the_covariance_is_that_of_the_noise() {
    let noise = PowerLaw { white: 1.0, flicker: 3.0, walk: 20.0 };
    let count = 60;
    let octaves: Vec<f64> = (0..=8).map(|k| (-1.0 / 2f64.powi(k)).exp()).collect();
    let covariance = DMatrix::from_fn(count, count, |b, c| {
        let lag = b.abs_diff(c) as i32;
        let flicker = octaves.iter().map(|rho| rho.powi(lag)).sum::<f64>() / octaves.len() as f64;
        f64::from(u8::from(b == c)) + 3.0 * flicker + 20.0 * (-f64::from(lag) / 240.0).exp()
    });
    let product = covariance * noise.inverse(count);
    assert!((product - DMatrix::identity(count, count)).abs().max() < 1e-9);
}

/// The mean over 60 drawings of what is found, a line projected out; slow noise is taken as larger than
/// found.
#[test]
fn white_and_slow_noise_are_distinguished() {
    let count = 200;
    let (mut white, mut walk) = ([0.0; 2], 0.0);
    let line = basis(&drift(count), ROUNDING);
    for seed in 0..60 {
        let mut normal = Normal::new(seed);
        let own: Vec<f64> = (0..count).map(|_| normal.draw()).collect();
        let rho = f64::exp(-1.0 / (4.0 * count as f64));
        let step = (10.0 * (1.0 - rho * rho)).sqrt();
        let mut wander = 10f64.sqrt() * normal.draw();
        let slow: Vec<f64> = own
            .iter()
            .map(|w| {
                wander = rho * wander + step * normal.draw();
                w + wander
            })
            .collect();
        let alone = PowerLaw::of(&DVector::from_vec(own), &line);
        let both = PowerLaw::of(&DVector::from_vec(slow), &line);
        white[0] += alone.white / 60.0;
        white[1] += both.white / 60.0;
        walk += (both.walk + both.flicker) / 60.0;
        assert!(alone.walk + alone.flicker < 1.5, "{alone:?}");
    }
    assert!((white[0] - 0.97).abs() < 0.05 && (white[1] - 1.0).abs() < 0.15, "{white:?}");
    assert!(walk > 8.0 && walk < 40.0, "{walk}");
}

/// The decrease of χ² by a step is that of the residual sums of squares of two dense fits, noise of any
/// covariance.
#[test]
fn a_score_is_the_difference_of_two_fits() {
    let blocks = Blocks::new(600, 2, |t, _| [0.1 * t, 0.0]);
    let weights = Weights::none(2);
    let whitening = Whitening::diagonal(&SIGMA.map(|s| 1.0 / s));
    let rows = blocks.rows(&whitening, &weights);
    let bins = Bins::new(&rows);
    let count = bins.len();
    let noise = [PowerLaw { white: 1.0, flicker: 0.5, walk: 2.0 }, PowerLaw::white(0.7)];
    let metrics: Vec<Metric> = noise.iter().map(|n| Metric::new(n, count)).collect();
    let steps = [2, 3, 0, 1];
    let common = Common::new(&bins, &metrics, &steps);
    let drift = drift(count);
    // Columns of both channels one above the other, whitened by the root of the inverse.
    let dense = |bin: Option<usize>| {
        let wide = N + 4 + if bin.is_some() { N } else { 0 };
        let mut sum = 0.0;
        let (mut all, mut right) = (DMatrix::zeros(2 * count, wide), DVector::zeros(2 * count));
        for c in 0..2 {
            let inverse =
                if c == 0 { noise[0].inverse(count) } else { DMatrix::identity(count, count) / 0.7 };
            let root = nalgebra::Cholesky::new(inverse).unwrap().l().transpose();
            let own = DMatrix::from_fn(count, wide, |b, j| match j {
                0..N => bins.rows[c][(b, j)],
                _ if j < N + 4 => {
                    if (j - N) / 2 == c {
                        drift[(b, (j - N) % 2)]
                    } else {
                        0.0
                    }
                }
                _ => bins.rows[c][(b, j - N - 4)] * f64::from(u8::from(b >= bin.unwrap())),
            });
            all.rows_mut(c * count, count).copy_from(&(&root * own));
            right.rows_mut(c * count, count).copy_from(&(root * &bins.residuals[c]));
        }
        let svd = all.clone().svd(true, true);
        let solution = svd.solve(&right, 1e-10).unwrap();
        sum += (right - all * solution).norm_squared();
        sum
    };
    for bin in [15, 30, 52] {
        let score = common.at(bin).unwrap();
        let [(offsets, two), (both, four)] = common.explained(&score, [&[0, 1], &[2, 3]]);
        assert_eq!((two, four), (2, 4));
        let expected = dense(None) - dense(Some(bin));
        assert!((both - expected).abs() < 1e-6 * expected, "{both} {expected}");
        assert!(offsets <= both);
    }
}

/// Noise of each body column in its own channel, per row.
const NOISE: [f64; 2] = [0.6, 0.5];

/// Series of noise in the rows.
struct Noise {
    /// σ of the rows with what the noise leaves in them.
    sigma: [f64; 2],
}

impl NoiseRows for Noise {
    fn series(&self) -> usize {
        2
    }

    fn weight(&self, _: usize) -> f64 {
        0.5
    }

    fn doubt(&self) -> f64 {
        0.0
    }

    fn each(&self, series: usize, visit: &mut dyn FnMut(f64, &[f64])) {
        let mut normal = Normal::new(1000 + series as u64);
        for k in 0..2000 {
            let mut rows = [0.0; 2 * (N + 1)];
            rows[0] = NOISE[0] * normal.draw() / self.sigma[0];
            rows[N + 2] = NOISE[1] * normal.draw() / self.sigma[1];
            visit(k as f64 / RATE_HZ, &rows);
        }
    }
}

/// Ten seconds of rest, then motion, both with noise in the rows. What is expected of a step at the end of
/// the rest is taken off: two more columns explain two on average; without that, far more. The fit is the
/// truth, or off by what noise draws.
#[test]
fn rest_before_motion_is_no_change_where_noise_is_in_the_rows() {
    let sigma: [f64; 2] = std::array::from_fn(|c| SIGMA[c].hypot(NOISE[c] * PHI[c]));
    let whitening = Whitening::diagonal(&sigma.map(|s| 1.0 / s));
    let (runs, noise) = (runs(60, 15), Noise { sigma });
    for off in [0.0, 0.05] {
        let mut mean = [0.0; 2];
        for seed in 0..runs {
            let mut blocks = Blocks::new(2000, 500 + seed, |t, row| {
                let still = if t < 10.0 { -1.0 } else { 0.0 };
                [
                    still * (row[0] - 5.0) * PHI[0] + still * row[1] * PHI[1],
                    still * (row[4] * PHI[0] + row[5] * PHI[1]),
                ]
            });
            let mut normal = Normal::new(9000 + seed);
            for (k, rows) in blocks.rows.iter_mut().enumerate() {
                if k < 1000 {
                    (rows[0], rows[1], rows[4], rows[5]) = (5.0, 0.0, 0.0, 0.0);
                }
                rows[0] += NOISE[0] * normal.draw();
                rows[5] += NOISE[1] * normal.draw();
            }
            let weights = Weights::none(2);
            let values = [PHI[0] * (1.0 - off), PHI[1] * (1.0 - off), PHI[2], PHI[3]];
            for (with, mean) in mean.iter_mut().enumerate() {
                let of_signals = (with == 1).then_some(&noise as &dyn NoiseRows);
                let rows = Rows { noise: of_signals, values: &values, ..blocks.rows(&whitening, &weights) };
                let bins = Bins::new(&rows);
                let metrics =
                    [PowerLaw::white(1.0), PowerLaw::white(1.0)].map(|n| Metric::new(&n, bins.len()));
                let common = Common::new(&bins, &metrics, &[2, 3, 0, 1]);
                let score = common.at(100).unwrap();
                let [(offsets, _), (both, four)] = common.explained(&score, [&[0, 1], &[2, 3]]);
                assert_eq!(four, 4);
                *mean += (both - offsets) / runs as f64;
                if with == 1 {
                    assert_eq!(look(&rows).change, None, "{seed}");
                }
            }
        }
        // The mean of numbers of 2 ± 2; four standard deviations.
        assert!((mean[1] - 2.0).abs() < 4.0 * 2.0 / f64::from(runs as u32).sqrt(), "{mean:?}");
        assert!(mean[0] > 10.0, "{mean:?}");
    }
}
