//! From a fit and its circumstances to the answer.

use rigident_shared::inertia::{InertialParameters, PARAMETER_NAMES, tensor_elements, tensor_from_elements};
use rigident_shared::spatial::{Body, Position, Rotation, Sensor};

use super::complete::complete;
use super::context::{Context, Links, StandardRequest};
use super::derived::{self, Derived, ten};
use super::judgement::Findings;
use super::nearest_body::{self, nearest_body};
use super::physical_consistency::{PhysicalConsistency, SURPRISING, of_base_parameters, probability};
use super::result::{
    Answer, BodyFrame, Channel, Consistency, Counts, ErrorsAgreement, ForgettingKind, Forgotten, KnownValue,
    ModelSummary, NearestBody, Parameter, ParameterState, PrincipalMoment, RigError, SCHEMA, SignalNoise,
    StandardLink, StandardParameters, Status, Truth,
};
use super::selection::{SelectionError, owner_name, select};
use super::standard_parameters::{BaseEstimate, Full, nearest};
use super::states::{is_reversed, is_whole_body, states};
use super::{
    budget, contradictions, drive_signs, excitation_advice, load, plausibility, reliance, remarks, rig_errors,
};
use rigident_fit::figures::shortened;
use rigident_fit::{Basis, ChannelFit, Fit, NuisanceFit};
use rigident_io::rig::{BodyTable, TruthTable};
use rigident_model::inertial::impossibility;
use rigident_model::{ModelError, ModelLink};

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum AnswerError {
    /// The name asked for is no parameter.
    #[error("{0}")]
    Selection(#[from] SelectionError),
    /// Standard parameters were asked for and cannot be found.
    #[error("{0}")]
    Standard(#[from] ModelError),
    /// Standard parameters were asked for, and the bodies would have negative mass.
    #[error("{0}")]
    Reversed(String),
}

/// The note about the standard parameters of links.
pub const STANDARD_NOTE: &str = "full parameters of every link: nearest to the nominal model among those the \
                        data allow; only the base parameters above are identified, the rest is the nominal \
                        model's";

/// A larger coverage factor is that of few residuals.
const OF_FEW: f64 = 2.0;

const REVERSED: &str = "the mass comes out negative: is wrench_sign right? It says in [recording] of the rig \
                        file whether the load cell reports the wrench \"on_body\" or \"on_sensor\"; reversed \
                        axes of the IMU, reversed gravity columns, attitudes to axes with z down, or a `tare` \
                        that is heavier than what it is taken off look the same";

/// A fit with what was concluded from it on the way to the answer.
struct Judged<'a> {
    fit: &'a Fit,
    states: Vec<ParameterState>,
    is_body: bool,
    reversed: bool,
}

impl Judged<'_> {
    fn at(&self, j: usize) -> ParameterState {
        self.states.get(j).copied().unwrap_or_default()
    }

    /// Returns true if all these parameters of one body have a number.
    fn has(&self, mut range: std::ops::Range<usize>) -> bool {
        self.is_body && range.all(|j| self.at(j).measured().is_some())
    }

    /// Returns true if one of them rests on what was known beforehand.
    fn rests_on_prior(&self, mut range: std::ops::Range<usize>) -> bool {
        range.any(|j| self.at(j).is_prior_dominated())
    }
}

