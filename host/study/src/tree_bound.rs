//! The Cramér–Rao bound of a tree's parameters, with the noise of all its signals.

use nalgebra::{Cholesky, DMatrix, Matrix3, MatrixXx3, UnitQuaternion, Vector3};
use rigident_shared::tree::Joint;

use super::banded::{Banded, Coefficients};
use super::tree_experiment::TreeExperiment;
use rigident_laboratory::trees::TreeInstant;
use rigident_model::Model;
use rigident_model::base::BaseParameters;
use rigident_model::dynamics::inverse_dynamics;

/// Step of differences by angles, rad.
const STEP: f64 = 1e-6;

/// Returns the Cramér–Rao bound of base parameters and offsets, 1 σ; `None` if the motion leaves something
/// undetermined.
///
/// `J⁻¹` with `J = aᵀ C⁻¹ a` over every sample. Forces are linear in the standard parameters, `w = Y φ`, the
/// columns of Y being forces of unit bodies by Newton and Euler. With `β = M φ` and `M_L` the columns of M of
/// those that represent β, `w = Y_L M_L⁻¹ β`. The motion is known through the signals alone: C is the
/// covariance of the noise of load cell or torques and of what noise of the signals moves the forces by, to
/// first order. Accelerations are central differences of rates, or of positions where these alone are
/// measured, so that C is banded.
pub(super) fn bound(model: &Model, base: &BaseParameters, experiment: &TreeExperiment) -> Option<Vec<f64>> {
    let map = base.map();
    let skip = 10 * model.links.len() - base.standard.len();
    let leads: Vec<usize> = base.parameters.iter().filter_map(|p| Some(p.terms.first()?.0)).collect();
    let count = leads.len();
    let mix = map.select_columns(&leads).try_inverse()?;
    // Mechanics by centre of mass and tensor about it know no massless body: what a parameter adds to a
    // kilogram.
    let bodies = |lead: &usize| {
        let (own, mass) = (skip + lead, (skip + lead) / 10 * 10);
        (unit_body(model, own), (own != mass).then(|| unit_body(model, mass)))
    };
    let units: Vec<(Model, Option<Model>)> = leads.iter().map(bodies).collect();
    let way = Way { model, experiment };
    let own = way.own_sigma();
    let channels = own.len();
    let offsets = if experiment.has_torques { 0 } else { channels };
    let columns = count + offsets;
    let variance = DMatrix::from_fn(channels, channels, |i, j| if i == j { own[i] * own[i] } else { 0.0 });
    let mut banded = Banded::new(variance);
    let mut information = DMatrix::<f64>::zeros(columns, columns);
    for k in 0..experiment.samples() {
        let now = experiment.instant(model, k as f64);
        let mut made = DMatrix::zeros(channels, count);
        for (mut column, (own, mass)) in made.column_iter_mut().zip(&units) {
            let mut forces = way.forces(own, &now)?;
            if let Some(mass) = mass {
                let of_mass = way.forces(mass, &now)?;
                forces.iter_mut().zip(of_mass).for_each(|(own, mass)| *own -= mass);
            }
            column.copy_from_slice(&forces);
        }
        let mut rows = DMatrix::zeros(channels, columns);
        rows.columns_mut(0, count).copy_from(&(made * &mix));
        rows.columns_mut(count, offsets).fill_with_identity();
        let white = banded.next(way.coefficients(k as f64, &now)?, rows)?;
        information += white.tr_mul(&white);
    }
    // Units differ by orders of magnitude: a unit diagonal leaves the inverse its digits.
    let scale = information.diagonal().map(|d| 1.0 / d.sqrt());
    let scaled = DMatrix::from_fn(columns, columns, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = Cholesky::new(scaled)?.inverse();
    Some((0..columns).map(|j| inverse[(j, j)].sqrt() * scale[j]).collect())
}

/// Returns the same tree with a body of one link alone: of a kilogram, and with one standard parameter more
/// if `parameter` is not the link's mass.
fn unit_body(model: &Model, parameter: usize) -> Model {
    let mut unit = model.clone();
    for (i, link) in unit.links.iter_mut().enumerate() {
        let is_one = |k: usize| k == 0 || 10 * i + k == parameter;
        let own = || std::array::from_fn(|k| if is_one(k) { 1.0 } else { 0.0 });
        link.nominal = (i == parameter / 10).then(own);
    }
    unit
}

/// The way of noise from the signals to the forces. Signals have unit variance here.
struct Way<'a> {
    model: &'a Model,
    experiment: &'a TreeExperiment,
}

