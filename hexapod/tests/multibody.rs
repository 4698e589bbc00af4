//! The platform's hand-written mechanics against an independent multibody engine:
//! `vectors/platform_dynamics.py` says which, and makes `vectors/platform_dynamics.json` anew.

use hexapod::BodyParameters;
use hexapod::Mounting;
use hexapod::{Bodies, Geometry, Load, PlateState, rotation_from_rpy};
use nalgebra::Vector3;
use serde::Deserialize;

#[derive(Deserialize)]
struct Recorded {
    gravity_mps2: f64,
    base_joints_m: [[f64; 3]; 6],
    plate_joints_m: [[f64; 3]; 6],
    bodies: Vec<Placed>,
    vectors: Vec<Vector>,
}

/// A body in a frame of its own, and that frame on the plate.
#[derive(Deserialize)]
struct Placed {
    mass_kg: f64,
    com_m: [f64; 3],
    inertia_com_kgm2: [f64; 6],
    position_m: [f64; 3],
    rotation_wxyz: [f64; 4],
}

impl Placed {
    fn on_the_plate(&self) -> BodyParameters {
        let Self { mass_kg, com_m, inertia_com_kgm2, position_m, rotation_wxyz } = *self;
        let turn = Mounting { position_m, rotation_wxyz }.rotation().expect("a rotation");
        BodyParameters { mass_kg, com_m, inertia_com_kgm2 }.in_frame(&Vector3::from(position_m), &turn)
    }
}

#[derive(Deserialize)]
struct Vector {
    position_m: [f64; 3],
    rpy_rad: [f64; 3],
    velocity_mps: [f64; 3],
    acceleration_mps2: [f64; 3],
    angular_rate_radps: [f64; 3],
    angular_acceleration_radps2: [f64; 3],
    leg_length_m: [f64; 6],
    leg_rate_mps: [f64; 6],
    leg_acceleration_mps2: [f64; 6],
    leg_force_n: [f64; 6],
}

#[test]
fn lengths_rates_accelerations_and_forces_of_the_legs_are_those_of_a_multibody_engine() {
    let recorded: Recorded =
        serde_json::from_str(include_str!("vectors/platform_dynamics.json")).expect("recorded vectors");
    let geometry = Geometry {
        base_joints_m: recorded.base_joints_m,
        plate_joints_m: recorded.plate_joints_m,
        ..Geometry::thesis()
    };
    let load = Load {
        bodies: Bodies::Known(recorded.bodies.iter().map(Placed::on_the_plate).collect()),
        gravity_mps2: [0.0, 0.0, -recorded.gravity_mps2],
    };
    assert!(recorded.vectors.len() >= 50);
    let mut worst = [0.0_f64; 4];
    for v in &recorded.vectors {
        let state = PlateState {
            rpy: Vector3::from(v.rpy_rad),
            position: Vector3::from(v.position_m),
            velocity: Vector3::from(v.velocity_mps),
            acceleration: Vector3::from(v.acceleration_mps2),
            rotation: rotation_from_rpy(v.rpy_rad),
            angular_rate: Vector3::from(v.angular_rate_radps),
            angular_acceleration: Vector3::from(v.angular_acceleration_radps2),
        };
        let forces = geometry.leg_force_ranges(&state, 0.0, &load).unwrap().map(|[low, _]| low);
        let pairs = [
            (geometry.leg_lengths(&state.pose()), v.leg_length_m),
            (geometry.leg_rates(&state), v.leg_rate_mps),
            (geometry.leg_accelerations(&state), v.leg_acceleration_mps2),
            (forces, v.leg_force_n),
        ];
        for (worst, (ours, theirs)) in worst.iter_mut().zip(pairs) {
            let largest = theirs.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            for (a, b) in ours.iter().zip(theirs) {
                *worst = worst.max((a - b).abs() / largest);
            }
        }
    }
    println!("relative gaps of lengths, rates, accelerations, forces: {worst:?}");
    // Promised 1e-6; both are closed forms in double precision, so only rounding times cond(H) may be left.
    assert!(worst.iter().all(|gap| *gap < 1e-11), "{worst:?}");
}
