//! The common time base: uniform instants of the wrench's clock, and every stream's value there.

use nalgebra::{UnitQuaternion, Vector3};

use super::kernel::Weights;
use super::{Stream, StreamError, StreamSet};
use rigident_fit::filter_width_s;
use rigident_io::recording::Recording;
use rigident_io::recording::columns::Group;

/// Half the kernel's width, periods of the slowest stream: seven samples of it.
const HALF_PERIODS: f64 = 3.5;
/// Rates between which the grid's is chosen, 1/s: the estimator's filter needs the one, nothing more than the
/// other.
const RATES_HZ: (f64, f64) = (200.0, 1000.0);

/// A mean of quaternions that is shorter than one by more than this is of no attitude: of two that are 50
/// degrees apart it is shorter by a tenth.
const SHORTENED: f64 = 0.1;

/// The time base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Its rate, 1/s.
    pub rate_hz: f64,
    /// Half the width of the kernel, ns.
    pub half_ns: i64,
    /// The substitute for the noise of rates that come from attitudes, see [`Self::rate_noise`].
    rate_noise: Option<f64>,
}

/// One stream on the grid.
#[derive(Clone, Debug)]
pub struct Resampled {
    groups: Vec<(Group, Vec<Vec<f64>>)>,
    joints: Vec<(String, Vec<f64>)>,
    turns: Option<Vec<Turn>>,
}

/// The information of the attitudes at an instant.
#[derive(Clone, Debug)]
struct Turn {
    /// Upwards in S, of the length of gravity: what an accelerometer at rest would feel, m/s².
    up: Vector3<f64>,
    /// Of S, in S, rad/s.
    rate: Vector3<f64>,
}

impl Grid {
    /// `rate_hz` of the rig file; without it twice that of the slowest stream, between 200 and 1000 per
    /// second.
    ///
    /// # Errors
    /// [`StreamError::NoOverlap`]
    pub fn of(set: &StreamSet) -> Result<Self, StreamError> {
        let slowest = set.streams.iter().map(|s| s.rate_hz).fold(f64::INFINITY, f64::min);
        let rate_hz = set.rig.recording.rate_hz.unwrap_or((2.0 * slowest).clamp(RATES_HZ.0, RATES_HZ.1));
        let words = |times: &[i64]| {
            let seconds = |t: Option<&i64>| t.map_or(0.0, |t| *t as f64 * 1e-9);
            format!("{:.3} s to {:.3} s", seconds(times.first()), seconds(times.last()))
        };
        let ends = |times: &[i64]| (times.first().copied().unwrap_or(0), times.last().copied().unwrap_or(0));
        for first in &set.streams {
            for second in &set.streams {
                let ((a, b), (c, d)) = (ends(&first.time_ns), ends(&second.time_ns));
                if b < c || d < a {
                    return Err(StreamError::NoOverlap {
                        first: first.file.clone(),
                        first_s: words(&first.time_ns),
                        second: second.file.clone(),
                        second_s: words(&second.time_ns),
                    });
                }
            }
        }
        let mut grid =
            Self { rate_hz, half_ns: (HALF_PERIODS * 1e9 / slowest).round() as i64, rate_noise: None };
        grid.rate_noise = grid.rate_noise(set);
        Ok(grid)
    }

