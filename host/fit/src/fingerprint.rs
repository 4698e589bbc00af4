//! Fingerprints: which readings, and which model, a factor is of.

/// A hash over words, FNV-1a with the high half folded in: the same for the same numbers on every machine.
///
/// ```
/// use rigident_fit::Fingerprint;
///
/// let of = |words: [f64; 2]| {
///     let mut hash = Fingerprint::default();
///     words.iter().for_each(|word| hash.add(word.to_bits()));
///     hash.finish()
/// };
/// assert_eq!(of([1.0, 2.0]), of([1.0, 2.0]));
/// assert_ne!(of([1.0, 2.0]), of([2.0, 1.0]));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(u64);

impl Default for Fingerprint {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fingerprint {
    /// Takes a word.
    pub fn add(&mut self, word: u64) {
        // The product alone carries bits upwards only.
        self.0 = (self.0 ^ word).wrapping_mul(0x0000_0100_0000_01b3);
        self.0 ^= self.0 >> 32;
    }

    /// Takes a text, told apart from the one after it.
    pub fn add_text(&mut self, text: &str) {
        self.add(text.len() as u64);
        text.bytes().for_each(|byte| self.add(u64::from(byte)));
    }

    /// Returns the fingerprint of all that was added.
    pub fn finish(self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_of_every_word_counts() {
        let words: Vec<u64> = (0..50).collect();
        let of = |words: &[u64]| {
            let mut hash = Fingerprint::default();
            words.iter().for_each(|word| hash.add(*word));
            hash.finish()
        };
        let mut seen = std::collections::HashSet::from([of(&words), of(&words[1..])]);
        for n in 0..50 {
            for bit in 0..64 {
                let mut other = words.clone();
                other[n] ^= 1 << bit;
                seen.insert(of(&other));
            }
        }
        assert_eq!(seen.len(), 2 + 50 * 64);
    }

    #[test]
    fn texts_are_told_apart_where_one_ends() {
        let of = |texts: [&str; 2]| {
            let mut hash = Fingerprint::default();
            texts.iter().for_each(|text| hash.add_text(text));
            hash.finish()
        };
        assert_ne!(of(["ab", "c"]), of(["a", "bc"]));
    }
}
