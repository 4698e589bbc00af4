//! The choice of the next segment: the first of the sequence that reaches what is asked for in the shortest
//! time.
//!
//! For a sequence S that brings ΔM in t seconds, k is the number with which `M + kΔM` just reaches the goal,
//! and `k t` is the time it is believed to take. Singles, then the best of them continued, then those once
//! more: a segment that is poor alone, because it shows half of what is needed, is found in company.

use super::goal::Goal;
use super::information::Information;

/// Sequences continued at each length.
const BEAM: usize = 6;
/// A sequence that must be repeated more often leads nowhere.
const MOST_TIMES: f64 = 1e12;
/// Segments in a sequence.
const LONGEST: usize = 3;

/// A sequence that reaches the goal in this many rounds or more is driven in turn.
const REPEATED: f64 = 2.0;

/// The cost and the information of a candidate, from where it is begun.
#[derive(Clone, Debug)]
pub struct Step {
    /// Seconds, the way there included.
    pub seconds: f64,
    /// The information that it brings.
    pub brings: Information,
}

/// A choice.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The candidates, in order; the first is what to do now.
    pub sequence: Vec<usize>,
    /// Until the goal is reached, s.
    pub seconds: f64,
}

impl Choice {
    /// Returns the choice of one candidate, whatever it leads to.
    pub fn alone(candidate: usize) -> Self {
        Self { sequence: vec![candidate], seconds: f64::INFINITY }
    }
}

/// A sequence that leads to the goal only if it is repeated often is driven in turn: chosen anew after each
/// segment, it would always begin with the same one.
#[derive(Clone, Debug, Default)]
pub struct Turns {
    members: Vec<usize>,
    driven: Vec<usize>,
}

impl Turns {
    /// Takes note that a segment of a sequence was driven.
    pub fn driven(&mut self, sequence: &[usize], segment: usize) {
        let members = sorted(sequence);
        if members != self.members {
            (self.members, self.driven) = (members, Vec::new());
        }
        self.driven.push(segment);
    }

    /// Returns the choice beginning with the segment whose turn it is, if its sequence takes `once_s` and is
    /// repeated; with one that can be begun.
    pub fn in_turn(&self, mut choice: Choice, once_s: f64, can_begin: impl Fn(usize) -> bool) -> Choice {
        let members = sorted(&choice.sequence);
        if choice.seconds < REPEATED * once_s || members != self.members {
            return choice;
        }
        let times = |of: &[usize], segment: usize| of.iter().filter(|s| **s == segment).count() as f64;
        // How often each was driven over how often it is in the sequence.
        let due = |segment: usize| times(&self.driven, segment) / times(&members, segment);
        let mut first = 0;
        for (k, segment) in choice.sequence.iter().enumerate() {
            if can_begin(*segment) && due(*segment) < due(choice.sequence[first]) {
                first = k;
            }
        }
        choice.sequence.rotate_left(first);
        choice
    }
}

/// Returns the members of a sequence, whatever their order in it.
fn sorted(sequence: &[usize]) -> Vec<usize> {
    let mut members = sequence.to_vec();
    members.sort_unstable();
    members
}

/// Returns the best sequence; `None` if none reaches the goal. `step(from, to)` is candidate `to` after
/// candidate `from` (`None`: from where the plate is); `None` where that cannot be.
pub fn choose(
    candidates: usize,
    step: &dyn Fn(Option<usize>, usize) -> Option<Step>,
    goal: &Goal,
    now: &Information,
    variance_scale: f64,
) -> Option<Choice> {
    struct Path {
        sequence: Vec<usize>,
        brings: Information,
        seconds: f64,
        total_s: f64,
    }
    let mut best: Option<Choice> = None;
    let root =
        Path { sequence: Vec::new(), brings: Information::zeros(), seconds: 0.0, total_s: f64::INFINITY };
    let mut beam = vec![root];
    for _ in 0..LONGEST {
        let mut longer: Vec<Path> = Vec::new();
        for path in &beam {
            for c in 0..candidates {
                let Some(next) = step(path.sequence.last().copied(), c) else { continue };
                let brings = path.brings + next.brings;
                let seconds = path.seconds + next.seconds;
                let total_s = seconds * times(goal, now, &brings, variance_scale);
                let sequence = path.sequence.iter().copied().chain([c]).collect();
                longer.push(Path { sequence, brings, seconds, total_s });
            }
        }
        longer.sort_by(|a, b| a.total_s.total_cmp(&b.total_s));
        if let Some(first) = longer.first()
            && first.total_s.is_finite()
            && best.as_ref().is_none_or(|b| first.total_s < b.seconds * (1.0 - 1e-6))
        {
            best = Some(Choice { sequence: first.sequence.clone(), seconds: first.total_s });
        }
        let determined = longer.iter().take_while(|path| path.total_s.is_finite()).count();
        if determined > 0 {
            longer.truncate(determined.min(BEAM));
        } else if longer.len() > 2 * BEAM {
            // What alone determines nothing may do so in company: the most telling by volume go on.
            let volumes: Vec<f64> = longer.iter().map(|path| volume(&(now + path.brings))).collect();
            let mut order: Vec<usize> = (0..longer.len()).collect();
            order.sort_by(|a, b| volumes[*b].total_cmp(&volumes[*a]));
            let kept = order.get(2 * BEAM - 1).map_or(f64::NEG_INFINITY, |last| volumes[*last]);
            let mut volumes = volumes.into_iter();
            longer.retain(|_| volumes.next().is_some_and(|v| v >= kept));
        }
        beam = longer;
    }
    best
}

