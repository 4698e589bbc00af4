//! Two links that swing on springs, from frames at 1 kHz over the lock-step bus: the springs are the load
//! cell.

use hexapod::Mounting;
use nalgebra::{Matrix6, SMatrix, Vector3};
use rigident_shared::wire::{
    Command, ErrorCode, LinkJoint, LinkSettings, ModelSettings, Reply, SettingName, Settings,
    SuspensionSettings,
};
use rigident_sim::rig::RigConfig;
use rigident_sim::runner::{FrameBus, InProcess, suspended_frames_of};
use rigident_sim::suspension::paper::{self, JOINT_ELSEWHERE_M};
use rigident_sim::suspension::{Motion, Run, Suspension};

use super::device::{Device, settings};
use super::tracked_tree::batch;
use super::tree::{as_good_as, bits, here_and_there, merged, run, solved};

const RATE_HZ: f64 = 1000.0;
/// Angles that the second link is released at, rad: the matrix of the springs is of first order.
const RELEASE_RAD: [f64; 3] = [0.12, 0.08, 0.05];
/// White noise of the displacement sensors, m and rad.
const NOISE: [f64; 6] = [1e-5, 1e-5, 1e-5, 2e-5, 2e-5, 2e-5];

fn rig() -> Suspension {
    let mount = Mounting { position_m: [0.0, 0.256, 0.406], rotation_wxyz: [0.96, 0.0, 0.0, 0.28] };
    Suspension { mount, ..paper::suspension(JOINT_ELSEWHERE_M) }
}

fn stiffness(rig: &Suspension) -> Matrix6<f64> {
    let of = |spring: &rigident_sim::suspension::Spring| {
        let axis = Vector3::from(spring.axis).normalize();
        let along = axis * axis.transpose();
        let own = along * spring.axial_npm + (nalgebra::Matrix3::identity() - along) * spring.lateral_npm;
        let mut arms = SMatrix::<f64, 3, 6>::zeros();
        arms.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        arms.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Vector3::from(spring.at_m).cross_matrix());
        arms.transpose() * own * arms
    };
    rig.springs.iter().map(of).sum()
}

fn settings_of(rig: &Suspension) -> Settings {
    let k = stiffness(rig);
    let mut elements = SuspensionSettings::places().map(|place| k[place] as f32);
    let springs = SuspensionSettings {
        stiffness: std::array::from_fn(|_| elements.next().unwrap()),
        base_position_m: rig.mount.position_m.map(|v| v as f32),
        base_rotation_wxyz: rig.mount.rotation_wxyz.map(|v| v as f32),
        anchor_height_m: -0.05,
        locked: 0,
    };
    let base = LinkSettings { parent: 0, joint: LinkJoint::Free, position_m: [0.0; 3] };
    let position_m = JOINT_ELSEWHERE_M.map(|v| v as f32);
    let link = LinkSettings { parent: 0, joint: LinkJoint::Spherical, position_m };
    let mut own = settings(&RigConfig::thesis_horizontal());
    own.model = ModelSettings::Suspended([base, link].into_iter().collect(), springs);
    // What noise of the displacement is after the stiffness.
    own.load_cell.noise_n_nm =
        std::array::from_fn(|i| (0..6).map(|j| (k[(i, j)] * NOISE[j]).powi(2)).sum::<f64>().sqrt() as f32);
    own.load_cell.known_offset_n_nm = Some([0.0; 6]);
    own.load_cell.range_n_nm = [1e5; 6];
    own.frozen_after = 5;
    // Nineteen averages of five frames in either precision.
    Settings { rate_hz: RATE_HZ as f32, filter_width_s: 0.099, row_every: 10, ..own }
}

fn motion(rig: &Suspension, scale: f64, duration_s: f64) -> Motion {
    let simulated = rig.at_rest(&[paper::hanging_wxyz()]).unwrap();
    let start = paper::released(RELEASE_RAD.map(|v| scale * v));
    simulated.simulate(&start, &Run::new(duration_s, RATE_HZ)).unwrap()
}

/// Returns what the base link's parameters are: its own, the platform's, and the second link's mass in the
/// joint.
fn true_base(rig: &Suspension) -> [f64; 10] {
    let turn = rig.mount.rotation().unwrap();
    let turn = nalgebra::Matrix3::from_fn(|i, j| turn[(i, j)]);
    let arm = Vector3::from(rig.mount.position_m);
    let platform = hexapod::BodyParameters {
        com_m: (turn.transpose() * (Vector3::from(rig.platform.com_m) - arm)).into(),
        inertia_com_kgm2: {
            let i = turn.transpose() * rig.platform.inertia_com() * turn;
            [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(1, 2)], i[(2, 0)], i[(0, 1)]]
        },
        ..rig.platform
    };
    let joint = hexapod::BodyParameters {
        mass_kg: rig.links[0].body.mass_kg,
        com_m: JOINT_ELSEWHERE_M,
        inertia_com_kgm2: [0.0; 6],
    };
    let all = [rig.base, platform, joint].map(|body| body.parameters());
    std::array::from_fn(|k| all.iter().map(|p| p[k]).sum())
}

