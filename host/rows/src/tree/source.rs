//! A tree of links: the source of its rows, base wrench and joint torques, with offsets and drives as
//! columns.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};

use rigident_shared::screening::Rejection;
use rigident_shared::tree::{Joint, LinkState, TreeError};

use super::drive::Term;
use super::rows::{RowMaker, names_and_units};
use super::sensitivities::ErrorRows;
use super::{BaseSensor, Frame, Input, TreeSourceError, friction_speed, rotors, signals};
use crate::white_noise::sixth_differences;
use rigident_fit::{
    Channel, DriveMotion, Fingerprint, Kind, Nuisance, Owner, Parameter, RowSource, SampleRows, SignalNoise,
    Timing,
};
use rigident_model::base::{BaseParameters, ROUNDED, base_parameters};

/// σ of force and of everything else to start from where none is stated: only ratios matter.
const NOMINAL_SIGMA: (f64, f64) = (1.0, 0.1);

/// The rows of a tree.
pub struct TreeSource {
    input: Input,
    base: BaseParameters,
    parameters: Vec<Parameter>,
    channels: Vec<Channel>,
    /// It keeps the state of every link while it makes rows.
    maker: Mutex<RowMaker>,
}

impl TreeSource {
    /// Returns the source of frames of a tree.
    ///
    /// # Errors
    /// [`TreeSourceError`] if the model has no base parameters, or the frames do not fit it.
    pub fn new(mut input: Input) -> Result<Self, TreeSourceError> {
        let mut base = base_parameters(&input.model, &input.situation)?;
        rotors::regroup(&mut input, &mut base).map_err(TreeSourceError::Frames)?;
        let input = friction_speed::found(input, &base).map_err(TreeSourceError::Frames)?;
        Self::with_base(input, base).map_err(TreeSourceError::Frames)
    }

    /// Returns the same source with the parameters in the order of a device: that of the standard parameters
    /// that are there for them.
    ///
    /// # Errors
    /// See [`TreeSource::new`].
    pub fn in_device_order(self) -> Result<Self, TreeSourceError> {
        let Self { input, mut base, .. } = self;
        base.parameters.sort_by_key(|p| p.terms.first().map(|(column, _)| *column));
        Self::with_base(input, base).map_err(TreeSourceError::Frames)
    }

    /// Returns the rows of other frames of the same model, without finding its base parameters once more.
    ///
    /// # Errors
    /// [`TreeSourceError`] as [`TreeSource::new`].
    pub fn of_same_model(&self, input: Input) -> Result<Self, TreeSourceError> {
        Self::with_base(input, self.base.clone()).map_err(TreeSourceError::Frames)
    }

    pub(super) fn with_base(input: Input, base: BaseParameters) -> Result<Self, TreeError> {
        // Neither efforts nor errors of an IMU are defined against a laboratory.
        let has_more = input.has_efforts() || !input.errors.is_empty() || !input.signals.is_empty();
        if input.base == BaseSensor::Tracked && has_more {
            return Err(TreeError::Lengths);
        }
        let mut maker = RowMaker::new(&input, &base)?;
        let parameters = parameters(&input, &base);
        let channels = channels(&input, &parameters);
        // All frames are made alike.
        if let Some(frame) = input.frames.first() {
            let mut rows = SampleRows::default();
            rows.clear(channels.len(), parameters.len());
            maker.rows(frame, &mut rows)?;
        }
        Ok(Self { input, base, parameters, channels, maker: Mutex::new(maker) })
    }

    /// Returns frames and settings.
    pub fn input(&self) -> &Input {
        &self.input
    }

    /// Returns the same source with 1 σ of every channel, per unfiltered sample.
    #[must_use]
    pub fn with_channel_sigma(mut self, sigma: Vec<f64>) -> Self {
        self.input.channel_sigma = Some(sigma);
        self.channels = channels(&self.input, &self.parameters);
        self
    }

    /// Returns the motion of the drives that have parameters.
    pub fn drive_motions(&self) -> Vec<DriveMotion> {
        let names = self.input.freedom_names();
        let drives = self.input.drives.iter().filter(|_| self.input.has_efforts());
        let frames = &self.input.frames;
        drives
            .map(|drive| {
                let rate = |frame: &Frame| -> f64 {
                    drive.rates.iter().map(|(k, _)| frame.rates.get(*k).copied().unwrap_or(0.0)).sum()
                };
                let squares: f64 = frames.iter().map(|frame| rate(frame).powi(2)).sum();
                DriveMotion {
                    name: drive.name.clone(),
                    channels: drive.rates.iter().filter_map(|(k, _)| names.get(*k).cloned()).collect(),
                    rms_rate: (squares / frames.len().max(1) as f64).sqrt(),
                    turns_with: drive.sum(&names),
                    terms: drive.terms.iter().map(|term| term.word()).collect(),
                }
            })
            .collect()
    }

