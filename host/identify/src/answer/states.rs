//! States of parameters: one rule for every kind of body.
//!
//! A parameter is *identified* if the data alone determine it at the noise level: its column is independent
//! of the others, its 95 % uncertainty is at most [`LARGEST_SHARE`] of its owner's scale, never of its own
//! value (a true zero is identified), and a moment of inertia has [`LEAST_EXCITATION`] times the information
//! that noise of the rates alone would bring. It is *prior-dominated* if it is so only together with what was
//! known beforehand, else *not identified*. The scale is always that of all that is known: a known mass sets
//! the scale of the first moments, it does not measure them.
//!
//! One scale per owner and kind:
//! - One whole body, of which all ten parameters are columns: its mass m, its first moment m ℓ and its
//!   largest principal moment, with ℓ its size, bounded from below by a sphere of steel. Its mass must be
//!   known, or there is no scale. Its tensor is identified only if that about its centre of mass is, too, by
//!   its own largest principal moment, and its first moments only if the centre of mass is, by the radius of
//!   gyration about it: so nothing depends on where the origin is.
//! - A link of which there are base parameters: of each kind the largest, as estimated less its uncertainty,
//!   or as the nominal model has it; where first moments vanish, the moments of inertia over the link's
//!   length take their place. The rule for one body cannot be used, because a base parameter sums several
//!   links' and no mass may be among them.
//! - An offset of the wrench: the weight of one whole body, and its moment m g ℓ; without one, the measured
//!   forces or moments.
//! - A drive: its measured effort, over its measured rate for viscous friction; the largest moment of inertia
//!   for a rotor.
//! - Anything else: the largest value of its owner in the same unit.

use std::collections::BTreeMap;

use nalgebra::DVector;

use super::context::Links;
use super::derived::{centre_of_mass, inertia_com, ten};
use super::drive_signs::of_impossible_sign;
use super::result::ParameterState;
pub use rigident_fit::LEAST_EXCITATION;
use rigident_fit::{Estimate, Fit, Kind, Measured, Owner, Parameter};
use rigident_model::Model;

/// U95 of an identified parameter is at most this share of the body's scale.
pub const LARGEST_SHARE: f64 = 0.1;

/// Density of the most compact body considered, kg/m³ (steel): the sphere of the estimated mass bounds the
/// body's size from below when neither its centre of mass nor its tensor does.
const DENSITY: f64 = 7850.0;

/// The scales of one whole body, against which uncertainties are judged.
pub(super) struct BodyScale {
    /// Mass, kg.
    mass: f64,
    /// m·ℓ, kg m.
    first_moment: f64,
    /// The largest principal moment, kg m².
    moment: f64,
    /// ℓ, m.
    length: f64,
}

impl BodyScale {
    /// Returns the scale of a body of ten parameters; `None` if there is no mass: then there is no scale for
    /// anything else.
    pub(super) fn of(estimate: &Estimate, spurious: f64) -> Option<Self> {
        let phi = ten(estimate);
        let mass = phi[0];
        if mass.is_nan() || mass <= 0.0 || estimate.u95(0) > LARGEST_SHARE * mass {
            return None;
        }
        let sphere = sphere_radius(mass);
        let arm = phi[1..4].iter().map(|v| v * v).sum::<f64>().sqrt() / mass;
        let arm_known = (1..4).all(|j| estimate.u95(j) <= LARGEST_SHARE * mass * arm);
        let largest_moment = largest_moment(estimate, spurious);
        let gyration = (largest_moment / mass).max(0.0).sqrt();
        let length = sphere.max(if arm_known { arm } else { 0.0 }).max(gyration);
        Some(Self {
            mass,
            first_moment: mass * length,
            moment: largest_moment.max(0.4 * mass * sphere * sphere),
            length,
        })
    }

