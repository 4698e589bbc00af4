//! A 34-DOF human's 128 base parameters from frames over the lock-step bus.

use std::time::{Duration, Instant};

use hexapod::BodyParameters;
use nalgebra::{DMatrix, DVector};
use rigident_shared::estimator::frames::{
    Frame, FrameEstimator, FrameFilter, FrameLink, FramesConfig, LinkMotion, Suspension, TreeFactor,
};
use rigident_shared::tree::base::TurningJoint;
use rigident_shared::wire::tree_frame::TreeFrame;
use rigident_shared::wire::{
    Command, ErrorCode, FactorRow, LinkJoint, LinkSettings, ModelSettings, Reason, Reply, SettingName,
    Settings, StateName, SuspensionSettings,
};
use rigident_sim::links::{Swing, Tree, TreeLink};
use rigident_sim::rig::RigConfig;
use rigident_sim::runner::{FrameBus, FrameGate, InProcess, Mcu, Qemu, QemuOptions, frames_of};

use super::device::{Device, settings};

pub(super) const RATE_HZ: f64 = 100.0;
pub(super) const NOISE: [f64; 6] = [1.0, 1.0, 2.0, 0.2, 0.2, 0.2];
pub(super) const PARAMETERS: usize = 128;
const PARENTS: [usize; 15] = [0, 0, 1, 2, 2, 4, 5, 2, 7, 8, 0, 10, 11, 0, 13];
const HINGES: [usize; 4] = [5, 8, 11, 14];

/// Returns a tree of a human's size and shape, every joint in motion.
pub(super) fn human() -> Tree {
    let links = PARENTS
        .iter()
        .enumerate()
        .map(|(i, parent)| {
            let phase = |k: usize| 0.9 * i as f64 + 1.7 * k as f64;
            let mut swing = Swing {
                amplitude_rad: std::array::from_fn(|k| 0.5 + 0.1 * ((i + k) % 3) as f64),
                frequency_hz: std::array::from_fn(|k| 0.35 + 0.083 * ((5 * i + 3 * k) % 11) as f64),
                phase_rad: std::array::from_fn(phase),
            };
            if HINGES.contains(&i) {
                (swing.amplitude_rad[0], swing.amplitude_rad[2]) = (0.0, 0.0);
            }
            let mass_kg = 2.0 + 1.3 * ((4 * i) % 7) as f64;
            TreeLink {
                parent: *parent,
                joint_m: [
                    0.02 * (i % 3) as f64,
                    0.15 - 0.02 * i as f64,
                    if i % 2 == 0 { 0.25 } else { -0.3 },
                ],
                body: BodyParameters {
                    mass_kg,
                    com_m: [0.01, 0.02, -0.12],
                    inertia_com_kgm2: [
                        0.02 * mass_kg,
                        0.018 * mass_kg,
                        0.004 * mass_kg,
                        0.001,
                        -0.002,
                        0.003,
                    ],
                },
                swing,
            }
        })
        .collect();
    Tree { links, sway_m: [0.1, 0.08, 0.05], sway_hz: [0.5, 0.7, 0.9], gravity_mps2: 9.80665 }
}

pub(super) fn tree_settings(tree: &Tree) -> Settings {
    let links = tree.links.iter().enumerate().map(|(i, link)| LinkSettings {
        parent: link.parent as u8,
        joint: if HINGES.contains(&i) { LinkJoint::Revolute(1) } else { LinkJoint::Spherical },
        position_m: link.joint_m.map(|v| v as f32),
    });
    let mut settings = settings(&RigConfig::thesis_horizontal());
    settings.model = ModelSettings::Tree(links.collect());
    settings.load_cell.noise_n_nm = NOISE.map(|v| v as f32);
    settings.load_cell.known_offset_n_nm = Some([0.0; 6]);
    settings.load_cell.range_n_nm = [1e5; 6];
    settings.frozen_after = 5;
    settings
}

fn take_all(device: &mut Device) -> Vec<FactorRow> {
    let mut take = |row| match device.ask(&Command::TakeRow { row }) {
        Ok(Reply::Row(row)) => row,
        other => panic!("{other:?}"),
    };
    let first = take(0);
    let others = (1..first.parameters).map(take).collect::<Vec<_>>();
    std::iter::once(first).chain(others).collect()
}

