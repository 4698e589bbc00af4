//! Motions predicted by what the others say, beside the table.

use hexapod::STANDARD_GRAVITY_MPS2 as GRAVITY;

use super::study::{Study, StudyError};
use crate::answer::person::LeftOut;
use crate::fit::{Fit, Prediction};
use crate::problem::person::Person;
use crate::problem::person::noise::noise_gain;

/// Motions predicted.
pub struct LeftOutMotions {
    /// The errors of every channel.
    pub channels: Vec<LeftOut>,
    /// What the person's own parameters predict of each motion that they do not come from, then what the table predicts.
    pub predictions: Vec<[Prediction; 2]>,
}

/// Returns the errors of motions that were left out one at a time; of a single motion those of itself.
///
/// # Errors
/// [`StudyError`] as the fits have it.
pub fn left_out(study: &Study, person: &Person) -> Result<LeftOutMotions, StudyError> {
    let all: Vec<usize> = (0..study.motions.len()).collect();
    let channels = &study.motions[0].fit.channels;
    let mut sums = vec![Sums::default(); channels.len()];
    let mut predictions = Vec::new();
    for k in &all {
        let others: Vec<usize> = all.iter().copied().filter(|o| o != k || all.len() == 1).collect();
        let values = predictor(study, person, &study.together(&others)?)?;
        let source = &study.motions[*k].source;
        let own = Prediction::of(source, &values, &[])?;
        let table = Prediction::of(source, study.table.mean().as_slice(), &[])?;
        let report = &person.trials[study.motions[*k].trial].report;
        let every = f64::from(study.motions[*k].fit.filter.every);
        let share = every * noise_gain(report.rate_hz, report.cut_off_hz);
        for (c, sums) in sums.iter_mut().enumerate() {
            sums.add(&own, &table, c, share);
        }
        predictions.push([own, table]);
    }
    let weight = person.subject.person.mass_kg * GRAVITY;
    let found = channels.iter().zip(&sums).map(|(channel, sums)| {
        let error = sums.error(&channel.channel);
        let by = if error.unit == "N" { weight } else { weight * person.subject.person.height_m };
        LeftOut { percent_of_weight: 100.0 * error.rms / by, ..error }
    });
    Ok(LeftOutMotions { channels: found.collect(), predictions })
}

/// The base parameters that predict: of the segments nearest to the table.
fn predictor(study: &Study, person: &Person, fit: &Fit) -> Result<Vec<f64>, StudyError> {
    Ok(study.segments(person, fit)?.base)
}

#[derive(Clone, Default)]
struct Sums {
    count: f64,
    independent: f64,
    own: f64,
    table: f64,
    gain: f64,
    gain_square: f64,
    measured: f64,
    measured_square: f64,
}

impl Sums {
    fn add(&mut self, own: &Prediction, table: &Prediction, c: usize, share: f64) {
        for (own, table) in own.blocks.iter().zip(&table.blocks) {
            let y = own.measured[c];
            let (a, b) = ((y - own.predicted[c]).powi(2), (y - table.predicted[c]).powi(2));
            self.count += 1.0;
            self.independent += share;
            self.own += a;
            self.table += b;
            self.gain += b - a;
            self.gain_square += (b - a).powi(2);
            self.measured += y;
            self.measured_square += y * y;
        }
    }

    fn error(&self, channel: &crate::fit::Channel) -> LeftOut {
        let n = self.count.max(1.0);
        let mean = self.gain / n;
        let variance = (self.gain_square / n - mean * mean).max(0.0);
        let deviation = (variance / self.independent.max(1.0)).sqrt();
        let average = self.measured / n;
        LeftOut {
            name: channel.name.clone(),
            unit: channel.unit.clone(),
            rms: (self.own / n).sqrt(),
            table_rms: (self.table / n).sqrt(),
            percent_of_weight: 0.0,
            measured_sd: (self.measured_square / n - average * average).max(0.0).sqrt(),
            gain_sd: if deviation > 0.0 { mean / deviation } else { 0.0 },
        }
    }
}
