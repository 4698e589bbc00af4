//! Columns of what may act on a robot beside what its model says: a torque that reads a multiple of its
//! value, friction, a rotor, a pull at a link, a foot's sensor with another scale.
//!
//! With `Y φ = [0; τ] + Σ G w` of [`super::contact`], a force f that nobody measures has the columns −G, a
//! torque that is read `1/(1 − g)` times its value the column τ.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rigident_shared::screening::Rejection;
use rigident_shared::tree::TreeError;

use super::contact::Foot;
use super::contact::forces::Columns;
use super::{Frame, Input, TreeSource};
use rigident_fit::{Kind, OtherColumns, Owner, Parameter, RowSource as _, SampleRows};

/// Speeds at which dry friction may turn over, in root mean squares of the joint's rate: steep, and so slow
/// that a sum of both is anything between.
const TURNS_OVER: [f64; 2] = [0.03, 0.3];
/// Limits of g, of a reading that is `1/(1 − g)` times its value: 0.4 to 2.5 times.
const SHARE: [f64; 2] = [-1.5, 0.6];
/// Time in which the specific force says where up is, s: longer than a step or a sway.
const TILT_S: f64 = 5.0;
/// Components of a wrench.
const WRENCH: usize = 6;
/// Components of a force.
const FORCE: usize = 3;

/// Something that the model does not say, constant throughout a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unmodelled {
    /// An effort reads a multiple of its value; by its freedom.
    Gain(usize),
    /// Viscous and dry friction.
    Friction {
        /// The freedom.
        freedom: usize,
        /// A usual rate of it, rad/s or m/s.
        rate: f64,
    },
    /// An effort reads too much; by its freedom.
    Offset(usize),
    /// A rotor behind a gear; by its freedom.
    Rotor(usize),
    /// A wrench on the base about its origin, in its axes.
    BaseWrench,
    /// A force at the origin of a link, in axes that do not turn: z is up, x where the base's is at the
    /// start; by its number in the model.
    Force(usize),
    /// A component of a foot's wrench reads a multiple of its value.
    FootScale {
        /// The foot.
        foot: usize,
        /// The component, of its sensor.
        component: usize,
    },
}

impl Unmodelled {
    /// Returns the number of its columns.
    pub fn columns(self) -> usize {
        match self {
            Self::Gain(_) | Self::Offset(_) | Self::Rotor(_) | Self::FootScale { .. } => 1,
            Self::Friction { .. } => 1 + TURNS_OVER.len(),
            Self::BaseWrench => WRENCH,
            Self::Force(_) => FORCE,
        }
    }

    /// Returns true if it may have these coefficients: readings that are nearly nothing but a multiple of
    /// their value would explain any reading by no body at all, friction and rotors take energy.
    pub fn may_be(self, values: &[f64]) -> bool {
        let first = values.first().copied().unwrap_or(0.0);
        match self {
            Self::Gain(_) | Self::FootScale { .. } => (SHARE[0]..=SHARE[1]).contains(&first),
            Self::Rotor(_) => first >= 0.0,
            Self::Friction { rate, .. } => first * rate + values.iter().skip(1).sum::<f64>() >= 0.0,
            Self::Offset(_) | Self::BaseWrench | Self::Force(_) => true,
        }
    }

    /// Returns everything of the kind that may act beside a source, wrenches only if asked for.
    pub fn of(source: &TreeSource, wrenches: bool) -> Vec<Self> {
        let input = source.input();
        let mut all = Vec::new();
        let unmeasured = input.contact.as_ref().map_or(&[][..], |contact| &contact.unmeasured);
        let freedoms = (0..input.model.freedoms()).filter(|_| input.has_efforts());
        for k in freedoms.filter(|k| !unmeasured.contains(k)) {
            let friction = Self::Friction { freedom: k, rate: rms_rate(input, k) };
            all.extend([Self::Gain(k), friction, Self::Offset(k), Self::Rotor(k)]);
        }
        if wrenches {
            let has_base = input.has_wrench() && input.known_offset.is_some();
            all.extend(has_base.then_some(Self::BaseWrench));
            let links = input.model.links.iter().enumerate().filter(|(i, _)| has_base || *i > 0);
            all.extend(links.filter(|(_, link)| link.is_body()).map(|(i, _)| Self::Force(i)));
        }
        for (foot, own) in input.contact.iter().flat_map(|contact| contact.feet.iter().enumerate()) {
            let measured = (0..WRENCH).filter(|component| own.measured[*component]);
            all.extend(measured.map(|component| Self::FootScale { foot, component }));
        }
        all
    }
}

