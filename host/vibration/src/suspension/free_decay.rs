//! The modes of a recording of free vibration: from poses of the platform, or from an IMU on it alone.

use std::ops::Range;

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::SuspensionError;
use super::bridged::bridged;
use super::imu_errors::MountedImu;
use super::release::{later, quiet_beginning};
use super::rests::Rest;
use super::springs::COORDINATES;
use super::support::{Support, constant_rate_hz, missing};
use super::track::{GAP, Pose, poses, rest};
use crate::modal_analysis::{
    self, FreeDecay, ModalError, Modes, Options, Spectrum, complex, out_of_phase, platform_amplitudes,
    shapes, spectrum, undamped,
};
use rigident_io::recording::Recording;

/// Names of an IMU's channels.
const IMU_CHANNELS: [&str; 6] = ["fx", "fy", "fz", "wx", "wy", "wz"];

/// Least share of a recording that must be without a gap.
const WHOLE: f64 = 0.5;

/// Samples of a free vibration.
#[derive(Clone, Debug)]
pub struct Samples {
    /// Rows that were left out: before or after a gap in time, before the release, or while the amplitude was
    /// too large.
    pub left_out: usize,
    /// Samples that were missing, and are filled in by the modes of the others.
    pub filled_in: usize,
    /// Samples per second.
    pub rate_hz: f64,
    /// A row for each sample; shifts of O in m and turns in rad, of the free coordinates, or an IMU's
    /// specific force and rate.
    pub values: DMatrix<f64>,
    /// Names of the columns.
    pub names: Vec<&'static str>,
    /// The IMU that they are of; `None` of poses.
    pub(super) imu: Option<MountedImu>,
    /// Rest in the frame of the recording: position of O, and attitude as a rotation matrix; `None` of an
    /// IMU.
    pub rest: Option<(Vector3<f64>, Matrix3<f64>)>,
}

/// The modes of a recording.
#[derive(Clone, Debug)]
pub struct Vibration {
    /// The samples they are from.
    pub samples: Samples,
    /// Modes over the free coordinates, and what was noticed.
    pub modes: Modes,
}

impl Vibration {
    /// Returns the rests that the rig file states against that of the recording; none of an IMU's.
    pub fn rests(&self, support: &Support) -> Vec<Rest> {
        let sd = self.rest_sd(&support.free);
        let against = |own: (Vector3<f64>, Matrix3<f64>)| {
            support.rests.iter().map(|rest| rest.against(own, &sd, &support.at_m)).collect()
        };
        self.samples.rest.map_or_else(Vec::new, against)
    }

    /// Returns 1 σ of the coordinates of the rest, m and rad: what a mean over no whole periods leaves.
    pub fn rest_sd(&self, free: &[usize]) -> [f64; 6] {
        let lowest =
            self.modes.shapes.modes.iter().map(modal_analysis::Mode::hz).fold(f64::INFINITY, f64::min);
        let length_s = self.samples.values.nrows() as f64 / self.samples.rate_hz;
        let mut all = [0.0; 6];
        for (column, k) in self.samples.values.column_iter().zip(free) {
            let rms = (column.norm_squared() / column.len().max(1) as f64).sqrt();
            all[*k] = rms / (std::f64::consts::PI * lowest * length_s).max(1.0);
        }
        all
    }
}

/// Returns the samples of a recording: those of the poses if it has any, else of the IMU.
///
/// # Errors
/// [`SuspensionError`] if it has neither, or no constant rate.
pub fn samples(recording: &Recording, support: &Support) -> Result<Samples, SuspensionError> {
    let stretch = longest(recording, constant_rate_hz(recording)?)?;
    samples_of(recording, support, stretch)
}

