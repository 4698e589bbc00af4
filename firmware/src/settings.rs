//! The estimator's configuration from the host's settings, every field checked.

use heapless::Vec;
use rigident_shared::alignment::AlignerConfig;
use rigident_shared::calibration::{GaugeCalibration, ImuMounting};
use rigident_shared::estimator::frames::{
    FrameFilter, FrameLink, FrameStop, FramesConfig, FramesError, Suspension,
};
use rigident_shared::estimator::watch::{WatchConfig, WatchError, WatchFoot, WatchLink, turned};
use rigident_shared::estimator::{ConfigError, EstimatorConfig, JointAttitude, TwoLinks};
use rigident_shared::forgetting::{ImuNoise, MemoryConfig, Span};
use rigident_shared::screening::Limits;
use rigident_shared::spatial::{AngularRate, Position, Rotation, SpecificForce};
use rigident_shared::tree::base::TurningJoint;
use rigident_shared::tree::{Joint, Link};
use rigident_shared::wire::{
    AttitudeSource, ImuSettings, LinkJoint, LinkSettings, MAX_LINKS, MAX_WATCH_FEET, MemorySettings,
    ModelSettings, SettingName, Settings, Source, StopRule, SuspensionSettings, TwoLinkSettings, WatchJoint,
    WatchLinkSettings, WatchSettings,
};

use crate::sample_path::{StopLimits, second_aligner};

/// Highest rate, 1/s.
const MAX_RATE_HZ: f32 = 4000.0;

/// Coverage factor of a 95 % uncertainty.
const COVERAGE: f32 = 1.96;

/// Tells what the settings amount to.
#[allow(clippy::large_enum_variant, reason = "no heap")]
pub(crate) enum Configuration {
    /// The configuration for sensors or a recording.
    Samples(SampleConfiguration),
    /// The configuration for frames.
    Tree(Vec<FrameLink<f32>, MAX_LINKS>, FramesConfig<f32>, Option<FrameStop<f32>>),
    /// The configuration for a robot that is watched.
    Watch(WatchConfig<f32>, Vec<WatchFoot<f32>, MAX_WATCH_FEET>),
}

/// Holds what the settings of one body or of two links amount to.
pub(crate) struct SampleConfiguration {
    pub(crate) estimator: EstimatorConfig<f32>,
    pub(crate) aligner: AlignerConfig,
    pub(crate) gauges: GaugeCalibration<f32>,
    /// The second link and the aligner of its IMU.
    pub(crate) second: Option<(TwoLinks<f32>, AlignerConfig)>,
    pub(crate) estimates_offset: bool,
    pub(crate) stop: Option<StopLimits>,
    pub(crate) knock_limit: f32,
    /// Noise of the first IMU.
    pub(crate) imu_noise: ImuNoise<f32>,
    /// `None`: everything is retained.
    pub(crate) memory: Option<MemoryConfig<f32>>,
}

// One piece of code for all of these, which are not in a hurry.
#[inline(never)]
fn all_finite(values: &[f32]) -> bool {
    values.iter().all(|v| v.is_finite())
}

#[inline(never)]
fn positive(values: &[f32]) -> bool {
    values.iter().all(|v| v.is_finite() && *v > 0.0)
}

fn ensure(ok: bool, name: SettingName) -> Result<(), SettingName> {
    if ok { Ok(()) } else { Err(name) }
}

impl Configuration {
    /// Checks every field; the first that is impossible is named.
    pub(crate) fn new(settings: &Settings) -> Result<Self, SettingName> {
        match &settings.model {
            ModelSettings::Body => SampleConfiguration::new(settings, None).map(Self::Samples),
            ModelSettings::TwoLinks(links) if cfg!(feature = "links") => {
                SampleConfiguration::new(settings, Some(links)).map(Self::Samples)
            }
            ModelSettings::Tree(links) if cfg!(feature = "frames") => tree(settings, links, None),
            ModelSettings::Suspended(links, springs) if cfg!(feature = "frames") => {
                tree(settings, links, Some(springs))
            }
            ModelSettings::Watch(robot) if cfg!(feature = "watch") => watch(settings, robot),
            // Left out of this image.
            ModelSettings::TwoLinks(_)
            | ModelSettings::Tree(_)
            | ModelSettings::Suspended(..)
            | ModelSettings::Watch(_) => Err(SettingName::Model),
        }
    }
}

