//! The knowledge of markers by their names: the sets of Plug-in Gait, of OpenSim's examples, and names like
//! theirs.
//!
//! Places are of a standing adult 1.741 m tall, about joint centres, and scale with the stature. Those of the
//! pelvis about the hips are M. Harrington et al., "Prediction of the hip joint centre in adults, children,
//! and patients with cerebral palsy based on magnetic resonance imaging", Journal of Biomechanics 40 (3),
//! 2007, for a pelvis 0.25 m wide and 0.16 m deep; the others are half breadths of joints and lengths of
//! segments as textbooks of gait analysis have them, with the radius of a marker (assumed). They are where a
//! calibration begins, each with how far it may be off.

use nalgebra::Vector3;

use super::markers::Attached;
use super::skeleton::Skeleton;
use rigident_model::Model;

/// Stature that places are of, m.
const STATURE_M: f64 = 1.741;
/// The uncertainty of a marker's place on its link, 1 σ, m: skin moves over bone by about this much.
const SKIN_M: f64 = 0.006;
/// The uncertainty of a marker's place on the trunk and the shoulder girdle, which are not rigid, 1 σ, m.
const SOFT_M: f64 = 0.012;

/// The place where a marker is fixed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum On {
    Pelvis,
    Trunk,
    Girdle,
    Head,
    UpperArm,
    Forearm,
    Wrist,
    Hand,
    Thigh,
    Shank,
    Foot,
}

/// The joint centre that a place is measured from, at zero position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum From {
    MidHip,
    Neck,
    Shoulder,
    Elbow,
    Wrist,
    Hip,
    Knee,
    Ankle,
}

struct Landmark {
    /// Names without side, capitals and digits only.
    names: &'static [&'static str],
    on: On,
    from: From,
    /// Forward, outward (of a marker with a side; else to the left), up, m.
    at: [f64; 3],
    /// 1 σ of each, m.
    sigma: f64,
}

/// A marker that may be anywhere on its segment.
const ANYWHERE: f64 = 0.15;

const fn mark(names: &'static [&'static str], on: On, from: From, at: [f64; 3], sigma: f64) -> Landmark {
    Landmark { names, on, from, at, sigma }
}

