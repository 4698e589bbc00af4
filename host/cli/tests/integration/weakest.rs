//! Motions that lack something are reported, in words, and those that lack nothing are not.
#![cfg(feature = "simulator")]

use hexapod::experiment::{THESIS_POSES_DEG, thesis_program};
use hexapod::{Axis, MotionProgram, Pose, Segment, SineTerm};
use rigident::answer::result::ParameterState;
use rigident::answer::{Answer, Context};
use rigident::fit::Fit;
use rigident::laboratory::{mounting, reading};
use rigident::rig::FROZEN_AFTER;
use rigident::rows::body::Input;
use rigident_shared::calibration::Reading;
use rigident_shared::screening::Limits;
use rigident_sim::rig::{Readings, RigConfig};
use rigident_sim::sensors::SensorModels;

use crate::fitting::{fit_body, states};

/// Axis, Hz, phase in rad.
type Sine = (Axis, f64, f64);

const RATE_HZ: f64 = 200.0;
/// Thesis, Table 1: 95 % figures over 1.96.
const SIGMA: [f64; 6] = [9.9 / 1.96, 9.9 / 1.96, 19.8 / 1.96, 0.75 / 1.96, 0.9 / 1.96, 0.9 / 1.96];

fn ideal_rig() -> RigConfig {
    RigConfig::thesis_horizontal().with_sensors(SensorModels::ideal())
}

/// Returns what perfect sensors read in a motion.
fn ideal(config: &RigConfig, program: &MotionProgram) -> Vec<Reading<f64>> {
    Readings::new(config, program, RATE_HZ).unwrap().ideal().iter().map(reading).collect()
}

fn tilted(geometry_home: Pose, [roll, pitch]: [f64; 2]) -> Pose {
    Pose { rpy_rad: [roll.to_radians(), pitch.to_radians(), 0.0], ..geometry_home }
}

/// Still poses of 20 s each, without the moves between them.
fn still(poses_deg: &[[f64; 2]]) -> Vec<Reading<f64>> {
    let config = ideal_rig();
    let pose = |pose: &[f64; 2]| {
        let start = tilted(config.geometry.home(), *pose);
        ideal(&config, &MotionProgram { start, segments: vec![Segment::Hold { duration_s: 20.0 }] })
    };
    poses_deg.iter().map(pose).fold(Vec::new(), joined)
}

/// Sines of `(axis, Hz, phase)`, each of 0.36 rad/s, about the level pose.
fn turning(duration_s: f64, sines: &[Sine]) -> Vec<Reading<f64>> {
    let config = ideal_rig();
    let term = |&(axis, frequency_hz, phase_rad): &Sine| SineTerm {
        axis,
        amplitude: 0.36 / (std::f64::consts::TAU * frequency_hz),
        frequency_hz,
        phase_rad,
    };
    let terms = sines.iter().map(term).collect();
    let segments = vec![Segment::Multisine { duration_s, ramp_s: 1.0, terms }];
    ideal(&config, &MotionProgram { start: config.geometry.home(), segments })
}

/// One motion after another, a gap in time between them.
fn joined(mut a: Vec<Reading<f64>>, b: Vec<Reading<f64>>) -> Vec<Reading<f64>> {
    let start_ns = a.last().map_or(0, |r| r.time_ns + 1_000_000_000);
    a.extend(b.into_iter().map(|r| Reading { time_ns: start_ns + r.time_ns, ..r }));
    a
}

/// Advice, and which parameters are identified; σ are the thesis'.
fn advised(readings: &[Reading<f64>], knows_offset: bool) -> (Vec<String>, Vec<bool>) {
    let input = Input {
        readings: readings.to_vec(),
        is_static: false,
        rate_hz: RATE_HZ,
        mounting: mounting(&ideal_rig()),
        channel_sigma: Some(SIGMA),
        gyro_sigma: Some(0.0),
        known_offset: knows_offset.then_some([0.0; 6]),
        nuisances: Vec::new(),
        rests: Vec::new(),
        beforehand: None,
        limits: Limits::none(),
    };
    let fit = fit_body(&input);
    let identified = states(&fit).iter().map(|s| matches!(s, ParameterState::Identified(_))).collect();
    (advice(&fit), identified)
}

