//! The load of the plate, as far as anything is known of it before it has been identified.
//!
//! Nothing is guessed: a rig file, or options, say how heavy the body may be and how far from the load cell a
//! part of it may be; the load cell at rest says how heavy it is and where across the vertical its centre of
//! mass lies, as well as its offset is known. `[truth]` has no part in it.

use hexapod::{Bodies, BodyParameters, BodySet, Limits, Load, Pose};
use nalgebra::{Matrix3, Vector3};

use super::machine::{self, MachineError};
use rigident_io::rig::{OffsetTable, RigFile, WRENCH_CHANNELS};

/// The offset of a channel is within this share of its range unless the rig file says otherwise: twice what
/// data sheets of multi-axis load cells give as zero balance.
const OFFSET_SHARE: f64 = 0.01;
/// Standard deviations of its noise within which the offset of a channel is, where that is the coarser.
const OFFSET_SD: f64 = 3.0;
/// A load cell without a stated range: the same as a share of what it reads.
const OFFSET_OF_READING: f64 = 0.02;
/// The largest share of its range that a channel may take at rest: a motion needs the remainder.
const MOST_AT_REST: f64 = 0.9;

/// The reason why nothing can be said of what the plate carries, or no motion is safe.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CarriedError {
    /// Forces are limited, and nothing bounds them.
    #[error(
        "{limited} is limited, and nothing says what the plate may carry: give [platform] load_max_kg and \
         load_within_m in the rig file (or `load_max_kg` and `load_within_m`): the heaviest body that is put \
         on it, and how far from the load cell's origin a part of it may be"
    )]
    NoBound {
        /// The quantity that has a limit, in words.
        limited: &'static str,
    },
    /// More than is ever put on it.
    #[error(
        "the load cell carries {least:.2} kg at least, and load_max_kg says {bound} kg at most: one of the \
         two is wrong, or the load cell's sign, its calibration or offset_within_n_nm"
    )]
    Heavier {
        /// The reading less all that its offset may be, kg.
        least: f64,
        /// The mass stated, kg.
        bound: f64,
    },
    /// Farther out than any part of it is said to be.
    #[error(
        "the centre of mass lies {least:.3} m at least from the vertical through the load cell's origin, and \
         load_within_m says that no part of the body is farther away than {bound} m"
    )]
    Farther {
        /// m.
        least: f64,
        /// The distance stated, m.
        bound: f64,
    },
    /// A range that is used up at rest.
    #[error(
        "the load cell's {channel} reads {value:.1} of {range:.1} {unit} at rest: the motion would overload \
         it. Take a larger load cell, a lighter body, or mount it nearer to the load cell's axis"
    )]
    Overloaded {
        /// The channel of the wrench.
        channel: &'static str,
        /// N or N m.
        value: f64,
        /// The channel's range, N or N m.
        range: f64,
        /// The unit of both.
        unit: &'static str,
    },
    /// No material is so dense.
    #[error(
        "the load cell carries {least:.2} kg, and load_within_m = {within} m leaves them a ball of \
         {density:.0} kg/m³, denser than any material: no part of the body is farther from the load cell's \
         origin than load_within_m"
    )]
    Denser {
        /// kg.
        least: f64,
        /// m.
        within: f64,
        /// kg/m³.
        density: f64,
    },
    /// The error in the rig file's statements about the machine.
    #[error(transparent)]
    Machine(#[from] MachineError),
}

/// The mass that the body may have, and the distance that a part of it may have from the load cell's origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadBound {
    /// kg.
    pub mass_kg: f64,
    /// m.
    pub within_m: f64,
}

impl LoadBound {
    /// Returns the bound of a rig file; `None` if it lacks either of them. Its heaviest body may be left out
    /// where the load cell's range is known: it cannot weigh more than that.
    pub fn of(rig: &RigFile) -> Option<Self> {
        let table = rig.platform.as_ref()?;
        let of_range = || {
            let [x, y, z, ..] = rig.load_cell.range_n_nm?;
            Some(Vector3::new(x, y, z).norm() / rig.recording.gravity_mps2)
        };
        let mass_kg = table.load_max_kg.or_else(of_range)?;
        Some(Self { mass_kg, within_m: table.load_within_m? })
    }

