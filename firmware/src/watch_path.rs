//! The processing of every frame of a robot that is watched. No I/O, no panic, no heap, no f64.
//!
//! [`watch_path`] is the one entry; the release check searches for its symbol and walks what it can reach.

use rigident_shared::estimator::watch::{
    Change, WATCH_FEET, WATCH_LINKS, Watch, WatchConfig, WatchError, WatchFoot, WatchFrame, WatchLink,
};
use rigident_shared::wire::{ChangeReport, ChangeSize, MAX_WATCH_FEET, MAX_WATCHED_LINKS, watch_frame};

use crate::Path;
use crate::place::{HasVariant, begin};

// What the host may tell is what there is room for.
const _: () = assert!(WATCH_LINKS == MAX_WATCHED_LINKS && WATCH_FEET == MAX_WATCH_FEET);

/// Holds the watch, and whether it takes frames in.
#[derive(Clone)]
pub struct WatchPath {
    watch: Watch<f32>,
    absorbing: bool,
}

// SAFETY: `Path` has `repr(u8)`, and this is its variant with the tag 3.
unsafe impl HasVariant<WatchPath, 3> for Path {
    const UNUSED: WatchPath = WatchPath { watch: Watch::UNUSED, absorbing: false };
}

impl WatchPath {
    /// Makes the path of such a robot in place; its links are still to come.
    #[inline(never)]
    pub(crate) fn set_up(
        path: &mut Path,
        config: &WatchConfig<f32>,
        feet: &[WatchFoot<f32>],
    ) -> Result<(), WatchError> {
        if !matches!(path, Path::Watch(_)) {
            begin::<_, Self, 3>(path);
        }
        let Path::Watch(own) = path else { return Ok(()) };
        own.absorbing = false;
        own.watch.set_up(config, feet)
    }

    pub(crate) fn set_link(&mut self, i: u8, link: &WatchLink<f32>) -> Result<(), WatchError> {
        self.watch.set_link(i, link)
    }

    pub(crate) fn absorb_from_now_on(&mut self, absorbing: bool) {
        self.absorbing = absorbing;
    }

    pub(crate) fn restart(&mut self) {
        self.watch.restart();
    }

    pub(crate) fn reject_links(&mut self) {
        self.watch.reject_links();
    }

    pub(crate) fn watch(&self) -> &Watch<f32> {
        &self.watch
    }
}

/// Takes a frame in. A change if it has just been found or measured.
// SAFETY: the name is this function's own; no other symbol of the program has it.
#[unsafe(export_name = "rigident_watch_path")]
#[inline(never)]
pub fn watch_path(path: &mut WatchPath, frame: &watch_frame::WatchFrame<'_>) -> Option<ChangeReport> {
    if !path.absorbing {
        return None;
    }
    let mut joints = [[0.0; 2]; WATCH_LINKS];
    let mut count = 0;
    for (slot, joint) in joints.iter_mut().zip(frame.joints()) {
        *slot = joint;
        count += 1;
    }
    let [ax, ay, az, wx, wy, wz] = frame.imu;
    let mut feet = [[0.0; 6]; WATCH_FEET];
    for (slot, wrench) in feet.iter_mut().zip(frame.feet()) {
        *slot = wrench;
    }
    let found = path.watch.absorb(&WatchFrame {
        number: frame.number,
        specific_force: [ax, ay, az],
        rate: [wx, wy, wz],
        joints: joints.get(..count).unwrap_or_default(),
        wrenches: feet.get(..path.watch.feet()).unwrap_or_default(),
    });
    // Frames that are left out are counted.
    found.ok().flatten().map(|change| report(&change, path.watch.changes()))
}

fn report(change: &Change<f32>, number: u16) -> ChangeReport {
    ChangeReport {
        change: number,
        found: change.found,
        at: change.at,
        between: change.between,
        ratio: change.ratio,
        size: change.size.map(|(change, standard_deviation)| ChangeSize { change, standard_deviation }),
    }
}
