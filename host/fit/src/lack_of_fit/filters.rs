//! Filters over whitened rows, several columns at once.

/// Columns that are filtered beside one another: each waits for its own last output, and none for another's.
const BESIDE: usize = 8;
/// Rows of them at once.
const ROWS: usize = 64;
/// Below this frequency the integrals forget, Hz.
const FORGET_HZ: f64 = 0.01;

/// The last two inputs and the last two outputs of columns.
type Last = [[f64; BESIDE]; 4];

/// A filter of second order over rows.
#[derive(Clone, Copy)]
pub(super) struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

impl Section {
    /// Returns `(b₂ s² + b₀)/(s² + 2ζω₀ s + ω₀²)` at a frequency in Hz by the bilinear transform, right at
    /// that frequency.
    fn new(frequency_hz: f64, damping: f64, squared: f64, constant: f64, rate_hz: f64) -> Self {
        let omega = std::f64::consts::TAU * frequency_hz;
        let k = omega / (0.5 * omega / rate_hz).tan();
        let (k2, o2) = (k * k, omega * omega);
        let a0 = k2 + 2.0 * damping * omega * k + o2;
        let b = [squared * k2 + constant, 2.0 * (constant - squared * k2), squared * k2 + constant];
        let a = [2.0 * (o2 - k2), k2 - 2.0 * damping * omega * k + o2];
        Self { b: b.map(|v| v / a0), a: a.map(|v| v / a0) }
    }

    /// Returns what a resonance of this frequency and damping adds.
    pub(super) fn resonance(frequency_hz: f64, damping: f64, rate_hz: f64) -> Self {
        Self::new(frequency_hz, damping, -1.0, 0.0, rate_hz)
    }

    /// Returns a low-pass that lets through what is slower than a frequency.
    pub(super) fn low_pass(frequency_hz: f64, damping: f64, rate_hz: f64) -> Self {
        let omega = std::f64::consts::TAU * frequency_hz;
        Self::new(frequency_hz, damping, 0.0, omega * omega, rate_hz)
    }

    /// Returns the outputs over time of columns of one length, each settled on its first input.
    pub(super) fn apply(&self, inputs: &[&[f64]]) -> Vec<Vec<f64>> {
        let mut outputs: Vec<Vec<f64>> = inputs.iter().map(|own| vec![0.0; own.len()]).collect();
        // Of nothing comes nothing.
        let moving: Vec<usize> = (0..inputs.len()).filter(|j| inputs[*j].iter().any(|x| *x != 0.0)).collect();
        let mut rows = [[0.0; BESIDE]; ROWS];
        for beside in moving.chunks(BESIDE) {
            let count = inputs[beside[0]].len();
            let mut last = None;
            for from in (0..count).step_by(ROWS) {
                let own = from..count.min(from + ROWS);
                let rows = &mut rows[..own.len()];
                for (place, j) in beside.iter().enumerate() {
                    rows.iter_mut().zip(&inputs[*j][own.clone()]).for_each(|(row, x)| row[place] = *x);
                }
                last = self.over(rows, last);
                for (place, j) in beside.iter().enumerate() {
                    outputs[*j][own.clone()].iter_mut().zip(&*rows).for_each(|(y, row)| *y = row[place]);
                }
            }
        }
        outputs
    }

    /// Replaces the columns of rows by their outputs; takes and returns the last two inputs and outputs.
    fn over(&self, rows: &mut [[f64; BESIDE]], last: Option<Last>) -> Option<Last> {
        let Self { b, a } = self;
        let settled = |first: &[f64; BESIDE]| {
            let gain = b.iter().sum::<f64>() / (1.0 + a.iter().sum::<f64>());
            let output = first.map(|x| gain * x);
            [*first, *first, output, output]
        };
        let [mut x1, mut x2, mut y1, mut y2] = last.or_else(|| rows.first().map(settled))?;
        for row in rows {
            let x = *row;
            for (k, y) in row.iter_mut().enumerate() {
                *y = b[0] * x[k] + b[1] * x1[k] + b[2] * x2[k] - a[0] * y1[k] - a[1] * y2[k];
            }
            (x1, x2, y1, y2) = (x, x1, *row, y1);
        }
        Some([x1, x2, y1, y2])
    }
}

/// Returns the second integral over time with its sign turned, `1/(ω² + ω_f²)` at the frequency ω: one that
/// forgets, forwards and then backwards, so that no phase is lost; each without its mean, as where it began
/// is not known.
pub(super) fn second_integral(input: impl Iterator<Item = f64>, rate_hz: f64) -> Vec<f64> {
    let step = 0.5 / rate_hz;
    let forget = std::f64::consts::TAU * FORGET_HZ * step;
    let once = |input: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
        let (mut sum, mut before) = (0.0, 0.0);
        let integral = input.map(|x| {
            sum = (sum * (1.0 - forget) + step * (x + before)) / (1.0 + forget);
            before = x;
            sum
        });
        let integral: Vec<f64> = integral.collect();
        let mean = integral.iter().sum::<f64>() / integral.len().max(1) as f64;
        integral.into_iter().map(|v| v - mean).collect()
    };
    let forwards = once(&mut { input });
    let mut twice = once(&mut forwards.into_iter().rev());
    twice.reverse();
    twice
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_beside_one_another_are_filtered_as_each_alone() {
        let section = Section::resonance(3.0, 0.1, 100.0);
        let column = |k: usize| (0..150).map(|t| 0.3 + (0.1 * (t * (k + 1)) as f64).sin()).collect();
        let mut columns: Vec<Vec<f64>> = (0..10).map(column).collect();
        columns[4].fill(0.0);
        let all = section.apply(&columns.iter().map(Vec::as_slice).collect::<Vec<_>>());
        for (own, x) in all.iter().zip(&columns) {
            assert_eq!(section.apply(&[x])[0], *own);
        }
        assert!(all[4].iter().all(|y| *y == 0.0));
        let (x, y, Section { b, a }) = (&columns[9], &all[9], section);
        for t in 2..150 {
            let inputs = b[0] * x[t] + b[1] * x[t - 1] + b[2] * x[t - 2];
            assert_eq!(y[t], inputs - a[0] * y[t - 1] - a[1] * y[t - 2], "{t}");
        }
    }
}
