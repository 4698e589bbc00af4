//! The tables of an answer: quantities in groups, the same for the terminal and for the page.

use rigident_shared::inertia::PARAMETER_NAMES;

use super::data::{self, Drift, PrincipalAxis, Quantity};
use super::table::printable;
use rigident_fit::figures::shortened;
use rigident_identify::answer::Answer;
use rigident_identify::answer::person::PersonResult;
use rigident_identify::answer::result::{Measured, Parameter, ParameterState, RunVerdict, Status};

const AXES: [&str; 3] = ["x", "y", "z"];
const TENSOR: [&str; 6] = ["Ixx", "Iyy", "Izz", "Iyz", "Izx", "Ixy"];
/// The caption of offsets.
const OFFSETS: &str = "Apparent wrench offsets, on the body";
/// At most this many other standard parameters are named beside a base parameter.
const NAMED: usize = 4;

/// Quantities under one caption.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Group {
    /// The caption.
    pub title: String,
    /// The quantities, with their full names.
    pub quantities: Vec<Quantity>,
    /// The other parts of each; empty where all represent themselves.
    pub made_of: Vec<String>,
}

/// Returns true if the answer is about one whole body.
pub(super) fn is_body(answer: &Answer) -> bool {
    answer.parameters.len() >= 10
        && answer.parameters.iter().zip(PARAMETER_NAMES).take(10).all(|(p, n)| p.name == n)
}

fn quantity(parameter: &Parameter) -> Quantity {
    Quantity {
        name: parameter.name.clone(),
        unit: parameter.unit.clone(),
        state: parameter.state,
        truth: parameter.truth,
    }
}

/// Returns the quantities of the parameters that are no offsets of channels.
pub(super) fn parameters(answer: &Answer) -> Vec<Quantity> {
    answer.parameters.iter().filter(|p| !is_offset(answer, p)).map(quantity).collect()
}

fn is_offset(answer: &Answer, parameter: &Parameter) -> bool {
    parameter.name.starts_with("offset_") && answer.channels.iter().any(|c| c.name == parameter.owner)
}

/// Returns the name of one body's frame: S, or that of the link that carries it.
fn frame(answer: &Answer) -> &str {
    answer.payload.as_ref().map_or("S", |_| answer.parameters.first().map_or("S", |p| p.frame.as_str()))
}

/// Returns the estimated parameters, one group an owner.
pub(super) fn by_owner(answer: &Answer) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    let in_frame = format!("In {0}, about the origin of {0}", frame(answer));
    for parameter in &answer.parameters {
        let title = match parameter.owner.as_str() {
            _ if is_offset(answer, parameter) => OFFSETS,
            "" if is_body(answer) => &in_frame,
            "" => "Parameters",
            owner => owner,
        };
        if groups.last().is_none_or(|last| last.title != title) {
            groups.push(Group { title: title.to_owned(), ..Group::default() });
        }
        let others: Vec<&str> = parameter.terms.iter().skip(1).map(|(name, _)| name.as_str()).collect();
        if let Some(group) = groups.last_mut() {
            group.quantities.push(quantity(parameter));
            group.made_of.push(shortened(&others, NAMED));
        }
    }
    groups
}

/// Returns one body's derived quantities: about the centre of mass, then in the customer's frame.
pub(super) fn of_the_body(answer: &Answer) -> (Option<Group>, Option<Group>) {
    if !is_body(answer) {
        return (None, None);
    }
    let mut quantities = centre_of_mass(answer);
    quantities.extend(inertia_com(answer));
    let about = Group {
        title: format!("About the centre of mass, axes of {}", frame(answer)),
        quantities,
        made_of: Vec::new(),
    };
    let there = answer.body_frame.as_ref().map(|frame| {
        let truth = answer.truth.as_ref();
        let com = Some((frame.com_m, frame.com_u95_m));
        let mut quantities =
            list(&AXES, "m", states(answer, "com_m"), com, truth.and_then(|t| t.body_frame_com_m));
        let tensor = frame.inertia_origin_kgm2.zip(frame.inertia_origin_u95_kgm2);
        if tensor.is_some() {
            let truth = truth.and_then(|t| t.body_frame_inertia_origin_kgm2);
            quantities.extend(list(&TENSOR, "kg m2", states(answer, "inertia_com_kgm2"), tensor, truth));
        }
        Group { title: format!("In the body's frame, {}", frame.name), quantities, made_of: Vec::new() }
    });
    (Some(about), there)
}

