//! The model of one person, scaled to the markers.

use nalgebra::{DMatrix, DVector, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use rigident_shared::tree::Joint;

use super::calibrate::{Calibrated, calibrate};
use super::known::ANATOMICAL_M;
pub use super::known::Known;
use super::landmarks::{Naming, attach};
use super::lengths::{LENGTH_SIGMA_M, Other, contradiction, lengths, unusual};
use super::markers::{Attached, Seen};
use super::pelvis::{LOWEST_JOINT_SIGMA_M, pelvis, trunk};
use super::sides::{exchanged, exchanged_pair, is_exchanged};
use super::skeleton::{Pose, Skeleton};
use super::solve::Solver;
pub use super::stature::Stature;
use super::stature::{by_legs, upright_frame};
use rigident_io::motion_capture::registration::nearest_rotation;
use rigident_model::human::Person;
use rigident_model::{Model, ModelError};

/// Fewest such markers that a pose can be begun from.
const FEWEST: usize = 5;

/// Frames that left and right are compared in.
const COMPARED: usize = 5;
/// A stature by the markers is taken if it differs by more than this from the one that the model was made
/// with, relative; …
const SAME_STATURE: f64 = 0.02;
/// … this many times at most.
const ROUNDS: usize = 3;
/// Statures of people from small children on, m.
const STATURES_M: [f64; 2] = [0.5, 2.5];

/// The model of people.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HumanModel {
    /// 15 links, 34 degrees of freedom.
    #[default]
    Human34,
    /// 23 links, 58 degrees of freedom.
    Human58,
}

/// The reason that there is no model of a person.
#[derive(Debug, thiserror::Error)]
pub enum SubjectError {
    /// Too few markers have names that are known.
    #[error(
        "only {known} of {markers} markers have names that are known ({unknown} is not), and {FEWEST} must \
         be: name in `markers` which segment each is on"
    )]
    Markers {
        /// Markers of known names that were seen.
        known: usize,
        /// All markers.
        markers: usize,
        /// The first that is not known.
        unknown: String,
    },
    /// Markers are in another unit, or are no person's.
    #[error(
        "the markers make a person {height_m:.3} m tall: is their unit right? Correct POINT:UNITS or the \
         header's Units"
    )]
    Stature {
        /// The stature, m.
        height_m: f64,
    },
    /// The stature that is given is not the markers'.
    #[error(
        "the stature is given as {given_m:.3} m, and by the markers it is about {found_m:.2} m: is it of this \
         person, and in metres? Correct `height_m`, or leave it out"
    )]
    OtherStature {
        /// The one that is given, m.
        given_m: f64,
        /// That of the markers, m.
        found_m: f64,
    },
    /// Left and right are exchanged.
    #[error(
        "left and right are exchanged in the names of {what}: the person would stand {left_mm:.0} mm off the \
         model as they are named, and          {other_mm:.0} mm the other way round; correct the names"
    )]
    Exchanged {
        /// The markers.
        what: String,
        /// The residuals as they are named, mm.
        left_mm: f64,
        /// The residuals the other way round, mm.
        other_mm: f64,
    },
    /// A pair of markers is exchanged.
    #[error("{left} and {right} are exchanged: each is where the other should be; correct their names")]
    ExchangedPair {
        /// The marker that is named left.
        left: String,
        /// The other one.
        right: String,
    },
    /// A file of markers names no link of the model.
    #[error("`markers`: {0}")]
    OwnMarkers(String),
    /// Lengths from elsewhere are another person's.
    #[error(
        "the {} of `osim` is {given_m:.3} m, and the person's is about {found_m:.3} m: is the model scaled \
         to this person, in metres?",
        name.replace('_', " ")
    )]
    OtherPerson {
        /// The length.
        name: String,
        /// The one that was given, m.
        given_m: f64,
        /// The value by stature or markers, m.
        found_m: f64,
    },
    /// The search for joint centres failed.
    #[error("joint centres cannot be found from the markers: too few were seen together")]
    Calibration,
    /// The table refuses these lengths.
    #[error(transparent)]
    Model(#[from] ModelError),
}

/// A person's model with the markers on it.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The person as the table is scaled.
    pub person: Person,
    /// The model: joints as calibrated, bodies as the table has them.
    pub model: Model,
    /// The tree of `model` for inverse kinematics.
    pub skeleton: Skeleton,
    /// Markers on its links.
    pub markers: Vec<Attached>,
    /// Root mean square of the distances of markers from their links in the frames of the calibration, m.
    pub rms_m: f64,
    /// Names of markers that are not used.
    pub unknown: Vec<String>,
    /// The trunk's link if no marker follows it.
    pub unseen_trunk: Option<usize>,
    /// The stature by the markers.
    pub stature: Stature,
    /// The information of frames and prior on the places of joints and markers ([`Calibrated::information`]),
    /// its lower triangular root.
    root: DMatrix<f64>,
}

