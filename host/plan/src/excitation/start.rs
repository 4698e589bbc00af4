//! The start of a robot if nobody says it: it is at zero, or where the robot is clear of the floor.

use super::information::Tree;
use super::plan::{ExcitationError, Task};

/// Poses that are tried.
const TRIED: usize = 4000;
/// Poses are within this share of the positions that may be used: there is room about them.
const INSIDE: f64 = 0.7;

/// Returns the start of a task, rad or m: its own where it was asked for, or is clear of the floor and can be
/// held; else of many poses the nearest one that is, or its own if none is.
///
/// # Errors
/// [`ExcitationError::Model`] if the model has no base parameters.
pub fn clear_start(task: &Task) -> Result<Vec<f64>, ExcitationError> {
    if task.is_start_given || task.apart.floor_m.is_none() {
        return Ok(task.start.clone());
    }
    let tree = Tree::new(&task.model, &task.measured)?;
    let mut moving = tree.moving();
    let mut at = |positions: &[f64]| tree.at_rest(&mut moving, positions);
    let free = [at(&task.zero()).0, at(&task.start).0];
    let collisions = task.collisions(&tree, &free);
    let mut room = |positions: &[f64]| {
        let (states, efforts) = at(positions);
        let holds = efforts.iter().zip(&task.limits).all(|(own, limits)| own.abs() < limits.usable_effort());
        let nearest = collisions.nearest(&states).map_or(f64::INFINITY, |nearest| nearest.distance_m);
        holds.then_some(nearest - task.apart.clearance_m).filter(|room| *room > 0.0)
    };
    if room(&task.start).is_some() {
        return Ok(task.start.clone());
    }
    let middles: Vec<(f64, f64)> = task.limits.iter().map(|limits| limits.room()).collect();
    let away = |positions: &[f64]| -> f64 {
        let each = positions.iter().zip(&task.start).zip(&middles);
        each.map(|((own, start), (_, half))| ((own - start) / half).powi(2)).sum()
    };
    // As near as a tenth of the reach counts as in the way; further off any pose is as good.
    let near = collisions.near_m();
    let mut best: Option<(f64, f64, Vec<f64>)> = None;
    for number in 1..=TRIED {
        let even = evenly(number, middles.len());
        let pose = even.iter().zip(&middles).map(|(share, (middle, half))| middle + INSIDE * half * share);
        let pose: Vec<f64> = pose.collect();
        let Some(room) = room(&pose).map(|room| room.min(near)) else { continue };
        let distance = away(&pose);
        let is_better = |best: &(f64, f64, Vec<f64>)| (room, -distance) > (best.0, -best.1);
        if best.as_ref().is_none_or(is_better) {
            best = Some((room, distance, pose));
        }
    }
    Ok(best.map_or_else(|| task.start.clone(), |(_, _, pose)| pose))
}

/// Returns a point of a sequence that fills a cube from −1 to 1 evenly: multiples of powers of the inverse of
/// the root of `x^(n+1) = x + 1` (M. Roberts, "The unreasonable effectiveness of quasirandom sequences",
/// 2018).
fn evenly(number: usize, dimensions: usize) -> Vec<f64> {
    let mut root = 2.0_f64;
    for _ in 0..40 {
        root = (1.0 + root).powf(1.0 / (dimensions as f64 + 1.0));
    }
    let share = |k: usize| (0.5 + number as f64 * root.powi(-(k as i32 + 1))).fract();
    (0..dimensions).map(|k| 2.0 * share(k) - 1.0).collect()
}
