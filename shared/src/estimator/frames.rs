//! Trees of links from streamed frames: who streams knows how every link moves, and the wrench on the base.
//!
//! A frame of a base with an IMU brings attitude, rate and angular acceleration of every link, so nothing is
//! filtered here. One of a base that cameras track brings positions and rates alone; its rows are made of
//! momentum and filtered ([`TrackedFrame`]). Two rows of blocks are absorbed together, twelve rows. There is
//! room for one level of a factor of up to 128 parameters, so it is handed to the host row by row
//! ([`PackedFactor`]) and merged there; at the latest after [`LEVEL_FRAMES`] nothing more is taken in.

mod link;
mod suspension;
mod tracked;

use nalgebra::Vector3;

use self::link::attitude;
pub use self::link::{FrameLink, LINKS};
use self::suspension::Sums;
pub use self::suspension::{SUSPENDED_LINKS, Suspension};
use self::tracked::Window;
pub use self::tracked::{FrameFilter, LinkPose, TAPS, TrackedFrame};
use crate::Scalar;
use crate::conditioning::KernelError;
use crate::factor::{BLOCK_ROWS, Column, PackedFactor, packed_entries};
use crate::screening::{Rejection, Screen};
use crate::tree::base::{FIRST_LINK, TurningJoint, kept_columns};
use crate::tree::{LinkState, rows};

/// Base parameters at most.
pub const PARAMETERS: usize = 128;
const ENTRIES: usize = packed_entries(PARAMETERS);
/// Beyond this many frames single precision loses digits of one level.
pub const LEVEL_FRAMES: u32 = 100_000;

/// A level of the factor of a tree.
pub type TreeFactor<T> = PackedFactor<T, PARAMETERS, ENTRIES>;

/// Everything that fixes what is done with a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramesConfig<T> {
    /// 1 σ of the wrench per frame: N, N m.
    pub channel_sigma: [T; 6],
    /// Wrench offset that is known, taken off first: N, N m.
    pub known_offset: [T; 6],
    /// Range of each wrench channel: N, N m.
    pub range: [T; 6],
    /// This many consecutive frames whose motion repeats itself to the last bit while the wrench does not
    /// have none. Zero: never.
    pub still_after: u16,
    /// The filter of a base that is tracked; `None`: the base carries an IMU.
    pub filter: Option<FrameFilter<T>>,
    /// The springs under the base, if they are the sensor; it is tracked then.
    pub suspension: Option<Suspension<T>>,
}

/// Tells when a run of frames has brought enough information.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameStop<T> {
    /// Largest standard deviation of each base parameter; infinite for one that is not asked for.
    pub standard_deviation: [T; PARAMETERS],
    /// The run is not ended before this many frames.
    pub minimum_frames: u32,
}

/// Tells why a tree cannot be estimated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FramesError {
    /// No links, or too many.
    Links(usize),
    /// The parent of this link does not precede it, or its joint has no such axis or no finite place.
    Link(usize),
    /// More base parameters than there is room for.
    Parameters(usize),
    /// A σ is not positive and finite.
    Sigma(u8),
    /// There is no such filter, or no room for it.
    Filter(KernelError),
    /// The stiffness is not symmetric and positive.
    Stiffness,
    /// The base's place on the springs is not finite, or no rotation; or all coordinates are locked.
    Suspension,
}

/// Holds how one link moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkMotion<T> {
    /// `R_SL`: axes of S ← link axes, as a quaternion w, x, y, z.
    pub attitude: [T; 4],
    /// Angular rate relative to the earth, link axes, rad/s.
    pub rate: [T; 3],
    /// Derivative of the angular rate, link axes, rad/s².
    pub angular_acceleration: [T; 3],
}

/// One frame: the base link in the axes of S, then every other link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<'a, T> {
    /// Wrench on the base at S's origin: N, N m.
    pub wrench: [T; 6],
    /// Specific force at S's origin, m/s².
    pub specific_force: [T; 3],
    /// Angular rate of S, rad/s.
    pub rate: [T; 3],
    /// Derivative of the angular rate, rad/s².
    pub angular_acceleration: [T; 3],
    /// The links after the first.
    pub links: &'a [LinkMotion<T>],
}

