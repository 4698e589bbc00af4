//! Sets of markers by the name of those who made them, and what a recording lacks of one.

use super::landmarks::{are_keypoints, places};

/// A set by its name and the names of its markers.
struct MarkerSet {
    name: &'static str,
    labels: &'static [&'static str],
}

/// Sets that are recognised by their names. Vicon, *Plug-in Gait Reference Guide*; Leboeuf et al., *pyCGM2*,
/// 2019; Qualisys, *QTM Marker Set Guide* (Sports); Leardini et al., *Gait & Posture* 26, 2007 (IOR); Uhlrich
/// et al., *OpenCap*, 2023; Cao et al., *OpenPose*, 2019 (BODY_25). Names are compared in capitals and
/// digits.
const SETS: &[MarkerSet] = &[
    MarkerSet {
        name: "Plug-in Gait",
        labels: &[
            "LASI", "RASI", "LPSI", "RPSI", "LTHI", "LKNE", "LTIB", "LANK", "LHEE", "LTOE", "RTHI", "RKNE",
            "RTIB", "RANK", "RHEE", "RTOE",
        ],
    },
    MarkerSet {
        name: "CGM2",
        labels: &[
            "LASI", "RASI", "LPSI", "RPSI", "LTHAP", "LTHAD", "LKNE", "LKNM", "LTIAP", "LTIAD", "LANK",
            "LMED", "LHEE", "LSMH", "LFMH", "LVMH", "RTHAP", "RTHAD", "RKNE", "RKNM", "RTIAP", "RTIAD",
            "RANK", "RMED", "RHEE", "RSMH", "RFMH", "RVMH",
        ],
    },
    MarkerSet {
        name: "Qualisys Sports",
        labels: &[
            "HEADL",
            "HEADFRONT",
            "HEADR",
            "LSHOULDERTOP",
            "RSHOULDERTOP",
            "LELBOWOUT",
            "RELBOWOUT",
            "LWRISTOUT",
            "RWRISTOUT",
            "WAISTLFRONT",
            "WAISTRFRONT",
            "LKNEEOUT",
            "RKNEEOUT",
            "LANKLEOUT",
            "RANKLEOUT",
            "LHEELBACK",
            "RHEELBACK",
            "LFOREFOOTOUT",
            "RFOREFOOTOUT",
        ],
    },
    MarkerSet {
        name: "IOR",
        labels: &[
            "LIAS", "RIAS", "LIPS", "RIPS", "LGT", "LLE", "LME", "LHF", "LTT", "LLM", "LMM", "LCA", "LFM",
            "LVM", "RGT", "RLE", "RME", "RHF", "RTT", "RLM", "RMM", "RCA", "RFM", "RVM",
        ],
    },
    MarkerSet {
        name: "OpenCap anatomical",
        labels: &[
            "RASISSTUDY",
            "LASISSTUDY",
            "RPSISSTUDY",
            "LPSISSTUDY",
            "RKNEESTUDY",
            "RMKNEESTUDY",
            "RANKLESTUDY",
            "RMANKLESTUDY",
            "RTOESTUDY",
            "R5METASTUDY",
            "RCALCSTUDY",
            "LKNEESTUDY",
            "LMKNEESTUDY",
            "LANKLESTUDY",
            "LMANKLESTUDY",
            "LTOESTUDY",
            "L5METASTUDY",
            "LCALCSTUDY",
        ],
    },
    MarkerSet {
        name: "keypoints (OpenPose, Theia, OpenCap)",
        labels: &[
            "NECK",
            "RSHOULDER",
            "RELBOW",
            "RWRIST",
            "LSHOULDER",
            "LELBOW",
            "LWRIST",
            "RHIP",
            "RKNEE",
            "RANKLE",
            "LHIP",
            "LKNEE",
            "LANKLE",
        ],
    },
];

/// A set has at least this share of its markers.
const SHARE: f64 = 0.6;
/// Segments that a pose takes, and how many markers each takes beside its neighbours'.
const SEGMENTS: [(&str, usize); 8] = [
    ("pelvis", 3),
    ("torso", 2),
    ("l_thigh", 1),
    ("l_shank", 1),
    ("l_foot", 1),
    ("r_thigh", 1),
    ("r_shank", 1),
    ("r_foot", 1),
];

/// The likeness of a recording's markers to a set.
#[derive(Clone, Debug, PartialEq)]
pub struct Likeness {
    /// The set.
    pub set: &'static str,
    /// Markers of it that are there, and how many it has.
    pub found: usize,
    /// See `found`.
    pub of: usize,
    /// Markers of the set that are missing in the recording.
    pub missing: Vec<&'static str>,
}

