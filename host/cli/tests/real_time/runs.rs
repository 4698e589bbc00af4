//! `rigident run` with a hexapod and with lines of set points.

use std::io::{BufRead, BufReader};
use std::process::{Command, Output, Stdio};
use std::sync::Arc;

use hexapod::experiment::thesis_program;
use hexapod::{Geometry, MotionProgram, Pose, Segment};
use nalgebra::{Quaternion, UnitQuaternion};
use rigident::plan::plan_file::PlanFile;
use rigident_sim::links::SecondLink;
use rigident_sim::rig::{MotionState, RigConfig};
use rigident_sim::serve::{Controller, StreamServer};

use super::{Served, rms_off_path, text};

fn run(served: &Served, more: &[&str]) -> Command {
    run_at(served, &served.address(), "out", more)
}

pub fn run_at(served: &Served, address: &str, out: &str, more: &[&str]) -> Command {
    run_of(served, "rig.toml", address, out, more)
}

fn run_of(served: &Served, rig: &str, address: &str, out: &str, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
    command
        .arg("run")
        .args(["--port".as_ref(), served.path("port").as_os_str()])
        .args(["--rig".as_ref(), served.path(rig).as_os_str()])
        .args(["--out".as_ref(), served.path(out).as_os_str()])
        .args(["--platform", address, "--warm-up-s", "0"])
        .args(more)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn without_a_yes_nothing_moves_and_the_limits_are_shown() {
    let served = Served::new();
    let home = served.rig.lock().unwrap().pose();
    let output = run(&served, &["--duration-s", "20"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    let said = said(&output);
    assert!(
        said.contains("nothing was moved") && said.contains("--yes") && said.contains("leg rate"),
        "{said}"
    );
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Holding);
    assert_eq!(served.rig.lock().unwrap().pose(), home);
    assert!(!served.path("out").exists());
}

#[test]
fn a_dry_run_does_everything_but_the_motion() {
    let served = Served::new();
    let home = served.rig.lock().unwrap().pose();
    for slow in [None, Some("0.1")] {
        let mut more = vec!["--duration-s", "20", "--dry-run"];
        more.extend(slow.iter().flat_map(|share| ["--slow", share]));
        let output = run(&served, &more).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
        let said = said(&output);
        let seconds = if slow.is_some() { "about to move for 20" } else { "about to move for 2" };
        for words in [
            "load guard ON",
            "motion guard ON",
            "in reserve",
            "assumed",
            "nothing was moved",
            seconds,
            "condition up to",
        ] {
            assert!(said.contains(words), "{words}\n{said}");
        }
        assert_eq!(said.contains("at 0.1 of the program's speed"), slow.is_some(), "{said}");
    }
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Holding);
    assert_eq!(served.rig.lock().unwrap().pose(), home);
    assert!(!served.path("out").exists());
    let output = run(&served, &["--yes", "--slow", "0"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
}

#[test]
fn a_run_that_is_stopped_on_the_way_to_its_start_leaves_a_trace() {
    let served = Served::new();
    let mut away = Geometry::thesis().home();
    away.position_m[2] += 0.05;
    served.rig.lock().unwrap().move_to(&away, 1.0).unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let mut child = run(&served, &["--duration-s", "20", "--yes"]).spawn().unwrap();
    let mut heard = BufReader::new(child.stderr.take().unwrap()).lines();
    for line in heard.by_ref() {
        if line.unwrap().starts_with("to the first pose") {
            break;
        }
    }
    let rest = std::thread::spawn(move || heard.map_while(Result::ok).collect::<Vec<_>>().join("\n"));
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let status = child.wait().unwrap();
    let said = rest.join().unwrap();
    assert_eq!(status.code(), Some(1), "{said}");
    assert_ne!(served.rig.lock().unwrap().motion(), MotionState::Moving, "{said}");
    assert!(said.contains("trace.jsonl"), "{said}");
    let trace = text(&served.path("out/trace.jsonl"));
    let lines: Vec<serde_json::Value> =
        trace.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.iter().find_map(|line| line.get("consent")).unwrap()["by"], "--yes");
    assert!(lines.iter().any(|line| line["shown"].as_str().is_some_and(|s| s.contains("load guard ON"))));
    assert!(lines.iter().any(|line| line["program"]["segments"].is_array()));
    assert!(lines.iter().any(|line| line["command"] == "HLT"), "{trace}");
    assert!(lines.iter().any(|line| line["reply"].is_string()));
}

/// Asked after the zero, and once more by a countdown.
#[cfg(unix)]
#[test]
fn a_key_in_the_countdown_after_the_yes_stops_it_and_nothing_is_moved() {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use std::io::{Read, Write};
    let served = Served::new();
    let home = served.rig.lock().unwrap().pose();
    let mut keyboard = std::fs::File::from(openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap());
    grantpt(&keyboard).unwrap();
    unlockpt(&keyboard).unwrap();
    let name = ptsname(&keyboard, Vec::new()).unwrap().into_string().unwrap();
    let terminal = std::fs::File::options().read(true).write(true).open(name).unwrap();
    let mut child = run(&served, &["--duration-s", "20"]).stdin(terminal).spawn().unwrap();
    let mut heard = child.stderr.take().unwrap();
    let mut said = String::new();
    let mut until = |words: &str| {
        let mut byte = [0];
        while !said.contains(words) {
            assert_eq!(heard.read(&mut byte).unwrap(), 1, "{said}");
            said.push(char::from(byte[0]));
        }
        said.clone()
    };
    let asked = until("shall it move [y/N]?");
    assert!(asked.contains("zero: mean wrench") && asked.contains("load guard ON"), "{asked}");
    // The question forgets what was typed before it; the terminal is read from right after.
    std::thread::sleep(std::time::Duration::from_millis(200));
    keyboard.write_all(b"y\n").unwrap();
    until("any key stops it");
    std::thread::sleep(std::time::Duration::from_millis(1500));
    keyboard.write_all(b" ").unwrap();
    until("stopped by a key in the countdown; nothing was moved");
    assert_eq!(child.wait().unwrap().code(), Some(1));
    assert_eq!(served.rig.lock().unwrap().pose(), home);
    assert_eq!(served.rig.lock().unwrap().motion(), MotionState::Holding);
    let trace = text(&served.path("out/trace.jsonl"));
    assert!(trace.contains("yes at the terminal") && !trace.contains("\"MOV"), "{trace}");
}

/// The pose at the end of a line of `motion.csv`.
fn measured(line: &str) -> Pose {
    let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
    let [x, y, z, w, i, j, k] = *cells.last_chunk().unwrap();
    let (roll, pitch, yaw) = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)).euler_angles();
    Pose { position_m: [x, y, z], rpy_rad: [roll, pitch, yaw] }
}

