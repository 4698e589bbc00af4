//! A frame with all links in motion, and the changes of predicted rows by a change of a joint or of the base.
//!
//! One of these serves all frames, one after the other: nothing is allocated for a frame without feet.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rigident_shared::tree::{BaseMotion, Joint, TreeError};

use super::contact::{Contact, forces};
use super::rows::BASE;
use super::{BaseSensor, Frame, Input};
use rigident_model::rows::Moving;

/// A vector of three numbers.
pub(super) type Three = Vector3<f64>;

/// Mass, first moment, tensor and momentum of links together, about a point.
#[derive(Clone, Copy)]
struct Composite {
    mass: f64,
    moment: Three,
    inertia: Matrix3<f64>,
    momentum: Three,
    angular: Three,
}

/// A change of the motion of a link and all beyond.
#[derive(Clone, Copy)]
struct Change {
    turn: Three,
    rate: Three,
    shift: Three,
    velocity: Three,
}

impl Change {
    const NONE: Self = Self {
        turn: Vector3::new(0.0, 0.0, 0.0),
        rate: Vector3::new(0.0, 0.0, 0.0),
        shift: Vector3::new(0.0, 0.0, 0.0),
        velocity: Vector3::new(0.0, 0.0, 0.0),
    };
}

/// A freedom of a joint.
#[derive(Clone, Copy)]
pub(super) struct Freedom {
    /// The link beyond.
    link: usize,
    /// Axis in base axes.
    axis: Three,
    slides: bool,
    /// Rate of the link that carries the axis of a turn, base axes.
    carrier: Three,
}

/// A frame with all links in motion.
#[derive(Clone)]
pub(super) struct Instant {
    /// The tree about the IMU, as [`super::rows::RowMaker::moving`] has it.
    pub(super) moving: Moving,
    /// Motion of the base.
    pub(super) base: BaseMotion<f64>,
    /// Parameters of the links, ten each.
    bodies: Vec<[f64; 10]>,
    composites: Vec<Composite>,
    pub(super) freedoms: Vec<Freedom>,
    /// By pairs of links: the second is above the first.
    above: Vec<bool>,
    /// Changes that each freedom makes in the feet's part of the measured side; empty without feet.
    ground: Vec<Vec<f64>>,
    /// Accelerations, which rows of momentum do not depend on.
    zeros: Vec<f64>,
    /// Place of the IMU in S if the wrench is among the rows.
    imu: Option<Three>,
    has_wrench: bool,
    has_efforts: bool,
}

/// A change of the motion.
#[derive(Clone, Copy)]
pub(super) enum Direction {
    /// Position of a freedom; of a ball a turn about an axis of the link.
    Position(usize),
    /// Rate of a freedom.
    Speed(usize),
    /// Rate of the base, by an axis.
    Rate(usize),
    /// Specific force of the base.
    Force(usize),
    /// Place of the base's IMU.
    LeverArm(usize),
}

/// Brings mass, first moment, tensor and momentum of each link and all beyond, about its origin, to the
/// present motion.
fn compose(moving: &Moving, bodies: &[[f64; 10]], all: &mut Vec<Composite>) {
    all.clear();
    all.extend(moving.states().iter().zip(bodies).map(|(state, phi)| {
        let [m, x, y, z, xx, yy, zz, yz, zx, xy] = *phi;
        let (turn, u, rate) = (&state.rotation, &state.velocity, &state.rate);
        let moment = turn * Vector3::new(x, y, z);
        let inertia = turn * Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz) * turn.transpose();
        Composite {
            mass: m,
            moment,
            inertia,
            momentum: u * m + rate.cross(&moment),
            angular: moment.cross(u) + inertia * rate,
        }
    }));
    for i in (1..all.len()).rev() {
        let parent = moving.links()[i].parent;
        let d = moving.states()[i].position - moving.states()[parent].position;
        let (c, cross) = (all[i], d.cross_matrix());
        let of_moment = c.moment.cross_matrix();
        let to = &mut all[parent];
        to.mass += c.mass;
        to.moment += c.moment + d * c.mass;
        to.inertia += c.inertia - (cross * of_moment + of_moment * cross) - cross * cross * c.mass;
        to.momentum += c.momentum;
        to.angular += c.angular + d.cross(&c.momentum);
    }
}

