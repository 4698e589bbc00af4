//! A source of frames of a tree in motion on the sensor bus: motion capture and force plates, say.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use hexapod::FrameMotion;
use rand_distr::{Distribution, StandardNormal};
use rigident_shared::wire::bus::{Event, PollAnswer};
use rigident_shared::wire::tree_frame::{LINK_NUMBERS, MAX_TREE_FRAME, TrackedFrame, TreeFrame};

use super::sensor_bus::SensorBus;
use crate::links::{Tree, quaternion};
use crate::sensors::stream;
use crate::suspension::Motion;

/// Frames that the board fetches one after the other, as fast as it asks, once they are let go.
pub struct FrameBus {
    frames: Vec<Vec<u8>>,
    period_ns: u64,
    next: usize,
    gate: FrameGate,
}

/// Lets the frames go and sees their end, while the bus is the microcontroller's.
#[derive(Clone, Default)]
pub struct FrameGate {
    open: Arc<AtomicBool>,
    done: Arc<AtomicBool>,
}

impl FrameGate {
    /// Lets frames come, or stop coming.
    pub fn set_open(&self, open: bool) {
        self.open.store(open, Ordering::Release);
    }

    /// Returns whether the last one has been fetched.
    pub fn is_done(&self) -> bool {
        self.done.load(Ordering::Acquire)
    }
}

impl FrameBus {
    /// Makes a bus of these frames, at this rate.
    pub fn new(frames: Vec<Vec<u8>>, rate_hz: f64) -> (Self, FrameGate) {
        let gate = FrameGate::default();
        (Self { frames, period_ns: (1e9 / rate_hz).round() as u64, next: 0, gate: gate.clone() }, gate)
    }
}

impl SensorBus for FrameBus {
    fn poll(&mut self) -> PollAnswer {
        let time_ns = self.next as u64 * self.period_ns;
        if !self.gate.open.load(Ordering::Acquire) || self.next >= self.frames.len() {
            self.gate.done.store(self.next >= self.frames.len(), Ordering::Release);
            return PollAnswer { event: Event::Idle, time_ns };
        }
        self.next += 1;
        PollAnswer { event: Event::FrameReady, time_ns: time_ns + self.period_ns }
    }

    fn transfer_load_cell(&mut self, bytes: &mut [u8]) {
        bytes.fill(0);
    }

    fn transfer_imu(&mut self, bytes: &mut [u8]) {
        bytes.fill(0);
    }

    fn transfer_frame(&mut self, bytes: &mut [u8]) {
        bytes.fill(0);
        if let Some(frame) = self.next.checked_sub(1).and_then(|last| self.frames.get(last)) {
            bytes.iter_mut().zip(frame).for_each(|(slot, byte)| *slot = *byte);
        }
    }
}

/// Returns `count` frames of a tree in motion whose base cameras track, at `rate_hz`, the wrench with white
/// noise of these σ (N, N m) in the laboratory's axes from the seed; the rest is exact but for single
/// precision.
///
/// # Panics
/// If the tree has more links than a frame can hold.
pub fn tracked_frames_of(
    tree: &Tree,
    count: usize,
    rate_hz: f64,
    noise_n_nm: [f64; 6],
    seed: u64,
) -> Vec<Vec<u8>> {
    let mut random = stream(seed, 6);
    (0..count)
        .map(|k| {
            let now = tree.at(k as f64 / rate_hz);
            let base = now.motions.first().expect("a tree has a base");
            let [fx, fy, fz, mx, my, mz] = now.wrench;
            let force = base.rotation * nalgebra::Vector3::new(fx, fy, fz);
            let moment = base.rotation * nalgebra::Vector3::new(mx, my, mz);
            let mut numbers: Vec<f64> = force.iter().chain(&moment).copied().collect();
            for (w, sigma) in numbers.iter_mut().zip(noise_n_nm) {
                let n: f64 = StandardNormal.sample(&mut random);
                *w += sigma * n;
            }
            encoded(k, numbers, base, &now.motions)
        })
        .collect()
}

