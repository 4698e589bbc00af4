use hexapod::BodyParameters;
use hexapod::MotionProgram;
use hexapod::Mounting;
use nalgebra::{DMatrix, SMatrix, SVector};
use rigident_sim::rig::{Readings, RigConfig, RigError};
use rigident_sim::sensors::SensorModels;

/// The body's ten and six offsets.
pub const PARAMETERS: usize = 16;
/// With six gains before them.
const JOINT: usize = 22;

/// The Cramér–Rao bound, a covariance, of `[m, mcx, mcy, mcz, Ixx, Iyy, Izz, Iyz, Izx, Ixy]` and the six constant
/// wrench offsets, SI: every sample of the load cell with its white noise, the motion known exactly, the gain errors
/// unknown but for their distribution. Nothing that has seen the same samples and believes no more can do better.
///
/// `J⁻¹` with `J = Σ aᵀa/σ²`, rows `a = [(A φ)_c at its gain; row c of A; 1 at its offset]`, `1/σ_g²` added for each
/// gain, the gains' rows and columns left out. The columns of A are wrenches of unit bodies on this motion by the
/// simulator's own mechanics. `None` if the motion leaves something undetermined.
///
/// # Errors
/// A program that the platform cannot follow, or a rate that makes no sense.
pub fn bound(
    config: &RigConfig,
    program: &MotionProgram,
    rate_hz: f64,
) -> Result<Option<DMatrix<f64>>, RigError> {
    let columns = unit_wrenches(config, program, rate_hz)?;
    let truth = wrenches(config, config.body, program, rate_hz)?;
    let cell = &config.sensors.load_cell;
    let mut information = SMatrix::<f64, JOINT, JOINT>::zeros();
    for (k, wrench) in truth.iter().enumerate() {
        for c in 0..6 {
            let mut row = SVector::<f64, JOINT>::zeros();
            if cell.gain_error.spread[c] > 0.0 {
                row[c] = wrench[c];
            }
            for (j, column) in columns.iter().enumerate() {
                row[6 + j] = column[k][c];
            }
            row[16 + c] = 1.0;
            information.ger(cell.noise_n_nm[c].powi(-2), &row, &row, 1.0);
        }
    }
    for (c, spread) in cell.gain_error.spread.iter().enumerate() {
        information[(c, c)] += if *spread > 0.0 { spread.powi(-2) } else { 1.0 };
    }
    // Units differ by orders of magnitude: a unit diagonal leaves the inverse its digits.
    let scale = information.diagonal().map(|d| 1.0 / d.sqrt());
    let scaled = SMatrix::<f64, JOINT, JOINT>::from_fn(|i, j| information[(i, j)] * scale[i] * scale[j]);
    let Some(cholesky) = nalgebra::Cholesky::new(scaled) else { return Ok(None) };
    let inverse = cholesky.inverse();
    let entry = |i: usize, j: usize| inverse[(6 + i, 6 + j)] * scale[6 + i] * scale[6 + j];
    Ok(Some(DMatrix::from_fn(PARAMETERS, PARAMETERS, entry)))
}

/// True wrenches on `body` along the motion, N and N m in S.
fn wrenches(
    config: &RigConfig,
    body: BodyParameters,
    program: &MotionProgram,
    rate_hz: f64,
) -> Result<Vec<[f64; 6]>, RigError> {
    let config = RigConfig { imu: Mounting::IDENTITY, ..config.clone() };
    let config = config.with_body(body).with_sensors(SensorModels::ideal());
    Ok(Readings::new(&config, program, rate_hz)?.ideal().iter().map(|row| row.wrench).collect())
}

/// The linear map from the ten parameters to the wrench, column by column. A first moment is a unit mass at a unit
/// distance less what else that is: a mass, and two moments of inertia about the origin.
fn unit_wrenches(
    config: &RigConfig,
    program: &MotionProgram,
    rate_hz: f64,
) -> Result<Vec<Vec<[f64; 6]>>, RigError> {
    let of = |mass_kg, com_m, inertia_com_kgm2| {
        wrenches(config, BodyParameters { mass_kg, com_m, inertia_com_kgm2 }, program, rate_hz)
    };
    let unit = |i: usize| -> [f64; 6] { std::array::from_fn(|k| if k == i { 1.0 } else { 0.0 }) };
    let mass = of(1.0, [0.0; 3], [0.0; 6])?;
    let inertia = (0..6).map(|i| of(0.0, [0.0; 3], unit(i))).collect::<Result<Vec<_>, _>>()?;
    let mut columns = vec![mass.clone()];
    for axis in 0..3 {
        let mut column = of(1.0, std::array::from_fn(|k| if k == axis { 1.0 } else { 0.0 }), [0.0; 6])?;
        for (k, row) in column.iter_mut().enumerate() {
            for (i, w) in row.iter_mut().enumerate() {
                *w -= mass[k][i] + inertia[(axis + 1) % 3][k][i] + inertia[(axis + 2) % 3][k][i];
            }
        }
        columns.push(column);
    }
    columns.extend(inertia);
    Ok(columns)
}

#[cfg(test)]
mod tests {
    use hexapod::{Axis, Segment, SineTerm};

    use super::*;
    use crate::answer::derived;
    use crate::fit::Estimate;

    /// Independently computed figures for a body of 20 kg on a motion of 30 s at 200 Hz, ±0.5 rad of roll, pitch and yaw
    /// at 0.23, 0.31 and 0.41 Hz with soft ends, unknown offsets, Table 1's noise: mass 14.6 g, centre of mass 0.10, 0.10, 0.09 mm,
    /// tensor about it 1.12, 1.16, 0.72, 0.59, 0.54, 0.79 % of its largest element.
    #[test]
    fn the_bound_is_the_published_one_of_a_published_motion() {
        let mut config = RigConfig::thesis_horizontal();
        // The motion alone matters: legs that reach it.
        let home = config.geometry.home();
        config.geometry.leg_length_m = [0.1, 2.0];
        config.geometry.leg_rate_mps = 10.0;
        let term = |axis, frequency_hz| SineTerm { axis, amplitude: 0.5, frequency_hz, phase_rad: 0.0 };
        let program = MotionProgram {
            start: home,
            segments: vec![Segment::Multisine {
                duration_s: 30.0,
                ramp_s: 2.0,
                terms: vec![term(Axis::Roll, 0.23), term(Axis::Pitch, 0.31), term(Axis::Yaw, 0.41)],
            }],
        };
        let covariance = bound(&config, &program, 200.0).unwrap().unwrap();
        let phi = config.body.parameters().to_vec();
        let estimate = Estimate::of_bound(phi, covariance);
        let mut got = vec![1e3 * estimate.covariance[(0, 0)].sqrt()];
        got.extend(derived::centre_of_mass(&estimate).sd.map(|sd| 1e3 * sd));
        got.extend(derived::inertia_com(&estimate).sd.map(|sd| 100.0 * sd / 0.3813));
        // Half a unit of the last printed digit; 2 % for phases and ramp, which are not printed.
        let published: [(f64, f64); 10] = [
            (14.6, 0.05),
            (0.10, 0.005),
            (0.10, 0.005),
            (0.09, 0.005),
            (1.12, 0.005),
            (1.16, 0.005),
            (0.72, 0.005),
            (0.59, 0.005),
            (0.54, 0.005),
            (0.79, 0.005),
        ];
        for (got, (published, digit)) in got.iter().zip(published) {
            assert!((got - published).abs() < digit + 0.02 * published, "{got} {published}");
        }
    }
}
