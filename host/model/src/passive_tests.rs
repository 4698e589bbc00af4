//! Rotors, friction and springs of joints are read, stored and written.

use super::passive::Passive;
use super::xml::Language;
use super::*;

const NONE: Passive =
    Passive { armature: 0.0, damping: 0.0, friction: 0.0, stiffness: 0.0, spring_reference: 0.0 };

/// In degrees, with classes: a hinge with an own word beside its class's, a slide, two hinges of one body, a
/// ball.
const MJCF: &str = r#"<mujoco model="m"><compiler angle="degree"/>
  <default><joint armature="0.01"/><default class="soft"><joint stiffness="20" springref="90" damping="0.5"/></default></default>
  <worldbody><body name="a"><joint name="ja" class="soft" damping="0.25" ref="30"/>
    <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/>
    <body name="b"><joint name="jb" type="slide" stiffness="7" springref="0.5" frictionloss="3"/>
      <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/>
      <body name="c"><joint name="c1" axis="1 0 0" damping="1"/><joint name="c2" axis="0 1 0" armature="0" damping="2"/>
        <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/>
        <body name="d"><joint name="jd" type="ball" damping="0.125" stiffness="4"/>
          <inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/>
  </body></body></body></body></worldbody></mujoco>"#;

fn of(model: &Model, joint: &str) -> Passive {
    let link = &model.links[model.joint(joint).unwrap()];
    assert_eq!(link.passive[1], NONE);
    link.passive[0]
}

fn model() -> Model {
    mjcf::parse(MJCF, "m.xml").unwrap().model
}

fn findings(model: &Model, place: &str) -> String {
    let own = model.findings.iter().filter(|finding| finding.place == place);
    own.map(|finding| finding.text.as_str()).collect::<Vec<_>>().join("\n")
}

/// Returns what each joint has, less what a change takes away.
fn all(change: impl Fn(Passive) -> Passive) -> Vec<Passive> {
    ["ja", "jb", "c1", "c2", "jd"].map(|joint| change(of(&model(), joint))).to_vec()
}

