//! The effect of the sensors on the truth, before any register.
//!
//! Lives here: noise, bias, gain, resolution, range, bandwidth, delay and faults of the load cell and the
//! IMU. May not live here: registers and buses. Before this: [`hexapod`]; next: [`crate::devices`].
//!
//! Everything random comes from one seed through separate streams (per-experiment values, load-cell noise,
//! IMU noise), so that the same seed gives the same bits and one sensor's noise does not depend on the
//! other's rate.

mod chain;
mod faults;

pub use chain::{ImuChain, LoadCellChain};
pub use faults::{Channel, Fault};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use hexapod::{
    THESIS_ACCEL_RANGE_MPS2, THESIS_GYRO_RANGE_RADPS, THESIS_WRENCH_NOISE_N_NM, THESIS_WRENCH_RANGE_N_NM,
};

/// A quantity that is constant over one experiment: `fixed + spread · n`, with `n` standard normal, drawn
/// from the seed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerExperiment<const N: usize> {
    /// The part that is the same in every experiment.
    pub fixed: [f64; N],
    /// 1 σ of the part that is drawn.
    pub spread: [f64; N],
}

impl<const N: usize> PerExperiment<N> {
    /// Always zero.
    pub const ZERO: Self = Self { fixed: [0.0; N], spread: [0.0; N] };

    /// Returns fixed values.
    pub const fn fixed(values: [f64; N]) -> Self {
        Self { fixed: values, spread: [0.0; N] }
    }

    /// Returns values drawn with these standard deviations around zero.
    pub const fn spread(sigma: [f64; N]) -> Self {
        Self { fixed: [0.0; N], spread: sigma }
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> [f64; N] {
        let mut out = self.fixed;
        for (o, s) in out.iter_mut().zip(&self.spread) {
            let n: f64 = StandardNormal.sample(rng);
            *o += s * n;
        }
        out
    }
}

/// The six-axis load cell and its amplifiers. Arrays are `[Fx, Fy, Fz, Mx, My, Mz]`, N and N m.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadCellModel {
    /// White noise per sample, 1 σ.
    pub noise_n_nm: [f64; 6],
    /// Offset of the experiment.
    pub offset_n_nm: PerExperiment<6>,
    /// Relative gain error of the experiment.
    pub gain_error: PerExperiment<6>,
    /// Step of a digitiser of its own, 0 for none. Used for float readings; where the converter's words are
    /// simulated, they are the quantisation.
    pub resolution_n_nm: [f64; 6],
    /// Readings beyond ± this are clipped.
    pub range_n_nm: [f64; 6],
    /// Corner of a single pole, if it has one.
    pub bandwidth_hz: Option<f64>,
    /// Pure delay in front of the converter that the rig file states, s.
    pub delay_s: f64,
    /// Further delay that nobody knows of, s.
    pub undeclared_delay_s: f64,
}

/// The six-axis IMU. Arrays are along the IMU's own axes.
#[derive(Clone, Debug, PartialEq)]
pub struct ImuModel {
    /// White accelerometer noise per sample, 1 σ, m/s².
    pub accel_noise_mps2: [f64; 3],
    /// White gyro noise per sample, 1 σ, rad/s.
    pub gyro_noise_radps: [f64; 3],
    /// Accelerometer bias of the experiment, added to the reading, m/s².
    pub accel_bias_mps2: PerExperiment<3>,
    /// Gyro bias of the experiment, added to the reading, rad/s.
    pub gyro_bias_radps: PerExperiment<3>,
    /// Relative gain error of the accelerometer.
    pub accel_gain_error: PerExperiment<3>,
    /// Relative gain error of the gyro.
    pub gyro_gain_error: PerExperiment<3>,
    /// Step of the float readings, 0 for none, m/s².
    pub accel_resolution_mps2: f64,
    /// Step of the float readings, 0 for none, rad/s.
    pub gyro_resolution_radps: f64,
    /// Readings beyond ± this are clipped, m/s².
    pub accel_range_mps2: f64,
    /// Readings beyond ± this are clipped, rad/s.
    pub gyro_range_radps: f64,
    /// Corner of a single pole, if it has one.
    pub bandwidth_hz: Option<f64>,
    /// Pure delay that the rig file states, s.
    pub delay_s: f64,
    /// Further delay that nobody knows of, s.
    pub undeclared_delay_s: f64,
}

