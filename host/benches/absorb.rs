//! The speed at which the host absorbs: `cargo bench -p rigident --bench absorb`.
//!
//! Three figures. *Kernel*: row blocks (six scalar rows each) from filtered signals by the regressor into the
//! factor, no screening and no filter, on one core. *Pipeline*: readings of a simulated rig through all of
//! it, on one core. *Scaling*: the same on all cores, merged.

use std::hint::black_box;
use std::time::Instant;

use hexapod::experiment::thesis_program;
use rigident::rows::body::shares::{Shares, Split};
use rigident_shared::calibration::{ImuMounting, Reading};
use rigident_shared::estimator::{Estimator, EstimatorConfig};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};
use rigident_sim::rig::{Readings, RigConfig};

/// Rate of the readings, 1/s.
const RATE_HZ: f64 = 1000.0;
/// Each figure is the best of this many: what else runs on the machine only slows down.
const TRIES: usize = 5;
/// The estimate, the residuals, and the course of the estimate: a pass each.
const PASSES: usize = 3;

fn main() {
    let config = RigConfig::thesis_horizontal();
    let program = thesis_program(&config.geometry, 60.0);
    let readings: Vec<Reading<f64>> = match Readings::new(&config, &program, RATE_HZ) {
        Ok(rows) => rows
            .measured(1)
            .map(|row| Reading {
                time_ns: row.time_ns,
                wrench: Wrench::from_array(row.wrench),
                specific_force: SpecificForce::from_array(row.specific_force),
                angular_rate: AngularRate::from_array(row.angular_rate),
            })
            .collect(),
        Err(error) => return eprintln!("no readings: {error}"),
    };
    println!("kernel, one core, no filter, regressor included, f64:");
    for (name, rate) in [("N = 10", kernel::<10>(&readings)), ("N = 16", kernel::<16>(&readings))] {
        println!(
            "  {name}: {:6.2} million rows/s ({:.2} million readings/s)",
            6.0 * rate * 1e-6,
            rate * 1e-6
        );
    }
    println!("pipeline, {RATE_HZ} Hz, filter of 0.1 s, a row block every ten readings:");
    let long: Vec<Reading<f64>> = repeated(&readings, 16);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let one = pipeline::<16>(&long, Split { parts: 1, threads: 1 });
    println!("  one pass:              {:6.2} million readings/s", one * 1e-6);
    let parts = Split::of(long.len()).parts;
    for threads in [1, 2, 4, 8, 16, 32].into_iter().filter(|threads| *threads <= cores) {
        let rate = pipeline::<16>(&long, Split { parts, threads });
        println!(
            "  {parts} parts on {threads:2} threads: {:6.2} million readings/s, {:.2} times one pass",
            rate * 1e-6,
            rate / one
        );
    }
    println!("  ({cores} cores here; scouting the parts is in it, once for {PASSES} passes, as in identify)");
}

/// Readings per second of the best of several tries.
fn best(readings: usize, mut job: impl FnMut()) -> f64 {
    let seconds = (0..TRIES)
        .map(|_| {
            let started = Instant::now();
            job();
            started.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min);
    readings as f64 / seconds
}

fn settings(filter_width_s: f64, row_every: u16) -> EstimatorConfig<f64> {
    EstimatorConfig {
        rate_hz: RATE_HZ,
        filter_width_s,
        row_every,
        channel_sigma: [5.05, 5.05, 10.1, 0.383, 0.459, 0.459],
        known_offset: [0.0; 6],
        mounting: ImuMounting::default(),
        limits: Limits { frozen_after: 50, ..Limits::none() },
    }
}

/// A filter of one tap passes what it gets: screening, mounting, regressor, whitening, factor.
fn kernel<const N: usize>(readings: &[Reading<f64>]) -> f64 {
    let Ok(estimator) = Estimator::<f64, N, 1>::new(&settings(0.0, 1)) else { return f64::NAN };
    let mut estimator = Box::new(estimator);
    let rate = best(readings.len(), || {
        for reading in readings {
            estimator.absorb(black_box(reading));
        }
    });
    black_box(estimator.factor());
    rate
}

/// Readings per second and pass.
fn pipeline<const N: usize>(readings: &[Reading<f64>], split: Split) -> f64 {
    best(PASSES * readings.len(), || {
        let config = settings(0.1, 10);
        let Ok(shares) = Shares::new(readings, &config, split) else { return };
        for _ in 0..PASSES {
            let _ = black_box(shares.absorb::<N, ()>(config.channel_sigma, || (), |(), _, _| ()));
        }
    })
}

/// The same readings over and over, their time going on.
fn repeated(readings: &[Reading<f64>], times: u64) -> Vec<Reading<f64>> {
    let period = readings.last().map_or(0, |r| r.time_ns) + (1e9 / RATE_HZ) as u64;
    (0..times)
        .flat_map(|k| readings.iter().map(move |r| Reading { time_ns: r.time_ns + k * period, ..*r }))
        .collect()
}
