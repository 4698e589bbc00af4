//! Masses and centres of mass of a robot's links relative to its model.

use std::path::PathBuf;

use serde::Serialize;

use super::super::calibrate_error::CalibrateError;
use super::super::{Caller, Error};
use super::mass_options::MassOptions;
use super::masses_beside::{self, Eliminated};
use super::masses_rows::{Read, read};
use rigident_fit::Progress;
use rigident_identify::mass_properties::comparison::{Comparison, Outcome, Study, Way};
use rigident_identify::mass_properties::whole_mass::WholeMass;
use rigident_model::base::BaseParameters;
use rigident_model::inertial::Parameters;
use rigident_model::{Model, remarks, write};

/// No model of a robot is off by more: the sum of what its masses change by, over the mass of the whole.
const FARTHEST: f64 = 0.4;

/// Masses and centres of mass as every way has them; its text is the table.
#[derive(Clone, Debug, Serialize)]
pub struct MassProperties {
    /// Name of this object.
    pub schema: &'static str,
    /// Name of the model.
    pub model: String,
    /// The recordings.
    pub recordings: Vec<String>,
    /// Number of the parts of which each was left out once.
    pub parts: usize,
    /// Number of rows.
    pub rows: u64,
    /// Number of unknowns.
    pub unknowns: usize,
    /// Number of the directions that rows tell.
    pub rank: usize,
    /// Ratio of the largest singular value of these to the smallest.
    pub condition: f64,
    /// Number of base parameters.
    pub base_parameters: usize,
    /// Sum of squares that the nominal model leaves, in standard deviations.
    pub nominal_cost: f64,
    /// The ways.
    pub ways: Vec<ComparedWay>,
    /// The way whose parameters are taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chosen: Option<&'static str>,
    /// Mass of all links by that way, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub whole_mass_kg: Option<f64>,
    /// Mass of all links as the rows alone determine it, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identified_whole_mass_kg: Option<f64>,
    /// The 95 % expanded uncertainty of `identified_whole_mass_kg`, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identified_whole_mass_u95_kg: Option<f64>,
    /// Constant force on the base that nothing measures, axes of the base, N, where one was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub external_force_n: Option<[f64; 3]>,
    /// All that acts beside the model and was found; the masses are those without it.
    pub eliminated: Vec<Eliminated>,
    /// Mass of all links by the model, kg.
    pub nominal_whole_mass_kg: f64,
    /// The links by the chosen way: by itself none is identified.
    pub links: Vec<LinkMass>,
    /// Notes on the steps taken.
    pub notes: Vec<String>,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
    /// The model with what was found; `None` if no way gives bodies that can be, or none is better than the
    /// nominal one.
    #[serde(skip)]
    pub found: Option<Model>,
    /// True if all links are bodies that can be and no torque contradicts the model.
    #[serde(skip)]
    pub is_believed: bool,
}

/// A way beside the others.
#[derive(Clone, Debug, Serialize)]
pub struct ComparedWay {
    /// The name of the way.
    pub way: &'static str,
    /// The setting of the way, in words.
    pub setting: String,
    /// True if that was chosen by what was left out.
    pub is_setting_chosen: bool,
    /// Sum of squares that it leaves of all rows, in standard deviations.
    pub cost: f64,
    /// Sum of squares that it leaves of rows that it has not seen, in standard deviations; `None` if there is
    /// only one part.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out_cost: Option<f64>,
    /// Bodies whose mass is not positive.
    pub negative_masses: usize,
    /// Bodies that cannot be.
    pub impossible_links: usize,
}

/// A link as the chosen way has it.
#[derive(Clone, Debug, Serialize)]
pub struct LinkMass {
    /// The name of the link.
    pub link: String,
    /// The mass of the link by the chosen way, kg.
    pub mass_kg: f64,
    /// The mass of the link in the nominal model, kg.
    pub nominal_mass_kg: f64,
    /// The centre of mass by the chosen way, in the link's frame, m.
    pub centre_of_mass_m: [f64; 3],
    /// The centre of mass in the nominal model, in the link's frame, m.
    pub nominal_centre_of_mass_m: [f64; 3],
}

