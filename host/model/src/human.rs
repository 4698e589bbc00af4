//! People: `human34` (15 links, 34 degrees of freedom) and `human58` (23 links, 58), the models of the papers
//! on identifying human mass properties from motion.
//!
//! At zero position the person stands upright with hanging arms, x forward, y to the left, z up. Each link's
//! frame has its origin at its parent joint, the base's (the lower trunk's) midway between the hips; x and y
//! of that lie in the plane of its four spines, which leans forward by [`PELVIS_TILT`] when people stand.
//! Knees (of `human34`) and elbows turn about y, the radius about the forearm's z.
//!
//! Assumed here, not published: where a segment of the table is split among links (clavicles and scapulae of
//! the upper trunk, cervical of the head, ulna and radius of the forearm), each has a share of the same
//! distribution of mass, so that together and at zero position they are the table's segment.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{Joint, Link};

use super::finding::ModelError;
use super::human_segments::{ANKLE, HIP, Part, SHOULDER, other_tables, segment};
pub use super::human_segments::{Ratio, Sex};
use super::inertial::{Parameters, in_parent};
use super::tree::{Model, ModelLink};

/// The person to model.
#[derive(Clone, Debug, PartialEq)]
pub struct Person {
    /// Stature, m.
    pub height_m: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// The sex whose means are taken.
    pub sex: Sex,
    /// Lengths known otherwise, m: `thigh`, `shank`, `foot`, `upper_arm`, `forearm`, `hand`, `head`,
    /// `upper_trunk`, `middle_trunk`, `lower_trunk`, `shoulder_width`, `hip_width`, `ankle_height`.
    pub lengths_m: Vec<(String, f64)>,
}

impl Default for Person {
    fn default() -> Self {
        Self { height_m: 1.741, mass_kg: 73.0, sex: Sex::Male, lengths_m: Vec::new() }
    }
}

/// From small children to the tallest and heaviest people known.
const HEIGHTS_M: [f64; 2] = [0.4, 2.8];
const MASSES_KG: [f64; 2] = [2.0, 650.0];
/// No segment is this many times longer or shorter than the table's for the stature.
const ODD_LENGTH: f64 = 3.0;

const LENGTHS: [&str; 13] = [
    "head",
    "upper_trunk",
    "middle_trunk",
    "lower_trunk",
    "upper_arm",
    "forearm",
    "hand",
    "thigh",
    "shank",
    "foot",
    "shoulder_width",
    "hip_width",
    "ankle_height",
];
const PARTS: [Part; 10] = [
    Part::Head,
    Part::UpperTrunk,
    Part::MiddleTrunk,
    Part::LowerTrunk,
    Part::UpperArm,
    Part::Forearm,
    Part::Hand,
    Part::Thigh,
    Part::Shank,
    Part::Foot,
];

/// Shares of a segment of the table in a link of `human58` [assumed].
const CLAVICLE: f64 = 0.05;
const SCAPULA: f64 = 0.10;
const CERVICAL: f64 = 0.15;
const ULNA: f64 = 0.5;

/// The plane of the pelvis' four spines leans forward so far in standing, rad (10°); the table's axis of the
/// lower trunk is the vertical.
pub const PELVIS_TILT: f64 = 0.175;
/// The distance of the lowest joint of the spine behind the hips in the axes of the four spines, over the
/// stature: 35 mm at 1.80 m (30 mm in S. Delp et al. 1990).
pub const SPINE_BEHIND: f64 = 0.0194;

/// Returns the part of the body that a link of either model belongs to, and its body by each of two other
/// tables over that of this one ([`Ratio`]); `None` if no model has such a link.
pub fn link_by_other_tables(link: &str, sex: Sex) -> Option<(&'static str, [Ratio; 2])> {
    let core = link.strip_prefix("l_").or_else(|| link.strip_prefix("r_")).unwrap_or(link);
    let (name, parts): (&str, &[Part]) = match core {
        "head" | "cervical" => ("head", &[Part::Head]),
        "torso" | "lumbar" | "chest" | "clavicle" | "scapula" => {
            ("trunk", &[Part::UpperTrunk, Part::MiddleTrunk])
        }
        "pelvis" => ("pelvis", &[Part::LowerTrunk]),
        "upper_arm" => ("upper arm", &[Part::UpperArm]),
        "forearm" | "ulna" | "radius" => ("forearm", &[Part::Forearm]),
        "hand" => ("hand", &[Part::Hand]),
        "thigh" => ("thigh", &[Part::Thigh]),
        "shank" => ("shank", &[Part::Shank]),
        "foot" => ("foot", &[Part::Foot]),
        _ => return None,
    };
    let mut found = other_tables(parts, sex);
    if name == "trunk" && core != "torso" {
        // Links of a part of it have their own centres.
        found.iter_mut().for_each(|ratio| ratio.com = 1.0);
    }
    Some((name, found))
}

