use std::io::Write as _;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use rigident_shared::screening::{ALL_CHANNELS, CHANNEL_NAMES};

use super::followed::Followed;
use super::{Failure, Folder};
use crate::answer::assemble::{Asked, Assembled, Context, assemble};
use crate::answer::result::{MemoryResult, ResultSource, TimeBase};
use crate::identification::knocks::LIMIT_SD;
use crate::identification::pooled::PooledFactor;
use crate::identification::{Identification, Input, Progression};
use crate::present::text::counted;
use crate::present::{
    self, Along, Convergence, Decided, Drift, ReportData, Residual, Source, Stage, TimePlot, table,
};
use crate::rig::RigFile;

/// Everything a command knows at its end.
pub struct Ending<'a> {
    /// When the command began.
    pub started: Instant,
    /// What was asked for.
    pub asked: &'a Asked,
    /// The rig.
    pub rig: &'a RigFile,
    /// The recording's name.
    pub recording: String,
    /// Who estimated.
    pub mcu: &'a str,
    /// The readings and settings.
    pub input: &'a Input,
    /// What they say, a fixture taken off.
    pub identification: &'a Identification,
    /// What they say with the fixture in it: what is kept.
    pub factor: PooledFactor,
    /// The readings are still poses with gravity from columns of its own; no IMU was used.
    pub gravity_columns: bool,
    /// The estimate as it came in.
    pub progression: Vec<Progression>,
    /// What it is a memory of, if not of everything.
    pub memory: Option<MemoryResult>,
    /// Parts of the experiment.
    pub stages: Vec<Stage>,
    /// First against last pose.
    pub drift: Option<Drift>,
    /// How several files became one recording.
    pub time_base: Option<TimeBase>,
    /// Device, serial numbers, dates.
    pub provenance: Vec<(String, String)>,
    /// Segments that were decided on.
    pub decisions: Vec<Decided>,
    /// What to know.
    pub warnings: Vec<String>,
    /// How the platform followed.
    pub followed: Option<Followed>,
    /// What broke, if anything.
    pub broken: Option<String>,
}

