//! Springs under a base that is tracked: they are the sensor, and rows are made of every frame.
//!
//! Axes are those of the platform at rest, z up; moments are about the point O of the platform. A frame
//! brings O's shift d and the vector θ of the turn, and the springs' wrench is `[F; M] = −K [d; θ]`. What
//! they carry at rest is a column for every coordinate that is not locked: two forces, the weight, which acts
//! at the height of the anchors, its two horizontal moments, which turn with the platform R, and a moment
//! about the vertical: `F = (fx, fy, W)`, `M = R (my, −mx, h W) × ẑ + mz ẑ`.
//!
//! Frames come too often for keeping them under the kernel and making their rows anew for every row block. So
//! each frame's rows are made once, added up with those of its neighbours as [`crate::conditioning`] averages
//! samples, and the sums go with their weights into every row block whose kernel lies over them: one FIR over
//! exact rows, at an even cost.

use nalgebra::{Matrix3, Vector3};

use super::FramesError;
use super::link::{FrameLink, LINKS, attitude};
use super::tracked::{FrameFilter, OF_LINK, ROOM, TAPS, TrackedFrame, WITH_FORCES, link_columns, states};
use crate::Scalar;
use crate::conditioning::{Kernel, KernelError};

/// Links on springs at most.
pub const SUSPENDED_LINKS: usize = 8;
/// Numbers of a column of sums: smoothed and differentiated, six each.
const SUMMED: usize = 12;
/// A pivot of the scaled stiffness that is less is none.
const LEAST_PIVOT: f32 = 1e-5;
/// The vector of a turn and twice the quaternion's may differ by this much, rad: turns of up to 0.7 rad.
const SAME_TURN: f32 = 0.02;

/// Springs under the platform that carries the base link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suspension<T> {
    /// K about O: forces (N) and moments (N m) against shifts (m) and turns (rad), row by row.
    pub stiffness: [[T; 6]; 6],
    /// Origin of the base link against O, axes of the platform, m.
    pub base_position: [T; 3],
    /// Axes of the platform ← base link, as a quaternion w, x, y, z.
    pub base_attitude: [T; 4],
    /// Height of the anchors above O, m.
    pub anchor_height: T,
    /// Bit k: coordinate k of x, y, z and the turns about them is locked.
    pub locked: u8,
}

impl<T: Scalar> Suspension<T> {
    /// Returns how many coordinates are free.
    pub fn free(&self) -> usize {
        (!self.locked & 0x3f).count_ones() as usize
    }

    /// Checks whether there can be such springs.
    pub(super) fn check(&self) -> Result<(), FramesError> {
        let placed = self.base_position.iter().chain(&[self.anchor_height]).all(|v| v.is_finite());
        if !placed || self.free() == 0 || attitude(self.base_attitude).is_none() {
            return Err(FramesError::Suspension);
        }
        if self.is_positive() { Ok(()) } else { Err(FramesError::Stiffness) }
    }

    /// Returns whether the stiffness is finite, symmetric, and positive where it is free: elimination leaves
    /// positive pivots.
    fn is_positive(&self) -> bool {
        let mut k = self.stiffness;
        for i in 0..6 {
            for j in 0..6 {
                // NaN is not equal to itself.
                if k[i][j] != k[j][i] || !k[i][j].is_finite() {
                    return false;
                }
            }
        }
        let is_free = |i: usize| self.locked >> i & 1 == 0;
        for p in (0..6).filter(|p| is_free(*p)) {
            let pivot = k[p][p];
            if pivot <= T::from_f32(LEAST_PIVOT) * self.stiffness[p][p] || pivot <= T::ZERO {
                return false;
            }
            for i in p + 1..6 {
                let share = k[i][p] / pivot;
                for j in p + 1..6 {
                    let taken = share * k[p][j];
                    k[i][j] -= taken;
                }
            }
        }
        true
    }
}

/// The place of the base link on what is tracked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mount<T> {
    /// The origin of the base link, axes of what is tracked, m.
    pub(super) arm: Vector3<T>,
    /// Axes of what is tracked ← base link.
    pub(super) rotation: Matrix3<T>,
}

impl<T: Scalar> Mount<T> {
    /// The base link itself is tracked.
    pub(super) const NONE: Self = Self {
        arm: Vector3::new(T::ZERO, T::ZERO, T::ZERO),
        rotation: Matrix3::new(T::ONE, T::ZERO, T::ZERO, T::ZERO, T::ONE, T::ZERO, T::ZERO, T::ZERO, T::ONE),
    };
}

