//! Frames of a tree as a recording, and back.
//!
//! A frame holds what a recording's columns hold, and angular accelerations. These have columns of their own,
//! `alpha0_x_radps2`, `alpha0_y_radps2`, `alpha0_z_radps2`, then `alpha1_…`: of link j, in its own axes.
//! `rigident identify` does not need them.

use nalgebra::{Matrix3, Vector3};
use rigident_shared::wire::tree_frame::{LINK_NUMBERS, MAX_TREE_FRAME, TreeFrame};

use rigident_fit::figures::shortened;
use rigident_io::recording::{ImuColumns, Recording};
use rigident_io::rig::{Calibrated, ImuTable, RigFile};
use rigident_model::Model;
use rigident_rows::tree::joints::attitude;

/// The reason why a recording makes no frames.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoFrames {
    /// Columns, or what they are to be understood by.
    #[error(
        "{name} lacks what frames are made of: {what}. On the device nothing is differentiated; `identify()` \
         needs no accelerations, and takes joints' own columns"
    )]
    Missing {
        /// The recording.
        name: String,
        /// The quantity.
        what: String,
    },
    /// More links than a frame holds.
    #[error("the model has more links than a frame holds")]
    Links,
}

/// Returns the columns of a link's angular acceleration.
pub fn acceleration_columns(link: usize) -> [String; 3] {
    ["x", "y", "z"].map(|axis| format!("alpha{link}_{axis}_radps2"))
}

/// Returns frames at the given rate as a recording; those that are not whole, or not of the given number of
/// links, are left out.
pub fn recording(name: &str, rig: &RigFile, rate_hz: f64, links: usize, frames: &[Vec<u8>]) -> Recording {
    let mut recording = Recording {
        name: name.to_owned(),
        rig: rig.clone(),
        rate_hz: Some(rate_hz),
        imus: vec![ImuColumns { accel: None, gyro: Some(Vec::new()) }; links],
        attitudes: (1..links).map(|j| (j, Vec::new())).collect(),
        ..Recording::default()
    };
    let mut wrenches = Vec::new();
    let mut forces = Vec::new();
    let mut accelerations: Vec<[Vec<String>; 3]> = vec![Default::default(); links];
    for frame in frames.iter().filter_map(|bytes| TreeFrame::decode(bytes, links).ok()) {
        let [fx, fy, fz, mx, my, mz, ax, ay, az, base @ ..] = frame.base.map(f64::from);
        recording.time_ns.push((f64::from(frame.number) * 1e9 / rate_hz).round() as u64);
        wrenches.push([fx, fy, fz, mx, my, mz]);
        forces.push([ax, ay, az]);
        for (j, link) in frame.links().enumerate() {
            let [w, x, y, z, ..] = link.map(f64::from);
            if let Some((_, rows)) = recording.attitudes.get_mut(j) {
                rows.push([w, x, y, z]);
            }
        }
        let others = frame.links().map(|l| {
            let [_, _, _, _, turning @ ..] = l.map(f64::from);
            turning
        });
        for ((imu, cells), [gx, gy, gz, cx, cy, cz]) in
            recording.imus.iter_mut().zip(&mut accelerations).zip([base].into_iter().chain(others))
        {
            imu.gyro.get_or_insert_default().push([gx, gy, gz]);
            for (cells, value) in cells.iter_mut().zip([cx, cy, cz]) {
                cells.push(value.to_string());
            }
        }
    }
    recording.wrench = Some(wrenches);
    if let Some(base) = recording.imus.first_mut() {
        base.accel = Some(forces);
    }
    let named = accelerations.into_iter().enumerate();
    recording.extra = named.flat_map(|(j, cells)| acceleration_columns(j).into_iter().zip(cells)).collect();
    recording
}

/// A link's rates and angular accelerations in its axes, and attitudes but for the base's.
struct LinkRows {
    rates: Vec<Vector3<f64>>,
    accelerations: [Vec<f64>; 3],
    attitudes: Vec<[f64; 4]>,
}

