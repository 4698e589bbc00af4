//! Motions predicted by what the others say, beside the table.

use hexapod::STANDARD_GRAVITY_MPS2 as GRAVITY;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::error::StudyError;
use super::study::Study;
use crate::person::Person;
use crate::person::noise::noise_gain;
use rigident_fit::{Channel, PredictedBlock, Prediction, parallel};
use rigident_identify::answer::person::LeftOut;

/// Motions that are left out: one at a time, or this many groups of neighbours.
const GROUPS: usize = 12;

/// Motions predicted.
pub struct LeftOutMotions {
    /// The errors of every channel, of all motions.
    pub channels: Vec<LeftOut>,
    /// The errors of every channel, of the motions of each trial.
    pub by_trial: Vec<Vec<LeftOut>>,
    /// The predictions of the person's own parameters for each motion that they do not come from, then what
    /// the table predicts; of the beginning of each trial.
    pub predictions: Vec<[Vec<PredictedBlock>; 2]>,
}

/// Returns the errors of motions that were left out one at a time, of more than twelve in as many groups; of
/// a single motion those of itself. Predictions are stored of the first `keep_s` of each trial.
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
    let none = vec![Sums::default(); channels.len()];
    let (mut sums, mut by_trial) = (none.clone(), vec![none; person.trials.len()]);
    let mut predictions = Vec::new();
    for (motion, predicted) in study.motions.iter().zip(predicted) {
        let (own, kept) = predicted?;
        for all in std::iter::once(&mut sums).chain(by_trial.get_mut(motion.trial)) {
            all.iter_mut().zip(&own).for_each(|(sums, own)| sums.add(own));
        }
        predictions.push(kept);
    }
    let weight = person.subject.person.mass_kg * GRAVITY;
    let errors = |sums: &Vec<Sums>| -> Vec<LeftOut> {
        let of = |(channel, sums): (&Channel, &Sums)| {
            let error = sums.error(channel);
            let by = if error.unit == "N" { weight } else { weight * person.subject.person.height_m };
            LeftOut { percent_of_weight: 100.0 * error.rms / by, ..error }
        };
        channels.iter().zip(sums).map(of).collect()
    };
    let by_trial = by_trial.iter().map(errors).collect();
    Ok(LeftOutMotions { channels: errors(&sums), by_trial, predictions })
}

/// Returns the base parameters that predict: those of the segments beside the table.
fn predictor(study: &Study, person: &Person, motions: &[usize]) -> Result<Vec<f64>, StudyError> {
    study.base_of_segments(person, &study.together(motions)?, motions)
}

/// Returns the value of a normal distribution that is exceeded as rarely as one of Student's.
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
    /// Of gains times what own parameters and the table leave, and of the product of both.
    gain_own: f64,
    gain_table: f64,
    cross: f64,
    measured: f64,
    measured_square: f64,
}

impl Sums {
    /// Sums of a channel, by the person's own parameters and by the table; blocks that count for `share`
    /// independent ones.
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
                gain_own: (b - a) * off,
                gain_table: (b - a) * table_off,
                cross: off * table_off,
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
        self.gain_own += other.gain_own;
        self.gain_table += other.gain_table;
        self.cross += other.cross;
        self.measured += other.measured;
        self.measured_square += other.measured_square;
    }

    fn error(&self, channel: &Channel) -> LeftOut {
        let n = self.count.max(1.0);
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
            gain_sd: self.gain_sd([0.0; 2]),
            scatter_gain_sd: self.gain_sd([self.own_sum / n, self.table_sum / n]),
        }
    }

    /// Returns the mean gain `(b − m)² − (a − l)²` over its standard deviation, where `a` is left by the
    /// person's own parameters and `b` by the table, with constants `l` and `m` taken out.
    fn gain_sd(&self, [l, m]: [f64; 2]) -> f64 {
        let n = self.count.max(1.0);
        // g = b² − a², x = g + 2 l a − 2 m b + k
        let k = m * m - l * l;
        let linear = l * self.own_sum - m * self.table_sum;
        let mean = (self.gain + 2.0 * linear) / n + k;
        let square = (self.gain_square
            + 4.0 * (l * self.gain_own - m * self.gain_table)
            + 4.0 * (l * l * self.own + m * m * self.table - 2.0 * l * m * self.cross)
            + 2.0 * k * (self.gain + 2.0 * linear))
            / n
            + k * k;
        // About their own mean: one degree of freedom less.
        let freedom = (self.independent - 1.0).max(1.0);
        let deviation = ((square - mean * mean).max(0.0) / freedom).sqrt();
        if deviation > 0.0 { normal(mean / deviation, freedom) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_that_a_table_leaves_is_no_gain_in_scatter() {
        // The person's own parameters leave 1 ± 2, the table 10 ± 1 in turn, both with a drift.
        let off = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let drift = |k: usize| 1e-3 * (k * k) as f64;
        let [own, table] = [1.0, 10.0].map(|mean| move |k: usize, size: f64| mean + size * off(k) + drift(k));
        let block = |off: f64| PredictedBlock {
            time_s: 0.0,
            measured: vec![0.0],
            predicted: vec![-off],
            determined: Vec::new(),
        };
        let of = |value: &dyn Fn(usize) -> f64| Prediction {
            residual_rms: Vec::new(),
            measured_sd: Vec::new(),
            blocks: (0..40).map(|k| block(value(k))).collect(),
        };
        let sums = Sums::of(&[of(&|k| own(k, 2.0)), of(&|k| table(k, 1.0))], 0, 1.0);
        let means = [sums.own_sum / 40.0, sums.table_sum / 40.0];
        let (whole, scatter) = (sums.gain_sd([0.0; 2]), sums.gain_sd(means));
        assert!(whole > 3.0 && scatter < -3.0, "{whole} {scatter}");
        // The same by the differences themselves.
        let gain = |k: usize| (table(k, 1.0) - means[1]).powi(2) - (own(k, 2.0) - means[0]).powi(2);
        let gains: Vec<f64> = (0..40).map(gain).collect();
        let mean = gains.iter().sum::<f64>() / 40.0;
        let deviation = (gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / 40.0 / 39.0).sqrt();
        assert!((sums.gain_sd(means) / normal(mean / deviation, 39.0) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn few_degrees_of_freedom_tell_less() {
        // Of Student's table: 12.706, 2.776 and 1.984 are exceeded by 2.5 % with 1, 4 and 100 degrees of
        // freedom, 1.960 of a normal distribution.
        for (freedom, t) in [(1.0, 12.706), (4.0, 2.776), (100.0, 1.984)] {
            assert!((normal(t, freedom) - 1.960).abs() < 1e-3, "{freedom}: {}", normal(t, freedom));
            assert_eq!(normal(-t, freedom), -normal(t, freedom));
        }
        assert!(normal(1e9, 100.0).is_finite() && normal(0.0, 3.0).abs() < 1e-12);
    }
}
