//! The places where the status of an answer, or the state of one of its parameters, is set.

use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Item, Member};

use super::modules::{is_test, item_attributes};

/// Fields that a judgement sets, each with the type that it is of.
const JUDGED: [(&str, &str); 2] = [("status", "Status"), ("state", "ParameterState")];
/// Structs that have them.
const HOLDERS: [&str; 2] = ["Answer", "Parameter"];

/// Returns true if code that is no test sets the status of an answer or the state of a parameter.
pub fn sets_judgement(items: &[Item]) -> bool {
    let mut setters = Setters::default();
    items.iter().filter(|item| !matches!(item, Item::Mod(_))).for_each(|item| setters.visit_item(item));
    setters.found
}

#[derive(Default)]
struct Setters {
    found: bool,
}

impl Setters {
    fn skips(attributes: &[Attribute]) -> bool {
        is_test(attributes)
    }
}

impl<'a> Visit<'a> for Setters {
    fn visit_item(&mut self, item: &'a Item) {
        if !Self::skips(item_attributes(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, function: &'a syn::ImplItemFn) {
        if !Self::skips(&function.attrs) {
            visit::visit_impl_item_fn(self, function);
        }
    }

    fn visit_expr_assign(&mut self, assignment: &'a syn::ExprAssign) {
        if let Expr::Field(field) = &*assignment.left {
            self.found |= is_judgement(&field.member, &assignment.right);
        }
        visit::visit_expr_assign(self, assignment);
    }

    fn visit_expr_struct(&mut self, made: &'a syn::ExprStruct) {
        let holder = made.path.segments.last().is_some_and(|last| HOLDERS.iter().any(|h| last.ident == h));
        self.found |= holder && made.fields.iter().any(|field| is_judgement(&field.member, &field.expr));
        visit::visit_expr_struct(self, made);
    }
}

/// Returns true if a field is one that a judgement sets, and its value names the type of that.
fn is_judgement(member: &Member, value: &Expr) -> bool {
    let named = |name: &str| matches!(member, Member::Named(own) if own == name);
    JUDGED.iter().filter(|(field, _)| named(field)).any(|(_, name)| {
        let mut values = Named { name, found: false };
        values.visit_expr(value);
        values.found
    })
}

/// Searches for a path with a name in it.
struct Named {
    name: &'static str,
    found: bool,
}

impl<'a> Visit<'a> for Named {
    fn visit_path(&mut self, path: &'a syn::Path) {
        self.found |= path.segments.iter().any(|segment| segment.ident == self.name);
        visit::visit_path(self, path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sets(text: &str) -> bool {
        sets_judgement(&syn::parse_file(text).unwrap().items)
    }

    #[test]
    fn planted_judgements_are_found_and_others_are_not() {
        for text in [
            "fn f(answer: &mut Answer) { answer.status = Status::Implausible; }",
            "fn f(answer: &mut Answer) { if a { answer.status = if b { Status::Failed } else { c }; } }",
            "fn f(p: &mut Parameter) { p.state = ParameterState::NotIdentified; }",
            "fn f() -> Answer { Answer { status: Status::Identified, ..Answer::default() } }",
            "impl A { fn f() { all.for_each(|p| p.state = result::ParameterState::Identified(m)); } }",
        ] {
            assert!(sets(text), "{text}");
        }
        for text in [
            "fn f(answer: &Answer) -> bool { answer.status == Status::Implausible }",
            "fn f(machine: &mut Machine) { machine.state = State::Idle; }",
            "fn f(answer: &Answer) -> Answered { Answered { status: answer.status } }",
            "fn f() -> Answer { Answer { status: words(), ..Answer::default() } }",
            "#[cfg(test)] fn f(answer: &mut Answer) { answer.status = Status::Implausible; }",
        ] {
            assert!(!sets(text), "{text}");
        }
    }
}
