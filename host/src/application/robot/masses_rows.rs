//! The rows that masses are found from: factors of recordings, or of the parts of one.

use std::path::PathBuf;

use super::super::calibrate_error::CalibrateError;
use super::super::{Caller, Error, Loaded};
use super::mass_options::{ExternalWrench, MassOptions};
use rigident_fit::{Factor, Progress, RowSource, Silent, plain_factor, plain_factors};
use rigident_identify::mass_properties::beside::{self, Choice, Found};
use rigident_identify::mass_properties::efforts::suspects;
use rigident_identify::mass_properties::weights::channel_sigma;
use rigident_identify::problem::ProblemError;
use rigident_rows::tree::unmodelled::Unmodelled;
use rigident_rows::tree::{ProblemOptions, TreeSource, TreeSourceError};

/// The data read.
#[derive(Default)]
pub(super) struct Read {
    pub(super) loaded: Vec<Loaded>,
    pub(super) factors: Vec<Factor>,
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
    /// A torque contradicts the model.
    pub(super) has_suspects: bool,
    /// What acts beside the model, and is eliminated.
    pub(super) beside: Beside,
}

/// What acts beside the model.
#[derive(Default)]
pub(super) struct Beside {
    /// The sources whose rows are taken, where they are not those that were read: one a recording.
    sources: Vec<TreeSource>,
    /// What has columns.
    chosen: Vec<Unmodelled>,
    /// The same with its size.
    pub(super) found: Vec<Found>,
    /// The link on which something pushes that no sensor measures, by its number.
    pub(super) unmeasured: Option<usize>,
}

/// Reads the recordings, fits each and makes the factors of their parts.
pub(super) fn read(
    recordings: &[PathBuf],
    options: &MassOptions,
    caller: &Caller<'_>,
) -> Result<Read, Error> {
    let problem = ProblemOptions { friction: options.friction.clone(), ..ProblemOptions::default() };
    let mut read = Read::default();
    for path in recordings {
        caller.stage(&format!("reading {}", path.display()), 0.0);
        let loaded = Loaded::read(path, options.rig.as_deref(), None, &options.tree, &problem, caller)?;
        read.loaded.push(loaded);
    }
    let several = recordings.len() > 1;
    let mut sources = Vec::new();
    for (loaded, path) in read.loaded.iter().zip(recordings) {
        let name = path.display().to_string();
        let Some((source, (model, _))) = loaded.problem.tree().zip(loaded.nominal()) else {
            return Err(CalibrateError::NoTree(Some(name)).into());
        };
        let of = |text: &String| if several { format!("{name}: {text}") } else { text.clone() };
        read.notes.extend(loaded.notes.iter().map(of));
        read.warnings.extend(loaded.warnings.iter().map(of));
        for suspect in suspects(source, model)? {
            read.has_suspects = true;
            read.warnings.push(of(&suspect.text()));
        }
        let other = sources
            .first()
            .is_some_and(|first: &&TreeSource| first.channels().len() != source.channels().len());
        if other {
            let first = recordings.first().map_or_else(String::new, |first| first.display().to_string());
            return Err(CalibrateError::OtherChannels { name, first }.into());
        }
        sources.push(source);
    }
    caller.stage("what acts beside the model", 0.0);
    let mut beside = Beside::of(&sources, options, caller)?;
    let owned: Vec<&TreeSource> = beside.sources.iter().collect();
    let sources = if owned.is_empty() { sources } else { owned };
    let (mut factors, mut with) = (Vec::new(), Vec::new());
    if let Some(first) = sources.first() {
        let sigma = channel_sigma(first, &beside.chosen, caller)?;
        let parts = if several { 1 } else { options.parts };
        for source in &sources {
            factors.extend(plain_factors(&source.with_unmodelled(&beside.chosen), &sigma, parts, &Silent)?);
        }
        let count = first.parameters().len();
        with = beside::found(&Factor::merged(&factors), count, &beside.chosen);
    }
    beside.found = with;
    read.factors = factors;
    read.beside = beside;
    Ok(read)
}

