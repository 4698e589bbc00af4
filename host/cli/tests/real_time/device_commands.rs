//! The commands around a device, with one on a port: firmware that is ours, and one built from other
//! definitions.

use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rigident_shared::wire::{
    Answer, ClockSource, Identity, Kept, Kind, PROTOCOL_VERSION, Reason, Reply, ResetReason, SCHEMA_HASH,
    StateName, encode, frame::MAX_FRAME,
};
use rigident_sim::serve::Port;
use serde_json::Value;

use super::{Served, text};

fn rigident(served: &Served, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_rigident"))
        .current_dir(served.folder.path())
        .args(arguments)
        .output()
        .unwrap()
}

fn good(output: &Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Returns what is said of a failure with this status.
fn refused(output: &Output, status: i32) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(status), "{said}");
    said
}

#[test]
fn settings_go_into_a_file_and_back_and_refused_ones_change_nothing() {
    let served = Served::new();
    let run = |arguments: &[&str]| rigident(&served, &[arguments, &["--port", "port"]].concat());
    let info = good(&run(&["info", "--json"]));
    assert_eq!((&info["state"], &info["same_messages"]), (&"idle".into(), &true.into()));
    assert!(refused(&run(&["configure"]), 2).contains("--rig FILE"));
    let dry = good(&run(&["configure", "--rig", "rig.toml", "--dry-run", "--json"]));
    assert_eq!(
        (&dry["sent"], good(&run(&["info", "--json"]))["state"].as_str()),
        (&false.into(), Some("idle"))
    );
    let sent = good(&run(&["configure", "--rig", "rig.toml", "--json"]));
    assert_eq!((&sent["sent"], &sent["settings"]), (&true.into(), &dry["settings"]));
    assert!(run(&["configure", "--write", "a.toml"]).status.success());
    assert!(refused(&run(&["configure", "--write", "a.toml"]), 2).contains("nothing is overwritten"));
    let again = good(&run(&["configure", "--from", "a.toml", "--json"]));
    assert_eq!((&again["changes"], &again["settings"]), (&Value::Array(Vec::new()), &sent["settings"]));
    // One number changed, then one that no device takes.
    let whole = text(&served.path("a.toml"));
    let line = whole.lines().find(|line| line.starts_with("row_every")).unwrap();
    std::fs::write(served.path("b.toml"), whole.replacen(line, "row_every = 12", 1)).unwrap();
    let changed = good(&run(&["configure", "--from", "b.toml", "--json"]));
    assert_eq!(
        (&changed["changes"][0]["key"], &changed["changes"][0]["to"]),
        (&"row_every".into(), &12.into())
    );
    std::fs::write(served.path("c.toml"), whole.replacen(line, "row_every = 0", 1)).unwrap();
    assert!(refused(&run(&["configure", "--from", "c.toml"]), 2).contains("nothing was changed"));
    assert_eq!(good(&run(&["configure", "--json"]))["settings"], changed["settings"]);
}

#[test]
fn the_only_device_is_found_by_itself_and_a_doctor_finds_it_well() {
    let served = Served::new();
    std::os::unix::fs::symlink(served.path("port"), served.path("rigident-rig")).unwrap();
    let ports = good(&rigident(&served, &["ports", "--json"]));
    let own = ports.as_array().unwrap().iter().find(|port| port["kind"] == "simulated").unwrap();
    assert_eq!((&own["answer"], own["device"]["board"].as_str()), (&"device".into(), Some("in-process")));
    let unasked = good(&rigident(&served, &["ports", "--no-hello", "--json"]));
    assert!(unasked.as_array().unwrap().iter().all(|port| port["answer"] == "not_asked"));
    let health = rigident(&served, &["doctor", "--json", "--port", "port"]);
    let health: Value = serde_json::from_slice(&health.stdout).unwrap();
    let of = |what: &str| {
        health["checks"].as_array().unwrap().iter().filter(|c| c["what"] == what).cloned().collect::<Vec<_>>()
    };
    assert_eq!(of("device")[0]["standing"], "ok", "{health}");
    assert!(of("clocks").iter().any(|check| check["found"].as_str().unwrap().contains("ppm")), "{health}");
    // A machine of a user has other ports too, and may have another device.
    if ports.as_array().unwrap().iter().filter(|port| port["answer"] == "device").count() == 1 {
        assert_eq!(good(&rigident(&served, &["info", "--json"]))["port"], "./rigident-rig");
    }
}

#[test]
fn a_device_is_watched_while_it_runs() {
    let served = Served::new();
    let monitored =
        rigident(&served, &["monitor", "--port", "port", "--rig", "rig.toml", "--start", "--once", "--json"]);
    let view = good(&monitored);
    // It hangs still: nothing is known of most, and there is no number of it.
    assert!(view["answer"]["readings"].as_u64().unwrap() > 0 && view["phase"] == "running", "{view}");
    let parameters = view["answer"]["parameters"].as_array().unwrap();
    assert!(parameters.iter().any(|parameter| parameter["now"].is_null()), "{view}");
}

/// Answers every frame by a hello of firmware with other messages.
fn other_firmware(port: &mut Port, leave: &AtomicBool) {
    let identity = Identity {
        protocol_version: PROTOCOL_VERSION,
        schema_hash: SCHEMA_HASH ^ 1,
        firmware_version: [9, 9, 9],
        firmware_hash: 1,
        board: *b"another\0\0\0\0\0\0\0\0\0",
        unique_id: [0; 12],
        state: StateName::Idle,
        reason: Reason::Boot,
        reset: ResetReason::PowerOn,
        ended: None,
        clock: ClockSource::Crystal,
        kept: Kept::default(),
    };
    let mut decoder = rigident_shared::wire::Decoder::new();
    let mut bytes = [0; 256];
    while !leave.load(Ordering::Acquire) {
        let count = port.read(&mut bytes, Duration::from_millis(20)).unwrap_or(0);
        for byte in &bytes[..count] {
            let Some(Ok(frame)) = decoder.push(*byte) else { continue };
            let (answer, mut out): (Answer, _) = (Ok(Reply::Hello(identity.clone())), [0; MAX_FRAME]);
            let length = encode(Kind::Answer, frame.sequence, &answer, &mut out).unwrap();
            port.write(&out[..length]).unwrap();
        }
    }
}

#[test]
fn firmware_built_from_other_definitions_is_named_with_advice() {
    let served = Served::new();
    let mut port = Port::open(Some(&served.path("other"))).unwrap();
    let leave = Arc::new(AtomicBool::new(false));
    let leaving = Arc::clone(&leave);
    let answering = std::thread::spawn(move || other_firmware(&mut port, &leaving));
    for command in [&["info"][..], &["configure"], &["monitor", "--once"]] {
        let said = refused(&rigident(&served, &[command, &["--port", "other"]].concat()), 3);
        assert!(said.contains("flash the firmware"), "{command:?}: {said}");
    }
    let health = rigident(&served, &["doctor", "--port", "other"]);
    let said = String::from_utf8_lossy(&health.stdout);
    assert!(health.status.code() == Some(1) && said.contains("flash the firmware"), "{said}");
    leave.store(true, Ordering::Release);
    answering.join().unwrap();
}