/// Returns the largest standard deviation of every parameter that the rule allows: infinite for those not
/// asked for.
fn deviations<const N: usize>(stop: &StopRule) -> [f32; N] {
    let mut limits = [f32::INFINITY; N];
    for (j, limit) in limits.iter_mut().enumerate() {
        if let Some(u95) = stop.u95(j) {
            *limit = u95 / COVERAGE;
        }
    }
    limits
}

fn is_possible(stop: Option<&StopRule>) -> bool {
    stop.is_none_or(|stop| stop.limits.iter().all(|limit| limit.u95.is_finite()))
}

/// Returns the configuration of a tree, which absorbs frames as they come, filtered if its base is tracked:
/// nothing forgotten, the offset known.
fn tree(
    settings: &Settings,
    links: &[LinkSettings],
    springs: Option<&SuspensionSettings>,
) -> Result<Configuration, SettingName> {
    let cell = &settings.load_cell;
    ensure(settings.source == Source::Sensors, SettingName::Model)?;
    ensure(is_possible(settings.stop.as_ref()), SettingName::StopRule)?;
    ensure(settings.memory == MemorySettings::Forever, SettingName::Memory)?;
    let known_offset = cell.known_offset_n_nm.filter(|o| all_finite(o)).ok_or(SettingName::KnownOffset)?;
    ensure(positive(&cell.range_n_nm), SettingName::LoadCellRange)?;
    let suspension = springs.map(suspension);
    let is_tracked = suspension.is_some() || links.first().is_some_and(|base| base.joint == LinkJoint::Free);
    if let Some(free) = links.iter().skip(1).position(|link| link.joint == LinkJoint::Free) {
        return Err(SettingName::Link(1 + free as u8));
    }
    let links = links
        .iter()
        .map(|link| FrameLink {
            parent: link.parent,
            joint: match link.joint {
                LinkJoint::Fixed => TurningJoint::Fixed,
                LinkJoint::Revolute(axis) => TurningJoint::Revolute(axis),
                // Only the first one's, which is not examined.
                LinkJoint::Spherical | LinkJoint::Free => TurningJoint::Spherical,
            },
            position: link.position_m,
        })
        .collect();
    let filter = is_tracked.then_some(FrameFilter {
        rate_hz: settings.rate_hz,
        width_s: settings.filter_width_s,
        row_every: settings.row_every,
    });
    let config = FramesConfig {
        channel_sigma: cell.noise_n_nm,
        known_offset,
        range: cell.range_n_nm,
        still_after: settings.frozen_after,
        filter,
        suspension,
    };
    let stop = settings
        .stop
        .as_ref()
        .map(|stop| FrameStop { standard_deviation: deviations(stop), minimum_frames: stop.minimum_blocks });
    Ok(Configuration::Tree(links, config, stop))
}

/// Returns the configuration of a robot that is watched, without its links.
#[cold]
#[inline(never)]
fn watch(settings: &Settings, robot: &WatchSettings) -> Result<Configuration, SettingName> {
    ensure(settings.source == Source::Sensors && settings.stop.is_none(), SettingName::Model)?;
    ensure(positive(&[settings.rate_hz]) && settings.rate_hz <= MAX_RATE_HZ, SettingName::Rate)?;
    let mut feet = Vec::new();
    for foot in robot.feet.get(..usize::from(robot.foot_count)).ok_or(SettingName::Watch)? {
        let rotation = turned(foot.rotation_wxyz).ok_or(SettingName::Watch)?;
        // There is room for as many as there can be.
        let _ = feet.push(WatchFoot { link: foot.link, rotation, position: foot.position_m.into() });
    }
    let config = WatchConfig {
        links: robot.links,
        watched: robot.watched,
        rate_hz: settings.rate_hz,
        width_s: settings.filter_width_s,
        row_every: settings.row_every,
        channel_sigma: settings.load_cell.noise_n_nm,
        range: settings.load_cell.range_n_nm,
        limit: robot.limit,
        settle: robot.settle_bins,
        forget_s: robot.forget_s,
    };
    Ok(Configuration::Watch(config, feet))
}