struct Builder {
    person: Person,
    lengths: [f64; 13],
    links: Vec<ModelLink>,
}

/// A part's body in a frame: whose axes, where the part's proximal end is, which way it extends.
type Placed = (Part, f64, Vector3<f64>, Vector3<f64>);

impl Person {
    /// Returns a length, m, by its name in `lengths_m`: as it is given, else as the table has it for the
    /// stature; `None` if there is none of that name.
    pub fn length(&self, name: &str) -> Option<f64> {
        let k = LENGTHS.iter().position(|n| *n == name)?;
        let given = self.lengths_m.iter().find(|(n, _)| n == name).map(|(_, length)| *length);
        Some(given.unwrap_or_else(|| self.usual_length(k)))
    }

    /// Returns the table's length number `k` for the stature, m.
    fn usual_length(&self, k: usize) -> f64 {
        let over_stature = match PARTS.get(k) {
            Some(part) => segment(*part, self.sex).length,
            None => [2.0 * SHOULDER, 2.0 * HIP, ANKLE][k - PARTS.len()],
        };
        over_stature * self.height_m
    }

    fn builder(&self) -> Result<Builder, ModelError> {
        let positive = |what: &str, v: f64| {
            if v.is_finite() && v > 0.0 {
                Ok(v)
            } else {
                Err(ModelError::Option(format!("{what} must be finite and greater than zero, not {v}")))
            }
        };
        let within = |what: &str, v: f64, unit: &str, [low, high]: [f64; 2]| {
            if v.is_finite() && (low..=high).contains(&v) {
                Ok(v)
            } else {
                Err(ModelError::Option(format!(
                    "{what} is {v} {unit}, and people's is {low} to {high} {unit}: is the unit right?"
                )))
            }
        };
        let h = within("the height (`height_m`)", self.height_m, "m", HEIGHTS_M)?;
        within("the mass (`mass_kg`)", self.mass_kg, "kg", MASSES_KG)?;
        let mut lengths: [f64; 13] = std::array::from_fn(|k| self.usual_length(k));
        for (name, value) in &self.lengths_m {
            let k = LENGTHS.iter().position(|n| n == name).ok_or_else(|| {
                ModelError::Option(format!("there is no segment {name}; there are {}", LENGTHS.join(", ")))
            })?;
            if self.lengths_m.iter().filter(|(other, _)| other == name).count() > 1 {
                return Err(ModelError::Option(format!("`segment` {name} is given more than once")));
            }
            let (value, usual) = (positive(&format!("`segment` {name}"), *value)?, lengths[k]);
            if !(usual / ODD_LENGTH..=usual * ODD_LENGTH).contains(&value) {
                return Err(ModelError::Option(format!(
                    "`segment` {name}={value}: of a person {h} m tall it is about {usual:.3} m; is it in \
                     metres, and is the height right?"
                )));
            }
            lengths[k] = value;
        }
        Ok(Builder { person: self.clone(), lengths, links: Vec::new() })
    }

    /// Returns the model of 15 links and 34 degrees of freedom: ten spherical joints, knees and elbows
    /// revolute.
    ///
    /// # Errors
    /// [`ModelError::Option`] on lengths or masses that cannot be.
    pub fn human34(&self) -> Result<Model, ModelError> {
        let mut b = self.builder()?;
        let up = Vector3::z();
        let (upper, middle) = (b.length(Part::UpperTrunk), b.length(Part::MiddleTrunk));
        let pelvis = b.pelvis();
        let torso = b.add(
            "torso",
            pelvis,
            Joint::Spherical,
            b.lowest_joint(),
            &[
                (Part::MiddleTrunk, 1.0, up * middle, -up),
                (Part::UpperTrunk, 1.0, up * (middle + upper), -up),
            ],
        );
        b.head("head", torso, up * (middle + upper), 1.0, 0.0);
        for (side, left) in [("l", 1.0), ("r", -1.0)] {
            let shoulder = up * (middle + upper) + Vector3::y() * (left * b.lengths[10] / 2.0);
            let arm = b.arm_to_elbow(side, torso, shoulder);
            let down = -up;
            let upper_arm = b.length(Part::UpperArm);
            let forearm = b.add(
                &format!("{side}_forearm"),
                arm,
                Joint::Revolute(Vector3::y()),
                down * upper_arm,
                &[(Part::Forearm, 1.0, Vector3::zeros(), down)],
            );
            let length = b.length(Part::Forearm);
            b.hand(side, forearm, down * length);
            b.leg(side, left, pelvis, Joint::Revolute(Vector3::y()));
        }
        Ok(b.model("human34"))
    }

