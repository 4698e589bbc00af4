//! A page that plays a person's motion in three dimensions: figure, markers, centre of mass, measured and
//! predicted forces, and the wrench over time under it.
//!
//! Lives here: what such a page needs to know ([`MotionPage`]), the check of it, its packing (`series`), its
//! markup (`page`) and the player itself (`*.js`, `style.css`), which is drawn on a canvas without any
//! library and loads nothing. May not live here: kinematics, prediction, files.

mod page;
mod series;
#[cfg(test)]
mod tests;

/// Everything that the page shows of one trial. Positions are in laboratory axes with z up, m.
///
/// Series hold one entry per frame, as many as [`Self::points_m`]; those that may be left out are empty then.
/// Values that are not known in a frame are NaN.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MotionPage {
    /// Name of the trial.
    pub title: String,
    /// Rate of the frames stored, Hz; more than 100 only make the page larger.
    pub rate_hz: f64,
    /// Horizontal direction in which the person faces, for the views from front and side; zero: the x axis.
    pub forward: [f32; 2],
    /// The parts of the figure.
    pub bones: Vec<Bone>,
    /// Joint centres and ends of links, by frame.
    pub points_m: Vec<Vec<[f32; 3]>>,
    /// Markers, by frame; NaN where one was not seen. May be empty.
    pub markers_m: Vec<Vec<[f32; 3]>>,
    /// Names of the markers, shown where the pointer is. May be empty.
    pub marker_names: Vec<String>,
    /// Centre of mass of the whole body, by frame. May be empty.
    pub com_m: Vec<[f32; 3]>,
    /// Corners of the force plates.
    pub plates_m: Vec<[[f32; 3]; 4]>,
    /// Forces on the body, each as a pair of arrows.
    pub forces: Vec<ForceArrow>,
    /// About which point the wrench of the curves is taken, for their heading: `the pelvis`.
    pub about: String,
    /// Components of the wrench: `Fx`, `Fy`, `Fz`, `Mx`, `My`, `Mz`. May be empty.
    pub curves: Vec<Curve>,
    /// Tells by frame whether parameters were identified from it; empty: all were.
    pub used: Vec<bool>,
    /// Errors of both predictions, component by component. May be empty.
    pub errors: Vec<ErrorRow>,
}

/// A part of the figure: a bone from one point to another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bone {
    /// Name, shown where the pointer is.
    pub name: String,
    /// The two ends of the bone as indices into the points of a frame, the one nearer to the trunk first.
    pub ends: [usize; 2],
    /// Side of the body.
    pub side: Side,
    /// Thickness, as a radius, m; `None`: an eighth of its length, at most 60 mm.
    pub radius_m: Option<f32>,
}

/// A side of the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Neither: trunk, head.
    #[default]
    Middle,
    /// The person's left.
    Left,
    /// The person's right.
    Right,
}

/// A measured force and what is predicted in its place.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceArrow {
    /// Name: of the plate, or `total`.
    pub name: String,
    /// Point of application, by frame; NaN where there is none.
    pub at_m: Vec<[f32; 3]>,
    /// Force on the body, N, by frame.
    pub measured_n: Vec<[f32; 3]>,
    /// Force that the identified parameters predict, N, by frame. May be empty.
    pub predicted_n: Vec<[f32; 3]>,
}

/// One component of the wrench over time. Each of the three holds one value per frame, NaN where there is
/// none, or nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// Name: `Fx`.
    pub name: String,
    /// `N` or `N m`.
    pub unit: String,
    /// By the force plates.
    pub measured: Vec<f32>,
    /// By the identified parameters.
    pub identified: Vec<f32>,
    /// By the scaled table.
    pub table: Vec<f32>,
}

/// Root mean square errors of one component.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ErrorRow {
    /// Name: `Fx`.
    pub name: String,
    /// `N` or `N m`.
    pub unit: String,
    /// Of the prediction by the identified parameters.
    pub identified: Rms,
    /// Of the prediction by the scaled table.
    pub table: Rms,
}

