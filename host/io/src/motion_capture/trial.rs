//! A trial: markers and the ground's wrenches, in axes whose z points up.

use std::io::{BufRead, BufReader, Seek};
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};

use super::c3d::{C3d, C3dError, Plate};
use super::ground::{GroundWrench, Means, Placed, with_room};
use super::markers::Markers;
use super::motive::{MotiveError, Take};
use super::opensim::OpenSimError;
use super::opensim::ground_reaction::ground_wrenches;
use super::opensim::storage::Rows;
use super::opensim::trc::Trc;
use super::upright::{Both, turn_of_markers};
use crate::recording::extension;
use rigident_fit::parallel;

/// The reason that a file is no trial.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// It cannot be read.
    #[error("{path} cannot be read: {reason}")]
    Unreadable {
        /// The file.
        path: String,
        /// The message of the system.
        reason: String,
    },
    /// The ending is none that is known.
    #[error(
        "{0} is no trial by its name: it must end in .c3d, .trc, or .csv of OptiTrack's Motive; of markers \
         in other forms export one of these"
    )]
    UnknownKind(String),
    /// It is no C3D file that can be read.
    #[error("{name}: {error}")]
    C3d {
        /// The file.
        name: String,
        /// The fault.
        error: C3dError,
    },
    /// It is no CSV of Motive that can be read.
    #[error("{name}: {error}")]
    Motive {
        /// The file.
        name: String,
        /// The fault.
        error: MotiveError,
    },
    /// It is no text file of OpenSim's that can be read.
    #[error("{name}: {error}")]
    OpenSim {
        /// The file.
        name: String,
        /// The fault.
        error: OpenSimError,
    },
    /// The content cannot be.
    #[error("{name}: {what}: {advice}")]
    Contents {
        /// The file.
        name: String,
        /// The fault, with its numbers.
        what: String,
        /// The advice.
        advice: String,
    },
}

/// Markers and wrenches of one recording.
#[derive(Clone, Debug)]
pub struct Trial {
    /// The name of the trial: the file's without folder and ending.
    pub name: String,
    /// Frames per second.
    pub rate_hz: f64,
    /// Time of the first frame, s.
    pub first_s: f64,
    /// Names of the markers.
    pub labels: Vec<String>,
    /// The markers, laboratory axes with z up, m.
    pub markers: Markers,
    /// Force plates, in the same axes.
    pub ground: Vec<GroundWrench>,
    /// The notes.
    pub notes: Vec<String>,
}

impl Trial {
    /// Returns the trial of a C3D file.
    ///
    /// # Errors
    /// [`TrialError`] says what is wrong with it.
    pub fn of_c3d(name: &str, reader: impl BufRead + Seek) -> Result<Self, TrialError> {
        let failed = |error| TrialError::C3d { name: name.to_owned(), error };
        let (mut c3d, mut frames) = C3d::open(reader).map_err(failed)?;
        let placed: Vec<Placed> = c3d.plates.iter().filter_map(Placed::of).collect();
        if placed.len() < c3d.plates.len() {
            return Err(TrialError::Contents {
                name: name.to_owned(),
                what: "the corners of a force plate are no rectangle".to_owned(),
                advice: "correct FORCE_PLATFORM:CORNERS in the file".to_owned(),
            });
        }
        let (rate_hz, channels) = (c3d.rate_hz * c3d.samples_per_frame as f64, c3d.channels.len().max(1));
        let mut means: Vec<Means> =
            placed.iter().map(|_| Means::new(rate_hz, c3d.frames, c3d.rate_hz)).collect();
        c3d.points_m = with_room(c3d.frames * c3d.labels.len());
        let mut samples = Vec::new();
        while frames.add_next(&mut c3d.points_m, &mut samples).map_err(failed)? {
            for sample in samples.chunks_exact(channels) {
                means.iter_mut().zip(&placed).for_each(|(means, plate)| means.push(plate.wrench(sample)));
            }
            samples.clear();
        }
        let plates = means.into_iter().zip(&c3d.plates);
        let plate = |(means, plate): (Means, &Plate)| {
            means.plate(format!("plate {}", plate.number), Some(plate.corners_m), rate_hz, 0.0)
        };
        let mut notes = std::mem::take(&mut c3d.notes);
        let plates: Vec<GroundWrench> = plates.map(plate).collect();
        // Where none changes it is no plate's own fault.
        let any = plates.iter().any(changes);
        let (ground, unplugged): (Vec<_>, Vec<_>) = plates.into_iter().partition(|own| !any || changes(own));
        notes.extend(unplugged.iter().map(|plate| {
            format!("{} never changes, as none that is plugged in does: it is left out", plate.name)
        }));
        if c3d.plates.is_empty() {
            let channels = c3d.channels.iter().filter(|c| c.to_ascii_uppercase().contains("FZ")).count();
            notes.push(match channels {
                0 => "the file has no force plates".to_owned(),
                n => format!(
                    "the file has {n} channels called Fz, and no description of force plates: write \
                     FORCE_PLATFORM with type, corners, origin and channels into it"
                ),
            });
        }
        let mut trial = Self {
            name: name.to_owned(),
            rate_hz: c3d.rate_hz,
            first_s: 0.0,
            markers: Markers::new(c3d.labels.len(), c3d.points_m),
            labels: c3d.labels,
            ground,
            notes,
        };
        trial.forget_zeros();
        trial.same_signs()?;
        trial.turn_upright(Vector3::z())?;
        Ok(trial)
    }

