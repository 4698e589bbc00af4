//! Written models are read again with the same inverse dynamics, and a retained file stays as it is.

use nalgebra::{Rotation3, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::spatial::{Body, Position};
use rigident_shared::tree::{BaseMotion, Joint, Link};

use super::dynamics::inverse_dynamics;
use super::inertial::in_parent;
use super::tree::{ModelLink, RawLink};
use super::xml::Language;
use super::*;

const LANGUAGES: [Language; 3] = [Language::Urdf, Language::Mjcf, Language::Sdf];

fn number(k: usize) -> f64 {
    ((k * k * 31 + k * 17 + 5) as f64).sin()
}

fn link(n: usize, parent: usize, joint: Joint<f64>) -> ModelLink {
    let phi = [2.0, 0.2, -0.1, 0.4, 0.5, 0.6, 0.4, 0.01, -0.02, 0.03];
    // The fifth one upright, where roll and yaw are one.
    let angles = if n == 5 {
        [0.3, std::f64::consts::FRAC_PI_2, 0.0]
    } else {
        [number(n), number(n + 1), number(n + 2)]
    };
    let rotation = Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).into_inner();
    ModelLink::new(
        format!("l{n}"),
        if n == 0 { String::new() } else { format!("j{n}") },
        Link { parent, joint, rotation, position: Vector3::new(number(n + 5), number(n + 6), number(n + 7)) },
        Some(in_parent(&phi, &rotation, &(Vector3::new(0.1, 0.05, -0.1) * number(n)))),
    )
}

/// Returns a model with every kind of joint that has words in all three languages.
fn model() -> Model {
    let skew = Vector3::new(0.3, -0.5, 0.7).normalize();
    let other = Vector3::new(0.2, 0.9, 0.1).normalize();
    Model {
        name: "t & \"t\"".to_owned(),
        links: vec![
            link(0, 0, Joint::Free),
            link(1, 0, Joint::Revolute(skew)),
            link(2, 1, Joint::Prismatic(skew)),
            link(3, 2, Joint::Universal(other, skew)),
            link(4, 3, Joint::Fixed),
            link(5, 4, Joint::Spherical),
            link(6, 0, Joint::Revolute(-Vector3::y())),
        ],
        findings: Vec::new(),
        gravity_mps2: None,
    }
}

/// Returns base wrench and efforts by joint. Those of a universal joint are one list, for files that make two
/// joints of it.
fn forces(model: &Model, states: usize) -> Vec<Vec<f64>> {
    (0..states)
        .map(|s| {
            let mut q = Vec::new();
            let mut at = 0;
            for link in model.links.iter().skip(1) {
                let joint = &link.link.joint;
                if *joint == Joint::Spherical {
                    let v = Vector3::new(number(at + s), number(at + s + 1), number(at + s + 2));
                    let ball = nalgebra::UnitQuaternion::from_scaled_axis(v);
                    q.extend([ball.w, ball.i, ball.j, ball.k]);
                } else {
                    q.extend((0..joint.coordinates()).map(|k| number(at + k + 10 * s)));
                }
                at += joint.freedoms();
            }
            let rates: Vec<f64> = (0..at).map(|k| number(k + 20 * s + 3)).collect();
            let accelerations: Vec<f64> = (0..at).map(|k| number(k + 30 * s + 7)).collect();
            let base = BaseMotion {
                specific_force: Vector3::new(number(s), 2.0, 9.0),
                rate: Vector3::new(0.1, number(s + 1), 0.3),
                angular_acceleration: Vector3::new(0.5, -0.2, number(s + 2)),
            };
            inverse_dynamics(model, &base, &q, &rates, &accelerations).unwrap()
        })
        .collect()
}

