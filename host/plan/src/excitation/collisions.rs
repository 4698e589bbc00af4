//! The parts that must stay apart: boxes round the links from each other, and from a floor.

use rigident_shared::tree::{Joint, LinkState};

use nalgebra::Vector3;

use super::boxes::BodyBox;
use super::oriented_box::{PlacedBox, separation};
use rigident_model::Model;
use rigident_model::rows::Moving;

/// Distance at which a pair begins to be kept apart, as a share of the robot's reach.
const NEAR: f64 = 0.1;

/// The data stored, beside boxes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// Least distance of boxes, and of a box from the floor, m.
    pub clearance_m: f64,
    /// Height of the floor along z of the base's frame, m.
    pub floor_m: Option<f64>,
}

/// Two boxes, or a box and the floor.
#[derive(Clone, Debug, PartialEq)]
pub struct Nearest {
    /// Lower bound of the distance, m; negative if they overlap.
    pub distance_m: f64,
    /// The links; `floor` for the floor.
    pub between: [String; 2],
}

/// The pairs that are examined.
#[derive(Clone, Debug)]
pub struct Collisions {
    boxes: Vec<BodyBox>,
    pairs: Vec<(usize, usize)>,
    /// Pairs of links that touch in a pose that is known to be free.
    left_out: Vec<[String; 2]>,
    apart: Apart,
    near_m: f64,
    /// Joints between the base and each body.
    paths: Vec<Vec<usize>>,
}

impl Collisions {
    /// Returns what is examined: boxes of bodies that are not joined to each other, but for pairs named in
    /// `skipped` and those that are nearer than the clearance in one of the poses `free`, whose boxes are too
    /// large then. `model` has no fixed joints.
    pub fn new(
        model: &Model,
        paths: &[Vec<usize>],
        (boxes, skipped): (Vec<BodyBox>, &[[String; 2]]),
        apart: Apart,
        free: &[Vec<LinkState<f64>>],
    ) -> Self {
        // Links that are no bodies are only between joints.
        let holder = |body: usize| {
            let mut at = model.links[body].link.parent;
            while at != 0 && !model.links[at].is_body() {
                at = model.links[at].link.parent;
            }
            at
        };
        let joined = |a: usize, b: usize| a == b || (b != 0 && holder(b) == a) || (a != 0 && holder(a) == b);
        let named = |a: &BodyBox, b: &BodyBox| {
            skipped.iter().any(|[c, d]| (*c == a.link && *d == b.link) || (*c == b.link && *d == a.link))
        };
        let mut from_base = vec![0.0_f64; model.links.len()];
        for (i, link) in model.links.iter().enumerate().skip(1) {
            from_base[i] = from_base[link.link.parent] + link.link.position.norm();
        }
        let mut all = Self {
            pairs: Vec::new(),
            left_out: Vec::new(),
            apart,
            near_m: NEAR * from_base.iter().fold(0.0, |most, v| v.max(most)).max(f64::MIN_POSITIVE),
            paths: paths.to_vec(),
            boxes,
        };
        for a in 0..all.boxes.len() {
            for b in a + 1..all.boxes.len() {
                let (first, second) = (&all.boxes[a], &all.boxes[b]);
                if !joined(first.body, second.body) && !named(first, second) {
                    all.pairs.push((a, b));
                }
            }
        }
        for states in free {
            let placed = all.placed(states);
            for (a, b) in &all.pairs {
                if separation(&placed[*a], &placed[*b]).gap < apart.clearance_m {
                    let pair = [all.boxes[*a].link.clone(), all.boxes[*b].link.clone()];
                    if !all.left_out.contains(&pair) {
                        all.left_out.push(pair);
                    }
                }
            }
        }
        let left_out = std::mem::take(&mut all.left_out);
        let is_out =
            |a: usize, b: usize| left_out.contains(&[all.boxes[a].link.clone(), all.boxes[b].link.clone()]);
        let pairs = all.pairs.iter().copied().filter(|(a, b)| !is_out(*a, *b)).collect();
        Self { pairs, left_out, ..all }
    }

    /// Returns the pairs of links that touch in a pose that is free, and are not examined.
    pub fn left_out(&self) -> &[[String; 2]] {
        &self.left_out
    }

    /// Returns the number of pairs of boxes that are examined.
    pub fn pairs(&self) -> usize {
        self.pairs.len()
    }

    /// Returns the distance beyond the clearance at which a pair begins to be kept apart, m.
    pub fn near_m(&self) -> f64 {
        self.near_m
    }

