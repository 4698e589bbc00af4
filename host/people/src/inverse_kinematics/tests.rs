//! Recorded people: joint centres against those that the laboratories' own software wrote into the same
//! files.

use std::path::PathBuf;

use nalgebra::Vector3;

use super::solve::Solver;
use super::subject::{HumanModel, Known, Subject, subject};
use rigident_io::motion_capture::trial::Trial;

/// Links, points of the file, and how far they may be apart, m.
type Limits = &'static [(&'static str, &'static str, f64)];

type Frames = Vec<Vec<Option<Vector3<f64>>>>;

fn recorded(folder: &str, file: &str) -> Trial {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(folder).join(file);
    Trial::read(&path, None).unwrap()
}

/// Returns some frames of a trial, markers in the order of `labels`.
fn frames(trial: &Trial, labels: &[String], count: usize) -> Frames {
    let own: Vec<Option<usize>> = labels.iter().map(|l| trial.labels.iter().position(|k| k == l)).collect();
    let step = trial.frames() / count;
    (0..count).map(|k| own.iter().map(|l| l.and_then(|l| trial.point(k * step, l))).collect()).collect()
}

/// Returns the root mean square of the distance of a link's joint from a point of the file, m.
fn distance(found: &Subject, trial: &Trial, link: &str, point: &str) -> f64 {
    let link = found.model.link(link).unwrap();
    let point = trial.labels.iter().position(|l| l == point).unwrap();
    let mut solver = Solver::new(&found.skeleton, &found.markers);
    let labels: Vec<usize> =
        found.markers.iter().map(|m| trial.labels.iter().position(|l| *l == m.name).unwrap()).collect();
    let (mut sum, mut count) = (0.0, 0);
    let mut last = None;
    for frame in 0..trial.frames() {
        let seen = labels.iter().map(|l| trial.point(frame, *l)).collect();
        let Some(start) = last.clone().or_else(|| found.first_pose(&seen)) else { continue };
        let Some(solved) = solver.solve(&seen, &start) else { continue };
        if let Some(there) = trial.point(frame, point) {
            sum += (found.skeleton.places(&solved.pose)[link].1 - there).norm_squared();
            count += 1;
        }
        last = Some(solved.pose);
    }
    (sum / f64::from(count)).sqrt()
}

#[test]
#[ignore = "needs ../shared/data"]
fn joint_centres_of_shared_data_are_where_functional_motion_and_the_laboratory_have_them() {
    // Centres of the hips that functional motion gave (the laboratory's SCoRE), ankles of Plug-in Gait; and
    // Plug-in Gait's of another person. Regressions of hips are good to 10 to 20 mm.
    let cases: [(&str, [&str; 2], f64, Limits); 2] = [
        (
            "human_btk_pig_60kg_functional",
            ["FunctionalStatic.c3d", "FunctionalWalk.c3d"],
            1.68,
            &[
                ("r_thigh", "RightHipCenterScore", 0.02),
                ("l_thigh", "LeftHipCenterScore", 0.02),
                ("l_foot", "LTIO", 0.02),
                ("r_foot", "RTIO", 0.02),
            ],
        ),
        (
            "human_btk_pig_47kg_fullbody",
            ["PiG_Calibration-FlatFoot-Full.c3d", "PiG_Motion-FlatFoot-Full.c3d"],
            1.505,
            &[
                ("l_shank", "LFEO", 0.02),
                ("r_shank", "RFEO", 0.02),
                ("l_foot", "LTIO", 0.02),
                ("r_foot", "RTIO", 0.02),
            ],
        ),
    ];
    for (folder, files, stature, wanted) in cases {
        let [standing, moving] = files.map(|file| recorded(folder, file));
        let labels = moving.labels.clone();
        let mut all = frames(&standing, &labels, 4);
        all.extend(frames(&moving, &labels, 60));
        for kind in [HumanModel::Human34, HumanModel::Human58] {
            let known = Known { mass_kg: 60.0, ..Known::default() };
            let found = subject(&labels, &all, kind, &known).unwrap();
            assert!((found.person.height_m / stature - 1.0).abs() < 0.05, "{}", found.person.height_m);
            assert!(found.rms_m < 0.007, "{}", found.rms_m);
            for (link, point, limit) in wanted {
                let away = distance(&found, &moving, link, point);
                assert!(away < *limit, "{kind:?}, {link}: {away} m");
            }
        }
    }
}

/// Markers of a whole body, by names that are in use.
#[rustfmt::skip]
const MARKERS: [&str; 44] = [
    "LASI", "RASI", "LPSI", "RPSI", "C7", "T10", "CLAV", "STRN",
    "LSHO", "RSHO", "LFHD", "RFHD", "LBHD", "RBHD", "LTHI", "RTHI",
    "LKNE", "RKNE", "LTIB", "RTIB", "LANK", "RANK", "LHEE", "RHEE",
    "LTOE", "RTOE", "L.MT5", "R.MT5", "LUPA", "RUPA", "LELB", "RELB",
    "LFRA", "RFRA", "LWRA", "RWRA", "LWRB", "RWRB", "LFIN", "RFIN",
    "L.Knee.Med", "R.Knee.Med", "L.Ankle.Med", "R.Ankle.Med",
];

#[test]
fn poses_and_joint_centres_come_out_of_markers_that_were_made_of_them() {
    use super::calibrate::calibrate;
    use super::landmarks::attach;
    use super::skeleton::{Pose, Skeleton};
    use rigident_model::human::Person;

    let model = Person::default().human34().unwrap();
    let truth = Skeleton::new(&model).unwrap();
    let labels: Vec<String> = MARKERS.iter().map(|n| (*n).to_owned()).collect();
    let markers = attach(&model, &truth, &labels, 1.741);
    assert_eq!(markers.len(), labels.len());
    let pose = |k: usize| -> Pose {
        let step: Vec<f64> =
            (0..truth.freedoms()).map(|i| 0.4 * (0.7 * k as f64 + 1.3 * i as f64).sin()).collect();
        truth.step(&truth.zero(), &step)
    };
    let poses: Vec<Pose> = (0..30).map(pose).collect();
    let seen: Vec<Vec<Option<Vector3<f64>>>> = poses
        .iter()
        .map(|pose| {
            let places = truth.places(pose);
            markers.iter().map(|m| Some(places[m.link].1 + places[m.link].0 * m.position_m)).collect()
        })
        .collect();
    // A pose alone, from one nearby, is found but for the weak preference of zero: 6 mm of skin against 1
    // rad.
    let mut solver = Solver::new(&truth, &markers);
    for k in 1..30 {
        let solved = solver.solve(&seen[k], &poses[k - 1]).unwrap();
        let worst = solved.distances_m.iter().flatten().fold(0.0_f64, |m, d| m.max(*d));
        assert!(worst < 1e-3, "{k}: {worst}");
    }
    // Joints that begin 15 mm off come back to a third of that and nearer, where little is known of them
    // beforehand.
    let mut off = truth.clone();
    let hips = [model.link("l_thigh").unwrap(), model.link("r_thigh").unwrap()];
    hips.iter().for_each(|hip| off.shift(*hip, &Vector3::new(0.010, -0.008, 0.008)));
    let sigma = vec![[0.05; 3]; model.links.len() - 1];
    let found = calibrate(&off, &markers, &sigma, &seen, &poses).unwrap();
    for hip in hips {
        let away = (found.skeleton.links()[hip].position - truth.links()[hip].position).norm();
        assert!(away < 0.005, "{away}");
    }
}
