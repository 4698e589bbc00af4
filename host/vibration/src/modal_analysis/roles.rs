//! The meaning of each component: a mode, or something that a mode's numbers must not be given for.

use nalgebra::DMatrix;

use super::amplitudes::Amplitudes;
use super::harmonics::combinations;
use super::input::Options;
use super::triangle::Pole;

/// Cycles below which a vibration is not distinguished from a drift.
pub(super) const LEAST_CYCLES: f64 = 1.5;
/// Standard deviations by which poles must differ for their shapes to be known one by one. Twice this is the
/// ratio of the difference to what bends the likelihood's parabola, on which the covariance rests.
pub(super) const APART: f64 = 8.0;
/// Damping ratio below which nothing decays: half the least one that is promised.
const UNDAMPED: f64 = 2.5e-4;
/// Strength by that of the stronger one, below which a component may be its harmonic or be beside it.
const WEAK: f64 = 0.05;
/// Strength by that of the stronger one, below which a component may be what a mode's change of frequency
/// leaves beside it.
const WEAK_BESIDE: f64 = 0.4;

/// The meaning of a component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// A mode.
    Mode,
    /// The component does not decay: a disturbance from outside.
    Disturbance,
    /// A multiple or sum of other frequencies.
    Harmonic,
    /// A decay beyond the number of modes, or outside the band.
    Other,
    /// The component is too close to another mode, the one with this number.
    TooClose(usize),
    /// The component is too slow for this recording.
    TooShort,
    /// A weak one beside the mode with this number: what its frequency's change, or an unknown mode, leaves
    /// there.
    Beside(usize),
}

/// Says what each component is.
pub(super) fn roles(
    poles: &[Pole],
    amplitudes: &Amplitudes,
    strengths: &[f64],
    duration_s: f64,
    options: &Options,
) -> Vec<Role> {
    let count = poles.len();
    let mut roles = vec![Role::Mode; count];
    for (r, pole) in poles.iter().enumerate() {
        let outside = options.band_hz.is_some_and(|[low, high]| !(low..=high).contains(&pole.hz()));
        if pole.hz() * duration_s < LEAST_CYCLES {
            roles[r] = Role::TooShort;
        } else if outside {
            roles[r] = Role::Other;
        }
    }
    mark_undamped(&mut roles, amplitudes);
    mark_beside(&mut roles, poles, amplitudes, strengths, duration_s);
    mark_harmonics(&mut roles, poles, amplitudes, strengths, duration_s);
    let is_found = |role: &Role| matches!(role, Role::Mode | Role::TooClose(_) | Role::TooShort);
    let wanted = options.modes.unwrap_or(0);
    // Before and after pairs are examined: those that are taken back must be apart, too.
    take_back(&mut roles, strengths, wanted, is_found);
    mark_close(&mut roles, poles, amplitudes, strengths, duration_s);
    take_back(&mut roles, strengths, wanted, is_found);
    keep_strongest(&mut roles, strengths, options.modes.unwrap_or(options.most), is_found);
    roles
}

/// Marks components of no or negative damping, unless nothing decays at all.
fn mark_undamped(roles: &mut [Role], amplitudes: &Amplitudes) {
    let is_undamped = |r: usize| {
        let (_, sd) = amplitudes.deviations(r);
        let damping = amplitudes.damping[r];
        damping + 3.0 * sd < UNDAMPED && damping < 4.0 * sd || damping < -4.0 * sd
    };
    let undamped: Vec<bool> = (0..roles.len()).map(is_undamped).collect();
    if undamped.iter().all(|u| *u) {
        return;
    }
    for (role, undamped) in roles.iter_mut().zip(undamped) {
        if undamped && *role == Role::Mode {
            *role = Role::Disturbance;
        }
    }
}

/// Marks weak components at the frequency of a stronger one that decay as its product with a square does. A
/// frequency that changes with amplitudes squared, `ν + κ e^{−2βt}`, makes of `e^{iνt − αt}` to first order
/// such a part of decay `α + 2β`; `α + 4β` and `α + 6β` are of the second and third order.
fn mark_beside(
    roles: &mut [Role],
    poles: &[Pole],
    amplitudes: &Amplitudes,
    strengths: &[f64],
    duration_s: f64,
) {
    let modes: Vec<usize> = (0..roles.len()).filter(|r| roles[*r] == Role::Mode).collect();
    for r in &modes {
        let (angular_sd, damping_sd) = amplitudes.deviations(*r);
        let decay_sd = damping_sd * amplitudes.angular[*r];
        let stronger = |other: &&usize| strengths[*r] < WEAK_BESIDE * strengths[**other];
        let explains = |parent: &&usize| {
            let off = (poles[**parent].angular - poles[*r].angular).abs();
            let decays = |square: &usize| {
                let is_strong = strengths[*r] < WEAK_BESIDE * strengths[*square];
                let orders = [2.0, 4.0, 6.0].map(|k| poles[**parent].decay + k * poles[*square].decay);
                let is_near =
                    |wanted: &f64| (wanted - poles[*r].decay).abs() < 4.0 * decay_sd + 0.2 * wanted.abs();
                is_strong && orders.iter().any(is_near)
            };
            off < 4.0 * angular_sd + 1.5 / duration_s + poles[*r].decay && modes.iter().any(decays)
        };
        if let Some(parent) = modes.iter().filter(stronger).find(explains) {
            roles[*r] = Role::Beside(*parent);
        }
    }
}

