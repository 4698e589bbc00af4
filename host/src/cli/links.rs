//! What commands with several links on the device share: an experiment that is over, judged.

use std::process::ExitCode;
use std::time::Instant;

use super::arguments::Output;
use super::experiment::noticed;
use super::followed::Followed;
use super::outcome::left_out;
use super::tree_outcome::{Fullness, TreeEnding};
use super::{Failure, Folder};
use crate::answer::result::ResultSource;
use crate::device::session::tree::complaints;
use crate::device::session::{DeviceFactor, Take};
use crate::model::Model;
use crate::model::base::BaseParameter;
use crate::recording::Recording;
use crate::trees::prepare::{Wishes, prepare};
use crate::trees::{self, DeviceRows, result};

/// An experiment with several links that is over.
pub(super) struct LinksExperiment<'a> {
    pub(super) started: Instant,
    pub(super) output: &'a Output,
    pub(super) model: &'a Model,
    /// What the device was given, or said that it read.
    pub(super) recording: &'a Recording,
    pub(super) mcu: &'a str,
    /// How the device makes rows.
    pub(super) rows: DeviceRows,
    /// What is really the case, parameter by parameter in the device's order.
    pub(super) truth: Option<&'a [f64]>,
    /// How the platform followed, if there was one that told.
    pub(super) followed: Option<&'a Followed>,
    pub(super) warnings: Vec<String>,
}

impl LinksExperiment<'_> {
    /// Judges the device's factor by its readings and concludes the command.
    pub(super) fn conclude(self, take: Take, folder: &Folder) -> Result<ExitCode, Failure> {
        let mut warnings = self.warnings;
        warnings.extend(noticed(&take, &self.recording.rig));
        if take.levels > 0 {
            tell!("a level of the factor was taken from the device {} times and merged here", take.levels);
        }
        let names: Vec<String> = self.model.welded().links.into_iter().map(|l| l.name).collect();
        let counters = &take.counters;
        warnings.extend(complaints(&counters.frames, &names));
        warnings.extend(left_out(&counters.rejected_by_channel, &counters.knocks, counters.blocks));
        let broken = take.broken;
        let kept = |error: String| {
            let place = folder.path().display();
            match &broken {
                Some(broken) => Failure::link(format!("{broken}\nWhat was recorded is in {place}: {error}")),
                None => Failure::input(format!("{error}\nWhat was recorded is in {place}")),
            }
        };
        let mut read = self.recording.clone();
        // The second link's accelerometer has served the joint's attitude; it is not among the rows.
        read.imus.iter_mut().skip(1).for_each(|imu| imu.accel = None);
        let ready = prepare(&read, self.model, &Wishes::default()).map_err(|e| kept(e.to_string()))?;
        let (found, mcu) = match take.factor {
            Some(DeviceFactor::Links(factor)) => {
                let found = trees::conclude_device(&ready.input, factor, self.rows);
                (found.map_err(|e| kept(e.to_string()))?, self.mcu)
            }
            // The device is out of reach; what it streamed is here.
            _ => {
                warnings.push(
                    "the device's factor could not be fetched: this one was made here, from the readings received"
                        .to_owned(),
                );
                (trees::identify(&ready.input).map_err(|e| kept(e.to_string()))?, "host")
            }
        };
        let source = ResultSource {
            recording: self.recording.name.clone(),
            rows: match self.rows {
                DeviceRows::Filtered => self.recording.rows(),
                DeviceRows::Frames => counters.frames.absorbed as usize,
            },
            rate_hz: Some(ready.input.rate_hz),
            mcu: mcu.to_owned(),
            memory: None,
        };
        let ending = TreeEnding {
            started: self.started,
            output: self.output,
            model: self.model,
            ready: &ready,
            found: &found,
            fullness: Fullness::USUAL,
            source,
            // Of what was made here the order is another.
            truth: self.truth.filter(|_| mcu != "host"),
            followed: self.followed,
            warnings,
            broken,
        };
        ending.conclude(|| Ok(folder.clone()))
    }
}

/// Whether what `--estimate` asks for is there, before anything is done; the names are the device's.
///
/// # Errors
/// Bad input: the word that is none of them.
pub(super) fn check_asked(
    parameters: &[BaseParameter],
    offset: bool,
    output: &Output,
) -> Result<(), Failure> {
    let offset = rigident_shared::inertia::PARAMETER_NAMES.iter().skip(10).filter(|_| offset);
    let names: Vec<String> =
        parameters.iter().map(|p| p.name.clone()).chain(offset.map(|n| (*n).to_owned())).collect();
    result::asked(&names, &output.estimate).map(drop).map_err(Failure::input)
}
