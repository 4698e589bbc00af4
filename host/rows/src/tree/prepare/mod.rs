//! From a recording and a model to frames: which columns are there, which are missing, what does not fit.
//!
//! Lives here: the order of these questions, and the frames. Their answers are in `joints`, `rates`,
//! `sensors`, `sources` and `agreement`.

mod agreement;
mod feet;
mod frames;
mod joints;
mod rates;
mod sensors;
mod sources;

use std::collections::BTreeMap;

use nalgebra::{UnitQuaternion, Vector3};

use super::drive::Drive;
use super::errors::errors;
use super::rows::rows_of;
use super::{BaseSensor, Input, TreePrepareError, standstill};
use crate::body::input_checks::check_channels;
use crate::tree::ProblemOptions;
use feet::Feet;
use frames::{Forces, LinkColumns};
use rigident_io::recording::{ImuColumns, Recording};
use rigident_io::rig::{DOWN, OffsetTable, OffsetWord, RecordingTable};
use rigident_model::base::{Rows, Situation};
use rigident_model::{Finding, Model};

/// Ready to be identified.
#[derive(Clone, Debug)]
pub struct PreparedTree {
    /// All of it.
    pub input: Input,
    /// The notes.
    pub notes: Vec<String>,
    /// The warnings.
    pub warnings: Vec<String>,
    /// Joints that never move, a base that never turns.
    pub idle: Vec<Finding>,
}

/// A joint's columns.
struct JointColumns {
    positions: Vec<f64>,
    rates: Option<Vec<f64>>,
    effort: Option<Vec<f64>>,
    position_noise: Option<f64>,
    rate_noise: Option<f64>,
    effort_noise: Option<f64>,
}

struct Preparation<'a> {
    recording: &'a Recording,
    model: &'a Model,
    /// The model with its fixed joints.
    original: &'a Model,
    notes: Vec<String>,
    warnings: Vec<String>,
    cells: BTreeMap<&'a str, &'a [String]>,
}

/// Brings a recording to frames of a model.
///
/// # Errors
/// [`TreePrepareError`] says what is missing or does not fit.
pub fn prepare(
    recording: &Recording,
    model: &Model,
    options: &ProblemOptions,
) -> Result<PreparedTree, TreePrepareError> {
    check_channels(recording)
        .map_err(|error| TreePrepareError::Implausible { name: recording.name.clone(), error })?;
    let original = model;
    let model = upright(original.welded(), recording)?;
    let cells = recording.extra.iter().map(|(name, cells)| (name.as_str(), cells.as_slice())).collect();
    let mut work =
        Preparation { recording, model: &model, original, notes: Vec::new(), warnings: Vec::new(), cells };
    let input = work.input(options)?;
    let frames: Vec<(&[f64], Vector3<f64>)> =
        input.frames.iter().map(|f| (f.positions.as_slice(), f.base.rate)).collect();
    let mut idle = rigident_model::idle::idle(&model, &frames, !input.is_static);
    if !input.situation.floating || input.is_static {
        // Of a base that is held still that is no news; still poses turn nothing by what they are.
        idle.retain(|finding| !finding.text.starts_with("the base never turns"));
    }
    Ok(PreparedTree { input, notes: work.notes, warnings: work.warnings, idle })
}

/// Gravity on a base that is held still.
pub(super) struct Gravity {
    /// The magnitude of gravity, m/s².
    pub(super) mps2: f64,
    /// The direction of its pull, the base's frame, of length one.
    pub(super) direction: [f64; 3],
    /// The origin of the statement, as the end of a sentence; empty for the rig file.
    pub(super) stated: &'static str,
}

impl Gravity {
    /// Returns what the rig file states; where that states nothing, what the model's file does.
    pub(super) fn of(recording: &Recording, model: &Model) -> Self {
        let table = &recording.rig.recording;
        let own = Self { mps2: table.gravity_mps2, direction: table.gravity_direction, stated: "" };
        let default = RecordingTable::default();
        let is_stated = own.mps2 != default.gravity_mps2 || own.direction != default.gravity_direction;
        let Some(stated) = model.gravity_mps2.map(Vector3::from).filter(|_| !is_stated) else { return own };
        let mps2 = stated.norm();
        let direction = if mps2 > 0.0 { (stated / mps2).into() } else { own.direction };
        let stated =
            ", as the model's file states; gravity_mps2 and gravity_direction of the rig file state another";
        Self { mps2, direction, stated }
    }
}

