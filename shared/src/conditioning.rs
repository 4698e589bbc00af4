//! One low-pass FIR over every regressor row and the wrench alike.
//!
//! Lives here: the kernel and its polyphase evaluation. May not live here: what the rows mean. Before this:
//! [`crate::regressor`]; after it: [`crate::factor`].
//!
//! Filtering both sides of `A φ = w` with one FIR of unit gain at zero frequency leaves the equation exact.
//! ω̇ enters through the kernel's derivative, `h ∗ ω̇ = ḣ ∗ ω`, so nothing is differentiated twice or
//! delayed against anything else. The kernel is `(1 − x²)⁸` on its width: finitely supported, eight times
//! differentiable at its ends, made of products only. Its aliasing error at 200 Hz and 0.1 s is below 2e-9 of
//! a 1 Hz rate's derivative.
//!
//! If rows are much rarer than samples, neighbouring samples are averaged first and the kernel, sampled more
//! coarsely, takes the averages. That is one FIR still, on rows and wrench alike, and `h̄ ∗ ω̇ = ḣ̄ ∗ ω` for
//! the averages as for the samples. Averages of white noise are white, so nothing is lost: the noise gain is
//! that of the kernel on its own samples, divided by their number. An output is evaluated when it is due,
//! folding the symmetric halves of the kernel onto each other.

use crate::Scalar;

/// Averages are taken no more seldom than this, 1/s: the kernel of 0.1 s then still has fifteen samples.
const LEAST_RATE_HZ: u32 = 150;

/// Tells why a kernel cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KernelError {
    /// Rate or width is not finite, not positive, or `row_every` is zero.
    Invalid,
    /// The width needs this many taps, more than there is room for.
    TooManyTaps(u32),
}

/// Coefficients of the kernel `h` and of its derivative, centred, for sums of neighbouring samples.
#[derive(Clone, Copy, Debug)]
pub struct Kernel<T: Scalar, const TAPS: usize> {
    taps: usize,
    smooth: [T; TAPS],
    derivative: [T; TAPS],
    noise_gain: T,
    derivative_noise_gain: T,
}

/// Writes a kernel's weights, of one piece of code for all lengths; returns taps and noise gains.
#[inline(never)]
fn fill<T: Scalar>(
    rate_hz: T,
    width_s: T,
    averaged: u16,
    smooth: &mut [T],
    derivative: &mut [T],
) -> Result<(usize, T, T), KernelError> {
    let averaged = T::from_u32(u32::from(averaged));
    let sum_rate_hz = rate_hz / averaged;
    let half = sum_rate_hz * width_s / T::from_u32(2);
    if !half.is_finite() || half < T::ZERO || rate_hz <= T::ZERO || smooth.is_empty() {
        return Err(KernelError::Invalid);
    }
    // Whole samples strictly inside the half width.
    let mut reach = 0_u32;
    while T::from_u32(reach + 1) < half && reach < 1_000_000 {
        reach += 1;
    }
    let taps = 2 * reach + 1;
    if taps as usize > smooth.len() || taps > u32::from(u16::MAX) {
        return Err(KernelError::TooManyTaps(taps));
    }
    if reach == 0 {
        smooth.iter_mut().take(1).for_each(|h| *h = T::ONE);
        return Ok((1, T::ONE, T::ZERO));
    }
    let taps = taps as usize;
    let (mut sum, mut slope) = (T::ZERO, T::ZERO);
    for (i, (h, d)) in smooth.iter_mut().zip(derivative.iter_mut()).take(taps).enumerate() {
        let offset = T::from_i32(i as i32 - reach as i32);
        let x = offset / half;
        let u = T::ONE - x * x;
        let u2 = u * u;
        let u4 = u2 * u2;
        *h = u4 * u4;
        // ḣ at the lag (centre − sample): −x, hence +x u⁷ up to a constant.
        *d = x * u4 * u2 * u;
        sum += *h;
        slope += *d * offset;
    }
    // Σ h = 1 exactly, and Σ d t = 1 exactly, on averages: constants and straight lines pass without error.
    let (sum, slope_per_second) = (sum * averaged, slope * averaged / sum_rate_hz);
    let (mut energy, mut derivative_energy) = (T::ZERO, T::ZERO);
    for (h, d) in smooth.iter_mut().zip(derivative).take(taps) {
        *h /= sum;
        *d /= slope_per_second;
        energy += *h * *h;
        derivative_energy += *d * *d;
    }
    Ok((taps, energy * averaged, derivative_energy * averaged))
}

