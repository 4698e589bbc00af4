//! The load that a controller is given by an answer about a payload.

use super::payload::{ControllerLoad, LoadBasis, PayloadResult};
use super::result::{Answer, Status};

impl ControllerLoad {
    /// Returns the load of an answer about one body.
    ///
    /// # Errors
    /// Says why no controller should be given one.
    fn of(answer: &Answer) -> Result<Self, String> {
        if answer.status == Status::Failed || answer.is_contradicted() {
            return Err("the numbers are not to be used: the warnings say why".to_owned());
        }
        let mass_kg = answer.mass_kg.ok_or("the mass is not identified")?;
        let com_m = answer.com_m.ok_or("the centre of mass is not identified")?;
        let Some(tensor) = answer.inertia_com_kgm2 else {
            return Ok(Self { mass_kg, com_m, inertia_com_kgm2: None, basis: LoadBasis::PointMass });
        };
        if answer.physically_consistent == Some(true) {
            return Ok(Self { mass_kg, com_m, inertia_com_kgm2: Some(tensor), basis: LoadBasis::Identified });
        }
        let nearest = answer.consistency.as_ref().and_then(|found| found.nearest_body.as_ref());
        let body = nearest.ok_or("no body has these parameters")?;
        Ok(Self {
            mass_kg: body.mass_kg,
            com_m: body.com_m,
            inertia_com_kgm2: Some(body.inertia_com_kgm2),
            basis: LoadBasis::NearestBody,
        })
    }
}

impl PayloadResult {
    /// Returns the same with the load of the answer about it, or why there is none.
    #[must_use]
    pub(super) fn with_load(self, answer: &Answer) -> Self {
        match ControllerLoad::of(answer) {
            Ok(load) => Self { load: Some(load), refused: None, ..self },
            Err(why) => Self { load: None, refused: Some(why), ..self },
        }
    }
}

/// Returns what would identify more of a payload.
pub(super) fn advice(answer: &Answer) -> Vec<String> {
    let open: Vec<&str> =
        answer.parameters.iter().filter(|p| !p.state.is_identified()).map(|p| p.name.as_str()).collect();
    if open.is_empty() {
        return Vec::new();
    }
    let how = if answer.mass_kg.is_none() || answer.com_m.is_none() {
        "tilt the flange about two axes as far as it goes, in both runs"
    } else {
        "turn the last joints fast and about several axes, in both runs; what is light and small beside the \
         arm stays a point mass"
    };
    vec![format!("of the payload {} stay open: {how}", open.join(", "))]
}
