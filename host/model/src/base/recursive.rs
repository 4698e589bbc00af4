//! Regrouping by rules, leaf to root, for a base that moves freely.
//!
//! The motion of a link differs from its parent's by what its joint does; what the joint leaves alone the two
//! links cannot be distinguished by. With a the axis, R and p of the joint at zero position:
//!
//! | joint | goes to the parent | stays |
//! |---|---|---|
//! | spherical, universal | `M` | `MS`, `J`: 9 |
//! | revolute | `M`, `MS·a`, one of the transverse moments as `J_yy (1 − a aᵀ)` | `MSx MSy Jxx−Jyy Jzz Jyz Jzx Jxy`: 7, z along a |
//! | prismatic | `J` | `M`, `MS`: 4 |
//! | fixed | all | – |
//! | free | – | all ten |
//!
//! This is G. Venture, K. Ayusawa, Y. Nakamura (SYSID 2009) with the misprints of its equations put right,
//! and with a frame inserted where an axis is not z: along a coordinate axis it only renames (x y z in a
//! circle, names stay those of the link's axes), otherwise names carry a prime and belong to axes turned so
//! that z' is the joint's.

use nalgebra::{DMatrix, Matrix3, Vector3};
use rigident_shared::tree::Joint;

use crate::inertial::{ParameterMap, map_to_parent};
use crate::tree::Model;

/// A base parameter by the rules.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The name of the parameter.
    pub name: String,
    /// The standard column that represents it: it has weight 1 there, and none in other rules, unless its
    /// name is primed.
    pub column: usize,
    /// True if the name is primed: axes are the joint's, not the link's.
    pub primed: bool,
    /// Columns and weights.
    pub terms: Vec<(usize, f64)>,
}

/// The parts that stay with a link: its name, the column that represents it, and two of the link's ten rows
/// with their weights.
type Stays = (String, usize, [(usize, f64); 2]);

const M: usize = 0;
pub(super) const NAMES: [&str; 10] = ["M", "MSx", "MSy", "MSz", "Jxx", "Jyy", "Jzz", "Jyz", "Jzx", "Jxy"];

/// Returns the place of the tensor's element (i, k) in φ.
fn tensor(i: usize, k: usize) -> usize {
    if i == k { 4 + i } else { 10 - i - k }
}

/// Returns the rules of a model without fixed joints, base first.
pub fn rules(model: &Model) -> Vec<Rule> {
    let (links, columns) = (&model.links, 10 * model.links.len());
    // Row k of `carried[i]`: parameter k of link i with what has come to it from its children.
    let mut carried: Vec<DMatrix<f64>> = (0..links.len())
        .map(|i| {
            let mut own = DMatrix::zeros(10, columns);
            own.view_mut((0, 10 * i), (10, 10)).fill_with_identity();
            own
        })
        .collect();
    let mut kept: Vec<Vec<Rule>> = vec![Vec::new(); links.len()];
    for i in (0..links.len()).rev() {
        let name = &links[i].name;
        let keep = |rows: &[Stays], from: &DMatrix<f64>| -> Vec<Rule> {
            rows.iter()
                .map(|(quantity, column, parts)| {
                    let row = from.row(parts[0].0) * parts[0].1 + from.row(parts[1].0) * parts[1].1;
                    let terms = row.iter().enumerate().filter(|(_, w)| **w != 0.0).map(|(c, w)| (c, *w));
                    Rule {
                        name: format!("{name}.{quantity}"),
                        column: 10 * i + column,
                        primed: quantity.contains('\''),
                        terms: terms.collect(),
                    }
                })
                .collect()
        };
        let plain = |k: usize| (NAMES[k].to_owned(), k, [(k, 1.0), (k, 0.0)]);
        let own = &carried[i];
        let joint = if i == 0 { Joint::Free } else { links[i].link.joint };
        // φ that goes on, as a map of the link's φ.
        let mut passes = ParameterMap::zeros();
        kept[i] = match joint {
            Joint::Fixed => {
                passes.fill_with_identity();
                Vec::new()
            }
            Joint::Free => keep(&std::array::from_fn::<_, 10, _>(plain), own),
            Joint::Spherical | Joint::Universal(..) => {
                passes[(M, M)] = 1.0;
                keep(&std::array::from_fn::<_, 9, _>(|k| plain(k + 1)), own)
            }
            Joint::Prismatic(_) => {
                for k in 4..10 {
                    passes[(k, k)] = 1.0;
                }
                keep(&std::array::from_fn::<_, 4, _>(plain), own)
            }
            Joint::Revolute(axis) => {
                let (frame, primed) = joint_frame(&axis);
                let to_link = map_to_parent(&frame, &Vector3::zeros());
                let to_joint = map_to_parent(&frame.transpose(), &Vector3::zeros());
                // In the joint's frame: M, MSz, and Jyy diag(1, 1, 0).
                let mut split = ParameterMap::zeros();
                split[(M, M)] = 1.0;
                split[(3, 3)] = 1.0;
                split[(4, 5)] = 1.0;
                split[(5, 5)] = 1.0;
                passes = to_link * split * to_joint;
                let turned = DMatrix::from_iterator(10, 10, to_joint.iter().copied()) * own;
                keep(&revolute_names(&frame, primed), &turned)
            }
        };
        if i > 0 {
            let link = &links[i].link;
            let up = map_to_parent(&link.rotation, &link.position) * passes;
            let share = DMatrix::from_iterator(10, 10, up.iter().copied()) * &carried[i];
            carried[link.parent] += share;
        }
    }
    kept.into_iter().flatten().collect()
}

/// Axes whose z is the joint's, as columns in link axes, and whether they are others than the link's.
fn joint_frame(axis: &Vector3<f64>) -> (Matrix3<f64>, bool) {
    let along = axis.iamax();
    let rest: f64 = (0..3).filter(|k| *k != along).map(|k| axis[k].abs()).sum();
    if rest < 1e-9 {
        // x y z in a circle; the sign of the axis does not matter.
        let unit = |k: usize| Vector3::ith(k % 3, 1.0);
        return (Matrix3::from_columns(&[unit(along + 1), unit(along + 2), unit(along)]), false);
    }
    let y = axis.cross(&Vector3::ith((along + 1) % 3, 1.0)).normalize();
    (Matrix3::from_columns(&[y.cross(axis), y, *axis]), true)
}

/// Names, columns that represent them, and rows in the joint's frame of the seven that stay.
fn revolute_names(frame: &Matrix3<f64>, primed: bool) -> [Stays; 7] {
    // Which of the link's axes is nearest to each of the frame's; where the frame is the link's, exactly it.
    let near: [usize; 3] = {
        let z = frame.column(2).iamax();
        [(z + 1) % 3, (z + 2) % 3, z]
    };
    let one = |in_frame: usize| {
        let (i, k) = match in_frame {
            1..=3 => (in_frame - 1, in_frame - 1),
            4..=6 => (in_frame - 4, in_frame - 4),
            7 => (1, 2),
            8 => (2, 0),
            _ => (0, 1),
        };
        if in_frame < 4 { 1 + near[i] } else { tensor(near[i], near[k]) }
    };
    let mark = if primed { "'" } else { "" };
    let name = |k: usize| {
        let k = if primed { k } else { one(k) };
        format!("{}{mark}", NAMES[k])
    };
    let plain = |k: usize| (name(k), one(k), [(k, 1.0), (k, 0.0)]);
    [
        plain(1),
        plain(2),
        (format!("{}-{}", name(4), name(5)), one(4), [(4, 1.0), (5, -1.0)]),
        plain(6),
        plain(7),
        plain(8),
        plain(9),
    ]
}
