//! A person's segments from trials.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use rigident::application::body::HeldTool;
use rigident::application::{self, BodyOptions};
use rigident::model::human::Sex;
use rigident::people::body_segments::Parts;
use rigident::people::body_segments::choice::Way;
use rigident::people::inverse_kinematics::subject::HumanModel;
use rigident::people::person::anthropometry::GivenMass;

use crate::answers::{Answered, Kept, beside};
use crate::calls::watched;
use crate::errors::{Refused, named};
use crate::jobs::{caller, plain};

/// The way a person is identified, as the fields of the command line say it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct PersonWords {
    standing: Option<PathBuf>,
    ground: Vec<PathBuf>,
    markers: Option<PathBuf>,
    osim: Option<PathBuf>,
    model: String,
    mass_kg: Option<f64>,
    height_m: Option<f64>,
    table: String,
    segment_mass: Vec<(String, f64, f64)>,
    plate_scale_percent: f64,
    cut_off_hz: Option<f64>,
    delay_s: Option<f64>,
    plates_zeroed: bool,
    parts: Option<usize>,
    motions: Option<usize>,
    select: String,
    nominal_sigma: f64,
    symmetric_sides: bool,
    tool: Option<String>,
    tool_link: String,
    tare: Vec<PathBuf>,
    write_model: Option<PathBuf>,
}

impl PersonWords {
    fn typed(self) -> Result<BodyOptions, Refused> {
        let models = [("human34", HumanModel::Human34), ("human58", HumanModel::Human58)];
        let tables = [("female", Sex::Female), ("male", Sex::Male), ("unknown", Sex::Unknown)];
        let ways = [
            ("d-optimal", Way::DOptimal),
            ("e-optimal", Way::EOptimal),
            ("published", Way::Published),
            ("random", Way::Random),
        ];
        let model = *named("model", &self.model, &models)?;
        let table = *named("table", &self.table, &tables)?;
        let way = *named("select", &self.select, &ways)?;
        let parts = match self.parts {
            None => Parts::Strides,
            Some(count @ 1..=100) => Parts::Equal(count),
            Some(_) => return Err(Refused::usage("parts: must be 1 to 100, or 'strides'".to_owned())),
        };
        if self.tool.is_some() == self.tare.is_empty() {
            let why = "tool and tare: a tool needs trials without it, and these a tool";
            return Err(Refused::usage(why.to_owned()));
        }
        let (link, without) = (self.tool_link, self.tare);
        let masses = self.segment_mass.into_iter();
        let options = BodyOptions {
            standing: self.standing,
            ground: self.ground,
            markers: self.markers,
            osim: self.osim,
            model,
            mass_kg: self.mass_kg,
            height_m: self.height_m,
            table,
            given: masses.map(|(link, kg, sigma_kg)| GivenMass { link, kg, sigma_kg }).collect(),
            plate_scale: 1e-2 * self.plate_scale_percent,
            cut_off_hz: self.cut_off_hz,
            delay_s: self.delay_s,
            plates_zeroed: self.plates_zeroed,
            parts,
            motions: self.motions.map(|count| (count, way)),
            nominal_sigma: self.nominal_sigma,
            symmetric: self.symmetric_sides,
            tool: self.tool.map(|name| HeldTool { name, link, without }),
            write_model: self.write_model,
        };
        all_plain(options.write_model.iter().chain(&options.ground).chain(&options.standing))?;
        Ok(options)
    }
}

fn all_plain<'a>(paths: impl Iterator<Item = &'a PathBuf>) -> Result<(), Refused> {
    paths.map(|path: &PathBuf| -> &Path { path }).try_for_each(|path| plain(&path.to_string_lossy()))
}

/// A person: the answer, the factors of the motions by their files' names, and pages that play the trials.
#[derive(IntoPyObject)]
pub struct Found {
    answer: Answered,
    factors: Vec<Kept>,
    pages: Vec<(String, String)>,
}

/// Identifies a person's segments.
///
/// # Errors
/// Raises `RigidentError` if there is no answer.
#[pyfunction]
pub fn identify_person(py: Python<'_>, trials: Vec<PathBuf>, options: PersonWords) -> PyResult<Found> {
    let done = watched(py, move |stop| -> Result<Found, Refused> {
        all_plain(trials.iter())?;
        let options = options.typed()?;
        let found = application::body(&trials, &options, None, &caller(&stop))?;
        let mut messages = Vec::new();
        if let Some(path) = &options.write_model {
            match found.no_model() {
                None => found.write_model(path)?,
                Some(why) => messages.push(format!("write_model {}: not written: {why}", path.display())),
            }
        }
        let answer = beside(&found.answer, &found.page(), Some(found.covariance()))?;
        Ok(Found {
            answer: Answered { messages, ..answer },
            factors: found.factors().map(|(name, bytes)| (bytes, name)).collect(),
            pages: found.pages,
        })
    })?;
    done.map_err(|why| why.raised(py, &[]))
}
