//! Why gains of drives are not found.

/// Why gains are not looked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DriveGainsError {
    /// No joint has an effort.
    #[error(
        "{0} has no efforts of joints: name their columns in the rig file, [[joint]] effort, or JOINT_a if \
         they are currents in A"
    )]
    NoEfforts(String),
    /// Recordings with efforts of other joints.
    #[error("{0} has efforts of other joints, or in other columns, than the first recording")]
    OtherEfforts(String),
    /// Nothing that a gain could be compared with.
    #[error("{0} has no masses: the first guess of the gains is taken from a model's torques")]
    NoMasses(String),
    /// The nominal torques explain nothing of the efforts.
    #[error(
        "nothing of the efforts in {0} is explained by the model's torques: are the columns those of these \
         joints, and do they move?"
    )]
    NothingExplained(String),
    /// Rows that say nothing of the gains.
    #[error("the rows determine nothing of the gains of {0}")]
    NoRows(String),
    /// A recording that cannot be true.
    #[error("{name} cannot be true, whatever the gains are: {why}")]
    Implausible {
        /// The recording.
        name: String,
        /// The contradiction, in words.
        why: String,
    },
    /// The trust in the nominal model is no standard deviation, or is given beside a load.
    #[error(
        "the nominal model's links are trusted within a share above zero, and only where there is no load: \
         {0}"
    )]
    NominalSigma(f64),
}
