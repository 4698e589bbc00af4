//! People in the computer who share nothing with the program: another table (men's masses by R. Dumas et al.
//! 2007), other joints, skin that slides over bone, forces from differences of places in time, and files as
//! laboratories write them. They move in one plane, y to the left and z up.

use std::f64::consts::PI;
use std::fmt::Write as _;

const GRAVITY: f64 = 9.806_65;
/// Step of differences in time, s.
const STEP_S: f64 = 2e-3;

/// A segment: its parent, its joint in that, mass over the body's, centre and radius of gyration about y, m.
struct Segment {
    name: &'static str,
    parent: usize,
    joint: [f64; 3],
    mass: f64,
    centre: [f64; 3],
    radius: f64,
}

/// Somebody so tall and heavy.
#[derive(Clone, Copy)]
pub(crate) struct Somebody {
    pub height_m: f64,
    pub mass_kg: f64,
    /// Skin slides by this much where a joint bends by a quarter of a turn, m.
    pub skin_m: f64,
    /// 1 σ of a force channel, N.
    pub plate_n: f64,
    /// A thing in the right hand: its mass, kg, its centre in the hand and its radius of gyration about y, m.
    pub held: Option<(f64, [f64; 3], f64)>,
}

/// The posture of a person at an instant; turns about y, rad, a bend forward positive.
#[derive(Clone, Copy, Default)]
pub(crate) struct Posture {
    /// Midway between the hips, x and z, m.
    pub hip: [f64; 2],
    pub pelvis: f64,
    pub trunk: f64,
    /// Left and right.
    pub arms: [f64; 2],
    pub elbows: [f64; 2],
    /// x and z of each ankle, m.
    pub ankles: [[f64; 2]; 2],
    pub soles: [f64; 2],
    /// The distance of each foot to the side, m.
    pub beside: f64,
}

/// The supports of her at an instant.
#[derive(Clone, Copy)]
pub(crate) enum Carried {
    /// Both feet, on a plate each.
    Both,
    /// One foot, on its plate, with the centre of pressure so far before its ankle, m.
    One(usize, f64),
    /// Both feet, and a seat whose vertical push is at this x, m, as balance has it about the middle of the
    /// feet.
    Seat(f64),
    /// Both feet, and a seat that carries this share of the weight, where balance about the middle of the
    /// feet has it.
    SeatOf(f64),
    /// Both feet, and a hand at (x, z), m, which is pushed upwards, N.
    Hand([f64; 2], f64),
    /// Something that no plate measures.
    Elsewhere,
    /// Nothing.
    Flight,
}

/// A recording as text: markers (TRC) and forces of two plates (MOT).
pub(crate) struct Files {
    pub trc: String,
    pub mot: String,
}

/// From 0 to 1 between two instants, without a jerk at either end.
pub(crate) fn ramp(t: f64, from: f64, to: f64) -> f64 {
    let u = ((t - from) / (to - from)).clamp(0.0, 1.0);
    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
}

/// Normal noise, the same every time.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }

    fn normal(&mut self, sigma: f64) -> f64 {
        sigma * ((0..12).map(|_| self.uniform()).sum::<f64>() - 6.0)
    }
}

/// The place of a segment: its turn about y and its origin.
type Place = (f64, [f64; 3]);

fn on((turn, at): &Place, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let (s, c) = turn.sin_cos();
    [at[0] + c * x + s * z, at[1] + y, at[2] - s * x + c * z]
}

impl Somebody {
    fn leg(&self) -> [f64; 3] {
        [0.245, 0.246, 0.039].map(|share| share * self.height_m)
    }

    /// Height of the hips of somebody upright with knees a little bent, m.
    pub(crate) fn upright_m(&self) -> f64 {
        self.leg().iter().sum::<f64>() - 0.008
    }

