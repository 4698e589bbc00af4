//! Several links on the device, from the host's side: what it is told, what it finds, under which names.

use std::io;
use std::time::Duration;

use nalgebra::{DMatrix, DVector};
use rigident::formats::rig::RigFile;
use rigident::link::{Client, Transport};
use rigident::models::human::Person;
use rigident::session::tree::{complaints, device_tree, empty_factor, take_level};
use rigident::session::two_links::{two_link_answer, two_link_settings};
use rigident::session::{DeviceTiming, settings};
use rigident_shared::wire::{AttitudeSource, Command, Reply, Settings, Source, StateName, Telemetry};
use rigident_sim::body::BodyParameters;
use rigident_sim::experiment::thesis_program;
use rigident_sim::links::{SecondLink, Swing, Tree, TreeLink};
use rigident_sim::rig::{Mounting, Rig, RigConfig};
use rigident_sim::runner::{FrameBus, InProcess, Mcu, Pacing, frames_of};
use rigident_sim::sensors::{PerExperiment, SensorModels};
use rigident_sim::serve::rig_file;

struct Line(InProcess);

impl Transport for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.write(bytes)
    }
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.0.read(buffer, timeout)
    }
}

const TIMING: DeviceTiming =
    DeviceTiming { rate_hz: 1000.0, is_static: false, source: Source::Sensors, host_timeout_ms: 0 };

fn swing(i: usize) -> Swing {
    Swing {
        amplitude_rad: std::array::from_fn(|k| 0.5 + 0.1 * ((i + k) % 3) as f64),
        frequency_hz: std::array::from_fn(|k| 0.35 + 0.083 * ((5 * i + 3 * k) % 11) as f64),
        phase_rad: std::array::from_fn(|k| 0.9 * i as f64 + 1.7 * k as f64),
    }
}

/// Mass, centre of mass and tensor about it, of φ about the link's origin.
fn body(phi: &[f64; 10]) -> BodyParameters {
    let [m, x, y, z, xx, yy, zz, yz, zx, xy] = *phi;
    let [x, y, z] = [x / m, y / m, z / m];
    BodyParameters {
        mass_kg: m,
        com_m: [x, y, z],
        inertia_com_kgm2: [
            xx - m * (y * y + z * z),
            yy - m * (z * z + x * x),
            zz - m * (x * x + y * y),
            yz + m * y * z,
            zx + m * z * x,
            xy + m * x * y,
        ],
    }
}

#[test]
fn the_34_dof_human_s_128_base_parameters_come_off_the_device_under_their_names() {
    const NOISE: [f64; 6] = [1.0, 1.0, 2.0, 0.2, 0.2, 0.2];
    let human = Person::default().human34().unwrap();
    let (model, parameters) = device_tree(&human).unwrap();
    assert_eq!(parameters.len(), 128);
    let mut phi = Vec::new();
    let links = human
        .links
        .iter()
        .enumerate()
        .map(|(i, link)| {
            let nominal = link.nominal.expect("every segment has a mass");
            phi.extend(nominal);
            // Axes at zero position are the parent's, so that attitudes are products of the joints' turns alone.
            assert_eq!(link.link.rotation, nalgebra::Matrix3::identity());
            let mut swing = swing(i);
            if matches!(link.link.joint, rigident_shared::tree::Joint::Revolute(_)) {
                (swing.amplitude_rad[0], swing.amplitude_rad[2]) = (0.0, 0.0);
            }
            TreeLink {
                parent: link.link.parent,
                joint_m: link.link.position.into(),
                body: body(&nominal),
                swing,
            }
        })
        .collect();
    let tree = Tree { links, sway_m: [0.1, 0.08, 0.05], sway_hz: [0.5, 0.7, 0.9], gravity_mps2: 9.80665 };
    let frames = frames_of(&tree, 3000, 100.0, NOISE, 7);
    let (bus, gate) = FrameBus::new(frames, 100.0);
    let mut client = Client::new(Box::new(Line(InProcess::on(Box::new(bus)))));
    client.hello().unwrap();
    let rig = RigFile::parse("[load_cell]\nnoise_n_nm = [1, 1, 2, 0.2, 0.2, 0.2]\noffset_n_nm = \"zero\"\n")
        .unwrap();
    let injected = DeviceTiming { source: Source::Injected, ..TIMING };
    let one = settings(&rig, &injected, None, None).unwrap();
    let told = Settings { model, source: Source::Sensors, ..one };
    client.ask("configure", &Command::Configure(told)).unwrap();
    client.ask("start", &Command::Start).unwrap();
    gate.set_open(true);
    let mut factor = empty_factor(parameters.len());
    let mut levels = 0;
    while !gate.is_done() {
        client.listen(Duration::from_millis(5)).unwrap();
        if levels < 3 {
            // While it runs.
            take_level(&mut client, &mut factor).unwrap();
            levels += 1;
        }
    }
    take_level(&mut client, &mut factor).unwrap();
    assert_eq!(factor.rows(), 6 * 3000);
    let Reply::Counters(counters) = client.ask("counters", &Command::ReadCounters).unwrap() else {
        panic!("no counters")
    };
    let names: Vec<String> = human.links.iter().map(|l| l.name.clone()).collect();
    assert_eq!(complaints(&counters.frames, &names), Vec::<String>::new());
    // φ_B of the nominal human by the host's regrouping.
    let mut r = DMatrix::zeros(128, 128);
    let mut z = DVector::zeros(128);
    for i in 0..128 {
        let row: Vec<f64> = factor.row(i).collect();
        (0..128 - i).for_each(|k| r[(i, i + k)] = row[k]);
        z[i] = row[128 - i];
    }
    let inverse = r.clone().try_inverse().unwrap();
    let found = &inverse * z;
    let norms: Vec<f64> = r.column_iter().map(|c| c.norm()).collect();
    let singular = DMatrix::from_fn(128, 128, |i, j| r[(i, j)] / norms[j]).singular_values();
    let limit = 20.0 * 1.19e-7 * singular.max() / singular.min() * found.norm();
    for (j, parameter) in parameters.iter().enumerate() {
        let truth: f64 = parameter.terms.iter().map(|(column, weight)| weight * phi[*column]).sum();
        let sd = inverse.row(j).norm();
        assert!((found[j] - truth).abs() < 5.0 * sd + limit, "{}: {} {truth} {sd}", parameter.name, found[j]);
    }
}