    /// Writes what is measured of a sample, a known offset taken off.
    ///
    /// # Errors
    /// [`Rejection`] if a channel is not finite, or there is no such sample.
    pub(super) fn measure(&self, sample: usize, measured: &mut [f64]) -> Result<(), Rejection> {
        let frame = self.input.frames.get(sample).ok_or(Rejection::NotFinite(0))?;
        let offset = self.input.known_offset.unwrap_or_default();
        let wrench = frame.wrench.iter().zip(offset).map(|(w, o)| w - o);
        let wrench = wrench.take(self.input.first_effort());
        let efforts = frame.efforts.iter().copied().filter(|_| self.input.has_efforts());
        for (c, (to, from)) in measured.iter_mut().zip(wrench.chain(efforts)).enumerate() {
            if !from.is_finite() {
                return Err(Rejection::NotFinite(u8::try_from(c).unwrap_or(u8::MAX)));
            }
            *to = from;
        }
        Ok(())
    }

    /// Returns the motion of every link in a frame, in the laboratory's axes; `None` if there is no such
    /// frame, or the base is not tracked.
    pub fn link_states(&self, sample: usize) -> Option<Vec<LinkState<f64>>> {
        let frame = self.input.frames.get(sample).filter(|_| self.input.base == BaseSensor::Tracked)?;
        let mut maker = self.maker();
        maker.states(frame).ok()
    }

    /// Marks the channels of drives with dry friction that are at rest, and those by which what feet do not
    /// measure is eliminated.
    pub(super) fn mark_missing(&self, sample: usize, rows: &mut SampleRows) {
        if let Some((contact, frame)) = self.input.contact.as_ref().zip(self.input.frames.get(sample)) {
            let pivots = contact.states.get(frame.ground.state).map_or(&[][..], |state| &state.pivots);
            for pivot in pivots {
                rows.missing.iter_mut().skip(*pivot).take(1).for_each(|missing| *missing = true);
            }
            return;
        }
        let first = self.input.first_effort();
        let standing = self.input.frames.get(sample).map_or(&[][..], |frame| &frame.standing);
        for freedom in standing.iter().filter(|_| self.input.has_efforts()) {
            rows.missing.iter_mut().skip(first + freedom).take(1).for_each(|missing| *missing = true);
        }
    }

    /// Returns the maker of rows, which nobody else has meanwhile.
    pub(super) fn maker(&self) -> MutexGuard<'_, RowMaker> {
        self.maker.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the base parameters that are estimated.
    pub fn base(&self) -> &BaseParameters {
        &self.base
    }
}

fn parameters(input: &Input, base: &BaseParameters) -> Vec<Parameter> {
    let (names, units) = names_and_units(input, base);
    let root = input.model.links.first().map_or("", |l| l.name.as_str());
    let drives = input.drives.iter().filter(|_| input.has_efforts());
    let mut terms = drives.flat_map(|drive| drive.terms.iter().map(|term| (drive.name.as_str(), *term)));
    names
        .into_iter()
        .zip(units)
        .enumerate()
        .map(|(j, (name, unit))| {
            let stem = name.rsplit_once('.').map_or("", |(stem, _)| stem).to_owned();
            if let Some(own) = base.parameters.get(j) {
                let kind = match own.terms.first().map_or(0, |t| t.0 % 10) {
                    0 => Kind::Mass,
                    1..4 => Kind::FirstMoment,
                    _ => Kind::Inertia,
                };
                let standard = |column: usize| base.standard.get(column).cloned().unwrap_or_default();
                let links = own.terms.iter().map(|(column, weight)| (standard(*column), *weight));
                let made_of = links.chain(own.rotors.iter().cloned()).collect();
                let owner = Owner::Link(stem.clone());
                return Parameter { frame: stem, made_of, ..Parameter::new(name, owner, kind, unit) };
            }
            if let Some(channel) = name.strip_prefix("offset_").map(str::to_owned).filter(|_| stem.is_empty())
            {
                let owner = Owner::Channel(channel);
                return Parameter {
                    frame: root.to_owned(),
                    ..Parameter::new(name, owner, Kind::Offset, unit)
                };
            }
            let (drive, term) = terms.next().unwrap_or(("", Term::Offset));
            let kind = match term {
                Term::Viscous => Kind::Viscous,
                Term::Coulomb(_) | Term::Stribeck(_) => Kind::Coulomb,
                Term::Load => Kind::Load,
                Term::Offset => Kind::Offset,
                Term::Rotor => Kind::Rotor,
                Term::Spring => Kind::Other,
            };
            Parameter::new(name, Owner::Drive(drive.to_owned()), kind, unit)
        })
        .collect()
}

