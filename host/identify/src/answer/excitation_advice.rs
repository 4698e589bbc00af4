//! Excitation advice: what the motion lacks, in words that a person can act on.
//!
//! The one source of such words. They are read off the factor: its information about the body, the wrench
//! offset eliminated, in units in which a parameter is identified if it has the information 1. A *weak*
//! direction has less.
//! - A tensor `n nᵀ` answers to nothing but rotation about n: `M = (n·ω̇) n + (n·ω)(ω×n)`. If it is weak, so
//!   was the rotation about n.
//! - A first moment along v answers, still, to gravity across v, less the mean that the moment offset takes.
//!   If it is weak, gravity moved in S along v at most; a tilt about k moves it along `k × a`.
//! - A mass answers to what specific force has beside its mean.
//! - What is weak though none of these is, is weak by collinearity: at one frequency `ω̇ = −Ω² θ`, and the
//!   tensor answers as the first moment does in the tilted gravity, or by want of time.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, SymmetricEigen, Vector3};

use super::context::Links;
use super::result::ParameterState;
use super::states::{BodyScale, LARGEST_SHARE, LEAST_EXCITATION, scales};
use rigident_fit::figures::significant;
use rigident_fit::{Estimate, Fit, Kind, Owner};
use rigident_shared::inertia::PARAMETER_NAMES;

/// Information below this share of what is needed is none: less than a third of the motion.
const NONE: f64 = 0.1;

/// Directions this close to an axis of S are called by its name: 15 degrees.
const NEARLY: f64 = 0.966;

/// Correlation of the answers of a tensor and a first moment from which on they are called collinear.
const COLLINEAR: f64 = 0.9;

type Body = SVector<f64, 10>;

/// The information of rows on the body when nothing is known of the offset.
struct Information {
    /// In units of what identifies a parameter.
    needed: SMatrix<f64, 10, 10>,
    /// One of those units, SI.
    unit: Body,
    /// Mean specific force in S, weighted as the rows are, m/s²; `None` if the offset was known.
    mean_force: Option<Vector3<f64>>,
}

impl Information {
    /// Returns what the triangle of ten parameters, or sixteen with the offset, says; `None` if its offset is
    /// open.
    fn of(r: &DMatrix<f64>, estimate: &Estimate, coverage_factor: f64, spurious: f64) -> Option<Self> {
        let raw = r.transpose() * r;
        let mut body: SMatrix<f64, 10, 10> = raw.fixed_view::<10, 10>(0, 0).into();
        let mut mean_force = None;
        if raw.nrows() == 16 {
            let offset = raw.fixed_view::<6, 6>(10, 10).into_owned().cholesky()?;
            let cross = raw.fixed_view::<6, 10>(10, 0).into_owned();
            // Offsets that would best imitate each parameter.
            let alike = offset.solve(&cross);
            body -= cross.transpose() * alike;
            mean_force = Some(Vector3::new(alike[(0, 0)], alike[(1, 0)], alike[(2, 0)]));
        }
        let scale = BodyScale::rough(estimate, spurious);
        let moment = scale.central_moment(estimate);
        let unit = Body::from_fn(|j, _| {
            let is_tensor = (4..10).contains(&j);
            let size = if is_tensor { moment } else { scale.of_parameter(j) };
            let size = LARGEST_SHARE * size / coverage_factor;
            let faked = if is_tensor { LEAST_EXCITATION * spurious } else { 0.0 };
            1.0 / (1.0 / (size * size)).max(faked).sqrt()
        });
        let needed = SMatrix::from_fn(|i, j| body[(i, j)] * unit[i] * unit[j]);
        Some(Self { needed, unit, mean_force })
    }

    /// On a change of the parameters, SI, of any length.
    fn about(&self, change: &Body) -> f64 {
        let x = change.component_div(&self.unit).normalize();
        (x.transpose() * self.needed * x).x
    }

    fn about_rotation(&self, n: &Vector3<f64>) -> f64 {
        self.about(&tensor(n, n))
    }