impl Ending<'_> {
    /// Writes the files, prints the answer, and gives the exit status.
    ///
    /// # Errors
    /// A file cannot be written; the answer is printed nevertheless.
    pub fn conclude(mut self, folder: &Folder, json: bool) -> Result<ExitCode, Failure> {
        let counters = &self.identification.counters;
        self.warnings.extend(left_out(&counters.rejected_by_channel, &counters.knocks, counters.blocks));
        let source = ResultSource {
            recording: self.recording.clone(),
            rows: self.input.readings.len(),
            rate_hz: (!self.input.is_static).then_some(self.input.rate_hz),
            mcu: self.mcu.to_owned(),
            memory: self.memory,
        };
        let Assembled { results, mut object, success } = assemble(
            self.identification,
            Context {
                rig: self.rig,
                asked: self.asked,
                source,
                time_base: self.time_base.take(),
                broken: self.broken.clone(),
                warnings: std::mem::take(&mut self.warnings),
            },
        );
        let factor = self.factor.to_file();
        let page = present::html(&self.report(&results));
        object.tracking = self.followed.as_ref().and_then(Followed::to_json);
        object.elapsed_s = self.started.elapsed().as_secs_f64();
        let text = serde_json::to_string_pretty(&object)
            .map_err(|e| Failure::input(format!("the result cannot be put into JSON: {e}")))?;
        // The answer first: a full disk must not keep it from the user.
        if json {
            say(text.as_str());
        } else {
            say(table::plain(&results).trim_end());
            if let Some(followed) = &self.followed {
                say(format_args!("\n{followed}"));
            }
        }
        let written = folder
            .write("result.json", text.as_bytes())
            .and_then(|_| folder.write(&format!("{}.factor", self.recording), &factor.to_bytes()))
            .and_then(|_| folder.write("report.html", page.as_bytes()));
        let report = match (written, &self.broken) {
            (Ok(report), _) => report,
            (Err(failure), None) => return Err(failure),
            (Err(failure), Some(broken)) => return Err(Failure::link(format!("{broken}\n{failure}"))),
        };
        if !json {
            say(format_args!(
                "\nFiles in {}; open {} in a browser.",
                folder.path().display(),
                report.display()
            ));
        }
        if let Some(broken) = self.broken {
            return Err(Failure::link(format!(
                "{broken}\nWhat came before is in {}",
                folder.path().display()
            )));
        }
        Ok(if success { ExitCode::SUCCESS } else { ExitCode::from(1) })
    }

    fn report(&self, results: &present::Results) -> ReportData {
        let input = self.input;
        let start_ns = input.readings.first().map_or(0, |r| r.time_ns);
        let origin_s = start_ns as f64 * 1e-9;
        let time_of = |row: usize, time_ns: u64| {
            if input.is_static { row as f64 + 1.0 } else { (time_ns - start_ns.min(time_ns)) as f64 * 1e-9 }
        };
        let times: Vec<f64> =
            input.readings.iter().enumerate().map(|(row, r)| time_of(row, r.time_ns)).collect();
        let names = rigident_shared::inertia::PARAMETER_NAMES;
        let shift = |t: f64, row: usize| if input.is_static { row as f64 + 1.0 } else { t - origin_s };
        // What is not identified in the end has no course either.
        let identified = |j: &usize| results.parameters.get(*j).is_some_and(|q| q.known().is_some());
        let convergence = (0..10)
            .filter(identified)
            .map(|j| (j, move |p: &Progression| p.parameters.get(j).copied().flatten()))
            .map(|(j, at)| Convergence {
                name: names[j].to_owned(),
                time_s: self.progression.iter().enumerate().map(|(i, p)| shift(p.time_s, i)).collect(),
                estimate: self.progression.iter().map(|p| at(p).map_or(f64::NAN, |m| m.value)).collect(),
                u95: self.progression.iter().map(|p| at(p).map_or(f64::INFINITY, |m| m.u95)).collect(),
            })
            .collect();
        let kernel_gain = self.identification.noise_gain / f64::from(self.row_every());
        let residuals = ["fx", "fy", "fz", "mx", "my", "mz"]
            .into_iter()
            .enumerate()
            .map(|(c, channel)| Residual {
                channel: channel.to_owned(),
                unit: if c < 3 { "N" } else { "N m" }.to_owned(),
                time_s: self
                    .identification
                    .residuals
                    .iter()
                    .enumerate()
                    .map(|(i, r)| shift(r.time_s, i))
                    .collect(),
                values: self.identification.residuals.iter().map(|r| r.residual[c]).collect(),
                sigma: self.identification.channel_sigma[c] * kernel_gain.sqrt(),
            })
            .collect();
        let plot =
            |title: &str,
             unit: &str,
             value: &dyn Fn(&rigident_shared::calibration::Reading<f64>) -> [f64; 3]| {
                let mut series: Vec<(String, Vec<f64>)> = ["x", "y", "z"]
                    .iter()
                    .map(|a| ((*a).to_owned(), Vec::with_capacity(times.len())))
                    .collect();
                for reading in &input.readings {
                    for ((_, values), v) in series.iter_mut().zip(value(reading)) {
                        values.push(v);
                    }
                }
                TimePlot { title: title.to_owned(), unit: unit.to_owned(), time_s: times.clone(), series }
            };
        let mut motion = vec![if self.gravity_columns {
            // As it stands in the columns: what a sensor at rest would feel is its reverse.
            plot("Gravity from its columns, axes of S", "m/s2", &|r| r.specific_force.array().map(|a| -a))
        } else {
            plot("Specific force, IMU axes", "m/s2", &|r| r.specific_force.array())
        }];
        if !input.is_static {
            motion.insert(0, plot("Angular rate, IMU axes", "rad/s", &|r| r.angular_rate.array()));
        }
        if let Some(followed) = &self.followed {
            motion.extend(followed.plots());
        }
        ReportData {
            source: Source {
                body_name: self.rig.body.as_ref().map_or_else(String::new, |b| b.name.clone()),
                recording: self.recording.clone(),
                mcu: self.mcu.to_owned(),
                rate_hz: (!input.is_static).then_some(input.rate_hz),
                rows: input.readings.len() as u64,
                duration_s: (!input.is_static).then(|| times.last().copied().unwrap_or(0.0)),
            },
            results: results.clone(),
            rejected: CHANNEL_NAMES
                .iter()
                .zip(self.identification.counters.rejected_by_channel)
                .filter(|(_, count)| *count > 0)
                .map(|(name, count)| ((*name).to_owned(), u64::from(count)))
                .collect(),
            provenance: self.provenance.clone(),
            along: if input.is_static { Along::Poses } else { Along::Time },
            stages: self.stages.clone(),
            convergence,
            residuals,
            residual_note: if input.is_static {
                "Measured wrench less what the answer predicts, pose by pose.".to_owned()
            } else {
                "Filtered wrench less what the answer predicts.".to_owned()
            },
            motion,
            drift: self.drift.clone(),
            decisions: self.decisions.clone(),
        }
    }

    fn row_every(&self) -> u16 {
        if self.input.is_static { 1 } else { crate::identification::row_every(self.input.rate_hz) }
    }
}

