use super::*;

/// The example of the format, whole.
const EXAMPLE: &str = r#"
[recording]
rate_hz = 200.0
wrench_sign = "on_sensor"
gravity_mps2 = 9.80665
columns = { fx_n = "Fx", t_s = { name = "time_ms", scale = 1e-3 } }

[[imu]]
link = 0
position_m = [0.01, -0.02, 0.05]
rotation_wxyz = [1, 0, 0, 0]
accel_scale = [1, 1, 1]
accel_bias_mps2 = "from_poses"
gyro_bias_radps = [0, 0, 0]
group_delay_s = 0.0
bandwidth_hz = 92
range_mps2 = 78.5
range_radps = 17.4
accel_noise_mps2 = 0.02
gyro_noise_radps = 4.3e-4
serial = "IMU-7"
calibrated_on = "2025-03-01"

[load_cell]
noise_n_nm = [5.05, 5.05, 10.1, 0.383, 0.459, 0.459]
offset_n_nm = "zero"
gain_uncertainty = [0.01, 0.01, 0.01, 0.01, 0.01, 0.01]
calibration = [[1,0,0,0,0,0],[0,1,0,0,0,0],[0,0,1,0,0,0],[0,0,0,1,0,0],[0,0,0,0,1,0],[0,0,0,0,0,1]]
group_delay_s = 0.0
bandwidth_hz = 250
range_n_nm = [500, 500, 1000, 20, 20, 20]
serial = "A-123"
calibrated_on = "2025-02-11"

[body]
name = "bracket 17"
position_m = [0, 0, 0.02]
rotation_wxyz = [1, 0, 0, 0]

[platform]
leg_length_m = [0.5, 0.9]
leg_rate_mps = 0.5
leg_acceleration_mps2 = 8
leg_jerk_mps3 = 90
leg_force_n = 2000
leg_push_n = 1900
leg_pull_n = 500
leg_buckling_nm2 = 1000
base_joint_angle_rad = 0.6
base_joint_axes = [[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1]]
plate_joint_angle_rad = 0.7
plate_joint_axes = [[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1],[0,0,1]]
cond_max = 30
load_cell = { position_m = [0, 0, 0.1], rotation_wxyz = [1, 0, 0, 0] }

[platform.arm]
model = "ur5.urdf"
flange = "tool0"
home_rad = [0, -1.9, -1.9, -0.9, 1.57, 0]
acceleration_radps2 = 12
rate_radps = [1, 1, 2, 2, 3, 3]
payload_kg = 5

[truth]
mass_kg = 3.2
com_m = [0.0, 0.01, 0.053]
inertia_com_kgm2 = [1, 1, 1, 0, 0, 0]

[[link]]
name = "base"
[[link]]
name = "arm"
parent = "base"
joint = "spherical"
position_m = [0.03, 0.0, 0.065]
rotation_wxyz = [1, 0, 0, 0]

[[stream]]
file = "wrench.csv"
columns = { t_s = { name = "t", scale = 1e-6 }, fx_n = "fx" }
[[stream]]
file = "attitude.csv"
rotation_matrix = { frame = "S in A", columns = ["r11","r12","r13","r21","r22","r23","r31","r32","r33"] }
"#;

#[test]
fn every_key_of_the_format_is_read_and_written() {
    let rig = RigFile::parse(EXAMPLE).unwrap();
    assert_eq!(rig.recording.wrench_sign, WrenchSign::OnSensor);
    assert_eq!(rig.recording.columns["t_s"].parts(), ("time_ms", 1e-3));
    assert_eq!(rig.imu[0].accel_bias_mps2, Calibrated::FromPoses(FromPoses::FromPoses));
    assert_eq!(rig.imu_on(0).unwrap().serial.as_deref(), Some("IMU-7"));
    assert_eq!(rig.load_cell.offset_n_nm, OffsetTable::Word(OffsetWord::Zero));
    assert_eq!(rig.load_cell.calibrated_on.as_deref(), Some("2025-02-11"));
    assert_eq!(rig.link[1].joint, Some(Joint::Spherical));
    let arm = rig.platform.as_ref().unwrap().arm.as_ref().unwrap();
    assert_eq!(arm.acceleration_radps2.each(), [12.0; 6]);
    assert_eq!(arm.rate_radps.as_ref().unwrap().each(), [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]);
    assert_eq!(rig.stream[1].rotation_matrix.as_ref().unwrap().columns[8], "r33");
    assert_eq!(RigFile::parse(&rig.to_toml()).unwrap(), rig);
    assert_eq!(RigFile::parse("").unwrap(), RigFile::default());
}

