//! The evidence of a channel's own readings about its sensor: one that never changes is dead, a lone reading
//! far off its neighbours is a spike, and of many at one extreme value the sensor is saturated.
//!
//! A single bad reading on the device is [`rigident_shared::screening`]'s; here the whole recording is there
//! to compare it with.

use super::columns::{Group, Known};
use super::{ImuColumns, Recording};

/// Endings of joints' columns: efforts,
const EFFORTS: [&str; 2] = ["_nm", "_n"];
/// and their motion.
const MOTION: [&str; 4] = ["_rad", "_radps", "_m", "_mps"];
/// Fewer rows say nothing of a channel.
const LEAST_ROWS: usize = 50;
/// A spike is this many times as far from the mean of its two neighbours as white noise is on average.
const SPIKE_SD: f64 = 20.0;
/// And this many times as far as any other reading near it: noise comes near two there, and smooth motion
/// near one.
const SPIKE_SHARE: f64 = 8.0;
/// Readings on either side that may belong to the same spike, and up to which others are compared.
const OWN: usize = 3;
const NEAR: usize = 12;
/// The standard deviation of normal noise over the median of its size.
const MEDIAN_TO_SD: f64 = 1.0 / 0.674_489_75;

/// Readings at the limit of a saturated channel at least, and over those at any of this many values next to
/// it: of a motion that turns there half as many are at the next value.
const LEAST_AT_LIMIT: usize = 8;
const AT_LIMIT: usize = 5;
const NEXT: usize = 20;
/// Noise of a channel over the step between its values, at least: with less it may rest at its extreme value.
const LEAST_STEP: f64 = 0.5;

/// At this share of its stated range a channel is rejected as saturated.
const NEARLY: f64 = 0.999;

/// Noise of a sensor over what its channel does, at least.
const LEAST_NOISE: f64 = 1e-5;

/// One column of a sensor.
#[derive(Clone)]
struct Channel {
    name: String,
    values: Vec<f64>,
}

impl Channel {
    fn is_dead(&self) -> bool {
        self.values.windows(2).all(|pair| matches!(pair, [a, b] if a == b))
    }

    /// Returns true if there is noise.
    fn is_noisy(&self) -> bool {
        self.noise().is_some()
    }

    /// Returns the standard deviation of the noise, if neighbouring readings are apart as noise is, up and
    /// down in turn, and not as a smooth motion is: of the fourth differences of white noise four in five
    /// have another sign than the one before (their correlation is −0.8), of a motion's hardly any. Decimals
    /// that a file lacks are noise of less than [`LEAST_NOISE`] of what the channel does.
    fn noise(&self) -> Option<f64> {
        let fourth = |w: &[f64]| match w {
            [a, b, c, d, e] => a - 4.0 * b + 6.0 * c - 4.0 * d + e,
            _ => 0.0,
        };
        let differences: Vec<f64> = self.values.windows(5).map(fourth).collect();
        let turns = differences.iter().zip(differences.iter().skip(1)).filter(|(a, b)| *a * *b < 0.0).count();
        let mut sizes: Vec<f64> = differences.iter().map(|d| d.abs()).collect();
        let middle = sizes.len() / 2;
        if sizes.is_empty() || 2 * turns < sizes.len() {
            return None;
        }
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        // 1 + 16 + 36 + 16 + 1
        let noise = MEDIAN_TO_SD * median / 70_f64.sqrt();
        let count = self.values.len() as f64;
        let mean = self.values.iter().sum::<f64>() / count;
        let variance = self.values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
        Some(noise).filter(|noise| *noise > LEAST_NOISE * variance.sqrt())
    }

