//! Poles and complex amplitudes of components with their joint covariance.

use nalgebra::{Complex, DMatrix, DVector};

use super::decay_fit::Fit;
use super::spectrum::Periodogram;

/// Independent frequencies on each side of a component that tell the noise there.
const AROUND: usize = 16;

/// Frequencies, damping ratios and complex amplitudes: channel c moves by
/// `Re Σ_r z_rc e^{(−ζω + iω√(1−ζ²)) t}`, t from the first sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Amplitudes {
    /// Undamped natural frequencies ω, rad/s.
    pub angular: Vec<f64>,
    /// Damping ratios ζ.
    pub damping: Vec<f64>,
    /// z: one row for each channel, one column for each component, in the channel's unit.
    pub complex: DMatrix<Complex<f64>>,
    /// Covariance of `[ω ζ Re z₁ … Re z_n Im z₁ … Im z_n]` of the first component, then of the second, and so
    /// on: `2 + 2n` for each.
    pub covariance: DMatrix<f64>,
}

impl Amplitudes {
    /// Returns the numbers that a component has in the covariance.
    pub fn stride(&self) -> usize {
        2 + 2 * self.complex.nrows()
    }

    /// Returns only these components, in this order.
    #[must_use]
    pub fn selected(&self, components: &[usize]) -> Self {
        let stride = self.stride();
        let places: Vec<usize> =
            components.iter().flat_map(|r| (0..stride).map(move |k| r * stride + k)).collect();
        Self {
            angular: components.iter().map(|r| self.angular[*r]).collect(),
            damping: components.iter().map(|r| self.damping[*r]).collect(),
            complex: self.complex.select_columns(components),
            covariance: self.covariance.select_rows(&places).select_columns(&places),
        }
    }

    /// Returns only these channels, in this order.
    #[must_use]
    pub fn of_channels(&self, channels: &[usize]) -> Self {
        let (all, stride) = (self.complex.nrows(), self.stride());
        let own = || [0, 1].into_iter().chain(channels.iter().map(|c| 2 + c));
        let own = || own().chain(channels.iter().map(|c| 2 + all + c));
        let places: Vec<usize> =
            (0..self.complex.ncols()).flat_map(|r| own().map(move |k| r * stride + k)).collect();
        Self {
            complex: self.complex.select_rows(channels),
            covariance: self.covariance.select_rows(&places).select_columns(&places),
            ..self.clone()
        }
    }

    /// Returns the standard deviations of ω and ζ of a component.
    pub(super) fn deviations(&self, component: usize) -> (f64, f64) {
        let k = component * self.stride();
        (self.covariance[(k, k)].max(0.0).sqrt(), self.covariance[(k + 1, k + 1)].max(0.0).sqrt())
    }
}

/// Noise of the channels as the residuals show it.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    /// Correlation between channels.
    pub(super) correlation: DMatrix<f64>,
    /// Noise around the component's frequency by white noise of the same variance, at least one, for each
    /// component and channel.
    pub(super) coloured: Vec<Vec<f64>>,
}

impl Noise {
    /// Measures a fit's residuals.
    pub(super) fn new(fit: &Fit, columns: &DMatrix<f64>, spectrum: &Periodogram) -> Self {
        let channels = columns.ncols();
        let norms: Vec<f64> = columns.column_iter().map(|column| column.norm()).collect();
        let correlation = DMatrix::from_fn(channels, channels, |i, j| {
            let size = norms[i] * norms[j];
            let exact = fit.is_rounding(i) || fit.is_rounding(j);
            match i == j {
                true => 1.0,
                false if exact || size <= 0.0 => 0.0,
                false => columns.column(i).dot(&columns.column(j)) / size,
            }
        });
        let away: Vec<f64> = fit.poles.iter().map(|pole| pole.hz()).collect();
        let of = |hz: f64| {
            let near = spectrum.mean_near(hz, AROUND, &away);
            let ratio = |(channel, near): (usize, f64)| {
                if fit.is_rounding(channel) { 1.0 } else { (near / fit.sigma[channel].powi(2)).max(1.0) }
            };
            near.into_iter().enumerate().map(ratio).collect()
        };
        Self { correlation, coloured: away.iter().map(|hz| of(*hz)).collect() }
    }
}

/// Brings a fit into natural frequencies, damping ratios and complex amplitudes, with their covariance.
pub(super) fn amplitudes(fit: &Fit, noise: &Noise) -> Option<Amplitudes> {
    let (count, channels) = (fit.poles.len(), fit.sigma.len());
    let covariance = raw_covariance(fit, noise)?;
    let stride = 2 + 2 * channels;
    let mut to = DMatrix::<f64>::zeros(count * stride, covariance.nrows());
    for (r, pole) in fit.poles.iter().enumerate() {
        let (omega, k) = (pole.natural(), r * stride);
        // ω² = α² + ν², ζ = α / ω.
        to[(k, 2 * r)] = pole.decay / omega;
        to[(k, 2 * r + 1)] = pole.angular / omega;
        to[(k + 1, 2 * r)] = pole.angular.powi(2) / omega.powi(3);
        to[(k + 1, 2 * r + 1)] = -pole.decay * pole.angular / omega.powi(3);
        for c in 0..channels {
            // z = a − i b.
            let place = place(count, channels, r, c);
            to[(k + 2 + c, place)] = 1.0;
            to[(k + 2 + channels + c, place + 1)] = -1.0;
        }
    }
    let of =
        |c: usize, r: usize| Complex::new(fit.amplitudes[(1 + 2 * r, c)], -fit.amplitudes[(2 + 2 * r, c)]);
    Some(Amplitudes {
        angular: fit.poles.iter().map(|pole| pole.natural()).collect(),
        damping: fit.poles.iter().map(|pole| pole.damping()).collect(),
        complex: DMatrix::from_fn(channels, count, of),
        covariance: &to * covariance * to.transpose(),
    })
}

