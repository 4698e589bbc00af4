//! SDF as other programs write it.

use std::path::Path;

use rigident_shared::tree::BaseMotion;

use crate::dynamics::inverse_dynamics;
use crate::{Model, read_file, sdf, urdf};

/// Returns a robot of two joints; `child`, `axis` and `more` are the second joint's link, its own axis, and
/// additions.
fn arm(version: &str, axis: &str, child: &str, more: &str) -> String {
    let inertial = "<inertial><pose>0.05 0.02 0.15 0.4 0.1 \
                    -0.7</pose><mass>2</mass><inertia><ixx>0.03</ixx><ixy>0.002</ixy><ixz>-0.001</ixz><iyy>0.035</iyy><iyz>0.003</iyz><izz>0.012</izz></inertia></inertial>";
    format!(
        "<sdf version=\"{version}\"><model name=\"r\">{more}<link name=\"base\"/><link name=\"l1\"><pose>0 0 \
         0.3 0 0 0</pose>{inertial}</link><link name=\"l2\"><pose>0.1 0.05 0.7 0.3 -0.2 \
         0.5</pose>{inertial}</link><joint name=\"j1\" \
         type=\"revolute\"><parent>base</parent><child>l1</child><axis><xyz>0 1 0</xyz></axis></joint><joint \
         name=\"j2\" \
         type=\"revolute\"><parent>l1</parent><child>{child}</child><axis>{axis}</axis></joint></model></sdf>"
    )
}

/// Returns the efforts of the same robot as URDF, whose second axis is (0, 0.6, 0.8) of the link.
fn wanted() -> Vec<f64> {
    let inertial = "<inertial><origin xyz=\"0.05 0.02 0.15\" rpy=\"0.4 0.1 -0.7\"/><mass \
                    value=\"2\"/><inertia ixx=\"0.03\" ixy=\"0.002\" ixz=\"-0.001\" iyy=\"0.035\" \
                    iyz=\"0.003\" izz=\"0.012\"/></inertial>";
    let text = format!(
        "<robot name=\"r\"><link name=\"base\"/><link name=\"l1\">{inertial}</link><link \
         name=\"l2\">{inertial}</link><joint name=\"j1\" type=\"continuous\"><parent link=\"base\"/><child \
         link=\"l1\"/><origin xyz=\"0 0 0.3\"/><axis xyz=\"0 1 0\"/></joint><joint name=\"j2\" \
         type=\"continuous\"><parent link=\"l1\"/><child link=\"l2\"/><origin xyz=\"0.1 0.05 0.4\" rpy=\"0.3 \
         -0.2 0.5\"/><axis xyz=\"0 0.6 0.8\"/></joint></robot>"
    );
    efforts(&urdf::parse(&text, "u").unwrap())
}

fn efforts(model: &Model) -> Vec<f64> {
    let base = BaseMotion::still([0.0, 0.0, -9.81]);
    inverse_dynamics(model, &base, &[0.4, -0.9], &[0.7, 0.5], &[-0.3, 1.1]).unwrap()[6..].to_vec()
}

fn same(model: &Model, wanted: &[f64], what: &str) {
    for (own, wanted) in efforts(model).iter().zip(wanted) {
        assert!((own - wanted).abs() < 1e-9, "{what}: {own} {wanted}");
    }
}

/// The link's axis (0, 0.6, 0.8) in the model's frame.
const IN_MODEL: &str = "<xyz>-0.32562719531193 0.205874344472982 0.922812377442757</xyz>";

#[test]
fn axes_are_in_the_model_s_frame_before_version_1_5() {
    let wanted = wanted();
    let own = "<xyz>0 0.6 0.8</xyz>";
    let stated =
        |word: &str, xyz: &str| format!("{xyz}<use_parent_model_frame>{word}</use_parent_model_frame>");
    for (version, axis) in [
        ("1.4", IN_MODEL.to_owned()),
        ("1.3", IN_MODEL.to_owned()),
        ("1.5", own.to_owned()),
        ("1.10", own.to_owned()),
        ("1.4", stated("0", own)),
        ("1.6", stated("true", IN_MODEL)),
    ] {
        let model = sdf::parse(&arm(version, &axis, "l2", ""), "s").unwrap().model;
        same(&model, &wanted, &format!("{version} {axis}"));
    }
}