/// Returns a link of a robot that is watched.
#[cold]
#[inline(never)]
pub(crate) fn watch_link(given: &WatchLinkSettings, i: u8) -> Result<WatchLink<f32>, SettingName> {
    let axis = given.axis.into();
    let joint = match given.joint {
        WatchJoint::Fixed => Joint::Fixed,
        WatchJoint::Revolute => Joint::Revolute(axis),
        WatchJoint::Prismatic => Joint::Prismatic(axis),
    };
    let length: f32 = given.axis.iter().map(|v| v * v).sum();
    ensure(given.joint == WatchJoint::Fixed || (length - 1.0).abs() < 1e-3, SettingName::Link(i))?;
    let rotation = turned(given.rotation_wxyz).ok_or(SettingName::Link(i))?;
    let link = Link { parent: usize::from(given.parent), joint, rotation, position: given.position_m.into() };
    Ok(WatchLink { link, parameters: given.parameters })
}

/// Returns the setting that a watch's refusal is about.
pub(crate) fn setting_of_watch(error: WatchError) -> SettingName {
    match error {
        WatchError::Links => SettingName::Links,
        WatchError::Link(link) => SettingName::Link(link),
        WatchError::Feet | WatchError::Limit => SettingName::Watch,
        WatchError::Sigma(channel) => SettingName::Noise(channel),
        WatchError::Range => SettingName::LoadCellRange,
        WatchError::Filter(_) => SettingName::Filter,
    }
}

/// Returns the springs, whose stiffness is given by half of the matrix.
fn suspension(springs: &SuspensionSettings) -> Suspension<f32> {
    let mut stiffness = [[0.0; 6]; 6];
    for ((i, j), value) in SuspensionSettings::places().zip(springs.stiffness) {
        for (i, j) in [(i, j), (j, i)] {
            if let Some(slot) = stiffness.get_mut(i).and_then(|row: &mut [f32; 6]| row.get_mut(j)) {
                *slot = value;
            }
        }
    }
    Suspension {
        stiffness,
        base_position: springs.base_position_m,
        base_attitude: springs.base_rotation_wxyz,
        anchor_height: springs.anchor_height_m,
        locked: springs.locked,
    }
}

/// Returns the second link and its IMU.
fn second_link(
    links: &TwoLinkSettings,
    first: &AlignerConfig,
    source: Source,
) -> Result<(TwoLinks<f32>, AlignerConfig), SettingName> {
    let imu = &links.imu;
    let from_sensors = source == Source::Sensors;
    let rate = !from_sensors || (positive(&[imu.rate_hz]) && imu.rate_hz <= MAX_RATE_HZ);
    let ranges = [imu.range_mps2, imu.range_radps];
    ensure(rate && positive(&ranges), SettingName::SecondImu)?;
    let mounting = mounting(imu).map_err(|_| SettingName::SecondImu)?;
    let attitude = match links.attitude {
        // Only with readings that bring it.
        AttitudeSource::Streamed if !from_sensors => JointAttitude::Streamed,
        AttitudeSource::Streamed => return Err(SettingName::Joint),
        AttitudeSource::FromImus { initial_wxyz, time_constant_s } => {
            JointAttitude::FromImus { initial: initial_wxyz, time_constant_s }
        }
    };
    let model =
        TwoLinks::new(mounting, ranges, links.joint_position_m, attitude).ok_or(SettingName::Joint)?;
    let period_ns = if from_sensors { (1e9 / imu.rate_hz) as u32 } else { 0 };
    Ok((model, second_aligner(first, imu.group_delay_ns, period_ns)))
}

#[inline(never)]
fn mounting(imu: &ImuSettings) -> Result<ImuMounting<f32>, SettingName> {
    let rotation = Rotation::from_quaternion(imu.rotation_wxyz).ok_or(SettingName::ImuRotation)?;
    ensure(all_finite(&imu.position_m), SettingName::ImuPosition)?;
    ensure(positive(&imu.accel_scale), SettingName::AccelScale)?;
    ensure(all_finite(&imu.accel_bias_mps2) && all_finite(&imu.gyro_bias_radps), SettingName::ImuBias)?;
    Ok(ImuMounting {
        rotation,
        position: Position::from_array(imu.position_m),
        accel_scale: imu.accel_scale,
        accel_bias: SpecificForce::from_array(imu.accel_bias_mps2),
        gyro_bias: AngularRate::from_array(imu.gyro_bias_radps),
    })
}

