//! Faults of still poses: the attitudes that gravity is made of, and the load cell's axes against them.

use super::sensors::{Triple, axes_in_words, rotations, turned};
use super::{Case, Fault};

/// Returns the faults that still poses whose gravity is that of attitudes may have.
pub(super) fn faults(case: &Case) -> Vec<Fault> {
    if !case.recording.is_static || case.recording.gravity_attitudes.is_empty() {
        return Vec::new();
    }
    let mut all = of_attitudes();
    all.extend(of_load_cell());
    all
}

/// Returns orders and directions in which programs write a quaternion, beside w, x, y, z of S.
fn of_attitudes() -> Vec<Fault> {
    let fault = |what: &str, remedy: &str, change: fn([f64; 4]) -> [f64; 4]| {
        Fault::new("attitude_wxyz", what, remedy, move |case| {
            let attitudes = case.recording.gravity_attitudes.iter().map(|q| change(*q)).collect();
            case.recording.set_attitudes(attitudes);
            true
        })
    };
    let named = "name the columns of attitude_wxyz in the order w, x, y, z";
    vec![
        fault("the attitudes are in the order x, y, z, w", named, |[x, y, z, w]| [w, x, y, z]),
        fault(
            "the attitudes are the inverse ones: of the world in S",
            "give the attitude of S in axes with z up, or change the signs of its x, y and z",
            |[w, x, y, z]| [w, -x, -y, -z],
        ),
        fault(
            "the attitudes are the inverse ones, in the order x, y, z, w",
            "give the attitude of S in axes with z up, in the order w, x, y, z",
            |[x, y, z, w]| [w, -x, -y, -z],
        ),
    ]
}

/// Returns turns of force and moment together: the attitudes are then not those of the load cell.
fn of_load_cell() -> impl Iterator<Item = Fault> {
    rotations().map(|axes| {
        let what = format!("the load cell {} against S of the attitudes", axes_in_words(axes));
        let remedy = "give the attitudes of the load cell's own axes, S";
        Fault::new("axes of the load cell", what, remedy, move |case| {
            [Triple::Force, Triple::Moment].iter().all(|half| half.each(case, &|v| turned(axes, v)))
        })
    })
}