#[test]
fn a_run_on_a_hexapod_identifies_the_body_and_tells_how_the_platform_followed() {
    let served = Served::new();
    let output = run(&served, &["--duration-s", "20", "--yes", "--json"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["status"], "identified");
    let tracking = &result["tracking"];
    assert!(tracking["samples"].as_u64().unwrap() > 300, "{tracking}");
    assert!(tracking["delay_s"].is_number() && tracking["rms_without_delay_m"][2].is_number(), "{tracking}");
    let motion = text(&served.path("out/motion.csv"));
    let mut lines = motion.lines().skip_while(|line| line.starts_with('#'));
    let header = lines.next().unwrap();
    assert!(header.starts_with("t_s,cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw,"), "{header}");
    assert!(header.ends_with(",x_m,y_m,z_m,qw,qx,qy,qz"), "{header}");
    let poses: Vec<Pose> = lines.map(measured).collect();
    assert_eq!(poses.len() as u64, tracking["samples"].as_u64().unwrap());
    let program = thesis_program(&Geometry::thesis(), 20.0).trajectory().unwrap();
    let off = rms_off_path(&program, &poses);
    assert!(off < 1e-3, "{off} m off the path");
    assert!(text(&served.path("out/report.html")).contains("measured less commanded"));
    let recording = rigident::recording::Recording::load(&served.path("out/run.mcap"), None).unwrap();
    assert!(recording.recorded().unwrap().as_str() <= result["date"].as_str().unwrap());
}

#[test]
fn a_run_with_two_links_identifies_both_and_unsuitable_options_are_refused_before_anything_moves() {
    let second = SecondLink { with_program: true, ..SecondLink::arm() };
    let config = RigConfig::two_links().with_second(second);
    let served = Served::of(config.clone());
    let home = served.rig.lock().unwrap().pose();
    for (option, value) in [("--known", "mass_kg=3±0.1"), ("--until", "nose=0.1"), ("--estimate", "nose")] {
        let output = run(&served, &["--duration-s", "20", "--yes", option, value]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(said(&output).contains(option), "{}", said(&output));
    }
    let file = text(&served.path("rig.toml"));
    for (less, part) in [
        (file.replace("initial_wxyz", "rotation_wxyz"), "no initial_wxyz"),
        (file.replace("\"spherical\"", "\"fixed\""), "spherical joint"),
        (file.replace("link = 1", "link = 7"), "link = 7: the [[link]] tables are links 0 to 1"),
    ] {
        std::fs::write(served.path("less.toml"), less).unwrap();
        let output = run_of(&served, "less.toml", &served.address(), "out", &["--yes"]).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(said(&output).contains(part), "{}", said(&output));
    }
    assert_eq!(served.rig.lock().unwrap().pose(), home);
    // Its program is driven as a whole, and the arm with it.
    let controller = Controller::listen("127.0.0.1:0", Arc::clone(&served.rig)).unwrap();
    let address = format!("tcp://{}", controller.address());
    let mut command = run_at(&served, &address, "out", &["--duration-s", "20", "--yes", "--json"]);
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&result["status"], &result["source"]["mcu"]), (&"identified".into(), &"port".into()));
    assert!(result["tracking"]["samples"].as_u64().unwrap() > 100);
    let offset = served.rig.lock().unwrap().truth().apparent_offset_n_nm;
    let truth: Vec<f64> = second.base_parameters(&config.body).into_iter().chain(offset).collect();
    let found = result["parameters"].as_array().unwrap();
    assert_eq!(found.len(), truth.len());
    for (p, truth) in found.iter().zip(truth) {
        // Once in a hundred thousand of a normal number.
        let sd = p["u95"].as_f64().unwrap() / 1.96;
        assert!((p["value"].as_f64().unwrap() - truth).abs() < 4.5 * sd, "{p} {truth}");
    }
}