/// Both sensors and what is wrong with them.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorModels {
    /// The load cell.
    pub load_cell: LoadCellModel,
    /// The IMU.
    pub imu: ImuModel,
    /// Faults, all of which act.
    pub faults: Vec<Fault>,
}

/// Returns the low-frequency delay of an optional single pole, s.
fn pole_delay_s(bandwidth_hz: Option<f64>) -> f64 {
    bandwidth_hz.map_or(0.0, |f| 1.0 / (std::f64::consts::TAU * f))
}

impl LoadCellModel {
    /// Returns the group delay a data sheet would state: pure delay plus that of the pole, s.
    pub fn stated_delay_s(&self) -> f64 {
        self.delay_s + pole_delay_s(self.bandwidth_hz)
    }

    /// Rounds to the digitiser's steps.
    pub fn digitise(&self, wrench: [f64; 6]) -> [f64; 6] {
        let mut out = wrench;
        for (w, step) in out.iter_mut().zip(self.resolution_n_nm) {
            *w = round_to(*w, step);
        }
        out
    }
}

impl ImuModel {
    /// Returns the group delay a data sheet would state: pure delay plus that of the pole, s.
    pub fn stated_delay_s(&self) -> f64 {
        self.delay_s + pole_delay_s(self.bandwidth_hz)
    }

    /// Rounds to the steps of the float readings: specific force, angular rate.
    pub fn digitise(&self, accel: [f64; 3], gyro: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        (
            accel.map(|a| round_to(a, self.accel_resolution_mps2)),
            gyro.map(|g| round_to(g, self.gyro_resolution_radps)),
        )
    }
}

fn round_to(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

/// The values that one experiment drew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Experiment {
    /// Load-cell offset, N, N m.
    pub load_cell_offset_n_nm: [f64; 6],
    /// Load-cell relative gain error.
    pub load_cell_gain_error: [f64; 6],
    /// Accelerometer bias, IMU axes, m/s².
    pub accel_bias_mps2: [f64; 3],
    /// Gyro bias, IMU axes, rad/s.
    pub gyro_bias_radps: [f64; 3],
    /// Accelerometer relative gain error.
    pub accel_gain_error: [f64; 3],
    /// Gyro relative gain error.
    pub gyro_gain_error: [f64; 3],
}

/// Streams of the seed.
pub(crate) const STREAM_EXPERIMENT: u64 = 0;
pub(crate) const STREAM_LOAD_CELL: u64 = 1;
pub(crate) const STREAM_IMU: u64 = 2;
pub(crate) const STREAM_SECOND_EXPERIMENT: u64 = 3;
pub(crate) const STREAM_SECOND_IMU: u64 = 4;

