//! A humanoid of thirty links that picks something up and drops it, with what its own sensors read: for the
//! watch over a robot.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{Joint, Link};

use super::noise::Noise;
use super::on_feet::OnFeet;
use rigident_model::{Model, ModelLink};
use rigident_rows::tree::{Input, NoisySignal, SignalKind};

/// Frames per second.
pub const RATE_HZ: f64 = 500.0;

/// Tells what happens, and how well it is measured.
#[derive(Clone, Debug)]
pub struct PicksUp {
    /// Length, s.
    pub seconds: f64,
    /// The hand holds it from the first time to the second, s; `None`: never.
    pub holds_s: Option<[f64; 2]>,
    /// The link that holds it.
    pub link: &'static str,
    /// The mass that the link holds, kg. Below zero, the link has lost it from the first time to the second.
    pub mass_kg: f64,
    /// Links weigh up to this much more or less than known, their centres and radii of gyration are off by
    /// half of it.
    pub off: f64,
    /// 1 σ of the joints' rates, rad/s, the IMU's specific force, m/s², and rate, rad/s.
    pub noise: [f64; 3],
    /// Seed of motion, errors and noise.
    pub seed: u64,
}

impl Default for PicksUp {
    fn default() -> Self {
        Self {
            seconds: 40.0,
            holds_s: None,
            link: HAND,
            mass_kg: 0.5,
            off: 0.03,
            noise: [0.005, 0.05, 0.002],
            seed: 1,
        }
    }
}

/// Name of the link that picks up where nothing else is said.
pub const HAND: &str = "r_hand";
/// The place where it holds the thing, in its frame, m.
pub const GRIP_M: [f64; 3] = [0.02, 0.0, -0.08];

/// Parameters of a body of this mass, centre, and radii of gyration.
fn body(mass: f64, centre: [f64; 3], radii: [f64; 3]) -> [f64; 10] {
    let [a, b, c] = radii.map(|r| mass * r * r);
    let tensor = Matrix3::from_diagonal(&Vector3::new(b + c, c + a, a + b));
    InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::from_array(centre), tensor)
        .to_vector()
}

/// Returns a pelvis, two legs of six axes, a trunk of three, a head of one, two arms of seven.
pub fn humanoid() -> Model {
    let base =
        Link { parent: 0, joint: Joint::Free, rotation: Matrix3::identity(), position: Vector3::zeros() };
    let own = body(9.0, [0.0, 0.0, -0.03], [0.07, 0.1, 0.06]);
    let mut links = vec![ModelLink::new("pelvis", "", base, Some(own))];
    let mut add = |parent: usize, name: String, axis: usize, place: [f64; 3], mass: f64, length: f64| {
        let mut along = Vector3::zeros();
        along[axis] = 1.0;
        let link = Link {
            parent,
            joint: Joint::Revolute(along),
            rotation: Matrix3::identity(),
            position: place.into(),
        };
        let radius = 0.25 * length.abs().max(0.1);
        let centre = [0.01, 0.0, 0.5 * length];
        let own = body(mass, centre, [0.5 * radius, 0.6 * radius, radius]);
        links.push(ModelLink::new(name.clone(), format!("{name}_joint"), link, Some(own)));
        links.len() - 1
    };
    for (side, y) in [("l_", 0.09), ("r_", -0.09)] {
        let named = |name: &str| format!("{side}{name}");
        let yaw = add(0, named("hip_yaw"), 2, [0.0, y, -0.08], 1.2, -0.06);
        let roll = add(yaw, named("hip_roll"), 0, [0.0, 0.0, -0.05], 1.4, -0.04);
        let thigh = add(roll, named("thigh"), 1, [0.0; 3], 5.5, -0.36);
        let shank = add(thigh, named("shank"), 1, [0.0, 0.0, -0.36], 3.0, -0.36);
        let ankle = add(shank, named("ankle"), 1, [0.0, 0.0, -0.36], 0.4, -0.03);
        add(ankle, named("foot"), 0, [0.0, 0.0, -0.03], 0.9, -0.05);
    }
    let yaw = add(0, "waist".to_owned(), 2, [0.0, 0.0, 0.1], 2.0, 0.08);
    let roll = add(yaw, "belly".to_owned(), 0, [0.0, 0.0, 0.08], 3.0, 0.1);
    let chest = add(roll, "chest".to_owned(), 1, [0.0, 0.0, 0.1], 12.0, 0.3);
    add(chest, "head".to_owned(), 2, [0.0, 0.0, 0.35], 3.5, 0.2);
    for (side, y) in [("l_", 0.18), ("r_", -0.18)] {
        let named = |name: &str| format!("{side}{name}");
        let pitch = add(chest, named("shoulder"), 1, [0.0, y, 0.28], 1.0, -0.03);
        let roll = add(pitch, named("shoulder_roll"), 0, [0.0; 3], 0.8, -0.05);
        let upper = add(roll, named("upper_arm"), 2, [0.0, 0.0, -0.06], 1.4, -0.2);
        let fore = add(upper, named("forearm"), 1, [0.0, 0.0, -0.22], 0.9, -0.1);
        let twist = add(fore, named("wrist_yaw"), 2, [0.0, 0.0, -0.12], 0.6, -0.1);
        let wrist = add(twist, named("wrist"), 1, [0.0, 0.0, -0.1], 0.2, -0.03);
        add(wrist, named("hand"), 0, [0.0; 3], 0.5, -0.1);
    }
    Model { name: "humanoid".to_owned(), links, findings: Vec::new(), gravity_mps2: None }
}

