//! A robot that is watched while it works: did a link change, when, and by how much?
//!
//! The robot's inertial parameters are known, of one link they may change: it picks something up, or loses a
//! cover. Frames bring what the robot's own controller has: places and rates of joints, the base's IMU,
//! wrenches of feet. The reference is the IMU's place, so that no acceleration is needed but the IMU's own:
//! `w = ∂h + ω×h + [m a; mc×a]` of all links, h being the momentum relative to a frame that moves with the
//! IMU without turning. What is left of w has the rows of the watched link's changes ([`Change`]).

mod change;
mod filter;
mod robot;

use self::change::Test;
pub use self::change::{BINS, Change};
use self::filter::Filter;
pub use self::filter::WATCH_TAPS;
pub use self::robot::{WATCH_FEET, WATCH_LINKS, WatchFoot, WatchLink, turned};
use crate::Scalar;
use crate::conditioning::KernelError;
use crate::tree::{Joint, Link};
use nalgebra::{Matrix3, Vector3};

/// Steps of a sweep over the bins and of a measurement, which are to be done before the next bin.
const STEPS: u16 = 2 * BINS as u16 + 2;

/// Holds everything that fixes what is done with a frame but the links.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchConfig<T> {
    /// Links, the base included.
    pub links: u8,
    /// The link that is watched.
    pub watched: u8,
    /// Frames per second.
    pub rate_hz: T,
    /// Width of the filter, s.
    pub width_s: T,
    /// Frames from row to row; two rows make a bin.
    pub row_every: u16,
    /// 1 σ of a frame's wrench on the whole robot about the IMU's place: N, N m. Rows show their noise; a
    /// thousandth of this is the least.
    pub channel_sigma: [T; 6],
    /// Range of each channel of a sensor of forces: N, N m.
    pub range: [T; 6],
    /// The least that a change must explain: ten times F of ten degrees of freedom, as many as rows in the
    /// first half of `settle` show the noise by.
    pub limit: T,
    /// Bins before a change is reported: half for the noise, half for what the known parameters' errors
    /// leave.
    pub settle: u16,
    /// Rows before a change are forgotten with this time constant, s; zero: never.
    pub forget_s: T,
}

/// Tells why a robot cannot be watched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WatchError {
    /// There are no links, too many, or the watched one is not among them.
    Links,
    /// The link has no parent before it, no joint of one freedom, or a number that is none.
    Link(u8),
    /// There are no sensors of forces, too many, or some on no link.
    Feet,
    /// A σ is not positive and finite.
    Sigma(u8),
    /// A range is not positive.
    Range,
    /// There is no such filter, or no room for it.
    Filter(KernelError),
    /// The limit or the time constant is not positive and finite.
    Limit,
}

/// Holds a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchFrame<'a, T> {
    /// One more with every frame; those that are missing are missing rows.
    pub number: u32,
    /// Specific force that the IMU reads, its axes, m/s².
    pub specific_force: [T; 3],
    /// Angular rate that the IMU reads, rad/s.
    pub rate: [T; 3],
    /// Place and rate of each link's joint after the base: rad and rad/s, or m and m/s; not examined of a
    /// fixed one.
    pub joints: &'a [[T; 2]],
    /// Wrench on the robot of each sensor, in the sensor's axes at its origin: N, N m.
    pub wrenches: &'a [[T; 6]],
}

/// Tells why a frame was not taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WatchRejection {
    /// A frame without this many links or sensors.
    Links,
    /// A number is none, or an angle far too large.
    NotFinite,
    /// A sensor of forces is at its range: this one.
    Saturated(u8),
}

/// Holds what happened to frames so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WatchCounters {
    /// Given.
    pub frames: u32,
    /// Taken in.
    pub absorbed: u32,
    /// Frames of another robot.
    pub wrong_links: u32,
    /// Frames with a number that is none.
    pub not_finite: u32,
    /// Frames with a wrench at its range.
    pub saturated: u32,
    /// The sensor that was last.
    pub last_foot: u8,
    /// Blocks of six rows.
    pub blocks: u32,
}

/// Watches a robot.
#[derive(Clone, Copy, Debug)]
pub struct Watch<T: Scalar> {
    links: [WatchLink<T>; WATCH_LINKS],
    /// Bit i: link i is known.
    known: u32,
    count: u8,
    watched: u8,
    feet: [WatchFoot<T>; WATCH_FEET],
    feet_count: u8,
    range: [T; 6],
    filter: Filter<T>,
    test: Test<T>,
    steps_per_frame: u16,
    last: Option<u32>,
    counters: WatchCounters,
}

