extern crate std;
use std::vec::Vec;

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Vector3};

use super::*;
use crate::inertia::{InertialParameters, tensor_elements};
use crate::random::Random;
use crate::spatial::{Body, Position, Rotation, Sensor};

type Parameters = InertialParameters<Sensor, f64>;

/// Returns a body of random mass, place and shape; one principal second moment is `thin` times the largest.
fn body(random: &mut Random, thin: f64) -> [f64; 10] {
    let q = core::array::from_fn(|_| random.normal());
    let r = Rotation::<Sensor, Sensor, f64>::from_quaternion(q).unwrap().matrix();
    let mass = 1.0 + 9.0 * random.uniform();
    let size = mass * 0.05 * 0.05;
    let second = Matrix3::from_diagonal(&Vector3::new(size, size * random.uniform(), size * thin));
    let second = r * second * r.transpose();
    let com = Position::from_array(core::array::from_fn(|_| 0.1 * random.normal()));
    let inertia = Matrix3::identity() * second.trace() - second;
    Parameters::from_centre_of_mass(mass, com, inertia).to_vector()
}

/// Returns rows of N parameters whose answer is `phi` with a standard deviation of about `noise` of a unit
/// each, mixed by a random matrix; offsets of zero.
fn factor<const N: usize>(
    random: &mut Random,
    phi: &[f64; 10],
    noise: f64,
    spread: f64,
) -> InformationFactor<f64, N> {
    let mut factor = InformationFactor::new();
    let unit: [f64; N] = core::array::from_fn(|j| match j {
        0 => 1.0,
        1..4 => 0.05,
        4..10 => 0.0025,
        _ => 1.0,
    });
    let weights: [f64; N] = core::array::from_fn(|_| spread.powf(random.uniform() - 0.5));
    for _ in 0..N + 20 {
        let row: [f64; N] = core::array::from_fn(|j| {
            weights[j] * random.normal() / unit[j] / noise / (N as f64 + 20.0).sqrt()
        });
        let y = row.iter().zip(phi).map(|(a, p)| a * p).sum::<f64>() + random.normal();
        factor.absorb::<1>(&row.map(|a| [a]), &[y]);
    }
    factor
}

/// Returns random problems whose free answer is outside the cone.
fn infeasible<const N: usize>(
    seed: u64,
    count: usize,
    noise: f64,
) -> Vec<(InformationFactor<f64, N>, [f64; N])> {
    let mut random = Random(seed);
    let mut problems = Vec::new();
    while problems.len() < count {
        let thin = 1e-4 + 0.01 * random.uniform();
        let phi = body(&mut random, thin);
        let factor = factor::<N>(&mut random, &phi, noise, 10.0);
        let free = free_answer(&factor).unwrap();
        let ten: [f64; 10] = core::array::from_fn(|j| free[j]);
        if !is_consistent_with_margin(&ten) {
            problems.push((factor, free));
        }
    }
    problems
}

/// Returns K(φ) by another formula, from the pseudo-inertia.
fn oracle_cone(phi: &[f64; 10]) -> Matrix4<f64> {
    let mut k = Parameters::from_vector(*phi).pseudo_inertia();
    let floor = FLOOR * k.fixed_view::<3, 3>(0, 0).trace();
    for i in 0..3 {
        k[(i, i)] -= floor;
    }
    k
}

fn squared_misfit<const N: usize>(factor: &InformationFactor<f64, N>, phi: &[f64; N]) -> f64 {
    let r = DMatrix::from_fn(N, N, |i, j| factor.r()[i][j]);
    (r * DVector::from_column_slice(phi) - DVector::from_column_slice(factor.z())).norm_squared()
}

fn projected<const N: usize>(factor: &InformationFactor<f64, N>, free: &[f64; N]) -> Consistent<f64, N> {
    match nearest(factor, free, 60) {
        Nearest::Projected(found) => found,
        other => panic!("{other:?}"),
    }
}

