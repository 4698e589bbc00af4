//! The clock tree: crystal, or the chip's own oscillator where none starts; then the PLL.
//!
//! If RCC_CR reads zero, there is no clock tree: the image runs in an emulator. On silicon it never does, for
//! some oscillator runs.

use rigident_shared::wire::ClockSource;

use crate::registers::{
    FLASH_ACR, PWR_CR, RCC_AHB1ENR, RCC_APB1ENR, RCC_APB2ENR, RCC_CFGR, RCC_CIR, RCC_CR, RCC_PLLCFGR,
    RCC_RSTR, wait_for,
};

/// The crystal, MHz: of Olimex' and WeAct's F405, of a Nucleo-F446RE (its debugger's 8 MHz), of WeAct's F411.
pub const CRYSTAL_MHZ: u32 = if cfg!(feature = "f411") { 25 } else { 8 };
/// The core, MHz.
const CORE_MHZ: u32 = if cfg!(feature = "f411") { 96 } else { 168 };
const INTERNAL_MHZ: u32 = 16;
/// The core by the chip's own oscillator, MHz, which may be 4 % fast: so that the buses' limits hold all the
/// same.
const CORE_MHZ_WITHOUT_CRYSTAL: u32 = if cfg!(feature = "f411") { 96 } else { 160 };

/// Reads of a ready bit, of five cycles at 16 MHz each: 60 ms for a crystal, which takes 2 ms, and 3 ms for
/// the PLL.
const CRYSTAL_LOOKS: u32 = 200_000;
const PLL_LOOKS: u32 = 10_000;

const HSION: u32 = 1;
const HSIRDY: u32 = 1 << 1;
const HSEON: u32 = 1 << 16;
const HSERDY: u32 = 1 << 17;
const HSEBYP: u32 = 1 << 18;
const CSSON: u32 = 1 << 19;
const PLLON: u32 = 1 << 24;
const PLLRDY: u32 = 1 << 25;
const CSS_CLEAR: u32 = 1 << 23;
const SWITCH_TO_PLL: u32 = 0b10;
const SWITCHED: u32 = 0b11 << 2;

/// Frequencies, and where they come from.
#[derive(Clone, Copy, Debug)]
pub struct Clocks {
    /// Says how fast the core is, Hz.
    pub core_hz: u32,
    /// Says how fast the clock of USART2 is, Hz.
    pub usart_hz: u32,
    /// Says how fast the clock of TIM2 is, Hz.
    pub timer_hz: u32,
    /// Says where they come from.
    pub source: ClockSource,
}

/// Sets the clocks up and gives them to the peripherals. Takes 65 ms at most.
pub fn start() -> Clocks {
    let clocks = choose();
    // GPIOA, GPIOB, DMA2; TIM2, USART2; SPI1, SYSCFG.
    RCC_AHB1ENR.change(0, 1 | 1 << 1 | 1 << 22);
    RCC_APB1ENR.change(0, 1 | 1 << 17);
    RCC_APB2ENR.change(0, 1 << 12 | 1 << 14);
    clocks
}

/// Sets the clocks as after a reset: the chip's own loader leaves its PLL on and the core on it, and its
/// peripherals running.
fn as_after_a_reset() {
    RCC_CR.change(0, HSION);
    wait_for(RCC_CR, HSIRDY, HSIRDY, PLL_LOOKS);
    RCC_CFGR.write(0);
    wait_for(RCC_CFGR, SWITCHED, 0, PLL_LOOKS);
    RCC_CR.change(HSEON | CSSON | PLLON, 0);
    wait_for(RCC_CR, PLLRDY, 0, PLL_LOOKS);
    // With its oscillator off this bit may be changed.
    RCC_CR.change(HSEBYP, 0);
    RCC_CIR.write(0);
    // GPIOA, GPIOB, DMA2; USB; TIM2, USART2; SPI1, SYSCFG.
    for (register, used) in
        RCC_RSTR.into_iter().zip([1 | 1 << 1 | 1 << 22, 1 << 7, 1 | 1 << 17, 1 << 12 | 1 << 14])
    {
        register.change(0, used);
        register.change(used, 0);
    }
}