    /// Axes without enough rotation, and how much there is: those of S first, then whatever is left between.
    fn lacking_rotations(&self) -> Vec<(Vector3<f64>, f64)> {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let measured = |n: Vector3<f64>| (n, self.about_rotation(&n));
        let mut lacking: Vec<_> = axes.into_iter().map(measured).filter(|(_, q)| *q < 1.0).collect();
        while lacking.len() < 3 {
            let (n, q) = measured(self.least_rotated(&lacking));
            if q >= 1.0 {
                break;
            }
            lacking.push((n, q));
        }
        lacking
    }

    /// The unit vector across `others` of the least rotation: a search on the sphere, refined where it is
    /// least.
    fn least_rotated(&self, others: &[(Vector3<f64>, f64)]) -> Vector3<f64> {
        let across = |v: Vector3<f64>| {
            let left = others.iter().fold(v, |v, (n, _)| v - n * n.dot(&v));
            left.try_normalize(1e-3)
        };
        let mut best = (Vector3::z(), f64::INFINITY);
        let consider = |v: Vector3<f64>, best: &mut (Vector3<f64>, f64)| {
            if let Some((v, q)) = across(v).map(|v| (v, self.about_rotation(&v)))
                && q < best.1
            {
                *best = (v, q);
            }
        };
        // A sunflower: even to a few degrees.
        const POINTS: u32 = 600;
        for k in 0..POINTS {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(POINTS);
            let (sin, cos) = (f64::from(k) * 2.399_963_229_728_653).sin_cos();
            let r = (1.0 - z * z).sqrt();
            consider(Vector3::new(r * cos, r * sin, z), &mut best);
        }
        let mut step = 0.1;
        for _ in 0..100 {
            let from = best.0;
            for d in [Vector3::x(), Vector3::y(), Vector3::z()] {
                consider(from + d * step, &mut best);
                consider(from - d * step, &mut best);
            }
            if best.0 == from {
                step *= 0.5;
            }
        }
        best.0
    }

    /// Unit vectors along which the first moment is not seen, and how much it is.
    fn lacking_first_moments(&self) -> Vec<(Vector3<f64>, f64)> {
        let eigen = SymmetricEigen::new(self.needed.fixed_view::<3, 3>(1, 1).into_owned());
        let pairs = eigen.eigenvectors.column_iter().zip(eigen.eigenvalues.iter());
        pairs.filter(|(_, q)| **q < 1.0).map(|(v, q)| (v.into_owned(), *q)).collect()
    }

    /// Returns the weakest direction that has no share in those reported already, in the units of `needed`,
    /// with its information.
    fn weakest_beside(&self, reported: &[Body]) -> Option<(Body, f64)> {
        let mut space = SMatrix::<f64, 10, 10>::identity();
        let mut basis: Vec<Body> = Vec::new();
        for change in reported {
            let x = change.component_div(&self.unit).normalize();
            let left = basis.iter().fold(x, |x, b| x - b * b.dot(&x));
            if let Some(b) = left.try_normalize(1e-6) {
                space -= b * b.transpose();
                basis.push(b);
            }
        }
        // Directions reported already are lifted out of the way.
        let lift = self.needed.trace().max(1.0);
        let rest = space * self.needed * space + (SMatrix::identity() - space) * lift;
        let eigen = SymmetricEigen::new(rest);
        let (k, q) = eigen.eigenvalues.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
        (basis.len() < 10).then(|| (eigen.eigenvectors.column(k).into_owned(), *q))
    }

    /// Correlation of what the tensor of x and the first moment of x answer.
    fn correlation(&self, x: &Body) -> f64 {
        let only =
            |range: std::ops::Range<usize>| Body::from_fn(|j, _| if range.contains(&j) { x[j] } else { 0.0 });
        let (first, second) = (only(1..4), only(4..10));
        let form = |a: &Body, b: &Body| (a.transpose() * self.needed * b).x;
        let scale = (form(&first, &first) * form(&second, &second)).sqrt();
        if scale > 0.0 { (form(&first, &second) / scale).abs() } else { 0.0 }
    }
}

