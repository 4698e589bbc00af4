//! The filter of what frames say. A row takes its sums along instead of frames their place in a memory: two
//! or three rows are under way at a time, and frames may be many.

use super::robot::Share;
use crate::Scalar;
use crate::conditioning::{Kernel, KernelError};

/// Frames under the filter at most.
pub const WATCH_TAPS: usize = 64;
/// Rows under way at most.
const ROWS: usize = 4;

/// Six rows: ten columns and the right-hand side each.
pub(super) type Six<T> = [[T; 11]; 6];

/// Six rows that are not complete.
#[derive(Clone, Copy, Debug)]
struct Pending<T> {
    /// Frames that it holds; zero: it is free.
    frames: u16,
    sums: Six<T>,
}

/// The rows under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Filter<T: Scalar> {
    kernel: Kernel<T, WATCH_TAPS>,
    row_every: u16,
    /// Frames until a row begins.
    until: u16,
    pending: [Pending<T>; ROWS],
}

impl<T: Scalar> Filter<T> {
    pub(super) const UNUSED: Self = Self {
        kernel: Kernel::NONE,
        row_every: 0,
        until: 0,
        pending: [Pending { frames: 0, sums: [[T::ZERO; 11]; 6] }; ROWS],
    };

    /// Returns the kernel of such a filter.
    pub(super) fn kernel(
        rate_hz: T,
        width_s: T,
        row_every: u16,
    ) -> Result<Kernel<T, WATCH_TAPS>, KernelError> {
        let kernel = Kernel::new(rate_hz, width_s, 1)?;
        let taps = kernel.smooth().len();
        // One tap knows no derivative.
        if taps < 3 || row_every == 0 || taps > ROWS * usize::from(row_every) {
            return Err(KernelError::Invalid);
        }
        Ok(kernel)
    }

    pub(super) fn set_up(&mut self, rate_hz: T, width_s: T, row_every: u16) -> Result<(), KernelError> {
        self.kernel = Self::kernel(rate_hz, width_s, row_every)?;
        self.row_every = row_every;
        self.clear();
        Ok(())
    }

    /// Returns half the frames of a row: it is about the instant this many frames back.
    pub(super) fn half(&self) -> u32 {
        (self.kernel.smooth().len() / 2) as u32
    }

    /// Forgets rows that are not complete.
    pub(super) fn clear(&mut self) {
        self.until = 0;
        self.pending.iter_mut().for_each(|row| row.frames = 0);
    }

    /// Takes a frame; six rows if it completes some.
    #[inline(never)]
    pub(super) fn push(&mut self, share: &Share<T>) -> Option<Six<T>> {
        let mut begins = self.until == 0;
        self.until = if begins { self.row_every } else { self.until }.saturating_sub(1);
        let (smooth, derivative) = (self.kernel.smooth(), self.kernel.derivative());
        let mut complete = None;
        for row in &mut self.pending {
            if row.frames == 0 {
                if !begins {
                    continue;
                }
                begins = false;
                row.sums = [[T::ZERO; 11]; 6];
            }
            let at = usize::from(row.frames);
            let (Some(h), Some(d)) = (smooth.get(at), derivative.get(at)) else { continue };
            let shares = share.smoothed.as_flattened().iter().zip(share.differentiated.as_flattened());
            for (sum, (s, m)) in row.sums.as_flattened_mut().iter_mut().zip(shares) {
                *sum += *s * *h + *m * *d;
            }
            row.frames += 1;
            if usize::from(row.frames) == smooth.len() {
                row.frames = 0;
                complete = Some(row.sums);
            }
        }
        complete
    }
}
