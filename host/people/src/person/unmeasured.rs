//! Contacts that no plate measures: a seat, a rail, a box, a partner.
//!
//! The force that the table's bodies need for the motion, `s M (c̈ + g)`, less the measured one is what
//! pushes a person beside the plates. Whatever carries her takes from the plates: s is the plates' mass over
//! the table's by the stretches of time in which they carry most. Over a contact the angular momentum about
//! the centre of mass changes little, so that the contact's mean moment about that is the plates' with the
//! other sign, and tells where it pushes.

use std::ops::Range;

use hexapod::STANDARD_GRAVITY_MPS2 as GRAVITY;
use nalgebra::Vector3;

use super::alignment::{self, along, needed, total};
use super::compared::Compared;
use crate::inverse_kinematics::skeleton::Place;
use crate::inverse_kinematics::subject::Subject;
use rigident_io::motion_capture::trial::Trial;
use rigident_rows::smoothing::Smoother;

/// Both forces are smoothed with this cut-off, Hz.
const CUT_OFF_HZ: f64 = 6.0;
/// The share of the plates is judged over stretches of this length, s, …
const LEVEL_S: f64 = 0.5;
/// … that begin this long after one another, s.
const HOP_S: f64 = 0.1;
/// Stretches are at one level if their shares differ by less, relative, …
const SAME_LEVEL: f64 = 0.05;
/// … and carry all if theirs is at least this share of the highest level, …
const CARRIES_ALL: f64 = 0.9;
/// … which is one with so large a part of all stretches, …
const LEVEL_PART: f64 = 0.15;
/// … and no fewer than this many: a second.
const LEVEL_LEAST: usize = 6;
/// The time over which the residual force is averaged, s: soft tissue and steps are over by then.
const MEAN_S: f64 = 0.35;
/// No table leaves more of a mean than this share of the weight, and that of the measured force.
const LARGEST: [f64; 2] = [0.06, 0.04];
/// A mean is one of the whole time if this share of it is known, …
const MOSTLY_KNOWN: f64 = 0.8;
/// … and of a part of it no table leaves more than this share of the weight.
const LARGEST_OF_A_PART: f64 = 0.4;
/// A force less than this share of the weight over the whole of its time is none.
const LEAST_MEAN: f64 = 0.05;
/// A contact lasts while what is left along it is more than this share of the weight, …
const FADED: f64 = 0.03;
/// … and this long before and after, s: the filters reach so far.
const MARGIN_S: f64 = 0.1;
/// A contact is at a part of the body if its line passes no farther from it, m.
const NEAR_M: f64 = 0.25;
/// Frames of one piece of the work: of a long trial not everything is stored at once.
const PIECE: usize = 30_000;

/// A contact that no plate measures.
#[derive(Clone, Debug, PartialEq)]
pub struct Unmeasured {
    /// From when to when, from the trial's first frame on, s.
    pub times_s: [f64; 2],
    /// The mean force of the contact on the person, laboratory axes, N.
    pub force_n: Vector3<f64>,
    /// The largest force, N.
    pub most_n: f64,
    /// The link that its line of action passes nearest to; `None` if it passes none.
    pub near: Option<String>,
}

/// The forces that a person's motion needs and those that plates measured, frame by frame.
pub(super) struct Forces {
    rate_hz: f64,
    weight_n: f64,
    /// Needed by the table's bodies, and measured, N; `None` where frames are not used.
    pairs: Vec<Option<[Vector3<f32>; 2]>>,
}

impl Forces {
    /// Compares the forces of a trial in the frames that are used; `centre` is where the table's centre of
    /// mass is in each, m.
    pub(super) fn of(
        subject: &Subject,
        trial: &Trial,
        is_used: &(dyn Fn(usize) -> bool + Sync),
        centre: &(dyn Fn(usize) -> Vector3<f64> + Sync),
    ) -> Option<Self> {
        let smoother = Smoother::new(CUT_OFF_HZ, trial.rate_hz)?;
        let (count, reach) = (trial.frames(), 2 * smoother.half());
        let mut pairs = Vec::with_capacity(count);
        for from in (0..count).step_by(PIECE) {
            let to = count.min(from + PIECE);
            let wide = from.saturating_sub(reach)..count.min(to + reach);
            let centres = rigident_fit::parallel::each(wide.len(), |k| centre(wide.start + k));
            let needed = needed(subject, &centres, &smoother);
            let measured = along(&total(trial, &wide, &smoother, 0.0), &smoother, false);
            pairs.extend((from..to).map(|frame| {
                let k = frame - wide.start;
                let (needed, measured) = (needed.get(k).copied().flatten()?, measured.get(k).copied()?);
                (is_used(frame) && measured.x.is_finite())
                    .then(|| [needed, measured].map(|v| v.map(|v| v as f32)))
            }));
        }
        Some(Self { rate_hz: trial.rate_hz, weight_n: subject.person.mass_kg * GRAVITY, pairs })
    }

