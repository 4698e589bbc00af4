//! Bags that ROS 2's own definitions made (`rosbags` in Python, which shares no code with this project):
//! SQLite and MCAP, joint states, wrenches, IMUs and transforms. `RIGIDENT_PYTHON` names an interpreter that
//! has it, as `cargo xtask setup` installs it.

use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::program::{python, rigident, said, status};
use crate::streams::simulated::write_thesis;

/// Makes a bag of CSV files: `make.py BAG.db3|BAG.mcap KIND:TOPIC:FILE…`.
const SCRIPT: &str = r"
import csv, pathlib, shutil, sys, tempfile
from decimal import Decimal
import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
T = store.types
out = pathlib.Path(sys.argv[1])
V3, Q = T['geometry_msgs/msg/Vector3'], T['geometry_msgs/msg/Quaternion']

def header(ns, frame='base'):
    return T['std_msgs/msg/Header'](T['builtin_interfaces/msg/Time'](ns // 10**9, ns % 10**9), frame)

def message(kind, names, ns, v):
    if kind == 'joints':
        joints = [n[:-4] for n in names if n.endswith('_rad')]
        of = lambda unit: np.array([v[names.index(j + unit)] for j in joints])
        return T['sensor_msgs/msg/JointState'](header(ns), joints, of('_rad'), of('_radps'), of('_nm'))
    if kind == 'wrench':
        return T['geometry_msgs/msg/WrenchStamped'](header(ns), T['geometry_msgs/msg/Wrench'](V3(*v[:3]), V3(*v[3:])))
    if kind == 'accel':
        no, some = np.array([-1.0] + 8 * [0.0]), np.zeros(9)
        return T['sensor_msgs/msg/Imu'](header(ns), Q(0.0, 0.0, 0.0, 1.0), no, V3(0.0, 0.0, 0.0), no, V3(*v), some)
    x, y, z, qw, qx, qy, qz = v
    tf = T['geometry_msgs/msg/Transform'](V3(x, y, z), Q(qx, qy, qz, qw))
    other = T['geometry_msgs/msg/Transform'](V3(9.0, 9.0, 9.0), Q(0.0, 0.0, 0.0, 1.0))
    made = lambda child, tf: T['geometry_msgs/msg/TransformStamped'](header(ns, 'world'), child, tf)
    return T['tf2_msgs/msg/TFMessage']([made('camera', other), made('plate', tf)])

kinds = {'joints': 'sensor_msgs/msg/JointState', 'wrench': 'geometry_msgs/msg/WrenchStamped',
         'accel': 'sensor_msgs/msg/Imu', 'plate': 'tf2_msgs/msg/TFMessage'}
folder = pathlib.Path(tempfile.mkdtemp()) / 'bag'
plugin = StoragePlugin.SQLITE3 if out.suffix == '.db3' else StoragePlugin.MCAP
with Writer(folder, version=9, storage_plugin=plugin) as writer:
    all = []
    for k, source in enumerate(sys.argv[2:]):
        kind, topic, name = source.split(':')
        connection = writer.add_connection(topic, kinds[kind], typestore=store)
        rows = list(csv.reader(open(name)))
        names = rows[0][1:]
        for row in rows[1:]:
            ns = int(Decimal(row[0]) * 10**9)
            data = store.serialize_cdr(message(kind, names, ns, [float(c) for c in row[1:]]), kinds[kind])
            # It was stored 3 ms after it was measured: the header's stamp counts.
            all.append((ns + 3_000_000, k, connection, data))
    for ns, _, connection, data in sorted(all, key=lambda entry: entry[:2]):
        writer.write(connection, ns, data)
shutil.copy(next(folder.glob('*' + out.suffix)), out)
";

fn bag(at: &Path, name: &str, sources: &[&str]) {
    let out =
        Command::new(python()).args(["-c", SCRIPT, name]).args(sources).current_dir(at).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}

fn identified(at: &Path, arguments: &[&str]) -> Value {
    let output = rigident(at, &[&["identify"], arguments, &["--json"]].concat());
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&output)))
}

/// An arm of one joint about a horizontal axis: τ = I q̈ + m g c cos q.
const ARM: &str = r#"<robot name="arm"><link name="base"/><link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="3"/>
<inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 -1 0"/>
<limit lower="-2" upper="2" velocity="6" effort="60"/></joint></robot>"#;
const MOMENT_OF_INERTIA: f64 = 0.05 + 3.0 * 0.2 * 0.2;
const FIRST_MOMENT: f64 = 3.0 * 0.2;

fn write_arm(at: &Path) {
    let mut text = "t_s,shoulder_rad,shoulder_radps,shoulder_nm\n".to_owned();
    for k in 0..2000_u64 {
        let t = k as f64 * 0.005;
        // Two sines; a third for the noise of torques, which no model has.
        let (a, b) = ((0.6, 3.1), (0.4, 7.7));
        let q = a.0 * (a.1 * t).sin() + b.0 * (b.1 * t).sin();
        let rate = a.0 * a.1 * (a.1 * t).cos() + b.0 * b.1 * (b.1 * t).cos();
        let acceleration = -a.0 * a.1 * a.1 * (a.1 * t).sin() - b.0 * b.1 * b.1 * (b.1 * t).sin();
        let noise = 0.02 * (((k * 7919) % 1009) as f64 / 504.5 - 1.0);
        let torque = MOMENT_OF_INERTIA * acceleration + 9.80665 * FIRST_MOMENT * q.cos() + noise;
        let ns = 1_700_000_000_000_000_000 + 5_000_000 * k;
        let _ = writeln!(text, "{}.{:09},{q:?},{rate:?},{torque:?}", ns / 1_000_000_000, ns % 1_000_000_000);
    }
    std::fs::write(at.join("arm.csv"), text).unwrap();
    std::fs::write(at.join("arm.urdf"), ARM).unwrap();
}

