//! Elements of a robot description that can be changed and written anew: files that name other files become
//! one.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use roxmltree::Node;

use super::loose_xml::tidied;
use super::urdf::text_of;
use super::xml::{self, exactly};

/// No robot has more elements than this, all copies counted.
pub(super) const MOST_ELEMENTS: usize = 200_000;
/// Files within files within files, deeper than any robot has them.
pub(super) const DEEPEST: usize = 32;
/// Larger files are no robot descriptions, bytes.
const MOST_BYTES: u64 = 64 << 20;

/// An element of its own.
#[derive(Clone, Debug, Default)]
pub(super) struct Element {
    pub(super) tag: String,
    pub(super) attributes: Vec<(String, String)>,
    /// Text before its first child.
    pub(super) text: String,
    pub(super) children: Vec<Self>,
}

impl Element {
    pub(super) fn of(node: &Node) -> Self {
        Self {
            tag: node.tag_name().name().to_owned(),
            attributes: node.attributes().map(|a| (a.name().to_owned(), a.value().to_owned())).collect(),
            text: node.text().unwrap_or_default().trim().to_owned(),
            children: node.children().filter(Node::is_element).map(|child| Self::of(&child)).collect(),
        }
    }

    /// Reads the root of a file.
    ///
    /// # Errors
    /// Why it cannot be read.
    pub(super) fn read(path: &Path) -> Result<Self, String> {
        let unreadable = |e: std::io::Error| format!("cannot be read: {e}");
        if std::fs::metadata(path).map_err(unreadable)?.len() > MOST_BYTES {
            return Err("it is larger than any robot description".to_owned());
        }
        let text = text_of(path).map_err(|e| e.to_string())?;
        let tidy = tidied(&text);
        let document = xml::document(&tidy, &path.display().to_string()).map_err(|e| e.to_string())?;
        Ok(Self::of(&document.root_element()))
    }

    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(own, _)| own == name).map(|(_, value)| value.as_str())
    }

    pub(super) fn set(&mut self, name: &str, value: String) {
        match self.attributes.iter_mut().find(|(own, _)| own == name) {
            Some((_, own)) => *own = value,
            None => self.attributes.push((name.to_owned(), value)),
        }
    }

    /// Returns the first child of a tag.
    pub(super) fn child(&self, tag: &str) -> Option<&Self> {
        self.children.iter().find(|child| child.tag == tag)
    }

    pub(super) fn numbers<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>, String> {
        let what = format!("{name} of <{}>", self.tag);
        self.attribute(name).map(|text| exactly::<N>(xml::parse(text, &what)?, &what)).transpose()
    }

    pub(super) fn count(&self) -> usize {
        1 + self.children.iter().map(Self::count).sum::<usize>()
    }

    /// Changes attributes of these names of the element and of all in it.
    pub(super) fn change(&mut self, names: &[&str], new: &impl Fn(&str) -> String) {
        for (name, value) in &mut self.attributes {
            if names.contains(&name.as_str()) {
                *value = new(value);
            }
        }
        self.children.iter_mut().for_each(|child| child.change(names, new));
    }

    /// Returns its text, and that of all in it.
    pub(super) fn written(&self) -> String {
        let mut out = String::new();
        self.write(&mut out);
        out
    }

    fn write(&self, out: &mut String) {
        let escaped = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
        let _ = write!(out, "<{}", self.tag);
        for (name, value) in &self.attributes {
            let _ = write!(out, " {name}=\"{}\"", escaped(value));
        }
        if self.children.is_empty() && self.text.is_empty() {
            out.push_str("/>\n");
            return;
        }
        out.push('>');
        out.push_str(&escaped(&self.text));
        self.children.iter().for_each(|child| child.write(out));
        let _ = writeln!(out, "</{}>", self.tag);
    }
}

/// Returns the file that another one names, of the folders that it may be in.
///
/// # Errors
/// Returns a message if there is no such file, or if it cannot be read.
pub(super) fn beside(file: &str, folders: &[Option<&Path>]) -> Result<PathBuf, String> {
    let mut near = folders.iter().flatten().map(|folder| folder.join(file)).peekable();
    near.peek().ok_or("it is looked for beside the file that names it: give that as a file")?;
    let found = near.find(|path| path.is_file());
    let path = found.ok_or("there is no such file beside the one that names it")?;
    path.canonicalize().map_err(|e| format!("cannot be read: {e}"))
}
