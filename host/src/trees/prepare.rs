//! From a recording and a model to frames: which columns are there, which are missing, what does not fit.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use rigident_shared::calibration::GaugeCalibration;
use rigident_shared::tree::{BaseMotion, Joint};

use super::drive::{Drive, Term};
use super::joints::{Resolved, Seen, attitude, resolve};
use super::polynomial::Polynomial;
use super::rows::rows_of;
use super::{Frame, Input};
use crate::formats::recording::Recording;
use crate::formats::rig::{Calibrated, ImuTable, OffsetTable, OffsetWord};
use crate::models::base::{Rows, Situation};
use crate::models::{Finding, Model};

/// Attitudes this much off what a joint can do are another joint's, rad: far beyond what IMUs and straps do.
const ANOTHER_JOINT: f64 = 0.15;
/// Worth telling, rad.
const NOTICEABLE: f64 = 0.02;

/// Why a recording cannot be used with a model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TreePrepareError {
    /// Columns, tables or keys are missing.
    #[error("{name}: {missing} missing: {advice}")]
    Missing {
        /// The recording.
        name: String,
        /// What, with its verb.
        missing: String,
        /// What to do.
        advice: String,
    },
    /// A cell cannot be used.
    #[error("{name}: column {column}, row {row}: {reason}")]
    Cell {
        /// The recording.
        name: String,
        /// The column.
        column: String,
        /// The row, from 1.
        row: usize,
        /// Why.
        reason: String,
    },
    /// Recording and model contradict each other.
    #[error("{name} does not fit the model {model}: {why}")]
    Fit {
        /// The recording.
        name: String,
        /// The model.
        model: String,
        /// Why, and what to do.
        why: String,
    },
    /// Something asked for that is not done for trees.
    #[error("{0}")]
    Unsupported(String),
}

/// What to identify beside the links.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Wishes {
    /// Friction columns of every joint.
    pub friction: Vec<Term>,
    /// Drives that turn with several joints: `NAME=J1+J2`.
    pub drives: Vec<String>,
}

/// Ready to be identified.
#[derive(Clone, Debug)]
pub struct PreparedTree {
    /// All of it.
    pub input: Input,
    /// What to know.
    pub notes: Vec<String>,
    /// Joints that never move, a base that never turns.
    pub idle: Vec<Finding>,
}

/// A joint's columns.
struct JointColumns {
    positions: Vec<f64>,
    rates: Option<Vec<f64>>,
    effort: Option<Vec<f64>>,
    effort_noise: Option<f64>,
}

struct Preparation<'a> {
    recording: &'a Recording,
    model: &'a Model,
    notes: Vec<String>,
    cells: BTreeMap<&'a str, &'a [String]>,
}

