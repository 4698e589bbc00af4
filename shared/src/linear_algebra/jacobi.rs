use crate::Scalar;

/// Sweeps at most: six to eight are usual at N = 16; the bound is for bad luck.
const SWEEPS: u8 = 30;

/// One-sided Jacobi: `A V = W` with orthogonal columns W; their squared lengths are the squared singular
/// values (Hestenes 1958; accurate to relative precision on column-scaled matrices, Demmel and Veselić 1992).
///
/// There is room for `M` columns; the first `n` of them, with `n` numbers each, are used. The rotations can
/// be done some pairs of columns at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jacobi<T: Scalar, const M: usize> {
    /// Columns of W.
    pub(crate) w: [[T; M]; M],
    /// Columns of V.
    pub(crate) v: [[T; M]; M],
    /// Squared lengths of the columns of W.
    pub(crate) squares: [T; M],
    n: usize,
    /// The pair of columns that is next.
    pair: (usize, usize),
    /// A pair of this sweep was rotated.
    rotated: bool,
    sweeps: u8,
}

pub(crate) fn dot<T: Scalar, const N: usize>(a: &[T; N], b: &[T; N]) -> T {
    let mut sum = T::ZERO;
    for (x, y) in a.iter().zip(b) {
        sum += *x * *y;
    }
    sum
}

impl<T: Scalar, const M: usize> Jacobi<T, M> {
    /// Decomposes nothing. All bits are zero.
    pub(crate) const EMPTY: Self = Self {
        w: [[T::ZERO; M]; M],
        v: [[T::ZERO; M]; M],
        squares: [T::ZERO; M],
        n: 0,
        pair: (0, 0),
        rotated: false,
        sweeps: 0,
    };

    /// Begins with the matrix A whose columns are the first `n` of W. A column of zeros stays one, with a
    /// unit vector of its own in V.
    pub(crate) fn begin(&mut self, n: usize) {
        self.n = n.min(M);
        for (j, column) in self.v.iter_mut().enumerate().take(self.n) {
            for (i, entry) in column.iter_mut().enumerate().take(self.n) {
                *entry = if i == j { T::ONE } else { T::ZERO };
            }
        }
        (self.pair, self.rotated, self.sweeps) = ((0, 1), false, 0);
    }

    /// Rotates the given number of pairs of columns. Returns true when no pair needs it any more.
    #[inline(never)]
    pub(crate) fn rotate_pairs(&mut self, count: usize) -> bool {
        for _ in 0..count {
            let (p, q) = self.pair;
            if q >= self.n {
                self.sweeps += 1;
                if !core::mem::take(&mut self.rotated) || self.sweeps >= SWEEPS {
                    return true;
                }
                self.pair = (0, 1);
                continue;
            }
            self.rotated |= self.rotate_pair(p, q);
            self.pair = if q + 1 < self.n { (p, q + 1) } else { (p + 1, p + 2) };
        }
        false
    }

    /// Takes the squared lengths when all rotations are done.
    pub(crate) fn measure(&mut self) {
        for (square, w) in self.squares.iter_mut().zip(&self.w).take(self.n) {
            let w = w.get(..self.n).unwrap_or_default();
            *square = T::dot(w, w);
        }
    }

    /// Makes two columns orthogonal. Returns true if they were not.
    fn rotate_pair(&mut self, p: usize, q: usize) -> bool {
        let Some((wp, wq)) = pair(&mut self.w, p, q, self.n) else { return false };
        let (a, b, c) = T::squares(wp, wq);
        // The product of the roots, as that of the squares might overflow.
        if c.abs() <= T::EPSILON * (a.sqrt() * b.sqrt()) || c * c <= T::TINY_SQUARE {
            return false;
        }
        let zeta = (b - a) / (T::from_u32(2) * c);
        let sign = if zeta < T::ZERO { -T::ONE } else { T::ONE };
        // Beyond this ζ² would overflow or drown the 1; the root is then |ζ|.
        let large = T::ONE / (T::EPSILON * T::EPSILON);
        let root = if zeta.abs() < large { (T::ONE + zeta * zeta).sqrt() } else { zeta.abs() };
        let tangent = sign / (zeta.abs() + root);
        let cosine = T::ONE / (T::ONE + tangent * tangent).sqrt();
        let sine = cosine * tangent;
        T::rotate(wp, wq, cosine, sine);
        if let Some((vp, vq)) = pair(&mut self.v, p, q, self.n) {
            T::rotate(vp, vq, cosine, sine);
        }
        true
    }
}

/// Returns the first `n` numbers of two columns.
#[inline]
fn pair<T, const M: usize>(
    columns: &mut [[T; M]; M],
    p: usize,
    q: usize,
    n: usize,
) -> Option<(&mut [T], &mut [T])> {
    let [p, q] = columns.get_disjoint_mut([p, q]).ok()?;
    Some((p.get_mut(..n)?, q.get_mut(..n)?))
}