impl<T: Scalar> Watch<T> {
    /// The watch before it is set up: [`Self::set_up`] must follow. All bits are zero.
    pub const UNUSED: Self = Self {
        links: [WatchLink {
            link: Link {
                parent: 0,
                joint: Joint::Fixed,
                rotation: zeros(),
                position: Vector3::new(T::ZERO, T::ZERO, T::ZERO),
            },
            parameters: [T::ZERO; 10],
        }; WATCH_LINKS],
        known: 0,
        count: 0,
        watched: 0,
        feet: [WatchFoot { link: 0, rotation: zeros(), position: Vector3::new(T::ZERO, T::ZERO, T::ZERO) };
            WATCH_FEET],
        feet_count: 0,
        range: [T::ZERO; 6],
        filter: Filter::UNUSED,
        test: Test::UNUSED,
        steps_per_frame: 0,
        last: None,
        counters: WatchCounters {
            frames: 0,
            absorbed: 0,
            wrong_links: 0,
            not_finite: 0,
            saturated: 0,
            last_foot: 0,
            blocks: 0,
        },
    };

    /// Returns whether a robot can be watched so.
    ///
    /// # Errors
    /// [`WatchError`] says what is wrong.
    #[cold]
    #[inline(never)]
    pub fn check(config: &WatchConfig<T>, feet: &[WatchFoot<T>]) -> Result<(), WatchError> {
        let links = usize::from(config.links);
        if links == 0 || links > WATCH_LINKS || config.watched >= config.links {
            return Err(WatchError::Links);
        }
        if feet.is_empty() || feet.len() > WATCH_FEET {
            return Err(WatchError::Feet);
        }
        for foot in feet {
            let numbers = foot.rotation.iter().chain(&foot.position);
            if foot.link >= config.links || !numbers.copied().all(T::is_finite) {
                return Err(WatchError::Feet);
            }
        }
        for (channel, sigma) in config.channel_sigma.iter().enumerate() {
            if !sigma.is_finite() || *sigma <= T::ZERO {
                return Err(WatchError::Sigma(channel as u8));
            }
        }
        if !config.range.iter().all(|range| *range > T::ZERO) {
            return Err(WatchError::Range);
        }
        let positive = config.limit.is_finite() && config.limit > T::ZERO;
        if !positive || !config.forget_s.is_finite() || config.forget_s < T::ZERO {
            return Err(WatchError::Limit);
        }
        Filter::kernel(config.rate_hz, config.width_s, config.row_every).map(drop).map_err(WatchError::Filter)
    }

    /// Makes it a watch that has seen nothing, and to which no link is known yet ([`Self::set_link`]).
    ///
    /// # Errors
    /// See [`Self::check`]; nothing is changed then.
    #[cold]
    #[inline(never)]
    pub fn set_up(&mut self, config: &WatchConfig<T>, feet: &[WatchFoot<T>]) -> Result<(), WatchError> {
        Self::check(config, feet)?;
        (self.known, self.count, self.watched) = (0, config.links, config.watched);
        for (slot, foot) in self.feet.iter_mut().zip(feet) {
            *slot = *foot;
        }
        (self.feet_count, self.range) = (feet.len() as u8, config.range);
        self.filter.set_up(config.rate_hz, config.width_s, config.row_every).map_err(WatchError::Filter)?;
        let kernel =
            Filter::kernel(config.rate_hz, config.width_s, config.row_every).map_err(WatchError::Filter)?;
        // White noise of a frame leaves the filter with this part of its variance; rows hardly overlap.
        let gain = kernel.noise_gain().sqrt();
        let bin = T::from_u32(2 * u32::from(config.row_every));
        let forgotten =
            if config.forget_s > T::ZERO { bin / (config.rate_hz * config.forget_s) } else { T::ZERO };
        // √(1 − x) of a part of the information.
        let keep = (T::ONE - forgotten).max(T::ZERO).sqrt();
        self.test.set_up(config.channel_sigma.map(|sigma| sigma * gain), config.limit, config.settle, keep);
        self.steps_per_frame = STEPS.div_ceil(config.row_every.saturating_mul(2));
        self.restart();
        Ok(())
    }

    /// Makes a link known. Its joint is fixed, revolute or prismatic, and its parent precedes it.
    ///
    /// # Errors
    /// [`WatchError::Link`]; nothing is changed then.
    #[cold]
    #[inline(never)]
    pub fn set_link(&mut self, i: u8, link: &WatchLink<T>) -> Result<(), WatchError> {
        let wrong = WatchError::Link(i);
        let axis = match link.link.joint {
            Joint::Fixed => Vector3::zeros(),
            Joint::Revolute(axis) | Joint::Prismatic(axis) => axis,
            _ => return Err(wrong),
        };
        let numbers =
            axis.iter().chain(&link.link.rotation).chain(&link.link.position).chain(&link.parameters);
        let in_order = i == 0 || link.link.parent < usize::from(i);
        if i >= self.count || !in_order || !numbers.copied().all(T::is_finite) {
            return Err(wrong);
        }
        *self.links.get_mut(usize::from(i)).ok_or(wrong)? = *link;
        self.known |= 1 << i;
        Ok(())
    }

