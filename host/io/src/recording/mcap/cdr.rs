//! The plain encoding of ROS 2 messages (CDR, XCDR version 1): aligned binary after a header of four bytes.

/// Why bytes are not the message they should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CdrError {
    /// The header names another encoding.
    #[error("the message is encoded as {0:#06x}, not as plain CDR")]
    Encoding(u16),
    /// The message is packed by itself.
    #[error(
        "the message is packed by itself (zstd), as ROS 2 records in its compression mode `message`: give the \
         folder of the bag with its metadata.yaml"
    )]
    Packed,
    /// Bytes are missing.
    #[error("the message is cut off after {0} bytes")]
    CutOff(usize),
    /// A list is not as long as that of the names.
    #[error("it names {names} joints and has {values} values of one kind")]
    Count {
        /// Names.
        names: usize,
        /// Values.
        values: usize,
    },
    /// A text is not UTF-8.
    #[error("a text in the message is not UTF-8")]
    Text,
}

/// Begins what zstd packed.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// Length of the header that names the encoding; alignment counts from its end.
const HEADER: usize = 4;

/// Builds a little-endian message.
#[derive(Debug, Clone)]
pub struct CdrWriter {
    bytes: Vec<u8>,
}

impl Default for CdrWriter {
    fn default() -> Self {
        Self { bytes: vec![0, 1, 0, 0] }
    }
}

impl CdrWriter {
    fn align(&mut self, to: usize) {
        let past = (self.bytes.len() - HEADER) % to;
        if past != 0 {
            self.bytes.resize(self.bytes.len() + to - past, 0);
        }
    }

    /// Writes a `uint32`.
    pub fn u32(&mut self, value: u32) -> &mut Self {
        self.align(4);
        self.bytes.extend_from_slice(&value.to_le_bytes());
        self
    }

    /// Writes an `int32`.
    pub fn i32(&mut self, value: i32) -> &mut Self {
        self.align(4);
        self.bytes.extend_from_slice(&value.to_le_bytes());
        self
    }

    /// Writes a fixed number of `float64`s.
    pub fn f64s(&mut self, values: &[f64]) -> &mut Self {
        for value in values {
            self.align(8);
            self.bytes.extend_from_slice(&value.to_le_bytes());
        }
        self
    }

    /// Writes a `string`.
    pub fn string(&mut self, text: &str) -> &mut Self {
        // A text beyond 4 GiB does not come up: cells of a file are far shorter.
        self.u32(u32::try_from(text.len() + 1).unwrap_or(u32::MAX));
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
        self
    }

    /// Returns the message.
    pub fn finish(self) -> Vec<u8> {
        self.bytes
    }
}

/// Takes a message of either byte order apart.
#[derive(Debug, Clone)]
pub struct CdrReader<'a> {
    bytes: &'a [u8],
    at: usize,
    little: bool,
}

impl<'a> CdrReader<'a> {
    /// Reads the header.
    ///
    /// # Errors
    /// There is none, or it names another encoding.
    pub fn new(message: &'a [u8]) -> Result<Self, CdrError> {
        let (header, bytes) = message.split_first_chunk::<HEADER>().ok_or(CdrError::CutOff(message.len()))?;
        let encoding = u16::from_be_bytes([header[0], header[1]]);
        match encoding {
            0 | 1 => Ok(Self { bytes, at: 0, little: encoding == 1 }),
            _ if message.starts_with(&ZSTD) => Err(CdrError::Packed),
            other => Err(CdrError::Encoding(other)),
        }
    }

    fn take<const K: usize>(&mut self) -> Result<[u8; K], CdrError> {
        let start = self.at.next_multiple_of(K);
        let bytes = self
            .bytes
            .get(start..)
            .and_then(|rest| rest.first_chunk::<K>())
            .ok_or(CdrError::CutOff(self.bytes.len() + HEADER))?;
        self.at = start + K;
        Ok(*bytes)
    }

    /// Reads a `uint32`.
    ///
    /// # Errors
    /// The message is cut off.
    pub fn u32(&mut self) -> Result<u32, CdrError> {
        let bytes = self.take::<4>()?;
        Ok(if self.little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    /// Reads an `int32`.
    ///
    /// # Errors
    /// The message is cut off.
    pub fn i32(&mut self) -> Result<i32, CdrError> {
        self.u32().map(|v| v.cast_signed())
    }

    /// Reads a `float64`.
    ///
    /// # Errors
    /// The message is cut off.
    pub fn f64(&mut self) -> Result<f64, CdrError> {
        let bytes = self.take::<8>()?;
        Ok(if self.little { f64::from_le_bytes(bytes) } else { f64::from_be_bytes(bytes) })
    }

    /// Reads a fixed number of `float64`s.
    ///
    /// # Errors
    /// The message is cut off.
    pub fn f64s<const K: usize>(&mut self) -> Result<[f64; K], CdrError> {
        let mut values = [0.0; K];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    /// Reads a `string`.
    ///
    /// # Errors
    /// The message is cut off, or the text is not UTF-8.
    pub fn string(&mut self) -> Result<&'a str, CdrError> {
        let length = self.u32()? as usize;
        let bytes = self
            .bytes
            .get(self.at..)
            .and_then(|rest| rest.get(..length))
            .ok_or(CdrError::CutOff(self.bytes.len() + HEADER))?;
        self.at += length;
        // The terminating zero counts; some writers leave an empty text without one.
        std::str::from_utf8(bytes.strip_suffix(&[0]).unwrap_or(bytes)).map_err(|_| CdrError::Text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_those_of_the_specification() {
        let mut writer = CdrWriter::default();
        writer.i32(-2).string("S").f64s(&[1.0]).u32(7);
        let expected = [
            0, 1, 0, 0, // little-endian CDR
            0xFE, 0xFF, 0xFF, 0xFF, // −2
            2, 0, 0, 0, b'S', 0, // two bytes with the zero
            0, 0, 0, 0, 0, 0, // up to a multiple of eight
            0, 0, 0, 0, 0, 0, 0xF0, 0x3F, // 1.0
            7, 0, 0, 0,
        ];
        assert_eq!(writer.finish(), expected);
    }

    #[test]
    fn both_byte_orders_are_read() {
        let little = [0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xF0, 0x3F];
        let big = [0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0x3F, 0xF0, 0, 0, 0, 0, 0, 0];
        for bytes in [little, big] {
            let mut reader = CdrReader::new(&bytes).unwrap();
            assert_eq!((reader.u32(), reader.f64()), (Ok(1), Ok(1.0)));
            assert_eq!(reader.f64(), Err(CdrError::CutOff(20)));
        }
        assert_eq!(CdrReader::new(&[0, 7, 0, 0]).unwrap_err(), CdrError::Encoding(7));
        assert_eq!(CdrReader::new(&[0x28, 0xb5, 0x2f, 0xfd, 4]).unwrap_err(), CdrError::Packed);
        assert_eq!(CdrReader::new(&[0]).unwrap_err(), CdrError::CutOff(1));
    }
}