/// Returns the largest difference of inverse dynamics over the largest force.
fn difference(a: &Model, b: &Model) -> f64 {
    let (a, b) = (forces(a, 5).concat(), forces(b, 5).concat());
    assert_eq!(a.len(), b.len());
    let scale = a.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    a.iter().zip(&b).fold(0.0_f64, |m, (x, y)| m.max((x - y).abs())) / scale
}

#[test]
fn inverse_dynamics_of_written_models_agree_in_every_language() {
    let model = model();
    for language in LANGUAGES {
        let text = write::generated(&model, language).unwrap();
        let again = write::parse(&text, "again").unwrap();
        assert!(
            again.model.findings.iter().all(|f| f.text.starts_with("has no mass")),
            "{:?}",
            again.model.findings
        );
        let off = difference(&model, &again.model);
        assert!(off < 1e-9, "{language:?}: {off:e}");
        // And from there into every other language.
        for other in LANGUAGES {
            let text = write::generated(&again.model, other).unwrap();
            let third = write::parse(&text, "third").unwrap().model;
            assert!(difference(&model, &third) < 1e-9, "{language:?} {other:?}");
        }
    }
}

const URDF: &str = r#"<?xml version="1.0"?>
<!-- kept -->
<robot name="r">
  <material name="grey"/>
  <link name="a"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="b"/>
  <link name="c">
    <inertial><origin xyz="0.1 0 0" rpy="0.1 0.2 0.3"/><mass value="2"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1.5" iyz="0" izz="1.2"/></inertial>
  </link>
  <joint name="ab" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/></joint>
  <joint name="bc" type="revolute"><parent link="b"/><child link="c"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>
"#;

/// Degrees, Euler angles, a default class, a joint off its body's origin, two joints on one body.
const MJCF: &str = r#"<mujoco model="m">
  <default><default class="side"><joint axis="0 1 0"/></default></default>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="a" pos="0 0 1" euler="0 0 90">
      <joint name="ja" type="hinge" pos="0.1 0.2 0.3" class="side"/>
      <inertial pos="0.1 0 0" mass="2" quat="0.6 0.8 0 0" diaginertia="1 1.5 1.2"/>
      <body name="b" pos="0.5 0 0">
        <joint name="b1" axis="1 0 0"/>
        <joint name="b2" axis="0 0 1" pos="0 0 0.2"/>
        <inertial pos="0 0.1 0" mass="1" fullinertia="0.5 0.6 0.4 0.01 0.02 0.03"/>
      </body>
      <body name="tip" pos="0 0 1"/>
    </body>
  </worldbody>
</mujoco>
"#;

const SDF: &str = r#"<sdf version="1.9"><model name="s">
  <link name="a"><pose>0 0 1 0 0 1.5707963267948966</pose></link>
  <link name="b"><pose relative_to="a">0.5 0 0 0 0 0</pose>
    <inertial><pose>0 0.1 0 0.3 0 0</pose><mass>1</mass><inertia><ixx>0.5</ixx><iyy>0.6</iyy><izz>0.4</izz><ixy>0.01</ixy></inertia></inertial>
  </link>
  <joint name="world_a" type="fixed"><parent>world</parent><child>a</child></joint>
  <joint name="ab" type="revolute"><pose>0 0 0.2 0.1 0 0</pose><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint>
</model></sdf>
"#;

#[test]
fn files_are_kept_but_for_their_inertias() {
    for (text, name, kept) in [
        (URDF, "c", ["<!-- kept -->", "<material name=\"grey\"/>", "lower=\"-1\""]),
        (MJCF, "b", ["<geom type=\"plane\"", "class=\"side\"", "euler=\"0 0 90\""]),
        (SDF, "b", ["<pose relative_to=\"a\">", "world_a", "<xyz>0 0 1</xyz>"]),
    ] {
        let parsed = write::parse(text, "given").unwrap();
        let phi = in_parent(
            &[2.0, 0.2, -0.1, 0.4, 0.5, 0.6, 0.4, 0.01, -0.02, 0.03],
            &Rotation3::from_euler_angles(0.3, 0.2, 0.1).into_inner(),
            &Vector3::new(0.1, 0.2, 0.3),
        );
        // One that had an inertia and, where there is one, one that had none.
        let new = [(name, phi), ("a", phi)];
        let wanted = write::with_parameters(&parsed.model, new.into_iter());
        let edited = write::edited(&wanted, text, "edited").unwrap();
        for part in kept {
            assert!(edited.contains(part), "{edited}");
        }
        let again = write::parse(&edited, "edited").unwrap().model;
        assert!(difference(&wanted, &again) < 1e-9, "{}", difference(&wanted, &again));
        assert!(difference(&parsed.model, &again) > 1e-3);
    }
}