/// Brings the freedoms of all joints to the present motion.
fn turn_freedoms(moving: &Moving, frame: &Frame, all: &mut Vec<Freedom>) {
    all.clear();
    let (states, mut q) = (moving.states(), frame.positions.as_slice());
    let mut first = 0;
    for (i, link) in moving.links().iter().enumerate().skip(1) {
        let (state, parent) = (&states[i], &states[link.parent]);
        let own = q.get(..link.joint.coordinates()).unwrap_or_default();
        q = q.get(link.joint.coordinates()..).unwrap_or_default();
        let turning = |axis: Three, carrier: Three| Freedom { link: i, axis, slides: false, carrier };
        match &link.joint {
            Joint::Revolute(axis) => all.push(turning(state.rotation * axis, parent.rate)),
            Joint::Prismatic(axis) => {
                all.push(Freedom { slides: true, ..turning(state.rotation * axis, parent.rate) });
            }
            Joint::Universal(a, b) => {
                let second = own.get(1).copied().unwrap_or(0.0);
                let inner = rigident_shared::tree::joint::turn(b, second.sin(), second.cos());
                let axis = state.rotation * inner.tr_mul(a);
                let rate = frame.rates.get(first).copied().unwrap_or(0.0);
                all.push(turning(axis, parent.rate));
                all.push(turning(state.rotation * b, parent.rate + axis * rate));
            }
            Joint::Spherical => {
                let axes = state.rotation.column_iter();
                all.extend(axes.map(|axis| turning(axis.into_owned(), parent.rate)));
            }
            Joint::Fixed | Joint::Free => {}
        }
        first += link.joint.freedoms();
    }
}

impl Instant {
    /// Returns the tree at rest, with parameters of its links, ten each.
    pub(super) fn new(input: &Input, moving: Moving, bodies: Vec<[f64; 10]>) -> Self {
        let links = moving.links();
        let count = links.len();
        let mut above = vec![false; count * count];
        for (i, link) in links.iter().enumerate().skip(1) {
            above.copy_within(link.parent * count..(link.parent + 1) * count, i * count);
            above[i * count + link.parent] = true;
        }
        let imu = match input.base {
            BaseSensor::Imu(place) if input.has_wrench() => Some(Vector3::from(place)),
            _ => None,
        };
        Self {
            base: BaseMotion::still([0.0; 3]),
            composites: Vec::with_capacity(count),
            freedoms: Vec::with_capacity(moving.freedoms()),
            above,
            ground: Vec::new(),
            zeros: vec![0.0; moving.freedoms()],
            imu,
            has_wrench: input.has_wrench(),
            has_efforts: input.has_efforts(),
            bodies,
            moving,
        }
    }

    /// Brings everything to a frame.
    ///
    /// # Errors
    /// [`TreeError`] if the frame does not fit the tree.
    pub(super) fn set(&mut self, frame: &Frame, contact: Option<&Contact>) -> Result<(), TreeError> {
        self.moving.set(&frame.positions, &frame.rates, &self.zeros, &frame.base)?;
        self.base = frame.base;
        if let Some(contact) = contact {
            let standing = contact.standing(frame);
            let feet: Vec<_> = standing.into_iter().map(|(_, foot, wrench)| (foot, wrench)).collect();
            self.ground = forces::moved(&mut self.moving, &feet)?;
        }
        compose(&self.moving, &self.bodies, &mut self.composites);
        turn_freedoms(&self.moving, frame, &mut self.freedoms);
        Ok(())
    }

    /// Returns true if link j is above link i.
    fn is_above(&self, i: usize, j: usize) -> bool {
        self.above[i * self.composites.len() + j]
    }

    /// Returns the parent of a link.
    pub(super) fn parent(&self, i: usize) -> usize {
        self.moving.links().get(i).map_or(0, |link| link.parent)
    }

    /// Returns the freedoms of the joint of link i, by their numbers.
    pub(super) fn freedoms_of(&self, i: usize) -> impl Iterator<Item = (usize, &Freedom)> {
        self.freedoms.iter().enumerate().filter(move |(_, freedom)| freedom.link == i)
    }

    /// Returns the number of rows.
    pub(super) fn channels(&self) -> usize {
        let first = if self.has_wrench { 6 } else { 0 };
        first + if self.has_efforts { self.freedoms.len() } else { 0 }
    }

    /// Returns the number of directions that the motion may change by.
    pub(super) fn directions(&self) -> usize {
        2 * self.zeros.len() + 9
    }

