//! Errors of the signals that frames of a tree are made of: what the rig file or a class lets expect of them.
//!
//! IMU and load cell have those of one body ([`crate::body::errors`]), a link's IMU those of them that its
//! attitude and rate have. Joints have zeros, a base that is held still is tilted against gravity, and
//! efforts have scales and offsets.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::tree::Joint;

use super::contact::COMPONENTS;
use super::drive::{FrictionPart, Term};
use super::joints::attitude;
use super::{Input, SignalKind};
use crate::body::errors::{of_cell, of_imu};
use crate::body::sensitivities::ImuError;
use rigident_fit::{Basis, Effect, Nuisance, Scope};
use rigident_io::rig::classes::{LoadCellClass, rectangular};
use rigident_io::rig::{ImuTable, RigFile, TreeClass};

const AXES: [&str; 3] = ["x", "y", "z"];
/// Factor of the second derivative that a low-pass of efforts has, 1 σ, over the square of their delay's:
/// that of a delay of two standard deviations.
const FILTERED: f64 = 4.0;

/// An error of a signal: the truth is what is read, moved as said here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SignalError {
    /// Place of the base's IMU in S, by an axis.
    LeverArm(usize),
    /// Attitude of the base's IMU about an axis e of S: `a ← a + e×a`, and rates and attitudes against S
    /// likewise.
    BaseRotation(usize),
    /// Attitude of a link's IMU about an axis of the link, as [`Self::BaseRotation`] of the base's.
    LinkRotation {
        /// The link.
        link: usize,
        /// The axis.
        axis: usize,
    },
    /// The signals are of an earlier time.
    Skew,
    /// Efforts have gone through a low-pass: beside their delay the second derivative of what acts, by this
    /// factor.
    EffortFilter,
    /// Bias of a gyro.
    GyroBias {
        /// The link.
        link: usize,
        /// The gyro's axis in the axes of the link.
        axis: Vector3<f64>,
    },
    /// Scale of a gyro.
    GyroGain {
        /// The link.
        link: usize,
        /// The gyro's axis in the axes of the link.
        axis: Vector3<f64>,
    },
    /// Attitude of a gyro against its IMU: `ω ← ω + u×ω`.
    GyroRotation {
        /// The link.
        link: usize,
        /// The axis u of the IMU in the axes of the link.
        axis: Vector3<f64>,
    },
    /// Bias of the base's accelerometer along an axis in S.
    AccelBias(Vector3<f64>),
    /// Axis `to` of the base's accelerometer reads a share of what is along `from`, both in S; its scale, if
    /// they are one.
    AccelGain {
        /// The axis that reads.
        to: Vector3<f64>,
        /// The ideal reading.
        from: Vector3<f64>,
    },
    /// Zero of a joint of one freedom: it reads too much.
    JointZero(usize),
    /// Gravity is turned about an axis of the base.
    BaseTilt(usize),
    /// An effort reads too much, by the channel.
    EffortOffset(usize),
    /// An effort reads `1 + g` times its value, by the channel; of a robot with feet, whose rows combine
    /// channels.
    EffortGain(usize),
    /// An effort's offset moves by a Legendre polynomial of the time, as [`Effect::Drift`] has it; of a robot
    /// with feet.
    EffortDrift {
        /// The channel.
        channel: usize,
        /// 1: a line; 2: a curve.
        degree: u8,
    },
    /// Dry friction of a drive, by its number, turns over at a speed that is larger by this share.
    FrictionSpeed(usize),
    /// It turns over more slowly than a hyperbolic tangent does, by this share of the way to an algebraic
    /// law.
    FrictionShape(usize),
    /// A part of a drive's friction moves by a Legendre polynomial of the time, relative, as
    /// [`Effect::Drift`] has it.
    FrictionDrift {
        /// The drive, by its number.
        drive: usize,
        /// The part.
        part: FrictionPart,
        /// 1: a line; 2: a curve.
        degree: u8,
    },
    /// Dry friction of a drive, by its number, grows with what it carries, by this share of it.
    FrictionLoad(usize),
    /// A component of a foot's wrench reads too much.
    FootZero {
        /// The foot.
        foot: usize,
        /// The component, of its sensor.
        component: usize,
    },
    /// A component of a foot's wrench reads `1 + g` times its value.
    FootGain {
        /// The foot.
        foot: usize,
        /// The component, of its sensor.
        component: usize,
    },
}