/// Returns the frames of a recording of a model's links, in the model's order.
///
/// # Errors
/// [`NoFrames`] names what is missing.
pub fn frames(recording: &Recording, model: &Model) -> Result<Vec<Vec<u8>>, NoFrames> {
    let links = model.welded().links;
    let tables = &recording.rig.link;
    let number = |i: usize, name: &str| {
        if tables.is_empty() { Some(i) } else { tables.iter().position(|t| t.name == name) }
    };
    let mut missing = Vec::new();
    let mut all = Vec::new();
    for (i, link) in links.iter().enumerate() {
        match number(i, &link.name) {
            Some(j) => all.push(link_rows(recording, j, i == 0, &mut missing)),
            None => missing.push(format!("link {}", link.name)),
        }
    }
    let forces = recording.imus.first().and_then(|imu| imu.accel.as_ref());
    for (there, what) in [
        (recording.wrench.is_some(), "the wrench (fx_n …)"),
        (forces.is_some(), "the base's specific force (imu_ax_mps2 …)"),
        (!recording.is_static, "time: its rows are still poses"),
    ] {
        if !there {
            missing.push(what.to_owned());
        }
    }
    let (Some(wrench), Some(forces), true) = (&recording.wrench, forces, missing.is_empty()) else {
        return Err(NoFrames::Missing { name: recording.name.clone(), what: shortened(&missing, 6) });
    };
    let default = ImuTable::default();
    let imu = recording.rig.imu_on(0).unwrap_or(&default);
    let (turn, arm) = (mounting(imu), Vector3::from(imu.position_m));
    let [scale, bias] = [imu.accel_scale, imu.accel_bias_mps2].map(numbers);
    (0..recording.rows())
        .map(|k| {
            let mut base = Vec::new();
            let mut others: Vec<[f32; LINK_NUMBERS]> = Vec::new();
            for (i, link) in all.iter().enumerate() {
                let rate = link.rates.get(k).copied().unwrap_or_default();
                let change: [f64; 3] =
                    std::array::from_fn(|c| link.accelerations[c].get(k).copied().unwrap_or(f64::NAN));
                let change = Vector3::from(change);
                if i > 0 {
                    let attitude = link.attitudes.get(k).copied().unwrap_or([f64::NAN; 4]);
                    let numbers: Vec<f64> = attitude
                        .into_iter()
                        .chain(rate.iter().copied())
                        .chain(change.iter().copied())
                        .collect();
                    others.push(std::array::from_fn(|n| numbers[n] as f32));
                    continue;
                }
                let felt = turn
                    * (Vector3::from(forces[k]).component_mul(&Vector3::from(scale)) - Vector3::from(bias));
                // From the IMU's place to the origin of S.
                let force = felt - change.cross(&arm) - rate.cross(&rate.cross(&arm));
                base.extend(wrench[k].iter().copied().chain(force.iter().copied()));
                base.extend(rate.iter().chain(change.iter()).copied());
            }
            let base = std::array::from_fn(|n| base.get(n).copied().unwrap_or(f64::NAN) as f32);
            let mut bytes = vec![0; MAX_TREE_FRAME];
            let length = TreeFrame::encode(k as u32, &base, &others, &mut bytes).ok_or(NoFrames::Links)?;
            bytes.truncate(length);
            Ok(bytes)
        })
        .collect()
}

