//! The common part of the readers of MJCF and SDF: numbers of attributes, rotations, and where to put an
//! element.

use std::ops::Range;
use std::path::Path;

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use rigident_shared::inertia::InertialParameters;
use rigident_shared::printable;
use rigident_shared::spatial::Body;
use roxmltree::{Document, Node, ParsingOptions};

use super::finding::ModelError;
use super::inertial::Parameters;

/// Languages of robot descriptions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// `<robot>`
    Urdf,
    /// `<mujoco>`
    Mjcf,
    /// `<sdf>`
    Sdf,
}

impl Language {
    /// Returns the language of a text, by its root element.
    pub fn of_text(text: &str) -> Option<Self> {
        let roots = [("<robot", Self::Urdf), ("<mujoco", Self::Mjcf), ("<sdf", Self::Sdf)];
        let found = roots.iter().filter_map(|(word, language)| Some((text.find(word)?, *language)));
        found.min_by_key(|(at, _)| *at).map(|(_, language)| language)
    }

    /// Returns the language of a file, by the ending of its name.
    pub fn of_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "urdf" => Some(Self::Urdf),
            "xml" | "mjcf" => Some(Self::Mjcf),
            "sdf" => Some(Self::Sdf),
            _ => None,
        }
    }
}

/// Parses a text.
///
/// # Errors
/// [`ModelError::Syntax`].
pub(super) fn document<'a>(text: &'a str, what: &str) -> Result<Document<'a>, ModelError> {
    let refuse = |reason: String| ModelError::Syntax { what: what.to_owned(), reason };
    let document = parsed(text).map_err(|error| refuse(error.to_string()))?;
    check_depth(&document).map_err(refuse)?;
    Ok(document)
}

/// The deepest that elements are within one another. Readers call themselves for each.
const DEEPEST: usize = 256;

/// Refuses a document whose elements are deeper within one another than any robot's are.
///
/// # Errors
/// Says at which element.
pub(super) fn check_depth(document: &Document) -> Result<(), String> {
    let mut depths: Vec<usize> = Vec::new();
    // Parents come before their children.
    for node in document.descendants() {
        let above = node.parent().and_then(|parent| depths.get(parent.id().get_usize()).copied());
        let depth = above.map_or(0, |above| above + 1);
        if depth > DEEPEST {
            return Err(format!("{} is within more than {DEEPEST} elements", describe(&node)));
        }
        let at = node.id().get_usize();
        depths.resize(depths.len().max(at + 1), 0);
        depths[at] = depth;
    }
    Ok(())
}

/// Parses a text, which may have a `<!DOCTYPE>`.
///
/// # Errors
/// Returns the error of the XML parser.
pub(super) fn parsed(text: &str) -> Result<Document<'_>, roxmltree::Error> {
    Document::parse_with_options(text, ParsingOptions { allow_dtd: true, ..ParsingOptions::default() })
}

/// Numbers of an attribute.
pub(super) fn numbers(node: &Node, attribute: &str) -> Result<Option<Vec<f64>>, String> {
    node.attribute(attribute)
        .map(|text| parse(text, &format!("{} of {}", attribute, describe(node))))
        .transpose()
}

/// Numbers in a text.
pub(super) fn parse(text: &str, what: &str) -> Result<Vec<f64>, String> {
    text.split_whitespace()
        .map(|word| word.parse::<f64>().ok().filter(|v| v.is_finite()))
        .collect::<Option<Vec<f64>>>()
        .ok_or_else(|| format!("{what} is {text:?}, which are no finite numbers"))
}

/// Returns exactly `N` numbers.
pub(super) fn exactly<const N: usize>(values: Vec<f64>, what: &str) -> Result<[f64; N], String> {
    let count = values.len();
    values.try_into().map_err(|_| format!("{what} has {count} numbers where {N} are needed"))
}

/// Returns an element's tag and name, or its line.
pub(super) fn describe(node: &Node) -> String {
    match node.attribute("name") {
        Some(name) => format!("<{} name=\"{}\">", node.tag_name().name(), printable::name(name)),
        None => format!("<{}> in line {}", node.tag_name().name(), line(node)),
    }
}

/// Returns the line of an element, from 1.
pub(super) fn line(node: &Node) -> u32 {
    node.document().text_pos_at(node.range().start).row
}

/// Returns the first child element of a name.
pub(super) fn child<'a, 'i>(node: &Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|c| c.has_tag_name(name))
}