pub(crate) fn stream(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

impl SensorModels {
    /// Defaults of the platform thesis, Tables 1 and 2 (95 % figures / 1.96), gyro range ±1.309 rad/s.
    ///
    /// Not printed there and assumed: accelerometer noise 0.02 m/s² and range 16 g; per-experiment offsets
    /// and biases as large as one sample's noise; a delay of 0.6 ms in the IMU's filters; no bandwidth limit.
    pub fn thesis() -> Self {
        let noise = THESIS_WRENCH_NOISE_N_NM;
        let gyro = [8.4e-4 / 1.96, 7.2e-4 / 1.96, 3.7e-3 / 1.96];
        let moment_step = 10.0 / 1333.0;
        Self {
            load_cell: LoadCellModel {
                noise_n_nm: noise,
                offset_n_nm: PerExperiment::spread(noise),
                gain_error: PerExperiment::ZERO,
                resolution_n_nm: [0.125, 0.125, 0.25, moment_step, moment_step, moment_step],
                range_n_nm: THESIS_WRENCH_RANGE_N_NM,
                bandwidth_hz: None,
                delay_s: 0.0,
                undeclared_delay_s: 0.0,
            },
            imu: ImuModel {
                accel_noise_mps2: [0.02; 3],
                gyro_noise_radps: gyro,
                accel_bias_mps2: PerExperiment::spread([0.02; 3]),
                gyro_bias_radps: PerExperiment::spread(gyro),
                accel_gain_error: PerExperiment::ZERO,
                gyro_gain_error: PerExperiment::ZERO,
                accel_resolution_mps2: 0.0,
                gyro_resolution_radps: 0.0,
                accel_range_mps2: THESIS_ACCEL_RANGE_MPS2,
                gyro_range_radps: THESIS_GYRO_RANGE_RADPS,
                bandwidth_hz: None,
                delay_s: 0.6e-3,
                undeclared_delay_s: 0.0,
            },
            faults: Vec::new(),
        }
    }

    /// Returns the thesis' sensors without noise, bias, gain error, steps, bandwidth, delay and faults. Their
    /// ranges stay, and so do the words of the converters where registers are simulated.
    pub fn ideal() -> Self {
        let mut s = Self::thesis();
        s.load_cell = LoadCellModel {
            noise_n_nm: [0.0; 6],
            offset_n_nm: PerExperiment::ZERO,
            resolution_n_nm: [0.0; 6],
            ..s.load_cell
        };
        s.imu = ImuModel {
            accel_noise_mps2: [0.0; 3],
            gyro_noise_radps: [0.0; 3],
            accel_bias_mps2: PerExperiment::ZERO,
            gyro_bias_radps: PerExperiment::ZERO,
            delay_s: 0.0,
            ..s.imu
        };
        s
    }

    /// Returns what one experiment with this seed draws.
    pub fn draw(&self, seed: u64) -> Experiment {
        self.draw_from(&mut stream(seed, STREAM_EXPERIMENT))
    }

    /// Returns what it draws for a second IMU; the load cell's are not used.
    fn draw_second(&self, seed: u64) -> Experiment {
        self.draw_from(&mut stream(seed, STREAM_SECOND_EXPERIMENT))
    }

    fn draw_from(&self, rng: &mut ChaCha8Rng) -> Experiment {
        Experiment {
            load_cell_offset_n_nm: self.load_cell.offset_n_nm.draw(rng),
            load_cell_gain_error: self.load_cell.gain_error.draw(rng),
            accel_bias_mps2: self.imu.accel_bias_mps2.draw(rng),
            gyro_bias_radps: self.imu.gyro_bias_radps.draw(rng),
            accel_gain_error: self.imu.accel_gain_error.draw(rng),
            gyro_gain_error: self.imu.gyro_gain_error.draw(rng),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_the_printed_figures_over_1_96() {
        let s = SensorModels::thesis();
        for (got, want) in s.load_cell.noise_n_nm.iter().zip([5.05, 5.05, 10.1, 0.383, 0.459, 0.459]) {
            assert!((got - want).abs() < 0.001 * want, "{got} {want}");
        }
        for (got, want) in s.imu.gyro_noise_radps.iter().zip([4.3e-4, 3.7e-4, 1.9e-3]) {
            assert!((got - want).abs() < 0.01 * want, "{got} {want}");
        }
    }

    #[test]
    fn the_same_seed_draws_the_same_experiment_and_another_seed_another() {
        let s = SensorModels::thesis();
        assert_eq!(s.draw(7), s.draw(7));
        assert_ne!(s.draw(7), s.draw(8));
        let ideal = SensorModels::ideal().draw(7);
        assert_eq!(ideal.load_cell_offset_n_nm, [0.0; 6]);
        assert_eq!((ideal.accel_bias_mps2, ideal.gyro_bias_radps), ([0.0; 3], [0.0; 3]));
    }
}