    /// Returns false if what is measured along a horizontal axis goes against what the motion needs there: an
    /// axis with a wrong sign is no contact.
    pub(super) fn go_with_the_motion(&self) -> bool {
        let pairs = self.pairs.iter().flatten().map(|pair| pair.map(|v| v.map(f64::from))).collect();
        Compared::of(pairs).is_none_or(|compared| compared.flipped().is_none())
    }

    fn frames(&self, seconds: f64) -> usize {
        (seconds * self.rate_hz).round().max(1.0) as usize
    }

    /// Returns the plates' share of the needed force in stretches of time, each with its first frame.
    fn shares(&self) -> Vec<(usize, f64)> {
        let length = self.frames(LEVEL_S);
        let of = |from: usize| {
            let own = self.pairs.get(from..from + length)?.iter().flatten();
            let (mut count, mut sum, mut product, mut square) = (0, 0.0, 0.0, 0.0);
            for [needed, measured] in own {
                let [n, m] = [needed.z, measured.z].map(f64::from);
                (count, sum) = (count + 1, sum + n);
                (product, square) = (product + n * m, square + n * n);
            }
            let is_known = 5 * count > 3 * length && sum > 0.5 * self.weight_n * f64::from(count as u32);
            is_known.then(|| (from, product / square))
        };
        (0..self.pairs.len()).step_by(self.frames(HOP_S)).filter_map(of).collect()
    }

    /// Returns the plates' mass over the table's, by the stretches in which plates carry most; `None` of a
    /// trial that is too short.
    pub(super) fn level(&self) -> Option<f64> {
        let shares = self.shares();
        let mut sorted: Vec<f64> = shares.iter().map(|(_, share)| *share).collect();
        sorted.sort_by(|a, b| b.total_cmp(a));
        let least = ((LEVEL_PART * sorted.len() as f64) as usize).max(LEVEL_LEAST).min(sorted.len());
        let beside =
            |share: f64| sorted.iter().filter(move |own| (**own - share).abs() <= SAME_LEVEL * share);
        let highest = *sorted.iter().find(|share| beside(**share).count() >= least)?;
        let (sum, count) = beside(highest).fold((0.0, 0.0), |(sum, count), own| (sum + own, count + 1.0));
        let least = CARRIES_ALL * sum / count;
        let length = self.frames(LEVEL_S);
        let mut carried = vec![false; self.pairs.len()];
        shares.iter().filter(|(_, share)| *share > least).for_each(|(from, _)| {
            carried[*from..from + length].fill(true);
        });
        let own = self.pairs.iter().zip(&carried).filter_map(|(pair, is_own)| pair.filter(|_| *is_own));
        let (product, square) = own.fold((0.0, 0.0), |(product, square), [needed, measured]| {
            let [n, m] = [needed.z, measured.z].map(f64::from);
            (product + n * m, square + n * n)
        });
        (square > 0.0 && product > 0.0).then(|| product / square)
    }

    /// Returns how far the plates lean, x and y: the median of what is left of the horizontal force over the
    /// vertical one. A slope is no contact.
    fn lean(&self, level: f64) -> [f64; 2] {
        let carried =
            self.pairs.iter().flatten().filter(|[_, m]| f64::from(m.z) > 0.5 * self.weight_n * level);
        [0, 1].map(|axis| {
            let ratio = |[n, m]: &[Vector3<f32>; 2]| (n[axis] * level as f32 - m[axis]) / m.z;
            let mut all: Vec<f32> = carried.clone().map(ratio).collect();
            all.sort_by(f32::total_cmp);
            all.get(all.len() / 2).map_or(0.0, |v| f64::from(*v))
        })
    }

