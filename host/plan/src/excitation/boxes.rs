//! Boxes round the links: from a file, from the model's shapes, or about its joints.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Rotation3, Vector3};
use rigident_shared::tree::Joint;
use serde::{Deserialize, Serialize};

use rigident_model::Model;
use rigident_model::check::shapes::ShapeBox;

/// Half the thickness of a link of which only joints are known, as a share of the robot's reach.
const RADIUS: f64 = 0.05;

/// A file of boxes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxFile {
    /// The boxes; a link that has one has no others.
    #[serde(default, rename = "box", skip_serializing_if = "Vec::is_empty")]
    pub boxes: Vec<BoxTable>,
    /// Links without a box.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub no_box: Vec<String>,
    /// Pairs of links that are not examined.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skip_pairs: Vec<[String; 2]>,
}

/// `[[box]]`
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxTable {
    /// The box's link in the model.
    pub link: String,
    /// The box's edges, m.
    pub size_m: [f64; 3],
    /// The box's centre in the link's frame, m.
    #[serde(default)]
    pub position_m: [f64; 3],
    /// The box's attitude in the link's frame, Rz(yaw) Ry(pitch) Rx(roll), rad.
    #[serde(default)]
    pub rpy_rad: [f64; 3],
}

/// A box of a body, which is a link with all that is fixed to it, in the body's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyBox {
    /// The body, by its index in the model without fixed joints.
    pub body: usize,
    /// The link that it is round.
    pub link: String,
    /// The box's axes, as columns.
    pub rotation: Matrix3<f64>,
    /// The box's centre, m.
    pub centre: Vector3<f64>,
    /// Half of its edges, m.
    pub half: Vector3<f64>,
}

/// Boxes of all links, and what to know of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Boxes {
    /// The boxes.
    pub all: Vec<BodyBox>,
    /// Links whose boxes are made about their joints.
    pub guessed: Vec<String>,
    /// Half of the thickness of those, m.
    pub radius_m: f64,
}

impl BoxFile {
    /// Reads the text of a file for a model; `what` names it in complaints.
    ///
    /// # Errors
    /// Says what is wrong, where, and what to do.
    pub fn parse(text: &str, what: &str, model: &Model) -> Result<Self, String> {
        let file: Self = toml::from_str(text).map_err(|e| format!("{what}: {}", e.to_string().trim_end()))?;
        let named = file
            .boxes
            .iter()
            .map(|own| &own.link)
            .chain(&file.no_box)
            .chain(file.skip_pairs.iter().flatten());
        for name in named {
            if model.link(name).is_none() {
                let links: Vec<&str> = model.links.iter().map(|l| l.name.as_str()).collect();
                return Err(format!(
                    "{what}: {} has no link {name}; its links are {}",
                    model.name,
                    links.join(", ")
                ));
            }
        }
        for own in &file.boxes {
            let numbers = own.size_m.iter().chain(&own.position_m).chain(&own.rpy_rad);
            if numbers.into_iter().any(|v| !v.is_finite()) || own.size_m.iter().any(|v| *v <= 0.0) {
                return Err(format!(
                    "{what}: [[box]] of {}: size_m {:?} and its place must be finite numbers, sizes above \
                     zero, m",
                    own.link, own.size_m
                ));
            }
        }
        Ok(file)
    }
}

/// Returns the boxes of a model, whose fixed joints are still there: the file's, else those of its `shapes`,
/// else, of links that have mass or a shape that cannot be read, one about the joints that it holds and its
/// centre of mass, `radius_m` about them.
pub fn boxes(
    model: &Model,
    shapes: &BTreeMap<String, Option<Vec<ShapeBox>>>,
    file: &BoxFile,
    radius_m: Option<f64>,
) -> Boxes {
    let mut places: Vec<(usize, Matrix3<f64>, Vector3<f64>)> = Vec::new();
    let (mut bodies, mut from_base) = (0, vec![0.0; model.links.len()]);
    for (i, link) in model.links.iter().enumerate() {
        let own = &link.link;
        let place = match places.get(own.parent).filter(|_| i > 0) {
            Some((body, r, p)) if own.joint == Joint::Fixed => {
                (*body, r * own.rotation, p + r * own.position)
            }
            Some(_) => {
                bodies += 1;
                (bodies, Matrix3::identity(), Vector3::zeros())
            }
            None => (0, Matrix3::identity(), Vector3::zeros()),
        };
        places.push(place);
        from_base[i] = if i == 0 { 0.0 } else { from_base[own.parent] + own.position.norm() };
    }
    let radius_m = radius_m.unwrap_or(RADIUS * from_base.iter().fold(0.0, |most: f64, v| v.max(most)));
    let mut found = Boxes { radius_m, ..Boxes::default() };
    for (i, (link, (body, r, p))) in model.links.iter().zip(&places).enumerate() {
        let name = &link.name;
        let of_file: Vec<ShapeBox> =
            file.boxes.iter().filter(|own| own.link == *name).map(of_table).collect();
        let own = match (of_file.is_empty(), shapes.get(name)) {
            _ if file.no_box.contains(name) => Vec::new(),
            (false, _) => of_file,
            (true, Some(Some(own))) => own.clone(),
            (true, unread) if unread.is_some() || (link.is_body() && link.nominal.is_some()) => {
                found.guessed.push(name.clone());
                vec![about_joints(model, i, radius_m)]
            }
            _ => Vec::new(),
        };
        found.all.extend(own.into_iter().map(|own| BodyBox {
            body: *body,
            link: name.clone(),
            rotation: r * own.rotation,
            centre: p + r * own.centre,
            half: own.half,
        }));
    }
    found
}

fn of_table(own: &BoxTable) -> ShapeBox {
    let [roll, pitch, yaw] = own.rpy_rad;
    ShapeBox {
        rotation: Rotation3::from_euler_angles(roll, pitch, yaw).into_inner(),
        centre: Vector3::from(own.position_m),
        half: Vector3::from(own.size_m) / 2.0,
    }
}

/// Returns the box about a link's own joint, those of the links that it holds and its centre of mass.
fn about_joints(model: &Model, i: usize, radius_m: f64) -> ShapeBox {
    let below = model.links.iter().skip(1).filter(|l| l.link.parent == i).map(|l| l.link.position);
    let body = model.links[i].nominal.filter(|phi| phi[0] > 0.0);
    let centre = body.map(|phi| Vector3::new(phi[1], phi[2], phi[3]) / phi[0]);
    let (mut low, mut high) = (Vector3::zeros(), Vector3::zeros());
    for point in below.chain(centre) {
        (low, high) = (low.inf(&point), high.sup(&point));
    }
    ShapeBox {
        rotation: Matrix3::identity(),
        centre: (low + high) / 2.0,
        half: (high - low) / 2.0 + Vector3::repeat(radius_m),
    }
}
