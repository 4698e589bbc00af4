//! Another way to a tree's forces: d'Alembert's principle on the motion of the links' centres of mass, which
//! comes from twice differentiated homogeneous transformations. For tests.

extern crate std;
use std::vec;
use std::vec::Vec;

use nalgebra::{Matrix3, Matrix4, Quaternion, Vector3};

use super::{Joint, Link};

/// A transformation with its first two derivatives in time.
#[derive(Clone, Copy)]
pub struct Jet(pub [Matrix4<f64>; 3]);

impl Jet {
    pub fn then(&self, next: &Self) -> Self {
        let ([a, da, dda], [b, db, ddb]) = (self.0, next.0);
        Self([a * b, da * b + a * db, dda * b + da * db * 2.0 + a * ddb])
    }
}

pub fn homogeneous(r: Matrix3<f64>, p: Vector3<f64>, one: f64) -> Matrix4<f64> {
    let mut t = r.to_homogeneous();
    t.fixed_view_mut::<3, 1>(0, 3).copy_from(&p);
    t[(3, 3)] = one;
    t
}

/// Returns the rotation about an axis by an angle with derivatives: d/dt R = q̇ [a]× R.
pub fn turning(axis: Vector3<f64>, q: [f64; 3]) -> Jet {
    let k = axis.cross_matrix();
    let r = Matrix3::identity() + k * q[0].sin() + k * k * (1.0 - q[0].cos());
    let dr = k * r * q[1];
    let ddr = k * r * q[2] + k * k * r * (q[1] * q[1]);
    let o = Vector3::zeros();
    Jet([homogeneous(r, o, 1.0), homogeneous(dr, o, 0.0), homogeneous(ddr, o, 0.0)])
}

/// Returns the attitude by the quaternion's own derivatives: q̇ = ½ q ω.
pub fn attitude(q: Quaternion<f64>, rate: Vector3<f64>, change: Vector3<f64>) -> [Matrix3<f64>; 3] {
    let pure = |v: Vector3<f64>| Quaternion::from_imag(v);
    let dq = q * pure(rate) * 0.5;
    let ddq = (dq * pure(rate) + q * pure(change)) * 0.5;
    // R is quadratic in q: R = sandwich(q, q).
    let sandwich = |a: Quaternion<f64>, b: Quaternion<f64>| {
        let column = |v: Vector3<f64>| (a * pure(v) * b.conjugate()).imag();
        Matrix3::from_columns(&[column(Vector3::x()), column(Vector3::y()), column(Vector3::z())])
    };
    [
        sandwich(q, q),
        sandwich(dq, q) + sandwich(q, dq),
        sandwich(ddq, q) + sandwich(dq, dq) * 2.0 + sandwich(q, ddq),
    ]
}

/// A joint's state: positions, rates, changes of rates; quaternions w, x, y, z.
#[derive(Clone)]
pub struct Drive {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub dv: Vec<f64>,
}

pub fn three(v: &[f64]) -> Vector3<f64> {
    Vector3::new(v[0], v[1], v[2])
}

pub fn quaternion(q: &[f64]) -> Quaternion<f64> {
    Quaternion::new(q[0], q[1], q[2], q[3]).normalize()
}

pub fn jet(link: &Link<f64>, s: &Drive) -> Jet {
    let o = Vector3::zeros();
    let zero = Matrix4::zeros();
    let fixed = Jet([homogeneous(link.rotation, link.position, 1.0), zero, zero]);
    let moved = match link.joint {
        Joint::Fixed => Jet([Matrix4::identity(), zero, zero]),
        Joint::Revolute(a) => turning(a, [s.q[0], s.v[0], s.dv[0]]),
        Joint::Prismatic(a) => {
            let slid = |x: f64, one| homogeneous(Matrix3::identity() * one, a * x, one);
            Jet([slid(s.q[0], 1.0), slid(s.v[0], 0.0), slid(s.dv[0], 0.0)])
        }
        Joint::Universal(a, b) => {
            turning(a, [s.q[0], s.v[0], s.dv[0]]).then(&turning(b, [s.q[1], s.v[1], s.dv[1]]))
        }
        Joint::Spherical => {
            let r = attitude(quaternion(&s.q), three(&s.v), three(&s.dv));
            Jet([homogeneous(r[0], o, 1.0), homogeneous(r[1], o, 0.0), homogeneous(r[2], o, 0.0)])
        }
        Joint::Free => {
            let r = attitude(quaternion(&s.q[3..]), three(&s.v[3..]), three(&s.dv[3..]));
            let (v, dv) = (three(&s.v), three(&s.dv));
            Jet([
                homogeneous(r[0], three(&s.q), 1.0),
                homogeneous(r[1], r[0] * v, 0.0),
                homogeneous(r[2], r[1] * v + r[0] * dv, 0.0),
            ])
        }
    };
    fixed.then(&moved)
}

pub fn world(links: &[Link<f64>], drives: &[Drive]) -> Vec<Jet> {
    let mut jets: Vec<Jet> = Vec::new();
    for (i, link) in links.iter().enumerate() {
        let own = jet(link, &drives[i]);
        jets.push(if i == 0 { own } else { jets[link.parent].then(&own) });
    }
    jets
}

/// Returns angular rate and acceleration in A from Ṙ Rᵀ = [ω]×.
pub fn angular(jet: &Jet) -> [Vector3<f64>; 2] {
    let r = |k: usize| jet.0[k].fixed_view::<3, 3>(0, 0).into_owned();
    let vee = |m: Matrix3<f64>| {
        Vector3::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]) * 0.5
    };
    [vee(r(1) * r(0).transpose()), vee(r(2) * r(0).transpose() + r(1) * r(1).transpose())]
}

/// Mass, centre of mass, inertia about it, link axes.
pub type Body = (f64, Vector3<f64>, Matrix3<f64>);

pub fn point(jet: &Jet, c: Vector3<f64>, k: usize) -> Vector3<f64> {
    (jet.0[k] * c.push(1.0)).xyz()
}

/// Returns the generalised forces of all freedoms, the free base's six first, as the sum of (m(p̈ − g), İω +
/// …) on virtual motions.
pub fn inverse_dynamics(links: &[Link<f64>], drives: &[Drive], bodies: &[Body], g: Vector3<f64>) -> Vec<f64> {
    let jets = world(links, drives);
    let mut forces = Vec::new();
    for i in 0..links.len() {
        for k in 0..links[i].joint.freedoms() {
            let virtual_drives: Vec<Drive> = drives
                .iter()
                .enumerate()
                .map(|(j, d)| Drive {
                    q: d.q.clone(),
                    v: (0..d.v.len()).map(|n| f64::from(u8::from(j == i && n == k))).collect(),
                    dv: vec![0.0; d.dv.len()],
                })
                .collect();
            let moved = world(links, &virtual_drives);
            let mut sum = 0.0;
            for ((jet, moved), (m, c, inertia)) in jets.iter().zip(&moved).zip(bodies) {
                let r = jet.0[0].fixed_view::<3, 3>(0, 0).into_owned();
                let [w, dw] = angular(jet);
                let tensor = r * inertia * r.transpose();
                let force = (point(jet, *c, 2) - g) * *m;
                let moment = tensor * dw + w.cross(&(tensor * w));
                sum += force.dot(&point(moved, *c, 1)) + moment.dot(&angular(moved)[0]);
            }
            forces.push(sum);
        }
    }
    forces
}
