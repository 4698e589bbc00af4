//! Columns of the errors of a tree's signals: what each changes in the wrench and the efforts that the
//! parameters predict.
//!
//! With the momentum `h = (P, H)` of the links beyond a joint, their mass M, first moment c and tensor J, all
//! about that joint's link, a change of the motion there, a turn ε, a rate ζ beside the turned one, a shift s
//! and its velocity z, moves
//! ```text
//! P by  ε×(P − M u) + ζ×c + M z        H by  (ε×c)×u + ε×(H − c×u) + J ζ + c×z
//! ```
//! and with them the rows of the base and of all joints above. A joint beyond sees itself at rest, and the
//! rest turned the other way: `a` by `−ε×a`, its own velocity by `b = −ε×u + ζ×d + z`. So each joint's
//! coordinates and rates have columns in one pass over the links, and an error of a signal is a sum of few of
//! them.

use std::sync::{Mutex, PoisonError};

use nalgebra::{Matrix3, Vector3};
use rigident_shared::screening::Rejection;
use rigident_shared::tree::{Joint, LinkState, TreeError};

use super::contact::availability::Availability;
use super::instant::{Direction, Instant, Three};
use super::neighbours::{Neighbours, Predictor};
use super::rows::{BASE, RowMaker};
use super::{Frame, SignalError, SignalKind, TreeSource};
use rigident_fit::{Kind, OtherColumns, Owner, Parameter, RowSource as _, SampleRows};
use rigident_model::rows::Moving;

/// Steps longer than this many sample periods are gaps.
const GAP: f64 = 1.5;

/// Columns of a source's errors.
pub(super) struct ErrorRows<'a> {
    source: &'a TreeSource,
    /// By links of the tree: its own IMU shows its motion.
    is_seen: Vec<bool>,
    predictor: Predictor,
    /// The tree at rest, of which rooms are copies.
    still: Instant,
    rooms: Mutex<Vec<Room>>,
}

/// Room for the numbers of one frame after the other.
struct Room {
    neighbours: Neighbours,
    /// The tree, for what is available where there are feet.
    moving: Moving,
    /// Columns of directions, as they are asked for, and which of them are made.
    columns: Vec<f64>,
    is_made: Vec<bool>,
    /// Attitude and rate of links, in their own axes, that an error moves.
    moved: Vec<Option<[Three; 2]>>,
    /// Weights of the directions of an error.
    moves: Vec<(Direction, f64)>,
    sum: Vec<f64>,
}

impl<'a> ErrorRows<'a> {
    /// Returns the columns about parameters φ.
    ///
    /// # Errors
    /// [`TreeError`] if the frames do not fit the model.
    pub(super) fn new(source: &'a TreeSource, maker: &RowMaker, phi: &[f64]) -> Result<Self, TreeError> {
        let input = source.input();
        let moving = maker.moving().clone();
        let seen = |signal: &super::NoisySignal, i: usize| {
            signal.kind == SignalKind::Attitude && signal.link + BASE == i
        };
        let links = moving.links().len();
        let is_seen = (0..links).map(|i| input.signals.iter().any(|s| seen(s, i))).collect();
        let still = Instant::new(input, moving, maker.bodies(phi));
        let predictor = Predictor::new(maker.drives(), phi);
        Ok(Self { source, is_seen, predictor, still, rooms: Mutex::new(Vec::new()) })
    }

    /// Does something with a room that nobody else has meanwhile, one that has a frame at hand if there is
    /// one.
    fn in_room<R>(&self, sample: usize, job: impl FnOnce(&mut Room) -> R) -> R {
        let rooms = || self.rooms.lock().unwrap_or_else(PoisonError::into_inner);
        let free = {
            let mut rooms = rooms();
            let near = rooms.iter().position(|room: &Room| room.neighbours.has(sample));
            near.map(|at| rooms.swap_remove(at)).or_else(|| rooms.pop())
        };
        let mut room = free.unwrap_or_else(|| {
            let (width, directions) = (2 * self.source.channels().len(), self.still.directions());
            Room {
                columns: vec![0.0; directions * width],
                is_made: vec![false; directions],
                moved: vec![None; self.still.moving.links().len()],
                moves: Vec::new(),
                sum: vec![0.0; width],
                neighbours: Neighbours::new(&self.still, width),
                moving: self.still.moving.clone(),
            }
        });
        let done = job(&mut room);
        rooms().push(room);
        done
    }

