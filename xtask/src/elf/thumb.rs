//! A decoder for the Thumb-2 instructions of an Armv7E-M with single-precision floating point: length,
//! control flow, stack, and the class that the cycle model counts by. Encodings: Armv7-M Architecture
//! Reference Manual, A5–A7.

/// The destination of control after an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// The flow goes to the next instruction.
    Next,
    /// The flow goes to a fixed address, always or on a condition.
    Jump { to: u32, conditional: bool },
    /// A call to a fixed address.
    Call { to: u32 },
    /// A call through a register.
    CallRegister(u8),
    /// A jump through a register: a tail call.
    JumpRegister(u8),
    /// A jump by a move into the program counter: into a table of jumps, if such follow it.
    MoveToCounter(u8),
    /// Into a table of offsets that follows the instruction, within the function.
    Table,
    /// Back to the caller.
    Return,
    /// A permanently undefined instruction: the compiler's abort.
    Trap,
}

/// The classes that the cycle model distinguishes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// Integer arithmetic, logic, moves, comparisons.
    Integer,
    IntegerDivide,
    Load,
    Store,
    /// Several words; how many.
    LoadMany(u8),
    StoreMany(u8),
    Branch,
    /// VADD, VSUB, VMUL, VCVT, VCMP, VABS, VNEG and register moves.
    Float,
    /// VMLA, VMLS, VFMA, VFMS and their negations.
    FloatMultiplyAccumulate,
    FloatDivide,
    FloatRoot,
    FloatLoad,
    FloatStore,
    /// A move between an integer and a float register, or the status flags.
    FloatMove,
    /// Barriers, hints, system registers, IT.
    System,
}

/// One decoded instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// Bytes: 2 or 4.
    pub size: u32,
    pub flow: Flow,
    pub class: Class,
    /// Bytes by which it lowers the stack pointer.
    pub pushed: u32,
    /// True if it sets the stack pointer in a way that is not a constant.
    pub moves_stack: bool,
    /// Single registers that a float instruction reads and the one that a float computation writes.
    pub float: Option<FloatRegisters>,
}

/// Register numbers S0–S31 of a float computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FloatRegisters {
    pub to: u8,
    pub from: [u8; 3],
}

/// No register at all.
pub const NONE: u8 = u8::MAX;

const SP: u16 = 13;
const LR: u8 = 14;
const PC: u8 = 15;

fn plain(size: u32, class: Class) -> Instruction {
    Instruction { size, flow: Flow::Next, class, pushed: 0, moves_stack: false, float: None }
}

fn jump(size: u32, flow: Flow) -> Instruction {
    Instruction { flow, ..plain(size, Class::Branch) }
}

fn sign_extend(value: u32, bits: u32) -> u32 {
    (((value << (32 - bits)) as i32) >> (32 - bits)) as u32
}

/// Decodes the instruction at `address` from its first halfword and the one after it.
///
/// Coprocessor 11, the double-precision registers, is decoded as to its length alone: the target has none of
/// it.
pub fn decode(address: u32, first: u16, second: u16) -> Instruction {
    if first >> 11 >= 0b11101 { decode_wide(address, first, second) } else { decode_narrow(address, first) }
}

