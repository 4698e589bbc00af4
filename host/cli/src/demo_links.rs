//! `rigident demo` of several links: two with an IMU each from sensor buses, and a person from frames.

use std::process::ExitCode;
use std::time::Instant;

use rigident_shared::wire::Source;
use rigident_sim::links::SecondLink;
use rigident_sim::rig::{Rig, RigConfig};
use rigident_sim::runner::frames_of;
use rigident_sim::sensors::SensorModels;

use super::arguments::Demo;
use super::demo::{QUIET, RATE_HZ};
use super::experiment::{Experiment, Watcher, device_notes};
use super::link::configured;
use super::links_on_device::{check_asked, device_parameters};
use super::refused::refuse_for_trees;
use super::{Failure, Folder, guards, simulated};
use rigident::application::Loaded;
use rigident::application::report::provenance;
use rigident::device::link::Client;
use rigident::device::platform::{LocalPlatform, Platform as _};
use rigident::device::session::tree::{self, device_tree, tree_settings};
use rigident::device::session::two_links::{attitude_source, two_link_settings};
use rigident::device::session::{Axes, DeviceTiming, Session, frames, two_links};
use rigident::laboratory::person;
use rigident::rows::named_model::rig_links::from_tables;
use rigident_io::recording::new_file::{write_new, write_new_text};
use rigident_io::recording::{comment_in_words, rig_path};
use rigident_io::rig::{
    ImuClass, ImuTable, Joint, LinkTable, LoadCellClass, LoadCellTable, OffsetTable, OffsetWord,
    RecordingTable, RigFile,
};
use rigident_model::human::Person;

/// Frames of a person at the given rate.
const FRAMES_HZ: f64 = 100.0;
/// Of the force plates below the person: 1 σ per frame, N and N m.
const PLATES: [f64; 6] = [0.5, 0.5, 1.0, 0.1, 0.1, 0.1];
/// Shorter motions of a person tell little; longer ones nothing new. s
const FRAMES_S: std::ops::RangeInclusive<f64> = 2.0..=3600.0;

fn refuse_others(arguments: &Demo) -> Result<(), Failure> {
    refuse_for_trees(&[&arguments.forgetting, &arguments.adaptive])
}

/// The device, greeted.
fn open(transport: Box<dyn rigident::device::link::Transport>) -> Result<Session, Failure> {
    Session::open(Client::new(transport)).map_err(|e| Failure::link(e).context("the simulated device"))
}

/// `rigident demo --body two-links`
pub(super) fn two_links(arguments: &Demo) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    refuse_others(arguments)?;
    let known = arguments.known.parse()?;
    let mut config = RigConfig::two_links().with_seed(arguments.seed).with_rates(RATE_HZ, RATE_HZ);
    if arguments.ideal {
        let range = config.sensors.imu.gyro_range_radps;
        let mut sensors = SensorModels::ideal();
        sensors.imu.gyro_range_radps = range;
        config = config.with_sensors(sensors);
    }
    let geometry = config.geometry.clone();
    let rig = Rig::new(config).map_err(Failure::input)?;
    let second = rig.config().second.unwrap_or_else(SecondLink::arm);
    let mut file = two_link_file(&rig, &second);
    if arguments.ideal {
        file.load_cell.noise_n_nm = Some(QUIET);
        // Words without noise repeat themselves.
        file.recording.frozen_after = 0;
    }
    let truth = rig.truth();
    let truth: Vec<f64> =
        second.base_parameters(&truth.body).into_iter().chain(truth.apparent_offset_n_nm).collect();
    let model = from_tables(&file.link, "two links").map_err(Failure::input)?;
    let (_, parameters) = device_tree(&model).map_err(Failure::input)?;
    let estimated = device_parameters(&model, &parameters, true);
    check_asked(&estimated, &known, &arguments.output)?;
    let program = arguments.programme.program(&geometry)?;
    let rig = rig.shared();
    let mut session = open(simulated::transport(arguments.mcu, &rig)?)?;
    let timing =
        DeviceTiming { rate_hz: RATE_HZ, is_static: false, source: Source::Sensors, host_timeout_ms: 0 };
    let mut settings =
        two_link_settings(&file, &timing, None, attitude_source(&file)).map_err(Failure::input)?;
    arguments.stop.put_into(&mut settings, &estimated)?;
    configured(&mut session, &settings)?;
    let expected = (program.duration_s() * RATE_HZ) as usize;
    let mut platform = LocalPlatform(rig);
    platform.load(&program).map_err(Failure::link)?;
    let folder = Folder::new(arguments.output.out.as_deref(), "demo")?;
    let mut comments = device_notes(session.identity());
    comments.extend(provenance(&file));
    let mut watcher = Watcher::recording(folder.file("demo.mcap"), &file, &comments, expected)?;
    guards::watch(&mut session, &file, Axes::Each)?;
    let mut take = session.follow(&mut platform, &program, &mut watcher).map_err(Failure::link)?;
    watcher.end(&mut take);
    let read = two_links::recording("demo", &file, RATE_HZ, &take.links);
    Experiment {
        started,
        output: &arguments.output,
        stop: &arguments.stop,
        loaded: Loaded::of_links(&read, &model)?,
        mcu: simulated::name(arguments.mcu),
        identity: session.identity(),
        known: &known,
        tare: None,
        until: settings.stop,
        span: None,
        parameter_truth: Some(&truth),
        stages: Vec::new(),
        same_pose: None,
        tracking_error: None,
        decisions: Vec::new(),
        came: None,
        notes: Vec::new(),
        warnings: Vec::new(),
    }
    .conclude(take, &folder)
}

