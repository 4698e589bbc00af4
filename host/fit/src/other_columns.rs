//! The samples of a source with other columns: those of errors, or what given parameters predict.

use rigident_shared::screening::Rejection;

use super::{Channel, Parameter, RowSource, SampleRows, Timing};

/// Writes the rows of a sample.
type Write<'a> = dyn Fn(usize, &mut SampleRows) -> Result<(), Rejection> + Send + Sync + 'a;

/// A source with the samples, times and channels of another, and columns of its own.
pub struct OtherColumns<'a> {
    source: &'a dyn RowSource,
    parameters: Vec<Parameter>,
    write: Box<Write<'a>>,
}

impl<'a> OtherColumns<'a> {
    /// Returns the source whose rows over `parameters` are written by `write`.
    pub fn new(
        source: &'a dyn RowSource,
        parameters: Vec<Parameter>,
        write: impl Fn(usize, &mut SampleRows) -> Result<(), Rejection> + Send + Sync + 'a,
    ) -> Self {
        Self { source, parameters, write: Box::new(write) }
    }
}

impl RowSource for OtherColumns<'_> {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn channels(&self) -> &[Channel] {
        self.source.channels()
    }

    fn timing(&self) -> Timing {
        self.source.timing()
    }

    fn samples(&self) -> usize {
        self.source.samples()
    }

    fn time_ns(&self, sample: usize) -> u64 {
        self.source.time_ns(sample)
    }

    fn rows(&self, sample: usize, rows: &mut SampleRows) -> Result<(), Rejection> {
        (self.write)(sample, rows)
    }
}
