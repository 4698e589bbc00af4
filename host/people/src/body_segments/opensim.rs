//! Segments in the bodies of an OpenSim model.
//!
//! Both models stand upright, theirs at its default coordinates. A segment of ours is one or more of their
//! bodies, by OpenSim's usual names: a foot is talus, calcaneus and toes, a trunk without arms has ours in
//! it. Their matter is moved by one affine map a segment, so that together the bodies have our mass, centre
//! of mass about the joint and tensor, and each of them stays a body that can be: `x → B (x − c_t) + c_o`
//! with `B Σ_t Bᵀ = Σ_o`, Σ the second moments of unit mass about the centre, and masses all times the same.

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::inverse_kinematics::skeleton::Skeleton;
use rigident_io::motion_capture::opensim::model::{OsimBody, OsimModel};
use rigident_model::Model;
use rigident_model::inertial::{Parameters, in_parent};

/// The reason that segments have no place in a model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OsimFault {
    /// A body that all people of OpenSim's have is missing, or no joints lead to it.
    #[error(
        "the OpenSim model has no body {0} that joints lead to, as its models of people do: give another \
         model with `osim`"
    )]
    Missing(String),
    /// A segment of it has no mass.
    #[error("the bodies of {0} have no mass in the OpenSim model")]
    Massless(String),
}

/// A segment, and its side: `r`, `l`, or empty.
type Segment = (Part, &'static str);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Pelvis,
    Trunk,
    UpperArm,
    Forearm,
    Hand,
    Thigh,
    Shank,
    Foot,
}

impl Part {
    /// Returns the names of a part: our link and their body that begin it, then its other links and bodies.
    fn names(self) -> (&'static str, &'static str, &'static [&'static str], &'static [&'static str]) {
        match self {
            Self::Pelvis => ("pelvis", "pelvis", &[], &[]),
            Self::Trunk => {
                ("torso", "torso", &["lumbar", "chest", "cervical", "head", "clavicle", "scapula"], &[])
            }
            Self::UpperArm => ("upper_arm", "humerus", &[], &[]),
            Self::Forearm => ("forearm", "ulna", &["ulna", "radius"], &["radius"]),
            Self::Hand => ("hand", "hand", &[], &[]),
            Self::Thigh => ("thigh", "femur", &[], &[]),
            Self::Shank => ("shank", "tibia", &[], &["patella"]),
            Self::Foot => ("foot", "talus", &[], &["calcn", "toes"]),
        }
    }

    /// Returns the part that takes its matter in a model without it.
    fn above(self) -> Option<Self> {
        match self {
            Self::Pelvis => None,
            Self::Trunk | Self::Thigh => Some(Self::Pelvis),
            Self::UpperArm => Some(Self::Trunk),
            Self::Forearm => Some(Self::UpperArm),
            Self::Hand => Some(Self::Forearm),
            Self::Shank => Some(Self::Thigh),
            Self::Foot => Some(Self::Shank),
        }
    }
}

const PARTS: [Part; 8] = [
    Part::Pelvis,
    Part::Trunk,
    Part::UpperArm,
    Part::Forearm,
    Part::Hand,
    Part::Thigh,
    Part::Shank,
    Part::Foot,
];

/// Mass, centre of mass and second moments of unit mass about it.
struct Matter {
    mass: f64,
    centre: Vector3<f64>,
    second: Matrix3<f64>,
}

