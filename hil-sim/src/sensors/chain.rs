//! A sensor at work: truth in, reading out, sample after sample.
//!
//! Order: single pole, gain, offset or bias with drift and knocks, noise, range, faults of the channel.
//! Rounding is the last step and left to the caller, because simulated registers round by themselves.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{
    Channel, Experiment, Fault, ImuModel, LoadCellModel, STREAM_IMU, STREAM_LOAD_CELL, STREAM_SECOND_IMU,
    SensorModels, stream,
};

/// A single pole, exact for inputs that are straight lines between samples.
#[derive(Clone, Debug)]
struct Pole<const N: usize> {
    time_constant_s: f64,
    last: Option<(f64, [f64; N], [f64; N])>,
}

impl<const N: usize> Pole<N> {
    fn new(bandwidth_hz: Option<f64>) -> Option<Self> {
        bandwidth_hz.map(|f| Self { time_constant_s: 1.0 / (std::f64::consts::TAU * f), last: None })
    }

    /// Filters by `y = a y₋ + (1 − r) u + (r − a) u₋` with `a = e^(−T/τ)`, `r = (1 − a) τ/T`. Starts settled.
    fn filter(&mut self, time_s: f64, input: [f64; N]) -> [f64; N] {
        let mut output = input;
        if let Some((then_s, before, held)) = &self.last {
            let ratio = (time_s - then_s) / self.time_constant_s;
            let a = (-ratio).exp();
            let r = (1.0 - a) / ratio;
            for (i, y) in output.iter_mut().enumerate() {
                *y = a * held[i] + (1.0 - r) * input[i] + (r - a) * before[i];
            }
        }
        self.last = Some((time_s, input, output));
        output
    }
}

/// Holds readings of frozen channels.
#[derive(Clone, Debug)]
struct Freezer<const N: usize> {
    held: [Option<f64>; N],
}

impl<const N: usize> Freezer<N> {
    fn apply(
        &mut self,
        faults: &[Fault],
        channel: impl Fn(usize) -> Channel,
        time_s: f64,
        range: &[f64; N],
        reading: &mut [f64; N],
    ) {
        for (i, ((value, held), range)) in reading.iter_mut().zip(&mut self.held).zip(range).enumerate() {
            if faults.iter().any(|f| f.saturates(channel(i), time_s)) {
                *value = *range;
            }
            *held = faults.iter().any(|f| f.freezes(channel(i), time_s)).then(|| held.unwrap_or(*value));
            *value = held.unwrap_or(*value);
        }
    }
}

fn add_noise<const N: usize>(rng: &mut ChaCha8Rng, sigma: &[f64; N], values: &mut [f64; N]) {
    for (v, s) in values.iter_mut().zip(sigma) {
        let n: f64 = StandardNormal.sample(rng);
        *v += s * n;
    }
}

/// The load cell of one experiment.
#[derive(Clone, Debug)]
pub struct LoadCellChain {
    model: LoadCellModel,
    faults: Vec<Fault>,
    offset: [f64; 6],
    gain: [f64; 6],
    pole: Option<Pole<6>>,
    freezer: Freezer<6>,
    rng: Option<ChaCha8Rng>,
}

impl LoadCellChain {
    /// Returns the load cell of the experiment that `seed` draws.
    pub fn new(models: &SensorModels, experiment: &Experiment, seed: u64) -> Self {
        let model = models.load_cell.clone();
        let noisy = model.noise_n_nm.iter().any(|s| *s != 0.0);
        Self {
            faults: models.faults.clone(),
            offset: experiment.load_cell_offset_n_nm,
            gain: experiment.load_cell_gain_error.map(|e| 1.0 + e),
            pole: Pole::new(model.bandwidth_hz),
            freezer: Freezer { held: [None; 6] },
            rng: noisy.then(|| stream(seed, STREAM_LOAD_CELL)),
            model,
        }
    }

    /// Adds a fault.
    pub fn add_fault(&mut self, fault: Fault) {
        self.faults.push(fault);
    }

    /// Returns the gauges' excitation at a time, as a ratio to the one of the calibration.
    pub fn excitation(&self, time_s: f64) -> f64 {
        self.faults.iter().filter_map(|f| f.excitation(time_s)).product()
    }

