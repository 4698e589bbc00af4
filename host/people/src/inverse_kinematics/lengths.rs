//! Lengths of segments by joint centres, and whether lengths from elsewhere are those of the same person.

use nalgebra::{DMatrix, DVector, Vector3};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::skeleton::Skeleton;
use rigident_model::Model;
use rigident_model::human::Person;

/// The uncertainty of lengths that another program scaled by markers, 1 σ, m (assumed).
pub(super) const LENGTH_SIGMA_M: f64 = 0.015;
/// A length from elsewhere that is this many times the usual one for the stature is in another unit.
const OTHER_UNIT: f64 = 1.5;
/// Lengths that are less likely than this are another person's.
const SURPRISING: f64 = 1e-3;
/// A joint is moved by this much to see what lengths become, m.
const STEP_M: f64 = 1e-6;

/// A length from elsewhere that is another one.
pub(super) struct Other {
    pub name: String,
    pub given_m: f64,
    pub found_m: f64,
}

/// Returns the first length from elsewhere that is far from what is usual for the stature.
pub(super) fn unusual(given: &[(String, f64)], person: &Person) -> Option<Other> {
    given.iter().find_map(|(name, length)| {
        let usual = person.length(name)?;
        let is_far = length.max(usual) > OTHER_UNIT * length.min(usual);
        is_far.then(|| Other { name: name.clone(), given_m: *length, found_m: usual })
    })
}

/// Returns the worst of lengths from elsewhere if, all together or by itself, they contradict those of joints
/// that were found without them; `root` is that of what markers say of these.
pub(super) fn contradiction(
    given: &[(String, f64)],
    model: &Model,
    skeleton: &Skeleton,
    root: &DMatrix<f64>,
) -> Option<Other> {
    let sigma = sigma(model, skeleton, root);
    let compared = given.iter().filter_map(|(name, length)| {
        let (_, found, sigma) = sigma.iter().find(|(own, ..)| own == name)?;
        let other = Other { name: name.clone(), given_m: *length, found_m: *found };
        Some((other, ((length - found) / sigma.hypot(LENGTH_SIGMA_M)).powi(2)))
    });
    let compared: Vec<(Other, f64)> = compared.collect();
    let tail = |freedoms: f64, chi2: f64| ChiSquared::new(freedoms).map_or(1.0, |all| all.sf(chi2));
    let count = compared.len() as f64;
    let all = tail(count, compared.iter().map(|(_, square)| square).sum());
    let (other, worst) = compared.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (all.min(count * tail(1.0, worst)) < SURPRISING / 2.0).then_some(other)
}

/// Returns the lengths of segments, m, each with 1 σ by the markers' information on the joints.
fn sigma(model: &Model, skeleton: &Skeleton, root: &DMatrix<f64>) -> Vec<(String, f64, f64)> {
    let found = lengths(model, skeleton);
    let joints = model.links.len() - 1;
    let mut gradients = vec![DVector::zeros(root.nrows()); found.len()];
    for k in 0..3 * joints {
        let mut moved = skeleton.clone();
        moved.shift(1 + k / 3, &Vector3::ith(k % 3, STEP_M));
        let own = lengths(model, &moved);
        for ((gradient, own), found) in gradients.iter_mut().zip(own).zip(&found) {
            gradient[k] = (own.1 - found.1) / STEP_M;
        }
    }
    let with = |((name, length), gradient): ((String, f64), DVector<f64>)| {
        let sigma = root.solve_lower_triangular(&gradient).map_or(f64::INFINITY, |v| v.norm());
        (name, length, sigma)
    };
    found.into_iter().zip(gradients).map(with).collect()
}

/// Returns the lengths of segments between joint centres, m.
pub(super) fn lengths(model: &Model, skeleton: &Skeleton) -> Vec<(String, f64)> {
    let at = |name: &str| model.link(name).map(|i| skeleton.links()[i].position);
    let both = |names: [&str; 2]| {
        let found: Vec<f64> = names.iter().filter_map(|n| Some(at(n)?.norm())).collect();
        (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
    };
    let apart = |names: [&str; 2]| Some((at(names[0])? - at(names[1])?).norm());
    let mut found = vec![
        ("thigh", both(["l_shank", "r_shank"])),
        ("shank", both(["l_foot", "r_foot"])),
        ("upper_arm", both(["l_forearm", "r_forearm"]).or_else(|| both(["l_ulna", "r_ulna"]))),
        ("forearm", both(["l_hand", "r_hand"])),
        ("hip_width", apart(["l_thigh", "r_thigh"])),
        ("lower_trunk", at("torso").or_else(|| at("lumbar")).map(|p| p.z)),
    ];
    if model.link("torso").is_some() {
        found.push(("shoulder_width", apart(["l_upper_arm", "r_upper_arm"])));
    }
    found.into_iter().filter_map(|(name, length)| Some((name.to_owned(), length?))).collect()
}
