use rigident_shared::estimator::watch::{
    Change, Watch, WatchConfig, WatchFoot, WatchFrame as Given, WatchLink, turned,
};
use rigident_shared::tree::Link;

use super::*;
use crate::study_length::runs;
use rigident_laboratory::picks_up::{HAND, PicksUp, RATE_HZ};

/// Returns the watch of these settings as the firmware makes it, in any precision.
fn watch<T: rigident_shared::Scalar>(robot: &WatchedRobot) -> Box<Watch<T>> {
    let ModelSettings::Watch(stated) = &robot.settings.model else { panic!("a watch") };
    let [s, r] = [robot.settings.load_cell.noise_n_nm, robot.settings.load_cell.range_n_nm];
    let config = WatchConfig {
        links: stated.links,
        watched: stated.watched,
        rate_hz: T::from_f32(robot.settings.rate_hz),
        // A tenth in single precision is more than one, and then the filter two frames longer in double.
        width_s: T::from_f64_const(0.1),
        row_every: robot.settings.row_every,
        channel_sigma: s.map(T::from_f32),
        range: r.map(T::from_f32),
        limit: T::from_f32(stated.limit),
        settle: stated.settle_bins,
        forget_s: T::from_f32(stated.forget_s),
    };
    let feet: Vec<WatchFoot<T>> = stated.feet[..usize::from(stated.foot_count)]
        .iter()
        .map(|f| WatchFoot {
            link: f.link,
            rotation: turned(f.rotation_wxyz.map(T::from_f32)).unwrap(),
            position: f.position_m.map(T::from_f32).into(),
        })
        .collect();
    let mut watch = Box::new(Watch::UNUSED);
    watch.set_up(&config, &feet).unwrap();
    for (i, l) in robot.links.iter().enumerate() {
        let axis = l.axis.map(T::from_f32).into();
        let joint = match l.joint {
            WatchJoint::Fixed => Joint::Fixed,
            WatchJoint::Revolute => Joint::Revolute(axis),
            WatchJoint::Prismatic => Joint::Prismatic(axis),
        };
        let link = Link {
            parent: usize::from(l.parent),
            joint,
            rotation: turned(l.rotation_wxyz.map(T::from_f32)).unwrap(),
            position: l.position_m.map(T::from_f32).into(),
        };
        watch.set_link(i as u8, &WatchLink { link, parameters: l.parameters.map(T::from_f32) }).unwrap();
    }
    watch
}

/// Returns the changes that it reports.
fn changes<T: rigident_shared::Scalar>(robot: &WatchedRobot) -> (Vec<Change<T>>, Box<Watch<T>>) {
    let mut watch = watch::<T>(robot);
    let mut all = Vec::new();
    for frame in &robot.frames {
        let frame = WatchFrame::decode(&frame.payload, robot.links.len(), robot.feet()).unwrap();
        let imu = frame.imu.map(T::from_f32);
        let joints: Vec<[T; 2]> = frame.joints().map(|joint| joint.map(T::from_f32)).collect();
        let wrenches: Vec<[T; 6]> = frame.feet().map(|wrench| wrench.map(T::from_f32)).collect();
        let given = Given {
            number: frame.number,
            specific_force: [imu[0], imu[1], imu[2]],
            rate: [imu[3], imu[4], imu[5]],
            joints: &joints,
            wrenches: &wrenches,
        };
        all.extend(watch.absorb(&given).unwrap());
    }
    (all, watch)
}

fn robot(case: &PicksUp) -> WatchedRobot {
    let (_, input, _) = case.input().unwrap();
    WatchedRobot::new(&input, HAND, &WatchOptions::default()).unwrap()
}

/// Returns the time from the change until it is found, s; whether the interval of time holds it; errors of
/// mass and first moment in 1 σ.
fn judged(change: (&Change<f32>, &Change<f32>), at_s: f64, wanted: &[f64; 10]) -> (f64, bool, [f64; 4]) {
    let (found, measured) = change;
    let (size, sd) = measured.size.unwrap();
    let [from, to] = measured.between.map(|number| f64::from(number) / RATE_HZ);
    let errors = std::array::from_fn(|k| (f64::from(size[k]) - wanted[k]) / f64::from(sd[k]));
    (f64::from(found.found) / RATE_HZ - at_s, from <= at_s && at_s <= to, errors)
}

#[test]
fn loads_picked_up_and_dropped_are_found_with_their_size() {
    let (mut inside, mut of, mut in_time) = (0_u32, 0_u32, 0_u32);
    for (seed, off) in (1..=runs(4, 1)).flat_map(|seed| [(seed, 0.0), (seed, 0.03)]) {
        let holds = [30.0, 40.0];
        let case = PicksUp { holds_s: Some(holds), seconds: 46.0, off, seed, ..PicksUp::default() };
        let (found, watch) = changes::<f32>(&robot(&case));
        assert_eq!((watch.changes(), found.len()), (2, 4), "seed {seed} off {off}: {found:?}");
        for (pair, (at_s, sign)) in found.as_chunks::<2>().0.iter().zip([(holds[0], 1.0), (holds[1], -1.0)]) {
            let wanted = case.thing().map(|value| sign * value);
            let (late, time_inside, errors) = judged((&pair[0], &pair[1]), at_s, &wanted);
            assert!((0.0..0.5).contains(&late), "seed {seed} off {off}: {late} s");
            in_time += u32::from(time_inside);
            for error in errors {
                // Once in 15 000 of a normal error.
                assert!(error.abs() < 4.0, "seed {seed} off {off}: {errors:?}");
                inside += u32::from(error.abs() < 1.96);
                of += 1;
            }
        }
    }
    // 95 % of 16 errors a seed and three binomial standard deviations; and times, four a seed.
    let all = f64::from(of);
    let least = 0.95 * all - 3.0 * (all * 0.95 * 0.05).sqrt();
    assert!(f64::from(inside) >= least.floor() && 8 * in_time >= 7 * (of / 4), "{inside} of {of}, {in_time}");
}