    /// Returns [`Self::of`], or the scale of a compact body of about the mass where the mass is not known:
    /// enough for words.
    pub(super) fn rough(estimate: &Estimate, spurious: f64) -> Self {
        Self::of(estimate, spurious).unwrap_or_else(|| {
            let [mass, ..] = ten(estimate);
            let mass = if mass.is_finite() && mass > 0.0 { mass } else { 1.0 };
            let sphere = sphere_radius(mass);
            let moment = largest_moment(estimate, spurious).max(0.4 * mass * sphere * sphere);
            let length = sphere.max((moment / mass).sqrt());
            Self { mass, first_moment: mass * length, moment, length }
        })
    }

    /// Returns the quantity that an uncertainty of parameter `j` is judged against, in its unit.
    pub(super) fn of_parameter(&self, j: usize) -> f64 {
        let weight = self.mass * 9.80665;
        match j {
            0 => self.mass,
            1..4 => self.first_moment,
            4..10 => self.moment,
            10..13 => weight,
            _ => weight * self.length,
        }
    }

    /// Returns the quantity that the uncertainty of a tensor about the centre of mass is judged against, as
    /// far as it is known: its largest principal moment, no smaller than that of a sphere, kg m².
    pub(super) fn central_moment(&self, estimate: &Estimate) -> f64 {
        if !(0..10).all(|j| estimate.is_determined(j)) {
            return self.moment;
        }
        let central = rigident_shared::inertia::tensor_from_elements(inertia_com(estimate).value);
        let sphere = sphere_radius(self.mass);
        central.symmetric_eigenvalues().max().max(0.4 * self.mass * sphere * sphere).min(self.moment)
    }

    /// Returns the weight for an offset in N, its moment for one in N m.
    fn of_offset(&self, unit: &str) -> f64 {
        self.of_parameter(if unit == "N" { 10 } else { 13 })
    }
}

/// Returns the largest principal moment; where not all of the tensor is informed, the largest moment about an
/// axis of S that is, less its uncertainty: the largest principal moment is no smaller. Zero if there is
/// none.
fn largest_moment(estimate: &Estimate, spurious: f64) -> f64 {
    let (phi, informed) = (ten(estimate), informed_of_body(estimate, spurious));
    if informed == [true; 6] {
        return rigident_shared::inertia::tensor_from_elements(std::array::from_fn(|k| phi[4 + k]))
            .symmetric_eigenvalues()
            .max();
    }
    let at_least = |j: usize| phi[j] - estimate.u95(j);
    (4..7).filter(|j| informed[*j - 4]).map(at_least).fold(0.0, f64::max)
}

/// Returns the radius of the sphere of [`DENSITY`], m.
fn sphere_radius(mass: f64) -> f64 {
    (3.0 * mass / (4.0 * std::f64::consts::PI * DENSITY)).cbrt()
}

/// Returns how many of the ten parameters of one whole body are identified without a gap, by the rule of this
/// module: the mass, the first moments, the tensor. `spurious` is the information that noise of the rates
/// alone brings to a moment of inertia, 1/(kg m²)².
pub fn identified_of_body(estimate: &Estimate, spurious: f64) -> usize {
    let Some(scale) = BodyScale::of(estimate, spurious) else { return 0 };
    let informed = informed_of_body(estimate, spurious);
    let resolved = |j: &usize| {
        let is_informed = j.checked_sub(4).and_then(|k| informed.get(k)).is_none_or(|informed| *informed);
        estimate.is_determined(*j)
            && is_informed
            && estimate.u95(*j) <= LARGEST_SHARE * scale.of_parameter(*j)
    };
    let count = (0..10).take_while(resolved).count();
    count.min(1 + resolves_central(estimate).iter().take_while(|resolved| **resolved).count())
}

