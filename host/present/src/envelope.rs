//! Long series made short without losing their extremes.

/// Returns a series with at most `2 · buckets` points: the smallest and the largest value of each bucket of
/// time, in the order in which they occur. A series that is short enough is returned as it is. Values that
/// are not finite break the line: one point `(time, NaN)` represents a bucket of them.
pub fn envelope(time_s: &[f64], values: &[f64], buckets: usize) -> Vec<(f64, f64)> {
    envelope_of(time_s.len().min(values.len()), |k| (time_s[k], values[k]), buckets)
}

/// Returns the [`envelope`] of `count` points, `of(k)` being the time and the value of one: a long series is
/// held nowhere.
pub fn envelope_of(count: usize, of: impl Fn(usize) -> (f64, f64), buckets: usize) -> Vec<(f64, f64)> {
    let buckets = buckets.max(1);
    let points = || (0..count).map(&of).filter(|(t, _)| t.is_finite());
    let finite = |p: (f64, f64)| if p.1.is_finite() { p } else { (p.0, f64::NAN) };
    let (Some(first), Some(last)) = (points().next(), (0..count).rev().map(&of).find(|p| p.0.is_finite()))
    else {
        return Vec::new();
    };
    if points().nth(2 * buckets).is_none() {
        return points().map(finite).collect();
    }
    let mut short = Vec::with_capacity(2 * buckets);
    let (mut bucket, mut own) = (bucket_of(first.0, (first.0, last.0), buckets), Extremes::of(first));
    for point in points().skip(1) {
        let next = bucket_of(point.0, (first.0, last.0), buckets);
        if next > bucket {
            own.put_into(&mut short);
            (bucket, own) = (next, Extremes::of(point));
        } else {
            own.add(point);
        }
    }
    own.put_into(&mut short);
    short
}

/// The first point of a bucket, its first smallest and its last largest finite value.
struct Extremes {
    first: (f64, f64),
    range: Option<[(f64, f64); 2]>,
}

impl Extremes {
    fn of(first: (f64, f64)) -> Self {
        Self { first, range: Some([first; 2]).filter(|_| first.1.is_finite()) }
    }

    fn add(&mut self, point: (f64, f64)) {
        if !point.1.is_finite() {
            return;
        }
        let [low, high] = self.range.get_or_insert([point; 2]);
        if point.1.total_cmp(&low.1).is_lt() {
            *low = point;
        }
        if point.1.total_cmp(&high.1).is_ge() {
            *high = point;
        }
    }

    fn put_into(&self, short: &mut Vec<(f64, f64)>) {
        match self.range {
            Some([low, high]) if low.1 == high.1 => short.push(low),
            Some([low, high]) if low.0 <= high.0 => short.extend([low, high]),
            Some([low, high]) => short.extend([high, low]),
            None => short.push((self.first.0, f64::NAN)),
        }
    }
}

/// Returns the bucket of a time within a range; a clock that runs backwards stays in the first one.
fn bucket_of(time: f64, (start, end): (f64, f64), buckets: usize) -> usize {
    let span = end - start;
    let share = if span > 0.0 { (time - start) / span } else { 0.0 };
    ((share * buckets as f64) as usize).min(buckets.saturating_sub(1))
}

/// Returns the area that `value ± half_width` covers, as at most `buckets` points (time, low, high); not
/// finite where a bucket holds nothing finite.
pub(super) fn band(
    time_s: &[f64],
    value: &[f64],
    half_width: &[f64],
    buckets: usize,
) -> Vec<(f64, f64, f64)> {
    let points: Vec<(f64, f64, f64)> = time_s
        .iter()
        .zip(value)
        .zip(half_width)
        .filter(|((t, _), _)| t.is_finite())
        .map(|((t, v), h)| (*t, v - h, v + h))
        .collect();
    let covered = |group: &[(f64, f64, f64)]| {
        let low = extremes(group.iter().map(|p| p.1)).map_or(f64::NAN, |range| range.0);
        let high = extremes(group.iter().map(|p| p.2)).map_or(f64::NAN, |range| range.1);
        group.last().map(|p| (p.0, low, high))
    };
    by_time(&points, |p| p.0, buckets).into_iter().filter_map(covered).collect()
}

