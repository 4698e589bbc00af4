//! Solids of meshes: what MuJoCo's compiler makes of the triangles of a file.
//!
//! Every triangle and a point within make a tetrahedron. The sum of these counts each by its size (`inertia`
//! is `legacy`, which is the default) or by its sign (`exact`); a `shell` has the triangles alone.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use rigident_files::MOST_OF_MESH;
use roxmltree::Node;

use super::Reader;
use super::geoms::Solid;
use crate::check::surface::{self, Triangle};
use crate::xml::{self, describe, exactly};

/// Flatter than this a mesh encloses nothing, m³ (m² of a shell).
const NOTHING: f64 = 1e-15;
/// MuJoCo's own binary form begins with four counts, and has numbers of four bytes.
const HEADER: usize = 16;

/// The way that the inside of a mesh is summed up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Inside {
    Legacy,
    Exact,
    Shell,
}

/// A `<mesh>` as it is stated.
struct Stated {
    /// Absolute or in the folder of meshes; empty if the file itself has the corners.
    file: String,
    /// Triangles that the file itself has.
    corners: Option<Vec<Triangle>>,
    scale: Vector3<f64>,
    place: Vector3<f64>,
    turn: UnitQuaternion<f64>,
    inertia: String,
}

/// The meshes of a file by their names, read when a body needs them.
#[derive(Default)]
pub(super) struct Meshes {
    /// Where files are; `None` of a text without a file.
    folder: Option<PathBuf>,
    strips: bool,
    stated: BTreeMap<String, Stated>,
    solids: RefCell<BTreeMap<String, Result<Solid, String>>>,
}

impl Meshes {
    /// Returns the meshes of the files in a folder, as the compiler's settings have it.
    pub(super) fn of(compilers: &[Node], folder: Option<&Path>) -> Self {
        let setting = |name: &str| compilers.iter().rev().find_map(|c| c.attribute(name));
        let own = setting("meshdir").or_else(|| setting("assetdir")).unwrap_or_default().replace('\\', "/");
        Self {
            folder: folder.map(|folder| folder.join(own)),
            strips: setting("strippath") == Some("true"),
            ..Self::default()
        }
    }

    /// Returns the solid of a mesh.
    ///
    /// # Errors
    /// Why it is not known.
    pub(super) fn solid(&self, name: &str) -> Result<Solid, String> {
        let known = self.solids.borrow().get(name).cloned();
        known.unwrap_or_else(|| {
            let own = self.read(name);
            self.solids.borrow_mut().insert(name.to_owned(), own.clone());
            own
        })
    }

    fn read(&self, name: &str) -> Result<Solid, String> {
        let own = self.stated.get(name).ok_or("no <mesh> has that name")?;
        let inside = match own.inertia.as_str() {
            "" | "legacy" => Inside::Legacy,
            "exact" => Inside::Exact,
            "shell" => Inside::Shell,
            other => return Err(format!("its inertia is {other:?}")),
        };
        let mut triangles = match &own.corners {
            Some(corners) => corners.clone(),
            None => self.triangles(&own.file)?,
        };
        for corner in triangles.iter_mut().flatten() {
            let turned = own.turn.inverse() * (corner.coords - own.place);
            corner.coords = turned.component_mul(&own.scale);
        }
        solid(&triangles, inside).ok_or_else(|| "it encloses nothing".to_owned())
    }

    fn triangles(&self, file: &str) -> Result<Vec<Triangle>, String> {
        let folder = self.folder.as_ref().ok_or("it is looked for beside the file that names it")?;
        let name = file.replace('\\', "/");
        let name = Path::new(&name);
        let last = name.file_name().filter(|_| self.strips).map(Path::new);
        let path = folder.join(last.unwrap_or(name));
        let unreadable = |why: &str| format!("{file} {why}");
        if !path.is_file() {
            return Err(unreadable("is not there"));
        }
        let bytes = || rigident_files::read(&path, MOST_OF_MESH).ok();
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let found = match ending.as_str() {
            "stl" => surface::triangles(&path),
            "obj" => bytes().and_then(|bytes| wavefront(&String::from_utf8_lossy(&bytes))),
            "msh" => bytes().and_then(|bytes| own_format(&bytes)),
            _ => None,
        };
        found.ok_or_else(|| unreadable("cannot be read as STL, OBJ or MSH"))
    }
}