fn choose() -> Clocks {
    if RCC_CR.read() == 0 {
        // What QEMU's machine gives core and timers; its serial port has no rate.
        return Clocks {
            core_hz: 168_000_000,
            usart_hz: 42_000_000,
            timer_hz: 1_000_000_000,
            source: ClockSource::Emulated,
        };
    }
    as_after_a_reset();
    RCC_APB1ENR.change(0, 1 << 28);
    // The highest voltage scale, before the PLL runs: one bit of the F405, two of the others.
    PWR_CR.change(0, if cfg!(any(feature = "f446", feature = "f411")) { 0b11 << 14 } else { 1 << 14 });
    if cfg!(feature = "f446") {
        // The debugger sends its clock: there is no crystal between the pins.
        RCC_CR.change(0, HSEBYP);
    }
    RCC_CR.change(0, HSEON);
    let has_crystal = wait_for(RCC_CR, HSERDY, HSERDY, CRYSTAL_LOOKS);
    let (input_mhz, core_mhz) =
        if has_crystal { (CRYSTAL_MHZ, CORE_MHZ) } else { (INTERNAL_MHZ, CORE_MHZ_WITHOUT_CRYSTAL) };
    // Of the PLL before it is divided by two.
    let vco_mhz = 2 * core_mhz;
    // 2 MHz into the PLL where that goes, for less jitter; else 1 MHz.
    let (m, n) = if input_mhz % 2 == 0 { (input_mhz / 2, vco_mhz / 2) } else { (input_mhz, vco_mhz) };
    // P = 2, Q for 48 MHz at most, R as after a reset.
    RCC_PLLCFGR.write(m | n << 6 | u32::from(has_crystal) << 22 | vco_mhz.div_ceil(48) << 24 | 2 << 28);
    RCC_CR.change(0, PLLON);
    if !wait_for(RCC_CR, PLLRDY, PLLRDY, PLL_LOOKS) {
        RCC_CR.change(PLLON | HSEON, 0);
        return slow();
    }
    // Five wait states at 168 MHz, three at 96; prefetch and both caches.
    FLASH_ACR.write(if cfg!(feature = "f411") { 3 } else { 5 } | 0b111 << 8);
    // APB1 at a quarter and APB2 at half of 168 MHz; at half and all of 96.
    RCC_CFGR.write(if cfg!(feature = "f411") { 0b100 << 10 } else { 0b101 << 10 | 0b100 << 13 });
    RCC_CFGR.change(0b11, SWITCH_TO_PLL);
    if !wait_for(RCC_CFGR, SWITCHED, SWITCH_TO_PLL << 2, PLL_LOOKS) {
        RCC_CFGR.write(0);
        return slow();
    }
    if has_crystal {
        // From now on a crystal that stops is an interrupt.
        RCC_CR.change(0, CSSON);
    } else {
        RCC_CR.change(HSEON, 0);
    }
    let core_hz = core_mhz * 1_000_000;
    let bus_hz = core_hz / if cfg!(feature = "f411") { 2 } else { 4 };
    let source = if has_crystal { ClockSource::Crystal } else { ClockSource::Internal };
    // Timers run at twice their divided bus.
    Clocks { core_hz, usart_hz: bus_hz, timer_hz: 2 * bus_hz, source }
}

fn slow() -> Clocks {
    RCC_CR.change(0, HSION);
    let hz = INTERNAL_MHZ * 1_000_000;
    Clocks { core_hz: hz, usart_hz: hz, timer_hz: hz, source: ClockSource::Slow }
}

/// Returns whether the interrupt that is not masked was raised because the crystal has stopped.
pub fn crystal_has_stopped() -> bool {
    const CSSF: u32 = 1 << 7;
    let stopped = RCC_CIR.read() & CSSF != 0;
    RCC_CIR.change(0, CSS_CLEAR);
    stopped
}
