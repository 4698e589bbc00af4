//! Errors of a model are named with a remedy.

use super::*;
use rigident_shared::tree::Joint;

fn urdf(body: &str) -> Result<Model, ModelError> {
    urdf::parse(&format!("<robot name=\"r\">{body}</robot>"), "r.urdf")
}

const GOOD: &str = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" \
                    iyz=\"0\"/></inertial>";

fn link(name: &str) -> String {
    format!("<link name=\"{name}\">{GOOD}</link>")
}

fn joint(name: &str, parent: &str, child: &str, rest: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child \
         link=\"{child}\"/>{rest}</joint>"
    )
}

fn complaint(body: &str) -> String {
    urdf(body).unwrap_err().to_string()
}

#[test]
fn structures_that_are_no_trees_are_named() {
    let abc = link("a") + &link("b") + &link("c");
    let chain = joint("ab", "a", "b", "") + &joint("bc", "b", "c", "");
    assert_eq!(urdf(&(abc.clone() + &chain)).unwrap().links.len(), 3);
    let said = complaint(&(abc.clone() + &chain + &joint("ca", "c", "a", "")));
    assert!(said.contains("loop") && said.contains("a → b"), "{said}");
    let said = complaint(&(abc.clone() + &chain + &joint("ac", "a", "c", "")));
    assert!(said.contains("joints bc and ac both hold link c") && said.contains("loop"), "{said}");
    let said = complaint(&(abc.clone() + &joint("ab", "a", "b", "")));
    assert!(said.contains("2 links hang on nothing: a, c"), "{said}");
    let said = complaint(&(abc.clone() + &joint("ab", "a", "b", "") + &joint("ab", "b", "c", "")));
    assert!(said.contains("two joints are named ab"), "{said}");
    let said = complaint(&(abc.clone() + &joint("", "a", "b", "") + &joint("bc", "b", "c", "")));
    assert!(said.contains("joint that holds link b has no name"), "{said}");
    let unnamed = "<joint type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>";
    let said = complaint(&(link("a") + &link("b") + unnamed));
    assert!(said.contains("no name"), "{said}");
    let said = complaint(&(abc.clone() + &chain.replace("\"c\"", "\"d\"")));
    assert!(said.contains("link d, which is not there"), "{said}");
    let said = complaint(&(abc.clone() + &chain.replace("\"a\"", "\"d\"")));
    assert!(said.contains("on d, which is not there"), "{said}");
    let said =
        complaint(&(abc + &joint("ab", "a", "b", "<axis xyz=\"0 0 0\"/>") + &joint("bc", "b", "c", "")));
    assert!(said.contains("joint ab") && said.contains("no direction"), "{said}");
    assert!(complaint("").contains("no link"));
    assert!(urdf::parse("no robot", "x").unwrap_err().to_string().contains("no <robot>"));
}

#[test]
fn strange_inertias_are_found_and_change_nothing() {
    let massless = "<link name=\"b\"/>";
    let impossible = link("c").replace("ixx=\"1\"", "ixx=\"3\"");
    let still = "<limit lower=\"0.5\" upper=\"0.5\" effort=\"1\" velocity=\"1\"/>";
    let body = link("a")
        + massless
        + &impossible
        + &joint("ab", "a", "b", "")
        + &joint("bc", "b", "c", still).replace("continuous", "revolute");
    let model = urdf(&body).unwrap();
    let said: Vec<String> = model.findings.iter().map(ToString::to_string).collect();
    assert_eq!(said.len(), 3, "{said:?}");
    assert!(said.iter().any(|s| s.starts_with("link b: has no mass")), "{said:?}");
    assert!(said.iter().any(|s| s.starts_with("link c: no distribution of mass")), "{said:?}");
    assert!(
        said.iter().any(|s| s.starts_with("joint bc: never moves") && s.contains("`lock` bc")),
        "{said:?}"
    );
    // Nothing is guessed: the massless link has no numbers.
    assert_eq!(model.links[1].nominal, None);
    assert_eq!(model.links[2].nominal.unwrap()[4], 3.0);
    let mut locked = model;
    locked.lock(&["bc".to_owned()]).unwrap();
    assert_eq!(locked.welded().links.len(), 2);
    assert!(locked.lock(&["zz".to_owned()]).unwrap_err().to_string().contains("ab, bc"));
}

