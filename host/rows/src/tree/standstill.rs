//! Drives that are at rest: dry friction has the sign of the rate, and at rest it is anything of its size.
//!
//! A drive that turns by no more than the noise of its rate may be at rest, and friction there balances
//! whatever acts: the effort of such a joint tells of neither its friction nor its links, but that together
//! they are no more than it. Its rows are left out, those under the filter with it, while the other joints'
//! stay. A reversal is none: in the time examined the rate grows beyond its noise, and what is not known of
//! its sign then is noise of a signal like any other.

use super::polynomial::Polynomial;
use super::{Input, SignalKind};
use rigident_fit::filter_width_s;

/// A drive is at rest where the root mean square of its rate, over the filter's width, is at most this many
/// standard deviations of the rate's noise: of nine samples noise alone exceeds that four times in 1e5.
const STILL_SD: f64 = 2.0;
/// It is at rest, too, where that is at most this share of the root mean square of its rate throughout: noise
/// far below that is not seen in its readings, and a reversal is as slow only in a motion that takes a
/// quarter of an hour.
const STILL_SHARE: f64 = 1e-3;

/// A drive that is at rest for more than this share of the recording never moves.
const ALWAYS: f64 = 0.99;

/// Marks the drives with dry friction that are at rest, by frames, and says which do for how long. One that
/// never moves has rows and zeros in these columns: nothing tells of them.
pub(super) fn mark(input: &mut Input) -> Vec<String> {
    if input.is_static || !input.has_efforts() {
        return Vec::new();
    }
    let names = input.freedom_names();
    let sigma = rate_sigma(input);
    let window = ((filter_width_s(input.rate_hz) * input.rate_hz).round() as usize).max(1);
    let longest_ns = (1.5 * window as f64 / input.rate_hz * 1e9) as u64;
    let (mut said, mut never) = (Vec::new(), Vec::new());
    for drive in input.drives.iter_mut().filter(|drive| drive.terms.iter().any(|term| term.is_dry())) {
        let square = |(k, factor): &(usize, f64)| (factor * sigma.get(*k).copied().unwrap_or(0.0)).powi(2);
        let noise = STILL_SD.powi(2) * drive.rates.iter().map(square).sum::<f64>();
        let squares: Vec<f64> = input.frames.iter().map(|frame| drive.rate(&frame.rates).powi(2)).collect();
        let usual = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        let limit = noise.max(STILL_SHARE.powi(2) * usual) * window as f64;
        let mut stands = vec![false; squares.len()];
        for (first, own) in squares.windows(window).enumerate() {
            let times = input.frames.get(first).zip(input.frames.get(first + window - 1));
            let is_whole = times.is_some_and(|(a, b)| b.time_ns.saturating_sub(a.time_ns) < longest_ns);
            if is_whole && own.iter().sum::<f64>() <= limit {
                stands.iter_mut().skip(first).take(window).for_each(|stands| *stands = true);
            }
        }
        let count = stands.iter().filter(|stands| **stands).count();
        if count as f64 > ALWAYS * stands.len() as f64 {
            drive.stands = true;
            never.push(drive.name.clone());
            continue;
        }
        for (frame, _) in input.frames.iter_mut().zip(&stands).filter(|(_, stands)| **stands) {
            for (freedom, _) in drive.rates.iter().filter(|(k, _)| *k < names.len()) {
                if !frame.standing.contains(freedom) {
                    frame.standing.push(*freedom);
                }
            }
        }
        if count > 0 {
            said.push(format!("{} {:.1} s", drive.name, count as f64 / input.rate_hz));
        }
    }
    let mut notes = Vec::new();
    if !said.is_empty() {
        notes.push(format!(
            "standing still, within the noise of the rate: {}; dry friction is then anything of its size, so \
             that these joints' efforts were left out there (`friction` JOINT=none keeps them)",
            said.join(", ")
        ));
    }
    if !never.is_empty() {
        notes.push(format!(
            "never moving: {}; nothing tells of dry friction there, and if there is any, efforts that hold \
             these joints are taken for their links' (`lock` leaves them out)",
            never.join(", ")
        ));
    }
    notes
}

/// Returns 1 σ of the rate of every freedom, rad/s or m/s.
fn rate_sigma(input: &Input) -> Vec<f64> {
    let slope = Polynomial::new(input.rate_hz).slope_noise();
    let of = |link: usize, kind: SignalKind| {
        let own = input.signals.iter().find(|signal| signal.link == link && signal.kind == kind);
        own.map_or(0.0, |signal| signal.size())
    };
    let links = input.model.links.iter().enumerate().skip(1);
    links
        .flat_map(|(i, link)| {
            let of_joint = of(i, SignalKind::Rate).max(slope * of(i, SignalKind::PositionWithSlope));
            let gyros = of(i, SignalKind::Gyro).hypot(of(link.link.parent, SignalKind::Gyro));
            let is_turned = input.signals.iter().any(|s| s.link == i && s.kind == SignalKind::Attitude);
            let own = if is_turned { gyros } else { of_joint };
            std::iter::repeat_n(own, link.link.joint.freedoms())
        })
        .collect()
}
