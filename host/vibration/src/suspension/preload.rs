//! The load of springs at rest, and the stiffness that it has in every direction.
//!
//! At rest the springs carry the weight by forces f at their places a about O. The forces are linear in the
//! loads `1` (what is stated as preload), `W = g m`, `Mx = g ms_y` and `My = −g ms_x`: of all that balance
//! these, the ones of least energy `Σ f K⁻¹ f / 2`. A spring that is free to turn at its ends pulls along its
//! axis, so that its stiffness across counts almost nothing there; a clamped one carries shear as it yields
//! to it. A force keeps its direction while its place turns with the platform, and weight acts at the centre
//! of mass, so about O
//! ```text
//! K_g = Σ [(a·f) 1 − a fᵀ] − g ms_z 1 + g ms ẑᵀ                     turns (symmetric, as moments balance)
//!     + Σ (t/L) Jᵀ (1 − n nᵀ) J                                      springs of length L that pull along n
//!     + Σ (P/2) Jᵀ [0, [n]×; −[n]×, 0] J                              clamped ones that push by P: both ends
//!                                                                     bear half of the moment F L + P δ
//! ```
//! Sources: H. M. Irvine, Cable Structures, 1981 (tension over length); S. Timoshenko, J. Gere, Theory of
//! Elastic Stability, 1961 (sway of clamped columns).

use nalgebra::{Matrix3, Matrix3x6, Matrix6, Vector3, Vector6};

use super::springs::{Displacement, free};
use rigident_fit::{Basis, Effect, Nuisance, Scope};
use rigident_io::rig::{SpringTable, SuspensionTable};

/// Loads: what is stated, W, Mx, My.
const LOADS: usize = 4;
/// Parameters of a body.
const TEN: usize = 10;
/// Share of the stiffness across that bears the weight in springs which are free to turn at their ends.
const FREE_TO_TURN: f64 = 0.01;
/// Least stiffness across by that along, so that there is one.
const LEAST_ACROSS: f64 = 0.01;
/// Share of its stiffness that bears what is not in balance in a spring whose pull is stated.
const NO_SHARE: f64 = 1e-6;
/// Stiffness of what no spring holds, by the largest.
const HELD: f64 = 1e-10;
/// 1 σ of the share of the way between free and clamped ends, where nothing is stated of them.
const ENDS_STD: f64 = 0.5;
/// Springs whose weight has more stiffness than this share of their distance, beside that of its height,
/// lean.
const LEANS: f64 = 0.02;
/// A stiffness that changes by less, relative to that of the arms, does not change.
const SAME: f64 = 1e-9;

/// The response of a spring to its load.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ends {
    /// A force of constant direction: what it does across is stated.
    Stated,
    /// The spring turns about a far end at this distance, m; negative if that is where the axis comes from.
    Hooked(f64),
    /// Both ends keep their direction.
    Clamped,
}

/// A place at which weight is carried.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Carrier {
    /// The place against O, m.
    arm: Vector3<f64>,
    axis: Vector3<f64>,
    ends: Ends,
    /// Force for a unit of each load.
    forces: [Vector3<f64>; LOADS],
}

/// The forces that carry the weight.
#[derive(Clone, Debug, PartialEq)]
pub struct Preload {
    carriers: Vec<Carrier>,
    /// The carriers if springs of which no ends are stated are clamped.
    clamped: Vec<Carrier>,
    gravity_mps2: f64,
    /// True if it matters whether ends of which nothing is stated are clamped.
    pub(super) has_unknown_ends: bool,
}

