//! The columns of [`super::sensitivities`] for several row blocks side by side.
//!
//! The operations on the numbers of a block, and their order, are those of [`super::sensitivities`], those
//! with zeros left out: numbers are the same to the last bit, but for the signs of zeros. An error moves the
//! specific force alone, or products of rates and angular acceleration too; of the first kind the regressor
//! has two entries a row.

use std::ops::{Add, Mul, Neg, Sub};

use rigident_shared::regressor::SIGNALS;

use super::WRENCH;
use super::sensitivities::{Block, COLUMNS, PAIRS};

/// Blocks side by side.
pub(super) const LANES: usize = 4;

/// A number of each block.
#[derive(Clone, Copy)]
struct Lanes([f64; LANES]);

impl Lanes {
    const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    fn each(self, of: impl Fn(f64) -> f64) -> Self {
        Self(std::array::from_fn(|l| of(self.0[l])))
    }

    #[inline(always)]
    fn with(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self(std::array::from_fn(|l| of(self.0[l], other.0[l])))
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, |a, b| a * b)
    }
}

impl Mul<f64> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, by: f64) -> Self {
        self.each(|a| a * by)
    }
}

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.each(|a| -a)
    }
}

/// A vector, and a symmetric matrix by its rows.
type Vector = [Lanes; 3];
type Matrix = [[Lanes; 3]; 3];
type Axes = [[f64; 3]; 3];

/// Returns the number that `of` finds in each block; the last block fills the lanes that are left.
#[inline(always)]
fn gather(blocks: &[Block<'_>], of: impl Fn(&Block<'_>) -> f64) -> Lanes {
    Lanes(std::array::from_fn(|l| blocks.get(l).or(blocks.last()).map_or(0.0, &of)))
}

#[inline(always)]
fn combined(map: &Axes, v: &Vector) -> Vector {
    std::array::from_fn(|i| v[2] * map[i][2] + (v[1] * map[i][1] + v[0] * map[i][0]))
}

/// Returns an entry of `map · m`.
#[inline(always)]
fn left(map: &Axes, m: &Matrix, i: usize, j: usize) -> Lanes {
    m[2][j] * map[i][2] + (m[1][j] * map[i][1] + m[0][j] * map[i][0])
}

/// Returns an entry of `m · map`.
#[inline(always)]
fn right(m: &Matrix, map: &Axes, i: usize, j: usize) -> Lanes {
    m[i][2] * map[2][j] + (m[i][1] * map[1][j] + m[i][0] * map[0][j])
}

#[inline(always)]
fn dot(u: &[f64; 3], v: &Vector) -> Lanes {
    v[0] * u[0] + v[1] * u[1] + v[2] * u[2]
}

#[inline(always)]
fn scaled(u: &[f64; 3], by: Lanes) -> Vector {
    u.map(|u| by * -u)
}

/// Returns the six products of rates that are signals, in their order, each entry made by `of`.
#[inline(always)]
fn products(of: impl Fn(usize, usize) -> Lanes) -> [Lanes; 6] {
    [of(0, 0), of(1, 1), of(2, 2), of(1, 2), of(2, 0), of(0, 1)]
}

fn cross_matrix([x, y, z]: [f64; 3]) -> Axes {
    [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
}

/// Returns the wrench of specific forces alone.
#[inline(always)]
fn of_force([x, y, z]: Vector, phi: &[f64; 10]) -> [Lanes; WRENCH] {
    [
        x * phi[0],
        y * phi[0],
        z * phi[0],
        z * phi[2] + -y * phi[3],
        -z * phi[1] + x * phi[3],
        y * phi[1] + -x * phi[2],
    ]
}

/// Returns the wrench of signals: [`rigident_shared::regressor::block`] times the parameters.
#[inline(always)]
fn of_all(
    [ux, uy, uz]: Vector,
    [xx, yy, zz, yz, zx, xy]: [Lanes; 6],
    [ax, ay, az]: Vector,
    [px, py, pz]: [f64; 3],
    phi: &[f64; 10],
) -> [Lanes; WRENCH] {
    let (nx, ny, nz) = (-(yy + zz), -(zz + xx), -(xx + yy));
    let (xy_more, xy_less) = (xy + az, xy - az);
    let (yz_more, yz_less) = (yz + ax, yz - ax);
    let (zx_more, zx_less) = (zx + ay, zx - ay);
    let sx = ux - (nx * px + xy_less * py + zx_more * pz);
    let sy = uy - (xy_more * px + ny * py + yz_less * pz);
    let sz = uz - (zx_less * px + yz_more * py + nz * pz);
    let [m, mx, my, mz, i4, i5, i6, i7, i8, i9] = *phi;
    [
        sx * m + nx * mx + xy_less * my + zx_more * mz,
        sy * m + xy_more * mx + ny * my + yz_less * mz,
        sz * m + zx_less * mx + yz_more * my + nz * mz,
        sz * my + -sy * mz + ax * i4 + -yz * i5 + yz * i6 + (yy - zz) * i7 + xy_more * i8 + -zx_less * i9,
        -sz * mx + sx * mz + zx * i4 + ay * i5 + -zx * i6 + -xy_less * i7 + (zz - xx) * i8 + yz_more * i9,
        sy * mx + -sx * my + -xy * i4 + xy * i5 + az * i6 + zx_more * i7 + -yz_less * i8 + (xx - yy) * i9,
    ]
}

/// The signals of the blocks that an error may move.
struct Moving {
    force: Vector,
    products: Matrix,
    acceleration: Vector,
}

impl Moving {
    #[inline(always)]
    fn of(signals: impl Fn(usize) -> Lanes) -> Self {
        let at = &signals;
        let [xx, yy, zz, yz, zx, xy] = std::array::from_fn(|k| at(3 + k));
        Self {
            force: std::array::from_fn(at),
            products: [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]],
            acceleration: std::array::from_fn(|k| at(SIGNALS - 3 + k)),
        }
    }
}

