//! A tree of links on the device: what it is given, its factor as it hands it over, and what became of its
//! frames.
//!
//! The device holds one level of the factor in single precision; it is taken row by row and merged here in
//! double ([`take_level`]), at the latest every [`LEVEL_FRAMES`] frames; a [`Session`] does so while it
//! follows them.

use std::sync::atomic::Ordering;

use rigident_shared::estimator::frames::{LEVEL_FRAMES, SUSPENDED_LINKS, TreeFactor};
use rigident_shared::inertia::PARAMETER_NAMES;
use rigident_shared::tree::Joint;
use rigident_shared::wire::{
    Command, FactorRow, FrameReport, LinkJoint, LinkSettings, MAX_LINKS, MAX_TREE_PARAMETERS, ModelSettings,
    Reason, Reply, Settings, Source, StateName,
};

use super::settings::{DeviceTiming, SettingsError, settings};
use super::{INTERRUPTED, Observer, Session, SessionError, Take, Taking};
use crate::link::{Client, LinkError};
use rigident_fit::{Kind, Owner, Parameter};
use rigident_io::rig::RigFile;
use rigident_model::ModelError;
use rigident_model::base::{BaseParameter, Rows, Situation, base_parameters};
use rigident_model::tree::Model;

/// The reason why a model does not fit onto the device.
#[derive(Debug, thiserror::Error)]
pub enum DeviceTreeError {
    /// The model makes no tree.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The tree's sensors are not described.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The offset is to be estimated.
    #[error(
        "on the device a tree has no room for the wrench's offset: give it in [load_cell] offset_n_nm as six \
         numbers, or as \"zero\""
    )]
    Offset,
    /// There are too many links.
    #[error(
        "the model has {0} links that move against each other, the device takes {MAX_LINKS}: weld some of \
         them"
    )]
    Links(usize),
    /// There are too many links on springs.
    #[error(
        "the model has {0} links that move against each other, the device takes {SUSPENDED_LINKS} on \
         springs: weld some of them, or lock their joints"
    )]
    OnSprings(usize),
    /// Springs whose weight does more than act at a height.
    #[error(
        "springs that lean, have a length or a preload of their own change their stiffness with the weight: \
         the device has one matrix and one          height of the anchors; use `identify()`"
    )]
    Preload,
    /// There are too many parameters.
    #[error(
        "the model has {0} base parameters, the device has room for {MAX_TREE_PARAMETERS}: weld some of its \
         links"
    )]
    Parameters(usize),
    /// A joint that is not a turning one, or turns about an axis that is none of the link's.
    #[error(
        "link {0}: on the device joints are fixed, spherical, universal, or revolute about x, y or z of \
         their link; `identify()` takes every other kind"
    )]
    Joint(String),
    /// A link that is no body: no attitude can be streamed of it.
    #[error(
        "link {0} is no body but the place where two joints of one body meet: on the device declare three \
         hinges through one point to be one ball (`spherical`); `identify()` takes them as they are"
    )]
    NoBody(String),
}

/// Returns what the device is to be given of a model, and its base parameters in the device's order.
///
/// # Errors
/// [`DeviceTreeError`] says what does not fit.
pub fn device_tree(model: &Model) -> Result<(ModelSettings, Vec<BaseParameter>), DeviceTreeError> {
    let welded = model.welded();
    if welded.links.len() > MAX_LINKS {
        return Err(DeviceTreeError::Links(welded.links.len()));
    }
    if let Some(link) = welded.links.iter().find(|link| !link.is_body()) {
        return Err(DeviceTreeError::NoBody(link.name.clone()));
    }
    let mut links = Vec::new();
    for (i, link) in welded.links.iter().enumerate() {
        let joint = match link.link.joint {
            _ if i == 0 => LinkJoint::Fixed,
            Joint::Fixed => LinkJoint::Fixed,
            Joint::Spherical | Joint::Universal(..) => LinkJoint::Spherical,
            Joint::Revolute(axis) => {
                let along = axis.iamax();
                if (axis[along].abs() - 1.0).abs() > 1e-9 {
                    return Err(DeviceTreeError::Joint(link.name.clone()));
                }
                LinkJoint::Revolute(along as u8)
            }
            Joint::Prismatic(_) | Joint::Free => return Err(DeviceTreeError::Joint(link.name.clone())),
        };
        let position_m = link.link.position.map(|v| v as f32).into();
        links.push(LinkSettings { parent: link.link.parent as u8, joint, position_m });
    }
    let situation = Situation { floating: true, rows: Rows::Base, mimic: false };
    let mut parameters = base_parameters(&welded, &situation)?.parameters;
    if parameters.len() > MAX_TREE_PARAMETERS {
        return Err(DeviceTreeError::Parameters(parameters.len()));
    }
    // Columns of a link are in the order of φ; the first term is the column that represents the parameter.
    parameters.sort_by_key(|p| p.terms.first().map(|(column, _)| *column));
    Ok((ModelSettings::Tree(links.into_iter().collect()), parameters))
}

