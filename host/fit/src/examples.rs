//! Fits of made-up models, with every row at hand: for tests against dense algebra.

use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use rigident_fit::factor_file::{FactorSource, SourceChannel};
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Factor, Fit, Kind, Owner, Parameter, RigRows};

const TEN: [(&str, Kind, &str); 10] = [
    ("m", Kind::Mass, "kg"),
    ("mcx", Kind::FirstMoment, "kg m"),
    ("mcy", Kind::FirstMoment, "kg m"),
    ("mcz", Kind::FirstMoment, "kg m"),
    ("Ixx", Kind::Inertia, "kg m2"),
    ("Iyy", Kind::Inertia, "kg m2"),
    ("Izz", Kind::Inertia, "kg m2"),
    ("Iyz", Kind::Inertia, "kg m2"),
    ("Izx", Kind::Inertia, "kg m2"),
    ("Ixy", Kind::Inertia, "kg m2"),
];
const REGROUPED: [&str; 10] = ["M", "MSx", "MSy", "MSz", "Jxx", "Jyy", "Jzz", "Jyz", "Jzx", "Jxy"];
const CHANNELS: [&str; 6] = ["fx", "fy", "fz", "mx", "my", "mz"];

fn offsets() -> Vec<Parameter> {
    let of = |(k, channel): (usize, &&str)| {
        let unit = if k < 3 { "N" } else { "N m" };
        Parameter::new(format!("offset_{channel}"), Owner::Channel((*channel).into()), Kind::Offset, unit)
    };
    CHANNELS.iter().enumerate().map(of).collect()
}

/// One body and its offsets.
pub fn body() -> Vec<Parameter> {
    let ten = TEN.iter().map(|(name, kind, unit)| Parameter {
        frame: "S".into(),
        ..Parameter::new(*name, Owner::Link(String::new()), *kind, unit)
    });
    ten.chain(offsets()).collect()
}

/// A base with all of its ten, `links` links on revolute joints about z (seven each, M and MSz gone to the
/// base), offsets and a drive with two frictions: 18 + 7 links parameters.
pub fn tree(links: usize) -> Vec<Parameter> {
    let parameter = |link: &str, k: usize| {
        let (_, kind, unit) = TEN[k];
        let name = format!("{link}.{}", REGROUPED[k]);
        Parameter { frame: link.into(), ..Parameter::new(name, Owner::Link(link.into()), kind, unit) }
    };
    let mut all: Vec<Parameter> = (0..10).map(|k| parameter("base", k)).collect();
    for (k, parameter) in all.iter_mut().enumerate() {
        parameter.made_of = vec![(format!("base.{}", TEN[k].0), 1.0)];
        if k == 0 || k == 3 {
            let carried =
                (0..links).map(|l| (format!("link{l}.{}", TEN[0].0), if k == 0 { 1.0 } else { 0.25 }));
            parameter.made_of.extend(carried);
        }
    }
    for l in 0..links {
        let link = format!("link{l}");
        for k in [1, 2, 4, 6, 7, 8, 9] {
            let mut own = parameter(&link, k);
            own.made_of = vec![(format!("{link}.{}", TEN[k].0), 1.0)];
            if k == 4 {
                own.made_of.push((format!("{link}.Iyy"), -1.0));
            }
            all.push(own);
        }
    }
    all.extend(offsets());
    for (name, kind, unit) in [("viscous", Kind::Viscous, "N m s"), ("coulomb", Kind::Coulomb, "N m")] {
        all.push(Parameter::new(format!("elbow.{name}"), Owner::Drive("elbow".into()), kind, unit));
    }
    all
}

/// A run: whitened rows of unit noise, and what they make.
pub struct Run {
    pub parameters: Vec<Parameter>,
    pub a: DMatrix<f64>,
    pub y: DVector<f64>,
    pub pooled: PooledFactor,
}

impl Run {
    /// Rows `A φ + noise`, A random with entries of size `1/sigma`.
    pub fn new(parameters: &[Parameter], phi: &[f64], rows: usize, sigma: f64, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let a = DMatrix::from_fn(rows, phi.len(), |_, _| normal() / sigma);
        let y = &a * DVector::from_column_slice(phi) + DVector::from_fn(rows, |_, _| normal());
        Self::of(parameters, a, y, seed)
    }

    pub fn of(parameters: &[Parameter], a: DMatrix<f64>, y: DVector<f64>, seed: u64) -> Self {
        let name = format!("run {seed}");
        let channels = CHANNELS.map(|channel| SourceChannel {
            name: channel.into(),
            unit: "N".into(),
            sigma: 0.5,
            gain_sigma: 0.0,
            measured_rms: 10.0,
        });
        let source = FactorSource {
            recording: name.clone(),
            recorded_unix_s: Some(1_700_000_000),
            fingerprint: seed,
            samples: a.nrows() as u64 / 6,
            rejected: 0,
            rows: a.nrows() as u64,
            noise_gain: 1.0,
            variance_scale: 1.0,
            fitted: None,
            sigma_given: true,
            spurious_information: 0.0,
            channels: channels.to_vec(),
            checks: None,
            labels: std::collections::BTreeMap::new(),
            readings: Vec::new(),
            folded: None,
        };
        let pooled = PooledFactor {
            name,
            parameters: parameters.to_vec(),
            model_fingerprint: 77,
            rounding: 1e-12,
            rigs: vec![RigRows::plain(factor(&a, &y))],
            errors_inside: false,
            differing: Vec::new(),
            overlapping: Vec::new(),
            sources: vec![source],
            eliminated: 0,
            disagreement: 0.0,
            comparisons: 0,
        };
        Self { parameters: parameters.to_vec(), a, y, pooled }
    }

    pub fn fit(&self) -> Fit {
        self.pooled.fit()
    }
}

pub fn factor(a: &DMatrix<f64>, y: &DVector<f64>) -> Factor {
    let rows: Vec<Vec<f64>> = a.row_iter().map(|row| row.iter().copied().collect()).collect();
    let mut factor = Factor::new(a.ncols());
    factor.absorb(rows.iter().zip(y.iter()).map(|(row, value)| (row.as_slice(), *value)));
    factor
}

/// Estimate, covariance and residual sum of squares by the normal equations.
pub fn dense(a: &DMatrix<f64>, y: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>, f64) {
    let covariance = (a.transpose() * a).try_inverse().unwrap();
    let estimate = &covariance * a.transpose() * y;
    let residual = (y - a * &estimate).norm_squared();
    (estimate, covariance, residual)
}

/// The largest difference of estimates in standard deviations, and of covariances in products of them.
pub fn apart(fit: &Fit, at: &[usize], estimate: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
    let sd = |i: usize| covariance[(i, i)].sqrt();
    let mut worst = 0.0_f64;
    for (i, p) in at.iter().enumerate() {
        worst = worst.max((fit.estimate.unjudged().values[*p] - estimate[i]).abs() / sd(i));
        for (j, q) in at.iter().enumerate() {
            worst = worst.max(
                (fit.estimate.unjudged().covariance[(*p, *q)] - covariance[(i, j)]).abs() / (sd(i) * sd(j)),
            );
        }
    }
    worst
}

/// Numbers of a plausible size.
pub fn truth(count: usize) -> Vec<f64> {
    (0..count).map(|j| ((j * j + 3 * j + 1) as f64).sin() + 2.0).collect()
}
