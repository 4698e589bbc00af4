//! What a person reads of a result: a page and a table.
//!
//! Lives here: rounding to the uncertainty ([`text`]), the terminal's table ([`table`]), the self-contained
//! HTML page with its plots ([`html`], [`html_of_tree`]), normal probability plots ([`probability`]), the map of a [`workspace`] and the plain data they are made of ([`ReportData`]). May not live here:
//! estimation, files, the JSON object. Before this: [`crate::answer`].

mod data;
mod envelope;
mod figures;
mod html;
mod page;
pub mod plain;
mod plot;
pub mod probability;
mod quantities;
mod series;
pub mod table;
pub mod text;
mod tree;
pub mod workspace;

pub use data::{
    Along, Convergence, Decided, Drift, FrameResults, NearestBody, PrincipalAxis, Quantity, ReportData,
    Residual, Results, Source, Stage, Status, TimePlot,
};
pub use envelope::envelope;
pub use html::report;
pub use page::html;
pub use series::Series;
pub use tree::{ChannelRow, FullRow, LinkRows, TreeReport, html_of_tree};
