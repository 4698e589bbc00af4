//! Zeros of force plates, from the time that nobody stands on them.

use super::ground::GroundWrench;

/// A plate's load is judged over stretches of this length, s.
const STRETCH_S: f64 = 0.05;
/// A load whose vertical force scatters by more within a stretch is a person's, N.
const QUIET_N: f64 = 3.0;
/// An unloaded plate is off by at most this much, N: a foot of somebody who sits rests on it with 40 N and
/// more.
const LARGEST_OFFSET_N: f64 = 30.0;
/// A foot on a plate rests on it with more than this, N.
const LIGHTEST_FOOT_N: f64 = 4.0;
/// Stretches belong to the unloaded plate if their mean is so near the quietest level, N.
const SAME_LEVEL_N: f64 = 4.0;
/// Least time without load, s.
const LEAST_S: f64 = 0.1;

/// Returns what a plate reads without load, N and N m about the laboratory's origin; `None` if it was always
/// loaded.
///
/// The unloaded level is the one nearest zero at which the vertical force rests, and no foot `is_on_it` at a
/// time, s: somebody who sits may rest her feet as lightly as a plate is off.
pub fn offset(plate: &GroundWrench, is_on_it: &dyn Fn(f64) -> bool) -> Option<[f64; 6]> {
    let length = ((STRETCH_S * plate.rate_hz) as usize).max(2);
    let middle_s = |k: usize| plate.first_s + (k as f64 + 0.5) * length as f64 / plate.rate_hz;
    let is_quiet = |(k, (mean, sd)): &(usize, ([f64; 6], f64))| {
        *sd < QUIET_N
            && mean[2].abs() < LARGEST_OFFSET_N
            && (mean[2].abs() < LIGHTEST_FOOT_N || !is_on_it(middle_s(*k)))
    };
    let all = plate.wrench.chunks_exact(length).enumerate().filter_map(|(k, own)| Some((k, level(own)?)));
    let stretches: Vec<([f64; 6], f64)> = all.filter(is_quiet).map(|(_, own)| own).collect();
    let quiet = stretches.iter();
    let nearest = quiet.clone().min_by(|a, b| a.0[2].abs().total_cmp(&b.0[2].abs()))?.0[2];
    let own: Vec<&[f64; 6]> =
        quiet.filter(|(mean, _)| (mean[2] - nearest).abs() < SAME_LEVEL_N).map(|(mean, _)| mean).collect();
    if ((own.len() * length) as f64) < LEAST_S * plate.rate_hz {
        return None;
    }
    Some(std::array::from_fn(|axis| {
        let mut values: Vec<f64> = own.iter().map(|mean| mean[axis]).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    }))
}

/// Returns the mean of a stretch and the scatter of its vertical force.
fn level(stretch: &[[f32; 6]]) -> Option<([f64; 6], f64)> {
    let count = stretch.len() as f64;
    let mean: [f64; 6] =
        std::array::from_fn(|axis| stretch.iter().map(|w| f64::from(w[axis])).sum::<f64>() / count);
    let square = stretch.iter().map(|w| (f64::from(w[2]) - mean[2]).powi(2)).sum::<f64>() / count;
    (mean.iter().all(|v| v.is_finite())).then_some((mean, square.sqrt()))
}

/// Returns by how much the vertical force of an unloaded plate is larger at the end of the recording than at
/// its beginning, N, where that is more than one zero can be; `None` if it is not, or the plate was unloaded
/// only once.
pub fn drift(plate: &GroundWrench, is_on_it: &dyn Fn(f64) -> bool) -> Option<f64> {
    let length = ((STRETCH_S * plate.rate_hz) as usize).max(2);
    let middle_s = |k: usize| plate.first_s + (k as f64 + 0.5) * length as f64 / plate.rate_hz;
    let is_free = |(k, own): (usize, &[[f32; 6]])| {
        level(own).filter(|(mean, _)| mean[2].abs() < LIGHTEST_FOOT_N || !is_on_it(middle_s(k)))
    };
    let stretches: Vec<Option<([f64; 6], f64)>> =
        plate.wrench.chunks_exact(length).enumerate().map(is_free).collect();
    let is_quiet = |own: &Option<([f64; 6], f64)>| {
        own.as_ref().is_some_and(|(mean, sd)| *sd < QUIET_N && mean[2].abs() < LARGEST_OFFSET_N)
    };
    // A time without load is several stretches at one level.
    let follows = |a: &Option<([f64; 6], f64)>, b: &Option<([f64; 6], f64)>| is_quiet(a) == is_quiet(b);
    let times = stretches.chunk_by(follows).filter(|own| is_quiet(&own[0]));
    let long = times.filter(|own| (own.len() * length) as f64 >= LEAST_S * plate.rate_hz);
    let levels: Vec<f64> = long
        .map(|own| {
            let mut values: Vec<f64> = own.iter().flatten().map(|(mean, _)| mean[2]).collect();
            values.sort_by(f64::total_cmp);
            values[values.len() / 2]
        })
        .collect();
    let drift = levels.last()? - levels.first()?;
    (drift.abs() > SAME_LEVEL_N).then_some(drift)
}

