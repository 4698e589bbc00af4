//! What acts beside the model: a hose at a link, torques that read a multiple of their value, friction,
//! rotors, a foot that no sensor measures.
//!
//! Least squares of masses take for mass whatever these explain, and predict the better for it: no motion
//! that is left out shows it. So each has columns ([`rigident_rows::tree::unmodelled`]) and is taken along
//! where rows show it, with coefficients that may be: one after the other the one by which Schwarz's
//! criterion gains most (G. Schwarz, *Ann. Statist.* 6 (2), 1978), as long as an F test says that it is no
//! chance. What acts all the time and changes as it likes, the ground under a foot without a sensor, has no
//! columns: its rows are eliminated, and that is compared with what columns explain.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::methods::truncated;
use rigident_fit::Factor;
use rigident_model::base::ROUNDED;
use rigident_rows::tree::TreeSource;
use rigident_rows::tree::unmodelled::Unmodelled;

/// Squares that something explains are no chance below this probability, over all that is tried.
const SURPRISING: f64 = 1e-6;
/// Rows behind the filter, and errors of what is measured, are not independent: they count as this share of
/// their number.
const INDEPENDENT: f64 = 0.2;

/// Something that acts beside the model, as rows show it.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The kind.
    pub what: Unmodelled,
    /// The coefficients of its columns.
    pub values: Vec<f64>,
}

/// The choice of what is taken along.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The numbers of what was chosen, in the order in which they were.
    pub chosen: Vec<usize>,
    /// The sum of squares that is left.
    left: f64,
    /// Rows and unknowns.
    rows: f64,
    unknowns: f64,
}

impl Choice {
    /// Chooses from the columns of a factor: the first `base` ones are the model's, then come those of `all`
    /// in turn.
    pub fn of(factor: &Factor, base: usize, all: &[Unmodelled]) -> Self {
        let mut spans: Vec<Range<usize>> = Vec::new();
        for own in all {
            let start = spans.last().map_or(0, |span| span.end);
            spans.push(start..start + own.columns());
        }
        let count = factor.parameters() - base;
        let lengths: Vec<f64> = factor.r().columns(base, count).column_iter().map(|c| c.norm()).collect();
        // The model's columns come first: below them is what is left of the others beside them.
        let all_columns = factor.r().view((base, base), (count, count)).into_owned();
        let all_values = DVector::from_column_slice(&factor.z()[base..]);
        let (mut columns, mut values) = (all_columns.clone(), all_values.clone());
        let mut choice = Self {
            chosen: Vec::new(),
            left: values.norm_squared() + factor.residual_sum_of_squares(),
            rows: factor.rows() as f64,
            unknowns: base as f64,
        };
        let mut open: Vec<usize> = (0..all.len()).collect();
        loop {
            let tried = open.iter().filter_map(|k| {
                let own = basis(&columns, &lengths, spans[*k].clone())?;
                let explained = own.tr_mul(&values).norm_squared();
                (choice.left > explained).then_some((*k, own, explained))
            });
            let gains =
                tried.map(|(k, own, explained)| (choice.gain(own.ncols(), explained), k, own, explained));
            let Some((_, k, own, explained)) = gains.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            if choice.chance(own.ncols(), explained) * all.len() as f64 > SURPRISING {
                break;
            }
            open.retain(|other| *other != k);
            choice.chosen.push(k);
            if !choice.may_be(all, &spans, (&all_columns, &all_values)) {
                choice.chosen.pop();
                continue;
            }
            values -= &own * own.tr_mul(&values);
            columns -= &own * own.tr_mul(&columns);
            choice.left -= explained;
            choice.unknowns += own.ncols() as f64;
        }
        choice
    }

    /// Returns true if all that is chosen may have the coefficients that it has together.
    fn may_be(
        &self,
        all: &[Unmodelled],
        spans: &[Range<usize>],
        (columns, values): (&DMatrix<f64>, &DVector<f64>),
    ) -> bool {
        let own: Vec<usize> = self.chosen.iter().flat_map(|k| spans[*k].clone()).collect();
        let found = truncated(&columns.select_columns(&own), values, 1.0 / ROUNDED).0;
        let mut at = 0;
        self.chosen.iter().all(|k| {
            let count = all[*k].columns();
            at += count;
            all[*k].may_be(&found.as_slice()[at - count..at])
        })
    }

    /// Returns the gain of Schwarz's criterion by a number of more columns that explain a sum of squares.
    fn gain(&self, columns: usize, explained: f64) -> f64 {
        let rows = INDEPENDENT * self.rows;
        rows * (self.left / (self.left - explained)).ln() - columns as f64 * rows.max(1.0).ln()
    }

