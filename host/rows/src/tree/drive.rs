//! The parts that turn with the joints and rub: friction, offsets and rotor inertia, as columns beside the
//! links'.
//!
//! If a drive is at rest, dry friction is anything of its size, and its rows tell nothing (`standstill`).

use rigident_shared::tree::Link;

use rigident_model::Model;
use rigident_model::passive::Passive;

/// Rate at which what Stribeck's curve adds at rest has fallen to 1/e, of something that turns, rad/s, and
/// that slides, m/s: 10 rad/s of a motor behind a gear of 100 (A. Bittencourt, S. Gunnarsson, "Static
/// friction in a robot joint", J. Dyn. Sys. Meas. Control 134 (5), 2012).
const STRIBECK_RATE: (f64, f64) = (0.1, 0.01);

/// A column of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term {
    /// Proportional to the rate.
    Viscous,
    /// Of one size, against the rate: `tanh(v/v_c)`, as contacts slip a little before they slide (C. Canudas
    /// de Wit and others, IEEE Trans. Automatic Control 40 (3), 1995); 0 is the sign of the rate, `None` the
    /// speed v_c that the recording shows (`friction_speed`).
    Coulomb(Option<f64>),
    /// Against the rate, and less the faster it is: `sign(v) exp(−(v/v_s)²)`, with v_s where it is said (B.
    /// Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30 (7), 1994).
    Stribeck(Option<f64>),
    /// Against the rate, and proportional to what the drive carries: `sign(v) |τ|`, τ being the measured
    /// effort, without unit (P. Hamon, M. Gautier, P. Garrec, "Dynamic identification of robots with a dry
    /// friction model depending on load and velocity", IROS 2010).
    Load,
    /// Constant: of current sensors, or friction that differs by direction.
    Offset,
    /// Proportional to the rate's derivative: a rotor behind a gear.
    Rotor,
    /// Proportional to the position: a spring. Where it is slack is a constant beside it ([`Term::Offset`]).
    Spring,
}

/// The state of a drive at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveState {
    /// Position of the drive, rad or m.
    pub position: f64,
    /// Rate of the drive, rad/s or m/s.
    pub rate: f64,
    /// The effort that the drive carries, N m or N.
    pub load: f64,
}

impl Term {
    /// Returns the term of a word.
    ///
    /// # Errors
    /// Returns the word if there is no such term.
    pub fn parse(word: &str) -> Result<Self, String> {
        let word = word.trim();
        match word {
            "viscous" => return Ok(Self::Viscous),
            "coulomb" => return Ok(Self::Coulomb(None)),
            "stribeck" => return Ok(Self::Stribeck(None)),
            "load" => return Ok(Self::Load),
            "offset" => return Ok(Self::Offset),
            "rotor" => return Ok(Self::Rotor),
            "spring" => return Ok(Self::Spring),
            _ => {}
        }
        let speed = |text: &str| text.trim().parse::<f64>().ok().filter(|speed| speed.is_finite());
        if let Some(text) = word.strip_prefix("coulomb:") {
            return match speed(text).filter(|speed| *speed >= 0.0) {
                Some(speed) => Ok(Self::Coulomb(Some(speed))),
                None => Err(format!(
                    "`friction` {word}: is written as coulomb:SPEED, rad/s or m/s, for example coulomb:0.02; \
                     coulomb:0 has the sign of the rate"
                )),
            };
        }
        let Some(text) = word.strip_prefix("stribeck:") else {
            return Err(format!(
                "`friction` {word}: there are viscous, coulomb, stribeck, load, offset, rotor, spring and \
                 none"
            ));
        };
        match speed(text).filter(|speed| *speed > 0.0) {
            Some(speed) => Ok(Self::Stribeck(Some(speed))),
            None => Err(format!(
                "`friction` {word}: is written as stribeck:RATE with a rate above zero, rad/s or m/s, for \
                 example stribeck:0.05"
            )),
        }
    }