/// By hand: where the anchors put the joints.
#[test]
fn joints_off_their_bodies_origins_are_where_the_file_has_them() {
    let mjcf = write::parse(MJCF, "m").unwrap();
    let names: Vec<&str> = mjcf.model.links.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["world", "a", "b#1", "b", "tip"]);
    assert_eq!(mjcf.anchors["a"], Vector3::new(0.1, 0.2, 0.3));
    // The body is turned by 90° about z: its (0.1, 0.2, 0.3) is (−0.2, 0.1, 0.3) of the world.
    let a = &mjcf.model.links[1].link;
    assert!((a.position - Vector3::new(-0.2, 0.1, 1.3)).norm() < 1e-15);
    assert_eq!(a.joint, Joint::Revolute(Vector3::y()));
    assert!((mjcf.model.links[2].link.position - Vector3::new(0.4, -0.2, -0.3)).norm() < 1e-15);
    // φ about the anchor: the centre of mass is at (0.1, 0, 0) of the body.
    let phi = mjcf.model.links[1].nominal.unwrap();
    assert!((Vector3::new(phi[1], phi[2], phi[3]) - Vector3::new(0.0, -0.4, -0.6)).norm() < 1e-15);
    let sdf = write::parse(SDF, "s").unwrap();
    let b = &sdf.model.links[2].link;
    assert!((b.position - Vector3::new(0.5, 0.0, 0.2)).norm() < 1e-15, "{}", b.position);
    let Joint::Revolute(axis) = b.joint else { panic!("{:?}", b.joint) };
    // Turned by 0.1 about x against the link.
    assert!((axis - Vector3::new(0.0, -(0.1_f64.sin()), 0.1_f64.cos())).norm() < 1e-15);
}

#[test]
fn files_that_cannot_be_followed_are_named() {
    let said = |text: &str| write::parse(text, "x").unwrap_err().to_string();
    let included = said(&MJCF.replace("<worldbody>", "<include file=\"y.xml\"/><worldbody>"));
    assert!(included.contains("<include> of y.xml") && included.contains("beside the file"), "{included}");
    assert!(said(&MJCF.replace("mass=\"1\"", "mass=\"heavy\"")).contains("mass of <inertial>"));
    assert!(
        said(&SDF.replace("relative_to=\"a\"", "relative_to=\"z\""))
            .contains("relative to z, which is not there")
    );
    assert!(said(&SDF.replace("type=\"revolute\"", "type=\"screw\"")).contains("\"screw\""));
    assert!(said(&SDF.replace("<child>b</child>", "<child>a</child>")).contains("both hold link a"));
    assert!(said("<sdf version=\"1.9\"/>").contains("no <model>"));
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("out.urdf");
    std::fs::write(&path, "").unwrap();
    assert!(write::check_target(&path).unwrap_err().to_string().contains("nothing is overwritten"));
    assert!(
        write::check_target(&place.path().join("out.txt"))
            .unwrap_err()
            .to_string()
            .contains("must end in .urdf")
    );
}