/// Markers with a side.
const SIDED: &[Landmark] = &[
    mark(&["ASI", "ASIS", "IAS"], On::Pelvis, From::MidHip, [0.048, 0.125, 0.086], 0.012),
    mark(&["PSI", "PSIS", "IPS"], On::Pelvis, From::MidHip, [-0.108, 0.045, 0.086], 0.012),
    mark(&["WAISTFRONT"], On::Pelvis, From::MidHip, [0.048, 0.125, 0.086], 0.02),
    mark(&["WAISTBACK"], On::Pelvis, From::MidHip, [-0.108, 0.045, 0.086], 0.02),
    mark(&["ILIACCREST", "ICR", "ILC", "WAIST"], On::Pelvis, From::MidHip, [0.0, 0.14, 0.15], ANYWHERE),
    mark(&["BAK", "BACK"], On::Trunk, From::Neck, [-0.1, 0.08, -0.12], ANYWHERE),
    mark(&["CLAVICLE"], On::Trunk, From::Neck, [0.04, 0.06, -0.05], 0.04),
    mark(
        &["SHO", "ACROMIUM", "ACROMION", "SHOULDER", "SHOULDERTOP", "ACR", "SAJ"],
        On::Girdle,
        From::Shoulder,
        [0.0, 0.0, 0.045],
        0.02,
    ),
    mark(&["FHD"], On::Head, From::Neck, [0.085, 0.07, 0.17], 0.03),
    mark(&["BHD"], On::Head, From::Neck, [-0.085, 0.07, 0.17], 0.03),
    mark(&["TEMPLE", "HEAD"], On::Head, From::Neck, [0.04, 0.075, 0.15], 0.03),
    mark(
        &["UPA", "BICEP", "BICEPS", "UPPERARM", "ARM", "UA1", "UA2", "UA3"],
        On::UpperArm,
        From::Elbow,
        [0.0, 0.05, 0.12],
        ANYWHERE,
    ),
    mark(
        &["ELB", "ELBOW", "ELBOWLAT", "ELBOWOUT", "LEL", "LELBOW"],
        On::UpperArm,
        From::Elbow,
        [0.0, 0.043, 0.0],
        0.015,
    ),
    mark(
        &["ELBOWMED", "ELBOWIN", "ELBIN", "MEL", "MELBOW"],
        On::UpperArm,
        From::Elbow,
        [0.0, -0.04, 0.0],
        0.015,
    ),
    mark(
        &["FRA", "FOREARM", "FRM", "FA1", "FA2", "FA3", "FASUPERIOR"],
        On::Forearm,
        From::Wrist,
        [0.0, 0.04, 0.12],
        ANYWHERE,
    ),
    mark(&["WRA", "WRISTLAT", "RSP", "FARADIUS", "LWRIST"], On::Wrist, From::Wrist, [0.033, 0.0, 0.0], 0.015),
    mark(&["WRB", "WRISTMED", "USP", "FAULNA", "MWRIST"], On::Wrist, From::Wrist, [-0.033, 0.0, 0.0], 0.015),
    mark(&["WRIST"], On::Wrist, From::Wrist, [0.0, 0.025, 0.0], 0.025),
    mark(&["WRISTOUT", "WRISTIN"], On::Wrist, From::Wrist, [0.0; 3], 0.04),
    mark(&["FIN", "HAND", "HANDOUT", "HM2"], On::Hand, From::Wrist, [0.0, 0.02, -0.08], 0.02),
    mark(&["TROC", "GTR", "TROCHANTER", "FTC"], On::Thigh, From::Hip, [0.0, 0.08, -0.01], 0.04),
    mark(
        &[
            "THI",
            "THIGH",
            "THIGHUPPER",
            "THIGHFRONT",
            "THIGHREAR",
            "THIGHFRONTLOW",
            "THIGHFRONTHIGH",
            "THAP",
            "THAD",
            "THIAP",
            "THIAD",
            "BAR1",
            "THIGH1",
            "THIGH2",
            "THIGH3",
            "TH1",
            "TH2",
            "TH3",
            "TH4",
            "F01",
            "F02",
            "F03",
            "F04",
            "F05",
        ],
        On::Thigh,
        From::Knee,
        [0.02, 0.07, 0.2],
        ANYWHERE,
    ),
    mark(
        &["KNE", "KNEE", "KNEELAT", "KNEEOUT", "KNEE1", "KNL", "LFC", "FLE"],
        On::Thigh,
        From::Knee,
        [0.0, 0.056, 0.0],
        0.012,
    ),
    mark(
        &["KNEEMED", "KNEEIN", "KNEE2", "KNEIN", "KNM", "MKNE", "MKNEE", "MFC", "FME"],
        On::Thigh,
        From::Knee,
        [0.0, -0.054, 0.0],
        0.012,
    ),
    mark(
        &[
            "TIB",
            "SHANK",
            "SHANKUPPER",
            "SHANKFRONT",
            "SHANKREAR",
            "SHIN",
            "SHINFRONTHIGH",
            "SHINFRONTLOW",
            "TIAP",
            "TIAD",
            "TIBAP",
            "TIBAD",
            "BAR2",
            "TTC",
            "FAX",
            "SK1",
            "SK2",
            "SK3",
            "SK4",
            "SH1",
            "SH2",
            "SH3",
            "SH4",
            "T01",
            "T02",
            "T03",
            "T04",
            "T05",
        ],
        On::Shank,
        From::Ankle,
        [0.02, 0.05, 0.2],
        ANYWHERE,
    ),
    mark(
        &["ANK", "ANKLE", "ANKLELAT", "ANKLEOUT", "MALL", "ANL", "FAL"],
        On::Shank,
        From::Ankle,
        [0.0, 0.043, 0.0],
        0.012,
    ),
    mark(
        &["ANKLEMED", "ANKLEIN", "ANKIN", "MED", "ANM", "MMA", "MANKLE", "TAM"],
        On::Shank,
        From::Ankle,
        [0.0, -0.04, 0.005],
        0.012,
    ),
    mark(
        &["HEE", "HEEL", "HEELBACK", "CAL", "CALC", "FCC"],
        On::Foot,
        From::Ankle,
        [-0.07, 0.0, -0.035],
        0.02,
    ),
    mark(&["TOE", "MT2", "FM2", "SMH", "FOREFOOT2"], On::Foot, From::Ankle, [0.125, 0.0, -0.04], 0.03),
    mark(&["TOETIP", "HLX"], On::Foot, From::Ankle, [0.18, 0.0, -0.045], 0.03),
    mark(
        &["MT5", "MTP5", "5META", "FM5", "VMH", "MET", "FOREFOOTOUT", "TOELAT"],
        On::Foot,
        From::Ankle,
        [0.1, 0.045, -0.045],
        0.03,
    ),
    mark(
        &["MT1", "MTP1", "FM1", "FMH", "FOREFOOTIN", "TOEMED"],
        On::Foot,
        From::Ankle,
        [0.12, -0.04, -0.045],
        0.03,
    ),
    mark(&["MIDFOOTSUP", "MIDFOOTLAT", "MFOOT"], On::Foot, From::Ankle, [0.05, 0.02, -0.03], ANYWHERE),
];