/// The tensor `½ (p qᵀ + q pᵀ)` and nothing else.
fn tensor(p: &Vector3<f64>, q: &Vector3<f64>) -> Body {
    let m: Matrix3<f64> = (p * q.transpose() + q * p.transpose()) * 0.5;
    Body::from_column_slice(&[
        0.0,
        0.0,
        0.0,
        0.0,
        m[(0, 0)],
        m[(1, 1)],
        m[(2, 2)],
        m[(1, 2)],
        m[(2, 0)],
        m[(0, 1)],
    ])
}

/// `S.x`, or its components.
fn name(v: &Vector3<f64>) -> String {
    let k = v.iamax();
    if v[k].abs() >= NEARLY {
        return format!("S.{}", ["x", "y", "z"][k]);
    }
    // Either sign is the same line.
    let v = if v[k] < 0.0 { -v } else { *v };
    let [x, y, z] = [v.x, v.y, v.z].map(|c| (c * 100.0).round() / 100.0 + 0.0);
    format!("({x:.2}, {y:.2}, {z:.2}) of S")
}

/// `a`, `a or b`, `a, b or c`.
fn listed(names: &[String], last: &str) -> String {
    match names {
        [] => String::new(),
        [only] => only.clone(),
        [front @ .., end] => format!("{} {last} {end}", front.join(", ")),
    }
}

/// A smaller share of the information is reported as this one.
const LEAST_SHARE: f64 = 1e-6;

/// Returns how much more is needed of a motion that brought this share of the information:
/// `2.5 times the rate, or 6 times as long`.
fn more(share: f64, what: &str) -> String {
    let rate = 1.0 / share.max(LEAST_SHARE).sqrt();
    if share <= LEAST_SHARE {
        return format!("more than {rate:.0} times {what}, or a sensor quieter by as much,");
    }
    format!("{rate:.1} times {what}, or {:.1} times as long,", rate * rate)
}

/// Returns what to do so that the parameters of a body that are not identified become so.
///
/// `r` is the triangle of the data alone in true standard deviations, of ten parameters or of sixteen with
/// the offset. `estimate` counts what was known beforehand and gives the body's scale; `coverage_factor` is
/// that of the data's intervals; `spurious` is the information that noise of the rates alone brings to a
/// moment of inertia, 1/(kg m²)². Nothing is said of what `is_identified` with what is known beforehand.
pub(super) fn advice(
    r: Option<&DMatrix<f64>>,
    (estimate, is_identified): (&Estimate, &dyn Fn(usize) -> bool),
    coverage_factor: f64,
    spurious: f64,
) -> Vec<String> {
    let fallback = || vec!["move about more axes at once, longer, or with a quieter sensor".to_owned()];
    let information = r.and_then(|r| Information::of(r, estimate, coverage_factor, spurious));
    let Some(information) = information else { return fallback() };
    let rotations = information.lacking_rotations();
    let moments = information.lacking_first_moments();
    let mass = Body::from_fn(|j, _| f64::from(u8::from(j == 0)));
    let mass = Some((mass, information.about(&mass))).filter(|(_, q)| *q < 1.0);

    let mut reported: Vec<Body> = mass.iter().map(|(m, _)| *m).collect();
    for (v, _) in &moments {
        reported.push(Body::from_fn(|j, _| if (1..4).contains(&j) { v[j - 1] } else { 0.0 }));
    }
    for (i, (p, _)) in rotations.iter().enumerate() {
        reported.extend(rotations.iter().skip(i).map(|(q, _)| tensor(p, q)));
    }

    let mut advice = Vec::new();
    let is_none = |found: &[(Vector3<f64>, f64)]| found.len() == 3 && found.iter().all(|(_, q)| *q < NONE);
    if mass.is_some_and(|(_, q)| q < NONE) && is_none(&moments) && is_none(&rotations) {
        advice.push(one_pose(&information));
        return advice;
    }
    let open = |mut range: std::ops::Range<usize>| range.any(|j| !is_identified(j));
    let lacking = if open(1..4) { moments.as_slice() } else { &[] };
    advice.extend(tilt(&information, mass.map(|(_, q)| q).filter(|_| open(0..1)), lacking));
    advice.extend(rotation(&rotations));
    for _ in 0..10 {
        let Some((x, q)) = information.weakest_beside(&reported).filter(|(_, q)| *q < 1.0) else { break };
        let sentence = between(&information, &x, q);
        if !advice.contains(&sentence) {
            advice.push(sentence);
        }
        reported.push(x.component_mul(&information.unit));
    }
    if advice.is_empty() { fallback() } else { advice }
}

