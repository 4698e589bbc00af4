//! Two links on the device: its settings from a rig file with two `[[link]]` and two `[[imu]]` tables, its
//! readings as a recording and back, and its factor.

use rigident_shared::calibration::GaugeCalibration;
use rigident_shared::tree::Joint;
use rigident_shared::wire::{
    AttitudeSource, LinkReadingMessage, ModelSettings, ReadingMessage, Settings, Source, TwoLinkSettings,
};

use super::settings::{DeviceTiming, SettingsError, imu_settings, settings};
use crate::link::{Client, LinkError, TakenFactor};
use rigident_io::recording::{ImuColumns, Recording};
use rigident_io::rig::RigFile;
use rigident_model::ModelError;
use rigident_rows::named_model::rig_links::from_tables;

/// Time constant of the accelerometers' correction of the attitude that the device finds, s.
pub const ATTITUDE_TIME_CONSTANT_S: f32 = 5.0;

/// The reason why a rig file's links do not fit onto the device.
#[derive(Debug, thiserror::Error)]
pub enum TwoLinkError {
    /// The links make no tree.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The rig's sensors are not described.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The links are not two with a spherical joint between them.
    #[error(
        "the device identifies two links with a spherical joint between them; the rig file has {0}. \
         `identify()` takes every tree"
    )]
    Links(String),
    /// A link without an IMU.
    #[error("link {0} has no [[imu]] table (link = {1}): each of the two links needs one")]
    NoImu(String, usize),
    /// The attitude has no beginning: from sensors it is found from both IMUs, which need one.
    #[error(
        "[[link]] {0} has no initial_wxyz: from sensors the device finds the joint's attitude from both \
         IMUs, and must know how the link hangs at the start (R_SL, w, x, y, z)"
    )]
    NoInitial(String),
    /// A recording without what the device reads.
    #[error("{name} lacks what the device reads of two links: {what}. `identify()` needs less")]
    Columns {
        /// The recording.
        name: String,
        /// The quantity.
        what: String,
    },
}

/// Returns the device's settings for two links; `attitude` as the device wants it, `R_SL` of the second link
/// at the start.
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
    if timing.source == Source::Sensors && attitude == AttitudeSource::Streamed {
        return Err(TwoLinkError::NoInitial(second.name.clone()));
    }
    let joint_position_m = second.link.position.map(|v| v as f32).into();
    let model = TwoLinkSettings { imu: imu_settings(imu, timing)?, joint_position_m, attitude };
    Ok(Settings { model: ModelSettings::TwoLinks(model), ..settings(rig, timing, noise, None)? })
}

/// Returns where the device is to take the joint's attitude from: from both IMUs if the rig file says how the
/// second link hangs at the start, else as it is streamed.
pub fn attitude_source(rig: &RigFile) -> AttitudeSource {
    match rig.link.get(1).and_then(|link| link.initial_wxyz) {
        Some(initial) => AttitudeSource::FromImus {
            initial_wxyz: initial.map(|v| v as f32),
            time_constant_s: ATTITUDE_TIME_CONSTANT_S,
        },
        None => AttitudeSource::Streamed,
    }
}

/// Returns a device's readings as a recording.
pub fn recording(name: &str, rig: &RigFile, rate_hz: f64, readings: &[LinkReadingMessage]) -> Recording {
    let imu = |of: fn(&LinkReadingMessage) -> [[f32; 3]; 2]| ImuColumns {
        accel: Some(readings.iter().map(|r| of(r)[0].map(f64::from)).collect()),
        gyro: Some(readings.iter().map(|r| of(r)[1].map(f64::from)).collect()),
    };
    Recording {
        name: name.to_owned(),
        rig: rig.clone(),
        rate_hz: Some(rate_hz),
        time_ns: readings.iter().map(|r| r.base.time_ns).collect(),
        wrench: Some(readings.iter().map(|r| r.base.wrench.map(f64::from)).collect()),
        imus: vec![
            imu(|r| [r.base.specific_force, r.base.angular_rate]),
            imu(|r| [r.specific_force, r.angular_rate]),
        ],
        attitudes: vec![(1, readings.iter().map(|r| r.attitude_wxyz.map(f64::from)).collect())],
        ..Recording::default()
    }
}

