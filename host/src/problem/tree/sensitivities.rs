//! Columns of the errors of a tree's signals: what each changes in the wrench and the efforts that the parameters predict.
//!
//! With the momentum `h = (P, H)` of the links beyond a joint, their mass M, first moment c and tensor J, all about that joint's
//! link, a change of the motion there, a turn ε, a rate ζ beside the turned one, a shift s and its velocity z, moves
//! ```text
//! P by  ε×(P − M u) + ζ×c + M z        H by  (ε×c)×u + ε×(H − c×u) + J ζ + c×z
//! ```
//! and with them the rows of the base and of all joints above. A joint beyond sees itself at rest, and the rest turned the
//! other way: `a` by `−ε×a`, its own velocity by `b = −ε×u + ζ×d + z`. So each joint's coordinates and rates have columns in
//! one pass over the links, and an error of a signal is a sum of few of them.

use std::sync::{Mutex, PoisonError};

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rigident_shared::screening::Rejection;
use rigident_shared::tree::{Joint, LinkState, TreeError};

use super::contact::availability::Availability;
use super::contact::forces;
use super::rows::{BASE, RowMaker};
use super::{BaseSensor, Frame, Input, SignalError, SignalKind, TreeSource};
use crate::fit::{Kind, OtherColumns, Owner, Parameter, RowSource as _, SampleRows};
use crate::model::rows::Moving;

/// A step longer than so many periods is a gap.
const GAP: f64 = 1.5;

type Three = Vector3<f64>;

/// What links have in common about a point.
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
struct Freedom {
    link: usize,
    /// Axis in base axes.
    axis: Three,
    slides: bool,
    /// Rate of the link that carries the axis of a turn, base axes.
    carrier: Three,
}

/// Columns of a source's errors.
pub(super) struct ErrorRows<'a> {
    source: &'a TreeSource,
    bodies: Vec<[f64; 10]>,
    /// By links of the tree: its own IMU shows its motion.
    is_seen: Vec<bool>,
    /// By links: the links above.
    above: Vec<Vec<usize>>,
    /// What the parameters predict of every frame, smoothed and differentiated parts; empty without a skew.
    predicted: Vec<Vec<f64>>,
    moving: Mutex<Moving>,
}

/// A frame with all links in motion.
struct Instant<'a> {
    input: &'a Input,
    moving: &'a Moving,
    frame: &'a Frame,
    composites: Vec<Composite>,
    freedoms: Vec<Freedom>,
    above: &'a [Vec<usize>],
    /// What each freedom changes in what the feet add to the measured side; empty without feet.
    ground: Vec<Vec<f64>>,
}

impl<'a> ErrorRows<'a> {
    /// Returns the columns about parameters φ.
    ///
    /// # Errors
    /// [`TreeError`] if the frames do not fit the model.
    pub(super) fn new(source: &'a TreeSource, maker: &RowMaker, phi: &[f64]) -> Result<Self, TreeError> {
        let input = source.input();
        let moving = maker.moving().clone();
        let links = moving.links();
        let seen = |signal: &super::NoisySignal, i: usize| {
            signal.kind == SignalKind::Attitude && signal.link + BASE == i
        };
        let is_seen = (0..links.len()).map(|i| input.signals.iter().any(|s| seen(s, i))).collect();
        let mut above: Vec<Vec<usize>> = vec![Vec::new()];
        for link in links.iter().skip(1) {
            let mut own = above.get(link.parent).cloned().unwrap_or_default();
            own.push(link.parent);
            above.push(own);
        }
        let mut rows = Self {
            source,
            bodies: maker.bodies(phi),
            is_seen,
            above,
            predicted: Vec::new(),
            moving: Mutex::new(moving),
        };
        if input.errors.contains(&SignalError::Skew) {
            rows.predicted = rows.predictions(maker, phi)?;
        }
        Ok(rows)
    }

    /// Returns what the parameters predict of every frame, offsets of the wrench left out.
    fn predictions(&self, maker: &RowMaker, phi: &[f64]) -> Result<Vec<Vec<f64>>, TreeError> {
        let input = self.source.input();
        let first = if input.has_wrench() { 6 } else { 0 };
        let mut row = vec![0.0; phi.len()];
        let of_frame = |frame: &Frame| {
            let mut moving = self.moving.lock().unwrap_or_else(PoisonError::into_inner);
            let instant = self.instant(&mut moving, frame)?;
            let mut out = instant.predicted();
            let channels = out.len() / 2;
            if input.has_efforts() {
                for (k, smoothed) in (first..channels).flat_map(|c| [(c - first, true), (c - first, false)]) {
                    row.fill(0.0);
                    maker.add_drives(k, frame, smoothed, &mut row);
                    let drives: f64 = row.iter().zip(phi).map(|(a, b)| a * b).sum();
                    if let Some(to) = out.get_mut(first + k + if smoothed { 0 } else { channels }) {
                        *to += drives;
                    }
                }
            }
            Ok(out)
        };
        input.frames.iter().map(of_frame).collect()
    }