#[test]
fn rotors_friction_and_springs_of_mjcf_are_read_with_their_classes() {
    let model = model();
    let turned = of(&model, "ja");
    // Positions count as the file has them: 0 is 30° before the pose of its bodies.
    assert!((turned.spring_reference - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    let without = Passive { spring_reference: 0.0, ..turned };
    assert_eq!(without, Passive { armature: 0.01, damping: 0.25, stiffness: 20.0, ..NONE });
    let slide = Passive { armature: 0.01, friction: 3.0, stiffness: 7.0, spring_reference: 0.5, ..NONE };
    assert_eq!(of(&model, "jb"), slide);
    assert_eq!(of(&model, "c1"), Passive { armature: 0.01, damping: 1.0, ..NONE });
    assert_eq!(of(&model, "c2"), Passive { damping: 2.0, ..NONE });
    assert_eq!(of(&model, "jd"), Passive { armature: 0.01, damping: 0.125, stiffness: 4.0, ..NONE });
    // Hinges and slides have columns of theirs.
    assert_eq!(findings(&model, "joint jb"), "");
    let said = findings(&model, "joint jd");
    assert!(said.contains("armature, damping, stiffness: there are no columns of a ball"), "{said}");
}

#[test]
fn attributes_that_a_language_has_are_written() {
    let kept: [(Language, Vec<Passive>); 3] = [
        (Language::Mjcf, all(|p| p)),
        (Language::Urdf, {
            // No transmission turns a ball.
            let mut own = all(|p| Passive { stiffness: 0.0, spring_reference: 0.0, ..p });
            own[4].armature = 0.0;
            own
        }),
        (Language::Sdf, {
            // Two axes of one joint have no rotors there, and the ball has no axis.
            let mut own = all(|p| p);
            (own[2].armature, own[4]) = (0.0, NONE);
            own
        }),
    ];
    for (language, wanted) in kept {
        let text = write::generated(&model(), language).unwrap();
        let again = write::parse(&text, "again").unwrap().model;
        // Hinges c1 and c2 may be the axes of one universal joint.
        let got: Vec<Passive> =
            again.links.iter().flat_map(|link| link.passive).filter(|p| *p != NONE).collect();
        let wanted: Vec<Passive> = wanted.into_iter().filter(|p| *p != NONE).collect();
        assert_eq!(got, wanted, "{language:?}: {text}");
    }
}

#[test]
fn universal_joints_keep_both_axes_in_every_language() {
    let text = write::generated(&model(), Language::Sdf).unwrap();
    let universal = write::parse(&text, "u.sdf").unwrap().model;
    let c = &universal.links[universal.link("c").unwrap()];
    assert!(matches!(c.link.joint, rigident_shared::tree::Joint::Universal(..)), "{text}");
    assert_eq!(c.passive.map(|p| p.damping), [1.0, 2.0]);
    for language in [Language::Urdf, Language::Mjcf, Language::Sdf] {
        let text = write::generated(&universal, language).unwrap();
        let again = write::parse(&text, "again").unwrap().model;
        let damped: Vec<f64> = again
            .links
            .iter()
            .flat_map(|link| link.passive.map(|p| p.damping))
            .filter(|d| *d != 0.0)
            .collect();
        assert_eq!(damped, [0.25, 1.0, 2.0], "{language:?}: {text}");
    }
}

#[test]
fn a_file_is_written_and_its_losses_are_reported() {
    let place = tempfile::tempdir().unwrap();
    for (name, lost) in
        [("w.urdf", Some("of ja, jb, jd; write")), ("w.xml", None), ("w.sdf", Some("of c2, jd; write"))]
    {
        let path = place.path().join(name);
        write::write(&model(), None, &path).unwrap();
        let said = remarks::remarks(&model(), None, &path, &[]).join("\n");
        assert_eq!(said.contains("no words for all rotors"), lost.is_some(), "{said}");
        assert!(lost.is_none_or(|joints| said.contains(joints)), "{name}: {said}");
        // What readers pass over is in a table of its own, and named.
        let table = place.path().join(format!("{name}.joints.yaml"));
        assert_eq!(table.exists(), lost.is_some());
        if table.exists() {
            let text = std::fs::read_to_string(&table).unwrap();
            assert!(text.contains("\narmature:\n  \"ja\": 0.01\n  \"jb\": 0.01\n"), "{text}");
            assert!(text.contains("stiffness:\n  \"ja\": 20\n"), "{text}");
            assert!(
                said.contains("rotors of ja, jb") && said.contains(&format!("{name}.joints.yaml")),
                "{said}"
            );
            let again = write::check_target(&path).unwrap_err().to_string();
            assert!(again.contains("there already"), "{again}");
        }
    }
}

/// By Drake's documents a joint feels `gear_ratio² · rotor_inertia` of its actuator.
#[test]
fn rotors_of_drake_s_words_are_read_and_kept_with_their_gear() {
    let text = "<robot name=\"r\" xmlns:drake=\"http://drake.mit.edu\"><link name=\"a\"/><link \
                name=\"b\"/><link name=\"c\"/><joint name=\"ja\" type=\"continuous\"><parent \
                link=\"a\"/><child link=\"b\"/></joint><joint name=\"jb\" type=\"prismatic\"><parent \
                link=\"b\"/><child link=\"c\"/></joint><transmission \
                name=\"t\"><type>transmission_interface/SimpleTransmission</type><joint \
                name=\"ja\"/><actuator name=\"m\"><drake:gear_ratio value=\"30\"/><drake:rotor_inertia \
                value=\"0.002\"/></actuator></transmission></robot>";
    let own = write::parse(text, "r.urdf").unwrap().model;
    assert!((of(&own, "ja").armature - 1.8).abs() < 1e-15);
    assert_eq!(of(&own, "jb"), NONE);
    let new = |armature: f64| Passive { armature, ..NONE };
    let wanted = write::with_passive(&own, [("ja", new(0.7)), ("jb", new(3.0))].into_iter());
    let place = tempfile::tempdir().unwrap();
    let (source, path) = (place.path().join("r.urdf"), place.path().join("w.urdf"));
    std::fs::write(&source, text).unwrap();
    write::write(&wanted, Some(&source), &path).unwrap();
    let written = std::fs::read_to_string(&path).unwrap();
    assert!(written.contains("<drake:gear_ratio value=\"30\"/>"), "{written}");
    let again = write::parse(&written, "w.urdf").unwrap().model;
    assert!((of(&again, "ja").armature - 0.7).abs() < 1e-15 && of(&again, "jb").armature == 3.0, "{written}");
    // And what has no such word is given the namespace.
    let bare = text.replace(" xmlns:drake=\"http://drake.mit.edu\"", "");
    let bare = bare.split("<transmission").next().unwrap().to_owned() + "</robot>";
    let written = write::edited(&wanted, &bare, "b.urdf").unwrap();
    assert!(written.starts_with("<robot name=\"r\" xmlns:drake=\"http://drake.mit.edu\">"), "{written}");
    assert_eq!(of(&write::parse(&written, "b.urdf").unwrap().model, "jb").armature, 3.0);
}

#[test]
fn friction_of_urdf_and_springs_of_sdf_are_read() {
    let urdf = |dynamics: &str, kind: &str| {
        format!(
            "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><joint name=\"j\" type=\"{kind}\"><parent \
             link=\"a\"/><child link=\"b\"/>{dynamics}</joint></robot>"
        )
    };
    let read = |dynamics: &str, kind: &str| urdf::parse(&urdf(dynamics, kind), "r.urdf");
    let both = "<dynamics damping=\"0.5\" friction=\" 2 \"/>";
    assert_eq!(of(&read(both, "continuous").unwrap(), "j"), Passive { damping: 0.5, friction: 2.0, ..NONE });
    assert_eq!(of(&read(both, "fixed").unwrap(), "j"), NONE);
    assert_eq!(of(&read("<dynamics/>", "continuous").unwrap(), "j"), NONE);
    let refused = read("<dynamics damping=\"some\"/>", "continuous").unwrap_err();
    assert!(matches!(refused, ModelError::Syntax { .. }), "{refused}");
    let refused = read("<dynamics damping=\"nan\"/>", "continuous").unwrap_err();
    assert!(matches!(refused, ModelError::Structure { .. }), "{refused}");
    let driven = read("<dynamics friction=\"-1\"/>", "continuous").unwrap();
    assert!(findings(&driven, "joint j").contains("negative"));
    let sdf = "<sdf version=\"1.9\"><model name=\"s\"><link name=\"a\"/><link name=\"b\"/><joint name=\"j\" \
               type=\"revolute\"><parent>a</parent><child>b</child><axis><xyz>0 0 \
               1</xyz><dynamics><damping>0.5</damping><friction>2</friction><spring_reference>0.25</spring_reference><spring_stiffness>8</spring_stiffness></dynamics></axis></joint></model></sdf>";
    let wanted =
        Passive { armature: 0.0, damping: 0.5, friction: 2.0, stiffness: 8.0, spring_reference: 0.25 };
    assert_eq!(of(&sdf::parse(sdf, "s.sdf").unwrap().model, "j"), wanted);
}

#[test]
fn unread_attributes_of_mjcf_are_reported() {
    let powers = MJCF.replace("damping=\"0.25\"", "damping=\"0.25 0 0.1\" springdamper=\"1 0.5\"");
    let model = mjcf::parse(&powers, "m.xml").unwrap().model;
    assert_eq!(of(&model, "ja").damping, 0.25);
    assert!(findings(&model, "joint ja").contains("damping, springdamper"), "{:?}", model.findings);
    let empty = MJCF.replace("damping=\"0.25\"", "damping=\"\"");
    assert!(matches!(mjcf::parse(&empty, "m.xml"), Err(ModelError::Structure { .. })));
}

#[test]
fn joints_that_are_locked_or_made_a_ball_lose_their_attributes() {
    let mut locked = model();
    locked.lock(&["ja=0.5".to_owned()]).unwrap();
    assert_eq!(of(&locked, "ja"), NONE);
    let hinge = |name: &str, axis: &str| format!("<joint name=\"{name}\" axis=\"{axis}\" damping=\"1\"/>");
    let hinges = hinge("x", "1 0 0") + &hinge("y", "0 1 0") + &hinge("z", "0 0 1");
    let three = MJCF.replace("<joint name=\"jd\" type=\"ball\" damping=\"0.125\" stiffness=\"4\"/>", &hinges);
    let mut ball = mjcf::parse(&three, "m.xml").unwrap().model;
    ball.declare_spherical(&["x", "y", "z"].map(str::to_owned)).unwrap();
    assert_eq!(of(&ball, "z"), NONE);
    assert!(findings(&ball, "joint z").contains("left out"));
}

/// Joints j and k of a URDF and an SDF, axes and hinges with and without words of their own.
const KEPT: [(&str, &str); 3] = [
    (
        "k.urdf",
        "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>\n<!-- kept --><joint \
         name=\"ja\" type=\"revolute\"><parent link=\"a\"/><child link=\"b\"/><limit lower=\"-1\" \
         upper=\"1\" effort=\"9\" velocity=\"3\"/><dynamics friction = '0.5' spring=\"kept\" \
         /></joint><joint name=\"jb\" type=\"continuous\"><parent link=\"b\"/><child \
         link=\"c\"/></joint></robot>",
    ),
    (
        "k.sdf",
        "<sdf version=\"1.9\"><model name=\"s\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/><joint \
         name=\"ja\" type=\"revolute\"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz><!-- kept \
         --><dynamics><friction>0.5</friction></dynamics></axis></joint><joint name=\"jb\" \
         type=\"revolute\"><parent>b</parent><child>c</child><axis><xyz>0 0 \
         1</xyz></axis></joint></model></sdf>",
    ),
    (
        "k.xml",
        "<mujoco><default><joint frictionloss=\"0.5\"/></default><worldbody><body name=\"b\"><joint \
         name=\"ja\" range=\"0 9\"/><!-- kept --><inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 \
         1\"/><body name=\"c\"><joint frictionloss='0' ></joint><inertial pos=\"0 0 0\" mass=\"1\" \
         diaginertia=\"1 1 1\"/></body></body></worldbody></mujoco>",
    ),
];

#[test]
fn friction_and_rotors_go_into_a_file_that_is_kept() {
    let new = Passive { armature: 0.125, damping: 0.25, friction: 1e-7, ..NONE };
    let place = tempfile::tempdir().unwrap();
    for (name, text) in KEPT {
        let source = place.path().join(name);
        std::fs::write(&source, text).unwrap();
        let own = write::parse(text, name).unwrap().model;
        let second = if name == "k.xml" { "c_joint" } else { "jb" };
        assert_eq!(of(&own, "ja"), Passive { friction: 0.5, ..NONE }, "{name}");
        assert_eq!(of(&own, second), NONE);
        // What nobody changed is not touched.
        assert_eq!(
            write::edited(&write::with_passive(&own, [("none", new)].into_iter()), text, name).unwrap().len(),
            write::edited(&own, text, name).unwrap().len()
        );
        let wanted = write::with_passive(&own, [("ja", new), (second, new)].into_iter());
        let path = place.path().join(format!("new_{name}"));
        write::write(&wanted, Some(&source), &path).unwrap();
        let written = std::fs::read_to_string(&path).unwrap();
        let language = Language::of_text(text).unwrap();
        let again = write::parse(&written, name).unwrap().model;
        for joint in ["ja", second] {
            let kind = again.links[again.joint(joint).unwrap()].link.joint;
            assert_eq!(of(&again, joint), new.said_in(language, &kind), "{written}");
            assert_eq!(of(&again, joint).armature, 0.125, "every language has words for rotors");
        }
        assert!(written.contains("<!-- kept -->"));
        let table = path.with_added_extension("joints.yaml");
        assert_eq!(std::fs::remove_file(&table).is_ok(), language != Language::Mjcf);
        let said = remarks::remarks(&wanted, Some(&source), &path, &[]);
        assert_eq!(said.len(), usize::from(language != Language::Mjcf), "{said:?}");
    }
    let urdf = std::fs::read_to_string(place.path().join("new_k.urdf")).unwrap();
    assert!(urdf.contains("<dynamics friction = '0.0000001' spring=\"kept\"  damping=\"0.25\"/>"), "{urdf}");
    // A locked joint stays as the file has it.
    let mut locked = urdf::parse(KEPT[0].1, "k.urdf").unwrap();
    locked.lock(&["ja".to_owned()]).unwrap();
    assert_eq!(write::edited(&locked, KEPT[0].1, "k.urdf").unwrap(), KEPT[0].1);
}