/// Returns a recording's readings as the device takes them, rounded to single precision; attitudes are not
/// examined if it finds them itself.
///
/// # Errors
/// [`TwoLinkError::Columns`] names what is missing.
pub fn readings(recording: &Recording) -> Result<Vec<LinkReadingMessage>, TwoLinkError> {
    let finds = recording.rig.link.get(1).is_some_and(|link| link.initial_wxyz.is_some());
    let gauges =
        recording.gauges.as_ref().zip(recording.rig.load_cell.calibration).map(|(gauges, matrix)| {
            let calibration = GaugeCalibration { matrix };
            gauges.iter().map(|g| calibration.wrench(g).array()).collect()
        });
    let wrench: Vec<[f64; 6]> = recording.wrench.clone().or(gauges).unwrap_or_default();
    let imu = |j: usize| recording.imus.get(j).cloned().unwrap_or_default();
    let (base, second) = (imu(0), imu(1));
    let attitudes = recording.attitudes.iter().find(|(link, _)| *link == 1).map(|(_, rows)| rows);
    let missing: Vec<&str> = [
        (wrench.is_empty(), "the wrench (fx_n …)"),
        (base.accel.is_none(), "the base IMU's specific force (imu_ax_mps2 …)"),
        (base.gyro.is_none(), "its rate (imu_gx_radps …)"),
        (second.accel.is_none(), "the second IMU's specific force (imu1_ax_mps2 …)"),
        (second.gyro.is_none(), "its rate (imu1_gx_radps …)"),
        (
            attitudes.is_none() && !finds,
            "the second link's attitude (q1_w …), or initial_wxyz of its [[link]], for the device to find it",
        ),
    ]
    .into_iter()
    .filter_map(|(missing, what)| missing.then_some(what))
    .collect();
    if recording.is_static || !missing.is_empty() {
        let name = recording.name.clone();
        let what = if recording.is_static {
            "time: its rows are still poses".to_owned()
        } else {
            missing.join(", ")
        };
        return Err(TwoLinkError::Columns { name, what });
    }
    fn row<const K: usize>(rows: Option<&Vec<[f64; K]>>, k: usize) -> [f32; K] {
        rows.and_then(|rows| rows.get(k)).map_or([0.0; K], |v| v.map(|v| v as f32))
    }
    let reading = |k: usize| LinkReadingMessage {
        base: ReadingMessage {
            time_ns: recording.time_ns.get(k).copied().unwrap_or(0),
            wrench: row(Some(&wrench), k),
            specific_force: row(base.accel.as_ref(), k),
            angular_rate: row(base.gyro.as_ref(), k),
        },
        specific_force: row(second.accel.as_ref(), k),
        angular_rate: row(second.gyro.as_ref(), k),
        attitude_wxyz: row(attitudes, k),
    };
    Ok((0..recording.rows()).map(reading).collect())
}

/// Fetches the device's factor of two links: base parameters in the order of the standard columns that
/// represent them, then the offset.
///
/// # Errors
/// The link, or what is no factor of two links.
pub(super) fn factor(client: &mut Client) -> Result<TakenFactor, LinkError> {
    let taken = client.any_factor()?;
    let fits = matches!(taken.factor.parameters(), 19 | 25);
    if fits { Ok(taken) } else { Err(LinkError::Nonsense("read the factor of two links")) }
}

#[cfg(test)]
mod tests {
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
    }

    #[test]
    fn a_recording_of_readings_is_these_readings_and_missing_columns_are_named() {
        let rig = RigFile::parse(&text("spherical", "[[imu]]\nlink = 1")).unwrap();
        assert_eq!(attitude_source(&rig), AttitudeSource::Streamed);
        let number = |k: usize, n: usize| ((37 * k + n) as f32).sin();
        let sent: Vec<LinkReadingMessage> = (0..5)
            .map(|k| LinkReadingMessage {
                base: ReadingMessage {
                    time_ns: 1_000_000 * k as u64,
                    wrench: std::array::from_fn(|n| number(k, n)),
                    specific_force: std::array::from_fn(|n| number(k, 6 + n)),
                    angular_rate: std::array::from_fn(|n| number(k, 9 + n)),
                },
                specific_force: std::array::from_fn(|n| number(k, 12 + n)),
                angular_rate: std::array::from_fn(|n| number(k, 15 + n)),
                attitude_wxyz: std::array::from_fn(|n| number(k, 18 + n)),
            })
            .collect();
        let mut recording = recording("two", &rig, 1000.0, &sent);
        let text = recording.to_csv();
        let again = Recording::from_csv_bytes("two.csv", text.as_bytes(), &rig).unwrap();
        assert_eq!(readings(&again).unwrap(), sent);
        recording.attitudes.clear();
        recording.imus[1].accel = None;
        let said = readings(&recording).unwrap_err().to_string();
        assert!(said.contains("imu1_ax_mps2") && said.contains("q1_w") && !said.contains("fx_n"), "{said}");
    }

    #[test]
    fn unsuitable_rig_files_are_refused_by_name() {
        let refused = |text: &str| {
            let rig = RigFile::parse(text).unwrap();
            two_link_settings(&rig, &TIMING, None, AttitudeSource::Streamed).unwrap_err().to_string()
        };
        let second = "[[imu]]\nlink = 1";
        assert!(refused(&text("fixed", second)).contains("another joint above link arm"));
        assert!(refused(&text("spherical", "")).contains("link arm has no [[imu]] table (link = 1)"));
        let rig = RigFile::parse(&text("spherical", second)).unwrap();
        let sensors = DeviceTiming { source: Source::Sensors, ..TIMING };
        let live = two_link_settings(&rig, &sensors, None, attitude_source(&rig)).unwrap_err();
        assert!(live.to_string().contains("arm has no initial_wxyz"), "{live}");
        let third = text("spherical", second)
            + "[[link]]\nname = \"hand\"\nparent = \"arm\"\njoint = \"spherical\"\n";
        assert!(refused(&third).contains("3 links"));
    }
}
