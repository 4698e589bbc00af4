//! Area and its moments of the surfaces of meshes: STL, OBJ and COLLADA.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, Matrix4, Point3, Rotation3, Unit, Vector3};
use rigident_files::MOST_OF_MESH;
use roxmltree::{Document, Node};

use crate::xml::{child, parsed};

/// Deeper nodes of a COLLADA scene are not followed: it may contain itself.
const DEEPEST: usize = 32;
/// More nodes, or triangles, make no surface: they may contain each other many times over.
const MOST: [usize; 2] = [100_000, 20_000_000];

pub(crate) type Triangle = [Point3<f64>; 3];

/// A surface: area, its first and second moments about the origin, and the box around it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Surface {
    /// m²
    pub(super) area: f64,
    /// m³
    pub(super) first: Vector3<f64>,
    /// m⁴
    pub(super) second: Matrix3<f64>,
    /// Least coordinates.
    pub(super) low: Vector3<f64>,
    /// Largest coordinates.
    pub(super) high: Vector3<f64>,
}

impl Surface {
    /// Returns a body of this area whose moments are those of its volume, from its half box and the second
    /// moments of a unit of mass about its centre.
    pub(super) fn of_body(area: f64, half: Vector3<f64>, second: Vector3<f64>) -> Self {
        let second = Matrix3::from_diagonal(&second) * area;
        Self { area, first: Vector3::zeros(), second, low: -half, high: half }
    }

    fn of_triangles(triangles: &[Triangle], scale: &Vector3<f64>) -> Option<Self> {
        let infinite = Vector3::repeat(f64::INFINITY);
        let mut sum = Self {
            area: 0.0,
            first: Vector3::zeros(),
            second: Matrix3::zeros(),
            low: infinite,
            high: -infinite,
        };
        for triangle in triangles {
            let corners = triangle.map(|corner| corner.coords.component_mul(scale));
            let [a, b, c] = corners;
            let area = 0.5 * (b - a).cross(&(c - a)).norm();
            let middle = a + b + c;
            let outer = corners.iter().fold(middle * middle.transpose(), |m, p| m + p * p.transpose());
            sum.area += area;
            sum.first += middle * (area / 3.0);
            sum.second += outer * (area / 12.0);
            for corner in &corners {
                (sum.low, sum.high) = (sum.low.inf(corner), sum.high.sup(corner));
            }
        }
        (sum.area > 0.0 && sum.area.is_finite()).then_some(sum)
    }

    /// Returns the same moved to another place.
    pub(super) fn moved(&self, turn: &Matrix3<f64>, place: &Vector3<f64>) -> Self {
        let turned = turn * self.first;
        let mixed = turned * place.transpose();
        let centre = turn * ((self.low + self.high) / 2.0) + place;
        let half = turn.abs() * ((self.high - self.low) / 2.0);
        Self {
            area: self.area,
            first: turned + place * self.area,
            second: turn * self.second * turn.transpose()
                + mixed
                + mixed.transpose()
                + place * place.transpose() * self.area,
            low: centre - half,
            high: centre + half,
        }
    }

    /// Returns both.
    pub(super) fn with(&self, other: &Self) -> Self {
        Self {
            area: self.area + other.area,
            first: self.first + other.first,
            second: self.second + other.second,
            low: self.low.inf(&other.low),
            high: self.high.sup(&other.high),
        }
    }
}

/// Returns the surface of a mesh's file; `None` if it cannot be read, or is of a kind not known here.
pub(super) fn read(path: &Path, scale: &Vector3<f64>) -> Option<Surface> {
    Surface::of_triangles(&triangles(path)?, scale)
}