/// What is to be said of readings that were rejected, and of filtered rows that count less.
pub(super) fn left_out(
    rejected_by_channel: &[u16; ALL_CHANNELS],
    knocks: &[u16; 6],
    blocks: u32,
) -> Vec<String> {
    let named = |counts: &[u16]| -> Vec<(&str, u16)> {
        CHANNEL_NAMES.into_iter().zip(counts.iter().copied()).filter(|(_, count)| *count > 0).collect()
    };
    let rejected = named(rejected_by_channel).into_iter().map(|(channel, count)| {
        format!(
            "{} rejected because of {channel}: saturated, frozen or not finite; check that sensor and its range",
            counted(count.into(), "reading was", "readings were")
        )
    });
    let knocks = named(knocks).into_iter().map(|(channel, count)| {
        format!(
            "{count} of {blocks} filtered rows of channel {channel} {} more than {LIMIT_SD} standard deviations off, as after a \
             knock, and {} less",
            if count == 1 { "is" } else { "are" },
            if count == 1 { "counts" } else { "count" },
        )
    });
    rejected.chain(knocks).collect()
}

/// Whether anything has been printed on standard output.
static SAID: AtomicBool = AtomicBool::new(false);

/// What `--json` prints of a command that ends without an answer; an object that is out already stays the only one.
pub(super) fn say_failed(error: &str) {
    if !SAID.load(Ordering::Relaxed) {
        say(failed(error));
    }
}

/// Returns the object of a command that ends without an answer.
pub(super) fn failed(error: &str) -> serde_json::Value {
    serde_json::json!({ "status": "failed", "error": error.trim_end() })
}

/// Prints a line on standard output. A reader that has gone away is no failure: the files have it all.
pub(super) fn say(text: impl std::fmt::Display) {
    SAID.store(true, Ordering::Relaxed);
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

/// Serial numbers and calibration dates of the rig file.
pub fn provenance(rig: &RigFile) -> Vec<(String, String)> {
    let mut notes = Vec::new();
    let mut add = |what: &str, value: &Option<String>| {
        if let Some(value) = value {
            notes.push((what.to_owned(), value.clone()));
        }
    };
    add("Load cell, serial number", &rig.load_cell.serial);
    add("Load cell, calibrated on", &rig.load_cell.calibrated_on);
    if let Some(imu) = rig.imu.first() {
        add("IMU, serial number", &imu.serial);
        add("IMU, calibrated on", &imu.calibrated_on);
    }
    notes
}
