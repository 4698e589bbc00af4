//! A person's motion as frames of a base that cameras track: positions and rates alone.

use nalgebra::{DMatrix, Matrix3, Rotation3, UnitQuaternion, Vector3};
use rigident_shared::tree::LinkState;
use rigident_shared::wire::tree_frame::{MAX_TREE_FRAME, TRACKED_LINK_NUMBERS, TrackedFrame};
use rigident_shared::wire::{LinkJoint, ModelSettings, Settings, Source};

use super::tree::{DeviceTreeError, device_tree, tree_settings};
use super::{DeviceTiming, frames::NoFrames};
use rigident_fit::RowSource;
use rigident_io::rig::{LoadCellClass, LoadCellTable, OffsetTable, OffsetWord, RecordingTable, RigFile};
use rigident_rows::tree::{Frame, Input, TreeSource};

/// Returns the frames of a source whose base is tracked. Their numbers tell gaps in time: one more is one
/// period later.
///
/// # Errors
/// [`NoFrames`] if a frame holds fewer links.
pub fn frames(source: &TreeSource) -> Result<Vec<Vec<u8>>, NoFrames> {
    let input = source.input();
    let frame = |(k, frame): (usize, &Frame)| {
        let states = source.link_states(k).ok_or(NoFrames::Links)?;
        let (base, others) = states.split_first().ok_or(NoFrames::Links)?;
        let placed = std::array::from_fn(|i| if i < 6 { frame.wrench[i] } else { base.velocity[i - 6] });
        let others: Vec<_> = others.iter().map(of_link).collect();
        encoded(number(input, k), &placed, &of_link(base), &others)
    };
    input.frames.iter().enumerate().map(frame).collect()
}

/// Returns the number of a frame in the series.
pub(super) fn number(input: &Input, frame: usize) -> u32 {
    let time_ns = |k: usize| input.frames.get(k).map_or(0, |frame| frame.time_ns);
    (time_ns(frame).saturating_sub(time_ns(0)) as f64 * 1e-9 * input.rate_hz).round() as u32
}

/// Returns the attitude of a body, and its rate in its own axes.
pub(super) fn pose(rotation: &Matrix3<f64>, rate: &Vector3<f64>) -> [f32; TRACKED_LINK_NUMBERS] {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation));
    let rate = rotation.tr_mul(rate);
    [q.w, q.i, q.j, q.k, rate.x, rate.y, rate.z].map(|v| v as f32)
}

/// Returns the attitude of a link, and its rate in its own axes.
pub(super) fn of_link(state: &LinkState<f64>) -> [f32; TRACKED_LINK_NUMBERS] {
    pose(&state.rotation, &state.rate)
}

/// Encodes a frame: its number, what is measured at the base and the velocity there, and the poses.
pub(super) fn encoded(
    number: u32,
    placed: &[f64; 9],
    base: &[f32; TRACKED_LINK_NUMBERS],
    others: &[[f32; TRACKED_LINK_NUMBERS]],
) -> Result<Vec<u8>, NoFrames> {
    let base = std::array::from_fn(|i| if i < 9 { placed[i] as f32 } else { base[i - 9] });
    let mut bytes = vec![0; MAX_TREE_FRAME];
    let length = TrackedFrame::encode(number, &base, others, &mut bytes).ok_or(NoFrames::Links)?;
    bytes.truncate(length);
    Ok(bytes)
}

/// Returns the number of frames that a series leaves out between its own.
pub fn left_out(frames: &[Vec<u8>], links: usize) -> u32 {
    let numbers: Vec<u32> =
        frames.iter().filter_map(|bytes| Some(TrackedFrame::decode(bytes, links).ok()?.number)).collect();
    numbers.windows(2).map(|pair| pair[1].saturating_sub(pair[0]).saturating_sub(1)).sum()
}

/// Returns the device's settings for frames of a tracked base, and the map that brings its parameters into
/// the order of the source's: `φ_device = map φ`.
///
/// # Errors
/// [`DeviceTreeError`] says what does not fit onto the device.
pub fn settings(source: &TreeSource) -> Result<(Settings, DMatrix<f64>), DeviceTreeError> {
    let input = source.input();
    let (mut model, parameters) = device_tree(&input.model)?;
    if let ModelSettings::Tree(links) = &mut model
        && let Some(base) = links.first_mut()
    {
        base.joint = LinkJoint::Free;
    }
    let sigma = |c: usize| source.channels().get(c).and_then(|channel| channel.sigma).unwrap_or(1.0);
    let own = source.parameters();
    let is = |j: usize, k: usize| own.get(k).map(|p| &p.name) == parameters.get(j).map(|p| &p.name);
    let map = DMatrix::from_fn(parameters.len(), own.len(), |j, k| f64::from(u8::from(is(j, k))));
    Ok((settings_of(model, input.rate_hz, std::array::from_fn(sigma))?, map))
}

/// Returns the device's settings for frames of this model, whose wrench has no offset and this noise.
pub(super) fn settings_of(
    model: ModelSettings,
    rate_hz: f64,
    sigma: [f64; 6],
) -> Result<Settings, DeviceTreeError> {
    let rig = RigFile {
        recording: RecordingTable { rate_hz: Some(rate_hz), ..RecordingTable::default() },
        load_cell: LoadCellTable {
            noise_n_nm: Some(sigma),
            offset_n_nm: OffsetTable::Word(OffsetWord::Zero),
            class: Some(LoadCellClass::Exact),
            ..LoadCellTable::default()
        },
        ..RigFile::default()
    };
    let timing = DeviceTiming { rate_hz, is_static: false, source: Source::Sensors, host_timeout_ms: 0 };
    tree_settings(&rig, &timing, model)
}
