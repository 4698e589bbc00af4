//! Twelve of twenty-nine motions of a simulated person, by four ways of choosing.

use rigident::fit::{FitOptions, Silent};
use rigident::laboratory::laboratory::Laboratory;
use rigident::motion_capture::trial::Trial;
use rigident::people::body_segments::choice::{Way, choices};
use rigident::people::body_segments::{Study, StudyOptions};
use rigident::people::inverse_kinematics::subject::HumanModel;
use rigident::people::person::{PeopleOptions, Person};

use super::subjects::subject;

/// The number chosen.
const CHOSEN: usize = 12;
/// Length of each, s.
const SECONDS: f64 = 8.0;

/// Motions by what moves, and how many there are of each: 29.
const KINDS: [(&str, usize, &[&str]); 9] = [
    ("whole body", 3, &["pelvis", "torso", "head", "arm", "hand", "thigh", "shank", "foot"]),
    ("steps", 4, &["pelvis", "thigh", "shank", "foot"]),
    ("bends", 4, &["pelvis", "torso", "head"]),
    ("bends above the hips", 3, &["torso", "head"]),
    ("left arm", 4, &["l_upper_arm", "l_forearm", "l_hand"]),
    ("right arm", 4, &["r_upper_arm", "r_forearm", "r_hand"]),
    ("both arms", 3, &["arm", "hand"]),
    ("head", 2, &["head"]),
    ("stands", 2, &[]),
];

/// The remaining motion of what is at rest, as nobody stands quite still.
const STILL: f64 = 0.05;

/// Returns the table.
pub fn table() -> String {
    let seed = 1;
    let own = subject(HumanModel::Human34, None, seed);
    let laboratory = Laboratory { seconds: SECONDS, ..Laboratory::default() };
    let mut trials: Vec<Trial> = Vec::new();
    for (kind, count, moving) in KINDS {
        let share = |link: &str| if moving.iter().any(|part| link.contains(part)) { 1.0 } else { STILL };
        for k in 0..count {
            let number = trials.len() as u64;
            trials.push(own.somebody.trial_of(
                &format!("{kind} {}", k + 1),
                &laboratory,
                500 + number,
                &share,
            ));
        }
    }
    let options = PeopleOptions {
        own_markers: own.somebody.clusters().clone(),
        plates_zeroed: true,
        ..PeopleOptions::default()
    };
    let standing = own.somebody.standing(&laboratory, seed);
    let person = Person::new(&mut trials, Some(&standing), &options, &|_, _| {}).expect("a person");
    let all: Vec<usize> = (0..trials.len()).collect();
    let study = Study::new(&person, &all, &StudyOptions::default(), &FitOptions::default(), &Silent)
        .expect("motions");
    let (_, found) = choices(&study, Way::DOptimal, CHOSEN).expect("choices");
    let mut out = String::from(
        "| motions | condition | columns of unit length | < 5 % | 5–15 % | > 15 % | small | log10 det | \
         left-out motions, sd |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    for row in found {
        let number = |v: Option<f64>, digits: usize| v.map_or("–".to_owned(), |v| format!("{v:.digits$}"));
        out.push_str(&format!(
            "| {} {} | {} | {} | {} | {} | {} | {} | {} | {} |\n",
            row.name,
            row.motions.len(),
            number(row.condition, 0),
            number(row.condition_scaled, 1),
            row.good,
            row.fair,
            row.poor,
            row.small,
            number(row.log10_determinant, 0),
            number(row.left_out, 2),
        ));
    }
    out
}
