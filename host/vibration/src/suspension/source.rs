//! Rows of bodies on springs: the springs' wrench is what a load cell would measure.
//!
//! Rows are those of a tree whose base is tracked ([`TreeSource`]): its momentum, so that no acceleration is
//! formed. They are about the platform's point O at r_O instead of the base's origin at r: with `a = r − r_O`
//! the moments gain `a × F`, whose differentiated part is `a × d/dt D = d/dt (a × D) − ȧ × D`.
//!
//! The load of springs at rest is six columns of its own, eliminated as offsets: two horizontal forces, the
//! weight W and its two horizontal moments, each as forces of the springs whose places turn with the platform
//! ([`super::preload`]), and a moment about the vertical. Of upright springs at the height h
//! ```text
//! F = (fx, fy, W)     M = R (m_y', m_x', W h …) × ẑ     of which R x̂ × ẑ, R ŷ × ẑ and h R ẑ × ẑ are the columns
//! ```
//! So weight tells nothing of the mass, and no pose of empty springs has to be known; but the pendulum that a
//! body is about the anchors stays in the rows.

use std::ops::Range;

use nalgebra::{Vector3, Vector6};
use rigident_shared::screening::Rejection;

use super::mount::Instant;
use super::springs::{Displacement, Springs};
use super::support::Support;
use super::track::Track;
use super::track_noise::TrackNoise;
use rigident_fit::{
    Channel, Kind, Nuisance, OtherColumns, Owner, Parameter, RowSource, SampleRows, SignalNoise, Timing,
};
use rigident_model::base::BaseParameters;
use rigident_rows::body;
use rigident_rows::smoothing::Smoother;
use rigident_rows::tree::{Frame, Input, TreeSource, TreeSourceError};

/// Names and units of the six channels.
const CHANNELS: [(&str, &str); 6] =
    [("fx", "N"), ("fy", "N"), ("fz", "N"), ("mx", "N m"), ("my", "N m"), ("mz", "N m")];

/// The origin of instants and frames.
pub(super) struct Tracked {
    track: Track,
    smoother: Smoother,
    noise: Option<TrackNoise>,
    /// The rows of the track that are the samples.
    rows: Vec<usize>,
}

impl Tracked {
    /// Returns the smoothed track of a platform, and of a tree on it, with the platform and the frame at each
    /// of its rows but those near its ends and gaps.
    pub(super) fn new(
        track: Track,
        smoother: Smoother,
        support: &Support,
    ) -> (Self, Vec<Instant>, Vec<Frame>) {
        let (mut rows, mut instants, mut frames) = (Vec::new(), Vec::new(), Vec::new());
        for row in 0..track.len() {
            let Some(moved) = track.at(&smoother, row) else { continue };
            let (instant, frame) = support.mount.frame(&moved, track.time_ns(row));
            rows.push(row);
            instants.push(instant);
            frames.push(frame);
        }
        (Self { noise: None, track, smoother, rows }, instants, frames)
    }

    /// Returns the same with the noise that the track shows.
    pub(super) fn with_noise(self) -> Self {
        Self { noise: self.track.noise(self.smoother.cut_off_hz), ..self }
    }
}

/// The rows of bodies on springs.
pub struct SuspendedSource {
    inner: TreeSource,
    instants: Vec<Instant>,
    support: Support,
    tracked: Option<Tracked>,
    parameters: Vec<Parameter>,
    channels: Vec<Channel>,
}

