//! `rigident replay` of several links: two from their readings, any tree of turning joints from frames.

use std::process::ExitCode;
use std::time::Instant;

use rigident_shared::wire::Source;

use super::arguments::{Mcu, Replay};
use super::experiment::{Experiment, Watcher};
use super::link::configured;
use super::links_on_device::{check_asked, device_parameters};
use super::options::microcontroller::Image;
use super::refused::refuse_for_trees;
use super::replay;
use super::{Failure, Folder, Stages, simulated};
use rigident::application::tree::change_as_recorded;
use rigident::application::{Loaded, Tree};
use rigident::device::link::Client;
use rigident::device::session::tree::{self, device_tree, tree_settings};
use rigident::device::session::two_links::{attitude_source, two_link_settings};
use rigident::device::session::{DeviceTiming, Session, frames, two_links};
use rigident_io::recording::Recording;
use rigident_io::rig::{OffsetTable, OffsetWord};
use rigident_model::Model;

/// Replays a recording of this tree.
pub(super) fn run(
    arguments: &Replay,
    tree: &Tree,
    mut model: Model,
    started: Instant,
) -> Result<ExitCode, Failure> {
    refuse_for_trees(&[&arguments.forgetting])?;
    let known = arguments.known.parse()?;
    let mut recording =
        Recording::load(&arguments.recording, arguments.rig.as_deref()).map_err(Failure::input)?;
    if recording.wrench.is_none() {
        return Err(Failure::input(format!(
            "{}: the device estimates from the wrench of a load cell (fx_n to mz_nm), and there is none; `rigident identify` \
             takes joint torques",
            arguments.recording.display()
        )));
    }
    recording.leave_out_spikes();
    let mut warnings = recording.warnings.clone();
    let mut notes = change_as_recorded(&mut model, &tree.changes, &recording, &Stages::silent().caller())?;
    let rig_path = arguments.rig.as_deref();
    let tare = super::factor::tare(&arguments.tare, rig_path, None, tree, (&mut notes, &mut warnings))?;
    let model = &model;
    let (told, parameters) = device_tree(model).map_err(Failure::input)?;
    let offset = recording.rig.load_cell.offset_n_nm == OffsetTable::Word(OffsetWord::Estimate);
    let as_read = recording.clone();
    let sigma = replay::device_sigma(&Loaded::of_links(&as_read, model)?, None, &mut notes)?;
    recording.rig.load_cell.noise_n_nm = Some(sigma);
    let rate_hz = recording.rate_hz.unwrap_or(1.0);
    let timing =
        |source| DeviceTiming { rate_hz, is_static: recording.is_static, source, host_timeout_ms: 0 };
    let rig = &recording.rig;
    // Two links with an IMU each go the way of their readings.
    let two = rig.link.len() == 2 && rig.imu_on(1).is_some() && arguments.tree.model.is_none();
    let estimated = device_parameters(model, &parameters, two && offset);
    check_asked(&estimated, &known, &arguments.output)?;
    let (take, given, mcu, identity, folder, until);
    if two {
        let readings = two_links::readings(&recording).map_err(Failure::input)?;
        let mut settings = two_link_settings(rig, &timing(Source::Injected), None, attitude_source(rig))
            .map_err(Failure::input)?;
        arguments.stop.put_into(&mut settings, &estimated)?;
        let (name, transport) = replay::device(&arguments.mcu, Image::Standard)?;
        let mut session = Session::open(Client::new(transport)).map_err(Failure::link)?;
        configured(&mut session, &settings)?;
        folder = Folder::new(arguments.output.out.as_deref(), "replay")?;
        let mut watcher = Watcher::new(readings.len());
        take = session.inject_links(&readings, &mut watcher).map_err(Failure::link)?;
        watcher.finish()?;
        // As the file has them: the device was given them in single precision.
        let mut read = as_read.clone();
        read.keep_first(take.links.len());
        (given, mcu, identity) = (read, name, session.identity().clone());
        until = settings.stop;
    } else {
        let runner = match arguments.mcu.as_str() {
            "inproc" => Mcu::Inproc,
            "qemu" => Mcu::Qemu,
            port => {
                return Err(Failure::input(format!(
                    "--mcu {port}: frames of a tree come over the device's sensor bus, which is simulated here: say inproc or \
                     qemu. A port takes recordings of one body and of two links"
                )));
            }
        };
        let sent = frames::frames(&recording, model).map_err(Failure::input)?;
        let mut settings = tree_settings(rig, &timing(Source::Sensors), told).map_err(Failure::input)?;
        arguments.stop.put_into(&mut settings, &estimated)?;
        let count = sent.len();
        let (transport, source) = simulated::frames(runner, sent, rate_hz)?;
        let mut session = Session::open(Client::new(transport)).map_err(Failure::link)?;
        configured(&mut session, &settings)?;
        folder = Folder::new(arguments.output.out.as_deref(), "replay")?;
        let mut watcher = Watcher::new(count);
        take = session.follow_frames(&source, parameters.len(), &mut watcher).map_err(Failure::link)?;
        watcher.finish()?;
        let mut begun = as_read.clone();
        begun.keep_first(tree::frames_taken(&take));
        (given, mcu, until) = (begun, simulated::name(runner), settings.stop);
        identity = session.identity().clone();
    }
    Experiment {
        started,
        output: &arguments.output,
        stop: &arguments.stop,
        loaded: Loaded::of_links(&given, model)?,
        mcu,
        identity: &identity,
        known: &known,
        tare,
        until,
        span: None,
        parameter_truth: None,
        stages: Vec::new(),
        same_pose: None,
        tracking_error: None,
        decisions: Vec::new(),
        came: None,
        notes,
        warnings,
    }
    .conclude(take, &folder)
}