fn decode_narrow(address: u32, word: u16) -> Instruction {
    let class = |class| plain(2, class);
    match word >> 12 {
        0x0..=0x3 => class(Class::Integer),
        0x4 => match (word >> 8) & 0xf {
            0x0..=0x3 => class(Class::Integer),
            0x4 | 0x6 => {
                let to = (word & 7) | ((word >> 4) & 8);
                match to {
                    SP => Instruction { moves_stack: true, ..class(Class::Integer) },
                    15 => jump(2, Flow::MoveToCounter(((word >> 3) & 0xf) as u8)),
                    _ => class(Class::Integer),
                }
            }
            0x5 => class(Class::Integer),
            0x7 => match (word & 0x80 != 0, ((word >> 3) & 0xf) as u8) {
                (true, register) => jump(2, Flow::CallRegister(register)),
                (false, LR) => jump(2, Flow::Return),
                (false, register) => jump(2, Flow::JumpRegister(register)),
            },
            _ => class(Class::Load),
        },
        0x5 => class(if (word >> 9) & 7 <= 2 { Class::Store } else { Class::Load }),
        0x6..=0x9 => class(if word & 0x800 == 0 { Class::Store } else { Class::Load }),
        0xa => class(Class::Integer),
        0xb => decode_miscellaneous(address, word),
        0xc => {
            let many = (word & 0xff).count_ones() as u8;
            class(if word & 0x800 == 0 { Class::StoreMany(many) } else { Class::LoadMany(many) })
        }
        0xd => match (word >> 8) & 0xf {
            0xe => Instruction { flow: Flow::Trap, ..class(Class::System) },
            0xf => class(Class::System),
            _ => {
                let to = (address + 4).wrapping_add(sign_extend(u32::from(word & 0xff) << 1, 9));
                jump(2, Flow::Jump { to, conditional: true })
            }
        },
        _ => {
            let to = (address + 4).wrapping_add(sign_extend(u32::from(word & 0x7ff) << 1, 12));
            jump(2, Flow::Jump { to, conditional: false })
        }
    }
}

fn decode_miscellaneous(address: u32, word: u16) -> Instruction {
    let class = |class| plain(2, class);
    if word & 0xf500 == 0xb100 {
        let offset = u32::from((word >> 9) & 1) << 6 | u32::from((word >> 3) & 0x1f) << 1;
        return jump(2, Flow::Jump { to: address + 4 + offset, conditional: true });
    }
    match (word >> 8) & 0xf {
        0x0 if word & 0x80 != 0 => {
            Instruction { pushed: u32::from(word & 0x7f) * 4, ..class(Class::Integer) }
        }
        0x0 => class(Class::Integer),
        0x4 | 0x5 => {
            let many = (word & 0x1ff).count_ones();
            Instruction { pushed: 4 * many, ..class(Class::StoreMany(many as u8)) }
        }
        0xc | 0xd => {
            let many = (word & 0x1ff).count_ones() as u8;
            let flow = if word & 0x100 != 0 { Flow::Return } else { Flow::Next };
            Instruction { flow, ..class(Class::LoadMany(many)) }
        }
        0x2 | 0xa => class(Class::Integer),
        _ => class(Class::System),
    }
}

fn decode_wide(address: u32, first: u16, second: u16) -> Instruction {
    match (first >> 11) & 3 {
        0b01 if first & 0x0400 != 0 => decode_coprocessor(first, second),
        0b01 if first & 0x0200 != 0 => data_processing(second),
        0b01 if first & 0x0040 == 0 => decode_multiple(first, second),
        0b01 => decode_dual_or_table(first, second),
        0b10 if second & 0x8000 == 0 => decode_immediate(first, second),
        0b10 => decode_branch(address, first, second),
        _ if first & 0x0400 != 0 => decode_coprocessor(first, second),
        _ if first & 0x0200 == 0 => decode_single(first, second),
        _ => decode_multiply(first),
    }
}

/// Decodes shifted-register and register forms: only what they do to the stack pointer matters.
fn data_processing(second: u16) -> Instruction {
    let to_stack = (second >> 8) & 0xf == SP;
    Instruction { moves_stack: to_stack, ..plain(4, Class::Integer) }
}

fn decode_multiple(first: u16, second: u16) -> Instruction {
    let many = second.count_ones();
    let load = first & 0x10 != 0;
    let class = if load { Class::LoadMany(many as u8) } else { Class::StoreMany(many as u8) };
    let pushed = if first == 0xe92d { 4 * many } else { 0 };
    let flow = if load && second & 0x8000 != 0 { Flow::Return } else { Flow::Next };
    Instruction { pushed, flow, ..plain(4, class) }
}

