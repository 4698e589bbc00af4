//! OpenSim models (`.osim`): bodies with mass, centre of mass and tensor, and the joints between them, of both layouts: a `Joint`
//! inside of every body (before version 4), and a `JointSet` beside the bodies.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{Isometry3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::{Document, Node, ParsingOptions};

use super::error::OpenSimError;
use super::functions::{Function, numbers, one, place};

/// A model.
#[derive(Clone, Debug, PartialEq)]
pub struct OsimModel {
    /// Its bodies, the ground left out.
    pub bodies: Vec<OsimBody>,
    /// The joints between them.
    pub joints: Vec<OsimJoint>,
}

/// A body in its own axes (x forward, y up, z to the right in the standing pose).
#[derive(Clone, Debug, PartialEq)]
pub struct OsimBody {
    /// Its name.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass, m.
    pub com_m: [f64; 3],
    /// Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of mass, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// Where in the text these stand: mass, centre of mass, then one place for the tensor or six in the order above.
    pub places: Vec<Range<usize>>,
}

/// A joint at the model's default coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct OsimJoint {
    /// Its name.
    pub name: String,
    /// The body that carries it; `None`: the ground.
    pub parent: Option<usize>,
    /// The body beyond it.
    pub child: usize,
    /// The joint in the parent.
    pub in_parent: Isometry3<f64>,
    /// The joint in the child.
    pub in_child: Isometry3<f64>,
    /// How it is displaced.
    pub moved: Isometry3<f64>,
}

impl OsimModel {
    /// Reads the text of a model.
    ///
    /// # Errors
    /// [`OpenSimError::Missing`] names what is wrong with which element.
    pub fn parse(text: &str) -> Result<Self, OpenSimError> {
        let missing = |what: String| OpenSimError::Missing(what);
        let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
        let document = Document::parse_with_options(text, options)
            .map_err(|error| missing(format!("it is no XML: {error}")))?;
        let root = document.root_element();
        if !root.has_tag_name("OpenSimDocument") {
            return Err(missing("it is no model of OpenSim's: its root is no OpenSimDocument".to_owned()));
        }
        let is_body = |node: &Node| node.has_tag_name("Body") && node.children().any(|c| c.has_tag_name("mass"));
        let nodes: Vec<Node> = root.descendants().filter(is_body).collect();
        let named = |node: &&Node| node.attribute("name") != Some("ground");
        let nodes: Vec<Node> = nodes.iter().filter(named).copied().collect();
        let bodies: Vec<OsimBody> = nodes.iter().map(body).collect::<Result<_, _>>().map_err(missing)?;
        if bodies.is_empty() {
            return Err(missing("the model has no bodies".to_owned()));
        }
        let index: BTreeMap<&str, usize> = bodies.iter().enumerate().map(|(k, b)| (b.name.as_str(), k)).collect();
        if index.len() < bodies.len() {
            return Err(missing("two bodies have the same name".to_owned()));
        }
        let is_joint = |node: &Node| node.tag_name().name().ends_with("Joint") && node.attribute("name").is_some();
        let mut joints = Vec::new();
        for node in root.descendants().filter(is_joint) {
            let inside = node.ancestors().find(is_body).and_then(|b| b.attribute("name"));
            if let Some(joint) = joint(&node, inside, &index).map_err(missing)? {
                joints.push(joint);
            }
        }
        Ok(Self { bodies, joints })
    }
}

fn body(node: &Node) -> Result<OsimBody, String> {
    let name = node.attribute("name").unwrap_or_default().to_owned();
    let three = |tag: &str| -> Result<[f64; 3], String> {
        numbers(node, tag)?.try_into().map_err(|_| format!("{tag} of {}: three numbers are needed", place(node)))
    };
    const PARTS: [&str; 6] =
        ["inertia_xx", "inertia_yy", "inertia_zz", "inertia_xy", "inertia_xz", "inertia_yz"];
    let together = node.children().any(|c| c.has_tag_name("inertia"));
    let inertia: [f64; 6] = if together {
        numbers(node, "inertia")?
            .try_into()
            .map_err(|_| format!("inertia of {}: six numbers are needed", place(node)))?
    } else {
        let mut all = [0.0; 6];
        for (value, tag) in all.iter_mut().zip(PARTS) {
            *value = one(node, tag)?;
        }
        all
    };
    let tags: &[&str] = if together { &["inertia"] } else { &PARTS };
    let range = |tag: &&str| {
        let text = node.children().find(|c| c.has_tag_name(*tag))?.first_child()?;
        Some(text.range())
    };
    let places = ["mass", "mass_center"].iter().chain(tags).filter_map(range).collect();
    let mass_kg = one(node, "mass")?;
    if mass_kg < 0.0 {
        return Err(format!("{}: its mass is negative", place(node)));
    }
    Ok(OsimBody { name, mass_kg, com_m: three("mass_center")?, inertia_com_kgm2: inertia, places })
}

/// A translation and turns about x, then y, then z of the turned axes.
fn offset(at: &[f64], turned: &[f64]) -> Isometry3<f64> {
    let about = |k: usize| turned.get(k).copied().unwrap_or(0.0);
    let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), about(0))
        * Rotation3::from_axis_angle(&Vector3::y_axis(), about(1))
        * Rotation3::from_axis_angle(&Vector3::z_axis(), about(2));
    let at = |k: usize| at.get(k).copied().unwrap_or(0.0);
    Isometry3::from_parts(Translation3::new(at(0), at(1), at(2)), UnitQuaternion::from_rotation_matrix(&turn))
}

