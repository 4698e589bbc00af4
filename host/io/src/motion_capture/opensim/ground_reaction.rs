//! Wrenches of the ground as columns of a MOT file: force, centre of pressure and free moment of every plate
//! or belt.

use std::io::BufRead;

use nalgebra::Vector3;

use super::error::OpenSimError;
use super::storage::Rows;
use crate::motion_capture::ground::{GroundWrench, Means};

/// Below this force a centre of pressure means nothing, and the plate counts as not loaded, N.
const LOADED_N: f64 = 1.0;

/// The columns of a plate or belt.
struct Columns {
    name: String,
    force: [usize; 3],
    point: [usize; 3],
    moment: Option<[usize; 3]>,
}

/// Returns the wrenches about the laboratory's origin, in the file's axes, beside the given number of frames
/// of markers, at the given rate.
///
/// Columns are `…vx, …vy, …vz` (N, on the person), `…px, …py, …pz` (m) and the free moment at that point,
/// `…torque…x` or `…mx` (N m): the names before `v` say which belong together. What is missing of the free
/// moment is zero.
///
/// # Errors
/// There are no forces, or a force has no centre of pressure.
pub fn ground_wrenches(
    mut rows: Rows<impl BufRead>,
    frames: usize,
    frames_hz: f64,
) -> Result<Vec<GroundWrench>, OpenSimError> {
    let stems: Vec<&str> = rows.columns.iter().filter_map(|c| c.strip_suffix("vx")).collect();
    if stems.is_empty() {
        return Err(OpenSimError::Missing(
            "no column ends in vx: forces of the ground are named like ground_force_vx, _vy, _vz, _px, _py, \
             _pz"
            .to_owned(),
        ));
    }
    // Which of two columns of one name belongs to which plate is not known.
    let twice = rows.columns.iter().enumerate().find(|(k, name)| rows.columns[..*k].contains(name));
    if let Some((_, name)) = twice {
        return Err(OpenSimError::Missing(format!(
            "two columns are called {name}: which plate each belongs to is not known; give every plate names \
             of its own, like 1_ground_force_vx"
        )));
    }
    let plates: Vec<Columns> =
        stems.iter().map(|stem| Columns::of(&rows.columns, stem)).collect::<Result<_, _>>()?;
    // The first two rows tell how many are taken together.
    let mut begin: Vec<(f64, Vec<[f64; 6]>)> = Vec::new();
    let mut means: Vec<Means> = Vec::new();
    let (mut count, mut last_s) = (0_usize, 0.0);
    while let Some((time, values)) = rows.next_row()? {
        (count, last_s) = (count + 1, time);
        let own: Vec<[f64; 6]> = plates.iter().map(|plate| plate.wrench(values)).collect();
        if count <= 2 {
            begin.push((time, own));
            if let [(first, _), (second, _)] = begin.as_slice() {
                means =
                    plates.iter().map(|_| Means::new(1.0 / (second - first), frames, frames_hz)).collect();
                for (_, own) in &begin {
                    means.iter_mut().zip(own).for_each(|(mean, wrench)| mean.push(*wrench));
                }
            }
            continue;
        }
        means.iter_mut().zip(own).for_each(|(mean, wrench)| mean.push(wrench));
    }
    let (Some((first_s, _)), true) = (begin.first(), count > 1) else {
        return Err(OpenSimError::Missing("there are fewer than two rows".to_owned()));
    };
    let rate_hz = (count - 1) as f64 / (last_s - first_s);
    let one = |(plate, means): (Columns, Means)| means.plate(plate.name, None, rate_hz, *first_s);
    Ok(plates.into_iter().zip(means).map(one).collect())
}

impl Columns {
    fn of(columns: &[String], stem: &str) -> Result<Self, OpenSimError> {
        let three = |names: [String; 3]| -> Result<[usize; 3], OpenSimError> {
            let place = |name: &String| {
                let missing = || OpenSimError::Missing(format!("the column {name} is missing"));
                columns.iter().position(|c| c == name).ok_or_else(missing)
            };
            let [x, y, z] = &names;
            Ok([place(x)?, place(y)?, place(z)?])
        };
        let axes = |word: &str| ["x", "y", "z"].map(|axis| format!("{stem}{word}{axis}"));
        // ground_force_r_v → ground_torque_r_ , 1_ground_force_v → 1_ground_torque_
        let torque = stem.replacen("force", "torque", 1);
        let moment = three(["x", "y", "z"].map(|axis| format!("{torque}{axis}")))
            .or_else(|_| three(axes("m")))
            .or_else(|_| {
                three(["x", "y", "z"].map(|axis| format!("{}moment_{axis}", stem.trim_end_matches("force_"))))
            });
        let name = stem.trim_end_matches('_').to_owned();
        Ok(Self { name, force: three(axes("v"))?, point: three(axes("p"))?, moment: moment.ok() })
    }

    fn wrench(&self, row: &[f64]) -> [f64; 6] {
        let vector = |at: [usize; 3]| Vector3::from(at.map(|k| row.get(k).copied().unwrap_or(f64::NAN)));
        let (f, p) = (vector(self.force), vector(self.point));
        if f.norm() < LOADED_N {
            return [0.0; 6];
        }
        let m = self.moment.map_or_else(Vector3::zeros, vector) + p.cross(&f);
        [f.x, f.y, f.z, m.x, m.y, m.z]
    }
}