fn decode_dual_or_table(first: u16, second: u16) -> Instruction {
    if first & 0xfff0 == 0xe8d0 && second & 0x00e0 == 0 && second & 0xf000 == 0xf000 {
        return jump(4, Flow::Table);
    }
    let load = first & 0x10 != 0;
    let indexed = first & 0x0120 != 0;
    let exclusive = !indexed;
    if exclusive {
        return plain(4, if load { Class::Load } else { Class::Store });
    }
    let before_below_and_back = first & 0x01a0 == 0x0120;
    let pushes = !load && first & 0xf == SP && before_below_and_back;
    let pushed = if pushes { u32::from(second & 0xff) * 4 } else { 0 };
    Instruction { pushed, ..plain(4, if load { Class::LoadMany(2) } else { Class::StoreMany(2) }) }
}

fn decode_immediate(first: u16, second: u16) -> Instruction {
    let to = (second >> 8) & 0xf;
    let low = (first & 0x0400) << 1 | (second & 0x7000) >> 4 | (second & 0xff);
    let integer = plain(4, Class::Integer);
    match first & 0xfbf0 {
        _ if to != SP => integer,
        0xf2a0 if first & 0xf == SP => Instruction { pushed: u32::from(low), ..integer },
        0xf1a0 | 0xf1b0 if first & 0xf == SP => Instruction { pushed: expand(low), ..integer },
        // Adding to the stack pointer gives stack back.
        0xf200 | 0xf100 | 0xf110 if first & 0xf == SP => integer,
        _ => Instruction { moves_stack: true, ..integer },
    }
}

/// Returns ThumbExpandImm of a twelve-bit constant.
fn expand(low: u16) -> u32 {
    let byte = u32::from(low & 0xff);
    match low >> 8 {
        0 => byte,
        1 => byte | byte << 16,
        2 => byte << 8 | byte << 24,
        3 => byte * 0x0101_0101,
        _ => (0x80 | u32::from(low & 0x7f)).rotate_right(u32::from(low >> 7)),
    }
}

fn decode_branch(address: u32, first: u16, second: u16) -> Instruction {
    let sign = u32::from(first >> 10) & 1;
    let (j1, j2) = (u32::from(second >> 13) & 1, u32::from(second >> 11) & 1);
    let low = u32::from(second & 0x7ff) << 1;
    let far = || {
        let (i1, i2) = (!(j1 ^ sign) & 1, !(j2 ^ sign) & 1);
        let offset = sign << 24 | i1 << 23 | i2 << 22 | u32::from(first & 0x3ff) << 12 | low;
        (address + 4).wrapping_add(sign_extend(offset, 25))
    };
    match second & 0xd000 {
        0xd000 => jump(4, Flow::Call { to: far() }),
        0x9000 => jump(4, Flow::Jump { to: far(), conditional: false }),
        _ if (first >> 6) & 0xe != 0xe => {
            let offset = sign << 20 | j2 << 19 | j1 << 18 | u32::from(first & 0x3f) << 12 | low;
            let to = (address + 4).wrapping_add(sign_extend(offset, 21));
            jump(4, Flow::Jump { to, conditional: true })
        }
        _ if first & 0xfff0 == 0xf7f0 && second & 0xf000 == 0xa000 => {
            Instruction { flow: Flow::Trap, ..plain(4, Class::System) }
        }
        // MSR to MSP or PSP sets a stack pointer.
        _ if first & 0xfff0 == 0xf380 && second & 0xff == 8 => {
            Instruction { moves_stack: true, ..plain(4, Class::System) }
        }
        _ => plain(4, Class::System),
    }
}

