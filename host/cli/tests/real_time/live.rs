//! `rigident live` with simulated sensors of other makes, in real time: what they carry, what is lost, what
//! goes wrong.

use std::io::Write;
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Instant;

use hexapod::{MotionProgram, Segment};
use rigident_sim::rig::RigConfig;
use rigident_sim::serve::sensors::{
    AtiServer, BridgeServer, Delivery, LinesServer, Played, Quantity, RtdeServer, Topic, TopicKind,
    XsensServer, body_moved, sensors_rig_file,
};
use serde_json::Value;
use tempfile::TempDir;

use super::runs::said;
use super::{python, text};

const BOTH: &[&str] = &["foxglove.sdk.v1", "foxglove.websocket.v1"];

/// A body that moves for this long, and a folder.
struct Scene {
    folder: TempDir,
    moved: (RigConfig, MotionProgram),
    begun: Instant,
}

impl Scene {
    fn new(duration_s: f64, more: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let moved = body_moved(duration_s, 3);
        std::fs::write(folder.path().join("hand.rig.toml"), sensors_rig_file(&moved.0, more)).unwrap();
        Self { folder, moved, begun: Instant::now() }
    }

    fn played(&self, clock: (f64, f64, f64), delivery: Delivery) -> Played {
        Played::new(&self.moved, clock, delivery, self.begun).unwrap()
    }

