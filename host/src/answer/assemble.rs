//! One answer, for people ([`present::Results`]) and for programs ([`ResultObject`]).

use rigident_shared::inertia::{
    InertialParameters, PARAMETER_NAMES, PARAMETER_UNITS, tensor_elements, tensor_from_elements,
};
use rigident_shared::spatial::{Position, Rotation, Sensor};

use super::derived::{self, BodyFrame, Derived};
use super::identifiability::{is_reversed, states, too_loose};
use super::nearest_body::{self, nearest_body};
use super::weakest;
use crate::answer::result::{
    BodyFrameResult, ColourResult, ConsistentResult, KnownResult, Measured, ParameterState, PrincipalResult,
    ResultObject, ResultSource, SCHEMA_1, Status, TimeBase,
};
use crate::answer::schema_1::Parameter;
use crate::identification::{FILTER_WIDTH_S, Identification, whiteness};
use crate::present::{self, FrameResults, PrincipalAxis, Quantity, Results};
use crate::rig::{BodyTable, RigFile, TruthTable};

const AXES: [&str; 3] = ["x", "y", "z"];
const TENSOR: [&str; 6] = ["Ixx", "Iyy", "Izz", "Iyz", "Izx", "Ixy"];

const REVERSED: &str = "the mass comes out negative: is wrench_sign right? It says in [recording] of the rig file whether the \
                        load cell reports the wrench \"on_body\" or \"on_sensor\"; reversed axes of the IMU, reversed gravity \
                        columns, or a --tare that is heavier than what it is taken off look the same";
/// Rows beyond the unknowns from which on residuals that are half as large as stated are no chance: 0.5 % of them.
const ENOUGH_SPARE_ROWS: usize = 12;

/// Which parameters must be identified for success.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asked(pub(crate) Vec<usize>);

impl Asked {
    /// From `--estimate`: `m`, `mc`, `I`, `offset`, or single names. Empty: the body's ten.
    ///
    /// # Errors
    /// The word that is no parameter.
    pub fn parse(words: &[String]) -> Result<Self, String> {
        let mut asked = Vec::new();
        for word in words.iter().map(|w| w.trim()) {
            match word {
                "m" => asked.push(0),
                "mc" => asked.extend(1..4),
                "I" => asked.extend(4..10),
                "offset" => asked.extend(10..16),
                name => match PARAMETER_NAMES.iter().position(|p| *p == name) {
                    Some(j) => asked.push(j),
                    None => {
                        return Err(format!(
                            "--estimate {name}: no such parameter; there are m, mc, I, offset, and single ones: {}",
                            PARAMETER_NAMES.join(", ")
                        ));
                    }
                },
            }
        }
        if asked.is_empty() {
            asked.extend(0..10);
        }
        Ok(Self(asked))
    }

    /// Whether an offset is among them.
    pub fn offset(&self) -> bool {
        self.0.iter().any(|j| *j >= 10)
    }
}

/// What the answer is about.
pub struct Context<'a> {
    /// The rig: customer's frame, truth.
    pub rig: &'a RigFile,
    /// What must be identified.
    pub asked: &'a Asked,
    /// Where the numbers come from.
    pub source: ResultSource,
    /// How several files became one recording.
    pub time_base: Option<TimeBase>,
    /// What broke the experiment off, if anything did.
    pub broken: Option<String>,
    /// What to know, beyond what the data say themselves.
    pub warnings: Vec<String>,
}

/// Both forms of the answer.
pub struct Assembled {
    /// For people.
    pub results: Results,
    /// For programs; `elapsed_s` is left zero.
    pub object: ResultObject,
    /// Everything asked for is identified.
    pub success: bool,
}

fn quantity(name: &str, unit: &str, state: ParameterState, truth: Option<f64>) -> Quantity {
    Quantity { name: name.to_owned(), unit: unit.to_owned(), state, truth }
}

/// The state of a quantity that is derived from others.
fn state(value: f64, u95: f64, prior: bool) -> ParameterState {
    let measured = Measured { value, u95 };
    if prior { ParameterState::PriorDominated(measured) } else { ParameterState::Identified(measured) }
}

