//! MJCF as others write it, against numbers of MuJoCo 4.0.0 (`mj_inverse`, contacts and limits off).

use std::path::{Path, PathBuf};

use rigident_shared::tree::BaseMotion;

use crate::dynamics::inverse_dynamics;
use crate::{Model, ModelLink, mjcf, read_file, write};

const STANDARD: [f64; 3] = [0.0, 0.0, -9.81];

/// Returns an arm of three joints, with the given attributes in its elements.
fn arm(compiler: &str, option: &str, joints: [&str; 3]) -> String {
    let [one, two, three] = joints;
    format!(
        "<mujoco><compiler {compiler}/><option {option}/><worldbody><body name=\"l1\" pos=\"0 0 0.3\"><joint \
         name=\"j1\" axis=\"0 1 0\" {one}/><inertial pos=\"0 0.01 0.2\" mass=\"3\" diaginertia=\"0.05 0.05 \
         0.01\"/><body name=\"l2\" pos=\"0.1 0.05 0.4\"><joint name=\"j2\" axis=\"1 0 0.5\" {two}/><inertial \
         pos=\"0.02 0 0.15\" mass=\"2\" fullinertia=\"0.03 0.03 0.01 0.002 -0.001 0.003\"/><body name=\"l3\" \
         pos=\"0 0 0.3\"><joint name=\"j3\" type=\"slide\" axis=\"0 1 1\" pos=\"0.02 0 0\" \
         {three}/><inertial pos=\"0.05 0.02 0.04\" quat=\"0.9 0.1 0.3 -0.2\" mass=\"1\" diaginertia=\"0.004 \
         0.006 0.005\"/></body></body></body></worldbody></mujoco>"
    )
}

/// Efforts of a robot on the world with one freedom a joint, all that its joints do by themselves included.
fn efforts(model: &Model, q: &[f64], v: &[f64], a: &[f64]) -> Vec<f64> {
    let base = BaseMotion::still(model.gravity_mps2.unwrap_or(STANDARD));
    let links = inverse_dynamics(model, &base, q, v, a).unwrap();
    let joints = model.links.iter().skip(1).filter(|link| link.link.joint.freedoms() == 1);
    let own = joints.enumerate().map(|(k, link)| {
        let own = link.passive[0];
        links[6 + k]
            + own.armature * a[k]
            + own.damping * v[k]
            + own.stiffness * (q[k] - own.spring_reference)
    });
    own.collect()
}

fn names(model: &Model) -> Vec<&str> {
    model.links.iter().map(|link| link.name.as_str()).collect()
}

fn place(model: &Model) -> String {
    model.findings.iter().map(|finding| format!("{finding}\n")).collect()
}

#[test]
fn settings_of_the_compiler_and_of_joints_are_followed_as_mujoco_does() {
    let radian = "angle=\"radian\"";
    let none = ["", "", ""];
    for (compiler, option, joints, wanted) in [
        (radian, "", none, [-14.404_523_587_3, 9.118_070_217_61, 2.290_637_530_06]),
        (radian, "gravity=\"0 1 -3.71\"", none, [-6.477_010_794_63, 4.193_769_526_43, -0.247_547_976_671]),
        (
            "angle=\"radian\" settotalmass=\"12\"",
            "",
            none,
            [-28.809_047_174_5, 18.236_140_435_2, 4.581_275_060_13],
        ),
        (
            "angle=\"degree\"",
            "",
            ["", "ref=\"40\"", "ref=\"0.2\""],
            [-14.134_618_647_6, 9.273_159_105_21, -3.840_884_869_35],
        ),
        (
            radian,
            "",
            [
                "armature=\"0.4\" damping=\"0.7\"",
                "stiffness=\"10\" springref=\"0.3\"",
                "stiffness=\"50\" ref=\"0.1\" springref=\"-0.2\"",
            ],
            [-13.587_500_108_1, 0.137_943_397_205, 47.337_950_141_7],
        ),
        (
            "angle=\"radian\" boundmass=\"1.5\" boundinertia=\"0.02\"",
            "",
            none,
            [-17.726_574_043, 13.097_664_86, 3.435_956_295_09],
        ),
        (
            "angle=\"radian\" balanceinertia=\"true\" boundinertia=\"0.005\"",
            "",
            none,
            [-14.404_678_940_2, 9.118_685_496_59, 2.290_637_530_06],
        ),
    ] {
        let text = arm(compiler, option, joints);
        let model = mjcf::parse(&text, "arm.xml").unwrap().model;
        let got = efforts(&model, &[0.3, -0.5, 0.7], &[0.9, -0.4, 0.2], &[-0.6, 0.8, 0.5]);
        let scale = wanted.iter().fold(0.0_f64, |most, v: &f64| most.max(v.abs()));
        for (own, mujoco) in got.iter().zip(wanted) {
            assert!(
                (own - mujoco).abs() < 1e-9 * scale,
                "{compiler} {option} {joints:?}: {got:?}, {wanted:?}"
            );
        }
    }
}

