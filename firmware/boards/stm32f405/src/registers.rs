//! Registers of the chip: addresses from the reference manuals RM0090 (F405), RM0390 (F446) and RM0383
//! (F411), which have all of these at the same places.

pub use rigident_cortex_m::registers::{AddressRegister, Register, wait_for};

/// Returns the register at an offset in a block.
const fn at(block: usize, offset: usize) -> Register {
    // SAFETY: this module alone calls it, with addresses of the manuals. None of them names memory: those
    // that do are in
    // [`Stream`].
    unsafe { Register::new(block + offset) }
}

const RCC: usize = 0x4002_3800;
/// Clock control.
pub const RCC_CR: Register = at(RCC, 0x00);
/// The PLL's factors.
pub const RCC_PLLCFGR: Register = at(RCC, 0x04);
/// Clock switch and dividers.
pub const RCC_CFGR: Register = at(RCC, 0x08);
/// Clock interrupts.
pub const RCC_CIR: Register = at(RCC, 0x0c);
/// Resets peripherals of AHB1, AHB2, APB1 and APB2 while their bits are set.
pub const RCC_RSTR: [Register; 4] = [at(RCC, 0x10), at(RCC, 0x14), at(RCC, 0x20), at(RCC, 0x24)];
/// Clocks of GPIO and DMA.
pub const RCC_AHB1ENR: Register = at(RCC, 0x30);
/// Clocks of TIM2, USART2, PWR.
pub const RCC_APB1ENR: Register = at(RCC, 0x40);
/// Clocks of SPI1 and SYSCFG.
pub const RCC_APB2ENR: Register = at(RCC, 0x44);
/// The reason why the chip was reset.
pub const RCC_CSR: Register = at(RCC, 0x74);

const FLASH: usize = 0x4002_3c00;
/// Wait states and caches.
pub const FLASH_ACR: Register = at(FLASH, 0x00);
/// Unlocks what erases and programs.
pub const FLASH_KEYR: Register = at(FLASH, 0x04);
/// Busy, and what went wrong.
pub const FLASH_SR: Register = at(FLASH, 0x0c);
/// The operation on the cells.
pub const FLASH_CR: Register = at(FLASH, 0x10);
/// Unlocks the option bytes.
pub const FLASH_OPTKEYR: Register = at(FLASH, 0x08);
/// The option bytes.
pub const FLASH_OPTCR: Register = at(FLASH, 0x14);

/// The chip's own number, of 96 bits.
pub const UNIQUE_ID: [Register; 3] = [at(0x1fff_7a10, 0), at(0x1fff_7a10, 4), at(0x1fff_7a10, 8)];

const SCB: usize = 0xe000_ed00;
/// The core's faults, by kinds.
pub const SCB_CFSR: Register = at(SCB, 0x28);
/// The address of a memory fault, and of a bus fault.
pub const SCB_FAULT_ADDRESS: [Register; 2] = [at(SCB, 0x34), at(SCB, 0x38)];
/// Resets the chip, by a key.
pub const SCB_AIRCR: Register = at(SCB, 0x0c);
/// The core's own timer: control, and its flag, which reading clears.
pub const SYST_CSR: Register = at(0xe000_e010, 0);
/// The count that it begins with again.
pub const SYST_RVR: Register = at(0xe000_e010, 4);
/// The count of the core's own timer; any value clears it.
pub const SYST_CVR: Register = at(0xe000_e010, 8);
/// Masks interrupts, and forgets those that wait, 32 each.
pub const NVIC_ICER: [Register; 3] = [at(0xe000_e180, 0), at(0xe000_e180, 4), at(0xe000_e180, 8)];
/// Forgets interrupts that wait.
pub const NVIC_ICPR: [Register; 3] = [at(0xe000_e280, 0), at(0xe000_e280, 4), at(0xe000_e280, 8)];

/// Sectors 8 to 11 of an STM32F405: `build.rs` ends the image before them.
const KEPT: usize = 0x0808_0000;
/// Bytes of these.
pub const KEPT_BYTES: usize = 512 * 1024;

/// Returns a word of the flash's sectors 8 to 11; `None` beyond them.
pub fn kept_word(number: usize) -> Option<Register> {
    (number < KEPT_BYTES / 4).then(|| at(KEPT, 4 * number))
}

const PWR: usize = 0x4000_7000;
/// The core's voltage.
pub const PWR_CR: Register = at(PWR, 0x00);
/// The state of the supply.
pub const PWR_CSR: Register = at(PWR, 0x04);

const GPIO: [usize; 2] = [0x4002_0000, 0x4002_0400];

/// Registers of a port of pins.
pub struct Port {
    /// Two bits a pin: input, output, peripheral, analog.
    pub mode: Register,
    /// Two bits a pin: how steep its edges are.
    pub speed: Register,
    /// Two bits a pin: pulled up, down or not at all.
    pub pull: Register,
    /// Levels.
    pub input: Register,
    /// Sets the lower sixteen, clears by the upper.
    pub set: Register,
    /// Four bits a pin: which peripheral.
    pub function: [Register; 2],
}

const fn port(block: usize) -> Port {
    Port {
        mode: at(block, 0x00),
        speed: at(block, 0x08),
        pull: at(block, 0x0c),
        input: at(block, 0x10),
        set: at(block, 0x18),
        function: [at(block, 0x20), at(block, 0x24)],
    }
}

/// Ports A and B.
pub const PORTS: [Port; 2] = [port(GPIO[0]), port(GPIO[1])];