/// Markers in the middle.
const MIDDLE: &[Landmark] = &[
    mark(
        &["SACR", "VSACRAL", "SACRAL", "SACRUM", "S2"],
        On::Pelvis,
        From::MidHip,
        [-0.115, 0.0, 0.08],
        0.015,
    ),
    mark(&["C7", "CV7", "SPINETOP"], On::Trunk, From::Neck, [-0.06, 0.0, 0.0], 0.03),
    mark(&["T8", "TV8"], On::Trunk, From::Neck, [-0.12, 0.0, -0.17], 0.05),
    mark(&["T10", "TV10"], On::Trunk, From::Neck, [-0.11, 0.0, -0.24], 0.05),
    mark(&["CLAV", "IJ", "SJN", "JUGULAR"], On::Trunk, From::Neck, [0.05, 0.0, -0.06], 0.03),
    mark(
        &["STRN", "STERNUM", "SXS", "PX", "XIPHOID", "CHEST"],
        On::Trunk,
        From::Neck,
        [0.09, 0.0, -0.2],
        0.05,
    ),
    mark(&["HEADFRONT"], On::Head, From::Neck, [0.1, 0.0, 0.17], 0.03),
    mark(&["TOPHEAD", "HEADTOP", "VERTEX"], On::Head, From::Neck, [0.0, 0.0, 0.243], 0.03),
];

/// Markers of Leardini et al. (IOR), whose names are short: the side is before them, and in recordings with
/// that set alone they are taken.
const SHORT: &[Landmark] = &[
    mark(&["GT"], On::Thigh, From::Hip, [0.0, 0.08, -0.01], 0.04),
    mark(&["LE"], On::Thigh, From::Knee, [0.0, 0.056, 0.0], 0.012),
    mark(&["ME"], On::Thigh, From::Knee, [0.0, -0.054, 0.0], 0.012),
    mark(&["HF", "TT"], On::Shank, From::Ankle, [0.02, 0.05, 0.35], ANYWHERE),
    mark(&["LM"], On::Shank, From::Ankle, [0.0, 0.043, 0.0], 0.012),
    mark(&["MM"], On::Shank, From::Ankle, [0.0, -0.04, 0.005], 0.012),
    mark(&["CA"], On::Foot, From::Ankle, [-0.07, 0.0, -0.035], 0.02),
    mark(&["SM"], On::Foot, From::Ankle, [0.125, 0.0, -0.04], 0.03),
    mark(&["VM"], On::Foot, From::Ankle, [0.1, 0.045, -0.045], 0.03),
    mark(&["FM"], On::Foot, From::Ankle, [0.12, -0.04, -0.045], 0.03),
];

/// Joint centres, as programs that see people without markers name them.
const CENTRES: &[Landmark] = &[
    mark(&["HIP", "HJC"], On::Thigh, From::Hip, [0.0; 3], 0.03),
    mark(&["KNEE"], On::Thigh, From::Knee, [0.0; 3], 0.03),
    mark(&["ANKLE"], On::Shank, From::Ankle, [0.0; 3], 0.03),
    mark(&["SHOULDER"], On::UpperArm, From::Shoulder, [0.0; 3], 0.03),
    mark(&["ELBOW"], On::UpperArm, From::Elbow, [0.0; 3], 0.03),
    mark(&["WRIST"], On::Wrist, From::Wrist, [0.0; 3], 0.03),
];