impl Beside {
    /// Finds what acts beside the model in recordings of one robot.
    fn of(sources: &[&TreeSource], options: &MassOptions, caller: &Caller<'_>) -> Result<Self, Error> {
        let Some(first) = sources.first() else { return Ok(Self::default()) };
        // What is left where something acts would hide it.
        let sigma = match &first.input().contact {
            Some(contact) => contact.sigma.clone(),
            None => channel_sigma(first, &[], caller)?,
        };
        let mut own = Self::columns(sources, options, &sigma)?;
        let has_wrenches = options.external_wrench != ExternalWrench::None;
        // Where nothing acts there is no foot without a sensor either.
        if own.0.chosen.is_empty() || !has_wrenches {
            return Ok(own.1);
        }
        let mut best: Option<(f64, usize)> = None;
        for link in beside::ends(first) {
            let Some(sources) = pushed(sources, link)? else { continue };
            let factor = merged(&sources.iter().collect::<Vec<_>>(), &[], &sigma)?;
            let each = factor.residual_sum_of_squares() / (factor.rows() as f64).max(1.0);
            if own.0.is_worse_than(&factor) && best.is_none_or(|best| each < best.0) {
                best = Some((each, link));
            }
        }
        let Some((_, link)) = best else { return Ok(own.1) };
        let Some(eliminated) = pushed(sources, link)? else { return Ok(own.1) };
        own = Self::columns(&eliminated.iter().collect::<Vec<_>>(), options, &sigma)?;
        Ok(Self { sources: eliminated, unmeasured: Some(link), ..own.1 })
    }

    /// Chooses what has columns.
    fn columns(
        sources: &[&TreeSource],
        options: &MassOptions,
        sigma: &[f64],
    ) -> Result<(Choice, Self), Error> {
        let Some(first) = sources.first() else {
            return Ok((Choice::of(&Factor::new(0), 0, &[]), Self::default()));
        };
        let mut all = Unmodelled::of(first, options.external_wrench != ExternalWrench::None);
        let (mut always, mut count) = (Vec::new(), first.parameters().len());
        if options.external_wrench == ExternalWrench::Unknown && all.contains(&Unmodelled::BaseWrench) {
            all.retain(|own| *own != Unmodelled::BaseWrench);
            always.push(Unmodelled::BaseWrench);
            count += Unmodelled::BaseWrench.columns();
        }
        let both: Vec<Unmodelled> = always.iter().chain(&all).copied().collect();
        let choice = Choice::of(&merged(sources, &both, sigma)?, count, &all);
        always.extend(choice.chosen.iter().filter_map(|k| all.get(*k)));
        Ok((choice, Self { chosen: always, ..Self::default() }))
    }
}

/// Returns the factor of all recordings together, with columns of what may act beside the model.
fn merged(sources: &[&TreeSource], beside: &[Unmodelled], sigma: &[f64]) -> Result<Factor, Error> {
    let each = sources.iter().map(|source| plain_factor(&source.with_unmodelled(beside), sigma, &Silent));
    Ok(Factor::merged(&each.collect::<Result<Vec<_>, _>>()?))
}

/// Returns the sources in which nobody knows what acts at a link; `None` if there are no such rows.
fn pushed(sources: &[&TreeSource], link: usize) -> Result<Option<Vec<TreeSource>>, Error> {
    let refuse = |error: TreeSourceError| Error::from(ProblemError::from(error));
    let mut all = Vec::new();
    for source in sources {
        let input = source.input().with_unknown_wrench_at(link);
        let Some(input) = input.map_err(|error| refuse(TreeSourceError::Frames(error)))? else {
            return Ok(None);
        };
        all.push(source.of_same_model(input).map_err(refuse)?);
    }
    Ok(Some(all))
}