/// Writes the columns of the first errors, for each block six rows of `count`, about the body's parameters.
#[inline(always)]
fn write_lanes(blocks: &[Block<'_>], phi: &[f64; 10], count: usize, out: &mut [f64]) {
    let Some(first) = blocks.first() else { return };
    let axes: Axes = std::array::from_fn(|k| first.axes.column(k).into_owned().into());
    let lever_arm = first.lever_arm.array();
    let now = Moving::of(|k| gather(blocks, |block| block.signals[k]));
    let slope = Moving::of(|k| gather(blocks, |block| block.slope[k]));
    let rate: Vector = std::array::from_fn(|k| gather(blocks, |block| block.rate[k]));
    let one = gather(blocks, |block| block.one);
    let p = &now.products;
    let trace = Lanes::ZERO + p[0][0] + p[1][1] + p[2][2];
    let none = [Lanes::ZERO; 3];
    for k in 0..count.min(COLUMNS) {
        let turned = |map: Axes, force: Vector| {
            let own = products(|i, j| left(&map, p, i, j) - right(p, &map, i, j));
            of_all(force, own, combined(&map, &now.acceleration), lever_arm, phi)
        };
        let column = match k {
            0..3 => {
                let unit: [f64; 3] = std::array::from_fn(|i| f64::from(u8::from(i == k)));
                let turning: Vector = std::array::from_fn(|i| p[i][k] - trace * unit[i]);
                let [x, y, z] = now.acceleration;
                let [ex, ey, ez] = unit;
                let cross = [y * ez - z * ey, z * ex - x * ez, x * ey - y * ex];
                of_force(std::array::from_fn(|i| -(cross[i] + turning[i])), phi)
            }
            3..6 => {
                let map = cross_matrix(std::array::from_fn(|i| f64::from(u8::from(i == k - 3))));
                turned(map, combined(&map, &now.force))
            }
            6 => {
                let own = products(|i, j| slope.products[i][j]);
                of_all(slope.force, own, slope.acceleration, lever_arm, phi)
            }
            7..10 => {
                let u = &axes[k - 7];
                let own = products(|i, j| -(rate[j] * u[i] + rate[i] * u[j]));
                of_all(none, own, none, lever_arm, phi)
            }
            10..13 => {
                let u = &axes[k - 10];
                let along: Axes = std::array::from_fn(|i| std::array::from_fn(|j| u[i] * u[j]));
                let own = products(|i, j| -(left(&along, p, i, j) + right(p, &along, i, j)));
                let acceleration = combined(&along, &now.acceleration).map(|a| -a);
                of_all(none, own, acceleration, lever_arm, phi)
            }
            13..16 => turned(cross_matrix(axes[k - 13]), none),
            16..19 => of_force(scaled(&axes[k - 16], one), phi),
            19..22 => of_force(scaled(&axes[k - 19], dot(&axes[k - 19], &now.force)), phi),
            25 => of_force(now.force, phi),
            _ => {
                let (i, j) = PAIRS.get(k.saturating_sub(22)).copied().unwrap_or((1, 0));
                of_force(scaled(&axes[i], dot(&axes[j], &now.force)), phi)
            }
        };
        for (l, own) in out.chunks_exact_mut(WRENCH * count).enumerate().take(blocks.len()) {
            for (c, column) in column.iter().enumerate() {
                own[c * count + k] = column.0[l];
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn write_avx2(blocks: &[Block<'_>], phi: &[f64; 10], count: usize, out: &mut [f64]) {
    write_lanes(blocks, phi, count, out);
}

/// Writes the columns of the first errors of at most [`LANES`] blocks of one IMU, one block after the other,
/// six rows of `count` each, about the body's parameters `phi`.
pub(super) fn write(blocks: &[Block<'_>], phi: &[f64; 10], count: usize, out: &mut [f64]) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the instructions that the function is compiled for, as was just asked.
        return unsafe { write_avx2(blocks, phi, count, out) };
    }
    write_lanes(blocks, phi, count, out);
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};
    use rigident_shared::spatial::Position;

    use super::*;

    #[test]
    fn blocks_side_by_side_have_the_bits_of_single_ones() {
        let mut state = 3_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 10.0
        };
        let axes = *Rotation3::new(Vector3::new(next(), next(), next())).matrix();
        for turned in [axes, nalgebra::Matrix3::identity()] {
            for lever_arm in [[0.0; 3], [next(), next(), next()]] {
                let signals: Vec<[f64; SIGNALS]> = (0..4).map(|_| std::array::from_fn(|_| next())).collect();
                let phi: [f64; 10] = std::array::from_fn(|_| next());
                let blocks: Vec<Block<'_>> = signals
                    .iter()
                    .map(|signals| Block {
                        signals,
                        one: 1.0,
                        rate: Vector3::new(next(), next(), next()),
                        slope: std::array::from_fn(|_| next()),
                        axes: turned,
                        lever_arm: Position::from_array(lever_arm),
                    })
                    .collect();
                for (count, some) in [(26, 4), (25, 3), (7, 1)] {
                    let mut own = vec![f64::NAN; some * WRENCH * count];
                    write(&blocks[..some], &phi, count, &mut own);
                    let mut single = vec![f64::NAN; WRENCH * count];
                    for (block, own) in blocks.iter().zip(own.chunks_exact(WRENCH * count)) {
                        block.write(&phi, &mut single);
                        // Zeros of either sign are equal.
                        assert!(own.iter().zip(&single).all(|(a, b)| a == b), "{count}: {own:?} {single:?}");
                    }
                }
            }
        }
    }
}
