//! The answer about a tree as a page.

use super::Input;
use super::nearest::FullLink;
use super::result::{Answer, SENTENCE, body_of};
use crate::answer::result::Status;
use crate::present::text::significant;
use crate::present::{
    self, ChannelRow, FullRow, LinkRows, Quantity, Residual, Source, TreeReport, html_of_tree,
};

fn full_row(link: &FullLink) -> FullRow {
    let (mass_kg, com_m, inertia_com_kgm2) = body_of(link);
    FullRow { link: link.name.clone(), mass_kg, com_m, inertia_com_kgm2, distance: link.distance }
}

/// Whether each freedom slides.
fn slides(input: &Input) -> Vec<bool> {
    let links = input.model.links.iter().skip(1);
    links
        .flat_map(|l| {
            let slides = matches!(l.link.joint, rigident_shared::tree::Joint::Prismatic(_));
            std::iter::repeat_n(slides, l.link.joint.freedoms())
        })
        .collect()
}

impl Answer<'_> {
    /// The same as a page.
    pub fn page(&self) -> String {
        let found = self.found;
        let mut owners: Vec<LinkRows> = Vec::new();
        for (j, name) in found.names.iter().enumerate() {
            let (owner, own) = name.rsplit_once('.').unwrap_or(("wrench offset", name));
            if owners.last().is_none_or(|last| last.owner != owner) {
                owners.push(LinkRows { owner: owner.to_owned(), rows: Vec::new() });
            }
            let quantity = Quantity {
                name: own.to_owned(),
                unit: found.units[j].to_owned(),
                state: self.states[j],
                truth: None,
            };
            if let Some(last) = owners.last_mut() {
                last.rows.push((quantity, self.made_of(j)));
            }
        }
        let names = self.input.channels();
        let forces = if self.input.has_wrench() { 3 } else { 0 };
        let slides = slides(self.input);
        let unit = |c: usize| {
            let first = if self.input.has_wrench() { 6 } else { 0 };
            let force = c < forces || (c >= first && slides.get(c - first) == Some(&true));
            if force { "N" } else { "N m" }.to_owned()
        };
        let origin_s = self.input.frames.first().map_or(0.0, |f| f.time_ns as f64 * 1e-9);
        let last_s = self.input.frames.last().map_or(0.0, |f| f.time_ns as f64 * 1e-9);
        let time_of =
            |k: usize, time_s: f64| if self.input.is_static { k as f64 + 1.0 } else { time_s - origin_s };
        let times: Vec<f64> = found.residuals.iter().enumerate().map(|(k, r)| time_of(k, r.time_s)).collect();
        let mut facts = vec![
            ("rows".to_owned(), format!("{} for {} unknowns", found.factor.rows(), found.names.len())),
            ("frames used".to_owned(), format!("{} of {}", self.input.frames.len(), self.source.rows)),
        ];
        if found.estimate.condition_number.is_finite() {
            facts.push(("condition number".to_owned(), significant(found.estimate.condition_number, 3)));
        }
        facts.extend(
            found
                .widened()
                .map(|w| ("intervals wider for coloured noise by up to".to_owned(), format!("{w:.1}"))),
        );
        if let Some(full) = self.full {
            facts.push((
                "full parameters from the base parameters".to_owned(),
                format!("{:.2} standard deviations", full.distance_sd),
            ));
        }
        html_of_tree(&TreeReport {
            model: self.input.model.name.clone(),
            source: Source {
                body_name: String::new(),
                recording: self.source.recording.clone(),
                mcu: self.source.mcu.clone(),
                rate_hz: self.source.rate_hz,
                rows: self.source.rows as u64,
                duration_s: (!self.input.is_static).then_some(last_s - origin_s),
            },
            status: match self.status {
                Status::Identified => present::Status::Identified,
                Status::PartlyIdentified => present::Status::PartlyIdentified,
                Status::NotIdentified => present::Status::NotIdentified,
                Status::Failed => present::Status::Failed,
            },
            status_words: self.headline(),
            situation: format!(
                "{}; {} base parameters of {} standard ones.",
                self.input.situation.sentence(),
                found.base.parameters.len(),
                found.base.standard_count()
            ),
            owners,
            reasons: self.reasons.clone(),
            warnings: self.warnings.clone(),
            full_note: SENTENCE.to_owned(),
            full: self.full.map_or_else(Vec::new, |full| full.links.iter().map(full_row).collect()),
            channels: names
                .iter()
                .enumerate()
                .map(|(c, name)| ChannelRow {
                    name: name.clone(),
                    unit: unit(c),
                    residual_rms: found.residual_rms[c],
                    measured_rms: found.measured_rms[c],
                    sigma: found.residual_sigma[c],
                    colour: found
                        .colour
                        .iter()
                        .find(|colour| colour.channel == c)
                        .map(|colour| colour.factor),
                })
                .collect(),
            residuals: names
                .iter()
                .enumerate()
                .map(|(c, name)| Residual {
                    channel: name.clone(),
                    unit: unit(c),
                    time_s: times.clone(),
                    values: found.residuals.iter().map(|r| r.channels[c]).collect(),
                    sigma: found.residual_sigma[c],
                })
                .collect(),
            facts,
        })
    }
}
