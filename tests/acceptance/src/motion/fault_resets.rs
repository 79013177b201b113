//! Faults of the controller, which are reset and counted.

use std::collections::BTreeMap;

use shared_types::codes::{LoopFault, LoopState};
use tests::stack::{Part, Stack};

use crate::report::Report;

/// Faults, beside one in ten requests, after which a run ends.
const SOME_FAULTS: usize = 10;

/// Faults of the controller, which were reset: what was asked for before counts.
#[derive(Debug, Default)]
pub(super) struct Faults(BTreeMap<String, usize>);

impl Faults {
    /// Resets a fault, if the controller is in one, and counts it.
    pub(super) fn reset(&mut self, stack: &mut Stack) -> anyhow::Result<()> {
        let fault = stack.controller_state().fault;
        if fault != LoopFault::None {
            *self.0.entry(fault.to_string()).or_default() += 1;
            stack.clear_fault()?;
        }
        Ok(())
    }

    /// Waits until the robot rests, after so many requests, and resets a fault; an error where there were too many.
    pub(super) fn rest(&mut self, stack: &mut Stack, requests: usize) -> anyhow::Result<()> {
        stack.wait_for_state(&[LoopState::Holding, LoopState::Fault])?;
        self.reset(stack)?;
        let faults: usize = self.0.values().sum();
        anyhow::ensure!(
            faults <= SOME_FAULTS + requests / 10,
            "the controller was in fault too often ({:?}): {}",
            self.0,
            stack.process(Part::Controller).log()
        );
        Ok(())
    }

    /// None is allowed.
    pub(super) fn show(&self, report: &mut Report, line: &dyn Fn(&str) -> String) {
        report.check(
            &line("faults of the controller, which was reset: what was asked for before counts"),
            format!("{:?}", self.0),
            "none",
            self.0.is_empty(),
        );
    }
}