impl<'a> Reader<'a> {
    /// Takes down the meshes that a file states.
    ///
    /// # Errors
    /// Which attribute holds no such numbers.
    pub(super) fn meshes(&mut self, root: &Node<'a, 'a>) -> Result<(), String> {
        let assets = root.children().filter(|n| n.has_tag_name("asset")).flat_map(|n| n.children());
        for node in assets.filter(|n| n.has_tag_name("mesh")) {
            let what = describe(&node);
            let own = |name: &str| self.word("mesh", &node, name, &[]);
            let numbers = |name: &str| -> Result<Option<Vec<f64>>, String> {
                own(name).map(|text| xml::parse(text, &format!("{name} of {what}"))).transpose()
            };
            let triple = |name: &str, otherwise: Vector3<f64>| -> Result<Vector3<f64>, String> {
                let Some(values) = numbers(name)? else { return Ok(otherwise) };
                Ok(Vector3::from(exactly::<3>(values, &format!("{name} of {what}"))?))
            };
            let turn = match numbers("refquat")? {
                Some(values) => {
                    let [w, i, j, k] = exactly::<4>(values, &format!("refquat of {what}"))?;
                    UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k))
                }
                None => UnitQuaternion::identity(),
            };
            let file = own("file").unwrap_or_default().to_owned();
            let stem = Path::new(&file).file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
            let name = node.attribute("name").unwrap_or(stem).to_owned();
            let corners = match (numbers("vertex")?, numbers("face")?) {
                (Some(vertices), Some(faces)) => Some(faces_of(&vertices, &faces)),
                _ => None,
            };
            let stated = Stated {
                file,
                corners,
                scale: triple("scale", Vector3::repeat(1.0))?,
                place: triple("refpos", Vector3::zeros())?,
                turn,
                inertia: own("inertia").unwrap_or_default().to_owned(),
            };
            self.meshes.stated.insert(name, stated);
        }
        Ok(())
    }
}

/// Returns the triangles of corners and their numbers; those of corners that there are not are left out.
fn faces_of(vertices: &[f64], faces: &[f64]) -> Vec<Triangle> {
    let corner = |at: f64| {
        let at = ((0.0..1e9).contains(&at) && at.fract() == 0.0).then_some(3.0 * at)? as usize;
        let own = vertices.get(at..at.checked_add(3)?)?;
        Some(nalgebra::Point3::new(own[0], own[1], own[2]))
    };
    let own = |three: &[f64]| Some([corner(three[0])?, corner(three[1])?, corner(three[2])?]);
    faces.chunks_exact(3).filter_map(own).collect()
}

/// Reads the faces of an OBJ. As in MuJoCo one of four corners, which need not be flat, is cut along its
/// shorter diagonal.
fn wavefront(text: &str) -> Option<Vec<Triangle>> {
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let mut number = || words.next()?.parse::<f32>().ok().map(f64::from);
                corners.push(nalgebra::Point3::new(number()?, number()?, number()?));
            }
            Some("f") => {
                let corner = |word: &str| {
                    let place: i64 = word.split('/').next()?.parse().ok()?;
                    // From one, or from the last one backwards.
                    let from = if place > 0 { -1 } else { i64::try_from(corners.len()).ok()? };
                    corners.get(usize::try_from(place + from).ok()?).copied()
                };
                let own: Vec<_> = words.map(corner).collect::<Option<_>>()?;
                let is_other = |c: &[nalgebra::Point3<f64>]| (c[0] - c[2]).norm() >= (c[1] - c[3]).norm();
                if own.len() == 4 && is_other(&own) {
                    triangles.extend([[own[0], own[1], own[3]], [own[1], own[2], own[3]]]);
                } else {
                    let rest = own.windows(2).skip(1);
                    triangles.extend(rest.map(|two| [own[0], two[0], two[1]]));
                }
            }
            _ => {}
        }
    }
    Some(triangles)
}