#[test]
#[ignore = "needs rosbags in Python"]
fn joint_states_of_bags_agree_with_their_table_by_an_independent_ros_reader() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write_arm(at);
    let of_table = identified(at, &["arm.csv", "--model", "arm.urdf", "--out", "table"]);
    let parameters = of_table["parameters"].as_array().unwrap();
    // What the torque of one joint tells: the moment of inertia about it, and the first moments in its plane.
    for truth in [MOMENT_OF_INERTIA, FIRST_MOMENT] {
        let near = |p: &&Value| {
            let (value, u95) = (p["value"].as_f64(), p["u95"].as_f64());
            value.zip(u95).is_some_and(|(value, u95)| (value.abs() - truth).abs() < u95 && u95 < 0.03 * truth)
        };
        assert_eq!(parameters.iter().filter(near).count(), 1, "{truth}: {parameters:?}");
    }
    for name in ["arm.db3", "arm.mcap"] {
        bag(at, name, &["joints:/joint_states:arm.csv"]);
        let of_bag = identified(at, &[name, "--model", "arm.urdf", "--out", &format!("of-{name}")]);
        assert_eq!(of_bag["parameters"], of_table["parameters"], "{name}");
    }
    // Half of it.
    let whole = std::fs::read(at.join("arm.db3")).unwrap();
    std::fs::write(at.join("half.db3"), &whole[..whole.len() / 2]).unwrap();
    let refused = rigident(at, &["identify", "half.db3", "--model", "arm.urdf"]);
    assert_eq!(status(&refused), 2, "{}", said(&refused));
    assert!(said(&refused).contains("damaged or cut off"), "{}", said(&refused));
}

#[test]
#[ignore = "needs rosbags in Python"]
fn topics_of_one_bag_are_streams_by_an_independent_ros_reader() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    write_thesis(&at.join("run"), 1);
    let folder = at.join("run");
    let of_files = identified(at, &["run/run.rig.toml", "--out", "files"]);
    bag(&folder, "both.db3", &["wrench:/ft:wrench.csv", "accel:/imu:accelerometer.csv"]);
    let rig = std::fs::read_to_string(folder.join("run.rig.toml")).unwrap();
    let rig = rig
        .replace("file = \"wrench.csv\"", "file = \"both.db3\"\ntopic = \"/ft\"")
        .replace("file = \"accelerometer.csv\"", "file = \"both.db3\"\ntopic = \"/imu\"");
    assert_eq!(rig.matches("both.db3").count(), 2);
    std::fs::write(folder.join("bag.rig.toml"), &rig).unwrap();
    let of_bag = identified(at, &["run/bag.rig.toml", "--out", "bag"]);
    assert_eq!(of_bag["parameters"], of_files["parameters"]);
    std::fs::write(folder.join("none.rig.toml"), rig.replace("/imu", "/imu_2")).unwrap();
    let refused = rigident(at, &["identify", "run/none.rig.toml"]);
    assert_eq!(status(&refused), 2);
    let words = said(&refused);
    assert!(
        words.contains("no topic /imu_2") && words.contains("/ft (geometry_msgs/msg/WrenchStamped"),
        "{words}"
    );
}

#[test]
#[ignore = "needs rosbags in Python"]
fn transforms_are_poses_of_the_frame_that_is_named_by_an_independent_ros_reader() {
    let place = tempfile::tempdir().unwrap();
    let at = place.path();
    let mut text = "t_s,x_m,y_m,z_m,qw,qx,qy,qz\n".to_owned();
    for k in 0..50 {
        let half = 0.01 * f64::from(k);
        let _ = writeln!(
            text,
            "{:.3},{half:?},0.5,1.0,{:?},0.0,0.0,{:?}",
            1000.0 + 0.01 * f64::from(k),
            half.cos(),
            half.sin()
        );
    }
    std::fs::write(at.join("plate.csv"), &text).unwrap();
    bag(at, "tf.mcap", &["plate:/tf:plate.csv"]);
    let bytes = std::fs::read(at.join("tf.mcap")).unwrap();
    let read = |topic: &str| rigident::recording::mcap::read::topic_columns("tf.mcap", &bytes, topic);
    let columns = read("/tf#plate").unwrap();
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = rows.next().unwrap();
    let rows: Vec<Vec<&str>> = rows.collect();
    assert_eq!(columns.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), names);
    for (k, (name, cells)) in columns.iter().enumerate() {
        let numbers = cells.iter().map(|cell| cell.parse().unwrap()).collect::<Vec<f64>>();
        assert_eq!(numbers, rows.iter().map(|row| row[k].parse().unwrap()).collect::<Vec<f64>>(), "{name}");
    }
    assert!(read("/tf").unwrap_err().to_string().contains("/tf#FRAME"));
    assert!(read("/tf#none").unwrap_err().to_string().contains("frame none"));
}
