//! Motion by set points: a move to a pose from wherever the plate is, or a stream of poses at their times.
//!
//! The path is made of quintics that agree in value, rate and acceleration where they meet. After the last of
//! them the plate always brakes: a stream that ceases needs nobody to notice it.

use std::collections::VecDeque;

use super::config::RigError;
use hexapod::{Coordinates, Geometry, Pose};

/// Time to come to rest smoothly, and when nothing more is known, s.
const BRAKE_S: f64 = 0.3;
/// Time to come to rest abruptly, s.
const ABRUPT_S: f64 = 0.05;
/// Accelerations that are braked out of smoothly, m/s² and rad/s².
const BRAKED: [f64; 6] = [10.0, 10.0, 10.0, 30.0, 30.0, 30.0];
/// Sensors read the past by their delays, which are shorter than this, ns.
const KEPT_NS: f64 = 2e9;
/// Steps in which a move is checked against the legs, s.
const STEP_S: f64 = 0.004;

/// A piece of a motion, from one state to another.
#[derive(Clone, Debug)]
struct Piece {
    begin_ns: f64,
    /// The time at which the next piece takes over; before the piece's own end if it was cut.
    until_ns: f64,
    duration_s: f64,
    from: Coordinates,
    to: Coordinates,
    /// Powers 3 to 5 of `s = t / duration` for each coordinate.
    high: [[f64; 3]; 6],
}

impl Piece {
    /// Returns the quintic with the given value, rate and acceleration at both ends.
    fn new(begin_ns: f64, duration_s: f64, from: Coordinates, to: Coordinates) -> Self {
        let t = duration_s;
        let high = std::array::from_fn(|i| {
            let (c1, c2) = (from.rate[i] * t, 0.5 * from.acceleration[i] * t * t);
            let value = to.value[i] - from.value[i] - c1 - c2;
            let rate = to.rate[i] * t - c1 - 2.0 * c2;
            let bend = to.acceleration[i] * t * t - 2.0 * c2;
            [
                10.0 * value - 4.0 * rate + 0.5 * bend,
                -15.0 * value + 7.0 * rate - bend,
                6.0 * value - 3.0 * rate + 0.5 * bend,
            ]
        });
        Self { begin_ns, until_ns: begin_ns + 1e9 * duration_s, duration_s, from, to, high }
    }

    /// Brakes to rest: the rate falls as a cubic, so `x(T) = x + T (v/2 + a T/12)`.
    fn brake(begin_ns: f64, from: Coordinates) -> Self {
        Self::brake_in(BRAKE_S, begin_ns, from)
    }

    fn brake_in(brake_s: f64, begin_ns: f64, mut from: Coordinates) -> Self {
        // Where the points jump there is more of it: braked out smoothly it would lead far away.
        from.acceleration.iter_mut().zip(BRAKED).for_each(|(a, most)| *a = a.clamp(-most, most));
        let value = std::array::from_fn(|i| {
            from.value[i] + brake_s * (0.5 * from.rate[i] + from.acceleration[i] * brake_s / 12.0)
        });
        Self::new(begin_ns, brake_s, from, at_rest(value))
    }

