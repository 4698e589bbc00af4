use nalgebra::{Complex, DMatrix, DVector};

use super::*;

type Pole = Complex<f64>;

/// The pole near iω and its shape of `λ² + C λ + Ω²` over undamped modes, by Newton's method on the quadratic
/// eigenproblem itself.
fn vibration(omega: &[f64], c: &DMatrix<f64>, r: usize) -> (Pole, DVector<Pole>) {
    let n = omega.len();
    let matrix = |pole: Pole| {
        DMatrix::from_fn(n, n, |i, j| {
            let own = if i == j { pole * pole + omega[i].powi(2) } else { Pole::new(0.0, 0.0) };
            own + pole * c[(i, j)]
        })
    };
    let mut pole = Pole::new(-0.5 * c[(r, r)], omega[r]);
    let mut shape = DVector::from_fn(n, |i, _| Pole::new(f64::from(u8::from(i == r)), 0.0));
    for _ in 0..50 {
        // One step of inverse iteration, of the slope 2 λ + C.
        let slope = DMatrix::from_fn(n, n, |i, j| {
            let own = if i == j { 2.0 * pole } else { Pole::new(0.0, 0.0) };
            own + c[(i, j)]
        });
        let found = matrix(pole).lu().solve(&(slope * &shape));
        let Some(found) = found.filter(|found| found.iter().all(|z| z.norm().is_finite())) else { break };
        let by = found[r];
        pole -= Pole::new(1.0, 0.0) / by;
        shape = found / by;
    }
    (pole, shape)
}

fn mode(pole: Pole, shape: &DVector<Pole>) -> Mode {
    // The phase that makes most real.
    let turn = Pole::from_polar(1.0, -0.5 * shape.iter().map(|z| z * z).sum::<Pole>().arg());
    let real = shape.map(|z| (z * turn).re);
    Mode {
        angular: pole.norm(),
        angular_sd: 0.0,
        damping: -pole.re / pole.norm(),
        damping_sd: 0.0,
        shape: &real / real.norm(),
        amplitudes: shape.map(|z| z * Pole::new(0.3, 0.7)),
        imaginary_share: 0.0,
        collinearity: 1.0,
        signal_to_noise: 0.0,
    }
}

/// Frequencies are off by what is counted, as far as second order goes, and shapes by no more than twice that.
#[test]
fn damping_out_of_proportion_moves_modes_by_what_is_counted() {
    let omega = [5.0, 8.0, 13.0];
    for size in [0.02, 0.1, 0.4] {
        // One damper between two places of the body: c_rs = d v_r v_s.
        let v = [0.7, -1.0, 0.5];
        let c = DMatrix::from_fn(3, 3, |i, j| size * v[i] * v[j]);
        let modes: Vec<Mode> = (0..3)
            .map(|r| {
                let (pole, shape) = vibration(&omega, &c, r);
                mode(pole, &shape)
            })
            .collect();
        let counted = covariance(&modes);
        for r in 0..3 {
            let off = (modes[r].angular - omega[r]).abs();
            let sd = counted[(4 * r, 4 * r)].sqrt();
            assert!(off < 1.2 * sd && sd < 10.0 * off, "{size} {r}: {off:e} {sd:e}");
            let unit = DVector::from_fn(3, |i, _| f64::from(u8::from(i == r)));
            let sign = modes[r].shape[r].signum();
            let off = (&modes[r].shape * sign - unit).norm();
            let sd = (0..3).map(|k| counted[(4 * r + 1 + k, 4 * r + 1 + k)]).sum::<f64>().sqrt();
            assert!(off < 2.0 * sd + off.powi(2), "{size} {r}: {off:e} {sd:e}");
        }
    }
}

/// Damping in proportion moves nothing.
#[test]
fn damping_in_proportion_counts_nothing() {
    let omega = [5.0, 8.0];
    let c = DMatrix::from_diagonal(&DVector::from_vec(vec![0.1, 0.3]));
    let modes: Vec<Mode> = (0..2).map(|r| vibration(&omega, &c, r)).map(|(p, s)| mode(p, &s)).collect();
    assert!(covariance(&modes).amax() < 1e-20);
}