/// Returns which coordinates of the centre of mass are resolved by the radius of gyration about it, and which
/// elements of the tensor about it by its own largest principal moment: those about a far origin are mostly
/// the mass times a distance, and its square. All, where a parameter is not determined and there is no such
/// tensor.
fn resolves_central(estimate: &Estimate) -> [bool; 9] {
    if !(0..10).all(|j| estimate.is_determined(j)) {
        return [true; 9];
    }
    let mass = ten(estimate)[0];
    let (central, centre) = (inertia_com(estimate), centre_of_mass(estimate));
    let (of_tensor, of_centre) = (central.u95(), centre.u95());
    let within = |largest: f64| {
        let radius = (largest / mass).max(0.0).sqrt().max(sphere_radius(mass));
        std::array::from_fn(|k| match k.checked_sub(3) {
            None => of_centre[k] <= LARGEST_SHARE * radius,
            Some(k) => of_tensor[k] <= LARGEST_SHARE * largest,
        })
    };
    let tensor = rigident_shared::inertia::tensor_from_elements(central.value);
    let all = within(tensor.symmetric_eigenvalues().max());
    if all[3..] == [true; 6] {
        return all;
    }
    // The largest principal moment is no smaller than any about an axis.
    within((0..3).map(|k| central.value[k] - of_tensor[k]).fold(0.0, f64::max))
}

/// Returns true if a tensor element has more information than the gyro's noise brings.
fn tensor_informed(estimate: &Estimate, spurious: f64, j: usize) -> bool {
    estimate.is_determined(j) && 1.0 / estimate.unjudged().covariance[(j, j)] > LEAST_EXCITATION * spurious
}

/// Returns the same of the elements of one whole body, of the tensor about its centre of mass where there is
/// one: that about a far origin is as uncertain as the distance is.
fn informed_of_body(estimate: &Estimate, spurious: f64) -> [bool; 6] {
    if !(0..10).all(|k| estimate.is_determined(k)) {
        return std::array::from_fn(|k| tensor_informed(estimate, spurious, 4 + k));
    }
    inertia_com(estimate).sd.map(|sd| 1.0 / (sd * sd) > LEAST_EXCITATION * spurious)
}

/// Kinds of the ten parameters of a whole body, in their order.
const BODY: [Kind; 10] = {
    let mut kinds = [Kind::Inertia; 10];
    kinds[0] = Kind::Mass;
    (kinds[1], kinds[2], kinds[3]) = (Kind::FirstMoment, Kind::FirstMoment, Kind::FirstMoment);
    kinds
};

/// Returns true if the first ten parameters are those of one whole body, and there is no other link.
pub fn is_whole_body(fit: &Fit) -> bool {
    let of_links = || fit.parameters.iter().filter(|p| matches!(p.owner, Owner::Link(_)));
    let own = fit.parameters.first().map(|p| &p.owner);
    of_links().count() == 10
        && of_links().all(|p| Some(&p.owner) == own)
        && fit.parameters.iter().zip(BODY).all(|(p, kind)| p.kind == kind)
        && fit.parameters.len() >= 10
}

/// Returns true if the data alone determine the mass of one whole body, and it is negative: a sign or an axis
/// is wrong, and no motion would help.
pub(super) fn is_reversed(data: &Estimate) -> bool {
    let mass = ten(data)[0];
    mass < 0.0 && data.u95(0) <= LARGEST_SHARE * -mass
}

/// Returns the state of every parameter. With `reversed` the bodies would have negative mass, and nothing is
/// identified.
pub fn states(fit: &Fit, links: Option<&Links>, reversed: bool) -> Vec<ParameterState> {
    if reversed {
        return vec![ParameterState::NotIdentified; fit.parameters.len()];
    }
    let scales = scales(fit, links);
    let (all, data) = (&fit.estimate, fit.data_alone());
    let is_whole = is_whole_body(fit);
    let central = [data, all].map(|own| if is_whole { resolves_central(own) } else { [true; 9] });
    let informed = [data, all].map(|own| is_whole.then(|| informed_of_body(own, fit.spurious_information)));
    let resolves = |of_all: bool, j: usize, scale: f64| {
        let estimate = if of_all { all } else { data };
        let of_centre = j.checked_sub(1).and_then(|k| central[usize::from(of_all)].get(k));
        let of_tensor = informed[usize::from(of_all)].as_ref().zip(j.checked_sub(4));
        let is_informed = match of_tensor.and_then(|(informed, k)| informed.get(k)) {
            Some(informed) => *informed,
            None => is_informed(fit, estimate, j),
        };
        is_informed && estimate.u95(j) <= LARGEST_SHARE * scale && of_centre.is_none_or(|resolved| *resolved)
    };
    let impossible = of_impossible_sign(fit);
    (0..fit.parameters.len())
        .map(|j| match (scales.get(j).copied().flatten(), all.measured(j)) {
            _ if impossible.contains(&j) => ParameterState::NotIdentified,
            (Some(scale), Some(measured)) if resolves(false, j, scale) => {
                ParameterState::Identified(measured)
            }
            (Some(scale), Some(measured)) if resolves(true, j, scale) => {
                ParameterState::PriorDominated(measured)
            }
            _ => ParameterState::NotIdentified,
        })
        .collect()
}