/// Returns the place of `a` of a component and channel among (α₁ ν₁ … a₁₁ b₁₁ a₁₂ …).
fn place(count: usize, channels: usize, component: usize, channel: usize) -> usize {
    2 * count + 2 * (component * channels + channel)
}

/// Returns the covariance of (α₁ ν₁ … α_R ν_R, a₁₁ b₁₁ a₁₂ b₁₂ …).
///
/// With the triangle's blocks `[R_B R_BD; 0 R_D]` and unit noise ε in its rows, channel by channel:
/// `δθ = C Σ_c S_cᵀ R_Dᵀ ε_D / σ_c` and `δx_c = R_B⁻¹ (σ_c ε_B − R_BD S_c δθ)`. Channels that are correlated
/// are summed so.
fn raw_covariance(fit: &Fit, noise: &Noise) -> Option<DMatrix<f64>> {
    let (count, channels) = (fit.poles.len(), fit.sigma.len());
    let (p, q) = fit.columns();
    let poles = fit.pole_covariance()?;
    let above = fit.upper.view((0, 0), (p, p)).into_owned();
    let inverse = above.solve_upper_triangular(&DMatrix::identity(p, p))?;
    let coupling = &inverse * fit.upper.view((0, p), (p, q - p));
    let free = fit.upper.view((p, p), (q - p, q - p));
    let derivatives: Vec<DMatrix<f64>> = (0..channels).map(|c| fit.derivative(c)).collect();
    let influences: Vec<DMatrix<f64>> = (0..channels)
        .map(|c| {
            let mut influence = DMatrix::zeros(place(count, channels, count, 0), q);
            let on_poles = &poles * (free * &derivatives[c]).transpose() / fit.sigma[c];
            influence.view_mut((0, p), (2 * count, q - p)).copy_from(&on_poles);
            for (other, derivative) in derivatives.iter().enumerate() {
                let on_all = -(&coupling * derivative) * &on_poles;
                for r in 0..count {
                    let k = place(count, channels, r, other);
                    influence.view_mut((k, p), (2, q - p)).copy_from(&on_all.rows(1 + 2 * r, 2));
                    if other == c {
                        let own = inverse.rows(1 + 2 * r, 2) * fit.sigma[c];
                        influence.view_mut((k, 0), (2, p)).copy_from(&own);
                    }
                }
            }
            influence
        })
        .collect();
    let root = correlation_root(&noise.correlation);
    let size = influences.first()?.nrows();
    let mut covariance = DMatrix::zeros(size, size);
    for k in 0..channels {
        let mut sum = DMatrix::zeros(size, q);
        for (c, influence) in influences.iter().enumerate() {
            sum += influence * root[(c, k)];
        }
        covariance += &sum * sum.transpose();
    }
    let wider = widening(fit, noise);
    Some(DMatrix::from_fn(size, size, |i, j| covariance[(i, j)] * wider[i] * wider[j]))
}

/// Returns `L` with `L Lᵀ` the correlation; the identity if it is none.
fn correlation_root(correlation: &DMatrix<f64>) -> DMatrix<f64> {
    let n = correlation.nrows();
    let eigen = correlation.clone().symmetric_eigen();
    if eigen.eigenvalues.iter().any(|v| !v.is_finite()) {
        return DMatrix::identity(n, n);
    }
    let roots = DVector::from_iterator(n, eigen.eigenvalues.iter().map(|v| v.max(0.0).sqrt()));
    &eigen.eigenvectors * DMatrix::from_diagonal(&roots)
}

/// Returns what noise that is not white widens standard deviations by: amplitudes by their channel's, poles
/// by the channels' mean, each weighted by what it tells of the pole (its amplitude by its noise, squared).
fn widening(fit: &Fit, noise: &Noise) -> Vec<f64> {
    let (count, channels) = (fit.poles.len(), fit.sigma.len());
    let mut wider = vec![1.0; place(count, channels, count, 0)];
    for (r, coloured) in noise.coloured.iter().enumerate() {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (c, ratio) in coloured.iter().enumerate() {
            let k = place(count, channels, r, c);
            wider[k] = ratio.sqrt();
            wider[k + 1] = ratio.sqrt();
            let size = fit.amplitudes[(1 + 2 * r, c)].hypot(fit.amplitudes[(2 + 2 * r, c)]) / fit.sigma[c];
            sum += size * size * ratio;
            weights += size * size;
        }
        let mean = if weights > 0.0 { (sum / weights).sqrt() } else { 1.0 };
        wider[2 * r] = mean;
        wider[2 * r + 1] = mean;
    }
    wider
}
