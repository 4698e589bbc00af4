//! The search: a low-discrepancy sequence over all combinations of orientations, then a refinement of the
//! best.
//!
//! The refinement polls `2 d` orthogonal directions that turn from poll to poll: the columns of the
//! Householder reflection of the next point of the same sequence, ± (OrthoMADS: Abramson, Audet, Dennis and
//! Le Digabel, *SIAM J. Optim.* 20, 2009). A condition number is not differentiable where eigenvalues meet,
//! and they meet at the optimum; fixed directions get stuck there and so does a simplex. Bounds are enforced
//! by projection.

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::Vector3;

use super::measure::Objective;
use super::region::Region;

/// Combinations that are examined, as in the thesis.
pub const COMBINATIONS: usize = 100_000;
/// Combinations that are refined, as in the thesis.
pub const STARTS: usize = 10;
/// Step of the poll directions at the beginning, as a share of each coordinate's range.
const FIRST_STEP: f64 = 0.125;
/// The step at which a refinement ends.
const LAST_STEP: f64 = 1e-9;
/// Polls after which it ends, too.
const POLLS: usize = 20_000;
/// Combinations between two checks of the flag.
const CHUNK: usize = 2_000;

/// The task of the search, and its region.
#[derive(Clone, Copy, Debug)]
pub struct Search<'a> {
    /// The region where the plate can go.
    pub region: &'a Region,
    /// Number of orientations.
    pub n: usize,
    /// The objective.
    pub objective: Objective,
}

/// The best that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// "Up" in the plate's axes, one a pose, by azimuth.
    pub ups: Vec<Vector3<f64>>,
    /// Cost of the best combination of the sequence.
    pub screened: f64,
    /// Cost after refinement.
    pub cost: f64,
}

/// A combination: two coordinates in [0, 1] for each orientation, with its cost.
type Candidate = (f64, Vec<f64>);

