//! C3D files against `ezc3d`, which shares no code with this project. `RIGIDENT_PYTHON` names an interpreter
//! that has it, as `cargo xtask setup` installs it.

use crate::program::python;
use std::path::Path;
use std::process::Command;

use rigident::motion_capture::c3d::{C3d, PlateKind};

const SCRIPT: &str = "
import sys, json, ezc3d, numpy as np
c = ezc3d.c3d(sys.argv[1], extract_forceplat_data=True)
points, analog, p = c['data']['points'], c['data']['analogs'][0], c['parameters']
unseen = lambda row: [None if np.isnan(v) else float(v) for v in row]
plates = p['FORCE_PLATFORM']
print(json.dumps({
    'rate': float(p['POINT']['RATE']['value'][0]),
    'labels': p['POINT']['LABELS']['value'][:points.shape[1]],
    'points': [unseen(row) for row in (points[:3] / 1000).transpose(2, 1, 0).reshape(-1, 3)],
    'channels': p['ANALOG']['LABELS']['value'][:analog.shape[0]],
    'analog': analog.T.reshape(-1).tolist(),
    'types': plates['TYPE']['value'].tolist(),
    'wired': plates['CHANNEL']['value'].T.tolist(),
    'corners': (plates['CORNERS']['value'] / 1000).transpose(2, 1, 0).tolist(),
    'origins': (plates['ORIGIN']['value'] / 1000).T.tolist(),
    # About the middle of the surface; a channel whose unit is said to be V is one of N and N mm in these files.
    'wrenches': [np.vstack([q['force'], q['moment'] / 1000]).T.tolist() for q in c['data']['platform']],
}))
";

/// Writes a file whose plates are of another type, and says what they do by it.
const OTHER_TYPES: &str = "
import sys, json, ezc3d, numpy as np
source, kind, out = sys.argv[1], int(sys.argv[2]), sys.argv[3]
c = ezc3d.c3d(source)
p = c['parameters']['FORCE_PLATFORM']
n = 2 if kind == 3 else 3
p['USED']['value'], p['TYPE']['value'] = np.array([n]), np.array([kind] * n)
p['CORNERS']['value'], p['ORIGIN']['value'] = p['CORNERS']['value'][:, :, :n], p['ORIGIN']['value'][:, :n]
if kind == 3:
    p['ORIGIN']['value'] = np.array([[120.0, 150.0], [200.0, 210.0], [-40.0, -50.0]])
    p['CHANNEL']['value'] = np.arange(1, 17).reshape(2, 8).T
if kind == 4:
    p['CAL_MATRIX']['value'] = np.random.default_rng(1).normal(size=(6, 6, 3))
c.write(out)
d = ezc3d.c3d(out, extract_forceplat_data=True)
wrenches = [np.vstack([q['force'], q['moment'] / 1000]).T for q in d['data']['platform']]
if kind == 1:
    # The reader takes F x p for the moment of a force at its centre of pressure p, for p x F: by hand, from the channels.
    for k in range(n):
        fx, fy, fz, px, py, mz = d['data']['analogs'][0][6 * k:6 * k + 6]
        c = p['CORNERS']['value'][:, :, k].T
        x, y = (c[0] + c[3] - c[1] - c[2]), (c[0] + c[1] - c[2] - c[3])
        axes = np.stack([x / np.linalg.norm(x), y / np.linalg.norm(y)], axis=1)
        axes = np.column_stack([axes, np.cross(axes[:, 0], axes[:, 1])])
        force = (axes @ np.stack([fx, fy, fz])).T
        at = (axes @ np.stack([px, py, 0 * px])).T / 1000
        free = (axes @ np.stack([0 * mz, 0 * mz, mz])).T / 1000
        wrenches[k] = np.hstack([wrenches[k][:, :3], np.cross(at, force) + free])
print(json.dumps([w.tolist() for w in wrenches]))
";

#[test]
#[ignore = "needs ezc3d in Python and the shared recordings"]
fn plates_of_every_type_made_of_shared_data_agree_with_an_independent_c3d_reader() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data/human_btk_pig_60kg_functional/FunctionalStatic.c3d");
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    for kind in ["1", "3", "4"] {
        let file = folder.path().join("plates.c3d");
        let out = Command::new(&python).args(["-c", OTHER_TYPES]).arg(&source).arg(kind).arg(&file).output();
        let out = out.unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let theirs: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        let ours = C3d::parse(&std::fs::read(&file).unwrap()).unwrap();
        same_wrenches(&ours, &theirs, kind);
    }
}