impl<T: Scalar, const TAPS: usize> Kernel<T, TAPS> {
    /// No taps. All bits are zero.
    pub(crate) const NONE: Self = Self {
        taps: 0,
        smooth: [T::ZERO; TAPS],
        derivative: [T::ZERO; TAPS],
        noise_gain: T::ZERO,
        derivative_noise_gain: T::ZERO,
    };

    /// Returns the kernel of `width_s` seconds for sums of `averaged` samples at `rate_hz`. Width zero is
    /// the identity, for still rows: ω̇ is then 0.
    ///
    /// # Errors
    /// [`KernelError`] if it cannot be, or does not fit.
    pub fn new(rate_hz: T, width_s: T, averaged: u16) -> Result<Self, KernelError> {
        let mut kernel = Self::NONE;
        let gains = fill(rate_hz, width_s, averaged, &mut kernel.smooth, &mut kernel.derivative)?;
        (kernel.taps, kernel.noise_gain, kernel.derivative_noise_gain) = gains;
        Ok(kernel)
    }

    /// Returns the kernel where an output is wanted every `row_every` samples, and how many of them are
    /// averaged first.
    ///
    /// # Errors
    /// [`KernelError`] if it cannot be, or does not fit.
    pub fn for_rows(rate_hz: T, width_s: T, row_every: u16) -> Result<(Self, u16), KernelError> {
        if row_every == 0 {
            return Err(KernelError::Invalid);
        }
        let least = T::from_u32(LEAST_RATE_HZ);
        let fits =
            |k: u16| row_every.is_multiple_of(k) && (k == 1 || rate_hz >= least * T::from_u32(u32::from(k)));
        let still = width_s <= T::ZERO;
        let averaged = (1..=row_every).rev().find(|k| !still && *k < row_every && fits(*k)).unwrap_or(1);
        Ok((Self::new(rate_hz, width_s, averaged)?, averaged))
    }

    /// Returns the weights of the samples, oldest first; they sum to one over `averaged`.
    pub fn smooth(&self) -> &[T] {
        self.smooth.get(..self.taps).unwrap_or_default()
    }

    /// Returns the weights of the samples for the derivative, oldest first, 1/s.
    pub fn derivative(&self) -> &[T] {
        self.derivative.get(..self.taps).unwrap_or_default()
    }

    /// Returns `Σ h²` over the samples: the variance of white noise after the filter, relative to before.
    pub fn noise_gain(&self) -> T {
        self.noise_gain
    }

    /// Returns `Σ ḣ²` over the samples, 1/s²: the variance of ω̇ for white noise of unit variance in ω.
    pub fn derivative_noise_gain(&self) -> T {
        self.derivative_noise_gain
    }
}

/// The filter of `S` signals, the last `D` of which come out as their derivatives, with its state.
#[derive(Clone, Copy, Debug)]
pub struct Conditioner<T: Scalar, const S: usize, const D: usize, const TAPS: usize> {
    kernel: Kernel<T, TAPS>,
    /// Samples in an average, and averages between two outputs.
    averaged: u16,
    every: u16,
    /// Sum of the samples since the last average.
    sum: [T; S],
    in_sum: u16,
    /// The last averages; the next one is written at `next`.
    averages: [[T; S]; TAPS],
    next: usize,
    /// Averages until the next output.
    until_output: u16,
}

impl<T: Scalar, const S: usize, const D: usize, const TAPS: usize> Conditioner<T, S, D, TAPS> {
    /// The filter before it is set up: [`Self::set_up`] must follow.
    pub const UNUSED: Self = Self {
        kernel: Kernel::NONE,
        averaged: 0,
        every: 0,
        sum: [T::ZERO; S],
        in_sum: 0,
        averages: [[T::ZERO; S]; TAPS],
        next: 0,
        until_output: 0,
    };

    /// Returns a filter of `width_s` seconds on samples at `rate_hz`, with an output every `row_every`
    /// samples. Width zero is the identity, for still rows.
    ///
    /// # Errors
    /// [`KernelError`] if it cannot be, or does not fit.
    pub fn new(rate_hz: T, width_s: T, row_every: u16) -> Result<Self, KernelError> {
        let mut conditioner = Self::UNUSED;
        conditioner.set_up(rate_hz, width_s, row_every)?;
        Ok(conditioner)
    }

