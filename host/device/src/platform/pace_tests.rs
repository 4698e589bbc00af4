use std::time::{Duration, Instant};

use super::*;
use hexapod::{Geometry, MotionProgram, Segment};

/// Takes points, and once takes its time.
struct Slow {
    sent: Arc<Mutex<Vec<Point>>>,
    delay: Duration,
}

/// The time of a point, its x, and the time of its arrival.
type Point = (f64, f64, Instant);

impl Sink for Slow {
    fn send(&mut self, time_s: f64, pose: &Pose) -> Result<(), PlatformError> {
        let mut sent = self.sent.lock().unwrap();
        sent.push((time_s, pose.position_m[0], Instant::now()));
        if sent.len() == 60 {
            drop(sent);
            thread::sleep(self.delay);
        }
        Ok(())
    }
}

type Motions = Vec<Result<Motion, PlatformError>>;

fn shift() -> Trajectory {
    let home = Geometry::thesis().home();
    let mut to = home;
    to.position_m[0] += 0.1;
    let program = MotionProgram { start: home, segments: vec![Segment::Move { to, duration_s: 2.0 }] };
    program.trajectory().unwrap()
}

fn ended(pace: &Pace<impl Sink + 'static>) -> Motions {
    let mut motions = Vec::new();
    while motions.last() != Some(&Ok(Motion::Done)) {
        let now = pace.motion();
        if now != Ok(Motion::Moving) {
            motions.push(now);
        }
        thread::sleep(Duration::from_millis(5));
    }
    motions
}

/// Drives a move of 0.1 m in 2 s, one of whose points took this long, s, with a lead of 0.3 s. Returns its
/// points and what was reported.
fn driven(delay_s: f64, follows: Follows) -> (Vec<Point>, Motions) {
    let sent = Arc::default();
    let sink = Slow { sent: Arc::clone(&sent), delay: Duration::from_secs_f64(delay_s) };
    let timing = Timing { rate_hz: 100.0, lead_s: 0.3, follows };
    let motions = ended(&Pace::begin(sink, shift(), timing, 20.0, &Clock::of_this_machine()));
    let sent = sent.lock().unwrap().clone();
    (sent, motions)
}

#[test]
fn late_points_end_the_motion_on_its_path_and_after_a_gap_nothing_moves_any_more() {
    // A seventh of a second after its time: led to rest further on.
    let (sent, motions) = driven(0.45, Follows::Unknown);
    assert!(
        matches!(motions.as_slice(), [Err(PlatformError::Late(late)), Ok(_)] if *late > 0.1),
        "{motions:?}"
    );
    let end = sent.last().unwrap().1;
    assert!(sent[59].1 + 1e-3 < end && end < 0.099, "{end}");
    assert!(sent[sent.len() - 10..].iter().all(|point| point.1 == end), "it ends at rest");
    // Two seconds: the plate has been at the last point for long.
    for follows in [Follows::Unknown, Follows::Arrival] {
        let (sent, motions) = driven(2.0, follows);
        assert!(
            matches!(motions.as_slice(), [Err(PlatformError::Late(late)), Ok(_)] if *late > 1.0),
            "{motions:?}"
        );
        assert!(
            sent.len() > 70 && sent[60..].iter().all(|point| (point.1 - sent[59].1).abs() < 1e-12),
            "{:?}",
            &sent[58..]
        );
        assert!(sent[60].0 > sent[59].0 + 1.0, "and it is sent so for times to come");
    }
}

