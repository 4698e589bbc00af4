//! Table 12: condition numbers of the angles of Table 11, absolute and relative to the level pose.

use nalgebra::Vector3;
use rigident::plan::poses::measure::{condition_number, normal_matrix, relative_normal_matrix, up_in_plate};

use super::still_poses::difference;

/// Table 11, the fourth row as meant.
const TABLE_11: [&[[f64; 2]]; 4] = [
    &[[28.5, -14.5], [-29.1, 15.5]],
    &[[28.9, 16.0], [-29.1, 15.5], [1.7, -31.9]],
    &[[-28.9, 16.0], [14.1, 26.5], [28.2, -15.0], [-19.5, -24.1]],
    &[[-29.1, 15.5], [-2.7, 30.9], [27.7, -16.0], [-19.0, -24.4], [29.1, 15.5]],
];
const PRINTED_4: &[[f64; 2]] = &[[-28.9, 16.0], [14.1, 26.5], [28.2, -25.0], [-19.5, -24.1]];
/// CNT, and CNR lying and standing, of which the last is missing.
const TABLE_12: [(f64, f64, Option<f64>); 4] =
    [(3.52, 13.0, Some(13.9)), (2.99, 1.7, Some(1.8)), (3.27, 1.8, Some(1.9)), (3.25, 1.8, None)];

/// Returns the table.
pub fn table() -> String {
    let mut text = "| n | largest tilt | stacked [F] | normal matrix | CNT printed | difference | relative, \
                    normal matrix | CNR printed (lying, standing) | difference \
                    |\n|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for ((poses, printed), n) in TABLE_11.into_iter().zip(TABLE_12).zip(2..) {
        if n == 4 {
            text += &row("4, third pitch −25° as printed", PRINTED_4, printed);
            text += &row("4, −15° as meant", poses, printed);
        } else {
            text += &row(&n.to_string(), poses, printed);
        }
    }
    text
}

fn row(name: &str, poses: &[[f64; 2]], (cnt, cnr, standing): (f64, f64, Option<f64>)) -> String {
    let ups: Vec<_> = poses.iter().map(|p| up_in_plate(p.map(f64::to_radians))).collect();
    let normal = condition_number(&normal_matrix(ups.iter().copied()));
    let relative = condition_number(&relative_normal_matrix(&ups, &Vector3::z()));
    let tilt = ups.iter().map(|u| u.z.acos().to_degrees()).fold(0.0, f64::max);
    format!(
        "| {name} | {tilt:.1}° | {:.3} | {normal:.3} | {cnt} | {} | {relative:.2} | {cnr}, {} | {} |\n",
        normal.sqrt(),
        difference(normal, cnt, 3),
        standing.map_or("–".to_owned(), |c| c.to_string()),
        difference(relative, cnr, 2),
    )
}
