//! A gyro whose readings are too large or too small by one factor, which is no unit's: that of another range,
//! mostly.

use super::tuned::Tuned;
use super::{Case, Fault, left_by, rows_of};
use rigident_fit::explained::BLOCKS;

/// Factors that are tried at first, and those that a gyro may be off by; what is nearer to 1 is an error of
/// its scale.
const GRID: [f64; 8] = [0.2, 0.35, 0.5, 0.75, 1.3, 2.0, 3.0, 5.0];
const LIMITS: [f64; 2] = [0.15, 6.5];
const NEAR: f64 = 0.03;

/// Multiplies the gyro's readings; false if there are none.
fn multiply(case: &mut Case, factor: f64) -> bool {
    let gyro = case.recording.imus.first_mut().and_then(|imu| imu.gyro.as_mut());
    gyro.map(|rows| rows.iter_mut().flatten().for_each(|v| *v *= factor)).is_some()
}

/// Returns the factor of a grid that leaves least.
fn start(case: &Case) -> Option<f64> {
    let left = |factor: f64| {
        let mut case = case.clone();
        let left = multiply(&mut case, factor)
            .then(|| rows_of(&case))
            .flatten()
            .and_then(|rows| left_by(&*rows, BLOCKS));
        left.map(|(left, _)| (factor, left))
    };
    let all = GRID.iter().filter_map(|factor| left(*factor));
    all.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(factor, _)| factor)
}

/// Returns that the gyro's scale is off, with the factor that explains the recording best.
pub(super) fn fault(case: &Case) -> Option<Fault> {
    const KIND: &str = "scale of the gyro";
    if case.model.is_some() || case.recording.is_static {
        return None;
    }
    let tuned = Tuned {
        kind: KIND,
        what: KIND,
        remedy: "",
        start,
        units: &[1e-3],
        undo: |case, start: &f64, settings| {
            settings.first().is_some_and(|log| multiply(case, start * log.exp()))
        },
        is_possible: |_| true,
    };
    let (start, settings) = tuned.tune(case)?;
    let factor = start * settings.first()?.exp();
    let is_off = (LIMITS[0]..LIMITS[1]).contains(&factor) && factor.ln().abs() > NEAR;
    let what = format!("the gyro reads {:.3} times the angular rate", 1.0 / factor);
    let remedy = format!(
        "look at the range that its sensitivity belongs to, or give scale = {factor:.4} for its columns in \
         [recording] columns of the rig file"
    );
    is_off.then(|| Fault::new(KIND, what, remedy, move |case| multiply(case, factor)))
}