    /// Returns what pushes beside the plates in a frame, N, with the measured force, if plates have this
    /// share of the table's mass and lean by this much.
    fn left(&self, frame: usize, (level, lean): (f64, [f64; 2])) -> Option<[Vector3<f64>; 2]> {
        let [needed, measured] = self.pairs.get(frame).copied().flatten()?.map(|v| v.map(f64::from));
        let leans = Vector3::new(lean[0], lean[1], 0.0) * measured.z;
        Some([needed * level - measured - leans, measured])
    }

    /// Returns the means of the force that is left and of the measured force about a known frame, with the
    /// share of known frames in that time. Half a step is no mean.
    fn mean_left(&self, frame: usize, level: (f64, [f64; 2])) -> Option<([Vector3<f64>; 2], f64)> {
        self.pairs.get(frame)?.as_ref()?;
        let half = self.frames(MEAN_S / 2.0);
        let own = (frame.saturating_sub(half)..=frame + half).filter_map(|k| self.left(k, level));
        let (mut sums, mut count) = ([Vector3::zeros(); 2], 0.0);
        for pair in own {
            sums.iter_mut().zip(pair).for_each(|(sum, own)| *sum += own);
            count += 1.0;
        }
        Some((sums.map(|sum| sum / count), count / (2 * half + 1) as f64))
    }

    /// Returns the largest mean of what is left outside of some frames, N.
    pub(super) fn largest_mean(&self, level: f64, outside: &[Range<usize>]) -> Option<f64> {
        let level = (level, self.lean(level));
        let is_outside = |frame: usize| outside.iter().all(|own| !own.contains(&frame));
        let mean = |frame: usize| {
            let ([left, _], known) = self.mean_left(frame, level)?;
            (known >= MOSTLY_KNOWN && is_outside(frame)).then(|| left.norm())
        };
        rigident_fit::parallel::each(self.pairs.len(), mean).into_iter().flatten().max_by(f64::total_cmp)
    }

    /// Returns the stretches of frames in which something pushes beside the plates.
    pub(super) fn pushed(&self, level: f64) -> Vec<Range<usize>> {
        let weight = level * self.weight_n;
        let level = (level, self.lean(level));
        let core = |frame: usize| {
            let ([left, measured], known) = self.mean_left(frame, level)?;
            let largest = if known >= MOSTLY_KNOWN { LARGEST[0] } else { LARGEST_OF_A_PART };
            (left.norm() > largest * weight + LARGEST[1] * measured.norm()).then_some(left)
        };
        let cores = rigident_fit::parallel::each(self.pairs.len(), core);
        let mut all: Vec<Range<usize>> = Vec::new();
        let margin = self.frames(MARGIN_S);
        for (frame, left) in cores.iter().enumerate().filter_map(|(k, left)| Some((k, left.as_ref()?))) {
            if all.last().is_some_and(|last| frame < last.end.saturating_sub(margin)) {
                continue;
            }
            let along = left.normalize();
            // Over frames that are not known, as of feet that hardly touch the plates while she sits, a
            // contact goes on.
            let is_known = |k: &usize| self.left(*k, level).is_some();
            let lasts =
                |k: &usize| self.left(*k, level).is_none_or(|[own, _]| own.dot(&along) > FADED * weight);
            let from = (0..frame).rev().take_while(lasts).filter(is_known).last().unwrap_or(frame);
            let after = (frame + 1..self.pairs.len()).take_while(lasts);
            let to = after.filter(is_known).last().unwrap_or(frame);
            let own = from.saturating_sub(margin)..self.pairs.len().min(to + 1 + margin);
            match all.last_mut() {
                Some(last) if own.start <= last.end => last.end = last.end.max(own.end),
                _ => all.push(own),
            }
        }
        let pushes = |own: &Range<usize>| {
            let all = own.clone().filter_map(|frame| self.left(frame, level));
            let (sum, count) = all.fold((Vector3::zeros(), 0.0), |(sum, n), [left, _]| (sum + left, n + 1.0));
            sum.norm() > LEAST_MEAN * weight * count
        };
        all.retain(pushes);
        all
    }

