//! The shapes of a URDF's links: where matter can be, and roughly how it is spread.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

use super::surface::{self, Surface};
use crate::loose_xml::tidied;
use crate::urdf::{place, three};
use crate::xml::{child, parsed};

/// The shapes of a link, in its frame, taken for a shell of one thickness.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Centre of that shell, m.
    pub centre: Vector3<f64>,
    /// Second moments of its mass about that centre over the mass, m².
    pub second: Matrix3<f64>,
    /// The box around its simple shapes, visual and collision; `None` where one of them is a mesh.
    pub simple: Option<(Vector3<f64>, Vector3<f64>)>,
}

/// Returns the shapes of a URDF's links by their names; `path` is where the text is. Links with a mesh that
/// is not there or cannot be read have none, unless what they collide with can be read.
#[must_use]
pub fn shapes(text: &str, path: &Path) -> BTreeMap<String, Shape> {
    let tidy = tidied(text);
    let Ok(document) = parsed(&tidy) else { return BTreeMap::new() };
    let mut reader = Reader::beside(path);
    let links = document.root_element().children().filter(|n| n.has_tag_name("link"));
    links.filter_map(|link| Some((link.attribute("name")?.to_owned(), reader.shape(&link)?))).collect()
}

/// A box round one shape of a link, in the link's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeBox {
    /// The axes of the box, as columns.
    pub rotation: Matrix3<f64>,
    /// The centre of the box, m.
    pub centre: Vector3<f64>,
    /// Half of the box's edges, m.
    pub half: Vector3<f64>,
}

/// Returns the boxes round what the links of a URDF collide with, or are seen as where they collide with
/// nothing, by their names; links without shapes are left out, and `None` is of a link with one that cannot
/// be read.
#[must_use]
pub fn boxes(text: &str, path: &Path) -> BTreeMap<String, Option<Vec<ShapeBox>>> {
    let tidy = tidied(text);
    let Ok(document) = parsed(&tidy) else { return BTreeMap::new() };
    let mut reader = Reader::beside(path);
    let links = document.root_element().children().filter(|n| n.has_tag_name("link"));
    let own = links.filter_map(|link| {
        let has = |tag: &&str| link.children().any(|n| n.has_tag_name(*tag));
        let tag = ["collision", "visual"].into_iter().find(has)?;
        Some((link.attribute("name")?.to_owned(), reader.boxes(&link, tag)))
    });
    own.collect()
}

struct Reader {
    folder: PathBuf,
    /// Surfaces by file and scale.
    meshes: BTreeMap<(PathBuf, [u64; 3]), Option<Surface>>,
}

impl Reader {
    /// Returns the reader of a description that is at a path.
    fn beside(path: &Path) -> Self {
        let folder = std::path::absolute(path).ok().and_then(|path| Some(path.parent()?.to_owned()));
        Self { folder: folder.unwrap_or_default(), meshes: BTreeMap::new() }
    }

    /// Returns the boxes round a link's shapes of a kind; `None` if one cannot be read.
    fn boxes(&mut self, link: &Node, tag: &str) -> Option<Vec<ShapeBox>> {
        let mut all = Vec::new();
        for shape in link.children().filter(|n| n.has_tag_name(tag)) {
            let geometry = child(&shape, "geometry")?.children().find(Node::is_element)?;
            let (middle, half) = if geometry.tag_name().name() == "mesh" {
                let surface = self.mesh(&geometry)?;
                ((surface.low + surface.high) / 2.0, (surface.high - surface.low) / 2.0)
            } else {
                (Vector3::zeros(), sizes(&geometry)?.0)
            };
            let (rotation, centre) = place(&shape);
            let numbers = centre.iter().chain(rotation.iter()).chain(half.iter());
            if numbers.copied().any(|v| !v.is_finite()) || half.min() < 0.0 {
                return None;
            }
            all.push(ShapeBox { rotation, centre: centre + rotation * middle, half });
        }
        Some(all)
    }

    fn shape(&mut self, link: &Node) -> Option<Shape> {
        let all = ["visual", "collision"].map(|tag| self.surface(link, tag));
        let simple = simple(link);
        let surface = all.into_iter().flatten().next()?;
        let centre = surface.first / surface.area;
        let second = surface.second / surface.area - centre * centre.transpose();
        Some(Shape { centre, second, simple })
    }

