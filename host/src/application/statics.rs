//! The centre of mass from a recording's still poses, by three estimators.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::Error;
use rigident_identify::problem::ProblemError;
use rigident_io::recording::Recording;
use rigident_io::rig::WRENCH_CHANNELS;
use rigident_plan::poses::statics::{self, Estimated, Held, Statics, StaticsError, held};
use rigident_rows::body::prepare::prepare;

/// Options of the estimation from still poses.
#[derive(Clone, Debug)]
pub struct StaticsOptions {
    /// Rig file. Default: `NAME.rig.toml` beside the recording.
    pub rig: Option<PathBuf>,
    /// Number of the pose that the second estimator takes differences to, from 1.
    pub reference: usize,
}

impl Default for StaticsOptions {
    fn default() -> Self {
        Self { rig: None, reference: 1 }
    }
}

/// The centre of mass from still poses; its text is the tables.
#[derive(Clone, Debug, Serialize)]
pub struct StillPoses {
    /// Number of the poses.
    pub poses: usize,
    /// Number of the reference pose, from 1.
    pub reference: usize,
    /// The estimators beside each other, and what they leave.
    #[serde(flatten)]
    pub found: Statics,
    /// Warnings from reading the recording.
    #[serde(skip)]
    pub warnings: Vec<String>,
    #[serde(skip)]
    held: Vec<Held>,
    /// Readings a second; `None` of readings that are a pose each.
    #[serde(skip)]
    rate_hz: Option<f64>,
}

/// Estimates the centre of mass from the still poses of a recording.
///
/// # Errors
/// The recording cannot be read, or has too few poses that differ.
///
/// ```
/// use rigident::application::{StaticsOptions, statics};
///
/// let folder = tempfile::tempdir().unwrap();
/// let path = folder.path().join("poses.csv");
/// // 2 kg at (0.1, 0, 0.3) m, at rest in four attitudes: moment = r × force.
/// let mut text = "t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,imu_ax_mps2,imu_ay_mps2,imu_az_mps2\n".to_owned();
/// let gravity = [[0.0, 0.0, 9.8], [4.9, 0.0, 8.487], [0.0, 4.9, 8.487], [-4.9, 0.0, 8.487]];
/// for (k, [x, y, z]) in gravity.iter().enumerate() {
///     let [fx, fy, fz] = [2.0 * x, 2.0 * y, 2.0 * z];
///     let [mx, my, mz] = [-0.3 * fy, 0.3 * fx - 0.1 * fz, 0.1 * fy];
///     text += &format!("{k},{fx},{fy},{fz},{mx},{my},{mz},{x},{y},{z}\n");
/// }
/// std::fs::write(&path, text).unwrap();
/// std::fs::write(folder.path().join("poses.rig.toml"), "[recording]\nstatic = true\n").unwrap();
/// let [x, y, z] = statics(&path, &StaticsOptions::default())?.found.estimates[2].com_m.unwrap();
/// assert!((x - 0.1).abs() < 1e-6 && y.abs() < 1e-6 && (z - 0.3).abs() < 1e-6);
/// # Ok::<(), rigident::application::Error>(())
/// ```
pub fn statics(recording: &Path, options: &StaticsOptions) -> Result<StillPoses, Error> {
    let reference = options.reference.checked_sub(1).ok_or(StaticsError::CountedFromOne)?;
    let mut recording = Recording::load(recording, options.rig.as_deref())?;
    recording.leave_out_bad_readings();
    let input = prepare(&recording).map_err(ProblemError::from)?.input;
    let held = held(&input);
    let found = statics::statics(&held, input.channel_sigma.as_ref(), reference)?;
    Ok(StillPoses {
        poses: held.len(),
        reference: options.reference,
        found,
        warnings: recording.warnings,
        held,
        rate_hz: (!input.is_static).then_some(input.rate_hz),
    })
}

impl StillPoses {
    /// Returns true if the poses leave no estimator's centre of mass open.
    pub fn is_whole(&self) -> bool {
        self.found.estimates.iter().all(|estimated| estimated.com_m.is_some())
    }
}

impl fmt::Display for StillPoses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} still poses; relative to pose {}.\n\nCentre of mass, mm          x ± U95            y ± \
             U95            z ± U95   \
             condition number of the normal matrix",
            self.poses, self.reference
        )?;
        for Estimated { name, com_m, u95_m, condition_number_normal } in &self.found.estimates {
            write!(f, "\n  {name:<25}")?;
            match (com_m, u95_m) {
                (Some(com), Some(u95)) => com
                    .iter()
                    .zip(u95)
                    .try_for_each(|(com, u95)| write!(f, " {:>8.2} ± {:<6.2}", 1e3 * com, 1e3 * u95))?,
                _ => write!(f, " {:<53}", "these poses leave it open")?,
            }
            match condition_number_normal {
                v if v.is_finite() => write!(f, "  {v:.3}")?,
                _ => write!(f, "  infinite")?,
            }
        }
        writeln!(
            f,
            "\n\nThe first takes the forces as read for the body's weight: their offset is an error of it, \
             and its interval counts the one \
             that the third finds.\nThe second takes what changes from one pose to the others, the third \
             gravity from the attitude \
             and six offsets."
        )?;
        if let (Some([mass, u95]), Some(offset)) = (self.found.mass_kg, &self.found.offset_n_nm) {
            write!(f, "\nMass {mass:.4} ± {u95:.4} kg. Offsets")?;
            for (k, ((name, unit), [value, u95])) in WRENCH_CHANNELS.into_iter().zip(offset).enumerate() {
                write!(f, "{} {name} {value:.3} ± {u95:.3} {unit}", if k > 0 { "," } else { "" })?;
            }
            writeln!(f, ".")?;
        }
        if self.found.differences.is_empty() {
            return Ok(());
        }
        let [force, _, _, moment, _, _] = self.found.sigma_n_nm;
        write!(
            f,
            "\nMeasured less theoretical wrench (one standard deviation of the noise: {force:.3} N in Fx, \
             {moment:.4} N m in Mx)\n  pose        at       Fx       \
             Fy       Fz        Mx        My        Mz\n             s        N        N        N       N \
             m       N m       N m"
        )?;
        for (k, (pose, [fx, fy, fz, mx, my, mz])) in self.held.iter().zip(&self.found.differences).enumerate()
        {
            let at =
                self.rate_hz.map_or_else(|| "–".to_owned(), |hz| format!("{:.1}", pose.first as f64 / hz));
            write!(
                f,
                "\n  {:>4} {at:>9} {fx:>8.3} {fy:>8.3} {fz:>8.3} {mx:>9.4} {my:>9.4} {mz:>9.4}",
                k + 1
            )?;
        }
        Ok(())
    }
}
