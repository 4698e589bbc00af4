//! A tree on springs by locked postures.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::super::bare_platform::take_platform_off;
use super::super::recorded::is_recording;
use super::super::vibration_error::VibrationError;
use super::super::{Caller, Error};
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Fit, Progress};
use rigident_io::recording::Recording;
use rigident_present::posture_sets::{Bar, figure};
use rigident_rows::named_model::rig_links;
use rigident_vibration::suspension::posture_checks::contradiction;
use rigident_vibration::suspension::posture_file::PosturesFile;
use rigident_vibration::suspension::posture_sets::{
    NextPosture, OpenBounds, PostureSet, Subset, SubsetValue, next, sets, shares,
};
use rigident_vibration::suspension::postures::PostureSource;
use rigident_vibration::suspension::recorded_postures::{self, RecordedPosture};
use rigident_vibration::suspension::settled::settled;
use rigident_vibration::suspension::support::Support;

/// The identification of a tree from locked postures; its text is the tables.
#[derive(Clone, Debug, Serialize)]
pub struct IdentifiedPostures {
    /// Name of this object.
    pub schema: &'static str,
    /// Number of the base parameters.
    pub parameters: usize,
    /// Number of their directions that the postures determine.
    pub determined: usize,
    /// True if the uncertainty is stated, false if the postures' scatter tells it.
    pub sigma_stated: bool,
    /// The origin of the uncertainty, in words.
    #[serde(skip)]
    pub(super) from: &'static str,
    /// The quantities that the postures determine by theory: Φ_s of the vibration paper.
    pub subset: Vec<PostureValue>,
    /// The bounds of what they leave open.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub open: Option<OpenBounds>,
    /// Sets of postures.
    pub sets: Vec<NamedSet>,
    /// The share of the errors of each posture in the variance of what is determined, on average.
    pub shares: Vec<PostureShare>,
    /// The posture to take next.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next: Option<NextPosture>,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
    /// The factor of all postures, of recordings the platform on it.
    #[serde(skip)]
    pub factor: PooledFactor,
}

/// A quantity of Φ_s.
#[derive(Clone, Debug, Serialize)]
pub struct PostureValue {
    /// The quantity.
    #[serde(flatten)]
    pub found: SubsetValue,
    /// The value from another source, stated in the file of postures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<f64>,
}

/// A set of postures.
#[derive(Clone, Debug, Serialize)]
pub struct NamedSet {
    /// Names of the postures.
    pub postures: Vec<String>,
    /// Rank over the base parameters.
    pub rank: usize,
    /// Condition number over what they tell.
    pub condition: f64,
}

/// The part of a posture in the variance.
#[derive(Clone, Debug, Serialize)]
pub struct PostureShare {
    /// The name of the posture.
    pub posture: String,
    /// The share of the posture, 0 to 1.
    pub share: f64,
}

/// Identifies what locked postures tell of a tree: a file of postures, TOML, or the recordings of their free
/// vibration, one for each.
/// `rig` is the rig file of all recordings, by default that of the first, `NAME.rig.toml` beside it.
///
/// # Errors
/// A file cannot be read, a joint is not locked, or postures do not fit the tree; the caller stops the job.
///
/// ```
/// use rigident::application::{Caller, vibration_postures};
///
/// let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/examples/two-link-postures.toml");
/// let found = vibration_postures(&[file.into()], None, &Caller::default())?;
/// // Three postures of two links on a spherical joint leave one number open, and bound it.
/// assert!(found.determined + 1 == found.parameters);
/// assert!(found.open.is_some_and(|open| open.least < open.most));
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn vibration_postures(
    files: &[PathBuf],
    rig: Option<&Path>,
    caller: &Caller<'_>,
) -> Result<IdentifiedPostures, Error> {
    caller.stoppable(|| {
        let is_recorded = files.len() > 1 || files.iter().any(|file| is_recording(file));
        if is_recorded { recordings(files, rig, caller) } else { of_file(files, rig) }
    })
}

/// Returns what a file of postures tells.
fn of_file(files: &[PathBuf], rig: Option<&Path>) -> Result<IdentifiedPostures, Error> {
    let path = files.first().ok_or(VibrationError::NoFile)?;
    if rig.is_some() {
        return Err(VibrationError::RigOfPostures.into());
    }
    let what = path.display().to_string();
    let file: PosturesFile = toml::from_str(&Error::text_of(path)?)
        .map_err(|e| VibrationError::Postures(format!("{what}: {e}")))?;
    let source = PostureSource::new(&file, &what).map_err(VibrationError::from)?;
    let pooled = source.pooled();
    let fit = pooled.fit();
    let from = if source.sigma_given() { "what the file states" } else { "the scatter of the postures" };
    Ok(identified(&file, &source, (&fit, pooled), from))
}

