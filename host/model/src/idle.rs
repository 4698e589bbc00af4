//! Motions that cannot tell what is asked of them: joints that never move, a base that does not.

use nalgebra::Vector3;
use rigident_shared::tree::Joint;

use super::finding::Finding;
use super::tree::Model;

/// Sample-to-sample noise beyond this is none of an encoder's or an attitude's, rad, and of what slides, m:
/// what appears white then is motion too fast for the recording.
const LARGEST_NOISE: f64 = 0.02;
const LARGEST_NOISE_M: f64 = 2e-3;
/// A signal that leaves its mean by this many times the noise, 1 σ, does not stay.
pub const DEVIATION: f64 = 3.0;
/// A gyro at rest may read as much, rad/s.
const BIAS_RADPS: f64 = 0.05;

/// Returns σ of white noise on something smooth, from fourth differences, which motion hardly enters.
pub fn white_noise(values: &[f64]) -> f64 {
    let squares = values.windows(5).filter_map(|w| match w {
        [a, b, c, d, e] => Some((a - 4.0 * b + 6.0 * c - 4.0 * d + e).powi(2)),
        _ => None,
    });
    let (sum, count) = squares.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    // 1 + 16 + 36 + 16 + 1
    if count > 0.0 { (sum / (70.0 * count)).sqrt() } else { 0.0 }
}

/// The spread of a series about its mean, and how much of that is white noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Mean of the series.
    pub mean: f64,
    /// Standard deviation of the series.
    pub deviation: f64,
    /// Standard deviation of the series' white noise.
    pub noise: f64,
}

impl Spread {
    /// Returns the spread of a series; zero for an empty one.
    pub fn of(values: &[f64]) -> Self {
        let count = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / count;
        let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt();
        Self { mean, deviation, noise: white_noise(values) }
    }
}

/// Returns whether something stays where it is: exactly, or in time as far as its own noise shows.
fn stays(values: &[f64], in_time: bool, largest_noise: f64) -> bool {
    if values.windows(2).all(|w| matches!(w, [a, b] if a == b)) {
        return true;
    }
    let Spread { deviation, noise, .. } = Spread::of(values);
    in_time && noise <= largest_noise && deviation <= DEVIATION * noise
}

/// Joints of the model whose coordinates stay the same, and a base without turning. Frames hold the
/// coordinates of all joints as [`super::rows::Moving::set`] takes them, and the base's angular rate, rad/s.
///
/// Of frames in time noise is no motion: what leaves its place by no more than samples differ from one to the
/// next stays. Of still poses only what is exactly the same does.
pub fn idle(model: &Model, frames: &[(&[f64], Vector3<f64>)], in_time: bool) -> Vec<Finding> {
    let finding = |place: String, text: &str| Finding { place, text: text.to_owned() };
    if frames.is_empty() {
        return vec![finding("recording".to_owned(), "has no frames: nothing can be identified from it")];
    }
    let mut found = Vec::new();
    let mut at = 0;
    for link in model.links.iter().skip(1) {
        let range = at..at + link.link.joint.coordinates();
        at = range.end;
        let largest =
            if matches!(link.link.joint, Joint::Prismatic(_)) { LARGEST_NOISE_M } else { LARGEST_NOISE };
        let moves = range.clone().any(|k| {
            let values: Vec<f64> = frames.iter().filter_map(|(q, _)| q.get(k).copied()).collect();
            !stays(&values, in_time, largest)
        });
        if !range.is_empty() && !moves {
            found.push(finding(
                format!("joint {}", link.joint_name),
                "never moves in these frames: what is beyond it is identified only as one body with what it \
                 hangs on; move it, or say `lock`",
            ));
        }
    }
    let turns = frames.iter().any(|(_, rate)| *rate != Vector3::zeros())
        && (0..3).any(|k| {
            let values: Vec<f64> = frames.iter().map(|(_, rate)| rate[k]).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            mean.abs() > BIAS_RADPS || !stays(&values, in_time, BIAS_RADPS)
        });
    if !turns {
        found.push(finding(
            format!("link {}", model.links.first().map_or("base", |l| l.name.as_str())),
            "the base never turns in these frames: its own inertia is not identified, and of what hangs on \
             it only what joints and gravity show",
        ));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::human::Person;

    #[test]
    fn joints_that_never_move_and_bases_that_never_turn_are_named() {
        let model = Person::default().human34().unwrap();
        let coordinates: usize = model.links.iter().skip(1).map(|l| l.link.joint.coordinates()).sum();
        let knee = model.link("l_shank").unwrap();
        let at: usize = model.links[1..knee].iter().map(|l| l.link.joint.coordinates()).sum();
        let frame = |n: usize, turning: f64| {
            let mut q: Vec<f64> = (0..coordinates).map(|k| (k + n) as f64).collect();
            q[at] = 0.3;
            (q, Vector3::z() * turning)
        };
        let said = |frames: &[(Vec<f64>, Vector3<f64>)]| -> Vec<String> {
            let frames: Vec<(&[f64], Vector3<f64>)> =
                frames.iter().map(|(q, w)| (q.as_slice(), *w)).collect();
            idle(&model, &frames, true).iter().map(ToString::to_string).collect()
        };
        let turning = said(&[frame(0, 0.1), frame(1, 0.2)]);
        assert_eq!(turning.len(), 1, "{turning:?}");
        assert!(turning[0].starts_with("joint l_shank_joint: never moves"), "{turning:?}");
        let still = said(&[frame(0, 0.0), frame(1, 0.0)]);
        assert!(still[1].starts_with("link pelvis: the base never turns"), "{still:?}");
        assert!(said(&[])[0].contains("no frames"));
    }

    #[test]
    fn a_motion_within_its_noise_is_rest_and_the_slowest_beyond_it_is_none() {
        let series = |f: &dyn Fn(f64) -> f64| (0..4000).map(|k| f(f64::from(k))).collect::<Vec<f64>>();
        // Of unit variance, white.
        let white = |k: f64| {
            let mut z = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let parts = (0..12).map(|_| {
                z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9).wrapping_add(0x94d0_49bb_1331_11eb);
                (z >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
            });
            parts.sum::<f64>()
        };
        for (values, still) in [
            (series(&|_| 0.4), true),
            (series(&|k| 0.4 + 1e-4 * white(k)), true),
            (series(&|k| 0.4 + 1e-2 * white(k)), true),
            // To and fro by less than a milliradian, and a creep by two.
            (series(&|k| 0.4 + 1e-4 * white(k) + 6e-4 * (k / 300.0).sin()), false),
            (series(&|k| 0.4 + 1e-4 * white(k) + 5e-7 * k), false),
            (series(&|k| 0.4 + (k / 20.0).sin()), false),
            // As wild as noise, but nobody's noise.
            (series(&|k| 0.4 + 0.5 * white(k)), false),
        ] {
            assert_eq!(stays(&values, true, LARGEST_NOISE), still, "{:e}", white_noise(&values));
        }
        // Still poses are each where they are.
        assert!(!stays(&series(&|k| 1e-3 * white(k)), false, LARGEST_NOISE));
        assert!((white_noise(&series(&|k| 3.0 * white(k) + k)) / 3.0 - 1.0).abs() < 0.1);
    }
}
