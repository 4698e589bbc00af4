use super::symmetric::{Sym4, cholesky, eigen, invert_lower};
use super::{FLOOR, back_substitute, cone, from_cone, norm, share, times};
use crate::Scalar;
use crate::factor::InformationFactor;

/// Scaled coordinates: G, `V = G⁻¹` and the diagonal s, so that `K = G diag(s) Gᵀ`.
struct Scaling<T: Scalar> {
    g: Sym4<T>,
    v: Sym4<T>,
    s: [T; 4],
}

impl<T: Scalar> Scaling<T> {
    /// Nesterov–Todd scaling of the pair `(X, S)` given in the coordinates `G, V`: these times
    /// `L U diag(1/√s)`, where `X = L Lᵀ` and `Lᵀ S L = U diag(s²) Uᵀ`.
    fn of(x: &Sym4<T>, s: &Sym4<T>, g: &Sym4<T>, v: &Sym4<T>) -> Option<Self> {
        let l = cholesky(x)?;
        let product: Sym4<T> = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                let mut sum = T::ZERO;
                for a in i..4 {
                    for b in j..4 {
                        sum += l[a][i] * s[a][b] * l[b][j];
                    }
                }
                sum
            })
        });
        let (squares, axes) = eigen(&product);
        let inverse = invert_lower(&l);
        let mut scaling = Self { g: [[T::ZERO; 4]; 4], v: [[T::ZERO; 4]; 4], s: [T::ZERO; 4] };
        for i in 0..4 {
            if squares[i] <= T::ZERO || !squares[i].is_finite() {
                return None;
            }
            scaling.s[i] = squares[i].sqrt();
            let root = scaling.s[i].sqrt();
            let mut column = [T::ZERO; 4];
            for (entry, line) in column.iter_mut().zip(&l) {
                *entry = line.iter().zip(&axes[i]).map(|(a, b)| *a * *b).sum::<T>() / root;
            }
            for (entry, line) in scaling.g.iter_mut().zip(g) {
                entry[i] = line.iter().zip(&column).map(|(a, b)| *a * *b).sum();
            }
            let mut row = [T::ZERO; 4];
            for (weight, line) in axes[i].iter().zip(&inverse) {
                for (entry, w) in row.iter_mut().zip(line) {
                    *entry += root * *weight * *w;
                }
            }
            for (weight, line) in row.iter().zip(v) {
                for (entry, w) in scaling.v[i].iter_mut().zip(line) {
                    *entry += *weight * *w;
                }
            }
        }
        Some(scaling)
    }

    /// φ of `K = G diag(s) Gᵀ`: a sum of squares, so that no rounding takes it out of the cone.
    fn parameters(&self) -> [T; 10] {
        let mut k: Sym4<T> = core::array::from_fn(|i| {
            core::array::from_fn(|j| (0..4).map(|e| self.g[i][e] * self.s[e] * self.g[j][e]).sum())
        });
        // tr(K) over the first three is (1 − 3ε) tr(Σ).
        let floor = T::from_f64_const(FLOOR / (1.0 - 3.0 * FLOOR)) * (k[0][0] + k[1][1] + k[2][2]);
        for (i, row) in k.iter_mut().enumerate().take(3) {
            row[i] += floor;
        }
        from_cone(&k)
    }

    /// Columns of the ten rows `V K(d) Vᵀ`, packed; column k belongs to parameter k.
    fn columns(&self) -> [[T; 10]; 10] {
        let h = share::<T>();
        let v = &self.v;
        let square = |k: usize| pack(|i, j| v[i][k] * v[j][k]);
        let pair = |k: usize, l: usize| pack(|i, j| v[i][k] * v[j][l] + v[i][l] * v[j][k]);
        let negative = |column: [T; 10]| column.map(|x| -x);
        let (xx, yy, zz) = (square(0), square(1), square(2));
        let all: [T; 10] = core::array::from_fn(|i| h * (xx[i] + yy[i] + zz[i]));
        let moment = |own: &[T; 10]| core::array::from_fn(|i| all[i] - own[i]);
        [
            square(3),
            pair(0, 3),
            pair(1, 3),
            pair(2, 3),
            moment(&xx),
            moment(&yy),
            moment(&zz),
            negative(pair(1, 2)),
            negative(pair(2, 0)),
            negative(pair(0, 1)),
        ]
    }
}