/// Returns the model of a person from frames of markers, `labels` their names; the first frames are those
/// that the person stands upright in, as far as there are any. A stature that is not given is that of an
/// upright frame, else that by the legs.
///
/// # Errors
/// [`SubjectError`] says what is missing.
pub fn subject(
    labels: &[String],
    frames: &[Vec<Option<Vector3<f64>>>],
    kind: HumanModel,
    known: &Known,
) -> Result<Subject, SubjectError> {
    let mut found = scaled(labels, frames, kind, known)?;
    if let Some(given_m) = known.height_m {
        if found.stature.rules_out(given_m) {
            return Err(SubjectError::OtherStature { given_m, found_m: found.stature.height_m });
        }
        return Ok(found);
    }
    for _ in 0..ROUNDS {
        let height_m = found.stature.height_m;
        if (height_m / found.person.height_m - 1.0).abs() < SAME_STATURE {
            break;
        }
        found = scaled(labels, frames, kind, &Known { height_m: Some(height_m), ..known.clone() })?;
    }
    Ok(found)
}

/// Returns the model with the stature that is given, else with that of the first frame.
fn scaled(
    labels: &[String],
    frames: &[Vec<Option<Vector3<f64>>>],
    kind: HumanModel,
    known: &Known,
) -> Result<Subject, SubjectError> {
    let question = Question { labels, frames, kind, known };
    let mut person = Person {
        height_m: known.height_m.unwrap_or_else(|| Person::default().height_m),
        mass_kg: known.mass_kg,
        sex: known.sex,
        lengths_m: Vec::new(),
    };
    let unknown = question.unknown();
    let first = question.first_pose(&mut person, &unknown)?;
    question.refuse_other_person(&person)?;
    person.lengths_m.clone_from(&known.lengths_m);
    let (_, mut skeleton, mut markers) = question.attached(&person)?;
    let by_spines = pelvis(&mut skeleton, &mut markers, frames, (&model(&person, kind)?, &person, known));
    let mut sigma = joint_sigma(&model(&person, kind)?, known);
    if by_spines {
        let trunk = trunk(&model(&person, kind)?);
        trunk.into_iter().for_each(|link| sigma[link - 1] = LOWEST_JOINT_SIGMA_M);
    }
    let seen: Vec<Seen> = frames.iter().map(|f| of_frame(&markers, f)).collect();
    let poses = follow(&skeleton, &markers, &seen, &first).ok_or(SubjectError::Calibration)?;
    refuse_exchanged(&skeleton, &markers, &seen, &first)?;
    if let Some((left, right)) = exchanged_pair(&skeleton, &markers, &seen, &poses) {
        return Err(SubjectError::ExchangedPair { left, right });
    }
    let found = calibrate(&skeleton, &markers, &sigma, &seen, &poses).ok_or(SubjectError::Calibration)?;
    let root = found.information.clone().cholesky().ok_or(SubjectError::Calibration)?.unpack();
    let found = if known.symmetric { mirrored(found, &model(&person, kind)?, &seen)? } else { found };
    let Calibrated { skeleton, markers, rms_m, poses, .. } = found;
    let upright = question.upright_stature(&person, (&skeleton, &poses))?;
    person.lengths_m = lengths(&model(&person, kind)?, &skeleton);
    let own = Stature { height_m: person.height_m, upright: false };
    let stature = upright.or_else(|| by_legs(&person)).unwrap_or(own);
    let mut model = model(&person, kind)?;
    for (link, found) in model.links.iter_mut().zip(skeleton.links()) {
        link.link.position = found.position;
    }
    Ok(Subject { person, model, skeleton, markers, rms_m, unknown, unseen_trunk: None, stature, root })
}

/// Frames of markers and what is known beside them, of which a person's model is made.
struct Question<'a> {
    labels: &'a [String],
    frames: &'a [Vec<Option<Vector3<f64>>>],
    kind: HumanModel,
    known: &'a Known,
}

