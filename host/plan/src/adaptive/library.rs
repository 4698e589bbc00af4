//! Segments to choose from: short motions with several frequencies about home and about tilted poses, and
//! still poses.

use hexapod::{Axis, Geometry, MotionProgram, Pose, Segment, SineTerm};

use super::information::RigModel;

/// Length of a motion, s, and of its ramps.
pub const MOTION_S: f64 = 4.0;
const RAMP_S: f64 = 0.5;
/// Length of a still pose, s.
const STILL_S: f64 = 1.5;
/// Frequencies, Hz: the band of the default experiment, well apart. With a single one a tilt's `I ω̇` and
/// `mc × g` would be collinear.
const FAST_HZ: [f64; 3] = [2.35, 2.05, 1.75];
const SLOW_HZ: [f64; 3] = [0.5, 0.6, 0.7];
/// Share of the slow sine's rate.
const SLOW_SHARE: f64 = 0.35;
/// Tilt of the poses beside home, degrees.
const TILT_DEG: f64 = 20.0;
/// Tilt of the still poses, degrees.
const STILL_TILT_DEG: f64 = 28.0;
/// Peak rate of the moves between poses, rad/s on the path of the angles, and their shortest time, s.
const MOVE_RATE_RADPS: f64 = 1.0;
const SHORTEST_MOVE_S: f64 = 0.5;
/// Peak velocity of a shift, m/s.
const SHIFT_MPS: f64 = 0.15;
/// A motion that must be made smaller than this is left out.
const LEAST_SCALE: f64 = 0.1;

/// A segment to choose.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The name for people.
    pub name: String,
    /// The pose where it begins and ends.
    pub centre: Pose,
    /// The segment there.
    pub segment: Segment,
}

impl Candidate {
    /// Returns the coordinates that move.
    pub fn moves(&self) -> [bool; 6] {
        let mut moves = [false; 6];
        if let Segment::Multisine { terms, .. } = &self.segment {
            for term in terms {
                moves[term.axis as usize] = true;
            }
        }
        moves
    }

    /// Returns the candidate with smaller amplitudes; `None` for a still pose.
    pub fn smaller(&self, scale: f64) -> Option<Self> {
        let Segment::Multisine { duration_s, ramp_s, terms } = &self.segment else { return None };
        let terms = terms.iter().map(|t| SineTerm { amplitude: scale * t.amplitude, ..*t }).collect();
        let segment = Segment::Multisine { duration_s: *duration_s, ramp_s: *ramp_s, terms };
        Some(Self { segment, ..self.clone() })
    }

    /// Returns the way there and the segment; `None` if the machine cannot go there.
    pub fn program(&self, from: &Pose, slower: f64, geometry: &Geometry) -> Option<MotionProgram> {
        let mut segments = Vec::new();
        if *from != self.centre {
            segments.push(way(from, &self.centre, slower, geometry)?);
        }
        segments.push(self.segment.clone());
        Some(MotionProgram { start: *from, segments })
    }
}

/// Returns a straight move, slower by the given factor than thought right, and slower still where a leg would
/// be too fast.
pub(super) fn way(from: &Pose, to: &Pose, slower: f64, geometry: &Geometry) -> Option<Segment> {
    let square = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(p, q)| (p - q).powi(2)).sum::<f64>();
    let angle = square(&from.rpy_rad, &to.rpy_rad).sqrt();
    let shift = square(&from.position_m, &to.position_m).sqrt();
    // The quintic's peak rate is 15/8 of its mean.
    let mut duration_s =
        (1.875 * angle / MOVE_RATE_RADPS).max(1.875 * shift / SHIFT_MPS).max(SHORTEST_MOVE_S) * slower;
    for _ in 0..8 {
        let segment = Segment::Move { to: *to, duration_s };
        let program = MotionProgram { start: *from, segments: vec![segment.clone()] };
        if keeps(&program, geometry) {
            return Some(segment);
        }
        duration_s *= 1.4;
    }
    None
}

pub(super) fn keeps(program: &MotionProgram, geometry: &Geometry) -> bool {
    program.trajectory().is_ok_and(|trajectory| geometry.check(&trajectory).is_ok())
}

