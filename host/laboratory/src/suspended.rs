//! The vibration paper's experiment as a laboratory records it: markers on platform and links, poses by
//! registration.

use hexapod::{BodyParameters, Mounting};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rigident_sim::suspension::paper::{self, POSTURES, RELEASE_RAD, posture_wxyz};
use rigident_sim::suspension::{
    Carrier, Motion, MotionCapture, Run, Spring, Start, Suspended, Suspension, SuspensionError,
};

use rigident_io::motion_capture::registration::register;
use rigident_io::recording::Recording;
use rigident_io::rig::{RigFile, SpringTable, SuspendedPlatformTable, SuspensionTable, TruthTable};

/// Rate of cameras and recordings, Hz.
pub const RATE_HZ: f64 = 120.0;
/// Length of the free vibration of a posture, s.
const POSTURE_S: f64 = 40.0;
/// Window after the release, s: the paper's.
const WINDOW_S: [f64; 2] = [3.0, 10.0];
/// Loss of the springs, s: a damping ratio of 0.3 % at 1 Hz.
const LOSS_S: f64 = 1e-3;
/// Origin of a single body's S in the platform, m.
const S_IN_P_M: [f64; 3] = [0.0, 0.0, 0.06];
/// Rates that a blow gives to a single body, rad/s: it turns faster than the paper's links, and comes to rest
/// sooner.
const TURNED_RADPS: [f64; 3] = [0.1, 0.15, 0.1];
/// Half the side of the markers' clusters on platform and links, m.
const CLUSTERS_M: [f64; 3] = [0.4, 0.4, 0.3];

/// The experiment.
#[derive(Clone, Debug)]
pub struct Experiment {
    rig: Suspension,
    noise_m: f64,
    seed: u64,
}

impl Experiment {
    /// Returns the experiment with the joint at `joint_m` in link 0 and white noise of markers along each
    /// axis.
    pub fn new(joint_m: [f64; 3], noise_m: f64, seed: u64) -> Self {
        let mut rig = paper::suspension(joint_m);
        rig.springs = rig.springs.iter().map(|spring| spring.with_loss(LOSS_S)).collect();
        Self { rig, noise_m, seed }
    }

    /// Returns one body on springs as much softer as it is lighter, its frame S above the middle of the
    /// platform.
    pub fn of_body(body: BodyParameters, noise_m: f64, seed: u64) -> Self {
        let own = Self::new(paper::JOINT_M, noise_m, seed);
        let mount = Mounting { position_m: S_IN_P_M, rotation_wxyz: [1.0, 0.0, 0.0, 0.0] };
        let carried = |body: &BodyParameters| own.rig.platform.mass_kg + body.mass_kg;
        let links: f64 = own.rig.links.iter().map(|link| link.body.mass_kg).sum();
        let lighter = carried(&body) / (carried(&own.rig.base) + links);
        let softer = |s: &Spring| {
            let (axial_npm, lateral_npm) = (lighter * s.axial_npm, lighter * s.lateral_npm);
            Spring { axial_npm, lateral_npm, ..*s }.with_loss(LOSS_S)
        };
        let springs = own.rig.springs.iter().map(softer).collect();
        Self { rig: Suspension { springs, base: body, links: Vec::new(), mount, ..own.rig }, ..own }
    }

    /// Returns the recording of the body that was struck.
    ///
    /// # Errors
    /// [`SuspensionError`] if nothing swings so.
    pub fn swing(&self) -> Result<Recording, SuspensionError> {
        let suspended = self.rig.at_rest(&[])?;
        let start = Start { rate_radps: TURNED_RADPS, ..paper::struck(&suspended, &[]) };
        let motion = suspended.simulate(&start, &Run::new(POSTURE_S, RATE_HZ))?;
        self.filmed(&motion, "swing", 0, 0.0)
    }

    /// Returns the rig file of its recordings: springs and platform as they are.
    pub fn rig_file(&self) -> RigFile {
        let spring = |s: &rigident_sim::suspension::Spring| SpringTable {
            at_m: s.at_m,
            axis: s.axis,
            axial_npm: s.axial_npm,
            lateral_npm: s.lateral_npm,
            std: None,
            length_m: None,
            clamped: false,
            diameter_m: None,
            preload_n: 0.0,
            pull_n: None,
            mass_kg: 0.0,
        };
        let platform = &self.rig.platform;
        let suspension = SuspensionTable {
            stiffness_std: Some(0.0),
            place_std_m: Some(0.0),
            axis_std_rad: Some(0.0),
            anchor_height_std_m: Some(0.0),
            share_std: Some(0.0),
            anchor_height_m: self.rig.springs.first().map(|s| s.at_m[2]),
            base_position_m: self.rig.mount.position_m,
            spring: self.rig.springs.iter().map(spring).collect(),
            platform: Some(SuspendedPlatformTable {
                mass_kg: platform.mass_kg,
                com_m: platform.com_m,
                inertia_com_kgm2: platform.inertia_com_kgm2,
                ..SuspendedPlatformTable::default()
            }),
            ..SuspensionTable::default()
        };
        let Some(joint_m) = self.rig.links.first().map(|link| link.joint_m) else {
            let BodyParameters { mass_kg, com_m, inertia_com_kgm2 } = self.rig.base;
            let truth = TruthTable { mass_kg, com_m, inertia_com_kgm2, apparent_offset_n_nm: None };
            return RigFile { suspension: Some(suspension), truth: Some(truth), ..RigFile::default() };
        };
        let links = format!(
            "[[link]]\nname = \"base\"\n[[link]]\nname = \"arm\"\nparent = \"base\"\njoint \
             = \"spherical\"\nposition_m = {joint_m:?}\n"
        );
        RigFile { suspension: Some(suspension), ..RigFile::parse(&links).unwrap_or_default() }
    }

