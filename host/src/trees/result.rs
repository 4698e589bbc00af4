//! The answer about a tree, for people and for programs.

use rigident_shared::inertia::{InertialParameters, tensor_elements};
use rigident_shared::spatial::Body;
use serde_json::{Value, json};

use super::nearest::{Full, FullLink};
use super::possible::Possible;
use super::{Input, TreeIdentification};
use crate::answer::result::{ParameterState, ResultSource, SCHEMA_1, Status};
use crate::identification::{filter_width_s, whiteness};
use crate::model::base::names::legend;
use crate::present::text::{NOT_IDENTIFIED, beside, shortened, significant, unit_symbol, with_u95};

/// All that is told.
pub struct Answer<'a> {
    /// What was identified from.
    pub input: &'a Input,
    /// What was found.
    pub found: &'a TreeIdentification,
    /// What became of each parameter.
    pub states: Vec<ParameterState>,
    /// Why what is not identified is not.
    pub reasons: Vec<String>,
    /// Whether bodies have the base parameters; `None`: that could not be told.
    pub possible: Option<Possible>,
    /// Full parameters, where there is a nominal model.
    pub full: Option<&'a Full>,
    /// 1 σ that it was trusted with.
    pub trust: f64,
    /// Its sides mirror each other.
    pub symmetric: bool,
    /// What is really the case, parameter by parameter as far as it is known; never used but to stand beside the answer.
    pub truth: Option<&'a [f64]>,
    /// How much is identified.
    pub status: Status,
    /// Where it comes from.
    pub source: ResultSource,
    /// What to know.
    pub warnings: Vec<String>,
}

/// Indices of what must be identified for success, from `--estimate`: parameters by name, links or drives (all of theirs),
/// `offset`. Without words all but the offset.
///
/// # Errors
/// The word that is none of them.
pub fn asked(names: &[String], words: &[String]) -> Result<Vec<usize>, String> {
    let is_offset = |name: &str| name.starts_with("offset_") && !name.contains('.');
    let select = |good: &dyn Fn(&str) -> bool| -> Vec<usize> {
        names.iter().enumerate().filter(|(_, n)| good(n)).map(|(j, _)| j).collect()
    };
    if words.is_empty() {
        return Ok(select(&|name| !is_offset(name)));
    }
    let mut all = Vec::new();
    for word in words.iter().map(|w| w.trim()) {
        let found = if word == "offset" {
            select(&is_offset)
        } else {
            select(&|name| name == word || name.rsplit_once('.').is_some_and(|(owner, _)| owner == word))
        };
        if found.is_empty() {
            return Err(format!(
                "--estimate {word}: no parameter, link or drive of that name; there are {}",
                names.join(", ")
            ));
        }
        all.extend(found);
    }
    all.sort_unstable();
    all.dedup();
    Ok(all)
}

/// A share of an interval that is worth a word.
const RATE_NOISE: f64 = 0.5;

/// What residuals say of the noise, and what noise of the rates does.
pub fn warnings(input: &Input, found: &TreeIdentification) -> Vec<String> {
    let mut said = Vec::new();
    let rows = found.factor.rows() as usize;
    if rows <= found.names.len() {
        said.push(format!(
            "too few rows: {rows} equations for {} unknowns; record for longer",
            found.names.len()
        ));
    } else if found.sigma_given && found.variance_scale > 1.0 {
        said.push(format!(
            "residuals are {:.1} times larger than the noise stated in the rig file: the intervals were widened; look for a \
             wrong sign, frame, delay or scale, links that are not rigid, friction that is left out",
            found.variance_ratio.sqrt()
        ));
    }
    said.extend(whiteness::warning(
        &found.colour,
        &input.channels(),
        found.widened(),
        filter_width_s(input.rate_hz),
    ));
    let moved = found
        .rate_bias
        .iter()
        .enumerate()
        .map(|(j, bias)| bias.abs() / found.estimate.covariance[(j, j)].sqrt());
    let worst = moved.filter(|share| share.is_finite()).fold(0.0, f64::max);
    if worst > RATE_NOISE {
        said.push(format!(
            "noise of the rates (1 σ {} rad/s) stands in the rows and does not average out: up to {:.0} % of an interval is for it. \
             Better gyros or encoders, or faster motion, make intervals narrower; a longer recording does not",
            significant(input.rate_sigma, 2),
            100.0 * worst
        ));
    }
    let poor: Vec<String> = input
        .channels()
        .iter()
        .zip(found.residual_rms.iter().zip(&found.measured_rms))
        .filter(|(_, (residual, measured))| **residual > 0.5 * **measured)
        .map(|(name, (residual, measured))| format!("{name} {:.0} %", 100.0 * residual / measured))
        .collect();
    if !poor.is_empty() {
        said.push(format!(
            "the model explains little of some channels (residual over measurement, rms): {}; are their signs, units and \
             joints those of the model?",
            poor.join(", ")
        ));
    }
    said
}

