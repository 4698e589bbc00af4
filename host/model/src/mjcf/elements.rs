//! MJCF written out: what `include`, `replicate` and `attach` represent is put in their place.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::angles::Angles;
use crate::element::{DEEPEST, Element, MOST_ELEMENTS, beside};
use crate::finding::ModelError;
use crate::xml::{self, vector};

/// Elements that represent others.
const STAND_FOR_OTHERS: [&str; 3] = ["include", "replicate", "attach"];
/// Attributes that hold the name of a default class.
const CLASSES: [&str; 2] = ["class", "childclass"];

/// Returns a text in which nothing represents other elements: as it is, or written anew. Files that it names
/// are searched for in `folder`; without one they are refused.
///
/// # Errors
/// [`ModelError`] that says which element cannot be followed and why.
pub(super) fn expanded<'a>(
    text: &'a str,
    what: &str,
    folder: Option<&Path>,
) -> Result<Cow<'a, str>, ModelError> {
    let document = xml::document(text, what)?;
    let stands = |n: Node| STAND_FOR_OTHERS.iter().any(|tag| n.has_tag_name(*tag));
    if !document.descendants().any(stands) {
        return Ok(Cow::Borrowed(text));
    }
    let refuse = |problem: String| ModelError::Structure { what: what.to_owned(), problem };
    let mut files = Files { folder, read: BTreeSet::new(), left: MOST_ELEMENTS };
    let mut root = Element::of(&document.root_element());
    files.expand(&mut root, folder, 0).map_err(refuse)?;
    Ok(Cow::Owned(root.written()))
}

struct Files<'a> {
    /// Of the main file.
    folder: Option<&'a Path>,
    read: BTreeSet<PathBuf>,
    /// Elements that may still be made.
    left: usize,
}

