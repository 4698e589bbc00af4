//! Streams while they grow: readings of one body on a uniform grid, as soon as every stream has a value
//! there.
//!
//! Lives here: what of the samples is still needed, and the same kernel as of files. May not live here: how
//! late stamps are; that takes a whole run.

use nalgebra::UnitQuaternion;
use rigident_shared::calibration::{GaugeCalibration, Reading};
use rigident_shared::spatial::{AngularRate, SpecificForce, Wrench};

use super::files::{attitude, delay_s, on_grid, on_plate};
use super::kernel::Weights;
use super::{Grid, Stamped, Stream, StreamError, StreamSet};
use rigident_io::recording::Recording;
use rigident_io::recording::columns::Group;
use rigident_io::rig::{RigFile, WrenchSign};
use rigident_rows::body::prepare::{Prepared, prepare};
use rigident_rows::white_noise::sixth_differences;

/// Samples of one stream that are still needed.
#[derive(Clone, Debug)]
struct Samples {
    name: String,
    groups: Vec<Group>,
    delay_ns: i64,
    time_ns: Vec<i64>,
    rows: Vec<Vec<f64>>,
}

impl Samples {
    /// Rows by second of what is here, 1/s.
    fn rate_hz(&self) -> f64 {
        match (self.time_ns.first(), self.time_ns.last()) {
            (Some(first), Some(last)) if last > first => {
                (self.time_ns.len() - 1) as f64 * 1e9 / (last - first) as f64
            }
            _ => 0.0,
        }
    }
}

/// Streams of one body while they grow.
#[derive(Clone, Debug)]
pub struct Growing {
    rig: RigFile,
    negative: bool,
    on_plate: UnitQuaternion<f64>,
    streams: Vec<Samples>,
    rates_hz: Vec<f64>,
    grid: Option<Grid>,
    /// Number of the next instant of the grid.
    next: i64,
}

/// Samples are stored for this many halves of the kernel's width before the next instant.
const KEPT: i64 = 3;
/// No sensor has less noise than this share of what it measures.
const LEAST_NOISE: f64 = 1e-6;

impl Growing {
    /// Starts without samples; streams are of a name and groups of columns each.
    pub fn new(rig: &RigFile, streams: Vec<(String, Vec<Group>)>) -> Self {
        let negative = rig.recording.wrench_sign == WrenchSign::OnSensor;
        let on_plate = on_plate(rig);
        let delay_ns = |groups: &[Group]| (1e9 * delay_s(groups.iter().copied(), rig)).round() as i64;
        let streams = streams
            .into_iter()
            .map(|(name, groups)| Samples {
                delay_ns: delay_ns(&groups),
                name,
                groups,
                time_ns: Vec::new(),
                rows: Vec::new(),
            })
            .collect();
        let mut rig = on_grid(rig);
        if negative {
            // Gauges stay as they are: the matrix brings the sign.
            rig.load_cell.calibration.iter_mut().flatten().flatten().for_each(|v| *v = -*v);
        }
        Self { rig, negative, on_plate, streams, rates_hz: Vec::new(), grid: None, next: 0 }
    }

    /// Adds a sample of a stream, at a time of the common clock, ns; returns false if it is not after the one
    /// before.
    pub fn push(&mut self, stream: usize, at_ns: i64, values: Vec<f64>) -> bool {
        let Some(samples) = self.streams.get_mut(stream) else { return false };
        let at_ns = at_ns.saturating_sub(samples.delay_ns);
        if samples.time_ns.last().is_some_and(|last| at_ns <= *last) {
            return false;
        }
        samples.time_ns.push(at_ns);
        samples.rows.push(values);
        true
    }

    /// Returns the white noise of the wrench's samples, N and N m, none of which is taken to be without.
    fn noise_n_nm(&self) -> Option<[f64; 6]> {
        self.streams.iter().find_map(|samples| {
            let (_, columns) = columns(samples).into_iter().find(|(group, _)| *group == Group::Wrench)?;
            let of = |column: &Vec<f64>| {
                let times = samples.time_ns.iter().map(|t| u64::try_from(*t).unwrap_or(0));
                let signal: Vec<(u64, [f64; 1])> = times.zip(column.iter().map(|v| [*v])).collect();
                let largest = column.iter().fold(1e-3_f64, |most, v| most.max(v.abs()));
                sixth_differences(&signal, 1).max(LEAST_NOISE * largest)
            };
            columns.iter().map(of).collect::<Vec<f64>>().first_chunk().copied()
        })
    }

