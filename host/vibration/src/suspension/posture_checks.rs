//! Checks whether locked postures can belong to one tree.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::postures::PostureSource;

/// Residuals that chance exceeds less often contradict the noise that is stated.
const SURPRISING: f64 = 1e-4;
/// First moments or tensors that scatter by more than this share of the largest are not those of one tree:
/// the paper's scatter by 0.3 %.
const SCATTERED: f64 = 0.02;

/// Returns what postures leave against one another, in words, if that is more than their noise explains.
pub fn contradiction(source: &PostureSource) -> Option<String> {
    let count = source.names().len();
    let factor = source.factor(0..count);
    let rank = source.parameters().len() - factor.solve(factor.rounding()).null_directions.len();
    let freedom = (10 * count).checked_sub(rank).filter(|freedom| *freedom > 0)? as f64;
    let advice = "are attitudes of joints from link to parent (not the transposed matrix), and tensors about \
                  the centre of mass?";
    if source.sigma_given() {
        let squares = factor.residual_sum_of_squares();
        let chance = 1.0 - ChiSquared::new(freedom).ok()?.cdf(squares);
        return (chance < SURPRISING).then(|| {
            format!(
                "the postures contradict one another: they leave {:.1} times what their noise explains; \
                 {advice}",
                (squares / freedom).sqrt()
            )
        });
    }
    let sigma = source.sigma().first()?;
    let share = |kind: std::ops::Range<usize>| {
        let values = (0..count).filter_map(|k| source.of_posture(k)).flat_map(|(_, own)| &own[kind.clone()]);
        sigma[kind.start] / values.fold(f64::MIN_POSITIVE, |most, v| most.max(v.abs()))
    };
    let (moments, tensors) = (share(1..4), share(4..7));
    (moments.max(tensors) > SCATTERED).then(|| {
        format!(
            "the postures contradict one another: first moments scatter by {:.1} % of the largest, tensors \
             by {:.1} %; {advice}",
            1e2 * moments,
            1e2 * tensors
        )
    })
}
