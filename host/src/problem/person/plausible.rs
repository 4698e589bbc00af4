//! Whether what the plates measured can be of the person that the cameras saw: motion along each axis, and mass.

use nalgebra::Vector3;

use super::alignment;
use super::error::PersonError;
use super::people::Person;
use super::track::UsedFrame;

/// Fewest frames that tell whether plates and cameras belong together, …
const FEWEST_TO_COMPARE: usize = 30;
/// … of a person who moves: standard deviations of the force over the weight, …
const MOVES: f64 = 0.03;
/// … and the least correlation of the two.
const LEAST_CORRELATION: f64 = 0.4;
/// Mass over squared stature of living people, kg/m². Nobody lives long of starvation below 10 to 13 (Henry 1990), and the heaviest
/// who still walk are near 80; forces in kgf, lbf or counts are off by 4.4 and more.
const BODY_MASS_INDICES: [f64; 2] = [10.0, 80.0];

/// Needed and measured force in the frames of a trial that are used, N.
struct Compared {
    pairs: Vec<[Vector3<f64>; 2]>,
    means: [Vector3<f64>; 2],
    /// Standard deviations about the means.
    spread: [Vector3<f64>; 2],
}

impl Compared {
    fn new(person: &Person, trial: usize) -> Option<Self> {
        let pairs: Vec<_> = forces(person, trial).into_iter().map(|(_, pair)| pair).collect();
        if pairs.len() < FEWEST_TO_COMPARE {
            return None;
        }
        let n = pairs.len() as f64;
        let means = [0, 1].map(|k| pairs.iter().map(|p| p[k]).sum::<Vector3<f64>>() / n);
        let squares =
            |k: usize| pairs.iter().map(|p| (p[k] - means[k]).map(|v| v * v)).sum::<Vector3<f64>>() / n;
        let spread = [0, 1].map(|k| squares(k).map(f64::sqrt));
        Some(Self { pairs, means, spread })
    }

    /// The correlation of the needed force along an axis with the measured one along another; `None` of who hardly moves along them.
    fn correlation(&self, needed: usize, measured: usize) -> Option<f64> {
        let moves = MOVES * self.means[1].z.abs();
        let [a, b] = [self.spread[0][needed], self.spread[1][measured]];
        let product = |p: &[Vector3<f64>; 2]| {
            (p[0][needed] - self.means[0][needed]) * (p[1][measured] - self.means[1][measured])
        };
        let mean = self.pairs.iter().map(product).sum::<f64>() / self.pairs.len() as f64;
        (a > moves && b > moves).then(|| mean / (a * b))
    }
}

/// Refuses plates that measured another motion than the cameras: what the table's bodies need explains little of it.
pub(super) fn belong_together(person: &Person) -> Result<(), PersonError> {
    for (k, tracked) in person.trials.iter().enumerate() {
        let Some(compared) = Compared::new(person, k) else { continue };
        let name = || tracked.name.clone();
        if let Some(correlation) = compared.correlation(2, 2).filter(|r| *r < LEAST_CORRELATION) {
            return Err(PersonError::Apart { name: name(), correlation });
        }
        let own = [0, 1].map(|axis| compared.correlation(axis, axis));
        let crossed = [compared.correlation(0, 1), compared.correlation(1, 0)];
        let follows = own.iter().flatten().any(|r| *r > LEAST_CORRELATION);
        if let [Some(a), Some(b)] = crossed
            && !follows
            && a.abs().min(b.abs()) > LEAST_CORRELATION
        {
            return Err(PersonError::Exchanged { name: name(), correlations: [a, b] });
        }
        // Small correlations are those of parts that no marker follows, or of noise; no honest plate pushes the other way.
        for (axis, correlation) in ["x", "y"].into_iter().zip(own) {
            if let Some(correlation) = correlation.filter(|r| *r < -LEAST_CORRELATION) {
                return Err(PersonError::Flipped { name: name(), axis, correlation });
            }
        }
    }
    Ok(())
}

/// Refuses a mass that nobody of the person's stature has; `share` is the plates' mass over the table's.
pub(super) fn can_weigh(person: &Person, share: f64) -> Result<(), PersonError> {
    let (mass_kg, height_m) = (share * person.subject.person.mass_kg, person.subject.person.height_m);
    let [least, most] = BODY_MASS_INDICES.map(|index| index * height_m * height_m);
    if (least..=most).contains(&mass_kg) {
        return Ok(());
    }
    Err(PersonError::Weight { mass_kg, height_m, least_kg: least, most_kg: most })
}

/// How many times the force that the table's bodies need for all motions the plates measured, in the frames that are used.
pub(super) fn share_of_needed(person: &Person) -> Option<f64> {
    let (mut product, mut square) = (0.0, 0.0);
    for trial in 0..person.trials.len() {
        for (_, [needed, measured]) in forces(person, trial) {
            product += needed.z * measured.z;
            square += needed.z * needed.z;
        }
    }
    (square > 0.0 && product > 0.0).then(|| product / square)
}

/// The force that the table's bodies need and that was measured, N, in the frames of a trial that are used, with their numbers.
pub(super) fn forces(person: &Person, trial: usize) -> Vec<(usize, [Vector3<f64>; 2])> {
    let Some(tracked) = person.trials.get(trial) else { return Vec::new() };
    let none = Vector3::repeat(f64::NAN);
    let centre = |frame: usize| person.table_centre(trial, frame).unwrap_or(none);
    let centres = rigident_fit::parallel::each(tracked.report.frames, centre);
    let needed = alignment::needed(&person.subject, &centres, &tracked.smoother);
    let pair = |frame: &UsedFrame| {
        let [x, y, z, ..] = frame.wrench.map(f64::from);
        let needed = needed.get(frame.number).copied().flatten()?;
        Some((frame.number, [needed, Vector3::new(x, y, z)]))
    };
    tracked.frames.iter().filter_map(pair).collect()
}
