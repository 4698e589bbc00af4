use super::*;
use crate::condition;
use crate::linearised::{Columns, Linearised};
use crate::{
    Basis, Channel, Effect, Filter, Kind, Nuisance, Owner, Parameter, RowSource, SampleCounts, SampleRows,
    Scope, Timing,
};
use rigident_shared::screening::Rejection;

/// Channels, parameters with one offset each, errors of signals.
const CHANNELS: usize = 6;
const PARAMETERS: usize = 7 + CHANNELS;
const SIGNALS: usize = 4;
/// Waves, and a one.
const FEATURES: usize = 9;
const BLOCKS: usize = 300;

/// Blocks whose rows are fixed sums of nine numbers; nothing comes for a while after the first hundred.
struct Waves {
    filter: Filter,
    counts: SampleCounts,
    parts: Vec<Range<usize>>,
    parameters: Vec<Parameter>,
    channels: Vec<Channel>,
}

/// Returns a pseudo-random number, from −1 to 1.
fn weight(k: usize) -> f64 {
    (1.0 + k as f64).powf(1.7).sin()
}

impl Waves {
    fn new() -> Self {
        let channel = |c: usize| format!("c{c}");
        let own = |j: usize| {
            let owner = Owner::Link(String::new());
            match j.checked_sub(PARAMETERS - CHANNELS) {
                None => Parameter::new(format!("p{j}"), owner, Kind::Inertia, "kg m2"),
                Some(c) => Parameter::new(format!("o{c}"), Owner::Channel(channel(c)), Kind::Offset, "N"),
            }
        };
        let channels = (0..CHANNELS).map(|c| Channel {
            name: channel(c),
            unit: "N".to_owned(),
            sigma: None,
            offset: Some(PARAMETERS - CHANNELS + c),
            group: 0,
        });
        Self {
            filter: Filter { rate_hz: 200.0, every: 2, ..Filter::default() },
            counts: SampleCounts::default(),
            parts: std::iter::once(0..BLOCKS).collect(),
            parameters: (0..PARAMETERS).map(own).collect(),
            channels: channels.collect(),
        }
    }
}

impl RowSource for Waves {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn timing(&self) -> Timing {
        Timing::Uniform { rate_hz: self.filter.rate_hz }
    }

    fn samples(&self) -> usize {
        0
    }

    fn time_ns(&self, _sample: usize) -> u64 {
        0
    }

    fn rows(&self, _sample: usize, _rows: &mut SampleRows) -> Result<(), Rejection> {
        Err(Rejection::NotFinite(0))
    }

    fn nuisances(&self) -> Vec<Nuisance> {
        let signals = (0..SIGNALS).map(Effect::Signal);
        let effects = signals.chain([
            Effect::Gain { channel: 1 },
            Effect::CrossTalk { from: 0, to: 4 },
            Effect::Drift { channel: 2, degree: 1 },
            Effect::Drift { channel: 3, degree: 2 },
        ]);
        let of = |(k, effect)| Nuisance {
            name: format!("error {k}"),
            group: "errors".to_owned(),
            unit: String::new(),
            sigma: 0.1,
            basis: Basis::Stated("a key".to_owned()),
            scope: Scope::Rig,
            effect,
        };
        effects.enumerate().map(of).collect()
    }
}

impl RowBlocks for Waves {
    fn filter(&self) -> &Filter {
        &self.filter
    }

    fn counts(&self) -> &SampleCounts {
        &self.counts
    }

    fn parts(&self) -> &[Range<usize>] {
        &self.parts
    }

    fn time_s(&self, block: usize) -> f64 {
        0.01 * block as f64 + if block > 100 { 0.3 } else { 0.0 }
    }

    fn write(&self, block: usize, rows: &mut [f64], measured: &mut [f64]) {
        let mut features = [0.0; FEATURES];
        self.write_features(block, &mut features);
        self.write_of(&features, rows, measured);
    }

    fn sensitivities(&self, block: usize, parameters: &[f64], out: &mut [f64]) -> bool {
        let mut features = [0.0; FEATURES];
        self.write_features(block, &mut features);
        self.sensitivities_of(&features, parameters, out);
        true
    }

    fn features(&self) -> usize {
        FEATURES
    }

    fn write_features(&self, block: usize, out: &mut [f64]) {
        let t = 0.01 * block as f64;
        for (k, to) in out.iter_mut().enumerate() {
            let wave = (std::f64::consts::TAU * (0.6 + 0.7 * k as f64) * t + k as f64).sin();
            *to = if k + 1 == FEATURES { 1.0 } else { 3.0 * wave };
        }
    }

