//! Markers over time, of which what is not needed any more can be dropped.

use std::ops::Range;

use nalgebra::Vector3;

/// Markers of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Markers {
    count: usize,
    frames: usize,
    /// Frames that are stored: the first of each piece, and its points, frame by frame; NaN where a marker
    /// was not seen.
    pieces: Vec<(usize, Vec<[f32; 3]>)>,
}

impl Markers {
    /// Returns the markers of frames that follow one another, the given number a frame, m; NaN where one was
    /// not seen.
    pub fn new(count: usize, points_m: Vec<[f32; 3]>) -> Self {
        Self { count, frames: points_m.len() / count.max(1), pieces: vec![(0, points_m)] }
    }

    /// Returns the number of frames, dropped ones among them.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Returns a marker in a frame, m; `None` where it was not seen, or the frame was dropped.
    pub fn point(&self, frame: usize, marker: usize) -> Option<Vector3<f64>> {
        let piece = self.pieces.partition_point(|(first, _)| *first <= frame).checked_sub(1)?;
        let (first, points) = self.pieces.get(piece)?;
        let p = points.get((frame - first) * self.count + marker).filter(|_| marker < self.count)?;
        p[0].is_finite().then(|| Vector3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])))
    }

    /// Returns whether no frame of a range, as far as it is in the recording, was dropped.
    pub fn has(&self, range: Range<usize>) -> bool {
        let end = range.end.min(self.frames);
        self.pieces
            .iter()
            .any(|(first, points)| *first <= range.start && end <= first + points.len() / self.count.max(1))
    }

    /// Changes every point.
    pub fn change(&mut self, change: impl Fn([f32; 3]) -> [f32; 3]) {
        self.pieces.iter_mut().flat_map(|(_, points)| points).for_each(|p| *p = change(*p));
    }

    /// Drops all frames but these.
    pub fn keep(&mut self, mut ranges: Vec<Range<usize>>) {
        ranges.sort_by_key(|range| range.start);
        let mut joined: Vec<Range<usize>> = Vec::new();
        for range in ranges.into_iter().map(|range| range.start..range.end.min(self.frames)) {
            match joined.last_mut() {
                Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
                _ => joined.push(range),
            }
        }
        let piece = |range: Range<usize>| {
            let own = |(first, points): &(usize, Vec<[f32; 3]>)| {
                let at = |frame: usize| {
                    frame.saturating_sub(*first).min(points.len() / self.count.max(1)) * self.count
                };
                points.get(at(range.start)..at(range.end)).filter(|own| !own.is_empty()).map(<[_]>::to_vec)
            };
            // What is stored follows one another within one piece.
            Some((range.start, self.pieces.iter().find_map(own)?))
        };
        self.pieces = joined.into_iter().filter(|range| !range.is_empty()).filter_map(piece).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_frames_stay_in_their_places() {
        let all: Vec<[f32; 3]> = (0..40).map(|k| [k as f32, 0.0, 1.0]).collect();
        let whole = Markers::new(2, all);
        let mut some = whole.clone();
        some.keep(vec![12..15, 3..6, 5..7, 19..30, 8..8]);
        assert_eq!((whole.frames(), some.frames()), (20, 20));
        for frame in 0..25 {
            let kept = (3..7).contains(&frame) || (12..15).contains(&frame) || frame == 19;
            for marker in 0..3 {
                let wanted = whole.point(frame, marker);
                assert_eq!(wanted.is_some(), frame < 20 && marker < 2);
                assert_eq!(some.has(frame..frame + 1), kept || frame >= 20);
                assert_eq!(some.point(frame, marker), wanted.filter(|_| kept), "{frame}");
            }
        }
    }
}
