use crate::Scalar;
use crate::factor::InformationFactor;

/// The last `K` segments, each counting fully: a sliding window of `K` times a segment's length.
///
/// Holds `K` factors: `K (N² + N + 2)` words (f32: 448 bytes a segment for N = 10, 1 096 for N = 16). Nothing
/// is ever subtracted, so a window that has slid for a year is as good as a new one.
#[derive(Clone, Copy, Debug)]
pub struct Window<T: Scalar, const N: usize, const K: usize> {
    segments: [InformationFactor<T, N>; K],
    next: usize,
}

impl<T: Scalar, const N: usize, const K: usize> Default for Window<T, N, K> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar, const N: usize, const K: usize> Window<T, N, K> {
    /// Returns the window of no segments.
    #[must_use]
    pub fn new() -> Self {
        const { assert!(K > 0, "a window holds at least one segment") }
        Self { segments: [InformationFactor::new(); K], next: 0 }
    }

    /// Takes in a segment; the oldest of more than `K` falls out.
    pub fn take(&mut self, segment: &InformationFactor<T, N>) {
        if let Some(slot) = self.segments.get_mut(self.next) {
            *slot = *segment;
        }
        self.next = (self.next + 1) % K;
    }

    /// Adds to the newest segment.
    pub fn add(&mut self, part: &InformationFactor<T, N>) {
        if let Some(slot) = self.segments.get_mut((self.next + K - 1) % K) {
            slot.merge(part);
        }
    }

    /// Multiplies all rows.
    pub(crate) fn scale(&mut self, by: T) {
        for segment in &mut self.segments {
            segment.scale(by);
        }
    }

    /// Begins a new segment; the oldest of more than `K` falls out.
    pub fn advance(&mut self) {
        self.take(&InformationFactor::EMPTY);
    }

    /// Returns the factor of all segments in the window, merged oldest first.
    #[must_use]
    pub fn factor(&self) -> InformationFactor<T, N> {
        let mut whole = InformationFactor::new();
        for k in 0..K {
            self.fold(k, &mut whole);
        }
        whole
    }

    /// Merges the `k`th oldest segment into a factor.
    pub(crate) fn fold(&self, k: usize, whole: &mut InformationFactor<T, N>) {
        if let Some(segment) = self.segments.get((self.next + k) % K) {
            whole.merge(segment);
        }
    }
}
