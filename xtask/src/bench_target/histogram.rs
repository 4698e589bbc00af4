//! The number of samples by their number of instructions.

use serde::Serialize;

/// Instructions in a bin.
const BIN: u64 = 500;
/// Shares of all samples, in thousandths, with what they are called.
const SHARES: [(u64, &str); 3] = [(500, "p50"), (990, "p99"), (999, "p99.9")];
/// Characters of the longest bar.
const WIDTH: f64 = 40.0;

/// Instructions of a sample, to one tick of the emulated clock, and in how many samples.
pub type Counts = [(u64, u64)];

/// One entry's part of the JSON: percentiles of instructions, and bins.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Histogram {
    path_p50_instructions: u64,
    path_p99_instructions: u64,
    path_p99_9_instructions: u64,
    /// The beginning of a bin of 500 instructions, and the samples in it; empty bins are left out.
    path_histogram: Vec<(u64, u64)>,
}

impl Histogram {
    /// Sums counts up, which ascend. `None` if there are none.
    pub fn of(counts: &Counts) -> Option<Self> {
        let [path_p50_instructions, path_p99_instructions, path_p99_9_instructions] =
            SHARES.map(|(share, _)| quantile(counts, share));
        let path_histogram = bins(counts);
        let some = !path_histogram.is_empty();
        some.then_some(Self {
            path_p50_instructions,
            path_p99_instructions,
            path_p99_9_instructions,
            path_histogram,
        })
    }
}

/// Returns the fewest instructions that this share of the samples does not exceed.
fn quantile(counts: &Counts, thousandths: u64) -> u64 {
    let all: u64 = counts.iter().map(|(_, count)| count).sum();
    let mut seen = 0;
    let reached = counts.iter().find(|(_, count)| {
        seen += count;
        1000 * seen >= thousandths * all
    });
    reached.map_or(0, |(instructions, _)| *instructions)
}

fn bins(counts: &Counts) -> Vec<(u64, u64)> {
    let mut bins: Vec<(u64, u64)> = Vec::new();
    for (instructions, count) in counts {
        let bin = instructions / BIN * BIN;
        match bins.last_mut().filter(|last| last.0 == bin) {
            Some(last) => last.1 += count,
            None => bins.push((bin, *count)),
        }
    }
    bins
}

/// Prints a case's quantiles, its worst sample and its bins, if there are any; a bar is as long as the
/// logarithm of its count.
pub fn print(name: &str, counts: &Counts, worst: u64) {
    if counts.is_empty() {
        return;
    }
    let quantiles = SHARES.map(|(share, called)| format!("{called} {}", quantile(counts, share)));
    println!("\n{name}: {}, max {worst}\n", quantiles.join(", "));
    let bins = bins(counts);
    let most = bins.iter().map(|(_, count)| *count).max().unwrap_or(1);
    let length = |count: u64| (1.0 + count as f64).ln() / (1.0 + most as f64).ln() * WIDTH;
    for (bin, count) in &bins {
        let bar = "#".repeat(length(*count).ceil() as usize);
        println!("{bin:>7} – {:<7} {count:>7}  {bar}", bin + BIN - 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_and_bins_are_those_of_the_samples() {
        let counts = [(480, 1), (960, 899), (1000, 90), (1480, 9), (5000, 1)];
        assert_eq!(
            [0, 500, 990, 999, 1000].map(|share| quantile(&counts, share)),
            [480, 960, 1000, 1480, 5000]
        );
        assert_eq!(bins(&counts), [(0, 1), (500, 899), (1000, 99), (5000, 1)]);
        assert_eq!(Histogram::of(&[]), None);
    }
}
