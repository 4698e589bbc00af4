//! The bare fixture taken off, with its uncertainty.
//!
//! Inertial parameters about one origin add: a run with the fixture and the body sees
//! `φ_total = φ_body + T φ_fixture`, a run with the bare fixture sees φ_fixture. Both are rows over
//! `[φ_fixture; φ_body]`, and the trailing triangle of the merged factor is what is known of the body when
//! the fixture is known as well as its runs tell, and no better. T is one for a fixture of the same
//! parameters; of a fixture on a link of a tree it holds the weights of the link's ten parameters in the
//! tree's base parameters.

use nalgebra::DMatrix;

use super::own_errors::OwnErrors;
use super::pool::{self, PooledFactor};
use super::standard::{name, weights};
use super::{Convergence, Estimate, Fit, Identity, Measured, Parameter, RigRows};

/// Why a fixture is not taken off.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TareError {
    /// A run of the fixture is the run that it is to be taken off.
    #[error(
        "a run of the tare {fixture} is the run that it would be taken off of: its readings would count twice"
    )]
    Repeated {
        /// The fixture's name.
        fixture: String,
    },
    /// The fixture's runs tell no mass, first moment or tensor.
    #[error("the tare {fixture} has no inertial parameters: there is nothing to take off")]
    NotInertial {
        /// The fixture's name.
        fixture: String,
    },
    /// The fixture is of another model than the run.
    #[error("the tare {fixture} is of another model than the run: {difference}")]
    Model {
        /// The fixture's name.
        fixture: String,
        /// Its parameters against the run's.
        difference: pool::ModelDifference,
    },
    /// The run has no such link.
    #[error("the tare {fixture} cannot be put on the link {link}: there is none of that name; there are {}", links.join(", "))]
    Link {
        /// The fixture's name.
        fixture: String,
        /// The link that was named.
        link: String,
        /// The links of the run's parameters.
        links: Vec<String>,
    },
    /// The run's rows do not see all of the link that the fixture is on.
    #[error(
        "the tare {fixture} cannot be taken off the link {link}: the run's parameters do not hold {}; a run \
         of the bare fixture on the same tree works parameter by parameter", missing.join(", ")
    )]
    Missing {
        /// The fixture's name.
        fixture: String,
        /// The link that it is on.
        link: String,
        /// Standard parameters that are in none of the run's.
        missing: Vec<String>,
    },
}

/// The runs of a bare fixture.
///
/// ```
/// use rigident_fit::pool::PooledFactor;
/// use rigident_fit::tare::{Tare, TareError};
/// use rigident_fit::Fit;
///
/// /// Takes the merged runs of a bare fixture off a run with the body.
/// fn body_alone(mut total: Fit, bare: Vec<PooledFactor>) -> Result<Fit, Box<dyn std::error::Error>> {
///     let fixture = Tare::new(PooledFactor::merged(bare, false)?)?;
///     fixture.take_off(&mut total)?;
///     Ok(total)
/// }
/// ```
#[derive(Clone, Debug)]
pub struct Tare {
    pooled: PooledFactor,
    fit: Fit,
    link: Option<String>,
    /// The errors of the one run that it is of, if they are known.
    errors: Option<OwnErrors>,
}

impl Tare {
    /// Builds a fixture from the merged runs of it alone. Their offsets are their own, as are frictions: what
    /// adds is mass, first moment and tensor.
    ///
    /// # Errors
    /// [`TareError::NotInertial`] if it has none of these.
    pub fn new(pooled: PooledFactor) -> Result<Self, TareError> {
        let pooled = pooled.only(|parameter| parameter.kind.is_inertial());
        if pooled.parameters.is_empty() {
            return Err(TareError::NotInertial { fixture: pooled.name });
        }
        let fit = pooled.fit();
        Ok(Self { pooled, fit, link: None, errors: None })
    }

    /// Returns the tare of one run, whose errors are known as well as its parameters.
    ///
    /// # Errors
    /// [`TareError::NotInertial`] if it has no inertial parameters.
    pub fn of_run(run: &Fit, pooled: PooledFactor) -> Result<Self, TareError> {
        Ok(Self { errors: Some(OwnErrors::of(run)), ..Self::new(pooled)? })
    }