impl Preload {
    /// Returns the forces of the springs of a rig file; of a matrix alone, one at the height of the anchors.
    pub fn new(table: &SuspensionTable, gravity_mps2: f64) -> Self {
        let free = free(&table.locked);
        if table.spring.is_empty() {
            let height = if free.contains(&2) { table.anchor_height_m.unwrap_or(0.0) } else { 0.0 };
            let carriers = upright(height);
            return Self { clamped: carriers.clone(), carriers, gravity_mps2, has_unknown_ends: false };
        }
        let of = |is_clamped: bool| carried(table, &free, is_clamped);
        let own = Self { carriers: of(false), clamped: of(true), gravity_mps2, has_unknown_ends: false };
        Self { has_unknown_ends: own.depends_on_ends(), ..own }
    }

    /// Returns whether clamped instead of free ends change the stiffness under any weight.
    fn depends_on_ends(&self) -> bool {
        let scale: f64 = self.carriers.iter().map(|own| own.arm.norm() + 1e-3).sum();
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].iter().any(|first| {
            let mut ten = [0.0; TEN];
            ten[..3].copy_from_slice(first);
            self.error_stiffness(&ten).amax() > SAME * self.gravity_mps2 * scale
        })
    }

    /// Returns whether the weight does more than a force of one height would.
    pub fn is_more_than_a_height(&self) -> bool {
        let at_height = Matrix6::from_diagonal(&Vector6::new(0.0, 0.0, 0.0, 1.0, 1.0, 0.0)) * self.height_m();
        let for_load = |load: usize| -> Matrix6<f64> {
            self.carriers.iter().map(|own| own.stiffness(&own.forces[load])).sum()
        };
        let arm = self.carriers.iter().map(|own| own.arm.norm()).fold(0.0, f64::max);
        let stated = for_load(0).amax() > SAME;
        stated || ((for_load(1) + for_load(1).transpose()) * 0.5 - at_height).amax() > LEANS * arm.max(1e-3)
    }

    /// Returns the height above O at which the weight is carried, m.
    pub fn height_m(&self) -> f64 {
        height(&self.carriers)
    }

    /// Returns what the weight of ten parameters about O adds to the stiffness about O.
    pub fn stiffness(&self, ten: &[f64; TEN]) -> Matrix6<f64> {
        self.of_loads(&self.carriers, ten) + self.of_weight(ten)
    }

    /// Returns the same for a unit of each of the ten parameters, and what is there without them.
    pub fn stiffnesses(&self) -> ([Matrix6<f64>; TEN], Matrix6<f64>) {
        let none = self.stiffness(&[0.0; TEN]);
        let unit = |k: usize| self.stiffness(&std::array::from_fn(|j| f64::from(u8::from(j == k)))) - none;
        (std::array::from_fn(|k| if k < 4 { unit(k) } else { Matrix6::zeros() }), none)
    }

    fn of_loads(&self, carriers: &[Carrier], ten: &[f64; TEN]) -> Matrix6<f64> {
        let g = self.gravity_mps2;
        let loads = [1.0, g * ten[0], g * ten[2], -g * ten[1]];
        let all: Matrix6<f64> = carriers.iter().map(|own| own.stiffness(&own.force(&loads))).sum();
        (all + all.transpose()) * 0.5
    }

    /// Returns what weight alone, which acts at the centre of mass, adds to the stiffness about O.
    pub(super) fn of_weight(&self, ten: &[f64; TEN]) -> Matrix6<f64> {
        let moment = Vector3::new(ten[1], ten[2], ten[3]);
        let turns = (moment * Vector3::z().transpose() - Matrix3::identity() * moment.z) * self.gravity_mps2;
        let mut all = Matrix6::zeros();
        all.fixed_view_mut::<3, 3>(3, 3).copy_from(&((turns + turns.transpose()) * 0.5));
        all
    }

    /// Returns the wrench on the platform about O for these loads: the stated preload, W (N), Mx and My (N
    /// m).
    pub fn wrench(&self, at: &Displacement, loads: &[f64; LOADS]) -> Vector6<f64> {
        self.carriers.iter().map(|own| own.wrench(at, &own.force(loads))).sum()
    }

    /// Returns what is not known of the forces, numbered from `first`.
    pub fn nuisances(&self, first: usize) -> Vec<Nuisance> {
        let nuisance = Nuisance {
            name: "clamped_ends".to_owned(),
            group: "preload".to_owned(),
            unit: String::new(),
            sigma: ENDS_STD,
            basis: Basis::Class("ends of springs that are not stated".to_owned()),
            scope: Scope::Rig,
            effect: Effect::Signal(first),
        };
        if self.has_unknown_ends { vec![nuisance] } else { Vec::new() }
    }

    /// Returns what clamped instead of free ends change in the stiffness about O.
    pub fn error_stiffness(&self, ten: &[f64; TEN]) -> Matrix6<f64> {
        self.of_loads(&self.clamped, ten) - self.of_loads(&self.carriers, ten)
    }

    /// Returns what clamped instead of free ends change in the wrench for these loads.
    pub fn error_wrench(&self, at: &Displacement, loads: &[f64; LOADS]) -> Vector6<f64> {
        let other: Vector6<f64> = self.clamped.iter().map(|own| own.wrench(at, &own.force(loads))).sum();
        other - self.wrench(at, loads)
    }
}

