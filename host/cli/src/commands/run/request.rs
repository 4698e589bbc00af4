//! The request of a run: rig, machine and program, checked before anything moves.

use hexapod::{BodyParameters, BodySet, Geometry, MotionProgram};

use crate::Failure;
use crate::commands::run::adaptive::Directing;
use crate::commands::run::arguments::Run;
use crate::commands::run::consent::Consent;
use crate::commands::run::refused::refuse_for_trees;
use crate::commands::run::{programme, unmoved, zeroing};
use crate::device::link::{device_settings, of_sensors};
use crate::options::calibration;
use rigident::application::device::check_asked;
use rigident::application::{Loaded, calibrate};
use rigident::device::platform::check::Summary;
use rigident::device::platform::{self, Platform, PlatformError, check};
use rigident::device::session::tree::{device_parameters, device_tree};
use rigident::plan::ranges::{self, CellStopped, RangePeaks};
use rigident::plan::{carried, machine};
use rigident::rows::named_model::rig_links::from_tables;
use rigident_fit::Parameter;
use rigident_fit::prior::KnownValues;
use rigident_io::rig::RigFile;
use rigident_model::Model;

/// The request and the machine.
pub(crate) struct Request<'a> {
    pub(crate) arguments: &'a Run,
    pub(crate) known: KnownValues,
    pub(crate) rig: RigFile,
    /// The tree of a rig file with several links, with its parameters.
    pub(crate) links: Option<(Model, Vec<Parameter>)>,
    pub(crate) parameters: Vec<Parameter>,
    pub(crate) rate_hz: f64,
    pub(crate) geometry: Geometry,
    /// True if the rig file states which machine it is.
    described: bool,
    /// The body that a plan was made for.
    pub(crate) carries: Option<BodyParameters>,
    /// The program; none if each segment is decided on the way.
    pub(crate) fixed: Option<MotionProgram>,
}

impl<'a> Request<'a> {
    /// Reads the rig file and makes the program.
    ///
    /// # Errors
    /// Bad input, and a machine whose limits nobody knows. Nothing was moved.
    pub(crate) fn new(arguments: &'a Run) -> Result<Self, Failure> {
        let known = arguments.known.parse()?;
        let mut rig = RigFile::load(&arguments.rig).map_err(Failure::input)?;
        arguments.load.put_into(&mut rig)?;
        let calibrated = arguments.calibration.calibration.as_deref();
        calibrate(&mut rig, calibrated)?;
        let links = links_of(arguments, &rig)?;
        if links.is_some() {
            calibration::refuse_for_trees(calibrated)?;
        }
        let parameters = match &links {
            Some((_, parameters)) => parameters.clone(),
            None => {
                let one = Loaded::of_readings("run", &rig, Vec::new(), Some(1.0), false);
                one.source().parameters().to_vec()
            }
        };
        check_asked(&parameters, &known, &arguments.output.estimate)?;
        let rate_hz = rig.recording.rate_hz.unwrap_or(1000.0);
        let geometry = geometry(arguments, &rig)?;
        let (mut fixed, mut carries) = (None, None);
        if !arguments.adaptive.adaptive {
            let planned = arguments.programme.planned(&geometry)?;
            (fixed, carries) = (Some(planned.program), planned.carries);
        }
        arguments.adaptive.check()?;
        check_slow(arguments.slow)?;
        let fixed =
            fixed.map(|program| arguments.slow.map_or(program.clone(), |share| program.slowed(share)));
        zeroing::bound(&rig)?;
        let described = machine::is_described(&rig);
        Ok(Self { arguments, known, rig, links, parameters, rate_hz, geometry, described, carries, fixed })
    }

