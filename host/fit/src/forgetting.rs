//! Forgetting and windows: the firmware's algorithm (`rigident_shared::forgetting`) for any number of
//! parameters.
//!
//! A segment of some tenths of a second renews what its rows excite. Let the columns of X span these
//! directions; the memory `M = RᵀR` splits uniquely into `M∥ = M X (XᵀMX)⁻¹ XᵀM` and `M⊥ X = 0`, and
//! `M ← λ M∥ + M⊥ + S`: what the motion does not renew is not forgotten (Cao and Schwartz 2000; Lai and
//! Bernstein 2024). With Q an orthonormal basis of the columns of `R X`, `R ← (1 − β Q Qᵀ) R`,
//! `z ← (1 − β Q Qᵀ) z`, `β = 1 − √λ`. A direction is excited if its information is well above what noise of
//! the signals alone would bring.

use nalgebra::{DMatrix, DVector};
use rigident_shared::forgetting::{SIGNIFICANCE, Span, retention};

use super::jacobi::Jacobi;
use super::{Factor, Filter};

/// Segments that a time constant is divided into.
const SEGMENTS: f64 = 20.0;
/// Row blocks in a segment, at least and at most: half a second at a hundred blocks a second.
const SEGMENT_BLOCKS: (u32, u32) = (10, 50);
/// Parts that a window is divided into, of which the newest is being filled: four fifths of it are held at
/// least.
const PARTS: usize = 5;

/// Everything retained of the segments so far.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    kept: Kept,
    /// Row blocks in a segment.
    pub(super) segment_blocks: u32,
    block_s: f64,
    channels: usize,
}

#[derive(Clone, Debug)]
enum Kept {
    Forgetting { memory: Forgetting, time_constant_s: f64 },
    Window { segments: Vec<Factor>, newest: usize, part_blocks: u32, filled: u32 },
}

impl Memory {
    /// Returns a memory of nothing; `None` if the span is shorter than the filter or so short that a part of
    /// it holds no row block, or rows have no time. `noise` is that of the coefficients, see
    /// [`super::RowSource::coefficient_noise`].
    pub(super) fn new(span: Span<f64>, filter: &Filter, noise: Vec<f64>, channels: usize) -> Option<Self> {
        let (Span::TimeConstant(span_s) | Span::Window(span_s)) = span;
        let block_s = filter.row_period_s();
        if !span_s.is_finite() || block_s <= 0.0 || span_s < filter.width_s {
            return None;
        }
        let n = noise.len();
        let blocks_of = |parts: f64| (span_s / (parts * block_s)).round().clamp(0.0, 4e9) as u32;
        let (segment_blocks, kept) = match span {
            Span::TimeConstant(time_constant_s) => {
                let independence = filter.row_noise_gain().min(1.0);
                let memory = Forgetting::new(noise, independence);
                let segment = blocks_of(SEGMENTS).clamp(SEGMENT_BLOCKS.0, SEGMENT_BLOCKS.1);
                (segment, Kept::Forgetting { memory, time_constant_s })
            }
            Span::Window(_) => {
                let part = blocks_of(PARTS as f64);
                let segments = vec![Factor::new(n); PARTS];
                // As equal as can be, so that a part of the window ends with one of them.
                let segment = part.div_ceil(part.div_ceil(SEGMENT_BLOCKS.1).max(1));
                (segment, Kept::Window { segments, newest: PARTS - 1, part_blocks: part, filled: 0 })
            }
        };
        (segment_blocks > 0).then_some(Self { kept, segment_blocks, block_s, channels })
    }

    /// Takes in a segment.
    pub(super) fn take(&mut self, segment: &Factor) {
        let blocks = segment.rows() / self.channels.max(1) as u64;
        match &mut self.kept {
            Kept::Forgetting { memory, time_constant_s } => {
                let length_s = blocks as f64 * self.block_s;
                memory.take(segment, retention(length_s, *time_constant_s));
            }
            Kept::Window { segments, newest, part_blocks, filled } => {
                if let Some(slot) = segments.get_mut(*newest) {
                    slot.merge(segment);
                }
                *filled = filled.saturating_add(u32::try_from(blocks).unwrap_or(u32::MAX));
                if *filled >= *part_blocks {
                    *newest = (*newest + 1) % PARTS;
                    if let Some(slot) = segments.get_mut(*newest) {
                        *slot = Factor::new(slot.parameters());
                    }
                    *filled = 0;
                }
            }
        }
    }

    /// Keeps the memory about these parameters from now on, for the digits' sake.
    pub(super) fn recentre(&mut self, parameters: &[f64]) {
        if let Kept::Forgetting { memory, .. } = &mut self.kept {
            memory.recentre(parameters);
        }
    }

    /// Returns the factor of everything retained.
    pub(super) fn factor(&self) -> Factor {
        match &self.kept {
            Kept::Forgetting { memory, .. } => memory.factor(),
            Kept::Window { segments, newest, .. } => {
                let n = segments.first().map_or(0, Factor::parameters);
                let mut whole = Factor::new(n);
                for k in 1..=PARTS {
                    if let Some(segment) = segments.get((newest + k) % PARTS) {
                        whole.merge(segment);
                    }
                }
                whole
            }
        }
    }
}

/// A memory of segments that forgets what newer segments renew.
#[derive(Clone, Debug)]
pub(super) struct Forgetting {
    noise: Vec<f64>,
    /// Independent rows that each row is worth.
    independence: f64,
    /// φ_r.
    reference: Vec<f64>,
    /// R and `z − R φ_r`.
    memory: Factor,
    rows: f64,
}