/// Solves by alternating directions (Boyd et al. 2011, §5.2) with the eigenvalue projection, in coordinates
/// in which the map from φ to K is an isometry up to units: another method, another decomposition.
fn alternating_directions(factor: &InformationFactor<f64, 10>) -> DVector<f64> {
    // K in balanced units: kg, 0.05 m.
    let unit = Vector3::repeat(1.0 / 0.05).push(1.0);
    let basis: Vec<Matrix4<f64>> = (0..10)
        .map(|j| {
            let mut e = [0.0; 10];
            e[j] = 1.0;
            oracle_cone(&e).zip_map(&(unit * unit.transpose()), |a, b| a * b)
        })
        .collect();
    let a = DMatrix::from_fn(16, 10, |i, j| basis[j][(i % 4, i / 4)]);
    let r = DMatrix::from_fn(10, 10, |i, j| factor.r()[i][j]);
    let z = DVector::from_column_slice(factor.z());
    let rho = (r.transpose() * &r).trace() / (a.transpose() * &a).trace() * 0.1;
    let inverse = (r.transpose() * &r + a.transpose() * &a * rho).cholesky().unwrap();
    let (mut y, mut u) = (DVector::zeros(16), DVector::zeros(16));
    let mut phi = DVector::zeros(10);
    for _ in 0..200_000 {
        phi = inverse.solve(&(r.transpose() * &z + a.transpose() * (&y - &u) * rho));
        let ax = &a * &phi;
        let full = Matrix4::from_column_slice((&ax + &u).as_slice());
        let mut eigen = full.symmetric_eigen();
        eigen.eigenvalues.iter_mut().for_each(|v| *v = v.max(0.0));
        let next = DVector::from_column_slice(eigen.recompose().as_slice());
        let dual = (&next - &y).norm();
        y = next;
        u += &ax - &y;
        if (&ax - &y).norm() < 1e-13 * ax.norm() && dual < 1e-13 * ax.norm() {
            break;
        }
    }
    phi
}

#[test]
fn the_answer_is_that_of_alternating_projections() {
    for (factor, free) in infeasible::<10>(7, 20, 0.05) {
        let found = projected(&factor, &free);
        let oracle = alternating_directions(&factor);
        let r = DMatrix::from_fn(10, 10, |i, j| factor.r()[i][j]);
        let apart = (r * (&oracle - DVector::from_column_slice(&found.parameters))).norm();
        // Standard deviations. The bound the gap gives is √ε·max(32, 4·distance) = 4.8e-7 and up.
        assert!(apart < 1e-6 * found.distance_sd.max(1.0), "{apart} of {}", found.distance_sd);
    }
}

#[test]
fn the_answer_satisfies_the_conditions_of_optimality() {
    for noise in [0.01, 0.1, 1.0, 100.0] {
        for (factor, free) in infeasible::<10>(3, 50, noise) {
            let found = projected(&factor, &free);
            let k = oracle_cone(&found.parameters);
            let inside = Parameters::from_vector(found.parameters).pseudo_inertia().cholesky().unwrap();
            // Λ from the gradient: one equation per basis matrix, Λ symmetric with ten unknowns.
            let r = DMatrix::from_fn(10, 10, |i, j| factor.r()[i][j]);
            let d = DVector::from_fn(10, |j, _| found.parameters[j] - free[j]);
            let gradient = r.transpose() * (&r * d);
            let places: Vec<(usize, usize)> = (0..4).flat_map(|i| (0..=i).map(move |j| (i, j))).collect();
            let map = DMatrix::from_fn(10, 10, |p, e| {
                let mut unit = [0.0; 10];
                unit[p] = 1.0;
                let (i, j) = places[e];
                oracle_cone(&unit)[(i, j)] * if i == j { 1.0 } else { 2.0 }
            });
            let packed = map.lu().solve(&gradient).unwrap();
            let mut multiplier = Matrix4::zeros();
            for (e, (i, j)) in places.iter().enumerate() {
                multiplier[(*i, *j)] = packed[e];
                multiplier[(*j, *i)] = packed[e];
            }
            // The promise of the tolerance: ‖R(φ − φ*)‖² ≤ 2 tr(KΛ), with what may be left of the gradient,
            // at most the tolerance, times the body's size in standard deviations.
            let tolerance = f64::EPSILON.sqrt() * 32.0_f64.max(4.0 * found.distance_sd);
            let left = tolerance * norm(&times(&factor.r(), &found.parameters));
            let gap = (k * multiplier).trace();
            assert!(2.0 * gap.abs() <= tolerance * tolerance + left, "{gap} {left}");
            // Λ ⪰ 0 up to the same, in the units of the body.
            let l = inside.l();
            let least = (l.transpose() * multiplier * l).symmetric_eigenvalues().min();
            assert!(least > -left, "{least} {left}");
        }
    }
}