    fn segments(&self) -> Vec<Segment> {
        let h = self.height_m;
        let [thigh, shank, ankle] = self.leg();
        let one =
            |name, parent, joint, mass, centre, radius| Segment { name, parent, joint, mass, centre, radius };
        let mut all = vec![
            one("pelvis", 0, [0.0; 3], 0.142, [-0.01, 0.0, 0.045 * h / 1.7], 0.075),
            one("trunk", 0, [-0.035, 0.0, 0.135], 0.333, [0.015, 0.0, 0.105 * h], 0.155),
            one("head", 1, [0.0, 0.0, 0.200 * h], 0.067, [0.02, 0.0, 0.09 * h], 0.08),
        ];
        for side in [1.0, -1.0] {
            let k = all.len();
            let (upper, fore) = (0.186 * h, 0.146 * h);
            all.extend([
                one(
                    "upper_arm",
                    1,
                    [0.0, side * 0.11 * h, 0.175 * h],
                    0.024,
                    [0.0, 0.0, -0.436 * upper],
                    0.322 * upper,
                ),
                one("forearm", k, [0.0, 0.0, -upper], 0.017, [0.0, 0.0, -0.430 * fore], 0.303 * fore),
                one("hand", k + 1, [0.0, 0.0, -fore], 0.006, [0.0, 0.0, -0.05], 0.03),
                one(
                    "thigh",
                    0,
                    [0.0, side * 0.05 * h, 0.0],
                    0.123,
                    [0.01, 0.0, -0.433 * thigh],
                    0.323 * thigh,
                ),
                one("shank", k + 3, [0.0, 0.0, -thigh], 0.048, [0.0, 0.0, -0.433 * shank], 0.302 * shank),
                one("foot", k + 4, [0.0, 0.0, -shank], 0.011, [0.05, 0.0, -0.5 * ankle], 0.07),
            ]);
        }
        let right_hand = all.iter().rposition(|segment| segment.name == "hand").unwrap_or(0);
        all.extend(
            self.held
                .map(|(kg, at, radius)| one("held", right_hand, [0.0; 3], kg / self.mass_kg, at, radius)),
        );
        all
    }

    fn places(&self, p: &Posture) -> Vec<Place> {
        let [thigh, shank, _] = self.leg();
        let bends = |side: usize| {
            let ankle = p.ankles[side];
            let (dx, dz) = (ankle[0] - p.hip[0], ankle[1] - p.hip[1]);
            let d = dx.hypot(dz).min(0.9995 * (thigh + shank));
            let bent =
                ((d * d - thigh * thigh - shank * shank) / (2.0 * thigh * shank)).clamp(-1.0, 1.0).acos();
            let upper = (-dx).atan2(-dz) - (shank * bent.sin() / d).clamp(-1.0, 1.0).asin();
            [upper, upper + bent, p.soles[side]]
        };
        let (l, r) = (bends(0), bends(1));
        let arm = |side: usize| {
            let upper = p.trunk - p.arms[side];
            [upper, upper - p.elbows[side], upper - p.elbows[side]]
        };
        let held = vec![arm(1)[2]];
        let turns =
            [[p.pelvis, p.trunk, p.trunk].to_vec(), arm(0).into(), l.into(), arm(1).into(), r.into(), held]
                .concat();
        let mut all: Vec<Place> = Vec::new();
        for (k, segment) in self.segments().iter().enumerate() {
            let at = match k {
                0 => [p.hip[0], 0.0, p.hip[1]],
                _ => on(&all[segment.parent], segment.joint),
            };
            all.push((turns[k], at));
        }
        all
    }

    fn centres(&self, p: &Posture) -> Vec<[f64; 3]> {
        self.places(p).iter().zip(self.segments()).map(|(place, segment)| on(place, segment.centre)).collect()
    }

    /// The centre of mass, x and z.
    pub(crate) fn centre(&self, p: &Posture) -> [f64; 2] {
        let all = self.centres(p);
        let whole: f64 = self.segments().iter().map(|s| s.mass).sum();
        let sum = |k: usize| all.iter().zip(self.segments()).map(|(c, s)| s.mass * c[k]).sum::<f64>();
        [sum(0), sum(2)].map(|v| v / whole)
    }

    /// Returns a posture with the hips where the centre of mass is at a place.
    pub(crate) fn centred(&self, mut p: Posture, at: [f64; 2]) -> Posture {
        for _ in 0..12 {
            let now = self.centre(&p);
            p.hip = [p.hip[0] + at[0] - now[0], p.hip[1] + at[1] - now[1]];
        }
        p
    }

    /// Force and moment about the origin that all together need, x, z and about y; and about x and z.
    fn needed(&self, motion: &dyn Fn(f64) -> Posture, t: f64) -> [f64; 6] {
        let around = [-1.0, 0.0, 1.0].map(|k| motion(t + k * STEP_S));
        let centres = around.map(|p| self.centres(&p));
        let turns = around.map(|p| self.places(&p));
        let mut sum = [0.0; 6];
        for (k, segment) in self.segments().iter().enumerate() {
            let m = segment.mass * self.mass_kg;
            let at = centres[1][k];
            let a = |axis: usize| {
                (centres[0][k][axis] + centres[2][k][axis] - 2.0 * at[axis]) / (STEP_S * STEP_S)
            };
            let (fx, fz) = (m * a(0), m * (a(2) + GRAVITY));
            let turn = (turns[0][k].0 + turns[2][k].0 - 2.0 * turns[1][k].0) / (STEP_S * STEP_S);
            let own = [fx, 0.0, fz, at[1] * fz, at[2] * fx - at[0] * fz, -at[1] * fx];
            sum.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
            sum[4] += m * segment.radius.powi(2) * turn;
        }
        sum
    }

