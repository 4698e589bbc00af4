//! The recorded motion as plots over time.

use rigident_shared::calibration::Reading;

use rigident_present::TimePlot;
use rigident_rows::body::Input;

/// Returns angular rate and specific force of one body's IMU; times in s from the first reading, or the
/// number of the still pose.
pub(super) fn of_body(input: &Input, gravity_columns: bool) -> Vec<TimePlot> {
    let start_ns = input.readings.first().map_or(0, |r| r.time_ns);
    let readings = &input.readings;
    let time = |row: usize| match input.is_static {
        true => row as f64 + 1.0,
        false => readings[row].time_ns.saturating_sub(start_ns) as f64 * 1e-9,
    };
    let plot = |title: &str, unit: &str, value: &dyn Fn(&Reading<f64>) -> [f64; 3]| {
        let axes = ["x", "y", "z"].into_iter().enumerate();
        axes.fold(TimePlot::new(title, unit), |plot, (axis, name)| {
            plot.with(name, readings.len(), |row| (time(row), value(&readings[row])[axis]))
        })
    };
    let force = if gravity_columns {
        // As it is in the columns: what a sensor at rest would feel is its reverse.
        plot("Gravity from its columns, axes of S", "m/s2", &|r| r.specific_force.array().map(|a| -a))
    } else {
        plot("Specific force, IMU axes", "m/s2", &|r| r.specific_force.array())
    };
    if input.is_static {
        return vec![force];
    }
    vec![plot("Angular rate, IMU axes", "rad/s", &|r| r.angular_rate.array()), force]
}