    /// Returns a frame, that before and that after it, itself in place of one beyond a gap; and the time from
    /// the second to the third, s.
    fn around(&self, sample: usize) -> ([usize; 3], f64) {
        let input = self.source.input();
        let time = |k: usize| input.frames.get(k).map_or(0.0, |frame| frame.time_ns as f64 * 1e-9);
        let near = |other: Option<usize>| {
            let is_near = |k: &usize| (time(*k) - time(sample)).abs() < GAP / input.rate_hz;
            other.filter(|k| *k < input.frames.len() && is_near(k)).unwrap_or(sample)
        };
        let (before, after) = (near(sample.checked_sub(1)), near(Some(sample + 1)));
        // The frame itself will be a neighbour of the next one.
        ([sample, before, after], time(after) - time(before))
    }

    /// Writes the derivative by time of the predictions of a frame.
    fn slope(&self, sample: usize, neighbours: &mut Neighbours, out: &mut [f64]) -> Result<(), TreeError> {
        let (samples, span) = self.around(sample);
        let [_, own_before, own_after] = neighbours.predict(samples, &self.predictor, self.source.input())?;
        if span > 0.0 {
            let pairs = own_after.iter().zip(own_before);
            out.iter_mut().zip(pairs).for_each(|(to, (a, b))| *to = (a - b) / span);
        }
        Ok(())
    }

    /// Writes the second derivative by time of the predicted efforts of a frame.
    fn bend(&self, sample: usize, neighbours: &mut Neighbours, out: &mut [f64]) -> Result<(), TreeError> {
        let (samples, span) = self.around(sample);
        let first = self.source.input().first_effort();
        let channels = (out.len() / 2).max(1);
        let [own, own_before, own_after] =
            neighbours.predict(samples, &self.predictor, self.source.input())?;
        if samples[1] == sample || samples[2] == sample {
            return Ok(());
        }
        let all = out.iter_mut().zip(own.iter().zip(own_before.iter().zip(own_after))).enumerate();
        for (_, (to, (here, (before, after)))) in all.filter(|(c, _)| c % channels >= first) {
            *to = 4.0 * (after - 2.0 * here + before) / (span * span);
        }
        Ok(())
    }

    /// Returns the effort that links and rotor take of a drive in the frame that was brought last, as it is
    /// predicted; what is measured has the friction in it. `room` is overwritten.
    fn load(
        &self,
        sample: usize,
        drive: usize,
        neighbours: &mut Neighbours,
        room: &mut [f64],
    ) -> Result<f64, TreeError> {
        let Some(freedom) = self.predictor.loaded_freedom(drive) else { return Ok(0.0) };
        let (channel, channels) = (self.source.input().first_effort() + freedom, room.len() / 2);
        self.slope(sample, neighbours, room)?;
        let changing = room.get(channels + channel).copied().unwrap_or(0.0);
        neighbours.instant().predict(room);
        Ok(changing + room.get(channel).copied().unwrap_or(0.0))
    }