    /// Returns the trial of a TRC file, with the ground's wrenches of a MOT or STO file beside it.
    ///
    /// # Errors
    /// [`TrialError`] says what is wrong with which.
    pub fn of_trc(
        name: &str,
        markers: impl BufRead,
        ground: Option<(&str, impl BufRead + Send)>,
    ) -> Result<Self, TrialError> {
        let refuse = |name: &str, error: OpenSimError| TrialError::OpenSim { name: name.to_owned(), error };
        let (trc, frames) = Trc::open(markers).map_err(|error| refuse(name, error))?;
        let (count, frames_hz) = (frames.count(), trc.rate_hz);
        let forces = || match ground {
            None => Ok(Vec::new()),
            Some((name, reader)) => {
                let rows = Rows::new(reader).and_then(|rows| ground_wrenches(rows, count, frames_hz));
                rows.map_err(|error| refuse(name, error))
            }
        };
        let points = || trc.read(frames).map_err(|error| refuse(name, error));
        let (trc, wrenches) = parallel::both(points, forces);
        let (trc, wrenches) = (trc?, wrenches?);
        Self {
            name: name.to_owned(),
            rate_hz: trc.rate_hz,
            first_s: trc.first_s,
            markers: Markers::new(trc.labels.len(), trc.points_m),
            labels: trc.labels,
            ground: wrenches,
            notes: Vec::new(),
        }
        .beside_forces()
    }

    /// Returns the trial of a CSV of Motive, with the ground's wrenches of a MOT or STO file beside it.
    ///
    /// # Errors
    /// [`TrialError`] says what is wrong with which.
    pub fn of_motive(
        name: &str,
        markers: impl BufRead,
        ground: Option<(&str, impl BufRead)>,
    ) -> Result<Self, TrialError> {
        let refuse = |error| TrialError::Motive { name: name.to_owned(), error };
        let take = Take::read(markers).map_err(refuse)?;
        let count = take.points_m.len() / take.labels.len().max(1);
        let ground = ground.map(|(name, reader)| {
            let rows = Rows::new(reader).and_then(|rows| ground_wrenches(rows, count, take.rate_hz));
            rows.map_err(|error| TrialError::OpenSim { name: name.to_owned(), error })
        });
        Self {
            name: name.to_owned(),
            rate_hz: take.rate_hz,
            first_s: take.first_s,
            markers: Markers::new(take.labels.len(), take.points_m),
            labels: take.labels,
            ground: ground.transpose()?.unwrap_or_default(),
            notes: take.notes,
        }
        .beside_forces()
    }

    /// Returns markers beside forces of another file in axes whose z points up.
    fn beside_forces(mut self) -> Result<Self, TrialError> {
        if self.ground.is_empty() {
            self.notes.insert(0, "there are no forces of the ground".to_owned());
        }
        self.forget_zeros();
        self.same_signs()?;
        self.turn_markers()?;
        self.turn_upright(Vector3::y())?;
        Ok(self)
    }