impl Search<'_> {
    /// Searches on all cores; the result does not depend on how many there are. `progress` receives what is
    /// being done; `stop` ends the search with the best so far. `None` if no combination determines what is
    /// sought.
    pub fn run(&self, stop: &AtomicBool, mut progress: impl FnMut(&str)) -> Option<Found> {
        progress("looking at combinations of orientations");
        let starts = self.screen(stop);
        let screened = starts.first()?.0;
        let mut best = starts.first()?.clone();
        let count = starts.len();
        let refined = std::thread::scope(|scope| {
            let cores = std::thread::available_parallelism().map_or(1, usize::from);
            let handles: Vec<_> = starts
                .chunks(count.div_ceil(cores))
                .map(|part| {
                    let part = part.to_vec();
                    scope.spawn(move || {
                        part.into_iter().map(|start| self.refine(start, stop)).collect::<Vec<_>>()
                    })
                })
                .collect();
            progress(&format!("refining the best {count}"));
            handles.into_iter().filter_map(|h| h.join().ok()).flatten().collect::<Vec<_>>()
        });
        for candidate in refined {
            if candidate.0 < best.0 {
                best = candidate;
            }
        }
        let (cost, x) = best;
        let mut ups = self.ups(&x);
        ups.sort_by(|a, b| a.y.atan2(a.x).total_cmp(&b.y.atan2(b.x)));
        Some(Found { ups, screened, cost })
    }

    fn ups(&self, x: &[f64]) -> Vec<Vector3<f64>> {
        x.as_chunks::<2>().0.iter().map(|pair| self.region.direction(*pair)).collect()
    }

    fn cost(&self, x: &[f64]) -> f64 {
        self.objective.cost(&self.ups(x))
    }

    /// Returns the best of the sequence, best first.
    fn screen(&self, stop: &AtomicBool) -> Vec<Candidate> {
        let halton = Halton::new(2 * self.n);
        let next = std::sync::atomic::AtomicUsize::new(0);
        let mut all: Vec<(f64, usize)> = std::thread::scope(|scope| {
            let work = || {
                let mut best: Vec<(f64, usize)> = Vec::new();
                loop {
                    let first = next.fetch_add(CHUNK, Ordering::Relaxed);
                    // The first chunk is always examined.
                    if first >= COMBINATIONS || (first > 0 && stop.load(Ordering::Relaxed)) {
                        return best;
                    }
                    best.extend(
                        (first..(first + CHUNK).min(COMBINATIONS))
                            .map(|k| (self.cost(&halton.point(k + 1)), k))
                            .filter(|(cost, _)| cost.is_finite()),
                    );
                    best.sort_by(by_cost_then_place);
                    best.truncate(STARTS);
                }
            };
            let cores = std::thread::available_parallelism().map_or(1, usize::from);
            let handles: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
            handles.into_iter().filter_map(|h| h.join().ok()).flatten().collect()
        });
        all.sort_by(by_cost_then_place);
        all.truncate(STARTS);
        all.into_iter().map(|(cost, k)| (cost, halton.point(k + 1))).collect()
    }

    /// Returns a better combination near one, by polling; the step is doubled by a success and halved by a
    /// failure.
    fn refine(&self, (mut cost, mut x): Candidate, stop: &AtomicBool) -> Candidate {
        let dimension = x.len();
        let halton = Halton::new(dimension);
        let mut step = FIRST_STEP;
        let good_enough = self.objective.floor() + 1e-10;
        for poll in 1..=POLLS {
            if step < LAST_STEP || cost < good_enough || stop.load(Ordering::Relaxed) {
                break;
            }
            let mut axis: Vec<f64> = halton.point(poll + dimension).iter().map(|h| 2.0 * h - 1.0).collect();
            let norm = axis.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-12);
            axis.iter_mut().for_each(|v| *v /= norm);
            let polled = (0..2 * dimension).find_map(|direction| {
                let (column, sign) = (direction / 2, if direction % 2 == 0 { step } else { -step });
                let trial: Vec<f64> = (0..dimension)
                    .map(|i| {
                        let reflection = f64::from(u8::from(i == column)) - 2.0 * axis[i] * axis[column];
                        let moved = x[i] + sign * reflection;
                        // Azimuths go round, shares end at the border.
                        if i % 2 == 0 { moved.rem_euclid(1.0) } else { moved.clamp(0.0, 1.0) }
                    })
                    .collect();
                let trial_cost = self.cost(&trial);
                (trial_cost < cost).then_some((trial_cost, trial))
            });
            match polled {
                Some(better) => {
                    (cost, x) = better;
                    step = (2.0 * step).min(FIRST_STEP);
                }
                None => step *= 0.5,
            }
        }
        (cost, x)
    }
}

fn by_cost_then_place(a: &(f64, usize), b: &(f64, usize)) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

/// Halton's sequence: coordinate j of point k is the radical inverse of k in the j-th prime's base.
#[derive(Clone, Debug)]
struct Halton {
    bases: Vec<usize>,
}

impl Halton {
    fn new(dimension: usize) -> Self {
        let mut bases: Vec<usize> = Vec::with_capacity(dimension);
        let mut candidate = 2_usize;
        while bases.len() < dimension {
            if bases.iter().all(|p| !candidate.is_multiple_of(*p)) {
                bases.push(candidate);
            }
            candidate += 1;
        }
        Self { bases }
    }