#[test]
fn a_run_that_decides_for_itself_ends_when_the_tensor_is_known() {
    let served = Served::new();
    let output = run(&served, &["--adaptive", "--yes", "--json"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["status"], "identified");
    let u95 = |j: usize| result["parameters"][j]["u95"].as_f64().unwrap();
    // A hundredth of 0.381 kg m², and the answer's own allowance for noise beyond that stated.
    assert!((4..10).all(|j| u95(j) < 1.15 * 0.00381), "{}", result["parameters"]);
    // The default experiment takes a minute.
    let rows = result["source"]["rows"].as_u64().unwrap();
    assert!(rows < 20_000, "{rows}");
    let page = text(&served.path("out/report.html"));
    assert!(page.contains("<h2>Decisions</h2>") && page.contains("measured less commanded"));
    let tracking = &result["tracking"];
    assert!(tracking["samples"].as_u64().unwrap() > 20, "{tracking}");
    assert!(tracking["rms_without_delay_m"][2].is_number(), "{tracking}");
    assert_ne!(served.rig.lock().unwrap().motion(), MotionState::Moving);
}

#[test]
fn ctrl_c_and_sigterm_stop_the_platform_and_keep_the_recording() {
    for signal in ["-INT", "-TERM"] {
        interrupted_by(signal);
    }
}

fn interrupted_by(signal: &str) {
    let served = Served::new();
    let mut child = run(&served, &["--duration-s", "60", "--yes"]).spawn().unwrap();
    let mut heard = BufReader::new(child.stderr.take().unwrap()).lines();
    for line in heard.by_ref() {
        if line.unwrap().starts_with("the experiment takes") {
            break;
        }
    }
    let rest = std::thread::spawn(move || heard.map_while(Result::ok).collect::<Vec<_>>().join("\n"));
    std::thread::sleep(std::time::Duration::from_secs(8));
    let killed = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let status = child.wait().unwrap();
    let said = rest.join().unwrap();
    assert_ne!(served.rig.lock().unwrap().motion(), MotionState::Moving, "{said}");
    assert_eq!(status.code(), Some(1), "{status}: {said}");
    assert!(text(&served.path("out/motion.csv")).lines().count() > 50);
    assert!(served.path("out/run.mcap").metadata().unwrap().len() > 10_000);
    let result: serde_json::Value = serde_json::from_str(&text(&served.path("out/result.json"))).unwrap();
    assert!(result["warnings"].to_string().contains("Ctrl-C"), "{result}");
}

/// Progress is shown every five seconds where standard error is no terminal.
#[test]
fn a_terminal_that_takes_nothing_any_more_holds_back_neither_guards_nor_ctrl_c() {
    use std::io::{Read, Write};
    use std::time::{Duration, Instant};
    let served = Served::new();
    let (reader, writer) = std::io::pipe().unwrap();
    let mut filler = writer.try_clone().unwrap();
    let mut child = run(&served, &["--duration-s", "60", "--yes"]).stderr(writer).spawn().unwrap();
    let mut heard = BufReader::new(reader);
    let mut line = String::new();
    while !line.starts_with("the experiment takes") {
        line.clear();
        assert!(heard.read_line(&mut line).unwrap() > 0, "it ended");
    }
    // More than a pipe holds: it stays full until somebody reads.
    let filling = std::thread::spawn(move || filler.write_all(&vec![b'#'; 1 << 20]));
    std::thread::sleep(Duration::from_secs(10));
    assert_eq!(
        served.rig.lock().unwrap().motion(),
        MotionState::Moving,
        "it was stopped for want of a watch"
    );
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let stopped = Instant::now();
    assert!(killed.success());
    while served.rig.lock().unwrap().motion() == MotionState::Moving {
        assert!(stopped.elapsed() < Duration::from_millis(1500), "Ctrl-C was not heard");
        std::thread::sleep(Duration::from_millis(5));
    }
    let mut rest = Vec::new();
    heard.read_to_end(&mut rest).unwrap();
    filling.join().unwrap().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1), "{}", String::from_utf8_lossy(&rest));
    assert!(served.path("out/run.mcap").metadata().unwrap().len() > 10_000);
}