#[test]
#[ignore = "needs ezc3d in Python and the shared recordings"]
fn shared_data_are_read_as_an_independent_c3d_reader_reads_them() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let python = python();
    for name in [
        "human_btk_pig_47kg_fullbody/PiG_Calibration-FlatFoot-Full.c3d",
        "human_btk_pig_47kg_fullbody/PiG_Motion-FlatFoot-Full.c3d",
        "human_btk_pig_60kg_functional/FunctionalStatic.c3d",
        "human_btk_pig_60kg_functional/FunctionalWalk.c3d",
    ] {
        let path = data.join(name);
        let out = Command::new(&python).args(["-c", SCRIPT]).arg(&path).output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let theirs: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        let ours = C3d::parse(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(theirs["rate"], ours.rate_hz);
        let points = theirs["points"].as_array().unwrap();
        assert_eq!(points.len(), ours.frames * ours.labels.len());
        for (k, (a, b)) in points.iter().zip(&ours.points_m).enumerate() {
            for (a, b) in a.as_array().unwrap().iter().zip(b) {
                let near = a.as_f64().map_or(b.is_nan(), |a| (a - f64::from(*b)).abs() < 1e-6);
                assert!(near, "{name}, point {k}: {a} {b}");
            }
        }
        // Ours are without what may be a subject's name.
        for (a, b) in theirs["labels"].as_array().unwrap().iter().zip(&ours.labels) {
            assert!(a.as_str().unwrap().ends_with(b.as_str()), "{a} {b}");
        }
        assert_eq!(theirs["channels"].as_array().unwrap().len(), ours.channels.len());
        let analog = theirs["analog"].as_array().unwrap();
        assert_eq!(analog.len(), ours.analog.len());
        for (k, (a, b)) in analog.iter().zip(&ours.analog).enumerate() {
            let (a, b) = (a.as_f64().unwrap(), f64::from(*b));
            assert!((a - b).abs() <= 1e-6 * a.abs().max(1e-3), "{name}, sample {k}: {a} {b}");
        }
        same_wrenches(&ours, &theirs["wrenches"], name);
        for (k, plate) in ours.plates.iter().enumerate() {
            assert_eq!((&plate.kind, &theirs["types"][k]), (&PlateKind::Wrench, &serde_json::json!(2)));
            let wired: Vec<usize> = plate.channels.iter().map(|c| c + 1).collect();
            assert_eq!(theirs["wired"][k], serde_json::json!(wired));
            let near = |theirs: &serde_json::Value, ours: f64| (theirs.as_f64().unwrap() - ours).abs() < 1e-6;
            for corner in 0..4 {
                for axis in 0..3 {
                    assert!(near(&theirs["corners"][k][corner][axis], plate.corners_m[corner][axis]));
                }
            }
            assert!((0..3).all(|axis| near(&theirs["origins"][k][axis], plate.origin_m[axis])));
        }
    }
}

/// Compares what the plates do, moments about the middle of each surface.
fn same_wrenches(ours: &C3d, theirs: &serde_json::Value, name: &str) {
    let wrenches = ours.ground_wrenches();
    assert_eq!(theirs.as_array().unwrap().len(), wrenches.len());
    for (k, (ours, plate)) in wrenches.iter().zip(&ours.plates).enumerate() {
        let middle: [f64; 3] =
            std::array::from_fn(|axis| plate.corners_m.iter().map(|c| c[axis]).sum::<f64>() / 4.0);
        assert_eq!(theirs[k].as_array().unwrap().len(), ours.len());
        for (sample, [x, y, z, mx, my, mz]) in ours.iter().enumerate() {
            let [a, b, c] = middle;
            let own = [*x, *y, *z, mx - (b * z - c * y), my - (c * x - a * z), mz - (a * y - b * x)];
            for (axis, own) in own.iter().enumerate() {
                let their = theirs[k][sample][axis].as_f64().unwrap();
                let near = 1e-4_f64.max(1e-6 * their.abs());
                assert!((own - their).abs() < near, "{name}, plate {k}, {sample}, {axis}: {own} {their}");
            }
        }
    }
}
