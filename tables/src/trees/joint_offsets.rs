//! The number of poses that are enough for the offsets of joints: errors and intervals over the number of
//! poses; and how often poses in which nothing is wrong are refused.
//!
//! The humanoid stands in random flat poses, or in symmetric squats; its encoders have noise of 0.05°, its
//! IMU of 0.2° (1 σ). Corners stand on the floor exactly, and their heights are said to be known to 0.1 mm.

use std::fmt::Write as _;

use rigident::fit::parallel::{map, threads};
use rigident::joint_offsets::faults::contradiction;
use rigident::joint_offsets::result::{Answer, COARSEST, identify};
use rigident::joint_offsets::search::Method;
use rigident::joint_offsets::{Noise, Pose, Setup};
use rigident::laboratory::standing::{Reading, random_offsets, random_poses, setup, squats};
use statrs::distribution::{Beta, ContinuousCDF as _};

/// Sets of poses of each kind and number.
const SETS: usize = 100;
/// Sets of poses of each kind that are examined for faults they do not have.
const HONEST_SETS: usize = 300;
/// Numbers of poses.
const POSES: [usize; 6] = [3, 6, 12, 24, 48, 96];
/// True offsets are within ± this, rad.
const OFFSETS_RAD: f64 = 0.035;

/// Makes the given number of poses of a humanoid with these offsets, rad, as they are read, by a seed.
type Poses = fn(usize, &[f64], Reading, u64) -> Vec<Pose>;

/// The result of a set of poses: errors and U95 of the identified offsets, rad.
struct Found {
    identified: Vec<[f64; 2]>,
    asked: usize,
}

/// Returns the true offsets, rad, and the poses of a set as they are read.
fn set_of(poses: Poses, count: usize, set: usize) -> (Vec<f64>, Vec<Pose>) {
    let seed = 1000 * count as u64 + set as u64 + 1;
    let truth = random_offsets(OFFSETS_RAD, seed);
    let reading = Reading { encoder_rad: 0.05_f64.to_radians(), attitude_rad: 0.2_f64.to_radians() };
    let all = poses(count, &truth, reading, 77 + seed);
    (truth, all)
}

/// Returns the stated noise, which is the true one.
fn stated_noise() -> Noise {
    Noise { height_m: 1e-4, floor_rad: 0.0, ..Noise::default() }
}

fn answered(setup: &Setup, poses: &[Pose]) -> Answer {
    identify(setup, poses, Method::GaussNewton, COARSEST).expect("poses that can be used")
}

/// Returns whether the command refuses a set in which nothing is wrong, or says that it did not settle.
fn refused(poses: Poses, count: usize, set: usize) -> bool {
    let (_, all) = set_of(poses, count, set);
    let setup = setup(stated_noise());
    let answer = answered(&setup, &all);
    !answer.converged || contradiction(&setup, &all, &answer).expect("poses that can be used").is_some()
}

/// Returns the table of sets that are refused though nothing is wrong.
pub fn refusals() -> String {
    let mut out =
        "| poses | number | refused | chance of it, at most (95 %) |\n|---|---|---|---|\n".to_owned();
    let kinds: [(&str, Poses, usize); 3] = [
        ("random, flat soles", random_poses, 6),
        ("random, flat soles", random_poses, 24),
        ("symmetric squats", squats, 24),
    ];
    for (name, poses, count) in kinds {
        let all = map(threads(), HONEST_SETS, |set| refused(poses, count, SETS + set));
        let refused = all.iter().filter(|refused| **refused).count();
        // Clopper and Pearson: the beta distribution's quantile.
        let most = if refused == HONEST_SETS {
            1.0
        } else {
            Beta::new(refused as f64 + 1.0, (HONEST_SETS - refused) as f64).expect("counts").inverse_cdf(0.95)
        };
        let _ = writeln!(out, "| {name} | {count} | {refused} of {HONEST_SETS} | {:.1} % |", 100.0 * most);
    }
    out
}

fn found(poses: Poses, count: usize, set: usize) -> Found {
    let (truth, all) = set_of(poses, count, set);
    let answer = answered(&setup(stated_noise()), &all);
    let both = answer.offsets.iter().zip(&truth).filter_map(|(offset, truth)| {
        let own = offset.measured?;
        Some([own.value - truth, own.u95])
    });
    Found { identified: both.collect(), asked: truth.len() }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Returns the table.
pub fn table() -> String {
    let mut out = "| poses | number | identified of 14, mean | error of these, RMS | U95, median | largest \
                   U95 of a set, median | coverage |\n\
                   |---|---|---|---|---|---|---|\n"
        .to_owned();
    let kinds: [(&str, Poses); 2] = [("random, flat soles", random_poses), ("symmetric squats", squats)];
    for (name, poses) in kinds {
        for count in POSES {
            let all = map(threads(), SETS, |set| found(poses, count, set));
            let pairs: Vec<[f64; 2]> = all.iter().flat_map(|own| own.identified.iter().copied()).collect();
            let asked: usize = all.iter().map(|own| own.asked).sum();
            let mean = pairs.len() as f64 / asked as f64 * 14.0;
            if pairs.is_empty() {
                let _ = writeln!(out, "| {name} | {count} | 0.0 | – | – | – | – |");
                continue;
            }
            let rms = (pairs.iter().map(|[error, _]| error * error).sum::<f64>() / pairs.len() as f64).sqrt();
            let u95 = median(pairs.iter().map(|[_, u95]| *u95).collect());
            let largest = |own: &Found| own.identified.iter().map(|[_, u95]| *u95).fold(0.0, f64::max);
            let worst = median(all.iter().filter(|own| !own.identified.is_empty()).map(largest).collect());
            let inside = pairs.iter().filter(|[error, u95]| error.abs() <= *u95).count();
            let _ = writeln!(
                out,
                "| {name} | {count} | {mean:.1} | {:.2}° | {:.2}° | {:.2}° | {:.1} % |",
                rms.to_degrees(),
                u95.to_degrees(),
                worst.to_degrees(),
                100.0 * inside as f64 / pairs.len() as f64
            );
        }
    }
    out
}
