//! The last step of reading: signs, stamps and attitudes as the rig file says they are.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::columns::Group;
use super::{GAP, Recording, RecordingError, measured_rate, rows, time};
use crate::rig::WrenchSign;

/// Times agree with a stated rate if they differ by no more than this, relative.
const RATE_TOLERANCE: f64 = 0.01;
/// Stamps jitter if their standard deviation is this share of a period or more.
const LEAST_JITTER: f64 = 0.1;
/// Stamps that are made even are at most this many periods off.
const MOST_JITTER: f64 = 3.0;
/// The norm of an attitude differs from one by at most this.
const UNIT_TOLERANCE: f64 = 0.01;

impl Recording {
    /// Does the last step of reading: the rig file is brought to the notation, and times are checked against
    /// its rate.
    pub(super) fn settle(mut self, label: &str) -> Result<Self, RecordingError> {
        if self.rig.recording.wrench_sign == WrenchSign::OnSensor {
            negate(self.wrench.iter_mut().flatten().flatten());
            // Gauges stay as they are: the matrix brings the sign.
            negate(self.rig.load_cell.calibration.iter_mut().flatten().flatten());
            self.rig.recording.wrench_sign = WrenchSign::OnBody;
        }
        self.rig.recording.columns.clear();
        self.rig.recording.decimal = None;
        self.rig.recording.topics.clear();
        self.gravity_of_attitudes(label)?;
        self.is_static = self.rig.recording.is_static;
        let columns = |reason: String| RecordingError::Columns { name: label.to_owned(), reason };
        if self.is_static {
            self.rate_hz = None;
            return Ok(self);
        }
        let stated = self.rig.recording.rate_hz;
        if std::mem::take(&mut self.rig.recording.even_stamps) {
            self.make_stamps_even(label)?;
        }
        let measured = measured_rate(&self.time_ns);
        // A single row measures none.
        self.rate_hz = measured.or(stated);
        let Some(measured) = measured else { return Ok(self) };
        if let Some(stated) = stated
            && (measured / stated - 1.0).abs() > RATE_TOLERANCE
        {
            return Err(columns(format!(
                "the times make {measured:.6} rows per second, rate_hz says {stated}: correct rate_hz in the \
                 rig file, or the unit of t_s (its scale in [recording] columns)"
            )));
        }
        self.warn_of_gaps(1e9 / measured);
        Ok(self)
    }

    /// Makes gravity columns of the attitudes that the rig file names.
    fn gravity_of_attitudes(&mut self, label: &str) -> Result<(), RecordingError> {
        let Some(names) = self.rig.recording.attitude_wxyz.take() else { return Ok(()) };
        let refuse = |reason: String| RecordingError::Columns { name: label.to_owned(), reason };
        if self.gravity.is_some() {
            return Err(refuse(
                "it has gravity columns, and attitude_wxyz would make others: remove one".to_owned(),
            ));
        }
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for name in &names {
            let Some((_, cells)) = self.extra.iter().find(|(own, _)| own == name) else {
                // Those of a whole pose of the plate.
                let place = Group::Platform.names().iter().position(|own| own == name);
                if let (Some(k), Some(poses)) = (place, &self.platform) {
                    columns.push(poses.iter().map(|pose| pose[k]).collect());
                    continue;
                }
                return Err(refuse(format!("attitude_wxyz names column {name:?}, and there is none")));
            };
            let numbers = cells.iter().map(|cell| cell.trim().parse::<f64>().ok().filter(|v| v.is_finite()));
            let wrong = || refuse(format!("column {name:?} of attitude_wxyz holds what is no finite number"));
            columns.push(numbers.collect::<Option<Vec<f64>>>().ok_or_else(wrong)?);
        }
        let mut rows = Vec::new();
        for (row, [w, x, y, z]) in self::rows::<4>(&columns).into_iter().enumerate() {
            let norm = (w * w + x * x + y * y + z * z).sqrt();
            if (norm - 1.0).abs() > UNIT_TOLERANCE {
                let place = self.place(row);
                return Err(refuse(format!(
                    "{place}: the attitude's norm is {norm:.4}; a unit quaternion w, x, y, z is wanted"
                )));
            }
            rows.push([w, x, y, z]);
        }
        self.set_attitudes(rows);
        Ok(())
    }