    /// Chooses the grid by what is here, and returns the rig file and the readings of it as a recording's are
    /// prepared, with their checks. Where the rig file does not state the load cell's noise it has what is
    /// found here.
    ///
    /// # Errors
    /// [`StreamError`]: too little in common, or no recording of a body.
    pub fn begin(&mut self) -> Result<Prepared, StreamError> {
        if self.rig.load_cell.noise_n_nm.is_none() {
            self.rig.load_cell.noise_n_nm = self.noise_n_nm();
        }
        self.rates_hz = self.streams.iter().map(Samples::rate_hz).collect();
        let set = self.set()?;
        let grid = Grid::of(&set)?;
        let late = vec![0; set.streams.len()];
        let instants = grid.instants(&set, &late, 0)?;
        self.grid = Some(grid);
        Ok(prepare(&grid.recording(&set, &instants, &grid.all(&set, &instants, &late)))?)
    }

    /// Returns the grid's rate, 1/s, once it is chosen.
    pub fn rate_hz(&self) -> Option<f64> {
        self.grid.map(|grid| grid.rate_hz)
    }

    /// Returns the readings that have become possible, their times counted from the zero of the common clock.
    ///
    /// # Errors
    /// [`StreamError`]: a pose that is none.
    pub fn readings(&mut self) -> Result<Vec<Reading<f64>>, StreamError> {
        let Some(grid) = self.grid else { return Ok(Vec::new()) };
        let period = 1e9 / grid.rate_hz;
        let at = |k: i64| (k as f64 * period).round() as i64;
        let first = self.streams.iter().filter_map(|s| s.time_ns.first()).max().copied().unwrap_or(0).max(0);
        let last = self.streams.iter().map(|s| s.time_ns.last().copied().unwrap_or(0)).min().unwrap_or(0);
        // Nothing that is still to come is under the window.
        let (from, to) = (self.next.max((first as f64 / period).ceil() as i64), last - grid.half_ns);
        let to = (to as f64 / period).floor() as i64;
        if to < from {
            return Ok(Vec::new());
        }
        let there =
            |at: &i64| self.streams.iter().all(|s| Weights::window(&s.time_ns, *at, grid.half_ns).is_some());
        let instants: Vec<i64> = (from..=to).map(at).filter(there).collect();
        self.next = to + 1;
        let mut readings = Vec::new();
        if !instants.is_empty() {
            let set = self.set()?;
            let late = vec![0; set.streams.len()];
            readings = readings_of(&grid.recording(&set, &instants, &grid.all(&set, &instants, &late)));
        }
        let needed = at(self.next) - KEPT * grid.half_ns;
        for samples in &mut self.streams {
            let gone = samples.time_ns.partition_point(|t| *t < needed);
            samples.time_ns.drain(..gone);
            samples.rows.drain(..gone);
        }
        Ok(readings)
    }

    fn set(&self) -> Result<StreamSet, StreamError> {
        let mut streams = Vec::new();
        for (k, samples) in self.streams.iter().enumerate() {
            let (mut groups, mut attitudes) = (Vec::new(), None);
            for (group, mut columns) in columns(samples) {
                match group {
                    Group::Platform => {
                        let pose = |row: usize| std::array::from_fn(|c| columns[c][row]);
                        let rows = (0..samples.rows.len())
                            .map(|row| attitude(&pose(row), &self.on_plate, &samples.name, row));
                        attitudes = Some(rows.collect::<Result<Vec<_>, _>>()?);
                    }
                    Group::Wrench if self.negative => {
                        columns.iter_mut().flatten().for_each(|v| *v = -*v);
                        groups.push((group, columns));
                    }
                    _ => groups.push((group, columns)),
                }
            }
            streams.push(Stream {
                file: samples.name.clone(),
                time_ns: samples.time_ns.clone(),
                groups,
                attitude: attitudes,
                joints: Vec::new(),
                rate_hz: self.rates_hz.get(k).copied().unwrap_or(0.0),
                discarded: 0,
                stamped: Stamped::default(),
            });
        }
        let has = |wanted| streams.iter().position(|s: &Stream| s.groups.iter().any(|(g, _)| *g == wanted));
        let reference = has(Group::Wrench).or_else(|| has(Group::Gauges)).ok_or(StreamError::NoWrench)?;
        Ok(StreamSet {
            name: "live".to_owned(),
            rig: self.rig.clone(),
            streams,
            reference,
            warnings: Vec::new(),
            is_settled: true,
        })
    }
}