#[test]
fn two_links_of_a_rig_file_come_off_the_device_under_their_names() {
    let mut sensors = SensorModels::thesis();
    sensors.load_cell.offset_n_nm = PerExperiment::fixed([3.0, -2.0, 5.0, 0.2, -0.3, 0.1]);
    sensors.imu.accel_bias_mps2 = PerExperiment::ZERO;
    sensors.imu.gyro_bias_radps = PerExperiment::ZERO;
    sensors.imu.gyro_range_radps = 30.0;
    let at_rest = Swing { phase_rad: [std::f64::consts::FRAC_PI_2; 3], ..swing(2) };
    let second = SecondLink {
        body: BodyParameters {
            mass_kg: 6.0,
            com_m: [0.04, -0.03, 0.12],
            inertia_com_kgm2: [0.12, 0.10, 0.06, 0.01, -0.015, 0.02],
        },
        joint_m: [0.1, -0.05, 0.2],
        swing: at_rest,
        imu: Mounting { position_m: [0.03, 0.05, 0.1], rotation_wxyz: [1.0, 0.0, 0.0, 0.0] },
    };
    let config = RigConfig::thesis_horizontal().with_sensors(sensors).with_second(second);
    let rig = Rig::new(config.clone()).unwrap();
    let file = rig_file(&rig)
        + "[[imu]]\nlink = 1\nposition_m = [0.03, 0.05, 0.1]\nrate_hz = 1000\ngroup_delay_s = 0.6e-3\n\
           [[link]]\nname = \"seat\"\n[[link]]\nname = \"arm\"\nparent = \"seat\"\njoint = \"spherical\"\n\
           position_m = [0.1, -0.05, 0.2]\n";
    let file = RigFile::parse(&file).unwrap();
    let attitude = AttitudeSource::FromImus {
        initial_wxyz: at_rest.attitude_wxyz(0.0).map(|v| v as f32),
        time_constant_s: 5.0,
    };
    let told = two_link_settings(&file, &TIMING, None, attitude).unwrap();
    let rig = rig.shared();
    let mut client = Client::new(Box::new(Line(InProcess::new(rig.clone(), Pacing::LockStep))));
    client.hello().unwrap();
    client.ask("configure", &Command::Configure(told)).unwrap();
    rig.lock().unwrap().load_program(thesis_program(&config.geometry, 40.0)).unwrap();
    client.ask("start", &Command::Start).unwrap();
    rig.lock().unwrap().start().unwrap();
    let mut readings = 0;
    while !rig.lock().unwrap().is_done() {
        client.listen(Duration::from_millis(5)).unwrap();
        while let Some(message) = client.next_telemetry() {
            match message {
                Telemetry::LinkReadings { readings: batch, .. } => readings += batch.len(),
                Telemetry::State { state, .. } => assert_ne!(state, StateName::Fault),
                _ => {}
            }
        }
    }
    client.ask("hold", &Command::Hold).unwrap();
    assert!(readings > 39_000, "{readings}");
    let answer = two_link_answer(&mut client, &file).unwrap();
    assert_eq!((answer.names[0].as_str(), answer.names[10].as_str()), ("seat.M", "arm.MSx"));
    assert!(answer.determined.iter().all(|d| *d));
    let truth = second.base_parameters(&config.body).into_iter().chain([3.0, -2.0, 5.0, 0.2, -0.3, 0.1]);
    for (j, truth) in truth.enumerate() {
        let (value, sd) = (answer.estimate[j], answer.standard_deviation[j]);
        assert!((value - truth).abs() < 4.0 * sd, "{}: {value} {truth} {sd}", answer.names[j]);
    }
}