fn advice(fit: &Fit) -> Vec<String> {
    Answer::new(fit, Context::default()).unwrap().advice
}

const ROLL: [Sine; 3] = [(Axis::Roll, 0.55, 4.59), (Axis::Roll, 1.15, 5.51), (Axis::Roll, 1.95, 5.92)];
const PITCH: [Sine; 3] = [(Axis::Pitch, 0.65, 5.11), (Axis::Pitch, 1.35, 0.93), (Axis::Pitch, 2.15, 4.63)];
const YAW: [Sine; 3] = [(Axis::Yaw, 0.75, 0.69), (Axis::Yaw, 1.55, 0.42), (Axis::Yaw, 2.35, 1.93)];
/// A cone about the vertical at 0.4 Hz.
const CONE: [Sine; 2] = [(Axis::Roll, 0.4, 0.0), (Axis::Pitch, 0.4, std::f64::consts::FRAC_PI_2)];

/// Each sentence begins as expected, in this order, and there is no other.
#[track_caller]
fn says(readings: &[Reading<f64>], expected: &[&str]) {
    says_with(readings, false, expected);
}

#[track_caller]
fn says_with(readings: &[Reading<f64>], knows_offset: bool, expected: &[&str]) {
    let (sentences, identified) = advised(readings, knows_offset);
    assert!(
        sentences.len() == expected.len() && sentences.iter().zip(expected).all(|(s, e)| s.starts_with(e)),
        "{sentences:#?}\nin place of {expected:#?}; identified: {identified:?}"
    );
    assert_eq!(identified.iter().all(|i| *i), expected.is_empty(), "{identified:?}");
}

#[test]
fn still_poses_lack_rotation_and_too_few_of_them_lack_tilt() {
    let no_rotation = "no rotation to and fro about S.x, S.y or S.z that is fast enough: turn the body about \
                       S.x, S.y and S.z";
    says(&still(&[[0.0, 0.0]]), &["one still pose only: hold the body still in three or more attitudes"]);
    says(&still(&[[10.0, 5.0]; 3]), &["one still pose only"]);
    let along_y = "no tilt about S.y: the centre of mass along S.y cannot be distinguished from the wrench \
                   offset";
    says(&still(&[[20.0, 0.0], [-20.0, 0.0]]), &[along_y, no_rotation]);
    let along_x = "no tilt about S.x: the centre of mass along S.x cannot be distinguished from the wrench \
                   offset";
    says(&still(&[[0.0, 20.0], [0.0, -20.0]]), &[along_x, no_rotation]);
    says(&still(&THESIS_POSES_DEG[..2]), &["no tilt about (-0.50, 0.87, 0.03) of S", no_rotation]);
    says(&still(&THESIS_POSES_DEG), &[no_rotation]);
}

#[test]
fn with_a_known_offset_one_attitude_lacks_the_centre_of_mass_along_gravity_and_two_lack_nothing_still() {
    let no_rotation = "no rotation to and fro about S.x, S.y or S.z";
    let no_tilt = "no tilt about S.x or S.y: gravity says nothing of the centre of mass along S.z";
    says_with(&still(&[[0.0, 0.0]]), true, &[no_tilt, no_rotation]);
    says_with(&still(&THESIS_POSES_DEG[..2]), true, &[no_rotation]);
}

#[test]
fn the_axes_without_rotation_are_named_and_no_others() {
    let poses = still(&THESIS_POSES_DEG);
    let cases: [(&[Sine], &str); 3] = [
        (&ROLL, "no rotation to and fro about S.y or S.z"),
        (&PITCH, "no rotation to and fro about S.x or S.z"),
        (&YAW, "no rotation to and fro about S.x or S.y"),
    ];
    for (sines, expected) in cases {
        says(&joined(turning(60.0, sines), poses.clone()), &[expected]);
    }
    // ω̇ × mc shows the first moments across the axis.
    let level = "no tilt about S.x or S.y: the mass and the centre of mass along S.z cannot be \
                 distinguished from the wrench offset";
    says(&turning(60.0, &YAW), &[level, "no rotation to and fro about S.x or S.y"]);
}