/// Returns the set that a recording's markers are of; `None` if they are of none that is known.
pub fn likeness(labels: &[String]) -> Option<Likeness> {
    let plain = |name: &str| -> String {
        name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_uppercase()).collect()
    };
    let own: Vec<String> = labels.iter().map(|label| plain(label)).collect();
    let of = |set: &MarkerSet| {
        let missing: Vec<&'static str> =
            set.labels.iter().copied().filter(|label| !own.iter().any(|o| o == label)).collect();
        Likeness { set: set.name, found: set.labels.len() - missing.len(), of: set.labels.len(), missing }
    };
    let share = |likeness: &Likeness| likeness.found as f64 / likeness.of as f64;
    let all = SETS.iter().map(of).filter(|found| share(found) >= SHARE);
    // Hips by name tell keypoints from markers; of two sets the one with more of its markers there is it.
    all.filter(|found| found.set.starts_with("keypoints") == are_keypoints(labels)).max_by(|a, b| {
        (a.found, share(a)).partial_cmp(&(b.found, share(b))).unwrap_or(std::cmp::Ordering::Equal)
    })
}

/// Returns the segments with fewer markers of known names than each takes: its name, how many it has, and how
/// many it takes.
pub fn bare_segments(labels: &[String]) -> Vec<(&'static str, usize, usize)> {
    let places = places(labels);
    let count = |segment: &str| places.iter().flatten().filter(|place| place.segment == segment).count();
    SEGMENTS
        .iter()
        .filter_map(|(segment, least)| {
            let found = count(segment);
            (found < *least).then_some((*segment, found, *least))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(names: &str) -> Vec<String> {
        names.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn sets_are_distinguished_and_their_missing_markers_are_named() {
        let gait = labels(
            "LASI RASI LPSI RPSI LTHI LKNE LTIB LANK LHEE LTOE RTHI RKNE RTIB RANK RHEE RTOE C7 CLAV STRN \
             T10 LSHO RSHO",
        );
        let found = likeness(&gait).unwrap();
        assert_eq!((found.set, found.found, found.missing.len()), ("Plug-in Gait", 16, 0));
        let two = labels(
            "LASI RASI LPSI RPSI LTHAP LTHAD LKNE LKNM LTIAP LTIAD LANK LMED LHEE LSMH LFMH LVMH RTHAP RTHAD \
             RKNE RKNM RTIAP RTIAD RANK RMED RHEE RSMH RFMH",
        );
        assert_eq!(likeness(&two).map(|found| (found.set, found.missing)), Some(("CGM2", vec!["RVMH"])));
        let cap = labels(
            "r.ASIS_study L.ASIS_study r.PSIS_study L.PSIS_study r_knee_study r_mknee_study r_ankle_study \
             r_mankle_study r_toe_study r_5meta_study r_calc_study L_knee_study L_mknee_study L_ankle_study \
             L_mankle_study L_toe_study L_calc_study L_5meta_study C7_study r_lelbow_study r_melbow_study \
             r_lwrist_study",
        );
        assert_eq!(likeness(&cap).unwrap().set, "OpenCap anatomical");
        let known = places(&cap);
        assert!(known.iter().all(Option::is_some), "{known:?}");
        assert_eq!(known[4].as_ref().unwrap().segment, "r_thigh");
        assert!(known[5].as_ref().unwrap().at_m[1] > 0.0 && known[4].as_ref().unwrap().at_m[1] < 0.0);
        assert_eq!(known[19].as_ref().unwrap().joint, "r_elbow");
        assert_eq!(likeness(&labels("a b c")), None);
        assert_eq!(bare_segments(&cap), [("torso", 1, 2)]);
    }

    #[test]
    fn keypoints_are_the_centres_of_joints_and_markers_of_the_same_names_are_not() {
        let pose = labels(
            "Nose Neck RShoulder RElbow RWrist LShoulder LElbow LWrist MidHip RHip RKnee RAnkle LHip LKnee \
             LAnkle",
        );
        assert!(are_keypoints(&pose));
        assert!(likeness(&pose).unwrap().set.starts_with("keypoints"));
        let all = places(&pose);
        let knee = all[10].clone().unwrap();
        assert_eq!((knee.segment.as_str(), knee.joint.as_str(), knee.at_m), ("r_thigh", "r_knee", [0.0; 3]));
        assert_eq!(all[9].as_ref().unwrap().joint, "r_hip");
        // Beside iliac spines a knee is skin.
        let skin = labels("RASI LASI RPSI LPSI RKnee LKnee RAnkle LAnkle");
        assert!(!are_keypoints(&skin));
        assert!(places(&skin)[4].as_ref().unwrap().at_m[1] < -0.04);
    }
}
