//! A person who steps about on a force plate in front of cameras: markers and forces as a laboratory records
//! them.
//!
//! Feet are planted and lifted in turn, legs follow by inverse kinematics, everything else swings. Forces
//! come from differences of places in time (Newton and Euler of every segment), and share nothing with the
//! rows that identify them.

use std::f64::consts::TAU;

use hexapod::STANDARD_GRAVITY_MPS2;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::Body;
use rigident_shared::tree::Joint;

use super::noise::Noise;
use rigident_io::motion_capture::ground::GroundWrench;
use rigident_io::motion_capture::markers::Markers;
use rigident_io::motion_capture::trial::Trial;
use rigident_model::Model;
use rigident_people::inverse_kinematics::landmarks::attach;
use rigident_people::inverse_kinematics::marker_file::{MarkerFile, OwnMarker};
use rigident_people::inverse_kinematics::skeleton::{Place, Pose, Skeleton, Turn};

/// Markers that laboratories place.
const ANATOMICAL: [&str; 39] = [
    "LASI",
    "RASI",
    "LPSI",
    "RPSI",
    "C7",
    "T10",
    "CLAV",
    "STRN",
    "LSHO",
    "RSHO",
    "LFHD",
    "RFHD",
    "LBHD",
    "RBHD",
    "LKNE",
    "RKNE",
    "LANK",
    "RANK",
    "LHEE",
    "RHEE",
    "LTOE",
    "RTOE",
    "LELB",
    "RELB",
    "LWRA",
    "RWRA",
    "LWRB",
    "RWRB",
    "LFIN",
    "RFIN",
    "L.Knee.Med",
    "R.Knee.Med",
    "L.Ankle.Med",
    "R.Ankle.Med",
    "L.Elbow.Med",
    "R.Elbow.Med",
    "L.MT5",
    "R.MT5",
    "Top.Head",
];
/// Markers of a cluster on every link.
const CLUSTER: usize = 3;
/// Half the edge of the force plate, m.
const PLATE_M: f64 = 0.8;
/// Time from one foot to the other and back, s.
const STEP_S: f64 = 3.4;
/// Forces a marker's frame.
const FORCES: usize = 4;
/// Step of differences in time, s.
const STENCIL_S: f64 = 1e-3;

/// A laboratory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Laboratory {
    /// Frames per second.
    pub rate_hz: f64,
    /// Length of a trial, s.
    pub seconds: f64,
    /// 1 σ of every marker's place, m.
    pub marker_m: f64,
    /// 1 σ of force and moment of the plate, N and N m.
    pub plate: [f64; 2],
}

impl Default for Laboratory {
    fn default() -> Self {
        Self { rate_hz: 100.0, seconds: 20.0, marker_m: 5e-4, plate: [1.0, 0.3] }
    }
}

/// A person: a model with ten parameters of every link, and markers on it.
pub struct Somebody {
    model: Model,
    skeleton: Skeleton,
    parameters: Vec<[f64; 10]>,
    /// Name, link and place on it, m.
    markers: Vec<(String, usize, Vector3<f64>)>,
    clusters: MarkerFile,
}

impl Somebody {
    /// Returns a person of a model so tall, with anatomical markers near where they belong and clusters of
    /// others; `None` if its joints do not all turn, or it has no legs.
    pub fn new(model: &Model, parameters: &[f64], height_m: f64, seed: u64) -> Option<Self> {
        let skeleton = Skeleton::new(model)?;
        let mut noise = Noise(Some(seed));
        let labels: Vec<String> = ANATOMICAL.iter().map(|name| (*name).to_owned()).collect();
        let mut markers = Vec::new();
        for at in attach(model, &skeleton, &labels, height_m) {
            let off = Vector3::from_fn(|_, _| noise.normal(0.5 * at.position_sigma_m.min(0.02)));
            markers.push((at.name, at.link, at.position_m + off));
        }
        let mut clusters = MarkerFile::default();
        for (i, link) in model.links.iter().enumerate() {
            let along = model.links.iter().find(|l| l.link.parent == i && l.name != link.name);
            let end = along.map_or(Vector3::new(0.0, 0.0, -0.1), |l| l.link.position);
            for k in 0..CLUSTER {
                let name = format!("{}_{k}", link.name);
                let around = Vector3::from_fn(|_, _| 0.05 * (2.0 * noise.uniform() - 1.0));
                markers.push((name.clone(), i, end * 0.6 + around));
                let own = OwnMarker { segment: link.name.clone(), position_m: None, sigma_m: None };
                clusters.marker.insert(name, own);
            }
        }
        let parameters = parameters.as_chunks::<10>().0.to_vec();
        ["l_foot", "r_foot"].iter().all(|foot| model.link(foot).is_some()).then_some(Self {
            model: model.clone(),
            skeleton,
            parameters,
            markers,
            clusters,
        })
    }