#[test]
fn strange_inertias_of_other_people_s_files_are_found() {
    let place = tempfile::tempdir().unwrap();
    let found = |name: &str, text: &str| -> Vec<String> {
        let path = place.path().join(name);
        std::fs::write(&path, text).unwrap();
        checked(&path).findings.iter().map(ToString::to_string).collect()
    };
    let link = |name: &str, com: &str, inertia: [f64; 3], size: &str| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"{com}\"/><mass value=\"2\"/><inertia ixx=\"{}\" \
             iyy=\"{}\" izz=\"{}\" ixy=\"0.001\" ixz=\"0\" iyz=\"0\"/></inertial><collision><origin xyz=\"0 \
             0 0.1\"/><geometry><box size=\"{size}\"/></geometry></collision></link>",
            inertia[0], inertia[1], inertia[2]
        )
    };
    let robot = |a: String, left: String, right: String| {
        format!(
            "<robot name=\"r\">{a}{left}{right}<joint name=\"jl\" type=\"continuous\"><origin xyz=\"0 0.2 \
             0.3\"/><parent link=\"a\"/><child link=\"l_arm\"/></joint><joint name=\"jr\" \
             type=\"continuous\"><origin xyz=\"0 -0.2 0.3\"/><parent link=\"a\"/><child \
             link=\"r_arm\"/></joint></robot>"
        )
    };
    let good = [0.01, 0.012, 0.008];
    let (a, left) =
        (link("a", "0 0 0.1", good, "0.2 0.2 0.3"), link("l_arm", "0 0.05 0.1", good, "0.2 0.2 0.3"));
    let right = link("r_arm", "0 -0.05 0.1", good, "0.2 0.2 0.3").replace("ixy=\"0.001\"", "ixy=\"-0.001\"");
    assert_eq!(found("good.urdf", &robot(a.clone(), left.clone(), right.clone())), Vec::<String>::new());
    let copied = found("copied.urdf", &robot(a.clone(), left.clone(), left.replace("l_arm", "r_arm")));
    assert!(
        copied.len() == 1 && copied[0].starts_with("link r_arm: has the very numbers of l_arm"),
        "{copied:?}"
    );
    let triangle = link("a", "0 0 0.1", [0.01, 0.01, 0.03], "0.2 0.2 0.3");
    let said = found("triangle.urdf", &robot(triangle, left.clone(), right.clone()));
    assert!(said.iter().any(|s| s.contains("largest exceeds the sum of the others")), "{said:?}");
    let grams = link("a", "0 0 0.1", good.map(|v| v * 1e6), "0.2 0.2 0.3");
    let said = found("grams.urdf", &robot(grams, left.clone(), right.clone()));
    assert!(said.iter().any(|s| s.contains("is the tensor in kg m²")), "{said:?}");
    let outside = link("a", "0 0.25 0.1", good, "0.2 0.2 0.3");
    let said = found("outside.urdf", &robot(outside, left.clone(), right.clone()));
    assert!(said.len() == 1 && said[0].contains("0.150 m outside of the box"), "{said:?}");
    // The tensor about the origin, of something far from it, is more than anything inside the box has.
    let origin = link("a", "0 0 0.1", good, "0.02 0.02 0.03");
    let said = found("origin.urdf", &robot(origin, left, right));
    assert!(
        said.iter().any(|s| s.contains("about the link's origin and not about the centre of mass")),
        "{said:?}"
    );
    let unit = MJCF.replace(
        "mass=\"2\" quat=\"0.6 0.8 0 0\" diaginertia=\"1 1.5 1.2\"",
        "mass=\"1\" diaginertia=\"1 1 1\"",
    );
    let said = found("unit.xml", &unit);
    assert!(said.iter().any(|s| s.contains("placeholder")), "{said:?}");
    let flat = SDF.replace("<izz>0.4</izz>", "<izz>1.4</izz>");
    assert!(found("flat.sdf", &flat).iter().any(|s| s.starts_with("link b: no distribution of mass")));
}