/// The ten entries of a symmetric matrix (i ≥ j), off-diagonal ones times √2, so that the norm is Frobenius'.
fn pack<T: Scalar>(entry: impl Fn(usize, usize) -> T) -> [T; 10] {
    let root2 = T::from_u32(2).sqrt();
    let mut packed = [T::ZERO; 10];
    let mut slots = packed.iter_mut();
    for i in 0..4 {
        for j in 0..=i {
            if let Some(slot) = slots.next() {
                *slot = if i == j { entry(i, j) } else { root2 * entry(i, j) };
            }
        }
    }
    packed
}

fn unpack<T: Scalar>(packed: &[T; 10]) -> Sym4<T> {
    let root2 = T::from_u32(2).sqrt();
    let mut full = [[T::ZERO; 4]; 4];
    let mut slots = packed.iter();
    for i in 0..4 {
        for j in 0..=i {
            if let Some(value) = slots.next() {
                let value = if i == j { *value } else { *value / root2 };
                full[i][j] = value;
                full[j][i] = value;
            }
        }
    }
    full
}

/// φ inside the cone, Newton steps taken, whether it is the optimum.
pub(super) fn interior_point<T: Scalar>(
    body: &InformationFactor<T, 10>,
    free: &[T; 10],
    start: &[T; 10],
    max_iterations: u8,
) -> ([T; 10], u8, bool) {
    let mut phi = *start;
    let mut misfit = times(&body.r(), &core::array::from_fn(|j| free[j] - phi[j]));
    // Λ = μ K⁻¹ with μ of the size of the squared misfit: in coordinates V = L⁻¹ the pair is (1, μ 1).
    let mu = misfit.iter().map(|v| *v * *v).sum::<T>().max(T::EPSILON) / T::from_u32(4);
    let identity = diagonal(&[T::ONE; 4]);
    let Some(l) = cholesky(&cone(&phi, share())) else { return (phi, 0, false) };
    let Some(mut scaling) = Scaling::of(&identity, &diagonal(&[mu; 4]), &l, &invert_lower(&l)) else {
        return (phi, 0, false);
    };
    // ‖R⁻ᵀ(RᵀR(φ − φ₀) − K*(Λ))‖ shrinks with every step by 1 − α, from at most about this.
    let mut dual_residual = norm(&misfit);
    for iteration in 0..max_iterations {
        let gap = scaling.s.iter().map(|s| *s * *s).sum::<T>();
        let distance = norm(&misfit);
        let tolerance = T::EPSILON.sqrt() * T::from_u32(32).max(T::from_u32(4) * distance);
        // ½‖R(φ − φ*)‖² ≤ gap
        if gap + gap <= tolerance * tolerance && dual_residual <= tolerance {
            return (phi, iteration, true);
        }
        let columns = scaling.columns();
        let newton = Newton::of(&body.r(), &columns);
        // Predictor: straight at the boundary, μ = 0.
        let Some(dx) = newton.step(&columns, &misfit, &[T::ZERO; 10]) else { break };
        let s = diagonal(&scaling.s);
        let ds = combine(&s, &dx, -T::ONE, -T::ONE);
        let reach = step_length(&s, &dx, &ds, T::ONE);
        let mut gap_there = T::ZERO;
        let (x_there, s_there) = (combine(&s, &dx, T::ONE, reach), combine(&s, &ds, T::ONE, reach));
        for (a, b) in x_there.iter().flatten().zip(s_there.iter().flatten()) {
            gap_there += *a * *b;
        }
        let share = gap_there.max(T::ZERO) / gap;
        let mu = share * share * share * gap / T::from_u32(4);
        // Corrector (Mehrotra 1992): s∘(dx + ds) = μ 1 − s² − dx∘ds of the predictor.
        let target: Sym4<T> = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                let mut product = T::ZERO;
                for k in 0..4 {
                    product += dx[i][k] * ds[k][j] + ds[i][k] * dx[k][j];
                }
                let wanted = if i == j { mu + mu } else { T::ZERO };
                (wanted - product) / (scaling.s[i] + scaling.s[j])
            })
        });
        let Some(dx) = newton.step(&columns, &misfit, &pack(|i, j| target[i][j])) else { break };
        let ds = combine(&combine(&target, &s, T::ONE, -T::ONE), &dx, T::ONE, -T::ONE);
        let margin = T::from_f64_const(0.9) + T::from_f64_const(0.09) * reach;
        let alpha = step_length(&s, &dx, &ds, margin);
        let (x, s) = (combine(&s, &dx, T::ONE, alpha), combine(&s, &ds, T::ONE, alpha));
        let Some(next) = Scaling::of(&x, &s, &scaling.g, &scaling.v) else { break };
        scaling = next;
        dual_residual *= T::ONE - alpha;
        phi = scaling.parameters();
        misfit = times(&body.r(), &core::array::from_fn(|j| free[j] - phi[j]));
    }
    (phi, max_iterations, false)
}

