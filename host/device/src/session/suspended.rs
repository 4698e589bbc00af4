//! Bodies on springs as frames: the displacement of the platform is where a wrench would, which the device
//! makes of it.

use nalgebra::{DMatrix, Matrix6, Vector6};
use rigident_shared::estimator::frames::SUSPENDED_LINKS;
use rigident_shared::wire::{
    LinkJoint, LinkSettings, MAX_TREE_PARAMETERS, ModelSettings, Settings, SuspensionSettings,
};

use super::frames::NoFrames;
use super::tracked::{encoded, number, of_link, pose, settings_of};
use super::tree::{DeviceTreeError, device_tree};
use rigident_fit::RowSource;
use rigident_vibration::suspension::Instant;
use rigident_vibration::suspension::SuspendedSource;

/// Returns the frames of a source on springs. Their numbers tell gaps in time: one more is one period later.
///
/// # Errors
/// [`NoFrames`] if a frame holds fewer links.
pub fn frames(source: &SuspendedSource) -> Result<Vec<Vec<u8>>, NoFrames> {
    let frame = |(k, Instant { at, .. }): (usize, &Instant)| {
        let states = source.tree().link_states(k).ok_or(NoFrames::Links)?;
        let (displacement, velocity) = (at.coordinates(), at.velocity);
        let placed = std::array::from_fn(|i| if i < 6 { displacement[i] } else { velocity[i - 6] });
        let others: Vec<_> = states.iter().skip(1).map(of_link).collect();
        encoded(number(source.input(), k), &placed, &pose(&at.rotation, &at.rate), &others)
    };
    source.instants().iter().enumerate().map(frame).collect()
}

/// Returns the device's settings for frames on springs with noise `sigma` of the springs' six channels, and
/// the map that brings its parameters into the order of the source's: `φ_device = map φ`.
///
/// # Errors
/// [`DeviceTreeError`] says what does not fit onto the device.
pub fn settings(
    source: &SuspendedSource,
    sigma: [f64; 6],
) -> Result<(Settings, DMatrix<f64>), DeviceTreeError> {
    let input = source.input();
    let (model, parameters) = device_tree(&input.model)?;
    let ModelSettings::Tree(mut links) = model else { return Err(DeviceTreeError::Links(0)) };
    if links.len() > SUSPENDED_LINKS {
        return Err(DeviceTreeError::OnSprings(links.len()));
    }
    if let Some(base) = links.first_mut() {
        *base = LinkSettings { joint: LinkJoint::Free, ..*base };
    }
    let support = source.support();
    if support.preload.is_more_than_a_height() {
        return Err(DeviceTreeError::Preload);
    }
    let (own, base, free) = (source.parameters(), &source.base().parameters, source.free());
    let all = parameters.len() + free.len();
    if all > MAX_TREE_PARAMETERS {
        return Err(DeviceTreeError::Parameters(all));
    }
    let stiffness = support.springs.stiffness();
    let mut elements = SuspensionSettings::places().map(|place| stiffness[place] as f32);
    let q = nalgebra::UnitQuaternion::from_matrix(&support.mount.rotation);
    let springs = SuspensionSettings {
        stiffness: std::array::from_fn(|_| elements.next().unwrap_or(0.0)),
        base_position_m: support.mount.arm.map(|v| v as f32).into(),
        base_rotation_wxyz: [q.w, q.i, q.j, q.k].map(|v| v as f32),
        anchor_height_m: support.preload.height_m() as f32,
        locked: (0..6).filter(|k| !free.contains(k)).fold(0, |locked, k| locked | 1 << k),
    };
    // Base parameters by name, as one body's have other names in the source; then what springs carry, in the
    // same order.
    let place = |j: usize| match parameters.get(j) {
        Some(p) => base.iter().position(|own| own.name == p.name),
        None => Some(j - parameters.len() + base.len()),
    };
    let map = DMatrix::from_fn(all, own.len(), |j, k| f64::from(u8::from(place(j) == Some(k))));
    Ok((settings_of(ModelSettings::Suspended(links, springs), input.rate_hz, sigma)?, map))
}

/// Returns by how much the springs' wrench differs from that of their matrix at most, which is what the
/// device has: N, N m.
pub fn beyond_matrix(source: &SuspendedSource) -> [f64; 6] {
    let springs = source.springs();
    let stiffness: Matrix6<f64> = springs.stiffness();
    let mut most = [0.0_f64; 6];
    for Instant { at, .. } in source.instants() {
        let off: Vector6<f64> = springs.wrench(at) + stiffness * at.coordinates();
        most.iter_mut().zip(off.iter()).for_each(|(most, off)| *most = most.max(off.abs()));
    }
    most
}
