//! Rules of a tree with links that are no bodies, as between the joints of one body.
//!
//! The rules' combinations `B φ` are independent as long as every link may have mass. Where some have none,
//! their columns of B go, and rows that then depend on others with them: `B' = B'_i N`, B'_i independent
//! columns, so that `N φ` are the base parameters that are left, each in place of a standard one.

use nalgebra::{DMatrix, DVector};

use super::numerical::{power, rank};
use super::qr::Columns;
use super::recursive::{NAMES, Rule};

/// Returns the rules that are left with the `present` columns only, ascending. `reach` is the unit of length
/// that makes them of one size.
pub(super) fn without(rules: &[Rule], present: &[usize], reach: f64) -> Vec<Rule> {
    let natural = DMatrix::from_fn(rules.len(), present.len(), |row, k| {
        let term = rules[row].terms.iter().find(|(column, _)| *column == present[k]);
        term.map_or(0.0, |t| t.1 * reach.powi(power(present[k]) - power(rules[row].column)))
    });
    let pivoted = Columns { rows: rules.len(), data: natural.as_slice().to_vec() }.pivot();
    let rank = rank(&pivoted.diagonal, pivoted.floor, rules.len().min(present.len()));
    // Those that represented a rule before, base first, if they do; otherwise the best conditioned.
    let leads = rules.iter().filter_map(|rule| present.iter().position(|c| *c == rule.column));
    let others = 0..present.len();
    let mut chosen = independent(&natural, leads.chain(others), rank);
    if chosen.len() < rank {
        chosen = pivoted.order[..rank].to_vec();
    }
    chosen.sort_unstable();
    let kept = DMatrix::from_fn(rules.len(), rank, |row, k| natural[(row, chosen[k])]);
    let qr = kept.qr();
    let weights = qr
        .r()
        .solve_upper_triangular(&(qr.q().transpose() * &natural))
        .unwrap_or_else(|| DMatrix::zeros(0, 0));
    chosen
        .iter()
        .enumerate()
        .filter(|_| weights.nrows() == rank)
        .map(|(row, stands)| {
            let column = present[*stands];
            let terms: Vec<(usize, f64)> = present
                .iter()
                .enumerate()
                .map(|(k, c)| (*c, weights[(row, k)] * reach.powi(power(column) - power(*c))))
                .map(|(c, weight)| if c == column { (c, 1.0) } else { (c, weight) })
                .filter(|(c, weight)| {
                    *c == column || (weight.abs() > ROUNDING && !chosen.iter().any(|k| present[*k] == *c))
                })
                .collect();
            Rule { name: name(column, &terms, rules), column, primed: false, terms }
        })
        .collect()
}

/// Weights of less, in natural units of the order of one, are rounding.
const ROUNDING: f64 = 1e-12;

/// Returns the first columns of an order that do not depend on those before, at most the given number.
fn independent(matrix: &DMatrix<f64>, order: impl Iterator<Item = usize>, most: usize) -> Vec<usize> {
    let mut basis: Vec<DVector<f64>> = Vec::new();
    let mut chosen = Vec::new();
    for k in order {
        if chosen.len() == most {
            break;
        }
        let mut rest = matrix.column(k).clone_owned();
        let before = rest.norm();
        // Twice is enough (Kahan).
        for _ in 0..2 {
            for direction in &basis {
                rest -= direction * direction.dot(&rest);
            }
        }
        if rest.norm() > f64::EPSILON.sqrt() * before {
            basis.push(rest.normalize());
            chosen.push(k);
        }
    }
    chosen
}

/// Returns a parameter's name in the style of the rules: with the other transverse moment where that is taken
/// off.
fn name(column: usize, terms: &[(usize, f64)], rules: &[Rule]) -> String {
    let moment = |c: usize| (4..7).contains(&(c % 10));
    let taken_off = |(c, weight): &&(usize, f64)| {
        *c != column && c / 10 == column / 10 && moment(column) && moment(*c) && (weight + 1.0).abs() < 1e-9
    };
    let link = rules.iter().find(|rule| rule.column / 10 == column / 10);
    let link = link.and_then(|rule| rule.name.rsplit_once('.')).map_or("", |(link, _)| link);
    let less = terms.iter().find(taken_off).map_or_else(String::new, |(c, _)| format!("-{}", NAMES[c % 10]));
    format!("{link}.{}{less}", NAMES[column % 10])
}