    /// Returns the voltage at the converter's input at `time_s` when the wrench is `truth`; N, N m. Call in
    /// time order.
    pub fn read(&mut self, time_s: f64, truth: [f64; 6]) -> [f64; 6] {
        let mut w = match &mut self.pole {
            Some(pole) => pole.filter(time_s, truth),
            None => truth,
        };
        for ((w, g), o) in w.iter_mut().zip(&self.gain).zip(&self.offset) {
            *w = *w * g + o;
        }
        for added in self.faults.iter().filter_map(|f| f.added_wrench(time_s)) {
            for (w, a) in w.iter_mut().zip(added) {
                *w += a;
            }
        }
        if let Some(rng) = &mut self.rng {
            add_noise(rng, &self.model.noise_n_nm, &mut w);
        }
        for (w, range) in w.iter_mut().zip(&self.model.range_n_nm) {
            *w = w.clamp(-range, *range);
        }
        if !self.faults.is_empty() {
            self.freezer.apply(&self.faults, Channel::Wrench, time_s, &self.model.range_n_nm, &mut w);
        }
        w
    }
}

/// The IMU of one experiment.
#[derive(Clone, Debug)]
pub struct ImuChain {
    model: ImuModel,
    faults: Vec<Fault>,
    experiment: Experiment,
    pole: Option<Pole<6>>,
    accel_freezer: Freezer<3>,
    gyro_freezer: Freezer<3>,
    rng: Option<ChaCha8Rng>,
}

impl ImuChain {
    /// Returns the IMU of the experiment that `seed` draws.
    pub fn new(models: &SensorModels, experiment: &Experiment, seed: u64) -> Self {
        Self::with_stream(models, experiment, seed, STREAM_IMU)
    }

    /// Returns another IMU of the same model: its biases and its noise are its own.
    pub fn second(models: &SensorModels, seed: u64) -> Self {
        let chain = Self::with_stream(models, &models.draw_second(seed), seed, STREAM_SECOND_IMU);
        // Faults are the first one's.
        Self { faults: Vec::new(), ..chain }
    }

    fn with_stream(models: &SensorModels, experiment: &Experiment, seed: u64, noise: u64) -> Self {
        let model = models.imu.clone();
        let noisy = model.accel_noise_mps2.iter().chain(&model.gyro_noise_radps).any(|s| *s != 0.0);
        Self {
            faults: models.faults.clone(),
            experiment: *experiment,
            pole: Pole::new(model.bandwidth_hz),
            accel_freezer: Freezer { held: [None; 3] },
            gyro_freezer: Freezer { held: [None; 3] },
            rng: noisy.then(|| stream(seed, noise)),
            model,
        }
    }

    /// Adds a fault.
    pub fn add_fault(&mut self, fault: Fault) {
        self.faults.push(fault);
    }

