//! Recordings of a body to which something happens.

use hexapod::{Axis, BodyParameters, FrameMotion, Geometry, MotionProgram, Segment, SineTerm};
use nalgebra::{Matrix3, Vector3};
use rigident_shared::calibration::Reading;
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

use super::super::problem::Normal;
use super::{Case, DURATION_S, LOAD_CELL, RATE_HZ};

const GRAVITY: f64 = 9.80665;
/// 1/f noise begins where it is as large as the white noise, Hz.
const CORNER_HZ: f64 = 1.0;

fn body() -> BodyParameters {
    BodyParameters {
        mass_kg: 3.2,
        com_m: [0.03, -0.02, 0.08],
        inertia_com_kgm2: [0.02, 0.025, 0.015, 0.0015, -0.001, 0.002],
    }
}

/// Returns the sum of two bodies, the second a point.
fn with_point(body: &BodyParameters, mass_kg: f64, at: Vector3<f64>) -> BodyParameters {
    let whole = body.mass_kg + mass_kg;
    let own = Vector3::from(body.com_m);
    let com = (own * body.mass_kg + at * mass_kg) / whole;
    let mut inertia = body.inertia_com_kgm2;
    for (mass, place) in [(body.mass_kg, own), (mass_kg, at)] {
        let d = place - com;
        let add = [
            d.y * d.y + d.z * d.z,
            d.z * d.z + d.x * d.x,
            d.x * d.x + d.y * d.y,
            -d.y * d.z,
            -d.z * d.x,
            -d.x * d.y,
        ];
        inertia.iter_mut().zip(add).for_each(|(i, a)| *i += mass * a);
    }
    BodyParameters { mass_kg: whole, com_m: com.into(), inertia_com_kgm2: inertia }
}

/// Returns a uniform number from −1 to 1.
fn uniform(normal: &mut Normal) -> f64 {
    // The phase of two normal deviates.
    normal.draw().atan2(normal.draw()) / std::f64::consts::PI
}

fn motion(normal: &mut Normal, (rest_s, moving_s, faster): (f64, f64, f64)) -> MotionProgram {
    let mut terms = Vec::new();
    for axis in [Axis::Roll, Axis::Pitch, Axis::Yaw] {
        for (amplitude, frequency_hz) in [(0.25, 0.3), (0.15, 0.8), (0.1, 1.4)] {
            terms.push(SineTerm {
                axis,
                amplitude,
                frequency_hz: faster * frequency_hz * (1.0 + 0.25 * uniform(normal)),
                phase_rad: std::f64::consts::PI * uniform(normal),
            });
        }
    }
    let rest = (rest_s > 0.0).then_some(Segment::Hold { duration_s: rest_s });
    let moving = Segment::Multisine { duration_s: moving_s, ramp_s: 2.0, terms };
    MotionProgram { start: Geometry::thesis().home(), segments: rest.into_iter().chain([moving]).collect() }
}

/// 1/f noise whose density is that of white noise of unit variance per sample at [`CORNER_HZ`]: exponentially
/// correlated noise of time constants an octave apart.
struct Flicker {
    states: Vec<(f64, f64)>,
}

impl Flicker {
    const OCTAVES: i32 = 12;

    fn new(normal: &mut Normal) -> Self {
        let times = (0..Self::OCTAVES).map(|k| 2f64.powi(k - 6));
        let states = times.map(|time_s| (f64::exp(-1.0 / (RATE_HZ * time_s)), normal.draw()));
        Self { states: states.collect() }
    }

    fn next(&mut self, normal: &mut Normal) -> f64 {
        // Sum of Lorentzians 4 τ/(1 + (ωτ)²) per octave: (2/ln 2)/f; white noise has 2/rate.
        let variance = CORNER_HZ * std::f64::consts::LN_2 / RATE_HZ;
        for (rho, state) in &mut self.states {
            *state = *rho * *state + (1.0 - *rho * *rho).sqrt() * normal.draw();
        }
        variance.sqrt() * self.states.iter().map(|s| s.1).sum::<f64>()
    }
}

/// A recording and what is true of it.
pub(super) struct Recording {
    pub(super) readings: Vec<Reading<f64>>,
    pub(super) changed_at_s: f64,
}

/// Returns the body before and after the change.
fn bodies(case: Case, place: Vector3<f64>, direction: Vector3<f64>) -> (BodyParameters, BodyParameters) {
    let rest = body();
    match case {
        Case::Lost(mass) => (rest, with_point(&rest, -mass, place)),
        Case::Moved => {
            let without = with_point(&rest, -0.2, place);
            (rest, with_point(&without, 0.2, place + 0.005 * direction))
        }
        _ => (rest, rest),
    }
}