    /// Returns the limits at which the channel is saturated: extreme values that are read many times, where
    /// the values next to them, which noise makes as likely, are read seldom.
    fn limits(&self) -> Vec<f64> {
        let extremes = [f64::max as fn(f64, f64) -> f64, f64::min];
        let extremes = extremes.map(|of| self.values.iter().copied().reduce(of).unwrap_or(f64::NAN));
        // One stretch of equal readings is a channel that froze, which is judged elsewhere.
        let often = |limit: &f64| {
            let stretches = self.values.chunk_by(|a, b| a == b).filter(|own| own[0] == *limit);
            let (count, readings) =
                stretches.fold((0, 0), |(n, readings), own| (n + 1, readings + own.len()));
            count > 1 && readings >= LEAST_AT_LIMIT
        };
        let mut limits: Vec<f64> = extremes.into_iter().filter(often).collect();
        if limits.is_empty() {
            return limits;
        }
        let Some(noise) = self.noise() else { return Vec::new() };
        let mut sorted = self.values.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        limits.retain(|limit| {
            let mut values: Vec<&[f64]> = sorted.chunk_by(|a, b| a == b).collect();
            if values.last().and_then(|own| own.first()) == Some(limit) {
                values.reverse();
            }
            let next = values.iter().skip(1).take(NEXT);
            let often = next.clone().map(|own| own.len()).max().unwrap_or(usize::MAX);
            let steps = next.clone().zip(next.skip(1)).map(|(a, b)| (a[0] - b[0]).abs());
            let step = steps.fold(f64::INFINITY, f64::min);
            values.first().is_some_and(|own| own.len() >= AT_LIMIT.saturating_mul(often))
                && noise >= LEAST_STEP * step
        });
        limits
    }

    /// Returns the rows that hold a spike, in order; `is_even` tells of each row if none is missing beside
    /// it.
    fn spikes(&self, is_even: &[bool]) -> Vec<usize> {
        let x = &self.values;
        // From the mean of both neighbours; zero where a row is missing beside it.
        let off: Vec<f64> = (0..x.len())
            .map(|i| match (i.checked_sub(1).and_then(|k| x.get(k)), x.get(i), x.get(i + 1)) {
                (Some(a), Some(b), Some(c)) if is_even.get(i) == Some(&true) => b - 0.5 * (a + c),
                _ => 0.0,
            })
            .collect();
        let mut sizes: Vec<f64> = off.iter().map(|d| d.abs()).filter(|d| *d > 0.0).collect();
        let middle = sizes.len() / 2;
        if sizes.len() < LEAST_ROWS {
            return Vec::new();
        }
        let sd = MEDIAN_TO_SD * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        let is_spike = |i: usize| {
            let d = off.get(i).map_or(0.0, |d| d.abs());
            if d <= SPIKE_SD * sd {
                return false;
            }
            let near = (OWN + 1..=NEAR).flat_map(|k| [i.checked_sub(k), Some(i + k)]).flatten();
            let largest = near.filter_map(|j| off.get(j)).fold(0.0_f64, |m, v| m.max(v.abs()));
            // What stays changed is a step, and no spike.
            let (before, after) = (i.checked_sub(OWN).and_then(|k| x.get(k)), x.get(i + OWN));
            let returns = matches!((before, after), (Some(a), Some(b)) if (a - b).abs() < d);
            d > SPIKE_SHARE * largest && returns
        };
        (0..x.len()).filter(|i| is_spike(*i)).collect()
    }
}

/// Returns the names of a sensor's channels that are dead beside live ones with noise; `channels` goes
/// through them once more at every call, so that no two of a long recording are held at once.
fn dead<I: Iterator<Item = Channel>>(channels: impl Fn() -> I) -> Vec<String> {
    let dead: Vec<String> = channels().filter(Channel::is_dead).map(|channel| channel.name).collect();
    if dead.is_empty() {
        return dead;
    }
    let mut live = channels().filter(|channel| !channel.is_dead()).peekable();
    if live.peek().is_some() && live.all(|channel| channel.is_noisy()) { dead } else { Vec::new() }
}

