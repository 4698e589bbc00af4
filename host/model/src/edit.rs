//! Changes to a model by option: joints locked, three revolutes declared spherical, a tool held.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rigident_shared::tree::{Joint, Link};

use super::finding::{Finding, ModelError};
use super::passive::Passive;
use super::tree::{Model, ModelLink, NO_BODY};

/// Axes pass through one point if they miss it by less, m: below any tolerance a joint is made to.
const COINCIDENCE_M: f64 = 1e-6;

/// A frame in a link's.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// The link.
    pub link: usize,
    /// Axes of the frame, as columns, in the link's.
    pub rotation: Matrix3<f64>,
    /// Origin of the frame in the link's frame, m.
    pub position: Vector3<f64>,
}

impl Model {
    /// Makes joints fixed: `JOINT` at zero, `JOINT=VALUE` at an angle, rad, or a length, m. Who follows a
    /// joint that is locked is locked with it where it then is, if it is not among them itself.
    ///
    /// # Errors
    /// [`ModelError::Option`] if there is no such joint, or it cannot be there.
    pub fn lock(&mut self, joints: &[String]) -> Result<(), ModelError> {
        let given = joints.iter().map(|words| self.locked(words)).collect::<Result<Vec<_>, _>>()?;
        let own: Vec<&str> = given.iter().map(|(name, _)| *name).collect();
        for (n, name) in own.iter().enumerate() {
            if own[..n].contains(name) {
                return Err(ModelError::Option(format!("`lock` {name}: it is given twice")));
            }
        }
        for (name, value) in &given {
            self.lock_at(name, value.unwrap_or(0.0), &own)?;
        }
        Ok(())
    }

