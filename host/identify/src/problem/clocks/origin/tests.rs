use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};

use super::*;
use crate::problem::clocks::{Stamped, Stream};
use crate::study_length::runs;
use rigident_io::recording::columns::Group;
use rigident_io::rig::RigFile;

type V = [f64; 3];

fn add(a: V, b: V) -> V {
    std::array::from_fn(|k| a[k] + b[k])
}

fn scaled(a: V, s: f64) -> V {
    a.map(|v| v * s)
}

fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A body that is swung about by hand: roll, pitch and yaw and the place of its sensor are sums of sines
/// whose amplitudes come and go. Angles and places are differentiated by differences; the wrench is that of
/// Newton and Euler about the centre of mass. Nothing of the estimator's is used.
struct Hand {
    angles: [Vec<(f64, f64, f64)>; 3],
    places: [Vec<(f64, f64, f64)>; 3],
    mass: f64,
    com: V,
    inertia: V,
    repeats: bool,
}

impl Hand {
    fn new(rng: &mut ChaCha8Rng, repeats: bool) -> Self {
        let mut draw = |low: f64, high: f64| Uniform::new(low, high).unwrap().sample(rng);
        let mut sines = |size: f64| -> Vec<(f64, f64, f64)> {
            (0..5)
                .map(|_| (size * draw(0.2, 1.0), draw(0.15, 1.8), draw(0.0, std::f64::consts::TAU)))
                .collect()
        };
        let angles = [sines(0.25), sines(0.25), sines(0.3)];
        let places = [sines(0.03), sines(0.03), sines(0.03)];
        Self {
            angles,
            places,
            mass: draw(1.0, 8.0),
            com: [draw(-0.1, 0.1), draw(-0.1, 0.1), draw(0.0, 0.2)],
            inertia: [draw(0.01, 0.1), draw(0.01, 0.1), draw(0.01, 0.1)],
            repeats,
        }
    }

    fn value(&self, sines: &[(f64, f64, f64)], t: f64) -> f64 {
        // A hand rests, and begins again; a machine repeats itself.
        let one = |(k, (size, f, phase)): (usize, &(f64, f64, f64))| {
            let f = if self.repeats { 0.5 * (k + 1) as f64 } else { *f };
            let comes = if self.repeats { 1.0 } else { (0.11 * f * t + phase).sin() };
            size * comes * (std::f64::consts::TAU * f * t + phase).sin()
        };
        sines.iter().enumerate().map(one).sum()
    }

    /// Columns are the axes of the body in the room.
    fn axes(&self, t: f64) -> [V; 3] {
        let [r, p, y] = [0, 1, 2].map(|k| self.value(&self.angles[k], t));
        let ((sr, cr), (sp, cp), (sy, cy)) = (r.sin_cos(), p.sin_cos(), y.sin_cos());
        [
            [cy * cp, sy * cp, -sp],
            [cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr],
            [cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr],
        ]
    }

    fn to_body(axes: &[V; 3], v: V) -> V {
        axes.map(|axis| (0..3).map(|k| axis[k] * v[k]).sum())
    }

    /// Rate in the body's axes: of Ṙ = R [ω]×.
    fn rate(&self, t: f64) -> V {
        let h = 1e-4;
        let (before, axes, after) = (self.axes(t - h), self.axes(t), self.axes(t + h));
        let slope: [V; 3] = std::array::from_fn(|c| scaled(add(after[c], scaled(before[c], -1.0)), 0.5 / h));
        let dot = |a: V, b: V| -> f64 { (0..3).map(|k| a[k] * b[k]).sum() };
        [dot(axes[2], slope[1]), dot(axes[0], slope[2]), dot(axes[1], slope[0])]
    }

    /// Specific force in the body's axes at a point of it.
    fn force_at(&self, t: f64, point: V) -> V {
        let h = 1e-3;
        let place = |t: f64| -> V {
            let axes = self.axes(t);
            let own = [0, 1, 2].map(|k| self.value(&self.places[k], t));
            add(own, (0..3).map(|k| scaled(axes[k], point[k])).fold([0.0; 3], add))
        };
        let acceleration =
            scaled(add(add(place(t + h), place(t - h)), scaled(place(t), -2.0)), 1.0 / (h * h));
        Self::to_body(&self.axes(t), add(acceleration, [0.0, 0.0, 9.806_65]))
    }

