//! The information of a motion of joints on the base parameters, and how that changes with the motion.
//!
//! `M = Σ Aᵀ W A` with the regressor of `identify`: base parameters, friction, offsets, at white noise of
//! efforts and wrench. Its filter is not in it; what it takes off is in the prediction. Columns are those of
//! the standard parameters that represent the base parameters: `log det M` differs from that of the base
//! parameters by a constant.
//!
//! The gradient of `log det M` goes backwards: `d log det M = Σ_r ⟨2 w M⁻¹ a_r, da_r⟩`, a_r the rows. How
//! rows change with position, rate and acceleration of a joint is found by differences. A column of a link
//! depends on the joints between it and the base alone, so that all joints of one depth are moved at once:
//! three differences for each depth of the tree, whatever the number of its joints.

use hexapod::STANDARD_GRAVITY_MPS2;
use nalgebra::{DMatrix, DVector};
use rigident_shared::tree::{BaseMotion, LinkState};

use super::family::Motion;
use rigident_model::Model;
use rigident_model::base::{Rows, Situation};
use rigident_model::passive::Passive;
use rigident_model::rows::Moving;
use rigident_rows::tree::drive::{Drive, DriveState, Friction, Term};
use rigident_rows::tree::{BaseSensor, Input, TreeSource, TreeSourceError};

/// Steps of the differences: rows are smooth in positions, quadratic in rates and linear in accelerations.
const STEPS: [f64; 3] = [1e-7, 1e-6, 1.0];
/// Information of a direction, in columns of unit length, below which it counts as this: an open direction
/// leaves a finite volume.
const OPEN: f64 = 1e-13;
/// Rows of the base's wrench.
const WRENCH: usize = 6;

/// The quantities measured while a robot moves, with what noise, and what is estimated beside the links.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Joint efforts, the base's wrench or both.
    pub rows: Rows,
    /// 1 σ of every joint's effort per reading, N m or N.
    pub effort_noise: Vec<f64>,
    /// 1 σ of the wrench per reading, N and N m.
    pub wrench_noise: [f64; 6],
    /// Readings per second.
    pub rate_hz: f64,
    /// Friction columns.
    pub friction: Friction,
}

/// A row that is measured.
struct MeasuredRow {
    /// The row's place among all rows, the wrench first.
    place: usize,
    /// The block of parameters that it is a row of.
    block: usize,
    /// One over its variance.
    weight: f64,
    /// Standard columns with their places in the block.
    links: Vec<(usize, usize)>,
    /// Other columns with their places in the block.
    others: Vec<(Other, usize)>,
}

/// A row's place, its standard columns and its others, each with its parameter.
type Places = (usize, Vec<(usize, usize)>, Vec<(Other, usize)>);

/// A column that is no link's.
#[derive(Clone, Copy)]
enum Other {
    /// An offset of the wrench.
    One,
    /// A column of the drive of a freedom.
    Drive(Term, usize),
}

/// A tree of revolute and prismatic joints on a base that is held still, with what is measured of it.
pub struct Tree {
    source: TreeSource,
    moving: Moving,
    base: BaseMotion<f64>,
    nominal: Vec<f64>,
    passive: Vec<Passive>,
    slides: Vec<bool>,
    /// Freedoms between the base and each link, nearest to the base first.
    paths: Vec<Vec<usize>>,
    rows: Vec<MeasuredRow>,
    /// Sizes of the blocks of parameters that no row has in common.
    blocks: Vec<usize>,
}

/// One instant: rows of standard parameters and the nominal efforts without dry friction.
pub(super) struct Instant {
    rows: Vec<f64>,
    pub(super) efforts: Vec<f64>,
}