/// Reads MuJoCo's own form: counts of vertices, normals, texture coordinates and faces, and these.
fn own_format(bytes: &[u8]) -> Option<Vec<Triangle>> {
    let word = |at: usize| <[u8; 4]>::try_from(bytes.get(at..at.checked_add(4)?)?).ok();
    let count = |k: usize| usize::try_from(i32::from_le_bytes(word(4 * k)?)).ok();
    let [vertices, normals, coordinates, faces] = [count(0)?, count(1)?, count(2)?, count(3)?];
    let floats = [(3_usize, vertices), (3, normals), (2, coordinates)];
    let floats = floats.iter().try_fold(0_usize, |n, (each, own)| n.checked_add(each.checked_mul(*own)?))?;
    let start = floats.checked_mul(4)?.checked_add(HEADER)?;
    if start.checked_add(12_usize.checked_mul(faces)?)? != bytes.len() {
        return None;
    }
    let corner = |face: usize, k: usize| {
        let vertex = usize::try_from(i32::from_le_bytes(word(start + 12 * face + 4 * k)?)).ok()?;
        let own = |axis: usize| {
            let at = HEADER + 4 * (3 * vertex + axis);
            Some(f64::from(f32::from_le_bytes(word(at)?)))
        };
        (vertex < vertices).then_some(())?;
        Some(nalgebra::Point3::new(own(0)?, own(1)?, own(2)?))
    };
    (0..faces).map(|face| Some([corner(face, 0)?, corner(face, 1)?, corner(face, 2)?])).collect()
}

/// Returns the area, normal and middle of a triangle; `None` if it has no area.
fn measured([a, b, c]: &Triangle, from: &Vector3<f64>) -> Option<(f64, Vector3<f64>, Vector3<f64>)> {
    let across = (b - a).cross(&(c - a));
    let twice = across.norm();
    let middle = (a.coords + b.coords + c.coords) / 3.0 - from;
    (twice > 0.0 && twice.is_finite()).then(|| (twice / 2.0, across / twice, middle))
}

/// Returns volume (of a shell the area), centre and second moments about it; `None` if there is no inside.
fn solid(triangles: &[Triangle], inside: Inside) -> Option<Solid> {
    let zero = Vector3::zeros();
    let all = || triangles.iter().filter_map(|own| measured(own, &zero));
    let area: f64 = all().map(|(area, ..)| area).sum();
    let apex = all().map(|(area, _, middle)| middle * area).sum::<Vector3<f64>>() / area;
    // The size of a tetrahedron over a triangle whose middle is there from its top.
    let size = |area: f64, normal: &Vector3<f64>, middle: &Vector3<f64>| {
        let volume = area * middle.dot(normal) / 3.0;
        match inside {
            Inside::Legacy => volume.abs(),
            Inside::Exact => volume,
            Inside::Shell => area,
        }
    };
    let (mut volume, mut first) = (0.0, zero);
    for (area, normal, middle) in all() {
        let own = size(area, &normal, &(middle - apex));
        let centre = if inside == Inside::Shell { middle } else { middle * 0.75 + apex * 0.25 };
        volume += own;
        first += centre * own;
    }
    if !(volume.is_finite() && volume.abs() > NOTHING) {
        return None;
    }
    let centre = first / volume;
    let share = if inside == Inside::Shell { 12.0 } else { 20.0 };
    let (mut volume, mut second) = (0.0, Matrix3::zeros());
    for triangle in triangles {
        let Some((area, normal, middle)) = measured(triangle, &centre) else { continue };
        let own = size(area, &normal, &middle);
        let corners = triangle.map(|corner| corner.coords - centre);
        let sum = corners[0] + corners[1] + corners[2];
        let outer = corners.iter().fold(sum * sum.transpose(), |m, p| m + p * p.transpose());
        volume += own;
        second += outer * (own / share);
    }
    if volume.is_nan() || volume <= NOTHING {
        return None;
    }
    let second = second / volume;
    Some(Solid { volume, centre, moments: Matrix3::identity() * second.trace() - second })
}
