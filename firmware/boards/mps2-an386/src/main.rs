//! The firmware on the emulated board.
#![no_std]
#![no_main]

use core::cell::RefCell;

use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::{entry, exception};
use embedded_hal::spi::SpiDevice;
use mps2_an386::bus::{Pipes, Sensor};
use mps2_an386::{exit, uart};
use rigident_shared::wire::bus::Event;

#[entry]
fn main() -> ! {
    let mut core = cortex_m::Peripherals::take().expect("taken once");
    // Wakes an idle machine a thousand times a second, to look at the bus again.
    core.SYST.set_clock_source(SystClkSource::Core);
    core.SYST.set_reload(25_000 - 1);
    core.SYST.enable_counter();
    core.SYST.enable_interrupt();

    let pipes = RefCell::new(Pipes::open());
    uart::start();
    uart::send(b"hello\n");
    defmt::info!("up");
    let mut chunk = [0_u8; 64];
    let mut adc = Sensor::load_cell(&pipes);
    loop {
        let n = uart::receive(&mut chunk[..uart::room().min(64)]);
        if n > 0 {
            uart::send(&chunk[..n]);
        }
        if uart::room() > 512 {
            let answer = pipes.borrow_mut().poll();
            match answer.event {
                Event::Exit => exit::success(),
                Event::Idle => cortex_m::asm::wfi(),
                Event::ImuReady | Event::LoadCellReady => {
                    let mut frame = [7; 30];
                    adc.transfer_in_place(&mut frame).ok();
                    uart::send(&frame);
                }
            }
        } else {
            cortex_m::asm::wfi();
        }
    }
}

#[exception]
fn SysTick() {}

// SAFETY: it only touches the serial port, which the main loop leaves to it.
#[exception]
unsafe fn DefaultHandler(line: i16) {
    match line {
        uart::RECEIVED => uart::on_received(),
        uart::SENT => uart::on_sent(),
        unexpected => defmt::panic!("interrupt {=i16} has no handler", unexpected),
    }
}
