//! The rows against d'Alembert's principle: another formula from the first line to the last.

extern crate std;
use std::vec;
use std::vec::Vec;

use nalgebra::{DMatrix, DVector, Matrix3, Quaternion, Vector3};

use super::joint::turn;
use super::motion::states;
use super::oracle::{Body, Drive, angular, attitude, inverse_dynamics, point, quaternion, three, world};
use super::rows::Workspace;
use super::*;
use crate::random::Random;

/// Returns a tree with every kind of joint in the middle and at the end, branches included.
fn zoo(random: &mut Random) -> Vec<Link<f64>> {
    let mut v = || Vector3::new(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5);
    let kinds = |a: Vector3<f64>, b: Vector3<f64>| {
        [
            Joint::Revolute(a),
            Joint::Prismatic(a),
            Joint::Universal(a, b),
            Joint::Spherical,
            Joint::Free,
            Joint::Fixed,
        ]
    };
    let mut links = vec![Link {
        parent: 0,
        joint: Joint::Free,
        rotation: Matrix3::identity(),
        position: Vector3::zeros(),
    }];
    for round in 0..2 {
        for kind in 0..6 {
            let joint = kinds(v().normalize(), v().normalize())[kind];
            let rotation = turn(&v().normalize(), 0.6, 0.8);
            // First round a chain; second, a leaf of every kind on each link of the chain.
            let parent = if round == 0 { kind } else { (kind * 5) % 6 + 1 };
            links.push(Link { parent, joint, rotation, position: v() });
        }
    }
    links
}

fn drives(links: &[Link<f64>], random: &mut Random) -> Vec<Drive> {
    links
        .iter()
        .map(|l| {
            let mut some = |n: usize| -> Vec<f64> { (0..n).map(|_| 4.0 * random.uniform() - 2.0).collect() };
            Drive {
                q: some(l.joint.coordinates()),
                v: some(l.joint.freedoms()),
                dv: some(l.joint.freedoms()),
            }
        })
        .collect()
}

fn joint_motion(link: &Link<f64>, s: &Drive) -> JointMotion<f64> {
    let a3 = |v: &[f64]| [v[0], v[1], v[2]];
    let matrix = |q: &[f64]| attitude(quaternion(q), Vector3::zeros(), Vector3::zeros())[0];
    match &link.joint {
        Joint::Fixed => JointMotion::rest(link),
        Joint::Revolute(a) => JointMotion::revolute(link, a, s.q[0].sin_cos(), s.v[0], s.dv[0]),
        Joint::Prismatic(a) => JointMotion::prismatic(link, a, s.q[0], s.v[0], s.dv[0]),
        Joint::Universal(a, b) => JointMotion::universal(
            link,
            [a, b],
            [s.q[0].sin_cos(), s.q[1].sin_cos()],
            [s.v[0], s.v[1]],
            [s.dv[0], s.dv[1]],
        ),
        Joint::Spherical => JointMotion::spherical(link, &matrix(&s.q), a3(&s.v), a3(&s.dv)),
        Joint::Free => JointMotion::free(
            link,
            a3(&s.q),
            &matrix(&s.q[3..]),
            [a3(&s.v), a3(&s.v[3..])],
            [a3(&s.dv), a3(&s.dv[3..])],
        ),
    }
}

struct Case {
    links: Vec<Link<f64>>,
    drives: Vec<Drive>,
    states: Vec<LinkState<f64>>,
    base: BaseMotion<f64>,
    phi: DVector<f64>,
    forces: Vec<f64>,
}

fn case(random: &mut Random) -> Case {
    let links = zoo(random);
    let drives = drives(&links, random);
    let mut v = || Vector3::new(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5);
    let bodies: Vec<Body> = links
        .iter()
        .map(|_| {
            let g = Matrix3::from_columns(&[v(), v(), v()]);
            (1.5 + v().x, v(), g * g.transpose())
        })
        .collect();
    let g = v() * 20.0;
    let forces = inverse_dynamics(&links, &drives, &bodies, g);
    let jets = world(&links, &drives);
    let r = jets[0].0[0].fixed_view::<3, 3>(0, 0).into_owned();
    let [w, dw] = angular(&jets[0]);
    let base = BaseMotion {
        specific_force: r.transpose() * (point(&jets[0], Vector3::zeros(), 2) - g),
        rate: r.transpose() * w,
        angular_acceleration: r.transpose() * dw,
    };
    let motions: Vec<_> = links.iter().zip(&drives).map(|(l, d)| joint_motion(l, d)).collect();
    let mut out = vec![LinkState::zero(); links.len()];
    states(&links, &motions, &base, &mut out).unwrap();
    let phi = DVector::from_iterator(
        10 * links.len(),
        bodies.iter().flat_map(|(m, c, i)| {
            let s = (Matrix3::identity() * c.dot(c) - c * c.transpose()) * *m + i;
            let mc = c * *m;
            [*m, mc.x, mc.y, mc.z, s.m11, s.m22, s.m33, s.m23, s.m31, s.m12]
        }),
    );
    Case { links, drives, states: out, base, phi, forces }
}

