//! The passive parameters of a joint: rotor inertia, friction and springs, as robot descriptions state them.

use rigident_shared::tree::Joint;

use super::xml::Language;

/// Numbers that were multiplied by a gear ratio and divided by it again differ by no more, relative.
const ROUNDING: f64 = 1e-12;

/// The addition of one axis of a joint to the effort that the links need:
/// `armature · q̈ + damping · q̇ + friction · sign q̇ +
/// stiffness · (q − spring_reference)`. All are zero where a file says nothing.
///
/// A ball has one for its three freedoms. Units are those of a turning joint; a sliding one has m for rad and
/// N for N m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Passive {
    /// Inertia of the rotor as the joint feels it, kg m².
    pub armature: f64,
    /// Viscous friction, N m s/rad.
    pub damping: f64,
    /// Coulomb friction, N m.
    pub friction: f64,
    /// Stiffness of a spring, N m/rad.
    pub stiffness: f64,
    /// The position where that spring is slack, rad from the model's zero.
    pub spring_reference: f64,
}

impl Passive {
    /// Returns the numbers with the words that columns of friction have for them. A spring that is slack at
    /// q₀ adds `stiffness · q` and the constant `−stiffness · q₀`.
    pub fn terms(&self) -> [(&'static str, f64); 5] {
        [
            ("viscous", self.damping),
            ("coulomb", self.friction),
            ("rotor", self.armature),
            ("spring", self.stiffness),
            ("offset", -self.stiffness * self.spring_reference),
        ]
    }

    /// Returns the numbers with the words that MJCF has for them.
    pub(super) fn named(&self) -> [(&'static str, f64); 5] {
        [
            ("armature", self.armature),
            ("damping", self.damping),
            ("frictionloss", self.friction),
            ("stiffness", self.stiffness),
            ("springref", self.spring_reference),
        ]
    }

    /// Returns what of it a language has words for at a joint; a spring without stiffness is none.
    #[must_use]
    pub(super) fn said_in(self, language: Language, joint: &Joint<f64>) -> Self {
        let spring_reference = if self.stiffness == 0.0 { 0.0 } else { self.spring_reference };
        let all = Self { spring_reference, ..self };
        match (language, joint) {
            (_, Joint::Fixed | Joint::Free) | (Language::Sdf, Joint::Spherical) => Self::default(),
            // A ball's spring pulls to the model's zero.
            (Language::Mjcf, Joint::Spherical) => Self { spring_reference: 0.0, ..all },
            (Language::Mjcf, _) => all,
            // Drake's words for rotors are for joints of one axis.
            (Language::Sdf, Joint::Universal(..)) => Self { armature: 0.0, ..all },
            (Language::Sdf, _) => all,
            (Language::Urdf, Joint::Spherical) => Self { armature: 0.0, ..self.of_urdf() },
            (Language::Urdf, _) => self.of_urdf(),
        }
    }

    /// Returns it without the springs that URDF has no words for.
    fn of_urdf(self) -> Self {
        Self { stiffness: 0.0, spring_reference: 0.0, ..self }
    }

    /// Returns true if both are the same but for rounding.
    pub(super) fn is_same_as(&self, other: &Self) -> bool {
        let mut pairs = self.named().into_iter().zip(other.named());
        pairs.all(|((_, own), (_, other))| (own - other).abs() <= ROUNDING * own.abs().max(other.abs()))
    }

    /// Returns it as attributes or elements of a joint, or of an axis in SDF; empty where nothing is to be
    /// said. Rotors of URDF and SDF are elsewhere ([`super::transmission`]).
    pub(super) fn written(self, language: Language, joint: &Joint<f64>) -> String {
        let own = self.said_in(language, joint);
        if own == Self::default() {
            return String::new();
        }
        let Self { damping, friction, stiffness, spring_reference, .. } = own;
        match language {
            // Nothing but a rotor.
            Language::Urdf | Language::Sdf if [damping, friction, stiffness] == [0.0; 3] => String::new(),
            Language::Urdf => format!("<dynamics damping=\"{damping}\" friction=\"{friction}\"/>"),
            Language::Mjcf => {
                let stated = own.named().into_iter().filter(|(_, value)| *value != 0.0);
                stated.map(|(name, value)| format!(" {name}=\"{value}\"")).collect()
            }
            Language::Sdf => format!(
                "<dynamics><damping>{damping}</damping><friction>{friction}</friction><spring_reference>{spring_reference}</spring_reference><spring_stiffness>{stiffness}</spring_stiffness></dynamics>"
            ),
        }
    }
}