    /// Makes it such a filter in place. On an error nothing is changed.
    ///
    /// # Errors
    /// See [`Self::new`].
    pub fn set_up(&mut self, rate_hz: T, width_s: T, row_every: u16) -> Result<(), KernelError> {
        const { assert!(D <= S) }
        let (kernel, averaged) = Kernel::for_rows(rate_hz, width_s, row_every)?;
        self.kernel = kernel;
        (self.averaged, self.every) = (averaged, row_every / averaged);
        self.reset();
        Ok(())
    }

    /// Returns the kernel.
    pub fn kernel(&self) -> &Kernel<T, TAPS> {
        &self.kernel
    }

    /// Returns the number of samples in an average.
    pub(crate) fn averaged(&self) -> u16 {
        self.averaged
    }

    /// Forgets all samples.
    pub fn reset(&mut self) {
        (self.in_sum, self.next) = (0, 0);
        self.until_output = self.kernel.taps as u16;
    }

    /// Takes one sample. The last `D` signals come out as their derivatives.
    #[inline(always)]
    pub fn push(&mut self, signals: &[T; S]) -> Option<[T; S]> {
        if self.in_sum == 0 {
            self.sum = *signals;
        } else {
            for (sum, value) in self.sum.iter_mut().zip(signals) {
                *sum += *value;
            }
        }
        self.in_sum += 1;
        if self.in_sum < self.averaged {
            return None;
        }
        self.end_average()
    }

    /// Takes the sum of the samples of an average.
    #[inline(never)]
    fn end_average(&mut self) -> Option<[T; S]> {
        self.in_sum = 0;
        if let Some(slot) = self.averages.get_mut(self.next) {
            *slot = self.sum;
        }
        self.next += 1;
        if self.next >= self.kernel.taps {
            self.next = 0;
        }
        self.until_output -= 1;
        if self.until_output > 0 {
            return None;
        }
        self.until_output = self.every;
        Some(self.output())
    }

    /// Returns the smoothed signals and the derivatives. The kernel's halves lie mirrored, those of its
    /// derivative mirrored and negated.
    #[inline(never)]
    fn output(&self) -> [T; S] {
        let Kernel { taps, smooth, derivative, .. } = &self.kernel;
        let all = self.averages.get(..*taps).unwrap_or_default();
        let (newer, older) = all.split_at(self.next.min(all.len()));
        let (mut from_start, mut from_end) =
            (older.iter().chain(newer), newer.iter().rev().chain(older.iter().rev()));
        let mut y = [T::ZERO; S];
        let half = taps / 2;
        for ((h, d), (a, b)) in
            smooth.iter().zip(derivative).take(half).zip((&mut from_start).zip(&mut from_end))
        {
            let (smoothed, rates) = y.split_at_mut(S - D);
            for (sum, (a, b)) in smoothed.iter_mut().zip(a.iter().zip(b)) {
                *sum += *h * (*a + *b);
            }
            for (sum, (a, b)) in rates.iter_mut().zip(a.iter().zip(b).skip(S - D)) {
                *sum += *d * (*a - *b);
            }
        }
        if let (Some(h), Some(middle)) = (smooth.get(half), from_start.next()) {
            for (sum, value) in y.iter_mut().take(S - D).zip(middle) {
                *sum += *h * *value;
            }
        }
        y
    }

    /// Returns the number of samples until the next output, that one included.
    pub(crate) fn until_output(&self) -> u32 {
        let averages = u32::from(self.until_output.saturating_sub(1));
        averages * u32::from(self.averaged) + u32::from(self.averaged.saturating_sub(self.in_sum))
    }

