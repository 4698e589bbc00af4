//! A 34-DOF human's 128 base parameters from frames of positions and rates alone, over the lock-step bus.

use nalgebra::Vector3;
use rigident_shared::estimator::frames::{FrameEstimator, LinkPose, TrackedFrame};
use rigident_shared::wire::tree_frame;
use rigident_shared::wire::{
    Command, ErrorCode, LinkJoint, LinkSettings, ModelSettings, Reply, SettingName, Settings,
};
use rigident_sim::links::{Tree, quaternion};
use rigident_sim::runner::{FrameBus, InProcess, tracked_frames_of};

use super::device::Device;
use super::tree::{
    NOISE, PARAMETERS, RATE_HZ, as_good_as, bits, here_and_there, human, in_double, merged, run, solved,
    tree_settings,
};

/// Taps of the filter of 0.1 s at 100 frames a second.
const TAPS: u32 = 9;

fn settings_of(tree: &Tree) -> Settings {
    let mut settings = tree_settings(tree);
    let ModelSettings::Tree(links) = &mut settings.model else { panic!("a tree") };
    links[0].joint = LinkJoint::Free;
    Settings { rate_hz: RATE_HZ as f32, filter_width_s: 0.1, row_every: 1, ..settings }
}

fn links_of(settings: &Settings) -> &[LinkSettings] {
    match &settings.model {
        ModelSettings::Tree(links) | ModelSettings::Suspended(links, _) => links,
        _ => panic!("a tree"),
    }
}

/// Absorbs the frames in double precision.
pub(super) fn batch(frames: &[Vec<u8>], settings: &Settings) -> Box<FrameEstimator<f64>> {
    let mut estimator = in_double(links_of(settings), settings);
    for bytes in frames {
        let frame = tree_frame::TrackedFrame::decode(bytes, links_of(settings).len()).unwrap();
        let [fx, fy, fz, mx, my, mz, vx, vy, vz, base @ ..] = frame.base.map(f64::from);
        let others = frame.links().map(|l| l.map(f64::from));
        let links: Vec<LinkPose<f64>> = std::iter::once(base)
            .chain(others)
            .map(|[qw, qx, qy, qz, x, y, z]| LinkPose { attitude: [qw, qx, qy, qz], rate: [x, y, z] })
            .collect();
        let wrench = [fx, fy, fz, mx, my, mz];
        let frame = TrackedFrame { number: frame.number, wrench, velocity: [vx, vy, vz], links: &links };
        estimator.absorb_tracked(&frame).unwrap();
    }
    estimator.begin_hand_over();
    estimator
}

#[test]
fn positions_and_rates_alone_give_the_human() {
    let tree = human();
    let settings = settings_of(&tree);
    let mut estimator = in_double(links_of(&settings), &settings);
    for k in 0..6000 {
        let now = tree.at(f64::from(k) / RATE_HZ);
        let turn = now.motions[0].rotation;
        let [fx, fy, fz, mx, my, mz] = now.wrench;
        let (f, m) = (turn * Vector3::new(fx, fy, fz), turn * Vector3::new(mx, my, mz));
        let pose = |link: &hexapod::FrameMotion| LinkPose {
            attitude: quaternion(&link.rotation),
            rate: link.rotation.tr_mul(&link.angular_rate).into(),
        };
        let links: Vec<LinkPose<f64>> = now.motions.iter().map(pose).collect();
        let frame = TrackedFrame {
            number: k as u32,
            wrench: [f.x, f.y, f.z, m.x, m.y, m.z],
            velocity: now.motions[0].velocity.into(),
            links: &links,
        };
        estimator.absorb_tracked(&frame).unwrap();
    }
    estimator.begin_hand_over();
    let (found, ..) = solved(estimator.factor());
    let mass: f64 = tree.links.iter().map(|l| l.body.mass_kg).sum();
    assert!((found[0] / mass - 1.0).abs() < 1e-5, "{} {mass}", found[0]);
    // Links at the ends of chains keep their own first moments, and their tensors if their joint is a ball;
    // in the order of links.
    let mut first = 10;
    for (i, link) in tree.links.iter().enumerate().skip(1) {
        let is_hinge = [5, 8, 11, 14].contains(&i);
        let is_end = tree.links.iter().all(|l| l.parent != i);
        if is_end && !is_hinge {
            let own = link.body.parameters();
            for k in 0..9 {
                let error = (found[first + k] - own[1 + k]).abs();
                assert!(error < 2e-4 * (0.1 + own[1 + k].abs()), "{i} {k}: {error} of {}", own[1 + k]);
            }
        }
        first += if is_hinge { 7 } else { 9 };
    }
    assert_eq!(first, PARAMETERS);
}

