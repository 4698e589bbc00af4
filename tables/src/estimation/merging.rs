//! Recordings of one rig and of several, merged: the share of truths in the intervals, and how wide these
//! are by those of the best linear unbiased estimate.

use rigident::fit::Fit;
use rigident::fit::pool::PooledFactor;

use super::report::{Job, in_parallel};

mod arm;
mod machines;
mod reference;
#[path = "../../../host/cli/tests/integration/merging/runs.rs"]
mod runs;
mod springs;

use runs::bound::{deviations, deviations_beyond, information};
use runs::{Body, Conditions, Errors, NOISY};
use runs::{
    by_best, central_off, factor, larger, off, on_fixture, outside, predicted_off, principal_off, rms,
};
use runs::{sums_off, tared};

/// Rigs that each row draws; `RIGIDENT_RIGS` asks for fewer.
const RIGS: usize = 500;
/// Rigs of the row of a hundred recordings.
const FEW: usize = 24;
/// Rigs of which the best estimate is made.
const BEST: usize = 12;
/// Recordings that are made of each rig.
const EACH: usize = 9;
const MASS_KG: f64 = 3.2;
/// Noise of a second as large as the white noise of a reading, beside a motion three times as slow.
const SLOW: Conditions = Conditions { slow_s: 1.0, slower: 3.0, ..Conditions::STATED };
/// A load cell whose gains and cross-talk are known.
const CALIBRATED: Conditions = Conditions { cell: 0.0, ..Conditions::STATED };

/// The recordings that are merged.
#[derive(Clone, Copy)]
enum Case {
    /// Recordings of one rig.
    One(usize),
    /// Recordings of one rig, of slow noise and slow motion.
    Slow(usize),
    /// Recordings of several rigs, the same number of each.
    Rigs { rigs: usize, each: usize },
    /// Four of one rig, the first with five times its noise.
    Noisy,
    /// Four of one rig whose load cell is calibrated.
    Calibrated,
    /// A body of a tenth of its fixture, whose run is taken off.
    Tare,
    /// Four of one rig that a body of known properties calibrated before.
    Reference,
    /// This many recordings of two links on one load cell.
    Links(u64),
    /// A load, by an arm's recordings with and without it.
    Payload,
    /// This many recordings of a body on one set of springs.
    Springs(u64),
}

/// The errors of a rig's answers.
#[derive(Default)]
struct Asked {
    of_body: Errors,
    of_sums: Errors,
    of_centre: Errors,
    of_axes: Errors,
    of_wrenches: Errors,
}

impl Asked {
    fn of(fit: &Fit, body: &Body) -> Self {
        Self {
            of_body: off(fit, body),
            of_sums: sums_off(fit, body),
            of_axes: principal_off(fit, body),
            of_centre: central_off(fit, body),
            of_wrenches: predicted_off(fit, body),
        }
    }
}

/// The body, rig, motion and conditions of a recording.
#[derive(Clone, Copy)]
struct Made {
    rig: usize,
    recording: usize,
    conditions: Conditions,
}

impl Made {
    fn seed(self) -> u64 {
        1000 * self.rig as u64 + self.recording as u64
    }

    fn factor(self) -> PooledFactor {
        factor(self.rig as u64, &Body::of_mass(MASS_KG), self.seed(), &self.conditions)
    }
}

impl Case {
    /// Returns the recordings of a rig of this number and of others, those of each in a list.
    fn recordings(self, rig: usize, rigs: usize) -> Vec<Vec<Made>> {
        let all = rigs.max(EACH);
        let of = |rig: usize, recordings: std::ops::Range<usize>, conditions: Conditions| -> Vec<Made> {
            recordings.map(|recording| Made { rig: rig % all, recording, conditions }).collect()
        };
        match self {
            Self::One(count) => vec![of(rig, 0..count, Conditions::STATED)],
            Self::Slow(count) => vec![of(rig, 0..count, SLOW)],
            Self::Rigs { rigs, each } => {
                // Those that are next to each other share no recording.
                let own = |k: usize| of(rig + k, k * each..(k + 1) * each, Conditions::STATED);
                (0..rigs).map(own).collect()
            }
            Self::Noisy => {
                let noisy = Made { rig, recording: EACH, conditions: NOISY };
                vec![std::iter::once(noisy).chain(of(rig, 1..4, Conditions::STATED)).collect()]
            }
            Self::Calibrated => vec![of(rig, 0..4, CALIBRATED)],
            Self::Tare | Self::Reference | Self::Links(_) | Self::Payload | Self::Springs(_) => Vec::new(),
        }
    }

