//! Markers whose names say nothing: a file tells which segment each is on.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::Deserialize;

use super::markers::Attached;
use rigident_model::Model;

/// The uncertainty of a marker's place on its link, 1 σ, m, if nothing is said.
const SIGMA_M: f64 = 0.006;
/// The uncertainty of a place that is not given, and one that is, 1 σ, m.
const PLACE_M: [f64; 2] = [0.15, 0.012];

/// Segments that are raised with the arms.
const ARMS: [&str; 5] = ["upper_arm", "forearm", "ulna", "radius", "hand"];

/// The file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MarkerFile {
    /// Markers by their names in the recording.
    #[serde(default)]
    pub marker: BTreeMap<String, OwnMarker>,
}

/// A marker.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OwnMarker {
    /// The link of the model that it is on; empty: it is not used.
    pub segment: String,
    /// The place of it on the link, link axes (x forward, y left, z up when standing) from its proximal
    /// joint, m; absent: anywhere.
    pub position_m: Option<[f64; 3]>,
    /// The uncertainty of its place on its link, 1 σ, m; absent: 0.006.
    pub sigma_m: Option<f64>,
}

impl MarkerFile {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// In words: it is no TOML, or has other keys.
    pub fn parse(text: &str) -> Result<Self, String> {
        let file: Self = toml::from_str(text).map_err(|error| error.to_string())?;
        let wrong = file.marker.iter().find(|(_, m)| {
            let numbers = m.position_m.into_iter().flatten().chain(m.sigma_m);
            numbers.into_iter().any(|v| !v.is_finite() || v.abs() > 3.0)
                || m.sigma_m.is_some_and(|s| s <= 0.0)
        });
        match wrong {
            Some((name, _)) => {
                Err(format!("marker {name}: places are in metres, and sigma_m is greater than zero"))
            }
            None => Ok(file),
        }
    }

    /// Puts its markers in the place of those of the same names, `labels` being all of the recording.
    ///
    /// # Errors
    /// In words: the model has no such link.
    pub(super) fn apply(
        &self,
        markers: &mut Vec<Attached>,
        labels: &[String],
        model: &Model,
    ) -> Result<(), String> {
        for (name, own) in &self.marker {
            markers.retain(|m| m.name != *name);
            let Some(label) = labels.iter().position(|l| l == name).filter(|_| !own.segment.is_empty())
            else {
                continue;
            };
            let link = model.link(&own.segment).ok_or_else(|| {
                let links: Vec<&str> = model.links.iter().map(|l| l.name.as_str()).collect();
                format!("marker {name}: there is no segment {}; there are {}", own.segment, links.join(", "))
            })?;
            let [anywhere, known] = PLACE_M;
            markers.push(Attached {
                name: name.clone(),
                label,
                link,
                position_m: own.position_m.map_or_else(Vector3::zeros, Vector3::from),
                position_sigma_m: if own.position_m.is_some() { known } else { anywhere },
                sigma_m: own.sigma_m.unwrap_or(SIGMA_M),
                tells_stature: !ARMS.iter().any(|part| own.segment.ends_with(part)),
            });
        }
        Ok(())
    }
}
