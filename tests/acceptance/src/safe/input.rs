//! Files and options that were once taken without a word.

mod commands;
mod configurations;
mod data;
mod outcome;
mod proofs;

use crate::report::Report;
use crate::scale::Scale;

const COMMAND: &str = "acceptance safe, input";

pub(crate) fn run(report: &mut Report, scale: Scale) {
    report.group("input: vectors need proof", COMMAND, proofs::run);
    report.group("input: robots and settings", COMMAND, configurations::run);
    report.group("input: data sets", COMMAND, |report| {
        data::run(report, scale)
    });
    report.group("input: commands", COMMAND, commands::run);
}
