//! The demands on the firmware for several links, checked before anything is done.

use rigident_shared::inertia::PARAMETER_NAMES;

use super::Failure;
use super::arguments::Output;
use rigident::answer::selection;
use rigident_fit::prior::KnownValues;
use rigident_fit::{Kind, Owner, Parameter};
use rigident_model::Model;
use rigident_model::base::BaseParameter;

/// Returns the parameters that a device estimates of a model, in its order: base parameters, then the offset if that is
/// estimated.
pub(super) fn device_parameters(model: &Model, parameters: &[BaseParameter], offset: bool) -> Vec<Parameter> {
    let links = model.welded().links;
    let standard = |column: usize| {
        let link = links.get(column / 10).map_or("", |link| link.name.as_str());
        format!("{link}.{}", PARAMETER_NAMES[column % 10])
    };
    let of_base = parameters.iter().map(|p| {
        let owner = p.name.rsplit_once('.').map_or("", |(link, _)| link).to_owned();
        let kind = match p.terms.first().map_or(0, |t| t.0 % 10) {
            0 => Kind::Mass,
            1..4 => Kind::FirstMoment,
            _ => Kind::Inertia,
        };
        let made_of = p.terms.iter().map(|(column, weight)| (standard(*column), *weight)).collect();
        Parameter { made_of, ..Parameter::new(p.name.clone(), Owner::Link(owner), kind, "") }
    });
    let offsets = PARAMETER_NAMES.iter().skip(10).filter(|_| offset).map(|name| {
        let channel = name.trim_start_matches("offset_").to_owned();
        Parameter::new((*name).to_owned(), Owner::Channel(channel), Kind::Offset, "")
    });
    of_base.chain(offsets).collect()
}

/// Refuses what `--estimate` asks for or `--known` states and is not there, before anything is done.
///
/// # Errors
/// Bad input: the word that is none of them.
pub(super) fn check_asked(
    parameters: &[Parameter],
    known: &KnownValues,
    output: &Output,
) -> Result<(), Failure> {
    known.check(parameters).map_err(Failure::input)?;
    selection::select(parameters, &output.estimate).map(drop).map_err(Failure::input)
}