/// Errors with what is known of them beforehand.
#[derive(Clone, Debug, Default)]
pub(super) struct Errors {
    pub(super) nuisances: Vec<Nuisance>,
    pub(super) signals: Vec<SignalError>,
}

impl Errors {
    fn signal(&mut self, mut nuisance: Nuisance, error: SignalError) {
        if nuisance.sigma.is_finite() && nuisance.sigma > 0.0 {
            nuisance.effect = Effect::Signal(self.signals.len());
            self.nuisances.push(nuisance);
            self.signals.push(error);
        }
    }
}

/// Returns the errors of the frames of an input; `table` finds the IMU on a link.
pub(super) fn errors<'a>(
    input: &Input,
    rig: &RigFile,
    table: &dyn Fn(usize) -> Option<&'a ImuTable>,
) -> Errors {
    let mut all = Errors::default();
    if input.situation.floating {
        of_base_imu(input, table(0), &mut all);
    }
    for signal in input.signals.iter().filter(|signal| signal.kind == SignalKind::Attitude) {
        of_link_imu(input, signal.link, table(signal.link), &mut all);
    }
    of_joints(input, rig, &mut all);
    if input.has_efforts() {
        of_efforts(input, rig, &mut all);
    }
    if input.contact.is_some() {
        of_feet(input, rig, &mut all);
    } else if input.has_wrench() {
        all.nuisances.extend(of_cell(&rig.load_cell, input.frames.iter().map(|frame| frame.wrench)));
    }
    all
}

/// Returns the axes of an IMU in those of its link.
fn axes(table: &ImuTable) -> Matrix3<f64> {
    attitude(&table.rotation_wxyz).unwrap_or_else(Matrix3::identity)
}

fn of_base_imu(input: &Input, table: Option<&ImuTable>, all: &mut Errors) {
    let default = ImuTable::default();
    let table = table.unwrap_or(&default);
    let axes = axes(table);
    let of = |axis: usize| axes.column(axis).into_owned();
    let has_gyro = input.signals.iter().any(|s| s.kind == SignalKind::Gyro && s.link == 0);
    for (error, axis, nuisance) in of_imu(table, input.is_static) {
        let (link, along) = (0, of(axis));
        let error = match error {
            ImuError::LeverArm => SignalError::LeverArm(axis),
            ImuError::Rotation => SignalError::BaseRotation(axis),
            ImuError::Skew => SignalError::Skew,
            ImuError::GyroBias if has_gyro => SignalError::GyroBias { link, axis: along },
            ImuError::GyroGain if has_gyro => SignalError::GyroGain { link, axis: along },
            ImuError::GyroRotation if has_gyro => SignalError::GyroRotation { link, axis: along },
            ImuError::GyroBias | ImuError::GyroGain | ImuError::GyroRotation | ImuError::Gravity => continue,
            ImuError::AccelBias => SignalError::AccelBias(along),
            ImuError::AccelGain => SignalError::AccelGain { to: along, from: along },
            ImuError::AccelMisalignment => {
                let (to, from) = [(1, 0), (2, 0), (2, 1)].get(axis).copied().unwrap_or((1, 0));
                SignalError::AccelGain { to: of(to), from: of(from) }
            }
        };
        all.signal(nuisance, error);
    }
}

/// Adds the errors of a link's IMU: of its attitude and its rate.
fn of_link_imu(input: &Input, link: usize, table: Option<&ImuTable>, all: &mut Errors) {
    let default = ImuTable::default();
    let table = table.unwrap_or(&default);
    let name = input.model.links.get(link).map_or("", |l| l.name.as_str());
    let axes = axes(table);
    for (error, axis, mut nuisance) in of_imu(table, input.is_static) {
        let along = axes.column(axis).into_owned();
        let error = match error {
            ImuError::Rotation => SignalError::LinkRotation { link, axis },
            ImuError::GyroBias => SignalError::GyroBias { link, axis: along },
            ImuError::GyroGain => SignalError::GyroGain { link, axis: along },
            ImuError::GyroRotation => SignalError::GyroRotation { link, axis: along },
            _ => continue,
        };
        let stem = nuisance.name.strip_suffix(&format!("_{}", AXES[axis])).unwrap_or(&nuisance.name);
        nuisance.name = format!("{stem}_{name}_{}", AXES[axis]);
        all.signal(nuisance, error);
    }
}

