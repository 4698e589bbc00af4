//! Two links on the device: its settings from a rig file with two `[[link]]` and two `[[imu]]` tables, and its answer.

use rigident_shared::factor::InformationFactor;
use rigident_shared::inertia::PARAMETER_NAMES;
use rigident_shared::tree::Joint;
use rigident_shared::wire::{AttitudeSource, ModelSettings, Settings, TwoLinkSettings};

use super::settings::{DeviceTiming, SettingsError, imu_settings, settings};
use crate::formats::rig::RigFile;
use crate::link::{Client, LinkError};
use crate::models::ModelError;
use crate::models::base::{Rows, Situation, base_parameters};
use crate::models::rig_links::from_tables;

/// Why a rig file's links do not fit onto the device.
#[derive(Debug, thiserror::Error)]
pub enum TwoLinkError {
    /// Its links make no tree.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Its sensors are not described.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Not two links with a spherical joint between them.
    #[error(
        "the device identifies two links with a spherical joint between them; the rig file has {0}. `rigident identify` \
         takes every tree"
    )]
    Links(String),
    /// A link without an IMU.
    #[error("link {0} has no [[imu]] table (link = {1}): each of the two links needs one")]
    NoImu(String, usize),
}

/// The device's settings for two links; `attitude` as the device wants it, `R_SL` of the second link at the start.
///
/// # Errors
/// [`TwoLinkError`] says what does not fit.
pub fn two_link_settings(
    rig: &RigFile,
    timing: &DeviceTiming,
    noise: Option<[f64; 6]>,
    attitude: AttitudeSource,
) -> Result<Settings, TwoLinkError> {
    let links = from_tables(&rig.link, "the rig file")?.links;
    let [base, second] = links.as_slice() else {
        return Err(TwoLinkError::Links(format!("{} links", links.len())));
    };
    if second.link.joint != Joint::Spherical {
        return Err(TwoLinkError::Links(format!("another joint above link {}", second.name)));
    }
    if rig.imu_on(0).is_none() {
        return Err(TwoLinkError::NoImu(base.name.clone(), 0));
    }
    let imu = rig.imu_on(1).ok_or_else(|| TwoLinkError::NoImu(second.name.clone(), 1))?;
    let joint_position_m = second.link.position.map(|v| v as f32).into();
    let model = TwoLinkSettings { imu: imu_settings(imu, timing)?, joint_position_m, attitude };
    Ok(Settings { model: ModelSettings::TwoLinks(model), ..settings(rig, timing, noise, None)? })
}

/// What the device found of two links.
#[derive(Clone, Debug, PartialEq)]
pub struct TwoLinkAnswer {
    /// Names of the base parameters, by the links', and of the offset.
    pub names: Vec<String>,
    /// SI.
    pub estimate: Vec<f64>,
    /// For the σ of the settings.
    pub standard_deviation: Vec<f64>,
    /// Whether the rows determine it.
    pub determined: Vec<bool>,
}

/// Fetches the device's factor of two links and solves it.
///
/// # Errors
/// The link, or a factor of another model; a rig file whose links make no tree is told as nonsense, too.
pub fn two_link_answer(client: &mut Client, rig: &RigFile) -> Result<TwoLinkAnswer, LinkError> {
    const NAME: &str = "read the factor of two links";
    let (parameters, entries, rows) = client.factor_numbers()?;
    let mut names = names(rig).map_err(|_| LinkError::Nonsense(NAME))?;
    names.truncate(parameters);
    fn solved<const N: usize>(entries: Vec<f64>, rows: u32, names: Vec<String>) -> Option<TwoLinkAnswer> {
        let solution = InformationFactor::<f64, N>::from_entries(entries, rows)?.solve();
        (names.len() == N).then(|| TwoLinkAnswer {
            names,
            estimate: solution.estimate.to_vec(),
            standard_deviation: solution.standard_deviation.to_vec(),
            determined: solution.determined.to_vec(),
        })
    }
    match parameters {
        19 => solved::<19>(entries, rows, names),
        25 => solved::<25>(entries, rows, names),
        _ => None,
    }
    .ok_or(LinkError::Nonsense(NAME))
}

/// Base parameters in the device's order, then the offset.
fn names(rig: &RigFile) -> Result<Vec<String>, ModelError> {
    let situation = Situation { floating: true, rows: Rows::Base, mimic: false };
    let mut parameters = base_parameters(&from_tables(&rig.link, "the rig file")?, &situation)?.parameters;
    parameters.sort_by_key(|p| p.terms.first().map(|(column, _)| *column));
    let offset = PARAMETER_NAMES.iter().skip(10).map(|name| (*name).to_owned());
    Ok(parameters.into_iter().map(|p| p.name).chain(offset).collect())
}

#[cfg(test)]
mod tests {
    use rigident_shared::wire::Source;

    use super::*;

    const TIMING: DeviceTiming =
        DeviceTiming { rate_hz: 1000.0, is_static: false, source: Source::Injected, host_timeout_ms: 0 };

    fn text(joint: &str, second_imu: &str) -> String {
        format!(
            "[[link]]\nname = \"base\"\n[[link]]\nname = \"arm\"\nparent = \"base\"\njoint = \"{joint}\"\n\
             position_m = [0.03, 0.0, 0.065]\n[[imu]]\nlink = 0\n{second_imu}\n[load_cell]\n\
             noise_n_nm = [1, 1, 1, 0.1, 0.1, 0.1]\n"
        )
    }

    #[test]
    fn a_rig_file_of_two_links_becomes_the_device_s_settings() {
        let rig =
            RigFile::parse(&text("spherical", "[[imu]]\nlink = 1\nposition_m = [0.0, 0.1, 0.0]")).unwrap();
        let settings = two_link_settings(&rig, &TIMING, None, AttitudeSource::Streamed).unwrap();
        let ModelSettings::TwoLinks(model) = settings.model else { panic!("two links") };
        assert_eq!(model.joint_position_m, [0.03, 0.0, 0.065]);
        assert_eq!((model.imu.position_m, settings.imu.position_m), ([0.0, 0.1, 0.0], [0.0; 3]));
        let names = names(&rig).unwrap();
        assert_eq!(names.len(), 25);
        assert_eq!((names[0].as_str(), names[10].as_str()), ("base.M", "arm.MSx"));
        assert_eq!(names[24], "offset_mz");
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let refused = |text: &str| {
            let rig = RigFile::parse(text).unwrap();
            two_link_settings(&rig, &TIMING, None, AttitudeSource::Streamed).unwrap_err().to_string()
        };
        let second = "[[imu]]\nlink = 1";
        assert!(refused(&text("fixed", second)).contains("another joint above link arm"));
        assert!(refused(&text("spherical", "")).contains("link arm has no [[imu]] table (link = 1)"));
        let third = text("spherical", second)
            + "[[link]]\nname = \"hand\"\nparent = \"arm\"\njoint = \"spherical\"\n";
        assert!(refused(&third).contains("3 links"));
    }
}
