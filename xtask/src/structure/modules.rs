//! Modules of a crate, what they refer to, and which of it is for Unix alone; tests are left out.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Item, UseTree};

/// Names by which code for Unix alone is known.
const UNIX: [&[&str]; 5] =
    [&["std", "os", "unix"], &["std", "os", "fd"], &["nix"], &["libc"], &["serialport", "TTYPort"]];

/// Path of a module from the crate's root, which has none.
pub type Name = Vec<String>;

/// A path that occurs in a module.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Reference {
    /// Module in which it occurs.
    pub from: Name,
    /// Module that it leads to.
    pub to: Name,
    /// File in which it occurs.
    pub file: PathBuf,
}

/// A parsed crate.
#[derive(Default)]
pub struct Crate {
    modules: Vec<Module>,
}

struct Module {
    name: Name,
    file: PathBuf,
    /// Compiled on Unix alone.
    guarded: bool,
    items: Vec<Item>,
}

impl Crate {
    /// Parses what `lib.rs` leads to. `sources` holds the files below the source folder by their paths from
    /// there.
    ///
    /// # Errors
    /// A file that is missing or cannot be parsed.
    pub fn parse(sources: &BTreeMap<PathBuf, String>) -> Result<Self> {
        let mut parsed = Self::default();
        parsed.add(sources, Vec::new(), Path::new("lib.rs"), Path::new(""), false)?;
        Ok(parsed)
    }

    fn add(
        &mut self,
        sources: &BTreeMap<PathBuf, String>,
        name: Name,
        file: &Path,
        folder: &Path,
        guarded: bool,
    ) -> Result<()> {
        let text = sources.get(file).with_context(|| format!("there is no {}", file.display()))?;
        let items = syn::parse_file(text).with_context(|| format!("{}", file.display()))?.items;
        self.add_items(sources, Module { name, file: file.to_owned(), guarded, items }, folder)
    }

    fn add_items(
        &mut self,
        sources: &BTreeMap<PathBuf, String>,
        module: Module,
        folder: &Path,
    ) -> Result<()> {
        for item in &module.items {
            let Item::Mod(inner) = item else { continue };
            if is_test(&inner.attrs) {
                continue;
            }
            let word = inner.ident.to_string();
            let mut name = module.name.clone();
            name.push(word.clone());
            let guarded = module.guarded || is_unix_only(&inner.attrs);
            let below = folder.join(&word);
            if let Some((_, items)) = &inner.content {
                let inline = Module { name, file: module.file.clone(), guarded, items: items.clone() };
                self.add_items(sources, inline, &below)?;
                continue;
            }
            let beside = module.file.parent().unwrap_or(Path::new(""));
            let candidates = match path_of(&inner.attrs) {
                // A file of another crate, which is examined there.
                Some(path) if path.starts_with("..") => continue,
                Some(path) => vec![beside.join(path)],
                None => vec![folder.join(format!("{word}.rs")), below.join("mod.rs")],
            };
            let file = candidates.iter().find(|c| sources.contains_key(*c));
            let file = file.with_context(|| format!("no file of module {}", name.join("::")))?;
            self.add(sources, name, file, &below, guarded)?;
        }
        self.modules.push(module);
        Ok(())
    }

    /// Returns every path that leads from one module of the crate to another.
    pub fn references(&self) -> BTreeSet<Reference> {
        let names: BTreeSet<Name> = self.modules.iter().map(|m| m.name.clone()).collect();
        let mut imports: BTreeMap<(Name, String), Vec<String>> = BTreeMap::new();
        for module in &self.modules {
            for (alias, path) in imported(&module.items) {
                imports.entry((module.name.clone(), alias)).or_insert(path);
            }
        }
        let mut found = BTreeSet::new();
        for module in &self.modules {
            let mut paths = Paths::default();
            paths.of_module(&module.items);
            for path in paths.found {
                if let Some(to) = target(&path, &module.name, &names, &imports, 8)
                    && to != module.name
                {
                    found.insert(Reference { from: module.name.clone(), to, file: module.file.clone() });
                }
            }
        }
        found
    }