/// The content of the file, and the words that its message must hold.
#[test]
fn nonsense_is_named_with_its_line() {
    for (text, words) in [
        (
            "[load_cell]\nnoise_n_nm = [1,1,1,1,1,0]",
            &["line 2", "load_cell.noise_n_nm", "greater than zero"][..],
        ),
        ("[load_cell]\n\nnoise_n_nm = [1,1,1,1,1,nan]", &["line 3", "load_cell.noise_n_nm"]),
        ("[load_cell]\nnoise_n_nm = [1,1,1,1,1,-2]", &["load_cell.noise_n_nm"]),
        ("[load_cell]\nnoise_n_nm = [1,1,1]", &["line 2"]),
        ("[load_cell]\noffset_n_nm = \"none\"", &["line 2", "six numbers, \"estimate\" or \"zero\""]),
        ("[load_cell]\noffset_n_nm = [1,2,3,4,5,inf]", &["load_cell.offset_n_nm", "finite"]),
        ("[load_cell]\nnoise_nnm = [1,1,1,1,1,1]", &["line 2", "noise_nnm is not known (is it noise_n_nm?)"]),
        ("[loadcell]\n", &["line 1", "loadcell is not known (is it load_cell?)"]),
        (
            "[[imu]]\n[[imu]]\nlink = 1\nrotation_wxyz = [0,0,0,0]",
            &["line 4", "imu[1].rotation_wxyz", "norm is 0"],
        ),
        ("[[imu]]\naccel_bias_mps2 = \"poses\"", &["line 2", "from_poses"]),
        ("[[imu]]\ngroup_delay_s = 5", &["imu[0].group_delay_s", "between 0 and 1 s"]),
        ("[[imu]]\naccel_noise_mps2 = 0.0", &["line 2", "imu[0].accel_noise_mps2", "greater than zero"]),
        ("[[imu]]\ngyro_noise_radps = 0", &["line 2", "imu[0].gyro_noise_radps", "leave the key out"]),
        ("[[imu]]\n[[imu]]\n", &["two [[imu]] tables"]),
        (
            "[platform.arm]\nmodel = \"a\"\nflange = \"b\"\nhome_rad = [0,0,0,0,0,0]\n\
             acceleration_radps2 = 0",
            &["line 5", "platform.arm.acceleration_radps2", "greater than zero"],
        ),
        ("[platform.arm]\nmodel = \"a\"\nflange = \"b\"\nhome_rad = [0,0,0,0,0]", &["line 4", "length 6"]),
        ("[recording]\nrate_hz = -1", &["line 2", "recording.rate_hz"]),
        ("[recording]\nrate_hz = \"fast\"", &["line 2, column 11:"]),
        ("[recording]\nrate_hz = ", &["line 2, column 11:"]),
        ("[body]\nname = \"Träger\" 17", &["line 2, column 17:"]),
        ("[recording]\nwrench_sign = \"reaction\"", &["line 2", "on_body", "on_sensor"]),
        ("[recording]\ncolumns = { fx_n = { name = \"F\", scale = 0 } }", &["line 2", "scale"]),
        ("[recording]\ncolumns = { fx = \"F\" }", &["line 2", "is it fx_n?"]),
        ("[recording]\ncolumns = { fx_n = 3 }", &["line 2", "a column's name"]),
        ("[recording]\ncolumns = { fx_n = { name = \"F\", factor = 2 } }", &["line 2", "name", "scale"]),
        ("[truth]\nmass_kg = 0\ncom_m=[0,0,0]\ninertia_com_kgm2=[1,1,1,0,0,0]", &["line 2", "truth.mass_kg"]),
        ("[truth]\ncom_m=[0,0,0]", &["mass_kg"]),
        (
            "[platform]\nload_max_kg = 30\n[truth]\nmass_kg = \
             40\ncom_m=[0,0,0]\ninertia_com_kgm2=[1,1,1,0,0,0]",
            &["line 4", "truth.mass_kg", "load_max_kg"],
        ),
        (
            "[platform]\nload_within_m = 0.2\n[truth]\nmass_kg = \
             4\ncom_m=[0,0.2,0.1]\ninertia_com_kgm2=[1,1,1,0,0,0]",
            &["line 5", "truth.com_m", "load_within_m"],
        ),
        ("[platform]\nleg_length_m = [2, 1]", &["platform.leg_length_m", "wrong way round"]),
        ("[platform]\nleg_length_m = [0.7, 0.7]", &["platform.leg_length_m", "no stroke"]),
        ("[platform]\nleg_length_m = [nan, 0.8]", &["platform.leg_length_m", "finite"]),
        ("[platform]\nleg_length_m = [0.0, 0.8]", &["platform.leg_length_m", "greater than zero"]),
        ("[platform]\nbase_joints_m = [[0,0,0],[1,0,0]]", &["line 2"]),
        (
            "[platform]\nleg_rate_mps = 1\nbase_joint_angle_rad = -1",
            &["line 3", "platform.base_joint_angle_rad"],
        ),
        ("[[link]]\nname = \"a\"\n[[link]]\nname = \"b\"\nparent = \"c\"", &["line 5", "link[1].parent"]),
    ] {
        let error = RigFile::parse(text).unwrap_err().to_string();
        for word in words {
            assert!(error.contains(word), "{text}\n{word}\n{error}");
        }
    }
}

