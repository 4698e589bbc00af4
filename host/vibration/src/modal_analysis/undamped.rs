//! Modes that there would be without dampers, from those that there are.
//!
//! With as many modes as coordinates, poles λ and complex shapes z give the whole system, whatever its
//! dampers are:
//! ```text
//! [−M⁻¹K  −M⁻¹C] [Z; ZΛ] = ZΛ²
//! ```
//! and M⁻¹K has the undamped frequencies and shapes, of which equations of free vibration speak. Where
//! damping is in proportion they are |λ| and z; where it is not, they differ by the square of the part of z
//! that is out of phase.

use nalgebra::{Complex, DMatrix, DVector};

use super::amplitudes::Amplitudes;

/// Steps of the inverse iteration; each doubles the digits.
const STEPS: usize = 6;
/// A shape that has less than this cosine with the one measured is another mode's.
const SAME: f64 = 0.8;
/// Steps of differences, relative.
const STEP: f64 = 1e-6;

/// Returns the amplitudes of the undamped modes, their covariance counted; `None` unless there are as many
/// modes as channels, and each keeps its own.
pub fn undamped(damped: &Amplitudes) -> Option<Amplitudes> {
    let (channels, count) = damped.complex.shape();
    let stride = damped.stride();
    if channels != count || count == 0 {
        return None;
    }
    let weights = DMatrix::from_fn(channels, count, |c, r| {
        let first = r * stride + 2 + c;
        let both =
            damped.covariance[(first, first)] + damped.covariance[(first + channels, first + channels)];
        if both > 0.0 { 1.0 / both } else { 1.0 }
    });
    let of = |numbers: &DVector<f64>| corrected(numbers, channels, &weights);
    let measured = numbers(damped);
    let found = of(&measured)?;
    let mut slopes = DMatrix::zeros(measured.len(), measured.len());
    for k in 0..measured.len() {
        let place = k % stride;
        let size = match place {
            0 => measured[k],
            1 => 1.0,
            // Of the mode's own kind of coordinate.
            _ => damped.complex.column(k / stride).map(|z| z.norm()).amax(),
        };
        let step = STEP * size;
        let at = |by: f64| {
            let mut moved = measured.clone();
            moved[k] += by;
            of(&moved)
        };
        slopes.set_column(k, &((at(step)? - at(-step)?) / (2.0 * step)));
    }
    let covariance = &slopes * &damped.covariance * slopes.transpose();
    // Undamped shapes are real: the part out of phase is the dampers' and noise, which turns nothing to first
    // order.
    let complex = DMatrix::from_fn(channels, count, |c, r| {
        let turn = phase(&damped.complex, &weights, r);
        turn * (shape_entry(&found, channels, r, c) * turn.conj()).re
    });
    Some(Amplitudes {
        angular: (0..count).map(|r| found[r * stride]).collect(),
        damping: damped.damping.clone(),
        complex,
        covariance: (&covariance + covariance.transpose()) * 0.5,
    })
}

/// Returns `[ω ζ Re z Im z]` of all modes.
fn numbers(amplitudes: &Amplitudes) -> DVector<f64> {
    let (channels, count) = amplitudes.complex.shape();
    let mut all = Vec::new();
    for r in 0..count {
        all.extend([amplitudes.angular[r], amplitudes.damping[r]]);
        all.extend((0..channels).map(|c| amplitudes.complex[(c, r)].re));
        all.extend((0..channels).map(|c| amplitudes.complex[(c, r)].im));
    }
    DVector::from_vec(all)
}

fn shape_entry(numbers: &DVector<f64>, channels: usize, mode: usize, channel: usize) -> Complex<f64> {
    let first = mode * (2 + 2 * channels) + 2 + channel;
    Complex::new(numbers[first], numbers[first + channels])
}

