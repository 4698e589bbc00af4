//! The flash's controller, its option bytes and the cells of sectors 8 to 11: RM0090, section 3.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;

use super::{MS, Machine, US};

const WORDS: usize = 128 * 1024;
const SECTOR_WORDS: usize = 32 * 1024;
const LOCK: u32 = 1 << 31;
const BUSY: u32 = 1 << 16;
const PROTECTED: u32 = 1 << 4;
const SEQUENCE: u32 = 1 << 7;
const PARALLELISM: u32 = 1 << 6;
/// Lines of the data cache: eight of four words (section 3.5.2).
const LINES: usize = 8;

/// Times that the cells take, ps (data sheet, table of the flash: 16 to 100 µs a word, 1 to 2 s a sector, 3.3
/// V by words).
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    pub word: u64,
    pub sector: u64,
}

pub struct Flash {
    pub pace: Pace,
    access: u32,
    control: u32,
    status: u32,
    options: u32,
    options_kept: u32,
    keys: [usize; 2],
    broken: [bool; 2],
    cells: Vec<u32>,
    /// Words that a cut has left between two values: the bits that read as they like.
    unsure: Vec<(usize, u32)>,
    busy: Option<u64>,
    doing: Doing,
    cache: Vec<(usize, [u32; 4])>,
    pub erased: u32,
    pub programmed: u64,
}

#[derive(Clone, Copy)]
enum Doing {
    Nothing,
    Word(usize, u32),
    Sector(usize),
    Options,
}

impl Flash {
    pub(super) fn new() -> Self {
        Self {
            pace: Pace { word: 16 * US, sector: 1_000 * MS },
            access: 0,
            control: LOCK,
            status: 0,
            // As the factory leaves it: brown-out reset off.
            options: 0x0fff_aaed,
            options_kept: 0x0fff_aaec,
            keys: [0; 2],
            broken: [false; 2],
            cells: vec![u32::MAX; WORDS],
            unsure: Vec::new(),
            busy: None,
            doing: Doing::Nothing,
            cache: Vec::new(),
            erased: 0,
            programmed: 0,
        }
    }

    pub(super) fn reset(&mut self) {
        (self.access, self.control, self.status) = (0, LOCK, 0);
        self.options = self.options_kept | 1;
        (self.keys, self.broken) = ([0; 2], [false; 2]);
        (self.busy, self.doing) = (None, Doing::Nothing);
        self.cache.clear();
    }

    pub(super) fn wait_states(&self) -> u32 {
        self.access & 7
    }

    /// Returns true if the chip is held in reset while its supply is low.
    pub fn guards_supply(&self) -> bool {
        self.options_kept & 0b11 << 2 == 0
    }

    pub(super) fn busy_until(&self) -> Option<u64> {
        self.busy
    }

    pub(super) fn next(&self) -> Option<u64> {
        self.busy
    }

    /// Takes power away: what is being done is half done.
    pub(super) fn loses_power(&mut self, random: &mut ChaCha8Rng) {
        match self.doing {
            Doing::Word(at, value) => {
                // Some of the bits that were to be cleared are, some are between.
                let (cleared, unsure) = (random.next_u32(), random.next_u32());
                let changes = self.cells[at] & !value;
                self.cells[at] &= !(changes & cleared);
                self.unsure.push((at, changes & unsure));
            }
            Doing::Sector(sector) => {
                for at in sector * SECTOR_WORDS..(sector + 1) * SECTOR_WORDS {
                    self.cells[at] |= random.next_u32();
                    if random.next_u32().is_multiple_of(4) {
                        self.unsure.push((at, random.next_u32() & random.next_u32()));
                    }
                }
            }
            Doing::Nothing | Doing::Options => {}
        }
        self.doing = Doing::Nothing;
    }

    pub(super) fn read(&mut self, offset: usize) -> u32 {
        match offset {
            0x00 => self.access,
            0x0c => self.status | (u32::from(self.busy.is_some()) * BUSY),
            0x10 => self.control,
            0x14 => self.options,
            _ => 0,
        }
    }

    fn key(&mut self, which: usize, value: u32) {
        const KEYS: [[u32; 2]; 2] = [[0x4567_0123, 0xcdef_89ab], [0x0819_2a3b, 0x4c5d_6e7f]];
        let locked = if which == 0 { self.control & LOCK != 0 } else { self.options & 1 != 0 };
        if !locked || self.broken[which] {
            return;
        }
        if KEYS[which].get(self.keys[which]) != Some(&value) {
            // Until the next reset.
            self.broken[which] = true;
            return;
        }
        self.keys[which] += 1;
        if self.keys[which] == 2 {
            self.keys[which] = 0;
            if which == 0 { self.control &= !LOCK } else { self.options &= !1 }
        }
    }
}

