//! The action of the ground on a person: wrenches of force plates in the laboratory's frame.

use nalgebra::{Matrix3, Vector3};

use super::c3d::{C3d, Plate, PlateKind};

/// The wrench of a force plate on whoever stands on it, over time.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundWrench {
    /// The plate's name.
    pub name: String,
    /// Corners of its surface, laboratory axes, m; `None` if they are not known, as of a belt.
    pub corners_m: Option<[[f64; 3]; 4]>,
    /// Samples per second.
    pub rate_hz: f64,
    /// Time of the first sample, s: of its middle.
    pub first_s: f64,
    /// The time that each sample is the mean over, s.
    pub mean_s: f64,
    /// Force and moment on the person about the laboratory's origin, laboratory axes, N and N m.
    pub wrench: Vec<[f32; 6]>,
}

/// Neighbouring samples are taken together as long as this many a second are left, ten times the highest
/// cut-off that is chosen, …
const RATE_HZ: f64 = 150.0;
/// … and this many a frame of markers: of a cut-off that is asked for that is eight times as many.
const PER_FRAME: f64 = 2.0;

/// More bytes than these are not asked for before they are there: the count may be wrong.
const MOST_ROOM: usize = 1 << 28;

/// Returns an empty list with room for the given number: one that grows leaves holes in memory.
pub(super) fn with_room<T>(count: usize) -> Vec<T> {
    let mut list = Vec::new();
    // Without the room it grows.
    let _ = list.try_reserve_exact(count.min(MOST_ROOM / size_of::<T>().max(1)));
    list
}

/// Takes neighbouring samples together, so that a long recording is no longer than its markers.
pub(super) struct Means {
    together: usize,
    sum: [f64; 6],
    count: usize,
    means: Vec<[f32; 6]>,
}

impl Means {
    /// Returns means for samples at about the given rate, beside the given number of frames at their rate.
    pub(super) fn new(rate_hz: f64, frames: usize, frames_hz: f64) -> Self {
        let together = (rate_hz / RATE_HZ.max(PER_FRAME * frames_hz)).floor().clamp(1.0, 1000.0) as usize;
        let samples = frames as f64 / frames_hz * rate_hz / together as f64;
        Self { together, sum: [0.0; 6], count: 0, means: with_room(samples as usize + 2) }
    }

    pub(super) fn push(&mut self, wrench: [f64; 6]) {
        self.sum.iter_mut().zip(wrench).for_each(|(sum, value)| *sum += value);
        self.count += 1;
        if self.count == self.together {
            self.means.push(self.sum.map(|sum| (sum / self.together as f64) as f32));
            (self.sum, self.count) = ([0.0; 6], 0);
        }
    }

    /// Returns the plate whose samples they were, at the given rate from an instant on; what is left of them
    /// at the end is dropped.
    pub(super) fn plate(
        self,
        name: String,
        corners_m: Option<[[f64; 3]; 4]>,
        rate_hz: f64,
        first_s: f64,
    ) -> GroundWrench {
        let together = self.together as f64;
        GroundWrench {
            name,
            corners_m,
            rate_hz: rate_hz / together,
            first_s: first_s + 0.5 * (together - 1.0) / rate_hz,
            mean_s: if self.together > 1 { together / rate_hz } else { 0.0 },
            wrench: self.means,
        }
    }
}

impl Plate {
    /// Returns the plate's axes in the laboratory's, by columns, and the middle of its surface, m; `None` if
    /// its corners are no rectangle's.
    ///
    /// x from the second corner to the first, y from the fourth to the first, z of both.
    pub fn place(&self) -> Option<(Matrix3<f64>, Vector3<f64>)> {
        let [a, b, c, d] = self.corners_m.map(Vector3::from);
        let x = (a + d - b - c).try_normalize(1e-6)?;
        let y = a + b - c - d;
        let y = (y - x * x.dot(&y)).try_normalize(1e-6)?;
        Some((Matrix3::from_columns(&[x, y, x.cross(&y)]), (a + b + c + d) / 4.0))
    }

    /// Returns force and moment in the plate's axes and the point that the moment is about, in the plate's
    /// frame, from the values of its channels.
    ///
    /// The point lies below the surface, whatever sign a laboratory has written the plate's origin with.
    fn own_wrench(&self, values: &[f64; 8]) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let [ox, oy, oz] = self.origin_m;
        // z of the plate points down; what is below the surface has a positive one.
        let below = Vector3::new(-ox, -oy, oz.abs());
        let length = self.moment_m;
        let first =
            |v: &[f64; 6]| (Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]) * length, below);
        match &self.kind {
            PlateKind::Wrench => {
                let [a, b, c, d, e, f, ..] = *values;
                first(&[a, b, c, d, e, f])
            }
            PlateKind::Calibrated(matrix) => {
                first(&std::array::from_fn(|row| matrix[row].iter().zip(values).map(|(m, v)| m * v).sum()))
            }
            PlateKind::Pressure => {
                let [fx, fy, fz, px, py, mz, ..] = *values;
                let at = Vector3::new(px, py, 0.0) * length;
                (Vector3::new(fx, fy, fz), Vector3::new(0.0, 0.0, mz * length), at)
            }
            PlateKind::Pillars => {
                let [x12, x34, y14, y23, z1, z2, z3, z4] = *values;
                // The pillars' distances from the middle; the moment is about their tops.
                let (a, b) = (ox.abs(), oy.abs());
                let force = Vector3::new(x12 + x34, y14 + y23, z1 + z2 + z3 + z4);
                let moment = Vector3::new(
                    b * (z1 + z2 - z3 - z4),
                    a * (-z1 + z2 + z3 - z4),
                    b * (-x12 + x34) + a * (y14 - y23),
                );
                (force, moment, Vector3::new(0.0, 0.0, oz.abs()))
            }
        }
    }
}

/// A plate with its place in the laboratory.
pub(super) struct Placed {
    plate: Plate,
    axes: Matrix3<f64>,
    middle: Vector3<f64>,
}

impl Placed {
    /// Returns a plate in its place; `None` if its corners are no rectangle's.
    pub(super) fn of(plate: &Plate) -> Option<Self> {
        let (axes, middle) = plate.place()?;
        Some(Self { plate: plate.clone(), axes, middle })
    }

    /// Returns the wrench by one sample of all channels.
    pub(super) fn wrench(&self, sample: &[f32]) -> [f64; 6] {
        let mut values = [0.0; 8];
        for (to, channel) in values.iter_mut().zip(&self.plate.channels) {
            *to = sample.get(*channel).copied().map_or(f64::NAN, f64::from);
        }
        let (force, moment, at) = self.plate.own_wrench(&values);
        let force = self.axes * force;
        let moment = self.axes * moment + (self.middle + self.axes * at).cross(&force);
        [force.x, force.y, force.z, moment.x, moment.y, moment.z]
    }
}

impl C3d {
    /// Returns the wrenches of the plates as their channels have them, sample by sample, not zeroed: force
    /// and moment about the laboratory's origin, N and N m.
    pub fn ground_wrenches(&self) -> Vec<Vec<[f64; 6]>> {
        let placed = self.plates.iter().filter_map(Placed::of);
        let samples = || self.analog.chunks_exact(self.channels.len().max(1));
        placed.map(|plate| samples().map(|sample| plate.wrench(sample)).collect()).collect()
    }
}