impl SuspendedSource {
    /// Returns the source of frames of a tree, or of one body where the model is one link, with the platform
    /// at the time of each.
    ///
    /// # Errors
    /// [`TreeSourceError`] if the model has no base parameters, or the frames do not fit it.
    pub(super) fn new(
        input: Input,
        instants: Vec<Instant>,
        support: Support,
        tracked: Option<Tracked>,
    ) -> Result<Self, TreeSourceError> {
        let inner = TreeSource::new(input)?;
        let is_body = inner.input().model.links.len() == 1;
        let own = inner.parameters().len();
        let mut parameters: Vec<Parameter> =
            if is_body { body::parameters(own) } else { inner.parameters().to_vec() };
        let mut channels = Vec::new();
        for k in &support.free {
            let (name, unit) = CHANNELS[*k];
            parameters.push(Parameter {
                frame: "P".to_owned(),
                ..Parameter::new(
                    format!("offset_{name}"),
                    Owner::Channel(name.to_owned()),
                    Kind::Offset,
                    unit,
                )
            });
            channels.push(Channel {
                name: name.to_owned(),
                unit: unit.to_owned(),
                sigma: None,
                offset: Some(parameters.len() - 1),
                group: u8::from(*k > 2),
            });
        }
        Ok(Self { inner, instants, support, tracked, parameters, channels })
    }

    /// Returns the base parameters that are estimated.
    pub fn base(&self) -> &BaseParameters {
        self.inner.base()
    }

    /// Returns the tree, about the base's origin.
    pub fn tree(&self) -> &TreeSource {
        &self.inner
    }

    /// Returns what carries the platform.
    pub fn support(&self) -> &Support {
        &self.support
    }

    /// Returns frames and settings of the tree.
    pub fn input(&self) -> &Input {
        self.inner.input()
    }

    /// Returns the platform at the time of every frame.
    pub fn instants(&self) -> &[Instant] {
        &self.instants
    }

    /// Returns the springs.
    pub fn springs(&self) -> &Springs {
        &self.support.springs
    }

    /// Returns the coordinates that are not locked, by their numbers.
    pub fn free(&self) -> &[usize] {
        &self.support.free
    }

    /// Returns true if it is one rigid body.
    pub fn is_body(&self) -> bool {
        self.input().model.links.len() == 1
    }

    /// Returns the column of what the springs carry at rest, of a coordinate.
    fn carried(&self, at: &Displacement, coordinate: usize) -> Vector6<f64> {
        if !(2..5).contains(&coordinate) {
            return Vector6::ith(coordinate, 1.0);
        }
        self.support
            .preload
            .wrench(at, &std::array::from_fn(|load| f64::from(u8::from(load + 1 == coordinate))))
    }
}

/// Adds `arm × force` rows to the moment rows of six rows of `n` coefficients.
fn add_arm(arm: &Vector3<f64>, forces: &[f64], moments: &mut [f64], n: usize) {
    for axis in 0..3 {
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        for c in 0..n {
            moments[(3 + axis) * n + c] += arm[j] * forces[k * n + c] - arm[k] * forces[j * n + c];
        }
    }
}

impl RowSource for SuspendedSource {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn timing(&self) -> Timing {
        self.inner.timing()
    }

    fn samples(&self) -> usize {
        self.instants.len()
    }

    fn time_ns(&self, sample: usize) -> u64 {
        self.inner.time_ns(sample)
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        let Instant { at, arm } = self.instants.get(sample).ok_or(Rejection::NotFinite(0))?;
        let n = self.inner.parameters().len();
        let mut own = SampleRows::default();
        own.clear(6, n);
        self.inner.rows(sample, &mut own)?;
        // The arm is fixed in the platform: ȧ = ω × a.
        let turning = at.rate.cross(arm);
        let forces = own.differentiated.clone();
        add_arm(arm, &own.smoothed.clone(), &mut own.smoothed, n);
        add_arm(&-turning, &forces, &mut own.smoothed, n);
        add_arm(arm, &forces, &mut own.differentiated, n);
        let stated = self.support.preload.wrench(at, &[1.0, 0.0, 0.0, 0.0]);
        let wrench = self.support.springs.wrench(at) + stated;
        let all = self.parameters.len();
        for (row, k) in self.support.free.iter().enumerate() {
            rows.smoothed[row * all..row * all + n].copy_from_slice(&own.smoothed[k * n..(k + 1) * n]);
            rows.differentiated[row * all..row * all + n]
                .copy_from_slice(&own.differentiated[k * n..(k + 1) * n]);
            for (column, coordinate) in self.support.free.iter().enumerate() {
                rows.smoothed[row * all + n + column] = -self.carried(at, *coordinate)[*k];
            }
            rows.measured[row] = wrench[*k];
        }
        if rows.measured.iter().any(|v| !v.is_finite()) {
            return Err(Rejection::NotFinite(0));
        }
        Ok(())
    }