    /// Forces of the plates under the left and right foot, [fx, fz, px, py, free moment], and what no plate
    /// measures, N.
    fn plates(&self, motion: &dyn Fn(f64) -> Posture, carried: Carried, t: f64) -> ([[f64; 5]; 2], f64) {
        let mut all = self.needed(motion, t);
        let p = motion(t);
        let mut hidden = 0.0;
        let push = |all: &mut [f64; 6], x: f64, force: f64| {
            all[2] -= force;
            all[4] += x * force;
        };
        match carried {
            Carried::Seat(at) => {
                let feet = (p.ankles[0][0] + p.ankles[1][0]) / 2.0 + 0.05;
                let x = -all[4] / all[2];
                hidden = (all[2] * (x - feet) / (at - feet)).clamp(0.0, 0.85 * all[2].max(0.0));
                push(&mut all, at, hidden);
            }
            Carried::SeatOf(share) => {
                let feet = (p.ankles[0][0] + p.ankles[1][0]) / 2.0 + 0.05;
                let x = -all[4] / all[2];
                hidden = share * all[2];
                push(&mut all, (x - (1.0 - share) * feet) / share, hidden);
            }
            Carried::Hand([x, _], force) => {
                hidden = force;
                push(&mut all, x, force);
            }
            Carried::Elsewhere => (hidden, all) = (all[2], [0.0; 6]),
            Carried::Flight => all = [0.0; 6],
            Carried::Both | Carried::One(..) => {}
        }
        let ankle = |foot: usize| p.ankles[foot][0];
        let x = match carried {
            Carried::One(foot, before) => ankle(foot) + before,
            _ if all[2].abs() > 20.0 => (-all[4] / all[2]).clamp(ankle(0) - 0.1, ankle(0) + 0.25),
            _ => 0.0,
        };
        // What is held in one hand presses on that side.
        let aside = if self.held.is_some() { all[3] / (2.0 * p.beside * all[2]) } else { 0.0 };
        let free = if self.held.is_some() { all[5] + all[3] / all[2] * all[0] } else { 0.0 };
        let of = |foot: usize| {
            let share = match carried {
                Carried::One(own, _) => f64::from(u8::from(own == foot)),
                _ if foot == 0 => 0.5 + aside,
                _ => 0.5 - aside,
            };
            let y = if foot == 0 { p.beside } else { -p.beside };
            [share * all[0], share * all[2], x, y, free / 2.0]
        };
        ([of(0), of(1)], hidden)
    }