impl Question<'_> {
    /// Returns the markers whose names say nothing.
    fn unknown(&self) -> Vec<String> {
        let own = &self.known.own_markers.marker;
        let naming = Naming::of(self.labels);
        self.labels.iter().filter(|l| !naming.knows(l) && !own.contains_key(*l)).cloned().collect()
    }

    /// Returns a person's model with the markers that were seen at all.
    fn attached(&self, person: &Person) -> Result<(Model, Skeleton, Vec<Attached>), SubjectError> {
        let seen_once = |label: usize| self.frames.iter().any(|f| f.get(label).is_some_and(Option::is_some));
        let model = model(person, self.kind)?;
        let skeleton = Skeleton::new(&model).ok_or(SubjectError::Calibration)?;
        let mut markers = attach(&model, &skeleton, self.labels, person.height_m);
        let own = &self.known.own_markers;
        own.apply(&mut markers, self.labels, &model).map_err(SubjectError::OwnMarkers)?;
        markers.retain(|marker| seen_once(marker.label));
        Ok((model, skeleton, markers))
    }

    /// Returns the pose of the first frame that shows one, and gives the person the stature that it shows if
    /// none is known.
    fn first_pose(&self, person: &mut Person, unknown: &[String]) -> Result<Pose, SubjectError> {
        let (_, skeleton, markers) = self.attached(person)?;
        let anatomical = markers.iter().filter(|m| m.position_sigma_m < ANATOMICAL_M).count();
        if anatomical < FEWEST {
            let name = unknown.first().cloned().unwrap_or_default();
            return Err(SubjectError::Markers {
                known: anatomical,
                markers: self.labels.len(),
                unknown: name,
            });
        }
        let mut frames = self.frames.iter();
        let (first, _, scale) = frames
            .find_map(|f| similarity(&skeleton, &markers, &of_frame(&markers, f)))
            .ok_or(SubjectError::Calibration)?;
        let height_m = person.height_m * scale;
        if !(STATURES_M[0]..=STATURES_M[1]).contains(&height_m) {
            return Err(SubjectError::Stature { height_m });
        }
        if self.known.height_m.is_none() {
            person.height_m = height_m;
        }
        Ok(first)
    }

    /// Returns the stature of a frame in which the person is upright, by the poses of all frames; `None` if
    /// there is none.
    fn upright_stature(
        &self,
        person: &Person,
        (skeleton, poses): (&Skeleton, &[Pose]),
    ) -> Result<Option<Stature>, SubjectError> {
        let (model, nominal, markers) = self.attached(&Person { lengths_m: Vec::new(), ..person.clone() })?;
        let frame = upright_frame(&model, skeleton, poses).and_then(|frame| self.frames.get(frame));
        let found = frame.and_then(|frame| similarity(&nominal, &markers, &of_frame(&markers, frame)));
        let of = |scale: f64| Stature { height_m: person.height_m * scale, upright: true };
        Ok(found.map(|(.., scale)| of(scale)))
    }

    /// Refuses lengths from elsewhere that are another person's.
    fn refuse_other_person(&self, person: &Person) -> Result<(), SubjectError> {
        let Self { labels, frames, kind, known } = self;
        if known.lengths_m.is_empty() {
            return Ok(());
        }
        let refuse = |Other { name, given_m, found_m }| SubjectError::OtherPerson { name, given_m, found_m };
        unusual(&known.lengths_m, person).map(refuse).map_or(Ok(()), Err)?;
        // What markers alone say: beside these lengths they would agree with them.
        let without = Known { lengths_m: Vec::new(), ..Known::clone(known) };
        let alone = subject(labels, frames, *kind, &without)?;
        let Subject { model, skeleton, root, .. } = &alone;
        contradiction(&known.lengths_m, model, skeleton, root).map(refuse).map_or(Ok(()), Err)
    }
}

/// Returns the markers of a frame in the order of the attached ones.
fn of_frame(markers: &[Attached], frame: &[Option<Vector3<f64>>]) -> Seen {
    markers.iter().map(|m| frame.get(m.label).copied().flatten()).collect()
}

/// Refuses markers whose left and right are exchanged; `first` is a pose to begin from.
fn refuse_exchanged(
    skeleton: &Skeleton,
    markers: &[Attached],
    seen: &[Seen],
    first: &Pose,
) -> Result<(), SubjectError> {
    let left = rms(skeleton, markers, &seen[..seen.len().min(COMPARED)], first);
    let other: Vec<Seen> = seen.iter().take(COMPARED).map(|frame| exchanged(markers, frame)).collect();
    let start = other.iter().find_map(|f| similarity(skeleton, markers, f));
    let other = start.map(|(start, ..)| rms(skeleton, markers, &other, &start));
    match other.filter(|other| is_exchanged(left, *other)) {
        Some(other) => {
            let what = "all markers".to_owned();
            Err(SubjectError::Exchanged { what, left_mm: 1e3 * left, other_mm: 1e3 * other })
        }
        None => Ok(()),
    }
}

