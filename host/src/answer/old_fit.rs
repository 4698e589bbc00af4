//! Fits made of what the old engine of one body found: the answers must be the same.

use rigident_shared::inertia::{PARAMETER_NAMES, PARAMETER_UNITS};

use crate::fit::{
    Autocorrelation, BlockResidual, Channel, ChannelFit, Counts, Estimate, Factor, Filter, Fit, Kind,
    NoiseCheck, Owner, Parameter, Prior, PriorStatement,
};
use crate::identification::pooled::{RowSet, judge};
use crate::identification::whiteness::{Colour, WRENCH};
use crate::identification::{self, Identification};

fn autocorrelation(colour: &[Colour], channel: usize) -> Option<Autocorrelation> {
    let found = colour.iter().find(|c| c.channel == channel)?;
    Some(Autocorrelation { mean: found.autocorrelation, chance: found.chance, factor: found.factor })
}

fn fit(parameters: Vec<Parameter>, channels: Vec<ChannelFit>, factor: Factor, estimate: Estimate) -> Fit {
    Fit {
        parameters,
        channels,
        factor,
        estimate,
        solved: None,
        rounding: 1e-10,
        model_fingerprint: 0,
        fingerprints: Vec::new(),
        prior: None,
        noise: NoiseCheck {
            sigma_given: false,
            noise_gain: 1.0,
            variance_ratio: 1.0,
            variance_scale: 1.0,
            disagreement: None,
        },
        inflation: Vec::new(),
        signal_bias: Vec::new(),
        spurious_information: 0.0,
        residuals: Vec::new(),
        filter: Filter::default(),
        counts: Counts::default(),
        forgotten: None,
        convergence: Vec::new(),
    }
}

fn offset(channel: usize, frame: &str) -> Parameter {
    Parameter {
        name: PARAMETER_NAMES[10 + channel].to_owned(),
        owner: Owner::Channel(WRENCH[channel].to_owned()),
        kind: Kind::Offset,
        unit: PARAMETER_UNITS[10 + channel].to_owned(),
        frame: frame.to_owned(),
        made_of: Vec::new(),
    }
}

/// Returns the fit of one body.
pub fn of_body(found: &Identification, input: &identification::Input) -> Fit {
    let n = found.estimate.values.len();
    let kind =
        |j: usize| [Kind::Mass, Kind::FirstMoment, Kind::Inertia][usize::from(j > 0) + usize::from(j > 3)];
    let mut parameters: Vec<Parameter> = (0..10)
        .map(|j| Parameter {
            name: PARAMETER_NAMES[j].to_owned(),
            owner: Owner::Link(String::new()),
            kind: kind(j),
            unit: PARAMETER_UNITS[j].to_owned(),
            frame: "S".to_owned(),
            made_of: Vec::new(),
        })
        .collect();
    parameters.extend((0..n - 10).map(|c| offset(c, "S")));
    let channels = (0..6).map(|c| ChannelFit {
        channel: Channel {
            name: WRENCH[c].to_owned(),
            unit: if c < 3 { "N" } else { "N m" }.to_owned(),
            sigma: input.channel_sigma.map(|s| s[c]),
            gain_sigma: input.gain_sigma[c],
            offset: (n > 10).then_some(10 + c),
            group: u8::from(c > 2),
        },
        sigma: found.channel_sigma[c],
        residual_rms: found.residual_rms[c],
        measured_rms: 0.0,
        gain: found.gains[c],
        outliers: found.counters.knocks[c].into(),
        rejected: found.counters.rejected_by_channel[c].into(),
        residual_sigma: found.channel_sigma[c],
        autocorrelation: autocorrelation(&found.colour, c),
    });
    let factor = match &found.factor {
        identification::Factor::Ten(f) => Factor::from(&**f),
        identification::Factor::Sixteen(f) => Factor::from(&**f),
    };
    let rows =
        RowSet { rows: found.factor.rows(), noise_gain: found.noise_gain, sigma_given: found.sigma_given };
    let judged =
        judge(&[rows], found.factor.residual_sum_of_squares(), found.estimate.of_data_alone().rank() as f64);
    let estimate: Estimate = (*found.estimate).clone();
    let statements: Vec<PriorStatement> = found
        .estimate
        .known()
        .iter()
        .map(|k| PriorStatement {
            name: k.name(),
            parameter: k.parameter(),
            value: k.value(),
            sigma: k.sigma(),
            is_symmetry: k.is_symmetry(),
            free: Vec::new(),
            text: k.to_string(),
        })
        .collect();
    let data_alone = Box::new((**found.estimate.of_data_alone()).clone());
    let residuals = found.residuals.iter().map(|r| BlockResidual {
        time_s: r.time_s,
        values: r.residual.to_vec(),
        weights: Vec::new(),
    });
    Fit {
        prior: (!statements.is_empty()).then_some(Prior { statements, data_alone }),
        noise: NoiseCheck {
            sigma_given: found.sigma_given,
            noise_gain: found.noise_gain,
            variance_ratio: found.variance_ratio,
            variance_scale: judged.variance_scale,
            disagreement: None,
        },
        inflation: found.widening.clone(),
        spurious_information: found.regressor_noise.tensor_information,
        residuals: residuals.collect(),
        counts: Counts {
            samples: found.counters.readings.into(),
            rejected: found.counters.rejected.into(),
            rejected_by_signal: Vec::new(),
            gaps: 0,
            blocks: found.counters.blocks.into(),
        },
        ..fit(parameters, channels.collect(), factor, estimate)
    }
}
