//! Unpacks bzip2, by which bags of ROS 1 may pack their chunks; after Seward's *bzip2* 1.0.8 and the
//! description of its format by Tsai (2016).

use crc::{CRC_32_BZIP2, Crc};

const BLOCK: u64 = 0x3141_5926_5359;
const END: u64 = 0x1772_4538_5090;
/// Symbols that one table codes before the next is selected.
const PER_TABLE: usize = 50;
const LONGEST_CODE: usize = 20;
const TORN: &str = "what bzip2 packed is damaged or cut off";
const SUM: Crc<u32> = Crc::<u32>::new(&CRC_32_BZIP2);

/// Takes bits off bytes, the highest first.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Bits<'_> {
    fn bit(&mut self) -> Result<usize, String> {
        let byte = self.bytes.get(self.at / 8).ok_or(TORN)?;
        let bit = byte >> (7 - self.at % 8) & 1;
        self.at += 1;
        Ok(usize::from(bit))
    }

    fn take(&mut self, count: usize) -> Result<u64, String> {
        let mut value = 0;
        for _ in 0..count {
            value = value << 1 | self.bit()? as u64;
        }
        Ok(value)
    }
}

/// A Huffman code: symbols by the length of their code and their place among those of that length.
struct Code {
    /// The first code of each length, how many there are, and where their symbols begin.
    lengths: [(u32, u32, usize); LONGEST_CODE + 1],
    symbols: Vec<u16>,
}

impl Code {
    fn new(lengths: &[usize]) -> Self {
        let (mut symbols, mut table, mut code) = (Vec::new(), [(0, 0, 0); LONGEST_CODE + 1], 0_u32);
        for (length, entry) in table.iter_mut().enumerate().skip(1) {
            code <<= 1;
            let first = symbols.len();
            symbols.extend((0..lengths.len()).filter(|s| lengths[*s] == length).map(|s| s as u16));
            let count = (symbols.len() - first) as u32;
            *entry = (code, count, first);
            code = code.saturating_add(count);
        }
        Self { lengths: table, symbols }
    }

    fn read(&self, bits: &mut Bits<'_>) -> Result<u16, String> {
        let mut code = 0_u32;
        for (first, count, start) in self.lengths.iter().skip(1) {
            code = code << 1 | bits.bit()? as u32;
            if let Some(place) = code.checked_sub(*first).filter(|place| place < count) {
                return self.symbols.get(start + place as usize).copied().ok_or_else(|| TORN.to_owned());
            }
        }
        Err(TORN.to_owned())
    }
}

/// Unpacks bytes to at most `most`.
///
/// # Errors
/// They are damaged, or unpack to more.
pub(super) fn unpack(bytes: &[u8], most: usize) -> Result<Vec<u8>, String> {
    let level = match bytes {
        [b'B', b'Z', b'h', level @ b'1'..=b'9', ..] => usize::from(level - b'0'),
        _ => return Err(TORN.to_owned()),
    };
    let (mut bits, mut out, mut sum) = (Bits { bytes, at: 32 }, Vec::new(), 0_u32);
    loop {
        let mark = bits.take(48)?;
        let stated = bits.take(32)? as u32;
        match mark {
            BLOCK => {
                let start = out.len();
                let block = block(&mut bits, 100_000 * level)?;
                repeated(&block, most, &mut out)?;
                let own = SUM.checksum(out.get(start..).unwrap_or_default());
                if own != stated {
                    return Err(TORN.to_owned());
                }
                sum = sum.rotate_left(1) ^ own;
            }
            END if sum == stated => return Ok(out),
            _ => return Err(TORN.to_owned()),
        }
    }
}

/// Reads a block: its Huffman codes, its move-to-front list, and the Burrows–Wheeler transform.
fn block(bits: &mut Bits<'_>, longest: usize) -> Result<Vec<u8>, String> {
    if bits.bit()? == 1 {
        return Err("what bzip2 packed is of a version before 1.0: pack it anew".to_owned());
    }
    let origin = bits.take(24)? as usize;
    let used = bits.take(16)?;
    let mut list: Vec<u8> = Vec::new();
    for high in (0..16_u8).filter(|k| used >> (15 - k) & 1 == 1) {
        let own = bits.take(16)?;
        list.extend((0..16_u8).filter(|k| own >> (15 - k) & 1 == 1).map(|low| high * 16 + low));
    }
    let (tables, selectors) = (bits.take(3)? as usize, bits.take(15)? as usize);
    if list.is_empty() || !(2..=6).contains(&tables) || selectors == 0 {
        return Err(TORN.to_owned());
    }
    let (mut order, mut chosen): (Vec<usize>, Vec<usize>) = ((0..tables).collect(), Vec::new());
    for _ in 0..selectors {
        let mut place = 0;
        while bits.bit()? == 1 {
            place += 1;
        }
        if place >= tables {
            return Err(TORN.to_owned());
        }
        let table = order.remove(place);
        order.insert(0, table);
        chosen.push(table);
    }
    let end = list.len() + 1;
    let codes = (0..tables).map(|_| code(bits, end + 1)).collect::<Result<Vec<_>, _>>()?;
    let mut block: Vec<u8> = Vec::new();
    let (mut run, mut weight) = (0_usize, 1_usize);
    for n in 0.. {
        let table = chosen.get(n / PER_TABLE).and_then(|k| codes.get(*k)).ok_or(TORN)?;
        let symbol = usize::from(table.read(bits)?);
        if symbol < 2 {
            run = run.saturating_add(weight << symbol);
            weight = weight.checked_mul(2).filter(|w| *w <= 2 * longest).ok_or(TORN)?;
            continue;
        }
        if run > longest - block.len() {
            return Err(TORN.to_owned());
        }
        let front = *list.first().ok_or(TORN)?;
        block.resize(block.len() + run, front);
        (run, weight) = (0, 1);
        if symbol == end {
            break;
        }
        if block.len() >= longest || symbol > list.len() {
            return Err(TORN.to_owned());
        }
        let byte = list.remove(symbol - 1);
        list.insert(0, byte);
        block.push(byte);
    }
    turned_back(&block, origin)
}