    /// Returns the rows over the inertial parameters, with the errors that other runs share if they are of
    /// one rig.
    pub(super) fn rows(&self) -> RigRows {
        self.fit.rows()
    }

    /// Returns what errors bring to its one run, as far as that is known.
    pub(super) fn own_errors(&self) -> OwnErrors {
        self.errors.clone().unwrap_or_default()
    }

    /// Returns the same fixture on a link of a tree; it is on the base link otherwise. The fixture's frame is
    /// the link's.
    #[must_use]
    pub fn on_link(self, link: &str) -> Self {
        Self { link: Some(link.to_owned()), ..self }
    }

    /// Returns the fit of the fixture alone.
    pub fn fit(&self) -> &Fit {
        &self.fit
    }

    /// Returns the names of the fixture's recordings.
    pub fn recordings(&self) -> String {
        self.pooled.recordings()
    }

    /// Returns a warning if its runs disagree.
    pub fn warning(&self) -> Option<String> {
        self.fit.noise.disagreement.map(|ratio| pool::disagreement_in_words("the tare's runs", ratio))
    }

    /// Takes the fixture off the estimate of a run, before anything known beforehand is put in. The run's own
    /// factor stays that of fixture and body together; offsets and frictions are those of the run.
    ///
    /// # Errors
    /// [`TareError`] if the run is one of the fixture's, or the fixture's parameters do not map into the
    /// run's; the fit is then as it was.
    pub fn take_off(&self, fit: &mut Fit) -> Result<(), TareError> {
        self.refuse_repeated(fit)?;
        let map = self.map(fit)?;
        let own = DMatrix::identity(fit.parameters.len(), fit.parameters.len());
        // An error that both have is one: what it brings to the fixture it takes off the sum.
        let both = fit.rows();
        let rows = both.beyond(&self.rows(), &map, &own).rows;
        let body = rows.own();
        let before = fit.estimate.covariance.clone();
        let noise = fit.estimate.noise.less_certain(self.fit.estimate.noise);
        let estimate = Estimate::new(&body, fit.rounding.max(self.fit.rounding), 1.0, noise);
        fit.estimate = estimate.beside(std::slice::from_ref(&rows));
        // Errors in common move with both runs, and the fixture's part is not to be taken apart.
        if fit.nuisances.is_empty() {
            fit.added.push(("fixture".to_owned(), &fit.estimate.covariance - before));
        }
        let by_errors = &fit.estimate.covariance * rows.beforehand_in_scores();
        for found in &mut fit.nuisances {
            let own = both.errors().iter().find(|error| error.name == found.nuisance.name);
            let place = own.and_then(|own| rows.errors().iter().position(|error| error.is(own)));
            if let Some(place) = place {
                found.contributions = by_errors.column(place).iter().copied().collect();
            }
        }
        (fit.solved, fit.rig_rows, fit.widened) = (Some(body), Some(rows), Vec::new());
        fit.runs.extend(self.fit.runs.iter().cloned());
        // A body's element has no more information than either run's, so this asks it of both.
        fit.spurious_information += self.fit.spurious_information;
        let taken = taken_off(&self.fit.estimate, &map);
        for point in &mut fit.convergence {
            subtract_from(point, &taken);
        }
        Ok(())
    }

    /// Refuses a run that is one of the fixture's.
    pub(super) fn refuse_repeated(&self, fit: &Fit) -> Result<(), TareError> {
        let is_own =
            |own: &Identity| self.fit.identities.iter().any(|other| other.fingerprint == own.fingerprint);
        if fit.identities.iter().any(is_own) {
            return Err(TareError::Repeated { fixture: self.pooled.name.clone() });
        }
        Ok(())
    }

    /// Returns the weights of the fixture's parameters (columns) in the run's (rows).
    fn map(&self, fit: &Fit) -> Result<DMatrix<f64>, TareError> {
        let fixture = &self.pooled.parameters;
        let single = |all: &[Parameter]| all.iter().filter_map(Parameter::link).all(str::is_empty);
        if single(fixture) && !single(&fit.parameters) {
            return self.map_on_link(fit);
        }
        self.map_by_name(fit)
    }