#[test]
fn attributes_not_followed_are_named() {
    let body = |attributes: &str| {
        arm("", "", ["", "", ""]).replace("name=\"l2\"", &format!("name=\"l2\" {attributes}"))
    };
    let also = |more: &str| arm("", "", ["", "", ""]).replace("</worldbody>", &format!("</worldbody>{more}"));
    let tendon =
        "<tendon><fixed name=\"cable\" stiffness=\"3\"><joint joint=\"j1\" coef=\"1\"/></fixed></tendon>";
    let coupled = "<equality><joint joint1=\"j1\" joint2=\"j2\"/></equality>";
    for (text, wanted) in [
        (body("gravcomp=\"0.5\""), "gravcomp: MuJoCo carries that share of the weight of l2 (0.5)"),
        (arm("", "density=\"1000\"", ["", "", ""]), "density"),
        (also(tendon), "tendon cable: the answer does not use what the file states of its stiffness"),
        (also(coupled), "equality of j1 and j2: couples"),
        (
            also("<actuator><motor name=\"m\" joint=\"j1\" armature=\"0.5\"/></actuator>"),
            "actuator m: the answer does not use what the file states of its armature",
        ),
        (
            also("<default><default class=\"d\"><position damping=\"2\"/></default></default>"),
            "actuator: the answer does not use what the file states of its damping",
        ),
        (
            "<mujoco><compiler alignfree=\"true\"/><worldbody><body name=\"t\"><freejoint/><inertial \
             pos=\"0.1 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/></body></worldbody></mujoco>"
                .to_owned(),
            "body t: MuJoCo moves its frame",
        ),
        (
            arm("", "", ["", "", ""]).replacen(
                "<inertial pos=\"0 0.01 0.2\" mass=\"3\" diaginertia=\"0.05 0.05 0.01\"/>",
                "<geom type=\"hfield\" hfield=\"h\"/>",
                1,
            ),
            "of a hfield",
        ),
        (arm("", "", ["springdamper=\"1 1\"", "", ""]), "joint j1: not read of its attributes"),
        (
            arm("settotalmass=\"9\"", "", ["", "", ""])
                .replace("mass=\"1\" diag", "mass=\"1\" name=\"x\" diag")
                .replacen(
                    "<inertial pos=\"0 0.01 0.2\" mass=\"3\" diaginertia=\"0.05 0.05 0.01\"/>",
                    "<geom type=\"mesh\" mesh=\"m\"/>",
                    1,
                ),
            "settotalmass = 9 kg is not followed, as the masses of l1 are not stated",
        ),
    ] {
        let said = place(&mjcf::parse(&text, "arm.xml").unwrap().model);
        assert!(said.contains(wanted), "{wanted}: {said}");
    }
    assert_eq!(place(&mjcf::parse(&arm("", "", ["", "", ""]), "arm.xml").unwrap().model), "");
}