    /// Records a motion of some seconds, 100 frames a second, forces 1000.
    pub(crate) fn recorded(
        &self,
        seconds: f64,
        motion: &dyn Fn(f64) -> Posture,
        carried: &dyn Fn(f64) -> Carried,
    ) -> Files {
        let mut noise = Noise(self.mass_kg.to_bits());
        let markers = self.markers();
        let count = (seconds * 100.0) as usize;
        let mut trc = format!(
            "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n\
             100\t100\t{count}\t{}\tmm\t100\t1\t{count}\nFrame#\tTime",
            markers.len()
        );
        markers.iter().for_each(|(name, ..)| trc += &format!("\t{name}\t\t"));
        trc += "\n\t";
        (1..=markers.len()).for_each(|k| trc += &format!("\tX{k}\tY{k}\tZ{k}"));
        trc += "\n\n";
        for frame in 0..count {
            let t = frame as f64 / 100.0;
            let places = self.places(&motion(t));
            let _ = write!(trc, "{}\t{t:.4}", frame + 1);
            for (_, segment, at) in &markers {
                let parent = self.segments()[*segment].parent;
                let bend = (places[*segment].0 - places[parent].0).sin();
                let slid = [at[0], at[1], at[2] + self.skin_m * bend];
                let [x, y, z] = on(&places[*segment], slid).map(|v| 1e3 * (v + noise.normal(5e-4)));
                let _ = write!(trc, "\t{x:.3}\t{z:.3}\t{:.3}", -y);
            }
            trc += "\n";
        }
        let rows = count * 10;
        let mut mot = format!("forces\nversion=1\nnRows={rows}\nnColumns=19\ninDegrees=yes\nendheader\ntime");
        for plate in ["", "1_"] {
            for (kind, letters) in [("ground_force_v", "xyz"), ("ground_force_p", "xyz")] {
                letters.chars().for_each(|c| mot += &format!("\t{plate}{kind}{c}"));
            }
        }
        for plate in ["", "1_"] {
            "xyz".chars().for_each(|c| mot += &format!("\t{plate}ground_torque_{c}"));
        }
        for sample in 0..rows {
            let t = sample as f64 / 1000.0;
            let (feet, _) = self.plates(motion, carried(t), t);
            let _ = write!(mot, "\n{t:.4}");
            for [fx, fz, px, py, _] in feet {
                let [fx, fy, fz] = [fx, 0.0, fz].map(|v| v + noise.normal(self.plate_n));
                let (px, py) = if fz > 20.0 { (px, py) } else { (0.0, 0.0) };
                let _ = write!(mot, "\t{fx:.4}\t{fz:.4}\t{:.4}\t{px:.5}\t0\t{:.5}", -fy, -py);
            }
            for [.., free] in feet {
                let _ = write!(mot, "\t0\t{free:.4}\t0");
            }
        }
        Files { trc, mot: mot + "\n" }
    }

    /// Names of markers, segments and places.
    fn markers(&self) -> Vec<(String, usize, [f64; 3])> {
        let [_, _, ankle] = self.leg();
        let h = self.height_m;
        let mut all: Vec<(String, usize, [f64; 3])> = Vec::new();
        let mut put = |name: String, segment: &str, second: bool, at: [f64; 3]| {
            let mut own =
                self.segments().into_iter().enumerate().filter(|(_, s)| s.name == segment).map(|(k, _)| k);
            all.push((name, own.nth(usize::from(second)).unwrap_or(0), at));
        };
        put("V.Sacral".into(), "pelvis", false, [-0.12, 0.0, 0.07]);
        put("C7".into(), "trunk", false, [-0.07, 0.0, 0.19 * h]);
        put("Sternum".into(), "trunk", false, [0.10, 0.0, 0.11 * h]);
        put("Top.Head".into(), "head", false, [0.01, 0.0, 0.145 * h]);
        for (side, y) in [("L", 1.0), ("R", -1.0)] {
            let second = y < 0.0;
            let mut own = |name: &str, segment: &str, at: [f64; 3]| {
                put(format!("{side}.{name}"), segment, second, [at[0], y * at[1], at[2]]);
            };
            let is_one = |at: [f64; 3]| at;
            own("Elbow.Lat", "upper_arm", [0.0, 0.045, -0.186 * h]);
            own("Bicep", "upper_arm", [0.04, 0.02, -0.09 * h]);
            own("Wrist.Lat", "hand", [0.03, 0.0, 0.0]);
            own("Wrist.Med", "hand", [-0.03, 0.0, 0.0]);
            own("Hand", "hand", [0.0, 0.02, -0.08]);
            own("Thigh.Upper", "thigh", [0.03, 0.08, -0.1 * h]);
            own("Thigh.Front", "thigh", [0.07, 0.03, -0.15 * h]);
            own("Knee.Lat", "thigh", [0.0, 0.055, -0.247 * h]);
            own("Shank.Upper", "shank", [0.02, 0.06, -0.08 * h]);
            own("Shank.Front", "shank", [0.05, 0.0, -0.13 * h]);
            own("Ankle.Lat", "shank", [0.0, 0.045, -0.248 * h]);
            own("Heel", "foot", is_one([-0.062, 0.0, -0.6 * ankle]));
            own("Toe.Tip", "foot", [0.165, 0.0, -0.65 * ankle]);
            own("Toe.Lat", "foot", [0.11, 0.045, -0.65 * ankle]);
        }
        for (name, segment, at) in [
            ("ASIS", 0, [0.065, 0.125, 0.09]),
            ("Acromium", 1, [0.0, 0.11 * h, 0.175 * h + 0.045]),
            ("Temple", 2, [0.06, 0.075, 0.09 * h]),
        ] {
            for (side, y) in [("L", 1.0), ("R", -1.0)] {
                all.push((format!("{side}.{name}"), segment, [at[0], y * at[1], at[2]]));
            }
        }
        all
    }
}