fn channels(input: &Input, parameters: &[Parameter]) -> Vec<Channel> {
    let wrench = input.first_effort();
    let slides: Vec<bool> = input
        .model
        .links
        .iter()
        .skip(1)
        .flat_map(|l| {
            let slides = matches!(l.link.joint, Joint::Prismatic(_));
            std::iter::repeat_n(slides, l.link.joint.freedoms())
        })
        .collect();
    let names = input.channels().into_iter().enumerate();
    names
        .map(|(c, name)| {
            let own = c.checked_sub(wrench).map(|k| slides.get(k) == Some(&true));
            let (unit, group) = match own {
                None if c < 3 => ("N", 0),
                None => ("N m", 1),
                // Each joint is compared with itself.
                Some(slides) => (if slides { "N" } else { "N m" }, u8::try_from(2 + c).unwrap_or(u8::MAX)),
            };
            let offset = parameters.iter().position(|p| {
                own.is_none() && p.kind == Kind::Offset && p.owner == Owner::Channel(name.clone())
            });
            Channel {
                sigma: input.channel_sigma.as_ref().and_then(|all| all.get(c).copied()),
                unit: unit.to_owned(),
                name,
                offset,
                group,
            }
        })
        .collect()
}

impl RowSource for TreeSource {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn timing(&self) -> Timing {
        if self.input.is_static { Timing::Static } else { Timing::Uniform { rate_hz: self.input.rate_hz } }
    }

    fn samples(&self) -> usize {
        self.input.frames.len()
    }

    fn time_ns(&self, sample: usize) -> u64 {
        self.input.frames.get(sample).map_or(0, |f| f.time_ns)
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        // Frames were checked when they were prepared.
        let refuse = Rejection::NotFinite(0);
        let frame = self.input.frames.get(sample).ok_or(refuse)?;
        self.measure(sample, &mut rows.measured)?;
        let mut maker = self.maker();
        maker.available(frame, rows).map_err(|_| refuse)?;
        self.mark_missing(sample, rows);
        Ok(())
    }

    fn rounding(&self) -> f64 {
        ROUNDED
    }

    fn nominal_sigma(&self) -> Vec<f64> {
        let of = |c: &Channel| if c.group == 0 { NOMINAL_SIGMA.0 } else { NOMINAL_SIGMA.1 };
        self.channels.iter().map(of).collect()
    }

    fn model_fingerprint(&self) -> u64 {
        let mut hash = Fingerprint::default();
        if self.input.base == BaseSensor::Tracked {
            hash.add_text("tracked");
        }
        for link in &self.input.model.links {
            hash.add_text(&link.name);
            hash.add(link.link.parent as u64);
            let (kind, axes): (&str, Vec<f64>) = match &link.link.joint {
                Joint::Fixed => ("fixed", Vec::new()),
                Joint::Free => ("free", Vec::new()),
                Joint::Spherical => ("spherical", Vec::new()),
                Joint::Revolute(a) => ("revolute", a.iter().copied().collect()),
                Joint::Prismatic(a) => ("prismatic", a.iter().copied().collect()),
                Joint::Universal(a, b) => ("universal", a.iter().chain(b.iter()).copied().collect()),
            };
            hash.add_text(kind);
            let place = link.link.rotation.iter().chain(link.link.position.iter()).copied();
            axes.into_iter().chain(place).for_each(|v| hash.add(v.to_bits()));
        }
        hash.finish()
    }

    fn each_reading(&self, take: &mut dyn FnMut(Option<u64>, &[f64])) {
        for frame in &self.input.frames {
            let of_frame =
                frame.positions.iter().chain(&frame.rates).chain(&frame.wrench).chain(&frame.efforts);
            let numbers: Vec<f64> = of_frame.chain(frame.ground.wrenches.iter().flatten()).copied().collect();
            take(Some(frame.time_ns), &numbers);
        }
    }

    fn nuisances(&self) -> Vec<Nuisance> {
        self.input.nuisances.clone()
    }

    fn error_columns(&self, parameters: &[f64]) -> Option<Box<dyn RowSource + '_>> {
        let rows = {
            let maker = self.maker();
            ErrorRows::new(self, &maker, parameters).ok()?
        };
        Some(Box::new(rows.into_source()))
    }

    fn signal_noise(&self) -> Vec<SignalNoise> {
        signals::signal_noise(&self.input)
    }

    fn with_signal_noise(
        &self,
        samples: Range<usize>,
        sigma: &[f64],
        seed: u64,
    ) -> Option<Box<dyn RowSource + '_>> {
        let frames = signals::with_noise(&self.input, samples, sigma, seed).ok()?;
        let source = Self::with_base(self.input.with_frames(frames), self.base.clone()).ok()?;
        Some(Box::new(source))
    }

    fn channel_noise(&self) -> Vec<f64> {
        // Rows of feet are no readings.
        if self.input.is_static || self.input.contact.is_some() {
            return Vec::new();
        }
        let of = |c: usize| {
            let value = |frame: &Frame| {
                let wrench = frame.wrench.iter().take(self.input.first_effort());
                let efforts = frame.efforts.iter().filter(|_| self.input.has_efforts());
                wrench.chain(efforts).nth(c).copied().unwrap_or(0.0)
            };
            let values = self.input.frames.iter().map(|frame| (frame.time_ns, [value(frame)]));
            sixth_differences(&values.collect::<Vec<_>>(), 1)
        };
        (0..self.channels.len()).map(of).collect()
    }

    fn rate_sigma(&self) -> f64 {
        self.input.rate_sigma
    }
}
