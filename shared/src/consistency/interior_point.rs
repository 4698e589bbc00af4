use super::symmetric::{Sym4, cholesky, eigen, invert_lower};
use super::{FLOOR, back_substitute, cone, from_cone, norm, share, times};
use crate::Scalar;
#[cfg(doc)]
use crate::factor::InformationFactor;

/// Scaled coordinates: G, `V = G⁻¹` and the diagonal s, so that `K = G diag(s) Gᵀ`.
#[derive(Clone, Copy, Debug)]
struct Scaling<T: Scalar> {
    g: Sym4<T>,
    v: Sym4<T>,
    s: [T; 4],
}

impl<T: Scalar> Scaling<T> {
    /// Returns the Nesterov–Todd scaling of the pair `(X, S)` given in the coordinates `G, V`: these times
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

    /// Returns φ of `K = G diag(s) Gᵀ`: a sum of squares, so that no rounding takes it out of the cone.
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

    /// Returns the columns of the ten rows `V K(d) Vᵀ`, packed; column k belongs to parameter k.
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

/// Returns the ten entries of a symmetric matrix (i ≥ j), off-diagonal ones times √2, so that the norm is
/// Frobenius'.
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

/// Step lengths tried at most, and the number at once.
const TRIES: u8 = 30;
const TRIES_AT_ONCE: u8 = 6;

/// Tells what a search does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The search is at its end, or not begun. All bits are zero.
    End,
    /// Makes the first scaling.
    Begin,
    /// Checks whether it is at the optimum; else Newton's matrix.
    Measure,
    /// The predictor's direction.
    Predict,
    /// Tells how far that goes.
    PredictorLength,
    /// The corrector's direction.
    Correct,
    /// Tells how far that goes.
    CorrectorLength,
    /// Goes there.
    Move,
}

/// The search for φ inside the cone, in steps of bounded size.
#[derive(Clone, Copy, Debug)]
pub(super) struct InteriorPoint<T: Scalar> {
    phase: Phase,
    /// R by rows, zero below the diagonal.
    r: [[T; 10]; 10],
    free: [T; 10],
    phi: [T; 10],
    iteration: u8,
    max_iterations: u8,
    converged: bool,
    misfit: [T; 10],
    dual_residual: T,
    gap: T,
    scaling: Scaling<T>,
    columns: [[T; 10]; 10],
    newton: Newton<T>,
    dx: Sym4<T>,
    ds: Sym4<T>,
    length: StepLength<T>,
    reach: T,
}

impl<T: Scalar> InteriorPoint<T> {
    /// Searches nothing yet.
    pub(super) const UNUSED: Self = Self {
        phase: Phase::End,
        r: [[T::ZERO; 10]; 10],
        free: [T::ZERO; 10],
        phi: [T::ZERO; 10],
        iteration: 0,
        max_iterations: 0,
        converged: false,
        misfit: [T::ZERO; 10],
        dual_residual: T::ZERO,
        gap: T::ZERO,
        scaling: Scaling { g: [[T::ZERO; 4]; 4], v: [[T::ZERO; 4]; 4], s: [T::ZERO; 4] },
        columns: [[T::ZERO; 10]; 10],
        newton: Newton {
            r: [[T::ZERO; 10]; 10],
            x: [[T::ZERO; 10]; 10],
            first: [T::ZERO; 10],
            tau: [T::ZERO; 10],
        },
        dx: [[T::ZERO; 4]; 4],
        ds: [[T::ZERO; 4]; 4],
        length: StepLength { alpha: T::ZERO, less: T::ZERO, margin: T::ZERO, tries: 0 },
        reach: T::ZERO,
    };

    /// Begins at `start`, which is inside the cone, with the metric R and the free answer.
    pub(super) fn begin(&mut self, r: &[[T; 10]; 10], free: &[T; 10], start: &[T; 10], max_iterations: u8) {
        (self.r, self.free, self.phi) = (*r, *free, *start);
        (self.phase, self.iteration, self.max_iterations, self.converged) =
            (Phase::Begin, 0, max_iterations, false);
    }

    /// Returns φ, the Newton steps taken, and whether it is the optimum.
    pub(super) fn found(&self) -> (&[T; 10], u8, bool) {
        (&self.phi, self.iteration, self.converged)
    }

