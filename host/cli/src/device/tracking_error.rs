//! The platform's motion: recorded as it happens, compared at the end.

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;

use hexapod::Trajectory;

use crate::Failure;
use rigident::answer::Tracking;
use rigident::device::platform::MotionSample;
use rigident::device::platform::tracking::{compare, difference};
use rigident::present::TimePlot;
use rigident_io::behind::Behind;

/// Writes commanded and measured poses as a recording in CSV, line by line.
pub(crate) struct MotionLog {
    file: Behind,
    path: PathBuf,
    /// True if the rows have measured poses; `None` before the first row.
    measured: Option<bool>,
    samples: Vec<MotionSample>,
    last_s: f64,
}

const POSE: [&str; 7] = ["x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"];

impl MotionLog {
    /// Creates a new file.
    pub(crate) fn create(path: PathBuf, address: &str) -> Result<Self, Failure> {
        let said = |e: std::io::Error| Failure::input(format!("{}: {e}", path.display()));
        let mut file = Behind::file(File::create_new(&path).map_err(said)?);
        writeln!(file, "# platform = {address:?}").map_err(said)?;
        Ok(Self { file, path, measured: None, samples: Vec::new(), last_s: f64::NEG_INFINITY })
    }

    /// Writes one row; a killed program keeps the rows before.
    pub(crate) fn append(&mut self, sample: &MotionSample) -> Result<(), String> {
        // Time goes on from row to row.
        if sample.time_s <= self.last_s {
            return Ok(());
        }
        self.last_s = sample.time_s;
        self.row(sample).map_err(|e| format!("{}: {e}", self.path.display()))?;
        self.samples.push(*sample);
        Ok(())
    }

    fn row(&mut self, sample: &MotionSample) -> std::io::Result<()> {
        let measured = match self.measured {
            Some(measured) => measured,
            None => {
                let names = POSE.iter().map(|name| format!(",cmd_{name}")).collect::<String>();
                let seen = POSE.iter().map(|name| format!(",{name}")).collect::<String>();
                let has = sample.measured.is_some();
                writeln!(self.file, "t_s{names}{}", if has { &seen } else { "" })?;
                *self.measured.insert(has)
            }
        };
        let mut line = format!("{:.6}", sample.time_s);
        for pose in [Some(sample.commanded), sample.measured.filter(|_| measured)].into_iter().flatten() {
            for value in pose.position_m.into_iter().chain(pose.quaternion_wxyz()) {
                line.push_str(&format!(",{value:.9}"));
            }
        }
        writeln!(self.file, "{line}")?;
        self.file.flush()
    }

    /// Waits until the file is written, and returns all samples for the comparison at the end.
    ///
    /// # Errors
    /// Fails if the file could not be written.
    pub(crate) fn end(self) -> Result<Vec<MotionSample>, Failure> {
        let said = |e: std::io::Error| Failure::input(format!("{}: {e}", self.path.display()));
        self.file.close().map_err(said)?;
        Ok(self.samples)
    }
}

/// The tracking of the platform.
pub struct TrackingError {
    tracking: Tracking,
    time_s: Vec<f64>,
    differences: Vec<[f64; 6]>,
    commanded: Vec<[f64; 6]>,
    measured: Vec<[f64; 6]>,
}

impl TrackingError {
    /// Returns the errors of following; `None` if nothing was measured.
    pub(crate) fn of(trajectory: &Trajectory, samples: &[MotionSample]) -> Option<Self> {
        let tracking = compare(trajectory, samples)?;
        let both: Vec<_> =
            samples.iter().filter_map(|s| s.measured.map(|m| (s.time_s, s.commanded, m))).collect();
        let six = |p: &hexapod::Pose| {
            let ([x, y, z], [roll, pitch, yaw]) = (p.position_m, p.rpy_rad);
            [x, y, z, roll, pitch, yaw]
        };
        Some(Self {
            tracking,
            time_s: both.iter().map(|b| b.0).collect(),
            differences: both.iter().map(|(_, c, m)| difference(c, m)).collect(),
            commanded: both.iter().map(|(_, c, _)| six(c)).collect(),
            measured: both.iter().map(|(_, _, m)| six(m)).collect(),
        })
    }

    /// Returns the tracking error for the answer.
    pub(crate) fn tracking(&self) -> Tracking {
        self.tracking
    }

    /// Returns plots of commanded and measured coordinates, where they change, and of their differences.
    pub(crate) fn plots(&self) -> Vec<TimePlot> {
        let count = self.time_s.len();
        let point = |values: &[[f64; 6]], i: usize, scale: f64, k: usize| {
            (self.time_s[k], values.get(k).map_or(f64::NAN, |v| scale * v[i]))
        };
        let mut plots = Vec::new();
        for (i, name) in ["x", "y", "z", "roll", "pitch", "yaw"].into_iter().enumerate() {
            let (low, high) = self
                .commanded
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v[i]), hi.max(v[i])));
            if high - low > 1e-6 {
                let plot = TimePlot::new(format!("Platform's {name}"), if i < 3 { "m" } else { "rad" })
                    .with("commanded", count, |k| point(&self.commanded, i, 1.0, k))
                    .with("measured", count, |k| point(&self.measured, i, 1.0, k));
                plots.push(plot);
            }
        }
        for (what, unit, first, scale) in [("position", "mm", 0, 1e3), ("attitude", "mrad", 3, 1e3)] {
            let plot = TimePlot::new(format!("Platform's {what}, measured less commanded"), unit);
            let axes = ["x", "y", "z"].iter().enumerate();
            let with = |plot: TimePlot, (axis, name): (usize, &&str)| {
                plot.with(name, count, |k| point(&self.differences, first + axis, scale, k))
            };
            plots.push(axes.fold(plot, with));
        }
        plots
    }
}