impl Subject {
    /// Returns a pose near that of a frame, of the person upright; `None` if too few markers were seen.
    pub fn first_pose(&self, seen: &Seen) -> Option<Pose> {
        similarity(&self.skeleton, &self.markers, seen).map(|(pose, ..)| pose)
    }

    /// Returns the links from one to the base, itself first.
    pub fn way(&self, link: usize) -> &[usize] {
        self.skeleton.way(link)
    }

    /// Returns a subject that the markers agree with as well: joints and markers moved by `L⁻ᵀ z`, with
    /// `L Lᵀ` what they say, and independent numbers z of variance 1 from `unit`. `None` if the model has no
    /// such skeleton.
    pub fn another(&self, mut unit: impl FnMut() -> f64) -> Option<Self> {
        let z = DVector::from_fn(self.root.nrows(), |_, _| unit());
        let moved = self.root.tr_solve_lower_triangular(&z)?;
        let three = |at: usize| Vector3::from_fn(|k, _| moved.get(at + k).copied().unwrap_or(0.0));
        let mut other = self.clone();
        let joints = self.model.links.len() - 1;
        for (i, link) in other.model.links.iter_mut().enumerate().skip(1) {
            link.link.position += three(3 * (i - 1));
        }
        for (m, marker) in other.markers.iter_mut().enumerate() {
            marker.position_m += three(3 * (joints + m));
        }
        other.skeleton = Skeleton::new(&other.model)?;
        Some(other)
    }

    /// Returns the subject with links fixed to their parents; `None` if the model has none of a name.
    pub fn with_fixed(mut self, names: &[String]) -> Option<Self> {
        for name in names {
            let link = self.model.link(name)?;
            self.model.links.get_mut(link)?.link.joint = Joint::Fixed;
        }
        self.skeleton = Skeleton::new(&self.model)?;
        Some(self)
    }
}

/// Makes joints mirror images of one another, and finds the markers' places anew.
fn mirrored(found: Calibrated, model: &Model, seen: &[Seen]) -> Result<Calibrated, SubjectError> {
    const NOT_AT_ALL: f64 = 1e-6;
    let mut skeleton = found.skeleton.clone();
    let at = |link: usize| found.skeleton.links()[link].position;
    for (i, link) in model.links.iter().enumerate().skip(1) {
        let own = at(i);
        let other = link.name.strip_prefix("l_").map(|rest| format!("r_{rest}"));
        let other = other.or_else(|| link.name.strip_prefix("r_").map(|rest| format!("l_{rest}")));
        let mirror = other.and_then(|name| model.link(&name)).map_or(own, &at);
        let mean = (own + Vector3::new(mirror.x, -mirror.y, mirror.z)) / 2.0;
        skeleton.shift(i, &(mean - own));
    }
    let sigma = vec![[NOT_AT_ALL; 3]; model.links.len() - 1];
    calibrate(&skeleton, &found.markers, &sigma, seen, &found.poses).ok_or(SubjectError::Calibration)
}

fn model(person: &Person, kind: HumanModel) -> Result<Model, ModelError> {
    match kind {
        HumanModel::Human34 => person.human34(),
        HumanModel::Human58 => person.human58(),
    }
}

/// Poses of frames that follow one another or lie apart: each is begun from the last one that was found.
fn follow(skeleton: &Skeleton, markers: &[Attached], seen: &[Seen], first: &Pose) -> Option<Vec<Pose>> {
    let mut solver = Solver::new(skeleton, markers);
    let mut last = first.clone();
    let mut poses = Vec::with_capacity(seen.len());
    for frame in seen {
        // The person may have turned since.
        let fresh = similarity(skeleton, markers, frame).map(|(pose, ..)| pose);
        let starts = [Some(last.clone()), fresh];
        let found = starts.into_iter().flatten().filter_map(|start| solver.solve(frame, &start));
        let squares = |d: &[Option<f64>]| d.iter().flatten().map(|v| v * v).sum::<f64>();
        let best = found.min_by(|a, b| squares(&a.distances_m).total_cmp(&squares(&b.distances_m)))?;
        last = best.pose.clone();
        poses.push(best.pose);
    }
    Some(poses)
}

/// Returns the root mean square of the distances, m, of the markers that are known best from their places in
/// the table.
fn rms(skeleton: &Skeleton, markers: &[Attached], seen: &[Seen], start: &Pose) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for (frame, pose) in seen.iter().zip(follow(skeleton, markers, seen, start).unwrap_or_default()) {
        let places = skeleton.places(&pose);
        for (marker, seen) in markers.iter().zip(frame).filter(|(m, _)| m.position_sigma_m < ANATOMICAL_M) {
            let Some(seen) = seen else { continue };
            let (turn, origin) = &places[marker.link];
            sum += (origin + turn * marker.position_m - seen).norm_squared();
            count += 1;
        }
    }
    (sum / count.max(1) as f64).sqrt()
}