/// Returns what to do so that the rest of one body is identified.
pub(super) fn of_body(fit: &Fit, states: &[ParameterState]) -> Vec<String> {
    let n = fit.parameters.len();
    let rows = || match &fit.solved {
        Some(solved) => solved.r(),
        None => fit.factor.discount(fit.noise.variance_scale).r(),
    };
    let r = (n == 10 || n == 16).then(rows);
    let is_identified = |j: usize| states.get(j).is_some_and(ParameterState::is_identified);
    let judged = (&fit.estimate, &is_identified as &dyn Fn(usize) -> bool);
    advice(r.as_ref(), judged, fit.data_alone().coverage_factor(), fit.spurious_information)
}

/// Returns why parameters of a tree, or of any other model, are not identified, owner by owner.
pub(super) fn of_links(fit: &Fit, links: Option<&Links>, states: &[ParameterState]) -> Vec<String> {
    let data = fit.data_alone();
    let mut said: Vec<String> = links.map_or_else(Vec::new, |links| links.idle.clone());
    let list =
        |all: &[usize]| all.iter().map(|j| fit.parameters[*j].name.as_str()).collect::<Vec<_>>().join(", ");
    let open = || (0..states.len()).filter(|j| states[*j] == ParameterState::NotIdentified);
    let together: BTreeSet<usize> =
        data.unjudged().null_directions.iter().flatten().map(|part| part.0).collect();
    let (shared, alone): (Vec<usize>, Vec<usize>) =
        open().filter(|j| !data.is_determined(*j)).partition(|j| together.contains(j));
    if !alone.is_empty() {
        said.push(format!("not excited at all: {}; nothing in this motion depends on them", list(&alone)));
    }
    if !shared.is_empty() {
        let count = data.unjudged().null_directions.len();
        let seen = match shared.len().checked_sub(count) {
            None | Some(0) => "nothing".to_owned(),
            Some(more) => format!("{more} combinations"),
        };
        let stay = if count == 1 { "combination stays" } else { "combinations stay" };
        said.push(format!("the rows see only {seen} of {}: {count} {stay} open", list(&shared)));
    }
    let mut weak: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for j in open().filter(|j| data.is_determined(*j)) {
        let place = match &fit.parameters[j].owner {
            Owner::Link(link) => format!("link {link}"),
            Owner::Channel(_) => "the wrench's offset".to_owned(),
            Owner::Drive(name) => format!("drive of {name}"),
            Owner::Other(name) => name.clone(),
        };
        weak.entry(place).or_default().push(j);
    }
    let scales = scales(fit, links);
    for (place, parameters) in weak {
        said.extend(weakly_excited(fit, &scales, &place, &parameters));
    }
    said.extend(link_rotations(fit, links, states));
    said
}

