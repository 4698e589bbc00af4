//! The first guess of gains: each effort beside what the nominal model and friction of the joint say.

use rigident_fit::{Factor, FitError, RowSource as _, Silent};
use rigident_model::Model;
use rigident_rows::tree::TreeSource;

/// Row blocks that are made at once.
const AT_ONCE: usize = 64;
/// A gain is seen if the nominal torque explains this many standard deviations of it.
const SEEN: f64 = 3.0;

/// Returns the first guess of the gain of each freedom, of efforts that are scaled by one: the reciprocal of
/// what the nominal torque explains of them. Where it explains nothing the gain is the median of the others';
/// `None` where it explains no joint's.
///
/// # Errors
/// [`FitError`] if there are no rows.
pub fn gains(source: &TreeSource, nominal: &Model) -> Result<Option<Vec<f64>>, FitError> {
    let blocks = source.blocks(&Silent)?;
    let (channels, columns) = (source.channels().len(), source.parameters().len());
    let (base, first) = (source.base(), source.input().first_effort());
    let bodies = nominal.welded();
    let standard: Vec<f64> = bodies.links.iter().flat_map(|link| link.nominal.unwrap_or([0.0; 10])).collect();
    // Columns of a root that is held still are left out of the base parameters' own.
    let skip = standard.len().saturating_sub(base.standard.len());
    let value = |terms: &[(usize, f64)]| -> f64 {
        terms.iter().map(|(c, weight)| weight * standard.get(skip + c).copied().unwrap_or(0.0)).sum()
    };
    let known: Vec<f64> = base.parameters.iter().map(|parameter| value(&parameter.terms)).collect();
    let own = 1 + columns - known.len();
    let mut factors = vec![Factor::new(own); channels.saturating_sub(first)];
    let (mut rows, mut values) = (Vec::new(), Vec::new());
    for start in (0..blocks.len()).step_by(AT_ONCE) {
        let count = AT_ONCE.min(blocks.len() - start);
        rows.resize(count * channels * columns, 0.0);
        values.resize(count * channels, 0.0);
        blocks.write_blocks(start..start + count, channels, &mut rows, &mut values);
        for (k, factor) in factors.iter_mut().enumerate() {
            for block in 0..count {
                let at = block * channels + first + k;
                let Some((row, value)) = rows.get(at * columns..(at + 1) * columns).zip(values.get(at))
                else {
                    continue;
                };
                let torque: f64 = row.iter().zip(&known).map(|(a, b)| a * b).sum();
                let all: Vec<f64> =
                    [torque].into_iter().chain(row.iter().skip(known.len()).copied()).collect();
                factor.absorb([(all.as_slice(), *value)]);
            }
        }
    }
    let found: Vec<Option<f64>> = factors.iter().map(seen).collect();
    let mut sizes: Vec<f64> = found.iter().flatten().map(|gain| gain.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes.get(sizes.len() / 2).copied();
    Ok(median.map(|median| found.into_iter().map(|gain| gain.unwrap_or(median)).collect()))
}

/// Returns the reciprocal of the first unknown of rows, if they show it.
fn seen(factor: &Factor) -> Option<f64> {
    let solution = factor.solve(factor.rounding());
    let (estimate, determined) = (*solution.estimate.first()?, *solution.determined.first()?);
    let free = factor.rows() as f64 - factor.parameters() as f64;
    let variance = factor.residual_sum_of_squares() / free.max(1.0) * solution.covariance[(0, 0)];
    (determined && estimate.abs() > SEEN * variance.max(0.0).sqrt()).then(|| 1.0 / estimate)
}
