//! What turns with the joints and rubs: friction, offsets and rotor inertia, as columns beside the links'.

use rigident_shared::tree::Link;

/// A column of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Term {
    /// Proportional to the rate.
    Viscous,
    /// Of one size, against the rate.
    Coulomb,
    /// Constant: of current sensors, or friction that differs by direction.
    Offset,
    /// Proportional to the rate's derivative: a rotor behind a gear.
    Rotor,
}

impl Term {
    /// From its word.
    ///
    /// # Errors
    /// The word that is none.
    pub fn parse(word: &str) -> Result<Self, String> {
        match word.trim() {
            "viscous" => Ok(Self::Viscous),
            "coulomb" => Ok(Self::Coulomb),
            "offset" => Ok(Self::Offset),
            "rotor" => Ok(Self::Rotor),
            other => Err(format!("--friction {other}: there are viscous, coulomb, offset and rotor")),
        }
    }

    /// Its word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Viscous => "viscous",
            Self::Coulomb => "coulomb",
            Self::Offset => "offset",
            Self::Rotor => "rotor",
        }
    }

    /// Unit of its parameter, for something that turns or slides.
    pub fn unit(self, slides: bool) -> &'static str {
        match (self, slides) {
            (Self::Viscous, false) => "N m s",
            (Self::Viscous, true) => "N s/m",
            (Self::Coulomb | Self::Offset, false) => "N m",
            (Self::Coulomb | Self::Offset, true) => "N",
            (Self::Rotor, false) => "kg m2",
            (Self::Rotor, true) => "kg",
        }
    }
}

/// Something whose rate is a sum of joint rates: a joint's own drive, or one that turns with two of a coupled wrist. By
/// virtual work what rubs there acts on these joints in the same proportion.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Its name.
    pub name: String,
    /// Freedoms and their factors.
    pub rates: Vec<(usize, f64)>,
    /// Its columns.
    pub terms: Vec<Term>,
    /// It slides.
    pub slides: bool,
}

impl Drive {
    /// One for every freedom of these names.
    pub fn of_joints(names: &[String], links: &[Link<f64>], terms: &[Term]) -> Vec<Self> {
        let slides = links.iter().skip(1).flat_map(|l| {
            let slide = matches!(l.joint, rigident_shared::tree::Joint::Prismatic(_));
            std::iter::repeat_n(slide, l.joint.freedoms())
        });
        names
            .iter()
            .zip(slides)
            .enumerate()
            .map(|(k, (name, slides))| Self {
                name: name.clone(),
                rates: vec![(k, 1.0)],
                terms: terms.to_vec(),
                slides,
            })
            .collect()
    }

    /// From `NAME=J1+J2` or `NAME=J1-J2`: sums of freedoms by name.
    ///
    /// # Errors
    /// What is no such thing, or no such joint.
    pub fn parse(words: &str, names: &[String], terms: &[Term]) -> Result<Self, String> {
        let refuse = |why: String| format!("--drive {words}: {why}");
        let (name, sum) = words
            .split_once('=')
            .ok_or_else(|| refuse("stands as NAME=JOINT+JOINT, for example m6=joint_5+joint_6".to_owned()))?;
        let mut rates = Vec::new();
        // A joint's name may hold a dash: the longest names first.
        let mut rest = sum.trim();
        let mut factor = 1.0;
        while !rest.is_empty() {
            let found = names.iter().enumerate().filter(|(_, n)| {
                rest.strip_prefix(n.as_str())
                    .is_some_and(|more| more.is_empty() || more.starts_with(['+', '-']))
            });
            let Some((k, joint)) = found.max_by_key(|(_, n)| n.len()) else {
                return Err(refuse(format!("there is no joint {rest}; there are {}", names.join(", "))));
            };
            rates.push((k, factor));
            rest = &rest[joint.len()..];
            factor = if rest.starts_with('-') { -1.0 } else { 1.0 };
            rest = rest.get(1..).unwrap_or_default().trim();
        }
        if name.trim().is_empty() || rates.is_empty() {
            return Err(refuse("stands as NAME=JOINT+JOINT, for example m6=joint_5+joint_6".to_owned()));
        }
        // A constant that acts on several joints is the sum of theirs.
        let terms = terms.iter().copied().filter(|term| rates.len() == 1 || *term != Term::Offset).collect();
        Ok(Self { name: name.trim().to_owned(), rates, terms, slides: false })
    }

    /// Its rate.
    pub fn rate(&self, rates: &[f64]) -> f64 {
        self.rates.iter().map(|(k, factor)| factor * rates.get(*k).copied().unwrap_or(0.0)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drives_are_sums_of_joints_by_name() {
        let names = ["j-1", "j", "joint_5", "joint_6"].map(str::to_owned);
        let drive = Drive::parse("m6=joint_5+joint_6", &names, &[Term::Viscous, Term::Offset]).unwrap();
        assert_eq!(drive.rates, [(2, 1.0), (3, 1.0)]);
        assert_eq!(drive.terms, [Term::Viscous]);
        let drive = Drive::parse("d=j-1-j", &names, &[]).unwrap();
        assert_eq!(drive.rates, [(0, 1.0), (1, -1.0)]);
        assert_eq!(drive.rate(&[3.0, 1.0, 0.0, 0.0]), 2.0);
        assert!(Drive::parse("m6=joint_7", &names, &[]).unwrap_err().contains("there are j-1, j, joint_5"));
        assert!(Drive::parse("m6", &names, &[]).unwrap_err().contains("NAME=JOINT"));
        assert!(Term::parse("stiction").unwrap_err().contains("viscous, coulomb"));
    }
}
