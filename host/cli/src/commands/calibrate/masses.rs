//! `rigident calibrate masses`: masses and centres of mass of a robot's links relative to its model.

use std::process::ExitCode;

use crate::commands::calibrate::arguments::{CalibrateMasses, ExternalWrench as Asked, MassMethod};
use crate::commands::calibrate::joints::positive;
use crate::screen::outcome::{say, say_answer};
use crate::{ExitStatus, Failure, Stages};
use rigident::application::{ExternalWrench, MassOptions, Tree, masses};
use rigident::mass_properties::comparison::{Way, WayName};
use rigident::mass_properties::methods::Method;
use rigident::mass_properties::unknowns::ParameterSet;
use rigident::rows::tree::drive::Friction;

/// Runs `rigident calibrate masses`.
pub(crate) fn run(arguments: &CalibrateMasses) -> Result<ExitCode, Failure> {
    let options = MassOptions {
        rig: arguments.rig.clone(),
        tree: Tree { model: Some(arguments.model.clone()), changes: arguments.changes.typed()? },
        friction: Friction::parse(&arguments.friction).map_err(Failure::input)?,
        parts: arguments.parts.into(),
        set: if arguments.all_parameters { ParameterSet::All } else { ParameterSet::MassAndMoment },
        symmetric_sides: arguments.symmetric_sides,
        least_mass: arguments.least_mass,
        way: arguments.method.way(),
        fixed: fixed(arguments)?,
        external_wrench: match arguments.external_wrench {
            Asked::Auto => ExternalWrench::Auto,
            Asked::Unknown => ExternalWrench::Unknown,
            Asked::None => ExternalWrench::None,
        },
        write_model: arguments.write_model.clone(),
    };
    let stages = Stages::new("reading the model");
    let found = masses(&arguments.recordings, &options, &stages.caller())?;
    drop(stages);
    say_answer(&found, arguments.json)?;
    if !arguments.json {
        found.notes.iter().chain(&found.warnings).for_each(|said| tell!("rigident: {said}"));
        if let (Some(path), Some(_)) = (&arguments.write_model, &found.found) {
            say(format_args!("\nModel in {}.", path.display()));
        }
    }
    Ok(ExitStatus::of(found.is_believed).into())
}

impl MassMethod {
    /// Returns the way whose parameters are taken.
    fn way(self) -> Option<WayName> {
        match self {
            Self::Best => None,
            Self::Truncated => Some(WayName::Truncated),
            Self::Gradient => Some(WayName::Gradient),
            Self::Bounded => Some(WayName::Bounded),
            Self::Ridge => Some(WayName::Ridge),
            Self::Consistent => Some(WayName::Consistent),
        }
    }
}

/// Returns the ways whose setting is given, in the order in which they are compared.
fn fixed(arguments: &CalibrateMasses) -> Result<Vec<Way>, Failure> {
    let above_zero =
        |option: &str, value: Option<f64>| value.map(|value| positive(option, value)).transpose();
    let truncated = above_zero("--condition", arguments.condition)?;
    let ridge = above_zero("--weight", arguments.weight)?;
    let trust = above_zero("--nominal-sigma", arguments.nominal_sigma)?;
    let steps = arguments.steps.map(|steps| steps as usize);
    let given = [
        ("--condition", truncated.map(|condition| Way::Relative(Method::Truncated { condition }))),
        ("--steps", steps.map(|steps| Way::Relative(Method::Gradient { steps }))),
        ("--weight", ridge.map(|weight| Way::Relative(Method::Ridge { weight }))),
        ("--nominal-sigma", trust.map(|trust| Way::Consistent { trust })),
    ];
    let given = given.into_iter().filter_map(|(option, way)| Some((option, way?)));
    given
        .map(|(option, way)| match arguments.method.way() {
            Some(asked) if asked != way.name() => Err(Failure::input(format!(
                "{option} is of --method {}, and --method is {}",
                way.name().text(),
                asked.text()
            ))),
            _ => Ok(way),
        })
        .collect()
}