    /// Reads a trial from a C3D file, or from a TRC file or a CSV of Motive with the ground's wrenches of a
    /// MOT or STO file, where there is one.
    ///
    /// # Errors
    /// [`TrialError`] says what is wrong with which file.
    pub fn read(path: &Path, ground: Option<&Path>) -> Result<Self, TrialError> {
        let unreadable = |path: &Path, error: std::io::Error| TrialError::Unreadable {
            path: path.display().to_string(),
            reason: error.to_string(),
        };
        let open = |path: &Path| {
            rigident_files::open(path).map(BufReader::new).map_err(|error| unreadable(path, error))
        };
        let shown = path.display().to_string();
        let mut trial = match extension(path).as_str() {
            "c3d" => Self::of_c3d(&shown, open(path)?)?,
            kind @ ("trc" | "csv") => {
                let beside = ground.map(Path::to_path_buf).or_else(|| beside(path));
                let mut own = beside.map(|p| Ok((p.display().to_string(), open(&p)?))).transpose()?;
                let own = own.as_mut().map(|(name, reader)| (name.as_str(), reader));
                let markers = open(path)?;
                if kind == "trc" {
                    Self::of_trc(&shown, markers, own)?
                } else {
                    Self::of_motive(&shown, markers, own)?
                }
            }
            _ => return Err(TrialError::UnknownKind(shown)),
        };
        trial.name = name_of(path);
        Ok(trial)
    }

    /// Returns the number of frames.
    pub fn frames(&self) -> usize {
        self.markers.frames()
    }

    /// Returns the time of a frame, s.
    pub fn time_s(&self, frame: usize) -> f64 {
        self.first_s + frame as f64 / self.rate_hz
    }

    /// Returns a marker in a frame, m; `None` where it was not seen, or was dropped.
    pub fn point(&self, frame: usize, label: usize) -> Option<Vector3<f64>> {
        self.markers.point(frame, label)
    }

    /// Counts markers that are exactly in the origin as not seen: some programs write that.
    fn forget_zeros(&mut self) {
        self.markers.change(|p| if p == [0.0; 3] { [f32::NAN; 3] } else { p });
    }

    /// Refuses plates that push in opposite directions.
    fn same_signs(&self) -> Result<(), TrialError> {
        let push: Vec<Vector3<f64>> = self.ground.iter().map(loaded_push).collect();
        let all = self.mean_push();
        let against =
            push.iter().zip(&self.ground).find(|(p, _)| p.norm() > CLEAR_PUSH_N && p.dot(&all) < 0.0);
        let Some((p, plate)) = against.filter(|_| all.norm() > LEAST_PUSH_N) else { return Ok(()) };
        Err(TrialError::Contents {
            name: self.name.clone(),
            what: format!(
                "{} pushes with ({:.0}, {:.0}, {:.0}) N against the others",
                plate.name, p.x, p.y, p.z
            ),
            advice: "its forces have the wrong sign: export the reaction on the person for every plate"
                .to_owned(),
        })
    }

