//! Vectors that know their frame and quantity.
//!
//! Lives here: the frames of the notation (A, S, U, body), one vector type per physical quantity, rotations
//! between frames. May not live here: anything about mass. Next: [`crate::inertia`], [`crate::regressor`].
//!
//! A frame or quantity slip does not compile:
//! ```compile_fail
//! use rigident_shared::spatial::*;
//! let at_sensor = AngularRate::<Sensor, f64>::new(0.0, 0.0, 1.0);
//! let at_imu = AngularRate::<Imu, f64>::new(0.0, 0.0, 1.0);
//! let _ = at_sensor + at_imu; // S and U axes mixed
//! ```
//! ```compile_fail
//! use rigident_shared::spatial::*;
//! let f = Force::<Sensor, f64>::new(0.0, 0.0, 1.0);
//! let m = Moment::<Sensor, f64>::new(0.0, 0.0, 1.0);
//! let _ = Wrench::new(m, f); // moment given as force
//! ```
//! ```compile_fail
//! use rigident_shared::spatial::*;
//! let mounting = Rotation::<Sensor, Imu, f64>::identity();
//! let rate = AngularRate::<Sensor, f64>::new(0.0, 0.0, 1.0);
//! let _ = mounting * rate; // a rotation from U applied to a vector in S
//! ```
//!
//! Not promised: that a rotation given by a user is the right one, or that two vectors belong to the same
//! instant. Wrenches are on the body, specific force has gravity in it (`a = R_SA (p̈ − g)`).

use core::marker::PhantomData;
use core::ops::{Add, Mul, Neg, Sub};

use nalgebra::{Matrix3, Vector3};

use crate::Scalar;

/// A frame of reference, as a marker type.
pub trait Frame: Copy + Default + PartialEq + core::fmt::Debug + Send + Sync + 'static {
    /// The frame's symbol in the notation.
    const SYMBOL: &'static str;
}

macro_rules! frame {
    ($(#[$doc:meta] $name:ident = $symbol:literal;)*) => {$(
        #[$doc]
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct $name;
        impl Frame for $name {
            const SYMBOL: &'static str = $symbol;
        }
    )*};
}
frame! {
    /// A: earth-fixed, z up.
    Earth = "A";
    /// S: the wrench sensor's frame; also the frame of link 0.
    Sensor = "S";
    /// U: the inertial measurement unit's own axes.
    Imu = "U";
    /// The customer's frame of the body under test.
    Body = "body";
}

macro_rules! quantity {
    ($(#[$doc:meta] $name:ident;)*) => {$(
        #[$doc]
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name<F: Frame, T: Scalar>(Vector3<T>, PhantomData<F>);

        impl<F: Frame, T: Scalar> $name<F, T> {
            /// Makes a vector from components along the frame's axes.
            #[inline(always)]
            pub const fn new(x: T, y: T, z: T) -> Self {
                Self(Vector3::new(x, y, z), PhantomData)
            }
            /// Makes a vector from components along the frame's axes. The caller vouches for the frame.
            #[inline(always)]
            pub fn from_array(v: [T; 3]) -> Self {
                let [x, y, z] = v;
                Self::new(x, y, z)
            }
            /// Returns the zero vector.
            #[inline(always)]
            pub const fn zero() -> Self {
                Self::new(T::ZERO, T::ZERO, T::ZERO)
            }
            /// Returns the components along the frame's axes.
            #[inline(always)]
            pub fn array(&self) -> [T; 3] {
                [self.0.x, self.0.y, self.0.z]
            }
            /// Returns the components as a plain vector, the frame forgotten.
            #[inline(always)]
            pub fn vector(&self) -> Vector3<T> {
                self.0
            }
            /// Returns whether every component is finite.
            pub fn is_finite(&self) -> bool {
                self.0.x.is_finite() && self.0.y.is_finite() && self.0.z.is_finite()
            }
        }
        impl<F: Frame, T: Scalar> Default for $name<F, T> {
            fn default() -> Self {
                Self::zero()
            }
        }
        impl<F: Frame, T: Scalar> Add for $name<F, T> {
            type Output = Self;
            #[inline(always)]
            fn add(self, o: Self) -> Self {
                Self(self.0 + o.0, PhantomData)
            }
        }
        impl<F: Frame, T: Scalar> Sub for $name<F, T> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, o: Self) -> Self {
                Self(self.0 - o.0, PhantomData)
            }
        }
        impl<F: Frame, T: Scalar> Neg for $name<F, T> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(-self.0, PhantomData)
            }
        }
        impl<To: Frame, From: Frame, T: Scalar> Mul<$name<From, T>> for Rotation<To, From, T> {
            type Output = $name<To, T>;
            #[inline(always)]
            fn mul(self, v: $name<From, T>) -> $name<To, T> {
                $name(self.matrix * v.0, PhantomData)
            }
        }
    )*};
}
quantity! {
    /// Position, m.
    Position;
    /// Force on the body by the sensor side, N.
    Force;
    /// Moment on the body by the sensor side about the frame's origin, N m.
    Moment;
    /// Specific force `p̈ − g`, m/s²: what an ideal accelerometer reads.
    SpecificForce;
    /// Angular rate of the link relative to A, rad/s.
    AngularRate;
    /// Time derivative of the angular rate in the link's axes, rad/s².
    AngularAcceleration;
}

