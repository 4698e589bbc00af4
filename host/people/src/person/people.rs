//! Trials of one person: her model, and every trial tracked with it.

use std::ops::Range;

use hexapod::STANDARD_GRAVITY_MPS2 as GRAVITY;
use nalgebra::Vector3;
use rigident_shared::tree::{BaseMotion, Joint};

use super::anthropometry::GivenMass;
use super::contact::Dropped;
use super::error::PersonError;
use super::poses::distances;
use super::track::{TrackOptions, Tracked, UsedFrame, track};
use super::zeros::{drifts, zero};
use super::{alignment, level, plausible};
use crate::inverse_kinematics::marker_file::MarkerFile;
use crate::inverse_kinematics::subject::{HumanModel, Known, Subject, SubjectError, subject};
use rigident_fit::parallel;
use rigident_io::motion_capture::trial::Trial;
use rigident_model::ModelError;
use rigident_model::human::Sex;
use rigident_rows::moved::Moved;
use rigident_rows::tree::{Frame, Input, UnknownZero};

/// Frames of the standing trial that joint centres are found from, …
const STANDING: usize = 4;
/// … and of all moving ones together.
const MOVING: usize = 60;
/// Root mean square of the distances of markers from their links that no trial of a person has, m.
const LARGEST_DISTANCE_M: f64 = 0.025;
/// Windows of all trials in which markers are stored once frames are found, about, …
const WINDOWS: usize = 12;
/// … and frames in all of them.
const WINDOW_FRAMES: usize = 600;
/// Beside contacts that no plate measures at least this much of a trial is used, s: less are their beginnings
/// and ends.
const LEAST_BESIDE_S: f64 = 0.5;
/// The uncertainty of a stature that is given, that comes from a standing trial, and from a motion, 1 σ,
/// relative (assumed).
const HEIGHT_SIGMAS: [f64; 3] = [0.005, 0.03, 0.05];
/// A link is followed if so large a share of frames has a marker on it or beyond.
const FOLLOWED: f64 = 0.5;
/// This many markers show place and attitude of a link.
const WHOLE_PLACE: usize = 3;

/// The knowledge of a person and the request.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PeopleOptions {
    /// The model.
    pub kind: HumanModel,
    /// Stature, m; `None`: from the markers.
    pub height_m: Option<f64>,
    /// Mass that the table is scaled to, kg; `None`: from the plates.
    pub mass_kg: Option<f64>,
    /// The sex whose means the table has.
    pub sex: Sex,
    /// Right joints are where left ones are, mirrored.
    pub symmetric: bool,
    /// Markers whose names say nothing, or something else.
    pub own_markers: MarkerFile,
    /// Lengths from elsewhere, m, as in [`Known::lengths_m`].
    pub lengths_m: Vec<(String, f64)>,
    /// Segments whose masses are known otherwise.
    pub given: Vec<GivenMass>,
    /// Plates that are always loaded read zero without load: they were reset right before each trial.
    pub plates_zeroed: bool,
    /// The way trials are tracked.
    pub track: TrackOptions,
    /// The number of trials, the first ones, in which the person holds something.
    pub holding_first: usize,
}

/// A person with all her trials.
pub struct Person {
    /// The model, its links that no marker follows fixed to their parents.
    pub subject: Subject,
    /// Names of links that no marker follows.
    pub fixed: Vec<String>,
    /// The uncertainty of the stature, 1 σ, relative.
    pub height_sigma: f64,
    /// Segments whose masses are known otherwise.
    pub given: Vec<GivenMass>,
    /// The trials, in their order.
    pub trials: Vec<Tracked>,
    /// The notes.
    pub notes: Vec<String>,
    /// The warnings that the answer may be wrong.
    pub warnings: Vec<String>,
}

