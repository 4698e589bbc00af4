use super::*;

const RATE_HZ: f64 = 200.0;
const ROWS: usize = 4000;

fn time_ns() -> Vec<u64> {
    (0..ROWS as u64).map(|row| row * 5_000_000).collect()
}

/// Repeats itself, of unit variance.
fn noise(k: usize) -> f64 {
    let mut z = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mut sum = 0.0;
    for _ in 0..12 {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9).wrapping_add(0x94d0_49bb_1331_11eb);
        sum += ((z >> 11) as f64) / (1_u64 << 53) as f64 - 0.5;
    }
    sum
}

/// A base and a link that turn every way: attitude of the link in S and both rates, their noise given.
struct Motion {
    world: Vec<[f64; 4]>,
    attitudes: Vec<[f64; 4]>,
    link: Vec<Vector3<f64>>,
    base: Vec<Vector3<f64>>,
}

fn numbers(q: UnitQuaternion<f64>) -> [f64; 4] {
    [q.w, q.i, q.j, q.k]
}

fn motion(size: f64, attitude_noise: f64, rate_noise: f64) -> Motion {
    let turn = |t: f64, f: f64, size: f64| {
        UnitQuaternion::from_scaled_axis(
            Vector3::new((3.1 * f * t).sin(), (2.3 * f * t + 1.0).sin(), (1.7 * f * t + 2.0).sin()) * size,
        )
    };
    let (base_at, link_at) = (|t: f64| turn(t, 0.9, 0.6), |t: f64| turn(t, 1.3, 0.3 + size));
    // Body rate by a central difference of ten microseconds: q⁻¹ dq.
    let rate = |at: &dyn Fn(f64) -> UnitQuaternion<f64>, t: f64| {
        (at(t - 1e-5).inverse() * at(t + 1e-5)).scaled_axis() / 2e-5
    };
    let mut k = 0;
    let mut random = |size: f64| {
        k += 3;
        Vector3::new(noise(k), noise(k + 1), noise(k + 2)) * size
    };
    let mut out = Motion { world: vec![], attitudes: vec![], link: vec![], base: vec![] };
    for row in 0..ROWS {
        let t = row as f64 / RATE_HZ;
        let wobble = UnitQuaternion::from_scaled_axis(random(attitude_noise));
        out.world.push(numbers(link_at(t)));
        out.attitudes.push(numbers(base_at(t).inverse() * link_at(t) * wobble));
        out.link.push(rate(&link_at, t) + random(rate_noise));
        out.base.push(rate(&base_at, t) + random(rate_noise));
    }
    out
}

fn judged(
    attitudes: &[[f64; 4]],
    rate: &[Vector3<f64>],
    base: Option<&[Vector3<f64>]>,
) -> Option<Disagreement> {
    let mounting = UnitQuaternion::identity();
    let turning = Turning { number: 1, name: "arm", attitudes, rate, base, mounting };
    turning.disagreement(&Spans::new(&time_ns(), RATE_HZ))
}

#[test]
fn attitudes_and_gyros_of_one_motion_agree_noisy_biased_signed_at_will_or_at_rest() {
    for (attitude, rate) in [(0.0, 0.0), (0.01, 0.05), (0.05, 0.2)] {
        let m = motion(0.5, attitude, rate);
        assert_eq!(judged(&m.attitudes, &m.link, Some(&m.base)), None, "{attitude} {rate}");
        let biased: Vec<_> = m.link.iter().map(|w| w + Vector3::new(0.05, -0.05, 0.02)).collect();
        assert_eq!(judged(&m.attitudes, &biased, Some(&m.base)), None);
        let flipped: Vec<_> = m
            .attitudes
            .iter()
            .enumerate()
            .map(|(k, q)| if k % 2 == 0 { *q } else { q.map(|v| -v) })
            .collect();
        assert_eq!(judged(&flipped, &m.link, Some(&m.base)), None);
    }
    // Nothing moves: what there is is noise and bias.
    let still: Vec<_> = (0..ROWS)
        .map(|k| {
            numbers(UnitQuaternion::from_scaled_axis(
                Vector3::new(noise(3 * k), noise(3 * k + 1), noise(3 * k + 2)) * 0.02,
            ))
        })
        .collect();
    let gyro: Vec<_> = (0..ROWS).map(|k| Vector3::new(0.1, 0.05 * noise(k), -0.1)).collect();
    assert_eq!(judged(&still, &gyro, None), None);
}