    /// Returns a ball of that mass and size about the load cell's origin, in S.
    pub fn ball(&self) -> BodyParameters {
        let moment = 0.4 * self.mass_kg * self.within_m * self.within_m;
        BodyParameters {
            mass_kg: self.mass_kg,
            com_m: [0.0; 3],
            inertia_com_kgm2: [moment, moment, moment, 0.0, 0.0, 0.0],
        }
    }

    /// Returns the set of bodies that it allows, in S.
    pub fn set(&self) -> BodySet {
        BodySet::bounded(self.mass_kg, [0.0; 3], self.within_m)
    }
}

/// Density of osmium, kg/m³.
const DENSEST: f64 = 22_600.0;

/// The load cell at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighing {
    /// Mean wrench on the body, S, N and N m.
    pub wrench: [f64; 6],
    /// Noise of a reading, 1 σ, and of the mean.
    pub sigma: [f64; 6],
    /// The number of readings that it is the mean of.
    pub readings: usize,
    /// "Up" in S.
    pub up: [f64; 3],
}

impl Weighing {
    /// Returns what it may be that the load cell carries, in S: within `bound`, and as heavy as it weighs.
    ///
    /// # Errors
    /// It contradicts the bound, or uses up the range.
    pub fn set(&self, rig: &RigFile, bound: &LoadBound) -> Result<BodySet, CarriedError> {
        let range = rig.load_cell.range_n_nm.unwrap_or([f64::INFINITY; 6]);
        for (k, (channel, unit)) in WRENCH_CHANNELS.into_iter().enumerate() {
            if self.wrench[k].abs() > MOST_AT_REST * range[k] {
                return Err(CarriedError::Overloaded {
                    channel,
                    value: self.wrench[k],
                    range: range[k],
                    unit,
                });
            }
        }
        let (offset, within) = self.offset(rig);
        let wrench: [f64; 6] = std::array::from_fn(|k| self.wrench[k] - offset[k]);
        let [force, moment] = [0, 3].map(|k| Vector3::new(wrench[k], wrench[k + 1], wrench[k + 2]));
        let [force_within, moment_within] =
            [0, 3].map(|k| Vector3::new(within[k], within[k + 1], within[k + 2]));
        let (up, g) = (Vector3::from(self.up).normalize(), rig.recording.gravity_mps2);
        let mass = force.dot(&up) / g;
        let spread = force_within.dot(&up.abs()) / g;
        // M = mc × g up, so that up × M / g is mc across the vertical.
        let (across, lever_spread) = (up.cross(&moment) / g, moment_within.norm() / g);
        let (least, most) = ((mass - spread).max(0.0), (mass + spread).min(bound.mass_kg));
        if least > bound.mass_kg {
            return Err(CarriedError::Heavier { least, bound: bound.mass_kg });
        }
        let density = least / (4.0 / 3.0 * std::f64::consts::PI * bound.within_m.powi(3));
        if density > DENSEST {
            return Err(CarriedError::Denser { least, within: bound.within_m, density });
        }
        let most = most.max(least);
        let out = (across.norm() - lever_spread).max(0.0);
        if out > most * bound.within_m {
            return Err(CarriedError::Farther { least: out / most, bound: bound.within_m });
        }
        Ok(BodySet::weighed(
            0.5 * (least + most),
            0.5 * (most - least),
            across.into(),
            lever_spread,
            up.into(),
            bound.within_m,
        ))
    }

