//! The places where a text names an option or a command of the command line.

use syn::visit::{self, Visit};
use syn::{Attribute, Item, LitStr, Macro, Meta};

use super::modules::{is_test, item_attributes};

/// Returns true if code that is no test has a text with an option (`--x`) or a command (`rigident x`) in it;
/// comments do not count.
pub fn names_the_command_line(items: &[Item]) -> bool {
    let mut texts = Texts::default();
    items.iter().filter(|item| !matches!(item, Item::Mod(_))).for_each(|item| texts.visit_item(item));
    texts.found
}

/// Returns true if there are two hyphens with a letter behind them that are no property of a style sheet.
fn has_option(text: &str) -> bool {
    text.match_indices("--").any(|(place, _)| {
        let behind = &text[place + 2..];
        let end = behind.find(|c: char| !c.is_ascii_alphanumeric() && c != '-').unwrap_or(behind.len());
        let is_style = text[..place].ends_with("var(")
            || behind[end..].strip_prefix(':').is_some_and(|value| !value.starts_with(' '));
        behind.starts_with(|c: char| c.is_ascii_lowercase()) && !text[..place].ends_with('!') && !is_style
    })
}

/// Returns true if the program's name has a lower-case word behind it.
fn has_command(text: &str) -> bool {
    text.match_indices("rigident ").any(|(place, name)| {
        let is_word = !text[..place].ends_with(|c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '/'));
        is_word && text[place + name.len()..].starts_with(|c: char| c.is_ascii_lowercase())
    })
}

/// Returns a text as written in the sources with its lines joined where they are continued.
fn joined(written: &str) -> String {
    let mut lines = written.split("\\\n");
    let first = lines.next().unwrap_or_default().to_owned();
    lines.fold(first, |text, line| text + line.trim_start())
}

fn names_one(text: &str) -> bool {
    has_option(text) || has_command(text)
}

#[derive(Default)]
struct Texts {
    found: bool,
}

impl<'a> Visit<'a> for Texts {
    fn visit_item(&mut self, item: &'a Item) {
        if !is_test(item_attributes(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'a syn::ImplItemFn) {
        if !is_test(&function.attrs) {
            visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_attribute(&mut self, attribute: &'a Attribute) {
        // A comment is an attribute with a value; the words of an error are in a list.
        if let Meta::List(list) = &attribute.meta {
            self.found |= names_one(&joined(&list.tokens.to_string()));
        }
    }

    fn visit_macro(&mut self, called: &'a Macro) {
        self.found |= names_one(&joined(&called.tokens.to_string()));
    }

    fn visit_lit_str(&mut self, text: &'a LitStr) {
        self.found |= names_one(&text.value());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_and_commands_are_found_in_every_text_and_not_in_comments_and_tests() {
        for (text, names) in [
            ("fn f() -> &'static str { \"give it by --rig\" }", true),
            ("fn f(x: u8) -> String { format!(\"--known {x}: no\") }", true),
            ("#[derive(Error)] enum E { #[error(\"--sex {0}\")] Sex(String) }", true),
            ("impl S { fn f(&self) { self.say(\"`rigident --json`\") } }", true),
            ("/// By --rig.\nfn f() -> &'static str { \"a -- b, 3--4\" }", false),
            ("fn f() -> &'static str { \":root{--ink:#111}a{color:var(--ink)}<!--note-->\" }", false),
            ("#[cfg(test)] fn f() -> &'static str { \"--rig\" }", false),
            ("fn f() -> &'static str { \"make it anew with `rigident factor`\" }", true),
            ("#[serde(expecting = \"what rigident calibrate rig writes\")] struct S;", true),
            (
                "/// As `rigident factor` does.\nfn f() -> &'static str \
                 { \"of this version of rigident; rigident-sim serve\" }",
                false,
            ),
            ("fn f() -> &'static str { \"say `lock` JOINT=VALUE, or `plan_motion(no_poses)`\" }", false),
            ("impl S { #[test] fn f() { assert!(x.contains(\"--rig\")) } }", false),
        ] {
            assert_eq!(names_the_command_line(&syn::parse_file(text).unwrap().items), names, "{text}");
        }
    }
}
