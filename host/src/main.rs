//! `rigident`.
fn main() {}
