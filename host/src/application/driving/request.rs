//! The request of a run: rig, machine and program, checked before anything moves.

use hexapod::{BodyParameters, BodySet, Geometry, MotionProgram};
use rigident_shared::wire::Settings;

use super::super::device::{check_asked, device_settings, of_sensors};
use super::super::planning::unchecked;
use super::super::{DeviceError, Error, Loaded, calibrate};
use super::checks::bound;
use super::consent::Consent;
use super::directing::Directing;
use super::{Attendant, DriveOptions, DrivingError};
use rigident_device::platform::check::{self, Summary};
use rigident_device::platform::{self, Platform};
use rigident_device::session::tree::{device_parameters, device_tree};
use rigident_fit::Parameter;
use rigident_fit::prior::KnownValues;
use rigident_io::rig::RigFile;
use rigident_model::Model;
use rigident_plan::ranges::{self, CellStopped, RangePeaks};
use rigident_plan::{carried, machine};
use rigident_rows::named_model::rig_links::from_tables;

/// Rate of readings where a rig file states none, 1/s.
const RATE_HZ: f64 = 1000.0;

/// The request and the machine.
pub struct Request {
    pub(super) options: DriveOptions,
    /// The rig file, with the calibration and the load that go before it.
    pub rig: RigFile,
    /// The tree of a rig file with several links, with its parameters.
    pub links: Option<(Model, Vec<Parameter>)>,
    /// The estimated parameters.
    pub parameters: Vec<Parameter>,
    /// Readings, 1/s.
    pub rate_hz: f64,
    /// The machine.
    pub geometry: Geometry,
    /// True if the rig file states which machine it is.
    described: bool,
    /// The body that a plan was made for.
    pub(super) carries: Option<BodyParameters>,
    /// The program; none if each segment is decided on the way.
    pub fixed: Option<MotionProgram>,
}

impl Request {
    /// Reads the rig file and makes the program.
    ///
    /// # Errors
    /// What the rig file lacks, and a machine whose limits nobody knows. Nothing was moved.
    pub fn new(options: DriveOptions, at: &dyn Attendant) -> Result<Self, Error> {
        let mut rig = RigFile::load(&options.rig)?;
        options.load.put_into(&mut rig)?;
        calibrate(&mut rig, options.calibration.as_deref())?;
        let links = links_of(&options, &rig)?;
        if links.is_some() && options.calibration.is_some() {
            return Err(Error::CalibrationOfTree);
        }
        let parameters = match &links {
            Some((_, parameters)) => parameters.clone(),
            None => {
                let one = Loaded::of_readings("run", &rig, Vec::new(), Some(1.0), false);
                one.source().parameters().to_vec()
            }
        };
        check_asked(&parameters, &options.known, &options.asked)?;
        let rate_hz = rig.recording.rate_hz.unwrap_or(RATE_HZ);
        let geometry = geometry(&options, &rig, at)?;
        let (mut fixed, mut carries) = (None, None);
        if !options.adaptive {
            let planned = options.programme.planned(&geometry, at)?;
            (fixed, carries) = (Some(planned.program), planned.carries);
        }
        options.end.check()?;
        if let Some(share) = options.slow.filter(|share| !(0.01..=1.0).contains(share)) {
            return Err(DrivingError::Slow(share).into());
        }
        let fixed = fixed.map(|program| options.slow.map_or(program.clone(), |share| program.slowed(share)));
        bound(&rig)?;
        let described = machine::is_described(&rig);
        Ok(Self { options, rig, links, parameters, rate_hz, geometry, described, carries, fixed })
    }

    /// Returns the prior knowledge.
    pub fn known(&self) -> &KnownValues {
        &self.options.known
    }

