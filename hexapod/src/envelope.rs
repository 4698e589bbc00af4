//! The quintic that motions begin and end with.

/// Returns the quintic from 0 to 1 with its first and second derivatives; its first two derivatives vanish at
/// both ends.
pub(super) fn quintic(s: f64) -> [f64; 3] {
    if s <= 0.0 {
        return [0.0; 3];
    }
    if s >= 1.0 {
        return [1.0, 0.0, 0.0];
    }
    let r = 1.0 - s;
    [s * s * s * (10.0 + s * (6.0 * s - 15.0)), 30.0 * s * s * r * r, 60.0 * s * r * (1.0 - 2.0 * s)]
}

/// Returns the integral of the quintic from 0 to `s`, and the quintic itself with its derivatives.
pub fn quintic_integral(s: f64) -> (f64, [f64; 3]) {
    let c = s.clamp(0.0, 1.0);
    (c * c * c * c * (2.5 + c * (c - 3.0)) + (s - 1.0).max(0.0), quintic(s))
}

/// Returns the largest first, second and third derivatives of the quintic over `ramp` seconds: `15/8`,
/// `10/√3` and 60, by the powers of the ramp.
pub(super) fn envelope_peaks(ramp: f64) -> [f64; 3] {
    [1.875 / ramp, 10.0 / (3.0_f64.sqrt() * ramp * ramp), 60.0 / (ramp * ramp * ramp)]
}

/// Returns the envelope, up over `ramp`, one, down over `ramp`: value and derivatives in seconds.
pub(super) fn envelope(t: f64, duration: f64, ramp: f64) -> [f64; 3] {
    let down = duration - t;
    if t < ramp {
        let [a, b, c] = quintic(t / ramp);
        [a, b / ramp, c / (ramp * ramp)]
    } else if down < ramp {
        let [a, b, c] = quintic(down / ramp);
        [a, -b / ramp, c / (ramp * ramp)]
    } else {
        [1.0, 0.0, 0.0]
    }
}