/// Finds masses and centres of mass of a robot's links by every way beside the others, and writes the model
/// of the chosen one if that
/// is asked for.
///
/// # Errors
/// Something cannot be read or written, or is no recording of the tree; the caller stops the job.
///
/// ```
/// use rigident::application::{Caller, MassOptions, Tree, masses};
///
/// let example = |name: &str| format!("{}/../docs/examples/{name}", env!("CARGO_MANIFEST_DIR"));
/// let tree = Tree { model: Some(example("picks-up.urdf")), ..Tree::default() };
/// let options = MassOptions { tree, ..MassOptions::default() };
/// let found = masses(&[example("picks-up.csv").into()], &options, &Caller::default())?;
/// // One short motion predicts no better than the model: nothing is taken for found.
/// assert!(found.ways.len() == 5 && found.chosen.is_none() && !found.is_believed);
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn masses(
    recordings: &[PathBuf],
    options: &MassOptions,
    caller: &Caller<'_>,
) -> Result<MassProperties, Error> {
    caller.stoppable(|| found(recordings, options, caller))
}

fn found(
    recordings: &[PathBuf],
    options: &MassOptions,
    caller: &Caller<'_>,
) -> Result<MassProperties, Error> {
    if let Some(path) = &options.write_model {
        write::check_target(path)?;
    }
    if !(0.0..1.0).contains(&options.least_mass) {
        return Err(CalibrateError::LeastMass(options.least_mass).into());
    }
    let read = read(recordings, options, caller)?;
    let first = read.loaded.first().and_then(|first| Some((first.problem.tree()?, first.nominal()?)));
    let (source, (model, file)) = first.ok_or(CalibrateError::NoTree(None))?;
    caller.stage("ways side by side", 0.0);
    let study = Study {
        model,
        base: source.base(),
        parts: &read.factors,
        set: options.set,
        symmetric: options.symmetric_sides,
        least: options.least_mass,
    };
    let is_open = |way: &Way| options.fixed.iter().all(|fixed| fixed.name() != way.name());
    let open: Vec<Way> = Way::all().into_iter().filter(is_open).collect();
    let compared = study.compare(&open, &options.fixed, &|share| caller.stage("ways side by side", share))?;
    let best = match options.way {
        None => compared.best(),
        Some(name) => compared.outcomes.iter().find(|outcome| outcome.way.name() == name),
    };
    let mut warnings = read.warnings.clone();
    warnings.extend(masses_beside::warnings(&Eliminated::of(&read)));
    let why_not = match best {
        Some(outcome) => why_not(outcome, &compared, model, &read),
        None => Some(
            "no way gives bodies that can be: nothing is written; take motions that excite more, or fewer \
             unknowns by `symmetric_sides`"
                .to_owned(),
        ),
    };
    let chosen = best.filter(|_| why_not.is_none());
    warnings.extend(why_not);
    if let (Some(path), Some(outcome)) = (&options.write_model, chosen) {
        write::write(&outcome.model, file, path)?;
        warnings.extend(remarks::remarks(&outcome.model, file, path, &options.tree.changes.lock));
    }
    if chosen.is_some_and(|outcome| outcome.impossible > 0) {
        warnings.push(
            "some links of what was asked for are no bodies that can be: do not simulate or control with \
             these numbers"
                .to_owned(),
        );
    }
    let recordings = recordings.iter().map(|path| path.display().to_string()).collect();
    Ok(answer(recordings, &read, (model, source.base()), (&compared, chosen), warnings))
}

