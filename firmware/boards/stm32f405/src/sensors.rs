//! Data-ready edges, the interrupts that serve them, and the sensors as their drivers see them.

use core::cell::{Cell, RefCell};

use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use rigident_cortex_m::interrupts::{self, Mutex, unmask};
use rigident_firmware::Sensor;
use rigident_firmware::capture::{Capture, Failures, Order};

use crate::pins::{IMU_READY, LOAD_CELL_READY, Pin, SECOND_IMU_READY};
use crate::registers::{EXTI_FTSR, EXTI_IMR, EXTI_PR, EXTI_RTSR, SYSCFG_EXTICR, lines};
use crate::spi;
use crate::time::latched;

/// The pins' function: a channel of TIM2.
const FUNCTION: u32 = 1;

/// Sensor, pin and channel of the timer.
const EDGES: [(Sensor, Pin, usize); 3] = [
    (Sensor::LoadCell, LOAD_CELL_READY, 2),
    (Sensor::Imu, IMU_READY, 3),
    (Sensor::SecondImu, SECOND_IMU_READY, 1),
];

/// Times that the bus is asked for while a sample is read: more than 10 ms, where one takes 30 µs and a
/// transfer that does not end is given up after 3 ms.
const LOOKS: u32 = 100_000;

static CAPTURE: Mutex<RefCell<Option<Capture<'static>>>> = Mutex::new(RefCell::new(None));
/// The sensor whose sample is being read.
static READS: Mutex<Cell<Option<Sensor>>> = Mutex::new(Cell::new(None));

/// Begins to detect edges; none is served before [`listen`].
pub fn start(capture: Capture<'static>) {
    interrupts::free(|section| {
        CAPTURE.borrow(section).replace(Some(capture));
        READS.borrow(section).take();
    });
    for (sensor, pin, _) in EDGES {
        let (number, bit) = (u32::from(pin.number()), 1 << pin.number());
        let falls = sensor == Sensor::LoadCell;
        // Pulled to where no sensor would: a line that is open is silent.
        pin.peripheral(FUNCTION, if falls { 1 } else { 2 });
        let four = 4 * (number % 4);
        if let Some(register) = SYSCFG_EXTICR.get(number as usize / 4) {
            register.change(0xf << four, u32::from(pin.port()) << four);
        }
        if falls { EXTI_FTSR } else { EXTI_RTSR }.change(0, bit);
        EXTI_PR.write(bit);
        EXTI_IMR.change(0, bit);
    }
    for number in [lines::EXTI1, lines::EXTI15_10, lines::DMA2_STREAM0] {
        unmask(number);
    }
}

/// Forgets the capture: memory is initialised when a chip starts, and that of a model by this.
#[cfg(not(target_os = "none"))]
pub fn forget() {
    interrupts::free(|section| {
        CAPTURE.borrow(section).take();
        READS.borrow(section).take();
    });
}

/// Calls the capture and begins what it orders.
fn serve(call: impl FnOnce(&mut Capture<'static>) -> Option<Order>) {
    interrupts::free(|section| {
        let order = CAPTURE.borrow(section).borrow_mut().as_mut().and_then(call);
        if let Some(order) = order {
            READS.borrow(section).set(Some(order.sensor));
            spi::begin(&order);
        }
    });
}

/// Serves edges of these sensors from now on.
pub fn listen(sensors: [bool; 3]) {
    serve(|capture| capture.listen(sensors));
}

/// Handles the interrupt of edges that have come.
pub fn on_edges() {
    let pending = EXTI_PR.read();
    for (sensor, pin, channel) in EDGES {
        let bit = 1 << pin.number();
        if pending & bit != 0 {
            EXTI_PR.write(bit);
            // An edge that the timer's filter took for noise has latched nothing.
            if let Some((ticks, missed)) = latched(channel) {
                serve(|capture| capture.on_edge(sensor, ticks, missed));
            }
        }
    }
}

/// Handles the interrupt of a transfer that has ended.
pub fn on_transferred() {
    if !spi::has_ended() {
        // Of a transfer that was given up meanwhile.
        return;
    }
    let sensor = interrupts::free(|section| READS.borrow(section).take());
    let Some(sensor) = sensor else { return };
    match spi::finished(sensor) {
        Some(bytes) => serve(|capture| capture.on_read(&bytes)),
        None => serve(|capture| capture.on_failed()),
    }
}

/// Handles the interrupt of every millisecond: gives up a transfer that does not end, and tries a bus again
/// that has failed.
pub fn on_look() {
    let overdue = interrupts::free(|section| {
        CAPTURE.borrow(section).borrow_mut().as_mut().is_some_and(Capture::on_look)
    });
    if overdue {
        spi::abort();
        interrupts::free(|section| READS.borrow(section).take());
        serve(Capture::on_overdue);
    }
    serve(Capture::after_look);
}

/// Returns how many transfers have failed, of both kinds.
pub fn failures() -> Failures {
    interrupts::free(|section| {
        CAPTURE.borrow(section).borrow().as_ref().map_or_else(Failures::default, Capture::failures)
    })
}

/// A sensor on the bus; samples are being read meanwhile.
pub struct OnBus(pub Sensor);

impl ErrorType for OnBus {
    type Error = ErrorKind;
}

impl SpiDevice for OnBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        let hold = || {
            interrupts::free(|section| {
                CAPTURE.borrow(section).borrow_mut().as_mut().is_none_or(Capture::hold)
            })
        };
        if !(0..LOOKS).any(|_| hold()) {
            return Err(ErrorKind::Other);
        }
        let done = spi::transact(self.0, operations);
        serve(Capture::release);
        done.map_err(|spi::Late| ErrorKind::Other)
    }
}