    /// Returns what a turn and a change of rate of link i against its parent, axes of the link, do to its
    /// joint.
    pub(super) fn joint_moves(&self, i: usize, turn: &Three, spin: &Three, out: &mut Vec<(Direction, f64)>) {
        let rotation = self.moving.states()[i].rotation;
        let own: Vec<(usize, Three)> =
            self.freedoms_of(i).map(|(k, freedom)| (k, rotation.tr_mul(&freedom.axis))).collect();
        let mut both = |k: usize, position: f64, speed: f64| {
            out.extend([(Direction::Position(k), position), (Direction::Speed(k), speed)]);
        };
        if let [(first, a), (second, b)] = own[..] {
            let c = a.dot(&b);
            let Some(solve) = Matrix2::new(1.0, c, c, 1.0).try_inverse() else { return };
            let [turn, spin] = [turn, spin].map(|v| solve * Vector2::new(a.dot(v), b.dot(v)));
            both(first, turn.x, spin.x);
            both(second, turn.y, spin.y);
            return;
        }
        for (k, axis) in own {
            both(k, axis.dot(turn), axis.dot(spin));
        }
    }

    /// Writes what is predicted, smoothed and differentiated, without drives.
    pub(super) fn predict(&self, out: &mut [f64]) {
        out.fill(0.0);
        let (whole, motion) = (&self.composites[0], &self.base);
        let (w, a) = (&motion.rate, &motion.specific_force);
        self.put_base(
            [
                &(w.cross(&whole.momentum) + a * whole.mass),
                &(w.cross(&whole.angular) + whole.moment.cross(a)),
            ],
            [&whole.momentum, &whole.angular],
            out,
        );
        self.put_joints(out, |freedom| {
            let (c, u) = (&self.composites[freedom.link], self.moving.states()[freedom.link].velocity);
            let (n, changed) = (&freedom.axis, freedom.carrier.cross(&freedom.axis));
            if freedom.slides {
                (n.dot(a) * c.mass - changed.dot(&c.momentum), n.dot(&c.momentum))
            } else {
                let smoothed =
                    n.dot(&c.moment.cross(a)) - changed.dot(&c.angular) + n.dot(&u.cross(&c.momentum));
                (smoothed, n.dot(&c.angular))
            }
        });
    }

    /// Adds a wrench about the IMU, brought to S, to the rows of the base.
    fn put_base(&self, smoothed: [&Three; 2], differentiated: [&Three; 2], out: &mut [f64]) {
        let Some(place) = self.imu else { return };
        let channels = self.channels();
        for ([force, moment], first) in [(smoothed, 0), (differentiated, channels)] {
            let moment = moment + place.cross(force);
            let values = force.iter().chain(moment.iter());
            out.iter_mut().skip(first).zip(values).for_each(|(to, value)| *to += value);
        }
    }

    /// Adds numbers to the rows of the joints.
    fn put_joints(&self, out: &mut [f64], of: impl Fn(&Freedom) -> (f64, f64)) {
        if !self.has_efforts {
            return;
        }
        let first = if self.has_wrench { 6 } else { 0 };
        let (smoothed, differentiated) = out.split_at_mut(self.channels());
        let own = smoothed.iter_mut().zip(differentiated).skip(first);
        for ((smoothed, differentiated), freedom) in own.zip(&self.freedoms) {
            let (s, d) = of(freedom);
            *smoothed += s;
            *differentiated += d;
        }
    }