    /// Returns files with code that only Unix has and that nothing guards, each with a path of it.
    pub fn unguarded_unix(&self) -> BTreeSet<(PathBuf, String)> {
        self.modules
            .iter()
            .filter(|module| !module.guarded)
            .flat_map(|module| {
                let mut paths = Paths { skip_guarded: true, ..Paths::default() };
                paths.of_module(&module.items);
                let unix = |path: &&Vec<String>| UNIX.iter().any(|start| starts_with(path, start));
                let found: Vec<_> = paths.found.iter().filter(unix).map(|path| path.join("::")).collect();
                found.into_iter().map(|path| (module.file.clone(), path))
            })
            .collect()
    }

    /// Returns files whose items are as asked.
    pub fn files_with(&self, is_so: impl Fn(&[Item]) -> bool) -> BTreeSet<PathBuf> {
        let found = self.modules.iter().filter(|module| is_so(&module.items));
        found.map(|module| module.file.clone()).collect()
    }

    /// Returns files in which a path ends with one of these names.
    pub fn files_naming(&self, last: &[&str]) -> BTreeSet<PathBuf> {
        let names = |module: &&Module| {
            let mut paths = Paths::default();
            paths.of_module(&module.items);
            paths.found.iter().any(|p| p.len() > 1 && p.last().is_some_and(|l| last.contains(&l.as_str())))
        };
        self.modules.iter().filter(names).map(|module| module.file.clone()).collect()
    }
}

fn starts_with(path: &[String], start: &[&str]) -> bool {
    path.len() >= start.len() && path.iter().zip(start).all(|(a, b)| a == b)
}

/// Returns the module that a path in `from` leads to, through imports; `None` if it leads out of the crate.
fn target(
    path: &[String],
    from: &Name,
    names: &BTreeSet<Name>,
    imports: &BTreeMap<(Name, String), Vec<String>>,
    depth: usize,
) -> Option<Name> {
    let (first, mut rest) = path.split_first()?;
    let mut at = from.clone();
    match first.as_str() {
        "crate" => at.clear(),
        "self" => {}
        "super" => {
            at.pop()?;
            while let Some((word, after)) = rest.split_first()
                && word == "super"
            {
                at.pop()?;
                rest = after;
            }
        }
        child => {
            at.push(child.to_owned());
            if !names.contains(&at) {
                return None;
            }
        }
    }
    for (k, word) in rest.iter().enumerate() {
        at.push(word.clone());
        if names.contains(&at) {
            continue;
        }
        at.pop();
        let import = imports.get(&(at.clone(), word.clone())).filter(|_| depth > 0);
        let Some(import) = import else { break };
        let further: Vec<String> = import.iter().chain(rest.iter().skip(k + 1)).cloned().collect();
        return target(&further, &at, names, imports, depth - 1);
    }
    Some(at)
}

/// Returns the names that `use` brings into a module, each with its path.
fn imported(items: &[Item]) -> Vec<(String, Vec<String>)> {
    let mut found = Vec::new();
    for item in items {
        if let Item::Use(import) = item
            && !is_test(&import.attrs)
        {
            leaves(&import.tree, &mut Vec::new(), &mut |path, alias| found.push((alias, path)));
        }
    }
    found
}

/// Calls `leaf` with every path of a `use` and the name that it gets; a star's path is that before it, its
/// name `*`.
fn leaves(tree: &UseTree, before: &mut Vec<String>, leaf: &mut impl FnMut(Vec<String>, String)) {
    match tree {
        UseTree::Path(path) => {
            before.push(path.ident.to_string());
            leaves(&path.tree, before, leaf);
            before.pop();
        }
        UseTree::Group(group) => group.items.iter().for_each(|tree| leaves(tree, before, leaf)),
        UseTree::Glob(_) => leaf(before.clone(), "*".to_owned()),
        UseTree::Name(name) => {
            let word = name.ident.to_string();
            let mut path = before.clone();
            if word != "self" {
                path.push(word);
            }
            let alias = path.last().cloned().unwrap_or_default();
            leaf(path, alias);
        }
        UseTree::Rename(renamed) => {
            let mut path = before.clone();
            path.push(renamed.ident.to_string());
            leaf(path, renamed.rename.to_string());
        }
    }
}

/// Every path of a module, without those of tests and, if asked, without guarded ones.
#[derive(Default)]
struct Paths {
    found: BTreeSet<Vec<String>>,
    skip_guarded: bool,
}

