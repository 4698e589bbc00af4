//! The baseline: a dense Householder in C, on the very rows that [`crate::kernels::dense`] absorbs.

use core::hint::black_box;

use rigident_shared::factor::InformationFactor;

use crate::kernels::{self, Rows};
use crate::measure::{Bench, give_up};

/// RAM of the board outside of what the firmware is allowed, behind what `kernels` uses of it.
const PLACE: usize = 0x2180_0000;

/// `[R z]`, N rows of N + 1; then six rows of N columns and a right-hand side.
type Householder<const N: usize> = unsafe extern "C" fn(*mut f32, *mut Rows<N>);

unsafe extern "C" {
    fn householder_10(triangle: *mut f32, rows: *mut Rows<10>);
    fn householder_16(triangle: *mut f32, rows: *mut Rows<16>);
    fn householder_19(triangle: *mut f32, rows: *mut Rows<19>);
    fn householder_36(triangle: *mut f32, rows: *mut Rows<36>);
    fn householder_128(triangle: *mut f32, rows: *mut Rows<128>);
}

/// Measures every size.
pub fn all(bench: &mut Bench) {
    one::<10, 70>(bench, householder_10);
    one::<16, 68>(bench, householder_16);
    one::<19, 69>(bench, householder_19);
    one::<36, 40>(bench, householder_36);
    one::<128, 31>(bench, householder_128);
}

/// Counts the C function, then lets ours absorb the same rows: both triangles must be equal to rounding.
#[inline(never)]
fn one<const N: usize, const BLOCKS: usize>(bench: &mut Bench, householder: Householder<N>) {
    let triangle = PLACE as *mut f32;
    // SAFETY: RAM that nothing else refers to, and a triangle of no rows is zeros.
    let triangle = unsafe {
        triangle.write_bytes(0, N * (N + 1));
        core::slice::from_raw_parts_mut(triangle, N * (N + 1))
    };
    kernels::with_rows::<N, BLOCKS>(|_, rows| {
        let mut blocks = rows.iter_mut();
        let mut absorb = || {
            if let Some(rows) = blocks.next() {
                // SAFETY: it reads and writes the whole of both and nothing else; `Rows` is N + 1 columns of
                // six.
                unsafe { householder(black_box(triangle.as_mut_ptr()), black_box(rows)) };
            }
        };
        let first = kernels::until_full_rank(N);
        (0..first).for_each(|_| absorb());
        bench.case("C Householder", N, (BLOCKS - first) as u32, 0, absorb);
    });
    kernels::with_rows::<N, BLOCKS>(|factor, rows| {
        let (pairs, rest) = rows.as_chunks::<2>();
        for pair in pairs {
            factor.absorb_block(&mut kernels::block_of(pair));
        }
        for Rows { columns, rhs } in rest {
            factor.absorb(columns, rhs);
        }
        if !equal_to_rounding(triangle, factor, BLOCKS) {
            give_up("the C Householder and the factor differ by more than rounding");
        }
    });
}

/// Returns true if rows of R are equal up to their sign, which C does not keep: each entry within the
/// rounding of `blocks` reflections of a column, ε for each of their rows, times the largest condition number
/// of such random rows, about 10.
fn equal_to_rounding<const N: usize>(c: &[f32], factor: &InformationFactor<f32, N>, blocks: usize) -> bool {
    // Nothing is copied: at N = 128 a triangle is half of the RAM.
    let triangle = (0..N).flat_map(|i| (i..N).map(move |j| (i, j)));
    let places = triangle.chain((0..N).map(|i| (i, N)));
    let largest = factor.entries().take(N * (N + 1) / 2).fold(0.0_f32, |m, v| m.max(v.abs()));
    let tolerance = 10.0 * f32::EPSILON * blocks as f32 * largest;
    factor.entries().zip(places).all(|(ours, (i, j))| {
        let sign = if c[i * (N + 1) + i] < 0.0 { -1.0 } else { 1.0 };
        (ours - sign * c[i * (N + 1) + j]).abs() <= tolerance
    })
}