impl Recording {
    /// Returns the names of channels that never change, to the last digit, while all others of their sensor
    /// have noise: a sensor's own. Of a recording without noise nothing is said, nor of a sensor that is
    /// still as a whole.
    pub fn dead_channels(&self) -> Vec<String> {
        if self.is_static || self.rows() < LEAST_ROWS {
            return Vec::new();
        }
        let mut names = Vec::new();
        let own = |group: &&Group| !self.derived.contains(group);
        for sensor in self.sensors() {
            let groups: Vec<Group> = sensor.iter().filter(own).copied().collect();
            if !groups.iter().any(|group| self.has_still(*group)) {
                continue;
            }
            names.extend(dead(|| groups.iter().flat_map(|group| self.channels(*group))));
        }
        let joints = self.joint_channels(&EFFORTS);
        names.extend(dead(|| joints.iter().cloned()));
        names
    }

    /// Returns pairs of channels of one sensor that are the same in every row, to the last digit, and have
    /// noise: one was copied into the other's column.
    pub fn copied_channels(&self) -> Vec<[String; 2]> {
        if self.is_static || self.rows() < LEAST_ROWS {
            return Vec::new();
        }
        let mut pairs = Vec::new();
        let own = |group: &Group| !self.derived.contains(group);
        for group in self.sensors().into_iter().flatten().filter(own) {
            let names = group.names();
            let count = names.len();
            let of = |i: usize, j: usize| self.are_alike(group, i, j);
            let each = (0..count).flat_map(|j| (0..j).map(move |i| (i, j))).filter(|(i, j)| of(*i, *j));
            let noisy = |(i, _): &(usize, usize)| {
                let channel = Channel { name: String::new(), values: self.column(group, *i) };
                !channel.is_dead() && channel.is_noisy()
            };
            let named = |(i, j): (usize, usize)| Some([names.get(i)?.clone(), names.get(j)?.clone()]);
            pairs.extend(each.filter(noisy).filter_map(named));
        }
        pairs
    }

    /// Leaves out the rows in which an IMU's channel, or a joint's position or rate, has a spike, and those
    /// in which a channel of the load cell or an IMU is saturated at a limit that is not stated; tells of
    /// them by channel. Spikes of wrench and efforts stay: rows that they have spoilt weigh less in the fit.
    pub fn leave_out_bad_readings(&mut self) {
        if self.is_static || self.rows() < LEAST_ROWS {
            return;
        }
        let mut out = vec![false; self.rows()];
        let mut said = self.saturated(&mut out);
        said.extend(self.spikes(&mut out));
        if !said.is_empty() {
            self.keep_rows(&out.iter().map(|o| !o).collect::<Vec<_>>());
            self.warnings.extend(said);
        }
    }

    /// Marks the rows that hold a spike; returns what to know of them.
    fn spikes(&self, out: &mut [bool]) -> Vec<String> {
        let period_ns = self.rate_hz.map_or(f64::INFINITY, |rate| 1e9 / rate);
        let is_even = |i: usize| {
            let step = |from: usize| {
                let (a, b) = (self.time_ns.get(from), self.time_ns.get(from + 1));
                matches!((a, b), (Some(a), Some(b)) if (b.saturating_sub(*a) as f64) < 1.5 * period_ns)
            };
            i > 0 && step(i - 1) && step(i)
        };
        let is_even: Vec<bool> = (0..self.rows()).map(is_even).collect();
        let mut said = Vec::new();
        let imus = self.sensors().into_iter().skip(1).flatten();
        let joints = self.joint_channels(&MOTION);
        for channel in imus.flat_map(|group| self.channels(group)).chain(joints) {
            let rows = channel.spikes(&is_even);
            let Some(first) = rows.first() else { continue };
            said.push(format!(
                "{} of {} far off all others near, as no motion takes it, the first in {}: left out; check \
                 that sensor's cable and supply",
                if rows.len() == 1 { "1 reading".to_owned() } else { format!("{} readings", rows.len()) },
                format_args!("{} {}", channel.name, if rows.len() == 1 { "is" } else { "are" }),
                self.place(*first),
            ));
            rows.iter().filter_map(|row| out.get_mut(*row).map(|o| *o = true)).for_each(drop);
        }
        said
    }