/// Cuts consecutive points at equal steps of time into at most `buckets` groups, none of them empty.
fn by_time<P>(points: &[P], time: impl Fn(&P) -> f64, buckets: usize) -> Vec<&[P]> {
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return Vec::new() };
    let range = (time(first), time(last));
    let bucket_of = |p: &P| bucket_of(time(p), range, buckets);
    let mut groups = Vec::new();
    let mut rest = points;
    while let Some(head) = rest.first() {
        let bucket = bucket_of(head);
        let length = rest.iter().take_while(|p| bucket_of(p) <= bucket).count().max(1);
        let (group, tail) = rest.split_at(length);
        groups.push(group);
        rest = tail;
    }
    groups
}

/// Returns the smallest and the largest finite value.
pub(super) fn extremes(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|v| v.is_finite()).fold(None, |range, v| {
        let (low, high) = range.unwrap_or((v, v));
        Some((low.min(v), high.max(v)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a short pseudo-random sequence of the textbook's linear congruence.
    fn noise(n: usize) -> Vec<f64> {
        let mut state = 1_u32;
        (0..n)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(state) / f64::from(u32::MAX) - 0.5
            })
            .collect()
    }

    #[test]
    fn every_buckets_extremes_survive_and_nothing_is_invented() {
        let n = 60_000;
        let time: Vec<f64> = (0..n).map(|i| i as f64 * 1e-3).collect();
        let mut values = noise(n);
        values[31_234] = 50.0;
        values[45_678] = -70.0;
        let short = envelope(&time, &values, 500);
        assert!(short.len() <= 1000);
        assert!(short.windows(2).all(|w| w[0].0 <= w[1].0));
        assert!(short.contains(&(time[31_234], 50.0)) && short.contains(&(time[45_678], -70.0)));
        for point in &short {
            let i = (point.0 * 1e3).round() as usize;
            assert_eq!(*point, (time[i], values[i]));
        }
        // The oracle: any window as wide as two buckets holds at least one whole bucket, whose range is
        // shown.
        for window in 0..250 {
            let (from, to) = (window as f64 * 0.24, (window as f64 + 1.0) * 0.24);
            let shown = short.iter().filter(|p| (from - 0.12..to + 0.12).contains(&p.0)).map(|p| p.1);
            let all = time.iter().zip(&values).filter(|(t, _)| (from..to).contains(*t)).map(|(_, v)| *v);
            let (shown, all) = (extremes(shown).unwrap(), extremes(all).unwrap());
            assert!(shown.0 <= all.0 && shown.1 >= all.1);
        }
    }

    #[test]
    fn short_series_are_untouched() {
        let time = [0.0, 1.0, 2.0];
        assert_eq!(envelope(&time, &[3.0, 1.0, 2.0], 2), [(0.0, 3.0), (1.0, 1.0), (2.0, 2.0)]);
        assert!(envelope(&[], &[], 5).is_empty());
        assert!(envelope(&time, &[], 5).is_empty());
    }

    #[test]
    fn gaps_break_the_line_and_bad_clocks_do_no_harm() {
        let time: Vec<f64> = (0..100).map(f64::from).collect();
        let values: Vec<f64> = (0..100).map(|i| if i < 50 { f64::NAN } else { f64::from(i) }).collect();
        let short = envelope(&time, &values, 10);
        assert!(short.iter().filter(|p| p.0 < 50.0).all(|p| p.1.is_nan()));
        assert_eq!(short.last(), Some(&(99.0, 99.0)));
        // Equal, backward and missing times: still every extreme, never a panic.
        for time in [vec![1.0; 100], (0..100).map(|i| -f64::from(i)).collect(), vec![f64::NAN; 100]] {
            let short = envelope(&time, &(0..100).map(f64::from).collect::<Vec<_>>(), 10);
            let range = extremes(short.iter().map(|p| p.1));
            assert!(range.is_none() || range == Some((0.0, 99.0)));
        }
    }
}
