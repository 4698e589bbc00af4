//! Modes: real shapes without scale from complex amplitudes, with the covariance of all of them.

use nalgebra::{Complex, DMatrix, DVector};

use super::amplitudes::Amplitudes;
use super::input::ModalError;

/// A mode of vibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Undamped natural frequency ω, rad/s.
    pub angular: f64,
    /// Standard deviation of ω, rad/s.
    pub angular_sd: f64,
    /// Damping ratio ζ.
    pub damping: f64,
    /// Standard deviation of ζ.
    pub damping_sd: f64,
    /// Real shape in the channels' units: `Σ (φ_c / scale_c)² = 1`, its largest scaled entry positive.
    pub shape: DVector<f64>,
    /// Complex amplitudes of the channels at the first sample, in their units.
    pub amplitudes: DVector<Complex<f64>>,
    /// The part of the scaled amplitudes that no common phase makes real, `|Im| / |z|`: zero for damping in
    /// proportion, noise included.
    pub imaginary_share: f64,
    /// Mode phase collinearity of the scaled amplitudes: one if all channels move in phase or against it,
    /// zero if they go round.
    pub collinearity: f64,
    /// Root of the mode's energy by the noise's variance, summed over samples and channels: about the
    /// amplitude by its standard deviation.
    pub signal_to_noise: f64,
}

impl Mode {
    /// Returns the undamped natural frequency, Hz.
    pub fn hz(&self) -> f64 {
        self.angular / std::f64::consts::TAU
    }
}

/// Modes with their joint covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct Shapes {
    /// The modes in the order of the amplitudes.
    pub modes: Vec<Mode>,
    /// Covariance of `[ω ζ φ₁ … φ_n]` of the first mode, then of the second, and so on: `2 + n` for each. Of
    /// each shape, the direction in which only its norm would change, `φ_c / scale_c²`, has none.
    pub covariance: DMatrix<f64>,
}

impl Shapes {
    /// Returns the place of a mode's ω in the covariance; ζ and the shape follow it.
    pub fn place(&self, mode: usize) -> usize {
        mode * self.modes.first().map_or(0, |mode| mode.shape.len() + 2)
    }
}

/// Makes shapes of amplitudes.
///
/// With `z_c e^{−iθ} = u_c + i v_c`, the phase that makes most real is `θ = ½ arg Σ w_c z_c²`, each channel
/// weighted by `w_c`, the inverse of its amplitude's variance. Then `du_c = Re(dz_c e^{−iθ}) + v_c dθ` with
/// `dθ = Im(Σ w_c z_c dz_c / Σ w_c z_c²)`, and `φ = u / |u|` with `dφ = (du − φ (φ·du)) / |u|` in scaled
/// channels. All without signal-to-noise, which only samples tell.
///
/// # Errors
/// [`ModalError::Input`] if scales are not one positive number for each channel (or none: all one).
pub fn shapes(amplitudes: &Amplitudes, scales: &[f64]) -> Result<Shapes, ModalError> {
    let channels = amplitudes.complex.nrows();
    let scales = match scales.len() {
        0 => vec![1.0; channels],
        n if n == channels && scales.iter().all(|s| s.is_finite() && *s > 0.0) => scales.to_vec(),
        n => {
            return Err(ModalError::Input(format!(
                "{n} scales for {channels} channels: give a positive one for each"
            )));
        }
    };
    let (count, stride) = (amplitudes.angular.len(), amplitudes.stride());
    let mut to = DMatrix::<f64>::zeros(count * (2 + channels), count * stride);
    let mut modes = Vec::new();
    for r in 0..count {
        let turned = Turned::new(amplitudes, r, &scales);
        let (row, column) = (r * (2 + channels), r * stride);
        to[(row, column)] = 1.0;
        to[(row + 1, column + 1)] = 1.0;
        to.view_mut((row + 2, column + 2), (channels, 2 * channels)).copy_from(&turned.derivative(&scales));
        let (angular_sd, damping_sd) = amplitudes.deviations(r);
        modes.push(Mode {
            angular: amplitudes.angular[r],
            angular_sd,
            damping: amplitudes.damping[r],
            damping_sd,
            shape: &turned.real * (turned.sign / turned.norm),
            imaginary_share: turned.imaginary_share(&scales),
            collinearity: turned.collinearity(&scales),
            amplitudes: turned.complex,
            signal_to_noise: f64::NAN,
        });
    }
    let covariance = &to * &amplitudes.covariance * to.transpose();
    Ok(Shapes { modes, covariance })
}