impl Tree {
    /// Returns a tree without fixed joints whose other joints have one freedom each.
    ///
    /// # Errors
    /// [`TreeSourceError`] if the model has no base parameters.
    pub fn new(model: &Model, measured: &Measured) -> Result<Self, TreeSourceError> {
        let names: Vec<String> = model.links.iter().skip(1).map(|l| l.joint_name.clone()).collect();
        let mut drives = Drive::of_joints(&names, &model.tree(), &measured.friction);
        drives.retain(|drive| !drive.terms.is_empty());
        let situation = Situation { floating: false, rows: measured.rows, mimic: false };
        let mut sigma = Vec::new();
        if measured.rows != Rows::Joint {
            sigma.extend(measured.wrench_noise);
        }
        if measured.rows != Rows::Base {
            sigma.extend(&measured.effort_noise);
        }
        let source = TreeSource::new(Input {
            model: model.clone(),
            frames: Vec::new(),
            is_static: false,
            rate_hz: measured.rate_hz,
            base: BaseSensor::Imu([0.0; 3]),
            situation,
            channel_sigma: Some(sigma.clone()),
            known_offset: None,
            nuisances: Vec::new(),
            errors: Vec::new(),
            drives,
            as_stated: Vec::new(),
            signals: Vec::new(),
            rate_sigma: 0.0,
            contact: None,
        })?;
        let mut paths: Vec<Vec<usize>> = vec![Vec::new()];
        for (i, link) in model.links.iter().enumerate().skip(1) {
            let mut path = paths.get(link.link.parent).cloned().unwrap_or_default();
            path.push(i - 1);
            paths.push(path);
        }
        let (rows, blocks) = rows(&source, &paths, &sigma);
        Ok(Self {
            moving: Moving::new(model.tree()).map_err(TreeSourceError::Frames)?,
            base: BaseMotion::still([0.0, 0.0, -STANDARD_GRAVITY_MPS2]),
            nominal: model.nominal(),
            passive: model.links.iter().skip(1).map(|l| l.passive[0]).collect(),
            slides: model
                .links
                .iter()
                .skip(1)
                .map(|l| matches!(l.link.joint, rigident_shared::tree::Joint::Prismatic(_)))
                .collect(),
            paths,
            rows,
            blocks,
            source,
        })
    }

    /// Returns the source of rows without frames: parameters, channels and their σ.
    pub fn source(&self) -> &TreeSource {
        &self.source
    }

    /// Returns the motion of the base, which is held still.
    pub fn base(&self) -> BaseMotion<f64> {
        self.base
    }

    /// Returns the joints between the base and each link, nearest to the base first.
    pub fn paths(&self) -> &[Vec<usize>] {
        &self.paths
    }

    /// Returns a tree that can be moved.
    pub fn moving(&self) -> Moving {
        self.moving.clone()
    }

    /// Returns the efforts of the nominal model in a motion, N m or N, dry friction left out, and leaves
    /// `moving` there; `None` if the numbers do not fit.
    pub fn efforts(&self, moving: &mut Moving, motion: &Motion) -> Option<Vec<f64>> {
        Some(self.instant(moving, motion)?.efforts)
    }

    /// Returns the states of the links and the efforts that hold them, N m or N, in a pose at rest, rad or m.
    pub(super) fn at_rest(&self, moving: &mut Moving, positions: &[f64]) -> (Vec<LinkState<f64>>, Vec<f64>) {
        let motion = Motion { positions: positions.to_vec(), ..Motion::zeros(positions.len()) };
        let efforts = self.efforts(moving, &motion).unwrap_or_default();
        (moving.states().to_vec(), efforts)
    }

    pub(super) fn instant(&self, moving: &mut Moving, motion: &Motion) -> Option<Instant> {
        moving.set(&motion.positions, &motion.rates, &motion.accelerations, &self.base).ok()?;
        let rows = moving.all_rows().ok()?.to_vec();
        let stride = self.nominal.len();
        let efforts =
            rows.chunks_exact(stride).skip(WRENCH).zip(&self.passive).enumerate().map(|(k, (row, own))| {
                let links: f64 = row.iter().zip(&self.nominal).map(|(a, phi)| a * phi).sum();
                links
                    + own.armature * motion.accelerations[k]
                    + own.damping * motion.rates[k]
                    + own.stiffness * (motion.positions[k] - own.spring_reference)
            });
        let efforts = efforts.collect();
        Some(Instant { rows, efforts })
    }

    /// Returns the information of no readings.
    pub(super) fn nothing(&self) -> Vec<DMatrix<f64>> {
        self.blocks.iter().map(|size| DMatrix::zeros(*size, *size)).collect()
    }

    fn entries(&self, row: &MeasuredRow, instant: &Instant, motion: &Motion, out: &mut Vec<(usize, f64)>) {
        out.clear();
        let all = &instant.rows[row.place * self.nominal.len()..];
        out.extend(row.links.iter().map(|(column, at)| (*at, all[*column])));
        out.extend(row.others.iter().map(|(other, at)| (*at, self.other(*other, instant, motion))));
    }

    fn other(&self, other: Other, instant: &Instant, motion: &Motion) -> f64 {
        match other {
            Other::One => 1.0,
            Other::Drive(term, k) => self.column(term, k, motion, instant.efforts[k]),
        }
    }

    fn column(&self, term: Term, k: usize, motion: &Motion, effort: f64) -> f64 {
        if term == Term::Rotor {
            return motion.accelerations[k];
        }
        let own = DriveState { position: motion.positions[k], rate: motion.rates[k], load: effort };
        term.column(&own, self.slides[k], true)
    }