/// Returns a name in capitals and digits; what OpenCap adds to the names of its anatomical markers is taken
/// off.
fn plain(name: &str) -> String {
    let all: String =
        name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_uppercase()).collect();
    all.strip_suffix("STUDY").map(str::to_owned).unwrap_or(all)
}

/// Returns true of the names of a recording without markers (OpenPose, Theia, OpenCap's cameras): hips are in
/// it, which no marker shows, and knees and ankles by these words alone.
pub fn are_keypoints(labels: &[String]) -> bool {
    let plain: Vec<String> = labels.iter().map(|label| plain(label)).collect();
    let has = |core: &str| {
        ["L", "R"].iter().all(|side| plain.iter().any(|own| *own == format!("{side}{core}")))
            || ["LEFT", "RIGHT"].iter().all(|side| plain.iter().any(|own| *own == format!("{side}{core}")))
    };
    has("HIP") && has("KNEE") && has("ANKLE")
}

/// Returns true of the names of the set of Leardini et al.: tibial tuberosities and heads of fibulae are
/// in it.
fn are_short(labels: &[String]) -> bool {
    let plain: Vec<String> = labels.iter().map(|label| plain(label)).collect();
    ["LTT", "RTT", "LHF", "RHF"].iter().all(|name| plain.iter().any(|own| own == name))
}

/// The way names of a recording are understood.
#[derive(Clone, Copy, Debug)]
pub struct Naming {
    /// Names of joints are their centres.
    centres: bool,
    /// Short names of IOR are known.
    short: bool,
}

impl Naming {
    /// Returns how the names of a recording are understood.
    pub fn of(labels: &[String]) -> Self {
        Self { centres: are_keypoints(labels), short: are_short(labels) }
    }

    /// Returns the landmark of a name, its side (1 left, −1 right, 0 in the middle), and the name without it.
    fn find(self, name: &str) -> Option<(&'static Landmark, f64, String)> {
        let after_side = |list: &'static [Landmark]| {
            let name = plain(name);
            let sides = [("LEFT", 1.0), ("RIGHT", -1.0), ("L", 1.0), ("R", -1.0)];
            sides.iter().find_map(|(word, side)| {
                let core = name.strip_prefix(word)?;
                let found = list.iter().find(|l| l.names.contains(&core))?;
                Some((found, *side, core.to_owned()))
            })
        };
        let centre = if self.centres { after_side(CENTRES) } else { None };
        let short = if self.short { after_side(SHORT) } else { None };
        centre.or(short).or_else(|| core(name))
    }

    /// Returns true if a marker's name is known.
    pub fn knows(self, name: &str) -> bool {
        self.find(name).is_some()
    }

    /// Returns a marker's name without its side, and the side: 1 left, −1 right; `None` if it has none or is
    /// not known.
    pub fn sided(self, name: &str) -> Option<(String, f64)> {
        self.find(name).filter(|(_, side, _)| *side != 0.0).map(|(_, side, core)| (core, side))
    }
}

/// The assumed place of a marker of a known name.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// The segment that it is fixed to.
    pub segment: String,
    /// The joint whose centre it is measured from.
    pub joint: String,
    /// Forward, to the left and up of that centre, m, of a standing adult 1.741 m tall.
    pub at_m: [f64; 3],
    /// The uncertainty of that, 1 σ, m; [`ANYWHERE`] of a marker that may be anywhere on its segment.
    pub sigma_m: f64,
}

impl Place {
    /// Returns true of a marker that may be anywhere on its segment.
    pub fn is_anywhere(&self) -> bool {
        self.sigma_m >= ANYWHERE
    }
}

/// Returns where each marker is taken to be by its name, `None` of those that are not known.
pub fn places(labels: &[String]) -> Vec<Option<Place>> {
    let naming = Naming::of(labels);
    let of = |label: &String| {
        let (found, side, _) = naming.find(label)?;
        let side_word = |names: [&str; 2]| names[1].replace("S_", if side > 0.0 { "l_" } else { "r_" });
        let [x, y, z] = found.at;
        let joint = match found.from {
            From::MidHip => "middle of the hips".to_owned(),
            From::Neck => "neck".to_owned(),
            From::Shoulder => side_word(["", "S_shoulder"]),
            From::Elbow => side_word(["", "S_elbow"]),
            From::Wrist => side_word(["", "S_wrist"]),
            From::Hip => side_word(["", "S_hip"]),
            From::Knee => side_word(["", "S_knee"]),
            From::Ankle => side_word(["", "S_ankle"]),
        };
        let at_m = [x, if side == 0.0 { y } else { y * side }, z];
        Some(Place { segment: side_word(on_links(found.on)), joint, at_m, sigma_m: found.sigma })
    };
    labels.iter().map(of).collect()
}