    /// Returns the sum of a link's shapes of a kind; `None` without any, or if one cannot be read.
    fn surface(&mut self, link: &Node, tag: &str) -> Option<Surface> {
        let mut sum: Option<Surface> = None;
        for shape in link.children().filter(|n| n.has_tag_name(tag)) {
            let geometry = child(&shape, "geometry")?.children().find(Node::is_element)?;
            let own = if geometry.tag_name().name() == "mesh" {
                self.mesh(&geometry)?
            } else {
                primitive(&geometry)?
            };
            let (turn, at) = place(&shape);
            let own = own.moved(&turn, &at);
            sum = Some(sum.map_or_else(|| own.clone(), |sum| sum.with(&own)));
        }
        sum
    }

    fn mesh(&mut self, geometry: &Node) -> Option<Surface> {
        let path = self.find(geometry.attribute("filename")?)?;
        let scale = three(geometry, "scale").unwrap_or([1.0; 3]);
        let key = (path, scale.map(f64::to_bits));
        if let Some(known) = self.meshes.get(&key) {
            return known.clone();
        }
        let surface = surface::read(&key.0, &Vector3::from(scale));
        self.meshes.insert(key, surface.clone());
        surface
    }

    /// Finds a mesh: `package://NAME/…` where a folder above the description is, or holds, that package.
    fn find(&self, name: &str) -> Option<PathBuf> {
        let is_file = |path: PathBuf| path.is_file().then_some(path);
        let Some(in_package) = name.strip_prefix("package://").or_else(|| name.strip_prefix("model://"))
        else {
            return is_file(self.folder.join(name.strip_prefix("file://").unwrap_or(name)));
        };
        let (package, rest) = in_package.split_once('/')?;
        self.folder.ancestors().find_map(|above| {
            let own = above.file_name().is_some_and(|name| name == package).then(|| above.join(rest));
            own.and_then(is_file).or_else(|| is_file(above.join(in_package)))
        })
    }
}

/// Returns a simple shape about its own centre.
fn primitive(geometry: &Node) -> Option<Surface> {
    let (half, second, area) = sizes(geometry)?;
    Some(Surface::of_body(area, half, second))
        .filter(|surface| surface.area > 0.0 && surface.area.is_finite())
}

/// Returns half the box around a simple shape, m, its second moments over its mass, m², and its area, m².
fn sizes(geometry: &Node) -> Option<(Vector3<f64>, Vector3<f64>, f64)> {
    let number = |attribute: &str| geometry.attribute(attribute)?.trim().parse::<f64>().ok();
    let turn = std::f64::consts::TAU;
    Some(match geometry.tag_name().name() {
        "box" => {
            let size = Vector3::from(three(geometry, "size")?);
            let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
            (size / 2.0, size.component_mul(&size) / 12.0, area)
        }
        "cylinder" => {
            let (r, l) = (number("radius")?, number("length")?);
            let second = Vector3::new(r * r / 4.0, r * r / 4.0, l * l / 12.0);
            (Vector3::new(r, r, l / 2.0), second, turn * r * (r + l))
        }
        "capsule" => {
            let (r, l) = (number("radius")?, number("length")?);
            let second = Vector3::new(r * r / 4.0, r * r / 4.0, (l / 2.0 + r).powi(2) / 3.0);
            (Vector3::new(r, r, l / 2.0 + r), second, turn * r * (l + 2.0 * r))
        }
        "sphere" => {
            let r = number("radius")?;
            (Vector3::repeat(r), Vector3::repeat(r * r / 5.0), 2.0 * turn * r * r)
        }
        _ => return None,
    })
}

/// Returns the box around a link's shapes if all are simple.
fn simple(link: &Node) -> Option<(Vector3<f64>, Vector3<f64>)> {
    let mut all: Option<(Vector3<f64>, Vector3<f64>)> = None;
    for shape in link.children().filter(|n| n.has_tag_name("collision") || n.has_tag_name("visual")) {
        let geometry = child(&shape, "geometry")?.children().find(Node::is_element)?;
        let (half, ..) = sizes(&geometry)?;
        let (turn, centre) = place(&shape);
        let reach = turn.abs() * half;
        let (low, high) = (centre - reach, centre + reach);
        all = Some(all.map_or((low, high), |(l, h)| (l.inf(&low), h.sup(&high))));
    }
    all
}
