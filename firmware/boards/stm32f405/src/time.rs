//! Time: TIM2 counts quarters of a microsecond, and latches its count at data-ready edges.

use embedded_hal::delay::DelayNs;

use crate::clock::Clocks;
use crate::registers::{
    TIM2_ARR, TIM2_CCER, TIM2_CCMR, TIM2_CCR, TIM2_CNT, TIM2_CR1, TIM2_EGR, TIM2_PSC, TIM2_SR, wait_for,
};

/// Rate of the count, Hz.
pub const TICKS_HZ: u32 = 4_000_000;
/// Time of a tick, ns.
const TICK_NS: u64 = 1_000_000_000 / TICKS_HZ as u64;
/// A filter of eight samples.
const EIGHT: u32 = 0b0011;
/// Reads, of five cycles of the core each, in which the filter has come to an end: 0.5 µs.
const FILTER_LOOKS: u32 = 16;

/// Starts the count; channel 2 latches it when its pin falls, 1 and 3 when theirs rise.
pub fn start(clocks: &Clocks) {
    TIM2_PSC.write(clocks.timer_hz / TICKS_HZ - 1);
    TIM2_ARR.write(u32::MAX);
    // The divider is taken over.
    TIM2_EGR.write(1);
    // Each channel captures its own input once it has had a level for eight cycles of the timer's clock, 0.1
    // µs.
    TIM2_CCMR[0].write(1 | EIGHT << 4 | 1 << 8 | EIGHT << 12);
    TIM2_CCMR[1].write(1 | EIGHT << 4);
    TIM2_CCER.write(1 | 1 << 4 | 1 << 5 | 1 << 8);
    TIM2_SR.write(0);
    TIM2_CR1.write(1);
}

/// Returns what a channel (1 to 4) has latched last, and whether it had latched another one unread before;
/// `None` if it has latched nothing.
pub fn latched(channel: usize) -> Option<(u32, bool)> {
    // The filter is later than the interrupt may be.
    if !wait_for(TIM2_SR, 1 << channel, 1 << channel, FILTER_LOOKS) {
        return None;
    }
    let over = 1 << (8 + channel);
    let missed = TIM2_SR.read() & over != 0;
    if missed {
        TIM2_SR.write(!over);
    }
    Some((TIM2_CCR.get(channel.wrapping_sub(1)).map_or(0, |register| register.read()), missed))
}

/// Carries the count of 32 bits on. To be asked at least every 17 minutes.
pub struct Time {
    ticks: u64,
}

impl Time {
    /// Returns a time that begins at the present count.
    pub fn new() -> Self {
        Self { ticks: u64::from(TIM2_CNT.read()) }
    }

    /// Returns the time, ns.
    pub fn now_ns(&mut self) -> u64 {
        self.ticks += u64::from(TIM2_CNT.read().wrapping_sub(self.ticks as u32));
        self.ticks * TICK_NS
    }

    /// Returns the time of a latched count of the last 17 minutes, ns.
    pub fn of(&mut self, latched: u32) -> u64 {
        let now_ns = self.now_ns();
        now_ns.saturating_sub(u64::from((self.ticks as u32).wrapping_sub(latched)) * TICK_NS)
    }
}

impl Default for Time {
    fn default() -> Self {
        Self::new()
    }
}

/// Waits by the count; a count that stands still is not waited for.
pub struct Wait;

impl DelayNs for Wait {
    fn delay_ns(&mut self, ns: u32) {
        let ticks = ns / TICK_NS as u32 + 1;
        let from = TIM2_CNT.read();
        // More reads than a tick has cycles. The watchdog must not bite meanwhile.
        for look in 0..ticks.saturating_mul(48) {
            if TIM2_CNT.read().wrapping_sub(from) >= ticks {
                break;
            }
            if look % 65_536 == 0 {
                crate::watchdog::feed();
            }
        }
    }
}