#[test]
fn three_revolutes_through_a_point_may_be_declared_spherical() {
    let axes = |second: &str, offset: &str| {
        link("a")
            + "<link name=\"u\"/><link name=\"v\"/>"
            + &link("d")
            + &joint("x", "a", "u", "<axis xyz=\"1 0 0\"/><origin xyz=\"0.1 0 0.2\"/>")
            + &joint("y", "u", "v", &format!("<axis xyz=\"{second}\"/><origin xyz=\"{offset}\"/>"))
            + &joint("z", "v", "d", "<axis xyz=\"0 0 1\"/>")
    };
    let names = ["x", "y", "z"].map(str::to_owned);
    let mut model = urdf(&axes("0 1 0", "0.05 0 0")).unwrap();
    model.declare_spherical(&names).unwrap();
    assert_eq!(model.links.len(), 2);
    assert_eq!(model.links[1].link.joint, Joint::Spherical);
    assert!((model.links[1].link.position - nalgebra::Vector3::new(0.15, 0.0, 0.2)).norm() < 1e-15);
    assert!(model.findings.is_empty(), "{:?}", model.findings);
    let refused = |text: &str| urdf(text).unwrap().declare_spherical(&names).unwrap_err().to_string();
    assert!(
        refused(&axes("0 1 0", "0 0.05 0")).contains("axis of x misses the origin of link d by 50.0000 mm")
    );
    assert!(refused(&axes("1 0 0", "0 0 0")).contains("parallel"));
    let heavy = axes("0 1 0", "0 0 0").replace("<link name=\"v\"/>", &link("v"));
    assert!(refused(&heavy).contains("link v between them has mass"));
}

#[test]
fn followers_that_cannot_follow_move_by_themselves_with_a_word() {
    let of = |mimic: &str| {
        let body = link("a")
            + &link("b")
            + &link("c")
            + &joint("ab", "a", "b", "<mimic joint=\"bc\"/>")
            + &joint("bc", "b", "c", mimic);
        let model = urdf(&body).unwrap();
        let said: Vec<String> = model.findings.iter().map(ToString::to_string).collect();
        (model.links.iter().filter(|l| l.mimic.is_some()).count(), said.join("; "))
    };
    assert_eq!(of(""), (1, String::new()));
    for (mimic, why) in [
        ("<mimic joint=\"zz\"/>", "joint bc: mimics zz, which is not there"),
        ("<mimic/>", "which is not there"),
        ("<mimic joint=\"bc\"/>", "mimics bc and itself in the end"),
        ("<mimic joint=\"ab\"/>", "and itself in the end"),
        (
            "<mimic joint=\"ab\" multiplier=\"nan\"/>",
            "mimics ab by NaN times its position and 0, and both numbers must be finite",
        ),
        ("<mimic joint=\"ab\" offset=\"inf\"/>", "finite"),
    ] {
        let (_, said) = of(mimic);
        assert!(said.contains(why) && said.contains("moves by itself"), "{mimic}: {said}");
    }
    // One that leads may follow nothing, and its followers still follow it.
    assert_eq!(of("<mimic joint=\"zz\"/>").0, 1);
}