    /// Writes the weights of the directions that an error moves.
    fn find_moves(
        &self,
        instant: &Instant,
        error: &SignalError,
        moved: &mut [Option<[Three; 2]>],
        out: &mut Vec<(Direction, f64)>,
    ) {
        let states = instant.moving.states();
        let motion = &instant.base;
        out.clear();
        moved.fill(None);
        let still = LinkState::zero();
        let at = |i: usize| states.get(i).unwrap_or(&still);
        let unit = |axis: usize| Matrix3::<f64>::identity().column(axis).into_owned();
        let of_gyro = |link: usize| {
            let state = at(link + BASE);
            if link == 0 { motion.rate } else { state.rotation.tr_mul(&state.rate) }
        };
        let mut base = |direction: fn(usize) -> Direction, v: Three| {
            out.extend(v.iter().enumerate().map(|(axis, value)| (direction(axis), *value)));
        };
        let mut everywhere = None;
        // The link whose rate is in error, and by how much.
        let mut rate = None;
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
                rate = Some((0, e.cross(&motion.rate)));
                everywhere = Some(e);
            }
            SignalError::GyroBias { link, axis } => rate = Some((*link, -axis)),
            SignalError::GyroGain { link, axis } => {
                rate = Some((*link, -axis * axis.dot(&of_gyro(*link))));
            }
            SignalError::GyroRotation { link, axis } => rate = Some((*link, axis.cross(&of_gyro(*link)))),
            SignalError::LinkRotation { link, axis } => {
                let e = unit(*axis);
                let state = at(link + BASE);
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
            | SignalError::EffortFilter
            | SignalError::EffortOffset(_)
            | SignalError::EffortGain(_)
            | SignalError::EffortDrift { .. }
            | SignalError::FrictionSpeed(_)
            | SignalError::FrictionShape(_)
            | SignalError::FrictionDrift { .. }
            | SignalError::FrictionLoad(_)
            | SignalError::FootZero { .. }
            | SignalError::FootGain { .. } => {}
        }
        if let Some((link, rate)) = rate {
            if link == 0 {
                let weights = rate.iter().enumerate();
                out.extend(weights.map(|(axis, value)| (Direction::Rate(axis), *value)));
            }
            moved[link + BASE] = Some([Vector3::zeros(), rate]);
        }
        if self.is_seen.contains(&true) && moved.iter().any(Option::is_some) {
            self.pass_on(instant, everywhere, moved, out);
        }
    }

    /// Passes the moves of links on to those that they carry, and writes the weights of joints between links
    /// whose own sensors show their motion. A turn of everything beyond the base is `everywhere`, the base's
    /// frame.
    fn pass_on(
        &self,
        instant: &Instant,
        everywhere: Option<Three>,
        moved: &mut [Option<[Three; 2]>],
        out: &mut Vec<(Direction, f64)>,
    ) {
        let states = instant.moving.states();
        let still = LinkState::zero();
        let at = |i: usize| states.get(i).unwrap_or(&still);
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
            instant.joint_moves(i, &turn, &spin, out);
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
        self.source.mark_missing(sample, rows);
        let input = self.source.input();
        let frame = input.frames.get(sample).ok_or(refuse)?;
        let available = self.in_room(sample, |room| {
            room.neighbours.bring(sample, input)?;
            let available = self.available(&mut room.moving, frame)?;
            room.is_made.fill(false);
            for (k, error) in input.errors.iter().enumerate() {
                self.write_error(sample, frame, error, available.as_ref(), room)?;
                let (smoothed, differentiated) = room.sum.split_at(room.sum.len() / 2);
                put(&mut rows.smoothed, k, input.errors.len(), smoothed);
                put(&mut rows.differentiated, k, input.errors.len(), differentiated);
            }
            Ok(available)
        });
        if let Some(available) = available.map_err(|_: TreeError| refuse)? {
            available.combine(&mut rows.smoothed, &mut rows.differentiated, input.errors.len());
        }
        if input.is_static {
            rows.differentiated.fill(0.0);
        }
        Ok(())
    }

    /// Writes the column of an error into the sum of a room that was brought to its frame.
    fn write_error(
        &self,
        sample: usize,
        frame: &Frame,
        error: &SignalError,
        available: Option<&Availability>,
        room: &mut Room,
    ) -> Result<(), TreeError> {
        let Room { neighbours, columns, is_made, moved, moves, sum, .. } = room;
        sum.fill(0.0);
        match error {
            SignalError::Skew => self.slope(sample, neighbours, sum)?,
            SignalError::EffortFilter => self.bend(sample, neighbours, sum)?,
            SignalError::EffortOffset(channel) => {
                sum.iter_mut().skip(*channel).take(1).for_each(|v| *v = 1.0)
            }
            SignalError::EffortGain(channel) => {
                let effort = channel.checked_sub(6).and_then(|k| frame.efforts.get(k)).copied();
                sum.iter_mut().skip(*channel).take(1).for_each(|v| *v = effort.unwrap_or(0.0));
            }
            SignalError::EffortDrift { channel, degree } => {
                let drift = self.source.input().drift(frame, *degree);
                sum.iter_mut().skip(*channel).take(1).for_each(|v| *v = drift);
            }
            SignalError::FrictionSpeed(_)
            | SignalError::FrictionShape(_)
            | SignalError::FrictionDrift { .. } => {
                self.predictor.friction_moves(error, 0.0, (self.source.input(), frame), sum);
            }
            SignalError::FrictionLoad(drive) => {
                let load = self.load(sample, *drive, neighbours, sum)?;
                sum.fill(0.0);
                self.predictor.friction_moves(error, load, (self.source.input(), frame), sum);
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
                let instant = neighbours.instant();
                self.find_moves(instant, error, moved, moves);
                let width = sum.len();
                for (direction, weight) in moves.iter() {
                    let place = instant.place(*direction);
                    let own = columns.get_mut(place * width..(place + 1) * width);
                    let Some((own, is_made)) = own.zip(is_made.get_mut(place)) else { continue };
                    if !*is_made {
                        instant.column(*direction, own);
                        *is_made = true;
                    }
                    sum.iter_mut().zip(own.iter()).for_each(|(to, value)| *to += weight * value);
                }
            }
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
}

/// Writes the numbers of column k of some rows of `count` columns.
fn put(rows: &mut [f64], k: usize, count: usize, values: &[f64]) {
    for (row, value) in rows.chunks_exact_mut(count.max(1)).zip(values) {
        row[k] = *value;
    }
}

#[cfg(test)]
#[path = "sensitivities_tests.rs"]
mod tests;