/// Tells why a frame was not taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameRejection {
    /// It has this number of links, not those of the tree.
    Links(u8),
    /// A number of this link's motion is NaN or infinite; 0 is the base.
    NotFinite(u8),
    /// The attitude of this link is no rotation.
    NoAttitude(u8),
    /// A channel of the wrench: not finite, or at its range.
    Wrench(Rejection),
    /// The motion repeats itself while the wrench changes: whoever streams has lost the body.
    WithoutMotion,
    /// The level is full and has not been handed over.
    Full,
}

/// Holds what happened to frames so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameCounters {
    /// Given.
    pub frames: u32,
    /// Absorbed.
    pub absorbed: u32,
    /// Frames with another number of links than the tree.
    pub wrong_links: u32,
    /// Frames with a number that is none.
    pub not_finite: u32,
    /// Frames with an attitude that is none.
    pub no_attitude: u32,
    /// Frames with a wrench at its range.
    pub saturated: u32,
    /// The number whose motion repeats itself.
    pub without_motion: u32,
    /// Frames that came after the level was full.
    pub full: u32,
    /// The link of the last rejection that was about one, or how many links a frame had.
    pub last_link: u8,
}

impl FrameCounters {
    fn reject(&mut self, rejection: FrameRejection) {
        let count = match rejection {
            FrameRejection::Links(n) => {
                self.last_link = n;
                &mut self.wrong_links
            }
            FrameRejection::NotFinite(link) => {
                self.last_link = link;
                &mut self.not_finite
            }
            FrameRejection::NoAttitude(link) => {
                self.last_link = link;
                &mut self.no_attitude
            }
            FrameRejection::Wrench(Rejection::NotFinite(_)) => &mut self.not_finite,
            FrameRejection::Wrench(_) => &mut self.saturated,
            FrameRejection::WithoutMotion => &mut self.without_motion,
            FrameRejection::Full => &mut self.full,
        };
        *count = count.saturating_add(1);
    }
}

/// The estimator of a tree from frames.
#[derive(Clone, Copy, Debug)]
pub struct FrameEstimator<T: Scalar> {
    factor: TreeFactor<T>,
    /// A column for every parameter, and the right-hand side.
    block: [Column<T>; PARAMETERS + 1],
    /// Frames in the block.
    waiting: u8,
    links: [FrameLink<T>; LINKS],
    /// Frames under the filter, of a base that is tracked.
    window: Window<T>,
    /// Springs under the base, and where the window's room is used for what they make of frames.
    sums: Sums<T>,
    /// Columns that stay.
    kept: [u16; LINKS],
    count: u8,
    weights: [T; 6],
    known_offset: [T; 6],
    screen: Screen<T, 6>,
    still_after: u16,
    still: u16,
    /// A sum over the last frame's motion that any change of it changes, but for chance.
    last_motion: u32,
    last_wrench: [T; 6],
    /// Frames since the level was last begun to be handed over.
    in_level: u32,
    counters: FrameCounters,
    /// Largest standard deviations, if a run is to end by itself.
    stop: Option<FrameStop<T>>,
    /// Parameters whose standard deviation is small enough: all before this one. The level only gains.
    small_enough: u16,
}

impl<T: Scalar> FrameEstimator<T> {
    /// The estimator before it is set up: [`Self::set_up`] must follow. All bits are zero.
    pub const UNUSED: Self = Self {
        factor: TreeFactor::EMPTY,
        block: [Column::ZERO; PARAMETERS + 1],
        waiting: 0,
        links: [FrameLink { parent: 0, joint: TurningJoint::Fixed, position: [T::ZERO; 3] }; LINKS],
        window: Window::UNUSED,
        sums: Sums::UNUSED,
        kept: [0; LINKS],
        count: 0,
        weights: [T::ZERO; 6],
        known_offset: [T::ZERO; 6],
        screen: Screen::UNUSED,
        still_after: 0,
        still: 0,
        last_motion: 0,
        last_wrench: [T::ZERO; 6],
        in_level: 0,
        counters: FrameCounters {
            frames: 0,
            absorbed: 0,
            wrong_links: 0,
            not_finite: 0,
            no_attitude: 0,
            saturated: 0,
            without_motion: 0,
            full: 0,
            last_link: 0,
        },
        stop: None,
        small_enough: 0,
    };

