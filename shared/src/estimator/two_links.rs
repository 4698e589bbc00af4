//! Two links that a spherical joint holds together, the first on the load cell, with one IMU each.
//!
//! The rows are those of [`crate::tree::momentum`], which know no acceleration: about the base IMU's origin,
//! where gravity and acceleration are one measured thing, and moved to S behind the filter. Of the second
//! link's mass nothing can be determined ([`crate::tree`]: it belongs to the base's ten), so its column is
//! left out: 10 + 9 parameters, and six more for the wrench offset.
//!
//! # The joint's attitude
//! is streamed with the readings, or found here: both gyros turn it (`Ṙ = R [ω₁]× − [ω₀]× R`), and what is
//! left over between the two accelerometers' ideas of the specific force *at the joint* turns it back,
//! slowly. At the joint and behind the filter the two must agree exactly, whatever the motion: the lever
//! arms' terms enter as in the rows, by the filter's derivative. A turn about the specific force shows only
//! as far as its direction changes; at the start the attitude must therefore be known about the vertical.

use nalgebra::{Matrix3, Vector3};

use super::noise::Noiseless;
use super::{EstimatorConfig, Model};
use crate::Scalar;
use crate::calibration::{ImuMounting, Reading};
use crate::factor::Cascade;
use crate::regressor;
use crate::screening::{ATTITUDE_CHANNEL, Rejection, Screen, TWO_LINK_CHANNELS};
use crate::spatial::{AngularRate, Imu, Rotation, SpecificForce, Wrench};
use crate::tree::momentum::{Parts, parts};
use crate::tree::{BaseMotion, LinkState};

/// Parameters without the offset.
pub const PARAMETERS: usize = 19;
/// Parameters of the second link: first moments, and the tensor about the joint.
const SECOND: usize = 9;
/// Numbers of its columns: six each of the moments', three each of the tensor's, which moments alone see.
const ENTRIES: usize = 6 * 3 + 3 * 6;
/// Number of one body's signals that are smoothed.
const BASE: usize = regressor::SMOOTHED;
/// Tells where the second link's smoothed entries are, the joint's specific force, and what is
/// differentiated.
const LINK: usize = BASE;
const JOINT_FORCE: usize = LINK + ENTRIES;
const SMOOTHED: usize = JOINT_FORCE + 3;
const RATE: usize = SMOOTHED;
const LINK_MOMENTUM: usize = RATE + 3;
const SWING: usize = LINK_MOMENTUM + ENTRIES;
/// Signals per reading.
pub const SIGNALS: usize = SWING + 3;
/// Tells how many of them are differentiated.
pub const DIFFERENTIATED: usize = SIGNALS - SMOOTHED;
/// Levels above the absorbing one: the last takes more than a hundred merges after 2e6 row blocks.
const UPPER: usize = 2;
/// Row blocks whose leftovers are averaged before the first is absorbed: three filters' widths.
const SETTLING: u16 = 32;
/// Across a longer time nothing is turned, ns.
const LONGEST_STEP_NS: u64 = 100_000_000;

/// Holds what the sensors of two links said at one instant of the load cell's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TwoLinkReading<T: Scalar> {
    /// Load cell and the base's IMU.
    pub base: Reading<T>,
    /// Specific force at the second IMU's origin, in its axes, uncorrected.
    pub specific_force: SpecificForce<Imu, T>,
    /// Angular rate in the second IMU's axes, uncorrected.
    pub angular_rate: AngularRate<Imu, T>,
    /// Attitude of the second link, `R_SL` as a quaternion w, x, y, z; not examined if it is found from the
    /// IMUs.
    pub attitude: [T; 4],
}

impl<T: Scalar> TwoLinkReading<T> {
    /// All zero.
    pub const ZERO: Self = Self {
        base: Reading {
            time_ns: 0,
            wrench: Wrench::zero(),
            specific_force: SpecificForce::zero(),
            angular_rate: AngularRate::zero(),
        },
        specific_force: SpecificForce::zero(),
        angular_rate: AngularRate::zero(),
        attitude: [T::ZERO; 4],
    };
}

