//! What a nominal model lets expect of base parameters.

use nalgebra::{DMatrix, DVector};

use rigident_fit::Gaussian;
use rigident_model::Model;
use rigident_model::base::BaseParameters;

/// Parameters of a link.
const TEN: usize = 10;
/// What nothing is known of may be this many times as large as anything.
const ANYTHING: f64 = 100.0;

/// Returns the distribution of the base parameters if every link is as heavy as the model has it within a
/// share (1 σ), its centre where that has it within the share of its radius of gyration, and its tensor
/// likewise, each link by itself; rotors may be anything. `None` if the model has no masses.
pub fn expected(base: &BaseParameters, nominal: &Model, share: f64) -> Option<Gaussian> {
    let bodies = nominal.welded();
    let skip = (TEN * bodies.links.len()).saturating_sub(base.standard.len());
    let count = base.standard.len();
    let (mut mean, mut covariance) = (DVector::zeros(count), DMatrix::zeros(count, count));
    for (i, link) in bodies.links.iter().enumerate() {
        let Some((phi, at)) = link.nominal.zip((TEN * i).checked_sub(skip)) else { continue };
        if phi[0] <= 0.0 || at + TEN > count {
            continue;
        }
        let square: f64 = phi[1..4].iter().map(|moment| moment * moment / phi[0]).sum();
        // Moments of inertia about the origin add up to twice ∫ r² dm.
        let about_centre = (0.5 * phi[4..7].iter().sum::<f64>() - square).max(0.0);
        let first_moment = (phi[0] * about_centre).sqrt();
        let own = |k: usize| match k {
            0 => 0.0,
            1..4 => share * first_moment,
            _ => share * about_centre,
        };
        for k in 0..TEN {
            mean[at + k] = phi[k];
            for l in 0..TEN {
                covariance[(at + k, at + l)] = share * share * phi[k] * phi[l];
            }
            covariance[(at + k, at + k)] += own(k).powi(2);
        }
    }
    let (map, rotors) = (base.map(), base.rotor_map());
    let of_base = &map * &mean;
    let mut spread = &map * covariance * map.transpose();
    let largest = of_base.amax();
    if largest == 0.0 {
        return None;
    }
    spread += &rotors * rotors.transpose() * (ANYTHING * largest).powi(2);
    // Of links without mass nothing is expected; a distribution needs a width.
    for k in 0..spread.nrows() {
        spread[(k, k)] += (1e-6 * largest).powi(2);
    }
    let names = base.parameters.iter().map(|parameter| parameter.name.clone()).collect();
    Gaussian::new(names, of_base, spread)
}
