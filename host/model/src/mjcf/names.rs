//! Names of bodies and joints: their own, or made of where they are.

use std::collections::HashMap;

use roxmltree::{Document, Node, NodeId};

use super::WORLD;

/// Names of all bodies and joints of a file.
#[derive(Debug, Default)]
pub(crate) struct Names(HashMap<NodeId, String>);

impl Names {
    /// Names a body without a name by its path: the body that it is in, and how many bodies of that are
    /// before it and itself, `world/1`. A joint without a name is named after its body.
    pub(crate) fn of(document: &Document) -> Self {
        let mut own = Self::default();
        let mut bodies = 0;
        for world in document.root_element().children().filter(|n| n.has_tag_name("worldbody")) {
            own.inside(&world, WORLD, &mut bodies, &mut Vec::new());
        }
        own
    }

    fn inside(&mut self, node: &Node, body: &str, bodies: &mut usize, joints: &mut Vec<NodeId>) {
        for child in node.children() {
            match child.tag_name().name() {
                "frame" => self.inside(&child, body, bodies, joints),
                "joint" => match child.attribute("name") {
                    Some(name) => {
                        joints.push(child.id());
                        self.0.insert(child.id(), name.to_owned());
                    }
                    None => joints.push(child.id()),
                },
                "body" => {
                    *bodies += 1;
                    let name = child.attribute("name").filter(|name| !name.trim().is_empty());
                    let name = name.map_or_else(|| format!("{body}/{bodies}"), str::to_owned);
                    let (mut inner, mut own) = (0, Vec::new());
                    self.inside(&child, &name, &mut inner, &mut own);
                    let several = own.len() > 1;
                    for (k, joint) in own.into_iter().enumerate() {
                        let number = if several { (k + 1).to_string() } else { String::new() };
                        self.0.entry(joint).or_insert_with(|| format!("{name}_joint{number}"));
                    }
                    self.0.insert(child.id(), name);
                }
                _ => {}
            }
        }
    }

    /// Returns the name of a body or joint of the document.
    pub(crate) fn name(&self, node: &Node) -> Option<&str> {
        self.0.get(&node.id()).map(String::as_str)
    }
}
