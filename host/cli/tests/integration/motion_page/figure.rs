//! A stick figure that walks over three force plates, from formulas.

use std::f32::consts::PI;

use rigident::present::motion::{Bone, Curve, ErrorRow, ForceArrow, MotionPage, Rms, Side};

const RATE: f32 = 100.0;
const SPEED: f32 = 1.2;
const STRIDE_S: f32 = 1.1;
/// Share of a stride for which a foot is on the floor.
const STANCE: f32 = 0.6;
const WEIGHT_N: f32 = 720.0;
const THIGH: f32 = 0.43;
const SHANK: f32 = 0.42;

/// Smallest and largest x and y of each plate, m.
const PLATES: [[f32; 4]; 3] = [[0.86, 1.46, -0.3, 0.3], [1.52, 2.12, -0.3, 0.3], [2.18, 2.78, -0.3, 0.3]];

/// The place of a foot: its ankle, how far through stance it is, or NaN, and its pitch.
struct Foot {
    ankle: [f32; 3],
    stance: f32,
    pitch: f32,
}

fn foot(t: f32, left: bool) -> Foot {
    let phase = t / STRIDE_S + if left { 0.5 } else { 0.0 };
    let (stride, share) = (phase.floor(), phase.fract());
    let length = SPEED * STRIDE_S;
    let begun = (stride - if left { 0.5 } else { 0.0 }) * length + 0.5 * STANCE * length;
    let y = if left { 0.09 } else { -0.09 };
    if share < STANCE {
        let stance = share / STANCE;
        let pitch = if stance > 0.7 { 1.3 * (stance - 0.7) } else { -0.8 * (0.15 - stance).max(0.0) };
        return Foot { ankle: [begun, y, 0.09 + 0.25 * (stance - 0.7).max(0.0)], stance, pitch };
    }
    let s = (share - STANCE) / (1.0 - STANCE);
    let forward = s - (2.0 * PI * s).sin() / (2.0 * PI);
    let height = 0.09 + 0.075 * (1.0 - s) + 0.1 * (PI * s).sin().powi(2);
    Foot { ankle: [begun + length * forward, y, height], stance: f32::NAN, pitch: 0.39 - 0.51 * s }
}

/// The knee in front of the line from hip to ankle.
fn knee(hip: [f32; 3], ankle: [f32; 3]) -> [f32; 3] {
    let (dx, dz) = (ankle[0] - hip[0], ankle[2] - hip[2]);
    let far = dx.hypot(dz).min(0.999 * (THIGH + SHANK));
    let along = (THIGH * THIGH - SHANK * SHANK + far * far) / (2.0 * far);
    let beside = (THIGH * THIGH - along * along).max(0.0).sqrt();
    let (ux, uz) = (dx / far, dz / far);
    [hip[0] + along * ux - beside * uz, 0.5 * (hip[1] + ankle[1]), hip[2] + along * uz + beside * ux]
}

fn frame(t: f32) -> Vec<[f32; 3]> {
    let swing = (2.0 * PI * t / STRIDE_S).cos();
    let x = SPEED * t;
    let pelvis = [x, 0.02 * swing, 0.885 + 0.018 * (4.0 * PI * t / STRIDE_S).cos()];
    let at = |dx: f32, dy: f32, dz: f32| [pelvis[0] + dx, pelvis[1] + dy, pelvis[2] + dz];
    let mut points =
        vec![pelvis, at(0.0, 0.0, 0.08), at(0.03, 0.0, 0.5), at(0.05, 0.0, 0.57), at(0.06, 0.0, 0.7)];
    for (sign, left) in [(1.0, true), (-1.0, false)] {
        let arm = sign * 0.45 * swing;
        let shoulder = at(0.02, sign * 0.18, 0.47);
        let elbow =
            [shoulder[0] - 0.29 * arm.sin(), shoulder[1] + sign * 0.04, shoulder[2] - 0.29 * arm.cos()];
        let fore = arm - 0.35;
        let wrist = [elbow[0] - 0.25 * fore.sin(), elbow[1], elbow[2] - 0.25 * fore.cos()];
        let hand = [wrist[0] - 0.09 * fore.sin(), wrist[1], wrist[2] - 0.09 * fore.cos()];
        let hip = at(0.0, sign * 0.09, 0.0);
        let Foot { ankle, pitch, .. } = foot(t, left);
        let toe = [ankle[0] + 0.17 * pitch.cos(), ankle[1], (ankle[2] - 0.06 - 0.17 * pitch.sin()).max(0.02)];
        points.extend([shoulder, elbow, wrist, hand, hip, knee(hip, ankle), ankle]);
        points.push(toe);
    }
    points
}

