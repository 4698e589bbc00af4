//! The pivot point and the coordinate systems in force.
//!
//! Either moves the point of the plate that X, Y, Z are of and that U, V, W turn about, by an offset along
//! the plate's axes. Of a coordinate system that is all that is simulated here; a real one may be turned too.

use hexapod::Pose;
use hexapod::gcs::{GcsPosition, answer, error, read_pairs};

/// The root of all coordinate systems.
const ROOT: &str = "ZERO";
/// The type of those that are defined here.
const KIND: &str = "KSD";
/// The most coordinate systems that may be defined.
const MOST: usize = 16;
/// Names of the pivot point's coordinates.
const PIVOT: [&str; 3] = ["R", "S", "T"];

/// The frames that are defined and those in force.
#[derive(Debug, Default)]
pub(super) struct Frames {
    pivot_mm: [f64; 3],
    defined: Vec<(String, [f64; 3])>,
    in_force: Option<usize>,
}

impl Frames {
    /// Returns the point that X, Y, Z are of, in the plate's axes, m.
    fn point_m(&self) -> [f64; 3] {
        let frame = self.in_force.and_then(|k| self.defined.get(k)).map_or([0.0; 3], |(_, offset)| *offset);
        std::array::from_fn(|i| 1e-3 * (self.pivot_mm[i] + frame[i]))
    }

    /// Returns where the point `r` of the plate goes by the plate's turn: `R r − r`.
    fn shift_m(&self, pose: &Pose) -> [f64; 3] {
        let (turn, r) = (pose.rotation(), self.point_m());
        std::array::from_fn(|i| (0..3).map(|k| turn[i][k] * r[k]).sum::<f64>() - r[i])
    }

    /// Returns the position that represents a pose.
    pub(super) fn position(&self, pose: &Pose, reference: &Pose) -> GcsPosition {
        let shift = self.shift_m(pose);
        let point = Pose { position_m: std::array::from_fn(|i| pose.position_m[i] + shift[i]), ..*pose };
        GcsPosition::of(&point, reference)
    }

    /// Returns the pose that a position represents.
    pub(super) fn pose(&self, position: &GcsPosition, reference: &Pose) -> Pose {
        let point = position.pose(reference);
        let shift = self.shift_m(&point);
        Pose { position_m: std::array::from_fn(|i| point.position_m[i] - shift[i]), ..point }
    }

    /// Returns what is asked for here; `None` for other questions.
    pub(super) fn asked(&self, verb: &str) -> Option<String> {
        match verb {
            "SPI?" => Some(answer((0..3).map(|i| format!("{}={:.6}", PIVOT[i], self.pivot_mm[i])))),
            "KEN?" => {
                let own = self.in_force.and_then(|k| self.defined.get(k)).map(|(name, _)| name.as_str());
                Some(format!("{}={KIND}\n", own.unwrap_or(ROOT)))
            }
            _ => None,
        }
    }

    /// Obeys a command, the plate at rest.
    ///
    /// # Errors
    /// The number of what is wrong with it.
    pub(super) fn obey(&mut self, verb: &str, words: &[&str]) -> Result<(), u16> {
        match (verb, words) {
            ("SPI", words) => {
                for (name, mm) in read_pairs(words)? {
                    let i = PIVOT.iter().position(|n| *n == name).ok_or(error::AXIS)?;
                    self.pivot_mm[i] = mm;
                }
                Ok(())
            }
            ("KEN", [name]) if name.eq_ignore_ascii_case(ROOT) => {
                self.in_force = None;
                Ok(())
            }
            ("KEN", [name]) => {
                let known = self.defined.iter().position(|(defined, _)| defined.eq_ignore_ascii_case(name));
                self.in_force = Some(known.ok_or(error::RANGE)?);
                Ok(())
            }
            ("KSD", [name, offset @ ..]) if !name.eq_ignore_ascii_case(ROOT) => {
                let mut mm = [0.0; 3];
                for (axis, value) in read_pairs(offset)? {
                    let i = ["X", "Y", "Z"].iter().position(|a| *a == axis).ok_or(error::AXIS)?;
                    mm[i] = value;
                }
                self.defined.retain(|(defined, _)| !defined.eq_ignore_ascii_case(name));
                self.in_force = None;
                if self.defined.len() >= MOST {
                    return Err(error::RANGE);
                }
                self.defined.push(((*name).to_owned(), mm));
                Ok(())
            }
            _ => Err(error::PARAMETER_COUNT),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hexapod::Geometry;

    #[test]
    fn a_turn_about_a_pivot_leaves_that_point_where_it_is() {
        let home = Geometry::thesis().home();
        let mut frames = Frames::default();
        frames.obey("SPI", &["T", "100"]).unwrap();
        let leaning = GcsPosition([0.0, 0.0, 0.0, 90.0, 0.0, 0.0]);
        let pose = frames.pose(&leaning, &home);
        // The plate's origin goes on a quarter circle of 0.1 m about a point above it.
        let moved: [f64; 3] = std::array::from_fn(|i| pose.position_m[i] - home.position_m[i]);
        for (value, expected) in moved.into_iter().zip([0.0, 0.1, 0.1]) {
            assert!((value - expected).abs() < 1e-12, "{moved:?}");
        }
        let back = frames.position(&pose, &home);
        assert!(back.0.iter().zip(leaning.0).all(|(a, b)| (a - b).abs() < 1e-9), "{back:?}");
        frames.obey("SPI", &["T", "0"]).unwrap();
        frames.obey("KSD", &["mine", "Z", "100"]).unwrap();
        assert_eq!(frames.pose(&leaning, &home), leaning.pose(&home));
        frames.obey("KEN", &["mine"]).unwrap();
        assert_eq!(frames.pose(&leaning, &home), pose);
        assert_eq!(frames.asked("KEN?").unwrap(), "mine=KSD\n");
        assert_eq!(frames.obey("KEN", &["other"]), Err(error::RANGE));
    }
}
