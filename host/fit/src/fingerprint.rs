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

    /// Takes a text, separated from the one after it.
    pub fn add_text(&mut self, text: &str) {
        self.add(text.len() as u64);
        text.bytes().for_each(|byte| self.add(u64::from(byte)));
    }

    /// Returns the fingerprint of all that was added.
    pub fn finish(self) -> u64 {
        self.0
    }
}

/// Readings of which the smallest hashes are kept.
pub const READINGS_KEPT: usize = 8;
/// Readings in common that two recordings have to show: a sensor at rest, or frozen, may read one thing
/// twice.
const IN_COMMON: usize = 2;

/// What tells the readings of a run from others.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// The fingerprint of all, times included: that of the same readings, whatever file they are in.
    pub fingerprint: u64,
    /// The smallest hashes of single readings in single precision, in order, times left out: a sample of all,
    /// so that recordings that have a good part of their readings in common show some in common.
    pub sample: Vec<u64>,
}

impl Identity {
    /// Returns the identity of the readings that `each` gives: the time of each, ns, if it has one, and its
    /// numbers.
    pub fn of(each: impl FnOnce(&mut dyn FnMut(Option<u64>, &[f64]))) -> Self {
        let (mut all, mut sample) = (Fingerprint::default(), Vec::with_capacity(READINGS_KEPT + 1));
        each(&mut |time_ns, numbers| {
            time_ns.into_iter().for_each(|time| all.add(time));
            let mut own = Fingerprint::default();
            for number in numbers {
                all.add(number.to_bits());
                // As a device takes it.
                own.add(u64::from((*number as f32).to_bits()));
            }
            let own = own.finish();
            let is_full = sample.len() == READINGS_KEPT;
            if numbers.is_empty() || is_full && sample.last().is_some_and(|largest| own >= *largest) {
                return;
            }
            if let Err(place) = sample.binary_search(&own) {
                sample.insert(place, own);
                sample.truncate(READINGS_KEPT);
            }
        });
        Self { fingerprint: all.finish(), sample }
    }

    /// Returns true if two recordings that are not the same have a good part of their readings in common.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.fingerprint != other.fingerprint
            && self.sample.iter().filter(|own| other.sample.contains(own)).count() >= IN_COMMON
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
    fn texts_are_distinguished_where_one_ends() {
        let of = |texts: [&str; 2]| {
            let mut hash = Fingerprint::default();
            texts.iter().for_each(|text| hash.add_text(text));
            hash.finish()
        };
        assert_ne!(of(["ab", "c"]), of(["a", "bc"]));
    }

    /// Recordings of twelve channels as a generator makes them, of which parts are cut out.
    #[test]
    fn recordings_with_readings_in_common_are_noticed_and_no_others() {
        use rand_chacha::ChaCha8Rng;
        use rand_chacha::rand_core::SeedableRng;
        use rand_distr::{Distribution, StandardNormal};

        let recording = |seed: u64| -> Vec<[f64; 12]> {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            // A rest at first, noise-free, that all recordings share.
            let mut number = |k: usize| if k < 300 { 9.8 } else { StandardNormal.sample(&mut random) };
            (0..2_000).map(|k| std::array::from_fn(|_| number(k))).collect()
        };
        let of = |readings: &[[f64; 12]], first_ns: u64| {
            Identity::of(|take| {
                (first_ns..).zip(readings).for_each(|(time, reading)| take(Some(time), reading));
            })
        };
        let mut found = 0;
        for seed in 0..100 {
            let (own, other) = (recording(seed), recording(seed + 1_000));
            let whole = of(&own, 0);
            assert!(whole == of(&own, 0) && !whole.overlaps(&of(&own, 0)), "the same recording");
            assert!(!whole.overlaps(&of(&other, 0)), "two recordings");
            let narrow: Vec<[f64; 12]> = own.iter().map(|r| r.map(|v| f64::from(v as f32))).collect();
            assert!(whole.overlaps(&of(&narrow, 7)), "in single precision, at other times");
            found += usize::from(whole.overlaps(&of(&own[..1_200], 0)));
        }
        // Of eight in a half of the readings that vary two are missed once in thirty.
        assert!((90..=100).contains(&found), "{found}");
    }
}