    /// Returns the word of the term.
    pub fn name(self) -> &'static str {
        match self {
            Self::Viscous => "viscous",
            Self::Coulomb(_) => "coulomb",
            Self::Stribeck(_) => "stribeck",
            Self::Load => "load",
            Self::Offset => "offset",
            Self::Rotor => "rotor",
            Self::Spring => "spring",
        }
    }

    /// Returns the word that it is parsed from.
    pub fn word(self) -> String {
        match self {
            Self::Stribeck(Some(rate)) => format!("stribeck:{rate}"),
            Self::Coulomb(Some(speed)) => format!("coulomb:{speed}"),
            other => other.name().to_owned(),
        }
    }

    /// Returns the unit of the term's parameter, for a drive that turns or slides.
    pub fn unit(self, slides: bool) -> &'static str {
        match (self, slides) {
            (Self::Viscous, false) => "N m s",
            (Self::Viscous, true) => "N s/m",
            (Self::Coulomb(_) | Self::Stribeck(_) | Self::Offset, false) => "N m",
            (Self::Coulomb(_) | Self::Stribeck(_) | Self::Offset, true) => "N",
            (Self::Load, _) => "1",
            (Self::Rotor, false) => "kg m2",
            (Self::Rotor, true) => "kg",
            (Self::Spring, false) => "N m/rad",
            (Self::Spring, true) => "N/m",
        }
    }

    /// Returns true if it has the sign of the rate: where that is not known, it may be anything of its size.
    pub fn is_dry(self) -> bool {
        matches!(self, Self::Coulomb(_) | Self::Stribeck(_) | Self::Load)
    }

    /// Returns its column at an instant, before the filter. What is multiplied by `smoothed` is smoothed, the
    /// rest differentiated.
    pub fn column(self, motion: &DriveState, slides: bool, smoothed: bool) -> f64 {
        let DriveState { position, rate, load } = *motion;
        // At rest it is nowhere.
        let sign = if rate == 0.0 { 0.0 } else { rate.signum() };
        match (self, smoothed) {
            (Self::Viscous, true) | (Self::Rotor, false) => rate,
            (Self::Coulomb(Some(speed)), true) if speed > 0.0 => (rate / speed).tanh(),
            (Self::Coulomb(_), true) => sign,
            (Self::Stribeck(given), true) => {
                let usual = if slides { STRIBECK_RATE.1 } else { STRIBECK_RATE.0 };
                sign * (-(rate / given.unwrap_or(usual)).powi(2)).exp()
            }
            (Self::Load, true) => sign * load.abs(),
            (Self::Offset, true) => 1.0,
            (Self::Spring, true) => position,
            _ => 0.0,
        }
    }

    /// Returns what its column has more if it turns over as slowly as `x/√(1 + x²)` does, with `x = v/v_c`.
    pub fn slower(self, rate: f64) -> f64 {
        match self {
            Self::Coulomb(Some(speed)) if speed > 0.0 => {
                let x = rate / speed;
                x / 1.0_f64.hypot(x) - x.tanh()
            }
            _ => 0.0,
        }
    }

    /// Returns the derivative of its column by the logarithm of the speed at which it turns over.
    pub fn slope_by_speed(self, rate: f64) -> f64 {
        match self {
            Self::Coulomb(Some(speed)) if speed > 0.0 => {
                let x = rate / speed;
                -x * (1.0 - x.tanh().powi(2))
            }
            _ => 0.0,
        }
    }
}

/// A part of a drive's friction that changes by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrictionPart {
    /// That proportional to the rate.
    Viscous,
    /// That of one size, against the rate.
    Dry,
}

impl FrictionPart {
    /// Returns true if a term belongs to it.
    pub fn has(self, term: Term) -> bool {
        match self {
            Self::Viscous => term == Term::Viscous,
            Self::Dry => matches!(term, Term::Coulomb(_)),
        }
    }

    /// Returns the column of a term at a rate; zero if it does not belong to this part.
    pub fn column(self, term: Term, rate: f64) -> f64 {
        let motion = DriveState { rate, ..DriveState::default() };
        if self.has(term) { term.column(&motion, false, true) } else { 0.0 }
    }
}

/// Returns the columns that a joint's own friction, rotor and spring are values of.
pub fn stated(passive: &Passive) -> [(Term, f64); 5] {
    let [viscous, coulomb, rotor, spring, offset] = passive.terms().map(|(_, value)| value);
    [
        (Term::Viscous, viscous),
        (Term::Coulomb(None), coulomb),
        (Term::Rotor, rotor),
        (Term::Spring, spring),
        (Term::Offset, offset),
    ]
}