impl Person {
    /// Returns a person from trials, of which `standing` is one that she stands upright in. Plates' samples,
    /// and markers that are not needed any more, are taken out of the trials.
    ///
    /// # Errors
    /// [`PersonError`] says what is wrong with which trial.
    pub fn new(
        trials: &mut [Trial],
        standing: Option<&Trial>,
        options: &PeopleOptions,
        progress: &(dyn Fn(&str, f64) + Sync),
    ) -> Result<Self, PersonError> {
        refuse_empty(trials)?;
        let mut warnings = drifts(trials);
        let (mut notes, unzeroed) = zero(trials, options.plates_zeroed);
        let (subject, fixed) = scaled(trials, standing, options, progress)?;
        warnings.extend(doubtful_stature(&subject, options.height_m)?);
        notes.extend(compared_lengths(&options.lengths_m, &subject));
        notes.extend(assumptions(&subject, &fixed, standing.is_some(), options));
        let (tracked, of_contacts) = track_all(trials, unzeroed, &subject, options, progress)?;
        warnings.extend(of_contacts);
        let height_sigma =
            HEIGHT_SIGMAS[usize::from(options.height_m.is_none()) * (1 + usize::from(standing.is_none()))];
        let given = options.given.clone();
        let mut person = Self { subject, fixed, height_sigma, given, trials: tracked, notes, warnings };
        person.take_given()?;
        plausible::belong_together(&person, options.holding_first)?;
        if let Some(share) = plausible::share_of_needed(&person, options.holding_first) {
            plausible::can_weigh(&person, share)?;
            if options.mass_kg.is_none() {
                person.scale_mass(share);
            }
        }
        for trial in options.holding_first..person.trials.len() {
            person.trials[trial].report.tilt = level::tilt(&person, trial);
        }
        let leans = person.trials.iter().filter(|own| own.report.tilt.is_some_and(|tilt| !tilt.is_a_slope()));
        person.warnings.extend(leans.filter_map(Tracked::tilt_words));
        Ok(person)
    }

    /// Makes the table's bodies the given number of times as heavy, but for those whose masses are given.
    fn scale_mass(&mut self, by: f64) {
        self.subject.person.mass_kg *= by;
        let given = &self.given;
        let others =
            self.subject.model.links.iter_mut().filter(|l| given.iter().all(|own| own.link != l.name));
        others.flat_map(|link| link.nominal.iter_mut().flatten()).for_each(|v| *v *= by);
    }

    /// Gives segments the masses that are known, with the same shape.
    fn take_given(&mut self) -> Result<(), ModelError> {
        for own in &self.given {
            let link = self.subject.model.link(&own.link).ok_or_else(|| {
                let links: Vec<&str> = self.subject.model.links.iter().map(|l| l.name.as_str()).collect();
                ModelError::Option(format!(
                    "`segment_mass`: there is no segment {}; there are {}",
                    own.link,
                    links.join(", ")
                ))
            })?;
            if let Some(phi) = &mut self.subject.model.links[link].nominal {
                let by = own.kg / phi[0];
                phi.iter_mut().for_each(|v| *v *= by);
            }
        }
        Ok(())
    }

    /// Returns some of the frames of a trial that rows are made of, by their place among them, as those of a
    /// tree whose base is tracked.
    pub fn input(&self, trial: usize, frames: Range<usize>) -> Option<Input> {
        let tracked = self.trials.get(trial)?;
        let own = tracked.frames.get(frames)?.iter();
        let moved = |f: &UsedFrame| Some((*f, tracked.coordinates.at(&tracked.smoother, f.number)?));
        Some(Self::input_of(&self.subject, tracked, own.filter_map(moved)))
    }

    /// Returns the same of frames with the joints of a subject.
    pub fn input_of(
        subject: &Subject,
        tracked: &Tracked,
        frames: impl IntoIterator<Item = (UsedFrame, Moved)>,
    ) -> Input {
        let frame = |(own, moved): (UsedFrame, Moved)| {
            let [fx, fy, fz, mx, my, mz] = own.wrench.map(f64::from);
            let at = Vector3::from_iterator(moved.positions.iter().take(3).copied());
            // About the base's origin.
            let moment = Vector3::new(mx, my, mz) - at.cross(&Vector3::new(fx, fy, fz));
            Frame {
                time_ns: tracked.time_ns(own.number),
                positions: moved.positions,
                rates: moved.rates,
                base: BaseMotion::still([0.0, 0.0, -GRAVITY]),
                wrench: [fx, fy, fz, moment.x, moment.y, moment.z],
                efforts: Vec::new(),
                standing: Vec::new(),
                ground: Default::default(),
            }
        };
        Input::tracked(
            subject.model.welded(),
            frames.into_iter().map(frame).collect(),
            tracked.report.rate_hz,
        )
    }