#[test]
fn the_distance_is_the_rise_of_the_misfit() {
    for (factor, free) in infeasible::<16>(5, 20, 0.05) {
        let found = projected(&factor, &free);
        let rise = squared_misfit(&factor, &found.parameters) - squared_misfit(&factor, &free);
        let (expected, got) = (rise.sqrt(), found.distance_sd);
        assert!((expected - got).abs() < 1e-6 * got.max(1e-3), "{expected} {got}");
        // The offsets are the best ones for this body: no step along them lowers the misfit.
        for j in 10..16 {
            for step in [-1e-3, 1e-3] {
                let mut other = found.parameters;
                other[j] += step;
                assert!(squared_misfit(&factor, &other) > squared_misfit(&factor, &found.parameters));
            }
        }
    }
}

#[test]
fn a_consistent_answer_is_left_alone() {
    let mut random = Random(77);
    for _ in 0..100 {
        let phi = body(&mut random, 0.3);
        let factor = factor::<16>(&mut random, &phi, 1e-4, 10.0);
        let free = factor.solve().estimate;
        let answer = nearest(&factor, &free, ITERATIONS);
        assert_eq!(answer, Nearest::Free);
        assert_eq!(answer.parameters(&free), Some(free));
    }
}

/// Returns the matrix that takes φ to φ of the same body in another frame.
fn change_of_frame(rotation: &Rotation<Body, Sensor, f64>, origin: [f64; 3]) -> [[f64; 10]; 10] {
    let r = rotation.matrix();
    let t = Vector3::from(origin);
    let mut h = Matrix4::identity();
    h.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
    h.fixed_view_mut::<3, 1>(0, 3).copy_from(&(-(r * t)));
    // J' = H J Hᵀ
    let mut map = [[0.0; 10]; 10];
    for j in 0..10 {
        let mut e = [0.0; 10];
        e[j] = 1.0;
        let there = h * Parameters::from_vector(e).pseudo_inertia() * h.transpose();
        let sigma = there.fixed_view::<3, 3>(0, 0).into_owned();
        let tensor = tensor_elements(&(Matrix3::identity() * sigma.trace() - sigma));
        let column = [
            there[(3, 3)],
            there[(0, 3)],
            there[(1, 3)],
            there[(2, 3)],
            tensor[0],
            tensor[1],
            tensor[2],
            tensor[3],
            tensor[4],
            tensor[5],
        ];
        for i in 0..10 {
            map[i][j] = column[i];
        }
    }
    map
}

#[test]
fn another_frame_gives_the_same_body() {
    let mut random = Random(13);
    for (factor, free) in infeasible::<10>(23, 20, 0.05) {
        let there = Rotation::<Body, Sensor, f64>::from_quaternion(core::array::from_fn(|_| random.normal()))
            .unwrap();
        for origin in [[0.0; 3], core::array::from_fn(|_| 0.1 * random.normal())] {
            let forth = change_of_frame(&there, origin);
            let r = there.matrix();
            let back_origin = -(r * Vector3::from(origin));
            let back = change_of_frame(
                &Rotation::<Body, Sensor, f64>::from_quaternion(inverse_quaternion(&there)).unwrap(),
                [back_origin.x, back_origin.y, back_origin.z],
            );
            let moved = factor.substitute(&back);
            let here = projected(&factor, &free);
            let found = projected(&moved, &free_answer(&moved).unwrap());
            let expected: [f64; 10] =
                core::array::from_fn(|i| (0..10).map(|j| forth[i][j] * here.parameters[j]).sum());
            // In standard deviations. The floor is 2⁻¹⁷ tr(Σ) in whichever frame: shifting the origin moves
            // the edge by less than 2⁻¹⁷ (tr Σ + tr Σ′); rotating it, not at all.
            let apart: [f64; 10] = core::array::from_fn(|j| found.parameters[j] - expected[j]);
            let allowed = if origin == [0.0; 3] {
                1e-6 * here.distance_sd.max(1.0)
            } else {
                let second = |phi: &[f64; 10]| 0.5 * (phi[4] + phi[5] + phi[6]);
                let edge = FLOOR * (second(&here.parameters) + second(&expected));
                let stiffest = moved.r().map(|row| row[4..7].iter().map(|v| v.abs()).fold(0.0, f64::max));
                1e-6 * here.distance_sd.max(1.0) + 10.0 * edge * norm(&stiffest)
            };
            let apart = norm(&times(&moved.r(), &apart));
            assert!(apart < allowed, "{apart} {allowed} {origin:?}");
            assert!((found.distance_sd - here.distance_sd).abs() < allowed);
        }
    }
}

fn inverse_quaternion(rotation: &Rotation<Body, Sensor, f64>) -> [f64; 4] {
    let m = rotation.matrix();
    let q = nalgebra::UnitQuaternion::from_matrix(&m).inverse();
    [q.w, q.i, q.j, q.k]
}