#[test]
fn single_precision_is_as_good_as_double_of_the_same_tracked_frames() {
    let tree = human();
    let frames = tracked_frames_of(&tree, 6000, RATE_HZ, NOISE, 2);
    let settings = settings_of(&tree);
    let (bus, gate) = FrameBus::new(frames.clone(), RATE_HZ);
    let mut mcu = InProcess::on(Box::new(bus));
    let (rows, mut device) = run(&mut mcu, &gate, &settings);
    let counters = device.counters().frames;
    assert_eq!((counters.frames, counters.absorbed, counters.missing, counters.damaged), (6000, 6000, 0, 0));
    assert_eq!(rows.iter().map(|r| r.rows).sum::<u32>(), 6 * (6001 - TAPS));
    as_good_as(&merged(&rows), &batch(&frames, &settings));
}

#[test]
fn frames_on_both_sides_of_a_gap_make_no_rows_together() {
    let tree = human();
    let all = tracked_frames_of(&tree, 300, RATE_HZ, NOISE, 3);
    let settings = settings_of(&tree);
    let rows_of = |frames: &[Vec<u8>]| {
        let (bus, gate) = FrameBus::new(frames.to_vec(), RATE_HZ);
        let mut mcu = InProcess::on(Box::new(bus));
        let (rows, mut device) = run(&mut mcu, &gate, &settings);
        (rows, device.counters().frames)
    };
    let spoiled = |bytes: &[u8]| {
        let frame = tree_frame::TrackedFrame::decode(bytes, 15).unwrap();
        let (mut base, links) = (frame.base, frame.links().collect::<Vec<_>>());
        base[8] = f32::NAN;
        let mut out = vec![0; 700];
        let n = tree_frame::TrackedFrame::encode(frame.number, &base, &links, &mut out).unwrap();
        out.truncate(n);
        out
    };
    // Three that never come, one that is no frame.
    let mut with_gaps = all.clone();
    with_gaps[200] = spoiled(&all[200]);
    with_gaps.drain(100..103);
    let (rows, counters) = rows_of(&with_gaps);
    assert_eq!((counters.missing, counters.not_finite, counters.absorbed), (3, 1, 296));
    let of = |n: u32| 6 * (n + 1 - TAPS);
    assert_eq!(rows.iter().map(|r| r.rows).sum::<u32>(), of(100) + of(97) + of(99));
    // Rejected or never sent is the same.
    let mut never = with_gaps.clone();
    never.remove(197);
    assert_eq!(bits(&rows_of(&never).0), bits(&rows));
}

#[test]
#[ignore = "needs the emulated board"]
fn the_emulated_processor_gives_the_same_bits_of_a_tracked_human() {
    let tree = human();
    let frames = tracked_frames_of(&tree, 151, RATE_HZ, NOISE, 1);
    let settings = settings_of(&tree);
    let (here, there) = here_and_there(frames, RATE_HZ, &settings);
    assert_eq!(bits(&here), bits(&there));
}

#[test]
fn a_filter_that_cannot_be_is_named() {
    let tree = human();
    let good = settings_of(&tree);
    let (bus, _) = FrameBus::new(Vec::new(), RATE_HZ);
    let mut mcu = InProcess::on(Box::new(bus));
    let mut device = Device::greet(&mut mcu);
    for bad in [
        Settings { filter_width_s: 0.0, ..good.clone() },
        Settings { filter_width_s: f32::NAN, ..good.clone() },
        // More frames than there is room for.
        Settings { rate_hz: 1000.0, ..good.clone() },
        Settings { row_every: 0, ..good.clone() },
    ] {
        let said = device.ask(&Command::Configure(bad.clone()));
        assert_eq!(said, Err(ErrorCode::BadSetting(SettingName::Filter)), "{bad:?}");
    }
    assert_eq!(device.ask(&Command::Configure(good)), Ok(Reply::Done));
}
