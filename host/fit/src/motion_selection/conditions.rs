//! Condition numbers of groups of columns.
//!
//! The rows of a motion are `A = Q R` with orthonormal Q, so that the columns of a group have the singular
//! values of the same columns of R.

use nalgebra::DMatrix;

use crate::{Factor, Parameter};

/// Columns of one link, of a limb, or of the whole body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// Its columns.
    pub columns: Vec<usize>,
}

/// Condition numbers (2-norm) of a group of columns; infinite if they are dependent, or one is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Condition {
    /// Of the columns as they are.
    pub raw: f64,
    /// Of the columns brought to unit length.
    pub scaled: f64,
}

/// Returns the groups of a tree's parameters: the whole, each limb that a list of links names, each link.
pub fn groups(parameters: &[Parameter], limbs: &[(&str, &[&str])]) -> Vec<Group> {
    let of = |links: &[&str]| -> Vec<usize> {
        let is_in = |p: &Parameter| p.link().is_some_and(|link| links.contains(&link));
        parameters.iter().enumerate().filter(|(_, p)| is_in(p)).map(|(j, _)| j).collect()
    };
    let mut names: Vec<&str> = Vec::new();
    for link in parameters.iter().filter_map(Parameter::link) {
        if !names.contains(&link) {
            names.push(link);
        }
    }
    let whole = Group { name: "whole body".to_owned(), columns: of(&names) };
    let limbs = limbs.iter().map(|(name, links)| Group { name: (*name).to_owned(), columns: of(links) });
    let links = names.iter().map(|name| Group { name: (*name).to_owned(), columns: of(&[name]) });
    std::iter::once(whole).chain(limbs).chain(links).filter(|group| !group.columns.is_empty()).collect()
}

/// Returns the condition numbers of groups in a factor.
pub fn conditions(factor: &Factor, groups: &[Group]) -> Vec<Condition> {
    let r = factor.r();
    groups.iter().map(|group| condition(&r.select_columns(&group.columns))).collect()
}

/// Returns the condition numbers of a matrix's columns.
pub fn condition(columns: &DMatrix<f64>) -> Condition {
    let ratio = |matrix: DMatrix<f64>| {
        let values = matrix.singular_values();
        let (most, least) = (values.max(), values.min());
        if least > f64::EPSILON * most { most / least } else { f64::INFINITY }
    };
    if columns.nrows() < columns.ncols() || columns.ncols() == 0 {
        return Condition { raw: f64::INFINITY, scaled: f64::INFINITY };
    }
    let mut scaled = columns.clone();
    for mut column in scaled.column_iter_mut() {
        let length = column.norm();
        if length > 0.0 {
            column /= length;
        }
    }
    Condition { raw: ratio(columns.clone()), scaled: ratio(scaled) }
}