    /// Sets the gravity columns to those of attitudes of S, unit quaternions w, x, y, z to axes with z up.
    pub fn set_attitudes(&mut self, attitudes: Vec<[f64; 4]>) {
        let down = Vector3::new(0.0, 0.0, -self.rig.recording.gravity_mps2);
        let turned = |[w, x, y, z]: &[f64; 4]| {
            UnitQuaternion::new_normalize(Quaternion::new(*w, *x, *y, *z)).inverse() * down
        };
        self.gravity = Some(attitudes.iter().map(|attitude| turned(attitude).into()).collect());
        self.gravity_attitudes = attitudes;
    }

    /// Makes the stamps even.
    fn make_stamps_even(&mut self, label: &str) -> Result<(), RecordingError> {
        let (Some(first), Some(last)) = (self.time_ns.first().copied(), self.time_ns.last().copied()) else {
            return Ok(());
        };
        let steps = self.time_ns.len().saturating_sub(1).max(1) as f64;
        let period_ns = last.saturating_sub(first) as f64 / steps;
        // A stamp is never further from its place than jitter takes it, unless rows are missing.
        let off = |(k, time): (usize, &u64)| (*time as f64 - first as f64 - k as f64 * period_ns).abs();
        let worst = self.time_ns.iter().enumerate().map(off).fold(0.0, f64::max);
        if worst > MOST_JITTER * period_ns {
            return Err(RecordingError::Columns {
                name: label.to_owned(),
                reason: format!(
                    "even_stamps says that rows were taken at a constant rate, and a stamp is {:.1} ms off \
                     its place: rows are missing, or the rate changed; remove the key",
                    1e-6 * worst
                ),
            });
        }
        for (k, time) in self.time_ns.iter_mut().enumerate() {
            *time = first + (k as f64 * period_ns).round() as u64;
        }
        self.exact_time_s = None;
        self.warnings.push(format!(
            "stamps were made even: they were up to {:.2} ms off (even_stamps of the rig file)",
            1e-6 * worst
        ));
        Ok(())
    }

    /// Tells of stamps that jitter, and of rows that are missing. Where the rows from the first to the last
    /// are as many as their rate lets expect, a long step is one of jitter: a short one makes up for it.
    fn warn_of_gaps(&mut self, period_ns: f64) {
        let steps = self.time_ns.windows(2).map(|w| (w[0], (w[1] - w[0]) as f64 / period_ns));
        let gaps: Vec<(u64, f64)> = steps.filter(|(_, periods)| *periods > GAP).collect();
        if let Some((at, _)) = gaps.first() {
            let missing: f64 = gaps.iter().map(|(_, periods)| periods.round() - 1.0).sum();
            let short =
                self.time_ns.windows(2).filter(|w| ((w[1] - w[0]) as f64) < (2.0 - GAP) * period_ns).count();
            let jitter_s = jitter_s(&self.time_ns, period_ns);
            if 2 * short >= gaps.len() && jitter_s > LEAST_JITTER * period_ns * 1e-9 {
                self.warnings.push(format!(
                    "stamps jitter by {:.1} ms, where rows are {:.1} ms apart: {} of the steps are longer \
                     than one and a half of that, and rows after them are taken as after a gap; stamp \
                     readings where they are taken",
                    1e3 * jitter_s,
                    1e-6 * period_ns,
                    gaps.len()
                ));
                return;
            }
            self.warnings.push(format!(
                "{} in time, the first after {} s: about {missing} {} missing",
                if gaps.len() == 1 { "a gap".to_owned() } else { format!("{} gaps", gaps.len()) },
                time::text(*at),
                if missing == 1.0 { "row is" } else { "rows are" }
            ));
        }
    }
}

fn negate<'a>(values: impl Iterator<Item = &'a mut f64>) {
    for value in values {
        *value = -*value;
    }
}