    fn write_of(&self, features: &[f64], rows: &mut [f64], measured: &mut [f64]) {
        let sum = |place: usize| -> f64 {
            let own = features.iter().take(FEATURES - 1).enumerate();
            own.map(|(k, u)| weight(place * FEATURES + k) * u).sum()
        };
        for (c, (row, measured)) in rows.chunks_exact_mut(PARAMETERS).zip(measured).enumerate() {
            *measured = sum(1000 + c);
            for (j, to) in row.iter_mut().enumerate() {
                *to = match j.checked_sub(PARAMETERS - CHANNELS) {
                    None => sum(c * PARAMETERS + j),
                    Some(own) if own == c => features[FEATURES - 1],
                    Some(_) => 0.0,
                };
            }
        }
    }

    fn sensitivities_of(&self, features: &[f64], parameters: &[f64], out: &mut [f64]) {
        let predicted: f64 = parameters.iter().sum();
        for (place, to) in out.iter_mut().enumerate() {
            let own = features.iter().enumerate();
            *to = predicted * own.map(|(k, u)| weight(7000 + place * FEATURES + k) * u).sum::<f64>();
        }
    }
}

/// A covariance with correlated channels, and noise that rises with the frequency in two directions.
fn whitening() -> Whitening {
    let white =
        DMatrix::from_fn(
            6,
            6,
            |i, j| if i == j { 1.0 + 0.1 * i as f64 } else { 0.2 / (1.0 + (i + j) as f64) },
        );
    let j = DMatrix::from_fn(6, 2, |i, k| 3e-3 * ((1 + i) as f64 * (0.4 + k as f64)).cos());
    Whitening::of_spectrum(&white, &(&j * j.transpose()), 2.0, 0.01).unwrap()
}

/// The triangle of the features has all that the rows have: the same factor, by another way.
#[test]
fn factors_of_features_are_those_of_rows() {
    let blocks = Waves::new();
    let columns = Columns::of(&blocks);
    let phi: Vec<f64> = (0..PARAMETERS).map(|j| 3.0 / (1.0 + j as f64)).collect();
    let linearised = Linearised::new(&blocks, &blocks, &columns, &phi).unwrap();
    let (all, range) = (columns.all(), 3..blocks.len());
    for whitening in [whitening(), Whitening::diagonal(&[20.0, 21.0, 22.0, 300.0, 310.0, 320.0])] {
        let by_features = absorb(&linearised, range.clone(), all, &whitening);
        let by_rows = condition::absorb(&linearised, range.clone(), all, &whitening, None);
        let square = |factor: &Factor| factor.r().tr_mul(&factor.r());
        let (own, other) = (square(&by_features), square(&by_rows));
        for i in 0..all {
            for j in 0..all {
                let scale = (other[(i, i)] * other[(j, j)]).sqrt();
                assert!((own[(i, j)] - other[(i, j)]).abs() <= 1e-10 * scale, "{i} {j}");
            }
        }
        let pull = |factor: &Factor| factor.r().tr_mul(&nalgebra::DVector::from_column_slice(factor.z()));
        let whole = |factor: &Factor| {
            factor.z().iter().map(|z| z * z).sum::<f64>() + factor.residual_sum_of_squares()
        };
        assert!((pull(&by_features) - pull(&by_rows)).norm() < 1e-10 * pull(&by_rows).norm());
        assert!((whole(&by_features) / whole(&by_rows) - 1.0).abs() < 1e-10);
        assert_eq!(by_features.rows(), by_rows.rows());
    }
}

/// So has the Gram matrix.
#[test]
fn gram_matrices_of_features_are_those_of_rows() {
    let blocks = Waves::new();
    let columns = Columns::of(&blocks);
    let linearised = Linearised::new(&blocks, &blocks, &columns, &[0.5; PARAMETERS]).unwrap();
    let (whitening, all, count) = (whitening(), columns.all(), linearised.features());
    let mut features = vec![0.0; blocks.len() * count];
    features.chunks_exact_mut(count).enumerate().for_each(|(k, row)| linearised.write_features(k, row));
    let times: Vec<f64> = (0..blocks.len()).map(|k| blocks.time_s(k)).collect();
    let own = gram(&linearised, all, &whitening, &[(&times, &features)]);
    let r = condition::absorb(&linearised, 0..blocks.len(), all, &whitening, None).r();
    let other = r.tr_mul(&r);
    assert!((&own - &other).norm() < 1e-10 * other.norm());
}