/// Returns true unless a link's moment of inertia has no more information than noise of the rates brings.
fn is_informed(fit: &Fit, estimate: &Estimate, j: usize) -> bool {
    let Some(parameter) = fit.parameters.get(j) else { return false };
    if parameter.kind != Kind::Inertia || !matches!(parameter.owner, Owner::Link(_)) {
        return true;
    }
    tensor_informed(estimate, fit.spurious_information, j)
}

/// Returns the scale that each parameter's uncertainty is judged against, in its unit; `None` where there is
/// none.
pub(super) fn scales(fit: &Fit, links: Option<&Links>) -> Vec<Option<f64>> {
    let body = is_whole_body(fit).then(|| BodyScale::of(&fit.estimate, fit.spurious_information));
    let of_links = match body {
        Some(_) => BTreeMap::new(),
        None => link_scales(&fit.parameters, &fit.estimate, links),
    };
    (0..fit.parameters.len())
        .map(|j| {
            let parameter = &fit.parameters[j];
            match (&body, &parameter.owner) {
                (Some(body), Owner::Link(_)) => body.as_ref().map(|body| body.of_parameter(j)),
                (Some(body), Owner::Channel(_)) => body.as_ref().map(|body| body.of_offset(&parameter.unit)),
                (None, Owner::Link(link)) => of_links.get(&(link.clone(), parameter.kind)).copied(),
                (None, Owner::Channel(_)) => Some(measured_in_group(fit, j)),
                (_, Owner::Drive(name)) => Some(drive_scale(fit, links, &of_links, j, name)),
                (_, Owner::Other(_)) => Some(largest_value(fit, j)),
            }
        })
        .collect()
}

/// Returns |value| less its uncertainty, as far as the rows determine it; else zero.
fn at_least(estimate: &Estimate, j: usize) -> f64 {
    estimate.measured(j).map_or(0.0, |m: Measured| m.value.abs() - m.u95)
}

/// Returns the scales of links by kind.
pub fn link_scales(
    parameters: &[Parameter],
    estimate: &Estimate,
    links: Option<&Links>,
) -> BTreeMap<(String, Kind), f64> {
    let nominal = links.and_then(nominal_base);
    let mut scales: BTreeMap<(String, Kind), f64> = BTreeMap::new();
    for (j, parameter) in parameters.iter().enumerate() {
        let Owner::Link(link) = &parameter.owner else { continue };
        let assumed = nominal.as_ref().and_then(|n| n.get(j)).map_or(0.0, |n| n.abs());
        let scale = scales.entry((link.clone(), parameter.kind)).or_insert(0.0);
        *scale = scale.max(at_least(estimate, j)).max(assumed);
    }
    // m ℓ where first moments vanish: I / ℓ.
    for link in links.iter().flat_map(|links| &links.model.links) {
        let length = links.map_or(0.0, |links| length(links.model, &link.name));
        let moment = scales.get(&(link.name.clone(), Kind::Inertia)).copied().unwrap_or(0.0);
        if length > 0.0
            && let Some(first) = scales.get_mut(&(link.name.clone(), Kind::FirstMoment))
        {
            *first = first.max(moment / length);
        }
    }
    scales
}