/// Row blocks that are not complete. Their numbers are in the room that else holds frames: sums since the
/// last average, then the blocks, column by column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sums<T: Scalar> {
    kernel: Kernel<T, TAPS>,
    stiffness: [[T; 6]; 6],
    arm: [T; 3],
    rotation: [[T; 3]; 3],
    anchor_height: T,
    locked: u8,
    /// Blocks under way; zero: there are no springs.
    blocks: u8,
    /// Columns: parameters and the measured side.
    columns: u8,
    /// Frames in an average, averages between two blocks.
    averaged: u16,
    every: u16,
    /// Frames in the sums.
    in_sum: u16,
    /// Averages since the start, of which whole rounds of all blocks are left out later.
    averages: u16,
    /// The number that continues the series.
    expected: u32,
    is_empty: bool,
}

impl<T: Scalar> Sums<T> {
    /// The sums without springs. All bits are zero.
    pub(super) const UNUSED: Self = Self {
        kernel: Kernel::NONE,
        stiffness: [[T::ZERO; 6]; 6],
        arm: [T::ZERO; 3],
        rotation: [[T::ZERO; 3]; 3],
        anchor_height: T::ZERO,
        locked: 0,
        blocks: 0,
        columns: 0,
        averaged: 0,
        every: 0,
        in_sum: 0,
        averages: 0,
        expected: 0,
        is_empty: false,
    };

    /// Returns the kernel of a filter, the frames in an average and the blocks under way, of the given number
    /// of parameters.
    ///
    /// # Errors
    /// [`KernelError`] if there is none, or no room for it.
    pub(super) fn kernel(
        filter: Option<&FrameFilter<T>>,
        parameters: usize,
    ) -> Result<(Kernel<T, TAPS>, u16, usize), KernelError> {
        let filter = filter.ok_or(KernelError::Invalid)?;
        let (kernel, averaged) = Kernel::for_rows(filter.rate_hz, filter.width_s, filter.row_every)?;
        let taps = kernel.smooth().len();
        if taps < 2 {
            return Err(KernelError::Invalid);
        }
        let blocks = taps.div_ceil(usize::from(filter.row_every / averaged));
        // The sums take as much as two blocks.
        if 6 * (blocks + 2) * (parameters + 1) > ROOM {
            return Err(KernelError::TooManyTaps(taps as u32));
        }
        Ok((kernel, averaged, blocks))
    }

    /// Takes these springs, or none.
    ///
    /// # Errors
    /// [`FramesError`]; see [`Suspension::check`] too.
    pub(super) fn set_up(
        &mut self,
        filter: Option<&FrameFilter<T>>,
        suspension: Option<&Suspension<T>>,
        parameters: usize,
    ) -> Result<(), FramesError> {
        *self = Self::UNUSED;
        let (Some(own), Some(filter)) = (suspension, filter) else { return Ok(()) };
        let (kernel, averaged, blocks) =
            Self::kernel(Some(filter), parameters).map_err(FramesError::Filter)?;
        (self.kernel, self.averaged, self.blocks) = (kernel, averaged, blocks as u8);
        (self.every, self.columns) = (filter.row_every / averaged, parameters as u8 + 1);
        (self.stiffness, self.arm, self.locked) = (own.stiffness, own.base_position, own.locked);
        self.anchor_height = own.anchor_height;
        self.rotation = attitude(own.base_attitude).ok_or(FramesError::Suspension)?.data.0;
        self.clear();
        Ok(())
    }

    /// Returns whether there are springs.
    pub(super) fn is_used(&self) -> bool {
        self.blocks > 0
    }

    /// Returns whether a coordinate is not locked.
    pub(super) fn is_free(&self, k: usize) -> bool {
        self.locked >> k & 1 == 0
    }

    /// Returns the number of rows of a block.
    pub(super) fn rows(&self) -> usize {
        (!self.locked & 0x3f).count_ones() as usize
    }

    /// Forgets all frames.
    pub(super) fn clear(&mut self) {
        (self.in_sum, self.averages, self.is_empty) = (0, 0, true);
    }

    /// Returns what the springs do at a displacement: N, N m; `None` without springs.
    pub(super) fn wrench(&self, displacement: &[T; 6]) -> Option<[T; 6]> {
        let of = |row: &[T; 6]| -row.iter().zip(displacement).map(|(k, q)| *k * *q).sum::<T>();
        self.is_used().then(|| self.stiffness.each_ref().map(of))
    }

    /// Returns whether the displacement's turn is that of the platform's attitude.
    pub(super) fn is_one_turn(&self, frame: &TrackedFrame<'_, T>) -> bool {
        let Some([w, vector @ ..]) = frame.links.first().map(|base| base.attitude) else { return true };
        let twice = T::from_f32(if w < T::ZERO { -2.0 } else { 2.0 });
        let turns = frame.wrench.iter().skip(3).zip(vector);
        turns.map(|(turn, v)| *turn - twice * v).all(|off| off.abs() < T::from_f32(SAME_TURN))
    }