/// Reads the lengths of a table's codes.
fn code(bits: &mut Bits<'_>, symbols: usize) -> Result<Code, String> {
    let (mut length, mut lengths) = (bits.take(5)? as usize, Vec::with_capacity(symbols));
    for _ in 0..symbols {
        loop {
            if !(1..=LONGEST_CODE).contains(&length) {
                return Err(TORN.to_owned());
            }
            if bits.bit()? == 0 {
                break;
            }
            length = if bits.bit()? == 0 { length + 1 } else { length - 1 };
        }
        lengths.push(length);
    }
    Ok(Code::new(&lengths))
}

/// Undoes the Burrows–Wheeler transform.
fn turned_back(last: &[u8], origin: usize) -> Result<Vec<u8>, String> {
    let mut starts = [0_usize; 257];
    for byte in last {
        starts[usize::from(*byte) + 1] += 1;
    }
    for k in 1..starts.len() {
        starts[k] += starts[k - 1];
    }
    let mut next = vec![0_u32; last.len()];
    for (k, byte) in last.iter().enumerate() {
        let place = &mut starts[usize::from(*byte)];
        next[*place] = k as u32;
        *place += 1;
    }
    let mut at = *next.get(origin).ok_or(TORN)? as usize;
    let mut out = Vec::with_capacity(last.len());
    for _ in 0..last.len() {
        out.push(last[at]);
        at = next[at] as usize;
    }
    Ok(out)
}

/// Undoes the first step of packing: four equal bytes are followed by how many more there are.
fn repeated(block: &[u8], most: usize, out: &mut Vec<u8>) -> Result<(), String> {
    let (mut before, mut equal) = (None, 0);
    for byte in block {
        if equal == 4 {
            let count = usize::from(*byte);
            out.resize(out.len() + count, before.unwrap_or(0));
            (before, equal) = (None, 0);
        } else {
            equal = if before == Some(*byte) { equal + 1 } else { 1 };
            before = Some(*byte);
            out.push(*byte);
        }
        if out.len() > most {
            return Err(format!("it unpacks to more than {most} bytes, which no sensor records"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forty times `a`, `banana`, and a line's end, packed by libbz2 1.0.8 at level 9.
    const PACKED: &[u8] = &[
        0x42, 0x5a, 0x68, 0x39, 0x31, 0x41, 0x59, 0x26, 0x53, 0x59, 0x6d, 0x5b, 0x09, 0xeb, 0x00, 0x00, 0x03,
        0x51, 0x00, 0x00, 0x10, 0x04, 0x00, 0x30, 0x01, 0x20, 0x00, 0x30, 0xcd, 0x00, 0xc9, 0xe9, 0xa8, 0x47,
        0xa8, 0x2b, 0x3c, 0x5d, 0xc9, 0x14, 0xe1, 0x42, 0x41, 0xb5, 0x6c, 0x27, 0xac,
    ];

    #[test]
    fn bzip2_data_come_back_and_damage_is_found() {
        let plain = format!("{}banana\n", "a".repeat(40));
        assert_eq!(unpack(PACKED, 1000), Ok(plain.clone().into_bytes()));
        assert!(unpack(PACKED, 20).unwrap_err().contains("more than 20 bytes"));
        for length in 0..PACKED.len() {
            assert!(unpack(&PACKED[..length], 1000).is_err());
        }
        for (k, bit) in (4..PACKED.len()).flat_map(|k| (0..8).map(move |bit| (k, bit))) {
            let mut other = PACKED.to_vec();
            other[k] ^= 1 << bit;
            // Bits that nothing uses leave the same bytes.
            assert!(unpack(&other, 1000).map_or(true, |own| own == plain.as_bytes()), "{k} {bit}");
        }
    }
}