    /// Instants, ns of the wrench's clock, at which every stream has a value for stamps late by `late_ns`,
    /// give or take `margin_ns`.
    ///
    /// # Errors
    /// [`StreamError::TooShort`] if there are not enough for one row of the estimator.
    pub fn instants(
        &self,
        set: &StreamSet,
        late_ns: &[i64],
        margin_ns: i64,
    ) -> Result<Vec<i64>, StreamError> {
        let period = 1e9 / self.rate_hz;
        let limit = |end: fn(&[i64]) -> Option<&i64>, largest: bool| {
            let ends =
                set.streams.iter().zip(late_ns).filter_map(|(s, late)| end(&s.time_ns).map(|t| t - late));
            if largest { ends.max() } else { ends.min() }.unwrap_or(0)
        };
        let (from, to) = (limit(<[i64]>::first, true), limit(<[i64]>::last, false));
        let first = (from as f64 / period).ceil() as i64;
        let last = (to as f64 / period).floor() as i64;
        let there = |at: &i64| {
            set.streams.iter().zip(late_ns).all(|(stream, late)| {
                let margins: &[i64] = if margin_ns == 0 { &[0] } else { &[-margin_ns, margin_ns] };
                margins
                    .iter()
                    .all(|m| Weights::window(&stream.time_ns, at + late + m, self.half_ns).is_some())
            })
        };
        let instants: Vec<i64> =
            (first..=last).map(|k| (k as f64 * period).round() as i64).filter(there).collect();
        let needed_s = filter_width_s(self.rate_hz);
        let needed = (needed_s * self.rate_hz).ceil() as usize;
        if instants.len() < needed {
            return Err(StreamError::TooShort { overlap_s: instants.len() as f64 / self.rate_hz, needed_s });
        }
        Ok(instants)
    }

    /// One stream at these instants, its stamps taken to be late by `late_ns`.
    pub fn resample(&self, set: &StreamSet, stream: &Stream, instants: &[i64], late_ns: i64) -> Resampled {
        let weights = self.weights(&stream.time_ns, instants, late_ns);
        let on_grid = |column: &Vec<f64>| weights.iter().map(|w| w.apply(column)).collect();
        let up = Vector3::new(0.0, 0.0, set.rig.recording.gravity_mps2);
        let (groups, joints) = (stream.groups.iter(), stream.joints.iter());
        Resampled {
            groups: groups.map(|(group, columns)| (*group, columns.iter().map(on_grid).collect())).collect(),
            joints: joints.map(|(name, column)| (name.clone(), on_grid(column))).collect(),
            turns: stream.attitude.as_ref().map(|attitudes| {
                let pairs = weights.iter().zip(instants);
                pairs.map(|(w, at)| turn(attitudes, &stream.time_ns, w, at + late_ns, &up)).collect()
            }),
        }
    }

    /// Every stream at these instants.
    pub fn all(&self, set: &StreamSet, instants: &[i64], late_ns: &[i64]) -> Vec<Resampled> {
        let pairs = set.streams.iter().zip(late_ns);
        pairs.map(|(stream, late)| self.resample(set, stream, instants, *late)).collect()
    }

