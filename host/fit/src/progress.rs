//! Progress of a long computation.

/// Receives what is being done.
pub trait Progress {
    /// Takes the name of the present stage and its share that is done, 0 to 1; zero where that is not known.
    fn stage(&self, name: &str, share: f64);
}

/// Nobody is informed.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _name: &str, _share: f64) {}
}

impl<F: Fn(&str, f64)> Progress for F {
    fn stage(&self, name: &str, share: f64) {
        self(name, share);
    }
}