/// Returns the triangles of a mesh's file; `None` if it cannot be read, or is of a kind not known here.
pub(crate) fn triangles(path: &Path) -> Option<Vec<Triangle>> {
    let bytes = rigident_files::read(path, MOST_OF_MESH).ok()?;
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    if ending == "dae" {
        collada(std::str::from_utf8(&bytes).ok()?)
    } else {
        let scene = mesh_loader::Loader::default().load_from_slice(&bytes, path).ok()?;
        let corner = |mesh: &mesh_loader::Mesh, k: u32| {
            let [x, y, z] = mesh.vertices.get(usize::try_from(k).ok()?)?.map(f64::from);
            Some(Point3::new(x, y, z))
        };
        let face = |mesh: &mesh_loader::Mesh, [a, b, c]: [u32; 3]| {
            Some([corner(mesh, a)?, corner(mesh, b)?, corner(mesh, c)?])
        };
        let faces =
            scene.meshes.iter().flat_map(|mesh| mesh.faces.iter().filter_map(move |f| face(mesh, *f)));
        Some(faces.collect())
    }
}

/// Returns the triangles of a COLLADA scene in metres, z upwards.
fn collada(text: &str) -> Option<Vec<Triangle>> {
    let document = parsed(text).ok()?;
    let root = document.root_element();
    let asset = child(&root, "asset");
    let unit = asset.and_then(|a| child(&a, "unit")?.attribute("meter")?.parse().ok()).unwrap_or(1.0);
    let is_y_up = asset.and_then(|a| child(&a, "up_axis")?.text()).is_some_and(|axis| axis.trim() == "Y_UP");
    let up = if is_y_up { Vector3::x() * std::f64::consts::FRAC_PI_2 } else { Vector3::zeros() };
    let whole = Rotation3::new(up).to_homogeneous() * Matrix4::new_scaling(unit);
    let mut scene = Scene { ids: ids(&document), triangles: Vec::new(), nodes: 0 };
    let used = child(&root, "scene").and_then(|s| child(&s, "instance_visual_scene")?.attribute("url"));
    let start = used
        .and_then(|url| scene.of(url))
        .or_else(|| document.descendants().find(|node| node.has_tag_name("visual_scene")))?;
    scene.node(&start, &whole, 0)?;
    Some(scene.triangles)
}

fn ids<'a, 'i>(document: &'a Document<'i>) -> BTreeMap<&'a str, Node<'a, 'i>> {
    document.descendants().filter_map(|node| Some((node.attribute("id")?, node))).collect()
}

struct Scene<'a, 'i> {
    ids: BTreeMap<&'a str, Node<'a, 'i>>,
    triangles: Vec<Triangle>,
    /// The number of nodes and primitives that were followed.
    nodes: usize,
}

impl<'a, 'i> Scene<'a, 'i> {
    fn of(&self, url: &str) -> Option<Node<'a, 'i>> {
        self.ids.get(url.strip_prefix('#')?).copied()
    }

    /// Counts a node; `None` when there are too many.
    fn count(&mut self) -> Option<()> {
        self.nodes += 1;
        (self.nodes < MOST[0] && self.triangles.len() < MOST[1]).then_some(())
    }

    /// Adds what hangs on a node.
    fn node(&mut self, node: &Node<'a, 'i>, above: &Matrix4<f64>, depth: usize) -> Option<()> {
        let here = above * transform(node)?;
        self.count()?;
        for own in node.children().filter(Node::is_element) {
            let named = || self.of(own.attribute("url")?);
            match own.tag_name().name() {
                "node" if depth < DEEPEST => self.node(&own, &here, depth + 1)?,
                "instance_node" if depth < DEEPEST => self.node(&named()?, &here, depth + 1)?,
                "instance_geometry" => {
                    let mesh = child(&named()?, "mesh")?;
                    for primitive in mesh.children().filter(Node::is_element) {
                        self.primitive(&primitive, &here)?;
                    }
                }
                _ => {}
            }
        }
        Some(())
    }

