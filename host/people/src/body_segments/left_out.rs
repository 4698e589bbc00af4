//! Motions predicted by what the others say, beside the table.

use hexapod::STANDARD_GRAVITY_MPS2 as GRAVITY;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::error::StudyError;
use super::study::Study;
use crate::person::Person;
use crate::person::noise::noise_gain;
use rigident_fit::{PredictedBlock, Prediction, parallel};
use rigident_identify::answer::person::LeftOut;

/// Motions that are left out: one at a time, or this many groups of neighbours.
const GROUPS: usize = 12;

/// Motions predicted.
pub struct LeftOutMotions {
    /// The errors of every channel.
    pub channels: Vec<LeftOut>,
    /// The predictions of the person's own parameters for each motion that they do not come from, then what
    /// the table predicts; of the beginning of each trial.
    pub predictions: Vec<[Vec<PredictedBlock>; 2]>,
}

/// Returns the errors of motions that were left out one at a time, of more than twelve in as many groups; of a single motion those of
/// itself. Predictions are stored of the first `keep_s` of each trial.
///
/// # Errors
/// [`StudyError`] as the fits have it.
pub fn left_out(study: &Study, person: &Person, keep_s: f64) -> Result<LeftOutMotions, StudyError> {
    let count = study.motions.len();
    let channels = &study.channels;
    // Of many motions some are left out at a time.
    let each = count.div_ceil(GROUPS).max(1);
    let groups = parallel::map(parallel::threads(), count.div_ceil(each), |group| {
        let others: Vec<usize> = (0..count).filter(|k| k / each != group || count <= each).collect();
        predictor(study, person, &others)
    });
    let groups: Vec<Vec<f64>> = groups.into_iter().collect::<Result<_, _>>()?;
    let predicted = parallel::map(parallel::threads(), count, |k| -> Result<_, StudyError> {
        let values = &groups[k / each];
        let motion = &study.motions[k];
        let found = Prediction::of_each(&motion.source(person)?, [values, study.table.mean().as_slice()])?;
        let report = &person.trials[motion.trial].report;
        let share = f64::from(motion.every) * noise_gain(report.rate_hz, report.cut_off_hz);
        let sums: Vec<Sums> = (0..channels.len()).map(|c| Sums::of(&found, c, share)).collect();
        let is_kept = |block: &PredictedBlock| block.time_s <= keep_s;
        let kept = found.map(|own| own.blocks.into_iter().filter(is_kept).collect());
        Ok((sums, kept))
    });
    let mut sums = vec![Sums::default(); channels.len()];
    let mut predictions = Vec::new();
    for predicted in predicted {
        let (own, kept) = predicted?;
        sums.iter_mut().zip(&own).for_each(|(sums, own)| sums.add(own));
        predictions.push(kept);
    }
    let weight = person.subject.person.mass_kg * GRAVITY;
    let found = channels.iter().zip(&sums).map(|(channel, sums)| {
        let error = sums.error(channel);
        let by = if error.unit == "N" { weight } else { weight * person.subject.person.height_m };
        LeftOut { percent_of_weight: 100.0 * error.rms / by, ..error }
    });
    Ok(LeftOutMotions { channels: found.collect(), predictions })
}

/// The base parameters that predict: of the segments beside the table.
fn predictor(study: &Study, person: &Person, motions: &[usize]) -> Result<Vec<f64>, StudyError> {
    Ok(study.segments(person, &study.together(motions)?, motions)?.0.base)
}

/// The value of a normal distribution that is exceeded as rarely as one of Student's.
fn normal(t: f64, freedom: f64) -> f64 {
    let (Ok(student), Ok(normal)) = (StudentsT::new(0.0, 1.0, freedom), Normal::new(0.0, 1.0)) else {
        return 0.0;
    };
    // The lower tail: the upper one is lost in 1.
    normal.inverse_cdf(student.cdf(-t.abs()).max(f64::MIN_POSITIVE)).abs().copysign(t)
}

#[derive(Clone, Default)]
struct Sums {
    count: f64,
    independent: f64,
    own: f64,
    table: f64,
    own_sum: f64,
    table_sum: f64,
    gain: f64,
    gain_square: f64,
    measured: f64,
    measured_square: f64,
}

impl Sums {
    /// Sums of a channel, by the person's own parameters and by the table; blocks that count for `share` independent ones.
    fn of([own, table]: &[Prediction; 2], c: usize, share: f64) -> Self {
        let mut sums = Self::default();
        for (own, table) in own.blocks.iter().zip(&table.blocks) {
            let y = own.measured[c];
            let (off, table_off) = (y - own.predicted[c], y - table.predicted[c]);
            let (a, b) = (off * off, table_off * table_off);
            sums.add(&Self {
                count: 1.0,
                independent: share,
                own: a,
                table: b,
                own_sum: off,
                table_sum: table_off,
                gain: b - a,
                gain_square: (b - a).powi(2),
                measured: y,
                measured_square: y * y,
            });
        }
        sums
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.independent += other.independent;
        self.own += other.own;
        self.table += other.table;
        self.own_sum += other.own_sum;
        self.table_sum += other.table_sum;
        self.gain += other.gain;
        self.gain_square += other.gain_square;
        self.measured += other.measured;
        self.measured_square += other.measured_square;
    }

    fn error(&self, channel: &rigident_fit::Channel) -> LeftOut {
        let n = self.count.max(1.0);
        let mean = self.gain / n;
        let variance = (self.gain_square / n - mean * mean).max(0.0);
        // About their own mean: one degree of freedom less.
        let freedom = (self.independent - 1.0).max(1.0);
        let deviation = (variance / freedom).sqrt();
        let average = self.measured / n;
        LeftOut {
            name: channel.name.clone(),
            unit: channel.unit.clone(),
            rms: (self.own / n).sqrt(),
            table_rms: (self.table / n).sqrt(),
            mean: self.own_sum / n,
            table_mean: self.table_sum / n,
            percent_of_weight: 0.0,
            measured_sd: (self.measured_square / n - average * average).max(0.0).sqrt(),
            gain_sd: if deviation > 0.0 { normal(mean / deviation, freedom) } else { 0.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_degrees_of_freedom_tell_less() {
        // Of Student's table: 12.706, 2.776 and 1.984 are exceeded by 2.5 % with 1, 4 and 100 degrees of freedom, 1.960 of a normal
        // distribution.
        for (freedom, t) in [(1.0, 12.706), (4.0, 2.776), (100.0, 1.984)] {
            assert!((normal(t, freedom) - 1.960).abs() < 1e-3, "{freedom}: {}", normal(t, freedom));
            assert_eq!(normal(-t, freedom), -normal(t, freedom));
        }
        assert!(normal(1e9, 100.0).is_finite() && normal(0.0, 3.0).abs() < 1e-12);
    }
}
