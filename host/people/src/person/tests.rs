//! Recorded people: masses by moving trials against the plates' of standing ones.

use std::path::PathBuf;

use super::contact::Dropped;
use super::*;
use rigident_io::motion_capture::trial::Trial;

fn trial(folder: &str, file: &str, ground: Option<&str>) -> Trial {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(folder);
    let ground = ground.map(|name| folder.join(name));
    Trial::read(&folder.join(file), ground.as_deref()).unwrap()
}

fn person(trial: Trial, standing: Option<Trial>, height_m: f64) -> Person {
    let options = PeopleOptions { height_m: Some(height_m), ..PeopleOptions::default() };
    Person::new(&mut [trial], standing.as_ref(), &options, &|_, _| ()).unwrap()
}

/// Times between which frames are used, from the first frame on, s.
fn used(person: &Person) -> (f64, f64) {
    let trial = &person.trials[0];
    let at = |frame: Option<&track::UsedFrame>| trial.time_ns(frame.unwrap().number) as f64 * 1e-9;
    (at(trial.frames.first()), at(trial.frames.last()))
}

#[test]
#[ignore = "needs ../shared/data"]
fn only_frames_of_shared_data_with_all_contact_on_the_plates_are_used() {
    // On the ground: steps on the first plate at 1.06 s, and off the last one at 2.77 s.
    let folder = "human_btk_pig_60kg_functional";
    let walk = person(
        trial(folder, "FunctionalWalk.c3d", None),
        Some(trial(folder, "FunctionalStatic.c3d", None)),
        1.68,
    );
    let (from, to) = used(&walk);
    assert!(from > 1.06 && to < 2.77 && to - from > 0.8, "{from} {to}");
    assert!(walk.trials[0].report.dropped[&Dropped::FootOff] > 100);
    assert!(walk.subject.unseen_trunk.is_some() && walk.fixed.contains(&"head".to_owned()));
    // There are no corners. The left foot is on its plate from 0.836 to 1.590 s, the right one from 0.266 to
    // 1.024 and from 1.411 s: a stride of 1.145 s, so that the left foot left the floor at 0.445 s, and comes
    // back at 1.981 s.
    let folder = "human_rajagopal2016_walk";
    let walk = person(trial(folder, "markers_walk.trc", Some("grf_walk.mot")), None, 1.8);
    let (from, to) = used(&walk);
    assert!(from > 0.445 - 0.02 && to < 1.981 && to - from > 1.4, "{from} {to}");
    let stride_s = strides::period_s(&walk.trials[0]).unwrap();
    assert!((stride_s - 1.145).abs() < 0.015, "{stride_s}");
    // A treadmill measures every frame.
    let folder = "human_gait2354_subject01_walk";
    let standing = trial(folder, "subject01_static.trc", None);
    let walk = person(trial(folder, "subject01_walk1.trc", None), Some(standing), 1.8);
    assert!(walk.trials[0].frames.len() > 120, "{:?}", walk.trials[0].report);
}

#[test]
#[ignore = "needs ../shared/data"]
fn plates_of_shared_data_in_another_frame_are_refused_in_words() {
    let folder = "human_btk_pig_60kg_functional";
    let mut walk = trial(folder, "FunctionalWalk.c3d", None);
    for plate in &mut walk.ground {
        for w in &mut plate.wrench {
            // The plates a metre further to the left.
            w[3] += w[2];
            w[5] -= w[0];
        }
    }
    let standing = trial(folder, "FunctionalStatic.c3d", None);
    let error =
        Person::new(&mut [walk], Some(&standing), &PeopleOptions::default(), &|_, _| ()).err().unwrap();
    assert!(error.to_string().contains("another frame than the markers"), "{error}");
}
