//! Why known quantities are refused.

use super::{CENTRAL, CENTRE, PARAMETERS};
use crate::present::text::{significant, with_u95};

/// Why known quantities are refused. Nothing was absorbed then.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KnownError {
    /// Not of the form `NAME=VALUE±SIGMA`.
    #[error(
        "--known {0}: write NAME=VALUE±SIGMA with a standard uncertainty (1 σ), for example --known mass_kg=20.013±0.005; `+-` and `+/-` do as well"
    )]
    Form(String),
    /// Not of the form `AXIS` or `AXIS±SIGMA`.
    #[error(
        "--symmetry {0}: write the normal of the plane, x, y or z of S, and how far out it may be, 1 σ in m: y±0.002"
    )]
    SymmetryForm(String),
    /// No such quantity.
    #[error("--known {name}: no such quantity; there are {}", all_names())]
    Name {
        /// What was given.
        name: String,
    },
    /// A weighted row needs a positive σ.
    #[error(
        "{name}: a standard uncertainty of {sigma} is impossible; state how well it is known, however well, as a positive number"
    )]
    Sigma {
        /// The quantity.
        name: String,
        /// What was given.
        sigma: f64,
    },
    /// Rounding would spoil what else is known.
    #[error(
        "{name}: a standard uncertainty of {sigma:e} is below what double precision can hold beside the data; the smallest usable is {least:.1e}, and nothing is known that well: state that or a larger one"
    )]
    TooTight {
        /// The quantity.
        name: String,
        /// What was given.
        sigma: f64,
        /// The smallest usable, rounded up.
        least: f64,
    },
    /// The value is not finite, or a mass or a moment is not positive.
    #[error("{name}: no body has {}", plain(*.value))]
    Value {
        /// The quantity.
        name: String,
        /// What was given.
        value: f64,
    },
    /// Stated twice, and the two agree.
    #[error(
        "{name} is stated twice; if these are two measurements of it, combine them into one value and its σ"
    )]
    Repeated {
        /// The quantity.
        name: String,
    },
    /// Stated twice, and the two disagree.
    #[error(
        "{name} is stated twice, as {} and as {}: {} σ apart; keep the one that is true", plain(*.first), plain(*.second), significant(*.deviation, 4)
    )]
    Disagree {
        /// The quantity.
        name: String,
        /// One value.
        first: f64,
        /// The other.
        second: f64,
        /// Their distance over their joint σ.
        deviation: f64,
    },
    /// The rig file fixes the offset.
    #[error(
        "{name} cannot be used: the wrench offset is not estimated here (offset_n_nm in the rig file fixes it); remove one of the two"
    )]
    NoOffset {
        /// The quantity.
        name: String,
    },
    /// A centre of mass needs a mass, a central tensor a centre of mass.
    #[error(
        "{name} cannot be used: {needs} is known neither from the data nor from --known; state it as well"
    )]
    Needs {
        /// The quantity.
        name: String,
        /// What is missing.
        needs: &'static str,
    },
    /// The data, or the other known quantities, say otherwise.
    #[error(
        "{name} = {} ± {} contradicts the data and what else is known: they give {} (1 σ), {} σ away; check its unit and frame, the sensors' scales, or state a larger σ",
        plain(*.value), plain(*.sigma), with_u95(*.found, *.found_sigma, ""), significant(*.deviation, 4)
    )]
    Contradiction {
        /// The quantity.
        name: String,
        /// What was stated.
        value: f64,
        /// Its σ.
        sigma: f64,
        /// What the rest says.
        found: f64,
        /// Its σ.
        found_sigma: f64,
        /// Distance over the joint σ.
        deviation: f64,
    },
}

/// All its digits, with an exponent where there would be too many of them.
pub(super) fn plain(value: f64) -> String {
    if value == 0.0 || (1e-6..1e7).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}

fn all_names() -> String {
    [&PARAMETERS[..], &CENTRE, &CENTRAL].concat().join(", ")
}