impl Paths {
    fn of_module(&mut self, items: &[Item]) {
        items.iter().filter(|item| !matches!(item, Item::Mod(_))).for_each(|item| self.visit_item(item));
    }

    fn skips(&self, attributes: &[Attribute]) -> bool {
        is_test(attributes) || (self.skip_guarded && is_unix_only(attributes))
    }
}

impl<'a> Visit<'a> for Paths {
    fn visit_item(&mut self, item: &'a Item) {
        if !self.skips(item_attributes(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'a syn::ImplItemFn) {
        if !self.skips(&function.attrs) {
            visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_local(&mut self, local: &'a syn::Local) {
        if !self.skips(&local.attrs) {
            visit::visit_local(self, local);
        }
    }

    fn visit_arm(&mut self, arm: &'a syn::Arm) {
        if !self.skips(&arm.attrs) {
            visit::visit_arm(self, arm);
        }
    }

    fn visit_expr(&mut self, expression: &'a Expr) {
        if !self.skips(expression_attributes(expression)) {
            visit::visit_expr(self, expression);
        }
    }

    fn visit_item_use(&mut self, import: &'a syn::ItemUse) {
        leaves(&import.tree, &mut Vec::new(), &mut |path, _| {
            self.found.insert(path);
        });
    }

    /// Takes the paths from the words: what a macro makes of its arguments is not parsed.
    fn visit_macro(&mut self, call: &'a syn::Macro) {
        let words = call.tokens.to_string().replace(" :: ", "::").replace(":: ", "::");
        let paths = words.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':'));
        let paths = paths.filter(|path| path.contains("::") && !path.starts_with(':'));
        self.found.extend(paths.map(|path| path.split("::").map(str::to_owned).collect()));
        visit::visit_macro(self, call);
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        self.found.insert(path.segments.iter().map(|s| s.ident.to_string()).collect());
        visit::visit_path(self, path);
    }
}

pub(super) fn item_attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(i) => &i.attrs,
        Item::Enum(i) => &i.attrs,
        Item::Fn(i) => &i.attrs,
        Item::Impl(i) => &i.attrs,
        Item::Macro(i) => &i.attrs,
        Item::Mod(i) => &i.attrs,
        Item::Static(i) => &i.attrs,
        Item::Struct(i) => &i.attrs,
        Item::Trait(i) => &i.attrs,
        Item::Type(i) => &i.attrs,
        Item::Use(i) => &i.attrs,
        _ => &[],
    }
}

fn expression_attributes(expression: &Expr) -> &[Attribute] {
    match expression {
        Expr::Assign(e) => &e.attrs,
        Expr::Block(e) => &e.attrs,
        Expr::Call(e) => &e.attrs,
        Expr::If(e) => &e.attrs,
        Expr::Macro(e) => &e.attrs,
        Expr::Match(e) => &e.attrs,
        Expr::MethodCall(e) => &e.attrs,
        Expr::Return(e) => &e.attrs,
        _ => &[],
    }
}

/// Returns the words between the brackets of every `cfg`.
fn conditions(attributes: &[Attribute]) -> impl Iterator<Item = String> + '_ {
    attributes.iter().filter(|a| a.path().is_ident("cfg")).filter_map(|a| {
        let list = a.meta.require_list().ok()?;
        Some(list.tokens.to_string())
    })
}

/// Tells whether something is there for tests alone.
pub(super) fn is_test(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|a| a.path().is_ident("test"))
        || conditions(attributes).any(|c| c == "test" || c.starts_with("all (test"))
}

/// Tells whether something is there on Unix alone, or with the feature that is.
fn is_unix_only(attributes: &[Attribute]) -> bool {
    conditions(attributes).any(|c| {
        !c.starts_with("not") && ["unix", "target_os", "\"emulator\""].iter().any(|word| c.contains(word))
    })
}

/// Returns the file that `#[path = "…"]` names.
fn path_of(attributes: &[Attribute]) -> Option<String> {
    let value = &attributes.iter().find(|a| a.path().is_ident("path"))?.meta.require_name_value().ok()?.value;
    match value {
        Expr::Lit(syn::ExprLit { lit: syn::Lit::Str(text), .. }) => Some(text.value()),
        _ => None,
    }
}