/// Tells where the joint's attitude comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum JointAttitude<T> {
    /// The attitude comes with every reading.
    Streamed,
    /// The attitude is found from both IMUs.
    FromImus {
        /// The attitude at the start, w, x, y, z.
        initial: [T; 4],
        /// Time constant of the accelerometers' correction, s; zero: the gyros alone.
        time_constant_s: T,
    },
}

/// Holds what is known of the second link and the joint, and the attitude as it is followed.
#[derive(Clone, Copy, Debug)]
pub struct TwoLinks<T: Scalar> {
    /// The second IMU on the second link.
    pub mounting: ImuMounting<T>,
    /// Ranges of the second IMU: m/s², rad/s.
    pub ranges: [T; 2],
    /// The joint in S, m.
    pub joint: [T; 3],
    /// Tells where the attitude comes from.
    pub attitude: JointAttitude<T>,
    screen: Screen<T, TWO_LINK_CHANNELS>,
    /// w, x, y, z
    quaternion: [T; 4],
    /// Time and both rates of the last reading.
    last: Option<(u64, Vector3<T>, Vector3<T>)>,
    corrections: u16,
}

impl<T: Scalar> TwoLinks<T> {
    /// Makes the model. Returns `None` if an attitude is no rotation or a number is not finite.
    pub fn new(
        mounting: ImuMounting<T>,
        ranges: [T; 2],
        joint: [T; 3],
        attitude: JointAttitude<T>,
    ) -> Option<Self> {
        if let JointAttitude::FromImus { initial, time_constant_s } = attitude {
            Rotation::<Imu, Imu, T>::from_quaternion(initial)?;
            if !time_constant_s.is_finite() || time_constant_s < T::ZERO {
                return None;
            }
        }
        let finite = joint.iter().all(|v| v.is_finite());
        finite.then_some(Self { mounting, ranges, joint, attitude, ..Self::NONE })
    }

    /// The model before it is set up. All bits are zero.
    const NONE: Self = Self {
        mounting: ImuMounting::UNUSED,
        ranges: [T::ZERO; 2],
        joint: [T::ZERO; 3],
        attitude: JointAttitude::Streamed,
        screen: Screen::UNUSED,
        quaternion: [T::ZERO; 4],
        last: None,
        corrections: 0,
    };

    /// Returns the second link's attitude, `R_SL` as a quaternion w, x, y, z.
    pub fn attitude(&self) -> [T; 4] {
        self.quaternion
    }

    /// Turns the attitude by both links' rates from the last reading to this one, trapezoidally.
    fn turn(&mut self, time_ns: u64, base: Vector3<T>, second: Vector3<T>) {
        let last = self.last.replace((time_ns, base, second));
        let Some((then_ns, base_then, second_then)) = last else { return };
        let step_ns = time_ns.wrapping_sub(then_ns);
        if step_ns > LONGEST_STEP_NS {
            // The accelerometers find back what they can.
            self.corrections = 0;
            return;
        }
        let half = T::from_u32(step_ns as u32) * T::from_f32(0.5e-9);
        let before = small_turn(&((base + base_then) * (T::ZERO - half)));
        let after = small_turn(&((second + second_then) * half));
        self.quaternion = normalised(product(&product(&before, &self.quaternion), &after));
    }

    /// Turns it back by what is left over between the specific forces at the joint, in the axes of S.
    fn correct(&mut self, by_base: &Vector3<T>, by_second: &Vector3<T>, block_s: T, time_constant_s: T) {
        let square = by_base.dot(by_base);
        if square <= T::TINY_SQUARE {
            return;
        }
        self.corrections = self.corrections.saturating_add(1);
        let first = T::ONE / T::from_u32(u32::from(self.corrections));
        let gain = (block_s / time_constant_s).max(first);
        let error = by_second.cross(by_base) * (gain / square);
        self.quaternion = normalised(product(&small_turn(&error), &self.quaternion));
    }
}

/// Returns `[1 − |θ|²/8, θ/2 (1 − |θ|²/24)]`: to the fourth order in a small angle.
fn small_turn<T: Scalar>(angle: &Vector3<T>) -> [T; 4] {
    let square = angle.dot(angle);
    let v = angle * (T::from_f32(0.5) - square * T::from_f64_const(1.0 / 48.0));
    [T::ONE - square * T::from_f32(0.125), v.x, v.y, v.z]
}