    /// Returns which segment each marker of a cluster is on.
    pub fn clusters(&self) -> &MarkerFile {
        &self.clusters
    }

    /// Returns a trial in a laboratory: another motion and other noise for every seed.
    pub fn trial(&self, name: &str, laboratory: &Laboratory, seed: u64) -> Trial {
        self.trial_of(name, laboratory, seed, &|_| 1.0)
    }

    /// Returns a trial in which links swing by shares of what they do in [`Somebody::trial`]: feet are lifted
    /// by that of the foot, and the weight goes from foot to foot by that of the pelvis.
    pub fn trial_of(
        &self,
        name: &str,
        laboratory: &Laboratory,
        seed: u64,
        share: &dyn Fn(&str) -> f64,
    ) -> Trial {
        let mut noise = Noise(Some(seed.wrapping_mul(1000)));
        let mut dance = Dance::new(self, &mut noise);
        dance.restrain(share);
        self.recorded(name, laboratory, &|time_s| dance.pose(time_s), &mut noise)
    }

    /// Returns a trial of a second in which the person stands upright.
    pub fn standing(&self, laboratory: &Laboratory, seed: u64) -> Trial {
        let mut noise = Noise(Some(seed));
        let mut upright = self.skeleton.zero();
        upright.position_m.z = Dance::new(self, &mut noise).standing_m();
        let second = Laboratory { seconds: 1.0, ..*laboratory };
        self.recorded("standing", &second, &|_| upright.clone(), &mut noise)
    }

    fn recorded(
        &self,
        name: &str,
        laboratory: &Laboratory,
        pose: &dyn Fn(f64) -> Pose,
        noise: &mut Noise,
    ) -> Trial {
        let count = (laboratory.seconds * laboratory.rate_hz) as usize;
        let mut points_m = Vec::with_capacity(count * self.markers.len());
        for frame in 0..count {
            let places = self.skeleton.places(&pose(frame as f64 / laboratory.rate_hz));
            for (_, link, at) in &self.markers {
                let (turn, origin) = &places[*link];
                let seen = (origin + turn * at).map(|v| v + noise.normal(laboratory.marker_m));
                points_m.push(seen.map(|v| v as f32).into());
            }
        }
        let rate_hz = laboratory.rate_hz * FORCES as f64;
        let [force, moment] = laboratory.plate;
        let wrench = (0..count * FORCES).map(|sample| {
            let w = self.wrench(pose, sample as f64 / rate_hz);
            std::array::from_fn(|c| w[c] + noise.normal(if c < 3 { force } else { moment }))
        });
        let corners = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        let ground = GroundWrench {
            name: "plate 1".to_owned(),
            corners_m: Some(corners.map(|[x, y]| [PLATE_M * x, PLATE_M * y, 0.0])),
            rate_hz,
            first_s: 0.0,
            mean_s: 0.0,
            wrench: wrench.map(|w| w.map(|v| v as f32)).collect(),
        };
        Trial {
            name: name.to_owned(),
            rate_hz: laboratory.rate_hz,
            first_s: 0.0,
            labels: self.markers.iter().map(|(name, ..)| name.clone()).collect(),
            markers: Markers::new(self.markers.len(), points_m),
            ground: vec![ground],
            notes: Vec::new(),
        }
    }

