//! The processing of every frame of a tree in motion. No I/O, no panic, no heap, no f64.
//!
//! [`frame_path`] is the one entry; the release check searches for its symbol and walks what it can reach.

use rigident_shared::estimator::frames::{
    Frame, FrameEstimator, FrameLink, FrameRejection, FrameStop, FramesConfig, FramesError, LINKS,
    LinkMotion, LinkPose, TrackedFrame,
};
use rigident_shared::wire::tree_frame;

use crate::Path;
use crate::drivers::frames::AnyFrame;
use crate::place::{HasVariant, begin};

/// The estimator, and whether it absorbs.
#[derive(Clone)]
pub struct FramePath {
    estimator: FrameEstimator<f32>,
    absorbing: bool,
    /// The last frame has shown that the stop rule is met.
    stop_rule_met: bool,
}

// SAFETY: `Path` has `repr(u8)`, and this is its variant with the tag 2.
unsafe impl HasVariant<FramePath, 2> for Path {
    const UNUSED: FramePath =
        FramePath { estimator: FrameEstimator::UNUSED, absorbing: false, stop_rule_met: false };
}

impl FramePath {
    /// Makes the path of this tree in place.
    #[inline(never)]
    pub(crate) fn set_up(
        path: &mut Path,
        links: &[FrameLink<f32>],
        config: &FramesConfig<f32>,
        stop: Option<&FrameStop<f32>>,
    ) -> Result<(), FramesError> {
        if !matches!(path, Path::Frames(_)) {
            begin::<_, Self, 2>(path);
        }
        let Path::Frames(frames) = path else { return Ok(()) };
        (frames.absorbing, frames.stop_rule_met) = (false, false);
        frames.estimator.set_up(links, config)?;
        frames.estimator.set_stop(stop);
        Ok(())
    }

    pub(crate) fn absorb_from_now_on(&mut self, absorbing: bool) {
        self.absorbing = absorbing;
    }

    pub(crate) fn restart(&mut self) {
        self.estimator.reset();
        self.stop_rule_met = false;
    }

    /// Returns whether the last frame has shown that every asked-for parameter has its asked-for uncertainty.
    pub(crate) fn stop_rule_met(&self) -> bool {
        self.stop_rule_met
    }

    pub(crate) fn estimator(&self) -> &FrameEstimator<f32> {
        &self.estimator
    }

    pub(crate) fn estimator_mut(&mut self) -> &mut FrameEstimator<f32> {
        &mut self.estimator
    }
}

/// Takes a frame into the estimator. `None` while none is absorbed.
// SAFETY: the name is this function's own; no other symbol of the program has it.
#[unsafe(export_name = "rigident_frame_path")]
#[inline(never)]
pub fn frame_path(path: &mut FramePath, frame: &AnyFrame<'_>) -> Option<Result<(), FrameRejection>> {
    if !path.absorbing {
        return None;
    }
    let outcome = match frame {
        AnyFrame::Imu(frame) => with_imu(path, frame),
        AnyFrame::Tracked(frame) => tracked(path, frame),
    };
    path.stop_rule_met = path.estimator.look();
    Some(outcome)
}

fn with_imu(path: &mut FramePath, frame: &tree_frame::TreeFrame<'_>) -> Result<(), FrameRejection> {
    let mut links = [LinkMotion::default(); LINKS];
    let mut count = 0;
    for (slot, [qw, qx, qy, qz, wx, wy, wz, cx, cy, cz]) in links.iter_mut().zip(frame.links()) {
        *slot =
            LinkMotion { attitude: [qw, qx, qy, qz], rate: [wx, wy, wz], angular_acceleration: [cx, cy, cz] };
        count += 1;
    }
    let [fx, fy, fz, mx, my, mz, ax, ay, az, wx, wy, wz, cx, cy, cz] = frame.base;
    path.estimator.absorb(&Frame {
        wrench: [fx, fy, fz, mx, my, mz],
        specific_force: [ax, ay, az],
        rate: [wx, wy, wz],
        angular_acceleration: [cx, cy, cz],
        links: links.get(..count).unwrap_or_default(),
    })
}

fn tracked(path: &mut FramePath, frame: &tree_frame::TrackedFrame<'_>) -> Result<(), FrameRejection> {
    let [fx, fy, fz, mx, my, mz, vx, vy, vz, base @ ..] = frame.base;
    let mut links = [LinkPose::default(); LINKS];
    let mut count = 0;
    let all = core::iter::once(base).chain(frame.links());
    for (slot, [qw, qx, qy, qz, wx, wy, wz]) in links.iter_mut().zip(all) {
        *slot = LinkPose { attitude: [qw, qx, qy, qz], rate: [wx, wy, wz] };
        count += 1;
    }
    path.estimator.absorb_tracked(&TrackedFrame {
        number: frame.number,
        wrench: [fx, fy, fz, mx, my, mz],
        velocity: [vx, vy, vz],
        links: links.get(..count).unwrap_or_default(),
    })
}
