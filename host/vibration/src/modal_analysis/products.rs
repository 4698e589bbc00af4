//! Products of modes: vibrations that motion of the second order adds to a decay.
//!
//! Turns, and springs that change their direction, are of the second order in the amplitude: beside the
//! modes there are vibrations at twice each frequency, and at sums and differences of two, which decay by
//! the sum of both rates. A weak mode near one of them, of which it may be the resonance, is not measured
//! alone. So where some are seen, all are held: their poles are those of the modes, their amplitudes are
//! free.

use super::decay_fit::Fit;
use super::roles::Role;
use super::search::{chosen, quantile};
use super::triangle::{Held, Pole, Samples};

/// Chance that noise gives one product of a recording.
const FALSE_ALARM: f64 = 1e-4;
/// Products that must be seen: one alone may be a mode of its own.
const SEEN: usize = 2;
/// Strength by that of the strongest mode, below which a mode's products are too small to be seen.
const LEAST: f64 = 1e-3;
/// Samples for each column, at least.
const SAMPLES_A_COLUMN: usize = 4;
/// Turn over the recording, rad, of the pole of an offset that decays.
const SLOW: f64 = 0.2;
/// Products near a mode are its resonance, and larger than others by this.
const WIDER: f64 = 10.0;
/// Size of an amplitude by noise that is none.
const NOTHING: f64 = 1e-6;
/// Relative difference of frequencies of one mode from round to round.
const SAME: f64 = 0.01;
/// Rounds in which modes and products are searched.
const ROUNDS: usize = 2;

/// A product, with the places of its modes; none of an offset that decays, which all have.
type Product = (Pole, Option<[usize; 2]>);

/// Returns poles of the modes, and samples that hold their products; `None` where no product is seen.
pub(super) fn with_products(
    samples: &Samples,
    (poles, roles): (&[Pole], &[Role]),
    strengths: &[f64],
    most: usize,
) -> Option<(Vec<Pole>, Samples)> {
    let strongest = strengths.iter().copied().fold(0.0, f64::max);
    let is_mode = |r: usize| matches!(roles[r], Role::Mode | Role::TooClose(_));
    let is_kept = |r: usize| is_mode(r) || matches!(roles[r], Role::TooShort | Role::Disturbance);
    let kept: Vec<usize> = (0..poles.len()).filter(|r| is_kept(*r)).collect();
    let strong: Vec<Pole> = kept
        .iter()
        .filter(|r| is_mode(**r) && strengths[**r] > LEAST * strongest)
        .map(|r| poles[*r])
        .collect();
    let mut found: Vec<Pole> = kept.into_iter().map(|r| poles[r]).collect();
    let mut holding = samples.clone();
    for round in 0..ROUNDS {
        let is_strong =
            |r: &usize| strong.iter().any(|own| (own.angular - found[*r].angular).abs() < SAME * own.angular);
        let modes: Vec<usize> = (0..found.len()).filter(is_strong).collect();
        let products = products(&found, &modes, samples);
        let columns = 1 + 4 * found.len() + 2 * products.len();
        if modes.is_empty() || samples.y.nrows() < SAMPLES_A_COLUMN * columns {
            return None;
        }
        let held = |weights: &[f64]| {
            products
                .iter()
                .zip(weights)
                .map(|((pole, _), weight)| Held { pole: *pole, weight: *weight })
                .collect()
        };
        let free = Fit::refined(&samples.holding(held(&vec![0.0; products.len()])), found.clone(), 25)?;
        if round == 0 && seen(&free, products.len()) < SEEN {
            return None;
        }
        holding = samples.holding(held(&weights(&free, &products, &modes)));
        found = chosen(&holding, free.poles, most)?.poles;
    }
    Some((found, holding))
}

/// Returns the products of modes, those that a recording shows.
fn products(poles: &[Pole], modes: &[usize], samples: &Samples) -> Vec<Product> {
    let (mut all, mut offsets) = (Vec::new(), Vec::new());
    for (place, i) in modes.iter().enumerate() {
        for j in &modes[place..] {
            let (a, b) = (poles[*i], poles[*j]);
            let decay = a.decay + b.decay;
            all.push((Pole { decay, angular: a.angular + b.angular }, Some([*i, *j])));
            match i == j {
                true => offsets.push(decay),
                false => all.push((Pole { decay, angular: (a.angular - b.angular).abs() }, Some([*i, *j]))),
            }
        }
    }
    all.retain(|(pole, _)| pole.hz() < 0.45 * samples.rate_hz);
    // The difference of none is an offset that decays, by several rates: `e^{−αt}` and nearly `t e^{−αt}`.
    let decay = offsets.iter().sum::<f64>() / offsets.len().max(1) as f64;
    all.push((Pole { decay, angular: SLOW / samples.duration_s() }, None));
    all
}

/// Returns the inverse of the size of each product's amplitudes by noise: some times that of two modes'
/// product, by the factor that all products have on average.
///
/// With amplitudes of the size `s a` by noise, `χ²` of a product ([`Fit::strength`]) is `2 C + C s² a² tr
/// V⁻¹` on average, V being their covariance at unit noise.
fn weights(fit: &Fit, products: &[Product], modes: &[usize]) -> Vec<f64> {
    let level = levels(fit);
    let channels = fit.sigma.len() as f64;
    let square = |r: usize| -> f64 {
        let of = |c: usize| fit.amplitudes.view((1 + 2 * r, c), (2, 1)).norm_squared() / level[c];
        (0..fit.sigma.len()).map(of).sum()
    };
    let all: f64 = modes.iter().map(|r| square(*r)).sum();
    let size = |product: &Product| product.1.map_or(all, |[i, j]| (square(i) * square(j)).sqrt());
    let (mut excess, mut by) = (0.0, 0.0);
    for (k, product) in products.iter().enumerate() {
        let place = fit.poles.len() + k;
        excess += fit.strength(place, &level) - 2.0 * channels;
        by += channels * size(product).powi(2) * fit.information(place);
    }
    let factor = (excess / by.max(f64::MIN_POSITIVE)).max(0.0).sqrt();
    products.iter().map(|product| 1.0 / (WIDER * factor * size(product)).max(NOTHING)).collect()
}

/// Returns how many held poles stand out of noise.
fn seen(fit: &Fit, held: usize) -> usize {
    let limit = 1.15 * quantile(2.0 * fit.sigma.len() as f64, FALSE_ALARM / held.max(1) as f64);
    let (level, first) = (levels(fit), fit.poles.len());
    (first..first + held).filter(|place| fit.strength(*place, &level) > limit).count()
}

fn levels(fit: &Fit) -> Vec<f64> {
    fit.above_rounding(&fit.sigma.iter().map(|sigma| sigma * sigma).collect::<Vec<f64>>())
}