impl Answer {
    /// Concludes the answer from a fit.
    ///
    /// # Errors
    /// [`AnswerError`] if what was asked for is no parameter, or standard parameters were asked for and there
    /// are none.
    pub fn new(fit: &Fit, context: Context) -> Result<Self, AnswerError> {
        let links = context.links.as_ref();
        let mut asked = select(&fit.parameters, context.asked)?;
        if let Some(links) = links.filter(|_| context.asked.is_empty()) {
            asked.retain(|j| !links.as_stated.contains(&fit.parameters[*j].name));
        }
        let is_body = is_whole_body(fit);
        let base = links.filter(|_| !is_body).map(|links| (links, BaseEstimate::of(fit, links.base)));
        let evenly = base.as_ref().map(|(links, base)| (links, base.evenly_widened(fit)));
        let of_base = evenly.and_then(|(links, base)| of_base_parameters(links.model, &base));
        let reversed =
            if is_body { is_reversed(fit.data_alone()) } else { of_base.is_some_and(|p| p.reversed) };
        let judged = Judged { fit, states: states(fit, links, reversed), is_body, reversed };
        let mut answer = Self {
            schema: SCHEMA.to_owned(),
            error: context.error.clone(),
            errors: errors(fit),
            errors_agreement: fit.agreement.map(agreement),
            signals: signals(fit),
            budget: budget::budget(fit, is_body, |j| judged.at(j).measured().is_some()),
            parameters: parameters(&judged, &context),
            known: known(fit),
            model: links.map(model_summary),
            channels: channels(fit),
            counts: counts(fit),
            rejected_rows: fit.counts.rejected,
            forgotten: forgotten(fit),
            condition_number: Some(fit.estimate.condition_number).filter(|c| c.is_finite()),
            coverage_factor: Some(fit.estimate.coverage_factor()).filter(|k| *k > OF_FEW),
            notes: context.notes.clone(),
            warnings: context.warnings.clone(),
            ..Self::default()
        };
        answer.improvement = budget::improvement(&answer.budget);
        if is_body && !fit.residuals.is_empty() && (0..10).any(|j| judged.at(j).measured().is_some()) {
            answer.rests_on = reliance::of_body(fit);
        }
        if !fit.residuals.is_empty() {
            answer.residual_rms =
                fit.channels.iter().map(|c| c.residual_rms).filter(|v| v.is_finite()).collect();
        }
        answer.add_body(&judged, context.body);
        let named = |text: String| text + &links.map_or_else(String::new, impossible_links);
        answer.truth = context.truth.filter(|_| is_body).map(|truth| true_body(truth, context.body));
        let impossible = answer.add_consistency(&judged, of_base).map(named);
        answer.add_standard_parameters(&judged, &base, &impossible)?;
        let impossible = impossible.filter(|_| !answer.has_near_bodies(base.as_ref().map(|(_, base)| base)));
        let scaled = links.filter(|_| !is_body).and_then(|links| plausibility::scaled(fit, links));
        let inconsistent = answer.consistency.as_ref().is_some_and(|c| c.probability < SURPRISING);
        let findings = Findings {
            reversed,
            no_bodies: inconsistent,
            scaled: scaled.is_some(),
            others: &context.findings,
            ..Findings::of(fit, links)
        };
        answer.judge(&findings, &asked);
        let beyond = links.map_or(&[][..], |links| &links.beyond);
        answer.warnings.extend(beyond.iter().map(|(text, _)| text.clone()));
        answer.warnings.extend(scaled);
        if of_base.is_none() && base.as_ref().is_some_and(|(_, base)| base.rank > 0) {
            answer.notes.push(
                "physical consistency is not judged: the search for the nearest bodies did not converge"
                    .to_owned(),
            );
        }
        answer.add_remarks(&judged, &context, impossible);
        let Context { source, time_base, tracking, experiment, drift, date, payload, .. } = context;
        answer.payload = payload.map(|payload| payload.with_load(&answer));
        Ok(Self { source, time_base, tracking, experiment, drift, date, ..answer })
    }

