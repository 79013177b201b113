//! An answer, read where the daemon wrote it.

use shared_types::ipc::PlanResponse;
use shared_types::message::{self, CandidateSummary, Knot};
use shared_types::valid::{Invalid, PlanReport};

/// An answer to a plan request; the knots stay in shared memory until it is dropped.
///
/// The report is a checked copy. The knots are the daemon's: [`shared_types::valid::check_knots`] before driving
/// anything with them.
#[derive(Debug)]
pub struct PlanAnswer {
    response: PlanResponse,
    report: PlanReport,
}

/// One certified motion of an answer.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<'answer> {
    /// The motion's figures.
    pub summary: &'answer CandidateSummary,
    /// The motion's knots.
    pub knots: &'answer [Knot],
}

impl PlanAnswer {
    pub(crate) fn new(response: PlanResponse) -> Result<Self, Invalid> {
        let report = PlanReport::try_new(response.user_header(), response.payload().len())?;
        Ok(Self { response, report })
    }

    /// What happened.
    #[must_use]
    pub fn report(&self) -> &PlanReport {
        &self.report
    }

    /// What happened, as the daemon wrote it: [`PlanAnswer::report`] is the checked copy.
    #[must_use]
    pub fn wire_report(&self) -> &message::PlanReport {
        self.response.user_header()
    }

    /// A candidate by its index, below [`PlanReport::candidates`]' length.
    #[must_use]
    pub fn candidate(&self, index: usize) -> Option<Candidate<'_>> {
        self.candidates().nth(index)
    }

    /// All candidates, by index.
    pub fn candidates(&self) -> impl ExactSizeIterator<Item = Candidate<'_>> {
        let summaries = self.report.candidates.iter().enumerate();
        summaries.map(|(index, summary)| Candidate {
            summary,
            knots: &self.response.payload()[self.report.knot_range(index)],
        })
    }

    /// The selected candidate.
    #[must_use]
    pub fn selected(&self) -> Option<Candidate<'_>> {
        self.candidate(self.report.selected?)
    }
}
