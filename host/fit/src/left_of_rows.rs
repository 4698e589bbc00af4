//! Residuals of rows for values of their columns, several rows side by side.

/// Blocks whose residuals are made at once.
pub(super) const CHUNK: usize = 64;

/// Rows whose sums go side by side: one alone waits for each of its additions.
const SIDE_BY_SIDE: usize = 4;

/// Writes the residuals of measurements for values, by rows of as many coefficients; the products of a row
/// are added in their order.
pub(super) fn left_of_rows(rows: &[f64], measured: &[f64], values: &[f64], out: &mut [f64]) {
    let n = values.len().max(1);
    let lines = rows.chunks(SIDE_BY_SIDE * n).zip(measured.chunks(SIDE_BY_SIDE));
    for ((rows, measured), out) in lines.zip(out.chunks_mut(SIDE_BY_SIDE)) {
        let mut own = rows.chunks_exact(n);
        if let (Some(a), Some(b), Some(c), Some(d)) = (own.next(), own.next(), own.next(), own.next()) {
            // As a sum begins.
            let mut sums = [-0.0; SIDE_BY_SIDE];
            for ((((a, b), c), d), value) in a.iter().zip(b).zip(c).zip(d).zip(values) {
                sums.iter_mut().zip([a, b, c, d]).for_each(|(sum, v)| *sum += v * value);
            }
            out.iter_mut().zip(measured).zip(sums).for_each(|((out, m), sum)| *out = m - sum);
        } else {
            let lines = rows.chunks_exact(n).zip(measured);
            out.iter_mut().zip(lines).for_each(|(out, (row, m))| *out = m - dot(row, values));
        }
    }
}

/// Returns the sum of products.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
