use nalgebra::{Matrix3, Rotation3, Vector3};

use super::*;
use crate::inertial::in_parent;

const ALL: [Language; 5] =
    [Language::UniversalRobots, Language::FrankaCall, Language::FrankaFile, Language::Kuka, Language::Urdf];

/// Returns a box of 1.7 kg, 60 × 110 × 180 mm, turned, its centre off the flange's axis.
fn turned_box() -> Load {
    let (a, b, c) = (0.06_f64, 0.11_f64, 0.18_f64);
    let m = 1.7 / 12.0;
    let own =
        [1.7, 0.0, 0.0, 0.0, m * (b * b + c * c), m * (a * a + c * c), m * (a * a + b * b), 0.0, 0.0, 0.0];
    let turn = Rotation3::from_euler_angles(0.4, -0.7, 1.1).into_inner();
    Load::of_parameters(in_parent(&own, &turn, &Vector3::new(0.021, -0.034, 0.083)))
}

/// Returns twice the kinetic energy of eight equal masses at the corners of the box that has the moments of
/// `load`.
///
/// A box of 8 masses m/8 at ± s has `Ixx = m (s_y² + s_z²)`: nothing of the formulas of tensors in any other
/// axes.
fn energy(load: &Load, velocity: Vector3<f64>, rate: Vector3<f64>) -> f64 {
    let [xx, yy, zz, yz, zx, xy] = load.inertia_com_kgm2;
    let tensor = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
    let eigen = tensor.symmetric_eigen();
    let half = eigen.eigenvalues.sum() / 2.0;
    let side = eigen.eigenvalues.map(|moment| ((half - moment) / load.mass_kg).sqrt());
    let mut twice = 0.0;
    for corner in 0..8_u8 {
        let sign = |k: u8| if corner >> k & 1 == 1 { 1.0 } else { -1.0 };
        let own = Vector3::new(sign(0) * side.x, sign(1) * side.y, sign(2) * side.z);
        let place = Vector3::from(load.com_m) + eigen.eigenvectors * own;
        twice += load.mass_kg / 8.0 * (velocity + rate.cross(&place)).norm_squared();
    }
    twice
}

/// Returns twice the kinetic energy by the ten parameters: `m v² + 2 v·(ω × mc) + ω·I ω`.
fn energy_of_parameters(phi: &Parameters, v: Vector3<f64>, w: Vector3<f64>) -> f64 {
    let [m, x, y, z, xx, yy, zz, yz, zx, xy] = *phi;
    let tensor = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
    m * v.norm_squared() + 2.0 * v.dot(&w.cross(&Vector3::new(x, y, z))) + w.dot(&(tensor * w))
}

#[test]
fn every_language_is_read_back_as_the_same_body() {
    let load = turned_box();
    let phi = load.parameters();
    for language in ALL {
        let text = language.write(&load, "tool0", &["a remark".to_owned()]).unwrap();
        let again = language.read(&text).unwrap();
        for (k, (a, b)) in phi.iter().zip(again.parameters()).enumerate() {
            assert!((a - b).abs() < 1e-8, "{language:?} {k}: {a} {b}\n{text}");
        }
        let (v, w) = (Vector3::new(0.3, -0.2, 0.5), Vector3::new(1.0, 2.0, -1.5));
        let (own, other) = (energy_of_parameters(&phi, v, w), energy(&again, v, w));
        assert!((own - other).abs() < 1e-6 * own, "{language:?}: {own} {other}");
    }
}

/// Angles of KUKA in any part of space, near the pole of B = ± 90° as well.
#[test]
fn principal_axes_in_any_attitude_are_read_back() {
    let own = [1.0, 0.0, 0.0, 0.0, 0.011, 0.017, 0.023, 0.0, 0.0, 0.0];
    for k in 0..200 {
        let angle = |n: f64| (n * f64::from(k)).sin() * std::f64::consts::PI;
        let pitch = if k % 10 == 0 { std::f64::consts::FRAC_PI_2 } else { 0.5 * angle(2.3) };
        let turn = Rotation3::from_euler_angles(angle(1.7), pitch, angle(3.1)).into_inner();
        let load = Load::of_parameters(in_parent(&own, &turn, &Vector3::new(0.1, 0.2, 0.3)));
        let again = Language::Kuka.read(&Language::Kuka.write(&load, "f", &[]).unwrap()).unwrap();
        for (a, b) in load.inertia_com_kgm2.iter().zip(again.inertia_com_kgm2) {
            assert!((a - b).abs() < 1e-8, "{k}: {a} {b}");
        }
    }
}

