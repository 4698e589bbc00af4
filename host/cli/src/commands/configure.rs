use std::path::Path;
use std::process::ExitCode;

use rigident_shared::wire::{Settings, StateName};
use serde_json::{Value, json};

use crate::Failure;
use crate::commands::device_arguments::Configure;
use crate::device::link::{configured, device_settings, of_sensors, open};
use crate::screen::outcome::say;
use rigident::device::calibrated_board::another_board;
use rigident::device::settings_file::{self, Change};
use rigident::device::words;
use rigident_io::recording::extension;
use rigident_io::recording::new_file::write_new_text;
use rigident_io::rig::RigFile;

/// Runs `rigident configure`.
pub(crate) fn run(arguments: &Configure) -> Result<ExitCode, Failure> {
    // What is wrong with the files is said before a port is opened.
    let rig = arguments.rig.as_deref().map(RigFile::load).transpose().map_err(Failure::input)?;
    let wanted = wanted(arguments, rig.as_ref())?;
    if let Some(path) = &arguments.write {
        check_target(path)?;
    }
    if arguments.dry_run && wanted.is_none() {
        return Err(Failure::input("--dry-run shows what --rig or --from would change: give one of them"));
    }
    let (port, mut session) = open(arguments.device.port.as_deref(), &[])?;
    if let Some(warning) = rig.as_ref().and_then(|rig| another_board(rig, session.identity())) {
        tell!("rigident: {warning}");
    }
    let held = session.held_settings().map_err(|e| Failure::link(e).context(&port))?;
    let sends = wanted.is_some() && !arguments.dry_run;
    let changes = wanted.as_ref().map(|wanted| settings_file::changes(held.as_ref(), wanted));
    if sends && session.identity().state == StateName::Running {
        return Err(Failure::input(format!(
            "{port}: the device is running, and new settings would end that run: end it first, by Ctrl-C \
             where it was started. Nothing was sent"
        )));
    }
    if let Some(wanted) = wanted.as_ref().filter(|_| sends) {
        configured(&mut session, wanted).map_err(|e| e.context(&port))?;
    }
    let Some(settings) = wanted.or(held) else {
        return Err(Failure::input(format!(
            "{port}: the device has no settings (state {}): send some by --rig FILE or --from FILE",
            words::state(session.identity().state)
        )));
    };
    if let Some(path) = &arguments.write {
        write(path, &settings)?;
    }
    tell(arguments, &port, changes.as_deref(), &settings);
    Ok(ExitCode::SUCCESS)
}

/// Returns the settings that are to be sent, if any are.
fn wanted(arguments: &Configure, rig: Option<&RigFile>) -> Result<Option<Settings>, Failure> {
    if let Some(path) = &arguments.from {
        return settings_file::read(path).map(Some).map_err(Failure::input);
    }
    let Some(rig) = rig else { return Ok(None) };
    let timing = of_sensors(rig.recording.rate_hz.unwrap_or(1000.0));
    device_settings(rig, &timing, None).map(Some)
}

/// Refuses a file that could not be written, before anything is sent.
fn check_target(path: &Path) -> Result<(), Failure> {
    if !["toml", "json"].contains(&extension(path).as_str()) {
        return Err(Failure::input(format!(
            "--write {}: settings are a .toml or a .json file",
            path.display()
        )));
    }
    if path.symlink_metadata().is_ok() {
        return Err(Failure::input(format!(
            "--write {}: it is there already, and nothing is overwritten",
            path.display()
        )));
    }
    Ok(())
}

fn write(path: &Path, settings: &Settings) -> Result<(), Failure> {
    let text = match extension(path).as_str() {
        "json" => format!("{:#}\n", settings_file::to_json(settings)),
        _ => format!(
            "# Settings of a Rigident device; send them by `rigident configure --from`. Keys: \
             docs/formats.md\n{}",
            settings_file::to_toml(settings)
        ),
    };
    write_new_text(path, &text).map_err(Failure::input)
}

fn tell(arguments: &Configure, port: &str, changes: Option<&[Change]>, settings: &Settings) {
    let sent = changes.is_some() && !arguments.dry_run;
    if arguments.json {
        let mut object = json!({ "port": port, "sent": sent, "settings": settings_file::to_json(settings) });
        if let Some(changes) = changes {
            object["changes"] = serde_json::to_value(changes).unwrap_or_default();
        }
        return say(object);
    }
    let Some(changes) = changes else {
        return say(settings_file::to_toml(settings).trim_end());
    };
    for Change { key, from, to } in changes {
        say(format_args!("{key}: {} -> {}", value(from), value(to)));
    }
    let what = match changes.len() {
        0 => "no setting differs".to_owned(),
        1 => "1 setting differs".to_owned(),
        n => format!("{n} settings differ"),
    };
    say(format_args!("{what}; {}", if sent { "configured and read back" } else { "nothing was sent" }));
}

fn value(value: &Value) -> String {
    if value.is_null() { "none".to_owned() } else { value.to_string() }
}
