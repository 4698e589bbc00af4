//! `demo --mass … --com … --inertia … --noise …`: a body and sensors of one's own in the simulated rig.

use clap::Args;
use hexapod::BodyParameters;
use rigident_sim::rig::RigConfig;

use crate::Failure;

/// Aluminium, kg/m³: a body without a stated tensor is a cube of it.
const ALUMINIUM: f64 = 2700.0;
const MASSES: &[(&str, f64)] = &[("kg", 1.0), ("g", 1e-3), ("lb", 0.453_592_37)];
const LENGTHS: &[(&str, f64)] = &[("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254)];
const TENSORS: &[(&str, f64)] =
    &[("kgcm2", 1e-4), ("kgmm2", 1e-6), ("gcm2", 1e-7), ("gmm2", 1e-9), ("kgm2", 1.0)];

/// The body on the load cell and the noise of the sensors, where they are not the thesis'.
#[derive(Args, Debug, Clone, Default)]
pub struct OwnBody {
    /// A body of your own: its mass, as 3, 3kg or 300g
    #[arg(long, value_name = "KG", conflicts_with = "body", value_parser = mass)]
    pub mass: Option<f64>,
    /// Its centre of mass in S, in m, or as 0,10,50mm. Default: half an edge of the cube above the load cell
    #[arg(long, value_name = "X,Y,Z", requires = "mass", allow_hyphen_values = true, value_parser = place)]
    pub com: Option<[f64; 3]>,
    /// Its tensor about the centre of mass: Ixx,Iyy,Izz or Ixx,Iyy,Izz,Iyz,Izx,Ixy in kg m², or as
    /// 60,50,40kgcm2. Default: that of a cube of aluminium
    #[arg(long, value_name = "TENSOR", requires = "mass", allow_hyphen_values = true, value_parser = tensor)]
    pub inertia: Option<[f64; 6]>,
    /// Multiply the noise of load cell and IMU by this
    #[arg(long, value_name = "FACTOR", conflicts_with = "ideal")]
    pub noise: Option<f64>,
}

impl OwnBody {
    /// Tells whether anything is not as it is by default.
    pub fn is_given(&self) -> bool {
        self.mass.is_some() || self.noise.is_some()
    }

    /// Puts them into the rig, and returns the body's name where it is one's own.
    ///
    /// # Errors
    /// Bad input: a body that cannot be, or that the platform cannot carry, or noise that is none.
    pub fn put_into(
        &self,
        mut config: RigConfig,
        bound: [f64; 2],
    ) -> Result<(RigConfig, Option<String>), Failure> {
        if let Some(factor) = self.noise {
            if !(factor.is_finite() && factor > 0.0) {
                let words = "a factor greater than zero; --ideal switches noise off";
                return Err(Failure::input(format!("--noise {factor}: {words}")));
            }
            let sensors = &mut config.sensors;
            sensors.load_cell.noise_n_nm = sensors.load_cell.noise_n_nm.map(|v| factor * v);
            sensors.imu.accel_noise_mps2 = sensors.imu.accel_noise_mps2.map(|v| factor * v);
            sensors.imu.gyro_noise_radps = sensors.imu.gyro_noise_radps.map(|v| factor * v);
        }
        let Some(mass_kg) = self.mass else { return Ok((config, None)) };
        let edge_m = (mass_kg / ALUMINIUM).cbrt();
        let of_cube = mass_kg * edge_m * edge_m / 6.0;
        let body = BodyParameters {
            mass_kg,
            com_m: self.com.unwrap_or([0.0, 0.0, 0.5 * edge_m]),
            inertia_com_kgm2: self.inertia.unwrap_or([of_cube, of_cube, of_cube, 0.0, 0.0, 0.0]),
        };
        if !body.is_possible() {
            return Err(Failure::input(
                "--inertia: no body has this tensor: each principal moment is above zero and none larger \
                 than the sum of the other two",
            ));
        }
        let [most_kg, within_m] = bound;
        let far_m = body.com_m.iter().map(|c| c * c).sum::<f64>().sqrt();
        if mass_kg > most_kg || far_m > within_m {
            return Err(Failure::input(format!(
                "--mass and --com: the simulated platform carries {most_kg} kg with its centre of mass \
                 within {within_m} m of the load cell's origin, and this is {mass_kg} kg at {far_m:.3} m"
            )));
        }
        Ok((config.with_body(body), Some(format!("a body of {mass_kg} kg"))))
    }
}

fn mass(text: &str) -> Result<f64, String> {
    let [mass] = measured(text, MASSES)?;
    if mass > 0.0 { Ok(mass) } else { Err("a mass is greater than zero".to_owned()) }
}

fn place(text: &str) -> Result<[f64; 3], String> {
    measured(text, LENGTHS)
}

fn tensor(text: &str) -> Result<[f64; 6], String> {
    if text.split(',').count() == 3 {
        let [xx, yy, zz] = measured(text, TENSORS)?;
        return Ok([xx, yy, zz, 0.0, 0.0, 0.0]);
    }
    measured(text, TENSORS)
}

/// Reads numbers with commas between them and perhaps one unit behind the last; returns them in SI.
fn measured<const N: usize>(text: &str, units: &[(&str, f64)]) -> Result<[f64; N], String> {
    let plain = text.replace([' ', '*', '·'], "").replace('²', "2");
    // The longest name that fits: the m of mm is none.
    let unit = units.iter().filter(|(name, _)| plain.ends_with(name)).max_by_key(|(name, _)| name.len());
    let (numbers, scale) = unit
        .map_or((plain.as_str(), 1.0), |(name, scale)| (plain.strip_suffix(name).unwrap_or(&plain), *scale));
    let all: Result<Vec<f64>, _> = numbers.split(',').map(|cell| cell.parse::<f64>()).collect();
    let all = all.ok().filter(|all| all.iter().all(|v| v.is_finite()));
    all.and_then(|all| all.try_into().ok()).map(|all: [f64; N]| all.map(|v| v * scale)).ok_or_else(|| {
        let names: Vec<&str> = units.iter().map(|(name, _)| *name).collect();
        format!("{N} numbers with commas between them, and perhaps a unit: {}", names.join(", "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_may_have_a_unit() {
        assert_eq!(place("0,10,50mm"), Ok([0.0, 0.01, 0.05]));
        assert_eq!(place("-0.1, 0, 0.2"), Ok([-0.1, 0.0, 0.2]));
        assert_eq!(mass("300g"), Ok(0.3));
        assert_eq!(mass("3"), Ok(3.0));
        assert_eq!(tensor("60,50,40kg cm²"), Ok([0.006, 0.005, 0.004, 0.0, 0.0, 0.0]));
        assert_eq!(tensor("1,1,1,0,0,0.1"), Ok([1.0, 1.0, 1.0, 0.0, 0.0, 0.1]));
        for wrong in ["1,2", "1,2,x", "1,2,3miles", "nan,0,0"] {
            assert!(place(wrong).is_err(), "{wrong}");
        }
        assert!(mass("-1").is_err() && mass("0").is_err());
    }

    #[test]
    fn a_body_that_cannot_be_or_is_too_heavy_is_refused() {
        let rig = RigConfig::thesis_horizontal;
        let of = |mass, inertia| OwnBody { mass: Some(mass), inertia, ..OwnBody::default() };
        let bound = [40.0, 0.5];
        let (config, name) = of(2.7, None).put_into(rig(), bound).unwrap();
        // A litre of aluminium is a cube of 0.1 m.
        assert!((config.body.com_m[2] - 0.05).abs() < 1e-12 && name.is_some());
        assert!((config.body.inertia_com_kgm2[0] - 2.7 * 0.01 / 6.0).abs() < 1e-12);
        assert!(of(1.0, Some([1.0, 1.0, 5.0, 0.0, 0.0, 0.0])).put_into(rig(), bound).is_err());
        assert!(of(50.0, None).put_into(rig(), bound).is_err());
        let loud = OwnBody { noise: Some(3.0), ..OwnBody::default() };
        let found = loud.put_into(rig(), bound).unwrap().0.sensors.load_cell.noise_n_nm[0];
        assert!((found / rig().sensors.load_cell.noise_n_nm[0] - 3.0).abs() < 1e-12);
    }
}