/// Returns everything the machine can do of these without the coordinates in `lost`, each as large as its
/// limits and the gyro allow.
pub fn library(rig: &RigModel, lost: &[bool; 6]) -> Vec<Candidate> {
    let home = rig.geometry.home();
    let tilted = |tilt_deg: f64, azimuth_deg: f64| {
        let (s, c) = azimuth_deg.to_radians().sin_cos();
        let tilt = tilt_deg.to_radians();
        Pose { rpy_rad: [tilt * c, tilt * s, 0.0], ..home }
    };
    let turns = [Axis::Roll, Axis::Pitch, Axis::Yaw];
    let mut all = Vec::new();
    for k in 0..3 {
        let [a, b, c] = [turns[k], turns[(k + 1) % 3], turns[(k + 2) % 3]];
        for slow in [false, true] {
            for axes in [&[a][..], &[a, b], &[b, a], &[a, b, c], &[b, a, c]] {
                all.push(turning(home, "home", axes, slow));
            }
        }
    }
    for azimuth_deg in [0.0, 90.0, 180.0, 270.0] {
        let centre = tilted(TILT_DEG, azimuth_deg);
        let place = format!("a tilt of {TILT_DEG:.0}° towards {azimuth_deg:.0}°");
        for axes in [&[turns[0]][..], &[turns[1]], &[turns[0], turns[1]], &turns] {
            all.push(turning(centre, &place, axes, true));
        }
    }
    all.push(shifting(home));
    for azimuth_deg in [0.0, 60.0, 120.0, 180.0, 240.0, 300.0] {
        all.push(Candidate {
            name: format!("still, tilted by {STILL_TILT_DEG:.0}° towards {azimuth_deg:.0}°"),
            centre: tilted(STILL_TILT_DEG, azimuth_deg),
            segment: Segment::Hold { duration_s: STILL_S },
        });
    }
    let still = Candidate {
        name: "still, level".to_owned(),
        centre: home,
        segment: Segment::Hold { duration_s: STILL_S },
    };
    all.push(still);
    let away = |c: &Candidate, k: usize| k >= 3 && c.centre.rpy_rad[k - 3] != home.rpy_rad[k - 3];
    all.iter()
        .filter(|c| (0..6).all(|k| !lost[k] || !(c.moves()[k] || away(c, k))))
        .filter_map(|candidate| fitted(candidate, rig))
        .collect()
}

fn turning(centre: Pose, place: &str, axes: &[Axis], slow: bool) -> Candidate {
    let mut terms = Vec::new();
    for (k, axis) in axes.iter().enumerate() {
        let mut sine = |frequency_hz: f64, rate_radps: f64, phase_rad: f64| {
            let amplitude = rate_radps / (std::f64::consts::TAU * frequency_hz);
            terms.push(SineTerm { axis: *axis, amplitude, frequency_hz, phase_rad });
        };
        sine(FAST_HZ[k], 1.0, 1.9 * k as f64);
        if slow && *axis != Axis::Yaw {
            sine(SLOW_HZ[k], SLOW_SHARE, 1.0 + 2.3 * k as f64);
        }
    }
    let words: Vec<&str> = axes.iter().map(|axis| word(*axis)).collect();
    let slow = if slow { ", slow and fast," } else { "" };
    Candidate {
        name: format!("{}{slow} about {place}", words.join(" + ")),
        centre,
        segment: Segment::Multisine { duration_s: MOTION_S, ramp_s: RAMP_S, terms },
    }
}

fn shifting(centre: Pose) -> Candidate {
    let shifts = [(Axis::X, 1.15), (Axis::Y, 1.45), (Axis::Z, 1.75)];
    let terms = shifts
        .into_iter()
        .map(|(axis, frequency_hz)| {
            let amplitude = SHIFT_MPS / (std::f64::consts::TAU * frequency_hz);
            SineTerm { axis, amplitude, frequency_hz, phase_rad: frequency_hz }
        })
        .collect();
    Candidate {
        name: "shifts about home".to_owned(),
        centre,
        segment: Segment::Multisine { duration_s: MOTION_S, ramp_s: RAMP_S, terms },
    }
}

/// Returns what an axis is called.
pub fn word(axis: Axis) -> &'static str {
    match axis {
        Axis::X => "x",
        Axis::Y => "y",
        Axis::Z => "z",
        Axis::Roll => "roll",
        Axis::Pitch => "pitch",
        Axis::Yaw => "yaw",
    }
}

/// Returns the candidate as large as gyro and limits allow; `None` if that is next to nothing.
pub fn fitted(candidate: &Candidate, rig: &RigModel) -> Option<Candidate> {
    let alone = |c: &Candidate| MotionProgram { start: c.centre, segments: vec![c.segment.clone()] };
    if !matches!(candidate.segment, Segment::Multisine { .. }) {
        return keeps(&alone(candidate), &rig.geometry).then(|| candidate.clone());
    }
    let allowed = rig.highest_rate_radps();
    let mut now = candidate.clone();
    let turns = now.moves()[3..].contains(&true);
    // Angles add up almost linearly, so two rounds are enough; the second is never larger.
    for round in 0..2 {
        let peak = peak_rate(&alone(&now))?;
        if turns && (round == 0 || peak > allowed) {
            now = now.smaller(0.999 * allowed / peak)?;
        }
    }
    let mut scale = 1.0;
    while scale > LEAST_SCALE {
        let tried = now.smaller(scale)?;
        if keeps(&alone(&tried), &rig.geometry) {
            return Some(tried);
        }
        scale *= 0.9;
    }
    None
}

/// Returns the highest angular rate, rad/s, examined every 4 ms.
fn peak_rate(program: &MotionProgram) -> Option<f64> {
    let trajectory = program.trajectory().ok()?;
    let steps = (trajectory.duration_s() / 0.004).ceil() as usize;
    Some((0..=steps).map(|k| trajectory.state(k as f64 * 0.004).angular_rate.norm()).fold(0.0, f64::max))
}