    fn wrench(&self, t: f64) -> [f64; 6] {
        let h = 1e-3;
        let force = scaled(self.force_at(t, self.com), self.mass);
        let momentum = |t: f64| -> V {
            let w = self.rate(t);
            std::array::from_fn(|k| self.inertia[k] * w[k])
        };
        let change = scaled(add(momentum(t + h), scaled(momentum(t - h), -1.0)), 0.5 / h);
        let moment = add(add(change, cross(self.rate(t), momentum(t))), cross(self.com, force));
        [force[0], force[1], force[2], moment[0], moment[1], moment[2]]
    }
}

/// A recording: the wrench by its own clock, an IMU by another, which shows `(t − offset)/rate` at the time t
/// of the wrench.
struct Run {
    set: StreamSet,
    clock: Clock,
}

fn run(seed: u64, clock: Clock, repeats: bool, same_body: bool) -> Run {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let hand = Hand::new(&mut rng, repeats);
    let other = Hand::new(&mut rng, repeats);
    let mut draw = |low: f64, high: f64| Uniform::new(low, high).unwrap().sample(&mut rng);
    // The IMU begins up to 8 s before or after the load cell.
    let (length, begins, own_length) = (draw(50.0, 90.0), draw(-8.0, 8.0), draw(50.0, 90.0));
    let (wrench_hz, imu_hz) = (draw(100.0, 400.0), draw(80.0, 300.0));
    let place = [draw(-0.05, 0.05), draw(-0.05, 0.05), draw(-0.05, 0.05)];
    let bias: [f64; 12] = std::array::from_fn(|_| draw(-1.0, 1.0));
    let mut noise =
        |sigma: f64| sigma * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, &mut rng);
    let (mut wrench, mut wrench_ns) = (vec![Vec::new(); 6], Vec::new());
    for k in 0..(length * wrench_hz) as usize {
        let t = k as f64 / wrench_hz;
        wrench_ns.push((1e9 * t).round() as i64);
        for (c, value) in hand.wrench(t).into_iter().enumerate() {
            wrench[c].push(value + bias[c] + noise(if c < 3 { 0.1 } else { 0.01 }));
        }
    }
    let seen = if same_body { &hand } else { &other };
    let (mut accel, mut gyro, mut own_ns) = (vec![Vec::new(); 3], vec![Vec::new(); 3], Vec::new());
    for k in 0..(own_length * imu_hz) as usize {
        let t = begins + k as f64 / imu_hz;
        own_ns.push((1e9 * (t - clock.offset_s) / clock.rate).round() as i64);
        for (c, value) in seen.force_at(t, place).into_iter().enumerate() {
            accel[c].push(value + 0.1 * bias[6 + c] + noise(0.03));
        }
        for (c, value) in seen.rate(t).into_iter().enumerate() {
            gyro[c].push(value + 0.01 * bias[9 + c] + noise(0.003));
        }
    }
    let stream = |file: &str, groups, time_ns: Vec<i64>, rate_hz| Stream {
        file: file.to_owned(),
        time_ns,
        groups,
        attitude: None,
        joints: Vec::new(),
        rate_hz,
        discarded: 0,
        stamped: Stamped::default(),
    };
    let imu = vec![(Group::Accel(0), accel), (Group::Gyro(0), gyro)];
    let streams = vec![
        stream("imu.csv", imu, own_ns, imu_hz * clock.rate),
        stream("wrench.csv", vec![(Group::Wrench, wrench)], wrench_ns, wrench_hz),
    ];
    let set = StreamSet {
        name: "run".to_owned(),
        rig: RigFile::default(),
        streams,
        reference: 1,
        warnings: Vec::new(),
        is_settled: false,
    };
    Run { set, clock }
}