#[test]
fn a_point_mass_is_written_where_the_language_has_one() {
    let load = Load { mass_kg: 0.4, com_m: [0.0, 0.01, 0.05], inertia_com_kgm2: [0.0; 6] };
    for language in ALL {
        let found = language.write(&load, "tool0", &[]);
        if language == Language::Urdf {
            assert_eq!(found, Err(LoadError::NeedsTensor));
        } else {
            assert_eq!(language.read(&found.unwrap()).unwrap(), load);
        }
    }
}

#[test]
fn impossible_bodies_are_not_written() {
    let load = Load { inertia_com_kgm2: [0.01, 0.01, 0.03, 0.0, 0.0, 0.0], ..turned_box() };
    let nothing = Load { mass_kg: 0.0, com_m: [0.0; 3], inertia_com_kgm2: [0.0; 6] };
    for language in ALL {
        for load in [load, nothing] {
            assert!(matches!(language.write(&load, "tool0", &[]), Err(LoadError::Impossible(_))));
        }
    }
}

#[test]
fn texts_without_a_load_are_refused() {
    for language in ALL {
        for text in ["", "set_target_payload(1.0)", "{\"mass\": 1}", "robot.setLoad(1.0);", "{M 1.0}"] {
            assert!(matches!(language.read(text), Err(LoadError::Read(_))), "{language:?} {text}");
        }
    }
}

/// Oracle: the same body as a link on fixed joints, welded.
#[test]
fn a_place_on_a_fixed_link_is_one_on_the_link_that_moves() {
    let text = r#"<robot name="a"><link name="base"/><link name="arm"/><link name="flange"/><link name="tool0"/>
      <joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
      <joint name="f" type="fixed"><parent link="arm"/><child link="flange"/><origin xyz="0.1 0 0.2" rpy="0.3 0 1"/></joint>
      <joint name="t" type="fixed"><parent link="flange"/><child link="tool0"/><origin xyz="0 0.05 0" rpy="0 -0.4 0"/></joint>
    </robot>"#;
    let mut model = crate::urdf::parse(text, "a").unwrap();
    let words = "tool0@0.02,-0.01,0.1,10,30,15";
    let moving = model.moving_place(&model.place("`payload`", words).unwrap());
    assert_eq!(model.links[moving.link].name, "arm");
    let phi = turned_box().parameters();
    let found = in_parent(&phi, &moving.rotation, &moving.position);
    model.links.iter_mut().for_each(|link| link.nominal = Some([0.0; 10]));
    model.hold_tool(words).unwrap();
    model.links.last_mut().unwrap().nominal = Some(phi);
    let welded = model.welded();
    let expected = welded.links[welded.link("arm").unwrap()].nominal.unwrap();
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
    assert!(model.place("`payload`", "hand").is_err() && model.place("`payload`", "arm@1").is_err());
}

/// Names of recordings are in the remarks, and a robot runs each line that is no comment.
#[test]
fn no_remark_becomes_a_statement() {
    let load = turned_box();
    let remarks = [
        "x\nmovej([0,-1.57,0,-1.57,0,0], a=10, v=3)\n#",
        "x\r\nPTP HOME\r",
        "x\u{b}y\u{c}z\u{85}movel(p[])\u{2028}halt()",
        "ends in a backslash \\",
        "ends in a trigraph ??/",
        "\u{1b}[2J\u{202e}",
    ];
    for language in ALL {
        let plain = language.write(&load, "tool0", &[]).unwrap();
        let text = language.write(&load, "tool0", &remarks.map(str::to_owned)).unwrap();
        let own: Vec<&str> = plain.lines().collect();
        let Some(mark) = language.comment() else {
            assert_eq!(text, plain);
            continue;
        };
        let (comments, rest): (Vec<&str>, Vec<&str>) = text.lines().partition(|line| line.starts_with(mark));
        assert_eq!(comments.len(), remarks.len(), "{text}");
        assert_eq!(rest, own, "{text}");
        for line in comments {
            assert!(!line.chars().any(printable::steers) && !line.ends_with(['\\', '/']), "{line:?}");
        }
    }
}

#[test]
fn text_that_is_neither_comment_nor_statement_is_not_let_through() {
    let load = turned_box();
    for language in ALL {
        let plain = language.write(&load, "tool0", &[]).unwrap();
        assert!(language.says_only(&plain, &plain));
        for before in ["movej([0])\n", "\n", "# a\nb\n", "// a \\\n"] {
            assert!(!language.says_only(&format!("{before}{plain}"), &plain), "{language:?} {before:?}");
        }
        assert!(!language.says_only(&format!("{plain}movej([0])\n"), &plain));
    }
}