#[test]
fn bodies_and_joints_without_names_have_those_of_their_path() {
    let inertial = "<inertial pos=\"0 0 0.1\" mass=\"1\" diaginertia=\"0.01 0.01 0.001\"/>";
    let text = format!(
        "<mujoco><worldbody><body><joint axis=\"0 1 0\"/>{inertial}<frame pos=\"0 0 \
         0.2\"><body>{inertial}<joint/><joint axis=\"1 0 0\"/></body></frame><body \
         name=\"tip\">{inertial}</body></body></worldbody></mujoco>"
    );
    let model = mjcf::parse(&text, "x").unwrap().model;
    assert_eq!(names(&model), ["world", "world/1", "world/1/1#1", "world/1/1", "tip"]);
    let joints: Vec<&str> = model.links.iter().skip(1).map(|link| link.joint_name.as_str()).collect();
    assert_eq!(joints, ["world/1_joint", "world/1/1_joint1", "world/1/1_joint2", "tip_fixed"]);
    // They are written where they are.
    let mut heavy = model.clone();
    heavy.links[3].nominal = Some([2.0, 0.0, 0.0, 0.2, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0]);
    heavy.links[2].passive[0].damping = 0.25;
    let edited = write::edited(&heavy, &text, "x").unwrap();
    let again = mjcf::parse(&edited, "x").unwrap().model;
    assert_eq!(again.links[2].passive[0].damping, 0.25);
    assert!((again.links[3].nominal.unwrap()[0] - 2.0).abs() < 1e-12);
    assert!((again.links[1].nominal.unwrap()[0] - 1.0).abs() < 1e-12);
}

#[test]
fn the_robot_is_the_tree_and_bodies_beside_it_are_named() {
    let inertial = "<inertial pos=\"0 0 0\" mass=\"2\" diaginertia=\"0.1 0.1 0.1\"/>";
    let loose = |name: &str| format!("<body name=\"{name}\"><freejoint/>{inertial}</body>");
    let table = format!("<body name=\"table\">{inertial}</body>");
    let robot = |base: &str| {
        format!("<body name=\"torso\">{base}{inertial}<body name=\"leg\"><joint/>{inertial}</body></body>")
    };
    let parsed = |bodies: &[String]| {
        let text = format!("<mujoco><worldbody>{}</worldbody></mujoco>", bodies.concat());
        mjcf::parse(&text, "x").unwrap().model
    };
    let legged = parsed(&[table.clone(), loose("cube"), robot("<freejoint/>"), loose("ball")]);
    assert_eq!(names(&legged), ["torso", "leg"]);
    assert_eq!(legged.links[0].nominal.map(|phi| phi[0]), Some(2.0));
    assert!(place(&legged).contains("table, cube, ball are left out: the robot is the tree on torso"));
    // By a joint of type free, on the world, and alone.
    let other = parsed(&[loose("cube"), robot("<joint name=\"root\" type=\"free\"/>")]);
    assert_eq!(names(&other), ["torso", "leg"]);
    let held = parsed(&[table.clone(), loose("cube"), robot("")]);
    assert_eq!(names(&held), ["world", "table", "torso", "leg"]);
    assert!(place(&held).contains("cube is left out"));
    assert_eq!(names(&parsed(&[loose("cube")])), ["cube"]);
    assert_eq!(place(&parsed(&[robot("<freejoint/>")])), "");
    // Bodies beside the robot count in a total: 8 of 12 kg are its own.
    let total = format!(
        "<mujoco><compiler settotalmass=\"12\"/><worldbody>{}{}</worldbody></mujoco>",
        robot("<freejoint/>"),
        loose("cube")
    );
    let scaled = mjcf::parse(&total, "x").unwrap().model;
    let mass: f64 = scaled.links.iter().filter_map(|link| Some(link.nominal?[0])).sum();
    assert!((mass - 8.0).abs() < 1e-12, "{mass}");
}