/// A body that is much longer than its weight tells, on a load cell for small moments.
#[test]
fn a_motion_is_ended_before_it_overloads_the_load_cell() {
    let mut config = RigConfig::thesis_horizontal();
    config.body.com_m = [0.0; 3];
    config.body.inertia_com_kgm2 = [2.5, 2.5, 2.5, 0.0, 0.0, 0.0];
    let range = &mut config.sensors.load_cell.range_n_nm;
    range[3..].fill(8.0);
    let served = Served::of(config);
    let output = run(&served, &["--duration-s", "20", "--yes", "--json"]).output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", said(&output));
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let error = result["error"].as_str().unwrap();
    assert!(error.contains("the load cell's M") && error.contains("of 8.0 N m"), "{error}");
    assert!(error.contains("The platform is at rest."), "{error}");
    assert_ne!(served.rig.lock().unwrap().motion(), MotionState::Moving);
    assert!(served.path("out/run.mcap").metadata().unwrap().len() > 10_000);
}

/// A program that is stopped for longer than the device waits for it: the device stops absorbing, the hexapod
/// moves on.
#[test]
fn a_host_that_stalls_in_mid_run_is_reported_and_later_readings_are_taken_in() {
    let served = Served::new();
    // A controller that has the whole program drives on without us.
    let controller = Controller::listen("127.0.0.1:0", Arc::clone(&served.rig)).unwrap();
    let address = format!("tcp://{}", controller.address());
    let mut child = run_at(&served, &address, "out", &["--duration-s", "30", "--yes"]).spawn().unwrap();
    let mut heard = BufReader::new(child.stderr.take().unwrap()).lines();
    for line in heard.by_ref() {
        if line.unwrap().starts_with("the experiment takes") {
            break;
        }
    }
    let rest = std::thread::spawn(move || heard.map_while(Result::ok).collect::<Vec<_>>().join("\n"));
    let signal = |name: &str| {
        let killed = Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
        assert!(killed.success());
    };
    std::thread::sleep(std::time::Duration::from_secs(8));
    signal("-STOP");
    std::thread::sleep(std::time::Duration::from_secs(4));
    signal("-CONT");
    let status = child.wait().unwrap();
    let said = rest.join().unwrap();
    let result: serde_json::Value = serde_json::from_str(&text(&served.path("out/result.json"))).unwrap();
    let rows = result["source"]["rows"].as_u64().unwrap();
    assert_eq!(status.code(), Some(3), "{status}: {said}");
    let error = result["error"].as_str().unwrap();
    assert_eq!(result["status"], "failed", "{result}");
    // The controller, the device, or the device that was started again: whichever noticed.
    let named = ["was it not heard from here", "the host was too busy", "did not hear this program"];
    assert!(named.iter().any(|words| error.contains(words)) && rows > 5_000, "{rows} rows: {error}\n{said}");
}

