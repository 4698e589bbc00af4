//! The ROS 2 messages of a recording, to bytes and back.

use super::cdr::{CdrError, CdrReader, CdrWriter};

/// Says "not measured" at the head of a covariance.
const NOT_MEASURED: f64 = -1.0;

/// Writes a time stamp in ns as a header holds it: whole seconds in 32 bits.
fn header(writer: &mut CdrWriter, time_ns: u64, frame: &str) {
    // Seconds beyond 2038 do not fit; readers of ours use the log time, which has 64 bits.
    let seconds = i32::try_from(time_ns / 1_000_000_000).unwrap_or(i32::MAX);
    writer.i32(seconds).u32((time_ns % 1_000_000_000) as u32).string(frame);
}

/// Reads a header's stamp, ns; `None` if it is zero or before 1970.
fn stamp(reader: &mut CdrReader<'_>) -> Result<Option<u64>, CdrError> {
    let (seconds, nanoseconds) = (reader.i32()?, reader.u32()?);
    reader.string()?;
    let stamp = u64::try_from(seconds).ok().map(|seconds| seconds * 1_000_000_000 + u64::from(nanoseconds));
    Ok(stamp.filter(|ns| *ns > 0))
}

/// A message with the stamp of its header, ns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stamped<V> {
    /// The header's stamp, if it is set.
    pub stamp_ns: Option<u64>,
    /// The value.
    pub value: V,
}

/// The values that an IMU measured, in its own axes; a half that it does not measure is `None`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ImuValues {
    /// Specific force, m/s².
    pub accel: Option<[f64; 3]>,
    /// Angular rate, rad/s.
    pub gyro: Option<[f64; 3]>,
}

fn diagonal(sigma: Option<f64>, measured: bool) -> [f64; 9] {
    let mut covariance = [0.0; 9];
    if measured {
        let variance = sigma.map_or(0.0, |s| s * s);
        for i in [0, 4, 8] {
            covariance[i] = variance;
        }
    } else {
        covariance[0] = NOT_MEASURED;
    }
    covariance
}

/// Writes a `sensor_msgs/msg/Imu`; σ in m/s² and rad/s where known.
pub fn write_imu(
    time_ns: u64,
    frame: &str,
    values: &ImuValues,
    accel_sigma: Option<f64>,
    gyro_sigma: Option<f64>,
) -> Vec<u8> {
    let mut writer = CdrWriter::default();
    header(&mut writer, time_ns, frame);
    writer.f64s(&[0.0, 0.0, 0.0, 1.0]).f64s(&diagonal(None, false));
    for (half, sigma) in [(values.gyro, gyro_sigma), (values.accel, accel_sigma)] {
        writer.f64s(&half.unwrap_or_default()).f64s(&diagonal(sigma, half.is_some()));
    }
    writer.finish()
}

/// Reads `sensor_msgs/msg/Imu`.
///
/// # Errors
/// Not that message.
pub fn read_imu(bytes: &[u8]) -> Result<Stamped<ImuValues>, CdrError> {
    let mut reader = CdrReader::new(bytes)?;
    let stamp_ns = stamp(&mut reader)?;
    reader.f64s::<13>()?;
    let mut half = || {
        let value = reader.f64s::<3>()?;
        let covariance = reader.f64s::<9>()?;
        Ok((covariance[0] != NOT_MEASURED).then_some(value))
    };
    let (gyro, accel) = (half()?, half()?);
    Ok(Stamped { stamp_ns, value: ImuValues { accel, gyro } })
}

/// Writes a stamped message of K numbers: `WrenchStamped` (6), `Vector3Stamped` (3).
pub fn write_numbers<const K: usize>(time_ns: u64, frame: &str, values: &[f64; K]) -> Vec<u8> {
    let mut writer = CdrWriter::default();
    header(&mut writer, time_ns, frame);
    writer.f64s(values);
    writer.finish()
}

