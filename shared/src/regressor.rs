//! The wrench regressor `w = A(a, ω, ω̇) φ`.
//!
//! Lives here: the signals a sample contributes and the 6×10 block they make. May not live here: time.
//! Before this: [`crate::calibration`]; after it: [`crate::conditioning`].
//!
//! Every entry of A is a linear combination, with constant coefficients, of twelve signals: the specific
//! force, the six products ωᵢωⱼ and the three ω̇ᵢ; and so are the lever-arm terms
//! `a = a_U − ω̇×p − ω×(ω×p)`. One FIR over these twelve is therefore the same FIR over every entry of A.

use crate::Scalar;
use crate::spatial::{Position, Sensor};

/// Signals per sample: specific force at U (3), products (6), wrench (6), angular rate (3).
pub const SIGNALS: usize = 18;
/// Tells how many of the signals are smoothed; the rest, the angular rate, is differentiated.
pub const SMOOTHED: usize = 15;

/// Tells where the wrench is among the signals.
pub const WRENCH: usize = 9;

/// Returns the signals in the order `[a_U(3), ωx², ωy², ωz², ωyωz, ωzωx, ωxωy, F(3), M(3), ω(3)]`.
#[inline(always)]
pub fn signals<T: Scalar>(specific_force: [T; 3], rate: [T; 3], wrench: [T; 6]) -> [T; SIGNALS] {
    let [ax, ay, az] = specific_force;
    let [x, y, z] = rate;
    let [fx, fy, fz, mx, my, mz] = wrench;
    [ax, ay, az, x * x, y * y, z * z, y * z, z * x, x * y, fx, fy, fz, mx, my, mz, x, y, z]
}

/// Columns of the 6×10 regressor, each `[Fx, Fy, Fz, Mx, My, Mz]`, and the wrench they explain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegressorBlock<T: Scalar> {
    /// Column j belongs to parameter j of φ.
    pub columns: [[T; 6]; 10],
    /// Wrench on the body in S: N, N m.
    pub wrench: [T; 6],
}

/// Returns the regressor block from (conditioned) signals, the last three being ω̇, and the IMU's lever arm p
/// in S.
///
/// `F = a m + ([ω̇]× + [ω]×[ω]×) mc`, `M = −[a]× mc + (L(ω̇) + [ω]× L(ω)) I`.
#[inline(always)]
pub fn block<T: Scalar>(signals: &[T; SIGNALS], lever_arm: &Position<Sensor, T>) -> RegressorBlock<T> {
    let [ux, uy, uz, xx, yy, zz, yz, zx, xy, fx, fy, fz, mx, my, mz, ax, ay, az] = *signals;
    let [px, py, pz] = lever_arm.array();
    let o = T::ZERO;
    // [ω]×[ω]× = ω ωᵀ − |ω|² 1
    let (nx, ny, nz) = (-(yy + zz), -(zz + xx), -(xx + yy));
    let (xy_more, xy_less) = (xy + az, xy - az);
    let (yz_more, yz_less) = (yz + ax, yz - ax);
    let (zx_more, zx_less) = (zx + ay, zx - ay);
    // a = a_U − ([ω̇]× + [ω]×[ω]×) p
    let sx = ux - (nx * px + xy_less * py + zx_more * pz);
    let sy = uy - (xy_more * px + ny * py + yz_less * pz);
    let sz = uz - (zx_less * px + yz_more * py + nz * pz);
    RegressorBlock {
        columns: [
            [sx, sy, sz, o, o, o],
            [nx, xy_more, zx_less, o, -sz, sy],
            [xy_less, ny, yz_more, sz, o, -sx],
            [zx_more, yz_less, nz, -sy, sx, o],
            [o, o, o, ax, zx, -xy],
            [o, o, o, -yz, ay, xy],
            [o, o, o, yz, -zx, az],
            [o, o, o, yy - zz, -xy_less, zx_more],
            [o, o, o, xy_more, zz - xx, -yz_less],
            [o, o, o, -zx_less, yz_more, xx - yy],
        ],
        wrench: [fx, fy, fz, mx, my, mz],
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Vector3};

    use super::*;
    use crate::inertia::InertialParameters;

    fn pseudo_random(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (*seed >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
    }

    /// Returns random kinematics, the block they make, and the wrench by Newton and Euler about the centre of
    /// mass, never by the regressor's algebra: the oracle.
    fn case(seed: &mut u64) -> (RegressorBlock<f64>, [f64; 10], [f64; 6]) {
        let mut v = || Vector3::new(pseudo_random(seed), pseudo_random(seed), pseudo_random(seed));
        let (omega, alpha, lever, c, a_s) = (v(), v(), v(), v(), v() * 10.0);
        let g = Matrix3::from_columns(&[v(), v(), v()]);
        let inertia_com = g * g.transpose();
        let mass = 2.5;
        let a_imu = a_s + alpha.cross(&lever) + omega.cross(&omega.cross(&lever));
        let a_com = a_s + alpha.cross(&c) + omega.cross(&omega.cross(&c));
        let force = a_com * mass;
        let moment = inertia_com * alpha + omega.cross(&(inertia_com * omega)) + c.cross(&force);
        let mut s = signals(a_imu.into(), omega.into(), [0.0; 6]);
        s[15..].copy_from_slice(alpha.as_slice());
        let phi = InertialParameters::<Sensor, f64>::from_centre_of_mass(
            mass,
            Position::from_array(c.into()),
            inertia_com,
        );
        let wrench = core::array::from_fn(|i| if i < 3 { force[i] } else { moment[i - 3] });
        (block(&s, &Position::from_array(lever.into())), phi.to_vector(), wrench)
    }

    fn largest_error((block, phi, wrench): &(RegressorBlock<f64>, [f64; 10], [f64; 6])) -> f64 {
        (0..6)
            .map(|row| (0..10).map(|j| block.columns[j][row] * phi[j]).sum::<f64>() - wrench[row])
            .fold(0.0, |largest, e| f64::max(largest, e.abs()))
    }

    #[test]
    fn block_times_parameters_is_newton_euler() {
        let seed = &mut 7_u64;
        for _ in 0..200 {
            assert!(largest_error(&case(seed)) < 1e-12);
        }
    }

    #[test]
    fn one_flipped_sign_anywhere_is_noticed() {
        let clean = case(&mut 7_u64);
        for (j, row) in (0..10).flat_map(|j| (0..6).map(move |row| (j, row))) {
            let mut flipped = clean;
            if flipped.0.columns[j][row] != 0.0 {
                flipped.0.columns[j][row] *= -1.0;
                assert!(largest_error(&flipped) > 1e-3, "column {j}, row {row}");
            }
        }
    }
}
