//! `rigident-sim`: the simulated rig as a program of its own.

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::{Parser, Subcommand};
use rigident_sim::link::{ByteLink, FaultyLink};
use rigident_sim::rig::{Rig, SharedRig};
use rigident_sim::runner::{InProcess, Mcu, Pacing, Qemu, QemuOptions};
use rigident_sim::serve::gcs::GcsServer;
use rigident_sim::serve::sensors::{
    AtiServer, BridgeServer, Delivery, LinesServer, Played, Quantity, RtdeServer, Topic, TopicKind,
    XsensServer, body_moved, sensors_rig_file,
};
use rigident_sim::serve::ur;
use rigident_sim::serve::{
    Controller, Firmware, Port, SensorsOptions, ServeOptions, StreamServer, Where, carry, rig_file,
};

/// A simulated rig: a body on a Stewart platform, sensors, and the firmware that reads them.
#[derive(Parser)]
#[command(name = "rigident-sim", version)]
struct Arguments {
    /// What to do
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Offer the rig to other programs: firmware on a serial port, platform controller on a network port
    Serve(Box<ServeOptions>),
    /// Offer sensors of other makes on a body that moves, for `rigident live`
    Sensors(Box<SensorsOptions>),
}

/// A failure in words, and its exit status: 2 usage, 3 link or machine.
struct Failure(u8, String);

fn main() -> ExitCode {
    let done = match Arguments::parse().command {
        Command::Serve(options) => serve(&options),
        Command::Sensors(options) => sensors(&options),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure(status, message)) => {
            eprintln!("rigident-sim: {message}");
            ExitCode::from(status)
        }
    }
}

/// Offers lines of poses at an address.
fn stream(options: &ServeOptions, at: &str, rig: &SharedRig) -> Result<StreamServer, Failure> {
    let report = |said: &str| eprintln!("rigident-sim: the stream is not followed: {said}");
    let mut lines = StreamServer::listen(at, Arc::clone(rig), report)
        .map_err(|e| Failure(3, format!("no lines at {at}: {e}; name another address by --stream")))?;
    if let Some(name) = &options.stream_port_link {
        lines.open_port(name).map_err(|e| Failure(3, format!("no port {}: {e}", name.display())))?;
    }
    Ok(lines)
}

fn serve(options: &ServeOptions) -> Result<(), Failure> {
    let leave = Arc::new(AtomicBool::new(false));
    let stop = Arc::clone(&leave);
    ctrlc::set_handler(move || stop.store(true, Ordering::Release))
        .map_err(|e| Failure(3, format!("Ctrl-C cannot be caught: {e}")))?;

    let rig = Rig::new(options.rig()).map_err(|e| Failure(2, e.to_string()))?;
    describe(options, &rig)?;
    if let Some(at) = &options.ur {
        return serve_arm(options, at, rig, &leave);
    }
    let rig = rig.shared();
    let controller = Controller::listen(&options.platform, Arc::clone(&rig)).map_err(|e| {
        Failure(3, format!("no controller at {}: {e}; name another address by --platform", options.platform))
    })?;
    let hexapod = match &options.gcs {
        None => None,
        Some(at) => Some(
            GcsServer::listen(at, Arc::clone(&rig))
                .map_err(|e| Failure(3, format!("no hexapod at {at}: {e}; name another address by --gcs")))?,
        ),
    };
    let line = match (&hexapod, &options.gcs_port_link) {
        (Some(hexapod), Some(name)) => Some(hexapod.open_port(Some(name)).map_err(|e| {
            let name = name.display();
            Failure(
                3,
                format!("no port {name}: {e}; remove what has that name, or name another by --gcs-port-link"),
            )
        })?),
        _ => None,
    };
    let lines = options.stream.as_ref().map(|at| stream(options, at, &rig)).transpose()?;
    let (mut port, mut firmware) = device(options, rig)?;
    let (shown, address) = (options.port_link.display(), controller.address());
    eprintln!("port      {shown} -> {}", port.terminal().display());
    eprintln!("platform  tcp://{address}");
    if let Some(hexapod) = &hexapod {
        eprintln!("hexapod   gcs://{}", hexapod.address());
    }
    if let (Some(line), Some(name)) = (&line, &options.gcs_port_link) {
        eprintln!("hexapod   {} -> {}", name.display(), line.terminal().display());
    }
    if let Some(lines) = &lines {
        eprintln!(
            "lines     pose+tcp://{0}, pose+udp://{0}, legs+tcp://{0}, legs+udp://{0}",
            lines.address()
        );
    }
    let rig = options.write_rig.as_deref().unwrap_or(Path::new("FILE (see --write-rig)")).display();
    eprintln!("use it    rigident run --port {shown} --rig {rig} --platform tcp://{address}");
    eprintln!("Ctrl-C ends it.");
    carry(&mut port, firmware.as_mut(), &leave).map_err(|e| Failure(3, e.to_string()))
}