/// Brings a recording to frames of a model.
///
/// # Errors
/// [`TreePrepareError`] says what is missing or does not fit.
pub fn prepare(
    recording: &Recording,
    model: &Model,
    wishes: &Wishes,
) -> Result<PreparedTree, TreePrepareError> {
    let model = model.welded();
    let cells = recording.extra.iter().map(|(name, cells)| (name.as_str(), cells.as_slice())).collect();
    let mut work = Preparation { recording, model: &model, notes: Vec::new(), cells };
    let input = work.input(wishes)?;
    let frames: Vec<(Vec<f64>, Vector3<f64>)> =
        input.frames.iter().map(|f| (f.positions.clone(), f.base.rate)).collect();
    let mut idle = crate::models::idle::idle(&model, &frames);
    if !input.situation.floating || input.is_static {
        // Of a base that is held still that is no news; still poses turn nothing by what they are.
        idle.retain(|finding| !finding.text.starts_with("the base never turns"));
    }
    Ok(PreparedTree { input, notes: work.notes, idle })
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

    /// Index in the model of every numbered link; `None` for those that are rigidly one with another.
    fn numbering(&self) -> Result<Vec<Option<usize>>, TreePrepareError> {
        let tables = &self.recording.rig.link;
        if tables.is_empty() {
            return Ok((0..self.model.links.len()).map(Some).collect());
        }
        let unknown = |name: &str| {
            let known = |l: &crate::models::ModelLink| l.name == name || l.welded.iter().any(|w| w == name);
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

    fn input(&mut self, wishes: &Wishes) -> Result<Input, TreePrepareError> {
        let recording = self.recording;
        let numbering = self.numbering()?;
        let number_of = |i: usize| numbering.iter().position(|n| *n == Some(i));
        for (j, imu) in recording.imus.iter().enumerate() {
            let there = imu.accel.is_some() || imu.gyro.is_some();
            if there && numbering.get(j).copied().flatten().is_none() {
                return Err(self.misfit(format!(
                    "its columns imu{j}_… are of link {j}, and the model has the movable links 0 to {} ({})",
                    self.model.links.len() - 1,
                    self.model.links.iter().map(|l| l.name.as_str()).collect::<Vec<_>>().join(", ")
                )));
            }
        }
        let gyros = self.gyros(&numbering)?;
        let joints = self.joint_columns()?;
        let wrench = self.wrench()?;
        let efforts = self.efforts(&joints)?;
        let Some(rows) = rows_of(wrench.is_some(), efforts.is_some()) else {
            return Err(self.missing(
                "the wrench fx_n … mz_nm and the joints' efforts (JOINT_nm) are both",
                "a tree is identified from the wrench on its base link, from joint torques, or from both",
            ));
        };
        let base = self.base(gyros.get(&0))?;
        let floating = recording.imus.first().is_some_and(|i| i.accel.is_some());
        let rate_hz = recording.rate_hz.unwrap_or(1.0);
        let (coordinates, valid) = self.coordinates(&joints, rate_hz);
        let mut attitudes = BTreeMap::new();
        for (j, rows) in &recording.attitudes {
            if let Some(i) = numbering.get(*j).copied().flatten() {
                attitudes.insert(i, rows);
            }
        }
        self.check_sources(&joints, &attitudes, &gyros, &number_of)?;
        let mut misfits = vec![0.0_f64; self.model.links.len()];
        let mut frames = Vec::new();
        let mut unusable = 0;
        for row in 0..recording.rows() {
            if !valid.get(row).copied().unwrap_or(true) {
                continue;
            }
            if self.saturated(row) {
                unusable += 1;
                continue;
            }
            let motion = base(row);
            let root = Resolved {
                attitude: Matrix3::identity(),
                rate: motion.rate,
                positions: Vec::new(),
                rates: Vec::new(),
                misfit: 0.0,
            };
            let mut links = vec![root];
            for (i, link) in self.model.links.iter().enumerate().skip(1) {
                let seen = match (coordinates.get(&i), attitudes.get(&i)) {
                    (Some(series), _) => Seen::Coordinate(series[row].0, series[row].1),
                    (None, Some(rows)) => {
                        let j = number_of(i).unwrap_or(i);
                        let attitude = attitude(&rows[row]).ok_or_else(|| TreePrepareError::Cell {
                            name: recording.name.clone(),
                            column: format!("q{j}_w … q{j}_z"),
                            row: row + 1,
                            reason: format!("{:?} is no unit quaternion w, x, y, z", rows[row]),
                        })?;
                        let rate = if recording.is_static {
                            Vector3::zeros()
                        } else {
                            gyros.get(&i).map_or_else(Vector3::zeros, |g| g[row])
                        };
                        Seen::Link { attitude, rate }
                    }
                    (None, None) => continue,
                };
                let parent = &links[link.link.parent];
                let resolved = resolve(&link.link, parent, &seen)
                    .ok_or_else(|| self.missing(self.what_of(i).0, self.what_of(i).1))?;
                misfits[i] += resolved.misfit * resolved.misfit;
                links.push(resolved);
            }
            frames.push(Frame {
                time_ns: recording.time_ns.get(row).copied().unwrap_or(row as u64 * 1_000_000_000),
                positions: links.iter().flat_map(|l| l.positions.iter().copied()).collect(),
                rates: links.iter().flat_map(|l| l.rates.iter().copied()).collect(),
                base: motion,
                wrench: wrench.as_ref().map_or([0.0; 6], |w| w[row]),
                efforts: efforts.as_ref().map_or_else(Vec::new, |e| e.iter().map(|c| c[row]).collect()),
            });
        }
        if frames.is_empty() {
            return Err(self
                .missing("frames of motion are", "the recording is shorter than what rates are taken from"));
        }
        if unusable > 0 {
            self.notes.push(format!("{unusable} readings at the limit of a sensor's range were not used"));
        }
        self.judge_misfits(&misfits, frames.len(), &number_of)?;
        let situation = Situation { floating, rows, mimic: false };
        let rate_sigma = self.rate_sigma(&joints, &gyros, rate_hz);
        let mut input = Input {
            model: self.model.clone(),
            frames,
            is_static: recording.is_static,
            rate_hz,
            imu_position: self.imu(0).map_or([0.0; 3], |imu| imu.position_m),
            situation,
            channel_sigma: self.channel_sigma(rows, &joints),
            known_offset: match recording.rig.load_cell.offset_n_nm {
                OffsetTable::Known(offset) => Some(offset),
                OffsetTable::Word(OffsetWord::Zero) => Some([0.0; 6]),
                OffsetTable::Word(OffsetWord::Estimate) => None,
            },
            drives: Vec::new(),
            rate_sigma,
        };
        if !wishes.friction.is_empty() || !wishes.drives.is_empty() {
            if !input.has_efforts() {
                return Err(self.missing(
                    "the joints' efforts (JOINT_nm) that friction acts on are",
                    "the wrench on the base link does not see friction in the joints; leave --friction and --drive out",
                ));
            }
            let names = input.freedom_names();
            input.drives = Drive::of_joints(&names, &input.model.tree(), &wishes.friction);
            for words in &wishes.drives {
                let drive =
                    Drive::parse(words, &names, &wishes.friction).map_err(TreePrepareError::Unsupported)?;
                input.drives.push(drive);
            }
            input.drives.retain(|drive| !drive.terms.is_empty());
        }
        Ok(input)
    }

    /// The table of the IMU on a link, by the link's number.
    fn imu(&self, number: usize) -> Option<&'a ImuTable> {
        self.recording.rig.imu_on(number)
    }

    /// Rates of links by index, link axes.
    fn gyros(
        &self,
        numbering: &[Option<usize>],
    ) -> Result<BTreeMap<usize, Vec<Vector3<f64>>>, TreePrepareError> {
        let mut gyros = BTreeMap::new();
        for (j, imu) in self.recording.imus.iter().enumerate() {
            let (Some(gyro), Some(Some(i))) = (&imu.gyro, numbering.get(j)) else { continue };
            let default = ImuTable { link: j, ..ImuTable::default() };
            let table = self.imu(j).unwrap_or(&default);
            let Calibrated::Numbers(bias) = table.gyro_bias_radps else { return Err(self.uncalibrated(j)) };
            let rotation = attitude(&table.rotation_wxyz).unwrap_or_else(Matrix3::identity);
            let rates = gyro.iter().map(|g| rotation * (Vector3::from(*g) - Vector3::from(bias)));
            gyros.insert(*i, rates.collect());
        }
        Ok(gyros)
    }

    fn uncalibrated(&self, j: usize) -> TreePrepareError {
        TreePrepareError::Unsupported(format!(
            "{}: [[imu]] of link {j} is to be calibrated \"from_poses\", which is done for a single body only: identify the \
             base link alone on still poses first and put the numbers into the rig file",
            self.recording.name
        ))
    }

    fn wrench(&self) -> Result<Option<Vec<[f64; 6]>>, TreePrepareError> {
        match (&self.recording.wrench, &self.recording.gauges, self.recording.rig.load_cell.calibration) {
            (Some(wrench), _, _) => Ok(Some(wrench.clone())),
            (None, Some(gauges), Some(matrix)) => {
                let calibration = GaugeCalibration { matrix };
                Ok(Some(gauges.iter().map(|g| calibration.wrench(g).array()).collect()))
            }
            (None, Some(_), None) => Err(self.missing(
                "[load_cell] calibration is",
                "raw gauges need the 6x6 matrix to N and N m in the rig file",
            )),
            (None, None, _) => Ok(None),
        }
    }

    /// Numbers of a column that is not of the notation's.
    fn numbers(&self, column: &str, scale: f64) -> Result<Option<Vec<f64>>, TreePrepareError> {
        let Some(cells) = self.cells.get(column) else { return Ok(None) };
        let values = cells.iter().enumerate().map(|(row, cell)| {
            let value = cell.trim().parse::<f64>().ok().map(|v| v * scale).filter(|v| v.is_finite());
            value.ok_or_else(|| TreePrepareError::Cell {
                name: self.recording.name.clone(),
                column: column.to_owned(),
                row: row + 1,
                reason: format!("{cell:?} is not a finite number: mend it, or remove the row"),
            })
        });
        values.collect::<Result<Vec<f64>, _>>().map(Some)
    }

    /// Columns of the joints of one freedom, by link.
    fn joint_columns(&self) -> Result<BTreeMap<usize, JointColumns>, TreePrepareError> {
        let mut found = BTreeMap::new();
        let tables = &self.recording.rig.joint;
        if let Some(table) = tables.iter().find(|t| self.model.joint(&t.name).is_none()) {
            let names: Vec<&str> = self.model.links.iter().skip(1).map(|l| l.joint_name.as_str()).collect();
            return Err(self.misfit(format!(
                "the rig file's [[joint]] {} is not in it; its movable joints are {}",
                table.name,
                names.join(", ")
            )));
        }
        for (i, link) in self.model.links.iter().enumerate().skip(1) {
            let units = match link.link.joint {
                Joint::Revolute(_) => ["rad", "radps", "nm"],
                Joint::Prismatic(_) => ["m", "mps", "n"],
                _ => continue,
            };
            let name = &link.joint_name;
            let table = tables.iter().find(|t| t.name == *name);
            let column = |source: Option<&crate::formats::rig::ColumnSource>, unit: &str| {
                let given = source.map(|s| (s.parts().0.to_owned(), s.parts().1));
                let (column, scale) = given.clone().unwrap_or_else(|| (format!("{name}_{unit}"), 1.0));
                let values = self.numbers(&column, scale)?;
                if values.is_none() && given.is_some() {
                    return Err(self.missing(
                        format!("column {column:?}, which the rig file names for joint {name}, is"),
                        "correct the name in [[joint]]",
                    ));
                }
                Ok(values)
            };
            let positions = column(table.and_then(|t| t.position.as_ref()), units[0])?;
            let rates = column(table.and_then(|t| t.rate.as_ref()), units[1])?;
            let effort = column(table.and_then(|t| t.effort.as_ref()), units[2])?;
            if positions.is_none() && rates.is_none() && effort.is_none() {
                self.other_unit(name, &units)?;
                continue;
            }
            let Some(positions) = positions else {
                return Err(self.missing(
                    format!("the position of joint {name} ({name}_{}) is", units[0]),
                    "rates and efforts alone do not say where it stands",
                ));
            };
            found.insert(
                i,
                JointColumns { positions, rates, effort, effort_noise: table.and_then(|t| t.effort_noise) },
            );
        }
        Ok(found)
    }

    /// Complains of a joint's column in a unit that is not its own.
    fn other_unit(&self, joint: &str, units: &[&str; 3]) -> Result<(), TreePrepareError> {
        let strange = self.cells.keys().find(|column| {
            column.strip_prefix(joint).and_then(|rest| rest.strip_prefix('_')).is_some_and(|unit| {
                [
                    "deg", "degps", "mm", "mmps", "rpm", "nmm", "knm", "kn", "rad", "radps", "nm", "m",
                    "mps", "n",
                ]
                .contains(&unit)
                    && !units.contains(&unit)
            })
        });
        let Some(column) = strange else { return Ok(()) };
        Err(self.misfit(format!(
            "column {column} of joint {joint} is in another unit than {joint}_{}, {joint}_{}, {joint}_{}; name it with its scale \
             in the rig file, [[joint]] name = \"{joint}\", position = {{ name = \"{column}\", scale = … }}",
            units[0], units[1], units[2]
        )))
    }

    fn efforts(
        &mut self,
        joints: &BTreeMap<usize, JointColumns>,
    ) -> Result<Option<Vec<Vec<f64>>>, TreePrepareError> {
        let mut efforts = Vec::new();
        let mut without = Vec::new();
        for (i, link) in self.model.links.iter().enumerate().skip(1) {
            match joints.get(&i).and_then(|j| j.effort.clone()) {
                Some(values) => efforts.push(values),
                None => without.push(link.joint_name.as_str()),
            }
        }
        if efforts.is_empty() {
            return Ok(None);
        }
        if !without.is_empty() {
            return Err(self.missing(
                format!("the efforts (JOINT_nm, or JOINT_n of what slides) of {} are", without.join(", ")),
                "joint rows need all of them; --lock joints that were held, or remove the others' columns",
            ));
        }
        Ok(Some(efforts))
    }

    /// The base's motion by row.
    fn base(
        &mut self,
        gyro: Option<&Vec<Vector3<f64>>>,
    ) -> Result<impl Fn(usize) -> BaseMotion<f64> + 'static, TreePrepareError> {
        let recording = self.recording;
        let accel = recording.imus.first().and_then(|i| i.accel.as_ref());
        let gravity = recording.gravity.as_ref();
        let motions: Vec<BaseMotion<f64>> = match (accel, gyro, gravity) {
            (Some(accel), gyro, _) => {
                if gyro.is_none() && !recording.is_static {
                    return Err(self.missing(
                        "the angular rate imu_gx_radps … of the base link is",
                        "a moving base needs a gyro beside its accelerometer; of a base held still leave both out",
                    ));
                }
                let default = ImuTable::default();
                let table = self.imu(0).unwrap_or(&default);
                let (Calibrated::Numbers(scale), Calibrated::Numbers(bias)) =
                    (table.accel_scale, table.accel_bias_mps2)
                else {
                    return Err(self.uncalibrated(0));
                };
                let rotation = attitude(&table.rotation_wxyz).unwrap_or_else(Matrix3::identity);
                let rate = |row: usize| match gyro {
                    Some(gyro) if !recording.is_static => gyro[row],
                    _ => Vector3::zeros(),
                };
                let force = accel.iter().map(|a| {
                    rotation * (Vector3::from(*a).component_mul(&Vector3::from(scale)) - Vector3::from(bias))
                });
                force
                    .enumerate()
                    .map(|(row, specific_force)| BaseMotion {
                        specific_force,
                        rate: rate(row),
                        angular_acceleration: Vector3::zeros(),
                    })
                    .collect()
            }
            (None, Some(_), _) => {
                return Err(self.missing(
                    "the specific force imu_ax_mps2 … of the base link is",
                    "a moving base needs an accelerometer beside its gyro; of a base held still leave both out",
                ));
            }
            (None, None, Some(gravity)) => gravity.iter().map(|g| BaseMotion::still(*g)).collect(),
            (None, None, None) => {
                let g = recording.rig.recording.gravity_mps2;
                self.notes.push(format!(
                    "there is no IMU on the base link: it is taken to be held still, gravity {g} m/s² along −z of its frame"
                ));
                vec![BaseMotion::still([0.0, 0.0, -g])]
            }
        };
        if accel.is_none() && gravity.is_some() {
            let down = |m: &BaseMotion<f64>| {
                let a = m.specific_force;
                a.x.hypot(a.y) > 1e-3 * a.norm()
            };
            if motions.iter().any(down) {
                return Err(self.misfit(
                    "its gravity columns are not along −z of the base's frame, where a base held still has gravity: turn the \
                     model's base, or give the base an IMU"
                        .to_owned(),
                ));
            }
        }
        Ok(move |row: usize| {
            motions.get(row).or(motions.last()).copied().unwrap_or(BaseMotion::still([0.0; 3]))
        })
    }

    /// Positions and rates of joints with columns, and which rows have them.
    #[allow(clippy::type_complexity)]
    fn coordinates(
        &mut self,
        joints: &BTreeMap<usize, JointColumns>,
        rate_hz: f64,
    ) -> (BTreeMap<usize, Vec<(f64, f64)>>, Vec<bool>) {
        let rows = self.recording.rows();
        let mut valid = vec![true; rows];
        let mut all = BTreeMap::new();
        let without = joints.values().filter(|j| j.rates.is_none()).count();
        let fit = (without > 0 && !self.recording.is_static).then(|| Polynomial::new(rate_hz));
        if let Some(fit) = &fit {
            self.notes.push(format!(
                "rates of {without} joints are the slopes of polynomials fitted to {} positions each",
                2 * fit.half() + 1
            ));
            // Stretches without gaps, less their ends.
            let period = 1e9 / rate_hz;
            let times = &self.recording.time_ns;
            let mut start = 0;
            for row in 1..=rows {
                let gap = row == rows
                    || matches!((times.get(row - 1), times.get(row)), (Some(a), Some(b)) if (b - a) as f64 > 1.5 * period);
                if gap {
                    for (k, v) in valid.iter_mut().enumerate().take(row).skip(start) {
                        *v = k >= start + fit.half() && k + fit.half() < row;
                    }
                    start = row;
                }
            }
        }
        for (i, joint) in joints {
            let series = (0..rows).map(|row| {
                let q = joint.positions.get(row).copied().unwrap_or(0.0);
                match (&joint.rates, &fit) {
                    (Some(rates), _) => (q, rates.get(row).copied().unwrap_or(0.0)),
                    (None, Some(fit)) if valid[row] => {
                        fit.at(&joint.positions[row - fit.half()..=row + fit.half()])
                    }
                    _ => (q, 0.0),
                }
            });
            all.insert(*i, series.collect());
        }
        (all, valid)
    }

    /// What of joint `i` is missing, and what to do.
    fn what_of(&self, i: usize) -> (String, String) {
        let link = &self.model.links[i];
        let name = &link.joint_name;
        let number = self.numbering().ok().and_then(|n| n.iter().position(|k| *k == Some(i))).unwrap_or(i);
        let columns = match link.link.joint {
            Joint::Revolute(_) => {
                format!("q{number}_w … q{number}_z with imu{number}_gx_radps …, or {name}_rad")
            }
            Joint::Prismatic(_) => format!("{name}_m"),
            Joint::Free => {
                return (
                    format!("the place of link {}, which moves freely against its parent, is", link.name),
                    "a recording has no columns for it: identify it as a body of its own".to_owned(),
                );
            }
            _ => format!("q{number}_w … q{number}_z with imu{number}_gx_radps …"),
        };
        (
            format!("the motion of joint {name} (link {}) is", link.name),
            format!("add {columns}, or say --lock {name} if it did not move and stood at zero"),
        )
    }

    fn check_sources(
        &self,
        joints: &BTreeMap<usize, JointColumns>,
        attitudes: &BTreeMap<usize, &Vec<[f64; 4]>>,
        gyros: &BTreeMap<usize, Vec<Vector3<f64>>>,
        number_of: &dyn Fn(usize) -> Option<usize>,
    ) -> Result<(), TreePrepareError> {
        for i in 1..self.model.links.len() {
            let slides = matches!(self.model.links[i].link.joint, Joint::Prismatic(_) | Joint::Free);
            if joints.contains_key(&i) {
                continue;
            }
            if slides || !attitudes.contains_key(&i) {
                let (missing, advice) = self.what_of(i);
                return Err(self.missing(missing, advice));
            }
            if !gyros.contains_key(&i) && !self.recording.is_static {
                let j = number_of(i).unwrap_or(i);
                return Err(self.missing(
                    format!("the angular rate imu{j}_gx_radps … of link {} is", self.model.links[i].name),
                    "rates are not differentiated from attitudes: give the link a gyro, or static = true for still poses",
                ));
            }
        }
        Ok(())
    }

    fn judge_misfits(
        &mut self,
        squares: &[f64],
        frames: usize,
        number_of: &dyn Fn(usize) -> Option<usize>,
    ) -> Result<(), TreePrepareError> {
        for (i, sum) in squares.iter().enumerate() {
            let rms = (sum / frames as f64).sqrt();
            let link = &self.model.links[i];
            let said = format!(
                "the attitude q{}_… of link {} is turned by {:.2}° (rms) against what its joint {} can do",
                number_of(i).unwrap_or(i),
                link.name,
                rms.to_degrees(),
                link.joint_name
            );
            if rms > ANOTHER_JOINT {
                return Err(self.misfit(format!(
                    "{said}: is it the attitude relative to S, w first, and are joint kind, axis and rotation those of the \
                     model?"
                )));
            }
            if rms > NOTICEABLE {
                self.notes.push(format!("{said}; the rest is left out"));
            }
        }
        Ok(())
    }

    fn saturated(&self, row: usize) -> bool {
        let rig = &self.recording.rig;
        let beyond = |value: f64, range: f64| value.abs() >= range;
        let wrench =
            self.recording.wrench.as_ref().zip(rig.load_cell.range_n_nm).is_some_and(|(w, range)| {
                w.get(row).is_some_and(|w| w.iter().zip(range).any(|(v, r)| beyond(*v, r)))
            });
        let imus = self.recording.imus.iter().enumerate().any(|(j, imu)| {
            let Some(table) = rig.imu_on(j) else { return false };
            let over = |rows: &Option<Vec<[f64; 3]>>, range: Option<f64>| {
                rows.as_ref().zip(range).is_some_and(|(rows, range)| {
                    rows.get(row).is_some_and(|v| v.iter().any(|v| beyond(*v, range)))
                })
            };
            over(&imu.accel, table.range_mps2) || over(&imu.gyro, table.range_radps)
        });
        wrench || imus
    }

    fn channel_sigma(&self, rows: Rows, joints: &BTreeMap<usize, JointColumns>) -> Option<Vec<f64>> {
        let mut sigma = Vec::new();
        if rows != Rows::Joint {
            sigma.extend(self.recording.rig.load_cell.noise_n_nm?);
        }
        if rows != Rows::Base {
            for joint in joints.values() {
                sigma.push(joint.effort_noise?);
            }
        }
        Some(sigma)
    }

    /// The largest noise of a rate, rad/s or m/s: given, or from differences, which motion hardly enters.
    fn rate_sigma(
        &self,
        joints: &BTreeMap<usize, JointColumns>,
        gyros: &BTreeMap<usize, Vec<Vector3<f64>>>,
        rate_hz: f64,
    ) -> f64 {
        if self.recording.is_static {
            return 0.0;
        }
        let slope = Polynomial::new(rate_hz).slope_noise();
        let of_joints = joints.values().map(|j| match &j.rates {
            Some(rates) => fourth_difference(rates),
            None => slope * fourth_difference(&j.positions),
        });
        let of_links = gyros.values().map(|rates| {
            let axis = |k: usize| fourth_difference(&rates.iter().map(|r| r[k]).collect::<Vec<f64>>());
            axis(0).max(axis(1)).max(axis(2))
        });
        let given = self.recording.rig.imu.iter().filter_map(|imu| imu.gyro_noise_radps).fold(0.0, f64::max);
        let links = if given > 0.0 { given } else { of_links.fold(0.0, f64::max) };
        of_joints.fold(links, f64::max)
    }
}

/// σ of white noise on something smooth, from fourth differences, which motion hardly enters.
fn fourth_difference(values: &[f64]) -> f64 {
    let squares = values.windows(5).filter_map(|w| match w {
        [a, b, c, d, e] => Some((a - 4.0 * b + 6.0 * c - 4.0 * d + e).powi(2)),
        _ => None,
    });
    let (sum, count) = squares.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    // 1 + 16 + 36 + 16 + 1
    if count > 0.0 { (sum / (70.0 * count)).sqrt() } else { 0.0 }
}
