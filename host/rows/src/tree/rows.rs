//! The rows of a frame: base parameters, offsets and drives as columns.

use hexapod::STANDARD_GRAVITY_MPS2;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rigident_shared::inertia::PARAMETER_NAMES;
use rigident_shared::tree::{BaseMotion, Joint, Link, LinkState, TreeError};

use super::contact::availability::Availability;
use super::contact::forces::{self, Columns};
use super::contact::{Contact, Foot};
use super::{BaseSensor, Frame, Input};
use rigident_fit::SampleRows;
use rigident_model::base::{BaseParameters, Rows};
use rigident_model::rows::{MomentumRows, Moving};

/// The base link among those of [`RowMaker::moving`]: the first is the root.
pub(super) const BASE: usize = 1;

/// Makes the rows of an instant, in two parts.
///
/// The base's specific force is measured where its IMU sits, U. The links' momentum is taken about U
/// therefore, U being the root of the tree and the base link fixed to it; the wrench is then brought back to
/// the base's origin.
///
/// A tracked base moves freely against the laboratory, which is the root then, still and with gravity alone.
/// Rows and wrench are in its axes, moments about the base's origin at r: from those about the laboratory's
/// `S_M − r × S_F + ṙ × D_F` is smoothed and `D_M − r × D_F` differentiated, as `r × ∂D = ∂(r × D) − ṙ × D`.
pub struct RowMaker {
    moving: Moving,
    base: BaseSensor,
    wrench: bool,
    efforts: bool,
    still: bool,
    offset: bool,
    /// Standard columns that represent the base parameters, and what makes of them the base parameters' own
    /// columns; `None` where these are the same.
    leads: Vec<usize>,
    mix: Option<DMatrix<f64>>,
    /// The part of the nominal bodies beside their base parameters: in no row but those of a base
    /// that is tilted.
    unseen: Vec<f64>,
    /// Room for the entries of a row in the columns of `leads`.
    led: Vec<f64>,
    /// Accelerations, which rows of momentum do not depend on.
    zeros: Vec<f64>,
    drives: Vec<(super::drive::Drive, usize)>,
    columns: usize,
    contact: Option<Contact>,
}

/// Returns names and units of all parameters: base parameters, offsets, drives.
pub fn names_and_units(input: &Input, base: &BaseParameters) -> (Vec<String>, Vec<&'static str>) {
    let (mut names, mut units) = (Vec::new(), Vec::new());
    for parameter in &base.parameters {
        names.push(parameter.name.clone());
        units.push(match parameter.terms.first().map_or(0, |t| t.0 % 10) {
            0 => "kg",
            1..4 => "kg m",
            _ => "kg m2",
        });
    }
    if estimates_offset(input) {
        for (k, name) in PARAMETER_NAMES.iter().enumerate().skip(10) {
            names.push((*name).to_owned());
            units.push(if k < 13 { "N" } else { "N m" });
        }
    }
    for drive in input.drives.iter().filter(|_| input.has_efforts()) {
        for term in &drive.terms {
            names.push(format!("{}.{}", drive.name, term.name()));
            units.push(term.unit(drive.slides));
        }
    }
    (names, units)
}

/// Returns what the nominal bodies of the links of [`RowMaker::moving`] have beside their base parameters,
/// ten numbers each.
fn unseen(
    input: &Input,
    base: &BaseParameters,
    (leads, mix): (&[usize], Option<&DMatrix<f64>>),
    links: usize,
) -> Vec<f64> {
    let nominal = input.model.nominal();
    let standard = nominal.get(nominal.len() - base.standard.len()..).unwrap_or(&[]);
    let mut all = vec![0.0; 10 * links - standard.len()];
    all.extend(standard);
    let values = base.map() * DVector::from_column_slice(standard);
    let own = mix.map_or_else(|| values.clone(), |mix| mix * &values);
    for (lead, value) in leads.iter().zip(own.iter()) {
        if let Some(to) = all.get_mut(*lead) {
            *to -= value;
        }
    }
    all
}