/// Marks weak components at a multiple or sum of stronger ones, that decay as products of them do.
fn mark_harmonics(
    roles: &mut [Role],
    poles: &[Pole],
    amplitudes: &Amplitudes,
    strengths: &[f64],
    duration_s: f64,
) {
    let modes: Vec<usize> = (0..roles.len()).filter(|r| roles[*r] == Role::Mode).collect();
    for r in &modes {
        let stronger: Vec<usize> =
            modes.iter().copied().filter(|other| strengths[*r] < WEAK * strengths[*other]).collect();
        let (angular_sd, damping_sd) = amplitudes.deviations(*r);
        let decay_sd = damping_sd * amplitudes.angular[*r];
        let fits = combinations(poles, &stronger, strengths).iter().any(|c| {
            let off = (c.pole.angular - poles[*r].angular).abs();
            let decay_off = (c.pole.decay - poles[*r].decay).abs();
            off < 4.0 * angular_sd + 1.5 / duration_s + c.pole.decay.abs()
                && decay_off < 4.0 * decay_sd + 0.3 * c.pole.decay.abs()
        });
        if fits {
            roles[*r] = Role::Harmonic;
        }
    }
}

/// Pairs whose poles are not apart.
fn mark_close(
    roles: &mut [Role],
    poles: &[Pole],
    amplitudes: &Amplitudes,
    strengths: &[f64],
    duration_s: f64,
) {
    let count = roles.len();
    for i in 0..count {
        for j in i + 1..count {
            let both = matches!(roles[i], Role::Mode | Role::TooClose(_))
                && matches!(roles[j], Role::Mode | Role::TooClose(_));
            if !both {
                continue;
            }
            let reach = 1.5 * resolution_hz(poles, i, j, duration_s) * std::f64::consts::TAU;
            let is_near = (poles[i].angular - poles[j].angular).abs() < reach;
            let (weak, strong) = if strengths[i] < strengths[j] { (i, j) } else { (j, i) };
            if distance(amplitudes, i, j) < APART {
                roles[i] = Role::TooClose(j);
                roles[j] = Role::TooClose(i);
            } else if is_near && strengths[weak] < 0.1 * WEAK * strengths[strong] {
                roles[weak] = Role::Beside(strong);
            }
        }
    }
}

/// Takes a mark back if modes are missing: a weak component beside another or at a multiple or sum is then
/// one of them, the strongest first.
fn take_back(roles: &mut [Role], strengths: &[f64], wanted: usize, is_found: impl Fn(&Role) -> bool) {
    let found = roles.iter().filter(|role| is_found(role)).count();
    let is_weak = |r: &usize| matches!(roles[*r], Role::Beside(_) | Role::Harmonic);
    let mut beside: Vec<usize> = (0..roles.len()).filter(is_weak).collect();
    beside.sort_by(|a, b| strengths[*b].total_cmp(&strengths[*a]));
    for r in beside.into_iter().take(wanted.saturating_sub(found)) {
        roles[r] = Role::Mode;
    }
}

/// Leaves as many found ones as there are modes: the strongest.
fn keep_strongest(roles: &mut [Role], strengths: &[f64], wanted: usize, is_found: impl Fn(&Role) -> bool) {
    let mut found: Vec<usize> = (0..roles.len()).filter(|r| is_found(&roles[*r])).collect();
    found.sort_by(|a, b| strengths[*b].total_cmp(&strengths[*a]));
    for r in found.into_iter().skip(wanted) {
        roles[r] = Role::Other;
    }
}

/// Returns the difference of two poles by its covariance: `√(Δᵀ C⁻¹ Δ)` for Δ of (ω, ζ).
pub(super) fn distance(amplitudes: &Amplitudes, i: usize, j: usize) -> f64 {
    let stride = amplitudes.stride();
    let places = [i * stride, i * stride + 1, j * stride, j * stride + 1];
    let block = amplitudes.covariance.select_rows(&places).select_columns(&places);
    let to = DMatrix::from_row_slice(2, 4, &[1.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0]);
    let difference = nalgebra::DVector::from_row_slice(&[
        amplitudes.angular[i] - amplitudes.angular[j],
        amplitudes.damping[i] - amplitudes.damping[j],
    ]);
    let covariance = &to * block * to.transpose();
    covariance.try_inverse().map_or(f64::INFINITY, |inverse| {
        (difference.transpose() * inverse * &difference)[(0, 0)].max(0.0).sqrt()
    })
}

/// Returns what length and decay of two components resolve, Hz: `√(1/T² + (ᾱ/π)²)`.
pub(super) fn resolution_hz(poles: &[Pole], i: usize, j: usize, duration_s: f64) -> f64 {
    let decay = 0.5 * (poles[i].decay + poles[j].decay).max(0.0);
    (1.0 / duration_s).hypot(decay / std::f64::consts::PI)
}
