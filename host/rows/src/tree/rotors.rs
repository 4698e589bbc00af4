//! Rotors whose inertia no motion tells from that of the links: they are parts of base parameters.
//!
//! Behind a gear a rotor adds its inertia times the joint's acceleration to the joint's effort. The moment of
//! inertia of a link about a first, fixed axis does the same, and where axes are at right angles that of the
//! second does, too: only their sum has a column. Which rotors are such is found from random motions, as base
//! parameters are.

use nalgebra::{DMatrix, DVector};
use rigident_shared::tree::{BaseMotion, TreeError};

use super::Input;
use super::drive::{Drive, Term};
use rigident_model::base::BaseParameters;
use rigident_model::rows::Moving;

/// A column is a combination of others if they leave less than this share of its length.
const SAME: f64 = 1e-9;
/// Weights below this share of the largest are rounding.
const ROUNDING: f64 = 1e-8;
/// Random motions for each base parameter.
const MOTIONS: usize = 2;

/// Takes rotors that occur only together with base parameters from the drives into these.
///
/// # Errors
/// [`TreeError`] if the links are in no order.
pub(super) fn regroup(input: &mut Input, base: &mut BaseParameters) -> Result<(), TreeError> {
    let has_rotor = |drive: &Drive| drive.terms.contains(&Term::Rotor);
    let links = &input.model.links;
    let turn = links.iter().skip(1).all(|l| l.link.joint.coordinates() == l.link.joint.freedoms());
    if !turn || !input.has_efforts() || input.is_static || !input.drives.iter().any(has_rotor) {
        return Ok(());
    }
    let mut moving = Moving::new(input.model.tree())?;
    let (freedoms, stride, count) = (moving.freedoms(), moving.columns(), base.parameters.len());
    let skip = stride - base.standard.len();
    let leads: Vec<usize> = base.parameters.iter().filter_map(|p| Some(p.terms.first()?.0)).collect();
    let motions = MOTIONS * count + 1;
    let first = input.first_effort();
    let channels = first + freedoms;
    let mut rows = DMatrix::zeros(motions * channels, count);
    let mut changes = DMatrix::zeros(motions, freedoms);
    let mut number = numbers();
    for motion in 0..motions {
        let mut several = |size: f64| (0..freedoms).map(|_| size * number()).collect::<Vec<f64>>();
        let (q, v, dv) = (several(3.0), several(2.0), several(3.0));
        let mut base = BaseMotion::still([0.0, 0.0, -9.8]);
        if input.situation.floating {
            base.specific_force += nalgebra::Vector3::from_fn(|_, _| 5.0 * number());
            base.rate += nalgebra::Vector3::from_fn(|_, _| number());
            base.angular_acceleration += nalgebra::Vector3::from_fn(|_, _| 2.0 * number());
        }
        moving.set(&q, &v, &dv, &base)?;
        let wrench = if first > 0 { moving.base_rows()?.to_vec() } else { Vec::new() };
        let all: Vec<f64> = wrench.iter().chain(moving.joint_rows()?).copied().collect();
        for (c, row) in all.chunks_exact(stride).enumerate() {
            for (j, lead) in leads.iter().enumerate() {
                rows[(motion * channels + c, j)] = row.get(lead + skip).copied().unwrap_or(0.0);
            }
        }
        dv.iter().enumerate().for_each(|(k, value)| changes[(motion, k)] = *value);
    }
    let lengths: Vec<f64> = rows.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    let scaled = DMatrix::from_fn(rows.nrows(), count, |i, j| rows[(i, j)] / lengths[j]);
    let qr = scaled.clone().qr();
    let map = base.map();
    for drive in input.drives.iter_mut().filter(|drive| has_rotor(drive)) {
        let mut column = DVector::zeros(rows.nrows());
        for motion in 0..motions {
            let change: f64 = drive.rates.iter().map(|(k, factor)| factor * changes[(motion, *k)]).sum();
            drive
                .rates
                .iter()
                .for_each(|(k, factor)| column[motion * channels + first + k] = factor * change);
        }
        let Some(weights) = qr.r().solve_upper_triangular(&(qr.q().tr_mul(&column))) else { continue };
        if (&scaled * &weights - &column).norm() > SAME * column.norm() {
            continue;
        }
        let own: Vec<f64> = weights.iter().zip(&lengths).map(|(weight, length)| weight / length).collect();
        drive.terms.retain(|term| *term != Term::Rotor);
        let name = format!("{}.{}", drive.name, Term::Rotor.name());
        // Of base parameters, the leads' own combinations are taken along.
        let of_base: Vec<f64> = (0..count)
            .map(|i| leads.iter().zip(&own).map(|(lead, weight)| map[(i, *lead)] * weight).sum())
            .collect();
        let largest = of_base.iter().fold(0.0_f64, |most, weight| most.max(weight.abs()));
        for (parameter, weight) in base.parameters.iter_mut().zip(of_base) {
            if weight.abs() > ROUNDING * largest {
                if parameter.rotors.is_empty() {
                    parameter.name.push_str("+rotor");
                }
                parameter.rotors.push((name.clone(), weight));
            }
        }
    }
    Ok(())
}

/// Returns numbers between −1 and 1 that are the same every time (D. Knuth's linear congruence).
fn numbers() -> impl FnMut() -> f64 {
    let mut state = 0x853c_49e6_748f_ea9b_u64;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}