    /// Returns the model of 23 links and 58 degrees of freedom: eighteen spherical joints, ulnae and radii
    /// revolute.
    ///
    /// # Errors
    /// [`ModelError::Option`] on lengths or masses that cannot be.
    pub fn human58(&self) -> Result<Model, ModelError> {
        let mut b = self.builder()?;
        let up = Vector3::z();
        let (upper, middle) = (b.length(Part::UpperTrunk), b.length(Part::MiddleTrunk));
        let pelvis = b.pelvis();
        let lumbar = b.add(
            "lumbar",
            pelvis,
            Joint::Spherical,
            b.lowest_joint(),
            &[(Part::MiddleTrunk, 1.0, up * middle, -up)],
        );
        let rest = 1.0 - 2.0 * (CLAVICLE + SCAPULA);
        let chest = b.add(
            "chest",
            lumbar,
            Joint::Spherical,
            up * middle,
            &[(Part::UpperTrunk, rest, up * upper, -up)],
        );
        let neck = 0.3 * b.length(Part::Head);
        let cervical = b.add(
            "cervical",
            chest,
            Joint::Spherical,
            up * upper,
            &[(Part::Head, CERVICAL, up * b.length(Part::Head), -up)],
        );
        b.head("head", cervical, up * neck, 1.0 - CERVICAL, neck);
        for (side, left) in [("l", 1.0), ("r", -1.0)] {
            let out = Vector3::y() * (left * b.lengths[10] / 2.0);
            // Joints along the line from the breastbone to the shoulder, at an eighth and at three quarters
            // of it.
            let (inner, outer) = (out * 0.125, out * 0.75);
            let clavicle = b.add(
                &format!("{side}_clavicle"),
                chest,
                Joint::Spherical,
                up * upper + inner,
                &[(Part::UpperTrunk, CLAVICLE, -inner, -up)],
            );
            let scapula = b.add(
                &format!("{side}_scapula"),
                clavicle,
                Joint::Spherical,
                outer - inner,
                &[(Part::UpperTrunk, SCAPULA, -outer, -up)],
            );
            let arm = b.arm_to_elbow(side, scapula, out - outer);
            let down = -up;
            let upper_arm = b.length(Part::UpperArm);
            let ulna = b.add(
                &format!("{side}_ulna"),
                arm,
                Joint::Revolute(Vector3::y()),
                down * upper_arm,
                &[(Part::Forearm, ULNA, Vector3::zeros(), down)],
            );
            let radius = b.add(
                &format!("{side}_radius"),
                ulna,
                Joint::Revolute(Vector3::z()),
                Vector3::zeros(),
                &[(Part::Forearm, 1.0 - ULNA, Vector3::zeros(), down)],
            );
            let length = b.length(Part::Forearm);
            b.hand(side, radius, down * length);
            b.leg(side, left, pelvis, Joint::Spherical);
        }
        Ok(b.model("human58"))
    }
}

impl Builder {
    fn length(&self, part: Part) -> f64 {
        self.lengths[part as usize]
    }

    /// Returns the length that a part's body is scaled by, m. Breadth and depth of the trunk do not follow
    /// the distances between its joints: its bodies are the stature's.
    fn body_length(&self, part: Part) -> f64 {
        match part {
            Part::UpperTrunk | Part::MiddleTrunk | Part::LowerTrunk => {
                self.person.usual_length(part as usize)
            }
            _ => self.length(part),
        }
    }