    /// Returns what was asked for.
    pub fn apart(&self) -> Apart {
        self.apart
    }

    fn placed(&self, states: &[LinkState<f64>]) -> Vec<PlacedBox> {
        let place = |own: &BodyBox| {
            let state = states.get(own.body).copied().unwrap_or_else(LinkState::zero);
            PlacedBox {
                axes: state.rotation * own.rotation,
                centre: state.position + state.rotation * own.centre,
                half: own.half,
            }
        };
        self.boxes.iter().map(place).collect()
    }

    /// Returns the two that are nearest to each other; `None` where nothing is examined.
    pub fn nearest(&self, states: &[LinkState<f64>]) -> Option<Nearest> {
        let placed = self.placed(states);
        let mut best: Option<(f64, usize, Option<usize>)> = None;
        let mut look = |gap: f64, a: usize, b: Option<usize>| {
            if best.is_none_or(|(least, ..)| gap < least) {
                best = Some((gap, a, b));
            }
        };
        for (a, b) in &self.pairs {
            look(separation(&placed[*a], &placed[*b]).gap, *a, Some(*b));
        }
        if let Some(floor) = self.apart.floor_m {
            let down = -Vector3::z();
            for (a, own) in placed.iter().enumerate().filter(|(a, _)| self.boxes[*a].body != 0) {
                look(own.support(&down).z - floor, a, None);
            }
        }
        let (distance_m, a, b) = best?;
        let other = b.map_or_else(|| "floor".to_owned(), |b| self.boxes[b].link.clone());
        Some(Nearest { distance_m, between: [self.boxes[a].link.clone(), other] })
    }

    /// Adds what grows beyond all bounds as a pair comes as near as the clearance, and its slopes by the
    /// joints' positions; `None` if it is nearer. It is `−(1 − x)² ln x` of `x`, the distance beyond the
    /// clearance over that at which a pair counts as near.
    pub(super) fn barrier(&self, moving: &Moving, sum: &mut f64, worth: &mut [f64]) -> Option<()> {
        let placed = self.placed(moving.states());
        let mut wall = |gap: f64| {
            let x = (gap - self.apart.clearance_m) / self.near_m;
            if x >= 1.0 {
                return Some(0.0);
            }
            if x.is_nan() || x <= 0.0 {
                return None;
            }
            *sum -= (1.0 - x).powi(2) * x.ln();
            Some((2.0 * (1.0 - x) * x.ln() - (1.0 - x).powi(2) / x) / self.near_m)
        };
        for (a, b) in &self.pairs {
            let (first, second) = (&placed[*a], &placed[*b]);
            let far = self.apart.clearance_m + self.near_m + first.half.norm() + second.half.norm();
            if (second.centre - first.centre).norm_squared() > far * far {
                continue;
            }
            let found = separation(first, second);
            let slope = wall(found.gap)?;
            if slope == 0.0 {
                continue;
            }
            let [way, other] = [*a, *b].map(|own| &self.paths[self.boxes[own].body]);
            for (own, others, is_second) in [(way, other, false), (other, way, true)] {
                // What moves both moves neither against the other.
                for k in own.iter().filter(|k| !others.contains(k)) {
                    let (rate, velocity) = twist(moving, *k);
                    worth[*k] += slope * found.change(is_second, &rate, &velocity);
                }
            }
        }
        let Some(floor) = self.apart.floor_m else { return Some(()) };
        let down = -Vector3::z();
        for (a, own) in placed.iter().enumerate().filter(|(a, _)| self.boxes[*a].body != 0) {
            let corner = own.support(&down);
            let slope = wall(corner.z - floor)?;
            for k in self.paths[self.boxes[a].body].iter().filter(|_| slope != 0.0) {
                let (rate, velocity) = twist(moving, *k);
                worth[*k] += slope * (velocity + rate.cross(&corner)).z;
            }
        }
        Some(())
    }
}

/// Returns how everything beyond joint `k` moves at a rate of one: angular rate, and velocity of the point at
/// the base's origin, base axes.
fn twist(moving: &Moving, k: usize) -> (Vector3<f64>, Vector3<f64>) {
    let zero = Vector3::zeros();
    let (Some(link), Some(state)) = (moving.links().get(k + 1), moving.states().get(k + 1)) else {
        return (zero, zero);
    };
    match link.joint {
        Joint::Revolute(axis) => {
            let rate = state.rotation * axis;
            (rate, -rate.cross(&state.position))
        }
        Joint::Prismatic(axis) => (zero, state.rotation * axis),
        _ => (zero, zero),
    }
}