    /// Returns the probability that this number of columns explains a sum of squares by chance.
    fn chance(&self, columns: usize, explained: f64) -> f64 {
        let unknowns = self.unknowns + columns as f64;
        let free = INDEPENDENT * self.rows - unknowns;
        let each = (self.left - explained) / (self.rows - unknowns);
        if !(columns > 0 && explained > 0.0 && each > 0.0 && free > 1.0) {
            return 1.0;
        }
        let ratio = INDEPENDENT * explained / columns as f64 / each;
        FisherSnedecor::new(columns as f64, free).map_or(1.0, |of| of.sf(ratio))
    }

    /// Returns true if rows of which some are eliminated, for what acts as it likes, say better than this
    /// choice what acts: by Schwarz's criterion, each row that is missing being an unknown, with the variance
    /// that the better of both leaves.
    pub fn is_worse_than(&self, eliminated: &Factor) -> bool {
        let left = eliminated.residual_sum_of_squares();
        let rows = eliminated.rows() as f64;
        let free = |rows: f64, unknowns: f64| (rows - unknowns).max(1.0);
        let own = self.left / free(self.rows, self.unknowns);
        let other = left / free(rows, eliminated.parameters() as f64);
        let each = INDEPENDENT * self.rows;
        let cost = |left: f64, unknowns: f64| INDEPENDENT * left / own.min(other) + unknowns * each.ln();
        let gone = INDEPENDENT * (self.rows - rows).max(0.0);
        cost(left, eliminated.parameters() as f64 + gone) < cost(self.left, self.unknowns)
    }
}

/// Returns orthonormal columns of the space of some, as far as they are more than rounding; `None` if none
/// is.
fn basis(columns: &DMatrix<f64>, lengths: &[f64], span: Range<usize>) -> Option<DMatrix<f64>> {
    let mut own: Vec<DVector<f64>> = Vec::new();
    for k in span {
        let mut column = columns.column(k).into_owned();
        for _ in 0..2 {
            own.iter().for_each(|before: &DVector<f64>| column -= before * before.dot(&column));
        }
        let norm = column.norm();
        if norm > ROUNDED.sqrt() * lengths[k] {
            own.push(column / norm);
        }
    }
    (!own.is_empty()).then(|| DMatrix::from_columns(&own))
}

/// Returns the coefficients of `chosen`, whose columns a factor has after the first `base` ones.
pub fn found(factor: &Factor, base: usize, chosen: &[Unmodelled]) -> Vec<Found> {
    let estimate = factor.solve(ROUNDED).estimate;
    let mut at = base;
    let each = chosen.iter().map(|what| {
        let values = estimate.iter().skip(at).take(what.columns()).copied().collect();
        at += what.columns();
        Found { what: *what, values }
    });
    each.collect()
}

/// Returns the links on which something may push that no sensor measures: the base, those that carry no
/// other, and those of feet.
pub fn ends(source: &TreeSource) -> Vec<usize> {
    let input = source.input();
    let links = &input.model.links;
    let carries = |i: usize| links.iter().enumerate().skip(1).any(|(k, own)| k != i && own.link.parent == i);
    let feet = input.contact.iter().flat_map(|contact| contact.feet.iter().filter(|foot| foot.is_measured()));
    let mut all: Vec<usize> = feet.map(|foot| foot.link).collect();
    all.extend((0..links.len()).filter(|i| *i == 0 || !carries(*i)));
    all.sort_unstable();
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of two parameters and of two things beside them, one of which acts or not.
    #[test]
    fn what_acts_is_chosen_and_nothing_else() {
        let noise = |k: usize| 0.3 * ((k * 7919 + 13) as f64 * 12.9898).sin();
        let all = [Unmodelled::Gain(0), Unmodelled::Force(1)];
        for pull in [0.0, 0.4] {
            let mut factor = Factor::new(6);
            for k in 0..6000 {
                let (a, b) = ((0.37 * k as f64).sin(), (0.11 * k as f64).cos());
                let mut row = [a, b, (0.05 * k as f64).sin(), 0.0, 0.0, 0.0];
                row[3 + k % 3] = 1.0;
                let value = 2.0 * a - b + pull * row[4] + noise(k);
                factor.absorb([(&row[..], value)]);
            }
            let choice = Choice::of(&factor, 2, &all);
            assert_eq!(choice.chosen, if pull > 0.0 { vec![1] } else { vec![] });
            if pull > 0.0 {
                let found = found(&factor, 2, &all);
                assert!((found[1].values[1] - pull).abs() < 0.05, "{found:?}");
            }
        }
    }
}
