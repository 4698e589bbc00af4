//! A platform that is driven through an experiment: what the plate carries is weighed, the sensors are
//! zeroed, every limit is checked, somebody agrees, and guards watch the motion.
//!
//! [`prepare`] does everything but the motion, [`Prepared::agreed`] asks, and only what
//! is [`Agreed`] is driven: none of it can be left out.
//!
//! ```no_run
//! use rigident::application::driving::{
//!     Attendant, DriveOptions, Request, TraceFile, prepare,
//! };
//! use rigident::device::{platform, ports, session::Observer};
//!
//! # fn drive(options: DriveOptions, at: &dyn Attendant, watching: &mut dyn Observer)
//! # -> Result<(), Box<dyn std::error::Error>> {
//! let mut platform = platform::connect(&options.platform, &hexapod::Geometry::thesis())?;
//! let mut session = ports::open("/dev/ttyACM0")?;
//! let mut request = Request::new(options, at)?;
//! let prepared = prepare(&mut request, platform.as_mut(), &mut session, at)?;
//! let trace = TraceFile::create("trace.jsonl".into())?;
//! let agreed = prepared.agreed(&request, platform.as_mut(), &mut session, (at, &trace))?;
//! let start = agreed.approached(&request, platform.as_mut(), &mut session, (at, &trace))?;
//! let mut driven = start.drive(&request, platform.as_mut(), &mut session, (at, watching))?;
//! let loaded = driven.loaded(&request)?;
//! # Ok(())
//! # }
//! ```

mod attendant;
mod checks;
mod consent;
mod directing;
mod guards;
mod prepare;
mod programme;
mod request;
mod rest;
mod run;
mod trace;

use std::path::PathBuf;

use rigident_shared::forgetting::Span;

pub use super::DrivingError;
pub use attendant::{Agreement, Attendant, Nobody};
pub use checks::{Attitude, weigh};
pub use consent::Consent;
pub use directing::{Decisions, Directing, End};
pub use guards::guard;
pub use prepare::{Prepared, prepare};
pub use programme::{Planned, Programme, check_duration, stages};
pub use request::Request;
pub use rest::{Rest, at_rest, warm_up, zero};
use rigident_device::stop_criterion::StopCriterion;
use rigident_fit::prior::KnownValues;
use rigident_io::rig::{PlatformTable, RigFile};
pub use run::{Agreed, AtStart, Driven};
pub use trace::TraceFile;

/// The mass and size that the body on the load cell may have, before those of the rig file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadBounds {
    /// The heaviest, kg.
    pub load_max_kg: Option<f64>,
    /// No part of it is farther from the load cell's origin, m.
    pub load_within_m: Option<f64>,
}

impl LoadBounds {
    /// Puts what is given in the place of what the rig file says.
    ///
    /// # Errors
    /// [`DrivingError::Number`]: no positive number.
    pub fn put_into(self, rig: &mut RigFile) -> Result<(), DrivingError> {
        for (option, value) in [("load_max_kg", self.load_max_kg), ("load_within_m", self.load_within_m)] {
            if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                return Err(DrivingError::Number { option, value });
            }
        }
        if self.load_max_kg.is_some() || self.load_within_m.is_some() {
            let platform = rig.platform.get_or_insert_with(PlatformTable::default);
            platform.load_max_kg = self.load_max_kg.or(platform.load_max_kg);
            platform.load_within_m = self.load_within_m.or(platform.load_within_m);
        }
        Ok(())
    }
}

/// The way a platform is driven.
#[derive(Clone, Debug)]
pub struct DriveOptions {
    /// The platform's address.
    pub platform: String,
    /// The rig file.
    pub rig: PathBuf,
    /// Calibration of the rig. Default: that of the rig file.
    pub calibration: Option<PathBuf>,
    /// Mass and size of the body, before those of the rig file.
    pub load: LoadBounds,
    /// The programme, where nobody decides on the way.
    pub programme: Programme,
    /// Segments are decided on the way; the programme is not driven then.
    pub adaptive: bool,
    /// When it ends.
    pub end: End,
    /// The share of the programme's speed that it is driven at.
    pub slow: Option<f64>,
    /// The longest wait for the load cell to settle, s; 0: none.
    pub warm_up_s: f64,
    /// The rule by which the device ends it.
    pub stop: StopCriterion,
    /// The time for which rows are retained; `None`: all of them.
    pub span: Option<Span<f64>>,
    /// The prior knowledge.
    pub known: KnownValues,
    /// The parameters that must be identified; empty: all.
    pub asked: Vec<String>,
}

impl DriveOptions {
    /// Returns the first option that is for a single body only, if one is given.
    fn of_one_body(&self) -> Option<&'static str> {
        let given = [
            ("forget", matches!(self.span, Some(Span::TimeConstant(_)))),
            ("window", matches!(self.span, Some(Span::Window(_)))),
            ("adaptive", self.adaptive),
            ("until_relative", self.end.until_relative.is_some()),
            ("at_most_s", self.end.at_most_s.is_some()),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(option, _)| option)
    }
}