/// 0.1 m in 2 s: 15/8 of the mean rate at most, 0.94 mm in 10 ms.
#[test]
fn a_host_that_stood_still_makes_up_for_it_with_no_burst() {
    const MOST_MPS: f64 = 1.875 * 0.1 / 2.0;
    for (follows, delay_s) in [
        (Follows::Unknown, 0.1),
        (Follows::Unknown, 0.18),
        (Follows::Unknown, 0.45),
        (Follows::Arrival, 0.1),
        (Follows::Arrival, 0.4),
    ] {
        let (sent, motions) = driven(delay_s, follows);
        let late = follows == Follows::Unknown && delay_s > 0.3;
        assert_eq!(motions.len(), if late { 2 } else { 1 }, "{follows:?} {delay_s}: {motions:?}");
        // As one that takes points as they come would have it, once the buffer is full.
        for pair in sent[31..].windows(2) {
            let (way, time) = ((pair[1].1 - pair[0].1).abs(), (pair[1].2 - pair[0].2).as_secs_f64());
            assert!(way <= 0.01 * MOST_MPS + 1e-9, "{follows:?} {delay_s}: {way} m in a step");
            // The clock is read a little after the point is due.
            assert!(time > 0.0085, "{follows:?} {delay_s}: {time} s from one to the next");
        }
        if !late {
            assert!((sent.last().unwrap().1 - 0.1).abs() < 1e-12, "it comes to its end");
        }
        if follows == Follows::Arrival {
            let first = sent[60].1 - sent[59].1;
            assert!(first < 0.05 * 0.01 * MOST_MPS, "it sets off gently: {first} m");
        }
    }
}

/// A controller with a clock of its own has its buffer full again soon.
#[test]
fn a_controller_that_goes_by_time_has_its_lead_again_after_a_stall() {
    for (follows, within_s) in [(Follows::Time, 0.0..0.5), (Follows::Unknown, 0.8..9.0)] {
        let (sent, motions) = driven(0.18, follows);
        assert_eq!(motions, [Ok(Motion::Done)], "{follows:?}");
        let begun = sent[0].2;
        let lead = |point: &Point| point.0 - (point.2 - begun).as_secs_f64();
        let again = sent[60..].iter().find(|point| lead(point) > 0.25).unwrap_or(sent.last().unwrap());
        let took_s = (again.2 - sent[60].2).as_secs_f64();
        assert!(within_s.contains(&took_s), "{follows:?}: {took_s} s");
    }
}

/// Stops on request; notes how.
#[derive(Clone)]
struct Stopped(Arc<Mutex<Vec<(&'static str, f64)>>>);

impl Sink for Stopped {
    fn send(&mut self, _: f64, pose: &Pose) -> Result<(), PlatformError> {
        self.0.lock().unwrap().push(("point", pose.position_m[0]));
        Ok(())
    }
    fn halt(&mut self) -> Result<bool, PlatformError> {
        self.0.lock().unwrap().push(("halt", 0.0));
        Ok(true)
    }
    fn at_rest(&mut self) -> Result<Option<bool>, PlatformError> {
        Ok(Some(true))
    }
    fn patience_s(&self) -> f64 {
        GAP_S
    }
}

#[test]
fn a_planned_stop_leads_to_rest_on_the_path_and_an_alarm_halts_also_meanwhile() {
    for stops in [&[Stop::Planned] as &[Stop], &[Stop::Alarm], &[Stop::Planned, Stop::Alarm]] {
        let noted = Stopped(Arc::default());
        let timing = Timing { rate_hz: 100.0, lead_s: 0.1, follows: Follows::Time };
        let pace = Pace::begin(noted.clone(), shift(), timing, 20.0, &Clock::of_this_machine());
        thread::sleep(Duration::from_millis(700));
        for stop in stops {
            pace.stop(*stop);
            thread::sleep(Duration::from_millis(100));
        }
        assert_eq!(ended(&pace), [Ok(Motion::Done)]);
        let noted = noted.0.lock().unwrap();
        let halts = noted.iter().filter(|(what, _)| *what == "halt").count();
        if stops == [Stop::Planned] {
            assert_eq!(halts, 0);
            let x: Vec<f64> = noted.iter().map(|(_, x)| *x).collect();
            let end = x[x.len() - 1];
            assert!(end > 0.01 && end < 0.09 && x[x.len() - 10..].iter().all(|x| *x == end), "{end}");
            // The rate changes by no more than 5.4/s of it: 15/8 over 0.35 s.
            let bends = x.windows(3).map(|x| (x[2] - 2.0 * x[1] + x[0]).abs() / 1e-4);
            assert!(bends.fold(0.0, f64::max) < 5.4 * 0.094 + 0.15);
        } else {
            assert_eq!((halts, noted.last().unwrap().0), (1, "halt"));
        }
    }
}