impl SampleConfiguration {
    fn new(settings: &Settings, links: Option<&TwoLinkSettings>) -> Result<Self, SettingName> {
        let (imu, cell) = (&settings.imu, &settings.load_cell);
        let from_sensors = settings.source == Source::Sensors;
        ensure(positive(&[settings.rate_hz]) && settings.rate_hz <= MAX_RATE_HZ, SettingName::Rate)?;
        ensure(
            !from_sensors || (positive(&[imu.rate_hz]) && imu.rate_hz <= MAX_RATE_HZ),
            SettingName::ImuRate,
        )?;
        let mounting = mounting(imu)?;
        ensure(positive(&[imu.range_mps2, imu.range_radps]), SettingName::ImuRange)?;
        ensure(
            cell.calibration.iter().all(|row| all_finite(row) && row.iter().any(|v| *v != 0.0)),
            SettingName::Calibration,
        )?;
        ensure(positive(&cell.range_n_nm), SettingName::LoadCellRange)?;
        ensure(cell.known_offset_n_nm.is_none_or(|o| all_finite(&o)), SettingName::KnownOffset)?;
        // The converter's seventh input takes 1.2 V, with room for drift.
        let excitation = cell.excitation_v.is_none_or(|v| (0.1..=1.05).contains(&v));
        ensure(excitation, SettingName::Excitation)?;
        ensure(is_possible(settings.stop.as_ref()), SettingName::StopRule)?;
        let limit = settings.knock_limit_sd;
        ensure(limit.is_finite() && limit >= 0.0, SettingName::KnockLimit)?;
        let imu_noise = ImuNoise { accel: imu.accel_noise_mps2, gyro: imu.gyro_noise_radps };
        ensure(
            [imu_noise.accel, imu_noise.gyro].iter().all(|v| v.is_finite() && *v >= 0.0),
            SettingName::ImuNoise,
        )?;
        let estimator = EstimatorConfig {
            rate_hz: settings.rate_hz,
            filter_width_s: settings.filter_width_s,
            row_every: settings.row_every,
            channel_sigma: cell.noise_n_nm,
            known_offset: cell.known_offset_n_nm.unwrap_or_default(),
            mounting,
            limits: Limits {
                wrench: cell.range_n_nm,
                specific_force: imu.range_mps2,
                angular_rate: imu.range_radps,
                frozen_after: settings.frozen_after,
            },
        };
        let aligner = AlignerConfig {
            wrench_delay_ns: cell.group_delay_ns,
            imu_delay_ns: imu.group_delay_ns,
            imu_period_ns: if from_sensors { (1e9 / imu.rate_hz) as u32 } else { 0 },
        };
        Ok(Self {
            estimator,
            second: links.map(|links| second_link(links, &aligner, settings.source)).transpose()?,
            aligner,
            gauges: GaugeCalibration { matrix: cell.calibration },
            estimates_offset: cell.known_offset_n_nm.is_none(),
            stop: settings.stop.as_ref().map(|stop| StopLimits {
                standard_deviation: deviations(stop),
                minimum_blocks: stop.minimum_blocks,
            }),
            knock_limit: limit,
            imu_noise,
            memory: match settings.memory {
                MemorySettings::Forever => None,
                MemorySettings::Forgetting { time_constant_s, accel_noise_mps2, gyro_noise_radps } => {
                    Some(MemoryConfig {
                        span: Span::TimeConstant(time_constant_s),
                        imu_noise: ImuNoise { accel: accel_noise_mps2, gyro: gyro_noise_radps },
                    })
                }
                MemorySettings::Window { length_s } => Some(MemoryConfig {
                    span: Span::Window(length_s),
                    imu_noise: ImuNoise { accel: 0.0, gyro: 0.0 },
                }),
            },
        })
    }
}

/// Returns the setting an estimator's refusal is about.
pub(crate) fn setting_of(error: ConfigError) -> SettingName {
    match error {
        ConfigError::Sigma(channel) => SettingName::Noise(channel),
        ConfigError::Kernel(_) => SettingName::Filter,
        ConfigError::Memory => SettingName::Memory,
        ConfigError::ImuNoise => SettingName::ImuNoise,
    }
}

/// Returns the setting that a tree's refusal is about.
pub(crate) fn setting_of_tree(error: FramesError) -> SettingName {
    match error {
        FramesError::Links(_) | FramesError::Parameters(_) => SettingName::Links,
        FramesError::Link(link) => SettingName::Link(link as u8),
        FramesError::Sigma(channel) => SettingName::Noise(channel),
        FramesError::Filter(_) => SettingName::Filter,
        FramesError::Stiffness => SettingName::Stiffness,
        FramesError::Suspension => SettingName::Suspension,
    }
}