/// Runs the same frames in this process and on the emulated processor, whose stack must hold.
pub(super) fn here_and_there(
    frames: Vec<Vec<u8>>,
    rate_hz: f64,
    settings: &Settings,
) -> (Vec<FactorRow>, Vec<FactorRow>) {
    let (bus, gate) = FrameBus::new(frames.clone(), rate_hz);
    let here = run(&mut InProcess::on(Box::new(bus)), &gate, settings).0;
    let (bus, gate) = FrameBus::new(frames, rate_hz);
    let mut qemu = Qemu::spawn_on(&QemuOptions::default(), Box::new(bus)).unwrap_or_else(|e| panic!("{e}"));
    let there = run(&mut qemu, &gate, settings).0;
    let stack = qemu.finish(Duration::from_secs(60)).unwrap().expect("it reports its stack");
    assert!(stack.used < stack.size, "{stack:?}");
    (here, there)
}

/// Runs all frames and hands the level over.
pub(super) fn run<'a>(
    mcu: &'a mut dyn Mcu,
    gate: &FrameGate,
    settings: &Settings,
) -> (Vec<FactorRow>, Device<'a>) {
    let mut device = Device::greet(mcu);
    assert_eq!(device.ask(&Command::Configure(settings.clone())), Ok(Reply::Done));
    assert_eq!(device.ask(&Command::Start), Ok(Reply::Done));
    gate.set_open(true);
    let deadline = Instant::now() + Duration::from_secs(120);
    while !gate.is_done() {
        assert!(Instant::now() < deadline, "the frames do not end");
        device.listen(Duration::from_millis(20));
    }
    let rows = take_all(&mut device);
    assert_eq!(device.ask(&Command::Hold), Ok(Reply::Done));
    (rows, device)
}

pub(super) fn merged(rows: &[FactorRow]) -> Box<TreeFactor<f64>> {
    let mut factor = Box::new(TreeFactor::EMPTY);
    factor.clear(rows.len());
    for row in rows {
        let entries: Vec<f64> = row.entries.iter().map(|v| f64::from(*v)).collect();
        factor.merge_row(usize::from(row.row), &entries);
        factor.merge_residual(f64::from(row.residual_sum_of_squares), row.rows);
    }
    factor
}

/// Returns estimate, standard deviations, condition number of the column-scaled R.
pub(super) fn solved(factor: &TreeFactor<f64>) -> (DVector<f64>, Vec<f64>, f64) {
    let n = factor.parameters();
    let mut r = DMatrix::zeros(n, n);
    let mut z = DVector::zeros(n);
    for i in 0..n {
        let row: Vec<f64> = factor.row(i).collect();
        (0..n - i).for_each(|k| r[(i, i + k)] = row[k]);
        z[i] = row[n - i];
    }
    let inverse = r.clone().try_inverse().expect("every parameter is excited");
    let norms: Vec<f64> = r.column_iter().map(|c| c.norm()).collect();
    let singular = DMatrix::from_fn(n, n, |i, j| r[(i, j)] / norms[j]).singular_values();
    let sd = (0..n).map(|j| inverse.row(j).norm()).collect();
    (&inverse * z, sd, singular.max() / singular.min())
}

/// Holds a factor to that of double precision: parameters within max(0.05 sd, 20 ε cond ‖φ‖). Returns these
/// parameters, the standard deviations, and the second of the limits.
#[track_caller]
pub(super) fn as_good_as(
    found: &TreeFactor<f64>,
    exact: &FrameEstimator<f64>,
) -> (DVector<f64>, Vec<f64>, f64) {
    let (found, ..) = solved(found);
    let (exact, sd, condition) = solved(exact.factor());
    let limit = 20.0 * 1.19e-7 * condition * exact.norm();
    for j in 0..exact.len() {
        let error = (found[j] - exact[j]).abs();
        assert!(error <= limit.max(0.05 * sd[j]), "{j}: {error} sd {} limit {limit}", sd[j]);
    }
    (found, sd, limit)
}

/// Springs in double precision.
fn suspension(springs: &SuspensionSettings) -> Suspension<f64> {
    let mut stiffness = [[0.0; 6]; 6];
    for ((i, j), value) in SuspensionSettings::places().zip(springs.stiffness) {
        (stiffness[i][j], stiffness[j][i]) = (f64::from(value), f64::from(value));
    }
    Suspension {
        stiffness,
        base_position: springs.base_position_m.map(f64::from),
        base_attitude: springs.base_rotation_wxyz.map(f64::from),
        anchor_height: f64::from(springs.anchor_height_m),
        locked: springs.locked,
    }
}