    /// Adds what a change of link i and all beyond does to base and joints.
    fn change(&self, i: usize, change: &Change, out: &mut [f64]) {
        let Change { turn, rate, shift, velocity } = change;
        let (own, state, motion) = (&self.composites[i], &self.moving.states()[i], &self.base);
        let (u, a, w) = (&state.velocity, &motion.specific_force, &motion.rate);
        let momentum =
            turn.cross(&(own.momentum - u * own.mass)) + rate.cross(&own.moment) + velocity * own.mass;
        let angular = turn.cross(&own.moment).cross(u)
            + turn.cross(&(own.angular - own.moment.cross(u)))
            + own.inertia * rate
            + own.moment.cross(velocity);
        let angular = angular + state.position.cross(&momentum) + shift.cross(&own.momentum);
        let moment = turn.cross(&own.moment) + shift * own.mass;
        self.put_base(
            [&w.cross(&momentum), &(w.cross(&angular) + moment.cross(a))],
            [&momentum, &angular],
            out,
        );
        let turned = -turn.cross(a);
        self.put_joints(out, |freedom| {
            let j = freedom.link;
            let (n, c, at) = (&freedom.axis, &self.composites[j], &self.moving.states()[j]);
            let carried = freedom.carrier.cross(n);
            if j == i || self.is_above(i, j) {
                let about = angular - at.position.cross(&momentum);
                return if freedom.slides {
                    (-carried.dot(&momentum), n.dot(&momentum))
                } else {
                    let smoothed =
                        n.dot(&moment.cross(a)) - carried.dot(&about) + n.dot(&at.velocity.cross(&momentum));
                    (smoothed, n.dot(&about))
                };
            }
            if !self.is_above(j, i) {
                return (0.0, 0.0);
            }
            let b = -turn.cross(u) + rate.cross(&(at.position - state.position)) + velocity;
            let momentum = b * c.mass + rate.cross(&c.moment);
            let angular = c.moment.cross(&b) + c.inertia * rate;
            let also = rate.cross(n);
            if freedom.slides {
                let smoothed = n.dot(&turned) * c.mass - also.dot(&c.momentum) - carried.dot(&momentum);
                (smoothed, n.dot(&momentum))
            } else {
                let smoothed = n.dot(&c.moment.cross(&turned)) - also.dot(&c.angular) - carried.dot(&angular)
                    + n.dot(&(b.cross(&c.momentum) + at.velocity.cross(&momentum)));
                (smoothed, n.dot(&angular))
            }
        });
    }

    /// Writes the column of a direction: smoothed and differentiated.
    pub(super) fn column(&self, direction: Direction, out: &mut [f64]) {
        out.fill(0.0);
        let (whole, motion) = (&self.composites[0], &self.base);
        let unit = |axis: usize| Matrix3::<f64>::identity().column(axis).into_owned();
        match direction {
            Direction::Position(k) => {
                let Some(f) = self.freedoms.get(k) else { return };
                let change = if f.slides {
                    Change { shift: f.axis, velocity: f.carrier.cross(&f.axis), ..Change::NONE }
                } else {
                    Change { turn: f.axis, rate: -f.axis.cross(&f.carrier), ..Change::NONE }
                };
                self.change(f.link, &change, out);
                // What the feet push is moved on the other side.
                let ground = self.ground.get(k).map_or(&[][..], Vec::as_slice);
                out.iter_mut().zip(ground).for_each(|(to, moved)| *to -= moved);
            }
            Direction::Speed(k) => {
                let Some(f) = self.freedoms.get(k) else { return };
                let change = if f.slides {
                    Change { velocity: f.axis, ..Change::NONE }
                } else {
                    Change { rate: f.axis, ..Change::NONE }
                };
                self.change(f.link, &change, out);
            }
            Direction::Rate(axis) => {
                let e = unit(axis);
                self.change(0, &Change { rate: e, ..Change::NONE }, out);
                let zero = Vector3::zeros();
                let by_rate = [&e.cross(&whole.momentum), &e.cross(&whole.angular)];
                self.put_base(by_rate, [&zero, &zero], out);
            }
            Direction::Force(axis) => {
                let (e, zero) = (unit(axis), Vector3::zeros());
                self.put_base([&(e * whole.mass), &whole.moment.cross(&e)], [&zero, &zero], out);
                self.put_joints(out, |freedom| {
                    let c = &self.composites[freedom.link];
                    let n = &freedom.axis;
                    let smoothed =
                        if freedom.slides { n.dot(&e) * c.mass } else { n.dot(&c.moment.cross(&e)) };
                    (smoothed, 0.0)
                });
            }
            Direction::LeverArm(axis) => {
                let e = unit(axis);
                let change = Change { shift: -e, velocity: -motion.rate.cross(&e), ..Change::NONE };
                self.change(BASE, &change, out);
                // The wrench is brought to S from where the IMU is.
                let force = motion.rate.cross(&whole.momentum) + motion.specific_force * whole.mass;
                let zero = Vector3::zeros();
                let moments = [e.cross(&force), e.cross(&whole.momentum)];
                self.put_base([&zero, &moments[0]], [&zero, &moments[1]], out);
            }
        }
    }

    /// Returns the place of a direction among all.
    pub(super) fn place(&self, direction: Direction) -> usize {
        let count = self.freedoms.len();
        match direction {
            Direction::Position(k) => k,
            Direction::Speed(k) => count + k,
            Direction::Rate(axis) => 2 * count + axis,
            Direction::Force(axis) => 2 * count + 3 + axis,
            Direction::LeverArm(axis) => 2 * count + 6 + axis,
        }
    }
}