    fn instant<'f>(&'f self, moving: &'f mut Moving, frame: &'f Frame) -> Result<Instant<'f>, TreeError> {
        let zeros = vec![0.0; frame.rates.len()];
        moving.set(&frame.positions, &frame.rates, &zeros, &frame.base)?;
        let ground = match &self.source.input().contact {
            None => Vec::new(),
            Some(contact) => {
                let standing = contact.standing(frame);
                let feet: Vec<_> = standing.into_iter().map(|(_, foot, wrench)| (foot, wrench)).collect();
                forces::moved(moving, &feet)?
            }
        };
        let moving = &*moving;
        Ok(Instant {
            input: self.source.input(),
            moving,
            frame,
            composites: composites(moving, &self.bodies),
            freedoms: freedoms(moving, frame),
            above: &self.above,
            ground,
        })
    }

    /// Returns the derivative by time of what is predicted of a frame.
    fn slope(&self, sample: usize) -> Vec<f64> {
        let input = self.source.input();
        let own = self.predicted.get(sample).cloned().unwrap_or_default();
        let time = |k: usize| input.frames.get(k).map_or(0.0, |frame| frame.time_ns as f64 * 1e-9);
        let near = |other: Option<usize>| {
            let is_near = |k: &usize| (time(*k) - time(sample)).abs() < GAP / input.rate_hz;
            other.filter(|k| *k < self.predicted.len() && is_near(k)).unwrap_or(sample)
        };
        let (before, after) = (near(sample.checked_sub(1)), near(Some(sample + 1)));
        let span = time(after) - time(before);
        if span <= 0.0 {
            return vec![0.0; own.len()];
        }
        let pairs = self
            .predicted
            .get(after)
            .into_iter()
            .flatten()
            .zip(self.predicted.get(before).into_iter().flatten());
        pairs.map(|(a, b)| (a - b) / span).collect()
    }

    /// Returns what an error moves: weights of the directions.
    fn moves(&self, instant: &Instant, error: &SignalError) -> Vec<(Direction, f64)> {
        let states = instant.moving.states();
        let motion = &instant.frame.base;
        let mut out = Vec::new();
        let mut base = |direction: fn(usize) -> Direction, v: Three| {
            out.extend(v.iter().enumerate().map(|(axis, value)| (direction(axis), *value)));
        };
        let unit = |axis: usize| Matrix3::<f64>::identity().column(axis).into_owned();
        // Attitude and rate of links, in their own axes.
        let mut moved: Vec<Option<[Three; 2]>> = vec![None; states.len()];
        let still = LinkState::zero();
        let at = |i: usize| states.get(i).unwrap_or(&still);
        let mut everywhere = None;
        match error {
            SignalError::LeverArm(axis) => base(Direction::LeverArm, unit(*axis)),
            SignalError::BaseTilt(axis) => base(Direction::Force, unit(*axis).cross(&motion.specific_force)),
            SignalError::AccelBias(axis) => base(Direction::Force, -axis),
            SignalError::AccelGain { to, from } => {
                base(Direction::Force, -to * from.dot(&motion.specific_force));
            }
            SignalError::BaseRotation(axis) => {
                let e = unit(*axis);
                base(Direction::Force, e.cross(&motion.specific_force));
                let rate = e.cross(&motion.rate);
                base(Direction::Rate, rate);
                moved[BASE] = Some([Vector3::zeros(), rate]);
                everywhere = Some(e);
            }
            SignalError::GyroBias { link: 0, axis } => {
                base(Direction::Rate, -axis);
                moved[BASE] = Some([Vector3::zeros(), -axis]);
            }
            SignalError::GyroGain { link: 0, axis } => {
                let rate = -axis * axis.dot(&motion.rate);
                base(Direction::Rate, rate);
                moved[BASE] = Some([Vector3::zeros(), rate]);
            }
            SignalError::GyroRotation { link: 0, axis } => {
                let rate = axis.cross(&motion.rate);
                base(Direction::Rate, rate);
                moved[BASE] = Some([Vector3::zeros(), rate]);
            }
            SignalError::GyroBias { link, axis } => moved[link + BASE] = Some([Vector3::zeros(), -axis]),
            SignalError::GyroGain { link, axis } => {
                let state = at(link + BASE);
                let rate = state.rotation.tr_mul(&state.rate);
                moved[link + BASE] = Some([Vector3::zeros(), -axis * axis.dot(&rate)]);
            }
            SignalError::GyroRotation { link, axis } => {
                let state = at(link + BASE);
                let rate = state.rotation.tr_mul(&state.rate);
                moved[link + BASE] = Some([Vector3::zeros(), axis.cross(&rate)]);
            }
            SignalError::LinkRotation { link, axis } => {
                let (e, state) = (unit(*axis), at(link + BASE));
                moved[link + BASE] = Some([-e, e.cross(&state.rotation.tr_mul(&state.rate))]);
            }
            SignalError::JointZero(link) => {
                let i = link + BASE;
                out.extend(instant.freedoms_of(i).map(|(k, _)| (Direction::Position(k), -1.0)));
                if let Some(Joint::Revolute(axis)) = instant.moving.links().get(i).map(|l| l.joint) {
                    let carried = at(i).rotation.tr_mul(&at(instant.parent(i)).rate);
                    moved[i] = Some([-axis, axis.cross(&carried)]);
                }
            }
            SignalError::Skew
            | SignalError::EffortOffset(_)
            | SignalError::EffortGain(_)
            | SignalError::EffortDrift { .. }
            | SignalError::FootZero { .. }
            | SignalError::FootGain { .. } => return out,
        }
        if moved.iter().all(Option::is_none) {
            return out;
        }
        for i in BASE + 1..states.len() {
            let parent = instant.parent(i);
            if moved[i].is_none() && moved[parent].is_none() && everywhere.is_none() {
                continue;
            }
            let own = at(i);
            let carried = moved[parent].map(|[turn, rate]| {
                let to_own = own.rotation.tr_mul(&at(parent).rotation);
                [to_own * turn, to_own * rate]
            });
            if !self.is_seen.get(i).copied().unwrap_or(false) {
                if moved[i].is_none() {
                    moved[i] = carried;
                }
                continue;
            }
            if let Some(e) = everywhere {
                moved[i] = Some([own.rotation.tr_mul(&e), Vector3::zeros()]);
            }
            if moved[i].is_none() && carried.is_none() {
                continue;
            }
            let zero = [Vector3::zeros(); 2];
            let ([turn, rate], [turned, rated]) = (moved[i].unwrap_or(zero), carried.unwrap_or(zero));
            let turn = turn - turned;
            let spin = rate - rated + turn.cross(&own.rotation.tr_mul(&at(parent).rate));
            instant.joint_moves(i, &turn, &spin, &mut out);
        }
        out
    }
}