/// Returns a frame of six numbers, what moves as its base, and the links after the first.
fn encoded(number: usize, mut numbers: Vec<f64>, base: &FrameMotion, links: &[FrameMotion]) -> Vec<u8> {
    numbers.extend(base.velocity.iter());
    let own = pose(base);
    let base = std::array::from_fn(|i| if i < 9 { numbers[i] as f32 } else { own[i - 9] });
    let links: Vec<[f32; 7]> = links.iter().skip(1).map(pose).collect();
    let mut bytes = [0; MAX_TREE_FRAME];
    let n = TrackedFrame::encode(number as u32, &base, &links, &mut bytes).expect("at most sixteen links");
    bytes[..n].to_vec()
}

/// Returns a link's attitude and rate.
fn pose(link: &FrameMotion) -> [f32; 7] {
    let rate = link.rotation.transpose() * link.angular_rate;
    let all: Vec<f64> = quaternion(&link.rotation).into_iter().chain(rate.iter().copied()).collect();
    std::array::from_fn(|i| all[i] as f32)
}

/// Returns the frames of a motion on springs with O in the platform's origin, the displacement with white
/// noise of these σ (m, rad) from the seed; the rest is exact but for single precision.
///
/// # Panics
/// If there are more links than a frame can hold.
pub fn suspended_frames_of(motion: &Motion, noise: [f64; 6], seed: u64) -> Vec<Vec<u8>> {
    let mut random = stream(seed, 7);
    let of = |(number, now): (usize, &crate::suspension::Instant)| {
        let platform = &now.platform;
        let turned = nalgebra::Rotation3::from_matrix_unchecked(platform.rotation);
        let turn = nalgebra::UnitQuaternion::from_rotation_matrix(&turned).scaled_axis();
        let mut numbers: Vec<f64> = platform.position.iter().chain(&turn).copied().collect();
        for (value, sigma) in numbers.iter_mut().zip(noise) {
            let n: f64 = StandardNormal.sample(&mut random);
            *value += sigma * n;
        }
        encoded(number, numbers, platform, &now.links)
    };
    motion.instants.iter().enumerate().map(of).collect()
}

/// Returns `count` frames of a tree in motion at `rate_hz`, the wrench with white noise of these σ (N, N m)
/// from the seed; the rest is exact but for single precision.
///
/// # Panics
/// If the tree has more links than a frame can hold.
pub fn frames_of(tree: &Tree, count: usize, rate_hz: f64, noise_n_nm: [f64; 6], seed: u64) -> Vec<Vec<u8>> {
    let mut random = stream(seed, 5);
    (0..count)
        .map(|k| {
            let now = tree.at(k as f64 / rate_hz);
            let (base, links) = now.motions.split_first().expect("a tree has a base");
            let to_base = base.rotation.transpose();
            let mut numbers = Vec::with_capacity(15);
            for (w, sigma) in now.wrench.iter().zip(noise_n_nm) {
                let n: f64 = StandardNormal.sample(&mut random);
                numbers.push((w + sigma * n) as f32);
            }
            numbers.extend(now.specific_force.map(|v| v as f32));
            for v in [base.angular_rate, base.angular_acceleration] {
                numbers.extend((to_base * v).iter().map(|v| *v as f32));
            }
            let links: Vec<[f32; LINK_NUMBERS]> = links
                .iter()
                .map(|link| {
                    let own = link.rotation.transpose();
                    let (rate, change) = (own * link.angular_rate, own * link.angular_acceleration);
                    let attitude = quaternion(&(to_base * link.rotation));
                    let all: Vec<f32> =
                        attitude.iter().chain(&rate).chain(&change).map(|v| *v as f32).collect();
                    std::array::from_fn(|i| all[i])
                })
                .collect();
            let base = std::array::from_fn(|i| numbers[i]);
            let mut bytes = [0; MAX_TREE_FRAME];
            let n = TreeFrame::encode(k as u32, &base, &links, &mut bytes).expect("at most sixteen links");
            bytes[..n].to_vec()
        })
        .collect()
}