/// A controller that takes every line and moves nothing.
#[test]
fn a_stream_that_nobody_follows_ends_the_run_in_words_within_half_a_second_of_motion() {
    let served = Served::new();
    let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("pose+tcp://{}", server.local_addr().unwrap());
    let swallowing = std::thread::spawn(move || {
        let (mut stream, _) = server.accept().unwrap();
        std::io::copy(&mut stream, &mut std::io::sink()).unwrap()
    });
    let output =
        run_at(&served, &address, "out", &["--duration-s", "20", "--yes", "--json"]).output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", said(&output));
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let error = result["error"].as_str().unwrap();
    assert!(error.contains("is commanded to move, and for 0.25 s after the IMU shows none of it"), "{error}");
    // It holds for 0.3 s, and moves gently at first.
    let moved_s =
        error.split("t = ").nth(1).and_then(|t| t.split(' ').next()).unwrap().parse::<f64>().unwrap();
    assert!(moved_s < 1.5, "{error}");
    assert!(swallowing.join().unwrap() > 1000);
    assert!(served.path("out/run.mcap").exists());
}

#[test]
fn a_controller_lost_in_mid_run_ends_it_with_the_command_named_and_the_recording_kept() {
    let mut served = Served::new();
    let mut child = run(&served, &["--duration-s", "60", "--yes"]).spawn().unwrap();
    let mut heard = BufReader::new(child.stderr.take().unwrap()).lines();
    for line in heard.by_ref() {
        if line.unwrap().starts_with("the experiment takes") {
            break;
        }
    }
    let rest = std::thread::spawn(move || heard.map_while(Result::ok).collect::<Vec<_>>().join("\n"));
    std::thread::sleep(std::time::Duration::from_secs(6));
    drop(served.hexapod.take());
    let status = child.wait().unwrap();
    let said = rest.join().unwrap();
    assert_eq!(status.code(), Some(3), "{said}");
    assert!(said.contains("was lost at the command") && said.contains("emergency stop"), "{said}");
    assert!(served.path("out/run.mcap").metadata().unwrap().len() > 10_000);
    assert!(text(&served.path("out/motion.csv")).lines().count() > 50);
    assert!(served.path("out/report.html").exists());
}