fn bones() -> Vec<Bone> {
    let bone = |name: &str, from, to, side, radius: f32| Bone {
        name: name.to_owned(),
        ends: [from, to],
        side,
        radius_m: (radius > 0.0).then_some(radius),
    };
    let mut bones = vec![
        bone("pelvis", 0, 1, Side::Middle, 0.095),
        bone("thorax", 1, 2, Side::Middle, 0.105),
        bone("neck", 2, 3, Side::Middle, 0.05),
        bone("head", 3, 4, Side::Middle, 0.085),
    ];
    for (first, side, word) in [(5, Side::Left, "left"), (13, Side::Right, "right")] {
        let names = [
            ("upper arm", 0, 1, 0.042),
            ("forearm", 1, 2, 0.033),
            ("hand", 2, 3, 0.028),
            ("thigh", 4, 5, 0.065),
        ];
        let names = names.into_iter().chain([("shank", 5, 6, 0.047), ("foot", 6, 7, 0.034)]);
        bones.extend(
            names.map(|(name, a, b, r)| bone(&format!("{word} {name}"), first + a, first + b, side, r)),
        );
    }
    bones
}

/// The force under a foot and where it acts, if the foot is on this plate.
fn under(t: f32, left: bool, plate: &[f32; 4]) -> Option<([f32; 3], [f32; 3])> {
    let Foot { ankle, stance: p, .. } = foot(t, left);
    let on = ankle[0] > plate[0] && ankle[0] + 0.17 < plate[1];
    let shape = |k: f32| (k * PI * p).sin();
    let vertical = WEIGHT_N * (1.12 * shape(1.0) + 0.27 * shape(3.0) + 0.05 * shape(5.0));
    let force = [-0.19 * WEIGHT_N * shape(2.0), if left { -0.05 } else { 0.05 } * vertical, vertical];
    (on && p.is_finite() && vertical > 10.0).then_some(([ankle[0] - 0.05 + 0.19 * p, ankle[1], 0.0], force))
}

/// The arrows of one plate; the prediction is off by a few percent.
fn arrow(times: &[f32], number: usize, plate: &[f32; 4]) -> ForceArrow {
    let unknown = [f32::NAN; 3];
    let found = |t: f32| [true, false].into_iter().find_map(|left| under(t, left, plate));
    let measured = |t: f32| found(t).map_or(unknown, |(_, force)| force);
    let wobble = |t: f32| 1.0 + 0.05 * (17.0 * t + number as f32).sin();
    ForceArrow {
        name: format!("plate {}", number + 1),
        at_m: times.iter().map(|t| found(*t).map_or(unknown, |(at, _)| at)).collect(),
        measured_n: times.iter().map(|t| measured(*t)).collect(),
        predicted_n: times.iter().map(|t| measured(*t).map(|v| v * wobble(*t))).collect(),
    }
}

/// Tells whether every foot on the floor is on a plate.
fn is_used(t: f32) -> bool {
    let on_plate = |left| PLATES.iter().any(|plate| under(t, left, plate).is_some());
    [true, false].into_iter().all(|left| foot(t, left).stance.is_nan() || on_plate(left))
}

