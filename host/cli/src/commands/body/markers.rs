//! `rigident body markers`: which markers of a trial are known, and where they are taken to be.

use std::path::Path;
use std::process::ExitCode;

use serde_json::json;

use crate::commands::body::arguments::BodyMarkers;
use crate::screen::outcome::say;
use crate::{ExitStatus, Failure};
use rigident::application;
use rigident::model::human::Person;
use rigident::people::inverse_kinematics::landmarks::{Place, places};
use rigident::people::inverse_kinematics::marker_sets::{Likeness, bare_segments, likeness};
use rigident_io::motion_capture::trial::Trial;
use rigident_io::recording::new_file::write_new_text;

/// Runs `rigident body markers`.
pub(crate) fn run(arguments: &BodyMarkers) -> Result<ExitCode, Failure> {
    let trial = Trial::read(&arguments.trial, arguments.ground.as_deref()).map_err(Failure::input)?;
    if let Some(path) = &arguments.page {
        write_page(&trial, path)?;
    }
    let places = places(&trial.labels);
    let set = likeness(&trial.labels);
    let bare = bare_segments(&trial.labels);
    let frames = trial.frames().max(1) as f64;
    let seen = |label: usize| {
        (0..trial.frames()).filter(|frame| trial.point(*frame, label).is_some()).count() as f64 / frames
    };
    let unknown: Vec<&String> = trial
        .labels
        .iter()
        .zip(&places)
        .filter(|(_, place)| place.is_none())
        .map(|(label, _)| label)
        .collect();
    if arguments.json {
        let markers = trial.labels.iter().zip(&places).enumerate().map(|(k, (label, place))| {
            json!({
                "name": label,
                "seen": seen(k),
                "segment": place.as_ref().map(|place| &place.segment),
                "joint": place.as_ref().map(|place| &place.joint),
                "at_m": place.as_ref().map(|place| place.at_m),
                "sigma_m": place.as_ref().map(|place| place.sigma_m),
            })
        });
        say(json!({
            "frames": trial.frames(),
            "rate_hz": trial.rate_hz,
            "plates": trial.ground.iter().map(|plate| &plate.name).collect::<Vec<_>>(),
            "notes": trial.notes,
            "segments": segments()?,
            "set": set.as_ref().map(|set| set.set),
            "missing": set.as_ref().map(|set| &set.missing),
            "alike": set.as_ref().map(|set| &set.alike),
            "markers": markers.collect::<Vec<_>>(),
            "unknown": unknown,
            "bare_segments": bare.iter().map(|(segment, ..)| segment).collect::<Vec<_>>(),
        }));
        return Ok(ExitStatus::of(bare.is_empty()).into());
    }
    for (k, (label, place)) in trial.labels.iter().zip(&places).enumerate() {
        let share = 100.0 * seen(k);
        let partly =
            if share < 99.5 { format!("; seen in {share:.0} % of the frames") } else { String::new() };
        match place {
            Some(place) => say(format_args!("{label}: {}{partly}", words(place))),
            None => say(format_args!("{label}: not known{partly}")),
        }
    }
    say_set(set.as_ref());
    for (segment, found, least) in &bare {
        say(format_args!("{segment}: {found} of the {least} markers that it takes"));
    }
    if let Some(first) = unknown.first() {
        say(format_args!(
            "{} of {} names are not known: name in a file which segment each is on, and give it by \
             --markers:\n  [marker.{:?}]\n  segment = \"l_thigh\"\n  position_m = [0.0, 0.06, -0.2]",
            unknown.len(),
            trial.labels.len(),
            first
        ));
    }
    Ok(ExitStatus::of(bare.is_empty()).into())
}

/// Says which set the markers are of.
fn say_set(set: Option<&Likeness>) {
    match set {
        Some(set) if set.missing.is_empty() => {
            say(format_args!("{}: all of its {} markers", set.set, set.of))
        }
        Some(set) => say(format_args!(
            "{}: {} of its {} markers; {} missing",
            set.set,
            set.found,
            set.of,
            set.missing.join(", ")
        )),
        None => say("no set of markers that is known by its names"),
    }
    if let Some(set) = set.filter(|set| !set.alike.is_empty()) {
        say(format_args!("{} fits as well", set.alike.join(", ")));
    }
}

/// Writes the page that plays a trial.
fn write_page(trial: &Trial, path: &Path) -> Result<(), Failure> {
    let page = application::body::measured(trial).map_err(Failure::input)?;
    write_new_text(path, &page).map_err(|e| Failure::input(format!("--page: {e}")))
}

/// Returns the names of the segments that a marker may be on.
fn segments() -> Result<Vec<String>, Failure> {
    let model = Person::default().human34().map_err(Failure::input)?;
    Ok(model.links.into_iter().map(|link| link.name).collect())
}

/// Says where a marker is taken to be.
fn words(place: &Place) -> String {
    if place.is_anywhere() {
        return format!("anywhere on {}", place.segment);
    }
    let [x, y, z] = place.at_m.map(|v| 1e3 * v);
    if place.at_m == [0.0; 3] {
        return format!("{}, the centre of {} (± {:.0} mm)", place.segment, place.joint, 1e3 * place.sigma_m);
    }
    format!(
        "{}, {x:.0} mm forward, {y:.0} mm left, {z:.0} mm up of {} (± {:.0} mm)",
        place.segment,
        place.joint,
        1e3 * place.sigma_m
    )
}