#[test]
fn single_precision_agrees_within_its_tolerance() {
    let mut most = 0;
    for noise in [0.003, 0.03, 0.3, 3.0] {
        for (factor, free) in infeasible::<16>(29, 200, noise) {
            let exact = projected(&factor, &free);
            let narrow = factor.cast(|v| v as f32);
            let Nearest::Projected(found) = nearest(&narrow, &free.map(|v| v as f32), ITERATIONS) else {
                panic!("{:?} {exact:?}", nearest(&narrow, &free.map(|v| v as f32), ITERATIONS));
            };
            most = most.max(found.iterations);
            let phi: [f64; 16] = found.parameters.map(f64::from);
            let apart = norm(&times(&factor.r(), &core::array::from_fn(|j| phi[j] - exact.parameters[j])));
            // The promised tolerance, √ε·max(32, 4·distance), and what rounding φ and R to f32 is worth: ε
            // ‖R‖ ‖φ‖.
            let size = norm(&times(&factor.r(), &free));
            let allowed = f64::from(f32::EPSILON).sqrt() * 32.0_f64.max(4.0 * exact.distance_sd)
                + 20.0 * f64::from(f32::EPSILON) * size;
            assert!(apart < allowed, "{apart} {allowed} noise {noise}");
            assert!(Parameters::from_vector(core::array::from_fn(|j| phi[j])).is_physically_consistent());
        }
    }
    assert!((8..=14).contains(&most), "{most}");
}

#[test]
fn whatever_the_factor_nothing_leaves_the_cone() {
    let mut random = Random(101);
    let (mut projected, mut other, mut not) = (0, 0, 0);
    for n in 0..3000 {
        let thin = 10_f64.powf(-8.0 * random.uniform());
        let phi = body(&mut random, thin);
        let noise = 10_f64.powf(6.0 * random.uniform() - 3.0);
        let spread = 10_f64.powf(8.0 * random.uniform());
        let mut factor = factor::<16>(&mut random, &phi, noise, spread).cast(|v| v as f32);
        if n % 10 == 0 {
            // A column that almost repeats another.
            let mut map = [[0.0_f32; 16]; 16];
            for j in 0..16 {
                map[j][j] = 1.0;
            }
            map[n % 7][9] = 1.0;
            map[9][9] = 10_f32.powf(-6.0 * random.uniform() as f32);
            factor = factor.substitute(&map);
        }
        let free = free_answer(&factor).unwrap_or([0.0; 16]);
        let answer = nearest(&factor, &free, ITERATIONS);
        match answer {
            Nearest::Projected(_) => projected += 1,
            Nearest::NotDetermined => not += 1,
            Nearest::Free => (),
            Nearest::NotConverged(_) if spread > 1e3 || n % 10 == 0 => other += 1,
            Nearest::NotConverged(_) => panic!("{n} {answer:?}"),
        }
        let Some(parameters) = answer.parameters(&free) else { continue };
        assert!(parameters.iter().all(|v| v.is_finite()));
        assert!(answer.distance_sd().is_some_and(|d| d.is_finite() && d >= 0.0));
        // Judged in f64 on the numbers handed out, and in f32 as the target would.
        let ten: [f32; 10] = core::array::from_fn(|j| parameters[j]);
        assert!(InertialParameters::<Sensor, f32>::from_vector(ten).is_physically_consistent());
        assert!(Parameters::from_vector(ten.map(f64::from)).is_physically_consistent(), "{answer:?}");
    }
    // Rows whose weights differ by more than 1e3 and columns that repeat are more than f32 can hold; their
    // free answer may be 1e8 standard deviations from any body. That must not be rare here, nor be the rule.
    assert!(projected > 2000 && not > 10 && other > 10 && other * 5 < projected, "{projected} {other} {not}");
}

#[test]
fn undetermined_factors_are_reported() {
    let mut random = Random(9);
    let phi = body(&mut random, 0.1);
    let full = factor::<10>(&mut random, &phi, 0.01, 1.0);
    let mut map = [[0.0; 10]; 10];
    for (j, row) in map.iter_mut().enumerate().skip(1) {
        row[j] = 1.0;
    }
    let blind = full.substitute(&map);
    assert!(free_answer(&blind).is_none());
    assert_eq!(nearest(&blind, &phi, ITERATIONS), Nearest::NotDetermined);
    assert_eq!(nearest(&InformationFactor::<f64, 10>::new(), &[0.0; 10], ITERATIONS), Nearest::NotDetermined);
    assert_eq!(nearest(&full, &[f64::NAN; 10], ITERATIONS), Nearest::NotDetermined);
}
