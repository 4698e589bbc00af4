#[cfg(feature = "simulator")]
pub(crate) mod demonstration;
#[cfg_attr(target_family = "wasm", path = "no_terminal.rs")]
pub(crate) mod terminal;

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::process::ExitCode;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

use rigident_shared::wire::ModelSettings;

use crate::commands::device_arguments::Monitor;
use crate::device::link::{configured, device_settings, of_sensors, open};
use crate::screen::outcome::say;
use crate::{Failure, Stages};
use rigident::application::Error;
use rigident::application::monitor::{GrowingView, NAP, follow, hear, rig_of};
use rigident::device::calibrated_board::another_board;
use rigident::device::session::Session;
use rigident::present::monitor::View;
use rigident::present::monitor::foxglove::Server;
use rigident_io::rig::RigFile;

/// Runs `rigident monitor`.
pub(crate) fn run(arguments: &Monitor) -> Result<ExitCode, Failure> {
    let in_terminal = !arguments.once && !arguments.json;
    if in_terminal {
        terminal::check()?;
    }
    let server = arguments.foxglove.as_deref().map(listen).transpose()?;
    let (watch, threads) = start(arguments)?;
    let published = |view: &View| {
        if let Some(server) = &server {
            server.publish(view);
        }
    };
    let shown = if in_terminal {
        terminal::show(&watch, &mut |view| published(view))
    } else {
        print(arguments, &watch, &threads, &published)
    };
    watch.leave();
    // One that still fits or moves ends with the program: nobody is kept waiting for it.
    for thread in threads.into_iter().filter(JoinHandle::is_finished) {
        thread.join().map_err(|_| Failure::input("the monitor broke down; what it watched goes on"))?;
    }
    shown?;
    let view = watch.view();
    match (view.answer, view.trouble) {
        (None, Some(why)) if !in_terminal => Err(Failure::input(why)),
        _ => Ok(ExitCode::SUCCESS),
    }
}

/// Returns an empty view of what is watched.
fn grown(watched: String) -> GrowingView {
    GrowingView::new(watched, |error: &Error| Failure::input(crate::screen::worded::error(error)).to_string())
}

/// Starts the threads that watch and fit.
fn start(arguments: &Monitor) -> Result<(Arc<GrowingView>, Vec<JoinHandle<()>>), Failure> {
    if let Some(path) = arguments.recording.clone() {
        std::fs::metadata(&path).map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
        let watch = Arc::new(grown(path.display().to_string()));
        let (rig, once) = (arguments.rig.clone(), arguments.once);
        let thread = spawn(&watch, move |watch| {
            follow(&path, rig.as_deref(), once, watch, &Stages::silent().caller());
        });
        return Ok((watch, vec![thread]));
    }
    if arguments.demo {
        return demonstration(arguments);
    }
    let attached = attach(arguments)?;
    let watch = Arc::new(grown(attached.port.clone()));
    let fit = attached.rig.clone().map(|(rig, rate_hz)| fitting(&watch, rig, rate_hz));
    let hearing = spawn(&watch, move |watch| hear(&attached.port, attached.session, watch));
    Ok((watch, std::iter::once(hearing).chain(fit).collect()))
}

/// A device that is watched.
struct Attached {
    port: String,
    session: Session,
    /// The rig of its readings; none: the device has no settings, or they are of several links.
    rig: Option<(RigFile, f64)>,
}

/// Opens the device, and starts it where that is asked for.
///
/// # Errors
/// The link; the rig file; a device that runs already.
fn attach(arguments: &Monitor) -> Result<Attached, Failure> {
    let rig = arguments.rig.as_deref().map(RigFile::load).transpose().map_err(Failure::input)?;
    let (port, mut session) = open(arguments.device.port.as_deref(), &[])?;
    if let Some(rig) = rig.as_ref().filter(|_| arguments.start) {
        let timing = of_sensors(rig.recording.rate_hz.unwrap_or(1000.0));
        if let Some(warning) = another_board(rig, session.identity()) {
            tell!("rigident: {warning}");
        }
        configured(&mut session, &device_settings(rig, &timing, None)?)?;
        session.set_running().map_err(Failure::link)?;
    }
    let held = session.held_settings().map_err(|e| Failure::link(e).context(&port))?;
    let rig = held.filter(|held| held.model == ModelSettings::Body).map(|held| {
        let rate_hz = f64::from(held.rate_hz);
        (rig.unwrap_or_else(|| rig_of(&held)), rate_hz)
    });
    Ok(Attached { port, session, rig })
}