/// Returns forces upward at a height, and pairs of them for the moments.
fn upright(height_m: f64) -> Vec<Carrier> {
    let at = |arm: Vector3<f64>, load: usize, force: f64| {
        let mut forces = [Vector3::zeros(); LOADS];
        forces[load] = Vector3::z() * force;
        Carrier { arm, axis: Vector3::z(), ends: Ends::Stated, forces }
    };
    let o = Vector3::zeros();
    vec![
        at(Vector3::z() * height_m, 1, 1.0),
        at(Vector3::y(), 2, 1.0),
        at(o, 2, -1.0),
        at(-Vector3::x(), 3, 1.0),
        at(o, 3, -1.0),
    ]
}

/// Returns the height above O of the forces for a unit of W.
fn height(carriers: &[Carrier]) -> f64 {
    carriers.iter().map(|own| own.arm.z * own.forces[1].z).sum()
}

/// Returns the springs with their forces for each load.
fn carried(table: &SuspensionTable, free: &[usize], unstated_are_clamped: bool) -> Vec<Carrier> {
    let at = Vector3::from(table.at_m);
    let axis = |own: &SpringTable| Vector3::from(own.axis).normalize();
    let bears = |own: &SpringTable| {
        let n = axis(own);
        let is_clamped = own.clamped || unstated_are_clamped && own.length_m.is_none();
        let stiff = own.lateral_npm.max(LEAST_ACROSS * own.axial_npm);
        if own.pull_n.is_some() {
            return Matrix3::identity() * (NO_SHARE * own.axial_npm);
        }
        let across = if is_clamped { own.lateral_npm } else { FREE_TO_TURN * stiff };
        n * n.transpose() * (own.axial_npm - across) + Matrix3::identity() * across
    };
    let mut all: Vec<(Carrier, Matrix3<f64>)> = table
        .spring
        .iter()
        .map(|own| {
            let n = axis(own);
            let mut forces = [Vector3::zeros(); LOADS];
            let stated = own.pull_n.unwrap_or(own.preload_n);
            forces[0] = n * stated;
            // What pulls the platform is where it pulls to.
            let pulls = if stated == 0.0 { n.z } else { stated };
            let ends = match own.length_m {
                Some(_) if own.clamped => Ends::Clamped,
                Some(length) => Ends::Hooked(if pulls < 0.0 { -length } else { length }),
                None => Ends::Stated,
            };
            (Carrier { arm: Vector3::from(own.at_m) - at, axis: n, ends, forces }, bears(own))
        })
        .collect();
    share(&mut all, free);
    let mut carriers: Vec<Carrier> = all.into_iter().map(|(own, _)| own).collect();
    if let Some(stated) = table.anchor_height_m.filter(|_| free.contains(&2)) {
        let raised = stated - height(&carriers);
        carriers.iter_mut().for_each(|own| own.arm.z += raised);
    }
    carriers
}