impl Run {
    /// Leaves this number of seconds in which both run, at 30 s of the wrench's clock.
    fn cut(&mut self, common_s: f64) {
        let seconds = |ns: &i64| *ns as f64 * 1e-9;
        let clock = self.clock;
        let end = |ns: &i64| seconds(ns) < 30.0 + 0.5 * common_s;
        let begin = |ns: &i64| clock.offset_s + clock.rate * seconds(ns) >= 30.0 - 0.5 * common_s;
        let [imu, wrench] = self.set.streams.as_mut_slice() else { panic!() };
        for (stream, keep) in [(imu, &begin as &dyn Fn(&i64) -> bool), (wrench, &end)] {
            let kept: Vec<bool> = stream.time_ns.iter().map(keep).collect();
            for column in stream.groups.iter_mut().flat_map(|(_, columns)| columns) {
                let mut kept = kept.iter();
                column.retain(|_| *kept.next().unwrap());
            }
            stream.time_ns.retain(keep);
        }
    }

    fn verdict(&self) -> Verdict {
        found(&Signals::of(&self.set, 0).unwrap())
    }

    /// By how much times are wrong where both run, at most, s.
    fn error_s(&self, offset_s: f64, rate: f64) -> f64 {
        let own = &self.set.streams[0].time_ns;
        let end = self.set.streams[1].time_ns.last().map_or(0.0, |ns| *ns as f64 * 1e-9);
        let seconds = |ns: &i64| *ns as f64 * 1e-9;
        let truth = |t: f64| self.clock.offset_s + self.clock.rate * t;
        let both = own.iter().map(seconds).filter(|t| (0.0..=end).contains(&truth(*t)));
        both.map(|t| (offset_s + rate * t - truth(t)).abs()).fold(0.0, f64::max)
    }
}

/// Offsets of ±300 s and rates off by 0, 100 ppm and 1 %: found within 2 ms over all that both have in
/// common, in 99 of 100, and otherwise said.
#[test]
fn clocks_without_a_common_origin_are_found_within_two_milliseconds() {
    let count = runs(200, 24);
    let (mut near, mut wrong, mut covered) = (0, Vec::new(), 0);
    for seed in 0..count {
        let mut rng = ChaCha8Rng::seed_from_u64(1000 + seed);
        let offset_s = Uniform::new(-300.0, 300.0).unwrap().sample(&mut rng);
        let rate = 1.0 + [0.0, 1e-4, -1e-4, 1e-2, -1e-2][(seed % 5) as usize];
        let run = run(seed, Clock { offset_s, rate }, false, true);
        match run.verdict() {
            Verdict::Clock(found) => {
                let error = run.error_s(found.offset_s, found.rate);
                near += u64::from(error <= 2e-3);
                if error > 2e-3 {
                    wrong.push((seed, error, found));
                }
                let middle = run.set.streams[0].time_ns[run.set.streams[0].time_ns.len() / 2] as f64 * 1e-9;
                let at = found.offset_s - offset_s + (found.rate - rate) * middle;
                covered += u64::from(at.abs() <= 3.0 * found.time_u95_s + 2e-4);
            }
            other => println!("seed {seed}: {other:?}"),
        }
    }
    println!("{near} of {count} within 2 ms, {covered} within three of their uncertainties; {wrong:?}");
    assert!(wrong.is_empty(), "{wrong:?}");
    assert!(100 * near >= 99 * count, "{near} of {count}");
    assert!(10 * covered >= 9 * count, "{covered} of {count}");
}