    /// Returns the offset as far as it is known, and the distance from that at which it may be, the mean's
    /// noise included.
    fn offset(&self, rig: &RigFile) -> ([f64; 6], [f64; 6]) {
        let mean = self.sigma.map(|s| OFFSET_SD * s / (self.readings.max(1) as f64).sqrt());
        if let OffsetTable::Known(known) = &rig.load_cell.offset_n_nm {
            return (*known, mean);
        }
        let within = std::array::from_fn(|k| {
            let stated = rig.load_cell.offset_within_n_nm.map(|within| within[k]);
            let group = if k < 3 { &self.wrench[..3] } else { &self.wrench[3..] };
            let read = group.iter().map(|v| v * v).sum::<f64>().sqrt();
            let usual = match rig.load_cell.range_n_nm {
                Some(range) => OFFSET_SHARE * range[k],
                None => OFFSET_OF_READING * read,
            };
            stated.unwrap_or_else(|| usual.max(OFFSET_SD * self.sigma[k])) + mean[k]
        });
        ([0.0; 6], within)
    }
}

/// Returns what has a limit that only a body can reach, in words; `None` if nothing has.
pub fn limited(limits: &Limits, wrench_range_n_nm: &[f64; 6]) -> Option<&'static str> {
    if let Some(key) = limits.of_force() {
        Some(match key {
            "leg_push_n" => "the pushing force of the legs (leg_push_n)",
            "leg_pull_n" => "the pulling force of the legs (leg_pull_n)",
            "leg_buckling_nm2" => "the force at which the legs buckle (leg_buckling_nm2)",
            _ => "the force of the legs (leg_force_n)",
        })
    } else if wrench_range_n_nm.iter().any(|r| r.is_finite()) {
        Some("the load cell's range (range_n_nm)")
    } else {
        None
    }
}

/// Mountings are not more exact than so, rad, nor are bases more level: a plate that is tilted otherwise by
/// more is not where its platform says.
pub const LEVEL_RAD: f64 = 0.09;

/// Returns the angle between "up" in the plate's axes and that of a plate at a pose over a level base, rad.
pub fn off_level_rad(up: &Vector3<f64>, stands: &Pose) -> f64 {
    // Up in the plate's axes is the last row of its rotation.
    let expected = Vector3::from(stands.rotation()[2]);
    up.cross(&expected).norm().atan2(up.dot(&expected))
}

/// Returns what the legs carry: the parts that the rig file names, and one of a set of bodies on the load
/// cell (S).
///
/// # Errors
/// A rotation of the load cell that is none.
pub fn load(rig: &RigFile, body: &BodySet) -> Result<Load, MachineError> {
    let (at, rotation) = machine::load_cell(rig)?;
    Ok(Load {
        bodies: Bodies::Within {
            known: machine::parts(rig.platform.as_ref()),
            body: body.in_frame(&at, &rotation),
        },
        gravity_mps2: [0.0, 0.0, -rig.recording.gravity_mps2],
    })
}

/// Returns "up" in S as the IMU feels it at rest; `None` if it feels nothing.
pub fn up_of(specific_force_in_s: Vector3<f64>) -> Option<[f64; 3]> {
    let norm = specific_force_in_s.norm();
    (norm > 1.0).then(|| (specific_force_in_s / norm).into())
}