    /// Takes a frame, whose wrench is the springs', and which has been judged; returns the columns of a row
    /// block if one is complete, six rows each.
    pub(super) fn push<'a>(
        &mut self,
        room: &'a mut [T; ROOM],
        tree: (&[FrameLink<T>], &[u16; LINKS]),
        frame: &TrackedFrame<'_, T>,
        offset: &[T; 6],
    ) -> Option<&'a [T]> {
        if !self.is_empty && frame.number != self.expected {
            self.clear();
        }
        (self.expected, self.is_empty) = (frame.number.wrapping_add(1), false);
        let (sums, blocks) = room.split_at_mut_checked(SUMMED * usize::from(self.columns))?;
        if self.in_sum == 0 {
            sums.fill(T::ZERO);
        }
        self.add(sums, tree, frame, offset);
        self.in_sum += 1;
        if self.in_sum < self.averaged {
            return None;
        }
        self.in_sum = 0;
        self.spread(sums, blocks)
    }

    /// Adds the rows of a frame to the sums.
    #[inline(never)]
    fn add(
        &self,
        sums: &mut [T],
        (links, kept): (&[FrameLink<T>], &[u16; LINKS]),
        frame: &TrackedFrame<'_, T>,
        offset: &[T; 6],
    ) {
        let velocity = Vector3::from(frame.velocity);
        let mount = Mount { arm: self.arm.into(), rotation: Matrix3::from(self.rotation) };
        let mut poses = [[T::ZERO; OF_LINK]; SUSPENDED_LINKS];
        poses.iter_mut().zip(frame.links).for_each(|(slot, pose)| *slot = pose.numbers());
        let states = states(links, &poses, &velocity, &mount);
        let mut columns = sums.as_chunks_mut::<SUMMED>().0.iter_mut();
        for (state, kept) in states.iter().zip(kept).take(links.len()) {
            for (k, own) in link_columns(state, &velocity).iter().enumerate() {
                if kept >> k & 1 == 1
                    && let Some(sums) = columns.next()
                {
                    let from = if k < WITH_FORCES { 0 } else { SUMMED - 3 };
                    sums.iter_mut().zip(own).skip(from).for_each(|(sum, value)| *sum += *value);
                }
            }
        }
        // Judged when it was taken.
        let turn =
            frame.links.first().and_then(|base| attitude(base.attitude)).unwrap_or_else(Matrix3::identity);
        for k in (0..6).filter(|k| self.is_free(*k)) {
            if let Some(sums) = columns.next() {
                sums.iter_mut().zip(self.carried(&turn, k)).for_each(|(sum, value)| *sum -= value);
            }
        }
        if let Some(sums) = columns.next() {
            let measured = frame.wrench.iter().zip(offset);
            sums.iter_mut().zip(measured).for_each(|(sum, (value, offset))| *sum += *value - *offset);
        }
    }

    /// Returns the column of what the springs carry at rest, of a coordinate.
    fn carried(&self, turn: &Matrix3<T>, coordinate: usize) -> [T; 6] {
        let [x, y, z] = turn.data.0;
        // An axis of the platform, with its factor, × ẑ.
        let turned = |[a, b, _]: [T; 3], by: T| (b * by, -a * by);
        let (mx, my) = match coordinate {
            2 => turned(z, self.anchor_height),
            3 => turned(y, T::ONE),
            4 => turned(x, -T::ONE),
            _ => (T::ZERO, T::ZERO),
        };
        let one = |at: usize| if coordinate == at { T::ONE } else { T::ZERO };
        [one(0), one(1), one(2), mx, my, one(5)]
    }

    /// Adds the sums, with their weights, to the blocks whose kernel lies over them; returns the one that is
    /// complete by that.
    #[inline(never)]
    fn spread<'a>(&mut self, sums: &[T], blocks: &'a mut [T]) -> Option<&'a [T]> {
        let count = u16::from(self.blocks);
        let (round, taps) = (count * self.every, self.kernel.smooth().len());
        let mut complete = None;
        let mut rest = blocks;
        for b in 0..count {
            let Some((block, after)) = rest.split_at_mut_checked(6 * usize::from(self.columns)) else {
                break;
            };
            rest = after;
            // A block begins after those before it.
            let since = self.averages.checked_sub(b * self.every).and_then(|s| s.checked_rem(round));
            let Some(age) = since.map(usize::from) else { break };
            let weights = (self.kernel.smooth().get(age), self.kernel.derivative().get(age));
            let (Some(smooth), Some(derivative)) = weights else { continue };
            if age == 0 {
                block.fill(T::ZERO);
            }
            for (column, sums) in block.as_chunks_mut::<6>().0.iter_mut().zip(sums.as_chunks::<SUMMED>().0) {
                let (smoothed, differentiated) = sums.split_at(6);
                for ((slot, s), d) in column.iter_mut().zip(smoothed).zip(differentiated) {
                    *slot += *smooth * *s + *derivative * *d;
                }
            }
            if age + 1 == taps {
                complete = Some(block as &[T]);
            }
        }
        self.averages += 1;
        if self.averages >= 2 * round {
            self.averages -= round;
        }
        complete
    }
}