fn decode_single(first: u16, second: u16) -> Instruction {
    let register = (second >> 12) as u8;
    if first & 0x10 == 0 {
        // STR Rt, [SP, #-imm8]!
        let pushes = first == 0xf84d && second & 0x0f00 == 0x0d00;
        let pushed = if pushes { u32::from(second & 0xff) } else { 0 };
        return Instruction { pushed, ..plain(4, Class::Store) };
    }
    let word = first & 0x0060 == 0x0040;
    if register == PC {
        return match (word, first, second) {
            (false, _, _) => plain(4, Class::System),
            // LDR PC, [SP], #imm8
            (true, 0xf85d, second) if second & 0x0f00 == 0x0b00 => {
                Instruction { flow: Flow::Return, ..plain(4, Class::Load) }
            }
            (true, _, _) => Instruction { flow: Flow::JumpRegister(PC), ..plain(4, Class::Load) },
        };
    }
    plain(4, Class::Load)
}

fn decode_multiply(first: u16) -> Instruction {
    let class = match first & 0xfff0 {
        0xfb90 | 0xfbb0 => Class::IntegerDivide,
        _ => Class::Integer,
    };
    plain(4, class)
}

fn decode_coprocessor(first: u16, second: u16) -> Instruction {
    if first & 0x0f00 == 0x0e00 {
        return if second & 0x10 != 0 { plain(4, Class::FloatMove) } else { decode_float(first, second) };
    }
    if first & 0xffe0 == 0xec40 {
        return plain(4, Class::FloatMove);
    }
    let load = first & 0x10 != 0;
    let words = second & 0xff;
    if first & 0x0120 == 0x0100 {
        return plain(4, if load { Class::FloatLoad } else { Class::FloatStore });
    }
    let pushed = if first & 0xffbf == 0xed2d { u32::from(words) * 4 } else { 0 };
    let class = if load { Class::LoadMany(words as u8) } else { Class::StoreMany(words as u8) };
    Instruction { pushed, ..plain(4, class) }
}