    /// Returns how many base parameters a tree has.
    ///
    /// # Errors
    /// [`FramesError`] says what is wrong with it.
    pub fn check(links: &[FrameLink<T>], config: &FramesConfig<T>) -> Result<usize, FramesError> {
        if links.is_empty() || links.len() > LINKS {
            return Err(FramesError::Links(links.len()));
        }
        for (channel, sigma) in config.channel_sigma.iter().enumerate() {
            if !sigma.is_finite() || *sigma <= T::ZERO {
                return Err(FramesError::Sigma(channel as u8));
            }
        }
        let mut parameters = FIRST_LINK.count_ones() as usize;
        for (i, link) in links.iter().enumerate().skip(1) {
            let kept = kept_columns(link.joint).ok_or(FramesError::Link(i))?;
            if usize::from(link.parent) >= i || !link.position.iter().all(|v| v.is_finite()) {
                return Err(FramesError::Link(i));
            }
            parameters += kept.count_ones() as usize;
        }
        if let Some(suspension) = &config.suspension {
            suspension.check()?;
            parameters += suspension.free();
            if links.len() > SUSPENDED_LINKS {
                return Err(FramesError::Links(links.len()));
            }
        }
        if parameters > PARAMETERS {
            return Err(FramesError::Parameters(parameters));
        }
        match (&config.filter, &config.suspension) {
            (Some(filter), None) => Window::kernel(filter).map(drop).map_err(FramesError::Filter)?,
            (filter, Some(_)) => {
                Sums::kernel(filter.as_ref(), parameters).map(drop).map_err(FramesError::Filter)?
            }
            (None, None) => {}
        }
        Ok(parameters)
    }

    /// Makes it an estimator that has seen nothing, in place.
    ///
    /// # Errors
    /// See [`Self::check`]; nothing is changed then.
    pub fn set_up(&mut self, links: &[FrameLink<T>], config: &FramesConfig<T>) -> Result<(), FramesError> {
        let parameters = Self::check(links, config)?;
        for (i, ((slot, kept), link)) in self.links.iter_mut().zip(&mut self.kept).zip(links).enumerate() {
            *slot = *link;
            *kept = if i == 0 { FIRST_LINK } else { kept_columns(link.joint).unwrap_or(0) };
        }
        self.count = links.len() as u8;
        let of_window = config.filter.filter(|_| config.suspension.is_none());
        self.window.set_up(of_window.as_ref(), self.count).map_err(FramesError::Filter)?;
        self.sums.set_up(config.filter.as_ref(), config.suspension.as_ref(), parameters)?;
        let every = config.filter.map_or(T::ONE, |filter| T::from_u32(u32::from(filter.row_every)).sqrt());
        self.weights = config.channel_sigma.map(|sigma| every / sigma);
        self.known_offset = config.known_offset;
        self.screen = Screen::of_ranges(&config.range, 0);
        self.still_after = config.still_after;
        self.stop = None;
        self.factor.clear(parameters);
        self.reset();
        Ok(())
    }

    /// Ends runs by this rule, or by none.
    pub fn set_stop(&mut self, stop: Option<&FrameStop<T>>) {
        self.stop = stop.copied();
        self.small_enough = 0;
    }

    /// Checks the standard deviation of one parameter, after a frame that waits for its block; returns
    /// whether every one that is asked for is small enough. The level alone is judged: what has been handed
    /// over before counts for nothing.
    #[inline(never)]
    pub fn look(&mut self) -> bool {
        let Some(stop) = &self.stop else { return false };
        if self.in_level < stop.minimum_frames {
            return false;
        }
        let limits = stop.standard_deviation.iter().take(self.factor.parameters()).enumerate();
        let next = limits.skip(usize::from(self.small_enough)).find(|(_, limit)| limit.is_finite());
        let Some((j, limit)) = next else { return true };
        if self.waiting > 0 && self.factor.standard_deviation(j) <= *limit {
            self.small_enough = j as u16 + 1;
        }
        false
    }