impl TreeSource {
    /// Returns the source with columns of its own for each of these, after its parameters.
    pub fn with_unmodelled<'a>(&'a self, all: &'a [Unmodelled]) -> OtherColumns<'a> {
        let count: usize = all.iter().map(|own| own.columns()).sum();
        let parameter =
            |k| Parameter::new(format!("unmodelled {k}"), Owner::Link(String::new()), Kind::Other, "");
        let parameters = self.parameters().iter().cloned().chain((0..count).map(parameter)).collect();
        let has_force = all.iter().any(|own| matches!(own, Unmodelled::Force(_)));
        let attitudes = if has_force { attitudes(self.input()) } else { Vec::new() };
        OtherColumns::new(self, parameters, move |sample, rows| {
            let attitude = attitudes.get(sample).copied().unwrap_or_else(Matrix3::identity);
            self.rows_with(sample, (all, &attitude), rows)
        })
    }

    /// Writes the rows of a sample with the columns of these; the base has an attitude, laboratory ← base.
    fn rows_with(
        &self,
        sample: usize,
        (all, attitude): (&[Unmodelled], &Matrix3<f64>),
        rows: &mut SampleRows,
    ) -> Result<(), Rejection> {
        let refuse = Rejection::NotFinite(0);
        let input = self.input();
        let frame = input.frames.get(sample).ok_or(refuse)?;
        let (channels, count) = (self.channels().len(), self.parameters().len());
        let mut own = SampleRows::default();
        own.clear(channels, count);
        self.measure(sample, &mut own.measured)?;
        let columns: usize = all.iter().map(|one| one.columns()).sum();
        let mut more = SampleRows::default();
        more.clear(channels, columns);
        let mut maker = self.maker();
        let available = maker.available_rows(frame, &mut own).map_err(|_| refuse)?;
        let wrenches = maker.wrench_columns(&places(all, input, attitude)).map_err(|_| refuse)?;
        drop(maker);
        Table { input, frame, columns, more: &mut more }.write(all, &wrenches);
        if input.is_static {
            more.differentiated.fill(0.0);
        }
        if let Some(available) = available {
            available.combine(&mut more.smoothed, &mut more.differentiated, columns);
        }
        for (to, own, more) in [
            (&mut rows.smoothed, &own.smoothed, &more.smoothed),
            (&mut rows.differentiated, &own.differentiated, &more.differentiated),
        ] {
            for (c, to) in to.chunks_exact_mut((count + columns).max(1)).enumerate() {
                to[..count].copy_from_slice(&own[c * count..(c + 1) * count]);
                to[count..].copy_from_slice(&more[c * columns..(c + 1) * columns]);
            }
        }
        rows.measured.copy_from_slice(&own.measured);
        self.mark_missing(sample, rows);
        Ok(())
    }
}

/// Returns the root mean square of a freedom's rate.
fn rms_rate(input: &Input, freedom: usize) -> f64 {
    let rates = input.frames.iter().filter_map(|frame| frame.rates.get(freedom));
    (rates.map(|rate| rate * rate).sum::<f64>() / input.frames.len().max(1) as f64).sqrt()
}

/// A place where a wrench acts, as a foot whose sensor is there.
fn foot_at(link: usize) -> Foot {
    Foot {
        name: String::new(),
        link,
        position: Vector3::zeros(),
        rotation: Matrix3::identity(),
        known: [true; WRENCH],
        measured: [false; WRENCH],
        sigma: [0.0; WRENCH],
    }
}

/// Returns where wrenches act, in the order of `all`, each with its axes in the base's, base ← axes; `None`:
/// those of its sensor.
fn places(all: &[Unmodelled], input: &Input, attitude: &Matrix3<f64>) -> Vec<(Foot, Option<Matrix3<f64>>)> {
    let place = |own: &Unmodelled| match own {
        Unmodelled::BaseWrench => Some((foot_at(0), Some(Matrix3::identity()))),
        Unmodelled::Force(link) => Some((foot_at(*link), Some(attitude.transpose()))),
        Unmodelled::FootScale { foot, .. } => {
            let foot = input.contact.as_ref().and_then(|contact| contact.feet.get(*foot));
            foot.map(|foot| (foot.clone(), None))
        }
        _ => None,
    };
    all.iter().filter_map(place).collect()
}

/// Returns the attitudes of the base, laboratory ← base: what its rate says, with the vertical of the
/// specific force in the long run.
fn attitudes(input: &Input) -> Vec<Matrix3<f64>> {
    let up = |frame: &Frame| frame.base.specific_force.try_normalize(f64::MIN_POSITIVE);
    let upright = |force: Vector3<f64>| UnitQuaternion::rotation_between(&force, &Vector3::z());
    let count = ((TILT_S * input.rate_hz) as usize).max(1);
    let first: Vector3<f64> = input.frames.iter().take(count).map(|frame| frame.base.specific_force).sum();
    let mut now = upright(first).unwrap_or_default();
    let mut before: Option<u64> = None;
    let each = input.frames.iter().map(|frame| {
        if input.is_static {
            return up(frame).and_then(upright).unwrap_or_default().to_rotation_matrix().into_inner();
        }
        let step_s = before.map_or(0.0, |t| frame.time_ns.saturating_sub(t) as f64 * 1e-9);
        before = Some(frame.time_ns);
        now *= UnitQuaternion::from_scaled_axis(frame.base.rate * step_s);
        if let Some(up) = up(frame) {
            let share = (step_s / TILT_S).min(1.0);
            now = UnitQuaternion::from_scaled_axis((now * up).cross(&Vector3::z()) * share) * now;
        }
        now.to_rotation_matrix().into_inner()
    });
    each.collect()
}