/// Oracle: two slides and a hinge in a row, written out.
#[test]
fn planar_joints_are_two_slides_and_a_hinge() {
    let place = "<origin xyz=\"0.1 0.2 0.3\" rpy=\"0.3 0.2 0.1\"/>";
    for (axis, slides) in [("0 0 1", ["1 0 0", "0 1 0"]), ("1 0 0", ["0 1 0", "0 0 1"])] {
        let one = joint("ab", "a", "b", &format!("{place}<axis xyz=\"{axis}\"/>"));
        let model = urdf(&(link("a") + &link("b") + &one.replace("continuous", "planar"))).unwrap();
        let said = &model.findings;
        assert!(said.len() == 1 && said[0].text.contains("is planar"), "{said:?}");
        let row = |name: &str, from: &str, to: &str, axis: &str, place: &str| {
            joint(name, from, to, &format!("{place}<axis xyz=\"{axis}\"/>"))
        };
        let chain = link("a")
            + "<link name=\"b#1\"/><link name=\"b#2\"/>"
            + &link("b")
            + &row("ab#1", "a", "b#1", slides[0], place).replace("continuous", "prismatic")
            + &row("ab#2", "b#1", "b#2", slides[1], "").replace("continuous", "prismatic")
            + &row("ab", "b#2", "b", axis, "");
        let mut wanted = urdf(&chain).unwrap();
        for between in &mut wanted.links[1..3] {
            between.nominal = Some(tree::NO_BODY);
        }
        assert_eq!(model.links, wanted.links);
        let again = write::generated(&model, xml::Language::Mjcf).unwrap();
        assert_eq!(write::parse(&again, "again").unwrap().model.freedoms(), 3);
    }
}

#[test]
fn missing_elements_of_an_inertia_are_reported_and_the_rest_is_read() {
    let read = |old: &str, new: &str| {
        let text = link("a") + &link("b").replacen(old, new, 1) + &joint("ab", "a", "b", "");
        let model = urdf(&text).unwrap();
        let said: Vec<String> = model.findings.iter().map(ToString::to_string).collect();
        (model.links[1].nominal, said.join("\n"))
    };
    let mass = "<mass value=\"1\"/>";
    for (new, why) in [
        ("", "link b: line 1: <inertial> has no <mass>; counted as a link without mass"),
        ("<mass/>", "<mass> has no value; counted as"),
        ("<mass value=\"heavy\"/>", "value of <mass> is \"heavy\" and not a number; counted as"),
    ] {
        let (nominal, said) = read(mass, new);
        assert!(nominal.is_none() && said.contains(why) && said.contains("has no mass"), "{said}");
    }
    let (nominal, said) = read(" ixz=\"0\"", "");
    assert_eq!(nominal, read("", "").0);
    assert!(said.contains("<inertia> has no ixz; what is missing of its inertia counts as zero"), "{said}");
    let (nominal, said) = read(" izz=\"1\"", "");
    assert!(nominal.unwrap()[6] == 0.0 && said.contains("has no izz"), "{said}");
}

#[test]
fn links_fixed_together_are_judged_as_one_body_and_repaired() {
    let model = |mass: f64, i: [f64; 3], kind: &str| {
        let mass = format!("value=\"{mass}\"");
        let moments = format!("ixx=\"{}\" iyy=\"{}\" izz=\"{}\"", i[0], i[1], i[2]);
        let c = link("c").replace("value=\"1\"", &mass).replace("ixx=\"1\" iyy=\"1\" izz=\"1\"", &moments);
        let bc = joint("bc", "b", "c", "").replace("continuous", kind);
        let model = urdf(&(link("a") + &link("b") + &c + &joint("ab", "a", "b", "") + &bc)).unwrap();
        let said: Vec<String> = model.findings.iter().map(ToString::to_string).collect();
        (model.possible().0[2], said.join("\n"))
    };
    // A ball of a kilogram of water.
    let radius = (3.0 / (4000.0 * std::f64::consts::PI)).cbrt();
    for kind in ["fixed", "continuous"] {
        let (point, said) = model(1.0, [0.0; 3], kind);
        assert!(
            said.contains("link c: no distribution of mass") && said.contains("ball of 0.124 m"),
            "{said}"
        );
        let point = point.unwrap();
        assert!((point[4] - 0.4 * radius * radius).abs() < 1e-15 && point[0] == 1.0, "{point:?}");
        // The thickness of a plate is lost in the file's digits.
        let (plate, said) = model(1.0, [0.01, 0.01, 0.02001], kind);
        assert!(said.contains("plate a tenth as thick as wide"), "{said}");
        assert_eq!(inertial::impossibility(&plate.unwrap()), None);
        let (sound, said) = model(1.0, [1.0; 3], kind);
        assert!(said.is_empty() && sound.is_some(), "{said}");
        // A whole body's impossible inertia is not to be repaired.
        let (negative, said) = model(1.0, [-0.01, 0.01, 0.01], kind);
        let is_repaired = inertial::impossibility(&negative.unwrap()).is_none();
        assert_eq!((is_repaired, said.contains("is taken as")), (kind == "fixed", kind == "fixed"), "{said}");
        let (ghost, said) = model(0.0, [0.01; 3], kind);
        assert_eq!(
            (ghost.is_none(), said.contains("left out")),
            (kind == "fixed", kind == "fixed"),
            "{said}"
        );
    }
}

