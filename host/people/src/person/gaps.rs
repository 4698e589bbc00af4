//! Markers that were not seen for a moment.

use nalgebra::Vector3;

/// Gaps up to this length are filled, s.
pub const LONGEST_S: f64 = 0.1;

/// Fills short gaps of a marker by the cubic through the two frames on either side; returns how many frames
/// were filled.
///
/// `track` has a place for each frame, m.
pub fn fill(track: &mut [Option<Vector3<f64>>], rate_hz: f64) -> usize {
    let longest = (LONGEST_S * rate_hz).round() as usize;
    let mut filled = 0;
    let mut frame = 0;
    while frame < track.len() {
        if track[frame].is_some() {
            frame += 1;
            continue;
        }
        let end = (frame..track.len()).find(|k| track[*k].is_some()).unwrap_or(track.len());
        let length = end - frame;
        if length <= longest && frame >= 2 && end + 1 < track.len() {
            let around = (track[frame - 2], track[frame - 1], track[end], track[end + 1]);
            if let (Some(a), Some(b), Some(c), Some(d)) = around {
                // Through the frames −1, 0, n and n + 1 (Lagrange).
                let n = (length + 1) as f64;
                for (k, place) in track[frame..end].iter_mut().enumerate() {
                    let t = (k + 1) as f64;
                    *place = Some(
                        a * (-t * (t - n) * (t - n - 1.0) / ((n + 1.0) * (n + 2.0)))
                            + b * ((t + 1.0) * (t - n) * (t - n - 1.0) / (n * (n + 1.0)))
                            + c * ((t + 1.0) * t * (n + 1.0 - t) / (n * (n + 1.0)))
                            + d * ((t + 1.0) * t * (t - n) / ((n + 1.0) * (n + 2.0))),
                    );
                }
                filled += length;
            }
        }
        frame = end;
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_gap_is_filled_by_its_cubic_and_a_long_one_is_left() {
        let at = |k: usize| {
            let t = k as f64 / 100.0;
            Vector3::new(1.0 + t, t * t, (6.0 * t).sin())
        };
        let mut track: Vec<Option<Vector3<f64>>> = (0..100).map(|k| Some(at(k))).collect();
        track[20..25].fill(None);
        track[50..70].fill(None);
        track[0] = None;
        assert_eq!(fill(&mut track, 100.0), 5);
        for k in 20..25 {
            assert!((track[k].unwrap() - at(k)).norm() < 1e-4, "{k}");
        }
        assert!(track[50..70].iter().all(Option::is_none) && track[0].is_none());
    }
}
