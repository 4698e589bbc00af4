//! Sums over slices, in one copy of each whatever the number of parameters. On the reference core they are
//! written in its assembly: the same operations in the same order, so the same bits.

use crate::Scalar;

/// Returns `a·b`, of as many numbers as both have.
#[inline(always)]
pub(crate) fn dot_slices<T: Scalar>(a: &[T], b: &[T]) -> T {
    T::dot(a, b)
}

/// Adds `by` times other numbers, as far as both go.
#[inline(always)]
pub(crate) fn add_scaled<T: Scalar>(to: &mut [T], from: &[T], by: T) {
    T::add_scaled(to, from, by);
}

/// Multiplies all numbers.
#[inline(always)]
pub(crate) fn scale<T: Scalar>(all: &mut [T], by: T) {
    T::scale(all, by);
}

/// Copies numbers, as far as both go.
#[inline(always)]
pub(crate) fn copy<T: Scalar>(to: &mut [T], from: &[T]) {
    let length = to.len().min(from.len());
    if let (Some(to), Some(from)) = (to.get_mut(..length), from.get(..length)) {
        to.copy_from_slice(from);
    }
}

/// The sums for every scalar and core.
pub(crate) mod portable {
    use crate::Scalar;

    #[inline(never)]
    pub(crate) fn dot<T: Scalar>(a: &[T], b: &[T]) -> T {
        let mut sum = T::ZERO;
        for (a, b) in a.iter().zip(b) {
            sum += *a * *b;
        }
        sum
    }

    #[inline(never)]
    pub(crate) fn add_scaled<T: Scalar>(to: &mut [T], from: &[T], by: T) {
        for (to, from) in to.iter_mut().zip(from) {
            *to += *from * by;
        }
    }

    #[inline(never)]
    pub(crate) fn scale<T: Scalar>(all: &mut [T], by: T) {
        for entry in all {
            *entry *= by;
        }
    }

    /// Returns `a·a`, `b·b` and `a·b`.
    #[inline]
    pub(crate) fn squares<T: Scalar>(a: &[T], b: &[T]) -> (T, T, T) {
        let (mut aa, mut bb, mut ab) = (T::ZERO, T::ZERO, T::ZERO);
        for (x, y) in a.iter().zip(b) {
            aa += *x * *x;
            bb += *y * *y;
            ab += *x * *y;
        }
        (aa, bb, ab)
    }

    /// Rotates two columns by the angle of this cosine and sine.
    #[inline]
    pub(crate) fn rotate<T: Scalar>(p: &mut [T], q: &mut [T], cosine: T, sine: T) {
        for (p, q) in p.iter_mut().zip(q) {
            let (x, y) = (*p, *q);
            *p = cosine * x - sine * y;
            *q = sine * x + cosine * y;
        }
    }
}

/// The sums of `f32` on the reference core.
#[cfg(all(target_arch = "arm", target_os = "none"))]
pub(crate) mod on_core {
    core::arch::global_asm!(include_str!("vector_armv7em.s"), options(raw));

    /// Three floats, which the hard-float ABI returns in s0, s1 and s2.
    #[repr(C)]
    struct Squares(f32, f32, f32);

    unsafe extern "C" {
        fn rigident_dot(a: *const f32, a_length: usize, b: *const f32, b_length: usize) -> f32;
        fn rigident_add_scaled(to: *mut f32, length: usize, from: *const f32, from_length: usize, by: f32);
        fn rigident_scale(all: *mut f32, length: usize, by: f32);
        fn rigident_squares(a: *const f32, b: *const f32, length: usize) -> Squares;
        fn rigident_rotate(p: *mut f32, q: *mut f32, length: usize, cosine: f32, sine: f32);
    }

    #[inline(always)]
    pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
        // SAFETY: the kernel reads as many numbers as the shorter slice has, from both.
        unsafe { rigident_dot(a.as_ptr(), a.len(), b.as_ptr(), b.len()) }
    }

    #[inline(always)]
    pub(crate) fn add_scaled(to: &mut [f32], from: &[f32], by: f32) {
        // SAFETY: the kernel reads and writes as many numbers as the shorter slice has; the slices do not
        // overlap.
        unsafe { rigident_add_scaled(to.as_mut_ptr(), to.len(), from.as_ptr(), from.len(), by) }
    }

    #[inline(always)]
    pub(crate) fn scale(all: &mut [f32], by: f32) {
        // SAFETY: the kernel reads and writes the numbers of the slice.
        unsafe { rigident_scale(all.as_mut_ptr(), all.len(), by) }
    }

    #[inline(always)]
    pub(crate) fn squares(a: &[f32], b: &[f32]) -> (f32, f32, f32) {
        // SAFETY: the kernel reads as many numbers as the shorter slice has, from both.
        let Squares(aa, bb, ab) = unsafe { rigident_squares(a.as_ptr(), b.as_ptr(), a.len().min(b.len())) };
        (aa, bb, ab)
    }

    #[inline(always)]
    pub(crate) fn rotate(p: &mut [f32], q: &mut [f32], cosine: f32, sine: f32) {
        let length = p.len().min(q.len());
        // SAFETY: the kernel reads and writes as many numbers of both slices, which do not overlap.
        unsafe { rigident_rotate(p.as_mut_ptr(), q.as_mut_ptr(), length, cosine, sine) }
    }
}