    /// Adds what follows from the ten parameters of one body, as far as they are identified.
    fn add_body(&mut self, judged: &Judged, frame: Option<&BodyTable>) {
        let estimate = &judged.fit.estimate;
        self.mass_kg = judged.has(0..1).then(|| estimate.unjudged().values[0]);
        self.inertia_origin_kgm2 =
            judged.has(4..10).then(|| std::array::from_fn(|i| estimate.unjudged().values[4 + i]));
        if !judged.has(0..4) {
            self.prior_dominated = self.resting_on_prior(judged);
            return;
        }
        let com = derived::centre_of_mass(estimate);
        (self.com_m, self.com_u95_m) = (Some(com.value), Some(com.u95()));
        let whole = judged.has(0..10);
        if whole {
            let inertia = derived::inertia_com(estimate);
            self.principal = principal(&inertia);
            (self.inertia_com_kgm2, self.inertia_com_u95_kgm2) = (Some(inertia.value), Some(inertia.u95()));
        }
        self.body_frame = frame.map(|table| {
            let there = derived::in_body_frame(estimate, &frame_of(table));
            let u95 = there.u95();
            let first = |v: &[f64; 9]| [v[0], v[1], v[2]];
            let rest = |v: &[f64; 9]| -> [f64; 6] { std::array::from_fn(|i| v[3 + i]) };
            BodyFrame {
                name: table.name.clone(),
                com_m: first(&there.value),
                com_u95_m: first(&u95),
                inertia_origin_kgm2: whole.then(|| rest(&there.value)),
                inertia_origin_u95_kgm2: whole.then(|| rest(&u95)),
            }
        });
        self.prior_dominated = self.resting_on_prior(judged);
    }

    /// Returns the names of the fields that rest on what was known beforehand.
    fn resting_on_prior(&self, judged: &Judged) -> Vec<String> {
        if !judged.is_body {
            return Vec::new();
        }
        let (com, tensor) = (judged.rests_on_prior(0..4), judged.rests_on_prior(0..10));
        let frame = self.body_frame.as_ref();
        let fields = [
            ("mass_kg", judged.rests_on_prior(0..1)),
            ("com_m", com && self.com_m.is_some()),
            ("inertia_com_kgm2", tensor && self.inertia_com_kgm2.is_some()),
            ("inertia_origin_kgm2", judged.rests_on_prior(4..10) && self.inertia_origin_kgm2.is_some()),
            ("principal", tensor && !self.principal.is_empty()),
            ("body_frame", frame.is_some_and(|b| com || (tensor && b.inertia_origin_kgm2.is_some()))),
        ];
        fields.into_iter().filter(|(_, prior)| *prior).map(|(name, _)| name.to_owned()).collect()
    }

    /// Adds the judgement of physical consistency and returns what a user should check.
    fn add_consistency(&mut self, judged: &Judged, of_base: Option<PhysicalConsistency>) -> Option<String> {
        if let Some(found) = of_base {
            self.physically_consistent = Some(found.is_consistent());
            let PhysicalConsistency { distance_sd, probability, reversed } = found;
            self.consistency = Some(Consistency { distance_sd, probability, reversed, nearest_body: None });
            return found.warning();
        }
        if judged.reversed {
            self.consistency = Some(Consistency { reversed: true, ..Consistency::default() });
        }
        if !judged.has(0..10) {
            return None;
        }
        let estimate = &judged.fit.estimate;
        let is_body =
            InertialParameters::<Sensor, f64>::from_vector(ten(estimate)).is_physically_consistent();
        self.physically_consistent = Some(is_body);
        let nearest = if is_body { None } else { nearest_body(estimate) };
        self.consistency = match &nearest {
            _ if is_body => Some(Consistency { probability: 1.0, ..Consistency::default() }),
            Some(found) => Some(Consistency {
                distance_sd: found.distance_sd,
                probability: found.probability,
                reversed: false,
                nearest_body: Some(NearestBody {
                    mass_kg: found.body.mass,
                    com_m: found.body.centre_of_mass().array(),
                    inertia_com_kgm2: tensor_elements(&found.body.inertia_com()),
                    inertia_origin_kgm2: tensor_elements(&found.body.inertia),
                }),
            }),
            None => None,
        };
        (!is_body).then(|| nearest_body::warning(nearest.as_ref()))
    }

    /// Takes the standard parameters that were found for the nearest bodies, where the search from made-up
    /// ones did not come as near; returns true if these are near enough.
    fn has_near_bodies(&mut self, base: Option<&BaseEstimate>) -> bool {
        let (Some(base), Some(found), Some(judged)) =
            (base, &self.standard_parameters, &mut self.consistency)
        else {
            return false;
        };
        let square = found.distance_sd.powi(2);
        let nearer = found.distance_sd < judged.distance_sd;
        let Some(probability) = probability(square, base.rank as f64, base.noise).filter(|_| nearer) else {
            return false;
        };
        (judged.distance_sd, judged.probability) = (found.distance_sd, probability);
        let is_consistent = probability >= SURPRISING;
        self.physically_consistent = Some(is_consistent);
        is_consistent
    }

