//! Recordings of the laboratory, what is made of them, and how far off it is.

use std::collections::BTreeMap;

use rigident::answer::derived::{centre_of_mass, inertia_com, principal};
use rigident::fit::pool::PooledFactor;
use rigident::fit::tare::Tare;
use rigident::fit::{Fit, FitOptions, Parameter, Silent};
use rigident::problem::{Problem, Subject};
use rigident::rows::body::{BodySource, prepare};

#[path = "bound.rs"]
pub mod bound;
#[path = "laboratory.rs"]
pub mod laboratory;

pub use laboratory::{Body, Conditions};
use laboratory::{Motion, RATE_HZ, Rig, rig_file, wrench};

/// Errors in U95 of the ten parameters, and U95.
pub type Errors = Vec<(f64, f64)>;

const TEN: [&str; 10] = ["m", "mcx", "mcy", "mcz", "Ixx", "Iyy", "Izz", "Iyz", "Izx", "Ixy"];

/// Returns what a recording alone says.
pub fn fit(rig: u64, body: &Body, seed: u64, conditions: &Conditions) -> Fit {
    fit_named(rig, &format!("rig {rig}"), body, seed, conditions)
}

/// Returns the same of a rig whose instruments have this serial number.
fn fit_named(rig: u64, serial: &str, body: &Body, seed: u64, conditions: &Conditions) -> Fit {
    let file = rig_file(serial, conditions);
    let readings = Rig::new(rig, conditions).record(body, seed, conditions);
    let input = prepare::input(&file, readings, false, RATE_HZ);
    let source = Box::new(BodySource::new(input, file.imu.first()));
    let subject = Subject::Body { source, gravity_columns: false };
    let problem = Problem::new(&format!("{rig} {seed}"), file, subject);
    problem.fit(&FitOptions::default(), &Silent).unwrap()
}

/// Returns its factor.
pub fn factor(rig: u64, body: &Body, seed: u64, conditions: &Conditions) -> PooledFactor {
    PooledFactor::of(&fit(rig, body, seed, conditions), &format!("{rig} {seed}"))
}

/// Returns the factor of a recording with a rig whose instruments have this serial number.
#[allow(dead_code, reason = "the table has rigs of their own names alone")]
pub fn factor_named(rig: u64, serial: &str, body: &Body, seed: u64, conditions: &Conditions) -> PooledFactor {
    PooledFactor::of(&fit_named(rig, serial, body, seed, conditions), &format!("{rig} {seed}"))
}

/// A recording with five times the noise that is stated.
pub const NOISY: Conditions = Conditions { noisier: 5.0, ..Conditions::STATED };

/// A body of a tenth of its fixture, the fixture, and both.
pub fn on_fixture() -> [Body; 3] {
    [0.64, 6.4, 7.04].map(Body::of_mass)
}

/// Returns the fit of 0.64 kg on a fixture of 6.4 kg, whose own recording is taken off.
pub fn tared(rig: u64, seed: u64) -> Fit {
    let [_, bare, both] = on_fixture();
    let mut total = fit(rig, &both, seed, &Conditions::STATED);
    let tare = Tare::new(factor(rig, &bare, seed + 1, &Conditions::STATED)).unwrap();
    tare.take_off(&mut total).unwrap();
    total
}

/// Returns how far a fit is off.
pub fn off(fit: &Fit, body: &Body) -> Errors {
    let truth: BTreeMap<&str, f64> = TEN.into_iter().zip(body.parameters()).collect();
    let own = |(j, p): (usize, &Parameter)| {
        let measured = fit.estimate.measured(j)?;
        Some(((measured.value - truth.get(p.name.as_str())?) / measured.u95, measured.u95))
    };
    fit.parameters.iter().enumerate().filter_map(own).collect()
}

/// Returns how far wrenches are off that a fit predicts for a motion of its own, in U95, and this.
pub fn predicted_off(fit: &Fit, body: &Body) -> Errors {
    let at: Vec<usize> =
        TEN.iter().filter_map(|n| fit.parameters.iter().position(|p| p.name == *n)).collect();
    let motion = Motion::of_seed(u64::MAX, 1.0);
    let of_time = |t: f64| {
        let there = motion.at(t);
        let exact = wrench(&body.parameters(), &there);
        let slopes: Vec<[f64; 6]> =
            (0..10).map(|j| wrench(&std::array::from_fn(|k| f64::from(u8::from(k == j))), &there)).collect();
        let of_channel = |c: usize| {
            let (mut value, mut variance) = (0.0, 0.0);
            let mut weights = vec![0.0; fit.parameters.len()];
            at.iter().zip(&slopes).for_each(|(i, own)| weights[*i] = own[c]);
            for (own, i) in slopes.iter().zip(&at) {
                value += own[c] * fit.estimate.measured(*i)?.value;
                for (other, j) in slopes.iter().zip(&at) {
                    variance += own[c] * other[c] * fit.estimate.covariance(*i, *j)?;
                }
            }
            let u95 = fit.estimate.coverage_factor_of(&weights) * variance.sqrt();
            Some(((value - exact[c]) / u95, u95))
        };
        (0..6).filter_map(of_channel).collect::<Errors>()
    };
    [3.0, 7.0, 11.0].into_iter().flat_map(of_time).collect()
}