/// Wrench on the body by the sensor side, at the frame's origin: N, N m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench<F: Frame, T: Scalar> {
    /// Force, N.
    pub force: Force<F, T>,
    /// Moment about the frame's origin, N m.
    pub moment: Moment<F, T>,
}

impl<F: Frame, T: Scalar> Wrench<F, T> {
    /// Returns the zero wrench.
    #[inline(always)]
    pub const fn zero() -> Self {
        Self { force: Force::zero(), moment: Moment::zero() }
    }
    /// Makes a wrench from force and moment.
    #[inline(always)]
    pub fn new(force: Force<F, T>, moment: Moment<F, T>) -> Self {
        Self { force, moment }
    }
    /// Makes a wrench from `[Fx, Fy, Fz, Mx, My, Mz]`. The caller vouches for the frame and the sign.
    #[inline(always)]
    pub fn from_array(w: [T; 6]) -> Self {
        let [fx, fy, fz, mx, my, mz] = w;
        Self::new(Force::new(fx, fy, fz), Moment::new(mx, my, mz))
    }
    /// Returns `[Fx, Fy, Fz, Mx, My, Mz]`.
    #[inline(always)]
    pub fn array(&self) -> [T; 6] {
        let [fx, fy, fz] = self.force.array();
        let [mx, my, mz] = self.moment.array();
        [fx, fy, fz, mx, my, mz]
    }
    /// Returns whether every component is finite.
    pub fn is_finite(&self) -> bool {
        self.force.is_finite() && self.moment.is_finite()
    }
}

impl<F: Frame, T: Scalar> Neg for Wrench<F, T> {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.force, -self.moment)
    }
}

/// Rotation `R_(To,From)`: takes vectors written in `From` to `To`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotation<To: Frame, From: Frame, T: Scalar> {
    matrix: Matrix3<T>,
    frames: PhantomData<(To, From)>,
}

impl<To: Frame, From: Frame, T: Scalar> Rotation<To, From, T> {
    /// Returns the rotation of two frames with the same axes.
    #[inline(always)]
    pub const fn identity() -> Self {
        let (o, l) = (T::ZERO, T::ONE);
        Self { matrix: Matrix3::new(l, o, o, o, l, o, o, o, l), frames: PhantomData }
    }

    /// Returns no rotation: all bits are zero, for room that is set up later.
    pub(crate) const fn unset() -> Self {
        let o = T::ZERO;
        Self { matrix: Matrix3::new(o, o, o, o, o, o, o, o, o), frames: PhantomData }
    }

    /// Makes a rotation from a Hamilton quaternion `[w, x, y, z]`, normalised here. `None` if its norm is not
    /// finite or zero.
    pub fn from_quaternion(wxyz: [T; 4]) -> Option<Self> {
        let [w, x, y, z] = wxyz;
        let n2 = w * w + x * x + y * y + z * z;
        if !n2.is_finite() || n2 <= T::TINY_SQUARE {
            return None;
        }
        let s = (T::ONE + T::ONE) / n2;
        let matrix = Matrix3::new(
            T::ONE - s * (y * y + z * z),
            s * (x * y - w * z),
            s * (x * z + w * y),
            s * (x * y + w * z),
            T::ONE - s * (x * x + z * z),
            s * (y * z - w * x),
            s * (x * z - w * y),
            s * (y * z + w * x),
            T::ONE - s * (x * x + y * y),
        );
        Some(Self { matrix, frames: PhantomData })
    }

    /// Returns the inverse rotation.
    #[inline(always)]
    pub fn inverse(&self) -> Rotation<From, To, T> {
        Rotation { matrix: self.matrix.transpose(), frames: PhantomData }
    }

    /// Returns the matrix whose columns are the axes of `From` written in `To`.
    #[inline(always)]
    pub fn matrix(&self) -> Matrix3<T> {
        self.matrix
    }
}

/// Returns the cross-product matrix `[v]×`.
#[inline(always)]
pub fn cross_matrix<T: Scalar>(v: [T; 3]) -> Matrix3<T> {
    let [x, y, z] = v;
    let o = T::ZERO;
    Matrix3::new(o, -z, y, z, o, -x, -y, x, o)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quaternion_turns_the_accelerometer_of_the_published_end_effector() {
        // R_SU = [[0,−1,0],[0,0,1],[−1,0,0]] is quaternion (0.5, −0.5, 0.5, 0.5).
        let r = Rotation::<Sensor, Imu, f64>::from_quaternion([0.5, -0.5, 0.5, 0.5]).unwrap();
        let turned = r * SpecificForce::<Imu, f64>::new(1.0, 2.0, 3.0);
        assert_eq!(turned.array(), [-2.0, 3.0, -1.0]);
        assert_eq!((r.inverse() * turned).array(), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn a_zero_or_infinite_quaternion_is_refused() {
        assert!(Rotation::<Sensor, Imu, f32>::from_quaternion([0.0; 4]).is_none());
        assert!(Rotation::<Sensor, Imu, f32>::from_quaternion([f32::NAN, 0.0, 0.0, 1.0]).is_none());
    }
}