/// Returns the centre of mass of one body in S.
pub(super) fn centre_of_mass(answer: &Answer) -> Vec<Quantity> {
    let values = answer.com_m.zip(answer.com_u95_m);
    list(&AXES, "m", states(answer, "com_m"), values, answer.truth.as_ref().map(|t| t.com_m))
}

/// Returns the tensor of one body about its centre of mass, axes of S.
pub(super) fn inertia_com(answer: &Answer) -> Vec<Quantity> {
    let values = answer.inertia_com_kgm2.zip(answer.inertia_com_u95_kgm2);
    let truth = answer.truth.as_ref().map(|t| t.inertia_com_kgm2);
    list(&TENSOR, "kg m2", states(answer, "inertia_com_kgm2"), values, truth)
}

/// Returns principal moments and axes.
pub(super) fn principal(answer: &Answer) -> Vec<PrincipalAxis> {
    let prior = rests_on_prior(answer, "principal");
    let moments = answer.principal.iter().enumerate();
    moments
        .map(|(k, p)| PrincipalAxis {
            moment: Quantity {
                name: format!("I{}", k + 1),
                unit: "kg m2".to_owned(),
                state: state(p.moment_kgm2, p.u95_kgm2, prior),
                truth: answer.truth.as_ref().and_then(|t| t.moments_kgm2.get(k).copied()),
            },
            axis: p.axis.unwrap_or_default(),
            direction_u95_rad: p.axis.and(p.axis_u95_rad).unwrap_or(f64::INFINITY),
        })
        .collect()
}

/// Returns the drift check as quantities.
pub(super) fn drift(answer: &Answer) -> Option<Drift> {
    answer.drift.as_ref().map(|drift| Drift {
        elapsed_s: drift.elapsed_s,
        changes: drift
            .changes
            .iter()
            .map(|c| Quantity {
                name: c.channel.clone(),
                unit: c.unit.clone(),
                state: c.change.map_or(ParameterState::NotIdentified, ParameterState::Identified),
                truth: None,
            })
            .collect(),
    })
}

fn rests_on_prior(answer: &Answer, field: &str) -> bool {
    answer.prior_dominated.iter().any(|f| f == field)
}

/// Returns the state of a derived quantity that has no number, and whether one that has rests on what was
/// known beforehand.
fn states(answer: &Answer, field: &str) -> (ParameterState, bool) {
    let missing =
        if answer.is_contradicted() { ParameterState::Contradicted } else { ParameterState::NotIdentified };
    (missing, rests_on_prior(answer, field))
}

/// Returns the words in place of the numbers of one body, where there are none.
pub(super) fn missing(answer: &Answer) -> &'static str {
    data::missing(states(answer, "").0)
}

fn state(value: f64, u95: f64, prior: bool) -> ParameterState {
    let measured = Measured { value, u95 };
    if prior { ParameterState::PriorDominated(measured) } else { ParameterState::Identified(measured) }
}

fn list<const K: usize>(
    names: &[&str; K],
    unit: &str,
    (missing, prior): (ParameterState, bool),
    values: Option<([f64; K], [f64; K])>,
    truth: Option<[f64; K]>,
) -> Vec<Quantity> {
    (0..K)
        .map(|k| Quantity {
            name: names[k].to_owned(),
            unit: unit.to_owned(),
            state: values.map_or(missing, |(v, u)| state(v[k], u[k], prior)),
            truth: truth.map(|t| t[k]),
        })
        .collect()
}

