//! The rate of the line to the host, which a host may raise while a robot is watched.
//!
//! Nobody is locked out: the rate goes back by itself, whatever happens to the host.

use core::ops::DerefMut;

use rigident_shared::wire::{ErrorCode, LINE_RATE_MS, Reply, SettingName, StateName};

use super::App;
use crate::Path;

/// The slowest rate that a host may ask for, baud.
const LEAST: u32 = 115_200;

/// Holds the rate of the line.
#[derive(Clone, Copy, Default)]
pub(super) struct Line {
    /// The board can do this much, baud; zero: it has one rate.
    most: u32,
    /// The rate asked for, if it is not the one that the board started with.
    asked: Option<u32>,
    /// Something whole has come from the host at this time, ns.
    heard_ns: u64,
}

impl<P: DerefMut<Target = Path>> App<P> {
    /// Notes that the board can change the rate of its line, up to this one, baud.
    pub fn line_goes_up_to(&mut self, baud: u32) {
        self.line.most = baud;
    }

    /// Returns the rate that the line is to have as soon as everything has been sent, baud; `None`: the one
    /// that the board started with.
    pub fn line_rate(&self) -> Option<u32> {
        self.line.asked
    }

    #[inline(never)]
    pub(super) fn set_line_rate(&mut self, baud: u32) -> Result<Reply, ErrorCode> {
        if self.state != StateName::Configured || self.path.watch().is_none() {
            return Err(ErrorCode::WrongState(self.state));
        }
        if !(LEAST..=self.line.most).contains(&baud) {
            return Err(ErrorCode::BadSetting(SettingName::LineRate));
        }
        (self.line.asked, self.line.heard_ns) = (Some(baud), self.now_ns);
        Ok(Reply::Done)
    }

    pub(super) fn line_heard(&mut self) {
        self.line.heard_ns = self.now_ns;
    }

    /// Goes back where there is nobody to talk to, or nothing to watch.
    pub(super) fn look_at_line(&mut self) {
        let watches = matches!(self.state, StateName::Configured | StateName::Running);
        let quiet_ns = self.now_ns.saturating_sub(self.line.heard_ns);
        if !watches || quiet_ns > u64::from(LINE_RATE_MS) * 1_000_000 {
            self.line.asked = None;
        }
    }
}
