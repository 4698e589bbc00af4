//! What of a tree is identified, and in words why the rest is not.
//!
//! *Identified* means what it means of one body: the data alone determine a parameter, its 95 % uncertainty is small
//! against the link's scale, never against its own value, and its information is not that of the rates' noise.
//!
//! A link's scale is taken from what there is of it: of each kind (mass, first moments, moments of inertia) the largest
//! base parameter, as estimated less its uncertainty, or as the nominal model has it; where first moments vanish, the
//! moments of inertia over the link's length take their place.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::DVector;

use super::possible::Possible;
use super::{Input, TreeIdentification};
use crate::answer::identifiability::{LARGEST_SHARE, LEAST_EXCITATION};
use crate::answer::result::{Measured, ParameterState};
use crate::model::Finding;

/// Base parameters' kinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    Mass,
    First,
    Moment,
}

/// Where a parameter belongs.
#[derive(Clone, Debug, PartialEq)]
enum Place {
    Link(String, Kind),
    Offset(usize),
    Drive(Vec<usize>, super::drive::Term),
}

fn places(input: &Input, found: &TreeIdentification) -> Vec<Place> {
    let mut places: Vec<Place> = found
        .base
        .parameters
        .iter()
        .map(|p| {
            let kind = match p.terms.first().map_or(0, |t| t.0 % 10) {
                0 => Kind::Mass,
                1..4 => Kind::First,
                _ => Kind::Moment,
            };
            Place::Link(p.name.rsplit_once('.').map_or(String::new(), |(link, _)| link.to_owned()), kind)
        })
        .collect();
    if input.has_wrench() && input.known_offset.is_none() {
        places.extend((0..6).map(Place::Offset));
    }
    for drive in input.drives.iter().filter(|_| input.has_efforts()) {
        let freedoms: Vec<usize> = drive.rates.iter().map(|r| r.0).collect();
        places.extend(drive.terms.iter().map(|t| Place::Drive(freedoms.clone(), *t)));
    }
    places
}

/// Scales of the links by kind.
fn scales(input: &Input, found: &TreeIdentification, places: &[Place]) -> BTreeMap<(String, Kind), f64> {
    let nominal = nominal_base(input, found);
    let mut scales: BTreeMap<(String, Kind), f64> = BTreeMap::new();
    for (j, place) in places.iter().enumerate() {
        let Place::Link(link, kind) = place else { continue };
        let estimated = found.estimate.measured(j).map_or(0.0, |m| m.value.abs() - m.u95);
        let assumed = nominal.as_ref().map_or(0.0, |n| n[j].abs());
        let scale = scales.entry((link.clone(), *kind)).or_insert(0.0);
        *scale = scale.max(estimated).max(assumed);
    }
    // m ℓ where first moments vanish: I / ℓ.
    for link in &input.model.links {
        let length = length(input, &link.name);
        let moment = scales.get(&(link.name.clone(), Kind::Moment)).copied().unwrap_or(0.0);
        if length > 0.0
            && let Some(first) = scales.get_mut(&(link.name.clone(), Kind::First))
        {
            *first = first.max(moment / length);
        }
    }
    scales
}

/// The longest way from a link's origin to a joint of its own; of a link without, that of its joint from its parent.
fn length(input: &Input, name: &str) -> f64 {
    let Some(i) = input.model.link(name) else { return 0.0 };
    let below = input.model.links.iter().enumerate().skip(1).filter(|(_, l)| l.link.parent == i);
    let longest = below.map(|(_, l)| l.link.position.norm()).fold(0.0, f64::max);
    if longest > 0.0 || i == 0 { longest } else { input.model.links[i].link.position.norm() }
}

/// Base parameters of the nominal model; `None` if a link has no nominal parameters.
fn nominal_base(input: &Input, found: &TreeIdentification) -> Option<Vec<f64>> {
    let skip = 10 * input.model.links.len() - found.base.standard.len();
    if input.model.links.iter().skip(skip / 10).any(|l| l.nominal.is_none()) {
        return None;
    }
    let nominal = input.model.nominal();
    let product = found.base.map() * DVector::from_column_slice(&nominal[skip..]);
    Some(product.iter().copied().collect())
}

