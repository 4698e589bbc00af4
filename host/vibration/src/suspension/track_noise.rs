//! White noise of tracked coordinates, and tracks with more of it.
//!
//! Markers move position and attitude of a body together, and the attitude of a joint with that of the base:
//! noise has a covariance. It is that of tenth differences, which motion below the cut-off hardly enters.
//! Attitudes are turned in the axes of what they are measured against, so that the covariance stays the same
//! while links swing.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, Quaternion, SymmetricEigen, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::track::{GAP, Track};
use rigident_rows::moved::Part;
use rigident_rows::white_noise::{Signs, TENTH};

/// Samples between those of a difference are so far apart that there are this many to a period of the
/// cut-off.
const PER_PERIOD: f64 = 12.0;
/// Share of the differences that counts: a marker that jumps is not noise.
const COUNTED: f64 = 0.95;

/// Noise of the coordinates of a track.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TrackNoise {
    /// 1 σ per sample and axis, root mean square: of the platform's place; where that has none, of its
    /// attitude.
    pub(super) sigma: f64,
    /// m or rad.
    pub(super) unit: &'static str,
    /// Times independent numbers of variance `sigma²` is noise of the coordinates, D × D.
    shape: DMatrix<f64>,
}

/// Returns the change of coordinates by a change of their numbers: shifts, and turns in the axes of what is
/// turned against.
fn change(parts: &[Part], numbers: &[f64], by: &[f64]) -> Vec<f64> {
    let (mut at, mut out) = (0, Vec::with_capacity(by.len()));
    for part in parts {
        let (own, by) = (&numbers[at..at + part.numbers()], &by[at..at + part.numbers()]);
        at += part.numbers();
        match part {
            Part::Ball => {
                let q = Quaternion::new(own[0], own[1], own[2], own[3]);
                let turn = Quaternion::new(by[0], by[1], by[2], by[3]) * q.conjugate();
                out.extend((turn.vector() * (2.0 / q.norm_squared())).iter());
            }
            _ => out.extend(by),
        }
    }
    out
}

/// Changes the coordinates that numbers represent.
fn apply(parts: &[Part], numbers: &mut [f64], change: &[f64]) {
    let (mut at, mut from) = (0, 0);
    for part in parts {
        let own = &mut numbers[at..at + part.numbers()];
        at += part.numbers();
        match part {
            Part::Ball => {
                let turn = Vector3::from_column_slice(&change[from..from + 3]);
                from += 3;
                let q = Quaternion::new(own[0], own[1], own[2], own[3]);
                let turned = q + Quaternion::from_imag(0.5 * turn) * q;
                own.copy_from_slice(&[turned.w, turned.i, turned.j, turned.k]);
            }
            _ => {
                own.iter_mut().zip(&change[from..]).for_each(|(v, by)| *v += by);
                from += part.numbers();
            }
        }
    }
}

impl Track {
    /// Returns the white noise of the coordinates; `None` if there is none, or the track is too short.
    pub(super) fn noise(&self, cut_off_hz: f64) -> Option<TrackNoise> {
        let stride = ((self.rate_hz() / (PER_PERIOD * cut_off_hz)) as usize).max(1);
        let span = stride * (TENTH.len() - 1);
        let allowed_s = (span as f64 + GAP - 1.0) / self.rate_hz();
        let mut changes: Vec<Vec<f64>> = Vec::new();
        for row in 0..self.len().saturating_sub(span) {
            let taken_ns = self.time_ns(row + span).saturating_sub(self.time_ns(row));
            if taken_ns as f64 * 1e-9 > allowed_s {
                continue;
            }
            let middle = self.row(row + span / 2)?;
            let mut by = vec![0.0; middle.len()];
            for (k, weight) in TENTH.iter().enumerate() {
                by.iter_mut().zip(self.row(row + k * stride)?).for_each(|(sum, v)| *sum += weight * v);
            }
            changes.push(change(self.parts(), middle, &by));
        }
        let covariance = covariance(&changes)? / TENTH.iter().map(|w| w * w).sum::<f64>();
        let rms = |from: usize| (covariance.diagonal().rows(from, 3).sum() / 3.0).sqrt();
        let (sigma, unit) = if rms(0) > 0.0 { (rms(0), "m") } else { (rms(3), "rad") };
        if !sigma.is_finite() || sigma <= 0.0 {
            return None;
        }
        let eigen = SymmetricEigen::new(covariance / (sigma * sigma));
        let roots = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
        Some(TrackNoise { sigma, unit, shape: eigen.eigenvectors * DMatrix::from_diagonal(&roots) })
    }

