//! Numbers of samples that run on and wrap, as their senders count them.

/// Tells what the number of a sample says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// It follows the last one.
    Next,
    /// This number between the last one and it is missing.
    After(u64),
    /// It arrived already, or is older than one that did.
    Late,
    /// The sender has begun to count anew.
    Anew,
}

/// Counts samples by numbers of the given number of bits.
#[derive(Clone, Debug)]
pub struct Sequence {
    modulus: u64,
    /// The last number, without wraps.
    last: Option<u64>,
}

/// The distance back at which a number may still be one of a sample that arrived late.
const LATE: u64 = 1000;

impl Sequence {
    /// Starts to count numbers of 1 to 32 bits.
    pub fn new(bits: u32) -> Self {
        Self { modulus: 1 << bits.clamp(1, 32), last: None }
    }

    /// Notes a number, and returns the count that does not wrap with what it says.
    pub fn note(&mut self, number: u64) -> (u64, Order) {
        let number = number % self.modulus;
        let Some(last) = self.last else {
            self.last = Some(number);
            return (number, Order::Next);
        };
        let ahead = (number + self.modulus - last % self.modulus) % self.modulus;
        let behind = self.modulus - ahead;
        let (order, count) = match ahead {
            0 => return (last, Order::Late),
            1 => (Order::Next, last + 1),
            // In a narrow count half the way back is as near as half the way on.
            _ if behind <= LATE.min(self.modulus / 2) => return (last.saturating_sub(behind), Order::Late),
            _ if ahead <= self.modulus / 2 => (Order::After(ahead - 1), last + ahead),
            _ => (Order::Anew, last + 1),
        };
        if order == Order::Anew {
            // Counted on from here, so that times still ascend.
            self.last = Some(number);
            return (number, order);
        }
        self.last = Some(count);
        (count, order)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_gaps_repeats_and_restarts_are_distinguished() {
        let mut bits16 = Sequence::new(16);
        let said: Vec<_> = [65_534, 65_535, 0, 4, 3, 4, 5].map(|n| bits16.note(n)).to_vec();
        let expected = [
            (65_534, Order::Next),
            (65_535, Order::Next),
            (65_536, Order::Next),
            (65_540, Order::After(3)),
            (65_539, Order::Late),
            (65_540, Order::Late),
            (65_541, Order::Next),
        ];
        assert_eq!(said, expected);
        let mut bits32 = Sequence::new(32);
        bits32.note(5_000_000);
        // A box that was switched off and on.
        assert_eq!(bits32.note(1), (1, Order::Anew));
        assert_eq!(bits32.note(2), (2, Order::Next));
        // Numbers beyond their bits are taken as they wrap.
        assert_eq!(Sequence::new(8).note(u64::MAX), (255, Order::Next));
    }
}
