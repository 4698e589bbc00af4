//! Options of a single body's that are given for a tree of links: refused, never ignored.

use crate::Failure;
use crate::commands::run::adaptive::Adaptive;
use crate::commands::run::programme::Programme;
use crate::options::forgetting::Forgetting;

/// Options by name, and whether they are given.
pub(crate) trait Given {
    /// Returns all options.
    fn given(&self) -> Vec<(&'static str, bool)>;
}

impl Given for Forgetting {
    fn given(&self) -> Vec<(&'static str, bool)> {
        vec![("--forget", self.forget.is_some()), ("--window", self.window.is_some())]
    }
}

impl Given for Adaptive {
    fn given(&self) -> Vec<(&'static str, bool)> {
        vec![
            ("--adaptive", self.adaptive),
            ("--until-relative", self.until_relative.is_some()),
            ("--at-most-s", self.at_most_s.is_some()),
        ]
    }
}

impl Given for Programme {
    /// Returns the plan alone: the duration is used by others too.
    fn given(&self) -> Vec<(&'static str, bool)> {
        vec![("--plan", self.plan.is_some())]
    }
}

/// Refuses the first of a single body's options that is given.
///
/// # Errors
/// Bad input, with the option's name.
pub(crate) fn refuse_for_trees(options: &[&dyn Given]) -> Result<(), Failure> {
    match options.iter().flat_map(|o| o.given()).find(|(_, given)| *given) {
        None => Ok(()),
        Some((option, _)) => {
            Err(Failure::input(format!("{option}: for a single body only, not for a tree of links")))
        }
    }
}
