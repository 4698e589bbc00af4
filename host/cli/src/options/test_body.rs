/// The two mountings of the thesis' test body.
#[derive(clap::ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DemoBody {
    /// Lying: centre of mass at 53 mm
    #[default]
    Horizontal,
    /// Standing: centre of mass at 247 mm
    Vertical,
}