fn decode_float(first: u16, second: u16) -> Instruction {
    let to = ((second >> 12) << 1 | (first >> 6) & 1) as u8;
    let n = ((first & 0xf) << 1 | (second >> 7) & 1) as u8;
    let m = ((second & 0xf) << 1 | (second >> 5) & 1) as u8;
    let (class, from) = match (first >> 4) & 0b1011 {
        0b0000 | 0b0001 | 0b1001 | 0b1010 => (Class::FloatMultiplyAccumulate, [to, n, m]),
        0b1000 => (Class::FloatDivide, [n, m, m]),
        0b1011 if second & 0x40 == 0 => (Class::Float, [NONE; 3]),
        0b1011 => {
            let root = first & 0xf == 1 && second & 0xc0 == 0xc0;
            let compare = matches!(first & 0xf, 4 | 5);
            let class = if root { Class::FloatRoot } else { Class::Float };
            (class, if compare { [to, m, m] } else { [m; 3] })
        }
        _ => (Class::Float, [n, m, m]),
    };
    Instruction { float: Some(FloatRegisters { to, from }), ..plain(4, class) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encodings as GNU as gives them.
    fn at(address: u32, first: u16, second: u16) -> Instruction {
        decode(address, first, second)
    }

    #[test]
    fn calls_and_jumps_go_where_the_assembler_put_them() {
        // 1000: bl 0x1234; 1000: bl 0xf00; 1000: b.w 0x2000; 1000: beq.w 0xff0; 1000: b 0x1000; 1000: cbz r3,
        // 0x1040
        assert_eq!(at(0x1000, 0xf000, 0xf918).flow, Flow::Call { to: 0x1234 });
        assert_eq!(at(0x1000, 0xf7ff, 0xff7e).flow, Flow::Call { to: 0xf00 });
        assert_eq!(at(0x1000, 0xf000, 0xbffe).flow, Flow::Jump { to: 0x2000, conditional: false });
        assert_eq!(at(0x1000, 0xf43f, 0xaff6).flow, Flow::Jump { to: 0xff0, conditional: true });
        assert_eq!(at(0x1000, 0xe7fe, 0).flow, Flow::Jump { to: 0x1000, conditional: false });
        assert_eq!(at(0x1000, 0xb1f3, 0).flow, Flow::Jump { to: 0x1040, conditional: true });
    }

    #[test]
    fn returns_and_register_calls_are_distinguished() {
        assert_eq!(at(0, 0x4770, 0).flow, Flow::Return); // bx lr
        assert_eq!(at(0, 0xbd80, 0).flow, Flow::Return); // pop {r7, pc}
        assert_eq!(at(0, 0xe8bd, 0x8ff0).flow, Flow::Return); // pop.w {r4-r11, pc}
        assert_eq!(at(0, 0xf85d, 0xfb04).flow, Flow::Return); // ldr pc, [sp], #4
        assert_eq!(at(0, 0x4798, 0).flow, Flow::CallRegister(3)); // blx r3
        assert_eq!(at(0, 0x4718, 0).flow, Flow::JumpRegister(3)); // bx r3
        assert_eq!(at(0, 0xe8df, 0xf003).flow, Flow::Table); // tbb [pc, r3]
        assert_eq!(at(0, 0x46b7, 0).flow, Flow::MoveToCounter(6)); // mov pc, r6
        assert_eq!(at(0, 0xdefe, 0).flow, Flow::Trap); // udf #254
    }

    #[test]
    fn pushed_bytes_are_those_of_the_manual() {
        assert_eq!(at(0, 0xb5f0, 0).pushed, 20); // push {r4-r7, lr}
        assert_eq!(at(0, 0xe92d, 0x4ff0).pushed, 36); // push.w {r4-r11, lr}
        assert_eq!(at(0, 0xed2d, 0x8b10).pushed, 64); // vpush {d8-d15}
        assert_eq!(at(0, 0xb082, 0).pushed, 8); // sub sp, #8
        assert_eq!(at(0, 0xf5ad, 0x5d80).pushed, 4096); // sub.w sp, sp, #4096
        assert_eq!(at(0, 0xf6ad, 0x7d18).pushed, 0xf18); // subw sp, sp, #3864
        assert_eq!(at(0, 0xf84d, 0x8d04).pushed, 4); // str r8, [sp, #-4]!
        assert_eq!(at(0, 0xb002, 0).pushed, 0); // add sp, #8
        assert!(at(0, 0x46a5, 0).moves_stack); // mov sp, r4
    }

    #[test]
    fn float_instructions_are_of_their_class() {
        let class = |first, second| at(0, first, second).class;
        assert_eq!(class(0xee30, 0x0a81), Class::Float); // vadd.f32 s0, s1, s2
        assert_eq!(class(0xee20, 0x0a81), Class::Float); // vmul.f32
        assert_eq!(class(0xee00, 0x0a81), Class::FloatMultiplyAccumulate); // vmla.f32
        assert_eq!(class(0xeea0, 0x0a81), Class::FloatMultiplyAccumulate); // vfma.f32
        assert_eq!(class(0xee80, 0x0a81), Class::FloatDivide); // vdiv.f32
        assert_eq!(class(0xeeb1, 0x0ac0), Class::FloatRoot); // vsqrt.f32 s0, s0
        assert_eq!(class(0xeeb4, 0x0a60), Class::Float); // vcmp.f32 s0, s1
        assert_eq!(class(0xed90, 0x0a01), Class::FloatLoad); // vldr s0, [r0, #4]
        assert_eq!(class(0xed80, 0x0a01), Class::FloatStore); // vstr s0, [r0, #4]
        assert_eq!(class(0xecb0, 0x0a04), Class::LoadMany(4)); // vldmia r0!, {s0-s3}
        assert_eq!(class(0xee10, 0x0a10), Class::FloatMove); // vmov r0, s0
        assert_eq!(class(0xeef1, 0xfa10), Class::FloatMove); // vmrs APSR_nzcv, fpscr
        assert_eq!(class(0xfb90, 0xf0f1), Class::IntegerDivide); // sdiv r0, r0, r1
    }

    #[test]
    fn a_float_instruction_names_its_registers() {
        // vmul.f32 s3, s17, s30
        let registers = FloatRegisters { to: 3, from: [17, 30, 30] };
        assert_eq!(at(0, 0xee68, 0x1a8f).float, Some(registers));
    }
}
