//! A frame of a robot that is watched: what its own sensors read, as it travels on the link
//! ([`super::Kind::Stream`]).
//!
//! | part | bytes | |
//! |---|---|---|
//! | links | 1 | n, the base included |
//! | sensors of forces | 1 | k |
//! | number | 4 | little-endian, one more with every period of the robot's controller: a gap is a time without a frame |
//! | IMU of the base | 24 | 6 f32 LE: specific force (m/s²) and rate (rad/s), its axes |
//! | each sensor of forces | 24 | 6 f32 LE: force (N) and moment (N m), its axes |
//! | each further link | 8 | 2 f32 LE: place and rate of its joint: rad and rad/s, m and m/s; zero of a fixed one |
//!
//! The frame around it has the check. Of 30 links and two feet it is 310 bytes, 321 on the line: at 500 a
//! second 161 kB/s.

use super::watch::{MAX_WATCH_FEET, MAX_WATCHED_LINKS};

/// Bytes before the numbers.
const HEADER: usize = 6;
/// Numbers of the base's IMU, and of a sensor of forces.
const SIX: usize = 6;
/// Bytes of the longest frame.
pub const MAX_WATCH_FRAME: usize = WatchFrame::bytes(MAX_WATCHED_LINKS, MAX_WATCH_FEET);

/// Tells why a payload is no frame of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WatchFrameError {
    /// The payload's length is not that of the robot's links and sensors.
    Length,
    /// The frame has this number of links and sensors of forces, and others were expected.
    Robot {
        /// Links.
        links: u8,
        /// Sensors of forces.
        feet: u8,
    },
}

/// Holds a frame of a robot that is watched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WatchFrame<'a> {
    /// The frame's number.
    pub number: u32,
    /// Specific force (m/s²) and rate (rad/s) of the base's IMU.
    pub imu: [f32; SIX],
    feet: &'a [u8],
    joints: &'a [u8],
}

impl<'a> WatchFrame<'a> {
    /// Returns the bytes of a frame of the given number of links and sensors of forces.
    pub const fn bytes(links: usize, feet: usize) -> usize {
        HEADER + 4 * (SIX + SIX * feet + 2 * links.saturating_sub(1))
    }

    /// Reads a payload as a frame of a robot of the given number of links and sensors of forces.
    ///
    /// # Errors
    /// [`WatchFrameError`] says what it is instead.
    pub fn decode(payload: &'a [u8], links: usize, feet: usize) -> Result<Self, WatchFrameError> {
        const LENGTH: WatchFrameError = WatchFrameError::Length;
        let ([own_links, own_feet, number @ ..], rest) =
            payload.split_first_chunk::<HEADER>().ok_or(LENGTH)?;
        if payload.len() != Self::bytes(usize::from(*own_links), usize::from(*own_feet)) {
            return Err(LENGTH);
        }
        if (usize::from(*own_links), usize::from(*own_feet)) != (links, feet) {
            return Err(WatchFrameError::Robot { links: *own_links, feet: *own_feet });
        }
        let (imu, rest) = rest.split_at_checked(4 * SIX).ok_or(LENGTH)?;
        let (feet, joints) = rest.split_at_checked(4 * SIX * feet).ok_or(LENGTH)?;
        Ok(Self { number: u32::from_le_bytes(*number), imu: numbers(imu), feet, joints })
    }

    /// Returns force (N) and moment (N m) of each sensor.
    pub fn feet(&self) -> impl Iterator<Item = [f32; SIX]> + '_ {
        self.feet.chunks_exact(4 * SIX).map(numbers)
    }

    /// Returns place and rate of each joint, those of the links after the base.
    pub fn joints(&self) -> impl Iterator<Item = [f32; 2]> + '_ {
        self.joints.chunks_exact(8).map(numbers)
    }

    /// Writes a frame into `out` and returns how many bytes of it are used; `None` if there are more links or
    /// sensors than a robot may have, or no room.
    pub fn encode(
        number: u32,
        imu: &[f32; SIX],
        feet: &[[f32; SIX]],
        joints: &[[f32; 2]],
        out: &mut [u8],
    ) -> Option<usize> {
        if joints.len() >= MAX_WATCHED_LINKS || feet.len() > MAX_WATCH_FEET {
            return None;
        }
        let links = joints.len() + 1;
        let length = Self::bytes(links, feet.len());
        let (header, rest) = out.get_mut(..length)?.split_first_chunk_mut::<HEADER>()?;
        let [a, b, c, d] = number.to_le_bytes();
        *header = [u8::try_from(links).ok()?, u8::try_from(feet.len()).ok()?, a, b, c, d];
        let values = imu.iter().chain(feet.as_flattened()).chain(joints.as_flattened());
        for (slot, value) in rest.as_chunks_mut::<4>().0.iter_mut().zip(values) {
            *slot = value.to_le_bytes();
        }
        Some(length)
    }
}

fn numbers<const N: usize>(bytes: &[u8]) -> [f32; N] {
    let mut out = [0.0; N];
    for (number, bytes) in out.iter_mut().zip(bytes.as_chunks::<4>().0) {
        *number = f32::from_le_bytes(*bytes);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_comes_back_and_that_of_another_robot_is_refused() {
        let imu = core::array::from_fn(|k| k as f32 - 2.5);
        let feet: [[f32; 6]; 2] =
            core::array::from_fn(|i| core::array::from_fn(|k| (10 * i + k) as f32 * 0.125));
        let joints: [[f32; 2]; 29] = core::array::from_fn(|i| [i as f32, -0.5 * i as f32]);
        let mut bytes = [0; MAX_WATCH_FRAME];
        let n = WatchFrame::encode(0x0102_0304, &imu, &feet, &joints, &mut bytes).unwrap();
        assert_eq!(n, 310);
        assert_eq!(bytes[..6], [30, 2, 4, 3, 2, 1]);
        let frame = WatchFrame::decode(&bytes[..n], 30, 2).unwrap();
        assert_eq!((frame.number, frame.imu), (0x0102_0304, imu));
        assert!(frame.feet().eq(feet) && frame.joints().eq(joints));
        let other = WatchFrameError::Robot { links: 30, feet: 2 };
        assert_eq!(WatchFrame::decode(&bytes[..n], 29, 2), Err(other));
        assert_eq!(WatchFrame::decode(&bytes[..n], 30, 3), Err(other));
        for wrong in (0..bytes.len()).filter(|wrong| *wrong != n) {
            assert_eq!(WatchFrame::decode(&bytes[..wrong], 30, 2), Err(WatchFrameError::Length), "{wrong}");
        }
    }

    #[test]
    fn the_largest_robot_fits_and_no_larger_one_is_written() {
        let mut bytes = [0; MAX_WATCH_FRAME + 100];
        let joints = [[1.0; 2]; MAX_WATCHED_LINKS];
        let feet = [[1.0; 6]; MAX_WATCH_FEET + 1];
        let mut written = |feet: &[[f32; 6]], joints: &[[f32; 2]]| {
            WatchFrame::encode(1, &[0.0; 6], feet, joints, &mut bytes)
        };
        assert_eq!(written(&feet[1..], &joints[1..]), Some(MAX_WATCH_FRAME));
        assert_eq!((written(&feet, &joints[1..]), written(&feet[1..], &joints)), (None, None));
    }
}