/// Returns what recordings of locked postures tell.
fn recordings(
    files: &[PathBuf],
    rig: Option<&Path>,
    caller: &Caller<'_>,
) -> Result<IdentifiedPostures, Error> {
    caller.stage("reading the recordings", 0.0);
    let load = |path: &PathBuf| Recording::load(path, rig);
    let all = files.iter().map(load).collect::<Result<Vec<_>, _>>()?;
    let first = files.first().ok_or(VibrationError::NoFile)?.display().to_string();
    let rig = all.first().map(|recording| recording.rig.clone()).unwrap_or_default();
    if let Some(other) =
        all.iter().find(|own| own.rig.suspension != rig.suspension || own.rig.link != rig.link)
    {
        return Err(VibrationError::OtherRig { name: other.name.clone(), first }.into());
    }
    let model = rig_links::from_tables(&rig.link, &first)?.welded();
    let support = Support::of(&rig, &first).map_err(VibrationError::from)?;
    let table = rig.suspension.clone().unwrap_or_default();
    let (mut postures, mut findings) = (Vec::new(), Vec::new());
    for (k, recording) in all.iter().enumerate() {
        caller.stage(&format!("modes of {}", recording.name), k as f64 / all.len() as f64);
        let own = RecordedPosture::of(recording, &model, &support).map_err(VibrationError::from)?;
        findings.extend(own.findings.iter().map(|what| format!("{}: {what}", own.name)));
        postures.push(own);
    }
    let name = postures.iter().map(|own| own.name.as_str()).collect::<Vec<_>>().join(" + ");
    let together = recorded_postures::source(&model, &support, &postures, &name);
    let (source, mut fit) = together.map_err(VibrationError::from)?;
    let pooled = PooledFactor::of(&fit, &name);
    take_platform_off(&table, &mut fit)?;
    let mut found =
        identified(&PosturesFile::default(), &source, (&fit, pooled), "the modes and the springs");
    found.warnings.extend(findings);
    found.warnings.extend(settled(&table, &support, &postures));
    Ok(found)
}

fn identified(
    file: &PosturesFile,
    source: &PostureSource,
    (fit, factor): (&Fit, PooledFactor),
    from: &'static str,
) -> IdentifiedPostures {
    let subset = Subset::new(source.parameters(), source.model());
    let values = subset.values(fit);
    let leaf = source.model().links.get(1).and_then(|link| file.link_mass_kg.get(&link.name)).copied();
    let name = |k: &usize| source.names().get(*k).cloned().unwrap_or_default();
    let all = sets(source);
    let whole = all.iter().find(|set| set.postures.len() == source.names().len());
    let determined = whole.map_or(0, |set| set.rank);
    let warnings = warnings(source, &values, &all, determined);
    let shares = shares(source, &subset).into_iter().enumerate();
    let named = |set: PostureSet| NamedSet {
        postures: set.postures.iter().map(name).collect(),
        rank: set.rank,
        condition: set.condition,
    };
    let with_reference =
        |found: SubsetValue| PostureValue { reference: file.reference.get(&found.name).copied(), found };
    IdentifiedPostures {
        schema: "rigident/postures/1",
        parameters: source.parameters().len(),
        determined,
        sigma_stated: source.sigma_given(),
        from,
        open: subset.bounds(fit, leaf),
        subset: values.into_iter().map(with_reference).collect(),
        sets: all.into_iter().map(named).collect(),
        shares: shares.map(|(k, share)| PostureShare { posture: name(&k), share }).collect(),
        next: next(source),
        warnings,
        factor,
    }
}

fn warnings(
    source: &PostureSource,
    values: &[SubsetValue],
    sets: &[PostureSet],
    determined: usize,
) -> Vec<String> {
    let mut warnings: Vec<String> = contradiction(source).into_iter().collect();
    let open: Vec<&str> = values.iter().filter(|v| v.measured.is_none()).map(|v| v.name.as_str()).collect();
    if open.is_empty() {
        return warnings;
    }
    warnings.push(format!(
        "not determined by these postures: {}; take the next one that is proposed",
        open.join(", ")
    ));
    // A posture without which the rank is the same adds none.
    let names = source.names();
    for (k, name) in names.iter().enumerate().filter(|_| names.len() > 1) {
        let without: Vec<usize> = (0..names.len()).filter(|j| *j != k).collect();
        let fewer = sets.iter().find(|set| set.postures == without);
        if determined < source.parameters().len() && fewer.is_some_and(|set| set.rank == determined) {
            warnings.push(format!("{name} adds no rank: turn the joints elsewhere"));
        }
    }
    warnings
}

impl IdentifiedPostures {
    /// Returns true if the postures tell all that they can by theory.
    pub fn is_complete(&self) -> bool {
        self.subset.iter().all(|value| value.found.measured.is_some())
    }

    /// Returns rank and condition of every set of postures, SVG.
    pub fn figure(&self) -> String {
        let bar =
            |set: &NamedSet| Bar { name: set.postures.join(", "), rank: set.rank, condition: set.condition };
        figure(&self.sets.iter().map(bar).collect::<Vec<_>>())
    }
}