const SYSCFG: usize = 0x4001_3800;
/// Four bits a line: which port an external interrupt is of.
pub const SYSCFG_EXTICR: [Register; 4] =
    [at(SYSCFG, 0x08), at(SYSCFG, 0x0c), at(SYSCFG, 0x10), at(SYSCFG, 0x14)];

const EXTI: usize = 0x4001_3c00;
/// Lines that interrupt.
pub const EXTI_IMR: Register = at(EXTI, 0x00);
/// Lines that do so when they rise.
pub const EXTI_RTSR: Register = at(EXTI, 0x08);
/// Lines that do so when they fall.
pub const EXTI_FTSR: Register = at(EXTI, 0x0c);
/// Lines that have; cleared by ones.
pub const EXTI_PR: Register = at(EXTI, 0x14);

const TIM2: usize = 0x4000_0000;
/// Control.
pub const TIM2_CR1: Register = at(TIM2, 0x00);
/// Flags: captures, and captures that occurred before the last was read; cleared by zeros.
pub const TIM2_SR: Register = at(TIM2, 0x10);
/// Events by hand.
pub const TIM2_EGR: Register = at(TIM2, 0x14);
/// The captures of channels 1 and 2, 3 and 4.
pub const TIM2_CCMR: [Register; 2] = [at(TIM2, 0x18), at(TIM2, 0x1c)];
/// The channels that capture, and at which edge.
pub const TIM2_CCER: Register = at(TIM2, 0x20);
/// The count.
pub const TIM2_CNT: Register = at(TIM2, 0x24);
/// The divider, less one.
pub const TIM2_PSC: Register = at(TIM2, 0x28);
/// The highest count.
pub const TIM2_ARR: Register = at(TIM2, 0x2c);
/// The values that channels 1 to 4 have latched; reading clears the flag.
pub const TIM2_CCR: [Register; 4] = [at(TIM2, 0x34), at(TIM2, 0x38), at(TIM2, 0x3c), at(TIM2, 0x40)];

const USART2: usize = 0x4000_4400;
/// State.
pub const USART2_SR: Register = at(USART2, 0x00);
/// A byte out, a byte in.
pub const USART2_DR: Register = at(USART2, 0x04);
/// The divider.
pub const USART2_BRR: Register = at(USART2, 0x08);
/// Control.
pub const USART2_CR1: Register = at(USART2, 0x0c);

const SPI1: usize = 0x4001_3000;
/// Control.
pub const SPI1_CR1: Register = at(SPI1, 0x00);
/// DMA requests.
pub const SPI1_CR2: Register = at(SPI1, 0x04);
/// State.
pub const SPI1_SR: Register = at(SPI1, 0x08);
/// A byte out, a byte in.
pub const SPI1_DR: Register = at(SPI1, 0x0c);

const DMA2: usize = 0x4002_6400;
/// Flags of streams 0 to 3.
pub const DMA2_LISR: Register = at(DMA2, 0x00);
/// Clears them.
pub const DMA2_LIFCR: Register = at(DMA2, 0x08);

/// Registers of a stream of a DMA.
pub struct Stream {
    control: Register,
    count: Register,
    peripheral: AddressRegister,
    memory: AddressRegister,
}

impl Stream {
    const ENABLED: u32 = 1;

    /// Begins to move `count` bytes between SPI1 and memory, as `control` says.
    ///
    /// # Safety
    /// The memory must be a static of at least `count` bytes that may be read and, where `control` says so,
    /// written at any time until [`Self::stop`].
    pub unsafe fn begin(&self, memory: *const u8, count: u32, control: u32) {
        self.count.write(count);
        // SAFETY: the data register of SPI1 is no memory; of the other address the caller has promised what
        // is asked for.
        unsafe {
            self.peripheral.write(SPI1_DR.address());
            self.memory.write(memory as usize);
        }
        self.control.write(control);
        self.control.write(control | Self::ENABLED);
    }

    /// Stops it, and waits for what it has begun.
    pub fn stop(&self) {
        const LOOKS: u32 = 1_000;
        self.control.change(Self::ENABLED, 0);
        wait_for(self.control, Self::ENABLED, 0, LOOKS);
    }
}

const fn stream(number: usize) -> Stream {
    let block = DMA2 + 0x10 + 0x18 * number;
    Stream {
        control: at(block, 0x00),
        count: at(block, 0x04),
        // SAFETY: addresses of the manuals.
        peripheral: unsafe { AddressRegister::new(block + 0x08) },
        // SAFETY: as above.
        memory: unsafe { AddressRegister::new(block + 0x0c) },
    }
}

/// Stream 0 of DMA2, from SPI1.
pub const DMA2_FROM_SPI1: Stream = stream(0);
/// Stream 3 of DMA2, to SPI1.
pub const DMA2_TO_SPI1: Stream = stream(3);

const IWDG: usize = 0x4000_3000;
/// Keys: start, feed, unlock.
pub const IWDG_KR: Register = at(IWDG, 0x00);
/// The divider.
pub const IWDG_PR: Register = at(IWDG, 0x04);
/// The highest count.
pub const IWDG_RLR: Register = at(IWDG, 0x08);

/// The units that stop while a debugger holds the core.
pub const DBGMCU_APB1_FZ: Register = at(0xe004_2000, 0x08);

/// Numbers of interrupts.
pub mod lines {
    /// External lines 1, and 10 to 15.
    pub const EXTI1: u16 = 7;
    /// External lines 10 to 15.
    pub const EXTI15_10: u16 = 40;
    /// The link to the host.
    pub const USART2: u16 = 38;
    /// The end of a transfer from SPI1.
    pub const DMA2_STREAM0: u16 = 56;
}
