use hexapod::BodyParameters;
use hexapod::MotionProgram;
use hexapod::Mounting;
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};
use rigident_sim::rig::{ReadingRow, Readings, RigConfig, RigError};
use rigident_sim::sensors::SensorModels;

/// The body's ten and six offsets.
pub const PARAMETERS: usize = 16;
/// With six gains before them.
const JOINT: usize = 22;

type Wrench = SVector<f64, 6>;
type Block = SMatrix<f64, 6, 6>;
type Rows = SMatrix<f64, 6, JOINT>;

/// Returns the Cramér–Rao bound, a covariance, of `[m, mcx, mcy, mcz, Ixx, Iyy, Izz, Iyz, Izx, Ixy]` and the
/// six constant wrench offsets, SI: every sample of the load cell and of the IMU with its white noise, the
/// motion known through the IMU alone, the gain errors unknown but for their distribution. Nothing that has
/// seen the same samples and believes no more can do better.
///
/// `J⁻¹` with `J = aᵀ C⁻¹ a`, rows `a = [(A φ)_c at its gain; row c of A; 1 at its offset]` of all samples,
/// `1/σ_g²` added for each gain, the gains' rows and columns left out. C is the covariance of
/// `w + J_a a + J_ω g + J_α ġ`, noise of the load cell, the accelerometer and the gyro; with ġ as a central
/// difference it is banded and factorised as it comes. The columns of A are wrenches of unit bodies on this
/// motion by the simulator's own mechanics. `None` if the motion leaves something undetermined.
///
/// # Errors
/// A program that the platform cannot follow, or a rate that makes no sense.
pub fn bound(
    config: &RigConfig,
    program: &MotionProgram,
    rate_hz: f64,
) -> Result<Option<DMatrix<f64>>, RigError> {
    let columns = unit_wrenches(config, program, rate_hz)?;
    let truth = ideal(config, config.body, program, rate_hz)?;
    let cell = &config.sensors.load_cell;
    let mut whitened = Whitened::new(config, rate_hz);
    let mut information = SMatrix::<f64, JOINT, JOINT>::zeros();
    for (k, row) in truth.iter().enumerate() {
        let mut rows = Rows::zeros();
        for c in 0..6 {
            if cell.gain_error.spread[c] > 0.0 {
                rows[(c, c)] = row.wrench[c];
            }
            for (j, column) in columns.iter().enumerate() {
                rows[(c, 6 + j)] = column[k][c];
            }
            rows[(c, 16 + c)] = 1.0;
        }
        let Some(white) = whitened.next(&Vector3::from(row.angular_rate), rows) else { return Ok(None) };
        information += white.tr_mul(&white);
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

/// Whitens the rows of one sample after the other by the banded covariance of all noise.
struct Whitened {
    body: BodyParameters,
    lever_arm: Vector3<f64>,
    /// `Σ_w + σ_a² J_a J_aᵀ + 2 σ_g² Q Qᵀ`.
    constant: Block,
    /// `Q = J_α / 2T`: the gyro's noise of the samples after and before.
    slope: SMatrix<f64, 6, 3>,
    gyro_variance: f64,
    /// The two samples before, the last one first: diagonal block of the factor, that beside it, J_ω,
    /// whitened rows.
    before: Option<(Block, Block, SMatrix<f64, 6, 3>, Rows)>,
    earlier: Option<(Block, Rows)>,
}

impl Whitened {
    fn new(config: &RigConfig, rate_hz: f64) -> Self {
        let largest = |sigma: [f64; 3]| sigma.iter().copied().fold(0.0, f64::max);
        let (cell, imu) = (&config.sensors.load_cell, &config.sensors.imu);
        let lever_arm = Vector3::from(config.imu.position_m);
        let by = |of: &dyn Fn(&Vector3<f64>) -> Wrench| {
            SMatrix::<f64, 6, 3>::from_columns(&[of(&Vector3::x()), of(&Vector3::y()), of(&Vector3::z())])
        };
        let none = Vector3::zeros();
        let accelerated = by(&|a| wrench(&config.body, &lever_arm, a, &none, &none));
        let slope = by(&|alpha| wrench(&config.body, &lever_arm, &none, &none, alpha)) * (0.5 * rate_hz);
        let own = Wrench::from_fn(|c, _| cell.noise_n_nm[c].powi(2));
        let gyro_variance = largest(imu.gyro_noise_radps).powi(2);
        Self {
            body: config.body,
            lever_arm,
            constant: Block::from_diagonal(&own)
                + accelerated * accelerated.transpose() * largest(imu.accel_noise_mps2).powi(2)
                + slope * slope.transpose() * (2.0 * gyro_variance),
            slope,
            gyro_variance,
            before: None,
            earlier: None,
        }
    }

    /// Returns the rows of the next sample, whitened; `None` if the covariance is not positive definite.
    fn next(&mut self, rate: &Vector3<f64>, rows: Rows) -> Option<Rows> {
        let none = Vector3::zeros();
        // The wrench is quadratic in the rate: its derivative is half the difference of two.
        let turned = |axis: Vector3<f64>| {
            let of = |sign: f64| wrench(&self.body, &self.lever_arm, &none, &(rate + axis * sign), &none);
            (of(1.0) - of(-1.0)) * 0.5
        };
        let turning = SMatrix::<f64, 6, 3>::from_columns(&[
            turned(Vector3::x()),
            turned(Vector3::y()),
            turned(Vector3::z()),
        ]);
        let variance = self.gyro_variance;
        let mut diagonal = self.constant + turning * turning.transpose() * variance;
        let (mut beside, mut rest) = (Block::zeros(), rows);
        if let Some((own, its_beside, its_turning, its_rows)) = &self.before {
            let mut covariance =
                (turning * self.slope.transpose() - self.slope * its_turning.transpose()) * variance;
            if let Some((earlier, earlier_rows)) = &self.earlier {
                let two_back = right_solve(&(self.slope * self.slope.transpose() * -variance), earlier)?;
                covariance -= two_back * its_beside.transpose();
                diagonal -= two_back * two_back.transpose();
                rest -= two_back * earlier_rows;
            }
            beside = right_solve(&covariance, own)?;
            diagonal -= beside * beside.transpose();
            rest -= beside * its_rows;
        }
        let own = nalgebra::Cholesky::new(diagonal)?.l();
        let white = own.solve_lower_triangular(&rest)?;
        self.earlier = self.before.take().map(|(own, _, _, rows)| (own, rows));
        self.before = Some((own, beside, turning, white));
        Some(white)
    }
}

/// Returns `matrix L⁻ᵀ` of a lower triangle.
fn right_solve(matrix: &Block, lower: &Block) -> Option<Block> {
    Some(lower.solve_lower_triangular(&matrix.transpose())?.transpose())
}

/// Returns the wrench on the body about the load cell's origin, by Newton and Euler, from the readings of an
/// IMU at a lever arm.
fn wrench(
    body: &BodyParameters,
    lever_arm: &Vector3<f64>,
    specific_force: &Vector3<f64>,
    rate: &Vector3<f64>,
    acceleration: &Vector3<f64>,
) -> Wrench {
    let about = |at: &Vector3<f64>| acceleration.cross(at) + rate.cross(&rate.cross(at));
    let centre = Vector3::from(body.com_m);
    let force = (specific_force - about(lever_arm) + about(&centre)) * body.mass_kg;
    let [xx, yy, zz, yz, zx, xy] = body.inertia_com_kgm2;
    let inertia = Matrix3::new(xx, xy, zx, xy, yy, yz, zx, yz, zz);
    let moment = inertia * acceleration + rate.cross(&(inertia * rate)) + centre.cross(&force);
    Wrench::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}

/// Returns the true wrenches on `body` along the motion, N and N m in S.
fn wrenches(
    config: &RigConfig,
    body: BodyParameters,
    program: &MotionProgram,
    rate_hz: f64,
) -> Result<Vec<[f64; 6]>, RigError> {
    Ok(ideal(config, body, program, rate_hz)?.iter().map(|row| row.wrench).collect())
}

/// Returns what ideal sensors read of `body` along the motion, the IMU at the load cell's origin.
fn ideal(
    config: &RigConfig,
    body: BodyParameters,
    program: &MotionProgram,
    rate_hz: f64,
) -> Result<Vec<ReadingRow>, RigError> {
    let config = RigConfig { imu: Mounting::IDENTITY, ..config.clone() };
    let config = config.with_body(body).with_sensors(SensorModels::ideal());
    Ok(Readings::new(&config, program, rate_hz)?.ideal().to_vec())
}

/// Returns the linear map from the ten parameters to the wrench, column by column. A first moment is a unit
/// mass at a unit distance less what else that is: a mass, and two moments of inertia about the origin.
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
    use rigident_fit::Estimate;
    use rigident_identify::answer::derived;

    /// Independently computed figures for a body of 20 kg on a motion of 30 s at 200 Hz, ±0.5 rad of roll,
    /// pitch and yaw at 0.23, 0.31 and 0.41 Hz with soft ends, unknown offsets, Table 1's noise: mass 14.6 g,
    /// centre of mass 0.10, 0.10, 0.09 mm, tensor about it 1.12, 1.16, 0.72, 0.59, 0.54, 0.79 % of its
    /// largest element.
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
        let mut got = vec![1e3 * estimate.unjudged().covariance[(0, 0)].sqrt()];
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