#[test]
fn faults_of_a_urdf_are_reported_with_line_link_and_attribute() {
    let good = format!(
        "{}\n{}\n{}",
        link("a"),
        link("b"),
        joint("ab", "a", "b", "<origin xyz=\"0 0 1\"/><axis xyz=\"0 1 0\"/><limit velocity=\"1\"/>")
    );
    assert!(urdf(&good).is_ok());
    for (old, new, line, why) in [
        ("xyz=\"0 0 1\"", "xyz=\"0 0\"", 3, "joint ab: xyz of <origin> is \"0 0\" and not three numbers"),
        ("xyz=\"0 1 0\"", "xyz=\"0,1,0\"", 3, "joint ab: xyz of <axis> is \"0,1,0\""),
        ("velocity=\"1\"", "lower=\"low\"", 3, "joint ab: lower of <limit> is \"low\" and not a number"),
        ("\"continuous\"", "\"hinge\"", 3, "joint ab: its type is \"hinge\"; there are revolute"),
        ("<parent link=\"a\"/>", "", 3, "joint ab: it has no <parent"),
        ("name=\"ab\" ", "", 3, "the joint that holds link b has no name"),
        ("link name=\"b\"", "link", 2, "a link has no name"),
    ] {
        let said = complaint(&good.replacen(old, new, 1));
        assert!(said.contains(&format!("line {line}")) && said.contains(why), "{old}: {said}");
    }
    for macros in [
        good.replacen("\"0 0 1\"", "\"0 0 ${h}\"", 1),
        good.replacen("value=\"1\"", "value=\"${m}\"", 1),
        format!("<xacro:include filename=\"x\"/>{good}"),
        format!("<xacro:include xmlns:xacro=\"http://ros.org/wiki/xacro\" filename=\"x\"/>{good}"),
    ] {
        let said = complaint(&macros);
        assert!(said.contains("expand them first"), "{said}");
    }
}

/// Such parts are in descriptions of iCub, Romeo and Talos, which Pinocchio reads.
#[test]
fn a_urdf_is_read_where_only_unused_parts_are_wrong() {
    let visual = "<visual><geometry><mesh filename=\"x\"/></geometry><material \
                  name=\"m\"><texture/></material></visual>";
    let links = link("a").replace("</link>", &format!("{visual}</link>")) + &link("b") + &link("c");
    let follower = |kind: &str, leader: &str| {
        let mimic = format!("<mimic joint=\"{leader}\"/>");
        joint("ab", "a", "b", "") + &joint("bc", "b", "c", &mimic).replace("continuous", kind)
    };
    let fixed = urdf(&(links.clone() + &follower("fixed", "ab"))).unwrap();
    assert_eq!(fixed.links[2].mimic, None);
    assert!(fixed.findings.is_empty(), "{:?}", fixed.findings);
    let alone = urdf(&(links.clone() + &follower("continuous", "elsewhere"))).unwrap();
    assert_eq!((alone.freedoms(), &alone.links[2].mimic), (2, &None));
    assert!(
        alone.findings.iter().any(|f| f.to_string().contains("mimics elsewhere")),
        "{:?}",
        alone.findings
    );
    let follows = urdf(&(links + &follower("continuous", "ab"))).unwrap();
    assert_eq!(follows.links[2].mimic.as_ref().unwrap().leader, "ab");
}

