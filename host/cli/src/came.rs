use rigident::answer::result::ExperimentSummary;

/// The point to which an experiment that decides for itself proceeded.
pub(super) struct Came {
    pub(super) summary: ExperimentSummary,
    /// Why what was asked for is not reached, and what is; `None` if it is.
    pub(super) why: Option<String>,
}
