//! Frames of a tree whose base cameras track: positions and rates, of which rows are made and filtered here.
//!
//! All vectors are in the laboratory's axes, z up, and moments about the base's origin at r, wherever that
//! is. With D the momentum about it and S what gravity alone needs, `[F; M] = ∂D + S + [0; ṙ × D_F]`, so with
//! the kernel k of the filter `k ∗ [F; M] = k̇ ∗ D + k ∗ (S + [0; ṙ × D_F])`: no acceleration is ever formed,
//! and r never enters. The frames under the kernel are stored, not their rows: of sixteen links 484 bytes a
//! frame. On springs ([`super::Suspension`]) the same rows are about the platform's point O: the base's
//! origin has an arm to it, and ṙ is O's velocity.

use nalgebra::Vector3;

use super::link::{FrameLink, LINKS, attitude};
use super::suspension::Mount;
use crate::Scalar;
use crate::conditioning::{Kernel, KernelError};
use crate::tree::LinkState;
use crate::tree::momentum::momentum;

/// Taps of the filter at most: 0.1 s at 200 frames a second.
pub const TAPS: usize = 19;
/// Standard gravity, m/s².
const GRAVITY: f32 = 9.806_65;

/// The filter of rows of tracked frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameFilter<T> {
    /// Frames per second.
    pub rate_hz: T,
    /// Width of the kernel, s.
    pub width_s: T,
    /// Rows are absorbed once in this many frames.
    pub row_every: u16,
}

/// Holds how one link of a tracked tree moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkPose<T> {
    /// Laboratory's axes ← link axes, as a quaternion w, x, y, z.
    pub attitude: [T; 4],
    /// Angular rate relative to the laboratory, link axes, rad/s.
    pub rate: [T; 3],
}

/// One frame of a tree whose base is tracked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackedFrame<'a, T> {
    /// One more with every frame; frames on both sides of a gap make no rows together.
    pub number: u32,
    /// Wrench on the body at the base's origin, laboratory's axes: N, N m.
    pub wrench: [T; 6],
    /// Velocity of the base's origin, laboratory's axes, m/s.
    pub velocity: [T; 3],
    /// The links, the base first.
    pub links: &'a [LinkPose<T>],
}

/// Numbers that are stored of a frame but for its links: wrench and velocity.
const OF_BASE: usize = 9;
/// Numbers that are stored of a link.
pub(super) const OF_LINK: usize = 7;
/// Room for the frames of sixteen links under the longest kernel; or for rows on springs that are not
/// complete.
pub(super) const ROOM: usize = TAPS * (OF_BASE + OF_LINK * LINKS);
/// Numbers of the columns of a link: what is smoothed and what is differentiated, forces and moments each.
pub(super) type LinkColumns<T> = [[T; 12]; 10];
/// Parameters of a link that have forces: mass and first moments.
pub(super) const WITH_FORCES: usize = 4;

/// The data stored of a frame.
struct Kept<'a, T> {
    wrench: &'a [T],
    velocity: Vector3<T>,
    links: &'a [[T; OF_LINK]],
}

/// The frames under the kernel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window<T: Scalar> {
    kernel: Kernel<T, TAPS>,
    row_every: u16,
    /// Frames one after the other.
    pub(super) store: [T; ROOM],
    /// Links of a frame.
    links: u8,
    /// The place for the next frame.
    next: u8,
    /// Frames until rows are due.
    until: u16,
    /// The number that continues the window; of nothing if no frame is held.
    expected: u32,
    is_empty: bool,
}

impl<T: Scalar> LinkPose<T> {
    /// Returns attitude and rate.
    pub(super) fn numbers(&self) -> [T; OF_LINK] {
        let ([w, a, b, c], [x, y, z]) = (self.attitude, self.rate);
        [w, a, b, c, x, y, z]
    }
}