    /// Returns the ground's force and moment about the laboratory's origin at an instant, N and N m.
    fn wrench(&self, pose: &dyn Fn(f64) -> Pose, time_s: f64) -> [f64; 6] {
        let h = STENCIL_S;
        let around: [Vec<Place>; 5] =
            std::array::from_fn(|k| self.skeleton.places(&pose(time_s + (k as f64 - 2.0) * h)));
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        for (i, phi) in self.parameters.iter().enumerate() {
            let body = InertialParameters::<Body, f64>::from_vector(*phi);
            if body.mass <= 0.0 {
                continue;
            }
            let centre = Vector3::from(body.centre_of_mass().array());
            let turns: [Matrix3<f64>; 5] = std::array::from_fn(|k| around[k][i].0);
            let at: [Vector3<f64>; 5] = std::array::from_fn(|k| around[k][i].1 + around[k][i].0 * centre);
            // Differences of the fourth order.
            let second = (16.0 * (at[1] + at[3]) - at[0] - at[4] - 30.0 * at[2]) / (12.0 * h * h);
            let rate = (8.0 * (turns[3] - turns[1]) - turns[4] + turns[0]) / (12.0 * h);
            let change =
                ((turns[1] + turns[3]) * 16.0 - turns[0] - turns[4] - turns[2] * 30.0) / (12.0 * h * h);
            let turn = turns[2];
            // Ṙ Rᵀ = [ω]×, and R̈ Rᵀ = [ω̇]× + [ω]×².
            let omega = axial(&(rate * turn.transpose()));
            let alpha = axial(&(change * turn.transpose()));
            let tensor = turn * body.inertia_com() * turn.transpose();
            let own = (second + Vector3::z() * STANDARD_GRAVITY_MPS2) * body.mass;
            force += own;
            moment += at[2].cross(&own) + tensor * alpha + omega.cross(&(tensor * omega));
        }
        [force.x, force.y, force.z, moment.x, moment.y, moment.z]
    }
}

/// Returns the vector of the skew part of a matrix.
fn axial(m: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]) / 2.0
}

/// A sine of time.
#[derive(Clone, Copy)]
struct Wave {
    amplitude: f64,
    frequency_hz: f64,
    phase: f64,
}

impl Wave {
    fn at(&self, time_s: f64) -> f64 {
        self.amplitude * (TAU * self.frequency_hz * time_s + self.phase).sin()
    }
}

/// The motion of a person.
struct Dance<'a> {
    somebody: &'a Somebody,
    /// Of the base: place, then turns; of every other link: turns.
    place: [Wave; 3],
    waves: Vec<[Wave; 3]>,
    /// Standing height of the base, m.
    height_m: f64,
    /// The share of all that every link does.
    shares: Vec<f64>,
}

impl<'a> Dance<'a> {
    fn new(somebody: &'a Somebody, noise: &mut Noise) -> Self {
        let mut wave = |amplitude: f64| Wave {
            amplitude: amplitude * (0.8 + 0.4 * noise.uniform()),
            frequency_hz: 0.3 + 0.7 * noise.uniform(),
            phase: TAU * noise.uniform(),
        };
        let place = [0.03, 0.0, 0.025].map(&mut wave);
        let links = &somebody.model.links;
        let waves = links.iter().map(|link| amplitudes(&link.name).map(&mut wave)).collect();
        let leg = ["l_shank", "l_foot"].iter().filter_map(|name| somebody.model.link(name));
        let height_m = leg.map(|link| links[link].link.position.norm()).sum::<f64>();
        Self { somebody, place, waves, height_m, shares: vec![1.0; links.len()] }
    }

    /// Makes links swing less.
    fn restrain(&mut self, share: &dyn Fn(&str) -> f64) {
        let links = &self.somebody.model.links;
        self.shares = links.iter().map(|link| share(&link.name)).collect();
        let own = self
            .waves
            .iter_mut()
            .zip(&self.shares)
            .flat_map(|(waves, by)| waves.iter_mut().map(move |w| (w, by)));
        own.for_each(|(wave, by)| wave.amplitude *= by);
        let base = self.share("pelvis");
        self.place.iter_mut().for_each(|wave| wave.amplitude *= base);
    }

    fn share(&self, link: &str) -> f64 {
        self.somebody.model.link(link).and_then(|link| self.shares.get(link)).copied().unwrap_or(1.0)
    }

    /// Returns the height of the base of a person who stands upright, m.
    fn standing_m(&self) -> f64 {
        self.height_m + self.ankle_m()
    }