/// Opens the port and starts the firmware behind it.
fn device(options: &ServeOptions, rig: SharedRig) -> Result<(Port, Box<dyn ByteLink>), Failure> {
    let port = Port::open(Some(&options.port_link)).map_err(|e| {
        let name = options.port_link.display();
        Failure(3, format!("no port {name}: {e}; remove what has that name, or name another by --port-link"))
    })?;
    let mcu: Box<dyn Mcu> = match options.mcu {
        Where::Inproc => Box::new(InProcess::new(rig, Pacing::RealTime)),
        Where::Qemu => {
            let qemu = QemuOptions { show_log: options.show_log, ..QemuOptions::default() };
            Box::new(Qemu::spawn(&qemu, rig, Pacing::RealTime).map_err(|e| Failure(3, e.to_string()))?)
        }
    };
    eprintln!("firmware  {}", mcu.name());
    let firmware: Box<dyn ByteLink> = match options.link_faults() {
        None => Box::new(Firmware(mcu)),
        Some(faults) => Box::new(FaultyLink::new(Firmware(mcu), faults, options.seed)),
    };
    Ok((port, firmware))
}

/// Writes the rig file, and the model of an arm beside it, if asked for.
fn describe(options: &ServeOptions, rig: &Rig) -> Result<(), Failure> {
    if let Some(path) = &options.write_rig {
        write_new(path, &rig_file(rig)).map_err(|e| Failure(2, format!("{}: {e}", path.display())))?;
        if options.ur.is_some() {
            let model = path.with_file_name(ur::MODEL);
            write_new(&model, &ur::urdf()).map_err(|e| Failure(2, format!("{}: {e}", model.display())))?;
        }
    }
    Ok(())
}

/// Offers the rig on an arm until Ctrl-C.
fn serve_arm(options: &ServeOptions, at: &str, rig: Rig, leave: &AtomicBool) -> Result<(), Failure> {
    let rig = rig.shared();
    let report = |said: &str| eprintln!("rigident-sim: {said}");
    let arm = ur::UrServer::listen([at, &options.ur_script], Arc::clone(&rig), report).map_err(|e| {
        let script = &options.ur_script;
        Failure(3, format!("no arm at {at} and {script}: {e}; name other addresses by --ur and --ur-script"))
    })?;
    let arm = Arc::new(arm);
    let (mut port, mut firmware) = device(options, rig)?;
    let (shown, address) = (options.port_link.display(), arm.url());
    eprintln!("port      {shown} -> {}", port.terminal().display());
    eprintln!("arm       {address}");
    let file = options.write_rig.as_deref().unwrap_or(Path::new("FILE (see --write-rig)")).display();
    eprintln!("use it    rigident plan motion --rig {file} --out motion.json");
    eprintln!("          rigident run --port {shown} --rig {file} --plan motion.json --platform '{address}'");
    eprintln!("Ctrl-C ends it.");
    let typed = Arc::clone(&arm);
    std::thread::spawn(move || {
        for line in io::stdin().lines().map_while(Result::ok) {
            match incident(line.trim()) {
                Some(incident) => typed.happens(incident),
                None => {
                    eprintln!("rigident-sim: {line:?}: there are protective, emergency, cut, stopped, local")
                }
            }
        }
    });
    carry(&mut port, firmware.as_mut(), leave).map_err(|e| Failure(3, e.to_string()))
}

fn incident(word: &str) -> Option<ur::Incident> {
    match word {
        "protective" => Some(ur::Incident::Protective),
        "emergency" => Some(ur::Incident::Emergency),
        "cut" => Some(ur::Incident::Cut),
        "stopped" => Some(ur::Incident::Stopped),
        "local" => Some(ur::Incident::Local),
        _ => None,
    }
}