/// Reads a model from a file and checks it.
fn checked(path: &Path) -> check::Checked {
    let (model, text) = read_file(path).unwrap();
    check::check(&model, Some(&text), path)
}

fn tables() -> Model {
    let link =
        |name: &str, joint: Joint<f64>, position: [f64; 3], mass: f64, com: [f64; 3], tensor: [f64; 3]| {
            let tensor = nalgebra::Matrix3::from_diagonal(&Vector3::from(tensor));
            let body =
                InertialParameters::<Body, f64>::from_centre_of_mass(mass, Position::from_array(com), tensor);
            let link =
                Link { parent: 0, joint, rotation: nalgebra::Matrix3::identity(), position: position.into() };
            let joint = if name == "base" { String::new() } else { name.to_owned() };
            RawLink {
                link: ModelLink::new(name.to_owned(), joint, link, Some(body.to_vector())),
                parent: (name != "base").then(|| "base".to_owned()),
            }
        };
    let base = link("base", Joint::Free, [0.0; 3], 6.0, [0.02, 0.03, 0.12], [0.03, 0.09, 0.09]);
    let arm = link("arm", Joint::Spherical, [0.03, 0.0, 0.065], 2.0, [0.0, 0.0, 0.15], [0.01, 0.01, 0.015]);
    Model::assemble("two", vec![base, arm], Vec::new()).unwrap()
}

#[test]
fn links_of_tables_are_written_in_every_language_and_look_well() {
    let place = tempfile::tempdir().unwrap();
    let model = tables();
    for name in ["w.urdf", "w.xml", "w.sdf"] {
        let path = place.path().join(name);
        write::write(&model, None, &path).unwrap();
        let checked = checked(&path);
        assert_eq!(checked.findings, [], "{name}");
        assert_eq!(checked.name, "two");
        let again = write::parse(&std::fs::read_to_string(&path).unwrap(), name).unwrap().model;
        assert!(difference(&model, &again) < 1e-9);
    }
    let said =
        remarks::remarks(&model, None, &place.path().join("n.sdf"), &["arm=0.3".to_owned()]).join("\n");
    assert!(said.contains("fixed in it: arm=0.3") && said.contains("arm is arm_joint"), "{said}");
    let said = remarks::remarks(&model, None, &place.path().join("n.urdf"), &[]).join("\n");
    assert!(said.contains("type=\"spherical\" of arm is an extension") && said.contains("urdfdom"), "{said}");
    assert!(!said.contains("fixed"), "{said}");
    let nowhere = place.path().join("none").join("w.urdf");
    assert!(write::check_target(&nowhere).unwrap_err().to_string().contains("its folder is not there"));
    // A file that is retained keeps all of it.
    let urdf = place.path().join("w.urdf");
    assert!(
        remarks::remarks(&model, Some(&urdf), &place.path().join("n.urdf"), &["arm".to_owned()]).is_empty()
    );
}

#[test]
fn followers_and_frames_without_mass_are_written() {
    let mimic = URDF.replace(
        "<axis xyz=\"1 0 0\"/>",
        "<axis xyz=\"1 0 0\"/><mimic joint=\"ab\" multiplier=\"-0.5\" offset=\"0.1\"/>",
    );
    let model = write::parse(&mimic, "m").unwrap().model;
    let again = write::parse(&write::generated(&model, Language::Urdf).unwrap(), "again").unwrap().model;
    assert_eq!(again.links[2].mimic, model.links[2].mimic);
    assert!(again.links[2].mimic.is_some());
    let frames = write::parse(MJCF, "m").unwrap().model;
    let text = write::generated(&frames, Language::Mjcf).unwrap();
    let tip = text.split("<body name=\"tip\"").nth(1).unwrap();
    assert!(tip.contains("mass=\"0\""), "every body has an <inertial>: {text}");
    let again = write::parse(&text, "again").unwrap().model;
    assert_eq!(again.links[again.link("tip").unwrap()].nominal, None);
}

