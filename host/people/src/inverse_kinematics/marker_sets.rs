//! Sets of markers by the name of those who made them, and what a recording lacks of one.

use super::landmarks::{are_keypoints, places};

/// A set by its name and the names of its markers.
struct MarkerSet {
    name: &'static str,
    labels: &'static [&'static str],
}

/// Sets that are recognised by their names. Vicon, *Plug-in Gait Reference Guide*; Leboeuf et al., *pyCGM2*,
/// 2019; Qualisys, *QTM Marker Set Guide* (Sports); Leardini et al., *Gait & Posture* 26, 2007 (IOR); Van
/// Sint Jan, *Color Atlas of Skeletal Landmark Definitions*, 2007; C-Motion, *Visual3D documentation*; BTS,
/// *SMART-Clinic* (Davis et al., *Human Movement Science* 10, 1991); Uhlrich et al., *OpenCap*, 2023; Cao et
/// al., *OpenPose*, 2019 (BODY_25). Names are compared in capitals and digits.
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
        name: "CGM2.3",
        labels: &[
            "LASI", "RASI", "LPSI", "RPSI", "LTHI", "LKNE", "LTHIAP", "LTHIAD", "LTIB", "LANK", "LTIAP",
            "LTIAD", "LHEE", "LTOE", "RTHI", "RKNE", "RTHIAP", "RTHIAD", "RTIB", "RANK", "RTIAP", "RTIAD",
            "RHEE", "RTOE",
        ],
    },
    MarkerSet {
        name: "Qualisys Sports, legs",
        labels: &[
            "WAISTLFRONT",
            "WAISTRFRONT",
            "LTHIGHFRONTLOW",
            "LKNEEOUT",
            "LSHINFRONTHIGH",
            "LANKLEOUT",
            "LHEELBACK",
            "LFOREFOOTOUT",
            "LTOETIP",
            "RTHIGHFRONTLOW",
            "RKNEEOUT",
            "RSHINFRONTHIGH",
            "RANKLEOUT",
            "RHEELBACK",
            "RFOREFOOTOUT",
            "RTOETIP",
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
        name: "IOR, names of Van Sint Jan",
        labels: &[
            "LIAS", "RIAS", "LIPS", "RIPS", "LFTC", "LFLE", "LFME", "LFAX", "LTTC", "LFAL", "LTAM", "LFCC",
            "LFM1", "LFM2", "LFM5", "RFTC", "RFLE", "RFME", "RFAX", "RTTC", "RFAL", "RTAM", "RFCC", "RFM1",
            "RFM2", "RFM5",
        ],
    },
    MarkerSet {
        name: "Visual3D",
        labels: &[
            "LTH1", "LKNL", "LKNM", "LSK1", "LANL", "LANM", "LHEE", "LMT2", "LMT5", "RTH1", "RKNL", "RKNM",
            "RSK1", "RANL", "RANM", "RHEE", "RMT2", "RMT5",
        ],
    },
    MarkerSet {
        name: "BTS Davis",
        labels: &[
            "LASIS", "RASIS", "LBAR1", "LKNEE1", "LBAR2", "LMALL", "LHEEL", "LMET", "RBAR1", "RKNEE1",
            "RBAR2", "RMALL", "RHEEL", "RMET",
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
    /// Other sets that as many of its markers fit as well.
    pub alike: Vec<&'static str>,
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
        Likeness {
            set: set.name,
            found: set.labels.len() - missing.len(),
            of: set.labels.len(),
            missing,
            alike: Vec::new(),
        }
    };
    let share = |likeness: &Likeness| likeness.found as f64 / likeness.of as f64;
    let all = SETS.iter().map(of).filter(|found| share(found) >= SHARE);
    // Hips by name tell keypoints from markers; of two sets the one with more of its markers there is it.
    let all: Vec<Likeness> =
        all.filter(|found| found.set.starts_with("keypoints") == are_keypoints(labels)).collect();
    let mut best: Option<Likeness> = None;
    for found in all {
        // As many markers of a smaller set are more of it.
        let rank = |likeness: &Likeness| (likeness.found, std::cmp::Reverse(likeness.of));
        match best.as_ref().map(|best| rank(&found).cmp(&rank(best))) {
            None | Some(std::cmp::Ordering::Greater) => best = Some(found),
            Some(std::cmp::Ordering::Equal) => best.iter_mut().for_each(|best| best.alike.push(found.set)),
            Some(std::cmp::Ordering::Less) => {}
        }
    }
    best
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

    /// Names of sets as their makers publish them: every one has a place, and the set is named.
    #[test]
    fn sets_of_other_makers_are_known_with_places() {
        let both = |names: &str| {
            let sided = names.split(' ').flat_map(|name| [format!("L{name}"), format!("R{name}")]);
            sided.collect::<Vec<String>>()
        };
        let with = |more: &str, names: &str| [labels(more), both(names)].concat();
        let waist = "WaistLFront WaistRFront WaistL WaistR";
        for (set, names) in [
            ("CGM2", both("ASI PSI THAP THAD KNE KNM TIAP TIAD ANK MED HEE SMH FMH VMH")),
            ("CGM2.3", both("ASI PSI THIAP KNE TIAP ANK HEE TOE")),
            (
                "Qualisys Sports, legs",
                with(waist, "ThighFrontLow KneeOut ShinFrontHigh AnkleOut HeelBack ToeTip"),
            ),
            ("IOR", both("IAS IPS GT LE ME HF TT LM MM CA FM VM")),
            ("IOR, names of Van Sint Jan", both("_IAS _IPS _FTC _FLE _TTC _FAL _FCC _FM2")),
            ("Visual3D", both("ASI PSI TH1 KNL SK1 ANL HEE MT2")),
            ("BTS Davis", both("_asis _psis _bar_1 _knee_1 _bar_2 _mall _heel _met")),
        ] {
            let found = likeness(&names).unwrap_or_else(|| panic!("{set}"));
            assert_eq!((found.set, found.alike.len()), (set, 0), "{names:?}");
            for (name, place) in names.iter().zip(places(&names)) {
                assert!(place.is_some(), "{set}: {name}");
            }
        }
        // Left and right of the waist, and no short name where the set is another one.
        let all = places(&labels("WaistLFront WaistRBack LLE RME"));
        assert!(all[0].as_ref().is_some_and(|place| place.at_m[1] > 0.1));
        assert!(all[1].as_ref().is_some_and(|place| place.at_m[1] < 0.0 && place.at_m[0] < 0.0));
        assert_eq!((&all[2], &all[3]), (&None, &None));
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