    fn rounding(&self) -> f64 {
        self.inner.rounding()
    }

    fn nominal_sigma(&self) -> Vec<f64> {
        self.channels.iter().map(|c| if c.group == 0 { 1.0 } else { 0.1 }).collect()
    }

    fn model_fingerprint(&self) -> u64 {
        if self.is_body() {
            return 0;
        }
        self.inner.model_fingerprint()
    }

    fn each_reading(&self, take: &mut dyn FnMut(Option<u64>, &[f64])) {
        for (sample, instant) in self.instants.iter().enumerate() {
            let coordinates = instant.at.coordinates();
            take(Some(self.time_ns(sample)), coordinates.as_slice());
        }
    }

    fn signal_noise(&self) -> Vec<SignalNoise> {
        let noise = self.tracked.iter().filter_map(|tracked| tracked.noise.as_ref());
        let of = |noise: &TrackNoise| SignalNoise {
            name: "poses".to_owned(),
            unit: noise.unit.to_owned(),
            // What differences show is the noise itself: residuals do not bound it, as springs that are not
            // known take part of it.
            stated: Some(noise.sigma),
            found: noise.sigma,
        };
        noise.map(of).collect()
    }

    fn with_signal_noise(
        &self,
        samples: Range<usize>,
        sigma: &[f64],
        seed: u64,
    ) -> Option<Box<dyn RowSource + '_>> {
        let Tracked { track, smoother, noise, rows } = self.tracked.as_ref()?;
        let half = smoother.half();
        let rows = rows.get(samples)?;
        let around = rows.first()?.saturating_sub(half)..rows.last()? + half + 1;
        let noisier = track.with_noise(noise.as_ref()?, *sigma.first()?, seed, around);
        let (_, instants, frames) = Tracked::new(noisier, smoother.clone(), &self.support);
        let input = self.input().with_frames(frames);
        let noisy = Self::new(input, instants, self.support.clone(), None).ok()?;
        Some(Box::new(noisy))
    }

    fn signal_noise_is_white(&self) -> bool {
        // The poses were smoothed, and springs and masses make forces of their noise that cancel at each
        // resonance.
        false
    }

    fn determined_errors(&self) -> usize {
        // Of (1 + e) K and no body noise is least at e = −1: the rows tell of the damping alone.
        self.support.springs.dampings()
    }

    fn nuisances(&self) -> Vec<Nuisance> {
        self.support.motion_nuisances()
    }

    fn error_columns(&self, parameters: &[f64]) -> Option<Box<dyn RowSource + '_>> {
        // W(K) = A φ − Σ e ∂W/∂e, as the true wrench is W(K) + Σ e ∂W/∂e.
        let nuisances = self.nuisances();
        let n = nuisances.len();
        let own = self.inner.parameters().len();
        let offset = |k: usize| {
            let place = self.support.free.iter().position(|free| *free == k);
            place.and_then(|place| parameters.get(own + place)).copied().unwrap_or(0.0)
        };
        let loads = [1.0, offset(2), offset(3), offset(4)];
        let errors = nuisances.iter().map(Nuisance::parameter).collect();
        Some(Box::new(OtherColumns::new(self, errors, move |sample, rows| {
            let instant = self.instants.get(sample).ok_or(Rejection::NotFinite(0))?;
            let wrenches = self.support.wrench_errors(&instant.at, &loads);
            if let Some(air) = &self.support.air {
                let momentum = air * instant.at.rates();
                for (row, k) in self.support.free.iter().enumerate() {
                    rows.differentiated[row * n + wrenches.len()] = momentum[*k];
                }
            }
            for (column, wrench) in wrenches.iter().enumerate() {
                for (row, k) in self.support.free.iter().enumerate() {
                    rows.smoothed[row * n + column] = -wrench[*k];
                }
            }
            Ok(())
        })))
    }
}
