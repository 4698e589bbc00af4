use super::{Forgetting, NOISY, Window, retention, whole};
use crate::Scalar;
use crate::factor::{Gram, InformationFactor};

/// Segments that a time constant is divided into.
const SEGMENTS: u32 = 20;
/// Row blocks in a segment, at least and at most: half a second at a hundred blocks a second.
const SEGMENT_BLOCKS: (u32, u32) = (10, 50);
/// Parts that a window is divided into, of which the newest is being filled: four fifths of it are held at
/// least.
const PARTS: usize = 5;

/// Parameters of a body, which may have noise in their coefficients.
const BODY: usize = 10;

/// Tells how long rows are retained. Seconds are those of rows taken in: they stand still where none are.
///
/// The tags begin at 1, which leaves 0 for `None`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(u8)]
pub enum Span<T> {
    /// Forgets what newer rows renew, with this time constant, s ([`Forgetting`]).
    TimeConstant(T) = 1,
    /// The rows of this many seconds at most, of four fifths of it at least, and nothing else ([`Window`]).
    Window(T) = 2,
}

/// 1 σ of the IMU per reading: what it alone brings into the rows is not excitation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuNoise<T> {
    /// Noise of the accelerometer, m/s².
    pub accel: T,
    /// Noise of the gyro, rad/s.
    pub gyro: T,
}

/// Holds what an estimator retains, if not everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MemoryConfig<T> {
    /// Tells how long.
    pub span: Span<T>,
    /// Noise of the IMU. A window does not use it.
    pub imu_noise: ImuNoise<T>,
}

/// Holds what is known of the rows that segments are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rows<T> {
    /// Time from one row block to the next, s.
    pub(crate) block_s: T,
    /// Weight of each channel's row: √row_every / σ.
    pub(crate) weights: [T; 6],
    /// `Σh²` of the filter and of its derivative, 1/s².
    pub(crate) noise_gain: T,
    pub(crate) derivative_noise_gain: T,
    /// Independent rows that a row is worth.
    pub(crate) independence: T,
    /// Square of the lever arm, m².
    pub(crate) lever_arm2: T,
}

impl<T: Scalar> Rows<T> {
    /// Returns the root mean square, per whitened row, of what the IMU's noise brings to the coefficients of
    /// each parameter.
    ///
    /// Of the products with ω only the derivative's noise counts: that of ω itself is smaller by its
    /// bandwidth.
    fn regressor_noise<const N: usize>(&self, imu: &ImuNoise<T>) -> [T; N] {
        let turning = imu.gyro * imu.gyro * self.derivative_noise_gain;
        let specific = imu.accel * imu.accel * self.noise_gain + self.lever_arm2 * turning;
        let [fx, fy, fz, mx, my, mz] = self.weights.map(|w| w * w);
        let ten = [
            (fx + fy + fz) * specific,
            (fy + fz) * turning + (my + mz) * specific,
            (fz + fx) * turning + (mz + mx) * specific,
            (fx + fy) * turning + (mx + my) * specific,
            mx * turning,
            my * turning,
            mz * turning,
            (my + mz) * turning,
            (mz + mx) * turning,
            (mx + my) * turning,
        ];
        // The offset's coefficients are exact.
        core::array::from_fn(|j| ten.get(j).map_or(T::ZERO, |square| (*square / T::from_u32(6)).sqrt()))
    }
}

/// Holds what is retained of all segments so far.
#[derive(Clone, Copy, Debug)]
pub struct Memory<T: Scalar, const N: usize> {
    kept: Kept<T, N>,
    block_s: T,
}

#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "no heap")]
enum Kept<T: Scalar, const N: usize> {
    Forgetting {
        memory: Forgetting<T, N>,
        time_constant_s: T,
    },
    Window {
        window: Window<T, N, PARTS>,
        /// The part that noise of the signals has added to its segments.
        grams: [Gram<T, BODY>; PARTS],
        part_blocks: u32,
        filled: u32,
    },
}

/// Holds what follows from a configuration.
#[derive(Clone, Copy, Debug)]
pub struct Plan<T: Scalar, const N: usize> {
    span: Span<T>,
    noise: [T; N],
    independence: T,
    block_s: T,
    segment_blocks: u16,
    /// Row blocks in a part of a window.
    part_blocks: u32,
}