impl Files<'_> {
    /// Writes out a whole model: its includes first, as they bring the settings that the rest follows.
    fn expand(&mut self, root: &mut Element, folder: Option<&Path>, depth: usize) -> Result<(), String> {
        self.take(root.count())?;
        self.include(root, folder, depth)?;
        let angles = angles(root);
        self.attach(root, folder, depth, &angles)?;
        self.replicate(root, &angles)
    }

    fn take(&mut self, elements: usize) -> Result<(), String> {
        self.left = self.left.checked_sub(elements).ok_or_else(|| {
            format!("written out it has more than {MOST_ELEMENTS} elements, which no robot has")
        })?;
        Ok(())
    }

    /// Reads a file that another one names.
    fn open(
        &mut self,
        element: &Element,
        file: &str,
        folder: Option<&Path>,
        once: bool,
    ) -> Result<(Element, PathBuf), String> {
        let refuse = |why: String| format!("<{}> of {file}: {why}", element.tag);
        let path = beside(file, &[folder, self.folder]).map_err(refuse)?;
        if once && !self.read.insert(path.clone()) {
            return Err(refuse("it is included twice".to_owned()));
        }
        let own = Element::read(&path).map_err(refuse)?;
        self.take(own.count())?;
        Ok((own, path))
    }

    fn include(&mut self, element: &mut Element, folder: Option<&Path>, depth: usize) -> Result<(), String> {
        if depth > DEEPEST {
            return Err("files include each other without end".to_owned());
        }
        let mut children = Vec::with_capacity(element.children.len());
        for mut child in std::mem::take(&mut element.children) {
            if child.tag != "include" {
                self.include(&mut child, folder, depth)?;
                children.push(child);
                continue;
            }
            let file = child.attribute("file").ok_or("an <include> names no file")?.to_owned();
            let (mut own, path) = self.open(&child, &file, folder, true)?;
            self.include(&mut own, path.parent(), depth + 1)?;
            children.extend(own.children);
        }
        element.children = children;
        Ok(())
    }

    /// Puts copies in place of each `<replicate>`, the inner ones first.
    fn replicate(&mut self, element: &mut Element, angles: &Angles) -> Result<(), String> {
        let mut children = Vec::with_capacity(element.children.len());
        for mut child in std::mem::take(&mut element.children) {
            self.replicate(&mut child, angles)?;
            if child.tag != "replicate" {
                children.push(child);
                continue;
            }
            let count = child.attribute("count").and_then(|text| text.trim().parse::<usize>().ok());
            let count = count.filter(|n| *n > 0).ok_or("a <replicate> has no count above zero")?;
            self.take(count.saturating_mul(child.count()))?;
            let offset = child.numbers::<3>("offset")?.map_or_else(Vector3::zeros, Vector3::from);
            let turn = child.numbers::<3>("euler")?.map_or_else(Matrix3::identity, |v| angles.euler(v));
            let separator = child.attribute("sep").unwrap_or_default().to_owned();
            let digits = (count - 1).to_string().len();
            let (mut rotation, mut position) = (Matrix3::identity(), Vector3::zeros());
            for k in 0..count {
                let q = UnitQuaternion::from_matrix(&rotation);
                let mut attributes = vec![
                    ("pos".to_owned(), vector(&position)),
                    ("quat".to_owned(), format!("{} {} {} {}", q.w, q.i, q.j, q.k)),
                ];
                let class = child.attribute("childclass").map(|c| ("childclass".to_owned(), c.to_owned()));
                attributes.extend(class);
                let mut copy = Element {
                    tag: "frame".to_owned(),
                    attributes,
                    children: child.children.clone(),
                    ..Element::default()
                };
                copy.change(&["name"], &|name| format!("{name}{separator}{k:0digits$}"));
                children.push(copy);
                position += rotation * offset;
                rotation *= turn;
            }
        }
        element.children = children;
        Ok(())
    }

    /// Puts bodies of other models in place of each `<attach>`, with a prefix before their names and classes.
    fn attach(
        &mut self,
        root: &mut Element,
        folder: Option<&Path>,
        depth: usize,
        angles: &Angles,
    ) -> Result<(), String> {
        if depth > DEEPEST {
            return Err("models are attached to each other without end".to_owned());
        }
        let models: Vec<Element> = root
            .children
            .iter()
            .filter(|child| child.tag == "asset")
            .flat_map(|asset| asset.children.iter().filter(|child| child.tag == "model").cloned())
            .collect();
        let mut defaults = Vec::new();
        let mut children = std::mem::take(&mut root.children);
        for child in &mut children {
            self.attach_in(child, &models, folder, depth, angles, &mut defaults)?;
        }
        defaults.append(&mut children);
        root.children = defaults;
        Ok(())
    }

    fn attach_in(
        &mut self,
        element: &mut Element,
        models: &[Element],
        folder: Option<&Path>,
        depth: usize,
        angles: &Angles,
        defaults: &mut Vec<Element>,
    ) -> Result<(), String> {
        let mut children = Vec::with_capacity(element.children.len());
        for mut child in std::mem::take(&mut element.children) {
            if child.tag != "attach" {
                self.attach_in(&mut child, models, folder, depth, angles, defaults)?;
                children.push(child);
                continue;
            }
            let name = child.attribute("model").unwrap_or_default();
            let is_it = |model: &&Element| {
                let file = model.attribute("file").and_then(|file| Path::new(file).file_stem()?.to_str());
                model.attribute("name").or(file) == Some(name)
            };
            let model = models.iter().find(is_it);
            let model =
                model.ok_or_else(|| format!("<attach> of {name}: no <model> of <asset> has that name"))?;
            let file = model.attribute("file").ok_or_else(|| format!("<model> {name} names no file"))?;
            let (mut own, path) = self.open(&child, file, folder, false)?;
            let inner = Files { folder: path.parent(), read: BTreeSet::new(), left: self.left };
            self.left = { inner }.expand_into(&mut own, depth + 1)?;
            if super::elements::angles(&own) != *angles {
                return Err(format!(
                    "<attach> of {name}: {file} has another compiler angle or eulerseq; have MuJoCo write \
                     the compiled model (mj_saveLastXML) and give that"
                ));
            }
            let prefix = child.attribute("prefix").unwrap_or_default().to_owned();
            let with = |name: &str| format!("{prefix}{name}");
            own_meshes(&mut own, path.parent());
            own.change(&["name", "joint", "joint1", "joint2", "body1", "body2", "mesh"], &with);
            own.change(&CLASSES, &with);
            let main = with("main");
            for asset in own.children.iter_mut().filter(|c| c.tag == "asset") {
                let mut asset = std::mem::take(asset);
                asset.children.retain(|mesh| mesh.tag == "mesh");
                for mesh in asset.children.iter_mut().filter(|mesh| mesh.attribute("class").is_none()) {
                    mesh.set("class", main.clone());
                }
                defaults.push(asset);
            }
            for mut default in own.children.iter().filter(|c| c.tag == "default").cloned() {
                if default.attribute("class").is_none() {
                    default.attributes.push(("class".to_owned(), main.clone()));
                }
                defaults.push(default);
            }
            let attributes = vec![("childclass".to_owned(), main)];
            let inside: Vec<Element> = match child.attribute("body") {
                Some(body) => {
                    let found = body_of(&own, &with(body)).cloned();
                    vec![found.ok_or_else(|| format!("<attach> of {name}: {file} has no body {body}"))?]
                }
                None => {
                    let worlds = own.children.into_iter().filter(|c| c.tag == "worldbody");
                    worlds.flat_map(|world| world.children).collect()
                }
            };
            children.push(Element {
                tag: "frame".to_owned(),
                attributes,
                children: inside,
                ..Element::default()
            });
        }
        element.children = children;
        Ok(())
    }

    /// Writes out a model that another one attaches, and returns how many elements may still be made.
    fn expand_into(mut self, root: &mut Element, depth: usize) -> Result<usize, String> {
        let folder = self.folder;
        self.expand(root, folder, depth)?;
        Ok(self.left)
    }
}