/// The columns of drives: everywhere, and of drives by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Friction {
    /// Of every drive that is not named.
    pub everywhere: Vec<Term>,
    /// Of drives by name, joints' own or others, instead.
    pub by_drive: Vec<(String, Vec<Term>)>,
    /// True if `none` was said of all: what a model states of its joints has no columns either.
    pub none: bool,
}

impl From<Vec<Term>> for Friction {
    fn from(everywhere: Vec<Term>) -> Self {
        Self { everywhere, ..Self::default() }
    }
}

impl Friction {
    /// Reads lists: `viscous,coulomb` for all drives, and `NAME=viscous,coulomb` or `NAME=none` for one.
    /// Lists of the same drives are taken together.
    ///
    /// # Errors
    /// Returns a message about a list that cannot be read.
    pub fn parse<S: AsRef<str>>(lists: &[S]) -> Result<Self, String> {
        let mut all = Self::default();
        for list in lists.iter().map(AsRef::as_ref) {
            let (name, words) = match list.rsplit_once('=') {
                Some((name, words)) if !name.trim().is_empty() => (Some(name.trim()), words),
                Some(_) => {
                    return Err(format!(
                        "`friction` {list}: is written as JOINT=LIST, for example joint_1=viscous"
                    ));
                }
                None => (None, list),
            };
            all.none |= name.is_none() && words.trim() == "none";
            let terms = match words.trim() {
                "none" => Vec::new(),
                words => words.split(',').map(Term::parse).collect::<Result<Vec<_>, _>>()?,
            };
            let own = match name {
                None => &mut all.everywhere,
                Some(name) => {
                    if all.by_drive.iter().all(|(own, _)| own != name) {
                        all.by_drive.push((name.to_owned(), Vec::new()));
                    }
                    match all.by_drive.iter_mut().find(|(own, _)| own == name) {
                        Some((_, own)) => own,
                        None => continue,
                    }
                }
            };
            for term in terms {
                if own.iter().all(|there| there.name() != term.name()) {
                    own.push(term);
                }
            }
        }
        Ok(all)
    }

    /// Returns the columns everywhere, then those of each drive that is named.
    pub fn lists(&self) -> impl Iterator<Item = &Vec<Term>> {
        [&self.everywhere].into_iter().chain(self.by_drive.iter().map(|(_, terms)| terms))
    }

    /// Returns the same to be changed.
    pub fn lists_mut(&mut self) -> impl Iterator<Item = &mut Vec<Term>> {
        [&mut self.everywhere].into_iter().chain(self.by_drive.iter_mut().map(|(_, terms)| terms))
    }

    /// Forgets at which speeds dry friction turns over.
    pub fn forget_speeds(&mut self) {
        for term in self.lists_mut().flatten() {
            if let Term::Coulomb(speed) = term {
                *speed = None;
            }
        }
    }

    /// Returns these columns and those of what a model states of its joints, rotors, friction and springs,
    /// with the names of the parameters that only the model asks for. A joint of which `none` is said has
    /// none of these; still poses show springs alone.
    #[must_use]
    pub fn beside(&self, model: &Model, is_static: bool) -> (Self, Vec<String>) {
        let (mut all, mut added) = (self.clone(), Vec::new());
        let links = model.links.iter().skip(1).filter(|link| link.link.joint.freedoms() == 1 && !self.none);
        for link in links {
            let name = &link.joint_name;
            let mut own = self.of(name).to_vec();
            if own.is_empty() && self.by_drive.iter().any(|(drive, _)| drive == name) {
                continue;
            }
            let count = own.len();
            for (term, value) in stated(&link.passive[0]) {
                let is_seen = !is_static || matches!(term, Term::Spring | Term::Offset);
                if value != 0.0 && is_seen && own.iter().all(|there| there.name() != term.name()) {
                    added.push(format!("{name}.{}", term.name()));
                    own.push(term);
                }
            }
            if own.len() > count {
                all.by_drive.retain(|(drive, _)| drive != name);
                all.by_drive.push((name.clone(), own));
            }
        }
        (all, added)
    }

    /// Returns true if no drive has a column.
    pub fn is_empty(&self) -> bool {
        self.lists().all(Vec::is_empty)
    }

    /// Returns the columns of a drive.
    pub fn of(&self, drive: &str) -> &[Term] {
        self.by_drive.iter().find(|(name, _)| name == drive).map_or(&self.everywhere, |(_, terms)| terms)
    }

