//! The verb `flash`: puts the firmware onto a board, by a debug probe and probe-rs, or by the chip's own
//! loader over USB (DFU) and dfu-util.
//!
//! Nothing is written before the chip has been asked what it is.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use object::elf;
use object::read::elf::{ElfFile32, ProgramHeader};

use crate::firmware::{self, Board};
use crate::places;
use crate::process::{self, is_installed};
use crate::toolchain::{self, Core};

const PROBE: &str = "probe-rs";
const DFU: &str = "dfu-util";
const NO_PROBE_PROGRAM: &str = "there is no `probe-rs` here: install it by `cargo install probe-rs-tools \
     --locked` (or see https://probe.rs); without a debug probe, `cargo xtask flash --dfu`";
const NO_PROBE: &str = "no debug probe is connected: plug it in (ST-Link, J-Link or a CMSIS-DAP one) and \
     give the board power; `probe-rs list` must show it, and on Linux its udev rules must let you use it \
     (https://probe.rs/docs/getting-started/probe-setup). Without a probe: `cargo xtask flash --dfu`";
const NO_CHIP: &str = "the probe does not reach a chip: check that the board has power and that SWDIO \
     (PA13), SWCLK (PA14), ground and reset are connected as docs/wiring.md says";
const NO_DFU_PROGRAM: &str = "there is no `dfu-util` here: `sudo apt-get install dfu-util`, on macOS `brew \
     install dfu-util`; with a debug probe, `cargo xtask flash`";
const NO_DFU: &str = "no board in its loader is connected: hold BOOT0 (on some boards a jumper to 3.3 V) \
     while you press and release reset, with USB plugged into the board itself; `dfu-util -l` must then show \
     [0483:df11]. A charging cable without data wires shows nothing, and on Linux a udev rule or `sudo` may \
     be needed";

/// The register that tells which chip it is, and how much of it is the chip.
const IDCODE: &str = "0xe0042000";
const CHIP_BITS: u32 = 0xfff;
/// The register of the option bytes, and its bits of the brown-out level: the firmware of an STM32F405 sets
/// level 3, whose bits are both clear, at its first start, and keeps nothing in flash without.
const OPTION_BYTES: &str = "0x40023c14";
const BROWN_OUT: u32 = 0b11 << 2;
/// The firmware has started and set them after this long.
const STARTS: Duration = Duration::from_millis(500);
/// The address where flash begins.
const FLASH: u32 = 0x0800_0000;

/// What to flash.
#[derive(clap::Args, Clone)]
pub struct Options {
    /// Onto which board.
    #[arg(long, value_enum, default_value = "stm32f405")]
    board: Board,
    /// Features of the board crate, separated by commas: `watch` for the image that watches robots.
    #[arg(long, value_delimiter = ',')]
    features: Vec<String>,
    /// Over USB by the chip's own loader, without a debug probe.
    #[arg(long)]
    dfu: bool,
    /// Print the commands and touch nothing.
    #[arg(long)]
    dry_run: bool,
}

/// A chip as its tools know it.
struct Chip {
    board: Board,
    name: &'static str,
    /// The chip's name for probe-rs.
    probe: &'static str,
    /// The chip's ID code.
    id: u32,
    /// Sectors of 128 kB, as its loader tells its flash.
    large_sectors: u32,
}

const CHIPS: [Chip; 3] = [
    Chip { board: Board::F405, name: "STM32F405", probe: "STM32F405RGTx", id: 0x413, large_sectors: 7 },
    Chip { board: Board::F446, name: "STM32F446", probe: "STM32F446RETx", id: 0x421, large_sectors: 3 },
    Chip { board: Board::F411, name: "STM32F411", probe: "STM32F411CEUx", id: 0x431, large_sectors: 3 },
];

/// Builds the image and flashes it.
pub fn run(options: &Options, core: Option<Core>) -> Result<()> {
    if options.board == Board::Pico {
        bail!(
            "a Pico 2 flashes itself: hold BOOTSEL while you plug it in, `cargo xtask firmware --board \
             rp2350`, then `picotool load -t elf IMAGE`"
        );
    }
    let Some(chip) = CHIPS.iter().find(|chip| chip.board == options.board) else {
        bail!(
            "the emulated board cannot be flashed: `cargo xtask firmware` builds it, `rigident demo --mcu \
             qemu` runs it"
        );
    };
    if options.dry_run {
        let mut build = format!("cargo xtask firmware --board {}", chip.name.to_lowercase());
        if !options.features.is_empty() {
            build += &format!(" --features {}", options.features.join(","));
        }
        println!("{build}   # tells where IMAGE is");
        let image = Path::new("IMAGE");
        let commands =
            if options.dfu { vec![dfu(&image.with_extension("bin"))] } else { probe(chip, image).to_vec() };
        commands.iter().for_each(|words| println!("{}", words.join(" ")));
        return Ok(());
    }
    // What is missing is reported before minutes of building.
    if options.dfu {
        loader_is_here(chip)?
    } else {
        probe_is_here(chip)?
    }
    let features: Vec<&str> = options.features.iter().map(String::as_str).collect();
    let elf = firmware::build_for(chip.board, toolchain::choose(core)?, &features)?;
    if options.dfu {
        let image = elf.with_extension("bin");
        std::fs::write(&image, flat(&elf)?).with_context(|| format!("cannot write {}", image.display()))?;
        process::run(&mut command(&dfu(&image)))
            .context("dfu-util did not finish: reset the board into its loader again and repeat")?;
    } else {
        for words in probe(chip, &elf) {
            process::run(&mut command(&words))
                .context("probe-rs did not finish: hold the board's reset while it connects, and repeat")?;
        }
    }
    if !options.dfu && chip.board == Board::F405 {
        std::thread::sleep(STARTS);
        guards_supply(read_word(chip, OPTION_BYTES)?)?;
    }
    println!("flashed; `rigident info --port PORT` must now name {} (docs/wiring.md)", chip.name);
    Ok(())
}