#[test]
fn joints_on_frames_and_prefixes_that_nobody_declares_are_read() {
    let wanted = wanted();
    let own = "<xyz>0 0.6 0.8</xyz>";
    let frames = "<frame name=\"G\" attached_to=\"H\"/><frame name=\"H\" attached_to=\"l2\"/>";
    for (child, more) in [
        ("G", frames),
        ("l2", "<drake:note>x</drake:note>"),
        ("l2", "<plugin name=\"p\" filename=\"f\" gz:expressed=\"1\"/>"),
    ] {
        same(&sdf::parse(&arm("1.9", own, child, more), "s").unwrap().model, &wanted, more);
    }
    let turned = "<frame name=\"G\" attached_to=\"l2\"><pose>0 0 0 0 0 0.7</pose></frame>";
    let expressed = "<xyz expressed_in=\"l2\">0 0.6 0.8</xyz>";
    same(&sdf::parse(&arm("1.9", expressed, "G", turned), "s").unwrap().model, &wanted, "turned");
    let round = "<frame name=\"G\" attached_to=\"H\"/><frame name=\"H\" attached_to=\"G\"/>";
    let said = sdf::parse(&arm("1.9", own, "G", round), "s").unwrap_err().to_string();
    assert!(said.contains("frame G is attached to itself in the end"), "{said}");
    let said = sdf::parse(&arm("1.9", own, "K", ""), "s").unwrap_err().to_string();
    assert!(said.contains("K is not there"), "{said}");
}

/// Efforts are those of Pinocchio 3 with the base placed so in the world (rpy 0.5, −0.3, 0.2).
#[test]
fn the_pose_of_a_model_that_the_world_holds_is_applied() {
    let wanted = [-2.862_534_403_111_984_4, 0.516_180_504_403_275_7];
    let fixed = "<joint name=\"fix\" type=\"fixed\"><parent>world</parent><child>base</child></joint>";
    let own = "<xyz>0 0.6 0.8</xyz>";
    let pose = "<pose>1 2 3 0.5 -0.3 0.2</pose>";
    let whole = arm("1.9", own, "l2", &format!("{pose}{fixed}"));
    same(&sdf::parse(&whole, "s").unwrap().model, &wanted, "pose of the model");
    let frame = "<frame name=\"F\"><pose>1 2 3 0.5 -0.3 0.2</pose></frame>";
    let by_frame = arm("1.9", own, "l2", &format!("{frame}<pose>1 2 3 0.5 -0.3 0.2</pose>{fixed}"))
        .replace("name=\"r\"", "name=\"r\" placement_frame=\"F\"");
    same(&sdf::parse(&by_frame, "s").unwrap().model, &self::wanted(), "placement_frame");
    // What includes it places it.
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("r.sdf"), arm("1.9", own, "l2", fixed)).unwrap();
    let include = format!("<include><uri>r.sdf</uri>{pose}</include>");
    std::fs::write(path("w.sdf"), format!("<sdf version=\"1.9\"><world name=\"w\">{include}</world></sdf>"))
        .unwrap();
    same(&read_file(&path("w.sdf")).unwrap().0, &wanted, "include");
    // A frame of the world is not followed, and a base that floats keeps its axes, with a word.
    let said = sdf::parse(&whole.replace("<pose>1 2", "<pose relative_to=\"table\">1 2"), "s").unwrap_err();
    assert!(said.to_string().contains("relative to table"), "{said}");
    let free = sdf::parse(&arm("1.9", own, "l2", pose), "s").unwrap().model;
    same(&free, &self::wanted(), "free");
    assert!(free.findings.iter().any(|f| f.text.contains("stands tilted")), "{:?}", free.findings);
}