fn freedoms(links: &[Link<f64>]) -> usize {
    links.iter().skip(1).map(|l| l.joint.freedoms()).sum()
}

fn joint_rows(case: &Case) -> DMatrix<f64> {
    let (rows, n) = (freedoms(&case.links), 10 * case.links.len());
    let mut screws = vec![Screw { weights: [0.0; 6], changes: [0.0; 6] }; rows];
    let mut first = vec![0; case.links.len() + 1];
    let mut out = vec![0.0; rows * n];
    let mut room = Workspace { screws: &mut screws, first: &mut first };
    super::rows::joint_rows(&case.links, &case.states, &mut room, &mut out).unwrap();
    DMatrix::from_row_slice(rows, n, &out)
}

#[test]
fn rows_of_every_kind_of_joint_are_d_alembert_s_forces() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for _ in 0..20 {
        let case = case(&mut random);
        let n = 10 * case.links.len();
        let mut base = vec![0.0; 6 * n];
        super::rows::base_rows(&case.states, &mut base).unwrap();
        let wrench = DMatrix::from_row_slice(6, n, &base) * &case.phi;
        let torques = joint_rows(&case) * &case.phi;
        let scale = case.forces.iter().fold(1.0_f64, |m, f| m.max(f.abs()));
        // The base's freedoms are velocity and rate in its own axes: force and moment there.
        for (got, wanted) in wrench.iter().chain(torques.iter()).zip(&case.forces) {
            assert!((got - wanted).abs() < 1e-11 * scale, "{got} {wanted}");
        }
        assert_eq!(case.forces.len(), 6 + freedoms(&case.links));
    }
}

/// Returns the sum of all products of a screw's weights with a block, zeros of tensors in forces included.
fn projected(weights: &[f64; 6], block: &super::rows::Block<f64>) -> [f64; 10] {
    let mut row = [0.0; 10];
    for (weight, line) in weights.iter().zip(block) {
        row.iter_mut().zip(line).for_each(|(sum, entry)| *sum += weight * entry);
    }
    row
}

#[test]
fn rows_have_the_bits_of_the_blocks_that_devices_make() {
    let mut random = Random(0x2545_f491_4f6c_dd1d);
    for round in 0..12 {
        let mut case = case(&mut random);
        // Zeros of either sign, as still poses have them.
        for (k, state) in case.states.iter_mut().enumerate() {
            let zero = Vector3::new(0.0, -0.0, if k % 2 == 0 { 0.0 } else { -0.0 });
            if round % 2 == 1 {
                state.rate = zero;
            }
            if round % 3 == 1 {
                (state.angular_acceleration, state.specific_force) = (-zero, Vector3::new(-0.0, 0.0, 9.8));
            }
        }
        let (rows, n) = (freedoms(&case.links), 10 * case.links.len());
        let mut screws = vec![Screw { weights: [0.0; 6], changes: [0.0; 6] }; rows];
        let mut first = vec![0; case.links.len() + 1];
        let mut room = Workspace { screws: &mut screws, first: &mut first };
        let mut out = vec![0.0; (6 + rows) * n];
        super::rows::all_rows(&case.links, &case.states, &mut room, &mut out).unwrap();
        let bits = |row: &[f64]| -> Vec<u64> { row.iter().map(|v| v.to_bits()).collect() };
        for (i, state) in case.states.iter().enumerate() {
            let block = super::rows::block(state);
            let place = |row: usize| row * n + 10 * i..row * n + 10 * i + 10;
            for (row, line) in block.iter().enumerate() {
                assert_eq!(bits(&out[place(row)]), bits(line), "base row {row} of link {i}");
            }
            let mut at = i;
            while at != 0 {
                for row in first[at]..first[at + 1] {
                    let wanted = projected(&screws[row].weights, &block);
                    assert_eq!(bits(&out[place(6 + row)]), bits(&wanted), "row {row} of link {i}");
                }
                at = case.links[at].parent;
            }
        }
    }
}

