use core::fmt::Debug;
use core::iter::Sum;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Range, Sub, SubAssign};

use crate::factor::{self, Column};
use crate::linear_algebra::vector;
use nalgebra::{ClosedAddAssign, ClosedDivAssign, ClosedMulAssign, ClosedSubAssign};

mod sealed {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// The two scalars of the pipeline: `f32` on target, `f64` on the host.
///
/// Only operations whose result is fixed by IEEE 754 are offered (+ − × ÷ and the correctly rounded square
/// root), so that the same source gives the same bits on x86-64 and on a Cortex-M4F.
pub trait Scalar:
    sealed::Sealed
    + nalgebra::Scalar
    + Copy
    + Debug
    + PartialOrd
    + Default
    + nalgebra::Field
    + ClosedAddAssign
    + ClosedSubAssign
    + ClosedMulAssign
    + ClosedDivAssign
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
    + Sum
    + Send
    + Sync
    + 'static
{
    /// Additive identity.
    const ZERO: Self;
    /// Multiplicative identity.
    const ONE: Self;
    /// Distance from 1 to the next larger number.
    const EPSILON: Self;
    /// Squares below this are taken as zero: well above the smallest normal number, so that quotients of
    /// such squares neither overflow nor become NaN.
    const TINY_SQUARE: Self;

    /// Returns the correctly rounded square root of a non-negative number.
    fn sqrt(self) -> Self;
    /// Returns the nearest value of this type.
    fn from_f64_const(value: f64) -> Self;
    /// Returns the nearest value of this type.
    fn from_f32(value: f32) -> Self;
    /// Returns the nearest value of this type.
    fn from_u32(value: u32) -> Self;
    /// Returns the nearest value of this type.
    fn from_i32(value: i32) -> Self;
    /// Returns true if the number is neither infinite nor NaN.
    fn is_finite(self) -> bool;
    /// Returns the absolute value.
    fn abs(self) -> Self;
    /// Returns 32 bits that are others whenever the number is another single.
    #[doc(hidden)]
    fn trace_bits(self) -> u32;
    /// Reduces six rows into a triangle; see [`crate::factor`]. The target has kernels of its own for this
    /// and the following.
    #[doc(hidden)]
    fn reduce(triangle: &mut [Self], stride: usize, columns: &mut [Column<Self>]) -> Self {
        let all = columns.len();
        Self::reduce_part(triangle, stride, columns, 0..all)
    }
    /// Reduces the columns of this range; see [`crate::factor`].
    #[doc(hidden)]
    fn reduce_part(
        triangle: &mut [Self],
        stride: usize,
        columns: &mut [Column<Self>],
        range: Range<usize>,
    ) -> Self {
        factor::reduce(triangle, stride, columns, range)
    }
    /// Reduces rows into a packed triangle; see [`crate::factor::PackedFactor`].
    #[doc(hidden)]
    fn reduce_packed(triangle: &mut [Self], columns: &mut [Column<Self>]) -> Self {
        factor::reduce_packed(triangle, columns)
    }
    /// Returns `a·b`, of as many numbers as both have.
    #[doc(hidden)]
    #[inline(always)]
    fn dot(a: &[Self], b: &[Self]) -> Self {
        vector::portable::dot(a, b)
    }
    /// Adds `by` times other numbers, as far as both go.
    #[doc(hidden)]
    #[inline(always)]
    fn add_scaled(to: &mut [Self], from: &[Self], by: Self) {
        vector::portable::add_scaled(to, from, by);
    }
    /// Multiplies all numbers.
    #[doc(hidden)]
    #[inline(always)]
    fn scale(all: &mut [Self], by: Self) {
        vector::portable::scale(all, by);
    }
    /// Returns `a·a`, `b·b` and `a·b`.
    #[doc(hidden)]
    #[inline(always)]
    fn squares(a: &[Self], b: &[Self]) -> (Self, Self, Self) {
        vector::portable::squares(a, b)
    }
    /// Rotates two columns by the angle of this cosine and sine.
    #[doc(hidden)]
    #[inline(always)]
    fn rotate(p: &mut [Self], q: &mut [Self], cosine: Self, sine: Self) {
        vector::portable::rotate(p, q, cosine, sine);
    }
    /// Returns the larger of two; `self` if either is NaN.
    fn max(self, other: Self) -> Self {
        if other > self { other } else { self }
    }
}

macro_rules! scalar {
    ($t:ty, $tiny:expr, $sqrt:path, { $($kernels:tt)* }) => {
        impl Scalar for $t {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const EPSILON: Self = <$t>::EPSILON;
            const TINY_SQUARE: Self = $tiny;

            #[inline(always)]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }
            $($kernels)*
            #[inline(always)]
            fn from_f64_const(value: f64) -> Self {
                value as $t
            }
            #[inline(always)]
            fn from_f32(value: f32) -> Self {
                value as $t
            }
            #[inline(always)]
            fn from_u32(value: u32) -> Self {
                value as $t
            }
            #[inline(always)]
            fn from_i32(value: i32) -> Self {
                value as $t
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                <$t>::is_finite(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$t>::abs(self)
            }
            #[inline(always)]
            fn trace_bits(self) -> u32 {
                (self as f32).to_bits()
            }
        }
    };
}
#[cfg(all(target_arch = "arm", target_os = "none"))]
scalar!(f32, 1e-18, square_root::single, {
    #[inline(always)]
    fn reduce_part(
        triangle: &mut [Self],
        stride: usize,
        columns: &mut [Column<Self>],
        range: Range<usize>,
    ) -> Self {
        factor::reduce_on_core(triangle, stride, columns, range)
    }
    #[inline(always)]
    fn reduce_packed(triangle: &mut [Self], columns: &mut [Column<Self>]) -> Self {
        factor::reduce_packed_on_core(triangle, columns)
    }
    #[inline(always)]
    fn dot(a: &[Self], b: &[Self]) -> Self {
        vector::on_core::dot(a, b)
    }
    #[inline(always)]
    fn add_scaled(to: &mut [Self], from: &[Self], by: Self) {
        vector::on_core::add_scaled(to, from, by);
    }
    #[inline(always)]
    fn scale(all: &mut [Self], by: Self) {
        vector::on_core::scale(all, by);
    }
    #[inline(always)]
    fn squares(a: &[Self], b: &[Self]) -> (Self, Self, Self) {
        vector::on_core::squares(a, b)
    }
    #[inline(always)]
    fn rotate(p: &mut [Self], q: &mut [Self], cosine: Self, sine: Self) {
        vector::on_core::rotate(p, q, cosine, sine);
    }
});
#[cfg(not(all(target_arch = "arm", target_os = "none")))]
scalar!(f32, 1e-18, square_root::single, {});
scalar!(f64, 1e-150, square_root::double, {});

/// `core` has no stable square root. Hosts have one in `std`; the Cortex-M4F has one instruction for `f32`,
/// which no stable intrinsic reaches, so a two-instruction function is given in assembly. `libm::sqrtf`
/// gives the same bits in eleven times the instructions.
mod square_root {
    #[cfg(all(target_arch = "arm", target_os = "none"))]
    core::arch::global_asm!(
        ".syntax unified",
        ".fpu fpv4-sp-d16",
        ".section .text.rigident_vsqrt_f32,\"ax\",%progbits",
        ".global rigident_vsqrt_f32",
        ".type rigident_vsqrt_f32,%function",
        ".thumb_func",
        "rigident_vsqrt_f32:",
        "vsqrt.f32 s0, s0",
        "bx lr",
        ".size rigident_vsqrt_f32, . - rigident_vsqrt_f32",
    );

    #[cfg(all(target_arch = "arm", target_os = "none"))]
    #[inline(always)]
    pub fn single(x: f32) -> f32 {
        unsafe extern "C" {
            fn rigident_vsqrt_f32(x: f32) -> f32;
        }
        // SAFETY: the function above takes and returns one float in s0 (hard-float ABI of the target) and
        // touches nothing else.
        unsafe { rigident_vsqrt_f32(x) }
    }

    /// Takes the root in single precision: there is no `f64` arithmetic on target, and reaching this is a
    /// link-time mistake that the release check finds.
    #[cfg(all(target_arch = "arm", target_os = "none"))]
    #[inline(always)]
    pub fn double(x: f64) -> f64 {
        f64::from(single(x as f32))
    }

    #[cfg(not(target_os = "none"))]
    extern crate std;

    #[cfg(not(target_os = "none"))]
    #[inline(always)]
    pub fn single(x: f32) -> f32 {
        std::primitive::f32::sqrt(x)
    }

    #[cfg(not(target_os = "none"))]
    #[inline(always)]
    pub fn double(x: f64) -> f64 {
        std::primitive::f64::sqrt(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn square_root_is_the_correctly_rounded_one() {
        // The nearest f32 to √x is the f64 root rounded once: 53 bits are more than twice 24 + 2.
        for i in 0..100_000_u32 {
            let x = f32::from_bits(0x0080_0000 + i * 21_001);
            assert_eq!(Scalar::sqrt(x).to_bits(), (f64::from(x).sqrt() as f32).to_bits());
        }
    }
}