    /// Adds standard parameters of all links, where there is a nominal model, or says why there are none.
    fn add_standard_parameters(
        &mut self,
        judged: &Judged,
        base: &Option<(&Links, BaseEstimate)>,
        impossible: &Option<String>,
    ) -> Result<(), AnswerError> {
        let Some((links, base)) = base else { return Ok(()) };
        if !judged.reversed {
            self.complete = complete(judged.fit, links, None, &judged.states);
        }
        let Some(request) = links.standard else { return Ok(()) };
        if judged.reversed {
            return match impossible {
                Some(why) if request.required => Err(AnswerError::Reversed(why.clone())),
                _ => Ok(()),
            };
        }
        let without = request.nominal.welded().links.iter().all(|link| link.nominal.is_none());
        if without && !request.required {
            return Ok(());
        }
        match nearest(request.nominal, base, request.trust, request.symmetric) {
            Ok(full) => {
                self.complete = complete(judged.fit, links, Some(&full.base), &judged.states);
                self.standard_parameters = Some(standard_parameters(&full, judged, request));
            }
            Err(error) if request.required => return Err(error.into()),
            Err(error) => self.notes.push(format!("no full parameters: {error}")),
        }
        Ok(())
    }

    /// Adds warnings, notes and advice.
    fn add_remarks(&mut self, judged: &Judged, context: &Context, impossible: Option<String>) {
        let fit = judged.fit;
        let links = context.links.as_ref();
        if let Some(links) = links.filter(|links| !links.as_stated.is_empty()) {
            self.notes.push(format!(
                "{} have columns as the model states them, beside what `friction` asks for (`friction` none: \
                 none of them)",
                shortened(links.as_stated, 6)
            ));
        }
        if judged.is_body {
            self.warnings.extend(impossible.clone());
        }
        let (mut notes, mut warnings) =
            remarks::of_the_fit(fit, links.is_some() || context.payload.is_some(), context.rate_sigma);
        self.notes.append(&mut notes);
        self.add_lack_of_fit(fit);
        self.warnings.extend(contradictions::contradictions(fit));
        self.warnings.extend(plausibility::of_the_fit(fit));
        self.warnings.extend(drive_signs::without_a_cause_in_words(fit));
        self.warnings.extend(drive_signs::doubtful_in_words(fit));
        self.warnings.append(&mut warnings);
        self.notes.extend(reliance::in_words(&self.rests_on));
        self.notes.extend(rig_errors::calibration(fit));
        self.notes.extend(rig_errors::defaults(fit));
        self.add_runs(fit);
        self.warnings.extend(remarks::of_known_values(fit, links, &judged.states));
        self.notes.extend(self.forgotten.iter().map(ToString::to_string));
        if judged.is_body {
            self.warnings.extend(judged.reversed.then(|| REVERSED.to_owned()));
        } else {
            self.warnings.extend(impossible);
        }
        self.warnings.extend(context.findings.iter().map(|finding| finding.text.clone()));
        let all = judged.states.iter().all(ParameterState::is_identified);
        self.advice = match links {
            // No motion helps.
            _ if all || self.status == Status::Implausible => Vec::new(),
            _ if context.payload.is_some() => load::advice(self),
            _ if judged.is_body => excitation_advice::of_body(fit, &judged.states),
            links => excitation_advice::of_links(fit, links, &judged.states),
        };
    }
}

