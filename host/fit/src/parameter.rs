//! Parameters and channels: what a factor's columns and a source's rows are called.

use serde::{Deserialize, Serialize};

/// The thing that a parameter belongs to.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Owner {
    /// A link of a tree; the one link of a rigid body has an empty name.
    Link(String),
    /// A joint's drive, or several joints' that turn together.
    Drive(String),
    /// A measured channel, by its name.
    Channel(String),
    /// Anything else, by its name.
    Other(String),
}

impl Owner {
    /// Returns its name.
    pub fn name(&self) -> &String {
        match self {
            Self::Link(name) | Self::Drive(name) | Self::Channel(name) | Self::Other(name) => name,
        }
    }
}

/// The kind of quantity, which decides what an uncertainty is judged against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Kind {
    /// Mass, kg.
    Mass,
    /// First moment of mass, kg m.
    FirstMoment,
    /// Moment or product of inertia, kg m².
    Inertia,
    /// Constant offset of a channel, in the channel's unit.
    Offset,
    /// Viscous friction, N m s or N s/m.
    Viscous,
    /// Coulomb friction, N m or N.
    Coulomb,
    /// Friction over the effort that the drive carries, without unit.
    Load,
    /// Inertia of a rotor about its joint, kg m² or kg.
    Rotor,
    /// Anything else: judged against its own value's scale as its source states it.
    Other,
}

/// One unknown.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Its name, unique in its model: `m`, `arm.MSx`, `offset_fx`.
    pub name: String,
    /// The thing that it belongs to.
    pub owner: Owner,
    /// Its kind.
    pub kind: Kind,
    /// Its SI unit in ASCII: `kg`, `kg m`, `kg m2`.
    pub unit: String,
    /// The frame that it is expressed in: `S`, or the link's name; empty where there is none.
    pub frame: String,
    /// The standard parameters (`arm.m`) that it is a sum of, with their weights, where rows tell
    /// combinations apart only; empty: it is by itself what its name says.
    pub made_of: Vec<(String, f64)>,
}

impl Kind {
    /// Returns true for what adds where bodies are bolted together: mass, first moment, tensor.
    pub fn is_inertial(self) -> bool {
        matches!(self, Self::Mass | Self::FirstMoment | Self::Inertia)
    }
}

impl Parameter {
    /// Builds a parameter that is no combination and has no frame.
    ///
    /// ```
    /// use rigident_fit::{Kind, Owner, Parameter};
    ///
    /// let inertia = Parameter::new("J", Owner::Link("pendulum".into()), Kind::Inertia, "kg m2");
    /// assert!(inertia.kind.is_inertial() && inertia.made_of.is_empty());
    /// ```
    pub fn new(name: impl Into<String>, owner: Owner, kind: Kind, unit: &str) -> Self {
        Self {
            name: name.into(),
            owner,
            kind,
            unit: unit.to_owned(),
            frame: String::new(),
            made_of: Vec::new(),
        }
    }

    /// Returns the name of the link that it belongs to; `None` if it belongs to something else.
    pub fn link(&self) -> Option<&str> {
        match &self.owner {
            Owner::Link(link) => Some(link),
            _ => None,
        }
    }

    /// Returns true if it is a single standard parameter, of weight one, or no combination at all.
    pub fn is_by_itself(&self) -> bool {
        matches!(self.made_of.as_slice(), [] | [(_, 1.0)])
    }
}

/// The motion of a drive, a joint's own or one that turns with several: its viscous friction is judged
/// against it.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveMotion {
    /// Its name.
    pub name: String,
    /// Names of the channels that hold its joints' efforts.
    pub channels: Vec<String>,
    /// Root mean square of its joints' summed rates, rad/s or m/s.
    pub rms_rate: f64,
    /// The sum of joints that it turns with: `joint_5+joint_6`.
    pub turns_with: String,
    /// Its columns by their words, those that others have absorbed not among them: `viscous`,
    /// `stribeck:0.05`.
    pub terms: Vec<String>,
}

/// One measured quantity, of which each sample gives a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Channel {
    /// Its name: `fx`, or a joint's.
    pub name: String,
    /// Its SI unit: `N`, `N m`.
    pub unit: String,
    /// Standard deviation of its white noise per sample; `None`: estimated from the residuals.
    pub sigma: Option<f64>,
    /// The place of its offset among the parameters, which no gain error multiplies; `None` if it has none.
    pub offset: Option<usize>,
    /// Channels of one group are weighed and compared together: forces (0), moments (1), one drive (from 2
    /// on).
    pub group: u8,
}

impl Channel {
    /// Returns true if it is the effort of a drive.
    pub fn is_drive(&self) -> bool {
        self.group > 1
    }
}