/// Reads a stamped message of K numbers.
///
/// # Errors
/// Not that message.
pub fn read_numbers<const K: usize>(bytes: &[u8]) -> Result<Stamped<[f64; K]>, CdrError> {
    let mut reader = CdrReader::new(bytes)?;
    Ok(Stamped { stamp_ns: stamp(&mut reader)?, value: reader.f64s()? })
}

/// Writes a `PoseStamped` from `x, y, z, qw, qx, qy, qz`.
pub fn write_pose(time_ns: u64, frame: &str, pose: &[f64; 7]) -> Vec<u8> {
    let [x, y, z, qw, qx, qy, qz] = *pose;
    write_numbers(time_ns, frame, &[x, y, z, qx, qy, qz, qw])
}

/// Reads `PoseStamped` as `x, y, z, qw, qx, qy, qz`.
///
/// # Errors
/// Not that message.
pub fn read_pose(bytes: &[u8]) -> Result<Stamped<[f64; 7]>, CdrError> {
    let Stamped { stamp_ns, value: [x, y, z, qx, qy, qz, qw] } = read_numbers(bytes)?;
    Ok(Stamped { stamp_ns, value: [x, y, z, qw, qx, qy, qz] })
}

/// Writes a `QuaternionStamped` from w, x, y, z.
pub fn write_quaternion(time_ns: u64, frame: &str, q: &[f64; 4]) -> Vec<u8> {
    let [w, x, y, z] = *q;
    write_numbers(time_ns, frame, &[x, y, z, w])
}

/// Reads `QuaternionStamped` as w, x, y, z.
///
/// # Errors
/// Not that message.
pub fn read_quaternion(bytes: &[u8]) -> Result<Stamped<[f64; 4]>, CdrError> {
    let Stamped { stamp_ns, value: [x, y, z, w] } = read_numbers(bytes)?;
    Ok(Stamped { stamp_ns, value: [w, x, y, z] })
}

/// The values that joints measured, in one order; a list that is not measured is empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct JointState {
    /// Names of the joints.
    pub names: Vec<String>,
    /// Angles or ways.
    pub position: Vec<f64>,
    /// Their rates.
    pub velocity: Vec<f64>,
    /// Torques or forces.
    pub effort: Vec<f64>,
}

/// Reads `sensor_msgs/msg/JointState`.
///
/// # Errors
/// Not that message, or a list that has neither as many numbers as there are names, nor none.
pub fn read_joint_state(bytes: &[u8]) -> Result<Stamped<JointState>, CdrError> {
    let mut reader = CdrReader::new(bytes)?;
    let stamp_ns = stamp(&mut reader)?;
    let mut names = Vec::new();
    for _ in 0..reader.u32()? {
        names.push(reader.string()?.to_owned());
    }
    let mut list = || {
        let count = reader.u32()? as usize;
        if count != 0 && count != names.len() {
            return Err(CdrError::Count { names: names.len(), values: count });
        }
        (0..count).map(|_| reader.f64()).collect::<Result<Vec<f64>, _>>()
    };
    let (position, velocity, effort) = (list()?, list()?, list()?);
    Ok(Stamped { stamp_ns, value: JointState { names, position, velocity, effort } })
}

/// Reads `geometry_msgs/msg/AccelStamped`: linear and angular acceleration.
///
/// # Errors
/// Not that message.
pub fn read_accel(bytes: &[u8]) -> Result<Stamped<[f64; 6]>, CdrError> {
    read_numbers(bytes)
}

/// A transform of `tf2_msgs/msg/TFMessage`: the pose of the child frame in its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transform<'a> {
    /// The header's stamp, ns, if it is set.
    pub stamp_ns: Option<u64>,
    /// The child frame.
    pub child: &'a str,
    /// `x, y, z, qw, qx, qy, qz`.
    pub pose: [f64; 7],
}