/// Flange and tool frame have no mass; the base has that of the link that is fixed to it; the whole is that
/// of the model.
#[test]
fn links_without_mass_weigh_nothing_in_sdf() {
    let body = "<inertial><origin xyz=\"0.1 0.2 0\"/><mass value=\"2\"/><inertia ixx=\"0.1\" ixy=\"0\" \
                ixz=\"0\" iyy=\"0.12\" iyz=\"0.01\" izz=\"0.1\"/></inertial>";
    let fixed = |name: &str, parent: &str, child: &str| {
        format!(
            "<joint name=\"{name}\" type=\"fixed\"><origin xyz=\"0.1 0 0.3\" rpy=\"0.2 0.1 0.4\"/><parent \
             link=\"{parent}\"/><child link=\"{child}\"/></joint>"
        )
    };
    let urdf = |foot: &str| {
        format!(
            "<robot name=\"r\"><link name=\"base\"/><link name=\"foot\">{foot}</link><link \
             name=\"arm\">{body}</link><link name=\"flange\"/><link name=\"tool\"/><link \
             name=\"hand\">{body}</link>{}{}{}{}<joint name=\"turn\" type=\"continuous\"><origin xyz=\"0 0 \
             0.5\"/><parent link=\"foot\"/><child link=\"arm\"/><axis xyz=\"0 1 0\"/></joint></robot>",
            fixed("f0", "base", "foot"),
            fixed("f1", "arm", "flange"),
            fixed("f2", "flange", "tool"),
            fixed("f3", "tool", "hand"),
        )
    };
    let place = tempfile::tempdir().unwrap();
    for (name, foot, links) in [("heavy.sdf", body, 3), ("light.sdf", "", 3)] {
        let model = write::parse(&urdf(foot), "r").unwrap().model;
        let path = place.path().join(name);
        write::write(&model, None, &path).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.matches("<link ").count(), links, "{text}");
        let is_fixed = text.contains("<parent>world</parent>");
        assert_eq!(text.matches("<inertial>").count(), links - usize::from(is_fixed), "{text}");
        assert_eq!(is_fixed, foot.is_empty());
        for frame in ["flange", "tool", "foot"] {
            assert!(text.contains(&format!("<frame name=\"{frame}\" attached_to=")), "{text}");
        }
        let again = write::parse(&text, name).unwrap().model;
        assert!(difference(&model.welded(), &again.welded()) < 1e-12);
        let said = remarks::remarks(&model, None, &path, &[]).join("\n");
        assert!(said.contains("tool, flange, ") && said.contains("became frames"), "{said}");
        assert_eq!(said.contains("base, a base without mass, is fixed to the world"), is_fixed, "{said}");
    }
    // One that moves has no place in it.
    let moving = urdf(body).replace(&format!("<link name=\"arm\">{body}</link>"), "<link name=\"arm\"/>");
    let model = write::parse(&moving, "r").unwrap().model;
    let refused = write::write(&model, None, &place.path().join("m.sdf")).unwrap_err().to_string();
    assert!(refused.contains("link arm moves and has no inertia"), "{refused}");
}