/// Returns the model with its base turned such that gravity is along −z, of a base that is held still.
fn upright(mut model: Model, recording: &Recording) -> Result<Model, TreePrepareError> {
    let has_imu = recording.imus.first().is_some_and(|imu| imu.accel.is_some() || imu.gyro.is_some());
    let own = recording.rig.recording.gravity_direction;
    let measured = has_imu || recording.gravity.is_some() || recording.wrench.is_some();
    let gravity = Gravity::of(recording, &model);
    let down = if measured { own } else { gravity.direction };
    let mps2 = if measured { recording.rig.recording.gravity_mps2 } else { gravity.mps2 };
    model.gravity_mps2 = model.gravity_mps2.map(|_| DOWN.map(|share| share * mps2));
    if down == DOWN {
        return Ok(model);
    }
    let tells = [
        (has_imu, "the base has an IMU"),
        (recording.gravity.is_some(), "there are gravity columns"),
        (recording.wrench.is_some(), "the base's wrench is in axes of its own"),
    ];
    if let Some((_, why)) = tells.iter().find(|(is_there, _)| *is_there) {
        return Err(TreePrepareError::Fit {
            name: recording.name.clone(),
            model: model.name,
            why: format!(
                "gravity_direction of the rig file is for a base that is held still, and {why}: remove the \
                 key"
            ),
        });
    }
    let (from, to) = (Vector3::from(down), Vector3::from(DOWN));
    let upside_down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let turn = UnitQuaternion::rotation_between(&from, &to).unwrap_or(upside_down).to_rotation_matrix();
    for link in model.links.iter_mut().skip(1).filter(|link| link.link.parent == 0) {
        link.link.rotation = turn * link.link.rotation;
        link.link.position = turn * link.link.position;
    }
    Ok(model)
}

impl<'a> Preparation<'a> {
    fn missing(&self, missing: impl Into<String>, advice: impl Into<String>) -> TreePrepareError {
        TreePrepareError::Missing {
            name: self.recording.name.clone(),
            missing: missing.into(),
            advice: advice.into(),
        }
    }

    fn misfit(&self, why: String) -> TreePrepareError {
        TreePrepareError::Fit { name: self.recording.name.clone(), model: self.model.name.clone(), why }
    }

    /// Returns the index in the model of every numbered link; `None` for links that are rigidly one with
    /// another.
    fn numbering(&self) -> Result<Vec<Option<usize>>, TreePrepareError> {
        let tables = &self.recording.rig.link;
        if tables.is_empty() {
            let bodies = self.model.links.iter().enumerate().filter(|(_, link)| link.is_body());
            return Ok(bodies.map(|(i, _)| Some(i)).collect());
        }
        let unknown = |name: &str| {
            let known = |l: &rigident_model::ModelLink| l.name == name || l.welded.iter().any(|w| w == name);
            !self.model.links.iter().any(known)
        };
        if let Some(table) = tables.iter().find(|t| unknown(&t.name)) {
            let names: Vec<&str> = self.model.links.iter().map(|l| l.name.as_str()).collect();
            return Err(self.misfit(format!(
                "the rig file's [[link]] {} is not in it; its links are {}",
                table.name,
                names.join(", ")
            )));
        }
        Ok(tables.iter().map(|t| self.model.link(&t.name)).collect())
    }

    fn input(&mut self, options: &ProblemOptions) -> Result<Input, TreePrepareError> {
        let recording = self.recording;
        let mut columns = LinkColumns { numbering: self.numbering()?, ..LinkColumns::default() };
        self.check_imu_numbers(&columns.numbering)?;
        self.judge_imu_tables(&columns.numbering)?;
        self.note_unused();
        columns.gyros = self.gyros(&columns.numbering)?;
        columns.joints = self.joint_columns()?;
        let feet = self.feet(&columns.joints)?;
        let (forces, rows) = self.forces(&columns, feet.as_ref(), options)?;
        let base = self.base(columns.gyros.get(&0))?;
        let floating = recording.imus.first().is_some_and(|i| i.accel.is_some());
        let rate_hz = recording.rate_hz.unwrap_or(1.0);
        self.judge_gravity(&base, rate_hz)?;
        columns.attitudes = recording
            .attitudes
            .iter()
            .filter_map(|(j, rows)| Some((columns.numbering.get(*j).copied().flatten()?, rows)))
            .collect();
        self.check_sources(&columns)?;
        self.note_unused_attitudes(&columns);
        self.judge_agreement(&columns, rate_hz)?;
        self.leave_filtered_rates(&mut columns.joints, rate_hz);
        let coordinates = self.coordinates(&columns.joints, rate_hz);
        let frames = self.frames(&columns, &coordinates, &base, &forces)?;
        let mut input = Input {
            model: self.model.clone(),
            frames,
            is_static: recording.is_static,
            rate_hz,
            base: BaseSensor::Imu(self.imu(0).map_or([0.0; 3], |imu| imu.position_m)),
            situation: Situation { floating, rows, mimic: false },
            channel_sigma: self.channel_sigma(rows, &columns.joints),
            contact: None,
            known_offset: match recording.rig.load_cell.offset_n_nm {
                OffsetTable::Known(offset) => Some(offset),
                OffsetTable::Word(OffsetWord::Zero) => Some([0.0; 6]),
                OffsetTable::Word(OffsetWord::Estimate) => None,
            },
            nuisances: Vec::new(),
            errors: Vec::new(),
            drives: Vec::new(),
            as_stated: Vec::new(),
            signals: self.signals(&columns),
            rate_sigma: self.rate_sigma(&columns, rate_hz),
        };
        self.add_drives(&mut input, options)?;
        if let Some(feet) = feet {
            self.stand(&mut input, feet)?;
        }
        let table = |i: usize| columns.number(i).and_then(|j| self.imu(j));
        let errors = errors(&input, &recording.rig, &table);
        (input.nuisances, input.errors) = (errors.nuisances, errors.signals);
        Ok(input)
    }

