//! Attitudes and accelerometer that disagree on gravity are reported, and those that agree are not.

use rigident::problem::clocks::{StreamSet, align};
use rigident::rig::RigFile;

use super::simulated::{slow_turn, thesis};

fn warned(rig: &str, files: &[Vec<u8>; 3]) -> Option<String> {
    let set = StreamSet::from_bytes("simulated", &RigFile::parse(rig).unwrap(), files).unwrap();
    align(&set, None).unwrap().warnings.into_iter().find(|w| w.contains("gravity by the attitudes"))
}

/// The file's stamps later by this.
fn later(file: &[u8], by_s: f64) -> Vec<u8> {
    let text = String::from_utf8(file.to_vec()).unwrap();
    let (header, rows) = text.split_once('\n').unwrap();
    let mut late = format!("{header}\n");
    for row in rows.lines() {
        let (t, rest) = row.split_once(',').unwrap();
        late.push_str(&format!("{:.7},{rest}\n", t.parse::<f64>().unwrap() + by_s));
    }
    late.into_bytes()
}

#[test]
fn attitudes_that_fit_give_no_warning_however_lively_the_motion() {
    for seed in 1..=3 {
        for simulated in [thesis(), slow_turn()] {
            let (rig, files) = simulated.files(seed, 5e-5);
            assert_eq!(warned(&rig, &files), None, "seed {seed}");
        }
    }
}

#[test]
fn a_wrong_frame_and_a_clock_far_off_are_reported() {
    for simulated in [thesis(), slow_turn()] {
        let (rig, [wrench, imu, attitude]) = simulated.files(1, 5e-5);
        let files = [wrench, imu, attitude];
        let words = warned(&rig.replace("S in A", "A in S"), &files).expect("the transposed matrices");
        assert!(words.contains("attitude.csv") && words.contains("rotation_matrix"), "{words}");
        // A quarter of a turn of the IMU about its z.
        let wrong = rig.replace("rotation_wxyz = [", "rotation_wxyz = [0.8, 0.0, 0.0, 0.6] # [");
        assert!(warned(&wrong, &files).is_some());
    }
    // Beyond the half second that the search reaches.
    let (rig, [wrench, imu, attitude]) = slow_turn().files(1, 5e-5);
    assert!(warned(&rig, &[wrench, imu, later(&attitude, 0.8)]).is_some());
}