    /// Marks the rows in which a channel is saturated at a limit that is not stated; returns what to know of
    /// them. At a stated range rows are rejected later.
    fn saturated(&self, out: &mut [bool]) -> Vec<String> {
        let mut said = Vec::new();
        let own = |group: &Group| !self.derived.contains(group);
        for group in self.sensors().into_iter().flatten().filter(own) {
            let key = match group {
                Group::Wrench => "range_n_nm",
                Group::Accel(_) => "range_mps2",
                _ => "range_radps",
            };
            for (k, channel) in self.channels(group).enumerate() {
                let stated = self.range(group, k);
                for limit in channel.limits().into_iter().filter(|limit| limit.abs() < NEARLY * stated) {
                    let rows = channel.values.iter().zip(out.iter_mut()).filter(|(v, _)| **v == limit);
                    let count = rows.map(|(_, out)| *out = true).count();
                    said.push(format!(
                        "{count} readings of {} are all {limit}, its extreme value: the channel is saturated \
                         there, and they are left out. Give its range as {key} in the rig file, or load it less",
                        channel.name
                    ));
                }
            }
        }
        said
    }

    /// Returns the stated range of a channel of a group; infinite if there is none.
    fn range(&self, group: Group, channel: usize) -> f64 {
        let stated = match group {
            Group::Wrench => self.rig.load_cell.range_n_nm.and_then(|range| range.get(channel).copied()),
            Group::Accel(link) => self.rig.imu_on(link).and_then(|imu| imu.range_mps2),
            Group::Gyro(link) => self.rig.imu_on(link).and_then(|imu| imu.range_radps),
            _ => None,
        };
        stated.unwrap_or(f64::INFINITY)
    }

    /// Returns true if one of the channels of a group may never change: seldom more than two rows are looked
    /// at.
    fn has_still(&self, group: Group) -> bool {
        let number = |k: usize, row: usize| self.number(Known::Member(group, k), row);
        let is_still = |k: usize| (1..self.rows()).all(|row| number(k, row - 1) == number(k, row));
        (0..group.names().len()).any(is_still)
    }

    /// Returns true if two channels of a group are the same in every row.
    fn are_alike(&self, group: Group, one: usize, other: usize) -> bool {
        let number = |k: usize, row: usize| self.number(Known::Member(group, k), row);
        (0..self.rows()).all(|row| number(one, row) == number(other, row))
    }

    /// Returns the groups of columns of each sensor: the load cell, every IMU.
    fn sensors(&self) -> Vec<Vec<Group>> {
        let imus = (0..self.imus.len()).map(|j| vec![Group::Accel(j), Group::Gyro(j)]);
        let there: Vec<Group> = self.groups().into_iter().map(|(group, _)| group).collect();
        let sensors = std::iter::once(vec![Group::Wrench]).chain(imus);
        sensors.map(|groups| groups.into_iter().filter(|group| there.contains(group)).collect()).collect()
    }

    /// Returns the joints' columns whose names end so, as far as they hold numbers.
    fn joint_channels(&self, endings: &[&str]) -> Vec<Channel> {
        let own = |name: &&(String, Vec<String>)| endings.iter().any(|ending| name.0.ends_with(ending));
        let numbers = |(name, cells): &(String, Vec<String>)| {
            let values = cells.iter().map(|cell| cell.trim().parse().ok()).collect::<Option<Vec<f64>>>()?;
            Some(Channel { name: name.clone(), values })
        };
        self.extra.iter().filter(own).filter_map(numbers).collect()
    }

    /// Returns a group's channels, one after the other: of a long recording no two are copied at once.
    fn channels(&self, group: Group) -> impl Iterator<Item = Channel> {
        group
            .names()
            .into_iter()
            .enumerate()
            .map(move |(k, name)| Channel { name, values: self.column(group, k) })
    }