    /// Starts anew with the same tree.
    pub fn reset(&mut self) {
        self.small_enough = 0;
        self.factor.clear(self.factor.parameters());
        self.waiting = 0;
        self.window.clear();
        self.sums.clear();
        (self.still, self.last_motion, self.last_wrench) = (0, 0, [T::ZERO; 6]);
        self.in_level = 0;
        self.counters = FrameCounters::default();
    }

    /// Returns the number of base parameters.
    pub fn parameters(&self) -> usize {
        self.factor.parameters()
    }

    /// Returns the number of links, the base included.
    pub fn links(&self) -> usize {
        usize::from(self.count)
    }

    /// Returns what happened so far.
    pub fn counters(&self) -> &FrameCounters {
        &self.counters
    }

    /// Returns whether nothing more is taken in until the level is handed over.
    pub fn is_full(&self) -> bool {
        self.in_level >= LEVEL_FRAMES
    }

    /// Returns whether frames are those of a base that is tracked.
    pub fn is_tracked(&self) -> bool {
        self.window.is_used() || self.sums.is_used()
    }

    /// Takes in one frame of a base with an IMU.
    ///
    /// # Errors
    /// Why it was left out; nothing of it is absorbed then.
    pub fn absorb(&mut self, frame: &Frame<'_, T>) -> Result<(), FrameRejection> {
        self.counters.frames = self.counters.frames.saturating_add(1);
        let judged = self.judge(frame).and_then(|()| self.states(frame));
        match judged {
            Ok(states) => {
                self.write(&states, frame);
                Ok(())
            }
            Err(rejection) => {
                self.counters.reject(rejection);
                Err(rejection)
            }
        }
    }

    /// Takes in one frame of a base that is tracked. On springs it brings the platform's displacement instead
    /// of a wrench, and the platform's attitude and rate instead of the base link's.
    ///
    /// # Errors
    /// Why it was left out; rows of frames before it and after it are made apart then.
    pub fn absorb_tracked(&mut self, frame: &TrackedFrame<'_, T>) -> Result<(), FrameRejection> {
        self.counters.frames = self.counters.frames.saturating_add(1);
        let wrench = self.sums.wrench(&frame.wrench);
        let judged = match wrench {
            Some(_) if !self.sums.is_one_turn(frame) => Err(FrameRejection::NoAttitude(0)),
            _ => Ok(()),
        };
        let frame = &TrackedFrame { wrench: wrench.unwrap_or(frame.wrench), ..*frame };
        // Numbers that are none are distinguished from turns that do not agree.
        if let Err(rejection) = self.judge_tracked(frame).and(judged) {
            self.window.clear();
            self.sums.clear();
            self.counters.reject(rejection);
            return Err(rejection);
        }
        self.counters.absorbed = self.counters.absorbed.saturating_add(1);
        if wrench.is_some() {
            self.write_suspended(frame);
        } else if self.window.push(frame) {
            self.write_tracked();
        }
        Ok(())
    }

    /// Counts a frame whose header already says that it is of another tree.
    pub fn reject_links(&mut self, links: u8) {
        self.counters.frames = self.counters.frames.saturating_add(1);
        self.counters.reject(FrameRejection::Links(links));
    }

    #[inline(never)]
    fn judge(&mut self, frame: &Frame<'_, T>) -> Result<(), FrameRejection> {
        self.judge_wrench(frame.links.len() + 1, frame.wrench)?;
        let own = [&frame.specific_force, &frame.rate, &frame.angular_acceleration];
        if !own.iter().all(|v| v.iter().all(|x| x.is_finite())) {
            return Err(FrameRejection::NotFinite(0));
        }
        let mut motion = Trace(0);
        own.iter().for_each(|v| motion.add(*v));
        for (i, link) in frame.links.iter().enumerate() {
            let mut numbers = link.rate.iter().chain(&link.angular_acceleration).chain(&link.attitude);
            if !numbers.all(|x| x.is_finite()) {
                return Err(FrameRejection::NotFinite(1 + i as u8));
            }
            motion.add(&link.attitude);
            motion.add(&link.rate);
            motion.add(&link.angular_acceleration);
        }
        self.judge_stillness(&motion, frame.wrench)
    }