    /// The recording at these instants. Its times count from the first wrench.
    pub fn recording<'a>(
        &self,
        set: &StreamSet,
        instants: &[i64],
        streams: impl IntoIterator<Item = &'a Resampled>,
    ) -> Recording {
        // Stamps of the wrench may begin after another stream's.
        let origin = instants.first().copied().unwrap_or(0).min(0);
        let mut recording = Recording {
            name: set.name.clone(),
            rig: set.rig.clone(),
            rate_hz: Some(self.rate_hz),
            time_ns: instants.iter().map(|t| u64::try_from(t - origin).unwrap_or(0)).collect(),
            ..Recording::default()
        };
        let mut turns = None;
        for stream in streams {
            for (group, columns) in &stream.groups {
                match group {
                    Group::Attitude(_) => recording.set_group(*group, &unit_quaternions(columns)),
                    _ => recording.set_group(*group, columns),
                }
            }
            for (name, column) in &stream.joints {
                recording.extra.push((name.clone(), column.iter().map(|v| format!("{v:e}")).collect()));
            }
            turns = turns.or(stream.turns.as_ref());
        }
        let measured = recording.imus.first().is_some_and(|imu| imu.gyro.is_some());
        if let Some(turns) = turns.filter(|_| !measured) {
            let to_imu = mounting(set).inverse();
            let rates: Vec<Vector3<f64>> = turns.iter().map(|turn| to_imu * turn.rate).collect();
            let columns: Vec<Vec<f64>> = (0..3).map(|k| rates.iter().map(|r| r[k]).collect()).collect();
            recording.set_group(Group::Gyro(0), &columns);
            recording.derived.push(Group::Gyro(0));
        }
        self.restate_noise(set, &mut recording);
        recording
    }

    fn weights(&self, time_ns: &[i64], instants: &[i64], late_ns: i64) -> Vec<Weights> {
        instants.iter().filter_map(|at| Weights::at(time_ns, at + late_ns, self.half_ns)).collect()
    }

    /// Noise that the rig file states is per sample of a stream; of a sample of the grid it is what has the
    /// same density.
    fn restate_noise(&self, set: &StreamSet, recording: &mut Recording) {
        let density = |rate_hz: f64| (self.rate_hz / rate_hz).sqrt();
        let of = |wanted: Group| {
            set.streams
                .iter()
                .find(|s| s.groups.iter().any(|(g, _)| *g == wanted))
                .map(|s| density(s.rate_hz))
        };
        let cell = &mut recording.rig.load_cell;
        if let (Some(noise), Some(scale)) =
            (&mut cell.noise_n_nm, of(Group::Wrench).or_else(|| of(Group::Gauges)))
        {
            *noise = noise.map(|sigma| sigma * scale);
        }
        let gyro = of(Group::Gyro(0));
        if recording.rig.imu.is_empty() {
            recording.rig.imu.push(rigident_io::rig::ImuTable::default());
        }
        if let Some(imu) = recording.rig.imu.iter_mut().find(|imu| imu.link == 0) {
            match (imu.gyro_noise_radps, gyro) {
                (Some(sigma), Some(scale)) => imu.gyro_noise_radps = Some(sigma * scale),
                (_, None) => imu.gyro_noise_radps = self.rate_noise,
                (None, Some(_)) => {}
            }
        }
        for imu in recording.rig.imu.iter_mut().filter(|imu| imu.link > 0) {
            if let (Some(sigma), Some(scale)) = (&mut imu.gyro_noise_radps, of(Group::Gyro(imu.link))) {
                *sigma *= scale;
            }
        }
        for table in &mut recording.rig.joint {
            let named = table.effort.as_ref().map(|source| source.parts().0.to_owned());
            let is_effort = |column: &String| match &named {
                Some(name) => column == name,
                None => ["nm", "n"].iter().any(|unit| *column == format!("{}_{unit}", table.name)),
            };
            let stream = set.streams.iter().find(|s| s.joints.iter().any(|(name, _)| is_effort(name)));
            if let (Some(sigma), Some(stream)) = (&mut table.effort_noise, stream) {
                *sigma *= density(stream.rate_hz);
            }
        }
        // Ranges were examined before the kernel.
        for imu in &mut recording.rig.imu {
            (imu.range_mps2, imu.range_radps) = (None, None);
        }
        recording.rig.load_cell.range_n_nm = None;
    }

    /// 1 σ of a white rate on the grid that would leave as much noise in the estimator's ω̇ as the attitudes
    /// do, rad/s.
    ///
    /// The noise of an attitude is that of the residuals of its own cubic, `σ² (1 − 2 l_i + Σ l²)` each; ω̇
    /// is linear in the attitudes, so that its variance is σ² times the sum of squares of their weights in
    /// it.
    fn rate_noise(&self, set: &StreamSet) -> Option<f64> {
        let stream = set.streams.iter().find(|s| s.attitude.is_some())?;
        let attitudes = stream.attitude.as_ref()?;
        let (mut squares, mut count) = (Vector3::zeros(), 0.0);
        for (i, (at, own)) in stream.time_ns.iter().zip(attitudes).enumerate() {
            let Some(w) = Weights::at(&stream.time_ns, *at, self.half_ns) else { continue };
            let window = attitudes.get(w.range.clone()).unwrap_or_default();
            let thetas = window.iter().map(|q| (own.inverse() * q).scaled_axis());
            let residual: Vector3<f64> = thetas.zip(&w.value).map(|(theta, l)| theta * *l).sum();
            let own_weight = w.value.get(i - w.range.start).copied().unwrap_or(0.0);
            let left = 1.0 - 2.0 * own_weight + w.value.iter().map(|l| l * l).sum::<f64>();
            squares += residual.component_mul(&residual) / left;
            count += 1.0;
        }
        let variance = squares.amax() / f64::max(count, 1.0);
        // The derivative of the estimator's kernel, (1 − x²)⁸, on the grid.
        let width_s = filter_width_s(self.rate_hz);
        let reach = (0.5 * width_s * self.rate_hz) as i64;
        let offset_s = |k: i64| k as f64 / self.rate_hz;
        let bell = |k: i64| {
            let x = 2.0 * offset_s(k) / width_s;
            x * (1.0 - x * x).max(0.0).powi(7)
        };
        let scale: f64 = (-reach..=reach).map(|k| bell(k) * offset_s(k)).sum();
        let middle = stream.time_ns.get(stream.time_ns.len() / 2)?;
        let mut weights = vec![0.0; attitudes.len()];
        let mut white = 0.0;
        for k in -reach..=reach {
            let derivative = bell(k) / scale;
            white += derivative * derivative;
            let w = Weights::at(&stream.time_ns, middle + (1e9 * offset_s(k)) as i64, self.half_ns)?;
            for (weight, slope) in weights.iter_mut().skip(w.range.start).zip(&w.slope) {
                *weight += derivative * slope;
            }
        }
        Some((variance * weights.iter().map(|w| w * w).sum::<f64>() / white).sqrt())
    }
}