fn link_rows(recording: &Recording, j: usize, is_base: bool, missing: &mut Vec<String>) -> LinkRows {
    let default = ImuTable { link: j, ..ImuTable::default() };
    let imu = recording.rig.imu_on(j).unwrap_or(&default);
    let (turn, bias) = (mounting(imu), Vector3::from(numbers(imu.gyro_bias_radps)));
    let gyro = recording.imus.get(j).and_then(|imu| imu.gyro.as_ref());
    let attitudes = recording.attitudes.iter().find(|(link, _)| *link == j).map(|(_, rows)| rows);
    if gyro.is_none() {
        missing.push(format!("imu{j}_gx_radps …"));
    }
    if attitudes.is_none() && !is_base {
        missing.push(format!("q{j}_w …"));
    }
    let accelerations = acceleration_columns(j).map(|name| {
        let cells = recording.extra.iter().find(|(column, _)| *column == name).map(|(_, cells)| cells);
        // A cell that is no number makes a frame that the device counts and leaves out.
        let values = cells.map(|cells| cells.iter().map(|c| c.trim().parse().unwrap_or(f64::NAN)).collect());
        values.unwrap_or_default()
    });
    if accelerations.iter().any(Vec::is_empty) {
        missing.push(format!("alpha{j}_x_radps2 …"));
    }
    LinkRows {
        rates: gyro
            .map_or_else(Vec::new, |rows| rows.iter().map(|g| turn * (Vector3::from(*g) - bias)).collect()),
        accelerations,
        attitudes: attitudes.cloned().unwrap_or_default(),
    }
}

fn mounting(imu: &ImuTable) -> Matrix3<f64> {
    attitude(&imu.rotation_wxyz).unwrap_or_else(Matrix3::identity)
}

/// Returns the numbers, and NaN for those to be calibrated on poses, which are refused when the recording is
/// prepared.
fn numbers(value: Calibrated) -> [f64; 3] {
    match value {
        Calibrated::Numbers(v) => v,
        Calibrated::FromPoses(_) => [f64::NAN; 3],
    }
}

#[cfg(all(test, feature = "simulator"))]
mod tests {
    use rigident_sim::runner::frames_of;

    use super::*;
    use rigident_laboratory::person;
    use rigident_model::human::Person;

    #[test]
    fn a_recording_of_frames_is_these_frames_and_missing_columns_are_named() {
        let human = Person::default().human34().unwrap();
        let tree = person::tree(&human, &human.nominal());
        let sent = frames_of(&tree, 5, 100.0, [1.0; 6], 3);
        let rig = RigFile::default();
        let text = recording("person", &rig, 100.0, 15, &sent).to_csv();
        let mut again = Recording::from_csv_bytes("person.csv", text.as_bytes(), &rig).unwrap();
        assert_eq!(frames(&again, &human).unwrap(), sent);
        again.extra.retain(|(name, _)| !name.starts_with("alpha7"));
        again.attitudes.retain(|(j, _)| *j != 3);
        let said = frames(&again, &human).unwrap_err().to_string();
        assert!(said.contains("q3_w …, alpha7_x_radps2 …."), "{said}");
    }

    #[test]
    fn the_specific_force_is_moved_from_the_imu_to_the_origin() {
        let human = Person::default().human34().unwrap();
        let base = rigident_model::Model { links: human.links[..1].to_vec(), ..human };
        let tree = person::tree(&base, &base.nominal());
        let sent = frames_of(&tree, 3, 100.0, [0.0; 6], 1);
        let mut seen = recording("base", &RigFile::default(), 100.0, 1, &sent);
        let arm = Vector3::new(0.1, -0.2, 0.05);
        let imu =
            ImuTable { position_m: arm.into(), rotation_wxyz: [0.5, 0.5, -0.5, 0.5], ..ImuTable::default() };
        let turn = mounting(&imu);
        for k in 0..3 {
            let now = tree.at(k as f64 / 100.0).motions[0];
            let placed = now.fixed_frame(&arm, &turn);
            let gravity = Vector3::new(0.0, 0.0, -tree.gravity_mps2);
            seen.imus[0].accel.as_mut().unwrap()[k] = placed.specific_force(&gravity).into();
            seen.imus[0].gyro.as_mut().unwrap()[k] = placed.body_rate().into();
        }
        seen.rig.imu = vec![imu];
        for (bytes, wanted) in frames(&seen, &base).unwrap().iter().zip(&sent) {
            let [got, wanted] = [bytes, wanted].map(|b| TreeFrame::decode(b, 1).unwrap().base);
            for (a, b) in got.iter().zip(wanted) {
                // Angular accelerations of some 10 rad/s² in single precision, at arms of 0.2 m.
                assert!((a - b).abs() < 2e-5, "{a} {b}");
            }
        }
    }
}