/// Offers sensors until Ctrl-C.
fn sensors(options: &SensorsOptions) -> Result<(), Failure> {
    let leave = Arc::new(AtomicBool::new(false));
    let stop = Arc::clone(&leave);
    ctrlc::set_handler(move || stop.store(true, Ordering::Release))
        .map_err(|e| Failure(3, format!("Ctrl-C cannot be caught: {e}")))?;
    let moved = body_moved(options.duration_s, options.seed);
    let begun = std::time::Instant::now();
    let delivery = Delivery {
        lose: options.lose,
        jitter_s: options.jitter_s,
        stops_after_s: options.stop_after_s,
        ..Delivery::default()
    };
    // Every device has a clock of its own.
    let played = |rate_hz: f64, drift: f64, zero_s: f64| {
        Played::new(&moved, (rate_hz, drift, zero_s), delivery, begun).map_err(|e| Failure(2, e.to_string()))
    };
    let taken = |what: &str, e: io::Error| Failure(3, format!("no {what}: {e}"));
    if let Some(path) = &options.write_rig {
        // What these two report is what the body does to them.
        let is_reaction = options.ati.is_some() || options.rtde.is_some();
        let sign = if is_reaction { "\n[recording]\nwrench_sign = \"on_sensor\"\n" } else { "" };
        let text = sensors_rig_file(&moved.0, sign);
        write_new(path, &text).map_err(|e| Failure(2, format!("{}: {e}", path.display())))?;
    }
    let mut kept: Vec<Box<dyn std::any::Any>> = Vec::new();
    if let Some(at) = &options.ati {
        let ati = AtiServer::listen(at, played(500.0, 30e-6, 0.0)?).map_err(|e| taken("ATI sensor", e))?;
        eprintln!("--wrench  '{}'    (on_sensor, as --write-rig writes beside --ati or --rtde)", ati.url());
        kept.push(Box::new(ati));
    }
    if let Some(at) = &options.rtde {
        let rtde = RtdeServer::listen(at, played(500.0, -20e-6, 5000.0)?).map_err(|e| taken("robot", e))?;
        eprintln!("--wrench  rtde://{0} --imu rtde://{0}    (on_sensor)", rtde.address());
        kept.push(Box::new(rtde));
    }
    if let Some(at) = &options.bridge {
        let topic = |name: &str, kind, rate_hz| {
            Ok(Topic { name: name.to_owned(), kind, played: played(rate_hz, 0.0, 1.75e9)? })
        };
        let topics = vec![
            topic("/ft/wrench", TopicKind::Wrench, 250.0)?,
            topic("/imu/data", TopicKind::Imu, 200.0)?,
            topic("/pose", TopicKind::Pose, 100.0)?,
        ];
        let bridge = BridgeServer::listen(at, topics, &["foxglove.sdk.v1", "foxglove.websocket.v1"])
            .map_err(|e| taken("bridge", e))?;
        let url = format!("ws://{}", bridge.address());
        eprintln!("--wrench  '{url}?topic=/ft/wrench' --imu '{url}?topic=/imu/data'");
        kept.push(Box::new(bridge));
    }
    if let Some(name) = &options.xsens_port_link {
        let mti = XsensServer::open(Some(name), played(200.0, -40e-6, 77.0)?).map_err(|e| taken("IMU", e))?;
        eprintln!("--imu     xsens://{}", name.display());
        kept.push(Box::new(mti));
    }
    if let Some(to) = &options.lines_to {
        let to = to.parse().map_err(|e| Failure(2, format!("--lines-to {to}: {e}")))?;
        let lines = LinesServer::to_udp(to, Quantity::Both, played(250.0, 10e-6, 12.0)?);
        kept.push(Box::new(lines.map_err(|e| taken("lines", e))?));
        eprintln!("--wrench  udp://{to} --imu udp://{to}");
    }
    if let Some(name) = &options.lines_port_link {
        let lines = LinesServer::on_port(Some(name), Quantity::Both, played(100.0, 10e-6, 12.0)?);
        kept.push(Box::new(lines.map_err(|e| taken("line", e))?));
        eprintln!("--wrench  serial:{0} --imu serial:{0}", name.display());
    }
    if kept.is_empty() {
        return Err(Failure(2, "no sensor is asked for: see `rigident-sim sensors --help`".to_owned()));
    }
    eprintln!("Ctrl-C ends it.");
    while !leave.load(Ordering::Acquire) {
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    Ok(())
}

/// Writes a file that must not be there yet.
fn write_new(path: &Path, text: &str) -> io::Result<()> {
    OpenOptions::new().write(true).create_new(true).open(path)?.write_all(text.as_bytes())
}