/// Returns "up" in S where the plate is level.
///
/// # Errors
/// A rotation of the load cell that is none.
pub fn up_when_level(rig: &RigFile) -> Result<[f64; 3], MachineError> {
    let (_, rotation): (_, Matrix3<f64>) = machine::load_cell(rig)?;
    Ok(rotation.tr_mul(&Vector3::z()).into())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[load_cell]\nrange_n_nm = [660, 660, 1980, 60, 60, 60]\nnoise_n_nm = [5, 5, 10, 0.4, \
                        0.4, 0.4]\n\
                        [platform]\nload_max_kg = 40\nload_within_m = 0.4\n";

    fn weighed(body: &BodyParameters, up: [f64; 3], more: &str) -> Result<BodySet, CarriedError> {
        let rig = RigFile::parse(&format!("{TEXT}{more}")).unwrap();
        let g = rig.recording.gravity_mps2;
        let force = Vector3::from(up) * body.mass_kg * g;
        let moment = Vector3::from(body.com_m).cross(&force);
        let wrench = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
        let sigma = rig.load_cell.noise_n_nm.unwrap();
        Weighing { wrench, sigma, readings: 400, up }.set(&rig, &LoadBound::of(&rig).unwrap())
    }

    #[test]
    fn a_body_on_the_load_cell_is_among_those_it_may_be_however_the_cell_lies() {
        let body = BodyParameters {
            mass_kg: 20.0,
            com_m: [0.05, -0.02, 0.1],
            inertia_com_kgm2: [0.5, 0.4, 0.3, 0.0, 0.01, 0.0],
        };
        for up in [[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [-1.0, 0.0, 0.0]] {
            let set = weighed(&body, up, "").unwrap();
            assert!(set.may_hold(&body), "{up:?} {set:?}");
            // Noise of three parts in a hundred: 30 N of the vertical, 1.2 N m.
            assert!(!set.may_hold(&BodyParameters { mass_kg: 30.0, ..body }));
        }
    }

    #[test]
    fn a_bound_that_the_scale_contradicts_is_named() {
        let body = BodyParameters { mass_kg: 50.0, com_m: [0.0; 3], inertia_com_kgm2: [1.0; 6] };
        let heavier = weighed(&body, [0.0, 0.0, 1.0], "").unwrap_err();
        assert!(matches!(heavier, CarriedError::Heavier { bound: 40.0, .. }), "{heavier}");
        let out = BodyParameters { mass_kg: 5.0, com_m: [0.8, 0.0, 0.0], ..body };
        let farther = weighed(&out, [0.0, 0.0, 1.0], "").unwrap_err();
        assert!(matches!(farther, CarriedError::Farther { bound: 0.4, .. }), "{farther}");
        let over = BodyParameters { mass_kg: 20.0, com_m: [0.3, 0.0, 0.0], ..body };
        let error = weighed(&over, [0.0, 0.0, 1.0], "").unwrap_err();
        assert!(matches!(error, CarriedError::Overloaded { channel: "My", .. }), "{error}");
        // 20 kg of steel are a ball of 85 mm.
        let steel = BodyParameters { mass_kg: 20.0, ..body };
        let on = |within_m: f64| {
            let g = 9.80665;
            let rig = RigFile::parse(TEXT).unwrap();
            let wrench = [0.0, 0.0, steel.mass_kg * g, 0.0, 0.0, 0.0];
            let sigma = rig.load_cell.noise_n_nm.unwrap();
            let bound = LoadBound { mass_kg: 40.0, within_m };
            Weighing { wrench, sigma, readings: 400, up: [0.0, 0.0, 1.0] }.set(&rig, &bound)
        };
        assert!(on(0.085).is_ok());
        let denser = on(0.02).unwrap_err();
        assert!(matches!(denser, CarriedError::Denser { within: 0.02, .. }), "{denser}");
    }

    #[test]
    fn a_light_body_may_weigh_nothing_and_a_rig_without_a_bound_has_none() {
        let body = BodyParameters { mass_kg: 0.5, com_m: [0.0; 3], inertia_com_kgm2: [0.01; 6] };
        let [mass, ..] = weighed(&body, [0.0, 0.0, 1.0], "").unwrap().moments();
        assert!((0.5..4.5).contains(&mass), "{mass}");
        let rig = |text: &str| LoadBound::of(&RigFile::parse(text).unwrap());
        assert_eq!(rig("[platform]\nload_max_kg = 40\n"), None);
        assert_eq!(rig("[platform]\nload_within_m = 0.4\n"), None);
        let [mass, within] = rig(TEXT).map(|b| [b.mass_kg, b.within_m]).unwrap();
        assert_eq!([mass, within], [40.0, 0.4]);
    }
}