fn estimates_offset(input: &Input) -> bool {
    input.has_wrench() && input.known_offset.is_none()
}

impl RowMaker {
    /// Returns the maker of the rows of a recording.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub fn new(input: &Input, base: &BaseParameters) -> Result<Self, TreeError> {
        let moving = Self::about_imu(input)?;
        // Columns of the root are no link's; those of a base held still, without its wrench, are left out
        // too.
        let skip = 10 + 10 * input.model.links.len() - base.standard.len();
        let (mut leads, mix) = base.columns();
        leads.iter_mut().for_each(|lead| *lead += skip);
        let unseen = unseen(input, base, (&leads, mix.as_ref()), moving.links().len());
        let (names, _) = names_and_units(input, base);
        let zeros = vec![0.0; moving.freedoms()];
        let mut drives = Vec::new();
        let mut at = leads.len() + if estimates_offset(input) { 6 } else { 0 };
        for drive in input.drives.iter().filter(|_| input.has_efforts()) {
            drives.push((drive.clone(), at));
            at += drive.terms.len();
        }
        Ok(Self {
            moving,
            base: input.base,
            wrench: input.has_wrench(),
            efforts: input.has_efforts(),
            still: input.is_static,
            offset: estimates_offset(input),
            led: Vec::with_capacity(leads.len()),
            zeros,
            leads,
            mix,
            unseen,
            drives,
            columns: names.len(),
            contact: input.contact.clone(),
        })
    }

    /// Returns the tree whose root is the IMU of the base, or the laboratory: the root, the base link, the
    /// others.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub(super) fn about_imu(input: &Input) -> Result<Moving, TreeError> {
        let one = Matrix3::identity();
        let root = Link { parent: 0, joint: Joint::Fixed, rotation: one, position: Vector3::zeros() };
        let base_link = match input.base {
            BaseSensor::Imu(place) => Link { position: -Vector3::from(place), ..root },
            BaseSensor::Tracked => Link { joint: Joint::Free, ..root },
        };
        let mut links = vec![root, base_link];
        let own = input.model.links.iter().skip(1);
        links.extend(own.map(|l| Link { parent: l.link.parent + 1, ..l.link }));
        Moving::new(links)
    }

    /// Writes the rows of a frame, one a channel, where there is room for them.
    ///
    /// # Errors
    /// [`TreeError::Lengths`] if the frame does not fit the tree.
    pub fn rows(&mut self, frame: &Frame, out: &mut SampleRows) -> Result<(), TreeError> {
        self.set(frame)?;
        let wanted = rows_of(self.wrench, self.efforts).ok_or(TreeError::Lengths)?;
        let mut parts = self.moving.momentum_rows(wanted)?;
        if self.wrench {
            self.about_base(&mut parts);
        }
        self.part(&parts.smoothed, frame, true, &mut out.smoothed);
        if self.still {
            // In still poses nothing changes.
            out.differentiated.fill(0.0);
        } else {
            self.part(&parts.differentiated, frame, false, &mut out.differentiated);
        }
        self.moving.give_back(parts);
        Ok(())
    }

    /// Writes rows of a frame and combines them and `out.measured`, the readings of base and efforts, so that
    /// they are free of all that is not measured.
    ///
    /// # Errors
    /// [`TreeError`] if the frame does not fit the tree or the states of contact.
    pub(super) fn available(&mut self, frame: &Frame, out: &mut SampleRows) -> Result<(), TreeError> {
        self.available_rows(frame, out).map(|_| ())
    }

    /// Does as [`RowMaker::available`], and returns what is available; `None` where there are no feet.
    pub(super) fn available_rows(
        &mut self,
        frame: &Frame,
        out: &mut SampleRows,
    ) -> Result<Option<Availability>, TreeError> {
        self.rows(frame, out)?;
        let available = self.availability(frame)?;
        if let Some(available) = &available {
            available.combine(&mut out.smoothed, &mut out.differentiated, self.columns);
            available.combine_measured(&mut out.measured);
        }
        Ok(available)
    }

    /// Returns the columns of wrenches at places on links, of the frame that the tree was brought to, in axes
    /// that are given in the base's, base ← axes; `None`: in those of their sensors.
    ///
    /// # Errors
    /// [`TreeError`] if the links are in no order.
    pub(super) fn wrench_columns(
        &mut self,
        places: &[(Foot, Option<Matrix3<f64>>)],
    ) -> Result<Vec<Columns>, TreeError> {
        let states = self.moving.states();
        let turned = places.iter().map(|(foot, axes)| {
            let state = axes.zip(states.get(foot.link + BASE));
            let rotation = state.map_or(foot.rotation, |(axes, state)| state.rotation.tr_mul(&axes));
            Foot { rotation, ..foot.clone() }
        });
        let turned: Vec<Foot> = turned.collect();
        forces::columns(&mut self.moving, &turned.iter().collect::<Vec<_>>())
    }

    /// Returns what is available of the rows of the frame that the tree was brought to; `None` where there
    /// are no feet.
    fn availability(&mut self, frame: &Frame) -> Result<Option<Availability>, TreeError> {
        self.contact.as_ref().map(|contact| contact.availability(&mut self.moving, frame)).transpose()
    }

    /// Returns the motion of the base link and of every other one.
    ///
    /// # Errors
    /// [`TreeError::Lengths`] if the frame does not fit the tree.
    pub(super) fn states(&mut self, frame: &Frame) -> Result<Vec<LinkState<f64>>, TreeError> {
        self.set(frame)?;
        Ok(self.moving.states().iter().skip(BASE).copied().collect())
    }

    fn set(&mut self, frame: &Frame) -> Result<(), TreeError> {
        let motion = match self.base {
            BaseSensor::Imu(_) => frame.base,
            BaseSensor::Tracked => BaseMotion::still([0.0, 0.0, -STANDARD_GRAVITY_MPS2]),
        };
        self.moving.set(&frame.positions, &frame.rates, &self.zeros, &motion)
    }

    /// Returns the tree about the IMU: the root there, then the base link and the others.
    pub(super) fn moving(&self) -> &Moving {
        &self.moving
    }

    /// Returns bodies of the links of [`RowMaker::moving`], ten parameters each, that these base parameters
    /// predict the same rows of: of all such those nearest to the nominal ones.
    pub(super) fn bodies(&self, parameters: &[f64]) -> Vec<[f64; 10]> {
        let own = |body: &[f64]| std::array::from_fn(|k| body.get(k).copied().unwrap_or(0.0));
        let mut bodies: Vec<[f64; 10]> = self.unseen.chunks(10).map(own).collect();
        for (i, lead) in self.leads.iter().enumerate() {
            let own = match &self.mix {
                None => parameters.get(i).copied().unwrap_or(0.0),
                Some(mix) => mix.row(i).iter().zip(parameters).map(|(m, v)| m * v).sum(),
            };
            if let Some(to) = bodies.get_mut(lead / 10).and_then(|body| body.get_mut(lead % 10)) {
                *to += own;
            }
        }
        bodies
    }

    /// Adds what the drives of a freedom have in its row, smoothed or differentiated.
    fn add_drives(&self, freedom: usize, frame: &Frame, smoothed: bool, row: &mut [f64]) {
        for (drive, at) in &self.drives {
            let Some((_, factor)) = drive.rates.iter().find(|(k, _)| *k == freedom) else { continue };
            let motion = drive.motion(&frame.positions, &frame.rates, &frame.efforts);
            for (term, to) in drive.terms.iter().zip(row.iter_mut().skip(*at)) {
                let is_known = !(drive.stands && term.is_dry());
                *to = if is_known { factor * term.column(&motion, drive.slides, smoothed) } else { 0.0 };
            }
        }
    }

    /// Returns the drives, each with the place of its first parameter.
    pub(super) fn drives(&self) -> &[(super::drive::Drive, usize)] {
        &self.drives
    }

    /// Brings moments from the root's origin to the base's.
    fn about_base(&self, parts: &mut MomentumRows) {
        match (self.base, self.moving.states().get(BASE)) {
            // M about S = M about U + p × F, and U does not move against S.
            (BaseSensor::Imu(place), _) => {
                self.add_arm(&Vector3::from(place), &mut parts.smoothed);
                self.add_arm(&Vector3::from(place), &mut parts.differentiated);
            }
            (BaseSensor::Tracked, Some(base)) => {
                let (arm, velocity) = (-base.position, base.velocity);
                let mut turned = parts.differentiated.clone();
                self.add_arm(&velocity, &mut turned);
                for (to, (with, without)) in
                    parts.smoothed.iter_mut().zip(turned.iter().zip(&parts.differentiated))
                {
                    *to += with - without;
                }
                self.add_arm(&arm, &mut parts.smoothed);
                self.add_arm(&arm, &mut parts.differentiated);
            }
            (BaseSensor::Tracked, None) => {}
        }
    }

    /// Adds the moment of the forces at an arm to the moments.
    fn add_arm(&self, arm: &Vector3<f64>, rows: &mut [f64]) {
        let stride = self.moving.columns();
        for axis in 0..3 {
            let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
            for c in 0..stride {
                let moment = rows[(3 + axis) * stride + c];
                rows[(3 + axis) * stride + c] =
                    moment + arm[j] * rows[k * stride + c] - arm[k] * rows[j * stride + c];
            }
        }
    }

    fn part(&mut self, all: &[f64], frame: &Frame, smoothed: bool, out: &mut [f64]) {
        let stride = self.moving.columns();
        out.fill(0.0);
        let mut rows = out.chunks_exact_mut(self.columns.max(1));
        if self.wrench {
            for (axis, (row, out)) in all.chunks_exact(stride).take(6).zip(rows.by_ref()).enumerate() {
                self.select(row, out);
                if self.offset && smoothed {
                    out[self.leads.len() + axis] = 1.0;
                }
            }
        }
        if self.efforts {
            for (freedom, (row, out)) in all.chunks_exact(stride).skip(6).zip(rows).enumerate() {
                self.select(row, out);
                self.add_drives(freedom, frame, smoothed, out);
            }
        }
    }

    /// Writes the base parameters' columns of a row of standard ones.
    fn select(&mut self, row: &[f64], out: &mut [f64]) {
        let lead = self.leads.iter().map(|c| row[*c]);
        match &self.mix {
            None => out.iter_mut().zip(lead).for_each(|(to, v)| *to = v),
            Some(mix) => {
                self.led.clear();
                self.led.extend(lead);
                for (to, column) in out.iter_mut().zip(mix.column_iter()) {
                    *to = column.iter().zip(&self.led).map(|(m, v)| m * v).sum();
                }
            }
        }
    }
}

/// Returns the effort of drives, each with the place of its first parameter, that parameters predict for a
/// freedom: the smoothed part or that which is differentiated.
pub(super) fn effort_of_drives(
    drives: &[(super::drive::Drive, usize)],
    freedom: usize,
    frame: &Frame,
    smoothed: bool,
    phi: &[f64],
) -> f64 {
    let mut sum = 0.0;
    for (drive, at) in drives {
        let Some((_, factor)) = drive.rates.iter().find(|(k, _)| *k == freedom) else { continue };
        let motion = drive.motion(&frame.positions, &frame.rates, &frame.efforts);
        for (term, value) in drive.terms.iter().zip(phi.iter().skip(*at)) {
            if !(drive.stands && term.is_dry()) {
                sum += factor * term.column(&motion, drive.slides, smoothed) * value;
            }
        }
    }
    sum
}

/// Returns which rows there are if the base's wrench or the joints' efforts are measured; `None` without
/// either.
pub fn rows_of(wrench: bool, efforts: bool) -> Option<Rows> {
    match (wrench, efforts) {
        (true, true) => Some(Rows::Both),
        (true, false) => Some(Rows::Base),
        (false, true) => Some(Rows::Joint),
        (false, false) => None,
    }
}
