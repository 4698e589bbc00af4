//! Friction that changes while a recording is made, and friction that grows with the load, where the
//! recording shows them.
//!
//! Gears warm up: viscous friction falls by some per cent in the first minutes (A. Carvalho Bittencourt, E.
//! Wernholt, S. Sander-Tavallaey, T. Brogårdh, "An extended friction model to capture load and temperature
//! effects in robot joints", IROS 2010). Taken as constant it leaves residuals that grow to both ends of a
//! recording, as a change of the arm does. Dry friction grows with what the gear carries (P. Hamon, M.
//! Gautier, P. Garrec, IROS 2010). Both are errors of the law of friction then, eliminated as those of its
//! speed and shape are; a drive has them if its own efforts show them beyond chance.

use rigident_shared::screening::Rejection;

use super::drive::{Drive, Term};
use super::effort_factors::EffortFactors;
use super::{Frame, FrictionPart, Input, SignalError, TreeSource};
use rigident_fit::{
    Basis, Effect, FRICTION, Kind, Nuisance, OtherColumns, Owner, Parameter, RowSource as _, SampleRows,
    Scope,
};

/// χ² of four numbers and of one that one recording in a thousand shows by chance.
const BY_CHANCE: [f64; 2] = [18.47, 10.83];
/// The speed at which dry friction turns over in what is tried, over the root mean square of the rate.
const TURNS_OVER: f64 = 0.03;
/// Standard deviation of a change of friction from the mean to either end of a recording, relative.
const DRIFT: f64 = 0.1;
/// Standard deviation of the growth of dry friction by the load, N m by N m.
const LOAD: f64 = 0.1;
/// Columns of a drive: viscous and dry friction by a line and a curve in time, dry friction by the load.
const COLUMNS: usize = 5;

/// Returns the source with further columns of every drive, after its parameters; `rates` are usual ones.
pub(super) fn beside<'a>(source: &'a TreeSource, rates: &'a [f64]) -> OtherColumns<'a> {
    let input = source.input();
    let count = source.parameters().len();
    let more = COLUMNS * input.drives.len();
    let parameter = |k| Parameter::new(format!("friction {k}"), Owner::Link(String::new()), Kind::Other, "");
    let parameters = source.parameters().iter().cloned().chain((0..more).map(parameter)).collect();
    let first = input.first_effort();
    OtherColumns::new(source, parameters, move |sample, rows| {
        let frame = input.frames.get(sample).ok_or(Rejection::NotFinite(0))?;
        let channels = rows.measured.len();
        let mut own = SampleRows::default();
        own.clear(channels, count);
        source.rows(sample, &mut own)?;
        let all = count + more;
        for (to, own) in
            [(&mut rows.smoothed, &own.smoothed), (&mut rows.differentiated, &own.differentiated)]
        {
            for (to, own) in to.chunks_exact_mut(all.max(1)).zip(own.chunks_exact(count.max(1))) {
                to[..count].copy_from_slice(own);
            }
        }
        for (k, (drive, usual)) in input.drives.iter().zip(rates).enumerate() {
            let values = columns(input, frame, drive, *usual);
            for (freedom, factor) in &drive.rates {
                let at = (first + freedom) * all + count + COLUMNS * k;
                let row = rows.smoothed.iter_mut().skip(at);
                row.zip(values).for_each(|(to, value)| *to = factor * value);
            }
        }
        (rows.measured, rows.missing) = (own.measured, own.missing);
        Ok(())
    })
}

/// Returns the columns of a drive at a frame.
fn columns(input: &Input, frame: &Frame, drive: &Drive, usual: f64) -> [f64; COLUMNS] {
    if drive.stands || usual <= 0.0 {
        return [0.0; COLUMNS];
    }
    let rate = drive.rate(&frame.rates);
    let dry = (rate / (TURNS_OVER * usual)).tanh();
    let [line, curve] = [1, 2].map(|degree| input.drift(frame, degree));
    [line * rate, curve * rate, line * dry, curve * dry, drive.load(&frame.efforts).abs() * dry]
}

/// Adds the errors of drives that their efforts show beside `others`, the columns of each drive that explain
/// them best, `None` of one whose law is stated; further columns follow the first `count`.
pub(super) fn add(input: &mut Input, factors: &EffortFactors, count: usize, others: &[Option<Vec<usize>>]) {
    let drives = input.drives.iter().zip(others).enumerate().filter(|(_, (drive, _))| !drive.stands);
    let mut found = Vec::new();
    for (k, (drive, others)) in drives.filter_map(|(k, (drive, others))| Some((k, (drive, others.as_ref()?))))
    {
        let freedoms = drive.rates.iter().map(|(freedom, _)| *freedom);
        let first = count + COLUMNS * k;
        let drift: Vec<usize> = (first..first + COLUMNS - 1).collect();
        let parts = [(FrictionPart::Viscous, "viscous"), (FrictionPart::Dry, "coulomb")];
        let parts = parts.into_iter().filter(|(part, _)| drive.terms.iter().any(|term| part.has(*term)));
        if factors.gained(freedoms.clone(), others, &drift) > BY_CHANCE[0] {
            for (part, word) in parts {
                for (degree, shape) in [(1, "line"), (2, "curve")] {
                    let name = format!("friction_drift_{word}_{shape}_{}", drive.name);
                    let error = SignalError::FrictionDrift { drive: k, part, degree };
                    found.push((name, "friction drift", DRIFT, Scope::Recording, error));
                }
            }
        }
        let beside: Vec<usize> = others.iter().copied().chain(drift).collect();
        let has_dry = drive.terms.iter().any(|term| FrictionPart::Dry.has(*term));
        let asked = drive.terms.contains(&Term::Load);
        let by_load = factors.gained(freedoms, &beside, &[first + COLUMNS - 1]);
        if has_dry && !asked && by_load > BY_CHANCE[1] {
            let name = format!("friction_load_{}", drive.name);
            found.push((name, "friction load", LOAD, Scope::Rig, SignalError::FrictionLoad(k)));
        }
    }
    for (name, group, sigma, scope, error) in found {
        input.nuisances.push(Nuisance {
            name,
            group: group.to_owned(),
            unit: "1".to_owned(),
            sigma,
            basis: Basis::Class(FRICTION.to_owned()),
            scope,
            effect: Effect::Signal(input.errors.len()),
        });
        input.errors.push(error);
    }
}