impl Forgetting {
    fn new(noise: Vec<f64>, independence: f64) -> Self {
        let n = noise.len();
        Self { noise, independence, reference: vec![0.0; n], memory: Factor::new(n), rows: 0.0 }
    }

    fn factor(&self) -> Factor {
        self.memory.about(&self.reference.iter().map(|v| -v).collect::<Vec<_>>())
    }

    fn recentre(&mut self, reference: &[f64]) {
        if reference.iter().all(|v| v.is_finite()) {
            let change: Vec<f64> = reference.iter().zip(&self.reference).map(|(a, b)| a - b).collect();
            self.memory = self.memory.about(&change);
            self.reference = reference.to_vec();
        }
    }

    /// Takes in a segment and keeps the share `lambda` (0 to 1) of what it renews.
    fn take(&mut self, segment: &Factor, lambda: f64) {
        if segment.rows() == 0 || !segment.is_finite() || !lambda.is_finite() {
            return;
        }
        let segment = &segment.about(&self.reference);
        if lambda >= 1.0 {
            self.memory.merge(segment);
            self.rows = self.memory.rows() as f64;
            return;
        }
        let (n, lambda) = (self.noise.len(), lambda.max(0.0));
        let count = segment.rows() as f64;
        let edge = 1.0 + (n as f64 / (count * self.independence)).sqrt();
        let least = f64::from(SIGNIFICANCE) * edge * edge;
        let mut scaled = segment.r();
        let scale: Vec<f64> = scaled
            .column_iter()
            .zip(&self.noise)
            .map(|(column, noise)| {
                let noise = (noise * count.sqrt()).max(f64::EPSILON * column.norm());
                if noise > 0.0 { noise } else { 1.0 }
            })
            .collect();
        for (mut column, scale) in scaled.column_iter_mut().zip(&scale) {
            column /= *scale;
        }
        let Jacobi { w, v, squares } = Jacobi::of(scaled);
        let excited: Vec<usize> = (0..n).filter(|k| squares[*k] > least).collect();
        if excited.is_empty() {
            return;
        }
        self.forget(&v, &scale, &excited, lambda);
        if excited.len() == n {
            self.memory.merge(segment);
        } else {
            // One row a direction: s vᵀ (D φ) = uᵀ z.
            let rows = excited.iter().map(|k| {
                let s = squares[*k].sqrt();
                let row: Vec<f64> = v.column(*k).iter().zip(&scale).map(|(v, scale)| s * v * scale).collect();
                let value: f64 = w.column(*k).iter().zip(segment.z()).map(|(w, z)| w * z / s).sum();
                (row, value)
            });
            let rows: Vec<(Vec<f64>, f64)> = rows.collect();
            self.memory.absorb(rows.iter().map(|(row, value)| (row.as_slice(), *value)));
        }
        self.count(segment, excited.len(), lambda);
    }

    /// `M ← λ M∥ + M⊥`.
    fn forget(&mut self, v: &DMatrix<f64>, scale: &[f64], excited: &[usize], lambda: f64) {
        let n = self.noise.len();
        let beta = (1.0 - lambda) / (1.0 + lambda.sqrt());
        let mut r = self.memory.r();
        let mut z = DVector::from_column_slice(self.memory.z());
        // Columns of R X, made orthonormal; where the memory knows nothing there is nothing to forget.
        let mut basis: Vec<DVector<f64>> = Vec::new();
        let rounding = f64::EPSILON * n as f64;
        for k in excited {
            let direction = DVector::from_fn(n, |j, _| v[(j, *k)] / scale[j]);
            let mut column = &r * direction;
            let size = column.norm_squared();
            // Twice is enough (Giraud, Langou and Rozložník 2005).
            for _ in 0..2 {
                for other in &basis {
                    let share = other.dot(&column);
                    column.axpy(-share, other, 1.0);
                }
            }
            let left = column.norm_squared();
            if left > rounding * rounding * size && left > f64::MIN_POSITIVE {
                basis.push(column / left.sqrt());
            }
        }
        for q in &basis {
            let share = r.tr_mul(q) * beta;
            r.ger(-1.0, q, &share, 1.0);
            z.axpy(-beta * q.dot(&z), q, 1.0);
        }
        let residual = self.memory.residual_sum_of_squares();
        let mut memory = Factor::new(n);
        let rows: Vec<Vec<f64>> = r.row_iter().map(|row| row.iter().copied().collect()).collect();
        memory.absorb(rows.iter().zip(z.iter()).map(|(row, z)| (row.as_slice(), *z)));
        self.memory = memory.with_residual(residual, 0);
    }

    /// Rows and residuals belong to no direction: they are forgotten in proportion to the number of
    /// directions.
    fn count(&mut self, segment: &Factor, number: usize, lambda: f64) {
        let n = self.noise.len();
        let share = number as f64 / n.max(1) as f64;
        let kept = 1.0 - (1.0 - lambda) * share;
        self.rows = kept * self.rows + share * segment.rows() as f64;
        let merged = if number == n { segment.residual_sum_of_squares() } else { 0.0 };
        let old = (self.memory.residual_sum_of_squares() - merged).max(0.0);
        let residual = kept * old + share * segment.residual_sum_of_squares();
        let memory = std::mem::replace(&mut self.memory, Factor::new(0));
        self.memory = memory.with_residual(residual, self.rows.round() as u64);
    }
}