    /// Adds the given number of readings of an instant.
    pub(super) fn add(
        &self,
        instant: &Instant,
        motion: &Motion,
        readings: f64,
        information: &mut [DMatrix<f64>],
    ) {
        let mut entries = Vec::new();
        for row in &self.rows {
            self.entries(row, instant, motion, &mut entries);
            let block = &mut information[row.block];
            for (j, b) in &entries {
                let b = readings * row.weight * b;
                for (i, a) in entries.iter().filter(|(i, _)| i <= j) {
                    block[(*i, *j)] += a * b;
                }
            }
        }
    }

    /// Returns what a change of the motion at an instant is worth where `log det M` counts `−1` and the
    /// nominal efforts `pulls`; `inverse` are the blocks of `M⁻¹`, `moving` is left elsewhere.
    pub(super) fn worth(
        &self,
        (instant, motion): (&Instant, &Motion),
        (inverse, readings): (&[DMatrix<f64>], f64),
        pulls: &[f64],
        moving: &mut Moving,
    ) -> Option<Motion> {
        let stride = self.nominal.len();
        let mut worth = Motion::zeros(self.slides.len());
        let mut pulls = pulls.to_vec();
        let mut slopes = vec![0.0; instant.rows.len()];
        let mut entries = Vec::new();
        for row in &self.rows {
            self.entries(row, instant, motion, &mut entries);
            let inverse = &inverse[row.block];
            let mut product = DVector::zeros(inverse.nrows());
            entries.iter().for_each(|(j, a)| product.axpy(*a, &inverse.column(*j), 1.0));
            product *= -2.0 * readings * row.weight;
            for (column, at) in &row.links {
                slopes[row.place * stride + column] = product[*at];
            }
            for (other, at) in &row.others {
                let Other::Drive(term, k) = *other else { continue };
                self.worth_of_drive(term, k, product[*at], (instant, motion), &mut worth, &mut pulls);
            }
        }
        for (k, (pull, own)) in pulls.iter().zip(&self.passive).enumerate() {
            worth.accelerations[k] += pull * own.armature;
            worth.rates[k] += pull * own.damping;
            worth.positions[k] += pull * own.stiffness;
            let row = &mut slopes[(WRENCH + k) * stride..(WRENCH + k + 1) * stride];
            row.iter_mut().zip(&self.nominal).for_each(|(to, phi)| *to += pull * phi);
        }
        let [of_positions, of_rates, of_accelerations] =
            self.differences(instant, motion, &slopes, moving)?;
        let add = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(to, v)| *to += v);
        add(&mut worth.positions, &of_positions);
        add(&mut worth.rates, &of_rates);
        add(&mut worth.accelerations, &of_accelerations);
        Some(worth)
    }

    /// Adds what a drive's column is worth: dry friction has no slope but Stribeck's, and load that of the
    /// effort.
    fn worth_of_drive(
        &self,
        term: Term,
        k: usize,
        slope: f64,
        (instant, motion): (&Instant, &Motion),
        worth: &mut Motion,
        pulls: &mut [f64],
    ) {
        let (rate, effort) = (motion.rates[k], instant.efforts[k]);
        match term {
            Term::Rotor => worth.accelerations[k] += slope,
            Term::Spring => worth.positions[k] += slope,
            Term::Load => pulls[k] += slope * self.column(term, k, motion, 1.0) * effort.signum(),
            Term::Viscous | Term::Coulomb(Some(_)) | Term::Stribeck(_) if rate.abs() > STEPS[1] => {
                let own = DriveState { rate, load: effort, ..DriveState::default() };
                let at = |by: f64| term.column(&DriveState { rate: rate + by, ..own }, self.slides[k], true);
                worth.rates[k] += slope * (at(STEPS[1]) - at(-STEPS[1])) / (2.0 * STEPS[1]);
            }
            _ => {}
        }
    }

    /// Returns, for positions, rates and accelerations of every joint, `⟨slopes, ∂rows⟩`.
    fn differences(
        &self,
        instant: &Instant,
        motion: &Motion,
        slopes: &[f64],
        moving: &mut Moving,
    ) -> Option<[Vec<f64>; 3]> {
        let stride = self.nominal.len();
        let mut found: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; self.slides.len()]);
        let deepest = self.paths.iter().map(Vec::len).max().unwrap_or(0);
        for depth in 0..deepest {
            for (kind, step) in STEPS.into_iter().enumerate() {
                let mut moved = motion.clone();
                let values = match kind {
                    0 => &mut moved.positions,
                    1 => &mut moved.rates,
                    _ => &mut moved.accelerations,
                };
                for path in self.paths.iter().filter(|path| path.len() == depth + 1) {
                    values[path[depth]] += step;
                }
                moving.set(&moved.positions, &moved.rates, &moved.accelerations, &self.base).ok()?;
                let rows = moving.all_rows().ok()?;
                for (i, path) in self.paths.iter().enumerate().filter(|(_, path)| path.len() > depth) {
                    let mut sum = 0.0;
                    for place in (0..WRENCH).chain(path.iter().map(|k| WRENCH + k)) {
                        let own = place * stride + 10 * i..place * stride + 10 * i + 10;
                        let change = rows[own.clone()].iter().zip(&instant.rows[own.clone()]);
                        sum += change.zip(&slopes[own]).map(|((a, b), slope)| slope * (a - b)).sum::<f64>();
                    }
                    found[kind][path[depth]] += sum / step;
                }
            }
        }
        Some(found)
    }
}