    /// Returns φ of a part about its proximal end at `at`, extending along ±z or x.
    fn body(&self, (part, share, at, along): &Placed) -> Parameters {
        let s = segment(*part, self.person.sex);
        let length = self.body_length(*part);
        let mass = share * s.mass * self.person.mass_kg;
        let [sagittal, transverse, longitudinal] = s.radii.map(|r| (r * length).powi(2) * mass);
        // The longitudinal axis is the one the part extends along; feet extend forward, and turn about the
        // vertical as other parts about the sagittal axis.
        let moments = if along.x != 0.0 {
            [longitudinal, transverse, sagittal]
        } else {
            [sagittal, transverse, longitudinal]
        };
        let tensor = Matrix3::from_diagonal(&moments.into());
        let com = along * (s.com * length);
        let phi = InertialParameters::<Body, f64>::from_centre_of_mass(
            mass,
            Position::new(com.x, com.y, com.z),
            tensor,
        );
        in_parent(&phi.to_vector(), &Matrix3::identity(), at)
    }

    fn add(
        &mut self,
        name: &str,
        parent: usize,
        joint: Joint<f64>,
        position: Vector3<f64>,
        bodies: &[Placed],
    ) -> usize {
        let mut nominal = [0.0; 10];
        for body in bodies {
            for (sum, value) in nominal.iter_mut().zip(self.body(body)) {
                *sum += value;
            }
        }
        self.links.push(ModelLink::new(
            name,
            if self.links.is_empty() { String::new() } else { format!("{name}_joint") },
            Link { parent, joint, rotation: Matrix3::identity(), position },
            Some(nominal),
        ));
        self.links.len() - 1
    }

    /// Returns where the lowest joint of the spine is in the pelvis, m.
    fn lowest_joint(&self) -> Vector3<f64> {
        Vector3::new(-SPINE_BEHIND * self.person.height_m, 0.0, self.length(Part::LowerTrunk))
    }

