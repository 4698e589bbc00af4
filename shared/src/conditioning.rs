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
//! Outputs are wanted only every `row_every` samples. Instead of keeping the samples and convolving in a
//! burst, each sample is added to every window that is open: the same sums, a constant cost per sample, and
//! memory for ⌈taps / row_every⌉ windows instead of `taps` samples.

use crate::Scalar;
use crate::regressor::{SIGNALS, SMOOTHED};

/// Most windows that can be open at once.
pub const OPEN_WINDOWS: usize = 16;

/// Why a kernel cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KernelError {
    /// Rate or width is not finite, not positive, or `row_every` is zero.
    Invalid,
    /// The width needs this many taps, more than there is room for.
    TooManyTaps(u32),
    /// This many windows would be open at once, more than [`OPEN_WINDOWS`].
    TooManyWindows(u32),
}

/// Samples of the kernel `h` and of its derivative, centred.
#[derive(Clone, Copy, Debug)]
pub struct Kernel<T: Scalar, const TAPS: usize> {
    taps: usize,
    smooth: [T; TAPS],
    derivative: [T; TAPS],
    noise_gain: T,
    derivative_noise_gain: T,
}

impl<T: Scalar, const TAPS: usize> Kernel<T, TAPS> {
    /// The kernel of `width_s` seconds at `rate_hz`. Width zero is the identity, for still rows: ω̇ is then 0.
    pub fn new(rate_hz: T, width_s: T) -> Result<Self, KernelError> {
        let mut kernel = Self {
            taps: 1,
            smooth: [T::ZERO; TAPS],
            derivative: [T::ZERO; TAPS],
            noise_gain: T::ONE,
            derivative_noise_gain: T::ZERO,
        };
        let half = rate_hz * width_s / T::from_u32(2);
        if !half.is_finite() || half < T::ZERO || rate_hz <= T::ZERO || TAPS == 0 {
            return Err(KernelError::Invalid);
        }
        // Whole samples strictly inside the half width.
        let mut reach = 0_u32;
        while T::from_u32(reach + 1) < half && reach < 1_000_000 {
            reach += 1;
        }
        let taps = 2 * reach + 1;
        if taps as usize > TAPS {
            return Err(KernelError::TooManyTaps(taps));
        }
        kernel.taps = taps as usize;
        if reach == 0 {
            kernel.smooth[0] = T::ONE;
            return Ok(kernel);
        }
        let (mut sum, mut slope) = (T::ZERO, T::ZERO);
        for (i, (h, d)) in kernel.smooth.iter_mut().zip(&mut kernel.derivative).take(kernel.taps).enumerate()
        {
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
        // Σ h = 1 exactly, and Σ d t = 1 exactly: constants and straight lines pass without error.
        let slope_per_second = slope / rate_hz;
        let (mut energy, mut derivative_energy) = (T::ZERO, T::ZERO);
        for (h, d) in kernel.smooth.iter_mut().zip(&mut kernel.derivative).take(kernel.taps) {
            *h /= sum;
            *d /= slope_per_second;
            energy += *h * *h;
            derivative_energy += *d * *d;
        }
        kernel.noise_gain = energy;
        kernel.derivative_noise_gain = derivative_energy;
        Ok(kernel)
    }

    /// Number of samples under the kernel.
    pub fn taps(&self) -> usize {
        self.taps
    }

    /// `Σ h²`: the variance of white noise after the filter, relative to before.
    pub fn noise_gain(&self) -> T {
        self.noise_gain
    }

    /// `Σ ḣ²`, 1/s²: the variance of ω̇ for white noise of unit variance in ω.
    pub fn derivative_noise_gain(&self) -> T {
        self.derivative_noise_gain
    }
}

#[derive(Clone, Copy, Debug)]
struct Window<T: Scalar> {
    /// Next tap; equal to the number of taps when the window is closed.
    tap: usize,
    sums: [T; SIGNALS],
}

/// The filter with its open windows.
#[derive(Clone, Copy, Debug)]
pub struct Conditioner<T: Scalar, const TAPS: usize> {
    kernel: Kernel<T, TAPS>,
    row_every: u16,
    until_next: u16,
    windows: [Window<T>; OPEN_WINDOWS],
}

impl<T: Scalar, const TAPS: usize> Conditioner<T, TAPS> {
    /// A filter that gives one output every `row_every` samples.
    pub fn new(kernel: Kernel<T, TAPS>, row_every: u16) -> Result<Self, KernelError> {
        if row_every == 0 {
            return Err(KernelError::Invalid);
        }
        let open = kernel.taps.div_ceil(usize::from(row_every));
        if open > OPEN_WINDOWS {
            return Err(KernelError::TooManyWindows(open as u32));
        }
        let closed = Window { tap: kernel.taps, sums: [T::ZERO; SIGNALS] };
        Ok(Self { kernel, row_every, until_next: 0, windows: [closed; OPEN_WINDOWS] })
    }

