//! Errors of a set of files are reported by name, with status 2, and nothing is written.

use std::fs;
use std::path::Path;
use std::process::Command;

const RIG: &str = r#"
[[stream]]
file = "wrench.csv"
[[stream]]
file = "imu.csv"
[[stream]]
file = "attitude.csv"
rotation_matrix = { frame = "S in A", columns = ["r1","r2","r3","r4","r5","r6","r7","r8","r9"] }
"#;

fn table(header: &str, rows: usize, period_s: f64, row: impl Fn(f64) -> String) -> String {
    let mut text = format!("t_s,{header}\n");
    for k in 0..rows {
        let t = 10.0 + k as f64 * period_s;
        text.push_str(&format!("{t:.6},{}\n", row(t)));
    }
    text
}

fn wrench() -> String {
    table("fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm", 500, 0.002, |t| format!("{},0,{},0,{t},0", t.sin(), t.cos()))
}

fn imu() -> String {
    table("imu_ax_mps2,imu_ay_mps2,imu_az_mps2", 250, 0.004, |t| format!("{},{},9.8", t.sin(), t.cos()))
}

fn attitude() -> String {
    table("r1,r2,r3,r4,r5,r6,r7,r8,r9", 100, 0.01, |t| {
        let (s, c) = t.sin_cos();
        format!("{c},0,{s},0,1,0,{},0,{c}", -s)
    })
}

/// Status and words of `identify` on these files.
fn said(rig: &str, files: &[(&str, String)]) -> (Option<i32>, String) {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("turn.rig.toml"), rig).unwrap();
    for (name, text) in files {
        fs::write(place.path().join(name), text).unwrap();
    }
    let output = Command::new(env!("CARGO_BIN_EXE_rigident"))
        .current_dir(place.path())
        .args(["identify", "turn.rig.toml", "--out", "out"])
        .output()
        .unwrap();
    assert!(!Path::exists(&place.path().join("out")));
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn each_fault_of_the_files_is_named() {
    let good = [("wrench.csv", wrench()), ("imu.csv", imu()), ("attitude.csv", attitude())];
    let with = |name: &str, text: Option<String>| -> Vec<(&str, String)> {
        let kept = good.iter().filter(|(n, _)| *n != name || text.is_some()).cloned();
        kept.map(|(n, t)| if n == name { (n, text.clone().unwrap_or(t)) } else { (n, t) }).collect()
    };
    let backwards = |text: String| {
        let mut lines: Vec<&str> = text.lines().collect();
        lines.swap(40, 41);
        lines.join("\n")
    };
    let first = |text: String, rows: usize| text.lines().take(rows + 1).collect::<Vec<_>>().join("\n");
    for (files, words) in [
        (with("imu.csv", None), &["imu.csv", "turn.rig.toml", "cannot be read"][..]),
        (with("imu.csv", Some(imu().replace("\n1", "\n9"))), &["imu.csv", "do not overlap", "scale of t_s"]),
        (with("imu.csv", Some(backwards(imu()))), &["imu.csv", "line 42", "must increase"]),
        (with("imu.csv", Some(wrench())), &["fx_n", "wrench.csv", "imu.csv", "each quantity"]),
        (with("imu.csv", Some(first(imu(), 4))), &["imu.csv has 4 samples", "at least 5"]),
        (
            with("attitude.csv", Some(attitude().replace(",0,1,0,", ",0,1.1,0,"))),
            &["attitude.csv, row 1", "no rotation"],
        ),
        (
            with("attitude.csv", Some(attitude().replace(",0,1,0,", ",0,-1,0,"))),
            &["attitude.csv, row 1", "reflection"],
        ),
        (
            with("attitude.csv", Some(attitude().replace(",0,1,0,", ",0,x,0,"))),
            &["row 1, column r5", "\"x\""],
        ),
        (with("attitude.csv", Some(attitude().replace("r9", "r99"))), &["attitude.csv", "\"r9\"", "r99"]),
        (with("wrench.csv", Some(wrench().replace("fx_n", "fx"))), &["wrench.csv", "column fx_n is missing"]),
        (with("wrench.csv", Some(imu().replace("imu_", "imu1_"))), &["no stream holds the wrench"]),
        (
            vec![good[0].clone(), good[2].clone(), ("imu.csv", imu().replace("imu_", "imu1_"))],
            &["imu_ax_mps2", "missing"],
        ),
    ] {
        let (status, text) = said(RIG, &files);
        assert_eq!(status, Some(2), "{words:?}: {text}");
        for word in words {
            assert!(text.contains(word), "{word}: {text}");
        }
    }
    for (rig, words) in [
        (RIG.replace("S in A", "B in A"), &["line 8", "frame", "S in A"][..]),
        (format!("[recording]\nstatic = true\n{RIG}"), &["static", "stream"]),
        (String::new(), &["lists no [[stream]]"]),
    ] {
        let (status, text) = said(&rig, &good);
        assert_eq!(status, Some(2), "{text}");
        for word in words {
            assert!(text.contains(word), "{word}: {text}");
        }
    }
}