    /// Returns some rows of the track with noise of 1 σ of `sigma`, of either sign, added.
    pub(super) fn with_noise(&self, noise: &TrackNoise, sigma: f64, seed: u64, rows: Range<usize>) -> Self {
        let mut signs = Signs::new(seed);
        let mut some = self.part(rows);
        let parts = some.parts().to_vec();
        for row in some.rows_mut() {
            let drawn = DVector::from_fn(noise.shape.ncols(), |_, _| sigma * signs.draw());
            apply(&parts, row, (&noise.shape * drawn).as_slice());
        }
        some
    }
}

/// Returns the covariance of what has no mean, of normal numbers some of which are spoilt.
fn covariance(all: &[Vec<f64>]) -> Option<DMatrix<f64>> {
    let d = all.first()?.len();
    let count = all.len() as f64;
    let square = |k: usize| all.iter().map(|v| v[k] * v[k]).sum::<f64>() / count;
    let squares: Vec<f64> = (0..d).map(square).collect();
    let length = |v: &Vec<f64>| -> f64 {
        v.iter().zip(&squares).filter(|(_, s)| **s > 0.0).map(|(v, s)| v * v / s).sum()
    };
    let mut sorted: Vec<&Vec<f64>> = all.iter().collect();
    sorted.sort_by(|a, b| length(a).total_cmp(&length(b)));
    sorted.truncate((COUNTED * count).ceil() as usize);
    let moving = squares.iter().filter(|s| **s > 0.0).count().max(1) as f64;
    // Mean square of the least of them over that of all.
    let edge = ChiSquared::new(moving).ok()?.inverse_cdf(COUNTED);
    let counted = ChiSquared::new(moving + 2.0).ok()?.cdf(edge) / COUNTED;
    let mut sum = DMatrix::zeros(d, d);
    for v in &sorted {
        let v = DVector::from_column_slice(v);
        sum.ger(1.0 / (counted * sorted.len() as f64), &v, &v, 1.0);
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::super::track::Pose;
    use super::*;

    #[test]
    fn noise_of_a_swinging_link_is_found_with_its_correlation() {
        let (rate, sigma) = (120.0, 2e-4);
        let mut signs = Signs::new(1);
        let mut normal = || (0..12).map(|_| signs.draw()).sum::<f64>() / 12.0_f64.sqrt();
        let (mut poses, mut joints) = (Vec::new(), Vec::new());
        for k in 0..6000 {
            let t = f64::from(k) / rate;
            let noise = Vector3::new(normal(), normal(), normal()) * sigma;
            let swung = UnitQuaternion::from_scaled_axis(Vector3::new(0.6 * (5.0 * t).sin(), 0.0, 0.3));
            // The base turns by as many rad as it shifts m; the joint's attitude against it has that noise,
            // too.
            let base = UnitQuaternion::from_scaled_axis(noise);
            let relative = base.inverse() * swung;
            poses.push(Pose { position: noise + Vector3::x() * (0.005 * (9.0 * t).sin()), attitude: base });
            joints.push(vec![relative.w, relative.i, relative.j, relative.k]);
        }
        let rest = Pose { position: Vector3::zeros(), attitude: UnitQuaternion::identity() };
        let times = (0..6000_u64).map(|k| (k as f64 / rate * 1e9) as u64).collect();
        let track = Track::new(&poses, &rest, (&joints, &[Part::Ball]), times, rate);
        let noise = track.noise(8.0).unwrap();
        assert!((noise.sigma / sigma - 1.0).abs() < 0.03, "{}", noise.sigma);
        let covariance = &noise.shape * noise.shape.transpose();
        for (i, sign) in [(0, 1.0), (3, 1.0), (6, -1.0)] {
            for (j, other) in [(0, 1.0), (3, 1.0), (6, -1.0)] {
                let block = covariance.fixed_view::<3, 3>(i, j) * (sign * other);
                assert!((block - nalgebra::Matrix3::identity()).amax() < 0.06, "{i} {j} {block}");
            }
        }
        // Noise of both signs is opposite, and has that size.
        let [more, less] = [1.0, -1.0].map(|s| track.with_noise(&noise, s * sigma, 3, 100..1100));
        let (mut sum, mut different) = (0.0, 0.0_f64);
        for row in 0..1000 {
            let (own, a, b) = (track.row(100 + row).unwrap(), more.row(row).unwrap(), less.row(row).unwrap());
            sum += (0..3).map(|k| (a[k] - own[k]).powi(2) / 3000.0).sum::<f64>();
            different =
                a.iter().zip(b).zip(own).fold(different, |m, ((a, b), o)| m.max((a + b - 2.0 * o).abs()));
        }
        assert!((sum.sqrt() / sigma - 1.0).abs() < 0.05 && different < 1e-12, "{} {different}", sum.sqrt());
    }
}