/// A root mean square, NaN where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rms {
    /// In the unit of its row.
    pub value: f64,
    /// In percent of body weight; of body weight times stature for a moment.
    pub percent: f64,
}

/// Why a motion cannot be shown.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// There is nothing to play.
    #[error("the motion of `{0}` has no frames: keep at least one")]
    NoFrames(String),
    /// The rate is zero, negative or not a number.
    #[error("the frames of `{title}` come at {rate_hz} Hz: give a positive rate")]
    Rate {
        /// Name of the trial.
        title: String,
        /// The rate given.
        rate_hz: f64,
    },
    /// A series has another number of entries than there are frames, or a frame another number of points than
    /// the first.
    #[error("{what} of `{title}`: {found} entries where {wanted} are needed")]
    Length {
        /// Name of the trial.
        title: String,
        /// The series.
        what: String,
        /// Entries it has.
        found: usize,
        /// Entries it needs.
        wanted: usize,
    },
    /// A bone ends at a point that there is not.
    #[error("bone `{bone}` ends at point {point}, and a frame of `{title}` has {points}")]
    Bone {
        /// Name of the trial.
        title: String,
        /// Name of the bone.
        bone: String,
        /// The index given.
        point: usize,
        /// Points of a frame.
        points: usize,
    },
}

impl MotionPage {
    /// Returns the text of the page's script, the same for every motion: its hash lets a stricter page play
    /// one.
    pub fn player() -> String {
        page::player()
    }

    /// Returns the page as one self-contained HTML file.
    ///
    /// # Errors
    /// Fails if there is no frame, the rate is not positive, lengths of series differ, or a bone ends
    /// nowhere.
    pub fn html(&self) -> Result<String, MotionError> {
        self.check()?;
        Ok(page::html(self))
    }

    /// Returns the time from the first frame to the last, s.
    fn duration_s(&self) -> f64 {
        self.points_m.len().saturating_sub(1) as f64 / self.rate_hz
    }

    fn check(&self) -> Result<(), MotionError> {
        let title = || self.title.clone();
        let Some(first) = self.points_m.first() else { return Err(MotionError::NoFrames(title())) };
        if !(self.rate_hz.is_finite() && self.rate_hz > 0.0) {
            return Err(MotionError::Rate { title: title(), rate_hz: self.rate_hz });
        }
        let same = |what: &str, found: usize, wanted: usize| {
            let error = || MotionError::Length { title: title(), what: what.to_owned(), found, wanted };
            if found == wanted { Ok(()) } else { Err(error()) }
        };
        let frames = self.points_m.len();
        let or_none = |what: &str, found: usize| if found == 0 { Ok(()) } else { same(what, found, frames) };
        self.points_m.iter().try_for_each(|frame| same("points of a frame", frame.len(), first.len()))?;
        or_none("frames of markers", self.markers_m.len())?;
        let markers = self.markers_m.first().map_or(0, Vec::len);
        self.markers_m.iter().try_for_each(|frame| same("markers of a frame", frame.len(), markers))?;
        let names = self.marker_names.len();
        if names > 0 {
            same("names of markers", names, markers)?;
        }
        or_none("centres of mass", self.com_m.len())?;
        or_none("marks of frames used", self.used.len())?;
        for force in &self.forces {
            same(&format!("points of application of `{}`", force.name), force.at_m.len(), frames)?;
            same(&format!("measured forces of `{}`", force.name), force.measured_n.len(), frames)?;
            or_none(&format!("predicted forces of `{}`", force.name), force.predicted_n.len())?;
        }
        for curve in &self.curves {
            for values in [&curve.measured, &curve.identified, &curve.table] {
                or_none(&format!("values of curve `{}`", curve.name), values.len())?;
            }
        }
        for bone in &self.bones {
            if let Some(point) = bone.ends.into_iter().find(|end| *end >= first.len()) {
                let (bone, points) = (bone.name.clone(), first.len());
                return Err(MotionError::Bone { title: title(), bone, point, points });
            }
        }
        Ok(())
    }
}
