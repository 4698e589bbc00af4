//! Runs with faults, and what became of them.

use std::collections::BTreeMap;

use super::chip::{Chip, MS};
use super::faults::{Drawn, Kind};
use super::host::Plan;
use super::world::{self, Life};

/// The end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum End {
    /// An answer, every parameter within [`MOST_SD`] of the truth.
    Answered,
    /// No answer, or one that is withheld, with a word.
    Withheld,
    /// No answer and no word.
    Silent,
    /// An answer that is wrong, and no word.
    Wrong,
    /// The device could not be set up again.
    Dead,
    /// Samples are missing that nobody has counted.
    Uncounted,
    /// Something that the manual forbids.
    Forbidden,
}

impl End {
    pub fn is_good(self) -> bool {
        matches!(self, Self::Answered | Self::Withheld)
    }
}

/// Sixteen parameters of ten thousand answers: one in a million of normal errors is beyond, in all.
pub const MOST_SD: f64 = 6.0;
/// Samples that may be on their way when a run begins and when it ends: as many as the ring holds, if the
/// program is late.
const ON_THE_WAY: i64 = 8;
const IN_THE_RING: i64 = 144;

/// Runs a board with these faults.
pub fn run(drawn: &mut Drawn, seed: u64, seconds: u64) -> Life {
    planned(seed, seconds, |chip, plan| drawn.happen(chip, plan))
}

/// Runs a board that this is done to.
pub fn run_with(seed: u64, seconds: u64, prepare: impl FnOnce(&Chip)) -> Life {
    planned(seed, seconds, |chip, plan| {
        prepare(chip);
        Drawn::of(&[], seed).happen(chip, plan);
    })
}

fn planned(seed: u64, seconds: u64, prepare: impl FnOnce(&Chip, &mut Plan)) -> Life {
    let (rig, settings) = world::rig(500.0, seconds as f64, seed);
    let mut plan = Plan {
        settings,
        duration: seconds * 1_000 * MS + 200 * MS,
        calm_after: 0,
        sleeps: None,
        floods: None,
    };
    world::live(rig, &mut plan, seed, prepare)
}

/// Returns the error of the worst parameter of the answer, in its standard deviations.
pub fn worst_sd(life: &Life) -> Option<f64> {
    let report = life.outcome.estimate.as_ref()?;
    let errors = report.estimate.iter().zip(&report.standard_deviation).zip(life.truth);
    let errors = errors.map(|((value, sd), truth)| (f64::from(*value) - truth).abs() / f64::from(*sd));
    Some(errors.fold(0.0, f64::max))
}

/// Returns the number of samples of the load cell that reached the chip and that no counter knows of.
pub fn uncounted(life: &Life) -> Option<i64> {
    let counters = life.outcome.counters.as_ref()?;
    if !life.outcome.started || life.outcome.restarts > 0 {
        return None;
    }
    let came = life.edges[0] as i64;
    let known = [
        counters.readings,
        counters.unaligned,
        counters.load_cell_crc_errors,
        counters.load_cell_errors,
        counters.load_cell_clipped,
        counters.load_cell_stale,
        counters.load_cell_resyncs,
        counters.without_excitation,
        counters.lost[0],
    ];
    Some(came - known.iter().map(|count| i64::from(*count)).sum::<i64>())
}

/// Judges a run.
pub fn end(life: &Life, kinds: &[Kind]) -> End {
    let late = kinds.contains(&Kind::ProgramLate);
    if life.panicked.is_some() || !life.breaches.is_empty() {
        return if life.panicked.is_some() { End::Dead } else { End::Forbidden };
    }
    if !life.outcome.alive && life.reachable {
        return End::Dead;
    }
    let withheld = !life.outcome.words.is_empty();
    match worst_sd(life) {
        None if withheld => return End::Withheld,
        None => return End::Silent,
        Some(sd) if sd.is_nan() || sd > MOST_SD => return if withheld { End::Withheld } else { End::Wrong },
        Some(_) => {}
    }
    let on_the_way = if late { IN_THE_RING } else { ON_THE_WAY };
    if uncounted(life).is_some_and(|missing| missing > on_the_way) {
        return End::Uncounted;
    }
    if withheld { End::Withheld } else { End::Answered }
}

/// The ends of the runs of each kind.
#[derive(Default)]
pub struct Table(BTreeMap<Kind, BTreeMap<End, u32>>);

impl Table {
    pub fn note(&mut self, kinds: &[Kind], end: End) {
        for kind in kinds {
            *self.0.entry(*kind).or_default().entry(end).or_default() += 1;
        }
    }

    pub fn print(&self) {
        println!("| fault | runs | answered | withheld, with a word | wrong or silent | dead | uncounted |");
        println!("|---|--:|--:|--:|--:|--:|--:|");
        for (kind, ends) in &self.0 {
            let of = |end: End| ends.get(&end).copied().unwrap_or(0);
            println!(
                "| {} | {} | {} | {} | {} | {} | {} |",
                kind.name(),
                ends.values().sum::<u32>(),
                of(End::Answered),
                of(End::Withheld),
                of(End::Wrong) + of(End::Silent) + of(End::Forbidden),
                of(End::Dead),
                of(End::Uncounted),
            );
        }
    }
}