    /// Refuses columns of an IMU on a link that there is not.
    fn check_imu_numbers(&self, numbering: &[Option<usize>]) -> Result<(), TreePrepareError> {
        let has_no_link = |(j, imu): &(usize, &ImuColumns)| {
            (imu.accel.is_some() || imu.gyro.is_some()) && numbering.get(*j).copied().flatten().is_none()
        };
        let Some((j, _)) = self.recording.imus.iter().enumerate().find(has_no_link) else { return Ok(()) };
        let bodies = self.model.links.iter().filter(|link| link.is_body());
        let names: Vec<&str> = bodies.map(|link| link.name.as_str()).collect();
        Err(self.misfit(format!(
            "its columns imu{j}_… are of link {j}, and the model has the movable links 0 to {} ({})",
            names.len() - 1,
            names.join(", ")
        )))
    }

    /// Returns the forces that were measured, and which rows they make.
    fn forces(
        &mut self,
        columns: &LinkColumns<'_>,
        feet: Option<&Feet>,
        options: &ProblemOptions,
    ) -> Result<(Forces, Rows), TreePrepareError> {
        let samples = self.recording.rows();
        let wrench = match feet {
            // Nothing but the ground acts on a robot on its feet.
            Some(_) => Some(vec![[0.0; 6]; samples]),
            None => self.wrench()?,
        };
        let mut efforts = self.efforts(&columns.joints, feet.is_some())?;
        if options.without_efforts && wrench.is_none() && efforts.is_none() {
            efforts = Some(vec![vec![0.0; samples]; self.model.freedoms()]);
        }
        let Some(rows) = rows_of(wrench.is_some(), efforts.is_some()) else {
            return Err(self.missing(
                "the wrench fx_n … mz_nm and the joints' efforts (JOINT_nm) are both",
                format!(
                    "a tree is identified from the wrench on its base link, from joint torques, or from \
                     both{}",
                    self.about_spherical()
                ),
            ));
        };
        let ground = feet.map_or_else(Vec::new, |feet| feet.ground.clone());
        Ok((Forces { wrench, efforts: efforts.unwrap_or_default(), ground }, rows))
    }

    fn note_unused_attitudes(&mut self, columns: &LinkColumns<'_>) {
        let twice = columns.attitudes.keys().filter(|i| columns.joints.contains_key(i));
        let names: Vec<&str> = twice.map(|i| self.model.links[*i].name.as_str()).collect();
        if !names.is_empty() {
            self.notes.push(format!(
                "attitudes of {} were not used: their joints have columns of their own",
                names.join(", ")
            ));
        }
    }

    /// Adds friction and rotors: as asked, or as the model states them.
    fn add_drives(&mut self, input: &mut Input, options: &ProblemOptions) -> Result<(), TreePrepareError> {
        let asked = !options.friction.is_empty() || !options.drives.is_empty();
        let (friction, added) = options.friction.beside(self.model, input.is_static);
        if !asked && (!input.has_efforts() || added.is_empty()) {
            return Ok(());
        }
        if !input.has_efforts() {
            return Err(self.missing(
                "the joints' efforts (JOINT_nm) that friction acts on are",
                "the wrench on the base link does not see friction in the joints; leave `friction` and \
                 `drive` out",
            ));
        }
        let names = input.freedom_names();
        input.drives = Drive::of_joints(&names, &input.model.tree(), &friction);
        for words in &options.drives {
            let drive = Drive::parse(words, &names, &friction);
            input.drives.push(drive.map_err(TreePrepareError::Unsupported)?);
        }
        friction.check(&input.drives).map_err(TreePrepareError::Unsupported)?;
        input.as_stated = added;
        self.notes.extend(standstill::mark(input));
        input.drives.retain(|drive| !drive.terms.is_empty());
        Ok(())
    }
}