#[test]
fn a_stream_begins_at_home_ends_there_and_is_not_begun_from_elsewhere() {
    let served = Served::new();
    let server = StreamServer::listen("127.0.0.1:0", Arc::clone(&served.rig), |_| {}).unwrap();
    let geometry = Geometry::thesis();
    let mut leaning = geometry.home();
    leaning.rpy_rad[0] = 0.4;
    let segments = vec![Segment::Move { to: leaning, duration_s: 3.0 }, Segment::Hold { duration_s: 1.0 }];
    let program = MotionProgram { start: geometry.home(), segments };
    let plan = served.path("plan.json");
    PlanFile::new("leaning".to_owned(), &geometry, program).write(&plan).unwrap();
    let address = format!("pose+tcp://{}?lead_s=1", server.address());
    let more = ["--yes", "--plan", plan.to_str().unwrap()];
    let output = run_at(&served, &address, "out", &more).output().unwrap();
    // A lean says something of the body, if not everything.
    assert!(matches!(output.status.code(), Some(0 | 1)), "{}", said(&output));
    assert!(
        said(&output).contains("it begins at home: the plate must be there now, x 0.0"),
        "{}",
        said(&output)
    );
    let rest = served.rig.lock().unwrap().pose();
    assert!(rest.rpy_rad[0].abs() < 1e-6, "{rest:?}");

    served.rig.lock().unwrap().move_to(&leaning, 1.0).unwrap();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let output = run_at(&served, &address, "other", &more).output().unwrap();
    assert_eq!(output.status.code(), Some(3), "{}", said(&output));
    assert!(said(&output).contains("tilted by 23 degrees"), "{}", said(&output));
    assert_eq!(served.rig.lock().unwrap().pose().rpy_rad[0], 0.4);
    assert!(!served.path("other").exists());
}

#[test]
fn a_machine_that_the_rig_file_does_not_describe_is_not_taken_for_the_built_in_one() {
    let served = Served::new();
    let rig = text(&served.path("rig.toml"));
    let (before, rest) = rig.split_once("[platform]").unwrap();
    let (_, cell) = rest.split_once("[platform.load_cell]").unwrap();
    std::fs::write(served.path("rig.toml"), format!("{before}[platform.load_cell]{cell}")).unwrap();
    let output = run(&served, &["--yes"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(
        said(&output).contains("base_joints_m") && said(&output).contains("Nothing was moved"),
        "{}",
        said(&output)
    );
}

/// The simulated controller has its legs' limits all the same: the motion inside the travel keeps them.
#[test]
fn a_machine_without_joints_is_driven_inside_its_travel_and_the_checks_left_out_are_reported() {
    let served = Served::new();
    let rig = text(&served.path("rig.toml"));
    let of_legs = ["base_joints_m", "plate_joints_m", "leg_length_m", "leg_rate_mps", "cond_max"]
        .map(|key| format!("{key} ="));
    let kept = rig.lines().filter(|line| !of_legs.iter().any(|key| line.starts_with(key.as_str())));
    let lines: Vec<&str> = kept.collect();
    let travel =
        "[platform]\ntravel_m = [0.2, 0.2, 0.12]\ntravel_rad = [0.45, 0.45, 0.6]\nplate_speed_mps = 0.4";
    std::fs::write(served.path("rig.toml"), lines.join("\n").replacen("[platform]", travel, 1)).unwrap();
    let plan = Command::new(env!("CARGO_BIN_EXE_rigident"))
        .args(["plan", "motion", "--body", "horizontal", "--duration-s", "20", "--no-poses"])
        .args(["--rig".as_ref(), served.path("rig.toml").as_os_str()])
        .args(["--out".as_ref(), served.path("plan.json").as_os_str()])
        .output()
        .unwrap();
    assert!(plan.status.success() && said(&plan).contains("NOT checked"), "{}", said(&plan));
    let path = served.path("plan.json");
    let output = run(&served, &["--plan", path.to_str().unwrap(), "--yes", "--json"]).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    for words in ["of all axes together", "of 0.400 m/s", "singular poses, collisions"] {
        assert!(said(&output).contains(words), "{words}\n{}", said(&output));
    }
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["status"], "identified");
    let motion = text(&served.path("out/motion.csv"));
    let poses: Vec<Pose> =
        motion.lines().skip_while(|line| line.starts_with('#')).skip(1).map(measured).collect();
    let geometry =
        rigident::plan::machine::geometry(&rigident::rig::RigFile::load(&served.path("rig.toml")).unwrap());
    let planned = PlanFile::read(&path, &geometry.unwrap()).unwrap().program.trajectory().unwrap();
    let off = rms_off_path(&planned, &poses);
    assert!(poses.len() > 300 && off < 1e-3, "{off} m off the path");
}
