//! A person's motion as frames of a base that cameras track: positions and rates alone.

use nalgebra::{DMatrix, Rotation3, UnitQuaternion};
use rigident_shared::wire::tree_frame::{MAX_TREE_FRAME, TRACKED_LINK_NUMBERS, TrackedFrame};
use rigident_shared::wire::{LinkJoint, ModelSettings, Settings, Source};

use super::tree::{DeviceTreeError, device_tree, tree_settings};
use super::{DeviceTiming, frames::NoFrames};
use crate::fit::{Channel, RowSource};
use crate::problem::tree::TreeSource;
use crate::rig::{LoadCellClass, LoadCellTable, OffsetTable, OffsetWord, RecordingTable, RigFile};

/// The frames of a source whose base is tracked. Their numbers tell gaps in time: one more is one period later.
///
/// # Errors
/// [`NoFrames`] if a frame holds fewer links.
pub fn frames(source: &TreeSource) -> Result<Vec<Vec<u8>>, NoFrames> {
    let input = source.input();
    let first = input.frames.first().map_or(0, |frame| frame.time_ns);
    (0..input.frames.len())
        .map(|k| {
            let frame = &input.frames[k];
            let states = source.link_states(k).ok_or(NoFrames::Links)?;
            let pose = |state: &rigident_shared::tree::LinkState<f64>| -> [f32; TRACKED_LINK_NUMBERS] {
                let q =
                    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(state.rotation));
                let rate = state.rotation.tr_mul(&state.rate);
                [q.w, q.i, q.j, q.k, rate.x, rate.y, rate.z].map(|v| v as f32)
            };
            let (base, others) = states.split_first().ok_or(NoFrames::Links)?;
            let own = pose(base);
            let placed: Vec<f32> = frame.wrench.iter().chain(&base.velocity).map(|v| *v as f32).collect();
            let base = std::array::from_fn(|i| if i < 9 { placed[i] } else { own[i - 9] });
            let others: Vec<_> = others.iter().map(pose).collect();
            let number = (frame.time_ns.saturating_sub(first) as f64 * 1e-9 * input.rate_hz).round();
            let mut bytes = vec![0; MAX_TREE_FRAME];
            let length =
                TrackedFrame::encode(number as u32, &base, &others, &mut bytes).ok_or(NoFrames::Links)?;
            bytes.truncate(length);
            Ok(bytes)
        })
        .collect()
}

/// The frames that such a series leaves out between its own.
pub fn left_out(frames: &[Vec<u8>], links: usize) -> u32 {
    let numbers: Vec<u32> =
        frames.iter().filter_map(|bytes| Some(TrackedFrame::decode(bytes, links).ok()?.number)).collect();
    numbers.windows(2).map(|pair| pair[1].saturating_sub(pair[0]).saturating_sub(1)).sum()
}

/// The device's settings for such frames, and what brings its parameters into the order of the source's:
/// `φ_device = map φ`.
///
/// # Errors
/// [`DeviceTreeError`] says what does not fit onto the device.
pub fn settings(source: &TreeSource) -> Result<(Settings, DMatrix<f64>), DeviceTreeError> {
    let input = source.input();
    let (mut told, parameters) = device_tree(&input.model)?;
    if let ModelSettings::Tree(links) = &mut told
        && let Some(base) = links.first_mut()
    {
        base.joint = LinkJoint::Free;
    }
    let sigma = |c: &Channel| c.sigma.unwrap_or(1.0);
    let sigma: Vec<f64> = source.channels().iter().map(sigma).collect();
    let rig = RigFile {
        recording: RecordingTable { rate_hz: Some(input.rate_hz), ..RecordingTable::default() },
        load_cell: LoadCellTable {
            noise_n_nm: Some(std::array::from_fn(|c| sigma.get(c).copied().unwrap_or(1.0))),
            offset_n_nm: OffsetTable::Word(OffsetWord::Zero),
            class: Some(LoadCellClass::Exact),
            ..LoadCellTable::default()
        },
        ..RigFile::default()
    };
    let timing = DeviceTiming {
        rate_hz: input.rate_hz,
        is_static: false,
        source: Source::Sensors,
        host_timeout_ms: 0,
    };
    let own = source.parameters();
    let is = |j: usize, k: usize| own.get(k).map(|p| &p.name) == parameters.get(j).map(|p| &p.name);
    let map = DMatrix::from_fn(parameters.len(), own.len(), |j, k| f64::from(u8::from(is(j, k))));
    Ok((tree_settings(&rig, &timing, told)?, map))
}