impl<T: Scalar> Window<T> {
    /// All bits are zero.
    pub(super) const UNUSED: Self = Self {
        kernel: Kernel::NONE,
        row_every: 0,
        store: [T::ZERO; ROOM],
        links: 0,
        next: 0,
        until: 0,
        expected: 0,
        is_empty: false,
    };

    /// Returns the kernel of a filter.
    ///
    /// # Errors
    /// [`KernelError`] if there is none, or no room for it.
    pub(super) fn kernel(filter: &FrameFilter<T>) -> Result<Kernel<T, TAPS>, KernelError> {
        let kernel = Kernel::new(filter.rate_hz, filter.width_s, 1)?;
        let has_slope = kernel.derivative().len() > 1;
        if has_slope && filter.row_every > 0 { Ok(kernel) } else { Err(KernelError::Invalid) }
    }

    /// Takes this filter, or none: then nothing is tracked.
    ///
    /// # Errors
    /// See [`Self::kernel`].
    pub(super) fn set_up(&mut self, filter: Option<&FrameFilter<T>>, links: u8) -> Result<(), KernelError> {
        self.links = links;
        (self.kernel, self.row_every) = match filter {
            Some(filter) => (Self::kernel(filter)?, filter.row_every),
            None => (Kernel::NONE, 0),
        };
        self.clear();
        Ok(())
    }

    /// Forgets all frames.
    pub(super) fn clear(&mut self) {
        (self.next, self.is_empty) = (0, true);
        self.until = self.kernel.smooth().len() as u16;
    }

    /// Returns whether frames are tracked ones.
    pub(super) fn is_used(&self) -> bool {
        self.row_every > 0
    }

    /// Takes a frame, which has been judged; returns whether rows are due.
    #[inline(never)]
    pub(super) fn push(&mut self, frame: &TrackedFrame<'_, T>) -> bool {
        if !self.is_empty && frame.number != self.expected {
            self.clear();
        }
        (self.expected, self.is_empty) = (frame.number.wrapping_add(1), false);
        let stride = self.stride();
        if let Some(slots) = self.store.chunks_exact_mut(stride).nth(usize::from(self.next)) {
            let links = frame.links.iter().flat_map(LinkPose::numbers);
            let all = frame.wrench.into_iter().chain(frame.velocity).chain(links);
            slots.iter_mut().zip(all).for_each(|(slot, value)| *slot = value);
        }
        let taps = self.kernel.smooth().len();
        self.next = if usize::from(self.next) + 1 >= taps { 0 } else { self.next + 1 };
        self.until = self.until.saturating_sub(1);
        let due = self.until == 0;
        if due {
            self.until = self.row_every;
        }
        due
    }

    /// Returns the count of numbers of a frame.
    fn stride(&self) -> usize {
        OF_BASE + OF_LINK * usize::from(self.links)
    }