#[test]
fn a_file_is_named_in_its_errors() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("thing.rig.toml");
    let missing = RigFile::load(&path).unwrap_err().to_string();
    assert!(missing.contains("thing.rig.toml"), "{missing}");
    std::fs::write(&path, "[recording]\nrate_hz = 0\n").unwrap();
    let bad = RigFile::load(&path).unwrap_err().to_string();
    assert!(bad.contains("thing.rig.toml, line 2"), "{bad}");
}

#[test]
fn mutated_rig_files_never_panic() {
    let mut state = 88_172_645_463_325_252_u64;
    for _ in 0..3_000 {
        let mut bytes = EXAMPLE.as_bytes().to_vec();
        for _ in 0..4 {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let position = state as usize % bytes.len();
            bytes[position] = (state >> 32) as u8 & 0x7F;
        }
        if let Ok(text) = std::str::from_utf8(&bytes) {
            let _ = RigFile::parse(text);
        }
    }
}

#[test]
fn keys_and_texts_that_steer_are_refused_and_shown_harmless() {
    for text in [
        "[\"\\u001b[2J\"]\na = 1\n",
        "[load_cell]\n\"a\\nplatform: safe\" = 1\n",
        "[load_cell]\nserial = \"\\u009b8m\"\n",
        "[recording]\nlabels = { body = \"a\\u202eb\" }\n",
        "[[link]]\nname = \"a\\nmovej([0])\"\n",
        "[recording]\ntopics = { wrench = \"\"\"a\nb\"\"\" }\n",
    ] {
        let said = RigFile::parse(text).unwrap_err().to_string();
        assert!(said.contains("control characters"), "{said}");
        assert!(!said.chars().any(rigident_shared::printable::steers), "{said:?}");
    }
}

#[test]
fn files_outside_the_folder_of_a_rig_file_are_named() {
    let place = tempfile::tempdir().unwrap();
    let inside = place.path().join("inside");
    std::fs::create_dir(&inside).unwrap();
    for path in [place.path().join("a.csv"), inside.join("b.csv")] {
        std::fs::write(path, "").unwrap();
    }
    let absolute = place.path().join("a.csv").display().to_string();
    let text = format!(
        "[platform.arm]\nmodel = \"../a.csv\"\n[calibration]\nfile = \"../a.csv\"\n[[stream]]\nfile \
         = \"b.csv\"\n[[stream]]\nfile = {absolute:?}\n"
    );
    let said = files_outside(&text, &inside.join("x.rig.toml"));
    assert_eq!(said.len(), 3, "{said:?}");
    assert!(said[2].contains("../a.csv"), "{said:?}");
    assert!(said[0].contains(&absolute) && said[1].contains("../a.csv"), "{said:?}");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("/etc/passwd", inside.join("c.csv")).unwrap();
        assert_eq!(files_outside("[[stream]]\nfile = \"c.csv\"\n", &inside.join("x.rig.toml")).len(), 1);
    }
}

#[test]
fn the_number_of_a_calibrated_board_is_kept_and_a_bad_one_refused() {
    let key = |id: &str| RigFile::parse(&format!("[load_cell]\nboard_id = \"{id}\"\n"));
    let rig = key("0102030405060708090a0b0c").unwrap();
    assert_eq!(rig.load_cell.board_id.as_deref(), Some("0102030405060708090a0b0c"));
    // It survives being written and read.
    assert_eq!(RigFile::parse(&toml::to_string(&rig).unwrap()).unwrap(), rig);
    for id in [
        "",
        "0102030405060708090a0b0",
        "0102030405060708090a0b0cd",
        "0102030405060708090a0b0g",
        "12 Zeichen ü 0a0b0c0d0e0f",
    ] {
        let error = key(id).unwrap_err().to_string();
        assert!(error.contains("line 2") && error.contains("24 hexadecimal digits"), "{id}: {error}");
    }
}
