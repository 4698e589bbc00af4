//! Whether a recording can be true: one judgement for one body and for trees.
//!
//! Beside what contradicts the rig file or a rigid body ([`super::checks`]): bodies that cannot be
//! ([`super::physical_consistency`]), friction and rotors with the wrong sign, measurements that the model
//! does not explain and that are no noise, torques that are far from those of the nominal model in scale
//! alone. Each is false of less than one honest recording in a thousand.

use nalgebra::DVector;

use super::context::Links;
use super::drive_signs::negative;
use super::states::{is_whole_body, nominal_base};
use rigident_fit::figures::significant;
use rigident_fit::{ChannelFit, Fit};
use rigident_model::check::{DENSEST, least_density};

/// Of a channel's variation a model that holds leaves less than this beyond the noise, both as standard
/// deviations.
const UNEXPLAINED: f64 = 0.3;
/// Of the effort of a drive with friction: a real gear leaves more than that of a wrist, whose friction is
/// most of its effort.
const UNEXPLAINED_EFFORT: f64 = 0.6;
/// Cross-talk and tilt leave less than this of a channel of still poses whose residuals follow gravity along
/// other axes.
const CROSSED: f64 = 0.15;
/// Noise of a force's three axes is of one size: it leaves less than this many times what it leaves of the
/// quietest, of this many still poses or more.
const UNLIKE: f64 = 10.0;
const UNLIKE_POSES: usize = 8;
/// No body on a load cell has its centre of mass further away, m.
const FURTHEST_M: f64 = 10.0;
/// If a channel varies by fewer than this many σ of its noise, noise alone may leave that much: a tenth
/// more of it than stated leaves √0.21 σ, 23 % of two σ.
const STILL: f64 = 2.0;
/// Torques this many times those of the nominal model are in another unit: no estimate of a designer's is so
/// far off,
const SCALE: f64 = 5.0;
/// where they are alike but for the scale: the cosine of the angle between the two.
const ALIKE: f64 = 0.9;

/// Returns in words what of a fit cannot be true, beside what contradicts the rig file.
pub(super) fn of_the_fit(fit: &Fit) -> Vec<String> {
    let of_body = far_away(fit).or_else(|| too_dense(fit));
    negative(fit).into_iter().chain(unexplained(fit)).chain(of_body).collect()
}

/// Tells of a body whose centre of mass is further from the load cell than any that one carries.
fn far_away(fit: &Fit) -> Option<String> {
    let data = fit.data_alone();
    if !is_whole_body(fit) || !(0..4).all(|j| data.is_determined(j)) {
        return None;
    }
    let [m, x, y, z, ..] = *data.unjudged().values else { return None };
    let far_m = (x * x + y * y + z * z).sqrt() / m.abs();
    (far_m > FURTHEST_M).then(|| {
        format!(
            "the centre of mass would be {} m from the load cell's origin: are the moments in N m, and the \
             forces in N?",
            significant(far_m, 3)
        )
    })
}

/// Tells of one body that would have to be denser than any matter, its moments of inertia larger by twice
/// their uncertainty.
fn too_dense(fit: &Fit) -> Option<String> {
    let data = fit.data_alone();
    if !is_whole_body(fit) || !(0..10).all(|j| data.is_determined(j)) {
        return None;
    }
    let mut ten: [f64; 10] = data.unjudged().values.get(..10)?.try_into().ok()?;
    let larger = 2.0 * (4..7).map(|j| data.u95(j)).fold(0.0, f64::max);
    ten[4..7].iter_mut().for_each(|moment| *moment += larger);
    let density = least_density(&ten);
    (ten[0] > 0.0 && density.is_finite() && density > DENSEST).then(|| {
        format!(
            "a body of {} kg with these moments of inertia would have to be denser than osmium ({} kg/m³): \
             are the forces in N, the moments in N m, the rates in rad/s?",
            significant(ten[0], 4),
            significant(density, 2)
        )
    })
}

