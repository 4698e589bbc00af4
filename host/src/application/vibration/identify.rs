//! One body on springs: its modes, and the body by them and by the motion.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde::Serialize;

use super::super::bare_platform::take_platform_off;
use super::super::vibration_error::VibrationError;
use super::super::{Caller, Error, Loaded};
use rigident_fit::pool::PooledFactor;
use rigident_fit::{Fit, Progress};
use rigident_identify::answer::{Answer, Context, Source, Status};
use rigident_io::recording::Recording;
use rigident_io::rig::RigFile;
use rigident_present::modes_page::{self, Scene};
use rigident_present::vibration as present;
use rigident_vibration::suspension::bare::{is_stated, massless};
use rigident_vibration::suspension::by_modes::{Refused, by_modes};
use rigident_vibration::suspension::free_decay::{Vibration, vibration};
use rigident_vibration::suspension::mount::Mount;
use rigident_vibration::suspension::springs::COORDINATES;
use rigident_vibration::suspension::support::Support;
use rigident_vibration::suspension::suspects::judged_rests;

/// Answers of two ways that differ by more than this many times both uncertainties contradict each other.
const CONTRADICTORY: f64 = 1.5;
/// The numbers of modes that there may be.
const MODES: std::ops::RangeInclusive<usize> = 1..=12;

/// Options of the identification from a vibration.
#[derive(Clone, Debug, Default)]
pub struct VibrationOptions {
    /// Rig file. Default: `NAME.rig.toml` beside the recording.
    pub rig: Option<PathBuf>,
    /// The number of modes. Default: one for each coordinate that is free.
    pub modes: Option<usize>,
}