/// Holds 1 σ of each force's zero of a plate that was always loaded, N. It is assumed: 0.01 N/s of drift over
/// some minutes between the amplifiers' reset and a trial.
pub const UNKNOWN_ZERO_N: f64 = 5.0;
/// Holds 1 σ of the zero of each moment about the plate's middle, N m. The plate's sensors are about a
/// quarter of a metre from there.
pub const UNKNOWN_ZERO_NM: f64 = 0.25 * UNKNOWN_ZERO_N;

/// Returns the middle of a plate's surface, or, of one without corners, the mean centre of pressure at height
/// zero, m.
pub fn middle(plate: &GroundWrench) -> [f64; 3] {
    if let Some(corners) = plate.corners_m {
        return std::array::from_fn(|axis| corners.iter().map(|corner| corner[axis]).sum::<f64>() / 4.0);
    }
    pressed(plate)
}

/// Returns the mean centre of pressure at height zero, m.
pub fn pressed(plate: &GroundWrench) -> [f64; 3] {
    let finite = plate.wrench.iter().filter(|w| w.iter().all(|v| v.is_finite()));
    let sum = finite.fold([0.0; 3], |sum: [f64; 3], w| {
        [sum[0] + f64::from(w[2]), sum[1] + f64::from(w[3]), sum[2] + f64::from(w[4])]
    });
    if sum[0] > 0.0 { [-sum[2] / sum[0], sum[1] / sum[0], 0.0] } else { [0.0; 3] }
}

/// Takes an offset off a plate.
pub fn take_off(plate: &mut GroundWrench, offset: &[f64; 6]) {
    for wrench in &mut plate.wrench {
        for (value, offset) in wrench.iter_mut().zip(offset) {
            *value -= *offset as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate that is stepped on in the middle of three seconds, with a zero that moves by this much.
    fn plate(drift: f64) -> GroundWrench {
        let sample = |k: usize| {
            let load = if (100..200).contains(&k) { 700.0 + 50.0 * (0.3 * k as f64).sin() } else { 0.0 };
            [0.0, 0.0, (load + 8.0 + drift * k as f64 / 300.0) as f32, 0.0, 0.0, 0.0]
        };
        GroundWrench {
            name: "plate".to_owned(),
            corners_m: None,
            rate_hz: 100.0,
            first_s: 0.0,
            mean_s: 0.0,
            wrench: (0..300).map(sample).collect(),
        }
    }

    #[test]
    fn a_foot_of_somebody_who_sits_is_no_zero() {
        let mut seated = plate(0.0);
        seated.wrench.iter_mut().for_each(|wrench| wrench[2] += 42.0);
        assert_eq!(offset(&seated, &|_| false), None);
        // One who rests them as lightly as a plate is off is seen.
        let light = |time_s: f64| !(1.0..2.0).contains(&time_s);
        assert!(offset(&plate(0.0), &|_| false).is_some());
        assert_eq!(offset(&plate(0.0), &light), None);
        assert_eq!(drift(&plate(15.0), &|_| true), None);
    }

    #[test]
    fn a_zero_that_drifts_is_reported() {
        assert_eq!(drift(&plate(0.0), &|_| false), None);
        assert_eq!(drift(&plate(4.0), &|_| false), None);
        // From the middle of the first second to that of the last: two thirds.
        let found = drift(&plate(15.0), &|_| false).unwrap();
        assert!((found - 10.0).abs() < 0.5, "{found}");
        assert!((offset(&plate(0.0), &|_| false).unwrap()[2] - 8.0).abs() < 1e-3);
    }
}
