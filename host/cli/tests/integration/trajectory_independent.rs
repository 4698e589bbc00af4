//! A trajectory for ROS 2 as a reader of YAML and ROS 2's own definition of the message see it (`ruamel.yaml`
//! and `rosbags`), which share no code with this project. `RIGIDENT_PYTHON` names an interpreter that has
//! them, as `cargo xtask setup` installs it.

use std::process::Command;

use crate::plan_excitation::ARM;
use crate::program::{python, rigident, said, status};

/// Reads the message, builds it by its definition, sends it through ROS 2's binary form, and holds it against
/// the table.
const SCRIPT: &str = r"
import sys
import numpy as np
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML

store = get_typestore(Stores.ROS2_JAZZY)

def made(kind, value):
    names = [name for name, _ in store.fielddefs[kind][1]]
    assert sorted(value) == sorted(names), (kind, sorted(value), names)
    return store.types[kind](**value)

def point(value):
    value['time_from_start'] = made('builtin_interfaces/msg/Duration', value['time_from_start'])
    for name in ('positions', 'velocities', 'accelerations', 'effort'):
        value[name] = np.array(value[name], dtype=np.float64)
    return made('trajectory_msgs/msg/JointTrajectoryPoint', value)

whole = YAML(typ='safe').load(open(sys.argv[1]))
whole['header']['stamp'] = made('builtin_interfaces/msg/Time', whole['header']['stamp'])
whole['header'] = made('std_msgs/msg/Header', whole['header'])
whole['points'] = [point(value) for value in whole['points']]
kind = 'trajectory_msgs/msg/JointTrajectory'
sent = store.serialize_cdr(made(kind, whole), kind)
message = store.deserialize_cdr(sent, kind)

table = np.genfromtxt(sys.argv[2], delimiter=',', names=True)
t = np.array([p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points])
assert message.joint_names == ['shoulder', 'elbow'], message.joint_names
assert len(t) == 81 and t[0] == 0 and np.all(np.diff(t) > 0)
for k, joint in enumerate(message.joint_names):
    q = np.array([p.positions[k] for p in message.points])
    v = np.array([p.velocities[k] for p in message.points])
    a = np.array([p.accelerations[k] for p in message.points])
    assert np.ptp(q) > 0.1
    assert np.max(np.abs(q - np.interp(t, table['t_s'], table[joint + '_rad']))) < 1e-6
    assert np.max(np.abs(v - np.interp(t, table['t_s'], table[joint + '_radps']))) < 1e-6
    slope = np.interp(t, table['t_s'], np.gradient(table[joint + '_radps'], table['t_s']))
    assert np.max(np.abs(slope - a)[1:-1]) < 0.005 * np.max(np.abs(a))
";

#[test]
#[ignore = "needs rosbags in Python"]
fn a_trajectory_is_ros_2_s_message_by_an_independent_ros_reader() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("arm.urdf"), ARM).unwrap();
    let words = ["plan", "excitation", "arm.urdf", "--duration-s", "4", "--restarts", "1"];
    let output = rigident(place.path(), &[&words[..], &["-o", "a.csv", "-o", "a.yaml"]].concat());
    assert_eq!(status(&output), 0, "{}", said(&output));
    let python = python();
    let out = Command::new(&python)
        .args(["-c", SCRIPT, "a.yaml", "a.csv"])
        .current_dir(place.path())
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
}