/// Returns the pose at zero that is turned, moved and scaled onto the markers that are known best: pose, RMS
/// (m) and scale.
fn similarity(skeleton: &Skeleton, markers: &[Attached], seen: &Seen) -> Option<(Pose, f64, f64)> {
    let places = skeleton.places(&skeleton.zero());
    let known = markers.iter().zip(seen).filter(|(m, _)| m.position_sigma_m < ANATOMICAL_M);
    let pair = |(m, seen): (&Attached, &Option<Vector3<f64>>)| {
        Some((m.tells_stature, [places[m.link].1 + places[m.link].0 * m.position_m, (*seen)?]))
    };
    let all: Vec<(bool, [Vector3<f64>; 2])> = known.filter_map(pair).collect();
    if all.len() < FEWEST {
        return None;
    }
    let pairs: Vec<[Vector3<f64>; 2]> = all.iter().map(|(_, pair)| *pair).collect();
    let [a0, b0] = means(&pairs);
    let cross: Matrix3<f64> = pairs.iter().map(|[a, b]| (b - b0) * (a - a0).transpose()).sum();
    let turn = nearest_rotation(&cross)?;
    let scale = height_scale(&all).filter(|scale| *scale > 0.0)?;
    let attitude = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    let position = b0 - turn * a0 * scale;
    let left = pairs.iter().map(|[a, b]| (b - position - turn * a * scale).norm_squared()).sum::<f64>();
    let pose = Pose { position_m: Point3::from(position).coords, attitude, ..skeleton.zero() };
    Some((pose, (left / pairs.len() as f64).sqrt(), scale))
}

/// Returns how many times as high as the model's the markers are, of those that tell of the stature; of all
/// if those are too few.
fn height_scale(all: &[(bool, [Vector3<f64>; 2])]) -> Option<f64> {
    let telling: Vec<_> = all.iter().filter(|(tells, _)| *tells).map(|(_, pair)| *pair).collect();
    let pairs = if telling.len() < FEWEST { all.iter().map(|(_, pair)| *pair).collect() } else { telling };
    let [a0, b0] = means(&pairs);
    // Heights alone: legs may be apart.
    let sums = pairs.iter().fold((0.0, 0.0), |(above, own), [a, b]| {
        let (a, b) = (a.z - a0.z, b.z - b0.z);
        (above + a * b, own + a * a)
    });
    (sums.1 > 0.0).then(|| sums.0 / sums.1)
}

fn means(pairs: &[[Vector3<f64>; 2]]) -> [Vector3<f64>; 2] {
    [0, 1].map(|k| pairs.iter().map(|pair| pair[k]).sum::<Vector3<f64>>() / pairs.len() as f64)
}

/// Returns how well the table knows where the joint of each link is in its parent, 1 σ along the parent's
/// axes, m. Along a limb its length is open; across it the axis goes through the joint by definition.
fn joint_sigma(model: &Model, known: &Known) -> Vec<[f64; 3]> {
    const ACROSS: f64 = 0.001;
    let by_table = |name: &str| match name {
        "l_thigh" | "r_thigh" => [0.01; 3],
        "torso" | "lumbar" => [0.03, 0.005, 0.03],
        "chest" => [0.02, 0.005, 0.03],
        "head" | "cervical" => [0.03, 0.005, 0.05],
        "l_upper_arm" | "r_upper_arm" => [0.03, 0.03, 0.04],
        "l_clavicle" | "r_clavicle" | "l_scapula" | "r_scapula" => [0.005; 3],
        "l_radius" | "r_radius" => [ACROSS; 3],
        _ => [ACROSS, ACROSS, 0.06],
    };
    let of = |name: &str| {
        let mut sigma = by_table(name);
        let (length, axis) = match name.split_once('_').map_or("", |(_, core)| core) {
            "shank" => ("thigh", 2),
            "foot" => ("shank", 2),
            "forearm" | "ulna" => ("upper_arm", 2),
            "hand" => ("forearm", 2),
            "thigh" => ("hip_width", 1),
            "upper_arm" => ("shoulder_width", 1),
            _ => return sigma,
        };
        // `human58` has clavicles and scapulae on the way to the shoulder.
        if known.length(length).is_some() && sigma[axis] > LENGTH_SIGMA_M {
            sigma[axis] = LENGTH_SIGMA_M;
        }
        sigma
    };
    model.links.iter().skip(1).map(|l| of(&l.name)).collect()
}