/// `∂` of the momentum by Richardson's central differences of the drives' motion, against the rows with
/// accelerations.
#[test]
fn rows_without_accelerations_are_the_same_rows() {
    let mut random = Random(0xd1b5_4a32_d192_ed03);
    for _ in 0..5 {
        let case = case(&mut random);
        let (rows, n) = (freedoms(&case.links), 10 * case.links.len());
        let at = |t: f64| {
            let drives: Vec<Drive> =
                case.links.iter().zip(&case.drives).map(|(l, d)| later(l, d, t)).collect();
            let motions: Vec<_> = case.links.iter().zip(&drives).map(|(l, d)| joint_motion(l, d)).collect();
            let base = BaseMotion {
                rate: case.base.rate + case.base.angular_acceleration * t,
                angular_acceleration: Vector3::repeat(f64::NAN),
                ..case.base
            };
            // Accelerations must not matter.
            let mut states_at = vec![LinkState::zero(); case.links.len()];
            states(&case.links, &motions, &base, &mut states_at).unwrap();
            let mut screws = vec![Screw { weights: [0.0; 6], changes: [0.0; 6] }; rows];
            let mut first = vec![0; case.links.len() + 1];
            let mut room = Workspace { screws: &mut screws, first: &mut first };
            let (mut s, mut d) = (vec![0.0; (6 + rows) * n], vec![0.0; (6 + rows) * n]);
            momentum::base_rows(&states_at, &base, &mut s[..6 * n], &mut d[..6 * n]).unwrap();
            let (s_joints, d_joints) = (&mut s[6 * n..], &mut d[6 * n..]);
            momentum::joint_rows(&case.links, &states_at, &base, &mut room, s_joints, d_joints).unwrap();
            (DMatrix::from_row_slice(6 + rows, n, &s), DMatrix::from_row_slice(6 + rows, n, &d))
        };
        let difference = |h: f64| (at(h).1 - at(-h).1) / (2.0 * h);
        let h = 1e-3;
        let derivative = (difference(h) * 64.0 - difference(2.0 * h) * 20.0 + difference(4.0 * h)) / 45.0;
        let got = at(0.0).0 + derivative;
        let mut base = vec![0.0; 6 * n];
        super::rows::base_rows(&case.states, &mut base).unwrap();
        let mut wanted = DMatrix::zeros(6 + rows, n);
        wanted.rows_mut(0, 6).copy_from(&DMatrix::from_row_slice(6, n, &base));
        wanted.rows_mut(6, rows).copy_from(&joint_rows(&case));
        // Truncation is of order h⁶ times the seventh power of the rates, cancellation of ε / h.
        let error = (got - &wanted).abs().max();
        assert!(error < 1e-8 * wanted.abs().max(), "{error}");
    }
}

/// Returns the drive after a short time: constant accelerations, the attitude to the sixth order by small
/// steps of a quaternion.
fn later(link: &Link<f64>, s: &Drive, t: f64) -> Drive {
    let v: Vec<f64> = s.v.iter().zip(&s.dv).map(|(v, dv)| v + dv * t).collect();
    let mut q = s.q.clone();
    let rotating = |q: &[f64], w: &[f64], dw: &[f64]| -> Quaternion<f64> {
        // Runge–Kutta of fourth order in 32 steps.
        let (steps, mut x) = (32, quaternion(q));
        let h = t / f64::from(steps);
        let slope = |x: Quaternion<f64>, at: f64| x * Quaternion::from_imag(three(w) + three(dw) * at) * 0.5;
        for k in 0..steps {
            let at = h * f64::from(k);
            let a = slope(x, at);
            let b = slope(x + a * (h / 2.0), at + h / 2.0);
            let c = slope(x + b * (h / 2.0), at + h / 2.0);
            let d = slope(x + c * h, at + h);
            x += (a + b * 2.0 + c * 2.0 + d) * (h / 6.0);
        }
        x
    };
    match link.joint {
        Joint::Spherical => {
            let x = rotating(&s.q, &s.v, &s.dv);
            q = vec![x.w, x.i, x.j, x.k];
        }
        Joint::Free => {
            let x = rotating(&s.q[3..], &s.v[3..], &s.dv[3..]);
            // ṗ = R v by Simpson's rule on eight panels.
            let panels = 8;
            let mut sum = Vector3::zeros();
            for k in 0..=2 * panels {
                let at = t * f64::from(k) / f64::from(2 * panels);
                let part = Drive { q: s.q[3..].to_vec(), v: s.v[3..].to_vec(), dv: s.dv[3..].to_vec() };
                let turned = if k == 0 {
                    quaternion(&part.q)
                } else {
                    let d = later(&Link { joint: Joint::Spherical, ..*link }, &part, at).q;
                    quaternion(&d)
                };
                let r = attitude(turned, Vector3::zeros(), Vector3::zeros())[0];
                let weight = if k == 0 || k == 2 * panels {
                    1.0
                } else if k % 2 == 1 {
                    4.0
                } else {
                    2.0
                };
                sum += r * (three(&s.v) + three(&s.dv) * at) * weight;
            }
            let p = three(&s.q) + sum * (t / f64::from(6 * panels));
            q = vec![p.x, p.y, p.z, x.w, x.i, x.j, x.k];
        }
        _ => {
            for k in 0..q.len() {
                q[k] += s.v[k] * t + s.dv[k] * t * t / 2.0;
            }
        }
    }
    Drive { q, v, dv: vec![f64::NAN; s.dv.len()] }
}

#[test]
fn trees_out_of_order_are_refused() {
    let link = Link {
        parent: 3,
        joint: Joint::<f32>::Spherical,
        rotation: Matrix3::identity(),
        position: Vector3::zeros(),
    };
    assert_eq!(joint::check(&[link, link]), Err(TreeError::Order(1)));
    assert_eq!(joint::check::<f32>(&[]), Err(TreeError::Empty));
    let rest = JointMotion::rest(&link);
    let still = BaseMotion::still([0.0, 0.0, -9.8]);
    let mut one = [LinkState::zero()];
    assert_eq!(states(&[link], &[rest, rest], &still, &mut one), Err(TreeError::Lengths));
}