#[test]
fn nothing_is_reported_where_nothing_changes() {
    for (seed, off) in (101..=100 + runs(4, 1)).flat_map(|seed| [(seed, 0.0), (seed, 0.03), (seed, 0.06)]) {
        let (found, watch) =
            changes::<f32>(&robot(&PicksUp { seconds: 60.0, off, seed, ..PicksUp::default() }));
        assert!(watch.is_settled() && found.is_empty(), "seed {seed} off {off}: {found:?}");
    }
}

#[test]
fn single_precision_agrees_with_double() {
    let case = PicksUp { holds_s: Some([30.0, 99.0]), seconds: 34.0, ..PicksUp::default() };
    let robot = robot(&case);
    let (single, double) = (changes::<f32>(&robot).0, changes::<f64>(&robot).0);
    assert_eq!((single.len(), double.len()), (2, 2));
    assert_eq!((single[1].found, single[1].between), (double[1].found, double[1].between));
    let ((size, sd), (exact, exact_sd)) = (single[1].size.unwrap(), double[1].size.unwrap());
    for k in 0..10 {
        let error = (f64::from(size[k]) - exact[k]).abs();
        assert!(
            error < 0.05 * exact_sd[k] && (f64::from(sd[k]) / exact_sd[k] - 1.0).abs() < 0.05,
            "{k}: {error}"
        );
    }
}

#[test]
fn a_model_that_does_not_fit_the_device_is_named() {
    let (_, input, _) = PicksUp { seconds: 0.1, ..PicksUp::default() }.input().unwrap();
    let said = |input: &Input, link: &str| {
        WatchedRobot::new(input, link, &WatchOptions::default()).unwrap_err().to_string()
    };
    assert!(said(&input, "tail").contains("no link tail; its links are pelvis"));
    let mut blind = input.clone();
    blind.contact.as_mut().unwrap().feet[1].measured[4] = false;
    assert!(said(&blind, HAND).contains("my of foot r_foot"));
    let mut weightless = input.clone();
    weightless.model.links[3].nominal = None;
    assert!(said(&weightless, HAND).contains("thigh"));
    let slow = Input { rate_hz: 50.0, ..input };
    assert!(said(&slow, HAND).contains("50 frames"));
}

/// The base's parameters about the IMU are those of the same body: kinetic energy of any motion is the same.
#[test]
fn a_base_about_its_imu_is_the_same_body() {
    let phi = [3.0, 0.3, -0.2, 0.4, 0.5, 0.6, 0.7, 0.02, -0.03, 0.04];
    let own = InertialParameters::<Body, f64>::from_vector(phi);
    let energy = |[m, cx, cy, cz, xx, yy, zz, yz, xz, xy]: [f64; 10], v: Vector3<f64>, w: Vector3<f64>| {
        let tensor = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        0.5 * m * v.norm_squared() + v.dot(&w.cross(&Vector3::new(cx, cy, cz))) + 0.5 * w.dot(&(tensor * w))
    };
    let by = Vector3::new(0.2, -0.1, 0.3);
    let (v, w) = (Vector3::new(0.4, -1.2, 0.7), Vector3::new(2.0, -0.6, 1.1));
    let (here, there) = (energy(phi, v, w), energy(moved(&own, &by), v + w.cross(&by), w));
    assert!((here - there).abs() < 1e-12 * here, "{here} {there}");
}

#[test]
fn the_line_must_carry_the_frames() {
    let (_, input, _) = PicksUp { seconds: 0.1, ..PicksUp::default() }.input().unwrap();
    let robot = WatchedRobot::new(&input, HAND, &WatchOptions::default()).unwrap();
    // 31 links, two feet: 6 + 6·4 + 2·24 + 30·8 bytes, header and check of 8, COBS of 2, a zero; 10 bits
    // each.
    let need = crate::session::streamed::line_need(&robot.frames, RATE_HZ);
    assert!((need - 10.0 * 329.0 * RATE_HZ).abs() < 10.0 * RATE_HZ + 1.0, "{need}");
}

#[test]
fn wrenches_that_are_not_the_weight_are_refused() {
    let (_, mut input, _) = PicksUp::default().input().unwrap();
    assert!(WatchedRobot::new(&input, HAND, &WatchOptions::default()).is_ok());
    // In kgf.
    for frame in &mut input.frames {
        frame.ground.wrenches.iter_mut().flatten().for_each(|v| *v /= 9.806_65);
    }
    let refused = WatchedRobot::new(&input, HAND, &WatchOptions::default());
    assert!(
        matches!(refused, Err(WatchError::Weight(pushed, weight)) if (8.0..12.0).contains(&(weight / pushed))),
        "{refused:?}"
    );
}

#[cfg(feature = "simulator")]
#[path = "watched_firmware_tests.rs"]
mod on_the_firmware;
