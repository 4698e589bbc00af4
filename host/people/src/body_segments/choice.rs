//! The motions that a person is identified from, and what other ways of choosing as many would give.

use super::error::StudyError;
use super::study::{Study, known};
use rigident_fit::motion_selection::compare::compare;
use rigident_fit::motion_selection::conditions::groups;
use rigident_fit::motion_selection::greedy::{d_optimal, e_optimal, random};
use rigident_fit::motion_selection::published::choose;
use rigident_fit::motion_selection::{Candidate, SelectionError};
use rigident_identify::answer::person::ChoiceResult;

/// Motions with a condition number below this in one group are candidates of the published rule; its paper
/// gives none.
const THRESHOLD: f64 = 20.0;
/// The seed of the choice by chance.
const SEED: u64 = 1;

/// Limbs of `human34` and `human58`.
const LIMBS: [(&str, &[&str]); 5] = [
    ("left arm", &["l_clavicle", "l_scapula", "l_upper_arm", "l_forearm", "l_ulna", "l_radius", "l_hand"]),
    ("right arm", &["r_clavicle", "r_scapula", "r_upper_arm", "r_forearm", "r_ulna", "r_radius", "r_hand"]),
    ("left leg", &["l_thigh", "l_shank", "l_foot"]),
    ("right leg", &["r_thigh", "r_shank", "r_foot"]),
    ("trunk and head", &["pelvis", "torso", "lumbar", "chest", "cervical", "head"]),
];

/// A way to choose motions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Most information, by its determinant.
    DOptimal,
    /// The best least eigenvalue of the information.
    EOptimal,
    /// By conditions of parts of the body, as published.
    Published,
    /// By chance.
    Random,
}

impl Way {
    /// All ways.
    pub const ALL: [Self; 4] = [Self::DOptimal, Self::EOptimal, Self::Published, Self::Random];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::DOptimal => "D-optimal",
            Self::EOptimal => "E-optimal",
            Self::Published => "published rule",
            Self::Random => "random",
        }
    }
}

/// Returns the motions that a way chooses, and what comes of every way at that size, and of all motions.
///
/// # Errors
/// [`StudyError::Selection`] if there is nothing to choose from.
pub fn choices(study: &Study, way: Way, count: usize) -> Result<(Vec<usize>, Vec<ChoiceResult>), StudyError> {
    let candidates: Vec<Candidate> =
        study.motions.iter().map(|m| Candidate { name: m.name.clone(), factor: m.pooled.factor() }).collect();
    let groups = groups(&study.motions[0].pooled.parameters, &LIMBS);
    let made = |way: Way| -> Result<Vec<usize>, SelectionError> {
        match way {
            Way::DOptimal => d_optimal(&candidates, count),
            Way::EOptimal => e_optimal(&candidates, count),
            Way::Published => choose(&candidates, &groups, THRESHOLD, count),
            Way::Random => random(&candidates, count, SEED),
        }
    };
    let known = known(&study.table);
    let mut results = Vec::new();
    let mut chosen = Vec::new();
    for each in Way::ALL {
        let mut motions = made(each)?;
        motions.sort_unstable();
        // The published rule may find no candidate at all.
        if !motions.is_empty() {
            results.push(result(
                &compare(each.name(), &candidates, &motions, Some(&known))?,
                study,
                each == way,
            ));
        }
        if each == way {
            chosen = motions;
        }
    }
    if chosen.is_empty() {
        return Err(StudyError::NoFrames(format!("the {} finds no motion", way.name())));
    }
    let all: Vec<usize> = (0..candidates.len()).collect();
    results.push(result(&compare("all", &candidates, &all, Some(&known))?, study, false));
    Ok((chosen, results))
}

fn result(of: &rigident_fit::motion_selection::compare::Choice, study: &Study, used: bool) -> ChoiceResult {
    let finite = |v: f64| v.is_finite().then_some(v);
    ChoiceResult {
        name: of.name.clone(),
        used,
        motions: of.motions.iter().filter_map(|k| Some(study.motions.get(*k)?.name.clone())).collect(),
        good: of.good as u64,
        fair: of.fair as u64,
        poor: of.poor as u64,
        small: of.small as u64,
        condition: finite(of.condition[0]),
        condition_scaled: finite(of.condition[1]),
        log10_determinant: finite(of.log10_determinant),
        left_out: of.left_out,
    }
}
