//! The places of force plates according to feet: centres of pressure beside where soles carry people.

use nalgebra::Vector2;

use super::Person;
use super::contact::{KeptSoles, LOADED_N, LOW_M, distance, expanded, pressure, soles, sunken};
use super::track::Tracked;
use rigident_fit::parallel;

/// A centre of pressure counts from this vertical force on, N.
const CLEAR_N: f64 = 100.0;
/// Fewest frames that tell.
const FEWEST: usize = 10;
/// The place of the centre of pressure, of the way from heel to ball: of a foot that is flat on average, with
/// its ball in the air, and with its heel in the air.
const ALONG: [f64; 3] = [0.6, 0.1, 1.0];
/// It is so far outside of the foot's axis on average, m: the outer edge carries more.
const OUTSIDE_M: f64 = 0.012;

/// The distance of the centre of pressure under one foot from where people have it on average.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// The plate, by its number.
    pub plate: usize,
    /// The foot's axis from heel to ball, laboratory's x and y.
    pub axis: Vector2<f64>,
    /// The distance along the axis, and to its left, m: weighted means by load.
    pub off_m: [f64; 2],
}

impl Footprint {
    /// The uncertainty of people's average for one foot, 1 σ along and across, m: that of its way from heel
    /// to ball, and of markers on shoes (assumed).
    pub const SIGMA_M: [f64; 2] = [0.02, 0.01];
}

#[derive(Clone, Copy, Default)]
struct Sum {
    count: usize,
    load: f64,
    axis: Vector2<f64>,
    off: [f64; 2],
}

/// Returns the footprints on the plates of a trial, of each plate and foot.
pub fn footprints(person: &Person, trial: usize) -> Vec<Footprint> {
    let Some(tracked) = person.trials.get(trial) else { return Vec::new() };
    let of = |frame: usize| soles(&person.subject, &tracked.places(&person.subject, frame)?);
    let all: Vec<Option<KeptSoles>> = parallel::each(tracked.report.frames, of);
    let floor = sunken(&all);
    let mut sums = vec![[Sum::default(); 2]; tracked.plates.len()];
    for (k, frame) in tracked.frames.iter().enumerate() {
        let own = all.get(frame.number).and_then(Option::as_ref);
        let Some(own) = own else { continue };
        add(&mut sums, tracked, k, (own, &floor));
    }
    let plates = sums.iter().enumerate().flat_map(|(plate, feet)| feet.iter().map(move |sum| (plate, sum)));
    let loaded = plates.filter(|(_, sum)| sum.count >= FEWEST);
    let print = |(plate, sum): (usize, &Sum)| {
        let off_m = sum.off.map(|off| off / sum.load);
        Some(Footprint { plate, axis: sum.axis.try_normalize(1e-6)?, off_m })
    };
    loaded.filter_map(print).collect()
}

/// Adds the loads of a frame, by its place among those that are used, each to the foot that it is under.
fn add(sums: &mut [[Sum; 2]], tracked: &Tracked, k: usize, (kept, floor): (&KeptSoles, &[[f64; 4]; 2])) {
    let own = expanded(kept);
    let lift = |foot: usize, point: usize| own[foot][point].z - floor[foot][point];
    let in_air = |foot: usize| (0..4).all(|point| lift(foot, point) > LOW_M);
    let lowest = own.iter().flatten().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let load = |plate: usize| tracked.plates.get(plate)?.wrench.get(k).map(|w| w.map(f64::from));
    let loaded = (0..sums.len()).filter(|plate| load(*plate).is_some_and(|load| load[2] > LOADED_N)).count();
    for (plate, feet) in sums.iter_mut().enumerate() {
        let Some(load) = load(plate).filter(|load| load[2] > CLEAR_N) else { continue };
        let height = tracked.plates[plate].height_m.unwrap_or(lowest.min(0.0));
        let pressed = pressure(&load, height);
        let away = [0, 1].map(|foot: usize| distance(&own[foot], &pressed));
        let foot = usize::from(away[1] < away[0]);
        // One foot alone: the other one is in the air, or on another plate.
        if !in_air(1 - foot) && loaded != 2 {
            continue;
        }
        let sole = &own[foot];
        let (heel, ball) = ((sole[0] + sole[1]) / 2.0, (sole[2] + sole[3]) / 2.0);
        let line = (ball - heel).xy();
        let (length, axis) = (line.norm(), line.normalize());
        let from = (pressed - heel).xy();
        let [heel_up, ball_up] = [(0, 1), (2, 3)].map(|(a, b)| lift(foot, a) + lift(foot, b) > 2.0 * LOW_M);
        let along = if heel_up { ALONG[2] } else { ALONG[usize::from(ball_up)] };
        let outside = if foot == 0 { OUTSIDE_M } else { -OUTSIDE_M };
        let off = [axis.dot(&from) - along * length, axis.x * from.y - axis.y * from.x - outside];
        if !off.iter().all(|v| v.is_finite()) {
            continue;
        }
        let sum = &mut feet[foot];
        sum.count += 1;
        sum.load += load[2];
        sum.axis += axis * load[2];
        sum.off.iter_mut().zip(off).for_each(|(sum, off)| *sum += off * load[2]);
    }
}