    /// Returns what the IMU's own converters see at `time_s`: specific force m/s² and angular rate rad/s
    /// along its axes, made of the true ones. Call in time order.
    pub fn read(&mut self, time_s: f64, accel: [f64; 3], gyro: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let (mut a, mut g) = (accel, gyro);
        if let Some(pole) = &mut self.pole {
            let ([a0, a1, a2], [g0, g1, g2]) = (a, g);
            let [a0, a1, a2, g0, g1, g2] = pole.filter(time_s, [a0, a1, a2, g0, g1, g2]);
            (a, g) = ([a0, a1, a2], [g0, g1, g2]);
        }
        let e = &self.experiment;
        for i in 0..3 {
            a[i] = a[i] * (1.0 + e.accel_gain_error[i]) + e.accel_bias_mps2[i];
            g[i] = g[i] * (1.0 + e.gyro_gain_error[i]) + e.gyro_bias_radps[i];
        }
        if let Some(rng) = &mut self.rng {
            add_noise(rng, &self.model.accel_noise_mps2, &mut a);
            add_noise(rng, &self.model.gyro_noise_radps, &mut g);
        }
        let (a_max, g_max) = (self.model.accel_range_mps2, self.model.gyro_range_radps);
        a = a.map(|v| v.clamp(-a_max, a_max));
        g = g.map(|v| v.clamp(-g_max, g_max));
        if !self.faults.is_empty() {
            self.accel_freezer.apply(&self.faults, Channel::Accelerometer, time_s, &[a_max; 3], &mut a);
            self.gyro_freezer.apply(&self.faults, Channel::Gyro, time_s, &[g_max; 3], &mut g);
        }
        (a, g)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::PerExperiment;

    fn chain(models: &SensorModels, seed: u64) -> LoadCellChain {
        LoadCellChain::new(models, &models.draw(seed), seed)
    }

    #[test]
    fn noise_has_the_stated_spread_and_no_mean() {
        let mut models = SensorModels::thesis();
        models.load_cell.offset_n_nm = PerExperiment::ZERO;
        let mut cell = chain(&models, 3);
        let n = 40_000;
        let (mut sum, mut square) = ([0.0; 6], [0.0; 6]);
        for k in 0..n {
            for (i, w) in cell.read(k as f64 * 1e-3, [0.0; 6]).into_iter().enumerate() {
                sum[i] += w;
                square[i] += w * w;
            }
        }
        for i in 0..6 {
            let sigma = models.load_cell.noise_n_nm[i];
            // Standard errors σ/√n and σ/√(2n); five of them.
            assert!((sum[i] / n as f64).abs() < 5.0 * sigma / (n as f64).sqrt());
            let spread = (square[i] / n as f64).sqrt();
            assert!((spread / sigma - 1.0).abs() < 5.0 / (2.0 * n as f64).sqrt(), "{spread} {sigma}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bits() {
        let models = SensorModels::thesis();
        let run = |seed| {
            let mut c = chain(&models, seed);
            (0..100).map(|k| c.read(k as f64 * 1e-3, [1.0; 6])).collect::<Vec<_>>()
        };
        assert_eq!(run(5), run(5));
        assert_ne!(run(5), run(6));
    }

    #[test]
    fn a_pole_lags_a_ramp_by_its_time_constant() {
        // Steady state of 1/(τs + 1) driven by a ramp is the ramp τ later, exactly.
        let mut models = SensorModels::ideal();
        models.load_cell.bandwidth_hz = Some(50.0);
        let mut cell = chain(&models, 0);
        let tau = models.load_cell.stated_delay_s();
        let mut last = 0.0;
        for k in 0..1000 {
            let t = k as f64 * 1e-3;
            last = cell.read(t, [t; 6])[0];
        }
        assert!((last - (0.999 - tau)).abs() < 1e-12, "{last}");
    }

    #[test]
    fn channels_clip_freeze_saturate_drift_and_are_knocked_as_configured() {
        let mut models = SensorModels::ideal();
        models.faults = vec![
            Fault::Frozen { channel: Channel::Wrench(0), during: 1.0..2.0 },
            Fault::Saturated { channel: Channel::Wrench(1), during: 1.0..2.0 },
            Fault::Drift { rate_n_nm_per_s: [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], during: 1.0..2.0 },
            Fault::Knock { during: 1.0..2.0, peak_n_nm: [0.0, 0.0, 0.0, 5.0, 0.0, 0.0] },
        ];
        let mut cell = chain(&models, 0);
        let reading: Vec<_> = [0.5, 1.0, 1.5, 2.5]
            .into_iter()
            .map(|t| cell.read(t, [10.0 * t, 1.0, 0.0, 0.0, 1e6, 0.0]))
            .collect();
        assert_eq!(reading.iter().map(|r| r[0]).collect::<Vec<_>>(), [5.0, 10.0, 10.0, 25.0]);
        assert_eq!(reading.iter().map(|r| r[1]).collect::<Vec<_>>(), [1.0, 660.0, 660.0, 1.0]);
        assert_eq!(reading.iter().map(|r| r[2]).collect::<Vec<_>>(), [0.0, 0.0, 1.0, 2.0]);
        assert!((reading[2][3] - 5.0).abs() < 1e-12 && reading[3][3] == 0.0);
        assert!(reading.iter().all(|r| r[4] == 60.0));
    }

    #[test]
    fn a_frozen_imu_repeats_itself_bit_for_bit_under_noise() {
        let mut models = SensorModels::thesis();
        models.faults = vec![Fault::Frozen { channel: Channel::Imu, during: 0.01..f64::INFINITY }];
        let mut imu = ImuChain::new(&models, &models.draw(1), 1);
        let readings: Vec<_> =
            (0..30).map(|k| imu.read(k as f64 * 1e-3, [0.0, 0.0, 9.8], [0.1; 3])).collect();
        assert_ne!(readings[8], readings[9]);
        assert!(readings[10..].iter().all(|r| *r == readings[10]));
    }
}