/// Returns an estimator in double precision.
pub(super) fn in_double(links: &[LinkSettings], settings: &Settings) -> Box<FrameEstimator<f64>> {
    let suspension = match &settings.model {
        ModelSettings::Suspended(_, springs) => Some(suspension(springs)),
        _ => None,
    };
    let is_tracked = links[0].joint == LinkJoint::Free;
    let links: Vec<FrameLink<f64>> = links
        .iter()
        .map(|l| FrameLink {
            parent: l.parent,
            joint: match l.joint {
                LinkJoint::Fixed => TurningJoint::Fixed,
                LinkJoint::Revolute(axis) => TurningJoint::Revolute(axis),
                LinkJoint::Spherical | LinkJoint::Free => TurningJoint::Spherical,
            },
            position: l.position_m.map(f64::from),
        })
        .collect();
    let mut estimator = Box::new(FrameEstimator::UNUSED);
    let filter = FrameFilter {
        rate_hz: f64::from(settings.rate_hz),
        width_s: f64::from(settings.filter_width_s),
        row_every: settings.row_every,
    };
    let config = FramesConfig {
        channel_sigma: settings.load_cell.noise_n_nm.map(f64::from),
        known_offset: [0.0; 6],
        range: [1e9; 6],
        still_after: 0,
        filter: (is_tracked || suspension.is_some()).then_some(filter),
        suspension,
    };
    estimator.set_up(&links, &config).unwrap();
    estimator
}

/// Absorbs the frames in double precision.
fn batch(frames: &[Vec<u8>], settings: &Settings) -> Box<FrameEstimator<f64>> {
    let ModelSettings::Tree(links) = &settings.model else { panic!("a tree") };
    let mut estimator = in_double(links, settings);
    for bytes in frames {
        let frame = TreeFrame::decode(bytes, links.len()).unwrap();
        let motions: Vec<LinkMotion<f64>> = frame
            .links()
            .map(|l| l.map(f64::from))
            .map(|[qw, qx, qy, qz, wx, wy, wz, cx, cy, cz]| LinkMotion {
                attitude: [qw, qx, qy, qz],
                rate: [wx, wy, wz],
                angular_acceleration: [cx, cy, cz],
            })
            .collect();
        let [fx, fy, fz, mx, my, mz, ax, ay, az, wx, wy, wz, cx, cy, cz] = frame.base.map(f64::from);
        let frame = Frame {
            wrench: [fx, fy, fz, mx, my, mz],
            specific_force: [ax, ay, az],
            rate: [wx, wy, wz],
            angular_acceleration: [cx, cy, cz],
            links: &motions,
        };
        estimator.absorb(&frame).unwrap();
    }
    estimator.begin_hand_over();
    estimator
}

/// Spoils a frame's numbers.
type Change<'a> = &'a dyn Fn(&mut [f32; 15], &mut Vec<[f32; 10]>);

pub(super) fn bits(rows: &[FactorRow]) -> Vec<u32> {
    let of = |row: &FactorRow| {
        let residual = [row.residual_sum_of_squares.to_bits(), row.rows];
        row.entries.iter().map(|v| v.to_bits()).chain(residual).collect::<Vec<_>>()
    };
    rows.iter().flat_map(of).collect()
}

#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_processor_gives_the_same_bits_of_a_human() {
    let tree = human();
    let frames = frames_of(&tree, 301, RATE_HZ, NOISE, 1);
    let settings = tree_settings(&tree);
    let (here, there) = here_and_there(frames, RATE_HZ, &settings);
    assert_eq!(here.iter().map(|r| r.rows).sum::<u32>(), 6 * 301);
    assert_eq!(bits(&here), bits(&there));
}

