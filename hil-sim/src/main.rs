//! `rigident-sim`.
fn main() {}