/// A stream's samples, column by column.
fn columns(samples: &Samples) -> Vec<(Group, Vec<Vec<f64>>)> {
    let mut at = 0;
    let mut groups = Vec::new();
    for group in &samples.groups {
        let width = group.names().len();
        let column =
            |k: usize| samples.rows.iter().map(|row| row.get(at + k).copied().unwrap_or(0.0)).collect();
        groups.push((*group, (0..width).map(column).collect()));
        at += width;
    }
    groups
}

/// Readings of a recording on the grid; empty where a quantity is missing.
fn readings_of(recording: &Recording) -> Vec<Reading<f64>> {
    let matrix = recording.rig.load_cell.calibration;
    let by_gauges = || {
        let calibration = GaugeCalibration { matrix: matrix? };
        let gauges = recording.gauges.as_ref()?;
        Some(gauges.iter().map(|g| calibration.wrench(g).array()).collect::<Vec<_>>())
    };
    let wrench = recording.wrench.clone().or_else(by_gauges).unwrap_or_default();
    let imu = recording.imus.first();
    let accel = imu.and_then(|imu| imu.accel.as_deref()).unwrap_or_default();
    let gyro = imu.and_then(|imu| imu.gyro.as_deref()).unwrap_or_default();
    let rows = recording.time_ns.iter().zip(wrench).zip(accel.iter().zip(gyro));
    rows.map(|((time_ns, w), (a, g))| Reading {
        time_ns: *time_ns,
        wrench: Wrench::from_array(w),
        specific_force: SpecificForce::from_array(*a),
        angular_rate: AngularRate::from_array(*g),
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parabola of time, which the kernel passes without error, on two clocks' rates.
    fn values(at_ns: i64, width: usize) -> Vec<f64> {
        let t = at_ns as f64 * 1e-9;
        (0..width).map(|c| 1.0 + c as f64 + 0.3 * t - 0.2 * t * t).collect()
    }

    #[test]
    fn readings_come_as_soon_as_both_streams_allow_and_are_those_of_the_signals() {
        let rig = RigFile::parse(
            "[recording]\nwrench_sign = \"on_sensor\"\nrate_hz = 250.0\n[load_cell]\ngroup_delay_s = 0.01\n",
        )
        .unwrap();
        let streams = vec![
            ("wrench".to_owned(), vec![Group::Wrench]),
            ("imu".to_owned(), vec![Group::Accel(0), Group::Gyro(0)]),
        ];
        let mut growing = Growing::new(&rig, streams);
        let mut fed = [0, 0];
        let mut feed = |growing: &mut Growing, until_ns: i64| {
            for (stream, (period, delay, width)) in
                [(5_000_000, 10_000_000, 6), (4_100_000, 0, 6)].into_iter().enumerate()
            {
                while fed[stream] * period < until_ns {
                    let at = fed[stream] * period;
                    assert!(growing.push(stream, at, values(at - delay, width)));
                    assert!(!growing.push(stream, at, values(at, width)));
                    fed[stream] += 1;
                }
            }
        };
        feed(&mut growing, 1_000_000_000);
        growing.rates_hz = vec![200.0, 1e9 / 4.1e6];
        growing.grid = Some(Grid::of(&growing.set().unwrap()).unwrap());
        let mut readings = growing.readings().unwrap();
        for k in 1..=40 {
            feed(&mut growing, 1_000_000_000 + k * 50_000_000);
            readings.extend(growing.readings().unwrap());
        }
        let period = 4_000_000;
        assert!(readings.windows(2).all(|w| w[1].time_ns - w[0].time_ns == period));
        // All but the half kernel and the delay at the end.
        assert!(readings.len() > 730, "{}", readings.len());
        for reading in &readings {
            let expected = values(reading.time_ns as i64, 6);
            assert!(reading.wrench.array().iter().zip(&expected).all(|(a, b)| (a + b).abs() < 1e-9));
            let imu = reading.specific_force.array().into_iter().chain(reading.angular_rate.array());
            assert!(imu.zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9));
        }
        // What is over is forgotten.
        assert!(growing.streams.iter().all(|s| s.time_ns.len() < 100));
    }
}
