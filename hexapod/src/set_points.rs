//! Lines of set points, as a platform takes them that answers nothing.
//!
//! A line is `t_s,x_m,y_m,z_m,qw,qx,qy,qz` (the plate in A, Hamilton's quaternion) or `t_s,l1_m,…,l6_m` (the
//! legs) and ends with LF; time goes from the beginning of the stream.

use super::pose::Pose;

/// Longest line that a platform takes, bytes.
pub const LINE_BYTES: usize = 512;

/// The place where the plate, or its legs, shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SetPoint {
    /// Pose of the plate in A.
    Pose(Pose),
    /// Lengths of the legs, m.
    Legs([f64; 6]),
}

/// The reason why a line is not one.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LineError {
    /// Something else than finite numbers between commas.
    #[error("not numbers between commas")]
    NotNumbers,
    /// Neither a pose nor six legs.
    #[error("{0} numbers behind the time: a pose has 7, the legs have 6")]
    Count(usize),
    /// A quaternion whose length is not one.
    #[error("a quaternion of length {0} is no attitude")]
    Quaternion(f64),
}

impl SetPoint {
    /// Returns the line for this set point at `time_s`, its end included.
    pub fn line(&self, time_s: f64) -> String {
        let mut line = format!("{time_s:.6}");
        let mut add = |number: f64| line.push_str(&format!(",{number:.9}"));
        match self {
            Self::Pose(pose) => {
                pose.position_m.into_iter().chain(pose.quaternion_wxyz()).for_each(&mut add);
            }
            Self::Legs(lengths) => lengths.iter().copied().for_each(&mut add),
        }
        line.push('\n');
        line
    }

    /// Reads a line without its end: time, s, and set point.
    ///
    /// # Errors
    /// The fault of the line.
    pub fn read(line: &str) -> Result<(f64, Self), LineError> {
        let numbers = line.split(',').map(|n| n.trim().parse::<f64>().ok().filter(|n| n.is_finite()));
        let numbers: Vec<f64> = numbers.collect::<Option<_>>().ok_or(LineError::NotNumbers)?;
        let Some((time_s, rest)) = numbers.split_first() else { return Err(LineError::NotNumbers) };
        let point = match *rest {
            [x, y, z, w, a, b, c] => {
                let norm = (w * w + a * a + b * b + c * c).sqrt();
                if (norm - 1.0).abs() > 0.01 {
                    return Err(LineError::Quaternion(norm));
                }
                Self::Pose(Pose::from_quaternion([x, y, z], [w, a, b, c].map(|q| q / norm)))
            }
            [l1, l2, l3, l4, l5, l6] => Self::Legs([l1, l2, l3, l4, l5, l6]),
            _ => return Err(LineError::Count(rest.len())),
        };
        Ok((*time_s, point))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Quaternion, UnitQuaternion};

    use super::*;

    /// Attitudes by nalgebra's quaternions, which know nothing of ours.
    #[test]
    fn a_pose_line_is_time_position_and_hamiltons_quaternion() {
        let rpy = [0.31, -0.22, 0.57];
        let pose = Pose { position_m: [0.01, -0.02, 0.73], rpy_rad: rpy };
        let line = SetPoint::Pose(pose).line(1.25);
        let numbers: Vec<f64> = line.trim_end().split(',').map(|n| n.parse().unwrap()).collect();
        assert!(line.ends_with('\n') && line.len() < LINE_BYTES);
        assert_eq!(numbers[..4], [1.25, 0.01, -0.02, 0.73]);
        let q = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]).into_inner();
        for (got, want) in numbers[4..].iter().zip([q.w, q.i, q.j, q.k]) {
            // Printed to nine digits.
            assert!((got - want).abs() < 5.1e-10, "{line} {q}");
        }
        let q = UnitQuaternion::from_quaternion(Quaternion::new(0.5, -0.5, 0.5, 0.5));
        let (_, point) = SetPoint::read("0,0,0,0.7,0.5,-0.5,0.5,0.5").unwrap();
        let SetPoint::Pose(read) = point else { panic!("{point:?}") };
        let (r, want) = (read.rotation(), q.to_rotation_matrix());
        for i in 0..3 {
            for j in 0..3 {
                // Pitch is 90° here, where roll and yaw turn about one axis.
                assert!((r[i][j] - want[(i, j)]).abs() < 1e-15, "{r:?}");
            }
        }
    }

    #[test]
    fn written_set_points_are_read() {
        for point in [
            SetPoint::Pose(Pose { position_m: [0.1, 0.2, 0.7], rpy_rad: [0.1, 0.2, -0.3] }),
            SetPoint::Legs([0.61, 0.62, 0.63, 0.64, 0.65, 0.66]),
        ] {
            let (time_s, read) = SetPoint::read(point.line(0.125).trim_end()).unwrap();
            assert_eq!(time_s, 0.125);
            let numbers = |p: &SetPoint| match p {
                SetPoint::Pose(p) => p.coordinates(),
                SetPoint::Legs(l) => *l,
            };
            for (a, b) in numbers(&point).iter().zip(numbers(&read)) {
                assert!((a - b).abs() < 3e-9, "{point:?} {read:?}");
            }
        }
    }

    #[test]
    fn bad_lines_are_refused() {
        assert_eq!(SetPoint::read(""), Err(LineError::NotNumbers));
        assert_eq!(SetPoint::read("0,1,2,nan,4,5,6"), Err(LineError::NotNumbers));
        assert_eq!(SetPoint::read("0,1,2,3"), Err(LineError::Count(3)));
        assert_eq!(SetPoint::read("0,0,0,0.7,2,0,0,0"), Err(LineError::Quaternion(2.0)));
    }
}