    /// Returns the first link that is not known yet.
    pub fn unknown_link(&self) -> Option<u8> {
        (0..self.count).find(|i| self.known >> i & 1 == 0)
    }

    /// Starts anew with the same robot.
    pub fn restart(&mut self) {
        self.filter.clear();
        self.test.clear();
        self.last = None;
        self.counters = WatchCounters::default();
    }

    /// Returns the number of links, the base included.
    pub fn links(&self) -> usize {
        usize::from(self.count)
    }

    /// Returns the number of sensors of forces.
    pub fn feet(&self) -> usize {
        usize::from(self.feet_count)
    }

    /// Returns what happened so far.
    pub fn counters(&self) -> &WatchCounters {
        &self.counters
    }

    /// Returns the number of changes found so far.
    pub fn changes(&self) -> u16 {
        self.test.changes()
    }

    /// Returns whether a change would be reported by now.
    pub fn is_settled(&self) -> bool {
        self.test.is_settled()
    }

    /// Returns how many times the known parameters' errors make the limit larger, at a second.
    pub fn excess(&self) -> T {
        self.test.excess(BINS / 2)
    }

    /// Counts a frame of another robot.
    pub fn reject_links(&mut self) {
        self.counters.frames = self.counters.frames.saturating_add(1);
        self.reject(WatchRejection::Links);
    }

    /// Takes in one frame, and does a step of the test. A change if it has just been found, and once more
    /// when it has been measured.
    ///
    /// # Errors
    /// Why it was left out; rows of frames before it and after it are made apart then.
    pub fn absorb(&mut self, frame: &WatchFrame<'_, T>) -> Result<Option<Change<T>>, WatchRejection> {
        self.counters.frames = self.counters.frames.saturating_add(1);
        let next = self.last.replace(frame.number).map(|last| last.wrapping_add(1));
        if next.is_some_and(|next| next != frame.number) {
            self.filter.clear();
        }
        let share = match self.judge(frame).and_then(|()| self.share(frame)) {
            Ok(share) => share,
            Err(rejection) => {
                self.filter.clear();
                self.reject(rejection);
                return Err(rejection);
            }
        };
        self.counters.absorbed = self.counters.absorbed.saturating_add(1);
        if let Some(rows) = self.filter.push(&share) {
            self.counters.blocks = self.counters.blocks.saturating_add(1);
            self.test.take(&rows, frame.number.wrapping_sub(self.filter.half()));
        }
        let mut found = None;
        for _ in 0..self.steps_per_frame {
            found = self.test.step(frame.number).or(found);
        }
        Ok(found)
    }

    fn share(&self, frame: &WatchFrame<'_, T>) -> Result<robot::Share<T>, WatchRejection> {
        let links = self.links.get(..self.links()).unwrap_or_default();
        let feet = self.feet.get(..self.feet()).unwrap_or_default();
        robot::motion(links, frame.joints, frame.specific_force, frame.rate)
            .and_then(|motion| motion.share(links, self.watched, feet, frame.wrenches))
            .ok_or(WatchRejection::NotFinite)
    }

    fn judge(&self, frame: &WatchFrame<'_, T>) -> Result<(), WatchRejection> {
        if frame.joints.len() + 1 != self.links() || frame.wrenches.len() != self.feet() {
            return Err(WatchRejection::Links);
        }
        let own = frame.specific_force.iter().chain(&frame.rate).chain(frame.joints.as_flattened());
        if !own.chain(frame.wrenches.as_flattened()).copied().all(T::is_finite) {
            return Err(WatchRejection::NotFinite);
        }
        for (i, wrench) in frame.wrenches.iter().enumerate() {
            if wrench.iter().zip(&self.range).any(|(value, range)| value.abs() >= *range) {
                return Err(WatchRejection::Saturated(i as u8));
            }
        }
        Ok(())
    }

    fn reject(&mut self, rejection: WatchRejection) {
        let counters = &mut self.counters;
        let count = match rejection {
            WatchRejection::Links => &mut counters.wrong_links,
            WatchRejection::NotFinite => &mut counters.not_finite,
            WatchRejection::Saturated(foot) => {
                counters.last_foot = foot;
                &mut counters.saturated
            }
        };
        *count = count.saturating_add(1);
    }
}

const fn zeros<T: Scalar>() -> Matrix3<T> {
    let o = T::ZERO;
    Matrix3::new(o, o, o, o, o, o, o, o, o)
}