/// Returns the status in words.
pub(super) fn headline(answer: &Answer) -> String {
    if let Some(cause) = &answer.cause {
        return format!("Not to be used: most likely {}", cause.what);
    }
    if !is_body(answer) {
        let identified = answer.parameters.iter().filter(|p| p.state.is_identified()).count();
        let words = match answer.status {
            Status::Identified => "Identified",
            Status::PartlyIdentified => "Partly identified",
            Status::NotIdentified => "Not identified",
            Status::Implausible => return "Not to be used, see the warnings".to_owned(),
            Status::Failed => "Failed",
        };
        return match &answer.person {
            Some(person) => learned(person),
            None => format!("{words}: {identified} of {} parameters identified", answer.parameters.len()),
        };
    }
    let own = parameters(answer);
    let names = |good: &dyn Fn(&Quantity) -> bool| -> Vec<String> {
        own.iter().filter(|q| good(q)).map(|q| q.name.clone()).collect()
    };
    let missing = names(&|q| q.known().is_none());
    let prior = names(&|q| q.known().is_some() && q.state.is_prior_dominated());
    let words = match answer.status {
        Status::Identified if missing.is_empty() && !prior.is_empty() => {
            "Identified what was asked for".to_owned()
        }
        Status::Identified if missing.is_empty() => {
            "Identified: the data determine every parameter".to_owned()
        }
        Status::Identified => {
            format!("Identified what was asked for. Not identified: {}", missing.join(", "))
        }
        Status::PartlyIdentified if missing.is_empty() => "Partly identified".to_owned(),
        Status::PartlyIdentified => format!("Partly identified. Not identified: {}", missing.join(", ")),
        // The body is there, and was not what was asked for.
        Status::NotIdentified if missing.len() < own.len() => {
            "What was asked for is not identified".to_owned()
        }
        Status::NotIdentified => "Not identified".to_owned(),
        Status::Implausible if answer.change.is_some() || answer.not_rigid.is_some() => {
            "Not to be used: the recording is not that of an unchanging rigid body, see the warnings"
                .to_owned()
        }
        Status::Implausible if answer.runs.iter().any(|run| run.verdict == RunVerdict::Implausible) => {
            let named = answer.runs.iter().filter(|run| run.verdict == RunVerdict::Implausible);
            let named: Vec<&str> = named.map(|run| run.recording.as_str()).collect();
            format!("Not to be used: {} contradicted its own checks, see the warnings", named.join(", "))
        }
        Status::Implausible => {
            "Not to be used: the recording contradicts what is stated of the rig".to_owned()
        }
        Status::Failed => "Failed: the experiment did not come to its end".to_owned(),
    };
    if prior.is_empty() {
        words
    } else {
        format!("{words}. Only with what was known beforehand: {}", prior.join(", "))
    }
}

/// Returns how many identified parameters whose truth is known have it in their interval, of how many.
pub(super) fn inside(answer: &Answer) -> Option<(usize, usize)> {
    let known = answer.parameters.iter().filter_map(|p| Some((p.state.measured()?, p.truth?)));
    let (inside, all) = known.fold((0, 0), |(inside, all), (m, truth)| {
        (inside + usize::from((m.value - truth).abs() <= m.u95), all + 1)
    });
    (all > 0).then_some((inside, all))
}

/// Returns what was measured and how many parameters there are, for a model of links.
pub(super) fn situation(answer: &Answer) -> Option<String> {
    answer.model.as_ref().map(|m| {
        format!(
            "{}; {} base parameters of {} standard ones",
            m.situation, m.base_parameters, m.standard_parameters
        )
    })
}

/// Returns what the motions said of a person, and what they did not.
pub(super) fn learned(found: &PersonResult) -> String {
    let names = |identified: bool| -> Vec<String> {
        found.segments.iter().filter(|s| s.identified == identified).map(|s| printable(&s.name)).collect()
    };
    let (known, others) = (names(true), names(false));
    let masses = match (known.len(), others.len()) {
        (0, 0) => "of segments nothing".to_owned(),
        (0, _) => "of no segment more than the table knows".to_owned(),
        (_, 0) => "the masses of all segments".to_owned(),
        _ => format!("the masses of {}; not of {}", known.join(", "), others.join(", ")),
    };
    match found.mass_kg {
        None => "Not identified: the whole mass, nor any segment".to_owned(),
        Some(_) => format!("Identified: the whole mass; {masses}"),
    }
}
