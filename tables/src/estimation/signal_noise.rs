//! Noise of the IMU's signals over three decades: efficiency against the bound that includes it, bias and coverage.

use std::sync::atomic::AtomicBool;

use hexapod::{Axis, BodyParameters, MotionProgram, Segment, SineTerm};
use rigident::montecarlo::{Campaign, Solver};
use rigident_sim::rig::RigConfig;

const RUNS: u64 = 500;
/// Parameters of the body, without the offsets.
const BODY: usize = 10;
/// A load cell for hand-held bodies, 1 σ a sample, N and N m.
const LOAD_CELL: [f64; 6] = [0.05, 0.05, 0.08, 0.002, 0.002, 0.0015];
/// Accelerometer and gyro, 1 σ a sample, m/s² and rad/s.
const IMU: [[f64; 2]; 5] = [[0.003, 0.0002], [0.03, 0.002], [0.1, 0.006], [0.3, 0.02], [0.01, 0.02]];

fn rig([accel, gyro]: [f64; 2]) -> RigConfig {
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

/// ±0.5 rad of roll, pitch and yaw at three frequencies each.
fn motion(config: &RigConfig, duration_s: f64, slow: bool) -> MotionProgram {
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

/// The table.
pub fn table() -> String {
    let mut text =
        "| motion | accelerometer, m/s² | gyro, rad/s | noise | estimated by | efficiency | largest bias, sd | coverage |\n\
                    |---|---|---|---|---|---|---|---|\n"
            .to_owned();
    for (slow, imu) in [false, true].into_iter().flat_map(|slow| IMU.map(|imu| (slow, imu))) {
        // What is left of the slow motion with the worst gyros is noise.
        if slow && imu[1] > 0.002 {
            continue;
        }
        for (tell_noise, solver) in [(true, Solver::Host), (false, Solver::Host), (true, Solver::Firmware)] {
            let config = rig(imu);
            let program = Some(motion(&config, 20.0, slow));
            let campaign = Campaign { program, tell_noise, solver, ..Campaign::new(config) };
            let prepared = campaign.prepare().expect("a motion that the legs reach");
            let verdict = prepared.run(RUNS, 1, &AtomicBool::new(false), |_| ()).expect("a factor each time");
            let body = &verdict.parameters[..BODY];
            let least = |of: &dyn Fn(usize) -> f64| (0..BODY).map(of).fold(f64::INFINITY, f64::min);
            let most = |of: &dyn Fn(usize) -> f64| (0..BODY).map(of).fold(0.0, f64::max);
            text += &format!(
                "| {} | {} | {} | {} | {} | {:.2}–{:.2} | {:.2} | {:.1}–{:.1} % |\n",
                if slow { "0.05–0.15 Hz" } else { "0.2–1.6 Hz" },
                imu[0],
                imu[1],
                if tell_noise { "stated" } else { "from the data" },
                if solver == Solver::Host { "host, f64" } else { "device, f32" },
                least(&|j| body[j].efficiency()),
                most(&|j| body[j].efficiency()),
                most(&|j| (body[j].bias / body[j].std).abs()),
                least(&|j| 100.0 * body[j].coverage95),
                most(&|j| 100.0 * body[j].coverage95),
            );
        }
    }
    text
}
