//! The bodies of the world that are the robot, and those that lie beside it.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::tree::Joint;
use roxmltree::Node;

use super::masses::shortened;
use super::{Reader, WORLD, raw};
use crate::tree::RawLink;

/// An element with the frames around it, up to the body that it is in.
#[derive(Clone)]
pub(super) struct Inside<'n> {
    pub(super) node: Node<'n, 'n>,
    /// Body's axes ← those of the innermost frame.
    pub(super) rotation: Matrix3<f64>,
    /// Origin of the innermost frame in the body's frame, m.
    pub(super) position: Vector3<f64>,
    /// Default classes of what is in bodies and frames, the innermost last.
    pub(super) classes: Vec<&'n str>,
}

impl<'n> Inside<'n> {
    pub(super) fn new(node: Node<'n, 'n>, classes: &[&'n str]) -> Self {
        Self { node, rotation: Matrix3::identity(), position: Vector3::zeros(), classes: classes.to_vec() }
    }
}

/// A body of the world with those in it.
struct Tree<'n> {
    body: Inside<'n>,
    floats: bool,
    /// Joints within it, without the one that it floats by.
    joints: usize,
}

impl<'a> Reader<'a> {
    fn tree(&self, body: &Inside<'a>) -> Result<Tree<'a>, String> {
        let inside = self.inside(&body.node, &body.classes)?;
        let is_free = |own: &Inside| {
            let mut classes = own.classes.clone();
            classes.extend(body.node.attribute("childclass"));
            own.node.has_tag_name("freejoint")
                || (own.node.has_tag_name("joint")
                    && self.joint_word(&own.node, "type", &classes) == Some("free"))
        };
        let floats = inside.iter().any(is_free);
        let all = body.node.descendants().filter(|n| n.has_tag_name("joint")).count();
        let own = inside.iter().filter(|own| is_free(own) && own.node.has_tag_name("joint")).count();
        Ok(Tree { body: body.clone(), floats, joints: all.saturating_sub(own) })
    }

    /// Reads the bodies of the world and keeps those of the robot: of what floats and what hangs on the world
    /// that with the most joints. What hangs on the world is one tree.
    pub(super) fn world(&mut self, bodies: &[Inside<'a>]) -> Result<(), String> {
        let trees = bodies.iter().map(|body| self.tree(body)).collect::<Result<Vec<_>, _>>()?;
        let held: usize = trees.iter().filter(|tree| !tree.floats).map(|tree| tree.joints).sum();
        // The first of the largest.
        let floating = trees.iter().enumerate().filter(|(_, tree)| tree.floats);
        let floating = floating.min_by_key(|(i, tree)| (usize::MAX - tree.joints, *i));
        let own_base = floating.filter(|(_, tree)| held == 0 || tree.joints > held).map(|(i, _)| i);
        let mut robot: Vec<RawLink> = Vec::new();
        if own_base.is_none() {
            robot.push(raw(WORLD, "", None, Joint::Free, Matrix3::identity(), Vector3::zeros()));
        }
        let (mut left_out, mut beside) = (Vec::new(), Vec::new());
        for (i, tree) in trees.iter().enumerate() {
            let kept = own_base.map_or(!tree.floats, |own| own == i);
            let parent = (own_base.is_none() && kept).then_some(WORLD);
            let findings = self.findings.len();
            self.body(&tree.body, parent, Vector3::zeros())?;
            let own = std::mem::take(&mut self.raw);
            if kept {
                robot.extend(own);
                continue;
            }
            // What lies beside the robot says nothing of it.
            self.findings.truncate(findings);
            for name in own.iter().map(|link| link.link.name.clone()) {
                self.anchors.remove(&name);
            }
            left_out.extend(self.names.name(&tree.body.node).map(str::to_owned));
            beside.extend(own);
        }
        let mut all: Vec<&mut RawLink> = robot.iter_mut().chain(&mut beside).collect();
        if let Some(why) = self.masses.scale(&mut all, &self.unknown) {
            self.find("compiler", &why);
        }
        if !left_out.is_empty() {
            let base = robot.first().map_or(WORLD, |link| link.link.name.as_str());
            let text = format!(
                "{} {} left out: the robot is the tree on {base}, and nothing joins the two",
                shortened(&left_out),
                if left_out.len() == 1 { "is" } else { "are" }
            );
            self.find("bodies beside the robot", &text);
        }
        self.raw = robot;
        Ok(())
    }
}