/// Returns why parameters that the rows determine are not identified, each with its number, and the motion
/// that would do for the worst of them.
fn weakly_excited(fit: &Fit, scales: &[Option<f64>], place: &str, parameters: &[usize]) -> Vec<String> {
    let data = fit.data_alone();
    let (mut uncertain, mut noisy, mut said) = (Vec::new(), Vec::new(), Vec::new());
    let mut least = (1.0, Kind::Inertia);
    for j in parameters {
        let parameter = &fit.parameters[*j];
        let name = &parameter.name;
        let scale = scales.get(*j).copied().flatten().filter(|scale| *scale > 0.0);
        let Some(scale) = scale else {
            said.push(format!(
                "{place}: nothing of it is known that {name} could be compared with: move it more, or state \
                 with `known` what is known"
            ));
            continue;
        };
        let relative = data.u95(*j) / scale;
        if relative > LARGEST_SHARE {
            uncertain.push(format!("{name} to {} %", significant(100.0 * relative, 2)));
            let share = (LARGEST_SHARE / relative).powi(2);
            least = if share < least.0 { (share, parameter.kind) } else { least };
        } else {
            noisy.push(name.clone());
        }
    }
    if !uncertain.is_empty() {
        let what = match least.1 {
            Kind::Viscous => "the rate",
            Kind::Coulomb | Kind::Offset => "the change of direction",
            Kind::Mass | Kind::FirstMoment => "the tilt and the acceleration",
            _ => "the angular acceleration",
        };
        said.push(format!(
            "{place}: of its own scale are known {}, where {:.0} % would do: {} would do for the worst",
            listed(&uncertain, "and"),
            100.0 * LARGEST_SHARE,
            more(least.0, what)
        ));
    }
    if !noisy.is_empty() {
        said.push(format!(
            "{place}: what the motion tells of {} is less than {LEAST_EXCITATION} times what noise of the \
             rates would: faster motion, or quieter gyros or encoders, would do",
            listed(&noisy, "and")
        ));
    }
    said
}

/// Returns about which axes links with all six moments of inertia among the parameters should turn more.
///
/// Of a link the tensor `n nᵀ` answers to nothing but its rotation about n, whatever other bodies are summed
/// up in its base parameters: their marginal information is that of the link's own rotation.
fn link_rotations(fit: &Fit, links: Option<&Links>, states: &[ParameterState]) -> Vec<String> {
    let mut of_link: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (j, parameter) in fit.parameters.iter().enumerate() {
        if let (Owner::Link(link), Kind::Inertia) = (&parameter.owner, parameter.kind) {
            of_link.entry(link).or_default().push(j);
        }
    }
    let data = fit.data_alone();
    let open = |all: &[usize]| {
        all.iter().any(|j| states.get(*j) == Some(&ParameterState::NotIdentified))
            && all.iter().all(|j| data.is_determined(*j))
    };
    let scales = scales(fit, links);
    let mut said = Vec::new();
    for (link, all) in of_link.into_iter().filter(|(_, all)| all.len() == 6 && open(all)) {
        let scale = all.iter().filter_map(|j| scales.get(*j).copied().flatten()).fold(0.0, f64::max);
        let size = LARGEST_SHARE * scale / data.coverage_factor();
        let needed = (1.0 / (size * size)).max(LEAST_EXCITATION * fit.spurious_information);
        // 1 / (nᵀ-tensor's variance): information on the moment about an axis, all else estimated.
        let axes = ["x", "y", "z"].into_iter().zip(&all);
        let lacking: Vec<String> = axes
            .filter_map(|(axis, j)| {
                let share = 1.0 / data.covariance(*j, *j)? / needed;
                (share < 1.0).then(|| {
                    format!(
                        "{link}.{axis} ({})",
                        more(share, "the angular acceleration").trim_end_matches(',')
                    )
                })
            })
            .collect();
        if size > 0.0 && !lacking.is_empty() {
            said.push(format!(
                "too little rotation of link {link} for this noise about {}",
                lacking.join(", ")
            ));
        }
    }
    said
}

fn one_pose(information: &Information) -> String {
    let axes = tilt_axes(information, &[]);
    format!(
        "one still pose only: hold the body still in three or more attitudes that differ by 20 degrees or \
         more about {}, then turn it to and fro about S.x, S.y and S.z, with two or three well-separated \
         frequencies about each",
        listed(&axes, "and about")
    )
}