    /// Keeps the given number of rows, the first ones.
    pub fn keep_first(&mut self, rows: usize) {
        let keep: Vec<bool> = (0..self.rows()).map(|row| row < rows).collect();
        self.keep_rows(&keep);
    }

    /// Returns the recording of some of its rows.
    #[must_use]
    pub fn section(&self, rows: std::ops::Range<usize>) -> Self {
        fn part<T: Clone>(all: &[T], rows: &std::ops::Range<usize>) -> Vec<T> {
            all.get(rows.start.min(all.len())..rows.end.min(all.len())).unwrap_or_default().to_vec()
        }
        fn some<T: Clone>(all: &Option<Vec<T>>, rows: &std::ops::Range<usize>) -> Option<Vec<T>> {
            all.as_ref().map(|all| part(all, rows))
        }
        let rows = &rows;
        let of_imu =
            |imu: &ImuColumns| ImuColumns { accel: some(&imu.accel, rows), gyro: some(&imu.gyro, rows) };
        Self {
            time_ns: part(&self.time_ns, rows),
            exact_time_s: some(&self.exact_time_s, rows),
            wrench: some(&self.wrench, rows),
            imus: self.imus.iter().map(of_imu).collect(),
            gravity: some(&self.gravity, rows),
            gravity_attitudes: part(&self.gravity_attitudes, rows),
            gauges: some(&self.gauges, rows),
            platform: some(&self.platform, rows),
            commanded: some(&self.commanded, rows),
            attitudes: self.attitudes.iter().map(|(j, all)| (*j, part(all, rows))).collect(),
            extra: self.extra.iter().map(|(name, cells)| (name.clone(), part(cells, rows))).collect(),
            name: self.name.clone(),
            rig: self.rig.clone(),
            rig_text: self.rig_text.clone(),
            is_static: self.is_static,
            rate_hz: self.rate_hz,
            derived: self.derived.clone(),
            comments: self.comments.clone(),
            order: self.order.clone(),
            warnings: self.warnings.clone(),
            assumed: self.assumed.clone(),
            first_line: self.first_line,
        }
    }

    /// Returns the recording of the means of each `by` rows, of load cell, IMUs and gravity columns alone.
    #[must_use]
    pub fn thinned(&self, by: usize) -> Self {
        fn means<const N: usize>(rows: &[[f64; N]], by: usize) -> Vec<[f64; N]> {
            let mean = |part: &[[f64; N]]| {
                std::array::from_fn(|k| part.iter().map(|row| row[k]).sum::<f64>() / by as f64)
            };
            rows.chunks_exact(by.max(1)).map(mean).collect()
        }
        let three = |rows: &Option<Vec<[f64; 3]>>| rows.as_ref().map(|rows| means(rows, by));
        let middle = |part: &[u64]| {
            let first = part.first().copied().unwrap_or_default();
            first + part.iter().map(|time| time - first).sum::<u64>() / by as u64
        };
        let of_imu = |imu: &ImuColumns| ImuColumns { accel: three(&imu.accel), gyro: three(&imu.gyro) };
        Self {
            name: self.name.clone(),
            rig: self.rig.clone(),
            rig_text: self.rig_text.clone(),
            time_ns: self.time_ns.chunks_exact(by.max(1)).map(middle).collect(),
            rate_hz: self.rate_hz.map(|rate_hz| rate_hz / by as f64),
            wrench: self.wrench.as_ref().map(|rows| means(rows, by)),
            gauges: self.gauges.as_ref().map(|rows| means(rows, by)),
            imus: self.imus.iter().map(of_imu).collect(),
            gravity: three(&self.gravity),
            derived: self.derived.clone(),
            ..Self::default()
        }
    }