/// Adds a force that acts at a place to a wrench.
fn add(wrench: &mut [f64; 6], force: Vector3<f64>, at: Vector3<f64>) {
    let moment = at.cross(&force);
    wrench.iter_mut().zip(force.iter().chain(moment.iter())).for_each(|(w, v)| *w += v);
}

/// The motion at one sample in the body's own axes.
#[derive(Clone, Copy)]
struct Instant {
    time_s: f64,
    /// The earth's axes to the body's.
    to_s: Matrix3<f64>,
    /// Specific force at the origin, m/s².
    specific: Vector3<f64>,
    /// Angular rate, rad/s.
    rate: Vector3<f64>,
    /// Angular acceleration, rad/s².
    turning: Vector3<f64>,
}

impl Instant {
    fn of(time_s: f64, motion: &FrameMotion, gravity: &Vector3<f64>) -> Self {
        let to_s = motion.rotation.transpose();
        let specific = motion.specific_force(gravity);
        let (rate, turning) = (to_s * motion.angular_rate, to_s * motion.angular_acceleration);
        Self { time_s, to_s, specific, rate, turning }
    }
}

/// A mass on a spring.
struct Oscillator {
    /// Specific force of its place at the sample before.
    before: Option<Vector3<f64>>,
    /// The distance of the mass from its place, m, and its rate.
    swing: Vector3<f64>,
    swing_rate: Vector3<f64>,
}

impl Oscillator {
    const MASS: f64 = 0.3;
    const STEPS: u32 = 20;

    /// Goes on by a sample, of this specific force at its place, and adds what the spring does to the wrench.
    fn go_on(
        &mut self,
        (frequency, damping): (f64, f64),
        there: Vector3<f64>,
        place: Vector3<f64>,
        wrench: &mut [f64; 6],
    ) {
        let omega = std::f64::consts::TAU * frequency;
        let there_before = match self.before {
            Some(before) => before,
            None => {
                self.swing = -there / (omega * omega);
                there
            }
        };
        let of = |u: Vector3<f64>, swing: Vector3<f64>, swing_rate: Vector3<f64>| {
            -u - swing * (omega * omega) - swing_rate * (2.0 * damping * omega)
        };
        for step in 0..Self::STEPS {
            let share = (f64::from(step) + 0.5) / f64::from(Self::STEPS);
            let u = there_before * (1.0 - share) + there * share;
            self.swing_rate += of(u, self.swing, self.swing_rate) / (RATE_HZ * f64::from(Self::STEPS));
            self.swing += self.swing_rate / (RATE_HZ * f64::from(Self::STEPS));
        }
        self.before = Some(there);
        add(wrench, of(there, self.swing, self.swing_rate) * Self::MASS, place);
        let moment = self.swing.cross(&(there * Self::MASS));
        wrench.iter_mut().skip(3).zip(moment.iter()).for_each(|(w, v)| *w += v);
    }
}

/// A part that rattles for some samples after the force on it has changed its sign.
struct Rattle {
    sign: f64,
    left: u32,
}

impl Rattle {
    /// Returns true if it rattles in this sample, in which this force acts on it.
    fn go_on(&mut self, force: f64) -> bool {
        if force.signum() != self.sign {
            (self.sign, self.left) = (force.signum(), 20);
        }
        let rattles = self.left > 0;
        if rattles {
            self.left -= 1;
        }
        rattles
    }
}

/// The events of a recording, which goes on from sample to sample.
struct Events {
    case: Case,
    changed_at_s: f64,
    /// The place of what happens on the body, and its direction.
    place: Vector3<f64>,
    direction: Vector3<f64>,
    /// The place at the beginning, axes of the earth.
    began_at: Vector3<f64>,
    flicker: Vec<Flicker>,
    walk: [f64; 6],
    gyro_walk: Vector3<f64>,
    oscillator: Oscillator,
    rattle: Rattle,
    /// The times of knocks, s.
    knocks: Vec<f64>,
}

impl Events {
    fn new(
        case: Case,
        changed_at_s: f64,
        (place, direction): (Vector3<f64>, Vector3<f64>),
        began_at: Vector3<f64>,
        normal: &mut Normal,
    ) -> Self {
        let flicker: Vec<Flicker> = (0..6).map(|_| Flicker::new(normal)).collect();
        let knocks: Vec<f64> = (0..2).map(|_| DURATION_S * (0.5 + 0.45 * uniform(normal))).collect();
        Self {
            case,
            changed_at_s,
            place,
            direction,
            began_at,
            flicker,
            walk: [0.0; 6],
            gyro_walk: Vector3::zeros(),
            oscillator: Oscillator { before: None, swing: Vector3::zeros(), swing_rate: Vector3::zeros() },
            rattle: Rattle { sign: 0.0, left: 0 },
            knocks,
        }
    }