/// Returns the standard deviation of what the model leaves of a channel beyond its noise, as a share of what
/// varies, and the share that it stays below in an honest recording.
fn share(fit: &Fit, number: usize, channel: &ChannelFit) -> Option<[f64; 2]> {
    // Of a force or moment along one axis what the largest of the three varies by.
    let group = || fit.channels.iter().filter(|other| other.channel.group == channel.channel.group);
    let varies = group().map(|other| other.measured_sd).fold(0.0, f64::max);
    let quietest = group().map(|other| other.residual_rms).fold(f64::INFINITY, f64::min);
    if fit.residuals.is_empty() || varies <= 0.0 {
        return None;
    }
    let own = match (channel.noise_floor, channel.channel.sigma) {
        (_, Some(stated)) => stated.max(channel.noise_floor),
        (floor, None) if floor > 0.0 => floor,
        // Still poses, of which no differences tell the noise.
        _ if fit.filter.width_s == 0.0 => {
            let is_crossed = fit.lack_of_fit.crossed.contains(&number);
            let share = channel.residual_rms / varies;
            let is_force = channel.channel.unit == "N";
            let is_unlike =
                is_force && fit.residuals.len() >= UNLIKE_POSES && channel.residual_rms > UNLIKE * quietest;
            return is_crossed.then_some([share, CROSSED]).or(is_unlike.then_some([share, UNEXPLAINED]));
        }
        _ => 0.0,
    };
    let gain = fit.filter.noise_gain;
    if varies < STILL * gain.sqrt() * own {
        return None;
    }
    let signals = (channel.residual_sigma.powi(2) - gain * channel.sigma.powi(2)).max(0.0);
    let beyond = channel.residual_rms.powi(2) - gain * own * own - signals;
    let most = if channel.channel.is_drive() { UNEXPLAINED_EFFORT } else { UNEXPLAINED };
    Some([beyond.max(0.0).sqrt() / varies, most])
}

/// Returns false of still poses of which the model leaves more of a channel than any noise of a mean: a fault
/// that leaves as much is not the cause.
pub(crate) fn leaves_little_of_poses(fit: &Fit) -> bool {
    let varies = |group: u8| {
        let group = fit.channels.iter().filter(|other| other.channel.group == group);
        group.map(|other| other.measured_sd).fold(0.0, f64::max)
    };
    let is_explained = |own: &ChannelFit| own.residual_rms <= CROSSED * varies(own.channel.group);
    fit.filter.width_s > 0.0 || fit.channels.iter().all(is_explained)
}

/// Residuals of efforts whose autocorrelation makes intervals this many times as wide are no noise.
const NO_NOISE: f64 = 2.0;

/// Returns true if the model lacks something of the drives that is no noise, though the recording can be
/// true: only that no fault explains it says that it is the model, not the recording.
pub(crate) fn lacks_something_of_drives(fit: &Fit) -> bool {
    let poor = |(number, channel): (usize, &ChannelFit)| {
        channel.channel.is_drive()
            && (channel.autocorrelation.is_some_and(|found| found.factor > NO_NOISE)
                || share(fit, number, channel).is_some_and(|[share, _]| share > UNEXPLAINED))
    };
    fit.noise.model_error > 1.0 || fit.channels.iter().enumerate().any(poor)
}

/// Tells of channels that the model explains little of, where that is no noise.
fn unexplained(fit: &Fit) -> Option<String> {
    let mut limit = UNEXPLAINED;
    let mut poor = Vec::new();
    for (number, channel) in fit.channels.iter().enumerate() {
        let Some([share, most]) = share(fit, number, channel).filter(|[share, most]| share > most) else {
            continue;
        };
        limit = most.min(limit);
        poor.push(format!("{} {:.0} %", channel.channel.name, 100.0 * share));
    }
    (!poor.is_empty()).then(|| {
        format!(
            "the model leaves more of some channels than noise and {:.0} % of what they vary by (rms of what \
             is left beyond the noise, over the standard deviation of what is measured, of a wrench the \
             largest of three axes): {}",
            100.0 * limit,
            poor.join(", ")
        )
    })
}

/// Tells of base parameters that are those of the nominal model but for one large factor.
pub(crate) fn scaled(fit: &Fit, links: &Links) -> Option<String> {
    let nominal = nominal_base(links)?;
    let data = fit.data_alone();
    let factor = fit.scaled_factor();
    let count = nominal.len().min(fit.parameters.len());
    let marginal = factor.leading(count);
    let image = |values: &[f64]| marginal.r() * DVector::from_column_slice(&values[..count]);
    let (expected, found) = (image(&nominal), image(data.unjudged().values));
    let both = expected.dot(&found);
    let (scale, cosine) = (both / expected.norm_squared(), both / (expected.norm() * found.norm()));
    let far = !(1.0 / SCALE..=SCALE).contains(&scale.abs());
    (far && cosine.abs() > ALIKE && scale.is_finite()).then(|| {
        format!(
            "what is measured is that of the nominal model times {}: is it in another unit, or the model's \
             masses?",
            significant(scale, 3)
        )
    })
}