    #[inline(never)]
    fn judge_tracked(&mut self, frame: &TrackedFrame<'_, T>) -> Result<(), FrameRejection> {
        self.judge_wrench(frame.links.len(), frame.wrench)?;
        if !frame.velocity.iter().all(|x| x.is_finite()) {
            return Err(FrameRejection::NotFinite(0));
        }
        let mut motion = Trace(0);
        motion.add(&frame.velocity);
        for (i, link) in frame.links.iter().enumerate() {
            if !link.rate.iter().chain(&link.attitude).all(|x| x.is_finite()) {
                return Err(FrameRejection::NotFinite(i as u8));
            }
            attitude(link.attitude).ok_or(FrameRejection::NoAttitude(i as u8))?;
            motion.add(&link.attitude);
            motion.add(&link.rate);
        }
        self.judge_stillness(&motion, frame.wrench)
    }

    fn judge_wrench(&mut self, links: usize, wrench: [T; 6]) -> Result<(), FrameRejection> {
        if self.is_full() {
            return Err(FrameRejection::Full);
        }
        if links != self.links() {
            return Err(FrameRejection::Links(links.min(255) as u8));
        }
        self.screen.check_values(wrench).map_err(FrameRejection::Wrench)
    }

    fn judge_stillness(&mut self, motion: &Trace, wrench: [T; 6]) -> Result<(), FrameRejection> {
        let repeats = motion.0 == self.last_motion && wrench != self.last_wrench;
        self.still = if repeats { self.still.saturating_add(1) } else { 0 };
        (self.last_motion, self.last_wrench) = (motion.0, wrench);
        if self.still_after > 0 && self.still >= self.still_after {
            return Err(FrameRejection::WithoutMotion);
        }
        Ok(())
    }

    /// Returns every link's motion in the axes of S.
    #[inline(never)]
    fn states(&self, frame: &Frame<'_, T>) -> Result<[LinkState<T>; LINKS], FrameRejection> {
        let mut states = [LinkState::zero(); LINKS];
        if let Some(base) = states.first_mut() {
            base.rate = frame.rate.into();
            base.angular_acceleration = frame.angular_acceleration.into();
            base.specific_force = frame.specific_force.into();
        }
        for (i, (link, motion)) in self.links.iter().skip(1).zip(frame.links).enumerate() {
            let no_attitude = FrameRejection::NoAttitude(1 + i as u8);
            let rotation = attitude(motion.attitude).ok_or(no_attitude)?;
            let Some(parent) = states.get(usize::from(link.parent)).copied() else {
                return Err(no_attitude);
            };
            let arm = parent.rotation * Vector3::from(link.position);
            let (w, c) = (&parent.rate, &parent.angular_acceleration);
            if let Some(state) = states.get_mut(1 + i) {
                *state = LinkState {
                    rotation,
                    position: parent.position + arm,
                    rate: rotation * Vector3::from(motion.rate),
                    angular_acceleration: rotation * Vector3::from(motion.angular_acceleration),
                    specific_force: parent.specific_force + c.cross(&arm) + w.cross(&w.cross(&arm)),
                    ..LinkState::zero()
                };
            }
        }
        Ok(states)
    }

    /// Writes the whitened rows of the columns that stay.
    #[inline(never)]
    fn write(&mut self, states: &[LinkState<T>; LINKS], frame: &Frame<'_, T>) {
        let half = usize::from(self.waiting) * 6;
        let weights = self.weights;
        let set = |column: &mut Column<T>, values: [T; 6]| {
            let slots = column.rows.iter_mut().skip(half);
            for ((slot, value), weight) in slots.zip(values).zip(weights) {
                *slot = value * weight;
            }
        };
        let mut columns = self.block.iter_mut();
        for (state, kept) in states.iter().zip(self.kept).take(usize::from(self.count)) {
            let block = rows::block(state);
            for k in (0..10).filter(|k| kept >> k & 1 == 1) {
                if let Some(column) = columns.next() {
                    set(column, block.map(|row| row.get(k).copied().unwrap_or_default()));
                }
            }
        }
        if let Some(column) = columns.next() {
            set(column, core::array::from_fn(|i| frame.wrench[i] - self.known_offset[i]));
        }
        self.counters.absorbed = self.counters.absorbed.saturating_add(1);
        self.written();
    }