    /// Adds the forces on the body that are not its own inertia's.
    fn add_forces(
        &mut self,
        motion: &FrameMotion,
        now: &Instant,
        wrench: &mut [f64; 6],
        normal: &mut Normal,
    ) {
        let place = self.place;
        let Instant { time_s, to_s, specific, rate, turning } = *now;
        match self.case {
            Case::Cable(stiffness) => {
                let moved = motion.position + motion.rotation * place - self.began_at;
                add(wrench, to_s * moved * stiffness, place);
            }
            Case::Mode(frequency, damping) => {
                let there = specific + turning.cross(&place) + rate.cross(&rate.cross(&place));
                self.oscillator.go_on((frequency, damping), there, place, wrench);
            }
            Case::Bolt => {
                let force = specific.x + turning.cross(&place).x;
                if self.rattle.go_on(force) {
                    add(wrench, Vector3::from_fn(|_, _| normal.draw()), place);
                }
            }
            Case::Knocks => {
                for knock in &self.knocks {
                    let phase = (time_s - knock) / 0.1;
                    if (0.0..1.0).contains(&phase) {
                        add(wrench, self.direction * 20.0 * (std::f64::consts::PI * phase).sin(), place);
                    }
                }
            }
            _ => {}
        }
    }

    /// Adds noise and offset of the load cell.
    fn add_noise(&mut self, time_s: f64, wrench: &mut [f64; 6], normal: &mut Normal) {
        let direction = self.direction;
        for c in 0..6 {
            wrench[c] += LOAD_CELL[c] * normal.draw();
            wrench[c] += match self.case {
                Case::Flicker => LOAD_CELL[c] * self.flicker[c].next(normal),
                Case::WarmUp => direction[c % 3] * if c < 3 { 1.0 } else { 0.02 } * f64::exp(-time_s / 8.0),
                Case::Walk => {
                    self.walk[c] += if c < 3 { 0.05 } else { 0.002 } * root_step() * normal.draw();
                    self.walk[c]
                }
                Case::Jump if time_s >= self.changed_at_s => {
                    direction[c % 3] * if c < 3 { 0.2 } else { 0.005 }
                }
                _ => 0.0,
            };
        }
    }

    /// Returns the gyro's bias at the next sample, rad/s.
    fn gyro_bias(&mut self, normal: &mut Normal) -> Vector3<f64> {
        if self.case == Case::GyroWalk {
            self.gyro_walk += Vector3::from_fn(|_, _| 2e-3 * root_step() * normal.draw());
        }
        self.gyro_walk
    }
}

/// Returns the root of a sample's duration, √s: walks grow with it.
fn root_step() -> f64 {
    RATE_HZ.sqrt().recip()
}

/// Makes the recording of a case.
pub(super) fn recording(case: Case, seed: u64) -> Recording {
    let mut normal = Normal::new(seed);
    let trajectory = motion(&mut normal, case.timing()).trajectory().expect("a fixed kind of motion");
    let changed_at_s = DURATION_S * (0.5 + 0.25 * uniform(&mut normal));
    let place = Vector3::from_fn(|_, _| 0.06 * uniform(&mut normal)) + Vector3::from(body().com_m);
    let direction = Vector3::from_fn(|_, _| normal.draw()).normalize();
    let (before, after) = bodies(case, place, direction);
    let [accel, gyro] = case.imu();
    let gravity = Vector3::new(0.0, 0.0, -GRAVITY);
    let start = trajectory.state(0.0);
    let began_at = start.position + start.rotation * place;
    let mut events = Events::new(case, changed_at_s, (place, direction), began_at, &mut normal);
    let (rest_s, moving_s, _) = case.timing();
    let count = ((rest_s + moving_s) * RATE_HZ) as usize;
    let readings = (0..count).map(|k| {
        let time_s = k as f64 / RATE_HZ;
        let motion = FrameMotion::of_plate(&trajectory.state(time_s));
        let own = if time_s < changed_at_s { &before } else { &after };
        let mut wrench = own.wrench(&motion, &gravity);
        let now = Instant::of(time_s, &motion, &gravity);
        events.add_forces(&motion, &now, &mut wrench, &mut normal);
        events.add_noise(time_s, &mut wrench, &mut normal);
        let rate = now.rate + events.gyro_bias(&mut normal);
        let noisy = |v: Vector3<f64>, sigma: f64, normal: &mut Normal| -> [f64; 3] {
            std::array::from_fn(|i| v[i] + sigma * normal.draw())
        };
        Reading {
            time_ns: (time_s * 1e9).round() as u64,
            wrench: Wrench::from_array(wrench),
            specific_force: SpecificForce::from_array(noisy(now.specific, accel, &mut normal)),
            angular_rate: AngularRate::from_array(noisy(rate, gyro, &mut normal)),
        }
    });
    Recording { readings: readings.collect(), changed_at_s }
}