/// Oracle: inverse dynamics of the tree whose joints are there.
#[test]
fn joints_are_locked_where_they_are_and_their_followers_with_them() {
    use super::dynamics::inverse_dynamics;
    use rigident_shared::tree::BaseMotion;
    let body = link("a")
        + &link("b")
        + &link("c")
        + &link("d")
        + &link("e")
        + &joint("ab", "a", "b", "<origin xyz=\"0.1 0 0.2\" rpy=\"0.1 0.2 0.3\"/><axis xyz=\"0.6 0.8 0\"/>")
        + &joint("bc", "b", "c", "<origin xyz=\"0 0.3 0.2\"/><axis xyz=\"0 0.6 0.8\"/>")
            .replace("continuous", "prismatic")
        + &joint(
            "cd",
            "c",
            "d",
            "<origin xyz=\"0.2 0 0\"/><axis xyz=\"1 0 0\"/><mimic joint=\"ab\" multiplier=\"-2\" \
             offset=\"0.1\"/>",
        )
        + &joint("de", "d", "e", "<origin xyz=\"0.2 0 0.1\"/><axis xyz=\"0 0 1\"/>");
    let whole = urdf(&body).unwrap();
    let mut locked = whole.clone();
    locked.lock(&["ab=0.4".to_owned(), "bc=-0.15".to_owned()]).unwrap();
    assert_eq!(locked.freedoms(), 1);
    let base = BaseMotion {
        specific_force: nalgebra::Vector3::new(1.0, 2.0, 9.0),
        rate: nalgebra::Vector3::new(0.3, -0.2, 0.5),
        angular_acceleration: nalgebra::Vector3::new(-1.0, 0.4, 2.0),
    };
    let wanted = inverse_dynamics(
        &whole,
        &base,
        &[0.4, -0.15, -0.7, 0.9],
        &[0.0, 0.0, 0.0, 2.0],
        &[0.0, 0.0, 0.0, -3.0],
    )
    .unwrap();
    let got = inverse_dynamics(&locked, &base, &[0.9], &[2.0], &[-3.0]).unwrap();
    let wanted = [&wanted[..6], &wanted[9..]].concat();
    for (a, b) in got.iter().zip(&wanted) {
        assert!((a - b).abs() < 1e-12, "{got:?} {wanted:?}");
    }
    for (words, why) in
        [(&["ab=x"][..], "is no number"), (&["zz=1"], "has no joint zz"), (&["ab=1", "ab"], "given twice")]
    {
        let words: Vec<String> = words.iter().map(|w| (*w).to_owned()).collect();
        assert!(whole.clone().lock(&words).unwrap_err().to_string().contains(why), "{words:?}");
    }
    let mut person = human::Person::default().human34().unwrap();
    let neck = person.links.iter().find(|l| l.link.joint == Joint::Spherical).unwrap().joint_name.clone();
    assert!(person.lock(&[format!("{neck}=0.1")]).unwrap_err().to_string().contains("at zero only"));
}

#[test]
fn people_have_the_lengths_of_people() {
    let refused = |person: human::Person| person.human34().unwrap_err().to_string();
    let person = human::Person::default();
    assert!(refused(human::Person { height_m: 174.1, ..person.clone() }).contains("174.1 m"));
    let lengths = |all: &[(&str, f64)]| all.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect::<Vec<_>>();
    let with = |all: &[(&str, f64)]| human::Person { lengths_m: lengths(all), ..person.clone() };
    assert!(refused(with(&[("thigh", 5.0)])).contains("is it in metres"));
    assert!(refused(with(&[("thigh", 0.4), ("thigh", 0.45)])).contains("more than once"));
    assert!(with(&[("thigh", 0.5), ("hand", 0.1)]).human34().is_ok());
}