/// A component of the wrench, and two predictions of which the second is worse.
fn curve(times: &[f32], forces: &[ForceArrow], component: usize) -> Curve {
    let names = [("Fx", "N"), ("Fy", "N"), ("Fz", "N"), ("Mx", "N m"), ("My", "N m"), ("Mz", "N m")];
    let value = |k: usize| {
        let sum = |j: usize| forces.iter().map(|f| f.measured_n[k][j]).filter(|v| v.is_finite()).sum::<f32>();
        let [x, y, z] = [sum(0), sum(1), sum(2)];
        let arm = 0.06 * (2.0 * PI * times[k] / STRIDE_S).cos();
        [x, y, z, 0.9 * y + arm * z, -0.9 * x + 0.3 * arm * z, 0.5 * arm * x][component]
    };
    let measured: Vec<f32> =
        times.iter().enumerate().map(|(k, t)| if is_used(*t) { value(k) } else { f32::NAN }).collect();
    let off = |size: f32, rate: f32| {
        let pairs = times.iter().zip(&measured);
        pairs.map(|(t, v)| v * (1.0 + size * (rate * t).sin()) + 60.0 * size).collect()
    };
    let (name, unit) = names[component];
    let (identified, table) = (off(0.05, 17.0), off(0.17, 11.0));
    Curve { name: name.to_owned(), unit: unit.to_owned(), measured, identified, table }
}

fn errors(curve: &Curve) -> ErrorRow {
    let rms = |line: &[f32]| {
        let off = line.iter().zip(&curve.measured).map(|(a, b)| f64::from(a - b)).filter(|e| e.is_finite());
        let (sum, number) = off.fold((0.0, 0.0), |(sum, number), e| (sum + e * e, number + 1.0));
        let value = f64::sqrt(sum / number);
        Rms { value, percent: 100.0 * value / f64::from(WEIGHT_N) }
    };
    let (identified, table) = (rms(&curve.identified), rms(&curve.table));
    ErrorRow { name: curve.name.clone(), unit: curve.unit.clone(), identified, table }
}

/// Returns a walk of the given number of seconds.
pub fn walk(title: &str, seconds: f32) -> MotionPage {
    let times: Vec<f32> = (0..(seconds * RATE) as usize).map(|k| k as f32 / RATE).collect();
    let points: Vec<_> = times.iter().map(|t| frame(*t)).collect();
    let forces: Vec<ForceArrow> =
        PLATES.iter().enumerate().map(|(k, plate)| arrow(&times, k, plate)).collect();
    let curves: Vec<Curve> = (0..6).map(|component| curve(&times, &forces, component)).collect();
    let corners = |[x0, x1, y0, y1]: [f32; 4]| [[x0, y0, 0.0], [x1, y0, 0.0], [x1, y1, 0.0], [x0, y1, 0.0]];
    MotionPage {
        title: title.to_owned(),
        rate_hz: f64::from(RATE),
        forward: [1.0, 0.0],
        bones: bones(),
        markers_m: markers(&points),
        marker_names: Vec::new(),
        com_m: points.iter().map(|p| [p[0][0] + 0.01, p[0][1], p[0][2] + 0.06]).collect(),
        points_m: points,
        plates_m: PLATES.map(corners).to_vec(),
        about: "the pelvis".to_owned(),
        errors: curves.iter().map(errors).collect(),
        used: times.iter().map(|t| is_used(*t)).collect(),
        curves,
        forces,
    }
}

/// Three markers about each joint, each hidden for a while.
fn markers(points: &[Vec<[f32; 3]>]) -> Vec<Vec<[f32; 3]>> {
    let offsets = [[0.05, 0.0, 0.02], [-0.03, 0.05, 0.0], [-0.02, -0.05, -0.02]];
    let of_frame = |(k, frame): (usize, &Vec<[f32; 3]>)| {
        let joints = frame.iter().take(15).enumerate();
        joints
            .flat_map(|(j, p)| {
                let hidden = (k + 37 * j) % 400 < 40;
                offsets.map(|d| if hidden { [f32::NAN; 3] } else { [p[0] + d[0], p[1] + d[1], p[2] + d[2]] })
            })
            .collect()
    };
    points.iter().enumerate().map(of_frame).collect()
}