/// Returns the bodies of a template with our segments in them: `segments` are parameters about the links'
/// joints, by their names.
///
/// # Errors
/// [`OsimFault`] if the template is no model of a person.
pub fn in_opensim(
    template: &OsimModel,
    model: &Model,
    segments: &[(&str, Parameters)],
) -> Result<Vec<OsimBody>, OsimFault> {
    let places = template.places();
    let missing = |name: &str| OsimFault::Missing(name.to_owned());
    let place = |body: usize| places[body].ok_or_else(|| missing(&template.bodies[body].name));
    let centre = |name: &str| template.joint_centre(name).ok_or_else(|| missing(name));
    let hips = (centre("femur_r")? + centre("femur_l")?) / 2.0;
    let theirs: Vec<Segment> = (0..template.bodies.len()).map(|body| segment_of(template, body)).collect();
    template.body("pelvis").ok_or_else(|| missing("pelvis"))?;
    let ours = Ours::new(model, segments).ok_or_else(|| missing("pelvis"))?;
    let mut all = template.bodies.clone();
    for (part, side) in PARTS.into_iter().flat_map(|part| ["", "r", "l"].map(|side| (part, side))) {
        let bodies: Vec<usize> = (0..theirs.len()).filter(|b| theirs[*b] == (part, side)).collect();
        if bodies.is_empty() {
            continue;
        }
        let at = match part {
            Part::Pelvis | Part::Trunk => hips,
            _ => centre(&format!("{}_{side}", part.names().1))?,
        };
        let old: Vec<Matter> = bodies
            .iter()
            .map(|b| Ok(matter(&template.bodies[*b], &place(*b)?, &at)))
            .collect::<Result<_, _>>()?;
        let has = |segment: Segment| theirs.contains(&segment);
        let whole = together(old.iter()).ok_or_else(|| OsimFault::Massless(part.names().1.to_owned()))?;
        let Some(wanted) = ours.of((part, side), &has) else { continue };
        for ((body, old), number) in moved(&old, &whole, &wanted).into_iter().zip(&old).zip(&bodies) {
            if old.mass > 0.0 {
                all[*number] = osim_body(&all[*number], &body, &place(*number)?, &at);
            }
        }
    }
    Ok(all)
}

/// Returns the segment that a body is part of: by its name, otherwise by the body that it leads to or hangs
/// on.
fn segment_of(template: &OsimModel, body: usize) -> Segment {
    let by_name = |body: usize| -> Option<Segment> {
        let name = template.bodies[body].name.as_str();
        let (core, side) = match name.rsplit_once('_') {
            Some((core, "r")) => (core, "r"),
            Some((core, "l")) => (core, "l"),
            _ => (name, ""),
        };
        let is = |part: &Part| part.names().1 == core || part.names().3.contains(&core);
        PARTS
            .into_iter()
            .find(is)
            .filter(|part| matches!(part, Part::Pelvis | Part::Trunk) == side.is_empty())
            .map(|p| (p, side))
    };
    let parent = |body: usize| template.carrier(body).and_then(|joint| joint.parent);
    let way = |from: usize| {
        let mut at = Some(from);
        (0..template.bodies.len()).map_while(move |_| {
            let now = at?;
            at = parent(now);
            Some(now)
        })
    };
    let trunk = template.body("torso");
    let below_trunk = trunk.is_some_and(|trunk| way(trunk).any(|b| b == body));
    let found = by_name(body).or_else(|| below_trunk.then_some((Part::Trunk, "")));
    found.or_else(|| way(body).find_map(by_name)).unwrap_or((Part::Pelvis, ""))
}

/// Our links in the standing pose, in OpenSim's axes.
struct Ours<'a> {
    model: &'a Model,
    segments: &'a [(&'a str, Parameters)],
    places: Vec<(Matrix3<f64>, Vector3<f64>)>,
    /// Midway between the hips.
    hips: Vector3<f64>,
}

/// Returns the rotation to OpenSim's axes (x forward, y up, z to the right) from ours (x forward, y to the
/// left, z up).
fn turned() -> Matrix3<f64> {
    Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0)
}