    /// Returns the table's centre of mass in a frame of a trial, m.
    pub fn table_centre(&self, trial: usize, frame: usize) -> Option<Vector3<f64>> {
        let places = self.trials.get(trial)?.places(&self.subject, frame)?;
        Some(alignment::centre_of_mass(&self.subject, &places))
    }
}

/// Refuses trials without forces of the ground, and those without frames.
fn refuse_empty(trials: &[Trial]) -> Result<(), PersonError> {
    if let Some(trial) = trials.iter().find(|t| t.ground.is_empty()) {
        let why = trial.notes.first().map_or("there are no forces of the ground", String::as_str);
        return Err(PersonError::NoFrames {
            name: trial.name.clone(),
            why: format!(
                "{why}: the forces between person and ground are needed; for a TRC or CSV file name them \
                 with `ground` FILE"
            ),
        });
    }
    if let Some(trial) = trials.iter().find(|t| t.frames() == 0) {
        let why = "there are no frames".to_owned();
        return Err(PersonError::NoFrames { name: trial.name.clone(), why });
    }
    Ok(())
}

/// Returns the model that is scaled to the markers of trials, its links that no marker follows fixed, and the
/// names of those.
fn scaled(
    trials: &[Trial],
    standing: Option<&Trial>,
    options: &PeopleOptions,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<(Subject, Vec<String>), PersonError> {
    let labels = labels(trials, standing);
    let frames = chosen_frames(&labels, trials, standing);
    progress("joint centres", 0.0);
    let known = Known {
        height_m: options.height_m,
        mass_kg: options.mass_kg.or_else(|| weight(&trials[options.holding_first..])).unwrap_or(70.0),
        sex: options.sex,
        symmetric: options.symmetric,
        own_markers: options.own_markers.clone(),
        lengths_m: options.lengths_m.clone(),
    };
    let fitted = subject(&labels, &frames, options.kind, &known)?;
    for trial in standing.into_iter().chain(trials) {
        no_twins(trial, &fitted)?;
    }
    if let Some(trial) = standing {
        let (rms_m, by_marker) = distances(&fitted, trial, STANDING);
        on_the_model(&trial.name, rms_m, &by_marker)?;
    }
    follow(fitted, &labels, trials)
}

/// Tells what is assumed of a person because neither markers nor options say it.
fn assumptions(subject: &Subject, fixed: &[String], stands: bool, options: &PeopleOptions) -> Vec<String> {
    let mut notes = Vec::new();
    if !fixed.is_empty() {
        notes.push(format!("no marker, or too few, follow {}: fixed to the link before", fixed.join(", ")));
    }
    if options.sex == Sex::Unknown {
        notes.push(format!(
            "the table is of {}: say `table` female or male if it is known",
            options.sex.words()
        ));
    }
    if !stands && options.height_m.is_none() {
        notes.push(format!(
            "the stature, {:.2} m, comes from a pose in motion: who is bent there is found too small; give \
             `static` or `height_m`",
            subject.person.height_m
        ));
    } else if stands && options.height_m.is_none() {
        notes.push(format!(
            "the stature, {:.2} m, comes from the standing trial's markers, to some per cent; the table is \
             scaled by it: give `height_m` if it is known",
            subject.person.height_m
        ));
    }
    if subject.unseen_trunk.is_some() {
        notes.push("no marker follows the trunk: it is taken to stay upright".to_owned());
    }
    notes
}

/// Refuses to guess a stature of who is upright in no frame, and warns of one that is given and is not that
/// of the markers.
fn doubtful_stature(subject: &Subject, given_m: Option<f64>) -> Result<Option<String>, PersonError> {
    let found = subject.stature;
    let Some(given_m) = given_m else {
        return if found.upright { Ok(None) } else { Err(PersonError::NeverUpright) };
    };
    let by = if found.upright { "in an upright frame" } else { "by the length of the legs" };
    Ok(found.contradicts(given_m).then(|| {
        format!(
            "the stature is given as {given_m:.2} m, and {by} the markers make somebody {:.2} m tall: trunk, \
             head, hands and feet of the table are scaled by it; check `height_m`",
            found.height_m
        )
    }))
}

/// Tracks every trial, and takes what is not needed any more out of them; with warnings of contacts that no
/// plate measures.
fn track_all(
    trials: &mut [Trial],
    unzeroed: Vec<Vec<UnknownZero>>,
    subject: &Subject,
    options: &PeopleOptions,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<(Vec<Tracked>, Vec<String>), PersonError> {
    let (mut tracked, mut warnings) = (Vec::new(), Vec::new());
    let count = trials.len();
    for (k, (trial, unzeroed)) in trials.iter_mut().zip(unzeroed).enumerate() {
        let step = |share: f64| progress("poses", (k as f64 + share) / count as f64);
        let options = TrackOptions { holds: k < options.holding_first, ..options.track };
        let mut own = track(trial, subject, &options, &step)?;
        own.unzeroed = unzeroed;
        on_the_model(&own.name, own.report.rms_m, &own.report.by_marker)?;
        warnings.extend(without_contacts(&mut own));
        // What frames need of the plates is in the frames.
        trial.ground.iter_mut().for_each(|plate| plate.wrench = Vec::new());
        let windows = (WINDOWS / count).max(1);
        own.keep_windows(trial, windows, WINDOW_FRAMES.div_ceil(count * windows));
        if own.windows.is_empty() && !own.frames.is_empty() {
            let why = format!("{}; cut the recording to where she is on the plates", own.why_unused());
            return Err(PersonError::NoFrames { name: own.name, why });
        }
        tracked.push(own);
    }
    Ok((tracked, warnings))
}

/// Returns the names of all markers.
fn labels(trials: &[Trial], standing: Option<&Trial>) -> Vec<String> {
    let mut labels: Vec<String> = Vec::new();
    for label in standing.into_iter().chain(trials).flat_map(|t| &t.labels) {
        if !labels.contains(label) {
            labels.push(label.clone());
        }
    }
    labels
}

/// Frames that joint centres are found from: some of the standing trial, then some of each other one.
fn chosen_frames(
    labels: &[String],
    trials: &[Trial],
    standing: Option<&Trial>,
) -> Vec<Vec<Option<Vector3<f64>>>> {
    let each = MOVING.div_ceil(trials.len().max(1));
    let of = |trial: &Trial, count: usize| -> Vec<Vec<Option<Vector3<f64>>>> {
        let own: Vec<Option<usize>> =
            labels.iter().map(|l| trial.labels.iter().position(|k| k == l)).collect();
        let seen = |frame: usize| -> Vec<Option<Vector3<f64>>> {
            own.iter().map(|l| l.and_then(|l| trial.point(frame, l))).collect()
        };
        // Of each stretch the frame with most markers.
        let count = count.min(trial.frames());
        let stretch = |k: usize| k * trial.frames() / count..(k + 1) * trial.frames() / count;
        let markers =
            |frame: &usize| own.iter().flatten().filter(|l| trial.point(*frame, **l).is_some()).count();
        let chosen: Vec<usize> =
            parallel::map(parallel::threads(), count, |k| stretch(k).max_by_key(markers))
                .into_iter()
                .flatten()
                .collect();
        // A stretch in which cameras were blind tells nothing of joints.
        let most = chosen.iter().map(markers).max().unwrap_or(0);
        chosen.into_iter().filter(|frame| 2 * markers(frame) >= most).map(seen).collect()
    };
    let mut frames = standing.map_or_else(Vec::new, |trial| of(trial, STANDING));
    for trial in trials {
        frames.extend(of(trial, each));
    }
    frames
}

/// Returns the person's mass by the plates, kg: the largest mean of the vertical force over any second of a
/// trial where it is steady. It is a first guess for the table alone.
fn weight(trials: &[Trial]) -> Option<f64> {
    let best = trials.iter().filter_map(|trial| {
        let rate = trial.ground.first()?.rate_hz;
        let count = trial.ground.iter().map(|p| p.wrench.len()).min()?;
        let total = |k: usize| trial.ground.iter().map(|p| f64::from(p.wrench[k][2])).sum::<f64>();
        let stretch = ((rate * 0.5) as usize).clamp(1, count.max(1));
        let means = (0..count / stretch).map(|s| {
            let sum: f64 = (s * stretch..(s + 1) * stretch).map(total).sum();
            sum / stretch as f64
        });
        means.filter(|m| m.is_finite()).max_by(f64::total_cmp)
    });
    best.max_by(f64::total_cmp).map(|force| force / GRAVITY)
}

/// Refuses markers that are used and have one name.
fn no_twins(trial: &Trial, subject: &Subject) -> Result<(), PersonError> {
    let count = |name: &str| trial.labels.iter().filter(|label| *label == name).count();
    match subject.markers.iter().find(|marker| count(&marker.name) > 1) {
        Some(marker) => Err(PersonError::Twice { name: trial.name.clone(), marker: marker.name.clone() }),
        None => Ok(()),
    }
}

/// Refuses a trial whose markers are not where the model has them.
fn on_the_model(name: &str, rms_m: f64, by_marker: &[(String, f64)]) -> Result<(), PersonError> {
    let farthest = by_marker.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    match farthest.filter(|_| rms_m > LARGEST_DISTANCE_M) {
        Some((marker, _)) => Err(PersonError::OffTheModel {
            name: name.to_owned(),
            off_mm: 1e3 * rms_m,
            marker: marker.clone(),
        }),
        None => Ok(()),
    }
}

/// Tells what lengths from elsewhere became.
fn compared_lengths(given: &[(String, f64)], subject: &Subject) -> Option<String> {
    let each = given.iter().filter_map(|(name, length)| {
        let found = subject.person.length(name)?;
        Some(format!("{} {length:.3} ({found:.3})", name.replace('_', " ")))
    });
    let each: Vec<String> = each.collect();
    (!each.is_empty()).then(|| format!("lengths by `osim`, and with the markers, m: {}", each.join(", ")))
}

/// Drops what contacts that no plate measures leave of a trial if it is too little; tells of them.
fn without_contacts(tracked: &mut Tracked) -> Option<String> {
    let contacts = tracked.contacts()?;
    let left_s = tracked.frames.len() as f64 / tracked.report.rate_hz;
    let what = if left_s < LEAST_BESIDE_S {
        tracked.drop_all(Dropped::Unmeasured);
        "too little is left of the trial".to_owned()
    } else {
        format!("these times are left out, {left_s:.1} s are used")
    };
    Some(format!("{}: {contacts}; {what}", tracked.name))
}

/// Fixes links that no marker follows to their parents.
fn follow(
    mut subject: Subject,
    labels: &[String],
    trials: &[Trial],
) -> Result<(Subject, Vec<String>), PersonError> {
    let is_seen = |name: &str| {
        trials.iter().all(|trial| {
            let Some(label) = trial.labels.iter().position(|l| l == name) else { return false };
            let count = (0..trial.frames()).filter(|f| trial.point(*f, label).is_some()).count();
            count as f64 > FOLLOWED * trial.frames() as f64
        })
    };
    debug_assert!(subject.markers.iter().all(|m| labels.contains(&m.name)));
    let mut followed = vec![false; subject.model.links.len()];
    let mut own = vec![0; subject.model.links.len()];
    for marker in subject.markers.iter().filter(|m| is_seen(&m.name)) {
        own[marker.link] += 1;
        for link in subject.way(marker.link) {
            followed[*link] = true;
        }
    }
    let turns_freely = |link: usize| matches!(subject.model.links[link].link.joint, Joint::Spherical);
    for (i, link) in subject.model.links.iter().enumerate().skip(1) {
        // Two balls, and no marker between them: only a link whose place is known as a whole shows how the
        // first one is turned. The shoulder girdle is light.
        let bare = turns_freely(i) && turns_freely(link.link.parent) && own[link.link.parent] == 0;
        let is_spine = !link.name.starts_with("l_") && !link.name.starts_with("r_");
        if bare && is_spine && own[i] < WHOLE_PLACE {
            followed[i] = false;
        }
    }
    let trunk = subject.model.link("torso").or_else(|| subject.model.link("lumbar"));
    subject.unseen_trunk = trunk.filter(|trunk| followed.get(*trunk) == Some(&false));
    let names = subject.model.links.iter().zip(&followed).enumerate();
    let names = names.filter(|(i, (_, f))| !**f && Some(*i) != subject.unseen_trunk);
    let fixed: Vec<String> = names.map(|(_, (l, _))| l.name.clone()).collect();
    if !fixed.is_empty() {
        subject = subject.with_fixed(&fixed).ok_or(SubjectError::Calibration)?;
    }
    Ok((subject, fixed))
}