impl Resampled {
    /// Returns what an accelerometer at rest would feel in S by the attitudes, m/s².
    pub fn up(&self) -> Option<impl Iterator<Item = [f64; 3]>> {
        self.turns.as_ref().map(|turns| turns.iter().map(|turn| turn.up.into()))
    }
}

/// Returns quaternions, by column, of length one; what is far from it stays as it is, for its reader to
/// complain of.
fn unit_quaternions(columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let rows = columns.iter().map(Vec::len).min().unwrap_or(0);
    let norm = |row: usize| columns.iter().map(|c| c[row] * c[row]).sum::<f64>().sqrt();
    let scale = |row: usize| {
        let norm = norm(row);
        if (norm - 1.0).abs() < SHORTENED { 1.0 / norm } else { 1.0 }
    };
    columns.iter().map(|c| (0..rows).map(|row| c[row] * scale(row)).collect()).collect()
}

/// From the cubic through `θ_i = log(R_mᵀ R_i)` of the attitudes under the window: `R = R_m exp θ`, and
/// `ω = J_r(θ) θ̇ ≈ (1 − ½[θ]× + ⅙[θ]×²) θ̇`; |θ| is the turn within a sample, at most.
fn turn(
    attitudes: &[UnitQuaternion<f64>],
    time_ns: &[i64],
    weights: &Weights,
    at_ns: i64,
    up: &Vector3<f64>,
) -> Turn {
    let window = attitudes.get(weights.range.clone()).unwrap_or_default();
    let after = time_ns.partition_point(|t| *t < at_ns);
    let middle = attitudes.get(after).copied().unwrap_or_else(UnitQuaternion::identity);
    let (mut angle, mut slope) = (Vector3::zeros(), Vector3::zeros());
    for ((q, value), derivative) in window.iter().zip(&weights.value).zip(&weights.slope) {
        let theta = (middle.inverse() * q).scaled_axis();
        angle += theta * *value;
        slope += theta * *derivative;
    }
    let first = angle.cross(&slope);
    Turn {
        up: (middle * UnitQuaternion::from_scaled_axis(angle)).inverse() * up,
        rate: slope - first * 0.5 + angle.cross(&first) / 6.0,
    }
}

/// `R_LU` of the IMU on the base link.
fn mounting(set: &StreamSet) -> UnitQuaternion<f64> {
    let [w, x, y, z] = set.rig.imu_on(0).map_or([1.0, 0.0, 0.0, 0.0], |imu| imu.rotation_wxyz);
    UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
}