fn parameters(judged: &Judged, context: &Context) -> Vec<Parameter> {
    let body_truth = context.truth.filter(|_| judged.is_body);
    let ten = body_truth.map(|truth| inertial(truth).to_vector());
    let offsets = body_truth.and_then(|truth| truth.apparent_offset_n_nm);
    let truth_of = |j: usize| match j {
        _ if context.parameter_truth.is_some() => context.parameter_truth?.get(j).copied(),
        0..10 => ten.map(|ten| ten[j]),
        _ => offsets?.get(j - 10).copied(),
    };
    judged
        .fit
        .parameters
        .iter()
        .enumerate()
        .map(|(j, p)| Parameter {
            name: p.name.clone(),
            owner: owner_name(&p.owner).to_owned(),
            unit: p.unit.clone(),
            state: judged.at(j),
            frame: p.frame.clone(),
            truth: truth_of(j).filter(|v| v.is_finite()),
            terms: p.made_of.clone(),
        })
        .collect()
}

fn known(fit: &Fit) -> Vec<KnownValue> {
    let statements = fit.prior.iter().flat_map(|prior| &prior.statements);
    let value = |s: &rigident_fit::PriorStatement| KnownValue {
        name: s.name.clone(),
        value: s.value,
        sigma: s.sigma,
        text: s.text.clone(),
    };
    statements.map(value).collect()
}

fn model_summary(links: &Links) -> ModelSummary {
    ModelSummary {
        name: links.model.name.clone(),
        situation: links.situation.sentence().to_owned(),
        base_parameters: links.base.parameters.len() as u64,
        standard_parameters: links.base.standard_count() as u64,
    }
}

fn channels(fit: &Fit) -> Vec<Channel> {
    let with_data = !fit.residuals.is_empty();
    let finite = |v: f64| Some(v).filter(|v| v.is_finite());
    let channel = |(k, c): (usize, &ChannelFit)| Channel {
        name: c.channel.name.clone(),
        unit: c.channel.unit.clone(),
        sigma: finite(c.sigma),
        sigma_given: c.channel.sigma.is_some() && fit.noise.sigma_given,
        residual_rms: finite(c.residual_rms).filter(|_| with_data),
        measured_rms: finite(c.measured_rms).filter(|_| with_data),
        gain: fit.gain(k).and_then(|gain| finite(gain.value)),
        outliers: c.outliers.into(),
        rejected: c.rejected.into(),
        autocorrelation: c.autocorrelation.and_then(|a| finite(a.factor)),
    };
    fit.channels.iter().enumerate().map(channel).collect()
}

fn errors(fit: &Fit) -> Vec<RigError> {
    let k = fit.estimate.coverage_factor();
    let of = |found: &NuisanceFit| {
        let (basis, stated) = match &found.nuisance.basis {
            Basis::Stated(key) => (key.clone(), true),
            Basis::Calibration(of) => (of.clone(), true),
            Basis::Class(class) => (class.clone(), false),
        };
        RigError {
            name: found.nuisance.name.clone(),
            group: found.nuisance.group.clone(),
            unit: found.nuisance.unit.clone(),
            expected: found.expected,
            value: found.value,
            u95: k * found.sd,
            sigma: found.nuisance.sigma,
            basis,
            stated,
            learned: found.learned_share(),
            pull: Some(found.pull()).filter(|pull| *pull != 0.0 && pull.is_finite()),
        }
    };
    fit.nuisances.iter().map(of).collect()
}

fn agreement(found: rigident_fit::Agreement) -> ErrorsAgreement {
    ErrorsAgreement {
        chi2: found.chi2,
        degrees_of_freedom: found.degrees_of_freedom,
        probability: found.probability(),
    }
}

fn signals(fit: &Fit) -> Vec<SignalNoise> {
    let of = |signal: &rigident_fit::SignalFit| SignalNoise {
        name: signal.noise.name.clone(),
        unit: signal.noise.unit.clone(),
        sigma: signal.sigma,
        stated: signal.noise.stated.is_some(),
    };
    fit.signals.iter().map(of).collect()
}

fn counts(fit: &Fit) -> Counts {
    Counts {
        samples: fit.counts.samples,
        rejected: fit.counts.rejected,
        gaps: fit.counts.gaps,
        rows: fit.factor.rows(),
    }
}

fn forgotten(fit: &Fit) -> Option<Forgotten> {
    fit.forgotten.map(|f| Forgotten {
        kind: if f.is_window { ForgettingKind::Window } else { ForgettingKind::Exponential },
        span_s: f.span_s,
        effective_s: f.effective_s,
    })
}