    /// Checks that every drive that is named is one of these.
    ///
    /// # Errors
    /// The name that is none.
    pub fn check(&self, drives: &[Drive]) -> Result<(), String> {
        let known: Vec<&str> = drives.iter().map(|drive| drive.name.as_str()).collect();
        match self.by_drive.iter().find(|(name, _)| !known.contains(&name.as_str())) {
            None => Ok(()),
            Some((name, _)) => {
                Err(format!("`friction` {name}=…: there is no joint {name}; there are {}", known.join(", ")))
            }
        }
    }
}

/// Something whose rate is a sum of joint rates: a joint's own drive, or one that turns with two of a coupled
/// wrist. By virtual work what rubs there acts on these joints in the same proportion.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// The name of the drive.
    pub name: String,
    /// Freedoms and their factors.
    pub rates: Vec<(usize, f64)>,
    /// The friction terms of the drive, a column each.
    pub terms: Vec<Term>,
    /// It slides.
    pub slides: bool,
    /// It never moves: nothing tells of its dry friction.
    pub stands: bool,
    /// Place of its position among those of a frame; `None` of a sum of joints, and of a freedom of a ball.
    pub coordinate: Option<usize>,
}

impl Drive {
    /// Returns one drive for every freedom of these names.
    pub fn of_joints(names: &[String], links: &[Link<f64>], friction: &Friction) -> Vec<Self> {
        let slides = links.iter().skip(1).flat_map(|l| {
            let slide = matches!(l.joint, rigident_shared::tree::Joint::Prismatic(_));
            std::iter::repeat_n(slide, l.joint.freedoms())
        });
        let mut coordinates = Vec::new();
        let mut at = 0;
        for joint in links.iter().skip(1).map(|l| &l.joint) {
            coordinates.extend(std::iter::repeat_n((joint.freedoms() == 1).then_some(at), joint.freedoms()));
            at += joint.coordinates();
        }
        names
            .iter()
            .zip(slides)
            .zip(coordinates)
            .enumerate()
            .map(|(k, ((name, slides), coordinate))| Self {
                name: name.clone(),
                rates: vec![(k, 1.0)],
                terms: friction.of(name).to_vec(),
                slides,
                stands: false,
                coordinate,
            })
            .collect()
    }

    /// Reads a drive from `NAME=J1+J2`, `NAME=J1-J2` or `NAME=0.5*J1-2*J2`: sums of freedoms by name.
    ///
    /// # Errors
    /// Returns a message about words that cannot be read, or about a joint that is missing.
    pub fn parse(words: &str, names: &[String], friction: &Friction) -> Result<Self, String> {
        let refuse = |why: String| format!("`drive` {words}: {why}");
        let form = || {
            let form =
                "is written as NAME=JOINT+JOINT, for example m6=joint_5+joint_6 or m6=0.5*joint_5-joint_6";
            refuse(form.to_owned())
        };
        let (name, sum) = words.split_once('=').ok_or_else(form)?;
        let mut rates: Vec<(usize, f64)> = Vec::new();
        let mut rest = sum.trim();
        while !rest.is_empty() {
            let (k, factor, more) = first_of_sum(rest, names).map_err(refuse)?;
            if rates.iter().any(|(other, _)| *other == k) {
                return Err(refuse(format!("{} is in it twice: give the sum of both", names[k])));
            }
            rates.push((k, factor));
            rest = more;
        }
        if name.trim().is_empty() || rates.is_empty() {
            return Err(form());
        }
        // A constant that acts on several joints is the sum of theirs, and springs are at joints.
        let terms = friction.of(name.trim()).iter().copied().filter(|term| *term != Term::Spring);
        let terms = terms.filter(|term| rates.len() == 1 || *term != Term::Offset).collect();
        Ok(Self {
            name: name.trim().to_owned(),
            rates,
            terms,
            slides: false,
            stands: false,
            coordinate: None,
        })
    }

    /// Returns the freedoms that it turns with, as [`Drive::parse`] takes them.
    pub fn sum(&self, names: &[String]) -> String {
        let mut sum = String::new();
        for (k, factor) in &self.rates {
            if *factor < 0.0 {
                sum.push('-');
            } else if !sum.is_empty() {
                sum.push('+');
            }
            if factor.abs() != 1.0 {
                sum.push_str(&format!("{}*", factor.abs()));
            }
            sum.push_str(names.get(*k).map_or("", String::as_str));
        }
        sum
    }

