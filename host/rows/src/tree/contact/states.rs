//! States of contact: which feet stand, and by which rows what is not measured is eliminated, as long as that
//! is well conditioned.

use nalgebra::DMatrix;
use rigident_shared::tree::TreeError;

use super::super::Input;
use super::availability::unknown;
use super::forces;
use super::{Contact, ContactState, Foot};
use rigident_model::rows::Moving;

/// Rows are chosen anew where those chosen tell the unknowns apart by less than this.
const WORST: f64 = 1e-3;
/// The remainder of a row is nothing below this share of the largest.
const NOTHING: f64 = 1e-6;
/// The base's rows have no torque's noise: they are taken first.
const BASE_FIRST: f64 = 3.0;

/// Gives every frame its state of contact, and leaves out the frames at which it changes: the filter starts
/// anew there. Returns how many were left out.
///
/// # Errors
/// [`TreeError`] if frames and model do not fit.
pub(in super::super) fn assign(input: &mut Input, moving: &mut Moving) -> Result<usize, TreeError> {
    let Some(mut contact) = input.contact.take() else { return Ok(0) };
    let mut left_out = 0;
    let mut before: Option<usize> = None;
    let mut frames = std::mem::take(&mut input.frames);
    let zeros = vec![0.0; moving.freedoms()];
    let mut kept = Vec::with_capacity(frames.len());
    for mut frame in frames.drain(..) {
        moving.set(&frame.positions, &frame.rates, &zeros, &frame.base)?;
        let mut efforts = contact.unmeasured.clone();
        efforts.extend(frame.standing.iter().filter(|freedom| !contact.unmeasured.contains(freedom)));
        efforts.sort_unstable();
        let standing = contact.standing(&frame);
        let feet: Vec<&Foot> = standing.iter().map(|(_, foot, _)| *foot).collect();
        let columns = forces::columns(moving, &feet)?;
        let touching = frame.ground.touching.clone();
        let mut wanted = ContactState { touching, unknown_efforts: efforts, pivots: Vec::new() };
        let (values, _) = unknown(&wanted, &feet, &columns, contact.sigma.len());
        let fits = |state: &ContactState| {
            state.touching == wanted.touching
                && state.unknown_efforts == wanted.unknown_efforts
                && condition(&values, &state.pivots) > WORST
        };
        let same = before.filter(|k| contact.states.get(*k).is_some_and(&fits));
        let known = same.or_else(|| contact.states.iter().position(fits));
        let state = known.unwrap_or_else(|| {
            wanted.pivots = pivots(&values);
            contact.states.push(wanted);
            contact.states.len() - 1
        });
        frame.ground.state = state;
        if before.is_some_and(|before| before != state) {
            left_out += 1;
        } else {
            kept.push(frame);
        }
        before = Some(state);
    }
    (input.frames, input.contact) = (kept, Some(contact));
    Ok(left_out)
}

/// Returns how well rows tell the unknowns apart: the ratio of the smallest singular value that counts to the
/// largest.
fn condition(values: &DMatrix<f64>, pivots: &[usize]) -> f64 {
    if pivots.is_empty() {
        return if values.ncols() == 0 { 1.0 } else { 0.0 };
    }
    let own = values.select_rows(pivots).singular_values();
    let smallest = own.get(pivots.len().min(own.len()).saturating_sub(1)).copied().unwrap_or(0.0);
    smallest / own.max()
}

/// Returns rows by which the unknowns are eliminated: each is the one of which most is left beside those
/// before.
fn pivots(values: &DMatrix<f64>) -> Vec<usize> {
    let mut left = values.clone();
    for row in 0..left.nrows().min(6) {
        left.row_mut(row).scale_mut(BASE_FIRST);
    }
    let largest = left.row_iter().map(|row| row.norm()).fold(0.0, f64::max);
    let mut chosen = Vec::new();
    while chosen.len() < values.ncols() {
        let sizes = left.row_iter().map(|row| row.norm()).enumerate();
        let Some((row, size)) = sizes.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
        if size <= NOTHING * largest {
            break;
        }
        chosen.push(row);
        let direction = left.row(row) / size;
        let along = &left * direction.transpose();
        left -= along * direction;
    }
    chosen.sort_unstable();
    chosen
}

impl Contact {
    /// Returns the names of the feet that stand in a state, or what it is called.
    pub fn name(&self, state: &ContactState) -> String {
        let standing = self.feet.iter().zip(&state.touching).filter(|(_, touching)| **touching);
        let names: Vec<&str> = standing.map(|(foot, _)| foot.name.as_str()).collect();
        if names.is_empty() { "flight".to_owned() } else { names.join(" and ") }
    }
}
