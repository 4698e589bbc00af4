//! The description of the command line for a shell and `man`: made of the parser's own description.

use std::process::ExitCode;

use clap_mangen::Man as Page;

use crate::commands::device_arguments::{Completions, Man};
use crate::screen::outcome::{say, say_as_it_is};
use crate::{Failure, Folder};

const NAME: &str = "rigident";

/// Runs `rigident completions`.
pub(crate) fn completions(arguments: &Completions) -> Result<ExitCode, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut crate::command(), NAME, &mut script);
    say_as_it_is(String::from_utf8_lossy(&script).trim_end());
    Ok(ExitCode::SUCCESS)
}

/// Runs `rigident man`.
pub(crate) fn man(arguments: &Man) -> Result<ExitCode, Failure> {
    let mut command = crate::command();
    // Names of commands below others, and what all of them take.
    command.build();
    let Some(out) = &arguments.out else {
        say_as_it_is(page(&command, NAME)?.trim_end());
        return Ok(ExitCode::SUCCESS);
    };
    let mut pages = Vec::new();
    add_pages(&command, NAME.to_owned(), &mut pages)?;
    let folder = Folder::new(Some(out), "man")?;
    for (name, page) in &pages {
        folder.write(&format!("{name}.1"), page.as_bytes())?;
    }
    say(format_args!(
        "{} pages in {}; read one by `man -l {}/{NAME}.1`",
        pages.len(),
        out.display(),
        out.display()
    ));
    Ok(ExitCode::SUCCESS)
}

/// Adds the page of a command, and those of all commands below it.
fn add_pages(
    command: &clap::Command,
    name: String,
    pages: &mut Vec<(String, String)>,
) -> Result<(), Failure> {
    pages.push((name.clone(), page(command, &name)?));
    let below = command.get_subcommands().filter(|below| below.get_name() != "help" && !below.is_hide_set());
    for below in below {
        add_pages(below, format!("{name}-{}", below.get_name()), pages)?;
    }
    Ok(())
}

fn page(command: &clap::Command, name: &str) -> Result<String, Failure> {
    let mut text = Vec::new();
    // Building the command has named it, and what is typed.
    Page::new(command.clone().version(env!("CARGO_PKG_VERSION")))
        .date("")
        .render(&mut text)
        .map_err(|e| Failure::input(format!("the page of {name} cannot be made: {e}")))?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}