    /// Adds a frame on springs to the rows that are not complete, and writes the whitened rows of those that
    /// become so.
    #[inline(never)]
    fn write_suspended(&mut self, frame: &TrackedFrame<'_, T>) {
        let links = self.links.get(..usize::from(self.count)).unwrap_or_default();
        let Some(complete) =
            self.sums.push(&mut self.window.store, (links, &self.kept), frame, &self.known_offset)
        else {
            return;
        };
        // Of locked coordinates there are no rows.
        let first = usize::from(self.waiting) * self.sums.rows();
        for (column, rows) in self.block.iter_mut().zip(complete.as_chunks::<6>().0) {
            if first == 0 {
                *column = Column::ZERO;
            }
            let free = (0..6).filter(|k| self.sums.is_free(*k));
            for (slot, k) in column.rows.iter_mut().skip(first).zip(free) {
                *slot = rows.get(k).copied().unwrap_or_default()
                    * self.weights.get(k).copied().unwrap_or_default();
            }
        }
        self.written();
    }

    /// Writes the whitened rows that the filter leaves of the columns that stay.
    #[inline(never)]
    fn write_tracked(&mut self) {
        let half = usize::from(self.waiting) * 6;
        let (window, weights, block) = (&self.window, &self.weights, &mut self.block);
        let parameters = self.factor.parameters();
        for column in block.iter_mut().take(parameters) {
            column.rows.iter_mut().skip(half).take(6).for_each(|v| *v = T::ZERO);
        }
        let links = self.links.get(..usize::from(self.count)).unwrap_or_default();
        window.rows(links, &self.kept, |column, force, moment| {
            let rows = block.get_mut(column).and_then(|column| column.rows.get_mut(half..));
            let Some([fx, fy, fz, mx, my, mz, ..]) = rows else { return };
            if let Some(force) = force {
                (*fx, *fy, *fz) = (*fx + force.x, *fy + force.y, *fz + force.z);
            }
            (*mx, *my, *mz) = (*mx + moment.x, *my + moment.y, *mz + moment.z);
        });
        for column in block.iter_mut().take(parameters) {
            for (row, weight) in column.rows.iter_mut().skip(half).zip(weights) {
                *row *= *weight;
            }
        }
        if let Some(column) = block.get_mut(parameters) {
            let slots = column.rows.iter_mut().skip(half);
            for ((slot, value), weight) in slots.zip(window.wrench(&self.known_offset)).zip(weights) {
                *slot = value * *weight;
            }
        }
        self.written();
    }

    fn written(&mut self) {
        self.waiting += 1;
        self.in_level = self.in_level.saturating_add(1);
        if usize::from(self.waiting) * 6 >= BLOCK_ROWS {
            self.reduce();
        }
    }

    #[inline(never)]
    fn reduce(&mut self) {
        let used = usize::from(self.waiting) * self.sums.rows();
        let columns = self.factor.parameters() + 1;
        if let Some(columns) = self.block.get_mut(..columns) {
            self.factor.absorb(columns, used);
        }
        self.waiting = 0;
    }

    /// Begins to hand the level over: what waits for a block is absorbed, and frames are counted anew.
    pub fn begin_hand_over(&mut self) {
        if self.waiting > 0 {
            let used = usize::from(self.waiting) * self.sums.rows();
            for column in &mut self.block {
                for row in column.rows.iter_mut().skip(used) {
                    *row = T::ZERO;
                }
            }
            self.reduce();
        }
        (self.in_level, self.small_enough) = (0, 0);
    }

    /// Returns the level.
    pub fn factor(&self) -> &TreeFactor<T> {
        &self.factor
    }

    /// Returns the level, to take rows out of.
    pub fn factor_mut(&mut self) -> &mut TreeFactor<T> {
        &mut self.factor
    }
}

/// A polynomial of numbers' bits (FNV-1a by words).
struct Trace(u32);

impl Trace {
    fn add<T: Scalar>(&mut self, values: &[T]) {
        for value in values {
            self.0 = (self.0 ^ value.trace_bits()).wrapping_mul(0x0100_0193);
        }
    }
}

#[cfg(test)]
#[path = "frames_tests.rs"]
mod tests;