#[test]
fn frames_replicas_and_classes_are_where_mujoco_has_them() {
    let inertial = "<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>";
    let text = format!(
        "<mujoco><default><default class=\"a\"><joint damping=\"3\"/></default></default><default><joint \
         armature=\"2\"/></default><worldbody><body name=\"t\"><frame pos=\"0 0 1\" euler=\"90 0 0\" \
         childclass=\"a\"><joint name=\"j\" axis=\"0 1 0\" pos=\"0.1 0.2 0.3\"/></frame>{inertial}<replicate \
         count=\"3\" offset=\"0.1 0 0\" euler=\"0 0 90\" sep=\"-\"><body name=\"b\" pos=\"1 0 0\"><joint \
         name=\"k\"/>{inertial}</body></replicate></body></worldbody></mujoco>"
    );
    let model = mjcf::parse(&text, "x").unwrap().model;
    assert_eq!(names(&model), ["world", "t", "b-0", "b-1", "b-2"]);
    // MuJoCo 4.0.0: jnt_axis (0, 0, 1), jnt_pos (0.1, −0.3, 1.2); body_pos of the replicas beside that.
    let joint = nalgebra::Vector3::new(0.1, -0.3, 1.2);
    let link = &model.links[1].link;
    assert!((link.position - joint).norm() < 1e-12, "{}", link.position);
    assert!(
        matches!(link.joint, rigident_shared::tree::Joint::Revolute(axis) if (axis - nalgebra::Vector3::z()).norm() < 1e-12)
    );
    for (k, place) in [[1.0, 0.0, 0.0], [0.1, 1.0, 0.0], [-0.9, 0.1, 0.0]].into_iter().enumerate() {
        let own = model.links[2 + k].link.position + joint;
        assert!((own - nalgebra::Vector3::from(place)).norm() < 1e-12, "{own}");
    }
    // Sections of defaults add to each other.
    let passive = model.links[2].passive[0];
    assert_eq!((passive.armature, passive.damping, model.links[1].passive[0].damping), (2.0, 0.0, 3.0));
    let many = text.replace("count=\"3\"", "count=\"9999999999\"");
    assert!(mjcf::parse(&many, "x").unwrap_err().to_string().contains("more than 200000 elements"));
}

#[test]
fn files_that_a_file_names_are_read_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
        path
    };
    let inertial = "<inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>";
    put(
        "parts/settings.xml",
        "<mujocoinclude><compiler angle=\"radian\"/><default><joint \
         damping=\"0.5\"/></default></mujocoinclude>",
    );
    put(
        "parts/arm.xml",
        &format!(
            "<mujocoinclude><body name=\"arm\" euler=\"0 0 1.5\"><joint \
             name=\"a\"/>{inertial}</body></mujocoinclude>"
        ),
    );
    put(
        "gripper.xml",
        &format!(
            "<mujoco><default><joint damping=\"7\"/></default><compiler angle=\"radian\"/><worldbody><body \
             name=\"palm\"><body name=\"finger\"><joint \
             name=\"f\"/>{inertial}</body></body></worldbody></mujoco>"
        ),
    );
    let main = put(
        "main.xml",
        "<mujoco><include file=\"parts/settings.xml\"/><asset><model name=\"g\" \
         file=\"gripper.xml\"/></asset><worldbody><include file=\"parts/arm.xml\"/><body \
         name=\"hand\"><attach model=\"g\" body=\"palm\" prefix=\"left_\"/></body></worldbody></mujoco>",
    );
    let (model, _) = read_file(&main).unwrap();
    assert_eq!(names(&model), ["world", "arm", "hand", "left_palm", "left_finger"]);
    let damping = |link: &ModelLink| link.passive[0].damping;
    assert_eq!((damping(&model.links[1]), damping(&model.links[4])), (0.5, 7.0));
    // What is written of it holds all files.
    let new: PathBuf = folder.path().join("new.xml");
    let mut heavy = model.clone();
    heavy.links[1].nominal = Some([4.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    write::write(&heavy, Some(&main), &new).unwrap();
    assert_eq!(read_file(&new).unwrap().0.links[1].nominal.unwrap()[0], 4.0);
    for (text, wanted) in [
        ("<mujoco><include file=\"none.xml\"/><worldbody/></mujoco>", "no such file"),
        ("<mujoco><include file=\"round.xml\"/><worldbody/></mujoco>", "included twice"),
    ] {
        let said = read_file(&put("round.xml", text)).unwrap_err().to_string();
        assert!(said.contains(wanted), "{said}");
    }
}

/// Files that the cases hold, with efforts of MuJoCo.
#[test]
#[ignore = "needs ../shared/cases"]
fn shared_cases_are_read_as_mujoco_reads_them() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/cases");
    for name in ["u.xml", "u_saved.xml"] {
        let (model, _) = read_file(&cases.join("mjcf-unnamed").join(name)).unwrap();
        assert_eq!(names(&model), ["world", "world/1", "world/1/1"]);
    }
    for name in ["gravity_opt", "ref", "settotalmass", "stiff"] {
        let folder = cases.join("mjcf-predict-silent");
        let (model, _) = read_file(&folder.join(format!("{name}.xml"))).unwrap();
        let text = std::fs::read_to_string(folder.join(format!("{name}.csv"))).unwrap();
        let rows: Vec<Vec<f64>> = text
            .lines()
            .skip(1)
            .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
            .collect();
        let (mut off, mut size) = (0.0_f64, 0.0_f64);
        for three in rows.windows(3) {
            // Accelerations are central differences of rates.
            let of = |k: usize| [0, 1, 2].map(|j| three[1][1 + 3 * j + k]);
            let a =
                [0, 1, 2].map(|j| (three[2][2 + 3 * j] - three[0][2 + 3 * j]) / (three[2][0] - three[0][0]));
            for (own, wanted) in efforts(&model, &of(0), &of(1), &a).iter().zip(of(2)) {
                off += (own - wanted).powi(2);
                size += wanted.powi(2);
            }
        }
        assert!((off / size).sqrt() < 3e-3, "{name}: {}", (off / size).sqrt());
    }
    for (folder, name) in [("mjcf-gravcomp", "i_gravcomp.xml"), ("mjcf-predict-silent", "gravcomp.xml")] {
        let (model, _) = read_file(&cases.join(folder).join(name)).unwrap();
        assert!(place(&model).contains("the weight of l2 (1)"));
    }
}