/// Names the meshes of a model that is attached, and says where their files are: in its own folder of meshes.
fn own_meshes(root: &mut Element, folder: Option<&Path>) {
    let compilers: Vec<&Element> = root.children.iter().filter(|child| child.tag == "compiler").collect();
    let setting = |name: &str| compilers.iter().rev().find_map(|c| c.attribute(name));
    let own = setting("meshdir").or_else(|| setting("assetdir")).unwrap_or_default().to_owned();
    let strips = setting("strippath") == Some("true");
    let Some(folder) = folder.map(|folder| folder.join(own)) else { return };
    let assets = root.children.iter_mut().filter(|child| child.tag == "asset");
    for mesh in assets.flat_map(|asset| &mut asset.children).filter(|child| child.tag == "mesh") {
        let Some(file) = mesh.attribute("file").map(PathBuf::from) else { continue };
        if let (None, Some(stem)) = (mesh.attribute("name"), file.file_stem()) {
            mesh.set("name", stem.to_string_lossy().into_owned());
        }
        let last = file.file_name().filter(|_| strips).map(Path::new);
        mesh.set("file", folder.join(last.unwrap_or(&file)).to_string_lossy().into_owned());
    }
}

/// Returns the body of a name within an element.
fn body_of<'e>(element: &'e Element, name: &str) -> Option<&'e Element> {
    if element.tag == "body" && element.attribute("name") == Some(name) {
        return Some(element);
    }
    element.children.iter().find_map(|child| body_of(child, name))
}

/// Returns how a model writes angles.
fn angles(root: &Element) -> Angles {
    let setting = |name: &str| {
        let compilers = root.children.iter().rev().filter(|child| child.tag == "compiler");
        compilers.filter_map(|compiler| compiler.attribute(name)).next()
    };
    Angles::of(setting("angle"), setting("eulerseq"))
}