/// Returns the numbers with the frequencies, and the part in phase of the shapes, of the undamped modes.
fn corrected(numbers: &DVector<f64>, channels: usize, weights: &DMatrix<f64>) -> Option<DVector<f64>> {
    let stride = 2 + 2 * channels;
    let shapes = DMatrix::from_fn(channels, channels, |c, r| shape_entry(numbers, channels, r, c));
    // Shapes of unit size, coordinates of one size: nothing depends on either.
    let sizes = DVector::from_fn(channels, |c, _| shapes.row(c).map(|z| z.norm()).amax());
    if sizes.iter().any(|size| *size <= 0.0) {
        return None;
    }
    let scaled = DMatrix::from_fn(channels, channels, |c, r| shapes[(c, r)] / sizes[c]);
    let norms: Vec<f64> = scaled.column_iter().map(|z| z.map(|v| v.norm()).norm()).collect();
    let mut basis = DMatrix::zeros(2 * channels, 2 * channels);
    let mut second = DMatrix::zeros(channels, 2 * channels);
    for r in 0..channels {
        let (omega, zeta) = (numbers[r * stride], numbers[r * stride + 1]);
        let pole = Complex::new(-zeta * omega, omega * (1.0 - zeta * zeta).max(0.0).sqrt());
        for c in 0..channels {
            let z = scaled[(c, r)] / norms[r];
            let moved = [z, z * pole, z * pole * pole];
            for (column, part) in [(r, moved.map(|v| v.re)), (channels + r, moved.map(|v| v.im))] {
                basis[(c, column)] = part[0];
                basis[(channels + c, column)] = part[1];
                second[(c, column)] = part[2];
            }
        }
    }
    let all = basis.transpose().lu().solve(&second.transpose())?.transpose();
    let stiffness = -all.columns(0, channels).into_owned();
    let mut out = numbers.clone();
    for r in 0..channels {
        let turn = phase(&shapes, weights, r);
        let in_phase = DVector::from_fn(channels, |c, _| (shapes[(c, r)] * turn.conj()).re / sizes[c]);
        let omega = numbers[r * stride];
        let (square, shape) = eigen(&stiffness, omega * omega, &in_phase)?;
        let size = shape.dot(&in_phase) / shape.norm_squared();
        out[r * stride] = square.sqrt();
        for c in 0..channels {
            let moved = turn * ((size * shape[c] - in_phase[c]) * sizes[c]);
            out[r * stride + 2 + c] += moved.re;
            out[r * stride + 2 + channels + c] += moved.im;
        }
    }
    Some(out)
}

/// Returns the phase, a number of size one, by which a shape is as real as it can be.
fn phase(shapes: &DMatrix<Complex<f64>>, weights: &DMatrix<f64>, mode: usize) -> Complex<f64> {
    let sum: Complex<f64> = (0..shapes.nrows()).map(|c| shapes[(c, mode)].powi(2) * weights[(c, mode)]).sum();
    Complex::from_polar(1.0, 0.5 * sum.arg())
}

/// Returns the eigenvalue and the vector of a matrix next to a guess; `None` if they are not the guess's own.
fn eigen(matrix: &DMatrix<f64>, near: f64, guess: &DVector<f64>) -> Option<(f64, DVector<f64>)> {
    let n = matrix.nrows();
    let (mut value, mut vector) = (near, guess.normalize());
    for _ in 0..STEPS {
        let moved = matrix - DMatrix::identity(n, n) * value;
        // Singular: it is the value.
        let Some(next) = moved.lu().solve(&vector).filter(|next| next.iter().all(|v| v.is_finite())) else {
            break;
        };
        let by = vector.dot(&next);
        let size = next.norm();
        if by == 0.0 || size == 0.0 {
            return None;
        }
        value += 1.0 / by;
        vector = next / (size * by.signum());
        if (by * value).abs() > 1e14 {
            break;
        }
    }
    let cosine = vector.dot(guess) / guess.norm();
    (value > 0.0 && value.is_finite() && cosine.abs() > SAME).then_some((value, vector))
}

/// Returns of each mode the part of its amplitudes that no common phase makes real, beyond that of noise.
pub fn out_of_phase(amplitudes: &Amplitudes) -> Vec<f64> {
    let (channels, stride) = (amplitudes.complex.nrows(), amplitudes.stride());
    let of = |r: usize| {
        let z = amplitudes.complex.column(r);
        let sum: Complex<f64> = z.iter().map(|z| z * z).sum();
        let turn = Complex::from_polar(1.0, -0.5 * sum.arg());
        let first = r * stride + 2;
        let noise: f64 = (first..first + 2 * channels).map(|k| 0.5 * amplitudes.covariance[(k, k)]).sum();
        let size: f64 = z.iter().map(|z| z.norm_sqr()).sum();
        let beside: f64 = z.iter().map(|z| (z * turn).im.powi(2)).sum();
        ((beside - noise).max(0.0) / size.max(f64::MIN_POSITIVE)).sqrt()
    };
    (0..amplitudes.complex.ncols()).map(of).collect()
}
