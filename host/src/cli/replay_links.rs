//! `rigident replay` of several links: two from their readings, any tree of turning joints from frames.

use std::process::ExitCode;
use std::time::Instant;

use rigident_shared::wire::Source;

use super::arguments::{Mcu, Replay};
use super::experiment::Watcher;
use super::identify_tree::change_as_recorded;
use super::link::configured;
use super::links::{LinksExperiment, check_asked};
use super::refused::refuse_for_trees;
use super::replay;
use super::{Failure, Folder, simulated};
use crate::device::link::Client;
use crate::device::session::tree::{device_tree, tree_settings};
use crate::device::session::two_links::{attitude_source, two_link_settings};
use crate::device::session::{DeviceTiming, Session, frames, two_links};
use crate::model::Model;
use crate::recording::Recording;
use crate::rig::{OffsetTable, OffsetWord};
use crate::trees::prepare::{Wishes, prepare};
use crate::trees::{self, DeviceRows};

/// `rigident replay` of a recording of this tree.
pub(super) fn run(arguments: &Replay, mut model: Model, started: Instant) -> Result<ExitCode, Failure> {
    refuse_for_trees(&[&arguments.course, &arguments.remember, &arguments.tare, &arguments.known])?;
    let mut recording =
        Recording::load(&arguments.recording, arguments.rig.as_deref()).map_err(Failure::input)?;
    let mut warnings = recording.warnings.clone();
    warnings.extend(change_as_recorded(&mut model, &arguments.tree.changes, &recording)?);
    let model = &model;
    let cell = &recording.rig.load_cell;
    let offset = cell.offset_n_nm == OffsetTable::Word(OffsetWord::Estimate);
    if cell.noise_n_nm.is_none() {
        // The device weighs rows by σ from the first one on.
        let ready = prepare(&recording, model, &Wishes::default()).map_err(Failure::input)?;
        let sigma = trees::identify(&ready.input).map_err(Failure::input)?.channel_sigma;
        warnings.push(replay::told_noise(&sigma));
        recording.rig.load_cell.noise_n_nm = sigma.first_chunk().copied();
    }
    let rate_hz = recording.rate_hz.unwrap_or(1.0);
    let timing =
        |source| DeviceTiming { rate_hz, is_static: recording.is_static, source, host_timeout_ms: 0 };
    let (told, parameters) = device_tree(model).map_err(Failure::input)?;
    let rig = &recording.rig;
    // Two links with an IMU each go the way of their readings.
    let two = rig.link.len() == 2 && rig.imu_on(1).is_some() && arguments.tree.model.is_none();
    check_asked(&parameters, two && offset, &arguments.output)?;
    if two {
        let readings = two_links::readings(&recording).map_err(Failure::input)?;
        let settings = two_link_settings(rig, &timing(Source::Injected), None, attitude_source(rig))
            .map_err(Failure::input)?;
        let (mcu, transport) = replay::device(&arguments.mcu)?;
        let mut session = Session::open(Client::new(transport)).map_err(Failure::link)?;
        configured(&mut session, &settings)?;
        let folder = Folder::new(arguments.output.out.as_deref(), "replay")?;
        let mut watcher = Watcher::new(readings.len());
        let take = session.inject_links(&readings, &mut watcher).map_err(Failure::link)?;
        watcher.finish()?;
        let mut given = two_links::recording(&recording.name, rig, rate_hz, &take.links);
        if recording.attitudes.is_empty() {
            given.attitudes.clear();
        }
        return LinksExperiment {
            started,
            output: &arguments.output,
            model,
            recording: &given,
            mcu,
            rows: DeviceRows::Filtered,
            truth: None,
            followed: None,
            warnings,
        }
        .conclude(take, &folder);
    }
    let mcu = match arguments.mcu.as_str() {
        "inproc" => Mcu::Inproc,
        "qemu" => Mcu::Qemu,
        port => {
            return Err(Failure::input(format!(
                "--mcu {port}: frames of a tree come over the device's sensor bus, which is simulated here: say inproc or qemu. \
                 A port takes recordings of one body and of two links"
            )));
        }
    };
    let sent = frames::frames(&recording, model).map_err(Failure::input)?;
    let settings = tree_settings(rig, &timing(Source::Sensors), told).map_err(Failure::input)?;
    let count = sent.len();
    let (transport, source) = simulated::frames(mcu, sent, rate_hz)?;
    let mut session = Session::open(Client::new(transport)).map_err(Failure::link)?;
    configured(&mut session, &settings)?;
    let folder = Folder::new(arguments.output.out.as_deref(), "replay")?;
    let mut watcher = Watcher::new(count);
    let take = session.follow_frames(&source, parameters.len(), &mut watcher).map_err(Failure::link)?;
    watcher.finish()?;
    LinksExperiment {
        started,
        output: &arguments.output,
        model,
        recording: &recording,
        mcu: simulated::name(mcu),
        rows: DeviceRows::Frames,
        truth: None,
        followed: None,
        warnings,
    }
    .conclude(take, &folder)
}
