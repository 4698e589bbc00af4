//! The part of the sphere of directions that a motion's angular velocity and acceleration visit.

use hexapod::Trajectory;
use nalgebra::Vector3;

/// Cells of equal area: eight bands of equal height, twelve sectors each.
const BANDS: usize = 8;
const SECTORS: usize = 12;

/// Returns the share of 96 cells of equal area that vectors of more than 30 % of the longest one point into.
pub fn coverage(vectors: &[Vector3<f64>]) -> f64 {
    let longest = vectors.iter().map(Vector3::norm).fold(0.0, f64::max);
    let mut visited = [[false; SECTORS]; BANDS];
    for v in vectors.iter().filter(|v| v.norm() > 0.3 * longest) {
        let height = 0.5 * (v.z / v.norm() + 1.0);
        let azimuth = (v.y.atan2(v.x) / std::f64::consts::TAU).rem_euclid(1.0);
        let cell = |share: f64, count: usize| ((share * count as f64) as usize).min(count - 1);
        visited[cell(height, BANDS)][cell(azimuth, SECTORS)] = true;
    }
    let count = visited.iter().flatten().filter(|v| **v).count();
    count as f64 / (BANDS * SECTORS) as f64
}

/// Returns the coverage of angular rate and angular acceleration from one time to another, s.
pub fn of_motion(trajectory: &Trajectory, from_s: f64, to_s: f64) -> [f64; 2] {
    vectors(trajectory, from_s, to_s).map(|vectors| coverage(&vectors))
}

/// Returns angular rates, rad/s, and angular accelerations, rad/s², in the plate's axes from one time to
/// another, s, every hundredth of a second.
pub fn vectors(trajectory: &Trajectory, from_s: f64, to_s: f64) -> [Vec<Vector3<f64>>; 2] {
    let count = ((to_s - from_s) / 0.01) as usize;
    let states: Vec<_> = (0..count).map(|k| trajectory.state(from_s + 0.01 * k as f64)).collect();
    [states.iter().map(|s| s.angular_rate).collect(), states.iter().map(|s| s.angular_acceleration).collect()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_axis_covers_two_cells_and_a_fine_spiral_all() {
        let one: Vec<_> = (0..100).map(|k| Vector3::new((0.1 * f64::from(k)).sin(), 1e-3, 1e-3)).collect();
        assert!((coverage(&one) - 2.0 / 96.0).abs() < 0.011);
        let spiral: Vec<_> = (0..20_000)
            .map(|k| {
                let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 20_000.0;
                let (s, c) = (0.05 * f64::from(k)).sin_cos();
                Vector3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z)
            })
            .collect();
        assert_eq!(coverage(&spiral), 1.0);
    }
}
