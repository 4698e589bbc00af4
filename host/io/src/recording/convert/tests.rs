use super::*;
use std::fs;

/// Returns a text with every group there is, odd numbers, and columns in no particular order.
fn everything() -> String {
    let mut text = String::from("# operator = \"A. N. Other\"\n# free words\n# rate_hz = 3.0\n");
    let names = "lamp,imu1_gx_radps,imu1_gy_radps,imu1_gz_radps,t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2,q1_w,q1_x,q1_y,q1_z,x_m,y_m,z_m,qw,qx,qy,qz,cmd_x_m,cmd_y_m,cmd_z_m,cmd_qw,cmd_qx,cmd_qy,cmd_qz,g1_v,g2_v,g3_v,g4_v,g5_v,g6_v,gx_mps2,gy_mps2,gz_mps2,note";
    text += &format!("{names}\n");
    let columns = names.split(',').count();
    for n in 0..600 {
        let cells: Vec<String> = (0..columns)
            .map(|c| match c {
                0 => ["on", "", "\"a, b\"", "1.50"][n % 4].to_owned(),
                4 => format!("{:?}", n as f64 / 3.0),
                c if c + 1 == columns => format!("β{n}"),
                c => match (n * 37 + c) % 11 {
                    0 => "-0.0".to_owned(),
                    1 => "5e-324".to_owned(),
                    2 => "1.7976931348623157e308".to_owned(),
                    _ => format!("{:?}", ((n * 91 + c * 17) as f64).sin() / 7.0),
                },
            })
            .collect();
        text += &format!("{}\n", cells.join(","));
    }
    text
}

#[test]
fn csv_to_mcap_and_back_is_the_same_file_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let rig =
        "# what it was taken with\n[recording]\nrate_hz = 3\n\n[[imu]]\nlink = 0\naccel_noise_mps2 = 0.02\n";
    fs::write(at("a.csv"), everything()).unwrap();
    fs::write(at("a.rig.toml"), rig).unwrap();
    let there = convert(&at("a.csv"), &at("b.mcap"), None).unwrap();
    assert_eq!((there.rows, there.files.len()), (600, 1));
    let back = convert(&at("b.mcap"), &at("c.csv"), None).unwrap();
    assert_eq!(back.files, [at("c.csv"), at("c.rig.toml")]);
    assert_eq!(fs::read_to_string(at("c.csv")).unwrap(), everything());
    assert_eq!(fs::read_to_string(at("c.rig.toml")).unwrap(), rig);
    // And the other way round: the same messages.
    convert(&at("c.csv"), &at("d.mcap"), None).unwrap();
    assert_eq!(fs::read(at("b.mcap")).unwrap(), fs::read(at("d.mcap")).unwrap());
    // Same columns in memory, whichever form they are from.
    let (mut csv, mut mcap) =
        (Recording::load(&at("a.csv"), None).unwrap(), Recording::load(&at("b.mcap"), None).unwrap());
    (csv.name, mcap.name) = (String::new(), String::new());
    assert_eq!(csv, mcap);
}

#[test]
fn a_foreign_file_becomes_one_in_the_notation_and_names_its_origin() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.csv"), "fx,fy,fz,tx,ty,tz,ax,ay,az\n1,2,3,4,5,6,0,0,1\n2,2,3,4,5,6,0,0,-1\n").unwrap();
    let rig = "# ours\n[recording]\nstatic = true\nwrench_sign = \"on_sensor\"\n[recording.columns]\nfx_n \
               = \"fx\"\n\
               fy_n = \"fy\"\nfz_n = \"fz\"\nmx_nm = \"tx\"\nmy_nm = \"ty\"\nmz_nm = \"tz\"\n\
               imu_ax_mps2 = { name = \"ax\", scale = 9.80665 }\nimu_ay_mps2 = \
               { name = \"ay\", scale = 9.80665 }\n\
               imu_az_mps2 = { name = \"az\", scale = 9.80665 }\n";
    fs::write(at("a.rig.toml"), rig).unwrap();
    convert(&at("a.csv"), &at("b.mcap"), None).unwrap();
    convert(&at("b.mcap"), &at("c.csv"), None).unwrap();
    let (a, c) = (Recording::load(&at("a.csv"), None).unwrap(), Recording::load(&at("c.csv"), None).unwrap());
    assert_eq!((&a.wrench, &a.imus, &a.rig), (&c.wrench, &c.imus, &c.rig));
    assert!(c.is_static && c.wrench.as_ref().unwrap()[0] == [-1.0, -2.0, -3.0, -4.0, -5.0, -6.0]);
    assert_eq!(c.imus[0].accel.as_ref().unwrap()[1], [0.0, 0.0, -9.80665]);
    assert!(c.extra.contains(&("raw_az".to_owned(), vec!["1".to_owned(), "-1".to_owned()])));
    assert!(c.rig_text.unwrap().contains("# # ours\n# [recording]"));
}

#[test]
fn nothing_is_overwritten_and_names_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.csv"), everything()).unwrap();
    fs::write(at("b.mcap"), "mine").unwrap();
    fs::write(at("c.rig.toml"), "[recording]\nrate_hz = 17\n").unwrap();
    for (from, to, words) in [
        ("a.csv", "b.mcap", "b.mcap is there already"),
        ("a.csv", "c.csv", "c.rig.toml is there already"),
        ("a.csv", "b.parquet", "is written as .csv or .mcap"),
        ("a.doc", "d.mcap", "must end in .csv, .mcap,"),
        ("none.csv", "d.mcap", "cannot be read"),
        ("b.mcap", "d.csv", "is not a recording"),
        ("a.csv", "nowhere/d.mcap", "cannot be written"),
    ] {
        let error = convert(&at(from), &at(to), None).unwrap_err().to_string();
        assert!(error.contains(words), "{words}: {error}");
    }
    assert_eq!(fs::read(at("b.mcap")).unwrap(), b"mine");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
}