/// Returns how far the centre of mass and the tensor about it are off, in U95, and this.
pub fn central_off(fit: &Fit, body: &Body) -> Errors {
    let off = |value: f64, u95: f64, truth: f64| ((value - truth) / u95, u95);
    let (centre, central) = (centre_of_mass(&fit.estimate), inertia_com(&fit.estimate));
    let (c, i) = (body.com, body.central);
    let i = [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(1, 2)], i[(2, 0)], i[(0, 1)]];
    let of_centre = (0..3).map(|k| off(centre.value[k], centre.u95()[k], c[k]));
    of_centre.chain((0..6).map(|k| off(central.value[k], central.u95()[k], i[k]))).collect()
}

/// Returns how far sums of the parameters and differences are off, in U95, and this: of the first moments all
/// and the first less the second, of the moments of inertia likewise, and mass and first moment as at an edge
/// of 0.1 m.
pub fn sums_off(fit: &Fit, body: &Body) -> Errors {
    let sums: [&[(&str, f64)]; 5] = [
        &[("mcx", 1.0), ("mcy", 1.0), ("mcz", 1.0)],
        &[("mcx", 1.0), ("mcy", -1.0)],
        &[("Ixx", 1.0), ("Iyy", 1.0), ("Izz", 1.0)],
        &[("Ixx", 1.0), ("Iyy", -1.0)],
        &[("m", 0.1), ("mcz", -1.0)],
    ];
    let of = |terms: &&[(&str, f64)]| {
        let (mut weights, mut value, mut truth) = (vec![0.0; fit.parameters.len()], 0.0, 0.0);
        for (name, weight) in *terms {
            let at = fit.parameters.iter().position(|p| p.name == *name)?;
            weights[at] = *weight;
            value += weight * fit.estimate.measured(at)?.value;
            truth += weight * body.parameters()[TEN.iter().position(|own| own == name)?];
        }
        let all = |i: usize| (0..weights.len()).map(move |j| (i, j));
        let used = (0..weights.len()).flat_map(all).filter(|(i, j)| weights[*i] * weights[*j] != 0.0);
        let variance: f64 = used
            .map(|(i, j)| Some(weights[i] * weights[j] * fit.estimate.covariance(i, j)?))
            .sum::<Option<f64>>()?;
        let u95 = fit.estimate.coverage_factor_of(&weights) * variance.sqrt();
        Some(((value - truth) / u95, u95))
    };
    sums.iter().filter_map(of).collect()
}

/// Returns how far principal moments and the directions of their axes are off, in U95, and this.
pub fn principal_off(fit: &Fit, body: &Body) -> Errors {
    let found = principal(&inertia_com(&fit.estimate));
    let eigen = body.central.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let moment = |k: usize| {
        let u95 = found.moments_u95[k];
        ((found.moments[k] - eigen.eigenvalues[order[k]]) / u95, u95)
    };
    let axis = |k: usize| {
        let own = nalgebra::Vector3::from(found.axes[k]);
        let angle = own.cross(&eigen.eigenvectors.column(order[k])).norm().min(1.0).asin();
        (angle / found.axes_u95_rad[k], found.axes_u95_rad[k])
    };
    let known = |k: &usize| found.axes_u95_rad[*k].is_finite();
    (0..3).map(moment).chain((0..3).filter(known).map(axis)).collect()
}

/// Returns U95 of each parameter by `1.96` times the standard deviation of the best estimate, the geometric
/// mean over all.
pub fn by_best(all: &[Errors], best: &[Vec<f64>]) -> Vec<f64> {
    let mean = |j: usize| {
        let of = all.iter().zip(best).map(|(own, best)| (own[j].1 / (1.96 * best[j])).ln());
        (of.sum::<f64>() / all.len().min(best.len()) as f64).exp()
    };
    (0..best.first().map_or(0, Vec::len)).map(mean).collect()
}

/// Returns the share of truths outside U95.
pub fn outside(all: &[Errors]) -> f64 {
    let of: Vec<f64> = all.iter().flatten().map(|(off, _)| off.abs()).collect();
    of.iter().filter(|off| **off > 1.0).count() as f64 / of.len() as f64
}

/// Returns the root of the mean square of all errors, in standard deviations.
pub fn rms(all: &[Errors]) -> f64 {
    let of: Vec<f64> = all.iter().flatten().map(|(off, _)| (1.96 * off).powi(2)).collect();
    (of.iter().sum::<f64>() / of.len() as f64).sqrt()
}

/// Returns the geometric mean, over all parameters, of U95 by that of others.
pub fn larger(all: &[Errors], others: &[Errors]) -> f64 {
    let of = all.iter().flatten().zip(others.iter().flatten()).map(|(a, b)| (a.1 / b.1).ln());
    let of: Vec<f64> = of.collect();
    (of.iter().sum::<f64>() / of.len() as f64).exp()
}