#[test]
fn bodies_without_inertial_have_that_of_their_geoms() {
    let text = "<mujoco><compiler inertiagrouprange=\"0 2\"/><default><geom density=\"500\"/><default \
                class=\"heavy\"><geom mass=\"2\" size=\"0.05 0.1 0.2\"/></default></default><worldbody><body \
                name=\"b\" childclass=\"heavy\"><joint/><geom class=\"main\" size=\"0.1\" pos=\"0.1 0 \
                0\"/><geom type=\"capsule\" class=\"main\" fromto=\"0 0 0 0.1 0.2 0.3\" size=\"0.04\"/><geom \
                type=\"box\" euler=\"10 20 30\" pos=\"0 0.1 0\"/><geom type=\"ellipsoid\" pos=\"0 0 \
                0.2\"/><frame pos=\"0 0 1\" euler=\"40 0 0\"><geom type=\"cylinder\" class=\"main\" \
                size=\"0.03 0.2\" pos=\"0.1 0.1 0\"/><geom class=\"main\" type=\"box\" size=\"0.02\" \
                fromto=\"0.3 0 0 0 0 0.1\"/></frame><geom type=\"sphere\" class=\"main\" size=\"1\" \
                group=\"3\"/><geom type=\"sphere\" class=\"main\" size=\"1\" \
                density=\"0\"/></body></worldbody></mujoco>";
    // m, mc, I about the origin by MuJoCo 4.0.0.
    let wanted = [
        7.987_286_348_09,
        0.357_656_627_688,
        0.342_630_336_637,
        1.425_670_807_65,
        1.133_107_901_89,
        1.126_017_146_81,
        0.105_997_344_196,
        -0.054_436_068_066_8,
        -0.117_766_494_648,
        -0.007_846_601_541_83,
    ];
    let model = mjcf::parse(text, "x").unwrap().model;
    assert_eq!(place(&model), "");
    for (own, mujoco) in model.links[1].nominal.unwrap().iter().zip(wanted) {
        assert!((own - mujoco).abs() < 1e-10, "{:?}", model.links[1].nominal);
    }
    let mesh = text.replace("type=\"ellipsoid\"", "type=\"mesh\" mesh=\"m\"");
    let model = mjcf::parse(&mesh, "x").unwrap().model;
    assert_eq!(model.links[1].nominal, None);
    assert!(place(&model).contains("link b: has no <inertial>") && place(&model).contains("of a mesh"));
    // Where the file says so, what is stated does not count.
    let stated = "<inertial pos=\"0 0 0\" mass=\"3\" diaginertia=\"1 1 1\"/><joint/>";
    let mass = |setting: &str| {
        let text = text.replace("<joint/>", stated);
        let text =
            text.replace("inertiagrouprange", &format!("inertiafromgeom=\"{setting}\" inertiagrouprange"));
        mjcf::parse(&text, "x").unwrap().model.links[1].nominal.unwrap()[0]
    };
    assert_eq!((mass("auto"), mass("false")), (3.0, 3.0));
    assert!((mass("true") - wanted[0]).abs() < 1e-10);
}
