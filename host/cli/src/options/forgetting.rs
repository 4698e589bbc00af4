use clap::Args;
use rigident_shared::forgetting::Span;

use crate::Failure;
pub(crate) use rigident::application::span::RowsOf;
use rigident::application::span::checked;

/// How long rows are remembered.
#[derive(Args, Debug, Clone, Default)]
pub struct Forgetting {
    /// For a body that changes: forget what the motion renews with this time constant, s; what it does not
    /// renew is kept. The answer is the one at the end, with the uncertainty of S seconds. With --until the
    /// run ends when what is remembered is that well known, which a short memory may never be
    #[arg(long, value_name = "S", conflicts_with = "window")]
    pub forget: Option<f64>,
    /// The answer of the last S seconds alone (of four fifths of it at least); where these did not move,
    /// nothing is identified. With --until as --forget
    #[arg(long, value_name = "S")]
    pub window: Option<f64>,
}

impl Forgetting {
    /// Returns the span asked for, unchecked.
    pub(crate) fn asked(&self) -> Option<Span<f64>> {
        self.forget.map(Span::TimeConstant).or(self.window.map(Span::Window))
    }

    /// Returns the span asked for; `None`: everything is retained, which an infinite one asks for too.
    ///
    /// # Errors
    /// Why it cannot be: bad input.
    pub(crate) fn span(&self, rows: &RowsOf) -> Result<Option<Span<f64>>, Failure> {
        Ok(checked(self.asked(), rows)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOVING: RowsOf = RowsOf { rate_hz: 1000.0, is_static: false };

    #[test]
    fn nonsense_is_refused_with_its_reason() {
        let said = |remember: Forgetting, rows: RowsOf| remember.span(&rows).unwrap_err().to_string();
        let forget = |s| Forgetting { forget: Some(s), window: None };
        let window = |s| Forgetting { forget: None, window: Some(s) };
        for s in [0.0, -3.0, f64::NAN] {
            assert!(said(forget(s), MOVING).contains("positive"));
            assert!(said(window(s), MOVING).starts_with("--window"));
        }
        assert!(said(forget(0.05), MOVING).contains("shorter than the filter"));
        // At 20 readings a second a block is 50 ms long.
        assert!(said(window(0.2), RowsOf { rate_hz: 20.0, ..MOVING }).contains("at least 0.45 s"));
        assert!(said(forget(10.0), RowsOf { is_static: true, ..MOVING }).contains("still poses"));
        assert_eq!(forget(10.0).span(&MOVING).unwrap(), Some(Span::TimeConstant(10.0)));
        assert_eq!(window(10.0).span(&MOVING).unwrap(), Some(Span::Window(10.0)));
        for endless in [forget(f64::INFINITY), window(f64::INFINITY), Forgetting::default()] {
            assert_eq!(endless.span(&MOVING).unwrap(), None);
        }
    }
}