fn command(words: &[String]) -> Command {
    let mut command = process::command(words.first().map_or("", String::as_str), places::root());
    command.args(words.iter().skip(1));
    command
}

/// Returns what is typed for a probe: write and compare, then start.
fn probe(chip: &Chip, elf: &Path) -> [Vec<String>; 2] {
    let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
    let elf = elf.display().to_string();
    [
        words(&[PROBE, "download", "--chip", chip.probe, "--verify", &elf]),
        words(&[PROBE, "reset", "--chip", chip.probe]),
    ]
}

/// Returns what is typed for the loader: write, then leave it, which starts the image.
fn dfu(image: &Path) -> Vec<String> {
    let address = format!("{FLASH:#010x}:leave");
    let image = image.display().to_string();
    [DFU, "-d", "0483:df11", "-a", "0", "-s", &address, "-D", &image].map(str::to_owned).to_vec()
}

fn probe_is_here(chip: &Chip) -> Result<()> {
    if !is_installed(PROBE) {
        bail!(NO_PROBE_PROGRAM);
    }
    let list = process::output(process::command(PROBE, places::root()).arg("list"))?;
    if list.contains("No debug probes") {
        bail!(NO_PROBE);
    }
    is_chip(chip, read_word(chip, IDCODE)?)
}

/// Reads a word of the chip by the probe.
fn read_word(chip: &Chip, address: &str) -> Result<u32> {
    let mut read = process::command(PROBE, places::root());
    read.args(["read", "--chip", chip.probe, "b32", address, "1"]);
    let text = process::output(&mut read).context(NO_CHIP)?;
    id_code(&text).with_context(|| format!("probe-rs did not read the word at {address}"))
}

/// Refuses to call a chip ready that runs on while its supply is too low to program flash.
fn guards_supply(option_bytes: u32) -> Result<()> {
    if option_bytes & BROWN_OUT == 0 {
        return Ok(());
    }
    bail!(
        "the image is on the board, but its brown-out level is {} and not 3: the firmware has not started, \
         or its supply is below 2.9 V; it keeps nothing in flash like this. Look at the supply, reset the \
         board, and repeat",
        3 - (option_bytes & BROWN_OUT) / 4
    )
}

/// Refuses another chip than the one that is built for.
fn is_chip(chip: &Chip, code: u32) -> Result<()> {
    let found = code & CHIP_BITS;
    if found == chip.id {
        return Ok(());
    }
    match CHIPS.iter().find(|other| other.id == found) {
        Some(other) => {
            let name = other.name.to_lowercase();
            bail!("the board has an {}, not an {}: `cargo xtask flash --board {name}`", other.name, chip.name)
        }
        None => bail!(
            "the board's chip has the ID code {found:#05x}, which is none of {}: nothing was written",
            CHIPS.map(|chip| format!("{} ({:#05x})", chip.name, chip.id)).join(", ")
        ),
    }
}

/// Returns the last word of hexadecimal digits that was printed.
fn id_code(text: &str) -> Option<u32> {
    text.split_whitespace().rev().find_map(|word| u32::from_str_radix(word.trim_start_matches("0x"), 16).ok())
}

fn loader_is_here(chip: &Chip) -> Result<()> {
    if !is_installed(DFU) {
        bail!(NO_DFU_PROGRAM);
    }
    let list = process::output(process::command(DFU, places::root()).arg("-l"))?;
    is_loader(chip, &list)
}

/// Refuses no loader, several, or one of a chip with another flash.
fn is_loader(chip: &Chip, list: &str) -> Result<()> {
    let found: Vec<&str> =
        list.lines().filter(|line| line.contains("[0483:df11]") && line.contains("Internal Flash")).collect();
    let [one] = found.as_slice() else {
        if found.is_empty() {
            bail!(NO_DFU);
        }
        bail!("{} boards are in their loaders: leave one connected", found.len());
    };
    let sectors = one.split_once("*128Kg").and_then(|(before, _)| {
        before.rsplit(|c: char| !c.is_ascii_digit()).next().and_then(|digits| digits.parse().ok())
    });
    if sectors == Some(chip.large_sectors) {
        return Ok(());
    }
    let fitting: Vec<String> = CHIPS
        .iter()
        .filter(|other| Some(other.large_sectors) == sectors)
        .map(|other| format!("`--board {}`", other.name.to_lowercase()))
        .collect();
    let what = if fitting.is_empty() { "it is none of these chips".into() } else { fitting.join(" or ") };
    bail!("the flash of the board in its loader is not that of an {}: {what}; nothing was written", chip.name)
}