    fn live(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rigident"));
        command
            .arg("live")
            .args(["--rig".as_ref(), self.folder.path().join("hand.rig.toml").as_os_str()])
            .args(["--out".as_ref(), self.folder.path().join("out").as_os_str()])
            .args(arguments)
            .current_dir(self.folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Runs it to its end, and returns the result that it printed.
    fn answer(&self, arguments: &[&str]) -> Value {
        let output = self.live(&[arguments, &["--json"]].concat()).output().unwrap();
        assert!(matches!(output.status.code(), Some(0 | 1)), "{:?}\n{}", output.status, said(&output));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    fn file(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join("out").join(name)
    }
}

/// Holds what is identified against the body that was played. Of ten 95 % intervals one run in a hundred has
/// more than two without the truth; three times the interval holds it always.
fn check_truth(result: &Value, least: usize) {
    let (mut identified, mut outside) = (0, 0);
    for found in result["parameters"].as_array().unwrap() {
        let numbers = ["value", "u95", "truth"].map(|key| found[key].as_f64());
        let [Some(value), Some(u95), Some(truth)] = numbers else { continue };
        identified += 1;
        outside += usize::from((value - truth).abs() > u95);
        assert!((value - truth).abs() < 3.0 * u95, "{found}");
    }
    assert!(identified >= least && outside <= 2, "{identified} identified, {outside} outside: {result}");
}

fn warnings(result: &Value) -> String {
    result["warnings"].to_string()
}

#[test]
fn a_force_sensor_and_an_imu_on_clocks_of_their_own_identify_the_body_and_losses_are_reported() {
    let scene = Scene::new(16.0, "\n[recording]\nwrench_sign = \"on_sensor\"\n");
    let lossy = Delivery { lose: 0.02, jitter_s: 0.003, ..Delivery::default() };
    let ati = AtiServer::listen("127.0.0.1:0", scene.played((500.0, 80e-6, 0.0), lossy)).unwrap();
    let late = Delivery { jitter_s: 0.002, ..Delivery::default() };
    let mti = XsensServer::open(None, scene.played((200.0, -60e-6, 77.0), late)).unwrap();
    let imu = format!("xsens://{}", mti.terminal().display());
    let result = scene.answer(&["--wrench", &ati.url(), "--imu", &imu, "--at-most-s", "15"]);
    check_truth(&result, 4);
    let said = warnings(&result);
    assert!(
        said.contains("samples never came, by their sequence numbers") || said.contains("never came"),
        "{said}"
    );
    // A fiftieth of them: "N samples of M never came"; within five standard deviations of 8 000 throws.
    let words: Vec<&str> = said.split(" never came").next().unwrap().rsplit(' ').take(4).collect();
    let [all, _, _, lost] = words[..] else { panic!("{said}") };
    let [lost, all] = [lost, all].map(|n| n.parse::<f64>().unwrap());
    assert!(all > 6000.0 && (lost / all - 0.02).abs() < 5.0 * (0.02 / all).sqrt(), "{lost} of {all}");
    // Rates of both clocks, by arrivals up to 3 ms late over 15 s.
    let listing = text(&scene.file("streams.rig.toml"));
    let rates: Vec<f64> =
        listing.lines().filter_map(|line| line.strip_prefix("clock_rate = ")?.parse().ok()).collect();
    assert_eq!(rates.len(), 2, "{listing}");
    assert!(
        rates.iter().zip([-80e-6, 60e-6]).all(|(rate, off)| (rate - 1.0 - off).abs() < 1e-4),
        "{rates:?}"
    );
    // What was recorded is whole, and says the same again; its folder represents it.
    for (command, file) in [("identify", "streams.rig.toml"), ("identify", "."), ("replay", ".")] {
        let again = Command::new(env!("CARGO_BIN_EXE_rigident"))
            .args([command.as_ref(), scene.file(file).as_os_str(), "--json".as_ref()])
            .current_dir(scene.folder.path())
            .output()
            .unwrap();
        let again: Value = serde_json::from_slice(&again.stdout).unwrap_or_else(|e| panic!("{command}: {e}"));
        if command == "identify" {
            assert_eq!(again["parameters"], result["parameters"]);
        } else {
            assert!(again["parameters"][0]["value"].is_number(), "{again}");
        }
    }
}

#[test]
fn a_robot_alone_identifies_the_load_on_its_flange() {
    let scene = Scene::new(16.0, "\n[recording]\nwrench_sign = \"on_sensor\"\n");
    let late = Delivery { jitter_s: 0.001, ..Delivery::default() };
    let robot = RtdeServer::listen("127.0.0.1:0", scene.played((500.0, 20e-6, 5000.0), late)).unwrap();
    let url = format!("rtde://{}", robot.address());
    let result = scene.answer(&["--wrench", &url, "--imu", &url, "--at-most-s", "15"]);
    check_truth(&result, 4);
    let carries = &result["time_base"]["streams"][0]["carries"];
    assert_eq!(*carries, serde_json::json!(["wrench", "accelerometer", "attitude"]), "{result}");
    std::fs::remove_dir_all(scene.folder.path().join("out")).unwrap();
    let refused = scene.live(&["--wrench", &format!("{url}?wrench=actual_TCP_force")]).output().unwrap();
    assert_eq!(refused.status.code(), Some(2));
    assert!(said(&refused).contains("zeroed by the controller"), "{}", said(&refused));
}

#[test]
fn a_robot_that_stands_still_is_advised_to_move_and_its_gyro_is_not_called_dead() {
    let mut scene = Scene::new(1.0, "\n[recording]\nwrench_sign = \"on_sensor\"\n");
    // Its poses have no noise, and are the same to the last digit.
    scene.moved.1.segments = vec![Segment::Hold { duration_s: 1.0 }];
    let played = scene.played((500.0, 0.0, 5000.0), Delivery::default());
    let robot = RtdeServer::listen("127.0.0.1:0", played).unwrap();
    let url = format!("rtde://{}", robot.address());
    let output =
        scene.live(&["--wrench", &url, "--imu", &url, "--at-most-s", "3", "--json"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    check_truth(&result, 0);
    assert!(!result["advice"].as_array().unwrap().is_empty(), "{result}");
}

/// A bridge with wrench, IMU and pose; the IMU's stamps begin at `imu_zero_s`.
fn bridge(
    scene: &Scene,
    imu_zero_s: f64,
    delivery: Delivery,
    subprotocols: &'static [&'static str],
) -> BridgeServer {
    let topic = |name: &str, kind, rate_hz, zero_s| Topic {
        name: name.to_owned(),
        kind,
        played: scene.played((rate_hz, 0.0, zero_s), delivery),
    };
    let topics = vec![
        topic("/ft/wrench", TopicKind::Wrench, 250.0, 1.75e9),
        topic("/imu/data", TopicKind::Imu, 200.0, imu_zero_s),
        topic("/pose", TopicKind::Pose, 100.0, 1.75e9),
    ];
    BridgeServer::listen("127.0.0.1:0", topics, subprotocols).unwrap()
}

#[test]
fn topics_of_a_bridge_share_their_clock_and_identify_the_body_by_either_protocol() {
    for subprotocols in [&["foxglove.sdk.v1"][..], &["foxglove.websocket.v1"]] {
        let scene = Scene::new(15.0, "");
        let late = Delivery { jitter_s: 0.004, ..Delivery::default() };
        let bridge = bridge(&scene, 1.75e9, late, subprotocols);
        let url = |topic: &str| format!("ws://{}?topic={topic}", bridge.address());
        // The second has no need of a name: there is one IMU only.
        let imu = format!("ws://{}", bridge.address());
        let result = scene.answer(&["--wrench", &url("/ft/wrench"), "--imu", &imu, "--at-most-s", "13"]);
        check_truth(&result, 4);
        // One line for both: their stamps are of one clock.
        let listing = text(&scene.file("streams.rig.toml"));
        let offsets: Vec<&str> = listing.lines().filter(|line| line.starts_with("clock_offset_s")).collect();
        assert!(offsets.len() == 2 && offsets[0] == offsets[1], "{listing}");
    }
}

#[test]
fn lines_over_udp_identify_the_body() {
    let scene = Scene::new(15.0, "");
    let at = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let played = scene.played((250.0, 10e-6, 12.0), Delivery::default());
    let _lines = LinesServer::to_udp(at, Quantity::Both, played.clone()).unwrap();
    let url = format!("udp://{at}");
    let result = scene.answer(&["--wrench", &url, "--imu", &url, "--at-most-s", "13"]);
    check_truth(&result, 4);
}

#[test]
fn a_pose_takes_the_gyros_place_beside_an_accelerometer() {
    let scene = Scene::new(15.0, "");
    let bridge = bridge(&scene, 1.75e9, Delivery { jitter_s: 0.002, ..Delivery::default() }, BOTH);
    let [wrench, pose] =
        ["/ft/wrench", "/pose"].map(|topic| format!("ws://{}?topic={topic}", bridge.address()));
    // Without an accelerometer it is refused before anything is recorded.
    let refused = scene.live(&["--wrench", &wrench, "--pose", &pose]).output().unwrap();
    failed(&scene, &refused, 2, &["no accelerometer", "--imu", "Nothing was recorded"], false);
    let at = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    let played = scene.played((200.0, 10e-6, 12.0), Delivery::default());
    let _lines = LinesServer::start(None, Quantity::Imu, played, move |line| {
        // Number, time and accelerometer; no gyro.
        let cells: Vec<&str> = line.trim_end().split(',').take(5).collect();
        let _ = sender.send_to((cells.join(",") + "\n").as_bytes(), at);
        true
    });
    let imu = format!("udp://{at}");
    let result = scene.answer(&["--wrench", &wrench, "--imu", &imu, "--pose", &pose, "--at-most-s", "13"]);
    check_truth(&result, 4);
}

#[test]
fn lines_on_a_serial_port_identify_the_body() {
    let scene = Scene::new(15.0, "");
    let played = scene.played((250.0, 10e-6, 12.0), Delivery::default());
    let lines = LinesServer::on_port(None, Quantity::Both, played).unwrap();
    let url = format!("serial:{}", lines.terminal().unwrap().display());
    let result = scene.answer(&["--wrench", &url, "--imu", &url, "--at-most-s", "13"]);
    check_truth(&result, 4);
}

#[test]
fn lines_through_a_pipe_end_with_it_and_with_an_answer() {
    let scene = Scene::new(15.0, "");
    let mut live =
        scene.live(&["--wrench", "-", "--imu", "-", "--json"]).stdin(Stdio::piped()).spawn().unwrap();
    let mut input = live.stdin.take().unwrap();
    let played = scene.played((250.0, 0.0, 12.0), Delivery::default());
    let until = 16 * 250;
    let (ended, over) = std::sync::mpsc::channel();
    let sending = LinesServer::start(None, Quantity::Both, played, move |line| {
        let number = line.split(',').next().and_then(|n| n.parse::<u64>().ok());
        let goes_on = number.is_none_or(|n| n < until) && input.write_all(line.as_bytes()).is_ok();
        if !goes_on {
            let _ = ended.send(());
        }
        goes_on
    });
    over.recv().unwrap();
    // The pipe closes with its sender.
    drop(sending);
    let output = live.wait_with_output().unwrap();
    assert!(matches!(output.status.code(), Some(0 | 1)), "{}", said(&output));
    check_truth(&serde_json::from_slice(&output.stdout).unwrap(), 4);
}

/// Checks what a run that went wrong said, and that it left nothing half.
fn failed(scene: &Scene, output: &Output, status: i32, words: &[&str], kept: bool) {
    let said = said(output);
    assert_eq!(output.status.code(), Some(status), "{said}");
    words.iter().for_each(|word| assert!(said.contains(word), "{word:?} is not in {said}"));
    assert_eq!(scene.file("streams.rig.toml").is_file(), kept, "{said}");
    if kept {
        let listing = text(&scene.file("streams.rig.toml"));
        let files =
            listing.lines().filter_map(|line| line.strip_prefix("file = ")).map(|f| f.trim_matches('"'));
        for file in files {
            let rows = text(&scene.file(file)).lines().filter(|line| !line.starts_with('#')).count();
            assert!(rows > 100, "{file}: {rows} rows");
        }
    }
}

#[test]
fn unusable_streams_are_refused_before_anything_is_recorded() {
    let scene = Scene::new(12.0, "");
    let ports = [0; 2].map(|_| UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap());
    let played = || scene.played((250.0, 0.0, 12.0), Delivery::default());
    let _lines = ports.map(|at| LinesServer::to_udp(at, Quantity::Both, played()).unwrap());
    let [one, other] = ports.map(|at| format!("udp://{at}"));
    let refused = |arguments: &[&str], words: &[&str]| {
        failed(&scene, &scene.live(arguments).output().unwrap(), 2, words, false);
        assert!(!scene.folder.path().join("out").exists());
    };
    refused(&["--wrench", &one, "--imu", &other], &["both bring fx_n", "?columns=", "Nothing was recorded"]);
    refused(
        &["--wrench", &one, "--imu", &one, "--pose", &one],
        &["the pose is to come from here, and it brings"],
    );
    refused(&["--wrench", &one, "--imu", &one, "--until", "q=1"], &["--until q=1", "there are m, mc"]);
    let strange = format!("{one}?columns=a,b,c,d,e,f,g,h,i,j,k,l,m,n");
    refused(&["--wrench", &strange, "--imu", &strange], &["its columns a, b, c", "?columns="]);
}

#[test]
fn a_source_that_stops_ends_the_run_in_words_and_with_the_earlier_readings() {
    let scene = Scene::new(12.0, "");
    let at = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let stops = Delivery { stops_after_s: Some(11.0), ..Delivery::default() };
    let _lines = LinesServer::to_udp(at, Quantity::Both, scene.played((250.0, 0.0, 12.0), stops)).unwrap();
    let url = format!("udp://{at}");
    let output = scene.live(&["--wrench", &url, "--imu", &url]).output().unwrap();
    failed(&scene, &output, 3, &["has sent nothing for 2 s", "firewall", "What came before is in"], true);
    let result: Value = serde_json::from_str(&text(&scene.file("result.json"))).unwrap();
    assert!(result["status"] == "failed" && result["error"].as_str().unwrap().contains("2 s"), "{result}");
    check_truth(&result, 1);
    let recording = scene.file("live.mcap");
    let read = rigident::recording::Recording::load(Path::new(&recording), None).unwrap();
    assert!(read.rows() > 500 && read.warnings.is_empty(), "{} {:?}", read.rows(), read.warnings);
}

#[test]
fn a_bridge_without_the_topic_or_with_another_type_names_its_topics() {
    let scene = Scene::new(10.0, "");
    let bridge = bridge(&scene, 1.75e9, Delivery::default(), BOTH);
    let url = |topic: &str| format!("ws://{}?topic={topic}", bridge.address());
    let ask = |wrench: &str| scene.live(&["--wrench", wrench]).output().unwrap();
    let there = ["the bridge has no topic /wrench", "/ft/wrench", "Nothing was recorded"];
    failed(&scene, &ask(&url("/wrench")), 3, &there, false);
    let other = [
        "/imu/data is of sensor_msgs/msg/Imu",
        "--wrench needs geometry_msgs/msg/WrenchStamped",
        "/ft/wrench",
    ];
    failed(&scene, &ask(&url("/imu/data")), 3, &other, false);
    // Nobody, or somebody else.
    failed(&scene, &ask("ws://127.0.0.1:9"), 3, &["cannot be reached", "foxglove_bridge"], false);
    failed(
        &scene,
        &ask("ati+udp://127.0.0.1?http_port=9&tcp_port=9"),
        3,
        &["?cpf=1000000&cpt=1000000"],
        false,
    );
    failed(&scene, &ask("xsens:///dev/no-such-line"), 2, &["--imu alone"], false);
    let unread = scene
        .live(&["--wrench", "udp://127.0.0.1:47911", "--imu", "xsens:///dev/no-such-line"])
        .output()
        .unwrap();
    failed(&scene, &unread, 3, &["udp://127.0.0.1:47911", "within 3 s"], false);
    let two =
        scene.live(&["--wrench", "serial:/dev/a?baud=9600", "--imu", "serial:/dev/a"]).output().unwrap();
    failed(&scene, &two, 2, &["are one line with two settings", "the same address for both"], false);
}

#[test]
fn stamps_that_are_not_of_one_clock_are_reported_and_the_readings_are_kept() {
    let scene = Scene::new(10.0, "");
    // The IMU's driver stamps by the device's own time since it was switched on.
    let bridge = bridge(&scene, 312.0, Delivery::default(), BOTH);
    let url = |topic: &str, more: &str| format!("ws://{}?topic={topic}{more}", bridge.address());
    let (wrench, imu) = (url("/ft/wrench", ""), url("/imu/data", ""));
    let output = scene.live(&["--wrench", &wrench, "--imu", &imu]).output().unwrap();
    failed(
        &scene,
        &output,
        2,
        &["stamped by one clock", "?stamp=bridge", "?clock=own", "recorded is in"],
        true,
    );
    // As it says.
    std::fs::remove_dir_all(scene.folder.path().join("out")).unwrap();
    let result =
        scene.answer(&["--wrench", &wrench, "--imu", &url("/imu/data", "&clock=own"), "--at-most-s", "6"]);
    assert!(!result["time_base"]["streams"].as_array().unwrap().is_empty());
}

#[test]
fn impossible_units_are_reported_and_the_readings_are_kept() {
    let scene = Scene::new(12.0, "");
    let at = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let in_g = Delivery { scale: 1.0 / 9.80665, ..Delivery::default() };
    let _lines = LinesServer::to_udp(at, Quantity::Both, scene.played((250.0, 0.0, 12.0), in_g)).unwrap();
    let url = format!("udp://{at}");
    let output = scene.live(&["--wrench", &url, "--imu", &url, "--at-most-s", "8"]).output().unwrap();
    failed(&scene, &output, 2, &["gravity", "scale", "recorded is in"], true);
    // A time in milliseconds.
    let scene = Scene::new(12.0, "");
    let at = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let played = scene.played((250.0, 0.0, 12.0), Delivery::default());
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    let _lines = LinesServer::start(None, Quantity::Both, played, move |line| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if let Ok(seconds) = cells[1].parse::<f64>() {
            cells[1] = format!("{:.3}", 1e3 * seconds);
        }
        let _ = sender.send_to(cells.join(",").as_bytes(), at);
        true
    });
    let url = format!("udp://{at}");
    let output = scene.live(&["--wrench", &url, "--imu", &url]).output().unwrap();
    failed(&scene, &output, 2, &["its time counts milliseconds", "scale = 1e-3"], true);
}

/// Returns what a program of another maker says.
fn said_by_others(arguments: &[&str]) -> Vec<Vec<f64>> {
    let python = python();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/real_time/sensors_clients.py");
    let out = Command::new(python).arg(script).args(arguments).output().unwrap();
    assert!(out.status.success(), "{}", said(&out));
    let lines = String::from_utf8(out.stdout).unwrap();
    lines.lines().map(|line| line.split(' ').map(|n| n.parse().unwrap()).collect()).collect()
}

#[test]
#[ignore = "needs NetFT and ur_rtde in Python"]
fn independent_sensors_clients_of_other_makers_read_the_simulated_devices() {
    let scene = Scene::new(12.0, "");
    let played = scene.played((500.0, 0.0, 5000.0), Delivery::default());
    let ati = AtiServer::listen("127.0.0.1:0", played.clone()).unwrap();
    let port = ati.address().port().to_string();
    let counts = said_by_others(&["netft", "127.0.0.1", &port]);
    assert_eq!(counts.len(), 5);
    // Each is a sample that was played, in counts, as the reaction.
    let sample = |k: u64| played.sample(k);
    for read in counts {
        let near = |k: u64| sample(k).wrench.iter().zip(&read).all(|(w, c)| (-1e6 * w - c).abs() < 1.0);
        assert!((0..played.next()).any(near), "{read:?}");
    }
    // Its port is 30004 and no other; of this address nobody else has it.
    let robot = RtdeServer::listen("127.0.0.77:30004", played.clone()).unwrap();
    let read = said_by_others(&["rtde", &robot.address().ip().to_string()]);
    assert_eq!(read.len(), 5);
    for row in read {
        let sample = sample(((row[0] - 5000.0) * 500.0).round() as u64);
        let expected =
            sample.wrench.map(|w| -w).into_iter().chain(sample.accel).chain(sample.pose[..3].iter().copied());
        let differs = row[1..13].iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(differs < 1e-9, "{row:?}");
    }
}

#[test]
#[ignore = "needs foxglove-sdk in Python"]
fn independent_sensors_bridge_of_foxgloves_own_is_read() {
    use rigident::sources::{Role, open};
    use std::time::Duration;
    let python = python();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/real_time/sensors_clients.py");
    let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port().to_string();
    let mut serving = Command::new(python)
        .arg(script)
        .args(["foxglove", &port])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut ready = String::new();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(serving.stdout.take().unwrap()), &mut ready)
        .unwrap();
    assert_eq!(ready, "serving\n");
    let url = format!("ws://127.0.0.1:{port}?topic=/ft/wrench").parse().unwrap();
    let mut source = open(&url, &[Role::Wrench], &rigident::rig::RigFile::default()).unwrap();
    let mut rows = Vec::new();
    while rows.len() < 100 {
        source.read(Duration::from_millis(100), &mut rows).unwrap();
    }
    for row in &rows {
        let count = row.values[0];
        assert_eq!(row.time_ns, Some(1_000_000_000_000 + 5_000_000 * count as i64));
        assert!(row.values.iter().enumerate().all(|(k, v)| *v == count + 0.125 * k as f64), "{row:?}");
    }
    let missing = format!("ws://127.0.0.1:{port}?topic=/wrench").parse().unwrap();
    let said = open(&missing, &[Role::Wrench], &rigident::rig::RigFile::default()).err().unwrap().to_string();
    assert!(said.contains("/ft/wrench"), "{said}");
    drop(serving.stdin.take());
    serving.wait().unwrap();
}

/// The device's own sensors, and a body that somebody else moves.
#[test]
fn a_run_without_a_platform_tells_the_next_move_and_identifies_the_body() {
    let served = super::Served::new();
    let mut command = super::runs::run_at(&served, "none", "out", &["--at-most-s", "22", "--json"]);
    let mut running = command.spawn().unwrap();
    let errors = std::io::BufReader::new(running.stderr.take().unwrap());
    let mut said = Vec::new();
    for line in std::io::BufRead::lines(errors).map_while(Result::ok) {
        let moves = line.starts_with("move the body now");
        said.push(line);
        if moves {
            let mut rig = served.rig.lock().unwrap();
            rig.load_program(body_moved(16.0, 3).1).unwrap();
            rig.start().unwrap();
        }
    }
    let output = running.wait_with_output().unwrap();
    let said = said.join("\n");
    assert_eq!(output.status.code(), Some(0), "{said}");
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["status"], "identified", "{said}");
    check_truth(&result, 10);
    assert!(said.contains("hold the body still") && said.contains("next: "), "{said}");
    let plan = super::runs::run_at(&served, "none", "out2", &["--plan", "x.json"]).output().unwrap();
    assert_eq!(plan.status.code(), Some(2));
}
