use super::*;

fn known() -> Gaussian {
    let names = ["gain_fz", "lever_arm_x"].map(str::to_owned).to_vec();
    let covariance = DMatrix::from_row_slice(2, 2, &[1e-6, -4e-7, -4e-7, 2.5e-7]);
    Gaussian::new(names, DVector::from_vec(vec![3e-3, -1e-3]), covariance).unwrap()
}

fn rig(text: &str) -> RigFile {
    RigFile::parse(text).unwrap()
}

const PLAIN: &str = "[[imu]]\nposition_m = [0.04, -0.03, 0.02]\nserial = \"7\"\n";

fn calibration() -> RigCalibration {
    let units = ["1".to_owned(), "m".to_owned()];
    let of = CalibratedRig::of(&rig(PLAIN)).unwrap();
    RigCalibration { name: "lab".to_owned(), ..RigCalibration::of(&known(), &units, of) }.sealed()
}

#[test]
fn a_calibration_is_written_and_read() {
    let written = calibration();
    let read = RigCalibration::parse(&written.to_toml(), "lab.toml").unwrap();
    assert_eq!(read, written);
    let (read, known) = (read.distribution().unwrap(), known());
    assert_eq!(read.names(), known.names());
    assert!((read.covariance() - known.covariance()).norm() < 1e-15);
}

#[test]
fn a_rig_file_holds_it_or_names_its_file() {
    let mut own = rig(PLAIN);
    own.calibrate(calibration()).unwrap();
    assert_eq!(RigFile::parse(&own.to_toml()).unwrap(), own);

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lab.rig.toml");
    std::fs::write(folder.path().join("lab.calibration.toml"), calibration().to_toml()).unwrap();
    std::fs::write(&path, format!("{PLAIN}[calibration]\nfile = \"lab.calibration.toml\"\n")).unwrap();
    assert_eq!(RigFile::load(&path).unwrap(), own);

    std::fs::write(&path, format!("{PLAIN}[calibration]\nfile = \"other.toml\"\n")).unwrap();
    let RigFileError::Value { key, value, .. } = RigFile::load(&path).unwrap_err() else { panic!() };
    assert_eq!((key.as_str(), value.as_str()), ("calibration", "other.toml"));
}

#[test]
fn a_calibration_of_another_rig_is_refused() {
    for (text, differs) in [
        ("[[imu]]\nposition_m = [0.041, -0.03, 0.02]\n", "imu.position_m"),
        (
            "[recording]\ngravity_mps2 = 9.81\n[[imu]]\nposition_m = [0.04, -0.03, 0.02]\n",
            "recording.gravity_mps2",
        ),
        ("[[imu]]\nposition_m = [0.04, -0.03, 0.02]\nserial = \"8\"\n", "imu.serial"),
        ("[[imu]]\nposition_m = [0.04, -0.03, 0.02]\naccel_scale = [1, 1.01, 1]\n", "imu.accel_scale"),
    ] {
        let Err(CalibrationError::OtherRig { key, calibrated, own, .. }) = rig(text).calibrate(calibration())
        else {
            panic!("{text}")
        };
        assert_eq!(key, differs);
        assert!(!format!("{calibrated}{own}").contains("Some"), "{calibrated} {own}");
    }
    // Whose wrench the load cell reports is no matter: it is turned to that on the body when a recording is
    // read.
    let reports = "[recording]\nwrench_sign = \"on_sensor\"\n[[imu]]\nposition_m = [0.04, -0.03, 0.02]\n";
    assert!(rig(reports).calibrate(calibration()).is_ok());
    // A serial number that is not given says nothing.
    rig("[[imu]]\nposition_m = [0.04, -0.03, 0.02]\n").calibrate(calibration()).unwrap();
    let anew = rig("[[imu]]\naccel_scale = \"from_poses\"\n").calibrate(calibration());
    assert_eq!(anew, Err(CalibrationError::FromPoses));
}

#[test]
fn numbers_of_no_distribution_are_refused() {
    let good = calibration();
    let refused = |change: &dyn Fn(&mut RigCalibration)| {
        let mut bad = good.clone();
        change(&mut bad);
        let bad = bad.sealed();
        matches!(RigCalibration::parse(&bad.to_toml(), "x"), Err(CalibrationError::Invalid { .. }))
    };
    assert!(refused(&|c| c.error[0].std = -1e-3));
    assert!(refused(&|c| c.error[1].value = f64::NAN));
    assert!(refused(&|c| c.error[1].name = "gain_fz".to_owned()));
    assert!(refused(&|c| c.correlation[1][0] = 1.2));
    assert!(refused(&|c| c.correlation[1].clear()));
    assert!(refused(&|c| c.date = "yesterday".to_owned()));
    assert!(!refused(&|_| ()));
}

#[test]
fn a_calibration_grows_old() {
    let old = RigCalibration { date: "2026-01-01T00:00:00Z".to_owned(), valid_days: 100, ..calibration() };
    assert_eq!(old.expired(Some("2026-04-01T00:00:00Z")), None);
    assert!(old.expired(Some("2026-05-01T00:00:00Z")).is_some());
}

/// Returns why a changed calibration is refused; sealed again, so that its content alone is at fault.
fn reason(change: &dyn Fn(&mut RigCalibration)) -> String {
    let mut bad = calibration();
    change(&mut bad);
    match RigCalibration::parse(&bad.sealed().to_toml(), "x") {
        Err(CalibrationError::Invalid { reason, .. }) => reason,
        other => panic!("{other:?}"),
    }
}

#[test]
fn impossible_values_are_named_with_their_place() {
    assert!(reason(&|c| c.error[0].name = "gain_fq".to_owned()).starts_with("error[0].name"));
    assert!(reason(&|c| c.error[1].unit = "mm".to_owned()).starts_with("error[1].unit"));
    let ahead = humantime::format_rfc3339(SystemTime::now() + 3 * CLOCKS).to_string();
    assert!(reason(&|c| c.date.clone_from(&ahead)).contains("in the future"));
}

/// Every number and word counts; how the file is laid out does not.
#[test]
fn an_edited_calibration_is_refused() {
    let good = calibration();
    let changes: [&dyn Fn(&mut RigCalibration); 6] = [
        &|c| c.error[0].std *= 1e-3,
        &|c| c.error[1].value *= 1.000_001,
        &|c| c.rig.gravity_mps2 = 9.81,
        &|c| c.rig.load_cell_serial = Some("B".to_owned()),
        &|c| c.valid_days = 10_000,
        &|c| c.checksum.clear(),
    ];
    for change in changes {
        let mut edited = good.clone();
        change(&mut edited);
        let refused = RigCalibration::parse(&edited.to_toml(), "x").unwrap_err();
        assert!(refused.to_string().contains("checksum"), "{refused}");
    }
    let spaced = format!("# from the lab\n{}", good.to_toml().replace(" = ", "   =   "));
    assert_eq!(RigCalibration::parse(&spaced, "x").unwrap(), good);
}
