//! IMUs and load cell: calibrated readings, the motion of the base, what is at the limit of its range.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use rigident_shared::calibration::GaugeCalibration;
use rigident_shared::tree::BaseMotion;

use super::{Gravity, Preparation};
use crate::tree::TreePrepareError;
use crate::tree::joints::attitude;
use rigident_io::rig::{Calibrated, DOWN, ImuTable};

impl<'a> Preparation<'a> {
    /// Returns the table of the IMU on a link, by the link's number.
    pub(super) fn imu(&self, number: usize) -> Option<&'a ImuTable> {
        self.recording.rig.imu_on(number)
    }

    /// Rates of links by index, link axes.
    pub(super) fn gyros(
        &self,
        numbering: &[Option<usize>],
    ) -> Result<BTreeMap<usize, Vec<Vector3<f64>>>, TreePrepareError> {
        let mut gyros = BTreeMap::new();
        for (j, imu) in self.recording.imus.iter().enumerate() {
            let (Some(gyro), Some(Some(i))) = (&imu.gyro, numbering.get(j)) else { continue };
            let default = ImuTable { link: j, ..ImuTable::default() };
            let table = self.imu(j).unwrap_or(&default);
            let Calibrated::Numbers(bias) = table.gyro_bias_radps else { return Err(self.uncalibrated(j)) };
            let rotation = attitude(&table.rotation_wxyz).unwrap_or_else(Matrix3::identity);
            let rates = gyro.iter().map(|g| rotation * (Vector3::from(*g) - Vector3::from(bias)));
            gyros.insert(*i, rates.collect());
        }
        Ok(gyros)
    }

    pub(super) fn uncalibrated(&self, j: usize) -> TreePrepareError {
        TreePrepareError::Unsupported(format!(
            "{}: [[imu]] of link {j} is to be calibrated \"from_poses\", which is done for a single body \
             only: identify the base link alone on still poses first and put the numbers into the rig file",
            self.recording.name
        ))
    }

    pub(super) fn wrench(&self) -> Result<Option<Vec<[f64; 6]>>, TreePrepareError> {
        match (&self.recording.wrench, &self.recording.gauges, self.recording.rig.load_cell.calibration) {
            (Some(wrench), _, _) => Ok(Some(wrench.clone())),
            (None, Some(gauges), Some(matrix)) => {
                let calibration = GaugeCalibration { matrix };
                Ok(Some(gauges.iter().map(|g| calibration.wrench(g).array()).collect()))
            }
            (None, Some(_), None) => Err(self.missing(
                "[load_cell] calibration is",
                "raw gauges need the 6x6 matrix to N and N m in the rig file",
            )),
            (None, None, _) => Ok(None),
        }
    }

    /// Returns the base's motion by row.
    pub(super) fn base(
        &mut self,
        gyro: Option<&Vec<Vector3<f64>>>,
    ) -> Result<impl Fn(usize) -> BaseMotion<f64> + 'static, TreePrepareError> {
        let recording = self.recording;
        let accel = recording.imus.first().and_then(|i| i.accel.as_ref());
        let gravity = recording.gravity.as_ref();
        let motions: Vec<BaseMotion<f64>> = match (accel, gyro, gravity) {
            (Some(accel), gyro, _) => {
                if gyro.is_none() && !recording.is_static {
                    return Err(self.missing(
                        "the angular rate imu_gx_radps … of the base link is",
                        "a moving base needs a gyro beside its accelerometer; of a base held still leave \
                         both out",
                    ));
                }
                let default = ImuTable::default();
                let table = self.imu(0).unwrap_or(&default);
                let (Calibrated::Numbers(scale), Calibrated::Numbers(bias)) =
                    (table.accel_scale, table.accel_bias_mps2)
                else {
                    return Err(self.uncalibrated(0));
                };
                let rotation = attitude(&table.rotation_wxyz).unwrap_or_else(Matrix3::identity);
                let rate = |row: usize| match gyro {
                    Some(gyro) if !recording.is_static => gyro[row],
                    _ => Vector3::zeros(),
                };
                let force = accel.iter().map(|a| {
                    rotation * (Vector3::from(*a).component_mul(&Vector3::from(scale)) - Vector3::from(bias))
                });
                force
                    .enumerate()
                    .map(|(row, specific_force)| BaseMotion {
                        specific_force,
                        rate: rate(row),
                        angular_acceleration: Vector3::zeros(),
                    })
                    .collect()
            }
            (None, Some(_), _) => {
                return Err(self.missing(
                    "the specific force imu_ax_mps2 … of the base link is",
                    "a moving base needs an accelerometer beside its gyro; of a base held still leave both \
                     out",
                ));
            }
            (None, None, Some(gravity)) => gravity.iter().map(|g| BaseMotion::still(*g)).collect(),
            (None, None, None) => {
                let Gravity { mps2: g, direction: down, stated } = Gravity::of(recording, self.original);
                let along = if down == DOWN { "−z".to_owned() } else { format!("{down:?}") };
                self.notes.push(format!(
                    "there is no IMU on the base link: it is taken to be held still, gravity {g} m/s² along \
                     {along} of its frame{stated}"
                ));
                // The model was turned.
                vec![BaseMotion::still([0.0, 0.0, -g])]
            }
        };
        if accel.is_none() && gravity.is_some() {
            let down = |m: &BaseMotion<f64>| {
                let a = m.specific_force;
                a.x.hypot(a.y) > 1e-3 * a.norm()
            };
            if motions.iter().any(down) {
                return Err(self.misfit(
                    "its gravity columns are not along −z of the base's frame, where a base held still has \
                     gravity: turn the model's base, or give the base an IMU"
                        .to_owned(),
                ));
            }
        }
        Ok(move |row: usize| {
            motions.get(row).or(motions.last()).copied().unwrap_or(BaseMotion::still([0.0; 3]))
        })
    }

    pub(super) fn saturated(&self, row: usize) -> bool {
        let rig = &self.recording.rig;
        let beyond = |value: f64, range: f64| value.abs() >= range;
        let wrench =
            self.recording.wrench.as_ref().zip(rig.load_cell.range_n_nm).is_some_and(|(w, range)| {
                w.get(row).is_some_and(|w| w.iter().zip(range).any(|(v, r)| beyond(*v, r)))
            });
        let imus = self.recording.imus.iter().enumerate().any(|(j, imu)| {
            let Some(table) = rig.imu_on(j) else { return false };
            let over = |rows: &Option<Vec<[f64; 3]>>, range: Option<f64>| {
                rows.as_ref().zip(range).is_some_and(|(rows, range)| {
                    rows.get(row).is_some_and(|v| v.iter().any(|v| beyond(*v, range)))
                })
            };
            over(&imu.accel, table.range_mps2) || over(&imu.gyro, table.range_radps)
        });
        wrench || imus
    }
}