/// What became of each parameter. Nothing is identified if the bodies would have negative mass.
pub fn states(input: &Input, found: &TreeIdentification, possible: Option<&Possible>) -> Vec<ParameterState> {
    if possible.is_some_and(|p| p.reversed) {
        return vec![ParameterState::NotIdentified; found.names.len()];
    }
    let places = places(input, found);
    let scales = scales(input, found, &places);
    let informed = |j: usize| {
        let information = 1.0 / found.estimate.covariance[(j, j)];
        information > LEAST_EXCITATION * found.regressor_noise.tensor_information
    };
    let first_channel = if input.has_wrench() { 6 } else { 0 };
    let channel = |k: usize| found.measured_rms.get(k).copied().unwrap_or(0.0);
    let group = |from: usize| (from..from + 3).map(channel).map(|v| v * v).sum::<f64>().sqrt();
    let fastest = |freedoms: &[usize]| {
        let squares = input
            .frames
            .iter()
            .map(|f| freedoms.iter().map(|k| f.rates.get(*k).copied().unwrap_or(0.0)).sum::<f64>().powi(2));
        (squares.sum::<f64>() / input.frames.len().max(1) as f64).sqrt()
    };
    (0..found.names.len())
        .map(|j| {
            let Some(Measured { value, u95 }) = found.estimate.measured(j) else {
                return ParameterState::NotIdentified;
            };
            use super::drive::Term;
            let most = match &places[j] {
                Place::Link(link, kind) => {
                    if *kind == Kind::Moment && !informed(j) {
                        return ParameterState::NotIdentified;
                    }
                    scales.get(&(link.clone(), *kind)).copied().unwrap_or(0.0)
                }
                // As of one body: against the weight, and against its moments.
                Place::Offset(k) => group(if *k < 3 { 0 } else { 3 }),
                Place::Drive(freedoms, term) => {
                    let effort = freedoms.iter().map(|k| channel(first_channel + k)).fold(0.0, f64::max);
                    match term {
                        Term::Coulomb | Term::Offset => effort,
                        Term::Viscous => effort / fastest(freedoms).max(f64::MIN_POSITIVE),
                        Term::Rotor => {
                            let of_link =
                                |(key, v): (&(String, Kind), &f64)| (key.1 == Kind::Moment).then_some(*v);
                            scales.iter().filter_map(of_link).fold(value.abs() - u95, f64::max)
                        }
                    }
                }
            };
            if u95 <= LARGEST_SHARE * most {
                ParameterState::Identified(Measured { value, u95 })
            } else {
                ParameterState::NotIdentified
            }
        })
        .collect()
}

/// Why what is not identified is not, link by link.
pub fn reasons(
    input: &Input,
    found: &TreeIdentification,
    states: &[ParameterState],
    idle: &[Finding],
) -> Vec<String> {
    let mut said: Vec<String> = idle.iter().map(ToString::to_string).collect();
    let open: BTreeSet<usize> =
        (0..states.len()).filter(|j| states[*j] == ParameterState::NotIdentified).collect();
    let list = |all: &[usize]| all.iter().map(|j| found.names[*j].as_str()).collect::<Vec<_>>().join(", ");
    let never: Vec<usize> =
        open.iter().copied().filter(|j| found.estimate.determined.get(*j) == Some(&false)).collect();
    let together: BTreeSet<usize> = found.lost.iter().flatten().map(|part| part.0).collect();
    let (shared, alone): (Vec<usize>, Vec<usize>) = never.iter().partition(|j| together.contains(j));
    if !alone.is_empty() {
        said.push(format!("not excited at all: {}; nothing in this motion depends on them", list(&alone)));
    }
    if !shared.is_empty() {
        let count = found.lost.len();
        said.push(format!(
            "the rows see only {} of {}: {} {} open",
            if shared.len() > count {
                format!("{} combinations", shared.len() - count)
            } else {
                "nothing".to_owned()
            },
            list(&shared),
            count,
            if count == 1 { "combination stays" } else { "combinations stay" }
        ));
    }
    let places = places(input, found);
    let mut weak: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for j in open.iter().filter(|j| !never.contains(j)) {
        let at = match &places[*j] {
            Place::Link(link, _) => format!("link {link}"),
            Place::Offset(_) => "the wrench's offset".to_owned(),
            Place::Drive(freedoms, _) => {
                let names = input.freedom_names();
                format!(
                    "drive of {}",
                    freedoms.iter().filter_map(|k| names.get(*k)).cloned().collect::<Vec<_>>().join(" and ")
                )
            }
        };
        weak.entry(at).or_default().push(*j);
    }
    for (at, parameters) in weak {
        said.push(format!(
            "{at}: {} {} too weakly excited: the 95 % uncertainty is above {:.0} % of the link's own scale, or no more than \
             noise of the rates explains; move it faster, or in more directions",
            list(&parameters),
            if parameters.len() == 1 { "is" } else { "are" },
            100.0 * LARGEST_SHARE
        ));
    }
    said
}
