//! Everything but the motion.

use hexapod::Pose;
use rigident_shared::forgetting::Span;
use rigident_shared::wire::Settings;

use super::super::device::{configure, of_sensors};
use super::super::span::{self, RowsOf};
use super::super::{DeviceError, Error};
use super::checks::{check_attitude, check_carries, check_untouched, weigh};
use super::consent;
use super::guards::guard;
use super::rest::{look, zero_second};
use super::run::Agreed;
use super::{Attendant, Directing, DrivingError, Request, Rest, TraceFile, warm_up, zero};
use rigident_device::calibrated_board::another_board;
use rigident_device::platform::{self, Platform};
use rigident_device::session::{Axes, Session, settings};
use rigident_identify::answer::now;

/// Everything is done but the motion.
pub struct Prepared<'a> {
    /// The sensors at rest.
    pub rest: Rest,
    /// The device's settings.
    pub settings: Settings,
    /// The time for which rows are retained.
    pub span: Option<Span<f64>>,
    /// Warnings that the user should act on.
    pub warnings: Vec<String>,
    pub(super) directing: Option<Directing<'a>>,
    /// The motion as it was shown.
    pub(super) shown: String,
    /// The plate's pose then, as far as the platform knows.
    pub(super) stands: Option<Pose>,
    /// The pose that the platform expects the plate at before anything is sent.
    pub(super) from: Option<Pose>,
}

/// Weighs what the plate carries, warms the load cell up, zeroes the sensors, configures the device, checks
/// every limit, has the guards watch, and shows what would be driven.
///
/// # Errors
/// A limit that would be exceeded, a plate that is not where it should be, a device that cannot do it, a link
/// that broke. Nothing was moved.
pub fn prepare<'a>(
    request: &mut Request,
    platform: &mut dyn Platform,
    session: &mut Session,
    at: &'a dyn Attendant,
) -> Result<Prepared<'a>, Error> {
    let (span, stood) = first_look(request, platform, session, at)?;
    let mut warnings = Vec::from_iter(another_board(&request.rig, session.identity()));
    warm_up(session, &request.rig, request.options.warm_up_s, &mut warnings, at)?;
    let from = platform.expects();
    let timing = of_sensors(request.rate_hz);
    let rest = zero(session, &mut request.rig, &mut warnings, at)?;
    let stands = platform.stands().map_err(DrivingError::Unmoved)?;
    let attitude = check_attitude(&rest, &request.rig, stands.as_ref(), &mut warnings)?;
    if request.links.is_some() {
        zero_second(session, &mut request.rig, &timing, &rest, at)?;
    }
    let rig = &request.rig;
    let mut settings = rest.settings(rig, &timing, span)?;
    settings.stop = request.options.stop.rule(&request.parameters).map_err(DeviceError::from)?;
    configure(session, &settings)?;
    // It may have been changed since: what is driven is checked with what is carried now.
    let body = weigh(&rest, rig, at)?;
    let directing = request.directing(&settings, body.clone(), at)?;
    let summary = request.checked(platform, body.as_ref(), directing.as_ref())?;
    request.within_ranges(body.as_ref())?;
    let axes = if request.options.adaptive { Axes::LeftToPlanner } else { Axes::Each };
    guard(session, rig, axes)?;
    let mut consent = request.consent(&summary, request.cell_stopped(body.as_ref())?);
    (consent.guards, consent.attitude) = (Some(consent::guards(session)), Some(attitude));
    consent.moved = stood.zip(stands).filter(|(a, b)| !platform::near(a, b)).map(|(a, b)| [a, b]);
    warnings.iter().for_each(|warning| at.hear(&format!("rigident: {warning}")));
    at.see(&consent);
    let shown = consent.to_string();
    Ok(Prepared { rest, settings, span, warnings, directing, shown, stands, from })
}

/// Asks the device for what it can do, weighs what the plate carries, and shows what would be driven.
fn first_look(
    request: &Request,
    platform: &mut dyn Platform,
    session: &mut Session,
    at: &dyn Attendant,
) -> Result<(Option<Span<f64>>, Option<Pose>), Error> {
    let (options, rig) = (&request.options, &request.rig);
    // Any noise does while nothing is absorbed; of two links the sensors of the first are looked at.
    let mut standing =
        settings(rig, &of_sensors(request.rate_hz), Some([1.0; 6]), None).map_err(DeviceError::from)?;
    // What cannot be asked for is said before anything moves.
    standing.stop = options.stop.rule(&request.parameters).map_err(DeviceError::from)?;
    let span = span::checked(options.span, &RowsOf::moving(request.rate_hz))?;
    configure(session, &standing)?;
    // Nothing moves on a guess of what the plate carries: it is weighed.
    let body = weigh(&look(session, rig, at)?, rig, at)?;
    if let (Some(carries), Some(body)) = (&request.carries, &body) {
        check_carries(carries, rig, body, at)?;
    }
    // Until the noise is known, to see whether anything can be done at all.
    let directing = request.directing(&standing, body.clone(), at)?;
    let summary = request.checked(platform, body.as_ref(), directing.as_ref())?;
    if let (Some(program), Some(peaks)) = (&request.fixed, request.within_ranges(body.as_ref())?) {
        at.hear(peaks.to_string().trim_end());
        platform.load(program).map_err(DrivingError::Unmoved)?;
    }
    let mut consent = request.consent(&summary, request.cell_stopped(body.as_ref())?);
    consent.found = platform.found();
    at.see(&consent);
    at.can_agree()?;
    Ok((span, platform.stands().map_err(DrivingError::Unmoved)?))
}

impl<'a> Prepared<'a> {
    /// Asks for the agreement, and counts down; the trace has what was shown and who agreed.
    ///
    /// # Errors
    /// Nobody agreed, or the rig was touched meanwhile. Nothing was moved.
    pub fn agreed(
        self,
        request: &Request,
        platform: &mut dyn Platform,
        session: &mut Session,
        (at, trace): (&dyn Attendant, &TraceFile),
    ) -> Result<Agreed<'a>, Error> {
        trace.note("shown", &serde_json::json!(self.shown));
        trace.note("program", &serde_json::to_value(&request.fixed).unwrap_or_default());
        platform.trace(trace.of_the_line());
        let agreement = at.agree()?;
        if agreement.is_after_a_while {
            check_untouched(&self.rest, &look(session, &request.rig, at)?)?;
        }
        trace.note("consent", &serde_json::json!({ "by": agreement.by, "at": now() }));
        at.count_down()?;
        let now = platform.stands().map_err(DrivingError::Unmoved)?;
        match self.stands.zip(now).filter(|(shown, now)| !platform::near(shown, now)) {
            Some((shown, now)) => Err(DrivingError::MovedMeanwhile { shown, now }.into()),
            None => Ok(Agreed(self)),
        }
    }
}
