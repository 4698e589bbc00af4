//! A body on springs that are not as stiff as stated, simulated by `rigident-sim`.

use hexapod::{BodyParameters, Mounting};
use nalgebra::{UnitQuaternion, Vector3};
use rigident::fit::pool::PooledFactor;
use rigident::recording::Recording;
use rigident::rig::RigFile;
use rigident_sim::suspension::{Run, Spring, Start, Suspension};

use super::machines::{TEN, fitted};
use super::runs::Errors;
use crate::estimation::Normal;

/// Places of the springs, m, and their stiffness along and across, N/m.
const PLACES: [[f64; 3]; 4] = [[0.25, 0.2, 0.0], [-0.25, 0.2, 0.0], [-0.25, -0.2, 0.0], [0.25, -0.2, 0.0]];
const AXIAL: f64 = 4000.0;
const LATERAL: f64 = 1500.0;
/// 1 σ of the stiffness of each spring, relative, and of a pose, m and rad.
const STIFFNESS: f64 = 0.01;
const NOISE: [f64; 2] = [1e-5, 3e-5];
const RATE_HZ: f64 = 120.0;
const SECONDS: f64 = 20.0;
const MASS_KG: f64 = 12.0;

fn body() -> BodyParameters {
    BodyParameters {
        mass_kg: MASS_KG,
        com_m: [0.02, -0.01, 0.06],
        inertia_com_kgm2: [0.42, 0.35, 0.3, 0.01, -0.02, 0.015],
    }
}

/// Returns the ten parameters of the body about the origin.
fn truth() -> [f64; 10] {
    let BodyParameters { mass_kg: m, com_m: [x, y, z], inertia_com_kgm2: i } = body();
    [
        m,
        m * x,
        m * y,
        m * z,
        i[0] + m * (y * y + z * z),
        i[1] + m * (z * z + x * x),
        i[2] + m * (x * x + y * y),
        i[3] - m * y * z,
        i[4] - m * z * x,
        i[5] - m * x * y,
    ]
}

fn rig_file(number: usize) -> RigFile {
    let springs: String = PLACES
        .iter()
        .map(|at| {
            format!(
                "[[suspension.spring]]\nat_m = {at:?}\naxial_npm = {AXIAL:?}\nlateral_npm = {LATERAL:?}\n"
            )
        })
        .collect();
    let text = format!(
        "[recording.labels]\nrig = \"{number}\"\n[suspension]\nstiffness_std = {STIFFNESS}\n\
         stiffness_common_std = 0.0\n{springs}"
    );
    RigFile::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Returns a recording of a release with other velocities than any other.
fn record(number: usize, springs: &[Spring], seed: u64) -> Recording {
    let mut normal = Normal::new(seed);
    // Next to nothing: the body is all that moves.
    let empty = BodyParameters {
        mass_kg: 1e-6,
        com_m: [0.0; 3],
        inertia_com_kgm2: [1e-9, 1e-9, 1e-9, 0.0, 0.0, 0.0],
    };
    let suspension = Suspension::of_body(empty, springs.to_vec(), Mounting::IDENTITY, body());
    let mut three = |size: f64| std::array::from_fn(|_| size * (0.7 + 0.3 * normal.draw()));
    let start = Start { velocity_mps: three(0.2), rate_radps: three(0.6), ..Start::resting(&[]) };
    let rig = suspension.at_rest(&[]).expect("a rest");
    let motion = rig.simulate(&start, &Run::new(SECONDS, RATE_HZ)).expect("a motion");
    let [place, turn] = NOISE;
    let pose = |now: &rigident_sim::suspension::Instant| {
        let mut draw = |sigma: f64| Vector3::from_fn(|_, _| sigma * normal.draw());
        let at = now.platform.position + draw(place);
        let turned = UnitQuaternion::from_matrix(&now.platform.rotation)
            * UnitQuaternion::from_scaled_axis(draw(turn));
        [at.x, at.y, at.z, turned.w, turned.i, turned.j, turned.k]
    };
    Recording {
        name: format!("{number} {seed}"),
        rig: rig_file(number),
        rate_hz: Some(RATE_HZ),
        time_ns: motion.instants.iter().map(|now| (now.time_s * 1e9).round() as u64).collect(),
        platform: Some(motion.instants.iter().map(pose).collect()),
        ..Recording::default()
    }
}

/// Returns how far a body is off by recordings on the same springs, merged, in U95, and this.
pub fn merged(number: usize, runs: u64) -> Errors {
    let mut normal = Normal::new(5_000_000 + number as u64);
    let spring = |at: &[f64; 3]| Spring {
        factor: 1.0 + STIFFNESS * normal.draw(),
        ..Spring::upright(*at, AXIAL, LATERAL).with_loss(0.001)
    };
    let springs: Vec<Spring> = PLACES.iter().map(spring).collect();
    let one = |k: u64| {
        let recording = record(number, &springs, 60_000_000 + 10 * number as u64 + k);
        PooledFactor::of(&fitted(&recording, None), &recording.name)
    };
    let pooled = PooledFactor::merged((0..runs).map(one).collect(), false).expect("one body");
    let fit = pooled.fit();
    let truth = truth();
    let of = |k: usize| {
        let at = fit.parameters.iter().position(|p| p.name == TEN[k])?;
        let measured = fit.estimate.measured(at)?;
        Some(((measured.value - truth[k]) / measured.u95, measured.u95))
    };
    (0..10).filter_map(of).collect()
}