#[test]
fn single_precision_is_as_good_as_a_batch_of_the_same_frames_in_double() {
    let tree = human();
    let frames = frames_of(&tree, 6000, RATE_HZ, NOISE, 2);
    let settings = tree_settings(&tree);
    let (bus, gate) = FrameBus::new(frames.clone(), RATE_HZ);
    let mut mcu = InProcess::on(Box::new(bus));
    let (rows, mut device) = run(&mut mcu, &gate, &settings);
    let counters = device.counters().frames;
    assert_eq!((counters.frames, counters.absorbed, counters.missing, counters.damaged), (6000, 6000, 0, 0));
    let (found, sd, limit) = as_good_as(&merged(&rows), &batch(&frames, &settings));
    // And what is found is the human: the mass of all, whose column is the first.
    let mass: f64 = tree.links.iter().map(|l| l.body.mass_kg).sum();
    assert!((found[0] - mass).abs() < 5.0 * sd[0].max(limit), "{} {mass}", found[0]);
    // A whole link at the end of a chain has its own first moments and tensor.
    let hand = tree.links[9].body.parameters();
    let first = 10
        + PARENTS[1..9]
            .iter()
            .enumerate()
            .map(|(k, _)| if HINGES.contains(&(k + 1)) { 7 } else { 9 })
            .sum::<usize>();
    for k in 0..9 {
        let error = (found[first + k] - hand[1 + k]).abs();
        assert!(error < 5.0 * sd[first + k].max(limit), "{k}: {error}");
    }
}

#[test]
fn a_level_handed_over_while_running_loses_nothing() {
    let tree = human();
    let frames = frames_of(&tree, 500, RATE_HZ, NOISE, 3);
    let settings = tree_settings(&tree);
    let (bus, gate) = FrameBus::new(frames.clone(), RATE_HZ);
    let mut mcu = InProcess::on(Box::new(bus));
    let mut device = Device::greet(&mut mcu);
    assert_eq!(device.ask(&Command::Configure(settings.clone())), Ok(Reply::Done));
    assert_eq!(device.ask(&Command::Start), Ok(Reply::Done));
    gate.set_open(true);
    let mut rows = Vec::new();
    // Between the rows frames are absorbed.
    while !gate.is_done() {
        for row in 0..PARAMETERS as u8 {
            match device.ask(&Command::TakeRow { row }) {
                Ok(Reply::Row(row)) => rows.push(row),
                other => panic!("{other:?}"),
            }
            device.listen(Duration::from_micros(300));
        }
    }
    rows.extend(take_all(&mut device));
    let merged = merged(&rows);
    let exact = batch(&frames, &settings);
    assert_eq!(merged.rows(), 6 * 500);
    as_good_as(&merged, &exact);
    // What has been taken is no longer there.
    assert!(take_all(&mut device).iter().all(|r| r.rows == 0 && r.entries.iter().all(|v| *v == 0.0)));
    assert_eq!(device.ask(&Command::TakeRow { row: 128 }), Err(ErrorCode::NoEstimate));
    assert_eq!(device.ask(&Command::ReadEstimate), Err(ErrorCode::NoEstimate));
}

#[test]
fn bad_frames_are_counted_by_reason_and_nothing_of_them_is_absorbed() {
    let tree = human();
    let good = frames_of(&tree, 40, RATE_HZ, NOISE, 4);
    let settings = tree_settings(&tree);
    let rewritten = |bytes: &[u8], change: Change<'_>| {
        let frame = TreeFrame::decode(bytes, 15).unwrap();
        let (mut base, mut links) = (frame.base, frame.links().collect::<Vec<_>>());
        change(&mut base, &mut links);
        let mut out = vec![0; 700];
        let n = TreeFrame::encode(frame.number, &base, &links, &mut out).unwrap();
        out.truncate(n);
        out
    };
    let mut frames = good.clone();
    frames[5] = rewritten(&good[5], &|_, links| links[3][5] = f32::NAN);
    frames[6] = rewritten(&good[6], &|_, links| links.truncate(13));
    frames[7] = rewritten(&good[7], &|_, links| links[8][..4].fill(0.0));
    frames[8] = rewritten(&good[8], &|base, _| base[1] = 2e5);
    frames[9][100] ^= 4;
    // The motion capture holds its last pose while the feet go on pushing: the fifth repeat is too many.
    for k in 20..30 {
        frames[k] = rewritten(&good[k], &|base, links| {
            let held = TreeFrame::decode(&good[19], 15).unwrap();
            base[6..].copy_from_slice(&held.base[6..]);
            *links = held.links().collect();
        });
    }
    // And three frames never come.
    frames.drain(35..38);
    let (bus, gate) = FrameBus::new(frames.clone(), RATE_HZ);
    let mut mcu = InProcess::on(Box::new(bus));
    let (rows, mut device) = run(&mut mcu, &gate, &settings);
    let counters = device.counters();
    let f = counters.frames;
    assert_eq!((f.not_finite, f.wrong_links, f.no_attitude, f.saturated), (1, 1, 1, 1), "{f:?}");
    // Numbers of damaged frames and of other trees' are not known: they are missing, too.
    assert_eq!((f.damaged, f.without_motion, f.missing, f.full), (1, 6, 2 + 3, 0), "{f:?}");
    assert_eq!(f.absorbed, 37 - 5 - 6);
    assert_eq!((f.frames - f.absorbed, counters.rejected), (10, 10));
    assert_eq!(rows.iter().map(|r| r.rows).sum::<u32>(), 6 * f.absorbed);
    assert!(rows.iter().all(|r| r.entries.iter().all(|v| v.is_finite())));
    // The same as if they had never been sent.
    let left: Vec<Vec<u8>> = frames
        .iter()
        .enumerate()
        .filter(|(k, _)| !(5..10).contains(k) && !(24..30).contains(k))
        .map(|(_, f)| f.clone())
        .collect();
    let (bus, gate) = FrameBus::new(left, RATE_HZ);
    let mut clean = InProcess::on(Box::new(bus));
    assert_eq!(bits(&run(&mut clean, &gate, &settings).0), bits(&rows));
}