/// Pinocchio reads these files; each is left as it is but for its inertias.
#[test]
fn a_urdf_that_is_no_xml_is_read_and_kept_as_it_is() {
    let body = format!("{}{}{}", link("a"), link("b"), joint("ab", "a", "b", ""));
    let wanted = urdf(&body).unwrap();
    for text in [
        format!(
            "<robot name=\"r\"><sensor:camera \
             x:y=\"a:b\"><sensor:at>1:2</sensor:at></sensor:camera>{body}</robot>"
        ),
        format!("<robot name=\"r\"><!-- ä -- <b> : -->{body}</robot>"),
        format!("\n <?xml version=\"1.0\"?><robot name=\"r\">{body}</robot>"),
        format!("<robot name=\"r\"><gazebo a=\"&b\">a & b &deg; &amp;</gazebo>{body}</robot>"),
        format!("<!DOCTYPE robot><robot name=\"r\" xmlns:s=\"http://s\"><s:c/><t:c/>{body}</robot>"),
    ] {
        let model = urdf::parse(&text, "r.urdf").unwrap_or_else(|error| panic!("{error}: {text}"));
        assert_eq!(model, wanted, "{text}");
        let edited = write::edited(&model, &text, "r.urdf").unwrap();
        assert!(edited.starts_with(&text[..text.find("<link").unwrap()]), "{edited}");
        assert_eq!(urdf::parse(&edited, "r.urdf").unwrap().links.len(), 2);
    }
    for broken in
        ["<robot", "<!--", "<robot><link name=\"a\"", "<a:", "&", "<?xml", "<![CDATA[", "< <!-- --", "<a 'b"]
    {
        assert!(urdf::parse(broken, "r.urdf").is_err(), "{broken}");
    }
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("latin.urdf");
    std::fs::write(&path, [&b"<robot name=\"r\"><!-- \xe4 -->"[..], body.as_bytes(), b"</robot>"].concat())
        .unwrap();
    assert_eq!(urdf::read(&path).unwrap().links, wanted.links);
}

/// Elements within one another, as deep as the stack of a reader that calls itself for each would not be.
#[test]
fn nested_elements_and_many_links_end_in_words() {
    let bodies = |n: usize| -> String { (0..n).map(|k| format!("<body name=\"b{k}\">")).collect() };
    let mjcf =
        |n: usize| format!("<mujoco><worldbody>{}{}</worldbody></mujoco>", bodies(n), "</body>".repeat(n));
    let nested = |root: &str, tag: &str, n: usize| {
        format!("<{root}>{}{}</{root}>", format!("<{tag}>").repeat(n), format!("</{tag}>").repeat(n))
    };
    for text in [
        mjcf(4500),
        nested("mujoco", "default", 4500),
        nested("robot", "link", 100_000),
        nested("sdf", "model", 100_000),
    ] {
        let said = crate::write::parse(&text, "deep").map(|_| ()).unwrap_err().to_string();
        assert!(said.contains("within more than 256 elements"), "{said}");
    }
    assert!(crate::write::parse(&mjcf(200), "deep").is_ok());
    let links = |n: usize| -> String {
        let link = |k: usize| format!("<link name=\"l{k}\"/>");
        let joint = |k: usize| {
            format!(
                "<joint name=\"j{k}\" type=\"fixed\"><parent link=\"l{}\"/><child link=\"l{k}\"/></joint>",
                k - 1
            )
        };
        let (links, joints): (String, String) = ((0..n).map(link).collect(), (1..n).map(joint).collect());
        format!("<robot name=\"r\">{links}{joints}</robot>")
    };
    let said = crate::urdf::parse(&links(20_000), "long").unwrap_err().to_string();
    assert!(said.contains("20000 links"), "{said}");
    assert!(crate::urdf::parse(&links(crate::tree::MOST_LINKS), "long").is_ok());
}

#[test]
fn names_with_control_characters_are_refused_in_every_language() {
    for bad in ["a&#10;movej", "a&#x9b;8m", "a&#x202e;b", "a&#13;"] {
        for text in [
            format!("<robot name=\"r\"><link name=\"{bad}\"/></robot>"),
            format!("<mujoco><worldbody><body name=\"{bad}\"/></worldbody></mujoco>"),
            format!("<sdf version=\"1.9\"><model name=\"m\"><link name=\"{bad}\"/></model></sdf>"),
        ] {
            let said = crate::write::parse(&text, "x").map(|_| ()).unwrap_err().to_string();
            assert!(said.contains("control characters"), "{said} {text}");
            assert!(!said.chars().any(rigident_shared::printable::steers), "{said:?}");
        }
    }
    let named = crate::urdf::parse("<robot name=\"a&#10;b\"><link name=\"x\"/></robot>", "x").unwrap();
    assert_eq!(named.name, "a\u{fffd}b");
}
