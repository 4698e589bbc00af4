//! Why trials make no person.

use crate::inverse_kinematics::subject::SubjectError;
use rigident_model::ModelError;

/// The reason that trials make no person.
#[derive(Debug, thiserror::Error)]
pub enum PersonError {
    /// There is no model of the person.
    #[error(transparent)]
    Subject(#[from] SubjectError),
    /// The model refuses something.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The load is under the foot in the air.
    #[error(
        "{name}: in {wrong} of {frames} frames on one foot the load is nearer to the foot that is in the \
         air: are the plates, or their centres of pressure, exchanged, or left markers right ones?"
    )]
    OtherFoot {
        /// The trial.
        name: String,
        /// Frames with the load under the foot in the air.
        wrong: usize,
        /// Frames with one foot clearly lower and one plate loaded.
        frames: usize,
    },
    /// The cut-off does not fit the rate.
    #[error(
        "a cut-off of {cut_off_hz} Hz cannot be at {rate_hz} frames a second: give `cut_off_hz` between 1 \
         and a quarter of the rate"
    )]
    CutOff {
        /// The cut-off, Hz.
        cut_off_hz: f64,
        /// Frames per second.
        rate_hz: f64,
    },
    /// Plates and markers are in different frames.
    #[error(
        "{name}: where plates are loaded no foot is near: the centre of pressure is {away_m:.2} m from the \
         nearest sole: the corners of the plates, or the axes of their channels, are in another frame than \
         the markers"
    )]
    Laboratory {
        /// The trial.
        name: String,
        /// Median distance, m.
        away_m: f64,
    },
    /// Plates and cameras recorded different motions.
    #[error(
        "{name}: the plates do not follow the markers' motion: the vertical force that it needs and the \
         measured one have a correlation of {correlation:.2}: are the forces of another trial, at another \
         rate, or far out of step?"
    )]
    Apart {
        /// The trial.
        name: String,
        /// The correlation.
        correlation: f64,
    },
    /// Forces along an axis have the wrong sign.
    #[error(
        "{name}: along {axis} (z up) the plates push against the motion: the horizontal force that it needs \
         and the measured one have a correlation of {correlation:.2}: turn the sign of the plates' force \
         along that axis"
    )]
    Flipped {
        /// The trial.
        name: String,
        /// The axis.
        axis: &'static str,
        /// The correlation.
        correlation: f64,
    },
    /// Forces along the horizontal axes are exchanged.
    #[error(
        "{name}: the plates' x follows what the motion needs along y, and their y what it needs along x (z \
         up; correlations {:.2} and {:.2}): exchange the two columns or channels of force, or turn the \
         plates by a quarter",
        correlations[1], correlations[0]
    )]
    Exchanged {
        /// The trial.
        name: String,
        /// Correlations of the needed x with the measured y, and of y with x.
        correlations: [f64; 2],
    },
    /// Nobody has this mass.
    #[error(
        "by the plates the person weighs {mass_kg:.1} kg at a stature of {height_m:.2} m, and living people \
         of that stature weigh {least_kg:.0} to {most_kg:.0} kg: are the forces in newtons, and of one \
         person, whom nothing else carries (a seat)?"
    )]
    Weight {
        /// The mass, kg.
        mass_kg: f64,
        /// The stature, m.
        height_m: f64,
        /// The least that people weigh, kg.
        least_kg: f64,
        /// The most that people weigh, kg.
        most_kg: f64,
    },
    /// The stature is not known.
    #[error(
        "the person is upright in no frame, so that the stature, which the table is scaled by, is not known: \
         give `height_m`, or `static`, a trial in which she stands"
    )]
    NeverUpright,
    /// A marker's name means two.
    #[error("{name}: two markers are called {marker}: which is which is not known; rename one of them")]
    Twice {
        /// The trial.
        name: String,
        /// The marker.
        marker: String,
    },
    /// Markers are not where the model has them.
    #[error(
        "{name}: its markers are {off_mm:.0} mm off the model that all trials share (usual are less than 10 \
         mm), most {marker}: is it a trial of another person, with other markers, or are some exchanged?"
    )]
    OffTheModel {
        /// The trial.
        name: String,
        /// Root mean square of the distances, mm.
        off_mm: f64,
        /// The marker that is farthest off.
        marker: String,
    },
    /// No frame can be used.
    #[error("{name}: {why}")]
    NoFrames {
        /// The trial.
        name: String,
        /// Why not, and what to do.
        why: String,
    },
}
