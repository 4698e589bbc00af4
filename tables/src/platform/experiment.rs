//! Still poses and motion together: what the factor predicts, what repeated experiments show, in both
//! mountings.

use std::sync::atomic::AtomicBool;

use rigident::study::{Campaign, Judgement, noise_and_gain_error_sensors};
use rigident_sim::rig::RigConfig;

/// k of a 95 % interval.
const K95: f64 = 1.96;

/// Returns the table.
pub fn table() -> String {
    let mut text =
        "| mounting | noise | rate, Hz | runs | U95 of the centre of mass, mm | U95 of the tensor \
                    about it, % of the largest moment: Ixx Iyy Izz | Iyz Izx Ixy | spread found / predicted \
                    |\n|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    for (name, config) in
        [("lying", RigConfig::thesis_horizontal()), ("standing", RigConfig::thesis_vertical())]
    {
        for (noise, rate_hz, runs) in
            [("white", 200.0, 2000), ("white", 1000.0, 500), ("and gain errors", 200.0, 500)]
        {
            let config = match noise {
                "white" => config.clone(),
                _ => config.clone().with_sensors(noise_and_gain_error_sensors()),
            };
            let campaign = Campaign { duration_s: 60.0, rate_hz, ..Campaign::new(config.clone()) };
            let prepared = campaign.prepare().expect("the experiment is a fixed one");
            let verdict =
                prepared.run(runs, 1, &AtomicBool::new(false), |_| ()).expect("it can be identified");
            let (com, tensor) = verdict.derived.split_at(3);
            let largest = config.body.inertia_com_kgm2.into_iter().fold(0.0, f64::max);
            let list = |judgements: &[Judgement], unit: f64, digits: usize| {
                let each = judgements.iter().map(|j| format!("{:.digits$}", K95 * j.std / unit));
                each.collect::<Vec<_>>().join(" ")
            };
            let ratios = verdict.parameters.iter().chain(&verdict.derived).map(|j| j.std / j.predicted_std);
            let (least, most) = ratios.fold((f64::INFINITY, 0.0_f64), |(l, m), r| (l.min(r), m.max(r)));
            text += &format!(
                "| {name} | {noise} | {rate_hz} | {runs} | {} | {} | {} | {least:.2}–{most:.2} |\n",
                list(com, 1e-3, 3),
                list(&tensor[..3], 0.01 * largest, 2),
                list(&tensor[3..], 0.01 * largest, 2),
            );
        }
    }
    text
}
