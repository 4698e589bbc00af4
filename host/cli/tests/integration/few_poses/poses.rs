//! Still poses of a body: gravity along its axes, and what a load cell reads of it. Nothing of it is the
//! estimator's.

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rigident::answer::derived::centre_of_mass;
use rigident::fit::{Fit, FitOptions, Silent};
use rigident::problem::{Problem, Subject};
use rigident::rig::RigFile;
use rigident::rows::body::{BodySource, prepare};
use rigident_shared::calibration::Reading;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

const G: f64 = 9.80665;
const MASS: f64 = 3.2;
const CENTRE: [f64; 3] = [0.02, -0.03, 0.06];
/// 1 σ of the noise of forces, N, and moments, N m: nobody states it.
const NOISE: [f64; 2] = [0.05, 0.002];
/// Errors of quantities in U95, and U95: mass, three first moments, their sum, the first less the second, and
/// the centre of mass.
pub const QUANTITIES: usize = 9;

/// Returns how far the answer to this number of still poses is off, in U95, and this. Gains have an error of
/// `gain`, 1 σ, which is stated.
pub fn off(seed: u64, poses: usize, gain: f64) -> [(f64, f64); QUANTITIES] {
    let fit = fit(seed, poses, gain);
    let estimate = &fit.estimate;
    let first = CENTRE.map(|c| MASS * c);
    let of = |weights: [f64; 4]| {
        let (mut value, mut variance, mut truth) = (0.0, 0.0, 0.0);
        for (j, own) in weights.iter().enumerate().filter(|(_, own)| **own != 0.0) {
            value += own * estimate.measured(j).expect("poses tell mass and first moment").value;
            truth += own * [MASS, first[0], first[1], first[2]][j];
            for (k, other) in weights.iter().enumerate().filter(|(_, own)| **own != 0.0) {
                variance += own * other * estimate.covariance(j, k).expect("poses tell both");
            }
        }
        let u95 = estimate.coverage_factor_of(&weights) * variance.sqrt();
        ((value - truth) / u95, u95)
    };
    let centre = centre_of_mass(estimate);
    let of_centre = |k: usize| ((centre.value[k] - CENTRE[k]) / centre.u95()[k], centre.u95()[k]);
    [
        of([1.0, 0.0, 0.0, 0.0]),
        of([0.0, 1.0, 0.0, 0.0]),
        of([0.0, 0.0, 1.0, 0.0]),
        of([0.0, 0.0, 0.0, 1.0]),
        of([0.0, 1.0, 1.0, 1.0]),
        of([0.0, 1.0, -1.0, 0.0]),
        of_centre(0),
        of_centre(1),
        of_centre(2),
    ]
}

fn fit(seed: u64, poses: usize, gain: f64) -> Fit {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
    let gains: [f64; 6] = std::array::from_fn(|_| 1.0 + gain * draw());
    let offset: [f64; 6] = std::array::from_fn(|c| if c < 3 { draw() } else { 0.1 * draw() });
    let reading = |n: usize| {
        // Up and down along each axis in turn, and somewhat askew.
        let mut up = Vector3::from_fn(|k, _| 0.3 * draw() + f64::from(u8::from(k == n / 2 % 3)));
        if n % 2 == 1 {
            up = -up;
        }
        let specific = G * up.normalize();
        let (push, turn) = (MASS * specific, MASS * Vector3::from(CENTRE).cross(&specific));
        let exact = [push.x, push.y, push.z, turn.x, turn.y, turn.z];
        let read = std::array::from_fn(|c| gains[c] * exact[c] + offset[c] + NOISE[c / 3] * draw());
        Reading {
            time_ns: n as u64 * 1_000_000_000,
            wrench: Wrench::from_array(read),
            specific_force: SpecificForce::from_array(specific.into()),
            angular_rate: AngularRate::from_array([0.0; 3]),
        }
    };
    let readings: Vec<Reading<f64>> = (0..poses).map(reading).collect();
    let text = format!(
        "[recording]\ngravity_std_mps2 = 1e-6\n[[imu]]\nclass = \"exact\"\n[load_cell]\nclass = \"exact\"\n\
         gain_uncertainty = {:?}\n",
        [gain; 6]
    );
    let file = RigFile::parse(&text).expect("a rig file");
    let input = prepare::input(&file, readings, true, 1.0);
    let source = Box::new(BodySource::new(input, file.imu.first()));
    let problem = Problem::new("poses", file, Subject::Body { source, gravity_columns: true });
    problem.fit(&FitOptions::default(), &Silent).expect("rows of poses")
}
