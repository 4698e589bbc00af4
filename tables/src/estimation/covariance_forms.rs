//! The failure of the covariance forms of recursive least squares in f32, beside the information forms.

use rigident_shared::Scalar;
use rigident_shared::factor::Cascade;

use super::problem::{Block, Mixed, rigid_body};
use super::reference::Reference;
use super::report::short;

/// Thesis, Table 1, 1 σ; and its resolution as a uniform error.
const TABLE_1: [f64; 6] = [9.9 / 1.96, 9.9 / 1.96, 19.8 / 1.96, 0.75 / 1.96, 0.9 / 1.96, 0.9 / 1.96];
const STEPS: [f64; 6] = [0.125, 0.125, 0.25, 0.0075, 0.0075, 0.0075];

const PRIORS: [f64; 3] = [1e2, 1e4, 1e6];

#[derive(Clone, Copy)]
enum Form {
    /// P ← P − k (P a)ᵀ
    Plain,
    /// P ← P − k (P a)ᵀ, then P ← (P + Pᵀ)/2
    Symmetrised,
    /// P ← (1 − k aᵀ) P (1 − k aᵀ)ᵀ + k kᵀ, written out left to right
    Joseph,
}

struct Outcome<T> {
    x: Vec<T>,
    /// Innovation variances that were not positive.
    impossible: usize,
}

/// Estimates row by row, unit noise, from P = p0 1 and x = 0.
fn covariance_form<T: Scalar, const N: usize>(blocks: &[Block<N>], p0: f64, form: Form) -> Outcome<T> {
    let mut p = vec![[T::ZERO; N]; N];
    for (j, row) in p.iter_mut().enumerate() {
        row[j] = T::from_f64_const(p0);
    }
    let mut x = [T::ZERO; N];
    let mut impossible = 0;
    for (columns, rhs) in blocks {
        for i in 0..6 {
            let a: [T; N] = std::array::from_fn(|j| T::from_f32(columns[j][i]));
            impossible += usize::from(!update(&mut p, &mut x, &a, T::from_f32(rhs[i]), form));
        }
    }
    Outcome { x: x.to_vec(), impossible }
}

fn dot<T: Scalar, const N: usize>(a: &[T; N], b: &[T; N]) -> T {
    let mut sum = T::ZERO;
    for (a, b) in a.iter().zip(b) {
        sum += *a * *b;
    }
    sum
}

/// Returns `aᵀ P`.
fn times<T: Scalar, const N: usize>(a: &[T; N], p: &[[T; N]]) -> [T; N] {
    let mut product = [T::ZERO; N];
    for (a, row) in a.iter().zip(p) {
        for (entry, v) in product.iter_mut().zip(row) {
            *entry += *a * *v;
        }
    }
    product
}

/// Returns whether the innovation's variance was positive.
fn update<T: Scalar, const N: usize>(p: &mut [[T; N]], x: &mut [T; N], a: &[T; N], y: T, form: Form) -> bool {
    let mut u = [T::ZERO; N];
    for (u, row) in u.iter_mut().zip(p.iter()) {
        *u = dot(row, a);
    }
    let s = T::ONE + dot(a, &u);
    let k = u.map(|u| u / s);
    let innovation = y - dot(a, x);
    for (x, k) in x.iter_mut().zip(k) {
        *x += k * innovation;
    }
    let ap = if matches!(form, Form::Joseph) { times(a, p) } else { u };
    for (row, k) in p.iter_mut().zip(k) {
        for (entry, v) in row.iter_mut().zip(ap) {
            *entry -= k * v;
        }
    }
    match form {
        Form::Plain => {}
        Form::Symmetrised => {
            let half = T::ONE / T::from_u32(2);
            for i in 0..N {
                for j in 0..i {
                    let mean = half * (p[i][j] + p[j][i]);
                    (p[i][j], p[j][i]) = (mean, mean);
                }
            }
        }
        Form::Joseph => {
            for (row, ki) in p.iter_mut().zip(k) {
                let ba = dot(row, a);
                for (entry, kj) in row.iter_mut().zip(k) {
                    *entry = *entry - ba * kj + ki * kj;
                }
            }
        }
    }
    s > T::ZERO
}

/// Solves the normal equations in f32 by Cholesky; `None` where they are not positive definite.
fn information_sum<const N: usize>(blocks: &[Block<N>]) -> Option<Vec<f64>> {
    let mut gram = nalgebra::DMatrix::<f32>::zeros(N, N);
    let mut moments = nalgebra::DVector::<f32>::zeros(N);
    for (columns, rhs) in blocks {
        for (j, a) in columns.iter().enumerate() {
            for (k, b) in columns.iter().enumerate() {
                gram[(k, j)] += a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
            }
            moments[j] += a.iter().zip(rhs).map(|(a, y)| a * y).sum::<f32>();
        }
    }
    let x = gram.cholesky()?.solve(&moments);
    Some(x.iter().map(|v| f64::from(*v)).collect())
}

/// Returns what ships.
fn square_root_information<const N: usize>(blocks: &[Block<N>]) -> Vec<f64> {
    let mut cascade = Box::new(Cascade::<f32, N, 4>::new());
    for (columns, rhs) in blocks {
        cascade.absorb(columns, rhs);
    }
    cascade.factor().solve().estimate.iter().map(|v| f64::from(*v)).collect()
}