impl<T: Scalar, const N: usize> Plan<T, N> {
    /// Makes the plan. Returns `None` if the span is no positive number, or a window so short that a part of
    /// it holds no row block, or a noise is negative or not finite.
    #[inline(never)]
    pub(crate) fn new(config: &MemoryConfig<T>, rows: &Rows<T>) -> Option<Self> {
        let (Span::TimeConstant(span_s) | Span::Window(span_s)) = config.span;
        let positive = |v: T| v.is_finite() && v > T::ZERO;
        let ImuNoise { accel, gyro } = config.imu_noise;
        if ![span_s, rows.block_s].iter().all(|v| positive(*v))
            || ![accel, gyro].iter().all(|v| v.is_finite() && *v >= T::ZERO)
        {
            return None;
        }
        let blocks_of = |parts: u32| whole(span_s / (T::from_u32(parts) * rows.block_s));
        let (segment_blocks, part_blocks) = match config.span {
            Span::TimeConstant(_) => (blocks_of(SEGMENTS).clamp(SEGMENT_BLOCKS.0, SEGMENT_BLOCKS.1), 0),
            Span::Window(_) => {
                let part = blocks_of(PARTS as u32);
                // As equal as can be, so that a part of the window ends with one of them.
                (part.div_ceil(part.div_ceil(SEGMENT_BLOCKS.1).max(1)), part)
            }
        };
        (segment_blocks > 0).then(|| Self {
            span: config.span,
            noise: rows.regressor_noise(&config.imu_noise),
            independence: rows.independence,
            block_s: rows.block_s,
            segment_blocks: segment_blocks as u16,
            part_blocks,
        })
    }

    /// Returns the row blocks in a segment.
    pub(crate) fn segment_blocks(&self) -> u16 {
        self.segment_blocks
    }
}

impl<T: Scalar, const N: usize> Memory<T, N> {
    /// Returns a memory of nothing.
    pub(crate) fn new(plan: &Plan<T, N>) -> Self {
        let kept = match plan.span {
            Span::TimeConstant(time_constant_s) => Kept::Forgetting {
                memory: Forgetting::new(plan.noise).of_coloured_rows(plan.independence),
                time_constant_s,
            },
            Span::Window(_) => {
                let grams = [Gram::ZERO; PARTS];
                Kept::Window { window: Window::new(), grams, part_blocks: plan.part_blocks, filled: 0 }
            }
        };
        Self { kept, block_s: plan.block_s }
    }

    /// Takes in a segment, and what noise of the signals has added to it.
    #[inline(never)]
    pub(crate) fn take(&mut self, segment: &InformationFactor<T, N>, gram: Option<&Gram<T, BODY>>) {
        let blocks = segment.rows() / 6;
        match &mut self.kept {
            Kept::Forgetting { memory, time_constant_s } => {
                let length_s = T::from_u32(blocks) * self.block_s;
                let mut all = Gram::ZERO;
                if let Some(gram) = gram {
                    all.add(gram, T::ONE);
                }
                memory.take_noisy(segment, &all, retention(length_s, *time_constant_s));
            }
            Kept::Window { window, grams, part_blocks, filled } => {
                window.add(segment);
                if let (Some(newest), Some(gram)) = (grams.last_mut(), gram) {
                    newest.add(gram, T::ONE);
                }
                *filled = filled.saturating_add(blocks);
                if *filled >= *part_blocks {
                    window.advance();
                    grams.rotate_left(1);
                    if let Some(newest) = grams.last_mut() {
                        *newest = Gram::ZERO;
                    }
                    *filled = 0;
                }
            }
        }
    }

    /// Returns what noise of the signals has added to everything retained.
    pub(crate) fn gram(&self) -> Gram<T, NOISY> {
        match &self.kept {
            Kept::Forgetting { memory, .. } => *memory.gram(),
            Kept::Window { grams, .. } => {
                let mut sum = Gram::ZERO;
                for gram in grams {
                    sum.add(gram, T::ONE);
                }
                sum
            }
        }
    }

    /// Multiplies all rows.
    pub(crate) fn scale(&mut self, by: T) {
        match &mut self.kept {
            Kept::Forgetting { memory, .. } => memory.scale(by),
            Kept::Window { window, grams, .. } => {
                window.scale(by);
                for gram in grams {
                    gram.scale(by * by);
                }
            }
        }
    }

    /// Takes another noise per row; see [`Forgetting::new`].
    pub(crate) fn set_noise(&mut self, noise: &[T; N]) {
        if let Kept::Forgetting { memory, .. } = &mut self.kept {
            memory.set_noise(noise);
        }
    }

    /// Receives the answer, for the digits' sake; see [`Forgetting::recentre`].
    pub(crate) fn recentre(&mut self, parameters: &[T; N]) {
        if let Kept::Forgetting { memory, .. } = &mut self.kept {
            memory.recentre(parameters);
        }
    }

    /// Returns the factor of everything retained.
    pub(crate) fn factor(&self) -> InformationFactor<T, N> {
        let mut whole = InformationFactor::EMPTY;
        for k in 0..PARTS {
            self.fold(k, &mut whole);
        }
        whole
    }

    /// Takes the `k`th of five parts of what is retained into a factor that began empty; there are no more.
    pub(crate) fn fold(&self, k: usize, whole: &mut InformationFactor<T, N>) {
        match &self.kept {
            Kept::Forgetting { memory, .. } if k == 0 => *whole = memory.factor(),
            Kept::Window { window, .. } if k < PARTS => window.fold(k, whole),
            Kept::Forgetting { .. } | Kept::Window { .. } => {}
        }
    }
}