    /// Keeps the rows for which it is said so.
    fn keep_rows(&mut self, keep: &[bool]) {
        fn kept<T>(rows: &mut Vec<T>, keep: &[bool]) {
            let mut is_kept = keep.iter();
            rows.retain(|_| is_kept.next().copied().unwrap_or(true));
        }
        kept(&mut self.time_ns, keep);
        self.exact_time_s.iter_mut().for_each(|rows| kept(rows, keep));
        self.wrench.iter_mut().for_each(|rows| kept(rows, keep));
        for imu in &mut self.imus {
            imu.accel.iter_mut().chain(&mut imu.gyro).for_each(|rows| kept(rows, keep));
        }
        self.gravity.iter_mut().for_each(|rows| kept(rows, keep));
        kept(&mut self.gravity_attitudes, keep);
        self.gauges.iter_mut().for_each(|rows| kept(rows, keep));
        self.platform.iter_mut().chain(&mut self.commanded).for_each(|rows| kept(rows, keep));
        self.attitudes.iter_mut().for_each(|(_, rows)| kept(rows, keep));
        self.extra.iter_mut().for_each(|(_, cells)| kept(cells, keep));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body that turns and shakes, 100 readings a second, noise of a generator.
    fn recording(noise: f64) -> Recording {
        let mut state = 7_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            noise * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)
        };
        let mut of = |size: f64| -> Vec<[f64; 3]> {
            (0..3000)
                .map(|n| {
                    // At rest, then in motion: noise alone is no measure of what a motion does.
                    let t = f64::from(n) / 100.0;
                    let moves = if t < 10.0 { 0.0 } else { size };
                    std::array::from_fn(|k| moves * (9.0 * t + k as f64).sin() + random())
                })
                .collect()
        };
        let (accel, gyro, force, moment) = (of(2.0), of(1.0), of(20.0), of(1.0));
        Recording {
            time_ns: (0..3000).map(|n| n * 10_000_000).collect(),
            rate_hz: Some(100.0),
            wrench: Some(
                force.iter().zip(&moment).map(|(f, m)| [f[0], f[1], f[2], m[0], m[1], m[2]]).collect(),
            ),
            imus: vec![ImuColumns { accel: Some(accel), gyro: Some(gyro) }],
            ..Recording::default()
        }
    }

    #[test]
    fn two_columns_that_are_one_are_named_where_they_have_noise() {
        let copied = |noise: f64| {
            let mut changed = recording(noise);
            changed.wrench.iter_mut().flatten().for_each(|w| w[4] = w[3]);
            changed.imus[0].gyro.iter_mut().flatten().for_each(|w| w[0] = w[2]);
            changed.copied_channels()
        };
        assert!(recording(0.01).copied_channels().is_empty());
        let pair = |one: &str, other: &str| [one.to_owned(), other.to_owned()];
        assert_eq!(copied(0.01), [pair("mx_nm", "my_nm"), pair("imu_gx_radps", "imu_gz_radps")]);
        // Without noise two columns of a symmetrical motion may be the same.
        assert!(copied(0.0).is_empty());
    }

    #[test]
    fn rows_at_an_unstated_limit_are_left_out_and_a_rest_at_an_extreme_value_is_not() {
        let clipped = |noise: f64, step: f64, limit: f64| {
            let mut changed = recording(noise);
            for w in changed.wrench.iter_mut().flatten() {
                w[0] = (if step > 0.0 { (w[0] / step).round() * step } else { w[0] }).min(limit);
            }
            changed
        };
        let kept = |mut recording: Recording| {
            recording.leave_out_bad_readings();
            (recording.rows(), recording.warnings.len())
        };
        // The upper 4 % of an amplitude of 20: 9 % of the rows in motion.
        for step in [0.0, 0.01] {
            let (rows, said) = kept(clipped(0.05, step, 19.2));
            assert!((2700..2900).contains(&rows) && said == 1, "{rows} {said}");
            assert_eq!(kept(clipped(0.05, step, 30.0)), (3000, 0));
        }
        let mut stated = clipped(0.05, 0.0, 19.2);
        stated.rig.load_cell.range_n_nm = Some([19.2; 6]);
        assert_eq!(kept(stated), (3000, 0));
        // Without noise, and in steps larger than the noise, values repeat where nothing moves.
        assert_eq!(kept(clipped(0.0, 0.0, 0.0)), (3000, 0));
        assert_eq!(kept(clipped(0.01, 0.5, 0.0)), (3000, 0));
    }

    #[test]
    fn a_thinned_recording_has_the_means_of_its_rows_at_their_mean_time() {
        let (whole, thin) = (recording(0.01), recording(0.01).thinned(4));
        assert_eq!((thin.rows(), thin.rate_hz), (750, Some(25.0)));
        assert_eq!(thin.time_ns[1], 55_000_000);
        let mean = whole.wrench.as_ref().unwrap()[4..8].iter().map(|w| w[2]).sum::<f64>() / 4.0;
        assert!((thin.wrench.as_ref().unwrap()[1][2] - mean).abs() < 1e-12);
    }

    #[test]
    fn a_channel_that_never_changes_is_dead_where_the_others_have_noise() {
        let dead = |noise: f64, change: &dyn Fn(&mut Recording)| {
            let mut changed = recording(noise);
            change(&mut changed);
            changed.dead_channels()
        };
        assert!(dead(0.01, &|_| {}).is_empty());
        let still: &dyn Fn(&mut Recording) =
            &|r| r.imus[0].gyro.iter_mut().flatten().for_each(|w| *w = [0.0; 3]);
        assert_eq!(dead(0.01, still).len(), 3);
        // Rates that were made of attitudes may rest.
        let of_attitude: &dyn Fn(&mut Recording) = &|r| {
            still(r);
            r.derived.push(Group::Gyro(0));
        };
        assert!(dead(0.01, of_attitude).is_empty());
        let no_moment: &dyn Fn(&mut Recording) = &|r| r.wrench.iter_mut().flatten().for_each(|w| w[5] = 0.0);
        assert_eq!(dead(0.01, no_moment), ["mz_nm"]);
        let stuck: &dyn Fn(&mut Recording) =
            &|r| r.imus[0].gyro.iter_mut().flatten().for_each(|w| w[1] = 0.02);
        assert_eq!(dead(0.01, stuck), ["imu_gy_radps"]);
        let falls: &dyn Fn(&mut Recording) =
            &|r| r.imus[0].accel.iter_mut().flatten().for_each(|w| w[2] = 0.0);
        assert_eq!(dead(0.01, falls), ["imu_az_mps2"]);
        // A motion in a plane without noise has such channels rightly.
        assert!(dead(0.0, no_moment).is_empty() && dead(0.0, stuck).is_empty());
    }

    #[test]
    fn a_lone_reading_far_off_is_left_out_and_a_motion_that_begins_is_not() {
        for noise in [1e-6, 1e-3, 0.05] {
            let mut clean = recording(noise);
            clean.leave_out_bad_readings();
            assert_eq!((clean.rows(), clean.warnings.len()), (3000, 0), "{noise}: {:?}", clean.warnings);
            for (row, size) in [(300, 35.0), (2000, -35.0), (2500, 35.0)] {
                let mut spoilt = recording(noise);
                spoilt.imus[0].gyro.as_mut().unwrap()[row][0] += size;
                spoilt.leave_out_bad_readings();
                let left = &spoilt.imus[0].gyro.as_ref().unwrap();
                assert!(left.iter().all(|w| w[0].abs() < 2.0), "{noise}, row {row}");
                assert!((2997..3000).contains(&spoilt.rows()), "{}", spoilt.rows());
                let counts = [left.len(), spoilt.time_ns.len(), spoilt.wrench.as_ref().unwrap().len()];
                assert_eq!(counts, [spoilt.rows(); 3]);
                assert!(matches!(spoilt.warnings.as_slice(), [one] if one.contains("imu_gx_radps")));
            }
        }
        // A step stays, and so does a load that is put on.
        let mut step = recording(0.01);
        step.imus[0].accel.iter_mut().flatten().skip(500).for_each(|a| a[0] += 30.0);
        step.leave_out_bad_readings();
        assert_eq!(step.rows(), 3000);
    }
}