/// Returns the landmark of a name, its side, and the name without it: the side is before or after it, or
/// within it after the waist's (`WaistLFront`).
fn core(name: &str) -> Option<(&'static Landmark, f64, String)> {
    let name = plain(name);
    let of = |list: &'static [Landmark], core: &str| list.iter().find(|l| l.names.contains(&core));
    if let Some(found) = of(MIDDLE, &name) {
        return Some((found, 0.0, name));
    }
    let name = match name.strip_prefix("WAIST") {
        Some(rest) if rest.len() > 1 && rest.starts_with(['L', 'R']) => {
            let (side, rest) = rest.split_at(1);
            format!("{side}WAIST{rest}")
        }
        _ => name,
    };
    let sides = [("LEFT", 1.0), ("RIGHT", -1.0), ("L", 1.0), ("R", -1.0)];
    sides.iter().find_map(|(word, side)| {
        let cores = [name.strip_prefix(word), name.strip_suffix(word)];
        cores.into_iter().flatten().find_map(|core| Some((of(SIDED, core)?, *side, core.to_owned())))
    })
}

/// Returns what markers of known names are fixed to, of a model of a person so tall; names that are not known
/// are left out.
pub fn attach(model: &Model, skeleton: &Skeleton, labels: &[String], height_m: f64) -> Vec<Attached> {
    let zero = skeleton.places(&skeleton.zero());
    let link = |names: [&str; 2], side: f64| {
        let side = if side > 0.0 { "l_" } else { "r_" };
        names.iter().find_map(|name| model.link(&name.replace("S_", side)))
    };
    let scale = height_m / STATURE_M;
    let naming = Naming::of(labels);
    let attached = labels.iter().enumerate().filter_map(|(label, name)| {
        let (found, side, _) = naming.find(name)?;
        let on = link(on_links(found.on), side)?;
        let from = link(from_links(found.from), side)?;
        let [x, y, z] = found.at;
        let y = if side == 0.0 { y } else { y * side };
        let place = zero[from].1 + Vector3::new(x, y, z) * scale;
        Some(Attached {
            name: name.clone(),
            label,
            link: on,
            position_m: place - zero[on].1,
            position_sigma_m: found.sigma,
            sigma_m: if matches!(found.on, On::Trunk | On::Girdle) { SOFT_M } else { SKIN_M },
            tells_stature: !matches!(found.on, On::UpperArm | On::Forearm | On::Wrist | On::Hand),
        })
    });
    attached.collect()
}

/// Links of `human58` and of `human34` that a marker is fixed to.
fn on_links(on: On) -> [&'static str; 2] {
    match on {
        On::Pelvis => ["pelvis"; 2],
        On::Trunk => ["chest", "torso"],
        On::Girdle => ["S_scapula", "torso"],
        On::Head => ["head"; 2],
        On::UpperArm => ["S_upper_arm"; 2],
        On::Forearm => ["S_ulna", "S_forearm"],
        // The elbow of `human34` has no pronation: its wrist turns with the hand.
        On::Wrist => ["S_radius", "S_hand"],
        On::Hand => ["S_hand"; 2],
        On::Thigh => ["S_thigh"; 2],
        On::Shank => ["S_shank"; 2],
        On::Foot => ["S_foot"; 2],
    }
}

/// Links of `human58` and of `human34` whose joint is the centre.
fn from_links(from: From) -> [&'static str; 2] {
    match from {
        From::MidHip => ["pelvis"; 2],
        From::Neck => ["cervical", "head"],
        From::Shoulder => ["S_upper_arm"; 2],
        From::Elbow => ["S_ulna", "S_forearm"],
        From::Wrist => ["S_hand"; 2],
        From::Hip => ["S_thigh"; 2],
        From::Knee => ["S_shank"; 2],
        From::Ankle => ["S_foot"; 2],
    }
}
