//! The speed at which dry friction turns over, as the recording shows it.
//!
//! Friction of gears does not jump with the sign of the rate: contacts yield before they slide, and
//! `f tanh(v/v_c)` is what is seen, with v_c of some hundredths of a rad/s (C. Canudas de Wit, H. Olsson, K.
//! J. Åström, P. Lischinsky, A new model for control of systems with friction, IEEE Trans. Automatic Control
//! 40 (3), 1995). A jump in its place leaves residuals at every reversal, which resemble a change of whatever
//! else is large there. Every drive's own efforts decide: the columns of several speeds are beside all others
//! in one factor, and each speed leaves its own sum of squares.

use rigident_shared::tree::TreeError;

use super::drive::{Drive, Term};
use super::effort_factors::EffortFactors;
use super::{Input, SignalError, TreeSource, friction_terms};
use rigident_fit::{Basis, Effect, FRICTION, Nuisance, RowSource as _, Scope};
use rigident_model::base::BaseParameters;

/// Speeds that are tried, over the root mean square of the drive's rate, each twice the one before.
const SLOWEST: f64 = 1.0 / 256.0;
const SPEEDS: i32 = 8;
/// Samples that decide at most, in this many stretches of the recording.
const MOST: usize = 20_000;
const STRETCHES: usize = 8;
/// Standard deviation of the logarithm of a speed that was found here, before the fit.
const SHARE: f64 = 0.7;
/// Standard deviation of the way from a hyperbolic tangent to an algebraic law, which no theory decides.
const SHAPE: f64 = 2.0;

/// Returns the input with the speed of every drive of which none is given; 0, a jump, where that explains
/// most or the recording is too short. What else its friction depends on is among the errors then, where the
/// efforts show it.
///
/// # Errors
/// [`TreeError`] if frames and model do not fit.
pub(super) fn found(mut input: Input, base: &BaseParameters) -> Result<Input, TreeError> {
    if input.is_static
        || !input.has_efforts()
        || input.contact.is_some()
        || !input.drives.iter().any(is_sought)
    {
        return Ok(input);
    }
    let mut tried = input.with_frames(stretches(&input));
    let rates: Vec<f64> = tried.drives.iter().map(|drive| usual_rate(&tried, drive)).collect();
    for (drive, rate) in tried.drives.iter_mut().zip(&rates).filter(|(drive, _)| is_sought(drive)) {
        drive.terms.retain(|term| *term != Term::Coulomb(None));
        drive.terms.extend(speeds(*rate).map(|speed| Term::Coulomb(Some(speed))));
    }
    (tried.nuisances, tried.errors, tried.signals) = (Vec::new(), Vec::new(), Vec::new());
    let source = TreeSource::with_base(tried, base.clone())?;
    let factors = EffortFactors::of(&friction_terms::beside(&source, &rates), source.input().first_effort());
    let search = Search { source: &source, factors: factors.as_ref() };
    let mut others = Vec::new();
    for (k, (drive, rate)) in input.drives.iter_mut().zip(&rates).enumerate() {
        let Some(term) = drive.terms.iter_mut().find(|term| **term == Term::Coulomb(None)) else {
            others.push(None);
            continue;
        };
        let (speed, columns) = search.best(k, *rate);
        others.push(Some(columns));
        *term = Term::Coulomb(Some(speed));
        if speed > 0.0 {
            let unknown = [
                ("speed", SHARE, SignalError::FrictionSpeed(k)),
                ("shape", SHAPE, SignalError::FrictionShape(k)),
            ];
            for (word, sigma, error) in unknown {
                input.nuisances.push(nuisance(&drive.name, word, sigma, input.errors.len()));
                input.errors.push(error);
            }
        }
    }
    if let Some(factors) = &factors {
        friction_terms::add(&mut input, factors, source.parameters().len(), &others);
    }
    Ok(input)
}

/// Returns an error of the law of a drive's dry friction.
fn nuisance(drive: &str, word: &str, sigma: f64, number: usize) -> Nuisance {
    Nuisance {
        name: format!("friction_{word}_{drive}"),
        group: format!("friction {word}"),
        unit: "1".to_owned(),
        sigma,
        basis: Basis::Class(FRICTION.to_owned()),
        scope: Scope::Rig,
        effect: Effect::Signal(number),
    }
}

fn is_sought(drive: &Drive) -> bool {
    drive.terms.contains(&Term::Coulomb(None))
}

