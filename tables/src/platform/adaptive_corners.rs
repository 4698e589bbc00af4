//! Adaptive experiments from zero on rigs that are not the nominal one.

use std::sync::atomic::{AtomicUsize, Ordering};

use hexapod::BodyParameters;
use rigident::plan::adaptive::Asked;
use rigident::plan::adaptive::rehearsal::{Outcome, Rehearsal};
use rigident::plan::carried::LoadBound;
use rigident_sim::rig::RigConfig;

const ASKED: Asked = Asked::Tensor(0.01);
const RATE_HZ: f64 = 200.0;
const SEEDS: u64 = 5;
/// No further segment begins then, s.
const LONGEST_S: f64 = 60.0;
const MASSES_KG: [f64; 5] = [0.5, 5.0, 20.0, 60.0, 120.0];
const CENTRES_M: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, 0.3], [0.18, -0.18, 0.16]];
const LIMITS: [f64; 3] = [0.3, 1.0, 3.0];
const NOISES: [f64; 4] = [0.3, 1.0, 3.0, 10.0];
/// The load of a leg of the nominal machine, N, and its acceleration, m/s²: not printed, assumed.
const LEG_FORCE_N: f64 = 600.0;
const LEG_ACCELERATION_MPS2: f64 = 8.0;

/// One rig.
#[derive(Clone, Copy)]
struct Corner {
    mass_kg: f64,
    com_m: [f64; 3],
    limits: f64,
    noise: f64,
    seed: u64,
}

impl Corner {
    fn rehearsal(&self) -> Rehearsal {
        let mut config = RigConfig::thesis_horizontal();
        // A block whose radius of gyration grows with the cube root of its mass, 0.1 m at 20 kg.
        // Its owner says that it is at most half as heavy again, and a tenth larger.
        let square = 0.01 * (self.mass_kg / 20.0).powf(2.0 / 3.0);
        let moments = [1.0, 0.8, 0.5].map(|share| share * self.mass_kg * square);
        config.body = BodyParameters {
            mass_kg: self.mass_kg,
            com_m: self.com_m,
            inertia_com_kgm2: [moments[0], moments[1], moments[2], 0.0, 0.0, 0.0],
        };
        let geometry = &mut config.geometry;
        geometry.leg_rate_mps *= self.limits;
        geometry.limits.leg_acceleration_mps2 = Some(self.limits * LEG_ACCELERATION_MPS2);
        geometry.limits.leg_force_n = Some(self.limits * LEG_FORCE_N);
        let sensors = &mut config.sensors;
        let noises = sensors.load_cell.noise_n_nm.iter_mut();
        noises
            .chain(&mut sensors.imu.accel_noise_mps2)
            .chain(&mut sensors.imu.gyro_noise_radps)
            .for_each(|s| *s *= self.noise);
        sensors.load_cell.offset_n_nm.spread.iter_mut().for_each(|s| *s *= self.noise);
        sensors.load_cell.range_n_nm.iter_mut().for_each(|r| *r *= self.limits);
        sensors.imu.gyro_range_radps *= self.limits;
        let rehearsal = Rehearsal::as_believed(config, RATE_HZ).expect("a rig");
        let half_diagonal_m = (3.0 * 1.15 * square).sqrt();
        let away_m = self.com_m.iter().map(|v| v * v).sum::<f64>().sqrt();
        let bound = LoadBound { mass_kg: 1.5 * self.mass_kg, within_m: 1.1 * (away_m + half_diagonal_m) };
        Rehearsal { bound, ..rehearsal }
    }
}

fn corners() -> Vec<Corner> {
    let mut all = Vec::new();
    for limits in LIMITS {
        for noise in NOISES {
            for mass_kg in MASSES_KG {
                for com_m in CENTRES_M {
                    all.extend((1..=SEEDS).map(|seed| Corner { mass_kg, com_m, limits, noise, seed }));
                }
            }
        }
    }
    all
}

/// Returns the table of limits and noise, and how the experiments ended.
pub fn table() -> String {
    let corners = corners();
    let outcomes = run(&corners);
    let mut text = String::from(
        "| limits, of nominal | noise, of the thesis' | experiments | 1 % reached | median, s | what can be \
         reached was said | off by, at most | ended in words before it was known | largest share of a limit \
         | largest error over U95 asked for | longest decision, s |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for limits in LIMITS {
        for noise in NOISES {
            let of = |c: &&(Corner, Outcome)| c.0.limits == limits && c.0.noise == noise;
            text += &row(limits, noise, &outcomes.iter().filter(of).map(|(_, o)| o).collect::<Vec<_>>());
        }
    }
    text
}

fn row(limits: f64, noise: f64, outcomes: &[&Outcome]) -> String {
    let mut seconds: Vec<f64> = outcomes.iter().filter_map(|o| o.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let median = seconds.get(seconds.len() / 2).map_or("–".to_owned(), |s| format!("{s:.1}"));
    let unmet: Vec<&&Outcome> = outcomes.iter().filter(|o| o.seconds.is_none()).collect();
    let promised: Vec<f64> = unmet
        .iter()
        .filter(|o| o.promised.is_some())
        .map(|o| o.off.map_or(f64::INFINITY, f64::abs))
        .collect();
    let silent = unmet.iter().filter(|o| o.promised.is_none() && o.ended.is_none()).count();
    let largest = |of: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(|o| of(o)).fold(0.0, f64::max);
    let error = outcomes.iter().filter(|o| o.seconds.is_some()).map(|o| o.error / 0.01).fold(0.0, f64::max);
    format!(
        "| {limits} | {noise} | {} | {} | {median} | {} | {} | {}{} | {:.3} | {error:.2} | {:.1} |\n",
        outcomes.len(),
        seconds.len(),
        promised.len(),
        if promised.is_empty() {
            "–".to_owned()
        } else {
            format!("{:.0} %", 100.0 * promised.iter().copied().fold(0.0, f64::max))
        },
        unmet.len() - promised.len() - silent,
        if silent > 0 { format!(", {silent} silent") } else { String::new() },
        largest(&|o| o.taken),
        largest(&|o| o.decided_s),
    )
}

fn run(corners: &[Corner]) -> Vec<(Corner, Outcome)> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        while let Some(corner) = corners.get(next.fetch_add(1, Ordering::Relaxed)) {
            let outcome =
                corner.rehearsal().adaptive(&ASKED, corner.seed, LONGEST_S).expect("a rig that moves");
            eprintln!(
                "{} kg at {:?}, limits {}, noise {}, seed {}: {:?} s of {:.1}, worst {:.3}, promised {:?}, \
                 off {:?}, taken {:.3}, error {:.4}, {} segments, decisions up to {:.1} s{}",
                corner.mass_kg,
                corner.com_m,
                corner.limits,
                corner.noise,
                corner.seed,
                outcome.seconds,
                outcome.spent_s,
                outcome.worst,
                outcome.promised,
                outcome.off,
                outcome.taken,
                outcome.error,
                outcome.segments.len(),
                outcome.decided_s,
                outcome.ended.as_ref().map_or_else(String::new, |e| format!(": {e}"))
            );
            done.push((*corner, outcome));
        }
        done
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let running: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        running.into_iter().flat_map(|r| r.join().expect("rehearsals that end")).collect()
    })
}