    /// Returns the number of samples under the filter.
    pub fn span(&self) -> usize {
        self.kernel.taps * usize::from(self.averaged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::regressor::{SIGNALS, SMOOTHED};

    fn ramp(t: f64) -> [f64; SIGNALS] {
        core::array::from_fn(|c| 3.0 + 0.5 * t * (c as f64 + 1.0))
    }

    #[test]
    fn a_straight_line_passes_unchanged_and_its_slope_is_exact() {
        let mut filter = Conditioner::<f64, SIGNALS, 3, 64>::new(1000.0, 0.1, 10).unwrap();
        // Averages of five, nineteen of them.
        assert_eq!(filter.span(), 95);
        let mut outputs = 0;
        for n in 0..1000 {
            if let Some(y) = filter.push(&ramp(n as f64 * 1e-3)) {
                let middle = (n as f64 - 47.0) * 1e-3;
                for c in 0..SMOOTHED {
                    assert!((y[c] - ramp(middle)[c]).abs() < 1e-12);
                }
                for c in SMOOTHED..SIGNALS {
                    assert!((y[c] - 0.5 * (c as f64 + 1.0)).abs() < 1e-10);
                }
                outputs += 1;
            }
        }
        // The first is complete at sample 94, then one every ten samples.
        assert_eq!(outputs, (999 - 94) / 10 + 1);
    }

    #[test]
    fn the_samples_until_the_next_output_are_known() {
        for (rate, row_every) in [(1000.0, 10), (250.0, 3), (1200.0, 7), (1000.0, 1)] {
            let mut filter = Conditioner::<f64, SIGNALS, 3, 128>::new(rate, 0.08, row_every).unwrap();
            let mut said = filter.until_output();
            assert_eq!(said as usize, filter.span());
            for n in 1..500 {
                let came = filter.push(&ramp(f64::from(n))).is_some();
                assert_eq!(came, said == 1, "{rate} {row_every}: sample {n}");
                said = if came { u32::from(row_every) } else { said - 1 };
                assert_eq!(filter.until_output(), said, "{rate} {row_every}: sample {n}");
            }
        }
    }

    #[test]
    fn the_output_is_the_convolution_written_out() {
        // Rate, samples between outputs, samples averaged.
        for (rate, row_every, averaged) in
            [(250.0, 3, 1), (200.0, 2, 1), (600.0, 6, 3), (1000.0, 10, 5), (1200.0, 7, 7)]
        {
            let x = |n: usize, c: usize| ((n * 37 + c * 11) % 101) as f64 / 50.0 - 1.0;
            let mut filter = Conditioner::<f64, SIGNALS, 3, 128>::new(rate, 0.08, row_every).unwrap();
            let averaged = if averaged == usize::from(row_every) { 1 } else { averaged };
            assert_eq!(usize::from(filter.averaged), averaged);
            let mut first = 0;
            for n in 0..600 {
                if let Some(y) = filter.push(&core::array::from_fn(|c| x(n, c))) {
                    assert_eq!(n + 1, first + filter.span());
                    let kernel = &filter.kernel;
                    for c in 0..SIGNALS {
                        let table = if c < SMOOTHED { &kernel.smooth } else { &kernel.derivative };
                        let direct: f64 =
                            (0..filter.span()).map(|i| table[i / averaged] * x(first + i, c)).sum();
                        assert!((y[c] - direct).abs() < 1e-13 * table.iter().map(|t| t.abs()).sum::<f64>());
                    }
                    first += usize::from(row_every);
                }
            }
            assert!(first > 400);
        }
    }

    #[test]
    fn the_noise_gains_are_those_of_the_filter_s_response() {
        let mut filter = Conditioner::<f64, SIGNALS, 3, 64>::new(1000.0, 0.1, 10).unwrap();
        // Impulses at every phase give all of the response.
        let (mut gain, mut derivative_gain) = (0.0, 0.0);
        for phase in 0..10 {
            filter.reset();
            for n in 0..400 {
                let impulse = f64::from(u8::from(n == 200 + phase));
                if let Some(y) = filter.push(&[impulse; SIGNALS]) {
                    gain += y[0] * y[0];
                    derivative_gain += y[17] * y[17];
                }
            }
        }
        assert!((gain / filter.kernel().noise_gain() - 1.0).abs() < 1e-12);
        assert!((derivative_gain / filter.kernel().derivative_noise_gain() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn derivative_of_a_sinusoid_is_exact_to_the_aliasing_bound() {
        // h ∗ ω̇ against ḣ ∗ ω for 1 Hz at 0.1 s: at 200 Hz, and at 1 kHz by averages of five.
        let w = core::f64::consts::TAU;
        for (rate, row_every) in [(200.0, 2), (1000.0, 10)] {
            let mut filter = Conditioner::<f64, SIGNALS, 3, 64>::new(rate, 0.1, row_every).unwrap();
            for n in 0..(rate as usize) {
                let t = w * n as f64 / rate + 0.123;
                let mut signals = [0.0; SIGNALS];
                (signals[0], signals[17]) = (w * t.cos(), t.sin());
                if let Some(y) = filter.push(&signals) {
                    assert!((y[17] - y[0]).abs() < 2e-9 * w);
                }
            }
        }
    }

    #[test]
    fn widths_that_do_not_fit_are_named() {
        let refused =
            |width, row_every| Conditioner::<f32, SIGNALS, 3, 8>::new(1000.0, width, row_every).unwrap_err();
        assert_eq!(refused(0.1, 10), KernelError::TooManyTaps(19));
        assert_eq!(refused(f32::NAN, 10), KernelError::Invalid);
        assert_eq!(refused(0.1, 0), KernelError::Invalid);
    }
}