    /// Returns how many recordings of stated conditions a rig has that other rows have too.
    fn shared(self) -> usize {
        match self {
            Self::One(count) if count <= EACH => count,
            Self::Rigs { rigs, each } => rigs * each,
            _ => 0,
        }
    }

    /// Returns what is asked, by factors of the stated conditions that were made before.
    fn asked(self, rig: usize, rigs: usize, made: &[Vec<PooledFactor>]) -> Asked {
        let alone = |of_body: Errors| Asked { of_body, ..Asked::default() };
        let body = Body::of_mass(MASS_KG);
        match self {
            Self::Tare => {
                let [small, ..] = on_fixture();
                return Asked::of(&tared(rig as u64, 1_000_000 + 2 * rig as u64), &small);
            }
            Self::Reference => {
                let files = reference::factors(rig, &body, of_reference(rig));
                if files.is_empty() {
                    return Asked::default();
                }
                let pooled = PooledFactor::merged(files, false).expect("recordings of one body fit together");
                return Asked::of(&pooled.fit(), &body);
            }
            Self::Links(runs) => return alone(machines::two_links(rig, runs).1),
            Self::Payload => return alone(arm::payload(rig)),
            Self::Springs(runs) => return alone(springs::merged(rig, runs)),
            _ => {}
        }
        let known = |own: Made| {
            let own_conditions = own.conditions != Conditions::STATED;
            let known = made.get(own.rig).and_then(|of_rig| of_rig.get(own.recording));
            known.filter(|_| !own_conditions).cloned().unwrap_or_else(|| own.factor())
        };
        let files: Vec<PooledFactor> = self.recordings(rig, rigs).concat().into_iter().map(known).collect();
        let pooled = PooledFactor::merged(files, false).expect("recordings of one body fit together");
        Asked::of(&pooled.fit(), &body)
    }

    /// Returns the standard deviations of the best estimate.
    fn best(self, rig: usize, rigs: usize) -> Vec<f64> {
        match self {
            Self::Reference => return reference::best(&Body::of_mass(MASS_KG), of_reference(rig)),
            Self::Links(runs) => {
                return machines::best_of_two_links(&machines::two_links(rig, runs).0, rig, runs);
            }
            Self::Payload => return arm::best(rig),
            _ => {}
        }
        if let Self::Tare = self {
            let [_, bare, both] = on_fixture();
            let seed = 1_000_000 + 2 * rig as u64;
            let of = |body: &Body, seed: u64| information(body, seed, &Conditions::STATED);
            return deviations_beyond(&of(&both, seed), &of(&bare, seed + 1));
        }
        let body = Body::of_mass(MASS_KG);
        let of_rig = |own: Vec<Made>| {
            own.into_iter().map(|made| information(&body, made.seed(), &made.conditions)).collect()
        };
        deviations(&self.recordings(rig, rigs).into_iter().map(of_rig).collect::<Vec<_>>())
    }
}

/// Returns the seed of the recordings of a rig that a reference calibrates.
fn of_reference(rig: usize) -> u64 {
    10_000_000 + 10 * rig as u64
}