impl Way<'_> {
    /// Returns the standard deviations of the channels' own noise.
    fn own_sigma(&self) -> Vec<f64> {
        let noise = &self.experiment.noise;
        if self.experiment.has_torques { vec![noise.torque; self.freedoms()] } else { noise.wrench.to_vec() }
    }

    fn freedoms(&self) -> usize {
        self.model.links.iter().skip(1).map(|link| link.link.joint.freedoms()).sum()
    }

    fn forces(&self, bodies: &Model, now: &TreeInstant) -> Option<Vec<f64>> {
        let mut all = inverse_dynamics(bodies, &now.base, &now.positions, &now.rates, &now.accelerations)?;
        let joints = all.split_off(6);
        Some(if self.experiment.has_torques { joints } else { all })
    }

    /// Returns how the forces change with something: central differences, exact of what is quadratic.
    fn change(
        &self,
        now: &TreeInstant,
        count: usize,
        step: f64,
        vary: impl Fn(&mut TreeInstant, usize, f64),
    ) -> Option<DMatrix<f64>> {
        let mut columns = Vec::new();
        for k in 0..count {
            let of = |step: f64| {
                let mut varied = now.clone();
                vary(&mut varied, k, step);
                self.forces(self.model, &varied)
            };
            let (more, less) = (of(step)?, of(-step)?);
            columns.extend(more.iter().zip(&less).map(|(more, less)| (more - less) / (2.0 * step)));
        }
        Some(DMatrix::from_vec(columns.len() / count.max(1), count, columns))
    }

    fn coefficients(&self, k: f64, now: &TreeInstant) -> Option<Coefficients> {
        let freedoms = self.freedoms();
        let of_rates =
            self.change(now, 3 + freedoms, 1.0, |at, k, step| match at.rates.get_mut(k.wrapping_sub(3)) {
                Some(rate) => *rate += step,
                None => at.base.rate[k] += step,
            })?;
        let of_accelerations = self.change(now, 3 + freedoms, 1.0, |at, k, step| {
            match at.accelerations.get_mut(k.wrapping_sub(3)) {
                Some(acceleration) => *acceleration += step,
                None => at.base.angular_acceleration[k] += step,
            }
        })?;
        let of_positions =
            self.change(now, freedoms, STEP, |at, k, step| self.turn(&mut at.positions, k, step))?;
        let of_force = self.change(now, 3, 1.0, |at, k, step| at.base.specific_force[k] += step)?;
        let beside = |lag: f64| self.experiment.instant(self.model, k + lag);
        let half = 0.5 * self.experiment.rate_hz;
        let mut all = Coefficients {
            before: -&of_accelerations * self.rates(&beside(-1.0)) * half,
            now: of_force * self.force()
                + of_rates.clone() * self.rates(now)
                + &of_positions * self.positions(now),
            after: &of_accelerations * self.rates(&beside(1.0)) * half,
        };
        if self.experiment.has_torques && !self.experiment.has_rates {
            let positions = self.positions(now);
            let first = of_rates.columns(3, freedoms) * &positions * half;
            let second = of_accelerations.columns(3, freedoms) * &positions * self.experiment.rate_hz.powi(2);
            all.before += &second - &first;
            all.now -= &second * 2.0;
            all.after += second + first;
        }
        Some(all)
    }

    /// Turns a freedom by a small angle.
    fn turn(&self, positions: &mut [f64], freedom: usize, angle: f64) {
        let (mut q, mut v) = (0, 0);
        for link in self.model.links.iter().skip(1) {
            let joint = &link.link.joint;
            let (at, own) = (q, freedom.wrapping_sub(v));
            (q, v) = (q + joint.coordinates(), v + joint.freedoms());
            if own >= joint.freedoms() {
                continue;
            }
            if let (Joint::Spherical, Some([w, x, y, z])) = (joint, positions.get_mut(at..at + 4)) {
                let before = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(*w, *x, *y, *z));
                let turned = before * UnitQuaternion::from_scaled_axis(Vector3::ith(own, angle));
                [*w, *x, *y, *z] = [turned.w, turned.i, turned.j, turned.k];
            } else if let Some(position) = positions.get_mut(at) {
                *position += angle;
            }
        }
    }

    /// Returns the number of signals: accelerometer and gyros, then attitudes; or rates, then positions of
    /// joints.
    fn signals(&self) -> usize {
        if self.experiment.has_torques { 2 * self.freedoms() } else { 3 + 6 * self.model.links.len() }
    }

    /// Returns what the signals' noise adds to the specific force, 3 × S.
    fn force(&self) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(3, self.signals());
        if !self.experiment.has_torques {
            out.view_mut((0, 0), (3, 3)).fill_diagonal(self.experiment.noise.accel);
        }
        out
    }

    /// Returns what it adds to the base's rate and to the joints', (3 + F) × S.
    fn rates(&self, now: &TreeInstant) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(3 + self.freedoms(), self.signals());
        let noise = &self.experiment.noise;
        if self.experiment.has_torques {
            if self.experiment.has_rates {
                out.view_mut((3, 0), (self.freedoms(), self.freedoms())).fill_diagonal(noise.rate);
            }
            return out;
        }
        out.view_mut((0, 3), (3, 3)).fill_diagonal(noise.gyro);
        self.of_links(now, &mut out, 3, |out, own, before, carried, relative| {
            // The link's rate less its parent's, in the link's axes: A_iᵀ A_p ω_p.
            let w = relative * before.rate;
            let (gyro, attitude) = (noise.gyro, noise.attitude);
            add(out, own.gyro, &(carried * gyro));
            add(out, before.gyro, &(-carried * relative * gyro));
            add(out, own.attitude, &(-carried * w.cross_matrix() * attitude));
            add(out, before.attitude, &(carried * relative * before.rate.cross_matrix() * attitude));
        });
        out
    }

    /// Returns what it turns the joints by, F × S.
    fn positions(&self, now: &TreeInstant) -> DMatrix<f64> {
        let freedoms = self.freedoms();
        let mut out = DMatrix::zeros(freedoms, self.signals());
        let noise = &self.experiment.noise;
        if self.experiment.has_torques {
            out.view_mut((0, freedoms), (freedoms, freedoms)).fill_diagonal(noise.position);
            return out;
        }
        self.of_links(now, &mut out, 0, |out, own, before, carried, relative| {
            add(out, own.attitude, &(carried * noise.attitude));
            add(out, before.attitude, &(-carried * relative * noise.attitude));
        });
        out
    }

    /// Visits every joint with the rows of its freedoms, F_i × S: the signals of its link and of the parent,
    /// the freedoms' directions, F_i × 3, and the rotation link axes ← parent axes.
    fn of_links(
        &self,
        now: &TreeInstant,
        out: &mut DMatrix<f64>,
        first: usize,
        visit: impl Fn(&mut DMatrix<f64>, &Signals, &Signals, &MatrixXx3<f64>, &Matrix3<f64>),
    ) {
        let links = self.model.links.len();
        let signals = |i: usize| Signals {
            gyro: 3 + 3 * i,
            attitude: 3 + 3 * links + 3 * i,
            rate: now.links.get(i).map_or_else(Vector3::zeros, |link| link.1),
        };
        let mut at = first;
        for (i, link) in self.model.links.iter().enumerate().skip(1) {
            let parent = link.link.parent;
            let (Some(own), Some(before)) = (now.links.get(i), now.links.get(parent)) else { continue };
            let carried = match &link.link.joint {
                Joint::Revolute(axis) => MatrixXx3::from_row_slice(axis.as_slice()),
                _ => MatrixXx3::identity(3),
            };
            let mut rows = DMatrix::zeros(carried.nrows(), out.ncols());
            visit(&mut rows, &signals(i), &signals(parent), &carried, &(own.0.transpose() * before.0));
            // The base's attitude is what others are relative to.
            if parent == 0 {
                rows.columns_mut(signals(0).attitude, 3).fill(0.0);
            }
            out.rows_mut(at, rows.nrows()).copy_from(&rows);
            at += rows.nrows();
        }
    }
}

/// The places of the signals of a link, and its rate.
struct Signals {
    gyro: usize,
    attitude: usize,
    rate: Vector3<f64>,
}

fn add(out: &mut DMatrix<f64>, column: usize, part: &MatrixXx3<f64>) {
    let mut to = out.columns_mut(column, 3);
    to += part;
}