    /// Returns what pushes in some frames; `about` is the person's places and the plates' wrench about the
    /// laboratory's origin in a frame.
    pub(super) fn contact(
        &self,
        subject: &Subject,
        frames: &Range<usize>,
        level: f64,
        about: &dyn Fn(usize) -> Option<(Vec<Place>, [f64; 6])>,
    ) -> Option<Unmeasured> {
        let (mut force, mut moment, mut count, mut most) = (Vector3::zeros(), Vector3::zeros(), 0.0, 0.0_f64);
        let level = (level, self.lean(level));
        let mut parts: Vec<Vector3<f64>> = vec![Vector3::zeros(); subject.model.links.len()];
        for frame in frames.clone() {
            let Some([left, _]) = self.left(frame, level) else { continue };
            most = most.max(left.norm());
            let Some((places, [fx, fy, fz, mx, my, mz])) = about(frame) else { continue };
            let centre = alignment::centre_of_mass(subject, &places);
            force += left;
            moment -= Vector3::new(mx, my, mz) - centre.cross(&Vector3::new(fx, fy, fz));
            parts.iter_mut().zip(&places).for_each(|(part, (_, at))| *part += at - centre);
            count += 1.0;
        }
        (count > 0.0).then(|| {
            let (force, moment) = (force / count, moment / count);
            parts.iter_mut().for_each(|part| *part /= count);
            Unmeasured {
                times_s: [frames.start, frames.end - 1].map(|frame| frame as f64 / self.rate_hz),
                force_n: force,
                most_n: most,
                near: nearest(subject, &parts, &force, &moment),
            }
        })
    }
}

/// Returns the link that a force passes nearest to. `parts` are the places of links from the centre of mass,
/// which the force's moment is about, m.
fn nearest(
    subject: &Subject,
    parts: &[Vector3<f64>],
    force: &Vector3<f64>,
    moment: &Vector3<f64>,
) -> Option<String> {
    let at = |name: &str| parts.get(subject.model.link(name)?).copied();
    let is_upright = |force: &Vector3<f64>| force.z.abs() > force.xy().norm();
    // Who stands on something has hips and feet on one line with it.
    let legs = ["thigh", "shank"].iter().filter_map(|part| subject.person.length(part)).sum::<f64>();
    let feet = f64::midpoint(at("l_foot")?.z, at("r_foot")?.z);
    let stands = at("pelvis")?.z - feet > STRAIGHT * legs;
    let may = |name: &&str| match *name {
        "torso" => !is_upright(force),
        "pelvis" => !(stands && is_upright(force)),
        _ => true,
    };
    let away = |name: &'static str| Some(((moment - at(name)?.cross(force)).norm() / force.norm(), name));
    let all = TOUCHES.into_iter().filter(may).filter_map(away);
    let (away, name) = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (away < NEAR_M).then(|| name.to_owned())
}

/// Legs are straight if the hips are this much of their length above the ankles.
const STRAIGHT: f64 = 0.85;
/// Links that people sit, lean and hold on with.
const TOUCHES: [&str; 6] = ["pelvis", "torso", "l_hand", "r_hand", "l_foot", "r_foot"];

impl Unmeasured {
    /// Returns what pushes, in words: how much, when, where.
    pub fn words(&self) -> String {
        let [from, to] = self.times_s;
        let horizontal = self.force_n.xy().norm();
        let way = match self.force_n.z {
            z if z > horizontal => "upwards",
            z if z < -horizontal => "downwards",
            _ => "sideways",
        };
        let near = match self.near.as_deref() {
            Some("pelvis") => ", at the hips (a seat?)".to_owned(),
            Some("torso") => ", at the trunk (a backrest, a harness?)".to_owned(),
            Some(name) => {
                let side = if name.starts_with("l_") { "left" } else { "right" };
                let (part, what) = if name.ends_with("hand") {
                    ("hand", "a rail, a stick, a partner?")
                } else {
                    ("foot", "a box, a step, the floor beside the plates?")
                };
                format!(", at the {side} {part} ({what})")
            }
            None => String::new(),
        };
        format!(
            "from {from:.2} to {to:.2} s {:.0} N {way} on average, {:.0} N at most{near}",
            self.force_n.norm(),
            self.most_n
        )
    }
}