/// A row: its name, what is merged, and the number of rigs that it draws.
type RowOf = (&'static str, Case, usize);

/// Returns the table of recordings of one rig and of several.
pub fn table() -> String {
    study(&[
        ("1 recording", Case::One(1), RIGS),
        ("4 of one rig", Case::One(4), RIGS),
        ("9 of one rig", Case::One(EACH), RIGS),
        ("1 of each of 4 rigs", Case::Rigs { rigs: 4, each: 1 }, RIGS),
        ("1 of each of 9 rigs", Case::Rigs { rigs: EACH, each: 1 }, RIGS),
        ("3 of each of 3 rigs", Case::Rigs { rigs: 3, each: 3 }, RIGS),
    ])
}

/// Returns the table of a hundred recordings of one rig.
pub fn hundred_table() -> String {
    study(&[("100 of one rig", Case::One(100), FEW)])
}

/// Returns the table of recordings that are not alike.
pub fn unlike_table() -> String {
    study(&[
        ("4 of one rig, one with five times its noise", Case::Noisy, RIGS),
        ("4 of one rig, its load cell calibrated", Case::Calibrated, RIGS),
        ("1 recording, slow motion, noise of 1 s", Case::Slow(1), RIGS),
        ("4 of one rig, the same", Case::Slow(4), RIGS),
    ])
}

/// Returns the table of a body on a fixture.
pub fn tare_table() -> String {
    study(&[("0.64 kg on a fixture of 6.4 kg, taken off", Case::Tare, RIGS)])
}

/// Returns the table of machines, and of a rig that was calibrated.
pub fn machines_table() -> String {
    study(&[
        ("4 of one rig, calibrated by a body of known properties", Case::Reference, RIGS),
        ("two links, 1 recording", Case::Links(1), RIGS),
        ("two links, 4 of one rig", Case::Links(4), RIGS),
        ("a load of 2 kg on an arm of seven axes", Case::Payload, RIGS),
        ("12 kg on springs, 1 recording", Case::Springs(1), RIGS),
        ("12 kg on springs, 4 of one set", Case::Springs(4), RIGS),
    ])
}

/// Returns a row for each case.
fn study(rows: &[RowOf]) -> String {
    let most = most_rigs();
    let of_rig = |rig: usize, each: usize| {
        let own = move |recording| Made { rig, recording, conditions: Conditions::STATED }.factor();
        Box::new(move || (0..each).map(own).collect()) as Job<'_, Vec<PooledFactor>>
    };
    // Recordings of stated conditions are those of several rows.
    let each = rows.iter().map(|(_, case, _)| case.shared()).max().unwrap_or(0);
    let rigs = rows.iter().map(|(_, _, count)| (*count).min(most)).max().unwrap_or(0);
    let made = &in_parallel((0..rigs).map(|rig| of_rig(rig, each)).collect());
    let mut text = String::from(
        "| recordings | rigs drawn | inside U95, % | sums, differences | c, I_c | principal moments, axes | \
         predicted wrenches | rms error, σ | U95 by the best, least–largest | U95 by that of one recording \
         |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for (name, case, count) in rows {
        let begun = std::time::Instant::now();
        text.push_str(&row(name, *case, ((*count).min(most), rigs), made));
        eprintln!("  {name}: {:.0} s", begun.elapsed().as_secs_f64());
    }
    text
}

/// Returns a row; of `count` rigs, beside others of `rigs`.
fn row(name: &str, case: Case, (count, rigs): (usize, usize), made: &[Vec<PooledFactor>]) -> String {
    let ask = |case: Case| {
        let jobs = (0..count).map(|rig| Box::new(move || case.asked(rig, rigs, made)) as Job<'_, _>);
        in_parallel(jobs.collect())
    };
    let mut all: Vec<Asked> = ask(case);
    // A calibration may be refused.
    all.retain(|own| !own.of_body.is_empty());
    let count = all.len();
    let inside = |of: &dyn Fn(&Asked) -> &Errors| {
        let own: Vec<Errors> = all.iter().map(|own| of(own).clone()).collect();
        if own.iter().all(Vec::is_empty) {
            String::new()
        } else {
            format!("{:.1}", 100.0 * (1.0 - outside(&own)))
        }
    };
    let shares = [
        inside(&|own| &own.of_body),
        inside(&|own| &own.of_sums),
        inside(&|own| &own.of_centre),
        inside(&|own| &own.of_axes),
        inside(&|own| &own.of_wrenches),
    ];
    let own: Vec<Errors> = all.iter().map(|own| own.of_body.clone()).collect();
    // The best estimate of slow noise is another, and that of springs has noise in all it measures.
    let bounds = match case {
        Case::One(100) | Case::Links(_) => 2,
        Case::Slow(_) | Case::Springs(_) => 0,
        _ => BEST.min(count),
    };
    let best =
        in_parallel((0..bounds).map(|rig| Box::new(move || case.best(rig, rigs)) as Job<'_, _>).collect());
    let ratios = by_best(&own, &best);
    let [least, most] = [f64::min, f64::max].map(|of| ratios.iter().copied().reduce(of).unwrap_or(f64::NAN));
    let by_best = if bounds > 0 { format!("{least:.2}–{most:.2}") } else { String::new() };
    let single = |case: Case| -> Vec<Errors> { ask(case).into_iter().map(|own| own.of_body).collect() };
    let wider = match case {
        Case::One(_) | Case::Rigs { .. } | Case::Noisy => Some(Case::One(1)),
        Case::Links(_) => Some(Case::Links(1)),
        Case::Springs(_) => Some(Case::Springs(1)),
        _ => None,
    };
    let wider = wider.map_or_else(String::new, |one| format!("{:.2}", larger(&own, &single(one))));
    format!("| {name} | {count} | {} | {:.2} | {by_best} | {wider} |\n", shares.join(" | "), rms(&own))
}

/// Returns the most rigs that a row draws: all, unless fewer are asked for by the environment.
pub fn most_rigs() -> usize {
    std::env::var("RIGIDENT_RIGS").ok().and_then(|count| count.parse().ok()).unwrap_or(usize::MAX)
}