#[test]
fn a_full_level_holds_until_it_is_taken() {
    let human = human();
    let base = Tree { links: human.links[..1].to_vec(), ..human };
    let few = frames_of(&base, 500, RATE_HZ, NOISE, 5);
    let frames = (0..100_010).map(|k| few[k % 500].clone()).collect();
    let (bus, gate) = FrameBus::new(frames, RATE_HZ);
    let mut mcu = InProcess::on(Box::new(bus));
    let mut device = Device::greet(&mut mcu);
    assert_eq!(device.ask(&Command::Configure(tree_settings(&base))), Ok(Reply::Done));
    assert_eq!(device.ask(&Command::Start), Ok(Reply::Done));
    gate.set_open(true);
    while !gate.is_done() {
        device.listen(Duration::from_millis(20));
    }
    assert_eq!(device.states.last(), Some(&StateName::Holding));
    assert_eq!(device.reasons.last(), Some(&Reason::LevelFull));
    let frames = device.counters().frames;
    assert_eq!((frames.frames, frames.absorbed, frames.full), (100_000, 100_000, 0));
    let mut rows = 0;
    for row in 0..10 {
        let Ok(Reply::Row(taken)) = device.ask(&Command::TakeRow { row }) else { panic!("no row") };
        rows += taken.rows;
    }
    assert_eq!(rows, 600_000);
    assert_eq!(device.ask(&Command::Start), Ok(Reply::Done));
}

#[test]
fn impossible_settings_of_a_tree_are_named() {
    let tree = human();
    let good = tree_settings(&tree);
    let (bus, _) = FrameBus::new(Vec::new(), RATE_HZ);
    let mut mcu = InProcess::on(Box::new(bus));
    let mut device = Device::greet(&mut mcu);
    let ModelSettings::Tree(links) = good.model.clone() else { panic!("a tree") };
    let with = |change: &dyn Fn(&mut Vec<LinkSettings>)| {
        let mut all = links.to_vec();
        change(&mut all);
        Settings { model: ModelSettings::Tree(all.into_iter().collect()), ..good.clone() }
    };
    let mut unknown_offset = good.clone();
    unknown_offset.load_cell.known_offset_n_nm = None;
    for (bad, name) in [
        (with(&|l| l[4].parent = 4), SettingName::Link(4)),
        (with(&|l| l[5].joint = LinkJoint::Revolute(7)), SettingName::Link(5)),
        (with(&|l| l[9].position_m[0] = f32::NAN), SettingName::Link(9)),
        (with(&|l| l[3].joint = LinkJoint::Free), SettingName::Link(3)),
        (with(&|l| l[5].joint = LinkJoint::Spherical), SettingName::Links),
        (with(&|l| l.clear()), SettingName::Links),
        (unknown_offset, SettingName::KnownOffset),
        (Settings { source: rigident_shared::wire::Source::Injected, ..good.clone() }, SettingName::Model),
    ] {
        assert_eq!(device.ask(&Command::Configure(bad)), Err(ErrorCode::BadSetting(name)));
    }
    assert_eq!(device.ask(&Command::TakeRow { row: 0 }), Err(ErrorCode::NoEstimate));
    assert_eq!(device.ask(&Command::Configure(good)), Ok(Reply::Done));
    device.listen(Duration::from_millis(10));
    assert_eq!(device.states.last(), Some(&StateName::Configured));
}