/// Returns the longest way from a link's origin to a joint of its own; of a link without, that of its joint
/// from its parent.
fn length(model: &Model, name: &str) -> f64 {
    let Some(i) = model.link(name) else { return 0.0 };
    let below = model.links.iter().enumerate().skip(1).filter(|(_, l)| l.link.parent == i);
    let longest = below.map(|(_, l)| l.link.position.norm()).fold(0.0, f64::max);
    if longest > 0.0 || i == 0 { longest } else { model.links[i].link.position.norm() }
}

/// Returns the base parameters of the nominal model; `None` if a link has no nominal parameters.
pub(super) fn nominal_base(links: &Links) -> Option<Vec<f64>> {
    let skip = (10 * links.model.links.len()).checked_sub(links.base.standard.len())?;
    if links.model.links.iter().skip(skip / 10).any(|l| l.nominal.is_none()) {
        return None;
    }
    let nominal = links.model.nominal();
    let product = links.base.map() * DVector::from_column_slice(nominal.get(skip..)?);
    Some(product.iter().copied().collect())
}

/// Returns the root of the summed mean squares of the channels in the group of an offset's channel.
fn measured_in_group(fit: &Fit, offset: usize) -> f64 {
    let own = fit.channels.iter().find(|c| c.channel.offset == Some(offset)).map(|c| c.channel.group);
    let group = fit.channels.iter().filter(|c| Some(c.channel.group) == own);
    group.map(|c| c.measured_rms * c.measured_rms).sum::<f64>().sqrt()
}

/// Returns the scale of a drive's parameter `j`.
fn drive_scale(
    fit: &Fit,
    links: Option<&Links>,
    of_links: &BTreeMap<(String, Kind), f64>,
    j: usize,
    name: &str,
) -> f64 {
    let motion = links.and_then(|links| links.drives.iter().find(|d| d.name == name));
    let is_own = |channel: &str| match motion {
        Some(motion) => motion.channels.iter().any(|c| c == channel),
        None => channel == name,
    };
    let own = fit.channels.iter().filter(|c| is_own(&c.channel.name));
    let effort = own.map(|c| c.measured_rms).fold(0.0, f64::max);
    match fit.parameters[j].kind {
        Kind::Coulomb | Kind::Offset => effort,
        Kind::Load => 1.0,
        Kind::Viscous => match motion {
            Some(motion) => effort / motion.rms_rate.max(f64::MIN_POSITIVE),
            None => largest_value(fit, j),
        },
        Kind::Rotor => {
            let moments = of_links.iter().filter_map(|(key, v)| (key.1 == Kind::Inertia).then_some(*v));
            moments.fold(at_least(&fit.estimate, j), f64::max)
        }
        _ => largest_value(fit, j),
    }
}