    fn coordinates(&self, time_ns: f64) -> Coordinates {
        let t = self.duration_s;
        let s = ((time_ns - self.begin_ns) * 1e-9 / t).max(0.0);
        if s >= 1.0 {
            return self.to;
        }
        let mut out = Coordinates::default();
        for (i, [c3, c4, c5]) in self.high.into_iter().enumerate() {
            let (v, a) = (self.from.rate[i] * t, self.from.acceleration[i] * t * t);
            out.value[i] = self.from.value[i] + s * (v + s * (0.5 * a + s * (c3 + s * (c4 + s * c5))));
            out.rate[i] = (v + s * (a + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / t;
            out.acceleration[i] = (a + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (t * t);
        }
        out
    }
}

fn at_rest(value: [f64; 6]) -> Coordinates {
    Coordinates { value, ..Coordinates::default() }
}

fn rests(c: &Coordinates) -> bool {
    c.rate == [0.0; 6] && c.acceleration == [0.0; 6]
}

/// A plate that follows set points.
#[derive(Clone, Debug)]
pub(super) struct Follower {
    before: Coordinates,
    pieces: VecDeque<Piece>,
    /// The piece after the last piece.
    tail: Piece,
    /// The last point of a stream, and its time, ns: the piece to it needs the next one.
    pending: Option<(f64, [f64; 6])>,
}

impl Follower {
    /// Returns a plate at rest.
    pub(super) fn resting(pose: &Pose, now_ns: f64) -> Self {
        let before = at_rest(pose.coordinates());
        Self { before, pieces: VecDeque::new(), tail: Piece::brake(now_ns, before), pending: None }
    }

    pub(super) fn coordinates(&self, time_ns: f64) -> Coordinates {
        if time_ns >= self.tail.begin_ns {
            return self.tail.coordinates(time_ns);
        }
        match self.pieces.iter().rev().find(|p| p.begin_ns <= time_ns) {
            Some(piece) => piece.coordinates(time_ns),
            None => self.before,
        }
    }

    /// Returns when the plate will be at rest if nothing more is said, ns.
    pub(super) fn rest_ns(&self) -> f64 {
        if rests(&self.tail.from) { self.tail.begin_ns } else { self.tail.until_ns }
    }

    /// Returns whether the plate brakes, or has braked, because the points of a stream ceased.
    pub(super) fn starved(&self, now_ns: f64) -> bool {
        self.pending.is_some() && now_ns > self.tail.begin_ns && !rests(&self.tail.from)
    }

    /// Forgets everything after now.
    fn cut(&mut self, now_ns: f64) -> Coordinates {
        let state = self.coordinates(now_ns);
        if now_ns > self.tail.begin_ns {
            self.pieces.push_back(self.tail.clone());
        }
        while self.pieces.back().is_some_and(|p| p.begin_ns >= now_ns) {
            self.pieces.pop_back();
        }
        if let Some(last) = self.pieces.back_mut() {
            last.until_ns = last.until_ns.min(now_ns);
        }
        while self.pieces.front().is_some_and(|p| p.until_ns < now_ns - KEPT_NS) {
            if let Some(old) = self.pieces.pop_front() {
                self.before = old.coordinates(old.until_ns);
                (self.before.rate, self.before.acceleration) = ([0.0; 6], [0.0; 6]);
            }
        }
        self.pending = None;
        self.tail = Piece::brake(now_ns, state);
        state
    }

    /// Brings the plate to rest from where it is.
    pub(super) fn stop(&mut self, now_ns: f64) {
        if now_ns < self.tail.begin_ns {
            self.cut(now_ns);
        }
        self.pending = None;
    }

    /// Brings the plate to rest abruptly, out of a smooth stop too.
    pub(super) fn stop_abruptly(&mut self, now_ns: f64) {
        if now_ns < self.rest_ns() {
            let state = self.cut(now_ns);
            self.tail = Piece::brake_in(ABRUPT_S, now_ns, state);
        }
        self.pending = None;
    }

    /// Goes to a pose in the given time, s, from whatever it does now.
    pub(super) fn go(
        &mut self,
        now_ns: f64,
        to: &Pose,
        duration_s: f64,
        geometry: &Geometry,
    ) -> Result<(), RigError> {
        let goal = at_rest(to.coordinates());
        let piece = Piece::new(now_ns, duration_s, self.coordinates(now_ns), goal);
        for k in 0..=(duration_s / STEP_S).ceil() as usize {
            let time_s = (k as f64 * STEP_S).min(duration_s);
            geometry.check_state(&piece.coordinates(now_ns + 1e9 * time_s).plate_state(), time_s)?;
        }
        self.cut(now_ns);
        self.tail = Piece::brake(piece.until_ns, goal);
        self.pieces.push_back(piece);
        Ok(())
    }

    /// Orders the plate to pass this pose at this time. Its rate and acceleration there follow from the
    /// neighbours, so it is known one point later. A stream begins at rest, now: to its first point the plate
    /// has the time until then.
    pub(super) fn pass(
        &mut self,
        now_ns: f64,
        at_ns: f64,
        pose: &Pose,
        geometry: &Geometry,
    ) -> Result<(), RigError> {
        let value = pose.coordinates();
        if self.pending.is_none() && at_ns > now_ns && now_ns >= self.rest_ns() {
            self.cut(now_ns);
        }
        let from = self.tail.from;
        let (t0, p0) = (self.tail.begin_ns, from.value);
        let last_ns = self.pending.map_or(t0, |(t, _)| t).max(now_ns);
        if at_ns <= last_ns || self.starved(now_ns) {
            return Err(RigError::Late);
        }
        let Some((t1, p1)) = self.pending.replace((at_ns, value)) else { return Ok(()) };
        let (h1, h2) = ((t1 - t0) * 1e-9, (at_ns - t1) * 1e-9);
        let mut middle = at_rest(p1);
        for i in 0..6 {
            let (d1, d2) = ((p1[i] - p0[i]) / h1, (value[i] - p1[i]) / h2);
            middle.rate[i] = (d1 * h2 + d2 * h1) / (h1 + h2);
            middle.acceleration[i] = 2.0 * (d2 - d1) / (h1 + h2);
        }
        geometry.check_state(&middle.plate_state(), 0.0)?;
        self.pieces.push_back(Piece::new(t0, h1, from, middle));
        self.tail = Piece::brake(t1, middle);
        while self.pieces.front().is_some_and(|p| p.until_ns < now_ns - KEPT_NS) {
            self.pieces.pop_front();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start() -> (Geometry, Pose, Follower) {
        let geometry = Geometry::thesis();
        let home = geometry.home();
        (geometry, home, Follower::resting(&home, 0.0))
    }

    /// Asserts that rate and acceleration are the derivatives of value and rate, also where pieces meet.
    fn assert_smooth(f: &Follower, range: std::ops::Range<u32>) {
        let h = 1e-5;
        for k in range {
            // Off the joints by a tenth of a millisecond.
            let t = f64::from(k) * 2e-3 + 1e-4;
            let at = |s: f64| f.coordinates(s * 1e9);
            for i in 0..6 {
                let slope = (at(t + h).value[i] - at(t - h).value[i]) / (2.0 * h);
                assert!((slope - at(t).rate[i]).abs() < 1e-6, "rate {i} at {t}");
                let jump = at(t + h).acceleration[i] - at(t - h).acceleration[i];
                assert!(jump.abs() < 0.02, "acceleration {i} at {t}: {jump}");
            }
        }
    }

    #[test]
    fn a_new_goal_on_the_way_is_taken_up_without_a_jump_of_acceleration() {
        let (geometry, home, mut f) = start();
        let mut up = home;
        up.position_m[2] += 0.05;
        up.rpy_rad[0] = 0.1;
        f.go(0.0, &up, 2.0, &geometry).unwrap();
        let mut other = home;
        other.position_m[0] += 0.04;
        f.go(0.9e9, &other, 2.0, &geometry).unwrap();
        f.stop(2.1e9);
        assert_smooth(&f, 1..1400);
        assert!(rests(&f.coordinates(2.4e9)));
        assert_eq!(f.coordinates(9e9).value, f.coordinates(2.4e9).value);
    }

    #[test]
    fn a_stream_passes_its_points_at_their_times_and_its_end_is_a_brake() {
        let (geometry, home, mut f) = start();
        let at = |t: f64| {
            let mut pose = home;
            // Starts at rest.
            pose.rpy_rad[1] = 0.1 * (1.0 - (3.0 * t).cos());
            pose
        };
        for k in 1..=150 {
            let t = f64::from(k) * 0.01;
            f.pass((t - 0.2).max(0.0) * 1e9, (t + 0.1) * 1e9, &at(t), &geometry).unwrap();
        }
        for k in 1..=149 {
            let t = f64::from(k) * 0.01;
            let got = f.coordinates((t + 0.1) * 1e9);
            assert!((got.value[4] - at(t).rpy_rad[1]).abs() < 1e-12);
            if k == 1 {
                // Its neighbour is the start, a tenth of a second before.
                continue;
            }
            // Central differences: h²/6 of the third derivative, 0.1 · 27.
            assert!((got.rate[4] - 0.3 * (3.0 * t).sin()).abs() < 0.01 * 0.01 / 6.0 * 2.7 + 1e-9);
        }
        assert_smooth(&f, 60..900);
        assert!(rests(&f.coordinates((1.49 + 0.1 + BRAKE_S) * 1e9)));
        assert_eq!(f.pass(1.8e9, 1.9e9, &at(1.6), &geometry), Err(RigError::Late));
    }

    #[test]
    fn an_abrupt_stop_takes_a_twentieth_of_a_second_also_out_of_a_smooth_one() {
        for smooth_before in [false, true] {
            let (geometry, home, mut f) = start();
            let mut up = home;
            up.position_m[2] += 0.05;
            f.go(0.0, &up, 2.0, &geometry).unwrap();
            if smooth_before {
                f.stop(0.95e9);
            }
            let before = f.coordinates(1e9);
            assert!(before.rate[2] > 0.02);
            f.stop_abruptly(1e9);
            // Half the way that the rate would take it in that time, and less than the acceleration adds.
            let way = f.coordinates(9e9).value[2] - before.value[2];
            assert!((way - 0.5 * before.rate[2] * ABRUPT_S).abs() < 1e-4, "{way}");
            assert_eq!(f.rest_ns(), 1.05e9);
            assert!(rests(&f.coordinates(1.05e9)));
        }
    }

    #[test]
    fn motions_beyond_the_legs_are_refused_and_change_nothing() {
        let (geometry, home, mut f) = start();
        let mut far = home;
        far.position_m[2] += 0.5;
        assert!(matches!(f.go(0.0, &far, 9.0, &geometry), Err(RigError::Motion(_))));
        assert_eq!(f.coordinates(5e9).value, home.coordinates());
        let mut near = home;
        near.position_m[2] += 0.02;
        assert!(matches!(f.go(0.0, &near, 0.01, &geometry), Err(RigError::Motion(_))));
    }
}