/// Upright, hands hanging.
pub(crate) fn upright(body: &Somebody) -> Posture {
    let ankle = body.leg()[2];
    Posture {
        hip: [-0.005, body.upright_m()],
        arms: [0.05; 2],
        elbows: [0.1; 2],
        ankles: [[0.0, ankle]; 2],
        beside: 0.11,
        ..Posture::default()
    }
}

/// Rises from a chair and sits down again, some seconds a turn; upright from `t` on for a third of the turn.
pub(crate) fn rising(body: &Somebody, turn_s: f64) -> impl Fn(f64) -> Posture + '_ {
    move |t: f64| {
        let u = (t / turn_s).rem_euclid(1.0);
        let lean = ramp(u, 0.16, 0.32) * (1.0 - ramp(u, 0.32, 0.50))
            + ramp(u, 0.66, 0.82) * (1.0 - ramp(u, 0.82, 0.98));
        let up = ramp(u, 0.29, 0.50) * (1.0 - ramp(u, 0.68, 0.88));
        let sway = 0.004 * (2.0 * PI * 0.4 * t).sin();
        let mut p = upright(body);
        let seated = [-0.24, 0.52];
        p.hip = [seated[0] + (p.hip[0] - seated[0]) * up + sway, seated[1] + (p.hip[1] - seated[1]) * up];
        p.trunk = 0.08 + 0.75 * lean + 0.5 * sway;
        p.pelvis = 0.25 * p.trunk - 0.15 * (1.0 - up);
        p.arms = [0.1 + 0.9 * lean + sway, 0.1 + 0.8 * lean - sway];
        p.elbows = [0.4 - 0.2 * up, 0.4 - 0.25 * up];
        p
    }
}

/// Returns whether the seat of [`rising`] carries.
pub(crate) fn on_the_seat(turn_s: f64) -> impl Fn(f64) -> Carried {
    move |t: f64| {
        let u = (t / turn_s).rem_euclid(1.0);
        if (0.33..0.855).contains(&u) { Carried::Both } else { Carried::Seat(-0.30) }
    }
}

/// The gait of somebody who runs on a belt.
#[derive(Clone, Copy)]
pub(crate) struct Gait {
    pub speed_mps: f64,
    /// From one foot's landing to the other's, s.
    pub step_s: f64,
    pub stance_s: f64,
}

impl Gait {
    /// The foot that landed last, and the time since then, s.
    fn phase(&self, t: f64) -> (usize, f64) {
        let steps = (t / self.step_s).floor();
        (steps as i64 as usize % 2, t - steps * self.step_s)
    }

    /// Returns what carries her.
    pub(crate) fn carried(&self, t: f64) -> Carried {
        let (foot, since) = self.phase(t);
        match since / self.stance_s {
            u if u < 1.0 => Carried::One(foot, -0.03 + 0.2 * u),
            _ => Carried::Flight,
        }
    }

    fn centre(&self, t: f64) -> [f64; 2] {
        let (_, since) = self.phase(t);
        let (tc, ts) = (self.stance_s, self.step_s);
        let peak = GRAVITY * ts * PI / (2.0 * tc);
        // Twice the integral of peak sin(π t / tc) − g from the beginning of the stance on, whose speed is
        // that of half a flight.
        let k = PI / tc;
        let down = -GRAVITY * (ts - tc) / 2.0;
        let z = |t: f64| down * t + peak / k * (t - (k * t).sin() / k) - GRAVITY * t * t / 2.0;
        let fall = |t: f64| z(tc) - down * t - GRAVITY * t * t / 2.0;
        let height = if since < tc { z(since) } else { fall(since - tc) };
        // Braked, then driven.
        let brake = 2.5;
        let q = 2.0 * PI / tc;
        let u = since.min(tc);
        let x = -brake / q * (u - (q * u).sin() / q) + brake * tc / q * (since / ts);
        [x, height]
    }