    /// Does one step. Returns true at the end.
    pub(super) fn step(&mut self) -> bool {
        self.phase = match self.phase {
            Phase::Begin => self.first_scaling(),
            Phase::Measure => self.measure(),
            Phase::Predict => self.predict(),
            Phase::PredictorLength => self.predictor_length(),
            Phase::Correct => self.correct(),
            Phase::CorrectorLength => self.corrector_length(),
            Phase::Move => self.go(),
            Phase::End => Phase::End,
        };
        self.phase == Phase::End
    }

    /// Ends before the optimum, as where the iterations are used up.
    fn give_up(&mut self) -> Phase {
        self.iteration = self.max_iterations;
        Phase::End
    }

    fn first_scaling(&mut self) -> Phase {
        self.misfit = times(&self.r, &core::array::from_fn(|j| self.free[j] - self.phi[j]));
        // Λ = μ K⁻¹ with μ of the size of the squared misfit: in coordinates V = L⁻¹ the pair is (1, μ 1).
        let mu = self.misfit.iter().map(|v| *v * *v).sum::<T>().max(T::EPSILON) / T::from_u32(4);
        let identity = diagonal(&[T::ONE; 4]);
        let Some(l) = cholesky(&cone(&self.phi, share())) else { return Phase::End };
        let Some(scaling) = Scaling::of(&identity, &diagonal(&[mu; 4]), &l, &invert_lower(&l)) else {
            return Phase::End;
        };
        self.scaling = scaling;
        // ‖R⁻ᵀ(RᵀR(φ − φ₀) − K*(Λ))‖ shrinks with every step by 1 − α, from at most about this.
        self.dual_residual = norm(&self.misfit);
        Phase::Measure
    }

    fn measure(&mut self) -> Phase {
        if self.iteration >= self.max_iterations {
            return Phase::End;
        }
        self.gap = self.scaling.s.iter().map(|s| *s * *s).sum::<T>();
        let distance = norm(&self.misfit);
        let tolerance = T::EPSILON.sqrt() * T::from_u32(32).max(T::from_u32(4) * distance);
        // ½‖R(φ − φ*)‖² ≤ gap
        if self.gap + self.gap <= tolerance * tolerance && self.dual_residual <= tolerance {
            self.converged = true;
            return Phase::End;
        }
        self.columns = self.scaling.columns();
        self.newton.set(&self.r, &self.columns);
        Phase::Predict
    }

    /// Predicts: straight at the boundary, μ = 0.
    fn predict(&mut self) -> Phase {
        let Some(dx) = self.newton.step(&self.columns, &self.misfit, &[T::ZERO; 10]) else {
            return self.give_up();
        };
        self.ds = combine(&diagonal(&self.scaling.s), &dx, -T::ONE, -T::ONE);
        self.dx = dx;
        self.length = StepLength::new(T::ONE);
        Phase::PredictorLength
    }

    fn predictor_length(&mut self) -> Phase {
        let s = diagonal(&self.scaling.s);
        match self.length.search(&s, &self.dx, &self.ds) {
            Some(reach) => {
                self.reach = reach;
                Phase::Correct
            }
            None => Phase::PredictorLength,
        }
    }

    /// Corrects (Mehrotra 1992): s∘(dx + ds) = μ 1 − s² − dx∘ds of the predictor.
    fn correct(&mut self) -> Phase {
        let s = diagonal(&self.scaling.s);
        let (dx, ds, reach) = (self.dx, self.ds, self.reach);
        let mut gap_there = T::ZERO;
        let (x_there, s_there) = (combine(&s, &dx, T::ONE, reach), combine(&s, &ds, T::ONE, reach));
        for (a, b) in x_there.iter().flatten().zip(s_there.iter().flatten()) {
            gap_there += *a * *b;
        }
        let share = gap_there.max(T::ZERO) / self.gap;
        let mu = share * share * share * self.gap / T::from_u32(4);
        let target: Sym4<T> = core::array::from_fn(|i| {
            core::array::from_fn(|j| {
                let mut product = T::ZERO;
                for k in 0..4 {
                    product += dx[i][k] * ds[k][j] + ds[i][k] * dx[k][j];
                }
                let wanted = if i == j { mu + mu } else { T::ZERO };
                (wanted - product) / (self.scaling.s[i] + self.scaling.s[j])
            })
        });
        let Some(dx) = self.newton.step(&self.columns, &self.misfit, &pack(|i, j| target[i][j])) else {
            return self.give_up();
        };
        self.ds = combine(&combine(&target, &s, T::ONE, -T::ONE), &dx, T::ONE, -T::ONE);
        self.dx = dx;
        self.length = StepLength::new(T::from_f64_const(0.9) + T::from_f64_const(0.09) * reach);
        Phase::CorrectorLength
    }

