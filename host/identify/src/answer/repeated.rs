//! Several runs of one body: what scatters from one to the next, beside what each said of itself.
//!
//! The platform thesis sums its repeated experiments up by mean and standard deviation. Here the scatter is
//! compared with the runs' own uncertainties: `χ² = Σ (xᵢ − x̄)²/uᵢ²` with the weighted mean x̄ is that of n
//! − 1 degrees of freedom at most where these hold, since what the runs have in common (mounting, scales) is
//! in uᵢ and does not scatter.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, StudentsT};

use super::Answer;
use super::result::{Measured, Status};
use rigident_fit::COVERAGE_95;

/// By chance some quantity scatters as much once in a hundred summaries.
const SURPRISING: f64 = 0.01;

/// One quantity in several runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repeated {
    /// As in the results.
    pub name: String,
    /// As in the results.
    pub unit: String,
    /// In how many runs it is identified.
    pub runs: usize,
    /// Mean of the runs.
    pub mean: f64,
    /// 95 % uncertainty of the mean by the scatter alone: Student's t with n − 1 degrees of freedom.
    pub mean_u95: f64,
    /// Standard deviation between runs.
    pub std: f64,
    /// Root mean square of the standard uncertainties that the runs state.
    pub stated_std: f64,
    /// Least and largest.
    pub range: [f64; 2],
    /// Probability of this much scatter where the stated uncertainties hold.
    pub probability: f64,
    /// Its true value, where all runs say the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<f64>,
}

/// Several runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// The number of its runs.
    pub runs: usize,
    /// The quantities that at least two of them identify, in their order.
    pub quantities: Vec<Repeated>,
    /// The quantities that at most one of them identifies.
    #[serde(rename = "not_identified")]
    pub left_out: Vec<String>,
    /// Quantities other than offsets that scatter more than the runs' uncertainties explain.
    pub surprising: Vec<String>,
}

/// Returns true if the numbers of an answer may be used.
pub fn is_usable(answer: &Answer) -> bool {
    answer.status != Status::Failed && !answer.is_contradicted()
}

/// Returns true if two answers are of one run: noise repeats no number to the last bit.
pub fn is_same_run(a: &Answer, b: &Answer) -> bool {
    let measured = |answer: &Answer| -> Vec<Measured> {
        answer.parameters.iter().filter_map(|p| p.state.measured()).collect()
    };
    let (a, b) = (measured(a), measured(b));
    !a.is_empty() && a == b
}

/// Sums up the answers of several runs of one body, or of one tree.
pub fn summary(answers: &[Answer]) -> Summary {
    let mut names: Vec<(String, String)> = Vec::new();
    let by_run: Vec<Vec<Quantity>> = answers.iter().map(quantities).collect();
    for Quantity { name, unit, .. } in by_run.iter().flatten() {
        if !names.iter().any(|(known, _)| known == name) {
            names.push((name.clone(), unit.clone()));
        }
    }
    let count = names.len().max(1) as f64;
    let mut summary = Summary { runs: answers.len(), ..Summary::default() };
    for (name, unit) in names {
        let of: Vec<&Quantity> = by_run.iter().flatten().filter(|q| q.name == name).collect();
        let measured: Vec<Measured> = of.iter().filter_map(|q| q.measured).collect();
        let Some(repeated) = repeated(&measured) else {
            summary.left_out.push(name);
            continue;
        };
        // An offset is the load cell's, and may be another in every run.
        if !name.starts_with("offset_") && repeated.probability < SURPRISING / count {
            summary.surprising.push(name.clone());
        }
        let truth =
            of.first().and_then(|q| q.truth).filter(|truth| of.iter().all(|q| q.truth == Some(*truth)));
        summary.quantities.push(Repeated { name, unit, truth, ..repeated });
    }
    summary
}

struct Quantity {
    name: String,
    unit: String,
    measured: Option<Measured>,
    truth: Option<f64>,
}

/// The parameters, centre of mass and tensor about it.
fn quantities(answer: &Answer) -> Vec<Quantity> {
    let parameters = answer.parameters.iter().map(|parameter| Quantity {
        name: parameter.name.clone(),
        unit: parameter.unit.clone(),
        measured: parameter.state.measured(),
        truth: parameter.truth,
    });
    let named = |name: String, unit: &str, value: Option<f64>, u95: Option<f64>| Quantity {
        name,
        unit: unit.to_owned(),
        measured: value.zip(u95).map(|(value, u95)| Measured { value, u95 }),
        truth: None,
    };
    let com = ["x", "y", "z"].into_iter().enumerate().map(|(k, axis)| {
        let at = |values: Option<[f64; 3]>| values.map(|values| values[k]);
        named(format!("com_{axis}"), "m", at(answer.com_m), at(answer.com_u95_m))
    });
    let tensor = ["Ixx", "Iyy", "Izz", "Iyz", "Izx", "Ixy"].into_iter().enumerate().map(|(k, name)| {
        let at = |values: Option<[f64; 6]>| values.map(|values| values[k]);
        named(format!("{name}_com"), "kg m2", at(answer.inertia_com_kgm2), at(answer.inertia_com_u95_kgm2))
    });
    let of_body = answer.mass_kg.is_some() || answer.com_m.is_some() || answer.inertia_com_kgm2.is_some();
    parameters.chain(com.chain(tensor).filter(|_| of_body)).collect()
}