fn principal(inertia_com: &Derived<6>) -> Vec<PrincipalMoment> {
    let found = derived::principal(inertia_com);
    (0..3)
        .map(|i| {
            let is_known = found.axes_sd_rad[i].is_finite();
            PrincipalMoment {
                moment_kgm2: found.moments[i],
                u95_kgm2: found.moments_u95[i],
                axis: is_known.then_some(found.axes[i]),
                axis_u95_rad: is_known.then_some(found.axes_u95_rad[i]),
            }
        })
        .collect()
}

fn inertial(truth: &TruthTable) -> InertialParameters<Sensor, f64> {
    InertialParameters::from_centre_of_mass(
        truth.mass_kg,
        Position::from_array(truth.com_m),
        tensor_from_elements(truth.inertia_com_kgm2),
    )
}

fn frame_of(table: &BodyTable) -> derived::BodyFrame {
    let to_sensor = Rotation::<Sensor, Body, f64>::from_quaternion(table.rotation_wxyz)
        .unwrap_or_else(Rotation::identity);
    derived::BodyFrame { origin: Position::from_array(table.position_m), rotation: to_sensor.inverse() }
}

fn true_body(truth: &TruthTable, frame: Option<&BodyTable>) -> Truth {
    let mut moments: [f64; 3] = tensor_from_elements(truth.inertia_com_kgm2).symmetric_eigenvalues().into();
    moments.sort_by(|a, b| b.total_cmp(a));
    let there = frame.map(|table| {
        let frame = frame_of(table);
        inertial(truth).expressed_in(&frame.rotation, frame.origin)
    });
    Truth {
        mass_kg: truth.mass_kg,
        com_m: truth.com_m,
        inertia_com_kgm2: truth.inertia_com_kgm2,
        moments_kgm2: moments,
        body_frame_com_m: there.as_ref().map(|body| body.centre_of_mass().array()),
        body_frame_inertia_origin_kgm2: there.as_ref().map(|body| tensor_elements(&body.inertia)),
    }
}

/// Returns the end of a sentence on bodies that no mass has: the links of the model that are such, if any.
fn impossible_links(links: &Links) -> String {
    let of = |link: &ModelLink| link.nominal.is_some_and(|phi| impossibility(&phi).is_some());
    let names: Vec<&str> =
        links.model.links.iter().filter(|link| of(link)).map(|link| link.name.as_str()).collect();
    if names.is_empty() {
        return String::new();
    }
    format!(
        ". The model itself states inertias that no body has, of {}: a recording that was simulated with it \
         is refused for these; correct the model (`model_check()` says what is wrong with each)",
        shortened(&names, 6)
    )
}

fn standard_parameters(full: &Full, judged: &Judged, request: StandardRequest) -> StandardParameters {
    let alone = |name: String| {
        let mut all = judged.fit.parameters.iter().enumerate();
        all.any(|(j, p)| p.made_of == [(name.clone(), 1.0)] && judged.at(j).is_identified())
    };
    let links = full.links.iter().map(|link| {
        let body = InertialParameters::<Body, f64>::from_vector(link.parameters);
        StandardLink {
            name: link.name.clone(),
            mass_kg: body.mass,
            com_m: body.centre_of_mass().array(),
            inertia_com_kgm2: tensor_elements(&body.inertia_com()),
            parameters: link.parameters,
            distance_from_nominal: Some(link.distance).filter(|d| d.is_finite()),
            identified: PARAMETER_NAMES[..10]
                .iter()
                .filter(|own| alone(format!("{}.{own}", link.name)))
                .map(|own| (*own).to_owned())
                .collect(),
        }
    });
    StandardParameters {
        note: STANDARD_NOTE.to_owned(),
        nominal_sigma: request.trust,
        symmetric_sides: request.symmetric,
        distance_sd: full.distance_sd,
        largest_parameter_sd: full.largest_sd,
        converged: full.converged,
        links: links.collect(),
    }
}