    /// Returns the attitude of link 1 in each posture, w, x, y, z.
    pub fn postures() -> Vec<[f64; 4]> {
        POSTURES.iter().map(posture_wxyz).collect()
    }

    /// Returns the recording of a locked posture that was struck.
    ///
    /// # Errors
    /// [`SuspensionError`] if nothing swings so.
    pub fn posture(&self, number: usize, wxyz: [f64; 4]) -> Result<Recording, SuspensionError> {
        let mut rig = self.rig.clone();
        rig.links.iter_mut().for_each(|link| link.locked = true);
        let suspended = rig.at_rest(&[wxyz])?;
        let motion =
            suspended.simulate(&paper::struck(&suspended, &[wxyz]), &Run::new(POSTURE_S, RATE_HZ))?;
        self.filmed(&motion, &format!("posture{}", number + 1), number as u64, 0.0)
    }

    /// Returns the recording of link 1 released 25 degrees off its rest about x and y.
    ///
    /// # Errors
    /// [`SuspensionError`] if nothing swings so.
    pub fn release(&self) -> Result<Recording, SuspensionError> {
        let half = RELEASE_RAD * std::f64::consts::FRAC_1_SQRT_2;
        let suspended: Suspended = self.rig.at_rest(&[paper::hanging_wxyz()])?;
        let motion =
            suspended.simulate(&paper::released([half, half, 0.0]), &Run::new(WINDOW_S[1], RATE_HZ))?;
        self.filmed(&motion, "release", 100, WINDOW_S[0])
    }

    fn filmed(
        &self,
        motion: &Motion,
        name: &str,
        stream: u64,
        from_s: f64,
    ) -> Result<Recording, SuspensionError> {
        let carriers = [Carrier::Platform, Carrier::Link(0), Carrier::Link(1)];
        let carriers = &carriers[..if self.rig.links.is_empty() { 1 } else { 3 }];
        let clusters: Vec<_> =
            carriers.iter().zip(CLUSTERS_M).map(|(on, half)| MotionCapture::cluster(*on, half)).collect();
        let mut capture = MotionCapture::of(clusters.concat());
        (capture.noise_m, capture.rate_hz) = (self.noise_m, RATE_HZ);
        capture.seed = self.seed.wrapping_mul(1000).wrapping_add(stream);
        let film = capture.film(motion)?;
        let first = (from_s * RATE_HZ).round() as usize;
        let (mut platform, mut attitudes, mut time_ns) = (Vec::new(), Vec::new(), Vec::new());
        for (k, frame) in film.seen_m.iter().enumerate().skip(first) {
            let mut at = 0;
            let poses: Option<Vec<_>> = clusters
                .iter()
                .map(|cluster| {
                    let own: Vec<Vector3<f64>> = cluster.iter().map(|m| Vector3::from(m.at_m)).collect();
                    let seen: Vec<_> =
                        frame[at..at + own.len()].iter().map(|s| s.map(Vector3::from)).collect();
                    at += own.len();
                    register(&own, &seen)
                })
                .collect();
            let Some(poses) = poses else { continue };
            let (p, q) = poses[0];
            platform.push([p.x, p.y, p.z, q.w, q.i, q.j, q.k]);
            if let [_, base, arm] = poses.as_slice() {
                let turn: UnitQuaternion<f64> = base.1.inverse() * arm.1;
                attitudes.push([turn.w, turn.i, turn.j, turn.k]);
            }
            time_ns.push(((k - first) as f64 / RATE_HZ * 1e9).round() as u64);
        }
        Ok(Recording {
            name: name.to_owned(),
            rig: self.rig_file(),
            time_ns,
            rate_hz: Some(RATE_HZ),
            platform: Some(platform),
            attitudes: if attitudes.is_empty() { Vec::new() } else { vec![(1, attitudes)] },
            ..Recording::default()
        })
    }
}

/// Returns the base parameters M, MS_0, J_0, MS_1, J_1 of the paper's Table 1 with the joint at the origin,
/// in the order of
/// [`rigident_vibration::suspension::postures`]: kg, kg m, kg m².
pub fn truth() -> [f64; 19] {
    let (base, arm) = (paper::link_0(), paper::link_1());
    let about = |b: &hexapod::BodyParameters| {
        let c = Vector3::from(b.com_m);
        let [xx, yy, zz, yz, zx, xy] = b.inertia_com_kgm2;
        let i = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz)
            + (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * b.mass_kg;
        (c * b.mass_kg, [i.m11, i.m22, i.m33, i.m23, i.m13, i.m12])
    };
    let ((ms0, j0), (ms1, j1)) = (about(&base), about(&arm));
    let mut all = [0.0; 19];
    all[0] = base.mass_kg + arm.mass_kg;
    all[1..4].copy_from_slice(ms0.as_slice());
    all[4..10].copy_from_slice(&j0);
    all[10..13].copy_from_slice(ms1.as_slice());
    all[13..].copy_from_slice(&j1);
    all
}
