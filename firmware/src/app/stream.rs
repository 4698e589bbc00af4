//! Frames of a robot that is watched, as they come over the link to the host: none is answered, all are
//! counted.

use core::cmp::Ordering;
use core::ops::DerefMut;

use rigident_shared::wire::watch_frame::{WatchFrame, WatchFrameError};
use rigident_shared::wire::{ChangeReport, EventCode, StateName, Telemetry};

use super::{App, Sensor};
use crate::Path;
use crate::watch_path::watch_path;

impl<P: DerefMut<Target = Path>> App<P> {
    /// Takes a frame in, if a robot is watched and it is newer than the last one.
    #[inline(never)]
    pub(super) fn on_streamed(&mut self, sequence: u16, payload: &[u8]) {
        let watching = self.state == StateName::Running && self.path.watch().is_some();
        if !watching {
            let unasked = &mut self.errors.stream.unasked;
            *unasked = unasked.saturating_add(1);
            return;
        }
        self.alive(Sensor::Frames, self.now_ns);
        if !self.is_newer(sequence) {
            return;
        }
        let Some(path) = self.path.watch_mut() else { return };
        let watch = path.watch();
        let change = match WatchFrame::decode(payload, watch.links(), watch.feet()) {
            Ok(frame) => {
                let change = watch_path(path, &frame);
                self.note_number(frame.number);
                change
            }
            Err(error) => {
                path.reject_links();
                self.errors.other_links = match error {
                    WatchFrameError::Robot { links, .. } => links,
                    WatchFrameError::Length => 0,
                };
                None
            }
        };
        if let Some(change) = change {
            self.tell_change(&change);
        }
    }

    /// Counts what a sequence number says of frames before it. Numbers wrap: the half behind is older.
    fn is_newer(&mut self, sequence: u16) -> bool {
        let ahead = self.errors.next_streamed.map_or(0, |next| sequence.wrapping_sub(next).cast_signed());
        let stream = &mut self.errors.stream;
        let (count, more) = match ahead.cmp(&-1) {
            Ordering::Less => (&mut stream.late, 1),
            Ordering::Equal => (&mut stream.repeated, 1),
            Ordering::Greater => (&mut stream.lost, u32::from(ahead.unsigned_abs())),
        };
        *count = count.saturating_add(more);
        if ahead >= 0 {
            self.errors.next_streamed = Some(sequence.wrapping_add(1));
        }
        ahead >= 0
    }

    #[inline(never)]
    fn tell_change(&mut self, change: &ChangeReport) {
        self.link.telemetry(&Telemetry::Change(*change));
    }

    /// Counts times that the board had no room for bytes from the host.
    pub fn on_overruns(&mut self, count: u32) {
        self.errors.overruns = self.errors.overruns.saturating_add(count);
        if count > 0 {
            self.events.note(self.now_ns, EventCode::Overrun, 0);
        }
    }
}