/// Axes about which a tilt moves gravity across the first moments that are not seen: v itself, as far as it
/// is level.
fn tilt_axes(information: &Information, moments: &[(Vector3<f64>, f64)]) -> Vec<String> {
    let gravity = information.mean_force.and_then(|a| a.try_normalize(1.0));
    if let ([(v, _)], Some(a)) = (moments, gravity)
        && let Some(level) = (v - a * a.dot(v)).try_normalize(0.5)
    {
        return vec![name(&level)];
    }
    // Nothing but weight along v, or no tilt at all: every level axis helps.
    let a = gravity.or(moments.first().map(|(v, _)| *v)).unwrap_or(Vector3::z());
    let axes = ["S.x", "S.y", "S.z"].into_iter().zip(a.iter());
    axes.filter(|(_, a)| a.abs() < NEARLY).map(|(name, _)| name.to_owned()).collect()
}

fn tilt(information: &Information, mass: Option<f64>, moments: &[(Vector3<f64>, f64)]) -> Option<String> {
    let least = moments.iter().map(|(_, q)| *q).chain(mass).min_by(f64::total_cmp)?;
    let axes = tilt_axes(information, moments);
    let along = match moments {
        [] => None,
        [_, _, _] => Some("the centre of mass".to_owned()),
        some => {
            let names: Vec<String> = some.iter().map(|(v, _)| name(v)).collect();
            Some(format!("the centre of mass along {}", listed(&names, "and")))
        }
    };
    let what: Vec<String> = mass.map(|_| "the mass".to_owned()).into_iter().chain(along).collect();
    let why = if information.mean_force.is_some() {
        format!("{} cannot be distinguished from the wrench offset", listed(&what, "and"))
    } else {
        format!("gravity says nothing of {}", listed(&what, "and"))
    };
    let little = if least < NONE { "no tilt" } else { "too little tilt" };
    Some(format!(
        "{little} about {}: {why}; hold the body still in three or more attitudes that differ by 20 degrees \
         or more about {}",
        listed(&axes, "or"),
        listed(&axes, "and about")
    ))
}

fn rotation(lacking: &[(Vector3<f64>, f64)]) -> Vec<String> {
    let (none, little): (Vec<_>, Vec<_>) = lacking.iter().partition(|(_, q)| *q < NONE);
    let mut sentences = Vec::new();
    if !none.is_empty() {
        let names: Vec<String> = none.iter().map(|(n, _)| name(n)).collect();
        sentences.push(format!(
            "no rotation to and fro about {} that is fast enough: turn the body about {}, with two or three \
             well-separated frequencies{}",
            listed(&names, "or"),
            listed(&names, "and"),
            if names.len() > 1 { " about each" } else { "" }
        ));
    }
    for (n, q) in little {
        sentences.push(format!(
            "too little rotation about {} for this noise: {} would do",
            name(&n),
            more(q, "the angular acceleration")
        ));
    }
    sentences
}

/// A weak direction between parameters each of which is seen.
fn between(information: &Information, x: &Body, share: f64) -> String {
    if information.correlation(x) >= COLLINEAR {
        let t = [4, 5, 6].map(|j: usize| x[j] * information.unit[j]);
        let most = t.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        let named = ["S.x", "S.y", "S.z"].iter().zip(t).filter(|(_, v)| v.abs() >= 0.3 * most);
        let names: Vec<String> = named.map(|(name, _)| (*name).to_owned()).collect();
        return format!(
            "all rotation about {} is at one frequency: the tensor and the first moment are collinear; add a \
             second, well-separated frequency, or still poses tilted by 20 degrees or more",
            listed(&names, "and")
        );
    }
    let most = x.amax();
    let names: Vec<String> =
        (0..10).filter(|j| x[*j].abs() >= 0.3 * most).map(|j| PARAMETER_NAMES[j].to_owned()).collect();
    format!(
        "too little motion for this noise to determine {}: {} would do",
        listed(&names, "and"),
        more(share, "the angular rate")
    )
}