fn answer(
    recordings: Vec<String>,
    read: &Read,
    (model, base): (&Model, &BaseParameters),
    (compared, chosen): (&Comparison, Option<&Outcome>),
    warnings: Vec<String>,
) -> MassProperties {
    let mass =
        |model: &Model| -> f64 { model.links.iter().filter_map(|l| l.nominal).map(|phi| phi[0]).sum() };
    let whole = WholeMass::of(&read.factors, base);
    let way = |outcome: &Outcome| ComparedWay {
        way: outcome.way.name().text(),
        setting: outcome.way.setting(),
        is_setting_chosen: outcome.is_chosen,
        cost: outcome.direct,
        left_out_cost: outcome.left_out.as_ref().map(|left| left.squares),
        negative_masses: outcome.negative,
        impossible_links: outcome.impossible,
    };
    let eliminated = Eliminated::of(read);
    let on_base = eliminated.iter().find(|own| own.kind == "wrench");
    MassProperties {
        schema: "rigident/mass-properties/1",
        model: model.name.clone(),
        recordings,
        parts: read.factors.len(),
        rows: compared.rows,
        unknowns: compared.unknowns,
        rank: compared.rank,
        condition: compared.condition,
        base_parameters: base.parameters.len(),
        nominal_cost: compared.nominal,
        ways: compared.outcomes.iter().map(way).collect(),
        chosen: chosen.map(|outcome| outcome.way.name().text()),
        whole_mass_kg: chosen.map(|outcome| mass(&outcome.model)),
        identified_whole_mass_kg: whole.map(|whole| whole.kg),
        identified_whole_mass_u95_kg: whole.map(|whole| whole.u95_kg),
        external_force_n: on_base.and_then(|own| own.values.first_chunk().copied()),
        eliminated,
        nominal_whole_mass_kg: mass(model),
        links: chosen.map_or_else(Vec::new, |outcome| links(&outcome.model, model)),
        notes: read.notes.clone(),
        warnings,
        found: chosen.map(|outcome| outcome.model.clone()),
        is_believed: chosen.is_some_and(|outcome| outcome.impossible == 0) && !read.has_suspects,
    }
}

/// Returns why the nominal masses stay; `None` if the outcome's take their place.
fn why_not(outcome: &Outcome, compared: &Comparison, nominal: &Model, read: &Read) -> Option<String> {
    if compared.is_better_than_nominal(outcome) == Some(false) {
        let why = "what was left out is predicted no better than by the nominal model, whose masses the \
                   recordings do not improve: nothing is written; record motions that excite more, or look \
                   for a column that is wrong";
        return Some(why.to_owned());
    }
    // Torques alone do not tell the mass of the whole.
    if read.beside.unmeasured == Some(0) {
        let why = "the wrench on the base changes as nothing here explains, and without it the mass of the \
                   whole is not known: nothing is written; take away what pulls at the robot and record anew";
        return Some(why.to_owned());
    }
    let moved = moved_by(&outcome.model, nominal);
    (moved > FARTHEST).then(|| {
        format!(
            "masses would have to move by {:.0} % of the whole, more than a model of the robot is off: \
             something acts that is not known here, and nothing is written; look for a column that is wrong, \
             for what pulls at the robot, or for another robot's model",
            100.0 * moved
        )
    })
}

/// Returns the sum of what masses changed by, over the mass of the whole.
fn moved_by(found: &Model, nominal: &Model) -> f64 {
    let masses = |model: &Model| -> Vec<f64> {
        model.links.iter().map(|link| link.nominal.map_or(0.0, |phi| phi[0])).collect()
    };
    let (found, nominal) = (masses(found), masses(nominal));
    let moved: f64 = found.iter().zip(&nominal).map(|(own, other)| (own - other).abs()).sum();
    moved / nominal.iter().sum::<f64>().max(f64::MIN_POSITIVE)
}

fn links(found: &Model, nominal: &Model) -> Vec<LinkMass> {
    let centre = |phi: Parameters| -> [f64; 3] {
        std::array::from_fn(|k| if phi[0] == 0.0 { 0.0 } else { phi[1 + k] / phi[0] })
    };
    let pairs = found.links.iter().zip(&nominal.links);
    let pairs = pairs.filter_map(|(own, nominal)| Some((&own.name, own.nominal?, nominal.nominal?)));
    let link = |(name, own, nominal): (&String, Parameters, Parameters)| LinkMass {
        link: name.clone(),
        mass_kg: own[0],
        nominal_mass_kg: nominal[0],
        centre_of_mass_m: centre(own),
        nominal_centre_of_mass_m: centre(nominal),
    };
    pairs.map(link).collect()
}