/// A body on springs by its modes and by its motion, beside each other.
#[derive(Clone, Debug, Serialize)]
pub struct IdentifiedVibration {
    /// Name of this object.
    pub schema: &'static str,
    /// The recording.
    pub recording: String,
    /// The modes.
    pub modes: Vec<present::ModeRow>,
    /// Findings about the modes.
    pub findings: Vec<String>,
    /// The body by the modes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by_modes: Option<Answer>,
    /// The body by the motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub by_motion: Option<Answer>,
    /// Notes on the steps taken.
    pub notes: Vec<String>,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
    /// Factors by the names of their files, the platform on them, and those of the body alone where the
    /// platform is known.
    #[serde(skip)]
    pub factors: Vec<(&'static str, PooledFactor)>,
    #[serde(skip)]
    scene: Scene,
    #[serde(skip)]
    vibration: Vibration,
}

/// Identifies one body on springs.
///
/// # Errors
/// The recording cannot be read, is of several links, or has no modes; the caller stops the job.
pub fn vibration_identify(
    recording: &Path,
    options: &VibrationOptions,
    caller: &Caller<'_>,
) -> Result<IdentifiedVibration, Error> {
    vibration_of(vibration_recording(recording, options)?, options.modes, caller)
}

/// Reads the recording of one body on springs, and checks the number of modes that is asked for.
///
/// # Errors
/// It cannot be read, or is of several links.
pub fn vibration_recording(path: &Path, options: &VibrationOptions) -> Result<Recording, Error> {
    if options.modes.is_some_and(|n| !MODES.contains(&n)) {
        return Err(VibrationError::Modes.into());
    }
    let recording = Recording::load(path, options.rig.as_deref())?;
    if recording.rig.link.len() > 1 {
        return Err(VibrationError::Links(path.display().to_string()).into());
    }
    Ok(recording)
}

/// Identifies one body on springs of a recording in memory; `modes` is their number, by default one for each
/// coordinate that is free.
///
/// # Errors
/// It has no modes, or no answer; the caller stops the job.
///
/// ```
/// use rigident::application::{Caller, vibration_of};
/// # #[cfg(feature = "simulator")]
/// # {
/// use hexapod::BodyParameters;
/// use rigident::laboratory::suspended::Experiment;
///
/// let swing = Experiment::of_body(BodyParameters::thesis_horizontal(), 2e-4, 1).swing().unwrap();
/// let found = vibration_of(swing, None, &Caller::default())?;
/// assert!(found.modes.len() == 6 && found.is_identified());
/// # }
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn vibration_of(
    recording: Recording,
    modes: Option<usize>,
    caller: &Caller<'_>,
) -> Result<IdentifiedVibration, Error> {
    caller.stoppable(|| found(recording, modes, caller))
}

fn found(
    recording: Recording,
    modes: Option<usize>,
    caller: &Caller<'_>,
) -> Result<IdentifiedVibration, Error> {
    let support = Support::of(&recording.rig, &recording.name).map_err(VibrationError::from)?;
    caller.stage("modes", 0.0);
    let vibration = vibration(&recording, &support, modes).map_err(VibrationError::from)?;
    caller.stage("body", 0.7);
    let mut warnings = recording.warnings.clone();
    let rows = vibration.samples.values.nrows();
    let (mut by_modes, refused) = match by_modes(&support, &vibration) {
        Ok(fit) => (Some(answered(&recording, fit, rows)?), None),
        Err(why) => (None, Some(why)),
    };
    // What springs are not, they are for the motion neither.
    let has_motion = !vibration.samples.is_of_imu() && !matches!(refused, Some(Refused::Springs(_)));
    let by_motion = has_motion
        .then(|| by_motion(recording.clone(), caller))
        .and_then(|own| own.map_err(|why| warnings.push(format!("no body by the motion: {why}"))).ok());
    match &refused {
        None => {}
        Some(Refused::Springs(why)) => {
            warnings.insert(0, format!("no body, neither by the modes nor by the motion: {why}"))
        }
        Some(Refused::Modes(why)) => warnings.insert(0, format!("no body by the modes: {why}")),
    }
    if let (Some(modes), Some(motion)) = (&mut by_modes, &by_motion) {
        modes.of_the_readings_of(motion);
    }
    let answers = [&by_modes, &by_motion].map(|way| way.as_ref().map(|found| &found.answer));
    let differ = present::differences(answers);
    warnings.extend(differ.iter().filter(|(_, ratio)| *ratio > CONTRADICTORY).map(|(name, ratio)| {
        format!(
            "{name} by the modes and by the motion differ by {ratio:.1} times their uncertainty: are springs \
             linear, and is nothing loose?"
        )
    }));
    let coordinates: Vec<&'static str> = support.free.iter().map(|k| COORDINATES[*k]).collect();
    let mut found = IdentifiedVibration {
        schema: "rigident/vibration/1",
        recording: recording.name.clone(),
        modes: present::mode_rows(&vibration.modes.shapes, &coordinates),
        findings: vibration.modes.findings.iter().map(ToString::to_string).collect(),
        scene: scene(&recording.rig, answers),
        by_modes: None,
        by_motion: None,
        notes: notes(&recording.rig, &vibration, &support),
        warnings,
        factors: Vec::new(),
        vibration,
    };
    let ways = [
        (by_modes, &mut found.by_modes, ["modes.factor", "modes.body.factor"]),
        (by_motion, &mut found.by_motion, ["motion.factor", "motion.body.factor"]),
    ];
    for (own, answer, [all, body]) in ways {
        let Some(own) = own else { continue };
        *answer = Some(own.answer);
        found.factors.push((all, own.factor));
        found.factors.extend(own.body.map(|factor| (body, factor)));
    }
    Ok(found)
}

fn notes(rig: &RigFile, vibration: &Vibration, support: &Support) -> Vec<String> {
    let samples = &vibration.samples;
    let mut notes: Vec<String> = rig.suspension.as_ref().and_then(massless).into_iter().collect();
    notes.extend(judged_rests(support, vibration).iter().map(ToString::to_string));
    if samples.left_out > 0 {
        notes.push(format!(
            "{} rows are not in the modes: before or after a gap in time, before the release, or while the \
             amplitude was too large",
            samples.left_out
        ));
    }
    if samples.filled_in > 0 {
        notes.push(format!(
            "{} samples that are missing in gaps are filled in by the modes of the others",
            samples.filled_in
        ));
    }
    if samples.is_of_imu() {
        notes.push(
            "the recording has no poses: the body is identified by the modes of the IMU's readings alone"
                .to_owned(),
        );
    }
    notes
}

/// The result of one way.
struct Found {
    /// With the bare platform taken off.
    answer: Answer,
    /// With it on.
    factor: PooledFactor,
    /// Of the body alone, where the platform is known.
    body: Option<PooledFactor>,
}

impl Found {
    /// Says that its factors are of the same readings as another's: merged they would count the same noise
    /// twice.
    fn of_the_readings_of(&mut self, other: &Self) {
        let fingerprint = other.factor.sources.first().map(|source| source.fingerprint);
        for factor in std::iter::once(&mut self.factor).chain(&mut self.body) {
            factor.sources.iter_mut().zip(fingerprint).for_each(|(source, own)| source.fingerprint = own);
        }
    }
}

/// Answers from a fit with the bare platform taken off.
fn answered(recording: &Recording, mut fit: Fit, rows: usize) -> Result<Found, Error> {
    let factor = PooledFactor::of(&fit, &recording.name);
    let body = without_platform(&recording.rig, &mut fit, &recording.name)?;
    let source = Source {
        recording: recording.name.clone(),
        recorded: recording.recorded(),
        rows: rows as u64,
        rate_hz: recording.rate_hz,
        duration_s: recording.rate_hz.map(|hz| rows as f64 / hz),
        mcu: "host".to_owned(),
    };
    let context = Context {
        body: recording.rig.body.as_ref(),
        truth: recording.rig.truth.as_ref(),
        source,
        ..Context::default()
    };
    Ok(Found { answer: Answer::new(&fit, context)?, factor, body })
}

/// Takes the platform off, and returns the factor of the body alone if there was one: other rigs have no such
/// platform.
fn without_platform(rig: &RigFile, fit: &mut Fit, name: &str) -> Result<Option<PooledFactor>, Error> {
    let Some(table) = rig.suspension.as_ref().filter(|table| is_stated(table)) else {
        return Ok(None);
    };
    take_platform_off(table, fit)?;
    let of_body = |_| PooledFactor::of(fit, name).only(|parameter| parameter.kind.is_inertial());
    Ok(fit.solved.as_ref().map(of_body))
}

/// Identifies the body by its motion, as from any recording.
fn by_motion(recording: Recording, caller: &Caller<'_>) -> Result<Found, Error> {
    let loaded = Loaded::of_body(recording, None, caller)?;
    let mut fit = loaded.fit(None, 0, caller)?;
    let factor = loaded.factor(&fit);
    let rig = &loaded.problem.rig;
    let body = without_platform(rig, &mut fit, &loaded.problem.name)?;
    let context = Context {
        body: rig.body.as_ref(),
        truth: rig.truth.as_ref(),
        source: loaded.origin("host"),
        notes: loaded.notes.clone(),
        warnings: loaded.warnings.clone(),
        findings: loaded.problem.findings.clone(),
        ..Context::default()
    };
    Ok(Found { answer: Answer::new(&fit, context)?, factor, body })
}

/// Returns the body on the springs, with the centre of mass of the first answer that has one.
fn scene(rig: &RigFile, answers: [Option<&Answer>; 2]) -> Scene {
    let table = rig.suspension.clone().unwrap_or_default();
    let mount = Mount::of(&table);
    let at = Vector3::from(table.at_m);
    let com = answers.iter().flatten().find_map(|answer| answer.com_m);
    Scene {
        anchors_m: table.spring.iter().map(|spring| spring.at_m).collect(),
        at_m: table.at_m,
        com_m: com.map(|com| (at + mount.arm + mount.rotation * Vector3::from(com)).into()),
    }
}

impl IdentifiedVibration {
    /// Returns the answers by the modes and by the motion.
    pub fn answers(&self) -> [Option<&Answer>; 2] {
        [self.by_modes.as_ref(), self.by_motion.as_ref()]
    }

    /// Returns true if the body is identified in one way at least.
    pub fn is_identified(&self) -> bool {
        self.answers().into_iter().flatten().any(|answer| answer.status == Status::Identified)
    }

    /// Returns modes and both answers as text.
    pub fn text(&self) -> String {
        present::text(&self.modes, self.answers())
    }

    /// Returns the spectrum with the modes, SVG.
    ///
    /// # Errors
    /// [`VibrationError::Spectrum`] if the samples are too few for one.
    pub fn spectrum(&self) -> Result<String, Error> {
        let samples = &self.vibration.samples;
        let spectrum = samples.spectrum().map_err(VibrationError::from)?;
        Ok(present::spectrum_svg(&spectrum, &samples.names, &self.modes))
    }

    /// Returns the page of the modes, HTML, with this spectrum.
    pub fn page(&self, spectrum: &str) -> String {
        let said: Vec<&str> = self.warnings.iter().chain(&self.findings).map(String::as_str).collect();
        modes_page::page(&self.recording, &self.modes, &self.scene, spectrum, (&said, &self.text()))
    }
}
