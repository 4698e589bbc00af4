//! Frames of a tree whose base cameras track: positions and rates, of which rows are made and filtered here.
//!
//! All vectors are in the laboratory's axes, z up, and moments about the base's origin at r, wherever that is. With D the momentum
//! about it and S what gravity alone needs, `[F; M] = ∂D + S + [0; ṙ × D_F]`, so with the kernel k of the filter
//! `k ∗ [F; M] = k̇ ∗ D + k ∗ (S + [0; ṙ × D_F])`: no acceleration is ever formed, and r never enters. The frames under the kernel are
//! kept, not their rows: of sixteen links 484 bytes a frame.

use nalgebra::Vector3;

use super::link::{FrameLink, LINKS, attitude};
use crate::Scalar;
use crate::conditioning::{Kernel, KernelError};
use crate::tree::LinkState;
use crate::tree::momentum::momentum;

/// Taps of the filter at most: 0.1 s at 200 frames a second.
pub const TAPS: usize = 19;
/// Standard gravity, m/s².
const GRAVITY: f32 = 9.806_65;

/// How rows of tracked frames are filtered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameFilter<T> {
    /// Frames per second.
    pub rate_hz: T,
    /// Width of the kernel, s.
    pub width_s: T,
    /// Rows are absorbed every so many frames.
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

/// What is kept of a frame.
#[derive(Clone, Copy, Debug)]
struct Kept<T> {
    wrench: [T; 6],
    velocity: [T; 3],
    links: [LinkPose<T>; LINKS],
}

/// The frames under the kernel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window<T: Scalar> {
    kernel: Kernel<T, TAPS>,
    row_every: u16,
    frames: [Kept<T>; TAPS],
    /// Where the next frame goes.
    next: u8,
    /// Frames until rows are due.
    until: u16,
    /// The number that continues the window; of nothing if no frame is held.
    expected: u32,
    is_empty: bool,
}

impl<T: Scalar> Window<T> {
    /// All bits are zero.
    pub(super) const UNUSED: Self = Self {
        kernel: Kernel::NONE,
        row_every: 0,
        frames: [Kept {
            wrench: [T::ZERO; 6],
            velocity: [T::ZERO; 3],
            links: [LinkPose { attitude: [T::ZERO; 4], rate: [T::ZERO; 3] }; LINKS],
        }; TAPS],
        next: 0,
        until: 0,
        expected: 0,
        is_empty: false,
    };

    /// The kernel of a filter.
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
    pub(super) fn set_up(&mut self, filter: Option<&FrameFilter<T>>) -> Result<(), KernelError> {
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

    /// Whether frames are tracked ones.
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
        if let Some(kept) = self.frames.get_mut(usize::from(self.next)) {
            (kept.wrench, kept.velocity) = (frame.wrench, frame.velocity);
            for (slot, link) in kept.links.iter_mut().zip(frame.links) {
                *slot = *link;
            }
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

    /// Calls `each` with the weights of smoothed and differentiated parts and the frame, from the oldest to the newest.
    fn each_frame(&self, mut each: impl FnMut(T, T, &Kept<T>)) {
        let taps = self.kernel.smooth().len();
        let (newest, oldest) = self.frames.split_at_checked(usize::from(self.next)).unwrap_or_default();
        let used = oldest.iter().take(taps.saturating_sub(newest.len())).chain(newest);
        let weights = self.kernel.smooth().iter().zip(self.kernel.derivative());
        for ((smooth, derivative), kept) in weights.zip(used) {
            each(*smooth, *derivative, kept);
        }
    }

    /// Adds up the filtered rows: calls `add` with the number of a column that stays, its forces where it has any, and its moments,
    /// of every frame.
    pub(super) fn rows(
        &self,
        links: &[FrameLink<T>],
        columns: &[u16],
        mut add: impl FnMut(usize, Option<Vector3<T>>, Vector3<T>),
    ) {
        let upward = Vector3::new(T::ZERO, T::ZERO, T::from_f32(GRAVITY));
        self.each_frame(|smooth, derivative, kept| {
            let velocity = Vector3::from(kept.velocity);
            let mut next = 0;
            for (state, columns) in states(links, kept).iter().zip(columns).take(links.len()) {
                let h = momentum(state);
                for k in (0..10).filter(|k| columns >> k & 1 == 1) {
                    let [x, y, z, a, b, c] = h.each_ref().map(|row| row.get(k).copied().unwrap_or_default());
                    let linear = Vector3::new(x, y, z);
                    let mut moment = Vector3::new(a, b, c) * derivative;
                    let force = (k < 4).then(|| {
                        // What stands against gravity: m a at the link's origin, and mc.
                        let (force, arm) = match k.checked_sub(1).and_then(|k| state.rotation.data.0.get(k)) {
                            None => (upward, state.position),
                            Some(axis) => (Vector3::zeros(), Vector3::from(*axis)),
                        };
                        moment += (arm.cross(&upward) + velocity.cross(&linear)) * smooth;
                        force * smooth + linear * derivative
                    });
                    add(next, force, moment);
                    next += 1;
                }
            }
        });
    }

    /// The filtered wrench less an offset: N, N m.
    pub(super) fn wrench(&self, offset: &[T; 6]) -> [T; 6] {
        let mut sum = [T::ZERO; 6];
        self.each_frame(|smooth, _, kept| {
            for ((sum, value), offset) in sum.iter_mut().zip(kept.wrench).zip(offset) {
                *sum += smooth * (value - *offset);
            }
        });
        sum
    }
}

/// Every link's motion in the laboratory's axes, about the base's origin; velocities are the laboratory's.
#[inline(never)]
fn states<T: Scalar>(links: &[FrameLink<T>], kept: &Kept<T>) -> [LinkState<T>; LINKS] {
    let mut states = [LinkState::zero(); LINKS];
    for (i, (link, pose)) in links.iter().zip(&kept.links).enumerate() {
        // Judged when it was taken.
        let Some(rotation) = attitude(pose.attitude) else { continue };
        let (mut position, mut velocity) = (Vector3::zeros(), Vector3::from(kept.velocity));
        if let Some(parent) = states.get(usize::from(link.parent)).filter(|_| i > 0) {
            let arm = parent.rotation * Vector3::from(link.position);
            position = parent.position + arm;
            velocity = parent.velocity + parent.rate.cross(&arm);
        }
        if let Some(state) = states.get_mut(i) {
            let rate = rotation * Vector3::from(pose.rate);
            *state = LinkState { rotation, position, velocity, rate, ..LinkState::zero() };
        }
    }
    states
}
