//! `rigident body`: a person's segments from markers and force plates.

pub(crate) mod arguments;
pub(crate) mod markers;

use std::process::ExitCode;
use std::time::Instant;

use crate::commands::body::arguments::{Body, BodyCommand, IdentifyBody};
use crate::options::microcontroller::Mcu;
use crate::screen::outcome::{say, say_not_written};
use crate::{ExitStatus, Failure, Folder, Stages};
use rigident::answer::Status;
use rigident::answer::person::DeviceResult;
use rigident::application::body::{Beside, HeldTool, compared};
use rigident::application::{self, BodyError, BodyOptions, Error, IdentifiedPerson};
use rigident::device::session::tree::{DeviceTreeError, device_tree};
use rigident::people::body_segments::Study;
use rigident::people::person::Person;
use rigident::present;
use rigident_fit::Fit;

/// Runs `rigident body`.
pub(crate) fn run(body: &Body) -> Result<ExitCode, Failure> {
    match &body.command {
        BodyCommand::Identify(arguments) => identify(arguments),
        BodyCommand::Markers(arguments) => crate::commands::body::markers::run(arguments),
    }
}

fn identify(arguments: &IdentifyBody) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    arguments.out.as_deref().map_or(Ok(()), Folder::check)?;
    let options = options(arguments);
    let stages = Stages::new("reading the trials");
    let firmware = arguments.mcu.map(|mcu| Firmware { mcu, stages: &stages });
    let beside = firmware.as_ref().map(|firmware| firmware as &dyn Beside);
    let mut found = application::body(&arguments.trials, &options, beside, &stages.caller())?;
    found.answer.elapsed_s = started.elapsed().as_secs_f64();
    drop(stages);
    finish(arguments, &found)
}

/// Returns the options as the application takes them.
fn options(arguments: &IdentifyBody) -> BodyOptions {
    let tool = arguments.tool.as_ref().map(|name| HeldTool {
        name: name.clone(),
        link: arguments.tool_link.clone(),
        without: arguments.tare.clone(),
    });
    BodyOptions {
        standing: arguments.standing.clone(),
        ground: arguments.ground.clone(),
        markers: arguments.markers.clone(),
        osim: arguments.osim.clone(),
        model: arguments.model.into(),
        mass_kg: arguments.mass_kg,
        height_m: arguments.height_m,
        table: arguments.table.into(),
        given: arguments.segment_mass.clone(),
        plate_scale: 1e-2 * arguments.plate_scale_percent,
        cut_off_hz: arguments.cut_off_hz,
        delay_s: arguments.delay_s,
        plates_zeroed: arguments.plates_zeroed,
        parts: arguments.parts,
        motions: arguments.motions.map(|count| (count, arguments.select.into())),
        nominal_sigma: arguments.nominal_sigma,
        symmetric: arguments.symmetric_sides,
        tool,
        write_model: arguments.write_model.clone(),
    }
}

/// The firmware's result of the motions.
struct Firmware<'a> {
    mcu: Mcu,
    stages: &'a Stages,
}

impl Beside for Firmware<'_> {
    fn check(&self, person: &Person) -> Result<(), Error> {
        // What does not fit onto the device is said before anything is computed.
        let failed = |why: DeviceTreeError| {
            beside(Failure::input(format!("--mcu: {why}; leave --mcu out, or take --model human34")))
        };
        device_tree(&person.subject.model).map(|_| ()).map_err(failed)
    }

    fn compute(
        &self,
        whose: (&Person, &Study),
        chosen: &[usize],
        fit: &Fit,
    ) -> Result<(DeviceResult, Vec<String>), Error> {
        compared(&self.mcu.into(), whose, chosen, fit, &self.stages.caller())
    }
}

fn beside(failure: Failure) -> Error {
    BodyError::Beside(Box::new(failure)).into()
}

fn finish(arguments: &IdentifyBody, found: &IdentifiedPerson) -> Result<ExitCode, Failure> {
    let folder = Folder::new(arguments.out.as_deref(), "body")?;
    let json = serde_json::to_string_pretty(&found.answer)
        .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
    if arguments.json {
        say(json.as_str());
    } else {
        say(present::person::whole_text(&found.answer).trim_end());
    }
    folder.write_text("result.json", &json)?;
    let page = folder.write_text("report.html", &found.page())?;
    for (name, factor) in found.factors() {
        folder.write(&name, &factor)?;
    }
    for (name, page) in &found.pages {
        folder.write_text(name, page)?;
    }
    let asked = arguments.write_model.as_deref();
    let why_not = found.no_model();
    if let (Some(path), Some(why)) = (asked, why_not) {
        say_not_written(path, &why.to_string());
    }
    let mut model = String::new();
    if let Some(path) = asked.filter(|_| why_not.is_none()) {
        found.write_model(path)?;
        model = format!("; the model is {}", path.display());
    }
    if !arguments.json {
        say(format_args!(
            "\nFiles in {}; open {}, and {} to see the motion{model}.",
            folder.path().display(),
            page.display(),
            found.pages.first().map_or("motion.html", |(name, _)| name)
        ));
    }
    Ok(ExitStatus::of(found.answer.status == Status::Identified).into())
}
