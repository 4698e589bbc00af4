//! What is wrong with a model is named, and said what to do about.

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
        "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{rest}</joint>"
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
        said.iter().any(|s| s.starts_with("joint bc: never moves") && s.contains("--lock bc")),
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
fn rig_files_give_the_same_trees() {
    let text = r#"
[[link]]
name = "base"
[[link]]
name = "arm"
parent = "base"
joint = "universal"
position_m = [0.03, 0.0, 0.065]
[[link]]
name = "slide"
parent = "arm"
joint = "prismatic"
axis = [0, 0, 2]
"#;
    let rig = crate::formats::rig::RigFile::parse(text).unwrap();
    let model = rig_links::from_tables(&rig.link, "two.rig.toml").unwrap();
    assert_eq!(model.links[1].link.joint, Joint::Universal(nalgebra::Vector3::x(), nalgebra::Vector3::y()));
    assert_eq!(model.links[2].link.joint, Joint::Prismatic(nalgebra::Vector3::z()));
    assert_eq!(model.freedoms(), 3);
    let said = rig_links::from_tables(&[], "two.rig.toml").unwrap_err().to_string();
    assert!(said.contains("no [[link]] table"), "{said}");
    let bare = text.replace("joint = \"universal\"\n", "");
    let rig = crate::formats::rig::RigFile::parse(&bare).unwrap();
    let said = rig_links::from_tables(&rig.link, "two.rig.toml").unwrap_err().to_string();
    assert!(said.contains("arm: needs its joint"), "{said}");
}