/// Returns the sum of the logarithms of the eigenvalues that are not next to zero, columns scaled to one.
fn volume(information: &Information) -> f64 {
    let scale: [f64; 16] = std::array::from_fn(|j| {
        let d = information[(j, j)];
        if d > 0.0 { d.sqrt().recip() } else { 0.0 }
    });
    let scaled = Information::from_fn(|i, j| information[(i, j)] * scale[i] * scale[j]);
    scaled.symmetric_eigenvalues().iter().map(|v| v.max(1e-9).ln()).sum()
}

/// Returns how often `brings` must be added until the goal is reached; infinite if it never is.
fn times(goal: &Goal, now: &Information, brings: &Information, variance_scale: f64) -> f64 {
    let worst = |k: f64| goal.worst(&(now + brings * k), variance_scale);
    let (mut low, mut high) = (0.0, 1.0);
    let at_one = worst(1.0);
    if !at_one.is_finite() {
        return f64::INFINITY;
    }
    if at_one > 1.0 {
        // Information grows at most with k, so that is the least it takes.
        high = at_one * at_one;
        if high > MOST_TIMES {
            return f64::INFINITY;
        }
        while worst(high) > 1.0 {
            low = high;
            high *= 2.0;
            if high > MOST_TIMES {
                return f64::INFINITY;
            }
        }
    }
    for _ in 0..10 {
        let middle = 0.5 * (low + high);
        if worst(middle) > 1.0 {
            low = middle;
        } else {
            high = middle;
        }
        if high - low < 5e-3 * high {
            break;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Chosen anew after each segment, sequences that must be repeated are driven in their shares, whatever
    /// their order.
    #[test]
    fn a_sequence_that_is_repeated_is_driven_in_turn() {
        let mut turns = Turns::default();
        let (mut times, sequences) = ([0; 8], [vec![7, 7, 2], vec![7, 2, 7], vec![2, 7, 7]]);
        for k in 0..30 {
            let choice = Choice { sequence: sequences[k % 3].clone(), seconds: 500.0 };
            let chosen = turns.in_turn(choice, 12.0, |_| true);
            let first = chosen.sequence[0];
            times[first] += 1;
            turns.driven(&chosen.sequence, first);
        }
        assert_eq!((times[7], times[2]), (20, 10));
    }

    #[test]
    fn a_motion_that_reaches_the_goal_or_cannot_begin_otherwise_stays_as_chosen() {
        let mut turns = Turns::default();
        turns.driven(&[4, 5], 4);
        let choice = |seconds| Choice { sequence: vec![4, 5], seconds };
        assert_eq!(turns.in_turn(choice(20.0), 8.0, |_| true).sequence, [5, 4]);
        assert_eq!(turns.in_turn(choice(12.0), 8.0, |_| true).sequence, [4, 5]);
        assert_eq!(turns.in_turn(choice(20.0), 8.0, |segment| segment == 4).sequence, [4, 5]);
        // Another sequence begins anew.
        assert_eq!(
            turns.in_turn(Choice { sequence: vec![4, 6], seconds: 99.0 }, 8.0, |_| true).sequence,
            [4, 6]
        );
    }
}
