//! QR with column pivoting (Businger and Golub 1965), Householder, columns stored one after the other.

/// A matrix of `rows` rows, column by column, on its way to being triangular.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    pub rows: usize,
    pub data: Vec<f64>,
}

/// The result of the reduction.
#[derive(Clone, Debug)]
pub(super) struct Pivoted {
    /// Upper triangle, column by column, `steps` deep.
    pub triangle: Columns,
    /// The order of the columns.
    pub order: Vec<usize>,
    /// Magnitudes of the diagonal, decreasing, as far as they rise above `floor`.
    pub diagonal: Vec<f64>,
    /// Below this, rounding alone may be: ε · max(rows, columns) · the largest.
    pub floor: f64,
    /// Norms of what was left of the other columns.
    pub left: Vec<f64>,
}

/// Returns the sum of products in four lanes, which the compiler keeps in vector registers.
#[inline]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a8, b8) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a8.remainder().iter().zip(b8.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a8.zip(b8) {
        for k in 0..8 {
            lanes[k] += x[k] * y[k];
        }
    }
    lanes.iter().sum::<f64>() + rest
}

impl Columns {
    pub fn columns(&self) -> usize {
        self.data.len() / self.rows.max(1)
    }

    pub fn column(&self, k: usize) -> &[f64] {
        &self.data[k * self.rows..(k + 1) * self.rows]
    }

    fn swap(&mut self, a: usize, b: usize) {
        if a != b {
            let (low, high) = (a.min(b) * self.rows, a.max(b) * self.rows);
            let (left, right) = self.data.split_at_mut(high);
            left[low..low + self.rows].swap_with_slice(&mut right[..self.rows]);
        }
    }

    /// Reduces to a triangle, the column with the largest rest first, until nothing above rounding is left.
    pub fn pivot(mut self) -> Pivoted {
        let (m, n) = (self.rows, self.columns());
        let mut order: Vec<usize> = (0..n).collect();
        let mut norms: Vec<f64> = (0..n).map(|k| dot(self.column(k), self.column(k)).sqrt()).collect();
        let mut reference = norms.clone();
        let largest = norms.iter().copied().fold(0.0, f64::max);
        let floor = f64::EPSILON * m.max(n) as f64 * largest;
        let mut diagonal = Vec::new();
        for step in 0..m.min(n) {
            let best = (step..n).fold(step, |best, k| if norms[k] > norms[best] { k } else { best });
            if norms[best] <= floor {
                break;
            }
            self.swap(step, best);
            order.swap(step, best);
            norms.swap(step, best);
            reference.swap(step, best);
            let (done, rest) = self.data.split_at_mut((step + 1) * m);
            let pivot = &mut done[step * m + step..];
            let norm = dot(pivot, pivot).sqrt();
            let head = pivot[0];
            let alpha = if head > 0.0 { -norm } else { norm };
            diagonal.push(norm);
            // v = x − α e₁; H = 1 − v vᵀ / (α (α − x₁))
            pivot[0] = head - alpha;
            let scale = (alpha * (alpha - head)).recip();
            for (k, column) in rest.chunks_exact_mut(m).enumerate() {
                let tail = &mut column[step..];
                let factor = dot(pivot, tail) * scale;
                for (y, v) in tail.iter_mut().zip(&*pivot) {
                    *y -= factor * v;
                }
                let k = step + 1 + k;
                if norms[k] > 0.0 {
                    let ratio = tail[0] / norms[k];
                    let left = (1.0 - ratio * ratio).max(0.0);
                    let trust = norms[k] / reference[k];
                    if left * trust * trust <= f64::EPSILON.sqrt() {
                        norms[k] = dot(&tail[1..], &tail[1..]).sqrt();
                        reference[k] = norms[k];
                    } else {
                        norms[k] *= left.sqrt();
                    }
                }
            }
            pivot.fill(0.0);
            pivot[0] = alpha;
        }
        let left = norms.split_off(diagonal.len());
        Pivoted { triangle: self, order, diagonal, floor, left }
    }
}