#[test]
fn errors_of_unit_order_and_reference_are_named() {
    let m = motion(0.5, 0.01, 0.02);
    let degrees = |rates: &[Vector3<f64>]| rates.iter().map(|w| w * DEGREES).collect::<Vec<_>>();
    let inverse: Vec<_> = m.attitudes.iter().map(|[w, x, y, z]| [*w, -x, -y, -z]).collect();
    let last: Vec<_> = m.attitudes.iter().map(|[w, x, y, z]| [*x, *y, *z, *w]).collect();
    let base = Some(m.base.as_slice());
    let (link_degrees, base_degrees) = (degrees(&m.link), degrees(&m.base));
    for (found, word) in [
        (judged(&inverse, &m.link, base), "q1_… seems to be the inverse"),
        (judged(&last, &m.link, base), "scalar part last"),
        (judged(&m.world, &m.link, base), "relative to the world"),
        (judged(&m.attitudes, &link_degrees, base), "imu1_gx_radps … seem to be in deg/s, 180/π"),
        (
            judged(&m.attitudes, &m.link, Some(&base_degrees)),
            "imu0_gx_radps … (imu_gx_radps …) seem to be in deg/s",
        ),
    ] {
        let found = found.unwrap_or_else(|| panic!("{word}"));
        // The base moves less than the link.
        assert!(found.is_gross() || word.contains("world"), "{found:?}");
        let cause = found.cause.clone().unwrap_or_default();
        assert!(cause.contains(word) && !cause.contains("; and "), "{word}: {found:?}");
    }
    let both = judged(&inverse, &link_degrees, base).unwrap().cause.unwrap();
    assert!(both.contains("the inverse") && both.contains("; and imu1"), "{both}");
    // An attitude that stays where it is fits nothing.
    let frozen = judged(&vec![[1.0, 0.0, 0.0, 0.0]; ROWS], &m.link, base).unwrap();
    assert!(frozen.is_gross() && frozen.cause.is_none(), "{frozen:?}");
}

#[test]
fn axes_of_an_imu_that_are_turned_are_named_with_their_rotation() {
    let m = motion(0.5, 0.01, 0.02);
    let x = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, std::f64::consts::PI));
    let turned: Vec<_> = m.link.iter().map(|w| x.inverse() * w).collect();
    let found = judged(&m.attitudes, &turned, Some(&m.base)).unwrap();
    let cause = found.cause.clone().unwrap();
    assert!(found.is_gross() && cause.contains("turned by 180°"), "{found:?}");
    assert!(cause.contains("1.000]"), "{cause}");
}

#[test]
fn a_joint_s_positions_and_rates_are_compared_and_factors_named() {
    let spans = Spans::new(&time_ns(), RATE_HZ);
    let t = |row: usize| row as f64 / RATE_HZ;
    let positions: Vec<f64> = (0..ROWS).map(|k| (2.0 * t(k)).sin() + 1e-4 * noise(k)).collect();
    let rates: Vec<f64> = (0..ROWS).map(|k| 2.0 * (2.0 * t(k)).cos() + 1e-2 * noise(k + 7)).collect();
    let names = ["a_rad", "a_radps"];
    let by = |p: f64, r: f64, slides| {
        let scaled = |values: &[f64], by: f64| values.iter().map(|v| v * by).collect::<Vec<f64>>();
        joint_disagreement(&spans, &scaled(&positions, p), &scaled(&rates, r), slides, names)
    };
    assert_eq!(by(1.0, 1.0, false), None);
    assert_eq!(by(1.0, 1.0, true), None);
    for (p, r, slides, word) in [
        (1.0, DEGREES, false, "a_radps seems to be in deg/s, 180/π"),
        (DEGREES, 1.0, false, "a_rad seems to be in deg, 180/π"),
        (1.0, -1.0, false, "a_radps has the opposite sign of a_rad"),
        (1.0, -DEGREES, false, "a_radps has the opposite sign"),
        (1e3, 1.0, true, "a_rad seems to be in mm"),
        (1.0, 9.0, false, "changes by 0.1111 times"),
    ] {
        let found = by(p, r, slides).unwrap();
        assert!(found.is_gross() && found.cause.as_ref().unwrap().contains(word), "{word}: {found:?}");
    }
    // Of a joint that is held with noise on it nothing is said.
    let held: Vec<f64> = (0..ROWS).map(|k| 0.4 + 1e-2 * noise(k)).collect();
    let noisy: Vec<f64> = (0..ROWS).map(|k| 1e-2 * noise(k + 5)).collect();
    assert_eq!(joint_disagreement(&spans, &held, &noisy, false, names), None);
    // Another joint's rates fit by no factor.
    let other: Vec<f64> = (0..ROWS).map(|k| 3.0 * (3.3 * t(k)).cos()).collect();
    assert_eq!(joint_disagreement(&spans, &positions, &other, false, names).unwrap().cause, None);
}

#[test]
fn spans_do_not_cross_gaps() {
    let times: Vec<u64> =
        (0..100_u64).map(|row| row * 5_000_000 + if row >= 50 { 2_000_000_000 } else { 0 }).collect();
    let spans = Spans::new(&times, RATE_HZ);
    assert_eq!(spans.starts, [0, 20, 60]);
}