    /// Returns who decides on the way, if anybody does; `body` is what the load cell may carry, in S.
    ///
    /// # Errors
    /// [`DrivingError::NoChoice`]: the platform can do nothing.
    pub(super) fn directing<'a>(
        &self,
        settings: &Settings,
        body: Option<BodySet>,
        at: &'a dyn Attendant,
    ) -> Result<Option<Directing<'a>>, DrivingError> {
        let own = (&self.rig, &self.geometry);
        let new = || Directing::new(&self.options.end, own, settings, body, at);
        self.options.adaptive.then(new).transpose()
    }

    /// Checks everything that will be driven against all limits: the way to the start, the program, the way
    /// home.
    ///
    /// # Errors
    /// A limit that is violated. Nothing was moved.
    pub(super) fn checked(
        &self,
        platform: &mut dyn Platform,
        body: Option<&BodySet>,
        directing: Option<&Directing<'_>>,
    ) -> Result<Summary, DrivingError> {
        let load = body.map(|body| carried::load(&self.rig, body)).transpose()?;
        platform.carries(load.clone());
        let mut summary = Summary::default();
        if let Some(program) = self.fixed.clone().or_else(|| directing.map(Directing::everything)) {
            let way = platform.way(&program).map_err(DrivingError::Unmoved)?;
            let home = platform.way_home(&program).map_err(DrivingError::Unmoved)?;
            let [way_s, home_s] =
                [&way, &home].map(|way| way.as_ref().map_or(0.0, MotionProgram::duration_s));
            let driven = with_ways(way, program, home);
            let is_built_in = self.options.programme.plan.is_none() && !self.options.adaptive;
            summary = check::check(&driven, &self.geometry, load.as_ref())
                .map_err(|error| DrivingError::Beyond { error, is_built_in })?;
            (summary.way_s, summary.home_s) = (way_s, home_s);
            self.check_led(&summary)?;
        }
        if let Some(directing) = directing {
            summary.duration_s = directing.at_most_s() + summary.way_s;
        }
        (summary.from, summary.assumed) = (platform.expects(), !self.described);
        Ok(summary)
    }

    /// Checks the legs' forces while the plate is led to rest on its path, of a program that is fixed.
    ///
    /// # Errors
    /// Bad input: a leg that would be loaded too much. Nothing was moved.
    fn check_led(&self, summary: &Summary) -> Result<(), DrivingError> {
        let led = summary.stops.as_ref().map(|[led, _]| led).filter(|_| self.fixed.is_some());
        match led.and_then(|led| Some((led.stop_s, led.overloads?))) {
            Some((stop_s, (violation, time_s))) => {
                Err(DrivingError::Led { stop_s, time_s, what: violation.to_string() })
            }
            None => Ok(()),
        }
    }

    /// Returns what is consented to.
    pub(super) fn consent<'b>(&'b self, summary: &'b Summary, cell: Vec<(f64, CellStopped)>) -> Consent<'b> {
        let (address, slow) = (self.options.platform.as_str(), self.options.slow);
        let (found, rig) = (Vec::new(), &self.rig);
        Consent { summary, address, rig, slow, found, guards: None, cell, moved: None, attitude: None }
    }

    /// Returns the load cell in the stops that are shown, their durations, s, beside; nothing without a fixed
    /// program or a range.
    ///
    /// # Errors
    /// Bad input: led to rest on its path the middle of the bodies would overload it. Nothing was moved.
    pub(super) fn cell_stopped(
        &self,
        body: Option<&BodySet>,
    ) -> Result<Vec<(f64, CellStopped)>, DrivingError> {
        let (Some(program), Some(body)) = (&self.fixed, body) else { return Ok(Vec::new()) };
        let trajectory = program.trajectory()?;
        let mut all = Vec::new();
        for stop_s in check::STOPS_S {
            let cell = ranges::stopped(&trajectory, &self.rig, body, stop_s)?;
            all.extend(cell.map(|cell| (stop_s, cell)));
        }
        match all.first() {
            Some((stop_s, CellStopped { channel, unit, range, value, time_s, .. })) if value > range => {
                let what = format!(
                    "{channel} of the load cell would come to {value:.1} {unit}, its range is {range:.1} \
                     {unit}"
                );
                Err(DrivingError::Led { stop_s: *stop_s, time_s: *time_s, what })
            }
            _ => Ok(all),
        }
    }

    /// Returns the program's peaks against the ranges of the sensors; `None` without a program.
    ///
    /// # Errors
    /// Bad input: a range that is not enough. Nothing was moved.
    pub(super) fn within_ranges(&self, body: Option<&BodySet>) -> Result<Option<RangePeaks>, DrivingError> {
        let Some(program) = &self.fixed else { return Ok(None) };
        let trajectory = program.trajectory()?;
        Ok(Some(ranges::peaks(&trajectory, &self.rig, body)?))
    }

    /// Returns the longest time that the motion takes, s.
    pub(super) fn longest_s(&self, directing: Option<&Directing<'_>>) -> f64 {
        match (directing, &self.fixed) {
            (Some(directing), _) => directing.at_most_s(),
            (None, program) => program
                .as_ref()
                .map_or(0.0, MotionProgram::duration_s)
                .min(self.options.end.at_most_s.unwrap_or(f64::INFINITY)),
        }
    }
}

/// Returns the machine of a rig file.
///
/// # Errors
/// A machine that cannot be, or one whose limits nobody knows. Nothing was moved.
fn geometry(options: &DriveOptions, rig: &RigFile, at: &dyn Attendant) -> Result<Geometry, DrivingError> {
    let geometry = machine::geometry_or_thesis(rig)
        .map_err(|error| DrivingError::Machine { rig: options.rig.clone(), error })?;
    let described = machine::is_described(rig);
    if let Some(warning) = unchecked(&geometry).filter(|_| described && geometry.has_joints()) {
        at.hear(&format!("rigident: {warning}"));
    }
    if !described && !platform::checks_itself(&options.platform) {
        return Err(DrivingError::NotDescribed {
            rig: options.rig.clone(),
            address: options.platform.clone(),
        });
    }
    Ok(geometry)
}

/// Returns the tree of a rig file with several links, if the device takes it from sensors, with its
/// parameters; `None` if it is of one body.
fn links_of(options: &DriveOptions, rig: &RigFile) -> Result<Option<(Model, Vec<Parameter>)>, Error> {
    if rig.link.len() < 2 {
        return Ok(None);
    }
    if let Some(option) = options.of_one_body() {
        return Err(DrivingError::OneBody(option).into());
    }
    let model = from_tables(&rig.link, &options.rig.display().to_string())?;
    let timing = of_sensors(rig.recording.rate_hz.unwrap_or(RATE_HZ));
    // Whether it fits at all, whatever the noise is.
    let settings = device_settings(rig, &timing, Some([1.0; 6]))?;
    let (_, parameters) = device_tree(&model).map_err(DeviceError::from)?;
    let offset = settings.load_cell.known_offset_n_nm.is_none();
    let parameters = device_parameters(&model, &parameters, offset);
    Ok(Some((model, parameters)))
}

/// Puts the way to its start before a program, and the way home behind it.
fn with_ways(
    way: Option<MotionProgram>,
    program: MotionProgram,
    home: Option<MotionProgram>,
) -> MotionProgram {
    let start = way.as_ref().filter(|way| !way.segments.is_empty()).map_or(program.start, |way| way.start);
    let parts = way.into_iter().chain([program]).chain(home);
    MotionProgram { start, segments: parts.flat_map(|part| part.segments).collect() }
}