/// What the motion may change by.
#[derive(Clone, Copy)]
enum Direction {
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

/// Returns mass, first moment, tensor and momentum of each link and all beyond, about its origin.
fn composites(moving: &Moving, bodies: &[[f64; 10]]) -> Vec<Composite> {
    let own = moving.states().iter().zip(bodies).map(|(state, phi)| {
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
    });
    let mut all: Vec<Composite> = own.collect();
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
    all
}

/// Returns the freedoms of all joints.
fn freedoms(moving: &Moving, frame: &Frame) -> Vec<Freedom> {
    let mut all = Vec::new();
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
    all
}

impl Instant<'_> {
    fn parent(&self, i: usize) -> usize {
        self.moving.links().get(i).map_or(0, |link| link.parent)
    }

    fn freedoms_of(&self, i: usize) -> impl Iterator<Item = (usize, &Freedom)> {
        self.freedoms.iter().enumerate().filter(move |(_, freedom)| freedom.link == i)
    }

    fn channels(&self) -> usize {
        let first = if self.input.has_wrench() { 6 } else { 0 };
        first + if self.input.has_efforts() { self.freedoms.len() } else { 0 }
    }

    /// Returns what a turn and a change of rate of link i against its parent, axes of the link, do to its joint.
    fn joint_moves(&self, i: usize, turn: &Three, spin: &Three, out: &mut Vec<(Direction, f64)>) {
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

    /// Returns what is predicted, smoothed and differentiated, without drives.
    fn predicted(&self) -> Vec<f64> {
        let mut out = vec![0.0; 2 * self.channels()];
        let (whole, motion) = (&self.composites[0], &self.frame.base);
        let (w, a) = (&motion.rate, &motion.specific_force);
        self.put_base(
            [
                &(w.cross(&whole.momentum) + a * whole.mass),
                &(w.cross(&whole.angular) + whole.moment.cross(a)),
            ],
            [&whole.momentum, &whole.angular],
            &mut out,
        );
        self.put_joints(&mut out, |freedom| {
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
        out
    }

    /// Adds a wrench about the IMU, brought to S, to the rows of the base.
    fn put_base(&self, smoothed: [&Three; 2], differentiated: [&Three; 2], out: &mut [f64]) {
        if !self.input.has_wrench() {
            return;
        }
        let BaseSensor::Imu(place) = self.input.base else { return };
        let (place, channels) = (Vector3::from(place), self.channels());
        for ([force, moment], first) in [(smoothed, 0), (differentiated, channels)] {
            let moment = moment + place.cross(force);
            let values = force.iter().chain(moment.iter());
            out.iter_mut().skip(first).zip(values).for_each(|(to, value)| *to += value);
        }
    }

    /// Adds numbers to the rows of the joints.
    fn put_joints(&self, out: &mut [f64], of: impl Fn(&Freedom) -> (f64, f64)) {
        if !self.input.has_efforts() {
            return;
        }
        let (channels, first) = (self.channels(), if self.input.has_wrench() { 6 } else { 0 });
        for (k, freedom) in self.freedoms.iter().enumerate() {
            let (smoothed, differentiated) = of(freedom);
            out[first + k] += smoothed;
            out[channels + first + k] += differentiated;
        }
    }

    /// Adds what a change of link i and all beyond does to base and joints.
    fn change(&self, i: usize, change: &Change, out: &mut [f64]) {
        let Change { turn, rate, shift, velocity } = change;
        let (own, state, motion) = (&self.composites[i], &self.moving.states()[i], &self.frame.base);
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
            if j == i || self.above[i].contains(&j) {
                let about = angular - at.position.cross(&momentum);
                return if freedom.slides {
                    (-carried.dot(&momentum), n.dot(&momentum))
                } else {
                    let smoothed =
                        n.dot(&moment.cross(a)) - carried.dot(&about) + n.dot(&at.velocity.cross(&momentum));
                    (smoothed, n.dot(&about))
                };
            }
            if !self.above[j].contains(&i) {
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

    /// Returns the column of a direction: smoothed and differentiated.
    fn column(&self, direction: Direction) -> Vec<f64> {
        let mut out = vec![0.0; 2 * self.channels()];
        let (whole, motion) = (&self.composites[0], &self.frame.base);
        let unit = |axis: usize| Matrix3::<f64>::identity().column(axis).into_owned();
        match direction {
            Direction::Position(k) => {
                let Some(f) = self.freedoms.get(k) else { return out };
                let change = if f.slides {
                    Change { shift: f.axis, velocity: f.carrier.cross(&f.axis), ..Change::NONE }
                } else {
                    Change { turn: f.axis, rate: -f.axis.cross(&f.carrier), ..Change::NONE }
                };
                self.change(f.link, &change, &mut out);
                // What the feet push is moved on the other side.
                let ground = self.ground.get(k).map_or(&[][..], Vec::as_slice);
                out.iter_mut().zip(ground).for_each(|(to, moved)| *to -= moved);
            }
            Direction::Speed(k) => {
                let Some(f) = self.freedoms.get(k) else { return out };
                let change = if f.slides {
                    Change { velocity: f.axis, ..Change::NONE }
                } else {
                    Change { rate: f.axis, ..Change::NONE }
                };
                self.change(f.link, &change, &mut out);
            }
            Direction::Rate(axis) => {
                let e = unit(axis);
                self.change(0, &Change { rate: e, ..Change::NONE }, &mut out);
                let zero = Vector3::zeros();
                let by_rate = [&e.cross(&whole.momentum), &e.cross(&whole.angular)];
                self.put_base(by_rate, [&zero, &zero], &mut out);
            }
            Direction::Force(axis) => {
                let (e, zero) = (unit(axis), Vector3::zeros());
                self.put_base([&(e * whole.mass), &whole.moment.cross(&e)], [&zero, &zero], &mut out);
                self.put_joints(&mut out, |freedom| {
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
                self.change(BASE, &change, &mut out);
                // The wrench is brought to S from where the IMU is.
                let force = motion.rate.cross(&whole.momentum) + motion.specific_force * whole.mass;
                let zero = Vector3::zeros();
                let moments = [e.cross(&force), e.cross(&whole.momentum)];
                self.put_base([&zero, &moments[0]], [&zero, &moments[1]], &mut out);
            }
        }
        out
    }

    /// Returns the place of a direction among all.
    fn place(&self, direction: Direction) -> usize {
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

impl<'a> ErrorRows<'a> {
    /// Returns them as a source of their own: one coefficient for each error.
    pub(super) fn into_source(self) -> OtherColumns<'a> {
        let name = |k: usize| format!("error {k}");
        let parameter = |k| Parameter::new(name(k), Owner::Link(String::new()), Kind::Offset, "");
        let parameters = (0..self.source.input().errors.len()).map(parameter).collect();
        OtherColumns::new(self.source, parameters, move |sample, rows| self.rows(sample, rows))
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        let refuse = Rejection::NotFinite(0);
        self.source.measure(sample, &mut rows.measured)?;
        rows.measured.fill(0.0);
        self.source.mark_untold(sample, rows);
        let input = self.source.input();
        let frame = input.frames.get(sample).ok_or(refuse)?;
        let mut moving = self.moving.lock().unwrap_or_else(PoisonError::into_inner);
        let available = self.available(&mut moving, frame).map_err(|_| refuse)?;
        let instant = self.instant(&mut moving, frame).map_err(|_| refuse)?;
        let (channels, count) = (self.source.channels().len(), input.errors.len());
        // Columns of directions, as they are asked for.
        let mut columns: Vec<Option<Vec<f64>>> = vec![None; 2 * instant.freedoms.len() + 9];
        let mut sum = vec![0.0; 2 * channels];
        for (k, error) in input.errors.iter().enumerate() {
            sum.fill(0.0);
            match error {
                SignalError::Skew => {
                    sum.iter_mut().zip(self.slope(sample)).for_each(|(to, value)| *to = value)
                }
                SignalError::EffortOffset(channel) => {
                    sum.iter_mut().skip(*channel).take(1).for_each(|v| *v = 1.0)
                }
                SignalError::EffortGain(channel) => {
                    let effort = channel.checked_sub(6).and_then(|k| frame.efforts.get(k)).copied();
                    sum.iter_mut().skip(*channel).take(1).for_each(|v| *v = effort.unwrap_or(0.0));
                }
                SignalError::EffortDrift { channel, degree } => {
                    let drift = self.drift(frame, *degree);
                    sum.iter_mut().skip(*channel).take(1).for_each(|v| *v = drift);
                }
                SignalError::FootZero { foot, component } | SignalError::FootGain { foot, component } => {
                    let is_gain = matches!(error, SignalError::FootGain { .. });
                    let value = frame.ground.wrenches.get(*foot).map_or(0.0, |w| w[*component]);
                    let factor = if is_gain { value } else { 1.0 };
                    let feet = available.iter().flat_map(|available| &available.feet);
                    for (_, columns) in feet.filter(|(i, _)| i == foot) {
                        let column = columns.values.column(*component);
                        sum.iter_mut().zip(column.iter()).for_each(|(to, g)| *to = factor * g);
                    }
                }
                _ => {
                    for (direction, weight) in self.moves(&instant, error) {
                        let Some(own) = columns.get_mut(instant.place(direction)) else { continue };
                        let own = own.get_or_insert_with(|| instant.column(direction));
                        sum.iter_mut().zip(own.iter()).for_each(|(to, value)| *to += weight * value);
                    }
                }
            }
            let (smoothed, differentiated) = sum.split_at(channels);
            for (part, values) in [(&mut rows.smoothed, smoothed), (&mut rows.differentiated, differentiated)]
            {
                part.iter_mut().skip(k).step_by(count).zip(values).for_each(|(to, value)| *to = *value);
            }
        }
        if let Some(available) = available {
            available.combine(&mut rows.smoothed, &mut rows.differentiated, count);
        }
        if input.is_static {
            rows.differentiated.fill(0.0);
        }
        Ok(())
    }

    /// Returns what is available of the rows of a frame; `None` where there are no feet.
    fn available(&self, moving: &mut Moving, frame: &Frame) -> Result<Option<Availability>, TreeError> {
        let Some(contact) = &self.source.input().contact else { return Ok(None) };
        let zeros = vec![0.0; frame.rates.len()];
        moving.set(&frame.positions, &frame.rates, &zeros, &frame.base)?;
        contact.availability(moving, frame).map(Some)
    }

    /// Returns a Legendre polynomial at a frame, of the time that goes from −1 to 1.
    fn drift(&self, frame: &Frame, degree: u8) -> f64 {
        let frames = &self.source.input().frames;
        let time = |frame: Option<&Frame>| frame.map_or(0.0, |frame| frame.time_ns as f64 * 1e-9);
        let (first, last) = (time(frames.first()), time(frames.last()));
        let x = (2.0 * time(Some(frame)) - first - last) / (last - first).max(f64::MIN_POSITIVE);
        if degree == 1 { x } else { 1.5 * x * x - 0.5 }
    }
}

#[cfg(test)]
#[path = "sensitivities_tests.rs"]
mod tests;