fn product<T: Scalar>(a: &[T; 4], b: &[T; 4]) -> [T; 4] {
    let ([aw, ax, ay, az], [bw, bx, by, bz]) = (*a, *b);
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

/// Normalises a quaternion by one step of Newton's: what is near a unit quaternion becomes one.
fn normalised<T: Scalar>(q: [T; 4]) -> [T; 4] {
    let [w, x, y, z] = q;
    let n2 = w * w + x * x + y * y + z * z;
    let scale = (T::from_f32(3.0) - n2) * T::from_f32(0.5);
    q.map(|v| v * scale)
}

/// Returns the matrix of axes of S ← axes of the link.
fn matrix<T: Scalar>(quaternion: [T; 4]) -> Option<Matrix3<T>> {
    Rotation::<Imu, Imu, T>::from_quaternion(quaternion).map(|r| r.matrix())
}

/// Returns columns 1 to 9 of six rows: six numbers for each first moment, three for each of the tensor.
fn entries<T: Scalar>(block: &[[T; 10]; 6]) -> [T; ENTRIES] {
    let mut out = [T::ZERO; ENTRIES];
    let (first, tensor) = out.split_at_mut(18);
    for (k, column) in first.as_chunks_mut::<6>().0.iter_mut().enumerate() {
        for (entry, row) in column.iter_mut().zip(block) {
            *entry = row[1 + k];
        }
    }
    let [_, _, _, mx, my, mz] = block;
    for (k, column) in tensor.as_chunks_mut::<3>().0.iter_mut().enumerate() {
        *column = [mx[4 + k], my[4 + k], mz[4 + k]];
    }
    out
}

fn write<T: Scalar>(signals: &mut [T; SIGNALS], at: usize, values: &[T]) {
    for (slot, value) in signals.iter_mut().skip(at).zip(values) {
        *slot = *value;
    }
}

fn three<T: Scalar>(signals: &[T; SIGNALS], at: usize) -> Vector3<T> {
    let part = signals.get(at..).and_then(|rest| rest.first_chunk::<3>());
    part.map_or_else(Vector3::zeros, |v| Vector3::from(*v))
}

fn base_signals<T: Scalar>(signals: &[T; SIGNALS]) -> [T; regressor::SIGNALS] {
    core::array::from_fn(|k| {
        signals.get(if k < BASE { k } else { RATE + k - BASE }).copied().unwrap_or_default()
    })
}

/// Returns `p × f`.
fn moved<T: Scalar>(p: &Vector3<T>, f: [T; 3]) -> Vector3<T> {
    p.cross(&Vector3::from(f))
}

impl<T: Scalar> TwoLinks<T> {
    /// Returns the columns of all `N` parameters, and the wrench.
    #[inline(always)]
    fn columns<const N: usize>(config: &EstimatorConfig<T>, signals: &[T; SIGNALS]) -> ([[T; 6]; N], [T; 6]) {
        let base = regressor::block(&base_signals(signals), &config.mounting.position);
        let mut columns = [[T::ZERO; 6]; N];
        for (column, own) in columns.iter_mut().zip(&base.columns) {
            *column = *own;
        }
        let link = signals.get(LINK..LINK + ENTRIES).unwrap_or_default();
        let (first, tensor) = link.split_at_checked(18).unwrap_or_default();
        let mut rest = columns.iter_mut().skip(10);
        for (own, column) in first.as_chunks::<6>().0.iter().zip(&mut rest) {
            *column = *own;
        }
        for ([x, y, z], column) in tensor.as_chunks::<3>().0.iter().zip(&mut rest) {
            *column = [T::ZERO, T::ZERO, T::ZERO, *x, *y, *z];
        }
        for (k, column) in columns.iter_mut().skip(PARAMETERS).enumerate() {
            if let Some(own) = column.get_mut(k) {
                *own = T::ONE;
            }
        }
        (columns, base.wrench)
    }
}

impl<T: Scalar, const N: usize> Model<T, N, SIGNALS> for TwoLinks<T> {
    type Reading = TwoLinkReading<T>;
    type Store = Cascade<T, N, UPPER>;
    type Noise = Noiseless;
    const UNUSED: Self = Self::NONE;

    fn restart(&mut self, config: &EstimatorConfig<T>) {
        const {
            assert!(
                N == PARAMETERS || N == PARAMETERS + 6,
                "nineteen parameters, or 25 with the \
            offset"
            )
        }
        let limits = &config.limits;
        let [w0, w1, w2, w3, w4, w5] = limits.wrench;
        let (a, g) = (limits.specific_force, limits.angular_rate);
        let [a1, g1] = self.ranges;
        let ranges = [w0, w1, w2, w3, w4, w5, a, a, a, g, g, g, a1, a1, a1, g1, g1, g1];
        self.screen = Screen::of_ranges(&ranges, limits.frozen_after);
        if let JointAttitude::FromImus { initial: [w, x, y, z], .. } = self.attitude {
            let root = (w * w + x * x + y * y + z * z).sqrt();
            self.quaternion = [w, x, y, z].map(|v| v / root);
        }
        (self.last, self.corrections) = (None, 0);
    }

    #[inline(always)]
    fn time_ns(reading: &TwoLinkReading<T>) -> u64 {
        reading.base.time_ns
    }

    fn screen(&mut self, reading: &TwoLinkReading<T>) -> Result<(), Rejection> {
        let TwoLinkReading { base, specific_force, angular_rate, attitude } = reading;
        let [fx, fy, fz, mx, my, mz] = base.wrench.array();
        let [ax, ay, az] = base.specific_force.array();
        let [gx, gy, gz] = base.angular_rate.array();
        let [bx, by, bz] = specific_force.array();
        let [hx, hy, hz] = angular_rate.array();
        self.screen.check_values([fx, fy, fz, mx, my, mz, ax, ay, az, gx, gy, gz, bx, by, bz, hx, hy, hz])?;
        if self.attitude == JointAttitude::Streamed {
            // A hundredth off a unit quaternion is none.
            let n2 = attitude.iter().map(|v| *v * *v).sum::<T>();
            let near = (n2 - T::ONE).abs() < T::from_f32(0.02);
            if !near {
                return Err(Rejection::NotFinite(ATTITUDE_CHANNEL));
            }
        }
        Ok(())
    }

    #[inline]
    fn signals(&mut self, config: &EstimatorConfig<T>, reading: &TwoLinkReading<T>) -> [T; SIGNALS] {
        let turned = |mounting: &ImuMounting<T>, a: SpecificForce<Imu, T>, w: AngularRate<Imu, T>| {
            let ([sx, sy, sz], [ax, ay, az]) = (mounting.accel_scale, a.array());
            let scaled = SpecificForce::<Imu, T>::new(sx * ax, sy * ay, sz * az) - mounting.accel_bias;
            let r = mounting.rotation.matrix();
            (r * scaled.vector(), r * (w - mounting.gyro_bias).vector())
        };
        let base = &reading.base;
        let (a0, w0) = turned(&config.mounting, base.specific_force, base.angular_rate);
        let (a1, w1) = turned(&self.mounting, reading.specific_force, reading.angular_rate);
        match self.attitude {
            JointAttitude::Streamed => self.quaternion = reading.attitude,
            JointAttitude::FromImus { .. } => self.turn(base.time_ns, w0, w1),
        }
        let rotation = matrix(self.quaternion).unwrap_or_else(Matrix3::identity);
        // About the base IMU's origin, in the axes of S.
        let arm = Vector3::from(self.joint) - config.mounting.position.vector();
        let state = LinkState {
            rotation,
            position: arm,
            velocity: w0.cross(&arm),
            rate: rotation * w1,
            ..LinkState::zero()
        };
        let motion = BaseMotion { specific_force: a0, rate: w0, angular_acceleration: Vector3::zeros() };
        let Parts { smoothed, differentiated } = parts(&state, &motion);
        // With v = R (ω₁ × p₁) the specific force at the joint is R a₁ − ω₀ × v − v̇.
        let swing = rotation * w1.cross(&self.mounting.position.vector());
        let joint_force = rotation * a1 - w0.cross(&swing);
        let mut signals = [T::ZERO; SIGNALS];
        let own = regressor::signals(a0.into(), w0.into(), base.wrench.array());
        let (own, rate) = own.split_at(BASE);
        write(&mut signals, 0, own);
        write(&mut signals, LINK, &entries(&smoothed));
        write(&mut signals, JOINT_FORCE, joint_force.as_slice());
        write(&mut signals, RATE, rate);
        write(&mut signals, LINK_MOMENTUM, &entries(&differentiated));
        write(&mut signals, SWING, swing.as_slice());
        signals
    }

    fn rows(&mut self, config: &EstimatorConfig<T>, conditioned: &[T; SIGNALS]) -> Option<[T; SIGNALS]> {
        let mut signals = *conditioned;
        let base = base_signals(&signals);
        if let JointAttitude::FromImus { time_constant_s, .. } = self.attitude
            && time_constant_s > T::ZERO
        {
            // At the joint, seen from the base: a + ([ω̇]× + [ω]×[ω]×) arm.
            let [ax, ay, az, xx, yy, zz, yz, zx, xy, .., cx, cy, cz] = base;
            let arm = Vector3::from(self.joint) - config.mounting.position.vector();
            let o = T::ZERO;
            let turning = Matrix3::new(
                o - (yy + zz),
                xy - cz,
                zx + cy,
                xy + cz,
                o - (zz + xx),
                yz - cx,
                zx - cy,
                yz + cx,
                o - (xx + yy),
            );
            let by_base = Vector3::new(ax, ay, az) + turning * arm;
            let by_second = three(&signals, JOINT_FORCE) - three(&signals, SWING);
            let block_s = T::from_u32(u32::from(config.row_every)) / config.rate_hz;
            self.correct(&by_base, &by_second, block_s, time_constant_s);
            if self.corrections < SETTLING {
                return None;
            }
        }
        // Smoothed and differentiated parts together, moments about S.
        for k in 0..ENTRIES {
            let momentum = signals.get(LINK_MOMENTUM + k).copied().unwrap_or_default();
            if let Some(entry) = signals.get_mut(LINK + k) {
                *entry += momentum;
            }
        }
        let to_imu = config.mounting.position.vector();
        if let Some(first) = signals.get_mut(LINK..LINK + 18) {
            for [fx, fy, fz, mx, my, mz] in first.as_chunks_mut::<6>().0 {
                let more = moved(&to_imu, [*fx, *fy, *fz]);
                (*mx, *my, *mz) = (*mx + more.x, *my + more.y, *mz + more.z);
            }
        }
        config.take_off_offset(&mut signals);
        Some(signals)
    }

    fn residual(
        config: &EstimatorConfig<T>,
        _: &Self,
        signals: &[T; SIGNALS],
        parameters: &[T; N],
    ) -> [T; 6] {
        let (columns, mut e) = Self::columns::<N>(config, signals);
        for (column, phi) in columns.iter().zip(parameters) {
            for (e, a) in e.iter_mut().zip(column) {
                *e -= *a * *phi;
            }
        }
        e
    }

    fn spread(config: &EstimatorConfig<T>, _: &Self, signals: &[T; SIGNALS], sd: &[T; N], c: usize) -> T {
        let (columns, _) = Self::columns::<N>(config, signals);
        columns.iter().zip(sd).map(|(column, sd)| column.get(c).map_or(T::ZERO, |a| a.abs()) * *sd).sum()
    }

    fn absorb(
        config: &EstimatorConfig<T>,
        _: &Self,
        signals: &[T; SIGNALS],
        weights: &[T; 6],
        _: &[T; 6],
        store: &mut Self::Store,
        _: &mut Noiseless,
    ) {
        let (mut columns, mut wrench) = Self::columns::<N>(config, signals);
        for column in columns.iter_mut().chain([&mut wrench]) {
            for (a, weight) in column.iter_mut().zip(weights) {
                *a *= *weight;
            }
        }
        store.absorb(&columns, &wrench);
    }
}

/// Tells how many parameters the second link has.
const _: () = assert!(10 + SECOND == PARAMETERS);

#[cfg(test)]
#[path = "two_links_tests.rs"]
mod tests;