#[test]
fn bodies_denser_or_thinner_than_anything_are_found_and_copies_turned_about_are_not() {
    let place = tempfile::tempdir().unwrap();
    let found = |mass: f64, moment: f64, turn: &str| -> Vec<String> {
        let link = |name: &str, mass: f64, i: f64| {
            format!(
                "<link name=\"{name}\"><inertial><origin xyz=\"0.02 0 0.03\"/><mass \
                 value=\"{mass}\"/><inertia ixx=\"{i}\" iyy=\"{i}\" izz=\"{i}\" ixy=\"{}\" ixz=\"0\" \
                 iyz=\"0\"/></inertial></link>",
                0.1 * i
            )
        };
        let joint = |child: &str, y: f64, turn: &str| {
            format!(
                "<joint name=\"j_{child}\" type=\"continuous\"><origin xyz=\"0 {y} 0.3\" \
                 rpy=\"{turn}\"/><parent link=\"a\"/><child link=\"{child}\"/></joint>"
            )
        };
        let text = format!(
            "<robot name=\"r\">{}{}{}{}{}</robot>",
            link("a", mass, moment),
            link("left_f", 0.5, 1e-3),
            link("right_f", 0.5, 1e-3),
            joint("left_f", 0.1, "0 0 0"),
            joint("right_f", -0.1, turn)
        );
        let path = place.path().join("r.urdf");
        std::fs::write(&path, text).unwrap();
        checked(&path).findings.iter().map(ToString::to_string).collect()
    };
    let upside = "0 0 3.14159265358979";
    assert_eq!(found(2.0, 0.01, upside), Vec::<String>::new());
    assert!(found(2.0, 0.01, "0 0 0")[0].starts_with("link right_f: has the very numbers of left_f"));
    // A ball of osmium of 2 kg: I = 2/5 m r², ρ = m / (4/3 π r³).
    let radius = (2.0_f64 / (22_590.0 * 4.0 / 3.0 * std::f64::consts::PI)).cbrt();
    let least = 0.4 * 2.0 * radius * radius;
    let denser = found(2.0, least * 0.9, upside);
    assert!(
        denser.len() == 1 && denser[0].starts_with("link a: ") && denser[0].contains("denser than osmium"),
        "{denser:?}"
    );
    assert_eq!(found(2.0, least * 1.1, upside), Vec::<String>::new());
    assert!(found(1000.0, 0.01, upside)[0].contains("denser than osmium"));
    assert!(found(1.0, 1e-8, upside)[0].contains("denser than osmium"));
    assert!(found(2.0, 1e4, upside)[0].contains("a cloud"));
    let massless = found(0.0, 0.01, upside);
    assert!(
        massless.len() == 1 && massless[0].contains("no mass") && !massless[0].contains("NaN"),
        "{massless:?}"
    );
}

/// A URDF that is retained, with a joint that turns and one that slides, its zeros moved.
#[test]
fn zeros_of_joints_that_were_moved_are_written_and_all_else_is_kept() {
    let text = r#"<robot name="r"><!-- kept --><link name="a"/><link name="b"/><link name="c"/>
  <joint name="turn" type="revolute"><origin xyz="0.1 0.2 0.3" rpy="0.3 -0.4 0.5"/><axis xyz="0 0.6 0.8"/><parent link="a"/><child link="b"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><axis xyz="1 0 0"/><parent link="b"/><child link="c"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"#;
    let model = write::parse(text, "r").unwrap().model;
    let unmoved = write::edited(&model, text, "r").unwrap();
    assert_eq!(unmoved, text);
    let mut moved = model.clone();
    for (joint, by) in [("turn", 0.07), ("slide", -0.02)] {
        let i = moved.joint(joint).unwrap();
        moved.move_zero(i, by);
    }
    let written = write::edited(&moved, text, "r").unwrap();
    assert!(written.contains("<!-- kept -->") && written.contains("upper=\"1\""), "{written}");
    let again = write::parse(&written, "r").unwrap().model;
    super::joint_edits::check(&moved, &written, "r").unwrap();
    assert!(super::joint_edits::check(&model, &written, "r").is_err());
    // The turned joint is at zero where it was at 0.07 before.
    let turn = nalgebra::Rotation3::new(Vector3::new(0.0, 0.6, 0.8) * 0.07).into_inner();
    let [i, k] = ["turn", "slide"].map(|joint| model.joint(joint).unwrap());
    let off = again.links[i].link.rotation - model.links[i].link.rotation * turn;
    assert!(off.amax() < 1e-14, "{off}");
    assert!((again.links[k].link.position - Vector3::new(-0.02, 0.0, 0.0)).amax() < 1e-15);
}