/// Returns the rows that are measured and the sizes of the blocks of parameters: those that rows have in
/// common are of one block.
fn rows(source: &TreeSource, paths: &[Vec<usize>], sigma: &[f64]) -> (Vec<MeasuredRow>, Vec<usize>) {
    let (input, base) = (source.input(), source.base());
    let skip = 10 * paths.len() - base.standard.len();
    let (leads, _) = base.columns();
    let leads: Vec<usize> = leads.into_iter().map(|lead| lead + skip).collect();
    let freedoms = paths.len() - 1;
    // For each row: its place, lead columns and others, by parameter.
    let mut found: Vec<Places> = Vec::new();
    let mut parameters = leads.len();
    if input.has_wrench() {
        for axis in 0..WRENCH {
            let links = leads.iter().enumerate().map(|(j, lead)| (*lead, j)).collect();
            found.push((axis, links, vec![(Other::One, parameters + axis)]));
        }
        parameters += WRENCH;
    }
    if input.has_efforts() {
        for k in 0..freedoms {
            let beyond = |lead: usize| paths.get(lead / 10).is_some_and(|path| path.contains(&k));
            let own = leads.iter().enumerate().filter(|(_, lead)| beyond(**lead));
            found.push((WRENCH + k, own.map(|(j, lead)| (*lead, j)).collect(), Vec::new()));
        }
        let first = found.len() - freedoms;
        for drive in &input.drives {
            for term in &drive.terms {
                for (k, _) in &drive.rates {
                    found[first + k].2.push((Other::Drive(*term, *k), parameters));
                }
                parameters += 1;
            }
        }
    }
    let of_row = |row: &Places| -> Vec<usize> {
        row.1.iter().map(|(_, j)| *j).chain(row.2.iter().map(|(_, j)| *j)).collect()
    };
    // The least parameter that each is joined with, until nothing changes.
    let mut joined: Vec<usize> = (0..parameters).collect();
    loop {
        let before = joined.clone();
        for row in &found {
            let own = of_row(row);
            let least = own.iter().map(|j| joined[*j]).min().unwrap_or(0);
            own.iter().for_each(|j| joined[*j] = least);
        }
        if joined == before {
            break;
        }
    }
    let mut names: Vec<usize> = joined.clone();
    names.sort_unstable();
    names.dedup();
    let block_of = |j: usize| names.iter().position(|name| *name == joined[j]).unwrap_or(0);
    let blocks: Vec<usize> = names.iter().map(|name| joined.iter().filter(|j| *j == name).count()).collect();
    let local = |j: usize| (0..j).filter(|i| joined[*i] == joined[j]).count();
    let rows = found
        .iter()
        .zip(sigma)
        .map(|(row, sigma)| MeasuredRow {
            place: row.0,
            block: of_row(row).first().map_or(0, |j| block_of(*j)),
            weight: sigma.powi(-2),
            links: row.1.iter().map(|(column, j)| (*column, local(*j))).collect(),
            others: row.2.iter().map(|(other, j)| (*other, local(*j))).collect(),
        })
        .collect();
    (rows, blocks)
}

/// Returns `log det M` and the blocks of `M⁻¹`; `None` if a number is not finite.
pub(super) fn volume(information: &[DMatrix<f64>]) -> Option<(f64, Vec<DMatrix<f64>>)> {
    let mut log = 0.0;
    let mut inverses = Vec::with_capacity(information.len());
    for block in information {
        let n = block.nrows();
        // Units differ by orders of magnitude: a unit diagonal leaves the inverse its digits.
        let scale = block.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 });
        let mut scaled = DMatrix::from_fn(n, n, |i, j| block[(i.min(j), i.max(j))] * scale[i] * scale[j]);
        (0..n).for_each(|i| scaled[(i, i)] += OPEN * n as f64);
        let cholesky = scaled.cholesky()?;
        let diagonal = cholesky.l_dirty().diagonal();
        log += 2.0 * diagonal.map(f64::ln).sum() - 2.0 * scale.map(f64::ln).sum();
        let inverse = cholesky.inverse();
        inverses.push(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]));
    }
    log.is_finite().then_some((log, inverses))
}