/// Reads `tf2_msgs/msg/TFMessage`.
///
/// # Errors
/// Not that message.
pub fn read_transforms(bytes: &[u8]) -> Result<Vec<Transform<'_>>, CdrError> {
    let mut reader = CdrReader::new(bytes)?;
    let mut transforms = Vec::new();
    for _ in 0..reader.u32()? {
        let stamp_ns = stamp(&mut reader)?;
        let child = reader.string()?;
        let [x, y, z, qx, qy, qz, qw] = reader.f64s()?;
        transforms.push(Transform { stamp_ns, child, pose: [x, y, z, qw, qx, qy, qz] });
    }
    Ok(transforms)
}

/// Writes a `Float64MultiArray` of one dimension.
pub fn write_array(label: &str, values: &[f64; 6]) -> Vec<u8> {
    let mut writer = CdrWriter::default();
    writer.u32(1).string(label).u32(6).u32(6).u32(0).u32(6).f64s(values);
    writer.finish()
}

/// Reads a `Float64MultiArray` of six numbers.
///
/// # Errors
/// Not that message, or another number of numbers.
pub fn read_array(bytes: &[u8]) -> Result<[f64; 6], CdrError> {
    let mut reader = CdrReader::new(bytes)?;
    for _ in 0..reader.u32()? {
        reader.string()?;
        reader.u32()?;
        reader.u32()?;
    }
    reader.u32()?;
    match reader.u32()? {
        6 => reader.f64s(),
        _ => Err(CdrError::CutOff(bytes.len())),
    }
}

/// Writes a `std_msgs/msg/String`.
pub fn write_text(text: &str) -> Vec<u8> {
    let mut writer = CdrWriter::default();
    writer.string(text);
    writer.finish()
}

/// Reads `std_msgs/msg/String`.
///
/// # Errors
/// Not that message.
pub fn read_text(bytes: &[u8]) -> Result<&str, CdrError> {
    CdrReader::new(bytes)?.string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_message_comes_back_bit_for_bit() {
        let w = [1.0, -0.0, f64::MIN_POSITIVE, 1.0 / 3.0, -1e300, 5e-324];
        let back = read_numbers::<6>(&write_numbers(1_500_000_001, "S", &w)).unwrap();
        assert_eq!(back.stamp_ns, Some(1_500_000_001));
        assert_eq!(back.value.map(f64::to_bits), w.map(f64::to_bits));
        for values in [
            ImuValues { accel: Some([1.0, 2.0, 3.0]), gyro: Some([4.0, 5.0, 6.0]) },
            ImuValues { accel: Some([1.0, 2.0, 3.0]), gyro: None },
            ImuValues { accel: None, gyro: Some([4.0, 5.0, 6.0]) },
        ] {
            let back = read_imu(&write_imu(5, "a longer frame", &values, Some(0.02), None)).unwrap();
            assert_eq!((back.stamp_ns, back.value), (Some(5), values));
        }
        let pose = [1.0, 2.0, 3.0, 0.5, -0.5, 0.5, 0.25];
        assert_eq!(read_pose(&write_pose(0, "A", &pose)), Ok(Stamped { stamp_ns: None, value: pose }));
        let q = [0.5, -0.5, 0.5, 0.25];
        assert_eq!(read_quaternion(&write_quaternion(1, "S", &q)).unwrap().value, q);
        assert_eq!(read_array(&write_array("gauge_v", &w)).unwrap().map(f64::to_bits), w.map(f64::to_bits));
        assert_eq!(read_text(&write_text("{\"a\":\"β\"}")), Ok("{\"a\":\"β\"}"));
    }

    #[test]
    fn cut_messages_are_errors() {
        let imu = write_imu(5, "U0", &ImuValues::default(), None, None);
        for n in 0..imu.len() {
            assert!(read_imu(&imu[..n]).is_err());
        }
        // A length beyond the message's end.
        assert!(read_text(&[0, 1, 0, 0, 255, 255, 255, 255, 65]).is_err());
        assert!(read_array(&[0, 1, 0, 0, 255, 255, 255, 255]).is_err());
    }
}
