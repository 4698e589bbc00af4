//! A robot that moves on two feet, with what its joints, its base and its feet measure.
//!
//! The load of the ground follows from recursive Newton and Euler about centres of mass, and so do the
//! torques beside it: neither regressors nor screws.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::tree::Joint;

use super::noise::Noise;
use super::trees::TreeInstant;
use rigident_model::Model;
use rigident_model::base::{Rows, Situation};
use rigident_model::dynamics::{inverse_dynamics, inverse_dynamics_with};
use rigident_rows::tree::contact::ContactState;
use rigident_rows::tree::{BaseSensor, Contact, Foot, Frame, Ground, Input};

/// A recording of such a robot.
#[derive(Clone, Debug)]
pub struct OnFeet {
    /// Links of the two feet, whose sensors are at the links' origins in their axes.
    pub feet: [usize; 2],
    /// Samples per second.
    pub rate_hz: f64,
    /// Length, s.
    pub seconds: f64,
    /// Time at which it starts, s: others are other motions.
    pub start_s: f64,
    /// Size of the swings of base, legs and all else, rad.
    pub sizes: [f64; 3],
    /// 1 σ of torques, N m, forces, N, and moments, N m.
    pub noise: [f64; 3],
    /// Horizontal forces read this many times their value.
    pub horizontal_scale: f64,
    /// Horizontal forces are not to be believed.
    pub without_horizontal: bool,
    /// Seed of the noise.
    pub seed: u64,
}

impl OnFeet {
    /// Returns what is measured of a robot of these links and masses, as the input of its rows; `None` if the
    /// links make no tree, or a joint is free.
    pub fn input(&self, truth: &Model) -> Option<Input> {
        let mut input = self.unchosen(truth, &|_| truth)?;
        input.choose_rows().ok()?;
        Some(input)
    }

    /// Returns the same of a robot whose links and masses at a time, s, are those of `at`; which rows are
    /// free of what is not measured is left open.
    pub fn unchosen<'a>(&self, truth: &'a Model, at: &dyn Fn(f64) -> &'a Model) -> Option<Input> {
        let mut noise = Noise(Some(self.seed));
        let count = (self.seconds * self.rate_hz) as usize;
        let frames = (0..count).map(|row| self.frame(at(row as f64 / self.rate_hz), row, &mut noise));
        let frames = frames.collect::<Option<Vec<Frame>>>()?;
        let freedoms = truth.freedoms();
        let [torque, force, moment] = self.noise.map(|sigma| sigma.max(1e-3));
        let known = |k: usize| !(self.without_horizontal && k < 2);
        let feet = self.feet.map(|link| Foot {
            name: truth.links[link].name.clone(),
            link,
            position: Vector3::zeros(),
            rotation: Matrix3::identity(),
            known: std::array::from_fn(known),
            measured: std::array::from_fn(known),
            sigma: std::array::from_fn(|k| {
                if !known(k) {
                    0.0
                } else if k < 3 {
                    force
                } else {
                    moment
                }
            }),
        });
        let sigma = [[force; 3], [moment; 3]].concat().into_iter().chain(vec![torque; freedoms]);
        let sigma: Vec<f64> = sigma.collect();
        let pivots = Vec::new();
        let states = vec![ContactState { touching: vec![true; 2], unknown_efforts: Vec::new(), pivots }];
        let contact = Contact { feet: feet.to_vec(), unmeasured: Vec::new(), sigma: sigma.clone(), states };
        Some(Input {
            base: BaseSensor::Imu([0.0; 3]),
            situation: Situation { floating: true, rows: Rows::Both, mimic: false },
            channel_sigma: Some(sigma),
            contact: Some(contact),
            ..Input::tracked(truth.clone(), frames, self.rate_hz)
        })
    }

    fn frame(&self, truth: &Model, row: usize, noise: &mut Noise) -> Option<Frame> {
        let t = self.start_s + row as f64 / self.rate_hz;
        let [base, legs, rest] = self.sizes;
        let size = |name: &str, _: &Joint<f64>| {
            let is_leg =
                ["thigh", "shank", "foot", "hip", "knee", "ankle"].iter().any(|word| name.contains(word));
            if is_leg { legs } else { rest }
        };
        let now = TreeInstant::of_sizes(truth, base, &size, t);
        let (q, v, a) = (&now.positions, &now.rates, &now.accelerations);
        let all = inverse_dynamics(truth, &now.base, q, v, a)?;
        let places = places(truth, &now);
        // Each foot bears a share of the force and of the moment about the base, which goes to and fro.
        let share = 0.5 + 0.3 * (1.1 * t).sin();
        let on_feet = [(0, share), (1, 1.0 - share)].map(|(i, share)| {
            let (rotation, place) = places[self.feet[i]];
            let force = Vector3::new(all[0], all[1], all[2]) * share;
            let moment = Vector3::new(all[3], all[4], all[5]) * share - place.cross(&force);
            let (force, moment) = (rotation.tr_mul(&force), rotation.tr_mul(&moment));
            [force.x, force.y, force.z, moment.x, moment.y, moment.z]
        });
        let outside: Vec<(usize, [f64; 6])> = self.feet.into_iter().zip(on_feet).collect();
        let left = inverse_dynamics_with(truth, &now.base, q, v, a, &outside)?;
        let [torque, force, moment] = self.noise;
        let efforts = left[6..].iter().map(|effort| effort + noise.normal(torque)).collect();
        let mut read = |wrench: [f64; 6]| -> [f64; 6] {
            std::array::from_fn(|k| {
                let scale = if k < 2 { self.horizontal_scale } else { 1.0 };
                let reading = scale * wrench[k] + noise.normal(if k < 3 { force } else { moment });
                if self.without_horizontal && k < 2 { 0.0 } else { reading }
            })
        };
        let wrenches = on_feet.map(&mut read).to_vec();
        Some(Frame {
            time_ns: (row as f64 / self.rate_hz * 1e9).round() as u64,
            positions: now.positions.clone(),
            rates: now.rates.clone(),
            base: now.base,
            wrench: [0.0; 6],
            efforts,
            standing: Vec::new(),
            ground: Ground { wrenches, touching: vec![true; 2], state: 0 },
        })
    }
}

/// Returns the attitude and origin of every link in the base's frame.
fn places(model: &Model, now: &TreeInstant) -> Vec<(Matrix3<f64>, Vector3<f64>)> {
    let mut places = vec![(Matrix3::identity(), Vector3::zeros())];
    for (link, (rotation, _)) in model.links.iter().zip(&now.links).skip(1) {
        let (parent, origin) = places[link.link.parent];
        places.push((*rotation, origin + parent * link.link.position));
    }
    places
}
