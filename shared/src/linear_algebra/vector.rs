//! Sums over slices, in one copy of each whatever the number of parameters.

use crate::Scalar;

/// `a·b`, of as many numbers as both have.
#[inline(never)]
pub(crate) fn dot_slices<T: Scalar>(a: &[T], b: &[T]) -> T {
    let mut sum = T::ZERO;
    for (a, b) in a.iter().zip(b) {
        sum += *a * *b;
    }
    sum
}

/// Adds `by` times other numbers, as far as both go.
#[inline(never)]
pub(crate) fn add_scaled<T: Scalar>(to: &mut [T], from: &[T], by: T) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += *from * by;
    }
}

/// Multiplies all numbers.
#[inline(never)]
pub(crate) fn scale<T: Scalar>(all: &mut [T], by: T) {
    for entry in all {
        *entry *= by;
    }
}