/// An earlier study's figures for a problem: three priors of each of the four covariance forms (plain,
/// symmetrised, Joseph, f64), then the information sum and the square root. Empty where there is none.
struct Printed {
    forms: [[&'static str; 4]; 3],
    sum: &'static str,
    root: &'static str,
}

fn beside(own: String, printed: &str) -> String {
    if printed.is_empty() { own } else { format!("{own} ({printed})") }
}

fn lines<const N: usize>(name: &str, blocks: &[Block<N>], printed: &Printed) -> String {
    let reference = Reference::of(blocks);
    let cell = |outcome: Outcome<f32>, printed| {
        let deviation = reference.deviation_sd(outcome.x.iter().map(|v| f64::from(*v)));
        let mark = if outcome.impossible > 0 { "!" } else { "" };
        beside(format!("{}{mark}", short(deviation)), printed)
    };
    let sum = information_sum(blocks)
        .map_or("not positive definite".to_owned(), |x| short(reference.deviation_sd(x)));
    let root = short(reference.deviation_sd(square_root_information(blocks)));
    let mut text = String::new();
    for ((k, p0), [plain, symmetrised, joseph, wide]) in PRIORS.into_iter().enumerate().zip(printed.forms) {
        let f64_form = covariance_form::<f64, N>(blocks, p0, Form::Plain).x;
        let first = |own: &str, printed| if k == 0 { beside(own.to_owned(), printed) } else { String::new() };
        let cells = [
            if k == 0 { format!("{name}, cond {}", short(reference.condition)) } else { String::new() },
            short(p0),
            cell(covariance_form(blocks, p0, Form::Plain), plain),
            cell(covariance_form(blocks, p0, Form::Symmetrised), symmetrised),
            cell(covariance_form(blocks, p0, Form::Joseph), joseph),
            beside(short(reference.deviation_sd(f64_form)), wide),
            first(&sum, printed.sum),
            first(&root, printed.root),
        ];
        text += &format!("| {} |\n", cells.join(" | "));
    }
    text
}

fn random(condition: f64, seed: u64) -> Vec<Block<128>> {
    let mut rows = Mixed::<128>::new(condition, 1.0, 20.0, seed);
    (0..2000).map(|_| rows.block()).collect()
}

/// Returns the table.
pub fn table() -> String {
    let mut text = "| problem | P₀ | plain | + symmetrised | Joseph | plain, f64 | information sum | square \
                    root (ours) |\n\
                    |---|---|---|---|---|---|---|---|\n"
        .to_owned();
    text += &lines(
        "N = 10, Table 1",
        &rigid_body::<10>(TABLE_1, false, 1),
        &Printed {
            forms: [
                [".68", ".01", ".01", "≤ .002"],
                ["20", ".006", ".006", "≤ .002"],
                ["1.4e4", ".01", ".4", "≤ .002"],
            ],
            sum: ".02",
            root: ".005",
        },
    );
    text += &lines(
        "N = 16, Table 1",
        &rigid_body::<16>(TABLE_1, false, 2),
        &Printed {
            forms: [
                [".63", ".01", ".02", "≤ .002"],
                ["122", ".2", ".8", "≤ .002"],
                ["3e4", ".08", "2e3", "≤ .002"],
            ],
            sum: ".014",
            root: ".002",
        },
    );
    let fine = STEPS.map(|s| s / 12_f64.sqrt());
    text += &lines(
        "N = 10, resolution",
        &rigid_body::<10>(fine, false, 3),
        &Printed {
            forms: [["2e3", ".7", ".6", "≤ 2"], ["6e4", ".5", ".7", "≤ 2"], ["6e5", ".7", "1.9", "≤ 2"]],
            sum: ".9",
            root: "1.6",
        },
    );
    text += &lines(
        "N = 16, resolution",
        &rigid_body::<16>(fine, false, 4),
        &Printed {
            forms: [
                ["6e3", ".2", ".7", "≤ .14"],
                ["8e4", ".3", "4e3", "≤ .14"],
                ["5e5", ".2", "8.6", "≤ .14"],
            ],
            sum: "2.2",
            root: ".4",
        },
    );
    let empty = [["", "", "", ""]; 3];
    let none = Printed { forms: empty, sum: "", root: "" };
    text += &lines("N = 16, resolution, from rest", &rigid_body::<16>(fine, true, 4), &none);
    let (low, middle, high) = (random(1e2, 5), random(1e3, 6), random(1e4, 7));
    text += &lines(
        "N = 128, random",
        &low,
        &Printed {
            forms: [["1.5*", "1.5*", "", "1.5*"], [".13", ".015", "", ".015"], ["579", "269", "", "2e-4"]],
            sum: ".33",
            root: ".005",
        },
    );
    text += &lines("N = 128, random", &middle, &Printed { forms: empty, sum: "1.7", root: ".0005" });
    text += &lines(
        "N = 128, random",
        &high,
        &Printed {
            forms: [["7*", "7*", "", "7*"], ["1.95*", "2.0*", "", "1.9*"], ["303", "49", "", ".03"]],
            sum: "174",
            root: ".003",
        },
    );
    text
}