/// Returns the samples of a stretch.
fn samples_of(
    recording: &Recording,
    support: &Support,
    stretch: Range<usize>,
) -> Result<Samples, SuspensionError> {
    let rate_hz = constant_rate_hz(recording)?;
    let left_out = recording.rows() - stretch.len();
    let table = recording.rig.suspension.clone().unwrap_or_default();
    if let Some(rows) = recording.platform.as_deref() {
        let poses = poses(rows, &Vector3::from(table.at_m), |row| recording.place(row))?;
        let poses = poses.get(stretch).unwrap_or_default();
        let rest = rest(poses);
        return Ok(Samples {
            left_out,
            filled_in: 0,
            rate_hz,
            values: coordinates(poses, &rest, &support.free),
            names: support.free.iter().map(|k| COORDINATES[*k]).collect(),
            imu: None,
            rest: Some((rest.position, rest.attitude.to_rotation_matrix().into_inner())),
        });
    }
    let both = recording.imus.first().and_then(|imu| Some((imu.accel.as_ref()?, imu.gyro.as_ref()?)));
    let Some((force, turn)) = both else {
        return Err(missing(
            &recording.name,
            "the motion of the platform is",
            "give its poses (x_m, y_m, z_m, qw, qx, qy, qz), or accelerometer and gyro of an IMU on it",
        ));
    };
    let from = stretch.start;
    let at = |i: usize, j: usize| if j < 3 { force[from + i][j] } else { turn[from + i][j - 3] };
    Ok(Samples {
        left_out,
        filled_in: 0,
        rate_hz,
        values: DMatrix::from_fn(stretch.len(), 6, at),
        names: IMU_CHANNELS.to_vec(),
        imu: Some(MountedImu::new(&recording.rig, &table, &force[stretch.clone()])),
        rest: None,
    })
}

/// Returns the longest stretch without a gap in time: modes are those of samples at a constant rate.
///
/// # Errors
/// [`SuspensionError::Gaps`] if it is too short a part.
fn longest(recording: &Recording, rate_hz: f64) -> Result<Range<usize>, SuspensionError> {
    let times = &recording.time_ns;
    let is_gap = |k: &usize| times[*k].saturating_sub(times[k - 1]) as f64 * 1e-9 * rate_hz > GAP;
    let gaps: Vec<usize> = (1..times.len()).filter(is_gap).collect();
    let starts = std::iter::once(0).chain(gaps.iter().copied());
    let ends = gaps.iter().copied().chain([times.len()]);
    let longest = starts.zip(ends).map(|(a, b)| a..b).max_by_key(Range::len).unwrap_or(0..0);
    if (longest.len() as f64) < WHOLE * times.len() as f64 {
        let first = gaps.first().map_or_else(String::new, |k| recording.place(*k));
        return Err(SuspensionError::Gaps {
            name: recording.name.clone(),
            gaps: gaps.len(),
            first,
            longest_s: longest.len() as f64 / rate_hz,
        });
    }
    Ok(longest)
}

/// Returns shift and turn of each pose against rest.
fn coordinates(poses: &[Pose], rest: &Pose, free: &[usize]) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(poses.len(), free.len());
    for (row, pose) in poses.iter().enumerate() {
        let shift = rest.attitude.inverse_transform_vector(&(pose.position - rest.position));
        let turn = (rest.attitude.inverse() * pose.attitude).scaled_axis();
        for (column, k) in free.iter().enumerate() {
            all[(row, column)] = if *k < 3 { shift[*k] } else { turn[*k - 3] };
        }
    }
    all
}

impl Samples {
    /// Returns whether they are readings of an IMU.
    pub fn is_of_imu(&self) -> bool {
        self.imu.is_some()
    }

    fn decay<'a>(&'a self, names: &'a [&'a str]) -> FreeDecay<'a> {
        FreeDecay { rate_hz: self.rate_hz, samples: &self.values, names }
    }

    /// Returns the spectrum of the samples, resolved as well as their length allows.
    ///
    /// # Errors
    /// [`ModalError`] if numbers are missing.
    pub fn spectrum(&self) -> Result<Spectrum, ModalError> {
        spectrum(&self.decay(&self.names), self.values.nrows() as f64 / self.rate_hz)
    }
}

