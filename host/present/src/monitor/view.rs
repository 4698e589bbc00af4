//! The object that a monitor shows.

use serde::Serialize;

use rigident_fit::Fit;
use rigident_identify::answer::{Answer, Status};

/// Holds an interval at some time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Band {
    /// Time from the first reading, s.
    pub time_s: f64,
    /// The estimate, SI.
    pub value: f64,
    /// 95 % expanded uncertainty of the estimate, SI.
    pub u95: f64,
}

impl Band {
    /// Returns the interval's ends.
    pub fn ends(&self) -> [f64; 2] {
        [self.value - self.u95, self.value + self.u95]
    }
}

/// Holds a parameter with its intervals.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ParameterView {
    /// The name of the parameter: `m`, `arm.MSx`.
    pub name: String,
    /// The parameter's SI unit in ASCII.
    pub unit: String,
    /// The interval now; none: it is not identified, and there is no number.
    pub now: Option<Band>,
    /// The intervals until now, oldest first; empty where there is none now.
    pub history: Vec<Band>,
}

/// Holds an answer as a monitor shows it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Answered {
    /// The part that is identified.
    pub status: Status,
    /// Readings that it rests on.
    pub readings: u64,
    /// Every unknown.
    pub parameters: Vec<ParameterView>,
    /// 2-norm condition number of the column-scaled rows.
    pub condition_number: Option<f64>,
    /// The readings left out, by reason, and gaps between them.
    pub left_out: Vec<Counted>,
    /// The missing motion, the weakest direction first.
    pub advice: Vec<String>,
    /// The fault.
    pub warnings: Vec<String>,
}

impl Answered {
    /// Returns what is shown of an answer and the fit that it was concluded from.
    pub fn new(answer: &Answer, fit: &Fit) -> Self {
        let last_s = fit.convergence.last().map_or(0.0, |point| point.time_s);
        let first_s = fit.convergence.first().map_or(0.0, |point| point.time_s);
        let parameter = |(j, parameter): (usize, &rigident_identify::answer::result::Parameter)| {
            let now = parameter.state.measured();
            let now = now.map(|m| Band { time_s: last_s - first_s, value: m.value, u95: m.u95 });
            let until = fit.convergence.iter().filter_map(|point| {
                let measured = (*point.parameters.get(j)?)?;
                Some(Band { time_s: point.time_s - first_s, value: measured.value, u95: measured.u95 })
            });
            let mut history: Vec<Band> = if now.is_some() { until.collect() } else { Vec::new() };
            // The last one counts everything that the answer counts.
            if let (Some(last), Some(now)) = (history.last_mut(), now) {
                *last = now;
            }
            ParameterView { name: parameter.name.clone(), unit: parameter.unit.clone(), now, history }
        };
        Self {
            status: answer.status,
            readings: answer.counts.samples,
            parameters: answer.parameters.iter().enumerate().map(parameter).collect(),
            condition_number: answer.condition_number,
            left_out: left_out(fit),
            advice: answer.advice.clone(),
            warnings: answer.warnings.clone(),
        }
    }

    /// Returns when the last reading was taken that it rests on, from the first one, s; `None` where nothing
    /// is identified.
    pub fn time_s(&self) -> Option<f64> {
        self.parameters.iter().find_map(|parameter| Some(parameter.now?.time_s))
    }

    /// Returns the parameter that is known worst, with its uncertainty over the largest value of its unit:
    /// one of which there is no number if there is such a one, with infinity.
    pub fn worst(&self) -> Option<(&str, f64)> {
        let ratio = |parameter: &ParameterView| {
            let alike = self.parameters.iter().filter(|other| other.unit == parameter.unit);
            let scale = alike.filter_map(|other| other.now).map(|now| now.value.abs()).fold(0.0, f64::max);
            parameter.now.map_or(f64::INFINITY, |now| now.u95 / scale)
        };
        // An offset is as large as the body that it was zeroed with.
        let own = self.parameters.iter().filter(|parameter| !parameter.name.starts_with("offset"));
        let ratios = own.map(|parameter| (parameter.name.as_str(), ratio(parameter)));
        ratios.filter(|(_, ratio)| !ratio.is_nan()).max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Returns what a fit left out of its readings.
fn left_out(fit: &Fit) -> Vec<Counted> {
    let rejected = fit.counts.rejected_by_signal.iter();
    let rejected =
        rejected.map(|(signal, count)| Counted { what: format!("rejected by {signal}"), count: *count });
    let gaps = Counted { what: "gaps in time".to_owned(), count: fit.counts.gaps };
    rejected.chain([gaps]).filter(|counted| counted.count > 0).collect()
}

/// Counts something.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counted {
    /// The quantity.
    pub what: String,
    /// The number of times.
    pub count: u64,
}

/// Tells how the sensors are.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SensorHealth {
    /// Readings taken in.
    pub readings: u64,
    /// Readings a second by their own times.
    pub rate_hz: Option<f64>,
    /// The readings rejected, clipped or not readable, by reason; what never happened is left out.
    pub trouble: Vec<Counted>,
}

/// Tells how the link to a device is.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LinkHealth {
    /// Readings that never arrived.
    pub lost_readings: u64,
    /// Messages of the device that never arrived.
    pub lost_messages: u64,
    /// Frames that arrived damaged, here.
    pub damaged_frames: u64,
    /// Frames that arrived damaged, there.
    pub damaged_there: u64,
    /// Messages that the device dropped for want of room.
    pub dropped_there: u64,
    /// The time for which nothing has arrived, s.
    pub silent_s: f64,
}

/// Holds everything that a monitor shows.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct View {
    /// The subject that is watched: a port with its device, a file, the demonstration.
    pub watched: String,
    /// The activity, in words.
    pub phase: String,
    /// From the first reading to the last, s.
    pub elapsed_s: f64,
    /// The last answer; none before there are rows.
    pub answer: Option<Answered>,
    /// Why there is no answer, or no newer one.
    pub trouble: Option<String>,
    /// The state of the sensors.
    pub sensors: SensorHealth,
    /// The state of the link; none where there is no link.
    pub link: Option<LinkHealth>,
    /// The device's report about its own estimate, in words.
    pub device: Option<String>,
}