    /// Calls `each` with the weights of smoothed and differentiated parts and the frame, from the oldest to
    /// the newest.
    fn each_frame(&self, mut each: impl FnMut(T, T, &Kept<'_, T>)) {
        let (taps, stride) = (self.kernel.smooth().len(), self.stride());
        let used = self.store.get(..taps * stride).unwrap_or_default();
        let (newest, oldest) = used.split_at_checked(usize::from(self.next) * stride).unwrap_or_default();
        let frames = oldest.chunks_exact(stride).chain(newest.chunks_exact(stride));
        let weights = self.kernel.smooth().iter().zip(self.kernel.derivative());
        for ((smooth, derivative), frame) in weights.zip(frames) {
            let Some((wrench, [x, y, z, links @ ..])) = frame.split_at_checked(6) else { continue };
            let kept = Kept { wrench, velocity: Vector3::new(*x, *y, *z), links: links.as_chunks().0 };
            each(*smooth, *derivative, &kept);
        }
    }

    /// Adds up the filtered rows: calls `add` with the number of a column that stays, its forces where it has
    /// any, and its moments, of every frame.
    pub(super) fn rows(
        &self,
        links: &[FrameLink<T>],
        columns: &[u16],
        mut add: impl FnMut(usize, Option<Vector3<T>>, Vector3<T>),
    ) {
        self.each_frame(|smooth, derivative, kept| {
            let mut next = 0;
            let states = states(links, kept.links, &kept.velocity, &Mount::NONE);
            for (state, columns) in states.iter().zip(columns).take(links.len()) {
                let all = link_columns(state, &kept.velocity);
                for (k, column) in all.iter().enumerate().filter(|(k, _)| columns >> k & 1 == 1) {
                    let [s0, s1, s2, s3, s4, s5, d0, d1, d2, d3, d4, d5] = *column;
                    let mut moment = Vector3::new(d3, d4, d5) * derivative;
                    let force = (k < WITH_FORCES).then(|| {
                        moment += Vector3::new(s3, s4, s5) * smooth;
                        Vector3::new(s0, s1, s2) * smooth + Vector3::new(d0, d1, d2) * derivative
                    });
                    add(next, force, moment);
                    next += 1;
                }
            }
        });
    }

    /// Returns the filtered wrench less an offset: N, N m.
    pub(super) fn wrench(&self, offset: &[T; 6]) -> [T; 6] {
        let mut sum = [T::ZERO; 6];
        self.each_frame(|smooth, _, kept| {
            for ((sum, value), offset) in sum.iter_mut().zip(kept.wrench).zip(offset) {
                *sum += smooth * (*value - *offset);
            }
        });
        sum
    }
}

/// Returns the columns of a link: of each what is smoothed, then what is differentiated. `velocity` is that
/// of the point that moments are about.
#[inline(never)]
pub(super) fn link_columns<T: Scalar>(state: &LinkState<T>, velocity: &Vector3<T>) -> LinkColumns<T> {
    let upward = Vector3::new(T::ZERO, T::ZERO, T::from_f32(GRAVITY));
    let h = momentum(state);
    core::array::from_fn(|k| {
        let [x, y, z, a, b, c] = h.each_ref().map(|row| row.get(k).copied().unwrap_or_default());
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        if k < WITH_FORCES {
            // The reaction to gravity: m a at the link's origin, and mc.
            let arm = match k.checked_sub(1).and_then(|k| state.rotation.data.0.get(k)) {
                None => {
                    force = upward;
                    state.position
                }
                Some(axis) => Vector3::from(*axis),
            };
            moment = arm.cross(&upward) + velocity.cross(&Vector3::new(x, y, z));
        }
        [force.x, force.y, force.z, moment.x, moment.y, moment.z, x, y, z, a, b, c]
    })
}

/// Returns every link's motion in the laboratory's axes, about the point that the base's origin is mounted
/// to; velocities are the laboratory's.
#[inline(never)]
pub(super) fn states<T: Scalar>(
    links: &[FrameLink<T>],
    poses: &[[T; OF_LINK]],
    velocity: &Vector3<T>,
    mount: &Mount<T>,
) -> [LinkState<T>; LINKS] {
    let mut states = [LinkState::zero(); LINKS];
    for (i, (link, [qw, qx, qy, qz, rate @ ..])) in links.iter().zip(poses).enumerate() {
        // Judged when it was taken.
        let Some(mut rotation) = attitude([*qw, *qx, *qy, *qz]) else { continue };
        let rate = rotation * Vector3::from(*rate);
        let parent = states.get(usize::from(link.parent)).filter(|_| i > 0);
        let (origin, moving, turning, arm) = match parent {
            Some(p) => (p.position, p.velocity, p.rate, p.rotation * Vector3::from(link.position)),
            None => (Vector3::zeros(), *velocity, rate, rotation * mount.arm),
        };
        if i == 0 {
            rotation *= mount.rotation;
        }
        if let Some(state) = states.get_mut(i) {
            let (position, velocity) = (origin + arm, moving + turning.cross(&arm));
            *state = LinkState { rotation, position, velocity, rate, ..LinkState::zero() };
        }
    }
    states
}