/// Identifies the modes of a recording: as many as there are free coordinates, or the number given.
///
/// # Errors
/// [`SuspensionError`] if the recording has no motion, or no modes.
pub fn vibration(
    recording: &Recording,
    support: &Support,
    modes: Option<usize>,
) -> Result<Vibration, SuspensionError> {
    let mut samples = samples(recording, support)?;
    let has_gaps = samples.left_out > 0;
    let from = |first: usize| samples_of(recording, support, first..recording.rows());
    let held = quiet_beginning(&samples.values, samples.rate_hz);
    if held > 0 && !has_gaps {
        samples = from(held)?;
    }
    let refuse =
        |error: ModalError| SuspensionError::Modes { name: recording.name.clone(), error: Box::new(error) };
    let options = Options { modes: Some(modes.unwrap_or(support.free.len())), ..Options::default() };
    let rate_hz = samples.rate_hz;
    let identify = |values: &DMatrix<f64>, names: &[&str]| {
        let decay = FreeDecay { rate_hz, samples: values, names };
        modal_analysis::identify(&decay, &options)
    };
    let mut modes = identify(&samples.values, &samples.names).map_err(refuse)?;
    if has_gaps {
        let stretch = longest(recording, samples.rate_hz)?;
        let all = samples_of(recording, support, 0..recording.rows())?;
        let (rows, names) = ((&all.values, recording.time_ns.as_slice(), all.rate_hz), &samples.names);
        if let Some((values, found)) = bridged(rows, (stretch, &modes), |values| identify(values, names)) {
            modes = found;
            samples = Samples { filled_in: values.nrows() - recording.rows(), values, ..all };
        }
    } else if let Some((cut, found)) = later(&samples.values, &modes, |v| identify(v, &samples.names)) {
        modes = found;
        samples = from(held + cut)?;
    }
    if let Some(imu) = &samples.imu {
        let strengths: Vec<f64> = modes.shapes.modes.iter().map(|mode| mode.signal_to_noise).collect();
        let read = modes.amplitudes;
        let platform = platform_amplitudes(&imu.as_stated(), &read).map_err(refuse)?;
        modes.amplitudes = imu.counted(&read, &platform).map_err(refuse)?;
        modes.shapes = shapes(&modes.amplitudes, &[]).map_err(refuse)?;
        let noisy = complex(&platform, &modes.shapes.modes, |_| 1.0);
        modes.shapes = only(&modes.shapes, &support.free);
        // An accelerometer reads a quarter of a period beside a gyro: phases are those of shifts and turns.
        modes.findings.retain(|finding| !matches!(finding, modal_analysis::Finding::Complex { .. }));
        modes.findings.extend(noisy);
        for (mode, strength) in modes.shapes.modes.iter_mut().zip(strengths) {
            mode.signal_to_noise = strength;
        }
    }
    without_dampers(&mut modes, &support.free).map_err(refuse)?;
    Ok(Vibration { samples, modes })
}

/// Takes frequencies and shapes of the modes that there would be without dampers, where the part out of phase
/// moves a frequency by more than its standard deviation: equations of free vibration are theirs. Elsewhere,
/// and where modes are missing, the possible difference is counted.
fn without_dampers(modes: &mut Modes, free: &[usize]) -> Result<(), ModalError> {
    let damped = match modes.amplitudes.complex.nrows() {
        own if own == free.len() => modes.amplitudes.clone(),
        _ => modes.amplitudes.of_channels(free),
    };
    let shares = out_of_phase(&damped);
    let moves =
        |(share, mode): (&f64, &modal_analysis::Mode)| 0.5 * share * share * mode.angular > mode.angular_sd;
    let is_moved = shares.iter().zip(&modes.shapes.modes).any(moves);
    if let Some(found) = is_moved.then(|| undamped(&damped)).flatten() {
        let found = shapes(&found, &[])?;
        for (mode, own) in modes.shapes.modes.iter_mut().zip(found.modes) {
            (mode.angular, mode.angular_sd, mode.shape) = (own.angular, own.angular_sd, own.shape);
        }
        modes.shapes.covariance = found.covariance;
        return Ok(());
    }
    for (r, share) in shares.into_iter().enumerate() {
        let place = modes.shapes.place(r);
        let mode = &modes.shapes.modes[r];
        // Of ω² and of the shape that share, squared.
        let square = share * share;
        let shape = &mode.shape;
        let across = DMatrix::from_fn(shape.len(), shape.len(), |i, j| {
            f64::from(u8::from(i == j)) * shape.norm_squared() - shape[i] * shape[j]
        });
        modes.shapes.covariance[(place, place)] += (0.5 * square * mode.angular).powi(2);
        let mut own = modes.shapes.covariance.view_mut((place + 2, place + 2), across.shape());
        own += across * (square * square);
    }
    Ok(())
}

/// Returns the shapes of some channels.
fn only(all: &modal_analysis::Shapes, free: &[usize]) -> modal_analysis::Shapes {
    let channels = all.modes.first().map_or(0, |mode| mode.shape.len());
    if channels == free.len() {
        return all.clone();
    }
    let kept: Vec<usize> = (0..all.modes.len())
        .flat_map(|r| {
            [0, 1].into_iter().chain(free.iter().map(|k| 2 + k)).map(move |k| r * (2 + channels) + k)
        })
        .collect();
    let mut modes = all.modes.clone();
    for mode in &mut modes {
        mode.shape = mode.shape.select_rows(free);
        mode.amplitudes = mode.amplitudes.select_rows(free);
    }
    modal_analysis::Shapes { modes, covariance: all.covariance.select_rows(&kept).select_columns(&kept) }
}