/// Returns the bytes of flash from its beginning on, as the loader takes them.
fn flat(elf: &Path) -> Result<Vec<u8>> {
    let bytes = std::fs::read(elf).with_context(|| format!("cannot read {}", elf.display()))?;
    let file = ElfFile32::<object::Endianness>::parse(&*bytes)
        .with_context(|| format!("{} is no program", elf.display()))?;
    let endian = file.endian();
    let mut parts = Vec::new();
    for header in file.elf_program_headers() {
        let data = header.data(endian, &*bytes).ok().context("a segment is cut off")?;
        if header.p_type(endian) == elf::PT_LOAD && !data.is_empty() {
            parts.push((header.p_paddr(endian), data));
        }
    }
    join(&parts)
}

/// Puts parts at their addresses; between them is what erased flash holds.
fn join(parts: &[(u32, &[u8])]) -> Result<Vec<u8>> {
    const MOST: u32 = 1 << 20;
    let mut image = Vec::new();
    for (address, data) in parts {
        let offset = address.checked_sub(FLASH).filter(|offset| *offset < MOST);
        let offset =
            offset.with_context(|| format!("a part of the image lies at {address:#x}, not in flash"))?;
        let end = offset as usize + data.len();
        image.resize(image.len().max(end), 0xff);
        image[offset as usize..end].copy_from_slice(data);
    }
    if image.is_empty() { bail!("the image is empty") } else { Ok(image) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_chip_is_named_with_the_remedy() {
        let [f405, f446, _] = &CHIPS;
        assert!(is_chip(f405, 0x1007_6413).is_ok());
        let error = is_chip(f405, 0x1000_0431).unwrap_err().to_string();
        assert!(error.contains("has an STM32F411, not an STM32F405"), "{error}");
        assert!(error.contains("--board stm32f411"), "{error}");
        let error = is_chip(f446, 0x2003_6410).unwrap_err().to_string();
        assert!(error.contains("0x410") && error.contains("nothing was written"), "{error}");
        assert_eq!(id_code("10076413 \n"), Some(0x1007_6413));
        assert_eq!(id_code("e0042000: 0x10076413"), Some(0x1007_6413));
        assert_eq!(id_code("no such thing"), None);
    }

    /// From the factory all bits are set: off. 0x0fff_aaed and 0x0fff_aae1 differ in the level alone.
    #[test]
    fn a_chip_whose_brown_out_reset_is_off_is_not_called_ready() {
        assert!(guards_supply(0x0fff_aae1).is_ok());
        let error = guards_supply(0x0fff_aaed).unwrap_err().to_string();
        assert!(error.contains("level is 0 and not 3"), "{error}");
        assert!(guards_supply(0x0fff_aae5).unwrap_err().to_string().contains("level is 2"));
    }

    #[test]
    fn a_loader_is_known_by_its_flash() {
        let line = |sectors: &str| {
            format!(
                "Found DFU: [0483:df11] ver=2200, devnum=5, cfg=1, intf=0, path=\"1-2\", alt=0, \
                 name=\"@Internal Flash  /0x08000000/04*016Kg,01*064Kg,{sectors}*128Kg\", serial=\"34\"\n"
            )
        };
        let other = "Found DFU: [0483:df11] ver=2200, alt=1, name=\"@Option Bytes  /0x1FFFC000/01*016 e\"\n";
        let [f405, f446, _] = &CHIPS;
        assert!(is_loader(f405, &(line("07") + other)).is_ok());
        assert!(is_loader(f446, &line("03")).is_ok());
        let error = is_loader(f405, &line("03")).unwrap_err().to_string();
        assert!(error.contains("--board stm32f446` or `--board stm32f411"), "{error}");
        assert!(is_loader(f405, &line("11")).unwrap_err().to_string().contains("none of these chips"));
        assert!(is_loader(f405, other).unwrap_err().to_string().contains("hold BOOT0"));
        let two = line("07") + &line("07");
        assert!(is_loader(f405, &two).unwrap_err().to_string().contains("leave one connected"));
    }

    #[test]
    fn an_image_begins_where_flash_does_and_gaps_are_erased_flash() {
        let parts: [(u32, &[u8]); 2] = [(FLASH, &[1, 2]), (FLASH + 4, &[3])];
        assert_eq!(join(&parts).unwrap(), [1, 2, 0xff, 0xff, 3]);
        assert!(join(&[(0x2000_0000, &[1])]).unwrap_err().to_string().contains("not in flash"));
        assert!(join(&[]).is_err());
        assert_eq!(
            dfu(Path::new("firmware.bin")).join(" "),
            "dfu-util -d 0483:df11 -a 0 -s 0x08000000:leave -D firmware.bin"
        );
    }
}
