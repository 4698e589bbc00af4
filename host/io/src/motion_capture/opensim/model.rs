//! OpenSim models (`.osim`): bodies with mass, centre of mass and tensor, and the joints between them, of
//! both layouts: a `Joint` inside of every body (before version 4), and a `JointSet` beside the bodies.

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{Isometry3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::{Document, Node, ParsingOptions};

use super::error::OpenSimError;
use super::functions::{Function, numbers, one, place};

/// A model.
#[derive(Clone, Debug, PartialEq)]
pub struct OsimModel {
    /// The bodies of the model, without the ground.
    pub bodies: Vec<OsimBody>,
    /// The joints between them.
    pub joints: Vec<OsimJoint>,
}

/// A body in its own axes (x forward, y up, z to the right in the standing pose).
#[derive(Clone, Debug, PartialEq)]
pub struct OsimBody {
    /// The name of the body.
    pub name: String,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass, m.
    pub com_m: [f64; 3],
    /// Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of mass, kg m².
    pub inertia_com_kgm2: [f64; 6],
    /// The places in the text of these: mass, centre of mass, then one place for the tensor or six in the
    /// order above.
    pub places: Vec<Range<usize>>,
}

/// A joint at the model's default coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct OsimJoint {
    /// The name of the joint.
    pub name: String,
    /// The body that carries it; `None`: the ground.
    pub parent: Option<usize>,
    /// The body beyond it.
    pub child: usize,
    /// The joint in the parent.
    pub in_parent: Isometry3<f64>,
    /// The joint in the child.
    pub in_child: Isometry3<f64>,
    /// The displacement of the joint.
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
        let is_body =
            |node: &Node| node.has_tag_name("Body") && node.children().any(|c| c.has_tag_name("mass"));
        let nodes: Vec<Node> = root.descendants().filter(is_body).collect();
        let named = |node: &&Node| node.attribute("name") != Some("ground");
        let nodes: Vec<Node> = nodes.iter().filter(named).copied().collect();
        let bodies: Vec<OsimBody> = nodes.iter().map(body).collect::<Result<_, _>>().map_err(missing)?;
        if bodies.is_empty() {
            return Err(missing("the model has no bodies".to_owned()));
        }
        let index: BTreeMap<&str, usize> =
            bodies.iter().enumerate().map(|(k, b)| (b.name.as_str(), k)).collect();
        if index.len() < bodies.len() {
            return Err(missing("two bodies have the same name".to_owned()));
        }
        let is_joint =
            |node: &Node| node.tag_name().name().ends_with("Joint") && node.attribute("name").is_some();
        let mut joints = Vec::new();
        for node in root.descendants().filter(is_joint) {
            let inside = node.ancestors().find(is_body).and_then(|b| b.attribute("name"));
            if let Some(joint) = joint(&node, inside, &index).map_err(missing)? {
                joints.push(joint);
            }
        }
        Ok(Self { bodies, joints })
    }

    /// Returns the number of a body.
    pub fn body(&self, name: &str) -> Option<usize> {
        self.bodies.iter().position(|body| body.name == name)
    }

    /// Returns the joint that carries a body, the first if there are several.
    pub fn carrier(&self, body: usize) -> Option<&OsimJoint> {
        self.joints.iter().find(|joint| joint.child == body)
    }

    /// Returns where every body is at the default coordinates, ground ← body, m; `None` for one that no
    /// joints lead to.
    pub fn places(&self) -> Vec<Option<Isometry3<f64>>> {
        let mut places: Vec<Option<Isometry3<f64>>> = vec![None; self.bodies.len()];
        // In the worst order each round finds one more.
        for _ in 0..self.bodies.len() {
            for body in 0..self.bodies.len() {
                let Some(joint) = self.carrier(body).filter(|_| places[body].is_none()) else { continue };
                let parent = joint.parent.map_or(Some(Isometry3::identity()), |parent| places[parent]);
                places[body] = parent.map(|p| p * joint.in_parent * joint.moved * joint.in_child.inverse());
            }
        }
        places
    }

    /// Returns where the joint that carries a body is at the default coordinates, in the ground, m.
    pub fn joint_centre(&self, name: &str) -> Option<Vector3<f64>> {
        let body = self.body(name)?;
        let place = self.places().get(body).copied().flatten()?;
        Some((place * self.carrier(body)?.in_child).translation.vector)
    }

    /// Returns the lengths between joint centres that its bodies tell, m, by the names that lengths of people
    /// have here; of left and right the mean.
    pub fn lengths(&self) -> Vec<(String, f64)> {
        let apart = |a: &str, b: &str| Some((self.joint_centre(a)? - self.joint_centre(b)?).norm());
        let along = |from: &str, to: &str| {
            let sides = ["_r", "_l"].map(|side| apart(&format!("{from}{side}"), &format!("{to}{side}")));
            let found: Vec<f64> = sides.into_iter().flatten().collect();
            (!found.is_empty()).then(|| found.iter().sum::<f64>() / found.len() as f64)
        };
        let all = [
            ("thigh", along("femur", "tibia")),
            ("shank", along("tibia", "talus")),
            ("upper_arm", along("humerus", "ulna")),
            ("forearm", along("ulna", "hand")),
            ("hip_width", apart("femur_r", "femur_l")),
            ("shoulder_width", apart("humerus_r", "humerus_l")),
        ];
        all.into_iter().filter_map(|(name, length)| Some((name.to_owned(), length?))).collect()
    }

    /// Returns the text that the model was read from with other bodies, in the model's order; everything else
    /// stays as it is, and so do bodies that are the same.
    ///
    /// # Errors
    /// [`OpenSimError::Missing`] if the text is another one.
    pub fn written(&self, text: &str, bodies: &[OsimBody]) -> Result<String, OpenSimError> {
        let other = || OpenSimError::Missing("the model was changed while it was used".to_owned());
        let mut edits: Vec<(Range<usize>, String)> = Vec::new();
        for (old, new) in self.bodies.iter().zip(bodies).filter(|(old, new)| old != new) {
            let row = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
            let mut texts = vec![row(&[new.mass_kg]), row(&new.com_m)];
            match old.places.len() {
                3 => texts.push(row(&new.inertia_com_kgm2)),
                8 => texts.extend(new.inertia_com_kgm2.iter().map(|v| row(&[*v]))),
                _ => return Err(other()),
            }
            edits.extend(old.places.iter().cloned().zip(texts));
        }
        edits.sort_by_key(|(at, _)| std::cmp::Reverse(at.start));
        let mut out = text.to_owned();
        for (at, new) in edits {
            if text.get(at.clone()).is_none() {
                return Err(other());
            }
            out.replace_range(at, &new);
        }
        Ok(out)
    }
}

fn body(node: &Node) -> Result<OsimBody, String> {
    let name = node.attribute("name").unwrap_or_default().to_owned();
    let three = |tag: &str| -> Result<[f64; 3], String> {
        numbers(node, tag)?
            .try_into()
            .map_err(|_| format!("{tag} of {}: three numbers are needed", place(node)))
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

/// Returns a translation with turns about x, then y, then z of the turned axes.
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
    let text =
        |tag: &str| node.children().find(|c| c.has_tag_name(tag)).and_then(|c| c.text()).map(str::trim);
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

/// Returns the body of a joint's frame, and the frame in that body: an offset that the joint owns, or the
/// body itself.
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

/// Returns how a joint is displaced at the default values of its coordinates.
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
            <[f64; 3]>::try_from(all)
                .map_err(|_| format!("axis of {}: three numbers are needed", place(&axis)))?
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
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(file);
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