    /// Checks everything that will be driven against all limits: the way to the start, the program, the way
    /// home.
    ///
    /// # Errors
    /// A limit that is violated. Nothing was moved.
    pub(crate) fn checked(
        &self,
        platform: &mut dyn Platform,
        body: Option<&BodySet>,
        directing: Option<&Directing>,
    ) -> Result<Summary, Failure> {
        let load = body.map(|body| carried::load(&self.rig, body)).transpose().map_err(Failure::input)?;
        platform.carries(load.clone());
        let mut summary = Summary::default();
        if let Some(program) = self.fixed.clone().or_else(|| directing.map(Directing::everything)) {
            let way = platform.way(&program).map_err(unmoved)?;
            let home = platform.way_home(&program).map_err(unmoved)?;
            let [way_s, home_s] =
                [&way, &home].map(|way| way.as_ref().map_or(0.0, MotionProgram::duration_s));
            let driven = with_ways(way, program, home);
            summary = check::check(&driven, &self.geometry, load.as_ref())
                .map_err(|error| beyond(error, self.arguments))?;
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
    fn check_led(&self, summary: &Summary) -> Result<(), Failure> {
        let led = summary.stops.as_ref().map(|[led, _]| led).filter(|_| self.fixed.is_some());
        match led.and_then(|led| Some((led.stop_s, led.overloads?))) {
            Some((stop_s, (violation, time_s))) => Err(Failure::input(format!(
                "led to rest in {stop_s} s from t = {time_s:.2} s, as every planned end may do, {violation}: \
                 use a smaller or slower motion (--slow).\nNothing was moved."
            ))),
            None => Ok(()),
        }
    }

    /// Returns what is consented to.
    pub(crate) fn consent<'b>(&'b self, summary: &'b Summary, cell: Vec<(f64, CellStopped)>) -> Consent<'b> {
        let (address, slow) = (self.arguments.platform.as_str(), self.arguments.slow);
        let (found, rig) = (Vec::new(), &self.rig);
        Consent { summary, address, rig, slow, found, guards: None, cell, moved: None, attitude: None }
    }

    /// Returns the load cell in the stops that are shown, their durations, s, beside; nothing without a fixed
    /// program or a range.
    ///
    /// # Errors
    /// Bad input: led to rest on its path the middle of the bodies would overload it. Nothing was moved.
    pub(crate) fn cell_stopped(&self, body: Option<&BodySet>) -> Result<Vec<(f64, CellStopped)>, Failure> {
        let (Some(program), Some(body)) = (&self.fixed, body) else { return Ok(Vec::new()) };
        let trajectory = program.trajectory().map_err(Failure::input)?;
        let mut all = Vec::new();
        for stop_s in check::STOPS_S {
            let cell = ranges::stopped(&trajectory, &self.rig, body, stop_s).map_err(Failure::input)?;
            all.extend(cell.map(|cell| (stop_s, cell)));
        }
        match all.first() {
            Some((stop_s, CellStopped { channel, unit, range, value, time_s, .. })) if value > range => {
                Err(Failure::input(format!(
                    "led to rest in {stop_s} s from t = {time_s:.2} s, as every planned end may do, \
                     {channel} of the load cell would come to {value:.1} {unit}, its range is {range:.1} \
                     {unit}: use a smaller or slower motion (--slow).\nNothing was moved."
                )))
            }
            _ => Ok(all),
        }
    }

    /// Returns the program's peaks against the ranges of the sensors; `None` without a program.
    ///
    /// # Errors
    /// Bad input: a range that is not enough. Nothing was moved.
    pub(crate) fn within_ranges(&self, body: Option<&BodySet>) -> Result<Option<RangePeaks>, Failure> {
        let Some(program) = &self.fixed else { return Ok(None) };
        let trajectory = program.trajectory().map_err(Failure::input)?;
        let peaks = ranges::peaks(&trajectory, &self.rig, body);
        peaks.map(Some).map_err(|e| Failure::input(format!("{e}.\nNothing was moved.")))
    }

    /// Returns the longest time that the motion takes, s.
    pub(crate) fn longest_s(&self, directing: Option<&Directing>) -> f64 {
        match (directing, &self.fixed) {
            (Some(directing), _) => directing.at_most_s(),
            (None, program) => program
                .as_ref()
                .map_or(0.0, MotionProgram::duration_s)
                .min(self.arguments.adaptive.at_most_s.unwrap_or(f64::INFINITY)),
        }
    }
}

/// Returns the machine of a rig file.
///
/// # Errors
/// Bad input: a machine that cannot be, or one whose limits nobody knows. Nothing was moved.
fn geometry(arguments: &Run, rig: &RigFile) -> Result<Geometry, Failure> {
    let geometry = machine::geometry_or_thesis(rig)
        .map_err(|e| Failure::input(format!("{}: {e}\nNothing was moved.", arguments.rig.display())))?;
    let described = machine::is_described(rig);
    if described && geometry.has_joints() {
        programme::tell_collisions(&geometry);
    }
    if !described && !platform::checks_itself(&arguments.platform) {
        return Err(Failure::input(format!(
            "{} does not say which machine is at {}: its [platform] must give base_joints_m, plate_joints_m \
             and leg_length_m, or travel_m and travel_rad where joints are not published, so that its limits \
             can be checked before anything moves.\nNothing was moved.",
            arguments.rig.display(),
            arguments.platform
        )));
    }
    Ok(geometry)
}

/// Returns the tree of a rig file with several links, if the device takes it from sensors, with its
/// parameters; `None` if it is of one body.
fn links_of(arguments: &Run, rig: &RigFile) -> Result<Option<(Model, Vec<Parameter>)>, Failure> {
    if rig.link.len() < 2 {
        return Ok(None);
    }
    refuse_for_trees(&[&arguments.forgetting, &arguments.adaptive])?;
    let model = from_tables(&rig.link, &arguments.rig.display().to_string()).map_err(Failure::input)?;
    let rate_hz = rig.recording.rate_hz.unwrap_or(1000.0);
    let timing = of_sensors(rate_hz);
    // Whether it fits at all, whatever the noise is.
    let settings = device_settings(rig, &timing, Some([1.0; 6]))?;
    let (_, parameters) = device_tree(&model).map_err(Failure::input)?;
    let offset = settings.load_cell.known_offset_n_nm.is_none();
    let parameters = device_parameters(&model, &parameters, offset);
    Ok(Some((model, parameters)))
}

/// Checks that a speed is a share of the full one.
///
/// # Errors
/// Bad input: no share of a speed.
fn check_slow(slow: Option<f64>) -> Result<(), Failure> {
    match slow.filter(|share| !(0.01..=1.0).contains(share)) {
        Some(share) => Err(Failure::input(format!(
            "--slow {share}: a share of the program's speed, from 0.01 to 1, as 0.1"
        ))),
        None => Ok(()),
    }
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

/// Returns the failure of a program that the machine cannot do; the built-in one can be replaced.
fn beyond(error: PlatformError, arguments: &Run) -> Failure {
    let built_in = arguments.programme.plan.is_none() && !arguments.adaptive.adaptive;
    let advice = if built_in {
        "\nIt is the built-in experiment: make one for this machine by `rigident plan motion --rig`, and \
         give it by --plan."
    } else {
        ""
    };
    Failure::input(format!("{error}{advice}\nNothing was moved."))
}