    fn corrector_length(&mut self) -> Phase {
        let s = diagonal(&self.scaling.s);
        match self.length.search(&s, &self.dx, &self.ds) {
            Some(alpha) => {
                self.reach = alpha;
                Phase::Move
            }
            None => Phase::CorrectorLength,
        }
    }

    fn go(&mut self) -> Phase {
        let (s, alpha) = (diagonal(&self.scaling.s), self.reach);
        let (x, s) = (combine(&s, &self.dx, T::ONE, alpha), combine(&s, &self.ds, T::ONE, alpha));
        let Some(next) = Scaling::of(&x, &s, &self.scaling.g, &self.scaling.v) else { return self.give_up() };
        self.scaling = next;
        self.dual_residual *= T::ONE - alpha;
        self.phi = self.scaling.parameters();
        self.misfit = times(&self.r, &core::array::from_fn(|j| self.free[j] - self.phi[j]));
        self.iteration += 1;
        Phase::Measure
    }
}

fn diagonal<T: Scalar>(d: &[T; 4]) -> Sym4<T> {
    core::array::from_fn(|i| core::array::from_fn(|j| if i == j { d[i] } else { T::ZERO }))
}

/// Returns `α A + β B`.
fn combine<T: Scalar>(a: &Sym4<T>, b: &Sym4<T>, alpha: T, beta: T) -> Sym4<T> {
    core::array::from_fn(|i| core::array::from_fn(|j| alpha * a[i][j] + beta * b[i][j]))
}

/// The longest of a few step lengths α ≤ 1 for which `s + (α / margin) d` is positive definite for both
/// directions.
#[derive(Clone, Copy, Debug)]
struct StepLength<T: Scalar> {
    alpha: T,
    less: T,
    margin: T,
    tries: u8,
}

impl<T: Scalar> StepLength<T> {
    fn new(margin: T) -> Self {
        Self { alpha: T::ONE, less: T::from_f64_const(0.02), margin, tries: 0 }
    }

    /// Tries a few lengths; the length once it is found, zero if none is short enough.
    fn search(&mut self, s: &Sym4<T>, dx: &Sym4<T>, ds: &Sym4<T>) -> Option<T> {
        for _ in 0..TRIES_AT_ONCE {
            if self.tries >= TRIES {
                return Some(T::ZERO);
            }
            let inside = |d: &Sym4<T>| cholesky(&combine(s, d, T::ONE, self.alpha / self.margin)).is_some();
            if inside(dx) && inside(ds) {
                return Some(self.alpha);
            }
            self.alpha *= T::ONE - self.less;
            if self.less < T::from_f64_const(0.2) {
                self.less += self.less;
            }
            self.tries += 1;
        }
        None
    }
}

/// The triangle of `[R; B]` and the reflections that made it, to be applied to several right-hand sides.
#[derive(Clone, Copy, Debug)]
struct Newton<T: Scalar> {
    r: [[T; 10]; 10],
    /// Lower parts of the reflections, by columns; their first components and factors.
    x: [[T; 10]; 10],
    first: [T; 10],
    tau: [T; 10],
}

impl<T: Scalar> Newton<T> {
    /// Sets the reflections as [`InformationFactor::absorb`] makes them.
    fn set(&mut self, r: &[[T; 10]; 10], columns: &[[T; 10]; 10]) {
        let newton = self;
        (newton.r, newton.x) = (*r, *columns);
        (newton.first, newton.tau) = ([T::ZERO; 10], [T::ZERO; 10]);
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
    }

    /// Returns `B d` unpacked, for `d = argmin ‖R d − z‖² + ‖B d − y‖²`; B is `columns`.
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
