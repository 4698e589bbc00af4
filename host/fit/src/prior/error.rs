//! Why known values are refused.

/// Why known values are refused. Nothing was absorbed then.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KnownError {
    /// Not of the form `NAME=VALUE±SIGMA`.
    #[error(
        "`known` {0}: write NAME=VALUE±SIGMA with a standard uncertainty (1 σ), for example `known` \
         mass_kg=20.013±0.005; `+-` and `+/-` do as well"
    )]
    Form(String),
    /// Not of the form `AXIS` or `AXIS±SIGMA`.
    #[error(
        "`symmetry` {0}: write the normal of the plane, x, y or z of the frame, and how far out it may be, 1 \
         σ in m: y±0.002; of a link of a tree with its name before: arm:y±0.002"
    )]
    SymmetryForm(String),
    /// No such quantity.
    #[error("`known` {name}: no such quantity; there are {}", known.join(", "))]
    Name {
        /// The name that was given.
        name: String,
        /// Names that there are.
        known: Vec<String>,
    },
    /// No such link, or several and none named.
    #[error("{}", link_in_words(name, links))]
    Link {
        /// The statement.
        name: String,
        /// The links that there are.
        links: Vec<String>,
    },
    /// The rows tell a sum only, of which the statement is about a part.
    #[error(
        "{name} cannot be used: {needed} is no parameter by itself; the rows tell {parameter} = {terms} \
         only. State {parameter}={}, or the full parameters by the model's nominal values",
        "VALUE±SIGMA"
    )]
    Combination {
        /// The statement.
        name: String,
        /// The standard parameter that it needs.
        needed: String,
        /// The base parameter that holds it.
        parameter: String,
        /// Its terms.
        terms: String,
    },
    /// No parameter has to do with the statement.
    #[error("{name} cannot be used: {needed} is in none of the parameters that the rows determine")]
    NotEstimated {
        /// The statement.
        name: String,
        /// The standard parameter that it needs.
        needed: String,
    },
    /// A weighted row needs a positive σ.
    #[error(
        "{name}: a standard uncertainty of {sigma} is impossible; state how well it is known, however well, \
         as a positive number"
    )]
    Sigma {
        /// The statement.
        name: String,
        /// The σ that was given.
        sigma: f64,
    },
    /// Rounding would spoil what else is known.
    #[error(
        "{name}: a standard uncertainty of {sigma:e} is below what double precision can hold beside the \
         data; the smallest usable is {least:.1e}, and nothing is known that well: state that or a larger \
         one"
    )]
    TooTight {
        /// The statement.
        name: String,
        /// The σ that was given.
        sigma: f64,
        /// The smallest usable, rounded up.
        least: f64,
    },
    /// The value is not finite, or a mass or a moment is not positive.
    #[error("{name} = {}: no value that a body can have; numbers are finite, masses and moments of inertia \
             positive", plain(*.value))]
    Value {
        /// The statement.
        name: String,
        /// The value that was given.
        value: f64,
    },
    /// Stated twice, and the two agree.
    #[error(
        "{name} is stated twice; if these are two measurements of it, combine them into one value and its σ"
    )]
    Repeated {
        /// The statement.
        name: String,
    },
    /// Stated twice, and the two disagree.
    #[error(
        "{name} is stated twice, as {} and as {}: {} σ apart; keep the one that is true", plain(*.first), plain(*.second), significant(*.deviation, 4)
    )]
    Disagree {
        /// The statement.
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
        "{name} cannot be used: the wrench offset is not estimated here (offset_n_nm in the rig file fixes \
         it); remove one of the two"
    )]
    NoOffset {
        /// The statement.
        name: String,
    },
    /// A centre of mass needs a mass, a central tensor a centre of mass.
    #[error(
        "{name} cannot be used: {needs} is known neither from the data nor from `known`; state it as well"
    )]
    Needs {
        /// The statement.
        name: String,
        /// The missing part.
        needs: &'static str,
    },
    /// The data, or the other known values, say otherwise.
    #[error(
        "{name} = {} ± {} contradicts the data and what else is known: they give {} (1 σ), {} σ away; check \
         its unit and frame, the sensors' scales, or state a larger σ",
        plain(*.value), plain(*.sigma), rounded(*.found, *.found_sigma), significant(*.deviation, 4)
    )]
    Contradiction {
        /// The statement.
        name: String,
        /// The value that was stated.
        value: f64,
        /// Its σ.
        sigma: f64,
        /// The value that the rest gives.
        found: f64,
        /// Its σ.
        found_sigma: f64,
        /// Distance over the joint σ.
        deviation: f64,
    },
}

/// Says which links a statement can be about, and how it names one.
fn link_in_words(statement: &str, links: &[String]) -> String {
    let plane = statement.strip_prefix("symmetry ");
    let (option, said) = plane.map_or(("`known`", statement), |plane| ("`symmetry`", plane));
    let there = match links {
        [] => "no link has inertial parameters here".to_owned(),
        [only] if only.is_empty() => "there is one body without a name: leave the link away".to_owned(),
        links => {
            let own = said.rsplit(['.', ':']).next().unwrap_or(said);
            let form =
                if plane.is_some() { format!("LINK:{own}") } else { format!("LINK.{own}=VALUE±SIGMA") };
            format!("name one of the links, as {form}: {}", links.join(", "))
        }
    };
    format!("{option} {said}: {there}")
}

/// All digits of a number, with an exponent where there would be too many of them.
pub(super) fn plain(value: f64) -> String {
    if value == 0.0 || (1e-6..1e7).contains(&value.abs()) { value.to_string() } else { format!("{value:e}") }
}

/// Returns a number with the given digits.
pub(super) fn significant(value: f64, digits: usize) -> String {
    plain(format!("{value:.*e}", digits.saturating_sub(1)).parse().unwrap_or(value))
}

/// A value to the second digit of its σ, and the σ.
fn rounded(value: f64, sigma: f64) -> String {
    let decimals = 1.0 - sigma.log10().floor();
    if (0.0..=9.0).contains(&decimals) {
        // At most nine places: the cast is exact.
        let places = decimals as usize;
        format!("{value:.places$} ± {sigma:.places$}")
    } else {
        format!("{} ± {}", significant(value, 12), significant(sigma, 2))
    }
}
