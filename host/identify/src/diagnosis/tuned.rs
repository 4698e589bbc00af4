//! Faults with settings that only the recording tells, as an attitude at its start: found with the body by
//! the method of Gauss and Newton on the quick residuals, then undone as any other fault.

use super::{Case, Fault, left_by, rows_of, thinned};
use rigident_fit::RowSource;
use rigident_fit::explained::{BLOCKS, steps};

/// Steps of Gauss and Newton at most.
const STEPS: usize = 4;
/// The settings are found if a step lowers the mean logarithm of what is left by less than this.
const FOUND: f64 = 1e-3;

/// A fault with settings.
pub(super) struct Tuned<S> {
    pub(super) kind: &'static str,
    pub(super) what: &'static str,
    pub(super) remedy: &'static str,
    /// Returns from where the settings count; `None` if a case cannot have the fault.
    pub(super) start: fn(&Case) -> Option<S>,
    /// A small step of each setting.
    pub(super) units: &'static [f64],
    /// Undoes the fault with the settings; false if it cannot.
    pub(super) undo: fn(&mut Case, &S, &[f64]) -> bool,
    /// Returns true of settings that the fault may have.
    pub(super) is_possible: fn(&[f64]) -> bool,
}

impl<S: 'static> Tuned<S> {
    /// Returns the case without the fault, the settings being these.
    fn undone(&self, case: &Case, start: &S, settings: &[f64]) -> Option<Case> {
        let mut case = case.clone();
        (self.undo)(&mut case, start, settings).then_some(case)
    }

    /// Returns from where settings count, and those with which least squares leave least.
    pub(super) fn tune(&self, case: &Case) -> Option<(S, Vec<f64>)> {
        let start = (self.start)(case)?;
        let rows = |settings: &[f64]| rows_of(&self.undone(case, &start, settings)?);
        let mut settings = vec![0.0; self.units.len()];
        let mut now = rows(&settings)?;
        let mut left = left_by(&*now, BLOCKS)?.0;
        for _ in 0..STEPS {
            let one = |k: usize| {
                let mut moved = settings.clone();
                moved[k] += self.units[k];
                rows(&moved)
            };
            let moved: Vec<_> = (0..settings.len()).map(one).collect::<Option<_>>()?;
            let sources: Vec<&dyn RowSource> = moved.iter().map(|rows| &**rows).collect();
            let by = steps(&*now, &sources).ok()??;
            let next: Vec<f64> = settings
                .iter()
                .zip(by.iter().zip(self.units))
                .map(|(at, (by, unit))| at + by * unit)
                .collect();
            let Some(posed) = rows(&next).filter(|_| next.iter().all(|v| v.is_finite())) else { break };
            let Some((less, _)) = left_by(&*posed, BLOCKS).filter(|(less, _)| *less < left) else { break };
            let is_found = left - less < FOUND;
            (settings, now, left) = (next, posed, less);
            if is_found {
                break;
            }
        }
        (self.is_possible)(&settings).then_some((start, settings))
    }

    /// Returns it as a fault whose settings are found for each case that it is undone of.
    pub(super) fn fault(self) -> Fault {
        let Self { kind, what, remedy, .. } = self;
        Fault::new(kind, what, remedy, move |case| {
            let Some((start, settings)) = self.tune(&thinned(case)) else { return false };
            (self.undo)(case, &start, &settings)
        })
    }
}