    /// The kernel in use.
    pub fn kernel(&self) -> &Kernel<T, TAPS> {
        &self.kernel
    }

    /// Forgets every open window: the next sample is the first of a new stretch.
    pub fn reset(&mut self) {
        self.until_next = 0;
        for window in &mut self.windows {
            window.tap = self.kernel.taps;
        }
    }

    /// Adds one sample's signals. The filtered signals (the last three now ω̇, rad/s²) whenever a window
    /// is complete; their instant is that of the window's middle sample.
    #[inline]
    pub fn push(&mut self, signals: &[T; SIGNALS]) -> Option<[T; SIGNALS]> {
        let taps = self.kernel.taps;
        let mut open = self.until_next == 0;
        self.until_next = if open { self.row_every - 1 } else { self.until_next - 1 };
        let mut complete = None;
        for window in &mut self.windows {
            if window.tap >= taps {
                if !open {
                    continue;
                }
                open = false;
                *window = Window { tap: 0, sums: [T::ZERO; SIGNALS] };
            }
            if let (Some(&h), Some(&d)) =
                (self.kernel.smooth.get(window.tap), self.kernel.derivative.get(window.tap))
            {
                let (smoothed, rates) = window.sums.split_at_mut(SMOOTHED);
                let (values, rate_values) = signals.split_at(SMOOTHED);
                for (sum, value) in smoothed.iter_mut().zip(values) {
                    *sum += h * *value;
                }
                for (sum, value) in rates.iter_mut().zip(rate_values) {
                    *sum += d * *value;
                }
            }
            window.tap += 1;
            if window.tap >= taps {
                complete = Some(window.sums);
            }
        }
        complete
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(t: f64) -> [f64; SIGNALS] {
        core::array::from_fn(|c| 3.0 + 0.5 * t * (c as f64 + 1.0))
    }

    #[test]
    fn a_straight_line_passes_unchanged_and_its_slope_is_exact() {
        let kernel = Kernel::<f64, 256>::new(1000.0, 0.1).unwrap();
        assert_eq!(kernel.taps(), 99);
        let mut filter = Conditioner::new(kernel, 10).unwrap();
        let mut outputs = 0;
        for n in 0..1000 {
            if let Some(y) = filter.push(&ramp(n as f64 * 1e-3)) {
                let middle = (n as f64 - 49.0) * 1e-3;
                for c in 0..SMOOTHED {
                    assert!((y[c] - ramp(middle)[c]).abs() < 1e-12);
                }
                for c in SMOOTHED..SIGNALS {
                    assert!((y[c] - 0.5 * (c as f64 + 1.0)).abs() < 1e-10);
                }
                outputs += 1;
            }
        }
        // The first window is complete at sample 98, then one every ten samples.
        assert_eq!(outputs, (999 - 98) / 10 + 1);
    }

    #[test]
    fn polyphase_equals_the_convolution_written_out() {
        let kernel = Kernel::<f64, 64>::new(250.0, 0.08).unwrap();
        let x = |n: usize, c: usize| ((n * 37 + c * 11) % 101) as f64 / 50.0 - 1.0;
        let mut filter = Conditioner::new(kernel, 3).unwrap();
        let mut first = 0;
        for n in 0..300 {
            if let Some(y) = filter.push(&core::array::from_fn(|c| x(n, c))) {
                for c in 0..SIGNALS {
                    let table = if c < SMOOTHED { &kernel.smooth } else { &kernel.derivative };
                    let direct: f64 = (0..kernel.taps()).map(|i| table[i] * x(first + i, c)).sum();
                    assert_eq!(y[c], direct);
                }
                first += 3;
            }
        }
        assert!(first > 250);
    }

    #[test]
    fn derivative_of_a_sinusoid_is_exact_to_the_aliasing_bound() {
        // h ∗ ω̇ against ḣ ∗ ω for 1 Hz at 200 Hz and 0.1 s.
        let kernel = Kernel::<f64, 64>::new(200.0, 0.1).unwrap();
        let w = core::f64::consts::TAU;
        let (mut smoothed_derivative, mut derived) = (0.0, 0.0);
        for i in 0..kernel.taps() {
            let t = i as f64 / 200.0 + 0.123;
            smoothed_derivative += kernel.smooth[i] * w * (w * t).cos();
            derived += kernel.derivative[i] * (w * t).sin();
        }
        assert!((derived / smoothed_derivative - 1.0).abs() < 2e-9);
    }

    #[test]
    fn widths_that_do_not_fit_are_named() {
        assert_eq!(Kernel::<f32, 32>::new(1000.0, 0.1).unwrap_err(), KernelError::TooManyTaps(99));
        assert_eq!(Kernel::<f32, 32>::new(f32::NAN, 0.1).unwrap_err(), KernelError::Invalid);
        let kernel = Kernel::<f32, 128>::new(1000.0, 0.1).unwrap();
        assert_eq!(Conditioner::new(kernel, 1).unwrap_err(), KernelError::TooManyWindows(99));
    }
}