impl PicksUp {
    /// Returns what the thing adds to the parameters of the hand.
    pub fn thing(&self) -> [f64; 10] {
        body(self.mass_kg, GRIP_M, [0.02, 0.03, 0.02])
    }

    /// Returns what is known of the robot, what is measured of it, and the link that picks up; `None` if
    /// there is no such link.
    pub fn input(&self) -> Option<(Model, Input, usize)> {
        let mut noise = Noise(Some(self.seed.wrapping_mul(0x9e37_79b9).wrapping_add(77)));
        let known = humanoid();
        let hand = known.link(self.link)?;
        let mut truth = known.clone();
        for phi in truth.links.iter_mut().filter_map(|link| link.nominal.as_mut()) {
            let mut off = |part: f64| 1.0 + part * self.off * (2.0 * noise.uniform() - 1.0);
            let (mass, scale) = (off(1.0), off(0.5));
            let powers = [0, 1, 1, 1, 2, 2, 2, 2, 2, 2];
            phi.iter_mut().zip(powers).for_each(|(value, power)| *value *= mass * scale.powi(power));
        }
        let mut loaded = truth.clone();
        let held = loaded.links[hand].nominal.as_mut()?;
        held.iter_mut().zip(self.thing()).for_each(|(value, more)| *value += more);
        let feet = [known.link("l_foot")?, known.link("r_foot")?];
        let walk = OnFeet {
            feet,
            rate_hz: RATE_HZ,
            seconds: self.seconds,
            start_s: 1000.0 * noise.uniform(),
            sizes: [0.05, 0.06, 0.35],
            noise: [0.1, 1.0, 0.1],
            horizontal_scale: 1.0,
            without_horizontal: false,
            seed: self.seed,
        };
        let holds = |t: f64| self.holds_s.is_some_and(|[from, to]| t >= from && t < to);
        let at = |t: f64| if holds(t) { &loaded } else { &truth };
        let mut input = walk.unchosen(&truth, &at)?;
        let [joints, force, rate] = self.noise;
        for frame in &mut input.frames {
            frame.rates.iter_mut().for_each(|value| *value += noise.normal(joints));
            frame.base.specific_force.iter_mut().for_each(|value| *value += noise.normal(force));
            frame.base.rate.iter_mut().for_each(|value| *value += noise.normal(rate));
        }
        let signal =
            NoisySignal { kind: SignalKind::Accelerometer, link: 0, stated: Some(force), found: force };
        input.signals = vec![signal];
        input.model = known.clone();
        Some((known, input, hand))
    }
}