    /// Returns the pose at an instant.
    fn pose(&self, time_s: f64) -> Pose {
        let model = &self.somebody.model;
        let mut pose = self.somebody.skeleton.zero();
        let sway = (TAU * time_s / STEP_S).sin();
        let [x, _, z] = self.place.map(|wave| wave.at(time_s));
        // Low enough for both feet to be reached.
        pose.position_m = Vector3::new(x, 0.085 * sway * self.share("pelvis"), self.standing_m() - 0.09 + z);
        pose.attitude = self.turned(0, time_s);
        for (i, link) in model.links.iter().enumerate().skip(1) {
            pose.turns[i] = match link.link.joint {
                Joint::Revolute(axis) => {
                    let wave = &self.waves[i][axis.iamax()];
                    // Elbows bend one way, about y backward.
                    let bent = if link.name.ends_with("forearm") || link.name.ends_with("ulna") {
                        -0.8
                    } else {
                        0.0
                    };
                    Turn::Hinge(bent + wave.at(time_s))
                }
                Joint::Spherical => Turn::Ball(self.turned(i, time_s)),
                _ => Turn::None,
            };
        }
        for (side, left) in [("l", 1.0), ("r", -1.0)] {
            // A foot leaves the ground while the other one carries.
            let lift = ((-left * sway - 0.4) / 0.6).max(0.0).powi(4) * self.share(&format!("{side}_foot"));
            self.leg(&mut pose, side, left, lift, time_s);
        }
        pose
    }

    /// Returns the height of the ankle above the sole of a planted foot, m.
    fn ankle_m(&self) -> f64 {
        0.039 * (self.height_m / 0.83) * 1.7
    }

    fn turned(&self, link: usize, time_s: f64) -> UnitQuaternion<f64> {
        let [x, y, z] = self.waves[link].map(|wave| wave.at(time_s));
        UnitQuaternion::from_euler_angles(x, y, z)
    }

    /// Brings a foot to where it is planted, or lifted to.
    fn leg(&self, pose: &mut Pose, side: &str, left: f64, lift: f64, time_s: f64) -> Option<()> {
        let model = &self.somebody.model;
        let link = |name: &str| model.link(&format!("{side}_{name}"));
        let (thigh, shank, foot) = (link("thigh")?, link("shank")?, link("foot")?);
        let position = |link: usize| model.links[link].link.position;
        let (l, s) = (position(shank).norm(), position(foot).norm());
        let [dx, dy, dz] = self.waves[foot].map(|wave| wave.at(time_s));
        let planted = Vector3::new(0.0, position(thigh).y * 1.1, self.ankle_m());
        let target = planted + Vector3::new(0.1 + dx, left * (0.08 + dy.abs() * 0.2), 0.2 + 0.2 * dz) * lift;
        let pelvis = pose.attitude.to_rotation_matrix().into_inner();
        let hip = pose.position_m + pelvis * position(thigh);
        let away = target - hip;
        let d = away.norm().min(0.999 * (l + s));
        let bent = ((d * d - l * l - s * s) / (2.0 * l * s)).clamp(-1.0, 1.0).acos();
        // The ankle in the thigh's axes, and the thigh's turn that brings it there with the knee's axis
        // sideways.
        let ankle = Vector3::new(-s * bent.sin(), 0.0, -l - s * bent.cos());
        let frame = |along: &Vector3<f64>, lateral: &Vector3<f64>| {
            let e = along.normalize();
            let y = (lateral - e * lateral.dot(&e)).normalize();
            Matrix3::from_columns(&[y.cross(&e), y, e])
        };
        let turn = frame(&away, &(pelvis * Vector3::y())) * frame(&ankle, &Vector3::y()).transpose();
        let knee = Rotation3::from_axis_angle(&Vector3::y_axis(), bent);
        let sole = Rotation3::from_euler_angles(0.3 * lift * dx, 0.5 * lift * (0.5 + dz), 0.3 * lift * dy);
        let ball = |m: Matrix3<f64>| {
            Turn::Ball(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m)))
        };
        pose.turns[thigh] = ball(pelvis.transpose() * turn);
        pose.turns[shank] = match model.links[shank].link.joint {
            Joint::Revolute(_) => Turn::Hinge(bent),
            _ => ball(knee.into_inner()),
        };
        pose.turns[foot] = ball((turn * knee.matrix()).transpose() * sole.matrix());
        Some(())
    }
}