fn diagonal<T: Scalar>(d: &[T; 4]) -> Sym4<T> {
    core::array::from_fn(|i| core::array::from_fn(|j| if i == j { d[i] } else { T::ZERO }))
}

/// `α A + β B`
fn combine<T: Scalar>(a: &Sym4<T>, b: &Sym4<T>, alpha: T, beta: T) -> Sym4<T> {
    core::array::from_fn(|i| core::array::from_fn(|j| alpha * a[i][j] + beta * b[i][j]))
}

/// The longest of a few step lengths α ≤ 1 for which `s + (α / margin) d` is positive definite for both.
fn step_length<T: Scalar>(s: &Sym4<T>, dx: &Sym4<T>, ds: &Sym4<T>, margin: T) -> T {
    let (mut alpha, mut less) = (T::ONE, T::from_f64_const(0.02));
    for _ in 0..30 {
        let inside = |d: &Sym4<T>| cholesky(&combine(s, d, T::ONE, alpha / margin)).is_some();
        if inside(dx) && inside(ds) {
            return alpha;
        }
        alpha *= T::ONE - less;
        if less < T::from_f64_const(0.2) {
            less += less;
        }
    }
    T::ZERO
}

/// The triangle of `[R; B]` and the reflections that made it, to be applied to several right-hand sides.
struct Newton<T: Scalar> {
    r: [[T; 10]; 10],
    /// Lower parts of the reflections, by columns; their first components and factors.
    x: [[T; 10]; 10],
    first: [T; 10],
    tau: [T; 10],
}

impl<T: Scalar> Newton<T> {
    /// The reflections of [`InformationFactor::absorb`].
    fn of(r: &[[T; 10]; 10], columns: &[[T; 10]; 10]) -> Self {
        let mut newton = Self { r: *r, x: *columns, first: [T::ZERO; 10], tau: [T::ZERO; 10] };
        for j in 0..10 {
            let x = newton.x[j];
            let xx = x.iter().map(|v| *v * *v).sum::<T>();
            if xx <= T::TINY_SQUARE {
                continue;
            }
            let old = newton.r[j][j];
            let norm = (old * old + xx).sqrt();
            newton.first[j] = -(xx / (old + norm));
            newton.tau[j] = (old + norm) / (norm * xx);
            newton.r[j][j] = norm;
            for k in j + 1..10 {
                let (first, tau) = (newton.first[j], newton.tau[j]);
                reflect(&mut newton.r[j][k], &mut newton.x[k], first, tau, &x);
            }
        }
        newton
    }

    /// `B d` unpacked, for `d = argmin ‖R d − z‖² + ‖B d − y‖²`; B is `columns`.
    fn step(&self, columns: &[[T; 10]; 10], z: &[T; 10], y: &[T; 10]) -> Option<Sym4<T>> {
        let (mut z, mut y) = (*z, *y);
        for j in 0..10 {
            reflect(&mut z[j], &mut y, self.first[j], self.tau[j], &self.x[j]);
        }
        let step = back_substitute(&self.r, &z)?;
        let mut packed = [T::ZERO; 10];
        for (column, d) in columns.iter().zip(&step) {
            for (sum, c) in packed.iter_mut().zip(column) {
                *sum += *c * *d;
            }
        }
        Some(unpack(&packed))
    }
}

fn reflect<T: Scalar>(entry: &mut T, column: &mut [T; 10], first: T, tau: T, x: &[T; 10]) {
    let mut dot = first * *entry;
    for (a, b) in x.iter().zip(column.iter()) {
        dot += *a * *b;
    }
    let scaled = tau * dot;
    *entry -= scaled * first;
    for (a, b) in x.iter().zip(column) {
        *b -= scaled * *a;
    }
}