#[test]
fn small_vibrations_give_both_links_and_smaller_ones_give_them_better() {
    let rig = rig();
    let (base, link, settings) = (true_base(&rig), rig.links[0].body.parameters(), settings_of(&rig));
    let off = |scale: f64| {
        let frames = suspended_frames_of(&motion(&rig, scale, 6.0), [0.0; 6], 1);
        let (found, ..) = solved(batch(&frames, &settings).factor());
        let truth: Vec<f64> = base.iter().chain(&link[1..]).copied().collect();
        let size = |j: usize| {
            if j == 0 {
                base[0]
            } else if j < 4 {
                20.0
            } else {
                9.0
            }
        };
        let all = truth.iter().enumerate().map(|(j, t)| (found[j] - t).abs() / size(j));
        (all.fold(0.0, f64::max), found[5] - base[5])
    };
    // The springs' law is a matrix', of first order, and frames are of single precision.
    let (whole, j_yy) = off(1.0);
    let (half, half_j_yy) = off(0.5);
    println!("{whole:.2e} {j_yy:.2e}, {half:.2e} {half_j_yy:.2e}");
    assert!(whole < 0.02 && half < 0.6 * whole, "{whole} {half}");
    assert!(j_yy.abs() < 0.01 * base[5], "{j_yy} of {}", base[5]);
}

#[test]
fn single_precision_is_as_good_as_double_and_holds_the_inertia_about_y() {
    let rig = rig();
    let settings = settings_of(&rig);
    let frames = suspended_frames_of(&motion(&rig, 1.0, 6.0), NOISE, 2);
    let (bus, gate) = FrameBus::new(frames.clone(), RATE_HZ);
    let mut mcu = InProcess::on(Box::new(bus));
    let (rows, mut device) = run(&mut mcu, &gate, &settings);
    let counters = device.counters().frames;
    assert_eq!((counters.frames, counters.absorbed, counters.missing), (6001, 6001, 0));
    // A block every ten frames.
    assert_eq!(rows[0].rows, 6 * ((6001 - 95) / 10 + 1));
    let (found, sd, limit) = as_good_as(&merged(&rows), &batch(&frames, &settings));
    println!("J_yy {} of {} sd {} limit {limit:.1e}", found[5], true_base(&rig)[5], sd[5]);
    assert!((found[5] - true_base(&rig)[5]).abs() < 2.0 * sd[5], "{} {}", found[5], sd[5]);
}

#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_processor_gives_the_same_bits_of_links_on_springs() {
    let rig = rig();
    let settings = settings_of(&rig);
    let mut frames = suspended_frames_of(&motion(&rig, 1.0, 1.0), NOISE, 3);
    frames.drain(500..503);
    let (here, there) = here_and_there(frames, RATE_HZ, &settings);
    assert!(here[0].rows > 0);
    assert_eq!(bits(&here), bits(&there));
}

#[test]
fn springs_that_cannot_be_are_named() {
    let rig = rig();
    let good = settings_of(&rig);
    let (bus, _) = FrameBus::new(Vec::new(), RATE_HZ);
    let mut mcu = InProcess::on(Box::new(bus));
    let mut device = Device::greet(&mut mcu);
    let with = |change: &dyn Fn(&mut SuspensionSettings)| {
        let mut settings = good.clone();
        if let ModelSettings::Suspended(_, springs) = &mut settings.model {
            change(springs);
        }
        settings
    };
    let nan = f32::NAN;
    for (bad, name) in [
        (with(&|s| s.stiffness[0] = -1.0), SettingName::Stiffness),
        (with(&|s| s.stiffness[3] = nan), SettingName::Stiffness),
        // A diagonal that is positive, and a direction in which the platform is pushed away.
        (with(&|s| s.stiffness[1] = 1e6), SettingName::Stiffness),
        (with(&|s| s.base_position_m[1] = nan), SettingName::Suspension),
        (with(&|s| s.base_rotation_wxyz = [0.0; 4]), SettingName::Suspension),
        (with(&|s| s.anchor_height_m = f32::INFINITY), SettingName::Suspension),
        (with(&|s| s.locked = 0x3f), SettingName::Suspension),
        // More row blocks under way than there is room for.
        (Settings { row_every: 1, ..good.clone() }, SettingName::Filter),
    ] {
        let said = device.ask(&Command::Configure(bad.clone()));
        assert_eq!(said, Err(ErrorCode::BadSetting(name)), "{bad:?}");
    }
    assert_eq!(device.ask(&Command::Configure(with(&|s| s.locked = 0x21))), Ok(Reply::Done));
    assert_eq!(device.ask(&Command::Configure(good)), Ok(Reply::Done));
}
