//! The library's texts in the terms of the command line: parameters as options, jobs as commands.

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

/// The words before a backticked name that is no parameter: a key of a file, as its reader names it, or a
/// command of the device's protocol. Further names of such a list follow it.
const OF_OTHERS: [&str; 9] =
    ["field ", "variant ", "key ", "expected ", "one of ", "answer ", "answers ", "answered ", "refuses "];

/// The two ends of a script in a page.
const SCRIPT: [&str; 2] = ["<script", "</script>"];

/// The names of the command line.
#[derive(Default)]
struct Terms {
    /// Long options of all commands, without their hyphens.
    options: BTreeSet<String>,
    /// Commands as they are typed, by the names of their jobs: `plan_poses` is `plan poses`.
    commands: BTreeMap<String, String>,
}

/// Returns a text with the library's names in the terms of the command line: `` `write_model` `` is
/// `--write-model`, `` `configure(write=FILE)` `` is `` `rigident configure --write FILE` ``. Other words in
/// backticks stay as they are, and so do the scripts of a page.
pub(crate) fn in_own_terms(text: &str) -> Cow<'_, str> {
    if !text.contains('`') {
        return Cow::Borrowed(text);
    }
    let (mut own, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(begin) = rest.find(SCRIPT[0]) {
        let end = rest[begin..].find(SCRIPT[1]).map_or(rest.len(), |length| begin + length);
        reword(&rest[..begin], &mut own);
        own += &rest[begin..end];
        rest = &rest[end..];
    }
    reword(rest, &mut own);
    Cow::Owned(own)
}

/// Appends a text without scripts in the terms of the command line.
fn reword(text: &str, own: &mut String) {
    let terms = Terms::of_this_program();
    let (mut rest, mut is_of_others) = (text, false);
    while let Some((before, after)) = rest.split_once('`') {
        *own += before;
        is_of_others = OF_OTHERS.iter().any(|words| before.ends_with(words))
            || (is_of_others && matches!(before, ", " | " or "));
        match after.split_once('`').filter(|(name, _)| is_name(name)) {
            Some((name, behind)) => {
                let term = if is_of_others { None } else { terms.own(name) };
                *own += &term.unwrap_or_else(|| format!("`{name}`"));
                rest = behind;
            }
            None => {
                own.push('`');
                rest = after;
            }
        }
    }
    *own += rest;
}

/// Returns true for a word, and for a word with something in parentheses behind it.
fn is_name(text: &str) -> bool {
    let is_word = |word: &str| {
        !word.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.'))
    };
    match text.strip_suffix(')').and_then(|text| text.split_once('(')) {
        Some((job, given)) => is_word(job) && !given.contains('\n'),
        None => is_word(text),
    }
}

impl Terms {
    /// Returns those of this program's parser.
    fn of_this_program() -> &'static Self {
        static TERMS: OnceLock<Terms> = OnceLock::new();
        TERMS.get_or_init(|| {
            let mut terms = Self::default();
            terms.add(&crate::command(), "");
            terms
        })
    }

    /// Adds the options of a command, and the commands below it; `path` is how it is typed.
    fn add(&mut self, command: &clap::Command, path: &str) {
        self.options.extend(command.get_arguments().filter_map(clap::Arg::get_long).map(str::to_owned));
        for below in command.get_subcommands() {
            let path = format!("{path} {}", below.get_name()).trim_start().to_owned();
            self.add(below, &path);
            self.commands.insert(path.replace([' ', '-'], "_"), path);
        }
    }

    /// Returns the term for a parameter or a job of the library, if there is one here.
    fn own(&self, name: &str) -> Option<String> {
        let Some((job, given)) = name.strip_suffix(')').and_then(|name| name.split_once('(')) else {
            return self.option(name);
        };
        let mut own = format!("`rigident {}", self.commands.get(job)?);
        for given in given.split(", ").filter(|given| !given.is_empty()) {
            let (name, value) = given.split_once('=').map_or((given, None), |(name, v)| (name, Some(v)));
            own.push(' ');
            match (self.option(name), value) {
                (Some(option), Some(value)) => own += &format!("{option} {value}"),
                (Some(option), None) => own += &option,
                (None, _) => own += given,
            }
        }
        own.push('`');
        Some(own)
    }

    /// Returns the option for a parameter. One in seconds may lack the unit: `forget_s` is `--forget`.
    fn option(&self, parameter: &str) -> Option<String> {
        let name = parameter.replace('_', "-");
        let without_unit = name.strip_suffix("-s");
        let known = [Some(name.as_str()), without_unit].into_iter().flatten();
        let is_parameter = !parameter.contains('-');
        let mut options = known.filter(|name| is_parameter && self.options.contains(*name));
        options.next().map(|option| format!("--{option}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_options_and_jobs_are_commands() {
        for (library, command_line) in [
            ("`lock` elbow: it is given twice", "--lock elbow: it is given twice"),
            ("give `cut_off_hz` or `height_m`", "give --cut-off-hz or --height-m"),
            ("of rows (`forget_s` 5)", "of rows (--forget 5)"),
            ("the motion takes `settle_s` 2", "the motion takes --settle-s 2"),
            ("`range` a=-3.1,3.1 `speed` a=1", "--range a=-3.1,3.1 --speed a=1"),
            ("anew with `factor()`", "anew with `rigident factor`"),
            ("by `calibrate_load_cell()`", "by `rigident calibrate load-cell`"),
            ("as of `plan_poses(n=5)`, each", "as of `rigident plan poses --n 5`, each"),
            ("`plan_motion(no_poses)`", "`rigident plan motion --no-poses`"),
            ("`plan(…, rig)`", "`rigident plan … --rig`"),
            ("`factor(label=body=…)` gives", "`rigident factor --label body=…` gives"),
            ("`identify(RECORDING)`", "`rigident identify RECORDING`"),
        ] {
            assert_eq!(in_own_terms(library), command_line);
            assert_eq!(in_own_terms(command_line), command_line);
        }
    }

    #[test]
    fn names_that_are_not_the_librarys_stay_as_they_are() {
        for text in [
            "unknown field `lok`, expected one of `rig`, `body`, `mass`",
            "unknown variant `z`, expected `com` or `inertia`",
            "missing field `joints` at line 1",
            "duplicate key `rig`",
            "the device does not answer `hold`",
            "the device refuses `start`: no (error 3)",
            "`stiffness` of the spring; `+-` and `+/-`; `rigident plan`; `no_such_job()`",
            "one ` alone, and ``",
            "`body",
            "does `ros2 topic hz body` show messages",
            "`write-model`, `--rig`",
            "",
        ] {
            assert_eq!(in_own_terms(text), text);
        }
        // The list of a reader ends, and the text goes on.
        let said = in_own_terms("expected `com` or `mass`; give `rig`, or `body`");
        assert_eq!(said, "expected `com` or `mass`; give --rig, or --body");
        assert_eq!(in_own_terms("a ` and `ros2 bag` and `rig`"), "a ` and `ros2 bag` and --rig");
        let page = in_own_terms("<p>`rig`</p><script>f(`rig`)</script>`rig`<script>`rig`");
        assert_eq!(page, "<p>--rig</p><script>f(`rig`)</script>--rig<script>`rig`");
    }
}
