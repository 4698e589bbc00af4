//! SDF written out: models in models, and models of files that are included, become one.

use std::path::Path;

use roxmltree::Document;

use crate::element::{DEEPEST, Element, MOST_ELEMENTS, beside};

/// Attributes and elements that name a link, a joint or a frame.
const NAMES: [&str; 3] = ["relative_to", "attached_to", "expressed_in"];
/// Elements of a joint that do.
const ENDS: [&str; 2] = ["parent", "child"];

/// Returns a text in which no model is in another one and no file is included; `None` if none is in this one.
/// Files are searched for in `folder`; without one they are refused.
///
/// # Errors
/// Returns in words what cannot be followed, and why.
pub(super) fn flat(document: &Document, folder: Option<&Path>) -> Result<Option<String>, String> {
    let is_nested = |n: roxmltree::Node| {
        n.has_tag_name("include")
            || (n.has_tag_name("model") && n.parent().is_some_and(|parent| parent.has_tag_name("model")))
    };
    if !document.descendants().any(is_nested) {
        return Ok(None);
    }
    let mut root = Element::of(&document.root_element());
    let mut left = MOST_ELEMENTS;
    include(&mut root, folder, 0, &mut left)?;
    for child in &mut root.children {
        if child.tag == "model" {
            flatten(child)?;
        }
        for model in child.children.iter_mut().filter(|inner| child.tag == "world" && inner.tag == "model") {
            flatten(model)?;
        }
    }
    Ok(Some(root.written()))
}

/// Puts models in place of `<include>`.
fn include(
    element: &mut Element,
    folder: Option<&Path>,
    depth: usize,
    left: &mut usize,
) -> Result<(), String> {
    if depth > DEEPEST {
        return Err("files include each other without end".to_owned());
    }
    for child in &mut element.children {
        if child.tag != "include" {
            include(child, folder, depth, left)?;
            continue;
        }
        let uri = child.child("uri").map(|uri| uri.text.clone()).unwrap_or_default();
        let refuse = |why: String| format!("<include> of {uri}: {why}");
        let file = uri.split_once("://").map_or(uri.as_str(), |(_, rest)| rest);
        // A model is a folder, mostly beside that of the one that includes it.
        let folders = [folder, folder.and_then(Path::parent)];
        let path = beside(file, &folders)
            .or_else(|why| beside(&format!("{file}/model.sdf"), &folders).map_err(|_| why));
        let path = path.map_err(refuse)?;
        let mut own = Element::read(&path).map_err(refuse)?;
        *left = left
            .checked_sub(own.count())
            .ok_or_else(|| refuse(format!("together they have more than {MOST_ELEMENTS} elements")))?;
        include(&mut own, path.parent(), depth + 1, left)?;
        let model = own.children.into_iter().find(|inner| inner.tag == "model");
        let mut model = model.ok_or_else(|| refuse("there is no <model> in it".to_owned()))?;
        if child.child("placement_frame").is_some() || model.attribute("placement_frame").is_some() {
            return Err(refuse(
                "its placement_frame is not followed: give one file with everything in it".to_owned(),
            ));
        }
        if let Some(name) = child.child("name") {
            model.set("name", name.text.clone());
        }
        if let Some(pose) = child.child("pose") {
            model.children.retain(|inner| inner.tag != "pose");
            model.children.push(pose.clone());
        }
        if child.attribute("merge") == Some("true") {
            model.set("merge", "true".to_owned());
        }
        *child = model;
    }
    Ok(())
}

/// Takes the models that are in a model into it: what they name has their name before it, `MODEL::LINK`.
fn flatten(model: &mut Element) -> Result<(), String> {
    let mut children = Vec::with_capacity(model.children.len());
    for mut child in std::mem::take(&mut model.children) {
        if child.tag != "model" {
            children.push(child);
            continue;
        }
        flatten(&mut child)?;
        let name = child.attribute("name").unwrap_or_default().to_owned();
        if child.attribute("placement_frame").is_some() {
            return Err(format!(
                "placement_frame of <model> {name} is not followed: state the pose of the model itself"
            ));
        }
        let merged = child.attribute("merge") == Some("true");
        let (prefix, own_frame) = if merged {
            (String::new(), format!("_merged__{name}__model__"))
        } else {
            (format!("{name}::"), name.clone())
        };
        let with = |name: &str| match name {
            "world" | "" => name.to_owned(),
            "__model__" => own_frame.clone(),
            name => format!("{prefix}{name}"),
        };
        let first = child.child("link").and_then(|link| link.attribute("name"));
        let canonical = child.attribute("canonical_link").or(first).map(&with).unwrap_or_default();
        let mut pose = child
            .child("pose")
            .cloned()
            .unwrap_or_else(|| Element { tag: "pose".to_owned(), ..Element::default() });
        if pose.attribute("relative_to").is_none_or(str::is_empty) {
            pose.set("relative_to", "__model__".to_owned());
        }
        children.push(Element {
            tag: "frame".to_owned(),
            attributes: vec![("name".to_owned(), own_frame.clone()), ("attached_to".to_owned(), canonical)],
            children: vec![pose],
            ..Element::default()
        });
        for mut own in child.children {
            match own.tag.as_str() {
                "link" | "joint" | "frame" => {}
                _ => continue,
            }
            own.change(&NAMES, &with);
            if let Some(name) = own.attribute("name").map(&with) {
                own.set("name", name);
            }
            for end in own.children.iter_mut().filter(|inner| ENDS.contains(&inner.tag.as_str())) {
                end.text = with(&end.text);
            }
            match own.tag.as_str() {
                "link" => relative_to(&mut own, &own_frame),
                "frame" if own.attribute("attached_to").is_none_or(str::is_empty) => {
                    own.set("attached_to", own_frame.clone());
                }
                _ => {}
            }
            children.push(own);
        }
    }
    model.children = children;
    Ok(())
}

/// Says what a link's pose is relative to, where it says nothing.
fn relative_to(link: &mut Element, frame: &str) {
    match link.children.iter_mut().find(|inner| inner.tag == "pose") {
        Some(pose) if pose.attribute("relative_to").is_some_and(|name| !name.is_empty()) => {}
        Some(pose) => pose.set("relative_to", frame.to_owned()),
        None => link.children.push(Element {
            tag: "pose".to_owned(),
            attributes: vec![("relative_to".to_owned(), frame.to_owned())],
            ..Element::default()
        }),
    }
}