/// Adds the forces of least energy that balance what is stated, and a unit of each other load, in the free
/// coordinates.
fn share(all: &mut [(Carrier, Matrix3<f64>)], free: &[usize]) {
    let yields = |all: &[(Carrier, Matrix3<f64>)]| -> Matrix6<f64> {
        all.iter().map(|(own, stiffness)| own.arms().transpose() * stiffness * own.arms()).sum()
    };
    let mut stiffness = yields(all);
    let largest = stiffness.amax();
    for k in (0..6).filter(|k| !free.contains(k)) {
        stiffness.row_mut(k).fill(0.0);
        stiffness.column_mut(k).fill(0.0);
        stiffness[(k, k)] = largest;
    }
    // A pendulum yields without end where no spring holds it; nothing bears a load there.
    let compliance = stiffness + Matrix6::identity() * (HELD * largest);
    let Some(compliance) = compliance.cholesky() else { return };
    let stated: Vector6<f64> = all.iter().map(|(own, _)| own.arms().transpose() * own.forces[0]).sum();
    for load in 0..LOADS {
        let mut wanted = [-stated, Vector6::z(), Vector6::w(), Vector6::a()][load];
        (0..6).filter(|k| !free.contains(k)).for_each(|k| wanted[k] = 0.0);
        let moved = compliance.solve(&wanted);
        for (own, stiffness) in all.iter_mut() {
            let force = *stiffness * own.arms() * moved;
            own.forces[load] += force;
        }
    }
}

impl Carrier {
    fn force(&self, loads: &[f64; LOADS]) -> Vector3<f64> {
        self.forces.iter().zip(loads).map(|(force, load)| force * *load).sum()
    }

    /// Returns the displacement of the place by that of O.
    fn arms(&self) -> Matrix3x6<f64> {
        let mut arms = Matrix3x6::zeros();
        arms.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
        arms.fixed_view_mut::<3, 3>(0, 3).copy_from(&-self.arm.cross_matrix());
        arms
    }

    fn across(&self) -> Matrix3<f64> {
        Matrix3::identity() - self.axis * self.axis.transpose()
    }

    /// Returns what a force of this place does against displacements of O.
    fn stiffness(&self, force: &Vector3<f64>) -> Matrix6<f64> {
        let mut all = Matrix6::zeros();
        let turns = Matrix3::identity() * self.arm.dot(force) - self.arm * force.transpose();
        all.fixed_view_mut::<3, 3>(3, 3).copy_from(&turns);
        let along = self.axis.dot(force);
        let arms = self.arms();
        match self.ends {
            Ends::Stated => {}
            Ends::Hooked(length) => all += arms.transpose() * self.across() * arms * (along / length),
            Ends::Clamped => {
                // F = −(P/2) n × θ, M = (P/2) n × δ
                let half = self.axis.cross_matrix() * (0.5 * along);
                let mut turn = Matrix3x6::zeros();
                turn.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
                let coupling = arms.transpose() * half * turn;
                all += coupling + coupling.transpose();
            }
        }
        all
    }

    fn wrench(&self, at: &Displacement, force: &Vector3<f64>) -> Vector6<f64> {
        let arm = at.rotation * self.arm;
        let shift = at.shift + arm - self.arm;
        let along = self.axis.dot(force);
        let (mut acts, mut moment) = (*force, Vector3::zeros());
        match self.ends {
            Ends::Stated => {}
            Ends::Hooked(length) => acts -= self.across() * shift * (along / length),
            Ends::Clamped => {
                acts -= self.axis.cross(&at.turn()) * (0.5 * along);
                moment = self.axis.cross(&shift) * (0.5 * along);
            }
        }
        moment += arm.cross(&acts);
        Vector6::new(acts.x, acts.y, acts.z, moment.x, moment.y, moment.z)
    }
}

#[cfg(test)]
#[path = "preload_tests.rs"]
mod tests;