fn repeated(measured: &[Measured]) -> Option<Repeated> {
    let n = measured.len() as f64;
    if measured.len() < 2 {
        return None;
    }
    let freedoms = n - 1.0;
    let mean = measured.iter().map(|m| m.value).sum::<f64>() / n;
    let std = (measured.iter().map(|m| (m.value - mean).powi(2)).sum::<f64>() / freedoms).sqrt();
    let weight = |m: &Measured| (COVERAGE_95 / m.u95).powi(2);
    let weights: f64 = measured.iter().map(weight).sum();
    let centre = measured.iter().map(|m| weight(m) * m.value).sum::<f64>() / weights;
    let chi2: f64 = measured.iter().map(|m| weight(m) * (m.value - centre).powi(2)).sum();
    let stated = measured.iter().map(|m| (m.u95 / COVERAGE_95).powi(2)).sum::<f64>() / n;
    let t = StudentsT::new(0.0, 1.0, freedoms).map_or(f64::NAN, |t| t.inverse_cdf(0.975));
    Some(Repeated {
        name: String::new(),
        unit: String::new(),
        runs: measured.len(),
        mean,
        mean_u95: t * std / n.sqrt(),
        std,
        stated_std: stated.sqrt(),
        range: measured
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], m| [low.min(m.value), high.max(m.value)]),
        // Exact runs that differ are as surprising as can be.
        probability: ChiSquared::new(freedoms).map_or(1.0, |d| if chi2.is_nan() { 1.0 } else { d.sf(chi2) }),
        truth: None,
    })
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::answer::result::{Parameter, ParameterState};

    fn answer(values: &[(&str, Option<[f64; 2]>)]) -> Answer {
        let parameter = |(name, measured): &(&str, Option<[f64; 2]>)| Parameter {
            name: (*name).to_owned(),
            unit: "kg".to_owned(),
            state: measured.map_or(ParameterState::NotIdentified, |[value, u95]| {
                ParameterState::Identified(Measured { value, u95 })
            }),
            ..Parameter::default()
        };
        Answer { parameters: values.iter().map(parameter).collect(), ..Answer::default() }
    }

    /// By hand: 1, 2, 4 have the mean 7/3, the variance 7/3, and t(2) = 4.3027.
    #[test]
    fn mean_and_scatter_are_those_by_hand() {
        let answers: Vec<Answer> = [1.0, 2.0, 4.0]
            .into_iter()
            .map(|value| answer(&[("m", Some([value, 1.96])), ("mcx", None)]))
            .collect();
        let summary = summary(&answers);
        let [m] = summary.quantities.as_slice() else { panic!("{summary:?}") };
        assert!((m.mean - 7.0 / 3.0).abs() < 1e-12 && (m.std - (7.0_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!((m.mean_u95 - 4.302_653 * m.std / 3.0_f64.sqrt()).abs() < 1e-5);
        assert!((m.stated_std - 1.0).abs() < 1e-4);
        // χ² = 14/3 of two degrees of freedom: exp(−7/3).
        assert!((m.probability - (-7.0_f64 / 3.0).exp()).abs() < 1e-4, "{}", m.probability);
        assert_eq!((summary.left_out, summary.surprising), (vec!["mcx".to_owned()], Vec::new()));
    }

    #[test]
    fn one_run_is_the_same_however_often_it_is_read() {
        let run = |value| answer(&[("m", Some([value, 0.1])), ("mcx", None)]);
        assert!(is_same_run(&run(1.0), &run(1.0)) && !is_same_run(&run(1.0), &run(1.0 + f64::EPSILON)));
        let nothing = answer(&[("m", None)]);
        assert!(!is_same_run(&nothing, &nothing));
    }

    #[test]
    fn scatter_is_reported_where_it_is_more_than_stated_and_seldom_where_it_is_not() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut surprised = |scale: f64| {
            let mut runs = |_: usize| {
                let drawn: f64 = StandardNormal.sample(&mut random);
                answer(&[("m", Some([20.0 + 0.01 * scale * drawn, 0.0196]))])
            };
            let answers: Vec<Answer> = (0..10).map(&mut runs).collect();
            !summary(&answers).surprising.is_empty()
        };
        let honest = (0..500).filter(|_| surprised(1.0)).count();
        assert!(honest <= 15, "{honest} of 500, one in a hundred expected");
        let doubled = (0..100).filter(|_| surprised(3.0)).count();
        assert!(doubled >= 95, "{doubled} of 100");
    }
}