#[test]
fn roll_and_pitch_lack_yaw_until_their_coupling_brings_enough_of_it() {
    let both = [ROLL, PITCH].concat();
    let gently = turning(10.0, &[ROLL[1], PITCH[2]]);
    says(
        &joined(gently, still(&THESIS_POSES_DEG)),
        &["no rotation to and fro about S.z that is fast enough: turn the body about S.z"],
    );
    says(&turning(6.0, &both), &["too little rotation about S.z for this noise: "]);
    says(&turning(60.0, &both), &[]);
}

/// The promise of the sentence: 2.9 times as long is enough, and half of that is not.
#[test]
fn the_motion_asked_for_is_enough_and_not_far_too_much() {
    let both = [ROLL, PITCH].concat();
    let (sentences, _) = advised(&turning(6.0, &both), false);
    let words: Vec<&str> = sentences[0].split(' ').collect();
    let times = words.windows(4).find(|w| w[1..] == ["times", "as", "long,"]).map(|w| w[0]).unwrap();
    let times: f64 = times.parse().unwrap();
    // Ramps of 1 s each at either length.
    let lasting = |times: f64| 2.0 + 4.0 * times;
    assert!(advised(&turning(lasting(1.3 * times), &both), false).0.is_empty());
    assert!(!advised(&turning(lasting(0.6 * times), &both), false).0.is_empty());
}

#[test]
fn an_axis_between_those_of_s_is_named_by_its_components() {
    let both: Vec<_> =
        ROLL.iter().flat_map(|(_, f, p)| [(Axis::Roll, *f, *p), (Axis::Pitch, *f, *p)]).collect();
    says(&turning(20.0, &both), &["no rotation to and fro about (-0.71, 0.71, 0.00) of S"]);
}

#[test]
fn rotation_at_one_frequency_is_distinguished_from_missing_rotation() {
    let one = "all rotation about S.x and S.y is at one frequency: the tensor and the first moment are \
               collinear; add a second, well-separated frequency";
    let cone = turning(40.0, &CONE);
    says(&cone, &["too little rotation about S.z", one]);
    // Either remedy that the sentence names.
    says(&joined(cone, still(&THESIS_POSES_DEG)), &["too little rotation about S.z"]);
    let second = [&CONE[..], &[(Axis::Roll, 1.3, 0.0), (Axis::Pitch, 1.3, 1.0)]].concat();
    let (sentences, _) = advised(&turning(40.0, &second), false);
    assert!(!sentences.iter().any(|s| s.contains("frequency:")), "{sentences:?}");
}

/// Noise of all sensors, σ from the rig; the gyro's noise must not pass for rotation.
#[test]
fn measured_motions_bring_the_same_advice_and_the_demonstration_lacks_nothing() {
    let config = RigConfig::thesis_horizontal();
    let hints = |program: &MotionProgram| {
        let input = Input {
            readings: Readings::new(&config, program, RATE_HZ)
                .unwrap()
                .measured(3)
                .map(|r| reading(&r))
                .collect(),
            is_static: false,
            rate_hz: RATE_HZ,
            mounting: mounting(&config),
            channel_sigma: Some(SIGMA),
            gyro_sigma: None,
            known_offset: None,
            nuisances: Vec::new(),
            rests: Vec::new(),
            beforehand: None,
            limits: Limits { frozen_after: FROZEN_AFTER, ..Limits::none() },
        };
        advice(&fit_body(&input))
    };
    assert!(hints(&thesis_program(&config.geometry, 60.0)).is_empty());
    let hold =
        MotionProgram { start: config.geometry.home(), segments: vec![Segment::Hold { duration_s: 60.0 }] };
    let said = hints(&hold);
    assert!(said.len() == 1 && said[0].starts_with("one still pose only"), "{said:?}");
    let mut still = thesis_program(&config.geometry, 60.0);
    still.segments.retain(|s| !matches!(s, Segment::Multisine { .. }));
    let said = hints(&still);
    assert!(said.iter().any(|s| s.contains("rotation about S.z")), "{said:?}");
    assert!(!said.iter().any(|s| s.contains("tilt")), "{said:?}");
}