    /// Returns what it does at the positions of a frame and the rates and efforts of all freedoms.
    pub fn motion(&self, positions: &[f64], rates: &[f64], efforts: &[f64]) -> DriveState {
        let position = self.coordinate.and_then(|at| positions.get(at)).copied().unwrap_or(0.0);
        DriveState { position, rate: self.rate(rates), load: self.load(efforts) }
    }

    /// Returns the rate of the drive, rad/s or m/s, from the rates of all freedoms.
    pub fn rate(&self, rates: &[f64]) -> f64 {
        self.rates.iter().map(|(k, factor)| factor * rates.get(*k).copied().unwrap_or(0.0)).sum()
    }

    /// Returns the effort that it carries, of those of the freedoms: that of the last that it turns with.
    pub fn load(&self, efforts: &[f64]) -> f64 {
        self.rates.last().and_then(|(k, _)| efforts.get(*k)).copied().unwrap_or(0.0)
    }
}

/// Returns the first freedom of a sum, its factor, and what comes after it.
fn first_of_sum<'a>(sum: &'a str, names: &[String]) -> Result<(usize, f64, &'a str), String> {
    // A joint's name may hold a dash, or begin with a number: the longest names first.
    let joint = |text: &'a str| {
        let found = names.iter().enumerate().filter_map(|(k, name)| {
            let more = text.strip_prefix(name.as_str())?.trim_start();
            (more.is_empty() || more.starts_with(['+', '-'])).then_some((k, name.len(), more))
        });
        found.max_by_key(|(_, length, _)| *length).map(|(k, _, more)| (k, more))
    };
    if let Some((k, more)) = joint(sum) {
        return Ok((k, 1.0, more));
    }
    let (sign, text) = match sum.strip_prefix(['+', '-']) {
        Some(text) => (if sum.starts_with('-') { -1.0 } else { 1.0 }, text.trim_start()),
        None => (1.0, sum),
    };
    let factor = text.split_once('*').and_then(|(number, rest)| {
        let number = number.trim().parse().ok().filter(|v: &f64| v.is_finite() && *v != 0.0)?;
        Some((number, rest.trim_start()))
    });
    let (factor, text) = factor.unwrap_or((1.0, text));
    match joint(text) {
        Some((k, more)) => Ok((k, sign * factor, more)),
        None => Err(format!("there is no joint {text}; there are {}", names.join(", "))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drives_are_sums_of_joints_by_name() {
        let names = ["j-1", "j", "joint_5", "joint_6"].map(str::to_owned);
        let friction = Friction::from(vec![Term::Viscous, Term::Offset]);
        let drive = Drive::parse("m6=joint_5+joint_6", &names, &friction).unwrap();
        assert_eq!(drive.rates, [(2, 1.0), (3, 1.0)]);
        assert_eq!(drive.terms, [Term::Viscous]);
        let none = Friction::default();
        let drive = Drive::parse("d=j-1-j", &names, &none).unwrap();
        assert_eq!(drive.rates, [(0, 1.0), (1, -1.0)]);
        assert_eq!(drive.rate(&[3.0, 1.0, 0.0, 0.0]), 2.0);
        assert!(Drive::parse("m6=joint_7", &names, &none).unwrap_err().contains("there are j-1, j, joint_5"));
        assert!(Drive::parse("m6", &names, &none).unwrap_err().contains("NAME=JOINT"));
        // By any gear, as a puma's wrist has it; what it is said to be is read again.
        let drive = Drive::parse("m6=-0.25 * joint_5 + j-1 - 2e-1*j", &names, &none).unwrap();
        assert_eq!(drive.rates, [(2, -0.25), (0, 1.0), (1, -0.2)]);
        assert_eq!(drive.sum(&names), "-0.25*joint_5+j-1-0.2*j");
        assert_eq!(Drive::parse(&format!("m6={}", drive.sum(&names)), &names, &none).unwrap(), drive);
        for wrong in ["m6=0*j", "m6=x*j", "m6=0.5*", "m6=j+0.5*j", "m6=nan*j", "m6="] {
            assert!(Drive::parse(wrong, &names, &none).is_err(), "{wrong}");
        }
        assert!(Term::parse("stiction").unwrap_err().contains("viscous, coulomb"));
    }

    #[test]
    fn friction_is_said_for_all_and_by_joint() {
        let friction =
            Friction::parse(&["viscous,coulomb", "j2=none", "j3=viscous,stribeck:0.05", "j3=load"]).unwrap();
        assert_eq!(friction.of("j1"), [Term::Viscous, Term::Coulomb(None)]);
        assert!(friction.of("j2").is_empty());
        assert_eq!(friction.of("j3"), [Term::Viscous, Term::Stribeck(Some(0.05)), Term::Load]);
        assert!(Friction::parse(&["none", "j=none"]).unwrap().is_empty());
        for wrong in ["=viscous", "j=", "j=stribeck:0", "stribeck:-1", "stribeck:x", "j=none,viscous"] {
            assert!(Friction::parse(&[wrong]).is_err(), "{wrong}");
        }
        let drive = |name: &str| Drive {
            name: name.to_owned(),
            rates: Vec::new(),
            terms: Vec::new(),
            slides: false,
            stands: false,
            coordinate: None,
        };
        assert!(friction.check(&[drive("j1"), drive("j2"), drive("j3")]).is_ok());
        assert!(friction.check(&[drive("j1"), drive("j2")]).unwrap_err().contains("no joint j3"));
    }

    /// Terms that a model states of a joint are added to the list; `none` takes them out again.
    #[test]
    fn terms_that_a_model_states_have_columns() {
        let urdf = "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/><joint \
                    name=\"j1\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/><dynamics \
                    damping=\"0.5\"/></joint><joint name=\"j2\" type=\"continuous\"><parent \
                    link=\"b\"/><child link=\"c\"/><dynamics damping=\"1\" \
                    friction=\"2\"/></joint></robot>";
        let model = rigident_model::urdf::parse(urdf, "r").unwrap();
        let beside = |lists: &[&str], still: bool| Friction::parse(lists).unwrap().beside(&model, still);
        let (own, added) = beside(&["coulomb:0,rotor"], false);
        assert_eq!(own.of("j1"), [Term::Coulomb(Some(0.0)), Term::Rotor, Term::Viscous]);
        assert_eq!(added, ["j1.viscous", "j2.viscous"]);
        let (own, added) = beside(&["j2=none"], false);
        assert_eq!((own.of("j1"), own.of("j2")), (&[Term::Viscous][..], &[][..]));
        assert_eq!(added, ["j1.viscous"]);
        assert_eq!(beside(&[], false).1, ["j1.viscous", "j2.viscous", "j2.coulomb"]);
        assert!(beside(&["none"], false).0.is_empty() && beside(&[], true).0.is_empty());
    }

    #[test]
    fn dry_friction_has_the_sign_of_the_rate_and_its_own_size() {
        let at = |rate: f64, load: f64| DriveState { position: 0.5, rate, load };
        for sign in [1.0, -1.0] {
            assert_eq!(Term::Coulomb(None).column(&at(sign * 0.3, 5.0), false, true), sign);
            assert_eq!(Term::Coulomb(Some(0.0)).column(&at(sign * 0.3, 5.0), false, true), sign);
            let smooth = Term::Coulomb(Some(0.2)).column(&at(sign * 0.3, 5.0), false, true);
            assert!((smooth * sign - 1.5_f64.tanh()).abs() < 1e-15);
            assert_eq!(Term::Load.column(&at(sign * 0.3, -5.0), false, true), sign * 5.0);
            let stribeck = |rate: f64| Term::Stribeck(Some(0.3)).column(&at(sign * rate, 5.0), false, true);
            assert!((stribeck(0.3) * sign - (-1.0_f64).exp()).abs() < 1e-15);
            assert!((stribeck(1e-9) * sign - 1.0).abs() < 1e-9);
        }
        assert!(Term::Load.is_dry() && !Term::Viscous.is_dry());
        assert_eq!(Term::Rotor.column(&at(2.0, 0.0), false, false), 2.0);
        assert_eq!(Term::Rotor.column(&at(2.0, 0.0), false, true), 0.0);
        assert_eq!(Term::Spring.column(&at(2.0, 0.0), false, true), 0.5);
        assert_eq!(Term::Spring.column(&at(2.0, 0.0), false, false), 0.0);
    }
}