/// Amplitudes of one mode, turned to be as real as they can be.
struct Turned {
    complex: DVector<Complex<f64>>,
    /// `e^{−iθ}`.
    turn: Complex<f64>,
    real: DVector<f64>,
    imaginary: DVector<f64>,
    /// `w_c z_c / Σ w z²`.
    leverage: DVector<Complex<f64>>,
    norm: f64,
    sign: f64,
}

impl Turned {
    fn new(amplitudes: &Amplitudes, mode: usize, scales: &[f64]) -> Self {
        let channels = scales.len();
        let complex = amplitudes.complex.column(mode).into_owned();
        let first = mode * amplitudes.stride() + 2;
        let variance = |k: usize| amplitudes.covariance[(first + k, first + k)];
        let weights: Vec<f64> = (0..channels)
            .map(|c| {
                let both = variance(c) + variance(channels + c);
                if both > 0.0 { 1.0 / both } else { 1.0 / (1e-30 * scales[c].powi(2)) }
            })
            .collect();
        let sum: Complex<f64> = complex.iter().zip(&weights).map(|(z, w)| z * z * *w).sum();
        let turn = Complex::from_polar(1.0, -0.5 * sum.arg());
        let turned = complex.map(|z| z * turn);
        let real = turned.map(|z| z.re);
        let scaled = |c: usize| real[c] / scales[c];
        let norm = (0..channels).map(|c| scaled(c).powi(2)).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        let largest = (0..channels).max_by(|a, b| scaled(*a).abs().total_cmp(&scaled(*b).abs())).unwrap_or(0);
        Self {
            leverage: DVector::from_fn(channels, |c, _| complex[c] * weights[c] / sum),
            imaginary: turned.map(|z| z.im),
            sign: if scaled(largest) < 0.0 { -1.0 } else { 1.0 },
            complex,
            turn,
            real,
            norm,
        }
    }

    /// Returns the derivative of the shape by `[Re z, Im z]`.
    fn derivative(&self, scales: &[f64]) -> DMatrix<f64> {
        let channels = scales.len();
        let mut by = DMatrix::zeros(channels, 2 * channels);
        for c in 0..channels {
            // Re((dx + i dy)(cos − i sin)): the turn's real and negative imaginary part.
            by[(c, c)] += self.turn.re;
            by[(c, channels + c)] -= self.turn.im;
            for k in 0..channels {
                by[(c, k)] += self.imaginary[c] * self.leverage[k].im;
                by[(c, channels + k)] += self.imaginary[c] * self.leverage[k].re;
            }
        }
        let shape = &self.real / self.norm;
        let pull = DVector::from_fn(channels, |c, _| shape[c] / scales[c].powi(2));
        let along = by.tr_mul(&pull);
        (by - shape * along.transpose()) * (self.sign / self.norm)
    }

    fn sums(&self, scales: &[f64]) -> (f64, f64, f64) {
        let mut sums = (0.0, 0.0, 0.0);
        for c in 0..scales.len() {
            let (u, v) = (self.real[c] / scales[c], self.imaginary[c] / scales[c]);
            sums = (sums.0 + u * u, sums.1 + v * v, sums.2 + u * v);
        }
        sums
    }

    fn imaginary_share(&self, scales: &[f64]) -> f64 {
        let (real, imaginary, _) = self.sums(scales);
        (imaginary / (real + imaginary).max(f64::MIN_POSITIVE)).sqrt()
    }

    /// Returns `((Sxx − Syy)² + 4 Sxy²) / (Sxx + Syy)²` (R. Pappa, K. Elliott, A. Schenk 1993).
    fn collinearity(&self, scales: &[f64]) -> f64 {
        let (real, imaginary, both) = self.sums(scales);
        ((real - imaginary).powi(2) + 4.0 * both * both) / (real + imaginary).powi(2).max(f64::MIN_POSITIVE)
    }
}