/// Returns the rotation of a quaternion w, x, y, z.
pub(super) fn of_quaternion([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix().into_inner()
}

/// Returns the rotation of roll, pitch, yaw about fixed axes.
pub(super) fn of_rpy([roll, pitch, yaw]: [f64; 3]) -> Matrix3<f64> {
    Rotation3::from_euler_angles(roll, pitch, yaw).into_inner()
}

/// Numbers of a vector as an attribute has them.
pub(super) fn vector(v: &Vector3<f64>) -> String {
    format!("{} {} {}", v.x, v.y, v.z)
}

/// Returns roll, pitch and yaw about fixed axes; by arctangents, which lose no digits near upright pitch.
pub(super) fn rpy(r: &Matrix3<f64>) -> String {
    let level = r.m11.hypot(r.m21);
    let pitch = (-r.m31).atan2(level);
    // Upright, only the sum of roll and yaw matters.
    let (roll, yaw) = if level > 4.0 * f64::EPSILON {
        (r.m32.atan2(r.m33), r.m21.atan2(r.m11))
    } else {
        ((-r.m23).atan2(r.m22), 0.0)
    };
    format!("{roll} {pitch} {yaw}")
}

/// A range of a text, and its replacement.
pub(super) type Edit = (Range<usize>, String);

/// Returns the edit that puts `new` in place of a parent's first child of a tag, or at the parent's beginning
/// if it has none.
pub(super) fn replace_child(text: &str, parent: &Node, tag: &str, new: String) -> Edit {
    if let Some(old) = child(parent, tag) {
        return (old.range(), new);
    }
    let end = start_tag_end(text, parent);
    if text[..end].ends_with("/>") {
        (end - 2..end, format!(">{new}</{}>", parent.tag_name().name()))
    } else {
        (end..end, new)
    }
}

/// Returns the edit that gives an attribute this value.
pub(super) fn set_attribute(text: &str, node: &Node, name: &str, value: f64) -> Edit {
    match node.attribute_node(name) {
        Some(old) => (old.range_value(), value.to_string()),
        None => insert_attribute(text, node, name, &value.to_string()),
    }
}

/// Returns the edit that adds an attribute that is not there.
pub(super) fn insert_attribute(text: &str, node: &Node, name: &str, value: &str) -> Edit {
    let end = start_tag_end(text, node);
    let at = end - if text[..end].ends_with("/>") { 2 } else { 1 };
    (at..at, format!(" {name}=\"{value}\""))
}

/// Returns the edit that puts `new` before the end tag of an element that has one.
pub(super) fn before_end(text: &str, node: &Node, new: String) -> Edit {
    let range = node.range();
    let at = text[range.clone()].rfind("</").map_or(range.end, |at| range.start + at);
    (at..at, new)
}

/// Returns a text as it may be in an attribute.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// Returns the text with all edits made; no two of them overlap.
pub(super) fn edit(text: &str, mut edits: Vec<Edit>) -> String {
    edits.sort_by_key(|(range, _)| std::cmp::Reverse(range.start));
    let mut out = text.to_owned();
    for (range, new) in edits {
        out.replace_range(range, &new);
    }
    out
}

/// Returns where the first tag of an element ends in the text.
fn start_tag_end(text: &str, node: &Node) -> usize {
    let range = node.range();
    let mut quote = None;
    for (at, c) in text[range.clone()].char_indices() {
        match (quote, c) {
            (None, '"' | '\'') => quote = Some(c),
            (Some(q), c) if q == c => quote = None,
            (None, '>') => return range.start + at + 1,
            _ => {}
        }
    }
    range.end
}

/// Returns the `<inertial>` of parameters about the frame's origin.
pub(super) fn inertial(phi: &Parameters, language: Language) -> String {
    let body = InertialParameters::<Body, f64>::from_vector(*phi);
    // Moments without mass are about every point.
    let (centre, i) = if body.mass == 0.0 {
        ([0.0; 3], body.inertia)
    } else {
        (body.centre_of_mass().array(), body.inertia_com())
    };
    let [x, y, z] = centre;
    let (m, xx, yy, zz) = (body.mass, i.m11, i.m22, i.m33);
    let (xy, xz, yz) = (i.m12, i.m13, i.m23);
    match language {
        Language::Urdf => format!(
            "<inertial>\n      <origin xyz=\"{x} {y} {z}\" rpy=\"0 0 0\"/>\n      <mass \
             value=\"{m}\"/>\n      <inertia ixx=\"{xx}\" ixy=\"{xy}\" ixz=\"{xz}\" iyy=\"{yy}\" \
             iyz=\"{yz}\" izz=\"{zz}\"/>\n    </inertial>"
        ),
        Language::Mjcf => {
            format!(
                "<inertial pos=\"{x} {y} {z}\" mass=\"{m}\" fullinertia=\"{xx} {yy} {zz} {xy} {xz} {yz}\"/>"
            )
        }
        Language::Sdf => format!(
            "<inertial>\n        <pose>{x} {y} {z} 0 0 0</pose>\n        <mass>{m}</mass>\n        \
             <inertia><ixx>{xx}</ixx><ixy>{xy}</ixy><ixz>{xz}</ixz><iyy>{yy}</iyy><iyz>{yz}</iyz><izz>{zz}</izz></inertia>\n      </inertial>"
        ),
    }
}