#[test]
fn inertias_of_collisions_are_named_and_unknown() {
    let text =
        arm("1.11", "<xyz>0 0.6 0.8</xyz>", "l2", "").replacen("<inertial>", "<inertial auto=\"true\">", 1);
    let model = sdf::parse(&text, "s").unwrap().model;
    assert_eq!(model.links[1].nominal, None);
    assert!(model.findings.iter().any(|f| f.place == "link l1" && f.text.contains("auto = \"true\"")));
}

#[test]
fn models_within_models_and_of_files_are_one() {
    let wanted = wanted();
    let folder = tempfile::tempdir().unwrap();
    let whole = arm("1.9", "<xyz>0 0.6 0.8</xyz>", "l2", "");
    let path = |name: &str| folder.path().join(name);
    std::fs::create_dir_all(path("r")).unwrap();
    std::fs::write(path("r/model.sdf"), &whole).unwrap();
    let carrier = |inside: &str| {
        format!(
            "<sdf version=\"1.9\"><world name=\"w\"><gravity>0 0 -3.7</gravity><model name=\"floor\"><link \
             name=\"f\"/></model><model name=\"m\"><link name=\"pole\"/>{inside}<joint name=\"fix\" \
             type=\"fixed\"><parent>pole</parent><child>r::base</child></joint></model></world></sdf>"
        )
    };
    let nested = &whole[whole.find("<model").unwrap()..whole.find("</sdf>").unwrap()];
    for inside in [
        nested,
        "<include><uri>model://r</uri></include>",
        "<include><uri>r/model.sdf</uri><name>r</name></include>",
    ] {
        std::fs::write(path("m.sdf"), carrier(inside)).unwrap();
        let (model, _) = read_file(&path("m.sdf")).unwrap();
        let names: Vec<&str> = model.links.iter().map(|link| link.name.as_str()).collect();
        assert_eq!(names, ["pole", "r::base", "r::l1", "r::l2"], "{inside}");
        same(&model, &wanted, inside);
        assert_eq!(model.gravity_mps2, Some([0.0, 0.0, -3.7]));
        assert!(model.findings.iter().any(|f| f.text.contains("floor left out")), "{:?}", model.findings);
    }
    let said = sdf::parse(&carrier("<include><uri>model://r</uri></include>"), "s").unwrap_err().to_string();
    assert!(said.contains("<include> of model://r") && said.contains("give that as a file"), "{said}");
}

/// Files that the cases hold.
#[test]
#[ignore = "needs ../shared/cases"]
fn shared_cases_are_the_robot_that_their_urdf_is() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/cases");
    let wanted = efforts(&read_file(&cases.join("sdf14-axis/same_robot.urdf")).unwrap().0);
    for name in [
        "sdf14-axis/s_14_parentmodel.sdf",
        "sdf-joint-on-frame/s_joint_child_frame.sdf",
        "sdf-joint-on-frame/s_joint_parent_frame.sdf",
        "sdf-undeclared-prefix/s_gz_attr.sdf",
        "sdf-undeclared-prefix/s_undeclared_ns.sdf",
    ] {
        same(&read_file(&cases.join(name)).unwrap().0, &wanted, name);
    }
}

/// Grippers of Bullet's data have such a link.
#[test]
fn a_link_named_world_is_the_one_that_joints_hold_on_to() {
    let text = arm("1.6", "<xyz>0 0.6 0.8</xyz>", "l2", "");
    let plain = sdf::parse(&text, "s").unwrap().model;
    let model = sdf::parse(&text.replace("base", "world"), "s").unwrap().model;
    let names: Vec<&str> = model.links.iter().map(|link| link.name.as_str()).collect();
    assert_eq!(names, ["world", "l1", "l2"]);
    same(&model, &efforts(&plain), "a link named world");
    // Elsewhere than the world it is another one.
    let moved = text.replace("base", "world").replacen(
        "<link name=\"world\"/>",
        "<link name=\"world\"><pose>1 0 0 0 0 0</pose></link>",
        1,
    );
    assert!(sdf::parse(&moved, "s").unwrap_err().to_string().contains("two links are named world"));
}