fn quantities<const K: usize>(
    names: &[&str],
    unit: &str,
    prior: bool,
    derived: Option<(&[f64; K], &[f64; K])>,
    truth: Option<&[f64; K]>,
) -> Vec<Quantity> {
    (0..K)
        .map(|k| {
            let state = derived.map_or(ParameterState::NotIdentified, |(v, u)| state(v[k], u[k], prior));
            quantity(names.get(k).unwrap_or(&""), unit, state, truth.map(|t| t[k]))
        })
        .collect()
}

fn true_body(truth: &TruthTable) -> InertialParameters<Sensor, f64> {
    InertialParameters::from_centre_of_mass(
        truth.mass_kg,
        Position::from_array(truth.com_m),
        tensor_from_elements(truth.inertia_com_kgm2),
    )
}

fn body_frame(table: &BodyTable) -> BodyFrame {
    let to_sensor =
        Rotation::<Sensor, rigident_shared::spatial::Body, f64>::from_quaternion(table.rotation_wxyz)
            .unwrap_or_else(Rotation::identity);
    BodyFrame { origin: Position::from_array(table.position_m), rotation: to_sensor.inverse() }
}

/// Puts the answer together.
pub fn assemble(identification: &Identification, context: Context) -> Assembled {
    let Context { rig, asked, source, time_base, broken, mut warnings } = context;
    let estimate = &identification.estimate;
    let k = estimate.coverage_factor;
    let states = states(estimate, identification.regressor_noise);
    let at = |j: usize| states.get(j).copied().unwrap_or(ParameterState::NotIdentified);
    let known: Vec<bool> = states.iter().map(|s| matches!(s, ParameterState::Identified { .. })).collect();
    let truth = rig.truth.as_ref();
    let true_phi = truth.map(|t| true_body(t).to_vector());
    let parameters: Vec<Parameter> = (0..estimate.values.len())
        .map(|j| Parameter {
            name: PARAMETER_NAMES[j].to_owned(),
            unit: PARAMETER_UNITS[j].to_owned(),
            state: at(j),
            frame: "S",
        })
        .collect();

    let all = |mut range: std::ops::Range<usize>| range.all(|j| at(j).measured().is_some());
    let prior = |mut range: std::ops::Range<usize>| {
        range.any(|j| matches!(at(j), ParameterState::PriorDominated { .. }))
    };
    let (com_prior, tensor_prior) = (prior(0..4), prior(0..10));
    let u95 = |sd: f64| k * sd;
    let com = (all(0..4)).then(|| derived::centre_of_mass(estimate));
    let inertia = (all(0..10)).then(|| derived::inertia_com(estimate));
    let principal = inertia.as_ref().map(derived::principal);
    let scaled = |d: &Derived<3>| d.sd.map(u95);
    let consistent = all(0..10)
        .then(|| InertialParameters::<Sensor, f64>::from_vector(estimate.body()).is_physically_consistent());
    let nearest = (consistent == Some(false)).then(|| nearest_body(estimate)).flatten();
    if consistent == Some(false) {
        warnings.push(nearest_body::warning(nearest.as_ref()));
    }
    let nearest = nearest.map(|n| ConsistentResult {
        mass_kg: n.body.mass,
        com_m: n.body.centre_of_mass().vector().into(),
        inertia_com_kgm2: tensor_elements(&n.body.inertia_com()),
        inertia_origin_kgm2: tensor_elements(&n.body.inertia),
        distance_sd: n.distance_sd,
    });
    let ratio = identification.variance_ratio;
    let small = identification.sigma_given && ratio < 0.25;
    let rows = identification.factor.rows() as usize;
    let fitted = estimate.determined.iter().filter(|d| **d).count();
    if rows <= fitted || (small && rows < fitted + ENOUGH_SPARE_ROWS) {
        warnings.push(format!(
            "too few rows: {rows} equations for {} unknowns, which leaves nothing to check the noise by; record for longer, \
             or more poses",
            estimate.values.len()
        ));
    } else if identification.sigma_given && ratio > 2.0 {
        warnings.push(format!(
            "residuals are {:.1} times larger than the noise stated in the rig file: the intervals were widened; look for \
             a wrong sign, frame, delay or scale, or a body that is not rigid",
            ratio.sqrt()
        ));
    } else if small {
        warnings.push(format!(
            "residuals are {:.1} times smaller than the noise stated in the rig file: the intervals are wider than need be",
            1.0 / ratio.max(1e-12).sqrt()
        ));
    }

    warnings.extend(estimate.known().iter().filter_map(|known| known.warning(estimate)));
    warnings.extend(too_loose(estimate, identification.regressor_noise));
    warnings.extend(whiteness::warning(
        &identification.colour,
        &whiteness::WRENCH,
        identification.widened(),
        FILTER_WIDTH_S,
    ));

    let frame = rig.body.as_ref().filter(|_| com.is_some());
    let in_body = frame.map(|table| (table, derived::in_body_frame(estimate, &body_frame(table))));
    let body_frame_result = in_body.as_ref().map(|(table, d)| {
        let part = |values: &[f64; 9], from: usize| -> [f64; 6] { std::array::from_fn(|i| values[from + i]) };
        let first = |values: &[f64; 9]| [values[0], values[1], values[2]];
        BodyFrameResult {
            name: table.name.clone(),
            com_m: first(&d.value),
            com_u95_m: first(&d.sd.map(u95)),
            inertia_origin_kgm2: inertia.as_ref().map(|_| part(&d.value, 3)),
            inertia_origin_u95_kgm2: inertia.as_ref().map(|_| part(&d.sd.map(u95), 3)),
        }
    });

    let missing = asked.0.iter().filter(|j| known.get(**j) != Some(&true)).count();
    let status = match missing {
        _ if broken.is_some() => Status::Failed,
        0 => Status::Identified,
        m if m == asked.0.len() => Status::NotIdentified,
        _ => Status::PartlyIdentified,
    };
    let reversed = is_reversed(estimate);
    if reversed {
        warnings.push(REVERSED.to_owned());
    }
    let hints = if reversed || known.iter().all(|i| *i) {
        Vec::new()
    } else {
        weakest::advice(estimate, identification.regressor_noise)
    };

    let results = Results {
        status: match status {
            Status::Identified => present::Status::Identified,
            Status::PartlyIdentified => present::Status::PartlyIdentified,
            Status::NotIdentified => present::Status::NotIdentified,
            Status::Failed => present::Status::Failed,
        },
        parameters: (0..10)
            .map(|j| quantity(PARAMETER_NAMES[j], PARAMETER_UNITS[j], at(j), true_phi.map(|t| t[j])))
            .collect(),
        centre_of_mass: quantities(
            &AXES,
            "m",
            com_prior,
            com.as_ref().map(|d| (d.value, scaled(d))).as_ref().map(|(v, u)| (v, u)),
            truth.map(|t| &t.com_m),
        ),
        inertia_com: quantities(
            &TENSOR,
            "kg m2",
            tensor_prior,
            inertia.as_ref().map(|d| (d.value, d.sd.map(u95))).as_ref().map(|(v, u)| (v, u)),
            truth.map(|t| &t.inertia_com_kgm2),
        ),
        principal: principal.as_ref().map_or_else(Vec::new, |p| {
            let true_moments = truth.map(|t| {
                let mut m: [f64; 3] = tensor_from_elements(t.inertia_com_kgm2).symmetric_eigenvalues().into();
                m.sort_by(|a, b| b.total_cmp(a));
                m
            });
            (0..3)
                .map(|i| PrincipalAxis {
                    moment: quantity(
                        ["I1", "I2", "I3"][i],
                        "kg m2",
                        state(p.moments[i], u95(p.moments_sd[i]), tensor_prior),
                        true_moments.map(|t| t[i]),
                    ),
                    axis: p.axes[i],
                    direction_u95_rad: u95(p.axes_sd_rad[i]),
                })
                .collect()
        }),
        body_frame: in_body.as_ref().map(|(table, d)| {
            let true_values = truth.map(|t| {
                let there = true_body(t).expressed_in(&body_frame(table).rotation, body_frame(table).origin);
                let [x, y, z] = there.centre_of_mass().array();
                let [xx, yy, zz, yz, zx, xy] = tensor_elements(&there.inertia);
                [x, y, z, xx, yy, zz, yz, zx, xy]
            });
            let names = ["x", "y", "z", "Ixx", "Iyy", "Izz", "Iyz", "Izx", "Ixy"];
            let count = if inertia.is_some() { 9 } else { 3 };
            FrameResults {
                name: table.name.clone(),
                quantities: (0..count)
                    .map(|i| {
                        let unit = if i < 3 { "m" } else { "kg m2" };
                        let prior = if i < 3 { com_prior } else { tensor_prior };
                        quantity(
                            names[i],
                            unit,
                            state(d.value[i], u95(d.sd[i]), prior),
                            true_values.map(|t| t[i]),
                        )
                    })
                    .collect(),
            }
        }),
        offsets: (10..estimate.values.len())
            .map(|j| {
                let true_offset = truth.and_then(|t| t.apparent_offset_n_nm).map(|o| o[j - 10]);
                quantity(PARAMETER_NAMES[j], PARAMETER_UNITS[j], at(j), true_offset)
            })
            .collect(),
        condition_number: Some(estimate.condition_number),
        physically_consistent: consistent,
        nearest_body: nearest.as_ref().map(|n| present::NearestBody {
            mass_kg: n.mass_kg,
            com_m: n.com_m,
            inertia_com_kgm2: n.inertia_com_kgm2,
            distance_sd: n.distance_sd,
        }),
        known: estimate.known().iter().map(ToString::to_string).collect(),
        time_base: time_base.clone(),
        notes: source.memory.iter().map(ToString::to_string).collect(),
        warnings: warnings.clone(),
        advice: hints.clone(),
    };

    let success = missing == 0 && broken.is_none();
    let object = ResultObject {
        tracking: None,
        error: broken,
        schema: SCHEMA_1,
        status,
        source,
        time_base,
        known: estimate
            .known()
            .iter()
            .map(|k| KnownResult { name: k.name(), value: k.value(), sigma: k.sigma() })
            .collect(),
        prior_dominated: [
            ("mass_kg", prior(0..1)),
            ("com_m", com_prior && com.is_some()),
            ("inertia_com_kgm2", tensor_prior && inertia.is_some()),
            ("inertia_origin_kgm2", prior(4..10) && all(4..10)),
            ("principal", tensor_prior && inertia.is_some()),
            (
                "body_frame",
                body_frame_result
                    .as_ref()
                    .is_some_and(|b| com_prior || (tensor_prior && b.inertia_origin_kgm2.is_some())),
            ),
        ]
        .into_iter()
        .filter_map(|(field, prior)| prior.then_some(field))
        .collect(),
        mass_kg: at(0).measured().map(|m| m.value),
        com_m: com.as_ref().map(|d| d.value),
        com_u95_m: com.as_ref().map(scaled),
        inertia_com_kgm2: inertia.as_ref().map(|d| d.value),
        inertia_com_u95_kgm2: inertia.as_ref().map(|d| d.sd.map(u95)),
        inertia_origin_kgm2: all(4..10).then(|| std::array::from_fn(|i| estimate.values[4 + i])),
        principal: principal.as_ref().map(|p| PrincipalResult {
            moments_kgm2: p.moments,
            moments_u95_kgm2: p.moments_sd.map(u95),
            axes: std::array::from_fn(|i| p.axes_sd_rad[i].is_finite().then_some(p.axes[i])),
            axes_u95_rad: p.axes_sd_rad.map(|sd| sd.is_finite().then(|| u95(sd))),
        }),
        body_frame: body_frame_result,
        physically_consistent: consistent,
        consistent: nearest,
        condition_number: estimate.condition_number,
        coloured_residuals: identification
            .colour
            .iter()
            .map(|c| ColourResult {
                channel: whiteness::WRENCH.get(c.channel).copied().unwrap_or("?"),
                factor: c.factor,
            })
            .collect(),
        residual_rms: (!identification.residuals.is_empty()).then_some(identification.residual_rms),
        rejected_rows: identification.counters.rejected,
        parameters,
        advice: hints,
        warnings,
        elapsed_s: 0.0,
    };
    Assembled { results, object, success }
}