#[cfg(feature = "simulator")]
fn demonstration(arguments: &Monitor) -> Result<(Arc<GrowingView>, Vec<JoinHandle<()>>), Failure> {
    use crate::commands::demo;

    let demonstration = demonstration::prepare()?;
    let watch = Arc::new(grown("the demonstration, firmware in this process".to_owned()));
    let fit = fitting(&watch, demonstration.rig.clone(), demo::RATE_HZ);
    let is_paced = !arguments.once;
    let moving = spawn(&watch, move |watch| demonstration::follow(demonstration, is_paced, watch));
    Ok((watch, vec![moving, fit]))
}

#[cfg(not(feature = "simulator"))]
fn demonstration(_: &Monitor) -> Result<(Arc<GrowingView>, Vec<JoinHandle<()>>), Failure> {
    Err(crate::needs_simulator("`rigident monitor --demo`"))
}

fn fitting(watch: &Arc<GrowingView>, rig: RigFile, rate_hz: f64) -> JoinHandle<()> {
    spawn(watch, move |watch| watch.fit_readings(&rig, rate_hz))
}

/// Starts a thread. If it breaks down, the viewer is informed by the view's end.
fn spawn(watch: &Arc<GrowingView>, work: impl FnOnce(&GrowingView) + Send + 'static) -> JoinHandle<()> {
    let shared = Arc::clone(watch);
    thread::spawn(move || {
        let _guard = LeavesOnPanic(&shared);
        work(&shared);
    })
}

/// Ends the watch if its thread panics.
struct LeavesOnPanic<'a>(&'a GrowingView);

impl Drop for LeavesOnPanic<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.leave();
        }
    }
}

/// Prints objects or the last picture.
fn print(
    arguments: &Monitor,
    watch: &GrowingView,
    threads: &[JoinHandle<()>],
    published: &dyn Fn(&View),
) -> Result<(), Failure> {
    // A device has no end.
    let is_device = arguments.recording.is_none() && !arguments.demo;
    let mut said = None;
    loop {
        // Checked first: what arrived before the end is printed.
        let ended = threads.iter().all(JoinHandle::is_finished);
        let view = watch.view();
        published(&view);
        let readings = view.answer.as_ref().map(|answer| answer.readings);
        if arguments.json && !arguments.once && readings.is_some() && readings != said {
            say(as_json(&view)?);
            said = readings;
        }
        let enough = ended || (arguments.once && is_device && readings.is_some());
        if enough || watch.is_left() {
            break;
        }
        thread::sleep(NAP);
    }
    let view = watch.view();
    match (arguments.once, arguments.json) {
        (true, true) => say(as_json(&view)?),
        (true, false) => say(terminal::text(&view)?),
        _ => {}
    }
    Ok(())
}

fn as_json(view: &View) -> Result<String, Failure> {
    serde_json::to_string(view).map_err(|e| Failure::input(format!("the view cannot be put into JSON: {e}")))
}

/// Waits for Foxglove.
fn listen(text: &str) -> Result<Server, Failure> {
    let local = text.parse().ok().map(|port: u16| SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port));
    let address = local.or_else(|| text.parse().ok()).ok_or_else(|| {
        Failure::input(format!("--foxglove={text}: give a port, or an address with a port as 0.0.0.0:8765"))
    })?;
    let server = Server::listen(address).map_err(|e| {
        Failure::input(format!("--foxglove={text}: {e}; is another monitor running? Give another port"))
    })?;
    tell!("Foxglove: open a connection to ws://{}", server.address());
    Ok(server)
}
