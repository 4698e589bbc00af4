//! The rows of every freedom's effort in a factor of their own: what columns leave of it.

use nalgebra::DMatrix;

use rigident_fit::{Factor, RowSource, Silent};

/// Row blocks that are made at once.
const AT_ONCE: usize = 64;

/// The factors of the rows of every freedom's effort.
pub(super) struct EffortFactors {
    factors: Vec<Factor>,
    /// Rows of each whose noise is independent.
    rows: f64,
}

impl EffortFactors {
    /// Absorbs all rows of the channels from `first` on; `None` where there are none.
    pub(super) fn of(source: &dyn RowSource, first: usize) -> Option<Self> {
        let blocks = source.blocks(&Silent).ok()?;
        let (channels, columns) = (source.channels().len(), source.parameters().len());
        let mut factors = vec![Factor::new(columns); channels.checked_sub(first)?];
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for start in (0..blocks.len()).step_by(AT_ONCE) {
            let count = AT_ONCE.min(blocks.len() - start);
            rows.resize(count * channels * columns, 0.0);
            values.resize(count * channels, 0.0);
            blocks.write_blocks(start..start + count, channels, &mut rows, &mut values);
            for (k, factor) in factors.iter_mut().enumerate() {
                let own = (0..count).filter_map(|block| {
                    let at = block * channels + first + k;
                    Some((rows.get(at * columns..(at + 1) * columns)?, *values.get(at)?))
                });
                factor.absorb(own);
            }
        }
        let filter = blocks.filter();
        let rows = blocks.len() as f64 * (filter.row_period_s() / filter.width_s).min(1.0);
        (rows > 0.0).then_some(Self { factors, rows })
    }

    /// Returns true if there are enough rows to decide between columns of this number.
    pub(super) fn can_tell(&self, columns: usize) -> bool {
        self.rows > columns as f64
    }

    /// Returns the logarithm of the sum of squares that columns leave of the efforts of freedoms, of all
    /// together.
    pub(super) fn left(&self, freedoms: impl Iterator<Item = usize>, columns: &[usize]) -> f64 {
        let of = |freedom: usize| {
            let factor = self.factors.get(freedom)?;
            let map = DMatrix::from_fn(factor.parameters(), columns.len(), |i, j| f64::from(columns[j] == i));
            let left = factor.substitute(&map).residual_sum_of_squares();
            Some(left.max(f64::MIN_POSITIVE).ln())
        };
        freedoms.filter_map(of).sum()
    }

    /// Returns twice the logarithm of the ratio of likelihoods with more columns and without them: χ² of
    /// their number, if they explain nothing; 0 where there are too few rows to tell.
    pub(super) fn gained(
        &self,
        freedoms: impl Iterator<Item = usize> + Clone,
        columns: &[usize],
        more: &[usize],
    ) -> f64 {
        let with: Vec<usize> = columns.iter().chain(more).copied().collect();
        if !self.can_tell(with.len()) {
            return 0.0;
        }
        self.rows * (self.left(freedoms.clone(), columns) - self.left(freedoms, &with))
    }
}
