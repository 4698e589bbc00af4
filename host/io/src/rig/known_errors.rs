//! Names and units of the errors that a calibration of a rig may hold: those of one body that all runs share.

/// Groups of errors along three axes, and their units.
const ALONG_AXES: [(&str, &str); 6] = [
    ("lever_arm", "m"),
    ("imu_rotation", "rad"),
    ("gyro_scale", "1"),
    ("gyro_rotation", "rad"),
    ("accelerometer_scale", "1"),
    ("accelerometer_misalignment", "rad"),
];
/// Channels of the load cell.
const CHANNELS: [&str; 6] = ["fx", "fy", "fz", "mx", "my", "mz"];

/// Returns the unit of an error, in ASCII; `None` if no error has that name.
pub(super) fn unit(name: &str) -> Option<&'static str> {
    if name == "gravity" {
        return Some("1");
    }
    if let Some(channel) = name.strip_prefix("gain_") {
        return CHANNELS.contains(&channel).then_some("1");
    }
    if let Some((to, from)) = name.strip_prefix("crosstalk_").and_then(|pair| pair.split_once('_')) {
        let place = |channel: &str| CHANNELS.iter().position(|own| *own == channel);
        let (to, from) = (place(to)?, place(from)?);
        return match (to < 3, from < 3) {
            _ if to == from => None,
            (true, false) => Some("1/m"),
            (false, true) => Some("m"),
            _ => Some("1"),
        };
    }
    let (group, axis) = name.rsplit_once('_')?;
    let known = ALONG_AXES.iter().find(|(own, _)| *own == group);
    known.filter(|_| ["x", "y", "z"].contains(&axis)).map(|(_, unit)| *unit)
}