impl Pivoted {
    /// Returns an element of the triangle.
    fn at(&self, row: usize, column: usize) -> f64 {
        self.triangle.data[column * self.triangle.rows + row]
    }

    /// Solves `x ← R⁻¹ x` with the leading triangle as large as x.
    pub fn solve(&self, x: &mut [f64]) {
        for k in (0..x.len()).rev() {
            x[k] /= self.at(k, k);
            let xk = x[k];
            let column = &self.triangle.column(k)[..k];
            for (y, r) in x.iter_mut().zip(column) {
                *y -= r * xk;
            }
        }
    }

    /// Solves `x ← R⁻ᵀ x`.
    fn solve_transposed(&self, x: &mut [f64]) {
        for k in 0..x.len() {
            let sum = dot(&self.triangle.column(k)[..k], &x[..k]);
            x[k] = (x[k] - sum) / self.at(k, k);
        }
    }

    /// Returns the smallest singular value of the leading triangle of `rank`, by inverse iteration: never
    /// below it, and within some per cent after a dozen steps from a start that is no singular vector.
    pub fn smallest_singular_value(&self, rank: usize) -> f64 {
        let mut x: Vec<f64> = (0..rank).map(|k| 1.0 + ((k * 7919) % 101) as f64 / 101.0).collect();
        let mut growth = 0.0;
        for _ in 0..12 {
            let norm = dot(&x, &x).sqrt();
            x.iter_mut().for_each(|v| *v /= norm);
            self.solve_transposed(&mut x);
            self.solve(&mut x);
            growth = dot(&x, &x).sqrt();
        }
        growth.sqrt().recip()
    }

    /// Returns the norm of everything that the leading triangle of `rank` leaves: no singular value that is
    /// dropped exceeds it.
    pub fn dropped(&self, rank: usize) -> f64 {
        let deep = self.diagonal.len();
        let inside: f64 = (rank..self.order.len())
            .map(|c| {
                self.triangle.column(c)[rank.min(deep)..deep.max(rank)].iter().map(|v| v * v).sum::<f64>()
            })
            .sum();
        (inside + self.left.iter().map(|v| v * v).sum::<f64>()).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn rank_singular_values_and_triangle_are_those_of_the_matrix() {
        let noise = |i: usize, j: usize| ((i * 131 + j * 71 + i * j * 17) as f64).sin();
        let (m, n, rank) = (40, 25, 17);
        let left = DMatrix::from_fn(m, rank, noise);
        let right = DMatrix::from_fn(rank, n, |i, j| noise(j + 3, i + 50));
        let a = left * right;
        let pivoted = Columns { rows: m, data: a.as_slice().to_vec() }.pivot();
        let singular = a.clone().svd(false, false).singular_values;
        assert!(pivoted.diagonal.len() >= rank);
        let kept = pivoted.smallest_singular_value(rank);
        // Of the leading triangle: at most the matrix's, at least by the factor sqrt(k (n − k) + 1) of Gu and
        // Eisenstat's ideal pivoting, which Businger and Golub's meets but for contrived matrices.
        assert!(kept <= singular[rank - 1] * 1.05, "{kept} {}", singular[rank - 1]);
        assert!(kept > singular[rank - 1] / (rank as f64 * (n - rank) as f64 + 1.0).sqrt());
        assert!(pivoted.dropped(rank) < f64::EPSILON * 100.0 * singular[0]);
        // RᵀR = Π Aᵀ A Π
        let gram = a.transpose() * &a;
        for i in 0..n {
            for k in 0..n {
                let steps = pivoted.diagonal.len().min(i.min(k) + 1);
                let sum: f64 = (0..steps).map(|r| pivoted.at(r, i) * pivoted.at(r, k)).sum();
                let wanted = gram[(pivoted.order[i], pivoted.order[k])];
                assert!((sum - wanted).abs() < 1e-12 * gram[(0, 0)].abs().max(gram.abs().max()));
            }
        }
    }
}