/// Returns the parameters that a device estimates of a model, in its order: base parameters, then the
/// wrench's offset if that is estimated.
pub fn device_parameters(model: &Model, parameters: &[BaseParameter], offset: bool) -> Vec<Parameter> {
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

/// Returns the device's settings for a tree whose frames come over its sensor bus.
///
/// # Errors
/// [`DeviceTreeError`]: the rig file lacks what it needs, or leaves the offset to be estimated.
pub fn tree_settings(
    rig: &RigFile,
    timing: &DeviceTiming,
    model: ModelSettings,
) -> Result<Settings, DeviceTreeError> {
    // Of the gauges' matrix and other things of the sensors' there is no need.
    let injected = DeviceTiming { source: Source::Injected, ..*timing };
    let one = settings(rig, &injected, None, None)?;
    if one.load_cell.known_offset_n_nm.is_none() {
        return Err(DeviceTreeError::Offset);
    }
    Ok(Settings { model, source: timing.source, ..one })
}

/// Returns a factor of nothing for the given number of parameters.
pub fn empty_factor(parameters: usize) -> Box<TreeFactor<f64>> {
    let mut factor = Box::new(TreeFactor::EMPTY);
    factor.clear(parameters);
    factor
}

/// Takes the device's level, row by row, and merges it. It may go on absorbing meanwhile.
///
/// # Errors
/// The link. What was taken before is merged; if no answer arrived to the last command at all, its row is
/// lost with the link.
pub fn take_level(client: &mut Client, factor: &mut TreeFactor<f64>) -> Result<(), LinkError> {
    const NAME: &str = "take a row of the factor";
    for row in 0..factor.parameters() {
        let asked = u8::try_from(row).map_err(|_| LinkError::Nonsense(NAME))?;
        match client.ask(NAME, &Command::TakeRow { row: asked })? {
            Reply::Row(taken) if !is_finite(&taken) => return Err(LinkError::NotFinite),
            Reply::Row(taken) if taken.row == asked && merge(factor, &taken) => {}
            _ => return Err(LinkError::Nonsense(NAME)),
        }
    }
    Ok(())
}

fn is_finite(taken: &FactorRow) -> bool {
    taken.residual_sum_of_squares.is_finite() && taken.entries.iter().all(|v| v.is_finite())
}

/// Merges a row. Returns false if it is of other parameters.
fn merge(factor: &mut TreeFactor<f64>, taken: &FactorRow) -> bool {
    let row: Vec<f64> = taken.entries.iter().map(|v| f64::from(*v)).collect();
    let first = usize::from(taken.row);
    let residual = f64::from(taken.residual_sum_of_squares);
    let fits =
        usize::from(taken.parameters) == factor.parameters() && first + row.len() == factor.parameters() + 1;
    if fits {
        factor.merge_row(first, &row);
        factor.merge_residual(residual, taken.rows);
    }
    fits
}

/// A level of as many parameters as there may be is taken after about this many frames: often against
/// [`LEVEL_FRAMES`], seldom against the time that its rows need on the link; a smaller one more often, but no
/// more often than
const TAKEN_EVERY: u32 = 1500;
/// this.
const MOST_OFTEN: u32 = 200;

/// The source that streams frames to the device.
pub trait FrameSource {
    /// Lets frames go, or keeps them back.
    fn set_open(&self, open: bool);
    /// Returns whether the device has had the last one.
    fn is_done(&self) -> bool;
}

impl Session {
    /// Starts a device that was set to a tree of the given number of base parameters, lets the frames go,
    /// takes its level now and then, and for the last time at the end; where the device decides when that is,
    /// its level is left alone as long as there is room.
    ///
    /// # Errors
    /// The error that prevents a start. Anything later is stated in [`Take::broken`], with what was taken
    /// before.
    pub fn follow_frames(
        &mut self,
        source: &dyn FrameSource,
        parameters: usize,
        observer: &mut dyn Observer,
    ) -> Result<Take, SessionError> {
        self.start()?;
        let mut taking = Taking { level: Some(empty_factor(parameters)), ..Taking::default() };
        source.set_open(true);
        let outcome = self.frames(source, &mut taking, observer);
        source.set_open(false);
        Ok(self.conclude(taking, outcome, observer))
    }

    fn frames(
        &mut self,
        source: &dyn FrameSource,
        taking: &mut Taking,
        observer: &mut dyn Observer,
    ) -> Result<(), SessionError> {
        const FULL: (StateName, Reason) = (StateName::Holding, Reason::LevelFull);
        let mut taken = 0;
        let share = taking.level.as_ref().map_or(1.0, |l| l.parameters() as f64 / MAX_TREE_PARAMETERS as f64);
        let every = (f64::from(TAKEN_EVERY) * share * share).max(f64::from(MOST_OFTEN)) as u32;
        while !source.is_done() {
            self.listen(taking, observer)?;
            if INTERRUPTED.load(Ordering::Relaxed) {
                taking.interrupted = true;
                break;
            }
            if let Reply::Counters(counters) =
                self.client().ask("read the counters", &Command::ReadCounters)?
            {
                taking.counters = counters;
            }
            if taking.held() {
                break;
            }
            let absorbed = taking.counters.frames.absorbed;
            // A rule of the device's is judged by the level alone.
            let judged =
                self.stops_itself && taking.states.iter().all(|(_, reason)| *reason != Reason::StopRule);
            let full = taking.states.contains(&FULL);
            if let Some(level) = &mut taking.level
                && (full || !judged && absorbed.saturating_sub(taken) >= every)
            {
                take_level(self.client(), level)?;
                (taken, taking.levels) = (absorbed, taking.levels + 1);
                observer.level(level, absorbed);
            }
            if full {
                taking.states.retain(|state| *state != FULL);
                self.client().ask("go on", &Command::Start)?;
            }
        }
        Ok(())
    }
}

/// Returns how many frames had gone by when the device took in its last one.
pub fn frames_taken(take: &Take) -> usize {
    let FrameReport { frames, missing, damaged, .. } = take.counters.frames;
    frames.saturating_add(missing).saturating_add(damaged) as usize
}

/// Returns what is to be said of frames that were not absorbed, each with what to do. `links` are the model's
/// names.
pub fn complaints(report: &FrameReport, links: &[String]) -> Vec<String> {
    let link = links.get(usize::from(report.last_link)).map_or("?", String::as_str);
    let expected = links.len();
    let full = LEVEL_FRAMES;
    [
        (report.missing, "are missing in the series: the source or its link is too slow".to_owned()),
        (report.damaged, "were damaged on the way (their check does not fit): check the cable".to_owned()),
        (
            report.wrong_links,
            format!(
                "are of a tree with another number of links (the last of {}, the model has {expected}): \
                 stream the model's links, in its order",
                report.last_link
            ),
        ),
        (report.not_finite, format!("hold a number that is none (last rejected link: {link})")),
        (
            report.no_attitude,
            format!("hold an attitude that is no unit quaternion (last rejected link: {link})"),
        ),
        (report.saturated, "have a wrench at the range of the sensor".to_owned()),
        (
            report.without_motion,
            "are without motion: it repeats itself to the last bit while the wrench changes; the motion \
             capture has lost the body"
                .to_owned(),
        ),
        (report.full, format!("came after {full} others without the factor being taken, and were left out")),
    ]
    .into_iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, what)| format!("{count} frames {what}"))
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rigident_model::human::Person;

    #[test]
    fn the_humans_fit_or_it_is_said_why_not() {
        let (settings, parameters) = device_tree(&Person::default().human34().unwrap()).unwrap();
        let ModelSettings::Tree(links) = settings else { panic!("a tree") };
        assert_eq!((links.len(), parameters.len()), (15, 128));
        assert_eq!(links.iter().filter(|l| l.joint == LinkJoint::Revolute(1)).count(), 4);
        // The device's order: every link's columns in the order of φ.
        let columns: Vec<usize> = parameters.iter().map(|p| p.terms[0].0).collect();
        assert!(columns.is_sorted() && columns[..10].iter().eq(&(0..10).collect::<Vec<_>>()));
        let error = device_tree(&Person::default().human58().unwrap()).unwrap_err();
        assert!(error.to_string().contains("23 links"), "{error}");
    }

    #[test]
    fn joints_that_share_a_body_must_be_one_on_the_device() {
        let text = "<mujoco model=\"m\"><worldbody><body name=\"b\"><freejoint/><body name=\"t\"><joint \
                    name=\"x\" axis=\"1 0 0\"/><joint name=\"z\" axis=\"0 0 1\"/><joint name=\"y\" axis=\"0 \
                    1 0\"/></body></body></worldbody></mujoco>";
        let mut model = rigident_model::write::parse(text, "m.xml").unwrap().model;
        let error = device_tree(&model).unwrap_err();
        assert!(
            error.to_string().contains("link t#1") && error.to_string().contains("`spherical`"),
            "{error}"
        );
        model.declare_spherical(&["x", "z", "y"].map(str::to_owned)).unwrap();
        assert_eq!(device_tree(&model).unwrap().1.len(), 19);
    }

    #[test]
    fn the_device_keeps_the_columns_that_stand_for_the_host_s_parameters() {
        use rigident_shared::tree::base::{FIRST_LINK, TurningJoint, kept_columns};
        let (settings, parameters) = device_tree(&Person::default().human34().unwrap()).unwrap();
        let ModelSettings::Tree(links) = settings else { panic!("a tree") };
        let kept = links.iter().enumerate().flat_map(|(i, link)| {
            let joint = match link.joint {
                LinkJoint::Revolute(axis) => TurningJoint::Revolute(axis),
                _ => TurningJoint::Spherical,
            };
            let mask = if i == 0 { FIRST_LINK } else { kept_columns(joint).unwrap() };
            (0..10).filter(move |k| mask >> k & 1 == 1).map(move |k| 10 * i + k)
        });
        assert!(kept.eq(parameters.iter().map(|p| p.terms[0].0)));
    }

    #[test]
    fn lost_frames_are_reported_once_for_every_reason() {
        let links: Vec<String> = ["base", "arm", "hand"].map(str::to_owned).into();
        assert!(
            complaints(&FrameReport { frames: 9, absorbed: 9, ..FrameReport::default() }, &links).is_empty()
        );
        let report = FrameReport {
            frames: 20,
            absorbed: 2,
            missing: 3,
            damaged: 4,
            wrong_links: 1,
            not_finite: 2,
            no_attitude: 5,
            saturated: 6,
            without_motion: 7,
            full: 8,
            last_link: 2,
        };
        let said = complaints(&report, &links);
        assert_eq!(said.len(), 8);
        for (line, part) in said.iter().zip([
            "3 frames are missing",
            "4 frames were damaged",
            "the last of 2, the model has 3",
            "link: hand",
            "5 frames hold an attitude",
            "6 frames have a wrench",
            "7 frames are without motion",
            "8 frames came after 100000 others",
        ]) {
            assert!(line.contains(part), "{line}");
        }
    }
}
