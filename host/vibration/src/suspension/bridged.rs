//! Gaps in time bridged by the modes of the rest of the recording, so that what swings strongest before a gap
//! counts.
//!
//! Missing samples are what the modes of the longest stretch say, then what those of the whole say
//! (expectation and maximisation, A. P. Dempster et al. 1977). They are few, so that what they add to the
//! information does not count. Where the parts are of two swings, one decay does not fit both, noise is found
//! larger, and the longest stretch is retained alone.

use std::ops::Range;

use nalgebra::{Complex, DMatrix};

use crate::modal_analysis::{ModalError, Modes};

/// The largest share of all samples that may be missing.
const MISSING: f64 = 0.05;
/// A sample may be off its place by this share of a period.
const OFF_GRID: f64 = 0.2;
/// Rounds in which what is filled in comes from the whole.
const ROUNDS: usize = 2;
/// Noise of the whole by that of the longest stretch from which on they are not one swing.
const LOUDER: f64 = 1.5;

/// Returns the place of each row on a grid of this rate; `None` if rows are off it, or too many are missing.
fn places(time_ns: &[u64], rate_hz: f64) -> Option<Vec<usize>> {
    let first = *time_ns.first()?;
    let mut all = Vec::with_capacity(time_ns.len());
    for time in time_ns {
        let at = time.checked_sub(first)? as f64 * 1e-9 * rate_hz;
        let place = at.round();
        if (at - place).abs() > OFF_GRID {
            return None;
        }
        all.push(place as usize);
    }
    let rising = all.windows(2).all(|pair| pair[0] < pair[1]);
    let length = *all.last()? + 1;
    (rising && (length - all.len()) as f64 <= MISSING * length as f64).then_some(all)
}

/// Returns all samples of a decay with those that are missing filled in, and their modes; `None` if they are
/// not of one decay.
///
/// `rows` are the samples at `time_ns`; `found` are the modes of those in `stretch`, as `identify` finds
/// them.
pub(super) fn bridged(
    (rows, time_ns, rate_hz): (&DMatrix<f64>, &[u64], f64),
    (stretch, found): (Range<usize>, &Modes),
    identify: impl Fn(&DMatrix<f64>) -> Result<Modes, ModalError>,
) -> Option<(DMatrix<f64>, Modes)> {
    let places = places(time_ns, rate_hz)?;
    let (length, channels) = (*places.last()? + 1, rows.ncols());
    let mut all = DMatrix::zeros(length, channels);
    let mut is_there = vec![false; length];
    for (row, place) in places.iter().enumerate() {
        all.row_mut(*place).copy_from(&rows.row(row));
        is_there[*place] = true;
    }
    let inside = *places.get(stretch.start)?..*places.get(stretch.end.checked_sub(1)?)? + 1;
    let mut modes = found.clone();
    let mut origin = inside.start;
    let mut over = inside;
    for _ in 0..ROUNDS {
        for c in 0..channels {
            let at = |place: usize| swing(&modes, c, (place as f64 - origin as f64) / rate_hz);
            let count = over.clone().filter(|place| is_there[*place]).count().max(1);
            let offset: f64 =
                over.clone().filter(|place| is_there[*place]).map(|p| all[(p, c)] - at(p)).sum();
            let offset = offset / count as f64;
            for place in (0..length).filter(|place| !is_there[*place]) {
                all[(place, c)] = offset + at(place);
            }
        }
        modes = identify(&all).ok()?;
        (origin, over) = (0, 0..length);
    }
    let louder = modes.noise.iter().zip(&found.noise).any(|(all, part)| *all > LOUDER * part);
    (!louder).then_some((all, modes))
}

/// Returns what the modes do in a channel at a time after their beginning.
fn swing(modes: &Modes, channel: usize, time_s: f64) -> f64 {
    let own = &modes.amplitudes;
    let of = |r: usize| {
        let (omega, zeta) = (own.angular[r], own.damping[r]);
        let pole = Complex::new(-zeta * omega, omega * (1.0 - zeta * zeta).max(0.0).sqrt());
        (own.complex[(channel, r)] * (pole * time_s).exp()).re
    };
    (0..own.angular.len()).map(of).sum()
}

#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution as _, StandardNormal};

    use super::*;
    use crate::modal_analysis::{FreeDecay, Options, identify};

    const RATE_HZ: f64 = 100.0;

    /// Two modes in two channels: frequency, decay rate, shape, phase.
    const MODES: [(f64, f64, [f64; 2], f64); 2] =
        [(1.3, 0.10, [1.0, 0.4], 0.3), (2.9, 0.15, [-0.5, 1.0], 1.1)];

    /// Returns rows at the times of a recording, of which some are missing, and struck anew at a time.
    fn rows(missing: Range<usize>, struck_s: Option<f64>) -> (DMatrix<f64>, Vec<u64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let kept: Vec<usize> = (0..4000).filter(|k| !missing.contains(k)).collect();
        let at = |k: usize, c: usize| -> f64 {
            let t = k as f64 / RATE_HZ;
            let of = |(hz, decay, shape, phase): &(f64, f64, [f64; 2], f64)| {
                let (t, size) = match struck_s.filter(|struck| t >= *struck) {
                    Some(struck) => (t - struck, 0.7),
                    None => (t, 1.0),
                };
                size * shape[c] * (-decay * t).exp() * (std::f64::consts::TAU * hz * t + phase).cos()
            };
            MODES.iter().map(of).sum()
        };
        let mut values = DMatrix::zeros(kept.len(), 2);
        for (row, k) in kept.iter().enumerate() {
            for c in 0..2 {
                let noise: f64 = StandardNormal.sample(&mut rng);
                values[(row, c)] = 0.2 + at(*k, c) + 0.01 * noise;
            }
        }
        (values, kept.iter().map(|k| (*k as f64 / RATE_HZ * 1e9).round() as u64).collect())
    }

    fn found(values: &DMatrix<f64>) -> Result<Modes, ModalError> {
        let options = Options { modes: Some(2), ..Options::default() };
        identify(&FreeDecay { rate_hz: RATE_HZ, samples: values, names: &["a", "b"] }, &options)
    }

    #[test]
    fn a_swing_before_a_gap_counts_and_another_swing_does_not() {
        let (values, time_ns) = rows(800..820, None);
        let stretch = 800..values.nrows();
        let late = found(&values.rows(800, values.nrows() - 800).into_owned()).unwrap();
        let (filled, modes) =
            bridged((&values, &time_ns, RATE_HZ), (stretch, &late), found).expect("one decay");
        assert_eq!(filled.nrows(), 4000);
        for (r, (hz, decay, ..)) in MODES.iter().enumerate() {
            let (own, before) = (&modes.shapes.modes[r], &late.shapes.modes[r]);
            let natural = (std::f64::consts::TAU * hz).hypot(*decay);
            assert!((own.angular - natural).abs() < 3.0 * own.angular_sd, "{own:?} {natural}");
            assert!(own.angular_sd < 0.6 * before.angular_sd, "{own:?} {before:?}");
        }
        let (values, time_ns) = rows(800..820, Some(8.1));
        let late = found(&values.rows(800, values.nrows() - 800).into_owned()).unwrap();
        assert!(bridged((&values, &time_ns, RATE_HZ), (800..values.nrows(), &late), found).is_none());
        let (values, time_ns) = rows(800..1200, None);
        assert!(bridged((&values, &time_ns, RATE_HZ), (800..values.nrows(), &late), found).is_none());
    }
}
