//! `rigident ui`: the page of the browser, from this program or from a folder, served to this computer alone.

pub(crate) mod arguments;
#[cfg(all(feature = "page", not(target_family = "wasm")))]
pub(crate) mod files;
#[cfg(not(target_family = "wasm"))]
pub(crate) mod server;

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use crate::Failure;
use crate::commands::ui::arguments::Ui;
use crate::commands::ui::server::{Server, Site};
use crate::screen::outcome::say;

/// Files that a page needs to work.
const NEEDED: [&str; 2] = ["index.html", "rigident.wasm.gz"];

/// Runs `rigident ui`.
pub(crate) fn run(arguments: &Ui) -> Result<ExitCode, Failure> {
    let site = match &arguments.site {
        Some(folder) => Site::Folder(folder.clone()),
        None => embedded()?,
    };
    check(&site)?;
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, arguments.port));
    let listener = TcpListener::bind(address).map_err(|e| {
        Failure::input(format!(
            "--port {}: {e}; is another `rigident ui` running? Give another port",
            arguments.port
        ))
    })?;
    let server = Server::new(listener, site).map_err(Failure::input)?;
    let url = server.url();
    say(format_args!(
        "{url}\nServed to this computer alone; nothing that is chosen there leaves it. Ctrl-C ends it."
    ));
    if !arguments.no_open && !open(&url) {
        tell!("rigident: no browser could be opened here: open the address by hand");
    }
    server.serve(&rigident::device::session::INTERRUPTED);
    Ok(ExitCode::SUCCESS)
}

#[cfg(feature = "page")]
#[expect(clippy::unnecessary_wraps, reason = "its twin fails")]
fn embedded() -> Result<Site, Failure> {
    Ok(Site::Embedded(crate::commands::ui::files::FILES))
}

#[cfg(not(feature = "page"))]
fn embedded() -> Result<Site, Failure> {
    Err(Failure::input(
        "the page is not in this build. Make it by `cargo xtask web --build`, then give its folder, --site \
         target/web/site; or build the program with it: `cargo xtask web --program`",
    ))
}

/// Refuses a site without its parts.
fn check(site: &Site) -> Result<(), Failure> {
    let place = match site {
        Site::Folder(folder) => folder.clone(),
        Site::Embedded(_) => PathBuf::new(),
    };
    match NEEDED.iter().find(|name| site.file(name).is_none()) {
        None => Ok(()),
        Some(name) => Err(Failure::input(format!(
            "--site {}: it has no {name}: make the page by `cargo xtask web --build`, which leaves it in \
             target/web/site",
            Path::display(&place)
        ))),
    }
}

/// Opens an address in the user's browser; false if there is none to be found.
fn open(url: &str) -> bool {
    let words: &[&str] = if cfg!(target_os = "windows") {
        &["cmd", "/c", "start", ""]
    } else if cfg!(target_os = "macos") {
        &["open"]
    } else {
        &["xdg-open"]
    };
    let Some((program, rest)) = words.split_first() else { return false };
    let silent = Stdio::null;
    Command::new(program)
        .args(rest)
        .arg(url)
        .stdin(silent())
        .stdout(silent())
        .stderr(silent())
        .spawn()
        .is_ok()
}