impl Machine {
    pub(super) fn look_at_flash(&mut self) {
        if self.flash.busy.is_none_or(|at| at > self.now) {
            return;
        }
        let flash = &mut self.flash;
        flash.busy = None;
        match std::mem::replace(&mut flash.doing, Doing::Nothing) {
            Doing::Word(at, value) => {
                flash.cells[at] &= value;
                flash.unsure.retain(|(of, _)| *of != at || flash.cells[at] != u32::MAX);
                flash.programmed += 1;
            }
            Doing::Sector(sector) => {
                let words = sector * SECTOR_WORDS..(sector + 1) * SECTOR_WORDS;
                flash.cells[words.clone()].fill(u32::MAX);
                flash.unsure.retain(|(at, _)| !words.contains(at));
                flash.erased += 1;
                flash.control &= !(1 << 16);
            }
            Doing::Options => {
                flash.options_kept = flash.options & !3;
                flash.options &= !2;
            }
            Doing::Nothing => {}
        }
    }

    pub(super) fn write_flash(&mut self, offset: usize, value: u32) {
        let now = self.now;
        let flash = &mut self.flash;
        match offset {
            0x00 => {
                if value & 1 << 12 != 0 {
                    if value & 1 << 10 != 0 {
                        return self.breach("the data cache is emptied while it is on");
                    }
                    flash.cache.clear();
                }
                flash.access = value;
            }
            0x04 => flash.key(0, value),
            0x08 => flash.key(1, value),
            0x0c => flash.status &= !value,
            0x10 if flash.control & LOCK != 0 => self.breach("the flash is controlled while it is locked"),
            0x10 => {
                flash.control = value;
                if value & 1 << 16 != 0 && value & 2 != 0 {
                    let sector = (value >> 3 & 0xf) as usize;
                    if !(8..12).contains(&sector) {
                        return self.breach(format!("sector {sector} is erased, where the image is"));
                    }
                    (flash.doing, flash.busy) = (Doing::Sector(sector - 8), Some(now + flash.pace.sector));
                }
            }
            0x14 if flash.options & 1 != 0 => self.breach("option bytes are written while they are locked"),
            0x14 => {
                flash.options = value;
                if value & 2 != 0 {
                    (flash.doing, flash.busy) = (Doing::Options, Some(now + 20 * MS));
                }
            }
            _ => self.breach(format!("FLASH {offset:#x} is written")),
        }
    }

    pub(super) fn read_cells(&mut self, offset: usize) -> u32 {
        let at = offset / 4;
        let flash = &self.flash;
        let caches = flash.access & 1 << 10 != 0;
        if caches && let Some((_, line)) = flash.cache.iter().find(|(line, _)| *line == at / 4) {
            return line[at % 4];
        }
        let line: [u32; 4] = std::array::from_fn(|k| self.flash.cells[at & !3 | k]);
        let mut value = line[at % 4];
        let unsure: Vec<u32> =
            self.flash.unsure.iter().filter(|(of, _)| *of == at).map(|(_, bits)| *bits).collect();
        for bits in unsure {
            value ^= bits & self.draw(1 << 32) as u32;
        }
        if caches {
            let flash = &mut self.flash;
            if flash.cache.len() == LINES {
                flash.cache.remove(0);
            }
            let mut kept = line;
            kept[at % 4] = value;
            flash.cache.push((at / 4, kept));
        }
        value
    }

    pub(super) fn program(&mut self, offset: usize, value: u32) {
        let now = self.now;
        let volts = self.supply.volts(now);
        let flash = &mut self.flash;
        if flash.control & LOCK != 0 || flash.control & 1 == 0 {
            flash.status |= SEQUENCE;
            return self.breach("cells are written without leave");
        }
        if flash.control >> 8 & 3 != 2 {
            flash.status |= PARALLELISM;
            return;
        }
        if volts < 2.7 {
            flash.status |= PROTECTED;
            return self.breach("words are programmed below 2.7 V");
        }
        if flash.cells[offset / 4] & value != value {
            self.breach("cells are programmed that were not erased");
        }
        let flash = &mut self.flash;
        (flash.doing, flash.busy) = (Doing::Word(offset / 4, value), Some(now + flash.pace.word));
    }
}