/// The origin of the standard deviation of an error: stated for the joint, for all, or from the class.
struct Source<'a> {
    rig: &'a RigFile,
    class: TreeClass,
}

impl Source<'_> {
    fn of(&self, own: Option<(f64, &str)>, tree: Option<f64>, key: &str, limit: f64) -> (f64, Basis) {
        match (own, tree) {
            (Some((sigma, key)), _) => (sigma, Basis::Stated(format!("joint.{key}"))),
            (None, Some(sigma)) => (sigma, Basis::Stated(format!("tree.{key}"))),
            (None, None) => (rectangular(limit), Basis::Class(format!("tree {}", self.class.name()))),
        }
    }
}

fn source(rig: &RigFile) -> Source<'_> {
    Source { rig, class: rig.tree.class.unwrap_or(TreeClass::DEFAULT) }
}

fn of_joints(input: &Input, rig: &RigFile, all: &mut Errors) {
    let (source, tree) = (source(rig), &rig.tree);
    let limits = source.class.limits();
    let nuisance = |name: String, group: &str, unit: &str, (sigma, basis): (f64, Basis), scope| Nuisance {
        name,
        group: group.to_owned(),
        unit: unit.to_owned(),
        sigma,
        basis,
        scope,
        effect: Effect::Signal(0),
    };
    let positions = [SignalKind::Position, SignalKind::PositionWithSlope];
    let mut has_positions = false;
    for signal in input.signals.iter().filter(|signal| positions.contains(&signal.kind)) {
        let Some(link) = input.model.links.get(signal.link) else { continue };
        has_positions = true;
        let own = source.rig.joint.iter().find(|table| table.name == link.joint_name);
        let own = own.and_then(|table| table.zero_std).map(|sigma| (sigma, "zero_std"));
        let (unit, known) = match link.link.joint {
            Joint::Prismatic(_) => {
                ("m", source.of(own, tree.joint_zero_std_m, "joint_zero_std_m", limits.joint_zero_m))
            }
            _ => {
                ("rad", source.of(own, tree.joint_zero_std_rad, "joint_zero_std_rad", limits.joint_zero_rad))
            }
        };
        let name = format!("joint_zero_{}", link.joint_name);
        all.signal(
            nuisance(name, "joint zero", unit, known, Scope::Rig),
            SignalError::JointZero(signal.link),
        );
    }
    if input.situation.floating {
        return;
    }
    for (axis, name) in AXES.into_iter().enumerate().take(2) {
        let known = source.of(None, tree.base_tilt_std_rad, "base_tilt_std_rad", limits.base_tilt_rad);
        let name = format!("base_tilt_{name}");
        all.signal(nuisance(name, "base tilt", "rad", known, Scope::Rig), SignalError::BaseTilt(axis));
    }
    if has_positions && !input.is_static {
        let limit = if input.has_efforts() { limits.effort_skew_s } else { limits.skew_s };
        let known = source.of(None, tree.skew_std_s, "skew_std_s", limit);
        if input.has_efforts() {
            // A filter of first order that delays by τ has the factor τ², a delay and one of second order
            // half of that.
            let (sigma, basis) = (FILTERED * known.0.powi(2), known.1.clone());
            let filter =
                nuisance("effort_filter".to_owned(), "effort filter", "s2", (sigma, basis), Scope::Recording);
            all.signal(filter, SignalError::EffortFilter);
        }
        all.signal(
            nuisance("time_skew".to_owned(), "time skew", "s", known, Scope::Recording),
            SignalError::Skew,
        );
    }
}