/// Columns that are written for a frame.
struct Table<'a> {
    input: &'a Input,
    frame: &'a Frame,
    columns: usize,
    more: &'a mut SampleRows,
}

impl Table<'_> {
    fn write(&mut self, all: &[Unmodelled], wrenches: &[Columns]) {
        let mut wrenches = wrenches.iter();
        let mut at = 0;
        for own in all {
            match *own {
                Unmodelled::Gain(k) => {
                    self.effort(k, at, self.frame.efforts.get(k).copied().unwrap_or(0.0));
                }
                Unmodelled::Friction { freedom, rate } => self.friction(freedom, rate, at),
                Unmodelled::Offset(k) => self.effort(k, at, 1.0),
                Unmodelled::Rotor(k) => {
                    let to = (self.input.first_effort() + k) * self.columns + at;
                    let rate = self.frame.rates.get(k).copied().unwrap_or(0.0);
                    self.more.differentiated.iter_mut().skip(to).take(1).for_each(|v| *v = rate);
                }
                Unmodelled::BaseWrench | Unmodelled::Force(_) => {
                    let wrench = wrenches.next();
                    (0..own.columns()).for_each(|k| self.wrench(wrench, k, at + k, -1.0));
                }
                Unmodelled::FootScale { foot, component } => {
                    let wrench = wrenches.next();
                    let read = self.frame.ground.wrenches.get(foot).map_or(0.0, |w| w[component]);
                    self.wrench(wrench, component, at, read);
                }
            }
            at += own.columns();
        }
    }

    /// Writes a number into the row of an effort.
    fn effort(&mut self, freedom: usize, column: usize, value: f64) {
        let to = (self.input.first_effort() + freedom) * self.columns + column;
        self.more.smoothed.iter_mut().skip(to).take(1).for_each(|v| *v = value);
    }

    fn friction(&mut self, freedom: usize, usual: f64, at: usize) {
        let rate = self.frame.rates.get(freedom).copied().unwrap_or(0.0);
        let usual = usual.max(f64::MIN_POSITIVE);
        self.effort(freedom, at, rate);
        for (k, share) in TURNS_OVER.iter().enumerate() {
            self.effort(freedom, at + 1 + k, (rate / (share * usual)).tanh());
        }
    }

    /// Writes a multiple of a wrench's component into the rows of base and freedoms.
    fn wrench(&mut self, wrench: Option<&Columns>, component: usize, column: usize, factor: f64) {
        let first = if self.input.has_wrench() { 0 } else { WRENCH };
        let Some(wrench) = wrench else { return };
        for (c, row) in wrench.values.row_iter().skip(first).enumerate() {
            let to = c * self.columns + column;
            self.more.smoothed.iter_mut().skip(to).take(1).for_each(|v| *v = factor * row[component]);
        }
    }
}

impl Input {
    /// Returns the input of a robot of which nobody knows what acts at a link, all the time: its foot there
    /// measures nothing, or is one more. `None` where there are no feet, or no row is left.
    ///
    /// # Errors
    /// [`TreeError`] if frames and model do not fit.
    pub fn with_unknown_wrench_at(&self, link: usize) -> Result<Option<Self>, TreeError> {
        let mut input = self.clone();
        let Some(contact) = &mut input.contact else { return Ok(None) };
        let unknown = Foot { known: [false; WRENCH], ..foot_at(link) };
        let at = contact.feet.iter().position(|foot| foot.link == link).unwrap_or(contact.feet.len());
        match contact.feet.get_mut(at) {
            Some(foot) => *foot = Foot { name: foot.name.clone(), ..unknown },
            None => contact.feet.push(unknown),
        }
        contact.states.clear();
        for frame in &mut input.frames {
            frame.ground.wrenches.resize(contact.feet.len(), [0.0; WRENCH]);
            frame.ground.touching.resize(contact.feet.len(), true);
            frame.ground.wrenches[at] = [0.0; WRENCH];
            frame.ground.touching[at] = true;
        }
        input.choose_rows()?;
        let rows = input.contact.as_ref().map_or(0, |contact| contact.sigma.len());
        let states = input.contact.iter().flat_map(|contact| &contact.states);
        let has_rows = states.map(|state| state.pivots.len()).all(|pivots| pivots < rows);
        Ok((has_rows && !input.frames.is_empty()).then_some(input))
    }
}