/// Returns the standard deviation of the steps between stamps over √2, s: that of a stamp, if these are
/// independent. Steps of several periods are left out.
fn jitter_s(time_ns: &[u64], period_ns: f64) -> f64 {
    let steps = time_ns.windows(2).map(|w| (w[1] - w[0]) as f64 - period_ns).filter(|d| *d < 2.0 * period_ns);
    let (count, squares) = steps.fold((0.0, 0.0), |(n, sum), d| (n + 1.0, sum + d * d));
    1e-9 * (squares / f64::max(count, 1.0) / 2.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::RigFile;

    #[test]
    fn stamps_that_jitter_are_distinguished_from_missing_rows() {
        let warnings_of = |time_ns: Vec<u64>| {
            let mut recording = Recording { time_ns, ..Recording::default() };
            recording.warn_of_gaps(5e6);
            recording.warnings
        };
        let mut state = 3_u64;
        let mut jitter = |ns: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (ns * 2.0 * 3_f64.sqrt() * ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5)) as i64
        };
        let shaken: Vec<u64> =
            (0..2000).map(|n| (10_000_000 + n * 5_000_000 + jitter(2e6)).unsigned_abs()).collect();
        let mut sorted = shaken;
        sorted.sort_unstable();
        let said = warnings_of(sorted);
        assert!(
            matches!(said.as_slice(), [one] if one.starts_with("stamps jitter by 2.0 ms")
            || one.starts_with("stamps jitter by 1.9 ms")),
            "{said:?}"
        );
        let holes: Vec<u64> = (0..2000).filter(|n| n % 100 != 7).map(|n| n * 5_000_000).collect();
        let said = warnings_of(holes);
        assert!(matches!(said.as_slice(), [one] if one.contains("about 20 rows are missing")), "{said:?}");
        assert!(warnings_of((0..2000).map(|n| n * 5_000_000 + (n % 2) * 100_000).collect()).is_empty());
    }

    #[test]
    fn attitudes_make_gravity_and_stamps_are_made_even() {
        let read = |rig: &str, text: &str| {
            Recording::from_csv_bytes("a.csv", text.as_bytes(), &RigFile::parse(rig).unwrap())
        };
        let keys = "[recording]\nstatic = true\nattitude_wxyz = [\"a\", \"b\", \"c\", \"d\"]\n";
        let poses = "fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,a,b,c,d\n0,0,9,0,0,0,1,0,0,0\n0,9,0,0,0,0,0.70710678,0.70710678,0,0\n";
        let gravity = read(keys, poses).unwrap().gravity.unwrap();
        // Turned by 90° about x, y of S is up.
        for (found, wanted) in gravity.iter().zip([[0.0, 0.0, -9.80665], [0.0, -9.80665, 0.0]]) {
            assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
        }
        // By the names of the notation, of which a place makes a pose of the plate.
        let by_name = keys.replace(r#""a", "b", "c", "d""#, r#""qw", "qx", "qy", "qz""#);
        let alone = poses.replace("a,b,c,d", "qw,qx,qy,qz");
        let whole = alone.replace(",qw", ",x_m,y_m,z_m,qw").replace("0,0,0,1,", "0,0,0,0,0,0,1,");
        let whole = whole.replace("0,0,0,0.7", "0,0,0,0,0,0,0.7");
        for text in [alone, whole] {
            assert_eq!(read(&by_name, &text).unwrap().gravity.unwrap(), gravity, "{text}");
        }
        for wrong in [poses.replace(",1,0,0,0", ",2,0,0,0"), poses.replace(",a,", ",e,")] {
            assert!(matches!(read(keys, &wrong), Err(RecordingError::Columns { .. })));
        }
        let jittery = |gap: f64| -> String {
            let rows = (0..50).map(|k| {
                let t = 0.01 * f64::from(k) + 0.003 * f64::from(k % 2) + if k > 25 { gap } else { 0.0 };
                format!("{t},0,0,9,0,0,0\n")
            });
            format!("t_s,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n{}", rows.collect::<String>())
        };
        let even = read("[recording]\neven_stamps = true\n", &jittery(0.0)).unwrap();
        let steps: Vec<u64> = even.time_ns.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(steps.iter().all(|step| step.abs_diff(steps[0]) <= 1));
        assert!(
            matches!(even.warnings.as_slice(), [one] if one.contains("made even")),
            "{:?}",
            even.warnings
        );
        assert!(read("[recording]\neven_stamps = true\n", &jittery(1.0)).is_err());
    }
}
