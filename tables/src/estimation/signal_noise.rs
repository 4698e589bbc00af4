//! Noise of the IMU's signals over three decades: efficiency against the bound that includes it, bias and
//! coverage.

use std::sync::atomic::AtomicBool;

use hexapod::{Axis, BodyParameters, MotionProgram, Segment, SineTerm};
use rigident::study::{Campaign, Solver};
use rigident_sim::rig::RigConfig;

/// Parameters of the body, without the offsets.
pub(super) const BODY: usize = 10;
/// A load cell for hand-held bodies, 1 σ a sample, N and N m.
const LOAD_CELL: [f64; 6] = [0.05, 0.05, 0.08, 0.002, 0.002, 0.0015];
/// Accelerometer and gyro, 1 σ a sample, m/s² and rad/s.
pub(super) const IMU: [[f64; 2]; 5] =
    [[0.003, 0.0002], [0.03, 0.002], [0.1, 0.006], [0.3, 0.02], [0.01, 0.02]];

pub(super) fn rig([accel, gyro]: [f64; 2]) -> RigConfig {
    let mut config = RigConfig::thesis_horizontal().with_body(BodyParameters {
        mass_kg: 3.2,
        com_m: [0.03, -0.02, 0.08],
        inertia_com_kgm2: [0.02, 0.025, 0.015, 0.0015, -0.001, 0.002],
    });
    config.geometry.leg_length_m = [0.1, 3.0];
    config.geometry.leg_rate_mps = 20.0;
    config.sensors.load_cell.noise_n_nm = LOAD_CELL;
    // The platform's own sensors are coarser, and at the end of their range.
    config.sensors.load_cell.resolution_n_nm = [0.0; 6];
    (config.sensors.imu.gyro_range_radps, config.sensors.imu.accel_range_mps2) = (35.0, 160.0);
    config.sensors.imu.accel_noise_mps2 = [accel; 3];
    config.sensors.imu.gyro_noise_radps = [gyro; 3];
    config
}

/// Returns ±0.5 rad of roll, pitch and yaw at three frequencies each.
pub(super) fn motion(config: &RigConfig, duration_s: f64, slow: bool) -> MotionProgram {
    let frequencies: [[f64; 3]; 3] = if slow {
        [[0.05, 0.1, 0.13], [0.06, 0.09, 0.15], [0.07, 0.11, 0.14]]
    } else {
        [[0.2, 0.7, 1.6], [0.3, 0.9, 1.4], [0.4, 0.8, 1.2]]
    };
    let terms = [Axis::Roll, Axis::Pitch, Axis::Yaw].into_iter().zip(frequencies).flat_map(|(axis, own)| {
        own.into_iter().zip([0.25, 0.15, 0.1]).enumerate().map(move |(k, (frequency_hz, amplitude))| {
            SineTerm { axis, amplitude, frequency_hz, phase_rad: k as f64 }
        })
    });
    let terms = terms.collect();
    MotionProgram {
        start: config.geometry.home(),
        segments: vec![Segment::Multisine { duration_s, ramp_s: 2.0, terms }],
    }
}

/// The estimate, the way of it, and the recordings.
struct Case {
    /// Sampling rate, Hz, and duration, s.
    sampled: (f64, f64),
    runs: u64,
    ways: &'static [(bool, Solver)],
}

impl Case {
    fn lines(&self) -> String {
        let mut text =
            "| motion | accelerometer, m/s² | gyro, rad/s | noise | estimated by | efficiency | largest \
                        bias, sd | coverage |\n\
                        |---|---|---|---|---|---|---|---|\n"
                .to_owned();
        for (slow, imu) in [false, true].into_iter().flat_map(|slow| IMU.map(|imu| (slow, imu))) {
            // What is left of the slow motion with the worst gyros is noise.
            if slow && imu[1] > 0.002 {
                continue;
            }
            for (state_noise, solver) in self.ways {
                text += &self.line(imu, slow, *state_noise, *solver);
            }
        }
        text
    }

    fn line(&self, imu: [f64; 2], slow: bool, state_noise: bool, solver: Solver) -> String {
        let config = rig(imu);
        let (rate_hz, duration_s) = self.sampled;
        let program = Some(motion(&config, duration_s, slow));
        let campaign = Campaign { program, rate_hz, state_noise, solver, ..Campaign::new(config) };
        let prepared = campaign.prepare().expect("a motion that the legs reach");
        let verdict =
            prepared.run(self.runs, 1, &AtomicBool::new(false), |_| ()).expect("a factor each time");
        let body = &verdict.parameters[..BODY];
        let least = |of: &dyn Fn(usize) -> f64| (0..BODY).map(of).fold(f64::INFINITY, f64::min);
        let most = |of: &dyn Fn(usize) -> f64| (0..BODY).map(of).fold(0.0, f64::max);
        format!(
            "| {} | {} | {} | {} | {} | {:.2}–{:.2} | {:.2} | {:.1}–{:.1} % |\n",
            if slow { "0.05–0.15 Hz" } else { "0.2–1.6 Hz" },
            imu[0],
            imu[1],
            if state_noise { "stated" } else { "from the data" },
            if solver == Solver::Host { "host, f64" } else { "device, f32" },
            least(&|j| body[j].efficiency()),
            most(&|j| body[j].efficiency()),
            most(&|j| (body[j].bias / body[j].std).abs()),
            least(&|j| 100.0 * body[j].coverage95),
            most(&|j| 100.0 * body[j].coverage95),
        )
    }
}

/// Returns the table of 20 s at 200 Hz.
pub fn table() -> String {
    let ways = &[(true, Solver::Host), (false, Solver::Host), (true, Solver::Firmware)];
    Case { sampled: (200.0, 20.0), runs: 500, ways }.lines()
}

/// Returns the table of 60 s at 1 kHz.
pub fn fast_table() -> String {
    Case { sampled: (1000.0, 60.0), runs: 200, ways: &[(true, Solver::Host)] }.lines()
}
