//! An exact test of a point inside six spherical shells.
//!
//! In a fixed orientation leg `i` keeps its length where the plate's origin is at distance `lo..hi` of
//! `c_i = a_i − R b_i`. The positions are bounded and closed, so where there are any there is a highest one,
//! and it is the top of an outer sphere, the highest point of the circle in which two spheres meet, or one of
//! the two points in which three meet. Trying them all is complete: no search, no start, no tolerance to
//! tune.

use hexapod::Geometry;
use nalgebra::{Matrix3, Vector3};

/// Returns the centres `a_i − R b_i`, in A, m.
pub fn centres(geometry: &Geometry, rotation: &Matrix3<f64>) -> [Vector3<f64>; 6] {
    std::array::from_fn(|i| {
        Vector3::from(geometry.base_joints_m[i]) - rotation * Vector3::from(geometry.plate_joints_m[i])
    })
}

/// Calls `found` with every position (A, m) that is inside all shells and a candidate for the highest one,
/// until it returns true. Returns true if it did.
pub fn any_extreme(
    centres: &[Vector3<f64>; 6],
    [lo, hi]: [f64; 2],
    mut found: impl FnMut(&Vector3<f64>) -> bool,
) -> bool {
    // Rounding of a point on several spheres at once.
    let slack = 1e-9 * hi * hi;
    let (inner, outer) = (lo * lo - slack, hi * hi + slack);
    let mut try_point = |p: Vector3<f64>| {
        let inside = centres.iter().all(|c| {
            let square = (p - c).norm_squared();
            inner <= square && square <= outer
        });
        inside && found(&p)
    };
    for c in centres {
        if try_point(c + Vector3::z() * hi) {
            return true;
        }
    }
    let radii = [lo, hi];
    for i in 0..6 {
        for j in i + 1..6 {
            let apart = centres[j] - centres[i];
            let distance = apart.norm();
            if distance < 1e-12 * hi {
                continue;
            }
            let axis = apart / distance;
            // Along the axis to the circle's plane, then up in that plane.
            let up = Vector3::z() - axis * axis.z;
            let up = if up.norm() > 1e-9 { up.normalize() } else { Vector3::x() };
            for ri in radii {
                for rj in radii {
                    let along = 0.5 * (distance + (ri * ri - rj * rj) / distance);
                    let square = ri * ri - along * along;
                    if square >= 0.0 && try_point(centres[i] + axis * along + up * square.sqrt()) {
                        return true;
                    }
                }
            }
        }
    }
    for i in 0..6 {
        for j in i + 1..6 {
            for k in j + 1..6 {
                let (e, f) = (centres[j] - centres[i], centres[k] - centres[i]);
                let normal = e.cross(&f);
                let square = normal.norm_squared();
                if square < 1e-18 * hi.powi(4) {
                    continue;
                }
                let (ee, ff) = (e.norm_squared(), f.norm_squared());
                let (to_e, to_f) = (f.cross(&normal) / square, normal.cross(&e) / square);
                for ri in radii {
                    for rj in radii {
                        for rk in radii {
                            // p·e and p·f from the differences of the spheres' equations.
                            let pe = 0.5 * (ri * ri - rj * rj + ee);
                            let pf = 0.5 * (ri * ri - rk * rk + ff);
                            let foot = to_e * pe + to_f * pf;
                            let height = ri * ri - foot.norm_squared();
                            if height < 0.0 {
                                continue;
                            }
                            let rise = normal * (height / square).sqrt();
                            if try_point(centres[i] + foot + rise) || try_point(centres[i] + foot - rise) {
                                return true;
                            }
                        }
                    }
                }
            }
        }
    }
    false
}