fn words_of(status: Status) -> &'static str {
    match status {
        Status::Identified => "identified",
        Status::PartlyIdentified => "partly identified",
        Status::NotIdentified => "not identified",
        Status::Failed => "failed",
    }
}

pub(super) const SENTENCE: &str = "full parameters of every link: nearest to the nominal model among those the data allow; only the base \
                        parameters above are identified, the rest is the nominal model's";

pub(super) fn body_of(link: &FullLink) -> (f64, [f64; 3], [f64; 6]) {
    let body = InertialParameters::<Body, f64>::from_vector(link.parameters);
    (body.mass, body.centre_of_mass().array(), tensor_elements(&body.inertia_com()))
}

impl Answer<'_> {
    /// The object of `result.json`.
    pub fn object(&self, elapsed_s: f64) -> Value {
        let found = self.found;
        let count = found.base.parameters.len();
        let parameters: Vec<Value> = (0..found.names.len())
            .map(|j| {
                let mut value = json!({"name": found.names[j], "unit": found.units[j]});
                let state = serde_json::to_value(self.states[j]).unwrap_or_default();
                if let (Some(out), Value::Object(state)) = (value.as_object_mut(), state) {
                    out.extend(state);
                    if let Some(truth) = self.truth_of(j) {
                        out.insert("truth".to_owned(), json!(truth));
                    }
                    if j < count {
                        let base = &found.base;
                        let terms: Vec<Value> = base.parameters[j]
                            .terms
                            .iter()
                            .map(|(c, w)| json!([base.standard[*c], w]))
                            .collect();
                        let link = found.names[j].rsplit_once('.').map_or("S", |(link, _)| link);
                        out.insert("frame".to_owned(), json!(link));
                        out.insert("terms".to_owned(), json!(terms));
                    }
                }
                value
            })
            .collect();
        let channels: Vec<Value> = self
            .input
            .channels()
            .iter()
            .enumerate()
            .map(|(c, name)| {
                json!({"name": name, "residual_rms": found.residual_rms[c], "measured_rms": found.measured_rms[c],
                       "sigma": found.channel_sigma[c]})
            })
            .collect();
        let names = self.input.channels();
        let coloured: Vec<Value> = found
            .colour
            .iter()
            .map(|c| json!({"channel": names.get(c.channel), "factor": c.factor}))
            .collect();
        let mut object = json!({
            "schema": SCHEMA_1,
            "status": self.status,
            "source": self.source,
            "model": self.input.model.name,
            "situation": self.input.situation.sentence(),
            "parameters": parameters,
            "channels": channels,
            "coloured_residuals": coloured,
            "rejected_rows": self.source.rows.saturating_sub(self.input.frames.len()),
            "not_identified_because": self.reasons,
            "warnings": self.warnings,
            "elapsed_s": elapsed_s,
        });
        if let Some(out) = object.as_object_mut() {
            if found.estimate.condition_number.is_finite() {
                out.insert("condition_number".to_owned(), json!(found.estimate.condition_number));
            }
            if let Some(possible) = &self.possible {
                out.insert("physically_consistent".to_owned(), json!(possible.is_consistent()));
                out.insert("distance_from_bodies_sd".to_owned(), json!(possible.distance_sd));
            }
            if let Some(full) = self.full {
                out.insert("nearest_to_nominal".to_owned(), self.full_object(full));
            }
        }
        object
    }

    fn truth_of(&self, j: usize) -> Option<f64> {
        self.truth?.get(j).copied()
    }

    /// How many of the identified parameters whose truth is known have it in their interval, and how many there are.
    fn inside(&self) -> Option<(usize, usize)> {
        self.truth?;
        let known =
            (0..self.states.len()).filter_map(|j| Some((self.states[j].measured()?, self.truth_of(j)?)));
        Some(known.fold((0, 0), |(inside, all), (m, truth)| {
            (inside + usize::from((m.value - truth).abs() <= m.u95), all + 1)
        }))
    }

    fn full_object(&self, full: &Full) -> Value {
        let links: Vec<Value> = full
            .links
            .iter()
            .map(|link| {
                let (mass, com, inertia) = body_of(link);
                json!({"name": link.name, "mass_kg": mass, "com_m": com, "inertia_com_kgm2": inertia,
                       "distance_from_nominal": link.distance})
            })
            .collect();
        json!({
            "note": SENTENCE,
            "nominal_sigma": self.trust,
            "symmetric_sides": self.symmetric,
            "distance_sd": full.distance_sd,
            "largest_parameter_sd": full.largest_sd,
            "converged": full.converged,
            "links": links,
        })
    }

    pub(super) fn headline(&self) -> String {
        let identified = self.states.iter().filter(|s| matches!(s, ParameterState::Identified(_))).count();
        format!("{}: {identified} of {} parameters identified", words_of(self.status), self.states.len())
    }

    /// What else base parameter `j` is made of.
    pub(super) fn made_of(&self, j: usize) -> String {
        let base = &self.found.base;
        base.parameters.get(j).map_or_else(String::new, |p| {
            let others: Vec<&str> = p.terms.iter().skip(1).map(|(c, _)| base.standard[*c].as_str()).collect();
            shortened(&others, 4)
        })
    }

    /// The same as text.
    pub fn text(&self) -> String {
        let found = self.found;
        let mut out = format!(
            "{}\n{}: {}; {} base parameters of {} standard ones\n",
            self.headline(),
            self.input.model.name,
            self.input.situation.sentence(),
            found.base.parameters.len(),
            found.base.standard_count(),
        );
        let width = found.names.iter().map(|n| n.chars().count()).max().unwrap_or(0);
        let values: Vec<String> = (0..found.names.len())
            .map(|j| match self.states[j].measured() {
                Some(m) => with_u95(m.value, m.u95, found.units[j]),
                None => NOT_IDENTIFIED.to_owned(),
            })
            .collect();
        // Wide enough for what stands beside them.
        let beside_them =
            self.truth.map_or(0, |_| values.iter().map(|v| v.chars().count()).max().unwrap_or(0));
        let mut owner = None;
        for (j, name) in found.names.iter().enumerate() {
            let own = name.rsplit_once('.').map_or("", |(own, _)| own);
            if owner != Some(own) {
                out.push('\n');
                owner = Some(own);
            }
            let truth = self.truth_of(j).map_or_else(String::new, |truth| match self.states[j].measured() {
                Some(m) => {
                    format!("  truth {}  {:+.2} sd", beside(truth, m.u95), 1.96 * (m.value - truth) / m.u95)
                }
                None => format!("  truth {}", significant(truth, 4)),
            });
            let value = &values[j];
            let made_of = match self.made_of(j) {
                others if others.is_empty() => String::new(),
                others => format!("   (with {others})"),
            };
            out += &format!("  {name:<width$}  {value:<beside_them$}{truth}{made_of}\n");
        }
        if let Some((inside, all)) = self.inside() {
            out += &format!("\n{inside} of {all} identified parameters have the truth in their interval\n");
        }
        if let Some(legend) = legend(found.names.iter().map(String::as_str)) {
            out += &format!("\n{legend}\n");
        }
        if let Some(full) = self.full {
            out += &format!("\n{SENTENCE}\n");
            let width = full.links.iter().map(|l| l.name.chars().count()).max().unwrap_or(0);
            for link in &full.links {
                let (mass, com, inertia) = body_of(link);
                let list = |v: &[f64]| v.iter().map(|x| significant(*x, 4)).collect::<Vec<_>>().join(" ");
                out += &format!(
                    "  {:<width$}  {} kg, centre of mass [{}] m, tensor about it [{}] {}\n",
                    link.name,
                    significant(mass, 4),
                    list(&com),
                    list(&inertia),
                    unit_symbol("kg m2")
                );
            }
            out += &format!(
                "  their base parameters are {:.2} standard deviations from those identified\n",
                full.distance_sd
            );
        }
        out.push('\n');
        if found.estimate.condition_number.is_finite() {
            out += &format!("condition number  {}\n", significant(found.estimate.condition_number, 3));
        }
        for (c, name) in self.input.channels().iter().enumerate() {
            out += &format!(
                "residual {name}: {} of {} rms\n",
                significant(found.residual_rms[c], 3),
                significant(found.measured_rms[c], 3)
            );
        }
        for warning in &self.warnings {
            out += &format!("warning: {warning}\n");
        }
        for reason in &self.reasons {
            out += &format!("to identify more: {reason}\n");
        }
        out
    }
}