fn joint(
    node: &Node,
    inside: Option<&str>,
    bodies: &BTreeMap<&str, usize>,
) -> Result<Option<OsimJoint>, String> {
    let text = |tag: &str| node.children().find(|c| c.has_tag_name(tag)).and_then(|c| c.text()).map(str::trim);
    let (parent, in_parent, child, in_child) = if let Some(parent) = text("parent_body") {
        let Some(child) = inside else { return Ok(None) };
        let [a, b] = [["location_in_parent", "orientation_in_parent"], ["location", "orientation"]]
            .map(|[at, turned]| (numbers(node, at), numbers(node, turned)));
        (parent.to_owned(), offset(&a.0?, &a.1?), child.to_owned(), offset(&b.0?, &b.1?))
    } else {
        let [parent, child] = ["socket_parent_frame", "socket_child_frame"].map(text);
        let (Some(parent), Some(child)) = (parent, child) else { return Ok(None) };
        let (a, b) = (frame(node, parent)?, frame(node, child)?);
        (a.0, a.1, b.0, b.1)
    };
    let find = |name: &str| bodies.get(name).copied();
    let child = find(&child).ok_or_else(|| format!("{}: there is no body {child}", place(node)))?;
    let ground = parent == "ground";
    let parent = find(&parent);
    if parent.is_none() && !ground {
        return Err(format!("{}: its parent is no body of the model", place(node)));
    }
    let name = node.attribute("name").unwrap_or_default().to_owned();
    Ok(Some(OsimJoint { name, parent, child, in_parent, in_child, moved: moved(node)? }))
}

/// The body of a joint's frame, and the frame in it: an offset that the joint owns, or the body itself.
fn frame(node: &Node, name: &str) -> Result<(String, Isometry3<f64>), String> {
    let own = |n: &Node| n.has_tag_name("PhysicalOffsetFrame") && n.attribute("name") == Some(name);
    let last = |path: &str| path.trim().rsplit('/').next().unwrap_or_default().to_owned();
    match node.descendants().find(own) {
        None => Ok((last(name), Isometry3::identity())),
        Some(frame) => {
            let parent = frame.children().find(|c| c.has_tag_name("socket_parent")).and_then(|c| c.text());
            let parent = parent.ok_or_else(|| format!("{}: it has no socket_parent", place(&frame)))?;
            let place = offset(&numbers(&frame, "translation")?, &numbers(&frame, "orientation")?);
            Ok((last(parent), place))
        }
    }
}

/// How a joint is displaced at the default values of its coordinates.
fn moved(node: &Node) -> Result<Isometry3<f64>, String> {
    let mut values = BTreeMap::new();
    for coordinate in node.descendants().filter(|n| n.has_tag_name("Coordinate")) {
        let name = coordinate.attribute("name").unwrap_or_default();
        values.insert(name, one(&coordinate, "default_value").unwrap_or(0.0));
    }
    let axes: Vec<Node> = node.descendants().filter(|n| n.has_tag_name("TransformAxis")).collect();
    if axes.is_empty() {
        // Of a pin joint the coordinate turns about z; welded ones have none.
        let angle = values.values().next().copied().filter(|_| node.has_tag_name("PinJoint")).unwrap_or(0.0);
        return Ok(Isometry3::rotation(Vector3::z() * angle));
    }
    let (mut turn, mut shift) = (UnitQuaternion::identity(), Vector3::zeros());
    for axis in axes {
        let named = axis.children().find(|c| c.has_tag_name("coordinates")).and_then(|c| c.text());
        let value = named.and_then(|n| values.get(n.trim())).copied().unwrap_or(0.0);
        let along = Vector3::from_row_slice(&{
            let all = numbers(&axis, "axis")?;
            <[f64; 3]>::try_from(all).map_err(|_| format!("axis of {}: three numbers are needed", place(&axis)))?
        });
        let size = Function::of(&axis)?.at(value);
        if axis.attribute("name").is_some_and(|n| n.starts_with("rotation")) {
            let Some(along) = Unit::try_new(along, 1e-9) else {
                return Err(format!("axis of {}: it has no length", place(&axis)));
            };
            turn *= UnitQuaternion::from_axis_angle(&along, size);
        } else {
            shift += along * size;
        }
    }
    Ok(Isometry3::from_parts(shift.into(), turn))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shared(file: &str) -> String {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(file);
        std::fs::read_to_string(path).unwrap()
    }

    #[test]
    #[ignore = "needs ../shared/data"]
    fn models_of_both_layouts_in_shared_data_have_the_mass_of_their_subjects() {
        for (file, bodies, kg) in [
            ("human_gait2354_subject01_walk/subject01.osim", 12, 72.6),
            ("human_rajagopal2016_walk/subject_walk_scaled.osim", 22, 85.27),
        ] {
            let model = OsimModel::parse(&shared(file)).unwrap();
            assert_eq!((model.bodies.len(), model.joints.len()), (bodies, bodies));
            let mass: f64 = model.bodies.iter().map(|b| b.mass_kg).sum();
            assert!((mass - kg).abs() < 0.1, "{mass}");
        }
    }
}