    pub(crate) fn posture(&self, body: &Somebody, t: f64) -> Posture {
        let mut p = upright(body);
        let ankle = body.leg()[2];
        let stride = 2.0 * self.step_s;
        for foot in 0..2 {
            let since = (t - foot as f64 * self.step_s).rem_euclid(stride);
            let (tc, v) = (self.stance_s, self.speed_mps);
            let (x, z, sole) = if since < tc {
                let u = since / tc;
                (v * (tc / 2.0 - since), 0.06 * ramp(u, 0.6, 1.0), 0.5 * ramp(u, 0.6, 1.0))
            } else {
                let (s, length) = ((since - tc) / (stride - tc), stride - tc);
                let (from, to, slope) = (-v * tc / 2.0, v * tc / 2.0, -v * length);
                let (s2, s3) = (s * s, s * s * s);
                let x = (2.0 * s3 - 3.0 * s2 + 1.0) * from
                    + (s3 - 2.0 * s2 + s) * slope
                    + (3.0 * s2 - 2.0 * s3) * to
                    + (s3 - s2) * slope;
                let bump = (PI * s).sin().powi(2);
                (
                    x,
                    0.06 * (1.0 - ramp(s, 0.0, 0.5)) + 0.22 * bump,
                    0.5 * (1.0 - ramp(s, 0.0, 0.9)) + 0.5 * bump,
                )
            };
            p.ankles[foot] = [x, ankle + z];
            p.soles[foot] = sole;
        }
        let swing = (PI * t / self.step_s).cos();
        p.arms = [-0.45 * swing, 0.45 * swing];
        p.elbows = [1.3; 2];
        p.trunk = 0.15;
        p.pelvis = 0.12;
        p.beside = 0.04;
        let [x, z] = self.centre(t);
        body.centred(p, [x, 0.525 * body.height_m + z])
    }
}

/// A jump from a box onto the plates and up again, s: when she leaves the box, lands, takes off, lands again.
pub(crate) const DROP_S: [f64; 4] = [2.0, 2.247, 2.597, 3.046];
const BOX_M: f64 = 0.3;

/// Vertical acceleration of a drop jump, m/s².
fn drop_acceleration(t: f64) -> f64 {
    let [off, land, up, again] = DROP_S;
    let half = |from: f64, to: f64, change: f64| {
        let u = (t - from) / (to - from);
        change / (to - from) * 2.0 * (PI * u).sin().powi(2)
    };
    match t {
        _ if t < off => 0.0,
        _ if t < land => -GRAVITY,
        _ if t < up => half(land, up, GRAVITY * (land - off + (again - up) / 2.0)),
        _ if t < again => -GRAVITY,
        _ if t < again + 0.4 => half(again, again + 0.4, GRAVITY * (again - up) / 2.0),
        _ => 0.0,
    }
}

/// The motion of a drop jump.
pub(crate) fn drop_jump(body: &Somebody) -> impl Fn(f64) -> Posture + '_ {
    let fine = 1e-3;
    let (mut z, mut v) = (0.0, 0.0);
    let mut heights = vec![0.0];
    for k in 0..8000 {
        let a = drop_acceleration(k as f64 * fine);
        z += v * fine + a * fine * fine / 2.0;
        v += (a + drop_acceleration((k + 1) as f64 * fine)) / 2.0 * fine;
        heights.push(z);
    }
    let from = body.centre(&upright(body))[1] + BOX_M;
    let last = heights[8000];
    move |t: f64| {
        let height = |t: f64| {
            let place = (t / fine).clamp(0.0, 7999.0);
            let k = place as usize;
            heights[k] + (heights[k + 1] - heights[k]) * (place - k as f64)
        };
        let ankle = body.leg()[2];
        let [off, land, up, again] = DROP_S;
        // From the deep landing up to where she began, less the box.
        let rise = (-BOX_M - last) * ramp(t, again + 0.6, again + 1.8);
        let x = -0.3 + 0.3 * ramp(t, off - 0.5, land);
        let sole = match t {
            _ if t < land => ankle + (height(t) + BOX_M).max(0.0),
            _ if (up..again).contains(&t) => ankle + (height(t) - height(up)).max(0.0),
            _ => ankle,
        };
        let mut p = upright(body);
        p.ankles = [[x, sole]; 2];
        let bent = ((from - BOX_M - 0.0 - (from + height(t) + rise)) / 0.3).clamp(0.0, 1.0);
        p.trunk = 0.05 + 0.5 * bent;
        p.pelvis = 0.2 * bent;
        let sway = 0.004 * (2.0 * PI * 0.4 * t).sin();
        body.centred(p, [x + 0.02 + sway, from - 0.02 + height(t) + rise])
    }
}

/// Returns what carries her in [`drop_jump`].
pub(crate) fn drop_carried(t: f64) -> Carried {
    let [off, land, up, again] = DROP_S;
    match t {
        _ if t < off => Carried::Elsewhere,
        _ if t < land || (up..again).contains(&t) => Carried::Flight,
        _ => Carried::Both,
    }
}