impl<'a> Ours<'a> {
    fn new(model: &'a Model, segments: &'a [(&'a str, Parameters)]) -> Option<Self> {
        let skeleton = Skeleton::new(model)?;
        let places = skeleton.places(&skeleton.zero());
        let hip = |name: &str| Some(places.get(model.link(name)?)?.1);
        let hips = (hip("l_thigh")? + hip("r_thigh")?) / 2.0;
        Some(Self { model, segments, places, hips })
    }

    /// Returns what a segment of a model has of us, about its joint; `has` tells which segments the model
    /// has.
    fn of(&self, (part, side): Segment, has: &dyn Fn(Segment) -> bool) -> Option<Matter> {
        let at = match part {
            Part::Pelvis | Part::Trunk => self.hips,
            _ => {
                let first = |name: &str| self.model.link(&format!("{side}_{name}"));
                let names = part.names();
                let link = first(names.0).or_else(|| names.2.iter().find_map(|name| first(name)))?;
                self.places[link].1
            }
        };
        let mut sum = [0.0; 10];
        for (name, phi) in self.segments {
            let Some(mut own) = our_segment(name) else { continue };
            while !has(own) {
                let above = own.0.above()?;
                own = (above, if matches!(above, Part::Pelvis | Part::Trunk) { "" } else { own.1 });
            }
            if own != (part, side) {
                continue;
            }
            let (turn, origin) = self.places[self.model.link(name)?];
            let placed = in_parent(phi, &(turned() * turn), &(turned() * (origin - at)));
            sum.iter_mut().zip(placed).for_each(|(sum, value)| *sum += value);
        }
        let [mass, x, y, z, xx, yy, zz, yz, zx, xy] = sum;
        let centre = Vector3::new(x, y, z) / mass;
        let tensor = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
        let second = exchanged(&tensor) / mass - centre * centre.transpose();
        (mass > 0.0).then_some(Matter { mass, centre, second })
    }
}

/// Returns the segment of one of our links.
fn our_segment(name: &str) -> Option<Segment> {
    let (core, side) = match name.split_once('_') {
        Some(("r", core)) => (core, "r"),
        Some(("l", core)) => (core, "l"),
        _ => (name, ""),
    };
    let part = PARTS.into_iter().find(|part| part.names().0 == core || part.names().2.contains(&core))?;
    Some((part, if matches!(part, Part::Pelvis | Part::Trunk) { "" } else { side }))
}

/// Returns the second moments of a tensor: `Σ = ½ tr(I) 1 − I`.
fn exchanged(tensor: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::identity() * (tensor.trace() / 2.0) - tensor
}

/// Returns a body's matter about a point of the ground, in the ground's axes.
fn matter(body: &OsimBody, place: &Isometry3<f64>, at: &Vector3<f64>) -> Matter {
    let turn = place.rotation.to_rotation_matrix();
    let [xx, yy, zz, xy, xz, yz] = body.inertia_com_kgm2;
    let tensor = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    let second = turn * exchanged(&tensor) * turn.transpose() / body.mass_kg.max(f64::MIN_POSITIVE);
    Matter {
        mass: body.mass_kg,
        centre: place * Vector3::from(body.com_m) + place.translation.vector - at,
        second,
    }
}

/// Returns a body with new matter, which is given about a point of the ground.
fn osim_body(old: &OsimBody, new: &Matter, place: &Isometry3<f64>, at: &Vector3<f64>) -> OsimBody {
    let back = place.rotation.inverse().to_rotation_matrix();
    let second = back * new.second * back.transpose() * new.mass;
    let tensor = Matrix3::identity() * second.trace() - second;
    let symmetric = |i: usize, j: usize| (tensor[(i, j)] + tensor[(j, i)]) / 2.0;
    OsimBody {
        mass_kg: new.mass,
        com_m: (back * (at + new.centre - place.translation.vector)).into(),
        inertia_com_kgm2: [
            tensor[(0, 0)],
            tensor[(1, 1)],
            tensor[(2, 2)],
            symmetric(0, 1),
            symmetric(0, 2),
            symmetric(1, 2),
        ],
        ..old.clone()
    }
}

/// Bodies as one; `None` without mass.
fn together<'a>(bodies: impl Iterator<Item = &'a Matter> + Clone) -> Option<Matter> {
    let mass: f64 = bodies.clone().map(|b| b.mass).sum();
    if mass <= 0.0 {
        return None;
    }
    let centre = bodies.clone().map(|b| b.centre * (b.mass / mass)).sum::<Vector3<f64>>();
    let spread = |b: &Matter| {
        let d = b.centre - centre;
        (b.second + d * d.transpose()) * (b.mass / mass)
    };
    Some(Matter { mass, centre, second: bodies.map(spread).sum() })
}

/// Bodies moved so that together, instead of `whole`, they are as wanted.
fn moved(bodies: &[Matter], whole: &Matter, wanted: &Matter) -> Vec<Matter> {
    let scale = wanted.mass / whole.mass;
    let possible = bodies.iter().filter(|b| b.mass > 0.0).all(|b| root(&b.second).is_some());
    let map = Some(whole).filter(|_| possible).and_then(|whole| {
        // B = Σ_t^-½ (Σ_t^½ Σ_o Σ_t^½)^½ Σ_t^-½
        let half = root(&whole.second)?;
        let inverse = half.try_inverse()?;
        Some(inverse * root(&(half * wanted.second * half))? * inverse)
    });
    let one = |body: &Matter| match &map {
        Some(b) => Matter {
            mass: body.mass * scale,
            centre: wanted.centre + b * (body.centre - whole.centre),
            second: b * body.second * b.transpose(),
        },
        // A template that no distribution of mass has: all of its bodies are of the same matter.
        None => Matter { mass: body.mass * scale, centre: wanted.centre, second: wanted.second },
    };
    bodies.iter().map(one).collect()
}

/// Returns the symmetric root of a matrix; `None` if it is not positive.
fn root(of: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    const LEAST: f64 = 1e-9;
    let eigen = of.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let positive = eigen.eigenvalues.iter().all(|v| *v >= -LEAST * largest);
    let roots = Matrix3::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0).sqrt()));
    positive.then(|| eigen.eigenvectors * roots * eigen.eigenvectors.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_model::human::Person;
    use rigident_model::inertial::impossibility;

    /// A body on another one, so far below it.
    fn body(name: &str, parent: &str, below: [f64; 3], kg: f64, tensor: f64) -> String {
        let [x, y, z] = below;
        format!(
            "<Body name='{name}'><mass>{kg}</mass><mass_center>0 -0.1 \
             0</mass_center><inertia_xx>{tensor}</inertia_xx><inertia_yy>0.01</inertia_yy><inertia_zz>0.02</inertia_zz><inertia_xy>0</inertia_xy><inertia_xz>0</inertia_xz><inertia_yz>0</inertia_yz><Joint><WeldJoint name='to_{name}'><parent_body>{parent}</parent_body><location_in_parent>{x} {y} {z}</location_in_parent><orientation_in_parent>0 0 0</orientation_in_parent><location>0 0 0</location><orientation>0 0 0</orientation></WeldJoint></Joint></Body>"
        )
    }

    fn template(foot_tensor: f64) -> OsimModel {
        let mut text = body("pelvis", "ground", [0.0, 0.9, 0.0], 10.0, 0.02);
        text += &body("spine", "pelvis", [-0.1, 0.1, 0.0], 3.0, 0.02);
        text += &body("torso", "spine", [0.0, 0.1, 0.0], 30.0, 0.02);
        for (side, out) in [("r", 0.09), ("l", -0.09)] {
            let name = |of: &str| format!("{of}_{side}");
            text += &body(&name("femur"), "pelvis", [-0.07, -0.06, out], 9.0, 0.02);
            text += &body(&name("tibia"), &name("femur"), [0.0, -0.4, 0.0], 4.0, 0.02);
            text += &body(&name("talus"), &name("tibia"), [0.0, -0.4, 0.0], 0.2, 0.02);
            text += &body(&name("calcn"), &name("talus"), [-0.05, -0.04, 0.0], 1.2, foot_tensor);
            text += &body(&name("ball"), &name("calcn"), [0.1, 0.0, 0.0], 0.0, 0.02);
        }
        OsimModel::parse(&format!("<OpenSimDocument>{text}</OpenSimDocument>")).unwrap()
    }

    /// φ of bodies together, in the ground's axes about the ground's origin.
    fn sum(model: &OsimModel, bodies: &[OsimBody]) -> Parameters {
        let places = model.places();
        let mut sum = [0.0; 10];
        for (body, place) in bodies.iter().zip(places) {
            let [xx, yy, zz, xy, xz, yz] = body.inertia_com_kgm2;
            let about_com = [body.mass_kg, 0.0, 0.0, 0.0, xx, yy, zz, yz, xz, xy];
            let place = place.unwrap();
            let centre = place * nalgebra::Point3::from(body.com_m);
            let placed =
                in_parent(&about_com, &place.rotation.to_rotation_matrix().into_inner(), &centre.coords);
            sum.iter_mut().zip(placed).for_each(|(sum, value)| *sum += value);
        }
        sum
    }

    #[test]
    fn bodies_together_are_the_segment_and_each_can_be() {
        let model = Person::default().human34().unwrap();
        let segments: Vec<_> = model.links.iter().map(|l| (l.name.as_str(), l.nominal.unwrap())).collect();
        // With 0.2 no distribution of mass has the template's tensor.
        for foot in [0.02, 0.2] {
            let template = template(foot);
            let bodies = in_opensim(&template, &model, &segments).unwrap();
            let whole: f64 = bodies.iter().map(|b| b.mass_kg).sum();
            assert!((whole - 73.0).abs() < 0.1, "{whole}");
            for (old, new) in template.bodies.iter().zip(&bodies) {
                let [xx, yy, zz, xy, xz, yz] = new.inertia_com_kgm2;
                let own = [new.mass_kg, 0.0, 0.0, 0.0, xx, yy, zz, yz, xz, xy];
                assert!(old.mass_kg == 0.0 || impossibility(&own).is_none(), "{new:?}");
                assert!(old.mass_kg > 0.0 || new == old);
            }
            // The foot about its joint, and its two bodies about theirs.
            let (foot, link) =
                (segments[model.link("r_foot").unwrap()].1, template.joint_centre("talus_r").unwrap());
            let wanted =
                in_parent(&in_parent(&foot, &turned(), &Vector3::zeros()), &Matrix3::identity(), &link);
            let is_foot = |b: &&OsimBody| ["talus_r", "calcn_r"].contains(&b.name.as_str());
            let none = OsimBody { mass_kg: 0.0, inertia_com_kgm2: [0.0; 6], ..bodies[0].clone() };
            let only: Vec<OsimBody> =
                bodies.iter().map(|b| Some(b).filter(is_foot).unwrap_or(&none).clone()).collect();
            for (a, b) in sum(&template, &only).iter().zip(wanted) {
                assert!((a - b).abs() < 1e-12, "{a} {b}");
            }
            // What is between pelvis and torso is the trunk's.
            let spine = bodies[1].mass_kg / bodies[2].mass_kg;
            assert!((spine - 0.1).abs() < 1e-12);
        }
    }

    #[test]
    fn models_of_no_person_are_refused() {
        let model = Person::default().human34().unwrap();
        let segments: Vec<_> = model.links.iter().map(|l| (l.name.as_str(), l.nominal.unwrap())).collect();
        let alone = OsimModel::parse(&format!(
            "<OpenSimDocument>{}</OpenSimDocument>",
            body("pelvis", "ground", [0.0; 3], 1.0, 0.02)
        ));
        let refused = in_opensim(&alone.unwrap(), &model, &segments).unwrap_err();
        assert_eq!(refused, OsimFault::Missing("femur_r".to_owned()));
        let mut light = template(0.02);
        let femur = light.body("femur_l").unwrap();
        light.bodies[femur].mass_kg = 0.0;
        assert_eq!(
            in_opensim(&light, &model, &segments).unwrap_err(),
            OsimFault::Massless("femur".to_owned())
        );
    }
}