    /// Returns a joint's name and position, of `JOINT` or `JOINT=VALUE`.
    ///
    /// # Errors
    /// [`ModelError::Option`] if there is no such joint, or the value is no number.
    pub fn locked<'a>(&self, words: &'a str) -> Result<(&'a str, Option<f64>), ModelError> {
        if self.joint(words).is_some() {
            return Ok((words, None));
        }
        let (name, value) = words.rsplit_once('=').unwrap_or((words, "0"));
        let name = name.trim();
        if self.joint(name).is_none() {
            return Err(self.no_joint("`lock`", name));
        }
        let value = value.trim().parse().ok().filter(|v: &f64| v.is_finite()).ok_or_else(|| {
            ModelError::Option(format!(
                "`lock` {words}: {value} is no number; it is written as JOINT=VALUE, rad for an angle, m for \
                 a length"
            ))
        })?;
        Ok((name, Some(value)))
    }

    fn lock_at(&mut self, name: &str, value: f64, others: &[&str]) -> Result<(), ModelError> {
        let i = self.joint(name).ok_or_else(|| self.no_joint("`lock`", name))?;
        match self.links[i].link.joint {
            Joint::Revolute(_) | Joint::Prismatic(_) => self.move_zero(i, value),
            _ if value == 0.0 => {}
            Joint::Fixed => {
                return Err(ModelError::Option(format!(
                    "`lock` {name}={value}: it is a fixed joint and stays where the model has it; leave it \
                     out"
                )));
            }
            _ => {
                return Err(ModelError::Option(format!(
                    "`lock` {name}={value}: a joint of several freedoms is locked at zero only; leave =VALUE \
                     out, or turn its link in the model"
                )));
            }
        }
        let link = &mut self.links[i];
        (link.link.joint, link.mimic, link.passive) = (Joint::Fixed, None, [Passive::default(); 2]);
        let place = format!("joint {name}");
        self.findings.retain(|finding| finding.place != place);
        let followers: Vec<(String, f64)> = self
            .links
            .iter()
            .filter(|l| !others.contains(&l.joint_name.as_str()))
            .filter_map(|l| {
                let mimic = l.mimic.as_ref().filter(|m| m.leader == *name)?;
                Some((l.joint_name.clone(), mimic.multiplier * value + mimic.offset))
            })
            .collect();
        for (follower, there) in followers {
            self.lock_at(&follower, there, others)?;
        }
        Ok(())
    }

    /// Moves the zero of the joint on which link `i` hangs to where it was at `value`, rad or m: `q` is then
    /// what `q + value` was. Joints of other than one freedom stay.
    pub fn move_zero(&mut self, i: usize, value: f64) {
        let Some(ModelLink { link, .. }) = self.links.get_mut(i).filter(|_| value != 0.0) else { return };
        match link.joint {
            Joint::Revolute(axis) => link.rotation *= Rotation3::new(axis * value).into_inner(),
            Joint::Prismatic(axis) => link.position += link.rotation * axis * value,
            _ => {}
        }
    }

    fn no_joint(&self, option: &str, name: &str) -> ModelError {
        let names: Vec<&str> =
            self.links.iter().skip(1).map(|l| l.joint_name.as_str()).filter(|n| !n.is_empty()).collect();
        ModelError::Option(format!(
            "{option}: {} has no joint {name}; its joints are {}",
            self.name,
            names.join(", ")
        ))
    }

    /// Replaces three revolute joints in a row, whose axes pass through one point and whose two links in
    /// between have no mass, by one spherical joint. The last link keeps its name and frame, the joint the
    /// last one's name.
    ///
    /// # Errors
    /// [`ModelError::Option`] that says what speaks against it.
    pub fn declare_spherical(&mut self, joints: &[String; 3]) -> Result<(), ModelError> {
        let refuse = |why: String| ModelError::Option(format!("`spherical` {}: {why}", joints.join(",")));
        let mut at = [0; 3];
        for (place, name) in at.iter_mut().zip(joints) {
            *place = self.joint(name).ok_or_else(|| self.no_joint("`spherical`", name))?;
        }
        let [a, b, c] = at;
        if self.links[b].link.parent != a || self.links[c].link.parent != b {
            return Err(refuse("the three do not follow each other, nearest to the base first".to_owned()));
        }
        let axis = |i: usize| match self.links[i].link.joint {
            Joint::Revolute(axis) if self.links[i].mimic.is_none() => Ok(axis),
            _ => Err(refuse(format!("{} is not a revolute joint of its own", self.links[i].joint_name))),
        };
        let axes = [axis(a)?, axis(b)?, axis(c)?];
        for i in [a, b] {
            let link = &self.links[i];
            if link.is_body() && link.nominal.is_some() {
                return Err(refuse(format!("link {} between them has mass", link.name)));
            }
            let below = self.links.iter().filter(|l| !l.joint_name.is_empty() && l.link.parent == i).count();
            if below > 1 {
                return Err(refuse(format!("more than one link hangs on link {} between them", link.name)));
            }
        }
        let (first, second, third) = (self.links[a].link, self.links[b].link, self.links[c].link);
        // Places of b and c in a's frame at zero.
        let rb = second.rotation;
        let pc = second.position + rb * third.position;
        let rc = rb * third.rotation;
        let miss = |through: Vector3<f64>, axis: Vector3<f64>| (pc - through).cross(&axis).norm();
        let (second_axis, third_axis) = (rb * axes[1], rc * axes[2]);
        let misses = [miss(Vector3::zeros(), axes[0]), miss(second.position, second_axis)];
        if let Some((k, far)) = misses.iter().enumerate().find(|(_, m)| **m > COINCIDENCE_M) {
            return Err(refuse(format!(
                "the axis of {} misses the origin of link {} by {:.4} mm",
                joints[k],
                self.links[c].name,
                far * 1e3
            )));
        }
        let parallel = |u: Vector3<f64>, v: Vector3<f64>| u.cross(&v).norm() < f64::EPSILON.sqrt();
        if parallel(axes[0], second_axis) || parallel(second_axis, third_axis) {
            return Err(refuse(
                "two axes next to each other are parallel: they make no spherical joint".to_owned(),
            ));
        }
        let position = first.position + first.rotation * pc;
        self.links[c].link =
            Link { parent: first.parent, joint: Joint::Spherical, rotation: first.rotation * rc, position };
        // Three hinges of their own friction are no ball of one.
        let stated = [a, b, c].iter().any(|i| self.links[*i].passive != [Passive::default(); 2]);
        self.links[c].passive = [Passive::default(); 2];
        if stated {
            self.findings.push(Finding {
                place: format!("joint {}", self.links[c].joint_name),
                text: format!(
                    "friction, rotors and springs that the file states of {} are left out",
                    joints.join(", ")
                ),
            });
        }
        self.remove(&[a, b]);
        Ok(())
    }

    /// Returns the model with two revolute joints of a body whose axes meet at its origin as one universal
    /// joint, for languages that have no body of several joints.
    #[must_use]
    pub(super) fn with_universals(&self) -> Self {
        let mut out = self.clone();
        let pair = |model: &Self, i: usize| -> Option<(usize, Link<f64>)> {
            let own = &model.links[i].link;
            // What has no mass, and holds nothing else, is between two joints of one body.
            let is_between = |l: &&ModelLink| {
                l.nominal.is_none_or(|phi| phi == NO_BODY)
                    && model.links.iter().skip(1).filter(|other| other.link.parent == own.parent).count() == 1
            };
            let first = model
                .links
                .get(own.parent)
                .filter(is_between)
                .filter(|l| own.parent > 0 && model.links[l.link.parent].is_body())?;
            match (first.link.joint, own.joint) {
                (Joint::Revolute(a), Joint::Revolute(b)) if own.position.norm() < COINCIDENCE_M => {
                    let a = own.rotation.tr_mul(&a);
                    let joint = Joint::Universal(a, b);
                    if a.cross(&b).norm() < f64::EPSILON.sqrt() {
                        return None;
                    }
                    Some((
                        own.parent,
                        Link { joint, rotation: first.link.rotation * own.rotation, ..first.link },
                    ))
                }
                _ => None,
            }
        };
        while let Some((i, (between, link))) =
            (1..out.links.len()).filter(|i| out.links[*i].is_body()).find_map(|i| Some((i, pair(&out, i)?)))
        {
            out.links[i].link = link;
            out.links[i].passive = [out.links[between].passive[0], out.links[i].passive[0]];
            out.remove(&[between]);
        }
        out
    }

    /// Declares three joints whose axes meet and whose angles are known each on its own: the three stay, and
    /// the links between them become no bodies.
    ///
    /// # Errors
    /// Fails as [`Self::declare_spherical`] does.
    pub fn declare_meeting(&mut self, joints: &[String; 3]) -> Result<(), ModelError> {
        self.clone().declare_spherical(joints)?;
        for name in &joints[..2] {
            let Some(i) = self.joint(name) else { continue };
            self.links[i].nominal = Some(NO_BODY);
            let place = format!("link {}", self.links[i].name);
            self.findings.retain(|finding| finding.place != place);
        }
        Ok(())
    }

    /// Takes links out on which nothing hangs any more.
    fn remove(&mut self, gone: &[usize]) {
        let kept: Vec<usize> = (0..self.links.len()).filter(|i| !gone.contains(i)).collect();
        let places: Vec<String> = gone.iter().map(|i| format!("link {}", self.links[*i].name)).collect();
        self.findings.retain(|finding| !places.contains(&finding.place));
        self.links = kept
            .iter()
            .map(|i| {
                let mut link = self.links[*i].clone();
                link.link.parent = kept.iter().position(|k| *k == link.link.parent).unwrap_or(0);
                link
            })
            .collect();
    }

    /// Returns the place that an option's words say: `LINK`, `LINK@x,y,z` or `LINK@x,y,z,roll,pitch,yaw` (m
    /// and degrees, of a frame in the link's).
    ///
    /// # Errors
    /// [`ModelError::Option`] if there is no such link, or numbers that cannot be read.
    pub fn place(&self, option: &str, words: &str) -> Result<Place, ModelError> {
        let refuse = |why: String| ModelError::Option(format!("{option} {words}: {why}"));
        let (name, place) = words.split_once('@').unwrap_or((words, "0,0,0"));
        let holder = self.link(name).ok_or_else(|| {
            let names: Vec<&str> = self.links.iter().map(|l| l.name.as_str()).collect();
            refuse(format!("there is no link {name}; the links are {}", names.join(", ")))
        })?;
        let numbers = place
            .split(',')
            .map(|n| n.trim().parse::<f64>().ok().filter(|v| v.is_finite()))
            .collect::<Option<Vec<f64>>>()
            .filter(|n| n.len() == 3 || n.len() == 6)
            .ok_or_else(|| {
                refuse("the place is x,y,z in m, or x,y,z,roll,pitch,yaw in m and degrees".to_owned())
            })?;
        let angle = |k: usize| numbers.get(k).copied().unwrap_or(0.0).to_radians();
        let rotation: Matrix3<f64> = Rotation3::from_euler_angles(angle(3), angle(4), angle(5)).into_inner();
        let position = Vector3::new(numbers[0], numbers[1], numbers[2]);
        Ok(Place { link: holder, rotation, position })
    }

    /// Returns the link that moves and carries a place, links on fixed joints being one with what they hang
    /// on, and the place in its frame.
    pub fn moving_place(&self, place: &Place) -> Place {
        let mut found = place.clone();
        while let Some(own) = self.links.get(found.link).filter(|_| found.link > 0) {
            if own.link.joint != Joint::Fixed {
                break;
            }
            found = Place {
                link: own.link.parent,
                rotation: own.link.rotation * found.rotation,
                position: own.link.position + own.link.rotation * found.position,
            };
        }
        found
    }

    /// Makes a link hold a body rigidly: `LINK`, `LINK@x,y,z` or `LINK@x,y,z,roll,pitch,yaw` (m and degrees,
    /// of the tool's frame in the link's).
    ///
    /// # Errors
    /// [`ModelError::Option`] if there is no such link, or numbers that cannot be read.
    pub fn hold_tool(&mut self, words: &str) -> Result<(), ModelError> {
        let place = self.place("`tool`", words)?;
        let name = &self.links[place.link].name;
        let tool = format!("{name}_tool");
        if self.link(&tool).is_some() {
            return Err(ModelError::Option(format!("`tool` {words}: there is a link {tool} already")));
        }
        self.links.push(ModelLink::new(
            tool.clone(),
            tool,
            Link {
                parent: place.link,
                joint: Joint::Fixed,
                rotation: place.rotation,
                position: place.position,
            },
            None,
        ));
        Ok(())
    }
}