/// Returns what a user would have written into the rig file of the simulated rig with an arm.
fn two_link_file(rig: &Rig, second: &SecondLink) -> RigFile {
    let one = simulated::rig_file(rig, "");
    let imu = one.imu.first().cloned().unwrap_or_default();
    let link = |name: &str, nominal: (f64, [f64; 3], [f64; 6])| LinkTable {
        name: name.to_owned(),
        parent: None,
        joint: None,
        axis: None,
        second_axis: None,
        position_m: None,
        rotation_wxyz: [1.0, 0.0, 0.0, 0.0],
        initial_wxyz: None,
        nominal_mass_kg: Some(nominal.0),
        nominal_com_m: Some(nominal.1),
        nominal_inertia_com_kgm2: Some(nominal.2),
    };
    RigFile {
        imu: vec![
            imu.clone(),
            ImuTable {
                link: 1,
                position_m: second.imu.position_m,
                rotation_wxyz: simulated::normalised(second.imu.rotation_wxyz),
                ..imu
            },
        ],
        link: vec![
            // As a drawing may have them: bodies that are not quite these.
            link("body", (18.0, [0.0, 0.0, 0.06], [0.3, 1.0, 1.0, 0.0, 0.0, 0.0])),
            LinkTable {
                parent: Some("body".to_owned()),
                joint: Some(Joint::Spherical),
                position_m: Some(second.joint_m),
                initial_wxyz: Some(second.swing.attitude_wxyz(0.0)),
                ..link("arm", (5.5, [0.03, -0.02, 0.11], [0.1, 0.1, 0.05, 0.0, 0.0, 0.0]))
            },
        ],
        body: None,
        // It is of one body.
        truth: None,
        ..one
    }
}

/// `rigident demo --body human34`
pub(super) fn human34(arguments: &Demo) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    refuse_others(arguments)?;
    let known = arguments.known.parse()?;
    refuse_for_trees(&[&arguments.programme])?;
    let seconds = arguments.programme.duration_s;
    if !FRAMES_S.contains(&seconds) {
        return Err(Failure::input(format!(
            "--duration-s {seconds}: a person moves for {} to {} s",
            FRAMES_S.start(),
            FRAMES_S.end()
        )));
    }
    let model = Person::default().human34().map_err(Failure::input)?;
    let (told, parameters) = device_tree(&model).map_err(Failure::input)?;
    let estimated = device_parameters(&model, &parameters, false);
    check_asked(&estimated, &known, &arguments.output)?;
    // Not the person that the tables guess.
    let somebody = person::somebody(&model, arguments.seed);
    let truth: Vec<f64> = parameters
        .iter()
        .map(|p| p.terms.iter().map(|(column, weight)| weight * somebody[*column]).sum())
        .collect();
    let tree = person::tree(&model, &somebody);
    let noise = if arguments.ideal { [0.0; 6] } else { PLATES };
    let sent = frames_of(&tree, (seconds * FRAMES_HZ) as usize, FRAMES_HZ, noise, arguments.seed);
    let file = RigFile {
        recording: RecordingTable { rate_hz: Some(FRAMES_HZ), ..RecordingTable::default() },
        load_cell: LoadCellTable {
            noise_n_nm: Some(if arguments.ideal { QUIET } else { PLATES }),
            offset_n_nm: OffsetTable::Word(OffsetWord::Zero),
            class: Some(LoadCellClass::Exact),
            ..LoadCellTable::default()
        },
        // Frames tell of the links' own origins and axes.
        imu: (0..model.links.len())
            .map(|link| ImuTable { link, class: Some(ImuClass::Exact), ..ImuTable::default() })
            .collect(),
        ..RigFile::default()
    };
    let (transport, source) = simulated::frames(arguments.mcu, sent.clone(), FRAMES_HZ)?;
    let mut session = open(transport)?;
    let timing =
        DeviceTiming { rate_hz: FRAMES_HZ, is_static: false, source: Source::Sensors, host_timeout_ms: 0 };
    let mut settings = tree_settings(&file, &timing, told).map_err(Failure::input)?;
    arguments.stop.put_into(&mut settings, &estimated)?;
    configured(&mut session, &settings)?;
    let folder = Folder::new(arguments.output.out.as_deref(), "demo")?;
    let mut recording = frames::recording("demo", &file, FRAMES_HZ, model.links.len(), &sent);
    let comments = device_notes(session.identity());
    recording.comments = comments.iter().map(|(what, said)| comment_in_words(what, said)).collect();
    let path = folder.file("demo.csv");
    write_new(&path, |to| recording.write_csv(to)).map_err(Failure::input)?;
    write_new_text(&rig_path(&path), &file.to_toml()).map_err(Failure::input)?;
    let mut watcher = Watcher::new(sent.len());
    let take = session.follow_frames(&source, parameters.len(), &mut watcher).map_err(Failure::link)?;
    watcher.finish()?;
    recording.keep_first(tree::frames_taken(&take));
    Experiment {
        started,
        output: &arguments.output,
        stop: &arguments.stop,
        loaded: Loaded::of_links(&recording, &model)?,
        mcu: simulated::name(arguments.mcu),
        identity: session.identity(),
        known: &known,
        tare: None,
        until: settings.stop,
        span: None,
        parameter_truth: Some(&truth),
        stages: Vec::new(),
        same_pose: None,
        tracking_error: None,
        decisions: Vec::new(),
        came: None,
        notes: Vec::new(),
        warnings: Vec::new(),
    }
    .conclude(take, &folder)
}