/// Zeros and scales of what feet measure. Of a class both are those of a load cell, relative to the largest
/// force and moment.
fn of_feet(input: &Input, rig: &RigFile, all: &mut Errors) {
    let Some(contact) = &input.contact else { return };
    let limit = rig.load_cell.class.unwrap_or(LoadCellClass::DEFAULT).limit();
    for (i, foot) in contact.feet.iter().enumerate() {
        let table = rig.foot.iter().find(|table| table.name == foot.name);
        let readings = input.frames.iter().filter_map(|frame| frame.ground.wrenches.get(i));
        let mut largest = [0.0_f64; 2];
        for wrench in readings {
            for (k, value) in wrench.iter().enumerate() {
                largest[k / 3] = largest[k / 3].max(value.abs());
            }
        }
        for (k, name) in COMPONENTS.into_iter().enumerate().filter(|(k, _)| foot.measured[*k]) {
            let class = || {
                Basis::Class(format!(
                    "load cell {}",
                    rig.load_cell.class.unwrap_or(LoadCellClass::DEFAULT).name()
                ))
            };
            let zero = match table.and_then(|table| table.zero_std_n_nm) {
                Some(own) => (own[k / 3], Basis::Stated("foot.zero_std_n_nm".to_owned())),
                None => (rectangular(limit) * largest[k / 3], class()),
            };
            let gain = match table.and_then(|table| table.gain_std) {
                Some(own) => (own, Basis::Stated("foot.gain_std".to_owned())),
                None => (rectangular(limit), class()),
            };
            let unit = if k < 3 { "N" } else { "N m" };
            let nuisance = |word: &str, unit: &str, (sigma, basis), scope| Nuisance {
                name: format!("{word}_{}_{name}", foot.name),
                group: format!("foot {word}"),
                unit: unit.to_owned(),
                sigma,
                basis,
                scope,
                effect: Effect::Signal(0),
            };
            let at = (i, k);
            let (foot, component) = at;
            all.signal(
                nuisance("zero", unit, zero, Scope::Recording),
                SignalError::FootZero { foot, component },
            );
            all.signal(nuisance("gain", "1", gain, Scope::Rig), SignalError::FootGain { foot, component });
        }
    }
}

/// Adds the errors of efforts: scale, offset and drift.
fn of_efforts(input: &Input, rig: &RigFile, all: &mut Errors) {
    let (source, tree) = (source(rig), &rig.tree);
    let limit = source.class.limits().effort;
    // Most arms publish torques of their motors' currents: friction that differs by direction leaves an
    // offset.
    let of_offsets = Source { rig, class: tree.class.unwrap_or(TreeClass::Assembled) };
    let first = input.first_effort();
    let slides = input.model.links.iter().skip(1).map(|link| matches!(link.link.joint, Joint::Prismatic(_)));
    for (k, (name, slides)) in input.freedom_names().into_iter().zip(slides).enumerate() {
        let unit = if slides { "N" } else { "N m" };
        let channel = first + k;
        let own = source.rig.joint.iter().find(|table| table.name == name);
        let own = own.and_then(|table| table.effort_gain_std).map(|sigma| (sigma, "effort_gain_std"));
        let (sigma, basis) = source.of(own, tree.effort_gain_std, "effort_gain_std", limit);
        let has_feet = input.contact.is_some();
        let gain = Nuisance {
            name: format!("gain_{name}"),
            group: "effort gain".to_owned(),
            unit: "1".to_owned(),
            sigma,
            basis,
            scope: Scope::Rig,
            effect: Effect::Gain { channel },
        };
        if has_feet {
            all.signal(gain, SignalError::EffortGain(channel));
        } else {
            all.nuisances.push(gain);
        }
        let efforts = input.frames.iter().filter_map(|frame| frame.efforts.get(k));
        let largest = efforts.fold(0.0_f64, |most, effort| most.max(effort.abs()));
        let nuisance = |source: &Source, name: String, group: &str, effect| {
            let limit = source.class.limits().effort;
            let (share, basis) = source.of(None, tree.effort_drift_std, "effort_drift_std", limit);
            Nuisance {
                name,
                group: group.to_owned(),
                unit: unit.to_owned(),
                sigma: share * largest,
                basis,
                scope: Scope::Recording,
                effect,
            }
        };
        let has_offset = input.drives.iter().any(|drive| {
            drive.terms.contains(&Term::Offset) && drive.rates.iter().any(|(freedom, _)| *freedom == k)
        });
        if !has_offset {
            let name = format!("effort_offset_{name}");
            all.signal(
                nuisance(&of_offsets, name, "effort offset", Effect::Signal(0)),
                SignalError::EffortOffset(channel),
            );
        }
        for (degree, word) in [(1, "line"), (2, "curve")] {
            let name = format!("drift_{word}_{name}");
            let drift = nuisance(&source, name, "effort drift", Effect::Drift { channel, degree });
            if has_feet {
                all.signal(drift, SignalError::EffortDrift { channel, degree });
            } else {
                all.nuisances.push(drift);
            }
        }
    }
    all.nuisances.retain(|k| k.sigma.is_finite() && k.sigma > 0.0);
}