    /// Turns the laboratory such that z points up: the axis along which the ground pushes; without force
    /// plates `usual`.
    fn turn_upright(&mut self, usual: Vector3<f64>) -> Result<(), TrialError> {
        let push = self.mean_push();
        let up = if push.norm() < LEAST_PUSH_N { usual } else { push.normalize() };
        let axis = up.iamax();
        if up[axis].abs() < 0.8 {
            return Err(TrialError::Contents {
                name: self.name.clone(),
                what: format!(
                    "the ground's mean force is ({:.0}, {:.0}, {:.0}) N, along no axis of the laboratory",
                    push.x, push.y, push.z
                ),
                advice: "people push the ground downwards on average: check the plates' axes and signs"
                    .to_owned(),
            });
        }
        if up[axis] < 0.0 {
            return Err(TrialError::Contents {
                name: self.name.clone(),
                what: format!(
                    "the ground's mean force is ({:.0}, {:.0}, {:.0}) N and pulls the person down",
                    push.x, push.y, push.z
                ),
                advice: "the forces have the wrong sign: export the reaction on the person".to_owned(),
            });
        }
        // Cyclic turns keep what is right-handed.
        let turn = match axis {
            0 => Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0),
            // x forward, y up, z right of OpenSim: x forward, y left, z up.
            1 => Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0),
            _ => return Ok(()),
        };
        self.turn(&turn);
        Ok(())
    }

    /// Turns markers whose vertical is another than that of the forces beside them.
    fn turn_markers(&mut self) -> Result<(), TrialError> {
        let both = Both {
            markers: &self.markers,
            labels: self.labels.len(),
            rate_hz: self.rate_hz,
            first_s: self.first_s,
            ground: &self.ground,
            push: self.mean_push(),
        };
        let turn = turn_of_markers(&both).map_err(|what| TrialError::Contents {
            name: self.name.clone(),
            what,
            advice: "export markers and forces in the same axes".to_owned(),
        })?;
        if let Some(turn) = turn {
            self.markers.change(|p| {
                let turned: [f64; 3] = (turn * Vector3::from(p.map(f64::from))).into();
                turned.map(|v| v as f32)
            });
            self.notes.push(format!(
                "{}: markers and forces have different axes upwards; the markers are turned such that the \
                 feet are over the centres of pressure",
                self.name
            ));
        }
        Ok(())
    }

    fn turn(&mut self, by: &Matrix3<f64>) {
        let turned = |p: [f64; 3]| -> [f64; 3] { (by * Vector3::from(p)).into() };
        self.markers.change(|p| turned(p.map(f64::from)).map(|v| v as f32));
        for plate in &mut self.ground {
            if let Some(corners) = &mut plate.corners_m {
                *corners = corners.map(turned);
            }
            for w in &mut plate.wrench {
                let [fx, fy, fz, mx, my, mz] = w.map(f64::from);
                let (f, m) = (turned([fx, fy, fz]), turned([mx, my, mz]));
                *w = [f[0], f[1], f[2], m[0], m[1], m[2]].map(|v| v as f32);
            }
        }
    }

    /// Returns the mean of the sum of the plates' forces, N.
    fn mean_push(&self) -> Vector3<f64> {
        let means = self.ground.iter().map(|plate| {
            let finite = plate.wrench.iter().filter(|w| w.iter().all(|v| v.is_finite()));
            let (sum, count) =
                finite.fold((Vector3::zeros(), 0_usize), |(sum, count), w| (sum + force(w), count + 1));
            sum / count.max(1) as f64
        });
        means.sum()
    }
}

/// Returns whether a plate's readings change at all: those of one that is plugged in are never all the same.
fn changes(plate: &GroundWrench) -> bool {
    let mut wrenches = plate.wrench.iter().filter(|w| w.iter().all(|v| v.is_finite()));
    let first = wrenches.next();
    plate.wrench.len() < LEAST_FRAMES || wrenches.any(|own| Some(own) != first)
}

/// Fewer frames than this may be alike by chance.
const LEAST_FRAMES: usize = 10;
/// Less than this is no person's weight, N.
const LEAST_PUSH_N: f64 = 20.0;
/// A plate that is stepped on is pushed by more, N.
const CLEAR_PUSH_N: f64 = 100.0;

fn force(wrench: &[f32; 6]) -> Vector3<f64> {
    Vector3::new(wrench[0], wrench[1], wrench[2]).map(f64::from)
}

/// Returns the mean force of a plate while it is loaded, N; zero if it never is.
fn loaded_push(plate: &GroundWrench) -> Vector3<f64> {
    let loaded = plate.wrench.iter().map(force).filter(|f| f.norm() > CLEAR_PUSH_N && f.norm().is_finite());
    let (sum, count) = loaded.fold((Vector3::zeros(), 0_usize), |(sum, count), f| (sum + f, count + 1));
    sum / count.max(1) as f64
}

/// Returns the file with the ground's wrenches that belongs to a TRC file by its name: `walk_grf.mot` to
/// `walk.trc`.
fn beside(path: &Path) -> Option<PathBuf> {
    let stem = name_of(path);
    let names = ["mot", "sto"].map(|ending| path.with_file_name(format!("{stem}_grf.{ending}")));
    names.into_iter().find(|name| name.exists())
}

/// Returns the name of a file without folder and ending.
pub fn name_of(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}