/// Returns a jump, and the speeds that are tried of a drive of some usual rate.
fn speeds(rate: f64) -> impl Iterator<Item = f64> {
    (0..=SPEEDS).map(move |k| if k == 0 { 0.0 } else { rate * SLOWEST * f64::powi(2.0, k - 1) })
}

/// Returns the root mean square of a drive's rate.
fn usual_rate(input: &Input, drive: &Drive) -> f64 {
    let squares: f64 = input.frames.iter().map(|frame| drive.rate(&frame.rates).powi(2)).sum();
    (squares / input.frames.len().max(1) as f64).sqrt()
}

/// Returns the frames of stretches that are spread over a recording.
fn stretches(input: &Input) -> Vec<super::Frame> {
    let count = input.frames.len();
    if count <= MOST {
        return input.frames.clone();
    }
    let (length, every) = (MOST / STRETCHES, count / STRETCHES);
    let own = (0..STRETCHES).filter_map(|k| input.frames.get(k * every..k * every + length));
    own.flatten().cloned().collect()
}

/// The search for the speeds of drives.
struct Search<'a> {
    /// The rows with all speeds.
    source: &'a TreeSource,
    /// `None` where there are too few to decide.
    factors: Option<&'a EffortFactors>,
}

impl Search<'_> {
    /// Returns the speed of the drive k that explains most, 0 where a jump does, or of one that does not
    /// move; and the columns that its efforts are explained by then.
    fn best(&self, k: usize, rate: f64) -> (f64, Vec<usize>) {
        let drives = &self.source.input().drives;
        let mut columns = self.others(k);
        let Some(drive) = drives.get(k) else { return (0.0, columns) };
        let is_speed = |j: &usize| matches!(drive.terms.get(*j), Some(Term::Coulomb(Some(_))));
        let places: Vec<usize> = (0..drive.terms.len()).filter(is_speed).collect();
        let at =
            self.source.parameters().len() - drives[k..].iter().map(|own| own.terms.len()).sum::<usize>();
        let can_tell = !drive.stands && rate > 0.0 && places.len() > 1;
        let enough = |factors: &&EffortFactors| can_tell && factors.can_tell(columns.len() + places.len());
        let Some(factors) = self.factors.filter(enough) else {
            columns.extend(places.first().map(|place| at + place));
            return (0.0, columns);
        };
        let likelihood = |place: &usize| {
            let kept: Vec<usize> = columns.iter().copied().chain([at + place]).collect();
            -factors.left(drive.rates.iter().map(|(freedom, _)| *freedom), &kept)
        };
        let likelihood: Vec<f64> = places.iter().map(likelihood).collect();
        let larger = |best: usize, own: usize| if likelihood[own] > likelihood[best] { own } else { best };
        let best = (0..likelihood.len()).fold(0, larger);
        columns.push(at + places[best]);
        if best == 0 {
            return (0.0, columns);
        }
        (rate * SLOWEST * f64::powf(2.0, best as f64 - 1.0 + vertex(&likelihood, best)), columns)
    }

    /// Returns the columns beside those of drive k's speeds.
    fn others(&self, k: usize) -> Vec<usize> {
        let drives = &self.source.input().drives;
        let all = self.source.parameters().len();
        let first = all - drives.iter().map(|own| own.terms.len()).sum::<usize>();
        let terms =
            drives.iter().enumerate().flat_map(|(i, own)| own.terms.iter().map(move |term| (i, *term)));
        let is_speed = |term: &Term| matches!(term, Term::Coulomb(Some(_)));
        // Of another drive the speed that is given, or the jump; it has a part in this one's efforts if they
        // are coupled.
        let own = |i: usize, term: &Term| drives[i].terms.iter().find(|own| is_speed(own)) == Some(term);
        let kept = terms.enumerate().filter(|(_, (i, term))| !is_speed(term) || (*i != k && own(*i, term)));
        (0..first).chain(kept.map(|(j, _)| first + j)).collect()
    }
}

/// Returns where the parabola through a value and its neighbours is largest, from −1/2 to 1/2; 0 at either
/// end.
fn vertex(values: &[f64], at: usize) -> f64 {
    let near =
        at.checked_sub(1).filter(|before| *before > 0).and_then(|before| values.get(before..before + 3));
    let Some([before, here, after]) = near else { return 0.0 };
    let bend = before - 2.0 * here + after;
    if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}
