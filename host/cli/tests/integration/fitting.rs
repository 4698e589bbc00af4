//! Fits of one body's readings, and states of parameters.

use rigident::answer::Links;
use rigident::answer::result::ParameterState;
use rigident::fit::{Fit, FitOptions, Silent, fit};
use rigident::rows::body::{BodySource, Input};
use rigident::rows::tree::TreeSource;
use rigident_shared::forgetting::Span;

/// Fits readings of an IMU of whose noise nothing is stated.
pub fn fit_body(input: &Input) -> Fit {
    fit_with(input, &FitOptions::default())
}

/// Fits them with older rows forgotten.
pub fn fit_forgetting(input: &Input, span: Span<f64>) -> Fit {
    fit_with(input, &FitOptions { forgetting: Some(span), ..FitOptions::default() })
}

pub fn fit_with(input: &Input, options: &FitOptions) -> Fit {
    fit(&BodySource::new(input.clone(), None), options, &Silent).unwrap()
}

pub fn states(fit: &Fit) -> Vec<ParameterState> {
    rigident::answer::states::states(fit, None, false)
}

/// A tree as its answer takes it.
pub fn links(tree: &TreeSource) -> Links<'_> {
    let input = tree.input();
    Links {
        model: &input.model,
        base: tree.base(),
        situation: input.situation,
        drives: tree.drive_motions(),
        as_stated: &[],
        idle: Vec::new(),
        beyond: Vec::new(),
        standard: None,
    }
}

/// States of a tree's parameters.
pub fn tree_states(fit: &Fit, tree: &TreeSource) -> Vec<ParameterState> {
    rigident::answer::states::states(fit, Some(&links(tree)), false)
}

/// Rows that outliers have spoilt, by channel.
pub fn outliers(fit: &Fit) -> Vec<u32> {
    fit.channels.iter().map(|c| c.outliers).collect()
}
