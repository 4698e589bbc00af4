//! Joints that are locked are where the recording has them, or where it was said.

use rigident::model::base::{Rows, Situation, base_parameters};

use super::*;

/// Largest error of what is identified over its U95, against the arm locked at an angle.
fn largest_error(found: &Value, angle: f64) -> f64 {
    let rig = tempfile::tempdir().unwrap();
    std::fs::write(rig.path().join("arm.urdf"), ARM).unwrap();
    let mut truth = open(rig.path().join("arm.urdf").to_str().unwrap(), &Person::default()).unwrap().0;
    truth.lock(&[format!("elbow={angle}")]).unwrap();
    let truth = truth.welded();
    let situation = Situation { floating: false, rows: Rows::Joint, mimic: false };
    let base = base_parameters(&truth, &situation).unwrap();
    let nominal = truth.nominal();
    let skip = nominal.len() - base.standard.len();
    let mut largest: f64 = 0.0;
    for parameter in base.parameters {
        let value: f64 = parameter.terms.iter().map(|(c, w)| w * nominal[skip + c]).sum();
        let got = found["parameters"]
            .as_array()
            .unwrap()
            .iter()
            .find(|p| p["name"] == parameter.name.as_str())
            .unwrap();
        let (Some(estimate), Some(u95)) = (got["value"].as_f64(), got["u95"].as_f64()) else { continue };
        largest = largest.max((estimate - value).abs() / u95);
    }
    largest
}

fn warnings(found: &Value) -> String {
    in_words(found)
}

#[test]
fn a_joint_that_is_held_is_locked_where_the_recording_has_it() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 1);
    let identified = |lock: &str, out: &str| {
        let words = ["identify", "arm.csv", "--model", "arm.urdf", "--lock", lock, "--json", "--out", out];
        answer(&rigident(place.path(), &[&words[..], &FRICTION].concat()))
    };
    let found = identified("elbow", "a");
    assert!(
        warnings(&found).contains("joint elbow is locked at 0.3000 rad, where column elbow_rad has it"),
        "{found:#}"
    );
    // Seven parameters: three times U95 is six standard deviations.
    assert!(largest_error(&found, 0.3) < 3.0, "{}", largest_error(&found, 0.3));
    // At zero, where it was not, that is another body.
    let zero = identified("elbow=0", "b");
    assert!(warnings(&zero).contains("at 0 rad as stated; column elbow_rad has it at 0.3000"), "{zero:#}");
    assert!(largest_error(&zero, 0.0) > 3.0, "{}", largest_error(&zero, 0.0));
    // Without its column the angle can be stated, and otherwise is zero and said to be.
    let csv = std::fs::read_to_string(place.path().join("arm.csv")).unwrap();
    std::fs::write(place.path().join("arm.csv"), csv.replace("elbow_rad", "other")).unwrap();
    let stated = identified("elbow=0.3", "c");
    assert!(largest_error(&stated, 0.3) < 3.0);
    assert!(!warnings(&stated).contains("locked"), "{stated:#}");
    let silent = identified("elbow", "d");
    assert!(
        warnings(&silent).contains("elbow is locked at zero: the recording has no column of it"),
        "{silent:#}"
    );
}

#[test]
fn a_joint_that_moves_cannot_be_locked() {
    let place = tempfile::tempdir().unwrap();
    arm_recording(place.path(), 2);
    for lock in ["elbow", "elbow=0.3"] {
        let words = ["identify", "arm.csv", "--model", "arm.urdf", "--lock", lock, "--out", "never"];
        let said = complaint(&rigident(place.path(), &words));
        assert!(said.contains("--lock elbow: column elbow_rad in arm.csv moves, from -"), "{said}");
        assert!(!place.path().join("never").exists());
    }
}

/// The arm of two IMUs does move.
#[test]
fn attitudes_show_that_a_link_moves() {
    let place = tempfile::tempdir().unwrap();
    two_links(place.path(), Vector3::z());
    let said = complaint(&rigident(place.path(), &["identify", "two.csv", "--lock", "arm", "--out", "o"]));
    assert!(said.contains("--lock arm: the attitude q1_w … q1_z in two.csv moves"), "{said}");
}
