//! Recordings against MCAP software that shares no code with this project: the `mcap` and `mcap-ros2-support`
//! packages of Python. `RIGIDENT_PYTHON` names an interpreter that has them, as `cargo xtask setup` installs
//! it.

use crate::program::python;
use std::path::Path;
use std::process::{Command, Output};

use rigident::recording::Recording;
use rigident::recording::convert::convert;
use rigident::recording::mcap::{
    COMMANDED_TOPIC, GAUGES_TOPIC, GRAVITY_TOPIC, PLATFORM_TOPIC, WRENCH_TOPIC, attitude_topic, imu_topic,
};
use serde_json::Value;

const ROWS: usize = 700;
/// The CSV's groups, in order, with their topic, message type and number of columns.
const GROUPS: [(&str, &str, usize); 8] = [
    ("wrench", "geometry_msgs/msg/WrenchStamped", 6),
    ("imu0", "sensor_msgs/msg/Imu", 6),
    ("imu1", "sensor_msgs/msg/Imu", 6),
    ("gravity", "geometry_msgs/msg/Vector3Stamped", 3),
    ("gauges", "std_msgs/msg/Float64MultiArray", 6),
    ("platform", "geometry_msgs/msg/PoseStamped", 7),
    ("commanded", "geometry_msgs/msg/PoseStamped", 7),
    ("attitude1", "geometry_msgs/msg/QuaternionStamped", 4),
];

fn topic(group: &str) -> String {
    match group {
        "wrench" => WRENCH_TOPIC.to_owned(),
        "imu0" => imu_topic(0),
        "imu1" => imu_topic(1),
        "gravity" => GRAVITY_TOPIC.to_owned(),
        "gauges" => GAUGES_TOPIC.to_owned(),
        "platform" => PLATFORM_TOPIC.to_owned(),
        "commanded" => COMMANDED_TOPIC.to_owned(),
        _ => attitude_topic(1),
    }
}

/// Runs the script.
fn read_by_others(arguments: &[&str]) -> Output {
    let interpreter = python();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/integration/independent_mcap_reader.py");
    let output = Command::new(&interpreter).arg(&script).args(arguments).output().unwrap();
    assert!(output.status.success(), "{interpreter}: {}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Numbers whose digits all matter.
fn number(row: usize, column: usize) -> f64 {
    ((row * 53 + column) as f64 * 0.618_033_988_749_894_9).sin() * 10_f64.powi(column as i32 % 7 - 3)
}

fn csv() -> String {
    let mut text = String::from("# operator = \"A. N. Other\"\n");
    text += "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm";
    for imu in ["imu_", "imu1_"] {
        for column in ["ax_mps2", "ay_mps2", "az_mps2", "gx_radps", "gy_radps", "gz_radps"] {
            text += &format!(",{imu}{column}");
        }
    }
    text += ",gx_mps2,gy_mps2,gz_mps2,g1_v,g2_v,g3_v,g4_v,g5_v,g6_v";
    for prefix in ["", "cmd_"] {
        for column in ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"] {
            text += &format!(",{prefix}{column}");
        }
    }
    text += ",q1_w,q1_x,q1_y,q1_z,lamp\n";
    let columns: usize = GROUPS.iter().map(|(_, _, columns)| columns).sum();
    for row in 0..ROWS {
        text += &format!("{}.{:09}", time_ns(row) / 1_000_000_000, time_ns(row) % 1_000_000_000);
        for column in 0..columns {
            text += &format!(",{:?}", number(row, column));
        }
        text += if row % 2 == 0 { ",on\n" } else { ",off\n" };
    }
    text
}

fn time_ns(row: usize) -> u64 {
    12_000_000_000 + row as u64 * 1_000_000 + (row as u64 % 3)
}

#[test]
#[ignore = "needs the MCAP reader in Python"]
fn an_mcap_reader_in_python_finds_the_numbers_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("body.csv"), folder.path().join("body.mcap"));
    std::fs::write(&input, csv()).unwrap();
    std::fs::write(folder.path().join("body.rig.toml"), "[load_cell]\noffset_n_nm = \"zero\"\n").unwrap();
    convert(&input, &output, None).unwrap();
    let found = read_by_others(&["read", output.to_str().unwrap()]);
    let found: Value = serde_json::from_slice(&found.stdout).unwrap();
    assert_eq!(found["profile"], "ros2");
    let mut first = 0;
    for (group, kind, columns) in GROUPS {
        let name = topic(group);
        let there = &found["topics"][&name];
        assert_eq!(there["type"], kind, "{name}");
        assert_eq!(there["encoding"], "cdr");
        assert_eq!(there["count"], ROWS, "{name}");
        for row in 0..ROWS {
            let message = &there["rows"][row];
            assert_eq!(message["log_time"], time_ns(row));
            if group != "gauges" {
                assert_eq!(message["stamp"], time_ns(row), "{name}");
            }
            let expected: Vec<String> = (first..first + columns)
                .map(|column| format!("{:016x}", number(row, column).to_bits()))
                .collect();
            assert_eq!(message["bits"], Value::from(expected), "{name}, row {row}");
        }
        first += columns;
    }
    let attachments = found["attachments"].as_object().unwrap();
    assert!(attachments.iter().any(|(name, text)| {
        name.ends_with("rig.toml") && text.as_str().is_some_and(|t| t.contains("offset_n_nm = \"zero\""))
    }));
}

#[test]
#[ignore = "needs the MCAP reader in Python"]
fn bags_of_the_mcap_reader_in_python_are_brought_onto_the_times_of_the_wrench() {
    const BAG_ROWS: usize = 200;
    const EPOCH: u64 = 1_700_000_000_000_000_000;
    let folder = tempfile::tempdir().unwrap();
    for packing in ["zstd", "lz4", "none"] {
        let bag = folder.path().join(format!("{packing}.mcap"));
        read_by_others(&["write", bag.to_str().unwrap(), packing, &BAG_ROWS.to_string()]);
        let recording = Recording::load(&bag, None).unwrap();
        // The IMU begins 1 ms after the wrench: the first row has nothing before it.
        let times = &recording.time_ns;
        assert!(times.len() >= BAG_ROWS - 2, "{packing}: {} rows", times.len());
        let (wrench, imu) = (recording.wrench.as_ref().unwrap(), &recording.imus[0]);
        let (accel, gyro) = (imu.accel.as_ref().unwrap(), imu.gyro.as_ref().unwrap());
        for (row, time) in times.iter().enumerate() {
            let t = (time - EPOCH) as f64 * 1e-9;
            assert_eq!(wrench[row], [(t * 100.0).round(), -2.0, 3.0, 0.1, 0.2, 0.3]);
            // Straight lines over h = 2.5 ms are off by less than h²/8 · max|f″| = 3.2e-6, with f″ = 4 sin
            // 2t.
            assert!((accel[row][0] - (2.0 * t).sin()).abs() < 3.2e-6, "{packing}, {t}");
            assert!((gyro[row][0] - 0.5 * t.cos()).abs() < 3.2e-6, "{packing}, {t}");
            assert!((accel[row][2] - 9.8).abs() < 1e-12 && (gyro[row][2] - 0.25).abs() < 1e-12);
        }
        let said = recording.warnings.join("\n");
        assert!(said.contains("/camera/imu") && said.contains("interpolated"), "{said}");
    }
}