    fn pelvis(&mut self) -> usize {
        let (up, length) = (Vector3::z(), self.body_length(Part::LowerTrunk));
        let body = (Part::LowerTrunk, 1.0, up * length, -up);
        let at = self.add("pelvis", 0, Joint::Free, Vector3::zeros(), &[body]);
        // The vertical in the axes of the spines.
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), -PELVIS_TILT);
        if let Some(phi) = &mut self.links[at].nominal {
            *phi = in_parent(phi, turn.matrix(), &Vector3::zeros());
        }
        at
    }

    /// Adds the head. Its proximal end is the vertex, `below` the joint's height above the neck's root.
    fn head(&mut self, name: &str, parent: usize, at: Vector3<f64>, share: f64, below: f64) {
        let up = Vector3::z();
        let vertex = up * (self.length(Part::Head) - below);
        self.add(name, parent, Joint::Spherical, at, &[(Part::Head, share, vertex, -up)]);
    }

    fn arm_to_elbow(&mut self, side: &str, parent: usize, at: Vector3<f64>) -> usize {
        let body = (Part::UpperArm, 1.0, Vector3::zeros(), -Vector3::z());
        self.add(&format!("{side}_upper_arm"), parent, Joint::Spherical, at, &[body])
    }

    fn hand(&mut self, side: &str, parent: usize, at: Vector3<f64>) {
        let body = (Part::Hand, 1.0, Vector3::zeros(), -Vector3::z());
        self.add(&format!("{side}_hand"), parent, Joint::Spherical, at, &[body]);
    }

    fn leg(&mut self, side: &str, left: f64, pelvis: usize, knee: Joint<f64>) {
        let (down, o) = (-Vector3::z(), Vector3::zeros());
        let hip = Vector3::y() * (left * self.lengths[11] / 2.0);
        let (thigh_m, shank_m) = (self.length(Part::Thigh), self.length(Part::Shank));
        let thigh =
            self.add(&format!("{side}_thigh"), pelvis, Joint::Spherical, hip, &[(Part::Thigh, 1.0, o, down)]);
        let shank =
            self.add(&format!("{side}_shank"), thigh, knee, down * thigh_m, &[(Part::Shank, 1.0, o, down)]);
        // The heel is a quarter of the foot behind the ankle, the foot's axis halfway down to the sole.
        let heel = Vector3::new(-0.25 * self.length(Part::Foot), 0.0, -0.5 * self.lengths[12]);
        self.add(
            &format!("{side}_foot"),
            shank,
            Joint::Spherical,
            down * shank_m,
            &[(Part::Foot, 1.0, heel, Vector3::x())],
        );
    }

    fn model(self, name: &str) -> Model {
        Model { name: name.to_owned(), links: self.links, findings: Vec::new(), gravity_mps2: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inertial::impossibility;

    #[test]
    fn the_models_have_the_papers_links_and_freedoms_and_weigh_as_asked() {
        for sex in [Sex::Female, Sex::Male] {
            let person = Person { height_m: 1.60, mass_kg: 60.0, sex, ..Person::default() };
            for (model, links, freedoms) in
                [(person.human34().unwrap(), 15, 34), (person.human58().unwrap(), 23, 58)]
            {
                assert_eq!((model.links.len(), model.freedoms()), (links, freedoms));
                let masses: f64 = model.links.iter().filter_map(|l| Some(l.nominal?[0])).sum();
                // The table's masses sum to 100 % of men, 99.99 % of women.
                assert!((masses - 60.0).abs() < 60.0 * 1.5e-4, "{masses}");
                for link in &model.links {
                    assert_eq!(impossibility(&link.nominal.unwrap()), None, "{}", link.name);
                }
            }
        }
    }

    #[test]
    fn other_tables_have_the_same_whole_mass() {
        for sex in [Sex::Female, Sex::Male, Sex::Unknown] {
            let person = Person { mass_kg: 100.0, sex, ..Person::default() };
            for model in [person.human34().unwrap(), person.human58().unwrap()] {
                for table in 0..2 {
                    let mass = |link: &ModelLink| {
                        link.nominal.unwrap()[0]
                            * link_by_other_tables(&link.name, sex).unwrap().1[table].mass
                    };
                    let whole: f64 = model.links.iter().map(mass).sum();
                    assert!((whole - 100.0).abs() < 0.21, "{} {table}: {whole}", model.name);
                }
            }
        }
        // Thighs of 10.0 and 12.3 % of men's mass beside 14.16.
        let thigh = link_by_other_tables("l_thigh", Sex::Male).unwrap().1.map(|ratio| ratio.mass);
        assert!((thigh[0] - 0.706).abs() < 1e-3 && (thigh[1] - 0.869).abs() < 1e-3, "{thigh:?}");
        // The trunk's centre of mass is 12.95 % of men's stature above the pelvis, by the others 9.6 and
        // 15.6.
        let trunk = link_by_other_tables("torso", Sex::Male).unwrap().1.map(|ratio| ratio.com);
        assert!((trunk[0] - 0.741).abs() < 2e-3 && (trunk[1] - 1.204).abs() < 2e-3, "{trunk:?}");
    }

    /// Welds all links into one rigid body at zero position, and returns its parameters.
    fn whole(model: &Model) -> Parameters {
        let mut model = model.clone();
        for link in &mut model.links {
            link.link.joint = Joint::Fixed;
        }
        model.welded().links[0].nominal.unwrap()
    }

    #[test]
    fn links_of_human58_together_are_the_segments_of_human34() {
        let person = Person::default();
        let (a, b) = (whole(&person.human34().unwrap()), whole(&person.human58().unwrap()));
        for (x, y) in a.iter().zip(b) {
            assert!((x - y).abs() < 1e-12 * a[4], "{a:?} {b:?}");
        }
        // Standing, the centre of mass is at 53 to 60 % of the stature above the floor.
        let floor = (0.4222 + 0.4340) / 1.741 * 1.741 + ANKLE * 1.741;
        let share = (a[3] / a[0] + floor) / 1.741;
        assert!((0.53..0.60).contains(&share), "{share}");
    }

    #[test]
    fn lengths_can_be_given_and_unknown_ones_are_named() {
        let mut person = Person { lengths_m: vec![("thigh".to_owned(), 0.5)], ..Person::default() };
        let model = person.human34().unwrap();
        let shank = model.link("l_shank").unwrap();
        assert_eq!(model.links[shank].link.position.z, -0.5);
        // A joint that is found too low makes no pelvis of a quarter of the inertia.
        let usual = model.links[0].nominal;
        person.lengths_m.push(("lower_trunk".to_owned(), 0.09));
        let low = person.human34().unwrap();
        assert_eq!(low.links[low.link("torso").unwrap()].link.position.z, 0.09);
        assert_eq!(low.links[0].nominal, usual);
        person.lengths_m.pop();
        person.lengths_m[0].0 = "tail".to_owned();
        assert!(person.human34().unwrap_err().to_string().contains("no segment tail"));
        person.lengths_m = vec![("thigh".to_owned(), -1.0)];
        assert!(person.human34().unwrap_err().to_string().contains("greater than zero"));
    }
}