/// Loggers that ran together for a part of the time: a clock that is found is right, none is made up, and one
/// that is right already stays.
#[test]
fn clocks_of_loggers_that_overlap_in_part_are_right_or_not_found() {
    let (mut found, mut silent) = (0, 0);
    for seed in 0..runs(40, 6) {
        for common_s in [10.0, 18.0] {
            let mut rng = ChaCha8Rng::seed_from_u64(2000 + seed);
            let offset_s = Uniform::new(-300.0, 300.0).unwrap().sample(&mut rng);
            let rate = 1.0 + [0.0, 1e-4, -1e-4, 1e-2, -1e-2][(seed % 5) as usize];
            let mut apart = run(seed, Clock { offset_s, rate }, false, true);
            apart.cut(common_s);
            match apart.verdict() {
                Verdict::Clock(clock) => {
                    let error_s = apart.error_s(clock.offset_s, clock.rate);
                    assert!(error_s < 2e-3, "seed {seed}, {common_s} s: {error_s} {clock:?}");
                    found += 1;
                }
                Verdict::None(why) => {
                    assert!(why.contains("no common motion"), "{why}");
                    silent += 1;
                }
                other => panic!("seed {seed}, {common_s} s: {other:?}"),
            }
            let mut right = run(seed, Clock { offset_s: 0.0, rate: 1.0 }, false, true);
            right.cut(common_s);
            assert_eq!(right.verdict(), Verdict::Fits, "seed {seed}, {common_s} s");
        }
    }
    println!("{found} found, {silent} not found and said");
    assert!(found >= 2 * silent, "{found} {silent}");
}

#[test]
fn clocks_that_agree_are_left_alone_and_a_misfit_is_reported() {
    let same = Clock { offset_s: 0.0, rate: 1.0 };
    for seed in 0..4 {
        assert_eq!(run(seed, same, false, true).verdict(), Verdict::Fits, "{seed}");
        // A skew is found otherwise.
        let late = Clock { offset_s: 0.02, rate: 1.0 };
        assert_eq!(run(seed, late, false, true).verdict(), Verdict::Fits, "{seed}");
    }
    // A rate that is off is found where the origin is shared.
    let slow = run(11, Clock { offset_s: 0.0, rate: 0.99 }, false, true);
    let Verdict::Clock(found) = slow.verdict() else { panic!("{:?}", slow.verdict()) };
    assert!(slow.error_s(found.offset_s, found.rate) < 2e-3, "{found:?}");
    let far = Clock { offset_s: 250.0, rate: 1.0 };
    for seed in 0..4 {
        let mut other = run(seed, far, false, false);
        assert!(matches!(other.verdict(), Verdict::None(_)), "{:?}", other.verdict());
        let said = other.set.settle(true).unwrap_err().to_string();
        assert!(said.contains("do not overlap") && said.contains("clock_offset_s"), "{said}");
    }
    // A machine that repeats itself every two seconds.
    let again = run(7, far, true, true).verdict();
    assert!(matches!(&again, Verdict::None(why) if why.contains("repeats itself")), "{again:?}");
}

#[test]
fn a_clock_that_is_found_is_set_and_said_first() {
    let clock = Clock { offset_s: -123.456, rate: 1.01 };
    let mut run = run(3, clock, false, true);
    run.set.warnings.push("before".to_owned());
    let before = run.set.streams[0].clone();
    run.set.settle(true).unwrap();
    assert!(
        run.set.warnings[0].starts_with("the clock of imu.csv is not that of the wrench"),
        "{:?}",
        run.set.warnings
    );
    let after = &run.set.streams[0];
    assert!((before.rate_hz / after.rate_hz - 1.01).abs() < 1e-4);
    let at = |k: usize| clock.offset_s + clock.rate * before.time_ns[k] as f64 * 1e-9;
    let late =
        after.time_ns.iter().enumerate().map(|(k, ns)| (*ns as f64 * 1e-9 - at(k)).abs()).fold(0.0, f64::max);
    assert!(late < 3e-3, "{late}");
    // The zero of its stamps is stated by the wrench's clock, which begins at 1000 s.
    let mut late = self::run(3, clock, false, true);
    late.set.streams[0].stamped.begin_s = 1000.0;
    late.set.settle(true).unwrap();
    let zero_s = 1000.0 - 123.456 - 1010.0;
    let said = &late.set.warnings[0];
    let stated = said.split("its t_s = 0 is at ").nth(1).and_then(|rest| rest.split(' ').next());
    assert!((stated.unwrap().parse::<f64>().unwrap() - zero_s).abs() < 0.05, "{said}");
    assert!(said.contains("s of the wrench's clock") && said.contains("clock_offset_s = "), "{said}");
    // Done once.
    run.set.settle(true).unwrap();
    assert_eq!(run.set.warnings.len(), 2);
}