    /// Adds triangles or polygons.
    fn primitive(&mut self, primitive: &Node, here: &Matrix4<f64>) -> Option<()> {
        let kind = primitive.tag_name().name();
        self.count()?;
        if !["triangles", "polylist", "polygons"].contains(&kind) {
            return Some(());
        }
        let inputs: Vec<Node> = primitive.children().filter(|n| n.has_tag_name("input")).collect();
        let offset =
            |input: &Node| input.attribute("offset").and_then(|o| o.parse::<usize>().ok()).unwrap_or(0);
        let stride = inputs.iter().map(offset).max()?.checked_add(1)?;
        let vertex = inputs.iter().find(|input| input.attribute("semantic") == Some("VERTEX"))?;
        let at = offset(vertex);
        let points = self.points(vertex.attribute("source")?)?;
        let counts = child(primitive, "vcount").and_then(|n| n.text()).map(integers);
        for p in primitive.children().filter(|n| n.has_tag_name("p")) {
            let indices = integers(p.text().unwrap_or_default());
            let corners: Vec<Point3<f64>> = indices
                .chunks_exact(stride)
                .map(|corner| Some(here.transform_point(points.get(*corner.get(at)?)?)))
                .collect::<Option<_>>()?;
            let mut rest = corners.as_slice();
            let mut cut = |count: usize| -> Option<()> {
                let (polygon, after) = rest.split_at_checked(count)?;
                rest = after;
                let (first, others) = polygon.split_first()?;
                self.triangles.extend(others.windows(2).map(|two| [*first, two[0], two[1]]));
                Some(())
            };
            match (kind, &counts) {
                ("polygons", _) => cut(corners.len())?,
                ("polylist", Some(counts)) => counts.iter().try_for_each(|count| cut(*count))?,
                _ => (0..corners.len() / 3).try_for_each(|_| cut(3))?,
            }
        }
        Some(())
    }

    /// Returns the positions of a `<vertices>`.
    fn points(&self, vertices: &str) -> Option<Vec<Point3<f64>>> {
        let mut inputs = self.of(vertices)?;
        let is_position = |n: &Node| n.has_tag_name("input") && n.attribute("semantic") == Some("POSITION");
        let input = inputs.children().find(is_position)?;
        inputs = self.of(input.attribute("source")?)?;
        let values = numbers(child(&inputs, "float_array")?.text().unwrap_or_default())?;
        let accessor = child(&inputs, "technique_common").and_then(|common| child(&common, "accessor"));
        let stride = accessor.and_then(|a| a.attribute("stride")?.parse().ok()).unwrap_or(3);
        (stride >= 3).then(|| values.chunks_exact(stride).map(|p| Point3::new(p[0], p[1], p[2])).collect())
    }
}

/// Returns where a node is in the one above it.
fn transform(node: &Node) -> Option<Matrix4<f64>> {
    let mut all = Matrix4::identity();
    for step in node.children().filter(Node::is_element) {
        let values = || numbers(step.text().unwrap_or_default());
        all *= match step.tag_name().name() {
            "matrix" => {
                let values = values()?;
                if values.len() != 16 {
                    return None;
                }
                Matrix4::from_row_slice(&values)
            }
            "translate" => Matrix4::new_translation(&Vector3::from(<[f64; 3]>::try_from(values()?).ok()?)),
            "scale" => Matrix4::new_nonuniform_scaling(&Vector3::from(<[f64; 3]>::try_from(values()?).ok()?)),
            "rotate" => {
                let [x, y, z, angle] = <[f64; 4]>::try_from(values()?).ok()?;
                let axis = Unit::try_new(Vector3::new(x, y, z), 0.0)?;
                Rotation3::from_axis_angle(&axis, angle.to_radians()).to_homogeneous()
            }
            _ => continue,
        };
    }
    Some(all)
}

fn numbers(text: &str) -> Option<Vec<f64>> {
    text.split_whitespace().map(|word| word.parse().ok()).collect()
}

fn integers(text: &str) -> Vec<usize> {
    text.split_whitespace().filter_map(|word| word.parse().ok()).collect()
}