    /// Returns the weights of the parameters of the same model (columns) in the run's (rows).
    pub(super) fn map_by_name(&self, fit: &Fit) -> Result<DMatrix<f64>, TareError> {
        let fixture = &self.pooled.parameters;
        let inertial: Vec<Parameter> =
            fit.parameters.iter().filter(|p| p.kind.is_inertial()).cloned().collect();
        let difference = pool::difference(fixture, &inertial);
        let geometry = self.pooled.model_fingerprint == fit.model_fingerprint;
        if !geometry || !difference.missing.is_empty() || !difference.changed.is_empty() {
            // The run's against the fixture's is stated the other way about.
            let difference = pool::ModelDifference {
                missing: Vec::new(),
                foreign: difference.missing,
                changed: difference.changed,
            };
            return Err(TareError::Model { fixture: self.pooled.name.clone(), difference });
        }
        let is =
            |j: usize, f: usize| fit.parameters.get(j).map(|p| &p.name) == fixture.get(f).map(|p| &p.name);
        Ok(DMatrix::from_fn(fit.parameters.len(), fixture.len(), |j, f| f64::from(u8::from(is(j, f)))))
    }

    /// Returns the error that the run's rows have no such link.
    pub(super) fn without_link(&self, fit: &Fit, link: &str) -> TareError {
        let links = links_of(fit).into_iter().map(str::to_owned).collect();
        TareError::Link { fixture: self.pooled.name.clone(), link: link.to_owned(), links }
    }

    /// Returns the weights of a single body's parameters, as those of a link, in the run's.
    fn map_on_link(&self, fit: &Fit) -> Result<DMatrix<f64>, TareError> {
        let fixture = || self.pooled.name.clone();
        let links = links_of(fit);
        let Some(link) = self.link.as_deref().or(links.first().copied()).filter(|link| links.contains(link))
        else {
            return Err(self.without_link(fit, self.link.as_deref().unwrap_or_default()));
        };
        let parts: Vec<[f64; 10]> = fit.parameters.iter().map(|p| weights(p, link)).collect();
        let own: Vec<[f64; 10]> = self.pooled.parameters.iter().map(|p| weights(p, "")).collect();
        let map = DMatrix::from_fn(parts.len(), own.len(), |j, f| {
            parts
                .get(j)
                .zip(own.get(f))
                .map_or(0.0, |(part, own)| part.iter().zip(own).map(|(a, b)| a * b).sum())
        });
        let missing: Vec<String> = map
            .column_iter()
            .zip(&own)
            .filter(|(column, _)| column.iter().all(|weight| *weight == 0.0))
            .map(|(_, own)| name(link, own.iter().position(|w| *w != 0.0).unwrap_or(0)))
            .collect();
        if missing.is_empty() {
            Ok(map)
        } else {
            Err(TareError::Missing { fixture: fixture(), link: link.to_owned(), missing })
        }
    }
}

/// Returns the links that the inertial parameters of a fit belong to.
fn links_of(fit: &Fit) -> Vec<&str> {
    let mut links: Vec<&str> = Vec::new();
    for link in fit.parameters.iter().filter(|p| p.kind.is_inertial()).filter_map(Parameter::link) {
        if !links.contains(&link) {
            links.push(link);
        }
    }
    links
}

/// Returns what a fixture adds to each of a run's parameters; `None` where it is not determined.
fn taken_off(fixture: &Estimate, map: &DMatrix<f64>) -> Vec<Option<Measured>> {
    map.row_iter()
        .map(|row| {
            let part: Vec<(usize, f64)> =
                row.iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0).collect();
            let (mut value, mut variance) = (0.0, 0.0);
            for (f, weight) in &part {
                value += weight * fixture.measured(*f)?.value;
                for (g, other) in &part {
                    variance += weight * other * fixture.covariance(*f, *g)?;
                }
            }
            Some(Measured { value, u95: fixture.coverage_factor() * variance.max(0.0).sqrt() })
        })
        .collect()
}

fn subtract_from(point: &mut Convergence, taken: &[Option<Measured>]) {
    for (both, taken) in point.parameters.iter_mut().zip(taken) {
        *both = both.zip(*taken).map(|(both, fixture)| Measured {
            value: both.value - fixture.value,
            u95: both.u95.hypot(fixture.u95),
        });
    }
}

#[cfg(test)]
#[path = "tare_tests.rs"]
mod tests;