/// Amplitudes of a link's turns about x, y and z, rad; of a foot how far it is carried, m.
fn amplitudes(name: &str) -> [f64; 3] {
    let of = |part: &str| name == part || name.ends_with(&format!("_{part}"));
    match name {
        "pelvis" => [0.06, 0.1, 0.15],
        _ if of("foot") => [0.2, 0.5, 0.5],
        _ if of("upper_arm") => [0.5, 0.6, 0.4],
        _ if of("forearm") || of("ulna") => [0.0, 0.6, 0.0],
        _ if of("radius") => [0.0, 0.0, 0.5],
        _ if of("hand") => [0.4, 0.4, 0.4],
        _ if of("head") => [0.25, 0.3, 0.4],
        _ if of("clavicle") || of("scapula") => [0.1, 0.1, 0.1],
        _ => [0.12, 0.15, 0.2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::person::somebody;
    use rigident_fit::{FitOptions, Silent};
    use rigident_model::human::Person as Standard;
    use rigident_people::body_segments::tool::{Compared, holding};
    use rigident_people::body_segments::{Study, StudyOptions};
    use rigident_people::person::{PeopleOptions, Person};

    const SHORT: Laboratory = Laboratory { rate_hz: 100.0, seconds: 12.0, marker_m: 5e-4, plate: [1.0, 0.3] };

    #[test]
    fn the_ground_carries_a_person_through_her_feet() {
        let model = Standard::default().human34().unwrap();
        let truth = somebody(&model, 3);
        let person = Somebody::new(&model, &truth, 1.741, 3).unwrap();
        let weight = truth.chunks(10).map(|phi| phi[0]).sum::<f64>() * STANDARD_GRAVITY_MPS2;
        let trial = person.trial("a", &Laboratory { plate: [0.0; 2], ..SHORT }, 5);
        let wrench = &trial.ground[0].wrench;
        let mean = wrench.iter().map(|w| f64::from(w[2])).sum::<f64>() / wrench.len() as f64;
        assert!((mean / weight - 1.0).abs() < 0.02, "{mean} {weight}");
        // Whoever stands still is carried by her weight alone, at her centre of mass.
        let still =
            person.standing(&Laboratory { plate: [0.0; 2], ..SHORT }, 5).ground[0].wrench[100].map(f64::from);
        assert!(
            (still[2] / weight - 1.0).abs() < 1e-6 && still[0].abs() + still[1].abs() < 1e-4,
            "{still:?}"
        );
        // The centre of pressure stays near the feet.
        let near = wrench.iter().filter(|w| (w[4] / w[2]).abs() < 0.3 && (w[3] / w[2]).abs() < 0.25).count();
        assert!(near as f64 > 0.98 * wrench.len() as f64, "{near} of {}", wrench.len());
    }

    #[test]
    fn mass_and_racket_of_a_simulated_person_come_out_of_markers_and_a_plate() {
        let racket = [0.33, 0.0, 0.0, -0.11, 0.05, 0.05, 0.002, 0.0, 0.0, 0.0];
        let model = Standard::default().human34().unwrap();
        let bare = somebody(&model, 4);
        let mut with = bare.clone();
        let hand = model.link("r_hand").unwrap();
        with.iter_mut().skip(10 * hand).zip(racket).for_each(|(v, more)| *v += more);
        let [with, without] = [&with, &bare].map(|all| Somebody::new(&model, all, 1.741, 9).unwrap());
        let mut trials: Vec<Trial> = (0..2).map(|k| with.trial(&format!("with {k}"), &SHORT, k)).collect();
        trials.extend((0..2).map(|k| without.trial(&format!("without {k}"), &SHORT, 10 + k)));
        let own_markers = with.clusters().clone();
        let options =
            PeopleOptions { own_markers, plates_zeroed: true, holding_first: 2, ..PeopleOptions::default() };
        let standing = without.standing(&SHORT, 1);
        let person = Person::new(&mut trials, Some(&standing), &options, &|_, _| {}).unwrap();
        let link = holding(&person, "r_hand").unwrap();
        let [held, mut empty] = [([0, 1], Some(link)), ([2, 3], None)].map(|(which, link)| {
            let options = (StudyOptions::default(), FitOptions::default());
            Study::holding(&person, &which, &options.0, &options.1, &Silent, link).unwrap()
        });
        empty.draw(&person, &trials, &Silent).unwrap();
        let fit = empty.with_calibration(empty.together(&[0, 1]).unwrap(), &[0, 1]);
        let mass = fit.data_alone().measured(0).unwrap();
        let kg = bare.chunks(10).map(|phi| phi[0]).sum::<f64>();
        // The scale of the plate is counted: 1 % that all share and 1 % of its own (1 σ each).
        let scale = 1.96 * 0.01 * 2.0_f64.sqrt() * kg;
        let beside = (mass.u95 * mass.u95 - scale * scale).max(0.0).sqrt();
        assert!((mass.value - kg).abs() < mass.u95 && beside < 0.01 * kg, "{mass:?} {kg} {beside}");
        let both = Compared { person: &person, trials: &trials, with: &held, without: &empty };
        let found = both.tool("r_hand", "racket", &|_| {}).unwrap();
        assert!((found.mass_kg.value - 0.33).abs() < found.mass_kg.u95, "{found:?}");
        assert!(found.mass_kg.u95 < 0.2 && found.inertia_kgm2[0].u95 < 0.1, "{found:?}");
        assert!((found.inertia_kgm2[0].value - 0.05).abs() < found.inertia_kgm2[0].u95, "{found:?}");
        let said = both.tool("tail", "racket", &|_| {}).unwrap_err().to_string();
        assert!(said.contains("there is no such link") && said.contains("r_hand"), "{said}");
    }

    #[test]
    fn a_load_carried_in_one_trial_of_two_is_reported() {
        let model = Standard::default().human34().unwrap();
        let bare = somebody(&model, 4);
        let hand = model.link("r_hand").unwrap();
        for carried in [0.0, 1.5] {
            let mut with = bare.clone();
            with[10 * hand] += carried;
            let [with, without] = [&with, &bare].map(|all| Somebody::new(&model, all, 1.741, 9).unwrap());
            let mut trials = vec![without.trial("without", &SHORT, 1), with.trial("with", &SHORT, 2)];
            let own_markers = with.clusters().clone();
            let options = PeopleOptions { own_markers, plates_zeroed: true, ..PeopleOptions::default() };
            let standing = without.standing(&SHORT, 1);
            let person = Person::new(&mut trials, Some(&standing), &options, &|_, _| {}).unwrap();
            let options = (StudyOptions::default(), FitOptions::default());
            let mut study = Study::new(&person, &[0, 1], &options.0, &options.1, &Silent).unwrap();
            study.draw(&person, &trials, &Silent).unwrap();
            let others = study.other_masses().unwrap();
            assert_eq!(others.is_empty(), carried == 0.0, "{carried} kg: {others:?}");
        }
    }

    #[test]
    fn a_zero_that_is_not_known_moves_the_mass_as_a_plate_that_reads_too_much_does() {
        let model = Standard::default().human34().unwrap();
        let body = Somebody::new(&model, &somebody(&model, 4), 1.741, 9).unwrap();
        let found = |too_much_n: f32| {
            let mut trials = vec![body.trial("first", &SHORT, 1), body.trial("second", &SHORT, 2)];
            trials[1].ground[0].wrench.iter_mut().for_each(|wrench| wrench[2] += too_much_n);
            let options = PeopleOptions { own_markers: body.clusters().clone(), ..PeopleOptions::default() };
            let person =
                Person::new(&mut trials, Some(&body.standing(&SHORT, 1)), &options, &|_, _| {}).unwrap();
            let options = (StudyOptions::default(), FitOptions::default());
            let mut study = Study::new(&person, &[0, 1], &options.0, &options.1, &Silent).unwrap();
            study.draw(&person, &trials, &Silent).unwrap();
            study
        };
        let (right, wrong) = (found(0.0), found(0.5));
        for both in [vec![0, 1], vec![1]] {
            let [a, b] = [&right, &wrong].map(|study| study.together(&both).unwrap());
            let shift = 10.0 * (b.estimate.unjudged().values[0] - a.estimate.unjudged().values[0]);
            // The vertical zero of the second trial's plate, 1 σ of which is 5 N; 5 N of the whole weight
            // are 0.51 kg.
            let zeros = right.moved(&both)[1].1.row(0).into_owned();
            assert!((shift / zeros[8].abs() - 1.0).abs() < 0.1, "{shift} {zeros}");
            assert_eq!(zeros[2] == 0.0, both.len() == 1, "{zeros}");
            let fit = right.with_calibration(a, &both);
            assert!(fit.estimate.measured(0).unwrap().u95 > 1.95 * zeros[8].abs());
        }
    }
}