/// Returns the largest value of the same owner in the same unit, less its uncertainty.
fn largest_value(fit: &Fit, j: usize) -> f64 {
    let own = &fit.parameters[j];
    let alike = fit.parameters.iter().enumerate().filter(|(_, p)| p.owner == own.owner && p.unit == own.unit);
    alike.map(|(k, _)| at_least(&fit.estimate, k)).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;
    use rigident_shared::inertia::{InertialParameters, tensor_from_elements};
    use rigident_shared::spatial::{Position, Sensor};

    use super::*;

    /// The same knowledge about another origin says the same of the tensor.
    #[test]
    fn a_tensor_is_identified_wherever_the_origin_is() {
        let central = tensor_from_elements([0.02, 0.018, 0.012, 0.0, 0.0, 0.0]);
        let known = |away: f64, u95_of_central: f64| {
            let at = |arm: f64| {
                InertialParameters::<Sensor, f64>::from_centre_of_mass(
                    3.2,
                    Position::new(arm, 0.0, 0.0),
                    central,
                )
                .to_vector()
            };
            // Mass, place and tensor about the centre of mass, each with its own uncertainty.
            let of = |q: &[f64]| {
                let i = tensor_from_elements(std::array::from_fn(|k| q[4 + k]));
                let c = nalgebra::Vector3::new(q[1], q[2], q[3]);
                let about = i + q[0] * (nalgebra::Matrix3::identity() * c.norm_squared() - c * c.transpose());
                let e = [about.m11, about.m22, about.m33, about.m23, about.m31, about.m12];
                DVector::from_fn(10, |k, _| match k {
                    0 => q[0],
                    1..4 => q[0] * q[k],
                    _ => e[k - 4],
                })
            };
            let q = [3.2, away, 0.0, 0.0, 0.02, 0.018, 0.012, 0.0, 0.0, 0.0];
            let sd = [1e-3, 1e-5, 1e-5, 1e-5];
            let j = DMatrix::from_fn(10, 10, |i, k| {
                let h = 1e-6;
                let (mut up, mut down) = (q, q);
                up[k] += h;
                down[k] -= h;
                (of(&up)[i] - of(&down)[i]) / (2.0 * h)
            });
            let variances =
                DVector::from_fn(
                    10,
                    |k, _| if k < 4 { sd[k] * sd[k] } else { (u95_of_central / 1.96).powi(2) },
                );
            Estimate::of_bound(at(away).to_vec(), &j * DMatrix::from_diagonal(&variances) * j.transpose())
        };
        for away in [0.0, 0.05, 0.7] {
            assert_eq!(identified_of_body(&known(away, 0.0015), 0.0), 10, "{away}");
            assert_eq!(identified_of_body(&known(away, 0.0030), 0.0), 4, "{away}");
        }
    }

    fn estimate(u95: [f64; 10]) -> Estimate {
        let body = InertialParameters::<Sensor, f64>::from_centre_of_mass(
            20.0,
            Position::new(0.0, 0.0, 0.053),
            tensor_from_elements([0.38, 0.02, 0.38, 0.0, 0.0, 0.0]),
        );
        let variances = DVector::from_fn(10, |j, _| (u95[j] / 1.96).powi(2));
        let estimate = Estimate::of_bound(body.to_vector().to_vec(), DMatrix::from_diagonal(&variances));
        let open = (0..10).filter(|j| !u95[*j].is_finite());
        open.fold(estimate, Estimate::without)
    }

    fn identified(estimate: &Estimate, spurious: f64) -> Vec<bool> {
        let Some(scale) = BodyScale::of(estimate, spurious) else { return vec![false; 10] };
        let informed = informed_of_body(estimate, spurious);
        let own = |j: usize| estimate.u95(j) <= LARGEST_SHARE * scale.of_parameter(j);
        (0..10).map(|j| own(j) && (j < 4 || informed[j - 4])).collect()
    }

    #[test]
    fn a_true_zero_is_identified_when_its_interval_is_small_against_the_body() {
        let e = estimate([0.03, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3]);
        assert_eq!(identified(&e, 0.0), vec![true; 10]);
    }

    #[test]
    fn an_element_within_its_own_interval_of_nothing_is_not() {
        let mut u95 = [0.03, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3];
        u95[6] = 0.2;
        let states = identified(&estimate(u95), 0.0);
        assert!(!states[6] && states[5]);
    }

    #[test]
    fn information_that_the_gyro_noise_explains_identifies_nothing() {
        let e = estimate([0.03, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3]);
        let own = (1.96 / 8e-3_f64).powi(2);
        let states = identified(&e, own);
        assert_eq!(states, [vec![true; 4], vec![false; 6]].concat());
    }

    #[test]
    fn a_negative_mass_is_reversed_only_if_the_data_determine_it() {
        let e = estimate([0.03, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3]);
        assert!(!is_reversed(&e));
        let of_mass = |mass: f64| {
            let mut values = e.unjudged().values.to_vec();
            values[0] = mass;
            e.clone().at(values)
        };
        assert!(is_reversed(&of_mass(-20.0)));
        // Within half of its own size of nothing it may be the noise.
        assert!(!is_reversed(&of_mass(-0.06)));
        assert!(!is_reversed(&of_mass(-20.0).without(0)));
    }

    #[test]
    fn without_mass_there_is_no_scale() {
        let e = estimate([f64::INFINITY, 5e-3, 5e-3, 5e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3, 8e-3]);
        assert_eq!(identified(&e, 0.0), vec![false; 10]);
    }
}