    /// Draws a point whose coordinates are all in [0, 1).
    fn point(&self, k: usize) -> Vec<f64> {
        let inverse = |base: usize| {
            let (mut rest, mut weight, mut sum) = (k, 1.0, 0.0);
            while rest > 0 {
                weight /= base as f64;
                sum += weight * (rest % base) as f64;
                rest /= base;
            }
            sum
        };
        self.bases.iter().map(|b| inverse(*b)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::poses::measure::{
        condition_number, least_condition_number_in_cone, normal_matrix, up_in_plate,
    };

    fn best(region: &Region, n: usize, objective: Objective) -> Found {
        Search { region, n, objective }.run(&AtomicBool::new(false), |_| ()).unwrap()
    }

    #[test]
    fn the_sequence_is_haltons() {
        let halton = Halton::new(3);
        assert_eq!(halton.bases, [2, 3, 5]);
        let p = halton.point(11);
        // 11 is 1011 in base 2, 102 in base 3, 21 in base 5.
        for (got, want) in p.iter().zip([13.0 / 16.0, 19.0 / 27.0, 7.0 / 25.0]) {
            assert!((got - want).abs() < 1e-15);
        }
    }

    /// The closed form of the optimum on a cone, from where it is the border's to where it is a regular
    /// figure's.
    #[test]
    fn the_search_finds_the_closed_forms_optimum_on_cones() {
        for tilt_deg in [20.0_f64, 32.5, 45.0, 54.8, 65.0] {
            let region = Region::cone(tilt_deg.to_radians());
            for n in 2..=6 {
                let want = least_condition_number_in_cone(n, tilt_deg.to_radians());
                let found = best(&region, n, Objective::Condition);
                assert!(found.cost > want * (1.0 - 1e-9), "{n} at {tilt_deg}: below the optimum");
                assert!(found.cost < want * (1.0 + 1e-3), "{n} at {tilt_deg}: {} for {want}", found.cost);
                assert!(found.cost <= found.screened);
            }
        }
    }

    /// Two orientations on a border that is no circle, by trying all pairs in steps of three degrees.
    #[test]
    fn no_pair_of_a_grid_is_better_than_the_pair_found() {
        let inside = |up: &Vector3<f64>| {
            let tilt = up.z.acos();
            tilt <= 0.5 + 0.12 * (3.0 * up.y.atan2(up.x)).cos()
        };
        let region = Region::reachable_by(inside);
        let found = best(&region, 2, Objective::Condition);
        let grid: Vec<Vector3<f64>> = (-14..=14)
            .flat_map(|r| {
                (-14..=14).map(move |p| [f64::from(r), f64::from(p)].map(|d| (3.0 * d).to_radians()))
            })
            .map(up_in_plate)
            .filter(inside)
            .collect();
        let mut brute = f64::INFINITY;
        for (i, a) in grid.iter().enumerate() {
            for b in &grid[..i] {
                brute = brute.min(condition_number(&normal_matrix([*a, *b])));
            }
        }
        // 2/(1 − cos 2τ) changes by 2 cot τ for each rad of tilt; the grid misses the border by up to 3° · √½
        // on both.
        let loss = 2.0 * (brute / 2.0 - 1.0).sqrt() * 2.0_f64.sqrt() * 3_f64.to_radians();
        assert!(found.cost <= brute && brute < found.cost * (1.0 + loss), "{} {brute}", found.cost);
    }

    /// D-optimal: `Σ u uᵀ` as even as the cone allows; at 60° three orthogonal directions, determinant 8.
    #[test]
    fn the_largest_determinant_of_three_is_that_of_orthogonal_directions() {
        let found = best(&Region::cone(60_f64.to_radians()), 3, Objective::Determinant);
        assert!((found.cost + 8_f64.ln()).abs() < 1e-6, "{}", found.cost);
    }

    #[test]
    fn more_orientations_leave_less_uncertainty_and_two_leave_it_infinite() {
        let objective = Objective::WorstUncertainty {
            moment_sigma_nm: [0.38, 0.46, 0.46],
            plate_to_cell: nalgebra::Matrix3::identity(),
        };
        let region = Region::cone(0.55);
        let search = |n| Search { region: &region, n, objective }.run(&AtomicBool::new(false), |_| ());
        assert_eq!(search(2), None);
        let costs: Vec<f64> = (3..=6).map(|n| search(n).unwrap().cost).collect();
        assert!(costs.windows(2).all(|pair| pair[1] < pair[0]), "{costs:?}");
        // Among random sets of the region none is better.
        let halton = Halton::new(8);
        for k in 1..3000 {
            let ups: Vec<_> =
                halton.point(k + 50_000).as_chunks::<2>().0.iter().map(|x| region.direction(*x)).collect();
            assert!(objective.cost(&ups) >= costs[1]);
        }
    }
}
